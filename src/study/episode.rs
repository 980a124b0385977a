//! Episodes: how long after a disturbance a slave reports a fault, and how long after that it is in full operation again.
//!
//! **Full operation** of a slave with a clock is DATA_EXCH, a locked PLL and phase 5 (manual 2.1.5); of any other slave
//! DATA_EXCH alone. The first start-up is no recovery.
//!
//! **A disturbance** is what the scenario does, as [`Trouble`] says: it hits all slaves or one, and lasts for a moment or
//! until it ends. What follows from it on the bus, such as a late SYNCH, is none.
//!
//! | of a slave | from | to |
//! |---|---|---|
//! | time to fault, per code | the first disturbance since it was last unharmed | the first fault of this code since then |
//! | time to loss | the same | the end of full operation, where no fault came with it or before it |
//! | recovery, by what came first | the end of full operation | the beginning of the next |
//!
//! **Unharmed** is a slave in full operation with both failure counters at zero at the end of a whole cycle after the
//! disturbance, while none lasts. Model: otherwise a disturbance that was tolerated long ago would count as the cause of
//! everything that came later. A clock that is lost in cycle k shows in cycle k + 1 at the latest.
//!
//! Model: a fault that a slave latches within T_DP after the end of full operation is what ended it: the slave stops at
//! the end of the clock window and latches the fault with its next position. A fault that is still shown from before is
//! not latched anew; what ends full operation then counts as a loss.
//!
//! A slave that is hit again before it is unharmed stays in its episode. What a slave has not made up for at the end of
//! the run counts as lasting and enters no time.

use std::collections::BTreeMap;
use std::fmt;

use serde::{Serialize, Serializer};

use super::export::decimal::Decimal;
use super::histogram::Histogram;
use super::layout::Layout;
use super::report::{aligned, ranges};
use super::row::{EventRow, Sink, SlaveRow};
use super::summary::{Distribution, map};
use crate::observation::{Disturbance, Observation, Phase, PllState, SlaveState};
use crate::time::{Span, Time};
use crate::wire::Address;

/// Times that are kept one by one, in the order in which they came.
pub const SINGLES: usize = 20;
/// Longest time that has a place in a histogram. Model: a slave that needs more than an hour does not recover.
const LIMIT: Span = Span::from_s(3_600);
/// Cycles after which a disturbance that left no trace has done nothing: its own, and the next one, in whose beginning the
/// SYNCH that it took is missed.
const TRACE: u64 = 2;

/// What happened to a slave.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Harm {
    /// It latched a fault of this code (manual 5.3).
    Fault(u16),
    /// It lost full operation without a fault: its master let it go, its watchdog ran out, or its supply failed.
    Loss,
}
impl fmt::Display for Harm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fault(code) => f.pad(&format!("{code:04X}")),
            Self::Loss => f.pad("loss"),
        }
    }
}

/// What the scenario does to slaves.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Trouble {
    /// The slave that it is about; none is every slave.
    pub slave: Option<Address>,
    /// What it begins or ends.
    pub edge: Edge,
}

/// Whether a disturbance lasts.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Edge {
    /// It is over at once: a telegram.
    Moment,
    /// It lasts from now on.
    Begins,
    /// It lasts no longer.
    Ends,
}

impl Trouble {
    /// What `station` observed, as a disturbance; none if it is none. `is_slave` tells slaves from masters.
    pub fn of(station: Address, is_slave: bool, what: &Observation) -> Option<Self> {
        let lasting = |on: bool| if on { Edge::Begins } else { Edge::Ends };
        match *what {
            Observation::Disturbed { how: how @ (Disturbance::Begins | Disturbance::Ends), .. } => {
                let edge = lasting(how == Disturbance::Begins);
                Some(Self { slave: is_slave.then_some(station), edge })
            }
            Observation::Disturbed { .. } => Some(Self { slave: None, edge: Edge::Moment }),
            // Without its master nobody operates.
            Observation::Power { on } => Some(Self { slave: is_slave.then_some(station), edge: lasting(!on) }),
            Observation::MasterLifeHeld { slave, held } => Some(Self { slave: Some(slave), edge: lasting(held) }),
            _ => None,
        }
    }
}

/// Times of one kind of all slaves.
#[derive(Clone, Debug)]
pub struct Times {
    histogram: Histogram,
    singles: Vec<Span>,
}

impl Times {
    fn new() -> Self {
        Self { histogram: Histogram::new(LIMIT, false), singles: Vec::with_capacity(SINGLES) }
    }
    fn add(&mut self, time: Span) {
        self.histogram.record(time);
        if self.singles.len() < SINGLES {
            self.singles.push(time);
        }
    }
    /// How they are distributed.
    pub const fn histogram(&self) -> &Histogram {
        &self.histogram
    }
    /// Each of them in the order of time, if there are no more than [`SINGLES`].
    pub fn singles(&self) -> Option<&[Span]> {
        (self.histogram.count() == self.singles.len() as u64).then_some(&self.singles[..])
    }
}

/// Times of one kind of one slave.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Spread {
    /// How many.
    pub count: u64,
    min: Span,
    max: Span,
    total: i128,
}

impl Spread {
    fn add(&mut self, time: Span) {
        self.min = if self.count == 0 { time } else { self.min.min(time) };
        self.max = self.max.max(time);
        self.total += i128::from(time.ticks());
        self.count += 1;
    }
    /// Both together.
    #[must_use]
    pub fn merged(self, other: Self) -> Self {
        match (self.count, other.count) {
            (0, _) => other,
            (_, 0) => self,
            _ => Self {
                count: self.count + other.count,
                min: self.min.min(other.min),
                max: self.max.max(other.max),
                total: self.total + other.total,
            },
        }
    }
    /// The shortest; none if there is none.
    pub fn min(&self) -> Option<Span> {
        (self.count > 0).then_some(self.min)
    }
    /// The longest; none if there is none.
    pub fn max(&self) -> Option<Span> {
        (self.count > 0).then_some(self.max)
    }
    /// The mean, rounded down to a tick; none if there is none.
    pub fn mean(&self) -> Option<Span> {
        (self.count > 0).then(|| Span::from_ticks(self.total.div_euclid(i128::from(self.count)) as i64))
    }
}

/// The episodes of one slave.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SlaveEpisodes {
    /// The slave.
    pub address: Address,
    /// How often it lost full operation.
    pub losses: u64,
    /// Since when it is without full operation, if it had it before.
    pub lasting: Option<Time>,
    /// From a disturbance to what it did.
    pub to_harm: BTreeMap<Harm, Spread>,
    /// From the end of full operation to the next, by what ended it.
    pub recovery: BTreeMap<Harm, Spread>,
    watch: Watch,
}

/// What is known of a slave between two events.
#[derive(Clone, PartialEq, Eq, Debug)]
struct Watch {
    clocked: bool,
    state: SlaveState,
    phase: Phase,
    pll: PllState,
    /// Whether it is in full operation.
    full: bool,
    /// The first disturbance since it was unharmed, as instant and cycle.
    hit: Option<(Time, u64)>,
    /// The first disturbance of each of the latest cycles.
    recent: [Option<(Time, u64)>; TRACE as usize],
    /// Disturbances that last.
    lasting: u32,
    /// What the present disturbances did already.
    done: Vec<Harm>,
    /// What ended full operation, once that is known.
    cause: Option<Harm>,
}

impl Watch {
    const fn operates(&self) -> bool {
        let exchanges = matches!(self.state, SlaveState::DataExch);
        exchanges && (!self.clocked || matches!((self.phase, self.pll), (Phase::Operation, PllState::Locked)))
    }
    /// Takes in a change of state.
    const fn observe(&mut self, what: &Observation) {
        match *what {
            Observation::SlaveState { to, .. } => self.state = to,
            Observation::Phase { to, .. } => self.phase = to,
            Observation::Pll { to, .. } => self.pll = to,
            Observation::Power { on: false } => {
                (self.state, self.phase, self.pll) = (SlaveState::PowerOn, Phase::Configuration, PllState::Idle);
            }
            _ => {}
        }
    }
}

/// The episodes of all slaves, filled from rows.
#[derive(Clone, Debug)]
pub struct Episodes {
    layout: Layout,
    slaves: Vec<SlaveEpisodes>,
    to_harm: BTreeMap<Harm, Times>,
    recovery: BTreeMap<Harm, Times>,
}

impl Episodes {
    /// No episode yet; `clocked` tells which slaves have a clock.
    pub fn new(layout: &Layout, clocked: impl Fn(Address) -> bool) -> Self {
        let slave = |address| SlaveEpisodes {
            address,
            losses: 0,
            lasting: None,
            to_harm: BTreeMap::new(),
            recovery: BTreeMap::new(),
            watch: Watch {
                clocked: clocked(address),
                state: SlaveState::PowerOn,
                phase: Phase::Configuration,
                pll: PllState::Idle,
                full: false,
                hit: None,
                recent: [None; TRACE as usize],
                lasting: 0,
                done: Vec::new(),
                cause: None,
            },
        };
        Self {
            slaves: layout.slaves().iter().map(|layout| slave(layout.address)).collect(),
            layout: layout.clone(),
            to_harm: BTreeMap::new(),
            recovery: BTreeMap::new(),
        }
    }

    /// The run is over at `end`: what is not told by then is no more.
    pub fn finish(&mut self, end: Time) {
        for index in 0..self.slaves.len() {
            self.settle(index, end + self.layout.t_dp);
        }
    }
    /// Whether no slave was harmed.
    pub fn is_empty(&self) -> bool {
        self.to_harm.is_empty() && self.slaves.iter().all(|slave| slave.losses == 0)
    }
    /// Per slave, in address order.
    pub fn slaves(&self) -> &[SlaveEpisodes] {
        &self.slaves
    }
    /// Times from a disturbance to what it did, of all slaves.
    pub const fn to_harm(&self) -> &BTreeMap<Harm, Times> {
        &self.to_harm
    }
    /// Times from the end of full operation to the next, of all slaves, by what ended it.
    pub const fn recovery(&self) -> &BTreeMap<Harm, Times> {
        &self.recovery
    }

    /// A disturbance of slave number `index`.
    fn disturb(&mut self, index: usize, row: &EventRow, edge: Edge) {
        let watch = &mut self.slaves[index].watch;
        match edge {
            Edge::Ends => watch.lasting = watch.lasting.saturating_sub(1),
            Edge::Moment | Edge::Begins => {
                watch.lasting += u32::from(edge == Edge::Begins);
                let recent = &mut watch.recent[(row.cycle % TRACE) as usize];
                if recent.is_none_or(|recent| recent.1 != row.cycle) {
                    *recent = Some((row.at, row.cycle));
                }
                if watch.hit.is_none() {
                    watch.hit = Some((row.at, row.cycle));
                    watch.done.clear();
                }
            }
        }
    }

    /// Counts the time to `harm` at `at`, once per stretch of disturbances.
    fn harmed(&mut self, index: usize, at: Time, harm: Harm) {
        let slave = &mut self.slaves[index];
        let Some((hit, _)) = slave.watch.hit else { return };
        if !slave.watch.done.contains(&harm) {
            slave.watch.done.push(harm);
            slave.to_harm.entry(harm).or_default().add(at - hit);
            self.to_harm.entry(harm).or_insert_with(Times::new).add(at - hit);
        }
    }

    /// Decides what ended full operation, if it is too late for a fault to tell.
    fn settle(&mut self, index: usize, now: Time) {
        let slave = &mut self.slaves[index];
        let watch = &mut slave.watch;
        let Some(lost) = slave.lasting.filter(|_| watch.cause.is_none()) else { return };
        if now - lost <= self.layout.t_dp {
            return;
        }
        watch.cause = Some(Harm::Loss);
        // A supply that fails is no disturbance that leads to a loss, it is the loss; and a fault tells it before.
        if watch.done.is_empty() && watch.hit.is_some_and(|hit| hit.0 < lost) {
            self.harmed(index, lost, Harm::Loss);
        }
    }

    /// What slave number `index` observed.
    fn observe(&mut self, index: usize, row: &EventRow) {
        self.settle(index, row.at);
        let slave = &mut self.slaves[index];
        if let Observation::Fault { code } = row.what {
            if slave.lasting.is_some() {
                slave.watch.cause.get_or_insert(Harm::Fault(code));
            }
            return self.harmed(index, row.at, Harm::Fault(code));
        }
        let watch = &mut slave.watch;
        watch.observe(&row.what);
        let full = watch.operates();
        match (std::mem::replace(&mut watch.full, full), full) {
            (true, false) => {
                slave.losses += 1;
                slave.lasting = Some(row.at);
            }
            (false, true) => self.recovered(index, row.at),
            _ => {}
        }
    }

    /// Slave number `index` is in full operation from `at` on.
    fn recovered(&mut self, index: usize, at: Time) {
        let slave = &mut self.slaves[index];
        let cause = slave.watch.cause.take();
        if let Some(lost) = slave.lasting.take() {
            let cause = cause.unwrap_or(Harm::Loss);
            slave.recovery.entry(cause).or_default().add(at - lost);
            self.recovery.entry(cause).or_insert_with(Times::new).add(at - lost);
        }
    }
}

impl Sink for Episodes {
    fn slave(&mut self, row: &SlaveRow) {
        let Some(index) = self.layout.slave(row.slave) else { return };
        let watch = &mut self.slaves[index].watch;
        let Some((_, cycle)) = watch.hit else { return };
        let unharmed = watch.full && row.life_counter == 0 && row.clock_counter == 0;
        if unharmed && watch.lasting == 0 && row.cycle >= cycle + TRACE {
            // What came in the meantime may still show.
            watch.hit = watch.recent.into_iter().flatten().filter(|recent| recent.1 + TRACE > row.cycle).min();
            watch.done.clear();
        }
    }
    fn event(&mut self, row: &EventRow) {
        let own = self.layout.slave(row.station);
        if let Some(Trouble { slave, edge }) = Trouble::of(row.station, own.is_some(), &row.what) {
            match slave {
                None => (0..self.slaves.len()).for_each(|index| self.disturb(index, row, edge)),
                Some(slave) => self.layout.slave(slave).into_iter().for_each(|index| self.disturb(index, row, edge)),
            }
        }
        if let Some(index) = own {
            self.observe(index, row);
        }
    }
}

/// The episodes of a run as figures. Times are distributions as everywhere in the summary.
#[derive(Clone, Debug, Serialize)]
pub struct EpisodeSummary {
    /// How often slaves lost full operation.
    pub losses: u64,
    /// Slaves that had not got it back at the end, in address order.
    pub lasting: Vec<u8>,
    /// From a disturbance to a fault: `all` codes together, then each; `loss` is the time to a loss without fault, which
    /// is not in `all`.
    #[serde(serialize_with = "map")]
    pub time_to_fault: Vec<(String, Distribution)>,
    /// From the end of full operation to the next: `all` together, then by the fault that ended it, `loss` without one.
    #[serde(serialize_with = "map")]
    pub recovery: Vec<(String, Distribution)>,
    /// Slaves with an episode, in address order.
    pub slaves: Vec<SlaveEpisodeSummary>,
}

/// The episodes of one slave as figures.
#[derive(Clone, Debug, Serialize)]
pub struct SlaveEpisodeSummary {
    /// Its address.
    pub address: u8,
    /// How often it lost full operation.
    pub losses: u64,
    /// Whether it had not got it back at the end.
    pub lasting: bool,
    /// As [`EpisodeSummary::time_to_fault`].
    #[serde(serialize_with = "map")]
    pub time_to_fault: Vec<(String, Spread)>,
    /// As [`EpisodeSummary::recovery`].
    #[serde(serialize_with = "map")]
    pub recovery: Vec<(String, Spread)>,
}

impl EpisodeSummary {
    /// The figures; none if no slave was harmed.
    pub fn of(episodes: &Episodes) -> Option<Self> {
        (!episodes.is_empty()).then(|| Self {
            losses: episodes.slaves.iter().map(|slave| slave.losses).sum(),
            lasting: episodes.slaves.iter().filter(|s| s.lasting.is_some()).map(|s| s.address.get()).collect(),
            time_to_fault: distributions(&episodes.to_harm, |harm| harm != Harm::Loss),
            recovery: distributions(&episodes.recovery, |_| true),
            slaves: episodes.slaves.iter().filter_map(SlaveEpisodeSummary::of).collect(),
        })
    }
    /// Time from a disturbance to a fault: `all`, `0F04`, `loss`.
    pub fn time_to_fault(&self, name: &str) -> Option<&Distribution> {
        self.time_to_fault.iter().find(|entry| entry.0 == name).map(|entry| &entry.1)
    }
    /// Time from the end of full operation to the next: `all`, `0F04`, `loss`.
    pub fn recovery(&self, name: &str) -> Option<&Distribution> {
        self.recovery.iter().find(|entry| entry.0 == name).map(|entry| &entry.1)
    }

    /// The page's lines.
    pub(super) fn lines(&self) -> Vec<String> {
        let each = |what: &str, of: &[(String, Distribution)], loss: &str| -> Vec<Vec<String>> {
            let single = of.iter().filter(|entry| entry.0 != ALL);
            let name = |name: &str| if name == LOSS { loss.to_owned() } else { what.replace("{}", name) };
            single.map(|(harm, times)| cells(name(harm), times)).collect()
        };
        let mut rows = each("disturbance to {}", &self.time_to_fault, "disturbance to loss of operation");
        rows.extend(each("{} to full operation", &self.recovery, "loss of operation to full operation"));
        let mut lines = aligned(&["episode", "count", "min", "mean", "p99", "max"], &[0], &rows);
        if rows.is_empty() {
            lines.clear();
        }
        if !self.lasting.is_empty() {
            let slaves = ranges(&self.lasting);
            lines.push(format!("full operation was lost {}, and not regained by slave {slaves}", times(self.losses)));
        }
        lines
    }
}

/// Name of what ended in no fault.
const LOSS: &str = "loss";
/// Name of all together.
const ALL: &str = "all";

impl SlaveEpisodeSummary {
    fn of(slave: &SlaveEpisodes) -> Option<Self> {
        (slave.losses > 0 || !slave.to_harm.is_empty()).then(|| Self {
            address: slave.address.get(),
            losses: slave.losses,
            lasting: slave.lasting.is_some(),
            time_to_fault: spreads(&slave.to_harm, |harm| harm != Harm::Loss),
            recovery: spreads(&slave.recovery, |_| true),
        })
    }
}

/// Distributions by name, `all` first.
fn distributions(of: &BTreeMap<Harm, Times>, counts: impl Fn(Harm) -> bool) -> Vec<(String, Distribution)> {
    let all = merged(of, counts).map(|all| (ALL.to_owned(), Distribution::of(&all)));
    let each = of.iter().map(|(harm, times)| (harm.to_string(), Distribution::of(&times.histogram)));
    all.into_iter().chain(each).collect()
}

/// All those that count in one histogram; none if there are none.
pub(super) fn merged(of: &BTreeMap<Harm, Times>, counts: impl Fn(Harm) -> bool) -> Option<Histogram> {
    let mut counted = of.iter().filter(|entry| counts(*entry.0)).map(|entry| &entry.1.histogram);
    let mut all = counted.next()?.clone();
    counted.for_each(|histogram| all.merge(histogram));
    Some(all)
}

fn spreads(of: &BTreeMap<Harm, Spread>, counts: impl Fn(Harm) -> bool) -> Vec<(String, Spread)> {
    let counted = of.iter().filter(|entry| counts(*entry.0)).map(|entry| *entry.1);
    let all = counted.reduce(Spread::merged).map(|all| (ALL.to_owned(), all));
    all.into_iter().chain(of.iter().map(|(harm, spread)| (harm.to_string(), *spread))).collect()
}

fn cells(name: String, times: &Distribution) -> Vec<String> {
    let span = |span: Option<Span>| span.map_or_else(|| "-".to_owned(), |span| span.to_string());
    let count = times.count.to_string();
    vec![name, count, span(times.min), span(times.mean), span(times.p99), span(times.max)]
}

/// `once`, `3 times`.
fn times(count: u64) -> String {
    if count == 1 { "once".to_owned() } else { format!("{count} times") }
}

/// As a distribution in the summary, without percentiles.
impl Serialize for Spread {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeStruct;
        let mut fields = serializer.serialize_struct("Spread", 4)?;
        fields.serialize_field("count", &self.count)?;
        fields.serialize_field("min_ns", &self.min().map(Decimal::ns))?;
        fields.serialize_field("mean_ns", &self.mean().map(Decimal::ns))?;
        fields.serialize_field("max_ns", &self.max().map(Decimal::ns))?;
        fields.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::SlaveCause;
    use crate::study::layout::SlaveLayout;
    use crate::study::sample::address;

    const MASTER: u8 = 2;
    const T_DP: i64 = 1_000;

    /// Slaves 3 and 4 have a clock, slave 5 has none. Told in microseconds; T_DP is 1 ms.
    struct Told(Episodes);

    fn us(us: i64) -> Span {
        Span::from_us(us)
    }
    impl Told {
        fn new() -> Self {
            let slave = |n| SlaveLayout { address: address(n), t_i: us(125), encoder: true };
            let layout = Layout::new(address(MASTER), us(T_DP), vec![slave(3), slave(4), slave(5)], vec![]);
            Self(Episodes::new(&layout, |address| address.get() < 5))
        }
        fn tell(&mut self, at: i64, station: u8, what: Observation) {
            let cycle = (at / T_DP) as u64;
            self.0.event(&EventRow { at: Time::ZERO + us(at), cycle, station: address(station), what });
        }
        fn state(&mut self, at: i64, station: u8, to: SlaveState) {
            let (from, cause) = (SlaveState::PowerOn, SlaveCause::Watchdog);
            self.tell(at, station, Observation::SlaveState { from, to, cause });
        }
        fn phase(&mut self, at: i64, station: u8, to: Phase) {
            self.tell(at, station, Observation::Phase { from: Phase::Configuration, to });
        }
        fn pll(&mut self, at: i64, station: u8, to: PllState) {
            self.tell(at, station, Observation::Pll { from: PllState::Idle, to });
        }
        fn lost(&mut self, at: i64) {
            self.tell(at, MASTER, Observation::Disturbed { number: 0, how: Disturbance::Lost });
        }
        fn fault(&mut self, at: i64, station: u8, code: u16) {
            self.tell(at, station, Observation::Fault { code });
        }
        /// Brings all three into full operation.
        fn operating() -> Self {
            let mut told = Self::new();
            for station in 3..=5 {
                told.state(1_000, station, SlaveState::DataExch);
                told.pll(2_000, station, PllState::Locked);
                told.phase(3_000, station, Phase::Operation);
            }
            assert!(told.0.is_empty());
            told
        }
        /// The row of a cycle of one slave with a failure counter of the clock.
        fn row(&mut self, cycle: u64, station: u8, clock_counter: u16) {
            let row = crate::study::sample::slave(cycle, station);
            self.0.slave(&SlaveRow { clock_counter, life_counter: 0, ..row });
        }
        fn to_harm(&self, station: u8, harm: Harm) -> Option<Spread> {
            self.0.slaves[usize::from(station - 3)].to_harm.get(&harm).copied()
        }
        fn recovery(&self, station: u8, harm: Harm) -> Option<Spread> {
            self.0.slaves[usize::from(station - 3)].recovery.get(&harm).copied()
        }
    }
    fn one(time: i64) -> Option<Spread> {
        let mut spread = None;
        spread.get_or_insert_with(Spread::default).add(us(time));
        spread
    }
    const CLOCK: Harm = Harm::Fault(0x0F04);
    const LIFE: Harm = Harm::Fault(0x0F02);

    #[test]
    fn from_the_first_disturbance_to_the_fault_and_back_to_operation() {
        let mut told = Told::operating();
        told.lost(10_000);
        told.lost(11_000);
        told.pll(11_500, 3, PllState::Waiting);
        told.phase(11_500, 3, Phase::Clock);
        told.fault(11_900, 3, 0x0F04);
        told.fault(12_000, 3, 0x0F04);
        told.pll(30_000, 3, PllState::Locked);
        told.phase(30_000, 3, Phase::MasterLife);
        assert_eq!(told.recovery(3, CLOCK), None, "phase 3 is no full operation");
        told.phase(61_500, 3, Phase::Operation);
        assert_eq!((told.to_harm(3, CLOCK), told.recovery(3, CLOCK)), (one(1_900), one(50_000)));
        assert_eq!((told.to_harm(3, Harm::Loss), told.to_harm(4, CLOCK), told.0.slaves[0].losses), (None, None, 1));
        assert_eq!(told.0.to_harm[&CLOCK].singles(), Some(&[us(1_900)][..]));
        assert_eq!(told.0.recovery[&CLOCK].histogram().max(), Some(us(50_000)));
    }

    #[test]
    fn a_tolerated_disturbance_is_no_cause() {
        let mut told = Told::operating();
        told.lost(10_000);
        told.row(10, 3, 0);
        told.row(11, 3, 10);
        told.row(12, 3, 9);
        told.lost(13_000);
        told.row(13, 3, 1);
        told.fault(13_500, 3, 0x0F04);
        assert_eq!(told.to_harm(3, CLOCK), one(3_500), "the counter was not repaid");
        // Slave 4 did not notice and was unharmed in cycle 12.
        told.row(11, 4, 0);
        told.row(12, 4, 0);
        told.fault(13_400, 4, 0x0F02);
        assert_eq!(told.to_harm(4, LIFE), one(400), "hit again in cycle 13");
        let mut told = Told::operating();
        told.lost(10_000);
        told.row(11, 4, 0);
        told.row(12, 4, 0);
        told.fault(13_400, 4, 0x0F02);
        assert_eq!(told.to_harm(4, LIFE), None, "nothing disturbed it any more");
    }

    #[test]
    fn each_code_counts_once_per_stretch() {
        let mut told = Told::operating();
        told.lost(10_000);
        told.fault(11_000, 3, 0x0F04);
        told.fault(12_000, 3, 0x0F02);
        told.fault(13_000, 3, 0x0F04);
        assert_eq!((told.to_harm(3, CLOCK), told.to_harm(3, LIFE)), (one(1_000), one(2_000)));
        told.row(14, 3, 0);
        told.lost(20_000);
        told.fault(25_000, 3, 0x0F04);
        let clock = told.to_harm(3, CLOCK).unwrap();
        assert_eq!((clock.count, clock.min(), clock.max()), (2, Some(us(1_000)), Some(us(5_000))));
        assert_eq!(clock.mean(), Some(us(3_000)));
        assert_eq!(told.recovery(3, CLOCK), None, "it never left operation");
    }

    #[test]
    fn a_loss_without_fault_is_told_as_one() {
        let mut told = Told::operating();
        told.lost(10_000);
        told.state(12_000, 5, SlaveState::WaitPrm);
        told.state(20_000, 5, SlaveState::DataExch);
        assert_eq!((told.to_harm(5, Harm::Loss), told.recovery(5, Harm::Loss)), (one(2_000), one(8_000)));
        // At the end of a run too, as far as it can be known.
        told.state(20_000, 3, SlaveState::WaitPrm);
        told.0.finish(Time::ZERO + us(20_100));
        assert_eq!(told.to_harm(3, Harm::Loss), one(10_000));
        let summary = EpisodeSummary::of(&told.0).unwrap();
        assert_eq!((summary.losses, &summary.lasting[..]), (2, &[3][..]));
        assert!(summary.time_to_fault("all").is_none(), "a loss is no fault");
        assert_eq!(summary.time_to_fault("loss").unwrap().count, 2);
        assert_eq!(summary.recovery("all").unwrap().max, Some(us(8_000)));
    }

    #[test]
    fn a_disturbance_that_lasts_is_not_forgotten_before_it_ends() {
        let held = |held| Observation::MasterLifeHeld { slave: address(3), held };
        let mut told = Told::operating();
        told.tell(10_000, MASTER, held(true));
        for cycle in 10..20 {
            told.row(cycle, 3, 0);
            told.row(cycle, 4, 0);
        }
        told.fault(20_000, 3, 0x0F02);
        told.fault(20_000, 4, 0x0F02);
        assert_eq!((told.to_harm(3, LIFE), told.to_harm(4, LIFE)), (one(10_000), None), "it is about slave 3");
        told.tell(21_000, MASTER, held(false));
        told.row(21, 3, 0);
        told.fault(22_000, 3, 0x0F04);
        assert_eq!(told.to_harm(3, CLOCK), None);
    }

    #[test]
    fn without_its_supply_a_slave_is_lost_at_once_and_without_the_masters_all_are() {
        let mut told = Told::operating();
        told.tell(10_000, 3, Observation::Power { on: false });
        told.tell(15_000, 3, Observation::Power { on: true });
        assert_eq!((told.to_harm(3, Harm::Loss), told.0.slaves[0].losses), (None, 1));
        assert_eq!(told.0.slaves[0].lasting, Some(Time::ZERO + us(10_000)));
        let mut told = Told::operating();
        told.tell(10_000, MASTER, Observation::Power { on: false });
        told.state(30_000, 4, SlaveState::WaitPrm);
        told.0.finish(Time::ZERO + us(90_000));
        assert_eq!(told.to_harm(4, Harm::Loss), one(20_000));
    }

    #[test]
    fn the_first_start_up_and_faults_during_it_are_no_recovery() {
        let mut told = Told::new();
        told.lost(500);
        told.fault(900, 3, 0x0F01);
        told.state(1_000, 3, SlaveState::DataExch);
        told.pll(2_000, 3, PllState::Locked);
        told.phase(3_000, 3, Phase::Operation);
        assert_eq!((told.to_harm(3, Harm::Fault(0x0F01)), told.0.slaves[0].losses), (one(400), 0));
        assert!(told.0.recovery.is_empty());
    }

    #[test]
    fn many_times_are_in_the_histogram_alone() {
        let mut times = Times::new();
        (1..=SINGLES as i64).for_each(|n| times.add(us(n)));
        assert_eq!(times.singles().map(<[Span]>::len), Some(SINGLES));
        times.add(us(1));
        assert_eq!((times.singles(), times.histogram().count()), (None, SINGLES as u64 + 1));
    }

    #[test]
    fn the_page_has_a_line_per_kind() {
        let mut told = Told::operating();
        told.lost(10_000);
        told.fault(11_000, 3, 0x0F04);
        told.pll(11_000, 3, PllState::Waiting);
        told.0.finish(Time::ZERO + us(11_100));
        let lines = EpisodeSummary::of(&told.0).unwrap().lines();
        let expected = [
            "episode              count   min  mean   p99   max",
            "disturbance to 0F04      1  1 ms  1 ms  1 ms  1 ms",
            "full operation was lost once, and not regained by slave 3",
        ];
        assert_eq!(lines, expected);
        let json = serde_json::to_value(EpisodeSummary::of(&told.0)).unwrap();
        assert_eq!(json["slaves"][0]["time_to_fault"]["0F04"]["max_ns"], 1_000_000.0);
        assert!(EpisodeSummary::of(&Told::operating().0).is_none());
    }
}
