//! Baseline: what a run came to, in a file, so that a later run of the same scenario can be compared with it.
//!
//! The file is JSON with one figure, event or line of the scenario in each line of text, so that a change is seen where
//! baselines are kept under version control. It holds
//!
//! | key | what |
//! |---|---|
//! | `format`, `version`, `program` | what the file is, and who wrote it |
//! | `scenario`, `seed`, `sets`, `text` | the run: name, seed, overrides and the whole scenario file |
//! | `fingerprint` | the four hashes of the run |
//! | `tolerances` | by how much figures may move; may be edited by hand |
//! | `figures` | every figure: as people read it, and exactly |
//! | `events`, `journal`, `digests` | the [`Trail`] |

pub mod command;
mod file;
pub mod trail;

pub use file::BaselineError;
pub use trail::{Parting, Traced, Trail};

use std::fmt;
use std::path::{Path, PathBuf};

use super::compare::Tolerances;
use super::figure::Value;
use super::run::{Outcome, RunError, run};
use super::scenario::Scenario;
use crate::sim::network::NetworkEvent;
use crate::sim::queue::NearQueue;

/// The number of this form of the file.
pub const VERSION: u32 = 1;

/// The four hashes of a run.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Hashes {
    /// Of the wire, the states and the latches.
    pub fingerprint: crate::sim::fingerprint::Fingerprint,
    /// Of the summary.
    pub statistics: u64,
}

impl fmt::Display for Hashes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}  statistics {:016x}", self.fingerprint, self.statistics)
    }
}

impl Hashes {
    /// Name and value of each.
    pub const fn named(&self) -> [(&'static str, u64); 4] {
        let fingerprint = &self.fingerprint;
        [
            ("wire", fingerprint.wire),
            ("states", fingerprint.states),
            ("latches", fingerprint.latches),
            ("statistics", self.statistics),
        ]
    }
}

/// A run as a baseline keeps it.
#[derive(Clone, PartialEq, Debug)]
pub struct Baseline {
    /// The program and its version.
    pub program: String,
    /// Name of the scenario.
    pub scenario: String,
    /// Its seed.
    pub seed: u64,
    /// Overrides of the scenario.
    pub sets: Vec<(String, String)>,
    /// The scenario file.
    pub text: String,
    /// Hashes of the run.
    pub hashes: Hashes,
    /// By how much figures may move.
    pub tolerances: Tolerances,
    /// Name and value of every figure; none where it had none.
    pub figures: Vec<(String, Option<Value>)>,
    /// What stations did.
    pub trail: Trail,
}

/// Figures by name, and hashes.
pub(super) type Came = (Vec<(String, Option<Value>)>, Hashes);

/// Runs `scenario` without leaving files, and tells what it came to.
pub(super) fn result_of(scenario: &Scenario) -> Result<Came, RunError> {
    let Outcome { figures, fingerprint, statistics, .. } = run::<NearQueue<NetworkEvent>>(scenario, None, |_| ())?;
    let figures = figures.iter().map(|(figure, value)| (figure.to_string(), value)).collect();
    Ok((figures, Hashes { fingerprint, statistics }))
}

/// Where the baseline of a scenario file is where nothing else is said: `<scenario>.baseline.json` beside it.
pub fn beside(scenario: &Path) -> PathBuf {
    scenario.with_extension("baseline.json")
}
