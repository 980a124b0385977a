//! Values of a quantity in steady state: mean and percentiles with their bounds.

use super::{CONFIDENCE, FINE, Stream};
use crate::study::histogram::Histogram;
use crate::study::statistics::batch_means::StreamMean;
use crate::study::statistics::bins::Counted;
use crate::study::statistics::quantile::{QuantileInterval, Ranks, of_counted};
use crate::time::Span;

/// A quantity's values in steady state.
#[derive(Clone, PartialEq, Debug)]
pub struct Values {
    /// In bins, ascending \[ticks\].
    bins: Vec<Counted>,
    count: u64,
    sum: i128,
    /// The mean of the batches \[ticks / 1024\] with its bounds.
    mean: Option<StreamMean>,
    /// As many independent values as these are worth; none if too few batches tell.
    worth: Option<u64>,
}

/// A number with its bounds; no bound where the values are too few for one.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Bounded {
    /// The estimate.
    pub estimate: Span,
    /// Lower bound.
    pub low: Option<Span>,
    /// Upper bound.
    pub high: Option<Span>,
}

impl Values {
    pub(super) fn of(stream: &Stream, histogram: &Histogram) -> Self {
        let bins = less(histogram.counted(), &stream.before);
        let (count, sum) = (histogram.count() - stream.first.1, histogram.sum() - stream.first.0);
        let mean = stream.batches.interval(CONFIDENCE);
        let mut values = Self { bins, count, sum, mean, worth: None };
        values.worth = mean.and_then(|mean| values.worth(&mean));
        values
    }
    /// How many there are.
    pub const fn count(&self) -> u64 {
        self.count
    }
    /// Whether batches of the run's length are alike, so that the bounds are too narrow; false without batches.
    pub fn is_correlated(&self) -> bool {
        self.mean.is_some_and(|mean| mean.correlated)
    }
    /// The mean; none without a value.
    pub fn mean(&self) -> Option<Bounded> {
        let ticks = |ticks: f64| Span::from_ticks(libm::round(ticks) as i64);
        let mean = (self.count > 0).then(|| self.sum as f64 / self.count as f64)?;
        let half = self.mean.map(|mean| mean.interval.half_width() / FINE as f64);
        let [low, high] = [-1.0, 1.0].map(|side| half.map(|half| ticks(mean + side * half)));
        Some(Bounded { estimate: ticks(mean), low, high })
    }
    /// What `percent` of all values do not exceed; none without a value.
    pub fn percentile(&self, percent: f64) -> Option<Bounded> {
        self.quantile(&self.bins, percent)
    }
    /// The same of the magnitudes.
    pub fn magnitude_percentile(&self, percent: f64) -> Option<Bounded> {
        let magnitude = |bin: &Counted| {
            let ends = (bin.low.saturating_abs(), bin.high.saturating_abs());
            Counted { low: ends.0.min(ends.1), high: ends.0.max(ends.1), count: bin.count }
        };
        let mut bins: Vec<_> = self.bins.iter().map(magnitude).collect();
        bins.sort_unstable_by_key(|bin| bin.low);
        self.quantile(&bins, percent)
    }

    /// The same as if no cycle were like its neighbour.
    #[cfg(test)]
    pub(super) fn as_independent(&self) -> Self {
        Self { worth: Some(self.count), ..self.clone() }
    }
    fn quantile(&self, bins: &[Counted], percent: f64) -> Option<Bounded> {
        let ranks = Ranks::of_dependent(self.count, self.worth.unwrap_or(self.count), percent, CONFIDENCE)?;
        let QuantileInterval { estimate, low, high } = of_counted(bins, &ranks, Counted::middle);
        let [low, high] = [low, high].map(|bound| bound.filter(|_| self.worth.is_some()).map(Span::from_ticks));
        Some(Bounded { estimate: Span::from_ticks(estimate), low, high })
    }
    /// The variance of the values by that of their mean, as the batches tell it.
    fn worth(&self, mean: &StreamMean) -> Option<u64> {
        let center = self.sum as f64 / self.count as f64;
        let square = |bin: &Counted| {
            let off = bin.middle() as f64 - center;
            off * off * bin.count as f64
        };
        let spread = self.bins.iter().map(square).sum::<f64>() / self.count as f64;
        let error = mean.error / FINE as f64;
        let worth = if error > 0.0 { spread / (error * error) } else { self.count as f64 };
        // Even if all values of a batch were the same one, there are as many as batches.
        (self.count > 0).then(|| (worth as u64).clamp(mean.batches as u64, self.count.max(mean.batches as u64)))
    }
}

/// `all` less what was there `before`: each bin of before lies within one of all, whose ends may be farther out.
fn less(all: Vec<Counted>, before: &[Counted]) -> Vec<Counted> {
    let mut gone = before.iter().peekable();
    let left = all.into_iter().map(|mut bin| {
        while let Some(of_before) = gone.next_if(|of_before| of_before.high <= bin.high) {
            bin.count -= of_before.count;
        }
        bin
    });
    left.filter(|bin| bin.count > 0).collect()
}
