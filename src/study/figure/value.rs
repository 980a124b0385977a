//! Values: what a figure is, exact, in the unit in which people read it.

use core::cmp::Ordering;
use core::fmt;

use serde::{Deserialize, Serialize};

use crate::study::export::decimal::Decimal;
use crate::study::histogram;
use crate::time::Span;

/// The unit in which people read a figure. It also tells what kind of value it has.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Unit {
    /// A time in nanoseconds.
    Ns,
    /// A time in microseconds.
    Us,
    /// A time in milliseconds.
    Ms,
    /// A time in seconds.
    S,
    /// How often something happened.
    Count,
    /// Steps of a position.
    Steps,
    /// A part of a whole, in percent.
    Share,
    /// True or false.
    Truth,
}

impl Unit {
    /// The unit as a table names it; nothing for a count and for true or false.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Ns => "ns",
            Self::Us => "us",
            Self::Ms => "ms",
            Self::S => "s",
            Self::Steps => "steps",
            Self::Share => "%",
            Self::Count | Self::Truth => "",
        }
    }
    /// The end of the name of a column or key whose numbers have this unit: `_ns`; nothing for a count and for a truth.
    pub const fn suffix(self) -> &'static str {
        match self {
            Self::Ns => "_ns",
            Self::Us => "_us",
            Self::Ms => "_ms",
            Self::S => "_s",
            Self::Steps => "_steps",
            Self::Share => "_percent",
            Self::Count | Self::Truth => "",
        }
    }
    /// What a value of this unit is, with its article.
    pub const fn noun(self) -> &'static str {
        match self {
            Self::Ns | Self::Us | Self::Ms | Self::S => "a time",
            Self::Count => "a count",
            Self::Steps => "a number of steps",
            Self::Share => "a share",
            Self::Truth => "true or false",
        }
    }
    /// Whether it is one of time.
    pub const fn is_time(self) -> bool {
        matches!(self, Self::Ns | Self::Us | Self::Ms | Self::S)
    }
}

/// Grains of a number of steps: billionths.
const GRAINS_OF_A_STEP: f64 = 1e9;
/// Grains of a whole: 10^15, as many digits as a share has.
const GRAINS_OF_A_WHOLE: f64 = 1e15;

/// Grains: whole numbers that values are added up as, so that the order does not matter. A tick of 1/12 ns, one of a
/// count, a billionth of a step, 10^-15 of a share, 1 for true.
impl Unit {
    /// So many grains, or a fraction of one, as a number of this unit.
    pub fn of_grains(self, grains: f64) -> f64 {
        /// Ticks of a nanosecond.
        const NS: f64 = Span::from_ns(1).ticks() as f64;
        grains
            / match self {
                Self::Ns => NS,
                Self::Us => NS * 1e3,
                Self::Ms => NS * 1e6,
                Self::S => NS * 1e9,
                Self::Count | Self::Truth => 1.0,
                Self::Steps => GRAINS_OF_A_STEP,
                Self::Share => GRAINS_OF_A_WHOLE / 100.0,
            }
    }
}

impl From<histogram::Unit> for Unit {
    fn from(unit: histogram::Unit) -> Self {
        match unit {
            histogram::Unit::Ns => Self::Ns,
            histogram::Unit::Us => Self::Us,
        }
    }
}

/// What a figure is. Times and counts are exact; steps and shares are the nearest `f64`, made by one division.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Value {
    /// A time, or an instant since the beginning of the run.
    #[serde(rename = "ticks", with = "ticks")]
    Span(Span),
    /// How often something happened.
    Count(u64),
    /// Steps of a position.
    Steps(f64),
    /// A part of a whole; 1 is all of it.
    Share(f64),
    /// True or false.
    Truth(bool),
}

/// Spans in files: whole ticks of 1/12 ns, so that nothing is lost.
mod ticks {
    use serde::{Deserialize, Deserializer, Serializer};

    use crate::time::Span;

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde asks for")]
    pub(super) fn serialize<S: Serializer>(span: &Span, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_i64(span.ticks())
    }
    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Span, D::Error> {
        i64::deserialize(deserializer).map(Span::from_ticks)
    }
}

impl Value {
    /// The value as a number of `unit`: times to the picosecond, true as 1. A value of another kind is given in the unit
    /// of its own kind.
    pub fn number(self, unit: Unit) -> f64 {
        match (self, unit) {
            (Self::Span(span), Unit::Us) => Decimal::us(span).value(),
            (Self::Span(span), Unit::Ms) => Decimal::ms(span).value(),
            (Self::Span(span), Unit::S) => Decimal::s(span).value(),
            (Self::Span(span), _) => Decimal::ns(span).value(),
            (Self::Count(count), _) => count as f64,
            (Self::Steps(steps), _) => steps,
            (Self::Share(share), _) => share * 100.0,
            (Self::Truth(truth), _) => f64::from(u8::from(truth)),
        }
    }
    /// The value in grains; beyond what an `i64` takes, its end.
    pub fn grains(self) -> i64 {
        match self {
            Self::Span(span) => span.ticks(),
            Self::Count(count) => i64::try_from(count).unwrap_or(i64::MAX),
            Self::Steps(steps) => libm::round(steps * GRAINS_OF_A_STEP) as i64,
            Self::Share(share) => libm::round(share * GRAINS_OF_A_WHOLE) as i64,
            Self::Truth(truth) => truth.into(),
        }
    }
    /// The value of a figure of `unit` that has so many grains.
    pub fn of_grains(unit: Unit, grains: i64) -> Self {
        match unit {
            Unit::Ns | Unit::Us | Unit::Ms | Unit::S => Self::Span(Span::from_ticks(grains)),
            Unit::Count => Self::Count(grains.unsigned_abs()),
            Unit::Steps => Self::Steps(grains as f64 / GRAINS_OF_A_STEP),
            Unit::Share => Self::Share(grains as f64 / GRAINS_OF_A_WHOLE),
            Unit::Truth => Self::Truth(grains != 0),
        }
    }
    /// How two values of one kind compare; none for two kinds.
    pub fn compare(self, other: Self) -> Option<Ordering> {
        match (self, other) {
            (Self::Span(a), Self::Span(b)) => Some(a.cmp(&b)),
            (Self::Count(a), Self::Count(b)) => Some(a.cmp(&b)),
            (Self::Steps(a), Self::Steps(b)) | (Self::Share(a), Self::Share(b)) => a.partial_cmp(&b),
            (Self::Truth(a), Self::Truth(b)) => Some(a.cmp(&b)),
            _ => None,
        }
    }
}

/// With its unit: `123.25 ns`, `3`, `0.250 steps`, `99.950 %`, `true`.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Span(span) => span.fmt(f),
            Self::Count(count) => count.fmt(f),
            Self::Steps(steps) => write!(f, "{steps:.3} steps"),
            Self::Share(share) => write!(f, "{:.3} %", share * 100.0),
            Self::Truth(truth) => truth.fmt(f),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VALUES: [Value; 5] = [
        Value::Span(Span::from_ticks(1_479)),
        Value::Count(3),
        Value::Steps(0.25),
        Value::Share(0.9995),
        Value::Truth(true),
    ];

    #[test]
    fn values_are_told_with_their_units() {
        assert_eq!(VALUES.map(|value| value.to_string()), ["123.25 ns", "3", "0.250 steps", "99.950 %", "true"]);
        let units = [Unit::Us, Unit::Count, Unit::Steps, Unit::Share, Unit::Truth];
        let numbers: Vec<_> = VALUES.into_iter().zip(units).map(|(value, unit)| value.number(unit)).collect();
        assert_eq!(numbers, [0.123_25, 3.0, 0.25, 99.95, 1.0]);
        let span = Value::Span(Span::from_us(1_500));
        let in_all = [Unit::Ns, Unit::Us, Unit::Ms, Unit::S].map(|unit| span.number(unit));
        assert_eq!(in_all.to_vec(), [1_500_000.0, 1_500.0, 1.5, 0.001_5]);
    }

    #[test]
    fn grains_lose_nothing() {
        let units = [Unit::Us, Unit::Count, Unit::Steps, Unit::Share, Unit::Truth];
        for (value, unit) in VALUES.into_iter().zip(units) {
            assert_eq!(Value::of_grains(unit, value.grains()), value);
            let (number, expected) = (unit.of_grains(value.grains() as f64), value.number(unit));
            assert!((number - expected).abs() < 1e-9, "{number} and {expected}");
        }
        assert_eq!(Value::Count(u64::MAX).grains(), i64::MAX);
        // A third keeps as many digits as a share is told with.
        let third = Value::of_grains(Unit::Share, Value::Share(1.0 / 3.0).grains());
        assert_eq!(third.to_string(), "33.333 %");
    }

    #[test]
    fn values_survive_a_file() {
        let text = serde_json::to_string(&VALUES).unwrap();
        assert_eq!(text, r#"[{"ticks":1479},{"count":3},{"steps":0.25},{"share":0.9995},{"truth":true}]"#);
        assert_eq!(serde_json::from_str::<Vec<Value>>(&text).unwrap(), VALUES);
    }

    #[test]
    fn only_values_of_one_kind_compare() {
        for (i, a) in VALUES.into_iter().enumerate() {
            for (j, b) in VALUES.into_iter().enumerate() {
                assert_eq!(a.compare(b), (i == j).then_some(Ordering::Equal), "{a} and {b}");
            }
        }
        assert_eq!(Value::Count(2).compare(Value::Count(3)), Some(Ordering::Less));
    }
}
