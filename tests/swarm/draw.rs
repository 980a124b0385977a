//! Draws of the generator.

use std::ops::RangeInclusive;

/// SplitMix64: small, and one seed gives one scenario on every machine.
pub(super) struct Draw(u64);

impl Draw {
    pub(super) const fn new(seed: u64) -> Self {
        Self(seed)
    }
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
    /// A number of the range, each as likely as the others.
    pub(super) fn within(&mut self, range: RangeInclusive<i64>) -> i64 {
        let width = (range.end() - range.start() + 1) as u64;
        range.start() + (self.next() % width) as i64
    }
    /// True in so many of a hundred cases.
    pub(super) fn percent(&mut self, share: i64) -> bool {
        self.within(1..=100) <= share
    }
    /// One of them.
    pub(super) fn one<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.within(0..=of.len() as i64 - 1) as usize]
    }
    /// One of them, taken out.
    pub(super) fn take<T>(&mut self, from: &mut Vec<T>) -> T {
        let at = self.within(0..=from.len() as i64 - 1) as usize;
        from.swap_remove(at)
    }
}
