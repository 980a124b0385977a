//! Verdicts: what a scenario expects of its figures, held against those of a run.
//!
//! | figure | comparison | `true`, `false` | `"none"` |
//! |---|---|---|---|
//! | has a value | holds or not, with a margin | holds or not | fails |
//! | has no value | fails: no value | fails: no value | holds |
//! | of each subject | holds if it holds for every one; the worst is shown | the same | the same |
//!
//! Verdicts come after the fingerprints of a run and change none of them.

pub mod demand;
pub mod junit;
pub mod page;

pub use demand::{Comparison, Demand, Margin, Relation};

use serde::{Serialize, Serializer};

use super::figure::{Figure, Figures, Subject, Unit, Value, Who};
use crate::wire::Address;

/// What a scenario expects of one figure.
#[derive(Clone, PartialEq, Debug)]
pub struct Expectation {
    /// The figure.
    pub figure: Figure,
    /// What it should be.
    pub demand: Demand,
    /// Why, for who reads a verdict; may be empty.
    pub why: String,
}

/// What became of one expectation.
#[derive(Clone, PartialEq, Debug)]
pub struct Verdict {
    /// Name of the figure.
    pub figure: String,
    /// What it should be.
    pub expected: String,
    /// The unit in which people read it.
    pub unit: Unit,
    /// What it is; of several the worst. None if it has no value.
    pub measured: Option<Value>,
    /// Whose value that is, of a figure of each subject.
    pub subject: Option<Subject>,
    /// How many others fail too.
    pub others: usize,
    /// Room to the nearest limit, below zero where it is broken.
    pub margin: Option<Margin>,
    /// The same as a share of that limit (percent).
    pub margin_percent: Option<f64>,
    /// Whether the expectation holds.
    pub passed: bool,
    /// Why it is expected.
    pub why: String,
    /// A cycle worth a look where it does not hold.
    pub cycle: Option<u64>,
}

/// Holds `expectations` against the figures of a run, in their order.
pub fn judge(expectations: &[Expectation], figures: &Figures) -> Vec<Verdict> {
    expectations.iter().map(|expectation| expectation.judge(figures)).collect()
}

impl Expectation {
    /// Holds this against the figures of a run.
    pub fn judge(&self, figures: &Figures) -> Verdict {
        let values = figures.values(&self.figure);
        let failing = values.iter().filter(|(_, value)| !self.demand.holds(*value)).count();
        let (subject, measured) = self.worst(&values);
        let (margin, margin_percent) = self.demand.margin(measured).unzip();
        let about = subject.or(match self.figure.who() {
            Who::One(subject) => Some(subject),
            _ => None,
        });
        Verdict {
            figure: self.figure.name().to_owned(),
            expected: self.demand.to_string(),
            unit: self.figure.unit(),
            measured,
            subject,
            others: failing.saturating_sub(1),
            margin,
            margin_percent: margin_percent.flatten(),
            passed: failing == 0,
            why: self.why.clone(),
            cycle: (failing > 0).then(|| cycle(figures, about)),
        }
    }
    /// What is worst for this: a missing value, then the smallest margin of those that fail, then of those that hold.
    fn worst(&self, values: &[(Option<Subject>, Option<Value>)]) -> (Option<Subject>, Option<Value>) {
        let rank = |value: Option<Value>| {
            let margin = self.demand.margin(value).map_or(0.0, |(margin, _)| margin.number(Unit::Ns));
            (self.demand.holds(value), value.is_some(), margin)
        };
        let worst = values.iter().min_by(|a, b| {
            let (a, b) = (rank(a.1), rank(b.1));
            (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2))
        });
        worst.copied().unwrap_or((None, None))
    }
}

/// Where to look first: the first fault of the subject, or the last change of its state, or the end of the run.
fn cycle(figures: &Figures, about: Option<Subject>) -> u64 {
    let is_meant = |address: Address| match about {
        Some(Subject::Slave(slave) | Subject::Station(slave)) => slave == address,
        Some(Subject::Link(publisher, subscriber)) => [publisher, subscriber].contains(&address),
        _ => true,
    };
    let slaves = || figures.counts().slaves.iter().filter(|slave| is_meant(slave.address));
    let fault = slaves().filter_map(|slave| slave.first_fault).map(|moment| moment.cycle).min();
    let change = || slaves().filter_map(|slave| slave.last_change).map(|moment| moment.cycle).max();
    fault.or_else(change).unwrap_or_else(|| figures.counts().network.cycles.saturating_sub(1))
}

/// A verdict as other programs read it: numbers in the unit that is named beside them.
#[derive(Serialize)]
struct Written<'a> {
    figure: &'a str,
    expected: &'a str,
    unit: &'static str,
    measured: Option<Number>,
    #[serde(skip_serializing_if = "Option::is_none")]
    subject: Option<String>,
    #[serde(skip_serializing_if = "is_zero")]
    others_failing: usize,
    margin: Option<f64>,
    margin_percent: Option<f64>,
    passed: bool,
    #[serde(skip_serializing_if = "str::is_empty")]
    why: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    cycle: Option<u64>,
}

/// A value as JSON has it.
#[derive(Serialize)]
#[serde(untagged)]
enum Number {
    Count(u64),
    Truth(bool),
    Decimal(f64),
}

impl Serialize for Verdict {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let number = |value: Value| match value {
            Value::Count(count) => Number::Count(count),
            Value::Truth(truth) => Number::Truth(truth),
            value => Number::Decimal(value.number(self.unit)),
        };
        let written = Written {
            figure: &self.figure,
            expected: &self.expected,
            unit: self.unit.text(),
            measured: self.measured.map(number),
            subject: self.subject.map(|subject| subject.to_string()),
            others_failing: self.others,
            margin: self.margin.map(|margin| margin.number(self.unit)),
            margin_percent: self.margin_percent,
            passed: self.passed,
            why: &self.why,
            cycle: self.cycle,
        };
        written.serialize(serializer)
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde asks for")]
const fn is_zero(count: &usize) -> bool {
    *count == 0
}
