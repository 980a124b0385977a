//! `isodp disturbances`: every disturbance with its keys and an example that runs, and everything about one.

use assert_cmd::Command;
use isodp::observation::Observation;
use isodp::study::scenario::Scenario;
use isodp::study::scenario::disturbance::which::SERVICES;
use isodp::study::scenario::disturbance::{COMMON, DISTURBANCES};

use crate::support::Run;

/// Two masters, two encoders, and a reader of parameters.
pub(crate) const NETWORK: &str = r#"
[run]
duration = "1200 ms"

[bus]
rate = "12 Mbit/s"
cable = "100 m"
hsa = 15
t_tr = "21000 tbit"

[master]
address = 2
t_dp = "1 ms"
t_i = "125 us"
t_o = "500 us"
t_pll_w = "1 us"

[[class1]]
address = 5

[[slave]]
addresses = "3..4"
device = "posital-ocd-dpb1b"

[[slave]]
address = 10
master = 5
device = "posital-ocd-dpb1b"
"#;

/// Exit code, standard output and standard error of `isodp disturbances` with `args`.
fn disturbances(args: &[&str]) -> (Option<i32>, String, String) {
    let output =
        Command::cargo_bin("isodp").expect("the binary").arg("disturbances").args(args).output().expect("a run");
    let text = |octets: Vec<u8>| String::from_utf8(octets).expect("text");
    (output.status.code(), text(output.stdout), text(output.stderr))
}
fn parse(disturbance: &str) -> Scenario {
    let text = format!("{disturbance}\n{NETWORK}");
    Scenario::parse("example", "example.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_list_has_every_disturbance_with_every_key_its_unit_and_its_default() {
    let (code, list, errors) = disturbances(&[]);
    assert_eq!((code, errors.as_str()), (Some(0), ""));
    let mut sections = list.split("\n\n");
    let of_all = sections.next().expect("the keys of every disturbance");
    let has = |text: &str, key: &isodp::study::scenario::disturbance::Key| {
        text.lines().any(|line| {
            line.trim_start().starts_with(key.name)
                && [key.unit, key.default, key.what].iter().all(|part| line.contains(part))
        })
    };
    assert!(COMMON.iter().all(|key| has(of_all, key)), "{of_all}");
    for (kind, section) in DISTURBANCES.iter().zip(sections) {
        assert!(section.starts_with(&format!("{}: {}\n", kind.name, kind.what)), "{section}");
        assert!(kind.keys.iter().all(|key| has(section, key)), "{section}");
        assert!(section.ends_with(&format!("  example: disturbance = [{{ {} }}]", kind.example)), "{section}");
    }
    for service in SERVICES {
        assert!(list.contains(&format!("  {}", service.name)) && list.contains(service.what), "{list}");
    }
    assert!(list.lines().all(|line| line.chars().count() <= 140), "{list}");
}

#[test]
fn one_disturbance_is_told_alone() {
    for kind in DISTURBANCES {
        let (code, page, _) = disturbances(&[kind.name]);
        assert_eq!(code, Some(0));
        assert!(page.starts_with(&format!("{}: ", kind.name)) && page.contains("every disturbance: "), "{page}");
        let others = DISTURBANCES.iter().filter(|other| other.name != kind.name);
        assert!(others.into_iter().all(|other| !page.contains(&format!("\n{}: ", other.name))), "{page}");
    }
    let (code, page, errors) = disturbances(&["lost-telegram"]);
    assert_eq!((code, page.as_str()), (Some(2), ""));
    assert_eq!(errors, "error: there is no disturbance \"lost-telegram\"; did you mean \"lost-telegrams\"?\n");
}

/// The same network in two halls with a repeater between them, its masters in the first one.
fn in_halls(disturbance: &str) -> Scenario {
    let halls = "hsa = 15\nt_tr = \"21000 tbit\"\n[[segment]]\nname = \"hall 1\"\ncable = \"50 m\"\n\
                 [[segment]]\nname = \"hall 2\"\ncable = \"50 m\"\n\
                 [[repeater]]\nfrom = \"hall 1\"\nto = \"hall 2\"\n";
    let text = NETWORK.replace("cable = \"100 m\"\nhsa = 15\nt_tr = \"21000 tbit\"\n", halls);
    let text = text.replace("address = 2\n", "address = 2\nsegment = \"hall 1\"\n");
    let text = text.replace("address = 5\n", "address = 5\nsegment = \"hall 1\"\n");
    let text = format!("{disturbance}\n{}", text.replace("\ndevice =", "\nsegment = \"hall 2\"\ndevice ="));
    Scenario::parse("example", "example.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn every_example_runs_and_does_something() {
    let clean = [parse, in_halls].map(|network| Run::of(&network("")).fingerprint);
    for kind in DISTURBANCES {
        let example = format!("disturbance = [{{ {} }}]", kind.example);
        let needs_halls = kind.keys.iter().any(|key| key.name == "repeater");
        let network = if needs_halls { in_halls } else { parse };
        let run = Run::of(&network(&example));
        assert_ne!(run.fingerprint, clean[usize::from(needs_halls)], "{}", kind.name);
    }
}

#[test]
fn every_service_is_found_on_the_line() {
    for service in SERVICES {
        let alone = matches!(service.name, "acyclic" | "global-control");
        let text = format!("disturbance = [{{ kind = \"lost-telegrams\", service = \"{}\" }}]", service.name);
        let run = Run::of(&parse(&text));
        let lost = run.observations.iter().filter(|(_, _, seen)| matches!(seen, Observation::Disturbed { .. })).count();
        assert!(alone || lost > 0, "{}", service.name);
    }
}
