//! Jitter of SYNCH: the shapes of `gc_jitter` with their keys, and tables from CSV files.

use super::error::Fault;
use super::read_file;
use super::section::{Reader, Section, choice, instant, number, quantity, text, yes};
use super::tree::{Node, Value};
use crate::sim::jitter::{GcJitter, KINDS, Period, Rate};
use crate::study::quantity::span;
use crate::time::Span;
use std::path::Path;
use std::sync::Arc;

/// Column of a table in a file.
const COLUMN: &str = "offset_ns";

/// Reads `gc_jitter` of the master, and whether it accumulates (Model: D1).
pub(super) fn of_master(mut section: Section<'_>, reader: &mut Reader<'_>) -> Option<(GcJitter, bool)> {
    let jitter = shape("kind", &mut section, reader);
    let accumulate = section.optional(reader, "accumulate", yes).unwrap_or(false);
    section.finish(reader);
    Some((jitter?, accumulate))
}

/// Reads the shape that `key` names, with its own keys.
pub(super) fn shape(key: &'static str, section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<GcJitter> {
    let name = |node: &Node| choice(node, "jitter", KINDS, |kind| kind.name);
    let kind = section.required(reader, key, "\"bounded-normal\"", name)?;
    let jitter = match kind.name {
        "none" => Some(GcJitter::None),
        "uniform" => width("half_width", section, reader).map(|half_width| GcJitter::Uniform { half_width }),
        "normal" => width("sigma", section, reader).map(|sigma| GcJitter::Normal { sigma }),
        "bounded_normal" => {
            let sigma = width("sigma", section, reader);
            let bound = width("bound", section, reader);
            sigma.zip(bound).map(|(sigma, bound)| GcJitter::BoundedNormal { sigma, bound })
        }
        "sine" => {
            let amplitude = width("amplitude", section, reader);
            let period = section.required(reader, "period", "\"100 ms\"", period);
            amplitude.zip(period).map(|(amplitude, period)| GcJitter::Sine { amplitude, period })
        }
        "step" => section.required(reader, "offset", "\"100 ns\"", signed).map(|offset| GcJitter::Step { offset }),
        "drift" => {
            let rate = rate(section, reader);
            let bound = width("bound", section, reader);
            rate.zip(bound).map(|(rate, bound)| GcJitter::Drift { rate, bound })
        }
        _ => {
            let offsets = offsets(section, reader);
            let repeat = section.optional(reader, "repeat", yes).unwrap_or(true);
            offsets.map(|offsets| GcJitter::Table { offsets, repeat })
        }
    }?;
    if let Err(error) = jitter.check() {
        section.complain(reader, Fault::new(error.to_string()));
    }
    Some(jitter)
}

fn width(key: &'static str, section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Span> {
    section.required(reader, key, "\"100 ns\"", instant)
}
/// A time to either side.
fn signed(node: &Node) -> Result<Span, Fault> {
    quantity("100 ns", |text| span(text, None))(node)
}
fn period(node: &Node) -> Result<Period, Fault> {
    match &node.value {
        Value::Integer(_) => number(1..=u32::MAX)(node).map(Period::Cycles),
        _ => instant(node).map(Period::Time),
    }
}
fn rate(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Rate> {
    let cycle = section.optional(reader, "per_cycle", signed);
    let second = section.optional(reader, "per_second", signed);
    if section.has("per_cycle") == section.has("per_second") {
        let fault = Fault::new("a drift grows either per_cycle or per_second");
        section.complain(reader, fault.help("for example: per_cycle = \"1 ns\", or per_second = \"1 us\""));
        return None;
    }
    cycle.map(Rate::PerCycle).or(second.map(Rate::PerSecond))
}

/// The entries of a table, from the scenario or from a file.
fn offsets(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Arc<[Span]>> {
    let dir = reader.source.dir;
    let listed = section.optional(reader, "offsets", listed);
    let file = section.optional(reader, "file", |node| of_file(&dir.join(text(node)?)));
    if section.has("offsets") == section.has("file") {
        let fault = Fault::new("a table has either offsets or file");
        section.complain(reader, fault.help("for example: offsets = [\"0 ns\", \"100 ns\"], or file = \"jitter.csv\""));
        return None;
    }
    listed.or(file).map(Arc::from)
}
fn listed(node: &Node) -> Result<Vec<Span>, Fault> {
    let Value::List(items) = &node.value else {
        return Err(Fault::new(format!("this is {}", node.value.noun())).help("a list: [\"0 ns\", \"100 ns\"]"));
    };
    items.iter().map(signed).collect()
}

/// The column `offset_ns` of a CSV file.
fn of_file(path: &Path) -> Result<Vec<Span>, Fault> {
    let shown = path.display();
    let octets = read_file(path, "table", "name one CSV file in it")
        .map_err(|fault| Fault { message: format!("{shown}: {}", fault.message), ..fault })?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(&octets[..]);
    let broken = |error: &csv::Error| {
        let line = error.position().map_or(String::new(), |position| format!(":{}", position.line()));
        Fault::new(format!("{shown}{line}: this is no line of a CSV file: {error}"))
    };
    let header = reader.headers().map_err(|error| broken(&error))?;
    let Some(column) = header.iter().position(|name| name == COLUMN) else {
        return Err(Fault::new(format!("{shown}:1: there is no column {COLUMN}"))
            .rule("the first line names the columns, and the unit belongs to the name")
            .help(format!("{COLUMN} in the first line, a number of nanoseconds in each of the others")));
    };
    let offset = |record: Result<csv::StringRecord, csv::Error>| {
        let record = record.map_err(|error| broken(&error))?;
        let field = record.get(column).unwrap_or_default();
        let line = record.position().map_or(0, csv::Position::line);
        span(&format!("{field} ns"), None).map_err(|error| Fault::new(format!("{shown}:{line}: {error}")))
    };
    let offsets: Vec<Span> = reader.records().map(offset).collect::<Result<_, _>>()?;
    if offsets.is_empty() {
        return Err(Fault::new(format!("{shown}: a table without offsets says nothing")));
    }
    Ok(offsets)
}
