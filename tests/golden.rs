//! Golden files: what each shipped scenario comes to, in lines that a person can judge and four fingerprints that a
//! machine can. `ISODP_BLESS=1 cargo test golden` writes them.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::mem::{Discriminant, discriminant};
use std::path::{Path, PathBuf};
use std::{env, fs};

use isodp::observation::Observation;
use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::NearQueue;
use isodp::study::report;
use isodp::study::row::EventRow;
use isodp::study::run::run;
use isodp::study::scenario::Scenario;
use isodp::time::Time;

use crate::support::{Run, scenario, shipped};

const BLESS: &str = "ISODP_BLESS=1 cargo test golden";

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(format!("{name}.txt"))
}

/// The question, the page that a user sees, and the events by kind.
fn portrait(scenario: &Scenario) -> String {
    let summary = run::<NearQueue<NetworkEvent>>(scenario, None, |_| ()).expect("a run without files").summary;
    let question = scenario.question.lines().take_while(|line| !line.is_empty());
    let mut text: String = question.take(1).flat_map(|line| ["# ", line, "\n"]).collect();
    // Files are named from here on, wherever this is.
    text += &report::render(&summary, None).replace(concat!(env!("CARGO_MANIFEST_DIR"), "/"), "");
    text += "\nevents: first and last [ms], how often, an example\n";
    for kind in kinds(&Run::of(scenario).events) {
        let ms = |at: Time| at.since_zero().as_ms();
        let EventRow { station, what, .. } = kind.first;
        let _ = writeln!(
            text,
            "{:>12.3} {:>12.3} {:>6} x  {station:>3}: {what}",
            ms(kind.first.at),
            ms(kind.last),
            kind.count
        );
    }
    text
}

/// Events of one kind.
struct Kind {
    of: (Discriminant<Observation>, Option<u16>),
    first: EventRow,
    last: Time,
    count: u64,
}

/// The events by kind, each fault a kind of its own, in the order of their first occurrence.
fn kinds(events: &[EventRow]) -> Vec<Kind> {
    let mut kinds: Vec<Kind> = Vec::new();
    for event in events {
        let code = if let Observation::Fault { code } = event.what { Some(code) } else { None };
        let of = (discriminant(&event.what), code);
        match kinds.iter_mut().find(|known| known.of == of) {
            Some(known) => (known.last, known.count) = (event.at, known.count + 1),
            None => kinds.push(Kind { of, first: *event, last: event.at, count: 1 }),
        }
    }
    kinds
}

/// The first line in which two texts differ, both ways.
fn difference(golden: &str, now: &str) -> String {
    let (mut golden, mut now) = (golden.lines(), now.lines());
    for line in 1.. {
        match (golden.next(), now.next()) {
            (None, None) => break,
            (before, after) if before != after => {
                let [before, after] = [before, after].map(|line| line.unwrap_or("(no more lines)"));
                return format!("line {line}\n  was: {before}\n  now: {after}");
            }
            _ => {}
        }
    }
    "the ends of lines".to_owned()
}

#[test]
fn every_scenario_comes_to_what_its_golden_file_says() {
    let bless = env::var_os("ISODP_BLESS").is_some();
    let mut wrong = String::new();
    for name in shipped() {
        let (path, now) = (path(&name), portrait(&scenario(&name, &[])));
        if bless {
            fs::create_dir_all(path.parent().expect("a directory")).expect("a directory");
            fs::write(&path, now).expect("a file");
            continue;
        }
        let _ = match fs::read_to_string(&path) {
            Err(_) => writeln!(wrong, "{name}: there is no tests/golden/{name}.txt; {BLESS} writes it"),
            Ok(golden) if golden != now => {
                writeln!(wrong, "{name}: {}\n{BLESS} takes it over, if it is meant", difference(&golden, &now))
            }
            Ok(_) => Ok(()),
        };
    }
    assert!(wrong.is_empty(), "\n{wrong}");
}

#[test]
fn every_golden_file_has_its_scenario() {
    let Ok(files) = fs::read_dir(path("x").parent().expect("a directory")) else { return };
    let golden: BTreeSet<_> =
        files.map(|file| file.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    let known: BTreeSet<_> = shipped().into_iter().map(|name| format!("{name}.txt")).collect();
    assert_eq!(golden.difference(&known).collect::<Vec<_>>(), Vec::<&String>::new(), "golden files without scenario");
}

#[test]
fn a_difference_is_told_by_its_first_line() {
    assert_eq!(difference("a\nb\nc\n", "a\nx\nc\n"), "line 2\n  was: b\n  now: x");
    assert_eq!(difference("a\n", "a\nb\n"), "line 2\n  was: (no more lines)\n  now: b");
}
