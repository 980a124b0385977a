//! Statistics: what can be asked of a distribution.

use super::value::{Unit, Value};
use crate::study::histogram::{Histogram, Quantity};

/// One number of a distribution. One line of [`STATISTICS`] is all that a new one needs.
#[derive(Clone, Copy, Debug)]
pub struct Statistic {
    /// Its name, the end of a figure's.
    pub name: &'static str,
    /// What it is, for people.
    pub what: &'static str,
    /// How it is made.
    pub of: Of,
}

/// How a statistic is made of a histogram.
#[derive(Clone, Copy, Debug)]
pub enum Of {
    /// A number of values.
    Count(fn(&Histogram) -> u64),
    /// A value of the quantity.
    Value(fn(&Histogram) -> Option<crate::time::Span>),
    /// The value that this share of all values does not exceed (thousandths of a percent).
    Percentile(u32),
    /// The same of the magnitudes (thousandths of a percent).
    Magnitude(u32),
}

/// The statistics that are listed. Any other percentile, `p95` or `magnitude_p99.99`, can be asked for as well.
#[rustfmt::skip]
pub const STATISTICS: &[Statistic] = &[
    Statistic { name: "count", what: "how many values there are", of: Of::Count(Histogram::count) },
    Statistic { name: "out_of_range", what: "of these, values beyond the bounds of the histogram", of: Of::Count(|all| all.below() + all.above()) },
    Statistic { name: "min", what: "the smallest value, exact", of: Of::Value(Histogram::min) },
    Statistic { name: "mean", what: "the mean, exact", of: Of::Value(Histogram::mean) },
    Statistic { name: "p50", what: "what 50 % of the values do not exceed, three significant digits", of: Of::Percentile(50_000) },
    Statistic { name: "p90", what: "what 90 % do not exceed", of: Of::Percentile(90_000) },
    Statistic { name: "p99", what: "what 99 % do not exceed", of: Of::Percentile(99_000) },
    Statistic { name: "p99.9", what: "what 99.9 % do not exceed", of: Of::Percentile(99_900) },
    Statistic { name: "max", what: "the largest value, exact", of: Of::Value(Histogram::max) },
    Statistic { name: "magnitude_p99", what: "what 99 % of the magnitudes do not exceed", of: Of::Magnitude(99_000) },
    Statistic { name: "magnitude_max", what: "the largest magnitude, exact", of: Of::Value(|all| all.farthest().map(crate::time::Span::abs)) },
    Statistic { name: "farthest", what: "the value farthest from zero, with its sign, exact", of: Of::Value(Histogram::farthest) },
];

impl Of {
    /// The statistic called `name`: one of [`STATISTICS`] or a percentile with at most three decimals.
    pub(super) fn named(name: &str) -> Option<Self> {
        if let Some(row) = STATISTICS.iter().find(|row| row.name == name) {
            return Some(row.of);
        }
        match name.strip_prefix("magnitude_p") {
            Some(percent) => thousandths(percent).map(Self::Magnitude),
            None => thousandths(name.strip_prefix('p')?).map(Self::Percentile),
        }
    }
    /// The unit in which people read this statistic of `quantity`.
    pub(super) fn unit(self, quantity: &Quantity) -> Unit {
        if matches!(self, Self::Count(_)) { Unit::Count } else { quantity.unit.into() }
    }
    /// Whether it is never below zero, whatever the quantity.
    pub(super) const fn is_magnitude(self) -> bool {
        matches!(self, Self::Count(_) | Self::Magnitude(_))
    }
    /// The statistic of a histogram; none if that has no values. How many values there are is told in any case.
    pub(super) fn of(self, histogram: &Histogram) -> Option<Value> {
        let percent = |thousandths: u32| f64::from(thousandths) / 1_000.0;
        match self {
            Self::Count(of) => Some(Value::Count(of(histogram))),
            Self::Value(of) => of(histogram).map(Value::Span),
            Self::Percentile(p) => histogram.percentile(percent(p)).map(Value::Span),
            Self::Magnitude(p) => histogram.magnitude_percentile(percent(p)).map(Value::Span),
        }
    }
}

/// A percentage from `0` to `100` with at most three decimals, in thousandths.
pub(super) fn thousandths(text: &str) -> Option<u32> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, "0"));
    let digits = |part: &str| (1..=3).contains(&part.len()) && part.bytes().all(|octet| octet.is_ascii_digit());
    if !digits(whole) || !digits(fraction) {
        return None;
    }
    let number: u32 = format!("{whole}{fraction:0<3}").parse().ok()?;
    (number <= 100_000).then_some(number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Span;

    #[test]
    fn any_percentile_can_be_asked_for() {
        let texts = ["50", "99.9", "99.999", "0", "100", "100.0", "100.001", "99.9999", "", ".5", "5.", "-1", "1e2"];
        let all = texts.map(thousandths);
        let good = [50_000, 99_900, 99_999, 0, 100_000, 100_000].map(Some);
        assert_eq!((&all[..6], &all[6..]), (&good[..], &[None; 7][..]));
        assert!(matches!(Of::named("p99.95"), Some(Of::Percentile(99_950))));
        assert!(matches!(Of::named("magnitude_p5"), Some(Of::Magnitude(5_000))));
        assert!(["p", "q99", "magnitude", "max.max", "P99"].iter().all(|name| Of::named(name).is_none()));
    }

    #[test]
    fn listed_percentiles_are_what_their_names_say() {
        for row in STATISTICS {
            let said = row.name.strip_prefix("magnitude_p").or(row.name.strip_prefix('p')).and_then(thousandths);
            let is = match row.of {
                Of::Percentile(p) | Of::Magnitude(p) => Some(p),
                _ => None,
            };
            assert_eq!(said, is, "{}", row.name);
        }
    }

    #[test]
    fn every_statistic_is_the_histogram_s() {
        let mut histogram = Histogram::new(Span::from_us(1), true);
        for row in STATISTICS {
            let value = row.of.of(&histogram);
            assert_eq!(value, matches!(row.of, Of::Count(_)).then_some(Value::Count(0)), "{}", row.name);
        }
        for ticks in [-20, 1, 2, 3, 100_000] {
            histogram.record(Span::from_ticks(ticks));
        }
        let of = |name: &str| Of::named(name).unwrap().of(&histogram);
        let span = |ticks| Some(Value::Span(Span::from_ticks(ticks)));
        assert_eq!([of("count"), of("out_of_range")], [Some(Value::Count(5)), Some(Value::Count(1))]);
        assert_eq!([of("min"), of("p50"), of("max")], [span(-20), span(2), span(100_000)]);
        assert_eq!(
            [of("magnitude_p80"), of("magnitude_max"), of("farthest")],
            [span(20), span(100_000), span(100_000)]
        );
    }
}
