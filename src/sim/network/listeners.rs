//! Who hears a telegram, and when.
//!
//! | telegram | who hears it |
//! |---|---|
//! | any | who hears everything |
//! | request to all stations | everybody |
//! | reply to all stations | its subscribers |
//! | to one station | that one |
//!
//! Its sender does not hear it, unless it came onto the line at the sender's place by itself.

// See `network`.
#![allow(clippy::inline_always)]

use super::{Event, Network, NetworkEvent, Slot};
use crate::fdl::{Route, Station};
use crate::sim::bus::{Flight, FlightId, Wave};
use crate::sim::queue::{Key, Lane, Phase, Queue};
use crate::time::{Span, Time};
use crate::wire::Address;

/// A station as another one sees it whose telegrams reach it without jitter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbour {
    slot: u8,
    address: Address,
    delay: Span,
}

impl<S: Station, Q: Queue<NetworkEvent>> Network<S, Q> {
    /// Tells every listener when the telegram's end will reach it.
    #[inline(always)]
    pub(super) fn deliver(&mut self, wave: Wave, route: Option<Route>, apart: bool) {
        if let Some(route @ Route { da: Route::TO_ALL, .. }) = route {
            return self.deliver_to_all(wave, route, apart);
        }
        let mut listeners = 0;
        for rank in 0..self.attentive.len() {
            let listener = usize::from(self.attentive[rank]);
            if listener != wave.sender || apart {
                self.push_telegram(listener, wave, Lane::Soon);
                listeners += 1;
            }
        }
        let addressed = route.and_then(|route| self.addressed[usize::from(route.da)]).map(usize::from);
        if let Some(listener) = addressed.filter(|&slot| slot != wave.sender || apart) {
            self.push_telegram(listener, wave, Lane::Soon);
            listeners += 1;
        }
        if listeners != 1 {
            self.bus.expect_listeners(wave.id(), listeners);
        }
    }
    #[inline(never)]
    fn deliver_to_all(&mut self, wave: Wave, route: Route, apart: bool) {
        if !route.reply {
            return self.broadcast(wave, apart);
        }
        let mut listeners = 0;
        for rank in 0..self.attentive.len() + self.subscribers.len() {
            let listener = self.attentive.iter().chain(&self.subscribers).nth(rank);
            let Some(listener) = listener.map(|&slot| usize::from(slot)) else { break };
            if (listener != wave.sender || apart) && self.slots[listener].filter.passes(Some(route)) {
                self.push_telegram(listener, wave, Lane::Soon);
                listeners += 1;
            }
        }
        self.bus.expect_listeners(wave.id(), listeners);
    }
    /// A request for all passes every filter. Only the nearest neighbour is told now and tells the next one when it has
    /// heard, so that the queue holds one event of the telegram, not one for each station. Where links have jitter, who
    /// is nearest differs from telegram to telegram, and all are told now; so where receivers have.
    fn broadcast(&mut self, wave: Wave, apart: bool) {
        let count = self.neighbours[wave.sender].len();
        self.bus.expect_listeners(wave.id(), count as u16 + u16::from(apart));
        if apart {
            self.push_telegram(wave.sender, wave, Lane::Soon);
        }
        if self.bus.delays().is_steady() && !self.faults.strays_arrivals() {
            if let Some((key, slot)) = self.onward(wave.id(), 0) {
                let (number, event) = (wave.id().number(), Event::Broadcast);
                self.queue.push(Lane::Soon, key, NetworkEvent { number, event, slot, rank: 0 });
            }
            return;
        }
        for rank in 0..count {
            let listener = self.neighbours[wave.sender][rank].slot.into();
            self.push_telegram(listener, wave, Event::ARRIVALS);
        }
    }
    /// The neighbour of this rank, if there is one, and the key of the event that a telegram for all reaches it.
    #[inline(always)]
    pub(super) fn onward(&mut self, id: FlightId, rank: u8) -> Option<(Key, u8)> {
        let wave = self.bus.wave(id);
        let &Neighbour { slot, address, delay } = self.neighbours[wave.sender].get(usize::from(rank))?;
        let mut at = wave.end + delay;
        if self.faults.strays_arrivals() {
            at = self.captured(at, id, slot.into());
        }
        Some((Key::new(at, Phase::Telegram, address.get(), wave.number), slot))
    }
    /// The telegram's end reaches `listener`. Of telegrams that end there at one instant the one sent first comes first.
    #[inline(always)]
    fn push_telegram(&mut self, listener: usize, wave: Wave, lane: Lane) {
        let mut at = self.bus.arrival(wave, listener);
        if self.faults.strays_arrivals() {
            at = self.captured(at, wave.id(), listener);
        }
        let key = Key::new(at, Phase::Telegram, self.slots[listener].address.get(), wave.number);
        let (number, event) = (wave.id().number(), Event::Telegram);
        self.queue.push(lane, key, NetworkEvent { number, event, slot: listener as u8, rank: 0 });
    }
    /// When a receiver that strays captures the end of a telegram that reaches it `at`.
    #[cold]
    fn captured(&mut self, at: Time, id: FlightId, listener: usize) -> Time {
        let &Flight { start, end, .. } = self.bus.flight(id);
        let running = (start, self.clocks_begun(false));
        let captured = at + self.faults.capture_stray(self.slots[listener].address, running);
        // Nobody hears what has not been said.
        captured.max(end).max(self.now)
    }

    /// All but `sender`, by delay and then by address, as events are ordered.
    pub(super) fn neighbours_of(&self, sender: usize) -> Vec<Neighbour> {
        let others = self.slots.iter().enumerate().filter(|&(slot, _)| slot != sender);
        let mut all: Vec<_> = others
            .map(|(slot, &Slot { address, .. })| {
                let delay = self.bus.delays().nominal(sender, slot);
                Neighbour { slot: slot as u8, address, delay }
            })
            .collect();
        all.sort_by_key(|neighbour| (neighbour.delay, neighbour.address));
        all
    }
    /// Finds out who listens to more than what is for it, or from masters for everybody.
    pub(super) fn sort_listeners(&mut self) {
        let Self { slots, attentive, subscribers, addressed, .. } = self;
        for (slot, number) in slots.iter().zip(0..) {
            addressed[usize::from(slot.address.get())] = (!slot.filter.all).then_some(number);
        }
        let who = |hears: fn(&Slot<S>) -> bool| {
            let found = slots.iter().enumerate().filter(move |(_, slot)| hears(slot));
            found.map(|(index, _)| index as u8)
        };
        attentive.clear();
        attentive.extend(who(|slot| slot.filter.all));
        subscribers.clear();
        subscribers.extend(who(|slot| slot.filter.is_curious() && !slot.filter.all));
    }
}
