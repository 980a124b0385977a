//! Episodes of the shipped scenarios: disturbance, fault and recovery in whole networks.

use isodp::observation::{Observation, Phase};
use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::NearQueue;
use isodp::study::episode::EpisodeSummary;
use isodp::study::figure::{Figures, Value};
use isodp::study::run::run;
use isodp::time::{Span, Time};

use crate::support::{Run, scenario};

fn episodes(name: &str, sets: &[(&str, &str)]) -> Option<EpisodeSummary> {
    let outcome = run::<NearQueue<NetworkEvent>>(&scenario(name, sets), None, |_| ()).expect("a run without files");
    outcome.summary.episodes
}

#[test]
fn two_lost_clocks_lead_to_one_fault_that_costs_fifty_cycles() {
    let episodes = episodes("gc-loss", &[]).expect("an episode");
    let log = Run::of(&scenario("gc-loss", &[]));
    let at = |found: fn(&Observation) -> bool, nth: usize| -> Time {
        let mut all = log.events.iter().filter(|event| found(&event.what));
        all.nth(nth).expect("an event").at
    };
    // The clock of cycle 200 was repaid: the second disturbed telegram is the one that counts.
    let disturbed = at(|what| matches!(what, Observation::Disturbed { .. }), 1);
    let fault = at(|what| matches!(what, Observation::Fault { .. }), 0);
    let [to_fault, recovery] =
        [episodes.time_to_fault("0F04"), episodes.recovery("0F04")].map(|times| *times.expect("one time"));
    assert_eq!((to_fault.count, to_fault.min, to_fault.max), (1, Some(fault - disturbed), Some(fault - disturbed)));
    let (lost, back) = (log.phases_of(3), recovery.max.expect("a time"));
    assert_eq!(&lost[lost.len() - 3..], [(Phase::MasterLife, 318), (Phase::SlaveLife, 335), (Phase::Operation, 351)]);
    assert!(Span::from_ms(50) < back && back < Span::from_ms(51), "{back}");
    assert_eq!((episodes.losses, episodes.lasting.len(), episodes.slaves.len()), (1, 0, 1));
}

#[test]
fn lost_signs_of_life_are_found_in_the_second_cycle() {
    let episodes = episodes("life-sign-loss", &[]).expect("an episode");
    let to_fault = episodes.time_to_fault("0F02").expect("two faults");
    assert_eq!((to_fault.count, episodes.slaves.len(), episodes.losses), (2, 2, 2));
    assert!(to_fault.max < Some(Span::from_ms(2)), "{to_fault:?}");
    // Slave 3: resynchronised in cycle 318, operation in cycle 334; slave 4 waits for its master from 501 to 530 first.
    let recovery: Vec<_> = episodes.slaves.iter().map(|slave| (slave.address, slave.recovery[0].1.max())).collect();
    assert_eq!(recovery, [(3, Some(Span::from_ms(33))), (4, Some(Span::from_ms(61)))]);
}

#[test]
fn who_does_not_come_back_is_named() {
    let episodes = episodes("leds", &[]).expect("an episode");
    assert_eq!(episodes.lasting, [5, 7]);
    assert!(episodes.recovery("loss").expect("a recovery").max > Some(Span::from_s(45)));
}

#[test]
fn without_disturbance_there_are_times_to_recover_but_none_to_fault() {
    let episodes = episodes("gc-jitter-outside", &[]).expect("an episode");
    assert!(episodes.time_to_fault.is_empty() && episodes.recovery("all").expect("times").count > 0);
}

/// The value of a figure as a time; none if it has none.
fn time(figures: &Figures, name: &str) -> Option<Span> {
    match figures.get(name).unwrap_or_else(|error| panic!("{name}: {error}")) {
        Some(Value::Span(span)) => Some(span),
        None => None,
        other => panic!("{name}: {other:?}"),
    }
}

#[test]
fn times_have_figures_by_code() {
    let outcome = run::<NearQueue<NetworkEvent>>(&scenario("life-sign-loss", &[]), None, |_| ()).expect("a run");
    let (figures, episodes) = (&outcome.figures, outcome.summary.episodes.expect("episodes"));
    let told = episodes.time_to_fault("0F02").expect("two faults");
    for begin in ["time_to_fault.", "time_to_fault.0F02.", "time_to_fault.0f02."] {
        let of = |end: &str| time(figures, &format!("{begin}{end}"));
        assert_eq!((of("min"), of("max")), (told.min, told.max), "{begin}");
        // To the tick below.
        let mean = (of("mean").zip(told.mean)).map(|(figure, mean)| (figure - mean).abs());
        assert!(mean <= Some(Span::from_ticks(1)), "{begin}: {mean:?}");
        assert!(of("p50") >= of("min") && of("p50") <= of("p90") && of("p90") <= of("p99"), "{begin}");
        assert_eq!(figures.get(&format!("{begin}count")), Ok(Some(Value::Count(2))));
    }
    // No such fault: none of them, and no time.
    assert_eq!(figures.get("time_to_fault.0F04.count"), Ok(Some(Value::Count(0))));
    assert_eq!(["min", "mean", "p50", "max"].map(|end| time(figures, &format!("time_to_fault.0F04.{end}"))), [None; 4]);
    for slave in &episodes.slaves {
        let begin = format!("slave.{}.time_to_fault.0F02.", slave.address);
        assert_eq!(time(figures, &format!("{begin}max")), slave.time_to_fault[0].1.max());
        assert_eq!(figures.get(&format!("{begin}count")), Ok(Some(Value::Count(1))));
    }
    assert_eq!(time(figures, "slave.max.time_to_fault.0F02.max"), None, "not every slave has one");
    for wrong in
        ["time_to_fault.0F02", "time_to_fault.0F0.max", "time_to_fault.0F02.p95", "slave.3.time_to_fault.0F02.p50"]
    {
        assert!(figures.get(wrong).is_err(), "{wrong}");
    }
}

#[test]
fn recovery_has_percentiles_over_all_that_ended_operation() {
    let near =
        |figure: Option<Span>, ms: i64| (figure.expect("a time") - Span::from_ms(ms)).abs() < Span::from_us(ms + 1);
    // Two recoveries, of 33 and of 61 ms; values have three significant digits.
    let figures =
        run::<NearQueue<NetworkEvent>>(&scenario("life-sign-loss", &[]), None, |_| ()).expect("a run").figures;
    for (name, ms) in [("recovery.p50", 33), ("recovery.p90", 61), ("recovery.p99", 61)] {
        assert!(near(time(&figures, name), ms), "{name}: {:?}", time(&figures, name));
    }
    let figures = run::<NearQueue<NetworkEvent>>(&scenario("leds", &[]), None, |_| ()).expect("a run").figures;
    let kinds = figures.episodes().recovery();
    assert!(kinds.len() > 1, "{kinds:?}");
    let shortest = kinds.values().filter_map(|times| times.histogram().min()).min();
    assert_eq!(time(&figures, "recovery.min"), shortest);
    let [p50, p99, max] = ["p50", "p99", "max"].map(|end| time(&figures, &format!("recovery.{end}")).expect("a time"));
    assert!(p50 < p99 && (p99 - max).abs().ticks() <= max.ticks() / 500, "{p50} {p99} {max}");
    let none = run::<NearQueue<NetworkEvent>>(&scenario("startup", &[]), None, |_| ()).expect("a run").figures;
    assert_eq!(["recovery.p50", "time_to_fault.p99"].map(|name| time(&none, name)), [None; 2]);
}

#[test]
fn where_nothing_happens_there_is_no_episode() {
    assert!(episodes("startup", &[]).is_none() && episodes("gc-jitter", &[("run.duration", "1 s")]).is_none());
}
