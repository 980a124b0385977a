//! From lines of words to what a GSD file says.
//!
//! The crate `gsd-parser` reads modules, slots, bit rates and user parameters. It knows nothing of isochronous mode, DPV1
//! and slave-to-slave communication, and it panics on values of another kind than it expects. So every statement is
//! checked here first; the crate gets only what it understands, written anew, and this module keeps the rest.

use super::Wrong;
use super::keywords::{self, Keyword, Shape};
use super::lex::{At, Kind, Line, Token};
use crate::device::profile::MAX_PRM;
use gsd_parser::GenericStationDescription;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::Path;

/// The value of a keyword.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Value {
    Number(u32),
    Text(String),
}

/// What a file says, and what it says besides.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct File {
    /// Values by their keyword as [`keywords::KEYWORDS`] writes it, with their places.
    pub(super) values: BTreeMap<&'static str, (Value, At)>,
    /// Where each module begins, in the order of the description's.
    pub(super) modules: Vec<At>,
    /// Keywords without an effect, each with its line.
    pub(super) ignored: Vec<(String, usize)>,
    /// Keywords that were there before, each with its line.
    pub(super) repeated: Vec<(&'static str, usize)>,
    /// User_Prm_Data, for devices without extended user parameters.
    pub(super) user_prm_data: Option<Vec<u8>>,
    /// What the crate made of it.
    pub(super) description: GenericStationDescription,
}

/// Blocks without an effect: where they begin and end.
const SKIPPED: &[(&str, &str)] = &[
    ("UnitDiagType", "EndUnitDiagType"),
    ("Unit_Diag_Area", "Unit_Diag_Area_End"),
    ("X_Unit_Diag_Area", "X_Unit_Diag_Area_End"),
    ("Version_Firmware_Download", "End_Version_Firmware_Download"),
    ("Physical_Interface", "End_Physical_Interface"),
    ("Jokerblock_Type", "End_Jokerblock_Type"),
    ("Data_Area_Beg", "Data_Area_End"),
];
/// Data types of user parameters besides Bit and BitArea.
const DATA_TYPES: [&str; 6] = ["Unsigned8", "Unsigned16", "Unsigned32", "Signed8", "Signed16", "Signed32"];

/// Most comparisons that the crate may need to find the modules of slots.
const MOST_SEARCHES: usize = 400_000_000;

/// What must come before what in the text for the crate.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Part {
    Texts,
    Data,
    Settings,
    Slots,
}

/// Reads the statements of a file.
pub(super) fn read(lines: &[Line]) -> Result<File, Wrong> {
    let mut reader = Reader { lines, next: 0, ..Reader::default() };
    while let Some(line) = reader.take() {
        reader.statement(line)?;
    }
    reader.finish()
}

#[derive(Default)]
struct Reader<'a> {
    lines: &'a [Line],
    next: usize,
    values: BTreeMap<&'static str, (Value, At)>,
    modules: Vec<At>,
    ignored: Vec<(String, usize)>,
    repeated: Vec<(&'static str, usize)>,
    user_prm_data: Option<Vec<u8>>,
    /// The text for the crate.
    clean: Vec<(Part, String)>,
    /// What is there, and what is asked for.
    texts: BTreeSet<u32>,
    text_refs: Vec<(u32, At)>,
    data: BTreeSet<u32>,
    data_refs: Vec<(u32, At)>,
    references: BTreeSet<u32>,
    slots: Vec<Slot>,
}

impl<'a> Reader<'a> {
    fn take(&mut self) -> Option<&'a Line> {
        let line = self.lines.get(self.next)?;
        self.next += 1;
        Some(line)
    }
    fn write(&mut self, part: Part, text: String) {
        self.clean.push((part, text));
    }
    fn ignore(&mut self, token: &Token) {
        self.ignored.push((token.text.clone(), token.at.line));
    }
    /// The lines up to the one that begins with `end`, which is passed over; `begin` is to blame if there is none.
    fn block(&mut self, begin: &Token, end: &str) -> Result<&'a [Line], Wrong> {
        let rest = &self.lines[self.next..];
        let stop = rest.iter().position(|line| line[0].is_keyword(end) || line[0].is_keyword(&begin.text));
        let Some(length) = stop.filter(|&at| rest[at][0].is_keyword(end)) else {
            return Err(Wrong::at(begin.at, format!("{} without {end}", begin.text))
                .rule(format!("a block that {} begins ends with {end} (GSD specification)", begin.text))
                .help("is the file complete?"));
        };
        self.next += length + 1;
        Ok(&rest[..length])
    }

    fn statement(&mut self, line: &'a Line) -> Result<(), Wrong> {
        let first = &line[0];
        if first.is_keyword("PrmText") {
            self.prm_text(line)
        } else if first.is_keyword("ExtUserPrmData") {
            self.ext_user_prm_data(line)
        } else if first.is_keyword("Module") {
            self.module(line)
        } else if first.is_keyword("SlotDefinition") {
            self.slot_definition(first)
        } else if let Some((_, end)) = SKIPPED.iter().find(|(begin, _)| first.is_keyword(begin)) {
            self.ignore(first);
            self.block(first, end).map(|_| ())
        } else if line.iter().take_while(|token| token.kind == Kind::Word).count() > 1 && line.iter().any(|t| t.is("="))
        {
            // Real files have keywords in two words, such as "24V Pins".
            self.ignored.push((format!("{} {}", first.text, line[1].text), first.at.line));
            Ok(())
        } else {
            let setting = Setting::of(line)?;
            if !self.user_prm(&setting)? {
                self.setting(&setting)?;
            }
            Ok(())
        }
    }

    /// A keyword of the whole device.
    fn setting(&mut self, setting: &Setting<'_>) -> Result<(), Wrong> {
        let Some(keyword) = keywords::find(&setting.key.text).filter(|_| setting.index.is_empty()) else {
            self.ignore(setting.key);
            return Ok(());
        };
        let value = setting.value(keyword)?;
        if keyword.shared {
            let shown = match &value {
                Value::Number(number) => number.to_string(),
                Value::Text(text) => format!("\"{text}\""),
            };
            self.write(Part::Settings, format!("{}={shown}", keyword.name));
        }
        if self.values.insert(keyword.name, (value, setting.key.at)).is_some() {
            self.repeated.push((keyword.name, setting.key.at.line));
        }
        Ok(())
    }

    /// A keyword about user parameters, of the whole device or of a module; whether it is one.
    fn user_prm(&mut self, setting: &Setting<'_>) -> Result<bool, Wrong> {
        let key = setting.key;
        if key.is_keyword("Ext_User_Prm_Data_Const") {
            let (offset, octets) = (setting.offset()?, setting.octets()?);
            if offset as usize + octets.len() > usize::from(MAX_PRM) {
                return Err(beyond(key.at));
            }
            self.write(Part::Settings, format!("Ext_User_Prm_Data_Const({offset})={}", list(&octets)));
        } else if key.is_keyword("Ext_User_Prm_Data_Ref") {
            let (offset, id) = (setting.offset()?, setting.number(u32::MAX)?);
            self.data_refs.push((id, setting.values[0].at));
            self.write(Part::Settings, format!("Ext_User_Prm_Data_Ref({offset})={id}"));
        } else if key.is_keyword("User_Prm_Data") {
            // The crate has no use for it beside extended user parameters.
            let octets = setting.octets()?;
            if octets.len() > usize::from(MAX_PRM) {
                return Err(beyond(key.at));
            }
            self.user_prm_data = Some(octets);
        } else {
            return Ok(false);
        }
        Ok(true)
    }

    /// `PrmText = 1`, lines `Text(0) = "..."`, `EndPrmText`.
    fn prm_text(&mut self, line: &'a Line) -> Result<(), Wrong> {
        let id = Setting::of(line)?.number(0xFFFF)?;
        let rows = self.block(&line[0], "EndPrmText")?;
        let mut texts = Vec::new();
        for row in rows {
            let setting = Setting::of(row)?;
            if !setting.key.is_keyword("Text") {
                self.ignore(setting.key);
                continue;
            }
            let number = signed(setting.index, setting.key)?;
            texts.push(format!("Text({number})=\"{}\"", setting.text()?));
        }
        if texts.is_empty() {
            return Err(Wrong::at(line[0].at, "a PrmText without Text").help("add lines such as Text(0) = \"off\""));
        }
        self.texts.insert(id);
        self.write(Part::Texts, format!("PrmText={id}\n{}\nEndPrmText", texts.join("\n")));
        Ok(())
    }

    /// `ExtUserPrmData = 1 "name"`, the line of its type, Prm_Text_Ref and others, `EndExtUserPrmData`.
    fn ext_user_prm_data(&mut self, line: &'a Line) -> Result<(), Wrong> {
        let setting = Setting::of(line)?;
        let example =
            || Wrong::at(line[0].at, "no number and name").help("such as ExtUserPrmData = 1 \"Code sequence\"");
        let [numbers @ .., name] = setting.values else { return Err(example()) };
        if name.kind != Kind::Text {
            return Err(example());
        }
        let id = unsigned(numbers, &line[0], u32::MAX)?;
        let rows = self.block(&line[0], "EndExtUserPrmData")?;
        let (mut kind, mut attributes) = (None, [None, None, None]);
        for row in rows {
            let at = ["Prm_Text_Ref", "Changeable", "Visible"].iter().position(|name| row[0].is_keyword(name));
            if let Some(at) = at {
                let number = Setting::of(row)?.number(0xFFFF)?;
                if at == 0 {
                    self.text_refs.push((number, row[0].at));
                }
                attributes[at] = Some(format!("{}={number}\n", row[0].text));
            } else if kind.is_none() {
                kind = Some(data_type(row)?);
            } else {
                self.ignore(&row[0]);
            }
        }
        let Some(kind) = kind else {
            return Err(Wrong::at(line[0].at, "a parameter without data type").help("such as Unsigned8 0 0-255"));
        };
        self.data.insert(id);
        let attributes: String = attributes.into_iter().flatten().collect();
        let text = format!("ExtUserPrmData={id} \"{}\"\n{kind}\n{attributes}EndExtUserPrmData", name.text);
        self.write(Part::Data, text);
        Ok(())
    }

    /// `Module = "name" 0xC3, ...`, its number, its user parameters, `EndModule`.
    fn module(&mut self, line: &'a Line) -> Result<(), Wrong> {
        let setting = Setting::of(line)?;
        let (name, octets) = match setting.values {
            [name, octets @ ..] if name.kind == Kind::Text && !octets.is_empty() => {
                (name, octet_list(octets, &line[0])?)
            }
            _ => {
                return Err(Wrong::at(line[0].at, "no name with its octets of Chk_Cfg")
                    .help("such as Module = \"Telegram 81\" 0xC3,0xC1,0xC5,0xFD,0x00,0x51"));
            }
        };
        let rows = self.block(&line[0], "EndModule")?;
        let end = self.next;
        self.modules.push(line[0].at);
        self.write(Part::Settings, format!("Module=\"{}\" {}", name.text, list(&octets)));
        // The crate wants the number first.
        if let Some(row) = rows.iter().find(|row| is_number(row)) {
            let reference = unsigned(row, &row[0], u32::MAX)?;
            if self.references.insert(reference) {
                self.write(Part::Settings, reference.to_string());
            }
        }
        self.next = end - rows.len() - 1;
        while self.next + 1 < end {
            let Some(row) = self.take() else { break };
            self.in_module(row)?;
        }
        if self.next + 1 > end {
            return Err(Wrong::at(line[0].at, "a block begins in this module and ends behind it"));
        }
        self.next = end;
        self.write(Part::Settings, "EndModule".to_owned());
        Ok(())
    }
    /// One line of a module.
    fn in_module(&mut self, row: &'a Line) -> Result<(), Wrong> {
        let first = &row[0];
        if let Some((_, end)) = SKIPPED.iter().find(|(begin, _)| first.is_keyword(begin)) {
            self.ignore(first);
            return self.block(first, end).map(|_| ());
        }
        if is_number(row) {
            return Ok(());
        }
        let setting = Setting::of(row)?;
        if !self.user_prm(&setting)? {
            self.ignore(first);
        }
        Ok(())
    }

    /// Lines `Slot(1) = "name" 1 1-3` or `... 1 1,2,3` up to `EndSlotDefinition`.
    fn slot_definition(&mut self, first: &Token) -> Result<(), Wrong> {
        for row in self.block(first, "EndSlotDefinition")? {
            let setting = Setting::of(row)?;
            let wrong = || Wrong::at(row[0].at, "no slot").help("such as Slot(1) = \"name\" 1 1-3");
            let number = unsigned(setting.index, setting.key, 0xFF)?;
            let [name, default, allowed @ ..] = setting.values else { return Err(wrong()) };
            if !setting.key.is_keyword("Slot") || name.kind != Kind::Text || allowed.is_empty() {
                return Err(wrong());
            }
            let preset = unsigned(std::slice::from_ref(default), default, 0xFFFF)?;
            let allowed = Choice::of(allowed, default, 0..=0xFFFF)?;
            self.slots.push(Slot { number, name: name.text.clone(), preset, at: default.at, allowed });
        }
        Ok(())
    }
    /// The slots for the crate, with the modules that are there instead of ranges.
    fn write_slots(&mut self) -> Result<(), Wrong> {
        let mut lines = Vec::new();
        let mut entries = 0;
        for slot in std::mem::take(&mut self.slots) {
            if !self.references.contains(&slot.preset) {
                return Err(missing("module", slot.preset, slot.at));
            }
            let mut allowed: Vec<u32> = match slot.allowed {
                Choice::Range(low, high) => {
                    let there = |number: &i64| *number >= low && *number <= high;
                    self.references.iter().copied().filter(|&number| there(&number.into())).collect()
                }
                Choice::Set(numbers) => numbers.iter().map(|&number| number as u32).collect(),
            };
            if allowed.is_empty() {
                allowed.push(slot.preset);
            }
            entries += allowed.len();
            if entries * self.references.len() > MOST_SEARCHES {
                return Err(Wrong::at(slot.at, "too many slots for too many modules"));
            }
            let allowed = allowed.iter().map(u32::to_string).collect::<Vec<_>>().join(",");
            lines.push(format!("Slot({})=\"{}\" {} {allowed}", slot.number, slot.name, slot.preset));
        }
        if !lines.is_empty() {
            self.write(Part::Slots, format!("SlotDefinition\n{}\nEndSlotDefinition", lines.join("\n")));
        }
        Ok(())
    }

    /// Compares what is asked for with what is there, and lets the crate read.
    fn finish(mut self) -> Result<File, Wrong> {
        let asked = [("PrmText", &self.texts, &self.text_refs), ("ExtUserPrmData", &self.data, &self.data_refs)];
        for (what, there, refs) in asked {
            if let Some((id, at)) = refs.iter().find(|(id, _)| !there.contains(id)) {
                return Err(missing(what, *id, *at));
            }
        }
        self.write_slots()?;
        self.clean.sort_by_key(|&(part, _)| part);
        let lines: Vec<_> = self.clean.into_iter().map(|(_, text)| text).collect();
        if lines.is_empty() {
            return Err(Wrong::of_file("this file describes nothing").help("is it complete?"));
        }
        let clean = format!("#Profibus_DP\n{}\n", lines.join("\n"));
        let description = gsd_parser::parser::parse(Path::new(""), &clean).map_err(|error| {
            let message = error.variant.message().into_owned();
            Wrong::of_file(format!("{message}: {}", error.line().trim())).help("is the file complete?")
        })?;
        Ok(File {
            values: self.values,
            modules: self.modules,
            ignored: self.ignored,
            repeated: self.repeated,
            user_prm_data: self.user_prm_data,
            description,
        })
    }
}

/// A slot and the modules that may be in it.
struct Slot {
    number: u32,
    name: String,
    preset: u32,
    /// Where the file says the preset.
    at: At,
    allowed: Choice,
}

fn missing(what: &str, id: u32, at: At) -> Wrong {
    Wrong::at(at, format!("there is no {what} {id}")).help("is the file complete?")
}

/// `Key = values` or `Key(index) = values`.
struct Setting<'a> {
    key: &'a Token,
    /// Between the brackets.
    index: &'a [Token],
    values: &'a [Token],
}

impl<'a> Setting<'a> {
    fn of(line: &'a Line) -> Result<Self, Wrong> {
        let key = &line[0];
        let equals = line.iter().position(|token| token.is("="));
        let (index, values) = match equals {
            Some(1) => (&[][..], &line[2..]),
            Some(at) if at > 3 && line[1].is("(") && line[at - 1].is(")") => (&line[2..at - 1], &line[at + 1..]),
            _ => return Err(no_statement(key)),
        };
        if key.kind != Kind::Word {
            return Err(no_statement(key));
        }
        Ok(Self { key, index, values })
    }
    /// The value, as `keyword` wants it.
    fn value(&self, keyword: &Keyword) -> Result<Value, Wrong> {
        match keyword.shape {
            Shape::Flag => self.number(u32::MAX).map(|number| Value::Number(number.min(1))),
            Shape::Number(max) => self.number(max).map(Value::Number),
            Shape::Text => self.text().map(|text| Value::Text(text.trim().to_owned())),
        }
    }
    fn number(&self, max: u32) -> Result<u32, Wrong> {
        unsigned(self.values, self.key, max)
    }
    fn text(&self) -> Result<&'a str, Wrong> {
        match self.values {
            [Token { kind: Kind::Text, text, .. }] => Ok(text),
            [other, ..] => Err(Wrong::at(other.at, "this is no text").help("write it in quotation marks")),
            [] => Err(Wrong::at(self.key.at, format!("{} has no value", self.key.text)).help("add a text in quotes")),
        }
    }
    fn octets(&self) -> Result<Vec<u8>, Wrong> {
        octet_list(self.values, self.key)
    }
    /// Where in the user parameters it is about.
    fn offset(&self) -> Result<u32, Wrong> {
        if self.index.is_empty() {
            let help = format!("such as {}(0) = 1", self.key.text);
            return Err(Wrong::at(self.key.at, format!("{} does not say where", self.key.text)).help(help));
        }
        let offset = unsigned(self.index, self.key, u32::MAX)?;
        if offset < u32::from(MAX_PRM) { Ok(offset) } else { Err(beyond(self.index[0].at)) }
    }
}

/// Whether a line is a number alone.
fn is_number(line: &Line) -> bool {
    line.len() == 1 && line[0].text.starts_with(|c: char| c.is_ascii_digit())
}

fn no_statement(token: &Token) -> Wrong {
    Wrong::at(token.at, "this is no statement")
        .rule("a line is KEYWORD = VALUE, or begins or ends a block (GSD specification)")
        .help("comments begin with a semicolon; is the file complete?")
}

fn beyond(at: At) -> Wrong {
    Wrong::at(at, "these user parameters do not fit into Set_Prm")
        .rule(format!("Set_Prm has {MAX_PRM} octets behind octet 7 at most (EN 50170-2)"))
        .help("is the number in brackets right?")
}

/// The whole number that `tokens` are; `key` is to blame if there are none.
fn signed(tokens: &[Token], key: &Token) -> Result<i64, Wrong> {
    let (negative, token) = match tokens {
        [sign, token] if sign.is("-") => (true, token),
        [token] => (false, token),
        [other, ..] => return Err(Wrong::at(other.at, "this is not one whole number").help("such as 12 or 0x0C")),
        [] => return Err(Wrong::at(key.at, format!("{} has no value", key.text)).help("a whole number belongs here")),
    };
    let hex = token.text.strip_prefix("0x").or_else(|| token.text.strip_prefix("0X"));
    let digits = |text: &str, radix| u32::from_str_radix(text, radix).ok().filter(|_| !text.starts_with('+'));
    let number = hex.map_or_else(|| digits(&token.text, 10), |hex| digits(hex, 16));
    match number.filter(|_| token.kind == Kind::Word) {
        Some(number) => Ok(if negative { -i64::from(number) } else { number.into() }),
        None => Err(Wrong::at(token.at, "this is no whole number").help("such as 12 or 0x0C, at most 4294967295")),
    }
}

/// The whole number from 0 to `max` that `tokens` are.
fn unsigned(tokens: &[Token], key: &Token, max: u32) -> Result<u32, Wrong> {
    let number = signed(tokens, key)?;
    u32::try_from(number).ok().filter(|&number| number <= max).ok_or_else(|| {
        let at = tokens.first().map_or(key.at, |token| token.at);
        Wrong::at(at, format!("{number} is out of range")).help(format!("{} is 0 to {max}", key.text))
    })
}

/// Octets with commas between them; one too many at the end does no harm.
fn octet_list(tokens: &[Token], key: &Token) -> Result<Vec<u8>, Wrong> {
    let tokens = match tokens {
        [rest @ .., comma] if comma.is(",") => rest,
        all => all,
    };
    tokens.split(|token| token.is(",")).map(|part| unsigned(part, key, 0xFF).map(|octet| octet as u8)).collect()
}

fn list(octets: &[u8]) -> String {
    octets.iter().map(u8::to_string).collect::<Vec<_>>().join(",")
}

/// Values to choose from: `0-255` or `0,1,5`.
enum Choice {
    Range(i64, i64),
    Set(Vec<i64>),
}

impl Choice {
    fn of(tokens: &[Token], key: &Token, range: std::ops::RangeInclusive<i64>) -> Result<Self, Wrong> {
        let within = |part: &[Token]| {
            let number = signed(part, key)?;
            let at = part.first().map_or(key.at, |token| token.at);
            if range.contains(&number) { Ok(number) } else { Err(Wrong::at(at, format!("{number} is out of range"))) }
        };
        // The sign in the middle is the one after a number.
        let middle = (1..tokens.len()).find(|&at| tokens[at].is("-") && tokens[at - 1].kind == Kind::Word);
        match middle {
            Some(at) => Ok(Self::Range(within(&tokens[..at])?, within(&tokens[at + 1..])?)),
            None => tokens.split(|token| token.is(",")).map(within).collect::<Result<_, _>>().map(Self::Set),
        }
    }
}
impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Range(low, high) => write!(f, "{low}-{high}"),
            Self::Set(values) => f.write_str(&values.iter().map(i64::to_string).collect::<Vec<_>>().join(",")),
        }
    }
}

/// The line of a parameter's type, `Unsigned8 0 0-255`, `Bit(1) 0 0-1` or `BitArea(2-3) 0 0,1,2`, for the crate.
fn data_type(row: &Line) -> Result<String, Wrong> {
    let first = &row[0];
    let bit = |tokens: &[Token]| {
        let number = unsigned(tokens, first, u32::MAX)?;
        if number < 8 { Ok(number) } else { Err(Wrong::at(first.at, "an octet has the bits 0 to 7")) }
    };
    let close = row.iter().position(|token| token.is(")"));
    let (name, rest) = match (close, row.get(1)) {
        (Some(close), Some(open)) if open.is("(") => {
            let inner = &row[2..close.max(2)];
            let name = match inner.iter().position(|token| token.is("-")) {
                None if first.is_keyword("Bit") => format!("Bit({})", bit(inner)?),
                Some(at) if first.is_keyword("BitArea") => {
                    let (from, to) = (bit(&inner[..at])?, bit(&inner[at + 1..])?);
                    if from > to {
                        return Err(
                            Wrong::at(first.at, format!("no bits from {from} to {to}")).help("write the lower first")
                        );
                    }
                    format!("BitArea({from}-{to})")
                }
                _ => return Err(unknown_type(first)),
            };
            (name, &row[close + 1..])
        }
        _ => {
            let name = DATA_TYPES.iter().find(|name| first.is_keyword(name)).ok_or_else(|| unknown_type(first))?;
            ((*name).to_owned(), &row[1..])
        }
    };
    let length = if rest.first().is_some_and(|token| token.is("-")) { 2 } else { 1 };
    let (default, allowed) = rest.split_at(length.min(rest.len()));
    let default = signed(default, first)?;
    let limits = -i64::from(u32::MAX)..=u32::MAX.into();
    let allowed = if allowed.is_empty() { String::new() } else { Choice::of(allowed, first, limits)?.to_string() };
    Ok(format!("{name} {default} {allowed}"))
}

fn unknown_type(token: &Token) -> Wrong {
    Wrong::at(token.at, "there is no such data type")
        .help(format!("Bit(0), BitArea(0-3), {} with a default and a range", DATA_TYPES.join(", ")))
}
