//! Stretch: some cycles of a run with everything that happened in them.

use super::trigger::Fired;
use crate::observation::{MasterMode, Observation, Phase, PllState, SlaveState};
use crate::sim::record::Origin;
use crate::time::Time;
use crate::wire::Address;

/// A cycle of a stretch.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Cycle {
    /// Its number, from 0.
    pub number: u64,
    /// First bit of its SYNCH, or t0 where none was sent: the cycle's first telegram belongs to it.
    pub begin: Time,
    /// Last bit of SYNCH at the master (Model: D1).
    pub t0: Time,
}

/// One thing that happened.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Entry {
    /// True time; of a telegram its first bit at the sender.
    pub at: Time,
    /// The sender, or who observed it.
    pub station: Address,
    /// What.
    pub what: What,
}

/// What happened.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum What {
    /// A telegram on the line.
    Telegram {
        /// Last bit at the sender.
        end: Time,
        /// Where its octets begin among those of all telegrams.
        from: u32,
        /// How many there are.
        len: u16,
        /// How it came onto the line.
        origin: Origin,
    },
    /// A station observed something.
    Seen(Observation),
}

/// What a station is in at an instant, as far as it changes rarely.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Standing {
    /// The station.
    pub station: Address,
    /// A master's operation mode.
    pub mode: MasterMode,
    /// A slave's DP state.
    pub state: SlaveState,
    /// Its start-up phase.
    pub phase: Phase,
    /// State of its clock recovery.
    pub pll: PllState,
    /// The fault that it shows, 0 without one (manual 5.3).
    pub fault: u16,
}

impl Standing {
    /// A station without supply.
    pub const fn new(station: Address) -> Self {
        Self {
            station,
            mode: MasterMode::Offline,
            state: SlaveState::PowerOn,
            phase: Phase::Configuration,
            pll: PllState::Idle,
            fault: 0,
        }
    }
    /// After `what` was observed by this station. A fault that is acknowledged is the one that is shown.
    pub fn observe(&mut self, what: &Observation) {
        match *what {
            Observation::MasterMode { to, .. } => self.mode = to,
            Observation::SlaveState { to, .. } => self.state = to,
            Observation::Phase { to, .. } => self.phase = to,
            Observation::Pll { to, .. } => self.pll = to,
            Observation::Fault { code } => self.fault = code,
            Observation::Acknowledged { .. } => self.fault = 0,
            Observation::Power { on: false } => *self = Self::new(self.station),
            _ => {}
        }
    }
}

/// Some cycles in a row, complete: every telegram whose first bit lies in them and every observation made in them.
#[derive(Clone, Debug, Default)]
pub struct Stretch {
    /// The cycles, at least one.
    pub cycles: Vec<Cycle>,
    /// Where it ends: the beginning of the cycle after the last, or the end of the run.
    pub end: Time,
    /// Why it was kept, in the order of time; nothing where it was asked for by number.
    pub triggers: Vec<Fired>,
    /// Every station at the beginning.
    pub standings: Vec<Standing>,
    /// What happened in the order of time; of one instant, in the order in which it was told.
    pub entries: Vec<Entry>,
    /// Entries that there was no room for.
    pub left_out: u64,
    pub(super) octets: Vec<u8>,
}

impl Stretch {
    /// First bit of the first cycle's SYNCH.
    pub fn begin(&self) -> Time {
        self.cycles.first().map_or(self.end, |cycle| cycle.begin)
    }
    /// Numbers of the first and the last cycle.
    pub fn numbers(&self) -> (u64, u64) {
        let number = |cycle: Option<&Cycle>| cycle.map_or(0, |cycle| cycle.number);
        (number(self.cycles.first()), number(self.cycles.last()))
    }
    /// The octets of an entry; nothing where it is no telegram.
    pub fn octets(&self, entry: &Entry) -> &[u8] {
        match entry.what {
            What::Telegram { from, len, .. } => &self.octets[from as usize..][..len.into()],
            What::Seen(_) => &[],
        }
    }
    /// Each cycle with what happened in it.
    pub fn by_cycle(&self) -> impl Iterator<Item = (Cycle, &[Entry])> {
        self.cycles.iter().enumerate().map(|(index, &cycle)| {
            let end = self.cycles.get(index + 1).map_or(self.end, |next| next.begin);
            let place = |at: Time| self.entries.partition_point(|entry| entry.at < at);
            // What happens at the very end of the run is still told.
            let last = if index + 1 == self.cycles.len() { self.entries.len() } else { place(end) };
            (cycle, &self.entries[place(cycle.begin)..last])
        })
    }
    /// The cycle to which an instant belongs; the first one for instants before.
    pub fn cycle_at(&self, at: Time) -> Option<Cycle> {
        let after = self.cycles.partition_point(|cycle| cycle.begin <= at);
        self.cycles.get(after.saturating_sub(1)).copied()
    }

    /// Puts everything in the order of time and drops what lies before the first cycle or, if another one follows, not
    /// before the end. What was told before the beginning has its part in the standings.
    pub(super) fn finish(&mut self, end: Time, goes_on: bool) {
        self.end = end;
        self.entries.sort_by_key(|entry| entry.at);
        let first = self.entries.partition_point(|entry| entry.at < self.begin());
        for entry in self.entries.drain(..first) {
            if let What::Seen(what) = entry.what
                && let Some(standing) = self.standings.iter_mut().find(|known| known.station == entry.station)
            {
                standing.observe(&what);
            }
        }
        if goes_on {
            self.entries.truncate(self.entries.partition_point(|entry| entry.at < end));
        }
        self.entries.shrink_to_fit();
    }
}
