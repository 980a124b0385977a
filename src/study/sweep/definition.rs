//! Definition: what a sweep file says.
//!
//! ```toml
//! base = "../gc-jitter.toml"           # the scenario, relative to this file
//! repetitions = 20                     # runs of each combination
//! draws = "independent"                # or "common": repetition n of every combination has the same seed
//! figures = ["latch_skew.p99", "faults"]
//! confidence = "95 %"                  # of the intervals in summary.csv
//! until = { figure = "latch_skew.p99", relative_half_width = "2 %", max_repetitions = 200 }
//! expect = "all"                       # or "own": of the scenario's expectations only those that this file sets count
//! invalid = "fail"                     # or "skip": leave out combinations that break a rule
//!
//! [set]                                # changed in every run
//! run.duration = "1 s"
//!
//! [[axis]]                             # every value of an axis with every value of every other
//! key = "master.gc_jitter.half_width"
//! from = "100 ns"
//! to = "1 us"
//! step = "100 ns"
//!
//! [[axis]]                             # keys that move together
//! keys = ["master.t_dp", "master.t_o"]
//! values = [["1 ms", "0.625 ms"], ["2 ms", "1.25 ms"]]
//!
//! [[skip]]                             # what is left out
//! "master.t_dp" = "== 2 ms"
//! "master.gc_jitter.half_width" = "> 500 ns"
//! ```

use std::path::{Path, PathBuf};

use super::axis::Axis;
use super::combination::Combinations;
use super::skip::Skip;
use crate::study::figure::{Figure, Unit, Who};
use crate::study::quantity::Measure;
use crate::study::scenario::error::{Fault, ScenarioError};
use crate::study::scenario::section::{Reader, Section, number, suggestion, text};
use crate::study::scenario::tree::{Node, Place, Source, Value};
use crate::study::scenario::{Scenario, TABLES_OF_ONE};
use crate::study::statistics::confidence::Confidence;
use crate::study::statistics::stop_rule::{LEAST, StopError, StopRule, StopSettings};

/// A whole sweep, as its file has it.
#[derive(Clone, PartialEq, Debug)]
pub struct Definition {
    /// The file's name without its extension.
    pub name: String,
    /// What messages call the file.
    pub source: String,
    /// Its text.
    pub text: String,
    /// The scenario, as the file says it.
    pub base: String,
    /// Overrides of every run.
    pub sets: Vec<(String, String)>,
    /// The axes in the order of the file; the values of the last one change fastest.
    pub axes: Vec<Axis>,
    /// Which combinations are left out.
    pub skips: Vec<Skip>,
    /// Runs of each combination, at least 1.
    pub repetitions: u32,
    /// Where seeds come from.
    pub draws: Draws,
    /// What is collected of each run.
    pub figures: Vec<Figure>,
    /// Confidence of intervals.
    pub confidence: Confidence,
    /// When a combination has enough runs; without it [`Self::repetitions`] are enough.
    pub until: Option<Until>,
    /// Which expectations count.
    pub expect: Expect,
    /// What becomes of combinations that break a rule.
    pub invalid: Invalid,
    /// Where each figure is written.
    places: Vec<Place>,
}

/// Where the seeds of repetitions come from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Draws {
    /// A combination's own: results of different combinations are independent.
    Independent,
    /// The scenario's seed and the numbers after it, the same for all combinations: their differences stray less.
    Common,
}

/// When a combination has enough runs.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Until {
    /// Number of the figure whose mean is to be known, among those of the sweep.
    pub figure: usize,
    /// How well it is to be known.
    pub rule: StopRule,
    /// Most runs.
    pub most: u32,
}

/// Which of the scenario's expectations count in a sweep.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Expect {
    /// All of them.
    All,
    /// Those that the sweep file sets itself, `"expect.clock_failures" = "== 0"`.
    Own,
}

/// What becomes of combinations that break a rule of the bus or of a device.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Invalid {
    /// The sweep does not begin.
    Fail,
    /// They are left out and reported.
    Skip,
}

/// Most repetitions of a combination.
pub const MOST_REPETITIONS: u32 = 1_000_000;
/// Most runs of a sweep. Model: a year of runs that take three seconds.
pub const MOST_RUNS: u64 = 10_000_000;

impl Definition {
    /// Reads the file `path`.
    ///
    /// # Errors
    /// The file cannot be read, or [`Self::parse`] finds something wrong.
    pub fn load(path: &Path) -> Result<Self, ScenarioError> {
        let (name, source, text) = Scenario::text_of(path)?;
        Self::parse(&name, &source, &text)
    }
    /// Reads `text` as the sweep `name`; messages call it `source`.
    ///
    /// # Errors
    /// The text is no TOML, or a key is unknown, missing or wrong. Whether the scenario takes the values is not known yet.
    pub fn parse(name: &str, source: &str, text: &str) -> Result<Self, ScenarioError> {
        let of_text = Source::new(source, text, &[]);
        let root = of_text.parse()?;
        let mut reader = Reader::new(&of_text);
        let read = read(&mut reader, Section::new("", Place::Missing, Some(&root)));
        let problems = reader.take_problems();
        match read {
            Some(read) if problems.is_empty() => {
                Ok(Self { name: name.to_owned(), source: source.to_owned(), text: text.to_owned(), ..read })
            }
            _ => Err(ScenarioError { problems }),
        }
    }
    /// The combinations of its axes.
    pub fn combinations(&self) -> Combinations<'_> {
        Combinations::new(&self.axes)
    }
    /// Where the scenario is: beside this file, unless its path is absolute.
    pub fn base_path(&self) -> PathBuf {
        Path::new(&self.source).parent().unwrap_or(Path::new("")).join(&self.base)
    }
    /// Names of the figures.
    pub fn figure_names(&self) -> Vec<String> {
        self.figures.iter().map(|figure| figure.name().to_owned()).collect()
    }
    /// `fault` of this figure.
    pub(super) fn wrong_figure(&self, figure: usize, fault: Fault) -> ScenarioError {
        self.wrong(self.places[figure], "figures", fault)
    }
    /// `fault` of the file as a whole.
    pub(super) fn wrong_file(&self, fault: Fault) -> ScenarioError {
        self.wrong(Place::Missing, "", fault)
    }
    /// `fault` of `key` at `place`.
    pub(super) fn wrong(&self, place: Place, key: &str, fault: Fault) -> ScenarioError {
        let source = Source::new(&self.source, &self.text, &[]);
        ScenarioError { problems: vec![source.problem(place, key, fault)] }
    }
}

/// Reads everything. `None` if something is missing or wrong; the reader knows what.
fn read(reader: &mut Reader<'_>, mut section: Section<'_>) -> Option<Definition> {
    let s = &mut section;
    let base = s.required(reader, "base", "\"../reference.toml\"", |node| text(node).map(str::to_owned));
    let sets = sets(s, reader);
    let axes: Vec<_> = s.list(reader, "axis").into_iter().map(|section| Axis::read(section, reader)).collect();
    let all_read = axes.iter().all(Option::is_some);
    let axes: Vec<_> = axes.into_iter().flatten().collect();
    twice(reader, &axes, &sets);
    let skips = s.list(reader, "skip");
    let skips = if all_read { skips } else { Vec::new() };
    let skips = skips.iter().filter_map(|section| Skip::read(section, reader, &axes)).collect();
    let repetitions = s.optional(reader, "repetitions", number(1..=MOST_REPETITIONS)).unwrap_or(1);
    let draws = s.optional(reader, "draws", one_of(["independent", "common"], [Draws::Independent, Draws::Common]));
    let figures = figures(s, reader);
    let confidence = s.optional(reader, "confidence", confidence).unwrap_or(Confidence::USUAL);
    let expected = s.optional(reader, "expect", one_of(["all", "own"], [Expect::All, Expect::Own]));
    let invalid = s.optional(reader, "invalid", one_of(["fail", "skip"], [Invalid::Fail, Invalid::Skip]));
    let until = until(s, reader, figures.as_deref().unwrap_or_default(), repetitions);
    let runs = Combinations::new(&axes).len().saturating_mul(repetitions.into());
    if runs > MOST_RUNS {
        let fault = Fault::new(format!("{runs} runs")).rule(format!("a sweep has at most {MOST_RUNS}"));
        reader.complain(Place::Missing, "", fault);
    }
    section.finish(reader);
    let (figures, places) = figures?.into_iter().unzip();
    Some(Definition {
        name: String::new(),
        source: String::new(),
        text: String::new(),
        base: base?,
        sets: sets.into_iter().map(|(key, value, _)| (key, value)).collect(),
        axes,
        skips,
        repetitions,
        draws: draws.unwrap_or(Draws::Independent),
        figures,
        confidence,
        until,
        expect: expected.unwrap_or(Expect::All),
        invalid: invalid.unwrap_or(Invalid::Fail),
        places,
    })
}

/// One of two words and what it means.
fn one_of<T: Copy>(words: [&'static str; 2], meanings: [T; 2]) -> impl Fn(&Node) -> Result<T, Fault> {
    move |node| {
        let word = text(node)?;
        let found = words.into_iter().zip(meanings).find(|&(known, _)| known == word);
        let fault = || Fault::new(format!("\"{word}\" is not known here"));
        found.map(|(_, meaning)| meaning).ok_or_else(|| fault().help(format!("\"{}\" or \"{}\"", words[0], words[1])))
    }
}

/// `until = { ... }`, if it is there.
fn until(s: &mut Section<'_>, reader: &mut Reader<'_>, figures: &[(Figure, Place)], least: u32) -> Option<Until> {
    let mut section = s.table(reader, "until")?;
    let s = &mut section;
    let names = || figures.iter().map(|(figure, _)| figure.name());
    let figure = s.required(reader, "figure", "\"latch_skew.p99\"", |node| {
        let name = text(node)?;
        let number = names().position(|known| known == name);
        number.ok_or_else(|| Fault::new(format!("\"{name}\" is not among the figures")).help(suggestion(name, names())))
    });
    let unit = figure.map(|number| figures[number].0.unit());
    let relative = s.required(reader, "relative_half_width", "0.05", share);
    let floor = s.optional(reader, "half_width", |node| half_width(node, unit)).unwrap_or(0.0);
    let most = s.required(reader, "max_repetitions", "200", number(1..=MOST_REPETITIONS));
    let place = s.place();
    let path = s.path_of("relative_half_width");
    section.finish(reader);
    let (figure, relative, most) = (figure?, relative?, most?);
    let settings = StopSettings { relative, floor, least: least.into(), most: most.into() };
    let fault = |error: StopError| match error {
        StopError::Runs { .. } => Fault::new(format!("{least} repetitions and at most {most} are not in order"))
            .rule(format!("{LEAST} <= repetitions <= max_repetitions: of fewer runs hardly anything is known")),
        StopError::HalfWidth { .. } => Fault::new(error.to_string()),
    };
    let rule = StopRule::new(settings).map_err(|error| reader.complain(place, &path, fault(error))).ok()?;
    Some(Until { figure, rule, most })
}

/// A half width in the unit of a figure.
fn half_width(node: &Node, unit: Option<Unit>) -> Result<f64, Fault> {
    let written = match &node.value {
        Value::Text(text) => text.clone(),
        other => other.literal(),
    };
    let of_unit = match unit {
        Some(unit) if unit.is_time() => Measure::read(&format!("1 {}", unit.text())),
        _ => Measure::read("1"),
    };
    let found = Measure::read(&written).zip(of_unit).filter(|(found, of_unit)| found.is_like(*of_unit));
    let value = found.map(|(found, of_unit)| found.value_in(of_unit)).filter(|&value| value >= 0.0);
    value.ok_or_else(|| Fault::new("this is no half width of this figure").help("such as \"5 ns\" for a time, or 0.1"))
}

/// `0.05` or `"5 %"`.
fn share(node: &Node) -> Result<f64, Fault> {
    let share = match &node.value {
        Value::Text(text) => {
            let percent = text.trim().strip_suffix('%').and_then(|text| text.trim().parse::<f64>().ok());
            percent.map(|percent| percent / 100.0)
        }
        Value::Fraction(text) => text.replace('_', "").parse().ok(),
        _ => None,
    };
    let finite = share.filter(|share| share.is_finite() && *share > 0.0);
    finite.ok_or_else(|| Fault::new("this is no share above 0").help("such as 0.05 or \"5 %\""))
}

/// `[set]`: keys as overrides name them, in one text or as tables.
fn sets(s: &mut Section<'_>, reader: &mut Reader<'_>) -> Vec<(String, String, Place)> {
    let Some(table) = s.table(reader, "set") else { return Vec::new() };
    let mut sets = Vec::new();
    for (first, (place, node)) in table.all().into_iter().flat_map(|table| &table.0) {
        let levels = if TABLES_OF_ONE.contains(&first.as_str()) { 1 } else { 2 };
        match &node.value {
            Value::Table(_) if !first.contains('.') => below(first, node, levels, &mut sets),
            _ => sets.push((first.clone(), node.value.as_override(), *place)),
        }
    }
    sets
}

/// The keys under `before`, as many levels of tables down as make a key.
fn below(before: &str, node: &Node, levels: u8, sets: &mut Vec<(String, String, Place)>) {
    let Value::Table(table) = &node.value else {
        return sets.push((before.to_owned(), node.value.as_override(), node.place));
    };
    for (key, (place, node)) in &table.0 {
        let path = format!("{before}.{key}");
        match levels {
            0 | 1 => sets.push((path, node.value.as_override(), *place)),
            _ => below(&path, node, levels - 1, sets),
        }
    }
}

/// Complains about names of axes, and keys, that are there twice.
fn twice(reader: &mut Reader<'_>, axes: &[Axis], sets: &[(String, String, Place)]) {
    let mut known: Vec<&str> = sets.iter().map(|(key, ..)| key.as_str()).collect();
    for axis in axes {
        for key in &axis.keys {
            if known.contains(&key.as_str()) {
                let fault = Fault::new(format!("{key} is set twice")).rule("one axis, or [set], says what a key is");
                reader.complain(axis.place, &axis.name, fault);
            }
            known.push(key);
        }
    }
    for (number, axis) in axes.iter().enumerate() {
        if axes[..number].iter().any(|other| other.name == axis.name) {
            let fault = Fault::new(format!("two axes are called {}", axis.name)).help("give one of them another name");
            reader.complain(axis.place, &axis.name, fault);
        }
    }
}

/// `figures = [...]`, each with its place.
fn figures(s: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Vec<(Figure, Place)>> {
    let items = s.required(reader, "figures", "[\"latch_skew.p99\", \"faults\"]", |node| match &node.value {
        Value::List(items) if !items.is_empty() => Ok(items.clone()),
        Value::List(_) => Err(Fault::new("a sweep without figures shows nothing")),
        other => Err(Fault::new(format!("this is {}", other.noun())).help("write figures = [\"latch_skew.p99\"]")),
    })?;
    let mut figures: Vec<(Figure, Place)> = Vec::new();
    for item in &items {
        match figure(item, &figures) {
            Ok(figure) => figures.push((figure, item.place)),
            Err(fault) => reader.complain(item.place, "figures", fault),
        }
    }
    (figures.len() == items.len()).then_some(figures)
}

/// One figure, which is not among the `others`.
fn figure(node: &Node, others: &[(Figure, Place)]) -> Result<Figure, Fault> {
    let name = text(node)?;
    let figure = Figure::named(name).map_err(|error| Fault::new(error.message).help(error.help))?;
    if matches!(figure.who(), Who::Each(_)) {
        let fault = Fault::new(format!("\"{name}\" has as many values as there are subjects"));
        return Err(fault.help("ask for .min. or .max. instead of .each., or for one of them"));
    }
    if others.iter().any(|(other, _)| other.name() == figure.name()) {
        return Err(Fault::new(format!("\"{name}\" is there twice")));
    }
    Ok(figure)
}

/// `"95 %"` or `0.95`.
fn confidence(node: &Node) -> Result<Confidence, Fault> {
    let usual = share(node).ok().filter(|share| (0.5..=0.9999).contains(share));
    usual.and_then(|share| Confidence::new(share).ok()).ok_or_else(|| {
        Fault::new("this is no confidence of an interval").help("from 0.5 to 0.9999, such as 0.95 or \"95 %\"")
    })
}
