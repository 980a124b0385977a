//! Kinds: everything that a scenario names by a word, each with its keys. A new kind is a row and a function here.

use super::error::Fault;
use super::section::{Reader, Section, choice, instant, number, quantity};
use super::services::command;
use super::tree::{Node, Value};
use super::{Action, Format, Patch, StartupTelegram};
use crate::sim::motion::{Angle, Motion, Shaft};
use crate::study::quantity::{angle, micro_rpm};
use crate::time::Time;
use crate::wire::Address;
use crate::wire::control::GlobalControl;

/// A word of scenario files and what stands behind it.
#[derive(Clone, Copy, Debug)]
pub struct Kind<T> {
    /// The word.
    pub name: &'static str,
    /// What it does, in a sentence without its full stop.
    pub what: &'static str,
    read: fn(&mut Section<'_>, &mut Reader<'_>) -> Option<T>,
}

impl<T: 'static> Kind<T> {
    /// Reads the kind that `key` of `section` names, with its own keys.
    pub(super) fn read(
        kinds: &'static [Self],
        noun: &str,
        key: &'static str,
        section: &mut Section<'_>,
        reader: &mut Reader<'_>,
    ) -> Option<T> {
        let example = format!("\"{}\"", kinds[0].name);
        let kind = section.required(reader, key, &example, |node| choice(node, noun, kinds, |kind| kind.name))?;
        (kind.read)(section, reader)
    }
}

/// Formats of a value to be written.
const FORMATS: &[(&str, Format)] = &[
    ("unsigned8", Format::Unsigned8),
    ("unsigned16", Format::Unsigned16),
    ("unsigned32", Format::Unsigned32),
    ("octets", Format::OctetString),
];

/// How shafts can move.
pub const MOTIONS: &[Kind<Motion>] = &[
    Kind { name: "standstill", what: "the shaft stands at `at`", read: standstill },
    Kind { name: "speed", what: "the shaft turns with `speed` from `start` on", read: speed },
    Kind { name: "sine", what: "the shaft swings by `amplitude` about `centre` once per `period`", read: sine },
    Kind { name: "table", what: "the shaft moves in straight lines from point to point of `table`", read: table },
];

/// What events can order.
pub const ACTIONS: &[Kind<Action>] = &[
    Kind {
        name: "acknowledge",
        what: "the master acknowledges the sensor fault",
        read: |_, _| Some(Action::Acknowledge),
    },
    Kind {
        name: "hold-life-sign",
        what: "the master's sign of life stops, `for` so many cycles or until it is released",
        read: hold_life_sign,
    },
    Kind {
        name: "release-life-sign",
        what: "the master's sign of life counts again",
        read: |_, _| Some(Action::ReleaseLifeSign),
    },
    Kind {
        name: "jump-life-sign",
        what: "the master's sign of life goes on from the value `to`",
        read: jump_life_sign,
    },
    Kind { name: "control-word", what: "the master sends `value` as G1_STW from now on", read: control_word },
    Kind {
        name: "read-parameter",
        what: "the master application reads `elements` of `parameter` from `subindex` on over the parameter channel",
        read: read_parameter,
    },
    Kind {
        name: "change-parameter",
        what: "the master application tries to set `parameter` to `value` in `format`",
        read: change_parameter,
    },
    Kind {
        name: "set-prm",
        what: "the master starts the slaves anew; Set_Prm has other `octets` and another `length`, or is good again",
        read: |section, reader| startup(StartupTelegram::Prm, section, reader),
    },
    Kind {
        name: "chk-cfg",
        what: "the master starts the slaves anew; Chk_Cfg has other `octets` and another `length`, or is good again",
        read: |section, reader| startup(StartupTelegram::Cfg, section, reader),
    },
    Kind { name: "power-off", what: "the slaves lose their supply", read: |_, _| Some(Action::PowerOff) },
    Kind { name: "power-on", what: "the slaves get their supply back", read: |_, _| Some(Action::PowerOn) },
    Kind { name: "clear", what: "the master changes to Clear", read: |_, _| Some(Action::Clear) },
    Kind { name: "operate", what: "the master changes to Operate", read: |_, _| Some(Action::Operate) },
    Kind {
        name: "sync",
        what: "the master sends Sync to `groups`: outputs that wait take effect, further ones wait",
        read: |section, reader| command(GlobalControl { sync: true, ..GlobalControl::OPERATE }, section, reader),
    },
    Kind {
        name: "unsync",
        what: "the master sends Unsync to `groups`: outputs take effect as they come",
        read: |section, reader| command(GlobalControl { unsync: true, ..GlobalControl::OPERATE }, section, reader),
    },
    Kind {
        name: "freeze",
        what: "the master sends Freeze to `groups`: the inputs of this instant are held",
        read: |section, reader| command(GlobalControl { freeze: true, ..GlobalControl::OPERATE }, section, reader),
    },
    Kind {
        name: "unfreeze",
        what: "the master sends Unfreeze to `groups`: inputs are fresh again",
        read: |section, reader| command(GlobalControl { unfreeze: true, ..GlobalControl::OPERATE }, section, reader),
    },
];

#[expect(clippy::unnecessary_wraps, reason = "the signature of all kinds")]
fn standstill(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Motion> {
    let at = section.optional(reader, "at", quantity("0.25 rev", angle)).unwrap_or_default();
    Some(Motion::Standstill { at })
}
fn speed(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Motion> {
    let micro_rpm = section.required(reader, "speed", "\"1500 rpm\"", quantity("1500 rpm", micro_rpm));
    let start = section.optional(reader, "start", quantity("0.25 rev", angle)).unwrap_or_default();
    Some(Motion::Speed { start, micro_rpm: micro_rpm? })
}
fn sine(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Motion> {
    let amplitude = section.required(reader, "amplitude", "\"90 deg\"", quantity("90 deg", angle));
    let period = section.required(reader, "period", "\"2 s\"", instant);
    let centre = section.optional(reader, "centre", quantity("0.25 rev", angle)).unwrap_or_default();
    let phase = section.optional(reader, "phase", quantity("90 deg", angle)).unwrap_or_default();
    Some(Motion::Sine { centre, amplitude: amplitude?, period: period?, phase })
}
fn table(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Motion> {
    let points = section.required(reader, "table", "[[\"0 s\", \"0 rev\"], [\"1 s\", \"5 rev\"]]", |node| {
        let Value::List(points) = &node.value else {
            return Err(Fault::new(format!("this is {}", node.value.noun())).help("a list of [time, angle]"));
        };
        points.iter().map(point).collect()
    });
    Some(Motion::Table { points: points? })
}
/// One point of a table.
fn point(node: &Node) -> Result<(Time, Angle), Fault> {
    match &node.value {
        Value::List(pair) if pair.len() == 2 => {
            Ok((Time::ZERO + instant(&pair[0])?, quantity("0.25 rev", angle)(&pair[1])?))
        }
        _ => Err(Fault::new("a point of a table is a time and an angle").help("[\"1 s\", \"0.25 rev\"]")),
    }
}
/// Reads a motion with its keys and lets the simulator judge it.
pub(super) fn motion(mut section: Section<'_>, reader: &mut Reader<'_>) -> Option<Motion> {
    let motion = Kind::read(MOTIONS, "motion", "kind", &mut section, reader)?;
    if let Err(error) = Shaft::new(&motion) {
        section.complain(reader, Fault::new(error.to_string()));
    }
    section.finish(reader);
    Some(motion)
}

#[expect(clippy::unnecessary_wraps, reason = "the signature of all kinds")]
fn hold_life_sign(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Action> {
    Some(Action::HoldLifeSign { cycles: section.optional(reader, "for", number(1..=u32::MAX)) })
}
fn jump_life_sign(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Action> {
    section.required(reader, "to", "9", number(0..=15)).map(|to| Action::JumpLifeSign { to })
}
fn control_word(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Action> {
    section.required(reader, "value", "0x2000", number(0..=u16::MAX)).map(|value| Action::ControlWord { value })
}

fn read_parameter(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Action> {
    let parameter = section.required(reader, "parameter", "979", number(1..=u16::MAX))?;
    let subindex = section.optional(reader, "subindex", number(0..=u16::MAX)).unwrap_or(0);
    let elements = section.optional(reader, "elements", number(0..=u8::MAX)).unwrap_or(1);
    Some(Action::ReadParameter { parameter, subindex, elements })
}
fn change_parameter(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Action> {
    let parameter = section.required(reader, "parameter", "918", number(1..=u16::MAX))?;
    let subindex = section.optional(reader, "subindex", number(0..=u16::MAX)).unwrap_or(0);
    let format = section.optional(reader, "format", |node| choice(node, "format", FORMATS, |row| row.0));
    let value = section.required(reader, "value", "7", number(0..=u32::MAX))?;
    Some(Action::ChangeParameter { parameter, subindex, format: format.map_or(Format::Unsigned16, |row| row.1), value })
}
#[expect(clippy::unnecessary_wraps, reason = "the signature of all kinds")]
fn startup(telegram: StartupTelegram, section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Action> {
    Some(Action::Startup { telegram, patch: patch(section, reader) })
}
/// What is changed in a telegram of the start-up.
pub(super) fn patch(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Patch {
    let mut patch = section.optional(reader, "octets", octets).unwrap_or_default();
    if let Some(length) = section.optional(reader, "length", number(0..=244u8)) {
        patch.set_length(length);
    }
    patch
}
/// Pairs of an octet's number, from 1, and its value.
fn octets(node: &Node) -> Result<Patch, Fault> {
    let wrong = || Fault::new("the octets are pairs of a number and a value, 8 at most").help("octets = [[24, 0x05]]");
    let Value::List(pairs) = &node.value else { return Err(wrong()) };
    let mut patch = Patch::default();
    for pair in pairs {
        let Value::List(pair) = &pair.value else { return Err(wrong()) };
        let [octet, value] = pair.as_slice() else { return Err(wrong()) };
        if !patch.set(number(1..=244u8)(octet)?, number(0..=u8::MAX)(value)?) {
            return Err(wrong());
        }
    }
    Ok(patch)
}

/// The address of a station.
pub(super) fn address(node: &Node) -> Result<Address, Fault> {
    number(0..=125u8)(node)
        .and_then(|number| Address::new(number).ok_or_else(|| Fault::new(format!("{number} is no address"))))
}
