//! Run: one scenario from start to end, with everything that reads it, and the files it leaves.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::build;
use super::count::Counts;
use super::episode::Episodes;
use super::event_budget::{EventBudget, NoHeadway};
use super::export::{self, EXPORTERS, ExportError, Exports, Staged, Target, capture};
use super::figure::Figures;
use super::first_fault::FirstFaults;
use super::flight::{FlightRecorder, Recording};
use super::histogram::{Histogram, Histograms, Quantity, Subject};
use super::layout::{Layout, MasterLayout, SlaveLayout};
use super::metric::{Metrics, Shafts};
use super::plan::rules;
use super::plot::{
    self, BusCycle, Distribution, Distributions, EpisodeTimes, LinkLatencies, PlotError, PlotMeta, Plots,
};
use super::row::Sink;
use super::scenario::{Extent, Scenario};
use super::steady::{SteadyState, SteadySummary};
use super::summary::{Facts, SlaveFacts, Summary};
use super::topology::Map;
use super::verdict;
use crate::device::node::Node;
use crate::observation::MasterClass;
use crate::sim::fingerprint::{Digest, Fingerprint, Fingerprints};
use crate::sim::motion::Shaft;
use crate::sim::network::{Network, NetworkEvent, Until};
use crate::sim::queue::Queue;
use crate::time::{Span, Time};
use crate::wire::Address;

/// File of the topology in text.
const TOPOLOGY: &str = "topology.txt";
/// Bins of a histogram in a picture.
const BINS: usize = 120;

/// How far a run has come.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Progress {
    /// Simulated time.
    pub simulated: Span,
    /// Cycles begun.
    pub cycles: u64,
}

/// What a run left.
#[derive(Debug)]
pub struct Outcome {
    /// Figures of the run.
    pub summary: Summary,
    /// The network's fingerprint.
    pub fingerprint: Fingerprint,
    /// Each station's.
    pub stations: Vec<(Address, Fingerprint)>,
    /// Hash of every figure of the summary.
    pub statistics: u64,
    /// Everything that was counted and recorded, by name.
    pub figures: Figures,
    /// Where the files are, if there are any.
    pub dir: Option<PathBuf>,
}

/// Why a run ended without result.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A table, log or summary could not be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// It makes no headway.
    #[error(transparent)]
    NoHeadway(#[from] NoHeadway),
    /// A picture could not be written.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// The summary has no text form.
    #[error("the summary cannot be written as JSON: {0}")]
    Summary(#[from] serde_json::Error),
}

/// Speeds of the shafts of a scenario.
#[derive(Clone, Debug)]
pub(super) struct Speeds(Vec<Option<(Shaft, f64)>>);

impl Speeds {
    pub(super) fn of(scenario: &Scenario) -> Self {
        let mut speeds = vec![None; 128];
        for slave in &scenario.slaves {
            let counts = slave.scaling.map_or(slave.resolution().steps_per_rev, |scaling| scaling.units_per_rev);
            let shaft = Shaft::new(&slave.motion).expect("a checked motion");
            speeds[usize::from(slave.address.get())] = Some((shaft, f64::from(counts)));
        }
        Self(speeds)
    }
}
impl Shafts for Speeds {
    fn speed(&self, slave: Address, at: Time) -> f64 {
        self.0[usize::from(slave.get())].as_ref().map_or(0.0, |(shaft, counts)| shaft.speed(at) * counts)
    }
}

/// Everything that takes rows.
struct Sinks {
    histograms: Histograms,
    faults: FirstFaults,
    episodes: Episodes,
    steady: Option<SteadyState>,
    exports: Option<Exports>,
    plots: Option<Plots>,
}
impl Sink for Sinks {
    fn cycle(&mut self, row: &super::row::CycleRow) {
        // Before this cycle is recorded.
        if let Some(steady) = &mut self.steady {
            steady.cycle(row, &self.histograms);
        }
        self.histograms.cycle(row);
        self.exports.cycle(row);
        self.plots.cycle(row);
    }
    fn slave(&mut self, row: &super::row::SlaveRow) {
        self.histograms.slave(row);
        self.episodes.slave(row);
        if let Some(steady) = &mut self.steady {
            steady.slave(row);
        }
        self.exports.slave(row);
        self.plots.slave(row);
    }
    fn link(&mut self, row: &super::row::LinkRow) {
        self.histograms.link(row);
        self.exports.link(row);
        self.plots.link(row);
    }
    fn event(&mut self, row: &super::row::EventRow) {
        self.histograms.event(row);
        self.faults.event(row);
        self.episodes.event(row);
        if let Some(steady) = &mut self.steady {
            steady.event(row);
        }
        self.exports.event(row);
        self.plots.event(row);
    }
}

/// Where a run of `scenario` ends.
pub const fn until(scenario: &Scenario) -> Until {
    match scenario.run.duration {
        Extent::Time(span) => Until::Time(Time::from_ticks(span.ticks())),
        Extent::Cycles(cycles) => Until::Cycle(cycles),
    }
}

/// Runs `scenario`. Files go to `out/<scenario>/` if `out` is given and the scenario wants any; what earlier runs left there
/// under names of a run's files goes, so that all of them are of one run. `watch` is told the progress now and then; it
/// cannot change the run.
///
/// # Errors
/// A file that cannot be written, and then none is left half-written; or one of an earlier run that cannot be removed.
pub fn run<Q: Queue<NetworkEvent>>(
    scenario: &Scenario,
    out: Option<&Path>,
    watch: impl FnMut(Progress),
) -> Result<Outcome, RunError> {
    let dir = out.filter(|_| scenario.record.files).map(|out| out.join(&scenario.name));
    let layout = layout(scenario);
    let exports = dir.as_deref().map(|dir| {
        let (cycles, rows) = (cycles(scenario), scenario.record.rows);
        Exports::open(&Target { dir, layout: &layout, cycles, rows, tables: &scenario.record.tables }, EXPORTERS)
    });
    let draws = dir.is_some() && scenario.record.plots;
    let plots = draws.then(|| Plots::new(meta(scenario, &layout)));
    let sinks = Sinks {
        histograms: Histograms::new(&layout),
        faults: FirstFaults::default(),
        episodes: episodes(scenario, &layout),
        steady: steady_state(scenario, &layout),
        exports: exports.transpose()?,
        plots,
    };
    let metrics = Metrics::new(layout, Speeds::of(scenario), sinks);
    let bus = draws.then(|| BusCycle::new(scenario.master.address));
    let flight = scenario.record.flight.as_ref().filter(|_| dir.is_some());
    let flight = flight.map(|settings| FlightRecorder::new(scenario, settings));

    let mut network: Network<Node, Q> = build::network(scenario);
    let mut recorder = (Fingerprints::new(scenario.master.address), (metrics, (bus, flight)));
    EventBudget::of(scenario).run(&mut network, scenario, &mut recorder, watch)?;
    let (fingerprints, (metrics, (bus, flight))) = recorder;
    let flight = flight.map(|flight| flight.finish(network.now()));
    let (counts, mut sinks) = metrics.finish(network.now());
    sinks.episodes.finish(network.now());

    let summary = Summary::new(facts(scenario), &counts, &sinks.histograms);
    conclude(scenario, summary, (counts, sinks), (&fingerprints, bus.as_ref(), flight.as_ref()), dir)
}

/// Adds the fingerprints, the LEDs, what slaves and masters did and the topology, then writes the files.
fn conclude(
    scenario: &Scenario,
    mut summary: Summary,
    (counts, sinks): (Counts, Sinks),
    (fingerprints, bus, flight): (&Fingerprints, Option<&BusCycle>, Option<&Recording>),
    dir: Option<PathBuf>,
) -> Result<Outcome, RunError> {
    let Sinks { histograms, faults, episodes, steady, exports, plots } = sinks;
    let mut digest = Digest::default();
    digest.octets(&serde_json::to_vec(&summary)?);
    let statistics = digest.value();
    let fingerprint = fingerprints.total();
    let texts = [
        ("wire", fingerprint.wire),
        ("states", fingerprint.states),
        ("latches", fingerprint.latches),
        ("statistics", statistics),
    ];
    summary.fingerprint = texts.map(|(name, hash)| (name.to_owned(), format!("{hash:016x}"))).to_vec();
    summary.show_leds(&counts);
    summary.show_receptions(&counts);
    summary.show_acyclic(&counts);
    summary.show_faults(&faults, &scenario.invocation);
    summary.flight = flight.map(Recording::line);
    summary.show_episodes(&episodes);
    summary.steady_state = steady.as_ref().map(|steady| SteadySummary::of(steady, &histograms));
    let figures = Figures::new(counts, histograms, episodes).with_steady_state(steady);
    summary.verdicts = verdict::judge(&scenario.expectations, &figures);
    let map = Map::of(scenario);
    if scenario.topology.has_segments() {
        summary.topology = map.text(false);
    }
    summary.warnings = rules::warnings(scenario);

    let mut pictures = Vec::new();
    if let (Some(dir), Some(plots), Some(bus)) = (&dir, &plots, bus) {
        let drawn = plots.pictures(&distributions(&figures), bus)?;
        summary.files.extend(drawn.iter().map(|picture| picture.0.to_owned()));
        pictures = stage(dir, drawn)?;
    }
    if let Some(dir) = &dir {
        pictures.extend(stage(dir, vec![(TOPOLOGY, map.text(true).join("\n") + "\n")])?);
        summary.files.push(TOPOLOGY.to_owned());
    }
    if let (Some(dir), Some(flight)) = (&dir, flight) {
        pictures.extend(capture::stage(dir, flight)?);
        summary.files.extend(capture::FORMATS.iter().map(|format| format.file.to_owned()));
    }
    if let (Some(dir), Some(exports)) = (&dir, exports) {
        let placed = exports.finish(pictures, figures.histograms(), &mut summary)?;
        export::clear(dir, files(), &placed)?;
    }
    Ok(Outcome { summary, fingerprint, stations: fingerprints.stations().collect(), statistics, figures, dir })
}

/// Every name that a file of a run can have.
fn files() -> impl Iterator<Item = String> {
    let texts = plot::files().chain([TOPOLOGY]).chain(capture::FORMATS.iter().map(|format| format.file));
    texts.map(str::to_owned).chain(EXPORTERS.iter().flat_map(|exporter| (exporter.every)()))
}

/// Writes pictures and texts under temporary names.
fn stage(dir: &Path, pictures: Vec<(&str, String)>) -> Result<Vec<Staged>, ExportError> {
    let mut staged = Vec::with_capacity(pictures.len());
    for (name, text) in pictures {
        let mut file = Staged::create(dir, name)?;
        file.write_all(text.as_bytes()).map_err(|error| file.error(error))?;
        staged.push(file);
    }
    Ok(staged)
}

/// How many cycles the run will have, about: a scenario in time starts up for a moment before the first.
pub(super) fn cycles(scenario: &Scenario) -> u64 {
    match scenario.run.duration {
        Extent::Time(span) => span.div_floor(scenario.master.t_dp).max(0) as u64,
        Extent::Cycles(cycles) => cycles,
    }
}

/// The slaves that take part and their links; the masters, where several share the token.
pub fn layout(scenario: &Scenario) -> Layout {
    let slaves = scenario.configured();
    let slaves = slaves
        .map(|slave| SlaveLayout { address: slave.address, t_i: slave.times.t_i, encoder: !slave.device.subscriber })
        .collect();
    let links = scenario.links.iter().map(|link| (link.publisher, link.subscriber)).collect();
    Layout::new(scenario.master.address, scenario.master.t_dp, slaves, links).with_masters(masters(scenario))
}

/// What becomes of disturbances, before any is seen.
pub(super) fn episodes(scenario: &Scenario, layout: &Layout) -> Episodes {
    Episodes::new(layout, |slave| is_clocked(scenario, slave))
}

/// What waits for the steady state; none of a network without SYNCH.
pub(super) fn steady_state(scenario: &Scenario, layout: &Layout) -> Option<SteadyState> {
    SteadyState::new(layout, |slave| is_clocked(scenario, slave))
}

fn is_clocked(scenario: &Scenario, slave: Address) -> bool {
    scenario.slave(slave).is_some_and(|slave| scenario.is_clocked(slave))
}

/// Nobody where there is one only.
fn masters(scenario: &Scenario) -> Vec<MasterLayout> {
    if scenario.class1.is_empty() && scenario.class2.is_empty() {
        return Vec::new();
    }
    let class1 = std::iter::once(scenario.master.address).chain(scenario.class1.iter().map(|class1| class1.address));
    let class1 = class1.map(|address| MasterLayout {
        address,
        class: MasterClass::One,
        slaves: scenario.slaves_of(address).map(|slave| slave.address).collect(),
    });
    let class2 = scenario.class2.iter();
    let class2 = class2.map(|tool| MasterLayout { address: tool.address, class: MasterClass::Two, slaves: Vec::new() });
    class1.chain(class2).collect()
}

/// What pictures say about a run of `scenario`.
pub(super) fn meta(scenario: &Scenario, layout: &Layout) -> PlotMeta {
    PlotMeta {
        cycle: scenario.cycle_symbol(),
        scenario: scenario.name.clone(),
        seed: scenario.run.seed,
        t_dp: scenario.master.t_dp,
        slaves: layout.slaves().iter().map(|slave| slave.address).collect(),
        links: layout.links().to_vec(),
        masters: 1 + scenario.class1.len() + scenario.class2.len(),
        duration: scenario.master.t_dp * cycles(scenario) as i64,
        disturbances: scenario.disturbances.iter().map(|disturbance| disturbance.name.clone()).collect(),
        topology: Map::of(scenario),
    }
}

fn facts(scenario: &Scenario) -> Facts {
    let slaves = scenario.configured();
    Facts {
        scenario: scenario.name.clone(),
        bit_rate: scenario.bus.params.rate,
        seed: scenario.run.seed,
        slaves: slaves
            .map(|slave| SlaveFacts {
                device: slave.device.name.clone().into_owned(),
                t_o: scenario.is_clocked(slave).then_some(slave.times.t_o),
            })
            .collect(),
        fingerprint: Vec::new(),
    }
}

/// What the pictures show of the figures.
fn distributions(figures: &Figures) -> Distributions {
    let histograms = figures.histograms();
    let of = |name: &str, subject| {
        let quantity = Quantity::named(name).expect("a line of the registry");
        histograms.get(name, subject).map_or_else(Distribution::default, |found| distribution(quantity, found))
    };
    let link = |&(publisher, subscriber): &(Address, Address)| {
        let subject = Subject::Link(publisher, subscriber);
        let [wire, publish, age] = ["wire", "publish", "age"].map(|name| of(name, subject));
        LinkLatencies { publisher, subscriber, wire, publish, age }
    };
    Distributions {
        latch_skew: of("latch_skew", Subject::Network),
        t_dp_deviation: of("t_dp_deviation", Subject::Network),
        synch_delay: of("synch_delay", Subject::Network),
        links: histograms.layout().links().iter().map(link).collect(),
        episodes: EpisodeTimes::all(figures.episodes()),
    }
}

fn distribution(quantity: &Quantity, histogram: &Histogram) -> Distribution {
    let value = |span: Span| quantity.unit.of(span);
    let marks = [("p50", 50.0), ("p90", 90.0), ("p99", 99.0), ("p99.9", 99.9)];
    let marks = marks.into_iter().filter_map(|(label, percent)| Some((label, histogram.percentile(percent)?)));
    let marks = marks.chain(histogram.max().map(|max| ("max", max)));
    Distribution {
        title: quantity.title.to_owned(),
        unit: quantity.unit.text().to_owned(),
        bins: histogram.bins(BINS).iter().map(|bin| (value(bin.from), value(bin.to), bin.count)).collect(),
        marks: marks.map(|(label, span)| (label.to_owned(), value(span))).collect(),
        count: histogram.count(),
    }
}
