//! Two runs compared: where they part, what moved, and what becomes of baselines that are not what they should be.

use std::fs;
use std::process::Output;

use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::{HeapQueue, NearQueue};
use isodp::study::baseline::{Baseline, Trail};
use isodp::study::difference::{Difference, Differences};
use isodp::study::scenario::Scenario;

use crate::cli::Room;
use crate::support::{address, scenario};

type Near = NearQueue<NetworkEvent>;

const SHORT: (&str, &str) = ("run.duration", "1 s");

fn differences(before: &Scenario, now: &Scenario) -> Differences {
    let found = Differences::of::<Near>(before, now);
    assert_eq!(found, Differences::of::<HeapQueue<NetworkEvent>>(before, now), "the queue does not matter");
    found
}
fn first(found: &Differences) -> &Difference {
    found.first().expect("a difference")
}

#[test]
fn a_run_does_not_differ_from_itself() {
    for name in ["reference", "gc-loss", "two-masters", "free-running", "repeaters"] {
        let one = scenario(name, &[]);
        assert_eq!(Differences::of::<Near>(&one, &one), Differences::default(), "{name}");
    }
}

/// One part in 10^9 at a period of 2 ms are 2 fs, so it takes some cycles until an instant is another tick.
#[test]
fn a_crystal_that_is_one_ppb_faster_is_found() {
    let exact = |ppb: &'static str| scenario("reference", &[SHORT, ("slave.5.crystal", ppb)]);
    let (before, now) = (exact("20000 ppb"), exact("20001 ppb"));
    let found = differences(&before, &now);
    let first = first(&found);
    assert_eq!(first.station, address(5), "{first}");
    // Whatever it is, it is the first: up to there every other record is the same, and it is one tick or a few.
    let [before_at, now_at] = [&first.before, &first.now].map(|happening| happening.as_ref().expect("both have it").at);
    assert!((now_at - before_at).abs().ticks() <= 2, "{first}");
    let [one, other] = first.values();
    assert_ne!(one, other);
    // The trails say the same of the station and the cycle.
    let trail = |scenario: &Scenario| Trail::of::<Near>(scenario).expect("a run");
    let traced = trail(&before).compare(&trail(&now));
    let parting = traced.first_stretch().iter().find(|parting| parting.station == address(5)).expect("slave 5");
    assert!(parting.contains(first.cycle()), "{parting:?}, {first}");
}

#[test]
fn another_seed_is_another_run_from_the_start() {
    let found = differences(&scenario("reference", &[SHORT]), &scenario("reference", &[SHORT, ("run.seed", "2")]));
    assert_eq!(found.everything.len(), 10, "every station, {:?}", found.everything);
    assert!(first(&found).cycle().is_none_or(|cycle| cycle < 2), "{}", first(&found));
}

#[test]
fn an_event_that_is_elsewhere_parts_the_runs_there() {
    let at = |cycle| scenario("life-sign-loss", &[("event.1.cycle", cycle)]);
    let found = differences(&at("210"), &at("215"));
    let first = first(&found);
    assert_eq!((first.cycle(), first.station), (Some(210), address(2)), "the master does it: {first}");
}

#[test]
fn a_lost_clock_parts_the_runs_in_its_cycle() {
    let at = |cycle| scenario("gc-loss", &[("disturbance.1.cycle", cycle)]);
    let found = differences(&at("200"), &at("230"));
    assert_eq!((first(&found).cycle(), first(&found).station), (Some(200), address(2)), "{}", first(&found));
}

#[test]
fn of_runs_of_different_length_what_both_have_is_compared() {
    let [short, long] = ["1 s", "2 s"].map(|duration| scenario("reference", &[("run.duration", duration)]));
    assert_eq!(differences(&short, &long), Differences::default());
    let [few, many] = ["100", "400"].map(|cycles| scenario("reference", &[("run.cycles", cycles)]));
    assert_eq!(differences(&many, &few), Differences::default());
    let [few, many] = [&few, &many].map(|scenario| Trail::of::<Near>(scenario).expect("a run"));
    assert_eq!(few.compare(&many), isodp::study::baseline::Traced::default());
}

/// What the trails find is what both runs side by side show.
#[test]
fn a_trail_finds_what_two_runs_find() {
    for (name, set) in [
        ("reference", ("slave.7.t_sdr", "45 tbit")),
        ("reference", ("slave.6.t_o", "1.5 ms")),
        ("life-sign-loss", ("event.1.cycle", "333")),
        ("gc-loss", ("disturbance.1.cycle", "333")),
        ("two-masters", ("master.crystal", "13 ppm")),
    ] {
        let (before, now) = (scenario(name, &[]), scenario(name, &[set]));
        let live = Differences::of::<Near>(&before, &now);
        let traced = [&before, &now].map(|scenario| Trail::of::<Near>(scenario).expect("a run"));
        let traced = traced[0].compare(&traced[1]);
        let expected = first(&live);
        let parting = traced.first_stretch().iter().find(|parting| parting.station == expected.station);
        // A SYNCH is sent in the cycle before the one that it begins.
        let sent = expected.cycle().and_then(|cycle| cycle.checked_sub(1));
        let near = parting.is_some_and(|parting| parting.contains(expected.cycle()) || parting.contains(sent));
        assert!(near, "{name}, {set:?}: {:?}, {expected}", traced.first_stretch());
        if let Some(known) = traced.known.first() {
            assert_eq!((known.station, known.cycle()), (expected.station, expected.cycle()), "{name}, {set:?}");
        }
        let events = live.first_event().map(|event| (event.station, event.cycle(), event.values()));
        assert_eq!(traced.known.first_event().map(|event| (event.station, event.cycle(), event.values())), events);
    }
}

fn text(octets: &[u8]) -> &str {
    std::str::from_utf8(octets).expect("text")
}
/// Calls the program, which ends with `code`; the page.
#[track_caller]
fn ends(room: &Room, code: i32, arguments: &[&str]) -> String {
    let Output { status, stdout, stderr } = room.call(arguments);
    assert_eq!(status.code(), Some(code), "{arguments:?}\n{}{}", text(&stdout), text(&stderr));
    if code == 2 { text(&stderr).to_owned() } else { text(&stdout).to_owned() }
}

#[test]
fn nothing_moves_between_a_run_and_itself() {
    let room = Room::new();
    let page = ends(&room, 0, &["baseline", "scene.toml"]);
    assert!(page.starts_with("scene: ") && page.contains("scene.baseline.json"), "{page}");
    let size = fs::metadata(room.path("scene.baseline.json")).expect("a baseline").len();
    assert!((10_000..1_000_000).contains(&size), "{size} octets");
    let page = ends(&room, 0, &["compare", "scene.toml"]);
    assert!(page.contains("\nfingerprint: the same, wire ") && page.contains("\nnone of "), "{page}");
    assert!(!page.contains("verdict"), "{page}");
    let all = ends(&room, 0, &["compare", "scene.toml", "--all"]);
    assert!(all.contains("verdict") && all.contains("latch_skew.p99 ") && !all.contains("BEYOND"), "{all}");
    // The other form: two scenarios.
    room.write("twin.toml", fs::read(room.path("scene.toml")).expect("a scenario"));
    let page = ends(&room, 0, &["compare", "twin.toml", "--with", "scene.toml"]);
    assert!(page.contains("\nnone of "), "{page}");
}

#[test]
fn a_figure_that_moves_too_far_ends_with_one() {
    let room = Room::new();
    ends(&room, 0, &["baseline", "scene.toml"]);
    let changed = ["compare", "scene.toml", "--set", "slave.4.crystal=49 ppm"];
    let page = ends(&room, 1, &changed);
    for part in ["first difference: ", "station 4", "\n  before  ", "\n  now     ", "BEYOND", "fingerprint: another in"]
    {
        assert!(page.contains(part), "{part}:\n{page}");
    }
    // As far as anything may move.
    let page = ends(&room, 0, &[&changed[..], &["--tolerance", "*=100000%", "--tolerance", "*=1 h"]].concat());
    assert!(page.contains(" figures moved, none beyond the tolerance") && page.contains("within"), "{page}");
}

#[test]
fn a_baseline_keeps_its_seed_its_changes_and_its_tolerances() {
    let room = Room::new();
    let made = ["baseline", "scene.toml", "--seed", "9", "--set", "slave.4.crystal=-7 ppm", "--out", "keep/it.json"];
    ends(&room, 0, &[&made[..], &["--tolerance", "*.p99=1 us"]].concat());
    let compared = ["compare", "scene.toml", "--with", "keep/it.json"];
    let page = ends(&room, 0, &compared);
    assert!(page.contains("seed 9") && page.contains("\nnone of "), "{page}");
    // Written again it keeps what was told of tolerances.
    ends(&room, 0, &made);
    let kept = Baseline::load(&room.path("keep/it.json")).expect("a baseline");
    assert_eq!(kept.tolerances.texts().collect::<Vec<_>>(), [("*.p99", "1 us")]);
    assert_eq!(Baseline::parse(&kept.emit()).expect("what it wrote"), kept);
}

#[test]
fn what_changed_in_the_scenario_is_told() {
    let room = Room::new();
    ends(&room, 0, &["baseline", "scene.toml"]);
    let scene = fs::read_to_string(room.path("scene.toml")).expect("a scenario");
    room.write(
        "scene.toml",
        scene.replace(
            "gc_jitter = { kind = \"bounded-normal\", sigma = \"100 ns\"",
            "gc_jitter = { kind = \"bounded-normal\", sigma = \"120 ns\"",
        ),
    );
    let page = ends(&room, 1, &["compare", "scene.toml"]);
    assert!(page.contains("the scenario file is another than before\n  before  gc_jitter = "), "{page}");
    assert!(page.contains("SYNCH | 68 07 07 68"), "the octets of before are known:\n{page}");
}

/// The baseline of another program, or of one that has lost its files, is known by what it keeps.
#[test]
fn without_the_program_of_before_the_trail_tells() {
    let room = Room::new();
    ends(&room, 0, &["baseline", "scene.toml", "--set", "slave.4.crystal=49 ppm"]);
    let path = room.path("scene.baseline.json");
    // It says that it was made without the change, which this program cannot follow.
    let kept = fs::read_to_string(&path)
        .expect("a baseline")
        .replace("[\"slave.4.crystal\",\"49 ppm\"]", "[\"slave.4.crystal\",\"7 ppm\"]");
    fs::write(&path, kept).expect("a file");
    let page = ends(&room, 1, &["compare", "scene.toml"]);
    assert!(page.contains("first difference: ") && page.contains("station 4"), "{page}");
    assert!(page.contains("\n  before  ") && page.contains("\n  now     "), "{page}");
}

#[test]
fn what_is_no_baseline_is_refused() {
    let room = Room::new();
    let refused = |what: &str| {
        let said = ends(&room, 2, &["compare", "scene.toml", "--with", "b.json"]);
        assert!(said.starts_with("error: b.json: ") && said.contains(what) && said.contains("help: "), "{said}");
    };
    refused("there is no such file");
    for (text, what) in [
        ("", "no baseline"),
        ("{}", "no baseline"),
        ("[1, 2]", "no baseline"),
        ("\u{0}\u{1}", "no baseline"),
        ("{\"format\": \"isodp baseline\", \"version\": 99}", "form 99"),
        ("{\"format\": \"isodp baseline\", \"version\": 1}", "damaged: missing field"),
    ] {
        room.write("b.json", text);
        refused(what);
    }
    room.write("b.json", [0xFF, 0xFE]);
    refused("no text");
    fs::remove_file(room.path("b.json")).expect("a file");
    fs::create_dir(room.path("b.json")).expect("a directory");
    refused("directory");
}

/// Every kind of damage by hand is an error that says where, never a panic, and never a comparison.
#[test]
fn a_damaged_baseline_is_refused() {
    let room = Room::new();
    ends(&room, 0, &["baseline", "scene.toml", "--out", "b.json"]);
    let whole = fs::read_to_string(room.path("b.json")).expect("a baseline");
    let line = |start: &str| {
        whole.lines().find(|line| line.trim_start().starts_with(start)).unwrap_or_else(|| panic!("{start}"))
    };
    let (wire, cycles, master) = (line("\"wire\""), line("\"cycles\": {"), line("\"2\": \""));
    let first_event = whole.split("\"lines\": [\n").nth(1).and_then(|rest| rest.lines().next()).expect("an event");
    for (from, to) in [
        (wire, "\"wire\": \"xyz\","),
        (wire, "\"wires\": \"0\","),
        (cycles, "\"cycles\": {\"is\": \"75\", \"exact\": {\"count\": \"many\"}},"),
        (cycles, "\"cycles\": 75,"),
        (first_event, "      \"0 - 2\","),
        (first_event, "      \"0 - 200 text\","),
        (first_event, "      \"soon - 2 text\","),
        ("\"stride\": 1,", "\"stride\": 0,"),
        ("\"stride\": 1,", "\"stride\": 3,"),
        (master, "\"2\": \"0123\","),
        (master, "\"2\": \"zzzzzz\","),
        (master, "\"200\": \"000000\","),
        ("\"tolerances\": {}", "\"tolerances\": {\"cycles\": \"much\"}"),
        ("\"seed\": 3", "\"seed\": -3"),
        ("\"seed\": 3", "\"sead\": 3"),
    ] {
        assert!(whole.contains(from), "{from}");
        room.write("b.json", whole.replacen(from, to, 1));
        let said = ends(&room, 2, &["compare", "scene.toml", "--with", "b.json"]);
        assert!(said.starts_with("error: b.json: this baseline is damaged: "), "{to}: {said}");
    }
    for part in 1..20 {
        let octets = whole.as_bytes();
        room.write("b.json", &octets[..octets.len() * part / 20]);
        ends(&room, 2, &["compare", "scene.toml", "--with", "b.json"]);
    }
}

#[test]
fn calls_that_fit_no_run_are_refused() {
    let room = Room::new();
    ends(&room, 0, &["baseline", "scene.toml"]);
    let compare = |more: &[&str]| ends(&room, 2, &[&["compare", "scene.toml"], more].concat());
    let said = compare(&["--tolerance", "latch_scew.p99=5%"]);
    assert!(said.contains("latch_skew"), "{said}");
    assert!(compare(&["--tolerance", "nothing.*=5%"]).contains("no figure of these runs"), "{said}");
    assert!(compare(&["--tolerance", "cycles=5 ns"]).contains("no tolerance of this kind"));
    assert!(compare(&["--tolerance", "cycles=some"]).contains("is no tolerance"));
    // The baseline of another scenario.
    room.write("other.toml", fs::read(room.path("scene.toml")).expect("a scenario"));
    let said = ends(&room, 2, &["compare", "other.toml", "--with", "scene.baseline.json"]);
    assert!(said.contains("\"scene\", not of \"other\""), "{said}");
    // What is no baseline is not written over.
    room.write("notes.json", "mine");
    ends(&room, 2, &["baseline", "scene.toml", "--out", "notes.json"]);
    assert_eq!(fs::read(room.path("notes.json")).expect("a file"), b"mine");
}
