//! Bins: how many values were how large, exact in count, to three digits in value, without bounds.
//!
//! A value stands in the bin of its eleven leading bits: every value below 2048 has its own, a larger one shares it with
//! neighbours within a thousandth, on either side of zero. Bins that hold nothing are not kept. Unlike a
//! [`Histogram`](crate::study::histogram::Histogram) they take few words for few values, and they are written as text.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::aggregate::MOST_WRITTEN;

/// Leading bits of a value that are kept.
const BITS: u32 = 11;

/// A bin: values from `low` to `high`, both included.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Counted {
    /// The smallest value that falls in.
    pub low: i64,
    /// The largest.
    pub high: i64,
    /// How many did.
    pub count: u64,
}

impl Counted {
    /// The middle, rounded down.
    pub const fn middle(self) -> i64 {
        self.low + (self.high.abs_diff(self.low) / 2) as i64
    }
}

/// Counts of values. As text: `{"-17":2,"2048":1}`, each bin by the value in it that is nearest to zero.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(try_from = "BTreeMap<i64, u64>", into = "BTreeMap<i64, u64>")]
pub struct Bins {
    counts: BTreeMap<i64, u64>,
}

/// A bin that there is not.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("no bin begins at {edge} with {count} values; the file was changed")]
pub struct BinsError {
    edge: i64,
    count: u64,
}

impl Bins {
    /// Counts one value.
    pub fn add(&mut self, value: i64) {
        self.add_to(edges(value).0, 1);
    }
    /// Adds all that `other` counted.
    ///
    /// # Panics
    /// If there are 2^64 values.
    pub fn merge(&mut self, other: &Self) {
        other.counts.iter().for_each(|(&edge, &count)| self.add_to(edge, count));
    }
    /// How many values there are.
    pub fn count(&self) -> u64 {
        self.counts.values().sum()
    }
    /// The bins that hold something, ascending.
    pub fn iter(&self) -> impl Iterator<Item = Counted> {
        self.counts.iter().map(|(&near, &count)| {
            let (near, far) = edges(near);
            Counted { low: near.min(far), high: near.max(far), count }
        })
    }
    fn add_to(&mut self, edge: i64, more: u64) {
        let count = self.counts.entry(edge).or_default();
        *count = count.checked_add(more).expect("less than 2^64 values");
    }
}

/// The values of a bin that are nearest to zero and farthest from it.
fn edges(value: i64) -> (i64, i64) {
    let magnitude = value.unsigned_abs();
    let spare = (u64::BITS - magnitude.leading_zeros()).saturating_sub(BITS);
    let near = magnitude >> spare << spare;
    let far = near | ((1 << spare) - 1);
    let signed = |magnitude: u64| {
        if value < 0 { 0i64.saturating_sub_unsigned(magnitude) } else { magnitude as i64 }
    };
    (signed(near), signed(far))
}

impl From<Bins> for BTreeMap<i64, u64> {
    fn from(bins: Bins) -> Self {
        bins.counts
    }
}
impl TryFrom<BTreeMap<i64, u64>> for Bins {
    type Error = BinsError;
    fn try_from(counts: BTreeMap<i64, u64>) -> Result<Self, BinsError> {
        let mut total = 0u64;
        for (&edge, &count) in &counts {
            let sum = total.checked_add(count).filter(|&sum| count > 0 && sum <= MOST_WRITTEN && edges(edge).0 == edge);
            total = sum.ok_or(BinsError { edge, count })?;
        }
        Ok(Self { counts })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_in_its_bin_and_no_bin_overlaps() {
        let magnitudes = [0, 1, 17, 2_047, 2_048, 2_049, 2_050, 4_095, 4_096, 123_456_789, i64::MAX - 1, i64::MAX];
        let mut bins = Bins::default();
        for value in magnitudes.into_iter().flat_map(|value| [value, -value]).chain([i64::MIN]) {
            bins.add(value);
            let (near, far) = edges(value);
            assert!(near.min(far) <= value && value <= near.max(far), "{value}");
            assert_eq!((edges(near), edges(far)), ((near, far), (near, far)), "{value}");
            let width = far.abs_diff(near);
            assert!(width == 0 || width <= near.unsigned_abs() / 1_024, "{value}");
        }
        let all: Vec<_> = bins.iter().collect();
        assert!(all.windows(2).all(|pair| pair[0].high < pair[1].low));
        assert_eq!(bins.count(), 25);
        // 2048 and 2049 share a bin, 2050 does not.
        let shared = all.iter().find(|bin| bin.low == 2_048).unwrap();
        assert_eq!((shared.high, shared.count), (2_049, 2));
    }

    #[test]
    fn text_is_exact_and_bins_that_are_none_are_refused() {
        let mut bins = Bins::default();
        for value in [-17, -17, 2_049, i64::MIN] {
            bins.add(value);
        }
        let json = serde_json::to_string(&bins).unwrap();
        assert_eq!(json, "{\"-9223372036854775808\":1,\"-17\":2,\"2048\":1}");
        assert_eq!(serde_json::from_str::<Bins>(&json).unwrap(), bins);
        for bad in ["{\"2049\":1}", "{\"5\":0}", "{\"5\":18446744073709551615,\"6\":1}", "{\"x\":1}"] {
            assert!(serde_json::from_str::<Bins>(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_middle_is_between_the_ends_and_never_overflows() {
        let middle = |low, high| Counted { low, high, count: 1 }.middle();
        let middles = [(7, 7), (-3, 4), (2_048, 2_049), (i64::MIN, i64::MAX), (i64::MAX - 1, i64::MAX)];
        assert_eq!(middles.map(|(low, high)| middle(low, high)), [7, 0, 2_048, -1, i64::MAX - 1]);
    }
}
