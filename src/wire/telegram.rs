//! Telegram: the frames SD1, SD2, SD3, SD4 and SC, read with every check of a receiver and written into a [`Frame`].

use super::header::{Address, FrameControl, Header, Sap};
use core::fmt;
use core::ops::Range;

/// Octets of the longest frame: SD2 with LE = 249. EN 50170-2.
pub const MAX_FRAME: usize = 255;
/// Octets of the longest data unit, without service access points.
pub const MAX_DU: usize = LE_MAX - FIXED;

const SD1: u8 = 0x10;
const SD2: u8 = 0x68;
const SD3: u8 = 0xA2;
const SD4: u8 = 0xDC;
const SC: u8 = 0xE5;
const ED: u8 = 0x16;
/// Bit 7 of an address octet: an extension octet follows FC.
const EXTENDED: u8 = 0x80;
/// Bits 7 and 6 of an extension octet: a further extension, a segment. DP uses neither.
const NO_SAP: u8 = 0xC0;
/// DA, SA and FC, which LE counts.
const FIXED: usize = 3;
const LE_MIN: usize = 4;
const LE_MAX: usize = 249;
/// Octets before DA and after the data unit of an SD2 frame.
const SD2_HEAD: usize = 4;
const TAIL: usize = 2;
const SD1_LEN: usize = 1 + FIXED + TAIL;
const SD3_DATA: usize = 8;
const SD3_LEN: usize = SD1_LEN + SD3_DATA;
const SD4_LEN: usize = 3;
/// As long as nearly every telegram of a cycle: so many octets are written faster than counted.
const SHORT: usize = 32;

/// One telegram of the line, every field valid. EN 50170-2.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Telegram<'a> {
    /// SC: acknowledgement without data.
    ShortAck,
    /// SD4: the right to send goes from `sa` to `da`. Protected by the parity of its characters alone.
    Token {
        /// The master that gets the token, 0..=126.
        da: Address,
        /// The master that had it, 0..=126.
        sa: Address,
    },
    /// SD1, SD2 or SD3.
    Data {
        /// Everything before the data unit.
        header: Header,
        /// The data unit, at most 246 octets.
        du: &'a [u8],
    },
}

impl<'a> Telegram<'a> {
    /// Reads one whole frame.
    ///
    /// # Errors
    /// The first check that fails, in this order: start, length, repeats of length and start, end, sum, addresses, FC,
    /// service access points. A receiver stays silent in each case.
    pub fn parse(octets: &'a [u8]) -> Result<Self, TelegramError> {
        let (head, expected) = match octets.first() {
            None => return Err(TelegramError::Empty),
            Some(&SD2) => (SD2_HEAD, Self::sd2_len(octets)?),
            Some(&SD4) => return Self::parse_token(octets),
            Some(&SC) => {
                return match octets.len() {
                    1 => Ok(Self::ShortAck),
                    found => Err(TelegramError::Length { expected: 1, found }),
                };
            }
            Some(&SD1) => (1, SD1_LEN),
            Some(&SD3) => (1, SD3_LEN),
            Some(&found) => return Err(TelegramError::Start { offset: 0, found }),
        };
        let covered = check_tail(octets, head, expected)?;
        Self::parse_covered(octets, head, covered)
    }

    /// Writes this telegram, SD3 as SD2.
    ///
    /// # Errors
    /// As [`Frame::set_data`], and [`TelegramError::Address`] for a token with address 127. What [`Telegram::parse`]
    /// returned is always written.
    pub fn emit(&self, frame: &mut Frame) -> Result<(), TelegramError> {
        match self {
            Self::ShortAck => frame.set_short_ack(),
            Self::Token { da, sa } => {
                for (offset, address) in [(1, da), (2, sa)] {
                    if address.is_broadcast() {
                        return Err(TelegramError::Address { offset, found: address.get() });
                    }
                }
                frame.set_token(*da, *sa);
            }
            Self::Data { header, du } => frame.set_data(header, du)?,
        }
        Ok(())
    }

    fn parse_token(octets: &[u8]) -> Result<Self, TelegramError> {
        let &[_, da, sa] = octets else {
            return Err(TelegramError::Length { expected: SD4_LEN, found: octets.len() });
        };
        Ok(Self::Token { da: station(da, 1)?, sa: station(sa, 2)? })
    }

    /// Length of the frame that LE announces.
    fn sd2_len(octets: &[u8]) -> Result<usize, TelegramError> {
        let &[_, le, ler, start, ..] = octets else {
            return Err(TelegramError::Length { expected: SD2_HEAD + LE_MIN + TAIL, found: octets.len() });
        };
        let covered = usize::from(le);
        if !(LE_MIN..=LE_MAX).contains(&covered) {
            return Err(TelegramError::LengthField { offset: 1, found: le });
        }
        if ler != le {
            return Err(TelegramError::LengthRepeat { offset: 2, expected: le, found: ler });
        }
        if start != SD2 {
            return Err(TelegramError::Start { offset: 3, found: start });
        }
        Ok(SD2_HEAD + covered + TAIL)
    }

    /// Reads DA, SA, FC, service access points and data unit; `head` is the offset of DA.
    fn parse_covered(octets: &'a [u8], head: usize, covered: &'a [u8]) -> Result<Self, TelegramError> {
        let &[da, sa, fc, ref rest @ ..] = covered else {
            return Err(TelegramError::Length { expected: head + FIXED + TAIL, found: octets.len() });
        };
        let source = station(sa & !EXTENDED, head + 1)?;
        let fc = FrameControl::from_octet(fc)
            .map_err(|error| TelegramError::FrameControl { offset: head + 2, found: error.0 })?;
        let (dsap, rest) = if da & EXTENDED == 0 { (None, rest) } else { sap(rest, head + FIXED)? };
        let offset = head + FIXED + usize::from(dsap.is_some());
        let (ssap, du) = if sa & EXTENDED == 0 { (None, rest) } else { sap(rest, offset)? };
        Ok(Self::Data { header: Header { da: Address::of_low_bits(da), sa: source, dsap, ssap, fc }, du })
    }
}

/// A station's address without an extension: 0..=126.
fn station(octet: u8, offset: usize) -> Result<Address, TelegramError> {
    match Address::new(octet) {
        Some(address) if !address.is_broadcast() => Ok(address),
        _ => Err(TelegramError::Address { offset, found: octet }),
    }
}

/// One extension octet off the front of `rest`.
fn sap(rest: &[u8], offset: usize) -> Result<(Option<Sap>, &[u8]), TelegramError> {
    match rest {
        [] => Err(TelegramError::ExtensionMissing { offset }),
        &[found, ..] if found & NO_SAP != 0 => Err(TelegramError::Extension { offset, found }),
        [number, rest @ ..] => Ok((Some(Sap(*number)), rest)),
    }
}

/// Checks length, ED and FCS; the octets that FCS covers, from `head` on.
fn check_tail(octets: &[u8], head: usize, expected: usize) -> Result<&[u8], TelegramError> {
    let found = octets.len();
    if found != expected {
        return Err(TelegramError::Length { expected, found });
    }
    match octets.get(head..) {
        Some([covered @ .., found_sum, ED]) => match sum(covered) {
            computed if computed == *found_sum => Ok(covered),
            computed => Err(TelegramError::FrameCheck { offset: found - TAIL, expected: computed, found: *found_sum }),
        },
        Some([.., end]) => Err(TelegramError::End { offset: found - 1, found: *end }),
        _ => Err(TelegramError::Length { expected, found }),
    }
}

/// FCS: the sum modulo 256 of DA up to the last octet of the data unit. EN 50170-2.
fn sum(covered: &[u8]) -> u8 {
    covered.iter().fold(0, |sum, &octet| sum.wrapping_add(octet))
}

/// Why octets are no telegram, or a telegram cannot be written. Offsets count octets of the frame from 0.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum TelegramError {
    /// No octets at all.
    Empty,
    /// A start delimiter (offset 0) or its repetition in SD2 (offset 3) is none.
    Start {
        /// 0 or 3.
        offset: usize,
        /// The octet in its place.
        found: u8,
    },
    /// The frame is longer or shorter than its start and its LE say (octets).
    Length {
        /// The right length; for an SD2 cut off before its second start delimiter, the least.
        expected: usize,
        /// The actual length.
        found: usize,
    },
    /// LE is not in 4..=249.
    LengthField {
        /// 1.
        offset: usize,
        /// LE.
        found: u8,
    },
    /// `LEr` differs from LE.
    LengthRepeat {
        /// 2.
        offset: usize,
        /// LE.
        expected: u8,
        /// `LEr`.
        found: u8,
    },
    /// ED is not 16.
    End {
        /// The last octet.
        offset: usize,
        /// The octet in its place.
        found: u8,
    },
    /// FCS is not the sum of the covered octets.
    FrameCheck {
        /// The last octet but one.
        offset: usize,
        /// The sum.
        expected: u8,
        /// FCS.
        found: u8,
    },
    /// A source of 127, or an address of a token above 126.
    Address {
        /// Where.
        offset: usize,
        /// The address octet.
        found: u8,
    },
    /// FC is not assigned.
    FrameControl {
        /// Where.
        offset: usize,
        /// FC.
        found: u8,
    },
    /// An address announces a service access point but the telegram ends before it.
    ExtensionMissing {
        /// Where it should be.
        offset: usize,
    },
    /// An extension octet names a segment or a further extension, or a [`Sap`] to write is above 63.
    Extension {
        /// Where.
        offset: usize,
        /// The extension octet.
        found: u8,
    },
    /// The data unit to write does not fit (octets).
    DataUnit {
        /// The longest that fits behind these service access points.
        most: usize,
        /// Its length.
        found: usize,
    },
}

impl TelegramError {
    /// Offset of the offending octet; `None` if no single octet offends.
    pub const fn offset(&self) -> Option<usize> {
        match *self {
            Self::Empty | Self::Length { .. } | Self::DataUnit { .. } => None,
            Self::Start { offset, .. }
            | Self::LengthField { offset, .. }
            | Self::LengthRepeat { offset, .. }
            | Self::End { offset, .. }
            | Self::FrameCheck { offset, .. }
            | Self::Address { offset, .. }
            | Self::FrameControl { offset, .. }
            | Self::ExtensionMissing { offset }
            | Self::Extension { offset, .. } => Some(offset),
        }
    }
}
impl fmt::Display for TelegramError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Empty => write!(f, "there are no octets"),
            Self::Start { offset, found } => write!(f, "octet {offset} is {found:02X}, which starts no frame"),
            Self::Length { expected, found } => write!(f, "the frame has {found} octets instead of {expected}"),
            Self::LengthField { offset, found } => {
                write!(f, "octet {offset} is LE {found}, which is not in {LE_MIN}..={LE_MAX}")
            }
            Self::LengthRepeat { offset, expected, found } => {
                write!(f, "octet {offset} repeats LE {expected} as {found}")
            }
            Self::End { offset, found } => write!(f, "octet {offset} is {found:02X} instead of the end {ED:02X}"),
            Self::FrameCheck { offset, expected, found } => {
                write!(f, "octet {offset} is FCS {found:02X}, but the octets sum up to {expected:02X}")
            }
            Self::Address { offset, found } => write!(f, "octet {offset} is {found}, which is no station's address"),
            Self::FrameControl { offset, found } => {
                write!(f, "octet {offset} is FC {found:02X}, which is not assigned")
            }
            Self::ExtensionMissing { offset } => write!(f, "octet {offset} should be a service access point"),
            Self::Extension { offset, found } => {
                write!(f, "octet {offset} is {found:02X}, which is no service access point")
            }
            Self::DataUnit { most, found } => write!(f, "a data unit of {found} octets exceeds {most}"),
        }
    }
}
impl core::error::Error for TelegramError {}

/// The octets of one frame, or of what disturbances made of one. Lives on the stack or in a slab; never allocates.
#[derive(Clone)]
pub struct Frame {
    len: u8,
    octets: [u8; MAX_FRAME],
}

impl Frame {
    /// A frame of no octets.
    pub const fn new() -> Self {
        Self { len: 0, octets: [0; MAX_FRAME] }
    }
    /// A copy of any octets, valid or not; `None` above 255.
    pub fn from_octets(octets: &[u8]) -> Option<Self> {
        let mut frame = Self::new();
        frame.octets.get_mut(..octets.len())?.copy_from_slice(octets);
        frame.len = octets.len() as u8;
        Some(frame)
    }
    /// Becomes a copy of any octets, valid or not; nothing of them above 255.
    pub fn set(&mut self, octets: &[u8]) {
        self.len = 0;
        if let Some(place) = self.octets.get_mut(..octets.len()) {
            place.copy_from_slice(octets);
            self.len = octets.len() as u8;
        }
    }
    /// Becomes so many octets of zero, 255 at most.
    pub fn set_len(&mut self, len: usize) {
        self.len = len.min(MAX_FRAME) as u8;
        self.octets_mut().fill(0);
    }
    /// The octets.
    pub fn octets(&self) -> &[u8] {
        &self.octets[..self.len()]
    }
    /// The octets, for disturbing them.
    pub fn octets_mut(&mut self) -> &mut [u8] {
        &mut self.octets[..usize::from(self.len)]
    }
    /// Length (octets).
    pub const fn len(&self) -> usize {
        self.len as usize
    }
    /// Whether there are no octets.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }
    /// Removes all octets.
    pub const fn clear(&mut self) {
        self.len = 0;
    }
    /// Cuts the frame off after `len` octets, if it is longer.
    pub fn truncate(&mut self, len: usize) {
        self.len = self.len().min(len) as u8;
    }
    /// Becomes a copy of `other`.
    pub fn copy_from(&mut self, other: &Self) {
        self.len = other.len;
        self.octets[..SHORT].copy_from_slice(&other.octets[..SHORT]);
        if let Some(rest) = other.octets().get(SHORT..) {
            self.octets_mut()[SHORT..].copy_from_slice(rest);
        }
    }
    /// Reads the octets.
    ///
    /// # Errors
    /// As [`Telegram::parse`].
    pub fn telegram(&self) -> Result<Telegram<'_>, TelegramError> {
        Telegram::parse(self.octets())
    }

    /// Becomes the token SD4. Both are stations' addresses; a token with 127 is refused by every receiver.
    pub fn set_token(&mut self, da: Address, sa: Address) {
        self.set_head([SD4, da.get(), sa.get()]);
    }
    /// Becomes the short acknowledgement SC.
    pub fn set_short_ack(&mut self) {
        self.set_head([SC]);
    }
    /// Becomes a data telegram: SD1 without service access points and data, else SD2. Never SD3, which every receiver
    /// accepts but not every station sends.
    ///
    /// # Errors
    /// A source of 127, a service access point above 63, or a data unit that does not fit. The frame is then unchanged.
    #[inline]
    pub fn set_data(&mut self, header: &Header, du: &[u8]) -> Result<(), TelegramError> {
        let (head, place) = self.start_data(header, du.len())?;
        self.octets[place].copy_from_slice(du);
        self.finish_data(head.wrapping_add(sum(du)));
        Ok(())
    }
    /// As [`Frame::set_data`], with `write` filling the `len` octets of the data unit in place. They start as zero.
    ///
    /// # Errors
    /// As [`Frame::set_data`]; `write` is then not called.
    #[inline]
    pub fn set_data_with(
        &mut self,
        header: &Header,
        len: usize,
        write: impl FnOnce(&mut [u8]),
    ) -> Result<(), TelegramError> {
        let (head, du) = self.start_data(header, len)?;
        self.octets[du.start..du.start + SHORT].fill(0);
        if len > SHORT {
            self.octets[du.start + SHORT..du.end].fill(0);
        }
        let du = &mut self.octets[du];
        write(du);
        let fcs = head.wrapping_add(sum(du));
        self.finish_data(fcs);
        Ok(())
    }
    /// Becomes an SD3, for tests of receivers: stations here answer with SD2.
    ///
    /// # Errors
    /// As [`Frame::set_data`], and [`TelegramError::Length`] unless service access points and data unit are 8 octets.
    pub fn set_sd3(&mut self, header: &Header, du: &[u8]) -> Result<(), TelegramError> {
        let found = header.sap_octets() + du.len();
        if found != SD3_DATA {
            return Err(TelegramError::Length { expected: SD3_LEN, found: SD1_LEN + found });
        }
        self.set_data(header, du)?;
        self.octets.copy_within(SD2_HEAD..SD2_HEAD + SD3_LEN - 1, 1);
        self.octets[0] = SD3;
        self.len = SD3_LEN as u8;
        Ok(())
    }

    fn set_head<const N: usize>(&mut self, head: [u8; N]) {
        self.octets[..N].copy_from_slice(&head);
        self.len = N as u8;
    }
    /// Writes everything before the data unit; its share of FCS, and the data unit's place. FCS is not summed up from
    /// the frame: reading octets just written one by one is the slowest thing one can do here.
    fn start_data(&mut self, header: &Header, len: usize) -> Result<(u8, Range<usize>), TelegramError> {
        const DU: usize = SD2_HEAD + FIXED;
        // Data_Exchange: nearly all that is written in a cycle.
        if (header.dsap, header.ssap) == (None, None) && (1..=MAX_DU).contains(&len) && !header.sa.is_broadcast() {
            let (da, sa, fc) = (header.da.get(), header.sa.get(), header.fc.octet());
            let le = (FIXED + len) as u8;
            self.octets[..DU].copy_from_slice(&[SD2, le, le, SD2, da, sa, fc]);
            self.len = (DU + len + TAIL) as u8;
            return Ok((da.wrapping_add(sa).wrapping_add(fc), DU..DU + len));
        }
        self.start_any_data(header, len)
    }
    /// The same, whatever the header says.
    #[cold]
    fn start_any_data(&mut self, header: &Header, len: usize) -> Result<(u8, Range<usize>), TelegramError> {
        let saps = header.sap_octets();
        let most = MAX_DU - saps;
        if len > most {
            return Err(TelegramError::DataUnit { most, found: len });
        }
        let head = if saps + len == 0 { 1 } else { SD2_HEAD };
        station(header.sa.get(), head + 1)?;
        let extension = |sap: Option<Sap>, offset| match sap {
            None => Ok(0),
            Some(sap) if sap <= Sap::MAX => Ok(EXTENDED),
            Some(sap) => Err(TelegramError::Extension { offset, found: sap.0 }),
        };
        let da = header.da.get() | extension(header.dsap, head + FIXED)?;
        let sa = header.sa.get() | extension(header.ssap, head + FIXED + usize::from(header.dsap.is_some()))?;
        let fc = header.fc.octet();
        if head == 1 {
            self.octets[..head + FIXED].copy_from_slice(&[SD1, da, sa, fc]);
        } else {
            let le = (FIXED + saps + len) as u8;
            self.octets[..head + FIXED].copy_from_slice(&[SD2, le, le, SD2, da, sa, fc]);
        }
        let mut at = head + FIXED;
        let mut fcs = da.wrapping_add(sa).wrapping_add(fc);
        for sap in [header.dsap, header.ssap].into_iter().flatten() {
            self.octets[at] = sap.0;
            fcs = fcs.wrapping_add(sap.0);
            at += 1;
        }
        self.len = (at + len + TAIL) as u8;
        Ok((fcs, at..at + len))
    }
    /// Writes FCS and ED behind the data unit.
    fn finish_data(&mut self, fcs: u8) {
        let end = self.len() - TAIL;
        self.octets[end..end + TAIL].copy_from_slice(&[fcs, ED]);
    }
}
impl Default for Frame {
    fn default() -> Self {
        Self::new()
    }
}
impl PartialEq for Frame {
    fn eq(&self, other: &Self) -> bool {
        self.octets() == other.octets()
    }
}
impl Eq for Frame {}

/// The octets as hexadecimal numbers: `DC 02 02`.
impl fmt::Display for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (position, octet) in self.octets().iter().enumerate() {
            let gap = if position == 0 { "" } else { " " };
            write!(f, "{gap}{octet:02X}")?;
        }
        Ok(())
    }
}
impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{self}]")
    }
}
