//! What a class 2 master is used for: a list of jobs, each once or again and again.
//!
//! A parameter takes two services, as PROFIdrive's base mode has it: the request is written to record 47, then its answer
//! is read from there, again while the slave answers "state conflict". A job that is late is done as soon as it can be,
//! and what it missed is not made up for.

use alloc::vec;
use alloc::vec::Vec;

use crate::device::parameter_client::{failure, read, tell, write};
use crate::dp::class2::{Application, Task};
use crate::dp::ms1::{Failure, Pdu};
use crate::fdl::Outbox;
use crate::observation::{AcyclicFailure, AcyclicService, Observation};
use crate::time::{Local, Span};
use crate::wire::Address;
use crate::wire::acyclic::{ErrorCode, Record, Request, Response};
use crate::wire::diag::Diagnosis;
use crate::wire::parameter::ParameterAddress;

/// What to do.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Work {
    /// Read a parameter over MS2.
    Parameter(ParameterAddress),
    /// Read a record over MS2, at most so many octets.
    ReadRecord(Record, u8),
    /// Write a record over MS2.
    WriteRecord(Record, Vec<u8>),
    /// A reading service of DP-V0.
    Read(AcyclicService),
}

/// A job of the tool.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Job {
    /// Number of the slave.
    pub slave: usize,
    /// What to do.
    pub work: Work,
    /// When for the first time, from power on.
    pub start: Span,
    /// And then every so often; none is once.
    pub period: Option<Span>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Stage {
    /// The first service, for most the only one.
    Asked,
    /// The answer of the parameter channel is read.
    Reading,
}

/// The jobs of a class 2 master.
#[derive(Clone, Debug)]
pub struct Tool {
    slaves: Vec<Address>,
    jobs: Vec<(Job, Option<Local>)>,
    /// For each slave the job that runs.
    running: Vec<Option<(usize, Stage)>>,
    reference: u8,
}

impl Tool {
    /// Jobs for these slaves.
    pub fn new(slaves: Vec<Address>, jobs: Vec<Job>) -> Self {
        let running = vec![None; slaves.len()];
        Self { slaves, jobs: jobs.into_iter().map(|job| (job, None)).collect(), running, reference: 0 }
    }

    /// The job of this slave that is due first.
    fn due(&self, now: Local, slave: usize) -> Option<usize> {
        let due = self.jobs.iter().enumerate().filter(|(_, (job, _))| job.slave == slave);
        let due = due.filter_map(|(number, (_, due))| Some((due.filter(|&due| due <= now)?, number)));
        due.min().map(|(_, number)| number)
    }
    fn over(&mut self, now: Local, slave: usize) {
        if let Some((number, _)) = self.running[slave].take() {
            let (job, due) = &mut self.jobs[number];
            *due = due.zip(job.period).map(|(due, period)| (due + period).max(now));
        }
    }
}

impl Application for Tool {
    fn power_on(&mut self, now: Local) {
        for (job, due) in &mut self.jobs {
            *due = Some(now + job.start);
        }
        self.running.fill(None);
    }
    fn next(&mut self, now: Local, slave: usize, out: &mut Outbox) -> Option<Task> {
        if let Some((_, Stage::Reading)) = self.running[slave] {
            return Some(Task::Record(read()));
        }
        let number = self.due(now, slave)?;
        self.running[slave] = Some((number, Stage::Asked));
        Some(match &self.jobs[number].0.work {
            Work::Parameter(parameter) => {
                let ParameterAddress { pnu, subindex, elements, .. } = *parameter;
                let address = self.slaves[slave];
                out.observe(Observation::ParameterRequest { slave: address, pnu, subindex, elements, change: false });
                self.reference = if self.reference == u8::MAX { 1 } else { self.reference + 1 };
                Task::Record(write(self.reference, *parameter, None))
            }
            Work::ReadRecord(record, len) => Task::Record(Pdu::of(&Request::Read { record: *record, len: *len })),
            Work::WriteRecord(record, data) => Task::Record(Pdu::of(&Request::Write { record: *record, data })),
            Work::Read(service) => Task::Read(*service),
        })
    }
    fn done(&mut self, now: Local, slave: usize, answer: Result<&[u8], Failure>, out: &mut Outbox) {
        let Some((number, stage)) = self.running[slave] else { return };
        let address = self.slaves[slave];
        let goes_on = match answer {
            Err(why) => {
                out.observe(Observation::AcyclicFailed { slave: address, why: failure(why) });
                false
            }
            Ok(answer) => answered(address, &self.jobs[number].0.work, stage, answer, out),
        };
        if goes_on {
            self.running[slave] = Some((number, Stage::Reading));
        } else {
            self.over(now, slave);
        }
    }
}

/// Tells what came of a job. Whether the answer of the parameter channel is to be read next.
fn answered(slave: Address, work: &Work, stage: Stage, answer: &[u8], out: &mut Outbox) -> bool {
    if let Work::Read(service) = work {
        was_read(slave, *service, answer, out);
        return false;
    }
    match (work, stage, Response::parse(answer)) {
        (Work::Parameter(_), Stage::Asked, Ok(Response::Write { .. })) => return true,
        (Work::Parameter(_), Stage::Reading, Ok(Response::Negative(negative)))
            if negative.code_1 == ErrorCode::STATE_CONFLICT =>
        {
            return true;
        }
        (Work::Parameter(parameter), Stage::Reading, Ok(Response::Read { data, .. })) => {
            tell(slave, (*parameter, None), data, out);
        }
        (Work::ReadRecord(..), _, Ok(Response::Read { record, data })) => {
            data_of(slave, AcyclicService::RecordRead, Some(record), data, out);
        }
        (Work::WriteRecord(_, data), _, Ok(Response::Write { record, .. })) => {
            data_of(slave, AcyclicService::RecordWrite, Some(record), data, out);
        }
        (_, _, Ok(Response::Negative(negative))) => {
            out.observe(Observation::AcyclicFailed { slave, why: AcyclicFailure::Refused(negative.code_1) });
        }
        _ => out.observe(Observation::AcyclicFailed { slave, why: AcyclicFailure::Unreadable }),
    }
    false
}

fn was_read(slave: Address, service: AcyclicService, answer: &[u8], out: &mut Outbox) {
    if service == AcyclicService::Diagnosis && Diagnosis::parse(answer).is_err() {
        return out.observe(Observation::AcyclicFailed { slave, why: AcyclicFailure::Unreadable });
    }
    data_of(slave, service, None, answer, out);
}
fn data_of(slave: Address, service: AcyclicService, record: Option<Record>, data: &[u8], out: &mut Outbox) {
    let mut head = [0; 8];
    head.iter_mut().zip(data).for_each(|(place, &octet)| *place = octet);
    let record = record.map(|Record { slot, index }| (slot, index));
    out.observe(Observation::AcyclicData { slave, service, record, len: data.len() as u8, head });
}
