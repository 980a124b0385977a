//! Disturbances of crystals.

use super::station::{STATION, STATIONS, targets};
use super::{DisturbanceKind, Key};
use crate::sim::fault::What;
use crate::sim::fault::clock::CrystalFault;
use crate::study::plan::rules::Facts;
use crate::study::quantity::ppb;
use crate::study::scenario::check::{CRYSTAL_MAX_PPB, about};
use crate::study::scenario::error::Fault;
use crate::study::scenario::section::{Reader, Section, instant, quantity};
use crate::study::scenario::tree::Node;
use crate::time::Span;

/// Shortest time between two changes of a rate. Model: no crystal changes faster than a slave captures SYNCH.
const INTERVAL_MIN: Span = Span::from_us(100);
/// Time between two changes with a temperature. Model: a hundredth of the shortest time constant of a quartz.
const INTERVAL: Span = Span::from_ms(10);

const OFFSET: Key =
    Key { name: "offset", unit: "ppm or ppb", default: "-", what: "how much faster they run, at most 200 ppm" };

/// A jump.
pub(super) const CRYSTAL_OFFSET: DisturbanceKind = DisturbanceKind {
    name: "crystal-offset",
    what: "the crystals of these stations run faster by `offset`, or slower",
    keys: &[STATION, STATIONS, OFFSET],
    example: r#"kind = "crystal-offset", station = 3, offset = "20 ppm", at = "1 s", for = "2 s""#,
    read: |section, reader| {
        let offset = section.required(reader, "offset", "\"20 ppm\"", quantity("20 ppm", ppb));
        crystal(section, reader, offset.map(CrystalFault::Offset))
    },
};
/// A random walk.
pub(super) const CRYSTAL_WANDER: DisturbanceKind = DisturbanceKind {
    name: "crystal-wander",
    what: "the crystals of these stations wander by themselves: a `step` up or down every `interval`, up to `bound`",
    keys: &[
        STATION,
        STATIONS,
        Key { name: "step", unit: "ppm or ppb", default: "-", what: "size of a step" },
        Key { name: "interval", unit: "time", default: "-", what: "from step to step, at least 100 us" },
        Key { name: "bound", unit: "ppm or ppb", default: "-", what: "farthest offset, at most 200 ppm" },
    ],
    example: r#"kind = "crystal-wander", stations = "all slaves", step = "50 ppb", interval = "1 ms", bound = "5 ppm""#,
    read: |section, reader| {
        let step = section.required(reader, "step", "\"50 ppb\"", width);
        let interval = section.required(reader, "interval", "\"1 ms\"", interval);
        let bound = section.required(reader, "bound", "\"5 ppm\"", width);
        let walk = step.zip(interval).zip(bound);
        if let Some(((step, _), bound)) = walk.filter(|&((step, _), bound)| step > bound) {
            let fault = Fault::new(format!("a step of {step} ppb is beyond the bound of {bound} ppb"));
            section.complain(reader, fault.help("a smaller step, or a farther bound"));
        }
        let fault = walk.map(|((step, interval), bound)| CrystalFault::Wander { step, interval, bound });
        crystal(section, reader, fault)
    },
};
/// Heat.
pub(super) const TEMPERATURE_STEP: DisturbanceKind = DisturbanceKind {
    name: "temperature-step",
    what: "the crystals of these stations approach `offset` with `time_constant`, and return the same way at the end",
    keys: &[
        STATION,
        STATIONS,
        OFFSET,
        Key { name: "time_constant", unit: "time", default: "-", what: "until all but 1/e of the way is done" },
        Key { name: "interval", unit: "time", default: "10 ms", what: "from one change of the rate to the next" },
    ],
    example: r#"kind = "temperature-step", station = 4, offset = "-10 ppm", time_constant = "5 s", at = "1 s""#,
    read: |section, reader| {
        let offset = section.required(reader, "offset", "\"10 ppm\"", quantity("10 ppm", ppb));
        let time_constant = section.required(reader, "time_constant", "\"5 s\"", interval);
        let interval = section.optional(reader, "interval", interval).unwrap_or(INTERVAL);
        let both = offset.zip(time_constant);
        let fault = both.map(|(offset, time_constant)| CrystalFault::Temperature { offset, time_constant, interval });
        crystal(section, reader, fault)
    },
};

fn crystal(section: &mut Section<'_>, reader: &mut Reader<'_>, fault: Option<CrystalFault>) -> Option<What> {
    let stations = targets(section, reader);
    Some(What::Crystal(stations?, fault?))
}
/// A part of the frequency that is not negative (parts per billion).
fn width(node: &Node) -> Result<i64, Fault> {
    match quantity("5 ppm", ppb)(node)? {
        ppb if ppb < 0 => Err(Fault::new("a width is not negative")),
        ppb => Ok(ppb),
    }
}
fn interval(node: &Node) -> Result<Span, Fault> {
    match instant(node)? {
        span if span < INTERVAL_MIN => {
            Err(Fault::new(format!("{span} is too short")).help(format!("at least {INTERVAL_MIN}")))
        }
        span => Ok(span),
    }
}

/// A crystal that is disturbed is still a crystal.
pub(in crate::study::scenario) fn are_crystals(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (i, disturbance) in facts.scenario.disturbances.iter().enumerate() {
        let What::Crystal(_, fault) = &disturbance.what else { continue };
        if fault.bound() > CRYSTAL_MAX_PPB {
            let fault = Fault::new(format!("a crystal is not off by {} ppm", fault.bound() as f64 / 1e3))
                .rule("a crystal is within 200 ppm (Model: twice what cheap ones have)")
                .help(format!("at most {} ppm", CRYSTAL_MAX_PPB / 1_000));
            let path = format!("disturbance.{}", i + 1);
            about(reader, &format!("{path}.offset"), &[&format!("{path}.bound")], fault);
        }
    }
}
