//! The page of all figures: families with their units and what they mean, or the names that one network has.

use super::name::{Figure, Scope};
use super::statistic::STATISTICS;
use super::steady::STEADY;
use super::value::Unit;
use crate::study::layout::Layout;
use crate::study::report::aligned;

/// All families, quantities and statistics.
pub fn list() -> String {
    let mut lines = vec![
        "A figure is what a run recorded or counted, by name: latch_skew.p99, slave.3.lock_time, link.3-11.age.max."
            .into(),
    ];
    for scope in Scope::ALL {
        lines.push(String::new());
        let rows: Vec<_> = scope
            .families()
            .map(|family| [family.name, unit(family.unit), family.what, family.source])
            .chain(scope.quantities().map(|quantity| {
                [quantity.name, unit(quantity.unit.into()), quantity.title, "a distribution, see below"]
            }))
            .map(|[name, unit, what, source]| {
                let name = format!("{}{name}", scope.pattern());
                let name = if source.starts_with("a distribution") { name + ".<statistic>" } else { name };
                vec![name, unit.to_owned(), what.to_owned(), source.to_owned()]
            })
            .collect();
        lines.extend(aligned(&["figure", "unit", "what it is", "source"], &[0, 1, 2, 3], &rows));
    }
    lines.push(String::new());
    let rows: Vec<_> = STATISTICS.iter().map(|row| vec![row.name.to_owned(), row.what.to_owned()]).collect();
    lines.extend(aligned(
        &["statistic", "what it is; any other percentile, p95 or magnitude_p99.99, can be asked too"],
        &[0, 1],
        &rows,
    ));
    lines.push(String::new());
    let rows: Vec<_> = STEADY.iter().map(|row| vec![row.0.to_owned(), row.1.to_owned()]).collect();
    lines.extend(aligned(
        &["steady state", "steady. before a distribution: its values in steady state"],
        &[0, 1],
        &rows,
    ));
    lines.push(String::new());
    lines.push("slave.each., link.each., master.each.: every one of them, each for itself (expectations)".into());
    lines
        .push("slave.min., slave.max. and so on: the smallest or largest; none as soon as one of them has none".into());
    lines.push("the names that a network has: isodp figures FILE".into());
    text(&lines)
}

/// The names that a network of `layout` has.
pub fn of(layout: &Layout) -> String {
    let rows: Vec<_> = Figure::all(layout)
        .iter()
        .map(|figure| vec![figure.name().to_owned(), unit(figure.unit()).to_owned()])
        .collect();
    text(&aligned(&["figure", "unit"], &[0, 1], &rows))
}

/// The unit in a table of units.
const fn unit(unit: Unit) -> &'static str {
    match unit {
        Unit::Count => "count",
        Unit::Truth => "true or false",
        unit => unit.text(),
    }
}
fn text(lines: &[String]) -> String {
    lines.iter().flat_map(|line| [line.trim_end(), "\n"]).collect()
}
