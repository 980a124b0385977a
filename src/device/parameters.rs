//! The acyclic parameters of the encoder, behind record 47 (manual 4).
//!
//! A master writes a request to the record and reads the response from it. All parameters are read-only; one that is not
//! answered with its value is answered with an error number, and the others of the request are answered all the same.
//!
//! | error | when |
//! |---|---|
//! | 00 | the parameter is not in [`PARAMETERS`] |
//! | 01 | its value is to be changed, whatever the value |
//! | 03 | an array has no such element |
//! | 04 | it is no array, but a subindex or several elements are asked for |
//! | 07 | its description is to be changed |
//! | 09, 0F | its description or text is to be read, or its text to be changed |
//! | 15 | its value does not fit into the response any more |
//! | 16 | the attribute is none, or no element of an array is asked for |
//! | 19 | the axis is neither 0 nor 1 |
//!
//! The numbers 17 and 18, of values that do not suit, never occur: being read-only comes first.

use core::fmt;

use crate::device::position::Position;
use crate::wire::Address;
use crate::wire::acyclic::ErrorCode;
use crate::wire::parameter::{
    ErrorNumber, Format, ParameterAddress, ParameterError, ParameterRule, Request, RequestId, ResponseId, Values,
    emit_response,
};

/// Most octets of a request or a response, C1_Max_Data_Len of the GSD file.
pub const MAX_LEN: usize = 240;
/// Most parameters of a request that has [`MAX_LEN`] octets.
const MAX_COUNT: usize = (MAX_LEN - HEAD) / 6;
/// Octets of a response's header.
const HEAD: usize = 4;
/// Octets of a parameter without value in a response: format, number, error number.
const REFUSAL: usize = 4;
/// The device's axis may be called this or 0.
const AXIS: u8 = 1;
/// The most revolutions that P979 tells: a device with 65 536 reports this.
const REVOLUTIONS_MAX: u32 = 0xFFFF;

/// A parameter of the device. Its name and those of its elements: [`name`](crate::wire::parameter::name),
/// [`element`](crate::wire::parameter::element).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Parameter {
    /// Parameter number, PNU.
    pub pnu: u16,
    /// Format of its value or of each element.
    pub format: Format,
    /// Elements, from subindex 0; 0 for a parameter that is no array.
    pub elements: u16,
}

/// Every parameter, by number (manual 4; elements PROFIdrive).
pub const PARAMETERS: &[Parameter] = &[
    Parameter { pnu: 918, format: Format::Unsigned16, elements: 0 },
    Parameter { pnu: 922, format: Format::Unsigned16, elements: 0 },
    Parameter { pnu: 964, format: Format::Unsigned16, elements: 6 },
    Parameter { pnu: 965, format: Format::OctetString, elements: 0 },
    Parameter { pnu: 979, format: Format::Unsigned32, elements: 11 },
];

/// The device itself, the elements of P964.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct DeviceIdentification {
    /// Number of the manufacturer.
    pub manufacturer: u16,
    /// The manufacturer's own number of the device.
    pub device_type: u16,
    /// Version of the firmware.
    pub firmware: u16,
    /// Year of the firmware.
    pub year: u16,
    /// Day and month of the firmware; decimal `ddmm` or an octet each, as the manufacturer likes.
    pub day_month: u16,
    /// Number of axes.
    pub axes: u16,
}
impl DeviceIdentification {
    const fn words(self) -> [u16; 6] {
        [self.manufacturer, self.device_type, self.firmware, self.year, self.day_month, self.axes]
    }
}

/// How the position is to be read from G1_XIST1 and G1_XIST2, what P979 says of them.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct SensorFormat {
    /// Values in a revolution (steps, or units when scaled).
    pub steps_per_rev: u32,
    /// Bits by which G1_XIST1 is shifted left.
    pub xist1_shift: u32,
    /// Bits by which G1_XIST2 is shifted left.
    pub xist2_shift: u32,
    /// Revolutions that are told apart, up to 65 535.
    pub revolutions: u32,
}
impl SensorFormat {
    /// Structure 1.1, one sensor, five elements for it.
    const HEADER: u32 = 0x0000_5111;
    /// Valid; bit 1 as encoders send it, the sources do not say what for.
    const TYPE: u32 = 0x8000_0002;

    /// The format in force. Model: with scaling, the whole revolutions in the total measuring range.
    pub fn of(position: &Position) -> Self {
        Self {
            steps_per_rev: position.values_per_rev(),
            xist1_shift: position.xist1_shift(),
            xist2_shift: position.xist2_shift(),
            revolutions: position.whole_revolutions().min(REVOLUTIONS_MAX),
        }
    }
    const fn double_words(self) -> [u32; 11] {
        let Self { steps_per_rev, xist1_shift, xist2_shift, revolutions } = self;
        [Self::HEADER, Self::TYPE, steps_per_rev, xist1_shift, xist2_shift, revolutions, 0, 0, 0, 0, 0]
    }
}

/// A request to record 47 that gets no response: the write is answered negatively.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Refused(pub ErrorCode);

impl From<ParameterError> for Refused {
    /// Model: what is wrong with the header is a range, with formats a type, with anything behind them a length.
    fn from(error: ParameterError) -> Self {
        Self(match error.rule {
            ParameterRule::Identifier => ErrorCode::RANGE,
            ParameterRule::Format => ErrorCode::TYPE,
            ParameterRule::Length | ParameterRule::Address | ParameterRule::Value | ParameterRule::Trailing => {
                ErrorCode::WRITE_LENGTH
            }
        })
    }
}
impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "parameter request refused: {} ({:02X})", self.0.name().unwrap_or("unknown"), self.0.0)
    }
}
impl core::error::Error for Refused {}

/// What the parameters say at one moment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Parameters {
    /// P918, the station's address.
    pub address: Address,
    /// P922, number of the cyclic telegram; 81 for these encoders.
    pub telegram: u16,
    /// P964.
    pub identification: DeviceIdentification,
    /// P965, profile number and version.
    pub profile: [u8; 2],
    /// P979.
    pub format: SensorFormat,
}

impl Parameters {
    /// P965 of an encoder with profile 3, version 2. Model: the manual does not print the value.
    pub const PROFILE: [u8; 2] = [0x03, 0x02];

    /// Answers `request`, written to record 47, with the response that a read finds there; its length.
    ///
    /// A response has at most [`MAX_LEN`] octets, or as many as `out` has.
    ///
    /// # Errors
    /// A request that is none, that is too long or has no parameters, or an `out` in which not even all error numbers fit.
    pub fn answer(&self, request: &[u8], out: &mut [u8]) -> Result<usize, Refused> {
        if request.len() > MAX_LEN {
            return Err(Refused(ErrorCode::WRITE_LENGTH));
        }
        let request = Request::parse(request)?;
        let count = request.count();
        if !(1..=MAX_COUNT).contains(&count) {
            return Err(Refused(ErrorCode::RANGE));
        }
        let unavailable = Refused(ErrorCode::UNAVAILABLE);
        let room = out.len().min(MAX_LEN).checked_sub(HEAD + count * REFUSAL).ok_or(unavailable)?;
        let octets = self.octets();
        let answers = answers(&request, &octets, room);
        let values = answers.each_ref().map(|answer| match answer {
            Ok(values) => *values,
            Err(number) => Values::error(number),
        });
        let good = answers[..count].iter().all(Result::is_ok);
        let head = (request.reference, ResponseId::of(request.id, good), request.axis);
        emit_response(head, count as u8, &values[..count], out).ok_or(unavailable)
    }

    fn octets(&self) -> Octets {
        Octets {
            address: u16::from(self.address.get()).to_be_bytes(),
            telegram: self.telegram.to_be_bytes(),
            identification: self.identification.words().map(u16::to_be_bytes),
            profile: self.profile,
            format: self.format.double_words().map(u32::to_be_bytes),
        }
    }
}

/// The values of all parameters as they go onto the line.
struct Octets {
    address: [u8; 2],
    telegram: [u8; 2],
    identification: [[u8; 2]; 6],
    profile: [u8; 2],
    format: [[u8; 4]; 11],
}
impl Octets {
    fn get(&self, pnu: u16) -> &[u8] {
        match pnu {
            918 => &self.address,
            922 => &self.telegram,
            964 => self.identification.as_flattened(),
            965 => &self.profile,
            979 => self.format.as_flattened(),
            _ => &[],
        }
    }
}

/// A value, or the octets of an error number.
type Answer<'a> = Result<Values<'a>, [u8; 2]>;

/// The answer to each parameter in its order; `room` (octets) is left for values longer than a refusal.
fn answers<'a>(request: &Request<'_>, octets: &'a Octets, mut room: usize) -> [Answer<'a>; MAX_COUNT] {
    let mut answers = [Err([0; 2]); MAX_COUNT];
    for (answer, address) in answers.iter_mut().zip(request.addresses()) {
        let value = value(request.id, request.axis, address, octets).and_then(|values| {
            let more = (2 + values.data.len().next_multiple_of(2)).saturating_sub(REFUSAL);
            room = room.checked_sub(more).ok_or(ErrorNumber::ResponseTooLong)?;
            Ok(values)
        });
        *answer = value.map_err(|number| number.code().to_be_bytes());
    }
    answers
}

/// The value asked for.
fn value(id: RequestId, axis: u8, address: ParameterAddress, octets: &Octets) -> Result<Values<'_>, ErrorNumber> {
    if axis > AXIS {
        return Err(ErrorNumber::NoAxis);
    }
    let known = PARAMETERS.iter().find(|parameter| parameter.pnu == address.pnu);
    let parameter = known.ok_or(ErrorNumber::NoSuchParameter)?;
    match (address.attribute, id) {
        (ParameterAddress::VALUE, RequestId::Read) => {}
        (ParameterAddress::VALUE, RequestId::Change) => return Err(ErrorNumber::ReadOnly),
        (ParameterAddress::DESCRIPTION, RequestId::Read) => return Err(ErrorNumber::NoDescription),
        (ParameterAddress::DESCRIPTION, RequestId::Change) => return Err(ErrorNumber::DescriptionReadOnly),
        (ParameterAddress::TEXT, _) => return Err(ErrorNumber::NoText),
        _ => return Err(ErrorNumber::BadAddress),
    }
    let all = octets.get(parameter.pnu);
    let (elements, first) = (usize::from(address.elements), usize::from(address.subindex));
    let data = match (parameter.elements, elements, first) {
        (0, 0 | 1, 0) => all,
        (0, ..) => return Err(ErrorNumber::NoArray),
        (_, 0, _) => return Err(ErrorNumber::BadAddress),
        (_, elements, first) => {
            let size = parameter.format.size();
            all.get(first * size..(first + elements) * size).ok_or(ErrorNumber::Subindex)?
        }
    };
    Ok(Values { format: parameter.format, data })
}
