//! Plan: every combination of a sweep with what becomes of it, and the runs that follow.
//!
//! | a combination | its fate |
//! |---|---|
//! | a `[[skip]]` leaves it out | skipped |
//! | it breaks a rule of the bus or of a device, or has a value that its key does not take | refused; without `invalid = "skip"` the sweep does not begin |
//! | anything else | run, once for each repetition |

use std::path::Path;
use std::sync::atomic::AtomicBool;

use fixedbitset::FixedBitSet;
use serde::{Deserialize, Serialize};

use super::crew;
use super::definition::{Definition, Draws, Expect, Invalid, Until};
use super::journal::{Journal, JournalError};
use super::key::{Identity, RunKey};
use super::sample::Moments;
use super::shard::Shard;
use crate::study::run::{cycles, layout};
use crate::study::scenario::error::{Fault, Problem, ScenarioError};
use crate::study::scenario::{Position, Scenario};
use crate::study::statistics::aggregate::text;
use crate::study::statistics::stop_rule::Next;

/// The scenario that a sweep varies.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Base {
    /// Its name.
    pub name: String,
    /// What messages call its file.
    pub source: String,
    /// Its text.
    pub text: String,
    /// Which of its expectations count.
    pub expect: Expect,
}

impl Base {
    /// Reads the file that `definition` names.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn load(definition: &Definition) -> Result<Self, ScenarioError> {
        let (name, source, text) = Scenario::text_of(&definition.base_path())?;
        Ok(Self { name, source, text, expect: definition.expect })
    }
    /// The scenario with these changes.
    ///
    /// # Errors
    /// As [`Scenario::parse`].
    pub fn with(&self, sets: &[(String, String)]) -> Result<Scenario, ScenarioError> {
        let mut scenario = Scenario::parse(&self.name, &self.source, &self.text, sets)?;
        if self.expect == Expect::Own {
            let own = |name: &str| sets.iter().any(|(key, _)| key.strip_prefix("expect.") == Some(name));
            scenario.expectations.retain(|expectation| own(expectation.figure.name()));
        }
        Ok(scenario)
    }
}

/// What becomes of a combination.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fate {
    /// A condition leaves it out.
    Skipped,
    /// It breaks a rule: the first one in words.
    Refused(String),
    /// It is run.
    Run(#[serde(with = "text")] Identity),
}

/// What every combination comes to, without running any.
#[derive(Clone, PartialEq, Debug)]
pub struct Plan {
    /// What is wanted.
    pub definition: Definition,
    /// The seed of the scenario: that of the first repetition where draws are common.
    pub seed: u64,
    /// What becomes of each combination, by number.
    pub fates: Vec<Fate>,
    /// Runs of each combination: those of the file, or as many as its stop rule has asked for until now.
    repetitions: Vec<u32>,
    /// Combinations that the stop rule asks for no more runs of.
    settled: Vec<bool>,
    /// Per combination how much one run of it is to do (cycles of a slave); empty in a plan that was read back.
    pub work: Vec<u64>,
}

/// One run of a plan.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Job {
    /// Number of its combination.
    pub combination: u64,
    /// Its number among the runs of this combination, from 1.
    pub repetition: u32,
    /// Its seed.
    pub seed: u64,
    /// What it is told by.
    pub key: RunKey,
}

/// What looking at one combination told.
struct Look {
    fate: Fate,
    work: u64,
    /// Which of the wanted figures its network has.
    figures: Vec<bool>,
    /// Why it is refused.
    error: Option<ScenarioError>,
}

impl Plan {
    /// Looks at every combination of `definition`, on so many `threads`. None if `stop` was set before the end.
    ///
    /// # Errors
    /// The base is wrong, no combination can be run, one is refused and that may not be, or no network has a figure.
    pub fn make(
        definition: Definition,
        base: &Base,
        threads: usize,
        stop: &AtomicBool,
    ) -> Result<Option<Self>, ScenarioError> {
        let seed = base.with(&definition.sets)?.run.seed;
        let count = definition.combinations().len() as usize;
        let (mut fates, mut work) = (vec![Fate::Skipped; count], vec![0; count]);
        let mut known = vec![None; definition.figures.len()];
        let mut refused: Option<(usize, ScenarioError)> = None;
        let mut looked = 0;
        let look = |(): &mut (), number: usize| Some(look(&definition, base, number as u64));
        let take = |number: usize, look: Look| -> Result<(), std::convert::Infallible> {
            looked += 1;
            (fates[number], work[number]) = (look.fate, look.work);
            known.iter_mut().zip(look.figures).for_each(|(known, is)| *known = Some(*known == Some(true) || is));
            if let Some(error) = look.error
                && refused.as_ref().is_none_or(|&(first, _)| number < first)
            {
                refused = Some((number, error));
            }
            Ok(())
        };
        let Ok(()) = crew::share((threads, 0..count), stop, || (), look, take);
        if looked < count {
            return Ok(None);
        }
        let plan = Self { work, ..Self::of(definition, seed, fates) };
        if let Some((first, error)) = refused {
            plan.may_refuse(first as u64, error)?;
        }
        if plan.combinations_to_run() == 0 {
            return Err(plan.definition.wrong_file(Fault::new("every combination is left out")));
        }
        if let Some(figure) = known.iter().position(|known| *known == Some(false)) {
            return Err(plan.absent(figure, base));
        }
        Ok(Some(plan))
    }
    /// The plan of these combinations, before any run is done.
    pub(super) fn of(definition: Definition, seed: u64, fates: Vec<Fate>) -> Self {
        let repetitions = vec![definition.repetitions; fates.len()];
        let settled = vec![definition.until.is_none(); fates.len()];
        Self { definition, seed, fates, repetitions, settled, work: Vec::new() }
    }
    /// Asks for more runs where the stop rule wants some, as far as `journal` has those that were asked for before.
    /// However often and on whatever machine this is asked, the same runs lead to the same answer: the rule sees the
    /// repetitions of a combination by their number, and after a quarter more of them each time.
    ///
    /// # Errors
    /// The journal cannot be read.
    pub fn extend(&mut self, journal: &Journal) -> Result<(), JournalError> {
        let Some(until) = self.definition.until else { return Ok(()) };
        for combination in 0..self.fates.len() {
            let Fate::Run(identity) = self.fates[combination] else { continue };
            while !self.settled[combination] {
                let count = self.repetitions[combination];
                let Some(found) = self.moments(until, combination as u64, identity, journal)? else { break };
                match until.rule.next(count.into(), found.interval()) {
                    Next::GoOn => self.repetitions[combination] = (count + (count / 4).max(1)).min(until.most),
                    Next::Enough | Next::GivenUp => self.settled[combination] = true,
                }
            }
        }
        Ok(())
    }
    /// What the stop rule's figure comes to in all runs that were asked for; none if some are missing.
    fn moments(
        &self,
        until: Until,
        combination: u64,
        identity: Identity,
        journal: &Journal,
    ) -> Result<Option<Moments<'_>>, JournalError> {
        let figure = &self.definition.figures[until.figure];
        let mut moments = Moments::new(figure, self.definition.confidence);
        for repetition in 1..=self.repetitions[combination as usize] {
            let job = self.job(combination, identity, repetition);
            let Some(record) = journal.get(job.key)? else { return Ok(None) };
            if let Some(value) = record.figures.get(figure.name()).copied().flatten() {
                moments.add(value, record.key);
            }
        }
        Ok(Some(moments))
    }
    /// How many combinations are run.
    pub fn combinations_to_run(&self) -> usize {
        self.fates.iter().filter(|fate| matches!(fate, Fate::Run(_))).count()
    }
    /// The combinations that are refused, with the reason.
    pub fn refused(&self) -> impl Iterator<Item = (u64, &str)> {
        (0..).zip(&self.fates).filter_map(|(number, fate)| match fate {
            Fate::Refused(why) => Some((number, why.as_str())),
            _ => None,
        })
    }
    /// How many combinations conditions leave out.
    pub fn skipped(&self) -> usize {
        self.fates.iter().filter(|fate| matches!(fate, Fate::Skipped)).count()
    }
    /// All runs, by combination, then by repetition.
    pub fn jobs(&self) -> impl Iterator<Item = Job> {
        (0..self.fates.len() as u64).flat_map(|combination| self.jobs_in(combination))
    }
    /// The runs of one combination; none if it is not run.
    pub fn jobs_in(&self, combination: u64) -> impl Iterator<Item = Job> {
        let identity = if let Fate::Run(identity) = self.fates[combination as usize] { Some(identity) } else { None };
        let repetitions = self.repetitions[combination as usize];
        identity.into_iter().flat_map(move |identity| {
            (1..=repetitions).map(move |repetition| self.job(combination, identity, repetition))
        })
    }
    /// Which runs of a part are left for `is_left` to say: a bit for each, in the order of [`Self::jobs_of`].
    ///
    /// # Errors
    /// Whatever `is_left` says.
    pub fn left<E>(&self, shard: Shard, is_left: impl Fn(Job) -> Result<bool, E>) -> Result<FixedBitSet, E> {
        let mut left = FixedBitSet::new();
        for (number, job) in self.jobs_of(shard).enumerate() {
            if is_left(job)? {
                left.grow_and_insert(number);
            }
        }
        Ok(left)
    }
    /// The runs of one part of the sweep.
    pub fn jobs_of(&self, shard: Shard) -> impl Iterator<Item = Job> {
        // A stop rule looks at all runs of a combination, which are therefore in one part.
        let whole = self.definition.until.is_some();
        let identity = |job: &Job| match &self.fates[job.combination as usize] {
            Fate::Run(identity) => Some(*identity),
            _ => None,
        };
        self.jobs().filter(move |job| {
            if whole { identity(job).is_some_and(|id| shard.has_all_of(id)) } else { shard.has(job.key) }
        })
    }
    fn job(&self, combination: u64, identity: Identity, repetition: u32) -> Job {
        let seed = match self.definition.draws {
            Draws::Common => self.seed.wrapping_add(u64::from(repetition) - 1),
            Draws::Independent => identity.seed(repetition),
        };
        Job { combination, repetition, seed, key: identity.run(seed) }
    }
    /// Overrides of a combination: those of every run and those of its axes.
    pub fn sets(&self, combination: u64) -> Vec<(String, String)> {
        sets(&self.definition, combination)
    }
    /// Refused combinations are fine only if the file says so and others are left.
    fn may_refuse(&self, first: u64, mut error: ScenarioError) -> Result<(), ScenarioError> {
        let count = self.refused().count();
        if self.definition.invalid == Invalid::Skip && self.combinations_to_run() > 0 {
            return Ok(());
        }
        for problem in &mut error.problems {
            self.blame(first, problem);
        }
        let sets = self.definition.combinations().sets(first);
        let words: Vec<_> = sets.iter().map(|(key, value)| format!("{key} = {value}")).collect();
        let message = match (count, words.is_empty()) {
            (_, true) => "the scenario is refused".to_owned(),
            (1, _) => format!("the combination {} is refused", words.join(", ")),
            _ => format!("{count} combinations are refused, first {}", words.join(", ")),
        };
        let fault = match self.combinations_to_run() {
            0 => Fault::new(message).rule("a sweep runs at least one combination"),
            _ => Fault::new(message).help("invalid = \"skip\" leaves out what breaks a rule"),
        };
        error.problems.extend(self.definition.wrong_file(fault).problems);
        Err(error)
    }
    /// Tells a problem of an override where the axis has the value that is to blame.
    fn blame(&self, combination: u64, problem: &mut Problem) {
        let values = self.definition.combinations().values(combination);
        for (axis, value) in self.definition.axes.iter().zip(values) {
            for (key, text) in axis.keys.iter().zip(&axis.values[value]) {
                if problem.source == format!("--set \"{key}={text}\"") {
                    let place = axis.places.get(value).copied().unwrap_or(axis.place);
                    let found = self.definition.wrong(place, "", Fault::default()).problems.remove(0);
                    let position: Option<Position> = found.position;
                    (problem.source, problem.position) = (found.source, position);
                    return;
                }
            }
        }
    }
    /// No network of the sweep has the figure of this number.
    fn absent(&self, figure: usize, base: &Base) -> ScenarioError {
        let first = self.fates.iter().position(|fate| matches!(fate, Fate::Run(_))).unwrap_or(0);
        let scenario = match base.with(&self.sets(first as u64)) {
            Ok(scenario) => scenario,
            Err(error) => return error,
        };
        let wanted = &self.definition.figures[figure];
        let fault = match wanted.check(&layout(&scenario)) {
            Err(error) => Fault::new(error.message).help(error.help),
            Ok(()) => Fault::new(format!("no combination has {}", wanted.name())),
        };
        self.definition.wrong_figure(figure, fault)
    }
}

fn sets(definition: &Definition, combination: u64) -> Vec<(String, String)> {
    let mut sets = definition.sets.clone();
    sets.extend(definition.combinations().sets(combination));
    sets
}

/// Reads one combination.
fn look(definition: &Definition, base: &Base, number: u64) -> Look {
    let values = definition.combinations().values(number);
    let none = vec![false; definition.figures.len()];
    if definition.skips.iter().any(|skip| skip.leaves_out(&definition.axes, &values)) {
        return Look { fate: Fate::Skipped, work: 0, figures: none, error: None };
    }
    match base.with(&sets(definition, number)) {
        Ok(scenario) => {
            let layout = layout(&scenario);
            let stations = scenario.slaves.len().max(1) as u64;
            Look {
                fate: Fate::Run(Identity::of(&scenario)),
                work: cycles(&scenario).saturating_mul(stations),
                figures: definition.figures.iter().map(|figure| figure.check(&layout).is_ok()).collect(),
                error: None,
            }
        }
        Err(error) => {
            let first = &error.problems[0];
            let key = if first.key.is_empty() { String::new() } else { format!("{}: ", first.key) };
            let why = format!("{key}{}", first.fault.message);
            Look { fate: Fate::Refused(why), work: 0, figures: none, error: Some(error) }
        }
    }
}

/// The directory of the results of a sweep called `name` under `out`.
pub(super) fn directory(out: &Path, name: &str, shard: Shard) -> std::path::PathBuf {
    if shard.is_all() { out.join(name) } else { out.join(format!("{name}.part-{}-of-{}", shard.number(), shard.of())) }
}
