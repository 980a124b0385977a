//! Tolerances: by how much a figure may move. Where nothing is said, by nothing: runs are deterministic.
//!
//! A tolerance is a share of the value before, `5%`, a time, `100 ns`, or a number of whatever the figure counts, `3`. It
//! holds for the figures that its name fits: `*` stands for anything, `slave.each.` for every slave. Of several that fit a
//! figure and its kind of value the last one holds.

use std::fmt;
use std::mem::discriminant;

use crate::study::figure::{Unit, Value};
use crate::study::quantity::span;
use crate::time::Span;

/// Millionths of a percent in the whole.
const WHOLE: i128 = 100_000_000;

/// How far a figure may move.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Limit {
    /// By so many millionths of a percent of the value before.
    Share(u64),
    /// By so much time.
    Span(Span),
    /// By so many of what it counts.
    Number(f64),
}

/// A text that is no tolerance.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{0}")]
pub struct ToleranceError(String);

impl Limit {
    /// Reads `5%`, `0.5 %`, `100 ns`, `3`.
    ///
    /// # Errors
    /// The text is none of these, or negative.
    pub fn parse(text: &str) -> Result<Self, ToleranceError> {
        let error = || ToleranceError(format!("\"{text}\" is no tolerance: write 5%, 100ns or 3"));
        let text = text.trim();
        if let Some(percent) = text.strip_suffix('%') {
            return millionths(percent.trim()).map(Self::Share).ok_or_else(error);
        }
        let plain = !text.is_empty() && text.chars().all(|c| c.is_ascii_digit() || c == '.');
        if plain {
            return text.parse().ok().filter(|number: &f64| number.is_finite()).map(Self::Number).ok_or_else(error);
        }
        match span(text, None) {
            Ok(span) if span >= Span::ZERO => Ok(Self::Span(span)),
            Ok(_) => Err(error()),
            Err(why) => Err(ToleranceError(format!("{}; {why}", error()))),
        }
    }
    /// Whether it can be told of figures with this unit.
    pub const fn fits(self, unit: Unit) -> bool {
        match self {
            Self::Share(_) => !matches!(unit, Unit::Truth),
            Self::Span(_) => unit.is_time(),
            Self::Number(_) => matches!(unit, Unit::Count | Unit::Steps | Unit::Share),
        }
    }
    /// Whether it can be told of this value.
    const fn suits(self, value: Value) -> bool {
        self.fits(match value {
            Value::Span(_) => Unit::Ns,
            Value::Count(_) => Unit::Count,
            Value::Steps(_) => Unit::Steps,
            Value::Share(_) => Unit::Share,
            Value::Truth(_) => Unit::Truth,
        })
    }
    /// Whether a move from `before` to `now` is within it; none where one of them has no value, or another kind.
    pub fn allows(self, before: Value, now: Value) -> bool {
        let whole = |before: i128, now: i128, most: Option<i128>| {
            let moved = (now - before).abs();
            match (self, most) {
                (Self::Share(share), _) => moved * WHOLE <= i128::from(share) * before.abs(),
                (_, Some(most)) => moved <= most,
                (_, None) => moved == 0,
            }
        };
        match (before, now) {
            (Value::Span(before), Value::Span(now)) => {
                let most = if let Self::Span(most) = self { Some(most.ticks().into()) } else { None };
                whole(before.ticks().into(), now.ticks().into(), most)
            }
            (Value::Count(before), Value::Count(now)) => {
                let most = if let Self::Number(most) = self { Some(most as i128) } else { None };
                whole(before.into(), now.into(), most)
            }
            (Value::Steps(before), Value::Steps(now)) => self.allows_number(before, now, 1.0),
            // Told in percent, as the figure is.
            (Value::Share(before), Value::Share(now)) => self.allows_number(before, now, 100.0),
            (before, now) => before == now,
        }
    }
    fn allows_number(self, before: f64, now: f64, scale: f64) -> bool {
        let moved = (now - before).abs();
        match self {
            Self::Share(share) => moved * WHOLE as f64 <= share as f64 * before.abs(),
            Self::Number(most) => moved * scale <= most,
            Self::Span(_) => moved == 0.0,
        }
    }
}

/// A decimal number times a million, if it is one and not negative.
fn millionths(text: &str) -> Option<u64> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, "0"));
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|octet| octet.is_ascii_digit());
    if !digits(whole) || !digits(fraction) || fraction.len() > 6 {
        return None;
    }
    let fraction = format!("{fraction:0<6}").parse::<u64>().ok()?;
    whole.parse::<u64>().ok()?.checked_mul(1_000_000)?.checked_add(fraction)
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Share(share) => {
                let (whole, rest) = (share / 1_000_000, share % 1_000_000);
                let fraction = format!("{rest:06}");
                match fraction.trim_end_matches('0') {
                    "" => write!(f, "{whole}%"),
                    fraction => write!(f, "{whole}.{fraction}%"),
                }
            }
            Self::Span(span) => span.fmt(f),
            Self::Number(number) => number.fmt(f),
        }
    }
}

/// Tolerances by the names that they hold for.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Tolerances(Vec<(String, String, Limit)>);

impl Tolerances {
    /// One more, which goes before those that are there; `name` may have `*`.
    ///
    /// # Errors
    /// `limit` is no tolerance.
    pub fn add(&mut self, name: &str, limit: &str) -> Result<(), ToleranceError> {
        let parsed = Limit::parse(limit)?;
        self.0.retain(|(other, _, old)| other != name || discriminant(old) != discriminant(&parsed));
        self.0.push((name.to_owned(), limit.trim().to_owned(), parsed));
        Ok(())
    }
    /// Names and texts.
    pub fn texts(&self) -> impl Iterator<Item = (&str, &str)> {
        self.0.iter().map(|(name, text, _)| (name.as_str(), text.as_str()))
    }
    /// Names and limits.
    pub fn iter(&self) -> impl Iterator<Item = (&str, Limit)> {
        self.0.iter().map(|(name, _, limit)| (name.as_str(), *limit))
    }
    /// The tolerance of a figure that has such a value; none where nothing is said.
    pub fn of(&self, figure: &str, value: Value) -> Option<Limit> {
        let all = self.0.iter().rev();
        all.map(|(name, _, limit)| (name, *limit))
            .find(|(name, limit)| fits(name, figure) && limit.suits(value))
            .map(|(_, limit)| limit)
    }
}

/// Whether a name with `*`, or `each` between dots, stands for `figure`.
pub(super) fn fits(name: &str, figure: &str) -> bool {
    let name = name.replace(".each.", ".*.");
    let mut parts = name.split('*');
    let Some(mut rest) = figure.strip_prefix(parts.next().unwrap_or_default()) else { return false };
    let parts: Vec<_> = parts.collect();
    let Some((last, between)) = parts.split_last() else { return rest.is_empty() };
    for part in between {
        let Some(at) = rest.find(part) else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limit(text: &str) -> Limit {
        Limit::parse(text).unwrap_or_else(|error| panic!("{error}"))
    }
    fn ns(ns: i64) -> Value {
        Value::Span(Span::from_ns(ns))
    }

    #[test]
    fn tolerances_are_shares_times_or_numbers() {
        for (text, told) in [("5%", "5%"), ("0.5 %", "0.5%"), ("100ns", "100 ns"), ("1.5 us", "1.5 us"), ("3", "3")] {
            assert_eq!(limit(text).to_string(), told);
        }
        for bad in ["", "%", "-5%", "-1 ns", "five", "5 %%", "0.1234567%", "1e3", ".", "1.2.3", "-3", "3 V"] {
            assert!(Limit::parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_limit_itself_is_within() {
        for (text, before, now, within) in [
            ("5%", ns(100), ns(105), true),
            ("5%", ns(100), ns(95), true),
            ("5%", ns(-100), ns(-106), false),
            ("5%", ns(0), ns(1), false),
            ("5%", Value::Count(20), Value::Count(21), true),
            ("5%", Value::Count(20), Value::Count(22), false),
            ("5%", Value::Steps(1.0), Value::Steps(1.04), true),
            ("100 ns", ns(7), ns(107), true),
            ("100 ns", ns(7), ns(108), false),
            ("3", Value::Count(0), Value::Count(3), true),
            ("3", Value::Count(0), Value::Count(4), false),
            ("3", Value::Share(0.5), Value::Share(0.52), true),
            ("3", Value::Share(0.5), Value::Share(0.54), false),
            ("100%", Value::Truth(true), Value::Truth(false), false),
            ("100%", ns(1), Value::Count(1), false),
            ("0%", ns(3), ns(3), true),
        ] {
            assert_eq!(limit(text).allows(before, now), within, "{text}: {before} -> {now}");
        }
    }

    #[test]
    fn names_fit_with_stars_and_each() {
        for (name, figure, yes) in [
            ("cycles", "cycles", true),
            ("cycles", "cycles.max", false),
            ("*", "anything.at.all", true),
            ("slave.*.lock_time", "slave.12.lock_time", true),
            ("slave.each.lock_time", "slave.12.lock_time", true),
            ("slave.*.lock_time", "slave.12.lock_cycles", false),
            ("*.p99", "slave.3.pll_error.p99", true),
            ("*.p99", "slave.3.pll_error.p99.9", false),
            ("*pll*p99", "slave.3.pll_error.magnitude_p99", true),
            ("a*a", "a", false),
        ] {
            assert_eq!(fits(name, figure), yes, "{name} for {figure}");
        }
    }

    #[test]
    fn of_several_the_last_one_holds() {
        let mut all = Tolerances::default();
        for (name, text) in [("*", "1%"), ("slave.*.lock_time", "5 ms"), ("*", "2%")] {
            all.add(name, text).unwrap();
        }
        assert_eq!(all.of("slave.3.lock_time", ns(1)), Some(limit("2%")));
        assert_eq!(all.texts().collect::<Vec<_>>(), [("slave.*.lock_time", "5 ms"), ("*", "2%")]);
        // A time is nothing for a count, so that what was told before holds for it.
        all.add("*", "1 us").unwrap();
        assert_eq!(all.of("slave.3.lock_time", ns(1)), Some(limit("1 us")));
        assert_eq!(all.of("cycles", Value::Count(3)), Some(limit("2%")));
        assert_eq!(all.of("slave.3.in_operation", Value::Truth(true)), None);
        assert!(all.add("x", "much").is_err());
    }
}
