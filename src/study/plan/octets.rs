//! Octets: Set_Prm and Chk_Cfg of a slave as a configuration tool sends them, every octet with its name and value.

use crate::dp::{CHK_CFG, SET_PRM};
use crate::study::build;
use crate::study::scenario::{Scenario, Slave};
use crate::time::Span;
use crate::wire::prm::{
    Block, BlockType, DpV1Status, DxbLinks, DxbSubscriptions, EncoderOptions, IsoM, SetPrm, UserPrm81,
};
use crate::wire::{Address, Fcb, Frame, Header, Sap, Service};

/// Some octets of a data unit that mean one thing.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Field {
    /// Number of the first octet, from 1.
    pub first: usize,
    /// The octets.
    pub octets: Vec<u8>,
    /// What they are.
    pub name: String,
    /// What they say, with the unit.
    pub value: String,
}

impl Field {
    /// `octets 41..42` or `octet 43`.
    pub fn place(&self) -> String {
        match self.octets.len() {
            0 | 1 => format!("{}", self.first),
            n => format!("{}..{}", self.first, self.first + n - 1),
        }
    }
}

/// A telegram of the start-up.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Written {
    /// `Set_Prm` or `Chk_Cfg`.
    pub name: &'static str,
    /// To whom.
    pub slave: Address,
    /// The data unit, field by field; together they are all of it.
    pub fields: Vec<Field>,
    /// From SD to ED, with the FCB of an undisturbed start-up.
    pub telegram: Vec<u8>,
}

impl Written {
    /// The data unit.
    pub fn du(&self) -> Vec<u8> {
        self.fields.iter().flat_map(|field| field.octets.iter().copied()).collect()
    }
}

/// Octets as hexadecimal numbers with spaces between.
pub fn hex(octets: &[u8]) -> String {
    octets.iter().map(|octet| format!("{octet:02X}")).collect::<Vec<_>>().join(" ")
}

/// Set_Prm and Chk_Cfg of `slave` in `scenario`. A time that no step of its grid hits is cut to the step below, one that is
/// too long for its octets to the longest.
///
/// # Panics
/// If the scenario breaks a rule that reading it to plan checks.
pub fn telegrams(scenario: &Scenario, slave: &Slave) -> [Written; 2] {
    // Slave_Diag is the first request, Get_Cfg the second if the master asks for it.
    let mut fcb = Fcb::First.next();
    if scenario.master.get_cfg {
        fcb = fcb.next();
    }
    let (prm, cfg) = (build::set_prm(scenario, slave), &slave.device.config);
    let written = |name, (dsap, ssap): (Sap, Sap), fcb, fields: Vec<Field>, du: &[u8]| {
        let header = Header::request(slave.address, scenario.master.address, Service::SrdHigh, fcb);
        let mut frame = Frame::new();
        frame.set_data(&header.with_saps(dsap, ssap), du).expect("a data unit of the start-up fits");
        Written { name, slave: slave.address, fields, telegram: frame.octets().to_vec() }
    };
    [written("Set_Prm", SET_PRM, fcb, set_prm(&prm), &prm), written("Chk_Cfg", CHK_CFG, fcb.next(), chk_cfg(cfg), cfg)]
}

/// Takes fields off a data unit from the front.
struct Cutter<'a> {
    first: usize,
    rest: &'a [u8],
    fields: Vec<Field>,
}

impl<'a> Cutter<'a> {
    const fn new(first: usize, rest: &'a [u8]) -> Self {
        Self { first, rest, fields: Vec::new() }
    }
    /// The next `count` octets, or what is left.
    fn take(&mut self, count: usize, name: impl Into<String>, value: impl Into<String>) {
        let (octets, rest) = self.rest.split_at(count.min(self.rest.len()));
        if !octets.is_empty() {
            self.fields.push(Field {
                first: self.first,
                octets: octets.to_vec(),
                name: name.into(),
                value: value.into(),
            });
        }
        (self.first, self.rest) = (self.first + octets.len(), rest);
    }
    /// All that is left.
    fn end(mut self, name: &str, value: &str) -> Vec<Field> {
        self.take(self.rest.len(), name, value);
        self.fields
    }
}

/// The fields of a data unit of Set_Prm.
pub fn set_prm(du: &[u8]) -> Vec<Field> {
    let mut cutter = Cutter::new(1, du);
    let Ok(prm) = SetPrm::parse(du) else { return cutter.end("Set_Prm", "too short to be one") };
    let ms = u32::from(prm.watchdog_base_ms());
    let watchdog = prm.watchdog_units().map_or("off".to_owned(), |units| format!("{} ms", u32::from(units) * ms));
    cutter.take(1, "Station_Status", prm.status.to_string());
    cutter.take(1, "WD_Fact_1", prm.wd_fact_1.to_string());
    cutter.take(1, "WD_Fact_2", format!("{}; watchdog {watchdog}", prm.wd_fact_2));
    cutter.take(1, "min_TSDR", format!("{} tbit", prm.min_tsdr));
    cutter.take(2, "Ident_Number", format!("{:04X}", prm.ident));
    cutter.take(1, "Group_Ident", groups(prm.group));
    let [one, two, three] = prm.dpv1.octets();
    for (name, octets) in
        [("DPV1_Status_1", [one, 0, 0]), ("DPV1_Status_2", [0, two, 0]), ("DPV1_Status_3", [0, 0, three])]
    {
        cutter.take(1, name, DpV1Status::from_octets(octets).to_string());
    }
    for block in prm.blocks().flatten() {
        block_fields(&mut cutter, &block);
    }
    cutter.end("user parameters", "")
}

/// `group 8, the clock's`.
fn groups(group: u8) -> String {
    let all: Vec<_> = (0..8).filter(|bit| group & (1 << bit) != 0).map(|bit| (bit + 1).to_string()).collect();
    match (all.is_empty(), group & 0x80 != 0) {
        (true, _) => "no group".to_owned(),
        (_, true) => format!("group {} (8 is the clock's)", all.join(", ")),
        (_, false) => format!("group {}", all.join(", ")),
    }
}

fn block_fields(cutter: &mut Cutter<'_>, block: &Block<'_>) {
    let length = block.data.len() + 4;
    cutter.take(1, format!("{} block: length", block.kind), format!("{length} octets"));
    cutter.take(1, "  type", format!("{:02X}, {}", block.kind.code(), block.kind));
    cutter.take(1, "  slot", block.slot.to_string());
    cutter.take(1, "  specifier", block.specifier.to_string());
    match block.kind {
        BlockType::User => {
            if let Ok(user) = UserPrm81::parse(block) {
                return user_fields(cutter, &user);
            }
        }
        BlockType::IsoM => {
            if let Ok(iso) = IsoM::parse(block) {
                return iso_fields(cutter, &iso);
            }
        }
        BlockType::DxbLinks => {
            if let Ok(links) = DxbLinks::parse(block) {
                return link_fields(cutter, &links);
            }
        }
        BlockType::DxbSubscriptions => {
            if let Ok(subscriptions) = DxbSubscriptions::parse(block) {
                return subscription_fields(cutter, &subscriptions);
            }
        }
        _ => {}
    }
    cutter.take(block.data.len(), "  data", "");
}

fn user_fields(cutter: &mut Cutter<'_>, user: &UserPrm81) {
    let options = user.options;
    let on_off = |on| if on { "on" } else { "off" };
    let sequence = if options.has(EncoderOptions::COUNTER_CLOCKWISE) { "CCW" } else { "CW" };
    cutter.take(
        1,
        "  options",
        format!(
            "code sequence {sequence} (bit 0), scaling/preset/direction {} (bit 1), scaling function {} (bit 3)",
            on_off(options.has(EncoderOptions::ACTIVATE)),
            on_off(options.has(EncoderOptions::SCALING))
        ),
    );
    cutter.take(4, "  units per revolution", format!("{} counts", user.units_per_revolution));
    cutter.take(4, "  total measuring range", format!("{} counts", user.total_range));
    cutter.take(1, "  tolerated failures of the sign of life", user.max_failures.to_string());
    cutter.take(7, "  reserved", "");
}

fn iso_fields(cutter: &mut Cutter<'_>, iso: &IsoM) {
    let time = |units: u64| Span::from_iso_units(units.min(u32::MAX.into()) as u32);
    let of = |number: u16, base: u32| {
        format!("{number} x {} = {}", time(base.into()), time(u64::from(number) * u64::from(base)))
    };
    let units = |number: u32| format!("{number} x 1/12 us = {}", time(number.into()));
    cutter.take(1, "  version", iso.version.to_string());
    cutter.take(4, "  T_BASE_DP", units(iso.t_base_dp));
    cutter.take(2, "  T_DP", of(iso.t_dp, iso.t_base_dp));
    cutter.take(1, "  T_MAPC", format!("{} x T_DP", iso.t_mapc));
    cutter.take(4, "  T_BASE_IO", units(iso.t_base_io));
    cutter.take(2, "  T_I", of(iso.t_i, iso.t_base_io));
    cutter.take(2, "  T_O", of(iso.t_o, iso.t_base_io));
    cutter.take(4, "  T_DX", units(iso.t_dx));
    cutter.take(2, "  T_PLL_W", units(iso.t_pll_w.into()));
    cutter.take(2, "  T_PLL_D", units(iso.t_pll_d.into()));
}

fn link_fields(cutter: &mut Cutter<'_>, links: &DxbLinks<'_>) {
    cutter.take(1, "  version", "1");
    for link in links.iter() {
        cutter.take(1, "  publisher", format!("slave {}", link.publisher));
        cutter.take(1, "    its inputs", format!("{} octets", link.length));
        cutter.take(1, "    sample from", format!("octet {}", link.offset));
        cutter.take(1, "    sample length", format!("{} octets", link.sample));
    }
}

fn subscription_fields(cutter: &mut Cutter<'_>, subscriptions: &DxbSubscriptions<'_>) {
    cutter.take(1, "  version", "1");
    for entry in subscriptions.iter() {
        cutter.take(1, "  publisher", format!("slave {}", entry.link.publisher));
        cutter.take(1, "    its inputs", format!("{} octets", entry.link.length));
        cutter.take(1, "    sample from", format!("octet {}", entry.link.offset));
        cutter.take(1, "    to slot", entry.slot.to_string());
        cutter.take(1, "    to", format!("octet {}", entry.destination));
        cutter.take(1, "    sample length", format!("{} octets", entry.link.sample));
    }
}

/// The fields of a data unit of Chk_Cfg.
pub fn chk_cfg(du: &[u8]) -> Vec<Field> {
    let mut cutter = Cutter::new(1, du);
    while let Some(&identifier) = cutter.rest.first() {
        if identifier & 0x30 != 0 {
            let directions = ["", "inputs", "outputs", "inputs and outputs"][usize::from(identifier >> 4 & 3)];
            cutter.take(1, "identifier", format!("{directions}: {}", length(identifier, 0x0F)));
            continue;
        }
        let (outputs, inputs) = (identifier & 0x80 != 0, identifier & 0x40 != 0);
        let makers = usize::from(identifier & 0x0F);
        let makers = if makers == 0x0F { 0 } else { makers };
        cutter.take(1, "special identifier", format!("{makers} octets of the manufacturer at the end"));
        for (_, name) in [(outputs, "  outputs"), (inputs, "  inputs")].into_iter().filter(|part| part.0) {
            let octet = cutter.rest.first().copied().unwrap_or_default();
            cutter.take(1, name, length(octet, 0x3F));
        }
        let octets = cutter.rest.get(..makers).unwrap_or(cutter.rest);
        let what = match octets {
            [0xFD, high, low] => format!("PROFIdrive, telegram {}", u16::from_be_bytes([*high, *low])),
            _ => String::new(),
        };
        cutter.take(makers, "  manufacturer", what);
    }
    cutter.fields
}

/// `2 words, consistent`: a length octet of Chk_Cfg, bits 7 and 6 and those of `mask`.
fn length(octet: u8, mask: u8) -> String {
    let count = (octet & mask) + 1;
    let unit = if octet & 0x40 != 0 { "word" } else { "octet" };
    let consistent = if octet & 0x80 != 0 { ", consistent" } else { "" };
    format!("{count} {unit}{}{consistent}", if count == 1 { "" } else { "s" })
}

/// Every telegram of every configured slave as text: the first slave of each kind in full, of the others what differs.
/// With `only`, this slave in full and no other.
pub fn text(scenario: &Scenario, only: Option<Address>) -> String {
    let mut lines = Vec::new();
    let mut shown: Vec<(&Slave, [Written; 2])> = Vec::new();
    for slave in scenario.configured().filter(|slave| only.is_none_or(|only| only == slave.address)) {
        let own = telegrams(scenario, slave);
        let like = shown.iter().find(|(other, written)| other.device == slave.device && alike(written, &own));
        for (number, written) in own.iter().enumerate() {
            match like {
                Some((other, all)) => differences(&mut lines, written, other.address, &all[number]),
                None => in_full(&mut lines, written),
            }
        }
        if like.is_none() {
            shown.push((slave, own));
        }
    }
    lines.iter().flat_map(|line: &String| [line.trim_end(), "\n"]).collect()
}

/// Whether two slaves' telegrams have the same fields.
fn alike(a: &[Written; 2], b: &[Written; 2]) -> bool {
    let shape = |written: &[Written; 2]| -> Vec<_> {
        written.iter().flat_map(|one| &one.fields).map(|field| (field.first, field.octets.len())).collect()
    };
    shape(a) == shape(b)
}

fn in_full(lines: &mut Vec<String>, written: &Written) {
    lines.push(format!("{} to slave {}", written.name, written.slave));
    let width = written.fields.iter().map(|field| field.name.chars().count()).max().unwrap_or(0);
    for field in &written.fields {
        let (place, octets) = (field.place(), hex(&field.octets));
        lines.push(format!("  {place:>8}  {octets:<20}  {:<width$}  {}", field.name, field.value));
    }
    ends(lines, written);
}

fn differences(lines: &mut Vec<String>, written: &Written, other: Address, of: &Written) {
    let differ: Vec<_> = written.fields.iter().zip(&of.fields).filter(|(own, other)| own != other).collect();
    let as_slave = if differ.is_empty() { "as" } else { "as but for the octets below" };
    lines.push(format!("{} to slave {}: {as_slave} to slave {other}", written.name, written.slave));
    for (field, _) in differ {
        lines.push(format!(
            "  {:>8}  {:<20}  {}  {}",
            field.place(),
            hex(&field.octets),
            field.name.trim(),
            field.value
        ));
    }
    ends(lines, written);
}

fn ends(lines: &mut Vec<String>, written: &Written) {
    lines.push(format!("  data unit: {}", hex(&written.du())));
    lines.push(format!("  telegram:  {}", hex(&written.telegram)));
    lines.push(String::new());
}
