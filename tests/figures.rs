//! Figures by name: every family and quantity says what summary.json of the same run says, and wrong names are told.

use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::NearQueue;
use isodp::study::figure::{Figure, Figures, Scope, Unit, Value};
use isodp::study::layout::Layout;
use isodp::study::run::{layout, run};
use serde_json::Value as Json;

use crate::support::scenario;

/// A shipped scenario's figures and its summary as a foreign reader sees it.
fn outcome(name: &str, sets: &[(&str, &str)]) -> (Figures, Json) {
    let outcome = run::<NearQueue<NetworkEvent>>(&scenario(name, sets), None, |_| ()).expect("a run without files");
    (outcome.figures, serde_json::to_value(&outcome.summary).expect("JSON"))
}

/// The figure as a number of `unit`; none if it has no value.
fn number(figures: &Figures, name: &str, unit: Unit) -> Option<f64> {
    figures.get(name).unwrap_or_else(|error| panic!("{name}: {error}")).map(|value| value.number(unit))
}

/// Every statistic of every distribution under `json` is what the figure says; returns how many were compared.
#[track_caller]
fn assert_distributions(figures: &Figures, begin: &str, json: &Json) -> usize {
    let mut compared = 0;
    for (quantity, statistics) in json.as_object().expect("distributions") {
        for (key, expected) in statistics.as_object().expect("statistics") {
            let statistic = key.strip_suffix("_ns").unwrap_or(key);
            let name = format!("{begin}{quantity}.{statistic}");
            assert_eq!(number(figures, &name, Unit::Ns), expected.as_f64(), "{name}");
            compared += 1;
        }
    }
    compared
}

/// `figure` is the number that the summary has at `key`, which ends with the unit of a time.
#[track_caller]
fn assert_figure(figures: &Figures, figure: &str, json: &Json, key: &str) {
    let unit = [("_us", Unit::Us), ("_ms", Unit::Ms), ("_s", Unit::S)];
    let unit = unit.into_iter().find(|(end, _)| key.ends_with(end)).map_or(Unit::Ns, |(_, unit)| unit);
    // What the summary leaves out did not happen.
    let expected = json.get(key).map_or(Some(0.0), Json::as_f64);
    assert_eq!(number(figures, figure, unit), expected, "{figure} and {key}");
}

fn assert_network(figures: &Figures, json: &Json) {
    for key in ["cycles", "duration_s"] {
        assert_figure(
            figures,
            key.trim_end_matches("_s"),
            &json["network"],
            if key == "cycles" { "cycles" } else { key },
        );
    }
    for (figure, key) in [
        ("t_dx.max", "t_dx_max_us"),
        ("left_after_t_dx", "left_after_t_dx_us"),
        ("spare.min", "spare_min_us"),
        ("cycle_time.min", "cycle_time_min_us"),
        ("cycle_time.mean", "cycle_time_mean_us"),
        ("cycle_time.max", "cycle_time_max_us"),
    ] {
        assert_figure(figures, figure, &json["timing"], key);
    }
    let counts = [
        "faults",
        "retries",
        "no_answers",
        "diagnoses",
        "auto_clears",
        "late_clocks",
        "tokens_claimed",
        "collisions",
        "disturbed",
        "events",
    ];
    for key in counts {
        assert_figure(figures, key, &json["counts"], key);
    }
    assert_figure(figures, "skew_steps.max", &json["counts"], "skew_max_steps");
    if let Some(ring) = json.get("ring") {
        for (figure, key) in [
            ("rotation.count", "rotations"),
            ("rotation.min", "rotation_min_us"),
            ("rotation.mean", "rotation_mean_us"),
            ("rotation.max", "rotation_max_us"),
            ("missed_clocks", "missed_clocks"),
        ] {
            assert_figure(figures, figure, ring, key);
        }
        if ring["late_clocks"] != 0 {
            assert_figure(figures, "late_clock.max", ring, "late_clock_max_us");
        }
    }
}

fn assert_slaves(figures: &Figures, json: &Json) {
    let same = [
        "lock_cycles",
        "resynchronisations",
        "clock_failures",
        "acknowledgements",
        "retries",
        "no_answers",
        "diagnoses",
    ];
    for slave in json["slaves"].as_array().expect("slaves") {
        let begin = format!("slave.{}.", slave["address"]);
        for key in same {
            assert_figure(figures, &format!("{begin}{key}"), slave, key);
        }
        assert_figure(figures, &format!("{begin}lock_time"), slave, "lock_ms");
        let truth = |name: &str| figures.get(&format!("{begin}{name}")).expect("a figure");
        assert_eq!(truth("in_operation"), Some(Value::Truth(slave["phase"] == "5 operation")));
        assert_eq!(truth("exchanging"), Some(Value::Truth(slave["state"] == "DATA_EXCH")));
        assert_eq!(truth("locked"), Some(Value::Truth(slave["pll"] == "locked")));
        let mut faults = 0.0;
        for (code, count) in slave["faults"].as_object().expect("faults") {
            assert_eq!(number(figures, &format!("{begin}faults.{code}"), Unit::Count), count.as_f64(), "{begin}{code}");
            faults += count.as_f64().expect("a count");
        }
        assert_eq!(number(figures, &format!("{begin}faults"), Unit::Count), Some(faults));
        let phases = ["configuration", "clock", "master_life", "slave_life", "operation"];
        for (phase, (_, expected)) in phases.iter().zip(slave["phases_ms"].as_object().expect("phases")) {
            let name = format!("{begin}phase_time.{phase}");
            assert_eq!(number(figures, &name, Unit::Ms), expected.as_f64(), "{name}");
        }
        assert!(assert_distributions(figures, &begin, &slave["distributions"]) >= 2 * 11);
    }
}

fn assert_stations(figures: &Figures, json: &Json) {
    for station in json["live_list"].as_array().expect("stations") {
        for (figure, key) in [
            ("lost", "lost"),
            ("syncs", "syncs"),
            ("repeats", "repeats"),
            ("repeats_per_cycle.max", "repeats_max_per_cycle"),
            ("illegal_responses", "illegal_responses"),
            ("diagnoses_read", "diagnoses"),
        ] {
            assert_figure(figures, &format!("station.{}.{figure}", station["address"]), station, key);
        }
    }
    for (figure, key) in
        [("lost", "lost"), ("syncs", "syncs"), ("repeats", "repeats"), ("illegal_responses", "illegal_responses")]
    {
        let all = json["live_list"].as_array().expect("stations").iter();
        let sum = all.map(|station| station[key].as_f64().expect("a count")).sum();
        assert_eq!(number(figures, figure, Unit::Count), Some(sum), "{figure}");
    }
}

fn assert_links(figures: &Figures, json: &Json) {
    for link in json["links"].as_array().expect("links") {
        let begin = format!("link.{}-{}.", link["publisher"], link["subscriber"]);
        let receptions = &link["receptions"];
        for (figure, key) in
            [("valid", "valid"), ("lost", "lost"), ("length_errors", "length_errors"), ("gap.max", "longest_gap_ms")]
        {
            assert_figure(figures, &format!("{begin}{figure}"), receptions, key);
        }
        assert!(assert_distributions(figures, &begin, &link["distributions"]) >= 3 * 11);
    }
}

fn assert_masters(figures: &Figures, json: &Json) {
    for master in json.get("masters").and_then(Json::as_array).into_iter().flatten() {
        let begin = format!("master.{}.", master["address"]);
        for (figure, key) in [
            ("cycle_time.min", "cycle_time_min_us"),
            ("cycle_time.mean", "cycle_time_mean_us"),
            ("cycle_time.max", "cycle_time_max_us"),
            ("t_dx.max", "t_dx_max_us"),
            ("token_visits", "token_visits"),
            ("tokens_claimed", "tokens_claimed"),
            ("rotation.min", "rotation_min_us"),
            ("rotation.mean", "rotation_mean_us"),
            ("rotation.max", "rotation_max_us"),
        ] {
            assert_figure(figures, &format!("{begin}{figure}"), master, key);
        }
        assert_eq!(figures.get(&format!("{begin}operate")), Ok(Some(Value::Truth(master["mode"] == "Operate"))));
    }
    for class in json.get("acyclic").and_then(Json::as_array).into_iter().flatten() {
        let begin = format!("acyclic.{}.", class["class"].as_str().expect("a class").replace(' ', ""));
        for key in ["requests", "positive", "negative", "timeouts", "connection_lost"] {
            assert_figure(figures, &format!("{begin}{key}"), class, key);
        }
        for statistic in ["min", "mean", "max"] {
            let key = format!("response_{statistic}_us");
            assert_figure(figures, &format!("{begin}response.{statistic}"), class, &key);
        }
    }
}

#[test]
fn figures_are_what_the_summary_of_the_same_run_says() {
    let short = [("run.duration", "300 ms")];
    for (name, sets) in [
        ("reference", &short[..]),
        ("acknowledge", &[]),
        ("dxb-lost-publisher", &[]),
        ("two-masters", &[]),
        ("lost-token", &[]),
        ("class2-beside", &[]),
        ("auto-clear", &[]),
        ("free-running", &[]),
    ] {
        let (figures, json) = outcome(name, sets);
        assert_network(&figures, &json);
        assert!(assert_distributions(&figures, "", &json["distributions"]) >= 5 * 11, "{name}");
        assert_slaves(&figures, &json);
        assert_stations(&figures, &json);
        assert_links(&figures, &json);
        assert_masters(&figures, &json);
    }
}

#[test]
fn every_listed_figure_is_found_by_its_name() {
    for name in ["reference", "two-masters", "free-running"] {
        let layout: Layout = layout(&scenario(name, &[]));
        let all = Figure::all(&layout);
        let columns: std::collections::BTreeSet<_> = all.iter().map(Figure::column).collect();
        assert_eq!(columns.len(), all.len(), "names of columns are different");
        for figure in &all {
            let found = Figure::named(figure.name()).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!((&found, found.unit(), found.who()), (figure, figure.unit(), figure.who()));
            found.check(&layout).unwrap_or_else(|error| panic!("{error}"));
        }
        let of = |scope| all.iter().filter(|figure| figure.scope() == scope).count();
        assert_eq!(of(Scope::Link) > 0, name == "reference");
        assert_eq!(of(Scope::Master) > 0, name == "two-masters");
    }
}

#[test]
fn instants_are_those_of_the_events() {
    use crate::support::Run;
    use isodp::observation::{Observation, Phase};
    let network = scenario("acknowledge", &[]);
    let log = Run::of(&network);
    let (figures, _) = outcome("acknowledge", &[]);
    let at = |name: &str| match figures.get(name) {
        Ok(Some(Value::Span(span))) => span,
        other => panic!("{name}: {other:?}"),
    };
    let faults: Vec<_> = log.events.iter().filter(|row| matches!(row.what, Observation::Fault { .. })).collect();
    assert_eq!(at("first_fault"), faults[0].at.since_zero());
    assert_eq!(at("last_fault"), faults[faults.len() - 1].at.since_zero());
    for slave in network.configured().map(|slave| slave.address) {
        let own = || log.events.iter().filter(|row| row.station == slave);
        let change = |what: &Observation| {
            matches!(what, Observation::SlaveState { .. } | Observation::Phase { .. } | Observation::Pll { .. })
        };
        let last = own().rfind(|row| change(&row.what)).expect("a change").at;
        assert_eq!(at(&format!("slave.{slave}.last_state_change")), last.since_zero());
        let operating = |what: &Observation| matches!(what, Observation::Phase { to: Phase::Operation, .. });
        let first = own().find(|row| operating(&row.what)).expect("operation").at;
        assert_eq!(at(&format!("slave.{slave}.first_operation")), first.since_zero());
    }
    assert_eq!(at("last_state_change"), at("slave.max.last_state_change"));
    let (quiet, _) = outcome("startup", &[]);
    assert_eq!((quiet.get("first_fault"), quiet.get("slave.3.last_fault")), (Ok(None), Ok(None)));
}

#[test]
fn times_of_episodes_are_those_of_all_slaves() {
    use isodp::study::episode::{Harm, Times};
    for name in ["gc-loss", "life-sign-loss", "dxb-lost-publisher", "startup"] {
        let (figures, _) = outcome(name, &[]);
        let episodes = figures.episodes();
        let faults = episodes.to_harm().iter().filter(|(harm, _)| matches!(harm, Harm::Fault(_)));
        let faults: Vec<_> = faults.map(|(_, times)| times.histogram()).collect();
        let recovery: Vec<_> = episodes.recovery().values().map(Times::histogram).collect();
        for (begin, all) in [("time_to_fault", faults), ("recovery", recovery)] {
            let get = |statistic: &str| figures.get(&format!("{begin}.{statistic}")).expect("a figure");
            let count = all.iter().map(|histogram| histogram.count()).sum();
            assert_eq!(get("count"), Some(Value::Count(count)), "{name}");
            assert_eq!(get("max"), all.iter().filter_map(|all| all.max()).max().map(Value::Span), "{name}");
            assert_eq!(get("min"), all.iter().filter_map(|all| all.min()).min().map(Value::Span), "{name}");
            assert_eq!(get("mean").is_some(), count > 0, "{name}");
        }
    }
    let (figures, _) = outcome("gc-loss", &[]);
    let get = |name: &str| figures.get(name).expect(name);
    assert_eq!(
        (get("slave.3.losses"), get("slave.4.losses"), get("losses")),
        (Some(Value::Count(1)), Some(Value::Count(0)), Some(Value::Count(1)))
    );
    assert_eq!((get("slave.3.recovery.max"), get("slave.4.recovery.max")), (get("recovery.max"), None));
    assert_eq!(get("unrecovered"), Some(Value::Count(0)));
}

#[test]
fn the_smallest_and_the_largest_need_all() {
    let (figures, _) = outcome("startup", &[("slave.4.powered_at", "299 ms")]);
    let span = |name: &str| figures.get(name).expect(name);
    assert!(span("slave.3.lock_time").is_some() && span("slave.4.lock_time").is_none());
    assert_eq!((span("slave.min.lock_time"), span("slave.max.lock_time")), (None, None));
    assert_eq!(span("slave.max.operation_share"), span("slave.3.operation_share"));
    assert_eq!(span("slave.min.operation_share"), Some(Value::Share(0.0)));
    assert_eq!(
        (span("in_operation"), span("slave.max.in_operation")),
        (Some(Value::Truth(false)), Some(Value::Truth(true)))
    );
    let error = figures.get("slave.each.lock_time").expect_err("many values").to_string();
    assert_eq!(
        error,
        "\"slave.each.lock_time\" has a value for each slave; ask for slave.min, slave.max or one of them"
    );
}

#[test]
fn wrong_names_are_told_with_the_nearest_right_one() {
    let layout = layout(&scenario("reference", &[]));
    let error = |name: &str| {
        let figure = Figure::named(name).and_then(|figure| figure.check(&layout));
        figure.expect_err(name).to_string()
    };
    for (name, expected) in [
        ("latch_scew.p99", "there is no figure \"latch_scew.p99\"; did you mean \"latch_skew.p99\"?"),
        ("slave.3.lock_tme", "there is no figure \"slave.3.lock_tme\"; did you mean \"slave.3.lock_time\"?"),
        ("slave.each.fault", "there is no figure \"slave.each.fault\"; did you mean \"slave.each.faults\"?"),
        ("faults.0F4", "there is no figure \"faults.0F4\"; did you mean \"faults.0F04\"?"),
        ("lock_time", "there is no figure \"lock_time\"; each slave has it: \"slave.each.lock_time\""),
        ("pll_error.p99", "there is no figure \"pll_error.p99\"; each slave has it: \"slave.each.pll_error.p99\""),
        ("slave.3.t_dx.p99", "there is no figure \"slave.3.t_dx.p99\"; the network has it: \"t_dx.p99\""),
        ("requests", "there is no figure \"requests\"; \"acyclic.<class1 or class2>.requests\" is one"),
        ("something else", "there is no figure \"something else\"; isodp figures lists all of them"),
        ("", "there is no figure \"\"; isodp figures lists all of them"),
        (
            "slave",
            "\"slave\" says slave and not which; after slave comes an address, each, min and max, such as \"slave.3.lock_time\"",
        ),
        ("slave.3", "there is no figure \"slave.3\"; a figure comes behind it, such as \"slave.3.in_operation\""),
        (
            "slave.126.faults",
            "\"126\" is no slave; after slave comes an address, each, min and max, such as \"slave.3.lock_time\"",
        ),
        ("slave.99.faults", "this network has no slave 99; it has slave 3, 4, 5, 6, 7, 8, 9, 10, 11"),
        (
            "link.3.valid",
            "\"3\" is no link; after link comes a publisher and a subscriber, each, min and max, such as \"link.3-11.publish.max\"",
        ),
        ("link.4-11.valid", "this network has no link 4-11; it has link 3-11"),
        ("synch_delay.max", "this network has no synch_delay; it is recorded where several masters share the token"),
        (
            "master.2.token_visits",
            "this network has one master only; figures by master are kept where several share the token; those of the network are its own",
        ),
        (
            "acyclic.class3.requests",
            "\"class3\" is no acyclic; after acyclic comes class1 or class2, such as \"acyclic.class2.response.max\"",
        ),
    ] {
        assert_eq!(error(name), expected);
    }
    assert!(
        error("latch_skew")
            .starts_with("there is no figure \"latch_skew\"; \"latch_skew\" is a distribution: behind it comes count,")
    );
    let alone = isodp::study::run::layout(&scenario("startup", &[]));
    let link = Figure::named("link.each.valid").expect("a figure");
    assert_eq!(
        link.check(&alone).expect_err("no links").to_string(),
        "this network has no link; add a [[link]] with publisher and subscriber"
    );
}
