//! The command `isodp plan`: reads a scenario whose times may break rules, and tells what it will do.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::finding::Finding;
use super::proposal::Proposal;
use super::rules::{Facts, Weight};
use super::{data, octets, page, written};
use crate::study::export::{ExportError, Staged};
use crate::study::plot;
use crate::study::scenario::{Scenario, ScenarioError};
use crate::wire::Address;

/// What the command was called with.
#[derive(Clone, Debug)]
pub struct Call {
    /// The scenario.
    pub file: PathBuf,
    /// Changed values.
    pub sets: Vec<(String, String)>,
    /// Whether the proposal is wanted instead of the page.
    pub propose: bool,
    /// Whether the page shows every rule, not only those that are broken or tight.
    pub rules: bool,
    /// The slave whose telegrams are wanted instead of the page.
    pub slave: Option<u8>,
    /// Where the files go: to `out/<scenario>/`.
    pub out: PathBuf,
}

/// What it says.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Answer {
    /// The page.
    pub page: String,
    /// Whether a rule is violated that a run insists on.
    pub violated: bool,
}

/// Why it says nothing.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// The scenario cannot be read, or breaks a rule that is not about times.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A file could not be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The picture could not be drawn.
    #[error(transparent)]
    Plot(#[from] plot::PlotError),
    /// The plan has no text form.
    #[error("the plan cannot be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// No slave has this address.
    #[error("no slave has the address {0}; the slaves are {1}")]
    NoSlave(u8, String),
    /// The text of the scenario cannot be changed.
    #[error("the scenario cannot be written with other values: {0}")]
    Text(#[from] toml_edit::TomlError),
    /// No proposal keeps the rules.
    #[error("no T_DP, T_I, T_O, T_PLL_W and watchdog keep all rules:\n{0}")]
    NoProposal(String),
}

/// Does what was called for. Files are written for the page alone.
///
/// # Errors
/// The scenario is wrong, a file cannot be written, or there is no proposal.
pub fn answer(call: &Call) -> Result<Answer, PlanError> {
    if call.propose {
        return propose(call);
    }
    let scenario = Scenario::load_to_plan(&call.file, &call.sets)?;
    let facts = Facts::of(&scenario);
    let findings = facts.findings();
    let violated = violated(&findings);
    let page = if let Some(number) = call.slave {
        octets::text(&scenario, Some(configured(&scenario, number)?))
    } else {
        let dir = call.out.join(&scenario.name);
        let files = write(&dir, &facts, &data::json(&facts, &findings)?)?;
        page::render(&facts, &findings, &format!("{} in {}", files.join(", "), dir.display()), call.rules)
    };
    Ok(Answer { page, violated })
}

/// The proposal, which is itself read as a run reads it before it is told.
fn propose(call: &Call) -> Result<Answer, PlanError> {
    let told = |broken: Vec<Finding>| {
        let lines = broken.iter().filter_map(|found| found.fault.as_ref().map(|fault| (found.key, fault)));
        let lines: Vec<_> = lines.map(|(key, fault)| format!("  {key}: {}", super::rules::sentence(fault))).collect();
        PlanError::NoProposal(lines.join("\n"))
    };
    let (scenario, text) = Scenario::load_to_propose(&call.file, &call.sets)?;
    let proposal = Proposal::of(&scenario).map_err(told)?;
    let page = written(&text, &call.sets, &scenario, &proposal)?;
    let beside = call.file.with_file_name("proposal.toml").display().to_string();
    Scenario::parse(&scenario.name, &beside, &page, &[])?;
    Ok(Answer { page, violated: violated(&Facts::of(&scenario).findings()) })
}

/// Whether a rule is broken that a run insists on.
fn violated(findings: &[Finding]) -> bool {
    findings.iter().any(|found| found.rule.weight == Weight::Must && !found.holds())
}

fn configured(scenario: &Scenario, number: u8) -> Result<Address, PlanError> {
    let found = scenario.configured().map(|slave| slave.address).find(|address| address.get() == number);
    found.ok_or_else(|| {
        let all: Vec<_> = scenario.configured().map(|slave| slave.address.to_string()).collect();
        PlanError::NoSlave(number, all.join(", "))
    })
}

/// Writes the files; all of them, or none.
fn write(dir: &Path, facts: &Facts<'_>, json: &str) -> Result<Vec<&'static str>, PlanError> {
    let texts = [
        ("plan.json", json.to_owned()),
        ("plan.svg", plot::plan::draw(facts.scenario, &facts.plan)?),
        ("telegrams.txt", octets::text(facts.scenario, None)),
    ];
    std::fs::create_dir_all(dir).map_err(|source| ExportError::Directory { path: dir.to_owned(), source })?;
    let mut staged = Vec::with_capacity(texts.len());
    for (name, text) in &texts {
        let mut file = Staged::create(dir, name)?;
        file.write_all(text.as_bytes()).map_err(|error| file.error(error))?;
        staged.push(file);
    }
    Staged::place_all(staged)?;
    Ok(texts.map(|(name, _)| name).to_vec())
}
