//! Bins: values that cannot be told apart, and how many they are.

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_is_between_the_ends_and_never_overflows() {
        let middle = |low, high| Counted { low, high, count: 1 }.middle();
        let middles = [(7, 7), (-3, 4), (2_048, 2_049), (i64::MIN, i64::MAX), (i64::MAX - 1, i64::MAX)];
        assert_eq!(middles.map(|(low, high)| middle(low, high)), [7, 0, 2_048, -1, i64::MAX - 1]);
    }
}
