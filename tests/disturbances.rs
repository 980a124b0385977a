//! Disturbances of stations, clocks and paths: each is seen at full strength and not at all at none, leaves the draws of
//! others alone, and two at once do what each does.

mod acyclic;
mod clock;
mod each;
mod gc_jitter;
mod path;
mod scenarios;
mod station;

pub(crate) use scenarios::TESTS;

use isodp::observation::{Disturbance, Observation};
use isodp::sim::fingerprint::Fingerprint;
use isodp::study::scenario::Scenario;

use crate::support::{Run, address};

/// Three encoders, one of them a publisher, and a drive, on their own crystals; every loop is locked from cycle 60 on.
const SCENE: &str = r#"
[run]
seed = 5
cycles = 400
[bus]
rate = "12 Mbit/s"
cable = "100 m"
[master]
address = 2
t_dp = "2 ms"
t_i = "125 us"
t_o = "1 ms"
crystal = { within = "50 ppm" }
gc_jitter = { kind = "uniform", half_width = "100 ns" }
[[slave]]
addresses = "3..5"
device = "posital-ocd-dpb1b"
crystal = { within = "50 ppm" }
[[slave]]
address = 6
device = "subscriber-drive"
crystal = { within = "50 ppm" }
[[link]]
publisher = 3
subscriber = 6
"#;

/// The scene with these tables besides.
fn scene(more: &str) -> Scenario {
    changed(&[], more)
}
fn changed(sets: &[(&str, &str)], more: &str) -> Scenario {
    let sets: Vec<_> = sets.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
    Scenario::parse("scene", "scene.toml", &[SCENE, more].concat(), &sets).unwrap_or_else(|error| panic!("{error}"))
}
/// Runs the scene with these disturbances, each the keys of one on a line.
fn disturbed(disturbances: &[&str]) -> Run {
    Run::of(&scene(&tables(disturbances)))
}
/// Each disturbance as a table.
fn tables(disturbances: &[&str]) -> String {
    let lines = disturbances.iter().flat_map(|keys| ["[[disturbance]]"].into_iter().chain(keys.split("; ")));
    lines.flat_map(|line| ["\n", line]).chain(["\n"]).collect()
}
/// What a scene with these disturbances comes to, station by station.
fn prints(disturbances: &[&str]) -> Vec<(u8, Fingerprint)> {
    disturbed(disturbances).stations.iter().map(|&(station, print)| (station.get(), print)).collect()
}
/// Why a scene with these disturbances is refused.
fn refused(disturbances: &[&str]) -> String {
    let text = [SCENE, &tables(disturbances)].concat();
    match Scenario::parse("scene", "scene.toml", &text, &[]) {
        Ok(_) => panic!("{disturbances:?} is accepted"),
        Err(error) => error.to_string(),
    }
}
/// The cycles in which bursts were told to one station.
fn bursts(run: &Run, station: u8) -> Vec<(u64, Disturbance)> {
    let burst = |row: &isodp::study::row::EventRow| match row.what {
        Observation::Disturbed { how: how @ (Disturbance::Begins | Disturbance::Ends), .. } => Some((row.cycle, how)),
        _ => None,
    };
    run.events_of(station).filter_map(burst).collect()
}
/// The cycles in which one station sent something.
fn sends_in(run: &Run, station: u8, cycles: std::ops::Range<u64>) -> Vec<u64> {
    cycles.filter(|&cycle| run.telegrams_in(cycle).any(|(_, _, sender, _)| *sender == address(station))).collect()
}
