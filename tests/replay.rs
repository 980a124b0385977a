//! A stretch of a run, told once more.

use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::NearQueue;
use isodp::study::replay::{ReplayError, Window, replay};
use isodp::study::scenario::Scenario;

use crate::support::{Run, scenario};

fn told(scenario: &Scenario, window: Window) -> String {
    replay::<NearQueue<NetworkEvent>>(scenario, window).unwrap_or_else(|error| panic!("{error}"))
}
/// The octets of the telegrams in a trace, in its order.
fn octets(text: &str) -> Vec<Vec<u8>> {
    let hex = |line: &str| -> Option<Vec<u8>> {
        let (_, hex) = line.split_once('|')?;
        Some(hex.split_whitespace().map(|octet| u8::from_str_radix(octet, 16).expect("an octet")).collect())
    };
    text.lines().filter_map(hex).collect()
}

#[test]
fn a_replay_has_every_telegram_of_its_cycles_and_no_other() {
    for (name, first, last) in [("slave-to-slave", 100, 103), ("two-masters", 60, 62), ("gc-loss", 320, 330)] {
        let network = scenario(name, &[("run.duration", "1 s")]);
        let run = Run::of(&network);
        let text = told(&network, Window { first, last });
        // A cycle's SYNCH is the last telegram before its start.
        let t0 = |cycle| run.cycles.iter().find(|row| row.cycle == cycle).expect("a cycle").t0;
        let synch = |octets: &[u8]| octets.len() == 13 && octets[9..11] == [0x00, 0x80];
        let begin = |cycle| {
            let before = run
                .telegrams
                .iter()
                .filter(|(start, end, _, octets)| *start < t0(cycle) && *end == t0(cycle) && synch(octets));
            before.map(|(start, ..)| *start).next_back().unwrap_or(t0(cycle))
        };
        let (from, to) = (begin(first), begin(last + 1));
        let mut expected: Vec<_> = run.telegrams.iter().filter(|(start, ..)| (from..to).contains(start)).collect();
        expected.sort_by_key(|(start, ..)| *start);
        assert!(expected.len() > 10, "{name}");
        assert_eq!(octets(&text), expected.iter().map(|(.., octets)| octets.clone()).collect::<Vec<_>>(), "{name}");
        assert_eq!(text.matches("\ncycle ").count() as u64, last - first + 1, "{name}");
    }
}

#[test]
fn a_line_says_when_who_and_what() {
    let text = told(&scenario("slave-to-slave", &[]), Window::around(200, 0));
    let line = |what: &str| text.lines().find(|line| line.contains(what)).unwrap_or_else(|| panic!("{what}:\n{text}"));
    let synch: Vec<_> = line("SYNCH").split_whitespace().collect();
    assert_eq!(synch[1..7], ["-143", "143", "2", "->", "127", "SYNCH"], "bits before t0, length, stations, words");
    let request: Vec<_> = line("Data_Exchange, FCB").split_whitespace().collect();
    assert_eq!(request[1..4], ["800", "143", "2"], "T_ID2 after t0");
    assert!(line("cycle 200 starts").trim_start().starts_with("0.000"), "{text}");
    assert!(text.contains("T_O, master sign of life") && text.contains("latch"), "what stations saw:\n{text}");
}

#[test]
fn a_cycle_that_never_was_is_an_error() {
    let network = scenario("slave-to-slave", &[("run.duration", "300 ms")]);
    let error = replay::<NearQueue<NetworkEvent>>(&network, Window::around(1_000_000, 3)).expect_err("too late");
    assert!(matches!(error, ReplayError::NoSuchCycle { wanted: 999_997, last } if last > 50), "{error}");
}
