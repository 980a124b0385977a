//! The expected answers of the scenarios about the encoder and its manual, one test per file of `scenarios/`.

use isodp::observation::{Leds, LifeState, Observation, Phase, SlaveCause, SlaveState};
use isodp::study::row::SlaveRow;
use isodp::time::{Span, Time};

use crate::support::{Run, address, scenario};

/// These scenarios with their tests.
pub(crate) const TESTS: &[(&str, fn())] = &[
    ("acknowledge", acknowledge),
    ("configuration-fault", configuration_fault),
    ("leds", leds),
    ("parameter-fault", parameter_fault),
    ("parking", parking),
    ("preset", preset),
    ("read-parameters", read_parameters),
    ("scaling", scaling),
    ("t-mapc", t_mapc),
];

const ERROR: u16 = 0x8000;
const ACKNOWLEDGING: u16 = 0x0800;
const VALUE: u16 = 0x2000;

/// G1_ZSW and G1_XIST2 of one slave as latched in one cycle.
fn shown(run: &Run, slave: u8, cycle: u64) -> (u16, u32) {
    let row = run.row(slave, cycle);
    (row.g1_zsw, row.xist2)
}
/// The same as in every one of these cycles.
fn assert_shown(run: &Run, slave: u8, cycles: std::ops::Range<u64>, expected: (u16, u32)) {
    for row in run.slave(slave).filter(|row| cycles.contains(&row.cycle)) {
        assert_eq!((row.g1_zsw, row.xist2), expected, "slave {slave} in cycle {}", row.cycle);
    }
}
/// Faults of one slave that were acknowledged: in which cycle, with their codes.
fn acknowledged(run: &Run, slave: u8) -> Vec<(u64, u16)> {
    let code = |what: &Observation| if let Observation::Acknowledged { code } = *what { Some(code) } else { None };
    run.events_of(slave).filter_map(|row| Some((row.cycle, code(&row.what)?))).collect()
}
/// When the LEDs of one slave changed, and to what.
fn leds_of(run: &Run, slave: u8) -> Vec<(Time, Leds)> {
    let leds = |what: &Observation| if let Observation::Leds { to, .. } = *what { Some(to) } else { None };
    run.events_of(slave).filter_map(|row| Some((row.at, leds(&row.what)?))).collect()
}
/// The cycle from which a slave stays in operation.
fn operates_from(run: &Run, slave: u8) -> u64 {
    let last = run.phases_of(slave).last().copied().expect("a phase");
    assert_eq!(last.0, Phase::Operation, "slave {slave}");
    last.1
}

#[test]
fn preset() {
    let run = Run::of(&scenario("preset", &[]));
    // The word of cycle 200 is in force at its T_O, before its latch, and in the reply after that (Model: D10).
    assert_eq!([199, 200].map(|cycle| shown(&run, 3, cycle)), [(VALUE, 4_096), (0x3000, 0)]);
    let replies = [200, 201].map(|cycle| run.reply(3, cycle).expect("a reply"));
    assert_eq!(
        replies.map(|reply| (reply.g1_zsw.0, reply.xist1, reply.xist2)),
        [(VALUE, 4_096 << 7, 4_096), (0x3000, 0, 0)]
    );
    assert_shown(&run, 3, 200..250, (0x3000, 0));
    assert_shown(&run, 3, 250..300, (VALUE, 0));
    assert_shown(&run, 3, 300..399, (0x3000, 0));
    assert!(run.faults_of(3).is_empty() && run.faults_of(4).is_empty());

    // 409.6 steps in every cycle, across the preset as well: it sets the latch before it to 0.
    let position = |cycle: u64| run.row(4, cycle).xist2;
    assert!((40_000..).contains(&position(199)), "{}", position(199));
    for cycle in 200..399 {
        let expected = f64::from((cycle - 199) as u32) * 409.6;
        assert!((f64::from(position(cycle)) - expected).abs() <= 1.0, "{} in cycle {cycle}", position(cycle));
    }

    // Not enabled: 0F01 until the acknowledgement, and the position is where it was.
    assert_eq!((run.faults_of(5), acknowledged(&run, 5)), (vec![(200, 0x0F01)], vec![(270, 0x0F01)]));
    assert_shown(&run, 5, 200..270, (ERROR, 0x0F01));
    assert_shown(&run, 5, 270..399, (VALUE, 4_096));
    assert!(run.slave(5).filter(|row| (100..399).contains(&row.cycle)).all(|row| row.xist1 == 4_096 << 7));
}

#[test]
fn parking() {
    let run = Run::of(&scenario("parking", &[]));
    let rows = |slave, cycles: std::ops::Range<u64>| -> Vec<SlaveRow> {
        run.slave(slave).filter(|row| cycles.contains(&row.cycle)).copied().collect()
    };
    assert!(run.faults_of(3).is_empty());
    assert!(rows(3, 150..300).iter().all(|row| (row.g1_zsw, row.xist1, row.xist2) == (0x4000, 0, 0)));
    assert!(rows(3, 300..399).iter().all(|row| (row.g1_zsw, row.xist1, row.xist2) == (0, 12_288 << 7, 0)));
    // The sign of life knows nothing of parking: lost in cycle 201, back 16 steps after the start in cycle 220.
    assert!(rows(3, 150..201).iter().all(|row| row.sls != 0));
    assert!(rows(3, 201..236).iter().all(|row| row.sls == 0));
    assert_eq!([236, 237, 250].map(|cycle| run.row(3, cycle).sls), [1, 2, 15]);
    assert_eq!([3, 4, 5].map(|slave| operates_from(&run, slave)), [252; 3]);

    assert_eq!((run.faults_of(4), run.faults_of(5)), (vec![(201, 0x0F02)], vec![(201, 0x0F02)]));
    assert_shown(&run, 4, 201..250, (ERROR, 0x0F02));
    assert_shown(&run, 4, 250..300, (0x4000, 0));
    assert_shown(&run, 4, 300..399, (0, 0));
    assert_shown(&run, 5, 201..399, (ERROR, 0x0F02));
}

#[test]
fn acknowledge() {
    let run = Run::of(&scenario("acknowledge", &[]));
    assert_eq!(run.faults_of(3), [(201, 0x0F02), (301, 0x0F04)]);
    assert_eq!(acknowledged(&run, 3), [(400, 0x0F02), (450, 0x0F04)]);
    assert_shown(&run, 3, 201..400, (ERROR, 0x0F02));
    assert_shown(&run, 3, 400..450, (ERROR, 0x0F04));
    assert_shown(&run, 3, 450..499, (0, 0));

    assert_eq!(run.faults_of(4), [(200, 0x0F01), (301, 0x0F04)]);
    assert_eq!(acknowledged(&run, 4), [(400, 0x0F01), (450, 0x0F04)]);
    assert_shown(&run, 4, 200..220, (ERROR, 0x0F01));
    assert_shown(&run, 4, 220..224, (ERROR | ACKNOWLEDGING, 0x0F01));
    assert_shown(&run, 4, 224..400, (ERROR, 0x0F01));
    assert_shown(&run, 4, 400..450, (ERROR, 0x0F04));
    assert_shown(&run, 4, 450..499, (0, 0));

    // Both counters tripped on the way; the clock takes everything with it.
    assert_eq!([3, 4].map(|slave| operates_from(&run, slave)), [351; 2]);
    for slave in [3, 4] {
        assert!(run.slave(slave).filter(|row| (301..335).contains(&row.cycle)).all(|row| row.sls == 0));
    }
}

#[test]
fn scaling() {
    let network = scenario("scaling", &[]);
    let run = Run::of(&network);
    let positions = |slave| -> Vec<u32> {
        run.slave(slave).filter(|row| (100..290).contains(&row.cycle)).map(|row| row.xist2).collect()
    };
    // Units per revolution, range, whether the end of the disc is seamless.
    for (slave, units, range, seamless) in [(3, 100, 12_800, true), (4, 1_000, 32_000, true), (5, 100, 10_000, false)] {
        let all = positions(slave);
        let step = units * 20 / 1_000;
        let steps: Vec<_> = all.windows(2).map(|pair| (pair[1] + range - pair[0]) % range).collect();
        let jumps = steps.iter().filter(|&&grown| grown.abs_diff(step) > 1).count();
        assert_eq!(jumps, usize::from(!seamless), "slave {slave}");
        let at = all.windows(2).position(|pair| pair[1] < pair[0]).expect("the shaft goes over the end");
        let end = if seamless { range } else { 9_600 };
        assert!((end - step - 1..end).contains(&all[at]) && all[at + 1] <= step + 1, "{} {}", all[at], all[at + 1]);
        // Left-justified by the bits that the range leaves.
        let shift = (range - 1).leading_zeros();
        assert!(run.slave(slave).filter(|row| row.cycle >= 100).all(|row| row.xist1 == row.xist2 << shift));
    }
    // Scaled one to one, up to the step that the timer grid may move a latch across.
    for (scaled, unscaled) in positions(6).into_iter().zip(positions(7)) {
        assert!((scaled + (1 << 25) - unscaled) % (1 << 25) <= 1 || unscaled - scaled <= 1, "{scaled} {unscaled}");
    }
    assert!(run.slave(6).filter(|row| row.cycle >= 100).all(|row| row.xist1 == row.xist2 << 7));
    // The disc ends 3 revolutions after the start: 300 ms, in the latch of the cycle that ends after it.
    let over = run.slave(7).filter(|row| row.cycle >= 100).find(|row| row.xist2 < 1 << 24).expect("over the end");
    let latch = over.t0 + network.master.t_dp - network.slaves[4].times.t_i;
    let end = Time::ZERO + Span::from_ms(300);
    assert!(latch >= end && latch - end <= network.master.t_dp, "{latch:?}");
}

#[test]
fn parameter_fault() {
    let run = Run::of(&scenario("parameter-fault", &[]));
    for slave in 3..=6 {
        let causes: Vec<_> = states(&run, slave).into_iter().filter(|&(cycle, ..)| cycle >= 200).collect();
        // Refused again and again, never a step further, until the parameters are good.
        let (bad, good): (Vec<_>, Vec<_>) = causes.into_iter().partition(|&(.., cause)| cause == SlaveCause::PrmFault);
        assert!(bad.len() > 5 && bad.iter().all(|&(cycle, to, _)| cycle < 410 && to == SlaveState::WaitPrm));
        let good: Vec<_> = good.into_iter().map(|(_, to, cause)| (to, cause)).collect();
        let way = [(SlaveState::WaitCfg, SlaveCause::Parameterised), (SlaveState::DataExch, SlaveCause::Configured)];
        assert_eq!(good, way, "slave {slave}");
        assert_eq!(diagnoses(&run, slave, 200..400), [[0x42, 0x05, 0x00]], "slave {slave}");
        let patterns: Vec<_> = leds_of(&run, slave).into_iter().map(|(_, leds)| leds).skip(3).collect();
        assert_eq!(patterns, [Leds::Refused, Leds::NotAddressed, Leds::DataExchange], "slave {slave}");
        let mut between = run.slave(slave).filter(|row| (220..400).contains(&row.cycle));
        assert!(between.all(|row| row.state == SlaveState::WaitPrm), "slave {slave}");
        assert!((450..520).contains(&operates_from(&run, slave)), "slave {slave}");
        // The old fault of its sign of life ended with data exchange.
        assert_eq!(shown(&run, slave, 590), (0, 0));
    }
    assert_undisturbed(&run, 7);
}

#[test]
fn configuration_fault() {
    let run = Run::of(&scenario("configuration-fault", &[]));
    for slave in [3, 4] {
        let causes: Vec<_> = states(&run, slave).into_iter().filter(|&(cycle, ..)| cycle >= 200).collect();
        let refused = causes.iter().filter(|(.., cause)| *cause == SlaveCause::CfgFault);
        assert!(
            refused.clone().count() > 5
                && refused.clone().all(|&(cycle, to, _)| { cycle < 310 && to == SlaveState::WaitPrm })
        );
        assert!(causes.iter().all(|(cycle, to, _)| *to != SlaveState::DataExch || *cycle > 300));
        assert_eq!(diagnoses(&run, slave, 200..300), [[0x06, 0x05, 0x00]], "slave {slave}");
        // Set_Prm is good each time, so that the patterns take turns.
        let patterns = leds_of(&run, slave).into_iter().map(|(_, leds)| leds).skip(3);
        let patterns: Vec<_> = patterns.filter(|&leds| leds != Leds::NotAddressed).collect();
        let (last, refused) = patterns.split_last().expect("patterns");
        assert!(*last == Leds::DataExchange && refused.len() > 5 && refused.iter().all(|&leds| leds == Leds::Refused));
        assert!((350..400).contains(&operates_from(&run, slave)), "slave {slave}");
    }
    assert_undisturbed(&run, 5);
}

/// Changes of the DP state of one slave: cycle, state, cause.
fn states(run: &Run, slave: u8) -> Vec<(u64, SlaveState, SlaveCause)> {
    let state = |what: &Observation| match *what {
        Observation::SlaveState { to, cause, .. } => Some((to, cause)),
        _ => None,
    };
    run.events_of(slave).filter_map(|row| state(&row.what).map(|(to, cause)| (row.cycle, to, cause))).collect()
}
/// What the master read as diagnosis of one slave in these cycles, each change once.
fn diagnoses(run: &Run, number: u8, cycles: std::ops::Range<u64>) -> Vec<[u8; 3]> {
    let status = |what: &Observation| match *what {
        Observation::Diagnosis { slave, status } if slave == address(number) => Some(status),
        _ => None,
    };
    run.events_of(2).filter(|row| cycles.contains(&row.cycle)).filter_map(|row| status(&row.what)).collect()
}
/// This slave is in operation from the start-up to the end without a failure.
fn assert_undisturbed(run: &Run, slave: u8) {
    let counts = run.counts_of(slave);
    assert_eq!((counts.clock_failures, counts.fault_count(), run.phases_of(slave).len()), (0, 0, 4));
    assert!(run.slave(slave).all(|row| row.life_counter == 0));
    assert!(operates_from(run, slave) < 100);
}

#[test]
fn read_parameters() {
    let run = Run::of(&scenario("read-parameters", &[]));
    let told = run.events_of(2).filter_map(|row| match row.what {
        Observation::ParameterValue { slave, pnu, subindex, value } => Some((slave.get(), pnu, subindex, Ok(value))),
        Observation::ParameterError { slave, pnu, subindex, number } => Some((slave.get(), pnu, subindex, Err(number))),
        _ => None,
    });
    let array = |slave, pnu, first: u16, values: &[u32]| -> Vec<_> {
        (first..).zip(values).map(|(subindex, &value)| (slave, pnu, subindex, Ok(value))).collect()
    };
    let expected = [
        array(3, 918, 0, &[3]),
        array(3, 922, 0, &[81]),
        array(3, 964, 0, &[0, 0x06DF, 0x0101, 2_007, 101, 1]),
        array(3, 965, 0, &[3, 2]),
        array(3, 979, 0, &[0x0000_5111, 0x8000_0002, 8_192, 7, 0, 4_096]),
        array(4, 979, 2, &[100, 18, 0, 128]),
        vec![(3, 979, 11, Err(0x03)), (3, 925, 0, Err(0x00)), (3, 918, 0, Err(0x01))],
    ];
    assert_eq!(told.collect::<Vec<_>>(), expected.concat());
    assert!(!run.events.iter().any(|row| matches!(row.what, Observation::AcyclicFailed { .. })));

    // The acyclic part has its own place in the cycle.
    let t_dx = |cycles: std::ops::Range<u64>| -> Vec<_> {
        run.cycles.iter().filter(|row| cycles.contains(&row.cycle)).filter_map(|row| row.t_dx).collect()
    };
    assert!(t_dx(99..200).iter().all(|span| *span == t_dx(300..301)[0]));
    let asking = run.cycles.iter().filter(|row| (100..160).contains(&row.cycle));
    let longest = asking.clone().filter_map(|row| row.acyclic).max().expect("a message");
    let idle = run.row(3, 300).cycle;
    let shortest = run.cycles.iter().filter(|row| row.cycle > idle).filter_map(|row| row.acyclic).min();
    assert!(shortest < Some(longest), "{longest}");
    assert!(run.cycles.iter().all(|row| row.retries == 0));
    for slave in [3, 4] {
        assert_undisturbed(&run, slave);
    }
}

#[test]
fn t_mapc() {
    use Phase::{Clock, MasterLife, Operation, SlaveLife};
    let run = Run::of(&scenario("t-mapc", &[]));
    assert_eq!(run.phases_of(3), [(Clock, 6), (MasterLife, 23), (SlaveLife, 257), (Operation, 273)]);
    let again = [(MasterLife, 599), (SlaveLife, 850), (Operation, 866)];
    assert_eq!(run.phases_of(4)[2..], [&[(SlaveLife, 262), (Operation, 278)][..], &again].concat());
    assert_eq!((run.row(3, 256).sls, run.row(3, 257).sls, run.row(3, 258).sls), (0, 1, 2));
    // Each value of the master's is there for 14 cycles.
    let steps: Vec<_> = (34..888).filter(|&cycle| run.row(3, cycle).mls != run.row(3, cycle - 1).mls).collect();
    let on_time = |&&cycle: &&u64| (cycle - 33) % 14 == 0;
    assert_eq!(steps.iter().filter(|cycle| !on_time(cycle)).collect::<Vec<_>>(), [&496], "the lost one is seen late");

    // Twelve lost in the middle of a value: nothing. One lost at its beginning: one failure, ten good cycles repay it.
    let counters = |slave, cycles: std::ops::Range<u64>| -> Vec<u16> {
        cycles.map(|cycle| run.row(slave, cycle).life_counter).collect()
    };
    assert!(counters(3, 275..495).iter().all(|&counter| counter == 0));
    assert_eq!(counters(3, 494..507), [0, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0, 0]);
    assert!(run.faults_of(3).is_empty());
    // The master counts the twelve missing replies.
    let tripped = run.events_of(2).filter_map(|row| match row.what {
        Observation::SlaveLife { slave, tripped: true, .. } => Some((slave.get(), row.cycle)),
        _ => None,
    });
    assert_eq!(tripped.collect::<Vec<_>>(), [(3, 388), (4, 602)]);

    assert_eq!((run.faults_of(4), counters(4, 597..600)), (vec![(599, 0x0F02)], vec![0, 10, 20]));
    assert!(run.slave(4).filter(|row| (599..850).contains(&row.cycle)).all(|row| row.sls == 0));
    let starts: Vec<_> = (run.events_of(4))
        .filter(|row| row.cycle > 598 && matches!(row.what, Observation::MasterLife { to: LifeState::Strict, .. }))
        .map(|row| row.cycle)
        .collect();
    assert_eq!(starts, [600, 626]);
}

#[test]
fn leds() {
    use Leds::{DataExchange, NotAddressed, NotConfigured, Refused, Silence};
    let run = Run::of(&scenario("leds", &[]));
    let patterns = |slave| leds_of(&run, slave).into_iter().map(|(_, leds)| leds).collect::<Vec<_>>();
    let started = [NotConfigured, NotAddressed, DataExchange];
    assert_eq!(patterns(3), [&started[..], &[NotAddressed, Silence, NotAddressed, DataExchange]].concat());
    assert_eq!(patterns(4), [&started[..], &started[1..], &started[1..]].concat());
    assert_eq!(patterns(5), [&started[..], &[Refused]].concat());
    assert_eq!(patterns(6), started);
    assert_eq!(patterns(7), [&started[..], &[NotAddressed]].concat());

    // Slave 3 by the clock: the last request in cycle 299, the watchdog, 40 s, the first SYNCH.
    let at: Vec<_> = leds_of(&run, 3).into_iter().map(|(at, _)| at).collect();
    let mut last = run.telegrams.iter().filter(|&&(_, end, sender, _)| sender == address(3) && end < at[3]);
    let (request_end, ..) = last.next_back().expect("a reply");
    let near = |instant: Time, after: Span| (instant - *request_end - after).abs() < Span::from_us(5);
    assert!(near(at[3], Span::from_ms(200)) && near(at[4], Span::from_s(40)), "{:?}", &at[3..]);
    let back = run.cycles.iter().find(|row| row.cycle == 4_800).expect("a cycle");
    assert!((at[5] - back.t0).abs() < Span::from_us(1), "the first telegram of cycle 4800");
    assert!(at[6] - at[5] < Span::from_ms(500));
    // Slave 4 shows data exchange all the time, without any.
    let silent = |row: &&SlaveRow| (320..4_800).contains(&row.cycle);
    assert!(run.slave(4).filter(silent).all(|row| row.state == SlaveState::DataExch));
    // Supply: slave 6 from 20 s on, slave 7 until 30 s; a dark encoder tells nothing.
    let supply = |slave| -> Vec<_> {
        let on = |what: &Observation| if let Observation::Power { on } = *what { Some(on) } else { None };
        run.events_of(slave).filter_map(|row| Some((row.at, on(&row.what)?))).collect()
    };
    let s = |s| Time::ZERO + Span::from_s(s);
    assert_eq!((supply(6), supply(7)), (vec![(s(20), true)], vec![(s(0), true), (s(30), false)]));
    assert!(run.events_of(7).all(|row| row.at <= s(30)));
}
