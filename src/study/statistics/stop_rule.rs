//! Stop rule: how many repetitions are enough.
//!
//! | half width of the interval                    | runs                 | answer      |
//! |-----------------------------------------------|----------------------|-------------|
//! | any                                           | below the least      | go on       |
//! | at most `relative` x estimate, or at most `floor` | at least the least | enough      |
//! | more, or unknown                              | below the most       | go on       |
//! | more, or unknown                              | the most             | given up    |
//!
//! An estimate of zero is no trouble: nothing is divided by it. Values that are all the same have a half width of zero,
//! which is enough at any estimate; others around zero are enough at `floor` only.
//!
//! Whoever looks after every run stops at a lucky moment more often than the confidence says. The least number of runs
//! guards against the worst; Model: 10 at least. The counts alone decide, so take runs in by their number, not as they
//! finish: then the answer is the same for any number of threads.

use super::aggregate::Aggregate;
use super::confidence::Confidence;
use super::probability::{Probability, clopper_pearson};

/// Least number of runs that a rule may ask for. Model: of fewer the variance is hardly known.
pub const LEAST: u64 = 10;

/// When repetitions are enough. Made by [`StopRule::new`].
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StopRule {
    settings: StopSettings,
}

/// What a [`StopRule`] is made of.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StopSettings {
    /// Half width that is enough, as a share of the estimate's magnitude.
    pub relative: f64,
    /// Half width that is enough whatever the estimate, in the unit of the values; 0 for none.
    pub floor: f64,
    /// Confidence of the interval.
    pub confidence: Confidence,
    /// Least number of runs, [`LEAST`] or more.
    pub least: u64,
    /// Largest number of runs.
    pub most: u64,
}

/// What to do next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Next {
    /// One more run.
    GoOn,
    /// The interval is narrow enough.
    Enough,
    /// The largest number of runs is reached, the interval is still too wide.
    GivenUp,
}

/// Why there is no such rule.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum StopError {
    /// A half width is negative or no number, or none is asked for.
    #[error("{name} = {value} is no half width; {help}")]
    HalfWidth {
        /// `relative` or `floor`.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What would be one.
        help: &'static str,
    },
    /// The numbers of runs are in no order, or too small.
    #[error("least = {least} and most = {most} runs are not in order {LEAST} <= least <= most")]
    Runs {
        /// Least number.
        least: u64,
        /// Largest number.
        most: u64,
    },
}

impl StopRule {
    /// The rule of `settings`.
    ///
    /// # Errors
    /// If `relative` is not above 0, `floor` is below 0, `least` is below [`LEAST`] or above `most`.
    pub fn new(settings: StopSettings) -> Result<Self, StopError> {
        let StopSettings { relative, floor, least, most, .. } = settings;
        if !(relative > 0.0 && relative.is_finite()) {
            let help = "it is a share above 0, such as 0.05";
            return Err(StopError::HalfWidth { name: "relative", value: relative, help });
        }
        if !(floor >= 0.0 && floor.is_finite()) {
            let help = "it is 0 or more, in the unit of the values";
            return Err(StopError::HalfWidth { name: "floor", value: floor, help });
        }
        if !(LEAST <= least && least <= most) {
            return Err(StopError::Runs { least, most });
        }
        Ok(Self { settings })
    }

    /// What to do after `runs` runs that gave `estimate` and an interval of `half_width`, if any.
    pub fn next(&self, runs: u64, estimate: f64, half_width: Option<f64>) -> Next {
        let StopSettings { relative, floor, least, most, .. } = self.settings;
        let narrow = half_width.is_some_and(|half| half <= relative * estimate.abs() || half <= floor);
        if runs >= least && narrow {
            Next::Enough
        } else if runs >= most {
            Next::GivenUp
        } else {
            Next::GoOn
        }
    }
    /// The same for the mean of `values`, one of each run.
    pub fn next_for_mean(&self, values: &Aggregate) -> Next {
        let interval = values.mean_interval(self.settings.confidence);
        self.next(values.count(), values.mean().unwrap_or(0.0), interval.map(|interval| interval.half_width()))
    }
    /// The same for the probability of which `failures` in `runs` runs tell. Never seen, it is enough when its upper
    /// bound is at most `floor`.
    ///
    /// # Panics
    /// If more failed than ran.
    pub fn next_for_probability(&self, failures: u64, runs: u64) -> Next {
        let confidence = self.settings.confidence;
        let half = match Probability::of(failures, runs, confidence) {
            Probability::Unknown => None,
            Probability::UpperBound(high) => Some(high),
            _ => Some(clopper_pearson(failures, runs, confidence).half_width()),
        };
        self.next(runs, failures as f64 / runs.max(1) as f64, half)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::statistics::aggregate::{Place, RunKey};

    const SETTINGS: StopSettings =
        StopSettings { relative: 0.1, floor: 0.0, confidence: Confidence::USUAL, least: 10, most: 50 };

    fn rule(settings: StopSettings) -> StopRule {
        StopRule::new(settings).unwrap()
    }
    fn of(values: impl IntoIterator<Item = i64>) -> Aggregate {
        let mut all = Aggregate::default();
        values.into_iter().zip(0..).for_each(|(value, run)| all.add(value, Place { run: RunKey(run), cycle: 0 }));
        all
    }

    #[test]
    fn every_row_of_the_table() {
        let rule = rule(SETTINGS);
        for (runs, half, next) in [
            (9, Some(0.0), Next::GoOn),
            (10, Some(1.0), Next::Enough),
            (49, Some(1.1), Next::GoOn),
            (49, None, Next::GoOn),
            (50, Some(1.1), Next::GivenUp),
            (50, None, Next::GivenUp),
            (50, Some(1.0), Next::Enough),
            (49, Some(f64::NAN), Next::GoOn),
        ] {
            assert_eq!(rule.next(runs, -10.0, half), next, "{runs} {half:?}");
        }
    }

    #[test]
    fn means_of_zero_come_to_an_end() {
        let plain = rule(SETTINGS);
        assert_eq!(plain.next_for_mean(&of([0; 10])), Next::Enough);
        assert_eq!(plain.next_for_mean(&of([7; 9])), Next::GoOn);
        let around = |count: i64| of((0..count).map(|i| i % 2 * 2 - 1));
        assert_eq!(plain.next_for_mean(&around(40)), Next::GoOn);
        assert_eq!(plain.next_for_mean(&around(50)), Next::GivenUp);
        assert_eq!(rule(SETTINGS_WITH_FLOOR).next_for_mean(&around(40)), Next::Enough);
        assert_eq!(plain.next_for_mean(&of([])), Next::GoOn);
    }
    const SETTINGS_WITH_FLOOR: StopSettings = StopSettings { floor: 0.5, ..SETTINGS };

    #[test]
    fn probabilities_that_were_never_seen_are_enough_below_the_floor() {
        let rule = rule(StopSettings { floor: 0.1, ..SETTINGS });
        // 1 - 0.05^(1 / 28) is above 0.1, of 29 runs it is not.
        assert_eq!((rule.next_for_probability(0, 28), rule.next_for_probability(0, 29)), (Next::GoOn, Next::Enough));
        let plain = StopRule::new(SETTINGS).unwrap();
        assert_eq!((plain.next_for_probability(0, 49), plain.next_for_probability(0, 50)), (Next::GoOn, Next::GivenUp));
        assert_eq!(plain.next_for_probability(25, 49), Next::GoOn);
        assert_eq!(
            StopRule::new(StopSettings { most: 1_000, ..SETTINGS }).unwrap().next_for_probability(500, 1_000),
            Next::Enough
        );
        assert_eq!(plain.next_for_probability(0, 0), Next::GoOn);
    }

    #[test]
    fn settings_that_make_no_sense_are_named() {
        for (settings, text) in [
            (
                StopSettings { relative: 0.0, ..SETTINGS },
                "relative = 0 is no half width; it is a share above 0, such as 0.05",
            ),
            (
                StopSettings { floor: -1.0, ..SETTINGS },
                "floor = -1 is no half width; it is 0 or more, in the unit of the values",
            ),
            (
                StopSettings { least: 9, ..SETTINGS },
                "least = 9 and most = 50 runs are not in order 10 <= least <= most",
            ),
            (StopSettings { most: 9, ..SETTINGS }, "least = 10 and most = 9 runs are not in order 10 <= least <= most"),
        ] {
            assert_eq!(StopRule::new(settings).unwrap_err().to_string(), text);
        }
    }
}
