//! Crystals that change their rate while a network runs.
//!
//! Whatever a station waits for is armed in its own time, so that a new rate moves the true instant of every deadline. A
//! telegram that was handed to the transmitter leaves as planned; where the start of a cycle is planned already, the new
//! rate waits for it, at most one T_DP (Model: a SYNCH is not pulled while it waits, and the grid has no kink).

use super::turn::{Effect, Turning};
use super::{Event, Network, NetworkEvent, Phase, Queue};
use crate::fdl::{Outbox, Station};
use crate::sim::fault::clock::{Pull, within};
use crate::time::Span;

/// What a disturbance makes of the crystals of its stations.
#[derive(Clone)]
pub(super) struct Tuning {
    /// For each station, in the order of the disturbance's slots.
    pub pulls: Vec<Pull>,
    /// Time from one change to the next; none where only bursts change anything.
    pub interval: Option<Span>,
    /// Whether the next change is in the queue.
    pub planned: bool,
}

impl<S: Station, Q: Queue<NetworkEvent>> Network<S, Q> {
    /// A burst of a disturbance of crystals begins or ends.
    pub(super) fn turn_crystals(&mut self, index: usize, on: bool) {
        self.pull(index, |pull| pull.turn(on));
        self.plan_step(index);
    }
    /// An interval of a disturbance of crystals is over.
    #[cold]
    pub(super) fn step_crystals(&mut self, index: usize) {
        if let Effect::Crystals(tuning) = &mut self.turning[index].effect {
            tuning.planned = false;
        }
        self.pull(index, Pull::step);
        self.plan_step(index);
    }
    fn plan_step(&mut self, index: usize) {
        let Turning { slots, effect: Effect::Crystals(tuning), .. } = &mut self.turning[index] else { return };
        let Some(interval) = tuning.interval.filter(|_| !tuning.planned) else { return };
        if tuning.pulls.iter().all(Pull::rests) {
            return;
        }
        tuning.planned = true;
        let slot = slots[0];
        self.push(self.now + interval, Phase::Command, slot, (Event::Step, index as u32));
    }
    /// Changes what a disturbance makes of its crystals, and their rates with it.
    fn pull(&mut self, index: usize, change: impl Fn(&mut Pull)) {
        for place in 0..self.turning[index].slots.len() {
            let Turning { slots, effect: Effect::Crystals(tuning), .. } = &mut self.turning[index] else { return };
            let (slot, pull) = (slots[place], &mut tuning.pulls[place]);
            let before = pull.ppb();
            change(pull);
            let change = pull.ppb() - before;
            if change != 0 {
                self.slots[slot].offset.pulled += change;
                self.tune(slot);
            }
        }
    }
    /// Gives a station's crystal the rate that disturbances make of it, once no cycle start waits.
    #[cold]
    pub(super) fn tune(&mut self, index: usize) {
        let slot = &mut self.slots[index];
        slot.offset.waits = slot.cycle_at.is_some();
        if !slot.offset.waits {
            self.set_rate(index);
        }
    }
    /// Puts the rate of a station's crystal in force: what the station waits for comes when the crystal shows it.
    pub(super) fn set_rate(&mut self, index: usize) {
        let slot = &mut self.slots[index];
        slot.site
            .crystal
            .set_rate(self.now, within(slot.offset.own + slot.offset.pulled))
            .expect("a rate within bounds");
        self.alarms.retune(index, &slot.site.crystal, self.now);
        for which in 0..Outbox::DEADLINES {
            if let Some(reading) = self.slots[index].deadlines[which].armed() {
                self.slots[index].arm((index, which), reading, self.now, &mut self.queue);
            }
        }
    }
}
