//! Parted: where two runs parted, as well as it can be known.

use crate::observation::Observation;
use crate::sim::network::{Network, NetworkEvent};
use crate::sim::queue::NearQueue;
use crate::sim::record::{Recorder, Stamp, Transmission};
use crate::study::baseline::{Parting, Traced, Trail};
use crate::study::build;
use crate::study::difference::{Differences, Happening};
use crate::study::event_budget::NoHeadway;
use crate::study::run::until;
use crate::study::scenario::Scenario;
use crate::wire::Address;

/// Happenings of today that are shown where those of before are not kept.
const SHOWN: usize = 6;
/// Stations that are named.
const STATIONS: usize = 12;

/// Where two runs parted.
#[derive(Clone, PartialEq, Debug)]
pub enum Parted {
    /// Both were run.
    Live(Differences),
    /// One of them is known by its trail.
    Traced {
        /// What the trails say.
        traced: Traced,
        /// What stations did today in the first stretch in which digests differ, where what they did before is not kept.
        today: Vec<(Address, Happening)>,
    },
}

impl Parted {
    /// Of two scenarios.
    pub fn live(before: &Scenario, now: &Scenario) -> Self {
        Self::Live(Differences::of::<NearQueue<NetworkEvent>>(before, now))
    }
    /// Of a trail and a scenario.
    ///
    /// # Errors
    /// The run makes no headway.
    pub fn traced(before: &Trail, now: &Scenario) -> Result<Self, NoHeadway> {
        let traced = before.compare(&Trail::of::<NearQueue<NetworkEvent>>(now)?);
        let unknown = if traced.known.first().is_none() { traced.first_stretch() } else { &[] };
        let today = if unknown.is_empty() { Vec::new() } else { today(now, unknown) };
        Ok(Self::Traced { traced, today })
    }
    /// What a reader wants to know, in lines.
    pub fn lines(&self) -> Vec<String> {
        const NAMES: [&str; 2] = ["before", "now"];
        let (traced, today) = match self {
            Self::Live(differences) => return differences.lines(NAMES),
            Self::Traced { traced, today } => (traced, today),
        };
        if traced.known.first().is_some() {
            return traced.known.lines(NAMES);
        }
        let Some(first) = traced.partings.first() else {
            return vec!["where the runs parted is not known: what the baseline keeps of it is the same".to_owned()];
        };
        let among: Vec<_> = traced.first_stretch().iter().map(|parting| parting.station.to_string()).collect();
        let mut lines = vec![match &among[..] {
            [one] => format!("first difference: {}, station {one}", stretch(first)),
            all => format!("first difference: {}, one of the stations {}", stretch(first), all.join(", ")),
        }];
        lines.push("  before  not kept so late in the run; the program of before tells it, isodp replay".to_owned());
        let told = |(station, happening): &(Address, Happening)| format!("  now     station {station}: {happening}");
        lines.extend(today.iter().map(told));
        match traced.known.first_event() {
            Some(event) => lines.push(format!("first event that differs: {}", event.told(NAMES))),
            None => lines.push("no event differs, as far as they are kept".to_owned()),
        }
        let station = |parting: &Parting| format!("{} {}", parting.station, stretch(parting));
        let stations: Vec<_> = traced.partings.iter().take(STATIONS).map(station).collect();
        lines.push(format!("stations that differ: {}", stations.join(", ")));
        lines
    }
}

/// The stretch of a parting in words.
fn stretch(parting: &Parting) -> String {
    match parting.from {
        None => "before cycle 0".to_owned(),
        Some(from) if from + 1 == parting.to => format!("in cycle {from}"),
        Some(from) => format!("in cycles {from} to {}", parting.to - 1),
    }
}

/// What the stations of `partings` do in their stretch, the first of it.
fn today(scenario: &Scenario, partings: &[Parting]) -> Vec<(Address, Happening)> {
    let mut network: Network<_, NearQueue<NetworkEvent>> = build::network(scenario);
    let mut excerpt = Excerpt { master: scenario.master.address, partings, cycle: None, kept: Vec::new() };
    // The stretch is one of a run that came to its end.
    while excerpt.kept.len() < SHOWN && !network.run(until(scenario), 10_000, &mut excerpt) {}
    excerpt.kept
}

/// Keeps what some stations do in one stretch.
struct Excerpt<'a> {
    master: Address,
    partings: &'a [Parting],
    cycle: Option<u64>,
    kept: Vec<(Address, Happening)>,
}

impl Excerpt<'_> {
    fn keep(&mut self, station: Address, happening: impl FnOnce(Option<u64>) -> Happening) {
        let wanted = |parting: &Parting| parting.station == station && parting.contains(self.cycle);
        if self.kept.len() < SHOWN && self.partings.iter().any(wanted) {
            self.kept.push((station, happening(self.cycle)));
        }
    }
}
impl Recorder for Excerpt<'_> {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        self.keep(telegram.sender, |cycle| Happening::of_telegram(cycle, telegram));
    }
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        if let &Observation::CycleStart { cycle, .. } = what
            && stamp.station == self.master
        {
            self.cycle = Some(cycle);
        }
        self.keep(stamp.station, |cycle| Happening::of_observation(cycle, &stamp, what));
    }
}
