//! Steady state: when it begins, and that its figures are those of the cycles from then on.

use std::fs;

use isodp::observation::{Phase, PllState};
use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::NearQueue;
use isodp::study::figure::{Figures, Value};
use isodp::study::report;
use isodp::study::run::run;
use isodp::time::Span;

use crate::cli::Room;
use crate::support::{Run, scenario};
use crate::sweep::table;

fn figures(name: &str, sets: &[(&str, &str)]) -> (Figures, String) {
    let outcome = run::<NearQueue<NetworkEvent>>(&scenario(name, sets), None, |_| ()).expect("a run without files");
    (outcome.figures, report::render(&outcome.summary, None))
}

fn value(figures: &Figures, name: &str) -> Option<Value> {
    figures.get(name).unwrap_or_else(|error| panic!("{name}: {error}"))
}
fn span(figures: &Figures, name: &str) -> Span {
    match value(figures, name) {
        Some(Value::Span(span)) => span,
        other => panic!("{name} is {other:?}"),
    }
}
fn count(figures: &Figures, name: &str) -> Option<u64> {
    match value(figures, name) {
        Some(Value::Count(count)) => Some(count),
        _ => None,
    }
}

/// Each statistic of the steady state is that of `values` in it.
fn assert_values(figures: &Figures, name: &str, mut values: Vec<Span>) {
    let of = |statistic: &str| span(figures, &format!("{name}.{statistic}"));
    assert_eq!(count(figures, &format!("{name}.count")), Some(values.len() as u64), "{name}");
    let sum: i128 = values.iter().map(|value| i128::from(value.ticks())).sum();
    let mean = sum as f64 / values.len() as f64;
    assert!((of("mean").ticks() as f64 - mean).abs() <= 0.5, "{name}: {} and {mean}", of("mean"));
    assert!(of("mean_low") <= of("mean") && of("mean") <= of("mean_high"), "{name}");
    values.sort_unstable();
    let ranked = values[(values.len() * 99).div_ceil(100) - 1];
    let resolution = 1 + ranked.ticks().abs() / 1_000;
    assert!((of("p99").ticks() - ranked.ticks()).abs() <= resolution, "{name}: {} and {ranked}", of("p99"));
    assert!(of("p99_low") <= of("p99") && of("p99") <= of("p99_high"), "{name}");
}

#[test]
fn figures_of_the_steady_state_are_those_of_its_cycles() {
    let sets = [("run.duration", "6 s")];
    let (figures, page) = figures("reference", &sets);
    let run = Run::of(&scenario("reference", &sets));
    let slaves = 9;
    let working = |cycle| {
        let rows = run.slaves.iter().filter(|row| row.cycle == cycle);
        rows.filter(|row| row.pll == PllState::Locked && row.phase == Phase::Operation).count() == slaves
    };
    let last_before = (0..1_000).find(|&cycle| working(cycle)).expect("all come into operation");
    let begin = last_before + 1;
    assert_eq!(count(&figures, "steady_state.begin_cycle"), Some(begin));
    let first = run.cycles.iter().find(|row| row.cycle == begin).expect("the cycle");
    assert_eq!(span(&figures, "steady_state.begin"), first.t0.since_zero());
    let cycles = run.cycles.iter().filter(|row| row.cycle >= begin);
    assert_eq!(count(&figures, "steady_state.cycles"), Some(cycles.clone().count() as u64));
    assert_values(&figures, "steady.latch_skew", cycles.clone().filter_map(|row| row.latch_skew).collect());
    assert_values(&figures, "steady.t_dx", cycles.filter_map(|row| row.t_dx).collect());
    let of_slave = run.slaves.iter().filter(|row| row.cycle >= begin && row.slave.get() == 6);
    assert_values(&figures, "slave.6.steady.pll_error", of_slave.filter_map(|row| row.pll_error).collect());
    let links = run.links.iter().filter(|row| row.cycle >= begin);
    assert_values(&figures, "link.3-11.steady.publish", links.map(|row| row.publish).collect());
    // The first cycles, in which one slave after the other comes, are in the distribution of the whole run alone.
    assert_ne!(count(&figures, "latch_skew.count"), count(&figures, "steady.latch_skew.count"));
    assert!(page.contains(&format!("\nsteady state from cycle {begin}, ")), "{page}");
    assert!(page.contains("no fault in them: at 95 % fewer than one in "), "{page}");
    assert!(page.contains("\n  latch skew: mean "), "{page}");
}

#[test]
fn a_fault_in_steady_state_does_not_end_it() {
    let (with, page) = figures("gc-loss", &[]);
    assert_eq!(count(&with, "steady_state.faults"), Some(1));
    let begin = count(&with, "steady_state.begin_cycle").expect("a steady state");
    assert!(begin < 200, "it began before the first missing clock, and not in cycle {begin}");
    assert_eq!(count(&with, "steady_state.cycles"), Some(700 - begin));
    assert!(page.contains(", 1 fault in them\n"), "{page}");
}

#[test]
fn a_run_without_steady_state_says_what_is_missing() {
    let (short, page) = figures("reference", &[("run.duration", "60 ms")]);
    for name in ["steady_state.begin", "steady_state.cycles", "steady.latch_skew.mean", "slave.3.steady.pll_error.p99"]
    {
        assert_eq!(value(&short, name), None, "{name}");
    }
    assert!(page.contains("\nno steady state: without sign of life of slave 3, "), "{page}");
    let (free, page) = figures("free-running", &[]);
    assert_eq!(value(&free, "steady_state.begin"), None);
    assert!(!page.contains("steady state"), "{page}");
}

#[test]
fn a_sweep_has_the_figures_of_a_run() {
    let room = Room::new();
    let names = [
        "steady_state.begin",
        "steady.latch_skew.mean",
        "steady.latch_skew.mean_high",
        "slave.max.steady.pll_error.magnitude_p99",
    ];
    room.write(
        "steady.toml",
        format!("base = \"scene.toml\"\nfigures = {names:?}\n[set]\nrun.duration = \"600 ms\"\n"),
    );
    room.runs(&["sweep", "steady.toml"]);
    let row = &table(&room.path("out/steady/results.csv"))[0];
    let cell = |column: &str| row[column].parse::<f64>().unwrap_or_else(|_| panic!("{column} of {row:?}"));
    room.runs(&["run", "scene.toml", "--seed", &row["seed"], "--set", "run.duration=600 ms"]);
    let text = fs::read_to_string(room.path("out/scene/summary.json")).expect("a summary");
    let summary: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let steady = &summary["steady_state"];
    let near = |value: &serde_json::Value, expected: f64| {
        assert!((value.as_f64().expect("a number") - expected).abs() < 1e-6, "{value} and {expected}");
    };
    near(&steady["begin_ms"], cell("steady_state_begin_ms"));
    let skew = &steady["quantities"]["latch_skew"];
    near(&skew["mean_ns"], cell("steady_latch_skew_mean_ns"));
    near(&skew["mean_high_ns"], cell("steady_latch_skew_mean_high_ns"));
    let errors =
        [3, 4].map(|slave| steady["quantities"][format!("slave.{slave}.pll_error")]["p99_ns"].as_f64().expect("ns"));
    let largest = cell("slave_max_steady_pll_error_magnitude_p99_ns");
    assert!((errors[0].max(errors[1]) - largest).abs() < 1e-6, "{errors:?} and {largest}");
    assert!(skew["p99_low_ns"].as_f64().is_some_and(|low| low <= skew["p99_ns"].as_f64().expect("ns")));
}
