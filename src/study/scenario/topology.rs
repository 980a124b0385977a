//! Topology of a scenario: segments of cable, the repeaters and optical links that join them, and where stations sit.
//!
//! Without `[[segment]]` the network is one segment, the cable of `[bus]`. A ring of optical link modules is written as
//! the tree that is in use: its redundant link carries nothing until another one breaks.

use super::check::about;
use super::error::Fault;
use super::read::list;
use super::section::{Reader, Section, choice, number, quantity, text};
use super::tree::{Node, Table};
use super::{Bus, Scenario};
use crate::sim::topology::{CABLE_DELAY, Link, Place, Tree, TreeError, cable_delay};
use crate::study::quantity::{millimetres, span};
use crate::time::{BitRate, Span, Tbit};
use crate::wire::Address;

/// Most loads of a segment: stations, and each repeater or module that is connected to it (EN 50170-2, RS 485).
pub const LOADS_MAX: usize = 32;
/// Most repeaters in series (technology overview of an ABB manual: "max. 9 repeaters with signal refreshing").
const SERIES_MAX: usize = 9;
/// Longest delay of a repeater or module. Model: no device is slower, optical modules take 4 t_bit.
const DELAY_MAX: Span = Span::from_ms(1);

/// A segment of cable.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Segment {
    /// Its name; empty for the only segment of a network without `[[segment]]`.
    pub name: String,
    /// Length of its cable (mm), at most [`Bus::MAX_CABLE_MM`].
    pub cable_mm: u64,
    /// Delay of one metre, 5 ns by default (PROFIBUS network manual).
    pub delay_per_metre: Span,
}

/// A place on the cables.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Point {
    /// Index of the segment.
    pub segment: u8,
    /// From the beginning of its cable (mm).
    pub mm: u64,
}

/// What kind of device joins two segments.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RepeaterKind {
    /// Its name in a scenario.
    pub name: &'static str,
    /// For people.
    pub what: &'static str,
    /// Delay of one module (t_bit).
    pub delay: Tbit,
    /// Modules one behind the other.
    pub modules: u8,
}

/// Every kind of device between two segments.
pub const KINDS: &[RepeaterKind] = &[
    // Model: no source gives a delay. It refreshes bits as an optical module does, 4 t_bit, with one medium less.
    RepeaterKind { name: "repeater", what: "RS 485 repeater", delay: Tbit(2), modules: 1 },
    // Manual of the OLM 12M: 4 t_bit per module.
    RepeaterKind { name: "olm", what: "optical link modules with fibre between them", delay: Tbit(4), modules: 2 },
    // Manual of the ILM: 9 t_bit per link, which is a pair of them.
    RepeaterKind { name: "ilm", what: "infrared link", delay: Tbit(9), modules: 1 },
];

/// A repeater, or link modules in a row, between two segments.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Repeater {
    /// Its name; its draws hang on it. By default the segments' names.
    pub name: String,
    /// What it is.
    pub kind: &'static RepeaterKind,
    /// Where it is connected.
    pub ends: [Point; 2],
    /// Delay of each module, without jitter.
    pub delay: Span,
    /// How many modules are in the row.
    pub modules: u8,
    /// Length of all fibre between the modules (mm), 5 ns/m (Model: glass of index 1.5).
    pub fibre_mm: u64,
    /// Each telegram's delay strays by up to this, either way (Model: uniform, one draw per telegram).
    pub jitter: Span,
}

impl Repeater {
    /// How long a telegram takes through it, without jitter.
    pub fn crossing(&self) -> Span {
        self.delay * i64::from(self.modules) + cable_delay(self.fibre_mm, CABLE_DELAY)
    }
}

/// Segments and what joins them: a tree.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Topology {
    segments: Vec<Segment>,
    repeaters: Vec<Repeater>,
    tree: Tree,
}

impl Topology {
    /// One segment, `cable_mm` long.
    pub fn line(cable_mm: u64) -> Self {
        let segment = Segment { name: String::new(), cable_mm, delay_per_metre: CABLE_DELAY };
        Self { segments: vec![segment], repeaters: Vec::new(), tree: Tree::line() }
    }
    /// `segments` joined by `repeaters`.
    ///
    /// # Errors
    /// The first repeater that closes a loop, or else the first segment that is not connected to the first one.
    pub fn new(segments: Vec<Segment>, repeaters: Vec<Repeater>) -> Result<Self, TreeError> {
        let place = |point: Point| place(&segments, point);
        let links = repeaters.iter().map(|r| Link { ends: r.ends.map(place), delay: r.crossing() }).collect();
        let tree = Tree::new(segments.len(), links)?;
        Ok(Self { segments, repeaters, tree })
    }
    /// Whether the scenario names segments.
    pub fn has_segments(&self) -> bool {
        self.segments.iter().any(|segment| !segment.name.is_empty())
    }
    /// The segments in the order of the file.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }
    /// What joins them, in the order of the file.
    pub fn repeaters(&self) -> &[Repeater] {
        &self.repeaters
    }
    /// The same with all delays in true time.
    pub const fn tree(&self) -> &Tree {
        &self.tree
    }
    /// The place in true time that `point` is.
    pub fn place(&self, point: Point) -> Place {
        place(&self.segments, point)
    }
    /// How long a telegram takes from `from` to `to`, without jitter.
    pub fn delay(&self, from: Point, to: Point) -> Span {
        self.tree.delay(self.place(from), self.place(to))
    }
    /// T_TD from `from` to `to`: how long a telegram may take, each cable rounded up to a tick, with the worst jitter.
    pub fn t_td(&self, from: Point, to: Point) -> Span {
        let cable = |a: Point, b: Point| {
            let per_metre = self.segments[usize::from(a.segment)].delay_per_metre.ticks() as u64;
            Span::from_ticks((a.mm.abs_diff(b.mm) * per_metre).div_ceil(1_000) as i64)
        };
        let (mut at, mut t_td) = (from, Span::ZERO);
        for (index, near) in self.tree.path(from.segment, to.segment) {
            let repeater = &self.repeaters[index];
            t_td += cable(at, repeater.ends[near]) + repeater.crossing() + repeater.jitter;
            at = repeater.ends[1 - near];
        }
        t_td + cable(at, to)
    }
    /// The longest T_TD between any two ends of cables.
    pub fn t_td_max(&self) -> Span {
        let ends: Vec<_> = self
            .segments
            .iter()
            .zip(0..)
            .flat_map(|(s, segment)| [0, s.cable_mm].map(|mm| Point { segment, mm }))
            .collect();
        let from = |&from: &Point| ends.iter().map(move |&to| self.t_td(from, to)).collect::<Vec<_>>();
        ends.iter().flat_map(from).max().unwrap_or_default()
    }
    /// The sum of `what` over the repeaters between two segments, where it is largest.
    fn largest<T: core::iter::Sum + Ord + Default>(&self, what: impl Fn(&Repeater) -> T) -> T {
        let segments = 0..self.segments.len() as u8;
        let path = |a, b| self.tree.path(a, b).map(|(index, _)| what(&self.repeaters[index])).sum();
        segments
            .clone()
            .flat_map(|a| segments.clone().map(move |b| (a, b)))
            .map(|(a, b)| path(a, b))
            .max()
            .unwrap_or_default()
    }
}

fn place(segments: &[Segment], point: Point) -> Place {
    let per_metre = segments[usize::from(point.segment)].delay_per_metre;
    Place::new(point.segment, cable_delay(point.mm, per_metre))
}

impl Scenario {
    /// Where the station at `address` sits; `None` if there is none.
    pub fn point(&self, address: Address) -> Option<Point> {
        self.stations().find(|station| station.address == address).map(|station| station.point)
    }
    /// How long a telegram takes between two stations, without jitter; no time if one of them does not exist.
    pub fn delay(&self, from: Address, to: Address) -> Span {
        self.point(from).zip(self.point(to)).map_or(Span::ZERO, |(from, to)| self.topology.delay(from, to))
    }
    /// T_TD between two stations: how long a telegram may take; no time if one of them does not exist.
    pub fn t_td(&self, from: Address, to: Address) -> Span {
        self.point(from).zip(self.point(to)).map_or(Span::ZERO, |(from, to)| self.topology.t_td(from, to))
    }
    /// Loads of the segment with this index: the stations on it, silent ones too, and what else is connected to it.
    pub fn loads(&self, segment: u8) -> usize {
        let stations = self.stations().filter(|station| station.point.segment == segment).count();
        let ends = self.topology.repeaters.iter().flat_map(|repeater| repeater.ends);
        stations + ends.filter(|end| end.segment == segment).count()
    }
    /// What a network like this should not have, but may: a sentence each.
    pub fn wiring_warnings(&self) -> Vec<String> {
        let rate = self.bus.params.rate;
        let limit = longest_cable_mm(rate);
        let long = self.topology.segments.iter().filter(|segment| segment.cable_mm > limit);
        let mut warnings: Vec<_> = long
            .map(|segment| {
                format!(
                    "{} of cable{} are more than a segment has at {rate}: at most {} (EN 50170-2, cable type A)",
                    metres(segment.cable_mm),
                    on(segment),
                    metres(limit)
                )
            })
            .collect();
        let series = self.topology.largest(|repeater| usize::from(repeater.kind.name == "repeater"));
        if series > SERIES_MAX {
            warnings.push(format!(
                "{series} repeaters in series are more than a network should have: at most {SERIES_MAX} (vendors' manuals)"
            ));
        }
        warnings
    }
}

/// Longest cable of one segment at `rate` (mm): EN 50170-2, cable type A.
const fn longest_cable_mm(rate: BitRate) -> u64 {
    match rate {
        BitRate::M3 | BitRate::M6 | BitRate::M12 => 100_000,
        BitRate::M1_5 => 200_000,
        BitRate::K500 => 400_000,
        BitRate::K187_5 => 1_000_000,
        _ => 1_200_000,
    }
}

/// ` on segment "name"`, nothing for a segment without name.
fn on(segment: &Segment) -> String {
    if segment.name.is_empty() { String::new() } else { format!(" on segment \"{}\"", segment.name) }
}

/// A length as people write it.
pub(in crate::study) fn metres(mm: u64) -> String {
    match mm % 1_000 {
        0 => format!("{} m", mm / 1_000),
        _ => format!("{mm} mm"),
    }
}

/// A length of cable (mm).
pub(super) fn cable(node: &Node) -> Result<u64, Fault> {
    match quantity("100 m", millimetres)(node)? {
        mm if mm > Bus::MAX_CABLE_MM => Err(Fault::new("no cable is longer than 100 km")),
        mm => Ok(mm),
    }
}

/// A time that a signal takes, with bit times at `rate`.
fn delay(rate: BitRate) -> impl Fn(&Node) -> Result<Span, Fault> {
    move |node| match quantity("2 tbit", |text| span(text, Some(rate)))(node)? {
        span if span < Span::ZERO => Err(Fault::new(format!("{span} is negative"))),
        span if span > DELAY_MAX => {
            Err(Fault::new(format!("{span} is longer than any such device takes")).help(format!("at most {DELAY_MAX}")))
        }
        span => Ok(span),
    }
}

/// The name of a segment or a repeater.
fn name(node: &Node) -> Result<String, Fault> {
    match text(node)?.trim() {
        "" => Err(Fault::new("this name is empty")),
        name if name.chars().count() > 40 || name.chars().any(char::is_control) => {
            Err(Fault::new("this is too long for a name, or not printable").help("at most 40 characters"))
        }
        name => Ok(name.to_owned()),
    }
}

/// The index of the segment that a node names.
fn segment(node: &Node, segments: &[Segment]) -> Result<u8, Fault> {
    let named = text(node)?.trim();
    let known = || segments.iter().map(|segment| segment.name.as_str());
    match known().position(|name| name == named) {
        Some(index) => Ok(index as u8),
        None if segments.is_empty() => {
            Err(Fault::new("there are no segments").help("add [[segment]] with name and cable"))
        }
        None => Err(Fault::new("there is no such segment").help(super::suggestion(named, known()))),
    }
}

/// Reads `[[segment]]` and `[[repeater]]`; without them the network is a line of `cable_mm`. `None` if they are wrong.
pub(super) fn read(reader: &mut Reader<'_>, root: &Table, rate: BitRate, cable_mm: u64) -> Option<Topology> {
    let segments = list(reader, root, "segment", |section, reader| read_segment(section, reader, rate));
    let given = root.get("segment").is_some();
    same_names(reader, "segment", segments.iter().map(|segment| segment.name.as_str()));
    if segments.len() > Tree::MAX_SEGMENTS {
        let fault = Fault::new(format!("{} segments are too many", segments.len()))
            .rule(format!("a network has at most {} segments (Model: one per address)", Tree::MAX_SEGMENTS));
        about(reader, &format!("segment.{}.name", Tree::MAX_SEGMENTS + 1), &[], fault);
        return None;
    }
    if given {
        bus_cable(reader);
    }
    let repeaters = list(reader, root, "repeater", |section, reader| read_repeater(section, reader, rate, &segments));
    same_names(reader, "repeater", repeaters.iter().map(|repeater| repeater.name.as_str()));
    if !given {
        return Some(Topology::line(cable_mm));
    }
    if segments.is_empty() || reader.has_problems() {
        return None;
    }
    let names: Vec<_> = segments.iter().map(|segment| segment.name.clone()).collect();
    Topology::new(segments, repeaters).map_err(|error| no_tree(reader, error, &names)).ok()
}

/// `[bus] cable` says nothing where segments have their own.
fn bus_cable(reader: &mut Reader<'_>) {
    if reader.places.contains_key("bus.cable") {
        let fault = Fault::new("with [[segment]] each segment has its own cable")
            .help("remove it; under [[segment]]: cable = \"100 m\"");
        about(reader, "bus.cable", &[], fault);
    }
}

fn no_tree(reader: &mut Reader<'_>, error: TreeError, names: &[String]) {
    match error {
        TreeError::Loop(index) => {
            let fault = Fault::new("this repeater closes a loop: its two ends are connected without it")
                .rule("segments and repeaters are a tree (EN 50170-2; a telegram would go round for ever)")
                .help("of an optical ring, write the links that are in use and leave out the redundant one");
            about(reader, &format!("repeater.{}.to", index + 1), &[], fault);
        }
        TreeError::Apart(index) => {
            let fault = Fault::new(format!("segment \"{}\" is not connected to \"{}\"", names[index], names[0]))
                .help("add a [[repeater]] with from and to");
            about(reader, &format!("segment.{}.name", index + 1), &[], fault);
        }
    }
}

/// Complains about a name that was there before.
fn same_names<'n>(reader: &mut Reader<'_>, table: &str, names: impl Iterator<Item = &'n str>) {
    let names: Vec<_> = names.collect();
    for (index, name) in names.iter().enumerate().filter(|&(index, name)| names[..index].contains(name)) {
        let fault = Fault::new(format!("two of them are called \"{name}\"")).help("each has a name of its own");
        let path = format!("{table}.{}", index + 1);
        about(reader, &format!("{path}.name"), &[&format!("{path}.to")], fault);
    }
}

fn read_segment(mut section: Section<'_>, reader: &mut Reader<'_>, rate: BitRate) -> Option<Segment> {
    let name = section.required(reader, "name", "\"hall 1\"", name);
    let cable_mm = section.optional(reader, "cable", cable).unwrap_or(0);
    let delay_per_metre = section.optional(reader, "delay_per_metre", |node| match delay(rate)(node)? {
        // Light in a vacuum takes 3.3 ns.
        span if span <= Span::from_ticks(40) || span > Span::from_ns(30) => {
            Err(Fault::new(format!("{span} per metre is not a cable's")).help("copper and glass take 5 ns"))
        }
        span => Ok(span),
    });
    section.finish(reader);
    Some(Segment { name: name?, cable_mm, delay_per_metre: delay_per_metre.unwrap_or(CABLE_DELAY) })
}

fn read_repeater(
    mut section: Section<'_>,
    reader: &mut Reader<'_>,
    rate: BitRate,
    segments: &[Segment],
) -> Option<Repeater> {
    let s = &mut section;
    let own_name = s.optional(reader, "name", name);
    let kind = s.optional(reader, "kind", |node| choice(node, "kind of repeater", KINDS, |kind| kind.name));
    let kind = kind.or_else(|| (!s.has("kind")).then_some(&KINDS[0]));
    let from = s.required(reader, "from", "\"hall 1\"", |node| segment(node, segments));
    let to = s.required(reader, "to", "\"hall 2\"", |node| segment(node, segments));
    // By default from the end of one cable to the beginning of the next.
    let far_end = from.map_or(0, |from| segments[usize::from(from)].cable_mm);
    let from_mm = s.optional(reader, "from_position", cable).unwrap_or(far_end);
    let to_mm = s.optional(reader, "to_position", cable).unwrap_or(0);
    let own_delay = s.optional(reader, "delay", delay(rate));
    let jitter = s.optional(reader, "jitter", delay(rate)).unwrap_or(Span::ZERO);
    let modules = s.optional(reader, "modules", number(1..=127));
    let fibre_mm = s.optional(reader, "fibre", cable).unwrap_or(0);
    if kind.is_some_and(|kind| kind.name != "olm") && (s.has("modules") || s.has("fibre")) {
        s.complain(reader, Fault::new("only optical link modules have modules and fibre").help("kind = \"olm\""));
    }
    section.finish(reader);
    let (kind, from, to) = (kind?, from?, to?);
    let of = |segment: u8| segments[usize::from(segment)].name.as_str();
    Some(Repeater {
        name: own_name.unwrap_or_else(|| format!("{} - {}", of(from), of(to))),
        kind,
        ends: [Point { segment: from, mm: from_mm }, Point { segment: to, mm: to_mm }],
        delay: own_delay.unwrap_or_else(|| rate.span(kind.delay)),
        modules: modules.unwrap_or(kind.modules),
        fibre_mm,
        jitter,
    })
}

/// Reads the key `segment` of a station; without it, the first one where there is only one.
pub(super) fn station_segment(section: &mut Section<'_>, reader: &mut Reader<'_>, topology: Option<&Topology>) -> u8 {
    // What is wrong with the segments themselves is known already.
    let Some(topology) = topology else {
        section.optional(reader, "segment", |_| Ok(()));
        return 0;
    };
    let segments = if topology.has_segments() { topology.segments() } else { &[] };
    let read = |node: &Node| segment(node, segments);
    let index = if segments.len() > 1 {
        section.required(reader, "segment", &format!("\"{}\"", segments[0].name), read)
    } else {
        section.optional(reader, "segment", read)
    };
    index.unwrap_or(0)
}

/// Where slaves with these tables sit by default (mm): spread evenly along their segment in the order of the tables, the
/// last one at its end. The beginning is the master's or the repeater's.
pub(super) fn spread<'t>(topology: &Topology, slaves: impl Iterator<Item = &'t Table>) -> Vec<u64> {
    let index =
        |table: &Table| table.get("segment").and_then(|node| segment(node, &topology.segments).ok()).unwrap_or(0);
    let on: Vec<_> = slaves.map(index).collect();
    let position = |(rank, &segment): (usize, &u8)| {
        let here = || on.iter().enumerate().filter(|&(_, &other)| other == segment);
        let (before, all) = (here().filter(|&(other, _)| other < rank).count() as u64, here().count() as u64);
        topology.segments[usize::from(segment)].cable_mm * (before + 1) / all
    };
    on.iter().enumerate().map(position).collect()
}

/// Rule: no station and no repeater sits beyond the end of its cable.
pub(super) fn positions(scenario: &Scenario, reader: &mut Reader<'_>) {
    let stations = scenario.stations().map(|station| (station.point, format!("{}.position", station.path())));
    let repeaters = scenario.topology.repeaters.iter().enumerate();
    let ends = repeaters.flat_map(|(i, repeater)| {
        let [from, to] = ["from_position", "to_position"].map(|key| format!("repeater.{}.{key}", i + 1));
        [(repeater.ends[0], from), (repeater.ends[1], to)]
    });
    for (Point { segment, mm }, key) in stations.chain(ends) {
        let segment = &scenario.topology.segments[usize::from(segment)];
        let cable = segment.cable_mm;
        if mm > cable {
            let (rule, table) = if segment.name.is_empty() {
                (format!("a station is 0 m to {} along the cable (Model: one line)", metres(cable)), "[bus]".to_owned())
            } else {
                let name = &segment.name;
                let rule = format!("what is on segment \"{name}\" is 0 m to {} along its cable", metres(cable));
                (rule, format!("[[segment]] \"{name}\""))
            };
            let fault = Fault::new(format!("{} is beyond the end of the cable", metres(mm)))
                .rule(rule)
                .help(format!("for example under {table}: cable = \"{}\"", metres(mm)));
            about(reader, &key, &[], fault);
        }
    }
}

/// Rule: a segment has at most 32 loads.
pub(super) fn loads(scenario: &Scenario, reader: &mut Reader<'_>) {
    for (index, segment) in scenario.topology.segments.iter().enumerate() {
        let index = index as u8;
        let loads = scenario.loads(index);
        if loads <= LOADS_MAX {
            continue;
        }
        let on = on(segment);
        let fault = Fault::new(format!("{loads} stations and repeaters are too many{on}"))
            .rule(format!(
                "a segment has at most {LOADS_MAX} loads, each station and each repeater or link module on it counts \
                 as one (EN 50170-2, RS 485)"
            ))
            .help("divide it: [[segment]] with name and cable, [[repeater]] with from and to, and segment for each station");
        let last = scenario.stations().filter(|station| station.point.segment == index).last();
        let address = last.map_or(String::new(), |station| format!("{}.address", station.path()));
        let key = if segment.name.is_empty() { address.clone() } else { format!("segment.{}.name", index + 1) };
        about(reader, &key, &[&address], fault);
    }
}

/// Rules: jitter is never more than the delay that it strays from, and no telegram reaches the one before it.
pub(super) fn jitter(scenario: &Scenario, reader: &mut Reader<'_>) {
    let topology = &scenario.topology;
    for (i, repeater) in topology.repeaters.iter().enumerate().filter(|(_, r)| r.jitter > r.crossing()) {
        let (jitter, delay) = (repeater.jitter, repeater.crossing());
        let fault = Fault::new(format!("a jitter of {jitter} is more than the delay of {delay}"))
            .rule("nothing leaves a repeater before it has come")
            .help(format!("at most {delay}, or a longer delay"));
        about(reader, &format!("repeater.{}.jitter", i + 1), &[], fault);
    }
    let (sum, idle) = (topology.largest(|repeater| repeater.jitter.ticks()), scenario.bus.params);
    let (sum, idle) = (Span::from_ticks(2 * sum), idle.span(idle.min_tsdr));
    if sum >= idle {
        let fault = Fault::new(format!("the repeaters on a path may move telegrams against each other by {sum}"))
            .rule(format!(
                "twice the jitter along any path is less than the shortest pause, min T_SDR = {idle} (Model)"
            ))
            .help("less jitter, or a longer min_tsdr");
        let jitters: Vec<_> = (1..=topology.repeaters.len()).map(|i| format!("repeater.{i}.jitter")).collect();
        about(reader, "repeater", &jitters.iter().map(String::as_str).collect::<Vec<_>>(), fault);
    }
}
