//! Buckets: a value per cycle in memory that does not grow with the number of cycles.
//!
//! Each bucket stands for the same number of cycles. When the run outgrows the last bucket, neighbours are merged
//! and each stands for twice as many.

/// What a bucket can hold: values of neighbouring cycles become one.
pub(super) trait Merge: Clone + Default {
    /// Takes in what another bucket saw.
    fn merge(&mut self, other: &Self);
}

/// A fixed number of buckets over the cycles from 0.
#[derive(Clone, Debug)]
pub(super) struct Buckets<T> {
    capacity: usize,
    cycles_each: u64,
    filled: Vec<T>,
}

impl<T: Merge> Buckets<T> {
    /// At most `capacity` buckets, an even number.
    pub(super) fn new(capacity: usize) -> Self {
        Self { capacity, cycles_each: 1, filled: Vec::with_capacity(capacity) }
    }

    /// The bucket of `cycle`.
    pub(super) fn at(&mut self, cycle: u64) -> &mut T {
        while cycle / self.cycles_each >= self.capacity as u64 {
            self.double();
        }
        let index = (cycle / self.cycles_each) as usize;
        if index >= self.filled.len() {
            self.filled.resize(index + 1, T::default());
        }
        &mut self.filled[index]
    }

    fn double(&mut self) {
        self.cycles_each *= 2;
        let half = self.filled.len().div_ceil(2);
        for index in 0..half {
            let mut merged = self.filled[2 * index].clone();
            if let Some(second) = self.filled.get(2 * index + 1) {
                merged.merge(second);
            }
            self.filled[index] = merged;
        }
        self.filled.truncate(half);
    }

    /// Cycles that one bucket stands for.
    pub(super) const fn cycles_each(&self) -> u64 {
        self.cycles_each
    }
    /// First cycle of each bucket and what it holds.
    pub(super) fn iter(&self) -> impl Iterator<Item = (u64, &T)> {
        self.filled.iter().enumerate().map(|(index, value)| (index as u64 * self.cycles_each, value))
    }
    /// Whether nothing was ever put in.
    pub(super) const fn is_empty(&self) -> bool {
        self.filled.is_empty()
    }
}

/// Smallest and largest value; nothing at first.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct Envelope(pub(super) Option<(i64, i64)>);

impl Envelope {
    /// Takes in one value.
    pub(super) fn add(&mut self, value: i64) {
        let (lo, hi) = self.0.unwrap_or((value, value));
        self.0 = Some((lo.min(value), hi.max(value)));
    }
}
impl Merge for Envelope {
    fn merge(&mut self, other: &Self) {
        if let Some((lo, hi)) = other.0 {
            self.add(lo);
            self.add(hi);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_run_keeps_its_extremes_and_a_short_one_every_value() {
        let mut buckets = Buckets::<Envelope>::new(8);
        for cycle in 0..8 {
            buckets.at(cycle).add(cycle as i64);
        }
        assert_eq!(buckets.cycles_each(), 1);
        for cycle in 8..1_000 {
            buckets.at(cycle).add(if cycle == 777 { -5 } else { cycle as i64 });
        }
        assert_eq!(buckets.cycles_each(), 128);
        let found: Vec<_> = buckets.iter().map(|(first, envelope)| (first, envelope.0)).collect();
        assert_eq!(found.len(), 8);
        assert_eq!(found[0], (0, Some((0, 127))));
        assert_eq!(found[6], (768, Some((-5, 895))));
    }

    #[test]
    fn cycles_without_a_value_stay_empty() {
        let mut buckets = Buckets::<Envelope>::new(4);
        buckets.at(3).add(1);
        assert_eq!(buckets.iter().filter(|(_, envelope)| envelope.0.is_none()).count(), 3);
    }
}
