//! The ring as one active station knows it: the list of active stations (LAS), next and previous station (NS, PS),
//! the GAP between it and the next one, and the time the token takes to come round.
//!
//! | heard | in the list |
//! |---|---|
//! | token from SA to DA | SA and DA are in the ring, nobody between them is |
//! | two complete rotations in which the same stations sent the token | the list is complete |
//!
//! A rotation is complete with the token that goes to the sender's own or a lower address. Source: EN 50170-2, LAS
//! and GAPL; the rotation's times pp. 119.

use crate::observation::GapAnswer;
use crate::time::{Local, Span};
use crate::wire::Address;

/// Complete rotations in which the list must be heard unchanged.
const ROTATIONS: u8 = 2;

/// What an active station knows of the ring.
#[derive(Clone, Debug)]
pub struct Ring {
    ts: u8,
    hsa: u8,
    /// LAS: bit n is address n. This station's own bit is always set.
    las: u128,
    listening: Listening,
    /// GAPL: what the last poll of each address found.
    gap: [Option<GapAnswer>; 127],
    /// The address polled last.
    gap_at: u8,
    /// The GAP is being scanned from its beginning, an address at every token visit.
    scanning: bool,
}

/// The list while it is being made.
#[derive(Clone, Copy, Default, Debug)]
struct Listening {
    /// The beginning of a rotation was heard.
    begun: bool,
    /// Senders of the running rotation and of the one before.
    running: u128,
    before: u128,
    complete: u8,
    last: Option<(Address, Address)>,
}

impl Ring {
    /// The ring before anything was heard: the station at `ts` alone, on a bus whose highest address is `hsa`.
    pub const fn new(ts: Address, hsa: u8) -> Self {
        Self {
            ts: ts.get(),
            hsa,
            las: 1 << ts.get(),
            listening: Listening { begun: false, running: 0, before: 0, complete: 0, last: None },
            gap: [None; 127],
            gap_at: ts.get(),
            scanning: false,
        }
    }
    /// Forgets everything; the list is made anew.
    pub fn forget(&mut self) {
        self.las = 1 << self.ts;
        self.listening = Listening::default();
    }

    /// The active stations in ascending order, this one included.
    pub fn members(&self) -> impl Iterator<Item = Address> {
        (0..=126).filter(|n| self.las >> n & 1 == 1).filter_map(Address::new)
    }
    /// Whether no other active station is in the ring.
    pub const fn is_alone(&self) -> bool {
        self.las == 1 << self.ts
    }
    /// NS, the station that gets the token next: this one if it is alone.
    pub const fn ns(&self) -> Address {
        let above = self.las >> self.ts >> 1;
        let next =
            if above != 0 { self.ts + 1 + above.trailing_zeros() as u8 } else { self.las.trailing_zeros() as u8 };
        station(next)
    }
    /// PS, the station from which the token comes: this one if it is alone.
    pub const fn ps(&self) -> Address {
        let below = self.las & ((1 << self.ts) - 1);
        let before = if below != 0 { below } else { self.las };
        station(127 - before.leading_zeros() as u8)
    }
    /// Takes a station that does not take the token off the list.
    pub fn remove(&mut self, member: Address) {
        self.las &= !(1 << member.get()) | 1 << self.ts;
    }

    /// Listens to a token, for the first list. Tells whether the list is complete.
    pub fn listen(&mut self, sa: Address, da: Address) -> bool {
        let heard = &mut self.listening;
        let repeated = sa != da && heard.last == Some((sa, da));
        heard.last = Some((sa, da));
        if heard.complete >= ROTATIONS || repeated {
            return self.is_complete();
        }
        heard.running |= 1 << sa.get();
        if da <= sa {
            let same = heard.begun && (heard.complete == 0 || heard.running == heard.before);
            heard.complete = if same { heard.complete + 1 } else { u8::from(heard.begun) };
            heard.before = heard.running;
            (heard.begun, heard.running) = (true, 0);
            self.las = heard.before | 1 << self.ts;
        }
        self.is_complete()
    }
    /// Whether two complete rotations were heard.
    pub const fn is_complete(&self) -> bool {
        self.listening.complete >= ROTATIONS
    }
    /// A token went from `sa` to `da`. Tells whether this station was passed over.
    pub fn passed(&mut self, sa: Address, da: Address) -> bool {
        self.las &= !between(sa.get(), da.get());
        let skipped = self.las >> self.ts & 1 == 0;
        self.las |= 1 << sa.get() | 1 << da.get() | 1 << self.ts;
        skipped
    }

    /// The token was claimed: the ring is this station alone.
    pub fn claimed(&mut self) {
        self.las = 1 << self.ts;
    }
    /// From here on the whole GAP is polled once, an address at every token visit.
    pub fn scan(&mut self) {
        self.scanning = true;
        self.gap_at = self.ts;
    }
    /// Whether the GAP is being scanned.
    pub const fn is_scanning(&self) -> bool {
        self.scanning
    }
    /// The next address of the GAP, which lies between this station and NS; none where NS is the next address.
    pub fn next_gap(&mut self) -> Option<Address> {
        let mut next = self.after(self.gap_at);
        if !self.in_gap(next) {
            self.scanning = false;
            next = self.after(self.ts);
        }
        self.gap_at = next;
        self.in_gap(next).then(|| station(next))
    }
    /// Addresses go round at HSA.
    const fn after(&self, address: u8) -> u8 {
        if address >= self.hsa { 0 } else { address + 1 }
    }
    fn in_gap(&self, address: u8) -> bool {
        address <= self.hsa && between(self.ts, self.ns().get()) >> address & 1 == 1
    }
    /// What a poll of the GAP found. Tells whether a station joins: then it is NS.
    pub fn polled(&mut self, address: Address, answer: GapAnswer) -> bool {
        self.gap[usize::from(address.get())] = Some(answer);
        if answer != GapAnswer::Ready || self.las >> address.get() & 1 == 1 {
            return false;
        }
        self.las |= 1 << address.get();
        self.scanning = false;
        true
    }
    /// What the last poll of `address` found.
    pub fn gap(&self, address: Address) -> Option<GapAnswer> {
        *self.gap.get(usize::from(address.get()))?
    }
}

/// The addresses behind `sa` and before `da`, going round.
const fn between(sa: u8, da: u8) -> u128 {
    let (after, before) = (!(u128::MAX >> (127 - sa)), (1 << da) - 1);
    if sa < da { after & before } else { after | before }
}
const fn station(number: u8) -> Address {
    Address::new(number).expect("seven bits")
}

/// The token rotation timer (EN 50170-2 p. 119): loaded with T_TR whenever the token comes; what is left of it when
/// the token comes again is T_TH.
#[derive(Clone, Copy, Debug)]
pub struct RotationTimer {
    t_tr: Span,
    received: Option<Local>,
    /// The end of T_TH.
    until: Local,
}

impl RotationTimer {
    /// A timer for this T_TR, before the first token.
    pub const fn new(t_tr: Span) -> Self {
        Self { t_tr, received: None, until: Local::ZERO }
    }
    /// Forgets when the token came: the next one has the whole T_TR.
    pub const fn reset(&mut self) {
        self.received = None;
    }
    /// The token came at `now`. Returns T_RR, zero for the first token.
    pub fn received(&mut self, now: Local) -> Span {
        let before = self.received.replace(now).unwrap_or(now);
        self.until = before + self.t_tr;
        now - before
    }
    /// What is left of T_TH at `now`; not positive when it is used up.
    pub fn t_th(&self, now: Local) -> Span {
        self.until - now
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    const fn at(number: u8) -> Address {
        station(number)
    }
    fn members(ring: &Ring) -> Vec<u8> {
        ring.members().map(Address::get).collect()
    }
    /// A ring that has listened to these tokens; whether its list is complete after each.
    fn listened(ts: u8, tokens: &[(u8, u8)]) -> (Ring, Vec<bool>) {
        let mut ring = Ring::new(at(ts), 126);
        let complete = tokens.iter().map(|&(sa, da)| ring.listen(at(sa), at(da))).collect();
        (ring, complete)
    }

    #[test]
    fn two_complete_rotations_make_the_list() {
        let (ring, complete) = listened(4, &[(5, 9), (9, 2), (2, 5), (5, 9), (9, 2), (2, 5), (5, 9), (9, 2)]);
        assert_eq!(complete, [false, false, false, false, false, false, false, true], "from the first token of 2 on");
        assert_eq!(members(&ring), [2, 4, 5, 9]);
        assert_eq!((ring.ps(), ring.ns()), (at(2), at(5)));
        let (ring, complete) = listened(4, &[(2, 2), (2, 2), (2, 2)]);
        assert_eq!((complete, members(&ring)), ([false, false, true].into(), [2, 4].into()), "a lone station");
    }

    #[test]
    fn a_list_that_changes_is_heard_once_more() {
        let (_, complete) = listened(4, &[(5, 2), (2, 5), (5, 2), (2, 9), (9, 2), (2, 9)]);
        assert!(complete.iter().all(|complete| !complete));
        let (ring, complete) = listened(4, &[(5, 2), (2, 5), (5, 2), (2, 9), (9, 2), (2, 9), (9, 2)]);
        assert_eq!((complete.last(), members(&ring)), (Some(&true), [2, 4, 9].into()));
        let (_, complete) = listened(4, &[(5, 2), (5, 2), (5, 2)]);
        assert_eq!(complete, [false; 3], "a token sent three times is no rotation");
    }

    #[test]
    fn a_token_tells_who_is_there_and_who_is_not() {
        let (mut ring, _) = listened(9, &[(5, 2), (2, 5), (5, 2), (2, 5), (5, 2)]);
        assert!(!ring.passed(at(2), at(3)), "3 is new");
        assert_eq!(members(&ring), [2, 3, 5, 9]);
        assert!(!ring.passed(at(2), at(5)));
        assert_eq!(members(&ring), [2, 5, 9], "and left out again");
        assert!(ring.passed(at(5), at(2)), "this station is left out");
        assert!(ring.passed(at(2), at(2)) && members(&ring) == [2, 9]);
        ring.remove(at(2));
        ring.remove(at(9));
        assert!(ring.is_alone() && ring.ns() == at(9) && ring.ps() == at(9), "this station stays");
    }

    #[test]
    fn the_gap_lies_between_this_station_and_the_next() {
        let gap = |ring: &mut Ring, count: usize| -> Vec<Option<u8>> {
            (0..count).map(|_| ring.next_gap().map(Address::get)).collect()
        };
        let mut ring = Ring::new(at(3), 5);
        assert_eq!(gap(&mut ring, 7), [4, 5, 0, 1, 2, 4, 5].map(Some), "alone: all addresses up to HSA");
        assert!(ring.polled(at(1), GapAnswer::Ready));
        assert_eq!(gap(&mut ring, 5), [0, 4, 5, 0, 4].map(Some), "the next one is 1");
        assert!(ring.polled(at(4), GapAnswer::Ready));
        assert_eq!((gap(&mut ring, 2), ring.ns()), ([None, None].into(), at(4)), "no address between");
        let mut ring = Ring::new(at(3), 5);
        ring.scan();
        let scanned = (0..6).map(|_| (ring.next_gap(), ring.is_scanning()).1);
        assert!(scanned.eq([true, true, true, true, true, false]), "once round");
    }

    #[test]
    fn only_a_station_that_is_ready_joins() {
        let mut ring = Ring::new(at(3), 126);
        for answer in [GapAnswer::Absent, GapAnswer::Slave, GapAnswer::NotReady, GapAnswer::InRing] {
            assert!(!ring.polled(at(7), answer) && ring.is_alone(), "{answer}");
            assert_eq!(ring.gap(at(7)), Some(answer));
        }
        assert!(ring.polled(at(7), GapAnswer::Ready) && ring.ns() == at(7));
        assert!(!ring.polled(at(7), GapAnswer::Ready), "it has joined");
    }

    #[test]
    fn what_a_rotation_leaves_of_t_tr_may_be_used() {
        let us = |us| Local::ZERO + Span::from_us(us);
        let mut timer = RotationTimer::new(Span::from_us(100));
        assert_eq!((timer.received(us(10)), timer.t_th(us(10))), (Span::ZERO, Span::from_us(100)), "the first token");
        assert_eq!((timer.received(us(80)), timer.t_th(us(80))), (Span::from_us(70), Span::from_us(30)));
        assert_eq!(timer.t_th(us(115)), Span::from_us(-5), "it is used up while the token is held");
        assert_eq!((timer.received(us(200)), timer.t_th(us(200))), (Span::from_us(120), Span::from_us(-20)), "late");
    }
}
