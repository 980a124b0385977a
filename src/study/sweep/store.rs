//! Store: the directory of a sweep. What was wanted, and what was done of it.
//!
//! ```text
//! out/<sweep>/plan.json            the sweep file's text and what becomes of every combination
//! out/<sweep>/runs/journal.jsonl   a line per finished run
//! out/<sweep>/results.csv          when all runs are done: a row per run
//! out/<sweep>/results.parquet      the same, if isodp was built with the feature parquet
//! out/<sweep>/summary.csv          a row per combination
//! out/<sweep>/pooled_*.csv         of each pooled quantity a row per combination, and its bins
//! out/<sweep>/*.svg                figures against parameters, over two of them, and how they are distributed
//! ```

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::definition::Definition;
use super::journal::{Journal, JournalError, Wanted};
use super::key::MODEL_VERSION;
use super::plan::{Fate, Plan};
use crate::study::export::{ExportError, Staged};
use crate::study::scenario::ScenarioError;

/// File of the plan.
const PLAN: &str = "plan.json";
/// Directory of the runs.
const RUNS: &str = "runs";
/// File of the journal.
const JOURNAL: &str = "journal.jsonl";
/// File that is locked while somebody writes the journal.
const LOCK: &str = "lock";

/// A sweep's directory.
#[derive(Debug)]
pub struct Store {
    dir: PathBuf,
    /// What was done.
    pub journal: Journal,
    /// Kept locked, so that no two calls write one journal.
    _lock: File,
}

/// Why a store cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// A file could not be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The journal could not be read or written.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// Values could not be sorted in a temporary file.
    #[error("cannot sort values in a temporary file: {0}")]
    Temporary(std::io::Error),
    /// A picture could not be drawn.
    #[error("drawing {file} failed: {reason}")]
    Plot {
        /// Which.
        file: String,
        /// What the library said.
        reason: String,
    },
    /// Another call writes the same journal.
    #[error("another call of isodp is at work on {}; wait for its end, or give this one another --out", .0.display())]
    Busy(PathBuf),
    /// A directory holds no sweep.
    #[error("{} holds no sweep: {why}", dir.display())]
    NoSweep {
        /// Which.
        dir: PathBuf,
        /// Why not.
        why: String,
    },
    /// The text of the sweep cannot be understood.
    #[error(transparent)]
    Definition(#[from] ScenarioError),
}

/// What `plan.json` holds. Parts of one sweep have the same, octet by octet.
#[derive(Serialize, Deserialize)]
struct Written {
    sweep: String,
    model: String,
    seed: u64,
    text: String,
    combinations: Vec<Fate>,
}

/// Locks the directory of the runs. The lock ends with the process, however that ends.
fn lock(runs: &Path) -> Result<File, StoreError> {
    let path = runs.join(LOCK);
    let error = |source| ExportError::Create { path: path.clone(), source };
    let file = File::options().write(true).create(true).truncate(false).open(&path).map_err(error)?;
    match fs4::FileExt::try_lock(&file) {
        Ok(()) => Ok(file),
        Err(fs4::TryLockError::WouldBlock) => Err(StoreError::Busy(runs.to_owned())),
        Err(fs4::TryLockError::Error(source)) => Err(error(source).into()),
    }
}

/// The version of the model in words.
fn model() -> String {
    format!("isodp {} model {MODEL_VERSION}", env!("CARGO_PKG_VERSION"))
}

impl Store {
    /// Opens the store in `dir`, or begins it, for `plan`. Runs of other plans that it holds stay.
    ///
    /// # Errors
    /// The directory cannot be made, a file not be written, or another call is at work there.
    ///
    /// # Panics
    /// Never: a plan has a text form.
    pub fn open(dir: &Path, plan: &Plan) -> Result<Self, StoreError> {
        let runs = dir.join(RUNS);
        fs::create_dir_all(&runs).map_err(|source| ExportError::Directory { path: runs.clone(), source })?;
        let lock = lock(&runs)?;
        let journal = Journal::open(&runs.join(JOURNAL), &plan.definition.wanted())?;
        let written = Written {
            sweep: plan.definition.name.clone(),
            model: model(),
            seed: plan.seed,
            text: plan.definition.text.clone(),
            combinations: plan.fates.clone(),
        };
        let mut file = Staged::create(dir, PLAN)?;
        let text = serde_json::to_string_pretty(&written).expect("a plan is plain data") + "\n";
        file.write_all(text.as_bytes()).map_err(|error| file.error(error))?;
        file.place()?;
        Ok(Self { dir: dir.to_owned(), journal, _lock: lock })
    }
    /// The journal in `dir` as it is, if there is one; nothing is changed.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn look(dir: &Path, plan: &Plan) -> Result<Option<Journal>, JournalError> {
        let path = dir.join(RUNS).join(JOURNAL);
        if path.exists() { Journal::look(&path, &plan.definition.wanted()).map(Some) } else { Ok(None) }
    }
    /// Whether `dir` holds a sweep.
    pub fn is_in(dir: &Path) -> bool {
        dir.join(PLAN).exists()
    }
    /// The plan and the journal that `dir` holds; nothing is changed.
    ///
    /// # Errors
    /// There is no sweep, or none of this version of the model.
    pub fn read(dir: &Path) -> Result<(Plan, Journal), StoreError> {
        let no_sweep = |why: String| StoreError::NoSweep { dir: dir.to_owned(), why };
        let text = fs::read(dir.join(PLAN)).map_err(|error| no_sweep(format!("{PLAN}: {error}")))?;
        let written: Written = serde_json::from_slice(&text).map_err(|error| no_sweep(format!("{PLAN}: {error}")))?;
        if written.model != model() {
            return Err(no_sweep(format!("its runs are of {}, and this is {}", written.model, model())));
        }
        let definition = Definition::parse(&written.sweep, &written.sweep, &written.text)?;
        if definition.combinations().len() != written.combinations.len() as u64 {
            return Err(no_sweep(format!("{PLAN} does not fit together")));
        }
        let mut plan = Plan::of(definition, written.seed, written.combinations);
        let journal = Self::look(dir, &plan)?.ok_or_else(|| no_sweep(format!("there is no {RUNS}/{JOURNAL}")))?;
        plan.extend(&journal)?;
        Ok((plan, journal))
    }
    /// Where it is.
    pub fn dir(&self) -> &Path {
        &self.dir
    }
    /// Brings the journal into the order of its keys, the last record of every run alone: what it says then does not
    /// depend on who finished when.
    ///
    /// # Errors
    /// The new journal cannot be written; the old one stays.
    pub fn sort(&mut self, wanted: &Wanted) -> Result<(), StoreError> {
        let runs = self.dir.join(RUNS);
        let mut file = BufWriter::new(Staged::create(&runs, JOURNAL)?);
        self.journal.sorted(&mut file)?;
        let file = file
            .into_inner()
            .map_err(|error| ExportError::Write { path: runs.join(JOURNAL), source: error.into_error() })?;
        file.place()?;
        self.journal = Journal::open(&runs.join(JOURNAL), wanted)?;
        self.journal.sync()?;
        Ok(())
    }
}
