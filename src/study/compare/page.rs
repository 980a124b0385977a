//! The page of a comparison: the runs, where they parted, and a table of what moved.

use super::command::Before;
use super::{Moved, Parted, Verdict};
use crate::study::baseline::Hashes;
use crate::study::report::aligned;

/// Figures that are shown where not all are asked for.
const SHOWN: usize = 40;
/// Lines of a scenario that are shown.
const LINES: usize = 8;

/// What a page is made of.
pub(super) struct Material<'a> {
    pub(super) scenario: &'a str,
    pub(super) before: &'a Before,
    /// What is another than before in the scenario, in lines.
    pub(super) changes: Vec<String>,
    pub(super) hashes: [&'a Hashes; 2],
    /// None where the hashes of the wire, the states and the latches are the same.
    pub(super) parted: Option<&'a Parted>,
    pub(super) moved: &'a [Moved],
    pub(super) all: bool,
}

pub(super) fn render(material: &Material<'_>) -> String {
    let mut lines = vec![format!("{}: compared with {}", material.scenario, material.before.words())];
    lines.extend(material.changes.iter().cloned());
    let [before, now] = material.hashes.map(Hashes::named);
    let others: Vec<_> =
        before.iter().zip(now).filter(|(before, now)| before.1 != now.1).map(|(_, now)| now.0).collect();
    match others[..] {
        [] => lines.push(format!("fingerprint: the same, {}", material.hashes[1])),
        _ => lines.push(format!("fingerprint: another in {}", others.join(", "))),
    }
    if let Some(parted) = material.parted {
        lines.push(String::new());
        lines.extend(parted.lines());
    }
    lines.push(String::new());
    table(material, &mut lines);
    lines.iter().flat_map(|line| [line.trim_end(), "\n"]).collect()
}

fn table(material: &Material<'_>, lines: &mut Vec<String>) {
    let count = |verdict| material.moved.iter().filter(|moved| moved.verdict() == verdict).count();
    let (within, beyond) = (count(Verdict::Within), count(Verdict::Beyond));
    let total = material.moved.len();
    if within + beyond == 0 {
        lines.push(format!("none of {total} figures moved"));
    } else {
        let beyond = if beyond == 0 { "none".to_owned() } else { beyond.to_string() };
        lines.push(format!("{} of {total} figures moved, {beyond} beyond the tolerance", count_moved(material.moved)));
    }
    let mut rows: Vec<&Moved> =
        material.moved.iter().filter(|moved| material.all || moved.verdict() != Verdict::Same).collect();
    if rows.is_empty() {
        return;
    }
    let left_out = if material.all { 0 } else { rows.len().saturating_sub(SHOWN) };
    if left_out > 0 {
        // Those beyond first, else as they come.
        rows.sort_by_key(|moved| std::cmp::Reverse(moved.verdict()));
        rows.truncate(SHOWN);
    }
    let cells = |moved: &&Moved| {
        let [before, now, change, percent] = moved.cells();
        let tolerance = moved.tolerance.map_or_else(|| "0".to_owned(), |limit| limit.to_string());
        vec![moved.name.clone(), before, now, change, percent, tolerance, moved.verdict().text().to_owned()]
    };
    let rows: Vec<_> = rows.iter().map(cells).collect();
    lines.extend(aligned(&["figure", "before", "now", "change", "", "tolerance", "verdict"], &[0, 6], &rows));
    if left_out > 0 {
        lines.push(format!("and {left_out} more that moved; --all shows every figure"));
    }
}
fn count_moved(moved: &[Moved]) -> usize {
    moved.iter().filter(|moved| moved.verdict() != Verdict::Same).count()
}

/// What is another in a text, line by line, at most a few of them: lines that only one of both has.
pub(super) fn changed_lines(before: &str, now: &str) -> Vec<String> {
    let lines = |text: &str| text.lines().map(|line| line.trim().to_owned()).filter(|line| !line.is_empty()).collect();
    let (mut old, mut new): (Vec<String>, Vec<String>) = (lines(before), lines(now));
    // What both have, as often as both have it, is the same.
    old.retain(|line| new.iter().position(|other| other == line).map(|at| new.remove(at)).is_none());
    let told =
        old.iter().map(|line| format!("  before  {line}")).chain(new.iter().map(|line| format!("  now     {line}")));
    let mut told: Vec<_> = told.collect();
    if told.len() > LINES {
        let more = told.len() - LINES;
        told.truncate(LINES);
        told.push(format!("  and {more} more lines"));
    }
    if before != now {
        told.insert(0, "the scenario file is another than before".to_owned());
    }
    told
}
