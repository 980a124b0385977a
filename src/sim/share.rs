//! A share of things that chance decides: telegrams, bits.

use crate::sim::noise::Stream;

/// A share from nothing to all, exact to 10^-15.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Share(u64);

impl Share {
    /// Parts of a whole.
    pub const WHOLE: u64 = 1_000_000_000_000_000;
    /// None of them.
    pub const NONE: Self = Self(0);
    /// Each of them.
    pub const ALL: Self = Self(Self::WHOLE);

    /// So many of [`Self::WHOLE`] parts; none above all of them.
    pub const fn new(parts: u64) -> Option<Self> {
        if parts <= Self::WHOLE { Some(Self(parts)) } else { None }
    }
    /// The parts.
    pub const fn parts(self) -> u64 {
        self.0
    }
    /// Whether chance decides at all.
    pub const fn is_chance(self) -> bool {
        0 < self.0 && self.0 < Self::WHOLE
    }
    /// Whether the next one belongs to the share. Draws nothing where chance has no say.
    pub fn takes(self, stream: &mut Stream) -> bool {
        if self.is_chance() { stream.below(Self::WHOLE) < self.0 } else { self == Self::ALL }
    }
    /// How many do not belong to it before the next one that does: geometric, so that the cost is one draw for each
    /// that does, however rare they are. `u64::MAX` where none ever does.
    pub fn passed_over(self, stream: &mut Stream) -> u64 {
        if self.is_chance() {
            let share = self.0 as f64 / Self::WHOLE as f64;
            // The share is 10^-15 at least and the logarithm above -38: no more than 2^55.
            (libm::log(stream.unit()) / libm::log1p(-share)) as u64
        } else if self == Self::ALL {
            0
        } else {
            u64::MAX
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::noise::Purpose;

    fn stream() -> Stream {
        Stream::new(1, 2, Purpose::BitError)
    }

    #[test]
    fn none_and_all_are_no_matter_of_chance() {
        let mut stream = stream();
        assert!((0..100).all(|_| !Share::NONE.takes(&mut stream) && Share::ALL.takes(&mut stream)));
        assert_eq!([Share::NONE, Share::ALL].map(|share| share.passed_over(&mut stream)), [u64::MAX, 0]);
        assert_eq!(stream.below(1 << 40), self::stream().below(1 << 40), "nothing was drawn");
        assert_eq!(Share::new(Share::WHOLE + 1), None);
    }

    #[test]
    fn a_share_is_met_telegram_by_telegram_and_gap_by_gap() {
        // A tenth of 100 000: the standard deviation is 95.
        let tenth = Share::new(Share::WHOLE / 10).unwrap();
        let mut stream = stream();
        let taken = (0..100_000).filter(|_| tenth.takes(&mut stream)).count();
        assert!((9_600..10_400).contains(&taken), "{taken}");
        // 10 000 gaps of 9 on the average, with a standard deviation of 9.5 each.
        let gaps: u64 = (0..10_000).map(|_| tenth.passed_over(&mut stream)).sum();
        assert!((86_200..93_800).contains(&gaps), "{gaps}");
    }

    #[test]
    fn the_rarest_share_is_far_between() {
        let rare = Share::new(1).unwrap();
        let mut stream = stream();
        let gaps: Vec<_> = (0..1_000).map(|_| rare.passed_over(&mut stream)).collect();
        let mean = gaps.iter().map(|&gap| gap as f64).sum::<f64>() / 1e3;
        assert!((0.85e15..1.15e15).contains(&mean), "{mean}");
        assert!(gaps.iter().all(|&gap| gap < 1 << 56));
    }
}
