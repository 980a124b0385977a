//! Page: what the commands say on screen.

use std::fmt::Write;
use std::path::Path;

use super::command::{Call, Failures};
use super::journal::{Journal, JournalError};
use super::plan::{Base, Job, Plan};
use super::pooled::Worst;
use super::shard::Shard;
use super::summary::Never;
use crate::study::report::number;

/// What a cycle of a slave costs in a sweep, rows and histograms included (ns): time of the reference network in
/// `benches/sweep.rs` on a virtual AMD EPYC. It is an estimate before the first run, and nothing depends on it.
const NS_PER_SLAVE_CYCLE: u64 = 320;
/// Most failed runs and refused combinations that a page names.
pub(super) const NAMED: usize = 10;

/// The files of a sweep that is over, and what may not be taken for granted of them.
#[derive(Default)]
pub(super) struct Concluded {
    pub(super) files: Vec<String>,
    /// Counts that were never above 0.
    pub(super) never: Vec<Never>,
    /// Where pooled quantities were farthest from zero.
    pub(super) worst: Vec<Worst>,
}

impl Concluded {
    /// Where the files are and what was farthest from zero; what was never seen is no less possible for it.
    fn text(&self, plan: &Plan, base: &str, dir: &Path) -> String {
        let mut text = String::new();
        for Worst { name, value, job, cycle } in &self.worst {
            let _ = writeln!(text, "{name}: farthest from zero is {value}, in cycle {cycle} of run {}", job.key);
            let _ = writeln!(text, "    {}", replay(plan, base, *job, *cycle));
        }
        for Never { figure, combinations, runs, bound } in &self.never {
            let (all, confidence) = (plan.combinations_to_run(), plan.definition.confidence);
            let _ = writeln!(
                text,
                "{figure}: 0 in every run of {combinations} of {all} combinations; {} of each leave it possible, at \
                 {confidence}, that up to {:.2} % have one (rule of three)",
                number(*runs, "run"),
                bound * 100.0
            );
        }
        text + &format!("\nfiles in {}: {}\n", dir.display(), self.files.join(", "))
    }
}

/// Runs that are done.
#[derive(Clone, Copy, Debug)]
pub(super) struct Counts {
    /// Before this call.
    pub(super) before: usize,
    /// In this call.
    pub(super) done: usize,
}

/// What failed, and how to see it again.
pub(super) struct Failed<'a> {
    /// The scenario's file.
    pub(super) base: &'a str,
    pub(super) failures: &'a Failures,
}

/// The plan of `isodp sweep --plan`.
///
/// # Errors
/// The journal cannot be read.
pub(super) fn plan(plan: &Plan, base: &Base, call: &Call, journal: Option<&Journal>) -> Result<String, JournalError> {
    let mut page =
        format!("sweep {} of {}, model {}\n\n", plan.definition.name, base.source, env!("CARGO_PKG_VERSION"));
    for axis in &plan.definition.axes {
        let ends = [0, axis.len() - 1].map(|value| axis.label(value));
        let keys =
            if axis.keys == [axis.name.as_str()] { String::new() } else { format!(" ({})", axis.keys.join(", ")) };
        let _ = writeln!(page, "axis {}{keys}: {} values, {} to {}", axis.name, axis.len(), ends[0], ends[1]);
    }
    page += &refused(plan);
    let _ =
        writeln!(page, "\n{:<32} {:<5} {:>5} {:>20} {:>12}  parameters", "run", "state", "rep", "seed", "slave-cycles");
    let (mut runs, mut done, mut work) = (0_u64, 0_u64, 0_u64);
    for job in plan.jobs_of(call.shard) {
        let is_done = journal.map_or(Ok(false), |journal| journal.has(job.key))?;
        let cost = plan.work[job.combination as usize];
        (runs, done) = (runs + 1, done + u64::from(is_done));
        work = work.saturating_add(if is_done { 0 } else { cost });
        let state = if is_done { "done" } else { "to do" };
        let parameters = parameters(plan, job.combination);
        let _ =
            writeln!(page, "{} {state:<5} {:>5} {:>20} {cost:>12}  {parameters}", job.key, job.repetition, job.seed);
    }
    let part = if call.shard.is_all() { String::new() } else { format!(" in part {}", call.shard) };
    let seconds = work.saturating_mul(NS_PER_SLAVE_CYCLE) as f64 / 1e9;
    let _ = writeln!(
        page,
        "\n{} combinations to run, {runs} runs{part}, {done} of them done\nto do: {work} slave-cycles, about {seconds:.1} s on one core at {NS_PER_SLAVE_CYCLE} ns each",
        plan.combinations_to_run(),
    );
    Ok(page)
}

/// The end of a sweep.
pub(super) fn done(
    plan: &Plan,
    shard: Shard,
    counts: Counts,
    failed: &Failed<'_>,
    dir: &Path,
    concluded: Option<&Concluded>,
) -> String {
    let Counts { before, done } = counts;
    let part = if shard.is_all() { String::new() } else { format!(", part {shard}") };
    let mut page = format!(
        "sweep {}{part}: {} combinations, {} runs\n{}{done} runs done now, {before} before, {} failed\n",
        plan.definition.name,
        plan.combinations_to_run(),
        before + done,
        refused(plan),
        failed.failures.count
    );
    page += &failed.text(plan);
    match concluded {
        None => {
            let _ = writeln!(page, "\nthis part is in {}; isodp merge OUT PART... joins all parts", dir.display());
        }
        Some(concluded) => page += &concluded.text(plan, failed.base, dir),
    }
    page
}

/// The end of a merge.
pub(super) fn merged(
    plan: &Plan,
    parts: usize,
    left: usize,
    failed: &Failed<'_>,
    dir: &Path,
    concluded: Option<&Concluded>,
) -> String {
    let mut page = format!("sweep {}: {parts} parts joined, {} failed\n", plan.definition.name, failed.failures.count);
    page += &failed.text(plan);
    match concluded {
        None => {
            let _ = writeln!(page, "\n{left} runs are in none of the parts; what there is is in {}", dir.display());
        }
        Some(concluded) => page += &concluded.text(plan, failed.base, dir),
    }
    page
}

/// A sweep that was stopped.
pub(super) fn stopped(plan: &Plan, call: &Call, done: usize, left: usize) -> String {
    format!(
        "sweep {} stopped: {done} runs done, {left} left\nthe same call goes on where this one ended:\n  {}\n",
        plan.definition.name,
        again(call)
    )
}

/// A sweep that was stopped before its first run.
pub(super) fn stopped_early(call: &Call) -> String {
    format!("stopped before the first run; the same call begins again:\n  {}\n", again(call))
}

/// The call once more.
fn again(call: &Call) -> String {
    let mut text =
        format!("isodp sweep {} --out {}", shell(&call.file.to_string_lossy()), shell(&call.out.to_string_lossy()));
    if !call.shard.is_all() {
        let _ = write!(text, " --shard {}", call.shard);
    }
    text
}

/// Combinations that are not run.
fn refused(plan: &Plan) -> String {
    let mut text = String::new();
    match plan.skipped() {
        0 => {}
        skipped => {
            let _ = writeln!(text, "{skipped} combinations left out by conditions");
        }
    }
    let refused = plan.refused().count();
    if refused > 0 {
        let _ = writeln!(text, "{refused} combinations refused:");
    }
    for (combination, why) in plan.refused().take(NAMED) {
        let _ = writeln!(text, "  {}: {why}", parameters(plan, combination));
    }
    if refused > NAMED {
        let _ = writeln!(text, "  and {} more, see plan.json", refused - NAMED);
    }
    text
}

impl Failed<'_> {
    /// Each with the call that shows it again.
    fn text(&self, plan: &Plan) -> String {
        let mut text = String::new();
        for (job, failure) in &self.failures.first {
            let reason = failure.reason.lines().next().unwrap_or_default();
            let _ = writeln!(text, "  failed: {reason}\n    {}", replay(plan, self.base, *job, failure.cycle));
        }
        let more = self.failures.count - self.failures.first.len();
        if more > 0 {
            let _ = writeln!(text, "  and {more} more, see results.csv");
        }
        text
    }
}

/// The call that shows a cycle of a run again.
fn replay(plan: &Plan, base: &str, job: Job, cycle: u64) -> String {
    let mut text = format!("isodp replay {} --seed {}", shell(base), job.seed);
    for (key, value) in plan.sets(job.combination) {
        let _ = write!(text, " --run-set {}", shell(&format!("{key}={value}")));
    }
    text + &format!(" --cycle {cycle}")
}

/// Keys and values of a combination on one line.
fn parameters(plan: &Plan, combination: u64) -> String {
    let sets = plan.definition.combinations().sets(combination);
    let words: Vec<_> = sets.iter().map(|(key, value)| shell(&format!("{key}={value}"))).collect();
    if words.is_empty() { "-".to_owned() } else { words.join(" ") }
}

/// `word` as a shell takes it.
fn shell(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "._-/=:,+%@#".contains(c);
    if !word.is_empty() && !word.starts_with('#') && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}
