//! Header: who speaks to whom, through which service access points, with which frame control.

use core::fmt;

/// A station address, 0..=126, or 127 for all stations. EN 50170-2.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Address(u8);

impl Address {
    /// The highest address a station may have. A slave at 126 has not been given an address yet and exchanges no data.
    pub const MAX_STATION: Self = Self(126);
    /// All stations; only ever a destination.
    pub const BROADCAST: Self = Self(127);

    /// The address `number`, `None` above 127.
    pub const fn new(number: u8) -> Option<Self> {
        if number <= Self::BROADCAST.0 { Some(Self(number)) } else { None }
    }
    /// The address in the low seven bits of an octet, whatever bit 7 says.
    pub(super) const fn of_low_bits(octet: u8) -> Self {
        Self(octet & 0x7F)
    }
    /// The number, 0..=127.
    pub const fn get(self) -> u8 {
        self.0
    }
    /// Whether this is 127, all stations.
    pub const fn is_broadcast(self) -> bool {
        self.0 == Self::BROADCAST.0
    }
}
impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, f)
    }
}

/// A service access point, 0..=63. The absence of one is the default SAP of `Data_Exchange`. EN 50170-2, DP-V1.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Sap(pub u8);

impl Sap {
    /// The highest number that an extension octet can carry.
    pub const MAX: Self = Self(63);
    /// Slave: check configuration.
    pub const CHK_CFG: Self = Self(62);
    /// Slave: parameterise.
    pub const SET_PRM: Self = Self(61);
    /// Slave: read the diagnosis.
    pub const SLAVE_DIAG: Self = Self(60);
    /// Slave: read the configuration.
    pub const GET_CFG: Self = Self(59);
    /// Slave: `Global_Control`, the clock among them.
    pub const GLOBAL_CONTROL: Self = Self(58);
    /// Slave: read the outputs.
    pub const RD_OUTP: Self = Self(57);
    /// Slave: read the inputs.
    pub const RD_INP: Self = Self(56);
    /// Slave: change the station address.
    pub const SET_SLAVE_ADD: Self = Self(55);
    /// Both ends of a master to master message.
    pub const MASTER_MASTER: Self = Self(54);
    /// Slave: extended user parameters.
    pub const EXT_USER_PRM: Self = Self(53);
    /// Slave: acyclic read and write of the parameterising master (MS1).
    pub const MS1: Self = Self(51);
    /// Slave: alarm acknowledgement of the parameterising master (MS1).
    pub const MS1_ALARM: Self = Self(50);
    /// Slave: resource manager of acyclic connections (MS2). The connections themselves are at 0..=48.
    pub const MS2_RM: Self = Self(49);
    /// Slave: the highest SAP of an acyclic connection (MS2).
    pub const MS2_LAST: Self = Self(48);
    /// Master: everything of DP-V0.
    pub const MASTER_MS0: Self = Self(62);
    /// Master: MS1.
    pub const MASTER_MS1: Self = Self(51);
    /// Master: MS2.
    pub const MASTER_MS2: Self = Self(50);
}
impl fmt::Display for Sap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, f)
    }
}

codes! {
    /// The service that a request asks for: bits 3..0 of FC, and bit 7, which is 1 for the clock value alone. EN 50170-2.
    pub enum Service: u8 {
        /// Time event of clock synchronisation, no reply.
        TimeEvent = 0x00, "Time_Event";
        /// Clock value of clock synchronisation, no reply.
        ClockValue = 0x80, "Clock_Value";
        /// Send data with acknowledge, low priority.
        SdaLow = 0x03, "SDA_low";
        /// Send data with no acknowledge, low priority.
        SdnLow = 0x04, "SDN_low";
        /// Send data with acknowledge, high priority.
        SdaHigh = 0x05, "SDA_high";
        /// Send data with no acknowledge, high priority: `Global_Control`.
        SdnHigh = 0x06, "SDN_high";
        /// Send and request data with multicast reply: `Data_Exchange` with a publisher (DXB).
        Msrd = 0x07, "MSRD";
        /// Request FDL status: GAP.
        FdlStatus = 0x09, "FDL_Status";
        /// Send and request data, low priority: MS1, MS2.
        SrdLow = 0x0C, "SRD_low";
        /// Send and request data, high priority: all of DP-V0.
        SrdHigh = 0x0D, "SRD_high";
        /// Request ident.
        Ident = 0x0E, "Ident";
        /// Request LSAP status.
        LsapStatus = 0x0F, "LSAP_Status";
    }
}
impl Service {
    /// Whether the addressed station answers, so that the initiator waits for the slot time.
    pub const fn expects_reply(self) -> bool {
        !matches!(self, Self::TimeEvent | Self::ClockValue | Self::SdnLow | Self::SdnHigh)
    }
}

/// Frame count bit and its validity (FCB, FCV), bits 5 and 4 of a request's FC. EN 50170-2.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Fcb {
    /// FCV = 0, FCB = 0: not counted (SDN, FDL status, ident).
    Unused,
    /// FCV = 0, FCB = 1: first request to a station, which takes it as a new beginning.
    First,
    /// FCV = 1: a new request inverts the bit, a retry repeats it.
    Alternate(bool),
}
impl Fcb {
    const fn bits(self) -> u8 {
        match self {
            Self::Unused => 0x00,
            Self::First => 0x20,
            Self::Alternate(false) => 0x10,
            Self::Alternate(true) => 0x30,
        }
    }
    const fn from_bits(octet: u8) -> Self {
        match octet & 0x30 {
            0x00 => Self::Unused,
            0x20 => Self::First,
            bits => Self::Alternate(bits & 0x20 != 0),
        }
    }
    /// What the next new request to the same station carries: after [`Fcb::First`] the bit 0, then inverted each time.
    #[must_use]
    pub const fn next(self) -> Self {
        match self {
            Self::Unused => Self::First,
            Self::First => Self::Alternate(false),
            Self::Alternate(bit) => Self::Alternate(!bit),
        }
    }
}

codes! {
    /// What kind of station answers: bits 5..4 of a response's FC. EN 50170-2.
    pub enum StationType: u8 {
        /// A passive station.
        Slave = 0x00, "slave";
        /// A master that is not ready to enter the ring.
        MasterNotReady = 0x10, "master, not ready";
        /// A master that waits to be let into the ring.
        MasterReady = 0x20, "master, ready";
        /// A master in the ring.
        MasterInRing = 0x30, "master, in ring";
    }
}

codes! {
    /// How a request went: bits 3..0 of a response's FC. EN 50170-2.
    pub enum Status: u8 {
        /// Positive acknowledgement.
        Ok = 0x00, "OK";
        /// User error.
        Ue = 0x01, "UE";
        /// No resources.
        Rr = 0x02, "RR";
        /// Service access point not enabled.
        Rs = 0x03, "RS";
        /// Reply data, low priority: the normal case.
        Dl = 0x08, "DL";
        /// No reply data ready.
        Nr = 0x09, "NR";
        /// Reply data, high priority: a diagnosis waits to be read.
        Dh = 0x0A, "DH";
        /// As `Dl`, but the data of the request found no resources.
        Rdl = 0x0C, "RDL";
        /// As `Dh`, but the data of the request found no resources.
        Rdh = 0x0D, "RDH";
    }
}

/// The octet FC.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum FrameControl {
    /// Bit 6 = 1: sent by the station that has the token.
    Request {
        /// What is asked for.
        service: Service,
        /// Frame count.
        fcb: Fcb,
    },
    /// Bit 6 = 0: an acknowledgement or reply.
    Response {
        /// Who answers.
        station: StationType,
        /// How it went.
        status: Status,
    },
}

impl FrameControl {
    /// A request for `service`.
    pub const fn request(service: Service, fcb: Fcb) -> Self {
        Self::Request { service, fcb }
    }
    /// A slave's response.
    pub const fn slave(status: Status) -> Self {
        Self::Response { station: StationType::Slave, status }
    }
    /// Reads FC.
    ///
    /// # Errors
    /// The code in bits 3..0 is not assigned, or bit 7 is 1 in anything but a clock value.
    pub const fn from_octet(octet: u8) -> Result<Self, ReservedFrameControl> {
        match Self::ALL[octet as usize] {
            Some(fc) => Ok(fc),
            None => Err(ReservedFrameControl(octet)),
        }
    }
    /// What each octet means.
    const ALL: [Option<Self>; 256] = {
        let mut all = [None; 256];
        let mut octet = 0;
        while octet < all.len() {
            all[octet] = Self::of(octet as u8);
            octet += 1;
        }
        all
    };
    const fn of(octet: u8) -> Option<Self> {
        if octet & 0x40 != 0 {
            match Service::from_code(octet & 0x8F) {
                Some(service) => Some(Self::Request { service, fcb: Fcb::from_bits(octet) }),
                None => None,
            }
        } else {
            match (StationType::from_code(octet & 0x30), Status::from_code(octet & 0x8F)) {
                (Some(station), Some(status)) => Some(Self::Response { station, status }),
                _ => None,
            }
        }
    }
    /// FC on the wire.
    pub const fn octet(self) -> u8 {
        match self {
            Self::Request { service, fcb } => 0x40 | fcb.bits() | service.code(),
            Self::Response { station, status } => station.code() | status.code(),
        }
    }
    /// Whether this is a request whose initiator waits for an answer.
    pub const fn expects_reply(self) -> bool {
        matches!(self, Self::Request { service, .. } if service.expects_reply())
    }
}

/// A frame control octet without a meaning.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ReservedFrameControl(pub u8);

impl fmt::Display for ReservedFrameControl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "frame control {:02X} is not assigned", self.0)
    }
}
impl core::error::Error for ReservedFrameControl {}

/// Everything a data telegram says before its data unit.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Header {
    /// Destination.
    pub da: Address,
    /// Source, 0..=126.
    pub sa: Address,
    /// Destination service access point; `None` is the default SAP, `Data_Exchange`.
    pub dsap: Option<Sap>,
    /// Source service access point.
    pub ssap: Option<Sap>,
    /// Frame control.
    pub fc: FrameControl,
}

impl Header {
    /// A request without service access points.
    pub const fn request(da: Address, sa: Address, service: Service, fcb: Fcb) -> Self {
        Self { da, sa, dsap: None, ssap: None, fc: FrameControl::request(service, fcb) }
    }
    /// The same header with both service access points.
    #[must_use]
    pub const fn with_saps(self, dsap: Sap, ssap: Sap) -> Self {
        Self { dsap: Some(dsap), ssap: Some(ssap), ..self }
    }
    /// The header of a slave's answer to this request: stations and service access points change sides.
    #[must_use]
    pub const fn slave_reply(&self, status: Status) -> Self {
        Self { da: self.sa, sa: self.da, dsap: self.ssap, ssap: self.dsap, fc: FrameControl::slave(status) }
    }
    /// Octets that the service access points take in front of the data unit.
    pub const fn sap_octets(&self) -> usize {
        self.dsap.is_some() as usize + self.ssap.is_some() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_frame_control_octet_is_refused_or_written_again() {
        let accepted = (0..=255u8).filter(|&octet| match FrameControl::from_octet(octet) {
            Ok(fc) => {
                assert_eq!(fc.octet(), octet);
                true
            }
            Err(error) => {
                assert_eq!(error.0, octet);
                false
            }
        });
        // Twelve services times four counts, nine statuses times four station types.
        assert_eq!(accepted.count(), 12 * 4 + 9 * 4);
    }

    #[test]
    fn frame_controls_of_the_profile_have_their_well_known_octets() {
        use Fcb::{Alternate, First, Unused};
        for (service, fcb, octet) in [
            (Service::SrdHigh, First, 0x6D),
            (Service::SrdHigh, Alternate(false), 0x5D),
            (Service::SrdHigh, Alternate(true), 0x7D),
            (Service::SrdLow, First, 0x6C),
            (Service::SrdLow, Alternate(false), 0x5C),
            (Service::SrdLow, Alternate(true), 0x7C),
            (Service::Msrd, First, 0x67),
            (Service::Msrd, Alternate(false), 0x57),
            (Service::Msrd, Alternate(true), 0x77),
            (Service::FdlStatus, Unused, 0x49),
            (Service::SdnHigh, Unused, 0x46),
            (Service::SdnLow, Unused, 0x44),
            (Service::ClockValue, Unused, 0xC0),
        ] {
            assert_eq!(FrameControl::request(service, fcb).octet(), octet, "{service} {fcb:?}");
        }
        let sequence: [Fcb; 4] = [First, First.next(), First.next().next(), First.next().next().next()];
        assert_eq!(sequence, [First, Alternate(false), Alternate(true), Alternate(false)]);
    }

    #[test]
    fn only_sends_without_acknowledge_and_clock_telegrams_stay_unanswered() {
        let silent = Service::ALL.iter().filter(|service| !service.expects_reply());
        assert!(silent.eq(&[Service::TimeEvent, Service::ClockValue, Service::SdnLow, Service::SdnHigh]));
        assert!(!FrameControl::slave(Status::Dl).expects_reply());
    }

    #[test]
    fn addresses_end_at_127() {
        assert_eq!(Address::new(127), Some(Address::BROADCAST));
        assert_eq!(Address::new(128), None);
        assert!(Address::MAX_STATION < Address::BROADCAST);
    }
}
