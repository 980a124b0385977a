//! Metrics: the stream of observations becomes rows, one per cycle, slave and link.
//!
//! ```text
//! CycleStart k          Subscribed, Used      Latch          CycleStart k+1
//! ----|---------------------|-------------------|-----------------|----------->
//!     t0(k)            data of k-1      nominal(k+1) - T_I       t0(k+1): rows of k leave
//! ```
//!
//! Cycle k lasts from the master's `CycleStart` k to the next one. What slaves observe belongs to the cycle in which
//! they observe it, so the master's `CycleStart` must come before what any slave makes of the same SYNCH.

use super::count::Counts;
use super::layout::Layout;
use super::row::{CycleRow, EventRow, LinkRow, Sink, SlaveRow};
use crate::observation::{ClockVerdict, Observation, Phase, PllState, SlaveState};
use crate::sim::crystal::Crystal;
use crate::sim::record::{Recorder, Stamp, Transmission};
use crate::time::{Local, Span, Time};
use crate::wire::Address;

/// How fast the shafts of the slaves turn, for skew in counts.
pub trait Shafts {
    /// Speed of the shaft of `slave` at `at` [steps/s]; zero where there is none.
    fn speed(&self, slave: Address, at: Time) -> f64;
}
impl<F: Fn(Address, Time) -> f64> Shafts for F {
    fn speed(&self, slave: Address, at: Time) -> f64 {
        self(slave, at)
    }
}

/// Makes rows of a run and hands them to a sink.
#[derive(Debug)]
pub struct Metrics<S, V> {
    layout: Layout,
    shafts: V,
    sink: S,
    counts: Counts,
    /// The cycle that is under way; `None` before the first.
    open: Option<CycleRow>,
    /// Where the latches of this cycle belong, per different T_I.
    grid: Vec<Grid>,
    slaves: Vec<Watch>,
    links: Vec<LinkWatch>,
}

/// The nominal latch instant of all slaves with one T_I.
#[derive(Debug)]
struct Grid {
    t_i: Span,
    latch: Time,
}

/// What is known of one slave.
#[derive(Debug)]
struct Watch {
    /// The row of this cycle; what it does not renew is carried over to the next.
    row: SlaveRow,
    /// Number of its T_I in [`Metrics::grid`].
    grid: usize,
    /// Latch offset in counts [steps].
    offset_counts: f64,
    /// The last locked latch of this cycle.
    latched: Option<Time>,
    /// The same of the cycle before: what the replies of this cycle carry (Model: D8).
    travelling: Option<Time>,
    /// First bit of the last reply to all stations in this cycle.
    reply: Option<Time>,
}

/// What is known of one link in this cycle.
#[derive(Debug)]
struct LinkWatch {
    publisher: usize,
    row: LinkRow,
    received: bool,
}

impl<S: Sink, V: Shafts> Metrics<S, V> {
    /// Metrics of a network of `layout`, whose shafts turn as `shafts` says; rows go to `sink`.
    ///
    /// # Panics
    /// If a link names a publisher that is no slave of the layout.
    pub fn new(layout: Layout, shafts: V, sink: S) -> Self {
        let mut grid = Vec::<Grid>::new();
        let mut slaves = Vec::new();
        for slave in layout.slaves() {
            let number = grid.iter().position(|grid| grid.t_i == slave.t_i).unwrap_or_else(|| {
                grid.push(Grid { t_i: slave.t_i, latch: Time::ZERO });
                grid.len() - 1
            });
            slaves.push(Watch::new(slave.address, number));
        }
        let link = |&(publisher, subscriber): &(Address, Address)| LinkWatch {
            publisher: layout.slave(publisher).expect("a publisher is a slave"),
            row: LinkRow { cycle: 0, publisher, subscriber, wire: Span::ZERO, publish: Span::ZERO, age: None },
            received: false,
        };
        let links = layout.links().iter().map(link).collect();
        Self { counts: Counts::new(&layout), open: None, grid, slaves, links, layout, shafts, sink }
    }

    /// What was counted until now.
    pub fn counts(&self) -> &Counts {
        &self.counts
    }
    /// The sink.
    pub fn sink(&self) -> &S {
        &self.sink
    }
    /// The run is over at `end`: the rows of the cycle under way leave as far as they came.
    pub fn finish(mut self, end: Time) -> (Counts, S) {
        self.flush();
        self.counts.finish(end);
        (self.counts, self.sink)
    }

    /// Cycle `cycle` begins at `t0`, aimed at `nominal` by the master's `crystal`.
    fn begin(&mut self, cycle: u64, t0: Time, nominal: Local, crystal: &Crystal) {
        let before = self.open.filter(|before| before.cycle + 1 == cycle).map(|before| t0 - before.t0);
        self.flush();
        let next = nominal + self.layout.t_dp;
        for grid in &mut self.grid {
            grid.latch = crystal.to_true(next - grid.t_i);
        }
        self.open = Some(CycleRow {
            cycle,
            t0,
            gc_jitter: t0 - crystal.to_true(nominal),
            t_dp: before,
            t_dp_deviation: before.map(|t_dp| t_dp - self.layout.t_dp),
            t_dx: None,
            latch_skew: None,
            skew_counts: None,
            retries: 0,
            acyclic: None,
            spare: None,
        });
    }

    /// Sends the rows of the cycle under way off and makes everything ready for the next.
    fn flush(&mut self) {
        let Some(mut row) = self.open.take() else { return };
        (row.latch_skew, row.skew_counts) = skew(&self.slaves);
        if let Some(counts) = row.skew_counts {
            let largest = &mut self.counts.network.skew_counts;
            *largest = Some(largest.map_or(counts, |before| before.max(counts)));
        }
        self.sink.cycle(&row);
        for slave in &mut self.slaves {
            (slave.row.cycle, slave.row.t0) = (row.cycle, row.t0);
            self.sink.slave(&slave.row);
            slave.next_cycle();
        }
        for link in &mut self.links {
            if link.received {
                link.row.cycle = row.cycle;
                self.sink.link(&link.row);
            }
            (link.received, link.row.age) = (false, None);
        }
    }

    /// What the master observed.
    fn master(&mut self, stamp: &Stamp<'_>, what: &Observation) {
        self.counts.master(what, &self.layout);
        if let Observation::CycleStart { cycle, nominal } = *what {
            return self.begin(cycle, stamp.at, nominal, stamp.crystal);
        }
        let Some(open) = &mut self.open else { return };
        match *what {
            Observation::ExchangeDone { t_dx, .. } => open.t_dx = (t_dx > Span::ZERO).then_some(t_dx),
            Observation::CycleSpare { acyclic, spare } => (open.acyclic, open.spare) = (Some(acyclic), Some(spare)),
            Observation::Retry { .. } => open.retries += 1,
            _ => {}
        }
    }

    /// What the slave of number `index` observed.
    fn slave(&mut self, index: usize, stamp: &Stamp<'_>, what: &Observation) {
        self.counts.slaves[index].observe(stamp.at, self.counts.network.cycles, what);
        match *what {
            Observation::Latch { locked: true, .. } => self.latch(index, stamp.at),
            Observation::Subscribed { publisher } => self.subscribed(publisher, stamp),
            Observation::Used { publisher, .. } => self.used(publisher, stamp),
            _ => {}
        }
        self.slaves[index].observe(what);
    }

    /// A locked latch. The first one of a cycle counts for the offset; a second one is possible only where the next
    /// SYNCH is later than T_I.
    fn latch(&mut self, index: usize, at: Time) {
        let slave = &mut self.slaves[index];
        slave.latched = Some(at);
        if self.open.is_some() && slave.row.latch_offset.is_none() {
            let offset = at - self.grid[slave.grid].latch;
            slave.row.latch_offset = Some(offset);
            slave.offset_counts = offset.as_s() * self.shafts.speed(slave.row.slave, at);
        }
    }

    /// A subscriber took a reply over. The first one of a cycle counts; without a locked latch there is no latency.
    fn subscribed(&mut self, publisher: Address, stamp: &Stamp<'_>) {
        let Some(index) = self.layout.link(publisher, stamp.station) else { return };
        let link = &mut self.links[index];
        let Watch { travelling: Some(latch), reply: Some(reply), .. } = self.slaves[link.publisher] else { return };
        if !link.received {
            link.received = true;
            link.row.wire = stamp.at - reply;
            link.row.publish = stamp.at - latch;
        }
    }

    /// A subscriber used a publisher's value at its T_O: data that it took over in this cycle, or it does not count.
    fn used(&mut self, publisher: Address, stamp: &Stamp<'_>) {
        let Some(index) = self.layout.link(publisher, stamp.station) else { return };
        let link = &mut self.links[index];
        let latch = self.slaves[link.publisher].travelling.filter(|_| link.received && link.row.age.is_none());
        link.row.age = latch.map_or(link.row.age, |latch| Some(stamp.at - latch));
    }
}

impl<S: Sink, V: Shafts> Recorder for Metrics<S, V> {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        let [0x68, _, _, _, destination, ..] = telegram.octets else { return };
        if destination & 0x7F == Address::BROADCAST.get()
            && let Some(index) = self.layout.slave(telegram.sender)
        {
            self.slaves[index].reply = Some(telegram.start);
        }
    }

    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        self.counts.station(what);
        if stamp.station == self.layout.master {
            self.master(&stamp, what);
        } else if let Some(index) = self.layout.slave(stamp.station) {
            self.slave(index, &stamp, what);
        }
        if what.is_event() {
            let cycle = self.open.map_or(0, |open| open.cycle);
            self.sink.event(&EventRow { at: stamp.at, cycle, station: stamp.station, what: *what });
        }
    }
}

/// Largest minus smallest latch offset over the locked slaves, as time and in counts (Model: D9).
fn skew(slaves: &[Watch]) -> (Option<Span>, Option<f64>) {
    let mut locked = 0;
    let (mut low, mut high) = (Span::MAX, -Span::MAX);
    let (mut low_counts, mut high_counts) = (f64::INFINITY, f64::NEG_INFINITY);
    for slave in slaves {
        let Some(offset) = slave.row.latch_offset else { continue };
        locked += 1;
        (low, high) = (low.min(offset), high.max(offset));
        (low_counts, high_counts) = (low_counts.min(slave.offset_counts), high_counts.max(slave.offset_counts));
    }
    if locked < 2 { (None, None) } else { (Some(high - low), Some(high_counts - low_counts)) }
}

impl Watch {
    fn new(slave: Address, grid: usize) -> Self {
        let row = SlaveRow {
            cycle: 0,
            t0: Time::ZERO,
            slave,
            state: SlaveState::PowerOn,
            phase: Phase::Configuration,
            pll: PllState::Idle,
            pll_error: None,
            period: None,
            window: None,
            latch_offset: None,
            mls: 0,
            sls: 0,
            life_counter: 0,
            clock_counter: 0,
            g1_zsw: 0,
            xist1: 0,
            xist2: 0,
        };
        Self { row, grid, offset_counts: 0.0, latched: None, travelling: None, reply: None }
    }

    fn next_cycle(&mut self) {
        (self.row.pll_error, self.row.latch_offset, self.offset_counts) = (None, None, 0.0);
        (self.travelling, self.latched, self.reply) = (self.latched, None, None);
    }

    fn observe(&mut self, what: &Observation) {
        let row = &mut self.row;
        match *what {
            Observation::SlaveState { to, .. } => row.state = to,
            Observation::Phase { to, .. } => row.phase = to,
            Observation::Pll { to, .. } => {
                row.pll = to;
                if matches!(to, PllState::Idle | PllState::Waiting) {
                    (row.period, row.window) = (None, None);
                }
            }
            Observation::Clock { verdict: ClockVerdict::Stray, .. } => {}
            Observation::Clock { verdict, error, period, window, counter } => {
                if matches!(verdict, ClockVerdict::Hit | ClockVerdict::Outside) {
                    row.pll_error = Some(error);
                }
                (row.period, row.window, row.clock_counter) = (Some(period), Some(window), counter);
            }
            Observation::Latch { inputs, .. } => {
                (row.g1_zsw, row.xist1, row.xist2) = (inputs.g1_zsw, inputs.xist1, inputs.xist2);
            }
            Observation::SetPoint { mls, sls, counter, .. } => {
                (row.mls, row.sls, row.life_counter) = (mls, sls, counter);
            }
            _ => {}
        }
    }
}
