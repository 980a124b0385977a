//! How far a value can go: cases whose answer is known, and what the command says and leaves.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use assert_cmd::cargo::cargo_bin;
use isodp::study::plan::Plan;
use isodp::study::scenario::Scenario;
use isodp::study::scenario::disturbance::DISTURBANCES;
use isodp::study::statistics::confidence::Confidence;
use isodp::study::statistics::probability::clopper_pearson;
use isodp::study::tolerance::command::{Call, End, ToleranceError, tolerance};
use isodp::study::tolerance::draws::drawn;
use isodp::time::Span;
use serde_json::Value;

use crate::cli::Room;
use crate::disturbance_list::NETWORK;

/// Two encoders in a network in which nothing is drawn.
const STILL: &str = r#"[run]
seed = 1
cycles = 120

[bus]
rate = "12 Mbit/s"
cable = "10 m"

[master]
address = 2
t_dp = "1 ms"
t_i = "125 us"
t_o = "625 us"
t_pll_w = "1 us"

[[slave]]
addresses = "3..4"
device = "posital-ocd-dpb1b"

[expect]
faults = "== 0"
"#;

/// One stray of SYNCH in the middle.
const STRAY: &str = "[[disturbance]]\nkind = \"gc-jitter\"\nshape = \"step\"\noffset = \"0 ns\"\ncycle = 60\nfor = 1\n";
/// Lost requests to slave 3 for 100 cycles, when it has long been in operation.
const LOSS: &str = "[[disturbance]]\nkind = \"lost-telegrams\"\nto = 3\nservice = \"data-exchange\"\nrate = \"0 %\"\n\
    cycle = 100\nfor = 100\n";

fn room(more: &str) -> Room {
    let room = Room::new();
    room.write("still.toml", [STILL, more].concat());
    room
}
fn call(room: &Room, vary: &str, from: &str, to: &str) -> Call {
    Call {
        file: room.path("still.toml"),
        out: room.path("out"),
        vary: vary.to_owned(),
        from: Some(from.to_owned()),
        to: to.to_owned(),
        probes: 2,
        threads: 1,
        ..Call::default()
    }
}
fn set(key: &str, value: &str) -> (String, String) {
    (key.to_owned(), value.to_owned())
}
/// What a call says and what its JSON holds.
#[track_caller]
fn found(call: &Call, end: End) -> (String, Value) {
    let answer = tolerance(call, &AtomicBool::new(false), |_| ()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(answer.end, end, "{}", answer.page);
    let name = call.vary.replace('.', "_").replace('#', "");
    let file = call.out.join("still").join(format!("tolerance_{name}.json"));
    (answer.page, serde_json::from_str(&fs::read_to_string(file).expect("a file")).expect("JSON"))
}
fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}
fn files(dir: PathBuf) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(dir).expect("a directory").map(|entry| entry.expect("an entry").path());
    entries.map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(path).unwrap())).collect()
}

#[test]
fn one_stray_of_synch_is_tolerated_up_to_the_window() {
    let room = room(STRAY);
    let call = Call {
        step: Some("5 ns".to_owned()),
        expects: vec!["slave.each.clock_failures=== 0".to_owned()],
        ..call(&room, "disturbance.1.offset", "0 ns", "4 us")
    };
    let (page, json) = found(&call, End::Found);
    // An error is a failure from T_PLL_W on (manual 3.3.8), told on the slave's timer grid.
    let (holds, fails) = (number(&json["holds"]), number(&json["fails"]));
    assert!((960.0..=1_040.0).contains(&holds) && (fails - holds - 5.0).abs() < 1e-9, "{page}");
    assert!(page.contains("one run    decides where nothing is drawn but where the clocks begin"), "{page}");
    for point in json["curve"].as_array().expect("a list") {
        assert_eq!((&point["runs"], point["verdict"] == "holds"), (&Value::from(1), number(&point["value"]) <= holds));
    }
}

#[test]
fn the_longest_t_sdr_is_the_one_that_the_plan_says() {
    const MOST: Span = Span::from_us(160);
    let room = room("");
    let t_dx = |t_sdr: u32| {
        let text = fs::read_to_string(room.path("still.toml")).unwrap();
        let sets = [set("slave.#1.t_sdr", &format!("{t_sdr} tbit"))];
        Plan::expected(&Scenario::parse("still", "still.toml", &text, &sets).unwrap()).t_dx
    };
    let longest = (11..=255).rev().find(|&t_sdr| t_dx(t_sdr) <= MOST).expect("one fits");
    assert!(longest > 50 && longest < 200, "{longest}");
    let call = Call {
        step: Some("1 tbit".to_owned()),
        expects: vec![format!("t_dx.max <= {MOST}")],
        ..call(&room, "slave.#1.t_sdr", "11 tbit", "255 tbit")
    };
    let (page, json) = found(&call, End::Found);
    assert_eq!(
        (number(&json["holds"]), number(&json["fails"])),
        (f64::from(longest), f64::from(longest + 1)),
        "{page}"
    );
    assert!(page.contains(&format!("\nholds up to {longest} tbit, fails from {} tbit on\n", longest + 1)), "{page}");
    let broken =
        &json["curve"].as_array().unwrap().iter().find(|point| point["verdict"] == "fails").unwrap()["first_failing"];
    let over = (t_dx(longest + 1) - MOST).as_ns() / 1e3;
    assert!((number(&broken["broken"][0]["margin"]) + over).abs() < 1e-3, "{broken} {over}");
}

#[test]
fn what_the_scenario_refuses_is_its_end_and_the_rule_is_told() {
    let room = room("");
    let call = Call { step: Some("125 us".to_owned()), ..call(&room, "master.t_o", "625 us", "1 ms") };
    let (page, json) = found(&call, End::Found);
    // T_DP - T_I - 125 us.
    assert!(page.contains("\nholds up to 750 us; 875 us is refused by the scenario\n"), "{page}");
    assert!(
        page.contains("\n875 us is refused: slave.3.t_o: ") && page.contains("\n  rule: (T_DP - T_I) - T_O >= 125 us"),
        "{page}"
    );
    let last = json["curve"].as_array().unwrap().last().unwrap().clone();
    assert_eq!((&last["verdict"], &last["runs"], &last["share"]), (&"refused".into(), &0.into(), &Value::Null));
    assert!(fs::read_to_string(room.path("out/still/tolerance_master_t_o.csv")).unwrap().contains("\n1000,refused,"));
}

#[test]
fn a_key_that_takes_multiples_alone_is_searched_on_their_grid() {
    let room = room("");
    let (page, json) = found(&call(&room, "master.t_dp", "2 ms", "0.5 ms"), End::Found);
    // T_O 625 us, 125 us to the latch, T_I 125 us (manual 3.3.5).
    assert!(page.contains("\nholds down to 0.875 ms; 0.75 ms is refused by the scenario\n"), "{page}");
    assert_eq!((&json["step"], &json["inversions"]), (&"0.125 ms".into(), &Value::Array(Vec::new())), "{page}");
}

/// The probability that losses with probability `p` in each of so many cycles make the counter exceed what is tolerated:
/// a loss adds 10, a good cycle takes 1 (manual 2.1.3; Model: D16).
fn trips(p: f64, cycles: usize, tolerated: usize) -> f64 {
    let most = 10 * tolerated;
    let mut at = vec![0.0; most + 1];
    at[0] = 1.0;
    for _ in 0..cycles {
        let mut next = vec![0.0; most + 1];
        for (counter, probability) in at.iter().enumerate() {
            next[counter.saturating_sub(1)] += probability * (1.0 - p);
            if counter + 10 <= most {
                next[counter + 10] += probability * p;
            }
        }
        at = next;
    }
    1.0 - at.iter().sum::<f64>()
}

#[test]
fn the_loss_that_is_tolerated_has_the_probability_of_its_closed_form() {
    let mut limits = Vec::new();
    // With a repeat, both requests of a cycle must be lost (Model: D7).
    for (tolerated, retries) in [(1, 0), (2, 0), (1, 1)] {
        let room = room(LOSS);
        let call = Call {
            step: Some("0.1 %".to_owned()),
            sets: vec![
                set("run.cycles", "205"),
                set("slave.#1.max_life_failures", &tolerated.to_string()),
                set("master.dx_retries", &retries.to_string()),
            ],
            expects: vec!["slave.3.faults.0F02=== 0".to_owned()],
            good_enough: Some("5 %".to_owned()),
            too_much: Some("20 %".to_owned()),
            threads: 2,
            ..call(&room, "disturbance.1.rate", "0 %", "20 %")
        };
        let (page, json) = found(&call, End::Found);
        let of = |percent: &Value| trips((number(percent) / 100.0).powi(1 + retries), 100, tolerated);
        // The band is where the test may say either.
        assert!(of(&json["holds"]) < 0.2 && of(&json["fails"]) > 0.05, "{page}");
        let sure = Confidence::new(0.9999).unwrap();
        for point in json["curve"].as_array().unwrap().iter().filter(|point| number(&point["value"]) > 0.0) {
            let [runs, failures] = ["runs", "failures"].map(|key| point[key].as_u64().unwrap());
            let expected = of(&point["value"]);
            assert!(clopper_pearson(failures, runs, sure).holds(expected), "{expected}: {point}");
        }
        assert_eq!(json["curve"][0]["runs"], 1, "nothing is drawn at 0 %");
        limits.push(number(&json["holds"]));
    }
    assert!(limits[1] > 2.0 * limits[0] && limits[2] > 3.0 * limits[0], "{limits:?}");
}

#[test]
fn a_share_of_many_runs_is_that_of_the_closed_form() {
    let room = room(LOSS);
    let call = Call {
        step: Some("0.2 %".to_owned()),
        sets: vec![set("run.cycles", "205"), set("master.dx_retries", "0")],
        expects: vec!["slave.3.faults.0F02=== 0".to_owned()],
        // So near to each other and to the truth, 0.182, that the runs do not suffice.
        good_enough: Some("18 %".to_owned()),
        too_much: Some("18.4 %".to_owned()),
        limit: Some(1_000),
        threads: 2,
        probes: 0,
        ..call(&room, "disturbance.1.rate", "1.6 %", "1.8 %")
    };
    let (page, json) = found(&call, End::Nowhere);
    let point = &json["curve"][0];
    assert_eq!((&point["runs"], &point["proven"]), (&1_000.into(), &false.into()), "{page}");
    let expected = trips(0.016, 100, 1);
    assert!(number(&point["low"]) < expected && expected < number(&point["high"]), "{expected}: {point}");
}

#[test]
fn jitter_is_tolerated_in_proportion_to_the_window() {
    let limit = |window: &str| {
        let room = room("");
        let call = Call {
            step: Some("20 ns".to_owned()),
            sets: vec![
                set("master.t_pll_w", window),
                set("run.cycles", "400"),
                set("master.gc_jitter", "{ kind = \"uniform\", half_width = \"0 ns\" }"),
            ],
            expects: vec!["slave.each.clock_failures=== 0".to_owned()],
            probes: 0,
            threads: 2,
            ..call(&room, "master.gc_jitter.half_width", "0 ns", "2 us")
        };
        number(&found(&call, End::Found).1["holds"])
    };
    let [narrow, wide] = ["1 us", "2 us"].map(limit);
    // The worst sequence of all leaves the window from 0.39 of it on; a hit is certain beyond the window itself.
    assert!((390.0..1_000.0).contains(&narrow) && (780.0..2_000.0).contains(&wide), "{narrow} {wide}");
    assert!((wide / narrow - 2.0).abs() < 0.3, "{narrow} {wide}");
}

#[test]
fn the_number_of_threads_changes_no_octet() {
    let all = [1, 2, 5].map(|threads| {
        let room = room(LOSS);
        let call = Call {
            file: PathBuf::from("still.toml"),
            step: Some("1 %".to_owned()),
            sets: vec![set("run.cycles", "205")],
            expects: vec!["slave.3.faults.0F02=== 0".to_owned()],
            threads,
            ..call(&room, "disturbance.1.rate", "0 %", "20 %")
        };
        let call = Call { file: room.path("still.toml"), ..call };
        let (page, _) = found(&call, End::Found);
        let here = room.path("").display().to_string();
        let said = |octets: &[u8]| String::from_utf8_lossy(octets).replace(&here, "");
        let files: BTreeMap<_, _> =
            files(room.path("out/still")).into_iter().map(|(name, octets)| (name, said(&octets))).collect();
        assert_eq!(files.len(), 3);
        (page.replace(&here, ""), files)
    });
    assert!(all.iter().all(|one| *one == all[0]), "{all:?}");
}

#[test]
fn where_nothing_holds_or_everything_the_page_says_so() {
    let room = room("");
    let everywhere =
        Call { expects: vec!["cycles >= 1".to_owned()], ..call(&room, "slave.3.t_sdr", "11 tbit", "100 tbit") };
    let (page, json) = found(&everywhere, End::Found);
    assert!(page.contains("\nholds up to 100 tbit, the end of the search: the limit may be farther on\n"), "{page}");
    assert_eq!((&json["answer"], &json["fails"]), (&"everywhere".into(), &Value::Null));
    let nowhere = Call { expects: vec!["cycles < 5".to_owned()], ..everywhere };
    let (page, json) = found(&nowhere, End::Nowhere);
    assert!(page.contains("\ndoes not hold at 11 tbit, where the search begins\n"), "{page}");
    assert!(page.contains("\ncycles       < 5       120       -115"), "{page}");
    assert_eq!((&json["answer"], &json["holds"]), (&"nowhere".into(), &Value::Null));
}

#[test]
fn what_holds_again_farther_on_is_told() {
    let room = room("");
    let text = fs::read_to_string(room.path("still.toml")).unwrap();
    let sets = [set("slave.#1.t_sdr", "133 tbit")];
    let t_dx = Plan::expected(&Scenario::parse("still", "still.toml", &text, &sets).unwrap()).t_dx;
    let call = Call {
        step: Some("1 tbit".to_owned()),
        expects: vec![format!("t_dx.max != {} tick", t_dx.ticks())],
        probes: 1,
        ..call(&room, "slave.#1.t_sdr", "11 tbit", "255 tbit")
    };
    let (page, json) = found(&call, End::Found);
    assert!(page.contains("\nholds up to 132 tbit, fails from 133 tbit on\n"), "{page}");
    assert!(
        page.contains("\nnot monotone: ") && page.contains("\n  133 tbit fails, and 255 tbit holds again\n"),
        "{page}"
    );
    assert_eq!(json["inversions"].as_array().unwrap().len(), 1);
}

#[test]
fn a_run_that_breaks_off_does_not_hold_and_is_named() {
    let room = room("");
    let call = Call {
        sets: vec![set("run.max_events", "1"), set("run.cycles", "20000")],
        ..call(&room, "slave.3.t_sdr", "11 tbit", "100 tbit")
    };
    let (page, json) = found(&call, End::Nowhere);
    assert!(
        page.contains("fails, 1 run broke off\n") && page.contains("\nbroke off: ") && page.contains("  isodp replay "),
        "{page}"
    );
    assert_eq!(json["curve"][0]["broke_off"], 1);
}

#[test]
fn a_search_that_is_stopped_leaves_nothing() {
    let room = room("");
    let stop = AtomicBool::new(true);
    let answer = tolerance(&call(&room, "slave.3.t_sdr", "11 tbit", "100 tbit"), &stop, |_| ()).expect("an answer");
    assert_eq!(
        (answer.end, answer.page.as_str()),
        (End::Stopped, "stopped after 0 values, 0 runs; nothing is written, and the same call begins again\n")
    );
    assert!(!room.path("out").exists());
}

#[test]
fn gains_are_searched_as_fractions() {
    // The integral part must be well below the proportional one, or the loop swings up and loses the clock (Model: D11).
    let room = room(STRAY);
    let call = Call {
        step: Some("1/64".to_owned()),
        sets: vec![set("disturbance.1.offset", "500 ns"), set("slave.3.pll.ki", "1/1024")],
        expects: vec!["slave.3.clock_failures == 0".to_owned()],
        ..call(&room, "slave.3.pll.kp", "1/2", "1/64")
    };
    let (page, json) = found(&call, End::Found);
    assert!(page.contains("how far can slave.3.pll.kp go from 1/2 towards 1/64?"), "{page}");
    assert!(page.contains("values     in steps of 1/64\n"), "{page}");
    let texts: Vec<_> = json["curve"].as_array().unwrap().iter().map(|point| point["text"].as_str().unwrap()).collect();
    assert!(texts.contains(&"1/2") && texts.contains(&"1/64"), "{texts:?}");
    assert!(texts.iter().all(|text| text.contains('/')), "{texts:?}");
    assert!(json["curve"].as_array().unwrap().iter().all(|point| point["verdict"] != "refused"), "{page}");
}

#[test]
fn shares_are_searched_with_an_exponent() {
    let room = room(&LOSS.replace("0 %", "2e-3"));
    let call = Call {
        sets: vec![set("run.cycles", "205")],
        expects: vec!["slave.3.faults.0F02=== 0".to_owned()],
        resolution: Some("20 %".to_owned()),
        good_enough: Some("5 %".to_owned()),
        too_much: Some("20 %".to_owned()),
        threads: 2,
        from: None,
        ..call(&room, "disturbance.1.rate", "", "5e-1")
    };
    let (page, json) = found(&call, End::Found);
    assert!(page.contains("how far can disturbance.1.rate go from 2e-3 towards 0.5?"), "{page}");
    assert!(page.contains("\nbegins     at 2e-3, the scenario's own value\n"), "{page}");
    assert_eq!((&json["from"], &json["from_scenario"], &json["to"]), (&0.002.into(), &true.into(), &0.5.into()));
    // Both requests of a cycle must be lost, as in the closed form.
    let of = |rate: &Value| trips(number(rate).powi(2), 100, 1);
    assert!(of(&json["holds"]) < 0.2 && of(&json["fails"]) > 0.05, "{page}");
}

#[test]
fn between_whole_numbers_are_fractions_where_the_key_takes_some() {
    let room = room(LOSS);
    for (key, from, to, step) in [
        ("slave.3.pll.kp", "1", "0", "0.001"),
        ("disturbance.1.rate", "0", "1", "0.001"),
        ("slave.#1.max_life_failures", "1", "9", "1"),
    ] {
        let call = Call {
            expects: vec!["cycles >= 1".to_owned()],
            sets: vec![set("run.cycles", "30")],
            probes: 0,
            ..call(&room, key, from, to)
        };
        let (page, json) = found(&call, End::Found);
        assert_eq!((&json["step"], &json["answer"]), (&step.into(), &"everywhere".into()), "{page}");
    }
}

#[test]
fn a_search_begins_with_the_scenarios_own_value_where_it_has_one() {
    let room = room("");
    let own = |vary: &str, to: &str| Call {
        from: None,
        expects: vec!["cycles >= 1".to_owned()],
        ..call(&room, vary, "", to)
    };
    let (page, json) =
        found(&Call { sets: vec![set("slave.#1.t_sdr", "20 tbit")], ..own("slave.4.t_sdr", "100 tbit") }, End::Found);
    assert!(
        page.contains("go from 20 tbit towards") && page.contains("begins     at 20 tbit, the scenario's own value"),
        "{page}"
    );
    assert_eq!((&json["from"], &json["from_scenario"]), (&20.0.into(), &true.into()));
    let written = Call { from: Some("625 us".to_owned()), ..own("master.t_o", "700 us") };
    let (page, json) = found(&written, End::Found);
    assert!(!page.contains("own value") && json["from_scenario"] == false, "{page}");
    let refused = |call: &Call| tolerance(call, &AtomicBool::new(false), |_| ()).unwrap_err().to_string();
    let source = room.path("still.toml").display().to_string();
    assert_eq!(
        refused(&own("slave.3.t_sdr", "100 tbit")),
        format!(
            "--vary \"slave.3.t_sdr\": {source} does not set this key, so that the search has no beginning\n  help: write --from VALUE, a value that is expected to hold"
        )
    );
    assert_eq!(
        refused(&own("slave.#1.device", "100 tbit")),
        format!(
            "--vary \"slave.#1.device\": {source} has posital-ocd-dpb1b here: \"posital-ocd-dpb1b\" is no number with a unit\n  help: write --from VALUE, a value that is expected to hold"
        )
    );
    assert!(
        refused(&own("master.t_o", "625 us")).contains("--to \"625 us\": this range begins and ends with \"625 us\"")
    );
}

#[test]
fn several_runs_are_made_where_nothing_is_drawn_if_they_are_asked_for() {
    let room = room("");
    let call = Call { limit: Some(50), probes: 0, ..call(&room, "slave.3.t_sdr", "11 tbit", "12 tbit") };
    let (page, json) = found(&call, End::Found);
    assert_eq!(
        (&json["curve"][0]["runs"], &json["curve"][0]["drawn"][0]),
        (&31.into(), &"clock starts".into()),
        "{page}"
    );
    let few = Call { limit: Some(5), ..call };
    let (page, json) = found(&few, End::Nowhere);
    assert!(page.contains("fails, unproven\n"), "{page}");
    assert_eq!((&json["curve"][0]["proven"], &json["curve"][0]["failures"]), (&false.into(), &0.into()));
}

#[test]
fn the_replay_of_the_first_failing_run_shows_it() {
    let room = room(LOSS);
    #[rustfmt::skip]
    let page = room.runs(&[
        "tolerance", "still.toml", "--vary", "disturbance.1.rate", "--from", "0 %", "--to", "40 %", "--step", "10 %",
        "--expect", "slave.3.faults.0F02 == 0", "--set", "run.cycles=205", "--set", "master.dx_retries=0", "--limit", "40",
    ]);
    let line = page.lines().find_map(|line| line.trim().strip_prefix("isodp replay ")).expect("a command line");
    assert!(line.starts_with("still.toml --seed ") && !line.contains("expect"), "{line}");
    let words: Vec<_> = line.split(" --run-set ").collect();
    let sets: Vec<_> = words[1..].iter().map(|set| set.replace('\'', "")).collect();
    let mut arguments = vec!["replay"];
    arguments.extend(words[0].split(' '));
    arguments.extend(sets.iter().flat_map(|set| ["--run-set", set]));
    assert!(room.runs(&arguments).contains("0F02"), "{arguments:?}");
    let picture = fs::read_to_string(room.path("out/still/tolerance_disturbance_1_rate.svg")).expect("a picture");
    let document = roxmltree::Document::parse(&picture).expect("an SVG");
    let words: Vec<_> = document.descendants().filter_map(|node| node.text()).map(str::trim).collect();
    for expected in
        ["still: how far can disturbance.1.rate go from 0 % towards 40 %?", "disturbance.1.rate [%]", "the answer"]
    {
        assert!(words.contains(&expected), "{expected}: {words:?}");
    }
    assert!(words.iter().any(|word| word.starts_with("the limit is between ")), "{words:?}");
}

/// A call with some words changed and others added ends with what is `expected`.
#[track_caller]
fn refuses(room: &Room, changes: &[(usize, &str)], more: &[&str], expected: &str) {
    let mut arguments =
        vec!["tolerance", "still.toml", "--vary", "slave.3.t_sdr", "--from", "11 tbit", "--to", "100 tbit"];
    for &(at, text) in changes {
        arguments[at] = text;
    }
    arguments.extend(more);
    room.refuses(&arguments, expected);
}

#[test]
fn wrong_ends_and_keys_are_told_with_what_to_do() {
    let room = room("");
    let refuses = |changes: &[(usize, &str)], expected: &str| refuses(&room, changes, &[], expected);
    refuses(
        &[(3, "t_sdr")],
        "error: --vary \"t_sdr\": this is no key of a scenario\n  help: a key names a table and a key, as --set does: \"master.t_dp\", \"slave.3.crystal\", \"slave.#1.addresses\"",
    );
    refuses(
        &[(3, "run.seed")],
        "error: --vary \"run.seed\": seeds are no parameter\n  rule: every run of a value has a seed of its own\n  help: --limit N is the largest number of runs of a value",
    );
    refuses(
        &[(3, "slave.3.t_sdx")],
        "error: --vary slave.3.t_sdx --from \"11 tbit\": slave.3.t_sdx: there is no such key\n  help: did you mean \"t_sdr\"?",
    );
    refuses(&[(5, "soon")], "error: --from \"soon\": \"soon\" is no number with a unit\n  help: such as \"125 us\"");
    refuses(
        &[(5, "1 tbit")],
        "error: --vary slave.3.t_sdr --from \"1 tbit\": slave.3.t_sdr: 1 tbit is not what this slave may take to answer\n  rule: min_tsdr = 11 tbit <= T_SDR <= MaxTsdr = 800 tbit of posital-ocd-dpb1b (Model: D2)\n  help: t_sdr = \"11 tbit\"",
    );
    refuses(&[(7, "100 us")], "error: --to \"100 us\": \"11 tbit\" and \"100 us\" are not of one kind");
}

#[test]
fn wrong_options_are_told_with_what_to_do() {
    let room = room("");
    let refuses = |changes: &[(usize, &str)], more: &[&str], expected: &str| refuses(&room, changes, more, expected);
    refuses(&[(7, "11 tbit")], &[], "error: --to \"11 tbit\": this range begins and ends with \"11 tbit\"");
    refuses(
        &[],
        &["--step", "0 tbit"],
        "error: --step \"0 tbit\": a step of \"0 tbit\" leads nowhere\n  help: write it positive, whatever the direction",
    );
    refuses(
        &[],
        &["--first", "11 tbit"],
        "error: --first \"11 tbit\": \"11 tbit\" does not lie between \"11 tbit\" and \"100 tbit\"",
    );
    refuses(
        &[],
        &["--resolution", "0 %"],
        "error: --resolution \"0 %\": a resolution is a share of the value, above 0 and below 100 %\n  help: 1 % is usual; --step takes a distance",
    );
    refuses(
        &[],
        &["--confidence", "40 %"],
        "error: --confidence \"40 %\": a confidence lies between 50 % and 100 %\n  help: 95 % is usual",
    );
    refuses(
        &[],
        &["--good-enough", "20 %"],
        "error: p0 = 0.2 and p1 = 0.1 are not in order 0 <= p0 < p1 <= 1\n  help: --good-enough is below --too-much, and --confidence above 50 %",
    );
    refuses(
        &[],
        &["--set", "slave.3.t_sdr=20 tbit"],
        "error: --vary \"slave.3.t_sdr\": this key is set and varied\n  help: leave out its --set",
    );
    refuses(
        &[],
        &["--expect", "faults"],
        "error: --expect \"faults\": this is no figure with a condition\n  help: such as 'latch_skew.p99=<= 500 ns' or 'faults == 0'",
    );
    refuses(
        &[],
        &["--expect", "falts=== 0"],
        "error: --expect \"falts=== 0\": expect.falts: there is no figure \"falts\"\n  help: did you mean \"faults\"?",
    );
    refuses(&[(1, "nowhere.toml")], &[], "error: nowhere.toml: there is no such file");
    room.write("still.toml", STILL.split("[expect]").next().unwrap());
    refuses(
        &[],
        &[],
        "error: still.toml: this scenario expects nothing, so that everything would hold\n  help: --expect 'slave.each.clock_failures == 0', or a table [expect]; isodp figures FILE lists what can be expected",
    );
}

#[test]
fn expectations_are_written_with_or_without_a_sign_between() {
    let room = room("");
    for expect in [
        "cycles>=120",
        "cycles=>= 120",
        "cycles == 120",
        "cycles=== 120",
        "cycles=[\">= 1\", \"< 121\"]",
        "in_operation=true",
    ] {
        let call =
            Call { expects: vec![expect.to_owned()], probes: 0, ..call(&room, "slave.3.t_sdr", "11 tbit", "12 tbit") };
        match tolerance(&call, &AtomicBool::new(false), |_| ()) {
            Ok(answer) => assert!(answer.end == End::Found, "{expect}: {}", answer.page),
            Err(ToleranceError::Scenario(error)) if expect.starts_with("in_") => {
                assert!(error.to_string().contains("there is no figure"), "{error}");
            }
            Err(error) => panic!("{expect}: {error}"),
        }
    }
}

#[test]
fn what_is_drawn_is_known_of_every_part_of_a_scenario() {
    let of = |text: &str, sets: &[(&str, &str)]| {
        let sets: Vec<_> = sets.iter().map(|&(key, value)| set(key, value)).collect();
        drawn(&Scenario::parse("s", "s.toml", text, &sets).unwrap_or_else(|error| panic!("{error}")))
    };
    assert!(of(STILL, &[]).is_empty());
    for (key, value, words) in [
        ("master.gc_jitter", "{ kind = \"uniform\", half_width = \"1 ns\" }", vec!["clock jitter"]),
        ("master.gc_jitter", "{ kind = \"uniform\", half_width = \"0 ns\" }", vec![]),
        ("master.gc_jitter", "{ kind = \"normal\", sigma = \"1 ns\" }", vec!["clock jitter"]),
        ("master.gc_jitter", "{ kind = \"bounded-normal\", sigma = \"1 ns\", bound = \"2 ns\" }", vec!["clock jitter"]),
        ("master.gc_jitter", "{ kind = \"sine\", amplitude = \"1 ns\", period = \"1 s\" }", vec![]),
        ("master.crystal", "{ within = \"1 ppm\" }", vec!["crystals"]),
        ("slave.4.crystal", "{ within = \"1 ppm\" }", vec!["crystals"]),
        ("slave.4.crystal", "1 ppm", vec![]),
    ] {
        assert_eq!(of(STILL, &[(key, value)]), words, "{key} = {value}");
    }
    let draw = |kind: &&isodp::study::scenario::disturbance::DisturbanceKind| {
        !of(&format!("disturbance = [{{ {} }}]\n{NETWORK}", kind.example), &[]).is_empty()
    };
    let names: Vec<_> =
        DISTURBANCES.iter().filter(|kind| kind.name != "repeater-jitter" && draw(kind)).map(|kind| kind.name).collect();
    assert_eq!(names, ["bit-errors", "noise", "crystal-wander", "receiver-jitter", "t-sdr-jitter"]);
    let lost = |rate: &str| format!("disturbance = [{{ kind = \"lost-telegrams\"{rate} }}]\n{NETWORK}");
    assert_eq!(of(&lost(", rate = \"1 %\""), &[]), ["disturbances"]);
    assert!(of(&lost(", rate = \"100 %\""), &[]).is_empty());
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_search_cleanly() {
    let room = room("");
    let call = ["tolerance", "still.toml", "--vary", "slave.3.t_sdr", "--from", "11 tbit", "--to", "100 tbit"];
    // Before it listens, Ctrl-C ends the program as any other.
    for wait in [500, 2_000, 10_000, 30_000] {
        let child = Command::new(cargo_bin!("isodp"))
            .args(call)
            .args(["--set", "run.cycles=1000000000"])
            .current_dir(room.path("."))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        std::thread::sleep(Duration::from_millis(wait));
        let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill");
        assert!(killed.success());
        let output = child.wait_with_output().expect("it ends");
        if output.status.code().is_none() {
            continue;
        }
        let page = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(output.status.code(), Some(130), "{page}");
        assert_eq!(page, "stopped after 0 values, 0 runs; nothing is written, and the same call begins again\n");
        assert!(!room.path("out").exists());
        return;
    }
    panic!("it never listened");
}
