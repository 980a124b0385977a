//! Outcome: what a search found, complete: everything that page, tables and picture tell.

use super::scale::Scale;
use crate::study::scenario::Fault;
use crate::study::statistics::bisection::{Answer, Inversion};
use crate::study::statistics::confidence::Confidence;
use crate::study::statistics::probability::Probability;
use crate::study::statistics::sequential::{Tested, Verdict};
use crate::study::sweep::journal::Failure;
use crate::study::verdict;

/// How surely a value is to hold.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Demand {
    /// How often a verdict may not be wrong.
    pub confidence: Confidence,
    /// A share of failing runs that is good enough.
    pub good_enough: f64,
    /// A share of failing runs that is too much.
    pub too_much: f64,
    /// Most runs of a value; whoever has not proven until then that it holds does not.
    pub limit: u64,
    /// Whether values where nothing is drawn are run as often as others.
    pub always: bool,
}

/// A value that was tried.
#[derive(Clone, PartialEq, Debug)]
pub struct Tried {
    /// Its number on the scale.
    pub number: i64,
    /// What its runs came to; no run where it is refused.
    pub tested: Tested,
    /// What was drawn, in words; empty where one run decides.
    pub drawn: Vec<&'static str>,
    /// Runs that broke off, among those that failed.
    pub broke_off: u64,
    /// Why the scenario refuses it, if it does: the key, and the fault.
    pub refused: Option<(String, Fault)>,
    /// The first run that failed, if one did.
    pub failing: Option<Failing>,
}

/// A run that failed.
#[derive(Clone, PartialEq, Debug)]
pub struct Failing {
    /// Its number among the runs of the value, from 1.
    pub repetition: u64,
    /// Its seed.
    pub seed: u64,
    /// A cycle worth a look.
    pub cycle: u64,
    /// What is wrong with it.
    pub why: Why,
    /// The command line that tells this cycle.
    pub replay: String,
}

/// What is wrong with a run.
#[derive(Clone, PartialEq, Debug)]
pub enum Why {
    /// These expectations do not hold; at least one.
    Broken(Vec<verdict::Verdict>),
    /// It broke off.
    BrokeOff(Failure),
}

/// What a search found.
#[derive(Clone, PartialEq, Debug)]
pub struct Outcome {
    /// Name of the scenario.
    pub scenario: String,
    /// What messages call its file.
    pub source: String,
    /// The key that was varied.
    pub key: String,
    /// Its values.
    pub scale: Scale,
    /// Whether it begins with the scenario's own value.
    pub is_own: bool,
    /// What was set beside it, the seed included.
    pub sets: Vec<(String, String)>,
    /// Seed of the first run of every value.
    pub seed: u64,
    /// What was expected, in words.
    pub expected: Vec<String>,
    /// How surely.
    pub demand: Demand,
    /// The answer, in numbers of the scale.
    pub answer: Answer<i64>,
    /// Every value that was tried, from the beginning of the search to its end.
    pub curve: Vec<Tried>,
    /// Values that hold beyond one that fails.
    pub inversions: Vec<Inversion<i64>>,
}

impl Tried {
    /// Whether it holds.
    pub fn holds(&self) -> bool {
        self.tested.verdict == Verdict::Holds
    }
    /// What is known of the probability that a run fails; none where one run tells all or there is none. Model: as if the
    /// number of runs had been settled beforehand; a test that ends early makes the bounds a little too narrow.
    pub fn probability(&self, confidence: Confidence) -> Option<Probability> {
        let Tested { failures, runs, .. } = self.tested;
        (self.is_drawn() && runs > 0).then(|| Probability::of(failures, runs, confidence))
    }
    /// The share of the runs that failed; none without a run.
    pub fn share(&self) -> Option<f64> {
        let Tested { failures, runs, .. } = self.tested;
        (runs > 0).then(|| failures as f64 / runs as f64)
    }
    /// Whether its runs differ by their draws.
    pub fn is_drawn(&self) -> bool {
        !self.drawn.is_empty()
    }
    /// `holds`, `fails`, `refused`.
    pub fn verdict(&self) -> &'static str {
        match (&self.refused, self.holds()) {
            (Some(_), _) => "refused",
            (None, true) => "holds",
            (None, false) => "fails",
        }
    }
}

impl Outcome {
    /// The runs of all values together.
    pub fn runs(&self) -> u64 {
        self.curve.iter().map(|tried| tried.tested.runs).sum()
    }
    /// The value of this number.
    pub fn tried(&self, number: i64) -> Option<&Tried> {
        self.curve.iter().find(|tried| tried.number == number)
    }
    /// Whether runs of any value differ by their draws.
    pub fn is_drawn(&self) -> bool {
        self.curve.iter().any(Tried::is_drawn)
    }
    /// The first value, on the way of the search, that does not hold.
    pub fn failing(&self) -> Option<&Tried> {
        self.curve.iter().find(|tried| !tried.holds())
    }
    /// What was asked, in words.
    pub fn question(&self) -> String {
        let (from, to) = self.scale.ends();
        format!("{}: how far can {} go from {from} towards {to}?", self.scenario, self.key)
    }
    /// The answer in words.
    pub fn words(&self) -> String {
        let text = |number| self.scale.text(number);
        let up = if self.scale.grows() { "up to" } else { "down to" };
        let is_refused = |number| self.tried(number).is_some_and(|tried| tried.refused.is_some());
        match self.answer {
            Answer::Band { holds, fails } if is_refused(fails) => {
                format!("holds {up} {}; {} is refused by the scenario", text(holds), text(fails))
            }
            Answer::Band { holds, fails } => format!("holds {up} {}, fails from {} on", text(holds), text(fails)),
            Answer::Everywhere => {
                format!("holds {up} {}, the end of the search: the limit may be farther on", text(self.scale.last()))
            }
            Answer::Nowhere => format!("does not hold at {}, where the search begins", text(0)),
        }
    }
    /// The name of its files without their extension: `tolerance_master_t_o`.
    pub fn file(&self, extension: &str) -> String {
        format!("tolerance_{}.{extension}", crate::study::sweep::parameter::named(&self.key, ""))
    }
}
