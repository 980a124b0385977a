//! Worker: does one run after the other on its thread, in the memory of the one before.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

use super::attempt::attempt;
use super::definition::Definition;
use super::journal::{Failure, Record};
use super::plan::{Base, Job, Plan};
use crate::study::figure::{Figure, Figures, Value};
use crate::study::histogram::Histograms;
use crate::study::scenario::Scenario;
use crate::study::verdict::judge;

/// What a thread keeps from run to run.
#[derive(Default)]
pub(super) struct Worker {
    /// The scenario of the last run, with the number of its combination.
    scenario: Option<(u64, Scenario)>,
    histograms: Option<Histograms>,
}

impl Worker {
    /// Does one run of `plan`. None if `stop` was set before its end.
    pub(super) fn run(&mut self, plan: &Plan, base: &Base, job: Job, stop: &AtomicBool) -> Option<Record> {
        let (key, seed) = (job.key, job.seed);
        let failed =
            |failure| Some(Record { key, seed, figures: BTreeMap::new(), broken: None, failure: Some(failure) });
        if self.scenario.as_ref().is_none_or(|&(number, _)| number != job.combination) {
            match base.with(&plan.sets(job.combination)) {
                Ok(scenario) => self.scenario = Some((job.combination, scenario)),
                Err(error) => return failed(Failure { reason: error.to_string(), cycle: 0 }),
            }
        }
        let (_, scenario) = self.scenario.as_mut()?;
        scenario.run.seed = seed;
        let figures = &plan.definition.figures;
        match attempt(figures, scenario, self.histograms.take(), || !stop.load(Ordering::Relaxed)) {
            Ok(Some(figures)) => {
                let broken = broken(scenario, &figures);
                let record = Record { key, seed, figures: collect(&plan.definition, &figures), broken, failure: None };
                self.histograms = Some(figures.into_histograms());
                Some(record)
            }
            Ok(None) => None,
            Err(failure) => failed(failure),
        }
    }
}

/// The wanted figures, as far as this network has them.
fn collect(definition: &Definition, figures: &Figures) -> BTreeMap<String, Option<Value>> {
    let value = |figure: &Figure| figure.check(figures.layout()).ok().and_then(|()| figures.value(figure));
    definition.figures.iter().map(|figure| (figure.name().to_owned(), value(figure))).collect()
}

/// The figures that are not as `scenario` expects; none if it expects nothing.
fn broken(scenario: &Scenario, figures: &Figures) -> Option<Vec<String>> {
    let verdicts = judge(&scenario.expectations, figures).into_iter();
    let broken = verdicts.filter(|verdict| !verdict.passed).map(|verdict| verdict.figure).collect();
    (!scenario.expectations.is_empty()).then_some(broken)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::sweep::definition::Expect;
    use crate::study::sweep::journal::Journal;
    use crate::study::sweep::plan::Fate;

    const SCENE: &str = "[run]\ncycles = 20\n[bus]\nrate = \"12 Mbit/s\"\n[master]\naddress = 1\nt_dp = \"1 ms\"\n\
        t_i = \"125 us\"\nt_o = \"500 us\"\n[[slave]]\naddress = 3\ndevice = \"posital-ocd-dpb1b\"\n";

    fn base(text: &str) -> Base {
        Base { name: "scene".to_owned(), source: "scene.toml".to_owned(), text: text.to_owned(), expect: Expect::All }
    }
    fn plan(file: &str) -> Plan {
        let text = format!("base = \"scene.toml\"\nfigures = [\"cycles\", \"slave.3.lock_time\"]\n{file}");
        let definition = Definition::parse("s", "s.toml", &text).unwrap();
        Plan::make(definition, &base(SCENE), 1, &AtomicBool::new(false)).unwrap().unwrap()
    }

    #[test]
    fn a_run_has_its_figures_or_says_why_not_and_the_next_one_goes_on() {
        let plan = plan("repetitions = 3\n");
        let jobs: Vec<_> = plan.jobs().collect();
        let (mut worker, stop) = (Worker::default(), AtomicBool::new(false));
        let run = |worker: &mut Worker, base: &Base, job: Job| worker.run(&plan, base, job, &stop).unwrap();
        let first = run(&mut worker, &base(SCENE), jobs[0]);
        assert_eq!((first.key, first.seed, first.status()), (jobs[0].key, jobs[0].seed, "done"));
        assert_eq!(first.figures["cycles"], Some(Value::Count(20)));
        assert_eq!(first.figures["slave.3.lock_time"], None, "20 cycles are not enough to lock");
        // The scenario was changed meanwhile.
        let refused = run(&mut Worker::default(), &base("[run]\n"), jobs[1]);
        assert_eq!(refused.status(), "failed");
        assert!(refused.failure.unwrap().reason.starts_with("scene.toml:"));
        assert_eq!(run(&mut worker, &base(SCENE), jobs[0]), first, "in used memory as in new");
        assert!(!super::super::is_at_work());
    }

    #[test]
    fn a_stopped_run_leaves_no_record() {
        let plan = plan("set = { run.cycles = 100000 }\n");
        let job = plan.jobs().next().unwrap();
        let stop = AtomicBool::new(true);
        assert_eq!(Worker::default().run(&plan, &base(SCENE), job, &stop), None);
    }

    #[test]
    fn a_stop_rule_asks_for_as_many_runs_as_it_needs_and_no_more() {
        let mut plan = plan(
            "repetitions = 10\nuntil = { figure = \"cycles\", relative_half_width = 0.01, max_repetitions = 40 }\n",
        );
        let dir = tempfile::tempdir().unwrap();
        let mut journal = Journal::open(&dir.path().join("j"), &[]).unwrap();
        assert_eq!(plan.jobs().count(), 10);
        let append = |journal: &mut Journal, job: &Job, cycles| {
            let figures = [("cycles".to_owned(), Some(Value::Count(cycles)))].into();
            let record = Record { key: job.key, seed: job.seed, figures, broken: None, failure: None };
            journal.append(&record).unwrap();
        };
        let mut narrow = plan.clone();
        plan.jobs().skip(1).for_each(|job| append(&mut journal, &job, if job.repetition % 2 == 0 { 90 } else { 110 }));
        plan.extend(&journal).unwrap();
        assert_eq!(plan.jobs().count(), 10, "the first is missing");
        let first = plan.jobs().next().unwrap();
        append(&mut journal, &first, 110);
        let mut counts = Vec::new();
        loop {
            plan.extend(&journal).unwrap();
            let jobs: Vec<_> = plan.jobs().filter(|job| !journal.knows(job.key).unwrap()).collect();
            counts.push(plan.jobs().count());
            if jobs.is_empty() {
                break;
            }
            for job in &jobs {
                append(&mut journal, job, if job.repetition % 2 == 0 { 90 } else { 110 });
            }
        }
        assert_eq!(counts, [12, 15, 18, 22, 27, 33, 40, 40], "given up at the most");
        narrow.jobs().for_each(|job| append(&mut journal, &job, 100));
        narrow.extend(&journal).unwrap();
        assert_eq!(narrow.jobs().count(), 10, "all the same is enough at once");
        assert!(matches!(narrow.fates[0], Fate::Run(_)));
    }
}
