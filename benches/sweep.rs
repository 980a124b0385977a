//! What a sweep costs beside its runs, and what a second thread brings.
//!
//! ```text
//! cargo bench --bench sweep             nine rounds, medians
//! cargo bench --bench sweep -- --test   one short round, only to see that it runs
//! ```
//!
//! Each round does the same runs three times, one way after the other: plainly, as a program would that wants two figures
//! and no more; as a sweep on one thread, with its journal, tables and pictures; as a sweep on two. The share is that of
//! one round: a slow spell of the machine meets all three.

use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::NearQueue;
use isodp::study::figure::Figure;
use isodp::study::measure::measure;
use isodp::study::pool::Pools;
use isodp::study::scenario::Scenario;
use isodp::study::sweep::command::{Call, End, sweep};
use isodp::study::sweep::shard::Shard;
use std::hint::black_box;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// What is wanted of each run.
const FIGURES: [&str; 2] = ["latch_skew.p99", "faults"];

/// The runs: repetitions of the reference scenario with draws in common.
struct Work {
    base: String,
    runs: u64,
    /// Simulated time of each run.
    duration: &'static str,
}

impl Work {
    fn scenario(&self) -> Scenario {
        let sets = [("run.duration".to_owned(), self.duration.to_owned())];
        let mut scenario = Scenario::load(Path::new(&self.base), &sets).expect("the reference scenario");
        scenario.expectations.clear();
        scenario
    }
    /// Time of all runs without a sweep [s].
    fn plainly(&self) -> f64 {
        let figures = FIGURES.map(|name| Figure::named(name).expect("a figure"));
        let begun = Instant::now();
        let (mut scenario, mut memory) = (self.scenario(), None);
        let seed = scenario.run.seed;
        for number in 0..self.runs {
            scenario.run.seed = seed + number;
            let wanted = (&figures[..], &mut Pools::none());
            let told = measure::<NearQueue<NetworkEvent>>(wanted, &scenario, memory.take(), |_| true);
            let told = told.expect("headway").expect("nobody stops it");
            black_box(figures.each_ref().map(|figure| told.value(figure)));
            memory = Some(told.into_histograms());
        }
        begun.elapsed().as_secs_f64()
    }
    /// Time of a sweep over the same runs [s].
    fn as_sweep(&self, threads: usize) -> f64 {
        let dir = tempfile::tempdir().expect("a directory");
        let Self { base, runs, duration } = self;
        let text = format!(
            "base = {base:?}\nrepetitions = {runs}\ndraws = \"common\"\nexpect = \"own\"\nfigures = {FIGURES:?}\n\
             set = {{ run.duration = {duration:?} }}\n"
        );
        let file = dir.path().join("bench.toml");
        std::fs::write(&file, text).expect("a sweep file");
        let out = dir.path().join("out");
        let call = Call { file, out, threads, shard: Shard::ALL, plan: false };
        let begun = Instant::now();
        let answer = sweep(&call, &AtomicBool::new(false), |_| ()).expect("a sweep");
        let time = begun.elapsed().as_secs_f64();
        assert_eq!(answer.end, End::Done, "{}", answer.page);
        time
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let short = std::env::args().any(|arg| arg == "--test");
    let base = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/reference.toml").to_owned();
    // Some 0.1 s and some 0.01 s of one core each.
    let all = if short { vec![("0.1 s", 2)] } else { vec![("50 s", 12), ("5 s", 120)] };
    let rounds = if short { 1 } else { 9 };
    println!("simulated  runs   one run [ms]   beside the runs [%]   one thread / two");
    for (duration, runs) in all {
        let work = Work { base: base.clone(), runs, duration };
        let round = |_| (work.plainly(), work.as_sweep(1), work.as_sweep(2));
        let times: Vec<_> = (0..rounds).map(round).collect();
        let of = |value: fn(&(f64, f64, f64)) -> f64| median(times.iter().map(value).collect());
        println!(
            "{duration:>9}  {runs:>4}   {:>12.1}   {:>19.2}   {:>16.2}",
            of(|times| times.0) * 1e3 / runs as f64,
            of(|times| 100.0 * (times.1 / times.0 - 1.0)),
            of(|times| times.1 / times.2),
        );
    }
}
