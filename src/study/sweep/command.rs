//! The commands `isodp sweep` and `isodp merge`.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use super::definition::Definition;
use super::journal::{Failure, JournalError};
use super::plan::{Base, Job, Plan, directory};
use super::shard::Shard;
use super::store::{Store, StoreError};
use super::worker::Worker;
use super::{crew, merge, page, picture, results, summary};
use crate::study::export::{ExportError, Staged};
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

/// A run that failed.
#[derive(Clone, Debug)]
pub(super) struct Failed {
    pub(super) job: Job,
    pub(super) failure: Failure,
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
        return Ok(Answer { page: page::plan(&plan, &base, call, journal.as_ref()), end: End::Done });
    }
    let mut store = Store::open(&dir, &plan)?;
    plan.extend(&store.journal)?;
    let before = plan.jobs_of(call.shard).filter(|job| store.journal.has(job.key)).count();
    let done = run(&mut plan, &base, call, &mut store, stop, watch)?;
    store.journal.sync()?;
    if stop.load(Ordering::Relaxed) {
        let left = plan.jobs_of(call.shard).filter(|job| !store.journal.has(job.key)).count();
        return Ok(Answer { page: page::stopped(&plan, call, before + done, left), end: End::Stopped });
    }
    store.sort(&plan.definition.figure_names())?;
    let failed = failures(&plan, call.shard, &store)?;
    let concluded = if call.shard.is_all() { Some(conclude(&plan, &store)?) } else { None };
    let counts = page::Counts { before, done };
    let end = if failed.is_empty() { End::Done } else { End::Failed };
    let lines = page::Failures { base: &base.source, failed: &failed };
    Ok(Answer { page: page::done(&plan, call.shard, counts, &lines, store.dir(), concluded.as_ref()), end })
}

/// Joins the parts of a sweep into `out`.
///
/// # Errors
/// A directory holds no part of a sweep, they are not of one sweep, or the results cannot be written.
pub fn join(out: &Path, parts: &[PathBuf]) -> Result<Answer, SweepError> {
    let (plan, store) = merge::merge(out, parts)?;
    let mut left = 0;
    for job in plan.jobs() {
        left += usize::from(store.journal.get(job.key)?.is_none());
    }
    let failed = failures(&plan, Shard::ALL, &store)?;
    let concluded = if left == 0 { Some(conclude(&plan, &store)?) } else { None };
    let end = if left > 0 || !failed.is_empty() { End::Failed } else { End::Done };
    let lines = page::Failures { base: &plan.definition.base, failed: &failed };
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
    let mut jobs: Vec<_> = plan.jobs_of(call.shard).filter(|job| !store.journal.has(job.key)).collect();
    while !jobs.is_empty() && !stop.load(Ordering::Relaxed) {
        progress.runs += jobs.len();
        watch(progress);
        let of_plan = &*plan;
        let does = |worker: &mut Worker, number: usize| worker.run(of_plan, base, jobs[number], stop);
        crew::share((call.threads, jobs.len()), stop, Worker::default, does, |_, record| {
            store.journal.append(&record)?;
            progress.done += 1;
            progress.failed += usize::from(record.failure.is_some());
            watch(progress);
            Ok::<_, SweepError>(())
        })?;
        plan.extend(&store.journal)?;
        // What has failed just now fails again.
        jobs = plan.jobs_of(call.shard).filter(|job| !store.journal.knows(job.key)).collect();
    }
    Ok(progress.done)
}

/// The runs without figures.
fn failures(plan: &Plan, shard: Shard, store: &Store) -> Result<Vec<Failed>, SweepError> {
    let mut failed = Vec::new();
    for job in plan.jobs_of(shard).filter(|job| !store.journal.has(job.key)) {
        if let Some(failure) = store.journal.get(job.key)?.and_then(|record| record.failure) {
            failed.push(Failed { job, failure });
        }
    }
    Ok(failed)
}

/// Writes the tables and the pictures.
fn conclude(plan: &Plan, store: &Store) -> Result<page::Concluded, SweepError> {
    let mut files =
        vec![results::write(store.dir(), plan, &store.journal)?, summary::write(store.dir(), plan, &store.journal)?];
    for (name, text) in picture::draw(plan, &store.journal)? {
        let mut file = Staged::create(store.dir(), &name)?;
        file.write_all(text.as_bytes()).map_err(|error| file.error(error))?;
        files.push(file);
    }
    let placed = Staged::place_all(files)?;
    let name = |path: &PathBuf| path.file_name().map(|name| name.to_string_lossy().into_owned());
    let never = summary::never(plan, &store.journal)?;
    Ok(page::Concluded { files: placed.iter().filter_map(name).collect(), never })
}
