//! One slave as the master sees it: diagnosis, parameters, configuration, data exchange.
//!
//! | state | answer | next state |
//! |---|---|---|
//! | Diagnose | diagnosis | GetCfg if wanted, else SetPrm |
//! | GetCfg | configuration | SetPrm |
//! | SetPrm | SC | ChkCfg |
//! | ChkCfg | SC | AwaitReady |
//! | AwaitReady | diagnosis: ready | DataExchange |
//! | AwaitReady | diagnosis: fault of parameters or configuration | Diagnose |
//! | AwaitReady | diagnosis: wants parameters | SetPrm |
//! | AwaitReady | diagnosis: not ready, static diagnosis | AwaitReady |
//! | DataExchange | inputs, DL | DataExchange |
//! | DataExchange | inputs, DH | DataExchange, the diagnosis is due |
//! | DataExchange | diagnosis: ready | DataExchange |
//! | DataExchange | diagnosis: anything else | as from AwaitReady |
//! | DataExchange | RS, or nothing for `lost_after` cycles | Diagnose |
//! | any but DataExchange | nothing, or an answer that does not fit | Diagnose |
//!
//! A diagnosis that is due is read in the next cycle. Where Slave_Diag takes no longer than the slave's Data_Exchange it
//! takes its place, so that T_DX holds; a slave whose diagnosis may be longer (Max_Diag_Data_Len) is read in the acyclic
//! part and goes on exchanging data (Model: nothing in the isochronous part is longer than planned).
//!
//! Source: EN 50170-2; the order is that of an S7 master on the line.

use alloc::vec::Vec;

use crate::dp::{CHK_CFG, GET_CFG, SET_PRM, SLAVE_DIAG};
use crate::fdl::Outbox;
use crate::fdl::active::Request;
use crate::observation::{HandlerState, Observation};
use crate::time::{Local, Span};
use crate::wire::diag::{DiagStatus, Diagnosis};
use crate::wire::{Address, Sap, Service, Status};

/// Characters of a telegram around its data unit, with SAPs and without.
pub(super) const SAP_FRAME_OCTETS: usize = 11;
const FRAME_OCTETS: usize = 9;

/// What the master knows of a slave before it sees it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SlaveParams {
    /// Station address.
    pub address: Address,
    /// Data unit of Set_Prm.
    pub prm: Vec<u8>,
    /// Data unit of Chk_Cfg.
    pub cfg: Vec<u8>,
    /// Output octets (to the slave).
    pub outputs: u8,
    /// Input octets (from the slave).
    pub inputs: u8,
    /// Ask with MSRD, so that the slave replies to everybody.
    pub publisher: bool,
    /// Send an empty Data_Exchange in Clear.
    pub fail_safe: bool,
    /// Read the configuration back before parameterising.
    pub get_cfg: bool,
    /// Max_Diag_Data_Len (octets), 6..=244.
    pub max_diag: u8,
    /// Min_Slave_Interval, from one request of Data_Exchange to the next.
    pub min_interval: Span,
    /// C1_Response_Timeout, after which an acyclic job is given up; the GSD file counts it in 10 ms.
    pub ms1_timeout: Span,
}

/// A change to a telegram of the start-up, for trying how a slave takes wrong ones.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Patch {
    octets: [Option<(u8, u8)>; Self::MAX],
    length: Option<u8>,
}

impl Patch {
    /// Octets that one patch changes at most.
    pub const MAX: usize = 8;

    /// Sets octet number `octet` (from 1) to `value`. False if the patch is full.
    pub fn set(&mut self, octet: u8, value: u8) -> bool {
        let free = self.octets.iter_mut().find(|place| place.is_none());
        free.map(|place| *place = Some((octet, value))).is_some()
    }
    /// Cuts the data unit off after, or fills it with zeros up to, `length` octets.
    pub fn set_length(&mut self, length: u8) {
        self.length = Some(length);
    }
    /// The data unit with the changes.
    fn apply(&self, good: &[u8]) -> Vec<u8> {
        let mut du = good.to_vec();
        if let Some(length) = self.length {
            du.resize(length.into(), 0);
        }
        for (octet, value) in self.octets.into_iter().flatten() {
            if let Some(place) = du.get_mut(usize::from(octet).wrapping_sub(1)) {
                *place = value;
            }
        }
        du
    }
}

/// Which telegram of the start-up.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum StartupTelegram {
    /// Set_Prm.
    Prm,
    /// Chk_Cfg.
    Cfg,
}

/// An answer to a service of the start-up.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Answer<'a> {
    /// Reply data.
    Data(&'a [u8]),
    /// SC.
    Acknowledged,
    /// A reply that refuses: RS and its like.
    Refused(Status),
    /// Nothing.
    Nothing,
}

/// The handler of one slave.
#[derive(Clone, Debug)]
pub struct Handler {
    params: SlaveParams,
    /// Set_Prm and Chk_Cfg as they are sent: patched or not.
    prm: Vec<u8>,
    cfg: Vec<u8>,
    state: HandlerState,
    /// Cycles in a row in which Data_Exchange was not answered.
    missed: u16,
    /// Octets 1 to 3 of the diagnosis last reported.
    reported: Option<[u8; 3]>,
    /// Length and first octets of the extended blocks last reported.
    reported_blocks: (u8, [u8; 8]),
    /// The slave asked for Slave_Diag with its last reply.
    diagnosis_due: bool,
    /// First bit of the last request of Data_Exchange, and end of its last good answer.
    asked_at: Option<Local>,
    exchanged_at: Option<Local>,
}

impl Handler {
    /// A handler that has not asked yet.
    pub fn new(params: SlaveParams) -> Self {
        let (prm, cfg) = (params.prm.clone(), params.cfg.clone());
        Self {
            params,
            prm,
            cfg,
            state: HandlerState::Diagnose,
            missed: 0,
            reported: None,
            reported_blocks: (0, [0; 8]),
            diagnosis_due: false,
            asked_at: None,
            exchanged_at: None,
        }
    }
    /// What the master knows beforehand.
    pub const fn params(&self) -> &SlaveParams {
        &self.params
    }
    /// What is being done.
    pub const fn state(&self) -> HandlerState {
        self.state
    }
    /// Whether the slave takes part in the Data_Exchange part of the cycle.
    pub fn exchanges(&self) -> bool {
        self.state == HandlerState::DataExchange
    }
    /// Whether Slave_Diag takes the place of the next Data_Exchange.
    pub fn diagnosis_in_place(&self) -> bool {
        self.diagnosis_due && self.diagnosis_is_short()
    }
    /// Whether an acyclic service is due: one of the start-up, or Slave_Diag beside Data_Exchange.
    pub fn has_service(&self) -> bool {
        !self.exchanges() || (self.diagnosis_due && !self.diagnosis_is_short())
    }
    /// Whether Slave_Diag takes no longer than Data_Exchange, both frames together.
    fn diagnosis_is_short(&self) -> bool {
        let SlaveParams { outputs, inputs, max_diag, .. } = self.params;
        2 * SAP_FRAME_OCTETS + usize::from(max_diag) <= 2 * FRAME_OCTETS + usize::from(outputs) + usize::from(inputs)
    }
    /// First instant at which Data_Exchange may be asked for again (Min_Slave_Interval).
    pub fn earliest(&self) -> Option<Local> {
        self.asked_at.map(|at| at + self.params.min_interval)
    }
    /// Data_Exchange is asked for, the first bit of the request at `at`.
    pub fn asked(&mut self, at: Local) {
        self.asked_at = Some(at);
    }
    /// When Data_Exchange was answered last as it should be.
    pub const fn exchanged_at(&self) -> Option<Local> {
        self.exchanged_at
    }

    /// The service that comes next in the start-up, Slave_Diag in data exchange: its SAPs, data unit and the longest reply [octets of data].
    pub fn service(&self) -> ((Sap, Sap), &[u8], usize) {
        match self.state {
            HandlerState::Diagnose | HandlerState::AwaitReady | HandlerState::DataExchange => {
                (SLAVE_DIAG, &[], self.params.max_diag.into())
            }
            HandlerState::GetCfg => (GET_CFG, &[], self.params.cfg.len()),
            HandlerState::SetPrm => (SET_PRM, &self.prm, 0),
            HandlerState::ChkCfg => (CHK_CFG, &self.cfg, 0),
        }
    }
    /// Data_Exchange with this slave.
    pub fn exchange(&self, retries: u8) -> Request {
        let service = if self.params.publisher { Service::Msrd } else { Service::SrdHigh };
        Request { to: self.params.address, service, saps: None, retries }
    }

    /// Takes the answer to [`service`](Self::service). Tells whether the slave has just joined data exchange.
    pub fn answered(&mut self, answer: Answer<'_>, out: &mut Outbox) -> bool {
        let next =
            match (self.state, answer) {
                (HandlerState::Diagnose, Answer::Data(du)) if self.diagnosis(du, out).is_some() => {
                    if self.params.get_cfg { HandlerState::GetCfg } else { HandlerState::SetPrm }
                }
                (HandlerState::GetCfg, Answer::Data(_)) => HandlerState::SetPrm,
                (HandlerState::SetPrm, Answer::Acknowledged) => HandlerState::ChkCfg,
                (HandlerState::ChkCfg, Answer::Acknowledged) => HandlerState::AwaitReady,
                (HandlerState::AwaitReady, Answer::Data(du)) => match self.diagnosis(du, out) {
                    Some(status) => after_diagnosis(status),
                    None => HandlerState::Diagnose,
                },
                (HandlerState::DataExchange, Answer::Data(du)) => match self.diagnosis(du, out) {
                    Some(status) => {
                        (self.diagnosis_due, self.missed) = (false, 0);
                        after_diagnosis(status)
                    }
                    None => HandlerState::Diagnose,
                },
                // It stays due.
                (HandlerState::DataExchange, Answer::Nothing) => HandlerState::DataExchange,
                (_, Answer::Nothing) => HandlerState::Diagnose,
                _ => {
                    out.observe(Observation::IllegalAnswer { slave: self.params.address });
                    HandlerState::Diagnose
                }
            };
        let joined = next == HandlerState::DataExchange && !self.exchanges();
        if self.exchanges() && next != HandlerState::DataExchange {
            out.observe(Observation::Lost { slave: self.params.address });
        }
        self.enter(next, out);
        joined
    }
    fn diagnosis(&mut self, du: &[u8], out: &mut Outbox) -> Option<DiagStatus> {
        let diagnosis = Diagnosis::parse(du).ok()?;
        out.observe(Observation::DiagnosisRead { slave: self.params.address });
        let [a, b, c, ..] = diagnosis.emit();
        // During data exchange it is read because something changed.
        if self.reported != Some([a, b, c]) || self.exchanges() {
            self.reported = Some([a, b, c]);
            out.observe(Observation::Diagnosis { slave: self.params.address, status: [a, b, c] });
        }
        let blocks = beginning(diagnosis.extended);
        if self.reported_blocks != blocks || (self.exchanges() && blocks.0 > 0) {
            self.reported_blocks = blocks;
            let (length, first) = blocks;
            out.observe(Observation::ExtendedDiagnosis { slave: self.params.address, length, first });
        }
        Some(diagnosis.status)
    }

    /// Data_Exchange was answered as it should be, at `now`; `high` with high priority (DH).
    pub fn exchanged(&mut self, now: Local, high: bool, out: &mut Outbox) {
        self.missed = 0;
        self.exchanged_at = Some(now);
        if high && !self.diagnosis_due {
            self.diagnosis_due = true;
            out.observe(Observation::DiagnosisDue { slave: self.params.address });
        }
    }
    /// Data_Exchange was refused. Tells whether the slave was given up: always.
    pub fn refused(&mut self, out: &mut Outbox) -> bool {
        out.observe(Observation::Lost { slave: self.params.address });
        self.enter(HandlerState::Diagnose, out);
        true
    }
    /// Data_Exchange was not answered. Tells whether the slave was given up.
    pub fn missed(&mut self, lost_after: u16, out: &mut Outbox) -> bool {
        self.missed = self.missed.saturating_add(1);
        out.observe(Observation::NoAnswer { slave: self.params.address });
        self.missed >= lost_after && self.refused(out)
    }
    /// From now on sends this telegram changed, and starts over.
    pub fn patch(&mut self, telegram: StartupTelegram, patch: &Patch, out: &mut Outbox) {
        match telegram {
            StartupTelegram::Prm => self.prm = patch.apply(&self.params.prm),
            StartupTelegram::Cfg => self.cfg = patch.apply(&self.params.cfg),
        }
        self.enter(HandlerState::Diagnose, out);
    }
    /// Its master has supply again: starts over with the telegrams of the configuration.
    pub fn restart(&mut self, out: &mut Outbox) {
        self.prm.clone_from(&self.params.prm);
        self.cfg.clone_from(&self.params.cfg);
        self.enter(HandlerState::Diagnose, out);
    }

    fn enter(&mut self, state: HandlerState, out: &mut Outbox) {
        let from = core::mem::replace(&mut self.state, state);
        if from != state {
            (self.missed, self.diagnosis_due) = (0, false);
            out.observe(Observation::Handler { slave: self.params.address, from, to: state });
        }
    }
}

/// Length of extended blocks and their first octets.
fn beginning(blocks: &[u8]) -> (u8, [u8; 8]) {
    let mut first = [0; 8];
    for (place, &octet) in first.iter_mut().zip(blocks) {
        *place = octet;
    }
    (blocks.len() as u8, first)
}

/// What follows from the diagnosis after Chk_Cfg, and during data exchange.
fn after_diagnosis(status: DiagStatus) -> HandlerState {
    if status.prm_fault() || status.cfg_fault() || status.not_supported() {
        HandlerState::Diagnose
    } else if status.prm_req() {
        HandlerState::SetPrm
    } else if status.station_not_ready() || status.stat_diag() {
        HandlerState::AwaitReady
    } else {
        HandlerState::DataExchange
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const READY: [u8; 6] = [0x00, 0x0C, 0x00, 0x02, 0x80, 0xF9];

    fn handler(get_cfg: bool) -> Handler {
        Handler::new(SlaveParams {
            address: Address::new(6).unwrap(),
            prm: alloc::vec![1],
            cfg: alloc::vec![2],
            outputs: 4,
            inputs: 12,
            publisher: false,
            fail_safe: false,
            get_cfg,
            max_diag: 6,
            min_interval: Span::from_us(100),
            ms1_timeout: Span::from_s(10),
        })
    }
    /// The handler after the answers of a start-up up to `state`.
    fn in_state(state: HandlerState) -> Handler {
        let mut handler = handler(true);
        let answers = [
            Answer::Data(&[0x02, 0x05, 0x00, 0xFF, 0x80, 0xF9]),
            Answer::Data(&[2]),
            Answer::Acknowledged,
            Answer::Acknowledged,
            Answer::Data(&READY),
        ];
        for answer in answers {
            if handler.state() == state {
                break;
            }
            handler.answered(answer, &mut Outbox::new());
        }
        assert_eq!(handler.state(), state);
        handler
    }

    /// Every state with every answer; the table of the file header.
    #[test]
    fn states_and_answers() {
        use HandlerState::{AwaitReady, ChkCfg, DataExchange, Diagnose, GetCfg, SetPrm};
        let prm_fault: &[u8] = &[0x42, 0x05, 0x00, 0xFF, 0x80, 0xF9];
        let cfg_fault: &[u8] = &[0x06, 0x05, 0x00, 0xFF, 0x80, 0xF9];
        let waits: &[u8] = &[0x02, 0x05, 0x00, 0xFF, 0x80, 0xF9];
        let not_ready: &[u8] = &[0x02, 0x0C, 0x00, 0x02, 0x80, 0xF9];
        let inputs = [&READY[..], prm_fault, cfg_fault, waits, not_ready].map(Answer::Data).into_iter().chain([
            Answer::Acknowledged,
            Answer::Refused(Status::Rs),
            Answer::Nothing,
        ]);
        let table = [
            (Diagnose, [GetCfg, GetCfg, GetCfg, GetCfg, GetCfg, Diagnose, Diagnose, Diagnose]),
            (GetCfg, [SetPrm, SetPrm, SetPrm, SetPrm, SetPrm, Diagnose, Diagnose, Diagnose]),
            (SetPrm, [Diagnose, Diagnose, Diagnose, Diagnose, Diagnose, ChkCfg, Diagnose, Diagnose]),
            (ChkCfg, [Diagnose, Diagnose, Diagnose, Diagnose, Diagnose, AwaitReady, Diagnose, Diagnose]),
            (AwaitReady, [DataExchange, Diagnose, Diagnose, SetPrm, AwaitReady, Diagnose, Diagnose, Diagnose]),
            (DataExchange, [DataExchange, Diagnose, Diagnose, SetPrm, AwaitReady, Diagnose, Diagnose, DataExchange]),
        ];
        for (state, row) in table {
            for (answer, next) in inputs.clone().zip(row) {
                let mut handler = in_state(state);
                let joined = handler.answered(answer, &mut Outbox::new());
                let joins = next == DataExchange && state != DataExchange;
                assert_eq!((handler.state(), joined), (next, joins), "{state} {answer:?}");
            }
        }
    }

    #[test]
    fn a_slave_is_given_up_after_so_many_silent_cycles_in_a_row() {
        let mut handler = in_state(HandlerState::DataExchange);
        let mut out = Outbox::new();
        assert!(!handler.missed(3, &mut out) && !handler.missed(3, &mut out));
        handler.exchanged(Local::ZERO, false, &mut out);
        assert!(!handler.missed(3, &mut out) && !handler.missed(3, &mut out) && handler.missed(3, &mut out));
        assert_eq!(handler.state(), HandlerState::Diagnose);
    }

    /// 2 x 11 + 6 octets against 2 x 9 + 16 of telegram 81.
    #[test]
    fn a_short_diagnosis_takes_the_place_of_data_exchange_and_a_long_one_the_acyclic_part() {
        for (max_diag, in_place) in [(6, true), (12, true), (13, false), (244, false)] {
            let mut handler = in_state(HandlerState::DataExchange);
            handler.params.max_diag = max_diag;
            let mut out = Outbox::new();
            assert!(!handler.diagnosis_in_place() && !handler.has_service());
            handler.exchanged(Local::ZERO, true, &mut out);
            handler.exchanged(Local::ZERO, true, &mut out);
            assert_eq!(out.observations().count(), 1, "due is said once");
            assert_eq!((handler.diagnosis_in_place(), handler.has_service()), (in_place, !in_place));
            handler.answered(Answer::Nothing, &mut out);
            assert_eq!((handler.diagnosis_in_place(), handler.has_service()), (in_place, !in_place), "still due");
            handler.answered(Answer::Data(&READY), &mut out);
            assert!(!handler.diagnosis_in_place() && !handler.has_service());
        }
    }

    #[test]
    fn extended_blocks_are_reported_by_their_length_and_first_octets() {
        let mut handler = in_state(HandlerState::DataExchange);
        let mut diagnosis = READY.to_vec();
        diagnosis.extend([0x0A, 0x83, 0, 0, 6, 1, 7, 1, 8, 0]);
        let mut out = Outbox::new();
        handler.answered(Answer::Data(&diagnosis), &mut out);
        let slave = handler.params.address;
        let first = [0x0A, 0x83, 0, 0, 6, 1, 7, 1];
        let seen: Vec<_> = out.observations().copied().collect();
        let status = [0x00, 0x0C, 0x00];
        let expected = [
            Observation::DiagnosisRead { slave },
            Observation::Diagnosis { slave, status },
            Observation::ExtendedDiagnosis { slave, length: 10, first },
        ];
        assert_eq!(seen, expected);
        out.clear();
        handler.answered(Answer::Data(&READY), &mut out);
        let gone = Observation::ExtendedDiagnosis { slave, length: 0, first: [0; 8] };
        assert_eq!(out.observations().last(), Some(&gone));
    }

    /// Every way out of data exchange that the master does not want, and one that it wants.
    #[test]
    fn lost_is_said_where_a_slave_leaves_against_the_masters_will() {
        let losses = |leave: &dyn Fn(&mut Handler, &mut Outbox)| {
            let (mut handler, mut out) = (in_state(HandlerState::DataExchange), Outbox::new());
            leave(&mut handler, &mut out);
            assert!(!handler.exchanges());
            out.observations().filter(|what| matches!(what, Observation::Lost { .. })).count()
        };
        let not_ready = [0x02, 0x05, 0x00, 0xFF, 0x80, 0xF9];
        assert_eq!(
            losses(&|handler, out| {
                handler.refused(out);
            }),
            1,
            "RS"
        );
        assert_eq!(
            losses(&|handler, out| {
                handler.missed(1, out);
            }),
            1,
            "silence"
        );
        assert_eq!(
            losses(&|handler, out| {
                handler.answered(Answer::Data(&not_ready), out);
            }),
            1,
            "diagnosis"
        );
        assert_eq!(
            losses(&|handler, out| {
                handler.answered(Answer::Refused(Status::Rs), out);
            }),
            1,
            "nonsense"
        );
        assert_eq!(losses(&|handler, out| handler.restart(out)), 0, "the master's own will");
    }

    #[test]
    fn a_changed_telegram_is_sent_until_the_supply_fails() {
        let (mut handler, mut out) = (in_state(HandlerState::DataExchange), Outbox::new());
        let mut wrong = Patch::default();
        wrong.set_length(3);
        let sent = |handler: &mut Handler| {
            let mut out = Outbox::new();
            handler.answered(Answer::Data(&[0x02, 0x05, 0x00, 0xFF, 0x80, 0xF9]), &mut out);
            handler.answered(Answer::Data(&[2]), &mut out);
            assert_eq!(handler.state(), HandlerState::SetPrm);
            handler.service().1.to_vec()
        };
        handler.patch(StartupTelegram::Prm, &wrong, &mut out);
        assert_eq!(sent(&mut handler), [1, 0, 0]);
        handler.restart(&mut out);
        assert_eq!(sent(&mut handler), [1]);
    }

    #[test]
    fn get_cfg_is_left_out_where_it_is_not_wanted() {
        let mut handler = handler(false);
        handler.answered(Answer::Data(&READY), &mut Outbox::new());
        assert_eq!(handler.state(), HandlerState::SetPrm);
    }
}
