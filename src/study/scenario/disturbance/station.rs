//! Disturbances of stations: they fall silent, grow deaf, or are without supply for a while.

use super::{DisturbanceKind, Key};
use crate::sim::fault::What;
use crate::sim::fault::station::StationFault;
use crate::sim::fault::window::{Bursts, Window};
use crate::study::plan::rules::Facts;
use crate::study::scenario::check::about;
use crate::study::scenario::error::Fault;
use crate::study::scenario::kinds::address;
use crate::study::scenario::read::address_list;
use crate::study::scenario::section::{Reader, Section};
use crate::study::scenario::tree::{Node, Value};
use crate::wire::Address;

pub(super) const STATION: Key =
    Key { name: "station", unit: "address", default: "-", what: "the station that is meant; either this or stations" };
pub(super) const STATIONS: Key = Key {
    name: "stations",
    unit: "addresses or \"all slaves\"",
    default: "-",
    what: "the stations that are meant; either this or station",
};

/// Nothing comes in or out.
pub(super) const SILENT: DisturbanceKind = DisturbanceKind {
    name: "silent",
    what: "the stations hear nothing and send nothing; their supply stays, and they come back with their state",
    keys: &[STATION, STATIONS],
    example: r#"kind = "silent", station = 3, at = "1 s", for = "20 ms""#,
    read: |section, reader| station(StationFault::Silent, section, reader),
};
/// Nothing goes out.
pub(super) const MUTE: DisturbanceKind = DisturbanceKind {
    name: "mute",
    what: "the stations hear, but nothing that they send reaches the line",
    keys: &[STATION, STATIONS],
    example: r#"kind = "mute", stations = "3..5", cycle = 1000, for = 5"#,
    read: |section, reader| station(StationFault::Mute, section, reader),
};
/// Nothing comes in.
pub(super) const DEAF: DisturbanceKind = DisturbanceKind {
    name: "deaf",
    what: "the stations hear nothing, not even whether the line is busy",
    keys: &[STATION, STATIONS],
    example: r#"kind = "deaf", station = 3, cycle = 1000, for = 1, every = 50"#,
    read: |section, reader| station(StationFault::Deaf, section, reader),
};
/// Off and on.
pub(super) const RESTART: DisturbanceKind = DisturbanceKind {
    name: "restart",
    what: "the supply of the stations goes off, and on again at the end; a master is a station too",
    keys: &[STATION, STATIONS],
    example: r#"kind = "restart", station = 3, at = "1 s", for = "300 ms", every = "5 s", times = 3"#,
    read: |section, reader| station(StationFault::Restart, section, reader),
};

fn station(fault: StationFault, section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<What> {
    targets(section, reader).map(|stations| What::Station(stations, fault))
}

/// The stations that a disturbance means, in address order.
pub(super) fn targets(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Vec<Address>> {
    let slaves = reader.around.slaves.clone();
    let one = section.optional(reader, "station", address);
    let many = section.optional(reader, "stations", |node| many(node, &slaves));
    if section.has("station") == section.has("stations") {
        let fault = Fault::new("this disturbance needs either station or stations");
        section.complain(
            reader,
            fault.help("for example: station = 3, stations = \"3..10\", or stations = \"all slaves\""),
        );
        return None;
    }
    one.map(|station| vec![station]).or(many)
}
fn many(node: &Node, slaves: &[Address]) -> Result<Vec<Address>, Fault> {
    match &node.value {
        Value::Text(text) if matches!(text.trim(), "all slaves" | "all") => Ok(slaves.to_vec()),
        _ => address_list(node),
    }
}

/// Complains about the stations that disturbance number `index`, from 0, means.
pub(super) fn about_stations(reader: &mut Reader<'_>, index: usize, fault: Fault) {
    let path = format!("disturbance.{}", index + 1);
    about(reader, &format!("{path}.station"), &[&format!("{path}.stations")], fault);
}

/// A master without supply begins no cycles, so that its return cannot be counted in them.
pub(in crate::study::scenario) fn come_back(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let master = facts.scenario.master.address;
    for (i, disturbance) in facts.scenario.disturbances.iter().enumerate() {
        let off = matches!(&disturbance.what, What::Station(all, StationFault::Restart) if all.contains(&master));
        if off && matches!(disturbance.window, Window::Cycles(Bursts { length: Some(_), .. })) {
            let fault = Fault::new(format!("the supply of [master], station {master}, would never return"))
                .rule("cycles are those of [master], and without supply it begins none")
                .help("at and for as times, such as at = \"1 s\", for = \"20 ms\"");
            about(reader, &format!("disturbance.{}.for", i + 1), &[], fault);
        }
    }
}

/// Every station that a disturbance names is there.
pub(in crate::study::scenario) fn are_there(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let all: Vec<_> = facts.scenario.stations().map(|station| station.address).collect();
    for (i, disturbance) in facts.scenario.disturbances.iter().enumerate() {
        if let What::Source(_) = disturbance.what {
            continue; // It has a key of its own for that.
        }
        let mut named = disturbance.what.stations().iter();
        if let Some(address) = named.find(|address| !all.contains(address)) {
            let mut known = all.clone();
            known.sort_unstable();
            let known: Vec<_> = known.iter().map(ToString::to_string).collect();
            let fault = Fault::new(format!("there is no station {address}"))
                .help(format!("the stations are {}", known.join(", ")));
            about_stations(reader, i, fault);
        }
    }
}
