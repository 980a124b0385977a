//! Trial: whether one value holds, by as many runs as the sequential test asks for.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

use super::draws::drawn;
use super::outcome::{Demand, Failing, Tried, Why};
use super::scale::Scale;
use crate::study::histogram::Histograms;
use crate::study::invocation::Invocation;
use crate::study::scenario::{Scenario, ScenarioError};
use crate::study::statistics::sequential::{
    SequentialError, SequentialSettings, SequentialTest, Tally, Tested, Verdict,
};
use crate::study::sweep::journal::Failure;
use crate::study::sweep::plan::Base;
use crate::study::sweep::{attempt, crew};
use crate::study::verdict::judge;

/// Cycles before and after the one worth a look.
const WINDOW: u64 = 2;

/// How far a search has come.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Progress {
    /// The value that is tried.
    pub value: String,
    /// Values that are done.
    pub values: usize,
    /// Runs of this value.
    pub runs: u64,
    /// Failed of them.
    pub failures: u64,
}

/// The search was stopped.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Stopped;

/// What all values have in common.
pub struct Trial<'a> {
    base: &'a Base,
    sets: &'a [(String, String)],
    key: &'a str,
    scale: &'a Scale,
    test: SequentialTest,
    always: bool,
    threads: usize,
    stop: &'a AtomicBool,
}

/// What a thread keeps from run to run.
struct Worker {
    scenario: Scenario,
    histograms: Option<Histograms>,
}

/// What a run came to: none if it is as expected.
type Told = Option<Why>;

impl<'a> Trial<'a> {
    /// Values of `key` in `base` after `sets`, on so many `threads` until `stop` is set.
    ///
    /// # Errors
    /// There is no test for `demand`.
    pub fn new(
        (base, sets): (&'a Base, &'a [(String, String)]),
        (key, scale): (&'a str, &'a Scale),
        demand: &Demand,
        (threads, stop): (usize, &'a AtomicBool),
    ) -> Result<Self, SequentialError> {
        let missed = demand.confidence.outside();
        let test = SequentialTest::new(SequentialSettings {
            p0: demand.good_enough,
            p1: demand.too_much,
            alpha: missed,
            beta: missed,
            limit: demand.limit,
            at_limit: Verdict::Fails,
        })?;
        Ok(Self { base, sets, key, scale, test, always: demand.always, threads, stop })
    }
    /// The scenario with the value of this number.
    ///
    /// # Errors
    /// The scenario refuses it.
    pub fn scenario(&self, number: i64) -> Result<Scenario, ScenarioError> {
        let mut sets = self.sets.to_vec();
        sets.push((self.key.to_owned(), self.scale.text(number)));
        self.base.with(&sets)
    }
    /// Tries the value of this number, after `values` others. `watch` is told after every run.
    ///
    /// # Errors
    /// It was stopped.
    pub fn of(&self, number: i64, values: usize, mut watch: impl FnMut(Progress)) -> Result<Tried, Stopped> {
        let mut progress = Progress { value: self.scale.text(number), values, runs: 0, failures: 0 };
        watch(progress.clone());
        let scenario = match self.scenario(number) {
            Ok(scenario) => scenario,
            Err(error) => return Ok(refused(number, error)),
        };
        let drawn = drawn(&scenario);
        let test = if drawn.is_empty() && !self.always { SequentialTest::ONE_RUN } else { self.test };
        let drawn = if drawn.is_empty() && self.always { vec!["clock starts"] } else { drawn };
        let (mut tally, mut broke_off, mut failing) = (Tally::new(test), 0, None);
        let tested = self.runs(&scenario, test.limit(), |told| {
            progress.runs += 1;
            let fails = told.is_some();
            if let Some(why) = told {
                progress.failures += 1;
                broke_off += u64::from(matches!(why, Why::BrokeOff(_)));
                let first = || failure(&scenario, tally.runs() + 1, why);
                failing.get_or_insert_with(first);
            }
            watch(progress.clone());
            tally.count(fails)
        });
        let tested = tested.ok_or(Stopped)?;
        Ok(Tried { number, tested, drawn, broke_off, refused: None, failing })
    }
    /// Does runs until `take`, which gets what came of them in the order of their seeds, has an answer; none if it was
    /// stopped before.
    fn runs(&self, scenario: &Scenario, limit: u64, mut take: impl FnMut(Told) -> Option<Tested>) -> Option<Tested> {
        let answered = AtomicBool::new(false);
        let go_on = || !self.stop.load(Ordering::Relaxed) && !answered.load(Ordering::Relaxed);
        let worker = || Worker { scenario: scenario.clone(), histograms: None };
        let does = |worker: &mut Worker, number: usize| {
            worker.scenario.run.seed = scenario.run.seed.wrapping_add(number as u64);
            worker.run(go_on)
        };
        let (mut waiting, mut next) = (BTreeMap::new(), 0);
        let limit = usize::try_from(limit).unwrap_or(usize::MAX);
        let ended = crew::share((self.threads, 0..limit), self.stop, worker, does, |number, told| {
            waiting.insert(number, told);
            while let Some(told) = waiting.remove(&next) {
                next += 1;
                if let Some(tested) = take(told) {
                    // What others are at is of no use any more.
                    answered.store(true, Ordering::Relaxed);
                    return Err(tested);
                }
            }
            Ok(())
        });
        ended.err()
    }
}

impl Worker {
    /// Does a run; none if it was broken off from outside.
    fn run(&mut self, go_on: impl Fn() -> bool) -> Option<Told> {
        match attempt(&[], &self.scenario, self.histograms.take(), go_on) {
            Ok(Some(figures)) => {
                let mut broken = judge(&self.scenario.expectations, &figures);
                broken.retain(|verdict| !verdict.passed);
                self.histograms = Some(figures.into_histograms());
                Some((!broken.is_empty()).then_some(Why::Broken(broken)))
            }
            Ok(None) => None,
            Err(failure) => Some(Some(Why::BrokeOff(failure))),
        }
    }
}

/// A value that the scenario does not take.
fn refused(number: i64, error: ScenarioError) -> Tried {
    let first = error.problems.into_iter().next().map(|problem| (problem.key, problem.fault));
    let tested = Tested { verdict: Verdict::Fails, proven: true, runs: 0, failures: 0 };
    Tried { number, tested, drawn: Vec::new(), broke_off: 0, refused: first, failing: None }
}

/// The run of this number, from 1, with what is wrong with it.
fn failure(scenario: &Scenario, repetition: u64, why: Why) -> Failing {
    let seed = scenario.run.seed.wrapping_add(repetition - 1);
    let cycle = match &why {
        Why::Broken(broken) => broken.iter().find_map(|verdict| verdict.cycle).unwrap_or(0),
        Why::BrokeOff(Failure { cycle, .. }) => *cycle,
    };
    let mut sets = scenario.invocation.sets.clone();
    // What is expected changes no run.
    sets.retain(|(key, _)| !key.starts_with("expect."));
    let replay = Invocation { sets, ..scenario.invocation.clone() }.replay(seed, cycle, WINDOW);
    Failing { repetition, seed, cycle, why, replay }
}
