//! Prm: the data unit of `Set_Prm`, its structured blocks and their fields.
//!
//! Octets are numbered from 1, so that octet 32 here is octet 32 in the encoder manuals. Reading checks the layout alone;
//! the `check` functions compare values with what any slave may be sent; what one device can do, the device knows.

use super::Writer;
use core::fmt;

/// Octets of the longest data unit of `Set_Prm` behind two service access points.
pub const MAX_PRM: usize = 244;
/// Octets of the fixed part, `DPV1_Status` included.
const FIXED: usize = 10;
/// Octets of a block's header: length, type, slot, specifier.
const BLOCK_HEAD: usize = 4;
/// The highest address a publisher may have. VPC3+ driver.
const PUBLISHER_MAX: u8 = 125;
/// Octets of the longest data unit that a publisher sends. VPC3+ driver.
const PUBLISHER_LENGTH_MAX: u8 = 244;

rules! {
    /// A data unit of `Set_Prm` that no slave accepts.
    pub struct PrmError, pub enum PrmRule {
        Length = "a Set_Prm has 7 octets or at least 10";
        StatusReserved = "bits 2 to 0 of Station_Status are 0";
        Watchdog = "a watchdog factor is 1 to 255 while WD_On is set";
        DpV1Reserved = "a reserved bit of DPV1_Status is 0";
        BlockLength = "a block's length counts its header of 4 octets and ends within the telegram";
        BlockType = "another block type belongs here";
        IsoLength = "the isochronous block has 28 octets";
        UserLength = "the user block of telegram 81 has 21 octets";
        Slot = "the slot of this block is 0";
        Specifier = "the specifier of this block is 0";
        Version = "the version is 1";
        TimeBase = "a time base is 375, 750, 1500, 3000, 6000 or 12000 (1/12 us)";
        TDp = "T_DP is 1 to 65535 in T_BASE_DP and 500 us to 32 ms overall";
        TMapc = "T_MAPC is 1 to 14 in T_DP";
        TPllW = "T_PLL_W is 1 to 65535 (1/12 us)";
        DxbLength = "a DXB table has a version and whole entries";
        DxbPublisher = "the publisher's address is 0 to 125";
        DxbPublisherLength = "the publisher's data length is 1 to 244 octets";
        DxbOffset = "the sample begins within the publisher's data";
        DxbSample = "the sample ends within the publisher's data and fits the subscriber's buffer";
    }
}

bits! {
    /// Octet 1, `Station_Status`. EN 50170-2.
    pub struct StationStatus: u8 {
        /// The slave belongs to this master from now on.
        lock LOCK = 7, "Lock_Req";
        /// The slave is free for other masters. Wins over `lock`.
        unlock UNLOCK = 6, "Unlock_Req";
        /// The master will use Sync.
        sync SYNC = 5, "Sync_Req";
        /// The master will use Freeze.
        freeze FREEZE = 4, "Freeze_Req";
        /// The watchdog runs.
        wd_on WD_ON = 3, "WD_On";
    }
}

bits! {
    /// Octets 8..=10, `DPV1_Status_1` to `_3`; octet 8 is bits 23..=16. VPC3+ driver.
    pub struct DpV1Status: u32 {
        /// Octet 8 bit 7: the slave works as a DP-V1 slave.
        dpv1_enable DPV1_ENABLE = 23, "DPV1_Enable";
        /// Octet 8 bit 6: Clear arrives as an empty `Data_Exchange`.
        fail_safe FAIL_SAFE = 22, "Fail_Safe";
        /// Octet 8 bit 5: the slave answers MSRD to all stations (DXB).
        publisher_enable PUBLISHER_ENABLE = 21, "Publisher_Enable";
        /// Octet 8 bit 2: the watchdog's step is 1 ms instead of 10 ms.
        wd_base_1ms WD_BASE_1MS = 18, "WD_Base_1ms";
        /// Octet 8 bit 1: an ASIC's own affair, 0 on the bus.
        dis_stop_control DIS_STOP_CONTROL = 17, "Dis_Stop_Control";
        /// Octet 8 bit 0: an ASIC's own affair, 0 on the bus.
        dis_start_control DIS_START_CONTROL = 16, "Dis_Start_Control";
        /// Octet 9 bit 7.
        pull_plug_alarm PULL_PLUG_ALARM = 15, "Enable_Pull_Plug_Alarm";
        /// Octet 9 bit 6.
        process_alarm PROCESS_ALARM = 14, "Enable_Process_Alarm";
        /// Octet 9 bit 5.
        diagnostic_alarm DIAGNOSTIC_ALARM = 13, "Enable_Diagnostic_Alarm";
        /// Octet 9 bit 4.
        manufacturer_alarm MANUFACTURER_ALARM = 12, "Enable_Manufacturer_Alarm";
        /// Octet 9 bit 3.
        status_alarm STATUS_ALARM = 11, "Enable_Status_Alarm";
        /// Octet 9 bit 2.
        update_alarm UPDATE_ALARM = 10, "Enable_Update_Alarm";
        /// Octet 9 bit 0: reduced check of the configuration.
        check_cfg_mode CHECK_CFG_MODE = 8, "Chk_Cfg_Mode";
        /// Octet 10 bit 7: a block of type 2 follows (redundancy).
        prm_cmd PRM_CMD = 7, "PrmCmd";
        /// Octet 10 bit 4: the slave shall run isochronously.
        isom_req ISOM_REQ = 4, "IsoM_Req";
        /// Octet 10 bit 3: blocks follow the fixed part.
        prm_structure PRM_STRUCTURE = 3, "Prm_Structure";
    }
}
impl DpV1Status {
    const ALARM_MODE: u32 = 0x07;

    /// Reads octets 8..=10.
    pub const fn from_octets([octet_8, octet_9, octet_10]: [u8; 3]) -> Self {
        Self(u32::from_be_bytes([0, octet_8, octet_9, octet_10]))
    }
    /// Octets 8..=10.
    pub const fn octets(self) -> [u8; 3] {
        let [_, octet_8, octet_9, octet_10] = self.0.to_be_bytes();
        [octet_8, octet_9, octet_10]
    }
    /// Octet 9 bits 7..=2 in their place: the alarms that the master enables.
    pub const fn alarms(self) -> u8 {
        self.octets()[1] & 0xFC
    }
    /// Octet 10 bits 2..=0: how many alarms may be on their way at once (0 is 1, 1 is 2, 2 is 4, 3 is 8, 4 is 12, 5 is
    /// 16, 6 is 24, 7 is 32).
    pub const fn alarm_mode(self) -> u8 {
        (self.0 & Self::ALARM_MODE) as u8
    }
    /// The reserved bits that are set.
    pub const fn reserved(self) -> u32 {
        self.unnamed() & !Self::ALARM_MODE
    }
}

/// The data unit of `Set_Prm`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct SetPrm<'a> {
    /// Octet 1.
    pub status: StationStatus,
    /// Octet 2, first watchdog factor, 1..=255.
    pub wd_fact_1: u8,
    /// Octet 3, second watchdog factor, 1..=255.
    pub wd_fact_2: u8,
    /// Octet 4, earliest answer of the slave (`t_bit`); 0 keeps the value in force.
    pub min_tsdr: u8,
    /// Octets 5..=6, `Ident_Number`.
    pub ident: u16,
    /// Octet 7, `Group_Ident`: bit i is group i + 1; group 8 (bit 7) is the clock's.
    pub group: u8,
    /// Octets 8..=10; all zero in a telegram that ends with octet 7.
    pub dpv1: DpV1Status,
    /// Octets from 11 on: blocks if [`DpV1Status::prm_structure`] says so, else user parameters.
    pub blocks: &'a [u8],
}

impl<'a> SetPrm<'a> {
    /// Reads the data unit; blocks are read by [`SetPrm::blocks`].
    ///
    /// # Errors
    /// Fewer than 7 octets, or 8 or 9.
    pub fn parse(du: &'a [u8]) -> Result<Self, PrmError> {
        let (fixed, dpv1, blocks) = match du {
            [f1, f2, f3, f4, f5, f6, f7] => ([*f1, *f2, *f3, *f4, *f5, *f6, *f7], DpV1Status::default(), &[][..]),
            [f1, f2, f3, f4, f5, f6, f7, d1, d2, d3, blocks @ ..] => {
                ([*f1, *f2, *f3, *f4, *f5, *f6, *f7], DpV1Status::from_octets([*d1, *d2, *d3]), blocks)
            }
            _ => return Err(PrmError::new(du.len(), PrmRule::Length, du.len() as u32)),
        };
        let [status, wd_fact_1, wd_fact_2, min_tsdr, ident_high, ident_low, group] = fixed;
        Ok(Self {
            status: StationStatus(status),
            wd_fact_1,
            wd_fact_2,
            min_tsdr,
            ident: u16::from_be_bytes([ident_high, ident_low]),
            group,
            dpv1,
            blocks,
        })
    }
    /// Writes the data unit, octets 8..=10 always; its length, or `None` if `out` is too short.
    pub fn emit(&self, out: &mut [u8]) -> Option<usize> {
        let [ident_high, ident_low] = self.ident.to_be_bytes();
        let mut writer = Writer::new(out);
        writer.put(&[
            self.status.0,
            self.wd_fact_1,
            self.wd_fact_2,
            self.min_tsdr,
            ident_high,
            ident_low,
            self.group,
        ])?;
        writer.put(&self.dpv1.octets())?;
        writer.put(self.blocks)?;
        Some(writer.len)
    }
    /// Compares the fixed part with what any slave accepts.
    ///
    /// # Errors
    /// A reserved bit is set, or the watchdog is on with a factor of 0.
    pub fn check(&self) -> Result<(), PrmError> {
        if self.status.unnamed() != 0 {
            return Err(PrmError::new(1, PrmRule::StatusReserved, self.status.0));
        }
        for (octet, factor) in [(2, self.wd_fact_1), (3, self.wd_fact_2)] {
            if self.status.wd_on() && factor == 0 {
                return Err(PrmError::new(octet, PrmRule::Watchdog, factor));
            }
        }
        let [_, reserved @ ..] = self.dpv1.reserved().to_be_bytes();
        match reserved.iter().position(|&bits| bits != 0) {
            Some(at) => Err(PrmError::new(8 + at, PrmRule::DpV1Reserved, self.dpv1.octets()[at])),
            None => Ok(()),
        }
    }
    /// Watchdog time in steps of [`SetPrm::watchdog_base_ms`]; `None` while it is off.
    pub const fn watchdog_units(&self) -> Option<u16> {
        if self.status.wd_on() { Some(self.wd_fact_1 as u16 * self.wd_fact_2 as u16) } else { None }
    }
    /// One watchdog step (ms): 10, or 1 with [`DpV1Status::wd_base_1ms`].
    pub const fn watchdog_base_ms(&self) -> u16 {
        if self.dpv1.wd_base_1ms() { 1 } else { 10 }
    }
    /// The blocks in their order; none unless [`DpV1Status::prm_structure`] is set. Ends after the first error.
    pub const fn blocks(&self) -> Blocks<'a> {
        let rest = if self.dpv1.prm_structure() { self.blocks } else { &[] };
        Blocks { octet: FIXED + 1, rest }
    }
}

/// What a block is about. VPC3+ driver.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum BlockType {
    /// 02: redundancy command.
    PrmCmd,
    /// 03: DXB link table, [`DxbLinks`].
    DxbLinks,
    /// 04: isochronous parameters, [`IsoM`].
    IsoM,
    /// 07: DXB subscriber table, [`DxbSubscriptions`].
    DxbSubscriptions,
    /// 08: clock synchronisation.
    TimeAr,
    /// 81: user parameters, for encoders [`UserPrm81`].
    User,
    /// Any other.
    Unknown(u8),
}
impl BlockType {
    /// The type with this code number.
    pub const fn from_code(code: u8) -> Self {
        match code {
            0x02 => Self::PrmCmd,
            0x03 => Self::DxbLinks,
            0x04 => Self::IsoM,
            0x07 => Self::DxbSubscriptions,
            0x08 => Self::TimeAr,
            0x81 => Self::User,
            _ => Self::Unknown(code),
        }
    }
    /// The code number on the wire.
    pub const fn code(self) -> u8 {
        match self {
            Self::PrmCmd => 0x02,
            Self::DxbLinks => 0x03,
            Self::IsoM => 0x04,
            Self::DxbSubscriptions => 0x07,
            Self::TimeAr => 0x08,
            Self::User => 0x81,
            Self::Unknown(code) => code,
        }
    }
}
impl fmt::Display for BlockType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PrmCmd => f.write_str("PrmCmd"),
            Self::DxbLinks => f.write_str("DXB link table"),
            Self::IsoM => f.write_str("IsoM parameters"),
            Self::DxbSubscriptions => f.write_str("DXB subscriber table"),
            Self::TimeAr => f.write_str("Time AR"),
            Self::User => f.write_str("user parameters"),
            Self::Unknown(code) => write!(f, "block type {code:02X}"),
        }
    }
}

/// One structured block.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Block<'a> {
    /// Number of the block's first octet in `Set_Prm`, 11 for the first block.
    pub octet: usize,
    /// What it is about.
    pub kind: BlockType,
    /// The slot it is meant for, 0 for the whole device.
    pub slot: u8,
    /// Reserved, 0.
    pub specifier: u8,
    /// What follows the header of 4 octets.
    pub data: &'a [u8],
}

impl<'a> Block<'a> {
    /// Asks for a block of this type with slot and specifier 0; its data.
    fn plain(&self, kind: BlockType) -> Result<&'a [u8], PrmError> {
        if self.kind != kind {
            Err(PrmError::new(self.octet + 1, PrmRule::BlockType, self.kind.code()))
        } else if self.slot != 0 {
            Err(PrmError::new(self.octet + 2, PrmRule::Slot, self.slot))
        } else if self.specifier != 0 {
            Err(PrmError::new(self.octet + 3, PrmRule::Specifier, self.specifier))
        } else {
            Ok(self.data)
        }
    }
    /// As [`Block::plain`] with data of one length.
    fn exact<const N: usize>(&self, kind: BlockType, rule: PrmRule) -> Result<&'a [u8; N], PrmError> {
        let length = (BLOCK_HEAD + self.data.len()) as u32;
        self.plain(kind)?.try_into().map_err(|_| PrmError::new(self.octet, rule, length))
    }
    /// As [`Block::plain`] with version 1 and entries of `size` octets; the entries.
    fn table(&self, kind: BlockType, size: usize) -> Result<&'a [u8], PrmError> {
        let length = (BLOCK_HEAD + self.data.len()) as u32;
        match self.plain(kind)? {
            [1, entries @ ..] if entries.len().is_multiple_of(size) => Ok(entries),
            [1, ..] | [] => Err(PrmError::new(self.octet, PrmRule::DxbLength, length)),
            [version, ..] => Err(PrmError::new(self.octet + BLOCK_HEAD, PrmRule::Version, *version)),
        }
    }
}

/// Iterator over the blocks of a [`SetPrm`].
#[derive(Clone, Debug)]
pub struct Blocks<'a> {
    octet: usize,
    rest: &'a [u8],
}
impl<'a> Iterator for Blocks<'a> {
    type Item = Result<Block<'a>, PrmError>;

    fn next(&mut self) -> Option<Self::Item> {
        let length = usize::from(*self.rest.first()?);
        let octet = self.octet;
        let (Some(&[_, kind, slot, specifier, ref data @ ..]), rest) =
            (self.rest.get(..length), self.rest.get(length..).unwrap_or_default())
        else {
            self.rest = &[];
            return Some(Err(PrmError::new(octet, PrmRule::BlockLength, length as u32)));
        };
        self.rest = rest;
        self.octet += length;
        Some(Ok(Block { octet, kind: BlockType::from_code(kind), slot, specifier, data }))
    }
}

/// The isochronous block, 28 octets from `1C 04 00 00` on; octets 32..=59 behind the encoders' user block. Manual 3.3.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct IsoM {
    /// Octet 36: 1.
    pub version: u8,
    /// Octets 37..=40, `T_BASE_DP` (1/12 µs); 1500 is the one every slave knows.
    pub t_base_dp: u32,
    /// Octets 41..=42, bus cycle `T_DP` (`T_BASE_DP`), 1..=65535.
    pub t_dp: u16,
    /// Octet 43, master application cycle `T_MAPC` (`T_DP`), 1..=14.
    pub t_mapc: u8,
    /// Octets 44..=47, `T_BASE_IO` (1/12 µs).
    pub t_base_io: u32,
    /// Octets 48..=49, latch `T_I` before the end of the cycle (`T_BASE_IO`).
    pub t_i: u16,
    /// Octets 50..=51, set-point transfer `T_O` after the start of the cycle (`T_BASE_IO`).
    pub t_o: u16,
    /// Octets 52..=55, duration of all `Data_Exchange`, `T_DX` (1/12 µs); a manual's "1/12 ms" is a misprint.
    pub t_dx: u32,
    /// Octets 56..=57, half width of the clock window `T_PLL_W` (1/12 µs), 1..=65535.
    pub t_pll_w: u16,
    /// Octets 58..=59, delay of the clock `T_PLL_D` (1/12 µs).
    pub t_pll_d: u16,
}

impl IsoM {
    /// Octets of the block, header included.
    pub const LEN: usize = 28;
    /// The time bases that may be used (1/12 µs).
    pub const TIME_BASES: [u32; 6] = [375, 750, 1500, 3000, 6000, 12000];
    /// Shortest and longest bus cycle (1/12 µs): 500 µs and 32 ms.
    pub const T_DP_RANGE: core::ops::RangeInclusive<u64> = 6_000..=384_000;

    /// Reads the block.
    ///
    /// # Errors
    /// Another type, length or version, or a slot or specifier that is not 0.
    pub fn parse(block: &Block<'_>) -> Result<Self, PrmError> {
        let data: &[u8; Self::LEN - BLOCK_HEAD] = block.exact(BlockType::IsoM, PrmRule::IsoLength)?;
        let &[version, d0, d1, d2, d3, p0, p1, t_mapc, i0, i1, i2, i3, in0, in1, out0, out1, ref rest @ ..] = data;
        let &[x0, x1, x2, x3, w0, w1, y0, y1] = rest;
        if version != 1 {
            return Err(PrmError::new(block.octet + BLOCK_HEAD, PrmRule::Version, version));
        }
        Ok(Self {
            version,
            t_base_dp: u32::from_be_bytes([d0, d1, d2, d3]),
            t_dp: u16::from_be_bytes([p0, p1]),
            t_mapc,
            t_base_io: u32::from_be_bytes([i0, i1, i2, i3]),
            t_i: u16::from_be_bytes([in0, in1]),
            t_o: u16::from_be_bytes([out0, out1]),
            t_dx: u32::from_be_bytes([x0, x1, x2, x3]),
            t_pll_w: u16::from_be_bytes([w0, w1]),
            t_pll_d: u16::from_be_bytes([y0, y1]),
        })
    }
    /// The block, header included.
    pub fn emit(&self) -> [u8; Self::LEN] {
        let mut out = [0; Self::LEN];
        let mut writer = Writer::new(&mut out);
        let fields: [&[u8]; 11] = [
            &[Self::LEN as u8, BlockType::IsoM.code(), 0, 0],
            &[self.version],
            &self.t_base_dp.to_be_bytes(),
            &self.t_dp.to_be_bytes(),
            &[self.t_mapc],
            &self.t_base_io.to_be_bytes(),
            &self.t_i.to_be_bytes(),
            &self.t_o.to_be_bytes(),
            &self.t_dx.to_be_bytes(),
            &self.t_pll_w.to_be_bytes(),
            &self.t_pll_d.to_be_bytes(),
        ];
        for field in fields {
            // The fields are 28 octets together.
            let _ = writer.put(field);
        }
        out
    }
    /// Compares the values with the ranges of the block; `octet` is [`Block::octet`].
    ///
    /// # Errors
    /// The first value out of its range.
    pub fn check(&self, octet: usize) -> Result<(), PrmError> {
        for (offset, base) in [(5, self.t_base_dp), (12, self.t_base_io)] {
            if !Self::TIME_BASES.contains(&base) {
                return Err(PrmError::new(octet + offset, PrmRule::TimeBase, base));
            }
        }
        if self.t_dp == 0 || !Self::T_DP_RANGE.contains(&self.t_dp_units()) {
            return Err(PrmError::new(octet + 9, PrmRule::TDp, self.t_dp));
        }
        if !(1..=14).contains(&self.t_mapc) {
            return Err(PrmError::new(octet + 11, PrmRule::TMapc, self.t_mapc));
        }
        if self.t_pll_w == 0 {
            return Err(PrmError::new(octet + 24, PrmRule::TPllW, self.t_pll_w));
        }
        Ok(())
    }
    /// `T_DP` (1/12 µs).
    pub const fn t_dp_units(&self) -> u64 {
        self.t_base_dp as u64 * self.t_dp as u64
    }
    /// `T_I` (1/12 µs).
    pub const fn t_i_units(&self) -> u64 {
        self.t_base_io as u64 * self.t_i as u64
    }
    /// `T_O` (1/12 µs).
    pub const fn t_o_units(&self) -> u64 {
        self.t_base_io as u64 * self.t_o as u64
    }
}

bits! {
    /// Octet 15 of the encoders' `Set_Prm`. Manual 3.2.1 and 3.2.2.
    pub struct EncoderOptions: u8 {
        /// Bit 0: the position increases counter-clockwise, seen onto the shaft.
        counter_clockwise COUNTER_CLOCKWISE = 0, "code sequence CCW";
        /// Bit 1: scaling, preset and code sequence are in force.
        activate ACTIVATE = 1, "scaling/preset/counting direction";
        /// Bit 3: the position is scaled, if bit 1 is set too.
        scaling SCALING = 3, "scaling function";
    }
}

/// The encoders' user block, 21 octets from `15 81 00 00` on: octets 11..=31. Manual 3.2.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct UserPrm81 {
    /// Octet 15.
    pub options: EncoderOptions,
    /// Octets 16..=19, measuring units per revolution (counts).
    pub units_per_revolution: u32,
    /// Octets 20..=23, total measuring range (counts).
    pub total_range: u32,
    /// Octet 24, tolerated failures of the master's sign of life, default 1.
    pub max_failures: u8,
    /// Octets 25..=31, not used.
    pub reserved: [u8; 7],
}

impl UserPrm81 {
    /// Octets of the block, header included.
    pub const LEN: usize = 21;

    /// Reads the block.
    ///
    /// # Errors
    /// Another type or length, or a slot or specifier that is not 0.
    pub fn parse(block: &Block<'_>) -> Result<Self, PrmError> {
        let data: &[u8; Self::LEN - BLOCK_HEAD] = block.exact(BlockType::User, PrmRule::UserLength)?;
        let &[options, u0, u1, u2, u3, t0, t1, t2, t3, max_failures, ref reserved @ ..] = data;
        Ok(Self {
            options: EncoderOptions(options),
            units_per_revolution: u32::from_be_bytes([u0, u1, u2, u3]),
            total_range: u32::from_be_bytes([t0, t1, t2, t3]),
            max_failures,
            reserved: *reserved,
        })
    }
    /// The block, header included.
    pub fn emit(&self) -> [u8; Self::LEN] {
        let mut out = [0; Self::LEN];
        let [head, units, range, rest] = [0, 5, 9, 13];
        out[head..units].copy_from_slice(&[Self::LEN as u8, BlockType::User.code(), 0, 0, self.options.0]);
        out[units..range].copy_from_slice(&self.units_per_revolution.to_be_bytes());
        out[range..rest].copy_from_slice(&self.total_range.to_be_bytes());
        out[rest] = self.max_failures;
        out[rest + 1..].copy_from_slice(&self.reserved);
        out
    }
    /// Whether positions are scaled: bits 1 and 3 of octet 15 (manual 3.2.2).
    pub const fn scaled(&self) -> bool {
        self.options.has(EncoderOptions(EncoderOptions::ACTIVATE.0 | EncoderOptions::SCALING.0))
    }
}

/// One link of a subscriber: which octets of which publisher's answer it takes. VPC3+ driver.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct DxbLink {
    /// Address of the publisher, 0..=125.
    pub publisher: u8,
    /// Length of the publisher's data (octets), 1..=244; a broadcast of another length is a link error.
    pub length: u8,
    /// Where the sample begins in the publisher's data (octets).
    pub offset: u8,
    /// Length of the sample (octets).
    pub sample: u8,
}

impl DxbLink {
    /// Octets of an entry.
    pub const LEN: usize = 4;

    /// Compares with the rules; `octet` is the number of the entry's first octet, `buffer` the largest sample that the
    /// subscriber takes (octets).
    ///
    /// # Errors
    /// The first rule broken.
    pub fn check(&self, octet: usize, buffer: u8) -> Result<(), PrmError> {
        self.check_at([octet, octet + 1, octet + 2, octet + 3], buffer)
    }
    /// As [`DxbLink::check`] with the octet number of each field.
    fn check_at(self, octets: [usize; 4], buffer: u8) -> Result<(), PrmError> {
        let [publisher, length, offset, sample] = octets;
        let end = u16::from(self.offset) + u16::from(self.sample);
        if self.publisher > PUBLISHER_MAX {
            Err(PrmError::new(publisher, PrmRule::DxbPublisher, self.publisher))
        } else if !(1..=PUBLISHER_LENGTH_MAX).contains(&self.length) {
            Err(PrmError::new(length, PrmRule::DxbPublisherLength, self.length))
        } else if self.offset >= self.length {
            Err(PrmError::new(offset, PrmRule::DxbOffset, self.offset))
        } else if end > u16::from(self.length) || self.sample > buffer {
            Err(PrmError::new(sample, PrmRule::DxbSample, self.sample))
        } else {
            Ok(())
        }
    }
    const fn octets(self) -> [u8; Self::LEN] {
        [self.publisher, self.length, self.offset, self.sample]
    }
}

/// The DXB link table (block type 03).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct DxbLinks<'a> {
    octet: usize,
    entries: &'a [u8],
}

impl<'a> DxbLinks<'a> {
    /// Reads the block.
    ///
    /// # Errors
    /// Another type or version, a broken entry, or a slot or specifier that is not 0.
    pub fn parse(block: &Block<'a>) -> Result<Self, PrmError> {
        let entries = block.table(BlockType::DxbLinks, DxbLink::LEN)?;
        Ok(Self { octet: block.octet + BLOCK_HEAD + 1, entries })
    }
    /// The links in their order.
    pub fn iter(&self) -> impl Iterator<Item = DxbLink> + use<'a> {
        let (entries, _) = self.entries.as_chunks::<{ DxbLink::LEN }>();
        entries.iter().map(|&[publisher, length, offset, sample]| DxbLink { publisher, length, offset, sample })
    }
    /// Octet number of the first octet of entry `at`.
    pub const fn octet(&self, at: usize) -> usize {
        self.octet + at * DxbLink::LEN
    }
    /// Checks every link, see [`DxbLink::check`].
    ///
    /// # Errors
    /// The first rule broken.
    pub fn check(&self, buffer: u8) -> Result<(), PrmError> {
        self.iter().enumerate().try_for_each(|(at, link)| link.check(self.octet(at), buffer))
    }
}

/// A link whose sample goes to a place in the subscriber's modules. VPC3+ driver.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct DxbSubscription {
    /// Where the sample comes from.
    pub link: DxbLink,
    /// Slot that the sample goes to.
    pub slot: u8,
    /// Where it begins in this slot's data area (octets).
    pub destination: u8,
}
impl DxbSubscription {
    /// Octets of an entry: publisher, length, offset, slot, destination, sample.
    pub const LEN: usize = 6;

    /// As [`DxbLink::check`].
    ///
    /// # Errors
    /// The first rule broken.
    pub fn check(&self, octet: usize, buffer: u8) -> Result<(), PrmError> {
        self.link.check_at([octet, octet + 1, octet + 2, octet + 5], buffer)
    }
    const fn octets(self) -> [u8; Self::LEN] {
        let [publisher, length, offset, sample] = self.link.octets();
        [publisher, length, offset, self.slot, self.destination, sample]
    }
}

/// The DXB subscriber table (block type 07).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct DxbSubscriptions<'a> {
    octet: usize,
    entries: &'a [u8],
}
impl<'a> DxbSubscriptions<'a> {
    /// Reads the block.
    ///
    /// # Errors
    /// As [`DxbLinks::parse`].
    pub fn parse(block: &Block<'a>) -> Result<Self, PrmError> {
        let entries = block.table(BlockType::DxbSubscriptions, DxbSubscription::LEN)?;
        Ok(Self { octet: block.octet + BLOCK_HEAD + 1, entries })
    }
    /// The subscriptions in their order.
    pub fn iter(&self) -> impl Iterator<Item = DxbSubscription> + use<'a> {
        let (entries, _) = self.entries.as_chunks::<{ DxbSubscription::LEN }>();
        entries.iter().map(|&[publisher, length, offset, slot, destination, sample]| DxbSubscription {
            link: DxbLink { publisher, length, offset, sample },
            slot,
            destination,
        })
    }
    /// Octet number of the first octet of entry `at`.
    pub const fn octet(&self, at: usize) -> usize {
        self.octet + at * DxbSubscription::LEN
    }
    /// Checks every subscription, see [`DxbLink::check`].
    ///
    /// # Errors
    /// The first rule broken.
    pub fn check(&self, buffer: u8) -> Result<(), PrmError> {
        self.iter().enumerate().try_for_each(|(at, entry)| entry.check(self.octet(at), buffer))
    }
}

/// Builds a data unit of `Set_Prm` block by block. Each step is `None` once 244 octets do not suffice.
#[derive(Clone, Debug)]
pub struct PrmBuilder {
    len: usize,
    octets: [u8; MAX_PRM],
}

impl PrmBuilder {
    /// Starts with `prm`, whatever it has in its blocks included.
    pub fn new(prm: &SetPrm<'_>) -> Option<Self> {
        let mut octets = [0; MAX_PRM];
        let len = prm.emit(&mut octets)?;
        Some(Self { len, octets })
    }
    /// Appends a block with its header.
    pub fn block(self, kind: BlockType, slot: u8, specifier: u8, data: &[u8]) -> Option<Self> {
        let length = u8::try_from(BLOCK_HEAD + data.len()).ok()?;
        self.raw(&[length, kind.code(), slot, specifier])?.raw(data)
    }
    /// Appends the isochronous block.
    pub fn iso_m(self, iso: &IsoM) -> Option<Self> {
        self.raw(&iso.emit())
    }
    /// Appends the encoders' user block.
    pub fn user_81(self, user: &UserPrm81) -> Option<Self> {
        self.raw(&user.emit())
    }
    /// Appends a DXB link table, version 1.
    pub fn dxb_links(self, links: &[DxbLink]) -> Option<Self> {
        let length = u8::try_from(BLOCK_HEAD + 1 + links.len() * DxbLink::LEN).ok()?;
        let head = self.raw(&[length, BlockType::DxbLinks.code(), 0, 0, 1])?;
        links.iter().try_fold(head, |builder, link| builder.raw(&link.octets()))
    }
    /// Appends a DXB subscriber table, version 1.
    pub fn dxb_subscriptions(self, subscriptions: &[DxbSubscription]) -> Option<Self> {
        let length = u8::try_from(BLOCK_HEAD + 1 + subscriptions.len() * DxbSubscription::LEN).ok()?;
        let head = self.raw(&[length, BlockType::DxbSubscriptions.code(), 0, 0, 1])?;
        subscriptions.iter().try_fold(head, |builder, entry| builder.raw(&entry.octets()))
    }
    /// Appends octets as they are.
    pub fn raw(mut self, octets: &[u8]) -> Option<Self> {
        let end = self.len + octets.len();
        self.octets.get_mut(self.len..end)?.copy_from_slice(octets);
        self.len = end;
        Some(self)
    }
    /// The data unit so far.
    pub fn octets(&self) -> &[u8] {
        &self.octets[..self.len]
    }
}
