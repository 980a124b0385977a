//! Aggregate: what is left of any number of values, exact, in a few words.
//!
//! All is integers: count, sum, sum of squares (256 bits: 2^64 squares of the largest value fit), smallest and largest
//! with the place where they were. So aggregates of parts merge to the same bits in any order and grouping, and the
//! variance has not lost its digits to a mean far from zero. The unit is that of the values: ticks of 1/12 ns, steps,
//! counts.

use core::fmt;
use core::str::FromStr;

use ethnum::U256;
use serde::{Deserialize, Serialize};

use super::confidence::Confidence;
use super::interval::Interval;
use super::student::student_quantile;

/// Most values that a text is believed to be of: thousands of such parts merge before a count is full.
/// Model: 2^53, the largest count that other readers of JSON keep exact.
pub(super) const MOST_WRITTEN: u64 = 1 << 53;

/// What tells one run of a study from all others: a hash of all that it depends on.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct RunKey(pub u128);

/// 32 hexadecimal digits.
impl fmt::Display for RunKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

/// A text that is no run key.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{0:?} is no run key of 32 hexadecimal digits")]
pub struct RunKeyError(String);

impl FromStr for RunKey {
    type Err = RunKeyError;
    fn from_str(text: &str) -> Result<Self, RunKeyError> {
        let digits = text.len() == 32 && text.bytes().all(|octet| matches!(octet, b'0'..=b'9' | b'a'..=b'f'));
        let key = digits.then(|| u128::from_str_radix(text, 16).ok()).flatten();
        key.map(Self).ok_or_else(|| RunKeyError(text.to_owned()))
    }
}

/// Where a value was seen.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// The run.
    #[serde(with = "text")]
    pub run: RunKey,
    /// The bus cycle in it; 0 for a value of the whole run.
    pub cycle: u64,
}

/// The smallest or the largest value with its place; of equal values the first place.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extreme {
    /// The value.
    pub value: i64,
    /// Where it was seen.
    pub at: Place,
}

/// Count, sum, sum of squares, smallest and largest of integers. As text its large integers are strings.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(try_from = "Written")]
pub struct Aggregate {
    count: u64,
    #[serde(with = "text")]
    sum: i128,
    #[serde(with = "text")]
    squares: U256,
    min: Option<Extreme>,
    max: Option<Extreme>,
}

impl Aggregate {
    /// Takes one value in.
    ///
    /// # Panics
    /// If there are 2^64 values.
    pub fn add(&mut self, value: i64, at: Place) {
        let wide = i128::from(value);
        let extreme = Some(Extreme { value, at });
        let squares = U256::new((wide * wide).unsigned_abs());
        self.merge(&Self { count: 1, sum: wide, squares, min: extreme, max: extreme });
    }

    /// Takes in all that `other` did.
    ///
    /// # Panics
    /// If there are 2^64 values.
    pub fn merge(&mut self, other: &Self) {
        self.count = self.count.checked_add(other.count).expect("less than 2^64 values");
        self.sum += other.sum;
        self.squares += other.squares;
        self.min = first(self.min, other.min, |extreme| (extreme.value, extreme.at));
        self.max = first(self.max, other.max, |extreme| (!extreme.value, extreme.at));
    }

    /// How many values there were.
    pub const fn count(&self) -> u64 {
        self.count
    }
    /// Their sum.
    pub const fn sum(&self) -> i128 {
        self.sum
    }
    /// The sum of their squares.
    pub const fn squares(&self) -> U256 {
        self.squares
    }
    /// The smallest value.
    pub const fn min(&self) -> Option<Extreme> {
        self.min
    }
    /// The largest value.
    pub const fn max(&self) -> Option<Extreme> {
        self.max
    }
    /// The mean; none without a value.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum as f64 / self.count as f64)
    }
    /// The variance of whatever the values were drawn from; none of less than two values.
    pub fn variance(&self) -> Option<f64> {
        let pairs = u128::from(self.count) * u128::from(self.count.checked_sub(1)?);
        (pairs > 0).then(|| float(self.spread()) / pairs as f64)
    }
    /// The root of [`variance`](Self::variance).
    pub fn deviation(&self) -> Option<f64> {
        self.variance().map(f64::sqrt)
    }
    /// The mean and its bounds, if the values are independent; none of less than two values.
    ///
    /// Student's interval: exact for normal values, good for others from some dozen on.
    pub fn mean_interval(&self, confidence: Confidence) -> Option<Interval> {
        let error = (self.variance()? / self.count as f64).sqrt();
        let t = student_quantile((self.count - 1) as f64, confidence);
        Some(Interval::around(self.mean()?, t * error))
    }

    /// count x squares - sum², never negative and below 2^254.
    fn spread(&self) -> U256 {
        let sum = U256::new(self.sum.unsigned_abs());
        (self.squares * U256::from(self.count)) - (sum * sum)
    }
}

/// Of two extremes the one whose key is smaller.
fn first<K: Ord>(a: Option<Extreme>, b: Option<Extreme>, key: fn(&Extreme) -> K) -> Option<Extreme> {
    [a, b].into_iter().flatten().min_by_key(key)
}

/// The nearest number, or the one beside it.
fn float(wide: U256) -> f64 {
    /// 2^128.
    const HIGH: f64 = (1u128 << 64) as f64 * (1u128 << 64) as f64;
    let (high, low) = wide.into_words();
    high as f64 * HIGH + low as f64
}

/// An aggregate as it was written, not yet believed.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    count: u64,
    #[serde(with = "text")]
    sum: i128,
    #[serde(with = "text")]
    squares: U256,
    min: Option<Extreme>,
    max: Option<Extreme>,
}

/// Integers that no values have.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("count, sum, squares, min and max are of no {0} values; the file was changed")]
pub struct AggregateError(u64);

impl TryFrom<Written> for Aggregate {
    type Error = AggregateError;
    fn try_from(Written { count, sum, squares, min, max }: Written) -> Result<Self, AggregateError> {
        let read = Self { count, sum, squares, min, max };
        let possible = match (min, max) {
            (None, None) => read == Self::default(),
            (Some(min), Some(max)) => read.is_between(min.value, max.value),
            _ => false,
        };
        if possible { Ok(read) } else { Err(AggregateError(count)) }
    }
}

impl Aggregate {
    /// Whether so many values from `min` to `max` can have this sum and this sum of squares.
    fn is_between(&self, min: i64, max: i64) -> bool {
        let times = |value: i64| i128::from(value) * i128::from(self.count);
        // No product can overflow: the sum is checked first, and no square is above that of the farthest value.
        let farthest = U256::from(min.unsigned_abs().max(max.unsigned_abs()));
        (1..=MOST_WRITTEN).contains(&self.count)
            && (times(min)..=times(max)).contains(&self.sum)
            && self.squares <= farthest * farthest * U256::from(self.count)
            && self.squares * U256::from(self.count) >= U256::new(self.sum.unsigned_abs()).pow(2)
    }
}

/// Integers that other readers would round, as text.
pub(in crate::study) mod text {
    use core::fmt::Display;
    use core::str::FromStr;

    use serde::{Deserialize, Deserializer, Serializer, de};

    pub(in crate::study) fn serialize<T: Display, S: Serializer>(value: &T, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(value)
    }
    pub(in crate::study) fn deserialize<'de, T, D>(deserializer: D) -> Result<T, D::Error>
    where
        T: FromStr<Err: Display>,
        D: Deserializer<'de>,
    {
        String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(run: u128, cycle: u64) -> Place {
        Place { run: RunKey(run), cycle }
    }
    fn of(values: &[i64]) -> Aggregate {
        let mut all = Aggregate::default();
        values.iter().zip(0..).for_each(|(&value, cycle)| all.add(value, at(1, cycle)));
        all
    }

    #[test]
    fn moments_are_exact() {
        let all = of(&[2, 4, 4, 4, 5, 5, 7, 9]);
        assert_eq!((all.count(), all.sum(), all.squares()), (8, 40, U256::new(232)));
        assert_eq!((all.mean(), all.variance()), (Some(5.0), Some(32.0 / 7.0)));
        assert_eq!((all.min().unwrap().value, all.max().unwrap().value), (2, 9));
        assert_eq!((of(&[]).mean(), of(&[]).variance(), of(&[3]).variance()), (None, None, None));
        assert_eq!(of(&[3]).mean_interval(Confidence::USUAL), None);
    }

    #[test]
    fn values_far_from_zero_keep_their_variance() {
        const FAR: i64 = i64::MAX - 2;
        assert_eq!(of(&[FAR, FAR + 1, FAR + 2]).variance(), Some(1.0));
        assert_eq!(of(&[-FAR; 5]).variance(), Some(0.0));
        let widest = of(&[i64::MIN, i64::MIN, i64::MAX, i64::MAX]);
        assert_eq!(widest.sum(), -2);
        // 4 / 3 of 2^126, but for digits beyond an f64.
        let expected = 4.0 / 3.0 * (1u128 << 126) as f64;
        assert!((widest.variance().unwrap() / expected - 1.0).abs() < 1e-15);
    }

    #[test]
    fn of_equal_extremes_the_first_place_is_told() {
        let mut all = Aggregate::default();
        for place in [at(5, 9), at(3, 8), at(3, 7), at(4, 1)] {
            all.add(-1, place);
        }
        let first = Some(Extreme { value: -1, at: at(3, 7) });
        assert_eq!((all.min(), all.max()), (first, first));
    }

    #[test]
    fn the_interval_of_a_mean_is_students() {
        let found = of(&[2, 4, 4, 4, 5, 5, 7, 9]).mean_interval(Confidence::USUAL).unwrap();
        // t of 7 degrees at 95 %: 2.3646; the variance 32 / 7 of 8 values.
        let half = 2.364_624_251_592_785 * (4.0f64 / 7.0).sqrt();
        assert!((found.high - 5.0 - half).abs() < 1e-11 && (found.low - 5.0 + half).abs() < 1e-11, "{found:?}");
        assert_eq!(of(&[7; 9]).mean_interval(Confidence::USUAL), Some(Interval::around(7.0, 0.0)));
    }

    #[test]
    fn text_is_exact_and_read_back() {
        let json = serde_json::to_string(&of(&[i64::MAX, i64::MAX])).unwrap();
        assert_eq!(
            json,
            "{\"count\":2,\"sum\":\"18446744073709551614\",\
             \"squares\":\"170141183460469231694793815568465002498\",\
             \"min\":{\"value\":9223372036854775807,\"at\":{\"run\":\"00000000000000000000000000000001\",\"cycle\":0}},\
             \"max\":{\"value\":9223372036854775807,\"at\":{\"run\":\"00000000000000000000000000000001\",\"cycle\":0}}}"
        );
        for all in [of(&[]), of(&[-7]), of(&[i64::MIN; 5]), of(&[i64::MIN, 0, i64::MAX])] {
            let json = serde_json::to_string(&all).unwrap();
            assert_eq!(serde_json::from_str::<Aggregate>(&json).unwrap(), all);
        }
    }

    #[test]
    fn text_of_no_values_is_refused() {
        let good = serde_json::to_string(&of(&[1, 5])).unwrap();
        for (from, to) in [
            ("\"count\":2", "\"count\":0"),
            ("\"count\":2", "\"count\":18446744073709551615"),
            ("\"sum\":\"6\"", "\"sum\":\"-170141183460469231731687303715884105728\""),
            ("\"sum\":\"6\"", "\"sum\":\"11\""),
            ("\"squares\":\"26\"", "\"squares\":\"17\""),
            ("\"squares\":\"26\"", &format!("\"squares\":\"{}\"", U256::MAX)),
            ("\"value\":1", "\"value\":7"),
        ] {
            let bad = good.replace(from, to);
            assert_ne!(bad, good);
            let error = serde_json::from_str::<Aggregate>(&bad).unwrap_err();
            assert!(error.to_string().contains("the file was changed"), "{to}: {error}");
        }
        for (from, to) in [("\"6\"", "\"six\""), ("\"run\":\"0", "\"run\":\"+"), ("\"count\"", "\"counts\"")] {
            assert!(serde_json::from_str::<Aggregate>(&good.replace(from, to)).is_err(), "{to}");
        }
    }

    #[test]
    fn run_keys_are_32_digits() {
        let key = RunKey(0xfedc << 112 | 7);
        assert_eq!(key.to_string(), "fedc0000000000000000000000000007");
        assert_eq!(key.to_string().parse(), Ok(key));
        for text in ["", "7", "+edc0000000000000000000000000007", "FEDC0000000000000000000000000007"] {
            assert!(text.parse::<RunKey>().is_err());
        }
    }
}
