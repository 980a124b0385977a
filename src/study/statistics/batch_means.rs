//! Batch means: the mean of values that follow each other, with bounds that hold although neighbours are alike.
//!
//! Cycle after cycle, a slave's error depends on the one before; an interval that takes the values for independent is too
//! narrow. Means of long batches hardly depend on each other. So a stream is kept as sums of batches; when there are
//! [`FINE`] of them, two and two become one and batches are twice as long from then on: bounded memory, exact integers,
//! and half of [`FINE`] batches at least.
//!
//! The interval takes [`COARSE`] to 2 [`COARSE`] - 1 longer batches made of these, and Student's t. More would hardly make
//! it narrower, fewer would make it wider (Schmeiser, "Batch size effects in the analysis of simulation output", 1982).
//! Whether they are long enough is told by the correlation of neighbours among the finer batches, where there are enough
//! to see it.

use super::confidence::Confidence;
use super::interval::Interval;
use super::normal::normal_quantile;
use super::student::student_quantile;

/// Number of batches at which two and two become one.
pub const FINE: usize = 256;
/// Least number of batches that an interval is made of, where there are as many values.
pub const COARSE: usize = 16;
/// Model: probability of calling batches correlated that are not, 1 %.
const FALSE_ALARM: f64 = 0.01;
/// Correlations of neighbouring fine batches up to which 1, 2, 4, 8 of them joined are long enough.
///
/// Model: where correlation decays exponentially, neighbours among the joined ones are correlated by 0.05 then, and the
/// interval is 5 % too narrow.
const TOLERABLE: [f64; 4] = [0.05, 0.12, 0.26, 0.40];

/// A stream of values in batches.
#[derive(Clone, Debug)]
pub struct BatchMeans {
    /// Sums of the batches that are complete, [`FINE`] at most.
    sums: Vec<i128>,
    /// Values in each.
    length: u64,
    /// Sum and number of the values that make no batch yet.
    rest: (i128, u64),
}

/// A mean of values that follow each other.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StreamMean {
    /// The mean of all values and its bounds, in their unit.
    pub interval: Interval,
    /// Standard error of the mean.
    pub error: f64,
    /// Number of batches that the bounds were made of.
    pub batches: usize,
    /// Values in each.
    pub length: u64,
    /// Correlation of neighbours, lag 1, among the finer batches that these are made of.
    pub correlation: f64,
    /// Whether that is more than chance and too much: the run is too short and the bounds are too narrow.
    pub correlated: bool,
}

impl Default for BatchMeans {
    fn default() -> Self {
        Self::new()
    }
}

impl BatchMeans {
    /// No value yet. Allocates all that will be needed.
    pub fn new() -> Self {
        Self { sums: Vec::with_capacity(FINE), length: 1, rest: (0, 0) }
    }

    /// Takes the next value. Allocates nothing.
    pub fn push(&mut self, value: i64) {
        self.rest.0 += i128::from(value);
        self.rest.1 += 1;
        if self.rest.1 < self.length {
            return;
        }
        self.sums.push(self.rest.0);
        self.rest = (0, 0);
        if self.sums.len() == FINE {
            for pair in 0..FINE / 2 {
                self.sums[pair] = self.sums[2 * pair] + self.sums[2 * pair + 1];
            }
            self.sums.truncate(FINE / 2);
            self.length *= 2;
        }
    }

    /// How many values there were.
    pub fn count(&self) -> u64 {
        self.sums.len() as u64 * self.length + self.rest.1
    }
    /// The mean of all; none without a value.
    pub fn mean(&self) -> Option<f64> {
        let sum = self.sums.iter().sum::<i128>() + self.rest.0;
        (self.count() > 0).then(|| sum as f64 / self.count() as f64)
    }

    /// The mean of all values and its bounds; none of less than two values.
    pub fn interval(&self, confidence: Confidence) -> Option<StreamMean> {
        // A power of two, as fine batches are of values: 1, 2, 4 or 8.
        let doublings = (self.sums.len() / COARSE).max(1).ilog2() as usize;
        let join = 1 << doublings;
        let means = self.means(join);
        let (mean, count) = (self.mean()?, means.len());
        let freedom = count.checked_sub(1).filter(|&freedom| freedom > 0)? as f64;
        let error = (squares(&means) / freedom / count as f64).sqrt();
        let correlation = neighbours(&self.means(1));
        let chance = normal_quantile(FALSE_ALARM) / (self.sums.len() as f64).sqrt();
        Some(StreamMean {
            interval: Interval::around(mean, student_quantile(freedom, confidence) * error),
            error,
            batches: count,
            length: self.length * join as u64,
            correlation,
            correlated: correlation > chance.max(TOLERABLE[doublings]),
        })
    }

    /// Means of `join` batches each, less their common mean; what is left over at the end is left out.
    fn means(&self, join: usize) -> Vec<f64> {
        let used = self.sums.len() / join * join;
        let total: i128 = self.sums[..used].iter().sum();
        let groups = (used / join) as i128;
        let values = self.length as f64 * join as f64;
        let batches = self.sums[..used].chunks(join).map(|batch| batch.iter().sum::<i128>());
        // The difference is taken among integers, so that a mean far from zero costs no digits.
        batches.map(|sum| difference(sum, total, groups) / values).collect()
    }
}

/// `sum` - `total` / `groups`.
fn difference(sum: i128, total: i128, groups: i128) -> f64 {
    let (whole, part) = (total.div_euclid(groups), total.rem_euclid(groups));
    (sum - whole) as f64 - part as f64 / groups as f64
}

fn squares(means: &[f64]) -> f64 {
    means.iter().map(|mean| mean * mean).sum()
}

/// Correlation of neighbours, lag 1, of values whose mean is zero; zero if all are the same.
///
/// Corrected for both ends as von Neumann's ratio is, so that its mean is near zero for independent values.
fn neighbours(means: &[f64]) -> f64 {
    let (Some(first), Some(last), all) = (means.first(), means.last(), squares(means)) else { return 0.0 };
    if all <= 0.0 {
        return 0.0;
    }
    let products: f64 = means.windows(2).map(|pair| pair[0] * pair[1]).sum();
    (products + 0.5 * (first * first + last * last)) / all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: impl IntoIterator<Item = i64>) -> BatchMeans {
        let mut all = BatchMeans::new();
        values.into_iter().for_each(|value| all.push(value));
        all
    }

    #[test]
    fn memory_is_bounded_and_no_value_is_lost() {
        let mut all = BatchMeans::new();
        let mut sum = 0;
        for value in 0..100_000 {
            all.push(value - 7);
            sum += value - 7;
            assert!(all.sums.len() < FINE);
            assert!(all.length == 1 || all.sums.len() >= FINE / 2);
            assert_eq!(all.sums.iter().sum::<i128>() + all.rest.0, i128::from(sum));
        }
        assert_eq!((all.count(), all.mean()), (100_000, Some(49_992.5)));
        assert_eq!(all.sums.capacity(), FINE);
    }

    #[test]
    fn batches_are_the_sums_of_consecutive_values() {
        let all = of(0..1_000);
        // 1000 values: 125 would be batches of 8, so there are 250 of 4.
        assert_eq!((all.length, all.sums.len(), all.rest), (4, 250, (0, 0)));
        assert!(all.sums.iter().zip(0i128..).all(|(sum, batch)| *sum == 16 * batch + 6));
        let mean = all.interval(Confidence::USUAL).unwrap();
        assert_eq!((mean.batches, mean.length), (31, 32));
        assert!(mean.correlated && mean.correlation > 0.97, "a slope is one long correlation: {mean:?}");
    }

    #[test]
    fn few_values_are_batches_of_their_own() {
        assert_eq!(of([]).interval(Confidence::USUAL), None);
        assert_eq!((of([5]).mean(), of([5]).interval(Confidence::USUAL)), (Some(5.0), None));
        let mean = of([2, 4, 4, 4, 5, 5, 7, 9]).interval(Confidence::USUAL).unwrap();
        let half = 2.364_624_251_592_785 * (4.0f64 / 7.0).sqrt();
        assert_eq!((mean.batches, mean.length), (8, 1));
        assert!((mean.interval.half_width() - half).abs() < 1e-11 && mean.interval.holds(5.0));
        let same = of([7; 300]).interval(Confidence::USUAL).unwrap();
        assert_eq!((same.interval, same.correlated), (Interval::around(7.0, 0.0), false));
    }

    #[test]
    fn a_mean_far_from_zero_costs_no_digits() {
        let values = |far: i64| (0..4_096i64).map(move |i| far + (i * i * 7 + i * 13) % 101);
        let [near, far] = [0, 1 << 55].map(|far| of(values(far)).interval(Confidence::USUAL).unwrap());
        let spread = near.interval.half_width();
        assert!(spread > 0.1);
        // The bounds are numbers of 53 bits: they may lose up to 8 each, their making has lost nothing.
        assert!((far.interval.half_width() - spread).abs() <= 8.0);
        assert_eq!(far.correlation.to_bits(), near.correlation.to_bits());
    }

    #[test]
    fn alternating_values_are_not_called_correlated() {
        let mean = of((0..200).map(|i| i % 2)).interval(Confidence::USUAL).unwrap();
        assert!(mean.correlation < -0.9 && !mean.correlated);
    }
}
