//! Moved: what became of each figure from one run to another.

use super::tolerance::{Limit, Tolerances};
use crate::study::figure::Value;

/// What a figure's tolerance says of its move.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Verdict {
    /// It did not move.
    Same,
    /// It moved, as far as it may.
    Within,
    /// It moved farther, or has a value where it had none, or the other way round.
    Beyond,
}

impl Verdict {
    /// The word for it.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Same => "same",
            Self::Within => "within",
            Self::Beyond => "BEYOND",
        }
    }
}

/// What one run says of a figure.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Said {
    /// Its network cannot have it.
    NoFigure,
    /// It has no value.
    Nothing,
    /// Its value.
    Value(Value),
}

impl Said {
    fn value(self) -> Option<Value> {
        if let Self::Value(value) = self { Some(value) } else { None }
    }
}
impl From<Option<Value>> for Said {
    fn from(value: Option<Value>) -> Self {
        value.map_or(Self::Nothing, Self::Value)
    }
}
impl std::fmt::Display for Said {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoFigure => f.write_str("-"),
            Self::Nothing => f.write_str("none"),
            Self::Value(value) => value.fmt(f),
        }
    }
}

/// One figure in both runs.
#[derive(Clone, PartialEq, Debug)]
pub struct Moved {
    /// Its name.
    pub name: String,
    /// Before.
    pub before: Said,
    /// Now.
    pub now: Said,
    /// By how much it may move; none is by nothing.
    pub tolerance: Option<Limit>,
}

impl Moved {
    /// What became of it.
    pub fn verdict(&self) -> Verdict {
        if self.before == self.now {
            return Verdict::Same;
        }
        match (self.before.value(), self.now.value(), self.tolerance) {
            (Some(before), Some(now), Some(limit)) if limit.allows(before, now) => Verdict::Within,
            _ => Verdict::Beyond,
        }
    }
    /// Before, now, change and change in percent as texts.
    pub fn cells(&self) -> [String; 4] {
        let both = self.before.value().zip(self.now.value());
        let change = both.and_then(|(before, now)| change(before, now)).unwrap_or_default();
        let percent = both.and_then(|(before, now)| percent(before, now)).unwrap_or_default();
        [self.before.to_string(), self.now.to_string(), change, percent]
    }
}

/// The change with its sign and unit.
fn change(before: Value, now: Value) -> Option<String> {
    let signed = |negative: bool, text: String| if negative { text } else { format!("+{text}") };
    match (before, now) {
        (Value::Span(before), Value::Span(now)) => {
            let change = now - before;
            Some(signed(change.ticks() < 0, change.to_string()))
        }
        (Value::Count(before), Value::Count(now)) => {
            let change = i128::from(now) - i128::from(before);
            Some(signed(change < 0, change.to_string()))
        }
        (Value::Steps(before), Value::Steps(now)) => Some(signed(now < before, Value::Steps(now - before).to_string())),
        (Value::Share(before), Value::Share(now)) => Some(signed(now < before, Value::Share(now - before).to_string())),
        _ => None,
    }
}
/// The change in percent of the magnitude before; none of nothing.
fn percent(before: Value, now: Value) -> Option<String> {
    let numbers = |before: f64, now: f64| (before != 0.0).then(|| (now - before) / before.abs() * 100.0);
    let percent = match (before, now) {
        (Value::Span(before), Value::Span(now)) => numbers(before.ticks() as f64, now.ticks() as f64),
        (Value::Count(before), Value::Count(now)) => numbers(before as f64, now as f64),
        (Value::Steps(before), Value::Steps(now)) | (Value::Share(before), Value::Share(now)) => numbers(before, now),
        _ => None,
    }?;
    Some(if percent.abs() < 0.005 { "~0 %".to_owned() } else { format!("{percent:+.2} %") })
}

/// The figures of both runs side by side, in the order of `now`, then those that only `before` has.
pub fn side_by_side(
    before: &[(String, Option<Value>)],
    now: &[(String, Option<Value>)],
    tolerances: &Tolerances,
) -> Vec<Moved> {
    let mut old: std::collections::BTreeMap<&str, Option<Value>> =
        before.iter().map(|(name, value)| (name.as_str(), *value)).collect();
    let moved = |name: &str, before: Said, now: Said| {
        let value = now.value().or(before.value());
        let tolerance = value.and_then(|value| tolerances.of(name, value));
        Moved { name: name.to_owned(), before, now, tolerance }
    };
    let had = |before: Option<Option<Value>>| before.map_or(Said::NoFigure, Said::from);
    let mut all: Vec<_> =
        now.iter().map(|(name, value)| moved(name, had(old.remove(name.as_str())), (*value).into())).collect();
    // In the order in which they were.
    let gone = before.iter().filter(|(name, _)| old.contains_key(name.as_str()));
    all.extend(gone.map(|(name, value)| moved(name, (*value).into(), Said::NoFigure)));
    all
}
