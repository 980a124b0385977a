//! Disturbances that put something on the line: noise, and telegrams of nobody.

use super::{DisturbanceKind, Key};
use crate::sim::fault::What;
use crate::sim::fault::source::{Emission, SourceFault};
use crate::study::scenario::error::Fault;
use crate::study::scenario::kinds::address;
use crate::study::scenario::section::{Reader, Section, instant, number, text};
use crate::study::scenario::tree::{Node, Value};
use crate::time::Span;
use crate::wire::{Address, Fcb, Frame, FrameControl, Header, MAX_FRAME, Sap, Service};

const NEAR: Key = Key { name: "near", unit: "address", default: "[master]", what: "at the place of this station" };
const AFTER: Key =
    Key { name: "after", unit: "time", default: "0 ns", what: "how long after each beginning; of a cycle after t0" };

/// Characters without sense.
pub(super) const NOISE: DisturbanceKind = DisturbanceKind {
    name: "noise",
    what: "characters without sense come onto the line, idle or not; one in four has a good parity and a stop bit",
    keys: &[
        Key {
            name: "mean",
            unit: "time",
            default: "once",
            what: "average time from one to the next, exponentially distributed; without it one at each beginning",
        },
        Key { name: "octets", unit: "number", default: "1", what: "how many characters, 1 to 255" },
        Key {
            name: "octets_to",
            unit: "number",
            default: "octets",
            what: "anything from octets to this many is equally likely",
        },
        NEAR,
        AFTER,
    ],
    example: r#"kind = "noise", mean = "1 ms", octets = 1, octets_to = 4, at = "1 s", for = "20 ms""#,
    read: |section, reader| {
        let mean = section.optional(reader, "mean", |node| match instant(node)? {
            Span::ZERO => Err(Fault::new("noise that never pauses is no noise").help("such as \"1 ms\"")),
            mean => Ok(mean),
        });
        let least = section.optional(reader, "octets", number(1..=MAX_FRAME as u8)).unwrap_or(1);
        let most = section.optional(reader, "octets_to", number(least..=MAX_FRAME as u8)).unwrap_or(least);
        let wrong = section.has("mean") && mean.is_none();
        source(section, reader, (!wrong).then_some(Emission::Noise { mean, octets: (least, most) }))
    },
};

/// A telegram of nobody.
pub(super) const FOREIGN_TELEGRAM: DisturbanceKind = DisturbanceKind {
    name: "foreign-telegram",
    what: "a telegram that no station has sent comes onto the line, once at each beginning",
    keys: &[
        Key { name: "octets", unit: "text", default: "one of them", what: "its characters as they are: \"DC 02 05\"" },
        Key { name: "token", unit: "table", default: "is needed", what: "the token: { to = 2, from = 5 }" },
        Key {
            name: "data",
            unit: "table",
            default: "",
            what: "a telegram with good sum: { to = 3, from = 2, fc = 0x7D, dsap = 60, ssap = 62, du = \"00 00\" }",
        },
        NEAR,
        AFTER,
    ],
    example: r#"kind = "foreign-telegram", token = { to = 2, from = 5 }, after = "900 us", cycle = 500, for = 1"#,
    read: |section, reader| {
        let octets = section.optional(reader, "octets", hex);
        let token = section.table(reader, "token").and_then(|table| token(table, reader));
        let data = section.table(reader, "data").and_then(|table| data(table, reader));
        if ["octets", "token", "data"].iter().filter(|key| section.has(key)).count() != 1 {
            let fault = Fault::new("a foreign telegram is given by octets, token or data, and by one of them only");
            section.complain(reader, fault.help("for example: token = { to = 2, from = 5 }"));
        }
        source(section, reader, octets.or(token).or(data).map(Emission::Telegram))
    },
};

fn source(section: &mut Section<'_>, reader: &mut Reader<'_>, what: Option<Emission>) -> Option<What> {
    let near = section.optional(reader, "near", address);
    let after = section.optional(reader, "after", instant).unwrap_or(Span::ZERO);
    Some(What::Source(SourceFault { near, after, what: what? }))
}

/// Octets in hexadecimal numbers.
fn hex(node: &Node) -> Result<Box<[u8]>, Fault> {
    let wrong = || {
        Fault::new("these are no octets of a telegram")
            .help(format!("1 to {MAX_FRAME} octets in hexadecimal, such as \"DC 02 05\""))
    };
    let octet = |word: &str| match word.len() {
        1 | 2 if !word.starts_with('+') => u8::from_str_radix(word, 16).map_err(|_| wrong()),
        _ => Err(wrong()),
    };
    let octets: Box<[u8]> = text(node)?.split_ascii_whitespace().map(octet).collect::<Result<_, _>>()?;
    if (1..=MAX_FRAME).contains(&octets.len()) { Ok(octets) } else { Err(wrong()) }
}

/// The two ends of a telegram.
fn ends(table: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<(Address, Address)> {
    let station =
        |most: u8| move |node: &Node| number(0..=most)(node).map(|number| Address::new(number).expect("127 at most"));
    let to = table.required(reader, "to", "2", station(Address::BROADCAST.get()));
    let from = table.required(reader, "from", "5", station(Address::MAX_STATION.get()));
    to.zip(from)
}
fn token(mut table: Section<'_>, reader: &mut Reader<'_>) -> Option<Box<[u8]>> {
    let ends = ends(&mut table, reader);
    table.finish(reader);
    let (to, from) = ends?;
    let mut frame = Frame::new();
    frame.set_token(to, from);
    Some(frame.octets().into())
}
fn data(mut table: Section<'_>, reader: &mut Reader<'_>) -> Option<Box<[u8]>> {
    let ends = ends(&mut table, reader);
    let fc = table.optional(reader, "fc", |node| {
        FrameControl::from_octet(number(0..=u8::MAX)(node)?).map_err(|error| Fault::new(error.to_string()))
    });
    let service = |node: &Node| number(0..=Sap::MAX.0)(node).map(Sap);
    let (dsap, ssap) = (table.optional(reader, "dsap", service), table.optional(reader, "ssap", service));
    let du = table.optional(reader, "du", |node| match &node.value {
        Value::Text(text) if text.trim().is_empty() => Ok(Box::default()),
        _ => hex(node),
    });
    let (to, from) = ends?;
    // Data_Exchange, as from a master that has asked nothing yet.
    let fc = fc.unwrap_or(FrameControl::request(Service::SrdHigh, Fcb::First));
    let header = Header { da: to, sa: from, dsap, ssap, fc };
    let mut frame = Frame::new();
    if let Err(error) = frame.set_data(&header, &du.unwrap_or_default()) {
        table.complain(reader, Fault::new(error.to_string()));
    }
    table.finish(reader);
    Some(frame.octets().into())
}
