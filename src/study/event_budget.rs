//! The event budget: no run goes round in circles for ever.
//!
//! Bits take time, so a bus has only so many telegrams in a cycle, and a station does only so much about each. A run
//! that has more events than that makes no headway; it ends with an error and what was seen last. So does a run of so
//! many cycles in which no cycle comes any more.

use std::collections::VecDeque;
use std::fmt::{self, Write as _};

use super::run::{Progress, until};
use super::scenario::{Scenario, When, Window};
use crate::fdl::Station;
use crate::observation::Observation;
use crate::sim::network::{Network, NetworkEvent, Until};
use crate::sim::queue::Queue;
use crate::sim::record::{Recorder, Stamp, Transmission};
use crate::time::{Span, Time};
use crate::wire::words::Words;
use crate::wire::{Address, Telegram};

/// Events between two looks.
const STRIDE: u64 = 50_000;
/// Cycles over which events are counted against the budget.
const COUNTED: i64 = 64;
/// Events that are run once more to tell what was seen last.
const TAIL: u64 = 2_000;
/// Lines of that.
const LINES: usize = 12;
/// How long a run of so many cycles waits for the next one. Model: far beyond every start-up and recovery.
pub(super) const PATIENCE: Span = Span::from_s(60);

/// How much may happen in a run.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct EventBudget {
    /// Events per T_DP, at least 1.
    pub per_cycle: u64,
    /// T_DP.
    pub cycle: Span,
    /// After this instant nothing is ordered any more; a run of so many cycles then waits for each for a minute.
    pub ordered_until: Time,
}

/// A run that makes no headway. Reads as a sentence, with the last observations below it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct NoHeadway {
    why: String,
    cycle: Option<u64>,
    now: Time,
    last: Vec<String>,
}

impl std::error::Error for NoHeadway {}

impl fmt::Display for NoHeadway {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = format!("{:.9} s", self.now.since_zero().as_s());
        match self.cycle {
            Some(cycle) => write!(f, "{}, at {at} in cycle {cycle}", self.why)?,
            None => write!(f, "{}, at {at} before the first cycle", self.why)?,
        }
        if !self.last.is_empty() {
            write!(f, "; seen last:\n{}", self.last.join("\n"))?;
        }
        Ok(())
    }
}

impl EventBudget {
    /// The budget of a scenario: its own, or what the bits of a T_DP allow. Model: every character is a telegram of its
    /// own that each station hears and does something about, and each does a hundred things beside.
    pub fn of(scenario: &Scenario) -> Self {
        let cycle = scenario.master.t_dp.max(Span::from_us(100));
        let characters = cycle.div_floor(scenario.bus.params.rate.bit() * 11).max(0) as u64;
        let stations = scenario.stations().count() as u64;
        let usual = (stations + 1) * (characters * 2 + 100);
        Self { per_cycle: scenario.run.max_events.unwrap_or(usual), cycle, ordered_until: ordered_until(scenario) }
    }

    /// Runs `network` to the end of `scenario`; `watch` learns of the progress now and then.
    ///
    /// # Errors
    /// The run makes no headway.
    pub fn run<S: Station, Q: Queue<NetworkEvent>, R: Recorder>(
        &self,
        network: &mut Network<S, Q>,
        scenario: &Scenario,
        recorder: &mut R,
        mut watch: impl FnMut(Progress),
    ) -> Result<(), NoHeadway> {
        let always = |progress| {
            watch(progress);
            true
        };
        self.run_while(network, scenario, recorder, always).map(|_| ())
    }
    /// As [`run`](Self::run), as long as `go_on` says yes to the progress. Tells whether the end was reached.
    ///
    /// # Errors
    /// The run makes no headway.
    pub fn run_while<S: Station, Q: Queue<NetworkEvent>, R: Recorder>(
        &self,
        network: &mut Network<S, Q>,
        scenario: &Scenario,
        recorder: &mut R,
        mut go_on: impl FnMut(Progress) -> bool,
    ) -> Result<bool, NoHeadway> {
        let end = until(scenario);
        let mut headway = self.headway(network, scenario);
        while !network.run(end, STRIDE, recorder) {
            if !go_on(Progress { simulated: network.now().since_zero(), cycles: network.cycles() }) {
                return Ok(false);
            }
            headway.check(STRIDE, network, recorder)?;
        }
        go_on(Progress { simulated: network.now().since_zero(), cycles: network.cycles() });
        Ok(true)
    }

    /// The headway from now on of `network`, which is run as `scenario` says, for who does so step by step.
    pub fn headway<S: Station, Q: Queue<NetworkEvent>>(&self, network: &Network<S, Q>, scenario: &Scenario) -> Headway {
        let (end, now) = (until(scenario), network.now());
        Headway { budget: *self, end, unseen: 0, from: now, events: 0, last_cycle: (network.cycles(), now) }
    }
}

/// How far a run gets with how many events.
#[derive(Clone, Debug)]
pub struct Headway {
    budget: EventBudget,
    /// Where the run ends.
    end: Until,
    /// Events since the last look.
    unseen: u64,
    /// From when on events are counted, and how many there were.
    from: Time,
    events: u64,
    /// Cycles begun, and when that was seen.
    last_cycle: (u64, Time),
}

impl Headway {
    /// `network` has had so many more events. It is looked at now and then.
    ///
    /// # Errors
    /// It makes no headway.
    #[inline]
    pub fn check<S: Station, Q: Queue<NetworkEvent>, R: Recorder>(
        &mut self,
        events: u64,
        network: &mut Network<S, Q>,
        recorder: &mut R,
    ) -> Result<(), NoHeadway> {
        self.unseen += events;
        if self.unseen < STRIDE { Ok(()) } else { self.look(network, recorder) }
    }
    fn look<S: Station, Q: Queue<NetworkEvent>, R: Recorder>(
        &mut self,
        network: &mut Network<S, Q>,
        recorder: &mut R,
    ) -> Result<(), NoHeadway> {
        let EventBudget { per_cycle, cycle, ordered_until } = self.budget;
        let now = network.now();
        self.events += std::mem::take(&mut self.unseen);
        let cycles = (now - self.from).div_floor(cycle);
        if self.events > per_cycle.saturating_mul(cycles as u64 + 2) {
            let why = format!("more than {per_cycle} events per T_DP of {cycle}: the run makes no headway");
            return Err(self.stop(network, recorder, why));
        }
        if cycles >= COUNTED {
            (self.from, self.events) = (now, 0);
        }
        if network.cycles() > self.last_cycle.0 {
            self.last_cycle = (network.cycles(), now);
        }
        let waited = now - self.last_cycle.1.max(ordered_until);
        if matches!(self.end, Until::Cycle(_)) && waited > PATIENCE {
            let why = format!("no cycle has begun for {PATIENCE}, and the run is one of cycles");
            return Err(self.stop(network, recorder, why));
        }
        Ok(())
    }

    /// What is told of a run that makes no headway: it goes on for a moment to see what it does.
    fn stop<S: Station, Q: Queue<NetworkEvent>, R: Recorder>(
        &self,
        network: &mut Network<S, Q>,
        recorder: &mut R,
        why: String,
    ) -> NoHeadway {
        let (cycle, now) = (network.cycles().checked_sub(1), network.now());
        let mut tail = Tail::default();
        network.run(self.end, TAIL, &mut (recorder, &mut tail));
        NoHeadway { why, cycle, now, last: tail.0.into() }
    }
}

/// When the last order or disturbance of a scenario is over; those without end, and those in cycles, do not count.
fn ordered_until(scenario: &Scenario) -> Time {
    let powered = scenario.slaves.iter().map(|slave| slave.powered_at).chain([scenario.master.powered_at]);
    let events = scenario.events.iter().filter_map(|event| match event.when {
        When::Time(at) => Some(at),
        When::Cycle(_) => None,
    });
    let disturbances = scenario.disturbances.iter().filter_map(|disturbance| match disturbance.window {
        Window::Time(bursts) => bursts.last_end().map(Span::from_ticks),
        Window::Always | Window::Cycles(_) => None,
    });
    Time::ZERO + powered.chain(events).chain(disturbances).max().unwrap_or(Span::ZERO)
}

/// The last lines of what was seen.
#[derive(Debug, Default)]
struct Tail(VecDeque<String>);

impl Tail {
    fn line(&mut self, at: Time, station: Address, what: &dyn fmt::Display) {
        let mut line = format!("{:>16.9} s  {station:>3}  ", at.since_zero().as_s());
        // Writing into a text cannot fail.
        let _ = write!(line, "{what}");
        if self.0.len() == LINES {
            self.0.pop_front();
        }
        self.0.push_back(line);
    }
}

impl Recorder for Tail {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        match Telegram::parse(telegram.octets) {
            Ok(parsed) => self.line(telegram.start, telegram.sender, &Words::of(parsed)),
            Err(error) => self.line(telegram.start, telegram.sender, &error),
        }
    }
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        self.line(stamp.at, stamp.station, what);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::node::Node;
    use crate::sim::queue::NearQueue;
    use crate::study::build;

    const THREE: &str = "[run]\ncycles = 3000\n[bus]\nrate = \"12 Mbit/s\"\n[master]\naddress = 2\nt_dp = \"2 ms\"\n\
        t_i = \"125 us\"\nt_o = \"500 us\"\n[[slave]]\naddresses = \"4..6\"\ndevice = \"posital-ocd-dpb1b\"\n";

    fn run(text: &str) -> Result<u64, NoHeadway> {
        let scenario = Scenario::parse("three", "three.toml", text, &[]).unwrap_or_else(|error| panic!("{error}"));
        let mut network: Network<Node, NearQueue<NetworkEvent>> = build::network(&scenario);
        EventBudget::of(&scenario).run(&mut network, &scenario, &mut (), |_| ()).map(|()| network.cycles())
    }

    #[test]
    fn a_run_that_keeps_its_budget_comes_to_its_end() {
        assert_eq!(run(THREE), Ok(3_001));
    }

    #[test]
    fn a_run_beyond_its_budget_ends_and_tells_what_was_seen_last() {
        let error = run(&THREE.replace("[run]", "[run]\nmax_events = 9")).unwrap_err();
        let text = error.to_string();
        assert!(text.starts_with("more than 9 events per T_DP of 2 ms: the run makes no headway, at "), "{text}");
        assert_eq!(text.lines().count(), 1 + LINES, "{text}");
        assert!(text.contains("Data_Exchange"), "{text}");
    }

    #[test]
    fn a_run_of_cycles_ends_where_no_cycle_comes_any_more() {
        let off =
            THREE.to_owned() + "[[class1]]\naddress = 1\n[[event]]\nat = \"1 s\"\ndo = \"power-off\"\nstation = 2\n";
        let text = run(&off).unwrap_err().to_string();
        let begin = "no cycle has begun for 60 s, and the run is one of cycles, at 6";
        assert!(text.starts_with(begin), "{text}");
    }
}
