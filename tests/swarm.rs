//! A swarm of random networks: whatever may stand together in a scenario runs together, the same every time, and comes
//! back to order when all disturbances are over.
//!
//! `ISODP_SWARM_CASES` says how many networks, `ISODP_SWARM_SEED` the seed of the first one; the next has the next seed.

mod draw;
mod scenario;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};

use isodp::device::node::Node;
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
use isodp::study::scenario::Scenario;
use isodp::study::{build, run};
use isodp::time::{Span, Time};
use isodp::wire::Address;
use rayon::prelude::*;
use scenario::Case;

/// Networks where nothing is said.
const CASES: u64 = 24;
/// Share of texts that may be refused (%).
const REFUSED: u64 = 10;

/// A number from the environment.
fn setting(name: &str, usual: u64) -> u64 {
    let value = std::env::var(name).ok();
    value.map_or(usual, |text| text.parse().unwrap_or_else(|_| panic!("{name} is no number: {text}")))
}

/// What the swarm looks at while a network runs.
#[derive(Default)]
struct Watch {
    /// When a telegram was lost last.
    disturbed: Time,
    collisions: Vec<(Time, Address, Address)>,
    pll: BTreeMap<Address, PllState>,
    /// When each class 2 master had its last answer from a slave.
    answered: BTreeMap<Address, Time>,
}

impl Recorder for Watch {
    fn telegram(&mut self, _: &Transmission<'_>) {}
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        match *what {
            Observation::Disturbed { .. } => self.disturbed = stamp.at,
            Observation::Collision { with } => self.collisions.push((stamp.at, stamp.station, with)),
            Observation::Pll { to, .. } => {
                self.pll.insert(stamp.station, to);
            }
            Observation::AcyclicDone { class: MasterClass::Two, result, .. }
                if matches!(result, AcyclicResult::Positive | AcyclicResult::Negative) =>
            {
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
}

/// How long everything may take to come back: the GAP finds every station, a free-running master and an isochronous
/// one start each slave up, and connections that nobody closed run out.
fn patience(scenario: &Scenario, case: &Case) -> Span {
    let bus = &scenario.bus.params;
    let gap = 3 * i64::from(bus.gap_factor) * i64::from(bus.hsa);
    case.cycle * (300 + 20 * scenario.slaves.len() as i64 + gap) + Span::from_ms(300)
}

/// Runs until `until`, or until everything has had time to come back.
fn run_on<Q: Queue<NetworkEvent>>(scenario: &Scenario, case: &Case, until: Option<Time>) -> Seen {
    let mut network: Network<Node, Q> = build::network(scenario);
    let rows = Metrics::new(run::layout(scenario), |_, _| 0.0, Rows::default());
    let mut recorder = (Fingerprints::default(), (rows, Watch::default()));
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
            endless = now < quiet + patience;
            break now;
        }
    };
    let (fingerprints, (rows, watch)) = recorder;
    let (counts, rows) = rows.finish(end);
    if let Some(pair) = rows.cycles.windows(2).find(|pair| pair[1] != pair[0] + 1) {
        faults.push(format!("cycle {} comes after cycle {}", pair[1], pair[0]));
    }
    if endless {
        eprintln!("endless");
    } else {
        judge(scenario, case, &network, &watch, &mut faults);
    }
    Seen { end, fingerprint: fingerprints.total(), faults, counts }
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
    for slave in &scenario.slaves {
        let (state, phase) = match network.station(slave.address) {
            Some(Node::Encoder(encoder)) => (encoder.slave().state(), encoder.phase()),
            Some(Node::Drive(drive)) => (drive.slave().state(), drive.phase()),
            other => panic!("{} is {:?}", slave.address, other.map(isodp::fdl::Station::address)),
        };
        let pll = watch.pll.get(&slave.address).copied();
        let clocked = scenario.is_clocked(slave);
        if state != SlaveState::DataExch {
            faults.push(format!("slave {} is in {state}", slave.address));
        } else if clocked && (pll != Some(PllState::Locked) || phase != Phase::Operation) {
            faults.push(format!("slave {} is in phase {phase}, its clock {pll:?}", slave.address));
        }
    }
    for address in std::iter::once(scenario.master.address).chain(scenario.class1.iter().map(|class1| class1.address)) {
        let Some(Node::Master(master)) = network.station(address) else { panic!("{address} is a master") };
        let away = master.handlers().iter().filter(|handler| handler.state() != HandlerState::DataExchange);
        let away: Vec<_> = away.map(|handler| handler.params().address.get()).collect();
        if master.mode() != MasterMode::Operate || !away.is_empty() {
            faults.push(format!("master {address} is in {}, without {away:?}", master.mode()));
        }
    }
    for &address in &case.asking {
        let last = watch.answered.get(&Address::new(address).expect("an address")).copied();
        if last.is_none_or(|last| last < network.now() - Span::from_ticks(patience(scenario, case).ticks() / 2)) {
            faults.push(format!("class 2 master {address} had its last answer at {last:?}"));
        }
    }
}

/// Everything about one case that is not as it should be.
fn faults(scenario: &Scenario, case: &Case) -> Vec<String> {
    let first = run_on::<NearQueue<NetworkEvent>>(scenario, case, None);
    let again = run_on::<NearQueue<NetworkEvent>>(scenario, case, Some(first.end));
    let other = run_on::<HeapQueue<NetworkEvent>>(scenario, case, Some(first.end));
    let mut faults = first.faults;
    for (run, name) in [(again, "again"), (other, "on the other queue")] {
        if run.fingerprint != first.fingerprint || format!("{:?}", run.counts) != format!("{:?}", first.counts) {
            faults.push(format!("another fingerprint {name}: {} and {}", first.fingerprint, run.fingerprint));
        }
    }
    faults
}

/// What is wrong with the case of this seed; none also where it is refused, which the flag tells.
fn try_seed(seed: u64) -> (bool, Option<String>) {
    let mut refused = false;
    let mut text = String::new();
    let tried = catch_unwind(AssertUnwindSafe(|| match scenario::case(seed) {
        Err(why) => {
            text = why;
            refused = true;
            Vec::new()
        }
        Ok(case) => {
            text.clone_from(&case.text);
            match case.scenario() {
                Ok(scenario) => faults(&scenario, &case),
                Err(error) => {
                    text = error;
                    refused = true;
                    Vec::new()
                }
            }
        }
    }));
    if refused {
        eprintln!("seed {seed} is refused: {text}");
        return (true, None);
    }
    let faults = tried.unwrap_or_else(|panic| {
        let message = panic.downcast_ref::<String>().cloned();
        let message = message.or_else(|| panic.downcast_ref::<&str>().map(ToString::to_string));
        vec![format!("panic: {}", message.unwrap_or_default())]
    });
    let report = (!faults.is_empty()).then(|| {
        let mut report = format!("---- ISODP_SWARM_SEED={seed}\n");
        for fault in &faults {
            let _ = writeln!(report, "! {fault}");
        }
        report + &text
    });
    (false, report)
}

#[test]
fn random_networks_run_and_come_back() {
    let (cases, first) = (setting("ISODP_SWARM_CASES", CASES), setting("ISODP_SWARM_SEED", 1));
    let tried: Vec<_> = (first..first + cases).into_par_iter().map(try_seed).collect();
    let refused = tried.iter().filter(|(refused, _)| *refused).count() as u64;
    let wrong: Vec<_> = tried.iter().filter_map(|(_, report)| report.as_deref()).collect();
    assert!(wrong.is_empty(), "{} of {cases} networks, refused {refused}\n{}", wrong.len(), wrong.join("\n"));
    assert!(refused * 100 <= cases * REFUSED, "{refused} of {cases} texts are refused: the generator is not honest");
}
