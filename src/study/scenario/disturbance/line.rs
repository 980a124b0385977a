//! Disturbances of the line: what becomes of telegrams.

use super::{DisturbanceKind, Key};
use crate::sim::fault::What;
use crate::sim::fault::line::{LineFault, Service};
use crate::study::scenario::kinds::address;
use crate::study::scenario::section::choice;

/// Services that a disturbance can be about.
const SERVICES: &[(&str, Service)] = &[("data-exchange", Service::DataExchange), ("any", Service::Any)];

const FROM: Key = Key { name: "from", unit: "address", default: "all", what: "only telegrams of this station" };
const TO: Key = Key { name: "to", unit: "address", default: "all", what: "only telegrams to this station" };
const SERVICE: Key =
    Key { name: "service", unit: "data-exchange or any", default: "any", what: "only telegrams of this service" };

/// SYNCH that never comes.
pub(super) const MISSING_CLOCKS: DisturbanceKind = DisturbanceKind {
    name: "missing-clocks",
    what: "the master's SYNCH never reaches the line",
    keys: &[],
    example: r#"kind = "missing-clocks", cycle = 1000, for = 2, every = 100"#,
    read: |_, _| Some(What::Line(LineFault::MissingClocks)),
};

/// Telegrams that never come.
pub(super) const LOST_TELEGRAMS: DisturbanceKind = DisturbanceKind {
    name: "lost-telegrams",
    what: "telegrams `from` one station `to` another reach nobody; SYNCH is not among them",
    keys: &[FROM, TO, SERVICE],
    example: r#"kind = "lost-telegrams", from = 4, service = "data-exchange", at = "1 s", for = "20 ms""#,
    read: |section, reader| {
        let from = section.optional(reader, "from", address);
        let to = section.optional(reader, "to", address);
        let service = section.optional(reader, "service", |node| choice(node, "service", SERVICES, |row| row.0));
        let service = service.map_or(Service::Any, |row| row.1);
        Some(What::Line(LineFault::LostTelegrams { from, to, service }))
    },
};
