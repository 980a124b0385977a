//! What goes wrong with stations: they fall silent, grow deaf or lose their supply.
//!
//! | fault | hears | sends | supply |
//! |---|---|---|---|
//! | Silent | nothing | nothing | stays |
//! | Mute | everything | nothing | stays |
//! | Deaf | nothing | as its machine wants | stays |
//! | Restart | nothing | nothing | off, on again at the end |
//!
//! The machine of a station that is silent, mute or deaf runs on and knows nothing of it: its watchdog runs out, its
//! slot times end without an answer, a master counts its cycles. Whether a telegram leaves is decided by its first
//! bit, whether it is heard by its last (Model: nobody reads half a telegram).

use crate::sim::fault::window::Window;
use crate::time::Time;
use crate::wire::Address;

/// What a disturbance does to stations.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum StationFault {
    /// It hears nothing and sends nothing.
    Silent,
    /// It hears, but what it sends never reaches the line.
    Mute,
    /// It sends, but hears nothing.
    Deaf,
    /// Its supply is off from the beginning to the end.
    Restart,
}

impl StationFault {
    const fn mutes(self) -> bool {
        matches!(self, Self::Silent | Self::Mute)
    }
    const fn deafens(self) -> bool {
        matches!(self, Self::Silent | Self::Deaf)
    }
}

/// Stations in a set, by address.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct Stations(u128);

impl Stations {
    pub(super) fn of(stations: &[Address]) -> Self {
        Self(stations.iter().fold(0, |set, station| set | 1 << station.get()))
    }
    pub(super) const fn has(self, station: Address) -> bool {
        self.0 >> station.get() & 1 == 1
    }
}

/// A disturbance at work that keeps stations from sending or hearing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Apart {
    stations: Stations,
    window: Window,
    fault: StationFault,
}

impl Apart {
    pub(super) fn new(stations: &[Address], window: Window, fault: StationFault) -> Self {
        Self { stations: Stations::of(stations), window, fault }
    }
    fn acts(&self, station: Address, (now, cycle): (Time, u64)) -> bool {
        self.stations.has(station) && self.window.contains(now, cycle)
    }
    /// Whether nothing that `station` sends now, in the cycle of this number, reaches the line.
    pub(super) fn mutes(&self, station: Address, running: (Time, u64)) -> bool {
        self.fault.mutes() && self.acts(station, running)
    }
    /// Whether `station` hears nothing now.
    pub(super) fn deafens(&self, station: Address, running: (Time, u64)) -> bool {
        self.fault.deafens() && self.acts(station, running)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::fault::window::Bursts;

    #[test]
    fn each_fault_takes_what_the_table_says_from_those_who_are_meant() {
        let window = Window::Cycles(Bursts::once(5, Some(2)));
        let [three, four] = [3, 4].map(|number| Address::new(number).unwrap());
        for (fault, mute, deaf) in [
            (StationFault::Silent, true, true),
            (StationFault::Mute, true, false),
            (StationFault::Deaf, false, true),
            (StationFault::Restart, false, false),
        ] {
            let apart = Apart::new(&[three], window, fault);
            for cycle in 0..10 {
                let inside = (5..7).contains(&cycle);
                let running = (Time::ZERO, cycle);
                assert_eq!(apart.mutes(three, running), mute && inside);
                assert_eq!(apart.deafens(three, running), deaf && inside);
                assert!(!apart.mutes(four, running) && !apart.deafens(four, running));
            }
        }
    }
}
