//! The first difference of two runs: which station, in which cycle, did or saw what, and what in the other run.
//!
//! Runs are deterministic: two that differ anywhere differ from some happening on, and this one is the cause, all others
//! are consequences or come from the same cause. It is found per station, in two strands: among all telegrams and
//! observations, where it is as early as can be, and among the events alone, where it says most to a reader.

mod happening;
mod race;
mod tape;

use std::fmt::{self, Write as _};

pub(in crate::study) use happening::is_synch;
pub use happening::{Happening, What};
pub use race::Race;
pub(in crate::study) use race::{End, Runner};

use crate::sim::network::NetworkEvent;
use crate::sim::queue::Queue;
use crate::study::scenario::Scenario;
use crate::time::{Span, Time};
use crate::wire::Address;

/// A happening of one station that is not the same in both runs.
#[derive(Clone, PartialEq, Debug)]
pub struct Difference {
    /// Whose.
    pub station: Address,
    /// In the run that the other one is compared with, what it does there or next; none if it does nothing any more.
    pub before: Option<Happening>,
    /// The same in the other run.
    pub now: Option<Happening>,
}

impl Difference {
    fn both(&self) -> impl Iterator<Item = &Happening> {
        self.before.iter().chain(&self.now)
    }
    /// When the runs part, in true time: the earlier of both instants.
    pub fn at(&self) -> Time {
        self.both().map(|happening| happening.at).min().unwrap_or(Time::MAX)
    }
    /// In which cycle the runs part; none before the first. A SYNCH in one of them counts for the cycle that it begins.
    pub fn cycle(&self) -> Option<u64> {
        let synch = self.both().find(|happening| happening.is_synch());
        let earlier = || self.both().min_by_key(|happening| happening.at);
        synch.or_else(earlier).and_then(|happening| happening.cycle)
    }
    /// Both values, as texts that differ.
    pub fn values(&self) -> [String; 2] {
        let nothing = || "nothing".to_owned();
        let text = |happening: &Option<Happening>| happening.as_ref().map_or_else(nothing, ToString::to_string);
        let [before, now] = [&self.before, &self.now].map(text);
        if before != now {
            return [before, now];
        }
        // A difference of less than a nanosecond.
        let exact = |happening: &Option<Happening>| {
            let exact = |Happening { at, what, .. }: &Happening| format!("{} ticks  {what}", at.ticks());
            happening.as_ref().map_or_else(nothing, exact)
        };
        [&self.before, &self.now].map(exact)
    }
    /// How much later it happens now, where both have something of the same kind.
    pub fn later(&self) -> Option<Span> {
        let (before, now) = self.before.as_ref().zip(self.now.as_ref())?;
        before.what.is_like(&now.what).then(|| now.at - before.at)
    }
}

impl Difference {
    /// Where it is, and both values under these names.
    pub fn told(&self, names: [&str; 2]) -> String {
        let mut text = match self.cycle() {
            Some(cycle) => format!("cycle {cycle}, station {}", self.station),
            None => format!("before cycle 0, station {}", self.station),
        };
        // Writing into a text cannot fail.
        let _ = match self.later() {
            Some(later) if later > Span::ZERO => write!(text, ", {later} later"),
            Some(later) if later < Span::ZERO => write!(text, ", {} earlier", -later),
            _ => Ok(()),
        };
        let width = names.map(str::len).into_iter().max().unwrap_or(0);
        for (name, value) in names.iter().zip(self.values()) {
            let _ = write!(text, "\n  {name:<width$}  {value}");
        }
        text
    }
}
impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.told(["before", "now"]))
    }
}

/// Stations that are named one by one; of more, those that differ first.
const STATIONS: usize = 12;

/// What two runs differ in.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Differences {
    /// For each station that differs the first happening that does, the earliest first.
    pub everything: Vec<Difference>,
    /// The same among the events alone.
    pub events: Vec<Difference>,
}

impl Differences {
    fn new(found: &[[Option<Difference>; 2]]) -> Self {
        let strand = |index: usize| {
            let mut all: Vec<_> = found.iter().filter_map(|found| found[index].clone()).collect();
            all.sort_by_key(|difference| (difference.at(), difference.station));
            all
        };
        Self { everything: strand(0), events: strand(1) }
    }
    /// Runs `before` and `now` from their starts and tells what they differ in.
    ///
    /// # Panics
    /// If a scenario breaks a rule that reading it checks.
    pub fn of<Q: Queue<NetworkEvent>>(before: &Scenario, now: &Scenario) -> Self {
        Race::<Q, _>::new(before, now, [(), ()]).run().0
    }
    /// The first difference of all.
    pub fn first(&self) -> Option<&Difference> {
        self.everything.first()
    }
    /// The first difference among the events.
    pub fn first_event(&self) -> Option<&Difference> {
        self.events.first()
    }
    /// What a reader wants to know, in lines: the first difference, the first event that differs, and since when each
    /// station does. `names` are those of the two runs.
    pub fn lines(&self, names: [&str; 2]) -> Vec<String> {
        let Some(first) = self.first() else {
            return vec!["no difference: every telegram and observation is the same".into()];
        };
        let mut lines = vec![format!("first difference: {}", first.told(names))];
        match self.first_event() {
            Some(event) if event.values() == first.values() && event.station == first.station => {}
            Some(event) => lines.push(format!("first event that differs: {}", event.told(names))),
            None => lines.push("no event differs".into()),
        }
        let since = |difference: &Difference| match difference.cycle() {
            Some(cycle) => format!("{} from cycle {cycle}", difference.station),
            None => format!("{} before cycle 0", difference.station),
        };
        let mut stations: Vec<_> = self.everything.iter().take(STATIONS).map(since).collect();
        if let Some(more @ 1..) = self.everything.len().checked_sub(STATIONS) {
            stations.push(format!("{more} more later"));
        }
        lines.push(format!("stations that differ: {}", stations.join(", ")));
        lines
    }
}
