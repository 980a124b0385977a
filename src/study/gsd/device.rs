//! From what a file says to a device that the model can simulate, and what does not fit together in the file.

use super::file::{File, Value};
use super::prm::UserPrm;
use crate::device::profile::{
    AcyclicLimits, DISC, DxbLimits, FUNCTIONS_MIN, GAP_MIN, MAX_PRM, MIN_WINDOW, MOST_MS2_CONNECTIONS, MS2_CONNECTIONS,
    Profile,
};
use crate::study::scenario::{Fault, nearest};
use crate::time::{BitRate, Span, Tbit};
use crate::wire::config::{self, TELEGRAM_81};
use crate::wire::prm::IsoM;
use std::borrow::Cow;

/// Something in a file that does not fit.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Finding {
    /// Line of the keyword it is about, if there is one.
    pub line: Option<usize>,
    /// What does not fit, and what is made of it.
    pub message: String,
    /// How bad it is for the file.
    pub weight: Weight,
    /// Whether the model cannot simulate the device because of it.
    pub refuses: bool,
}

/// How bad a [`Finding`] is for the file.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Weight {
    /// Something is left out or said twice, and the meaning is clear; or the model has no such device.
    Note,
    /// The file contradicts itself or what the GSD specification allows.
    Error,
}

impl Weight {
    /// The word for it.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Error => "error",
        }
    }
}

/// Octets that a unit of the model exchanges: those of telegram 81.
const INPUTS: u8 = 12;
const OUTPUTS: u8 = 4;
/// What the model can simulate.
const SIMULATED: &str = "the model simulates encoders with telegram 81 (Chk_Cfg C3 C1 C5 FD 00 51), and subscribers \
                         with its 12 octets of inputs and 4 octets of outputs";
/// Where MaxTsdr ends (t_bit): min T_SDR and the longest that a slot time leaves.
const TSDR: std::ops::RangeInclusive<u32> = 11..=1_023;

impl File {
    /// The number that a keyword has.
    pub(super) fn number(&self, keyword: &str) -> Option<u32> {
        match self.values.get(keyword) {
            Some((Value::Number(number), _)) => Some(*number),
            _ => None,
        }
    }
    /// Whether a flag is set.
    pub(super) fn flag(&self, keyword: &str) -> bool {
        self.number(keyword).is_some_and(|number| number != 0)
    }
    /// The text that a keyword has.
    pub(super) fn text(&self, keyword: &str) -> &str {
        match self.values.get(keyword) {
            Some((Value::Text(text), _)) => text,
            _ => "",
        }
    }
    /// The line of a keyword.
    pub(super) fn line(&self, keyword: &str) -> Option<usize> {
        self.values.get(keyword).map(|(_, at)| at.line)
    }
    /// The number that a keyword of isochronous mode has; without that mode it says nothing.
    fn isochronous(&self, keyword: &str) -> Option<u32> {
        self.number(keyword).filter(|_| self.flag("Isochron_Mode_supp"))
    }
    /// T_BASE_DP (1/12 us). 1500 is the one that every slave knows.
    fn t_base_dp(&self) -> u32 {
        self.isochronous("TBASE_DP").unwrap_or(1_500)
    }
    /// T_BASE_IO (1/12 us).
    fn t_base_io(&self) -> u32 {
        self.isochronous("TBASE_IO").unwrap_or(1_500)
    }
    /// The shortest and the longest T_DP (1/12 us).
    fn t_dp(&self) -> (u64, u64) {
        let units = |keyword, usual| {
            self.isochronous(keyword).map_or(usual, |number| u64::from(number) * u64::from(self.t_base_dp()))
        };
        (units("TDP_MIN", *IsoM::T_DP_RANGE.start()), units("TDP_MAX", *IsoM::T_DP_RANGE.end()))
    }
    /// The end of the keyword's name that stands for a bit rate.
    pub(super) fn rate_name(rate: BitRate) -> &'static str {
        match rate {
            BitRate::K9_6 => "9.6",
            BitRate::K19_2 => "19.2",
            BitRate::K31_25 => "31.25",
            BitRate::K45_45 => "45.45",
            BitRate::K93_75 => "93.75",
            BitRate::K187_5 => "187.5",
            BitRate::K500 => "500",
            BitRate::M1_5 => "1.5M",
            BitRate::M3 => "3M",
            BitRate::M6 => "6M",
            BitRate::M12 => "12M",
        }
    }
    /// Whether the device works at `rate`.
    pub(super) fn works_at(&self, rate: BitRate) -> bool {
        self.flag(&format!("{}_supp", Self::rate_name(rate)))
    }
    /// MaxTsdr at `rate`; where the file says none, the crate has the DP profile's (Model: D2).
    fn max_tsdr(&self, rate: BitRate) -> Tbit {
        let all = &self.description.max_tsdr;
        Tbit(u32::from(match rate {
            BitRate::K9_6 => all.b9600,
            BitRate::K19_2 => all.b19200,
            BitRate::K31_25 => all.b31250,
            BitRate::K45_45 => all.b45450,
            BitRate::K93_75 => all.b93750,
            BitRate::K187_5 => all.b187500,
            BitRate::K500 => all.b500000,
            BitRate::M1_5 => all.b1500000,
            BitRate::M3 => all.b3000000,
            BitRate::M6 => all.b6000000,
            BitRate::M12 => all.b12000000,
        }))
    }
}

impl File {
    /// What acyclic services of one class take.
    fn acyclic_limits(&self, max_data: &str, response_timeout: &str) -> AcyclicLimits {
        let full = AcyclicLimits::FULL;
        let time = self.number(response_timeout).filter(|&steps| steps > 0);
        AcyclicLimits {
            max_data: self.number(max_data).map_or(full.max_data, |octets| octets.clamp(1, full.max_data.into()) as u8),
            response_timeout: time.map_or(full.response_timeout, |steps| Span::from_ms(10) * i64::from(steps)),
        }
    }
    /// MS2 connections.
    fn ms2_connections(&self) -> u8 {
        let channels = self.number("C2_Max_Count_Channels").unwrap_or(MS2_CONNECTIONS.into());
        if self.flag("C2_Read_Write_supp") { channels.min(MOST_MS2_CONNECTIONS.into()) as u8 } else { 0 }
    }
}

/// The number of the module called `name`, or of the one that needs no name.
pub(super) fn module(file: &File, name: Option<&str>) -> Result<usize, Fault> {
    let modules = &file.description.available_modules;
    let names = || modules.iter().map(|module| module.name.trim());
    if let Some(name) = name {
        let plain = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ").to_lowercase();
        return names().position(|known| plain(known) == plain(name)).ok_or_else(|| {
            let shown: String = name.chars().take(40).collect();
            let help = nearest(name, names()).unwrap_or_else(|| some(names()));
            Fault::new(format!("the GSD file has no module \"{shown}\"")).help(help)
        });
    }
    let mut telegram_81 = (0..modules.len()).filter(|&i| modules[i].config == TELEGRAM_81);
    match (modules.len(), telegram_81.next()) {
        (1, _) => Ok(0),
        (_, Some(index)) if telegram_81.next().is_none() => Ok(index),
        (0, _) => Err(Fault::new("the GSD file has no module").rule(SIMULATED)),
        (count, _) => {
            Err(Fault::new(format!("the GSD file has {count} modules, and it is not clear which one is meant"))
                .rule("without module = \"...\" it is the only one, or the only one with telegram 81")
                .help(format!("module = \"...\"; {}", some(names()))))
        }
    }
}

/// The first names.
fn some<'n>(names: impl Iterator<Item = &'n str> + Clone) -> String {
    const SHOWN: usize = 8;
    let more = names.clone().count().saturating_sub(SHOWN);
    let shown = names.take(SHOWN).collect::<Vec<_>>().join(", ");
    if more == 0 { format!("it has {shown}") } else { format!("it has {shown} and {more} more") }
}

/// The profile of the device with the module `module`, without its source.
pub(super) fn profile(file: &File, module_name: Option<&str>) -> Result<Profile, Fault> {
    if let Some(finding) = findings(file).into_iter().find(|finding| finding.refuses) {
        return Err(Fault::new(format!("this device cannot be simulated: {}", finding.message)).rule(SIMULATED));
    }
    let index = module(file, module_name)?;
    let chosen = &file.description.available_modules[index];
    let name = chosen.name.trim();
    let (inputs, outputs) = config::lengths(&chosen.config)
        .map_err(|error| Fault::new(format!("the octets of module \"{name}\" are no configuration: {error}")))?;
    let subscriber = file.flag("Subscriber_supp");
    if !subscriber && chosen.config != TELEGRAM_81 {
        return Err(
            Fault::new(format!("module \"{name}\" is not telegram 81: {}", hex(&chosen.config))).rule(SIMULATED)
        );
    }
    if (inputs, outputs) != (INPUTS, OUTPUTS) {
        let message = format!("module \"{name}\" has {inputs} octets of inputs and {outputs} octets of outputs");
        return Err(Fault::new(message).rule(SIMULATED));
    }
    let prm = UserPrm::of(file, Some(&chosen.module_prm_data))?;
    if subscriber { prm.blocks().map(|_| ()) } else { prm.encoder_block().map(|_| ()) }?;
    Ok(of_module(file, &chosen.config, subscriber))
}

/// The profile with a module that was found good.
fn of_module(file: &File, config: &[u8], subscriber: bool) -> Profile {
    let iso_units = |keyword, usual: u32| file.number(keyword).unwrap_or(usual);
    let io =
        |keyword| Span::from_iso_units(file.isochronous(keyword).unwrap_or(1).max(1).saturating_mul(file.t_base_io()));
    let (t_dp_min, t_dp_max) = file.t_dp();
    let t_dp =
        |units: u64| Span::from_iso_units(units.clamp(*IsoM::T_DP_RANGE.start(), *IsoM::T_DP_RANGE.end()) as u32);
    let (mut max_tsdr, mut rates) = ([Tbit(0); BitRate::ALL.len()], [false; BitRate::ALL.len()]);
    for &rate in BitRate::ALL {
        max_tsdr[rate as usize] = file.max_tsdr(rate);
        rates[rate as usize] = file.works_at(rate);
    }
    let octet = |keyword, full: u8| iso_units(keyword, full.into()).clamp(1, full.into()) as u8;
    let dxb = DxbLimits {
        links: octet("DXB_Max_Link_Count", DxbLimits::FULL.links),
        data: octet("DXB_Max_Data_Length", DxbLimits::FULL.data),
        user_blocks: true,
        ..DxbLimits::FULL
    };
    Profile {
        name: Cow::Owned(name(file)),
        title: Cow::Owned(title(file)),
        ident: file.description.ident_number,
        config: Cow::Owned(config.to_vec()),
        inputs: INPUTS,
        outputs: OUTPUTS,
        max_tsdr,
        rates,
        t_dp_min: t_dp(t_dp_min),
        t_dp_max: t_dp(t_dp_max),
        t_base_dp: file.t_base_dp(),
        t_base_io: file.t_base_io(),
        t_i_min: io("TI_MIN"),
        t_o_min: io("TO_MIN"),
        gap_min: GAP_MIN,
        functions_min: FUNCTIONS_MIN.max(io("TI_MIN")),
        t_pll_w_max: file.isochronous("T_PLL_W_MAX").unwrap_or(12) as u16,
        min_window: MIN_WINDOW,
        steps_per_rev: DISC.steps_per_rev,
        revolutions: DISC.revolutions,
        publisher: file.flag("Publisher_supp"),
        subscriber,
        dxb: if subscriber { dxb } else { DxbLimits::NONE },
        max_prm: iso_units("Max_User_Prm_Data_Len", MAX_PRM.into()).min(MAX_PRM.into()) as u8,
        fail_safe: file.flag("Fail_Safe"),
        sync: file.flag("Sync_Mode_supp"),
        freeze: file.flag("Freeze_Mode_supp"),
        max_diag: iso_units("Max_Diag_Data_Len", 6).clamp(6, 244) as u8,
        min_slave_interval: Span::from_us(100) * i64::from(iso_units("Min_Slave_Intervall", 1)),
        acyclic: file.flag("C1_Read_Write_supp") && !subscriber,
        c1: file.acyclic_limits("C1_Max_Data_Len", "C1_Response_Timeout"),
        c2: file.acyclic_limits("C2_Max_Data_Len", "C2_Response_Timeout"),
        ms2_connections: file.ms2_connections(),
        wd_base_1ms: file.flag("WD_Base_1ms_supp"),
        isochronous: file.flag("Isochron_Mode_supp"),
        isochronous_required: file.flag("Isochron_Mode_required"),
        source: Cow::Borrowed(""),
    }
}

/// Vendor and model, once each.
fn full_name(file: &File) -> String {
    let (vendor, model) = (file.text("Vendor_Name"), file.text("Model_Name"));
    if model.to_lowercase().starts_with(&vendor.to_lowercase()) {
        model.to_owned()
    } else {
        format!("{vendor} {model}")
    }
}

/// The name in tables: vendor and model in small letters, digits and hyphens.
fn name(file: &File) -> String {
    const LONGEST: usize = 48;
    let full = full_name(file);
    let words = full.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    let name: String = words.collect::<Vec<_>>().join("-").to_lowercase().chars().take(LONGEST).collect();
    if name.is_empty() { format!("gsd-{:04x}", file.description.ident_number) } else { name }
}

/// What the file says it is.
pub(super) fn title(file: &File) -> String {
    let info = file.text("Info_Text");
    if info.is_empty() { full_name(file) } else { info.to_owned() }
}

pub(super) fn hex(octets: &[u8]) -> String {
    octets.iter().map(|octet| format!("{octet:02X}")).collect::<Vec<_>>().join(" ")
}

/// Everything that does not fit together in `file`.
pub(super) fn findings(file: &File) -> Vec<Finding> {
    let mut all = Findings { file, found: Vec::new() };
    all.identity();
    all.isochronous();
    all.rates();
    all.acyclic();
    all.modules();
    all.parameters();
    for &(keyword, line) in &file.repeated {
        let message = format!("{keyword} was there before; the last one counts");
        all.found.push(Finding { line: Some(line), message, weight: Weight::Note, refuses: false });
    }
    all.found
}

struct Findings<'a> {
    file: &'a File,
    found: Vec<Finding>,
}

impl Findings<'_> {
    fn add(&mut self, keyword: &str, message: String, weight: Weight, refuses: bool) {
        self.found.push(Finding { line: self.file.line(keyword), message, weight, refuses });
    }
    /// Something that is taken as it is meant.
    fn note(&mut self, keyword: &str, message: String) {
        self.add(keyword, message, Weight::Note, false);
    }
    /// A contradiction that does no harm here.
    fn wrong(&mut self, keyword: &str, message: String) {
        self.add(keyword, message, Weight::Error, false);
    }
    /// A contradiction, so that the device cannot be simulated.
    fn refuse(&mut self, keyword: &str, message: String) {
        self.add(keyword, message, Weight::Error, true);
    }
    /// A device that the model has not.
    fn unknown(&mut self, keyword: &str, message: String) {
        self.add(keyword, message, Weight::Note, true);
    }

    fn identity(&mut self) {
        for (keyword, what) in [("Station_Type", "a slave"), ("Protocol_Ident", "PROFIBUS DP")] {
            if let Some(number) = self.file.number(keyword).filter(|&number| number != 0) {
                self.unknown(keyword, format!("{keyword} = {number} is not {what}"));
            }
        }
        if self.file.number("Ident_Number").is_none() {
            self.refuse("Ident_Number", "there is no Ident_Number".to_owned());
        }
    }

    fn isochronous(&mut self) {
        let file = self.file;
        if !file.flag("Isochron_Mode_supp") {
            if file.flag("Isochron_Mode_required") {
                let message = "Isochron_Mode_required without Isochron_Mode_supp".to_owned();
                self.refuse("Isochron_Mode_required", message);
            }
            return;
        }
        for keyword in ["DPV1_Slave", "Prm_Block_Structure_supp"] {
            if !file.flag(keyword) {
                let message = format!("isochronous mode without {keyword}: its parameters are a block of a DPV1 slave");
                self.wrong(keyword, message);
            }
        }
        for keyword in ["TBASE_DP", "TBASE_IO"] {
            let base = file.number(keyword).unwrap_or(1_500);
            if !IsoM::TIME_BASES.contains(&base) {
                let bases = IsoM::TIME_BASES.map(|base| base.to_string()).join(", ");
                self.refuse(keyword, format!("{keyword} = {base} is none of {bases} (1/12 us)"));
            }
        }
        let (min, max) = file.t_dp();
        for (keyword, units) in [("TDP_MIN", min), ("TDP_MAX", max)] {
            if !IsoM::T_DP_RANGE.contains(&units) {
                let base = file.t_base_dp();
                self.wrong(
                    keyword,
                    format!(
                        "{keyword} x TBASE_DP = {} x {base} / 12 us is not within 500 us to 32 ms",
                        units / u64::from(base.max(1))
                    ),
                );
            }
        }
        if min > max {
            self.refuse("TDP_MIN", "TDP_MIN is more than TDP_MAX".to_owned());
        }
        let usual = [
            ("TBASE_DP", "1500, 125 us"),
            ("TBASE_IO", "1500, 125 us"),
            ("TDP_MIN", "500 us"),
            ("TDP_MAX", "32 ms"),
            ("TI_MIN", "1 x TBASE_IO"),
            ("TO_MIN", "1 x TBASE_IO"),
            ("T_PLL_W_MAX", "12, 1 us"),
        ];
        for (keyword, taken) in usual {
            match file.number(keyword) {
                None => self.note(keyword, format!("there is no {keyword}; it is taken as {taken}")),
                Some(0) if keyword == "T_PLL_W_MAX" => self.refuse(keyword, "T_PLL_W_MAX = 0 is no window".to_owned()),
                Some(0) if keyword.starts_with("TI") || keyword.starts_with("TO") => {
                    self.note(keyword, format!("{keyword} = 0 is taken as {taken}"));
                }
                Some(_) => {}
            }
        }
    }

    fn rates(&mut self) {
        let file = self.file;
        let isochronous = file.flag("Isochron_Mode_supp");
        if isochronous && !BitRate::ALL.iter().any(|&rate| rate >= BitRate::M1_5 && file.works_at(rate)) {
            self.unknown("1.5M_supp", "no bit rate from 1.5 Mbit/s on, where isochronous mode begins".to_owned());
        }
        for &rate in BitRate::ALL {
            let name = File::rate_name(rate);
            let keyword = format!("MaxTsdr_{name}");
            match file.number(&keyword) {
                None if file.works_at(rate) => {
                    let taken = file.max_tsdr(rate);
                    self.note(&format!("{name}_supp"), format!("there is no {keyword}; it is taken as {taken}"));
                }
                Some(bits) if file.works_at(rate) && !TSDR.contains(&bits) => {
                    let message = format!("{keyword} = {bits} is not within {} to {}", TSDR.start(), TSDR.end());
                    self.wrong(&keyword, message);
                }
                _ => {}
            }
        }
    }

    /// Each class of acyclic services has its length and its time.
    fn acyclic(&mut self) {
        let file = self.file;
        for class in ["C1", "C2"].into_iter().filter(|class| file.flag(&format!("{class}_Read_Write_supp"))) {
            for (end, longest, taken) in
                [("Max_Data_Len", u32::from(AcyclicLimits::FULL.max_data), "240"), ("Response_Timeout", 65_535, "10 s")]
            {
                let keyword = format!("{class}_{end}");
                match file.number(&keyword) {
                    None => self.note(&keyword, format!("there is no {keyword}; it is taken as {taken}")),
                    Some(number) if !(1..=longest).contains(&number) => {
                        self.wrong(&keyword, format!("{keyword} = {number} is not within 1 to {longest}"));
                    }
                    Some(_) => {}
                }
            }
        }
        let channels = file.number("C2_Max_Count_Channels");
        match channels {
            None if file.flag("C2_Read_Write_supp") => {
                let message = format!("there is no C2_Max_Count_Channels; it is taken as {MS2_CONNECTIONS}");
                self.note("C2_Read_Write_supp", message);
            }
            Some(number) if number > MOST_MS2_CONNECTIONS.into() => {
                let message = format!("C2_Max_Count_Channels = {number} is more than {MOST_MS2_CONNECTIONS}");
                self.wrong("C2_Max_Count_Channels", message);
            }
            _ => {}
        }
    }

    fn modules(&mut self) {
        let file = self.file;
        let limits = (file.number("Max_Input_Len"), file.number("Max_Output_Len"), file.number("Max_Data_Len"));
        for (module, at) in file.description.available_modules.iter().zip(&file.modules) {
            let name = module.name.trim();
            let message = match config::lengths(&module.config) {
                Err(error) => format!("module \"{name}\": {error}"),
                Ok((inputs, outputs)) => {
                    let (inputs, outputs) = (u32::from(inputs), u32::from(outputs));
                    let over = [
                        ("Max_Input_Len", inputs, limits.0),
                        ("Max_Output_Len", outputs, limits.1),
                        ("Max_Data_Len", inputs + outputs, limits.2),
                    ];
                    let broken = over.into_iter().find(|&(_, octets, limit)| limit.is_some_and(|limit| octets > limit));
                    let Some((keyword, octets, _)) = broken else { continue };
                    format!("module \"{name}\" has {octets} octets, more than {keyword}")
                }
            };
            self.found.push(Finding { line: Some(at.line), message, weight: Weight::Error, refuses: false });
        }
        let isochronous = file.flag("Isochron_Mode_supp") && !file.flag("Subscriber_supp");
        if isochronous && !file.description.available_modules.iter().any(|module| module.config == TELEGRAM_81) {
            let message = "no module is telegram 81 (C3 C1 C5 FD 00 51)".to_owned();
            self.found.push(Finding { line: None, message, weight: Weight::Note, refuses: true });
        }
    }

    fn parameters(&mut self) {
        let file = self.file;
        let prm = match UserPrm::of(file, None) {
            Ok(prm) => prm,
            Err(fault) => return self.refuse("Max_User_Prm_Data_Len", fault.message),
        };
        let needed = prm.octets().len() + IsoM::LEN;
        if let Some(limit) = file.number("Max_User_Prm_Data_Len")
            && file.flag("Isochron_Mode_supp")
            && needed > limit as usize
        {
            let message = format!(
                "Max_User_Prm_Data_Len = {limit}, but the preset octets and the isochronous block are {needed} octets"
            );
            self.wrong("Max_User_Prm_Data_Len", message);
        }
        if file.flag("Subscriber_supp") && file.number("DXB_Max_Link_Count").is_none() {
            let message = format!("a subscriber without DXB_Max_Link_Count; it is taken as {}", DxbLimits::MOST_LINKS);
            self.note("Subscriber_supp", message);
        }
    }
}
