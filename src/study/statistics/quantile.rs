//! Quantile: the value that a share of all values does not exceed, with bounds that hold for any distribution.
//!
//! The bounds are values that were seen: of the i-th smallest of n it is known, by the binomial distribution alone, how
//! often it is below or above the quantile (David and Nagaraja, "Order statistics", 7.1). So they need independent
//! values, and enough of them: of 100 values none bounds the 99 % quantile from above.

use super::beta::{Share, binomial_cdf};
use super::bins::Counted;
use super::confidence::Confidence;

/// A quantile and its bounds, in the unit of the values; no bound where the values are too few for one.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct QuantileInterval<V> {
    /// The estimate.
    pub estimate: V,
    /// A value that is not above the quantile.
    pub low: Option<V>,
    /// A value that is not below it.
    pub high: Option<V>,
}

/// Which of `count` ascending values, the first being 1, are the quantile and its bounds.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Ranks {
    /// The value that estimates it: ceil(percent / 100 x count), at least 1.
    pub estimate: u64,
    /// The largest that bounds it from below.
    pub low: Option<u64>,
    /// The smallest that bounds it from above.
    pub high: Option<u64>,
}

impl Ranks {
    /// The ranks for the value that `percent` of all do not exceed; none without a value.
    ///
    /// `percent` is brought into 0 ..= 100 and rounded to thousandths, as in
    /// [`Histogram::percentile`](crate::study::histogram::Histogram::percentile).
    pub fn new(count: u64, percent: f64, confidence: Confidence) -> Option<Self> {
        const WHOLE: u32 = 100_000;
        let thousandths = (percent.clamp(0.0, 100.0) * 1_000.0).round() as u32;
        let whole = f64::from(WHOLE);
        let p = Share { x: f64::from(thousandths) / whole, rest: f64::from(WHOLE - thousandths) / whole };
        // Below this many of `count` values are at most the quantile in no more than `tail` of all cases.
        let fewest = |p: Share| {
            let tail = confidence.tail();
            last(count, |fewer| fewer == 0 || binomial_cdf(fewer - 1, count, p) <= tail)
        };
        let estimate = (u128::from(thousandths) * u128::from(count)).div_ceil(u128::from(WHOLE)) as u64;
        let (low, above) = (fewest(p), fewest(p.turned()));
        (count > 0).then_some(Self {
            estimate: estimate.max(1),
            low: (low > 0).then_some(low),
            high: (above > 0).then(|| count + 1 - above),
        })
    }
    /// The same for `count` values of which neighbours are alike, so that all of them tell as much as `worth` independent
    /// ones: each of these stands for as many of the others.
    pub fn of_dependent(count: u64, worth: u64, percent: f64, confidence: Confidence) -> Option<Self> {
        let worth = worth.clamp(1, count.max(1));
        let Self { low, high, .. } = Self::new(worth, percent, confidence)?;
        let of_all = |rank: u64, round: u128| {
            let rank = (u128::from(rank) * u128::from(count) + round) / u128::from(worth);
            rank as u64
        };
        Some(Self {
            // The first of those that this one stands for.
            low: low.map(|low| of_all(low - 1, 0) + 1),
            // The last of them.
            high: high.map(|high| of_all(high, u128::from(worth) - 1)),
            ..Self::new(count, percent, confidence)?
        })
    }
}

/// The largest number up to `end` for which `so` is, if it is for 0 and never again once it is not.
fn last(end: u64, so: impl Fn(u64) -> bool) -> u64 {
    let (mut low, mut high) = (0, end);
    while low < high {
        let middle = high - (high - low) / 2;
        if so(middle) { low = middle } else { high = middle - 1 }
    }
    low
}

/// The quantile of values in bins in ascending order, which hold as many values as `ranks` are of; `estimate` is the value
/// that stands for a bin.
///
/// # Panics
/// If they hold less.
pub(in crate::study) fn of_counted(
    bins: &[Counted],
    ranks: &Ranks,
    estimate: impl Fn(Counted) -> i64,
) -> QuantileInterval<i64> {
    let at = |rank: u64| {
        let mut left = rank;
        let found = bins.iter().find(|bin| {
            let here = left <= bin.count;
            left = left.saturating_sub(bin.count);
            here
        });
        *found.expect("a rank is not above the count")
    };
    QuantileInterval {
        estimate: estimate(at(ranks.estimate)),
        low: ranks.low.map(|rank| at(rank).low),
        high: ranks.high.map(|rank| at(rank).high),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::histogram::Histogram;
    use crate::time::Span;

    fn ranks(count: u64, percent: f64) -> Ranks {
        Ranks::new(count, percent, Confidence::USUAL).unwrap()
    }

    #[test]
    fn ranks_are_those_of_the_tables() {
        // The median of n at 95 %: Conover's table of the sign test.
        for (count, low, high) in [(6, 1, 6), (10, 2, 9), (20, 6, 15), (25, 8, 18), (100, 40, 61)] {
            let found = ranks(count, 50.0);
            assert_eq!((found.low, found.high), (Some(low), Some(high)), "{count}");
        }
        assert_eq!((ranks(5, 50.0).low, ranks(5, 50.0).high), (None, None));
    }

    #[test]
    fn few_values_bound_no_far_quantile() {
        // 0.99^367 is 2.501 %, 0.99^368 is 2.476 %: how often none of so many is above the quantile.
        assert_eq!(ranks(367, 99.0).high, None);
        assert_eq!(ranks(368, 99.0).high, Some(368));
        // A single value is below the 99 % quantile 99 % of the time, but below the 97 % quantile too rarely.
        assert_eq!(ranks(1, 99.0), Ranks { estimate: 1, low: Some(1), high: None });
        assert_eq!(ranks(1, 97.0).low, None);
        assert_eq!(Ranks::new(0, 50.0, Confidence::USUAL), None);
    }

    #[test]
    fn the_ends_are_the_smallest_and_the_largest_value() {
        assert_eq!(ranks(9, 0.0), Ranks { estimate: 1, low: None, high: Some(1) });
        assert_eq!(ranks(9, 100.0), Ranks { estimate: 9, low: Some(9), high: None });
        // 0.07 x 100 is above 7 in binary.
        assert_eq!(ranks(100, 7.0).estimate, 7);
    }

    #[test]
    fn dependent_values_bound_as_few_independent_ones_do() {
        for (count, worth) in [(1_000, 1_000), (1_000, 100), (997, 31), (50, 50)] {
            for percent in [50.0, 90.0] {
                let (few, all) = (ranks(worth, percent), ranks(count, percent));
                let found = Ranks::of_dependent(count, worth, percent, Confidence::USUAL).unwrap();
                assert_eq!(found.estimate, all.estimate);
                let share = |rank: u64, of: u64| rank as f64 / of as f64;
                assert!(share(few.low.unwrap(), worth) >= share(found.low.unwrap(), count), "{count} {worth}");
                assert!(found.low <= all.low && found.high.is_none_or(|high| Some(high) >= all.high && high <= count));
                assert_eq!(few.high.is_some(), found.high.is_some());
            }
        }
        // More cannot be told than there are, and of one value hardly anything.
        assert_eq!(Ranks::of_dependent(20, 100, 50.0, Confidence::USUAL), Some(ranks(20, 50.0)));
        let one = Ranks::of_dependent(1_000, 0, 50.0, Confidence::USUAL).unwrap();
        assert_eq!((one.low, one.high), (None, None));
        assert_eq!(Ranks::of_dependent(0, 10, 50.0, Confidence::USUAL), None);
    }

    #[test]
    fn bounds_are_as_narrow_as_the_confidence_allows() {
        for count in [10, 77, 1_000, 100_000] {
            for percent in [1.0, 25.0, 50.0, 90.0, 99.9] {
                let (found, p) = (ranks(count, percent), Share::new(percent / 100.0));
                let missed = |fewer| binomial_cdf(fewer, count, p);
                if let Some(low) = found.low {
                    assert!(missed(low - 1) <= 0.025 + 1e-12 && missed(low) > 0.025, "{count} {percent}");
                }
                if let Some(high) = found.high {
                    assert!(missed(high - 1) >= 0.975 - 1e-12, "{count} {percent}");
                    assert!(high == 1 || missed(high - 2) < 0.975, "{count} {percent}");
                }
            }
        }
    }

    /// The same by sorting.
    fn sorted(values: &[i64], percent: f64) -> QuantileInterval<i64> {
        let Ranks { estimate, low, high } = ranks(values.len() as u64, percent);
        let at = |rank: u64| values[rank as usize - 1];
        QuantileInterval { estimate: at(estimate), low: low.map(at), high: high.map(at) }
    }
    fn binned(histogram: &Histogram, percent: f64) -> QuantileInterval<i64> {
        of_counted(&histogram.counted(), &ranks(histogram.count(), percent), Counted::middle)
    }

    #[test]
    fn sorted_values_and_bins_agree() {
        let mut values: Vec<i64> = (0..2_000).map(|i| i * 7_919 % 4_001 - 2_000).collect();
        let mut histogram = Histogram::new(Span::from_ms(1), true);
        for &value in &values {
            histogram.record(Span::from_ticks(value));
        }
        values.sort_unstable();
        for percent in [0.0, 0.1, 5.0, 50.0, 99.0, 100.0] {
            assert_eq!(binned(&histogram, percent), sorted(&values, percent), "{percent}");
        }
    }

    #[test]
    fn bounds_of_shared_bins_are_their_far_ends() {
        // Values 1 000 000 .. 1 000 999, in bins of 512 ticks; 20 of them beyond the histogram's limit.
        let mut histogram = Histogram::new(Span::from_ticks(1_000_979), false);
        let values: Vec<i64> = (1_000_000..1_001_000).collect();
        for &value in &values {
            histogram.record(Span::from_ticks(value));
        }
        for percent in [10.0, 50.0, 90.0] {
            let (exact, found) = (sorted(&values, percent), binned(&histogram, percent));
            assert!(found.low <= exact.low && found.low.unwrap() > exact.low.unwrap() - 1_024, "{found:?}");
            assert!(found.high >= exact.high && found.high.unwrap() < exact.high.unwrap() + 1_024, "{found:?}");
        }
        assert_eq!(binned(&histogram, 99.0).high, Some(1_000_999), "beyond the limit only the end is known");
    }
}
