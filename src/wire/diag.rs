//! Diag: the data unit of `Slave_Diag`. EN 50170-2.

use super::header::Address;
use core::fmt;

/// Octet 4 while no master has parameterised the slave.
const NO_MASTER: u8 = 0xFF;
/// Octets of the longest data unit of `Slave_Diag` behind two service access points.
pub const MAX_DIAG: usize = 244;
/// Bits 7 and 6 of a block's first octet say which kind it is, bits 5..=0 are its length or a number.
const KIND: u8 = 0xC0;
const IDENTIFIER: u8 = 0x40;
const CHANNEL: u8 = 0x80;
const REVISION: u8 = 0xC0;
/// Octets of the longest block, its first one included.
const BLOCK_MAX: usize = 63;
/// Octets of a channel's block.
const CHANNEL_LEN: usize = 3;
/// Second octet of the device-related block that tells the status of DXB links. VPC3+ driver.
const LINK_STATUS: u8 = 0x83;

rules! {
    /// A diagnosis that cannot be read.
    pub struct DiagError, pub enum DiagRule {
        Length = "a diagnosis has at least 6 octets";
        Master = "the parameterising master is 0 to 126, or 255 for none";
        BlockLength = "a block's length counts its first octet and ends within the diagnosis";
    }
}

bits! {
    /// Octets 1..=3, `Station_Status_1` to `_3`; octet 1 is bits 23..=16. Some bits are set by the reading master, the
    /// slave sends them as 0.
    pub struct DiagStatus: u32 {
        /// Octet 1 bit 7, set by the master: the slave belongs to another master.
        master_lock MASTER_LOCK = 23, "Master_Lock";
        /// Octet 1 bit 6: the last `Set_Prm` was wrong.
        prm_fault PRM_FAULT = 22, "Prm_Fault";
        /// Octet 1 bit 5, set by the master: the answer made no sense.
        invalid_slave_response INVALID_SLAVE_RESPONSE = 21, "Invalid_Slave_Response";
        /// Octet 1 bit 4: the slave does not know the function asked for.
        not_supported NOT_SUPPORTED = 20, "Not_Supported";
        /// Octet 1 bit 3: extended blocks report something wrong.
        ext_diag EXT_DIAG = 19, "Ext_Diag";
        /// Octet 1 bit 2: the last `Chk_Cfg` was wrong.
        cfg_fault CFG_FAULT = 18, "Cfg_Fault";
        /// Octet 1 bit 1: no data exchange yet.
        station_not_ready STATION_NOT_READY = 17, "Station_Not_Ready";
        /// Octet 1 bit 0, set by the master: no answer.
        station_non_existent STATION_NON_EXISTENT = 16, "Station_Non_Existent";
        /// Octet 2 bit 7, set by the master: not in its parameter set.
        deactivated DEACTIVATED = 15, "Deactivated";
        /// Octet 2 bit 5.
        sync_mode SYNC_MODE = 13, "Sync_Mode";
        /// Octet 2 bit 4.
        freeze_mode FREEZE_MODE = 12, "Freeze_Mode";
        /// Octet 2 bit 3: the watchdog runs.
        wd_on WD_ON = 11, "WD_On";
        /// Octet 2 bit 2, always 1 from a slave. It has no name in the standard.
        by_slave BY_SLAVE = 10, "(always 1)";
        /// Octet 2 bit 1: the master goes on reading the diagnosis and exchanges no data.
        stat_diag STAT_DIAG = 9, "Stat_Diag";
        /// Octet 2 bit 0: the slave wants to be parameterised.
        prm_req PRM_REQ = 8, "Prm_Req";
        /// Octet 3 bit 7: more diagnosis than fits.
        ext_diag_overflow EXT_DIAG_OVERFLOW = 7, "Ext_Diag_Overflow";
    }
}

/// The data unit of `Slave_Diag`. Shown as the standard's names of the bits that are set.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Diagnosis<'a> {
    /// Octets 1..=3.
    pub status: DiagStatus,
    /// Octet 4, the master that parameterised the slave.
    pub master: Option<Address>,
    /// Octets 5..=6, `Ident_Number`.
    pub ident: u16,
    /// Octets from 7 on, extended blocks, read by [`Diagnosis::blocks`]; the encoders send none.
    pub extended: &'a [u8],
}

impl<'a> Diagnosis<'a> {
    /// Octets of the part that every slave sends.
    pub const LEN: usize = 6;

    /// Reads the data unit.
    ///
    /// # Errors
    /// Fewer than 6 octets, or a master that cannot be.
    pub fn parse(du: &'a [u8]) -> Result<Self, DiagError> {
        let &[octet_1, octet_2, octet_3, master, ident_high, ident_low, ref extended @ ..] = du else {
            return Err(DiagError::new(du.len(), DiagRule::Length, du.len() as u32));
        };
        let master = match Address::new(master) {
            Some(address) if !address.is_broadcast() => Some(address),
            None if master == NO_MASTER => None,
            _ => return Err(DiagError::new(4, DiagRule::Master, master)),
        };
        Ok(Self {
            status: DiagStatus(u32::from_be_bytes([0, octet_1, octet_2, octet_3])),
            master,
            ident: u16::from_be_bytes([ident_high, ident_low]),
            extended,
        })
    }
    /// The extended blocks in their order. Ends after the first error.
    pub const fn blocks(&self) -> Blocks<'a> {
        Blocks { octet: Self::LEN + 1, rest: self.extended }
    }
    /// Octets 1..=6, without extended blocks.
    pub fn emit(&self) -> [u8; Diagnosis::LEN] {
        let [_, octet_1, octet_2, octet_3] = self.status.0.to_be_bytes();
        let [ident_high, ident_low] = self.ident.to_be_bytes();
        let master = self.master.map_or(NO_MASTER, Address::get);
        [octet_1, octet_2, octet_3, master, ident_high, ident_low]
    }
}
impl fmt::Display for Diagnosis<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The bit that is always 1 tells nobody anything.
        fmt::Display::fmt(&self.status.with(DiagStatus::BY_SLAVE, false), f)
    }
}

/// Where in a module something is wrong: a channel's block.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Channel {
    /// Number of the module, octet 1 bits 5..=0.
    pub module: u8,
    /// Octet 2: bits 7 and 6 are 01 for an input, 10 for an output, 11 for both, bits 5..=0 the channel's number.
    pub channel: u8,
    /// Octet 3: bits 7..=5 are the channel's type, bits 4..=0 the error.
    pub error: u8,
}

/// One extended block.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum DiagBlock<'a> {
    /// 00: the device's own; with DP-V1 the first octet says what it is.
    Device(&'a [u8]),
    /// 01: bit i of octet n is set where module 8 n + i has a diagnosis.
    Identifier(&'a [u8]),
    /// 10: a channel of a module.
    Channel(Channel),
    /// 11: revision of the diagnosis, 0..=63.
    Revision(u8),
}
impl<'a> DiagBlock<'a> {
    /// Slot, specifier and (publisher, status) pairs, where this tells the status of DXB links.
    pub const fn link_status(&self) -> Option<(u8, u8, &'a [[u8; 2]])> {
        match *self {
            Self::Device(&[LINK_STATUS, slot, specifier, ref pairs @ ..]) => {
                let (pairs, rest) = pairs.as_chunks();
                if rest.is_empty() { Some((slot, specifier, pairs)) } else { None }
            }
            _ => None,
        }
    }
}

/// Iterator over the extended blocks of a [`Diagnosis`].
#[derive(Clone, Debug)]
pub struct Blocks<'a> {
    octet: usize,
    rest: &'a [u8],
}
impl<'a> Iterator for Blocks<'a> {
    type Item = Result<DiagBlock<'a>, DiagError>;

    fn next(&mut self) -> Option<Self::Item> {
        let head = *self.rest.first()?;
        let length = match head & KIND {
            CHANNEL => CHANNEL_LEN,
            REVISION => 1,
            _ => usize::from(head & !KIND),
        };
        let octet = self.octet;
        let (Some([_, data @ ..]), Some(rest)) = (self.rest.get(..length), self.rest.get(length..)) else {
            self.rest = &[];
            return Some(Err(DiagError::new(octet, DiagRule::BlockLength, head)));
        };
        self.rest = rest;
        self.octet += length;
        Some(Ok(match (head & KIND, data) {
            (CHANNEL, &[channel, error]) => DiagBlock::Channel(Channel { module: head & !KIND, channel, error }),
            (REVISION, _) => DiagBlock::Revision(head & !KIND),
            (IDENTIFIER, _) => DiagBlock::Identifier(data),
            _ => DiagBlock::Device(data),
        }))
    }
}

/// What a device adds to its slave's diagnosis: extended blocks and the bits `Ext_Diag` and `Stat_Diag`. A block that
/// does not fit into `Max_Diag_Data_Len` is left out and sets `Ext_Diag_Overflow`.
#[derive(Clone, Debug)]
pub struct DiagBuffer {
    octets: [u8; MAX_DIAG - Diagnosis::LEN],
    len: usize,
    room: usize,
    status: DiagStatus,
}

impl DiagBuffer {
    /// An empty buffer of a device whose diagnosis has up to `max_len` octets (GSD `Max_Diag_Data_Len`, 6..=244).
    pub fn new(max_len: u8) -> Self {
        let room = usize::from(max_len).clamp(Diagnosis::LEN, MAX_DIAG) - Diagnosis::LEN;
        Self { octets: [0; MAX_DIAG - Diagnosis::LEN], len: 0, room, status: DiagStatus::default() }
    }
    /// The blocks as they are sent from octet 7 on.
    pub fn octets(&self) -> &[u8] {
        &self.octets[..self.len]
    }
    /// `Ext_Diag`, `Stat_Diag` and `Ext_Diag_Overflow`.
    pub const fn status(&self) -> DiagStatus {
        self.status
    }
    /// `Ext_Diag`: the blocks report something wrong, and not a mere status.
    pub fn set_ext_diag(&mut self) {
        self.status = self.status | DiagStatus::EXT_DIAG;
    }
    /// `Stat_Diag`: the device has no valid data, its master shall go on reading the diagnosis.
    pub fn set_stat_diag(&mut self) {
        self.status = self.status | DiagStatus::STAT_DIAG;
    }
    /// Adds a block, its first octet 00 and the length; false if it does not fit.
    pub fn device(&mut self, data: &[u8]) -> bool {
        self.counted(0, data)
    }
    /// Adds a block, its first octet 01 and the length; false if it does not fit.
    pub fn identifier(&mut self, modules: &[u8]) -> bool {
        self.counted(IDENTIFIER, modules)
    }
    /// Adds a channel's block; false if it does not fit.
    pub fn channel(&mut self, channel: Channel) -> bool {
        self.put(&[CHANNEL | channel.module & !KIND, channel.channel, channel.error])
    }
    /// Adds the block that tells the status of DXB links, pairs of a publisher and its status; false if it does not
    /// fit (29 pairs do into the longest block).
    pub fn link_status(&mut self, slot: u8, specifier: u8, links: impl IntoIterator<Item = (Address, u8)>) -> bool {
        let mut block = [0; BLOCK_MAX - 1];
        let mut writer = super::Writer::new(&mut block);
        let mut fits = writer.put(&[LINK_STATUS, slot, specifier]).is_some();
        for (publisher, status) in links {
            fits &= writer.put(&[publisher.get(), status]).is_some();
        }
        let len = writer.len;
        if fits { self.device(&block[..len]) } else { self.overflow() }
    }
    fn counted(&mut self, kind: u8, data: &[u8]) -> bool {
        if data.len() >= BLOCK_MAX {
            return self.overflow();
        }
        let mut block = [0; BLOCK_MAX];
        block[0] = kind | (data.len() + 1) as u8;
        block[1..=data.len()].copy_from_slice(data);
        self.put(&block[..=data.len()])
    }
    fn put(&mut self, block: &[u8]) -> bool {
        let end = self.len + block.len();
        if end > self.room {
            return self.overflow();
        }
        self.octets[self.len..end].copy_from_slice(block);
        self.len = end;
        true
    }
    fn overflow(&mut self) -> bool {
        self.status = self.status | DiagStatus::EXT_DIAG_OVERFLOW;
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;
    use alloc::vec::Vec;

    #[test]
    fn blocks_are_read_as_they_were_written() {
        let [six, nine] = [6, 9].map(|number| Address::new(number).unwrap());
        let channel = Channel { module: 1, channel: 0x42, error: 0xA6 };
        let mut buffer = DiagBuffer::new(244);
        buffer.set_ext_diag();
        assert!(buffer.device(&[0x81, 0x00, 0x00]) && buffer.identifier(&[0x02]) && buffer.channel(channel));
        assert!(buffer.link_status(0, 0, [(six, 0x80), (nine, 0x00)]));
        let octets =
            [0x04, 0x81, 0x00, 0x00, 0x42, 0x02, 0x81, 0x42, 0xA6, 0x08, 0x83, 0x00, 0x00, 0x06, 0x80, 0x09, 0x00];
        assert_eq!((buffer.octets(), buffer.status()), (&octets[..], DiagStatus::EXT_DIAG));
        let diagnosis = Diagnosis { status: buffer.status(), master: None, ident: 0, extended: buffer.octets() };
        let blocks: Vec<_> = diagnosis.blocks().map(Result::unwrap).collect();
        let links = DiagBlock::Device(&octets[10..]);
        let expected =
            [DiagBlock::Device(&octets[1..4]), DiagBlock::Identifier(&[2]), DiagBlock::Channel(channel), links];
        assert_eq!(blocks, expected);
        assert_eq!(links.link_status(), Some((0, 0, &[[6, 0x80], [9, 0]][..])));
        assert_eq!(expected[0].link_status(), None);
    }

    #[test]
    fn what_does_not_fit_is_left_out_and_said() {
        let six = Address::new(6).unwrap();
        for (max_len, longest) in [(0, None), (6, None), (7, Some(0)), (10, Some(3)), (244, Some(62))] {
            for len in 0..=63usize {
                let mut buffer = DiagBuffer::new(max_len);
                let fits = longest.is_some_and(|longest| len <= longest);
                assert_eq!(buffer.device(&[0; 63][..len]), fits, "{len} octets in a diagnosis of {max_len}");
                assert_eq!(buffer.status().ext_diag_overflow(), !fits);
                assert_eq!(buffer.octets().len(), if fits { len + 1 } else { 0 });
            }
        }
        for (links, fits) in [(29, true), (30, false)] {
            let mut buffer = DiagBuffer::new(244);
            assert_eq!(buffer.link_status(0, 0, (0..links).map(|_| (six, 0))), fits);
            assert_eq!(
                (buffer.octets().len(), buffer.status().ext_diag_overflow()),
                (if fits { 62 } else { 0 }, !fits)
            );
        }
    }

    #[test]
    fn a_block_that_ends_elsewhere_is_an_error_and_the_last_one() {
        for extended in [&[0x00][..], &[0x40], &[0x03, 0x81], &[0x81, 0x42], &[0x3F], &[0xC1, 0x05, 0x00]] {
            let diagnosis = Diagnosis { status: DiagStatus::default(), master: None, ident: 0, extended };
            let blocks: Vec<_> = diagnosis.blocks().collect();
            let (last, before) = blocks.split_last().unwrap();
            assert!(before.iter().all(Result::is_ok), "{extended:02X?}");
            assert_eq!(last.unwrap_err().rule, DiagRule::BlockLength, "{extended:02X?}");
            assert_eq!(last.unwrap_err().octet, 7 + before.len(), "{extended:02X?}");
        }
    }

    #[test]
    fn the_diagnoses_of_a_real_start_up_read_by_name() {
        for (octets, master, text) in [
            ([0x02, 0x05, 0x00, 0xFF, 0x80, 0xE0], None, "Station_Not_Ready, Prm_Req"),
            ([0x00, 0x0E, 0x00, 0x01, 0x80, 0xE0], Address::new(1), "WD_On, Stat_Diag"),
            ([0x00, 0x0C, 0x00, 0x01, 0x80, 0xE0], Address::new(1), "WD_On"),
            ([0x42, 0x05, 0x00, 0xFF, 0x80, 0xF9], None, "Prm_Fault, Station_Not_Ready, Prm_Req"),
            ([0x00, 0x04, 0x00, 0x02, 0x80, 0xF9], Address::new(2), "none"),
        ] {
            let diagnosis = Diagnosis::parse(&octets).unwrap();
            assert_eq!((diagnosis.master, diagnosis.to_string().as_str()), (master, text));
            assert_eq!(diagnosis.emit(), octets);
        }
    }

    #[test]
    fn extended_blocks_are_kept_and_strange_masters_refused() {
        let octets = [0x08, 0x0C, 0x80, 0x02, 0x80, 0xF9, 0x03, 0x81, 0x07];
        assert_eq!(Diagnosis::parse(&octets).unwrap().extended, [0x03, 0x81, 0x07]);
        assert_eq!(Diagnosis::parse(&octets[..5]), Err(DiagError::new(5, DiagRule::Length, 5u8)));
        for master in [127, 128, 254] {
            let octets = [0, 4, 0, master, 0, 0];
            assert_eq!(Diagnosis::parse(&octets), Err(DiagError::new(4, DiagRule::Master, master)));
        }
    }
}
