//! Sequential test: whether a point of a search holds, decided with as few runs as the question allows.
//!
//! Wald's test ("Sequential tests of statistical hypotheses", 1945) of a failure probability: p0 is good enough, p1 is
//! too much, in between either answer will do. After each run the logarithm L of the likelihood of p1 over p0 is
//! compared with two bounds:
//!
//! ```text
//!             ln(beta / (1 - alpha))                   ln((1 - beta) / alpha)
//!  L: ------------------|------------------------------------------|---------------->
//!        the point holds         one more run is needed              it does not hold
//! ```
//!
//! L is computed from the two counts and not added up: the order of runs, and so the number of threads, cannot matter.
//! After `limit` runs the answer is the one that was settled beforehand.

use core::fmt;

/// The answer for one point of a search.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Verdict {
    /// Failures are rare enough.
    Holds,
    /// Failures are too frequent.
    Fails,
}

/// What the runs seen until now allow.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Decision {
    /// One more run is needed.
    GoOn,
    /// The evidence suffices.
    Proven(Verdict),
    /// The limit of runs is reached without: the answer settled beforehand.
    Settled(Verdict),
}

impl Decision {
    /// The answer, if there is one.
    pub const fn verdict(self) -> Option<Verdict> {
        match self {
            Self::GoOn => None,
            Self::Proven(verdict) | Self::Settled(verdict) => Some(verdict),
        }
    }
}

/// A test of a failure probability. Made by [`SequentialTest::new`] or [`SequentialTest::ONE_RUN`].
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SequentialTest {
    p0: f64,
    p1: f64,
    /// L at or below which the point holds, and at or above which it does not.
    bounds: (f64, f64),
    limit: u64,
    at_limit: Verdict,
}

/// What a test is made of.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SequentialSettings {
    /// A failure probability that is good enough, 0 included.
    pub p0: f64,
    /// A failure probability that is too much, 1 included.
    pub p1: f64,
    /// Probability of turning down a point whose failure probability is `p0`.
    pub alpha: f64,
    /// Probability of taking a point whose failure probability is `p1`.
    pub beta: f64,
    /// Largest number of runs.
    pub limit: u64,
    /// The answer where `limit` runs have not proven either.
    pub at_limit: Verdict,
}

/// Why there is no such test.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum SequentialError {
    /// The probabilities are none, or in no order.
    #[error("p0 = {p0} and p1 = {p1} are not in order 0 <= p0 < p1 <= 1")]
    Probabilities {
        /// Good enough.
        p0: f64,
        /// Too much.
        p1: f64,
    },
    /// An error rate is none.
    #[error("{name} = {value} is not between 0 and 0.5; 0.05 is usual")]
    ErrorRate {
        /// `alpha` or `beta`.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// No run is allowed.
    #[error("limit = 0 allows no run; 1 is the least")]
    NoRun,
}

impl SequentialTest {
    /// The test of a case in which every repetition is the same, as nothing is drawn: one run decides.
    pub const ONE_RUN: Self =
        Self { p0: 0.0, p1: 1.0, bounds: (f64::NEG_INFINITY, f64::INFINITY), limit: 1, at_limit: Verdict::Holds };

    /// The test of `settings`.
    ///
    /// # Errors
    /// If a probability or an error rate is out of its range, or no run is allowed.
    pub fn new(settings: SequentialSettings) -> Result<Self, SequentialError> {
        let SequentialSettings { p0, p1, alpha, beta, limit, at_limit } = settings;
        if !(0.0 <= p0 && p0 < p1 && p1 <= 1.0) {
            return Err(SequentialError::Probabilities { p0, p1 });
        }
        for (name, value) in [("alpha", alpha), ("beta", beta)] {
            if !(value > 0.0 && value < 0.5) {
                return Err(SequentialError::ErrorRate { name, value });
            }
        }
        if limit == 0 {
            return Err(SequentialError::NoRun);
        }
        let bounds = (libm::log(beta / (1.0 - alpha)), libm::log((1.0 - beta) / alpha));
        Ok(Self { p0, p1, bounds, limit, at_limit })
    }

    /// What `failures` in `runs` runs allow.
    ///
    /// # Panics
    /// If more failed than ran.
    pub fn decide(&self, failures: u64, runs: u64) -> Decision {
        assert!(failures <= runs, "{failures} of {runs} runs failed");
        let evidence = self.evidence(failures, runs);
        if evidence >= self.bounds.1 {
            Decision::Proven(Verdict::Fails)
        } else if evidence <= self.bounds.0 {
            Decision::Proven(Verdict::Holds)
        } else if runs >= self.limit {
            Decision::Settled(self.at_limit)
        } else {
            Decision::GoOn
        }
    }

    /// Runs one after the other until there is an answer. `fails` is given the number of the run, from 0.
    ///
    /// # Errors
    /// Those of `fails`.
    pub fn run<E>(&self, mut fails: impl FnMut(u64) -> Result<bool, E>) -> Result<Tested, E> {
        let mut tally = Tally::new(*self);
        loop {
            if let Some(tested) = tally.count(fails(tally.runs())?) {
                return Ok(tested);
            }
        }
    }

    /// Most runs that a point can take.
    pub const fn limit(&self) -> u64 {
        self.limit
    }

    /// L after `failures` in `runs` runs.
    fn evidence(&self, failures: u64, runs: u64) -> f64 {
        let failed = weighed(failures as f64, libm::log(self.p1 / self.p0));
        let passed = weighed((runs - failures) as f64, self.gain());
        // What p0 forbids refutes it, even if p1 forbids the rest.
        if failed == f64::INFINITY { failed } else { failed + passed }
    }
    /// What a run without failure adds to L; negative.
    fn gain(&self) -> f64 {
        libm::log1p(-self.p1) - libm::log1p(-self.p0)
    }
}

/// `count` times `each`; nothing of something endless is nothing.
fn weighed(count: f64, each: f64) -> f64 {
    if count > 0.0 { count * each } else { 0.0 }
}

/// A test under way: runs are counted one by one, in the order of their numbers.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Tally {
    test: SequentialTest,
    runs: u64,
    failures: u64,
}

impl Tally {
    /// No run yet.
    pub const fn new(test: SequentialTest) -> Self {
        Self { test, runs: 0, failures: 0 }
    }
    /// How many runs were counted.
    pub const fn runs(&self) -> u64 {
        self.runs
    }
    /// Counts the next run; what the test came to, if it needs no more.
    pub fn count(&mut self, fails: bool) -> Option<Tested> {
        self.failures += u64::from(fails);
        self.runs += 1;
        let (runs, failures) = (self.runs, self.failures);
        let decision = self.test.decide(failures, runs);
        let tested = |verdict| Tested { verdict, proven: decision == Decision::Proven(verdict), runs, failures };
        decision.verdict().map(tested)
    }
}

/// What a test of one point came to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Tested {
    /// The answer.
    pub verdict: Verdict,
    /// Whether the evidence sufficed; else the limit of runs was reached.
    pub proven: bool,
    /// How many runs were needed.
    pub runs: u64,
    /// How many of them failed.
    pub failures: u64,
}

impl Tested {
    /// One run that tells all, as nothing is drawn.
    pub const fn once(holds: bool) -> Self {
        let verdict = if holds { Verdict::Holds } else { Verdict::Fails };
        Self { verdict, proven: true, runs: 1, failures: !holds as u64 }
    }
}

/// `holds`, `does not hold`.
impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Holds => "holds",
            Self::Fails => "does not hold",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: SequentialSettings =
        SequentialSettings { p0: 0.01, p1: 0.1, alpha: 0.05, beta: 0.1, limit: 1_000, at_limit: Verdict::Fails };

    #[test]
    fn runs_without_failure_prove_a_point_after_a_known_number() {
        let test = SequentialTest::new(SETTINGS).unwrap();
        // ln(0.1 / 0.95) / ln(0.9 / 0.99) = 23.6 runs.
        assert_eq!(test.decide(0, 23), Decision::GoOn);
        assert_eq!(test.decide(0, 24), Decision::Proven(Verdict::Holds));
        // ln(0.9 / 0.05) / ln(0.1 / 0.01) = 1.26 failures.
        assert_eq!(test.decide(1, 1), Decision::GoOn);
        assert_eq!(test.decide(2, 2), Decision::Proven(Verdict::Fails));
        assert_eq!(test.decide(0, 0), Decision::GoOn);
    }

    #[test]
    fn the_limit_gives_the_answer_settled_beforehand() {
        for at_limit in [Verdict::Holds, Verdict::Fails] {
            let test = SequentialTest::new(SequentialSettings { limit: 10, at_limit, ..SETTINGS }).unwrap();
            assert_eq!(test.decide(0, 9), Decision::GoOn);
            assert_eq!(test.decide(0, 10), Decision::Settled(at_limit));
            assert_eq!(test.decide(3, 10), Decision::Proven(Verdict::Fails));
        }
    }

    #[test]
    fn where_every_repetition_is_the_same_one_run_decides() {
        let ask = |fails| SequentialTest::ONE_RUN.run(|_| Ok::<_, ()>(fails)).unwrap();
        assert_eq!(ask(false), Tested { verdict: Verdict::Holds, proven: true, runs: 1, failures: 0 });
        assert_eq!(ask(true), Tested { verdict: Verdict::Fails, proven: true, runs: 1, failures: 1 });
    }

    #[test]
    fn a_point_that_may_never_fail_is_refuted_by_the_first_failure() {
        let test = SequentialTest::new(SequentialSettings { p0: 0.0, ..SETTINGS }).unwrap();
        assert_eq!(test.decide(1, 500), Decision::Proven(Verdict::Fails));
        assert_eq!(test.decide(0, 21), Decision::GoOn);
        assert_eq!(test.decide(0, 22), Decision::Proven(Verdict::Holds));
        let certain = SequentialTest::new(SequentialSettings { p1: 1.0, ..SETTINGS }).unwrap();
        assert_eq!(certain.decide(0, 1), Decision::Proven(Verdict::Holds));
        let both = SequentialTest::new(SequentialSettings { p0: 0.0, p1: 1.0, ..SETTINGS }).unwrap();
        assert_eq!(both.decide(1, 2), Decision::Proven(Verdict::Fails));
    }

    #[test]
    fn settings_that_make_no_sense_are_named() {
        for (settings, text) in [
            (SequentialSettings { p0: 0.2, ..SETTINGS }, "p0 = 0.2 and p1 = 0.1 are not in order 0 <= p0 < p1 <= 1"),
            (
                SequentialSettings { p1: f64::NAN, ..SETTINGS },
                "p0 = 0.01 and p1 = NaN are not in order 0 <= p0 < p1 <= 1",
            ),
            (SequentialSettings { alpha: 0.5, ..SETTINGS }, "alpha = 0.5 is not between 0 and 0.5; 0.05 is usual"),
            (SequentialSettings { beta: 0.0, ..SETTINGS }, "beta = 0 is not between 0 and 0.5; 0.05 is usual"),
            (SequentialSettings { limit: 0, ..SETTINGS }, "limit = 0 allows no run; 1 is the least"),
        ] {
            assert_eq!(SequentialTest::new(settings).unwrap_err().to_string(), text);
        }
    }

    #[test]
    fn an_error_of_a_run_ends_the_test() {
        let test = SequentialTest::new(SETTINGS).unwrap();
        assert_eq!(test.run(|run| if run == 3 { Err(run) } else { Ok(false) }), Err(3));
    }
}
