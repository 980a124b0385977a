//! How a cycle begins, where it stops for the token, and what keeps the line alive in between.
//!
//! | master | token | what it does |
//! |---|---|---|
//! | isochronous | held | SYNCH on the grid of T_DP; silence before it, or GAP polls where others could claim the token |
//! | isochronous | passed on once in every cycle | waits; SYNCH is late if the token is, whole cycles are missed |
//! | isochronous | comes back | holds it until SYNCH; active spare: passes it on again while T_TR fits |
//! | free-running | comes | a poll cycle where the last one is over and long enough ago, else one acyclic message |
//! | free-running | T_TH over | passes it on and goes on with the same slave when it is back |
//! | free-running | comes after poll cycles that left no T_TH: eight for the message due after them, two for the GAP | that first |
//!
//! Model: T_TH does not limit an isochronous master, whose cycle is planned as a whole, nor a station alone. A master
//! that holds the token in silence is heard at least every 5 T_SL, which is less than the T_TO of any address, and
//! within T_SL of a token that it got, since its sender listens so long.

use super::{Application, Master, Part, STATUS_OCTETS};
use crate::dp::handler::Handler;
use crate::fdl::{Outbox, Timer};
use crate::observation::Observation;
use crate::time::{Local, Span};

/// Poll cycles in a row that may leave no time for a message. Model: no source has a number; the watchdogs of slaves last
/// tens of cycles.
const STARVED: u8 = 8;
/// Due polls of the GAP in a row that may be left out for lack of time. Model: EN 50170-2 p. 102 has them on one of the next
/// tokens.
const GAP_LEFT_OUT: u8 = 2;

/// What makes a master's cycles begin.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Pace {
    /// SYNCH every T_DP: isochronous mode.
    #[default]
    Synch,
    /// The token and the master itself.
    Free {
        /// From the start of one poll cycle to the next at least.
        least: Span,
    },
}

/// A free-running master's place in its poll cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Polling {
    /// The slave with which it goes on, where T_TH was over.
    stopped_at: Option<usize>,
    /// When the last cycle began, and the first instant of the next one by the least cycle time.
    began: Local,
    next: Local,
    /// Token visits.
    visits: u64,
    /// Poll cycles in a row with T_TH over before the message that was due after them.
    starved: u8,
    /// Polls of the GAP that T_TH left no time for when they were due.
    gap_left_out: u8,
    /// The running cycle's end is not told yet.
    open: bool,
}

impl Polling {
    pub(super) const fn new() -> Self {
        Self {
            stopped_at: None,
            began: Local::ZERO,
            next: Local::ZERO,
            visits: 0,
            starved: 0,
            gap_left_out: 0,
            open: false,
        }
    }
    /// Whether the next token is for what poll cycles left no time for.
    const fn is_starving(&self) -> bool {
        self.starved >= STARVED || self.gap_left_out >= GAP_LEFT_OUT
    }
}

impl<A: Application> Master<A> {
    pub(super) fn is_free(&self) -> bool {
        self.settings.pace != Pace::Synch
    }
    fn is_alone(&self) -> bool {
        self.active.ring().is_alone()
    }
    fn t_sl(&self) -> Span {
        self.settings.bus.span(self.settings.bus.t_sl)
    }

    /// The token is here.
    pub(super) fn token_held(&mut self, now: Local, out: &mut Outbox) {
        match self.part {
            Part::Starting => self.begin(now, out),
            _ if self.is_free() => self.visit(now, out),
            _ => self.back(now, out),
        }
    }
    /// The token is gone without having been passed: what was under way is given up.
    pub(super) fn token_gone(&mut self, out: &mut Outbox) {
        self.bereft |= self.part == Part::Clock;
        self.part = Part::Away;
        self.polling.stopped_at = None;
        out.disarm(Timer::Schedule);
    }
    /// After the first token, or the first since power on: the slaves are started up in Clear, and a clock starts one
    /// T_DP from here.
    fn begin(&mut self, now: Local, out: &mut Outbox) {
        self.begun = self.clock.coming();
        self.clock.restart(now + self.settings.t_dp);
        self.polling = Polling::new();
        self.set_mode(crate::observation::MasterMode::Clear, out);
        match self.settings.pace {
            Pace::Free { .. } => self.visit(now, out),
            Pace::Synch if self.is_alone() => self.spare(now, out),
            Pace::Synch => self.hold(now, out),
        }
    }
    /// A cycle begins at `now`. Returns its number and where it was aimed at.
    pub(super) fn started(&mut self, now: Local) -> (u64, Local) {
        self.polling.open = true;
        let (cycle, nominal) = self.clock.started(now);
        match self.settings.pace {
            Pace::Synch => {
                self.active.clock_sent(now);
                (cycle, nominal)
            }
            Pace::Free { least } => {
                self.active.not_before(now);
                (self.polling.began, self.polling.next) = (now, now + least);
                (cycle, now)
            }
        }
    }
    /// Whether something that keeps the bus busy for `span` may begin now: it ends early enough for the next SYNCH, or
    /// T_TH is not over.
    pub(super) fn fits(&self, span: Span) -> bool {
        let free = self.active.free_at();
        if self.is_free() {
            return self.is_alone() || self.active.may_high(free);
        }
        free + span + self.active.t_id1() <= self.clock.planned()
    }
    /// Whether a message with low priority may begin.
    pub(super) fn may_low(&self) -> bool {
        !self.is_free() || self.is_alone() || self.active.may_low(self.active.free_at())
    }

    // ----- isochronous

    /// Leaves out the cycles whose SYNCH is a whole T_DP and more late at `now`.
    pub(super) fn miss(&mut self, now: Local, out: &mut Outbox) {
        let cycles = self.clock.miss(now);
        if cycles > 0 {
            out.observe(Observation::SynchMissed { cycles });
        }
    }
    /// The token is back: whole cycles may have gone by.
    fn back(&mut self, now: Local, out: &mut Outbox) {
        self.miss(self.active.free_at().max(now), out);
        let t_tr = self.settings.bus.span(self.settings.bus.t_tr);
        if self.settings.active_spare && self.fits(t_tr) {
            return self.pass_on(out);
        }
        self.hold(now, out);
    }
    /// Holds a token that another station has passed: it listens for T_SL whether the token is taken.
    fn hold(&mut self, now: Local, out: &mut Outbox) {
        let answer = self.t_sl() - self.active.t_id1();
        if self.clock.planned() - now > answer { self.be_heard(now, out) } else { self.await_synch(now, out) }
    }
    fn pass_on(&mut self, out: &mut Outbox) {
        let end = self.active.pass_token(self.active.free_at(), out);
        if self.active.may_send() { self.spare(end, out) } else { self.part = Part::Away }
    }
    fn await_synch(&mut self, from: Local, out: &mut Outbox) {
        self.part = Part::Spare;
        out.arm(Timer::Schedule, from);
    }
    /// Silence from `from` to SYNCH, as far as others bear it.
    pub(super) fn spare(&mut self, from: Local, out: &mut Outbox) {
        let t_sl = self.t_sl();
        let others = self.settings.shared || !self.is_alone();
        if !others || self.clock.planned() - from <= t_sl * 4 {
            return self.await_synch(from, out);
        }
        self.part = Part::Silence;
        out.arm(Timer::Schedule, from + t_sl * 2);
    }
    /// Makes itself heard: a GAP poll, or where none fits a poll of PS, which answers soon.
    pub(super) fn be_heard(&mut self, now: Local, out: &mut Outbox) {
        let at = self.active.free_at().max(now);
        let room = self.fits(self.active.longest_cycle(STATUS_OCTETS, STATUS_OCTETS));
        let polled = if room { self.active.poll_gap(at, out) } else { None };
        match polled {
            Some(address) => self.part = Part::Alive(address),
            None if self.is_alone() => {
                let end = self.active.pass_token(at, out);
                self.spare(end, out);
            }
            None => {
                let ps = self.active.ring().ps();
                self.active.poll(at, ps, out);
                self.part = Part::Alive(ps);
            }
        }
    }

    // ----- free-running

    /// The token is here.
    pub(super) fn visit(&mut self, now: Local, out: &mut Outbox) {
        self.polling.visits += 1;
        self.active.not_before(now);
        let at = self.active.free_at();
        match self.polling.stopped_at.take() {
            Some(slave) => self.exchange(now, slave, out),
            None if at >= self.next_start() && !self.polling.is_starving() => {
                out.begin_cycle(at);
                self.part = Part::Clock;
            }
            None => {
                self.exchange_end = now;
                self.acyclic(now, out);
            }
        }
    }
    /// Counts how often T_TH was over though a slave's start-up or a job was due after the poll cycle. In the end it has a
    /// token of its own, else a T_TR that is just long enough for Data_Exchange would let no slave start up again, ever.
    pub(super) fn note_starving(&mut self) {
        if !self.is_free() || self.is_alone() {
            return;
        }
        let free = self.active.free_at();
        let starting = || self.handlers.iter().any(Handler::has_service);
        let (high_over, low_over) = (!self.active.may_high(free), !self.active.may_low(free));
        let starves = self.polling.open && ((high_over && starting()) || (low_over && !self.ms1.is_idle()));
        self.polling.starved = if starves { self.polling.starved + 1 } else { 0 };
    }
    /// First instant of the next cycle: from start to start at least the least cycle time, and the longest
    /// Min_Slave_Interval of the slaves that take part (EN 50170-2, bus parameters).
    fn next_start(&self) -> Local {
        let exchanging = self.handlers.iter().filter(|handler| handler.exchanges());
        let longest = exchanging.map(|handler| handler.params().min_interval).max();
        self.polling.next.max(self.polling.began + longest.unwrap_or(Span::ZERO))
    }
    /// Of a free-running master: whether T_TH is over before Data_Exchange with `slave`, or the slave may not be asked
    /// again for longer than T_SL, because the token was away between it and those before it: then the token goes on, and
    /// later so does the cycle.
    #[cold]
    pub(super) fn stops_before(&mut self, slave: usize, now: Local, out: &mut Outbox) -> bool {
        if self.is_alone() {
            return false;
        }
        let at = self.active.free_at().max(now);
        let too_early = self.handlers[slave].earliest().is_some_and(|earliest| earliest > at + self.t_sl());
        let stops = too_early || !self.active.may_high(at);
        if stops {
            self.polling.stopped_at = Some(slave);
            self.token(out);
        }
        stops
    }
    /// A station alone has the token again at once: the next visit is when something is due.
    fn rest(&mut self, end: Local, out: &mut Outbox) {
        let due = if self.polling.stopped_at.is_some() { end } else { self.next_start().max(end) };
        let at = if self.settings.shared { due.min(end + self.t_sl() * 2) } else { due };
        self.await_synch(at, out);
    }

    // ----- end of a cycle

    /// One address of the GAP where it is due and fits; then the token.
    pub(super) fn gap(&mut self, out: &mut Outbox) {
        let count = if self.is_free() { self.polling.visits } else { self.clock.coming() };
        let due = count.is_multiple_of(self.settings.bus.gap_factor.into())
            || self.active.ring().is_scanning()
            || self.polling.gap_left_out >= GAP_LEFT_OUT;
        let fits = due && self.may_low() && self.fits(self.active.longest_cycle(STATUS_OCTETS, STATUS_OCTETS));
        if due {
            let left_out = !fits && self.is_free() && self.polling.open;
            self.polling.gap_left_out = if left_out { self.polling.gap_left_out + 1 } else { 0 };
        }
        match if fits { self.active.poll_gap(self.active.free_at(), out) } else { None } {
            Some(address) => self.part = Part::Gap(address),
            None => self.token(out),
        }
    }
    /// Passes the token where it fits before SYNCH.
    pub(super) fn token(&mut self, out: &mut Outbox) {
        let free = self.active.free_at();
        let passes = self.is_free() || self.fits(self.settings.bus.rate.octets(3));
        let end = if passes { self.active.pass_token(free, out) } else { free };
        if core::mem::take(&mut self.polling.open) && self.polling.stopped_at.is_none() {
            let next = if self.is_free() { self.next_start() } else { self.clock.planned() };
            out.observe(Observation::CycleSpare {
                acyclic: end - self.exchange_end,
                spare: (next - end).max(Span::ZERO),
            });
        } else {
            self.polling.open = self.polling.stopped_at.is_some();
        }
        if !self.active.may_send() {
            self.part = Part::Away;
        } else if self.is_free() {
            self.rest(end, out);
        } else {
            self.idle(end, out);
        }
    }
    /// The cycle's work ends at `end`: silence, or further tokens (Model: D6).
    fn idle(&mut self, end: Local, out: &mut Outbox) {
        if !self.settings.active_spare {
            return self.spare(end, out);
        }
        self.part = Part::Token;
        out.arm(Timer::Schedule, end);
    }
    /// `Schedule` came due during active spare: another token, as far as it fits.
    pub(super) fn further_token(&mut self, now: Local, out: &mut Outbox) {
        if self.fits(self.settings.bus.rate.octets(3)) {
            let end = self.active.pass_token(self.active.free_at(), out);
            if self.active.may_send() { self.idle(end, out) } else { self.part = Part::Away }
        } else {
            self.spare(now, out);
        }
    }
}
