//! Disturbances of the line: what becomes of telegrams.

use super::which::{FROM, SERVICE, TO, which};
use super::{DisturbanceKind, Key, manner};
use crate::sim::fault::What;
use crate::sim::fault::line::{Effect, LineFault};
use crate::sim::fault::manner::Manner;
use crate::sim::fault::which::{Kind, Service, Which};
use crate::study::quantity::share;
use crate::study::scenario::error::Fault;
use crate::study::scenario::section::{instant, number, quantity, text};
use crate::study::scenario::tree::Node;
use crate::time::Span;

/// SYNCH that never comes.
pub(super) const MISSING_CLOCKS: DisturbanceKind = DisturbanceKind {
    name: "missing-clocks",
    what: "the master's SYNCH never reaches the line",
    keys: &[manner::RATE, manner::TELEGRAMS, manner::PATTERN],
    example: r#"kind = "missing-clocks", cycle = 1000, for = 2, every = 100"#,
    read: |section, reader| {
        let which = Which::all(Service::Only(Kind::Synch));
        fault(Some(which), manner::read(section, reader), Some(Effect::Lost))
    },
};

/// Telegrams that never come.
pub(super) const LOST_TELEGRAMS: DisturbanceKind = DisturbanceKind {
    name: "lost-telegrams",
    what: "telegrams reach nobody",
    keys: &[FROM, TO, SERVICE, manner::RATE, manner::TELEGRAMS, manner::PATTERN],
    example: r#"kind = "lost-telegrams", from = 4, service = "data-exchange", at = "1 s", for = "20 ms""#,
    read: |section, reader| {
        let which = which(section, reader, Service::Any);
        fault(which, manner::read(section, reader), Some(Effect::Lost))
    },
};

/// Telegrams that leave late.
pub(super) const LATE_TELEGRAMS: DisturbanceKind = DisturbanceKind {
    name: "late-telegrams",
    what: "telegrams leave late, and their senders do not know",
    keys: &[
        Key { name: "by", unit: "time", default: "needed, or up_to", what: "how much later a telegram leaves" },
        Key {
            name: "up_to",
            unit: "time",
            default: "needed, or by",
            what: "anything up to that is equally likely, drawn for each telegram",
        },
        FROM,
        TO,
        SERVICE,
        manner::RATE,
        manner::TELEGRAMS,
        manner::PATTERN,
    ],
    example: r#"kind = "late-telegrams", from = 4, service = "replies", by = "2 us", at = "1 s", for = "20 ms""#,
    read: |section, reader| {
        let by = section.optional(reader, "by", instant);
        let up_to = section.optional(reader, "up_to", instant);
        if section.has("by") == section.has("up_to") {
            let fault = Fault::new("a telegram is late either by a time or by anything up to a time");
            section.complain(reader, fault.help("for example: by = \"2 us\""));
        }
        let late = |random| move |by: Span| Effect::Late { by, random };
        let which = which(section, reader, Service::Any);
        fault(which, manner::read(section, reader), by.map(late(false)).or(up_to.map(late(true))))
    },
};

/// Telegrams that come twice.
pub(super) const DUPLICATE_TELEGRAMS: DisturbanceKind = DisturbanceKind {
    name: "duplicate-telegrams",
    what: "telegrams come a second time, as their senders sent them",
    keys: &[
        Key {
            name: "after",
            unit: "time",
            default: "0 ns",
            what: "from the end of the telegram to the beginning of the second one",
        },
        FROM,
        TO,
        SERVICE,
        manner::RATE,
        manner::TELEGRAMS,
        manner::PATTERN,
    ],
    example: r#"kind = "duplicate-telegrams", service = "synch", after = "3 us", at = "1 s", for = "20 ms""#,
    read: |section, reader| {
        let after = section.optional(reader, "after", instant).unwrap_or(Span::ZERO);
        let which = which(section, reader, Service::Any);
        fault(which, manner::read(section, reader), Some(Effect::Twice { after }))
    },
};

/// Bits that are wrong by chance.
pub(super) const BIT_ERRORS: DisturbanceKind = DisturbanceKind {
    name: "bit-errors",
    what: "bits are wrong by chance: start, data, parity and stop bits alike",
    keys: &[
        Key {
            name: "rate",
            unit: "share",
            default: "needed",
            what: "how likely each bit is wrong, such as \"1e-6\"; exact to 10^-15",
        },
        FROM,
        TO,
        Key { default: "all", ..SERVICE },
    ],
    example: r#"kind = "bit-errors", rate = "1e-3", at = "1 s", for = "20 ms""#,
    read: |section, reader| {
        let rate = section.required(reader, "rate", "\"1e-6\"", quantity("1e-6", share));
        let which = which(section, reader, Service::All);
        fault(which, Some(Manner::All), rate.map(|rate| Effect::Bits { rate }))
    },
};

/// An octet that is wrong.
pub(super) const WRONG_OCTET: DisturbanceKind = DisturbanceKind {
    name: "wrong-octet",
    what: "chosen bits of a chosen octet are wrong",
    keys: &[
        Key {
            name: "octet",
            unit: "number",
            default: "needed",
            what: "which one, from 1, the start delimiter; a telegram without it stays as it is",
        },
        Key {
            name: "flip",
            unit: "1 to 255",
            default: "1",
            what: "its wrong bits as a sum: 1 for the first data bit, 128 for the last",
        },
        Key {
            name: "parity",
            unit: "sent or good",
            default: "sent",
            what: "its parity bit: as it was sent, or good again as behind a repeater with a memory",
        },
        FROM,
        TO,
        Key { default: "all", ..SERVICE },
        manner::RATE,
        manner::TELEGRAMS,
        manner::PATTERN,
    ],
    example: r#"kind = "wrong-octet", octet = 8, flip = 3, from = 4, at = "1 s", for = "20 ms""#,
    read: |section, reader| {
        let octet = section.required(reader, "octet", "8", number(1..=255u8));
        let flip = section.optional(reader, "flip", number(1..=255u8)).unwrap_or(1);
        let good_parity = section.optional(reader, "parity", parity).unwrap_or(false);
        let which = which(section, reader, Service::All);
        let effect = octet.map(|octet| Effect::Octet { number: octet - 1, flip, good_parity });
        fault(which, manner::read(section, reader), effect)
    },
};

/// Whether the parity is made good.
fn parity(node: &Node) -> Result<bool, Fault> {
    match text(node)? {
        "good" => Ok(true),
        "sent" => Ok(false),
        other => {
            let other: String = other.chars().take(40).collect();
            Err(Fault::new(format!("there is no parity \"{other}\"")).help("known here: sent, good"))
        }
    }
}

fn fault(which: Option<Which>, manner: Option<Manner>, effect: Option<Effect>) -> Option<What> {
    Some(What::Line(LineFault { which: which?, manner: manner?, effect: effect? }))
}
