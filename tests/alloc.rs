//! Once a network runs, a cycle allocates nothing: neither the stations nor the kernel nor what is recorded.
//!
//! A test binary of its own, because the counter takes the place of the allocator.

use std::path::Path;

use isodp::device::node::Node;
use isodp::sim::fingerprint::Fingerprints;
use isodp::sim::network::{Network, NetworkEvent, Until};
use isodp::sim::queue::{HeapQueue, NearQueue, Queue};
use isodp::sim::record::Recorder;
use isodp::study::build;
use isodp::study::flight::FlightRecorder;
use isodp::study::histogram::Histograms;
use isodp::study::metric::Metrics;
use isodp::study::row::{CycleRow, LinkRow, Sink, SlaveRow};
use isodp::study::run;
use isodp::study::scenario::disturbance::DISTURBANCES;
use isodp::study::scenario::{Flight, Scenario};
use isodp::study::steady::SteadyState;

/// Cycles until everything is locked, linked and polled once: queues and buffers have their final size.
const START: u64 = 1_000;
/// Cycles that are watched.
const WATCHED: u64 = 1_000;

fn reference(sets: &[(&str, &str)]) -> Scenario {
    shipped("reference", sets)
}
fn shipped(name: &str, sets: &[(&str, &str)]) -> Scenario {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios").join(format!("{name}.toml"));
    let sets: Vec<_> = sets.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
    Scenario::load(&path, &sets).unwrap_or_else(|error| panic!("{error}"))
}

/// Allocations of the watched cycles, with metrics, histograms and fingerprints.
fn allocations<Q: Queue<NetworkEvent>>(scenario: &Scenario) -> u64 {
    allocations_beside::<Q>(scenario, ())
}
/// The same with a further recorder.
fn allocations_beside<Q: Queue<NetworkEvent>>(scenario: &Scenario, further: impl Recorder) -> u64 {
    let layout = run::layout(scenario);
    let histograms = Histograms::new(&layout);
    let metrics = Metrics::new(layout, |_, _| 0.0, histograms);
    let mut recorder = (Fingerprints::new(scenario.master.address), (metrics, further));
    let mut network: Network<Node, Q> = build::network(scenario);
    assert!(network.run(Until::Cycle(START), u64::MAX, &mut recorder));
    let info = allocation_counter::measure(|| {
        assert!(network.run(Until::Cycle(START + WATCHED), u64::MAX, &mut recorder));
    });
    assert!(network.cycles() > START + WATCHED, "the network stands still");
    info.count_total
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocation_counter::measure(|| drop(std::hint::black_box(Box::new(1)))).count_total, 1);
}

#[test]
fn a_running_network_allocates_nothing() {
    let scenario = reference(&[]);
    assert_eq!(allocations::<NearQueue<NetworkEvent>>(&scenario), 0);
    assert_eq!(allocations::<HeapQueue<NetworkEvent>>(&scenario), 0);
}

#[test]
fn repeaters_with_jitter_allocate_nothing() {
    let sets = [("run.duration", "10 s"), ("repeater.1.jitter", "50 ns"), ("repeater.2.jitter", "100 ns")];
    let scenario = shipped("repeaters", &sets);
    assert_eq!(allocations::<NearQueue<NetworkEvent>>(&scenario), 0);
    assert_eq!(allocations::<HeapQueue<NetworkEvent>>(&scenario), 0);
}

#[test]
fn a_fault_and_its_acknowledgement_allocate_nothing() {
    let scenario = reference(&[]);
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/reference.toml"));
    let text = text.expect("a scenario")
        + "\n[[disturbance]]\nkind = \"missing-clocks\"\ncycle = 500\nfor = 3\nevery = 200\n\
           [[event]]\ncycle = 1200\ndo = \"acknowledge\"\nslaves = \"all\"\n\
           [[disturbance]]\nkind = \"lost-telegrams\"\nfrom = 4\ncycle = 300\nfor = 1\nevery = 50\n";
    let disturbed = Scenario::parse(&scenario.name, "disturbed", &text, &[]).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(allocations::<NearQueue<NetworkEvent>>(&disturbed), 0);
}

/// Those of the line, in two-masters.
const ON_THE_LINE: &[&str] = &[
    "kind = \"lost-telegrams\"\nrate = \"1 %\"\nservice = \"data-exchange\"",
    "kind = \"lost-telegrams\"\npattern = \"x...............\"\nservice = \"fdl-status\"",
    "kind = \"missing-clocks\"\nrate = \"1 %\"",
    "kind = \"late-telegrams\"\nup_to = \"2 us\"\nservice = \"replies\"",
    "kind = \"duplicate-telegrams\"\nrate = \"5 %\"\nservice = \"replies\"",
    "kind = \"bit-errors\"\nrate = \"1e-5\"",
    "kind = \"wrong-octet\"\noctet = 8\nflip = 3\nrate = \"1 %\"\nto = 4",
    "kind = \"noise\"\nmean = \"5 ms\"\noctets_to = 4",
    "kind = \"noise\"\ncycle = 0\nfor = 1\nevery = 30\nafter = \"30 us\"",
    "kind = \"foreign-telegram\"\nat = \"1 ms\"\nfor = \"1 ms\"\nevery = \"41 ms\"\ndata = { to = 4, from = 9, fc = 0x49 }",
    "kind = \"late-token\"\nstation = 12\nby = \"20 us\"\ncycle = 1\nfor = 10\nevery = 25",
    "kind = \"overlong-acyclic\"\nto = 4\noctets = 100\ncycle = 500\nfor = 2\nevery = 25",
];
/// Those of stations, crystals and paths, in the reference network: every one begins and ends again and again.
const OF_STATIONS: &[&str] = &[
    "kind = \"silent\"\nstation = 3\ncycle = 500\nfor = 1\nevery = 50",
    "kind = \"deaf\"\nstation = 4\ncycle = 510\nfor = 1\nevery = 50",
    "kind = \"mute\"\nstation = 4\ncycle = 530\nfor = 1\nevery = 50",
    "kind = \"crystal-offset\"\nstations = \"2..3\"\noffset = \"5 ppm\"\ncycle = 500\nfor = 20\nevery = 50",
    "kind = \"crystal-wander\"\nstations = \"all slaves\"\nstep = \"10 ppb\"\ninterval = \"1 ms\"\nbound = \"2 ppm\"",
    "kind = \"temperature-step\"\nstation = 2\noffset = \"9 ppm\"\ntime_constant = \"1 s\"\ncycle = 500\nfor = 200\nevery = 400",
    "kind = \"gc-jitter\"\nshape = \"table\"\noffsets = [\"10 ns\", \"-10 ns\"]",
    "kind = \"receiver-jitter\"\nstation = 6\nhalf_width = \"20 ns\"\ncycle = 500\nfor = 9\nevery = 50",
    "kind = \"t-sdr-jitter\"\nstation = 7\nup_to = \"9 tbit\"",
    "kind = \"cable-cut\"\nposition = \"95 m\"\ncycle = 530\nfor = 1\nevery = 50",
    "kind = \"hold-life-sign\"\nstation = 5\ncycle = 520\nfor = 1\nevery = 50",
    "kind = \"jump-life-sign\"\nstation = 9\nto = 9\ncycle = 540\nfor = 1\nevery = 100",
    "kind = \"repeat-life-sign\"\nstation = 10\ncycle = 540\nfor = 1\nevery = 50",
];
/// Those after which a slave starts anew, in the reference network, and how often it does in the watched cycles.
const OF_STARTS: &[(&str, u64)] = &[
    ("kind = \"restart\"\nstation = 8\ncycle = 505\nfor = 60\nevery = 350", 3),
    ("kind = \"wrong-parameters\"\nstation = 7\noctets = [[5, 0x12]]\ncycle = 515\nfor = 60\nevery = 350", 6),
];
/// Those of repeaters, in a network that has some.
const OF_REPEATERS: &[&str] = &[
    "kind = \"repeater-jitter\"\nrepeater = \"press - gallery\"\nhalf_width = \"50 ns\"\ncycle = 500\nfor = 9\nevery = 50",
];

/// A shipped scenario with these disturbances.
fn disturbed(name: &str, sets: &[(&str, &str)], disturbances: &[&str]) -> Scenario {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios").join(format!("{name}.toml"));
    let mut text = std::fs::read_to_string(path).expect("a scenario");
    for keys in disturbances {
        text.extend(["\n[[disturbance]]\n", keys, "\n"]);
    }
    let sets: Vec<_> = sets.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
    Scenario::parse(name, "disturbed.toml", &text, &sets).unwrap_or_else(|error| panic!("{error}"))
}

/// A new kind has to come into one of the lists.
#[test]
fn every_kind_of_disturbance_is_in_a_list() {
    let starts = OF_STARTS.iter().map(|start| start.0);
    let all: Vec<_> = [ON_THE_LINE, OF_STATIONS, OF_REPEATERS].concat().into_iter().chain(starts).collect();
    for kind in DISTURBANCES {
        let begin = format!("kind = \"{}\"\n", kind.name);
        assert!(all.iter().any(|keys| keys.starts_with(&begin)), "{}", kind.name);
    }
}

#[test]
fn disturbances_of_the_line_allocate_nothing() {
    let disturbed = disturbed("two-masters", &[("run.cycles", "3000")], ON_THE_LINE);
    assert_eq!(allocations::<NearQueue<NetworkEvent>>(&disturbed), 0);
}

#[test]
fn a_token_that_goes_round_allocates_nothing() {
    for set in [("bus.gap_factor", "20"), ("bus.gap_factor", "1"), ("bus.t_tr", "300000 tbit")] {
        assert_eq!(allocations::<NearQueue<NetworkEvent>>(&shipped("two-masters", &[set])), 0, "{set:?}");
    }
}

#[test]
fn class_2_masters_allocate_nothing() {
    assert_eq!(allocations::<NearQueue<NetworkEvent>>(&shipped("class2-beside", &[])), 0);
}

#[test]
fn links_in_both_tables_and_a_lost_publisher_allocate_nothing() {
    assert_eq!(allocations::<NearQueue<NetworkEvent>>(&shipped("dxb-network", &[])), 0);
    let sets = [("run.duration", "5 s"), ("event.1.at", "2.2 s"), ("event.2.at", "4.5 s")];
    assert_eq!(allocations::<NearQueue<NetworkEvent>>(&shipped("dxb-lost-publisher", &sets)), 0);
}

/// Every kind of a disturbance that begins and ends, several of them again and again.
#[test]
fn disturbances_of_stations_allocate_nothing() {
    for disturbed in
        [disturbed("reference", &[], OF_STATIONS), disturbed("repeaters", &[("run.duration", "10 s")], OF_REPEATERS)]
    {
        assert_eq!(allocations::<NearQueue<NetworkEvent>>(&disturbed), 0, "{}", disturbed.name);
        assert_eq!(allocations::<HeapQueue<NetworkEvent>>(&disturbed), 0, "{}", disturbed.name);
    }
}

/// A start-up takes room once; the cycles in which a slave is without supply or out of data exchange do not.
#[test]
fn a_slave_that_starts_anew_allocates_for_its_parameters_alone() {
    for (keys, starts) in OF_STARTS {
        let disturbed = disturbed("reference", &[], &[keys]);
        let count = allocations::<NearQueue<NetworkEvent>>(&disturbed);
        assert!(count <= *starts, "{count} allocations for {starts} starts: {keys}");
    }
}

/// Rows as a run of figures takes them.
struct Kept {
    steady: SteadyState,
    histograms: Histograms,
}
impl Sink for Kept {
    fn cycle(&mut self, row: &CycleRow) {
        self.steady.cycle(row, &self.histograms);
        self.histograms.cycle(row);
    }
    fn slave(&mut self, row: &SlaveRow) {
        self.histograms.slave(row);
        self.steady.slave(row);
    }
    fn link(&mut self, row: &LinkRow) {
        self.histograms.link(row);
    }
}

/// What the histograms hold when it begins takes room; its batches do not.
#[test]
fn a_steady_state_allocates_nothing() {
    let scenario = reference(&[]);
    let layout = run::layout(&scenario);
    let steady = SteadyState::new(&layout, |_| true).expect("slaves with a clock");
    let kept = Kept { steady, histograms: Histograms::new(&layout) };
    let mut metrics = Metrics::new(layout, |_, _| 0.0, kept);
    let mut network: Network<Node, NearQueue<NetworkEvent>> = build::network(&scenario);
    assert!(network.run(Until::Cycle(START), u64::MAX, &mut metrics));
    let info = allocation_counter::measure(|| {
        assert!(network.run(Until::Cycle(START + WATCHED), u64::MAX, &mut metrics));
    });
    assert_eq!(info.count_total, 0);
    assert!(metrics.sink().steady.begin().is_some_and(|begin| begin.cycle < START && begin.cycles > WATCHED));
}

/// The stretches that it keeps take room; the cycles that come and go do not.
#[test]
fn a_flight_recorder_that_keeps_nothing_allocates_nothing() {
    for name in ["reference", "repeaters", "dxb-network"] {
        let scenario = shipped(name, &[("run.duration", "10 s")]);
        let flight = FlightRecorder::new(&scenario, &Flight::default());
        assert_eq!(allocations_beside::<NearQueue<NetworkEvent>>(&scenario, flight), 0, "{name}");
    }
}
