//! Replay: a stretch of a run once more, with everything that happened in it told line by line.
//!
//! A run is the same every time, so that nothing has to be kept for this: the scenario is run again from its start, and
//! what lies in the wanted cycles is written down. The lines are those of a bus analyser: when, how long, who to whom,
//! what in the field's words, the octets; between them what stations saw and did.

use std::fmt::Write as _;

use super::build;
use super::event_budget::{EventBudget, NoHeadway};
use super::flight::stretch::Stretch;
use super::flight::tape::Tape;
use super::flight::{Recorded, Recording};
use super::run::until;
use super::scenario::Scenario;
use super::trace::Trace;
use crate::device::node::Node;
use crate::observation::Observation;
use crate::sim::network::{Network, NetworkEvent};
use crate::sim::queue::Queue;
use crate::sim::record::{Recorder, Stamp, Transmission};
use crate::time::Time;
use crate::wire::Address;

/// The cycles that are told.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Window {
    /// The first.
    pub first: u64,
    /// The last.
    pub last: u64,
}

impl Window {
    /// `cycle` and `around` cycles before and after it.
    pub const fn around(cycle: u64, around: u64) -> Self {
        Self { first: cycle.saturating_sub(around), last: cycle.saturating_add(around) }
    }
}

/// Why there is nothing to tell.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ReplayError {
    /// The run is over before.
    #[error("cycle {wanted} is not in this run, whose last cycle is {last}")]
    NoSuchCycle {
        /// The cycle asked for.
        wanted: u64,
        /// The last one of the run.
        last: u64,
    },
    /// No cycle ever began.
    #[error("no cycle begins in this run")]
    NoCycle,
    /// The run makes no headway before.
    #[error(transparent)]
    NoHeadway(#[from] NoHeadway),
}

/// Runs `scenario` and tells the cycles of `window`, as far as the run has them.
///
/// # Errors
/// The run has not even the first of them, or makes no headway before their end.
pub fn replay<Q: Queue<NetworkEvent>>(scenario: &Scenario, window: Window) -> Result<String, ReplayError> {
    Ok(text(&record::<Q>(scenario, window)?))
}

/// Runs `scenario` and keeps the cycles of `window`, as far as the run has them: one stretch.
///
/// # Errors
/// As [`replay`].
pub fn record<Q: Queue<NetworkEvent>>(scenario: &Scenario, window: Window) -> Result<Recording, ReplayError> {
    let mut network: Network<Node, Q> = build::network(scenario);
    let recorded = Recorded::of(scenario);
    let mut watch = Watcher { window, master: scenario.master.address, tape: recorded.tape(0), last: None, kept: None };
    let mut headway = EventBudget::of(scenario).headway(&network, scenario);
    let end = until(scenario);
    while watch.kept.is_none() && !network.run(end, STRIDE, &mut watch) {
        headway.check(STRIDE, &mut network, &mut watch)?;
    }
    let last = watch.last;
    let stretch = watch.finish(network.now());
    match (stretch, last) {
        (Some(stretch), _) => Ok(Recording { network: recorded, stretches: vec![stretch], tallies: Vec::new() }),
        (None, Some(last)) => Err(ReplayError::NoSuchCycle { wanted: window.first, last }),
        (None, None) => Err(ReplayError::NoCycle),
    }
}

/// The stretch line by line.
pub fn text(recording: &Recording) -> String {
    let Recorded { scenario, seed, .. } = &recording.network;
    let mut text = String::new();
    for stretch in &recording.stretches {
        let (first, last) = stretch.numbers();
        // A String takes everything.
        let _ = writeln!(
            text,
            "{scenario}, seed {seed}, cycles {first} to {last}; instants from the start of each cycle (t0), at the sender"
        );
        Trace::new(stretch, &recording.network).tell(&mut text);
    }
    text
}

/// Events between two looks whether the window is over.
const STRIDE: u64 = 1_000;

/// Keeps what happens in the window.
struct Watcher {
    window: Window,
    /// The master whose cycles are counted.
    master: Address,
    tape: Tape,
    /// The latest cycle.
    last: Option<u64>,
    kept: Option<Stretch>,
}

impl Watcher {
    fn begin(&mut self, number: u64, t0: Time) {
        let begin = self.tape.begin(number, t0);
        self.last = Some(number);
        if number > self.window.last {
            self.kept = self.kept.take().or_else(|| self.tape.close(begin));
        } else if self.tape.open().is_some() {
            self.tape.go_on();
        } else if number >= self.window.first {
            self.tape.keep();
        }
    }
    /// The run is over at `end`, or enough of it has been seen.
    fn finish(self, end: Time) -> Option<Stretch> {
        self.kept.or_else(|| self.tape.finish(end))
    }
}

impl Recorder for Watcher {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        self.tape.telegram(telegram);
    }
    fn withdrawn(&mut self, sender: Address, now: Time) {
        self.tape.withdrawn(sender, now);
    }
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        if let Observation::CycleStart { cycle, .. } = *what
            && stamp.station == self.master
        {
            self.begin(cycle, stamp.at);
        }
        self.tape.observe(&stamp, what);
    }
}
