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
//! The slave opens it with data exchange if DPV1_Enable is set, and forgets what it has not given when it leaves. Master
//! side, see [`Client`]; a job is over with an answer, positive or negative, with RS, with the end of data exchange, or
//! after C1_Response_Timeout. Source: DP-V1, functions 5E and 5F.

use core::fmt;

use crate::observation::AcyclicResult;
use crate::time::{Local, Span};
use crate::wire::acyclic::{ErrorCode, Function, Negative, Record, Request, Response};
use crate::wire::{Sap, Status};

/// Destination and source SAP of MS1.
pub const MS1: (Sap, Sap) = (Sap::MS1, Sap::MASTER_MS1);
/// Octets of the longest PDU (C1_Max_Data_Len of the encoders and the head of a write).
pub const MAX_PDU: usize = 244;

/// Bit 7 of the function number of a negative answer.
const NEGATIVE: u8 = 0x80;
/// Octets in front of a record's data: function, slot, index, length.
const RECORD_HEAD: usize = 4;

/// Through which acyclic connection a record is meant: an answer of the parameter channel is for who has asked for it.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Access {
    /// The master that has parameterised the slave.
    Ms1,
    /// The MS2 connection at this SAP.
    Ms2(u8),
}

/// The records of a device.
pub trait Records {
    /// Reads a record, at most as much as fits into `out`. Returns its length (octets).
    ///
    /// # Errors
    /// Class and code of the negative answer.
    fn read(&mut self, access: Access, record: Record, out: &mut [u8]) -> Result<usize, ErrorCode>;
    /// Writes a record.
    ///
    /// # Errors
    /// Class and code of the negative answer.
    fn write(&mut self, access: Access, record: Record, data: &[u8]) -> Result<(), ErrorCode>;
    /// The connection is over: what it has asked for is forgotten.
    fn closed(&mut self, access: Access);
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
    /// Octets of the longest data of a record, C1_Max_Data_Len.
    max_data: u8,
    /// When the answer is ready.
    ready: Option<Local>,
    len: usize,
    pdu: [u8; MAX_PDU],
}

impl Server {
    /// A server that needs `working` for an answer and takes and gives records of up to `max_data` octets.
    pub const fn new(working: Span, max_data: u8) -> Self {
        Self { working, max_data, ready: None, len: 0, pdu: [0; MAX_PDU] }
    }
    /// Data exchange is over: forgets an answer that nobody has asked for yet.
    pub fn reset(&mut self, records: &mut impl Records) {
        self.ready = None;
        records.closed(Access::Ms1);
    }
    /// Takes the data unit of one request that arrived at `now`.
    pub fn heard(&mut self, now: Local, du: &[u8], records: &mut impl Records) -> Answer<'_> {
        match (self.ready, du.is_empty()) {
            (None, false) => {
                self.len = serve(Access::Ms1, du, self.max_data, records, &mut self.pdu);
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
pub(crate) fn serve(
    access: Access,
    pdu: &[u8],
    max_data: u8,
    records: &mut impl Records,
    out: &mut [u8; MAX_PDU],
) -> usize {
    let mut data = [0; MAX_PDU - RECORD_HEAD];
    let response = match Request::parse(pdu) {
        Ok(Request::Read { record, len }) => {
            let most = usize::from(len.min(max_data)).min(data.len());
            match records.read(access, record, &mut data[..most]) {
                Ok(len) => Response::Read { record, data: &data[..len] },
                Err(code) => Response::Negative(Negative::new(Function::Read, code)),
            }
        }
        Ok(Request::Write { data, .. }) if data.len() > usize::from(max_data) => {
            Response::Negative(Negative::new(Function::Write, ErrorCode::WRITE_LENGTH))
        }
        Ok(Request::Write { record, data }) => match records.write(access, record, data) {
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
    /// The MS2 connection was aborted, by either side: octet 3 of the abort.
    Aborted(u8),
}

/// How a service ended, for who counts.
pub fn result(answer: Result<&[u8], Failure>) -> AcyclicResult {
    match answer {
        Ok([function, ..]) if *function & NEGATIVE != 0 => AcyclicResult::Negative,
        Ok(_) => AcyclicResult::Positive,
        Err(Failure::Timeout) => AcyclicResult::Timeout,
        Err(Failure::Closed | Failure::Left | Failure::Aborted(_)) => AcyclicResult::Broken,
    }
}

/// The octets of a PDU, kept without a heap.
#[derive(Clone, Copy)]
pub struct Pdu {
    octets: [u8; MAX_PDU],
    len: u8,
}
impl Pdu {
    /// No octets.
    pub const EMPTY: Self = Self { octets: [0; MAX_PDU], len: 0 };

    /// A request. Empty if it has more than [`MAX_PDU`] octets.
    pub fn of(request: &Request<'_>) -> Self {
        let mut octets = [0; MAX_PDU];
        let len = request.emit(&mut octets).unwrap_or(0);
        Self { octets, len: len as u8 }
    }
    /// These octets, at most [`MAX_PDU`] of them.
    pub fn from_octets(from: &[u8]) -> Self {
        let len = from.len().min(MAX_PDU);
        let mut octets = [0; MAX_PDU];
        octets[..len].copy_from_slice(&from[..len]);
        Self { octets, len: len as u8 }
    }
    /// The octets.
    pub fn octets(&self) -> &[u8] {
        &self.octets[..self.len.into()]
    }
    /// Octets of the longest answer to this request.
    pub fn longest_answer(&self) -> usize {
        match *self.octets() {
            // A read says how much it takes; every other answer is its head alone.
            [read, _, _, len, ..] if read == Function::Read.code() => RECORD_HEAD + usize::from(len),
            _ => RECORD_HEAD,
        }
    }
}
impl PartialEq for Pdu {
    fn eq(&self, other: &Self) -> bool {
        self.octets() == other.octets()
    }
}
impl Eq for Pdu {}
impl fmt::Debug for Pdu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:02X?}", self.octets())
    }
}

/// A PDU for a slave, named by its index in the master's list.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Job {
    /// The slave.
    pub slave: usize,
    /// The request.
    pub pdu: Pdu,
}

/// The master's side: one job at a time.
#[derive(Clone, Debug, Default)]
pub struct Client {
    job: Option<(Job, Stage)>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Stage {
    since: Local,
    /// C1_Response_Timeout of the slave.
    timeout: Span,
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
    /// A client without a job.
    pub const fn new() -> Self {
        Self { job: None }
    }
    /// Whether there is no job.
    pub const fn is_idle(&self) -> bool {
        self.job.is_none()
    }
    /// Begins a job, which is given up after `timeout` (C1_Response_Timeout of the slave). There must be none.
    pub fn begin(&mut self, now: Local, job: Job, timeout: Span) {
        debug_assert!(self.job.is_none(), "one job at a time");
        self.job = Some((job, Stage { since: now, timeout, polling: false }));
    }
    /// The slave of the job and the data unit to send next.
    pub fn next(&self) -> Option<(usize, &[u8])> {
        let (job, stage) = self.job.as_ref()?;
        Some((job.slave, if stage.polling { &[] } else { job.pdu.octets() }))
    }
    /// Octets of the longest answer to the job.
    pub fn longest_answer(&self) -> usize {
        self.job.as_ref().map_or(RECORD_HEAD, |(job, _)| job.pdu.longest_answer())
    }
    /// When the job began.
    pub fn since(&self) -> Option<Local> {
        self.job.as_ref().map(|(_, stage)| stage.since)
    }
    /// The slave of a job whose time is over at `now`; it is given up.
    pub fn overdue(&mut self, now: Local) -> Option<usize> {
        let over = self.job.take_if(|(_, stage)| now - stage.since > stage.timeout);
        over.map(|(job, _)| job.slave)
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
        if progress != Progress::Going {
            self.job = None;
        } else if let Some(slave) = self.overdue(now) {
            return Progress::Failed { slave, why: Failure::Timeout };
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
    use alloc::vec::Vec;

    /// Record 47 of slot 1 keeps what was written.
    struct One(Vec<u8>);
    impl Records for One {
        fn read(&mut self, _access: Access, record: Record, out: &mut [u8]) -> Result<usize, ErrorCode> {
            if (record.slot, record.index) != (1, 47) {
                return Err(ErrorCode::INDEX);
            }
            let len = self.0.len().min(out.len());
            out[..len].copy_from_slice(&self.0[..len]);
            Ok(len)
        }
        fn write(&mut self, _access: Access, record: Record, data: &[u8]) -> Result<(), ErrorCode> {
            if record.slot != 1 {
                return Err(ErrorCode::SLOT);
            }
            self.0 = data.to_vec();
            Ok(())
        }
        fn closed(&mut self, _access: Access) {
            self.0.clear();
        }
    }
    const MS: Span = Span::from_ms(1);
    fn at(ms: i64) -> Local {
        Local::ZERO + MS * ms
    }

    #[test]
    fn the_slave_side_table() {
        let mut server = Server::new(MS * 2, 240);
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
            let mut server = Server::new(Span::ZERO, 240);
            server.heard(at(0), pdu, &mut one);
            assert_eq!(server.heard(at(0), &[], &mut one), Answer::Data(&answer), "{pdu:02X?}");
        }
    }

    #[test]
    fn the_master_side_goes_on_until_an_answer_a_refusal_or_the_time_ends_it() {
        let job = || Job { slave: 3, pdu: Pdu::from_octets(&[0x5E]) };
        let mut client = Client::new();
        client.begin(at(0), job(), MS * 10);
        assert_eq!(client.next(), Some((3, &[0x5E][..])));
        assert_eq!(client.answered(at(1), Err(Some(Status::Rr))), Progress::Going);
        assert_eq!(client.next(), Some((3, &[0x5E][..])), "busy: the same again");
        assert_eq!(client.answered(at(2), Ok(None)), Progress::Going);
        assert_eq!(client.next(), Some((3, &[][..])), "polls");
        assert_eq!(client.answered(at(3), Ok(Some(&[9]))), Progress::Done { slave: 3, pdu: &[9] });
        assert!(client.is_idle());

        client.begin(at(0), job(), MS * 10);
        assert_eq!(client.answered(at(11), Err(None)), Progress::Failed { slave: 3, why: Failure::Timeout });
        client.begin(at(0), job(), MS * 10);
        let closed = client.answered(at(1), Err(Some(Status::Rs)));
        assert_eq!(closed, Progress::Failed { slave: 3, why: Failure::Closed });
        client.begin(at(0), job(), MS * 10);
        assert!(!client.left(2) && client.left(3) && client.is_idle());
    }

    /// Records that refuse everything with one code.
    struct Refusing(ErrorCode);
    impl Records for Refusing {
        fn read(&mut self, _access: Access, _record: Record, _out: &mut [u8]) -> Result<usize, ErrorCode> {
            Err(self.0)
        }
        fn write(&mut self, _access: Access, _record: Record, _data: &[u8]) -> Result<(), ErrorCode> {
            Err(self.0)
        }
        fn closed(&mut self, _access: Access) {}
    }

    #[test]
    fn every_class_and_code_goes_through_as_it_is() {
        for code in 0..=u8::MAX {
            for (pdu, function) in [(&[0x5E, 1, 47, 240][..], 0xDE), (&[0x5F, 1, 47, 1, 0], 0xDF)] {
                let mut server = Server::new(Span::ZERO, 240);
                server.heard(at(0), pdu, &mut Refusing(ErrorCode(code)));
                let answer = server.heard(at(0), &[], &mut Refusing(ErrorCode(code)));
                assert_eq!(answer, Answer::Data(&[function, 0x80, code, 0]));
            }
        }
    }

    #[test]
    fn a_slave_with_short_records_takes_and_gives_no_more() {
        let mut one = One((0..10).collect());
        let mut server = Server::new(Span::ZERO, 4);
        server.heard(at(0), &[0x5F, 1, 47, 5, 1, 2, 3, 4, 5], &mut one);
        assert_eq!(server.heard(at(0), &[], &mut one), Answer::Data(&[0xDF, 0x80, 0xB1, 0]), "longer than allowed");
        server.heard(at(0), &[0x5E, 1, 47, 240], &mut one);
        assert_eq!(server.heard(at(0), &[], &mut one), Answer::Data(&[0x5E, 1, 47, 4, 0, 1, 2, 3]));
        server.heard(at(0), &[0x5F, 1, 47, 4, 1, 2, 3, 4], &mut one);
        assert_eq!(server.heard(at(0), &[], &mut one), Answer::Data(&[0x5F, 1, 47, 4]), "just as long as allowed");
    }

    #[test]
    fn leaving_data_exchange_forgets_the_answer_and_what_was_written() {
        let mut one = One(Vec::new());
        let mut server = Server::new(MS, 240);
        server.heard(at(0), &[0x5F, 1, 47, 2, 7, 8], &mut one);
        server.reset(&mut one);
        assert_eq!(server.heard(at(2), &[], &mut one), Answer::Acknowledge, "nothing left to give");
        assert!(one.0.is_empty());
    }

    #[test]
    fn a_job_that_is_never_sent_is_given_up_too() {
        let mut client = Client::new();
        assert_eq!(client.overdue(at(99)), None, "no job");
        client.begin(at(0), Job { slave: 3, pdu: Pdu::EMPTY }, MS * 10);
        assert_eq!(client.overdue(at(10)), None, "just in time");
        assert_eq!(client.overdue(at(11)), Some(3));
        assert!(client.is_idle());
    }
}
