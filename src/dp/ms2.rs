//! MS2: acyclic connections between a slave and class 2 masters, whatever the class 1 master does.
//!
//! A class 2 master opens a connection at SAP 49: the resource manager answers at once with the SAP of a free
//! connection, where the master polls for the answer to its Initiate. Then it sends one request after the other and
//! polls for each answer, and Idle while it has nothing to do. Slave side, each connection for itself:
//!
//! | state | input | next state | answer |
//! |---|---|---|---|
//! | Closed | PDU at SAP 49 | Opening; Aborting where it is no good Initiate | RM with the own SAP |
//! | none Closed | PDU at SAP 49 | unchanged | RS |
//! | any | empty request at SAP 49 | unchanged | SC |
//! | Closed | anything at its own SAP | Closed | RS |
//! | any but Closed | anything of another master or SAP | unchanged | RS |
//! | Opening, Working | empty, not ready yet | unchanged | SC |
//! | Opening, Working | empty, ready | Open | the answer, DL |
//! | Opening | PDU | Aborting (SE) | SC |
//! | Working | PDU | Working | RR |
//! | Open | empty | Open | SC |
//! | Open | Read, Write, Data_Transport | Working | SC |
//! | Open | Idle | Working, ready at once | SC |
//! | Open | any other PDU | Aborting (FE) | SC |
//! | Opening, Open, Working | Abort | Closed | SC |
//! | Opening, Working | Send_Timeout over since the answer was ready | Aborting (TO) | - |
//! | Open | twice Send_Timeout over since the last answer | Aborting (TO) | - |
//! | Aborting | anything | Closed | Abort, DL |
//! | Aborting | Send_Timeout over | Closed | - |
//!
//! The connection keeps the longer of both sides' Send_Timeout. Master side, see [`client`].
//! Source: DP-V1, functions 48, 51, 56 to 58, 5E, 5F; supervision, order of states and the refusal by RS VPC3+ driver.

pub mod client;

use alloc::vec::Vec;

use crate::dp::ms1::{Access, Answer, MAX_PDU, Records, serve};
use crate::fdl::Outbox;
use crate::observation::{ConnectionCause, ConnectionState, Observation};
use crate::time::{BitRate, Local, Span};
use crate::wire::acyclic::{Abort, AbortCode, Ends, Function, InitiateRes, Request, Response};
use crate::wire::{Address, Sap, Status};

/// The unit of Send_Timeout (VPC3+ driver).
pub const TIMEOUT_UNIT: Span = Span::from_ms(10);
/// Octets 3..=4 of an Initiate response: reads and writes records.
pub const FEATURES: [u8; 2] = [1, 0];
/// Ends of a connection without routing: application and access level 0.
const HERE: [u8; 2] = [0, 0];

/// The shortest Send_Timeout of a slave at `rate`, in units of [`TIMEOUT_UNIT`] (VPC3+ driver).
pub const fn send_timeout(rate: BitRate) -> u16 {
    match rate {
        BitRate::M1_5 | BitRate::M3 | BitRate::M6 | BitRate::M12 => 100,
        BitRate::K500 => 200,
        _ => 400,
    }
}

/// What the connections of a slave are like.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Settings {
    /// How many, at SAP 0 and up; at most 49. C2_Max_Count_Channels.
    pub connections: u8,
    /// Octets of the longest data of a record, octet 2 of an Initiate response (C2_Max_Data_Len).
    pub max_data: u8,
    /// Own Send_Timeout, in units of [`TIMEOUT_UNIT`].
    pub send_timeout: u16,
    /// Time from a request to its answer.
    pub working: Span,
    /// Profile_Ident_Number of the Initiate response; 3D00 for encoders.
    pub profile_ident: u16,
}

/// A request to SAP 49 or to a connection.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Message<'a> {
    /// From whom.
    pub master: Address,
    /// Its SAP.
    pub ssap: Sap,
    /// The slave's SAP.
    pub dsap: Sap,
    /// Data unit.
    pub du: &'a [u8],
}

/// The slave's side: the resource manager and its connections.
#[derive(Clone, Debug)]
pub struct Manager {
    settings: Settings,
    connections: Vec<Connection>,
    /// The resource manager's answer.
    answer: [u8; 4],
}

/// The slave's side of one connection.
#[derive(Clone, Debug)]
struct Connection {
    sap: Sap,
    state: ConnectionState,
    master: Address,
    ssap: Sap,
    /// Send_Timeout in force.
    timeout: Span,
    /// When the answer is ready, and when the supervision strikes.
    ready: Local,
    deadline: Local,
    /// C2_Max_Data_Len.
    max_data: u8,
    len: usize,
    pdu: [u8; MAX_PDU],
}

impl Manager {
    /// Connections that are all closed.
    pub fn new(settings: Settings) -> Self {
        let saps = 0..settings.connections.min(Sap::MS2_LAST.0 + 1);
        Self { settings, connections: saps.map(|sap| Connection::new(Sap(sap))).collect(), answer: [0; 4] }
    }
    /// Whether a service access point is one of these.
    pub fn has(&self, sap: Sap) -> bool {
        sap == Sap::MS2_RM || usize::from(sap.0) < self.connections.len()
    }
    /// State of the connection at `sap`.
    pub fn state(&self, sap: Sap) -> Option<ConnectionState> {
        self.connections.get(usize::from(sap.0)).map(|connection| connection.state)
    }
    /// When [`due`](Self::due) must be called next. Changes with each call of it and of [`heard`](Self::heard).
    pub fn deadline(&self) -> Option<Local> {
        let open = self.connections.iter().filter(|connection| connection.state != ConnectionState::Closed);
        open.map(|connection| connection.deadline).min()
    }

    /// Takes a request that arrived at `now`.
    pub fn heard(
        &mut self,
        now: Local,
        message: &Message<'_>,
        records: &mut impl Records,
        out: &mut Outbox,
    ) -> Answer<'_> {
        if message.dsap == Sap::MS2_RM {
            return self.initiate(now, message, out);
        }
        let working = self.settings.working;
        match self.connections.get_mut(usize::from(message.dsap.0)) {
            Some(connection) if connection.belongs_to(message) => {
                connection.heard((now, now + working), message.du, records, out)
            }
            _ => Answer::Refuse(Status::Rs),
        }
    }
    /// The supervision of a connection strikes.
    pub fn due(&mut self, now: Local, records: &mut impl Records, out: &mut Outbox) {
        for connection in &mut self.connections {
            if connection.state != ConnectionState::Closed && connection.deadline <= now {
                connection.due(now, records, out);
            }
        }
    }

    fn initiate(&mut self, now: Local, message: &Message<'_>, out: &mut Outbox) -> Answer<'_> {
        if message.du.is_empty() {
            return Answer::Acknowledge;
        }
        let free = self.connections.iter_mut().find(|connection| connection.state == ConnectionState::Closed);
        let Some(connection) = free else { return Answer::Refuse(Status::Rs) };
        connection.open(now, message, &self.settings, out);
        let manager =
            Response::ResourceManager { server_sap: connection.sap.0, send_timeout: self.settings.send_timeout };
        let len = manager.emit(&mut self.answer).unwrap_or(0);
        Answer::Data(&self.answer[..len])
    }
}

impl Connection {
    const fn new(sap: Sap) -> Self {
        Self {
            sap,
            state: ConnectionState::Closed,
            master: Address::BROADCAST,
            ssap: Sap::MASTER_MS2,
            timeout: Span::ZERO,
            ready: Local::ZERO,
            deadline: Local::ZERO,
            max_data: 0,
            len: 0,
            pdu: [0; MAX_PDU],
        }
    }
    fn belongs_to(&self, message: &Message<'_>) -> bool {
        self.state != ConnectionState::Closed && (self.master, self.ssap) == (message.master, message.ssap)
    }
    fn access(&self) -> Access {
        Access::Ms2(self.sap.0)
    }
    fn enter(&mut self, state: ConnectionState, why: ConnectionCause, out: &mut Outbox) {
        let from = core::mem::replace(&mut self.state, state);
        out.observe(Observation::Connection { peer: self.master, sap: self.sap, from, to: state, why });
    }

    /// The resource manager gave this connection to the sender of `message`.
    fn open(&mut self, now: Local, message: &Message<'_>, settings: &Settings, out: &mut Outbox) {
        (self.master, self.ssap, self.max_data) = (message.master, message.ssap, settings.max_data);
        self.timeout = TIMEOUT_UNIT * i64::from(settings.send_timeout);
        match Request::parse(message.du) {
            Ok(Request::Initiate(asked)) if is_level(asked.ends.source_type, asked.ends.source) => {
                let units = asked.send_timeout.max(settings.send_timeout);
                self.timeout = TIMEOUT_UNIT * i64::from(units);
                // No routing behind this slave, and one application in it.
                if (asked.ends.destination_type, asked.ends.destination) != (0, &HERE[..]) {
                    return self.abort(now, AbortCode::Address, out);
                }
                let ends = Ends {
                    source_type: asked.ends.destination_type,
                    source: asked.ends.destination,
                    destination_type: asked.ends.source_type,
                    destination: asked.ends.source,
                };
                let response = InitiateRes {
                    max_len: settings.max_data,
                    features: FEATURES,
                    profile_features: [0; 2],
                    profile_ident: settings.profile_ident,
                    ends,
                };
                match Response::Initiate(response).emit(&mut self.pdu) {
                    Some(len) => self.len = len,
                    None => return self.abort(now, AbortCode::Address, out),
                }
                self.ready = now + settings.working;
                self.deadline = self.ready + self.timeout;
                self.enter(ConnectionState::Opening, ConnectionCause::Initiated, out);
            }
            _ => self.abort(now, AbortCode::Format, out),
        }
    }

    /// A request of the own master, and when its answer would be ready.
    fn heard(
        &mut self,
        (now, ready): (Local, Local),
        du: &[u8],
        records: &mut impl Records,
        out: &mut Outbox,
    ) -> Answer<'_> {
        match (self.state, Request::parse(du)) {
            (ConnectionState::Closed, _) => return Answer::Refuse(Status::Rs),
            (ConnectionState::Aborting, _) => {
                self.close(ConnectionCause::Told, records, out);
                return Answer::Data(&self.pdu[..self.len]);
            }
            (_, Ok(Request::Abort(abort))) => self.close(ConnectionCause::Aborted(abort.reason), records, out),
            (ConnectionState::Opening | ConnectionState::Working, _) if du.is_empty() => return self.polled(now, out),
            (ConnectionState::Opening, _) => self.abort(now, AbortCode::Sequence, out),
            (ConnectionState::Working, _) => return Answer::Refuse(Status::Rr),
            (ConnectionState::Open, _) if du.is_empty() => {}
            (ConnectionState::Open, Ok(Request::Idle)) => {
                self.len = Response::Idle.emit(&mut self.pdu).unwrap_or(0);
                self.work(now);
            }
            // Also one that is cut short: it gets its negative answer.
            (ConnectionState::Open, _) if is_service(du) => {
                self.len = serve(self.access(), du, self.max_data, records, &mut self.pdu);
                self.work(ready);
            }
            (ConnectionState::Open, _) => self.abort(now, AbortCode::Format, out),
        }
        Answer::Acknowledge
    }
    /// The answer is made and will be ready; not told, since it happens with each request.
    fn work(&mut self, ready: Local) {
        self.state = ConnectionState::Working;
        self.ready = ready;
        self.deadline = ready + self.timeout;
    }
    fn polled(&mut self, now: Local, out: &mut Outbox) -> Answer<'_> {
        if now < self.ready {
            return Answer::Acknowledge;
        }
        self.deadline = now + self.timeout * 2;
        if self.state == ConnectionState::Opening {
            self.enter(ConnectionState::Open, ConnectionCause::Confirmed, out);
        }
        self.state = ConnectionState::Open;
        Answer::Data(&self.pdu[..self.len])
    }

    fn due(&mut self, now: Local, records: &mut impl Records, out: &mut Outbox) {
        if self.state == ConnectionState::Aborting {
            self.close(ConnectionCause::Silence, records, out);
        } else {
            self.abort(now, AbortCode::Timeout, out);
        }
    }
    /// This side gives up: the next request gets the abort.
    fn abort(&mut self, now: Local, code: AbortCode, out: &mut Outbox) {
        self.len = Response::Abort(Abort::new(code)).emit(&mut self.pdu).unwrap_or(0);
        self.deadline = now + self.timeout;
        self.enter(ConnectionState::Aborting, ConnectionCause::GaveUp(code), out);
    }
    fn close(&mut self, why: ConnectionCause, records: &mut impl Records, out: &mut Outbox) {
        records.closed(self.access());
        self.enter(ConnectionState::Closed, why, out);
    }
}

/// Whether an end is what its type says: without network and MAC address two octets, with them more (VPC3+ driver).
const fn is_level(kind: u8, address: &[u8]) -> bool {
    if kind == 0 { address.len() == 2 } else { address.len() > 2 }
}

/// Whether `du` begins as a request that an open connection serves.
fn is_service(du: &[u8]) -> bool {
    let function = du.first().copied().and_then(Function::from_code);
    matches!(function, Some(Function::Read | Function::Write | Function::DataTransport))
}

#[cfg(test)]
mod tests;
