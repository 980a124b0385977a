//! The command `isodp baseline`: runs a scenario and keeps what it came to.

use std::error::Error;
use std::path::PathBuf;

use super::{Baseline, Trail, beside, result_of};
use crate::sim::network::NetworkEvent;
use crate::sim::queue::NearQueue;
use crate::study::compare::{Tolerances, known};
use crate::study::scenario::Scenario;

/// What the command was called with.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Call {
    /// The scenario.
    pub file: PathBuf,
    /// Changed values.
    pub sets: Vec<(String, String)>,
    /// Where the baseline goes; none is beside the scenario.
    pub out: Option<PathBuf>,
    /// Tolerances to keep with it: names and limits.
    pub tolerances: Vec<(String, String)>,
}

/// Does what was called for. A baseline that is written again keeps the tolerances that it has.
///
/// # Errors
/// The scenario is wrong, the file cannot be written, or what is in its place is no baseline.
pub fn answer(call: &Call) -> Result<String, Box<dyn Error>> {
    let (scenario, text) = Scenario::load_with_text(&call.file, &call.sets)?;
    let path = call.out.clone().unwrap_or_else(|| beside(&call.file));
    // A file that is something else is not written over.
    let old = if path.exists() { Some(Baseline::load(&path)?) } else { None };
    let mut tolerances = old.map_or_else(Tolerances::default, |old| old.tolerances);
    for (name, limit) in &call.tolerances {
        tolerances.add(name, limit)?;
    }
    let (figures, hashes) = result_of(&scenario)?;
    known(&tolerances, &[&figures])?;
    let baseline = Baseline {
        program: program(),
        scenario: scenario.name.clone(),
        seed: scenario.run.seed,
        sets: call.sets.clone(),
        text,
        hashes,
        tolerances,
        figures,
        trail: Trail::of::<NearQueue<NetworkEvent>>(&scenario)?,
    };
    baseline.save(&path)?;
    let Baseline { figures, trail, .. } = &baseline;
    Ok(format!(
        "{}: {} figures of {} cycles, seed {}, in {}\nfingerprint: {}\n",
        baseline.scenario,
        figures.len(),
        trail.cycles(),
        baseline.seed,
        path.display(),
        hashes
    ))
}

/// This program and its version.
fn program() -> String {
    concat!("isodp ", env!("CARGO_PKG_VERSION")).to_owned()
}
