//! What goes wrong: disturbances, each with a name, a window of time and what it does.
//!
//! A disturbance changes octets and instants on the line, or orders something of a station's surroundings; it never
//! reaches into a machine. What it draws belongs to its name, so that one more leaves the others' draws as they are.

pub mod clock;
pub mod damage;
pub mod instant;
pub mod line;
pub mod manner;
pub mod order;
pub mod source;
pub mod station;
pub mod turn;
pub mod which;
pub mod window;

use crate::sim::fault::clock::{CrystalFault, Pull};
use crate::sim::fault::instant::{InstantFault, Straying};
use crate::sim::fault::line::{Line, LineFault};
use crate::sim::fault::order::OrderFault;
use crate::sim::fault::source::{Emission, Source, SourceFault};
use crate::sim::fault::station::{Apart, StationFault};
use crate::sim::fault::turn::Turns;
use crate::sim::fault::window::Window;
use crate::sim::jitter::{GcJitter, JitterSource};
use crate::sim::noise::{Purpose, Stream};
use crate::sim::topology::Place;
use crate::time::{Span, Time};
use crate::wire::Address;

/// One disturbance of a scenario.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Disturbance {
    /// What people call it; its draws hang on it.
    pub name: String,
    /// When it acts.
    pub window: Window,
    /// What it does.
    pub what: What,
}

/// What a disturbance does.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum What {
    /// It decides what becomes of telegrams.
    Line(LineFault),
    /// It puts something on the line.
    Source(SourceFault),
    /// It takes stations off the line, or their supply away.
    Station(Vec<Address>, StationFault),
    /// It changes the rate of crystals.
    Crystal(Vec<Address>, CrystalFault),
    /// It moves instants of these stations.
    Instant(Vec<Address>, InstantFault),
    /// It adds jitter of this half width to the link of this index.
    Repeater(usize, Span),
    /// It cuts the cable at this place.
    Cut(Place),
    /// It makes the SYNCH of the isochronous master stray; whether its strays add up, too (Model: D1).
    Clock(GcJitter, bool),
    /// It orders something of the masters of these slaves.
    Order(Vec<Address>, OrderFault),
}

impl What {
    /// Whether chance has a say: whether it draws anything in a run.
    pub fn draws(&self) -> bool {
        match self {
            Self::Line(fault) => fault.draws(),
            Self::Source(source) => matches!(source.what, Emission::Noise { .. }),
            Self::Crystal(_, fault) => matches!(fault, CrystalFault::Wander { .. }),
            Self::Instant(
                _,
                InstantFault::Receiver { half_width: width } | InstantFault::Answer { up_to: width, .. },
            )
            | Self::Repeater(_, width) => *width > Span::ZERO,
            Self::Clock(jitter, _) => jitter.draws(),
            Self::Station(..) | Self::Order(..) | Self::Cut(_) => false,
        }
    }
    /// The stations that it means, where it names them.
    pub fn stations(&self) -> &[Address] {
        match self {
            Self::Line(_) | Self::Clock(..) | Self::Repeater(..) | Self::Cut(_) => &[],
            Self::Source(source) => source.near.as_slice(),
            Self::Station(stations, _)
            | Self::Crystal(stations, _)
            | Self::Instant(stations, _)
            | Self::Order(stations, _) => stations,
        }
    }
}

/// A disturbance that begins and ends.
#[derive(Clone, Debug)]
pub(super) struct Turning {
    /// Number of the disturbance in the scenario, from 0.
    pub number: u16,
    pub name: String,
    pub turns: Turns,
    pub what: What,
    /// What it makes of each station's crystal, in the order of the stations.
    pub pulls: Vec<Pull>,
    /// What it puts on the line, if it does.
    pub source: Option<Box<Source>>,
}

/// All disturbances of a network at work.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    /// Those of the line.
    pub line: Line,
    apart: Vec<Apart>,
    /// Jitter of SYNCH, each with the number of its disturbance.
    clocks: Vec<(u16, JitterSource)>,
    receivers: Vec<Straying>,
    answers: Vec<Straying>,
    /// All of them, as the scenario has them.
    all: Vec<Disturbance>,
    turning: Vec<Turning>,
}

impl Faults {
    /// The disturbances of a run with `seed` among `stations`, in the order of the scenario.
    ///
    /// # Panics
    /// If a jitter cannot be: the caller checks scenarios.
    pub fn new(disturbances: &[Disturbance], seed: u64, stations: &[Address]) -> Self {
        let mut faults = Self { all: disturbances.to_vec(), ..Self::default() };
        for (number, Disturbance { name, window, what }) in disturbances.iter().enumerate() {
            let number = number as u16;
            match what {
                What::Line(fault) => faults.line.add((number, name, *window), *fault, (seed, stations)),
                What::Station(stations, fault) => faults.apart.push(Apart::new(stations, *window, *fault)),
                What::Clock(jitter, accumulates) => {
                    let stream = Stream::of_disturbance(seed, name, 0, Purpose::GcJitter);
                    let source = JitterSource::of_disturbance(jitter.clone(), *window, *accumulates, stream);
                    faults.clocks.push((number, source.expect("a checked jitter")));
                }
                What::Instant(stations, fault) => {
                    let straying = Straying::new((number, name, *window), stations, *fault, seed);
                    match fault {
                        InstantFault::Receiver { .. } => faults.receivers.push(straying),
                        InstantFault::Answer { .. } => faults.answers.push(straying),
                    }
                }
                What::Source(_) | What::Crystal(..) | What::Order(..) | What::Repeater(..) | What::Cut(_) => {}
            }
            if matches!(what, What::Line(_)) {
                continue;
            }
            let pull = |&station| match what {
                What::Crystal(_, fault) => Some(Pull::new(*fault, seed, name, station)),
                _ => None,
            };
            let pulls = what.stations().iter().filter_map(pull).collect();
            let source = match what {
                What::Source(fault) => Some(Box::new(Source::new(name, fault.clone(), seed))),
                _ => None,
            };
            faults.turning.push(Turning {
                number,
                name: name.clone(),
                turns: Turns::new(*window),
                what: what.clone(),
                pulls,
                source,
            });
        }
        faults
    }
    /// Takes over what `before` had drawn for disturbances that are in both.
    pub(super) fn go_on_from(&mut self, before: &Self) {
        let all = &self.all;
        let same = |number: u16| before.all.iter().position(|other| *other == all[usize::from(number)]);
        self.line.go_on_from(&before.line, same);
        for (number, source) in &mut self.clocks {
            let old = same(*number).and_then(|old| before.clocks.iter().find(|(other, _)| usize::from(*other) == old));
            if let Some((_, old)) = old {
                source.clone_from(old);
            }
        }
        let strayings = [(&mut self.receivers, &before.receivers), (&mut self.answers, &before.answers)];
        for (new, old) in strayings {
            for straying in new {
                let old = same(straying.number).and_then(|n| old.iter().find(|other| usize::from(other.number) == n));
                if let Some(old) = old {
                    straying.go_on_from(old);
                }
            }
        }
    }
    /// Whether there is no disturbance.
    #[inline]
    pub const fn is_empty(&self) -> bool {
        self.all.is_empty()
    }
    /// Whether ends of telegrams reach stations early or late.
    pub const fn strays_arrivals(&self) -> bool {
        !self.receivers.is_empty()
    }
    /// How much later than it comes `listener` captures a telegram's end. Signed.
    #[cold]
    pub fn capture_stray(&mut self, listener: Address, running: (Time, u64)) -> Span {
        self.receivers.iter_mut().fold(Span::ZERO, |sum, straying| sum + straying.draw(listener, running))
    }
    /// How much later than usual `sender` answers.
    #[inline]
    pub fn answer_delay(&mut self, sender: Address, running: (Time, u64)) -> Span {
        self.answers.iter_mut().fold(Span::ZERO, |sum, straying| sum + straying.draw(sender, running))
    }
    /// How much later than nominal disturbances make the SYNCH leave that should leave at `at` and begins the cycle of
    /// this number. Signed.
    #[inline]
    pub fn clock_strays(&mut self, at: Time, cycle: u64) -> Span {
        self.clocks.iter_mut().fold(Span::ZERO, |sum, (_, source)| sum + source.draw(at, cycle))
    }
    /// Hands over what begins and ends.
    pub(super) fn take_turning(&mut self) -> Vec<Turning> {
        std::mem::take(&mut self.turning)
    }
    /// Whether nothing that `station` sends now, in the cycle of this number, reaches the line.
    #[inline]
    pub fn mutes(&self, station: Address, running: (Time, u64)) -> bool {
        self.apart.iter().any(|apart| apart.mutes(station, running))
    }
    /// Whether `station` hears nothing now, in the cycle of this number.
    #[inline]
    pub fn deafens(&self, station: Address, running: (Time, u64)) -> bool {
        self.apart.iter().any(|apart| apart.deafens(station, running))
    }
}
