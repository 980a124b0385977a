//! Acyclic traffic that takes longer than the cycle has room for.

use isodp::observation::{AcyclicResult, Disturbance, HandlerState, Observation, Phase};
use isodp::study::scenario::Scenario;
use isodp::time::Span;

use super::{bursts, changed, disturbed, prints, refused, tables};
use crate::support::{Run, address};

/// The scene at a quarter of its rate: about 750 us are left after Data_Exchange.
const TIGHT: &[(&str, &str)] = &[
    ("bus.rate", "3 Mbit/s"),
    ("master.t_dp", "1.5 ms"),
    ("master.t_o", "1.25 ms"),
    ("master.gc_jitter", "{ kind = \"none\" }"),
];

fn tight(disturbances: &[&str]) -> Scenario {
    changed(TIGHT, &tables(disturbances))
}
/// In which cycle SYNCH of the next one was late, and by how much.
fn late(run: &Run) -> Vec<(u64, Span)> {
    let by = |what: &Observation| if let Observation::ClockLate { by } = *what { Some(by) } else { None };
    run.events_of(2).filter_map(|row| Some((row.cycle, by(&row.what)?))).collect()
}
/// How many DS-Writes a master sent to the MS1 of a slave in one cycle, with so much data.
fn writes(run: &Run, (master, slave): (u8, u8), octets: u8, cycle: u64) -> usize {
    let head = |du: &[u8]| du.len() == usize::from(octets) + 15 && (du[4], du[5]) == (slave | 0x80, master | 0x80);
    let ms1 = |octets: &[u8]| octets[7..9] == [51, 51] && octets[9] == 0x5F;
    let mine = run.telegrams_in(cycle).filter(|(_, _, sender, _)| *sender == address(master));
    mine.filter(|(.., octets)| octets.len() > 20 && head(octets) && ms1(octets)).count()
}
fn results(run: &Run) -> Vec<AcyclicResult> {
    let result = |what: &Observation| match *what {
        Observation::AcyclicDone { result, .. } => Some(result),
        _ => None,
    };
    run.observations.iter().filter_map(|(.., what)| result(what)).collect()
}

#[test]
fn synch_is_late_by_what_the_message_takes_beyond_the_room() {
    let clean = tight(&[]);
    let quiet = Run::of(&clean);
    assert_eq!(late(&quiet), []);
    // From the end of Data_Exchange to SYNCH, in the cycles that have no GAP poll as in those that have one.
    let room = |cycle| {
        let start =
            |what: &Observation| matches!(what, Observation::CycleStart { cycle: begun, .. } if *begun == cycle);
        let from = quiet.observations.iter().position(|(.., what)| start(what)).expect("the cycle");
        let spare = |what: &Observation| match *what {
            Observation::CycleSpare { acyclic, spare } => Some(acyclic + spare),
            _ => None,
        };
        quiet.observations[from..].iter().find_map(|(.., what)| spare(what)).expect("its end")
    };
    let bus = &clean.bus.params;
    let [first, second] = [200u8, 240].map(|octets| {
        let keys = format!("kind = \"overlong-acyclic\"; to = 4; octets = {octets}; cycle = 200; for = 1; every = 50");
        let run = Run::of(&tight(&[&keys]));
        assert_eq!(writes(&run, (2, 4), octets, 200), 1);
        let late: Vec<_> = late(&run).into_iter().filter(|(cycle, _)| cycle % 50 == 0).collect();
        assert_eq!(late.iter().map(|(cycle, _)| *cycle).collect::<Vec<_>>(), [200, 250, 300, 350]);
        for &(cycle, by) in &late {
            // T_ID1, the request, T_SDR, SC, T_ID1.
            let message = bus.span(bus.t_id1()) * 2 + bus.rate.octets(usize::from(octets) + 15 + 1);
            let [least, most] = [bus.min_tsdr, bus.max_tsdr].map(|t_sdr| message + bus.span(t_sdr) - room(cycle));
            assert!(by > least && by < most + Span::from_us(2), "{octets}: {by}, not {least} to {most}");
        }
        late[0].1
    });
    assert!((second - first - bus.rate.octets(40)).abs() < Span::from_ns(5), "{first} and {second}");
}

#[test]
fn what_goes_beyond_every_cycle_adds_up_until_cycles_are_missed() {
    let run = Run::of(&tight(&["kind = \"overlong-acyclic\"; to = 4; cycle = 200; for = 10"]));
    let missed = |what: &Observation| matches!(what, Observation::SynchMissed { .. });
    assert!(run.events_of(2).any(|row| missed(&row.what)));
    // SYNCH that would be a whole T_DP late is left out.
    assert!(late(&run).iter().all(|&(_, by)| by < Span::from_us(1_500)), "{:?}", late(&run));
    assert!((200..210).all(|cycle| writes(&run, (2, 4), 240, cycle) == 1));
    let failures = (3..=5).filter(|&slave| run.counts_of(slave).clock_failures > 0).count();
    assert_eq!(failures, 3, "every encoder notices");
    // It ends with the window.
    assert!(late(&run).iter().all(|(cycle, _)| (200..213).contains(cycle)), "{:?}", late(&run));
    assert!((211..390).all(|cycle| writes(&run, (2, 4), 240, cycle) == 0));
    assert_eq!(bursts(&run, 2), [(200, Disturbance::Begins), (210, Disturbance::Ends)]);
}

#[test]
fn with_room_enough_nothing_is_late() {
    let run = disturbed(&["kind = \"overlong-acyclic\"; to = 5; cycle = 200; for = 50"]);
    assert_eq!(late(&run), []);
    assert!((200..250).all(|cycle| writes(&run, (2, 5), 240, cycle) == 1));
    assert!([199, 250, 251].iter().all(|&cycle| writes(&run, (2, 5), 240, cycle) == 0));
    // No slave has the record, and each answer is fetched after the slave's time for it, 2 ms: T_DP.
    let results = results(&run);
    assert!(results.iter().all(|result| *result == AcyclicResult::Negative), "{results:?}");
    assert!((20..=50).contains(&results.len()), "{}", results.len());
    assert!((3..=5).all(|slave| run.counts_of(slave).fault_count() == 0));
}

#[test]
fn slaves_start_up_and_the_application_s_jobs_come_first() {
    let always = "[[disturbance]]\nkind = \"overlong-acyclic\"\nto = 3\n";
    let read = "[[event]]\ncycle = 200\ndo = \"read-parameter\"\nparameter = 918\nelements = 0\nslaves = \"all\"\n";
    let run = Run::of(&changed(&[("slave.3.powered_at", "100 ms")], &[always, read].concat()));
    for slave in 3..=5 {
        assert_eq!(run.row(slave, 390).phase, Phase::Operation, "slave {slave}");
    }
    let joined = |what: &Observation| matches!(what, Observation::Handler { to: HandlerState::DataExchange, .. });
    assert_eq!(run.events_of(2).filter(|row| joined(&row.what)).count(), 4);
    let value = |what: &Observation| match *what {
        Observation::ParameterValue { slave, value, .. } => Some((slave.get(), value)),
        _ => None,
    };
    let values: Vec<_> = run.events_of(2).filter_map(|row| value(&row.what)).collect();
    assert_eq!(values, [(3, 3), (4, 4), (5, 5)]);
    assert!((300..390).all(|cycle| writes(&run, (2, 3), 240, cycle) == 1));
}

#[test]
fn a_free_running_master_keeps_the_token_for_it() {
    let text = |disturbance: &str| {
        format!(
            "[run]\ncycles = 300\n[bus]\nrate = \"12 Mbit/s\"\nhsa = 15\nt_tr = \"21000 tbit\"\n\
             [master]\naddress = 2\nt_dp = \"1 ms\"\nt_i = \"125 us\"\nt_o = \"500 us\"\n[[class1]]\naddress = 5\n\
             [[slave]]\naddresses = \"3..4\"\ndevice = \"posital-ocd-dpb1b\"\n\
             [[slave]]\naddress = 10\nmaster = 5\ndevice = \"posital-ocd-dpb1b\"\n{disturbance}"
        )
    };
    let run = |disturbance: &str| {
        let scenario = Scenario::parse("two", "two.toml", &text(disturbance), &[]);
        Run::of(&scenario.unwrap_or_else(|error| panic!("{error}")))
    };
    let keys = "[[disturbance]]\nkind = \"overlong-acyclic\"\nto = 10\nat = \"200 ms\"\nfor = \"50 ms\"\n";
    let written = |run: &Run| (0..290).map(|cycle| writes(run, (5, 10), 240, cycle)).sum::<usize>();
    let (clean, disturbed) = (run(""), run(keys));
    assert_eq!(written(&clean), 0);
    assert!(written(&disturbed) >= 40, "{}", written(&disturbed));
    assert_eq!(bursts(&disturbed, 5).len(), 2, "told of the slave's master");
}

#[test]
fn what_never_begins_changes_nothing_and_two_at_once_leave_one() {
    assert_eq!(prints(&[]), prints(&["kind = \"overlong-acyclic\"; to = 4; cycle = 100000; for = 5; every = 7"]));
    let run = disturbed(&[
        "kind = \"overlong-acyclic\"; to = 4; octets = 50; cycle = 200; for = 40",
        "kind = \"overlong-acyclic\"; to = 5; octets = 90; station = 2; cycle = 210; for = 10",
    ]);
    assert!((212..220).all(|cycle| writes(&run, (2, 4), 50, cycle) == 0));
    assert!((200..210).chain(223..240).all(|cycle| writes(&run, (2, 4), 50, cycle) == 1));
    assert!((213..220).all(|cycle| writes(&run, (2, 5), 90, cycle) == 1));
}

#[test]
fn what_cannot_be_is_refused() {
    for (keys, says) in [
        ("octets = 9", "disturbance.1.to: this key is missing"),
        ("to = 77", "disturbance.1.to: no master has a slave 77"),
        ("to = 2", "disturbance.1.to: no master has a slave 2"),
        ("to = 4; station = 3", "disturbance.1.station: station 3 is a slave"),
        ("to = 4; station = 9", "disturbance.1.station: station 9 is not the master of slave 4"),
        ("to = 4; octets = 0", "a whole number from 1 to 240"),
        ("to = 4; octets = 241", "a whole number from 1 to 240"),
        ("to = 4; stations = \"2\"", "there is no such key"),
    ] {
        let said = refused(&[&format!("kind = \"overlong-acyclic\"; {keys}")]);
        assert!(said.contains(says), "{keys}: {said}");
    }
}
