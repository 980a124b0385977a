//! Acyclic: the PDUs of MS1 and MS2, reading and writing records beside the cycle. DP-V1, VPC3+ driver.

use super::Writer;
use core::fmt;

/// Bit 7 of the function number of a negative answer.
const NEGATIVE: u8 = 0x80;
/// Bits 5..=4 of an abort's reason.
const INSTANCE_SHIFT: u8 = 4;

rules! {
    /// An acyclic PDU that cannot be read.
    pub struct AcyclicError, pub enum AcyclicRule {
        Empty = "a PDU has a function number";
        Function = "another function number belongs here";
        Length = "the PDU of this function has another length";
        DataLength = "the length octet counts the octets that follow";
        Reserved = "a reserved octet is 0";
    }
}

codes! {
    /// The first octet of a PDU; a negative answer has bit 7 set in addition.
    pub enum Function: u8 {
        /// Keeps an MS2 connection alive.
        Idle = 0x48, "Idle";
        /// Data in both directions at once.
        DataTransport = 0x51, "Data_Transport";
        /// The resource manager names the SAP of a new connection.
        ResourceManager = 0x56, "RM";
        /// Opens an MS2 connection.
        Initiate = 0x57, "Initiate";
        /// Closes an MS2 connection.
        Abort = 0x58, "Abort";
        /// Acknowledges an alarm.
        AlarmAck = 0x5C, "Alarm_Ack";
        /// Reads a record.
        Read = 0x5E, "Read";
        /// Writes a record.
        Write = 0x5F, "Write";
    }
}

/// Which record of a slave is meant.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Record {
    /// Slot, octet 2.
    pub slot: u8,
    /// Index in the slot, octet 3; 47 is the parameter channel.
    pub index: u8,
}
impl Record {
    /// Index of the PROFIdrive parameter channel.
    pub const PARAMETER_CHANNEL: u8 = 47;
}

/// What a master sends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Request<'a> {
    /// `5E slot index len`.
    Read {
        /// The record.
        record: Record,
        /// Octet 4, most octets that the master takes.
        len: u8,
    },
    /// `5F slot index len data`.
    Write {
        /// The record.
        record: Record,
        /// From octet 5 on.
        data: &'a [u8],
    },
    /// `51 slot index len data`.
    DataTransport {
        /// The record.
        record: Record,
        /// From octet 5 on.
        data: &'a [u8],
    },
    /// `5C` and what the alarm was, not interpreted: the encoders have none.
    AlarmAck {
        /// From octet 2 on.
        data: &'a [u8],
    },
    /// `57`, opens a connection.
    Initiate(InitiateReq<'a>),
    /// `48 00`.
    Idle,
    /// `58`, closes the connection.
    Abort(Abort),
}

/// What a slave sends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Response<'a> {
    /// `5E slot index len data`.
    Read {
        /// The record.
        record: Record,
        /// From octet 5 on.
        data: &'a [u8],
    },
    /// `5F slot index len`.
    Write {
        /// The record.
        record: Record,
        /// Octet 4, octets written.
        len: u8,
    },
    /// `51 slot index len data`.
    DataTransport {
        /// The record.
        record: Record,
        /// From octet 5 on.
        data: &'a [u8],
    },
    /// `5C` and what the alarm was, not interpreted.
    AlarmAck {
        /// From octet 2 on.
        data: &'a [u8],
    },
    /// `56 server_SAP send_timeout`: where the master shall ask for its connection.
    ResourceManager {
        /// Octet 2, 0..=48.
        server_sap: u8,
        /// Octets 3..=4, `Send_Timeout` in the unit of `Initiate`.
        send_timeout: u16,
    },
    /// `57`, the connection is open.
    Initiate(InitiateRes<'a>),
    /// `48 00`.
    Idle,
    /// `58`, closes the connection.
    Abort(Abort),
    /// The function with bit 7 set, error decode, two error codes.
    Negative(Negative),
}

impl<'a> Request<'a> {
    /// Reads a PDU.
    ///
    /// # Errors
    /// A function that masters do not send, or a wrong length.
    pub fn parse(pdu: &'a [u8]) -> Result<Self, AcyclicError> {
        let (function, code) = function(pdu)?;
        match function {
            Some(Function::Read) => {
                let (record, len) = record_len(pdu)?;
                Ok(Self::Read { record, len })
            }
            Some(Function::Write) => record_data(pdu).map(|(record, data)| Self::Write { record, data }),
            Some(Function::DataTransport) => {
                record_data(pdu).map(|(record, data)| Self::DataTransport { record, data })
            }
            Some(Function::AlarmAck) => Ok(Self::AlarmAck { data: &pdu[1..] }),
            Some(Function::Initiate) => InitiateReq::parse(pdu).map(Self::Initiate),
            Some(Function::Idle) => idle(pdu).map(|()| Self::Idle),
            Some(Function::Abort) => Abort::parse(pdu).map(Self::Abort),
            Some(Function::ResourceManager) | None => Err(AcyclicError::new(1, AcyclicRule::Function, code)),
        }
    }
    /// Writes the PDU; its length, or `None` if it does not fit into `out` or its data into a length octet.
    pub fn emit(&self, out: &mut [u8]) -> Option<usize> {
        let mut writer = Writer::new(out);
        match *self {
            Self::Read { record, len } => put_record_len(&mut writer, Function::Read, record, len),
            Self::Write { record, data } => put_record_data(&mut writer, Function::Write, record, data),
            Self::DataTransport { record, data } => put_record_data(&mut writer, Function::DataTransport, record, data),
            Self::AlarmAck { data } => put_alarm_ack(&mut writer, data),
            Self::Initiate(initiate) => initiate.put(&mut writer),
            Self::Idle => writer.put(&IDLE),
            Self::Abort(abort) => abort.put(&mut writer),
        }?;
        Some(writer.len)
    }
}

impl<'a> Response<'a> {
    /// Reads a PDU.
    ///
    /// # Errors
    /// A function that is not assigned, or a wrong length.
    pub fn parse(pdu: &'a [u8]) -> Result<Self, AcyclicError> {
        let (function, code) = function(pdu)?;
        match function {
            Some(Function::Read) => record_data(pdu).map(|(record, data)| Self::Read { record, data }),
            Some(Function::Write) => {
                let (record, len) = record_len(pdu)?;
                Ok(Self::Write { record, len })
            }
            Some(Function::DataTransport) => {
                record_data(pdu).map(|(record, data)| Self::DataTransport { record, data })
            }
            Some(Function::AlarmAck) => Ok(Self::AlarmAck { data: &pdu[1..] }),
            Some(Function::ResourceManager) => {
                let &[_, server_sap, high, low] = exact(pdu)?;
                Ok(Self::ResourceManager { server_sap, send_timeout: u16::from_be_bytes([high, low]) })
            }
            Some(Function::Initiate) => InitiateRes::parse(pdu).map(Self::Initiate),
            Some(Function::Idle) => idle(pdu).map(|()| Self::Idle),
            Some(Function::Abort) => Abort::parse(pdu).map(Self::Abort),
            None if code & NEGATIVE != 0 => Negative::parse(pdu).map(Self::Negative),
            None => Err(AcyclicError::new(1, AcyclicRule::Function, code)),
        }
    }
    /// Writes the PDU; its length, or `None` if it does not fit into `out` or its data into a length octet.
    pub fn emit(&self, out: &mut [u8]) -> Option<usize> {
        let mut writer = Writer::new(out);
        match *self {
            Self::Read { record, data } => put_record_data(&mut writer, Function::Read, record, data),
            Self::Write { record, len } => put_record_len(&mut writer, Function::Write, record, len),
            Self::DataTransport { record, data } => put_record_data(&mut writer, Function::DataTransport, record, data),
            Self::AlarmAck { data } => put_alarm_ack(&mut writer, data),
            Self::ResourceManager { server_sap, send_timeout } => {
                let [high, low] = send_timeout.to_be_bytes();
                writer.put(&[Function::ResourceManager.code(), server_sap, high, low])
            }
            Self::Initiate(initiate) => initiate.put(&mut writer),
            Self::Idle => writer.put(&IDLE),
            Self::Abort(abort) => abort.put(&mut writer),
            Self::Negative(negative) => negative.put(&mut writer),
        }?;
        Some(writer.len)
    }
}

const IDLE: [u8; 2] = [Function::Idle.code(), 0];

fn function(pdu: &[u8]) -> Result<(Option<Function>, u8), AcyclicError> {
    match pdu.first() {
        Some(&code) => Ok((Function::from_code(code), code)),
        None => Err(AcyclicError::new(1, AcyclicRule::Empty, 0u8)),
    }
}
fn wrong_length(pdu: &[u8]) -> AcyclicError {
    AcyclicError::new(pdu.len(), AcyclicRule::Length, pdu.len() as u32)
}
fn exact<const N: usize>(pdu: &[u8]) -> Result<&[u8; N], AcyclicError> {
    pdu.try_into().map_err(|_| wrong_length(pdu))
}
fn idle(pdu: &[u8]) -> Result<(), AcyclicError> {
    match exact(pdu)? {
        [_, 0] => Ok(()),
        &[_, reserved] => Err(AcyclicError::new(2, AcyclicRule::Reserved, reserved)),
    }
}
fn record_len(pdu: &[u8]) -> Result<(Record, u8), AcyclicError> {
    let &[_, slot, index, len] = exact(pdu)?;
    Ok((Record { slot, index }, len))
}
fn record_data(pdu: &[u8]) -> Result<(Record, &[u8]), AcyclicError> {
    match pdu {
        [_, slot, index, len, data @ ..] if data.len() == usize::from(*len) => {
            Ok((Record { slot: *slot, index: *index }, data))
        }
        [_, _, _, len, ..] => Err(AcyclicError::new(4, AcyclicRule::DataLength, *len)),
        _ => Err(wrong_length(pdu)),
    }
}
fn put_record_len(writer: &mut Writer<'_>, function: Function, record: Record, len: u8) -> Option<()> {
    writer.put(&[function.code(), record.slot, record.index, len])
}
fn put_record_data(writer: &mut Writer<'_>, function: Function, record: Record, data: &[u8]) -> Option<()> {
    writer.put(&[function.code(), record.slot, record.index])?;
    writer.put_counted(data)
}
fn put_alarm_ack(writer: &mut Writer<'_>, data: &[u8]) -> Option<()> {
    writer.put(&[Function::AlarmAck.code()])?;
    writer.put(data)
}

/// The two ends of an MS2 connection behind the partners' SAPs: type, length and address of each.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Ends<'a> {
    /// `S_Type`: 0 without, 1 with network and MAC address.
    pub source_type: u8,
    /// Address of the caller; at least two octets, application and access level.
    pub source: &'a [u8],
    /// `D_Type`, as `S_Type`.
    pub destination_type: u8,
    /// Address of the called.
    pub destination: &'a [u8],
}
impl<'a> Ends<'a> {
    /// Reads `S_Type S_Len D_Type D_Len` and the addresses; `octet` is the number of `S_Type`.
    fn parse(rest: &'a [u8], octet: usize) -> Result<Self, AcyclicError> {
        let wrong = |at, len| AcyclicError::new(octet + at, AcyclicRule::DataLength, len);
        let &[source_type, source_len, destination_type, destination_len, ref addresses @ ..] = rest else {
            return Err(AcyclicError::new(octet, AcyclicRule::Length, rest.len() as u32));
        };
        let (source, destination) =
            addresses.split_at_checked(source_len.into()).ok_or_else(|| wrong(1, source_len))?;
        if destination.len() != usize::from(destination_len) {
            return Err(wrong(3, destination_len));
        }
        Ok(Self { source_type, source, destination_type, destination })
    }
    fn put(&self, writer: &mut Writer<'_>) -> Option<()> {
        let source_len = u8::try_from(self.source.len()).ok()?;
        let destination_len = u8::try_from(self.destination.len()).ok()?;
        writer.put(&[self.source_type, source_len, self.destination_type, destination_len])?;
        writer.put(self.source)?;
        writer.put(self.destination)
    }
}

/// `Initiate` request: `57 0 0 0`, timeout, features, profile, ends; 20 octets with the shortest addresses.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct InitiateReq<'a> {
    /// Octets 5..=6, `Send_Timeout` (10 ms).
    pub send_timeout: u16,
    /// Octets 7..=8, `Features_Supported`; `01 00` is read and write.
    pub features: [u8; 2],
    /// Octets 9..=10, `Profile_Features_Supported`.
    pub profile_features: [u8; 2],
    /// Octets 11..=12, `Profile_Ident_Number`; 3D00 for encoders.
    pub profile_ident: u16,
    /// From octet 13 on.
    pub ends: Ends<'a>,
}
impl<'a> InitiateReq<'a> {
    fn parse(pdu: &'a [u8]) -> Result<Self, AcyclicError> {
        let &[_, r1, r2, r3, t0, t1, f0, f1, p0, p1, i0, i1, ref rest @ ..] = pdu else {
            return Err(wrong_length(pdu));
        };
        if let Some((octet, &reserved)) = (2..).zip(&[r1, r2, r3]).find(|&(_, &reserved)| reserved != 0) {
            return Err(AcyclicError::new(octet, AcyclicRule::Reserved, reserved));
        }
        Ok(Self {
            send_timeout: u16::from_be_bytes([t0, t1]),
            features: [f0, f1],
            profile_features: [p0, p1],
            profile_ident: u16::from_be_bytes([i0, i1]),
            ends: Ends::parse(rest, 13)?,
        })
    }
    fn put(&self, writer: &mut Writer<'_>) -> Option<()> {
        writer.put(&[Function::Initiate.code(), 0, 0, 0])?;
        writer.put(&self.send_timeout.to_be_bytes())?;
        writer.put(&self.features)?;
        writer.put(&self.profile_features)?;
        writer.put(&self.profile_ident.to_be_bytes())?;
        self.ends.put(writer)
    }
}

/// `Initiate` response: `57`, longest data unit, features, profile, ends; 16 octets with the shortest addresses.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct InitiateRes<'a> {
    /// Octet 2, `Max_Len_Data_Unit` (octets).
    pub max_len: u8,
    /// Octets 3..=4, `Features_Supported`.
    pub features: [u8; 2],
    /// Octets 5..=6, `Profile_Features_Supported`.
    pub profile_features: [u8; 2],
    /// Octets 7..=8, `Profile_Ident_Number`.
    pub profile_ident: u16,
    /// From octet 9 on.
    pub ends: Ends<'a>,
}
impl<'a> InitiateRes<'a> {
    fn parse(pdu: &'a [u8]) -> Result<Self, AcyclicError> {
        let &[_, max_len, f0, f1, p0, p1, i0, i1, ref rest @ ..] = pdu else {
            return Err(wrong_length(pdu));
        };
        Ok(Self {
            max_len,
            features: [f0, f1],
            profile_features: [p0, p1],
            profile_ident: u16::from_be_bytes([i0, i1]),
            ends: Ends::parse(rest, 9)?,
        })
    }
    fn put(&self, writer: &mut Writer<'_>) -> Option<()> {
        writer.put(&[Function::Initiate.code(), self.max_len])?;
        writer.put(&self.features)?;
        writer.put(&self.profile_features)?;
        writer.put(&self.profile_ident.to_be_bytes())?;
        self.ends.put(writer)
    }
}

codes! {
    /// Why an MS2 connection is aborted, bits 3..=0 of an abort's reason.
    pub enum AbortCode: u8 {
        /// A PDU that does not belong into this state.
        Sequence = 0x01, "sequence error (SE)";
        /// An invalid request.
        Format = 0x02, "invalid request (FE)";
        /// A supervision time ran out.
        Timeout = 0x03, "time-out (TO)";
        /// An invalid response.
        Response = 0x04, "invalid response (RE)";
        /// The user asked for an invalid service.
        Service = 0x05, "invalid service of the user (IV)";
        /// The Send_Timeout asked for is too short.
        SendTimeout = 0x06, "Send_Timeout too short (STO)";
        /// An address behind the slave that is not there.
        Address = 0x07, "invalid additional address (IA)";
        /// The data link layer has not confirmed yet.
        Confirmation = 0x08, "confirmation outstanding (OC)";
        /// No resource.
        Resource = 0x0F, "no resource (RES)";
    }
}

/// `Abort`: why an MS2 connection ends.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Abort {
    /// Octet 2: 0 none, 1 local, 2 remote.
    pub subnet: u8,
    /// Octet 3: instance in bits 5..=4, code in bits 3..=0.
    pub reason: u8,
    /// Octet 4; the sources do not say what for.
    pub detail: u8,
}
impl Abort {
    /// Instance 1: the protocol of the connection itself, neither the data link layer nor the user.
    pub const PROTOCOL: u8 = 1;
    /// Instance 2: the user.
    pub const USER: u8 = 2;

    /// An abort by the protocol of the connection.
    pub const fn new(code: AbortCode) -> Self {
        Self { subnet: 0, reason: Self::PROTOCOL << INSTANCE_SHIFT | code.code(), detail: 0 }
    }
    fn parse(pdu: &[u8]) -> Result<Self, AcyclicError> {
        let &[_, subnet, reason, detail] = exact(pdu)?;
        Ok(Self { subnet, reason, detail })
    }
    fn put(self, writer: &mut Writer<'_>) -> Option<()> {
        writer.put(&[Function::Abort.code(), self.subnet, self.reason, self.detail])
    }
    /// Which part of the protocol gave up, bits 5..=4 of the reason.
    pub const fn instance(self) -> u8 {
        self.reason >> INSTANCE_SHIFT & 0x03
    }
    /// Why, bits 3..=0 of the reason.
    pub const fn code(self) -> u8 {
        self.reason & 0x0F
    }
}

/// A negative answer: `DE 80 B5 00`.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Negative {
    /// Octet 1: the function number refused, bit 7 set.
    pub function: u8,
    /// Octet 2, `Error_Decode`.
    pub error_decode: u8,
    /// Octet 3, `Error_Code_1`.
    pub code_1: ErrorCode,
    /// Octet 4, `Error_Code_2`, the device's own.
    pub code_2: u8,
}
impl Negative {
    /// `Error_Decode` of DP-V1.
    pub const DPV1: u8 = 128;

    /// The refusal of `function` for the reason `code_1`.
    pub const fn new(function: Function, code_1: ErrorCode) -> Self {
        Self { function: function.code() | NEGATIVE, error_decode: Self::DPV1, code_1, code_2: 0 }
    }
    /// The function refused, if it is one.
    pub const fn refused(&self) -> Option<Function> {
        Function::from_code(self.function & !NEGATIVE)
    }
    fn parse(pdu: &[u8]) -> Result<Self, AcyclicError> {
        let &[function, error_decode, code_1, code_2] = exact(pdu)?;
        Ok(Self { function, error_decode, code_1: ErrorCode(code_1), code_2 })
    }
    fn put(self, writer: &mut Writer<'_>) -> Option<()> {
        writer.put(&[self.function, self.error_decode, self.code_1.0, self.code_2])
    }
}

/// `Error_Code_1`: the class in bits 7..=4, the code in bits 3..=0. DP-V1.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct ErrorCode(pub u8);

macro_rules! error_codes {
    ($($(#[$doc:meta])* $name:ident = $code:literal, $text:literal;)*) => {
        impl ErrorCode {
            $($(#[$doc])* pub const $name: Self = Self($code);)*

            /// The name of class and code, `None` if they are not assigned.
            pub const fn name(self) -> Option<&'static str> {
                match self.0 { $($code => Some($text),)* _ => None }
            }
        }
    };
}
error_codes! {
    /// Application: read error.
    READ = 0xA0, "read error";
    /// Application: write error.
    WRITE = 0xA1, "write error";
    /// Application: module failure.
    MODULE = 0xA2, "module failure";
    /// Application: version conflict.
    VERSION = 0xA8, "version conflict";
    /// Application: feature not supported.
    NOT_SUPPORTED = 0xA9, "feature not supported";
    /// Access: invalid index.
    INDEX = 0xB0, "invalid index";
    /// Access: wrong length written.
    WRITE_LENGTH = 0xB1, "write length error";
    /// Access: invalid slot.
    SLOT = 0xB2, "invalid slot";
    /// Access: type conflict.
    TYPE_CONFLICT = 0xB3, "type conflict";
    /// Access: invalid area.
    AREA = 0xB4, "invalid area";
    /// Access: state conflict, for example an answer that is not ready yet.
    STATE_CONFLICT = 0xB5, "state conflict";
    /// Access: access denied.
    ACCESS_DENIED = 0xB6, "access denied";
    /// Access: invalid range.
    RANGE = 0xB7, "invalid range";
    /// Access: invalid parameter.
    PARAMETER = 0xB8, "invalid parameter";
    /// Access: invalid type.
    TYPE = 0xB9, "invalid type";
    /// Resource: constraint conflict while reading.
    READ_CONSTRAINT = 0xC0, "read constraint conflict";
    /// Resource: constraint conflict while writing.
    WRITE_CONSTRAINT = 0xC1, "write constraint conflict";
    /// Resource: busy.
    BUSY = 0xC2, "resource busy";
    /// Resource: unavailable.
    UNAVAILABLE = 0xC3, "resource unavailable";
}
impl ErrorCode {
    /// The class: 10 application, 11 access, 12 resource, 13 user.
    pub const fn class(self) -> u8 {
        self.0 >> 4
    }
    /// The code within the class.
    pub const fn code(self) -> u8 {
        self.0 & 0x0F
    }
}
impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name() {
            Some(name) => f.write_str(name),
            None => write!(f, "error {:02X}", self.0),
        }
    }
}
