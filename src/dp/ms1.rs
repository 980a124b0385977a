//! MS1: records of a slave, read and written by the master that has parameterised it, acyclically.
//!
//! The master sends a request to SAP 51 and gets SC; then it polls with empty requests until the slave's answer is
//! ready. Slave side:
//!
//! | state | request | next state | answer |
//! |---|---|---|---|
//! | Idle | PDU | Working | SC |
//! | Idle | empty | Idle | SC |
//! | Working | empty, not ready yet | Working | SC |
//! | Working | empty, ready | Idle | the answer, DL |
//! | Working | PDU | Working | RR |
//!
//! Master side, see [`Client`]. Source: DP-V1, functions 5E and 5F.

use alloc::vec::Vec;

use crate::time::{Local, Span};
use crate::wire::acyclic::{ErrorCode, Function, Negative, Record, Request, Response};
use crate::wire::{Sap, Status};

/// Destination and source SAP of MS1.
pub const MS1: (Sap, Sap) = (Sap::MS1, Sap::MASTER_MS1);
/// Octets of the longest PDU (C1_Max_Data_Len of the encoders and the head of a write).
pub const MAX_PDU: usize = 244;

/// Octets in front of a record's data: function, slot, index, length.
const RECORD_HEAD: usize = 4;

/// The records of a device.
pub trait Records {
    /// Reads a record, at most as much as fits into `out`. Returns its length (octets).
    ///
    /// # Errors
    /// Class and code of the negative answer.
    fn read(&mut self, record: Record, out: &mut [u8]) -> Result<usize, ErrorCode>;
    /// Writes a record.
    ///
    /// # Errors
    /// Class and code of the negative answer.
    fn write(&mut self, record: Record, data: &[u8]) -> Result<(), ErrorCode>;
}

/// What the slave answers to one request.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Answer<'a> {
    /// SC.
    Acknowledge,
    /// Reply data.
    Data(&'a [u8]),
    /// No data, with this status.
    Refuse(Status),
}

/// The slave's side.
#[derive(Clone, Debug)]
pub struct Server {
    /// Time from a request to its answer.
    working: Span,
    /// When the answer is ready.
    ready: Option<Local>,
    len: usize,
    pdu: [u8; MAX_PDU],
}

impl Server {
    /// A server that needs `working` for an answer.
    pub const fn new(working: Span) -> Self {
        Self { working, ready: None, len: 0, pdu: [0; MAX_PDU] }
    }
    /// Forgets an answer that nobody has asked for yet.
    pub fn reset(&mut self) {
        self.ready = None;
    }
    /// Takes the data unit of one request that arrived at `now`.
    pub fn heard(&mut self, now: Local, du: &[u8], records: &mut impl Records) -> Answer<'_> {
        match (self.ready, du.is_empty()) {
            (None, false) => {
                self.len = serve(du, records, &mut self.pdu);
                self.ready = Some(now + self.working);
                Answer::Acknowledge
            }
            (Some(ready), true) if now >= ready => {
                self.ready = None;
                Answer::Data(&self.pdu[..self.len])
            }
            // Nothing asked, or not ready yet.
            (None | Some(_), true) => Answer::Acknowledge,
            (Some(_), false) => Answer::Refuse(Status::Rr),
        }
    }
}

/// Carries out the request `pdu` and writes the answer. Returns its length.
fn serve(pdu: &[u8], records: &mut impl Records, out: &mut [u8; MAX_PDU]) -> usize {
    let mut data = [0; MAX_PDU - RECORD_HEAD];
    let response = match Request::parse(pdu) {
        Ok(Request::Read { record, len }) => {
            let most = usize::from(len).min(data.len());
            match records.read(record, &mut data[..most]) {
                Ok(len) => Response::Read { record, data: &data[..len] },
                Err(code) => Response::Negative(Negative::new(Function::Read, code)),
            }
        }
        Ok(Request::Write { record, data }) => match records.write(record, data) {
            Ok(()) => Response::Write { record, len: data.len() as u8 },
            Err(code) => Response::Negative(Negative::new(Function::Write, code)),
        },
        // A function that this server has not, or a PDU that is none.
        _ => {
            let function = pdu.first().copied().and_then(|code| Function::from_code(code & 0x7F));
            let code = match function {
                // Its length octet does not count the data that follow.
                Some(Function::Write) => ErrorCode::WRITE_LENGTH,
                _ => ErrorCode::NOT_SUPPORTED,
            };
            Response::Negative(Negative::new(function.unwrap_or(Function::Idle), code))
        }
    };
    response.emit(out).unwrap_or(0)
}

/// Why a job of the master ended without an answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Failure {
    /// The slave's SAP is closed.
    Closed,
    /// Nothing came within C1_Response_Timeout.
    Timeout,
    /// The slave left data exchange.
    Left,
}

/// A PDU for a slave, named by its index in the master's list.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Job {
    /// The slave.
    pub slave: usize,
    /// The request.
    pub pdu: Vec<u8>,
}

/// The master's side: one job at a time.
#[derive(Clone, Debug)]
pub struct Client {
    timeout: Span,
    job: Option<(Job, Stage)>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Stage {
    since: Local,
    /// The slave has the request: from now on it is polled.
    polling: bool,
}

/// What became of the job with one answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Progress<'a> {
    /// It goes on.
    Going,
    /// The slave answered it.
    Done {
        /// The slave.
        slave: usize,
        /// The answer.
        pdu: &'a [u8],
    },
    /// It is over.
    Failed {
        /// The slave.
        slave: usize,
        /// Why.
        why: Failure,
    },
}

impl Client {
    /// A client that gives a job up after `timeout` (C1_Response_Timeout).
    pub const fn new(timeout: Span) -> Self {
        Self { timeout, job: None }
    }
    /// Whether there is no job.
    pub const fn is_idle(&self) -> bool {
        self.job.is_none()
    }
    /// Begins a job. There must be none.
    pub fn begin(&mut self, now: Local, job: Job) {
        debug_assert!(self.job.is_none(), "one job at a time");
        self.job = Some((job, Stage { since: now, polling: false }));
    }
    /// The slave of the job and the data unit to send next.
    pub fn next(&self) -> Option<(usize, &[u8])> {
        let (job, stage) = self.job.as_ref()?;
        Some((job.slave, if stage.polling { &[] } else { &job.pdu }))
    }
    /// Octets of the longest answer to the job.
    pub fn longest_answer(&self) -> usize {
        match self.job.as_ref().map(|(job, _)| job.pdu.as_slice()) {
            // A read says how much it takes; every other answer is its head alone.
            Some(&[read, _, _, len, ..]) if read == Function::Read.code() => RECORD_HEAD + usize::from(len),
            _ => RECORD_HEAD,
        }
    }
    /// Takes what came back: SC (`Ok(None)`), data, a status without data, or nothing.
    pub fn answered<'a>(&mut self, now: Local, answer: Result<Option<&'a [u8]>, Option<Status>>) -> Progress<'a> {
        let Some((job, stage)) = &mut self.job else { return Progress::Going };
        let slave = job.slave;
        let progress = match answer {
            Ok(Some(pdu)) if stage.polling => Progress::Done { slave, pdu },
            Ok(None) => {
                stage.polling = true;
                Progress::Going
            }
            Err(Some(Status::Rs)) => Progress::Failed { slave, why: Failure::Closed },
            // No resources, or nothing heard: the same again until the time is over.
            _ => Progress::Going,
        };
        let over = now - stage.since > self.timeout && progress == Progress::Going;
        let progress = if over { Progress::Failed { slave, why: Failure::Timeout } } else { progress };
        if progress != Progress::Going {
            self.job = None;
        }
        progress
    }
    /// A slave left data exchange. Tells whether this ended the job.
    pub fn left(&mut self, slave: usize) -> bool {
        let mine = self.job.as_ref().is_some_and(|(job, _)| job.slave == slave);
        if mine {
            self.job = None;
        }
        mine
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Record 47 of slot 1 keeps what was written.
    struct One(Vec<u8>);
    impl Records for One {
        fn read(&mut self, record: Record, out: &mut [u8]) -> Result<usize, ErrorCode> {
            if (record.slot, record.index) != (1, 47) {
                return Err(ErrorCode::INDEX);
            }
            let len = self.0.len().min(out.len());
            out[..len].copy_from_slice(&self.0[..len]);
            Ok(len)
        }
        fn write(&mut self, record: Record, data: &[u8]) -> Result<(), ErrorCode> {
            if record.slot != 1 {
                return Err(ErrorCode::SLOT);
            }
            self.0 = data.to_vec();
            Ok(())
        }
    }
    const MS: Span = Span::from_ms(1);
    fn at(ms: i64) -> Local {
        Local::ZERO + MS * ms
    }

    #[test]
    fn the_slave_side_table() {
        let mut server = Server::new(MS * 2);
        let mut one = One(Vec::new());
        let write = [0x5F, 1, 47, 2, 7, 8];
        assert_eq!(server.heard(at(0), &[], &mut one), Answer::Acknowledge, "idle, polled");
        assert_eq!(server.heard(at(0), &write, &mut one), Answer::Acknowledge, "idle, request");
        assert_eq!(server.heard(at(1), &[], &mut one), Answer::Acknowledge, "not ready");
        assert_eq!(server.heard(at(1), &write, &mut one), Answer::Refuse(Status::Rr), "busy");
        assert_eq!(server.heard(at(2), &[], &mut one), Answer::Data(&[0x5F, 1, 47, 2]), "ready");
        assert_eq!(server.heard(at(3), &[], &mut one), Answer::Acknowledge, "given once");
        assert_eq!(server.heard(at(3), &[0x5E, 1, 47, 240], &mut one), Answer::Acknowledge);
        assert_eq!(server.heard(at(9), &[], &mut one), Answer::Data(&[0x5E, 1, 47, 2, 7, 8]));
    }

    #[test]
    fn what_cannot_be_done_gets_a_negative_answer() {
        let mut one = One(Vec::new());
        for (pdu, answer) in [
            (&[0x5E, 1, 9, 240][..], [0xDE, 0x80, 0xB0, 0]),
            (&[0x5F, 2, 47, 1, 0], [0xDF, 0x80, 0xB2, 0]),
            (&[0x5F, 1, 47, 2, 0], [0xDF, 0x80, 0xB1, 0]),
            (&[0x5F, 1], [0xDF, 0x80, 0xB1, 0]),
            (&[0x51, 1, 47, 1, 0], [0xD1, 0x80, 0xA9, 0]),
        ] {
            let mut server = Server::new(Span::ZERO);
            server.heard(at(0), pdu, &mut one);
            assert_eq!(server.heard(at(0), &[], &mut one), Answer::Data(&answer), "{pdu:02X?}");
        }
    }

    #[test]
    fn the_master_side_goes_on_until_an_answer_a_refusal_or_the_time_ends_it() {
        let job = || Job { slave: 3, pdu: alloc::vec![0x5E] };
        let mut client = Client::new(MS * 10);
        client.begin(at(0), job());
        assert_eq!(client.next(), Some((3, &[0x5E][..])));
        assert_eq!(client.answered(at(1), Err(Some(Status::Rr))), Progress::Going);
        assert_eq!(client.next(), Some((3, &[0x5E][..])), "busy: the same again");
        assert_eq!(client.answered(at(2), Ok(None)), Progress::Going);
        assert_eq!(client.next(), Some((3, &[][..])), "polls");
        assert_eq!(client.answered(at(3), Ok(Some(&[9]))), Progress::Done { slave: 3, pdu: &[9] });
        assert!(client.is_idle());

        client.begin(at(0), job());
        assert_eq!(client.answered(at(11), Err(None)), Progress::Failed { slave: 3, why: Failure::Timeout });
        client.begin(at(0), job());
        let closed = client.answered(at(1), Err(Some(Status::Rs)));
        assert_eq!(closed, Progress::Failed { slave: 3, why: Failure::Closed });
        client.begin(at(0), job());
        assert!(!client.left(2) && client.left(3) && client.is_idle());
    }
}
