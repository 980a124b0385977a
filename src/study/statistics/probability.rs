//! Probability: how likely a run fails, told from how many of how many did.
//!
//! | seen           | what is told                                                                       |
//! |----------------|------------------------------------------------------------------------------------|
//! | no run         | nothing                                                                            |
//! | no failure     | an upper bound, all of the error on that side; about 3 / n at 95 %: rule of three  |
//! | failures only  | a lower bound, the same mirrored                                                   |
//! | both           | failures / runs and the two bounds of Clopper and Pearson                          |
//!
//! The bounds are exact: whatever the true probability, the two bounds of Clopper and Pearson ("The use of confidence or
//! fiducial limits illustrated in the case of the binomial", 1934) hold it at least as often as the confidence says, and
//! so does a bound that stands alone.

use super::beta::{Share, beta_quantile};
use super::confidence::Confidence;
use super::interval::Interval;

/// What is known of a probability.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Probability {
    /// No run, so nothing.
    Unknown,
    /// It was never seen: the probability is at most this.
    UpperBound(f64),
    /// It was seen in every run: the probability is at least this.
    LowerBound(f64),
    /// It was seen in some runs.
    Between(Interval),
}

impl Probability {
    /// What `failures` in `runs` independent runs tell.
    ///
    /// # Panics
    /// If more failed than ran.
    pub fn of(failures: u64, runs: u64, confidence: Confidence) -> Self {
        assert!(failures <= runs, "{failures} of {runs} runs failed");
        match (failures, runs - failures) {
            (0, 0) => Self::Unknown,
            (0, _) => Self::UpperBound(never(runs, confidence.outside())),
            (_, 0) => Self::LowerBound(1.0 - never(runs, confidence.outside())),
            _ => Self::Between(clopper_pearson(failures, runs, confidence)),
        }
    }
    /// The bounds: 0 and 1 where there is no other.
    pub fn bounds(&self) -> (f64, f64) {
        match *self {
            Self::Unknown => (0.0, 1.0),
            Self::UpperBound(high) => (0.0, high),
            Self::LowerBound(low) => (low, 1.0),
            Self::Between(Interval { low, high, .. }) => (low, high),
        }
    }
    /// The share of runs in which it was seen; none without a run.
    pub fn estimate(&self) -> Option<f64> {
        match *self {
            Self::Unknown => None,
            Self::UpperBound(_) => Some(0.0),
            Self::LowerBound(_) => Some(1.0),
            Self::Between(Interval { estimate, .. }) => Some(estimate),
        }
    }
}

/// The probability that is not seen in `runs` runs in `missed` of all cases: 1 - missed^(1 / runs).
fn never(runs: u64, missed: f64) -> f64 {
    -libm::expm1(libm::log(missed) / runs as f64)
}

/// The two bounds of Clopper and Pearson around `failures` / `runs`, half of the error on either side.
///
/// # Panics
/// If there is no run, or more failed than ran.
pub fn clopper_pearson(failures: u64, runs: u64, confidence: Confidence) -> Interval {
    assert!(runs > 0 && failures <= runs, "{failures} of {runs} runs failed");
    let (failed, passed) = (failures as f64, (runs - failures) as f64);
    let tail = Share::new(confidence.tail());
    let low = if failures == 0 { 0.0 } else { beta_quantile(failed, passed + 1.0, tail).x };
    let high = if failures == runs { 1.0 } else { beta_quantile(failed + 1.0, passed, tail.turned()).x };
    Interval { estimate: failed / runs as f64, low, high }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::statistics::beta::binomial_cdf;

    #[test]
    fn bounds_are_those_of_the_tables() {
        for (failures, runs, confidence, low, high) in [
            (0, 10, 0.95, 0.0, 3.084_971_078_187_608_2e-1),
            (1, 10, 0.95, 2.528_578_544_461_784_5e-3, 4.450_161_170_281_954_2e-1),
            (5, 20, 0.95, 8.657_146_910_143_454e-2, 4.910_458_717_079_575_4e-1),
            (1, 1_000_000, 0.95, 2.531_780_766_379_417_8e-8, 5.571_630_655_172_244e-6),
            (10, 10, 0.95, 6.915_028_921_812_392e-1, 1.0),
            (3, 7, 0.99, 5.529_934_998_056_626_7e-2, 8.822_962_483_310_48e-1),
        ] {
            let found = clopper_pearson(failures, runs, Confidence::new(confidence).unwrap());
            assert!((found.low - low).abs() <= 1e-10 * low, "{failures} of {runs}: {found:?}");
            assert!((found.high / high - 1.0).abs() <= 1e-10, "{failures} of {runs}: {found:?}");
        }
    }

    #[test]
    fn what_was_never_seen_has_an_upper_bound_only() {
        let Probability::UpperBound(bound) = Probability::of(0, 1_000, Confidence::USUAL) else {
            panic!("an upper bound");
        };
        // Rule of three: 3 / n, and a little less as ln 20 is 2.996.
        assert!((0.002_98..0.003).contains(&bound), "{bound}");
        assert!((libm::pow(1.0 - bound, 1_000.0) - 0.05).abs() < 1e-12);
        let Probability::LowerBound(mirrored) = Probability::of(1_000, 1_000, Confidence::USUAL) else {
            panic!("a lower bound");
        };
        assert!((mirrored + bound - 1.0).abs() < 1e-15);
        assert_eq!(Probability::of(0, 0, Confidence::USUAL), Probability::Unknown);
        assert_eq!(Probability::of(0, 0, Confidence::USUAL).estimate(), None);
        assert_eq!(Probability::of(1, 4, Confidence::USUAL).estimate(), Some(0.25));
    }

    /// How often each count of failures is seen in `runs` runs.
    fn chances(runs: u64, p: f64) -> Vec<f64> {
        let at_most: Vec<_> = (0..=runs).map(|k| binomial_cdf(k, runs, Share::new(p))).collect();
        (0..at_most.len()).map(|k| at_most[k] - k.checked_sub(1).map_or(0.0, |before| at_most[before])).collect()
    }

    #[test]
    fn bounds_hold_the_true_probability_often_enough() {
        // Summed over every count that can be seen, so exact: never less often than promised.
        for confidence in [0.8, 0.95, 0.99].map(|c| Confidence::new(c).unwrap()) {
            for runs in [1, 2, 7, 30, 100] {
                let two: Vec<_> = (0..=runs).map(|seen| clopper_pearson(seen, runs, confidence)).collect();
                let told: Vec<_> = (0..=runs).map(|seen| Probability::of(seen, runs, confidence).bounds()).collect();
                for p in (1..100).map(|percent| f64::from(percent) / 100.0) {
                    let chances = chances(runs, p);
                    let sum = |hit: &dyn Fn(usize) -> bool| -> f64 {
                        chances.iter().enumerate().filter(|&(seen, _)| hit(seen)).map(|(_, chance)| chance).sum()
                    };
                    let context = format!("{runs} runs, {p}, {confidence}");
                    assert!(sum(&|seen| two[seen].holds(p)) >= confidence.value() - 1e-9, "{context}");
                    assert!(sum(&|seen| p > told[seen].1) <= confidence.outside() + 1e-9, "{context}");
                    assert!(sum(&|seen| p < told[seen].0) <= confidence.outside() + 1e-9, "{context}");
                }
            }
        }
    }
}
