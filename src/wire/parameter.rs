//! Parameter: requests and responses of the PROFIdrive parameter channel, the contents of record 47. PROFIdrive base mode.
//!
//! A request is written to the record, its response is then read from it. Values stay as octets, big-endian, next to
//! their format.

use super::Writer;

/// Octets of a header: reference, identifier, axis, number of parameters.
const HEAD: usize = 4;
/// Octets of a parameter's address.
const ADDRESS: usize = 6;

rules! {
    /// A parameter request or response that cannot be read.
    pub struct ParameterError, pub enum ParameterRule {
        Length = "the header has 4 octets";
        Identifier = "another request or response identifier belongs here";
        Address = "each parameter has an address of 6 octets";
        Value = "a value has a format, a number and as many octets, padded to an even length";
        Format = "the format is not assigned";
        Trailing = "nothing follows the last value";
    }
}

codes! {
    /// What a request does.
    pub enum RequestId: u8 {
        /// Read values.
        Read = 0x01, "read";
        /// Change values.
        Change = 0x02, "change";
    }
}
codes! {
    /// How a request went.
    pub enum ResponseId: u8 {
        /// All values were read.
        Read = 0x01, "read";
        /// All values were changed.
        Changed = 0x02, "changed";
        /// At least one parameter was not read.
        ReadFailed = 0x81, "read failed";
        /// At least one parameter was not changed.
        ChangeFailed = 0x82, "change failed";
    }
}
impl ResponseId {
    /// The answer to `request`, good or bad.
    pub const fn of(request: RequestId, good: bool) -> Self {
        match (request, good) {
            (RequestId::Read, true) => Self::Read,
            (RequestId::Read, false) => Self::ReadFailed,
            (RequestId::Change, true) => Self::Changed,
            (RequestId::Change, false) => Self::ChangeFailed,
        }
    }
}

codes! {
    /// How the octets of a value are to be read.
    pub enum Format: u8 {
        /// Signed, one octet.
        Integer8 = 0x02, "Integer8";
        /// Signed, two octets.
        Integer16 = 0x03, "Integer16";
        /// Signed, four octets.
        Integer32 = 0x04, "Integer32";
        /// Unsigned, one octet.
        Unsigned8 = 0x05, "Unsigned8";
        /// Unsigned, two octets.
        Unsigned16 = 0x06, "Unsigned16";
        /// Unsigned, four octets.
        Unsigned32 = 0x07, "Unsigned32";
        /// Floating point, four octets.
        Float32 = 0x08, "FloatingPoint32";
        /// Characters, counted in octets.
        VisibleString = 0x09, "VisibleString";
        /// Octets.
        OctetString = 0x0A, "OctetString";
        /// No value.
        Zero = 0x40, "zero";
        /// One octet.
        Byte = 0x41, "byte";
        /// Two octets.
        Word = 0x42, "word";
        /// Four octets.
        DoubleWord = 0x43, "double word";
        /// An error number, two octets, and what belongs to it.
        Error = 0x44, "error";
    }
}
impl Format {
    /// Octets of one value.
    pub const fn size(self) -> usize {
        match self {
            Self::Zero => 0,
            Self::Integer8 | Self::Unsigned8 | Self::VisibleString | Self::OctetString | Self::Byte => 1,
            Self::Integer16 | Self::Unsigned16 | Self::Word | Self::Error => 2,
            Self::Integer32 | Self::Unsigned32 | Self::Float32 | Self::DoubleWord => 4,
        }
    }
}

codes! {
    /// Why a parameter was not read or changed.
    pub enum ErrorNumber: u16 {
        /// There is no such parameter.
        NoSuchParameter = 0x00, "no such parameter";
        /// It can only be read.
        ReadOnly = 0x01, "parameter is read-only";
        /// The value is beyond its limits.
        Limit = 0x02, "value beyond its limits";
        /// There is no such subindex.
        Subindex = 0x03, "bad subindex";
        /// The parameter is no array.
        NoArray = 0x04, "parameter is no array";
        /// The value has another type.
        WrongType = 0x05, "wrong data type";
        /// It can only be reset.
        ResetOnly = 0x06, "only a reset is allowed";
        /// The description cannot be changed.
        DescriptionReadOnly = 0x07, "description is read-only";
        /// There is no description.
        NoDescription = 0x09, "no description";
        /// The rights to operate are missing.
        NoRights = 0x0B, "no rights to operate";
        /// There is no text.
        NoText = 0x0F, "no text";
        /// Not in this state of the device.
        State = 0x11, "not in this state";
        /// The value is none of those allowed.
        BadValue = 0x14, "bad value";
        /// The response would be too long.
        ResponseTooLong = 0x15, "response too long";
        /// The address has a value that cannot be.
        BadAddress = 0x16, "bad parameter address";
        /// The format is not assigned or does not suit.
        BadFormat = 0x17, "bad format";
        /// The number of values does not suit.
        BadCount = 0x18, "number of values does not match";
        /// There is no such axis.
        NoAxis = 0x19, "no such axis";
    }
}

/// One parameter asked for.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct ParameterAddress {
    /// Octet 1: 10 value, 20 description, 30 text.
    pub attribute: u8,
    /// Octet 2, number of array elements; 0 or 1 for a parameter that is none.
    pub elements: u8,
    /// Octets 3..=4, parameter number.
    pub pnu: u16,
    /// Octets 5..=6, first array element.
    pub subindex: u16,
}
impl ParameterAddress {
    /// [`ParameterAddress::attribute`]: the value.
    pub const VALUE: u8 = 0x10;
    /// [`ParameterAddress::attribute`]: the description.
    pub const DESCRIPTION: u8 = 0x20;
    /// [`ParameterAddress::attribute`]: the text.
    pub const TEXT: u8 = 0x30;

    const fn of_octets([attribute, elements, p0, p1, s0, s1]: [u8; ADDRESS]) -> Self {
        Self { attribute, elements, pnu: u16::from_be_bytes([p0, p1]), subindex: u16::from_be_bytes([s0, s1]) }
    }
    const fn octets(self) -> [u8; ADDRESS] {
        let [p0, p1] = self.pnu.to_be_bytes();
        let [s0, s1] = self.subindex.to_be_bytes();
        [self.attribute, self.elements, p0, p1, s0, s1]
    }
}

/// The value, or values, of one parameter.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Values<'a> {
    /// Octet 1.
    pub format: Format,
    /// From octet 3 on: whole values of this format, without the padding. Octet 2 is their number.
    pub data: &'a [u8],
}

impl<'a> Values<'a> {
    /// The refusal of one parameter; `number` are the two octets of an [`ErrorNumber`].
    pub const fn error(number: &'a [u8; 2]) -> Self {
        Self { format: Format::Error, data: number }
    }
    /// How many values there are.
    pub const fn count(&self) -> usize {
        match self.format.size() {
            0 => 0,
            size => self.data.len() / size,
        }
    }
    /// The error number if this is a refusal; assigned ones are [`ErrorNumber`]s.
    pub const fn error_number(&self) -> Option<u16> {
        match (self.format, self.data) {
            (Format::Error, &[high, low, ..]) => Some(u16::from_be_bytes([high, low])),
            _ => None,
        }
    }
    /// Value `at` as an unsigned integer; `None` if there is none or the format is signed, floating or a string.
    pub fn unsigned(&self, at: usize) -> Option<u32> {
        let unsigned = matches!(
            self.format,
            Format::Unsigned8
                | Format::Unsigned16
                | Format::Unsigned32
                | Format::Byte
                | Format::Word
                | Format::DoubleWord
        );
        let octets = self.data.chunks_exact(self.format.size().max(1)).nth(at).filter(|_| unsigned)?;
        Some(octets.iter().fold(0, |value, &octet| value << 8 | u32::from(octet)))
    }
    /// One value off the front of `rest`; `octet` is the number of its first octet.
    fn take(rest: &'a [u8], octet: usize) -> Result<(Self, &'a [u8]), ParameterError> {
        let &[format, count, ref rest @ ..] = rest else {
            return Err(ParameterError::new(octet, ParameterRule::Value, rest.len() as u32));
        };
        let known = Format::from_code(format).ok_or(ParameterError::new(octet, ParameterRule::Format, format))?;
        let len = known.size() * usize::from(count);
        let padded = len.next_multiple_of(2);
        match (rest.get(..len), rest.get(padded..)) {
            // A zero has no octets, whatever its number; only 0 could be written again.
            (Some(data), Some(rest)) if known != Format::Zero || count == 0 => Ok((Self { format: known, data }, rest)),
            _ => Err(ParameterError::new(octet + 1, ParameterRule::Value, count)),
        }
    }
    fn put(&self, writer: &mut Writer<'_>) -> Option<()> {
        let count = self.count();
        if count * self.format.size() != self.data.len() {
            return None;
        }
        writer.put(&[self.format.code(), u8::try_from(count).ok()?])?;
        writer.put(self.data)?;
        if self.data.len().is_multiple_of(2) { Some(()) } else { writer.put(&[0]) }
    }
}

/// Iterator over values, each with everything behind it already checked.
#[derive(Clone, PartialEq, Eq, Debug)]
struct Checked<'a>(&'a [u8]);

impl<'a> Checked<'a> {
    /// Checks that `rest` is exactly `count` values.
    fn new(rest: &'a [u8], count: u8, first: usize) -> Result<Self, ParameterError> {
        let mut left = rest;
        for _ in 0..count {
            let octet = first + rest.len() - left.len();
            (_, left) = Values::take(left, octet)?;
        }
        match left {
            [] => Ok(Self(rest)),
            &[octet, ..] => Err(ParameterError::new(first + rest.len() - left.len(), ParameterRule::Trailing, octet)),
        }
    }
}
impl<'a> Iterator for Checked<'a> {
    type Item = Values<'a>;

    fn next(&mut self) -> Option<Self::Item> {
        let (values, rest) = Values::take(self.0, 0).ok()?;
        self.0 = rest;
        Some(values)
    }
}

/// What a parameter is about (manual 4).
pub const fn name(pnu: u16) -> &'static str {
    match pnu {
        918 => "PROFIBUS address",
        922 => "telegram number",
        925 => "tolerated sign-of-life failures",
        964 => "device identification",
        965 => "profile number",
        979 => "sensor format",
        _ => "not known",
    }
}
/// What an element of a parameter is about.
pub const fn element(pnu: u16, subindex: u16) -> &'static str {
    match (pnu, subindex) {
        (964, 0) => "manufacturer",
        (964, 1) => "device type",
        (964, 2) => "firmware version",
        (964, 3) => "firmware year",
        (964, 4) => "firmware day and month",
        (964, 5) => "number of axes",
        (965, 0) => "profile number",
        (965, 1) => "profile version",
        (979, 0) => "header",
        (979, 1) => "sensor type",
        (979, 2) => "steps per revolution",
        (979, 3) => "shift factor of G1_XIST1",
        (979, 4) => "shift factor of G1_XIST2",
        (979, 5) => "determinable revolutions",
        _ => name(pnu),
    }
}

/// A request for one or more parameters.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Request<'a> {
    /// Octet 1: chosen by the master, mirrored by the slave.
    pub reference: u8,
    /// Octet 2.
    pub id: RequestId,
    /// Octet 3: axis, 0 for a device that has one.
    pub axis: u8,
    addresses: &'a [u8],
    values: Checked<'a>,
}

impl<'a> Request<'a> {
    /// Reads the contents of a written record.
    ///
    /// # Errors
    /// An identifier that is not assigned, or a length that does not suit the number of parameters in octet 4.
    pub fn parse(data: &'a [u8]) -> Result<Self, ParameterError> {
        let &[reference, id, axis, count, ref rest @ ..] = data else {
            return Err(ParameterError::new(data.len(), ParameterRule::Length, data.len() as u32));
        };
        let id = RequestId::from_code(id).ok_or(ParameterError::new(2, ParameterRule::Identifier, id))?;
        let len = usize::from(count) * ADDRESS;
        let (addresses, values) =
            rest.split_at_checked(len).ok_or(ParameterError::new(HEAD, ParameterRule::Address, count))?;
        let values_count = if id == RequestId::Change { count } else { 0 };
        let values = Checked::new(values, values_count, HEAD + len + 1)?;
        Ok(Self { reference, id, axis, addresses, values })
    }
    /// Number of parameters, octet 4.
    pub const fn count(&self) -> usize {
        self.addresses.len() / ADDRESS
    }
    /// The parameters in their order.
    pub fn addresses(&self) -> impl Iterator<Item = ParameterAddress> + use<'a> {
        let (addresses, _) = self.addresses.as_chunks::<ADDRESS>();
        addresses.iter().copied().map(ParameterAddress::of_octets)
    }
    /// The values of a change request, one for each parameter.
    pub fn values(&self) -> impl Iterator<Item = Values<'a>> + use<'a> {
        self.values.clone()
    }
}

/// Writes a request: for reading without `values`, for changing with one for each address. Its length, or `None` if it
/// does not fit or the numbers do not match.
pub fn emit_request(
    (reference, id, axis): (u8, RequestId, u8),
    addresses: &[ParameterAddress],
    values: &[Values<'_>],
    out: &mut [u8],
) -> Option<usize> {
    let wanted = if id == RequestId::Change { addresses.len() } else { 0 };
    if values.len() != wanted {
        return None;
    }
    let mut writer = Writer::new(out);
    writer.put(&[reference, id.code(), axis, u8::try_from(addresses.len()).ok()?])?;
    addresses.iter().try_for_each(|address| writer.put(&address.octets()))?;
    values.iter().try_for_each(|values| values.put(&mut writer))?;
    Some(writer.len)
}

/// The answer to a [`Request`].
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Response<'a> {
    /// Octet 1: as in the request.
    pub reference: u8,
    /// Octet 2.
    pub id: ResponseId,
    /// Octet 3: as in the request.
    pub axis: u8,
    /// Octet 4: number of parameters.
    pub count: u8,
    values: Checked<'a>,
}

impl<'a> Response<'a> {
    /// Reads the contents of a read record.
    ///
    /// # Errors
    /// An identifier or format that is not assigned, or a length that does not suit.
    pub fn parse(data: &'a [u8]) -> Result<Self, ParameterError> {
        let &[reference, id, axis, count, ref rest @ ..] = data else {
            return Err(ParameterError::new(data.len(), ParameterRule::Length, data.len() as u32));
        };
        let id = ResponseId::from_code(id).ok_or(ParameterError::new(2, ParameterRule::Identifier, id))?;
        let values_count = if id == ResponseId::Changed { 0 } else { count };
        let values = Checked::new(rest, values_count, HEAD + 1)?;
        Ok(Self { reference, id, axis, count, values })
    }
    /// The values or errors, one for each parameter; none when all were changed.
    pub fn values(&self) -> impl Iterator<Item = Values<'a>> + use<'a> {
        self.values.clone()
    }
}

/// Writes a response of `count` parameters with one value or error for each, none for [`ResponseId::Changed`]. Its
/// length, or `None` if it does not fit or the numbers do not match.
pub fn emit_response(
    (reference, id, axis): (u8, ResponseId, u8),
    count: u8,
    values: &[Values<'_>],
    out: &mut [u8],
) -> Option<usize> {
    let wanted = if id == ResponseId::Changed { 0 } else { usize::from(count) };
    if values.len() != wanted {
        return None;
    }
    let mut writer = Writer::new(out);
    writer.put(&[reference, id.code(), axis, count])?;
    values.iter().try_for_each(|values| values.put(&mut writer))?;
    Some(writer.len)
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    fn hex(text: &str) -> Vec<u8> {
        text.split(' ').map(|octet| u8::from_str_radix(octet, 16).unwrap()).collect()
    }

    #[test]
    fn requests_to_read_are_those_of_real_devices() {
        for (text, reference, elements, pnu, subindex) in [
            ("01 01 00 01 10 05 03 D3 00 01", 1, 5, 979, 1),
            ("01 01 00 01 10 05 03 C4 00 00", 1, 5, 964, 0),
            ("AA 01 00 01 10 01 03 96 00 00", 0xAA, 1, 918, 0),
            ("AA 01 00 01 10 06 03 D3 00 00", 0xAA, 6, 979, 0),
        ] {
            let octets = hex(text);
            let request = Request::parse(&octets).unwrap();
            let address = ParameterAddress { attribute: ParameterAddress::VALUE, elements, pnu, subindex };
            assert_eq!((request.reference, request.id, request.axis), (reference, RequestId::Read, 0));
            assert!(request.addresses().eq([address]) && request.values().next().is_none());
            let mut out = [0; 240];
            let len = emit_request((reference, RequestId::Read, 0), &[address], &[], &mut out).unwrap();
            assert_eq!(out[..len], octets);
        }
    }

    #[test]
    fn responses_to_read_are_those_of_real_devices() {
        let p979 = "01 01 00 01 07 05 80 00 00 02 00 00 20 00 00 00 00 07 00 00 00 00 00 00 10 00";
        let p979_29_bit = "AA 01 00 01 07 06 00 00 51 11 80 00 00 02 00 00 20 00 00 00 00 03 00 00 00 00 00 00 FF FF";
        for (text, format, expected) in [
            (p979, Format::Unsigned32, &[0x8000_0002, 8192, 7, 0, 4096][..]),
            (p979_29_bit, Format::Unsigned32, &[0x5111, 0x8000_0002, 8192, 3, 0, 0xFFFF]),
            ("01 01 00 01 06 05 01 2A 00 00 10 00 07 D7 11 09", Format::Unsigned16, &[0x12A, 0, 0x1000, 2007, 0x1109]),
            ("AA 01 00 01 06 01 00 37", Format::Unsigned16, &[55]),
        ] {
            let octets = hex(text);
            let response = Response::parse(&octets).unwrap();
            let values: Vec<_> = response.values().collect();
            assert_eq!((response.id, values.len(), values[0].format), (ResponseId::Read, 1, format));
            assert_eq!(values[0].count(), expected.len());
            let numbers: Vec<_> = (0..).map_while(|at| values[0].unsigned(at)).collect();
            assert_eq!(numbers, expected);
            let mut out = [0; 240];
            let head = (response.reference, response.id, response.axis);
            let len = emit_response(head, response.count, &values, &mut out).unwrap();
            assert_eq!(out[..len], octets);
        }
    }

    #[test]
    fn an_unknown_parameter_is_answered_with_an_error_number() {
        let octets = hex("01 81 00 01 44 01 00 00");
        let response = Response::parse(&octets).unwrap();
        let number = response.values().next().and_then(|values| values.error_number());
        assert_eq!((response.id, number), (ResponseId::ReadFailed, Some(0)));
        assert_eq!(number.and_then(ErrorNumber::from_code), Some(ErrorNumber::NoSuchParameter));
        let mut out = [0; 8];
        let refusal = ErrorNumber::NoSuchParameter.code().to_be_bytes();
        let head = (1, ResponseId::of(RequestId::Read, false), 0);
        assert_eq!(emit_response(head, 1, &[Values::error(&refusal)], &mut out), Some(8));
        assert_eq!(out[..], octets);
    }

    #[test]
    fn odd_values_are_padded_and_changes_carry_values() {
        let preset = ParameterAddress { attribute: ParameterAddress::VALUE, elements: 1, pnu: 65_000, subindex: 0 };
        let name = ParameterAddress { attribute: ParameterAddress::VALUE, elements: 3, pnu: 965, subindex: 0 };
        let values = [
            Values { format: Format::OctetString, data: &[1, 2, 3] },
            Values { format: Format::Integer32, data: &[0, 0, 0, 7] },
        ];
        let mut out = [0; 64];
        let len = emit_request((9, RequestId::Change, 0), &[name, preset], &values, &mut out).unwrap();
        assert_eq!(
            out[..len],
            hex("09 02 00 02 10 03 03 C5 00 00 10 01 FD E8 00 00 0A 03 01 02 03 00 04 01 00 00 00 07")
        );
        let request = Request::parse(&out[..len]).unwrap();
        assert!(request.addresses().eq([name, preset]) && request.values().eq(values));
        let changed = [9, 2, 0, 2];
        assert_eq!(Response::parse(&changed).map(|response| response.values().count()), Ok(0));
        assert_eq!(emit_response((9, ResponseId::Changed, 0), 2, &[], &mut out), Some(4));
    }

    #[test]
    fn errors_name_the_octet() {
        let error = |text: &str| Request::parse(&hex(text)).unwrap_err();
        assert_eq!(error("01 03 00 00"), ParameterError::new(2, ParameterRule::Identifier, 3u8));
        assert_eq!(error("01 01 00 01 10 05"), ParameterError::new(4, ParameterRule::Address, 1u8));
        assert_eq!(error("01 01 00 00 77"), ParameterError::new(5, ParameterRule::Trailing, 0x77u8));
        let error = |text: &str| Response::parse(&hex(text)).unwrap_err();
        assert_eq!(error("01 01 00 01 06 02 00 01"), ParameterError::new(6, ParameterRule::Value, 2u8));
        assert_eq!(error("01 01 00 01 99 00"), ParameterError::new(5, ParameterRule::Format, 0x99u8));
    }
}
