//! Tests: what good files become, and what each mistake in a file is answered with.

use super::*;
use crate::sim::fault::manner::Manner;
use crate::sim::motion::Angle;
use crate::study::scenario::disturbance::DISTURBANCES;
use crate::time::BitRate;
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
cycle = 1000
for = 1
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
/// Compares what is said of the good file after each change with what should be.
fn check(cases: &[(&str, &str, &str)]) {
    for (from, to, expected) in cases {
        assert_eq!(said(from, to), expected.trim(), "{from} -> {to}");
    }
}
/// Compares what is said of the good file with each override with what should be.
fn check_sets(cases: &[(&str, &str, &str)]) {
    for (key, value, expected) in cases {
        assert_eq!(said_of_set(key, value), expected.trim(), "{key}={value}");
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
fn keys_that_are_wrong() {
    check(&[
        (
            "t_o = \"2 ms\"",
            "t_0 = \"2 ms\"",
            r#"
good.toml:12:2: master.t_o: this key is missing, and slave 3 has no own t_o
  12 | [master]
     |  ^^^^^^
  rule: every slave has its T_O (manual 3.3)
  help: for example: t_o = "1 ms"

good.toml:16:1: master.t_0: there is no such key
  16 | t_0 = "2 ms"
     | ^^^
  help: did you mean "t_o"?
"#,
        ),
        (
            "t_o = \"2 ms\"\n",
            "",
            r#"
good.toml:12:2: master.t_o: this key is missing, and slave 3 has no own t_o
  12 | [master]
     |  ^^^^^^
  rule: every slave has its T_O (manual 3.3)
  help: for example: t_o = "1 ms"
"#,
        ),
        (
            "t_o = \"2 ms\"",
            "t_o = 2",
            r#"
good.toml:16:7: master.t_o: this is a number
  16 | t_o = 2
     |       ^
  help: write a number with its unit in quotation marks, such as "125 us"
"#,
        ),
        (
            "t_o = \"2 ms\"",
            "t_o = \"0.1 ns\"",
            r#"
good.toml:16:7: master.t_o: "0.1 ns" is not a whole number of ticks of 1/12 ns; its neighbours are "1 tick" and "2 tick"
  16 | t_o = "0.1 ns"
     |       ^^^^^^^^
"#,
        ),
        (
            "posital-ocd-dpb1b",
            "posital-ocd-dpb1",
            r#"
good.toml:21:10: slave.3.device: there is no device "posital-ocd-dpb1"
  21 | device = "posital-ocd-dpb1"
     |          ^^^^^^^^^^^^^^^^^^
  help: did you mean "posital-ocd-dpb1b"?
"#,
        ),
    ]);
}

#[test]
fn words_and_tables_that_are_wrong() {
    check(&[
        (
            "\"speed\"",
            "\"spin\"",
            r#"
good.toml:23:19: slave.3.motion.kind: there is no motion "spin"
  23 | motion = { kind = "spin", speed = "1500 rpm" }
     |                   ^^^^^^
  help: known here: standstill, speed, sine, table
"#,
        ),
        (
            "seed = 7",
            "seed = -7",
            r"
good.toml:5:8: run.seed: -7 is out of range
  5 | seed = -7
    |        ^^
  help: a whole number from 0 to 18446744073709551615
",
        ),
        (
            "seed = 7",
            "seed 7",
            r"
good.toml:5:6: key with no value, expected `=`
  5 | seed 7
    |      ^
  rule: the file is TOML 1.0 (toml.io)
",
        ),
        (
            "seed = 7",
            "seed = 7\ncycles = 5",
            r#"
good.toml:4:2: run: a run has either duration or cycles
  4 | [run]
    |  ^^^
  help: for example: duration = "20 s", or cycles = 10000
"#,
        ),
        (
            "[[link]]",
            "[[lnk]]",
            r#"
good.toml:31:3: lnk: there is no such table
  31 | [[lnk]]
     |   ^^^
  help: did you mean "link"?
"#,
        ),
    ]);
}

#[test]
fn stations_that_cannot_be() {
    check(&[
        (
            "3..5",
            "3..12",
            r"
good.toml:26:11: slave.address: two slaves have the address 11
  26 | address = 11
     |           ^^
  rule: every station of a bus has an address of its own (EN 50170-2)
",
        ),
        (
            "3..5",
            "2..5",
            r#"
good.toml:20:13: slave.2.address: the master and a slave have the address 2
  20 | addresses = "2..5"
     |             ^^^^^^
  rule: every station of a bus has an address of its own (EN 50170-2)
"#,
        ),
        (
            "3..5",
            "5..3",
            r#"
good.toml:20:13: slave.addresses: "5..3" is no address and no range of addresses
  20 | addresses = "5..3"
     |             ^^^^^^
  help: addresses are 0 to 125; a range is written "3..10" and includes both ends
"#,
        ),
        (
            "within = \"50 ppm\"",
            "within = \"500 ppm\"",
            r#"
good.toml:22:11: slave.3.crystal: a crystal is not off by 500 ppm
  22 | crystal = { within = "500 ppm" }
     |           ^^^^^^^^^^^^^^^^^^^^^^
  rule: a crystal is within 200 ppm (Model: twice what cheap ones have)
  help: "200 ppm" at most
"#,
        ),
        (
            "cable = \"100 m\"",
            "cable = \"9 m\"",
            r#"
good.toml:28:12: slave.11.position: 10 m is beyond the end of the cable
  28 | position = "10 m"
     |            ^^^^^^
  rule: a station is 0 m to 9 m along the cable (Model: one line)
  help: for example under [bus]: cable = "10 m"
"#,
        ),
    ]);
}

#[test]
fn bus_parameters_that_break_a_rule() {
    check(&[
        (
            "12 Mbit/s",
            "500 kbit/s",
            r#"
good.toml:14:8: master.t_dp: T_DP = 4 ms cannot hold the cycle of 4 slaves
  14 | t_dp = "4 ms"
     |        ^^^^^^
  rule: T_DP >= T_DX 4.216 ms + GAP 606 us + token 140 us + Global_Control 360 us = 5.322 ms (manual 3.3.2)
  help: the shortest is t_dp = "5.375 ms"
"#,
        ),
        (
            "12 Mbit/s",
            "10 Mbit/s",
            r#"
good.toml:9:8: bus.rate: "10 Mbit/s" is not a bit rate of PROFIBUS DP; the nearest is "12 Mbit/s"
  9 | rate = "10 Mbit/s"
    |        ^^^^^^^^^^^
"#,
        ),
        (
            "12 Mbit/s",
            "12 Mbit/s\"\nt_sl = \"1200 tbit\"\nt_set = \"120 tbit",
            r#"
good.toml:11:9: bus.t_set: T_ID1 = 284 tbit is more than publisher 3 can be told
  11 | t_set = "120 tbit"
     |         ^^^^^^^^^^
  rule: a publisher's min_TSDR is T_ID1 = 35 + 2 T_SET + T_QUI, at most 255 (Set_Prm octet 4, Model: D27)
  help: t_set = "105 tbit" or less, or no links
"#,
        ),
        (
            "cable = \"100 m\"",
            "cable = \"20 km\"",
            r#"
good.toml:10:9: bus.t_sl: 1000 is not allowed here
  10 | cable = "20 km"
     |         ^^^^^^^
  rule: T_SL >= 2 T_TD + max(max T_SDR, T_ID1) + 11 + T_SM (EN 50170-2)
  help: 3254 to 16383 with the other bus parameters and the cable
"#,
        ),
        (
            "40 tbit",
            "900 tbit",
            r#"
good.toml:29:9: slave.11.t_sdr: 900 tbit is not what this slave may take to answer
  29 | t_sdr = "900 tbit"
     |         ^^^^^^^^^^
  rule: min_tsdr = 11 tbit <= T_SDR <= MaxTsdr = 800 tbit of subscriber-drive (Model: D2)
  help: t_sdr = "800 tbit"
"#,
        ),
    ]);
}

#[test]
fn a_t_dp_that_does_not_work() {
    check(&[
        (
            "t_dp = \"4 ms\"",
            "t_dp = \"64 ms\"",
            r#"
good.toml:14:8: master.t_dp: T_DP = 64 ms is out of the range of posital-ocd-dpb1b
  14 | t_dp = "64 ms"
     |        ^^^^^^^
  rule: T_DP is 500 us to 32 ms (manual 3.3.2)
  help: t_dp = "32 ms"
"#,
        ),
        (
            "t_dp = \"4 ms\"",
            "t_dp = \"4.1 ms\"",
            r#"
good.toml:14:8: master.t_dp: T_DP = 4.1 ms is not on the grid of posital-ocd-dpb1b
  14 | t_dp = "4.1 ms"
     |        ^^^^^^^^
  rule: T_DP is a multiple of T_BASE_DP = 125 us (manual 3.3.1, 3.3.2)
  help: the neighbours are t_dp = "4 ms" and "4.125 ms"
"#,
        ),
        (
            "t_dp = \"4 ms\"",
            "t_dp = \"500 us\"",
            r#"
good.toml:14:8: master.t_dp: T_DP = 500 us cannot hold the cycle of 4 slaves
  14 | t_dp = "500 us"
     |        ^^^^^^^^
  rule: T_DP >= T_DX 478.6 us + GAP 95.167 us + token 9.083 us + Global_Control 18.25 us = 601.1 us (manual 3.3.2)
  help: the shortest is t_dp = "875 us"
"#,
        ),
    ]);
}

#[test]
fn t_i_and_t_o_that_do_not_work() {
    check(&[
        (
            "t_o = \"2 ms\"",
            "t_o = \"0.5 ms\"",
            r#"
good.toml:16:7: slave.3.t_o: T_O = 500 us is too early for slave 3
  16 | t_o = "0.5 ms"
     |       ^^^^^^^^
  rule: T_O > T_DX + T_O_MIN = 478.667 us + 125 us = 603.667 us (manual 3.3.6, Model: D3)
  help: the earliest is t_o = "625 us"
"#,
        ),
        (
            "t_o = \"2 ms\"",
            "t_o = \"2.1 ms\"",
            r#"
good.toml:16:7: slave.3.t_o: T_O = 2.1 ms is not on the grid
  16 | t_o = "2.1 ms"
     |       ^^^^^^^^
  rule: T_O is a multiple of T_BASE_IO = 125 us (manual 3.3.4, 3.3.6)
  help: the neighbours are t_o = "2 ms" and "2.125 ms"
"#,
        ),
        (
            "t_o = \"2 ms\"",
            "t_o = \"3.875 ms\"",
            r#"
good.toml:16:7: slave.3.t_o: T_O = 3.875 ms is only 0 ns before the latch of slave 3
  16 | t_o = "3.875 ms"
     |       ^^^^^^^^^^
  rule: (T_DP - T_I) - T_O >= 125 us with scaling, preset and code sequence off, here (4 ms - 125 us) - 3.875 ms (manual 3.3.5, 3.3.6, Model: D3)
  help: the latest is t_o = "3.75 ms"
"#,
        ),
        (
            "t_dp = \"4 ms\"",
            "t_dp = \"750 us\"",
            r#"
good.toml:16:7: slave.3.t_o: T_O = 2 ms comes after the latch of slave 3
  16 | t_o = "2 ms"
     |       ^^^^^^
  rule: (T_DP - T_I) - T_O >= 125 us with scaling, preset and code sequence off, here (750 us - 125 us) - 2 ms (manual 3.3.5, 3.3.6, Model: D3)
  help: no T_O fits between T_DX and the latch; the shortest is t_dp = "875 us"
"#,
        ),
        (
            "t_i = \"125 us\"",
            "t_i = \"0 us\"",
            r#"
good.toml:15:7: slave.3.t_i: T_I = 0 ns is too short for slave 3
  15 | t_i = "0 us"
     |       ^^^^^^
  rule: T_I >= 125 us with scaling, preset and code sequence off (manual 3.3.5)
  help: the shortest is t_i = "125 us"
"#,
        ),
    ]);
}

#[test]
fn times_of_one_slave_that_do_not_work() {
    check(&[
        (
            "crystal = { within = \"50 ppm\" }",
            "crystal = { within = \"50 ppm\" }\nscaling = { units_per_rev = 100, total_range = 12800 }",
            r#"
good.toml:15:7: slave.3.t_i: T_I = 125 us is too short for slave 3
  15 | t_i = "125 us"
     |       ^^^^^^^^
  rule: T_I >= 375 us with scaling, preset and code sequence on (manual 3.2.2)
  help: the shortest is t_i = "375 us"
"#,
        ),
        (
            "position = \"10 m\"",
            "position = \"10 m\"\nt_pll_w = \"100 ns\"",
            r#"
good.toml:29:11: slave.11.t_pll_w: T_PLL_W = 100 ns is between two steps
  29 | t_pll_w = "100 ns"
     |           ^^^^^^^^
  rule: T_PLL_W is a whole number of 1/12 us (manual 3.3.8)
  help: the neighbours are t_pll_w = "1000 tick" (83.333 ns) and "2000 tick" (166.667 ns)
"#,
        ),
        (
            "position = \"10 m\"",
            "position = \"10 m\"\nt_pll_w = \"100 us\"",
            r#"
good.toml:29:11: slave.11.t_pll_w: T_PLL_W = 100 us is out of range
  29 | t_pll_w = "100 us"
     |           ^^^^^^^^
  rule: T_PLL_W is 83.333 ns to 20 us for subscriber-drive (manual 3.3.8)
  help: t_pll_w = "20 us"
"#,
        ),
    ]);
}

#[test]
fn scaling_that_the_encoder_refuses() {
    check(&[
        (
            "crystal = { within = \"50 ppm\" }",
            "crystal = { within = \"50 ppm\" }\nt_i = \"375 us\"\nscaling = { units_per_rev = 9000, total_range = 12800 }",
            r"
good.toml:24:29: slave.3.scaling.units_per_rev: 9000 units per revolution are out of range
  24 | scaling = { units_per_rev = 9000, total_range = 12800 }
     |                             ^^^^
  rule: 1 to 8192 units, the physical resolution of posital-ocd-dpb1b (manual 3.2.3)
  help: units_per_rev = 8192
",
        ),
        (
            "crystal = { within = \"50 ppm\" }",
            "crystal = { within = \"50 ppm\" }\nt_i = \"375 us\"\nscaling = { units_per_rev = 100, total_range = 500000 }",
            r"
good.toml:24:48: slave.3.scaling.total_range: a total range of 500000 is out of range
  24 | scaling = { units_per_rev = 100, total_range = 500000 }
     |                                                ^^^^^^
  rule: total range <= 100 units per revolution x 4096 revolutions (manual 3.2.4, Model: D20)
  help: total_range = 409600
",
        ),
        (
            "crystal = { within = \"50 ppm\" }",
            "crystal = { within = \"50 ppm\" }\ncode_sequence = \"ccw\"",
            r#"
good.toml:23:17: slave.3.code_sequence: code_sequence = "ccw" has no effect in slave 3
  23 | code_sequence = "ccw"
     |                 ^^^^^
  rule: the code sequence is in force with octet 15 bit 1 alone (manual 3.2.2)
  help: add functions = true, which needs T_I and the gap of 375 us
"#,
        ),
        (
            "crystal = { within = \"50 ppm\" }",
            "crystal = { within = \"50 ppm\" }\nfunctions = false\nscaling = { units_per_rev = 100, total_range = 12800 }",
            r"
good.toml:23:13: slave.3.functions: slave 3 has scaling, but functions = false
  23 | functions = false
     |             ^^^^^
  rule: scaling needs octet 15 bit 1 as well as bit 3 (manual 3.2.2, Model: D21)
  help: leave out functions, or leave out scaling
",
        ),
    ]);
}

#[test]
fn jitter_that_does_not_fit() {
    check(&[
        (
            "bound = \"400 ns\"",
            "bound = \"2 ms\"",
            r#"
good.toml:17:13: master.gc_jitter: jitter of 2 ms (its bound) does not fit into the spare time of 3.399 ms
  17 | gc_jitter = { kind = "bounded-normal", sigma = "100 ns", bound = "2 ms" }
     |             ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
  rule: 2 x 2 ms <= T_DP 4 ms - cycle 601.1 us (Model: D1, D6)
  help: at most 1.699 ms, or a longer t_dp
"#,
        ),
        (
            "bound = \"400 ns\"",
            "bound = \"1 ns\"",
            r#"
good.toml:17:13: master.gc_jitter: bound = 1 ns is less than a quarter of sigma = 100 ns; uniform jitter is nearly the same
  17 | gc_jitter = { kind = "bounded-normal", sigma = "100 ns", bound = "1 ns" }
     |             ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
"#,
        ),
    ]);
}

#[test]
fn links_that_cannot_be() {
    check(&[
        (
            "publisher = 3",
            "publisher = 11",
            r"
good.toml:32:13: link.1.publisher: slave 11 cannot publish
  32 | publisher = 11
     |             ^^
  rule: subscriber-drive has no publisher function (its profile, manual 3.4)
",
        ),
        (
            "publisher = 3",
            "publisher = 9",
            r"
good.toml:32:13: link.1.publisher: there is no slave 9
  32 | publisher = 9
     |             ^
  help: the slaves are 3, 4, 5, 11
",
        ),
        (
            "subscriber = 11",
            "subscriber = 4",
            r"
good.toml:33:14: link.1.subscriber: slave 4 cannot subscribe
  33 | subscriber = 4
     |              ^
  rule: posital-ocd-dpb1b has no subscriber function (its profile, manual 3.4)
  help: subscriber-drive can
",
        ),
        (
            "subscriber = 11",
            "subscriber = 11\noffset = 10",
            r"
good.toml:34:10: link.1.length: a sample of 4 octets from octet 10 on is not in the publisher's data
  34 | offset = 10
     |          ^^
  rule: length >= 1 and offset 10 + length 4 <= 12 octets of posital-ocd-dpb1b (DXB link table)
  help: offset = 4, length = 4 is G1_XIST1 of telegram 81
",
        ),
        (
            "subscriber = 11",
            "subscriber = 11\n\n[[link]]\npublisher = 3\nsubscriber = 11\noffset = 8",
            r"
good.toml:37:14: link.2.subscriber: slave 11 has this publisher already
  37 | subscriber = 11
     |              ^^
  rule: one link per publisher, subscriber and table (Model: D26 counts latencies by the pair)
  help: one link with both: samples = [{ offset = 4, length = 4 }, { offset = 0, length = 2 }]
",
        ),
    ]);
}

#[test]
fn events_and_disturbances_that_cannot_be() {
    check(&[
        (
            "hold-life-sign",
            "hold-live-sign",
            r#"
good.toml:37:6: event.1.do: there is no action "hold-live-sign"
  37 | do = "hold-live-sign"
     |      ^^^^^^^^^^^^^^^^
  help: did you mean "hold-life-sign"?
"#,
        ),
        (
            "slave = 3\n",
            "slave = 9\n",
            r"
good.toml:38:9: event.1.slave: there is no slave 9
  38 | slave = 9
     |         ^
  help: the slaves are 3, 4, 5, 11
",
        ),
        (
            "at = \"1 s\"",
            "at = \"30 s\"",
            r#"
good.toml:36:6: event.1.at: the run is over before this event
  36 | at = "30 s"
     |      ^^^^^^
  help: a longer run, or an earlier event
"#,
        ),
        (
            "every = 100",
            "every = 0",
            r"
good.toml:45:9: disturbance.1.every: 0 is out of range
  45 | every = 0
     |         ^
  help: a whole number from 1 to 9223372036854775807
",
        ),
    ]);
}

#[test]
fn overrides_that_cannot_be() {
    check_sets(&[
        (
            "master.t_o",
            "0.5 ms",
            r#"
--set "master.t_o=0.5 ms": slave.3.t_o: T_O = 500 us is too early for slave 3
  rule: T_O > T_DX + T_O_MIN = 478.667 us + 125 us = 603.667 us (manual 3.3.6, Model: D3)
  help: the earliest is t_o = "625 us"
"#,
        ),
        (
            "slave.3.crystal",
            "20 pmp",
            r#"
--set "slave.3.crystal=20 pmp": slave.3.crystal: "20 pmp" has the unit "pmp"; a deviation of a frequency has one of the units ppm, ppb
"#,
        ),
        (
            "slave.9.crystal",
            "2 ppm",
            r#"
--set "slave.9.crystal=2 ppm": slave.9.crystal: no slave has the address "9"
  help: the slaves are 3, 4, 5, 11
"#,
        ),
        (
            "master.t_ox",
            "1 ms",
            r#"
--set "master.t_ox=1 ms": master.t_ox: there is no such key
  help: did you mean "t_o"?
"#,
        ),
    ]);
}

#[test]
fn overrides_of_the_bus_and_of_what_is_not_there() {
    check_sets(&[
        (
            "bus.t_sl",
            "100 tbit",
            r#"
--set "bus.t_sl=100 tbit": bus.t_sl: 100 is not allowed here
  rule: T_SL >= 2 T_TD + max(max T_SDR, T_ID1) + 11 + T_SM (EN 50170-2)
  help: 866 to 16383 with the other bus parameters and the cable
"#,
        ),
        (
            "bus.max_tsdr",
            "100 tbit",
            r#"
--set "bus.max_tsdr=100 tbit": bus.max_tsdr: 100 tbit is too short for slave 11
  rule: subscriber-drive may take MaxTsdr = 800 tbit at 12 Mbit/s (Model: D2)
  help: max_tsdr = "800 tbit" or more
"#,
        ),
        (
            "bus.hsa",
            "10",
            r"
good.toml:26:11: slave.11.address: the address 11 is above hsa = 10
  26 | address = 11
     |           ^^
  rule: no station is above the highest station address HSA (EN 50170-2)
  help: hsa = 11 or more, at most 126
",
        ),
        (
            "link.2.length",
            "1",
            r#"
--set "link.2.length=1": link.2.length: there is no [[link]] number "2"
  help: the first is 1
"#,
        ),
        (
            "record",
            "5",
            r#"
--set "record=5": record: an override names a table and a key
  help: for example master.t_dp=2 ms, slave.3.crystal=20 ppm, link.1.length=2
"#,
        ),
        (
            "mastr.t_o",
            "1 ms",
            r#"
--set "mastr.t_o=1 ms": mastr.t_o: there is no such table
  help: did you mean "master"?
"#,
        ),
    ]);
}

#[test]
fn overrides_that_break_a_rule() {
    check_sets(&[
        (
            "master.watchdog",
            "2570 ms",
            r#"
--set "master.watchdog=2570 ms": master.watchdog: no watchdog runs for 2.57 s
  rule: a watchdog is 10 ms x WD_Fact_1 x WD_Fact_2 with factors from 1 to 255 (Set_Prm octets 2 and 3), or 1 ms x both with WD_Base_1ms_supp (octet 8)
  help: the nearest are "2.56 s" and "2.58 s", and "0 ms" is off
"#,
        ),
        (
            "master.watchdog",
            "0 ms",
            r#"
--set "master.watchdog=0 ms": master.watchdog: links need the watchdog
  rule: a subscriber watches its links for the watchdog time (VPC3+ manual, Model: D27)
  help: watchdog = "200 ms"
"#,
        ),
        (
            "master.t_mapc",
            "15",
            r#"
--set "master.t_mapc=15": master.t_mapc: T_MAPC = 15 x T_DP is out of range
  rule: T_MAPC is 1 to 14 x T_DP (manual 3.3.3, octet 43)
  help: t_mapc = 14
"#,
        ),
        (
            "run.duration",
            "0 s",
            r#"
--set "run.duration=0 s": run.duration: a run of no time shows nothing
"#,
        ),
        (
            "run.cycles",
            "1000000000000",
            r#"
--set "run.cycles=1000000000000": run.cycles: 1000000000000 cycles of 4 ms are too long
  rule: a run ends within 24 years (Model: range of time)
  help: cycles = 189216000000 at most
"#,
        ),
    ]);
}

#[test]
fn rules_without_a_place_of_their_own() {
    let said = |sets: &[(&str, &str)]| parse(GOOD, sets).map_or_else(|error| error.to_string(), |_| String::new());
    let text = said(&[("master.t_dp", "16 ms"), ("master.watchdog", "10 ms")]);
    assert!(text.contains("a watchdog of 10 ms runs out in every cycle"), "{text}");
    let text = said(&[("master.gc_jitter.kind", "normal"), ("master.gc_jitter.sigma", "1 ms")]);
    assert!(text.contains("did you mean") || text.contains("there is no such key"), "{text}");
    let text = said(&[("slave.11.t_pll_d", "6 ms")]);
    assert!(text.contains("T_PLL_D = 6 ms is out of range"), "{text}");
    let text = said(&[("master.t_i", "200000 h")]);
    assert!(text.contains("master.t_i: 720000000 s is longer than any bus cycle"), "{text}");
    let text = said(&[("slave.3.powered_at", "212000 h")]);
    assert!(text.contains("slave.3.powered_at: \"212000 h\" is after the end of every run"), "{text}");
    let text = said(&[("slave.11.t_i", "200 us")]);
    assert!(text.contains("the neighbours are t_i = \"125 us\" and \"250 us\""), "{text}");
    let text = said(&[("disturbance.1.kind", "lost-telegrams"), ("disturbance.1.to", "99")]);
    assert!(text.contains("disturbance.1.to: there is no slave 99"), "{text}");
    let text = said(&[("slave.11.scaling.units_per_rev", "8"), ("slave.11.scaling.total_range", "8")]);
    assert!(text.contains("slave.11.scaling: subscriber-drive has no scaling"), "{text}");
    let text = said(&[("slave.3.silent", "true")]);
    assert!(text.contains("link.1.publisher: slave 3 is silent"), "{text}");
    let text = said(&[("event.1.cycle", "5001")]);
    assert!(text.contains("event.1.cycle: the run is over before this event"), "{text}");
}

/// The good file with these lines behind its link.
fn linked(lines: &str) -> Result<Scenario, ScenarioError> {
    parse(&GOOD.replace("subscriber = 11", &format!("subscriber = 11\n{lines}")), &[])
}

#[test]
fn samples_tables_and_places_of_links() {
    let samples = "samples = [{ offset = 4, length = 4 }, { offset = 0, length = 2 }]";
    let found = linked(samples).unwrap_or_else(|error| panic!("{error}")).links[0].clone();
    let sample = |offset, length, to| Sample { offset, length, to };
    assert_eq!((found.table, found.samples), (Table::Link, vec![sample(4, 4, 0), sample(0, 2, 0)]));
    let lines = format!("table = \"subscriber\"\nslot = 2\npublisher_length = 9\n{samples}");
    let found = linked(&lines).unwrap_or_else(|error| panic!("{error}")).links[0].clone();
    assert_eq!((found.slot(), found.publisher_length), (Some(2), Some(9)));
    assert_eq!(found.samples, [sample(4, 4, 0), sample(0, 2, 4)], "one behind the other");
    let other = "table = \"subscriber\"\nto = 7\n[[link]]\npublisher = 3\nsubscriber = 11";
    let found = linked(other).unwrap_or_else(|error| panic!("{error}")).links;
    assert_eq!(
        (found[0].slot(), found[0].samples[0].to, found[1].table),
        (Some(1), 7, Table::Link),
        "one in each table"
    );
}

#[test]
fn samples_tables_and_places_that_cannot_be() {
    let subscriber = "table = \"subscriber\"";
    let cases = [
        ("samples = []", "link.1.samples: a link has a sample at least"),
        ("samples = 4", "link.1.samples: this is a number"),
        ("samples = [4]", "link.1.samples: a sample is a table"),
        ("samples = [{ offset = 4 }]", "link.1.samples.1.length: this key is missing"),
        ("samples = [{ offset = 4, length = 4, at = 1 }]", "link.1.samples.1.at: there is no such key"),
        ("offset = 4\nsamples = [{ offset = 4, length = 4 }]", "link.1: a link has either samples or offset"),
        (
            "samples = [{ offset = 0, length = 4 }, { offset = 10, length = 4 }]",
            "link.1.samples.2.length: a sample of 4",
        ),
        ("length = 0", "link.1.length: a sample of 0 octets"),
        ("publisher_length = 7", "offset 4 + length 4 <= 7 octets of publisher_length"),
        ("publisher_length = 0", "link.1.publisher_length: 0 is out of range"),
        ("publisher_length = 245", "link.1.publisher_length: 245 is out of range"),
        ("table = \"links\"", "link.1.table: there is no table \"links\""),
        ("slot = 1", "link.1: the link table has no slot"),
        ("to = 1", "link.1: the link table has no to"),
        ("samples = [{ offset = 4, length = 4, to = 1 }]", "the link table has no to"),
        ("table = \"subscriber\"\nslot = 3", "link.1.slot: slave 11 has no slot 3 for samples"),
        ("table = \"subscriber\"\nslot = 0", "link.1.slot: 0 is out of range"),
        ("table = \"subscriber\"\nto = 241", "link.1.to: 4 octets from octet 241 on are not in the slot's data area"),
        (
            "table = \"subscriber\"\nsamples = [{ offset = 4, length = 4 }, { offset = 4, length = 4, to = 3 }]",
            "link.1.samples.2.to: octets 0 to 3 of slot 1 are taken already",
        ),
        (
            "publisher_length = 11\n[[link]]\npublisher = 3\nsubscriber = 11\ntable = \"subscriber\"",
            "link.2.publisher_length: slave 11 would know two lengths of its publisher's data",
        ),
    ];
    for (lines, expected) in cases {
        let said = linked(lines).map(|scenario| scenario.links).unwrap_err().to_string();
        assert!(said.contains(expected), "{lines}\n{said}");
    }
    let second = format!("{subscriber}\n[[link]]\npublisher = 4\nsubscriber = 11\n{subscriber}");
    let said = linked(&second).map(|scenario| scenario.links).unwrap_err().to_string();
    assert!(said.contains("link.2.to: octets 0 to 3 of slot 1 are taken already"), "{said}");
    assert!(said.contains("for example to = 4"), "{said}");
}

#[test]
fn a_subscriber_has_at_most_29_links() {
    let link = |i| format!("[[link]]\npublisher = {}\nsubscriber = 100\n", i + 3);
    let links = (0..30).map(link).collect::<Vec<_>>().concat();
    let text = format!(
        "[run]\ncycles = 9\n[bus]\nrate = \"12 Mbit/s\"\n[master]\naddress = 2\nt_dp = \"8 ms\"\nt_i = \"125 us\"\n\
         t_o = \"5 ms\"\n[[slave]]\naddresses = \"3..32\"\ndevice = \"posital-ocd-dpb1b\"\n[[slave]]\naddress = 100\n\
         device = \"subscriber-drive\"\n{links}"
    );
    let said = parse(&text, &[]).unwrap_err().to_string();
    assert!(said.contains("link.30.subscriber: slave 100 has more than 29 links"), "{said}");
}

#[test]
fn a_good_file_becomes_a_scenario() {
    let scenario = good(&[]);
    assert_eq!(scenario.question, "Does a clock lost every 100 cycles trip 0F04?\nExpected: no. Source: Model: D15.");
    assert_eq!(scenario.run, Run { seed: 7, duration: Extent::Time(Span::from_s(20)), max_events: None });
    assert_eq!(scenario.bus, Bus { params: BusParams::profile(BitRate::M12), cable_mm: 100_000 });
    assert_eq!(scenario.master.t_dp, Span::from_ms(4));
    let (sigma, bound) = (Span::from_ns(100), Span::from_ns(400));
    assert_eq!(scenario.master.gc_jitter, GcJitter::BoundedNormal { sigma, bound });
    let stations: Vec<_> = scenario.slaves.iter().map(|s| (s.address.get(), s.position_mm, s.t_sdr.0)).collect();
    assert_eq!(stations, [(3, 25_000, 30), (4, 50_000, 30), (5, 75_000, 30), (11, 10_000, 40)]);
    assert_eq!(scenario.slaves[0].crystal, Crystal::Within(50_000));
    assert_eq!(scenario.slaves[0].motion, Motion::Speed { start: Angle::ZERO, micro_rpm: 1_500_000_000 });
    let (publisher, subscriber) = (address(3), address(11));
    assert_eq!(scenario.links, [Link::of(publisher, subscriber, 4, 4)]);
    let action = Action::HoldLifeSign { cycles: Some(2) };
    assert_eq!(scenario.events, [Event { when: When::Time(Span::from_s(1)), slaves: vec![publisher], action }]);
    let window = Window::Cycles(Bursts { from: 1_000, length: Some(1), every: Some(100), times: None });
    let which = Which::all(Service::Only(crate::sim::fault::which::Kind::Synch));
    let what = What::Line(LineFault { which, manner: Manner::All, effect: Effect::Lost });
    assert_eq!(scenario.disturbances, [Disturbance { name: "missing-clocks".to_owned(), window, what }]);
    assert_eq!(scenario.record.tables, [CsvTable::Cycles, CsvTable::Slaves, CsvTable::Events]);
    assert!(scenario.publishes(publisher) && !scenario.publishes(subscriber));
}

#[test]
fn what_is_left_out_has_its_default() {
    let text = "[run]\ncycles = 1000\n[bus]\nrate = \"12 Mbit/s\"\n[master]\naddress = 2\nt_dp = \"8 ms\"\n\
                [[slave]]\naddress = 3\ndevice = \"posital-ocd-dpb1b\"\nt_i = \"125 us\"\nt_o = \"4 ms\"\n";
    let device = crate::device::profile::find("posital-ocd-dpb1b").unwrap();
    assert_eq!(parse(text, &[]).unwrap(), Scenario { name: "good".into(), ..tests::network(BitRate::M12, device, 1) });
}

#[test]
fn overrides_take_the_place_of_what_the_file_says() {
    let scenario = good(&[
        ("run.cycles", "500"),
        ("master.t_o", "1.5 ms"),
        ("slave.4.crystal", "20 ppm"),
        ("slave.4.t_o", "1 ms"),
        ("slave.5.scaling.units_per_rev", "100"),
        ("slave.5.scaling.total_range", "12800"),
        ("slave.5.t_i", "375 us"),
        ("master.gc_jitter.sigma", "\"50 ns\""),
        ("event.1.slaves", "[3, 4]"),
        ("event.1.cycle", "0x10"),
        ("record.plots", "false"),
    ]);
    assert_eq!(scenario.run.duration, Extent::Cycles(500));
    let t_o: Vec<_> = scenario.slaves.iter().map(|s| s.times.t_o.as_us() as u32).collect();
    assert_eq!(t_o, [1_500, 1_000, 1_500, 1_500]);
    let crystals: Vec<_> = scenario.slaves[..3].iter().map(|s| s.crystal).collect();
    assert_eq!(crystals, [Crystal::Within(50_000), Crystal::Offset(20_000), Crystal::Within(50_000)]);
    assert_eq!(scenario.slaves[2].scaling, Some(Scaling { units_per_rev: 100, total_range: 12_800 }));
    assert!(scenario.slaves[2].functions && !scenario.slaves[1].functions);
    assert!(matches!(scenario.master.gc_jitter, GcJitter::BoundedNormal { sigma, .. } if sigma == Span::from_ns(50)));
    assert_eq!((scenario.events[0].when, scenario.events[0].slaves.len()), (When::Cycle(16), 2));
    assert!(!scenario.record.plots);
}

#[test]
fn every_kind_can_be_read() {
    let motion = |kind: &str| match kind {
        "standstill" => "at = \"90 deg\"",
        "speed" => "speed = \"-3 rpm\", start = \"1 rev\"",
        "sine" => "amplitude = \"1 rev\", period = \"2 s\", centre = \"0 rev\", phase = \"90 deg\"",
        _ => "table = [[\"0 s\", \"0 rev\"], [\"1 s\", \"2 rev\"]]",
    };
    for kind in kinds::MOTIONS {
        let table = format!("{{ kind = \"{}\", {} }}", kind.name, motion(kind.name));
        let scenario = good(&[("slave.3.motion", &table)]);
        assert!(format!("{:?}", scenario.slaves[0].motion).to_lowercase().starts_with(kind.name));
    }
    for kind in crate::sim::jitter::KINDS {
        let values = kind.keys.iter().map(|(key, example)| format!(", {key} = {example}")).collect::<Vec<_>>().concat();
        let scenario = good(&[("master.gc_jitter", &format!("{{ kind = \"{}\"{values} }}", kind.name))]);
        assert_eq!(scenario.master.gc_jitter.kind(), kind);
    }
    for kind in kinds::ACTIONS {
        let command = ["sync", "unsync", "freeze", "unfreeze"].contains(&kind.name);
        let masters = command || ["clear", "operate"].contains(&kind.name);
        let about = if masters { "" } else { "slaves = \"all\"" };
        let takes = [("device", "simodrive-sensor-isochron"), ("sync", "true"), ("freeze", "true"), ("groups", "[2]")];
        let takes = takes.map(|(key, value)| (format!("slave.3.{key}"), value));
        let sets: Vec<_> = takes.iter().filter(|_| command).map(|(key, value)| (key.as_str(), *value)).collect();
        let value = match kind.name {
            "jump-life-sign" => "to = 9",
            "control-word" => "value = 0x2000",
            "read-parameter" => "parameter = 979\nelements = 6",
            "change-parameter" => "parameter = 918\nvalue = 7",
            "set-prm" => "octets = [[24, 0x05], [16, 255]]\nlength = 58",
            "sync" | "unfreeze" => "groups = [1, 2]",
            _ => "",
        };
        let event = format!("at = \"1 s\"\ndo = \"{}\"\n{about}\n{value}\n\n[[disturbance]]", kind.name);
        let start = GOOD.find("at = \"1 s\"").unwrap();
        let end = GOOD.find("[[disturbance]]").unwrap();
        let text = [&GOOD[..start], &event, &GOOD[end + "[[disturbance]]".len()..]].concat();
        let scenario = parse(&text, &sets).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(scenario.events[0].slaves.is_empty(), about.is_empty(), "{}", kind.name);
    }
}

/// The same network in two halls.
fn with_a_repeater(text: &str) -> String {
    let halls = "[[segment]]\nname = \"hall 1\"\ncable = \"50 m\"\n[[segment]]\nname = \"hall 2\"\ncable = \"50 m\"\n\
                 [[repeater]]\nfrom = \"hall 1\"\nto = \"hall 2\"\n";
    let text =
        text.replace("cable = \"100 m\"\n", halls).replace("address = 2\n", "address = 2\nsegment = \"hall 1\"\n");
    text.replace("\ndevice =", "\nsegment = \"hall 2\"\ndevice =")
}

#[test]
fn every_disturbance_can_be_written_as_its_example_says() {
    let end = GOOD.find("[[disturbance]]").unwrap();
    let rest = &GOOD[GOOD.find("[record]").unwrap()..];
    for kind in DISTURBANCES {
        let text = format!("disturbance = [{{ {} }}]\n{}{rest}", kind.example, &GOOD[..end]);
        let text = if kind.keys.iter().any(|key| key.name == "repeater") { with_a_repeater(&text) } else { text };
        let scenario = parse(&text, &[]).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(scenario.disturbances[0].name, kind.name);
        let unread = kind.keys.iter().filter(|key| key.name.contains(' ')).count();
        assert_eq!(unread, 0, "keys of {} are words", kind.name);
    }
}

#[test]
fn windows_that_cannot_be() {
    check(&[
        (
            "cycle = 1000",
            "cycle = 1000\nat = \"1 s\"",
            r"
good.toml:41:1: disturbance.1: a disturbance begins either at an instant or in a cycle
  41 | [[disturbance]]
     | ^^^^^^^^^^^^^^^
  help: leave out at, or leave out cycle
",
        ),
        (
            "for = 1\nevery",
            "every",
            r"
good.toml:41:1: disturbance.1: every without for says nothing
  41 | [[disturbance]]
     | ^^^^^^^^^^^^^^^
  help: add for, or leave out every
",
        ),
        (
            "for = 1\n",
            "for = \"1 ms\"\n",
            r#"
good.toml:44:7: disturbance.1.for: this is a time, but the disturbance begins in a cycle
  44 | for = "1 ms"
     |       ^^^^^^
  help: a whole number of cycles
"#,
        ),
        (
            "cycle = 1000",
            "at = \"1 s\"",
            r#"
good.toml:44:7: disturbance.1.for: this is a number, but the disturbance begins at an instant
  44 | for = 1
     |       ^
  help: a time with its unit, such as "20 ms"

good.toml:45:9: disturbance.1.every: this is a number, but the disturbance begins at an instant
  45 | every = 100
     |         ^^^
  help: a time with its unit, such as "20 ms"
"#,
        ),
    ]);
}

#[test]
fn repetitions_and_names_that_cannot_be() {
    check(&[
        (
            "cycle = 1000\nfor = 1\nevery = 100",
            "at = \"1 s\"\nfor = \"2 ms\"\nevery = \"1 ms\"",
            r#"
good.toml:45:9: disturbance.1.every: 1 ms is too short
  45 | every = "1 ms"
     |         ^^^^^^
  help: at least 2 ms
"#,
        ),
        (
            "kind = \"missing-clocks\"",
            "kind = \"restart\"\nstation = 2",
            r#"
good.toml:45:7: disturbance.1.for: the supply of [master], station 2, would never return
  45 | for = 1
     |       ^
  rule: cycles are those of [master], and without supply it begins none
  help: at and for as times, such as at = "1 s", for = "20 ms"
"#,
        ),
        (
            "every = 100",
            "every = 100\nname = \"x\"\n[[disturbance]]\nkind = \"missing-clocks\"\nname = \"x\"",
            r#"
good.toml:49:8: disturbance.2.name: two disturbances are called "x"
  49 | name = "x"
     |        ^^^
  rule: the draws of a disturbance hang on its name, so that each needs its own
"#,
        ),
    ]);
}

/// What is said of a disturbance with these keys in the place of that of the good file, without the lines that show it.
fn said_of_disturbance(keys: &str) -> String {
    let begin = GOOD.find("kind = \"missing-clocks\"").unwrap();
    let end = GOOD.find("\n[record]").unwrap();
    let text = [&GOOD[..begin], keys, "\n", &GOOD[end..]].concat();
    match parse(&text, &[]) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("nothing is said of {keys}"),
    }
}

#[test]
fn disturbances_of_the_line_that_cannot_be() {
    for (keys, expected) in [
        ("kind = \"lost-telegrams\"\nrate = \"1 %\"\ntelegrams = 3", "rate, telegrams and pattern exclude each other"),
        ("kind = \"lost-telegrams\"\nrate = \"101 %\"", "is beyond the range of a share, 0 to 1"),
        ("kind = \"lost-telegrams\"\npattern = \"xo\"", "1 to 64 characters, x for a telegram that is meant"),
        ("kind = \"lost-telegrams\"\nservice = \"tokens\"", "did you mean \"token\"?"),
        ("kind = \"late-telegrams\"", "late either by a time or by anything up to a time"),
        (
            "kind = \"late-telegrams\"\nby = \"1 us\"\nup_to = \"1 us\"",
            "late either by a time or by anything up to a time",
        ),
        ("kind = \"late-telegrams\"\nby = \"-1 us\"", "-1 us is negative"),
        ("kind = \"bit-errors\"", "for example: rate = \"1e-6\""),
        ("kind = \"bit-errors\"\nrate = \"1e-16\"", "is not a whole number of parts in 10^15"),
        ("kind = \"wrong-octet\"", "disturbance.1.octet: this key is missing"),
        ("kind = \"wrong-octet\"\noctet = 0", "0 is out of range"),
        ("kind = \"wrong-octet\"\noctet = 8\nflip = 0", "a whole number from 1 to 255"),
        ("kind = \"wrong-octet\"\noctet = 8\nparity = \"bad\"", "there is no parity \"bad\""),
        ("kind = \"noise\"\nmean = \"0 us\"", "noise that never pauses is no noise"),
        ("kind = \"noise\"\noctets = 4\noctets_to = 3", "a whole number from 4 to 255"),
        ("kind = \"noise\"\nnear = 77", "disturbance.1.near: there is no slave 77"),
        ("kind = \"foreign-telegram\"", "given by octets, token or data, and by one of them only"),
        ("kind = \"foreign-telegram\"\noctets = \"DC 2\"\ntoken = { to = 2, from = 5 }", "by one of them only"),
        ("kind = \"foreign-telegram\"\noctets = \"DC 102 5\"", "1 to 255 octets in hexadecimal"),
        ("kind = \"foreign-telegram\"\noctets = \"\"", "these are no octets of a telegram"),
        ("kind = \"foreign-telegram\"\ntoken = { to = 2 }", "token.from: this key is missing"),
        ("kind = \"foreign-telegram\"\ntoken = { to = 200, from = 5 }", "a whole number from 0 to 127"),
        ("kind = \"foreign-telegram\"\ndata = { to = 2, from = 5, fc = 0x41 }", "frame control 41 is not assigned"),
        ("kind = \"foreign-telegram\"\ndata = { to = 2, from = 5, sap = 60 }", "did you mean \"dsap\"?"),
        ("kind = \"late-token\"\nstation = 3\nby = \"1 us\"", "station 3 is a slave"),
        ("kind = \"late-token\"\nstation = 2", "for example: by = \"200 us\""),
    ] {
        let said = said_of_disturbance(keys);
        assert!(said.contains(expected), "{keys}\n{said}");
    }
}

#[test]
fn services_that_do_not_fit() {
    check_sets(&[
        (
            "slave.3.sync",
            "true",
            r#"
--set "slave.3.sync=true": slave.3.sync: posital-ocd-dpb1b knows no sync
  rule: a slave refuses what it does not know with Not_Supported (EN 50170-2, Set_Prm octet 1)
  help: leave out sync; simodrive-sensor-isochron knows it
"#,
        ),
        (
            "slave.3.min_slave_interval",
            "4.1 ms",
            r#"
--set "slave.3.min_slave_interval=4.1 ms": slave.3.min_slave_interval: T_DP = 4 ms is too short for slave 3
  rule: T_DP >= Min_Slave_Interval = 4.1 ms of every slave (GSD, Min_Slave_Intervall in 100 us)
  help: the shortest is t_dp = "4.125 ms"
"#,
        ),
        (
            "master.data_control_time",
            "20 ms",
            r#"
--set "master.data_control_time=20 ms": master.data_control_time: a Data_Control_Time of 20 ms is too short
  rule: Data_Control_Time >= 6 x T_DP = 24 ms: the mode is told every third of it, and not in every cycle (Model: D5)
  help: data_control_time = "24 ms" or more
"#,
        ),
        (
            "slave.3.groups",
            "[1, 8]",
            r#"
--set "slave.3.groups=[1, 8]": slave.3.groups: the groups are a list of numbers from 1 to 7
  rule: group 8 is the clock's (Global_Control octet 2, 00 80 is SYNCH)
  help: groups = [1, 3]
"#,
        ),
    ]);
    let event = "at = \"1 s\"\ndo = \"hold-life-sign\"\nslave = 3\nfor = 2";
    let freeze = "at = \"1 s\"\ndo = \"freeze\"\ngroups = [2]";
    assert!(said(event, freeze).contains("no slave takes this command"));
    let text = GOOD.replace(event, freeze);
    let takes = |group| {
        let sets =
            [("slave.3.freeze", "true"), ("slave.3.groups", group), ("slave.3.device", "simodrive-sensor-isochron")];
        parse(&text, &sets).is_ok()
    };
    assert!(takes("[2]") && takes("[1, 2, 7]") && !takes("[1]"));
}

#[test]
fn columns_count_characters() {
    let said = said("seed = 7", "\"s\u{e9}\u{e9}d\" = 7");
    assert!(said.starts_with("good.toml:5:1: run.s\u{e9}\u{e9}d: there is no such key"), "{said}");
    let said = parse("[run]\r\n\tseed = \"\u{fc}\", cycles = 1\r\n", &[]).unwrap_err().to_string();
    assert!(said.starts_with("good.toml:2:12: "), "{said}");
}

#[test]
fn files_that_cannot_be_scenarios() {
    let folder = tempfile::tempdir().unwrap();
    let said = |path: &Path| {
        let said = Scenario::load(path, &[]).unwrap_err().to_string();
        said.replace(&folder.path().display().to_string(), "FOLDER").replace('\\', "/")
    };
    let written = |name: &str, octets: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, octets).unwrap();
        path
    };
    let huge = written("huge.toml", b"");
    File::options().write(true).open(&huge).unwrap().set_len(100_000_000).unwrap();
    let latin = b"[run]\n# 10 \xB5s\n";
    for (path, expected) in [
        (folder.path().to_owned(), "FOLDER: this is a directory\n  help: name one scenario file in it, *.toml"),
        (folder.path().join("none.toml"), "FOLDER/none.toml: there is no such file"),
        (huge, "FOLDER/huge.toml: a 100 MB file is no scenario\n  rule: a scenario has at most 4 MB"),
        (
            written("empty.toml", b" \n\n"),
            "FOLDER/empty.toml: the scenario is empty\n  help: it needs [run], [bus], [master] and a [[slave]]",
        ),
        (
            written("latin.toml", latin),
            "FOLDER/latin.toml: this file is no UTF-8 text: octet B5 in line 2\n  help: save it as UTF-8; a scenario is a \
             text file",
        ),
        (
            written("...toml", GOOD.as_bytes()),
            "FOLDER/...toml: this file has no name before its extension\n  rule: the results of NAME.toml go to a \
             directory NAME\n  help: rename it",
        ),
    ] {
        assert_eq!(said(&path), expected);
    }
    let path = written("with mark.toml", format!("\u{feff}{GOOD}").as_bytes());
    assert_eq!(Scenario::load(&path, &[]), Ok(Scenario { name: "with mark".into(), ..good(&[]) }));
}

/// The good file with some octets taken out and others put in.
fn disturbed() -> impl Strategy<Value = Vec<u8>> {
    let octets = prop_oneof![
        prop::collection::vec(any::<u8>(), 0..20),
        "[-a-z0-9_\\[\\]{}=\"., \n]{0,20}".prop_map(String::into_bytes),
        prop::sample::select(vec![
            "99999999999999999999",
            "-1",
            "\"-1 s\"",
            "\"9e9 s\"",
            "[]",
            "{}",
            "1979-05-27",
            "nan"
        ])
        .prop_map(|text| text.as_bytes().to_vec()),
    ];
    (0..GOOD.len(), 0..30usize, octets).prop_map(|(start, length, octets)| {
        let good = GOOD.as_bytes();
        [&good[..start], &octets, &good[(start + length).min(good.len())..]].concat()
    })
}

/// Two segments, each kind of link in turn between them, and a slave on each.
const SEGMENTS: &str = r#"
[run]
cycles = 9
[bus]
rate = "12 Mbit/s"
[[segment]]
name = "a"
cable = "100 m"
[[segment]]
name = "b"
cable = "50 m"
delay_per_metre = "6 ns"
[[repeater]]
kind = "olm"
from = "a"
to = "b"
fibre = "10 m"
modules = 3
delay = "5 tbit"
jitter = "20 ns"
[master]
address = 2
segment = "a"
t_dp = "4 ms"
t_i = "125 us"
t_o = "2 ms"
[[slave]]
address = 3
segment = "a"
device = "posital-ocd-dpb1b"
[[slave]]
addresses = "4..5"
segment = "b"
device = "posital-ocd-dpb1b"
"#;

#[test]
fn segments_and_repeaters_are_read_and_overridden() {
    let scenario = parse(SEGMENTS, &[]).unwrap_or_else(|error| panic!("{error}"));
    let [a, b] = scenario.topology.segments() else { panic!("two segments") };
    assert_eq!((a.name.as_str(), a.cable_mm, a.delay_per_metre), ("a", 100_000, Span::from_ns(5)));
    assert_eq!((b.name.as_str(), b.cable_mm, b.delay_per_metre), ("b", 50_000, Span::from_ns(6)));
    let [link] = scenario.topology.repeaters() else { panic!("one link") };
    assert_eq!((link.name.as_str(), link.kind.name, link.modules, link.fibre_mm), ("a - b", "olm", 3, 10_000));
    assert_eq!(link.ends, [Point { segment: 0, mm: 100_000 }, Point { segment: 1, mm: 0 }]);
    // Three modules of 5 t_bit and 10 m of glass.
    assert_eq!(link.crossing(), Span::from_ns(1_250 + 50));
    assert_eq!(link.jitter, Span::from_ns(20));
    let at = |slave: &Slave| (slave.address.get(), slave.segment, slave.position_mm);
    assert_eq!(scenario.slaves.iter().map(at).collect::<Vec<_>>(), [(3, 0, 100_000), (4, 1, 25_000), (5, 1, 50_000)]);

    let sets = [
        ("segment.2.cable", "60 m"),
        ("repeater.1.delay", "1 us"),
        ("slave.5.segment", "a"),
        ("repeater.1.to_position", "7 m"),
    ];
    let other = parse(SEGMENTS, &sets).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(other.slaves.iter().map(at).collect::<Vec<_>>(), [(3, 0, 50_000), (4, 1, 60_000), (5, 0, 100_000)]);
    assert_eq!(other.topology.repeaters()[0].crossing(), Span::from_ns(3_050));
    assert_eq!(other.delay(address(2), address(4)), Span::from_ns(500 + 3_050 + 53 * 6));
}

#[test]
fn t_td_is_the_delay_with_the_worst_jitter_and_rounded_up() {
    let scenario = parse(SEGMENTS, &[("slave.5.position", "33333 mm"), ("repeater.1.to_position", "1 mm")]);
    let scenario = scenario.unwrap_or_else(|error| panic!("{error}"));
    let (master, slave) = (address(2), address(5));
    assert_eq!(scenario.t_td(master, slave), scenario.t_td(slave, master));
    let more = scenario.t_td(master, slave) - scenario.delay(master, slave) - Span::from_ns(20);
    assert!((Span::ZERO..=Span::from_ticks(2)).contains(&more), "{more}");
    assert!(scenario.topology.t_td_max() >= scenario.t_td(master, slave));
    assert_eq!(scenario.t_td(master, address(77)), Span::ZERO, "there is no such station");
}

proptest! {
    #[test]
    fn numbers_of_any_size_in_segments_do_not_panic(
        place in prop::sample::select(vec![
            "segment.1.cable", "segment.2.delay_per_metre", "segment.2.name", "repeater.1.from", "repeater.1.to",
            "repeater.1.from_position", "repeater.1.to_position", "repeater.1.delay", "repeater.1.jitter",
            "repeater.1.modules", "repeater.1.fibre", "repeater.1.kind", "master.segment", "slave.4.segment",
            "slave.4.position", "bus.cable",
        ]),
        number in prop_oneof![any::<i64>(), -1000i64..100_000],
        unit in prop::sample::select(vec!["", " tick", " us", " s", " tbit", " m", " km", " mm"]),
    ) {
        match parse(SEGMENTS, &[(place, &format!("{number}{unit}"))]) {
            Err(error) => prop_assert!(!error.problems.is_empty()),
            Ok(scenario) => prop_assert!(scenario.topology.t_td_max() >= Span::ZERO),
        }
    }
    #[test]
    fn no_octets_panic(octets in prop_oneof![prop::collection::vec(any::<u8>(), 0..400), disturbed()]) {
        if let Ok(text) = decode(&octets)
            && let Err(error) = parse(text, &[])
        {
            prop_assert!(!error.problems.is_empty() && !error.to_string().is_empty());
        }
    }
    #[test]
    fn no_override_panics(
        key in "(master|slave|run|bus|link|event|segment|repeater|x)(\\.(3|1|0|t_o|rate|cable|motion|)){0,3}",
        value in ".{0,30}",
    ) {
        if let Err(error) = parse(GOOD, &[(&key, &value)]) {
            prop_assert!(!error.problems.is_empty());
        }
    }
    #[test]
    fn numbers_of_any_size_do_not_panic(
        place in prop::sample::select(vec![
            "master.t_dp", "master.t_i", "master.t_o", "master.t_pll_w", "slave.3.t_pll_d", "run.duration", "slave.3.powered_at",
            "bus.cable", "slave.3.position", "bus.t_sl", "bus.t_set", "bus.t_qui", "bus.max_tsdr", "bus.min_tsdr",
            "slave.3.t_sdr", "slave.3.crystal", "master.gc_jitter.sigma", "master.gc_jitter.bound", "run.cycles",
            "disturbance.1.every", "link.1.offset", "link.1.length", "bus.hsa", "master.t_mapc", "master.watchdog",
        ]),
        number in prop_oneof![any::<i64>(), -1000i64..100_000],
        unit in prop::sample::select(vec!["", " tick", " us", " s", " tbit", " m", " km", " ppb"]),
    ) {
        if let Err(error) = parse(GOOD, &[(place, &format!("{number}{unit}"))]) {
            prop_assert!(!error.problems.is_empty());
        }
    }
}
