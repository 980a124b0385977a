//! What can be changed in a network that runs: the world around its stations, never a station.
//!
//! A change takes effect between two events. What a station has decided already stays: a telegram that is on its way, or
//! that was given to the line for a later instant, keeps its instants.

use super::{Network, NetworkEvent};
use crate::fdl::Station;
use crate::sim::crystal::{Crystal, CrystalError};
use crate::sim::fault::Faults;
use crate::sim::jitter::{GcJitter, JitterError};
use crate::sim::motion::Shaft;
use crate::sim::queue::Queue;
use crate::wire::Address;

impl<S: Station, Q: Queue<NetworkEvent>> Network<S, Q> {
    /// The master's SYNCH strays as `jitter` says from now on; its stream goes on where it is.
    ///
    /// # Errors
    /// Those of [`GcJitter::check`]; nothing is changed then.
    pub fn change_jitter(&mut self, jitter: GcJitter) -> Result<(), JitterError> {
        self.jitter.change(jitter)
    }
    /// From now on these are the disturbances.
    pub fn set_faults(&mut self, mut faults: Faults) {
        let turning = faults.take_turning();
        faults.go_on_from(&self.faults);
        self.faults = faults;
        self.turn_over(turning);
    }
    /// The crystal of the station at `address` goes on `ppb` fast (10^-9), without a step in its reading. What the
    /// station waits for comes when the crystal shows it. An address without station is ignored.
    ///
    /// # Errors
    /// [`CrystalError::Offset`] for an offset that no crystal has; nothing is changed then.
    pub fn set_crystal(&mut self, address: Address, ppb: i64) -> Result<(), CrystalError> {
        let Some(slot) = self.by_address[usize::from(address.get())] else { return Ok(()) };
        let slot = usize::from(slot);
        if ppb.abs() > Crystal::MAX_PPB {
            return Err(CrystalError::Offset(ppb));
        }
        self.slots[slot].offset.own = ppb;
        self.set_rate(slot);
        Ok(())
    }
    /// The shaft of the station at `address` goes on from where it is as `shaft` moves. A station without shaft, or an
    /// address without station, is ignored.
    pub fn set_shaft(&mut self, address: Address, shaft: Shaft) {
        let Some(slot) = self.by_address[usize::from(address.get())] else { return };
        if let Some((before, _)) = &mut self.slots[usize::from(slot)].site.shaft {
            *before = shaft.through(self.now, before.angle(self.now));
        }
    }
    /// Forgets every order that has not come yet, but for the first supply of each station.
    pub fn cancel_orders(&mut self) {
        self.cycle_acts.truncate(self.next_cycle_act);
        // The first orders of a network are those supplies.
        self.cancelled = self.slots.len()..self.acts.len();
    }
}
