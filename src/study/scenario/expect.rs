//! `[expect]`: what a scenario expects of its figures.
//!
//! A key is the name of a figure, written with dots or in quotation marks: `latch_skew.p99`, `"slave.3.faults"`. TOML
//! wants the latter where one name begins another. Its value is a comparison, a list of comparisons that all must hold,
//! `true`, `false` or `"none"`, or a table `{ is = ..., why = "..." }` with the reason.

use super::check::{Facts, about};
use super::error::Fault;
use super::section::{Reader, Section, text};
use super::tree::{Node, Place, Table, Value};
use crate::study::figure::{Figure, FigureError, Unit};
use crate::study::run::layout;
use crate::study::verdict::demand::NONE;
use crate::study::verdict::{Comparison, Demand, Expectation};
use crate::time::BitRate;

/// The table's name.
pub(super) const EXPECT: &str = "expect";
/// The key of the demand in a table with a reason.
const IS: &str = "is";

/// One expectation as it stands in the file.
struct Entry<'t> {
    name: String,
    /// Of its key.
    place: Place,
    node: &'t Node,
}

/// Reads `[expect]`, in the order of the file. At `rate` times can be written in bit times.
pub(super) fn read(reader: &mut Reader<'_>, root: &Table, rate: BitRate) -> Vec<Expectation> {
    let Some((place, node)) = root.0.get(EXPECT) else { return Vec::new() };
    let Value::Table(table) = &node.value else {
        let fault = Fault::new(format!("this is {}", node.value.noun())).help("write [expect]");
        reader.complain(*place, EXPECT, fault);
        return Vec::new();
    };
    let mut entries = Vec::new();
    flatten(reader, "", table, &mut entries);
    entries.sort_by_key(|entry| entry.place);
    let entries = overridden(reader, entries);
    entries.iter().filter_map(|entry| expectation(reader, entry, rate)).collect()
}

/// Puts an override of the expectation `name` into the file's tables, as a key of its own.
pub(super) fn put(root: &mut Table, name: &str, node: &Node) {
    let empty = || (node.place, Node { place: node.place, value: Value::Table(Table::default()) });
    let (_, expect) = root.0.entry(EXPECT.to_owned()).or_insert_with(empty);
    if let Value::Table(table) = &mut expect.value {
        // A table under this name holds other expectations, whose names begin with this one.
        let name = if matches!(table.get(name), Some(Node { value: Value::Table(_), .. })) {
            format!("{name} ")
        } else {
            name.to_owned()
        };
        let place = table.0.get(&name).map_or(node.place, |&(place, _)| place);
        table.0.insert(name, (place, node.clone()));
    }
}

/// Every expectation of `table`, whose names begin with `begin`.
fn flatten<'t>(reader: &mut Reader<'_>, begin: &str, table: &'t Table, entries: &mut Vec<Entry<'t>>) {
    for (key, (place, node)) in &table.0 {
        let name = format!("{begin}{}", key.trim());
        match &node.value {
            Value::Table(inner) if inner.0.is_empty() => {
                let fault = Fault::new("nothing is expected here").help(format!("write {name} = \"<= ...\""));
                reader.complain(*place, &path(&name), fault);
            }
            Value::Table(inner) if inner.get(IS).is_none() => flatten(reader, &format!("{name}."), inner, entries),
            _ => entries.push(Entry { name, place: *place, node }),
        }
    }
}

/// Leaves of several entries of one name the override; two of the file are a mistake.
fn overridden<'t>(reader: &mut Reader<'_>, entries: Vec<Entry<'t>>) -> Vec<Entry<'t>> {
    let mut kept = Vec::<Entry<'t>>::new();
    for entry in entries {
        match kept.iter_mut().find(|other| other.name == entry.name) {
            Some(other) if matches!(entry.place, Place::Set(_)) => other.node = entry.node,
            Some(_) => {
                let fault = Fault::new(format!("\"{}\" is expected twice", entry.name))
                    .help("write a list of all comparisons, such as [\">= 90 us\", \"< 110 us\"]");
                reader.complain(entry.place, &path(&entry.name), fault);
            }
            None => kept.push(entry),
        }
    }
    kept
}

fn path(name: &str) -> String {
    format!("{EXPECT}.{name}")
}

/// What was said of a figure that is none.
fn fault(error: FigureError) -> Fault {
    Fault::new(error.message).help(error.help)
}

/// Reads one expectation.
fn expectation(reader: &mut Reader<'_>, entry: &Entry<'_>, rate: BitRate) -> Option<Expectation> {
    let path = path(&entry.name);
    reader.places.insert(path.clone(), entry.place);
    let figure = match Figure::named(&entry.name) {
        Ok(figure) => figure,
        Err(error) => {
            reader.complain(entry.place, &path, fault(error));
            return None;
        }
    };
    let read = |node: &Node| demand(node, &figure, rate);
    let (demand, why) = match &entry.node.value {
        Value::Table(table) => {
            let mut section = Section::new(path, entry.node.place, Some(table));
            let demand = section.required(reader, IS, "\"<= ...\"", read);
            let why = section.optional(reader, "why", |node| text(node).map(str::to_owned));
            section.finish(reader);
            (demand?, why.unwrap_or_default())
        }
        _ => match read(entry.node) {
            Ok(demand) => (demand, String::new()),
            Err(fault) => {
                reader.complain(entry.node.place, &path, fault);
                return None;
            }
        },
    };
    Some(Expectation { figure, demand, why })
}

/// Reads what `figure` should be.
fn demand(node: &Node, figure: &Figure, rate: BitRate) -> Result<Demand, Fault> {
    let unit = figure.unit();
    let comparison = |node: &Node| match &node.value {
        Value::Text(text) if text.chars().count() > 60 => Err(Fault::new("this text is too long for a comparison")),
        Value::Text(text) => Comparison::read(text, unit, rate),
        other => Err(Fault::new(format!("this is {}", other.noun())).help(help(unit))),
    };
    let demand = match &node.value {
        Value::Bool(truth) if unit == Unit::Truth => Demand::Truth(*truth),
        Value::Text(text) if text.trim() == NONE => Demand::Absent,
        Value::List(items) if items.is_empty() => return Err(Fault::new("this list is empty").help(help(unit))),
        Value::List(items) => Demand::Compare(items.iter().map(comparison).collect::<Result<_, _>>()?),
        _ if unit == Unit::Truth => {
            return Err(Fault::new(format!("{figure} is either true or false")).help("write true or false"));
        }
        _ => Demand::Compare(vec![comparison(node)?]),
    };
    if demand.can_hold(figure.is_signed()) {
        return Ok(demand);
    }
    let rule = if figure.is_signed() { String::new() } else { format!("{figure} is never below 0") };
    Err(Fault::new(format!("no value is {demand}")).rule(rule).help("the limits leave nothing between them"))
}

/// What can be written for a figure of `unit`.
fn help(unit: Unit) -> &'static str {
    match unit {
        Unit::Count => "write a comparison in quotation marks, such as \"== 0\"",
        Unit::Steps => "write a comparison in quotation marks, such as \"<= 0.5 steps\"",
        Unit::Share => "write a comparison in quotation marks, such as \">= 99.9 %\"",
        Unit::Truth => "write true or false",
        _ => "write a comparison in quotation marks, such as \"<= 500 ns\"",
    }
}

/// Every expectation is of something that the network has.
pub(super) fn subjects(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let layout = layout(facts.scenario);
    for expectation in &facts.scenario.expectations {
        if let Err(error) = expectation.figure.check(&layout) {
            about(reader, &path(expectation.figure.name()), &[], fault(error));
        }
    }
}
