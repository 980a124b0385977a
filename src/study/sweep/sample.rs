//! Sample: what the repetitions of one combination tell of one figure.
//!
//! Values are added up as whole grains ([`Value::grains`]), so that what comes of them does not depend on their order, and
//! are sorted outside memory where they are many.

use std::collections::BTreeMap;
use std::io;

use super::ascending::Unsorted;
use super::key::RunKey;
use crate::study::figure::{Figure, Unit, Value};
use crate::study::statistics::aggregate::{Aggregate, Extreme, Place};
use crate::study::statistics::confidence::Confidence;
use crate::study::statistics::interval::Interval;
use crate::study::statistics::probability::Probability;
use crate::study::statistics::quantile::Ranks;

/// What a sample knows the percentiles of.
const PERCENTS: [f64; 2] = [50.0, 90.0];
/// Most points of an outline, besides the smallest and the largest value.
const POINTS: u64 = 1_000;

/// Count, mean and extremes of the values of one figure.
#[derive(Clone, Debug)]
pub(super) struct Moments<'a> {
    figure: &'a Figure,
    confidence: Confidence,
    all: Aggregate,
    /// Values above 0, or true.
    seen: u64,
}

impl<'a> Moments<'a> {
    /// Those of no value.
    pub(super) fn new(figure: &'a Figure, confidence: Confidence) -> Self {
        Self { figure, confidence, all: Aggregate::default(), seen: 0 }
    }
    /// Takes the value that a run had.
    pub(super) fn add(&mut self, value: Value, run: RunKey) {
        let grains = value.grains();
        self.all.add(grains, Place { run, cycle: 0 });
        self.seen += u64::from(grains > 0);
    }
    /// How many values there are.
    pub(super) const fn count(&self) -> u64 {
        self.all.count()
    }
    /// The mean in the unit of the figure; none without a value.
    pub(super) fn mean(&self) -> Option<f64> {
        self.all.mean().map(|mean| self.figure.unit().of_grains(mean))
    }
    /// The mean and its bounds; none of less than two values that are not true or false.
    pub(super) fn interval(&self) -> Option<Interval> {
        let unit = self.figure.unit();
        if unit == Unit::Truth {
            let (low, high) = self.seen().bounds();
            return Some(Interval { estimate: self.mean()?, low, high });
        }
        let Interval { estimate, low, high } = self.all.mean_interval(self.confidence)?;
        let [estimate, low, high] = [estimate, low, high].map(|grains| unit.of_grains(grains));
        Some(Interval { estimate, low, high })
    }
    /// How likely it is to be above 0, or true.
    pub(super) fn seen(&self) -> Probability {
        Probability::of(self.seen, self.count(), self.confidence)
    }
}

/// Values on their way to a [`Sample`].
#[derive(Debug)]
pub(super) struct Gathering<'a> {
    moments: Moments<'a>,
    values: Unsorted,
}

impl<'a> Gathering<'a> {
    /// No value yet.
    pub(super) fn new(figure: &'a Figure, confidence: Confidence) -> Self {
        Self { moments: Moments::new(figure, confidence), values: Unsorted::default() }
    }
    /// Takes the value that a run had.
    ///
    /// # Errors
    /// A temporary file cannot be written.
    pub(super) fn add(&mut self, value: Value, run: RunKey) -> io::Result<()> {
        self.moments.add(value, run);
        self.values.push(value.grains())
    }
    /// The sample of all values, with the outline of their distribution if it is wanted.
    ///
    /// # Errors
    /// A temporary file cannot be read.
    pub(super) fn finish(self, outline: bool) -> io::Result<Sample<'a>> {
        let Self { moments, values } = self;
        let count = moments.count();
        let all = PERCENTS.into_iter().filter_map(|percent| Ranks::new(count, percent, moments.confidence));
        let mut ranked: BTreeMap<u64, i64> = all
            .flat_map(|ranks| [Some(ranks.estimate), ranks.low, ranks.high])
            .flatten()
            .map(|rank| (rank, 0))
            .collect();
        let mut outlined = Vec::new();
        let points = POINTS.min(count);
        for (rank, value) in (1..).zip(values.ascending()?) {
            let value = value?;
            ranked.entry(rank).and_modify(|ranked| *ranked = value);
            // The first one of every part of the points, and the last of all.
            let is_point = rank == 1 || rank == count || rank * points / count > (rank - 1) * points / count;
            if outline && is_point {
                let number = moments.figure.unit().of_grains(value as f64);
                outlined.push((number, rank as f64 / count as f64));
            }
        }
        Ok(Sample { moments, ranked, outline: outlined })
    }
}

/// The values of one figure in the repetitions of one combination.
#[derive(Clone, Debug)]
pub(super) struct Sample<'a> {
    pub(super) moments: Moments<'a>,
    /// The values of some ranks, the smallest value's being 1 \[grains\].
    ranked: BTreeMap<u64, i64>,
    /// Values in the unit of the figure, ascending, each with the share of all that does not exceed it.
    pub(super) outline: Vec<(f64, f64)>,
}

impl<'a> Sample<'a> {
    /// Whose values these are.
    pub(super) const fn figure(&self) -> &'a Figure {
        self.moments.figure
    }
    /// The smallest value and the first run that had it.
    pub(super) fn min(&self) -> Option<(Value, RunKey)> {
        self.extreme(self.moments.all.min())
    }
    /// The largest value and the first run that had it.
    pub(super) fn max(&self) -> Option<(Value, RunKey)> {
        self.extreme(self.moments.all.max())
    }
    /// What `percent` of all runs do not exceed: the value of the rank that `of` says.
    ///
    /// `percent` is one of those that a sample knows.
    pub(super) fn percentile(&self, percent: f64, of: impl Fn(Ranks) -> Option<u64>) -> Option<Value> {
        let ranks = Ranks::new(self.moments.count(), percent, self.moments.confidence)?;
        self.ranked.get(&of(ranks)?).map(|&grains| self.value(grains))
    }
    fn extreme(&self, extreme: Option<Extreme>) -> Option<(Value, RunKey)> {
        extreme.map(|extreme| (self.value(extreme.value), extreme.at.run))
    }
    fn value(&self, grains: i64) -> Value {
        Value::of_grains(self.moments.figure.unit(), grains)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outline(values: impl Iterator<Item = u64>) -> Vec<(f64, f64)> {
        let figure = Figure::named("faults").unwrap();
        let mut gathering = Gathering::new(&figure, Confidence::USUAL);
        values.for_each(|value| gathering.add(Value::Count(value), RunKey(value.into())).unwrap());
        gathering.finish(true).unwrap().outline
    }

    #[test]
    fn an_outline_has_every_value_where_they_are_few() {
        assert_eq!(outline([7, 3, 3, 5].into_iter()), [(3.0, 0.25), (3.0, 0.5), (5.0, 0.75), (7.0, 1.0)]);
        assert_eq!(outline(std::iter::empty()), []);
        assert_eq!(outline(0..POINTS).len() as u64, POINTS);
    }

    #[test]
    fn an_outline_of_many_values_keeps_its_ends_and_is_true_in_between() {
        let count = 50 * POINTS + 17;
        let points = outline((0..count).rev());
        assert!((POINTS..=POINTS + 2).contains(&(points.len() as u64)), "{}", points.len());
        let exact = |value: f64| (value + 1.0) / count as f64;
        assert!(points.iter().all(|&(value, share)| (share - exact(value)).abs() < 1e-12));
        assert_eq!((points[0].0, points.last().unwrap().0), (0.0, (count - 1) as f64));
        assert!(points.windows(2).all(|pair| pair[1].1 - pair[0].1 <= 1.03 / POINTS as f64));
    }
}
