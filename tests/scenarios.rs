//! The expected answers of the shipped scenarios, one test per file of `scenarios/`.
//!
//! Bounds that several tests share:
//!
//! A slave captures SYNCH on its timer grid, at most one quantum Q early (Model: D14), and the clock recovery weighs
//! captures into its prediction E. The sum of the magnitudes of its impulse response from capture to E is 1.55
//! (Model: D11 with Kp = 1/4 and Ki = 1/32), so that captures within ±b of their middle leave E within ±1.55 b. The edge
//! fires up to one more Q late. Two crystals of ±50 ppm count T_I apart by at most 100 ppm of it. A loop's ringing falls
//! by 0.866 per cycle; after a hundred cycles nothing of its beginning is left.

use std::collections::BTreeSet;
use std::path::Path;

use isodp::observation::{ClockVerdict, LifeState, LinkState, Observation, Phase, PllState};
use isodp::study::plan::Plan;
use isodp::study::row::{CycleRow, SlaveRow};
use isodp::study::scenario::Scenario;
use isodp::time::{Span, Tbit, Time};
use isodp::wire::{Address, FrameControl, Service, Telegram};

use crate::support::{Run, address, scenario};

/// Every shipped scenario with its test.
const TESTS: &[(&str, fn())] = &[
    ("fast-cycle", fast_cycle),
    ("frame-loss", frame_loss),
    ("full-segment", full_segment),
    ("gc-jitter", gc_jitter),
    ("gc-jitter-outside", gc_jitter_outside),
    ("gc-loss", gc_loss),
    ("life-sign-loss", life_sign_loss),
    ("multi-turn-motion", multi_turn_motion),
    ("reference", reference),
    ("slave-to-slave", slave_to_slave),
    ("slow-bus", slow_bus),
    ("startup", startup),
];

/// Grid of capture and timers, 1/48 us (Model: D14).
const QUANTUM: Span = Span::from_ticks(250);
/// Cycles from the first SYNCH to lock without a clock failure: three halvings of the first window and the final width
/// take four hits each (Model: D12).
const LOCK_CYCLES: u64 = 16;
/// Cycles after which a loop has forgotten how it began.
const SETTLED: u64 = 100;
/// G1_ZSW bit 15, sensor error.
const ERROR: u16 = 0x8000;

#[test]
fn every_shipped_scenario_has_a_test_and_says_what_it_asks() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    let files = std::fs::read_dir(directory).expect("the scenarios").map(|entry| entry.expect("a file").path());
    let files = files.filter(|path| path.is_file());
    let names: BTreeSet<_> = files.filter_map(|path| Some(path.file_name()?.to_str()?.to_owned())).collect();
    let tables = [
        TESTS,
        crate::encoder_scenarios::TESTS,
        crate::dp_services::TESTS,
        crate::dxb::TESTS,
        crate::topology::TESTS,
        crate::ring::TESTS,
        crate::rates::TESTS,
        crate::gsd::TESTS,
        crate::acyclic::TESTS,
        crate::disturbances::TESTS,
        crate::line::TESTS,
        crate::verdicts::TESTS,
    ];
    let tested = || tables.into_iter().flatten();
    assert_eq!(names, tested().map(|(name, _)| format!("{name}.toml")).collect());
    for &(name, _) in tested() {
        let question = scenario(name, &[]).question;
        let starts: Vec<_> = ["Question: ", "Expected: ", "Source: "].map(|word| question.find(word)).into();
        assert!(starts.is_sorted() && starts[0].is_some(), "{name}: Question, Expected, Source, in this order");
    }
}

/// `bits` at the scenario's rate.
fn tbit(scenario: &Scenario, bits: u32) -> Span {
    scenario.bus.params.span(Tbit(bits))
}

/// T_SDR in the simulation: the slave's own, or min_TSDR where that is longer, T_ID1 for publishers (Model: D2, D27).
fn t_sdr(scenario: &Scenario, slave: Address) -> u32 {
    let params = &scenario.bus.params;
    let min = if scenario.publishes(slave) { params.t_id1() } else { params.min_tsdr };
    scenario.slave(slave).expect("a slave").t_sdr.max(min).0
}

/// From t0 to the last bit of the reply of `slave` leaving it, by the closed formula of Model D2 and D4: T_ID2, then
/// request 143, T_SDR and reply 231 t_bit with the line there and back, and T_ID1 before each further one.
fn reply_end(scenario: &Scenario, slave: Address) -> Span {
    let params = &scenario.bus.params;
    let master = scenario.master.address;
    let mut at = tbit(scenario, params.t_id2().0);
    for other in scenario.configured().map(|slave| slave.address) {
        let cycle = tbit(scenario, 143 + t_sdr(scenario, other) + 231) + scenario.delay(master, other);
        if other == slave {
            return at + cycle;
        }
        at += cycle + scenario.delay(master, other) + tbit(scenario, params.t_id1().0);
    }
    panic!("no slave {slave}")
}

/// T_DX with the simulated T_SDR.
fn t_dx(scenario: &Scenario) -> Span {
    let last = scenario.configured().last().expect("a slave").address;
    reply_end(scenario, last) + scenario.delay(scenario.master.address, last)
}

/// Every T_DX of a run from `from` on. Crystals of ±50 ppm count it 100 ppm apart at most.
fn assert_t_dx(scenario: &Scenario, run: &Run, from: u64) {
    let expected = t_dx(scenario);
    let most = Span::from_ticks(expected.ticks() / 10_000 + 1);
    for row in run.cycles[..run.cycles.len() - 1].iter().filter(|row| row.cycle >= from) {
        let off = row.t_dx.expect("slaves exchange data") - expected;
        assert!(off.abs() <= most, "cycle {}: T_DX {off} off {expected}", row.cycle);
    }
}

/// Cycle in which the last slave of a run locked.
fn last_lock(run: &Run) -> u64 {
    let locked = |what: &Observation| matches!(what, Observation::Pll { to: PllState::Locked, .. });
    run.events.iter().filter(|row| locked(&row.what)).map(|row| row.cycle).max().expect("a lock")
}

/// Rows of cycles in which every loop has settled.
fn settled(run: &Run) -> impl Iterator<Item = &CycleRow> {
    let from = last_lock(run) + SETTLED;
    run.cycles[..run.cycles.len() - 1].iter().filter(move |row| row.cycle >= from)
}

/// Every slave locks `LOCK_CYCLES` after its first SYNCH, reaches operation 33 cycles later at T_MAPC = T_DP, and stays
/// there without a clock failure or fault. Returns the cycle in which the last one is in operation.
fn assert_undisturbed(scenario: &Scenario, run: &Run) -> u64 {
    let mut last = 0;
    for slave in scenario.configured().map(|slave| slave.address.get()) {
        let counts = run.counts_of(slave);
        assert_eq!(counts.lock.map(|lock| lock.cycles), Some(LOCK_CYCLES), "slave {slave}");
        assert_eq!(
            (counts.clock_failures, counts.resynchronisations, counts.fault_count()),
            (0, 0, 0),
            "slave {slave}"
        );
        let phases = run.phases_of(slave);
        let (_, clock) = phases[0];
        let expected = [(Phase::Clock, 0), (Phase::MasterLife, 17), (Phase::SlaveLife, 34), (Phase::Operation, 50)];
        assert_eq!(phases, expected.map(|(phase, after)| (phase, clock + after)), "slave {slave}");
        last = last.max(clock + 50);
    }
    last
}

/// Largest and smallest latch skew of settled cycles lie around the delay of the line between the first and the last
/// encoder, the common jitter of SYNCH away: each loop adds ±1.55 Q/2 and Q.
fn assert_skew(scenario: &Scenario, run: &Run) {
    let mut encoders = scenario.slaves.iter().filter(|slave| !slave.device.subscriber);
    let first = encoders.next().expect("an encoder");
    let last = encoders.next_back().expect("another one");
    let line = scenario.delay(first.address, last.address);
    let t_i = Span::from_ticks(first.times.t_i.ticks() / 10_000);
    let most = line + Span::from_ticks(QUANTUM.ticks() * 255 / 100) + t_i;
    let skews: Vec<_> = settled(run).map(|row| row.latch_skew.expect("all are locked")).collect();
    assert!(skews.len() > 400, "{} settled cycles", skews.len());
    let (low, high) = (skews.iter().min().expect("some"), skews.iter().max().expect("some"));
    assert!(*high <= most, "{high} of {most}");
    assert!(*low >= line - (most - line), "{low}, line {line}");
}

/// Latch offsets of settled cycles: the delay of the line from the master, the loop's answer to jitter within ±`bound`,
/// and the timer grid.
fn assert_latch_offsets(scenario: &Scenario, run: &Run, bound: Span) {
    let (from, end) = (last_lock(run) + SETTLED, run.cycles.len() as u64 - 1);
    for row in run.slaves.iter().filter(|row| (from..end).contains(&row.cycle)) {
        let slave = scenario.slave(row.slave).expect("a slave");
        let loop_part = Span::from_ticks((bound.ticks() + QUANTUM.ticks() / 2) * 155 / 100 + 1);
        let t_i = Span::from_ticks(slave.times.t_i.ticks() / 10_000);
        let middle = scenario.delay(scenario.master.address, row.slave) - Span::from_ticks(QUANTUM.ticks() / 2);
        let off = row.latch_offset.expect("locked") - middle - slave.times.t_pll_d;
        let range = -loop_part - t_i..=loop_part + QUANTUM + t_i;
        assert!(range.contains(&off), "slave {} cycle {}: {off} not in {range:?}", row.slave, row.cycle);
    }
}

/// From the cycle of a fault until its acknowledgement, G1_ZSW bit 15 is 1 and G1_XIST2 has the code.
fn assert_shown(run: &Run, slave: u8, cycles: std::ops::Range<u64>, code: u16) {
    let shown = |row: &SlaveRow| row.g1_zsw & ERROR != 0 && row.xist2 == u32::from(code);
    assert!(!shown(run.row(slave, cycles.start - 1)), "before");
    for row in run.slave(slave).filter(|row| cycles.contains(&row.cycle)) {
        assert!(shown(row), "slave {slave} cycle {}: {:04X} {:04X}", row.cycle, row.g1_zsw, row.xist2);
    }
    let after = run.row(slave, cycles.end);
    assert_eq!((after.g1_zsw & ERROR, after.xist2), (0, 0), "acknowledged");
}

/// The observations of one station in one cycle.
fn observed(run: &Run, slave: u8, cycle: u64) -> impl Iterator<Item = &Observation> {
    run.events_of(slave).filter(move |row| row.cycle == cycle).map(|row| &row.what)
}

/// One acyclic message per cycle brings a slave through Slave_Diag, Get_Cfg, Set_Prm, Chk_Cfg and Slave_Diag; a slave that
/// gets on has all of them (slave 4 is without supply). Operate is told in the cycle after, and with the Data_Exchange
/// after this the clock recovery begins.
#[test]
fn startup() {
    use Phase::{Clock, MasterLife, Operation, SlaveLife};
    let network = scenario("startup", &[]);
    let run = Run::of(&network);
    assert_eq!(run.phases_of(3), [(Clock, 6), (MasterLife, 23), (SlaveLife, 40), (Operation, 56)]);
    assert_eq!(run.phases_of(4), [(Clock, 105), (MasterLife, 122), (SlaveLife, 139), (Operation, 155)]);
    assert_undisturbed(&network, &run);

    // The signs of life count 1 to 15 and on with 1; the slave's begins 16 steps after the start value in cycle 24.
    let ring = |since: u64| (since % 15) as u8 + 1;
    for row in run.slave(3).filter(|row| row.cycle < 298) {
        let sls = if row.cycle < 40 { 0 } else { ring(row.cycle - 40) };
        let mls = if row.cycle < 23 { 0 } else { ring(row.cycle - 5) };
        assert_eq!((row.sls, row.mls, row.life_counter, row.clock_counter), (sls, mls, 0, 0), "cycle {}", row.cycle);
        assert_eq!((row.g1_zsw & ERROR, row.latch_offset.is_some()), (0, row.cycle >= 23), "cycle {}", row.cycle);
    }
    // What is latched in a cycle travels in the next (Model: D8).
    assert_eq!([40, 41, 42].map(|k| run.reply(3, k).expect("a reply").zsw2.sign_of_life().get()), [0, 1, 2]);
    // No crystal is off: nothing but the line and the timer grid moves a latch.
    for row in run.slaves.iter().filter(|row| row.latch_offset.is_some()) {
        let late = row.latch_offset.expect("locked") - network.delay(network.master.address, row.slave);
        assert!(-QUANTUM < late && late <= Span::ZERO, "{late}");
    }
    let both = |row: &&CycleRow| (105..298).contains(&row.cycle);
    assert!(run.cycles.iter().filter(both).all(|row| row.t_dx == Some(t_dx(&network))));
}

/// w is 1 us and the jitter half of it to each side: the error of the loop stays inside.
#[test]
fn gc_jitter() {
    let network = scenario("gc-jitter", &[]);
    let run = Run::of(&network);
    assert_undisturbed(&network, &run);
    let (jitter, window) = (Span::from_ns(500), Span::from_us(1));
    let strays = || run.cycles.iter().map(|row| row.gc_jitter);
    assert!(strays().all(|stray| stray.abs() <= jitter + Span::from_ticks(1)));
    assert!(strays().max() > Some(jitter - Span::from_ns(5)) && strays().min() < Some(Span::from_ns(5) - jitter));
    let errors = || run.slaves.iter().filter(|row| row.pll == PllState::Locked).filter_map(|row| row.pll_error);
    let worst = errors().map(Span::abs).max().expect("errors");
    assert!((Span::from_ns(800)..=window).contains(&worst), "{worst} of {window}");
    assert_latch_offsets(&network, &run, jitter);
    assert_skew(&network, &run);
    assert_t_dx(&network, &run, last_lock(&run));
}

/// 1.1 w to each side: clock failures come often enough that none of ten good cycles in a row repays them.
#[test]
fn gc_jitter_outside() {
    let network = scenario("gc-jitter-outside", &[]);
    let run = Run::of(&network);
    for slave in 3..=6 {
        let counts = run.counts_of(slave);
        assert!(counts.clock_failures > 1_000, "slave {slave}: {} clock failures", counts.clock_failures);
        assert!(counts.resynchronisations > 200, "slave {slave}: {}", counts.resynchronisations);
        // The fault is latched once until its acknowledgement, however often the clock is lost.
        let faults = run.faults_of(slave);
        assert_eq!(faults.iter().map(|&(_, code)| code).collect::<Vec<_>>(), [0x0F04; 2], "slave {slave}");
        let [(first, _), (second, _)] = faults[..] else { panic!("two faults") };
        assert_shown(&run, slave, first..4_999, 0x0F04);
        assert!((4_999..5_100).contains(&second), "slave {slave}: {second}");
        assert_eq!(counts.acknowledgements, 1);
        assert_losses(&run, slave);
    }
}

/// Each loss of lock comes with a counter above 10 and at most 20, and takes the slave's sign of life away.
fn assert_losses(run: &Run, slave: u8) {
    let mut last = 0;
    let mut count = 0;
    for (_, station, what) in &run.observations {
        match *what {
            _ if *station != address(slave) => {}
            Observation::Clock { verdict, counter, .. } if verdict != ClockVerdict::Stray => last = counter,
            Observation::Pll { from: PllState::Locked, to } => {
                assert_eq!(to, PllState::Waiting);
                assert!((11..=20).contains(&last), "slave {slave}: counter {last}");
                count += 1;
            }
            _ => {}
        }
    }
    assert!(count > 200, "slave {slave}: {count} losses");
    let searching = |row: &&SlaveRow| row.phase == Phase::Clock;
    assert!(run.slave(slave).filter(searching).all(|row| row.sls == 0 && row.mls == 0));
}

/// Slave 3 tolerates one clock failure, slave 4 two. Clock 200 is missing, and clocks 300 and 301.
#[test]
fn gc_loss() {
    use Phase::{Clock, MasterLife, Operation, SlaveLife};
    let network = scenario("gc-loss", &[]);
    let run = Run::of(&network);
    let counters = |slave, cycles: std::ops::Range<u64>| {
        cycles.map(|cycle| run.row(slave, cycle).clock_counter).collect::<Vec<_>>()
    };
    let repaid = [0, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0, 0];
    assert_eq!([counters(3, 199..212), counters(4, 199..212)], [repaid; 2]);
    assert_eq!(counters(3, 299..303), [0, 10, 20, 0]);
    assert_eq!(counters(4, 299..304), [0, 10, 20, 19, 18]);

    // The second one trips slave 3: 0F04 and sign of life 0 in the same cycle, and the clock is searched at once.
    assert_eq!(run.faults_of(3), [(301, 0x0F04)]);
    let again = [(Clock, 301), (MasterLife, 318), (SlaveLife, 335), (Operation, 351)];
    assert_eq!(run.phases_of(3)[4..], again);
    assert_ne!(run.row(3, 300).sls, 0);
    assert!(run.slave(3).filter(|row| (301..335).contains(&row.cycle)).all(|row| row.sls == 0));
    assert_eq!([335, 336].map(|k| run.row(3, k).sls), [1, 2]);
    assert_eq!(run.row(3, 301).pll, PllState::Waiting);
    let first = |what: &Observation| matches!(what, Observation::Clock { verdict: ClockVerdict::First, .. });
    assert!(observed(&run, 3, 302).any(first));
    // Without a clock the position goes along with the request: the fault is in the reply of its own cycle.
    let reply = run.reply(3, 301).expect("a reply");
    assert_eq!((reply.zsw2.0, reply.g1_zsw.0, reply.xist2), (0, ERROR, 0x0F04));

    // In operation again since cycle 351, and still shown until the master acknowledges it.
    assert_shown(&run, 3, 301..500, 0x0F04);
    assert!(observed(&run, 3, 500).any(|what| *what == Observation::Acknowledged { code: 0x0F04 }));
    assert_eq!(run.counts_of(3).acknowledgements, 1);
    // The master sees sign of life 0 in the replies of cycles 301 to 305, one more than it tolerates.
    let lost = |row: &&isodp::study::row::EventRow| matches!(row.what, Observation::SlaveLife { tripped: true, .. });
    assert_eq!(run.events_of(2).filter(lost).map(|row| row.cycle).collect::<Vec<_>>(), [305]);

    // Slave 4 runs on: same phase, no fault, and its latch stays where it was although clocks are missing.
    assert_eq!((run.phases_of(4).len(), run.faults_of(4).len()), (4, 0));
    assert_latch_offsets(&scenario_of(&network, 4), &only(&run, 4), Span::ZERO);
}

/// The scenario with one slave.
fn scenario_of(network: &Scenario, slave: u8) -> Scenario {
    let mut network = network.clone();
    network.slaves.retain(|other| other.address == address(slave));
    network
}

/// The cycles and the slave rows and events of one slave.
fn only(run: &Run, slave: u8) -> Run {
    Run {
        cycles: run.cycles.clone(),
        slaves: run.slave(slave).copied().collect(),
        events: run.events_of(slave).copied().collect(),
        ..Run::default()
    }
}

/// One lost request in a hundred, by chance: the failure counter is the chain that the losses make of it.
#[test]
fn frame_loss() {
    let network = scenario("frame-loss", &[]);
    let run = Run::of(&network);
    let lost = |cycle| {
        run.events.iter().any(|event| event.cycle == cycle && matches!(event.what, Observation::Disturbed { .. }))
    };
    let (mut counter, mut cycle) = (0_u16, 400);
    while counter <= 10 {
        counter = if lost(cycle) { counter + 10 } else { counter.saturating_sub(1) };
        assert_eq!(run.row(3, cycle).life_counter, counter, "cycle {cycle}");
        cycle += 1;
    }
    let tripped = cycle - 1;
    assert_eq!(run.faults_of(3), [(tripped, 0x0F02)]);
    let (all, rounds) = ((400..2_400).filter(|&cycle| lost(cycle)).count(), run.phases_of(3).len() / 3);
    assert!(all > 2 * rounds, "single losses are forgiven: {all} losses, {rounds} times into operation");
    // It synchronises again, and a further loss in between costs it another round.
    let back =
        run.phases_of(3).iter().find(|&&(phase, at)| phase == Phase::Operation && at > tripped).map(|last| last.1);
    assert!(back.is_some_and(|back| back >= tripped + 32), "{back:?}");
    assert!(run.slave(3).filter(|row| row.cycle >= 150).all(|row| row.pll == PllState::Locked));
}

/// Requests to slave 3 are lost in cycle 200 and in cycles 300 and 301; the master stops counting for slave 4 in cycles
/// 500 to 529; replies of slave 5 are lost in cycles 650 to 653 and 700 to 704.
#[test]
fn life_sign_loss() {
    use Phase::{MasterLife, Operation, SlaveLife};
    let network = scenario("life-sign-loss", &[]);
    let run = Run::of(&network);
    let counters = |slave, cycles: std::ops::Range<u64>| {
        cycles.map(|cycle| run.row(slave, cycle).life_counter).collect::<Vec<_>>()
    };
    // The stale value is one failure, and ten good cycles repay it.
    assert_eq!(counters(3, 199..212), [0, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0, 0]);
    // Two in a row trip: sign of life 0 and the fault in the same cycle. The value after is the new start value.
    assert_eq!(counters(3, 299..304), [0, 10, 20, 0, 0]);
    assert_eq!(run.faults_of(3), [(301, 0x0F02)]);
    assert_eq!(run.phases_of(3)[4..], [(MasterLife, 301), (SlaveLife, 318), (Operation, 334)]);
    assert_eq!([300, 301, 317, 318, 319].map(|k| run.row(3, k).sls), [6, 0, 0, 1, 2]);
    assert_shown(&run, 3, 301..400, 0x0F02);
    let reply = run.reply(3, 302).expect("a reply");
    assert_eq!((reply.zsw2.0, reply.g1_zsw.0, reply.xist2), (0, ERROR, 0x0F02));
    // The clock has nothing to do with it.
    assert!(
        run.slave(3).filter(|row| row.cycle >= 150).all(|row| row.pll == PllState::Locked && row.clock_counter == 0)
    );

    // A master application that stops: the second repeated value trips, its first new one starts over.
    assert_eq!(counters(4, 499..503), [0, 10, 20, 20]);
    assert_eq!(run.faults_of(4), [(501, 0x0F02)]);
    assert_eq!(run.phases_of(4)[4..], [(MasterLife, 501), (SlaveLife, 546), (Operation, 562)]);
    assert!(run.slave(4).filter(|row| (501..546).contains(&row.cycle)).all(|row| row.sls == 0));
    assert_shown(&run, 4, 501..600, 0x0F02);

    // The other direction: the master tolerates four lost replies and not five; slave 5 notices nothing.
    let lives: Vec<_> = (run.events_of(2))
        .filter_map(|row| match row.what {
            Observation::SlaveLife { slave, to, tripped, .. } if slave == address(5) => Some((row.cycle, to, tripped)),
            _ => None,
        })
        .filter(|&(cycle, ..)| cycle >= 100)
        .collect();
    let (waiting, strict) = ((704, LifeState::Waiting, true), (705, LifeState::Strict, false));
    let (confirming, operating) = ((721, LifeState::Confirming, false), (737, LifeState::Operating, false));
    assert_eq!(lives, [waiting, strict, confirming, operating]);
    assert_eq!((run.phases_of(5).len(), run.faults_of(5).len(), run.row(5, 701).life_counter), (4, 0, 0));
    let network_counts = &run.counts.as_ref().expect("the run is over").network;
    // Only the first of a row is repeated: a station that did not answer gets no repeats.
    assert_eq!((network_counts.retries, network_counts.no_answers), (4, 12));
}

/// No crystal is off and the clock does not jitter: every latency is exact.
#[test]
fn slave_to_slave() {
    let network = scenario("slave-to-slave", &[]);
    let run = Run::of(&network);
    let operation = assert_undisturbed(&network, &run);
    let links: Vec<_> = network.links.iter().map(|link| (link.publisher, link.subscriber)).collect();
    assert_eq!(links.len(), 5);
    for (publisher, subscriber) in links {
        let line = network.delay(publisher, subscriber);
        let rows: Vec<_> = (run.links.iter())
            .filter(|row| (row.publisher, row.subscriber) == (publisher, subscriber))
            .filter(|row| (operation..300).contains(&row.cycle) || (303..665).contains(&row.cycle))
            .collect();
        assert!(rows.len() > 500, "{} rows", rows.len());
        for row in rows {
            // First bit to last bit of 21 octets, and the line between the two.
            assert_eq!(row.wire, tbit(&network, 231) + line);
            // The latch is T_I before this cycle, and as late as the publisher's edge is.
            let late = |slave: Address| run.row(slave.get(), row.cycle - 1).latch_offset.expect("locked");
            let t_i = network.slave(publisher).expect("a slave").times.t_i;
            assert_eq!(row.publish, t_i - late(publisher) + reply_end(&network, publisher) + line);
            let t_o = network.slave(subscriber).expect("a slave").times.t_o;
            assert_eq!(row.age, Some(t_i - late(publisher) + t_o + late(subscriber)), "{row:?}");
        }
    }
    assert_lost_publisher(&network, &run);
    assert_values_used(&run, operation);
}

/// Replies of publisher 4 are lost in cycles 300 to 302: the first one and its repeat, then one each.
fn assert_lost_publisher(network: &Scenario, run: &Run) {
    let lost = 300..303;
    let links = |publisher| run.links.iter().filter(move |row| row.publisher == address(publisher));
    assert!(links(4).all(|row| !lost.contains(&row.cycle)));
    let states = (run.events_of(10).chain(run.events_of(11)))
        .filter(|row| matches!(row.what, Observation::Link { to: LinkState::Lost, .. }));
    assert_eq!(states.count(), 0, "three cycles are far below the watchdog time");
    // A request without answer takes T_SL instead of T_SDR, reply and line.
    let line = network.delay(network.master.address, address(4));
    let answered = tbit(network, t_sdr(network, address(4)) + 231) + line * 2;
    let unanswered = tbit(network, network.bus.params.t_sl.0);
    let once = unanswered - answered;
    let repeat = tbit(network, 143 + network.bus.params.t_id1().0) + unanswered;
    let publish = |cycle| links(5).find(|row| row.cycle == cycle).expect("a row").publish;
    let usual = publish(299);
    assert_eq!([300, 301, 302, 303].map(|cycle| publish(cycle) - usual), [once + repeat, once, once, Span::ZERO]);
}

/// A subscriber uses at T_O of cycle k what its publisher latched in cycle k - 1 (Model: D8), or what it had.
fn assert_values_used(run: &Run, operation: u64) {
    let publishers = [3, 4, 5].map(address);
    let mut cycle = 0;
    let mut used = 0;
    for (_, station, what) in &run.observations {
        match *what {
            Observation::CycleStart { cycle: begun, .. } => cycle = begun,
            Observation::Used { publisher, position } if *station == address(11) && cycle > operation => {
                assert!(publishers.contains(&publisher));
                let stale = publisher == address(4) && (300..303).contains(&cycle);
                let latched = if stale { 298 + 1 } else { cycle };
                assert_eq!(position, run.row(publisher.get(), latched - 1).xist1, "cycle {cycle} of {publisher}");
                used += 1;
            }
            _ => {}
        }
    }
    assert!(used > 1_500);
}

#[test]
fn slow_bus() {
    let network = scenario("slow-bus", &[]);
    let run = Run::of(&network);
    let plan = Plan::of(&network);
    // T_ID2, then three times request, longest T_SDR, reply, with T_ID1 between; the line is 1/3, 2/3 and all of 1 us.
    let bits = 150 + 3 * (143 + 150 + 231) + 2 * 37;
    let line = Span::from_us(4);
    assert!((plan.t_dx - tbit(&network, bits) - line).abs() <= Span::from_ticks(6), "{}", plan.t_dx);
    assert_eq!(plan.t_o_min(&network.slaves[0].device), network.slaves[0].times.t_o);
    assert_undisturbed(&network, &run);
    assert_t_dx(&network, &run, last_lock(&run));
    assert_latch_offsets(&network, &run, Span::from_ns(400));
    assert_skew(&network, &run);
}

#[test]
fn fast_cycle() {
    let network = scenario("fast-cycle", &[]);
    let run = Run::of(&network);
    let plan = Plan::of(&network);
    assert_eq!(plan.t_o_min(&network.slaves[0].device), Span::from_us(625));
    assert_undisturbed(&network, &run);
    assert_t_dx(&network, &run, last_lock(&run));
    assert_latch_offsets(&network, &run, Span::from_ns(400));
    assert_skew(&network, &run);
    assert_order(&network, &run, 1_000..1_200);
}

/// SYNCH, every slave in address order, at most one Global_Control, at most one GAP poll, the token (Model: D6).
fn assert_order(network: &Scenario, run: &Run, cycles: std::ops::Range<u64>) {
    let (mut polls, mut controls) = (Vec::new(), Vec::new());
    for cycle in cycles {
        let mut rest: Vec<_> = run.telegrams_in(cycle).map(|(.., octets)| Telegram::parse(octets)).collect();
        // SYNCH of the next cycle begins before that cycle does.
        let synch = rest.pop().expect("a telegram");
        assert!(
            matches!(synch, Ok(Telegram::Data { header, du: [0x00, 0x80] }) if header.da.is_broadcast()),
            "{synch:?}"
        );
        let mut rest = rest.into_iter();
        for slave in network.slaves.iter().map(|slave| slave.address) {
            let (request, reply) = (rest.next(), rest.next());
            assert!(matches!(request, Some(Ok(Telegram::Data { header, du })) if header.da == slave && du.len() == 4));
            assert!(matches!(reply, Some(Ok(Telegram::Data { header, du })) if header.sa == slave && du.len() == 12));
        }
        let mut kinds = String::new();
        for telegram in rest {
            match telegram {
                Ok(Telegram::Token { .. }) => kinds.push('t'),
                Ok(Telegram::Data { header, du: [0x00, 0x00] }) if header.da.is_broadcast() => kinds.push('c'),
                Ok(Telegram::Data { header, du: [] }) => match header.fc {
                    FrameControl::Request { service: Service::FdlStatus, .. } => kinds.push('g'),
                    fc => assert!(matches!(fc, FrameControl::Response { .. }), "{fc:?}"),
                },
                other => panic!("{other:?}"),
            }
        }
        polls.extend(kinds.contains('g').then_some(cycle));
        controls.extend(kinds.contains('c').then_some(cycle));
        assert!(["t", "ct", "gt", "cgt"].contains(&kinds.as_str()), "cycle {cycle}: {kinds}");
    }
    assert!(polls.windows(2).all(|pair| pair[1] - pair[0] == 10), "every tenth cycle: {polls:?}");
    // Operate at least every third of Data_Control_Time, 200 ms (Model: D5).
    assert!(controls.len() > 1 && controls.windows(2).all(|pair| pair[1] - pair[0] == 66), "{controls:?}");
}

/// 32 stations are the most that one segment drives.
#[test]
fn full_segment() {
    let network = scenario("full-segment", &[]);
    let run = Run::of(&network);
    let plan = Plan::of(&network);
    assert_eq!(1 + network.slaves.len(), 32);
    let device = &network.slaves[0].device;
    let bits = 800 + 31 * (143 + 800 + 231) + 30 * 76;
    // Slaves sit at 1/31 to 31/31 of 500 ns: twice 16 times 500 ns for all.
    let line = Span::from_us(16);
    assert!((plan.t_dx - tbit(&network, bits) - line).abs() <= Span::from_ticks(2 * 31), "{}", plan.t_dx);
    assert_eq!(plan.t_o_min(device), Span::from_us(3_500));
    assert_eq!((plan.t_dp_min(device), network.master.t_dp), (Span::from_us(3_500), Span::from_us(3_750)));
    let operation = assert_undisturbed(&network, &run);
    assert!(operation < 320, "{operation}");
    assert_t_dx(&network, &run, last_lock(&run));
    assert_latch_offsets(&network, &run, Span::from_ns(400));
    assert_skew(&network, &run);
    let age = |publisher| {
        let rows = run.links.iter().filter(move |row| row.publisher == address(publisher) && row.cycle > operation);
        rows.map(|row| row.publish).max().expect("rows")
    };
    // The nearer in address order, the sooner: 29 message cycles of 143 + T_SDR 30 + 231 + T_ID1 76, and the line.
    let between = age(32) - age(3);
    let expected = reply_end(&network, address(32)) - reply_end(&network, address(3));
    let line = Span::from_us(1);
    assert!((between - expected).abs() < line, "{between}, {expected}");
}

/// Where a shaft of `multi-turn-motion` stands (revolutions) at true time `t` (s), as its file says.
fn revolutions(slave: u8, t: f64) -> f64 {
    match slave {
        3 | 4 => 4_000.0 + 100.0 * t,
        5 => 10.0 * (std::f64::consts::TAU * t / 0.8).sin(),
        6 if t < 0.5 => 4_094.0,
        6 if t < 1.0 => 4_094.0 + 6.25 * (t - 0.5) / 0.5,
        6 if t < 1.5 => 4_100.25 - 5.75 * (t - 1.0) / 0.5,
        6 => 4_094.5,
        _ => 20.0 - 50.0 * t,
    }
}

#[test]
fn multi_turn_motion() {
    let network = scenario("multi-turn-motion", &[]);
    let run = Run::of(&network);
    assert_undisturbed(&network, &run);
    assert_latch_offsets(&network, &run, Span::ZERO);
    assert_positions(&run);
    assert_wraps(&run);
    assert_skew_in_counts(&run);
}

/// Every position is the step in which the shaft stood at the true instant of its latch.
fn assert_positions(run: &Run) {
    /// Steps of all revolutions, 13 + 12 bit.
    const STEPS: f64 = 33_554_432.0;
    let mut seen = [0; 8];
    for (at, station, what) in &run.observations {
        let Observation::Latch { locked: true, inputs } = *what else { continue };
        let slave = station.get();
        let steps = (revolutions(slave, at.since_zero().as_s()) * 8_192.0).rem_euclid(STEPS);
        let (exact, range, shift) = match slave {
            7 => ((steps.floor() * 100.0 / 8_192.0) % 12_800.0, 12_800.0, 18),
            _ => (steps, STEPS, 7),
        };
        assert_eq!(inputs.xist1, inputs.xist2 << shift, "XIST1 is left-justified");
        assert_eq!(inputs.g1_zsw, 0x2000);
        // The simulated shaft is rounded to 2^-32 revolutions, and this formula to 53 bits.
        let within = (exact - f64::from(inputs.xist2) + 1e-4).rem_euclid(range);
        assert!(within < 1.0 + 2e-4, "slave {slave} at {at:?}: {} for {exact}", inputs.xist2);
        seen[usize::from(slave)] += 1;
    }
    assert!(seen[3..].iter().all(|&count| count > 900), "{seen:?}");
}

/// The position wraps at 4096 revolutions, or at its scaled range; signed differences of a full XIST1 do not see it.
fn assert_wraps(run: &Run) {
    let last = run.cycles.len() as u64 - 1;
    let values = |slave| {
        let rows = run.slave(slave).filter(move |row| row.latch_offset.is_some() && row.cycle < last);
        rows.map(|row| (row.xist1, row.xist2)).collect::<Vec<_>>()
    };
    let wraps = |slave, half: u32| {
        let values = values(slave);
        let jumps = values.windows(2).map(|pair| (pair[0].1, pair[1].1)).filter(|&(a, b)| a.abs_diff(b) > half);
        jumps.map(|(a, b)| b < a).collect::<Vec<_>>()
    };
    let half = 1 << 24;
    // 96 revolutions at 100 per second, once; the sine starts upwards from 0 and comes back through it every 400 ms.
    assert_eq!([3, 4].map(|slave| wraps(slave, half)), [[true]; 2]);
    assert_eq!(wraps(5, half), [false, true, false, true]);
    assert_eq!(wraps(6, half), [true, false]);
    // 20 revolutions down at 50 per second to 0, where the disc wraps too, and 128 revolutions later again.
    assert_eq!(wraps(7, 6_400), [false]);
    // 100 revolutions per second are 1638.4 steps in 2 ms; the master's crystal is at most 50 ppm off.
    for pair in values(3).windows(2) {
        let steps = pair[1].0.wrapping_sub(pair[0].0) as i32 >> 7;
        assert!((1_638..=1_639).contains(&steps), "{steps}");
    }
}

/// Slaves 3 and 4 sit on one shaft; slave 4 latches T_PLL_D = 20 us later. A skew in time is a skew in counts.
fn assert_skew_in_counts(run: &Run) {
    /// 6000 rpm with 8192 steps (steps/s).
    const SPEED: f64 = 819_200.0;
    let last = run.cycles.len() as u64 - 1;
    let early = run.slave(3).filter(|row| row.cycle < last);
    let mut compared = 0;
    for (early, late) in early.zip(run.slave(4)) {
        let (Some(a), Some(b)) = (early.latch_offset, late.latch_offset) else { continue };
        let skew = b - a;
        assert!((skew - Span::from_us(20)).abs() < Span::from_ns(200), "{skew}");
        let counts = f64::from(late.xist2.wrapping_sub(early.xist2) << 7 >> 7);
        // Each of the two is rounded down.
        assert!((counts - skew.as_s() * SPEED).abs() < 1.0, "{counts} counts in {skew}");
        compared += 1;
    }
    assert!(compared > 900);
}

#[test]
fn reference() {
    let network = scenario("reference", &[]);
    let run = Run::of(&network);
    let operation = assert_undisturbed(&network, &run);
    let in_operation = (network.master.t_dp * operation as i64, Span::from_ms(220));
    assert!(in_operation.0 < in_operation.1, "{in_operation:?}");
    assert!(run.cycles.last().is_some_and(|row| row.t0 < Time::ZERO + Span::from_s(20)));
    assert_t_dx(&network, &run, last_lock(&run));
    assert_latch_offsets(&network, &run, Span::from_ns(400));
    assert_skew(&network, &run);
    // 3 -> 11: the latch is T_I before the cycle, the reply ends 229.6 us after it; T_I + T_O until it is used.
    for row in run.links.iter().filter(|row| row.cycle > operation) {
        let off = |span: Span, us: f64| (span.as_us() - us).abs();
        assert!(off(row.publish, 229.6) < 1.0 && row.age.is_none_or(|age| off(age, 1_375.4) < 1.0), "{row:?}");
        assert!(off(row.wire, 19.25 + 0.444) < 0.003, "{row:?}");
    }
}
