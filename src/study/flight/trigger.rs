//! Triggers: what makes the flight recorder keep the cycles around it.
//!
//! | name | fires when | source |
//! |---|---|---|
//! | `0F02` | a slave latches the fault of the master's sign of life | manual 5.3 |
//! | `0F04` | a slave latches the fault of the clock | manual 5.3 |
//! | `lost-slave` | a slave leaves data exchange against its master's will | |
//! | `t-dx` | the Data_Exchange part is longer than Set_Prm says (T_DX, octets 49 to 52 of the isochronous block) | Model: D2 |
//! | `synch` | a SYNCH leaves late or not at all, since the bus was in use | Model: D1 |

use std::fmt;

use crate::dp::master::Pace;
use crate::observation::Observation;
use crate::sim::record::Stamp;
use crate::study::plan::Plan;
use crate::study::scenario::Scenario;
use crate::time::{Span, Time};
use crate::wire::Address;

/// What makes the flight recorder keep the cycles around it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Trigger {
    /// A slave latches 0F02 (manual 5.3).
    Life,
    /// A slave latches 0F04 (manual 5.3).
    Clock,
    /// A slave leaves data exchange against its master's will.
    LostSlave,
    /// T_DX is longer than Set_Prm says.
    TDx,
    /// SYNCH late or missed.
    Synch,
}

impl Trigger {
    /// Every trigger, in order.
    pub const ALL: &'static [Self] = &[Self::Life, Self::Clock, Self::LostSlave, Self::TDx, Self::Synch];

    /// The name in scenario files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Life => "0F02",
            Self::Clock => "0F04",
            Self::LostSlave => "lost-slave",
            Self::TDx => "t-dx",
            Self::Synch => "synch",
        }
    }
}
impl fmt::Display for Trigger {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A trigger that fired.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Fired {
    /// Which.
    pub trigger: Trigger,
    /// True time.
    pub at: Time,
    /// In which cycle.
    pub cycle: u64,
    /// Who saw it.
    pub station: Address,
    /// What was seen.
    pub what: Observation,
}
impl fmt::Display for Fired {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: station {}, {}", self.trigger, self.station, self.what)
    }
}

/// Tells triggers from everything else that is observed.
#[derive(Clone, Debug)]
pub struct Watch {
    /// The master whose cycles are counted.
    master: Address,
    /// Longest T_DX that is no trigger.
    t_dx: Span,
    /// The triggers that count, a bit each.
    wanted: u8,
}

impl Watch {
    /// Watches a run of `scenario` for the triggers `wanted`.
    pub fn new(scenario: &Scenario, wanted: &[Trigger]) -> Self {
        // Without SYNCH nobody is told a T_DX.
        let told = scenario.master.pace == Pace::Synch;
        let t_dx = if told { Plan::of(scenario).t_dx_told() } else { Span::MAX };
        let wanted = wanted.iter().fold(0, |bits, &trigger| bits | 1 << trigger as u8);
        Self { master: scenario.master.address, t_dx, wanted }
    }

    /// The trigger that this is, if it is one that counts.
    #[inline]
    pub fn trigger(&self, stamp: &Stamp<'_>, what: &Observation) -> Option<Trigger> {
        let trigger = match *what {
            Observation::Fault { code: 0x0F02 } => Trigger::Life,
            Observation::Fault { code: 0x0F04 } => Trigger::Clock,
            Observation::Lost { .. } => Trigger::LostSlave,
            Observation::ExchangeDone { t_dx, .. } if t_dx > self.t_dx && stamp.station == self.master => Trigger::TDx,
            Observation::ClockLate { .. } | Observation::SynchMissed { .. } if stamp.station == self.master => {
                Trigger::Synch
            }
            _ => return None,
        };
        (self.wanted >> trigger as u8 & 1 == 1).then_some(trigger)
    }
}
