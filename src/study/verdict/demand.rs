//! Demands: what a figure should be, read from a text such as `<= 500 ns`.

use core::cmp::Ordering;
use core::fmt;

use crate::study::figure::{Unit, Value};
use crate::study::quantity;
use crate::study::scenario::Fault;
use crate::time::{BitRate, Span};

/// How a value should stand to its limit.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Relation {
    /// `<`
    Below,
    /// `<=`
    AtMost,
    /// `==`
    Equal,
    /// `!=`
    Unequal,
    /// `>=`
    AtLeast,
    /// `>`
    Above,
}

impl Relation {
    /// Every relation; a sign comes before those that it begins with.
    const ALL: [(&'static str, Self); 6] = [
        ("<=", Self::AtMost),
        (">=", Self::AtLeast),
        ("==", Self::Equal),
        ("!=", Self::Unequal),
        ("<", Self::Below),
        (">", Self::Above),
    ];

    /// Its sign.
    pub fn sign(self) -> &'static str {
        Self::ALL.iter().find(|row| row.1 == self).map_or("", |row| row.0)
    }
    /// Whether values that compare as `ordering` stand so.
    const fn holds(self, ordering: Ordering) -> bool {
        match self {
            Self::Below => ordering.is_lt(),
            Self::AtMost => ordering.is_le(),
            Self::Equal => ordering.is_eq(),
            Self::Unequal => ordering.is_ne(),
            Self::AtLeast => ordering.is_ge(),
            Self::Above => ordering.is_gt(),
        }
    }
}

/// A relation and its limit.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Comparison {
    /// How.
    pub relation: Relation,
    /// With what.
    pub limit: Value,
}

/// How far a value is from breaking a comparison, in the unit of both; below zero where it is broken.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Margin {
    /// Of times.
    Span(Span),
    /// Of counts.
    Count(i128),
    /// Of steps.
    Steps(f64),
    /// Of shares.
    Share(f64),
}

impl Margin {
    /// As a number of `unit`.
    pub fn number(self, unit: Unit) -> f64 {
        match self {
            Self::Span(span) => Value::Span(span).number(unit),
            Self::Count(count) => count as f64,
            Self::Steps(steps) => steps,
            Self::Share(share) => share * 100.0,
        }
    }
}

impl fmt::Display for Margin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Span(span) => span.fmt(f),
            Self::Count(count) => count.fmt(f),
            Self::Steps(steps) => Value::Steps(steps).fmt(f),
            Self::Share(share) => Value::Share(share).fmt(f),
        }
    }
}

impl Comparison {
    /// Reads a comparison with a value of `unit`; at `rate` a time can be written in bit times.
    ///
    /// # Errors
    /// There is no sign, the unit does not fit, or no value can stand so to the limit.
    pub(in crate::study) fn read(text: &str, unit: Unit, rate: BitRate) -> Result<Self, Fault> {
        let trimmed = text.trim();
        let found =
            Relation::ALL.into_iter().find_map(|(sign, relation)| Some((relation, trimmed.strip_prefix(sign)?)));
        let (relation, limit) = found.ok_or_else(|| {
            Fault::new(format!("\"{trimmed}\" begins with no comparison")).help(format!(
                "write one of <, <=, ==, !=, >=, > and {}, such as \"{}\"",
                unit.noun(),
                example(unit)
            ))
        })?;
        Ok(Self { relation, limit: limit_of(limit.trim(), unit, rate)? })
    }
    /// Whether `value` is as it should be.
    pub fn holds(&self, value: Value) -> bool {
        value.compare(self.limit).is_some_and(|ordering| self.relation.holds(ordering))
    }
    /// How far `value` is from breaking this; none where there is no such distance.
    pub fn margin(&self, value: Value) -> Option<Margin> {
        let room = match (self.limit, value) {
            (Value::Span(limit), Value::Span(value)) => Margin::Span(limit - value),
            (Value::Count(limit), Value::Count(value)) => Margin::Count(i128::from(limit) - i128::from(value)),
            (Value::Steps(limit), Value::Steps(value)) => Margin::Steps(limit - value),
            (Value::Share(limit), Value::Share(value)) => Margin::Share(limit - value),
            _ => return None,
        };
        let value_is_limit = value.compare(self.limit) == Some(Ordering::Equal);
        match self.relation {
            Relation::Below | Relation::AtMost => Some(room),
            Relation::Above | Relation::AtLeast => Some(room.turned()),
            Relation::Equal if value_is_limit => None,
            Relation::Equal => Some(if room.is_negative() { room } else { room.turned() }),
            Relation::Unequal => None,
        }
    }
}

impl Margin {
    fn turned(self) -> Self {
        match self {
            Self::Span(span) => Self::Span(-span),
            Self::Count(count) => Self::Count(-count),
            // Not -0.
            Self::Steps(steps) => Self::Steps(0.0 - steps),
            Self::Share(share) => Self::Share(0.0 - share),
        }
    }
    fn is_negative(self) -> bool {
        self.number(Unit::Ns) < 0.0
    }
}

/// With its sign: `<= 500 ns`.
impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.relation.sign(), self.limit)
    }
}

/// A good comparison for a value of `unit`.
const fn example(unit: Unit) -> &'static str {
    match unit {
        Unit::Ns | Unit::Us => "<= 500 ns",
        Unit::Ms => "<= 20 ms",
        Unit::S => "<= 1.5 s",
        Unit::Count => "== 0",
        Unit::Steps => "<= 0.5 steps",
        Unit::Share => ">= 99.9 %",
        Unit::Truth => "true",
    }
}

/// Reads a limit.
fn limit_of(text: &str, unit: Unit, rate: BitRate) -> Result<Value, Fault> {
    let bad =
        || Fault::new(format!("\"{text}\" is not {}", unit.noun())).help(format!("for example \"{}\"", example(unit)));
    let number = |word: &str| {
        let number: f64 = text.strip_suffix(word)?.trim_end().parse().ok()?;
        number.is_finite().then_some(number)
    };
    match unit {
        Unit::Count => text.replace('_', "").parse().map(Value::Count).map_err(|_| bad().rule("a count has no unit")),
        Unit::Steps => number("steps").or_else(|| number("step")).map(Value::Steps).ok_or_else(bad),
        Unit::Share => number("%").map(|percent| Value::Share(percent / 100.0)).ok_or_else(bad),
        Unit::Truth => Err(bad().help("write true or false")),
        Unit::Ns | Unit::Us | Unit::Ms | Unit::S => {
            let span = quantity::span(text, Some(rate)).map_err(|error| Fault::new(error.to_string()))?;
            Ok(Value::Span(span))
        }
    }
}

/// What a figure should be.
#[derive(Clone, PartialEq, Debug)]
pub enum Demand {
    /// Every one of these comparisons.
    Compare(Vec<Comparison>),
    /// True, or false.
    Truth(bool),
    /// Without value: it did not happen.
    Absent,
}

/// The word for a figure without value.
pub const NONE: &str = "none";

impl Demand {
    /// Whether `value` is what it should be.
    pub fn holds(&self, value: Option<Value>) -> bool {
        match (self, value) {
            (Self::Absent, value) => value.is_none(),
            (Self::Truth(wanted), value) => value == Some(Value::Truth(*wanted)),
            (Self::Compare(all), Some(value)) => all.iter().all(|comparison| comparison.holds(value)),
            (Self::Compare(_), None) => false,
        }
    }
    /// The smallest margin of its comparisons, with its share of the limit (percent) where that is not zero.
    pub fn margin(&self, value: Option<Value>) -> Option<(Margin, Option<f64>)> {
        let (Self::Compare(all), Some(value)) = (self, value) else { return None };
        let of = |comparison: &Comparison| {
            let margin = comparison.margin(value)?;
            let limit = comparison.limit.number(Unit::Ns).abs();
            Some((margin, (limit > 0.0).then(|| margin.number(Unit::Ns) / limit * 100.0)))
        };
        all.iter().filter_map(of).min_by(|a, b| a.0.number(Unit::Ns).total_cmp(&b.0.number(Unit::Ns)))
    }
    /// Whether any value can be as demanded; below zero only if `signed`.
    pub(in crate::study) fn can_hold(&self, signed: bool) -> bool {
        let Self::Compare(all) = self else { return true };
        // Where something fits at all, something next to a limit fits.
        let near = |comparison: &Comparison| match comparison.limit {
            Value::Span(span) => [-1, 0, 1].map(|by| Value::Span(span + Span::from_ticks(by))),
            Value::Count(count) => [count.saturating_sub(1), count, count.saturating_add(1)].map(Value::Count),
            Value::Steps(steps) => around(steps).map(Value::Steps),
            Value::Share(share) => around(share).map(Value::Share),
            truth @ Value::Truth(_) => [truth; 3],
        };
        let is_value = |value: &Value| match *value {
            Value::Span(span) => signed || span >= Span::ZERO,
            Value::Steps(number) => number >= 0.0,
            Value::Share(share) => (0.0..=1.0).contains(&share),
            Value::Count(_) | Value::Truth(_) => true,
        };
        all.iter().flat_map(near).filter(is_value).any(|value| self.holds(Some(value)))
    }
}

/// `number` and a little less and more.
fn around(number: f64) -> [f64; 3] {
    let little = number.abs() * 1e-9 + 1e-12;
    [number - little, number, number + little]
}

/// `>= 90 us, < 110 us`, `true`, `none`.
impl fmt::Display for Demand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Compare(all) => {
                let all: Vec<_> = all.iter().map(ToString::to_string).collect();
                f.write_str(&all.join(", "))
            }
            Self::Truth(truth) => truth.fmt(f),
            Self::Absent => f.write_str(NONE),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, unit: Unit) -> Comparison {
        Comparison::read(text, unit, BitRate::M12).unwrap_or_else(|fault| panic!("{text}: {}", fault.message))
    }
    fn demand(texts: &[&str], unit: Unit) -> Demand {
        Demand::Compare(texts.iter().map(|text| read(text, unit)).collect())
    }
    const fn ns(ns: i64) -> Value {
        Value::Span(Span::from_ns(ns))
    }

    #[test]
    fn every_comparison_in_every_unit() {
        // Of each unit a limit, a value below, the limit, and a value above.
        let units = [
            (Unit::Ns, "1 us", [ns(999), ns(1_000), ns(1_001)]),
            (Unit::Us, "12 tbit", [ns(999), ns(1_000), ns(1_001)]),
            (Unit::Ms, "0.001 ms", [ns(999), ns(1_000), ns(1_001)]),
            (Unit::S, "1000 ns", [ns(999), ns(1_000), ns(1_001)]),
            (Unit::Count, "1_000", [999, 1_000, 1_001].map(Value::Count)),
            (Unit::Steps, "0.5 steps", [0.4, 0.5, 0.6].map(Value::Steps)),
            (Unit::Share, "50 %", [0.4, 0.5, 0.6].map(Value::Share)),
        ];
        let relations = [
            ("<", [true, false, false]),
            ("<=", [true, true, false]),
            ("==", [false, true, false]),
            ("!=", [true, false, true]),
            (">=", [false, true, true]),
            (">", [false, false, true]),
        ];
        for (unit, limit, values) in units {
            for (sign, expected) in relations {
                for text in [format!("{sign} {limit}"), format!("  {sign}{limit} ")] {
                    let comparison = read(&text, unit);
                    assert_eq!(values.map(|value| comparison.holds(value)), expected, "{text}");
                    assert_eq!(read(&comparison.to_string(), unit), comparison, "{comparison}");
                }
            }
        }
    }

    #[test]
    fn margins_are_room_to_the_limit() {
        let of = |text: &str, unit, value| demand(&[text], unit).margin(Some(value)).map(|(m, p)| (m.to_string(), p));
        let some = |text: &str, percent| Some((text.to_owned(), percent));
        assert_eq!(of("<= 500 ns", Unit::Ns, ns(400)), some("100 ns", Some(20.0)));
        assert_eq!(of("< 500 ns", Unit::Ns, ns(600)), some("-100 ns", Some(-20.0)));
        assert_eq!(of(">= 500 ns", Unit::Ns, ns(400)), some("-100 ns", Some(-20.0)));
        assert_eq!(of("> -500 ns", Unit::Ns, ns(-400)), some("100 ns", Some(20.0)));
        assert_eq!(of("== 0", Unit::Count, Value::Count(3)), some("-3", None));
        assert_eq!(of("== 5", Unit::Count, Value::Count(3)), some("-2", Some(-40.0)));
        assert_eq!(of("== 5", Unit::Count, Value::Count(5)), None, "as it should be, and no room at all");
        assert_eq!(of("!= 0", Unit::Count, Value::Count(5)), None);
        assert_eq!(of("<= 0.5 steps", Unit::Steps, Value::Steps(0.25)), some("0.250 steps", Some(50.0)));
        assert_eq!(of(">= 99 %", Unit::Share, Value::Share(0.99)), some("0.000 %", Some(0.0)));
        let both = demand(&[">= 90 us", "< 110 us"], Unit::Us);
        let margin = |us| both.margin(Some(Value::Span(Span::from_us(us)))).unwrap().0.to_string();
        assert_eq!([95, 108, 80].map(margin), ["5 us", "2 us", "-10 us"]);
        assert_eq!((both.margin(None), both.to_string()), (None, ">= 90 us, < 110 us".to_owned()));
        assert_eq!(Demand::Truth(true).margin(Some(Value::Truth(false))), None);
    }

    #[test]
    fn only_absence_is_content_without_value() {
        for (demand, none, zero) in [
            (Demand::Absent, true, false),
            (Demand::Truth(false), false, false),
            (demand(&["!= 7"], Unit::Count), false, true),
        ] {
            assert_eq!((demand.holds(None), demand.holds(Some(Value::Count(0)))), (none, zero), "{demand}");
        }
        assert!(Demand::Truth(false).holds(Some(Value::Truth(false))));
        assert!(!Demand::Truth(true).holds(Some(Value::Truth(false))));
    }

    #[test]
    fn what_no_value_can_be_is_found() {
        for (texts, unit, signed, can) in [
            (&["< 0 ns"][..], Unit::Ns, false, false),
            (&["< 0 ns"], Unit::Ns, true, true),
            (&["<= 0 ns"], Unit::Ns, false, true),
            (&["< 0"], Unit::Count, false, false),
            (&["> 1", "< 3"], Unit::Count, false, true),
            (&["> 1", "< 2"], Unit::Count, false, false),
            (&["== 1", "!= 1"], Unit::Count, false, false),
            (&[">= 90 us", "< 90 us"], Unit::Us, false, false),
            (&["> 0.5 steps", "< 0.6 steps"], Unit::Steps, false, true),
            (&["> 100 %"], Unit::Share, false, false),
            (&["== 100 %"], Unit::Share, false, true),
        ] {
            assert_eq!(demand(texts, unit).can_hold(signed), can, "{texts:?}");
        }
        assert!(Demand::Absent.can_hold(false) && Demand::Truth(true).can_hold(false));
    }

    #[test]
    fn wrong_comparisons_are_told() {
        let told = |text, unit| {
            let Fault { message, rule, help } = Comparison::read(text, unit, BitRate::M12).unwrap_err();
            [message, rule, help].join("|")
        };
        for (text, unit, expected) in [
            (
                "500 ns",
                Unit::Ns,
                "\"500 ns\" begins with no comparison||write one of <, <=, ==, !=, >=, > and a time, such as \"<= 500 ns\"",
            ),
            (
                "= 0",
                Unit::Count,
                "\"= 0\" begins with no comparison||write one of <, <=, ==, !=, >=, > and a count, such as \"== 0\"",
            ),
            (
                "<= 500",
                Unit::Ns,
                "\"500\" has no unit; a time has one of the units ns, us, ms, s, min, h, tick, tbit||",
            ),
            ("<= 5 ns", Unit::Count, "\"5 ns\" is not a count|a count has no unit|for example \"== 0\""),
            ("== -1", Unit::Count, "\"-1\" is not a count|a count has no unit|for example \"== 0\""),
            ("<= 5 ns", Unit::Steps, "\"5 ns\" is not a number of steps||for example \"<= 0.5 steps\""),
            ("<= inf %", Unit::Share, "\"inf %\" is not a share||for example \">= 99.9 %\""),
            ("== 1", Unit::Truth, "\"1\" is not true or false||write true or false"),
            ("<=", Unit::Ms, "\"\" is not a time: write a number and a unit, such as \"125 us\"||"),
        ] {
            assert_eq!(told(text, unit), expected, "{text}");
        }
    }
}
