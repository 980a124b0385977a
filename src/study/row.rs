//! Rows: what one T_DP left behind, per cycle, slave and link. Every export, histogram and plot reads these.

use crate::observation::{Leds, Observation, Phase, PllState, SlaveState};
use crate::time::{Span, Time};
use crate::wire::Address;

/// One bus cycle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CycleRow {
    /// Number of the cycle, from 0.
    pub cycle: u64,
    /// True instant of the last bit of SYNCH at the master.
    pub t0: Time,
    /// t0 minus the master's jitter-free grid point.
    pub gc_jitter: Span,
    /// How late the sending of SYNCH began, since the bus was in use; none where it began in time.
    pub synch_delay: Option<Span>,
    /// Length of the cycle that ended with this t0; none for the first.
    pub t_dp: Option<Span>,
    /// That length minus the nominal T_DP.
    pub t_dp_deviation: Option<Span>,
    /// From t0 to the last bit of the last Data_Exchange reply; none while no slave exchanges data.
    pub t_dx: Option<Span>,
    /// Largest minus smallest latch offset over the locked encoders (Model: D9); none with fewer than two.
    pub latch_skew: Option<Span>,
    /// The same in counts: largest minus smallest latch offset x speed of the slave's shaft (steps).
    pub skew_counts: Option<f64>,
    /// Repeated requests.
    pub retries: u32,
    /// From the end of the Data_Exchange part to the end of the token.
    pub acyclic: Option<Span>,
    /// From there to the next SYNCH.
    pub spare: Option<Span>,
}

/// One slave in one bus cycle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SlaveRow {
    /// Number of the cycle.
    pub cycle: u64,
    /// True instant at which the cycle began.
    pub t0: Time,
    /// The slave.
    pub slave: Address,
    /// DP state at the end of the cycle.
    pub state: SlaveState,
    /// Start-up phase at the end of the cycle.
    pub phase: Phase,
    /// State of the clock recovery at the end of the cycle.
    pub pll: PllState,
    /// What the LEDs show at the end of the cycle (manual 5.2).
    pub leds: Leds,
    /// Arrival of this cycle's SYNCH minus its prediction; none where it was not judged or missing.
    pub pll_error: Option<Span>,
    /// Recovered period; none before the clock recovery started.
    pub period: Option<Span>,
    /// Half width of the window in force; none before the clock recovery started.
    pub window: Option<Span>,
    /// True latch instant minus the nominal one (Model: D9); none while the clock is not locked.
    pub latch_offset: Option<Span>,
    /// Master's sign of life as the slave compared it at T_O; 0 before.
    pub mls: u8,
    /// Slave's sign of life.
    pub sls: u8,
    /// Failure counter of the master's sign of life, ten per failure.
    pub life_counter: u16,
    /// Failure counter of the clock, ten per failure.
    pub clock_counter: u16,
    /// Sensor status word as latched in this cycle.
    pub g1_zsw: u16,
    /// Position word as latched in this cycle.
    pub xist1: u32,
    /// Second position word or fault code as latched in this cycle.
    pub xist2: u32,
}

/// One slave-to-slave link in one bus cycle: the latencies of Model: D26.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LinkRow {
    /// Number of the cycle.
    pub cycle: u64,
    /// Whose data.
    pub publisher: Address,
    /// Who takes them.
    pub subscriber: Address,
    /// First bit sent by the publisher to last bit at the subscriber.
    pub wire: Span,
    /// Publisher's latch to last bit at the subscriber.
    pub publish: Span,
    /// Publisher's latch to the subscriber's T_O; none if the subscriber did not use the data in this cycle.
    pub age: Option<Span>,
}

/// Something rare.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct EventRow {
    /// When, in true time.
    pub at: Time,
    /// In which cycle.
    pub cycle: u64,
    /// Which station saw it.
    pub station: Address,
    /// What.
    pub what: Observation,
}

/// Takes rows as a run makes them, in the order of time. A row of cycle k comes when cycle k is over.
pub trait Sink {
    /// A cycle is complete.
    fn cycle(&mut self, _row: &CycleRow) {}
    /// A slave's part of a cycle is complete. Comes after the cycle's own row, in address order.
    fn slave(&mut self, _row: &SlaveRow) {}
    /// A link's part of a cycle is complete. Comes after the slaves'.
    fn link(&mut self, _row: &LinkRow) {}
    /// Something rare happened. Comes once its instant is over, before the rows of a cycle that begins later.
    fn event(&mut self, _row: &EventRow) {}
}

impl<A: Sink, B: Sink> Sink for (A, B) {
    fn cycle(&mut self, row: &CycleRow) {
        self.0.cycle(row);
        self.1.cycle(row);
    }
    fn slave(&mut self, row: &SlaveRow) {
        self.0.slave(row);
        self.1.slave(row);
    }
    fn link(&mut self, row: &LinkRow) {
        self.0.link(row);
        self.1.link(row);
    }
    fn event(&mut self, row: &EventRow) {
        self.0.event(row);
        self.1.event(row);
    }
}
impl Sink for () {}
impl<S: Sink> Sink for Option<S> {
    fn cycle(&mut self, row: &CycleRow) {
        if let Some(sink) = self {
            sink.cycle(row);
        }
    }
    fn slave(&mut self, row: &SlaveRow) {
        if let Some(sink) = self {
            sink.slave(row);
        }
    }
    fn link(&mut self, row: &LinkRow) {
        if let Some(sink) = self {
            sink.link(row);
        }
    }
    fn event(&mut self, row: &EventRow) {
        if let Some(sink) = self {
            sink.event(row);
        }
    }
}
impl<S: Sink + ?Sized> Sink for &mut S {
    fn cycle(&mut self, row: &CycleRow) {
        (**self).cycle(row);
    }
    fn slave(&mut self, row: &SlaveRow) {
        (**self).slave(row);
    }
    fn link(&mut self, row: &LinkRow) {
        (**self).link(row);
    }
    fn event(&mut self, row: &EventRow) {
        (**self).event(row);
    }
}
