//! Histograms: how each measured quantity is distributed over a run, signs kept, in a memory that does not grow.
//!
//! A signed quantity is kept in two tallies of ticks, one of magnitudes below zero and one of values from zero up, so that three significant digits hold on either side and every value below 2048 ticks (170 ns) is exact. Bounds
//! are fixed. A value beyond them is not lost: it is counted as out of range, enters count, mean, smallest and largest
//! exactly, and a percentile that falls among such values says the smallest or largest.

use super::layout::Layout;
use super::row::{CycleRow, LinkRow, Sink, SlaveRow};
use super::statistics::bins::Counted;
use super::tally::{Step, Tally};
use crate::time::Span;
use crate::wire::Address;

/// The distribution of one quantity of one subject.
#[derive(Clone, Debug)]
pub struct Histogram {
    /// Largest magnitude \[ticks\] that is kept with its place.
    limit: u64,
    /// Magnitudes of values below zero \[ticks\]; none for an unsigned quantity.
    negative: Option<Tally>,
    /// Values from zero up \[ticks\].
    positive: Tally,
    below: u64,
    above: u64,
    min: i64,
    max: i64,
    sum: i128,
}

/// A stretch of a [`Histogram`] on a linear axis.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Bin {
    /// The smallest value that falls in.
    pub from: Span,
    /// The smallest value that does not fall in any more.
    pub to: Span,
    /// How many did.
    pub count: u64,
}

impl Histogram {
    /// An empty histogram for values up to `limit` in magnitude, at least 2 ticks, and down to zero unless `signed`.
    ///
    /// # Panics
    /// If `limit` is below 2 ticks.
    pub fn new(limit: Span, signed: bool) -> Self {
        let limit = u64::try_from(limit.ticks()).expect("a limit is positive");
        assert!(limit >= 2, "a limit is at least 2 ticks");
        Self {
            limit,
            negative: signed.then(|| Tally::new(limit)),
            positive: Tally::new(limit),
            below: 0,
            above: 0,
            min: i64::MAX,
            max: i64::MIN,
            sum: 0,
        }
    }

    /// Counts one value. Allocates nothing.
    #[inline]
    pub fn record(&mut self, value: Span) {
        let ticks = value.ticks();
        self.min = self.min.min(ticks);
        self.max = self.max.max(ticks);
        self.sum += i128::from(ticks);
        let magnitude = ticks.unsigned_abs();
        match (ticks < 0, &mut self.negative) {
            (false, _) if magnitude <= self.limit => self.positive.record(magnitude),
            (false, _) => self.above += 1,
            (true, Some(negative)) if magnitude <= self.limit => negative.record(magnitude),
            (true, _) => self.below += 1,
        }
    }

    /// Forgets every value. Allocates nothing.
    pub fn reset(&mut self) {
        self.negative.iter_mut().chain([&mut self.positive]).for_each(Tally::reset);
        (self.below, self.above, self.min, self.max, self.sum) = (0, 0, i64::MAX, i64::MIN, 0);
    }

    /// Adds everything that `other` counted.
    ///
    /// # Panics
    /// If `other` has other bounds.
    pub fn merge(&mut self, other: &Self) {
        assert!(self.limit == other.limit && self.is_signed() == other.is_signed(), "histograms of different bounds");
        self.positive.merge(&other.positive);
        if let (Some(mine), Some(theirs)) = (&mut self.negative, &other.negative) {
            mine.merge(theirs);
        }
        self.below += other.below;
        self.above += other.above;
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.sum += other.sum;
    }

    /// The sum of all values, exact \[ticks\].
    pub(in crate::study) const fn sum(&self) -> i128 {
        self.sum
    }
    /// How many values were recorded, those out of range included.
    pub fn count(&self) -> u64 {
        self.negative_count() + self.positive.len() + self.below + self.above
    }
    /// Values below the range; below zero if the quantity is unsigned.
    pub fn below(&self) -> u64 {
        self.below
    }
    /// Values above the range.
    pub fn above(&self) -> u64 {
        self.above
    }
    /// Whether values below zero have a place.
    pub fn is_signed(&self) -> bool {
        self.negative.is_some()
    }
    /// The smallest value, exact; none if there is no value.
    pub fn min(&self) -> Option<Span> {
        (self.count() > 0).then(|| Span::from_ticks(self.min))
    }
    /// The largest value, exact; none if there is no value.
    pub fn max(&self) -> Option<Span> {
        (self.count() > 0).then(|| Span::from_ticks(self.max))
    }
    /// The value farthest from zero, with its sign, exact; of two equally far the positive one.
    pub fn farthest(&self) -> Option<Span> {
        let farthest = if self.min.unsigned_abs() > self.max.unsigned_abs() { self.min } else { self.max };
        (self.count() > 0).then(|| Span::from_ticks(farthest))
    }
    /// The mean of all values, exact, rounded to the nearest tick, halves away from zero.
    pub fn mean(&self) -> Option<Span> {
        let count = i128::from(self.count());
        let half = if self.sum < 0 { -(count / 2) } else { count / 2 };
        (count > 0).then(|| Span::from_ticks(((self.sum + half) / count) as i64))
    }

    /// The value that `percent` of all values do not exceed, to three significant digits; none if there is no value.
    ///
    /// `percent` is rounded to thousandths; the value is the one of rank ceil(percent / 100 x count), at least 1.
    pub fn percentile(&self, percent: f64) -> Option<Span> {
        let rank = self.rank(percent)?;
        if rank <= self.below {
            return self.min();
        }
        let ticks = of_rank(&self.recorded(), rank - self.below);
        ticks.map_or_else(|| self.max(), |ticks| Some(Span::from_ticks(ticks.clamp(self.min, self.max))))
    }

    /// The same for the magnitudes of the values, whatever their sign.
    pub fn magnitude_percentile(&self, percent: f64) -> Option<Span> {
        let rank = self.rank(percent)?;
        let farthest = self.farthest()?.abs();
        let mut magnitudes: Vec<_> = self.recorded().into_iter().map(|(ticks, count)| (ticks.abs(), count)).collect();
        magnitudes.sort_unstable();
        let ticks = of_rank(&magnitudes, rank);
        Some(ticks.map_or(farthest, |ticks| Span::from_ticks(ticks).min(farthest)))
    }

    /// At most `bins` bins of equal width that hold everything in range, for drawing.
    ///
    /// A bin is never narrower than what the histogram can tell apart there. Values out of range are in no bin; ask
    /// [`below`](Self::below) and [`above`](Self::above).
    pub fn bins(&self, bins: usize) -> Vec<Bin> {
        let recorded = self.recorded();
        let (Some(first), Some(last)) = (recorded.first(), recorded.last()) else { return Vec::new() };
        let resolution = Tally::width(first.0.unsigned_abs().max(last.0.unsigned_abs())) as i64;
        // A recorded value stands in the middle of what the histogram cannot tell apart.
        let (low, high) = (first.0 - resolution / 2, last.0 + resolution / 2);
        let width = ((high - low) / bins.max(1) as i64 + 1).max(resolution);
        let count = ((high - low) / width + 1) as usize;
        let mut bins: Vec<_> = (0..count as i64)
            .map(|number| Bin {
                from: Span::from_ticks(low + number * width),
                to: Span::from_ticks(low + (number + 1) * width),
                count: 0,
            })
            .collect();
        for (ticks, count) in recorded {
            bins[((ticks - low) / width) as usize].count += count;
        }
        bins
    }

    /// Magnitudes of the values below zero \[ticks\], for export; none if the quantity is unsigned.
    pub fn negative(&self) -> Option<hdrhistogram::Histogram<u64>> {
        self.negative.as_ref().map(|side| side.hdr(self.limit))
    }
    /// Values from zero up \[ticks\], for export.
    pub fn positive(&self) -> hdrhistogram::Histogram<u64> {
        self.positive.hdr(self.limit)
    }

    /// Everything in bins, ascending: what cannot be told apart is one, and so is what is out of range on either side.
    pub(in crate::study) fn counted(&self) -> Vec<Counted> {
        let limit = self.limit as i64;
        let side = |side: &Tally, sign: i64| {
            let bin = |step: Step| {
                let ends = [step.low, step.high()].map(|end| sign * end as i64);
                (ends[0].min(ends[1]), ends[0].max(ends[1]), step.count)
            };
            side.steps().map(bin).collect::<Vec<_>>()
        };
        let mut all = self.negative.as_ref().map_or_else(Vec::new, |negative| side(negative, -1));
        all.push((self.min, if self.is_signed() { -limit - 1 } else { -1 }, self.below));
        all.extend(side(&self.positive, 1));
        all.push((limit.saturating_add(1), self.max, self.above));
        all.retain(|bin| bin.2 > 0);
        all.sort_unstable();
        let inside = |ticks: i64| ticks.clamp(self.min, self.max);
        all.into_iter().map(|(low, high, count)| Counted { low: inside(low), high: inside(high), count }).collect()
    }
    /// What is in range, ascending, as (middle of what cannot be told apart \[ticks\], count).
    fn recorded(&self) -> Vec<(i64, u64)> {
        let place = |sign: i64| move |step: Step| (sign * step.middle() as i64, step.count);
        let below = self.negative.iter().flat_map(Tally::steps).rev().map(place(-1));
        below.chain(self.positive.steps().map(place(1))).collect()
    }
    fn negative_count(&self) -> u64 {
        self.negative.as_ref().map_or(0, Tally::len)
    }
    fn rank(&self, percent: f64) -> Option<u64> {
        let thousandths = (percent.clamp(0.0, 100.0) * 1_000.0).round() as u128;
        let rank = (thousandths * u128::from(self.count())).div_ceil(100_000) as u64;
        (self.count() > 0).then_some(rank.max(1))
    }
}

/// The `rank`-th value, from 1, of ascending values with their counts; none beyond the last.
fn of_rank(recorded: &[(i64, u64)], rank: u64) -> Option<i64> {
    let mut left = rank;
    for &(value, count) in recorded {
        if left <= count {
            return Some(value);
        }
        left -= count;
    }
    None
}

/// What a row tells of a quantity, and so of what the quantity is one.
#[derive(Clone, Copy, Debug)]
pub enum Source {
    /// One value per cycle.
    Network(fn(&CycleRow) -> Option<Span>),
    /// One value per cycle, of a network whose masters share the token; a master alone has none.
    Ring(fn(&CycleRow) -> Option<Span>),
    /// One value per slave and cycle.
    Slave(fn(&SlaveRow) -> Option<Span>),
    /// One value per link and cycle.
    Link(fn(&LinkRow) -> Option<Span>),
}

/// The unit in which people read a quantity.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Unit {
    /// Nanoseconds.
    Ns,
    /// Microseconds.
    Us,
}

impl Unit {
    /// The unit as an axis names it.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Ns => "ns",
            Self::Us => "µs",
        }
    }
    /// `span` as a number of this unit, for drawing.
    pub fn of(self, span: Span) -> f64 {
        match self {
            Self::Ns => span.as_ns(),
            Self::Us => span.as_us(),
        }
    }
}

/// Something measured in every cycle.
#[derive(Clone, Copy, Debug)]
pub struct Quantity {
    /// Its name in files.
    pub name: &'static str,
    /// Its name for people.
    pub title: &'static str,
    /// The unit in which people read it.
    pub unit: Unit,
    /// Whether it can be negative.
    pub signed: bool,
    /// Largest magnitude that is kept with its place.
    pub limit: Span,
    /// Where it comes from.
    pub source: Source,
}

/// Model: a slave that is off by more than 10 ms is not off by jitter or drift; such values are counted, not placed.
const NEAR: Span = Span::from_ms(10);
/// Model: three times the longest T_DP (32 ms, D3).
const CYCLE: Span = Span::from_ms(96);

/// Every recorded quantity. One line here is all that a new one needs.
#[rustfmt::skip]
pub const QUANTITIES: &[Quantity] = &[
    Quantity { name: "latch_skew", title: "Latch skew", unit: Unit::Ns, signed: false, limit: NEAR, source: Source::Network(|row| row.latch_skew) },
    Quantity { name: "gc_jitter", title: "Clock jitter", unit: Unit::Ns, signed: true, limit: NEAR, source: Source::Network(|row| Some(row.gc_jitter)) },
    Quantity { name: "t_dp_deviation", title: "T_DP deviation", unit: Unit::Ns, signed: true, limit: CYCLE, source: Source::Network(|row| row.t_dp_deviation) },
    Quantity { name: "t_dx", title: "T_DX", unit: Unit::Us, signed: false, limit: CYCLE, source: Source::Network(|row| row.t_dx) },
    Quantity { name: "spare", title: "Spare", unit: Unit::Us, signed: false, limit: CYCLE, source: Source::Network(|row| row.spare) },
    Quantity { name: "synch_delay", title: "SYNCH delay", unit: Unit::Us, signed: false, limit: CYCLE, source: Source::Ring(|row| row.synch_delay) },
    Quantity { name: "latch_offset", title: "Latch offset", unit: Unit::Ns, signed: true, limit: NEAR, source: Source::Slave(|row| row.latch_offset) },
    Quantity { name: "pll_error", title: "PLL error", unit: Unit::Ns, signed: true, limit: NEAR, source: Source::Slave(|row| row.pll_error) },
    Quantity { name: "wire", title: "Wire latency", unit: Unit::Us, signed: false, limit: CYCLE, source: Source::Link(|row| Some(row.wire)) },
    Quantity { name: "publish", title: "Publish latency", unit: Unit::Us, signed: false, limit: CYCLE, source: Source::Link(|row| Some(row.publish)) },
    Quantity { name: "age", title: "Age at use", unit: Unit::Us, signed: false, limit: CYCLE, source: Source::Link(|row| row.age) },
];

impl Quantity {
    /// The quantity of this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        QUANTITIES.iter().find(|quantity| quantity.name == name)
    }
    /// Whose this quantity is in a network of `layout`, in the order of the rows.
    pub fn subjects(&self, layout: &Layout) -> Vec<Subject> {
        match self.source {
            Source::Ring(_) if layout.masters().is_empty() => Vec::new(),
            Source::Network(_) | Source::Ring(_) => vec![Subject::Network],
            Source::Slave(_) => layout.slaves().iter().map(|slave| Subject::Slave(slave.address)).collect(),
            Source::Link(_) => layout.links().iter().map(|&(from, to)| Subject::Link(from, to)).collect(),
        }
    }
}

/// Whose quantity it is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Subject {
    /// The whole network.
    Network,
    /// One slave.
    Slave(Address),
    /// A publisher and its subscriber.
    Link(Address, Address),
}

/// `network`, `slave-5`, `link-3-7`.
impl core::fmt::Display for Subject {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Network => f.write_str("network"),
            Self::Slave(address) => write!(f, "slave-{address}"),
            Self::Link(publisher, subscriber) => write!(f, "link-{publisher}-{subscriber}"),
        }
    }
}

/// A quantity and what a row tells of it.
type Told<R> = (&'static Quantity, fn(&R) -> Option<Span>);

/// The lines of the registry with one kind of source, in their order. They are known when this is compiled, so that no row
/// is asked through a pointer.
macro_rules! told {
    ($name:ident: [$row:ty; $count:ident] = $source:path) => {
        const $count: usize = {
            let (mut count, mut line) = (0, 0);
            while line < QUANTITIES.len() {
                count += matches!(QUANTITIES[line].source, $source(_)) as usize;
                line += 1;
            }
            count
        };
        const $name: [Told<$row>; $count] = {
            let mut all: [Told<$row>; $count] = [(&QUANTITIES[0], |_| None); $count];
            let (mut found, mut line) = (0, 0);
            while line < QUANTITIES.len() {
                if let $source(of) = QUANTITIES[line].source {
                    all[found] = (&QUANTITIES[line], of);
                    found += 1;
                }
                line += 1;
            }
            all
        };
    };
}
told!(OF_NETWORK: [CycleRow; NETWORK] = Source::Network);
told!(OF_RING: [CycleRow; RING] = Source::Ring);
told!(OF_SLAVE: [SlaveRow; SLAVE] = Source::Slave);
told!(OF_LINK: [LinkRow; LINK] = Source::Link);

/// Every quantity of every subject of one network, filled from rows.
#[derive(Clone, Debug)]
pub struct Histograms {
    layout: Layout,
    network: [Histogram; NETWORK],
    /// None where the master is alone: nothing is kept, and no row is asked.
    ring: Option<[Histogram; RING]>,
    slaves: Vec<[Histogram; SLAVE]>,
    links: Vec<[Histogram; LINK]>,
}

impl Histograms {
    /// Empty histograms for a network.
    pub fn new(layout: &Layout) -> Self {
        Self {
            layout: layout.clone(),
            network: empty(&OF_NETWORK),
            ring: (!layout.masters().is_empty()).then(|| empty(&OF_RING)),
            slaves: layout.slaves().iter().map(|_| empty(&OF_SLAVE)).collect(),
            links: layout.links().iter().map(|_| empty(&OF_LINK)).collect(),
        }
    }

    /// Empty histograms for a network of `layout`, in the memory of these: for many short runs, of which each would
    /// otherwise spend milliseconds on its own.
    pub fn reset(&mut self, layout: &Layout) {
        self.layout.clone_from(layout);
        self.all_mut().for_each(Histogram::reset);
        if self.ring.is_none() != layout.masters().is_empty() {
            self.ring = (!layout.masters().is_empty()).then(|| empty(&OF_RING));
        }
        self.slaves.resize_with(layout.slaves().len(), || empty(&OF_SLAVE));
        self.links.resize_with(layout.links().len(), || empty(&OF_LINK));
    }

    /// The network these are of.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }
    /// The histogram of the quantity `name` of `subject`; none if there is no such quantity or subject.
    pub fn get(&self, name: &str, subject: Subject) -> Option<&Histogram> {
        match subject {
            Subject::Network => {
                named(&self.network, &OF_NETWORK, name).or_else(|| named(self.ring.as_ref()?, &OF_RING, name))
            }
            Subject::Slave(address) => named(&self.slaves[self.layout.slave(address)?], &OF_SLAVE, name),
            Subject::Link(publisher, subscriber) => {
                named(&self.links[self.layout.link(publisher, subscriber)?], &OF_LINK, name)
            }
        }
    }
    /// Every histogram, in a fixed order. Allocates nothing.
    pub(in crate::study) fn all(&self) -> impl Iterator<Item = &Histogram> {
        let network = self.network.iter().chain(self.ring.iter().flatten());
        network.chain(self.slaves.iter().flatten()).chain(self.links.iter().flatten())
    }
    fn all_mut(&mut self) -> impl Iterator<Item = &mut Histogram> {
        let network = self.network.iter_mut().chain(self.ring.iter_mut().flatten());
        network.chain(self.slaves.iter_mut().flatten()).chain(self.links.iter_mut().flatten())
    }
    /// Which one of [`Self::all`] the histogram of the quantity `name` of `subject` is.
    pub(in crate::study) fn place(&self, name: &str, subject: Subject) -> Option<usize> {
        let wanted = self.get(name, subject)?;
        self.all().position(|histogram| std::ptr::eq(histogram, wanted))
    }
    /// Everything, by quantity as in [`QUANTITIES`], then by subject.
    pub fn iter(&self) -> impl Iterator<Item = (&'static Quantity, Subject, &Histogram)> {
        QUANTITIES.iter().flat_map(move |quantity| {
            let subjects = quantity.subjects(&self.layout).into_iter();
            subjects.filter_map(move |subject| Some((quantity, subject, self.get(quantity.name, subject)?)))
        })
    }
    /// Adds everything that `other` counted, for repetitions of one run.
    ///
    /// # Panics
    /// If `other` is of another network.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!(self.layout, other.layout, "histograms of different networks");
        self.all_mut().zip(other.all()).for_each(|(mine, theirs)| mine.merge(theirs));
    }
}

/// Empty histograms of one subject.
fn empty<R, const N: usize>(of: &[Told<R>; N]) -> [Histogram; N] {
    of.map(|(quantity, _)| Histogram::new(quantity.limit, quantity.signed))
}
/// The histogram of the quantity `name` among those of one subject.
fn named<'a, R, const N: usize>(all: &'a [Histogram; N], of: &[Told<R>; N], name: &str) -> Option<&'a Histogram> {
    all.iter().zip(of).find(|(_, (quantity, _))| quantity.name == name).map(|(histogram, _)| histogram)
}
/// Records what a row tells of one subject.
#[inline]
fn record<R, const N: usize>(all: &mut [Histogram; N], of: &[Told<R>; N], row: &R) {
    for (histogram, (_, of)) in all.iter_mut().zip(of) {
        if let Some(value) = of(row) {
            histogram.record(value);
        }
    }
}

impl Sink for Histograms {
    #[inline]
    fn cycle(&mut self, row: &CycleRow) {
        record(&mut self.network, &OF_NETWORK, row);
        if let Some(ring) = &mut self.ring {
            record(ring, &OF_RING, row);
        }
    }
    #[inline]
    fn slave(&mut self, row: &SlaveRow) {
        if let Some(index) = self.layout.slave(row.slave) {
            record(&mut self.slaves[index], &OF_SLAVE, row);
        }
    }
    fn link(&mut self, row: &LinkRow) {
        if let Some(index) = self.layout.link(row.publisher, row.subscriber) {
            record(&mut self.links[index], &OF_LINK, row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::MasterClass;
    use crate::study::layout::{MasterLayout, SlaveLayout};
    use crate::study::sample;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn ticks(n: i64) -> Span {
        Span::from_ticks(n)
    }
    fn filled(values: &[i64]) -> Histogram {
        let mut histogram = Histogram::new(Span::from_ms(10), true);
        for &value in values {
            histogram.record(ticks(value));
        }
        histogram
    }
    /// The exact value of a percentile, by sorting.
    fn exact(sorted: &[i64], thousandths: usize) -> i64 {
        sorted[(thousandths * sorted.len()).div_ceil(100_000).max(1) - 1]
    }

    #[test]
    fn an_empty_histogram_says_nothing() {
        let histogram = filled(&[]);
        assert_eq!((histogram.count(), histogram.min(), histogram.max(), histogram.mean()), (0, None, None, None));
        assert_eq!((histogram.percentile(50.0), histogram.magnitude_percentile(50.0)), (None, None));
        assert!(histogram.bins(10).is_empty() && histogram.farthest().is_none());
    }

    #[test]
    fn signs_are_kept_and_small_values_are_exact() {
        let histogram = filled(&[-2_047, -3, -1, 0, 1, 2, 2_000]);
        let percentiles =
            [0.0, 14.0, 28.0, 42.0, 57.0, 71.0, 85.0, 100.0].map(|p| histogram.percentile(p).unwrap().ticks());
        assert_eq!(percentiles, [-2_047, -2_047, -3, -1, 0, 1, 2, 2_000]);
        assert_eq!((histogram.min(), histogram.max()), (Some(ticks(-2_047)), Some(ticks(2_000))));
        assert_eq!(histogram.mean(), Some(ticks(-7))); // -48 / 7 = -6.86
        assert_eq!(histogram.farthest(), Some(ticks(-2_047)));
        let magnitudes =
            [1.0, 28.0, 42.0, 57.0, 71.0, 85.0, 100.0].map(|p| histogram.magnitude_percentile(p).unwrap().ticks());
        assert_eq!(magnitudes, [0, 1, 1, 2, 3, 2_000, 2_047]);
    }

    #[test]
    fn what_lies_out_of_range_is_counted_and_never_lost() {
        let mut histogram = Histogram::new(ticks(1_000), false);
        for value in [-5, 10, 20, 1_000_000] {
            histogram.record(ticks(value));
        }
        assert_eq!((histogram.count(), histogram.below(), histogram.above()), (4, 1, 1));
        let percentiles = [25.0, 50.0, 75.0, 100.0].map(|p| histogram.percentile(p).unwrap().ticks());
        assert_eq!(percentiles, [-5, 10, 20, 1_000_000]);
        assert_eq!(histogram.mean(), Some(ticks(250_006)));
        assert_eq!(histogram.bins(5).iter().map(|bin| bin.count).sum::<u64>(), 2);
    }

    #[test]
    fn bins_are_linear_and_hold_everything_in_range() {
        let histogram = filled(&[-100, -100, -1, 0, 99]);
        let bins = histogram.bins(4);
        assert_eq!(bins.iter().map(|bin| bin.count).collect::<Vec<_>>(), [2, 1, 1, 1]);
        assert_eq!((bins[0].from, bins[0].to, bins[1].from), (ticks(-100), ticks(-50), ticks(-50)));
        assert_eq!(filled(&[7]).bins(10), [Bin { from: ticks(7), to: ticks(8), count: 1 }]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn percentiles_agree_with_sorting(
            values in prop::collection::vec(prop_oneof![-3_000i64..3_000, -100_000_000i64..100_000_000], 1..400),
            thousandths in 0usize..=100_000,
        ) {
            let histogram = filled(&values);
            let mut sorted = values.clone();
            sorted.sort_unstable();
            let magnitudes = { let mut m: Vec<_> = values.iter().map(|v| v.abs()).collect(); m.sort_unstable(); m };
            let percent = thousandths as f64 / 1_000.0;
            let pairs = [
                (exact(&sorted, thousandths), histogram.percentile(percent).unwrap().ticks()),
                (exact(&magnitudes, thousandths), histogram.magnitude_percentile(percent).unwrap().ticks()),
            ];
            for (exact, told) in pairs {
                prop_assert!((told - exact).abs() * 1_000 <= exact.abs(), "{told} for {exact}");
            }
            prop_assert_eq!(histogram.min().unwrap().ticks(), sorted[0]);
            prop_assert_eq!(histogram.max().unwrap().ticks(), sorted[sorted.len() - 1]);
            let mean = values.iter().map(|&v| v as f64).sum::<f64>() / values.len() as f64;
            prop_assert!((histogram.mean().unwrap().ticks() as f64 - mean).abs() <= 0.5 + 1e-6);
            prop_assert_eq!(histogram.bins(20).iter().map(|bin| bin.count).sum::<u64>(), values.len() as u64);
            prop_assert!(histogram.bins(20).len() <= 20);
        }

        #[test]
        fn merged_is_recorded_together(
            a in prop::collection::vec(-200_000_000i64..200_000_000, 0..100),
            b in prop::collection::vec(-200_000_000i64..200_000_000, 1..100),
        ) {
            let mut merged = filled(&a);
            merged.merge(&filled(&b));
            let together = filled(&[a, b].concat());
            prop_assert_eq!(merged.count(), together.count());
            prop_assert_eq!((merged.below(), merged.above()), (together.below(), together.above()));
            prop_assert_eq!((merged.min(), merged.max(), merged.mean()), (together.min(), together.max(), together.mean()));
            prop_assert_eq!(merged.percentile(37.5), together.percentile(37.5));
        }
    }

    #[test]
    fn every_measured_span_of_a_row_has_a_line() {
        // Destructured in full: a new field of a row does not compile here until someone decides whether it is measured.
        let CycleRow {
            cycle: _,
            t0: _,
            gc_jitter,
            synch_delay,
            t_dp: _,
            t_dp_deviation,
            t_dx,
            latch_skew,
            skew_counts: _,
            retries: _,
            acyclic: _,
            spare,
        } = sample::cycle(1);
        let SlaveRow {
            cycle: _,
            t0: _,
            slave: _,
            state: _,
            phase: _,
            pll: _,
            leds: _,
            pll_error,
            period: _,
            window: _,
            latch_offset,
            mls: _,
            sls: _,
            life_counter: _,
            clock_counter: _,
            g1_zsw: _,
            xist1: _,
            xist2: _,
        } = sample::slave(1, 3);
        let LinkRow { cycle: _, publisher: _, subscriber: _, wire, publish, age } = sample::link(1);
        let measured = [
            Some(gc_jitter),
            synch_delay,
            t_dp_deviation,
            t_dx,
            latch_skew,
            spare,
            pll_error,
            latch_offset,
            Some(wire),
            Some(publish),
            age,
        ];
        let recorded: BTreeSet<_> = QUANTITIES
            .iter()
            .map(|quantity| match quantity.source {
                Source::Network(of) | Source::Ring(of) => of(&sample::cycle(1)),
                Source::Slave(of) => of(&sample::slave(1, 3)),
                Source::Link(of) => of(&sample::link(1)),
            })
            .collect();
        assert_eq!(recorded, BTreeSet::from(measured), "the sample's spans are all different");
        let names: BTreeSet<_> = QUANTITIES.iter().map(|quantity| quantity.name).collect();
        assert_eq!(names.len(), QUANTITIES.len());
    }

    #[test]
    fn a_master_alone_has_no_delay_by_the_token() {
        let a = |n| Address::new(n).unwrap();
        let delays = |layout: &Layout| {
            let mut histograms = Histograms::new(layout);
            (0..3).for_each(|cycle| histograms.cycle(&sample::cycle(cycle)));
            histograms.cycle(&CycleRow { synch_delay: None, ..sample::cycle(3) });
            histograms.get("synch_delay", Subject::Network).map(Histogram::count)
        };
        let master = |n| MasterLayout { address: a(n), class: MasterClass::One, slaves: Vec::new() };
        assert_eq!(delays(&sample::layout()), None);
        let shared = sample::layout().with_masters(vec![master(1), master(2)]);
        assert_eq!(delays(&shared), Some(3), "only those that are late");
    }

    #[test]
    fn histograms_that_are_used_again_are_as_new() {
        let a = |n| Address::new(n).unwrap();
        let fill = |histograms: &mut Histograms| {
            histograms.cycle(&sample::cycle(1));
            histograms.slave(&sample::slave(1, 3));
            histograms.link(&sample::link(1));
        };
        let figures = |histograms: &Histograms| -> Vec<_> {
            let told = |(quantity, subject, found): (&Quantity, _, &Histogram)| {
                let p50 = (found.percentile(50.0), found.magnitude_percentile(50.0));
                (quantity.name, subject, found.count(), found.min(), found.mean(), p50)
            };
            histograms.iter().map(told).collect()
        };
        let slave = |n| SlaveLayout { address: a(n), t_i: Span::from_us(125), encoder: true };
        let master = |n| MasterLayout { address: a(n), class: MasterClass::One, slaves: Vec::new() };
        let shared = sample::layout().with_masters(vec![master(1), master(2)]);
        let more = Layout::new(a(1), Span::from_ms(2), (3..9).map(slave).collect(), vec![(a(3), a(5)), (a(5), a(3))]);
        let less = Layout::new(a(1), Span::from_ms(2), vec![slave(3)], Vec::new());
        let mut used = Histograms::new(&sample::layout());
        for layout in [sample::layout(), more, less, shared, sample::layout()] {
            fill(&mut used);
            used.reset(&layout);
            let mut new = Histograms::new(&layout);
            assert_eq!(used.layout(), new.layout());
            assert_eq!(figures(&used), figures(&new));
            fill(&mut used);
            fill(&mut new);
            assert_eq!(figures(&used), figures(&new));
        }
        let mut far = filled(&[-3, 7, 2_000_000_000, -2_000_000_000]);
        far.reset();
        assert_eq!((far.count(), far.below(), far.above(), far.max(), far.mean()), (0, 0, 0, None, None));
    }

    #[test]
    fn rows_arrive_at_the_histogram_of_their_subject() {
        let layout = sample::layout();
        let mut histograms = Histograms::new(&layout);
        histograms.cycle(&sample::cycle(1));
        histograms.slave(&sample::slave(1, 5));
        histograms.link(&sample::link(1));
        let a = |n| Address::new(n).unwrap();
        let count = |name, subject| histograms.get(name, subject).map(Histogram::count);
        assert_eq!(count("latch_skew", Subject::Network), Some(1));
        assert_eq!(count("pll_error", Subject::Slave(a(3))), Some(0));
        assert_eq!(count("pll_error", Subject::Slave(a(5))), Some(1));
        assert_eq!(count("age", Subject::Link(a(3), a(5))), Some(1));
        assert_eq!((count("age", Subject::Network), count("nothing", Subject::Network)), (None, None));
        assert_eq!(histograms.iter().count(), 5 + 2 * 2 + 3);
        let mut twice = histograms.clone();
        twice.merge(&histograms);
        assert_eq!(twice.get("wire", Subject::Link(a(3), a(5))).map(Histogram::count), Some(2));
        let stranger = SlaveLayout { address: a(9), t_i: Span::from_us(125), encoder: true };
        assert_eq!(
            Quantity::named("age").unwrap().subjects(&Layout::new(a(1), Span::from_ms(1), vec![stranger], vec![])),
            []
        );
    }
}
