//! `isodp devices`: every device with what a network plan needs, and everything about one.

use assert_cmd::Command;
use isodp::device::parameters::PARAMETERS;
use isodp::device::profile::PROFILES;

/// Exit code, standard output and standard error of `isodp devices` with `args`.
fn devices(args: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::cargo_bin("isodp").expect("the binary").arg("devices").args(args).output().expect("a run");
    let text = |octets: Vec<u8>| String::from_utf8(octets).expect("text");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn the_list_has_every_device_in_aligned_columns() {
    let (code, list, errors) = devices(&[]);
    assert_eq!((code, errors.as_str()), (Some(0), ""));
    for profile in PROFILES {
        assert!(list.contains(&*profile.title), "{list}");
        assert_eq!(list.lines().filter(|line| line.starts_with(&*profile.name)).count(), 3, "{list}");
    }
    let header = list.lines().next().expect("a header");
    let column = header.find("ident").expect("a column");
    for (line, profile) in list.lines().skip(1).zip(PROFILES) {
        assert_eq!(line[column..].split_whitespace().next(), Some(&*format!("{:04X}", profile.ident)), "{list}");
    }
    assert!(list.contains("simodrive-sensor-isochron   80F9"), "{list}");
    assert!(list.lines().all(|line| line.len() <= 132), "{list}");
}

#[test]
fn one_device_is_told_in_full() {
    for profile in PROFILES {
        let (code, all, _) = devices(&[&profile.name]);
        assert_eq!(code, Some(0));
        assert!(
            all.starts_with(&format!("{}: {}\n", profile.name, profile.title)) && all.contains(&*profile.source),
            "{all}"
        );
        for parameter in PARAMETERS {
            assert_eq!(all.contains(&format!("P{}", parameter.pnu)), !profile.subscriber, "{all}");
        }
    }
    let (_, all, _) = devices(&["simodrive-sensor-isochron"]);
    for line in [
        "Ident_Number         80F9",
        "Chk_Cfg octets       C3 C1 C5 FD 00 51",
        "T_DP                 500 us to 32 ms in steps of 125 us",
        "T_I                  125 us or more, 375 us with octet 15 bit 1",
        "T_PLL_W              up to 20 us; less than 1 us counts as this",
        "resolution           8192 steps in a revolution, 4096 revolutions",
        "watchdog             in steps of 10 ms or 1 ms",
        "MS1                  records of up to 240 octets, answered within 10 s",
        "MS2                  2 connections at a time, records of up to 240 octets, answered within 10 s",
        "P979[3]    shift factor of G1_XIST1",
    ] {
        assert!(all.lines().any(|each| each.split_whitespace().eq(line.split_whitespace())), "{line}\n{all}");
    }
}

#[test]
fn a_device_that_does_not_exist_is_an_error_with_help() {
    let (code, list, errors) = devices(&["posital-ocd-dpb1"]);
    assert_eq!((code, list.as_str()), (Some(2), ""));
    assert_eq!(errors, "error: there is no device \"posital-ocd-dpb1\"; did you mean \"posital-ocd-dpb1b\"?\n");
}
