//! Tally: how often each magnitude came, to three significant digits, in the bins of an HdrHistogram.
//!
//! Magnitudes below 2048 have a bin each. From there on each doubling of the magnitude has 1024 bins of equal width, so
//! that no bin is wider than a thousandth of what falls in. What is counted is what an HdrHistogram of three digits
//! counts; the memory differs: all bins are there from the start, so that counting never allocates, but a bin that
//! nothing comes near to stays untouched and costs the machine no memory.

/// Significant decimal digits that the bins tell apart.
const DIGITS: u8 = 3;
/// Bits of a magnitude that its bin tells: 2^11 magnitudes have bins of their own.
const BITS: u32 = 11;
/// Bins of a doubling.
const DOUBLING: usize = 1 << (BITS - 1);

/// Magnitudes that cannot be told apart, and how often one of them came.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Step {
    /// The smallest of them.
    pub(super) low: u64,
    /// How many they are.
    pub(super) width: u64,
    /// How often.
    pub(super) count: u64,
}

impl Step {
    /// The one in the middle.
    pub(super) const fn middle(self) -> u64 {
        self.low + self.width / 2
    }
    /// The largest of them.
    pub(super) const fn high(self) -> u64 {
        self.low + self.width - 1
    }
}

/// How often each magnitude up to a limit came.
#[derive(Debug)]
pub(super) struct Tally {
    counts: Vec<u64>,
    /// From this bin on none has counted.
    used: usize,
    total: u64,
}

/// A copy of what was counted; what is untouched stays so.
impl Clone for Tally {
    fn clone(&self) -> Self {
        let mut counts = vec![0; self.counts.len()];
        counts[..self.used].copy_from_slice(&self.counts[..self.used]);
        Self { counts, ..*self }
    }
}

/// The bin of a magnitude.
#[inline]
const fn bin(magnitude: u64) -> usize {
    let doublings = u64::BITS - BITS - (magnitude | ((1 << BITS) - 1)).leading_zeros();
    ((doublings as usize) << (BITS - 1)) + (magnitude >> doublings) as usize
}
/// What falls into a bin: the smallest magnitude, and how many.
pub(super) const fn range(bin: usize) -> (u64, u64) {
    let doublings = (bin / DOUBLING).saturating_sub(1);
    ((((bin - doublings * DOUBLING) as u64) << doublings), 1 << doublings)
}

impl Tally {
    /// Nothing counted, with a place for magnitudes up to `limit`.
    pub(super) fn new(limit: u64) -> Self {
        Self { counts: vec![0; bin(limit) + 1], used: 0, total: 0 }
    }
    /// Counts a magnitude; one beyond the limit's bin as if it were the limit.
    #[inline]
    pub(super) fn record(&mut self, magnitude: u64) {
        let bin = bin(magnitude).min(self.counts.len() - 1);
        self.counts[bin] += 1;
        self.used = self.used.max(bin + 1);
        self.total += 1;
    }
    /// Forgets everything.
    pub(super) fn reset(&mut self) {
        self.counts[..self.used].fill(0);
        (self.used, self.total) = (0, 0);
    }
    /// Adds what `other`, of the same limit, counted.
    pub(super) fn merge(&mut self, other: &Self) {
        for (mine, theirs) in self.counts.iter_mut().zip(&other.counts[..other.used]) {
            *mine += theirs;
        }
        self.used = self.used.max(other.used);
        self.total += other.total;
    }
    /// How much was counted.
    pub(super) const fn len(&self) -> u64 {
        self.total
    }
    /// What was counted, ascending.
    pub(super) fn steps(&self) -> impl DoubleEndedIterator<Item = Step> {
        let all = self.counts[..self.used].iter().enumerate().filter(|(_, count)| **count > 0);
        all.map(|(bin, &count)| {
            let (low, width) = range(bin);
            Step { low, width, count }
        })
    }
    /// How many magnitudes cannot be told apart from this one.
    pub(super) const fn width(magnitude: u64) -> u64 {
        range(bin(magnitude)).1
    }
    /// The same as an HdrHistogram for magnitudes up to `limit`.
    pub(super) fn hdr(&self, limit: u64) -> hdrhistogram::Histogram<u64> {
        let mut hdr = hdrhistogram::Histogram::new_with_bounds(1, limit, DIGITS).expect("a limit is at least 2 ticks");
        for step in self.steps() {
            hdr.saturating_record_n(step.low, step.count);
        }
        hdr
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMIT: u64 = 120_000_000;

    fn tally(magnitudes: &[u64]) -> Tally {
        let mut tally = Tally::new(LIMIT);
        for &magnitude in magnitudes {
            tally.record(magnitude);
        }
        tally
    }
    fn magnitude() -> impl Strategy<Value = u64> {
        prop_oneof![0..5_000u64, 0..=LIMIT, Just(LIMIT), Just(2_047), Just(2_048), Just(4_095), Just(4_096)]
    }

    #[test]
    fn small_magnitudes_have_a_bin_each_and_the_next_ones_share() {
        let steps: Vec<_> = tally(&[0, 2_047, 2_048, 2_049, 4_095, 4_096]).steps().collect();
        let step = |low, width, count| Step { low, width, count };
        assert_eq!(steps, [step(0, 1, 1), step(2_047, 1, 1), step(2_048, 2, 2), step(4_094, 2, 1), step(4_096, 4, 1)]);
        assert_eq!((steps[2].middle(), steps[2].high(), Tally::width(4_096)), (2_049, 2_049, 4));
    }

    #[test]
    fn beyond_the_limit_the_last_bin_counts() {
        let mut tally = Tally::new(1_000);
        tally.record(u64::MAX);
        assert_eq!(tally.steps().next(), Some(Step { low: 1_000, width: 1, count: 1 }));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        #[test]
        fn it_tells_what_an_hdr_histogram_tells(magnitudes in prop::collection::vec(magnitude(), 0..60)) {
            let mut hdr = hdrhistogram::Histogram::<u64>::new_with_bounds(1, LIMIT, DIGITS).unwrap();
            for &magnitude in &magnitudes {
                hdr.saturating_record(magnitude);
            }
            let told: Vec<_> = hdr
                .iter_recorded()
                .map(|step| (step.value_iterated_to(), step.count_at_value()))
                .map(|(value, count)| (hdr.lowest_equivalent(value), hdr.highest_equivalent(value), hdr.median_equivalent(value), count))
                .collect();
            let tally = tally(&magnitudes);
            let own: Vec<_> = tally.steps().map(|step| (step.low, step.high(), step.middle(), step.count)).collect();
            prop_assert_eq!(own, told);
            prop_assert_eq!(tally.len(), hdr.len());
            prop_assert_eq!(tally.hdr(LIMIT), hdr);
        }

        #[test]
        fn every_magnitude_lies_in_its_bin(magnitude in any::<u64>()) {
            let (low, width) = range(bin(magnitude));
            prop_assert!(low <= magnitude && magnitude - low < width && width * 1_000 <= magnitude.max(1_000));
        }

        #[test]
        fn copies_merges_and_resets_count_alike(
            a in prop::collection::vec(magnitude(), 0..30), b in prop::collection::vec(magnitude(), 0..30),
        ) {
            let steps = |tally: &Tally| (tally.steps().collect::<Vec<_>>(), tally.len());
            let (one, other) = (tally(&a), tally(&b));
            let mut merged = one.clone();
            prop_assert_eq!(steps(&merged), steps(&one));
            merged.merge(&other);
            prop_assert_eq!(steps(&merged), steps(&tally(&[a, b.clone()].concat())));
            merged.reset();
            prop_assert_eq!(steps(&merged), (Vec::new(), 0));
            merged.merge(&other);
            prop_assert_eq!(steps(&merged), steps(&other));
        }
    }
}
