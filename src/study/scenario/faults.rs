//! Tests: what good files become, and what each mistake in a file is answered with.

use super::*;
use crate::sim::motion::Angle;
use crate::study::quantity;
use crate::time::{BitRate, Time};
use proptest::prelude::*;

/// A scenario with every table.
const GOOD: &str = r#"# Does a clock lost every 100 cycles trip 0F04?
# Expected: no. Source: Model: D15.

[run]
seed = 7
duration = "20 s"

[bus]
rate = "12 Mbit/s"
cable = "100 m"

[master]
address = 2
t_dp = "4 ms"
t_i = "125 us"
t_o = "2 ms"
gc_jitter = { kind = "bounded-normal", sigma = "100 ns", bound = "400 ns" }

[[slave]]
addresses = "3..5"
device = "posital-ocd-dpb1b"
crystal = { within = "50 ppm" }
motion = { kind = "speed", speed = "1500 rpm" }

[[slave]]
address = 11
device = "subscriber-drive"
position = "10 m"
t_sdr = "40 tbit"

[[link]]
publisher = 3
subscriber = 11

[[event]]
at = "1 s"
do = "hold-life-sign"
slave = 3
for = 2

[[disturbance]]
kind = "missing-clocks"
from_cycle = 1000
every = 100

[record]
links_csv = false
"#;

fn address(number: u8) -> Address {
    Address::new(number).unwrap()
}
fn parse(text: &str, sets: &[(&str, &str)]) -> Result<Scenario, ScenarioError> {
    let sets: Vec<_> = sets.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
    Scenario::parse("good", "good.toml", text, &sets)
}
fn good(sets: &[(&str, &str)]) -> Scenario {
    parse(GOOD, sets).unwrap_or_else(|error| panic!("{error}"))
}
/// What is said of the good file after `from` became `to`.
fn said(from: &str, to: &str) -> String {
    assert_eq!(GOOD.matches(from).count(), 1, "{from}");
    match parse(&GOOD.replace(from, to), &[]) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("nothing is said of {to}"),
    }
}
/// What is said of the good file with this override.
fn said_of_set(key: &str, value: &str) -> String {
    match parse(GOOD, &[(key, value)]) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("nothing is said of {key}={value}"),
    }
}

#[test]
fn print_all() {
    for (from, to) in [
        ("t_o = \"2 ms\"", "t_o = \"0.5 ms\""),
        ("t_o = \"2 ms\"", "t_o = \"3.875 ms\""),
        ("t_o = \"2 ms\"", "t_o = \"0.6 ms\""),
        ("t_o = \"2 ms\"", "t_0 = \"2 ms\""),
        ("t_o = \"2 ms\"", "t_o = 2"),
        ("t_o = \"2 ms\"", "t_o = \"0.1 ns\""),
        ("t_o = \"2 ms\"\n", ""),
        ("t_i = \"125 us\"", "t_i = \"0 us\""),
        ("t_dp = \"4 ms\"", "t_dp = \"64 ms\""),
        ("t_dp = \"4 ms\"", "t_dp = \"500 us\""),
        ("t_dp = \"4 ms\"", "t_dp = \"1 us\""),
        ("posital-ocd-dpb1b", "posital-ocd-dpb1"),
        ("posital-ocd-dpb1b", "x"),
        ("3..5", "3..2"),
        ("3..5", "3..12"),
        ("3..5", "2..5"),
        ("within = \"50 ppm\"", "within = \"500 ppm\""),
        ("1500 rpm", "1500 rp"),
        ("1500 rpm", "150000 rpm"),
        ("\"speed\"", "\"spin\""),
        ("12 Mbit/s", "500 kbit/s"),
        ("12 Mbit/s", "10 Mbit/s"),
        ("cable = \"100 m\"", "cable = \"20 km\""),
        ("cable = \"100 m\"", "cable = \"9 m\""),
        ("[[link]]", "[[lnk]]"),
        ("[[link]]", "[link]"),
        ("publisher = 3", "publisher = 11"),
        ("publisher = 3", "publisher = 9"),
        ("subscriber = 11", "subscriber = 4"),
        ("subscriber = 11", "subscriber = 11\noffset = 10"),
        ("hold-life-sign", "hold-live-sign"),
        ("slave = 3\n", "slave = 9\n"),
        ("at = \"1 s\"", "at = \"30 s\""),
        ("at = \"1 s\"", ""),
        ("seed = 7", "seed = -7"),
        ("seed = 7", "seed = 7\ncycles = 5"),
        ("seed = 7", "seed = "),
        ("40 tbit", "900 tbit"),
        ("400 ns", "2 ms"),
        ("400 ns", "1 ns"),
        ("every = 100", "every = 0"),
        ("position = \"10 m\"", "position = \"10 m\"\nt_pll_w = \"100 ns\""),
        ("position = \"10 m\"", "position = \"10 m\"\nt_pll_w = \"100 us\""),
        ("position = \"10 m\"", "position = \"10 m\"\nscaling = { units_per_rev = 9000, total_range = 1 }"),
        (
            "position = \"10 m\"",
            "position = \"10 m\"\nt_i=\"375 us\"\nscaling = { units_per_rev = 100, total_range = 500000 }",
        ),
        ("position = \"10 m\"", "position = \"10 m\"\ncode_sequence = \"ccw\""),
        ("duration = \"20 s\"", "duration = \"0 s\""),
        ("duration = \"20 s\"", "cycles = 1000000000000"),
    ] {
        println!("--- {from} -> {to}\n{}\n", said(from, to));
    }
    for (key, value) in [
        ("master.t_o", "0.5 ms"),
        ("slave.3.crystal", "20 pmp"),
        ("slave.9.crystal", "2 ppm"),
        ("master.x", "1"),
        ("foo", "1"),
        ("link.2.length", "1"),
        ("master.watchdog", "2570 ms"),
        ("master.watchdog", "0 ms"),
        ("bus.t_sl", "100 tbit"),
        ("bus.max_tsdr", "100 tbit"),
        ("bus.hsa", "10"),
        ("record", "5"),
    ] {
        println!("--- {key}={value}\n{}\n", said_of_set(key, value));
    }
}
