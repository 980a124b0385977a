//! `[[link]]`: slave-to-slave links, what a scenario says of them and how it is read.

use super::error::Fault;
use super::kinds::address;
use super::section::{Reader, Section, choice, number};
use super::tree::Value;
use crate::wire::Address;

/// One slave-to-slave link (manual 3.4).
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Link {
    /// Whose inputs.
    pub publisher: Address,
    /// Who takes them.
    pub subscriber: Address,
    /// Which table of Set_Prm says so.
    pub table: Table,
    /// Length of the publisher's data as that table says it (octets), for trying a wrong one; none is the right one.
    pub publisher_length: Option<u8>,
    /// What is taken, a sample at least.
    pub samples: Vec<Sample>,
}

/// A table of Set_Prm for links.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Table {
    /// The link table (block type 03): the device knows where samples go.
    Link,
    /// The subscriber table (block type 07): samples go to places in this slot's data area.
    Subscriber {
        /// The slot.
        slot: u8,
    },
}

/// Octets of a publisher's inputs that a subscriber takes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Sample {
    /// Where they begin in the publisher's inputs (octets).
    pub offset: u8,
    /// How many they are (octets).
    pub length: u8,
    /// Where they go in the slot's data area (octets); 0 and without meaning in the link table.
    pub to: u8,
}

impl Link {
    /// A link of one sample, in the link table.
    pub fn of(publisher: Address, subscriber: Address, offset: u8, length: u8) -> Self {
        let samples = vec![Sample { offset, length, to: 0 }];
        Self { publisher, subscriber, table: Table::Link, publisher_length: None, samples }
    }
    /// The slot that the samples go to; none in the link table.
    pub const fn slot(&self) -> Option<u8> {
        match self.table {
            Table::Link => None,
            Table::Subscriber { slot } => Some(slot),
        }
    }
}

/// The tables by their words.
const TABLES: &[(&str, Table)] = &[("link", Table::Link), ("subscriber", Table::Subscriber { slot: 1 })];

/// Reads one `[[link]]`.
pub(super) fn link(mut section: Section<'_>, reader: &mut Reader<'_>) -> Option<Link> {
    let s = &mut section;
    let publisher = s.required(reader, "publisher", "3", address);
    let subscriber = s.required(reader, "subscriber", "11", address);
    let table = s.optional(reader, "table", |node| choice(node, "table", TABLES, |row| row.0));
    // The longest data of a publisher (VPC3+ driver).
    let publisher_length = s.optional(reader, "publisher_length", number(1..=244));
    let slot = s.optional(reader, "slot", number(1..=u8::MAX));
    let table = match table.map_or(Table::Link, |row| row.1) {
        Table::Subscriber { slot: first } => Table::Subscriber { slot: slot.unwrap_or(first) },
        Table::Link => Table::Link,
    };
    let samples =
        if s.has("samples") { samples(s, reader, table) } else { one_sample(s, reader, table).map(|s| vec![s]) };
    if table == Table::Link && s.has("slot") {
        s.complain(reader, no_place("slot"));
    }
    section.finish(reader);
    Some(Link { publisher: publisher?, subscriber: subscriber?, table, publisher_length, samples: samples? })
}

/// The only sample, whose keys stand in the link itself: G1_XIST1 of telegram 81 if nothing is said (manual 2.2).
fn one_sample(section: &mut Section<'_>, reader: &mut Reader<'_>, table: Table) -> Option<Sample> {
    section.optional(reader, "samples", |_| Ok(()));
    let offset = section.optional(reader, "offset", number(0..=u8::MAX)).unwrap_or(4);
    let length = section.optional(reader, "length", number(0..=u8::MAX)).unwrap_or(4);
    Some(Sample { offset, length, to: to(section, reader, table, 0)? })
}

/// Several samples. One without a place goes behind the one before.
fn samples(section: &mut Section<'_>, reader: &mut Reader<'_>, table: Table) -> Option<Vec<Sample>> {
    const EXAMPLE: &str = "samples = [{ offset = 4, length = 4 }, { offset = 0, length = 2 }]";
    for key in ["offset", "length", "to"] {
        if section.optional(reader, key, |_| Ok(())).is_some() {
            let fault = Fault::new(format!("a link has either samples or {key}"));
            section.complain(reader, fault.help(EXAMPLE));
            return None;
        }
    }
    section.optional(reader, "samples", |node| match &node.value {
        Value::List(items) if items.is_empty() => Err(Fault::new("a link has a sample at least").help(EXAMPLE)),
        Value::List(items) if items.iter().all(|item| matches!(item.value, Value::Table(_))) => Ok(()),
        Value::List(_) => Err(Fault::new("a sample is a table").help(EXAMPLE)),
        other => Err(Fault::new(format!("this is {}", other.noun())).help(EXAMPLE)),
    })?;
    let Value::List(items) = &section.node("samples")?.value else { return None };
    let mut samples = Vec::with_capacity(items.len());
    let mut free = 0;
    for (i, item) in items.iter().enumerate() {
        let Value::Table(inner) = &item.value else { continue };
        let mut inner = Section::new(section.path_of(&format!("samples.{}", i + 1)), item.place, Some(inner));
        let offset = inner.required(reader, "offset", "4", number(0..=u8::MAX));
        let length = inner.required(reader, "length", "4", number(0..=u8::MAX));
        let to = to(&mut inner, reader, table, free);
        inner.finish(reader);
        let sample = Sample { offset: offset?, length: length?, to: to? };
        free = sample.to.saturating_add(sample.length);
        samples.push(sample);
    }
    Some(samples)
}

/// Where a sample goes: as it says, or to `free`. None if it says something that the table has no place for.
fn to(section: &mut Section<'_>, reader: &mut Reader<'_>, table: Table, free: u8) -> Option<u8> {
    let said = section.optional(reader, "to", number(0..=u8::MAX));
    match table {
        Table::Subscriber { .. } => Some(said.unwrap_or(free)),
        Table::Link if section.has("to") => {
            section.complain(reader, no_place("to"));
            None
        }
        Table::Link => Some(0),
    }
}

fn no_place(key: &str) -> Fault {
    Fault::new(format!("the link table has no {key}"))
        .rule("its samples go where the device has them; slot and place are the subscriber table's (VPC3+ driver)")
        .help(format!("table = \"subscriber\", or leave {key} out"))
}
