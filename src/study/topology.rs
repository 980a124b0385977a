//! Topology: the segments of a network, what joins them and who sits where, as a map for people.

use super::scenario::Scenario;
use super::scenario::topology::{LOADS_MAX, metres};
use crate::time::Span;
use crate::wire::Address;

/// The map of a network.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Map {
    /// The segments, the master's first, each before those that are reached through it.
    pub segments: Vec<Segment>,
}

/// One segment.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Segment {
    /// Its name; empty for the only segment of a network without names.
    pub name: String,
    /// Length of its cable (mm).
    pub cable_mm: u64,
    /// How many of the 32 loads it has.
    pub loads: usize,
    /// The stations from the beginning of the cable to its end.
    pub stations: Vec<Station>,
    /// By what it is reached; none for the master's.
    pub via: Option<Via>,
    /// How many links lie between it and the master's.
    pub depth: usize,
}

/// One station.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Station {
    /// Its address.
    pub address: Address,
    /// Its device; `master` for the master.
    pub device: String,
    /// Where on the cable it sits (mm).
    pub mm: u64,
    /// How long a telegram of the master takes to it, without jitter.
    pub delay: Span,
}

/// The link by which a segment is reached from the master.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Via {
    /// Index in the map of the segment on the master's side.
    pub from: usize,
    /// Where it is connected there (mm).
    pub from_mm: u64,
    /// Where it is connected here (mm).
    pub to_mm: u64,
    /// What it is: `repeater`, `2 olm, 300 m fibre`.
    pub what: String,
    /// How long a telegram takes through it.
    pub delay: Span,
    /// By how much that strays, to each side.
    pub jitter: Span,
}

impl Via {
    /// Delay with jitter, if there is any.
    pub fn delay_text(&self) -> String {
        if self.jitter > Span::ZERO { format!("{} +- {}", self.delay, self.jitter) } else { self.delay.to_string() }
    }
}

impl Map {
    /// The map of a checked scenario.
    pub fn of(scenario: &Scenario) -> Self {
        let mut map = Self::default();
        map.add(scenario, scenario.master.segment, None);
        map
    }
    /// Adds the segment `index` of the scenario, reached through the repeater of this index, and all that are behind it.
    fn add(&mut self, scenario: &Scenario, index: u8, via: Option<(usize, Via)>) {
        let topology = &scenario.topology;
        let segment = &topology.segments()[usize::from(index)];
        let depth = via.as_ref().map_or(0, |(_, via)| self.segments[via.from].depth + 1);
        let own = self.segments.len();
        let (came, via) = via.unzip();
        self.segments.push(Segment {
            name: segment.name.clone(),
            cable_mm: segment.cable_mm,
            loads: scenario.loads(index),
            stations: stations(scenario, index),
            via,
            depth,
        });
        let mut branches: Vec<_> = topology
            .repeaters()
            .iter()
            .enumerate()
            .filter(|&(repeater, _)| Some(repeater) != came)
            .filter_map(|(number, repeater)| {
                let near = repeater.ends.iter().position(|end| end.segment == index)?;
                Some((repeater.ends[near], number, repeater.ends[1 - near]))
            })
            .collect();
        branches.sort_by_key(|&(near, number, _)| (near.mm, number));
        for (near, number, far) in branches {
            let repeater = &topology.repeaters()[number];
            let modules = if repeater.modules > 1 { format!("{} ", repeater.modules) } else { String::new() };
            let fibre =
                if repeater.fibre_mm > 0 { format!(", {} fibre", metres(repeater.fibre_mm)) } else { String::new() };
            let via = Via {
                from: own,
                from_mm: near.mm,
                to_mm: far.mm,
                what: format!("{modules}{}{fibre}", repeater.kind.name),
                delay: repeater.crossing(),
                jitter: repeater.jitter,
            };
            self.add(scenario, far.segment, Some((number, via)));
        }
    }
    /// The station that a telegram of the master reaches last, the first one of several.
    pub fn farthest(&self) -> Option<&Station> {
        let stations = self.segments.iter().flat_map(|segment| &segment.stations);
        stations.reduce(|far, station| if station.delay > far.delay { station } else { far })
    }

    /// A drawing in text: a tree of segments with their stations in short, or with `every` station on its own line.
    pub fn text(&self, every: bool) -> Vec<String> {
        let mut lines = Vec::new();
        if let Some(Station { address, delay, .. }) = self.farthest() {
            lines.push(format!("topology: {}, farthest from the master is station {address}, {delay}", self.counted()));
        }
        for segment in &self.segments {
            let indent = "   ".repeat(segment.depth);
            if let Some(via) = &segment.via {
                let above = "   ".repeat(segment.depth - 1);
                let (at, to) = (metres(via.from_mm), metres(via.to_mm));
                lines.push(format!("{above}|  at {at}: {}, {}, to {to}", via.what, via.delay_text()));
                lines.push(format!("{above}+--{}", segment.title()));
            } else {
                lines.push(segment.title());
            }
            if every {
                let rows = segment.stations.iter().map(|station| {
                    let Station { address, device, mm, delay } = station;
                    format!("{indent}|  {:>9}  {address:>3}  {device:<26} {delay}", metres(*mm))
                });
                lines.extend(rows);
            } else if let Some(line) = segment.stations_in_short() {
                lines.push(format!("{indent}|  {line}"));
            }
        }
        lines
    }
    /// `3 segments`, `1 segment`.
    pub fn counted(&self) -> String {
        let count = self.segments.len();
        format!("{count} segment{}", if count == 1 { "" } else { "s" })
    }
}

impl Segment {
    /// Name, length and loads.
    pub fn title(&self) -> String {
        let name = if self.name.is_empty() { "cable" } else { &self.name };
        format!("{name}: {}, {} of {LOADS_MAX} loads", metres(self.cable_mm), self.loads)
    }
    /// `2, 3..10, 0 ns to 500 ns from the master`.
    fn stations_in_short(&self) -> Option<String> {
        let mut addresses: Vec<_> = self.stations.iter().map(|station| station.address.get()).collect();
        addresses.sort_unstable();
        let delays = || self.stations.iter().map(|station| station.delay);
        let (least, most) = (delays().min()?, delays().max()?);
        let delays = if least == most { most.to_string() } else { format!("{least} to {most}") };
        Some(format!("{}: {delays} from the master", super::report::ranges(&addresses)))
    }
}

/// The stations of the segment `index`, from the beginning of the cable to its end.
fn stations(scenario: &Scenario, index: u8) -> Vec<Station> {
    let here = scenario.stations().filter(|station| station.point.segment == index).map(|station| {
        let delay = scenario.delay(scenario.master.address, station.address);
        Station { address: station.address, device: station.what.to_owned(), mm: station.point.mm, delay }
    });
    let mut here: Vec<_> = here.collect();
    here.sort_by_key(|station| (station.mm, station.address));
    here
}
