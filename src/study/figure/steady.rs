//! Statistics of the steady state: what can be asked of a quantity's values from its beginning on, with bounds.

use super::statistic::thousandths;
use super::value::{Unit, Value};
use crate::study::histogram::Quantity;
use crate::study::steady::{Bounded, Values};

/// What stands before a quantity whose values in steady state are meant.
pub(super) const BEGIN: &str = "steady.";
/// What the families of the steady state begin with.
const FAMILIES: &str = "steady_state.";

/// The statistics that are listed, with what they are. Any other percentile can be asked for as well.
pub const STEADY: &[(&str, &str)] = &[
    ("count", "how many values there are"),
    ("mean", "the mean"),
    ("mean_low", "its lower bound at 95 %, by batch means"),
    ("mean_high", "its upper bound"),
    ("p50", "what 50 % of the values do not exceed, three significant digits"),
    ("p50_low", "its lower bound at 95 %, by order statistics of as many values as the cycles are worth"),
    ("p50_high", "its upper bound"),
    ("p99", "what 99 % of the values do not exceed"),
    ("p99_low", "its lower bound"),
    ("p99_high", "its upper bound"),
    ("magnitude_p99", "what 99 % of the magnitudes do not exceed"),
    ("magnitude_p99_low", "its lower bound"),
    ("magnitude_p99_high", "its upper bound"),
];

/// One number of the steady state.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Of {
    /// Number of values.
    Count,
    /// Mean.
    Mean(Side),
    /// Percentile (thousandths of a percent).
    Percentile(u32, Side),
    /// The same of the magnitudes.
    Magnitude(u32, Side),
}

/// Which number of an estimate with bounds.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Side {
    Estimate,
    Low,
    High,
}

impl Of {
    /// The statistic called `name`.
    pub(super) fn named(name: &str) -> Option<Self> {
        if name == "count" {
            return Some(Self::Count);
        }
        let ends = [("_low", Side::Low), ("_high", Side::High)];
        let bound = ends.into_iter().find_map(|(end, side)| Some((name.strip_suffix(end)?, side)));
        let (stem, side) = bound.unwrap_or((name, Side::Estimate));
        match (stem, stem.strip_prefix("magnitude_p")) {
            ("mean", _) => Some(Self::Mean(side)),
            (_, Some(percent)) => Some(Self::Magnitude(thousandths(percent)?, side)),
            _ => Some(Self::Percentile(thousandths(stem.strip_prefix('p')?)?, side)),
        }
    }
    /// The unit in which people read this statistic of `quantity`.
    pub(super) fn unit(self, quantity: &Quantity) -> Unit {
        if self == Self::Count { Unit::Count } else { quantity.unit.into() }
    }
    /// Whether it is never below zero, whatever the quantity.
    pub(super) const fn is_magnitude(self) -> bool {
        matches!(self, Self::Count | Self::Magnitude(..))
    }
    /// The statistic of these values.
    pub(super) fn of(self, values: &Values) -> Option<Value> {
        let percent = |thousandths: u32| f64::from(thousandths) / 1_000.0;
        let (bounded, side) = match self {
            Self::Count => return Some(Value::Count(values.count())),
            Self::Mean(side) => (values.mean(), side),
            Self::Percentile(p, side) => (values.percentile(percent(p)), side),
            Self::Magnitude(p, side) => (values.magnitude_percentile(percent(p)), side),
        };
        let Bounded { estimate, low, high } = bounded?;
        let value = match side {
            Side::Estimate => Some(estimate),
            Side::Low => low,
            Side::High => high,
        };
        value.map(Value::Span)
    }
}

/// Whether the end of a name asks for the steady state.
pub(super) fn is_asked(end: &str) -> bool {
    end.starts_with(BEGIN) || end.starts_with(FAMILIES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn listed_statistics_are_known_and_others_are_not() {
        assert!(STEADY.iter().all(|row| Of::named(row.0).is_some()));
        assert_eq!(Of::named("mean_high"), Some(Of::Mean(Side::High)));
        assert_eq!(Of::named("p99.9_low"), Some(Of::Percentile(99_900, Side::Low)));
        assert_eq!(Of::named("magnitude_p90"), Some(Of::Magnitude(90_000, Side::Estimate)));
        assert!(
            ["", "max", "count_low", "p", "p101", "magnitude", "mean_", "low"].iter().all(|n| Of::named(n).is_none())
        );
    }
}
