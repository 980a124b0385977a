//! JUnit XML: verdicts for the servers that run tests. A run is a test suite, an expectation a test case.
//!
//! `time` is the simulated time: the file is the same whatever machine ran it. A scenario that expects nothing has one
//! test case, that it ran.

use std::time::Duration;

use quick_junit::{NonSuccessKind, Property, Report, SerializeError, TestCase, TestCaseStatus, TestSuite};

use super::{Verdict, page};
use crate::study::summary::Summary;

/// One run and the words of the command line that tell a stretch of it again, but for the cycle.
#[derive(Clone, Copy, Debug)]
pub struct Judged<'a> {
    /// What the run came to.
    pub summary: &'a Summary,
    /// The file and the overrides, ready for a shell.
    pub call: &'a str,
}

/// The verdicts of several runs as JUnit XML.
///
/// # Errors
/// A text that XML cannot hold.
pub fn text(runs: &[Judged<'_>]) -> Result<String, SerializeError> {
    let mut report = Report::new("isodp");
    report.add_test_suites(runs.iter().map(suite));
    report.to_string()
}

fn suite(run: &Judged<'_>) -> TestSuite {
    let network = &run.summary.network;
    let time = Duration::from_nanos(network.duration.as_ns() as u64);
    let mut suite = TestSuite::new(network.scenario.as_str());
    suite.set_time(time);
    suite.add_property(Property::new("seed", network.seed.to_string()));
    let mut add = |name: &str, status| {
        let mut case = TestCase::new(name, status);
        case.set_classname(network.scenario.as_str()).set_time(time);
        suite.add_test_case(case);
    };
    if run.summary.verdicts.is_empty() {
        add("it runs", TestCaseStatus::success());
    }
    for verdict in &run.summary.verdicts {
        add(&format!("{} {}", verdict.figure, verdict.expected), status(verdict, run.call));
    }
    suite
}

fn status(verdict: &Verdict, call: &str) -> TestCaseStatus {
    if verdict.passed {
        return TestCaseStatus::success();
    }
    let measured = page::measured(verdict);
    let mut lines = vec![format!("{} is {measured}, expected {}", verdict.figure, verdict.expected)];
    if let Some(margin) = verdict.margin {
        lines.push(format!("margin {margin}"));
    }
    if !verdict.why.is_empty() {
        lines.push(verdict.why.clone());
    }
    lines.extend(replay(verdict, call));
    let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
    status.set_type("expectation").set_message(format!("{measured}, expected {}", verdict.expected));
    status.set_description(lines.join("\n"));
    status
}

/// The command that tells the cycles that are worth a look.
pub fn replay(verdict: &Verdict, call: &str) -> Option<String> {
    verdict.cycle.map(|cycle| format!("isodp replay {call} --cycle {cycle} --window 2"))
}
