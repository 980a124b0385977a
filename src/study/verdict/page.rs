//! The page of verdicts: a table of what was expected and what became of it.

use super::Verdict;
use super::demand::NONE;
use crate::study::report::{aligned, number};

/// Titles over [`cells`].
const HEADER: &[&str] = &["expectation", "expected", "measured", "margin", "verdict"];

/// The table of verdicts, why those that fail were expected, and a line for all; nothing where nothing was expected.
pub fn lines(verdicts: &[Verdict]) -> Vec<String> {
    if verdicts.is_empty() {
        return Vec::new();
    }
    let rows: Vec<_> = verdicts.iter().map(cells).collect();
    let mut lines = aligned(HEADER, &[0, 1, 2, 3, 4], &rows);
    let failed = || verdicts.iter().filter(|verdict| !verdict.passed);
    let reasons = failed().filter(|verdict| !verdict.why.is_empty());
    lines.extend(reasons.map(|verdict| format!("{}: {}", verdict.figure, verdict.why)));
    let all = number(verdicts.len(), "expectation");
    lines.push(match failed().count() {
        0 if verdicts.len() == 1 => "the expectation holds".to_owned(),
        0 => format!("all {all} hold"),
        failed => format!("{failed} of {all} FAIL"),
    });
    lines
}

/// One line of the table.
fn cells(verdict: &Verdict) -> Vec<String> {
    let margin = match (verdict.margin, verdict.margin_percent) {
        (Some(margin), Some(percent)) => format!("{margin} ({percent:.1} %)"),
        (Some(margin), None) => margin.to_string(),
        (None, _) => "-".to_owned(),
    };
    let word = if verdict.passed { "pass" } else { "FAIL" };
    vec![verdict.figure.clone(), verdict.expected.clone(), measured(verdict), margin, word.to_owned()]
}

/// What was measured, and where: `17.2 ms at slave 5 and 2 more`.
pub(super) fn measured(verdict: &Verdict) -> String {
    let value = match verdict.measured {
        Some(value) => value.to_string(),
        // What should not have one is as it should be.
        None if verdict.passed => NONE.to_owned(),
        None => "no value".to_owned(),
    };
    let place = verdict.subject.map_or_else(String::new, |subject| format!(" at {subject}"));
    let more = if verdict.others > 0 { format!(" and {} more", verdict.others) } else { String::new() };
    value + &place + &more
}
