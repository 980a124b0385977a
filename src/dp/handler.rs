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
//! | DataExchange | RS, or nothing for `lost_after` cycles | Diagnose |
//! | any but DataExchange | nothing, or an answer that does not fit | Diagnose |
//!
//! Source: EN 50170-2; the order is that of an S7 master on the line.

use alloc::vec::Vec;

use crate::dp::{CHK_CFG, GET_CFG, SET_PRM, SLAVE_DIAG};
use crate::fdl::Outbox;
use crate::fdl::active::Request;
use crate::observation::{HandlerState, Observation};
use crate::wire::diag::{DiagStatus, Diagnosis};
use crate::wire::{Address, Sap, Service, Status};

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
}

impl Handler {
    /// A handler that has not asked yet.
    pub fn new(params: SlaveParams) -> Self {
        let (prm, cfg) = (params.prm.clone(), params.cfg.clone());
        Self { params, prm, cfg, state: HandlerState::Diagnose, missed: 0, reported: None }
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

    /// The service that comes next in the start-up: its SAPs, data unit and the longest reply [octets of data].
    pub fn service(&self) -> ((Sap, Sap), &[u8], usize) {
        match self.state {
            HandlerState::Diagnose | HandlerState::AwaitReady | HandlerState::DataExchange => {
                (SLAVE_DIAG, &[], Diagnosis::LEN)
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
                (_, Answer::Nothing) => HandlerState::Diagnose,
                _ => {
                    out.observe(Observation::IllegalAnswer { slave: self.params.address });
                    HandlerState::Diagnose
                }
            };
        self.enter(next, out);
        next == HandlerState::DataExchange
    }
    fn diagnosis(&mut self, du: &[u8], out: &mut Outbox) -> Option<DiagStatus> {
        let diagnosis = Diagnosis::parse(du).ok()?;
        out.observe(Observation::DiagnosisRead { slave: self.params.address });
        let [a, b, c, ..] = diagnosis.emit();
        if self.reported != Some([a, b, c]) {
            self.reported = Some([a, b, c]);
            out.observe(Observation::Diagnosis { slave: self.params.address, status: [a, b, c] });
        }
        Some(diagnosis.status)
    }

    /// Data_Exchange was answered as it should be.
    pub fn exchanged(&mut self) {
        self.missed = 0;
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
        self.restart(out);
    }
    /// Starts over, as after a stop of the master.
    pub fn restart(&mut self, out: &mut Outbox) {
        self.enter(HandlerState::Diagnose, out);
    }

    fn enter(&mut self, state: HandlerState, out: &mut Outbox) {
        let from = core::mem::replace(&mut self.state, state);
        self.missed = 0;
        if from != state {
            out.observe(Observation::Handler { slave: self.params.address, from, to: state });
        }
    }
}

/// What follows from the diagnosis after Chk_Cfg.
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
        ];
        for (state, row) in table {
            for (answer, next) in inputs.clone().zip(row) {
                let mut handler = in_state(state);
                let joined = handler.answered(answer, &mut Outbox::new());
                assert_eq!((handler.state(), joined), (next, next == DataExchange), "{state} {answer:?}");
            }
        }
    }

    #[test]
    fn a_slave_is_given_up_after_so_many_silent_cycles_in_a_row() {
        let mut handler = in_state(HandlerState::DataExchange);
        let mut out = Outbox::new();
        assert!(!handler.missed(3, &mut out) && !handler.missed(3, &mut out));
        handler.exchanged();
        assert!(!handler.missed(3, &mut out) && !handler.missed(3, &mut out) && handler.missed(3, &mut out));
        assert_eq!(handler.state(), HandlerState::Diagnose);
    }

    #[test]
    fn get_cfg_is_left_out_where_it_is_not_wanted() {
        let mut handler = handler(false);
        handler.answered(Answer::Data(&READY), &mut Outbox::new());
        assert_eq!(handler.state(), HandlerState::SetPrm);
    }
}
