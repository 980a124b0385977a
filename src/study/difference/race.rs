//! Race: two networks in lockstep, compared station by station.
//!
//! Both run to the same instant, then what they did is laid side by side: the first happening of a station in one run
//! belongs to its first in the other. Each waits until both runs have passed its instant: until then a telegram may be
//! withdrawn. What has no counterpart then is something that only one of them did.

use super::tape::{Strand, Tape};
use super::{Difference, Differences};
use crate::device::node::Node;
use crate::sim::network::{Network, NetworkEvent, Until};
use crate::sim::queue::Queue;
use crate::sim::record::Recorder;
use crate::study::build;
use crate::study::event_budget::{Headway, NoHeadway, PATIENCE};
use crate::study::run::until;
use crate::study::scenario::Scenario;
use crate::time::{Span, Time};
use crate::wire::Address;

/// Where a run ends: at whichever comes first.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(in crate::study) struct End {
    /// The cycle whose beginning ends it.
    pub(in crate::study) cycle: Option<u64>,
    /// The instant at which it ends.
    pub(in crate::study) at: Option<Time>,
}

impl End {
    /// Where a run of `scenario` ends.
    pub(in crate::study) const fn of(scenario: &Scenario) -> Self {
        match until(scenario) {
            Until::Time(at) => Self { cycle: None, at: Some(at) },
            Until::Cycle(cycle) => Self { cycle: Some(cycle), at: None },
        }
    }
    /// The same, or when `cycle` begins.
    pub(in crate::study) fn or_cycle(self, cycle: u64) -> Self {
        Self { cycle: Some(self.cycle.map_or(cycle, |own| own.min(cycle))), ..self }
    }
}

/// One network with all that is needed to go on with it.
pub(in crate::study) struct Runner<Q, R> {
    /// It.
    pub(in crate::study) network: Network<Node, Q>,
    /// The master whose cycles count.
    pub(in crate::study) master: Address,
    /// The cycle that it is in; none before the first.
    pub(in crate::study) cycle: Option<u64>,
    /// Where it ends.
    pub(in crate::study) end: End,
    /// Who sees to it that it makes headway, if anyone does.
    pub(in crate::study) guard: Option<Headway>,
    /// Who rides along.
    pub(in crate::study) rider: R,
}

/// A runner with the tape of its deeds.
struct Side<Q, R> {
    network: Network<Node, Q>,
    end: End,
    recorder: (Tape, R),
    /// Cycles begun, and the instant of this many.
    headway: (u64, Time),
    guard: Option<Headway>,
    /// Why it did not come to its end.
    failed: Option<NoHeadway>,
    over: bool,
}

impl<Q: Queue<NetworkEvent>, R: Recorder> Side<Q, R> {
    fn new(runner: Runner<Q, R>) -> Self {
        let Runner { network, master, cycle, end, guard, rider } = runner;
        let headway = (network.cycles(), network.now());
        let recorder = (Tape::new(master, cycle, end.cycle), rider);
        Self { network, end, recorder, headway, guard, failed: None, over: false }
    }
    /// Runs to `to`, or to the end if that is earlier. Tells how far it came.
    fn advance(&mut self, to: Time) -> Time {
        let to = self.end.at.map_or(to, |end| end.min(to));
        while !self.over {
            self.over = self.end.cycle.is_some_and(|last| self.network.cycles() > last);
            if self.over || self.network.run(Until::Time(to), 1, &mut self.recorder) {
                break;
            }
            if let Some(guard) = &mut self.guard {
                self.failed = guard.check(1, &mut self.network, &mut self.recorder).err();
                self.over = self.failed.is_some();
            }
        }
        if self.network.cycles() > self.headway.0 {
            self.headway = (self.network.cycles(), to);
        }
        // A run of so many cycles in which no cycle comes any more has no end.
        self.over |= self.end.at == Some(to) || self.end.at.is_none() && to - self.headway.1 > PATIENCE;
        // What else comes at the instant at which a run ends, it does not have.
        self.recorder.0.ended().map_or(to, |ended| ended - Span::from_ticks(1))
    }
}

/// Two networks side by side. `R` rides along on each.
pub struct Race<Q, R = ()> {
    sides: [Side<Q, R>; 2],
    /// How far both go between two looks.
    stride: Span,
    /// Until when both tapes are complete.
    passed: Time,
    /// For each station, what was found first in each strand.
    found: Vec<[Option<Difference>; 2]>,
}

impl<Q: Queue<NetworkEvent>, R: Recorder> Race<Q, R> {
    /// `before` and `now` from their starts, with their riders.
    ///
    /// # Panics
    /// If a scenario breaks a rule that reading it checks.
    pub fn new(before: &Scenario, now: &Scenario, [rider, other]: [R; 2]) -> Self {
        let runner = |scenario: &Scenario, rider| Runner {
            network: build::network(scenario),
            master: scenario.master.address,
            cycle: None,
            end: End::of(scenario),
            guard: None,
            rider,
        };
        Self::of([runner(before, rider), runner(now, other)], before.master.t_dp)
    }
    /// Networks that are under way at the same instant, compared every `stride`.
    pub(in crate::study) fn of(runners: [Runner<Q, R>; 2], stride: Span) -> Self {
        let sides = runners.map(Side::new);
        let found = vec![[None, None]; Tape::STATIONS];
        Self { sides, stride: stride.max(Span::from_us(100)), passed: Time::ZERO, found }
    }

    /// Both to `to`, as far as they go.
    pub(in crate::study) fn advance(&mut self, to: Time) {
        let [before, now] = &mut self.sides;
        self.passed = before.advance(to).min(now.advance(to));
        self.compare(self.passed);
    }
    /// From here on `cycle` is under way in both. Gives the second network, to be changed.
    pub(in crate::study) fn begin(&mut self, cycle: u64) -> &mut Network<Node, Q> {
        for side in &mut self.sides {
            side.recorder.0.begin(cycle);
        }
        &mut self.sides[1].network
    }
    /// Both to their ends. Gives what is different, and for each network its end and its rider.
    ///
    /// # Errors
    /// One of them is guarded and makes no headway.
    pub(in crate::study) fn run_guarded(mut self) -> Result<(Differences, [(Time, R); 2]), NoHeadway> {
        self.advance_to_the_ends();
        match self.sides.iter_mut().find_map(|side| side.failed.take()) {
            Some(failed) => Err(failed),
            None => Ok(self.finish()),
        }
    }
    /// The same of networks without a guard.
    pub fn run(mut self) -> (Differences, [(Time, R); 2]) {
        self.advance_to_the_ends();
        self.finish()
    }
    fn advance_to_the_ends(&mut self) {
        let mut to = self.sides[0].network.now().max(self.sides[1].network.now());
        while self.sides.iter().any(|side| !side.over) {
            to += self.stride;
            self.advance(to);
        }
    }
    fn finish(mut self) -> (Differences, [(Time, R); 2]) {
        // Nothing is withdrawn any more.
        self.compare(Time::MAX);
        let differences = Differences::new(&self.found);
        (differences, self.sides.map(|side| (side.network.now(), side.recorder.1)))
    }

    /// Lays side by side what both have done until `until`.
    fn compare(&mut self, until: Time) {
        let passed = self.passed;
        let [before, now] = &mut self.sides;
        let (before, now) = (&mut before.recorder.0, &mut now.recorder.0);
        for (station, found) in self.found.iter_mut().enumerate() {
            let Some(address) = Address::new(station as u8) else { continue };
            for strand in Strand::ALL {
                let found = &mut found[strand as usize];
                if found.is_none() {
                    *found = first([before, now], address, strand, (passed, until));
                }
                // A side that had nothing to show tells what it does next, if it does anything.
                if let Some(found) = found {
                    for (side, tape) in [(&mut found.before, &mut *before), (&mut found.now, &mut *now)] {
                        if side.is_none() {
                            *side = tape.pop(station, strand, until);
                        }
                        if side.is_some() {
                            tape.finish(station, strand);
                        }
                    }
                }
            }
        }
    }
}

/// The first difference of a station in what both tapes have until `until`, which are complete until `passed`.
fn first(
    [before, now]: [&mut Tape; 2],
    address: Address,
    strand: Strand,
    (passed, until): (Time, Time),
) -> Option<Difference> {
    let station = usize::from(address.get());
    loop {
        let different = match (before.first(station, strand, until), now.first(station, strand, until)) {
            (Some(one), Some(other)) if one.agrees_with(other) => false,
            (Some(_), Some(_)) => true,
            (Some(alone), None) | (None, Some(alone)) if alone.at <= passed => true,
            _ => return None,
        };
        let (before, now) = (before.pop(station, strand, until), now.pop(station, strand, until));
        if different {
            return Some(Difference { station: address, before, now });
        }
    }
}
