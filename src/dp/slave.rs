//! The DP slave: parameterisation, configuration, data exchange, diagnosis, watchdog.
//!
//! | state | input | next state | answer |
//! |---|---|---|---|
//! | POWER_ON | supply on, initialised | WAIT_PRM | - |
//! | WAIT_PRM | good Set_Prm with Lock | WAIT_CFG | SC |
//! | WAIT_PRM | bad Set_Prm | WAIT_PRM, Prm_Fault | SC |
//! | WAIT_PRM | Chk_Cfg, Data_Exchange, RD_Inp, RD_Outp | WAIT_PRM | RS |
//! | WAIT_CFG | good Chk_Cfg | DATA_EXCH | SC |
//! | WAIT_CFG | bad Chk_Cfg | WAIT_PRM, Cfg_Fault | SC |
//! | WAIT_CFG | Data_Exchange, RD_Inp, RD_Outp | WAIT_CFG | RS |
//! | WAIT_CFG, DATA_EXCH | good Set_Prm with Lock | WAIT_CFG | SC |
//! | WAIT_CFG, DATA_EXCH | bad Set_Prm, Unlock, watchdog | WAIT_PRM | SC, SC, - |
//! | DATA_EXCH | good Chk_Cfg | DATA_EXCH | SC |
//! | DATA_EXCH | bad Chk_Cfg | WAIT_PRM, Cfg_Fault | SC |
//! | DATA_EXCH | Data_Exchange, RD_Inp, RD_Outp | DATA_EXCH | data |
//! | DATA_EXCH | Data_Exchange after a change of the diagnosis that its master has not read | DATA_EXCH | data, DH |
//! | DATA_EXCH | Data_Exchange of another length | WAIT_PRM | RS |
//! | DATA_EXCH | Data_Exchange by MSRD without Publisher_Enable | DATA_EXCH | RS |
//! | DATA_EXCH | MS1 with DPV1_Enable | DATA_EXCH | see [`ms1`](crate::dp::ms1) |
//! | any but POWER_ON | Slave_Diag, Get_Cfg | unchanged | data |
//! | any but POWER_ON | MS2 of any master | unchanged | see [`ms2`] |
//! | any | Set_Prm with neither Lock nor Unlock | unchanged, min T_SDR in force | SC |
//! | WAIT_CFG, DATA_EXCH | Set_Prm, Chk_Cfg, Data_Exchange of another master | unchanged | RS |
//!
//! Source: EN 50170-2. The slave belongs to one device, whose own rules come in through [`Application`]. A
//! Global_Control of its own master acts in DATA_EXCH: the clock on all, Operate, Clear, Sync and Freeze where the
//! slave's group is selected; what the last two do to data says [`image`](crate::dp::image). Model: a change of
//! Sync_Mode or Freeze_Mode is a change of the diagnosis like any other.

use alloc::borrow::Cow;
use core::fmt;

use crate::dp::image::Image;
use crate::dp::ms1::{Access, Answer, Records, Server};
use crate::dp::ms2::{self, Manager, Message};
use crate::fdl::passive::{Indication, Passive};
use crate::fdl::{Filter, Heard, Outbox, Timer};
use crate::observation::{Observation, SlaveCause, SlaveState};
use crate::time::{BitRate, Local, Span, Tbit};
use crate::wire::control::GlobalControl;
use crate::wire::diag::{DiagBuffer, DiagStatus, Diagnosis};
use crate::wire::prm::{PrmError, SetPrm};
use crate::wire::{Address, FrameControl, Header, Sap, Service, Status, Telegram};

/// Time from an acyclic request to its answer. Model: none of the sources has a number.
pub const ACYCLIC_TIME: Span = Span::from_ms(2);

/// Why a slave does not take its parameters.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Refusal {
    /// The telegram itself is wrong.
    Telegram(PrmError),
    /// The device cannot do what is asked for.
    Device {
        /// Octet of Set_Prm, from 1.
        octet: usize,
        /// The rule, as the second half of a sentence.
        rule: &'static str,
        /// The value found.
        value: u64,
    },
}

impl From<PrmError> for Refusal {
    fn from(error: PrmError) -> Self {
        Self::Telegram(error)
    }
}
impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Telegram(error) => error.fmt(f),
            Self::Device { octet, rule, value } => write!(f, "octet {octet} is {value}, but {rule}"),
        }
    }
}
impl core::error::Error for Refusal {}

/// What a device brings along as a DP slave.
pub trait Application: Records {
    /// Checks the device's own rules for Set_Prm (blocks, times). Keeps nothing yet.
    ///
    /// # Errors
    /// The rule that is broken; the slave then reports Prm_Fault.
    fn check(&self, prm: &SetPrm<'_>) -> Result<(), Refusal>;
    /// Takes parameters over that were found good.
    fn parameterise(&mut self, prm: &SetPrm<'_>);
    /// Data exchange begins.
    fn enter(&mut self, now: Local, out: &mut Outbox);
    /// Data exchange is over: watchdog, new parameters, unlock, fault.
    fn leave(&mut self, now: Local, out: &mut Outbox);
    /// A Data_Exchange came. `outputs` are those in force from now on: what it brought, or in Sync mode what the last
    /// Sync did; none while the master is in Clear. `sample` is the raw position at the request.
    fn outputs(&mut self, now: Local, outputs: Option<&[u8]>, sample: u32, out: &mut Outbox);
    /// Sync, Unsync or Clear_Data put these outputs in force, none after Clear_Data.
    fn transfer(&mut self, now: Local, outputs: Option<&[u8]>, out: &mut Outbox);
    /// Freeze is about to hold the inputs. `sample` is the raw position at this instant.
    fn freeze(&mut self, now: Local, sample: u32, out: &mut Outbox);
    /// Writes the inputs of the reply.
    fn inputs(&self, du: &mut [u8]);
    /// The clock telegram SYNCH arrived during data exchange.
    fn synch(&mut self, now: Local, out: &mut Outbox);
    /// A Global_Control said Operate (`true`) or Clear during data exchange.
    fn operate(&mut self, now: Local, operate: bool, out: &mut Outbox);
    /// A publisher's reply was heard.
    fn published(&mut self, now: Local, publisher: Address, du: &[u8], out: &mut Outbox);
    /// Publishers to listen to: bit n is address n.
    fn publishers(&self) -> u128;
    /// Writes the device's own part of the diagnosis: extended blocks, Ext_Diag, Stat_Diag.
    fn diagnosis(&self, _diagnosis: &mut DiagBuffer) {}
    /// Another number than before whenever [`diagnosis`](Self::diagnosis) writes something else: the replies to
    /// Data_Exchange are then of high priority until the master has read it.
    fn diagnosis_revision(&self) -> u32 {
        0
    }
}

/// What a slave is, for good.
#[derive(Clone, Debug)]
#[allow(clippy::struct_excessive_bools)] // What a GSD file says with four keys.
pub struct Identity {
    /// Station address.
    pub address: Address,
    /// Ident_Number.
    pub ident: u16,
    /// The one configuration it accepts, as in Chk_Cfg.
    pub config: Cow<'static, [u8]>,
    /// Output octets (from the master).
    pub outputs: u8,
    /// Input octets (to the master).
    pub inputs: u8,
    /// Takes an empty Data_Exchange for Clear (DPV1_Status_1 bit 6 allowed).
    pub fail_safe: bool,
    /// Answers MSRD to everybody if so parameterised.
    pub publisher: bool,
    /// Takes Sync_Req.
    pub sync: bool,
    /// Takes Freeze_Req.
    pub freeze: bool,
    /// Max_Diag_Data_Len (octets), 6..=244.
    pub max_diag: u8,
    /// Bit rate of the bus.
    pub rate: BitRate,
    /// Own T_SDR.
    pub t_sdr: Tbit,
    /// C1_Max_Data_Len, the longest data of a record that its master reads or writes (octets).
    pub c1_max_data: u8,
    /// Its connections for class 2 masters.
    pub ms2: ms2::Settings,
}

/// A DP slave without its device.
#[derive(Clone, Debug)]
pub struct Slave {
    identity: Identity,
    passive: Passive,
    state: SlaveState,
    /// The master whose parameters are in force.
    master: Option<Address>,
    /// Prm_Fault, Cfg_Fault, Not_Supported of the last attempt.
    fault: DiagStatus,
    watchdog: Option<Span>,
    group: u8,
    fail_safe: bool,
    /// Publisher_Enable: MSRD is answered.
    publisher: bool,
    /// DPV1_Enable: MS1 is open.
    dpv1: bool,
    ms1: Server,
    ms2: Manager,
    image: Image,
    /// The diagnosis that its master knows: as it read it last, or as data exchange began.
    known: Known,
}

/// What can change in a diagnosis during data exchange.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
struct Known {
    /// Sync_Mode and Freeze_Mode.
    modes: DiagStatus,
    /// [`Application::diagnosis_revision`].
    device: u32,
}

impl Slave {
    /// A slave without supply.
    pub fn new(identity: Identity) -> Self {
        Self {
            passive: Passive::new(identity.address, identity.rate, identity.t_sdr),
            image: Image::new(identity.outputs, identity.inputs),
            ms1: Server::new(ACYCLIC_TIME, identity.c1_max_data),
            ms2: Manager::new(identity.ms2),
            identity,
            state: SlaveState::PowerOn,
            master: None,
            fault: DiagStatus::default(),
            watchdog: None,
            group: 0,
            fail_safe: false,
            publisher: false,
            dpv1: false,
            known: Known::default(),
        }
    }
    /// What it is.
    pub const fn identity(&self) -> &Identity {
        &self.identity
    }
    /// State now.
    pub const fn state(&self) -> SlaveState {
        self.state
    }
    /// Whether the last parameters or configuration were refused.
    pub fn has_fault(&self) -> bool {
        self.fault != DiagStatus::default()
    }
    /// Which telegrams it wants.
    pub fn filter(&self, app: &impl Application) -> Filter {
        // Without parameters there are no links.
        let listens = matches!(self.state, SlaveState::WaitCfg | SlaveState::DataExch);
        Filter { all: false, own: self.identity.address, publishers: if listens { app.publishers() } else { 0 } }
    }

    /// The supply came on: everything from before is forgotten, initialisation takes no time.
    pub fn power_on(&mut self, now: Local, app: &mut impl Application, out: &mut Outbox) {
        *self = Self::new(self.identity.clone());
        for connection in 0..self.identity.ms2.connections {
            app.closed(Access::Ms2(connection));
        }
        self.enter(SlaveState::WaitPrm, SlaveCause::Initialised, now, app, out);
    }
    /// [`Timer::Watchdog`] came due.
    pub fn watchdog(&mut self, now: Local, app: &mut impl Application, out: &mut Outbox) {
        if self.state != SlaveState::WaitPrm {
            self.unlock(SlaveCause::Watchdog, now, app, out);
        }
    }

    /// Takes a telegram whose last bit arrived at `now`.
    pub fn heard(&mut self, now: Local, heard: Heard<'_>, app: &mut impl Application, out: &mut Outbox) {
        let parsed = Telegram::parse(heard.octets);
        let Ok(telegram) = &parsed else { return };
        match self.passive.heard(now, telegram, out) {
            Indication::Nothing => {}
            Indication::Request { header, du } => {
                if self.master == Some(header.sa) {
                    self.retrigger(now, out);
                }
                match (header.dsap, header.ssap) {
                    (None, None) => self.data_exchange(now, header, (du, heard.sample), app, out),
                    _ => self.service(now, header, du, app, out),
                }
            }
            Indication::Broadcast { header, du } => self.broadcast(now, header, (du, heard.sample), app, out),
            Indication::Published { publisher, du } => app.published(now, publisher, du, out),
        }
    }
    fn retrigger(&self, now: Local, out: &mut Outbox) {
        if let Some(time) = self.watchdog {
            out.arm(Timer::Watchdog, now + time);
        }
    }

    /// A request for a service access point.
    #[cold]
    fn service(&mut self, now: Local, header: &Header, du: &[u8], app: &mut impl Application, out: &mut Outbox) {
        match (header.dsap, header.ssap) {
            (Some(Sap::SLAVE_DIAG), Some(Sap::MASTER_MS0)) => self.slave_diag(now, header, app, out),
            (Some(Sap::GET_CFG), Some(Sap::MASTER_MS0)) => {
                let config = &self.identity.config;
                self.passive.reply(now, header, (Status::Dl, config.len()), out, |du| du.copy_from_slice(config));
            }
            (Some(Sap::SET_PRM), Some(Sap::MASTER_MS0)) => self.set_prm(now, header, du, app, out),
            (Some(Sap::CHK_CFG), Some(Sap::MASTER_MS0)) => self.chk_cfg(now, header, du, app, out),
            (Some(Sap::RD_INP), Some(Sap::MASTER_MS0)) if self.state == SlaveState::DataExch => {
                self.reply_held_or_fresh(now, header, Status::Dl, app, out);
            }
            (Some(Sap::RD_OUTP), Some(Sap::MASTER_MS0)) if self.state == SlaveState::DataExch => {
                let outputs = self.image.octets();
                self.passive.reply(now, header, (Status::Dl, outputs.len()), out, |du| du.copy_from_slice(outputs));
            }
            (Some(Sap::MS1), Some(Sap::MASTER_MS1)) => self.ms1(now, header, du, app, out),
            (Some(dsap), Some(ssap)) if self.ms2.has(dsap) => {
                let message = Message { master: header.sa, ssap, dsap, du };
                answer(&mut self.passive, now, header, self.ms2.heard(now, &message, app, out), out);
                self.supervise(out);
            }
            _ => self.refuse(now, header, out),
        }
    }
    fn ms1(&mut self, now: Local, header: &Header, du: &[u8], app: &mut impl Application, out: &mut Outbox) {
        if self.state != SlaveState::DataExch || !self.dpv1 || self.is_foreign(header.sa) {
            return self.refuse(now, header, out);
        }
        answer(&mut self.passive, now, header, self.ms1.heard(now, du, app), out);
    }
    /// [`Timer::Connection`] came due.
    pub fn connection_due(&mut self, now: Local, app: &mut impl Application, out: &mut Outbox) {
        self.ms2.due(now, app, out);
        self.supervise(out);
    }
    fn supervise(&self, out: &mut Outbox) {
        match self.ms2.deadline() {
            Some(deadline) => out.arm(Timer::Connection, deadline),
            None => out.disarm(Timer::Connection),
        }
    }
    #[cold]
    fn refuse(&mut self, now: Local, request: &Header, out: &mut Outbox) {
        self.passive.reply(now, request, (Status::Rs, 0), out, |_| ());
    }
    /// Whether another master than `sa` has this slave.
    fn is_foreign(&self, sa: Address) -> bool {
        self.state != SlaveState::WaitPrm && self.master.is_some_and(|master| master != sa)
    }

    fn data_exchange(
        &mut self,
        now: Local,
        header: &Header,
        (du, sample): (&[u8], u32),
        app: &mut impl Application,
        out: &mut Outbox,
    ) {
        let published = matches!(header.fc, FrameControl::Request { service: Service::Msrd, .. });
        if self.state != SlaveState::DataExch || self.is_foreign(header.sa) || (published && !self.publisher) {
            return self.refuse(now, header, out);
        }
        if !self.image.exchange(du) {
            // A fail-safe slave takes an empty request for Clear.
            if !du.is_empty() || !self.fail_safe {
                self.refuse(now, header, out);
                return self.unlock(SlaveCause::OutputLength, now, app, out);
            }
            self.image.clear();
        }
        app.outputs(now, self.image.outputs(), sample, out);
        let status = if self.news(app) == self.known { Status::Dl } else { Status::Dh };
        if self.image.held().is_some() {
            return self.reply_held_or_fresh(now, header, status, app, out);
        }
        self.passive.reply(now, header, (status, self.identity.inputs.into()), out, |du| app.inputs(du));
    }
    /// Replies with the inputs that Freeze holds, or else with those of now.
    #[cold]
    fn reply_held_or_fresh(
        &mut self,
        now: Local,
        request: &Header,
        status: Status,
        app: &impl Application,
        out: &mut Outbox,
    ) {
        let held = self.image.held();
        self.passive.reply(now, request, (status, self.identity.inputs.into()), out, |du| match held {
            Some(held) => du.copy_from_slice(held),
            None => app.inputs(du),
        });
    }

    fn slave_diag(&mut self, now: Local, request: &Header, app: &impl Application, out: &mut Outbox) {
        let mut device = DiagBuffer::new(self.identity.max_diag);
        app.diagnosis(&mut device);
        let diagnosis = self.diagnosis(&device);
        let (standard, extended) = (diagnosis.emit(), diagnosis.extended);
        self.passive.reply(now, request, (Status::Dl, standard.len() + extended.len()), out, |du| {
            du[..standard.len()].copy_from_slice(&standard);
            du[standard.len()..].copy_from_slice(extended);
        });
        // A repeated request gets the same octets from the memory of the data link layer.
        if self.master == Some(request.sa) {
            self.known = self.news(app);
        }
    }
    /// The diagnosis as Slave_Diag reads it (manual 5.1), with what the device adds.
    pub fn diagnosis<'d>(&self, device: &'d DiagBuffer) -> Diagnosis<'d> {
        let status = (self.fault | DiagStatus::BY_SLAVE | self.image.modes() | device.status())
            .with(DiagStatus::STATION_NOT_READY, self.state != SlaveState::DataExch)
            .with(DiagStatus::PRM_REQ, matches!(self.state, SlaveState::PowerOn | SlaveState::WaitPrm))
            .with(DiagStatus::WD_ON, self.watchdog.is_some());
        Diagnosis { status, master: self.master, ident: self.identity.ident, extended: device.octets() }
    }
    fn news(&self, app: &impl Application) -> Known {
        Known { modes: self.image.modes(), device: app.diagnosis_revision() }
    }

    fn set_prm(&mut self, now: Local, header: &Header, du: &[u8], app: &mut impl Application, out: &mut Outbox) {
        if self.is_foreign(header.sa) {
            return self.refuse(now, header, out);
        }
        self.passive.acknowledge(now, out);
        let Ok(prm) = SetPrm::parse(du) else {
            return self.fail(DiagStatus::PRM_FAULT, SlaveCause::PrmFault, now, app, out);
        };
        match (prm.status.lock(), prm.status.unlock()) {
            // min T_SDR alone, whatever the ident number (EN 50170-2).
            (false, false) => self.passive.set_min_tsdr(Tbit(prm.min_tsdr.into())),
            (_, true) => self.unlock(SlaveCause::Unlocked, now, app, out),
            (true, false) => match self.check_prm(&prm, app) {
                Ok(()) => self.parameterise(now, header.sa, &prm, app, out),
                Err(fault) => self.fail(fault, SlaveCause::PrmFault, now, app, out),
            },
        }
    }
    fn check_prm(&self, prm: &SetPrm<'_>, app: &impl Application) -> Result<(), DiagStatus> {
        let Identity { sync, freeze, .. } = self.identity;
        if (prm.status.sync() && !sync) || (prm.status.freeze() && !freeze) {
            return Err(DiagStatus::NOT_SUPPORTED);
        }
        let own = prm.ident == self.identity.ident
            && (self.identity.fail_safe || !prm.dpv1.fail_safe())
            && (self.identity.publisher || !prm.dpv1.publisher_enable());
        let good = own && prm.check().is_ok() && app.check(prm).is_ok();
        if good { Ok(()) } else { Err(DiagStatus::PRM_FAULT) }
    }
    fn parameterise(
        &mut self,
        now: Local,
        sa: Address,
        prm: &SetPrm<'_>,
        app: &mut impl Application,
        out: &mut Outbox,
    ) {
        // The device leaves data exchange with its old parameters before it gets new ones.
        self.enter(SlaveState::WaitCfg, SlaveCause::Parameterised, now, app, out);
        self.master = Some(sa);
        self.fault = DiagStatus::default();
        self.group = prm.group;
        self.image.parameterise(prm.status.sync(), prm.status.freeze());
        self.fail_safe = prm.dpv1.fail_safe();
        self.publisher = prm.dpv1.publisher_enable();
        self.dpv1 = prm.dpv1.dpv1_enable();
        self.passive.set_min_tsdr(Tbit(prm.min_tsdr.into()));
        let step = Span::from_ms(prm.watchdog_base_ms().into());
        self.watchdog = prm.watchdog_units().map(|units| step * units.into());
        out.disarm(Timer::Watchdog);
        self.retrigger(now, out);
        app.parameterise(prm);
    }

    fn chk_cfg(&mut self, now: Local, header: &Header, du: &[u8], app: &mut impl Application, out: &mut Outbox) {
        if self.state == SlaveState::WaitPrm || self.is_foreign(header.sa) {
            return self.refuse(now, header, out);
        }
        self.passive.acknowledge(now, out);
        if *du != *self.identity.config {
            self.fail(DiagStatus::CFG_FAULT, SlaveCause::CfgFault, now, app, out);
        } else if self.state == SlaveState::WaitCfg {
            self.enter(SlaveState::DataExch, SlaveCause::Configured, now, app, out);
        }
    }

    fn broadcast(
        &mut self,
        now: Local,
        header: &Header,
        (du, sample): (&[u8], u32),
        app: &mut impl Application,
        out: &mut Outbox,
    ) {
        let control = (header.dsap, header.ssap) == (Some(Sap::GLOBAL_CONTROL), Some(Sap::MASTER_MS0));
        if !control || self.state != SlaveState::DataExch || self.is_foreign(header.sa) {
            return;
        }
        if *du == GlobalControl::SYNCH_OCTETS {
            return app.synch(now, out);
        }
        if let Ok(control) = GlobalControl::parse(du)
            && control.selects(self.group)
        {
            app.operate(now, !control.clear, out);
            self.control(now, control, sample, app, out);
        }
    }
    #[cold]
    fn control(
        &mut self,
        now: Local,
        control: GlobalControl,
        sample: u32,
        app: &mut impl Application,
        out: &mut Outbox,
    ) {
        let before = self.image.modes();
        let transferred = self.image.control(control, |du| {
            app.freeze(now, sample, out);
            app.inputs(du);
        });
        if transferred {
            app.transfer(now, self.image.outputs(), out);
        }
        let modes = self.image.modes();
        if modes != before {
            out.observe(Observation::Held { outputs: modes.sync_mode(), inputs: modes.freeze_mode() });
        }
    }

    fn fail(&mut self, fault: DiagStatus, cause: SlaveCause, now: Local, app: &mut impl Application, out: &mut Outbox) {
        self.unlock(cause, now, app, out);
        self.fault = fault;
    }
    #[cold]
    fn unlock(&mut self, cause: SlaveCause, now: Local, app: &mut impl Application, out: &mut Outbox) {
        self.master = None;
        self.watchdog = None;
        self.fault = DiagStatus::default();
        out.disarm(Timer::Watchdog);
        self.enter(SlaveState::WaitPrm, cause, now, app, out);
    }
    fn enter(
        &mut self,
        state: SlaveState,
        cause: SlaveCause,
        now: Local,
        app: &mut impl Application,
        out: &mut Outbox,
    ) {
        let from = core::mem::replace(&mut self.state, state);
        out.observe(Observation::SlaveState { from, to: state, cause });
        out.filter_changed();
        if from == SlaveState::DataExch && state != SlaveState::DataExch {
            self.image.leave();
            self.ms1.reset(app);
            app.leave(now, out);
        }
        if state == SlaveState::DataExch {
            app.enter(now, out);
            // Start-up reads the diagnosis anyway: only what changes from here on is news.
            self.known = self.news(app);
        }
    }
}

/// Answers a request to an acyclic service.
fn answer(passive: &mut Passive, now: Local, request: &Header, answer: Answer<'_>, out: &mut Outbox) {
    match answer {
        Answer::Acknowledge => passive.acknowledge(now, out),
        Answer::Data(pdu) => passive.reply(now, request, (Status::Dl, pdu.len()), out, |du| du.copy_from_slice(pdu)),
        Answer::Refuse(status) => passive.reply(now, request, (status, 0), out, |_| ()),
    }
}
