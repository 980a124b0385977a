//! The class 1 master: operation modes, the isochronous cycle, one handler per slave.
//!
//! One cycle (Model: D6), `t0` being the last bit of SYNCH:
//!
//! ```text
//! SYNCH | Data_Exchange in address order | one acyclic message | GAP, every G-th cycle | token | silence | SYNCH
//!       t0                               T_DX
//! ```
//!
//! The acyclic message is one service for a slave that starts up, or one of the acyclic job; where the mode has to be
//! told or Sync and Freeze were ordered, Global_Controls come before it. A slave that gets on is served until it exchanges data, then the next one: from Set_Prm on its watchdog
//! runs, and a cycle has time for one service only.
//!
//! | part | ends with | next part |
//! |---|---|---|
//! | Starting | token claimed | Spare, first SYNCH one T_DP later |
//! | Spare | `Schedule` due | Clock: SYNCH on its way |
//! | Clock | its last bit has left | Exchange with the first slave |
//! | Exchange | answer or none after the repeats | Exchange with the next slave; after the last Control, Startup or Acyclic |
//! | Control | end of the Global_Control | another Control, Startup or Acyclic |
//! | Startup, Acyclic | answer or none | Gap |
//! | Gap | answer or none | alone: Spare, the token sent; Token where the spare time is active; in a ring: Away |
//! | Token | `Schedule` due | Token, another token sent, while one fits; then Spare |
//! | Away | token held | Alive, or Spare where SYNCH is near; free-running: Clock, or Exchange where it stopped |
//! | Spare | others could claim the token before SYNCH | Silence |
//! | Silence | `Schedule` due | Alive: an FDL status request on its way |
//! | Alive | answer or none | Spare |
//! | any with the token | token gone | Away |
//!
//! A free-running master has no SYNCH: its Clock ends with the first bit of a poll cycle, see `master/cycle.rs`.
//!
//! Where a slave's diagnosis is due, Slave_Diag takes the place of its Data_Exchange, or is the acyclic message; see
//! [`handler`](crate::dp::handler). When the mode changes without an order says
//! [`supervision`](crate::dp::supervision).
//!
//! A part that has nothing to do, or whose longest course would not end before the next SYNCH, is left out. The scenario may
//! order acyclic messages that keep no such rule, see `master/overlong.rs`.

mod cycle;
mod overlong;

use alloc::vec::Vec;

pub use cycle::Pace;
use cycle::Polling;
use overlong::Overload;
pub use overlong::Overlong;

use crate::dp::handler::{Answer, Handler, Patch, SAP_FRAME_OCTETS, SlaveParams, StartupTelegram};
use crate::dp::iso::{CycleClock, Rearm};
use crate::dp::ms1::{self, Client, Failure, Job, MS1, Progress};
use crate::dp::supervision::Supervision;
use crate::dp::{GLOBAL_CONTROL, SLAVE_DIAG};
use crate::fdl::active::{Active, Confirm, HoldToken, Request};
use crate::fdl::params::BusParams;
use crate::fdl::{Filter, Heard, Input, Outbox, Station, Timer};
use crate::observation::{HandlerState, MasterClass, MasterMode, Observation};
use crate::time::{Local, Span};
use crate::wire::control::GlobalControl;
use crate::wire::{Address, Frame, Service, Status, Telegram};

/// Characters of a Global_Control telegram.
const GC_OCTETS: usize = 13;
/// Characters of an FDL status request and its answer.
const STATUS_OCTETS: usize = 6;

/// The program behind the master: it makes outputs and takes inputs. Slaves are named by their index in the list
/// the master was made with.
pub trait Application {
    /// What the scenario may order it to do.
    type Command: Copy;

    /// Its master has supply again: what it was ordered before is forgotten.
    fn power_on(&mut self, out: &mut Outbox);
    /// A cycle begins.
    fn cycle(&mut self, cycle: u64, mode: MasterMode, out: &mut Outbox);
    /// Writes the outputs for a slave. Not called in Clear.
    fn outputs(&mut self, slave: usize, du: &mut [u8]);
    /// A slave's inputs of this cycle, or none where nothing valid came.
    fn inputs(&mut self, slave: usize, inputs: Option<&[u8]>, out: &mut Outbox);
    /// A slave joined data exchange, or left it.
    fn joined(&mut self, slave: usize, joined: bool, out: &mut Outbox);
    /// The next acyclic job, if there is one. Asked whenever the one before is over.
    fn acyclic(&mut self) -> Option<Job>;
    /// An acyclic job is over: the slave's answer, or why there is none.
    fn acyclic_done(&mut self, slave: usize, answer: Result<&[u8], Failure>, out: &mut Outbox);
    /// The scenario orders something.
    fn command(&mut self, command: Self::Command, out: &mut Outbox);
}

/// An order of the scenario to a master.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Order<C> {
    /// Another operation mode: Clear or Operate.
    Mode(MasterMode),
    /// A slave is started anew, with this telegram changed.
    Patch(Address, StartupTelegram, Patch),
    /// Sync, Freeze and their ends, for these groups. Whether it is Clear or Operate, the master adds.
    Control(GlobalControl),
    /// Tokens are kept longer.
    HoldToken(HoldToken),
    /// DS-Write in every cycle, whether it fits or not, or no more. The supply ends it too.
    Overlong(Option<Overlong>),
    /// Something for its application.
    Application(C),
}

/// What a master is told before it starts.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Station address.
    pub address: Address,
    /// Bus parameters.
    pub bus: BusParams,
    /// T_DP; of a free-running master the cycle time that is planned.
    pub t_dp: Span,
    /// Whether cycles begin with SYNCH.
    pub pace: Pace,
    /// Other active stations belong to this bus, in the ring or not yet: silence is never as long as their T_TO.
    pub shared: bool,
    /// How the next cycle start is found.
    pub rearm: Rearm,
    /// Repeats of an unanswered Data_Exchange (Model: D7).
    pub dx_retries: u8,
    /// Cycles in a row without answer after which a slave is given up. Model: none of the sources has a number.
    pub lost_after: u16,
    /// Cycles in Clear before Operate.
    pub clear_for: u64,
    /// Whether further tokens to itself fill the spare time as far as they fit (Model: D6).
    pub active_spare: bool,
    /// Data_Control_Time; the mode is told to the slaves at least every third of it (Model: D5).
    pub data_control_time: Span,
    /// Error_Action_Flag: back to Clear when a slave misses Data_Exchange for Data_Control_Time.
    pub auto_clear: bool,
    /// The slaves, in the order in which they are polled.
    pub slaves: Vec<SlaveParams>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Part {
    Starting,
    Spare,
    Clock,
    /// Data_Exchange with the slave of this index.
    Exchange(usize),
    /// The start-up service of the slave of this index.
    Startup(usize),
    /// A request or poll of the acyclic job.
    Acyclic,
    /// Global_Control is on its way.
    Control,
    Gap(Address),
    /// A further token in active spare time.
    Token,
    /// The token is elsewhere.
    Away,
    /// The token is held in silence, a poll is scheduled.
    Silence,
    /// A poll of this address, to be heard.
    Alive(Address),
}

/// A class 1 master.
#[derive(Clone, Debug)]
pub struct Master<A> {
    settings: Settings,
    active: Active,
    clock: CycleClock,
    mode: MasterMode,
    handlers: Vec<Handler>,
    part: Part,
    app: A,
    /// The clock telegram: it says the same in Clear and Operate (Model: D5).
    synch: Frame,
    /// Start of the running cycle.
    t0: Local,
    /// Last bit of the last Data_Exchange answer, or t0.
    exchange_end: Local,
    exchanged: bool,
    /// The mode has to be told to the slaves.
    control_due: bool,
    /// Cycle in which it was told last, and after how many it is told again.
    control_told: u64,
    control_every: u64,
    /// Commands that were ordered and not sent yet, the first one first.
    commands: Vec<GlobalControl>,
    supervision: Supervision,
    /// Where the search for the next slave in start-up begins.
    startup_next: usize,
    ms1: Client,
    overload: Overload,
    /// Number of the first cycle since power on.
    begun: u64,
    polling: Polling,
    /// The token went while SYNCH, or a free-running cycle's start, was on its way: it cannot be called back.
    bereft: bool,
}

impl<A: Application> Master<A> {
    /// A master without supply.
    pub fn new(settings: Settings, app: A) -> Self {
        let t_gc = settings.bus.rate.octets(GC_OCTETS);
        let active = Active::new(settings.address, settings.bus);
        let third = Span::from_ticks(settings.data_control_time.ticks() / 3);
        Self {
            synch: active.clock(GLOBAL_CONTROL, &GlobalControl::SYNCH_OCTETS),
            active,
            clock: CycleClock::new(settings.t_dp, t_gc, settings.rearm, Local::ZERO),
            mode: MasterMode::Offline,
            handlers: settings.slaves.iter().cloned().map(Handler::new).collect(),
            part: Part::Starting,
            app,
            t0: Local::ZERO,
            exchange_end: Local::ZERO,
            exchanged: false,
            control_due: true,
            control_told: 0,
            // Never in every cycle: slaves start up in the acyclic part too.
            control_every: third.div_floor(settings.t_dp).max(2) as u64,
            commands: Vec::new(),
            supervision: Supervision::new(settings.auto_clear, settings.data_control_time, settings.clear_for),
            startup_next: 0,
            ms1: Client::new(),
            overload: Overload::default(),
            begun: 0,
            polling: Polling::new(),
            bereft: false,
            settings,
        }
    }
    /// Operation mode now.
    pub const fn mode(&self) -> MasterMode {
        self.mode
    }
    /// What the master knows of its slaves.
    pub fn handlers(&self) -> &[Handler] {
        &self.handlers
    }
    /// The application.
    pub const fn application(&self) -> &A {
        &self.app
    }

    fn set_mode(&mut self, to: MasterMode, out: &mut Outbox) {
        let from = core::mem::replace(&mut self.mode, to);
        if from != to {
            out.observe(Observation::MasterMode { from, to });
            self.control_due = true;
        }
    }

    fn power_on(&mut self, now: Local, out: &mut Outbox) {
        // What it knew of its slaves is gone, and so is its application's cycle with them.
        for slave in 0..self.handlers.len() {
            if self.handlers[slave].exchanges() {
                self.app.joined(slave, false, out);
            }
            self.handlers[slave].restart(out);
            self.give_up_job(slave, out);
        }
        self.app.power_on(out);
        self.commands.clear();
        self.overload.end();
        self.supervision.restart();
        (self.control_due, self.control_told, self.startup_next) = (true, 0, 0);
        self.active = Active::new(self.settings.address, self.settings.bus);
        (self.part, self.bereft) = (Part::Starting, false);
        self.set_mode(MasterMode::Offline, out);
        self.active.power_on(now, out);
    }

    /// Goes on after whatever is no reply to Data_Exchange.
    #[cold]
    fn confirmed(&mut self, now: Local, confirm: Confirm<'_>, out: &mut Outbox) {
        match (self.part, confirm) {
            (_, Confirm::Nothing) => {}
            (_, Confirm::TokenHeld) => self.token_held(now, out),
            (_, Confirm::TokenGone) => self.token_gone(out),
            (Part::Exchange(slave), confirm) => {
                self.exchange_failed(now, slave, confirm, out);
                self.exchange(now, slave + 1, out);
            }
            (Part::Startup(slave), confirm) => {
                self.startup_answered(slave, confirm, out);
                self.after_message(now, out);
            }
            (Part::Acyclic, confirm) => {
                self.acyclic_answered(now, confirm, out);
                self.after_message(now, out);
            }
            (Part::Gap(address), Confirm::Gap(answer)) => {
                out.observe(Observation::Gap { address, answer });
                self.token(out);
            }
            (Part::Alive(address), Confirm::Gap(answer)) => {
                out.observe(Observation::Gap { address, answer });
                self.spare(now, out);
            }
            (part, confirm) => unreachable!("{confirm:?} during {part:?}: the active station answers requests only"),
        }
    }

    /// `Schedule` came due.
    fn scheduled(&mut self, now: Local, out: &mut Outbox) {
        match self.part {
            Part::Spare if self.settings.pace == Pace::Synch => self.synch(now, out),
            Part::Spare => self.visit(now, out),
            Part::Silence => self.be_heard(now, out),
            Part::Control => self.acyclic(now, out),
            Part::Token => self.further_token(now, out),
            _ => {}
        }
    }

    fn synch(&mut self, now: Local, out: &mut Outbox) {
        let free = self.active.free_at().max(now);
        self.miss(free, out);
        let planned = self.clock.planned();
        let at = planned.max(free);
        if at > planned {
            out.observe(Observation::ClockLate { by: at - planned });
        }
        self.active.send_clock(at, &self.synch, out);
        self.part = Part::Clock;
    }

    /// The last bit of SYNCH left at `now`, or the first bit of a free-running master's cycle does: it begins.
    fn clock_sent(&mut self, now: Local, out: &mut Outbox) {
        self.cycle_begins(now, out);
        self.exchange(now, 0, out);
    }
    /// A cycle has its number even if the token went before its start: slaves hear SYNCH all the same.
    fn cycle_begins(&mut self, now: Local, out: &mut Outbox) {
        self.bereft = false;
        let (cycle, nominal) = self.started(now);
        self.t0 = now;
        self.exchange_end = now;
        self.exchanged = false;
        self.active.count_anew();
        self.overload.cycle_begins();
        out.observe(Observation::CycleStart { cycle, nominal });
        let (mode, to_blame) = self.supervision.cycle(now, cycle - self.begun, self.mode, &self.handlers);
        if let Some(slave) = to_blame {
            out.observe(Observation::AutoClear { slave: self.handlers[slave].params().address });
        }
        self.set_mode(mode, out);
        self.app.cycle(cycle, self.mode, out);
    }

    /// Data_Exchange with the first slave from index `from` on that takes part.
    fn exchange(&mut self, now: Local, from: usize, out: &mut Outbox) {
        let Some(slave) = (from..self.handlers.len()).find(|&slave| self.handlers[slave].exchanges()) else {
            return self.exchange_done(out);
        };
        if self.is_free() && self.stops_before(slave, now, out) {
            return;
        }
        self.exchanged = true;
        self.part = Part::Exchange(slave);
        let (handler, app) = (&mut self.handlers[slave], &mut self.app);
        let free = self.active.free_at().max(now);
        let at = handler.earliest().map_or(free, |earliest| earliest.max(free));
        handler.asked(at);
        if handler.diagnosis_in_place() {
            return self.diagnose_in_place(at, slave, out);
        }
        if self.mode != MasterMode::Operate {
            return self.exchange_in_clear(at, slave, out);
        }
        let (request, outputs) = (handler.exchange(self.settings.dx_retries), handler.params().outputs);
        self.active.request(at, &request, outputs.into(), out, |du| app.outputs(slave, du));
    }
    /// Data_Exchange without outputs, or with zeros in their place.
    #[cold]
    fn exchange_in_clear(&mut self, at: Local, slave: usize, out: &mut Outbox) {
        let handler = &self.handlers[slave];
        let (request, params) = (handler.exchange(self.settings.dx_retries), handler.params());
        let outputs = if params.fail_safe { 0 } else { params.outputs };
        self.active.request(at, &request, outputs.into(), out, |_| ());
    }
    #[cold]
    fn diagnose_in_place(&mut self, at: Local, slave: usize, out: &mut Outbox) {
        let request = self.handlers[slave].exchange(self.settings.dx_retries);
        let request = Request { service: Service::SrdHigh, saps: Some(SLAVE_DIAG), ..request };
        self.active.request(at, &request, 0, out, |_| ());
    }
    #[inline]
    fn exchange_answered(&mut self, now: Local, slave: usize, (status, du): (Status, &[u8]), out: &mut Outbox) {
        let handler = &mut self.handlers[slave];
        let good = matches!(status, Status::Dl | Status::Dh) && du.len() == usize::from(handler.params().inputs);
        if good && !handler.diagnosis_in_place() {
            self.exchange_end = now;
            handler.exchanged(now, status == Status::Dh, out);
            self.app.inputs(slave, Some(du), out);
        } else {
            self.exchange_failed(now, slave, Confirm::Reply { status, du }, out);
        }
    }
    /// Data_Exchange, or the diagnosis in its place, was not answered with inputs.
    #[cold]
    fn exchange_failed(&mut self, now: Local, slave: usize, confirm: Confirm<'_>, out: &mut Outbox) {
        self.exchange_end = now;
        let handler = &mut self.handlers[slave];
        let expected = usize::from(handler.params().inputs);
        let lost = match confirm {
            Confirm::Reply { status: Status::Dl | Status::Dh, du } if handler.diagnosis_in_place() => {
                handler.answered(Answer::Data(du), out);
                !handler.exchanges()
            }
            Confirm::Acknowledged if expected == 0 => return handler.exchanged(now, false, out),
            Confirm::NoReply => handler.missed(self.settings.lost_after, out),
            Confirm::Reply { status: Status::Rs, .. } => handler.refused(out),
            _ => {
                out.observe(Observation::IllegalAnswer { slave: handler.params().address });
                handler.refused(out)
            }
        };
        self.app.inputs(slave, None, out);
        if lost {
            self.left(slave, out);
        }
    }
    fn exchange_done(&mut self, out: &mut Outbox) {
        if self.exchanged {
            let retries = self.active.repeats();
            out.observe(Observation::ExchangeDone { t_dx: self.exchange_end - self.t0, retries });
        }
        self.acyclic(self.exchange_end, out);
    }

    /// The acyclic part of this cycle: the mode if it is due, commands, then one message (Model: D6).
    fn acyclic(&mut self, now: Local, out: &mut Outbox) {
        let since = self.clock.coming().saturating_sub(self.control_told);
        let control = self.control_due || since >= self.control_every;
        self.note_starving();
        let rate = self.settings.bus.rate;
        let fits = (control || !self.commands.is_empty())
            && self.fits(rate.octets(GC_OCTETS) + self.settings.bus.span(self.settings.bus.t_id2()));
        match self.commands.first() {
            _ if !fits => self.message(now, out),
            _ if control => self.tell_mode(out),
            Some(&command) => self.tell(command, out),
            None => self.message(now, out),
        }
    }
    /// The one acyclic message: a slave's start-up and the acyclic job in turn; then the GAP.
    fn message(&mut self, now: Local, out: &mut Outbox) {
        let mut slaves = (self.startup_next..self.handlers.len()).chain(0..self.startup_next);
        let starting = slaves.find(|&slave| self.handlers[slave].has_service());
        // Also where the cycle had no time to ask.
        let since = self.ms1.since().unwrap_or(now);
        if let Some(slave) = self.ms1.overdue(now) {
            self.acyclic_done((now - since, slave), Err(Failure::Timeout), out);
        }
        if self.ms1.is_idle() {
            self.next_job(now);
        }
        match starting {
            Some(slave) if self.ms1.is_idle() || self.clock.coming().is_multiple_of(2) => self.startup(now, slave, out),
            _ if !self.ms1.is_idle() => self.acyclic_message(out),
            _ => self.gap(out),
        }
    }
    fn acyclic_message(&mut self, out: &mut Outbox) {
        let heedless = self.overload.is_ordered();
        let Some((slave, du)) = self.ms1.next().filter(|_| heedless || self.may_low()) else { return self.gap(out) };
        let longest = SAP_FRAME_OCTETS + self.ms1.longest_answer();
        let fitting = self.retries_that_fit(SAP_FRAME_OCTETS + du.len(), longest);
        let Some(retries) = fitting.or(heedless.then_some(0)) else { return self.gap(out) };
        self.overload.sends(du);
        let to = self.handlers[slave].params().address;
        let request = Request { to, service: Service::SrdLow, saps: Some(MS1), retries };
        self.active.request(self.active.free_at(), &request, du.len(), out, |to| to.copy_from_slice(du));
        self.part = Part::Acyclic;
    }
    fn acyclic_answered(&mut self, now: Local, confirm: Confirm<'_>, out: &mut Outbox) {
        let answer = match confirm {
            Confirm::Acknowledged => Ok(None),
            Confirm::Reply { status: Status::Dl | Status::Dh, du } => Ok(Some(du)),
            Confirm::Reply { status, .. } => Err(Some(status)),
            _ => Err(None),
        };
        let since = self.ms1.since().unwrap_or(now);
        match self.ms1.answered(now, answer) {
            Progress::Going => {}
            Progress::Done { slave, pdu } => self.acyclic_done((now - since, slave), Ok(pdu), out),
            Progress::Failed { slave, why } => self.acyclic_done((now - since, slave), Err(why), out),
        }
    }
    /// An acyclic job is over after `took`.
    fn acyclic_done(&mut self, (took, slave): (Span, usize), answer: Result<&[u8], Failure>, out: &mut Outbox) {
        let (address, class) = (self.handlers[slave].params().address, MasterClass::One);
        out.observe(Observation::AcyclicDone { slave: address, class, result: ms1::result(answer), took });
        if !self.overload.over() {
            self.app.acyclic_done(slave, answer, out);
        }
    }
    /// How often a request of `octets` characters with an answer of up to `reply` may be repeated before the next
    /// SYNCH; none if it does not fit once.
    fn retries_that_fit(&self, octets: usize, reply: usize) -> Option<u8> {
        let once = self.active.longest_cycle(octets, reply);
        let limit = self.settings.bus.max_retry_limit;
        let all = (once + self.active.t_id1()) * (i64::from(limit) + 1);
        self.fits(once).then_some(if self.fits(all) { limit } else { 0 })
    }
    fn tell_mode(&mut self, out: &mut Outbox) {
        self.control_due = false;
        self.control_told = self.clock.coming();
        self.control(GlobalControl::OPERATE, out);
    }
    /// The command that was ordered first.
    fn tell(&mut self, command: GlobalControl, out: &mut Outbox) {
        self.commands.remove(0);
        let octets = self.control(command, out);
        out.observe(Observation::Control { octets });
    }
    /// Sends a Global_Control, which always says Clear or Operate too.
    fn control(&mut self, control: GlobalControl, out: &mut Outbox) -> [u8; GlobalControl::LEN] {
        let octets = GlobalControl { clear: self.mode != MasterMode::Operate, ..control }.emit();
        let end = self.active.broadcast(self.active.free_at(), Address::BROADCAST, GLOBAL_CONTROL, &octets, out);
        self.part = Part::Control;
        out.arm(Timer::Schedule, end);
        octets
    }
    fn startup(&mut self, now: Local, slave: usize, out: &mut Outbox) {
        let handler = &self.handlers[slave];
        let (saps, du, reply) = handler.service();
        let Some(retries) = self.retries_that_fit(SAP_FRAME_OCTETS + du.len(), SAP_FRAME_OCTETS + reply) else {
            return self.after_message(now, out);
        };
        let request = Request { to: handler.params().address, service: Service::SrdHigh, saps: Some(saps), retries };
        self.active.request(self.active.free_at(), &request, du.len(), out, |to| to.copy_from_slice(du));
        self.part = Part::Startup(slave);
    }
    fn startup_answered(&mut self, slave: usize, confirm: Confirm<'_>, out: &mut Outbox) {
        let answer = match confirm {
            Confirm::Reply { status: Status::Dl | Status::Dh, du } => Answer::Data(du),
            Confirm::Reply { status, .. } => Answer::Refused(status),
            Confirm::Acknowledged => Answer::Acknowledged,
            _ => Answer::Nothing,
        };
        let handler = &mut self.handlers[slave];
        let before = handler.state();
        if handler.answered(answer, out) {
            self.app.joined(slave, true, out);
            // The newcomer has not heard the mode yet.
            self.control_due = true;
        } else if before == HandlerState::DataExchange && !handler.exchanges() {
            self.left(slave, out);
        }
        let gets_on = self.handlers[slave].state() > before;
        self.startup_next = if gets_on { slave } else { slave + 1 };
    }

    fn patch(&mut self, slave: Address, telegram: StartupTelegram, patch: &Patch, out: &mut Outbox) {
        let found = self.handlers.iter().position(|handler| handler.params().address == slave);
        let Some(slave) = found else { return };
        let joined = self.handlers[slave].exchanges();
        self.handlers[slave].patch(telegram, patch, out);
        if joined {
            self.left(slave, out);
        }
    }
    /// A slave is not in data exchange any more.
    fn left(&mut self, slave: usize, out: &mut Outbox) {
        self.app.joined(slave, false, out);
        self.give_up_job(slave, out);
    }
    fn give_up_job(&mut self, slave: usize, out: &mut Outbox) {
        let since = self.ms1.since();
        if self.ms1.left(slave) {
            let took = since.map_or(Span::ZERO, |since| (self.exchange_end - since).max(Span::ZERO));
            self.acyclic_done((took, slave), Err(Failure::Left), out);
        }
    }
}

impl<A: Application> Station for Master<A> {
    type Command = Order<A::Command>;

    fn address(&self) -> Address {
        self.settings.address
    }
    fn filter(&self) -> Filter {
        Filter::all(self.settings.address)
    }
    fn step(&mut self, now: Local, input: Input<'_, Self::Command>, out: &mut Outbox) {
        match input {
            Input::Command(order) => self.order(order, out),
            input => self.take(now, input, out),
        }
    }
}

impl<A: Application> Master<A> {
    /// As [`Station::step`], but for orders: those are ignored here and taken by [`order`](Self::order).
    pub fn take<C: Copy>(&mut self, now: Local, input: Input<'_, C>, out: &mut Outbox) {
        match input {
            Input::Telegram(heard) => self.heard(now, heard, out),
            _ => self.take_other(now, input, out),
        }
    }
    #[inline(never)]
    fn heard(&mut self, now: Local, heard: Heard<'_>, out: &mut Outbox) {
        let parsed = Telegram::parse(heard.octets);
        if let Ok(telegram) = &parsed
            && let Some((status, du)) = self.active.replied(now, telegram, out)
        {
            if let Part::Exchange(slave) = self.part {
                self.exchange_answered(now, slave, (status, du), out);
                self.exchange(now, slave + 1, out);
            } else {
                self.confirmed(now, Confirm::Reply { status, du }, out);
            }
        } else {
            let confirm = self.active.heard_other(now, parsed.as_ref().ok(), out);
            self.confirmed(now, confirm, out);
        }
    }
    /// Takes what is no telegram.
    #[inline(never)]
    fn take_other<C: Copy>(&mut self, now: Local, input: Input<'_, C>, out: &mut Outbox) {
        match input {
            Input::PowerOn => self.power_on(now, out),
            Input::Sent if self.part == Part::Clock => self.clock_sent(now, out),
            Input::Sent if self.bereft => self.cycle_begins(now, out),
            Input::Deadline { timer: Timer::Slot, busy } => {
                let confirm = self.active.slot_over(now, busy, out);
                self.confirmed(now, confirm, out);
            }
            Input::Deadline { timer: Timer::Schedule, .. } => self.scheduled(now, out),
            Input::Telegram(_) | Input::Sent | Input::Deadline { .. } | Input::Sample(_) | Input::Command(_) => {}
        }
    }
    /// Takes an order.
    #[cold]
    pub fn order(&mut self, order: Order<A::Command>, out: &mut Outbox) {
        match order {
            Order::Mode(mode) if self.mode >= MasterMode::Clear => {
                self.supervision.ordered();
                self.set_mode(mode, out);
            }
            Order::Control(control) if self.mode >= MasterMode::Clear => self.commands.push(control),
            Order::Mode(_) | Order::Control(_) => {}
            Order::Patch(slave, telegram, patch) => self.patch(slave, telegram, &patch, out),
            Order::HoldToken(order) => self.active.hold_token(order),
            Order::Overlong(order) => self.overload(order),
            Order::Application(command) => self.app.command(command, out),
        }
    }
}
