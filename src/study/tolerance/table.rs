//! Table: a row per value that was tried.

use std::path::Path;

use super::outcome::{Outcome, Tried, Why};
use crate::study::export::Staged;
use crate::study::sweep::parameter::named;
use crate::study::sweep::results::Table;
use crate::study::sweep::store::StoreError;

/// Columns behind the value's.
const COLUMNS: [&str; 11] = [
    "verdict",
    "proven",
    "runs",
    "failures",
    "broke_off",
    "share_percent",
    "low_percent",
    "high_percent",
    "failing_seed",
    "failing_cycle",
    "why",
];

/// Writes the table under a temporary name.
///
/// # Errors
/// The file cannot be written.
pub(super) fn write(dir: &Path, name: &str, outcome: &Outcome) -> Result<Staged, StoreError> {
    let mut table = Table::create(dir, name)?;
    let value = named(&outcome.key, outcome.scale.unit());
    table.row(std::iter::once(value).chain(COLUMNS.map(str::to_owned)))?;
    for tried in &outcome.curve {
        table.row(row(outcome, tried).into_iter())?;
    }
    table.finish()
}

fn row(outcome: &Outcome, tried: &Tried) -> Vec<String> {
    let value = outcome.scale.measure(tried.number);
    let number = value.decimal_in(value).unwrap_or_else(|| value.value().to_string());
    let percent = |share: f64| (share * 100.0).to_string();
    let bounds = tried.probability(outcome.demand.confidence).map(|known| known.bounds());
    let failing = tried.failing.as_ref();
    vec![
        number,
        tried.verdict().to_owned(),
        tried.tested.proven.to_string(),
        tried.tested.runs.to_string(),
        tried.tested.failures.to_string(),
        tried.broke_off.to_string(),
        tried.share().map(percent).unwrap_or_default(),
        bounds.map(|(low, _)| percent(low)).unwrap_or_default(),
        bounds.map(|(_, high)| percent(high)).unwrap_or_default(),
        failing.map(|run| run.seed.to_string()).unwrap_or_default(),
        failing.map(|run| run.cycle.to_string()).unwrap_or_default(),
        why(tried).unwrap_or_default(),
    ]
}

/// What is wrong with the first failing run, or with the value, on one line.
pub(super) fn why(tried: &Tried) -> Option<String> {
    if let Some((key, fault)) = &tried.refused {
        return Some(if key.is_empty() { fault.message.clone() } else { format!("{key}: {}", fault.message) });
    }
    let failing = tried.failing.as_ref()?;
    Some(match &failing.why {
        Why::BrokeOff(failure) => failure.reason.lines().next().unwrap_or_default().to_owned(),
        Why::Broken(broken) => {
            let words: Vec<_> =
                broken.iter().map(|verdict| format!("{} {}", verdict.figure, verdict.expected)).collect();
            words.join("; ")
        }
    })
}
