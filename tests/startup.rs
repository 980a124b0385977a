//! Starting up where it is hard: many slaves, short watchdogs, little time.

use std::fmt::Write as _;

use isodp::observation::Phase;
use isodp::study::scenario::{Scenario, ScenarioError};

use crate::support::Run;

/// Encoders from address 3 on, in a network of these times; more than 30 on two segments.
fn network(rate: &str, slaves: u8, t_dp: &str, t_o: &str, more: &str) -> Result<Scenario, ScenarioError> {
    let mut text = format!(
        "[run]\ncycles = 1000\n[bus]\nrate = \"{rate}\"\n[master]\naddress = 2\nt_dp = \"{t_dp}\"\nt_i = \"125 us\"\n\
         t_o = \"{t_o}\"\n{more}\n"
    );
    let device = "device = \"simodrive-sensor-isochron\"\n";
    if slaves > 30 {
        text = text.replace("[master]", "[master]\nsegment = \"a\"");
        text += "[[segment]]\nname = \"a\"\n[[segment]]\nname = \"b\"\n[[repeater]]\nfrom = \"a\"\nto = \"b\"\n";
        let _ = write!(text, "[[slave]]\naddresses = \"33..{}\"\nsegment = \"b\"\n{device}", slaves + 2);
        let _ = write!(text, "[[slave]]\naddresses = \"3..32\"\nsegment = \"a\"\n{device}");
    } else {
        let _ = write!(text, "[[slave]]\naddresses = \"3..{}\"\n{device}", slaves + 2);
    }
    Scenario::parse("network", "network.toml", &text, &[])
}
fn all_operate(scenario: &Scenario) {
    let counts = Run::of(scenario).counts.expect("counts");
    for slave in counts.slaves {
        assert_eq!((slave.phase, slave.fault_count()), (Phase::Operation, 0), "slave {}", slave.address);
    }
}

/// A slave whose Set_Prm is followed by the services of all the others would lose its watchdog before its Chk_Cfg.
#[test]
fn many_slaves_start_up_one_after_the_other() {
    all_operate(&network("12 Mbit/s", 58, "16 ms", "15 ms", "").unwrap_or_else(|error| panic!("{error}")));
}

/// A third of the watchdog's time is less than a cycle: the mode is told as often as possible, but not instead of all else.
#[test]
fn a_short_watchdog_leaves_time_to_start_up() {
    for watchdog in ["10 ms", "20 ms", "30 ms"] {
        let scenario = network("12 Mbit/s", 5, "8 ms", "7 ms", &format!("watchdog = \"{watchdog}\""));
        all_operate(&scenario.unwrap_or_else(|error| panic!("{error}")));
    }
}

/// Two slaves at 1.5 Mbit/s exchange their data in a cycle that has no time for the Set_Prm of the second.
#[test]
fn a_cycle_without_time_for_set_prm_is_refused() {
    let error = network("1.5 Mbit/s", 2, "1.25 ms", "1 ms", "").expect_err("no time").to_string();
    let expected = r#"
network.toml:7:8: master.t_dp: T_DP = 1.25 ms leaves slave 4 no time to start up
  7 | t_dp = "1.25 ms"
    |        ^^^^^^^^^
  rule: T_DP >= 1.271 ms: Data_Exchange with the others, its Set_Prm, token 46.667 us and Global_Control 120 us (manual 3.3.2: time reserved for acyclic services, Model: D6)
  help: the shortest is t_dp = "1.375 ms"
"#;
    assert_eq!(error, expected.trim());
    all_operate(&network("1.5 Mbit/s", 2, "1.375 ms", "1 ms", "").unwrap_or_else(|error| panic!("{error}")));
}
