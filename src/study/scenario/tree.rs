//! The text of a scenario as a tree of values that know their place, overrides included.

use super::error::{Fault, Position, Problem, ScenarioError};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Where a value stands.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(in crate::study) enum Place {
    /// In the file, from this octet to that.
    File(usize, usize),
    /// In the override with this index.
    Set(usize),
    /// Nowhere: it is missing in the whole file.
    Missing,
}

/// A value and its place.
#[derive(Clone, PartialEq, Debug)]
pub(in crate::study) struct Node {
    pub(in crate::study) place: Place,
    pub(in crate::study) value: Value,
}

/// A value.
#[derive(Clone, PartialEq, Debug)]
pub(in crate::study) enum Value {
    Text(String),
    /// `None` if it is beyond 128 bits.
    Integer(Option<i128>),
    Bool(bool),
    List(Vec<Node>),
    Table(Table),
    /// A number with a decimal point or an exponent, as it is written.
    Fraction(String),
    /// A date, which no key takes.
    Other(&'static str),
}

impl Value {
    /// The value's kind with its article.
    pub(in crate::study) const fn noun(&self) -> &'static str {
        match self {
            Self::Text(_) => "a text",
            Self::Integer(_) => "a number",
            Self::Bool(_) => "true or false",
            Self::List(_) => "a list",
            Self::Table(_) => "a table",
            Self::Fraction(_) => "a fraction",
            Self::Other(noun) => noun,
        }
    }
    /// The value as a TOML literal on one line, tables sorted by key.
    pub(in crate::study) fn literal(&self) -> String {
        match self {
            Self::Text(text) => quoted(text),
            Self::Integer(number) => number.map_or_else(String::new, |number| number.to_string()),
            Self::Bool(yes) => yes.to_string(),
            Self::Fraction(text) => text.clone(),
            Self::Other(noun) => (*noun).to_owned(),
            Self::List(items) => {
                let items: Vec<_> = items.iter().map(|item| item.value.literal()).collect();
                format!("[{}]", items.join(", "))
            }
            Self::Table(Table(entries)) => {
                let entry = |(key, (_, node)): (&String, &(Place, Node))| {
                    let bare = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
                    let is_bare = !key.is_empty() && key.chars().all(bare);
                    let key = if is_bare { key.clone() } else { quoted(key) };
                    format!("{key} = {}", node.value.literal())
                };
                format!("{{ {} }}", entries.iter().map(entry).collect::<Vec<_>>().join(", "))
            }
        }
    }
    /// The value as an override has it: a text without quotation marks wherever it stays a text without them.
    pub(in crate::study) fn as_override(&self) -> String {
        match self {
            Self::Text(text) if override_value(text, Place::Missing).value == *self => text.clone(),
            other => other.literal(),
        }
    }
}

/// `text` as a TOML string.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// Values by key, each with the place of the key.
#[derive(Clone, PartialEq, Debug, Default)]
pub(in crate::study) struct Table(pub(in crate::study) BTreeMap<String, (Place, Node)>);

impl Table {
    /// The value of `key`.
    pub(in crate::study) fn get(&self, key: &str) -> Option<&Node> {
        self.0.get(key).map(|(_, node)| node)
    }
}

/// One `--set key=value`.
#[derive(Clone, PartialEq, Debug)]
pub(in crate::study) struct Set {
    /// The path, split at its dots.
    pub(in crate::study) path: Vec<String>,
    /// The assignment as it was given.
    pub(in crate::study) text: String,
    /// The value.
    pub(in crate::study) node: Node,
}

/// A text with its name and its overrides: what places refer to.
pub(in crate::study) struct Source<'a> {
    name: &'a str,
    text: &'a str,
    /// Where files are that the text names without a directory: where its own is.
    pub(in crate::study) dir: &'a Path,
    pub(in crate::study) sets: Vec<Set>,
}

impl<'a> Source<'a> {
    /// The source `text` called `name`, with overrides whose values are TOML where they can be and text otherwise.
    pub(in crate::study) fn new(name: &'a str, text: &'a str, overrides: &[(String, String)]) -> Self {
        let set = |(index, (key, value)): (usize, &(String, String))| Set {
            path: key.split('.').map(|part| part.trim().to_owned()).collect(),
            text: format!("{key}={value}"),
            node: override_value(value, Place::Set(index)),
        };
        Self { name, text, dir: Path::new(""), sets: overrides.iter().enumerate().map(set).collect() }
    }
    /// The same with the files that the text names in `dir`.
    pub(in crate::study) fn in_dir(self, dir: &'a Path) -> Self {
        Self { dir, ..self }
    }
    /// Reads the text.
    ///
    /// # Errors
    /// The text is not TOML.
    pub(in crate::study) fn parse(&self) -> Result<Table, ScenarioError> {
        match DeTable::parse(self.text) {
            Ok(table) => Ok(convert_table(table.get_ref(), None)),
            Err(error) => {
                let place = error.span().map_or(Place::Missing, |span| Place::File(span.start, span.end));
                let fault = Fault::new(sentence(error.message())).rule("the file is TOML 1.0 (toml.io)");
                Err(ScenarioError { problems: vec![self.problem(place, "", fault)] })
            }
        }
    }
    /// The problem `fault` of `key` at `place`.
    pub(in crate::study) fn problem(&self, place: Place, key: &str, fault: Fault) -> Problem {
        let (source, position) = match place {
            Place::File(start, end) => (self.name.to_owned(), Some(position(self.text, start..end))),
            Place::Set(index) => (format!("--set \"{}\"", self.sets[index].text), None),
            Place::Missing => (self.name.to_owned(), None),
        };
        Problem { source, position, key: key.to_owned(), fault }
    }
}

/// Line and column of `span` in `text`.
fn position(text: &str, span: Range<usize>) -> Position {
    let start = (0..=span.start.min(text.len())).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0);
    let before = &text[..start];
    let line_start = before.rfind('\n').map_or(0, |i| i + 1);
    let line = text[line_start..].lines().next().unwrap_or_default();
    let column = before[line_start..].chars().count() + 1;
    let within = span.end.clamp(start, line_start + line.len().max(start - line_start));
    let width = text.get(start..within).map_or(1, |blamed| blamed.chars().count().max(1));
    Position { line: before.matches('\n').count() + 1, column, width, text: line.to_owned() }
}

/// `message` of the TOML reader on one line.
fn sentence(message: &str) -> String {
    message.lines().map(str::trim).collect::<Vec<_>>().join("; ")
}

/// The value of an override: a TOML literal if it is one, otherwise the text itself.
fn override_value(text: &str, place: Place) -> Node {
    let literal = format!("x = {}", text.trim());
    match DeTable::parse(&literal).ok().map(|table| convert_table(table.get_ref(), Some(place))) {
        Some(mut table) if table.0.len() == 1 && table.0.contains_key("x") && !text.contains('\n') => {
            table.0.remove("x").map(|(_, node)| node)
        }
        _ => None,
    }
    .unwrap_or_else(|| Node { place, value: Value::Text(text.trim().to_owned()) })
}

/// The same table in our own terms; all places are `place` if there is one.
fn convert_table(table: &DeTable<'_>, place: Option<Place>) -> Table {
    let entry = |(key, value): (&Spanned<_>, &Spanned<DeValue<'_>>)| {
        let key_place = place.unwrap_or(Place::File(key.span().start, key.span().end));
        let name: &std::borrow::Cow<'_, str> = key.get_ref();
        (name.to_string(), (key_place, convert(value, place)))
    };
    Table(table.iter().map(entry).collect())
}

/// The same value in our own terms.
fn convert(value: &Spanned<DeValue<'_>>, place: Option<Place>) -> Node {
    let own = place.unwrap_or(Place::File(value.span().start, value.span().end));
    let value = match value.get_ref() {
        DeValue::String(text) => Value::Text(text.to_string()),
        DeValue::Integer(number) => Value::Integer(i128::from_str_radix(number.as_str(), number.radix()).ok()),
        DeValue::Boolean(yes) => Value::Bool(*yes),
        DeValue::Array(items) => Value::List(items.iter().map(|item| convert(item, place)).collect()),
        DeValue::Table(table) => Value::Table(convert_table(table, place)),
        DeValue::Float(number) => Value::Fraction(number.as_str().to_owned()),
        DeValue::Datetime(_) => Value::Other("a date"),
    };
    Node { place: own, value }
}
