//! Jitter of SYNCH as a disturbance, in all its shapes.

use std::path::Path;

use isodp::study::scenario::{Scenario, ScenarioError};
use isodp::time::Span;

use super::{SCENE, changed, prints, refused, tables};
use crate::support::Run;

/// A clock is where it should be but for the rounding of two crystals.
const TICK: Span = Span::from_ticks(2);
const STEADY: (&str, &str) = ("master.gc_jitter", "{ kind = \"none\" }");

/// Strays in the cycles from `from` on, the master itself having none.
fn strays<const N: usize>(disturbances: &[&str], from: u64) -> [Span; N] {
    let run = Run::of(&changed(&[STEADY], &tables(disturbances)));
    core::array::from_fn(|i| run.cycles.iter().find(|row| row.cycle == from + i as u64).expect("a cycle").gc_jitter)
}
fn assert_near<const N: usize>(strays: [Span; N], expected_ns: [i64; N]) {
    for (i, (stray, ns)) in strays.into_iter().zip(expected_ns).enumerate() {
        assert!((stray - Span::from_ns(ns)).abs() <= TICK, "{i}: {stray}, not {ns} ns: {strays:?}");
    }
}

#[test]
fn every_shape_is_seen_in_its_window_and_nowhere_else() {
    let step = "kind = \"gc-jitter\"; shape = \"step\"; offset = \"-300 ns\"; cycle = 202; for = 2";
    assert_near(strays(&[step], 200), [0, 0, -300, -300, 0, 0]);
    let again = format!("{step}; every = 3");
    assert_near(strays(&[&again], 200), [0, 0, -300, -300, 0, -300, -300, 0, -300]);
    let sine = "kind = \"gc-jitter\"; shape = \"sine\"; amplitude = \"400 ns\"; period = 4; cycle = 201; for = 6";
    assert_near(strays(&[sine], 200), [0, 0, 400, 0, -400, 0, 400, 0, 0]);
    let drift =
        "kind = \"gc-jitter\"; shape = \"drift\"; per_cycle = \"50 ns\"; bound = \"120 ns\"; cycle = 201; for = 5";
    assert_near(strays(&[drift], 200), [0, 0, 50, 100, 120, 120, 0]);
    let table = "kind = \"gc-jitter\"; shape = \"table\"; offsets = [\"10 ns\", \"-20 ns\"]; cycle = 201; for = 5";
    assert_near(strays(&[table], 200), [0, 10, -20, 10, -20, 10, 0]);
    let held = format!("{table}; repeat = false");
    assert_near(strays(&[&held], 200), [0, 10, -20, -20, -20, -20, 0]);
    assert_near(strays(&[&format!("{held}; accumulate = true")], 200), [0, 10, -10, -30, -50, -70, 0]);
    // T_DP is 2 ms, a drift of 25 us in a second is 50 ns in a cycle.
    let second = drift.replace("per_cycle = \"50 ns\"", "per_second = \"25 us\"");
    assert_near(strays(&[&second], 200), [0, 0, 50, 100, 120, 120, 0]);
}

#[test]
fn several_add_up_and_a_time_window_is_one_too() {
    let step = |name: &str, ns: i64, at: &str| {
        format!("kind = \"gc-jitter\"; name = \"{name}\"; shape = \"step\"; offset = \"{ns} ns\"; {at}")
    };
    let (one, two) = (step("one", 300, "cycle = 201; for = 3"), step("two", -100, "cycle = 203; for = 2"));
    assert_near(strays(&[&one, &two], 200), [0, 300, 300, 200, -100, 0]);
    let all = strays::<400>(&[&step("time", 70, "at = \"400 ms\"; for = \"100 ms\"")], 0);
    let in_it = all.iter().filter(|stray| (**stray - Span::from_ns(70)).abs() <= TICK).count();
    assert_eq!((in_it, all.iter().filter(|stray| stray.abs() <= TICK).count()), (50, 350));
}

#[test]
fn no_strength_changes_nothing_and_draws_are_the_disturbance_s_own() {
    let undisturbed = prints(&[]);
    for none in [
        "shape = \"none\"",
        "shape = \"uniform\"; half_width = \"0 ns\"",
        "shape = \"sine\"; amplitude = \"0 ns\"; period = \"10 ms\"; accumulate = true",
        "shape = \"uniform\"; half_width = \"100 ns\"; cycle = 99999; for = 1",
    ] {
        assert_eq!(undisturbed, prints(&[&format!("kind = \"gc-jitter\"; {none}")]), "{none}");
    }
    // The master's own draws, and those of the one, are there below the other.
    let draws = |name: &str| format!("kind = \"gc-jitter\"; name = \"{name}\"; shape = \"normal\"; sigma = \"100 ns\"");
    let (a, b) = (strays::<300>(&[&draws("a")], 0), strays::<300>(&[&draws("b")], 0));
    let both = strays::<300>(&[&draws("a"), &draws("b")], 0);
    assert!(a.iter().zip(&b).zip(&both).all(|((&a, &b), &sum)| (a + b - sum).abs() <= TICK * 3));
    assert!(a.iter().zip(&b).filter(|(a, b)| (**a - **b).abs() <= TICK).count() < 10);
}

#[test]
fn a_jitter_beyond_the_window_makes_failures_while_it_lasts() {
    let run = Run::of(&changed(
        &[STEADY],
        &tables(&["kind = \"gc-jitter\"; shape = \"uniform\"; half_width = \"5 us\"; cycle = 200; for = 50"]),
    ));
    for slave in 3..=5 {
        assert!(run.counts_of(slave).clock_failures > 0);
        assert!(run.faults_of(slave).iter().all(|&(cycle, code)| (200..260).contains(&cycle) && code == 0x0F04));
        assert!(!run.faults_of(slave).is_empty());
    }
}

#[test]
fn the_sum_of_all_bounds_has_to_fit_into_the_spare_time() {
    let sine = "kind = \"gc-jitter\"; shape = \"sine\"; amplitude = \"400 us\"; period = 50";
    let said = refused(&[sine, &format!("{sine}; name = \"second\"")]);
    assert!(
        said.contains("master.gc_jitter: jitter of 800.1 us (with the bounds of disturbances) does not fit"),
        "{said}"
    );
    let adds_up =
        "kind = \"gc-jitter\"; shape = \"step\"; offset = \"10 us\"; cycle = 10; for = 100; accumulate = true";
    assert!(refused(&[adds_up]).contains("does not fit into the spare time"));
}

fn in_directory(dir: &Path, table: &str) -> Result<Scenario, ScenarioError> {
    std::fs::write(dir.join("jitter.csv"), table).expect("a file");
    let keys = "kind = \"gc-jitter\"; shape = \"table\"; file = \"jitter.csv\"; cycle = 201; for = 4";
    let source = dir.join("scene.toml").display().to_string();
    let sets = [(STEADY.0.to_owned(), STEADY.1.to_owned())];
    Scenario::parse("scene", &source, &[SCENE, &tables(&[keys])].concat(), &sets)
}

#[test]
fn a_table_is_read_from_a_file_beside_the_scenario() {
    let room = tempfile::tempdir().expect("a directory");
    let table = "# measured\ncycle,offset_ns\n1, 0.25\n2,-40\n3,1e2\n";
    let error = in_directory(room.path(), table).expect_err("1e2 is no time").to_string();
    assert!(error.contains("jitter.csv:5: "), "{error}");
    let run =
        Run::of(&in_directory(room.path(), &table.replace("1e2", "100")).unwrap_or_else(|error| panic!("{error}")));
    let expected = [0, 0, -40, 100, 0, 0];
    for (cycle, ns) in (200..).zip(expected) {
        let stray = run.cycles.iter().find(|row| row.cycle == cycle).expect("a cycle").gc_jitter;
        assert!((stray - Span::from_ns(ns)).abs() <= TICK * 2, "{cycle}: {stray}");
    }
    for (table, says) in [
        ("offset_us\n1\n", "jitter.csv:1: there is no column offset_ns"),
        ("offset_ns\n", "a table without offsets says nothing"),
        ("offset_ns,b\n1,2\n3\n", "jitter.csv:3: this is no line of a CSV file"),
        ("offset_ns\n1\n0.1\n", "jitter.csv:3: "),
        ("offset_ns\n33000000\n", "longer than the longest T_DP"),
    ] {
        let error = in_directory(room.path(), table).expect_err(says).to_string();
        assert!(error.contains(says), "{error}");
    }
    std::fs::remove_file(room.path().join("jitter.csv")).expect("a file");
    let gone = refused(&["kind = \"gc-jitter\"; shape = \"table\"; file = \"gone.csv\""]);
    assert!(gone.contains("gone.csv: there is no such file"), "{gone}");
}

#[test]
fn shapes_without_their_keys_are_refused() {
    for (keys, says) in [
        ("shape = \"saw\"", "there is no jitter \"saw\""),
        ("shape = \"sine\"; amplitude = \"1 us\"", "disturbance.1.period: this key is missing"),
        ("shape = \"sine\"; amplitude = \"1 us\"; period = 0", "out of range"),
        ("shape = \"drift\"; bound = \"1 us\"", "either per_cycle or per_second"),
        ("shape = \"table\"", "either offsets or file"),
        ("shape = \"table\"; offsets = []", "a table without offsets says nothing"),
        ("shape = \"step\"; offset = \"33 ms\"", "longer than the longest T_DP"),
        ("shape = \"step\"; offset = \"1 ms\"; sigma = \"1 us\"", "there is no such key"),
    ] {
        let said = refused(&[&format!("kind = \"gc-jitter\"; {keys}")]);
        assert!(said.contains(says), "{keys}: {said}");
    }
}
