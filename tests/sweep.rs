//! Sweeps: what is computed, what is not computed twice, and that the results do not tell how they came about.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::cargo::cargo_bin;
use isodp::study::statistics::confidence::Confidence;
use isodp::study::statistics::student::student_quantile;
use isodp::study::sweep::key::MODEL_VERSION;

use crate::cli::Room;

/// Two half widths of the jitter, two cable lengths, three repetitions of [`SCENE`](crate::cli::SCENE).
const SWEEP: &str = r#"# Does the window hold?
base = "scene.toml"
repetitions = 3
figures = ["latch_skew.p99", "faults", "slave.max.lock_time", "slave.3.in_operation", "slave.4.pll_error.max"]
pool = ["latch_skew", "slave.4.pll_error"]
[set]
run.duration = "400 ms"
"master.gc_jitter" = { kind = "uniform", half_width = "100 ns" }

[[axis]]
key = "bus.cable"
values = ["10 m", "0.1 km"]

[[axis]]
key = "master.gc_jitter.half_width"
from = "100 ns"
to = "300 ns"
step = "200 ns"
"#;

fn room() -> Room {
    let room = Room::new();
    room.write("jitter.toml", SWEEP);
    room
}

/// Every file below, with what it holds.
pub(crate) fn files(dir: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(dir).unwrap_or_else(|error| panic!("{}: {error}", dir.display())) {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            let below = files(&path);
            let inside = |name| Path::new(path.file_name().unwrap()).join(name);
            found.extend(below.into_iter().map(|(name, octets)| (inside(name), octets)));
        } else {
            let name = PathBuf::from(path.file_name().expect("a name"));
            found.insert(name, fs::read(&path).expect("a file"));
        }
    }
    found
}

/// A CSV file as rows by the names of their columns.
pub(crate) fn table(path: &Path) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).expect("a table");
    reader.deserialize().collect::<Result<_, _>>().expect("rows")
}

#[test]
fn every_run_has_a_row_with_its_parameters_and_figures() {
    let room = room();
    let page = room.runs(&["sweep", "jitter.toml"]);
    assert!(
        page.starts_with("sweep jitter: 4 combinations, 12 runs\n12 runs done now, 0 before, 0 failed\n"),
        "{page}"
    );
    let never = "\nfaults: 0 in every run of 4 of 4 combinations; 3 runs of each leave it possible, at 95 %, that up to 63.16 % \
                 have one (rule of three)\n";
    assert!(page.contains(never), "{page}");
    let rows = table(&room.path("out/jitter/results.csv"));
    let parameters: Vec<_> = rows
        .iter()
        .map(|row| {
            [&row["bus_cable_m"], &row["master_gc_jitter_half_width_ns"], &row["repetition"]].map(String::as_str)
        })
        .collect();
    let expected: Vec<_> = ["10", "100"]
        .iter()
        .flat_map(|&cable| ["100", "300"].map(|width| (cable, width)))
        .flat_map(|(cable, width)| ["1", "2", "3"].map(|repetition| [cable, width, repetition]))
        .collect();
    assert_eq!(parameters, expected);
    for row in &rows {
        assert_eq!((row["status"].as_str(), row["faults"].as_str()), ("done", "0"), "{row:?}");
        assert!(row["latch_skew_p99_ns"].parse::<f64>().unwrap() > 0.0, "{row:?}");
    }
    let summary = table(&room.path("out/jitter/summary.csv"));
    assert_eq!(summary.len(), 4);
    let skews = rows[..3].iter().map(|row| row["latch_skew_p99_ns"].parse::<f64>().unwrap());
    // The table tells times to the picosecond, the mean is that of the ticks of 1/12 ns.
    let mean = skews.clone().map(|skew| (skew * 12.0).round()).sum::<f64>() / 36.0;
    assert!((summary[0]["mean_latch_skew_p99_ns"].parse::<f64>().unwrap() - mean).abs() < 1e-9);
    let largest = summary[0]["max_latch_skew_p99_ns"].parse::<f64>().unwrap();
    assert_eq!(largest.total_cmp(&skews.fold(0.0, f64::max)), Ordering::Equal, "{largest}");
    assert_eq!((summary[0]["runs"].as_str(), summary[0]["failed"].as_str()), ("3", "0"));
}

#[test]
fn a_row_says_what_a_run_of_its_parameters_says() {
    let room = room();
    room.runs(&["sweep", "jitter.toml"]);
    let row = &table(&room.path("out/jitter/results.csv"))[10];
    let sets =
        ["run.duration=400 ms", "bus.cable=0.1 km", "master.gc_jitter={ kind = \"uniform\", half_width = \"300 ns\" }"];
    let sets = sets.iter().flat_map(|set| ["--set", set]);
    let arguments: Vec<_> = ["run", "scene.toml", "--seed", &row["seed"]].into_iter().chain(sets).collect();
    room.runs(&arguments);
    let summary: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(room.path("out/scene/summary.json")).unwrap()).unwrap();
    let p99 = &summary["distributions"]["latch_skew"]["p99_ns"];
    let skew = row["latch_skew_p99_ns"].parse::<f64>().unwrap();
    assert_eq!(skew.total_cmp(&p99.as_f64().unwrap()), Ordering::Equal, "{skew} and {p99}");
}

#[test]
fn what_a_sweep_is_not_asked_any_more_it_does_not_leave() {
    let room = room();
    room.runs(&["sweep", "jitter.toml"]);
    let has = |file: &str| room.path("out/jitter").join(file).exists();
    let files = ["tail_latch_skew.svg", "pooled_latch_skew.csv", "pooled_latch_skew_bins.csv", "curve_faults.svg"];
    assert!(files.iter().all(|file| has(file)));
    room.write("out/jitter/curve of mine.txt", "kept");
    room.write("jitter.toml", SWEEP.replacen("\"latch_skew\", ", "", 1).replacen("\"faults\", ", "", 1));
    let page = room.runs(&["sweep", "jitter.toml"]);
    assert!(page.contains("\n0 runs done now, 12 before, 0 failed\n"), "{page}");
    assert!(!files.iter().any(|file| has(file)));
    assert!(has("curve of mine.txt") && has("results.csv") && has("tail_slave_4_pll_error.svg"));
}

#[test]
fn a_pool_has_every_value_of_every_repetition_and_knows_where_the_largest_was() {
    let room = room();
    let page = room.runs(&["sweep", "jitter.toml"]);
    let results = table(&room.path("out/jitter/results.csv"));
    let pooled = table(&room.path("out/jitter/pooled_slave_4_pll_error.csv"));
    assert_eq!(pooled.len(), 4);
    let number = |text: &str| text.parse::<f64>().unwrap_or_else(|_| panic!("{text}"));
    for (pool, runs) in pooled.iter().zip(results.chunks(3)) {
        let largest = runs.iter().max_by(|one, other| {
            let of = |row: &BTreeMap<String, String>| number(&row["slave_4_pll_error_max_ns"]);
            of(one).total_cmp(&of(other))
        });
        let largest = largest.unwrap();
        assert_eq!((&pool["max_ns"], &pool["max_run"]), (&largest["slave_4_pll_error_max_ns"], &largest["run"]));
        assert_eq!((pool["runs"].as_str(), &pool["bus_cable_m"]), ("3", &largest["bus_cable_m"]));
        let ordered = ["min_ns", "p50_ns", "p90_ns", "p99_ns", "p99_9_ns", "p99_99_ns", "p99_999_ns", "max_ns"];
        assert!(ordered.map(|column| number(&pool[column])).is_sorted(), "{pool:?}");
    }
    // Every bin, and no value twice.
    let bins = table(&room.path("out/jitter/pooled_slave_4_pll_error_bins.csv"));
    let counted: f64 = bins.iter().map(|bin| number(&bin["count"])).sum();
    let values: f64 = pooled.iter().map(|pool| number(&pool["n"])).sum();
    assert!((counted - values).abs() < 0.5 && values > 12.0 * 150.0, "{counted} {values}");
    // The cycle that the page names has the value, seen by a run of its own.
    let line = page.lines().find(|line| line.starts_with("slave.4.pll_error: farthest from zero is ")).expect(&page);
    let replay = page.lines().skip_while(|other| *other != line).nth(1).unwrap().trim();
    let cycle = line.split("cycle ").nth(1).unwrap().split(' ').next().unwrap();
    assert!(
        replay.starts_with("isodp replay scene.toml --seed ") && replay.ends_with(&format!(" --cycle {cycle}")),
        "{replay}"
    );
    let words = shell_words(replay);
    let seed = words.iter().skip_while(|word| *word != "--seed").nth(1).unwrap();
    let sets = words.iter().zip(words.iter().skip(1)).filter(|(word, _)| *word == "--run-set");
    let mut call = vec!["run", "scene.toml", "--seed", seed, "--set", "record.rows=100000"];
    sets.for_each(|(_, set)| call.extend(["--set", set.as_str()]));
    room.runs(&call);
    let slaves = table(&room.path("out/scene/slaves.csv"));
    let row = slaves.iter().find(|row| row["cycle"] == cycle && row["slave"] == "4").expect("the cycle is recorded");
    let value = line.split("zero is ").nth(1).unwrap().split(' ').next().unwrap();
    assert!((number(&row["pll_error_ns"]) - number(value)).abs() < 0.01, "{row:?} {line}");
}

/// The words of a call, as a shell reads them that knows no more than single quotes.
fn shell_words(line: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    for (number, part) in line.split('\'').enumerate() {
        if number % 2 == 1 {
            words.last_mut().unwrap().push_str(part);
            continue;
        }
        for (number, piece) in part.split(' ').enumerate() {
            if number > 0 {
                words.push(String::new());
            }
            words.last_mut().unwrap().push_str(piece);
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

#[test]
fn results_are_the_same_for_any_number_of_threads() {
    let room = room();
    for threads in ["1", "2", "4"] {
        room.runs(&["sweep", "jitter.toml", "--threads", threads, "--out", threads]);
    }
    let of = |threads| files(&room.path(threads));
    let expected = 5 + usize::from(cfg!(feature = "parquet")) + 3 * 5 + 3 * 2;
    assert_eq!(of("1").len(), expected, "plan, journal, lock, two tables; pictures of five figures; two pools");
    assert_eq!(of("1"), of("2"));
    assert_eq!(of("1"), of("4"));
}

#[test]
fn a_torn_journal_costs_only_the_runs_that_it_lost() {
    let room = room();
    room.runs(&["sweep", "jitter.toml"]);
    let whole = files(&room.path("out"));
    let journal = room.path("out/jitter/runs/journal.jsonl");
    let octets = fs::read(&journal).unwrap();
    fs::write(&journal, &octets[..octets.len() / 2 + 7]).unwrap();
    let kept = lines(&octets[..octets.len() / 2 + 7]);
    let page = room.runs(&["sweep", "jitter.toml"]);
    assert!(page.contains(&format!("\n{} runs done now, {kept} before, 0 failed\n", 12 - kept)), "{page}");
    assert_eq!(files(&room.path("out")), whole);
}

#[test]
fn more_values_and_repetitions_add_runs_and_repeat_none() {
    let room = room();
    room.runs(&["sweep", "jitter.toml"]);
    let more = SWEEP
        .replace("repetitions = 3", "repetitions = 4")
        .replace("[\"10 m\", \"0.1 km\"]", "[\"100 m\", \"1 km\", \"1000 cm\"]")
        .replace("# Does the window hold?", "# Another question?");
    room.write("jitter.toml", &more);
    let page = room.runs(&["sweep", "jitter.toml"]);
    assert!(page.contains("\n12 runs done now, 12 before, 0 failed\n"), "{page}");
    let page = room.runs(&["sweep", "jitter.toml"]);
    assert!(page.contains("\n0 runs done now, 24 before, 0 failed\n"), "{page}");
    // Axes in another order: other rows, the same runs.
    let (head, axes) = more.split_once("[[axis]]").unwrap();
    let (first, second) = axes.split_once("[[axis]]").unwrap();
    room.write("jitter.toml", format!("{head}[[axis]]{second}\n[[axis]]{first}"));
    let page = room.runs(&["sweep", "jitter.toml"]);
    assert!(page.contains("\n0 runs done now, 24 before, 0 failed\n"), "{page}");
    // A figure that no run has told yet is another matter.
    room.write("jitter.toml", more.replace("\"faults\",", "\"faults\", \"retries\","));
    let page = room.runs(&["sweep", "jitter.toml"]);
    assert!(page.contains("\n24 runs done now, 0 before, 0 failed\n"), "{page}");
}

#[test]
fn parts_of_a_sweep_become_the_whole_in_any_order() {
    let room = room();
    room.runs(&["sweep", "jitter.toml", "--out", "whole"]);
    let parts: Vec<_> = (1..=3).map(|number| format!("out/jitter.part-{number}-of-3")).collect();
    for number in ["1/3", "2/3", "3/3"] {
        let page = room.runs(&["sweep", "jitter.toml", "--shard", number]);
        assert!(page.contains(&format!("part {number}")), "{page}");
    }
    let whole = files(&room.path("whole/jitter"));
    let [a, b, c] = [&parts[0], &parts[1], &parts[2]].map(String::as_str);
    room.runs(&["merge", "abc", a, b, c]);
    room.runs(&["merge", "cab", c, a, b, a]);
    let output = room.call(&["merge", "steps", b]);
    assert_eq!(output.status.code(), Some(1), "runs are missing");
    let page = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(page.contains("runs are in none of the parts"), "{page}");
    assert!(!room.path("steps/results.csv").exists());
    room.runs(&["merge", "steps", a, c]);
    room.runs(&["merge", "steps", "steps", b]);
    for merged in ["abc", "cab", "steps"] {
        assert_eq!(files(&room.path(merged)), whole, "{merged}");
    }
}

#[test]
fn parts_of_different_sweeps_stay_apart() {
    let room = room();
    room.runs(&["sweep", "jitter.toml", "--out", "one"]);
    room.write("jitter.toml", SWEEP.replace("300 ns", "500 ns"));
    room.runs(&["sweep", "jitter.toml", "--out", "two"]);
    let output = room.call(&["merge", "both", "one/jitter", "two/jitter"]);
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.starts_with("error: one/jitter and two/jitter are parts of different sweeps"), "{said}");
    assert!(!room.path("both").exists());
}

/// The sweep with runs that take long enough to be in the middle of.
fn long() -> Room {
    let room = room();
    room.write("jitter.toml", SWEEP.replace("400 ms", "2 s").replace("repetitions = 3", "repetitions = 6"));
    room
}

/// Whole lines.
fn lines(octets: &[u8]) -> usize {
    octets.split(|&octet| octet == b'\n').count() - 1
}

/// Starts the sweep and waits until some of its runs are done.
fn begin(room: &Room) -> Child {
    begin_and_do(room, 3)
}

/// The same until so many are.
#[expect(clippy::zombie_processes, reason = "who asked for it waits for it")]
fn begin_and_do(room: &Room, runs: usize) -> Child {
    let child = Command::new(cargo_bin!("isodp"))
        .args(["sweep", "jitter.toml", "--threads", "2"])
        .current_dir(room.path("."))
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    let end = Instant::now() + Duration::from_secs(120);
    loop {
        let journal = fs::read(room.path("out/jitter/runs/journal.jsonl")).unwrap_or_default();
        if lines(&journal) >= runs {
            return child;
        }
        assert!(Instant::now() < end, "no run is done");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// The results of the whole sweep, undisturbed and after what was begun in `room`.
fn both(room: &Room) -> [BTreeMap<PathBuf, Vec<u8>>; 2] {
    assert!(!room.path("out/jitter/results.csv").exists(), "it was over before it was disturbed");
    let page = room.runs(&["sweep", "jitter.toml"]);
    assert!(!page.contains(", 0 before"), "{page}");
    room.runs(&["sweep", "jitter.toml", "--out", "undisturbed"]);
    ["out", "undisturbed"].map(|dir| files(&room.path(dir)))
}

#[test]
fn a_killed_sweep_goes_on_to_the_same_results() {
    let room = long();
    let mut child = begin(&room);
    child.kill().expect("it can be killed");
    child.wait().expect("it ends");
    let [resumed, undisturbed] = both(&room);
    assert_eq!(resumed, undisturbed);
}

#[cfg(unix)]
#[test]
fn an_interrupted_sweep_says_how_it_goes_on() {
    let room = long();
    let child = begin(&room);
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill");
    assert!(killed.success());
    let output = child.wait_with_output().expect("it ends");
    let page = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(130), "{page}");
    assert!(page.contains("isodp sweep jitter.toml --out out\n"), "{page}");
    let [resumed, undisturbed] = both(&room);
    assert_eq!(resumed, undisturbed);
}

#[test]
fn a_plan_lists_the_runs_and_runs_nothing() {
    let room = room();
    let page = room.runs(&["sweep", "jitter.toml", "--plan"]);
    assert!(!room.path("out").exists());
    assert_eq!(page.matches(" to do ").count(), 12, "{page}");
    assert!(page.contains("'bus.cable=0.1 km' 'master.gc_jitter.half_width=300 ns'"), "{page}");
    assert!(page.contains("4 combinations to run, 12 runs, 0 of them done"), "{page}");
    let parts: Vec<_> =
        ["1/2", "2/2"].map(|part| room.runs(&["sweep", "jitter.toml", "--plan", "--shard", part])).to_vec();
    assert_eq!(parts.iter().map(|page| page.matches(" to do ").count()).sum::<usize>(), 12);
    room.runs(&["sweep", "jitter.toml"]);
    let after = room.runs(&["sweep", "jitter.toml", "--plan"]);
    assert!(after.contains("12 of them done\nto do: 0 slave-cycles"), "{after}");
    for row in table(&room.path("out/jitter/results.csv")) {
        assert!(after.contains(&format!("{} done ", row["run"])), "{row:?}");
    }
}

#[test]
fn draws_are_common_or_a_combinations_own() {
    let seeds = |draws: &str| {
        let room = room();
        room.write("jitter.toml", SWEEP.replace("repetitions = 3", &format!("repetitions = 3\ndraws = \"{draws}\"")));
        room.runs(&["sweep", "jitter.toml"]);
        let rows = table(&room.path("out/jitter/results.csv"));
        rows.into_iter().map(|row| row["seed"].parse::<u64>().unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(seeds("common"), [3, 4, 5].repeat(4), "the scenario's seed and those after it");
    let mut own = seeds("independent");
    own.sort_unstable();
    own.dedup();
    assert_eq!(own.len(), 12);
}

#[test]
fn conditions_and_rules_leave_combinations_out() {
    let room = room();
    let skips = "\n[[skip]]\nbus.cable = \"> 50 m\"\n\"master.gc_jitter.half_width\" = \">= 300 ns\"\n";
    room.write("jitter.toml", SWEEP.to_owned() + skips);
    let page = room.runs(&["sweep", "jitter.toml"]);
    assert!(
        page.starts_with("sweep jitter: 3 combinations, 9 runs\n1 combinations left out by conditions\n"),
        "{page}"
    );
    // T_O of 2 ms is beyond T_DP for one of the values.
    let invalid = SWEEP.replace(
        "[[axis]]\nkey = \"bus.cable\"\nvalues = [\"10 m\", \"0.1 km\"]",
        "[[axis]]\nkey = \"master.t_dp\"\nvalues = [\"2 ms\", \"1 ms\"]",
    );
    room.write("jitter.toml", &invalid);
    let output = room.call(&["sweep", "jitter.toml"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("2 combinations are refused, first master.t_dp = 1 ms, "), "{said}");
    room.write("jitter.toml", invalid.replace("repetitions = 3", "repetitions = 3\ninvalid = \"skip\""));
    let page = room.runs(&["sweep", "jitter.toml"]);
    assert!(page.starts_with("sweep jitter: 2 combinations, 6 runs\n2 combinations refused:\n"), "{page}");
}

#[test]
fn the_number_of_slaves_is_a_parameter_with_a_label() {
    let room = room();
    let axis =
        "[[axis]]\nname = \"encoders\"\nkey = \"slave.#1.addresses\"\nvalues = [\"3\", \"3..4\"]\nlabels = [1, 2]\n";
    let (head, _) = SWEEP.split_once("[[axis]]").unwrap();
    room.write(
        "jitter.toml",
        format!("{}{axis}", head.replace(", \"slave.4.pll_error.max\"", ", \"slave.4.lock_time\"")),
    );
    room.runs(&["sweep", "jitter.toml"]);
    let rows = table(&room.path("out/jitter/results.csv"));
    let cells: Vec<_> =
        rows.iter().step_by(3).map(|row| (&row["encoders"][..], &row["slave_1_addresses"][..])).collect();
    assert_eq!(cells, [("1", "3"), ("2", "3..4")]);
    assert_eq!(rows[0]["slave_4_lock_time_ms"], "", "there is no slave 4");
}

#[test]
fn a_run_that_fails_is_told_with_its_replay_and_the_others_go_on() {
    let room = room();
    let axis = "[[axis]]\nkey = \"run.max_events\"\nvalues = [1, 1000000]\n";
    let (head, _) = SWEEP.split_once("[[axis]]").unwrap();
    room.write(
        "jitter.toml",
        format!("{}{axis}", head.replace("400 ms", "10 s").replace("repetitions = 3", "repetitions = 2")),
    );
    let output = room.call(&["sweep", "jitter.toml"]);
    let page = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(1), "{page}");
    assert!(page.contains("\n4 runs done now, 0 before, 2 failed\n"), "{page}");
    let rows = table(&room.path("out/jitter/results.csv"));
    let status: Vec<_> = rows.iter().map(|row| (&row["run_max_events"][..], &row["status"][..])).collect();
    assert_eq!(status, [("1", "failed"), ("1", "failed"), ("1000000", "done"), ("1000000", "done")]);
    let replay = page.lines().map(str::trim).find(|line| line.starts_with("isodp replay ")).expect("a replay");
    assert!(replay.starts_with(&format!("isodp replay scene.toml --seed {} --run-set ", rows[0]["seed"])), "{replay}");
    // What failed is tried again, what is done is not.
    let page = String::from_utf8_lossy(&room.call(&["sweep", "jitter.toml"]).stdout).into_owned();
    assert!(page.contains("\n2 runs done now, 2 before, 2 failed\n"), "{page}");
}

#[test]
fn broken_expectations_are_told_of_each_run() {
    let room = room();
    room.write("jitter.toml", SWEEP.replace("[set]", "[set]\n\"expect.t_dp_deviation.max\" = \"<= 250 ns\""));
    room.runs(&["sweep", "jitter.toml"]);
    let rows = table(&room.path("out/jitter/results.csv"));
    for row in &rows {
        let expected = if row["master_gc_jitter_half_width_ns"] == "100" { "passed" } else { "broken" };
        assert_eq!(row["status"], expected, "{row:?}");
    }
    let broken: Vec<_> = table(&room.path("out/jitter/summary.csv")).iter().map(|row| row["broken"].clone()).collect();
    assert_eq!(broken, ["0", "3", "0", "3"]);
    let page = room.runs(&["sweep", "jitter.toml"]);
    assert!(page.contains("\n0 runs done now, 12 before, 0 failed\n"), "{page}");
}

#[test]
fn whatever_a_scenario_says_its_runs_are_known_again() {
    let room = Room::new();
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    for name in ["reference", "gsd-device", "gc-loss", "two-masters", "repeaters", "dxb-network"] {
        let base = scenarios.join(format!("{name}.toml"));
        let text = format!("base = {base:?}\nfigures = [\"cycles\"]\n");
        room.write("one.toml", text);
        let plan = || room.runs(&["sweep", "one.toml", "--plan"]);
        let [first, second] = [plan(), plan()];
        assert!(first.contains(" to do "), "{first}");
        assert_eq!(first, second, "{name}");
    }
}

#[test]
fn pictures_show_figures_against_and_over_parameters() {
    let room = room();
    room.runs(&["sweep", "jitter.toml"]);
    for kind in ["curve_latch_skew_p99", "heat_latch_skew_p99", "cumulative_latch_skew_p99", "tail_latch_skew"] {
        let text = fs::read_to_string(room.path(&format!("out/jitter/{kind}.svg"))).expect("a picture");
        let document = roxmltree::Document::parse(&text).expect("an SVG");
        let words: Vec<_> = document.descendants().filter_map(|node| node.text()).map(str::trim).collect();
        assert!(words.iter().any(|text| text.contains("latch_skew")), "{kind}: {words:?}");
        assert!(words.iter().any(|text| text.contains("sweep jitter of scene.toml, 12 runs")), "{kind}: {words:?}");
    }
}

/// What is wrong with a sweep file, exactly.
#[track_caller]
fn refused(change: (&str, &str), expected: &str) {
    let room = room();
    room.write("jitter.toml", SWEEP.replacen(change.0, change.1, 1));
    let output = room.call(&["sweep", "jitter.toml"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!((output.status.code(), said.as_str()), (Some(2), expected));
    assert!(!room.path("out").exists());
}

#[test]
fn wrong_sweep_files_are_told_with_place_and_remedy() {
    refused(
        ("\"faults\", ", "\"falts\", "),
        r#"error: jitter.toml:4:30: figures: there is no figure "falts"
  4 | figures = ["latch_skew.p99", "falts", "slave.max.lock_time", "slave.3.in_operation", "slave.4.pll_error.max"]
    |                              ^^^^^^^
  help: did you mean "faults"?
"#,
    );
    refused(
        ("\"slave.4.pll_error\"]", "\"slave.max.pll_error\"]"),
        r#"error: jitter.toml:5:23: pool: "slave.max.pll_error" is a quantity of several, and a pool is that of one
  5 | pool = ["latch_skew", "slave.max.pll_error"]
    |                       ^^^^^^^^^^^^^^^^^^^^^
  help: name one of them, such as "slave.3.pll_error"
"#,
    );
    refused(
        ("\"slave.4.pll_error\"]", "\"slave.9.pll_error\"]"),
        r#"error: jitter.toml:5:23: pool: this network has no slave 9
  5 | pool = ["latch_skew", "slave.9.pll_error"]
    |                       ^^^^^^^^^^^^^^^^^^^
  help: it has slave 3, 4, 5
"#,
    );
    refused(
        ("repetitions = 3", "repetitions = 0"),
        "error: jitter.toml:3:15: repetitions: 0 is out of range\n  3 | repetitions = 0\n    |               ^\n  help: a whole number \
         from 1 to 1000000\n",
    );
    refused(
        ("repetitions = 3", "repetition = 3"),
        "error: jitter.toml:3:1: repetition: there is no such key\n  3 | repetition = 3\n    | ^^^^^^^^^^\n  help: did you mean \
         \"repetitions\"?\n",
    );
    refused(
        ("step = \"200 ns\"", "step = \"150 ns\""),
        "error: jitter.toml:16:8: axis.2.from: steps of \"150 ns\" do not lead from \"100 ns\" to \"300 ns\"\n  16 | from = \"100 \
         ns\"\n     |        ^^^^^^^^\n  rule: a range ends with its last value\n",
    );
    refused(("base = \"scene.toml\"", "base = \"nowhere.toml\""), "error: nowhere.toml: there is no such file\n");
}

/// What is wrong with the values of the cable, in words that begin like this.
#[track_caller]
fn refused_cable(cable: &str, expected: &[&str]) {
    let room = room();
    room.write("jitter.toml", SWEEP.replace("\"0.1 km\"", cable));
    let output = room.call(&["sweep", "jitter.toml"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    for expected in expected {
        assert!(said.contains(expected), "{said}");
    }
    assert!(!room.path("out").exists());
}

#[test]
fn values_that_the_scenario_does_not_take_are_told_where_the_sweep_has_them() {
    refused_cable(
        "\"1 parsec\"",
        &["error: jitter.toml:12:19: bus.cable: \"1 parsec\" has the unit", "values = [\"10 m\", \"1 parsec\"]"],
    );
    refused_cable("{ a = 1 }", &["error: jitter.toml:12:19: bus.cable: this is a table"]);
    let room = room();
    room.write("jitter.toml", SWEEP.replace("key = \"bus.cable\"", "key = \"bus.cabel\""));
    let output = room.call(&["sweep", "jitter.toml"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("jitter.toml:12:11: bus.cabel: there is no such key"), "{said}");
    assert!(said.contains("4 combinations are refused, first bus.cabel = 10 m, "), "{said}");
}

#[test]
#[cfg(unix)]
fn without_room_for_temporary_files_a_sweep_says_so() {
    let room = room();
    let mut call = Command::new(cargo_bin("isodp"));
    let call = call.args(["sweep", "jitter.toml"]).current_dir(room.path(".")).env("TMPDIR", room.path("nowhere"));
    let output = call.output().expect("the command runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.starts_with("error: cannot index the journal out/jitter/runs/journal.jsonl: no temporary file in "),
        "{said}"
    );
    assert!(said.contains("nowhere") && said.contains("; TMPDIR names another directory"), "{said}");
    assert!(!room.path("out/jitter/results.csv").exists());
}

#[test]
fn two_calls_do_not_write_one_journal() {
    let room = long();
    let mut child = begin(&room);
    let output = room.call(&["sweep", "jitter.toml"]);
    child.kill().expect("it can be killed");
    child.wait().expect("it ends");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.starts_with("error: another call of isodp is at work on out/jitter/runs; "), "{said}");
}

#[test]
fn a_stop_rule_repeats_until_the_mean_is_known() {
    let room = room();
    let until = "repetitions = 10\nuntil = { figure = \"latch_skew.p99\", relative_half_width = \"0.1 %\", half_width = \
                 \"10 ns\", max_repetitions = 14 }";
    room.write("jitter.toml", SWEEP.replace("repetitions = 3", until));
    room.runs(&["sweep", "jitter.toml", "--threads", "1"]);
    let summary = table(&room.path("out/jitter/summary.csv"));
    let mut runs = Vec::new();
    for row in &summary {
        let of = |statistic: &str| row[&format!("{statistic}_latch_skew_p99_ns")].parse::<f64>().unwrap();
        let half_width = (of("high") - of("low")) / 2.0;
        let count: u32 = row["runs"].parse().unwrap();
        assert!((10..=14).contains(&count), "{row:?}");
        assert!(count == 14 || half_width <= (of("mean") * 0.001).max(10.0), "{row:?}");
        runs.push(count);
    }
    room.runs(&["sweep", "jitter.toml", "--threads", "4", "--out", "four"]);
    assert_eq!(files(&room.path("four")), files(&room.path("out")));
    for part in ["1/2", "2/2"] {
        room.runs(&["sweep", "jitter.toml", "--shard", part]);
    }
    room.runs(&["merge", "merged/jitter", "out/jitter.part-1-of-2", "out/jitter.part-2-of-2"]);
    assert_eq!(files(&room.path("merged")), files(&room.path("four")), "{runs:?}");
}

/// Half widths of the mean of `values` and the mean itself, by Student's t at 95 %.
fn half_width(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / (count - 1.0);
    (student_quantile(count - 1.0, Confidence::USUAL) * (variance / count).sqrt(), mean)
}

#[test]
fn a_stop_rule_goes_on_until_the_mean_is_known_and_not_further_whatever_stops_it() {
    let room = room();
    let until = "repetitions = 10\nuntil = { figure = \"slave.4.pll_error.max\", relative_half_width = \"8 %\", \
                 max_repetitions = 400 }";
    room.write("jitter.toml", SWEEP.replace("repetitions = 3", until).replace("400 ms", "1 s"));
    // Into the runs that the rule asks for beyond the first 40.
    let mut child = begin_and_do(&room, 45);
    child.kill().expect("it can be killed");
    child.wait().expect("it ends");
    let kept = lines(&fs::read(room.path("out/jitter/runs/journal.jsonl")).expect("a journal"));
    assert!(!room.path("out/jitter/results.csv").exists(), "it was over before it was killed");
    let page = room.runs(&["sweep", "jitter.toml"]);
    let rows = table(&room.path("out/jitter/results.csv"));
    let (total, now) = (rows.len(), rows.len() - kept);
    assert!(page.contains(&format!("\n{now} runs done now, {kept} before, 0 failed\n")), "{total} runs: {page}");
    for threads in ["1", "2"] {
        room.runs(&["sweep", "jitter.toml", "--threads", threads, "--out", threads]);
        assert_eq!(files(&room.path(threads)), files(&room.path("out")), "{threads} threads");
    }
    let mut counts = Vec::new();
    for combination in rows.chunk_by(|one, other| {
        ["bus_cable_m", "master_gc_jitter_half_width_ns"].iter().all(|column| one[*column] == other[*column])
    }) {
        let values: Vec<f64> = combination.iter().map(|row| row["slave_4_pll_error_max_ns"].parse().unwrap()).collect();
        // A quarter more each time: all counts that the rule looked at before.
        let looks = std::iter::successors(Some(10), |count| Some((count + count / 4).min(400)));
        let looks: Vec<usize> = looks.take_while(|&count| count <= values.len()).take(40).collect();
        let (last, before) = looks.split_last().expect("ten at least");
        assert_eq!(*last, values.len(), "{looks:?}");
        for &count in before {
            let (half, mean) = half_width(&values[..count]);
            assert!(half > 0.08 * mean, "{count} of {} were enough", values.len());
        }
        let (half, mean) = half_width(&values);
        assert!(half <= 0.08 * mean, "{half} of {mean} after {} runs", values.len());
        counts.push(values.len());
    }
    assert_eq!(counts.len(), 4);
    assert!(counts.iter().any(|&count| count > 10) && counts.iter().all(|&count| count < 400), "{counts:?}");
}

/// What a part of the shipped scenarios comes to under this version of the model.
const KNOWN: (u32, [(&str, &str); 4]) = (
    2,
    [
        (
            "reference",
            "fingerprint: wire 9a842c5cedd35a70  states 9fa8ca288d0b4be2  latches bf2ab7bf4e70cdf4  statistics ffb931e6000471d5",
        ),
        (
            "slave-to-slave",
            "fingerprint: wire c45eb035672ac1c0  states 5ec204d7090ebe20  latches d0c71df4dd85e94d  statistics d5e4cb2c6ce9bc4c",
        ),
        (
            "burst-noise",
            "fingerprint: wire 375a62fedba3a5af  states 90701b8d5efb2edc  latches a8c708195974e55a  statistics 4e7874e2cff0e4c7",
        ),
        (
            "lost-token",
            "fingerprint: wire d5fc5958f005c161  states 5a501d2237f96d28  latches 30a0f6048ed3c2ad  statistics 457a8c8a5e2f6ebc",
        ),
    ],
);

#[test]
fn the_version_of_the_model_is_raised_with_fingerprints() {
    let (version, known) = KNOWN;
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    for (name, fingerprint) in known {
        let text = fs::read_to_string(golden.join(format!("{name}.txt"))).expect("a golden file");
        let now = text.lines().find(|line| line.starts_with("fingerprint")).expect("a fingerprint");
        assert_eq!(
            (MODEL_VERSION, now),
            (version, fingerprint),
            "{name}: a fingerprint changed, so finished runs of sweeps count no more: raise MODEL_VERSION in \
             src/study/sweep/key.rs and take both over here"
        );
    }
}
