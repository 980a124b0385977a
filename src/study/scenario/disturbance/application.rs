//! Disturbances of the master's application: its sign of life, and what it parameterises slaves with.

use super::station::{STATION, STATIONS, about_stations, targets};
use super::{DisturbanceKind, Key};
use crate::sim::fault::What;
use crate::sim::fault::order::OrderFault;
use crate::study::plan::rules::Facts;
use crate::study::scenario::error::Fault;
use crate::study::scenario::kinds::patch;
use crate::study::scenario::section::{Reader, Section, number};

const TO: Key = Key { name: "to", unit: "0 to 15", default: "-", what: "the value that is sent next" };
const OCTETS: Key = Key {
    name: "octets",
    unit: "[[number, value], ...]",
    default: "none",
    what: "octets of Set_Prm, counted from 1, that have another value, 8 at most",
};
const LENGTH: Key = Key {
    name: "length",
    unit: "0 to 244 octets",
    default: "as it is",
    what: "Set_Prm is cut off or filled with zeros",
};

/// The sign of life stands.
pub(super) const HOLD_LIFE_SIGN: DisturbanceKind = DisturbanceKind {
    name: "hold-life-sign",
    what: "the master's sign of life for these slaves stops, and counts on at the end",
    keys: &[STATION, STATIONS],
    example: r#"kind = "hold-life-sign", stations = "all slaves", cycle = 1000, for = 3"#,
    read: |section, reader| order(OrderFault::HoldLife, section, reader),
};
/// The sign of life jumps.
pub(super) const JUMP_LIFE_SIGN: DisturbanceKind = DisturbanceKind {
    name: "jump-life-sign",
    what: "the master's sign of life for these slaves goes on from `to`, at each beginning",
    keys: &[STATION, STATIONS, TO],
    example: r#"kind = "jump-life-sign", station = 3, to = 9, cycle = 1000, for = 1, every = 100"#,
    read: |section, reader| {
        let to = section.required(reader, "to", "9", number(0..=15));
        let what = order(OrderFault::JumpLife(to.unwrap_or(0)), section, reader);
        to.and(what)
    },
};
/// A value comes twice.
pub(super) const REPEAT_LIFE_SIGN: DisturbanceKind = DisturbanceKind {
    name: "repeat-life-sign",
    what: "the master sends one value of its sign of life for twice as long, at each beginning",
    keys: &[STATION, STATIONS],
    example: r#"kind = "repeat-life-sign", station = 3, cycle = 1000, for = 1, every = 100"#,
    read: |section, reader| order(OrderFault::RepeatLife, section, reader),
};
/// Set_Prm has other octets.
pub(super) const WRONG_PARAMETERS: DisturbanceKind = DisturbanceKind {
    name: "wrong-parameters",
    what: "these slaves get a changed Set_Prm at the beginning and the good one at the end",
    keys: &[STATION, STATIONS, OCTETS, LENGTH],
    example: r#"kind = "wrong-parameters", station = 3, octets = [[5, 0x12]], at = "1 s", for = "500 ms""#,
    read: |section, reader| {
        let patch = patch(section, reader);
        order(OrderFault::WrongPrm(patch), section, reader)
    },
};

fn order(fault: OrderFault, section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<What> {
    targets(section, reader).map(|stations| What::Order(stations, fault))
}

/// Orders are about slaves that a master has in its list.
pub(in crate::study::scenario) fn are_slaves(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (i, disturbance) in facts.scenario.disturbances.iter().enumerate() {
        let What::Order(stations, fault) = &disturbance.what else { continue };
        if matches!(fault, OrderFault::HoldToken(_) | OrderFault::Overlong(_)) {
            continue;
        }
        let no_slave = |address: &&_| facts.scenario.slave(**address).is_none_or(|slave| slave.silent);
        if let Some(address) = stations.iter().find(no_slave) {
            let fault = Fault::new(format!("station {address} is not a slave of a master"))
                .rule("a sign of life and parameters go to slaves that exchange data (manual 2.1)");
            about_stations(reader, i, fault);
        }
    }
}
