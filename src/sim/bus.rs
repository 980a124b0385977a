//! The line: telegrams under way, who they reach and when, and what happens when two overlap.

use crate::time::{Span, Time};
use crate::wire::Frame;

/// Ticks [1/12 ns] that a telegram takes for one metre of cable: 5 ns.
const TICKS_PER_METRE: u64 = 60;

/// Delay along `mm` of cable: 5 ns/m, rounded down to a tick.
pub const fn cable_delay(mm: u64) -> Span {
    Span::from_ticks((mm * TICKS_PER_METRE / 1_000) as i64)
}

/// A place on the line [delay from its end].
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Place(Span);

impl Place {
    /// The place `mm` from the end of the cable.
    pub const fn at(mm: u64) -> Self {
        Self(cable_delay(mm))
    }
    /// Delay between two places.
    #[inline]
    pub fn delay(self, other: Self) -> Span {
        (self.0 - other.0).abs()
    }
}

/// A telegram on the line.
#[derive(Clone, Debug)]
pub struct Flight {
    /// First bit at the sender.
    pub start: Time,
    /// Last bit at the sender.
    pub end: Time,
    /// Index of the sending station.
    pub sender: usize,
    /// Number of the telegram, counted on the line.
    pub number: u64,
    place: Place,
    /// The characters.
    pub frame: Frame,
    /// Listeners that have not heard its end yet.
    listeners: u16,
}

/// Names a telegram until its last listener has heard it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FlightId(u16);

/// Telegrams kept for telling whether the line is busy somewhere: more are never near each other.
const RECENT: usize = 4;

/// The line.
#[derive(Clone, Debug, Default)]
pub struct Bus {
    flights: Vec<Flight>,
    free: Vec<FlightId>,
    /// Telegrams sent.
    sent: u64,
    /// The telegrams sent last, newest first.
    recent: [Option<(Time, Time, Place)>; RECENT],
    last: Option<FlightId>,
    /// End and sender of the telegram that ends last of all.
    busy_until: Time,
    busy_by: usize,
}

impl Bus {
    /// Puts a telegram on the line. Returns its name, and the station it overlaps with, if any.
    pub fn send(
        &mut self,
        sender: usize,
        place: Place,
        (start, end): (Time, Time),
        frame: &Frame,
    ) -> (FlightId, Option<usize>) {
        let id = self.free.pop().unwrap_or_else(|| {
            self.flights.push(Flight { start, end, sender, number: 0, place, frame: Frame::new(), listeners: 0 });
            FlightId(self.flights.len() as u16 - 1)
        });
        let flight = &mut self.flights[usize::from(id.0)];
        flight.frame.copy_from(frame);
        (flight.start, flight.end, flight.sender, flight.place, flight.listeners) = (start, end, sender, place, 0);
        flight.number = self.sent;
        self.sent += 1;
        self.recent.rotate_right(1);
        self.recent[0] = Some((start, end, place));

        let hit = (start < self.busy_until).then_some(self.busy_by);
        if hit.is_some() {
            self.garble(id);
            if let Some(last) = self.last.filter(|last| !self.free.contains(last)) {
                self.garble(last);
            }
        }
        if end > self.busy_until {
            (self.busy_until, self.busy_by) = (end, sender);
        }
        self.last = Some(id);
        (id, hit)
    }
    /// Overlapping characters fail their parity: the receiver sees a telegram that does not end as it should.
    fn garble(&mut self, id: FlightId) {
        if let Some(octet) = self.flights[usize::from(id.0)].frame.octets_mut().last_mut() {
            *octet ^= 0xFF;
        }
    }

    /// So many stations will hear the end of this telegram.
    pub fn add_listeners(&mut self, id: FlightId, count: u16) {
        self.flights[usize::from(id.0)].listeners += count;
    }
    /// The telegram, for a listener that hears its end now.
    pub fn flight(&self, id: FlightId) -> &Flight {
        &self.flights[usize::from(id.0)]
    }
    /// A listener has heard it; the last one frees its place.
    pub fn heard(&mut self, id: FlightId) {
        let flight = &mut self.flights[usize::from(id.0)];
        flight.listeners -= 1;
        if flight.listeners == 0 {
            self.free.push(id);
        }
    }
    /// Nobody listens to this telegram.
    pub fn unheard(&mut self, id: FlightId) {
        debug_assert_eq!(self.flights[usize::from(id.0)].listeners, 0);
        self.free.push(id);
    }
    /// Whether a receiver at `place` sees characters at `now`.
    pub fn is_busy(&self, now: Time, place: Place) -> bool {
        self.recent.iter().flatten().any(|&(start, end, sender)| {
            let delay = sender.delay(place);
            start + delay <= now && now < end + delay
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::Address;

    fn token() -> Frame {
        let mut frame = Frame::new();
        frame.set_token(Address::new(2).unwrap(), Address::new(2).unwrap());
        frame
    }
    fn ns(ns: i64) -> Time {
        Time::ZERO + Span::from_ns(ns)
    }

    #[test]
    fn five_nanoseconds_per_metre() {
        assert_eq!(Place::at(0).delay(Place::at(100_000)), Span::from_ns(500));
        assert_eq!(Place::at(70_000).delay(Place::at(20_000)), Span::from_ns(250));
    }

    #[test]
    fn telegrams_that_overlap_are_both_garbled_and_those_that_follow_are_not() {
        let mut bus = Bus::default();
        let (a, clean) = bus.send(0, Place::default(), (ns(0), ns(100)), &token());
        bus.add_listeners(a, 1);
        let (b, hit) = bus.send(1, Place::default(), (ns(99), ns(199)), &token());
        bus.add_listeners(b, 1);
        assert_eq!((clean, hit), (None, Some(0)));
        for id in [a, b] {
            assert!(bus.flight(id).frame.octets() != token().octets());
            bus.heard(id);
        }
        let (c, hit) = bus.send(0, Place::default(), (ns(199), ns(299)), &token());
        assert_eq!((hit, bus.flight(c).frame.octets()), (None, token().octets()));
    }

    #[test]
    fn a_receiver_sees_the_line_busy_one_delay_later() {
        let mut bus = Bus::default();
        bus.send(0, Place::at(0), (ns(100), ns(200)), &token());
        let far = Place::at(10_000);
        assert_eq!([149, 150, 249, 250].map(|t| bus.is_busy(ns(t), far)), [false, true, true, false]);
    }
}
