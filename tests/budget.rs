//! Margin budgets of whole networks: cases whose answer is known, and the shipped scenarios.

use isodp::study::budget::source::SOURCES;
use isodp::study::budget::{Budget, Shares, SlaveBudget};
use isodp::study::scenario::{Crystal, Scenario};
use isodp::time::Span;

use crate::support::scenario;

/// `gc-jitter` for a second, without anything that a test does not put in.
fn still(sets: &[(&str, &str)]) -> Scenario {
    let base = [("run.duration", "2 s"), ("master.gc_jitter", "{ kind = \"none\" }")];
    let mut scenario = scenario("gc-jitter", &[&base[..], sets].concat());
    scenario.master.crystal = Crystal::Offset(0);
    for slave in &mut scenario.slaves {
        slave.crystal = Crystal::Offset(0);
        slave.options.pll.quantum = Span::from_ticks(1);
    }
    scenario
}

const JITTER: (&str, &str) = ("master.gc_jitter", "{ kind = \"uniform\", half_width = \"300 ns\" }");

fn budget(scenario: &Scenario) -> Budget {
    Budget::of(scenario, |_| ()).expect("slaves with a clock")
}
fn names(budget: &Budget) -> Vec<&str> {
    budget.sources.iter().map(|source| source.name).collect()
}
fn worst(slave: &SlaveBudget) -> &Shares {
    &slave.shares.as_ref().expect("a settled slave").worst
}
fn adds_up(shares: &Shares) -> bool {
    shares.rest + shares.parts.iter().copied().sum() + shares.interaction == shares.whole
}

#[test]
fn without_sources_nothing_is_used() {
    let budget = budget(&still(&[]));
    assert_eq!((names(&budget), budget.runs), (vec![], 1));
    for slave in &budget.slaves {
        let shares = worst(slave);
        assert!(shares.parts.is_empty() && shares.interaction == Span::ZERO && shares.rest == shares.whole);
        assert!(shares.whole <= Span::from_ticks(2), "{shares:?}");
        assert_eq!(slave.left(), Some(Span::from_us(1) - shares.whole));
    }
}

#[test]
fn a_source_alone_is_the_whole() {
    let budget = budget(&still(&[JITTER]));
    assert_eq!((names(&budget), budget.runs), (vec!["gc_jitter"], 2));
    for slave in &budget.slaves {
        let shares = worst(slave);
        assert_eq!((shares.parts[0] + shares.rest, shares.interaction), (shares.whole, Span::ZERO));
        // What strays evenly by ± 300 ns comes close to that in 1900 draws; the mean is not quite zero.
        let direct = slave.shares.as_ref().expect("shares").direct.whole;
        assert!(Span::from_ns(290) < direct && direct < Span::from_ns(320), "{direct}");
        // Sum of the magnitudes of the loop's impulse response: 2.55 (documentation of the PLL).
        assert!(direct < shares.whole && shares.whole.ticks() < direct.ticks() * 255 / 100, "{shares:?}");
    }
}

#[test]
fn the_loop_has_learnt_a_constant_offset() {
    let mut scenario = still(&[JITTER]);
    for slave in &mut scenario.slaves {
        slave.crystal = Crystal::Offset(100_000);
    }
    let budget = budget(&scenario);
    assert_eq!((names(&budget), budget.runs), (vec!["gc_jitter", "crystals"], 4));
    for slave in &budget.slaves {
        let shares = worst(slave);
        // 100 ppm of T_DP are 100 ns in every cycle; of the jitter it changes a ten thousandth.
        assert!(shares.parts[1].abs() < Span::from_ns(1), "{shares:?}");
        assert!(shares.parts[0] > Span::from_ns(300) && shares.interaction.abs() < Span::from_ns(1), "{shares:?}");
    }
}

#[test]
fn a_slave_before_the_repeater_has_no_part_of_it() {
    let sets = [
        ("repeater.1.jitter", "40 ns"),
        ("repeater.2.jitter", "60 ns"),
        JITTER,
        ("master.crystal", "{ within = \"50 ppm\" }"),
    ];
    let budget = budget(&scenario("repeaters", &sets));
    assert_eq!(names(&budget), ["gc_jitter", "repeaters", "crystals", "quantum"]);
    assert_eq!(budget.runs, 10);
    let repeaters: Vec<_> = budget.slaves.iter().map(|slave| worst(slave).parts[1]).collect();
    assert_eq!(repeaters[..2], [Span::ZERO; 2], "slaves 3 and 4 are on the master's segment");
    assert!(repeaters[2..].iter().all(|&part| part > Span::from_ns(20)), "{repeaters:?}");
    for slave in &budget.slaves {
        let shares = slave.shares.as_ref().expect("shares");
        assert!(adds_up(&shares.worst) && adds_up(&shares.p99_9) && adds_up(&shares.direct), "{shares:?}");
        assert!(shares.worst.interaction.abs().ticks() * 10 < shares.worst.whole.ticks(), "{shares:?}");
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let scenario = scenario("gc-jitter", &[("run.duration", "500 ms")]);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| budget(&scenario)).json()
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn every_source_can_be_switched_off() {
    let sets = [("repeater.1.jitter", "40 ns"), JITTER, ("master.crystal", "10 ppm")];
    let all = scenario("repeaters", &sets);
    for source in SOURCES {
        let mut without = all.clone();
        assert!((source.present)(&without), "{}", source.name);
        (source.off)(&mut without);
        let left: Vec<_> = SOURCES.iter().filter(|other| (other.present)(&without)).map(|other| other.name).collect();
        let others: Vec<_> = SOURCES.iter().map(|other| other.name).filter(|name| *name != source.name).collect();
        assert_eq!(left, others);
    }
}

#[test]
fn who_is_never_settled_has_no_budget_and_is_named() {
    let outside = [("run.duration", "1 s"), ("master.gc_jitter", "{ kind = \"uniform\", half_width = \"3 us\" }")];
    let budget = budget(&scenario("gc-jitter", &outside));
    assert!(budget.slaves.iter().all(|slave| slave.shares.is_none() && slave.left().is_none()));
    assert!(budget.page().contains("slave 3: no budget, it was not locked for 64 cycles in a row in every run"));
}

#[test]
fn a_network_without_clock_has_no_budget() {
    let error = Budget::of(&scenario("free-running", &[]), |_| ()).expect_err("no clock").to_string();
    assert!(error.starts_with("free-running: no slave follows a clock"), "{error}");
}
