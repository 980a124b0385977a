//! Pool: the values of many runs as one distribution, exact in every count.
//!
//! What is kept are integers: an [`Aggregate`] with the places of the extremes, and [`Bins`]. So pools of parts merge to
//! the same bits in any order and grouping. Values of one run are no independent draws; a pool tells what was seen, and no
//! bounds.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::aggregate::{Aggregate, Place};
use super::bins::{Bins, Counted};

/// All values of a quantity.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(try_from = "Written")]
pub struct Pool {
    values: Aggregate,
    bins: Bins,
}

impl Pool {
    /// Takes one value in.
    ///
    /// # Panics
    /// If there are 2^64 values.
    pub fn add(&mut self, value: i64, at: Place) {
        self.values.add(value, at);
        self.bins.add(value);
    }
    /// Takes in all that `other` did.
    ///
    /// # Panics
    /// If there are 2^64 values.
    pub fn merge(&mut self, other: &Self) {
        self.values.merge(&other.values);
        self.bins.merge(&other.bins);
    }
    /// Count, mean, deviation and the extremes with their places.
    pub const fn values(&self) -> &Aggregate {
        &self.values
    }
    /// The bins that hold something, ascending.
    pub fn bins(&self) -> impl Iterator<Item = Counted> {
        self.bins.iter()
    }
    /// The value that so many `millionths` of all values do not exceed, to three significant digits: the middle of the bin
    /// that holds the one of rank ceil(millionths / 10^6 x count), at least 1; none without a value.
    pub fn quantile(&self, millionths: u32) -> Option<i64> {
        let (min, max) = (self.values.min()?.value, self.values.max()?.value);
        let rank = (u128::from(millionths) * u128::from(self.values.count())).div_ceil(1_000_000).max(1);
        let mut below = 0;
        let found = self.bins().find(|bin| {
            below += u128::from(bin.count);
            below >= rank
        });
        found.map(|bin| bin.middle().clamp(min, max))
    }
    /// The magnitudes that are exceeded, ascending, each with how many values do: the upper ends of the bins, whatever the
    /// sign. The last one is the largest magnitude, which none exceeds.
    pub fn exceeded(&self) -> Vec<(u64, u64)> {
        let mut all = BTreeMap::new();
        for bin in self.bins() {
            *all.entry(bin.low.unsigned_abs().max(bin.high.unsigned_abs())).or_insert(0) += bin.count;
        }
        let ends = [self.values.min(), self.values.max()].into_iter().flatten();
        let most = ends.map(|extreme| extreme.value.unsigned_abs()).max().unwrap_or(0);
        let mut above = self.values.count();
        let told = all.into_iter().map(|(magnitude, count)| {
            above -= count;
            (magnitude.min(most), above)
        });
        told.collect()
    }
}

/// A pool as it was written, not yet believed.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    values: Aggregate,
    bins: Bins,
}

/// A distribution that is not that of its values.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the bins are not those of {0} values; the file was changed")]
pub struct PoolError(u64);

impl TryFrom<Written> for Pool {
    type Error = PoolError;
    fn try_from(Written { values, bins }: Written) -> Result<Self, PoolError> {
        let holds = |bin: Option<Counted>, value: i64| bin.is_some_and(|bin| (bin.low..=bin.high).contains(&value));
        let fits = match (values.min(), values.max()) {
            (Some(min), Some(max)) => holds(bins.iter().next(), min.value) && holds(bins.iter().last(), max.value),
            _ => true,
        };
        if fits && bins.count() == values.count() { Ok(Self { values, bins }) } else { Err(PoolError(values.count())) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::statistics::aggregate::RunKey;
    use proptest::prelude::*;

    fn of(run: u128, values: &[i64]) -> Pool {
        let mut pool = Pool::default();
        values.iter().zip(0..).for_each(|(&value, cycle)| pool.add(value, Place { run: RunKey(run), cycle }));
        pool
    }
    fn merged<'a>(parts: impl IntoIterator<Item = &'a Pool>) -> Pool {
        let mut all = Pool::default();
        parts.into_iter().for_each(|part| all.merge(part));
        all
    }
    fn values() -> impl Strategy<Value = Vec<i64>> {
        prop::collection::vec(prop_oneof![-3_000i64..3_000, -100_000_000i64..100_000_000], 0..60)
    }

    proptest! {
        #[test]
        fn parts_merge_to_the_same_in_any_order_and_grouping(a in values(), b in values(), c in values()) {
            let [a, b, c] = [of(1, &a), of(2, &b), of(3, &c)];
            let all = merged([&a, &b, &c]);
            prop_assert_eq!(&merged([&c, &a, &b]), &all);
            prop_assert_eq!(&merged([&a, &merged([&b, &c])]), &all);
            let text = serde_json::to_string(&all).unwrap();
            prop_assert_eq!(serde_json::from_str::<Pool>(&text).unwrap(), all);
        }

        #[test]
        fn quantiles_are_those_of_sorted_values(mut all in values(), millionths in 0u32..=1_000_000) {
            let pool = of(7, &all);
            all.sort_unstable();
            let rank = (millionths as usize * all.len()).div_ceil(1_000_000).max(1);
            let exact = all.get(rank - 1).copied();
            let told = pool.quantile(millionths);
            prop_assert_eq!(told.is_some(), exact.is_some());
            if let (Some(told), Some(exact)) = (told, exact) {
                prop_assert!((told - exact).abs() * 1_000 <= exact.abs(), "{told} for {exact}");
            }
        }

        #[test]
        fn what_is_exceeded_is_counted(all in values()) {
            for (magnitude, above) in of(7, &all).exceeded() {
                // Values of one bin are not told apart: those up to its end do not exceed it.
                let exact = all.iter().filter(|value| value.unsigned_abs() > magnitude).count();
                prop_assert_eq!(above, exact as u64, "{}", magnitude);
            }
        }
    }

    #[test]
    fn the_last_magnitude_is_exceeded_by_none() {
        assert_eq!(of(1, &[-5, 3, 3, 1]).exceeded(), [(1, 3), (3, 1), (5, 0)]);
        // 1 000 000 shares a bin with 999 999 and others; the largest is told exactly.
        assert_eq!(of(1, &[1_000_000]).exceeded(), [(1_000_000, 0)]);
        assert_eq!(of(1, &[]).exceeded(), []);
    }

    #[test]
    fn text_of_another_distribution_is_refused() {
        let good = serde_json::to_string(&of(1, &[1, 5])).unwrap();
        for (from, to) in [("\"5\":1", "\"6\":1"), ("\"5\":1", "\"5\":2"), ("\"1\":1", "\"0\":1")] {
            let bad = good.replace(from, to);
            assert_ne!(bad, good);
            let error = serde_json::from_str::<Pool>(&bad).unwrap_err();
            assert!(error.to_string().contains("the file was changed"), "{to}: {error}");
        }
    }
}
