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
    pub elements: usize,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::position::{CodeSequence, Scaling};
    use crate::wire::parameter::{Response, emit_request};
    use alloc::string::ToString;
    use alloc::vec::Vec;
    use proptest::prelude::*;

    /// 29-bit encoder at address 55 with the identification of the vectors.
    fn parameters() -> Parameters {
        let identification = DeviceIdentification {
            manufacturer: 0x012A,
            device_type: 0,
            firmware: 0x1000,
            year: 2007,
            day_month: 0x1109,
            axes: 1,
        };
        Parameters {
            address: Address::new(55).unwrap(),
            telegram: 81,
            identification,
            profile: Parameters::PROFILE,
            format: format(8192, 65_536, None),
        }
    }
    fn format(steps: u32, revolutions: u32, scaling: Option<(u32, u32)>) -> SensorFormat {
        let scaling = scaling.map(|(units_per_rev, total_range)| Scaling { units_per_rev, total_range });
        SensorFormat::of(&Position::new(steps, revolutions, CodeSequence::Cw, scaling).unwrap())
    }
    fn hex(text: &str) -> Vec<u8> {
        text.split(' ').map(|octet| u8::from_str_radix(octet, 16).unwrap()).collect()
    }
    fn answered(parameters: &Parameters, request: &[u8]) -> Result<Vec<u8>, Refused> {
        let mut out = [0xEE; 300];
        let len = parameters.answer(request, &mut out)?;
        assert!(out[len..].iter().all(|&octet| octet == 0xEE));
        Ok(out[..len].to_vec())
    }
    fn check(parameters: &Parameters, request: &str, response: &str) {
        assert_eq!(answered(parameters, &hex(request)), Ok(hex(response)), "{request}");
    }
    fn read(addresses: &[ParameterAddress]) -> Vec<u8> {
        let mut out = [0; 300];
        let len = emit_request((7, RequestId::Read, 0), addresses, &[], &mut out).unwrap();
        out[..len].to_vec()
    }
    /// Every element of `parameter`.
    fn whole(parameter: &Parameter) -> ParameterAddress {
        let elements = parameter.elements as u8;
        ParameterAddress { attribute: ParameterAddress::VALUE, elements, pnu: parameter.pnu, subindex: 0 }
    }

    #[test]
    fn answers_are_those_of_real_devices() {
        let device = parameters();
        check(&device, "AA 01 00 01 10 01 03 96 00 00", "AA 01 00 01 06 01 00 37");
        let p964 = "01 01 00 01 06 05 01 2A 00 00 10 00 07 D7 11 09";
        check(&device, "01 01 00 01 10 05 03 C4 00 00", p964);
        check(&device, "01 01 00 01 10 01 03 C5 00 00", "01 01 00 01 0A 02 03 02");
        let p979 = "AA 01 00 01 07 06 00 00 51 11 80 00 00 02 00 00 20 00 00 00 00 03 00 00 00 00 00 00 FF FF";
        check(&device, "AA 01 00 01 10 06 03 D3 00 00", p979);
        let disc_13_12 = Parameters { format: format(8192, 4096, None), ..device };
        let p979 = "01 01 00 01 07 05 80 00 00 02 00 00 20 00 00 00 00 07 00 00 00 00 00 00 10 00";
        check(&disc_13_12, "01 01 00 01 10 05 03 D3 00 01", p979);
        check(&device, "01 01 00 01 10 01 03 9A 00 00", "01 01 00 01 06 01 00 51");
        check(&device, "01 01 00 01 10 01 03 9D 00 00", "01 81 00 01 44 01 00 00");
    }

    #[test]
    fn each_error_has_its_reason() {
        for (axis, id, address, number) in [
            (0, "01", "10 01 00 01 00 00", 0x00),
            (0, "01", "30 01 00 01 00 00", 0x00),
            (0, "01", "10 01 03 C4 00 06", 0x03),
            (0, "01", "10 02 03 C4 00 05", 0x03),
            (0, "01", "10 07 03 C4 00 00", 0x03),
            (0, "01", "10 0C 03 D3 00 00", 0x03),
            (0, "01", "10 FF 03 D3 FF FF", 0x03),
            (0, "01", "10 01 03 96 00 01", 0x04),
            (0, "01", "10 02 03 96 00 00", 0x04),
            (0, "01", "10 02 03 C5 00 00", 0x04),
            (0, "01", "20 01 03 96 00 00", 0x09),
            (0, "01", "30 01 03 96 00 00", 0x0F),
            (0, "01", "10 00 03 C4 00 00", 0x16),
            (0, "01", "00 01 03 96 00 00", 0x16),
            (0, "01", "11 01 03 96 00 00", 0x16),
            (2, "01", "10 01 03 96 00 00", 0x19),
            (255, "02", "10 01 00 01 00 00", 0x19),
            (0, "02", "10 01 03 9D 00 00", 0x00),
            (0, "02", "10 01 03 96 00 00", 0x01),
            (0, "02", "10 01 03 96 00 09", 0x01),
            (0, "02", "20 01 03 96 00 00", 0x07),
            (0, "02", "30 01 03 96 00 00", 0x0F),
            (0, "02", "40 01 03 96 00 00", 0x16),
        ] {
            let mut request = hex(&alloc::format!("05 {id} {axis:02X} 01 {address}"));
            if id == "02" {
                request.extend(hex("06 01 00 38"));
            }
            let id = if id == "01" { 0x81 } else { 0x82 };
            let expected = [5, id, axis, 1, 0x44, 1, 0, number].to_vec();
            assert_eq!(answered(&parameters(), &request), Ok(expected), "{id} axis {axis} {address}");
        }
    }

    #[test]
    fn axis_0_and_axis_1_are_the_same() {
        let device = parameters();
        check(&device, "AA 01 01 01 10 00 03 96 00 00", "AA 01 01 01 06 01 00 37");
    }

    #[test]
    fn several_parameters_fail_or_succeed_each_for_itself() {
        let device = parameters();
        let request = "09 01 00 03 10 01 03 96 00 00 10 01 00 02 00 00 10 02 03 D3 00 02";
        check(&device, request, "09 81 00 03 06 01 00 37 44 01 00 00 07 02 00 00 20 00 00 00 00 03");
        let change = "09 02 00 02 10 01 03 96 00 00 10 01 00 02 00 00 06 01 00 05 05 01 07 00";
        check(&device, change, "09 82 00 02 44 01 00 01 44 01 00 00");
    }

    #[test]
    fn the_table_is_what_is_answered() {
        let device = parameters();
        assert!(PARAMETERS.is_sorted_by_key(|parameter| parameter.pnu));
        for parameter in PARAMETERS {
            let response = answered(&device, &read(&[whole(parameter)])).unwrap();
            let response = Response::parse(&response).unwrap();
            let values: Vec<_> = response.values().collect();
            assert_eq!((response.id, values.len(), values[0].format), (ResponseId::Read, 1, parameter.format));
            match parameter.elements {
                0 => assert_eq!(values[0].data.len(), 2, "P{}", parameter.pnu),
                elements => assert_eq!(values[0].count(), elements, "P{}", parameter.pnu),
            }
            for subindex in 0..parameter.elements {
                let address = ParameterAddress { elements: 1, subindex: subindex as u16, ..whole(parameter) };
                let response = answered(&device, &read(&[address])).unwrap();
                let element = Response::parse(&response).unwrap().values().next().and_then(|one| one.unsigned(0));
                assert_eq!(element, values[0].unsigned(subindex), "P{}[{subindex}]", parameter.pnu);
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_too_long_and_shorter_values_behind_it_are_read() {
        let device = parameters();
        let address = whole(&PARAMETERS[0]);
        let format = whole(&PARAMETERS[4]);
        // Five formats of 46 octets, an address of 4 and the header are 238. A sixth format is too long; so is the fifth,
        // because a refusal is kept free for each parameter.
        let request = read(&[format, format, format, format, format, address]);
        assert_eq!(answered(&device, &request).map(|response| response.len()), Ok(238));
        let request = read(&[format, format, format, format, format, format, address]);
        let response = answered(&device, &request).unwrap();
        let response = Response::parse(&response).unwrap();
        let numbers: Vec<_> = response.values().map(|values| values.error_number()).collect();
        assert_eq!(response.id, ResponseId::ReadFailed);
        assert_eq!(numbers, [None, None, None, None, Some(0x15), Some(0x15), None]);
        assert_eq!(answered(&device, &read(&[address; MAX_COUNT])).map(|response| response.len()), Ok(160));
    }

    #[test]
    fn an_out_that_is_short_makes_values_too_long_and_then_the_request_unavailable() {
        let (device, request) = (parameters(), read(&[whole(&PARAMETERS[2])]));
        let mut out = [0; MAX_LEN];
        for (room, len) in [(18, Ok(18)), (17, Ok(8)), (8, Ok(8)), (7, Err(Refused(ErrorCode::UNAVAILABLE)))] {
            assert_eq!(device.answer(&request, &mut out[..room]), len, "{room}");
        }
        assert_eq!(device.answer(&request, &mut []), Err(Refused(ErrorCode::UNAVAILABLE)));
    }

    #[test]
    fn a_request_that_is_none_is_refused() {
        let device = parameters();
        for (text, code) in [
            ("01", ErrorCode::WRITE_LENGTH),
            ("01 03 00 01 10 01 03 96 00 00", ErrorCode::RANGE),
            ("01 01 00 00", ErrorCode::RANGE),
            ("01 01 00 02 10 01 03 96 00 00", ErrorCode::WRITE_LENGTH),
            ("01 01 00 01 10 01 03 96 00", ErrorCode::WRITE_LENGTH),
            ("01 01 00 01 10 01 03 96 00 00 00", ErrorCode::WRITE_LENGTH),
            ("01 02 00 01 10 01 03 96 00 00", ErrorCode::WRITE_LENGTH),
            ("01 02 00 01 10 01 03 96 00 00 06 02 00 01", ErrorCode::WRITE_LENGTH),
            ("01 02 00 01 10 01 03 96 00 00 33 01 00 01", ErrorCode::TYPE),
        ] {
            assert_eq!(answered(&device, &hex(text)), Err(Refused(code)), "{text}");
        }
        assert_eq!(answered(&device, &[]), Err(Refused(ErrorCode::WRITE_LENGTH)));
        let long = read(&[whole(&PARAMETERS[0]); MAX_COUNT + 1]);
        assert_eq!(answered(&device, &long), Err(Refused(ErrorCode::WRITE_LENGTH)));
        assert_eq!(Refused(ErrorCode::RANGE).to_string(), "parameter request refused: invalid range (B7)");
    }

    #[test]
    fn the_sensor_format_is_that_of_the_position_in_force() {
        for (scaling, steps_per_rev, xist1_shift, revolutions) in [
            (None, 8192, 7, 4096),
            (Some((8192, 1 << 25)), 8192, 7, 4096),
            (Some((4096, 1 << 24)), 4096, 8, 4096),
            (Some((100, 12_800)), 100, 18, 128),
            (Some((100, 12_850)), 100, 18, 128),
            (Some((100, 50)), 100, 26, 0),
        ] {
            let expected = SensorFormat { steps_per_rev, xist1_shift, xist2_shift: 0, revolutions };
            assert_eq!(format(8192, 4096, scaling), expected, "{scaling:?}");
        }
        assert_eq!(format(8192, 1, None).revolutions, 1);
        assert_eq!(format(1, 65_535, None).revolutions, 65_535);
    }

    /// Requests whose parts mostly make sense.
    fn plausible() -> impl Strategy<Value = Vec<u8>> {
        let attribute = prop_oneof![8 => Just(0x10u8), 1 => Just(0x20), 1 => Just(0x30), 1 => any::<u8>()];
        let pnu = prop_oneof![9 => prop::sample::select(&[918u16, 922, 964, 965, 979][..]), 1 => any::<u16>()];
        let subindex = prop_oneof![9 => 0u16..12, 1 => any::<u16>()];
        let elements = prop_oneof![9 => 0u8..12, 1 => any::<u8>()];
        let address = (attribute, elements, pnu, subindex)
            .prop_map(|(attribute, elements, pnu, subindex)| ParameterAddress { attribute, elements, pnu, subindex });
        let addresses = prop::collection::vec(address, 0..45);
        (any::<u8>(), any::<bool>(), prop_oneof![9 => 0u8..2, 1 => any::<u8>()], addresses).prop_map(
            |(reference, change, axis, addresses)| {
                let id = if change { RequestId::Change } else { RequestId::Read };
                let value = Values { format: Format::Unsigned8, data: &[1] };
                let values: Vec<_> = addresses.iter().filter(|_| change).map(|_| value).collect();
                let mut out = [0; 600];
                let len = emit_request((reference, id, axis), &addresses, &values, &mut out).unwrap();
                out[..len].to_vec()
            },
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2048))]

        #[test]
        fn whatever_is_written_the_response_can_be_read(
            request in prop_oneof![2 => plausible(), 1 => prop::collection::vec(any::<u8>(), 0..300)],
            room in prop_oneof![1 => Just(300usize), 1 => 0usize..300],
        ) {
            let mut out = [0; 300];
            let Ok(len) = parameters().answer(&request, &mut out[..room]) else { return Ok(()) };
            prop_assert!(len <= room.min(MAX_LEN) && request.len() <= MAX_LEN);
            let response = Response::parse(&out[..len]).expect("a response");
            let request = Request::parse(&request).expect("what was answered");
            prop_assert_eq!(response.reference, request.reference);
            prop_assert_eq!(response.axis, request.axis);
            prop_assert_eq!(usize::from(response.count), request.count());
            let good = response.values().all(|values| values.error_number().is_none());
            prop_assert_eq!(response.id, ResponseId::of(request.id, good));
            prop_assert!(!good || request.id == RequestId::Read);
            for (address, values) in request.addresses().zip(response.values()) {
                match values.error_number() {
                    Some(number) => prop_assert!(ErrorNumber::from_code(number).is_some()),
                    None if values.format == Format::OctetString => prop_assert_eq!(values.count(), 2),
                    None => prop_assert_eq!(values.count(), usize::from(address.elements).max(1)),
                }
            }
        }

        #[test]
        fn the_sensor_format_finds_the_position_in_the_words(
            raw in any::<u32>(),
            (units, range) in (1u32..=8192).prop_flat_map(|units| (Just(units), 1..=units * 4096)),
            scaled in any::<bool>(),
        ) {
            let scaling = scaled.then_some(Scaling { units_per_rev: units, total_range: range });
            let position = Position::new(8192, 4096, CodeSequence::Cw, scaling).unwrap();
            let (format, value) = (SensorFormat::of(&position), position.value(raw));
            prop_assert_eq!(position.xist1(value) >> format.xist1_shift, value);
            prop_assert_eq!(position.xist2(value) >> format.xist2_shift, value);
            prop_assert!(u64::from(format.steps_per_rev) * u64::from(format.revolutions) <= position.range());
        }
    }
}
