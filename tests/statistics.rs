//! Statistics against distributions whose answer is known: intervals hold it as often as they say, tests err as rarely.
//!
//! Every draw is of a fixed seed. The bounds leave three standard deviations of the number of trials, and what the method
//! itself is known to miss.

use std::convert::Infallible;

use isodp::sim::noise::{Purpose, Stream};
use isodp::study::quantity::Measure;
use isodp::study::statistics::aggregate::{Aggregate, Place, RunKey};
use isodp::study::statistics::batch_means::BatchMeans;
use isodp::study::statistics::bisection::{Answer, Search};
use isodp::study::statistics::confidence::Confidence;
use isodp::study::statistics::probability::Probability;
use isodp::study::statistics::quantile::Ranks;
use isodp::study::statistics::sequential::{SequentialSettings, SequentialTest, Verdict};
use isodp::study::statistics::stop_rule::{Next, StopRule, StopSettings};
use isodp::study::tolerance::scale::Scale;
use isodp::time::Span;
use proptest::prelude::*;

use crate::props::config;

/// One microsecond of ticks.
const US: f64 = 12_000.0;

/// The draws of one test, which is given a number of its own.
fn draws(test: u8) -> Stream {
    Stream::new(0x5eed, test, Purpose::Sampling)
}
fn normal(stream: &mut Stream) -> i64 {
    (stream.normal() * US).round() as i64
}
fn uniform(stream: &mut Stream) -> i64 {
    stream.uniform(Span::from_us(1)).ticks()
}
/// Exponential with a mean of 1 µs.
fn exponential(stream: &mut Stream) -> i64 {
    let share = (stream.below(1 << 53) as f64 + 0.5) / (1u64 << 53) as f64;
    (-libm::log(share) * US).round() as i64
}
fn happens(stream: &mut Stream, probability: f64) -> bool {
    (stream.below(1 << 53) as f64) < probability * (1u64 << 53) as f64
}
fn aggregate(values: &[i64]) -> Aggregate {
    let mut all = Aggregate::default();
    values.iter().zip(0..).for_each(|(&value, cycle)| all.add(value, Place { run: RunKey(1), cycle }));
    all
}
/// The share of `trials` in which `held`.
fn share(trials: u32, mut held: impl FnMut() -> bool) -> f64 {
    f64::from((0..trials).map(|_| u32::from(held())).sum::<u32>()) / f64::from(trials)
}

#[test]
fn intervals_of_means_hold_the_mean_as_often_as_they_say() {
    type Draw = fn(&mut Stream) -> i64;
    // Distribution, its mean, values per interval, what Student's interval misses of it as it is not normal.
    let cases: [(Draw, f64, usize, f64); 4] =
        [(normal, 0.0, 3, 0.0), (normal, 0.0, 20, 0.0), (uniform, 0.0, 20, 0.005), (exponential, US, 50, 0.02)];
    for (number, (draw, mean, count, missed)) in cases.into_iter().enumerate() {
        for percent in [80.0, 95.0] {
            let mut stream = draws(number as u8);
            let confidence = Confidence::new(percent / 100.0).unwrap();
            let held = share(3_000, || {
                let values: Vec<_> = (0..count).map(|_| draw(&mut stream)).collect();
                aggregate(&values).mean_interval(confidence).unwrap().holds(mean)
            });
            let expected = confidence.value();
            let chance = 3.0 * (expected * (1.0 - expected) / 3_000.0).sqrt();
            assert!((held - expected).abs() <= chance + missed, "case {number} at {confidence}: {held}");
        }
    }
}

/// `count` values, each `memory` of the one before and a normal rest; in steady state from the first.
fn remembering(stream: &mut Stream, memory: f64, count: usize) -> Vec<i64> {
    let mut state = stream.normal() / (1.0 - memory * memory).sqrt();
    let mut next = || {
        state = memory * state + stream.normal();
        (state * US).round() as i64
    };
    (0..count).map(|_| next()).collect()
}

#[test]
fn batches_hold_the_mean_of_values_that_remember() {
    let mut stream = draws(10);
    let (mut plain, mut flagged) = (0, 0);
    let held = share(400, || {
        let values = remembering(&mut stream, 0.9, 8_000);
        let mut batches = BatchMeans::new();
        for &value in &values {
            batches.push(value);
        }
        let mean = batches.interval(Confidence::USUAL).unwrap();
        plain += u32::from(aggregate(&values).mean_interval(Confidence::USUAL).unwrap().holds(0.0));
        flagged += u32::from(mean.correlated);
        mean.interval.holds(0.0)
    });
    assert!((0.915..=0.985).contains(&held), "{held}");
    // What takes neighbours for independent is wrong more often than right.
    assert!(plain < 200, "{plain} of 400");
    assert!(flagged < 20, "{flagged} of 400");
}

#[test]
fn batches_tell_when_they_are_too_short() {
    let told = |test, memory, count| {
        let mut stream = draws(test);
        share(500, || {
            let mut batches = BatchMeans::new();
            for value in remembering(&mut stream, memory, count) {
                batches.push(value);
            }
            batches.interval(Confidence::USUAL).unwrap().correlated
        })
    };
    // 1000 values of a memory of 100: ten independent ones at best.
    assert!(told(11, 0.99, 1_000) > 0.95);
    assert!(told(12, 0.9, 200) > 0.95);
    for (test, count) in [(13, 40), (14, 100), (15, 1_000)] {
        let alarms = told(test, 0.0, count);
        assert!(alarms < 0.03, "{count} independent values: {alarms}");
    }
}

#[test]
fn intervals_of_quantiles_hold_them_for_any_distribution() {
    for (test, count, percent, value) in [
        (20, 30, 50.0, -libm::log(0.5)),
        (21, 100, 90.0, -libm::log(0.1)),
        (22, 1_000, 99.0, -libm::log(0.01)),
        (23, 400, 1.0, -libm::log(0.99)),
    ] {
        let mut stream = draws(test);
        let held = share(2_000, || {
            let mut values: Vec<_> = (0..count).map(|_| exponential(&mut stream)).collect();
            values.sort_unstable();
            let ranks = Ranks::new(count as u64, percent, Confidence::USUAL).unwrap();
            let bound = |rank: Option<u64>| rank.map(|rank| values[rank as usize - 1] as f64);
            let at = value * US;
            bound(ranks.low).is_none_or(|low| low <= at) && bound(ranks.high).is_none_or(|high| high >= at)
        });
        // At least as often: ranks are whole.
        assert!((0.95 - 0.015..=0.99).contains(&held), "{percent} % of {count}: {held}");
    }
}

/// Wald's mean number of runs where the failure probability is `p`, and a test ends with `held` of them at the lower bound.
fn mean_runs(settings: &SequentialSettings, p: f64, held: f64) -> f64 {
    let SequentialSettings { p0, p1, alpha, beta, .. } = *settings;
    let end = held * libm::log(beta / (1.0 - alpha)) + (1.0 - held) * libm::log((1.0 - beta) / alpha);
    end / (p * libm::log(p1 / p0) + (1.0 - p) * libm::log((1.0 - p1) / (1.0 - p0)))
}

#[test]
fn sequential_tests_err_as_rarely_and_take_as_many_runs_as_wald_says() {
    let settings =
        SequentialSettings { p0: 0.05, p1: 0.2, alpha: 0.05, beta: 0.1, limit: 100_000, at_limit: Verdict::Fails };
    let test = SequentialTest::new(settings).unwrap();
    let expected_good = mean_runs(&settings, settings.p0, 1.0 - settings.alpha);
    let expected_bad = mean_runs(&settings, settings.p1, settings.beta);
    for (number, p, wrong, allowed, expected) in [
        // Wald: at most alpha / (1 - beta) and beta / (1 - alpha).
        (30, settings.p0, Verdict::Fails, 0.05 / 0.9, expected_good),
        (31, settings.p1, Verdict::Holds, 0.1 / 0.95, expected_bad),
    ] {
        let mut stream = draws(number);
        let mut runs = 0;
        let erred = share(4_000, || {
            let tested = test.run(|_| Ok::<_, Infallible>(happens(&mut stream, p))).unwrap();
            runs += tested.runs;
            assert!(tested.proven);
            tested.verdict == wrong
        });
        assert!(erred <= allowed + 3.0 * f64::sqrt(allowed / 4_000.0), "at {p}: {erred}");
        // The formula takes the bound for met exactly; the last run steps over it.
        let mean = runs as f64 / 4_000.0;
        assert!((0.95..1.35).contains(&(mean / expected)), "at {p}: {mean} runs, expected {expected}");
    }
}

#[test]
fn a_sequential_test_with_a_limit_ends_there() {
    let settings =
        SequentialSettings { p0: 0.05, p1: 0.2, alpha: 0.05, beta: 0.1, limit: 20, at_limit: Verdict::Fails };
    let test = SequentialTest::new(settings).unwrap();
    let mut stream = draws(32);
    let mut settled = 0;
    for _ in 0..500 {
        let tested = test.run(|_| Ok::<_, Infallible>(happens(&mut stream, 0.1))).unwrap();
        assert!(tested.runs <= 20);
        if !tested.proven {
            settled += 1;
            assert_eq!((tested.runs, tested.verdict), (20, Verdict::Fails));
        }
    }
    assert!((50..450).contains(&settled), "{settled}");
}

#[test]
fn repetitions_end_when_the_interval_is_narrow_enough() {
    let settings = StopSettings { relative: 0.05, floor: 0.0, least: 20, most: 10_000 };
    let rule = StopRule::new(settings).unwrap();
    let mut stream = draws(40);
    let mut runs = 0;
    let held = share(1_000, || {
        let mut values = Aggregate::default();
        while rule.next(values.count(), values.mean_interval(Confidence::USUAL)) == Next::GoOn {
            let run = RunKey(values.count().into());
            values.add(5 * 12_000 + normal(&mut stream), Place { run, cycle: 0 });
        }
        runs += values.count();
        let interval = values.mean_interval(Confidence::USUAL).unwrap();
        assert!(interval.half_width() <= 0.05 * interval.estimate);
        interval.holds(5.0 * US)
    });
    // (1.96 x 0.2 / 0.05)² = 61.5 runs. Looking after every run costs a little confidence.
    assert!((55.0..70.0).contains(&(runs as f64 / 1_000.0)), "{runs}");
    assert!(held > 0.91, "{held}");
}

#[test]
fn a_search_with_sequential_tests_finds_where_failures_set_in() {
    // Failures set in around 500, from one in a thousand at 430 to nine in ten at 522.
    let failing = |value: i64| 1.0 / (1.0 + libm::exp((500 - value) as f64 / 10.0));
    let settings =
        SequentialSettings { p0: 0.02, p1: 0.2, alpha: 0.01, beta: 0.01, limit: 1_000, at_limit: Verdict::Fails };
    let test = SequentialTest::new(settings).unwrap();
    let [from, to, step] = ["0", "2000", "5"].map(|text| Measure::read(text).unwrap());
    let scale = Scale::stepped(from, to, step).unwrap();
    let at = |number: i64| 5 * number;
    let search = Search::new(&scale, 0, 5, scale.last(), 4).unwrap();
    for number in 50..60 {
        let mut stream = draws(number);
        let found =
            search.run(|value| test.run(|_| Ok::<_, Infallible>(happens(&mut stream, failing(at(value)))))).unwrap();
        let Answer::Band { holds, fails } = found.answer else { panic!("a band") };
        assert_eq!(fails - holds, 1);
        // p0 is at 461, p1 at 486; in between either answer will do.
        assert!((450..=495).contains(&at(holds)), "{holds}");
        assert!(found.inversions.is_empty() && found.runs() < 3_000, "{} runs", found.runs());
        let told = found.curve.iter().map(|point| (at(point.value), point.tested));
        for (value, tested) in told {
            let (low, high) = Probability::of(tested.failures, tested.runs, Confidence::new(0.9999).unwrap()).bounds();
            assert!(low <= failing(value) && failing(value) <= high, "{value}: {tested:?}");
        }
    }
}

/// Values with the extremes that there are.
fn values() -> impl Strategy<Value = Vec<(i64, u8, u8)>> {
    let value = prop_oneof![3 => -50..50i64, 2 => any::<i64>(), 1 => Just(i64::MIN), 1 => Just(i64::MAX)];
    prop::collection::vec((value, 0..4u8, 0..4u8), 0..40)
}
fn of(values: &[(i64, u8, u8)]) -> Aggregate {
    let mut all = Aggregate::default();
    for &(value, run, cycle) in values {
        all.add(value, Place { run: RunKey(run.into()), cycle: cycle.into() });
    }
    all
}
fn merged(mut a: Aggregate, b: &Aggregate) -> Aggregate {
    a.merge(b);
    a
}

proptest! {
    #![proptest_config(config(256))]

    #[test]
    fn merges_are_associative_and_commutative(a in values(), b in values(), c in values()) {
        let together = of(&[&a[..], &b, &c].concat());
        let [a, b, c] = [of(&a), of(&b), of(&c)];
        let left = merged(merged(a, &b), &c);
        let right = merged(a, &merged(b, &c));
        let turned = merged(merged(c, &b), &a);
        prop_assert_eq!(&left, &together);
        prop_assert_eq!(&right, &together);
        prop_assert_eq!(&turned, &together);
        let variance = |all: &Aggregate| all.variance().map(f64::to_bits);
        prop_assert_eq!(variance(&turned), variance(&together));
    }

    #[test]
    fn texts_are_read_back_to_the_same_bits(a in values()) {
        let all = of(&a);
        let json = serde_json::to_string(&all).unwrap();
        prop_assert_eq!(serde_json::from_str::<Aggregate>(&json).unwrap(), all);
    }

    #[test]
    fn moments_are_those_of_the_values(a in prop::collection::vec(-1_000_000..1_000_000i64, 2..60)) {
        let all = aggregate(&a);
        let count = a.len() as f64;
        let mean = a.iter().sum::<i64>() as f64 / count;
        let squares: f64 = a.iter().map(|&value| (value as f64 - mean) * (value as f64 - mean)).sum();
        prop_assert!((all.mean().unwrap() - mean).abs() <= 1e-9);
        prop_assert!((all.variance().unwrap() - squares / (count - 1.0)).abs() <= 1e-9 * (1.0 + squares));
        prop_assert_eq!(all.min().map(|min| min.value), a.iter().min().copied());
        prop_assert_eq!(all.max().map(|max| max.value), a.iter().max().copied());
    }
}
