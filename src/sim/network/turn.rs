//! Disturbances of stations in a network: each begins and ends when its window says so.
//!
//! Turns at one instant come in the order of the stations, then of the scenario; turns of one cycle in the order of the
//! scenario, before the orders bound to that cycle. A burst that ends where the next one begins ends first.

use super::tune::Tuning;
use super::{Event, Network, NetworkEvent, Phase, Queue};
use crate::fdl::Station;
use crate::observation::{Disturbance, Observation};
use crate::sim::fault::order::OrderFault;
use crate::sim::fault::source::Source;
use crate::sim::fault::station::StationFault;
use crate::sim::fault::turn::{Turn, Turns};
use crate::sim::fault::{self, What};
use crate::sim::record::Recorder;
use crate::sim::topology::Place;
use crate::time::{Span, Time};
use crate::wire::Address;

/// A disturbance that begins and ends, in this network.
#[derive(Clone)]
pub(super) struct Turning<C> {
    /// Number of the disturbance in the scenario, from 0.
    pub number: u16,
    name: String,
    what: What,
    pub turns: Turns,
    /// It is no more among the disturbances: a burst that goes on ends, and no other begins.
    pub retired: bool,
    /// Whom it is told of: the stations that it means, or the first station.
    pub slots: Vec<usize>,
    pub effect: Effect<C>,
}

/// What a disturbance does when it turns.
#[derive(Clone)]
pub(super) enum Effect<C> {
    /// Nothing: its window is asked where it matters.
    None,
    /// The supply goes off and on.
    Supply,
    /// The link of this index has more jitter, by this half width.
    Link(usize, Span),
    /// A cable is cut at this place and whole again.
    Cut(Place),
    /// Crystals run at other rates.
    Crystals(Tuning),
    /// Something comes onto the line.
    Source(Box<Source>),
    /// Orders to masters.
    Orders { fault: OrderFault, begin: Vec<(usize, C)>, end: Vec<(usize, C)> },
}

impl<S: Station, Q: Queue<NetworkEvent>> Network<S, Q> {
    /// Takes in the disturbances that begin and end.
    pub(super) fn disturb(&mut self, all: Vec<fault::Turning>) {
        for disturbance in all {
            self.add_turning(disturbance);
        }
    }
    /// From now on these are the disturbances that begin and end. One that was there before goes on as it is, any other
    /// begins where its window is now.
    pub(super) fn turn_over(&mut self, all: Vec<fault::Turning>) {
        let known = |turning: &Turning<_>, new: &fault::Turning| {
            !turning.retired
                && (&turning.name, &turning.what) == (&new.name, &new.what)
                && turning.turns.window() == new.turns.window()
        };
        for index in 0..self.turning.len() {
            match all.iter().find(|new| known(&self.turning[index], new)) {
                Some(new) => self.turning[index].number = new.number,
                None => self.retire(index),
            }
        }
        for mut new in all {
            if self.turning.iter().any(|turning| known(turning, &new)) {
                continue;
            }
            new.turns = Turns::from(new.turns.window(), self.now, self.clocks);
            self.add_turning(new);
        }
    }
    fn add_turning(&mut self, new: fault::Turning) {
        let fault::Turning { number, name, turns, what, pulls, source } = new;
        let mut slots: Vec<_> = what.stations().iter().filter_map(|&station| self.slot_of(station)).collect();
        if slots.is_empty() {
            slots.push(Self::CLOCK);
        }
        let effect = match what {
            What::Station(_, StationFault::Restart) => Effect::Supply,
            What::Crystal(_, fault) => Effect::Crystals(Tuning { pulls, interval: fault.interval(), planned: false }),
            What::Order(_, fault) => Effect::Orders { fault, begin: Vec::new(), end: Vec::new() },
            What::Repeater(link, half_width) => Effect::Link(link, half_width),
            What::Cut(place) => Effect::Cut(place),
            What::Line(_) | What::Source(_) | What::Station(..) | What::Clock(..) | What::Instant(..) => {
                source.map_or(Effect::None, Effect::Source)
            }
        };
        self.turning.push(Turning { number, name, what, turns, retired: false, slots, effect });
        self.plan_turn(self.turning.len() - 1);
    }
    fn retire(&mut self, index: usize) {
        let Turning { turns, retired, slots, .. } = &mut self.turning[index];
        *retired = true;
        if turns.is_on() {
            let slot = slots[0];
            self.push(self.now, Phase::Command, slot, (Event::Turn, index as u32));
        }
    }
    fn slot_of(&self, station: Address) -> Option<usize> {
        self.by_address[usize::from(station.get())].map(usize::from)
    }
    /// What the disturbance of this number, from 0, orders when a burst begins and when one ends.
    pub fn order_bursts(&mut self, number: u16, begin: &[(Address, S::Command)], end: &[(Address, S::Command)]) {
        let find = |orders: &[(Address, S::Command)]| {
            let orders = orders.iter().filter_map(|&(station, order)| Some((self.slot_of(station)?, order)));
            orders.collect::<Vec<_>>()
        };
        let (begins, ends) = (find(begin), find(end));
        for turning in self.turning.iter_mut().filter(|turning| turning.number == number) {
            if let Effect::Orders { begin, end, .. } = &mut turning.effect {
                (*begin, *end) = (begins.clone(), ends.clone());
            }
        }
    }

    /// Sees to it that the disturbance turns next when it has to.
    pub(super) fn plan_turn(&mut self, index: usize) {
        let Turning { turns, slots, retired, .. } = &self.turning[index];
        if *retired {
            return;
        }
        let slot = slots[0];
        match turns.next() {
            None => {}
            Some(Turn::Cycle(cycle)) => self.next_turn = self.next_turn.min(cycle as u64),
            Some(Turn::Time(at)) => {
                let at = Time::from_ticks(at).max(self.now);
                self.push(at, Phase::Command, slot, (Event::Turn, index as u32));
            }
        }
    }
    /// Everything that turns when this cycle begins.
    #[cold]
    pub(super) fn turn_in_cycle<R: Recorder>(&mut self, cycle: u64, recorder: &mut R) {
        self.next_turn = u64::MAX;
        for index in 0..self.turning.len() {
            if self.turning[index].retired {
                continue;
            }
            let due = |turns: &Turns| matches!(turns.next(), Some(Turn::Cycle(at)) if at as u64 <= cycle);
            while due(&self.turning[index].turns) {
                self.turn(index, recorder);
            }
            if let Some(Turn::Cycle(at)) = self.turning[index].turns.next() {
                self.next_turn = self.next_turn.min(at as u64);
            }
        }
    }
    /// A burst begins or ends.
    #[cold]
    pub(super) fn turn<R: Recorder>(&mut self, index: usize, recorder: &mut R) {
        let Turning { turns, retired, .. } = &mut self.turning[index];
        if *retired && !turns.is_on() {
            return;
        }
        let on = turns.turn();
        let number = self.turning[index].number;
        let how = if on { Disturbance::Begins } else { Disturbance::Ends };
        for place in 0..self.turning[index].slots.len() {
            let slot = self.turning[index].slots[place];
            self.tell(slot, &Observation::Disturbed { number, how }, recorder);
            if let Effect::Supply = self.turning[index].effect {
                let outages = &mut self.slots[slot].supply.outages;
                *outages = if on { *outages + 1 } else { *outages - 1 };
                self.update_supply(slot, recorder);
            }
        }
        match self.turning[index].effect {
            Effect::Crystals(_) => self.turn_crystals(index, on),
            Effect::Orders { fault, .. } => self.order_burst((index, fault), on, recorder),
            Effect::Source(_) if on => self.start_source(index),
            Effect::Link(link, half_width) => {
                self.bus.disturb_link(&self.turning[index].name, (link, half_width), on);
            }
            Effect::Cut(place) => self.bus.cut((&self.turning[index].name, place), on, self.now),
            Effect::Source(_) | Effect::None | Effect::Supply => {}
        }
        self.plan_turn(index);
    }
    /// The orders of a beginning or an end. What an end takes back, another disturbance may still want.
    fn order_burst<R: Recorder>(&mut self, (index, fault): (usize, OrderFault), on: bool, recorder: &mut R) {
        self.give_orders(index, on, recorder);
        for other in 0..self.turning.len() {
            let Turning { turns, effect, .. } = &self.turning[other];
            let still = matches!(effect, Effect::Orders { fault: held, .. } if held.holds_with(&fault));
            if !on && other != index && still && turns.is_on() {
                self.give_orders(other, true, recorder);
            }
        }
    }
    fn give_orders<R: Recorder>(&mut self, index: usize, on: bool, recorder: &mut R) {
        for place in 0.. {
            let Effect::Orders { begin, end, .. } = &self.turning[index].effect else { return };
            let Some(&(slot, order)) = (if on { begin } else { end }).get(place) else { return };
            self.command(slot, order, recorder);
        }
    }
}
