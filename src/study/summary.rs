//! Summary: what a run came to, as one value. The screen and `summary.json` show the same.

use serde::{Serialize, Serializer};

use super::acyclic::AcyclicSummary;
use super::count::{Counts, LinkCounts, SlaveCounts};
use super::episode::{EpisodeSummary, Episodes};
use super::export::decimal::{Decimal, ms, ms_or_null, ns_or_null, s, us, us_or_null};
use super::export::thinning::Thinning;
use super::first_fault::{FirstFault, FirstFaults};
use super::histogram::{Histogram, Histograms, QUANTITIES, Subject};
use super::invocation::Invocation;
use super::live_list::{Seen, Station};
use super::masters::MasterSummary;
use super::steady::SteadySummary;
use super::trace::WINDOW;
use super::verdict::Verdict;
use crate::observation::Leds;
use crate::time::{BitRate, Span};
use crate::wire::Address;

/// What a run came to. Keys of the JSON name their units; a quantity without value is `null`.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// The network and the run.
    pub network: Network,
    /// Segments, links and stations as a drawing in text; empty for a network of one cable.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub topology: Vec<String>,
    /// What a network like this should not have, but may.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// The bus cycle.
    pub timing: Timing,
    /// What happened how often.
    pub counts: Happened,
    /// The token ring; none where the master was alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ring: Option<Ring>,
    /// Per master, in address order; nobody where there is one only.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub masters: Vec<MasterSummary>,
    /// Distributions of the network's quantities, by name.
    #[serde(serialize_with = "map")]
    pub distributions: Vec<(&'static str, Distribution)>,
    /// Per slave, in address order.
    pub slaves: Vec<SlaveSummary>,
    /// Per link, by publisher, then subscriber.
    pub links: Vec<LinkSummary>,
    /// Every station that was seen or looked for, in address order.
    pub live_list: Vec<StationSummary>,
    /// Acyclic services per class of master; none before [`Summary::show_acyclic`].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub acyclic: Vec<AcyclicSummary>,
    /// Each slave's first fault of each code, in the order of time; none before [`Summary::show_faults`].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub first_faults: Vec<FaultSummary>,
    /// What the flight recorder kept; none where it is off.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flight: Option<String>,
    /// From disturbances to faults, and back to full operation; none before [`Summary::show_episodes`] and where no slave
    /// was harmed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub episodes: Option<EpisodeSummary>,
    /// From when on all slaves are locked and in operation, and what came then; none before the fingerprints are known
    /// and of a network without SYNCH. It is made of what the hash of all figures is of.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steady_state: Option<SteadySummary>,
    /// Name and text of each fingerprint.
    #[serde(serialize_with = "map")]
    pub fingerprint: Vec<(String, String)>,
    /// What became of the scenario's expectations, in their order; nothing where it expects nothing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub verdicts: Vec<Verdict>,
    /// What each table of rows kept.
    pub thinning: Vec<Thinning>,
    /// Events that `events.csv` does not hold.
    pub events_left_out: u64,
    /// The files of the run.
    pub files: Vec<String>,
}

/// What only the builder of a run knows.
#[derive(Clone, PartialEq, Debug)]
pub struct Facts {
    /// Name of the scenario.
    pub scenario: String,
    /// Bit rate.
    pub bit_rate: BitRate,
    /// Seed of all random streams.
    pub seed: u64,
    /// The slaves in address order.
    pub slaves: Vec<SlaveFacts>,
    /// Name and text of each fingerprint.
    pub fingerprint: Vec<(String, String)>,
}

/// What only the builder of a run knows of one slave.
#[derive(Clone, PartialEq, Debug)]
pub struct SlaveFacts {
    /// Name of the device profile.
    pub device: String,
    /// T_O (manual 3.3.6); none for a slave without set points.
    pub t_o: Option<Span>,
}

/// The network and the run.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Network {
    /// Name of the scenario.
    pub scenario: String,
    /// Bit rate with its unit.
    pub bit_rate: &'static str,
    /// Seed of all random streams.
    pub seed: u64,
    /// Address of the master.
    pub master: u8,
    /// Number of slaves.
    pub slaves: usize,
    /// Number of slave-to-slave links.
    pub links: usize,
    /// Cycles that began.
    pub cycles: u64,
    /// True length of the run.
    #[serde(rename = "duration_s", serialize_with = "s")]
    pub duration: Span,
}

/// The bus cycle.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Timing {
    /// Nominal T_DP.
    #[serde(rename = "t_dp_us", serialize_with = "us")]
    pub t_dp: Span,
    /// Longest T_DX of the run.
    #[serde(rename = "t_dx_max_us", serialize_with = "us_or_null")]
    pub t_dx_max: Option<Span>,
    /// T_DP minus the longest T_DX.
    #[serde(rename = "left_after_t_dx_us", serialize_with = "us_or_null")]
    pub left: Option<Span>,
    /// Shortest silence before a SYNCH.
    #[serde(rename = "spare_min_us", serialize_with = "us_or_null")]
    pub spare_min: Option<Span>,
    /// Smallest T_I.
    #[serde(rename = "t_i_min_us", serialize_with = "us_or_null")]
    pub t_i_min: Option<Span>,
    /// Largest T_I.
    #[serde(rename = "t_i_max_us", serialize_with = "us_or_null")]
    pub t_i_max: Option<Span>,
    /// Smallest T_O.
    #[serde(rename = "t_o_min_us", serialize_with = "us_or_null")]
    pub t_o_min: Option<Span>,
    /// Largest T_O.
    #[serde(rename = "t_o_max_us", serialize_with = "us_or_null")]
    pub t_o_max: Option<Span>,
    /// Shortest true time between two cycle starts at the master.
    #[serde(rename = "cycle_time_min_us", serialize_with = "us_or_null")]
    pub cycle_min: Option<Span>,
    /// Mean of the same.
    #[serde(rename = "cycle_time_mean_us", serialize_with = "us_or_null")]
    pub cycle_mean: Option<Span>,
    /// Longest of the same.
    #[serde(rename = "cycle_time_max_us", serialize_with = "us_or_null")]
    pub cycle_max: Option<Span>,
}

/// What happened how often in the network.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Happened {
    /// Faults that slaves latched.
    pub faults: u64,
    /// Requests that the master repeated.
    pub retries: u64,
    /// Requests without answer after all retries.
    pub no_answers: u64,
    /// Times that slaves asked for Slave_Diag during data exchange; not written where it did not happen.
    #[serde(skip_serializing_if = "is_zero")]
    pub diagnoses: u64,
    /// Times that the master went back to Clear on its own; not written where it did not happen.
    #[serde(skip_serializing_if = "is_zero")]
    pub auto_clears: u64,
    /// SYNCHs that could not be sent when planned.
    pub late_clocks: u64,
    /// Tokens claimed after silence, the first one included.
    pub tokens_claimed: u64,
    /// Telegrams that overlapped.
    pub collisions: u64,
    /// Telegrams that the scenario disturbed.
    pub disturbed: u64,
    /// Events.
    pub events: u64,
    /// Largest latch skew \[steps\].
    pub skew_max_steps: Option<f64>,
}

/// The token ring as the master saw it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
pub struct Ring {
    /// How often the token came round.
    pub rotations: u64,
    /// Shortest token rotation time T_RR.
    #[serde(rename = "rotation_min_us", serialize_with = "us")]
    pub min: Span,
    /// Mean token rotation time.
    #[serde(rename = "rotation_mean_us", serialize_with = "us")]
    pub mean: Span,
    /// Longest token rotation time.
    #[serde(rename = "rotation_max_us", serialize_with = "us")]
    pub max: Span,
    /// SYNCHs that could not be sent when planned.
    pub late_clocks: u64,
    /// The latest of them.
    #[serde(rename = "late_clock_max_us", serialize_with = "us")]
    pub latest: Span,
    /// SYNCHs that were left out because the token was away, or the bus in use, for a whole cycle.
    pub missed_clocks: u64,
}

impl Ring {
    fn of(counts: &Counts) -> Option<Self> {
        let network = &counts.network;
        let rotation = &network.rotation;
        Some(Self {
            rotations: rotation.count,
            min: rotation.min,
            mean: rotation.mean()?,
            max: rotation.max,
            late_clocks: network.late_clocks,
            latest: network.latest_clock,
            missed_clocks: network.missed_clocks,
        })
    }
}

/// What became of one slave.
#[derive(Clone, Debug, Serialize)]
pub struct SlaveSummary {
    /// Its address.
    pub address: u8,
    /// Name of the device profile.
    pub device: String,
    /// DP state at the end.
    pub state: &'static str,
    /// Start-up phase at the end.
    pub phase: &'static str,
    /// State of the clock recovery at the end.
    pub pll: &'static str,
    /// What the LEDs show at the end; none before [`Summary::show_leds`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leds: Option<LedSummary>,
    /// T_I.
    #[serde(rename = "t_i_us", serialize_with = "us")]
    pub t_i: Span,
    /// T_O.
    #[serde(rename = "t_o_us", serialize_with = "us_or_null")]
    pub t_o: Option<Span>,
    /// Cycles from the first SYNCH taken to the lock of the clock recovery.
    pub lock_cycles: Option<u64>,
    /// True time of the same.
    #[serde(rename = "lock_ms", serialize_with = "ms_or_null")]
    pub lock: Option<Span>,
    /// How often the clock recovery locked again.
    pub resynchronisations: u64,
    /// SYNCH outside the window or missing.
    pub clock_failures: u64,
    /// How often each fault was latched, by its code.
    #[serde(serialize_with = "map")]
    pub faults: Vec<(String, u64)>,
    /// Faults that were acknowledged.
    pub acknowledgements: u64,
    /// Requests that the master repeated.
    pub retries: u64,
    /// Requests without answer after all retries.
    pub no_answers: u64,
    /// Times that it asked for Slave_Diag during data exchange; not written where it did not happen.
    #[serde(skip_serializing_if = "is_zero")]
    pub diagnoses: u64,
    /// True time in each start-up phase.
    #[serde(rename = "phases_ms", serialize_with = "phases")]
    pub phases: Vec<(&'static str, Span)>,
    /// Distributions of the slave's quantities, by name.
    #[serde(serialize_with = "map")]
    pub distributions: Vec<(&'static str, Distribution)>,
}

/// One line of the live list; what each figure counts is told by [`Station`].
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
pub struct StationSummary {
    /// Its address.
    pub address: u8,
    /// What it was seen as at worst.
    #[serde(rename = "worst_state", serialize_with = "seen")]
    pub seen: Seen,
    /// How often it left data exchange against its master's will.
    pub lost: u64,
    /// How often it was brought into data exchange.
    pub syncs: u64,
    /// Repeated requests.
    pub repeats: u64,
    /// Most of them in one cycle.
    pub repeats_max_per_cycle: u64,
    /// Answers that do not fit their request.
    pub illegal_responses: u64,
    /// Diagnoses read.
    pub diagnoses: u64,
}

impl StationSummary {
    /// Whether there is something to look at: it is not where it should be, was started more than once, or did not answer
    /// as it should.
    pub const fn is_remarkable(&self) -> bool {
        self.seen.is_bad() || self.lost > 0 || self.syncs > 1 || self.repeats > 0 || self.illegal_responses > 0
    }
    fn of((address, station): (u8, &Station)) -> Option<Self> {
        let &Station { lost, syncs, repeats, most_repeats, illegal, diagnoses, .. } = station;
        Some(Self {
            address,
            seen: station.seen?,
            lost,
            syncs,
            repeats,
            repeats_max_per_cycle: most_repeats,
            illegal_responses: illegal,
            diagnoses,
        })
    }
}

/// What the two LEDs of a slave show (manual 5.2).
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
pub struct LedSummary {
    /// The red one: dark, bright or flashing.
    pub red: &'static str,
    /// The green one.
    pub green: &'static str,
    /// What the manual says of this.
    pub meaning: &'static str,
}

impl LedSummary {
    /// The words for a pattern.
    pub const fn of(leds: Leds) -> Self {
        Self { red: leds.red().text(), green: leds.green().text(), meaning: leds.meaning() }
    }
}

/// The latencies of one link.
#[derive(Clone, Debug, Serialize)]
pub struct LinkSummary {
    /// Whose data.
    pub publisher: u8,
    /// Who takes them.
    pub subscriber: u8,
    /// How often it worked and how often not; none before [`Summary::show_receptions`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub receptions: Option<Receptions>,
    /// Distributions of the link's quantities, by name.
    #[serde(serialize_with = "map")]
    pub distributions: Vec<(&'static str, Distribution)>,
}

/// A fault of a slave where it was latched first.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct FaultSummary {
    /// The slave.
    pub slave: u8,
    /// The code (manual 5.3).
    pub code: String,
    /// In which cycle.
    pub cycle: u64,
    /// True time since power-on.
    #[serde(rename = "at_ms", serialize_with = "ms")]
    pub at: Span,
    /// How often the slave latched it in the whole run.
    pub count: u64,
    /// The command line that tells the cycles around it.
    pub replay: String,
}

/// What a subscriber got from one publisher.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
pub struct Receptions {
    /// Valid receptions.
    pub valid: u64,
    /// How often nothing came for the watchdog time.
    pub lost: u64,
    /// Data of another length than parameterised.
    pub length_errors: u64,
    /// Longest true time between two valid receptions.
    #[serde(rename = "longest_gap_ms", serialize_with = "ms_or_null")]
    pub longest_gap: Option<Span>,
}

impl From<&LinkCounts> for Receptions {
    fn from(&LinkCounts { valid, lost, length_errors, longest_gap, .. }: &LinkCounts) -> Self {
        Self { valid, lost, length_errors, longest_gap }
    }
}

/// A distribution in a few numbers. Percentiles have three significant digits, the rest is exact.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
pub struct Distribution {
    /// Values.
    pub count: u64,
    /// Of these, values beyond the histogram's bounds.
    pub out_of_range: u64,
    /// Smallest value.
    #[serde(rename = "min_ns", serialize_with = "ns_or_null")]
    pub min: Option<Span>,
    /// Mean.
    #[serde(rename = "mean_ns", serialize_with = "ns_or_null")]
    pub mean: Option<Span>,
    /// Median.
    #[serde(rename = "p50_ns", serialize_with = "ns_or_null")]
    pub p50: Option<Span>,
    /// 90th percentile.
    #[serde(rename = "p90_ns", serialize_with = "ns_or_null")]
    pub p90: Option<Span>,
    /// 99th percentile.
    #[serde(rename = "p99_ns", serialize_with = "ns_or_null")]
    pub p99: Option<Span>,
    /// 99.9th percentile.
    #[serde(rename = "p99.9_ns", serialize_with = "ns_or_null")]
    pub p99_9: Option<Span>,
    /// Largest value.
    #[serde(rename = "max_ns", serialize_with = "ns_or_null")]
    pub max: Option<Span>,
    /// 99th percentile of the magnitudes.
    #[serde(rename = "magnitude_p99_ns", serialize_with = "ns_or_null")]
    pub magnitude_p99: Option<Span>,
    /// The value farthest from zero, with its sign.
    #[serde(rename = "farthest_ns", serialize_with = "ns_or_null")]
    pub farthest: Option<Span>,
}

impl Distribution {
    /// The numbers of a histogram.
    pub fn of(histogram: &Histogram) -> Self {
        Self {
            count: histogram.count(),
            out_of_range: histogram.below() + histogram.above(),
            min: histogram.min(),
            mean: histogram.mean(),
            p50: histogram.percentile(50.0),
            p90: histogram.percentile(90.0),
            p99: histogram.percentile(99.0),
            p99_9: histogram.percentile(99.9),
            max: histogram.max(),
            magnitude_p99: histogram.magnitude_percentile(99.0),
            farthest: histogram.farthest(),
        }
    }
}

impl Summary {
    /// The summary of a run. Files and thinning are added by the exports.
    ///
    /// # Panics
    /// If the facts, the counts and the histograms are not of the same slaves.
    pub fn new(facts: Facts, counts: &Counts, histograms: &Histograms) -> Self {
        let layout = histograms.layout();
        assert_eq!(facts.slaves.len(), layout.slaves().len(), "facts of other slaves");
        assert_eq!(counts.slaves.len(), layout.slaves().len(), "counts of other slaves");
        let link = |&(publisher, subscriber): &(Address, Address)| LinkSummary {
            publisher: publisher.get(),
            subscriber: subscriber.get(),
            receptions: None,
            distributions: distributions(histograms, Subject::Link(publisher, subscriber)),
        };
        Self {
            timing: timing(&facts, counts, histograms),
            counts: happened(counts),
            ring: Ring::of(counts),
            masters: MasterSummary::all(counts, layout),
            distributions: distributions(histograms, Subject::Network),
            slaves: (0..facts.slaves.len()).map(|index| slave(index, &facts, counts, histograms)).collect(),
            links: layout.links().iter().map(link).collect(),
            live_list: counts.live_list.stations().filter_map(StationSummary::of).collect(),
            acyclic: Vec::new(),
            first_faults: Vec::new(),
            flight: None,
            episodes: None,
            steady_state: None,
            network: Network {
                scenario: facts.scenario,
                bit_rate: facts.bit_rate.text(),
                seed: facts.seed,
                master: layout.master.get(),
                slaves: layout.slaves().len(),
                links: layout.links().len(),
                cycles: counts.network.cycles,
                duration: counts.network.duration,
            },
            fingerprint: facts.fingerprint,
            topology: Vec::new(),
            warnings: Vec::new(),
            verdicts: Vec::new(),
            thinning: Vec::new(),
            events_left_out: 0,
            files: Vec::new(),
        }
    }

    /// Adds what the LEDs of every slave show. They are words for people and no figures, so a hash of all figures does
    /// without them; their changes are in the fingerprint of the states.
    pub fn show_leds(&mut self, counts: &Counts) {
        for (slave, counts) in self.slaves.iter_mut().zip(&counts.slaves) {
            slave.leds = Some(LedSummary::of(counts.leds));
        }
    }

    /// Adds what the subscribers received. What becomes of links is in the fingerprint of the states, and the latencies of
    /// every reception are in that of the statistics, which therefore stays that of the latencies alone.
    pub fn show_receptions(&mut self, counts: &Counts) {
        for (link, counts) in self.links.iter_mut().zip(&counts.links) {
            link.receptions = Some(counts.into());
        }
    }
    /// Adds the acyclic services. All of them are on the line, whose hash is another fingerprint; the hash of all figures
    /// stays comparable with that of runs before they were counted.
    pub fn show_acyclic(&mut self, counts: &Counts) {
        self.acyclic = AcyclicSummary::all(&counts.acyclic);
    }

    /// Adds where each fault was first, and how to look at it again. How often each came is counted among the figures.
    pub fn show_faults(&mut self, faults: &FirstFaults, invocation: &Invocation) {
        let seed = self.network.seed;
        let of = |fault: &FirstFault| FaultSummary {
            slave: fault.slave.get(),
            code: format!("{:04X}", fault.code),
            cycle: fault.cycle,
            at: fault.at.since_zero(),
            count: fault.count,
            replay: invocation.replay(seed, fault.cycle, WINDOW),
        };
        self.first_faults = faults.all().iter().map(of).collect();
    }
    /// Whether every expectation of the scenario holds.
    pub fn passed(&self) -> bool {
        self.verdicts.iter().all(|verdict| verdict.passed)
    }
    /// Adds the episodes. What they are made of is in the fingerprint of the states; the hash of all figures stays
    /// comparable with that of runs before they were told.
    pub fn show_episodes(&mut self, episodes: &Episodes) {
        self.episodes = EpisodeSummary::of(episodes);
    }

    /// A distribution of the network by the name of its quantity.
    pub fn distribution(&self, name: &str) -> Option<&Distribution> {
        named(&self.distributions, name)
    }
}
impl SlaveSummary {
    /// A distribution of the slave by the name of its quantity.
    pub fn distribution(&self, name: &str) -> Option<&Distribution> {
        named(&self.distributions, name)
    }
    /// All faults, whatever their code.
    pub fn fault_count(&self) -> u64 {
        self.faults.iter().map(|fault| fault.1).sum()
    }
}
impl LinkSummary {
    /// A distribution of the link by the name of its quantity.
    pub fn distribution(&self, name: &str) -> Option<&Distribution> {
        named(&self.distributions, name)
    }
}

fn named<'a>(all: &'a [(&'static str, Distribution)], name: &str) -> Option<&'a Distribution> {
    all.iter().find(|distribution| distribution.0 == name).map(|distribution| &distribution.1)
}

/// Everything that is recorded of one subject.
fn distributions(histograms: &Histograms, subject: Subject) -> Vec<(&'static str, Distribution)> {
    let of = |name| Some((name, Distribution::of(histograms.get(name, subject)?)));
    QUANTITIES.iter().filter_map(|quantity| of(quantity.name)).collect()
}

fn timing(facts: &Facts, counts: &Counts, histograms: &Histograms) -> Timing {
    let cycles = counts.network.cycle_times;
    let some = |time| (cycles.count > 0).then_some(time);
    let layout = histograms.layout();
    let network = |name| histograms.get(name, Subject::Network);
    let t_dx_max = network("t_dx").and_then(Histogram::max);
    // A slave that runs freely has neither.
    let clocked = || layout.slaves().iter().zip(&facts.slaves).filter(|(_, facts)| facts.t_o.is_some());
    let t_i = || clocked().map(|(slave, _)| slave.t_i);
    let t_o = || facts.slaves.iter().filter_map(|slave| slave.t_o);
    Timing {
        t_dp: layout.t_dp,
        t_dx_max,
        left: t_dx_max.map(|t_dx| layout.t_dp - t_dx),
        spare_min: network("spare").and_then(Histogram::min),
        t_i_min: t_i().min(),
        t_i_max: t_i().max(),
        t_o_min: t_o().min(),
        t_o_max: t_o().max(),
        cycle_min: some(cycles.min),
        cycle_mean: cycles.mean(),
        cycle_max: some(cycles.max),
    }
}

fn happened(counts: &Counts) -> Happened {
    let network = &counts.network;
    Happened {
        faults: counts.slaves.iter().map(SlaveCounts::fault_count).sum(),
        retries: network.retries,
        no_answers: network.no_answers,
        diagnoses: network.diagnoses,
        auto_clears: network.auto_clears,
        late_clocks: network.late_clocks,
        tokens_claimed: network.tokens_claimed,
        collisions: network.collisions,
        disturbed: network.disturbed,
        events: network.events,
        skew_max_steps: network.skew_counts,
    }
}

fn slave(index: usize, facts: &Facts, counts: &Counts, histograms: &Histograms) -> SlaveSummary {
    let (facts, counts) = (&facts.slaves[index], &counts.slaves[index]);
    let phases = crate::observation::Phase::ALL.iter().zip(counts.phases);
    SlaveSummary {
        address: counts.address.get(),
        device: facts.device.clone(),
        state: counts.state.text(),
        phase: counts.phase.text(),
        pll: counts.pll.text(),
        leds: None,
        t_i: histograms.layout().slaves()[index].t_i,
        t_o: facts.t_o,
        lock_cycles: counts.lock.map(|lock| lock.cycles),
        lock: counts.lock.map(|lock| lock.span),
        resynchronisations: counts.resynchronisations,
        clock_failures: counts.clock_failures,
        faults: counts.faults.iter().map(|(code, count)| (format!("{code:04X}"), *count)).collect(),
        acknowledgements: counts.acknowledgements,
        retries: counts.retries,
        no_answers: counts.no_answers,
        diagnoses: counts.diagnoses,
        phases: phases.map(|(phase, span)| (phase.text(), span)).collect(),
        distributions: distributions(histograms, Subject::Slave(counts.address)),
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde asks for")]
const fn is_zero(count: &u64) -> bool {
    *count == 0
}
/// Serializes pairs as a map, in their order.
pub(super) fn map<S: Serializer, K: Serialize, V: Serialize>(
    entries: &[(K, V)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(entries.iter().map(|(key, value)| (key, value)))
}
#[allow(clippy::trivially_copy_pass_by_ref)] // As serde asks for it.
fn seen<S: Serializer>(seen: &Seen, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(seen.text())
}
fn phases<S: Serializer>(phases: &[(&'static str, Span)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(phases.iter().map(|&(phase, span)| (phase, Decimal::ms(span))))
}
