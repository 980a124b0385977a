//! The active station: a member of the token ring. It listens before it enters, holds the token, sends requests, waits
//! for answers, repeats, polls its GAP and passes the token on.
//!
//! | state | input | next state |
//! |---|---|---|
//! | Offline | power on | Listen_Token, T_TO armed |
//! | Listen_Token | a telegram | Listen_Token, T_TO armed anew; ready after two complete rotations of the token |
//! | Listen_Token | FDL status | Listen_Token; answered "not ready", from two rotations on "ready" |
//! | Listen_Token | second telegram with the own address as source | Offline |
//! | Listen_Token | ready, token from PS, or twice from another | Use_Token; [`Confirm::TokenHeld`] |
//! | Listen_Token | T_TO of silence | Claim_Token: first token to itself |
//! | Active_Idle | token from PS, or twice from another | Use_Token; [`Confirm::TokenHeld`] |
//! | Active_Idle | FDL status | Active_Idle; answered "in ring" |
//! | Active_Idle | passed over twice, or the own address as source | Listen_Token |
//! | Active_Idle | T_TO of silence | Claim_Token: first token to itself |
//! | Claim_Token | own first token sent | Claim_Token: second token to itself |
//! | Claim_Token | own second token sent | Use_Token; [`Confirm::TokenHeld`] |
//! | Claim_Token | a valid telegram | Listen_Token |
//! | Use_Token | request of the layer above | Await_Data_Response, T_SL armed |
//! | Use_Token | GAP poll of the layer above | Await_Status_Response, T_SL armed |
//! | Use_Token | token passed by the layer above | Pass_Token; alone: Use_Token; a slow station: Keep_Token |
//! | Keep_Token | the station is ready ([`HoldToken`]) | Pass_Token |
//! | Await_Data_Response, Await_Status_Response | anything but a token or request while the own request has not left | as before |
//! | Await_Data_Response | answer of the asked station | Use_Token; [`Confirm::Reply`] or [`Confirm::Acknowledged`] |
//! | Await_Data_Response | anything else, or T_SL over | repeated while retries are left, then Use_Token; [`Confirm::NoReply`] |
//! | Await_Status_Response | answer, anything else, or T_SL over | Use_Token; [`Confirm::Gap`]; "ready" is the next station |
//! | Pass_Token | its last bit has left | Check_Token_Pass, T_SL armed |
//! | Check_Token_Pass | activity on the line | Active_Idle |
//! | Check_Token_Pass | T_SL over | Pass_Token, three times to one station, then to the next; alone: Use_Token |
//! | any with the token | token or request of another station | Active_Idle; [`Confirm::TokenGone`] |
//! | any with the token | the own address as source | Listen_Token; [`Confirm::TokenGone`] |
//!
//! A station alone passes the token to itself and goes on at once. Source: EN 50170-2; the number of attempts as
//! the active station of profirust has it. Model: a station that found others by listening, or entered a ring, scans
//! its whole GAP once, an address at every token visit, before it keeps to G.

// A request and its answer come once per slave-cycle: each call would save and fetch all registers again.
#![allow(clippy::inline_always)]

mod token;

use crate::fdl::params::BusParams;
use crate::fdl::ring::{Ring, RotationTimer};
use crate::fdl::{Heard, Outbox, Timer, longest_telegram};
use crate::observation::{GapAnswer, Observation};
use crate::time::{Local, Span};
use crate::wire::{Address, Fcb, Frame, FrameControl, Header, Sap, Service, StationType, Status, Telegram};

/// What the layer above learns.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Confirm<'a> {
    /// Nothing to know.
    Nothing,
    /// The token is here: claimed, received, or back because nobody else takes it.
    TokenHeld,
    /// The token is gone without having been passed; what was awaited does not come any more.
    TokenGone,
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
    /// How often the own address was heard as source.
    ListenToken {
        conflicts: u8,
    },
    /// How often the token passed this station over.
    ActiveIdle {
        skipped: u8,
    },
    ClaimToken {
        tokens_left: u8,
    },
    UseToken,
    AwaitDataResponse(Awaited),
    AwaitStatusResponse(Awaited),
    /// It is passed on when the slow station is ready.
    KeepToken,
    PassToken(Passing),
    CheckTokenPass(Passing),
}

/// A token on its way to the next station.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Passing {
    to: Address,
    attempt: u8,
}

/// The answer that is awaited.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Awaited {
    from: Address,
    retries_left: u8,
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
    t_octet: Span,
    state: State,
    ring: Ring,
    timer: RotationTimer,
    /// The high-priority message that every token visit has, whatever is left of T_TH, was sent.
    high_used: bool,
    /// Sender of a token that did not come from PS, until it is repeated.
    doubted: Option<Address>,
    peers: [Peer; 127],
    /// First instant at which a request may begin.
    free_at: Local,
    /// The last request, for repeating.
    last: Frame,
    /// Where the last bit of that request leaves: an answer ends later.
    asked_until: Local,
    /// How much longer than it has to the station keeps each token.
    hold: Span,
    repeats: u32,
}

/// An order of the scenario: from now on the station keeps each token so much longer before it passes it on, as a slow
/// station does. Zero ends it, and so does the supply.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct HoldToken(pub Span);

impl Active {
    /// A station at `address` on a bus with these parameters.
    pub fn new(address: Address, bus: BusParams) -> Self {
        Self {
            address,
            t_id1: bus.span(bus.t_id1()),
            t_id2: bus.span(bus.t_id2()),
            t_sl: bus.span(bus.t_sl),
            t_octet: bus.rate.octets(1),
            bus,
            state: State::Offline,
            peers: [Peer { fcb: Fcb::First, operational: false }; 127],
            free_at: Local::ZERO,
            last: Frame::new(),
            ring: Ring::new(address, bus.hsa),
            timer: RotationTimer::new(bus.span(bus.t_tr)),
            high_used: false,
            doubted: None,
            asked_until: Local::ZERO,
            hold: Span::ZERO,
            repeats: 0,
        }
    }
    /// Keeps tokens longer from now on.
    pub const fn hold_token(&mut self, HoldToken(by): HoldToken) {
        self.hold = by;
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
    /// Whatever was sent before, the next request does not begin before `now`.
    pub fn not_before(&mut self, now: Local) {
        self.free_at = self.free_at.max(now);
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
    /// How many requests were repeated since [`count_anew`](Self::count_anew).
    pub const fn repeats(&self) -> u32 {
        self.repeats
    }
    /// From now on repeats are counted from zero.
    pub const fn count_anew(&mut self) {
        self.repeats = 0;
    }
    /// What this station knows of the ring.
    pub const fn ring(&self) -> &Ring {
        &self.ring
    }
    /// Whether this station has the token and awaits no answer: requests, GAP polls and the token may be sent.
    pub fn may_send(&self) -> bool {
        self.state == State::UseToken
    }
    /// T_TH that is left at `now`; not positive when it is used up.
    pub fn t_th(&self, now: Local) -> Span {
        self.timer.t_th(now)
    }
    /// Whether a message with high priority may begin at `now`: one in every token visit, more while T_TH lasts
    /// (EN 50170-2 p. 119).
    pub fn may_high(&self, now: Local) -> bool {
        !self.high_used || self.may_low(now)
    }
    /// Whether a message with low priority may begin at `now`: T_RR is below T_TR (EN 50170-2 p. 119).
    pub fn may_low(&self, now: Local) -> bool {
        self.t_th(now) > Span::ZERO
    }
    /// Whether the GAP may be polled at `now`: something of T_TH remains (EN 50170-2 p. 102).
    pub fn may_gap(&self, now: Local) -> bool {
        self.may_low(now)
    }
    /// Forgets that `peer` ever answered: its next request has FCV = 0.
    pub fn reset_peer(&mut self, peer: Address) {
        self.peers[usize::from(peer.get())] = Peer { fcb: Fcb::First, operational: false };
    }

    /// The supply came on.
    pub fn power_on(&mut self, now: Local, out: &mut Outbox) {
        self.state = State::ListenToken { conflicts: 0 };
        self.await_silence(now, out);
    }

    /// Sends a telegram that nobody answers to `da`, its first bit at `at`. Returns its end.
    ///
    /// # Panics
    /// Above 244 octets of data: a bug of the caller.
    pub fn broadcast(&mut self, at: Local, da: Address, saps: (Sap, Sap), du: &[u8], out: &mut Outbox) -> Local {
        let header = Header::request(da, self.address, Service::SdnHigh, Fcb::Unused).with_saps(saps.0, saps.1);
        let mut octets = 0;
        out.send(at, |frame| {
            frame.set_data(&header, du).expect("a broadcast fits");
            octets = frame.len();
        });
        let end = at + self.bus.rate.octets(octets);
        self.free_at = end + self.t_id2;
        end
    }
    /// The clock telegram of this station.
    ///
    /// # Panics
    /// Above 244 octets of data: a bug of the caller.
    pub fn clock(&self, (dsap, ssap): (Sap, Sap), du: &[u8]) -> Frame {
        let header = Header::request(Address::BROADCAST, self.address, Service::SdnHigh, Fcb::Unused);
        let mut frame = Frame::new();
        frame.set_data(&header.with_saps(dsap, ssap), du).expect("a broadcast fits");
        frame
    }
    /// Sends the [`clock`](Self::clock) telegram, its first bit at `at`; `Input::Sent` follows its last bit and
    /// [`clock_sent`](Self::clock_sent) must then be called.
    pub fn send_clock(&mut self, at: Local, clock: &Frame, out: &mut Outbox) {
        out.send_clock(at, |frame| frame.copy_from(clock));
    }
    /// The last bit of the clock telegram left at `now`.
    pub fn clock_sent(&mut self, now: Local) {
        self.free_at = now + self.t_id2;
    }
    /// Polls the next address of the GAP with FDL status, its first bit at `at`. Returns the address; none, and
    /// nothing is sent, where no address lies between this station and the next.
    ///
    /// # Panics
    /// While another answer is awaited: a bug of the caller.
    pub fn poll_gap(&mut self, at: Local, out: &mut Outbox) -> Option<Address> {
        let to = self.ring.next_gap()?;
        self.poll(at, to, out);
        Some(to)
    }
    /// Asks `to` for its FDL status, first bit at `at`. [`Confirm::Gap`] follows.
    ///
    /// # Panics
    /// While another answer is awaited: a bug of the caller.
    pub fn poll(&mut self, at: Local, to: Address, out: &mut Outbox) {
        assert!(self.may_send(), "one request at a time");
        let header = Header::request(to, self.address, Service::FdlStatus, Fcb::Unused);
        self.last.set_data(&header, &[]).expect("an empty request fits");
        self.send_last(at, out);
        self.state = State::AwaitStatusResponse(Awaited { from: to, retries_left: 0, extended: false });
    }
    /// Sends a request of `len` octets that `write` fills in, its first bit at `at`, and awaits the answer.
    ///
    /// # Panics
    /// While another answer is awaited, or above 246 octets: bugs of the caller.
    #[inline(always)]
    pub fn request(
        &mut self,
        at: Local,
        request: &Request,
        len: usize,
        out: &mut Outbox,
        write: impl FnOnce(&mut [u8]),
    ) {
        assert!(self.may_send(), "one request at a time");
        self.high_used |= matches!(request.service, Service::SrdHigh | Service::Msrd);
        let peer = self.peers[usize::from(request.to.get())];
        let mut header = Header::request(request.to, self.address, request.service, peer.fcb);
        if let Some((dsap, ssap)) = request.saps {
            header = header.with_saps(dsap, ssap);
        }
        self.last.set_data_with(&header, len, write).expect("a request fits");
        let retries_left = if peer.operational { request.retries } else { 0 };
        self.send_last(at, out);
        self.state = State::AwaitDataResponse(Awaited { from: request.to, retries_left, extended: false });
    }
    fn send_last(&mut self, at: Local, out: &mut Outbox) {
        let last = &self.last;
        out.send(at, |frame| frame.copy_from(last));
        self.asked_until = at + self.t_octet * last.len() as i64;
        out.arm(Timer::Slot, self.asked_until + self.t_sl);
    }

    /// Takes a telegram whose last bit arrived at `now`.
    pub fn heard<'a>(&mut self, now: Local, heard: Heard<'a>, out: &mut Outbox) -> Confirm<'a> {
        let telegram = Telegram::parse(heard.octets).ok();
        match telegram.and_then(|telegram| self.replied(now, &telegram, out)) {
            Some((status, du)) => Confirm::Reply { status, du },
            None => self.heard_other(now, telegram.as_ref(), out),
        }
    }
    /// The first half of [`heard`](Self::heard): a reply to the request, which is nearly all that is heard.
    #[inline(always)]
    pub fn replied<'a>(&mut self, now: Local, telegram: &Telegram<'a>, out: &mut Outbox) -> Option<(Status, &'a [u8])> {
        if let State::AwaitDataResponse(awaited) = self.state
            && let Telegram::Data { header, du } = telegram
            && let Some(status) = self.answer(now, awaited, header)
        {
            self.operational(now, awaited.from, out);
            return Some((status, du));
        }
        None
    }
    /// What a telegram with data means for the request, where it answers that: not before the request has left, and not
    /// as if it came from this very station.
    fn answer(&self, now: Local, awaited: Awaited, header: &Header) -> Option<Status> {
        let from = header.sa == awaited.from && header.sa != self.address;
        match header.fc {
            FrameControl::Response { status, .. } if from && self.is_for_me(header.da) && self.has_asked(now) => {
                Some(status)
            }
            _ => None,
        }
    }
    /// The asked station has answered.
    fn operational(&mut self, now: Local, from: Address, out: &mut Outbox) {
        self.goes_on(now, out);
        let peer = &mut self.peers[usize::from(from.get())];
        let counted = matches!(peer.fcb, Fcb::Alternate(_));
        let fcb = if counted { peer.fcb.next() } else { next_of_first(peer.fcb) };
        *peer = Peer { fcb, operational: true };
    }
    /// The second half of [`heard`](Self::heard): anything else that was heard, nothing for a broken telegram.
    #[cold]
    pub fn heard_other(&mut self, now: Local, telegram: Option<&Telegram<'_>>, out: &mut Outbox) -> Confirm<'static> {
        match self.state {
            State::ListenToken { conflicts } => self.listens(now, conflicts, telegram.copied(), out),
            State::ActiveIdle { skipped } => self.idles(now, skipped, telegram.copied(), out),
            State::CheckTokenPass(_) => self.idles(now, 0, telegram.copied(), out),
            State::ClaimToken { .. } if telegram.is_some() => self.listens_again(now, out),
            State::Offline | State::ClaimToken { .. } => Confirm::Nothing,
            State::UseToken | State::KeepToken | State::PassToken(_) => {
                self.disputed(now, telegram, out).unwrap_or(Confirm::Nothing)
            }
            State::AwaitDataResponse(awaited) => {
                let disputed = self.disputed(now, telegram, out).or(self.is_early(now));
                disputed.unwrap_or_else(|| match telegram {
                    Some(Telegram::ShortAck) => {
                        self.operational(now, awaited.from, out);
                        Confirm::Acknowledged
                    }
                    _ => self.unanswered(now, awaited, out),
                })
            }
            State::AwaitStatusResponse(Awaited { from, .. }) => {
                let disputed = self.disputed(now, telegram, out).or(self.is_early(now));
                disputed.unwrap_or_else(|| self.status(now, from, telegram, out))
            }
        }
    }
    /// What is on the line before the request has left answers nothing.
    fn is_early(&self, now: Local) -> Option<Confirm<'static>> {
        (!self.has_asked(now)).then_some(Confirm::Nothing)
    }
    /// Whether the request has left at `now`.
    fn has_asked(&self, now: Local) -> bool {
        now >= self.asked_until
    }
    /// The wait is over; the next telegram begins T_ID1 later.
    fn goes_on(&mut self, now: Local, out: &mut Outbox) {
        out.disarm(Timer::Slot);
        self.free_at = now + self.t_id1;
        self.state = State::UseToken;
    }
    /// A reply goes to this station, or from a publisher to everybody.
    fn is_for_me(&self, da: Address) -> bool {
        da == self.address || da == Address::BROADCAST
    }
    /// What came in place of an FDL status, or none within T_SL.
    fn status(
        &mut self,
        now: Local,
        from: Address,
        telegram: Option<&Telegram<'_>>,
        out: &mut Outbox,
    ) -> Confirm<'static> {
        let answer = match telegram {
            Some(Telegram::Data { header, .. }) if header.sa == from => match header.fc {
                FrameControl::Response { station, .. } => gap_answer(station),
                FrameControl::Request { .. } => GapAnswer::Absent,
            },
            _ => GapAnswer::Absent,
        };
        self.goes_on(now, out);
        if self.ring.polled(from, answer) {
            out.observe(Observation::StationJoined { station: from });
        }
        Confirm::Gap(answer)
    }

    /// [`Timer::Slot`] came due; `busy` tells whether characters are on the line.
    pub fn slot_over(&mut self, now: Local, busy: bool, out: &mut Outbox) -> Confirm<'static> {
        match &mut self.state {
            // The answer began within T_SL: its end decides, and something that never ends does not.
            State::AwaitDataResponse(awaited) | State::AwaitStatusResponse(awaited) if busy && !awaited.extended => {
                awaited.extended = true;
                out.arm(Timer::Slot, now + longest_telegram(self.bus.rate));
                return Confirm::Nothing;
            }
            _ => {}
        }
        match self.state {
            State::Offline | State::UseToken => Confirm::Nothing,
            State::ListenToken { .. } | State::ActiveIdle { .. } => self.silent(now, busy, out),
            State::ClaimToken { tokens_left } => self.claims(now, tokens_left, out),
            State::KeepToken => {
                self.pass_to(now, 1, out);
                Confirm::Nothing
            }
            State::PassToken(passing) => self.passed(now, passing, out),
            State::CheckTokenPass(passing) => self.not_taken(now, passing, busy, out),
            State::AwaitDataResponse(awaited) => self.unanswered(now, awaited, out),
            State::AwaitStatusResponse(Awaited { from, .. }) => self.status(now, from, None, out),
        }
    }
    /// Nothing valid came: repeat, or give up. The next telegram begins T_ID1 later either way.
    fn unanswered(&mut self, now: Local, awaited: Awaited, out: &mut Outbox) -> Confirm<'static> {
        self.goes_on(now, out);
        if awaited.retries_left > 0 {
            out.observe(Observation::Retry { slave: awaited.from });
            self.repeats += 1;
            self.send_last(self.free_at, out);
            self.state = State::AwaitDataResponse(Awaited {
                retries_left: awaited.retries_left - 1,
                extended: false,
                ..awaited
            });
            return Confirm::Nothing;
        }
        self.reset_peer(awaited.from);
        Confirm::NoReply
    }
}

/// The count after a request with FCV = 0.
#[cold]
const fn next_of_first(fcb: Fcb) -> Fcb {
    fcb.next()
}

const fn gap_answer(station: StationType) -> GapAnswer {
    match station {
        StationType::Slave => GapAnswer::Slave,
        StationType::MasterNotReady => GapAnswer::NotReady,
        StationType::MasterReady => GapAnswer::Ready,
        StationType::MasterInRing => GapAnswer::InRing,
    }
}

#[cfg(test)]
mod tests;
