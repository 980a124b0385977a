//! The command line `isodp`.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::{Args, Parser, Subcommand};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::NearQueue;
use isodp::study::baseline::command as baseline;
use isodp::study::budget::Budget;
use isodp::study::compare::command as compare;
use isodp::study::export::capture;
use isodp::study::gsd::Gsd;
use isodp::study::plan::command::{Call as PlanCall, answer};
use isodp::study::replay::{self, Window};
use isodp::study::run::{Progress, layout};
use isodp::study::scenario::{Extent, Scenario, disturbance};
use isodp::study::sweep::command::{Call, End, Progress as SweepProgress, join, sweep};
use isodp::study::sweep::crew::cores;
use isodp::study::sweep::is_at_work;
use isodp::study::sweep::shard::Shard;
use isodp::study::tolerance::command::{self as tolerance, Call as ToleranceCall, End as ToleranceEnd};
use isodp::study::tolerance::trial::Progress as ToleranceProgress;
use isodp::study::what_if::command as what_if;
use isodp::study::{batch, devices, figure};
use isodp::time::Span;

/// An expectation of a run fails, a planned network breaks a rule, a figure moved beyond its tolerance, or a GSD file is
/// inconsistent.
const VIOLATED: u8 = 1;
/// A wrong call, scenario or file.
const USAGE: u8 = 2;
/// Ended by Ctrl-C, as shells tell it: 128 and the number of the signal.
const STOPPED: u8 = 130;

const EXAMPLES: &str = "\
Examples:
  isodp run scenarios/reference.toml
      The main job: a complete network, its figures on screen, files under out/reference/.
  isodp run scenarios/reference.toml --seed 7 --out /tmp/results
      The same with other draws, files under /tmp/results/reference/.
  isodp plan scenarios/reference.toml
      What its bus cycle will be and whether its times keep the rules; --propose shows times that do.
  isodp replay scenarios/reference.toml --cycle 200 --window 2
      Cycles 198 to 202 of the run once more, every telegram and what stations saw, line by line.
  isodp replay scenarios/reference.toml --cycle 200 --set slave.5.crystal='60 ppm'
      What if: from cycle 200 on a second future with this crystal runs beside the original; what differs, and when first.
  isodp devices posital-ocd-dpb1b
      What the profile of this device says; without a name, all devices.
  isodp gsd scenarios/gsd/isodp_posital_06df.gsd
      What a GSD file says; scenarios use it with device = { gsd = FILE }.
  isodp budget scenarios/gc-jitter.toml
      What uses up the clock window T_PLL_W of each encoder: jitter, crystals, timer grid, loop.
  isodp tolerance scenarios/gc-jitter.toml --vary master.gc_jitter.half_width --from '100 ns' --to '2 us' --expect 'clock_failures == 0'
      How far the master's clock may stray until an encoder misses a clock, and how surely.
  isodp run scenarios/reference.toml --set master.t_o='1.5 ms' --set slave.3.crystal='20 ppm'
      The same with changed parameters; slaves are named by their address.
  isodp run scenarios/reference.toml scenarios/startup.toml --junit verdicts.xml
      Several scenarios side by side; what became of their expectations, also as JUnit XML.
  isodp run scenarios/reference.toml --set expect.latch_skew.p99='<= 400 ns'
      The same with another expectation; isodp figures lists what can be expected.

Exit codes: 0 done and every expectation holds, 1 an expectation fails, a planned rule is violated, a figure moved too
far or a GSD file is inconsistent, 2 wrong usage, scenario or file.";

const GSD_CODES: &str = "\
Exit codes: 0 the file fits together (notes are no fault), 1 it is inconsistent: one of the findings is an error, 2 it cannot be read.";

const SWEEP_CODES: &str = "\
Exit codes: 0 all runs are done, 1 some failed or are missing, 2 wrong usage or file, 130 stopped by Ctrl-C; the same call goes on.";

const REGRESSION: &str = "\
Examples:
  isodp baseline scenarios/reference.toml --tolerance '*.p99=2%' --tolerance 'slave.each.lock_time=5 ms'
      Writes scenarios/reference.baseline.json.
  isodp compare scenarios/reference.toml
      What moved since then; the first difference by cycle, station and observation, with both values.
  isodp compare scenarios/reference.toml --set slave.5.crystal='60 ppm'
      The same with a changed value.
  isodp compare b.toml --with a.toml
      Two scenarios.

Exit codes of compare: 0 nothing moved beyond its tolerance, 1 a figure did, 2 wrong usage, file, or baseline.";

const TOLERANCE: &str = "\
Every value is run with the same seeds, one after the other, until a sequential test (Wald) has an answer: it holds where at
most --good-enough of the runs fail, and does not where --too-much and more do; each verdict is right in --confidence of
all cases. Some 31 runs without failure prove that a value holds with the usual shares. Where nothing is drawn, one run decides.
A value that the scenario refuses ends the search there, and its rule is told; a key that takes multiples alone, such as
of 125 us, is searched on their grid. Bounds of shares are those of Clopper and
Pearson, as if the number of runs had been settled beforehand.

Examples:
  isodp tolerance scenarios/gc-jitter.toml --vary master.gc_jitter.half_width --from '100 ns' --to '2 us' --step '20 ns' \
      --expect 'clock_failures == 0'
      How far the master's clock may stray until an encoder misses a clock.
  isodp tolerance scenarios/fast-cycle.toml --vary master.t_dp --from '2 ms' --to '0.5 ms' --step '125 us' --expect 'faults == 0'
      The shortest T_DP.
  isodp tolerance scenarios/fast-cycle.toml --vary slave.#1.t_sdr --from '11 tbit' --to '255 tbit' --step '1 tbit'
      How slowly all slaves may answer together.

Files: tolerance_<key>.csv, .json and .svg.
Exit codes of tolerance: 0 it holds at least where the search begins, 1 not even there, 2 wrong usage, scenario or file, 130
stopped by Ctrl-C; nothing is written then.";

/// Simulates isochronous PROFIBUS DP (DP-V2) networks, telegram by telegram, in deterministic time.
#[derive(Parser)]
#[command(version, about, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Runs scenarios and leaves figures, tables, histograms and plots; tells whether their expectations hold.
    #[command(after_help = EXAMPLES)]
    Run(RunArgs),
    /// Reckons what a scenario's bus cycle will be, and which rules its times keep, without simulating it.
    #[command(after_help = EXAMPLES)]
    Plan(PlanArgs),
    /// Shares out the clock window T_PLL_W of each encoder among jitter, crystals and timer grid, by switching them off.
    #[command(after_help = EXAMPLES)]
    Budget(BudgetArgs),
    /// Runs a scenario again and tells a stretch of it, every telegram and every observation, line by line.
    #[command(after_help = EXAMPLES)]
    Replay(ReplayArgs),
    /// Runs a scenario many times, with other parameters and other draws, on all cores; what is done is not done again.
    #[command(after_help = SWEEP_CODES)]
    Sweep(SweepArgs),
    /// Joins the parts of a sweep that several machines ran with isodp sweep --shard.
    #[command(after_help = SWEEP_CODES)]
    Merge(MergeArgs),
    /// Finds how far one value of a scenario can go until what is expected no longer holds, and how surely.
    #[command(after_help = TOLERANCE)]
    Tolerance(Box<ToleranceArgs>),
    /// Keeps what a scenario comes to, every figure and where to look for a difference, in a file to compare with later.
    #[command(after_help = REGRESSION)]
    Baseline(BaselineArgs),
    /// Runs a scenario and tells which figures moved since its baseline was written, and where the two runs parted.
    #[command(after_help = REGRESSION)]
    Compare(CompareArgs),
    /// Lists the devices that a scenario can name, or tells everything about one; others come from GSD files, see isodp gsd.
    Devices(DevicesArgs),
    /// Lists the disturbances that a scenario can name, with their keys and an example of each, or tells about one.
    Disturbances(DisturbancesArgs),
    /// Lists the figures that a run can be asked for by name: all families, or the names of one scenario.
    Figures(FiguresArgs),
    /// Shows what a GSD file says, what of it is ignored and what does not fit.
    #[command(after_help = GSD_CODES)]
    Gsd(GsdArgs),
}

#[derive(Args)]
struct DevicesArgs {
    /// The device to tell about.
    #[arg(value_name = "NAME")]
    name: Option<String>,
}

#[derive(Args)]
struct DisturbancesArgs {
    /// The disturbance to tell about.
    #[arg(value_name = "NAME")]
    name: Option<String>,
}

#[derive(Args)]
struct FiguresArgs {
    /// Scenario file (TOML) whose names are listed.
    #[arg(value_name = "FILE")]
    scenario: Option<PathBuf>,
}

#[derive(Args)]
struct GsdArgs {
    /// GSD file of a PROFIBUS DP slave, in any language (.gsd, .gse, .gsg ...).
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

#[derive(Args)]
struct SweepArgs {
    /// Sweep file (TOML), which names its scenario.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Directory for the results; they go to DIR/<sweep>/.
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// Runs at the same time; without it one per core.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Does part I of N of the runs, into a directory of its own; isodp merge joins the parts.
    #[arg(long, value_name = "I/N", default_value_t = Shard::ALL)]
    shard: Shard,
    /// Lists all runs with their parameters, seeds and keys, and what is done of them, and runs nothing.
    #[arg(long)]
    plan: bool,
}

#[derive(Args)]
struct ToleranceArgs {
    /// Scenario file (TOML).
    #[arg(value_name = "FILE")]
    scenario: PathBuf,
    /// The key of the scenario that is varied, as --set names it, for example master.gc_jitter.half_width.
    #[arg(long, value_name = "KEY")]
    vary: String,
    /// Where the search begins: a value that is expected to hold, such as '100 ns', '50 ppm', '1 %' or 3.
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    from: String,
    /// Where it ends: a value that is expected to fail, larger or smaller.
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    to: String,
    /// Tries values that are whole steps from the beginning.
    #[arg(long, value_name = "V", conflicts_with = "resolution")]
    step: Option<String>,
    /// Tries values that differ by at least this share of the value; without it and --step 1 %.
    #[arg(long, value_name = "P")]
    resolution: Option<String>,
    /// Goes from the beginning over this value, then twice as far each time; without it, halves from the end.
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    first: Option<String>,
    /// What is expected instead of the scenario's own [expect], for example 'faults == 0'. May be given several times.
    #[arg(long = "expect", value_name = "FIGURE=CONDITION")]
    expects: Vec<String>,
    /// How often a verdict on a value is right at least [default: 95 %].
    #[arg(long, value_name = "P")]
    confidence: Option<String>,
    /// A share of failing runs that is good enough, 0 for none [default: 1 %].
    #[arg(long, value_name = "P")]
    good_enough: Option<String>,
    /// A share of failing runs that is too much [default: 10 %].
    #[arg(long, value_name = "P")]
    too_much: Option<String>,
    /// Most runs of a value, which fails if they do not prove that it holds [default: 200; 1 where nothing is drawn].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    limit: Option<u64>,
    /// Further values on either side of the answer, to see whether it holds again or fails before.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(0..=1_000))]
    probes: u32,
    /// Runs at the same time; without it one per core. The answer is the same.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Directory for the results; they go to DIR/<scenario>/.
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    #[command(flatten)]
    changes: Changes,
}

#[derive(Args)]
struct MergeArgs {
    /// Directory of the whole sweep.
    #[arg(value_name = "OUT")]
    out: PathBuf,
    /// Directories of its parts.
    #[arg(value_name = "PART", required = true)]
    parts: Vec<PathBuf>,
}

#[derive(Args)]
struct PlanArgs {
    /// Scenario file (TOML); its times may break rules.
    #[arg(value_name = "FILE")]
    scenario: PathBuf,
    /// Directory for plan.json, plan.svg and telegrams.txt; they go to DIR/<scenario>/.
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// Changes a value of the scenario, for example master.t_o='1.5 ms'. May be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = assignment)]
    sets: Vec<(String, String)>,
    /// Shows, as a scenario, times that keep all rules with the shortest T_DP, and nothing else.
    #[arg(long, conflicts_with = "slave")]
    propose: bool,
    /// Shows every rule on the page, not only those that are broken or tight.
    #[arg(long, conflicts_with_all = ["propose", "slave"])]
    rules: bool,
    /// Shows Set_Prm and Chk_Cfg of this slave octet by octet, and nothing else.
    #[arg(long, value_name = "N")]
    slave: Option<u8>,
}

#[derive(Args)]
struct ReplayArgs {
    /// Scenario file (TOML).
    #[arg(value_name = "FILE")]
    scenario: PathBuf,
    /// The cycle in the middle.
    #[arg(long, value_name = "C")]
    cycle: u64,
    /// How many cycles before and after it are told too; with --set, how many cycles both futures go on.
    #[arg(long, value_name = "N")]
    window: Option<u64>,
    /// Seed of all random streams, instead of the scenario's.
    #[arg(long, value_name = "N", value_parser = seed, allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Writes flight.txt, flight.pcapng with its dissector and flight.vcd of these cycles too, to DIR/<scenario>/; with
    /// --set what_if.svg, a picture of both futures.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// What if: from the cycle on another future runs beside the original, with this value of the scenario, for example
    /// slave.3.crystal='40 ppm'. May be given several times.
    #[arg(long = "set", visible_alias = "what-if", value_name = "KEY=VALUE", value_parser = assignment)]
    sets: Vec<(String, String)>,
    /// Changes a value for the whole run, as --set of isodp run does. May be given several times.
    #[arg(long = "run-set", value_name = "KEY=VALUE", value_parser = assignment)]
    run_sets: Vec<(String, String)>,
}

/// What is otherwise than in the scenario's file.
#[derive(Args)]
struct Changes {
    /// Seed of all random streams, instead of the scenario's.
    #[arg(long, value_name = "N", value_parser = seed, allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Changes a value of the scenario, for example master.t_o='1.5 ms'. May be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = assignment)]
    sets: Vec<(String, String)>,
}

impl Changes {
    /// The overrides, that of the seed among them.
    fn sets(self) -> Vec<(String, String)> {
        with_seed(self.sets, self.seed)
    }
}

#[derive(Args)]
struct BaselineArgs {
    /// Scenario file (TOML).
    #[arg(value_name = "FILE")]
    scenario: PathBuf,
    /// The baseline; without it <scenario>.baseline.json beside the scenario file. The tolerances of one that is there stay.
    #[arg(long, value_name = "BASELINE")]
    out: Option<PathBuf>,
    /// By how much figures may move later: NAME=5%, NAME=100ns, NAME=3; in NAME, * stands for anything. Several times.
    #[arg(long = "tolerance", value_name = "NAME=LIMIT", value_parser = assignment)]
    tolerances: Vec<(String, String)>,
    #[command(flatten)]
    changes: Changes,
}

#[derive(Args)]
struct CompareArgs {
    /// Scenario file (TOML); it runs with the seed and the changed values that its baseline was written with.
    #[arg(value_name = "FILE")]
    scenario: PathBuf,
    /// The baseline, without it <scenario>.baseline.json beside the scenario file; or another scenario, FILE.toml.
    #[arg(long, value_name = "BASELINE")]
    with: Option<PathBuf>,
    /// By how much figures may move: NAME=5%, NAME=100ns, NAME=3; in NAME, * stands for anything. Without, by nothing.
    #[arg(long = "tolerance", value_name = "NAME=LIMIT", value_parser = assignment)]
    tolerances: Vec<(String, String)>,
    /// Shows every figure, not only those that moved.
    #[arg(long)]
    all: bool,
    /// Seed of all random streams, instead of the baseline's.
    #[arg(long, value_name = "N", value_parser = seed, allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Changes a value of the scenario as well. May be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = assignment)]
    sets: Vec<(String, String)>,
}

#[derive(Args)]
struct BudgetArgs {
    /// Scenario file (TOML).
    #[arg(value_name = "FILE")]
    scenario: PathBuf,
    /// Directory for the results; they go to DIR/<scenario>/.
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    #[command(flatten)]
    changes: Changes,
}

#[derive(Args)]
struct RunArgs {
    /// Scenario files (TOML).
    #[arg(value_name = "FILE", required = true)]
    scenarios: Vec<PathBuf>,
    /// Directory for the results; they go to DIR/<scenario>/.
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    #[command(flatten)]
    changes: Changes,
    /// File for the verdicts on the expectations as JUnit XML.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// File for the verdicts on the expectations as JSON.
    #[arg(long, value_name = "FILE")]
    verdicts: Option<PathBuf>,
}

fn assignment(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((key, value)) if !key.trim().is_empty() => Ok((key.trim().to_owned(), value.trim().to_owned())),
        _ => Err(format!("{text:?} is no KEY=VALUE, such as master.t_o='1.5 ms'")),
    }
}

fn seed(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| format!("a seed is a whole number from 0 to {}", u64::MAX))
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Run(args) => run_command(args),
        Command::Plan(args) => plan_command(args),
        Command::Budget(args) => budget_command(args).map(done),
        Command::Replay(args) => replay_command(args).map(done),
        Command::Sweep(args) => sweep_command(args),
        Command::Merge(args) => merge_command(&args),
        Command::Tolerance(args) => tolerance_command(*args),
        Command::Baseline(args) => baseline_command(args).map(done),
        Command::Compare(args) => compare_command(args),
        Command::Devices(args) => devices_command(args.name.as_deref()).map(done),
        Command::Disturbances(args) => disturbances_command(args.name.as_deref()).map(done),
        Command::Figures(args) => figures_command(args.scenario.as_deref()).map(done),
        Command::Gsd(args) => gsd_command(&args.file),
    };
    match result.and_then(|(page, code)| show(&page).map(|()| code)) {
        Ok(code) => code,
        Err(error) => {
            // Where standard error is gone too, the exit code is all that can be told.
            let _ = writeln!(anstream::stderr(), "error: {error}");
            ExitCode::from(USAGE)
        }
    }
}

/// A page of a command that did what it should.
fn done(page: String) -> (String, ExitCode) {
    (page, ExitCode::SUCCESS)
}

/// Prints `page`. A reader that has seen enough and closes its end is fine.
fn show(page: &str) -> Result<(), Box<dyn std::error::Error>> {
    let mut out = anstream::stdout();
    match out.write_all(page.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(format!("the files are written, but the page cannot be shown: {error}").into())
        }
        _ => Ok(()),
    }
}

fn run_command(args: RunArgs) -> Result<(String, ExitCode), Box<dyn std::error::Error>> {
    let RunArgs { scenarios: files, changes, out, junit, verdicts } = args;
    let call = batch::Call { files, sets: changes.sets(), out, junit, verdicts };
    let scenarios = batch::load(&call)?;
    for warning in batch::warnings_of(&scenarios) {
        // Where standard error is gone, the summary tells.
        let _ = writeln!(anstream::stderr(), "warning: {warning}");
    }
    let bar = match &scenarios[..] {
        [scenario] => Some(Bar::new(scenario)),
        _ => None,
    };
    let watch = |at| bar.iter().for_each(|bar| bar.show(at));
    let answer = batch::answer(&call, &scenarios, watch)?;
    if let Some(bar) = &bar {
        bar.line.finish_and_clear();
    }
    let code = if answer.passed { ExitCode::SUCCESS } else { ExitCode::from(VIOLATED) };
    Ok((answer.page, code))
}

fn plan_command(args: PlanArgs) -> Result<(String, ExitCode), Box<dyn std::error::Error>> {
    let PlanArgs { scenario: file, out, sets, propose, rules, slave } = args;
    let answer = answer(&PlanCall { file, sets, propose, rules, slave, out })?;
    let code = if answer.violated { ExitCode::from(VIOLATED) } else { ExitCode::SUCCESS };
    Ok((answer.page, code))
}

fn budget_command(args: BudgetArgs) -> Result<String, Box<dyn std::error::Error>> {
    let scenario = Scenario::load(&args.scenario, &args.changes.sets())?;
    for warning in batch::warnings_of(std::slice::from_ref(&scenario)) {
        let _ = writeln!(anstream::stderr(), "warning: {warning}");
    }
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    bar.set_prefix(scenario.name.clone());
    bar.set_style(
        ProgressStyle::with_template("{prefix} [{bar:30}] {pos} of {len} runs").expect("a template that is right"),
    );
    let budget = Budget::of(&scenario, |runs| {
        bar.set_length(runs as u64);
        bar.inc(1);
    })?;
    bar.finish_and_clear();
    let dir = args.out.join(&scenario.name);
    let files = budget.write(&scenario, &dir)?;
    Ok(format!("{}{} in {}\n", budget.page(), files.join(", "), dir.display()))
}

fn devices_command(name: Option<&str>) -> Result<String, Box<dyn std::error::Error>> {
    Ok(name.map_or_else(|| Ok(devices::list()), devices::full)?)
}

fn disturbances_command(name: Option<&str>) -> Result<String, Box<dyn std::error::Error>> {
    Ok(name.map_or_else(|| Ok(disturbance::list()), disturbance::full)?)
}

fn figures_command(file: Option<&Path>) -> Result<String, Box<dyn std::error::Error>> {
    Ok(match file {
        Some(file) => figure::page::of(&layout(&Scenario::load(file, &[])?)),
        None => figure::page::list(),
    })
}

fn replay_command(args: ReplayArgs) -> Result<String, Box<dyn std::error::Error>> {
    let ReplayArgs { scenario: file, cycle, window, seed, out, sets, run_sets } = args;
    let run_sets = with_seed(run_sets, seed);
    if !sets.is_empty() {
        return what_if::answer(&what_if::Call { file, run_sets, sets, cycle, window, out });
    }
    let scenario = Scenario::load(&file, &run_sets)?;
    let around = Window::around(cycle, window.unwrap_or(0));
    let recording = replay::record::<NearQueue<NetworkEvent>>(&scenario, around)?;
    let page = replay::text(&recording);
    let Some(out) = out else { return Ok(page) };
    let dir = out.join(&scenario.name);
    let files = capture::write(&dir, &recording)?;
    Ok(format!("{page}\n{} files in {}\n", files.len(), dir.display()))
}

fn sweep_command(args: SweepArgs) -> Result<(String, ExitCode), Box<dyn std::error::Error>> {
    let SweepArgs { file, out, threads, shard, plan } = args;
    let stop = stop_on_ctrl_c()?;
    quiet_runs();
    let bar = SweepBar::new();
    let threads = threads.map_or_else(cores, usize::from);
    let answer = sweep(&Call { file, out, threads, shard, plan }, &stop, |at| bar.show(at))?;
    bar.0.finish_and_clear();
    Ok((answer.page, code(answer.end)))
}

/// What Ctrl-C sets.
fn stop_on_ctrl_c() -> Result<Arc<AtomicBool>, ctrlc::Error> {
    let stop = Arc::new(AtomicBool::new(false));
    let told = Arc::clone(&stop);
    ctrlc::set_handler(move || told.store(true, Ordering::Relaxed))?;
    Ok(stop)
}

/// Says nothing of a run that breaks off: the page names it.
fn quiet_runs() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !is_at_work() {
            usual(panic);
        }
    }));
}

fn tolerance_command(args: ToleranceArgs) -> Result<(String, ExitCode), Box<dyn std::error::Error>> {
    let stop = stop_on_ctrl_c()?;
    quiet_runs();
    let call = ToleranceCall {
        file: args.scenario,
        sets: args.changes.sets(),
        out: args.out,
        vary: args.vary,
        from: args.from,
        to: args.to,
        step: args.step,
        resolution: args.resolution,
        first: args.first,
        expects: args.expects,
        confidence: args.confidence,
        good_enough: args.good_enough,
        too_much: args.too_much,
        limit: args.limit,
        probes: args.probes,
        threads: args.threads.map_or_else(cores, usize::from),
    };
    let bar = ToleranceBar::new();
    let answer = tolerance::tolerance(&call, &stop, |at| bar.show(&at))?;
    bar.0.finish_and_clear();
    let code = match answer.end {
        ToleranceEnd::Found => ExitCode::SUCCESS,
        ToleranceEnd::Nowhere => ExitCode::from(VIOLATED),
        ToleranceEnd::Stopped => ExitCode::from(STOPPED),
    };
    Ok((answer.page, code))
}

fn merge_command(args: &MergeArgs) -> Result<(String, ExitCode), Box<dyn std::error::Error>> {
    let answer = join(&args.out, &args.parts)?;
    Ok((answer.page, code(answer.end)))
}

fn code(end: End) -> ExitCode {
    match end {
        End::Done => ExitCode::SUCCESS,
        End::Failed => ExitCode::from(VIOLATED),
        End::Stopped => ExitCode::from(STOPPED),
    }
}

fn baseline_command(args: BaselineArgs) -> Result<String, Box<dyn std::error::Error>> {
    let BaselineArgs { scenario: file, out, tolerances, changes } = args;
    baseline::answer(&baseline::Call { file, sets: changes.sets(), out, tolerances })
}

fn compare_command(args: CompareArgs) -> Result<(String, ExitCode), Box<dyn std::error::Error>> {
    let CompareArgs { scenario: file, with, tolerances, all, seed, sets } = args;
    let answer = compare::answer(&compare::Call { file, with, sets: with_seed(sets, seed), tolerances, all })?;
    let code = if answer.beyond { ExitCode::from(VIOLATED) } else { ExitCode::SUCCESS };
    Ok((answer.page, code))
}

/// Overrides with that of the seed, where one is given.
fn with_seed(mut sets: Vec<(String, String)>, seed: Option<u64>) -> Vec<(String, String)> {
    sets.extend(seed.map(|seed| ("run.seed".to_owned(), seed.to_string())));
    sets
}

fn gsd_command(file: &Path) -> Result<(String, ExitCode), Box<dyn std::error::Error>> {
    let gsd = Gsd::load(file)?;
    let code = if gsd.is_inconsistent() { ExitCode::from(VIOLATED) } else { ExitCode::SUCCESS };
    Ok((gsd.to_string(), code))
}

/// The progress bar; nothing where standard error is no terminal.
struct Bar {
    line: ProgressBar,
    end: Option<Span>,
    cycles: Option<u64>,
    started: Instant,
}

impl Bar {
    /// Positions are thousandths of the run.
    const LENGTH: u64 = 1_000;

    fn new(scenario: &Scenario) -> Self {
        let (end, cycles) = match scenario.run.duration {
            Extent::Time(span) => (Some(span), None),
            Extent::Cycles(cycles) => (None, Some(cycles)),
        };
        let target = ProgressDrawTarget::stderr();
        let bar = ProgressBar::with_draw_target(Some(Self::LENGTH), target);
        let style = ProgressStyle::with_template("{prefix} [{bar:30}] {percent:>3} %  {msg}  {eta} left");
        bar.set_style(style.expect("a template that is right").progress_chars("=> "));
        bar.set_prefix(scenario.name.clone());
        bar.enable_steady_tick(Duration::from_millis(200));
        Self { line: bar, end, cycles, started: Instant::now() }
    }

    fn show(&self, at: Progress) {
        let share = match (self.end, self.cycles) {
            (Some(end), _) => at.simulated.as_s() / end.as_s(),
            (_, Some(cycles)) => at.cycles as f64 / cycles.max(1) as f64,
            _ => 1.0,
        };
        self.line.set_position((share * Self::LENGTH as f64) as u64);
        let speed = at.simulated.as_s() / self.started.elapsed().as_secs_f64().max(1e-9);
        self.line.set_message(format!(
            "{:.1} s simulated, cycle {}, {speed:.0} x real time",
            at.simulated.as_s(),
            at.cycles
        ));
    }
}

/// The progress bar of a sweep.
struct SweepBar(ProgressBar);

impl SweepBar {
    fn new() -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template("[{bar:30}] {pos} of {len} runs{msg}  {per_sec}  {eta} left");
        bar.set_style(style.expect("a template that is right").progress_chars("=> "));
        bar.enable_steady_tick(Duration::from_millis(200));
        Self(bar)
    }

    fn show(&self, at: SweepProgress) {
        self.0.set_length(at.runs as u64);
        self.0.set_position(at.done as u64);
        if at.failed > 0 {
            self.0.set_message(format!(", {} failed", at.failed));
        }
    }
}

/// The progress line of a search, whose end nobody knows.
struct ToleranceBar(ProgressBar);

impl ToleranceBar {
    fn new() -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template("{spinner} {msg}  {elapsed}");
        bar.set_style(style.expect("a template that is right"));
        bar.enable_steady_tick(Duration::from_millis(200));
        Self(bar)
    }

    fn show(&self, at: &ToleranceProgress) {
        let ToleranceProgress { value, values, runs, failures } = at;
        self.0.set_message(format!("{values} values done, {value}: {runs} runs, {failures} failed"));
    }
}
