//! Trail: what a file keeps of a run, so that a later run can be compared with it happening by happening.
//!
//! A run is too long to be kept whole. A trail has three parts:
//!
//! | part | keeps | up to |
//! |---|---|---|
//! | journal | every telegram and observation, as text | the first [`JOURNAL`] |
//! | events | every event, as text | the first [`EVENTS`] |
//! | digests | 24 bits of a hash of all that a station did until the beginning of a cycle | [`DIGESTS`], evenly spread |
//!
//! Where the journal or the events part, both values are known. Where the digests part, the station is known and the
//! cycle, or the stretch of 2^k cycles in a long run; what the station did there is not.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::observation::Observation;
use crate::sim::fingerprint::Digest;
use crate::sim::network::{Network, NetworkEvent};
use crate::sim::queue::Queue;
use crate::sim::record::{Recorder, Stamp, Transmission};
use crate::study::build;
use crate::study::difference::{Difference, Differences, Happening, What};
use crate::study::event_budget::{EventBudget, NoHeadway};
use crate::study::scenario::Scenario;
use crate::time::Time;
use crate::wire::Address;

/// Most lines of a journal. Model: a third of a megabyte, the start-up of ten slaves.
pub const JOURNAL: usize = 4_000;
/// Most events of a trail. Model: a megabyte; a run with more has its trouble in the first of them.
pub const EVENTS: usize = 20_000;
/// Most digests of a trail, of all stations. Model: a megabyte, 10 000 cycles of 13 stations.
pub const DIGESTS: usize = 131_072;
/// Hexadecimal digits of a digest: 24 bits. One that is the same by chance, once in 16 million, is found a cycle late.
const DIGITS: usize = 6;

/// One line of a journal or of the events.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Line {
    pub(super) station: Address,
    pub(super) happening: Happening,
}

impl Line {
    /// `ticks cycle station text`, with `-` before the first cycle.
    pub(super) fn emit(&self) -> String {
        let Happening { cycle, at, what } = &self.happening;
        let cycle = cycle.map_or_else(|| "-".to_owned(), |cycle| cycle.to_string());
        format!("{} {cycle} {} {what}", at.ticks(), self.station)
    }
    /// Reads what [`Self::emit`] wrote.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let mut parts = text.splitn(4, ' ');
        let at = Time::from_ticks(parts.next()?.parse().ok()?);
        let cycle = match parts.next()? {
            "-" => None,
            cycle => Some(cycle.parse().ok()?),
        };
        let station = parts.next()?.parse().ok().and_then(Address::new)?;
        let what = What::Told(parts.next()?.to_owned());
        Some(Self { station, happening: Happening { cycle, at, what } })
    }
}

/// The first lines of something.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Log {
    pub(super) most: usize,
    pub(super) lines: Vec<Line>,
    /// Up to when it is whole: when the first line came that is left out, or the run ended.
    pub(super) until: Option<Time>,
}

impl Log {
    pub(super) const fn new(most: usize) -> Self {
        Self { most, lines: Vec::new(), until: None }
    }
    fn add(&mut self, station: Address, happening: impl FnOnce() -> Happening) {
        if self.lines.len() < self.most {
            let Happening { cycle, at, what } = happening();
            let what = What::Told(what.to_string());
            self.lines.push(Line { station, happening: Happening { cycle, at, what } });
        } else if self.until.is_none() {
            self.until = Some(happening().at);
        }
    }
    /// For each station the first line that the other log has not, as far as both are whole; the earliest first.
    fn differences(&self, other: &Self) -> Vec<Difference> {
        let until = self.until.into_iter().chain(other.until).min().unwrap_or(Time::MAX);
        let lanes = |log: &Self| {
            let mut lanes: BTreeMap<Address, Vec<Happening>> = BTreeMap::new();
            for line in log.lines.iter().filter(|line| line.happening.at < until) {
                lanes.entry(line.station).or_default().push(line.happening.clone());
            }
            lanes
        };
        let (before, mut now) = (lanes(self), lanes(other));
        let mut found = Vec::new();
        for (station, before) in before {
            found.extend(parting(station, &before, &now.remove(&station).unwrap_or_default()));
        }
        found.extend(now.into_iter().filter_map(|(station, now)| parting(station, &[], &now)));
        found.sort_by_key(|difference| (difference.at(), difference.station));
        found
    }
}

/// Where two lanes of one station part.
fn parting(station: Address, before: &[Happening], now: &[Happening]) -> Option<Difference> {
    let same = before.iter().zip(now).take_while(|(before, now)| before.agrees_with(now)).count();
    let [before, now] = [before, now].map(|lane| lane.get(same).cloned());
    (before.is_some() || now.is_some()).then_some(Difference { station, before, now })
}

/// The digests of one station.
struct Column {
    address: Address,
    running: Digest,
    values: Vec<u32>,
}

/// Digests of every station at the beginnings of cycles 0, `stride`, 2 `stride` and so on, and at the end.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Digests {
    pub(super) stride: u64,
    pub(super) stations: BTreeMap<Address, Vec<u32>>,
}

impl Digests {
    /// The values of a station as text.
    pub(super) fn emit(values: &[u32]) -> String {
        let mut text = String::with_capacity(values.len() * DIGITS);
        for value in values {
            let _ = write!(text, "{value:0DIGITS$x}");
        }
        text
    }
    /// Reads what [`Self::emit`] wrote.
    pub(super) fn parse(text: &str) -> Option<Vec<u32>> {
        if !text.is_ascii() || !text.len().is_multiple_of(DIGITS) {
            return None;
        }
        (0..text.len()).step_by(DIGITS).map(|at| u32::from_str_radix(&text[at..at + DIGITS], 16).ok()).collect()
    }

    /// For each station the stretch in which it parts from the other's, the first first.
    fn partings(&self, other: &Self) -> Vec<Parting> {
        let stride = self.stride.max(other.stride);
        let thinned = |digests: &Self, station: &Address| -> Vec<u32> {
            let each = (stride / digests.stride).max(1) as usize;
            digests.stations.get(station).map_or_else(Vec::new, |all| all.iter().copied().step_by(each).collect())
        };
        let mut found = Vec::new();
        for station in self.stations.keys().filter(|station| other.stations.contains_key(station)) {
            let (before, now) = (thinned(self, station), thinned(other, station));
            // The last ones are of the ends, which are others where one run is longer.
            let whole = if before.len() == now.len() && self.stride == other.stride {
                before.len()
            } else {
                before.len().min(now.len()).max(1) - 1
            };
            let at = before.iter().zip(&now).take(whole).position(|(before, now)| before != now);
            found.extend(at.map(|at| {
                let to = at as u64 * stride;
                Parting { station: *station, from: to.checked_sub(stride), to }
            }));
        }
        found.sort_by_key(|parting| (parting.to, parting.station));
        found
    }
}

/// A stretch of cycles in which a station did something else than before.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Parting {
    /// Which station.
    pub station: Address,
    /// The first cycle of the stretch; none for what comes before the first cycle.
    pub from: Option<u64>,
    /// The cycle before whose beginning it was.
    pub to: u64,
}

impl Parting {
    /// Whether `cycle` belongs to the stretch.
    pub fn contains(&self, cycle: Option<u64>) -> bool {
        cycle >= self.from && cycle.is_none_or(|cycle| cycle < self.to)
    }
}

/// What a file keeps of a run.
#[derive(Clone, PartialEq, Debug)]
pub struct Trail {
    pub(super) journal: Log,
    pub(super) events: Log,
    pub(super) digests: Digests,
}

/// How two trails differ.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Traced {
    /// What differs with both values: in the journal, and among the events.
    pub known: Differences,
    /// Where stations part by their digests, the first first; of those in one stretch nobody knows which was first.
    pub partings: Vec<Parting>,
}

impl Traced {
    /// The stations that part in the first stretch.
    pub fn first_stretch(&self) -> &[Parting] {
        let same = self.partings.iter().take_while(|parting| parting.to == self.partings[0].to).count();
        &self.partings[..same]
    }
}

impl Trail {
    /// Runs `scenario` and keeps its trail.
    ///
    /// # Panics
    /// If the scenario breaks a rule that reading it checks.
    ///
    /// # Errors
    /// The run makes no headway.
    pub fn of<Q: Queue<NetworkEvent>>(scenario: &Scenario) -> Result<Self, NoHeadway> {
        let mut network: Network<_, Q> = build::network(scenario);
        let mut tracker = Tracker::new(scenario);
        EventBudget::of(scenario).run(&mut network, scenario, &mut tracker, |_| ())?;
        Ok(tracker.finish(network.now()))
    }
    /// Cycles whose beginnings have digests, about as many as the run has.
    pub fn cycles(&self) -> u64 {
        let rows = self.digests.stations.values().next().map_or(0, Vec::len) as u64;
        rows.saturating_sub(1) * self.digests.stride
    }
    /// How `now` differs from this trail.
    pub fn compare(&self, now: &Self) -> Traced {
        let known = Differences {
            everything: self.journal.differences(&now.journal),
            events: self.events.differences(&now.events),
        };
        Traced { known, partings: self.digests.partings(&now.digests) }
    }
}

/// Makes the trail of a run.
struct Tracker {
    master: Address,
    cycle: Option<u64>,
    journal: Log,
    events: Log,
    stride: u64,
    /// The next cycle whose beginning gets digests.
    next: u64,
    columns: Vec<Column>,
    /// Column of each address.
    by_address: [Option<u8>; 128],
}

impl Tracker {
    fn new(scenario: &Scenario) -> Self {
        let mut addresses: Vec<_> = scenario.stations().map(|station| station.address).collect();
        addresses.sort_unstable();
        let mut by_address = [None; 128];
        for (index, address) in addresses.iter().enumerate() {
            by_address[usize::from(address.get())] = Some(index as u8);
        }
        let column = |address| Column { address, running: Digest::default(), values: Vec::new() };
        Self {
            master: scenario.master.address,
            cycle: None,
            journal: Log::new(JOURNAL),
            events: Log::new(EVENTS),
            stride: 1,
            next: 0,
            columns: addresses.into_iter().map(column).collect(),
            by_address,
        }
    }
    /// A cycle begins.
    fn begin(&mut self, cycle: u64) {
        self.cycle = Some(cycle);
        while self.next <= cycle {
            self.note();
            self.next += self.stride;
        }
    }
    /// Keeps a digest of every station; with too many, every second one is dropped.
    fn note(&mut self) {
        for column in &mut self.columns {
            column.values.push(column.running.value() as u32 & 0x00FF_FFFF);
        }
        let kept: usize = self.columns.iter().map(|column| column.values.len()).sum();
        if kept > DIGESTS {
            self.stride *= 2;
            for column in &mut self.columns {
                let mut odd = false;
                column.values.retain(|_| {
                    odd = !odd;
                    odd
                });
            }
            self.next = (self.next / self.stride) * self.stride;
        }
    }
    fn digest(&mut self, station: Address, happening: &Happening) {
        let Some(column) = self.by_address[usize::from(station.get())] else { return };
        let digest = &mut self.columns[usize::from(column)].running;
        // Writing into a digest cannot fail.
        let _ = writeln!(digest, "{} {}", happening.at.ticks(), happening.what);
    }
    fn finish(mut self, end: Time) -> Trail {
        self.note();
        for log in [&mut self.journal, &mut self.events] {
            log.until = Some(log.until.map_or(end, |until| until.min(end)));
        }
        let stations = self.columns.into_iter().map(|column| (column.address, column.values)).collect();
        Trail { journal: self.journal, events: self.events, digests: Digests { stride: self.stride, stations } }
    }
}

impl Recorder for Tracker {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        let happening = Happening::of_telegram(self.cycle, telegram);
        self.digest(telegram.sender, &happening);
        self.journal.add(telegram.sender, || happening);
    }
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        if let &Observation::CycleStart { cycle, .. } = what
            && stamp.station == self.master
        {
            self.begin(cycle);
        }
        let happening = Happening::of_observation(self.cycle, &stamp, what);
        self.digest(stamp.station, &happening);
        if what.is_event() {
            self.events.add(stamp.station, || happening.clone());
        }
        self.journal.add(stamp.station, || happening);
    }
}
