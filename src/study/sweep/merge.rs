//! Merge: the parts of a sweep become one. In which order, in how many steps and how often a part is named does not
//! matter: what comes of it is, octet by octet, what one call for the whole sweep leaves.

use std::path::{Path, PathBuf};

use super::journal::Record;
use super::key::RunKey;
use super::plan::Plan;
use super::store::{Store, StoreError};

/// Why parts do not become one.
#[derive(Debug, thiserror::Error)]
pub enum MergeError {
    /// A part cannot be read or the whole not be written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Two parts have different plans.
    #[error(
        "{} and {} are parts of different sweeps: their plan.json differ; merge parts of one sweep file and one scenario",
        .0.display(), .1.display()
    )]
    OtherSweep(PathBuf, PathBuf),
    /// Two parts have different figures of one run.
    #[error("{}: run {key} has other figures than in another part; one of them is damaged or was made by another build", dir.display())]
    Disagree {
        /// The second of the two.
        dir: PathBuf,
        /// Which run.
        key: RunKey,
    },
}

/// Joins the sweeps in `parts` into the one in `out`, which may be there already and is a part then.
///
/// # Errors
/// See [`MergeError`]. What could be joined before is kept; nothing that was in `out` is lost.
pub(super) fn merge(out: &Path, parts: &[PathBuf]) -> Result<(Plan, Store), MergeError> {
    let mut read = Vec::new();
    for dir in parts {
        read.push((dir, Store::read(dir)?));
    }
    if Store::is_in(out) {
        let (plan, _) = Store::read(out)?;
        same(parts.first(), &read[0].1.0, out, &plan)?;
    }
    for pair in read.windows(2) {
        let [(one, (plan, _)), (other, (other_plan, _))] = pair else { continue };
        same(Some(one), plan, other, other_plan)?;
    }
    let mut plan = read[0].1.0.clone();
    let mut store = Store::open(out, &plan)?;
    for (dir, (_, journal)) in &read {
        for record in journal.records() {
            let record = record.map_err(StoreError::from)?;
            let known = store.journal.get(record.key).map_err(StoreError::from)?;
            match joined(known.as_ref(), &record) {
                Ok(None) => {}
                Ok(Some(record)) => store.journal.append(&record).map_err(StoreError::from)?,
                Err(()) => return Err(MergeError::Disagree { dir: (*dir).clone(), key: record.key }),
            }
        }
    }
    store.sort(&plan.definition.figure_names())?;
    plan.extend(&store.journal).map_err(StoreError::from)?;
    Ok((plan, store))
}

fn same(one: Option<&PathBuf>, plan: &Plan, other: &Path, other_plan: &Plan) -> Result<(), MergeError> {
    let (mine, theirs) = (&plan.definition, &other_plan.definition);
    let same = (&mine.name, &mine.text, plan.seed, &plan.fates)
        == (&theirs.name, &theirs.text, other_plan.seed, &other_plan.fates);
    if same { Ok(()) } else { Err(MergeError::OtherSweep(one.cloned().unwrap_or_default(), other.to_owned())) }
}

/// What is known of a run that two parts know: figures of both, and figures rather than a failure. None if that is what
/// is `known` already, an error if they disagree.
fn joined(known: Option<&Record>, new: &Record) -> Result<Option<Record>, ()> {
    let Some(known) = known else { return Ok(Some(new.clone())) };
    match (&known.failure, &new.failure) {
        (None, Some(_)) => return Ok(None),
        (Some(_), None) => return Ok(Some(new.clone())),
        (Some(mine), Some(theirs)) => return if mine == theirs { Ok(None) } else { Err(()) },
        (None, None) => {}
    }
    let mut both = known.clone();
    for (name, value) in &new.figures {
        if both.figures.get(name).is_some_and(|known| known != value) {
            return Err(());
        }
        both.figures.insert(name.clone(), *value);
    }
    Ok((both != *known).then_some(both))
}
