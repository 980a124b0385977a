//! Expectations and verdicts: what `[expect]` takes, what a user, a server of tests and another program are told.

use std::fs;
use std::path::Path;

use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::NearQueue;
use isodp::study::run::{Outcome, run};
use isodp::study::scenario::Scenario;
use roxmltree::{Document, Node};

use crate::cli::{Room, SCENE};
use crate::support::{scenario, shipped};

/// The scenarios that are tested here.
pub(crate) const TESTS: &[(&str, fn())] = &[("canary", canary), ("jitter-tolerance", jitter_tolerance)];

fn outcome(scenario: &Scenario) -> Outcome {
    run::<NearQueue<NetworkEvent>>(scenario, None, |_| ()).expect("a run without files")
}
/// [`SCENE`] with these lines under `[expect]`.
fn expecting(lines: &str) -> Scenario {
    Scenario::parse("scene", "scene.toml", &format!("{SCENE}\n[expect]\n{lines}"), &[])
        .unwrap_or_else(|error| panic!("{error}"))
}
/// What is said of these lines under `[expect]`, without the place and the line.
fn refused(lines: &str) -> String {
    let error = Scenario::parse("scene", "scene.toml", &format!("{SCENE}\n[expect]\n{lines}"), &[]).expect_err(lines);
    let told: Vec<_> =
        error.problems.iter().map(|problem| format!("{}: {}", problem.key, problem.fault.message)).collect();
    assert!(error.problems.iter().all(|problem| problem.position.is_some()), "{lines}: where?");
    told.join("\n")
}
/// Figure and whether it holds, of each verdict.
fn judged(lines: &str) -> Vec<(String, bool)> {
    let verdicts = outcome(&expecting(lines)).summary.verdicts;
    verdicts.into_iter().map(|verdict| (verdict.figure, verdict.passed)).collect()
}
fn text(octets: &[u8]) -> &str {
    std::str::from_utf8(octets).expect("text")
}

/// Every slave holds the permitted jitter.
fn jitter_tolerance() {
    let outcome = outcome(&scenario("jitter-tolerance", &[]));
    assert!(outcome.summary.verdicts.len() > 10 && outcome.summary.passed());
    let wide = [("master.gc_jitter.half_width", "800 ns"), ("run.duration", "2 s")];
    let failing = |sets: &[(&str, &str)]| -> Vec<String> {
        let verdicts = self::outcome(&scenario("jitter-tolerance", sets)).summary.verdicts;
        verdicts.into_iter().filter(|verdict| !verdict.passed).map(|verdict| verdict.figure).collect()
    };
    let failed = failing(&wide);
    for figure in ["gc_jitter.magnitude_max", "clock_failures", "slave.each.pll_error.magnitude_p99.9"] {
        assert!(failed.iter().any(|name| name == figure), "{figure} of {failed:?}");
    }
}

/// The beginning of the long run: what is expected of all of it holds, and no row is kept for a cycle.
#[test]
fn a_day_begins_well() {
    let summary = outcome(&scenario("long/day", &[("run.cycles", "20000")])).summary;
    assert_eq!((summary.verdicts.len(), summary.passed()), (6, true));
    let wide = [("run.cycles", "20000"), ("master.gc_jitter.bound", "1.5 us"), ("master.gc_jitter.sigma", "600 ns")];
    assert!(!outcome(&scenario("long/day", &wide)).summary.passed());
}

/// It fails where it says that it does, and holds where it says so.
fn canary() {
    let summary = outcome(&scenario("canary", &[])).summary;
    let verdicts: Vec<_> = summary.verdicts.iter().map(|verdict| (&*verdict.figure, verdict.passed)).collect();
    let expected = [
        ("cycles", true),
        ("gc_jitter.magnitude_max", true),
        ("faults", false),
        ("clock_failures", false),
        ("slave.each.lock_time", false),
        ("slave.5.exchanging", false),
    ];
    assert_eq!(verdicts, expected);
    assert!(!summary.passed());
    let lock = &summary.verdicts[4];
    assert_eq!((lock.measured, lock.subject.map(|subject| subject.to_string())), (None, Some("slave 5".to_owned())));
}

#[test]
fn every_shipped_scenario_but_the_canary_keeps_what_it_expects() {
    let mut expecting = 0;
    for name in shipped() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(format!("{name}.txt"));
        let golden = fs::read_to_string(path).expect("a golden file");
        expecting += usize::from(!scenario(&name, &[]).expectations.is_empty());
        assert_eq!(golden.contains("FAIL"), name == "canary", "{name}");
    }
    assert!(expecting >= 12, "{expecting} scenarios expect something");
}

#[test]
fn verdicts_change_no_fingerprint() {
    let scene = Scenario::parse("scene", "scene.toml", SCENE, &[]).expect("a scenario");
    let (plain, judged) = (outcome(&scene), outcome(&expecting("faults = \"== 7\"")));
    assert_eq!((plain.fingerprint, plain.statistics), (judged.fingerprint, judged.statistics));
    assert_eq!((plain.summary.passed(), judged.summary.passed()), (true, false));
    assert_eq!(plain.summary.fingerprint, judged.summary.fingerprint);
}

#[test]
fn keys_are_figures_in_dots_or_quotation_marks_in_the_order_of_the_file() {
    let lines = r#"
        slave.each.in_operation = true
        latch_skew.p99 = { is = "<= 1 ms", why = "it is small" }
        faults = "== 0"
        "faults.0F04" = ["== 0", "< 1"]
        latch_skew."p99.9" = "> 0 ns"
        first_fault = "none"
        slave.3.last_fault = "none"
        t_dx.max = ["> 1 tbit", "< 2 ms"]
        "cycles" = "!= 0"
        link.3-5.age.max = "<= 1.2 ms"
    "#;
    let expected = [
        ("slave.each.in_operation", true),
        ("latch_skew.p99", true),
        ("faults", true),
        ("faults.0F04", true),
        ("latch_skew.p99.9", true),
        ("first_fault", true),
        ("slave.3.last_fault", true),
        ("t_dx.max", true),
        ("cycles", true),
        ("link.3-5.age.max", true),
    ];
    assert_eq!(judged(lines), expected.map(|(name, passed)| (name.to_owned(), passed)));
}

#[test]
fn what_cannot_be_expected_is_told_with_its_place() {
    for (line, expected) in [
        ("latch_scew.p99 = \"<= 1 us\"", "expect.latch_scew.p99: there is no figure \"latch_scew.p99\""),
        ("faults = 0", "expect.faults: this is a number"),
        ("faults = \"0\"", "expect.faults: \"0\" begins with no comparison"),
        ("faults = \"<= 5 ns\"", "expect.faults: \"5 ns\" is not a count"),
        ("faults = \"< 0\"", "expect.faults: no value is < 0"),
        ("faults = true", "expect.faults: this is true or false"),
        ("faults = []", "expect.faults: this list is empty"),
        ("faults = { why = \"x\" }", "expect.faults.why: there is no figure \"faults.why\""),
        ("faults = { is = \"== 0\", whi = \"x\" }", "expect.faults.whi: there is no such key"),
        ("faults = { is = \"== 0\", why = 3 }", "expect.faults.why: this is a number"),
        ("faults = {}", "expect.faults: nothing is expected here"),
        (
            "latch_skew.p99 = \"<= 1\"",
            "expect.latch_skew.p99: \"1\" has no unit; a time has one of the units ns, us, ms, s, min, h, tick, tbit",
        ),
        ("latch_skew.p99 = [\">= 2 us\", \"< 1 us\"]", "expect.latch_skew.p99: no value is >= 2 us, < 1 us"),
        ("in_operation = \"== 1\"", "expect.in_operation: in_operation is either true or false"),
        ("slave.9.faults = \"== 0\"", "expect.slave.9.faults: this network has no slave 9"),
        (
            "link.each.publish.p99 = \"< 1 ms\"\nsynch_delay.max = \"< 1 us\"",
            "expect.synch_delay.max: this network has no synch_delay",
        ),
        ("faults = \"== 0\"\n\"faults \" = \"== 1\"", "expect.faults: \"faults\" is expected twice"),
    ] {
        assert_eq!(refused(line), expected, "{line}");
    }
    assert_eq!(
        Scenario::parse("scene", "scene.toml", &format!("expect = 3\n{SCENE}"), &[]).expect_err("a number").problems[0]
            .fault
            .message,
        "this is a number"
    );
}

#[test]
fn the_exit_code_tells_whether_all_holds() {
    let room = Room::new();
    room.write("scene.toml", format!("{SCENE}\n[expect]\nfaults = \"== 0\"\nslave.each.lock_time = {{ is = \"<= 50 ms\", why = \"a short start-up\" }}\n"));
    let page = room.runs(&["run", "scene.toml"]);
    let table: Vec<_> = page.lines().skip_while(|line| !line.starts_with("expectation")).collect();
    assert_eq!(
        table[0].split_whitespace().collect::<Vec<_>>(),
        ["expectation", "expected", "measured", "margin", "verdict"]
    );
    let cells = |line: &str| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(cells(table[1]), ["faults", "==", "0", "0", "-", "pass"]);
    assert_eq!(cells(table[2])[..9], ["slave.each.lock_time", "<=", "50", "ms", "32", "ms", "at", "slave", "3"]);
    assert_eq!(cells(table[2])[9..], ["18", "ms", "(36.0", "%)", "pass"]);
    assert_eq!(table[3], "all 2 expectations hold");

    let strict = room.call(&["run", "scene.toml", "--set", "expect.slave.each.lock_time=<= 1 ms"]);
    let page = text(&strict.stdout);
    assert_eq!((strict.status.code(), text(&strict.stderr)), (Some(1), ""), "{page}");
    assert!(page.contains("<= 1 ms") && page.contains(" and 2 more") && page.contains("FAIL\n"), "{page}");
    assert!(page.ends_with("1 of 2 expectations FAIL\n"), "{page}");
    assert!(!page.contains("a short start-up"), "the reason was that of another limit");
    let strict = room.call(&["run", "scene.toml", "--set", "expect.retries=== 1", "--set", "expect.faults.0F02=none"]);
    assert!(text(&strict.stdout).ends_with("2 of 4 expectations FAIL\n"), "{}", text(&strict.stdout));

    room.refuses(
        &["run", "scene.toml", "--set", "expect.fault=== 0"],
        r#"
error: --set "expect.fault=== 0": expect.fault: there is no figure "fault"
  help: did you mean "faults"?
"#,
    );
}

/// The summary, verdicts.json and JUnit say the same; the latter two replace what was there.
#[test]
fn other_programs_read_the_verdicts() {
    let room = Room::new();
    room.write("scene.toml", format!("{SCENE}\n[expect]\nlatch_skew.max = \"<= 1 ms\"\nslave.4.faults = {{ is = \"== 3\", why = \"<none> & no more\" }}\n"));
    fs::create_dir(room.path("ci")).expect("a directory");
    room.write("ci/v.json", "old");
    let output = room.call(&["run", "scene.toml", "--seed", "9", "--junit", "ci/j.xml", "--verdicts", "ci/v.json"]);
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(1), ""));
    let read = |name: &str| fs::read_to_string(room.path(name)).expect(name);
    let summary: serde_json::Value = serde_json::from_str(&read("out/scene/summary.json")).expect("JSON");
    let verdicts: serde_json::Value = serde_json::from_str(&read("ci/v.json")).expect("JSON");
    assert_eq!(verdicts[0]["verdicts"], summary["verdicts"]);
    assert_eq!(
        (&verdicts[0]["scenario"], &verdicts[0]["seed"], &verdicts[0]["passed"]),
        (&"scene".into(), &9.into(), &false.into())
    );
    let [skew, faults] = [0, 1].map(|index| &summary["verdicts"][index]);
    assert_eq!(skew["measured"], summary["distributions"]["latch_skew"]["max_ns"]);
    assert_eq!((&skew["unit"], &skew["expected"], &skew["passed"]), (&"ns".into(), &"<= 1 ms".into(), &true.into()));
    let room_left = 1_000_000.0 - skew["measured"].as_f64().expect("a number");
    assert!((skew["margin"].as_f64().expect("a number") - room_left).abs() < 0.001);
    assert!((skew["margin_percent"].as_f64().expect("a number") - room_left / 10_000.0).abs() < 0.001);
    assert_eq!(
        (&faults["measured"], &faults["margin"], &faults["why"]),
        (&0.into(), &(-3.0).into(), &"<none> & no more".into())
    );

    let xml = read("ci/j.xml");
    let document = Document::parse(&xml).expect("XML");
    let suites = document.root_element();
    let suite = suites.children().find(Node::is_element).expect("a suite");
    let attributes = |node: Node<'_, '_>, names: &[&str]| -> Vec<String> {
        names.iter().map(|name| node.attribute(*name).unwrap_or("-").to_owned()).collect()
    };
    assert_eq!(attributes(suites, &["name", "tests", "failures", "errors"]), ["isodp", "2", "1", "0"]);
    assert_eq!(attributes(suite, &["name", "tests", "failures", "time"]), ["scene", "2", "1", "0.150"]);
    let cases: Vec<_> = suite.children().filter(|node| node.has_tag_name("testcase")).collect();
    let names: Vec<_> = cases.iter().map(|case| case.attribute("name").expect("a name")).collect();
    assert_eq!(names, ["latch_skew.max <= 1 ms", "slave.4.faults == 3"]);
    assert!(cases.iter().all(|case| case.attribute("classname") == Some("scene")));
    assert!(cases[0].children().all(|node| !node.has_tag_name("failure")));
    let failure = cases[1].children().find(|node| node.has_tag_name("failure")).expect("a failure");
    assert_eq!(failure.attribute("message"), Some("0, expected == 3"));
    let lines: Vec<_> = failure.text().expect("a text").lines().collect();
    assert_eq!(lines[..3], ["slave.4.faults is 0, expected == 3", "margin -3", "<none> & no more"]);
    let replay = lines[3].strip_prefix("isodp ").expect("a call").split(' ').collect::<Vec<_>>();
    assert_eq!(replay[..4], ["replay", "scene.toml", "--run-set", "run.seed=9"]);
    assert!(room.runs(&replay).contains("cycle "), "it can be called");
}

#[test]
fn several_scenarios_are_told_in_the_order_of_the_files() {
    let room = Room::new();
    room.write("a.toml", format!("{SCENE}\n[expect]\nfaults = \"== 0\"\n"));
    room.write("b.toml", format!("{SCENE}\n[expect]\nfaults = \"== 1\"\nretries = \"== 0\"\n"));
    let output = room.call(&["run", "b.toml", "scene.toml", "a.toml", "--junit", "j.xml"]);
    let page = text(&output.stdout);
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(1), ""), "{page}");
    let table: Vec<_> = page.lines().skip_while(|line| !line.starts_with("scenario ")).collect();
    let cells = |line: &str| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(cells(table[1]), ["b", "0", "2", "1", "FAIL"]);
    assert_eq!(cells(table[2]), ["scene", "0", "0", "0", "-"]);
    assert_eq!(cells(table[3]), ["a", "0", "1", "0", "pass"]);
    assert_eq!(table[4..], ["1 of 3 scenarios FAIL"]);
    let xml = fs::read_to_string(room.path("j.xml")).expect("a file");
    let document = Document::parse(&xml).expect("XML");
    let suites: Vec<_> = document.descendants().filter(|node| node.has_tag_name("testsuite")).collect();
    assert_eq!(
        suites.iter().map(|suite| suite.attribute("name").expect("a name")).collect::<Vec<_>>(),
        ["b", "scene", "a"]
    );
    let ran = suites[1].descendants().find(|node| node.has_tag_name("testcase")).expect("a case");
    assert_eq!(ran.attribute("name"), Some("it runs"));
    // Alone each leaves the same files.
    let together = fs::read(room.path("out/b/summary.json")).expect("a summary");
    room.call(&["run", "b.toml"]);
    assert_eq!(together, fs::read(room.path("out/b/summary.json")).expect("a summary"));
    assert_eq!(room.call(&["run", "a.toml", "scene.toml"]).status.code(), Some(0));
}

#[test]
fn several_scenarios_are_read_before_the_first_one_runs() {
    let room = Room::new();
    room.write("bad.toml", SCENE.replace("seed", "sed"));
    fs::create_dir(room.path("more")).expect("a directory");
    room.write("more/scene.toml", SCENE);
    room.refuses(
        &["run", "scene.toml", "bad.toml", "none.toml", "more/scene.toml"],
        r#"
error: bad.toml:3:1: run.sed: there is no such key
  3 | sed = 3
    | ^^^
  help: did you mean "seed"?

none.toml: there is no such file

more/scene.toml: scene.toml has the same name
  rule: the results of NAME.toml go to a directory NAME
  help: rename one, or run them one after the other
"#,
    );
}

#[test]
fn figures_are_listed() {
    let room = Room::new();
    let all = room.runs(&["figures"]);
    for name in ["slave.<addr>.lock_time", "faults.<code>", "slave.<addr>.pll_error.<statistic>", "magnitude_p99 "] {
        assert!(all.contains(name), "{name} in\n{all}");
    }
    let own = room.runs(&["figures", "scene.toml"]);
    for name in ["latch_skew.p99.9", "slave.4.faults.0F02", "link.3-5.age.max", "acyclic.class2.response.max"] {
        assert!(own.lines().any(|line| line.split_whitespace().next() == Some(name)), "{name} in\n{own}");
    }
    assert!(!own.contains("slave.6.") && !own.contains("synch_delay"), "{own}");
    room.refuses(&["figures", "none.toml"], "error: none.toml: there is no such file");
}
