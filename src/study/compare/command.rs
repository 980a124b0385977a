//! The command `isodp compare`: runs a scenario and tells what moved since its baseline was written.

use std::error::Error;
use std::path::{Path, PathBuf};

use super::page::{Material, changed_lines, render};
use super::{Parted, Tolerances, Verdict, known, side_by_side};
use crate::study::baseline::{Baseline, Hashes, beside, result_of};
use crate::study::event_budget::NoHeadway;
use crate::study::figure::Value;
use crate::study::scenario::Scenario;

/// What the command was called with.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Call {
    /// The scenario.
    pub file: PathBuf,
    /// The baseline, or another scenario; none is the baseline beside the scenario.
    pub with: Option<PathBuf>,
    /// Changed values, after those of the baseline.
    pub sets: Vec<(String, String)>,
    /// Tolerances, before those of the baseline: names and limits.
    pub tolerances: Vec<(String, String)>,
    /// Whether every figure is shown.
    pub all: bool,
}

/// What it says.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Answer {
    /// The page.
    pub page: String,
    /// Whether a figure moved beyond its tolerance.
    pub beyond: bool,
}

/// What a comparison cannot be made of.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error(
    "{path}: this is a baseline of the scenario \"{theirs}\", not of \"{ours}\"\n  help: name its own with --with, or write one with isodp baseline"
)]
pub struct OtherScenario {
    /// The baseline.
    path: String,
    /// Whose it is.
    theirs: String,
    /// Whose it should be.
    ours: String,
}

/// The run that the one of today is compared with.
pub(super) enum Before {
    Baseline(Box<Baseline>, PathBuf),
    Scenario(Box<Scenario>, PathBuf),
}

impl Before {
    fn load(path: PathBuf, sets: &[(String, String)]) -> Result<Self, Box<dyn Error>> {
        if path.extension().is_some_and(|extension| extension == "toml") {
            return Ok(Self::Scenario(Box::new(Scenario::load(&path, sets)?), path));
        }
        Ok(Self::Baseline(Box::new(Baseline::load(&path)?), path))
    }
    /// Which it is.
    pub(super) fn words(&self) -> String {
        match self {
            Self::Baseline(baseline, path) => {
                format!("{} of {}, seed {}", path.display(), baseline.program, baseline.seed)
            }
            Self::Scenario(scenario, path) => format!("{}, seed {}", path.display(), scenario.run.seed),
        }
    }
}

/// Figures and hashes of a run.
struct Side {
    figures: Vec<(String, Option<Value>)>,
    hashes: Hashes,
}

impl Side {
    fn of(scenario: &Scenario) -> Result<Self, Box<dyn Error>> {
        let (figures, hashes) = result_of(scenario)?;
        Ok(Self { figures, hashes })
    }
}

/// Does what was called for. No file is written.
///
/// # Errors
/// A scenario or baseline that cannot be read, a baseline of another scenario, a tolerance of no figure.
pub fn answer(call: &Call) -> Result<Answer, Box<dyn Error>> {
    let path = call.with.clone().unwrap_or_else(|| beside(&call.file));
    let before = Before::load(path, &call.sets)?;
    let mut sets = Vec::new();
    let mut tolerances = Tolerances::default();
    if let Before::Baseline(baseline, _) = &before {
        sets.clone_from(&baseline.sets);
        tolerances = baseline.tolerances.clone();
    }
    sets.extend(call.sets.iter().cloned());
    for (name, limit) in &call.tolerances {
        tolerances.add(name, limit)?;
    }
    let (now, text) = Scenario::load_with_text(&call.file, &sets)?;
    let new = Side::of(&now)?;
    let (old, mut changes) = match &before {
        Before::Baseline(baseline, path) => {
            same_name(baseline, path, &now)?;
            let old = Side { figures: baseline.figures.clone(), hashes: baseline.hashes };
            (old, changed_lines(&baseline.text, &text))
        }
        Before::Scenario(scenario, _) => (Side::of(scenario)?, Vec::new()),
    };
    known(&tolerances, &[&old.figures, &new.figures])?;
    if !call.sets.is_empty() {
        let sets: Vec<_> = call.sets.iter().map(|(key, value)| format!("{key}={value}")).collect();
        changes.push(format!("run with {}", sets.join(", ")));
    }
    let parts = old.hashes.fingerprint != new.hashes.fingerprint;
    let parted = if parts { Some(part(&before, &call.file, &now)?) } else { None };
    let moved = side_by_side(&old.figures, &new.figures, &tolerances);
    let page = render(&Material {
        scenario: &now.name,
        before: &before,
        changes,
        hashes: [&old.hashes, &new.hashes],
        parted: parted.as_ref(),
        moved: &moved,
        all: call.all,
    });
    Ok(Answer { page, beyond: moved.iter().any(|moved| moved.verdict() == Verdict::Beyond) })
}

fn same_name(baseline: &Baseline, path: &Path, now: &Scenario) -> Result<(), OtherScenario> {
    let (theirs, ours) = (baseline.scenario.clone(), now.name.clone());
    if theirs == ours { Ok(()) } else { Err(OtherScenario { path: path.display().to_string(), theirs, ours }) }
}

/// Where the runs parted.
fn part(before: &Before, file: &Path, now: &Scenario) -> Result<Parted, NoHeadway> {
    match before {
        Before::Scenario(scenario, _) => Ok(Parted::live(scenario, now)),
        Before::Baseline(baseline, _) => match again(baseline, file) {
            Some(old) => Ok(Parted::live(&old, now)),
            None => Parted::traced(&baseline.trail, now),
        },
    }
}
/// The scenario that a baseline keeps, if this program still makes of it what the baseline says.
fn again(baseline: &Baseline, file: &Path) -> Option<Scenario> {
    let source = file.display().to_string();
    let scenario = Scenario::parse(&baseline.scenario, &source, &baseline.text, &baseline.sets).ok()?;
    let same = Side::of(&scenario).ok()?.hashes.fingerprint == baseline.hashes.fingerprint;
    same.then_some(scenario)
}
