//! Disturbances of the line in whole networks: each at full strength, and at none.

use isodp::observation::{ClockVerdict, Disturbance, Observation};
use isodp::study::row::EventRow;
use isodp::study::scenario::Scenario;
use isodp::time::{Span, Time};
use isodp::wire::Address;

use crate::support::{Run, address, scenario};

/// An isochronous master with two encoders.
const NETWORK: &str = r#"
[run]
seed = 1
cycles = 300

[bus]
rate = "12 Mbit/s"

[master]
address = 2
t_dp = "1 ms"
t_i = "125 us"
t_o = "500 us"
t_pll_w = "1 us"
crystal = "20 ppm"

[[slave]]
address = 3
device = "posital-ocd-dpb1b"
crystal = "-30 ppm"

[[slave]]
address = 4
device = "posital-ocd-dpb1b"
crystal = "40 ppm"
"#;
/// Cycles from which on everything runs.
const RUNS: u64 = 100;

fn read(disturbances: &str) -> Scenario {
    let text = format!("{NETWORK}{disturbances}");
    Scenario::parse("line", "line.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}"))
}
/// A run with one disturbance, the keys of which are given.
fn with(keys: &str) -> Run {
    Run::of(&read(&format!("[[disturbance]]\n{}\n", keys.replace("; ", "\n"))))
}
/// How often something was done to telegrams of a station.
fn disturbed(run: &Run, station: u8, what: Disturbance) -> usize {
    let done = |seen: &Observation| matches!(seen, Observation::Disturbed { how, .. } if *how == what);
    run.observations.iter().filter(|(_, who, seen)| *who == address(station) && done(seen)).count()
}
fn count(run: &Run, what: impl Fn(&Observation) -> bool) -> usize {
    run.observations.iter().filter(|(_, _, seen)| what(seen)).count()
}
fn retries(run: &Run) -> usize {
    count(run, |seen| matches!(seen, Observation::Retry { .. }))
}
fn collisions(run: &Run) -> usize {
    count(run, |seen| matches!(seen, Observation::Collision { .. }))
}
/// Telegrams of a station from the cycle `RUNS` on that begin with SD2.
fn data_telegrams(run: &Run, station: u8) -> usize {
    let t0 = run.cycles.iter().find(|row| row.cycle == RUNS).expect("a cycle").t0;
    let data = |&&(start, _, who, ref octets): &&(_, _, _, Vec<u8>)| {
        start >= t0 && who == address(station) && octets[0] == 0x68
    };
    run.telegrams.iter().filter(data).count()
}

#[test]
fn without_strength_nothing_changes() {
    let clean = Run::of(&read(""));
    for keys in [
        "kind = \"lost-telegrams\"; rate = \"0 %\"",
        "kind = \"lost-telegrams\"; telegrams = 0",
        "kind = \"lost-telegrams\"; pattern = \"...\"",
        "kind = \"lost-telegrams\"; service = \"acyclic\"",
        "kind = \"missing-clocks\"; rate = \"0\"",
        "kind = \"late-telegrams\"; by = \"0 us\"",
        "kind = \"late-telegrams\"; up_to = \"0 us\"; service = \"all\"",
        "kind = \"duplicate-telegrams\"; telegrams = 0",
        "kind = \"bit-errors\"; rate = \"0\"",
        "kind = \"wrong-octet\"; octet = 250",
        "kind = \"bit-errors\"; rate = \"1\"; cycle = 1000",
        "kind = \"noise\"; cycle = 1000",
        "kind = \"noise\"; mean = \"1 us\"; at = \"20 s\"",
        "kind = \"foreign-telegram\"; token = { to = 4, from = 3 }; at = \"20 s\"",
    ] {
        let run = with(keys);
        assert_eq!((run.fingerprint, run.stations), (clean.fingerprint, clean.stations.clone()), "{keys}");
    }
}

#[test]
fn every_second_reply_that_is_lost_is_repeated_once() {
    let run = with(
        "kind = \"lost-telegrams\"; from = 4; service = \"data-exchange\"; pattern = \"x.\"; cycle = 100; for = 50",
    );
    assert_eq!((disturbed(&run, 4, Disturbance::Lost), retries(&run)), (50, 50));
    let row = run.cycles.iter().filter(|row| row.cycle >= RUNS && row.retries > 0);
    assert_eq!(row.count(), 50);
    let few = with(
        "kind = \"lost-telegrams\"; from = 4; service = \"replies\"; telegrams = 1; cycle = 100; for = 20; every = 50",
    );
    assert_eq!((disturbed(&few, 4, Disturbance::Lost), retries(&few)), (4, 4));
}

#[test]
fn a_share_of_the_clocks_is_missing() {
    let run = with("kind = \"missing-clocks\"; rate = \"20 %\"; cycle = 100");
    // 200 clocks: 40, give or take 5.7.
    let missing = disturbed(&run, 2, Disturbance::Lost);
    assert!((20..60).contains(&missing), "{missing}");
    let heard =
        run.telegrams.iter().filter(|(_, _, _, octets)| octets.len() == 13 && octets[11] != 0 && octets[7] == 58);
    assert!(heard.count() + missing >= 300);
    let all = with("kind = \"missing-clocks\"");
    assert!(disturbed(&all, 2, Disturbance::Lost) >= 300);
}

#[test]
fn a_late_reply_makes_t_dx_longer_and_one_beyond_the_slot_time_is_a_retry() {
    let clean = Run::of(&read(""));
    let late = with("kind = \"late-telegrams\"; from = 4; service = \"data-exchange\"; by = \"2 us\"; cycle = 100");
    for (late, clean) in late.cycles.iter().zip(&clean.cycles).filter(|(row, _)| row.cycle > RUNS) {
        let [late, clean] = [late, clean].map(|row| row.t_dx);
        let Some((late, clean)) = late.zip(clean) else { continue };
        // The reply's T_DX counts on the master's crystal.
        assert!((late - clean - Span::from_us(2)).abs() < Span::from_ns(30), "{late} {clean}");
    }
    assert_eq!((retries(&late), collisions(&late)), (0, 0));
    // T_SL of 1000 t_bit is 83 us: the reply comes when the repeated request, or the next one, is under way.
    let lost =
        with("kind = \"late-telegrams\"; from = 4; service = \"data-exchange\"; by = \"90 us\"; cycle = 100; for = 1");
    assert_eq!(disturbed(&lost, 4, Disturbance::Late), 1);
    assert!(retries(&lost) > 0 && collisions(&lost) > 0, "{} {}", retries(&lost), collisions(&lost));
}

#[test]
fn what_is_late_by_chance_stays_within_its_bound() {
    let clean = Run::of(&read(""));
    let keys = "kind = \"late-telegrams\"; from = 4; service = \"data-exchange\"; up_to = \"1 us\"; cycle = 100";
    let late = with(keys);
    let more: Vec<_> = late
        .cycles
        .iter()
        .zip(&clean.cycles)
        .filter(|(row, _)| row.cycle > RUNS && row.cycle < 299)
        .map(|(late, clean)| late.t_dx.expect("T_DX") - clean.t_dx.expect("T_DX"))
        .collect();
    let bound = Span::from_us(1) + Span::from_ns(30);
    assert!(more.iter().all(|&by| by > -Span::from_ns(30) && by < bound));
    assert!(more.iter().any(|&by| by > Span::from_ns(900)) && more.iter().any(|&by| by < Span::from_ns(100)));
}

#[test]
fn a_clock_that_comes_twice_is_heard_twice() {
    let run = with("kind = \"duplicate-telegrams\"; service = \"synch\"; after = \"100 ns\"; cycle = 100; for = 100");
    assert_eq!(disturbed(&run, 2, Disturbance::Doubled), 100);
    assert_eq!(collisions(&run), 0, "the copy ends before the first request begins");
    let (clean, telegrams) = (Run::of(&read("")).telegrams.len(), run.telegrams.len());
    assert_eq!(telegrams, clean + 100);
    // A copy is told when it leaves, after the request that was planned before.
    let is_doubled = |first: &&(Time, Time, Address, Vec<u8>)| {
        run.telegrams.iter().any(|other| other.0 == first.1 + Span::from_ns(100) && other.3 == first.3)
    };
    let copies = run.telegrams.iter().filter(is_doubled);
    assert_eq!(copies.count(), 100);
}

#[test]
fn a_request_that_comes_twice_collides_with_its_answer() {
    let run = with(
        "kind = \"duplicate-telegrams\"; to = 4; service = \"data-exchange\"; after = \"1 us\"; telegrams = 1; cycle = 100; for = 1",
    );
    assert_eq!((collisions(&run), retries(&run)), (1, 1));
}

#[test]
fn one_wrong_bit_in_a_thousand_is_a_retry_now_and_then_and_each_is_none_at_all() {
    let run = with("kind = \"bit-errors\"; rate = \"1e-4\"; from = 4; service = \"data-exchange\"; cycle = 100");
    // 200 replies of 231 bits: 4.6 with a wrong bit, give or take 2.1.
    let wrong = disturbed(&run, 4, Disturbance::WrongBits);
    assert!((1..=12).contains(&wrong), "{wrong}");
    assert_eq!(retries(&run), wrong, "each is found");
    let dead = with("kind = \"bit-errors\"; rate = \"1\"");
    let joined = count(&dead, |seen| {
        matches!(seen, Observation::SlaveState { to: isodp::observation::SlaveState::DataExch, .. })
    });
    assert_eq!((joined, data_telegrams(&dead, 3)), (0, 0), "nobody understands anything");
}

#[test]
fn a_wrong_octet_is_found_by_the_parity_or_by_the_sum() {
    for (octet, more) in [
        (8, ""),
        (8, "; flip = 3"),
        (8, "; parity = \"good\""),
        (20, "; parity = \"good\""),
        (21, "; flip = 0x81"),
        (1, "; flip = 3"),
    ] {
        let keys = format!(
            "kind = \"wrong-octet\"; octet = {octet}{more}; from = 4; service = \"data-exchange\"; telegrams = 1; cycle = 100; for = 1; every = 50"
        );
        let run = with(&keys);
        assert_eq!((disturbed(&run, 4, Disturbance::WrongBits), retries(&run)), (4, 4), "{keys}");
    }
}

#[test]
fn two_wrong_octets_that_leave_the_sum_as_it_was_pass() {
    // The shaft stands and signs of life are a high nibble: the last octet of G1_XIST2 is always the same, and of its sum
    // the low nibble.
    let clean = Run::of(&read(""));
    let reply = |(_, _, who, octets): &&(_, _, _, Vec<u8>)| *who == address(4) && octets.len() == 21;
    let octets = &clean.telegrams.iter().rev().find(reply).expect("a reply").3;
    let flip = (0..4).map(|bit| 1 << bit).find(|mask| (octets[18] ^ octets[19]) & mask == 0).expect("equal bits");
    let wrong = |octet: u8| {
        format!(
            "[[disturbance]]\nkind = \"wrong-octet\"\nname = \"{octet}\"\noctet = {octet}\nflip = {flip}\n\
             parity = \"good\"\nfrom = 4\nservice = \"data-exchange\"\ncycle = 100\nfor = 10\n"
        )
    };
    let run = Run::of(&read(&(wrong(19) + &wrong(20))));
    assert_eq!((disturbed(&run, 4, Disturbance::WrongBits), retries(&run)), (20, 0), "the sum is right");
    let run = Run::of(&read(&wrong(20)));
    // After the first one the slave gets no repeat until it answers.
    assert_eq!(count(&run, |seen| matches!(seen, Observation::NoAnswer { .. })), 10, "the sum alone is wrong");
}

/// Octets of telegrams that a disturbance put on the line at a station's place.
fn foreign(run: &Run, station: u8, octets: &[u8]) -> Vec<Time> {
    let same = run.telegrams.iter().filter(|(_, _, who, found)| *who == address(station) && found == octets);
    same.map(|(start, ..)| *start).collect()
}

#[test]
fn noise_comes_as_often_as_said_and_hits_what_is_on_the_line() {
    let run = with("kind = \"noise\"; mean = \"500 us\"; octets = 1; octets_to = 3; cycle = 100; for = 100; near = 4");
    // 200 in 100 ms, give or take 14.
    let noise = disturbed(&run, 4, Disturbance::Noise);
    assert!((150..250).contains(&noise), "{noise}");
    // Telegrams are on the line for 85 us of 1000, and noise of 22 bits on the average too.
    let hits = collisions(&run);
    assert!((10..100).contains(&hits), "{hits}");
    assert!(retries(&run) > 0, "a hit request or reply is repeated");
    let quiet = run.cycles.iter().filter(|row| row.cycle > 201 && row.cycle < 299);
    assert!(quiet.into_iter().all(|row| row.retries == 0));
}

#[test]
fn noise_in_the_idle_time_before_a_request_keeps_it_from_being_heard() {
    // The first request begins T_ID2 of 800 t_bit, 66.67 us, after t0. A character of noise is 11 t_bit long: begun up to
    // 63 us after t0 it leaves the 33 t_bit of T_SYN.
    for (after, lost) in [("8 us", false), ("62.9 us", false), ("63.1 us", true), ("65.7 us", true)] {
        let keys = format!("kind = \"noise\"; after = \"{after}\"; cycle = 100; for = 1; every = 10; times = 5");
        let run = with(&keys);
        assert_eq!((disturbed(&run, 2, Disturbance::Noise), collisions(&run)), (5, 0));
        assert_eq!(retries(&run), if lost { 5 } else { 0 }, "{after}");
    }
}

#[test]
fn noise_is_a_stranger_to_the_station_at_whose_place_it_is() {
    // In the middle of the wait for an answer the master takes it for one.
    let run = with("kind = \"noise\"; after = \"79 us\"; cycle = 100; for = 1; every = 10; times = 5");
    assert!(retries(&run) >= 5, "{}", retries(&run));
}

#[test]
fn a_foreign_telegram_is_answered_by_whom_it_asks() {
    // FDL status of slave 4, asked by nobody in the idle part of the cycle.
    let keys = "data = { to = 4, from = 9, fc = 0x49 }; after = \"800 us\"; cycle = 100; for = 1; every = 10; times = 3; near = 3";
    let run = with(&format!("kind = \"foreign-telegram\"; {keys}"));
    let (asked, answered) =
        (foreign(&run, 3, &[0x10, 4, 9, 0x49, 0x56, 0x16]), foreign(&run, 4, &[0x10, 9, 4, 0, 13, 0x16]));
    assert_eq!((asked.len(), answered.len(), disturbed(&run, 3, Disturbance::Foreign)), (3, 3, 3));
    assert!(asked.iter().zip(&answered).all(|(asked, answered)| asked < answered));
}

#[test]
fn a_foreign_token_takes_the_token_away() {
    // A master that is not there passes the token to one that is not there either.
    let run =
        with("kind = \"foreign-telegram\"; token = { to = 6, from = 9 }; after = \"800 us\"; cycle = 100; for = 1");
    let gone = |seen: &Observation| matches!(seen, Observation::TokenDropped { .. });
    assert_eq!((count(&run, gone), foreign(&run, 2, &[0xDC, 6, 9]).len()), (1, 1));
    let claimed = count(&run, |seen| matches!(seen, Observation::TokenClaimed));
    assert_eq!(claimed, 2, "after T_TO of silence the master claims it again");
}

// ----- shipped scenarios

/// The scenarios of this module with their tests.
pub(crate) const TESTS: &[(&str, fn())] =
    &[("bit-errors", bit_errors), ("burst-noise", burst_noise), ("late-token", late_token)];

fn missing_clocks(run: &Run, slave: u8) -> Vec<u64> {
    let missing = |seen: &Observation| matches!(seen, Observation::Clock { verdict: ClockVerdict::Missing, .. });
    run.events_of(slave).filter(|row| missing(&row.what)).map(|row| row.cycle).collect()
}
/// No slave reports a fault or leaves data exchange.
fn assert_unharmed(run: &Run) {
    assert_eq!(count(run, |seen| matches!(seen, Observation::Fault { .. } | Observation::Lost { .. })), 0);
}

#[test]
fn bit_errors() {
    let run = Run::of(&scenario("bit-errors", &[]));
    let wrong = count(&run, |seen| matches!(seen, Observation::Disturbed { how: Disturbance::WrongBits, .. }));
    assert!((90..160).contains(&wrong), "{wrong}");
    let (repeated, unanswered) = (retries(&run), count(&run, |seen| matches!(seen, Observation::NoAnswer { .. })));
    let clocks = missing_clocks(&run, 3).len();
    assert!((1..=16).contains(&clocks), "{clocks}");
    assert!(repeated + clocks <= wrong && repeated + clocks + 30 > wrong, "{repeated} {clocks} of {wrong}");
    assert!(unanswered < 10, "{unanswered}");
    assert_unharmed(&run);
    // Every set point and every position came as it was sent: the shafts stand at 0.
    let positions = |what: &Observation| match what {
        Observation::Latch { inputs, .. } => Some(inputs.xist1),
        _ => None,
    };
    assert!(run.observations.iter().filter_map(|(_, _, seen)| positions(seen)).all(|position| position == 0));
    assert_eq!(count(&run, |seen| matches!(seen, Observation::IllegalAnswer { .. })), 0);
}

#[test]
fn burst_noise() {
    let run = Run::of(&scenario("burst-noise", &[]));
    let noise = disturbed(&run, 5, Disturbance::Noise);
    assert!((340..460).contains(&noise), "{noise}");
    let hits = collisions(&run);
    assert!((noise / 12..noise / 4).contains(&hits), "{hits} of {noise}");
    assert!(retries(&run) > 15);
    for slave in 3..=8 {
        let missing = missing_clocks(&run, slave);
        assert_eq!(missing.len(), 3, "{missing:?}");
        assert!(missing.iter().all(|cycle| cycle % 300 <= 6), "{missing:?}");
    }
    assert_unharmed(&run);
    // After each burst it is quiet again.
    let quiet = run.cycles.iter().filter(|row| row.cycle > 60 && row.cycle % 300 > 6);
    assert!(quiet.into_iter().all(|row| row.retries == 0));
    let last = |slave| run.row(slave, 1_400);
    assert!((3..=8).all(|slave| last(slave).clock_counter == 0));
}

#[test]
fn late_token() {
    let scenario_ = scenario("late-token", &[]);
    let run = Run::of(&scenario_);
    let late = |seen: &Observation| match seen {
        Observation::ClockLate { by } => Some(*by),
        _ => None,
    };
    let late: Vec<_> = run.events_of(2).filter_map(|row| Some((row.cycle, late(&row.what)?))).collect();
    assert_eq!(late.iter().map(|(cycle, _)| *cycle).collect::<Vec<_>>(), [301, 500]);
    let near = |by: Span, us| (by - Span::from_us(us)).abs() < Span::from_us(1);
    assert!(near(late[0].1, 92) && near(late[1].1, 133), "{late:?}");
    let claimed = |seen: &Observation| matches!(seen, Observation::TokenClaimed);
    assert_eq!(count(&run, claimed), 2, "at the start, and once for the token that was kept too long");
    let dropped = |row: &&EventRow| matches!(row.what, Observation::TokenDropped { .. } | Observation::RingLeft { .. });
    assert_eq!(run.events_of(12).filter(dropped).count(), 2);
    let entered: Vec<_> =
        run.events_of(12).filter(|row| matches!(row.what, Observation::RingEntered)).map(|row| row.cycle).collect();
    assert!(entered.len() == 2 && entered[1] < 520, "{entered:?}");
    for slave in 4..=6 {
        assert_eq!(missing_clocks(&run, slave).len(), 2);
        let stray = |row: &&EventRow| matches!(row.what, Observation::Clock { verdict: ClockVerdict::Stray, .. });
        assert_eq!(run.events_of(slave).filter(stray).count(), 2);
    }
    assert_unharmed(&run);
    assert_eq!(
        scenario_.disturbances.iter().map(|one| one.name.as_str()).collect::<Vec<_>>(),
        ["slow master", "slower master"]
    );
}
