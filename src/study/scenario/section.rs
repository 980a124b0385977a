//! One table of a scenario file, read key by key: what is asked for is known, everything else is an unknown key.

use super::Run;
use super::error::{Fault, Problem};
use super::topology::Topology;
use super::tree::{Node, Place, Source, Table, Value};
use crate::study::quantity::{QuantityError, span};
use crate::time::{BitRate, Span};
use crate::wire::Address;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::ops::RangeInclusive;

/// Reads a scenario: collects problems and where every key was found.
pub(in crate::study) struct Reader<'a> {
    pub(in crate::study) source: &'a Source<'a>,
    /// Place of each key's value that was given, by the key's path.
    pub(in crate::study) places: BTreeMap<String, Place>,
    /// GSD files that were read for it.
    pub(super) gsd_files: super::gsd::Files,
    /// Whether T_DP, T_I and T_O may be missing: they are to be proposed.
    pub(in crate::study) proposes: bool,
    /// What disturbances can be about.
    pub(super) around: Around,
    problems: Vec<(Place, String, Fault)>,
}

/// What of a scenario is known when its disturbances are read.
pub(super) struct Around {
    /// Addresses of all slaves, in order.
    pub(super) slaves: Vec<Address>,
    /// The slaves that a master has in its list, each with that master, in order.
    pub(super) masters: Vec<(Address, Address)>,
    pub(super) topology: Option<Topology>,
    pub(super) rate: BitRate,
}

impl<'a> Reader<'a> {
    /// A reader of `source` that has read nothing yet.
    pub(in crate::study) const fn new(source: &'a Source<'a>) -> Self {
        Self {
            source,
            places: BTreeMap::new(),
            gsd_files: BTreeMap::new(),
            proposes: false,
            around: Around { slaves: Vec::new(), masters: Vec::new(), topology: None, rate: BitRate::M12 },
            problems: Vec::new(),
        }
    }
    /// Notes that `key` at `place` is wrong. The same fault of the same value, shared by several slaves, is noted once.
    pub(in crate::study) fn complain(&mut self, place: Place, key: &str, fault: Fault) {
        let same = |(at, _, other): &(Place, String, Fault)| {
            *at == place && (*other == fault || (!fault.rule.is_empty() && other.rule == fault.rule))
        };
        if place == Place::Missing || !self.problems.iter().any(same) {
            self.problems.push((place, key.to_owned(), fault));
        }
    }
    /// As [`Self::complain`] unless something else is wrong there already.
    pub(in crate::study) fn complain_first(&mut self, place: Place, key: &str, fault: Fault) {
        if place == Place::Missing || self.problems.iter().all(|&(at, ..)| at != place) {
            self.complain(place, key, fault);
        }
    }
    /// The place of the first of `keys` that was given.
    pub(in crate::study) fn place(&self, keys: &[&str]) -> Place {
        keys.iter().find_map(|&key| self.places.get(key).copied()).unwrap_or(Place::Missing)
    }
    /// Whether anything is wrong so far.
    pub(in crate::study) fn has_problems(&self) -> bool {
        !self.problems.is_empty()
    }
    /// All problems in the order of the file, and forgets them.
    pub(in crate::study) fn take_problems(&mut self) -> Vec<Problem> {
        self.problems.sort_by_key(|&(place, ..)| place);
        let mut problems: Vec<_> =
            self.problems.drain(..).map(|(place, key, fault)| self.source.problem(place, &key, fault)).collect();
        problems.dedup();
        problems
    }
}

/// One table.
pub(in crate::study) struct Section<'t> {
    path: String,
    place: Place,
    table: Option<&'t Table>,
    asked: Vec<&'static str>,
}

impl<'t> Section<'t> {
    /// The table at `path`; without one, all its keys are missing.
    pub(in crate::study) fn new(path: impl Into<String>, place: Place, table: Option<&'t Table>) -> Self {
        Self { path: path.into(), place, table, asked: Vec::new() }
    }
    /// The table `name` of the file.
    pub(in crate::study) fn of_file(reader: &mut Reader<'_>, root: &'t Table, name: &'static str) -> Self {
        match root.0.get(name) {
            Some((place, Node { value: Value::Table(table), .. })) => {
                reader.places.insert(name.to_owned(), *place);
                Self::new(name, *place, Some(table))
            }
            Some((place, node)) => {
                let fault = Fault::new(format!("this is {}", node.value.noun())).help(format!("write [{name}]"));
                reader.complain(*place, name, fault);
                Self::new(name, *place, None)
            }
            None => Self::new(name, Place::Missing, None),
        }
    }
    /// Place of the table itself.
    pub(in crate::study) const fn place(&self) -> Place {
        self.place
    }
    /// All of it, where any key may be.
    pub(in crate::study) const fn all(&self) -> Option<&'t Table> {
        self.table
    }
    /// Whether `key` is there.
    pub(in crate::study) fn has(&self, key: &str) -> bool {
        self.node(key).is_some()
    }
    /// The value of `key`.
    pub(in crate::study) fn node(&self, key: &str) -> Option<&'t Node> {
        self.table.and_then(|table| table.get(key))
    }
    /// The path of `key`.
    pub(in crate::study) fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }
    /// Complains about the table as a whole.
    pub(in crate::study) fn complain(&self, reader: &mut Reader<'_>, fault: Fault) {
        reader.complain(self.place, &self.path, fault);
    }

    /// The value of `key` as `read` makes it, `None` if it is not there or wrong.
    pub(in crate::study) fn optional<T>(
        &mut self,
        reader: &mut Reader<'_>,
        key: &'static str,
        read: impl FnOnce(&Node) -> Result<T, Fault>,
    ) -> Option<T> {
        self.asked.push(key);
        let node = self.node(key)?;
        let path = self.path_of(key);
        reader.places.insert(path.clone(), node.place);
        read(node).map_err(|fault| reader.complain(node.place, &path, fault)).ok()
    }
    /// As [`Self::optional`]; that it is not there is a problem too, and `example` shows what it could be.
    pub(in crate::study) fn required<T>(
        &mut self,
        reader: &mut Reader<'_>,
        key: &'static str,
        example: &str,
        read: impl FnOnce(&Node) -> Result<T, Fault>,
    ) -> Option<T> {
        if !self.has(key) {
            let fault = Fault::new("this key is missing").help(format!("for example: {key} = {example}"));
            reader.complain(self.place, &self.path_of(key), fault);
        }
        self.optional(reader, key, read)
    }
    /// The table under `key`.
    pub(in crate::study) fn table(&mut self, reader: &mut Reader<'_>, key: &'static str) -> Option<Section<'t>> {
        self.asked.push(key);
        let node = self.node(key)?;
        reader.places.insert(self.path_of(key), node.place);
        if let Value::Table(table) = &node.value {
            return Some(Self::new(self.path_of(key), node.place, Some(table)));
        }
        let fault = Fault::new(format!("this is {}", node.value.noun())).help(format!("write {key} = {{ ... }}"));
        reader.complain(node.place, &self.path_of(key), fault);
        None
    }
    /// The tables of the list under `key`, `[[key]]`, numbered from 1.
    pub(in crate::study) fn list(&mut self, reader: &mut Reader<'_>, key: &'static str) -> Vec<Section<'t>> {
        self.asked.push(key);
        let Some(node) = self.node(key) else { return Vec::new() };
        let items = match &node.value {
            Value::List(items) => &items[..],
            _ => std::slice::from_ref(node),
        };
        let mut sections = Vec::with_capacity(items.len());
        for (index, item) in items.iter().enumerate() {
            let path = format!("{}.{}", self.path_of(key), index + 1);
            if let (Value::Table(table), Value::List(_)) = (&item.value, &node.value) {
                sections.push(Self::new(path, item.place, Some(table)));
            } else {
                let fault = Fault::new(format!("this is {}", item.value.noun())).help(format!("write [[{key}]]"));
                reader.complain(item.place, &path, fault);
            }
        }
        sections
    }
    /// The end of the table: every key that nobody has asked for is unknown.
    pub(in crate::study) fn finish(self, reader: &mut Reader<'_>) {
        for (key, (place, _)) in self.table.iter().flat_map(|table| &table.0) {
            if !self.asked.contains(&key.as_str()) {
                let open: Vec<_> = self.asked.iter().copied().filter(|asked| !self.has(asked)).collect();
                // A key that is not there yet is more likely meant than one that is.
                let help =
                    nearest(key, open.into_iter()).unwrap_or_else(|| suggestion(key, self.asked.iter().copied()));
                let fault = Fault::new("there is no such key").help(help);
                reader.complain(*place, &self.path_of(key), fault);
            }
        }
    }
}

/// "did you mean ..." if one of `known` is near `word`.
pub(in crate::study) fn nearest<'k>(word: &str, known: impl Iterator<Item = &'k str>) -> Option<String> {
    // Nothing long is near, and the distance of long words takes long.
    let word: String = word.chars().take(60).collect::<String>().to_lowercase().replace('_', "-");
    let distance = |name: &str| strsim::damerau_levenshtein(&word, &name.replace('_', "-"));
    let (distance, name) = known.map(|name| (distance(name), name)).min_by_key(|&(distance, _)| distance)?;
    (distance <= (word.chars().count() / 3).max(1)).then(|| format!("did you mean \"{name}\"?"))
}

/// "did you mean ..." if one of `known` is near `word`, otherwise all of them.
pub(in crate::study) fn suggestion<'k>(word: &str, known: impl Iterator<Item = &'k str> + Clone) -> String {
    nearest(word, known.clone()).unwrap_or_else(|| format!("known here: {}", known.collect::<Vec<_>>().join(", ")))
}

/// The row of `rows` whose name `node` is; `name` tells a row's name, `noun` what the rows are.
pub(in crate::study) fn choice<T>(
    node: &Node,
    noun: &str,
    rows: &'static [T],
    name: impl Fn(&T) -> &str,
) -> Result<&'static T, Fault> {
    let word = text(node)?;
    let plain = |name: &str| name.replace('_', "-");
    rows.iter().find(|row| plain(name(row)) == plain(word)).ok_or_else(|| {
        let known: Vec<_> = rows.iter().map(|row| plain(name(row))).collect();
        Fault::new(format!("there is no {noun} \"{}\"", shorten(word)))
            .help(suggestion(word, known.iter().map(String::as_str)))
    })
}

/// `word`, cut where a message would become unreadable.
fn shorten(word: &str) -> String {
    let short: String = word.chars().take(40).collect();
    if short.len() < word.len() { short + "..." } else { short }
}

/// A text.
pub(in crate::study) fn text(node: &Node) -> Result<&str, Fault> {
    match &node.value {
        Value::Text(text) => Ok(text),
        other => Err(Fault::new(format!("this is {}", other.noun())).help("write a text in quotation marks")),
    }
}

/// `true` or `false`.
pub(in crate::study) fn yes(node: &Node) -> Result<bool, Fault> {
    match &node.value {
        Value::Bool(yes) => Ok(*yes),
        other => Err(Fault::new(format!("this is {}", other.noun())).help("write true or false")),
    }
}

/// A whole number in `range`.
pub(in crate::study) fn number<T>(range: RangeInclusive<T>) -> impl Fn(&Node) -> Result<T, Fault>
where
    T: TryFrom<i128> + PartialOrd + Display + Copy,
{
    move |node| {
        let help = || format!("a whole number from {} to {}", range.start(), range.end());
        let shown = match &node.value {
            Value::Integer(Some(number)) => match T::try_from(*number) {
                Ok(value) if range.contains(&value) => return Ok(value),
                _ => number.to_string(),
            },
            Value::Integer(None) => "this number".to_owned(),
            other => return Err(Fault::new(format!("this is {}", other.noun())).help(help())),
        };
        Err(Fault::new(format!("{shown} is out of range")).help(help()))
    }
}

/// A number with its unit, read by `read`; `example` shows one. An override has no quotation marks to tell a text by, so that
/// a number there, such as a gain of 0.25 or a share of 1e-6, is read as one.
pub(in crate::study) fn quantity<T>(
    example: &'static str,
    read: impl Fn(&str) -> Result<T, QuantityError>,
) -> impl Fn(&Node) -> Result<T, Fault> {
    move |node| match &node.value {
        Value::Text(text) if text.chars().count() > 60 => {
            Err(Fault::new("this text is too long for a quantity").help(format!("such as \"{example}\"")))
        }
        Value::Text(text) => read(text).map_err(|error| Fault::new(error.to_string())),
        Value::Integer(Some(_)) | Value::Fraction(_) if matches!(node.place, Place::Set(_)) => {
            read(&node.value.literal()).map_err(|error| Fault::new(error.to_string()))
        }
        other => Err(Fault::new(format!("this is {}", other.noun()))
            .help(format!("write a number with its unit in quotation marks, such as \"{example}\""))),
    }
}

/// A time in a run: not negative, and not after the end of the longest run.
pub(in crate::study) fn instant(node: &Node) -> Result<Span, Fault> {
    match quantity("2 s", |text| span(text, None))(node)? {
        span if span < Span::ZERO => Err(Fault::new(format!("{span} is negative"))),
        span if span > Run::LONGEST => Err(Fault::new(format!("\"{}\" is after the end of every run", text(node)?))
            .rule("a run ends within 24 years of 365 days (Model: range of time)")
            .help("at most \"210240 h\"")),
        span => Ok(span),
    }
}

/// A time in a bus cycle, with bit times at `rate`: not negative, and short enough to reckon with.
pub(in crate::study) fn cycle_time(rate: BitRate) -> impl Fn(&Node) -> Result<Span, Fault> {
    move |node| match quantity("125 us", |text| span(text, Some(rate)))(node)? {
        span if span < Span::ZERO => Err(Fault::new(format!("{span} is negative"))),
        span if span > Span::from_s(1) => {
            Err(Fault::new(format!("{span} is longer than any bus cycle")).rule("T_DP is at most 32 ms (Model: D3)"))
        }
        span => Ok(span),
    }
}
