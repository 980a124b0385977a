//! The commands `isodp sweep` and `isodp merge`.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use fixedbitset::FixedBitSet;

use super::definition::Definition;
use super::journal::{Failure, JournalError};
use super::picture::Gallery;
use super::plan::{Base, Job, Plan, directory};
use super::pooled::Pooling;
use super::results::Results;
use super::row::Gathered;
use super::shard::Shard;
use super::store::{Store, StoreError};
use super::summary::{NeverSeen, Summary};
use super::worker::Worker;
use super::{crew, merge, page};
use crate::study::export::{ExportError, Staged, clear};
use crate::study::scenario::ScenarioError;

/// What `isodp sweep` was called with.
#[derive(Clone, Debug)]
pub struct Call {
    /// The sweep file.
    pub file: PathBuf,
    /// Where the results go: to `out/<sweep>/`.
    pub out: PathBuf,
    /// Threads that run.
    pub threads: usize,
    /// Which part of the runs is done.
    pub shard: Shard,
    /// Whether the runs are only listed.
    pub plan: bool,
}

/// How far a sweep has come.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Progress {
    /// Runs to do in this call, as far as is known.
    pub runs: usize,
    /// Done of them, the failed ones included.
    pub done: usize,
    /// Failed of them.
    pub failed: usize,
}

/// How a call ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum End {
    /// All runs have their figures.
    Done,
    /// All runs are done, and some failed.
    Failed,
    /// It was stopped before all runs were done; the next call goes on.
    Stopped,
}

/// What the command says.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Answer {
    /// The page.
    pub page: String,
    /// How it ended.
    pub end: End,
}

/// Why a sweep did not take place.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// The sweep file or its scenario is wrong.
    #[error(transparent)]
    Definition(#[from] ScenarioError),
    /// The results could not be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Parts do not belong together.
    #[error(transparent)]
    Merge(#[from] merge::MergeError),
}
impl From<JournalError> for SweepError {
    fn from(error: JournalError) -> Self {
        Self::Store(error.into())
    }
}
impl From<ExportError> for SweepError {
    fn from(error: ExportError) -> Self {
        Self::Store(error.into())
    }
}

/// The runs without figures, as far as they are named.
#[derive(Clone, Debug, Default)]
pub(super) struct Failures {
    /// How many there are.
    pub(super) count: usize,
    /// The first of them and why they failed.
    pub(super) first: Vec<(Job, Failure)>,
}

/// Carries out `call`. `watch` is told after every run; when `stop` is set, runs are broken off and what is done is kept.
///
/// # Errors
/// The sweep file or its scenario is wrong, or the results cannot be written.
pub fn sweep(call: &Call, stop: &AtomicBool, watch: impl FnMut(Progress)) -> Result<Answer, SweepError> {
    let definition = Definition::load(&call.file)?;
    let base = Base::load(&definition)?;
    let dir = directory(&call.out, &definition.name, call.shard);
    let Some(mut plan) = Plan::make(definition, &base, call.threads, stop)? else {
        return Ok(Answer { page: page::stopped_early(call), end: End::Stopped });
    };
    if call.plan {
        let journal = Store::look(&dir, &plan)?;
        journal.as_ref().map_or(Ok(()), |journal| plan.extend(journal))?;
        return Ok(Answer { page: page::plan(&plan, &base, call, journal.as_ref())?, end: End::Done });
    }
    let mut store = Store::open(&dir, &plan)?;
    plan.extend(&store.journal)?;
    let all = plan.jobs_of(call.shard).count();
    let before = all - left(&plan, call.shard, &store)?.count_ones(..);
    let done = run(&mut plan, &base, call, &mut store, stop, watch)?;
    store.journal.sync()?;
    if stop.load(Ordering::Relaxed) {
        let left = left(&plan, call.shard, &store)?.count_ones(..);
        return Ok(Answer { page: page::stopped(&plan, call, before + done, left), end: End::Stopped });
    }
    store.sort(&plan.definition.wanted())?;
    let failed = failures(&plan, call.shard, &store)?;
    let concluded = if call.shard.is_all() { Some(conclude(&plan, &store)?) } else { None };
    let counts = page::Counts { before, done };
    let end = if failed.count == 0 { End::Done } else { End::Failed };
    let lines = page::Failed { base: &base.source, failures: &failed };
    Ok(Answer { page: page::done(&plan, call.shard, counts, &lines, store.dir(), concluded.as_ref()), end })
}

/// Joins the parts of a sweep into `out`.
///
/// # Errors
/// A directory holds no part of a sweep, they are not of one sweep, or the results cannot be written.
pub fn join(out: &Path, parts: &[PathBuf]) -> Result<Answer, SweepError> {
    let (plan, store) = merge::merge(out, parts)?;
    let left = plan.left(Shard::ALL, |job| Ok::<_, JournalError>(!store.journal.knows(job.key)?))?.count_ones(..);
    let failed = failures(&plan, Shard::ALL, &store)?;
    let concluded = if left == 0 { Some(conclude(&plan, &store)?) } else { None };
    let end = if left > 0 || failed.count > 0 { End::Failed } else { End::Done };
    let lines = page::Failed { base: &plan.definition.base, failures: &failed };
    Ok(Answer { page: page::merged(&plan, parts.len(), left, &lines, store.dir(), concluded.as_ref()), end })
}

/// Does the runs that are left, and those that the stop rule asks for then. Returns how many were done.
fn run(
    plan: &mut Plan,
    base: &Base,
    call: &Call,
    store: &mut Store,
    stop: &AtomicBool,
    mut watch: impl FnMut(Progress),
) -> Result<usize, SweepError> {
    let mut progress = Progress::default();
    let mut left = left(plan, call.shard, store)?;
    while !left.is_clear() && !stop.load(Ordering::Relaxed) {
        progress.runs += left.count_ones(..);
        watch(progress);
        let of_plan = &*plan;
        let jobs = plan.jobs_of(call.shard).enumerate().filter(|&(number, _)| left.contains(number));
        let does = |worker: &mut Worker, (_, job): (usize, Job)| worker.run(of_plan, base, job, stop);
        crew::share((call.threads, jobs), stop, Worker::default, does, |_, record| {
            store.journal.append(&record)?;
            progress.done += 1;
            progress.failed += usize::from(record.failure.is_some());
            watch(progress);
            Ok::<_, SweepError>(())
        })?;
        plan.extend(&store.journal)?;
        // What has failed just now fails again.
        left = plan.left(call.shard, |job| Ok::<_, JournalError>(!store.journal.knows(job.key)?))?;
    }
    Ok(progress.done)
}

/// Which runs of a part have no figures.
fn left(plan: &Plan, shard: Shard, store: &Store) -> Result<FixedBitSet, JournalError> {
    plan.left(shard, |job| Ok(!store.journal.has(job.key)?))
}

/// The runs without figures, the first ones with the reason.
fn failures(plan: &Plan, shard: Shard, store: &Store) -> Result<Failures, SweepError> {
    let left = left(plan, shard, store)?;
    let mut failures = Failures::default();
    for (_, job) in plan.jobs_of(shard).enumerate().filter(|&(number, _)| left.contains(number)) {
        if !store.journal.knows(job.key)? {
            continue;
        }
        failures.count += 1;
        if failures.first.len() < page::NAMED
            && let Some(failure) = store.journal.get(job.key)?.and_then(|record| record.failure)
        {
            failures.first.push((job, failure));
        }
    }
    Ok(failures)
}

/// Files in `dir` with names of this tool, which an earlier call may have left: with other figures, or in other formats.
fn left_by_others(dir: &Path) -> impl Iterator<Item = String> {
    const NAMES: [(&str, &str); 6] = [
        ("results.", ""),
        ("pooled_", ".csv"),
        ("curve_", ".svg"),
        ("heat_", ".svg"),
        ("cumulative_", ".svg"),
        ("tail_", ".svg"),
    ];
    let all = fs::read_dir(dir).into_iter().flatten().flatten();
    let names = all.filter_map(|entry| entry.file_name().into_string().ok());
    names.filter(|name| NAMES.iter().any(|(begin, end)| name.starts_with(begin) && name.ends_with(end)))
}

/// Writes the tables and the pictures.
fn conclude(plan: &Plan, store: &Store) -> Result<page::Concluded, SweepError> {
    let mut results = Results::create(store.dir(), plan)?;
    let mut summary = Summary::create(store.dir(), plan)?;
    let mut pooling = Pooling::create(store.dir(), plan)?;
    let (mut never, mut gallery) = (NeverSeen::new(plan), Gallery::new(plan));
    for combination in 0..plan.fates.len() as u64 {
        let mut gathered = Gathered::new(&plan.definition, combination);
        for job in plan.jobs_in(combination) {
            let Some(record) = store.journal.get(job.key)? else { continue };
            results.add(job, &record)?;
            gathered.add(&plan.definition, &record).map_err(StoreError::Temporary)?;
        }
        if let Some(row) = gathered.finish(gallery.outlines(combination)).map_err(StoreError::Temporary)? {
            summary.add(&row)?;
            pooling.add(&row)?;
            never.add(&row);
            gallery.add(row);
        }
    }
    let worst = pooling.worst();
    let mut files = results.finish()?;
    files.push(summary.finish()?);
    files.extend(pooling.finish()?);
    for (name, text) in gallery.draw()? {
        let mut file = Staged::create(store.dir(), &name)?;
        file.write_all(text.as_bytes()).map_err(|error| file.error(error))?;
        files.push(file);
    }
    let placed = Staged::place_all(files)?;
    clear(store.dir(), left_by_others(store.dir()), &placed)?;
    let name = |path: &PathBuf| path.file_name().map(|name| name.to_string_lossy().into_owned());
    Ok(page::Concluded { files: placed.iter().filter_map(name).collect(), never: never.told(), worst })
}
