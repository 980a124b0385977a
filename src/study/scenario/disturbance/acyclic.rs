//! Disturbances of the cycle's end: acyclic traffic that takes longer than the cycle has room for.

use super::{DisturbanceKind, Key};
use crate::dp::master::Overlong;
use crate::sim::fault::What;
use crate::sim::fault::order::OrderFault;
use crate::study::scenario::check::about;
use crate::study::scenario::error::Fault;
use crate::study::scenario::kinds::address;
use crate::study::scenario::section::{Reader, Section, number};
use crate::study::scenario::tree::Node;
use crate::wire::Address;

const TO: Key = Key { name: "to", unit: "address", default: "needed", what: "the slave whose record is written" };
const OCTETS: Key =
    Key { name: "octets", unit: "1 to 240 octets", default: "240", what: "data of each DS-Write, without its head" };
const STATION: Key = Key {
    name: "station",
    unit: "address",
    default: "the master of to",
    what: "the class 1 master that writes; no other one than the slave's can",
};

/// A master that does not look at the time.
pub(super) const OVERLONG_ACYCLIC: DisturbanceKind = DisturbanceKind {
    name: "overlong-acyclic",
    what: "a master writes a record in every cycle, whether that fits before SYNCH or not; what is too long makes SYNCH late",
    keys: &[TO, OCTETS, STATION],
    example: r#"kind = "overlong-acyclic", to = 3, octets = 240, at = "1 s", for = "20 ms""#,
    read: overlong,
};

fn overlong(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<What> {
    let masters = reader.around.masters.clone();
    let to = section.required(reader, "to", "3", |node| slave(node, &masters));
    let octets = section.optional(reader, "octets", number(1..=240));
    let station = section.optional(reader, "station", address);
    let (to, master) = to?;
    if let Some(other) = station.filter(|&station| station != master) {
        let is_slave = masters.iter().any(|(slave, _)| *slave == other);
        let what = if is_slave { "is a slave".to_owned() } else { format!("is not the master of slave {to}") };
        let fault = Fault::new(format!("station {other} {what}"))
            .rule("MS1 is between a slave and the master that has parameterised it (DP-V1)")
            .help(format!("leave out station: it is {master}"));
        let path = section.path_of("station");
        about(reader, &path, &[], fault);
    }
    Some(What::Order(vec![master], OrderFault::Overlong(Overlong { to, octets: octets.unwrap_or(240) })))
}

/// A slave with its master.
fn slave(node: &Node, masters: &[(Address, Address)]) -> Result<(Address, Address), Fault> {
    let to = address(node)?;
    masters.iter().find(|(slave, _)| *slave == to).copied().ok_or_else(|| {
        let known: Vec<_> = masters.iter().map(|(slave, _)| slave.to_string()).collect();
        Fault::new(format!("no master has a slave {to}")).help(format!("the slaves are {}", known.join(", ")))
    })
}
