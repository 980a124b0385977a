//! Device profiles: what a configuration tool knows about a device from its GSD file and its manual.

use alloc::borrow::Cow;
use alloc::sync::Arc;
use core::fmt;
use core::ops::Deref;

use crate::device::options::Resolution;
use crate::fdl::params::BusParams;
use crate::time::{BitRate, Span, Tbit};
use crate::wire::config;
use crate::wire::prm;

/// Telegram 81 (manual 2.1.1).
const TELEGRAM_81: &[u8] = &config::TELEGRAM_81;

/// A kind of slave that a scenario can name.
#[derive(Clone, PartialEq, Eq, Debug)]
#[allow(clippy::struct_excessive_bools)] // What a GSD file says with a key each.
pub struct Profile {
    /// The name in scenario files and tables.
    pub name: Cow<'static, str>,
    /// What it is, in a sentence without its full stop.
    pub title: Cow<'static, str>,
    /// Ident_Number, octets 5..=6 of Set_Prm.
    pub ident: u16,
    /// The data unit of Chk_Cfg (manual 2.1.1).
    pub config: Cow<'static, [u8]>,
    /// Octets from slave to master in a Data_Exchange.
    pub inputs: u8,
    /// Octets from master to slave in a Data_Exchange.
    pub outputs: u8,
    /// MaxTsdr, the longest T_SDR, in the order of [`BitRate::ALL`]; see [`Profile::max_tsdr`].
    pub max_tsdr: [Tbit; BitRate::ALL.len()],
    /// Whether it works at each bit rate, in the same order.
    pub rates: [bool; BitRate::ALL.len()],
    /// TDP_MIN, the shortest T_DP (manual 3.3.2).
    pub t_dp_min: Span,
    /// TDP_MAX, the longest T_DP (manual 3.3.2).
    pub t_dp_max: Span,
    /// T_BASE_DP, the step of T_DP (1/12 us) (manual 3.3.1).
    pub t_base_dp: u32,
    /// T_BASE_IO, the step of T_I and T_O (1/12 us) (manual 3.3.4).
    pub t_base_io: u32,
    /// TI_MIN, the shortest T_I while octet 15 bit 1 is 0 (manual 3.3.5).
    pub t_i_min: Span,
    /// TO_MIN, what T_O must exceed T_DX by (manual 3.3.6).
    pub t_o_min: Span,
    /// Shortest time from T_O to the latch while octet 15 bit 1 is 0 (manual 3.3.5, 3.3.6).
    pub gap_min: Span,
    /// Both minima, T_I and the gap, while octet 15 bit 1 is 1 (manual 3.2.2).
    pub functions_min: Span,
    /// T_PLL_W_MAX, the widest window a tool may set (1/12 us).
    pub t_pll_w_max: u16,
    /// The narrowest window; less is taken as this (manual 3.3.8).
    pub min_window: Span,
    /// Steps in a revolution of the disc.
    pub steps_per_rev: u32,
    /// Revolutions that are told apart.
    pub revolutions: u32,
    /// Whether other slaves can receive its inputs (manual 3.4).
    pub publisher: bool,
    /// Whether it can receive other slaves' inputs.
    pub subscriber: bool,
    /// What it takes as a subscriber.
    pub dxb: DxbLimits,
    /// Octets of Set_Prm from octet 8 on that it takes at most (Max_User_Prm_Data_Len).
    pub max_prm: u8,
    /// Whether an empty Data_Exchange means Clear to it.
    pub fail_safe: bool,
    /// Whether it takes Sync_Req in Set_Prm: outputs that wait for Sync.
    pub sync: bool,
    /// Whether it takes Freeze_Req in Set_Prm: inputs that are held.
    pub freeze: bool,
    /// Max_Diag_Data_Len (octets), 6..=244 (manual 5.1).
    pub max_diag: u8,
    /// Min_Slave_Intervall, the shortest time between two Data_Exchange with it; GSD files have it in 100 us.
    pub min_slave_interval: Span,
    /// Whether it takes acyclic requests of its master (C1_Read_Write_supp).
    pub acyclic: bool,
    /// What these requests may be (C1_Max_Data_Len, C1_Response_Timeout).
    pub c1: AcyclicLimits,
    /// What those of class 2 masters may be (C2_Max_Data_Len, C2_Response_Timeout).
    pub c2: AcyclicLimits,
    /// MS2 connections at the same time, 0..=49; 0 without C2_Read_Write_supp (C2_Max_Count_Channels).
    pub ms2_connections: u8,
    /// Whether its watchdog also runs in steps of 1 ms (WD_Base_1ms_supp).
    pub wd_base_1ms: bool,
    /// Whether it has isochronous mode (Isochron_Mode_supp).
    pub isochronous: bool,
    /// Whether it works in isochronous mode alone (Isochron_Mode_required).
    pub isochronous_required: bool,
    /// Where all this comes from.
    pub source: Cow<'static, str>,
}

/// What a device's acyclic services take of one class of masters.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct AcyclicLimits {
    /// Octets of the longest data of a record, 1..=240.
    pub max_data: u8,
    /// Longest time to the answer; GSD files have it in 10 ms.
    pub response_timeout: Span,
}

impl AcyclicLimits {
    /// What fits into a telegram, in 10 s (SIEM80F9.GSE).
    pub const FULL: Self = Self { max_data: 240, response_timeout: Span::from_s(10) };
}

/// MS2 connections where nothing else is said. Model: the encoder manuals and GSD files have no number.
pub const MS2_CONNECTIONS: u8 = 2;
/// Most MS2 connections: the SAPs below the resource manager's (DP-V1).
pub const MOST_MS2_CONNECTIONS: u8 = 49;

/// What a subscriber takes (GSD keywords DXB_Max_Link_Count, DXB_Max_Data_Length).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct DxbLimits {
    /// Entries of both tables together, at most [`DxbLimits::MOST_LINKS`].
    pub links: u8,
    /// Longest sample, and the data area of each slot (octets).
    pub data: u8,
    /// Slots with a data area for the subscriber table, numbered from 1.
    pub slots: u8,
    /// Whether it takes blocks of user parameters besides. Model: what they do is the manufacturer's, and nothing here.
    pub user_blocks: bool,
}

impl DxbLimits {
    /// Most links of a subscriber (VPC3+C manual).
    pub const MOST_LINKS: u8 = 29;
    /// No subscriber.
    pub const NONE: Self = Self { links: 0, data: 0, slots: 0, user_blocks: false };
    /// All that the ASIC allows. Model: two slots, so that samples can go to one or the other.
    pub const FULL: Self = Self { links: Self::MOST_LINKS, data: 244, slots: 2, user_blocks: false };
}

impl Profile {
    /// MaxTsdr, the longest T_SDR at `rate` (t_bit).
    pub const fn max_tsdr(&self, rate: BitRate) -> Tbit {
        self.max_tsdr[rate as usize]
    }
    /// Whether it works at `rate`.
    pub const fn works_at(&self, rate: BitRate) -> bool {
        self.rates[rate as usize]
    }
    /// Disc and gear, where the type key says nothing else.
    pub const fn resolution(&self) -> Resolution {
        Resolution { steps_per_rev: self.steps_per_rev, revolutions: self.revolutions }
    }
    /// Step of T_DP.
    pub const fn dp_grid(&self) -> Span {
        Span::from_iso_units(self.t_base_dp)
    }
    /// Step of T_I and T_O.
    pub const fn io_grid(&self) -> Span {
        Span::from_iso_units(self.t_base_io)
    }
    /// Shortest T_I with octet 15 bit 1 = `functions` (manual 3.2.2, 3.3.5).
    pub const fn t_i_min(&self, functions: bool) -> Span {
        if functions { self.functions_min } else { self.t_i_min }
    }
    /// Shortest time from T_O to the latch with octet 15 bit 1 = `functions` (manual 3.2.2, 3.3.5).
    pub const fn gap_min(&self, functions: bool) -> Span {
        if functions { self.functions_min } else { self.gap_min }
    }
}

/// What the devices here do not share.
#[derive(Clone, Copy)]
struct Row {
    name: &'static str,
    title: &'static str,
    ident: u16,
    config: &'static [u8],
    max_tsdr: [Tbit; BitRate::ALL.len()],
    publisher: bool,
    dxb: DxbLimits,
    sync_freeze: bool,
    max_diag: u8,
    source: &'static str,
}

/// The device of this row; the rest is what all devices here share: the isochronous limits of manual 3.3 and a disc of
/// 13 + 12 bit. Min_Slave_Intervall, Max_User_Prm_Data_Len, WD_Base and acyclic services as SIEM80F9.GSE, the longest Set_Prm for a subscriber.
const fn profile(row: Row) -> Profile {
    Profile {
        name: Cow::Borrowed(row.name),
        title: Cow::Borrowed(row.title),
        ident: row.ident,
        config: Cow::Borrowed(row.config),
        inputs: 12,
        outputs: 4,
        max_tsdr: row.max_tsdr,
        rates: wired_rates(),
        t_dp_min: Span::from_us(500),
        t_dp_max: Span::from_ms(32),
        t_base_dp: 1_500,
        t_base_io: 1_500,
        t_i_min: Span::from_us(125),
        t_o_min: Span::from_us(125),
        gap_min: GAP_MIN,
        functions_min: FUNCTIONS_MIN,
        t_pll_w_max: 240,
        min_window: MIN_WINDOW,
        steps_per_rev: DISC.steps_per_rev,
        revolutions: DISC.revolutions,
        publisher: row.publisher,
        subscriber: row.dxb.links > 0,
        dxb: row.dxb,
        max_prm: if row.dxb.links > 0 { MAX_PRM } else { 52 },
        fail_safe: true,
        sync: row.sync_freeze,
        freeze: row.sync_freeze,
        max_diag: row.max_diag,
        min_slave_interval: Span::from_us(100),
        acyclic: row.dxb.links == 0,
        c1: AcyclicLimits::FULL,
        c2: AcyclicLimits::FULL,
        ms2_connections: MS2_CONNECTIONS,
        wd_base_1ms: true,
        isochronous: true,
        isochronous_required: false,
        source: Cow::Borrowed(row.source),
    }
}

/// Shortest time from T_O to the latch (manual 3.3.5, 3.3.6). No GSD file says it.
pub const GAP_MIN: Span = Span::from_us(125);
/// T_I and the gap with scaling, preset and code sequence (manual 3.2.2). No GSD file says it.
pub const FUNCTIONS_MIN: Span = Span::from_us(375);
/// The narrowest window (manual 3.3.8). No GSD file says it.
pub const MIN_WINDOW: Span = Span::from_us(1);
/// The disc of 13 + 12 bit where nothing else is known. It is part of the type key, and no GSD file says it.
pub const DISC: Resolution = Resolution { steps_per_rev: 8_192, revolutions: 4_096 };
/// Octets of Set_Prm behind octet 7 that fit into a telegram.
pub const MAX_PRM: u8 = prm::MAX_PRM as u8 - 7;

/// Max_Diag_Data_Len of a subscriber (octets): the standard part and the status of 29 links. Model: D24, VPC3+C.
const SUBSCRIBER_MAX_DIAG: u8 = 6 + 4 + 2 * DxbLimits::MOST_LINKS;

/// Every device, in the order in which lists show them.
pub const PROFILES: &[Profile] = &[
    profile(Row {
        name: "posital-ocd-dpb1b",
        title: "POSITAL OCD-DPB1B absolute encoder, 13 + 12 bit",
        ident: 0x06DF,
        config: TELEGRAM_81,
        max_tsdr: profile_max_tsdr(),
        publisher: true,
        dxb: DxbLimits::NONE,
        // The encoder manuals say nothing of Sync and Freeze.
        sync_freeze: false,
        max_diag: 6,
        source: "manual 2.1.1, 3.2, 3.3; MaxTsdr Model: D2, Ident Model: D24, T_PLL_W_MAX and Fail_Safe as SIEM80F9.GSE",
    }),
    profile(Row {
        name: "scancon-sag-dpb1b",
        title: "SCANCON SAG-DPB1B absolute encoder, 13 + 12 bit",
        ident: 0x06DF,
        config: TELEGRAM_81,
        max_tsdr: profile_max_tsdr(),
        publisher: true,
        dxb: DxbLimits::NONE,
        // The encoder manuals say nothing of Sync and Freeze.
        sync_freeze: false,
        max_diag: 6,
        source: "manual 2.1.1, 3.2, 3.3; MaxTsdr Model: D2, Ident Model: D24, T_PLL_W_MAX and Fail_Safe as SIEM80F9.GSE",
    }),
    profile(Row {
        name: "simodrive-sensor-isochron",
        title: "SIMODRIVE sensor isochron absolute encoder, 13 + 12 bit",
        ident: 0x80F9,
        config: TELEGRAM_81,
        max_tsdr: fast_max_tsdr(),
        publisher: true,
        dxb: DxbLimits::NONE,
        sync_freeze: true,
        max_diag: 6,
        source: "SIEM80F9.GSE; times with octet 15 bit 1 and the narrowest window as the encoder manual, 3.2.2, 3.3.8",
    }),
    profile(Row {
        name: "subscriber-drive",
        title: "generic DP-V2 slave that follows a publisher",
        // A manufacturer's telegram of telegram 81's lengths, so that one Data_Exchange costs the same.
        ident: 0xF0D0,
        config: &[0xC3, 0xC1, 0xC5, 0xFD, 0x00, 0x00],
        max_tsdr: profile_max_tsdr(),
        publisher: false,
        dxb: DxbLimits::FULL,
        sync_freeze: false,
        max_diag: SUBSCRIBER_MAX_DIAG,
        source: "Model: D24; links as VPC3+C",
    }),
    profile(Row {
        name: "coupled-drive",
        title: "generic DP-V2 slave that follows a publisher and publishes what it follows",
        ident: 0xF0D1,
        config: &[0xC3, 0xC1, 0xC5, 0xFD, 0x00, 0x00],
        max_tsdr: profile_max_tsdr(),
        publisher: true,
        dxb: DxbLimits::FULL,
        sync_freeze: false,
        max_diag: SUBSCRIBER_MAX_DIAG,
        source: "Model: subscriber-drive (D24) with the publisher function, for chains of slaves",
    }),
];

/// A device: what a profile says, shared by everything that deals with one kind of slave. It makes no difference
/// whether the profile is one of [`PROFILES`] or was read from a file.
#[derive(Clone, PartialEq, Eq)]
pub struct Device(Arc<Profile>);

impl Deref for Device {
    type Target = Profile;
    fn deref(&self) -> &Profile {
        &self.0
    }
}
impl From<Profile> for Device {
    fn from(profile: Profile) -> Self {
        Self(Arc::new(profile))
    }
}
impl From<&Profile> for Device {
    fn from(profile: &Profile) -> Self {
        profile.clone().into()
    }
}
impl From<&Device> for Device {
    fn from(device: &Device) -> Self {
        device.clone()
    }
}
impl fmt::Debug for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Device({})", self.name)
    }
}

/// The device called `name`, if there is one.
pub fn find(name: &str) -> Option<&'static Profile> {
    PROFILES.iter().find(|profile| profile.name == name)
}

/// All rates but 31.25 kbit/s, which is of other cables (SIEM80F9.GSE).
const fn wired_rates() -> [bool; BitRate::ALL.len()] {
    let mut all = [true; BitRate::ALL.len()];
    all[BitRate::K31_25 as usize] = false;
    all
}

/// The DP profile's max T_SDR at each rate (Model: D2).
const fn profile_max_tsdr() -> [Tbit; BitRate::ALL.len()] {
    let mut all = [Tbit(0); BitRate::ALL.len()];
    let mut i = 0;
    while i < all.len() {
        all[i] = BusParams::profile(BitRate::ALL[i]).max_tsdr;
        i += 1;
    }
    all
}

/// MaxTsdr of a fast ASIC: 15 t_bit up to 500 kbit/s, then 25, 50, 100, 200 (SIEM80F9.GSE).
const fn fast_max_tsdr() -> [Tbit; BitRate::ALL.len()] {
    let mut all = [Tbit(15); BitRate::ALL.len()];
    all[BitRate::M1_5 as usize] = Tbit(25);
    all[BitRate::M3 as usize] = Tbit(50);
    all[BitRate::M6 as usize] = Tbit(100);
    all[BitRate::M12 as usize] = Tbit(200);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_profile_is_found_by_its_name_and_complete() {
        for profile in PROFILES {
            assert_eq!(find(&profile.name), Some(profile));
            assert!(!profile.title.is_empty() && !profile.source.is_empty() && profile.ident != 0, "{}", profile.name);
            assert!(profile.t_dp_min.is_multiple_of(profile.dp_grid()), "{}", profile.name);
            assert!(profile.publisher || profile.subscriber, "{}", profile.name);
            assert_eq!(profile.subscriber, profile.dxb != DxbLimits::NONE, "{}", profile.name);
            assert!(profile.dxb.links <= DxbLimits::MOST_LINKS, "{}", profile.name);
        }
        assert_eq!(find("posital"), None);
    }

    #[test]
    fn names_are_unique() {
        for (i, a) in PROFILES.iter().enumerate() {
            assert!(PROFILES[..i].iter().all(|b| b.name != a.name), "{}", a.name);
        }
    }

    #[test]
    fn max_tsdr_is_read_by_rate() {
        let at = |name: &str, rate| find(name).unwrap().max_tsdr(rate).0;
        let rates = [BitRate::K500, BitRate::M1_5, BitRate::M3, BitRate::M6, BitRate::M12];
        assert_eq!(rates.map(|rate| at("posital-ocd-dpb1b", rate)), [100, 150, 250, 450, 800]);
        assert_eq!(rates.map(|rate| at("simodrive-sensor-isochron", rate)), [15, 25, 50, 100, 200]);
        for (index, &rate) in BitRate::ALL.iter().enumerate() {
            assert_eq!(rate as usize, index);
        }
    }
}
