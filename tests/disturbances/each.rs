//! Every kind of disturbance in one list: each is seen at full strength, and nothing is at none.

use isodp::observation::{ClockVerdict, Observation, Phase, SlaveState};
use isodp::study::scenario::disturbance::DISTURBANCES;
use isodp::time::Span;

use super::path::{halls, no_answers, reply_at};
use super::{disturbed, sends_in};
use crate::support::{Run, address};

/// The cycles in which each disturbance acts, as a window.
const OPEN: &str = "cycle = 200; for = 4";
/// A window that never opens.
const NEVER: &str = "cycle = 100000; for = 4";

/// How a kind is tried.
struct Trial {
    kind: &'static str,
    /// In which network.
    run: fn(&[&str]) -> Run,
    /// Its keys at full strength.
    full: &'static str,
    /// Whether a run shows it, beside one without it.
    seen: fn(&Run, &Run) -> bool,
    /// Its keys without strength. Where it has none, only the window is left: [`NEVER`].
    none: &'static [&'static str],
}

fn count(run: &Run, station: u8, is: impl Fn(&Observation) -> bool) -> usize {
    run.events_of(station).filter(|row| is(&row.what)).count()
}
/// Clocks that a slave missed.
fn missed(run: &Run, slave: u8) -> usize {
    count(run, slave, |what| matches!(what, Observation::Clock { verdict: ClockVerdict::Missing, .. }))
}
/// A slave sends nothing while the disturbance lasts, and something before and after.
fn is_quiet(run: &Run, slave: u8) -> bool {
    sends_in(run, slave, 198..206) == [198, 199, 204, 205]
}
/// The largest change of the distance between a SYNCH and its prediction at one slave.
fn moved(calm: &Run, run: &Run, slave: u8) -> Span {
    let errors = |run: &Run| -> Vec<Span> {
        let rows = run.slave(slave).filter(|row| (195..210).contains(&row.cycle));
        rows.filter_map(|row| row.pll_error).collect()
    };
    errors(calm).iter().zip(errors(run)).map(|(&calm, error)| (error - calm).abs()).max().expect("locked")
}
/// By how much a slave answers later in a cycle in which the disturbance lasts.
fn later(calm: &Run, run: &Run) -> Span {
    reply_at(run, 3, 202) - reply_at(calm, 3, 202)
}
fn is_near(span: Span, us: i64) -> bool {
    (span - Span::from_us(us)).abs() < Span::from_ns(10)
}
/// The master's sign of life for slave 3 from the cycle before the disturbance on.
fn signs(run: &Run) -> Vec<u8> {
    (199..212).map(|cycle| run.row(3, cycle).mls).collect()
}
fn retries(run: &Run) -> u64 {
    run.cycles.iter().filter(|row| (200..204).contains(&row.cycle)).map(|row| u64::from(row.retries)).sum()
}

/// Every kind, in the order of their list.
#[rustfmt::skip]
const TRIALS: &[Trial] = &[
    Trial { kind: "missing-clocks", run: disturbed, full: "", seen: |_, run| (3..=5).all(|slave| missed(run, slave) >= 2), none: &["rate = \"0 %\"", "telegrams = 0", "pattern = \".\""] },
    Trial { kind: "lost-telegrams", run: disturbed, full: "from = 3", seen: |_, run| is_quiet(run, 3) && no_answers(run, 3) == 4, none: &["from = 3; rate = \"0 %\"", "telegrams = 0", "pattern = \"..\""] },
    Trial { kind: "late-telegrams", run: disturbed, full: "from = 3; service = \"replies\"; by = \"5 us\"", seen: |calm, run| is_near(later(calm, run), 5), none: &["service = \"replies\"; by = \"0 ns\"", "up_to = \"0 ns\"", "by = \"5 us\"; rate = \"0 %\""] },
    Trial { kind: "duplicate-telegrams", run: disturbed, full: "from = 3; service = \"replies\"; after = \"1 us\"", seen: |_, run| run.telegrams_in(202).filter(|(_, _, by, _)| *by == address(3)).count() >= 2, none: &["rate = \"0 %\"", "telegrams = 0"] },
    Trial { kind: "bit-errors", run: disturbed, full: "rate = \"100 %\"; from = 3", seen: |_, run| no_answers(run, 3) == 4, none: &["rate = \"0 %\""] },
    Trial { kind: "wrong-octet", run: disturbed, full: "octet = 8; flip = 3; from = 3", seen: |_, run| no_answers(run, 3) == 4, none: &["octet = 8; rate = \"0 %\"", "octet = 255"] },
    Trial { kind: "noise", run: disturbed, full: "octets = 60; after = \"100 us\"", seen: |calm, run| retries(run) > retries(calm), none: &[] },
    Trial { kind: "foreign-telegram", run: disturbed, full: "data = { to = 4, from = 9, fc = 0x49 }; after = \"800 us\"", seen: |_, run| run.telegrams_in(200).any(|(_, _, by, octets)| *by == address(4) && octets[..3] == [0x10, 9, 4]), none: &[] },
    Trial { kind: "late-token", run: disturbed, full: "station = 2; by = \"1900 us\"", seen: |_, run| count(run, 2, |what| matches!(what, Observation::ClockLate { .. } | Observation::SynchMissed { .. })) > 0, none: &["station = 2; by = \"0 ns\""] },
    Trial { kind: "overlong-acyclic", run: disturbed, full: "to = 4", seen: |_, run| (200..204).all(|cycle| run.telegrams_in(cycle).any(|(.., octets)| octets.len() > 250)), none: &[] },
    Trial { kind: "silent", run: disturbed, full: "station = 3", seen: |_, run| is_quiet(run, 3) && missed(run, 3) > 0, none: &[] },
    Trial { kind: "mute", run: disturbed, full: "station = 3", seen: |_, run| is_quiet(run, 3) && missed(run, 3) == 0, none: &[] },
    Trial { kind: "deaf", run: disturbed, full: "station = 2", seen: |_, run| (3..=6).all(|slave| no_answers(run, slave) == 4 && !is_quiet(run, slave)), none: &[] },
    Trial { kind: "restart", run: disturbed, full: "station = 3", seen: |_, run| count(run, 3, |what| matches!(what, Observation::Power { .. })) == 3, none: &[] },
    Trial { kind: "gc-jitter", run: disturbed, full: "shape = \"step\"; offset = \"2 us\"", seen: |calm, run| is_near(run.cycles[202].gc_jitter - calm.cycles[202].gc_jitter, 2), none: &["shape = \"none\"", "shape = \"step\"; offset = \"0 ns\"", "shape = \"normal\"; sigma = \"0 ns\"; accumulate = true"] },
    Trial { kind: "crystal-offset", run: disturbed, full: "station = 3; offset = \"50 ppm\"", seen: |calm, run| moved(calm, run, 3) > Span::from_ns(90) && moved(calm, run, 4) == Span::ZERO, none: &["stations = \"2..6\"; offset = \"0 ppm\""] },
    Trial { kind: "crystal-wander", run: disturbed, full: "station = 3; step = \"20 ppm\"; interval = \"1 ms\"; bound = \"60 ppm\"", seen: |calm, run| moved(calm, run, 3) > Span::from_ns(30) && moved(calm, run, 4) == Span::ZERO, none: &["stations = \"2..6\"; step = \"0 ppm\"; interval = \"1 ms\"; bound = \"60 ppm\""] },
    Trial { kind: "temperature-step", run: disturbed, full: "station = 3; offset = \"100 ppm\"; time_constant = \"2 ms\"; interval = \"1 ms\"", seen: |calm, run| moved(calm, run, 3) > Span::from_ns(50) && moved(calm, run, 4) == Span::ZERO, none: &["stations = \"2..6\"; offset = \"0 ppm\"; time_constant = \"2 ms\""] },
    Trial { kind: "receiver-jitter", run: disturbed, full: "station = 3; half_width = \"200 ns\"", seen: |calm, run| moved(calm, run, 3) > Span::from_ns(50) && moved(calm, run, 4) == Span::ZERO, none: &["stations = \"2..6\"; half_width = \"0 ns\""] },
    Trial { kind: "repeater-jitter", run: halls, full: "repeater = \"hall 1 - hall 2\"; half_width = \"150 ns\"", seen: |calm, run| moved(calm, run, 4) > Span::from_ns(40) && moved(calm, run, 3) == Span::ZERO, none: &["repeater = \"hall 1 - hall 2\"; half_width = \"0 ns\""] },
    Trial { kind: "t-sdr-jitter", run: disturbed, full: "station = 3; by = \"5 us\"", seen: |calm, run| is_near(later(calm, run), 5), none: &["stations = \"3..6\"; by = \"0 ns\"; up_to = \"0 tbit\""] },
    Trial { kind: "cable-cut", run: disturbed, full: "position = \"60 m\"", seen: |_, run| [3, 4, 5, 6].map(|slave| no_answers(run, slave)) == [0, 0, 4, 4], none: &[] },
    Trial { kind: "hold-life-sign", run: disturbed, full: "station = 3", seen: |_, run| signs(run).windows(5).any(|five| five.iter().all(|sign| *sign == five[0])), none: &[] },
    Trial { kind: "jump-life-sign", run: disturbed, full: "station = 3; to = 9", seen: |_, run| signs(run).windows(2).filter(|pair| pair[1] != pair[0] % 15 + 1).count() == 1, none: &[] },
    Trial { kind: "repeat-life-sign", run: disturbed, full: "station = 3", seen: |_, run| signs(run).windows(2).filter(|pair| pair[1] == pair[0]).count() == 1, none: &[] },
    Trial { kind: "wrong-parameters", run: disturbed, full: "station = 3; octets = [[5, 0x12]]", seen: |_, run| count(run, 3, |what| matches!(what, Observation::SlaveState { from: SlaveState::DataExch, .. })) == 1, none: &[] },
];

fn with(trial: &Trial, keys: &str, window: &str) -> Run {
    let parts = [&format!("kind = \"{}\"", trial.kind), keys, window];
    let line: Vec<_> = parts.into_iter().filter(|part| !part.is_empty()).collect();
    (trial.run)(&[&line.join("; ")])
}

/// A new kind has to come here too.
#[test]
fn every_kind_is_tried() {
    assert!(TRIALS.iter().map(|trial| trial.kind).eq(DISTURBANCES.iter().map(|kind| kind.name)));
    // What a kind is strong by is one of these keys; a kind that has one must be tried without strength.
    let strengths = ["rate", "telegrams", "by", "up_to", "half_width", "offset", "step", "shape"];
    for (trial, kind) in TRIALS.iter().zip(DISTURBANCES) {
        let has = kind.keys.iter().any(|key| strengths.contains(&key.name));
        assert_eq!(has, !trial.none.is_empty(), "{}", kind.name);
    }
}

#[test]
fn every_kind_is_seen_at_full_strength() {
    let calm = [disturbed(&[]), halls(&[])];
    for trial in TRIALS {
        let calm = &calm[usize::from(trial.kind == "repeater-jitter")];
        let run = with(trial, trial.full, OPEN);
        assert_ne!(run.fingerprint, calm.fingerprint, "{}", trial.kind);
        assert!((trial.seen)(calm, &run), "{}", trial.kind);
        assert!(!(trial.seen)(calm, calm), "{}: seen where it is not", trial.kind);
    }
}

#[test]
fn no_kind_does_anything_without_strength_or_outside_of_its_window() {
    let calm = [disturbed(&[]), halls(&[])];
    for trial in TRIALS {
        let calm = &calm[usize::from(trial.kind == "repeater-jitter")];
        let none = trial.none.iter().map(|keys| (*keys, OPEN)).chain([(trial.full, NEVER)]);
        for (keys, window) in none {
            let run = with(trial, keys, window);
            assert_eq!(run.stations, calm.stations, "{}: {keys}; {window}", trial.kind);
        }
    }
}

/// The only strength of a jump is how far it goes: to the value that comes next anyway it is none.
#[test]
fn a_jump_of_the_sign_of_life_to_the_next_value_is_none() {
    let calm = disturbed(&[]);
    let jump = |to: u8| disturbed(&[&format!("kind = \"jump-life-sign\"; station = 3; to = {to}; {OPEN}")]);
    let next = calm.row(3, 200).mls;
    let [none, far] = [next, next % 15 + 1].map(jump);
    assert_eq!(signs(&none), signs(&calm));
    assert_ne!(signs(&far), signs(&calm));
    for (calm, none) in calm.stations.iter().zip(&none.stations) {
        assert_eq!((calm.0, calm.1.wire, calm.1.latches), (none.0, none.1.wire, none.1.latches));
    }
    assert!(
        (none.faults_of(3).is_empty(), none.phases_of(3).last().map(|last| last.0)) == (true, Some(Phase::Operation))
    );
}
