//! A class 2 master: a tool that enters the ring and asks slaves beside the master that parameterises them, over MS2
//! or by the reading services of DP-V0.
//!
//! | part | ends with | next part |
//! |---|---|---|
//! | Away | token here | Message; Gap or Away if there is none |
//! | Message | answer, or none after the repeats | Message while [`Settings::per_token`] and T_TH allow; Gap or Away |
//! | Gap | answer or none | Away, the token passed |
//! | Alone | `Schedule` due: the own token has left | as Away |
//! | any | token lost | Away |
//!
//! A message of MS2 has low priority and begins only while T_TH remains, one of DP-V0 has high priority: one of them
//! always goes (EN 50170-2). The slaves get their turn one after the other; each is asked one thing at a time, and
//! its connection is opened with the first request over MS2.

use alloc::vec::Vec;

use crate::dp::ms1::{self, Failure, Pdu};
use crate::dp::ms2::client::{self, Client, Progress};
use crate::dp::{GET_CFG, RD_INP, RD_OUTP, SLAVE_DIAG};
use crate::fdl::active::{Active, Confirm, HoldToken, Request};
use crate::fdl::params::BusParams;
use crate::fdl::{Filter, Input, Outbox, Station, Timer};
use crate::observation::{AcyclicResult, AcyclicService, ConnectionState, MasterClass, Observation};
use crate::time::{Local, Span};
use crate::wire::{Address, Sap, Service, Status};

/// SAPs of a reading service of DP-V0, which every master may use; none for what goes over MS2.
const fn saps(service: AcyclicService) -> Option<(Sap, Sap)> {
    match service {
        AcyclicService::Diagnosis => Some(SLAVE_DIAG),
        AcyclicService::Inputs => Some(RD_INP),
        AcyclicService::Outputs => Some(RD_OUTP),
        AcyclicService::Configuration => Some(GET_CFG),
        AcyclicService::RecordRead | AcyclicService::RecordWrite => None,
    }
}

/// What to ask of a slave.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[allow(clippy::large_enum_variant)] // One for each slave that is asked, and no heap.
pub enum Task {
    /// A request over MS2.
    Record(Pdu),
    /// A reading service of DP-V0.
    Read(AcyclicService),
}

/// What the class 2 master is used for. Slaves are named by their index in the list that it was made with.
pub trait Application {
    /// The supply came on.
    fn power_on(&mut self, now: Local);
    /// The next thing to ask of a slave, if there is one. Asked at each of its turns while nothing runs for it.
    fn next(&mut self, now: Local, slave: usize, out: &mut Outbox) -> Option<Task>;
    /// A task is over: the slave's answer, or why there is none.
    fn done(&mut self, now: Local, slave: usize, answer: Result<&[u8], Failure>, out: &mut Outbox);
}

/// What a class 2 master is told before it starts.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Station address.
    pub address: Address,
    /// Bus parameters.
    pub bus: BusParams,
    /// Messages in one token visit at most, 1 or more.
    pub per_token: u8,
    /// The slaves that it asks, each with what it asks of their connection.
    pub slaves: Vec<(Address, client::Settings)>,
}

/// A slave as this master sees it.
#[derive(Clone, Debug)]
struct Partner {
    connection: Client,
    task: Option<(Task, Local)>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Part {
    Away,
    /// A message to the slave of this index.
    Message(usize),
    Gap(Address),
    Alone,
}

/// A class 2 master.
#[derive(Clone, Debug)]
pub struct Class2<A> {
    settings: Settings,
    active: Active,
    app: A,
    partners: Vec<Partner>,
    part: Part,
    /// Whose turn it is.
    turn: usize,
    /// Messages that this token visit still may have.
    left: u8,
    /// Token visits since the last GAP poll.
    visits: u8,
}

impl<A: Application> Class2<A> {
    /// A master without supply.
    pub fn new(settings: Settings, app: A) -> Self {
        let partner = |&(slave, ms2)| Partner { connection: Client::new(slave, ms2), task: None };
        Self {
            active: Active::new(settings.address, settings.bus),
            app,
            partners: settings.slaves.iter().map(partner).collect(),
            part: Part::Away,
            turn: 0,
            left: 0,
            visits: 0,
            settings,
        }
    }
    /// The data link layer.
    pub const fn active(&self) -> &Active {
        &self.active
    }
    /// State of the connection to the slave of this index.
    pub fn connection(&self, slave: usize) -> ConnectionState {
        self.partners[slave].connection.state()
    }

    fn power_on(&mut self, now: Local, out: &mut Outbox) {
        for (partner, &(slave, ms2)) in self.partners.iter_mut().zip(&self.settings.slaves) {
            *partner = Partner { connection: Client::new(slave, ms2), task: None };
        }
        self.active = Active::new(self.settings.address, self.settings.bus);
        self.part = Part::Away;
        self.app.power_on(now);
        self.active.power_on(now, out);
    }

    fn confirmed(&mut self, now: Local, confirm: Confirm<'_>, out: &mut Outbox) {
        match (self.part, confirm) {
            (_, Confirm::Nothing) => {}
            (_, Confirm::TokenHeld) => self.visit(now, out),
            (Part::Message(slave), Confirm::TokenGone) => {
                self.part = Part::Away;
                self.answered(now, slave, Confirm::NoReply, out);
            }
            (_, Confirm::TokenGone) => self.part = Part::Away,
            (Part::Message(slave), confirm) => {
                self.answered(now, slave, confirm, out);
                self.goes_on(now, out);
            }
            (Part::Gap(address), Confirm::Gap(answer)) => {
                out.observe(Observation::Gap { address, answer });
                self.pass(now, out);
            }
            (part, confirm) => unreachable!("{confirm:?} during {part:?}: the active station answers requests only"),
        }
    }
    /// The token is here.
    fn visit(&mut self, now: Local, out: &mut Outbox) {
        self.left = self.settings.per_token;
        self.visits = self.visits.saturating_add(1);
        self.goes_on(now, out);
    }
    /// The next message of this visit, the GAP, or the end of it.
    fn goes_on(&mut self, now: Local, out: &mut Outbox) {
        let at = self.active.free_at().max(now);
        if self.left > 0 && self.message(now, at, out) {
            self.left -= 1;
            return;
        }
        let due = self.visits >= self.settings.bus.gap_factor || self.active.ring().is_scanning();
        if due && self.active.may_gap(at) {
            self.visits = 0;
            if let Some(address) = self.active.poll_gap(at, out) {
                self.part = Part::Gap(address);
                return;
            }
        }
        self.pass(now, out);
    }
    fn pass(&mut self, now: Local, out: &mut Outbox) {
        let end = self.active.pass_token(self.active.free_at().max(now), out);
        self.part = Part::Away;
        if self.active.may_send() {
            self.part = Part::Alone;
            out.arm(Timer::Schedule, end);
        }
    }

    /// A message to the first slave from the one whose turn it is that has one; whether there was any.
    fn message(&mut self, now: Local, at: Local, out: &mut Outbox) -> bool {
        let (count, turn) = (self.partners.len(), self.turn);
        for slave in (0..count).map(|i| (turn + i) % count) {
            self.prepare(now, slave, out);
            if self.send(now, at, slave, out) {
                self.turn = (slave + 1) % count;
                self.part = Part::Message(slave);
                return true;
            }
        }
        false
    }
    /// Finds something to do for a slave and opens its connection where that needs one.
    fn prepare(&mut self, now: Local, slave: usize, out: &mut Outbox) {
        if let Progress::Over { why, .. } = self.partners[slave].connection.overdue(now, out) {
            self.fail(now, slave, why, out);
        }
        let partner = &mut self.partners[slave];
        if partner.task.is_none() {
            partner.task = self.app.next(now, slave, out).map(|task| (task, now));
        }
        match (partner.task, partner.connection.state()) {
            (Some((Task::Record(_), _)), ConnectionState::Closed) => partner.connection.connect(now, out),
            (Some((Task::Record(pdu), _)), ConnectionState::Open) => partner.connection.begin(now, pdu),
            _ => {}
        }
    }
    fn send(&mut self, now: Local, at: Local, slave: usize, out: &mut Outbox) -> bool {
        let (high, low) = (self.active.may_high(at), self.active.may_low(at));
        let Partner { connection, task } = &mut self.partners[slave];
        let (to, retries) = (connection.slave(), self.settings.bus.max_retry_limit);
        if let Some((Task::Read(service), _)) = task {
            let request = Request { to, service: Service::SrdHigh, saps: saps(*service), retries };
            if high {
                self.active.request(at, &request, 0, out, |_| ());
            }
            return high;
        }
        let Some(sending) = connection.next(now).filter(|_| low) else { return false };
        let saps = Some((sending.sap, Sap::MASTER_MS2));
        let request = Request { to, service: Service::SrdLow, saps, retries };
        self.active.request(at, &request, sending.du.len(), out, |du| du.copy_from_slice(sending.du));
        true
    }

    fn answered(&mut self, now: Local, slave: usize, confirm: Confirm<'_>, out: &mut Outbox) {
        let answer = match confirm {
            Confirm::Acknowledged => Ok(None),
            Confirm::Reply { status: Status::Dl | Status::Dh, du } => Ok(Some(du)),
            Confirm::Reply { status, .. } => Err(Some(status)),
            _ => Err(None),
        };
        if let Some((Task::Read(_), _)) = self.partners[slave].task {
            return self.was_read(now, slave, answer, out);
        }
        match self.partners[slave].connection.answered(now, answer, out) {
            Progress::Going | Progress::Opened => {}
            Progress::Done(pdu) => self.done(now, slave, Ok(pdu), ms1::result(Ok(pdu)), out),
            Progress::Over { why, .. } => self.fail(now, slave, why, out),
        }
    }
    /// A service of DP-V0 is over with its first answer. SC is an answer without data.
    fn was_read(&mut self, now: Local, slave: usize, answer: Result<Option<&[u8]>, Option<Status>>, out: &mut Outbox) {
        match answer {
            Ok(du) => self.done(now, slave, Ok(du.unwrap_or(&[])), AcyclicResult::Positive, out),
            Err(Some(_)) => {
                out.observe(Observation::IllegalAnswer { slave: self.partners[slave].connection.slave() });
                self.done(now, slave, Err(Failure::Closed), AcyclicResult::Negative, out);
            }
            Err(None) => self.done(now, slave, Err(Failure::Timeout), AcyclicResult::Timeout, out),
        }
    }
    fn fail(&mut self, now: Local, slave: usize, why: Failure, out: &mut Outbox) {
        // Also the task that has waited for its connection; an Idle has none.
        if self.partners[slave].task.is_some() {
            self.done(now, slave, Err(why), ms1::result(Err(why)), out);
        }
    }
    fn done(
        &mut self,
        now: Local,
        slave: usize,
        answer: Result<&[u8], Failure>,
        result: AcyclicResult,
        out: &mut Outbox,
    ) {
        let partner = &mut self.partners[slave];
        let took = partner.task.take().map_or(Span::ZERO, |(_, since)| now - since);
        let (slave_address, class) = (partner.connection.slave(), MasterClass::Two);
        out.observe(Observation::AcyclicDone { slave: slave_address, class, result, took });
        self.app.done(now, slave, answer, out);
    }
}

impl<A: Application> Station for Class2<A> {
    type Command = HoldToken;

    fn address(&self) -> Address {
        self.settings.address
    }
    fn filter(&self) -> Filter {
        Filter::all(self.settings.address)
    }
    fn step(&mut self, now: Local, input: Input<'_, Self::Command>, out: &mut Outbox) {
        match input {
            Input::PowerOn => self.power_on(now, out),
            Input::Telegram(heard) => {
                let confirm = self.active.heard(now, heard, out);
                self.confirmed(now, confirm, out);
            }
            Input::Deadline { timer: Timer::Slot, busy } => {
                let confirm = self.active.slot_over(now, busy, out);
                self.confirmed(now, confirm, out);
            }
            Input::Deadline { timer: Timer::Schedule, .. } if self.part == Part::Alone => self.visit(now, out),
            Input::Deadline { .. } | Input::Sent | Input::Sample(_) => {}
            Input::Command(order) => self.active.hold_token(order),
        }
    }
}

#[cfg(test)]
mod tests;
