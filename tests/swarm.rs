//! A swarm of random networks: whatever may stand together in a scenario runs together, the same every time, and comes
//! back to order when all disturbances are over.
//!
//! `ISODP_SWARM_CASES` says how many networks, `ISODP_SWARM_SEED` the seed of the first one; the next has the next seed.

mod disturbance;
mod draw;
mod scenario;

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};

use isodp::device::node::Node;
use isodp::fdl::{Heard, Input, Outbox, Station as _};
use isodp::observation::{
    AcyclicResult, HandlerState, MasterClass, MasterMode, Observation, Phase, PllState, SlaveState,
};
use isodp::sim::fingerprint::{Fingerprint, Fingerprints};
use isodp::sim::network::{Network, NetworkEvent, Until};
use isodp::sim::queue::{HeapQueue, NearQueue, Queue};
use isodp::sim::record::{Recorder, Stamp, Transmission};
use isodp::study::count::Counts;
use isodp::study::metric::Metrics;
use isodp::study::row::{CycleRow, Sink};
use isodp::study::scenario::disturbance::DISTURBANCES;
use isodp::study::scenario::{Class2, Extent, Scenario};
use isodp::study::{build, run};
use isodp::time::{Local, Span, Time};
use isodp::wire::{Address, Frame};
use rayon::prelude::*;
use scenario::Case;

/// Networks where nothing is said.
const CASES: u64 = 40;
/// One of so many runs writes all its files too.
const WITH_FILES: u64 = 8;
/// Share of texts that may be refused, and of networks whose disturbances may never end (%).
const REFUSED: u64 = 10;

/// A number from the environment.
fn setting(name: &str, usual: u64) -> u64 {
    let value = std::env::var(name).ok();
    value.map_or(usual, |text| text.parse().unwrap_or_else(|_| panic!("{name} is no number: {text}")))
}

/// What the swarm looks at while a network runs.
#[derive(Default)]
struct Watch {
    /// The first master.
    master: Option<Address>,
    /// Its T_DP.
    t_dp: Span,
    /// When a telegram was lost last.
    disturbed: Time,
    collisions: Vec<(Time, Address, Address)>,
    pll: BTreeMap<Address, PllState>,
    /// When the first master went back to Clear last.
    cleared: Time,
    /// When the first master repeated a request last.
    repeated: Time,
    /// When the first master's SYNCH was late, and by how much, though nothing had to be repeated.
    late: Option<(Time, Span)>,
    /// Cycles that the first master began.
    begun: u64,
    /// When each class 2 master had its last answer from a slave.
    answered: BTreeMap<Address, Time>,
    /// Masters that have seen another station use their address. They stay away until their supply is off and on again.
    conflicts: BTreeSet<Address>,
}

impl Recorder for Watch {
    fn telegram(&mut self, _: &Transmission<'_>) {}
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        match *what {
            Observation::Disturbed { .. } => self.disturbed = stamp.at,
            Observation::Collision { with } => self.collisions.push((stamp.at, stamp.station, with)),
            Observation::Retry { .. } if Some(stamp.station) == self.master => self.repeated = stamp.at,
            // T_DP need not have room for what is repeated.
            Observation::ClockLate { .. } if self.repeated + self.t_dp > stamp.at => {}
            Observation::ClockLate { by } => self.late = self.late.or(Some((stamp.at, by))),
            Observation::AutoClear { .. } => self.cleared = stamp.at,
            Observation::AddressConflict => _ = self.conflicts.insert(stamp.station),
            Observation::Power { on: true } => _ = self.conflicts.remove(&stamp.station),
            Observation::CycleStart { .. } if Some(stamp.station) == self.master => self.begun += 1,
            Observation::Pll { to, .. } => {
                self.pll.insert(stamp.station, to);
            }
            Observation::AcyclicDone {
                class: MasterClass::Two,
                result: AcyclicResult::Positive | AcyclicResult::Negative,
                ..
            } => {
                self.answered.insert(stamp.station, stamp.at);
            }
            _ => {}
        }
    }
}

/// Rows are made, and their cycles looked at.
#[derive(Default)]
struct Rows {
    cycles: Vec<u64>,
}
impl Sink for Rows {
    fn cycle(&mut self, row: &CycleRow) {
        self.cycles.push(row.cycle);
    }
}

/// What a run left.
struct Seen {
    end: Time,
    fingerprint: Fingerprint,
    faults: Vec<String>,
    counts: Counts,
    /// A disturbance that hangs on cycles never ends, since no cycle begins any more.
    endless: bool,
    /// Masters that keep away because another station used their address.
    conflicts: BTreeSet<Address>,
}

/// How long everything may take to come back: the GAP finds every station, a free-running master and an isochronous
/// one start each slave up, and connections that nobody closed run out.
fn patience(scenario: &Scenario, case: &Case) -> Span {
    let bus = &scenario.bus.params;
    let gap = 3 * i64::from(bus.gap_factor) * i64::from(bus.hsa);
    // A slave keeps a connection that its master lost for two Send_Timeout of 1 s.
    let connections = if case.asking.is_empty() { Span::ZERO } else { Span::from_ms(2_300) };
    // Each service of a start-up may wait for a rotation in which T_TR leaves time for it.
    let others = scenario.slaves.iter().filter(|slave| slave.master != scenario.master.address).count() as i64;
    case.cycle * (300 + 20 * scenario.slaves.len() as i64 + 150 * others + gap) + connections
}

/// Runs until `until`, or until everything has had time to come back.
fn run_on<Q: Queue<NetworkEvent>>(scenario: &Scenario, case: &Case, until: Option<Time>) -> Seen {
    let mut network: Network<Node, Q> = build::network(scenario);
    let rows = Metrics::new(run::layout(scenario), |_, _| 0.0, Rows::default());
    let mut recorder = (
        Fingerprints::new(scenario.master.address),
        (rows, Watch { master: Some(scenario.master.address), t_dp: scenario.master.t_dp, ..Watch::default() }),
    );
    // Every telegram has three characters and its idle time, and no station does more than a few things about it.
    let telegrams = case.cycle.div_floor(scenario.bus.params.rate.bit()) / 66;
    let budget = scenario.stations().count() as u64 * (telegrams as u64 * 2 + 20) + 100;
    let patience = patience(scenario, case);
    let mut faults = Vec::new();
    let mut endless = false;
    let end = loop {
        let now = network.now() + case.cycle;
        if !network.run(Until::Time(now), budget, &mut recorder) {
            faults.push(format!("more than {budget} events in the cycle before {now:?}"));
            break now;
        }
        let watch = &recorder.1.1;
        let quiet = watch.disturbed.max(Time::ZERO + case.quiet);
        let late = now > Time::ZERO + case.quiet * 4 + patience * 2;
        let back = network.cycles() > case.last_cycle && now > quiet + patience;
        if until.map_or(back || late, |until| now >= until) {
            // A master that is kept out of the ring by what it loses begins no cycles: its disturbance never ends.
            endless = now < quiet + patience || network.cycles() <= case.last_cycle;
            break now;
        }
    };
    let (fingerprints, (rows, watch)) = recorder;
    let (counts, rows) = rows.finish(end);
    if let Some(&[one, next]) = rows.cycles.windows(2).find(|pair| pair[1] != pair[0] + 1) {
        faults.push(format!("cycle {next} comes after cycle {one}"));
    }
    if case.restarts && !watch.conflicts.is_empty() {
        faults.push(format!("another station uses the address of {:?}, though all is over", watch.conflicts));
    }
    if !endless && watch.conflicts.is_empty() {
        judge(scenario, case, &network, &watch, &mut faults);
    }
    Seen { end, fingerprint: fingerprints.total(), faults, counts, endless, conflicts: watch.conflicts }
}

/// What is not as it should be at the end.
fn judge<Q: Queue<NetworkEvent>>(
    scenario: &Scenario,
    case: &Case,
    network: &Network<Node, Q>,
    watch: &Watch,
    faults: &mut Vec<String>,
) {
    if let Some((at, who, with)) = watch.collisions.first().filter(|_| !case.token_at_risk) {
        faults.push(format!("{who} and {with} send at once at {at:?}, and {} times more", watch.collisions.len() - 1));
    }
    if watch.begun != network.cycles() {
        faults.push(format!("the network counts {} cycles, the master began {}", network.cycles(), watch.begun));
    }
    let alone = scenario.class1.is_empty() && scenario.class2.is_empty() && !case.token_at_risk;
    if let Some((at, by)) = watch.late.filter(|_| alone) {
        faults.push(format!("SYNCH is late by {by} at {at:?}"));
    }
    // Nobody orders Operate any more.
    let cleared = watch.cleared > Time::ZERO + case.quiet - case.cycle;
    for slave in scenario.slaves.iter().filter(|slave| !slave.silent) {
        let (state, phase) = match network.station(slave.address) {
            Some(Node::Encoder(encoder)) => (encoder.slave().state(), encoder.phase()),
            Some(Node::Drive(drive)) => (drive.slave().state(), drive.phase()),
            other => panic!("{} is {:?}", slave.address, other.map(isodp::fdl::Station::address)),
        };
        let pll = watch.pll.get(&slave.address).copied();
        let clocked = scenario.is_clocked(slave);
        if state != SlaveState::DataExch {
            faults.push(format!("slave {} is in {state}", slave.address));
        } else if clocked && !cleared && (pll != Some(PllState::Locked) || phase != Phase::Operation) {
            faults.push(format!("slave {} is in phase {phase}, its clock {pll:?}", slave.address));
        }
    }
    for address in std::iter::once(scenario.master.address).chain(scenario.class1.iter().map(|class1| class1.address)) {
        let Some(Node::Master(master)) = network.station(address) else { panic!("{address} is a master") };
        let away = master.handlers().iter().filter(|handler| handler.state() != HandlerState::DataExchange);
        let away: Vec<_> = away.map(|handler| handler.params().address.get()).collect();
        let mode = if cleared && address == scenario.master.address { MasterMode::Clear } else { MasterMode::Operate };
        if master.mode() != mode || !away.is_empty() {
            faults.push(format!("master {address} is in {}, without {away:?}", master.mode()));
        }
    }
    // A message takes a rotation, an answer several of them, and the slaves take turns.
    let silent = |slave: &Address| scenario.slaves.iter().any(|other| other.address == *slave && other.silent);
    let answers = |class2: &Class2| class2.jobs.iter().flat_map(|job| &job.slaves).any(|slave| !silent(slave));
    let asking = scenario.class2.iter().filter(|class2| answers(class2)).map(|class2| class2.address.get());
    for address in asking.filter(|address| case.asking.contains(address)) {
        let last = watch.answered.get(&Address::new(address).expect("an address")).copied();
        let patience = Span::from_ms(500) + case.cycle * (60 + 10 * scenario.slaves.len() as i64);
        if last.is_none_or(|last| last < network.now() - patience) {
            faults.push(format!("class 2 master {address} had its last answer at {last:?}"));
        }
    }
}

/// Everything about one case that is not as it should be, and the run.
fn faults(scenario: &Scenario, case: &Case) -> (Seen, Vec<String>) {
    let first = run_on::<NearQueue<NetworkEvent>>(scenario, case, None);
    let again = run_on::<NearQueue<NetworkEvent>>(scenario, case, Some(first.end));
    let other = run_on::<HeapQueue<NetworkEvent>>(scenario, case, Some(first.end));
    let mut faults = first.faults.clone();
    for (run, name) in [(again, "again"), (other, "on the other queue")] {
        if run.fingerprint != first.fingerprint || format!("{:?}", run.counts) != format!("{:?}", first.counts) {
            faults.push(format!("another fingerprint {name}: {} and {}", first.fingerprint, run.fingerprint));
        }
    }
    (first, faults)
}

/// The run that a user starts, with all its files.
fn with_files(scenario: &Scenario, case: &Case) {
    let room = tempfile::tempdir().expect("a directory");
    let until = Extent::Time(case.quiet);
    let scenario =
        Scenario { run: isodp::study::scenario::Run { duration: until, ..scenario.run }, ..scenario.clone() };
    let outcome = run::run::<NearQueue<NetworkEvent>>(&scenario, Some(room.path()), |_| ());
    outcome.unwrap_or_else(|error| panic!("{error}"));
}

/// How a case went.
enum Tried {
    Well,
    /// Its disturbances never ended.
    Endless,
    /// Its text is refused.
    Refused(String),
    /// With what is wrong and the text.
    Wrong(String),
}

/// Tries the case of this seed.
fn try_seed(seed: u64) -> Tried {
    match scenario::case(seed) {
        Ok(case) => try_case(seed, case),
        Err(why) => Tried::Refused(format!("seed {seed}: {why}")),
    }
}

/// Tries a case; and once more, where masters keep away because their address was used, with those restarted at the end.
fn try_case(seed: u64, case: Case) -> Tried {
    let scenario = match case.scenario() {
        Ok(scenario) => scenario,
        Err(why) => return Tried::Refused(format!("seed {seed}: {why}")),
    };
    let tried = catch_unwind(AssertUnwindSafe(|| {
        if seed.is_multiple_of(WITH_FILES) {
            with_files(&scenario, &case);
        }
        let (run, faults) = faults(&scenario, &case);
        (run.endless, run.end, run.conflicts, faults)
    }));
    let (endless, end, conflicts, faults) = tried.unwrap_or_else(|panic| {
        let message = panic.downcast_ref::<String>().cloned();
        let message = message.or_else(|| panic.downcast_ref::<&str>().map(ToString::to_string));
        (false, Time::ZERO, BTreeSet::new(), vec![format!("panic: {}", message.unwrap_or_default())])
    });
    match (endless, faults.is_empty(), conflicts.is_empty()) {
        (_, false, _) => Tried::Wrong(format!("ISODP_SWARM_SEED={seed}\n{}\n{}", faults.join("\n"), case.text)),
        (true, true, _) => Tried::Endless,
        (false, true, false) => try_case(seed, case.with_restarts(&conflicts, end - Time::ZERO)),
        (false, true, true) => Tried::Well,
    }
}

#[test]
fn every_kind_of_disturbance_is_drawn() {
    let drawn: Vec<_> = disturbance::KINDS.iter().map(|&(kind, _)| kind).collect();
    let known: Vec<_> = DISTURBANCES.iter().map(|kind| kind.name).collect();
    assert_eq!(drawn, known);
}

#[test]
fn random_networks_run_and_come_back() {
    let (cases, first) = (setting("ISODP_SWARM_CASES", CASES), setting("ISODP_SWARM_SEED", 1));
    let tried: Vec<_> = (first..first + cases).into_par_iter().map(try_seed).collect();
    let (mut endless, mut refused, mut wrong) = (0, Vec::new(), Vec::new());
    for tried in tried {
        match tried {
            Tried::Well => {}
            Tried::Endless => endless += 1,
            Tried::Refused(why) => refused.push(why),
            Tried::Wrong(report) => wrong.push(report),
        }
    }
    assert!(wrong.is_empty(), "{} of {cases} networks, seeds from {first} on\n{}", wrong.len(), wrong.join("\n"));
    let few = |count: u64| count * 100 <= cases * REFUSED;
    assert!(few(refused.len() as u64), "{} of {cases} texts are refused:\n{}", refused.len(), refused.join("\n"));
    assert!(few(endless), "the disturbances of {endless} of {cases} networks never end");
}

/// SYNCH cannot be called back: the cycle that it begins has its number, whoever has the token by then.
#[test]
fn a_cycle_is_counted_where_the_token_goes_before_synch_has_left() {
    let text = "[run]\ncycles = 9\n[bus]\nrate = \"12 Mbit/s\"\n[master]\naddress = 2\nt_dp = \"2 ms\"\nt_i = \"125 us\"\n\
                t_o = \"500 us\"\n[[slave]]\naddress = 4\ndevice = \"posital-ocd-dpb1b\"\n";
    let scenario = Scenario::parse("synch", "synch.toml", text, &[]).unwrap_or_else(|error| panic!("{error}"));
    let mut network: Network<Node, NearQueue<NetworkEvent>> = build::network(&scenario);
    let mut starts = Starts::default();
    assert!(network.run(Until::Cycle(9), 100_000, &mut starts));
    let (cycle, nominal) = starts.0.expect("a cycle");
    // Nothing but SYNCH is left of this cycle.
    assert!(network.run(Until::Time(network.now() + Span::from_us(1_900)), 100_000, &mut starts));
    let mut master = network.station(scenario.master.address).expect("the master").clone();
    let mut token = Frame::new();
    token.set_token(Address::new(6).expect("an address"), Address::new(5).expect("an address"));
    let mut out = Outbox::new();
    let heard = Heard { octets: token.octets(), sample: 0 };
    master.step(nominal + Span::from_us(1_900), Input::Telegram(heard), &mut out);
    assert!(out.observations().any(|seen| matches!(seen, Observation::TokenDropped { .. })));
    out.clear();
    master.step(nominal + Span::from_ms(2), Input::Sent, &mut out);
    let next = out.observations().find_map(|seen| match *seen {
        Observation::CycleStart { cycle, .. } => Some(cycle),
        _ => None,
    });
    assert_eq!((next, out.sending().is_none()), (Some(cycle + 1), true), "and nothing is asked without the token");
}

/// The last cycle that began.
#[derive(Default)]
struct Starts(Option<(u64, Local)>);

impl Recorder for Starts {
    fn telegram(&mut self, _: &Transmission<'_>) {}
    fn observe(&mut self, _: Stamp<'_>, what: &Observation) {
        if let Observation::CycleStart { cycle, nominal } = *what {
            self.0 = Some((cycle, nominal));
        }
    }
}
