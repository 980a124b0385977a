//! Flight recorder: the cycles around whatever went wrong, complete, in bounded memory.
//!
//! ```text
//!            before   trigger   after
//! cycles  ... [] [] [] [X] [] [] [] ...     one stretch: every telegram, every observation
//!                          [X]              a trigger inside a stretch makes it longer
//! ```
//!
//! The last cycles are always on a [`Tape`]; a [`Trigger`] opens a stretch that goes back by some cycles and ends some
//! cycles after. A trigger while one is open makes it longer, up to [`FlightRecorder::LENGTHS`] times its usual length.
//! No trigger opens more than half of all stretches, so that what happens in every cycle leaves room for what happens
//! once. When all stretches are used up, triggers are only counted.

pub mod stretch;
pub mod tape;
pub mod trigger;

use crate::observation::Observation;
use crate::sim::record::{Origin, Recorder, Stamp, Transmission};
use crate::study::invocation::Invocation;
use crate::study::scenario::{Flight, Scenario};
use crate::time::{BitRate, Time};
use crate::wire::Address;
use stretch::Stretch;
use tape::Tape;
use trigger::{Fired, Trigger, Watch};

/// The network that a recording is of.
#[derive(Clone, PartialEq, Debug)]
pub struct Recorded {
    /// Name of the scenario.
    pub scenario: String,
    /// How the scenario was asked for.
    pub invocation: Invocation,
    /// Seed of all random streams.
    pub seed: u64,
    /// Bit rate.
    pub rate: BitRate,
    /// The class 1 masters, first the one whose cycles are counted.
    pub masters: Vec<Address>,
    /// The class 2 masters.
    pub tools: Vec<Address>,
    /// The slaves in address order.
    pub slaves: Vec<Address>,
    /// Names of the disturbances by their numbers.
    pub disturbances: Vec<String>,
}

impl Recorded {
    /// The network of `scenario`.
    pub fn of(scenario: &Scenario) -> Self {
        let further = scenario.class1.iter().map(|class1| class1.address);
        Self {
            scenario: scenario.name.clone(),
            invocation: scenario.invocation.clone(),
            seed: scenario.run.seed,
            rate: scenario.bus.params.rate,
            masters: std::iter::once(scenario.master.address).chain(further).collect(),
            tools: scenario.class2.iter().map(|class2| class2.address).collect(),
            slaves: scenario.slaves.iter().map(|slave| slave.address).collect(),
            disturbances: scenario.disturbances.iter().map(|disturbance| disturbance.name.clone()).collect(),
        }
    }
    /// A tape for this network that goes back by `before` cycles.
    pub fn tape(&self, before: usize) -> Tape {
        let stations: Vec<_> = self.masters.iter().chain(&self.slaves).copied().collect();
        Tape::new(self.masters[0], &stations, before)
    }
    /// Which disturbance put a telegram onto the line; nothing for what its sender sent.
    pub fn culprit(&self, origin: Origin) -> Option<&str> {
        match origin {
            Origin::Sender => None,
            Origin::Disturbance(number) => Some(self.disturbances.get(usize::from(number)).map_or("?", String::as_str)),
        }
    }
}

/// How often a trigger fired.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Tally {
    /// Which.
    pub trigger: Trigger,
    /// How often.
    pub fired: u64,
    /// How often in no stretch that was kept.
    pub missed: u64,
}

/// What the flight recorder kept of a run.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The network.
    pub network: Recorded,
    /// The stretches in the order of time.
    pub stretches: Vec<Stretch>,
    /// Every trigger that was watched for.
    pub tallies: Vec<Tally>,
}

impl Recording {
    /// Cycles that were kept.
    pub fn cycles(&self) -> usize {
        self.stretches.iter().map(|stretch| stretch.cycles.len()).sum()
    }
    /// What happened how often, in one line.
    pub fn line(&self) -> String {
        if self.tallies.is_empty() {
            return format!("{} cycles that were asked for", self.cycles());
        }
        let fired = self.tallies.iter().filter(|tally| tally.fired > 0);
        let fired: Vec<_> = fired.map(|tally| format!("{} x {}", tally.fired, tally.trigger)).collect();
        let missed: u64 = self.tallies.iter().map(|tally| tally.missed).sum();
        if fired.is_empty() {
            return "nothing happened that it watches for".to_owned();
        }
        let noun = if self.stretches.len() == 1 { "stretch" } else { "stretches" };
        let more = if missed > 0 { format!("; {missed} of them are in no stretch") } else { String::new() };
        format!("{} {noun}, {} cycles, around {}{more}", self.stretches.len(), self.cycles(), fired.join(", "))
    }
}

/// Keeps the cycles around every trigger.
#[derive(Clone, Debug)]
pub struct FlightRecorder {
    network: Recorded,
    settings: Flight,
    watch: Watch,
    tape: Tape,
    stretches: Vec<Stretch>,
    tallies: Vec<Tally>,
    /// Stretches that each trigger opened, in the order of the tallies.
    opened: Vec<usize>,
    /// Cycles of the open stretch that are still to come.
    left: usize,
}

impl FlightRecorder {
    /// A stretch has at most so many times the length of one around a single trigger.
    pub const LENGTHS: usize = 4;

    /// A recorder of a run of `scenario`.
    pub fn new(scenario: &Scenario, settings: &Flight) -> Self {
        let network = Recorded::of(scenario);
        let tally = |&trigger| Tally { trigger, fired: 0, missed: 0 };
        Self {
            watch: Watch::new(scenario, &settings.triggers),
            tape: network.tape(settings.before),
            stretches: Vec::with_capacity(settings.captures),
            tallies: settings.triggers.iter().map(tally).collect(),
            opened: vec![0; settings.triggers.len()],
            left: 0,
            settings: settings.clone(),
            network,
        }
    }
    /// The run is over at `end`.
    pub fn finish(mut self, end: Time) -> Recording {
        self.stretches.extend(self.tape.finish(end));
        Recording { network: self.network, stretches: self.stretches, tallies: self.tallies }
    }

    /// Whether nothing more will be kept.
    fn is_full(&self) -> bool {
        self.stretches.len() >= self.settings.captures
    }
    /// Cycles that a stretch may have.
    const fn longest(&self) -> usize {
        Self::LENGTHS * (self.settings.before + 1 + self.settings.after)
    }

    fn begin(&mut self, number: u64, t0: Time) {
        let begin = self.tape.begin(number, t0);
        if self.tape.open().is_none() {
            return;
        }
        if self.left == 0 {
            self.stretches.extend(self.tape.close(begin));
        } else {
            self.left -= 1;
            self.tape.go_on();
        }
    }

    fn fire(&mut self, trigger: Trigger, stamp: &Stamp<'_>, what: &Observation) {
        let Some(index) = self.tallies.iter().position(|tally| tally.trigger == trigger) else { return };
        self.tallies[index].fired += 1;
        if self.tape.open().is_none() && !self.open(index) {
            self.tallies[index].missed += 1;
            return;
        }
        let length = self.tape.open().map_or(0, |stretch| stretch.cycles.len());
        self.left = self.settings.after.min(self.longest().saturating_sub(length)).max(self.left);
        let cycle = self.tape.cycle().map_or(0, |cycle| cycle.number);
        self.tape.note(Fired { trigger, at: stamp.at, cycle, station: stamp.station, what: *what });
    }
    /// Opens a stretch for the trigger of this number, if it may.
    fn open(&mut self, index: usize) -> bool {
        let share = self.settings.captures.div_ceil(2);
        if self.is_full() || self.opened[index] >= share || self.tape.cycle().is_none() {
            return false;
        }
        self.opened[index] += 1;
        self.tape.keep();
        true
    }
}

impl Recorder for FlightRecorder {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        if !self.is_full() {
            self.tape.telegram(telegram);
        }
    }
    fn withdrawn(&mut self, sender: Address, now: Time) {
        self.tape.withdrawn(sender, now);
    }
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        if !self.is_full() {
            if let Observation::CycleStart { cycle, .. } = *what
                && stamp.station == self.network.masters[0]
            {
                self.begin(cycle, stamp.at);
            }
            self.tape.observe(&stamp, what);
        }
        if let Some(trigger) = self.watch.trigger(&stamp, what) {
            self.fire(trigger, &stamp, what);
        }
    }
}
