//! Another future of a run: the same without a change, and with one the same until it takes effect.

use isodp::observation::Observation;
use isodp::sim::fingerprint::Fingerprints;
use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::{HeapQueue, NearQueue};
use isodp::study::difference::{Happening, What};
use isodp::study::run::run;
use isodp::study::scenario::Scenario;
use isodp::study::what_if::{Futures, WhatIfError, futures};
use isodp::time::Span;

use crate::cli::{Room, SCENE};
use crate::support::{address, scenario, shipped};

type Near = NearQueue<NetworkEvent>;
type Set<'a> = (&'a str, &'a str);

const SHORT: Set<'static> = ("run.duration", "1 s");

fn rider(scenario: &Scenario) -> Fingerprints {
    Fingerprints::new(scenario.master.address)
}
/// The shipped scenario, at most 2 s of it where it says nothing of later.
fn whole(name: &str) -> Scenario {
    let path = format!("{}/scenarios/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let sets = [("run.duration".to_owned(), "2 s".to_owned())];
    Scenario::load(path.as_ref(), &sets).unwrap_or_else(|_| scenario(name, &[]))
}
/// The futures of a shipped scenario from `cycle` on, with `sets` from there.
fn part(name: &str, sets: &[Set<'_>], cycle: u64) -> Futures<Fingerprints> {
    let original = scenario(name, &[SHORT]);
    let altered = scenario(name, &[&[SHORT], sets].concat());
    futures::<Near, _>([&original, &altered], (cycle, None), rider(&original), |_| ())
        .unwrap_or_else(|error| panic!("{error}"))
}
fn refused(name: &str, sets: &[Set<'_>], cycle: u64) -> WhatIfError {
    let original = scenario(name, &[SHORT]);
    let altered = scenario(name, &[&[SHORT], sets].concat());
    futures::<Near, _>([&original, &altered], (cycle, None), (), |()| ()).expect_err("no future")
}

/// Everything that a network is comes along into its copy: machines, queue, line, streams.
#[test]
fn without_a_change_both_futures_are_the_straight_run() {
    for name in shipped() {
        let original = whole(&name);
        let straight = run::<Near>(&original, None, |_| ()).expect("a run without files");
        for cycle in [0, 57] {
            let futures = futures::<Near, _>([&original, &original], (cycle, None), rider(&original), |_| ());
            let Futures { differences, ends, .. } = futures.unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(differences.first(), None, "{name} from {cycle}");
            for (_, rider) in &ends {
                assert_eq!(rider.total(), straight.fingerprint, "{name} from {cycle}");
                assert_eq!(rider.stations().collect::<Vec<_>>(), straight.stations, "{name} from {cycle}");
            }
        }
    }
}

#[test]
fn the_plain_queue_gives_the_same_futures() {
    let [original, altered] =
        [scenario("reference", &[SHORT]), scenario("reference", &[SHORT, ("slave.5.crystal", "40 ppm")])];
    let near = futures::<Near, _>([&original, &altered], (300, None), rider(&original), |_| ()).expect("futures");
    let heap = futures::<HeapQueue<NetworkEvent>, _>([&original, &altered], (300, None), rider(&original), |_| ())
        .expect("futures");
    assert_eq!(near.differences, heap.differences);
    for (near, heap) in near.ends.iter().zip(&heap.ends) {
        assert_eq!((near.0, near.1.total()), (heap.0, heap.1.total()));
    }
}

/// What changes, and which station must be the first to show it where that is known.
#[test]
fn with_a_change_nothing_differs_before_its_cycle() {
    let sine = "{ kind = \"sine\", amplitude = \"1 rev\", period = \"1 s\" }";
    for (name, set, cycle, first) in [
        ("reference", ("master.gc_jitter", "{ kind = \"uniform\", half_width = \"300 ns\" }"), 200, Some(2)),
        ("reference", ("slave.5.crystal", "-47 ppm"), 200, Some(5)),
        ("reference", ("master.crystal", "12 ppm"), 200, None),
        ("reference", ("slave.7.motion", sine), 200, Some(7)),
        ("gc-loss", ("disturbance.1.cycle", "250"), 250, Some(2)),
        ("life-sign-loss", ("event.1.cycle", "210"), 210, None),
        ("free-running", ("slave.3.crystal", "100 ppm"), 120, Some(3)),
        ("two-masters", ("master.gc_jitter", "{ kind = \"uniform\", half_width = \"300 ns\" }"), 100, Some(2)),
    ] {
        let Futures { from, differences, ends } = part(name, &[set], cycle);
        let difference = differences.first().unwrap_or_else(|| panic!("{name}, {set:?}: no difference"));
        assert!(difference.cycle() >= Some(cycle), "{name}, {set:?}: {difference}");
        // A SYNCH that strays the other way is earlier than the one that begins the cycle, and that one is lost is known
        // as soon as the master has decided on it.
        let lost = set.0.starts_with("disturbance");
        assert!(lost || difference.at() >= from - Span::from_us(1), "{name}, {set:?}: {difference}");
        assert!(first.is_none_or(|first| difference.station == address(first)), "{name}, {set:?}: {difference}");
        assert_ne!(ends[0].1.total(), ends[1].1.total(), "{name}, {set:?}");
        let [before, now] = difference.values();
        assert_ne!(before, now, "{name}, {set:?}");
    }
}

#[test]
fn a_clock_can_be_lost_in_the_very_cycle() {
    let Futures { differences, .. } = part("gc-loss", &[("disturbance.1.cycle", "250")], 250);
    let difference = differences.first().expect("a difference");
    assert_eq!((difference.cycle(), difference.station), (Some(250), address(2)), "{difference}");
    let (before, now) = (difference.before.as_ref().expect("SYNCH"), difference.now.as_ref().expect("no SYNCH"));
    assert!(before.is_synch(), "{difference}");
    assert!(matches!(now.what, What::Observation(Observation::Disturbed { .. })), "{difference}");
}

/// A shaft that another motion takes over goes on from where it is: the first latch after it is near the one before.
#[test]
fn a_shaft_does_not_jump() {
    let Futures { differences, .. } = part("reference", &[("slave.7.motion", "{ kind = \"standstill\" }")], 300);
    let difference = differences.first().expect("a difference");
    let position = |happening: &Option<Happening>| match happening.as_ref().map(|happening| &happening.what) {
        Some(What::Observation(Observation::Latch { inputs, .. })) => inputs.xist1,
        other => panic!("{other:?}"),
    };
    let (before, now) = (position(&difference.before), position(&difference.now));
    let device = scenario("reference", &[]).slaves[0].resolution();
    let revolution = f64::from(u32::MAX) / f64::from(device.revolutions);
    let turned = f64::from(before.wrapping_sub(now) as i32) / revolution;
    // 1500 rpm are 25 rev/s: 0.05 rev in 2 ms.
    assert!(before != now && turned.abs() <= 0.051, "{before} {now}: {turned} rev");
}

#[test]
fn the_original_is_the_straight_run_whatever_the_other_does() {
    let original = scenario("reference", &[SHORT]);
    let straight = run::<Near>(&original, None, |_| ()).expect("a run without files");
    let Futures { ends, .. } = part("reference", &[("master.crystal", "12 ppm")], 200);
    assert_eq!(ends[0].1.total(), straight.fingerprint);
}

#[test]
fn a_window_ends_both() {
    let original = scenario("reference", &[SHORT]);
    let altered = scenario("reference", &[SHORT, ("slave.5.crystal", "-47 ppm")]);
    let Futures { ends, from, .. } = futures::<Near, _>([&original, &altered], (200, Some(10)), (), |()| ())
        .unwrap_or_else(|error| panic!("{error}"));
    for (end, ()) in ends {
        let cycles = (end - from).as_ms() / 2.0;
        assert!((9.5..10.5).contains(&cycles), "{cycles} cycles");
    }
}

#[test]
fn what_stations_keep_cannot_change() {
    for set in [("master.t_o", "1.5 ms"), ("slave.5.t_sdr", "40 tbit"), ("run.seed", "9"), ("bus.cable", "50 m")] {
        assert!(matches!(refused("reference", &[set], 100), WhatIfError::Station { .. }), "{set:?}");
    }
}
#[test]
fn a_disturbance_that_comes_later_can_be_another() {
    let text = format!(
        "{SCENE}\n[[disturbance]]\nkind = \"crystal-offset\"\nstation = 4\noffset = \"20 ppm\"\ncycle = 50\nfor = 20\n"
    );
    let scene = |sets: &[(&str, &str)]| {
        let sets: Vec<_> = sets.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
        Scenario::parse("scene", "scene.toml", &text, &sets).unwrap_or_else(|error| panic!("{error}"))
    };
    let original = scene(&[]);
    let straight = run::<Near>(&original, None, |_| ()).expect("a run without files");
    for (set, first) in [(("disturbance.1.offset", "30 ppm"), 50), (("slave.4.crystal", "1 ppm"), 40)] {
        let both = futures::<Near, _>([&original, &scene(&[set])], (40, None), rider(&original), |_| ());
        let Futures { differences, ends, .. } = both.unwrap_or_else(|error| panic!("{error}"));
        let difference = differences.first().expect("a difference");
        assert_eq!(difference.station, address(4), "{set:?}: {difference}");
        assert!(difference.cycle() >= Some(first), "{set:?}: {difference}");
        assert_eq!(ends[0].1.total(), straight.fingerprint, "{set:?}");
    }
}
/// The shipped scenario with repeaters for a second, with these disturbances, each the keys of one.
fn halls(disturbances: &[String]) -> Scenario {
    let path = format!("{}/scenarios/repeaters.toml", env!("CARGO_MANIFEST_DIR"));
    let mut text = std::fs::read_to_string(&path).expect("a scenario");
    for keys in disturbances {
        text.extend(["\n[[disturbance]]\n", &keys.replace("; ", "\n"), "\n"]);
    }
    let sets = [(SHORT.0.to_owned(), SHORT.1.to_owned())];
    Scenario::parse("repeaters", &path, &text, &sets).unwrap_or_else(|error| panic!("{error}"))
}

/// What repeaters add and where cables are cut can be otherwise too, under the same name or another: the other future is
/// that of a run with it, and the original's is what it was.
#[test]
fn paths_can_be_disturbed_otherwise() {
    let jitter = |ns: u32, from: u32| {
        format!(
            "kind = \"repeater-jitter\"; repeater = \"press - gallery\"; half_width = \"{ns} ns\"; cycle = {from}; for = 50"
        )
    };
    let cut = |metres: u32, from: u32| {
        format!("kind = \"cable-cut\"; segment = \"press\"; position = \"{metres} m\"; cycle = {from}; for = 30")
    };
    let named = |keys: String| format!("name = \"another\"; {keys}");
    for [before, now] in [
        [vec![], vec![jitter(100, 310)]],
        [vec![jitter(100, 310)], vec![]],
        [vec![jitter(100, 310)], vec![jitter(40, 310)]],
        [vec![jitter(100, 310)], vec![jitter(100, 310), named(jitter(60, 330))]],
        [vec![jitter(100, 310)], vec![jitter(100, 340)]],
        [vec![], vec![cut(40, 310)]],
        [vec![cut(40, 310)], vec![]],
        [vec![cut(30, 310)], vec![cut(60, 310)]],
        [vec![cut(40, 310)], vec![cut(40, 330)]],
        [vec![cut(40, 310), named(jitter(50, 320))], vec![cut(20, 315), named(cut(60, 330))]],
    ] {
        let both = [halls(&before), halls(&now)];
        let whole = both.each_ref().map(|scenario| run::<Near>(scenario, None, |_| ()).expect("a run").fingerprint);
        let futures = futures::<Near, _>(both.each_ref(), (300, None), rider(&both[0]), |_| ());
        let Futures { differences, ends, .. } = futures.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(ends.each_ref().map(|end| end.1.total()), whole, "{before:?}, {now:?}");
        // That it begins is told before its first cycle.
        assert!(differences.first().expect("a difference").cycle() >= Some(309), "{before:?}, {now:?}");
    }
}

#[test]
fn a_cut_that_lasts_is_another_one_from_the_cycle_on() {
    let cut = |metres: u32| {
        format!("kind = \"cable-cut\"; segment = \"press\"; position = \"{metres} m\"; cycle = 290; for = 150")
    };
    // The slaves of the press sit at 40 and 80 m, those of the gallery behind them.
    let both = [halls(&[cut(20)]), halls(&[cut(60)])];
    let Futures { differences, ends, .. } = futures::<Near, _>(both.each_ref(), (300, None), rider(&both[0]), |_| ())
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(ends[0].1.total(), run::<Near>(&both[0], None, |_| ()).expect("a run").fingerprint);
    let [before, now] = ends.map(|end| end.1.stations().collect::<Vec<_>>());
    let differs = |slave| before.iter().zip(&now).any(|(a, b)| a.0 == address(slave) && a.1.wire != b.1.wire);
    assert!(differs(5) && !differs(3), "slave 5 is heard again: {differences:?}");
}

#[test]
fn more_cuts_than_a_network_can_tell_apart_are_refused() {
    let cuts = |shift: u32| -> Vec<String> {
        let cut = |n| {
            format!("kind = \"cable-cut\"; segment = \"press\"; position = \"{} m\"; cycle = 400; for = 1", n + shift)
        };
        (1..=35).map(cut).collect()
    };
    let both = [halls(&cuts(0)), halls(&cuts(35))];
    let error = futures::<Near, _>(both.each_ref(), (300, None), (), |()| ()).expect_err("70 cuts");
    assert_eq!(error, WhatIfError::Cuts);
    assert!(error.to_string().contains("at most 64 places in both futures together"), "{error}");
}

#[test]
fn a_run_without_headway_is_told_as_by_run() {
    let room = Room::new();
    let told = |arguments: &[&str]| {
        let sets = ["--set", "run.duration=6 s", "--set", "run.max_events=3"];
        let name = if arguments[0] == "run" { "--set" } else { "--run-set" };
        let sets: Vec<_> = sets.iter().map(|word| if *word == "--set" { name } else { word }).collect();
        let output = room.call(&[arguments, &sets].concat());
        assert_eq!((output.status.code(), output.stdout.is_empty()), (Some(2), true), "{arguments:?}");
        let said = String::from_utf8(output.stderr).expect("text");
        let from = said
            .find("more than 3 events per T_DP of 2 ms: the run makes no headway")
            .unwrap_or_else(|| panic!("{said}"));
        said[from..].to_owned()
    };
    let run = told(&["run", "scene.toml"]);
    assert!(run.contains("; seen last:\n") && run.contains("Data_Exchange"), "{run}");
    assert_eq!(told(&["replay", "scene.toml", "--cycle", "2900"]), run);
    assert_eq!(told(&["replay", "scene.toml", "--cycle", "2900", "--set", "slave.4.crystal=9 ppm"]), run);
    // Before the cycle all may be well, and after it not.
    told(&["replay", "scene.toml", "--cycle", "40", "--set", "slave.4.crystal=9 ppm"]);
    assert!(!room.path("out").exists(), "nothing half-written");
}

#[test]
fn the_program_alters_cuts_and_repeaters() {
    let room = Room::new();
    let cut = "\n[[disturbance]]\nkind = \"cable-cut\"\nposition = \"50 m\"\ncycle = 50\nfor = 2\n";
    room.write("cut.toml", SCENE.to_owned() + cut);
    let page = room.runs(&["replay", "cut.toml", "--cycle", "40", "--set", "disturbance.1.position=90 m"]);
    assert!(page.contains("first difference: cycle 50"), "{page}");
    let page = room.runs(&["replay", "cut.toml", "--cycle", "40", "--set", "disturbance.1.cycle=60"]);
    let begins = page.lines().nth(4).expect("the original");
    assert!(begins.starts_with("  original") && begins.ends_with("disturbance 1 begins"), "{page}");
}

#[test]
fn what_has_happened_cannot_change() {
    assert_eq!(refused("life-sign-loss", &[("event.1.cycle", "99")], 100), WhatIfError::Past { cycle: 100 });
}
#[test]
fn a_cycle_that_never_comes_is_an_error() {
    assert!(matches!(refused("reference", &[], 1_000_000), WhatIfError::Replay(_)));
}

#[test]
fn the_page_says_what_parts_and_the_picture_is_drawn() {
    let room = Room::new();
    let call = |set: &str| ["replay", "scene.toml", "--cycle", "40", "--set", set].map(str::to_owned).to_vec();
    let run = |arguments: &[String]| {
        let arguments: Vec<_> = arguments.iter().map(String::as_str).collect();
        room.runs(&arguments)
    };
    let page = run(&[call("slave.4.crystal=49 ppm"), vec!["--out".into(), "pictures".into()]].concat());
    for part in [
        "scene, seed 3: from cycle 40 on, at 0.",
        "first difference: cycle 4",
        "  original  ",
        "  altered   ",
        "latch_skew",
    ] {
        assert!(page.contains(part), "{part}:\n{page}");
    }
    let picture = std::fs::read_to_string(room.path("pictures/scene/what_if.svg")).expect("a picture");
    let picture = roxmltree::Document::parse(&picture).expect("XML");
    let texts: Vec<_> = picture.descendants().filter_map(|node| node.text()).map(str::trim).collect();
    for text in ["original", "altered", "they part, cycle 40", "latch skew [ns]", "PLL error [ns]"] {
        assert!(texts.contains(&text), "{text}: {texts:?}");
    }
    let same = run(&call("slave.4.motion={ kind = \"standstill\" }"));
    assert!(same.contains("no difference: ") && same.contains("none of "), "{same}");
}

#[test]
fn a_whole_run_with_a_change_is_told_as_before() {
    let room = Room::new();
    let told = room.runs(&["replay", "scene.toml", "--cycle", "40", "--run-set", "slave.4.crystal=49 ppm"]);
    assert!(told.starts_with("scene, seed 3, cycles 40 to 40"), "{told}");
    room.write(
        "faster.toml",
        SCENE.replace("addresses = \"3..4\"", "address = 3").replace(
            "[[link]]",
            "[[slave]]\naddress = 4\ndevice = \"posital-ocd-dpb1b\"\ncrystal = \"49 ppm\"\n\n[[link]]",
        ),
    );
    let faster = room.runs(&["replay", "faster.toml", "--cycle", "40"]);
    assert_eq!(told.lines().skip(1).collect::<Vec<_>>(), faster.lines().skip(1).collect::<Vec<_>>());
}

#[test]
fn what_cannot_change_is_named() {
    let room = Room::new();
    let output = room.call(&[
        "replay",
        "scene.toml",
        "--cycle",
        "40",
        "--set",
        "slave.4.crystal=1 ppm",
        "--set",
        "master.t_o=1.5 ms",
    ]);
    let said = String::from_utf8(output.stderr).expect("text");
    assert_eq!((output.status.code(), output.stdout.is_empty()), (Some(2), true));
    assert!(
        said.starts_with("error: --set \"master.t_o=1.5 ms\": this cannot change while the network runs\n  rule: "),
        "{said}"
    );
}
