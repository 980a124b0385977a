//! Disturbances of the ring: a master that keeps the token too long.

use super::station::{STATION, STATIONS, about_stations, targets};
use super::{DisturbanceKind, Key};
use crate::sim::fault::What;
use crate::sim::fault::order::OrderFault;
use crate::study::plan::rules::Facts;
use crate::study::scenario::error::Fault;
use crate::study::scenario::section::{Reader, instant};

/// Masters keep the token.
pub(super) const LATE_TOKEN: DisturbanceKind = DisturbanceKind {
    name: "late-token",
    what: "these masters keep each token longer before they pass it on, and know it",
    keys: &[STATION, STATIONS, Key { name: "by", unit: "time", default: "needed", what: "how much longer" }],
    example: r#"kind = "late-token", station = 2, by = "200 us", at = "1 s", for = "20 ms""#,
    read: |section, reader| {
        let by = section.required(reader, "by", "\"200 us\"", instant);
        let masters = targets(section, reader);
        Some(What::Order(masters?, OrderFault::HoldToken(by?)))
    },
};

/// Only masters have tokens.
pub(in crate::study::scenario) fn are_masters(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let scenario = facts.scenario;
    for (i, disturbance) in scenario.disturbances.iter().enumerate() {
        let What::Order(stations, OrderFault::HoldToken(_)) = &disturbance.what else { continue };
        if let Some(address) = stations.iter().find(|&&address| scenario.slave(address).is_some()) {
            let fault = Fault::new(format!("station {address} is a slave"))
                .rule("the token goes from master to master (EN 50170-2)");
            about_stations(reader, i, fault);
        }
    }
}
