//! Summary of the steady state, for the screen and `summary.json`.

use serde::Serialize;

use super::{Bounded, CONFIDENCE, SteadyState, Values};
use crate::study::export::decimal::{ms, ns, ns_or_null};
use crate::study::histogram::{Histograms, QUANTITIES, Subject};
use crate::study::statistics::steady_state::Condition;
use crate::study::summary::map;
use crate::time::Span;
use crate::wire::Address;

/// Slaves of which the page says that something is missing.
const NAMED: usize = 4;

/// When the steady state began, and what the cycles of it come to.
#[derive(Clone, Debug, Serialize)]
pub struct SteadySummary {
    /// Whether there is one; without it the rest of this is left out.
    pub reached: bool,
    /// What keeps it from being one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<String>,
    /// The steady state itself.
    #[serde(flatten)]
    pub state: Option<SteadyCycles>,
}

/// The cycles of the steady state.
#[derive(Clone, Debug, Serialize)]
pub struct SteadyCycles {
    /// The first one.
    pub begin_cycle: u64,
    /// When that began, in true time since power-on.
    #[serde(rename = "begin_ms", serialize_with = "ms")]
    pub begin: Span,
    /// What came last.
    pub last: Option<String>,
    /// How many there are.
    pub cycles: u64,
    /// Faults that slaves latched in them.
    pub faults: u64,
    /// At least so many cycles for each fault: the reciprocal of the upper bound of the probability that a cycle has one.
    pub cycles_per_fault_min: u64,
    /// Confidence of all bounds.
    pub confidence: String,
    /// Every quantity of every subject, by the name of its figures without `steady.`.
    #[serde(serialize_with = "map")]
    pub quantities: Vec<(String, SteadyQuantity)>,
}

/// One quantity of one subject.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SteadyQuantity {
    /// Values.
    pub count: u64,
    /// Mean.
    #[serde(rename = "mean_ns", serialize_with = "ns")]
    pub mean: Span,
    /// Its bounds by batch means.
    #[serde(rename = "mean_low_ns", serialize_with = "ns_or_null")]
    pub mean_low: Option<Span>,
    /// The upper one.
    #[serde(rename = "mean_high_ns", serialize_with = "ns_or_null")]
    pub mean_high: Option<Span>,
    /// 99th percentile; of a quantity with a sign that of its magnitude.
    #[serde(rename = "p99_ns", serialize_with = "ns")]
    pub p99: Span,
    /// Its bounds by order statistics.
    #[serde(rename = "p99_low_ns", serialize_with = "ns_or_null")]
    pub p99_low: Option<Span>,
    /// The upper one.
    #[serde(rename = "p99_high_ns", serialize_with = "ns_or_null")]
    pub p99_high: Option<Span>,
    /// Whether the run is too short for bounds of this width.
    pub correlated: bool,
}

impl SteadyQuantity {
    fn of(values: &Values, signed: bool) -> Option<Self> {
        let mean = values.mean()?;
        let p99 = if signed { values.magnitude_percentile(99.0) } else { values.percentile(99.0) }?;
        Some(Self {
            count: values.count(),
            mean: mean.estimate,
            mean_low: mean.low,
            mean_high: mean.high,
            p99: p99.estimate,
            p99_low: p99.low,
            p99_high: p99.high,
            correlated: values.is_correlated(),
        })
    }
    fn mean(&self) -> Bounded {
        Bounded { estimate: self.mean, low: self.mean_low, high: self.mean_high }
    }
    fn p99(&self) -> Bounded {
        Bounded { estimate: self.p99, low: self.p99_low, high: self.p99_high }
    }
}

/// Begin of the names of a subject's figures.
fn begin(subject: Subject) -> String {
    match subject {
        Subject::Network => String::new(),
        Subject::Slave(address) => format!("slave.{address}."),
        Subject::Link(publisher, subscriber) => format!("link.{publisher}-{subscriber}."),
    }
}

fn slave((address, condition): (Address, Condition)) -> String {
    format!("{condition} of slave {address}")
}

impl SteadySummary {
    /// The summary after a run in which `histograms` recorded.
    pub fn of(steady: &SteadyState, histograms: &Histograms) -> Self {
        let Some(found) = steady.begin() else {
            return Self { reached: false, missing: steady.missing().map(slave).collect(), state: None };
        };
        let quantity = |name: &str, subject, signed| {
            let values = steady.values(name, subject, histograms)?;
            Some((begin(subject) + name, SteadyQuantity::of(&values, signed)?))
        };
        let subjects = |(name, signed, subjects): (&'static str, bool, Vec<Subject>)| {
            subjects.into_iter().filter_map(move |subject| quantity(name, subject, signed)).collect::<Vec<_>>()
        };
        let all = QUANTITIES.iter().map(|row| (row.name, row.signed, row.subjects(histograms.layout())));
        let state = SteadyCycles {
            begin_cycle: found.cycle,
            begin: found.at.since_zero(),
            last: found.last.map(slave),
            cycles: found.cycles,
            faults: found.faults,
            cycles_per_fault_min: (1.0 / found.chance().bounds().1) as u64,
            confidence: CONFIDENCE.to_string(),
            quantities: all.flat_map(subjects).collect(),
        };
        Self { reached: true, missing: Vec::new(), state: Some(state) }
    }

    /// The lines of the page.
    pub fn lines(&self) -> Vec<String> {
        let Some(state) = &self.state else {
            let named = self.missing.iter().take(NAMED).map(String::as_str).collect::<Vec<_>>().join(", ");
            let more = match self.missing.len().saturating_sub(NAMED) {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            let what = if named.is_empty() { "the run ends too early".to_owned() } else { format!("without {named}") };
            return vec![format!("no steady state: {what}{more}")];
        };
        let last = state.last.as_ref().map_or_else(String::new, |last| format!(", {last} came last"));
        let faults = match state.faults {
            0 => {
                let fewest = state.cycles_per_fault_min;
                format!("no fault in them: at {} fewer than one in {fewest} (rule of three)", state.confidence)
            }
            1 => "1 fault in them".to_owned(),
            faults => format!("{faults} faults in them"),
        };
        let cycles = state.cycles;
        let mut lines = vec![format!(
            "steady state from cycle {}, {}{last}; {cycles} cycles, {faults}",
            state.begin_cycle, state.begin
        )];
        let of = |name: &str| state.quantities.iter().find(|quantity| quantity.0 == name).map(|quantity| quantity.1);
        let told = |title: &str, quantity: SteadyQuantity, p99: &str| {
            let short = if quantity.correlated { ", in truth wider: the run is short" } else { "" };
            format!("  {title}: mean {}, {p99} {}{short}", bounded(quantity.mean()), bounded(quantity.p99()))
        };
        lines.extend(of("latch_skew").map(|skew| told("latch skew", skew, "p99")));
        let errors = state.quantities.iter().filter(|(name, _)| name.ends_with(".pll_error"));
        // The first of the largest.
        let worst = errors.rev().max_by_key(|(_, error)| error.p99);
        let address = |name: &str| name.split('.').nth(1).unwrap_or_default().to_owned();
        let title = |name: &str| format!("largest PLL error, slave {}", address(name));
        lines.extend(worst.map(|(name, error)| told(&title(name), *error, "magnitude p99")));
        lines
    }
}

/// `90 ns (89 ns to 91 ns)`.
fn bounded(value: Bounded) -> String {
    match (value.low, value.high) {
        (None, None) => value.estimate.to_string(),
        (Some(low), Some(high)) => format!("{} ({low} to {high})", value.estimate),
        (Some(low), None) => format!("{} (at least {low})", value.estimate),
        (None, Some(high)) => format!("{} (at most {high})", value.estimate),
    }
}
