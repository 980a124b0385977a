//! The active station: claims and holds the token, sends requests, waits for answers, repeats, polls its GAP.
//!
//! | state | input | next state |
//! |---|---|---|
//! | Offline | power on | Listening, T_TO armed |
//! | Listening | any telegram | Listening, T_TO armed anew |
//! | Listening | T_TO of silence | Claiming: first token to itself |
//! | Claiming | own first token sent | Claiming: second token to itself |
//! | Claiming | own second token sent | Holding; [`Confirm::TokenHeld`] |
//! | Holding | request of the layer above | Awaiting, T_SL armed |
//! | Awaiting | answer of the asked station | Holding; [`Confirm::Reply`], [`Confirm::Acknowledged`] or [`Confirm::Gap`] |
//! | Awaiting | anything else, or T_SL over | repeated while retries are left, then Holding; [`Confirm::NoReply`] |
//!
//! A single active station passes the token to itself and goes on at once. Source: EN 50170-2.

use crate::fdl::params::BusParams;
use crate::fdl::{Heard, Outbox, Timer, longest_telegram};
use crate::observation::{GapAnswer, Observation};
use crate::time::{Local, Span};
use crate::wire::{Address, Fcb, Frame, FrameControl, Header, Sap, Service, StationType, Status, Telegram};

/// What the layer above learns.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Confirm<'a> {
    /// Nothing to know.
    Nothing,
    /// The token was claimed; the ring is this station alone.
    TokenHeld,
    /// A reply to the request.
    Reply {
        /// How it went.
        status: Status,
        /// Data unit.
        du: &'a [u8],
    },
    /// The short acknowledgement SC.
    Acknowledged,
    /// Nothing valid came, also after the last repeat.
    NoReply,
    /// What a GAP poll found.
    Gap(GapAnswer),
}

/// A request of the layer above.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Request {
    /// Whom to ask.
    pub to: Address,
    /// Service: SRD or MSRD.
    pub service: Service,
    /// Destination and source SAP; none for Data_Exchange.
    pub saps: Option<(Sap, Sap)>,
    /// Repeats when nothing comes. A station that did not answer last time gets none.
    pub retries: u8,
}

/// What is kept of every other station.
#[derive(Clone, Copy, Debug)]
struct Peer {
    fcb: Fcb,
    operational: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum State {
    Offline,
    Listening,
    Claiming { tokens_left: u8 },
    Holding,
    Awaiting(Awaited),
}

/// The answer that is awaited.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Awaited {
    from: Address,
    retries_left: u8,
    gap: bool,
    /// A telegram was under way when T_SL ran out; its end is awaited once.
    extended: bool,
}

/// An active station's data link layer.
#[derive(Clone, Debug)]
pub struct Active {
    address: Address,
    bus: BusParams,
    /// Spans of the bus parameters, computed once.
    t_id1: Span,
    t_id2: Span,
    t_sl: Span,
    state: State,
    peers: [Peer; 127],
    /// First instant at which a request may begin.
    free_at: Local,
    /// The last request, for repeating.
    last: Frame,
    gap_next: u8,
}

impl Active {
    /// A station at `address` on a bus with these parameters.
    pub fn new(address: Address, bus: BusParams) -> Self {
        Self {
            address,
            t_id1: bus.span(bus.t_id1()),
            t_id2: bus.span(bus.t_id2()),
            t_sl: bus.span(bus.t_sl),
            bus,
            state: State::Offline,
            peers: [Peer { fcb: Fcb::First, operational: false }; 127],
            free_at: Local::ZERO,
            last: Frame::new(),
            gap_next: address.get(),
        }
    }
    /// The station's address.
    pub const fn address(&self) -> Address {
        self.address
    }
    /// The bus parameters.
    pub const fn bus(&self) -> &BusParams {
        &self.bus
    }
    /// First instant at which the next request may begin: T_ID1 after an answer or a token, T_ID2 after an
    /// unanswered telegram.
    pub const fn free_at(&self) -> Local {
        self.free_at
    }
    /// T_ID1 as a span.
    pub const fn t_id1(&self) -> Span {
        self.t_id1
    }
    /// The longest that a request of `octets` characters can keep the bus busy, with an answer of `reply` characters
    /// and no repeat: to the last bit of the answer, or to the end of the slot time.
    pub fn longest_cycle(&self, octets: usize, reply: usize) -> Span {
        let rate = self.bus.rate;
        let answered = rate.span(self.bus.max_tsdr) + rate.octets(reply);
        rate.octets(octets) + answered.max(self.t_sl)
    }
    /// Forgets that `peer` ever answered: its next request has FCV = 0.
    pub fn reset_peer(&mut self, peer: Address) {
        self.peers[usize::from(peer.get())] = Peer { fcb: Fcb::First, operational: false };
    }

    /// The supply came on.
    pub fn power_on(&mut self, now: Local, out: &mut Outbox) {
        self.state = State::Listening;
        out.arm(Timer::Slot, now + self.t_to());
    }
    fn t_to(&self) -> Span {
        self.bus.span(self.bus.t_to(self.address.get()))
    }

    /// Sends a telegram that nobody answers to `da`, its first bit at `at`. Returns its end.
    pub fn broadcast(&mut self, at: Local, da: Address, saps: (Sap, Sap), du: &[u8], out: &mut Outbox) -> Local {
        let header = Header::request(da, self.address, Service::SdnHigh, Fcb::Unused).with_saps(saps.0, saps.1);
        let mut octets = 0;
        out.send(at, |frame| octets = fill(frame, &header, du));
        let end = at + self.bus.rate.octets(octets);
        self.free_at = end + self.t_id2;
        end
    }
    /// Sends the clock telegram, its first bit at `at`; `Input::Sent` follows its last bit and
    /// [`clock_sent`](Self::clock_sent) must then be called.
    pub fn send_clock(&mut self, at: Local, saps: (Sap, Sap), du: &[u8], out: &mut Outbox) {
        let header = Header::request(Address::BROADCAST, self.address, Service::SdnHigh, Fcb::Unused);
        out.send_clock(at, |frame| {
            fill(frame, &header.with_saps(saps.0, saps.1), du);
        });
    }
    /// The last bit of the clock telegram left at `now`.
    pub fn clock_sent(&mut self, now: Local) {
        self.free_at = now + self.t_id2;
    }
    /// Passes the token to itself, its first bit at `at`. Returns its end.
    pub fn pass_token(&mut self, at: Local, out: &mut Outbox) -> Local {
        out.send(at, |frame| frame.set_token(self.address, self.address));
        let end = at + self.bus.rate.octets(3);
        self.free_at = end + self.t_id1;
        end
    }
    /// Polls the next address of the GAP with FDL status, its first bit at `at`. Returns the address.
    ///
    /// # Panics
    /// While another answer is awaited: a bug of the caller.
    pub fn poll_gap(&mut self, at: Local, out: &mut Outbox) -> Address {
        let to = self.next_gap();
        let header = Header::request(to, self.address, Service::FdlStatus, Fcb::Unused);
        self.last.set_data(&header, &[]).expect("an empty request fits");
        self.await_answer(at, Awaited { from: to, retries_left: 0, gap: true, extended: false }, out);
        to
    }
    fn next_gap(&mut self) -> Address {
        loop {
            self.gap_next = if self.gap_next >= self.bus.hsa { 0 } else { self.gap_next + 1 };
            match Address::new(self.gap_next) {
                Some(address) if address != self.address => return address,
                _ => {}
            }
        }
    }
    /// Sends a request of `len` octets that `write` fills in, its first bit at `at`, and awaits the answer.
    ///
    /// # Panics
    /// While another answer is awaited, or above 246 octets: bugs of the caller.
    pub fn request(
        &mut self,
        at: Local,
        request: &Request,
        len: usize,
        out: &mut Outbox,
        write: impl FnOnce(&mut [u8]),
    ) {
        let peer = self.peers[usize::from(request.to.get())];
        let mut header = Header::request(request.to, self.address, request.service, peer.fcb);
        if let Some((dsap, ssap)) = request.saps {
            header = header.with_saps(dsap, ssap);
        }
        self.last.set_data_with(&header, len, write).expect("a request fits");
        let retries_left = if peer.operational { request.retries } else { 0 };
        self.await_answer(at, Awaited { from: request.to, retries_left, gap: false, extended: false }, out);
    }
    fn await_answer(&mut self, at: Local, awaited: Awaited, out: &mut Outbox) {
        assert!(self.state == State::Holding, "one request at a time");
        self.send_last(at, awaited, out);
    }
    fn send_last(&mut self, at: Local, awaited: Awaited, out: &mut Outbox) {
        let last = &self.last;
        out.send(at, |frame| frame.copy_from(last));
        out.arm(Timer::Slot, at + self.bus.rate.octets(last.len()) + self.t_sl);
        self.state = State::Awaiting(awaited);
    }

    /// Takes a telegram whose last bit arrived at `now`.
    pub fn heard<'a>(&mut self, now: Local, heard: Heard<'a>, out: &mut Outbox) -> Confirm<'a> {
        match self.state {
            State::Offline | State::Claiming { .. } | State::Holding => Confirm::Nothing,
            State::Listening => {
                out.arm(Timer::Slot, now + self.t_to());
                Confirm::Nothing
            }
            State::Awaiting(awaited) => self.answered(now, awaited, heard, out),
        }
    }
    fn answered<'a>(&mut self, now: Local, awaited: Awaited, heard: Heard<'a>, out: &mut Outbox) -> Confirm<'a> {
        let confirm = match Telegram::parse(heard.octets) {
            Ok(Telegram::ShortAck) if !awaited.gap => Confirm::Acknowledged,
            Ok(Telegram::Data { header, du }) if header.sa == awaited.from => match header.fc {
                FrameControl::Response { station, .. } if awaited.gap => Confirm::Gap(gap_answer(station)),
                FrameControl::Response { status, .. } if self.is_for_me(header.da) => Confirm::Reply { status, du },
                _ => return self.unanswered(now, awaited, out),
            },
            _ => return self.unanswered(now, awaited, out),
        };
        out.disarm(Timer::Slot);
        self.free_at = now + self.t_id1;
        self.state = State::Holding;
        if !awaited.gap {
            let peer = &mut self.peers[usize::from(awaited.from.get())];
            *peer = Peer { fcb: peer.fcb.next(), operational: true };
        }
        confirm
    }
    /// A reply goes to this station, or from a publisher to everybody.
    fn is_for_me(&self, da: Address) -> bool {
        da == self.address || da == Address::BROADCAST
    }

    /// [`Timer::Slot`] came due; `busy` tells whether characters are on the line.
    pub fn slot_over(&mut self, now: Local, busy: bool, out: &mut Outbox) -> Confirm<'static> {
        match self.state {
            State::Offline | State::Holding => Confirm::Nothing,
            State::Listening => {
                self.claim(now, 1, out);
                Confirm::Nothing
            }
            State::Claiming { tokens_left: 0 } => {
                self.state = State::Holding;
                self.free_at = now;
                out.observe(Observation::TokenClaimed);
                Confirm::TokenHeld
            }
            State::Claiming { tokens_left } => {
                self.claim(now, tokens_left - 1, out);
                Confirm::Nothing
            }
            // The answer began within T_SL: its end decides, and something that never ends does not.
            State::Awaiting(awaited) if busy && !awaited.extended => {
                out.arm(Timer::Slot, now + longest_telegram(self.bus.rate));
                self.state = State::Awaiting(Awaited { extended: true, ..awaited });
                Confirm::Nothing
            }
            State::Awaiting(awaited) => self.unanswered(now, awaited, out),
        }
    }
    fn claim(&mut self, now: Local, tokens_left: u8, out: &mut Outbox) {
        let end = self.pass_token(now, out);
        out.arm(Timer::Slot, end + self.t_id1);
        self.state = State::Claiming { tokens_left };
    }
    /// Nothing valid came: repeat, or give up. The next telegram begins T_ID1 later either way.
    fn unanswered(&mut self, now: Local, awaited: Awaited, out: &mut Outbox) -> Confirm<'static> {
        self.free_at = now + self.t_id1;
        if awaited.retries_left > 0 {
            out.observe(Observation::Retry { slave: awaited.from });
            let awaited = Awaited { retries_left: awaited.retries_left - 1, extended: false, ..awaited };
            self.send_last(self.free_at, awaited, out);
            return Confirm::Nothing;
        }
        out.disarm(Timer::Slot);
        self.state = State::Holding;
        if awaited.gap {
            return Confirm::Gap(GapAnswer::Absent);
        }
        self.reset_peer(awaited.from);
        Confirm::NoReply
    }
}

fn fill(frame: &mut Frame, header: &Header, du: &[u8]) -> usize {
    frame.set_data(header, du).expect("a broadcast fits");
    frame.len()
}

const fn gap_answer(station: StationType) -> GapAnswer {
    match station {
        StationType::Slave => GapAnswer::Slave,
        StationType::MasterNotReady => GapAnswer::NotReady,
        StationType::MasterReady => GapAnswer::Ready,
        StationType::MasterInRing => GapAnswer::InRing,
    }
}
