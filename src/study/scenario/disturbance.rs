//! Disturbances: the tables `[[disturbance]]`, each with a kind, a name and a window. A new kind is a line of the
//! registry and a row beside the kinds of its family.

mod acyclic;
pub(super) mod application;
pub(super) mod clock;
mod gc_jitter;
mod line;
mod manner;
pub(super) mod path;
mod source;
pub(super) mod station;
pub(super) mod token;
pub mod which;

use super::error::Fault;
use super::section::{Reader, Section, choice, instant, number, suggestion, text};
use super::tree::{Node, Value};
use crate::sim::fault::window::{Bursts, Window};
use crate::sim::fault::{Disturbance, What};
use crate::study::report::aligned;
use crate::time::Span;

/// A kind of disturbance as a user meets it.
#[derive(Clone, Copy, Debug)]
pub struct DisturbanceKind {
    /// The word for it in a scenario.
    pub name: &'static str,
    /// What it does, in a sentence without its full stop.
    pub what: &'static str,
    /// Its own keys, beside those of every disturbance.
    pub keys: &'static [Key],
    /// A whole disturbance as an inline table.
    pub example: &'static str,
    read: fn(&mut Section<'_>, &mut Reader<'_>) -> Option<What>,
}

/// A key of a disturbance.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// Its name.
    pub name: &'static str,
    /// What its value is, with the unit.
    pub unit: &'static str,
    /// What holds without it.
    pub default: &'static str,
    /// What it means, in a sentence without its full stop.
    pub what: &'static str,
}

/// Every kind.
pub const DISTURBANCES: &[DisturbanceKind] = &[
    line::MISSING_CLOCKS,
    line::LOST_TELEGRAMS,
    line::LATE_TELEGRAMS,
    line::DUPLICATE_TELEGRAMS,
    line::BIT_ERRORS,
    line::WRONG_OCTET,
    source::NOISE,
    source::FOREIGN_TELEGRAM,
    token::LATE_TOKEN,
    acyclic::OVERLONG_ACYCLIC,
    station::SILENT,
    station::MUTE,
    station::DEAF,
    station::RESTART,
    gc_jitter::GC_JITTER,
    clock::CRYSTAL_OFFSET,
    clock::CRYSTAL_WANDER,
    clock::TEMPERATURE_STEP,
    path::RECEIVER_JITTER,
    path::REPEATER_JITTER,
    path::T_SDR_JITTER,
    path::CABLE_CUT,
    application::HOLD_LIFE_SIGN,
    application::JUMP_LIFE_SIGN,
    application::REPEAT_LIFE_SIGN,
    application::WRONG_PARAMETERS,
];

/// The keys of every disturbance.
pub const COMMON: &[Key] = &[
    Key {
        name: "name",
        unit: "text",
        default: "its kind",
        what: "what lists and pictures call it; its draws hang on it",
    },
    Key { name: "at", unit: "time", default: "the start", what: "when it begins; either this or cycle" },
    Key {
        name: "cycle",
        unit: "cycle",
        default: "the start",
        what: "in which cycle of [master] it begins; either this or at",
    },
    Key {
        name: "for",
        unit: "time or cycles",
        default: "to the end",
        what: "how long it lasts, counted as its beginning; cycles stand still while [master] begins none",
    },
    Key { name: "every", unit: "time or cycles", default: "once", what: "distance from one beginning to the next" },
    Key { name: "times", unit: "number", default: "for ever", what: "how often it comes with every" },
];

/// Reads one `[[disturbance]]`; `before` are those that were read before it.
pub(super) fn read(mut section: Section<'_>, reader: &mut Reader<'_>, before: &[Disturbance]) -> Option<Disturbance> {
    let s = &mut section;
    let example = format!("\"{}\"", DISTURBANCES[0].name);
    let kind =
        s.required(reader, "kind", &example, |node| choice(node, "disturbance", DISTURBANCES, |kind| kind.name))?;
    let named = s.optional(reader, "name", |node| name(node, before));
    let window = window(s, reader);
    let what = (kind.read)(s, reader);
    section.finish(reader);
    let name = named.unwrap_or_else(|| free_name(kind.name, before));
    Some(Disturbance { name, window: window?, what: what? })
}

/// A name that no other disturbance has.
fn name(node: &Node, before: &[Disturbance]) -> Result<String, Fault> {
    let word = text(node)?;
    if word.trim().is_empty() || word.chars().count() > 60 || word.chars().any(char::is_control) {
        return Err(Fault::new("this is no name").help("a line of at most 60 characters"));
    }
    if before.iter().any(|other| other.name == word) {
        return Err(Fault::new(format!("two disturbances are called \"{word}\""))
            .rule("the draws of a disturbance hang on its name, so that each needs its own"));
    }
    Ok(word.to_owned())
}

/// The kind's name, and from the second one on a number.
fn free_name(kind: &str, before: &[Disturbance]) -> String {
    let taken = |name: &String| before.iter().any(|other| other.name == *name);
    let mut names = std::iter::once(kind.to_owned()).chain((2..).map(|number| format!("{kind} {number}")));
    names.find(|name| !taken(name)).unwrap_or_default()
}

/// Whether a window counts cycles or time.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Axis {
    Cycles,
    Time,
}

/// Reads when a disturbance acts.
fn window(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Window> {
    let at = section.optional(reader, "at", instant);
    let cycle = section.optional(reader, "cycle", number(0..=i64::MAX));
    let both = section.has("at") && section.has("cycle");
    let axis = match section.node("for").map(|node| &node.value) {
        _ if section.has("cycle") => Axis::Cycles,
        // Without a beginning the length tells.
        Some(Value::Integer(_)) if !section.has("at") => Axis::Cycles,
        _ => Axis::Time,
    };
    let length = section.optional(reader, "for", |node| extent(axis, 1, node));
    let least = length.unwrap_or(1);
    let every = section.optional(reader, "every", |node| extent(axis, least, node));
    let times = section.optional(reader, "times", number(1..=i64::MAX as u64));
    if both {
        let fault = Fault::new("a disturbance begins either at an instant or in a cycle");
        section.complain(reader, fault.help("leave out at, or leave out cycle"));
        return None;
    }
    for (key, needs) in [("every", "for"), ("times", "every")] {
        if section.has(key) && !section.has(needs) {
            let fault = Fault::new(format!("{key} without {needs} says nothing"));
            section.complain(reader, fault.help(format!("add {needs}, or leave out {key}")));
            return None;
        }
    }
    if !["at", "cycle", "for"].iter().any(|key| section.has(key)) {
        return Some(Window::Always);
    }
    Some(match axis {
        Axis::Cycles => Window::Cycles(Bursts { from: cycle.unwrap_or(0), length, every, times }),
        Axis::Time => {
            let from = at.unwrap_or(Span::ZERO).ticks();
            Window::Time(Bursts { from, length, every, times })
        }
    })
}

/// A length of at least `least`, on the axis that the window's beginning is on.
fn extent(axis: Axis, least: i64, node: &Node) -> Result<i64, Fault> {
    match (axis, &node.value) {
        (Axis::Cycles, Value::Text(_)) => {
            Err(Fault::new("this is a time, but the disturbance begins in a cycle").help("a whole number of cycles"))
        }
        (Axis::Time, Value::Integer(_)) => {
            Err(Fault::new("this is a number, but the disturbance begins at an instant")
                .help("a time with its unit, such as \"20 ms\""))
        }
        (Axis::Cycles, _) => number(least..=i64::MAX)(node),
        (Axis::Time, _) => match instant(node)?.ticks() {
            ticks if ticks >= least => Ok(ticks),
            ticks => Err(Fault::new(format!("{} is too short", Span::from_ticks(ticks)))
                .help(format!("at least {}", Span::from_ticks(least)))),
        },
    }
}

/// A kind of disturbance that does not exist was asked for.
#[derive(Debug, thiserror::Error)]
#[error("there is no disturbance \"{name}\"; {help}")]
pub struct UnknownDisturbance {
    name: String,
    help: String,
}

/// Every kind with its keys and an example, as text.
pub fn list() -> String {
    let mut lines = common();
    for kind in DISTURBANCES {
        lines.push(String::new());
        lines.extend(about(kind));
    }
    if DISTURBANCES.iter().any(names_services) {
        lines.extend(services());
    }
    page(&lines)
}

/// One kind with its keys, those of every disturbance and an example, as text.
///
/// # Errors
/// There is no such kind.
pub fn full(name: &str) -> Result<String, UnknownDisturbance> {
    let Some(kind) = DISTURBANCES.iter().find(|kind| kind.name == name) else {
        let help = suggestion(name, DISTURBANCES.iter().map(|kind| kind.name));
        return Err(UnknownDisturbance { name: name.chars().take(40).collect(), help });
    };
    let mut lines = about(kind);
    lines.push(String::new());
    lines.extend(common());
    if names_services(kind) {
        lines.extend(services());
    }
    Ok(page(&lines))
}

fn page(lines: &[String]) -> String {
    let lines: Vec<_> = lines.iter().map(|line| line.trim_end()).collect();
    lines.join("\n") + "\n"
}
fn table(keys: &[Key]) -> Vec<String> {
    let row =
        |key: &Key| vec![format!("  {}", key.name), key.unit.to_owned(), key.default.to_owned(), key.what.to_owned()];
    aligned(&["  key", "value", "default", "meaning"], &[0, 1, 2, 3], &keys.iter().map(row).collect::<Vec<_>>())
}
fn common() -> Vec<String> {
    let mut lines = vec!["every disturbance: a table [[disturbance]] with its kind and".to_owned()];
    lines.extend(table(COMMON));
    lines
}
fn about(kind: &DisturbanceKind) -> Vec<String> {
    let mut lines = vec![format!("{}: {}", kind.name, kind.what)];
    if !kind.keys.is_empty() {
        lines.extend(table(kind.keys));
    }
    lines.push(format!("  example: disturbance = [{{ {} }}]", kind.example));
    lines
}
fn names_services(kind: &DisturbanceKind) -> bool {
    kind.keys.iter().any(|key| key.name == which::SERVICE.name)
}
fn services() -> Vec<String> {
    let rows: Vec<_> = which::SERVICES.iter().map(|row| vec![format!("  {}", row.name), row.what.to_owned()]).collect();
    let mut lines = vec![String::new(), "services".to_owned()];
    lines.extend(aligned(&["  service", "which telegrams"], &[0, 1], &rows));
    lines
}
