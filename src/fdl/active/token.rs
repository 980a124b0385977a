//! The active station's part in the ring: listening, claiming, receiving, passing and losing the token.

use super::{Active, Confirm, Passing, State};
use crate::fdl::{Outbox, Timer};
use crate::observation::{Observation, RingExit};
use crate::time::{Local, Span};
use crate::wire::{Address, FrameControl, Header, Service, StationType, Status, Telegram};

/// How often the token is sent to one station that is not heard (profirust).
const ATTEMPTS: u8 = 3;
/// Characters of the token.
const TOKEN_OCTETS: usize = 3;
/// How often the token may pass a station over, and its own address be heard while it listens (EN 50170-2: a fault
/// counts when it comes again).
const TWICE: u8 = 2;

impl Active {
    /// Passes the token to the next station, its first bit at `at`, or later where it is held ([`HoldToken`]). Returns its
    /// end. Alone in the ring a station goes on at once; otherwise [`Confirm::TokenHeld`] tells when the token is back.
    ///
    /// [`HoldToken`]: super::HoldToken
    ///
    /// # Panics
    /// While an answer is awaited: a bug of the caller.
    pub fn pass_token(&mut self, at: Local, out: &mut Outbox) -> Local {
        assert!(self.may_send(), "the token is passed when nothing is awaited");
        if self.hold == Span::ZERO || self.ring.is_alone() {
            return self.pass_to(at + self.hold, 1, out);
        }
        // The station itself is slow: were the token late on the line alone, it would be repeated. It is not sent yet, since
        // what the others do until then may be the end of it.
        let at = at + self.hold;
        out.arm(Timer::Slot, at);
        self.state = State::KeepToken;
        at + self.bus.rate.octets(TOKEN_OCTETS)
    }
    pub(super) fn pass_to(&mut self, at: Local, attempt: u8, out: &mut Outbox) -> Local {
        let to = self.ring.ns();
        let end = self.send_token(at, to, out);
        if to == self.address {
            self.timer.received(end);
            self.high_used = false;
            self.state = State::UseToken;
        } else {
            out.arm(Timer::Slot, end);
            self.state = State::PassToken(Passing { to, attempt });
        }
        end
    }
    fn send_token(&mut self, at: Local, to: Address, out: &mut Outbox) -> Local {
        out.send(at, |frame| frame.set_token(to, self.address));
        let end = at + self.bus.rate.octets(TOKEN_OCTETS);
        self.free_at = end + self.t_id1;
        end
    }
    /// The last bit of the token has left.
    pub(super) fn passed(&mut self, now: Local, passing: Passing, out: &mut Outbox) -> Confirm<'static> {
        self.state = State::CheckTokenPass(passing);
        out.arm(Timer::Slot, now + self.t_sl);
        Confirm::Nothing
    }
    /// T_SL after the token nothing was heard to its end.
    pub(super) fn not_taken(&mut self, now: Local, passing: Passing, busy: bool, out: &mut Outbox) -> Confirm<'static> {
        if busy {
            self.state = State::ActiveIdle { skipped: 0 };
            self.await_silence(now, out);
            return Confirm::Nothing;
        }
        let Passing { to, attempt } = passing;
        if attempt < ATTEMPTS {
            out.observe(Observation::TokenRetry { to });
            self.pass_to(now, attempt + 1, out);
            return Confirm::Nothing;
        }
        self.ring.remove(to);
        out.observe(Observation::StationLost { station: to });
        if !self.ring.is_alone() {
            self.pass_to(now, 1, out);
            return Confirm::Nothing;
        }
        self.timer.received(now);
        self.high_used = false;
        self.free_at = now;
        self.state = State::UseToken;
        Confirm::TokenHeld
    }

    /// T_TO is armed anew: something was on the line until `now`.
    pub(super) fn await_silence(&self, now: Local, out: &mut Outbox) {
        out.arm(Timer::Slot, now + self.bus.span(self.bus.t_to(self.address.get())));
    }
    /// T_TO has passed since the last telegram ended.
    pub(super) fn silent(&mut self, now: Local, busy: bool, out: &mut Outbox) -> Confirm<'static> {
        if busy {
            self.await_silence(now, out);
            return Confirm::Nothing;
        }
        // A station that never heard another one has no ring to find again.
        let known = !self.ring.is_alone();
        self.ring.claimed();
        if known {
            self.ring.scan();
        }
        self.claim(now, 1, out);
        Confirm::Nothing
    }
    fn claim(&mut self, now: Local, tokens_left: u8, out: &mut Outbox) {
        let end = self.send_token(now, self.address, out);
        out.arm(Timer::Slot, end + self.t_id1);
        self.state = State::ClaimToken { tokens_left };
    }
    /// T_ID1 after an own token of the claim.
    pub(super) fn claims(&mut self, now: Local, tokens_left: u8, out: &mut Outbox) -> Confirm<'static> {
        if tokens_left > 0 {
            self.claim(now, tokens_left - 1, out);
            return Confirm::Nothing;
        }
        self.timer.reset();
        self.timer.received(now);
        self.high_used = false;
        self.doubted = None;
        self.free_at = now;
        self.state = State::UseToken;
        out.observe(Observation::TokenClaimed);
        Confirm::TokenHeld
    }

    /// A telegram while the list is made.
    pub(super) fn listens(
        &mut self,
        now: Local,
        conflicts: u8,
        telegram: Option<Telegram<'_>>,
        out: &mut Outbox,
    ) -> Confirm<'static> {
        self.await_silence(now, out);
        match telegram {
            Some(Telegram::Token { sa, .. }) if sa == self.address => self.conflicts(conflicts + 1, out),
            Some(Telegram::Data { header, .. }) if header.sa == self.address => self.conflicts(conflicts + 1, out),
            Some(Telegram::Token { da, sa }) if !self.ring.is_complete() => {
                self.ring.listen(sa, da);
            }
            Some(Telegram::Token { da, sa }) if da == self.address => {
                return self.token_came(now, sa, true, out);
            }
            Some(Telegram::Token { da, sa }) => {
                self.doubted = None;
                self.ring.passed(sa, da);
            }
            Some(Telegram::Data { header, .. }) => {
                let ready = self.ring.is_complete();
                let station = if ready { StationType::MasterReady } else { StationType::MasterNotReady };
                self.answer_status(now, &header, station, out);
            }
            _ => {}
        }
        Confirm::Nothing
    }
    /// Another station uses this address: twice heard, this station keeps away from the line.
    fn conflicts(&mut self, conflicts: u8, out: &mut Outbox) {
        self.state = State::ListenToken { conflicts };
        if conflicts >= TWICE {
            self.state = State::Offline;
            out.disarm(Timer::Slot);
            out.observe(Observation::AddressConflict);
        }
    }

    /// A telegram while another station of the ring has the token.
    pub(super) fn idles(
        &mut self,
        now: Local,
        skipped: u8,
        telegram: Option<Telegram<'_>>,
        out: &mut Outbox,
    ) -> Confirm<'static> {
        self.await_silence(now, out);
        self.state = State::ActiveIdle { skipped };
        match telegram {
            Some(Telegram::Token { sa, .. }) if sa == self.address => {
                return self.leaves(now, RingExit::AddressConflict, out);
            }
            Some(Telegram::Data { header, .. }) if header.sa == self.address => {
                return self.leaves(now, RingExit::AddressConflict, out);
            }
            Some(Telegram::Token { da, sa }) if da == self.address => {
                return self.token_came(now, sa, false, out);
            }
            Some(Telegram::Token { da, sa }) => {
                self.doubted = None;
                if self.ring.passed(sa, da) {
                    if skipped + 1 >= TWICE {
                        return self.leaves(now, RingExit::Skipped, out);
                    }
                    self.state = State::ActiveIdle { skipped: skipped + 1 };
                }
            }
            Some(Telegram::Data { header, .. }) => {
                self.answer_status(now, &header, StationType::MasterInRing, out);
            }
            _ => {}
        }
        Confirm::Nothing
    }
    /// The token is taken from PS at once, from another station when it comes a second time: then PS is gone.
    fn token_came(&mut self, now: Local, sa: Address, enters: bool, out: &mut Outbox) -> Confirm<'static> {
        if sa != self.ring.ps() && self.doubted != Some(sa) {
            self.doubted = Some(sa);
            return Confirm::Nothing;
        }
        self.doubted = None;
        self.ring.passed(sa, self.address);
        if enters {
            out.observe(Observation::RingEntered);
            self.ring.scan();
            self.timer.reset();
        }
        out.disarm(Timer::Slot);
        let t_rr = self.timer.received(now);
        out.observe(Observation::TokenReceived { t_rr, t_th: self.timer.t_th(now) });
        self.high_used = false;
        self.free_at = now + self.t_id1;
        self.state = State::UseToken;
        Confirm::TokenHeld
    }
    fn answer_status(&self, now: Local, request: &Header, station: StationType, out: &mut Outbox) {
        if request.da != self.address || !is_status_request(request) {
            return;
        }
        let fc = FrameControl::Response { station, status: Status::Ok };
        let header = Header { da: request.sa, sa: self.address, dsap: None, ssap: None, fc };
        // Model: an active station answers after min T_SDR, which every requester is ready for (T_RDY).
        out.send(now + self.bus.span(self.bus.min_tsdr), |frame| {
            frame.set_data(&header, &[]).expect("an empty reply fits");
        });
    }

    /// What was heard while this station has the token: none if nothing speaks against that. PS repeats the token
    /// when it has not heard this station yet.
    pub(super) fn disputed(
        &mut self,
        now: Local,
        telegram: Option<&Telegram<'_>>,
        out: &mut Outbox,
    ) -> Option<Confirm<'static>> {
        match telegram? {
            Telegram::Token { da, sa } => Some(self.another_speaks(now, *sa, *da == self.address, out)),
            Telegram::Data { header, .. }
                if matches!(header.fc, FrameControl::Request { .. }) || header.sa == self.address =>
            {
                Some(self.another_speaks(now, header.sa, false, out))
            }
            Telegram::Data { .. } | Telegram::ShortAck => None,
        }
    }
    /// `sa` speaks as if it had the token, or gives it to this station.
    #[cold]
    fn another_speaks(&mut self, now: Local, sa: Address, gives: bool, out: &mut Outbox) -> Confirm<'static> {
        if sa == self.address {
            self.leaves(now, RingExit::AddressConflict, out);
            return Confirm::TokenGone;
        }
        if gives {
            return Confirm::Nothing;
        }
        out.observe(Observation::TokenDropped { why: RingExit::SecondToken });
        self.await_silence(now, out);
        self.state = State::ActiveIdle { skipped: 0 };
        Confirm::TokenGone
    }
    /// Leaves the ring: from here on as after power on.
    fn leaves(&mut self, now: Local, why: RingExit, out: &mut Outbox) -> Confirm<'static> {
        out.observe(Observation::RingLeft { why });
        self.listens_again(now, out);
        let conflicts = u8::from(why == RingExit::AddressConflict);
        self.state = State::ListenToken { conflicts };
        Confirm::Nothing
    }
    /// The list is made anew.
    pub(super) fn listens_again(&mut self, now: Local, out: &mut Outbox) -> Confirm<'static> {
        self.ring.forget();
        self.doubted = None;
        self.state = State::ListenToken { conflicts: 0 };
        self.await_silence(now, out);
        Confirm::Nothing
    }
}

const fn is_status_request(header: &Header) -> bool {
    matches!(header.fc, FrameControl::Request { service: Service::FdlStatus, .. })
}
