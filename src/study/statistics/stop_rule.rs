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

use super::interval::Interval;

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
        let StopSettings { relative, floor, least, most } = settings;
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

    /// What to do after `runs` runs that gave this interval, if any.
    pub fn next(&self, runs: u64, interval: Option<Interval>) -> Next {
        let StopSettings { relative, floor, least, most } = self.settings;
        let narrow = |interval: Interval| {
            let half = interval.half_width();
            half <= relative * interval.estimate.abs() || half <= floor
        };
        if runs >= least && interval.is_some_and(narrow) {
            Next::Enough
        } else if runs >= most {
            Next::GivenUp
        } else {
            Next::GoOn
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    const SETTINGS: StopSettings = StopSettings { relative: 0.1, floor: 0.0, least: 10, most: 50 };

    fn rule(settings: StopSettings) -> StopRule {
        StopRule::new(settings).unwrap()
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
            let interval = half.map(|half| Interval::around(-10.0, half));
            assert_eq!(rule.next(runs, interval), next, "{runs} {half:?}");
        }
    }

    #[test]
    fn an_estimate_of_zero_is_enough_when_all_is_the_same_or_below_the_floor() {
        let zero = |half| Some(Interval::around(0.0, half));
        let plain = rule(SETTINGS);
        assert_eq!((plain.next(10, zero(0.0)), plain.next(49, zero(0.1))), (Next::Enough, Next::GoOn));
        let with_floor = rule(StopSettings { floor: 0.5, ..SETTINGS });
        assert_eq!((with_floor.next(40, zero(0.5)), with_floor.next(40, zero(0.6))), (Next::Enough, Next::GoOn));
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
