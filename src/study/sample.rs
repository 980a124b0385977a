//! Samples for tests: a network of two slaves and rows whose measured spans are all different.

use super::layout::{Layout, SlaveLayout};
use super::row::{CycleRow, EventRow, LinkRow, SlaveRow};
use crate::observation::{Observation, Phase, PllState, SlaveState};
use crate::time::{Span, Time};
use crate::wire::Address;

pub(super) fn address(number: u8) -> Address {
    Address::new(number).unwrap()
}

/// Master 1, slaves 3 and 5, 3 publishes to 5; T_DP 1 ms, T_I 125 µs.
pub(super) fn layout() -> Layout {
    let slave = |number| SlaveLayout { address: address(number), t_i: Span::from_us(125) };
    Layout::new(address(1), Span::from_ms(1), vec![slave(3), slave(5)], vec![(address(3), address(5))])
}

pub(super) fn cycle(cycle: u64) -> CycleRow {
    CycleRow {
        cycle,
        t0: Time::ZERO + Span::from_ms(cycle as i64),
        gc_jitter: Span::from_ticks(-1),
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
