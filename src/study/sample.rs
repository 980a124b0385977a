//! Samples for tests: a network of two slaves and rows whose measured spans are all different.

use super::count::{Counts, Lock};
use super::export::thinning::Thinning;
use super::histogram::Histograms;
use super::layout::{Layout, SlaveLayout};
use super::row::{CycleRow, EventRow, LinkRow, Sink, SlaveRow};
use super::summary::{Facts, SlaveFacts, Summary};
use crate::observation::{HandlerState, Leds, Observation, Phase, PllState, SlaveState};
use crate::time::{BitRate, Span, Time};
use crate::wire::Address;

pub(super) fn address(number: u8) -> Address {
    Address::new(number).unwrap()
}

/// Master 1, slaves 3 and 5, 3 publishes to 5; T_DP 1 ms, T_I 125 µs.
pub(super) fn layout() -> Layout {
    let slave = |number| SlaveLayout { address: address(number), t_i: Span::from_us(125), encoder: true };
    Layout::new(address(1), Span::from_ms(1), vec![slave(3), slave(5)], vec![(address(3), address(5))])
}

pub(super) fn cycle(cycle: u64) -> CycleRow {
    CycleRow {
        cycle,
        t0: Time::ZERO + Span::from_ms(cycle as i64),
        gc_jitter: Span::from_ticks(-1),
        synch_delay: Some(Span::from_us(55)),
        t_dp: Some(Span::from_ms(1) + Span::from_ticks(2)),
        t_dp_deviation: Some(Span::from_ticks(2)),
        t_dx: Some(Span::from_us(449)),
        latch_skew: Some(Span::from_ns(90)),
        skew_counts: Some(0.25),
        retries: 1,
        acyclic: None,
        spare: Some(Span::from_us(300)),
    }
}

pub(super) fn slave(cycle: u64, slave: u8) -> SlaveRow {
    SlaveRow {
        cycle,
        t0: Time::ZERO + Span::from_ms(cycle as i64),
        slave: address(slave),
        state: SlaveState::DataExch,
        phase: Phase::Operation,
        pll: PllState::Locked,
        leds: Leds::DataExchange,
        pll_error: Some(Span::from_ns(-42)),
        period: Some(Span::from_ms(1)),
        window: Some(Span::from_us(1)),
        latch_offset: Some(Span::from_ns(45)),
        mls: 3,
        sls: 4,
        life_counter: 0,
        clock_counter: 10,
        g1_zsw: 0x1000,
        xist1: 0xFFFF_FFFF,
        xist2: 17,
    }
}

pub(super) fn link(cycle: u64) -> LinkRow {
    LinkRow {
        cycle,
        publisher: address(3),
        subscriber: address(5),
        wire: Span::from_us(21),
        publish: Span::from_us(400),
        age: Some(Span::from_us(750)),
    }
}

pub(super) fn event(cycle: u64) -> EventRow {
    let at = Time::ZERO + Span::from_ms(cycle as i64) + Span::from_us(1);
    EventRow { at, cycle, station: address(5), what: Observation::Fault { code: 0x0F04 } }
}

/// What the builder of a run knows.
pub(super) fn facts() -> Facts {
    let slave = SlaveFacts { device: "encoder".to_owned(), t_o: Some(Span::from_us(625)) };
    Facts {
        scenario: "sample".to_owned(),
        bit_rate: BitRate::M12,
        seed: 1,
        slaves: vec![slave.clone(), slave],
        fingerprint: vec![("wire".to_owned(), "0123456789abcdef".to_owned())],
    }
}

/// A run of ten seconds without a single row.
pub(super) fn summary() -> Summary {
    let mut counts = Counts::new(&layout());
    counts.finish(Time::ZERO + Span::from_s(10));
    Summary::new(facts(), &counts, &Histograms::new(&layout()))
}

/// What the master observed in a run: it finds slave 5, loses it and finds it again; two requests are repeated.
fn seen() -> [Observation; 8] {
    let slave = address(5);
    let (from, to) = (HandlerState::AwaitReady, HandlerState::DataExchange);
    let joined = Observation::Handler { slave, from, to };
    [
        Observation::TokenClaimed,
        Observation::DiagnosisRead { slave },
        joined,
        Observation::Retry { slave },
        Observation::Retry { slave },
        Observation::Lost { slave },
        Observation::DiagnosisRead { slave },
        joined,
    ]
}

/// A run of three cycles in which slave 5 did something.
pub(super) fn run() -> Summary {
    let (layout, mut counts, facts) = (layout(), Counts::new(&layout()), facts());
    let mut histograms = Histograms::new(&layout);
    for number in 0..3 {
        histograms.cycle(&cycle(number));
        histograms.slave(&slave(number, 5));
        histograms.link(&link(number));
    }
    counts.network.cycles = 3;
    counts.network.retries = 2;
    counts.network.skew_counts = Some(0.25);
    let slave = &mut counts.slaves[1];
    (slave.state, slave.phase, slave.pll) = (SlaveState::DataExch, Phase::Operation, PllState::Locked);
    slave.leds = Leds::DataExchange;
    slave.lock = Some(Lock { cycles: 20, span: Span::from_ms(20) });
    slave.faults.insert(0x0F04, 1);
    for what in seen() {
        counts.live_list.observe(address(1), &what);
    }
    counts.network.cycle_times.add(Span::from_ms(1));
    counts.network.cycle_times.add(Span::from_us(1_001));
    counts.finish(Time::ZERO + Span::from_s(10));
    let mut summary = Summary::new(facts, &counts, &histograms);
    summary.show_leds(&counts);
    summary.show_receptions(&counts);
    summary.thinning = vec![Thinning::new("cycles.csv", 1_000, 3, 1)];
    summary.files = vec!["cycles.csv".to_owned(), "summary.json".to_owned()];
    summary
}
