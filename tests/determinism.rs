//! One scenario and one seed give one fingerprint, whatever watches and whatever sorts.

use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::{HeapQueue, NearQueue};
use isodp::study::run::run;

use crate::support::{Run, scenario};

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
