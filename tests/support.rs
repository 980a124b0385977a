//! A run with everything kept, for tests that look at it.

use std::path::PathBuf;

use isodp::device::node::Node;
use isodp::observation::{Observation, Phase};
use isodp::sim::fingerprint::{Fingerprint, Fingerprints};
use isodp::sim::network::{Network, NetworkEvent, Until};
use isodp::sim::queue::{NearQueue, Queue};
use isodp::sim::record::{Recorder, Stamp, Transmission};
use isodp::study::build;
use isodp::study::count::{Counts, SlaveCounts};
use isodp::study::metric::Metrics;
use isodp::study::row::{CycleRow, EventRow, LinkRow, Sink, SlaveRow};
use isodp::study::run;
use isodp::study::scenario::{Extent, Scenario};
use isodp::time::Time;
use isodp::wire::drive::Inputs81;
use isodp::wire::{Address, Telegram};

/// Names of all shipped scenarios, in order.
pub(crate) fn shipped() -> Vec<String> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    let files = std::fs::read_dir(folder).expect("scenarios").map(|entry| entry.expect("an entry").path());
    let names = files.filter(|path| path.extension().is_some_and(|extension| extension == "toml"));
    let mut names: Vec<_> =
        names.map(|path| path.file_stem().expect("a name").to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// The shipped scenario of this name, with changed values.
pub(crate) fn scenario(name: &str, sets: &[(&str, &str)]) -> Scenario {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenarios").join(format!("{name}.toml"));
    let sets: Vec<_> = sets.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
    Scenario::load(&path, &sets).unwrap_or_else(|error| panic!("{error}"))
}

/// A station address.
pub(crate) fn address(number: u8) -> Address {
    Address::new(number).expect("an address")
}

/// Everything that a run left.
#[derive(Default)]
pub(crate) struct Run {
    pub(crate) cycles: Vec<CycleRow>,
    pub(crate) slaves: Vec<SlaveRow>,
    pub(crate) links: Vec<LinkRow>,
    pub(crate) events: Vec<EventRow>,
    /// Every observation: when, who, what.
    pub(crate) observations: Vec<(Time, Address, Observation)>,
    /// Every telegram: first bit, last bit, sender, octets.
    pub(crate) telegrams: Vec<(Time, Time, Address, Vec<u8>)>,
    pub(crate) counts: Option<Counts>,
    pub(crate) fingerprint: Fingerprint,
    pub(crate) stations: Vec<(Address, Fingerprint)>,
}

impl Run {
    /// Runs a scenario on the usual queue.
    pub(crate) fn of(scenario: &Scenario) -> Self {
        Self::on::<NearQueue<NetworkEvent>>(scenario)
    }
    /// Runs a scenario on a queue of this kind.
    pub(crate) fn on<Q: Queue<NetworkEvent>>(scenario: &Scenario) -> Self {
        let mut network: Network<Node, Q> = build::network(scenario);
        let rows = Metrics::new(run::layout(scenario), |_, _| 0.0, Self::default());
        let mut recorder = (Fingerprints::new(scenario.master.address), (rows, Log(Self::default())));
        let until = match scenario.run.duration {
            Extent::Time(span) => Until::Time(Time::ZERO + span),
            Extent::Cycles(cycles) => Until::Cycle(cycles),
        };
        assert!(network.run(until, 100_000_000, &mut recorder), "the run does not end");
        let (fingerprints, (rows, Log(log))) = recorder;
        let (counts, rows) = rows.finish(network.now());
        Self {
            counts: Some(counts),
            observations: log.observations,
            telegrams: log.telegrams,
            fingerprint: fingerprints.total(),
            stations: fingerprints.stations().collect(),
            ..rows
        }
    }
    /// The rows of one slave.
    pub(crate) fn slave(&self, number: u8) -> impl Iterator<Item = &SlaveRow> {
        self.slaves.iter().filter(move |row| row.slave == address(number))
    }
    /// The row of one slave in one cycle.
    pub(crate) fn row(&self, number: u8, cycle: u64) -> &SlaveRow {
        self.slave(number).find(|row| row.cycle == cycle).unwrap_or_else(|| panic!("slave {number} in cycle {cycle}"))
    }
    /// The cycles in which one slave entered the start-up phases.
    pub(crate) fn phases_of(&self, number: u8) -> Vec<(Phase, u64)> {
        let phase = |row: &EventRow| match row.what {
            Observation::Phase { to, .. } => Some((to, row.cycle)),
            _ => None,
        };
        self.events_of(number).filter_map(phase).collect()
    }
    /// The cycles in which one slave latched faults, with their codes.
    pub(crate) fn faults_of(&self, number: u8) -> Vec<(u64, u16)> {
        let fault = |row: &EventRow| match row.what {
            Observation::Fault { code } => Some((row.cycle, code)),
            _ => None,
        };
        self.events_of(number).filter_map(fault).collect()
    }
    /// What was counted for one slave.
    pub(crate) fn counts_of(&self, number: u8) -> &SlaveCounts {
        let counts = self.counts.as_ref().expect("the run is over");
        counts.slaves.iter().find(|slave| slave.address == address(number)).expect("a slave")
    }
    /// Telegrams from the start of one cycle to the start of the next.
    pub(crate) fn telegrams_in(&self, cycle: u64) -> impl Iterator<Item = &(Time, Time, Address, Vec<u8>)> {
        let t0 = |cycle| self.cycles.iter().find(|row| row.cycle == cycle).map(|row| row.t0);
        let (from, to) = (t0(cycle).expect("a cycle"), t0(cycle + 1).expect("another cycle"));
        self.telegrams.iter().filter(move |(start, ..)| (from..to).contains(start))
    }
    /// Telegram 81 in the Data_Exchange reply of one slave in one cycle, if there was one.
    pub(crate) fn reply(&self, number: u8, cycle: u64) -> Option<Inputs81> {
        self.telegrams_in(cycle).find_map(|(_, _, sender, octets)| match Telegram::parse(octets) {
            Ok(Telegram::Data { header, du }) if *sender == address(number) && header.dsap.is_none() => {
                Inputs81::parse(du)
            }
            _ => None,
        })
    }
    /// The events of one station.
    pub(crate) fn events_of(&self, number: u8) -> impl Iterator<Item = &EventRow> {
        self.events.iter().filter(move |row| row.station == address(number))
    }
}

impl Sink for Run {
    fn cycle(&mut self, row: &CycleRow) {
        self.cycles.push(*row);
    }
    fn slave(&mut self, row: &SlaveRow) {
        self.slaves.push(*row);
    }
    fn link(&mut self, row: &LinkRow) {
        self.links.push(*row);
    }
    fn event(&mut self, row: &EventRow) {
        self.events.push(*row);
    }
}

struct Log(Run);

impl Recorder for Log {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        self.0.telegrams.push((telegram.start, telegram.end, telegram.sender, telegram.octets.to_vec()));
    }
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        self.0.observations.push((stamp.at, stamp.station, *what));
    }
}
