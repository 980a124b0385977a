//! User parameters: the octets of Set_Prm that a GSD file presets, and their names.

use super::file::File;
use crate::device::profile::MAX_PRM;
use crate::study::scenario::{Fault, suggestion};
use crate::wire::prm::{BlockType, DpV1Status, SetPrm, UserPrm81};
use gsd_parser::{PrmValueConstraint, UserPrmData, UserPrmDataDefinition, UserPrmDataType};
use std::sync::Arc;

/// The user parameters of a device: octets of Set_Prm from octet 8 on, DPV1_Status first.
#[derive(Clone, PartialEq, Debug)]
pub struct UserPrm {
    octets: Vec<u8>,
    /// Where each named parameter begins in `octets`.
    named: Vec<(usize, Arc<UserPrmDataDefinition>)>,
}

/// Bits of one octet that a parameter fills.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Touched {
    /// Number of the octet in Set_Prm, from 1.
    pub octet: usize,
    /// Its bits.
    pub bits: u8,
}

/// Number of the first octet of user parameters in Set_Prm.
const FIRST: usize = 8;
/// Octets of DPV1_Status.
const STATUS: usize = 3;

impl UserPrm {
    /// What the file presets for the whole device and for a module, one after the other.
    pub(super) fn of(file: &File, module: Option<&UserPrmData>) -> Result<Self, Fault> {
        let mut prm = Self { octets: Vec::new(), named: Vec::new() };
        let device = &file.description.user_prm_data;
        if device.data_const.is_empty() && device.data_ref.is_empty() {
            prm.octets = file.user_prm_data.clone().unwrap_or_default();
        }
        prm.append(device, 0)?;
        let end = prm.octets.len().max(STATUS);
        prm.octets.resize(end, 0);
        if let Some(module) = module {
            prm.append(module, end)?;
        }
        Ok(prm)
    }

    /// Puts the parameters `data` at octet `from` and what follows.
    fn append(&mut self, data: &UserPrmData, from: usize) -> Result<(), Fault> {
        for (offset, octets) in &data.data_const {
            let at = from + offset;
            self.grow(at + octets.len())?;
            self.octets[at..at + octets.len()].copy_from_slice(octets);
        }
        for (offset, definition) in &data.data_ref {
            let at = from + offset;
            self.grow(at + definition.data_type.size())?;
            check(definition, definition.default_value, false)?;
            write(definition.data_type, definition.default_value, &mut self.octets[at..]);
            self.named.push((at, definition.clone()));
        }
        Ok(())
    }
    fn grow(&mut self, length: usize) -> Result<(), Fault> {
        if length > MAX_PRM.into() {
            return Err(Fault::new(format!("user parameters of {length} octets do not fit into Set_Prm"))
                .rule(format!("Set_Prm has {MAX_PRM} octets behind octet 7 at most (EN 50170-2)")));
        }
        let length = length.max(self.octets.len());
        self.octets.resize(length, 0);
        Ok(())
    }

    /// The octets, from octet 8 of Set_Prm on.
    pub fn octets(&self) -> &[u8] {
        &self.octets
    }
    /// The parameters that have a name, with the number of their octet in Set_Prm.
    pub(super) fn named(&self) -> impl Iterator<Item = (usize, &UserPrmDataDefinition)> {
        self.named.iter().map(|(at, definition)| (FIRST + at, &**definition))
    }

    /// Sets the parameter `name` to a number.
    ///
    /// # Errors
    /// There is no such parameter, or it cannot have this value.
    pub fn set(&mut self, name: &str, value: i64) -> Result<Vec<Touched>, Fault> {
        let (at, definition) = self.find(name)?;
        check(&definition, value, true)?;
        write(definition.data_type, value, &mut self.octets[at..]);
        Ok(touched(definition.data_type, FIRST + at))
    }
    /// Sets the parameter `name` to the value that `text` stands for.
    ///
    /// # Errors
    /// There is no such parameter or text, or it cannot have this value.
    pub fn set_text(&mut self, name: &str, text: &str) -> Result<Vec<Touched>, Fault> {
        let (_, definition) = self.find(name)?;
        let Some(texts) = &definition.text_ref else {
            return Err(Fault::new(format!("\"{}\" has no texts", definition.name.trim()))
                .help(format!("a number, {}", allowed(&definition))));
        };
        let value = texts.iter().find(|(known, _)| same(known, text)).map(|(_, &value)| value);
        match value {
            Some(value) => self.set(name, value),
            None => Err(Fault::new(format!("\"{}\" cannot be \"{}\"", definition.name.trim(), short(text)))
                .help(suggestion(text, texts.keys().map(|text| text.trim())))),
        }
    }
    fn find(&self, name: &str) -> Result<(usize, Arc<UserPrmDataDefinition>), Fault> {
        let mut found = self.named.iter().filter(|(_, definition)| same(&definition.name, name));
        match (found.next(), found.next()) {
            (Some((at, definition)), None) => Ok((*at, definition.clone())),
            (Some(_), Some(_)) => Err(Fault::new(format!("the GSD file has two user parameters \"{}\"", short(name)))
                .help("their names do not tell them apart, so neither can be set")),
            _ if self.named.is_empty() => Err(Fault::new("the GSD file has no user parameters with names")),
            _ => Err(Fault::new(format!("the GSD file has no user parameter \"{}\"", short(name)))
                .help(suggestion(name, self.named.iter().map(|(_, definition)| definition.name.trim())))),
        }
    }

    /// Where the encoders' user block begins in these octets; `None` if there are no blocks at all.
    ///
    /// # Errors
    /// The octets behind DPV1_Status are no blocks, or other ones.
    pub fn encoder_block(&self) -> Result<Option<usize>, Fault> {
        let mut found = None;
        for (octet, kind, length) in self.blocks()? {
            if kind != BlockType::User || length != UserPrm81::LEN || found.is_some() {
                return Err(Fault::new(format!("octet {octet} of Set_Prm begins a block of {length} octets: {kind}"))
                    .rule(format!("the user block of telegram 81 is one of {} octets (manual 3.1)", UserPrm81::LEN)));
            }
            found = Some(octet - FIRST);
        }
        Ok(found)
    }
    /// The blocks behind DPV1_Status: number of the first octet in Set_Prm, type, length.
    ///
    /// # Errors
    /// The octets are no blocks.
    pub(super) fn blocks(&self) -> Result<Vec<(usize, BlockType, usize)>, Fault> {
        let prm = SetPrm { dpv1: DpV1Status::PRM_STRUCTURE, blocks: &self.octets[STATUS..], ..SetPrm::default() };
        let block = |block: Result<crate::wire::prm::Block<'_>, _>| {
            block.map(|block| (block.octet, block.kind, 4 + block.data.len()))
        };
        prm.blocks().map(block).collect::<Result<_, _>>().map_err(|error: crate::wire::prm::PrmError| {
            Fault::new(format!("the preset user parameters are no blocks: {error}"))
                .rule("isochronous parameters are a block, and so is everything beside them (Prm_Block_Structure_supp)")
        })
    }
}

/// Whether two names are the same to a user.
fn same(a: &str, b: &str) -> bool {
    a.trim().to_lowercase() == b.trim().to_lowercase()
}
fn short(text: &str) -> String {
    text.chars().take(40).collect()
}

/// Asks for a value that the parameter can have; whether a user changes it makes a difference.
fn check(definition: &UserPrmDataDefinition, value: i64, change: bool) -> Result<(), Fault> {
    let name = definition.name.trim();
    let (low, high) = range(definition.data_type);
    if !(low..=high).contains(&value) {
        let fault = Fault::new(format!("\"{name}\" = {value} does not fit into its octets"));
        return Err(fault.rule(format!("its type holds {low} to {high}")));
    }
    if change && !definition.changeable {
        return Err(Fault::new(format!("\"{name}\" cannot be changed (Changeable = 0)")));
    }
    if change && !definition.constraint.is_valid(value) {
        return Err(Fault::new(format!("\"{name}\" cannot be {value}")).help(allowed(definition)));
    }
    Ok(())
}

/// The values that a type can hold.
const fn range(kind: UserPrmDataType) -> (i64, i64) {
    match kind {
        UserPrmDataType::Unsigned8 => (0, u8::MAX as i64),
        UserPrmDataType::Unsigned16 => (0, u16::MAX as i64),
        UserPrmDataType::Unsigned32 => (0, u32::MAX as i64),
        UserPrmDataType::Signed8 => (i8::MIN as i64, i8::MAX as i64),
        UserPrmDataType::Signed16 => (i16::MIN as i64, i16::MAX as i64),
        UserPrmDataType::Signed32 => (i32::MIN as i64, i32::MAX as i64),
        UserPrmDataType::Bit(_) => (0, 1),
        UserPrmDataType::BitArea(from, to) => (0, (1 << (to - from + 1)) - 1),
    }
}

/// What a parameter can be, in words.
pub(super) fn allowed(definition: &UserPrmDataDefinition) -> String {
    match &definition.constraint {
        PrmValueConstraint::MinMax(low, high) => format!("{low} to {high}"),
        PrmValueConstraint::Enum(values) => values.iter().map(i64::to_string).collect::<Vec<_>>().join(", "),
        PrmValueConstraint::Unconstrained => {
            let (low, high) = range(definition.data_type);
            format!("{low} to {high}")
        }
    }
}

/// The bits of a parameter, lowest bit and how many, if it shares its octet.
const fn bits(kind: UserPrmDataType) -> Option<(u8, u8)> {
    match kind {
        UserPrmDataType::Bit(bit) => Some((bit, 1)),
        UserPrmDataType::BitArea(from, to) => Some((from, to - from + 1)),
        _ => None,
    }
}
fn mask((from, count): (u8, u8)) -> u8 {
    (((1_u16 << count) - 1) << from) as u8
}

/// Writes `value`, which fits, to the first octets; other bits of a shared octet stay.
fn write(kind: UserPrmDataType, value: i64, octets: &mut [u8]) {
    if let Some(bits) = bits(kind) {
        octets[0] = octets[0] & !mask(bits) | ((value as u8) << bits.0) & mask(bits);
    } else {
        let size = kind.size();
        octets[..size].copy_from_slice(&value.to_be_bytes()[8 - size..]);
    }
}

/// The octets of Set_Prm that a parameter at `octet` fills.
fn touched(kind: UserPrmDataType, octet: usize) -> Vec<Touched> {
    match bits(kind) {
        Some(bits) => vec![Touched { octet, bits: mask(bits) }],
        None => (0..kind.size()).map(|i| Touched { octet: octet + i, bits: 0xFF }).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_fill_their_bits_and_leave_the_others() {
        let mut octets = [0b1010_0101, 0xFF, 0xFF, 0xFF, 0xFF];
        write(UserPrmDataType::Bit(1), 1, &mut octets);
        write(UserPrmDataType::Bit(0), 0, &mut octets);
        write(UserPrmDataType::BitArea(4, 6), 0b101, &mut octets);
        assert_eq!(octets[0], 0b1101_0110);
        write(UserPrmDataType::BitArea(0, 7), 0x5A, &mut octets);
        write(UserPrmDataType::Unsigned16, 0x0102, &mut octets[1..]);
        write(UserPrmDataType::Signed16, -2, &mut octets[3..]);
        assert_eq!(octets, [0x5A, 1, 2, 0xFF, 0xFE]);
        write(UserPrmDataType::Signed32, -2, &mut octets);
        write(UserPrmDataType::Signed8, -128, &mut octets[4..]);
        assert_eq!(octets, [0xFF, 0xFF, 0xFF, 0xFE, 0x80]);
    }

    #[test]
    fn types_hold_their_ranges() {
        assert_eq!(range(UserPrmDataType::BitArea(2, 4)), (0, 7));
        assert_eq!(range(UserPrmDataType::BitArea(0, 7)), (0, 255));
        assert_eq!(range(UserPrmDataType::Signed32), (-2_147_483_648, 2_147_483_647));
        assert_eq!(touched(UserPrmDataType::BitArea(2, 4), 15), [Touched { octet: 15, bits: 0b1_1100 }]);
        assert_eq!(touched(UserPrmDataType::Unsigned16, 18).len(), 2);
    }
}
