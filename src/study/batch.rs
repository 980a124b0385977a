//! Batch: `isodp run` from its files to its page, for one scenario or several.
//!
//! Several scenarios are all read before the first one runs, run side by side, and are told in the order of the files.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Serialize;

use super::export::{ExportError, Staged};
use super::plan::rules::warnings;
use super::report;
use super::run::{Outcome, Progress, RunError, run};
use super::scenario::{Fault, Scenario, ScenarioError};
use super::summary::Summary;
use super::verdict::junit::{self, Judged};
use super::verdict::{Verdict, page};
use crate::sim::network::NetworkEvent;
use crate::sim::queue::NearQueue;

/// What the command line asks for.
#[derive(Clone, Debug)]
pub struct Call {
    /// Scenario files, at least one.
    pub files: Vec<PathBuf>,
    /// Overrides of all of them.
    pub sets: Vec<(String, String)>,
    /// Directory for the results.
    pub out: PathBuf,
    /// Where the verdicts go as JUnit XML.
    pub junit: Option<PathBuf>,
    /// Where the verdicts go as JSON.
    pub verdicts: Option<PathBuf>,
}

/// The page, and whether every expectation holds.
#[derive(Clone, Debug)]
pub struct Answer {
    /// The page.
    pub page: String,
    /// Whether every expectation of every scenario holds.
    pub passed: bool,
}

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum BatchError {
    /// Scenarios that cannot be read.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A run without result.
    #[error(transparent)]
    Run(#[from] RunError),
    /// Verdicts that cannot be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// Verdicts without text form.
    #[error("the verdicts cannot be written as {form}: {why}")]
    Form {
        /// The form.
        form: &'static str,
        /// Why.
        why: String,
    },
}

/// Reads all scenarios of `call`.
///
/// # Errors
/// Everything that is wrong with any of them, or two of them whose results would go to one directory.
pub fn load(call: &Call) -> Result<Vec<Scenario>, ScenarioError> {
    let (mut scenarios, mut problems) = (Vec::new(), Vec::new());
    let mut names = BTreeMap::new();
    for file in &call.files {
        match Scenario::load(file, &call.sets) {
            Ok(scenario) => {
                if let Some(other) = names.insert(scenario.name.clone(), file) {
                    let fault = Fault::new(format!("{} has the same name", other.display()))
                        .rule("the results of NAME.toml go to a directory NAME")
                        .help("rename one, or run them one after the other");
                    problems.extend(ScenarioError::about_file(&file.display().to_string(), fault).problems);
                }
                scenarios.push(scenario);
            }
            Err(error) => problems.extend(error.problems),
        }
    }
    if problems.is_empty() { Ok(scenarios) } else { Err(ScenarioError { problems }) }
}

/// The warnings of a scenario, of several with its name.
pub fn warnings_of(scenarios: &[Scenario]) -> impl Iterator<Item = String> {
    scenarios.iter().flat_map(move |scenario| {
        let name = if scenarios.len() > 1 { format!("{}: ", scenario.name) } else { String::new() };
        warnings(scenario).into_iter().map(move |warning| format!("{name}{warning}"))
    })
}

/// Runs the scenarios that [`load`] read and writes what `call` asks for. `watch` is told how far a single one is.
///
/// # Errors
/// A file that cannot be written.
pub fn answer(call: &Call, scenarios: &[Scenario], watch: impl FnMut(Progress)) -> Result<Answer, BatchError> {
    let runs = match scenarios {
        [scenario] => vec![outcome(scenario, &call.out, watch)?],
        several => {
            several.par_iter().map(|scenario| outcome(scenario, &call.out, |_| ())).collect::<Result<Vec<_>, _>>()?
        }
    };
    let calls: Vec<_> = call.files.iter().map(|file| shell(file, &call.sets)).collect();
    let judged = || runs.iter().zip(&calls).map(|((summary, _), call)| Judged { summary, call });
    let mut staged = Vec::new();
    if let Some(file) = &call.junit {
        let text = junit::text(&judged().collect::<Vec<_>>());
        let text = text.map_err(|error| BatchError::Form { form: "JUnit XML", why: error.to_string() })?;
        staged.push(stage(file, &text)?);
    }
    if let Some(file) = &call.verdicts {
        staged.push(stage(file, &json(judged())?)?);
    }
    Staged::place_all(staged)?;
    let page = match &runs[..] {
        [(summary, dir)] => report::render(summary, dir.as_deref()),
        several => several_pages(several),
    };
    Ok(Answer { page, passed: runs.iter().all(|(summary, _)| summary.passed()) })
}

/// What is kept of a run: what it came to, and where its files are.
type Kept = (Summary, Option<String>);

fn outcome(scenario: &Scenario, out: &Path, watch: impl FnMut(Progress)) -> Result<Kept, RunError> {
    let Outcome { summary, dir, .. } = run::<NearQueue<NetworkEvent>>(scenario, Some(out), watch)?;
    Ok((summary, dir.map(|dir| dir.display().to_string())))
}

/// Each run in a few lines with its verdicts, and a table of all.
fn several_pages(runs: &[Kept]) -> String {
    let mut lines = Vec::new();
    for (summary, dir) in runs {
        lines.extend(report::brief(summary, dir.as_deref()));
        lines.extend(page::lines(&summary.verdicts));
        lines.push(String::new());
    }
    let cells = |(summary, _): &Kept| {
        let failed = summary.verdicts.iter().filter(|verdict| !verdict.passed).count();
        let word = match (failed, summary.verdicts.len()) {
            (_, 0) => "-",
            (0, _) => "pass",
            _ => "FAIL",
        };
        let all = [summary.counts.faults.to_string(), summary.verdicts.len().to_string(), failed.to_string()];
        std::iter::once(summary.network.scenario.clone()).chain(all).chain([word.to_owned()]).collect::<Vec<_>>()
    };
    let rows: Vec<_> = runs.iter().map(cells).collect();
    lines.extend(report::aligned(&["scenario", "faults", "expectations", "failed", "verdict"], &[0, 4], &rows));
    let failed = runs.iter().filter(|(summary, _)| !summary.passed()).count();
    lines.push(match failed {
        0 => format!("all {} pass", report::number(runs.len(), "scenario")),
        failed => format!("{failed} of {} FAIL", report::number(runs.len(), "scenario")),
    });
    lines.iter().flat_map(|line| [line.trim_end(), "\n"]).collect()
}

/// The verdicts of one run as other programs read them.
#[derive(Serialize)]
struct Written<'a> {
    scenario: &'a str,
    seed: u64,
    passed: bool,
    call: &'a str,
    verdicts: &'a [Verdict],
}

fn json<'a>(runs: impl Iterator<Item = Judged<'a>>) -> Result<String, BatchError> {
    let written = |run: Judged<'a>| Written {
        scenario: &run.summary.network.scenario,
        seed: run.summary.network.seed,
        passed: run.summary.passed(),
        call: run.call,
        verdicts: &run.summary.verdicts,
    };
    let all: Vec<_> = runs.map(written).collect();
    let text = serde_json::to_string_pretty(&all);
    text.map(|text| text + "\n").map_err(|error| BatchError::Form { form: "JSON", why: error.to_string() })
}

/// Writes `text` under a temporary name beside `file`.
fn stage(file: &Path, text: &str) -> Result<Staged, ExportError> {
    let dir = file.parent().filter(|dir| !dir.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(dir).map_err(|source| ExportError::Directory { path: dir.to_owned(), source })?;
    let name = file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let mut staged = Staged::create(dir, &name)?;
    staged.write_all(text.as_bytes()).map_err(|error| staged.error(error))?;
    Ok(staged)
}

/// The file and the overrides of a run as `isodp replay` takes them, as words for a shell.
fn shell(file: &Path, sets: &[(String, String)]) -> String {
    let mut words = quoted(&file.display().to_string());
    for (key, value) in sets {
        let _ = write!(words, " --run-set {}", quoted(&format!("{key}={value}")));
    }
    words
}
/// A word for a shell, in quotation marks if it needs them.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._/=-+,".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_replay_can_be_copied_into_a_shell() {
        let set = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        let sets = [set("run.seed", "7"), set("master.t_o", "1.5 ms"), set("x", "it's")];
        let words = shell(Path::new("scenarios/reference.toml"), &sets);
        assert_eq!(
            words,
            r"scenarios/reference.toml --run-set run.seed=7 --run-set 'master.t_o=1.5 ms' --run-set 'x=it'\''s'"
        );
        assert_eq!(shell(Path::new("my file.toml"), &[]), "'my file.toml'");
    }
}
