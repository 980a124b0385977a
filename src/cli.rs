//! What `isodp` can be called with, and what its help says.

pub(crate) mod progress;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use isodp::study::sweep::shard::Shard;

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
of 125 us, is searched on their grid. Values are written as the key takes them: with a unit, as a number, as a fraction
where it is a gain (1/4), with an exponent where it is a share (1e-6). Bounds of shares are those of Clopper and Pearson,
as if the number of runs had been settled beforehand.

Examples:
  isodp tolerance scenarios/gc-jitter.toml --vary master.gc_jitter.half_width --from '100 ns' --to '2 us' --step '20 ns' \
      --expect 'clock_failures == 0'
      How far the master's clock may stray until an encoder misses a clock.
  isodp tolerance scenarios/fast-cycle.toml --vary master.t_dp --from '2 ms' --to '0.5 ms' --step '125 us' --expect 'faults == 0'
      The shortest T_DP.
  isodp tolerance scenarios/fast-cycle.toml --vary slave.#1.t_sdr --from '11 tbit' --to '255 tbit' --step '1 tbit'
      How slowly all slaves may answer together.
  isodp tolerance scenarios/gc-jitter.toml --vary master.gc_jitter.half_width --to '2 us' --expect 'clock_failures == 0'
      From the scenario's own value on.

Files: tolerance_<key>.csv, .json and .svg.
Exit codes of tolerance: 0 it holds at least where the search begins, 1 not even there, 2 wrong usage, scenario or file, 130
stopped by Ctrl-C; nothing is written then.";

/// Simulates isochronous PROFIBUS DP (DP-V2) networks, telegram by telegram, in deterministic time.
#[derive(Parser)]
#[command(version, about, after_help = EXAMPLES)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Subcommand)]
pub(crate) enum Command {
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
pub(crate) struct DevicesArgs {
    /// The device to tell about.
    #[arg(value_name = "NAME")]
    pub(crate) name: Option<String>,
}

#[derive(Args)]
pub(crate) struct DisturbancesArgs {
    /// The disturbance to tell about.
    #[arg(value_name = "NAME")]
    pub(crate) name: Option<String>,
}

#[derive(Args)]
pub(crate) struct FiguresArgs {
    /// Scenario file (TOML) whose names are listed.
    #[arg(value_name = "FILE")]
    pub(crate) scenario: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct GsdArgs {
    /// GSD file of a PROFIBUS DP slave, in any language (.gsd, .gse, .gsg ...).
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
}

#[derive(Args)]
pub(crate) struct SweepArgs {
    /// Sweep file (TOML), which names its scenario.
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// Directory for the results; they go to DIR/<sweep>/.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub(crate) out: PathBuf,
    /// Runs at the same time; without it one per core.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Does part I of N of the runs, into a directory of its own; isodp merge joins the parts.
    #[arg(long, value_name = "I/N", default_value_t = Shard::ALL)]
    pub(crate) shard: Shard,
    /// Lists all runs with their parameters, seeds and keys, and what is done of them, and runs nothing.
    #[arg(long)]
    pub(crate) plan: bool,
}

#[derive(Args)]
pub(crate) struct ToleranceArgs {
    /// Scenario file (TOML).
    #[arg(value_name = "FILE")]
    pub(crate) scenario: PathBuf,
    /// The key of the scenario that is varied, as --set names it, for example master.gc_jitter.half_width.
    #[arg(long, value_name = "KEY")]
    pub(crate) vary: String,
    /// Where the search begins: a value that is expected to hold, such as '100 ns', '50 ppm', '1 %', 1e-6, 1/4 or 3; without
    /// it the scenario's own value of the key.
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub(crate) from: Option<String>,
    /// Where it ends: a value that is expected to fail, larger or smaller.
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub(crate) to: String,
    /// Tries values that are whole steps from the beginning.
    #[arg(long, value_name = "V", conflicts_with = "resolution")]
    pub(crate) step: Option<String>,
    /// Tries values that differ by at least this share of the value; without it and --step 1 %.
    #[arg(long, value_name = "P")]
    pub(crate) resolution: Option<String>,
    /// Goes from the beginning over this value, then twice as far each time; without it, halves from the end.
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub(crate) first: Option<String>,
    /// What is expected instead of the scenario's own [expect], for example 'faults == 0'. May be given several times.
    #[arg(long = "expect", value_name = "FIGURE=CONDITION")]
    pub(crate) expects: Vec<String>,
    /// How often a verdict on a value is right at least [default: 95 %].
    #[arg(long, value_name = "P")]
    pub(crate) confidence: Option<String>,
    /// A share of failing runs that is good enough, 0 for none [default: 1 %].
    #[arg(long, value_name = "P")]
    pub(crate) good_enough: Option<String>,
    /// A share of failing runs that is too much [default: 10 %].
    #[arg(long, value_name = "P")]
    pub(crate) too_much: Option<String>,
    /// Most runs of a value, which fails if they do not prove that it holds [default: 200; 1 where nothing is drawn].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub(crate) limit: Option<u64>,
    /// Further values on either side of the answer, to see whether it holds again or fails before.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(0..=1_000))]
    pub(crate) probes: u32,
    /// Runs at the same time; without it one per core. The answer is the same.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Directory for the results; they go to DIR/<scenario>/.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) changes: Changes,
}

#[derive(Args)]
pub(crate) struct MergeArgs {
    /// Directory of the whole sweep.
    #[arg(value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// Directories of its parts.
    #[arg(value_name = "PART", required = true)]
    pub(crate) parts: Vec<PathBuf>,
}

#[derive(Args)]
pub(crate) struct PlanArgs {
    /// Scenario file (TOML); its times may break rules.
    #[arg(value_name = "FILE")]
    pub(crate) scenario: PathBuf,
    /// Directory for plan.json, plan.svg and telegrams.txt; they go to DIR/<scenario>/.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub(crate) out: PathBuf,
    /// Changes a value of the scenario, for example master.t_o='1.5 ms'. May be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = assignment)]
    pub(crate) sets: Vec<(String, String)>,
    /// Shows, as a scenario, times that keep all rules with the shortest T_DP, and nothing else.
    #[arg(long, conflicts_with = "slave")]
    pub(crate) propose: bool,
    /// Shows every rule on the page, not only those that are broken or tight.
    #[arg(long, conflicts_with_all = ["propose", "slave"])]
    pub(crate) rules: bool,
    /// Shows Set_Prm and Chk_Cfg of this slave octet by octet, and nothing else.
    #[arg(long, value_name = "N")]
    pub(crate) slave: Option<u8>,
}

#[derive(Args)]
pub(crate) struct ReplayArgs {
    /// Scenario file (TOML).
    #[arg(value_name = "FILE")]
    pub(crate) scenario: PathBuf,
    /// The cycle in the middle.
    #[arg(long, value_name = "C")]
    pub(crate) cycle: u64,
    /// How many cycles before and after it are told too; with --set, how many cycles both futures go on.
    #[arg(long, value_name = "N")]
    pub(crate) window: Option<u64>,
    /// Seed of all random streams, instead of the scenario's.
    #[arg(long, value_name = "N", value_parser = seed, allow_negative_numbers = true)]
    pub(crate) seed: Option<u64>,
    /// Writes flight.txt, flight.pcapng with its dissector and flight.vcd of these cycles too, to DIR/<scenario>/; with
    /// --set what_if.svg, a picture of both futures.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// What if: from the cycle on another future runs beside the original, with this value of the scenario, for example
    /// slave.3.crystal='40 ppm'. May be given several times.
    #[arg(long = "set", visible_alias = "what-if", value_name = "KEY=VALUE", value_parser = assignment)]
    pub(crate) sets: Vec<(String, String)>,
    /// Changes a value for the whole run, as --set of isodp run does. May be given several times.
    #[arg(long = "run-set", value_name = "KEY=VALUE", value_parser = assignment)]
    pub(crate) run_sets: Vec<(String, String)>,
}

/// What is otherwise than in the scenario's file.
#[derive(Args)]
pub(crate) struct Changes {
    /// Seed of all random streams, instead of the scenario's.
    #[arg(long, value_name = "N", value_parser = seed, allow_negative_numbers = true)]
    pub(crate) seed: Option<u64>,
    /// Changes a value of the scenario, for example master.t_o='1.5 ms'. May be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = assignment)]
    pub(crate) sets: Vec<(String, String)>,
}

impl Changes {
    /// The overrides, that of the seed among them.
    pub(crate) fn sets(self) -> Vec<(String, String)> {
        with_seed(self.sets, self.seed)
    }
}

#[derive(Args)]
pub(crate) struct BaselineArgs {
    /// Scenario file (TOML).
    #[arg(value_name = "FILE")]
    pub(crate) scenario: PathBuf,
    /// The baseline; without it <scenario>.baseline.json beside the scenario file. The tolerances of one that is there stay.
    #[arg(long, value_name = "BASELINE")]
    pub(crate) out: Option<PathBuf>,
    /// By how much figures may move later: NAME=5%, NAME=100ns, NAME=3; in NAME, * stands for anything. Several times.
    #[arg(long = "tolerance", value_name = "NAME=LIMIT", value_parser = assignment)]
    pub(crate) tolerances: Vec<(String, String)>,
    #[command(flatten)]
    pub(crate) changes: Changes,
}

#[derive(Args)]
pub(crate) struct CompareArgs {
    /// Scenario file (TOML); it runs with the seed and the changed values that its baseline was written with.
    #[arg(value_name = "FILE")]
    pub(crate) scenario: PathBuf,
    /// The baseline, without it <scenario>.baseline.json beside the scenario file; or another scenario, FILE.toml.
    #[arg(long, value_name = "BASELINE")]
    pub(crate) with: Option<PathBuf>,
    /// By how much figures may move: NAME=5%, NAME=100ns, NAME=3; in NAME, * stands for anything. Without, by nothing.
    #[arg(long = "tolerance", value_name = "NAME=LIMIT", value_parser = assignment)]
    pub(crate) tolerances: Vec<(String, String)>,
    /// Shows every figure, not only those that moved.
    #[arg(long)]
    pub(crate) all: bool,
    /// Seed of all random streams, instead of the baseline's.
    #[arg(long, value_name = "N", value_parser = seed, allow_negative_numbers = true)]
    pub(crate) seed: Option<u64>,
    /// Changes a value of the scenario as well. May be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = assignment)]
    pub(crate) sets: Vec<(String, String)>,
}

#[derive(Args)]
pub(crate) struct BudgetArgs {
    /// Scenario file (TOML).
    #[arg(value_name = "FILE")]
    pub(crate) scenario: PathBuf,
    /// Directory for the results; they go to DIR/<scenario>/.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) changes: Changes,
}

#[derive(Args)]
pub(crate) struct RunArgs {
    /// Scenario files (TOML).
    #[arg(value_name = "FILE", required = true)]
    pub(crate) scenarios: Vec<PathBuf>,
    /// Directory for the results; they go to DIR/<scenario>/.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) changes: Changes,
    /// File for the verdicts on the expectations as JUnit XML.
    #[arg(long, value_name = "FILE")]
    pub(crate) junit: Option<PathBuf>,
    /// File for the verdicts on the expectations as JSON.
    #[arg(long, value_name = "FILE")]
    pub(crate) verdicts: Option<PathBuf>,
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

/// Overrides with that of the seed, where one is given.
pub(crate) fn with_seed(mut sets: Vec<(String, String)>, seed: Option<u64>) -> Vec<(String, String)> {
    sets.extend(seed.map(|seed| ("run.seed".to_owned(), seed.to_string())));
    sets
}
