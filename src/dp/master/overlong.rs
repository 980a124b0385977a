//! Acyclic traffic without regard to the cycle, where the scenario orders it: a DS-Write in every cycle, whether it fits
//! before SYNCH or not.
//!
//! It is sent once in every cycle, with the ordinary message of the cycle or after it:
//!
//! | acyclic job under way | the ordinary message | after it |
//! |---|---|---|
//! | none, or over with this message | the last poll, or none | the next DS-Write; the application's job if it has one, from the next cycle on |
//! | DS-Write, not taken yet | DS-Write | nothing |
//! | DS-Write, taken | an empty poll: SC, the slave works | DS-Write: the slave refuses it with RR |
//! | one of the application | that of the job | nothing |
//!
//! Model: the slave has no such record and answers a DS-Write with a negative answer, so that nothing in it changes. While
//! the order lasts every acyclic message is sent, whether it fits before SYNCH, or T_TH lasts, or not.

use super::{Application, Master, Part, SAP_FRAME_OCTETS};
use crate::dp::ms1::{Job, MS1, Pdu};
use crate::fdl::Outbox;
use crate::fdl::active::Request;
use crate::time::Local;
use crate::wire::acyclic::{self, Record};
use crate::wire::{Address, Service};

/// A record that no slave has. Model: beside the parameter channel in the slot of telegram 81, and below I&M.
const NO_RECORD: Record = Record { slot: 1, index: 254 };
/// Octets of data that a DS-Write has at most.
const MAX_DATA: u8 = 240;

/// An order of the scenario: DS-Write in every cycle to a slave.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Overlong {
    /// The slave; one that the master has not in its list is never asked.
    pub to: Address,
    /// Octets of data, 1..=240.
    pub octets: u8,
}

/// How far the order is carried out.
#[derive(Clone, Debug, Default)]
pub(super) struct Overload {
    /// What is ordered.
    job: Option<Job>,
    /// It was not sent in this cycle yet.
    due: bool,
    /// The job under way is the order's and none of the application.
    own: bool,
}

impl Overload {
    pub(super) const fn is_ordered(&self) -> bool {
        self.job.is_some()
    }
    pub(super) const fn cycle_begins(&mut self) {
        self.due = true;
    }
    /// The job under way sends this.
    pub(super) const fn sends(&mut self, du: &[u8]) {
        if self.own && !du.is_empty() {
            self.due = false;
        }
    }
    pub(super) fn end(&mut self) {
        self.job = None;
    }
    /// The job under way is over. Tells whether it was the order's.
    pub(super) const fn over(&mut self) -> bool {
        core::mem::replace(&mut self.own, false)
    }
}

impl<A: Application> Master<A> {
    /// From now on DS-Write in every cycle, or no more: one that is under way goes on as any job does.
    pub(super) fn overload(&mut self, order: Option<Overlong>) {
        self.overload.job = order.and_then(|Overlong { to, octets }| {
            let slave = self.handlers.iter().position(|handler| handler.params().address == to)?;
            let data = [0; MAX_DATA as usize];
            let data = &data[..octets.min(MAX_DATA).into()];
            Some(Job { slave, pdu: Pdu::of(&acyclic::Request::Write { record: NO_RECORD, data }) })
        });
    }
    /// Begins the next acyclic job, the application's before the ordered one.
    pub(super) fn next_job(&mut self, now: Local) {
        let asked = self.app.acyclic();
        self.overload.own = asked.is_none();
        if let Some(job) = asked.as_ref().or(self.overload.job.as_ref()) {
            self.ms1.begin(now, *job, self.handlers[job.slave].params().ms1_timeout);
        }
    }
    /// The ordinary message of the cycle is over: the ordered one, unless it was that; then the GAP.
    pub(super) fn after_message(&mut self, now: Local, out: &mut Outbox) {
        let Some(Job { slave, pdu }) = self.overload.job.filter(|_| self.overload.due) else { return self.gap(out) };
        if self.ms1.is_idle() {
            self.next_job(now);
        }
        // A slave that nobody will poll takes no request.
        let polled = self.overload.own && self.ms1.next().is_some_and(|(at, _)| at == slave);
        if !polled {
            return self.gap(out);
        }
        self.overload.due = false;
        let du = pdu.octets();
        let longest = SAP_FRAME_OCTETS + pdu.longest_answer();
        let retries = self.retries_that_fit(SAP_FRAME_OCTETS + du.len(), longest).unwrap_or(0);
        let to = self.handlers[slave].params().address;
        let request = Request { to, service: Service::SrdLow, saps: Some(MS1), retries };
        self.active.request(self.active.free_at(), &request, du.len(), out, |to| to.copy_from_slice(du));
        self.part = Part::Acyclic;
    }
}
