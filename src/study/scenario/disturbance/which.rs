//! Which telegrams a disturbance is about: the keys `from`, `to` and `service`.

use super::Key;
use crate::sim::fault::which::{Kind, Service, Which};
use crate::study::scenario::kinds::address;
use crate::study::scenario::section::{Reader, Section, choice};

/// A service as a user meets it.
#[derive(Clone, Copy, Debug)]
pub struct ServiceName {
    /// The word for it in a scenario.
    pub name: &'static str,
    /// Which telegrams it means.
    pub what: &'static str,
    service: Service,
}

/// Every service.
pub const SERVICES: &[ServiceName] = &[
    row("any", "every telegram but SYNCH", Service::Any),
    row("all", "every telegram, SYNCH too", Service::All),
    row("requests", "what the holder of the token sends, but SYNCH and the token", Service::Requests),
    row("replies", "what answers a request", Service::Replies),
    row("synch", "SYNCH", Service::Only(Kind::Synch)),
    row("global-control", "Global_Control, but SYNCH", Service::Only(Kind::GlobalControl)),
    row("data-exchange", "Data_Exchange and its replies", Service::Only(Kind::DataExchange)),
    row("diagnosis", "Slave_Diag and its replies", Service::Only(Kind::Diagnosis)),
    row("set-prm", "Set_Prm and its acknowledgement", Service::Only(Kind::SetPrm)),
    row("chk-cfg", "Chk_Cfg and its acknowledgement", Service::Only(Kind::ChkCfg)),
    row("fdl-status", "FDL status requests, as those of the GAP, and their answers", Service::Only(Kind::FdlStatus)),
    row("token", "the token", Service::Only(Kind::Token)),
    row("acyclic", "requests, polls and replies of MS1 and MS2", Service::Only(Kind::Acyclic)),
];

const fn row(name: &'static str, what: &'static str, service: Service) -> ServiceName {
    ServiceName { name, what, service }
}

pub(super) const FROM: Key =
    Key { name: "from", unit: "address", default: "any", what: "only telegrams of this station" };
pub(super) const TO: Key = Key { name: "to", unit: "address", default: "any", what: "only telegrams to this station" };
pub(super) const SERVICE: Key =
    Key { name: "service", unit: "service", default: "any", what: "only telegrams of this service, see below" };

/// Reads which telegrams are meant; `usual` is the service without the key.
#[expect(clippy::unnecessary_wraps, reason = "read as the other parts of a disturbance")]
pub(super) fn which(section: &mut Section<'_>, reader: &mut Reader<'_>, usual: Service) -> Option<Which> {
    let from = section.optional(reader, "from", address);
    let to = section.optional(reader, "to", address);
    let service = section.optional(reader, "service", |node| choice(node, "service", SERVICES, |row| row.name));
    Some(Which { from, to, service: service.map_or(usual, |row| row.service) })
}
