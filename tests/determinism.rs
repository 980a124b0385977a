//! One scenario and one seed give one fingerprint, whatever watches and whatever sorts.

use isodp::sim::fingerprint::Fingerprint;
use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::{HeapQueue, NearQueue};
use isodp::study::run::{Outcome, run};
use isodp::study::scenario::Scenario;
use isodp::wire::Address;
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;

use crate::cli::Room;
use crate::support::{Run, address, scenario, shipped};

const SHORT: (&str, &str) = ("run.duration", "1 s");

#[test]
fn the_same_seed_gives_the_same_run_and_another_does_not() {
    let reference = scenario("reference", &[SHORT]);
    let [one, two] = [Run::of(&reference), Run::of(&reference)];
    assert_eq!(one.fingerprint, two.fingerprint);
    assert_eq!(one.stations, two.stations);
    let other = Run::of(&scenario("reference", &[SHORT, ("run.seed", "2")]));
    assert_ne!(one.fingerprint, other.fingerprint);
}

/// A whole run without files.
fn outcome(scenario: &Scenario) -> Outcome {
    run::<NearQueue<NetworkEvent>>(scenario, None, |_| ()).expect("a run without files")
}

/// Golden files hold what this build says of whole runs, too.
#[test]
fn the_program_and_the_library_agree_on_every_scenario() {
    let room = Room::new();
    for name in shipped() {
        let Outcome { fingerprint, statistics, .. } = outcome(&scenario(&name, &[]));
        let file = format!("{}/scenarios/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let output = room.call(&["run", &file, "--set", "record.files=false"]);
        let page = String::from_utf8(output.stdout).expect("text");
        assert_eq!((output.status.code(), output.stderr), (Some(i32::from(name == "canary")), Vec::new()), "{name}");
        let line = format!("fingerprint: {fingerprint}  statistics {statistics:016x}");
        assert_eq!(page.lines().find(|line| line.starts_with("fingerprint")), Some(line.as_str()), "{name}");
    }
}

#[test]
fn both_queues_agree_on_every_scenario() {
    for name in shipped() {
        let scenario = scenario(&name, &[]);
        let near = outcome(&scenario);
        let heap = run::<HeapQueue<NetworkEvent>>(&scenario, None, |_| ()).expect("a run without files");
        assert_eq!((near.fingerprint, near.statistics), (heap.fingerprint, heap.statistics), "{name}");
        assert_eq!(near.stations, heap.stations, "{name}");
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let seeds: Vec<_> =
        (1..=6).map(|seed: u64| scenario("reference", &[SHORT, ("run.seed", &seed.to_string())])).collect();
    let on = |threads| -> Vec<_> {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| seeds.par_iter().map(outcome).map(|run| (run.fingerprint, run.statistics)).collect())
    };
    let one = on(1);
    assert_eq!(one, on(2));
    let other = |(i, run): (usize, &_)| one[..i].iter().all(|before| before != run);
    assert!(one.iter().enumerate().all(other), "every seed is a run of its own");
}

/// A station that says nothing changes nothing for the others, whether its address is polled or not.
#[test]
fn a_silent_station_changes_no_other() {
    let fixed = crate::cli::SCENE
        .replace("address = 5\n", "address = 5\nposition = \"100 m\"\n")
        .replace("addresses = \"3..4\"\n", "addresses = \"3..4\"\nposition = \"50 m\"\n");
    let stations = |text: &str| -> Vec<(Address, Fingerprint)> {
        let scenario = Scenario::parse("scene", "scene.toml", text, &[("run.duration".into(), "2 s".into())]);
        Run::of(&scenario.unwrap_or_else(|error| panic!("{error}"))).stations
    };
    let before = stations(&fixed);
    assert_eq!(before.len(), 4);
    for free in [0, 1, 6, 60, 125] {
        let silent = format!(
            "[[slave]]\naddress = {free}\nsilent = true\ndevice = \"posital-ocd-dpb1b\"\ncrystal = {{ within = \"50 ppm\" }}\n"
        );
        let mut after = stations(&format!("{fixed}\n{silent}"));
        after.retain(|(station, _)| *station != address(free));
        assert_eq!(before, after, "with a silent station {free}");
    }
}

#[test]
fn the_queue_does_not_matter() {
    let reference = scenario("reference", &[SHORT]);
    let [near, heap] = [Run::on::<NearQueue<NetworkEvent>>(&reference), Run::on::<HeapQueue<NetworkEvent>>(&reference)];
    assert_eq!(near.fingerprint, heap.fingerprint);
    assert_eq!(near.telegrams, heap.telegrams);
}

#[test]
fn files_and_plots_change_nothing() {
    let dir = tempfile::tempdir().expect("a directory");
    let reference = scenario("reference", &[SHORT]);
    let [with, without] =
        [Some(dir.path()), None].map(|out| run::<NearQueue<NetworkEvent>>(&reference, out, |_| ()).expect("a run"));
    assert_eq!(with.fingerprint, without.fingerprint);
    assert_eq!(with.statistics, without.statistics);
}
