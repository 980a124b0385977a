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
use super::layout::{Layout, SlaveLayout};
use super::row::{CycleRow, EventRow, LinkRow, Sink, SlaveRow};
use crate::observation::{ClockVerdict, Leds, Observation, Phase, PllState, SlaveState};
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
#[derive(Clone, Debug)]
pub struct Metrics<S, V> {
    layout: Layout,
    shafts: V,
    sink: S,
    counts: Counts,
    /// The cycle that is under way; `None` before the first.
    open: Option<CycleRow>,
    /// How late the SYNCH is that is on its way.
    delay: Option<Span>,
    /// Where the latches of this cycle belong, per different T_I.
    grid: Vec<Grid>,
    slaves: Vec<Watch>,
    /// Number of a slave by its address, [`NO_SLAVE`] where there is none.
    numbers: [u8; 256],
    /// The locked encoders of this cycle.
    skew: Skew,
    links: Vec<LinkWatch>,
    /// Events of the instant that is going on: a cycle that begins at this instant is theirs.
    held: Vec<EventRow>,
}

/// Events of one instant that fit without growing: a few of every station.
const HELD: usize = 512;

/// More than there can be slaves.
const NO_SLAVE: u8 = u8::MAX;

/// The nominal latch instant of all slaves with one T_I.
#[derive(Clone, Debug)]
struct Grid {
    t_i: Span,
    latch: Time,
}

/// What is known of one slave.
#[derive(Clone, Debug)]
struct Watch {
    /// The row of this cycle; what it does not renew is carried over to the next.
    row: SlaveRow,
    encoder: bool,
    /// Number of its T_I in [`Metrics::grid`].
    grid: usize,
    /// The last locked latch of this cycle.
    latched: Option<Time>,
    /// The same of the cycle before: what the replies of this cycle carry (Model: D8).
    travelling: Option<Time>,
    /// First bit of the last reply to all stations in this cycle.
    reply: Option<Time>,
}

/// What is known of one link in this cycle.
#[derive(Clone, Debug)]
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
            slaves.push(Watch::new(slave, number));
        }
        let link = |&(publisher, subscriber): &(Address, Address)| LinkWatch {
            publisher: layout.slave(publisher).expect("a publisher is a slave"),
            row: LinkRow { cycle: 0, publisher, subscriber, wire: Span::ZERO, publish: Span::ZERO, age: None },
            received: false,
        };
        let links = layout.links().iter().map(link).collect();
        let mut numbers = [NO_SLAVE; 256];
        for (number, slave) in (0..NO_SLAVE).zip(layout.slaves()) {
            numbers[usize::from(slave.address.get())] = number;
        }
        let held = Vec::with_capacity(HELD);
        let (counts, skew) = (Counts::new(&layout), Skew::NONE);
        Self { counts, open: None, delay: None, grid, slaves, numbers, skew, links, held, layout, shafts, sink }
    }

    /// What was counted until now.
    pub fn counts(&self) -> &Counts {
        &self.counts
    }
    /// The sink.
    pub fn sink(&self) -> &S {
        &self.sink
    }
    /// From now on the shafts turn as `shafts` says.
    pub fn set_shafts(&mut self, shafts: V) {
        self.shafts = shafts;
    }
    /// The run is over at `end`: the rows of the cycle under way leave as far as they came. A cycle that only begins
    /// at the end belongs to the run no more.
    pub fn finish(mut self, end: Time) -> (Counts, S) {
        self.release();
        if self.open.take_if(|open| open.t0 >= end).is_some() {
            self.counts.network.cycles -= 1;
        }
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
            synch_delay: self.delay.take(),
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

    /// Sends the held events off: their instant is over.
    #[cold]
    fn release(&mut self) {
        let cycle = self.open.map_or(0, |open| open.cycle);
        for mut event in self.held.drain(..) {
            event.cycle = cycle;
            self.sink.event(&event);
        }
    }

    /// Sends the rows of the cycle under way off and makes everything ready for the next.
    fn flush(&mut self) {
        let Some(row) = &mut self.open else { return };
        if let Some(t_dp) = row.t_dp {
            self.counts.network.cycle_times.add(t_dp);
        }
        (row.latch_skew, row.skew_counts) = self.skew.take();
        if let Some(counts) = row.skew_counts {
            let largest = &mut self.counts.network.skew_counts;
            *largest = Some(largest.map_or(counts, |before| before.max(counts)));
        }
        self.sink.cycle(row);
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
        self.open = None;
    }

    /// Takes what may have to be counted, when the instant of the events before it may be over.
    #[inline(never)]
    fn count(&mut self, at: Time, station: Address, crystal: &Crystal, what: &Observation) {
        if self.held.first().is_some_and(|event| event.at < at) {
            self.release();
        }
        let event = what.is_event();
        self.counts.station(at, station, what);
        let stamp = Stamp { at, station, crystal };
        if station == self.layout.master {
            self.master(&stamp, what);
        } else if let Some(index) = self.layout.slave(station) {
            self.slave(index, &stamp, what);
        }
        if event {
            self.counts.network.events += 1;
            self.held.push(EventRow { at, cycle: 0, station, what: *what });
        }
    }
    /// What the master observed.
    fn master(&mut self, stamp: &Stamp<'_>, what: &Observation) {
        self.counts.master(what, &self.layout);
        if let Observation::CycleStart { cycle, nominal } = *what {
            return self.begin(cycle, stamp.at, nominal, stamp.crystal);
        }
        // Told when its sending begins, which is in the cycle before.
        if let Observation::ClockLate { by } = *what {
            self.delay = Some(by);
        }
        if let Some(open) = &mut self.open {
            open.observe(what);
        }
    }

    /// What the slave of number `index` observed.
    fn slave(&mut self, index: usize, stamp: &Stamp<'_>, what: &Observation) {
        self.counts.slaves[index].observe(stamp.at, self.counts.network.cycles, what);
        if let Observation::Subscribed { publisher }
        | Observation::WrongLength { publisher, .. }
        | Observation::Link { publisher, .. } = *what
            && let Some(link) = self.layout.link(publisher, stamp.station)
        {
            self.counts.links[link].observe(stamp.at, what);
        }
        match *what {
            Observation::Subscribed { publisher } => self.subscribed(publisher, stamp),
            Observation::Used { publisher, .. } => self.used(publisher, stamp),
            _ => {}
        }
        self.slaves[index].observe(what);
    }
    /// Takes what a station observes in every cycle in which all is well: it is in the rows and in no count. Whether it was
    /// that.
    #[allow(clippy::inline_always)] // See `observe`.
    #[inline(always)]
    fn routine(&mut self, at: Time, station: Address, what: &Observation) -> bool {
        let number = usize::from(self.numbers[usize::from(station.get())]);
        let Some(slave) = self.slaves.get_mut(number) else { return self.routine_of_cycle(station, what) };
        match *what {
            Observation::Clock { verdict: ClockVerdict::Hit, error, period, window, counter } => {
                slave.row.pll_error = Some(error);
                slave.clocked(period, window, counter);
            }
            Observation::SetPoint { mls, sls, counter, expected: true } => slave.compared(mls, sls, counter),
            Observation::Latch { locked, inputs } => {
                (slave.row.g1_zsw, slave.row.xist1, slave.row.xist2) = (inputs.g1_zsw, inputs.xist1, inputs.xist2);
                if locked {
                    self.latch(number, at);
                }
            }
            _ => return false,
        }
        true
    }
    /// The same of the master. Where several share the token, it counts for each of them.
    #[inline]
    fn routine_of_cycle(&mut self, station: Address, what: &Observation) -> bool {
        let (Observation::ExchangeDone { .. } | Observation::CycleSpare { .. }, Some(open)) = (what, &mut self.open)
        else {
            return false;
        };
        let alone = station == self.layout.master && self.layout.masters().is_empty();
        if alone {
            open.observe(what);
        }
        alone
    }

    /// A locked latch. The first one of a cycle counts for the offset; a second one is possible only where the next
    /// SYNCH is later than T_I.
    #[allow(clippy::inline_always)] // See `observe`.
    #[inline(always)]
    fn latch(&mut self, number: usize, at: Time) {
        let slave = &mut self.slaves[number];
        slave.latched = Some(at);
        if self.open.is_some() && slave.row.latch_offset.is_none() {
            let offset = at - self.grid[slave.grid].latch;
            slave.row.latch_offset = Some(offset);
            if slave.encoder {
                self.skew.add(offset, offset.as_s() * self.shafts.speed(slave.row.slave, at));
            }
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
        // Nobody else asks for the reply.
        if self.links.is_empty() {
            return;
        }
        let [0x68, _, _, _, destination, ..] = telegram.octets else { return };
        if destination & 0x7F == Address::BROADCAST.get()
            && let Some(index) = self.layout.slave(telegram.sender)
        {
            self.slaves[index].reply = Some(telegram.start);
        }
    }

    // Most observations are routine, and a call takes as long as to note one of these.
    #[allow(clippy::inline_always)]
    #[inline(always)]
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        let Stamp { at, station, crystal } = stamp;
        if !self.routine(at, station, what) {
            self.count(at, station, crystal, what);
        }
    }
}

/// Latch offsets of the locked encoders of one cycle, as time and in counts \[steps\] (Model: D9).
#[derive(Clone, Copy, Debug)]
struct Skew {
    locked: u32,
    low: Span,
    high: Span,
    low_counts: f64,
    high_counts: f64,
}
impl Skew {
    const NONE: Self = Self {
        locked: 0,
        low: Span::MAX,
        high: Span::from_ticks(-Span::MAX.ticks()),
        low_counts: f64::INFINITY,
        high_counts: f64::NEG_INFINITY,
    };

    fn add(&mut self, offset: Span, counts: f64) {
        self.locked += 1;
        (self.low, self.high) = (self.low.min(offset), self.high.max(offset));
        // Compared as numbers, since none is something else.
        self.low_counts = if counts < self.low_counts { counts } else { self.low_counts };
        self.high_counts = if counts > self.high_counts { counts } else { self.high_counts };
    }
    /// Largest minus smallest, if there are two; then none is left.
    fn take(&mut self) -> (Option<Span>, Option<f64>) {
        let Self { locked, low, high, low_counts, high_counts } = core::mem::replace(self, Self::NONE);
        if locked < 2 { (None, None) } else { (Some(high - low), Some(high_counts - low_counts)) }
    }
}

impl CycleRow {
    /// Takes what the master observes in this cycle.
    #[inline]
    fn observe(&mut self, what: &Observation) {
        match *what {
            Observation::ExchangeDone { t_dx, .. } => self.t_dx = (t_dx > Span::ZERO).then_some(t_dx),
            Observation::CycleSpare { acyclic, spare } => (self.acyclic, self.spare) = (Some(acyclic), Some(spare)),
            Observation::Retry { .. } => self.retries += 1,
            _ => {}
        }
    }
}

impl Watch {
    fn new(slave: &SlaveLayout, grid: usize) -> Self {
        let row = SlaveRow {
            cycle: 0,
            t0: Time::ZERO,
            slave: slave.address,
            state: SlaveState::PowerOn,
            phase: Phase::Configuration,
            pll: PllState::Idle,
            leds: Leds::NoSupply,
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
        Self { row, encoder: slave.encoder, grid, latched: None, travelling: None, reply: None }
    }

    /// The clock recovery took a SYNCH, or noticed that one is missing.
    fn clocked(&mut self, period: Span, window: Span, counter: u16) {
        (self.row.period, self.row.window, self.row.clock_counter) = (Some(period), Some(window), counter);
    }
    /// The signs of life were compared at T_O.
    fn compared(&mut self, mls: u8, sls: u8, counter: u16) {
        (self.row.mls, self.row.sls, self.row.life_counter) = (mls, sls, counter);
    }
    fn next_cycle(&mut self) {
        (self.row.pll_error, self.row.latch_offset) = (None, None);
        (self.travelling, self.latched, self.reply) = (self.latched, None, None);
    }

    /// The supply is gone, and with it everything that the slave knew; what it latched last stays to be seen.
    fn switched_off(&mut self) {
        let row = &mut self.row;
        (row.state, row.phase, row.pll, row.leds) =
            (SlaveState::PowerOn, Phase::Configuration, PllState::Idle, Leds::NoSupply);
        (row.period, row.window, row.mls, row.sls) = (None, None, 0, 0);
        (row.life_counter, row.clock_counter) = (0, 0);
    }

    /// Takes what does not come in every cycle.
    fn observe(&mut self, what: &Observation) {
        let row = &mut self.row;
        match *what {
            Observation::SlaveState { to, .. } => row.state = to,
            Observation::Phase { to, .. } => {
                row.phase = to;
                // Nothing is compared at T_O without a clock, and the own sign of life stands at 0.
                if to < Phase::MasterLife {
                    (row.mls, row.sls) = (0, 0);
                }
                if to == Phase::Configuration {
                    (row.life_counter, row.clock_counter) = (0, 0);
                }
            }
            Observation::Pll { to, .. } => {
                row.pll = to;
                if matches!(to, PllState::Idle | PllState::Waiting) {
                    (row.period, row.window) = (None, None);
                }
            }
            Observation::Leds { to, .. } => row.leds = to,
            Observation::Power { on: false } => self.switched_off(),
            Observation::Clock { verdict: ClockVerdict::Stray, .. } => {}
            Observation::Clock { verdict, error, period, window, counter } => {
                if verdict == ClockVerdict::Outside {
                    row.pll_error = Some(error);
                }
                self.clocked(period, window, counter);
            }
            Observation::SetPoint { mls, sls, counter, .. } => self.compared(mls, sls, counter),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::{Inputs, MasterClass, SlaveCause};
    use crate::sim::record::Origin;
    use crate::study::layout::MasterLayout;
    use crate::study::sample::{self, address};

    /// Keeps every row.
    #[derive(Default)]
    struct Kept {
        cycles: Vec<CycleRow>,
        slaves: Vec<SlaveRow>,
        links: Vec<LinkRow>,
        events: Vec<EventRow>,
        order: String,
    }
    impl Sink for Kept {
        fn cycle(&mut self, row: &CycleRow) {
            self.cycles.push(*row);
            self.order.push('c');
        }
        fn slave(&mut self, row: &SlaveRow) {
            self.slaves.push(*row);
            self.order.push('s');
        }
        fn link(&mut self, row: &LinkRow) {
            self.links.push(*row);
            self.order.push('l');
        }
        fn event(&mut self, row: &EventRow) {
            self.events.push(*row);
            self.order.push('e');
        }
    }

    type Speed = fn(Address, Time) -> f64;
    /// A run of the sample's network that is told step by step, in true nanoseconds.
    struct Told {
        metrics: Metrics<Kept, Speed>,
        master: Crystal,
    }
    fn at(ns: i64) -> Time {
        Time::ZERO + Span::from_ns(ns)
    }
    impl Told {
        /// The master is `ppb` fast and reads 1 s at true time zero; slave 3 turns at 10^6 steps/s, slave 5 back at 2 x 10^6.
        fn new(ppb: i64) -> Self {
            let speed: Speed = |slave, _| if slave.get() == 3 { 1e6 } else { -2e6 };
            let master = Crystal::new(ppb, Local::ZERO + Span::from_s(1)).unwrap();
            Self { metrics: Metrics::new(sample::layout(), speed, Kept::default()), master }
        }
        fn tell(&mut self, ns: i64, station: u8, what: Observation) {
            let stamp = Stamp { at: at(ns), station: address(station), crystal: &self.master };
            self.metrics.observe(stamp, &what);
        }
        fn cycle(&mut self, ns: i64, cycle: u64) {
            let nominal = Local::ZERO + Span::from_s(1) + Span::from_ms(cycle as i64);
            self.tell(ns, 1, Observation::CycleStart { cycle, nominal });
        }
        fn latch(&mut self, ns: i64, station: u8, locked: bool) {
            let inputs = Inputs { zsw2: 0, g1_zsw: 0x2000, xist1: ns as u32, xist2: 7 };
            self.tell(ns, station, Observation::Latch { locked, inputs });
        }
        fn reply(&mut self, ns: i64, station: u8, destination: u8) {
            let octets = [0x68, 4, 4, 0x68, destination, station, 0x08, 0, 0, 0x16];
            let telegram = Transmission {
                start: at(ns),
                end: at(ns + 9_000),
                sender: address(station),
                octets: &octets,
                origin: Origin::Sender,
            };
            self.metrics.telegram(&telegram);
        }
        fn over(self, ns: i64) -> (Counts, Kept) {
            self.metrics.finish(at(ns))
        }
    }

    #[test]
    fn what_slaves_observe_when_all_is_well_is_in_no_count() {
        let mut counts = Counts::new(&sample::layout());
        let before = counts.clone();
        let (period, inputs) = (Span::from_ms(1), Inputs { zsw2: 1, g1_zsw: 2, xist1: 3, xist2: 4 });
        let clock = |verdict| Observation::Clock { verdict, error: Span::ZERO, period, window: period, counter: 3 };
        let set_point = |expected| Observation::SetPoint { mls: 1, sls: 2, counter: 3, expected };
        let latch = |locked| Observation::Latch { locked, inputs };
        let mut metrics = Told::new(0).metrics;
        for what in [clock(ClockVerdict::Hit), set_point(true), latch(true), latch(false)] {
            assert!(metrics.routine(at(7), address(3), &what) && !what.is_event());
            counts.station(at(7), address(3), &what);
            counts.slaves[0].observe(at(7), 9, &what);
        }
        assert_eq!(counts, before);
        assert!(!metrics.routine(at(7), address(3), &clock(ClockVerdict::Outside)));
        assert!(!metrics.routine(at(7), address(3), &set_point(false)));
    }

    #[test]
    fn what_the_only_master_tells_of_its_cycle_is_in_no_count() {
        let layout = sample::layout();
        let mut counts = Counts::new(&layout);
        let before = counts.clone();
        let done = Observation::ExchangeDone { t_dx: Span::from_us(449), retries: 0 };
        let spare = Observation::CycleSpare { acyclic: Span::from_us(51), spare: Span::from_us(488) };
        let mut told = Told::new(0);
        assert!(!told.metrics.routine(at(0), address(1), &done), "before the first cycle");
        told.cycle(0, 0);
        for what in [done, spare] {
            assert!(!told.metrics.routine(at(7), address(2), &what), "nobody's cycle");
            assert!(told.metrics.routine(at(7), address(1), &what) && !what.is_event());
            counts.station(at(7), address(1), &what);
            counts.master(&what, &layout);
        }
        assert_eq!(counts, before);
        assert!(!told.metrics.routine(at(7), address(1), &Observation::Retry { slave: address(3) }));
        let master = MasterLayout { address: address(1), class: MasterClass::One, slaves: vec![] };
        told.metrics.layout = layout.with_masters(vec![master]);
        assert!(!told.metrics.routine(at(7), address(1), &done), "each master counts it");
    }

    #[test]
    fn a_cycle_row_has_the_masters_numbers() {
        let mut told = Told::new(0);
        told.cycle(40, 0);
        told.tell(449_040, 1, Observation::ExchangeDone { t_dx: Span::from_us(449), retries: 1 });
        told.tell(449_040, 1, Observation::Retry { slave: address(5) });
        let (acyclic, spare) = (Span::from_us(51), Span::from_us(488));
        told.tell(500_000, 1, Observation::CycleSpare { acyclic, spare });
        told.cycle(999_970, 1);
        told.cycle(3_000_000, 3);
        let (counts, kept) = told.over(3_500_000);
        assert_eq!(kept.order, "ecsscsscss");
        let [first, second, third] = kept.cycles[..] else { panic!("three cycles") };
        assert_eq!(
            (first.t0, first.gc_jitter, first.t_dp, first.t_dp_deviation),
            (at(40), Span::from_ns(40), None, None)
        );
        assert_eq!((first.t_dx, first.retries), (Some(Span::from_us(449)), 1));
        assert_eq!((first.acyclic, first.spare), (Some(acyclic), Some(spare)));
        assert_eq!((second.gc_jitter, second.t_dp), (Span::from_ns(-30), Some(Span::from_ns(999_930))));
        assert_eq!((second.t_dp_deviation, second.t_dx), (Some(Span::from_ns(-70)), None));
        assert_eq!((third.cycle, third.gc_jitter, third.t_dp), (3, Span::ZERO, None), "cycle 2 is missing");
        assert_eq!((counts.network.cycles, counts.network.retries, counts.slaves[1].retries), (3, 1, 1));
        assert_eq!(counts.network.duration, Span::from_ns(3_500_000));
    }

    #[test]
    fn a_cycle_that_begins_at_the_end_is_none() {
        let mut told = Told::new(0);
        told.cycle(0, 0);
        told.cycle(1_000_000, 1);
        let (counts, kept) = told.over(1_000_000);
        assert_eq!((counts.network.cycles, kept.cycles.len(), kept.slaves.len()), (1, 1, 2));
    }

    #[test]
    fn latches_are_measured_from_the_nominal_grid() {
        let mut told = Told::new(0);
        told.cycle(500, 0); // late: the grid does not move
        told.latch(875_030, 3, true);
        told.latch(874_990, 5, true);
        told.cycle(1_000_000, 1);
        told.latch(1_875_012, 3, true);
        told.latch(1_100_000, 5, false);
        told.cycle(2_000_000, 2);
        let (counts, kept) = told.over(2_500_000);
        assert_eq!(kept.cycles[0].latch_skew, Some(Span::from_ns(40)));
        // 30 ns x 10^6 and -10 ns x -2 x 10^6 steps/s: 0.03 and 0.02 steps.
        assert!((kept.cycles[0].skew_counts.unwrap() - 0.01).abs() < 1e-12);
        assert_eq!(counts.network.skew_counts, kept.cycles[0].skew_counts);
        assert_eq!((kept.cycles[1].latch_skew, kept.cycles[1].skew_counts), (None, None), "one slave has no skew");
        let offsets: Vec<_> = kept.slaves.iter().map(|row| (row.slave.get(), row.latch_offset)).collect();
        let ns = |n| Some(Span::from_ns(n));
        assert_eq!(offsets, [(3, ns(30)), (5, ns(-10)), (3, ns(12)), (5, None), (3, None), (5, None)]);
        assert_eq!((kept.slaves[3].g1_zsw, kept.slaves[3].xist1, kept.slaves[3].xist2), (0x2000, 1_100_000, 7));
        assert_eq!(kept.slaves[4].xist1, 1_875_012, "carried over");
    }

    #[test]
    fn the_grid_is_counted_by_the_masters_crystal() {
        let mut told = Told::new(100_000); // 100 ppm fast
        told.cycle(0, 0);
        told.latch(875_000, 3, true);
        told.cycle(999_900, 1);
        let (_, kept) = told.over(1_000_000);
        // 875 µs of the master take 874 912.509 ns: 10 498 950.105 ticks, the first whole tick is 10 498 951.
        assert_eq!(kept.slaves[0].latch_offset, Some(Span::from_ns(875_000) - Span::from_ticks(10_498_951)));
        // Nominal t0(1) is at 999 900.01 ns: 11 998 800.12 ticks, 11 998 801.
        assert_eq!(kept.cycles[1].gc_jitter, Span::from_ticks(-1));
    }

    #[test]
    fn signs_of_life_end_with_the_clock_and_counters_with_data_exchange() {
        let phase = |from, to| Observation::Phase { from, to };
        let mut told = Told::new(0);
        told.cycle(0, 0);
        told.tell(500_000, 3, Observation::SetPoint { mls: 6, sls: 9, counter: 10, expected: false });
        told.cycle(1_000_000, 1);
        told.tell(1_000_020, 3, phase(Phase::Operation, Phase::Clock));
        told.cycle(2_000_000, 2);
        told.tell(2_100_000, 3, phase(Phase::Clock, Phase::Configuration));
        let (_, kept) = told.over(3_000_000);
        let rows = kept.slaves.iter().filter(|row| row.slave == address(3));
        let values: Vec<_> = rows.map(|row| (row.mls, row.sls, row.life_counter)).collect();
        assert_eq!(values, [(6, 9, 10), (0, 0, 10), (0, 0, 0)]);
    }

    #[test]
    fn the_leds_are_carried_over_and_a_slave_without_supply_is_dark_and_knows_nothing() {
        let leds = |from, to| Observation::Leds { from, to };
        let mut told = Told::new(0);
        told.cycle(0, 0);
        told.tell(100, 3, leds(Leds::NoSupply, Leds::NotConfigured));
        told.tell(200, 3, leds(Leds::NotConfigured, Leds::DataExchange));
        told.tell(
            300,
            3,
            Observation::SlaveState {
                from: SlaveState::WaitCfg,
                to: SlaveState::DataExch,
                cause: SlaveCause::Configured,
            },
        );
        told.tell(400, 3, Observation::Phase { from: Phase::Configuration, to: Phase::Operation });
        told.tell(500, 3, Observation::Pll { from: PllState::Idle, to: PllState::Locked });
        told.cycle(1_000_000, 1);
        told.cycle(2_000_000, 2);
        told.tell(2_100_000, 3, Observation::Power { on: false });
        told.cycle(3_000_000, 3);
        // Only now does the slave see where it has been.
        told.tell(3_100_000, 3, Observation::Phase { from: Phase::Operation, to: Phase::Configuration });
        let (counts, kept) = told.over(4_000_000);
        let rows = kept.slaves.iter().filter(|row| row.slave == address(3));
        let values: Vec<_> = rows.map(|row| (row.leds, row.state, row.phase, row.pll)).collect();
        let on = (Leds::DataExchange, SlaveState::DataExch, Phase::Operation, PllState::Locked);
        let off = (Leds::NoSupply, SlaveState::PowerOn, Phase::Configuration, PllState::Idle);
        assert_eq!(values, [on, on, off, off]);
        let slave = &counts.slaves[0];
        assert_eq!((slave.leds, slave.state, slave.phase, slave.pll), off);
        let [configuration, .., operation] = slave.phases;
        assert_eq!((configuration, operation), (Span::from_ns(1_900_400), Span::from_ns(2_099_600)));
    }

    #[test]
    fn the_clock_of_a_slave_is_carried_over_and_its_error_is_not() {
        let (period, window) = (Span::from_ms(1), Span::from_us(4));
        let clock =
            |verdict, ns, counter| Observation::Clock { verdict, error: Span::from_ns(ns), period, window, counter };
        let mut told = Told::new(0);
        told.cycle(0, 0);
        told.tell(10, 3, Observation::Pll { from: PllState::Idle, to: PllState::Waiting });
        told.tell(20, 3, clock(ClockVerdict::First, 0, 0));
        told.tell(20, 3, Observation::Pll { from: PllState::Waiting, to: PllState::Narrowing });
        told.cycle(1_000_000, 1);
        told.tell(1_000_020, 3, clock(ClockVerdict::Hit, -12, 0));
        told.cycle(2_000_000, 2);
        told.tell(2_000_020, 3, clock(ClockVerdict::Outside, 9_000, 10));
        told.cycle(3_000_000, 3);
        told.tell(3_004_020, 3, clock(ClockVerdict::Missing, 0, 20));
        told.tell(3_004_021, 3, clock(ClockVerdict::Stray, 5, 99));
        told.cycle(4_000_000, 4);
        told.tell(4_000_020, 3, Observation::Pll { from: PllState::Narrowing, to: PllState::Waiting });
        let (counts, kept) = told.over(5_000_000);
        let rows: Vec<_> = kept.slaves.iter().filter(|row| row.slave.get() == 3).collect();
        let errors: Vec<_> = rows.iter().map(|row| row.pll_error.map(Span::as_ns)).collect();
        assert_eq!(errors, [None, Some(-12.0), Some(9_000.0), None, None]);
        assert_eq!(rows.iter().map(|row| row.clock_counter).collect::<Vec<_>>(), [0, 0, 10, 20, 20]);
        let periods: Vec<_> = rows.iter().map(|row| (row.period, row.window, row.pll)).collect();
        assert_eq!(periods[0], (Some(period), Some(window), PllState::Narrowing));
        assert_eq!(periods[4], (None, None, PllState::Waiting));
        assert_eq!(kept.slaves[1].period, None, "slave 5 saw nothing");
        assert_eq!(counts.slaves[0].clock_failures, 2);
        assert_eq!(kept.events.iter().map(|event| event.cycle).collect::<Vec<_>>(), [0, 0, 0, 2, 3, 3, 4]);
    }

    #[test]
    fn latencies_follow_the_value_from_latch_to_use() {
        let (subscribed, used) = (
            Observation::Subscribed { publisher: address(3) },
            Observation::Used { publisher: address(3), position: 0 },
        );
        let mut told = Told::new(0);
        let mut cycle = |start: i64, number, latched| {
            told.cycle(start, number);
            told.reply(start + 90_000, 3, 127);
            told.reply(start + 95_000, 3, 1); // an answer to the master alone
            told.tell(start + 110_000, 5, subscribed);
            told.tell(start + 130_000, 5, subscribed);
            if number != 2 {
                told.tell(start + 700_000, 5, used);
            }
            told.latch(start + 875_000, 3, latched);
        };
        cycle(0, 0, true); // nothing was latched before
        cycle(1_000_000, 1, true);
        cycle(2_000_000, 2, false); // a value, but not used
        cycle(3_000_000, 3, true); // the value of a free-running latch
        told.cycle(4_000_000, 4);
        told.tell(4_700_000, 5, used); // an old value
        let (_, kept) = told.over(5_000_000);
        let row = |cycle, age| LinkRow {
            cycle,
            publisher: address(3),
            subscriber: address(5),
            wire: Span::from_us(20),
            publish: Span::from_us(235),
            age,
        };
        assert_eq!(kept.links, [row(1, Some(Span::from_us(825))), row(2, None)]);
        assert!(kept.order.starts_with("csscssl"), "{}", kept.order);
    }

    #[test]
    fn counts_are_by_slave_and_by_code() {
        let mut told = Told::new(0);
        let pll = |from, to| Observation::Pll { from, to };
        let period = Span::from_ms(1);
        let first =
            Observation::Clock { verdict: ClockVerdict::First, error: Span::ZERO, period, window: period, counter: 0 };
        told.cycle(0, 0);
        let (from, to, cause) = (SlaveState::PowerOn, SlaveState::WaitPrm, SlaveCause::Initialised);
        told.tell(100, 3, Observation::SlaveState { from, to, cause });
        told.tell(1_000, 3, Observation::Phase { from: Phase::Configuration, to: Phase::Clock });
        told.tell(2_000, 3, first);
        for cycle in 1..=20 {
            told.cycle(cycle * 1_000_000, cycle as u64);
        }
        told.tell(20_002_000, 3, pll(PllState::Settling, PllState::Locked));
        told.tell(21_000_000, 3, pll(PllState::Locked, PllState::Waiting));
        told.tell(22_000_000, 3, first);
        told.tell(23_000_000, 3, pll(PllState::Settling, PllState::Locked));
        for code in [0x0F04, 0x0F02, 0x0F04] {
            told.tell(23_000_000, 3, Observation::Fault { code });
        }
        told.tell(23_000_000, 3, Observation::Acknowledged { code: 0x0F04 });
        told.tell(23_000_000, 3, Observation::Collision { with: address(1) });
        told.tell(23_000_000, 1, Observation::ClockLate { by: Span::from_us(1) });
        told.tell(23_000_000, 1, Observation::NoAnswer { slave: address(5) });
        told.tell(23_000_000, 1, Observation::NoAnswer { slave: address(77) });
        told.tell(23_000_000, 1, Observation::TokenClaimed);
        let (counts, kept) = told.over(25_000_000);
        let (slave, other, network) = (&counts.slaves[0], &counts.slaves[1], &counts.network);
        assert_eq!(slave.faults.iter().collect::<Vec<_>>(), [(&0x0F02, &1), (&0x0F04, &2)]);
        assert_eq!((slave.fault_count(), slave.acknowledgements, slave.resynchronisations), (3, 1, 1));
        assert_eq!(slave.lock, Some(super::super::count::Lock { cycles: 20, span: Span::from_ms(20) }));
        assert_eq!((slave.state, slave.phase, slave.pll), (SlaveState::WaitPrm, Phase::Clock, PllState::Locked));
        let (none, before, after) = (Span::ZERO, Span::from_us(1), Span::from_us(24_999));
        assert_eq!(slave.phases, [before, after, none, none, none]);
        assert_eq!((other.lock, other.phases[0], other.no_answers), (None, Span::from_ms(25), 1));
        assert_eq!((network.late_clocks, network.no_answers), (1, 2));
        assert_eq!((network.tokens_claimed, network.collisions), (1, 1));
        assert_eq!(network.events, kept.events.len() as u64);
    }
}
