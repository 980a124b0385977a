//! The class 2 master's side of one MS2 connection.
//!
//! | state | answer or time | next state | what is sent |
//! |---|---|---|---|
//! | Closed | [`connect`](Client::connect) | Opening | Initiate to SAP 49 |
//! | Opening, at SAP 49 | RM | Opening, at the named SAP | polls |
//! | Opening, at SAP 49 | RS; an answer that is none | Closed | - |
//! | Opening, at the named SAP | SC | Opening | polls |
//! | Opening, at the named SAP | Initiate response | Open | - |
//! | Open | [`begin`](Client::begin) | Working | the request |
//! | Open | Send_Timeout over since the last answer | Working | Idle |
//! | Working, asking | SC | Working, polling | polls |
//! | Working, asking | RR | Working | the same again |
//! | Working, polling | SC | Working | polls |
//! | Working, polling | the answer, also a negative one | Open | - |
//! | Opening, Working | Abort | Closed | - |
//! | Opening, Working | RS at the named SAP | Closed | - |
//! | Opening, Working | another PDU | Aborting (RE) | Abort |
//! | Opening, Working | C2_Response_Timeout over | Aborting (TO); Closed before a SAP was named | Abort |
//! | Aborting | anything, or nothing | Closed | - |
//!
//! Nothing heard is no reason to give up before the time is over: the same is sent again.

use crate::dp::ms1::{Failure, Pdu};
use crate::dp::ms2::{FEATURES, HERE, TIMEOUT_UNIT};
use crate::fdl::Outbox;
use crate::observation::{ConnectionCause, ConnectionState, Observation};
use crate::time::{Local, Span};
use crate::wire::acyclic::{Abort, AbortCode, Ends, Function, InitiateReq, Request, Response};
use crate::wire::{Address, Sap, Status};

/// Octets of the longest answer to an Initiate: 12 and two ends without routing.
const MAX_INITIATE_RES: usize = 16;
/// Octets of an RM.
const RM_LEN: usize = 4;
/// Octets in front of a record's data.
const RECORD_HEAD: usize = 4;

/// What a class 2 master asks of its connections.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Settings {
    /// Own Send_Timeout (10 ms).
    pub send_timeout: u16,
    /// C2_Response_Timeout, after which a request is given up.
    pub response_timeout: Span,
    /// Profile_Ident_Number of the Initiate; 3D00 for encoders.
    pub profile_ident: u16,
}

/// What to send to the slave.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Sending<'a> {
    /// The slave's SAP.
    pub sap: Sap,
    /// Data unit.
    pub du: &'a [u8],
    /// Octets of the longest answer.
    pub longest_answer: usize,
}

/// What became of a connection with one answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Progress<'a> {
    /// It goes on.
    Going,
    /// It is open.
    Opened,
    /// The slave answered the request.
    Done(&'a [u8]),
    /// It is over, and with it the request if there was one.
    Over {
        /// Why.
        why: Failure,
        /// A request of the user had been begun.
        request: bool,
    },
}

/// One connection of a class 2 master; one request at a time.
#[derive(Clone, Debug)]
pub struct Client {
    settings: Settings,
    slave: Address,
    state: ConnectionState,
    /// SAP of the connection, 49 before it is named.
    sap: Sap,
    /// Send_Timeout in force.
    timeout: Span,
    /// When the running request began, or the last answer came.
    since: Local,
    /// The slave has the request: from now on it is polled.
    polling: bool,
    pdu: Pdu,
}

impl Client {
    /// A closed connection to `slave`.
    pub const fn new(slave: Address, settings: Settings) -> Self {
        Self {
            settings,
            slave,
            state: ConnectionState::Closed,
            sap: Sap::MS2_RM,
            timeout: Span::ZERO,
            since: Local::ZERO,
            polling: false,
            pdu: Pdu::EMPTY,
        }
    }
    /// The slave.
    pub const fn slave(&self) -> Address {
        self.slave
    }
    /// State now.
    pub const fn state(&self) -> ConnectionState {
        self.state
    }
    fn enter(&mut self, state: ConnectionState, why: ConnectionCause, out: &mut Outbox) {
        let from = core::mem::replace(&mut self.state, state);
        out.observe(Observation::Connection { peer: self.slave, sap: self.sap, from, to: state, why });
        if state == ConnectionState::Closed {
            self.sap = Sap::MS2_RM;
        }
    }

    /// Opens the connection. It must be closed.
    pub fn connect(&mut self, now: Local, out: &mut Outbox) {
        debug_assert!(self.state == ConnectionState::Closed, "a connection is opened once");
        let ends = Ends { source_type: 0, source: &HERE, destination_type: 0, destination: &HERE };
        let Settings { send_timeout, profile_ident, .. } = self.settings;
        let initiate = InitiateReq { send_timeout, features: FEATURES, profile_features: [0; 2], profile_ident, ends };
        self.ask(now, Pdu::of(&Request::Initiate(initiate)));
        self.enter(ConnectionState::Opening, ConnectionCause::Initiated, out);
    }
    /// Begins a request. The connection must be open.
    pub fn begin(&mut self, now: Local, pdu: Pdu) {
        debug_assert!(self.state == ConnectionState::Open, "one request at a time");
        self.ask(now, pdu);
        self.state = ConnectionState::Working;
    }
    fn ask(&mut self, now: Local, pdu: Pdu) {
        (self.pdu, self.polling, self.since) = (pdu, false, now);
    }
    /// Gives the connection up.
    pub fn abort(&mut self, code: AbortCode, out: &mut Outbox) {
        self.pdu = Pdu::of(&Request::Abort(Abort::new(code)));
        self.polling = false;
        let named = self.sap != Sap::MS2_RM;
        let next = if named { ConnectionState::Aborting } else { ConnectionState::Closed };
        self.enter(next, ConnectionCause::GaveUp(code), out);
    }

    /// What to send at `now`, if there is something. Sends Idle where nothing else was sent for Send_Timeout.
    pub fn next(&mut self, now: Local) -> Option<Sending<'_>> {
        if self.state == ConnectionState::Open && now - self.since >= self.timeout {
            self.begin(now, Pdu::of(&Request::Idle));
        }
        let longest_answer = match self.state {
            ConnectionState::Closed | ConnectionState::Open => return None,
            ConnectionState::Opening if !self.polling => RM_LEN,
            ConnectionState::Opening => MAX_INITIATE_RES,
            ConnectionState::Working => self.pdu.longest_answer(),
            ConnectionState::Aborting => RECORD_HEAD,
        };
        let du = if self.polling { &[] } else { self.pdu.octets() };
        Some(Sending { sap: self.sap, du, longest_answer })
    }
    /// When [`next`](Self::next) has an Idle to send, unless something else comes first.
    pub fn idle_at(&self) -> Option<Local> {
        (self.state == ConnectionState::Open).then_some(self.since + self.timeout)
    }
    /// Gives up what runs for longer than C2_Response_Timeout.
    pub fn overdue(&mut self, now: Local, out: &mut Outbox) -> Progress<'static> {
        let waits = matches!(self.state, ConnectionState::Opening | ConnectionState::Working);
        if !waits || now - self.since <= self.settings.response_timeout {
            return Progress::Going;
        }
        let request = self.has_request();
        self.abort(AbortCode::Timeout, out);
        Progress::Over { why: Failure::Timeout, request }
    }
    /// Whether a request of the user runs: all but Idle.
    fn has_request(&self) -> bool {
        self.state == ConnectionState::Working && self.pdu.octets().first() != Some(&Function::Idle.code())
    }

    /// Takes what came back: SC (`Ok(None)`), data, a status without data, or nothing.
    pub fn answered<'a>(
        &mut self,
        now: Local,
        answer: Result<Option<&'a [u8]>, Option<Status>>,
        out: &mut Outbox,
    ) -> Progress<'a> {
        let progress = match (self.state, answer) {
            (ConnectionState::Closed | ConnectionState::Open, _) => Progress::Going,
            (ConnectionState::Aborting, _) => {
                self.enter(ConnectionState::Closed, ConnectionCause::Told, out);
                Progress::Going
            }
            (_, Err(Some(Status::Rs))) => self.over(ConnectionCause::Refused, Failure::Closed, out),
            (_, Ok(Some(pdu))) => self.data(now, pdu, out),
            // The resource manager answers at once; an SC of it says nothing.
            (state, Ok(None)) => {
                self.polling |= state == ConnectionState::Working;
                Progress::Going
            }
            // No resources, or nothing heard: the same again until the time is over.
            (_, Err(_)) => Progress::Going,
        };
        if progress == Progress::Going { self.overdue(now, out) } else { progress }
    }
    fn over(&mut self, cause: ConnectionCause, why: Failure, out: &mut Outbox) -> Progress<'static> {
        let request = self.has_request();
        self.enter(ConnectionState::Closed, cause, out);
        Progress::Over { why, request }
    }
    fn data<'a>(&mut self, now: Local, pdu: &'a [u8], out: &mut Outbox) -> Progress<'a> {
        match (self.state, Response::parse(pdu)) {
            (_, Ok(Response::Abort(abort))) => {
                self.over(ConnectionCause::Aborted(abort.reason), Failure::Aborted(abort.reason), out)
            }
            (ConnectionState::Opening, Ok(Response::ResourceManager { server_sap, send_timeout }))
                if !self.polling && server_sap <= Sap::MS2_LAST.0 =>
            {
                (self.sap, self.polling) = (Sap(server_sap), true);
                self.timeout = TIMEOUT_UNIT * i64::from(send_timeout.max(self.settings.send_timeout));
                Progress::Going
            }
            (ConnectionState::Opening, Ok(Response::Initiate(_))) if self.polling => {
                self.since = now;
                self.polling = false;
                self.enter(ConnectionState::Open, ConnectionCause::Confirmed, out);
                Progress::Opened
            }
            (ConnectionState::Working, Ok(_)) if self.polling && self.is_answered_by(pdu) => {
                let request = self.has_request();
                (self.state, self.since, self.polling) = (ConnectionState::Open, now, false);
                if request { Progress::Done(pdu) } else { Progress::Going }
            }
            _ => {
                let request = self.has_request();
                self.abort(AbortCode::Response, out);
                Progress::Over { why: Failure::Aborted(Abort::new(AbortCode::Response).reason), request }
            }
        }
    }
    /// Whether `pdu` is about the function asked for, as it is or refused.
    fn is_answered_by(&self, pdu: &[u8]) -> bool {
        let function = |pdu: &[u8]| pdu.first().map(|code| code & 0x7F);
        function(pdu) == function(self.pdu.octets())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Span = Span::from_ms(1);
    fn at(ms: i64) -> Local {
        Local::ZERO + MS * ms
    }
    const SLAVE: Address = Address::new(6).unwrap();
    const RM: [u8; 4] = [0x56, 1, 0, 100];
    const INITIATED: [u8; 16] = [0x57, 240, 1, 0, 0, 0, 0x3D, 0, 0, 2, 0, 2, 0, 0, 0, 0];
    const ABORT: [u8; 4] = [0x58, 0, 0x13, 0];
    const READ: [u8; 4] = [0x5E, 1, 47, 240];

    fn client() -> Client {
        let settings = Settings { send_timeout: 50, response_timeout: MS * 3_000, profile_ident: 0x3D00 };
        Client::new(SLAVE, settings)
    }
    /// A client in this state; `polling` tells which half of it.
    fn in_state(state: ConnectionState, polling: bool) -> Client {
        let (mut client, mut out) = (client(), Outbox::new());
        if state == ConnectionState::Closed {
            return client;
        }
        client.connect(at(0), &mut out);
        if (state, polling) != (ConnectionState::Opening, false) {
            assert_eq!(client.answered(at(0), Ok(Some(&RM)), &mut out), Progress::Going);
        }
        if matches!(state, ConnectionState::Open | ConnectionState::Working) {
            assert_eq!(client.answered(at(0), Ok(Some(&INITIATED)), &mut out), Progress::Opened);
        }
        match state {
            ConnectionState::Working => {
                client.begin(at(0), Pdu::from_octets(&READ));
                if polling {
                    client.answered(at(0), Ok(None), &mut out);
                }
            }
            ConnectionState::Aborting => client.abort(AbortCode::Timeout, &mut out),
            _ => {}
        }
        assert_eq!((client.state(), client.polling), (state, polling && state != ConnectionState::Aborting));
        client
    }

    /// Every state with every answer; the table of the file header.
    #[test]
    fn states_and_answers() {
        use ConnectionState::{Aborting, Closed, Open, Opening, Working};
        let read: &[u8] = &[0x5E, 1, 47, 1, 9];
        let negative: &[u8] = &[0xDE, 0x80, 0xB5, 0];
        let answers: [Result<Option<&[u8]>, Option<Status>>; 9] = [
            Ok(None),
            Ok(Some(&RM)),
            Ok(Some(&INITIATED)),
            Ok(Some(read)),
            Ok(Some(negative)),
            Ok(Some(&ABORT)),
            Err(Some(Status::Rr)),
            Err(Some(Status::Rs)),
            Err(None),
        ];
        let table = [
            ((Closed, false), [Closed; 9]),
            ((Opening, false), [Opening, Opening, Closed, Closed, Closed, Closed, Opening, Closed, Opening]),
            ((Opening, true), [Opening, Aborting, Open, Aborting, Aborting, Closed, Opening, Closed, Opening]),
            ((Open, false), [Open; 9]),
            ((Working, false), [Working, Aborting, Aborting, Aborting, Aborting, Closed, Working, Closed, Working]),
            ((Working, true), [Working, Aborting, Aborting, Open, Open, Closed, Working, Closed, Working]),
            ((Aborting, false), [Closed; 9]),
        ];
        for ((state, polling), row) in table {
            for (answer, next) in answers.into_iter().zip(row) {
                let mut client = in_state(state, polling);
                client.answered(at(1), answer, &mut Outbox::new());
                assert_eq!(client.state(), next, "{state} polling {polling} {answer:02X?}");
            }
        }
    }

    #[test]
    fn what_is_sent_in_each_state() {
        let mut client = client();
        assert_eq!(client.next(at(0)), None);
        client.connect(at(0), &mut Outbox::new());
        let sending = client.next(at(0)).unwrap();
        let initiate = [0x57, 0, 0, 0, 0, 50, 1, 0, 0, 0, 0x3D, 0, 0, 2, 0, 2, 0, 0, 0, 0];
        assert_eq!(sending, Sending { sap: Sap(49), du: &initiate, longest_answer: 4 });
        let mut client = in_state(ConnectionState::Opening, true);
        assert_eq!(client.next(at(0)), Some(Sending { sap: Sap(1), du: &[], longest_answer: 16 }));
        let mut client = in_state(ConnectionState::Working, false);
        assert_eq!(client.next(at(0)), Some(Sending { sap: Sap(1), du: &READ, longest_answer: 244 }));
        let mut client = in_state(ConnectionState::Working, true);
        assert_eq!(client.next(at(0)), Some(Sending { sap: Sap(1), du: &[], longest_answer: 244 }));
        let mut client = in_state(ConnectionState::Aborting, false);
        assert_eq!(client.next(at(0)).unwrap().du, ABORT);
    }

    #[test]
    fn idle_comes_after_the_longer_send_timeout_and_is_no_request() {
        let mut client = in_state(ConnectionState::Open, false);
        let mut out = Outbox::new();
        assert_eq!(client.next(at(999)), None);
        assert_eq!(client.idle_at(), Some(at(1_000)));
        assert_eq!(client.next(at(1_000)).unwrap().du, [0x48, 0]);
        assert_eq!(client.answered(at(1_001), Ok(None), &mut out), Progress::Going);
        assert_eq!(client.answered(at(1_002), Ok(Some(&[0x48, 0])), &mut out), Progress::Going);
        assert_eq!((client.state(), client.idle_at()), (ConnectionState::Open, Some(at(2_002))));
        client.next(at(2_002));
        let refused = client.answered(at(2_003), Err(Some(Status::Rs)), &mut out);
        assert_eq!(refused, Progress::Over { why: Failure::Closed, request: false });
    }

    #[test]
    fn nothing_heard_ends_with_the_response_timeout() {
        let mut out = Outbox::new();
        let over = Progress::Over { why: Failure::Timeout, request: true };
        let mut client = in_state(ConnectionState::Working, true);
        assert_eq!(client.answered(at(3_000), Err(None), &mut out), Progress::Going);
        assert_eq!(client.answered(at(3_001), Err(None), &mut out), over);
        assert_eq!(client.state(), ConnectionState::Aborting, "the slave is told");
        let mut client = in_state(ConnectionState::Working, false);
        assert_eq!(client.overdue(at(3_001), &mut out), over, "also where there was no time to ask");
        let mut client = in_state(ConnectionState::Opening, false);
        let over = Progress::Over { why: Failure::Timeout, request: false };
        assert_eq!(client.overdue(at(3_001), &mut out), over);
        assert_eq!(client.state(), ConnectionState::Closed, "no SAP to tell it to");
    }

    #[test]
    fn an_answer_is_handed_up_also_a_negative_one() {
        for answer in [&[0x5E, 1, 47, 1, 9][..], &[0xDE, 0x80, 0xB5, 0]] {
            let mut client = in_state(ConnectionState::Working, true);
            assert_eq!(client.answered(at(1), Ok(Some(answer)), &mut Outbox::new()), Progress::Done(answer));
        }
        let mut client = in_state(ConnectionState::Working, true);
        let over = Progress::Over { why: Failure::Aborted(0x13), request: true };
        assert_eq!(client.answered(at(1), Ok(Some(&ABORT)), &mut Outbox::new()), over);
    }
}
