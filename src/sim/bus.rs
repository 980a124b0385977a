//! The bus: telegrams under way, who they reach and when, and what happens when two overlap.
//!
//! A telegram reaches a listener after the delay of the path between the two. Where a link on the path has jitter, each
//! telegram draws once from that link's stream, however many listen: whoever is behind the link hears the same.

// See `network`.
#![allow(clippy::inline_always)]

use crate::fdl::Route;
use crate::sim::cut::Cuts;
use crate::sim::noise::LinkJitter;
use crate::sim::record::Origin;
use crate::sim::topology::{Delays, Place};
use crate::time::{Span, Time};
use crate::wire::Frame;

/// What is to be known of a telegram on the line beside its characters.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Mark {
    /// How it came onto the line.
    pub origin: Origin,
    /// A character of it is broken, so that every receiver drops it and only knows that something was on the line.
    pub broken: bool,
    /// The station at whose place it begins has not sent it, and hears it as all others do.
    pub apart: bool,
}

impl Mark {
    /// A good telegram of its sender.
    pub const OWN: Self = Self { origin: Origin::Sender, broken: false, apart: false };
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
    /// How much later than nominal it comes out of each link with jitter.
    strays: Vec<Span>,
    /// The characters.
    pub frame: Frame,
    /// What is to be known of it.
    pub mark: Mark,
    /// Listeners that have not heard its end yet.
    listeners: u16,
}

impl Flight {
    /// The place of a telegram; none has been here.
    const fn blank(place: usize) -> Self {
        Self {
            start: Time::ZERO,
            end: Time::ZERO,
            sender: 0,
            number: place as u64,
            strays: Vec::new(),
            frame: Frame::new(),
            mark: Mark::OWN,
            listeners: 0,
        }
    }
    /// Whether it is on the line at some time: it was not cut off before it began.
    fn is_real(&self) -> bool {
        !self.frame.is_empty()
    }
}

/// Names a telegram until its last listener has heard it: its number, as far as it tells it from all others on the line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FlightId(u32);

impl FlightId {
    /// The name of this number.
    #[inline]
    pub const fn of(number: u32) -> Self {
        Self(number)
    }
    /// Its number.
    #[inline]
    pub const fn number(self) -> u32 {
        self.0
    }
}

/// What decides when a telegram reaches its listeners.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Wave {
    /// Index of the sending station.
    pub sender: usize,
    /// Last bit at the sender.
    pub end: Time,
    /// Number of the telegram, counted on the line.
    pub number: u64,
}

impl Wave {
    /// The telegram.
    #[inline]
    pub const fn id(self) -> FlightId {
        FlightId(self.number as u32)
    }
}

/// Telegrams kept for telling whether the line is busy somewhere: more are never near each other. A power of two.
const RECENT: usize = 16;

/// The bus.
#[derive(Clone, Debug)]
pub struct Bus {
    delays: Delays,
    /// Of the links that have any, in the order of `delays`.
    jitter: Vec<LinkJitter>,
    /// The telegrams sent last, each at the place of its number among as many as there are, a power of two.
    flights: Vec<Flight>,
    /// Telegrams sent.
    sent: u64,
    cuts: Cuts,
    /// From here on nothing is on the line, and a telegram may begin.
    clear_from: Time,
    /// T_SYN.
    t_syn: Span,
}

impl Bus {
    /// A silent bus. `jitter` is that of the links whose paths `delays` knows as unsteady, in the same order.
    pub fn new(delays: Delays, jitter: Vec<LinkJitter>) -> Self {
        Self {
            delays,
            jitter,
            flights: (0..RECENT).map(Flight::blank).collect(),
            sent: 0,
            cuts: Cuts::none(),
            clear_from: Time::ZERO,
            t_syn: Span::ZERO,
        }
    }
    /// The same whose cables may be cut. Where the line can be in parts, each part needs room for a long telegram beside the
    /// short ones of the others: 255 characters last as long as 50 tokens with their pauses.
    #[must_use]
    pub fn with_cuts(self, cuts: Cuts) -> Self {
        let kept = if cuts.is_empty() { RECENT } else { RECENT * 4 };
        Self { flights: (0..kept).map(Flight::blank).collect(), cuts, ..self }
    }
    /// The disturbance called `name` cuts the cable at this place from now on, or it is whole again.
    pub fn cut(&mut self, (name, place): (&str, Place), open: bool, now: Time) {
        let before = self.cuts.open();
        self.cuts.set((name, place), open, now);
        if open {
            return;
        }
        // What is on the line in both parts meets.
        let Self { flights, cuts, .. } = self;
        for place in 0..flights.len() {
            let flight = &flights[place];
            let meets = |other: &Flight| {
                let (a, b) = (flight.sender, other.sender);
                let both = (flight.start.max(other.start).max(now), flight.end.min(other.end));
                cuts.part_by(before, a, b) && !cuts.part(a, b) && both.0 < both.1
            };
            let waits = flight.listeners > 0 && flight.is_real();
            if waits && flights.iter().any(|other| other.is_real() && meets(other)) {
                flights[place].mark.broken = true;
            }
        }
    }
    /// Whether a telegram that ends at `listener` now has come there whole.
    #[inline]
    pub fn reaches(&self, id: FlightId, listener: usize) -> bool {
        self.cuts.is_empty() || {
            let flight = self.flight(id);
            !self.cuts.tear(flight.sender, listener, flight.start)
        }
    }
    /// What the disturbance called `name` adds, this half width to the jitter of the link of this index, counts from now on,
    /// or no more.
    pub fn disturb_link(&mut self, name: &str, what: (usize, Span), on: bool) {
        self.jitter.iter_mut().for_each(|jitter| jitter.disturb(name, what, on));
    }
    /// The delays between the stations.
    pub const fn delays(&self) -> &Delays {
        &self.delays
    }

    /// The same bus with this T_SYN: so long the line has to be idle before a request or a token, or receivers miss it. Stations
    /// see to it, what comes from nowhere does not.
    #[must_use]
    pub const fn with_t_syn(mut self, t_syn: Span) -> Self {
        self.t_syn = t_syn;
        self
    }

    /// Puts a telegram of `sender`, or at its place, on the line. Returns how it spreads, and the station it overlaps with, if
    /// any.
    #[inline(always)]
    pub fn send(&mut self, sender: usize, (start, end): (Time, Time), frame: &Frame, mark: Mark) -> (Wave, Option<u8>) {
        let wave = Wave { sender, end, number: self.sent };
        let mut flight = self.flight_mut(wave.id());
        if flight.listeners > 0 {
            self.make_room();
            flight = self.flight_mut(wave.id());
        }
        flight.frame.copy_from(frame);
        (flight.start, flight.end, flight.sender) = (start, end, sender);
        (flight.mark, flight.number, flight.listeners) = (mark, wave.number, 1);
        let hit = if start < self.clear_from { self.collide(wave.id()) } else { None };
        if !self.jitter.is_empty() {
            self.stray(wave.id());
        }
        self.sent = wave.number + 1;
        self.clear_from = self.clear_from.max(if mark.apart { end + self.t_syn } else { end });
        (wave, hit)
    }
    /// Draws what the links with jitter make of the telegram that is sent.
    #[cold]
    fn stray(&mut self, id: FlightId) {
        let mut strays = core::mem::take(&mut self.flight_mut(id).strays);
        strays.clear();
        strays.extend(self.jitter.iter_mut().map(LinkJitter::draw));
        self.flight_mut(id).strays = strays;
    }
    /// So many telegrams have followed one that somebody has not heard yet: twice as many are kept from now on.
    #[cold]
    fn make_room(&mut self) {
        let kept = self.flights.len() * 2;
        let before = core::mem::replace(&mut self.flights, (0..kept).map(Flight::blank).collect());
        for flight in before {
            let place = flight.number as usize & (kept - 1);
            self.flights[place] = flight;
        }
    }
    /// Overlapping characters fail their parity, and so receivers drop all telegrams that overlap with this one. What is
    /// apart spoils the idle time before a request too. Returns the sender of one that overlaps, the one that ends last.
    #[cold]
    fn collide(&mut self, id: FlightId) -> Option<u8> {
        let &Flight { start, end, sender, number, mark, ref frame, .. } = self.flight(id);
        let needs_idle = begins_with_idle(frame.octets());
        let Self { flights, cuts, t_syn, .. } = self;
        let t_syn = *t_syn;
        let overlaps =
            |(from, to): (Time, Time), other: usize| from < to && start < to && from < end && !cuts.part(sender, other);
        // What listeners wait for, however long ago it was sent.
        for other in flights.iter_mut().filter(|other| other.listeners > 0 && other.number != number && other.is_real())
        {
            let spoilt = mark.apart && begins_with_idle(other.frame.octets());
            let end = if spoilt { end + t_syn } else { end };
            other.mark.broken |= start < other.end && other.start < end && !cuts.part(sender, other.sender);
        }
        let others = || flights.iter().filter(|other| other.number != number && other.is_real());
        let hit = others().filter(|sent| overlaps((sent.start, sent.end), sent.sender));
        let hit = hit.max_by_key(|sent| (sent.end, sent.number)).map(|sent| sent.sender);
        let spoils = |sent: &Flight| {
            let too_soon = start >= sent.end && start < sent.end + t_syn;
            sent.mark.apart && needs_idle && too_soon && !cuts.part(sender, sent.sender)
        };
        let broken = hit.is_some() || others().any(spoils);
        self.flight_mut(id).mark.broken |= broken;
        hit.map(|sender| sender as u8)
    }
    /// The station `sender` lost its supply at `now`: what it would have sent later never reaches the line. What is
    /// under way is finished (Model: a telegram that breaks off would be dropped all the same).
    pub fn silence(&mut self, sender: usize, now: Time) {
        for flight in self.flights.iter_mut().filter(|flight| flight.sender == sender && flight.start > now) {
            flight.frame.clear();
        }
    }

    /// So many stations, not one, will hear the end of this telegram, which was just sent.
    pub fn expect_listeners(&mut self, id: FlightId, count: u16) {
        self.flight_mut(id).listeners = count;
    }
    /// The telegram, for a listener that hears its end now.
    #[inline]
    pub fn flight(&self, id: FlightId) -> &Flight {
        &self.flights[id.0 as usize & (self.flights.len() - 1)]
    }
    #[inline]
    fn flight_mut(&mut self, id: FlightId) -> &mut Flight {
        let place = id.0 as usize & (self.flights.len() - 1);
        &mut self.flights[place]
    }
    /// The same, and that listener has heard it.
    #[inline]
    pub fn heard(&mut self, id: FlightId) -> &Flight {
        let flight = self.flight_mut(id);
        flight.listeners -= 1;
        flight
    }
    /// How a telegram spreads.
    #[inline]
    pub fn wave(&self, id: FlightId) -> Wave {
        let &Flight { end, sender, number, .. } = self.flight(id);
        Wave { sender, end, number }
    }
    /// When a telegram's last bit reaches the station `listener`.
    #[inline]
    pub fn arrival(&self, wave: Wave, listener: usize) -> Time {
        if !self.delays.is_steady() {
            return self.strayed_arrival(wave.id(), listener);
        }
        wave.end + self.delays.nominal(wave.sender, listener)
    }
    /// The same with the jitter of links, out of the way of networks that have none.
    #[cold]
    fn strayed_arrival(&self, id: FlightId, listener: usize) -> Time {
        let &Flight { end, sender, ref strays, .. } = self.flight(id);
        end + self.delays.of(sender, listener, strays)
    }
    /// Whether the station `listener` sees characters at `now`.
    pub fn is_busy(&self, now: Time, listener: usize) -> bool {
        self.flights.iter().filter(|sent| sent.is_real() && !self.cuts.part(sent.sender, listener)).any(|sent| {
            let delay = self.delays.of(sent.sender, listener, &sent.strays);
            sent.start + delay <= now && now < sent.end + delay
        })
    }
}

/// Whether receivers take this telegram only after an idle line: what the holder of the token sends (EN 50170-2, T_SYN).
fn begins_with_idle(octets: &[u8]) -> bool {
    /// SD4.
    const TOKEN: u8 = 0xDC;
    octets.first() == Some(&TOKEN) || Route::of(octets).is_some_and(|route| !route.reply)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::topology::{CABLE_DELAY, Link, Place, Tree, cable_delay};
    use crate::wire::Address;

    fn token() -> Frame {
        let mut frame = Frame::new();
        frame.set_token(Address::new(2).unwrap(), Address::new(2).unwrap());
        frame
    }
    fn ns(ns: i64) -> Time {
        Time::ZERO + Span::from_ns(ns)
    }

    /// Two stations at the ends of 10 m of cable.
    fn line() -> Bus {
        let places = [0, 10_000].map(|mm| Place::new(0, cable_delay(mm, CABLE_DELAY)));
        Bus::new(Delays::new(&Tree::line(), &places, &[]), Vec::new())
    }

    #[test]
    fn telegrams_that_overlap_are_both_garbled_and_those_that_follow_are_not() {
        let mut bus = line();
        let (a, clean) = bus.send(0, (ns(0), ns(100)), &token(), Mark::OWN);
        let a = a.id();
        bus.expect_listeners(a, 1);
        let (b, hit) = bus.send(1, (ns(99), ns(199)), &token(), Mark::OWN);
        let b = b.id();
        bus.expect_listeners(b, 1);
        assert_eq!((clean, hit), (None, Some(0)));
        for id in [a, b] {
            assert!(bus.flight(id).mark.broken);
            bus.heard(id);
        }
        let (c, hit) = bus.send(0, (ns(199), ns(299)), &token(), Mark::OWN);
        let c = c.id();
        assert_eq!((hit, bus.flight(c).mark.broken), (None, false));
    }

    #[test]
    fn a_telegram_that_is_hit_twice_is_as_broken_and_one_that_fits_before_another_is_not_hit() {
        let mut bus = line();
        let mut put = |sender, from, to| {
            let (wave, hit) = bus.send(sender, (ns(from), ns(to)), &token(), Mark::OWN);
            let id = wave.id();
            bus.expect_listeners(id, 1);
            (id, hit)
        };
        let sent = [put(0, 0, 100), put(1, 50, 150), put(0, 120, 220), put(1, 1_000, 1_100), put(0, 500, 1_000)];
        assert_eq!(sent.map(|(_, hit)| hit), [None, Some(0), Some(1), None, None]);
        let long = put(0, 900, 2_000);
        assert_eq!(long.1, Some(1));
        let all = sent.map(|(id, _)| bus.flight(id).mark.broken);
        assert_eq!(all, [true, true, true, true, true], "the last two by the long one");
    }

    #[test]
    fn what_comes_from_nowhere_spoils_the_idle_time_before_a_request() {
        let mut bus = line().with_t_syn(ns(100) - ns(0));
        let noise = Mark { origin: Origin::Disturbance(0), broken: true, apart: true };
        let mut answer = Frame::new();
        answer.set_short_ack();
        let mut put = |from, to, frame: &Frame, mark| {
            let (wave, hit) = bus.send(0, (ns(from), ns(to)), frame, mark);
            let id = wave.id();
            bus.expect_listeners(id, 1);
            assert_eq!(hit, None);
            id
        };
        let mut at = |begin, frame: &Frame| {
            // The telegram may have been planned before the noise, or may come afterwards.
            let planned = put(begin + 50, begin + 60, frame, Mark::OWN);
            put(begin, begin + 10, &token(), noise);
            (planned, put(begin + 109, begin + 119, frame, Mark::OWN), put(begin + 219, begin + 229, frame, Mark::OWN))
        };
        let (tokens, answers) = (at(0, &token()), at(1_000, &answer));
        let broken = |(a, b, c): (FlightId, FlightId, FlightId)| [a, b, c].map(|id| bus.flight(id).mark.broken);
        assert_eq!((broken(tokens), broken(answers)), ([true, true, false], [false; 3]));
    }

    #[test]
    fn what_a_station_without_supply_had_planned_never_comes() {
        let mut bus = line();
        let (running, _) = bus.send(0, (ns(0), ns(100)), &token(), Mark::OWN);
        let running = running.id();
        bus.expect_listeners(running, 1);
        bus.silence(0, ns(50));
        assert_eq!(bus.flight(running).frame.octets(), token().octets(), "under way, it is finished");
        bus.heard(running);
        let (planned, _) = bus.send(0, (ns(500), ns(600)), &token(), Mark::OWN);
        let planned = planned.id();
        bus.expect_listeners(planned, 1);
        bus.silence(1, ns(300));
        assert!(!bus.flight(planned).frame.is_empty(), "another station's supply");
        bus.silence(0, ns(300));
        assert!(bus.flight(planned).frame.is_empty());
        assert!(!bus.is_busy(ns(550), 0), "the line stays free");
        let (_, hit) = bus.send(1, (ns(550), ns(650)), &token(), Mark::OWN);
        assert_eq!(hit, None);
    }

    #[test]
    fn a_long_telegram_meets_each_of_many_short_ones_and_is_kept_until_it_is_heard() {
        let mut bus = line();
        let (long, _) = bus.send(0, (ns(0), ns(100_000)), &token(), Mark::OWN);
        for n in 0..3 * RECENT as i64 {
            let (short, hit) = bus.send(1, (ns(1_000 * n), ns(1_000 * n + 500)), &token(), Mark::OWN);
            assert_eq!((hit, bus.flight(short.id()).mark.broken), (Some(0), true), "short telegram {n}");
            bus.heard(short.id());
            assert_eq!(bus.wave(long.id()), long);
        }
        assert!(bus.heard(long.id()).mark.broken);
    }

    #[test]
    fn a_receiver_sees_the_line_busy_one_delay_later() {
        let mut bus = line();
        let (wave, _) = bus.send(0, (ns(100), ns(200)), &token(), Mark::OWN);
        assert_eq!((wave.number, bus.wave(wave.id())), (0, wave));
        assert_eq!([149, 150, 249, 250].map(|t| bus.is_busy(ns(t), 1)), [false, true, true, false]);
        assert_eq!((bus.arrival(wave, 0), bus.arrival(wave, 1)), (ns(200), ns(250)));
        // Forgotten when everybody has heard it and as many as are kept have followed.
        bus.heard(wave.id());
        for _ in 0..RECENT {
            let (other, _) = bus.send(1, (ns(1_000), ns(1_100)), &token(), Mark::OWN);
            bus.expect_listeners(other.id(), 0);
        }
        assert!(!bus.is_busy(ns(150), 1) && bus.is_busy(ns(1_050), 1) && bus.is_busy(ns(1_149), 0));
    }

    #[test]
    fn behind_a_link_with_jitter_all_hear_a_telegram_at_its_own_delay() {
        let half_width = Span::from_ns(40);
        let link = Link { ends: [Place::new(0, Span::ZERO), Place::new(1, Span::ZERO)], delay: Span::from_ns(100) };
        let tree = Tree::new(2, vec![link]).unwrap();
        let places = [0, 0, 1, 1].map(|segment| Place::new(segment, Span::ZERO));
        let mut bus = Bus::new(Delays::new(&tree, &places, &[0]), vec![LinkJitter::new(half_width, 1, "link")]);
        let mut expected = LinkJitter::new(half_width, 1, "link");
        let mut strays = Vec::new();
        for sender in [0, 1, 2].into_iter().cycle().take(300) {
            let start = ns(strays.len() as i64 * 1_000);
            let (wave, _) = bus.send(sender, (start, start + Span::from_ns(300)), &token(), Mark::OWN);
            let delay = |listener| bus.arrival(wave, listener) - wave.end;
            let stray = expected.draw();
            let behind = Span::from_ns(100) + stray;
            let all = if sender < 2 {
                [Span::ZERO, Span::ZERO, behind, behind]
            } else {
                [behind, behind, Span::ZERO, Span::ZERO]
            };
            assert_eq!([0, 1, 2, 3].map(delay), all);
            let far = if sender < 2 { 3 } else { 0 };
            let tick = Span::from_ticks(1);
            let seen = [start + behind - tick, start + behind, bus.arrival(wave, far) - tick, bus.arrival(wave, far)];
            assert_eq!(seen.map(|now| bus.is_busy(now, far)), [false, true, true, false]);
            bus.expect_listeners(wave.id(), 1);
            bus.heard(wave.id());
            strays.push(stray);
        }
        let most = Span::from_ns(36);
        assert!(strays.iter().any(|&stray| stray > most) && strays.iter().any(|&stray| stray < -most));
    }
}
