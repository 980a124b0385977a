//! The expected answers of the shipped scenarios with disturbances of stations, crystals and paths.

use isodp::observation::{AcyclicResult, ClockVerdict, HandlerState, Observation, Phase, SlaveCause, SlaveState};
use isodp::time::{Span, Time};

use crate::support::{Run, address, scenario};

/// Every shipped scenario with its test.
pub(crate) const TESTS: &[(&str, fn())] = &[
    ("cable-cut", cable_cut),
    ("crystal-drift", crystal_drift),
    ("life-sign-jump", life_sign_jump),
    ("master-stop", master_stop),
    ("overlong-acyclic", overlong_acyclic),
    ("slave-restart", slave_restart),
];

fn ms(ms: i64) -> Time {
    Time::ZERO + Span::from_ms(ms)
}
/// When a slave entered full operation.
fn operations(run: &Run, slave: u8) -> Vec<Time> {
    let phase = |row: &isodp::study::row::EventRow| {
        matches!(row.what, Observation::Phase { to: Phase::Operation, .. }).then_some(row.at)
    };
    run.events_of(slave).filter_map(phase).collect()
}
/// When one station saw this.
fn instants(run: &Run, station: u8, is: impl Fn(&Observation) -> bool) -> Vec<Time> {
    run.events_of(station).filter(|row| is(&row.what)).map(|row| row.at).collect()
}
const fn watchdog(what: &Observation) -> bool {
    matches!(what, Observation::SlaveState { from: SlaveState::DataExch, cause: SlaveCause::Watchdog, .. })
}
const fn clock_lost(what: &Observation) -> bool {
    matches!(what, Observation::Phase { from: Phase::Operation, to: Phase::Clock })
}
/// From one instant of a list to another one, in milliseconds.
fn after(instants: &[Time], from: Time) -> Vec<f64> {
    instants.iter().map(|&at| (at - from).as_us() / 1e3).collect()
}

#[test]
fn slave_restart() {
    let run = Run::of(&scenario("slave-restart", &[]));
    let back = operations(&run, 3);
    assert_eq!(back.len(), 4);
    for (n, at) in (1..).zip(&back[1..]) {
        let took = *at - ms(n * 1_000 + 100);
        assert!((Span::from_ms(113)..Span::from_ms(115)).contains(&took), "{took}");
    }
    for slave in 4..=6 {
        assert_eq!((operations(&run, slave).len(), run.counts_of(slave).clock_failures), (1, 0), "slave {slave}");
    }
    let asked = |what: &Observation| matches!(what, Observation::NoAnswer { .. });
    assert_eq!(instants(&run, 2, asked).len(), 30);
}

#[test]
fn cable_cut() {
    let run = Run::of(&scenario("cable-cut", &[]));
    for slave in [3, 4] {
        assert_eq!((operations(&run, slave).len(), run.counts_of(slave).clock_failures), (1, 0), "slave {slave}");
    }
    for (slave, back_after) in [(5, 114.0), (6, 124.0)] {
        let lost = after(&instants(&run, slave, clock_lost), ms(1_000));
        assert!(lost.len() == 1 && (2.8..2.9).contains(&lost[0]), "{lost:?}");
        // The last Data_Exchange was in the cycle that ran at 1 s, 1.1 ms before.
        let out = after(&instants(&run, slave, watchdog), ms(1_000));
        assert!(out.len() == 1 && (98.0..100.0).contains(&out[0]), "{out:?}");
        let back = after(&operations(&run, slave)[1..], ms(1_300));
        assert!(back.len() == 1 && (back[0] - back_after).abs() < 1.0, "{back:?}");
        assert!(run.faults_of(slave).is_empty());
    }
    assert!(run.observations.iter().all(|(.., what)| !matches!(what, Observation::Collision { .. })));
}

#[test]
fn master_stop() {
    let run = Run::of(&scenario("master-stop", &[]));
    let joined = |what: &Observation| matches!(what, Observation::Handler { to: HandlerState::DataExchange, .. });
    assert_eq!(instants(&run, 2, joined).len(), 8);
    for slave in 3..=6 {
        let lost = after(&instants(&run, slave, clock_lost), ms(1_000));
        assert!(lost.len() == 1 && (2.8..2.9).contains(&lost[0]), "{lost:?}");
        let out = after(&instants(&run, slave, watchdog), ms(1_000));
        assert!(out.len() == 1 && (98.0..100.0).contains(&out[0]), "{out:?}");
        let back = after(&operations(&run, slave)[1..], ms(1_300));
        assert!(back.len() == 1 && back[0] < 150.0, "{back:?}");
        let forgotten = |what: &Observation| matches!(what, Observation::SlaveLife { slave: of, tripped: false, .. } if *of == address(slave));
        assert!(instants(&run, 2, forgotten).iter().any(|&at| at == ms(1_300)), "its application starts anew");
    }
    let numbers: Vec<_> = run.cycles.iter().map(|row| row.cycle).collect();
    assert!(numbers.windows(2).all(|pair| pair[1] == pair[0] + 1));
}

#[test]
fn life_sign_jump() {
    let run = Run::of(&scenario("life-sign-jump", &[]));
    for (slave, fault) in [(3, Some(301)), (4, Some(401)), (5, Some(305)), (6, None)] {
        assert_eq!(run.faults_of(slave), fault.map(|cycle| (cycle, 0x0F02)).into_iter().collect::<Vec<_>>());
        let operation: Vec<_> =
            run.phases_of(slave).into_iter().filter(|&(phase, _)| phase == Phase::Operation).collect();
        assert_eq!(operation.get(1).map(|&(_, cycle)| cycle), fault.map(|cycle| cycle + 33), "slave {slave}");
    }
}

#[test]
fn crystal_drift() {
    let run = Run::of(&scenario("crystal-drift", &[]));
    let worst = |slave: u8, range: std::ops::Range<i64>| -> f64 {
        let rows = run.slave(slave).filter(|row| (ms(range.start)..ms(range.end)).contains(&row.t0));
        let errors = rows.filter_map(|row| row.pll_error).map(|error| error.abs().as_us() * 1e3);
        errors.fold(0.0, f64::max)
    };
    for slave in 3..=6 {
        assert_eq!((run.counts_of(slave).clock_failures, run.counts_of(slave).fault_count()), (0, 0));
    }
    // 2.87 x 200 ns and a step of the timer, at both ends of the jump.
    for jump in [2_000, 3_000] {
        let peak = worst(5, jump..jump + 100);
        assert!((574.0 - 21.0..=574.0 + 42.0).contains(&peak), "{peak}");
    }
    assert!(worst(5, 2_300..3_000) <= 63.0, "{}", worst(5, 2_300..3_000));
    let warm = worst(4, 1_000..2_000);
    assert!((10.0..=13.0 + 42.0).contains(&warm), "{warm}");
    assert!(worst(3, 200..4_000) <= 63.0, "{}", worst(3, 200..4_000));
    // A master 20 ppm slow makes T_DP 40 ns longer.
    let t_dp = |cycle: usize| run.cycles[cycle].t_dp.expect("another before") - Span::from_ms(2);
    assert!(t_dp(400).abs() < Span::from_ns(1), "{}", t_dp(400));
    let last = t_dp(run.cycles.len() - 2);
    assert!((Span::from_ns(36)..Span::from_ns(41)).contains(&last), "{last}");
}

#[test]
fn overlong_acyclic() {
    let run = Run::of(&scenario("overlong-acyclic", &[]));
    let late = |row: &isodp::study::row::EventRow| match row.what {
        Observation::ClockLate { by } => Some((row.cycle, by)),
        _ => None,
    };
    let late: Vec<_> = run.events_of(2).filter_map(late).collect();
    let cycles: Vec<_> = late.iter().map(|&(cycle, _)| cycle).collect();
    assert_eq!(cycles, [500, 550, 600].into_iter().chain(900..912).collect::<Vec<_>>());
    for &(cycle, by) in &late[..4] {
        assert!((Span::from_us(45)..Span::from_us(46)).contains(&by), "{cycle}: {by}");
    }
    for pair in late[3..].windows(2) {
        // What was left out is T_DP, 1.5 ms.
        let missed = if pair[1].0 == 910 { Span::from_us(1_500) } else { Span::ZERO };
        let more = (pair[1].1 + missed - pair[0].1).as_us();
        assert!((more - 151.7).abs() < 0.2 || (more - 166.3).abs() < 0.2, "{pair:?}");
    }
    let left_out = |what: &Observation| matches!(what, Observation::SynchMissed { cycles: 1 });
    let missed: Vec<_> = run.events_of(2).filter(|row| left_out(&row.what)).map(|row| row.cycle).collect();
    assert_eq!(missed, [910]);
    for slave in 3..=5 {
        let missing = |what: &Observation| matches!(what, Observation::Clock { verdict: ClockVerdict::Missing, .. });
        let missing: Vec<_> = run.events_of(slave).filter(|row| missing(&row.what)).map(|row| row.cycle).collect();
        assert_eq!(missing[..5], [500, 550, 600, 900, 901], "slave {slave}");
        assert!(missing.iter().all(|&cycle| cycle < 913), "slave {slave}");
        assert_eq!(run.faults_of(slave), [(902, 0x0F04)]);
        let end = run.cycles[912].t0;
        let back = after(&operations(&run, slave)[1..], end);
        assert!(back.len() == 1 && (78.0..80.0).contains(&back[0]), "{back:?}");
        assert!(instants(&run, slave, watchdog).is_empty());
        // Ten good clocks have repaid each of the late ones.
        assert_eq!((run.row(slave, 499).clock_counter, run.row(slave, 520).clock_counter), (0, 0), "slave {slave}");
    }
    let acyclic = run.counts.as_ref().expect("the run is over").acyclic.of(isodp::observation::MasterClass::One);
    assert_eq!(acyclic.ended(AcyclicResult::Positive), 0);
    assert!(acyclic.ended(AcyclicResult::Negative) > 15);
}
