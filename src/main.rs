//! The command line `isodp`.

mod cli;

use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Parser;
use cli::progress::{Bar, SweepBar, ToleranceBar};
use cli::{
    BaselineArgs, BudgetArgs, Cli, Command, CompareArgs, MergeArgs, PlanArgs, ReplayArgs, RunArgs, SweepArgs,
    ToleranceArgs, with_seed,
};
use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::NearQueue;
use isodp::study::baseline::command as baseline;
use isodp::study::budget::Budget;
use isodp::study::compare::command as compare;
use isodp::study::export::capture;
use isodp::study::gsd::Gsd;
use isodp::study::plan::command::{Call as PlanCall, answer};
use isodp::study::replay::{self, Window};
use isodp::study::run::layout;
use isodp::study::scenario::{Scenario, disturbance};
use isodp::study::sweep::command::{Call, End, join, sweep};
use isodp::study::sweep::crew::cores;
use isodp::study::sweep::is_at_work;
use isodp::study::tolerance::command::{self as tolerance, Call as ToleranceCall, End as ToleranceEnd};
use isodp::study::what_if::command as what_if;
use isodp::study::{batch, devices, figure};

/// An expectation of a run fails, a planned network breaks a rule, a figure moved beyond its tolerance, or a GSD file is
/// inconsistent.
const VIOLATED: u8 = 1;
/// A wrong call, scenario or file.
const USAGE: u8 = 2;
/// Ended by Ctrl-C, as shells tell it: 128 and the number of the signal.
const STOPPED: u8 = 130;

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
    let bar = SweepBar::new();
    let budget = Budget::of(&scenario, |runs| {
        bar.0.set_length(runs as u64);
        bar.0.inc(1);
    })?;
    bar.0.finish_and_clear();
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

fn gsd_command(file: &Path) -> Result<(String, ExitCode), Box<dyn std::error::Error>> {
    let gsd = Gsd::load(file)?;
    let code = if gsd.is_inconsistent() { ExitCode::from(VIOLATED) } else { ExitCode::SUCCESS };
    Ok((gsd.to_string(), code))
}
