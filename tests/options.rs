//! Every option of a device and of the master has the effect that it promises, and only a good one is taken.

use isodp::observation::{Observation, Phase, PllState};
use isodp::study::row::SlaveRow;
use isodp::study::scenario::Scenario;
use isodp::time::Span;

use crate::support::Run;

/// Bits of G1_ZSW (manual 2.2).
const ACKNOWLEDGING: u16 = 1 << 11;
const VALUE: u16 = 1 << 13;
const ERROR: u16 = 1 << 15;

/// One encoder at address 3 whose clock is 50 ppm fast. `master` and `slave` are further keys, `more` further tables.
fn parse(master: &str, slave: &str, more: &str) -> Result<Scenario, String> {
    let text = format!(
        r#"
        [run]
        cycles = 400
        [bus]
        rate = "12 Mbit/s"
        [master]
        address = 2
        t_dp = "2 ms"
        t_i = "125 us"
        t_o = "1 ms"
        {master}
        [[slave]]
        address = 3
        device = "posital-ocd-dpb1b"
        crystal = "50 ppm"
        motion = {{ kind = "standstill", at = "0.5 rev" }}
        {slave}
        {more}
        "#
    );
    Scenario::parse("options", "options.toml", &text, &[]).map_err(|error| error.to_string())
}
fn run(master: &str, slave: &str, more: &str) -> Run {
    Run::of(&parse(master, slave, more).unwrap_or_else(|error| panic!("{error}")))
}
/// A run with these keys of the slave.
fn with(slave: &str) -> Run {
    run("", slave, "")
}
/// A run in which G1_STW has these values, each from its cycle on.
fn commanded(slave: &str, words: &[(u64, u16)]) -> Run {
    let event = |&(cycle, value): &(u64, u16)| {
        format!("[[event]]\ncycle = {cycle}\ndo = \"control-word\"\nslave = 3\nvalue = {value}\n")
    };
    run("", slave, &words.iter().map(event).collect::<String>())
}
/// How many cycles show all of `bits` in G1_ZSW.
fn shown(run: &Run, bits: u16) -> usize {
    run.slave(3).filter(|row| row.g1_zsw & bits == bits).count()
}
fn cycles_in(run: &Run, phase: Phase) -> usize {
    run.slave(3).filter(|row| row.phase == phase).count()
}
/// Cycles from the first SYNCH to lock.
fn lock(run: &Run) -> u64 {
    run.counts.as_ref().and_then(|counts| counts.slaves[0].lock).expect("locked").cycles
}
fn last(run: &Run) -> &SlaveRow {
    run.slave(3).last().expect("a row")
}
/// Largest magnitude of an error of the clock in the last 100 cycles \[ns\].
fn error_ns(run: &Run) -> f64 {
    let rows: Vec<_> = run.slave(3).filter_map(|row| row.pll_error).collect();
    rows[rows.len() - 100..].iter().map(|error| error.as_us().abs() * 1e3).fold(0.0, f64::max)
}

/// A command that does not exist, for some cycles, then an acknowledgement that is held.
const FAULT: &[(u64, u16)] = &[(200, 0x2001), (220, 0x2000), (240, 0xA000), (280, 0x2000)];

/// Overrides reach into lists and tables of tables; what is not there is told with what is.
#[test]
fn overrides_reach_into_lists() {
    let text = r#"
        [run]
        cycles = 400
        [bus]
        rate = "12 Mbit/s"
        hsa = 9
        [master]
        address = 2
        t_dp = "2 ms"
        t_i = "125 us"
        t_o = "1 ms"
        [[segment]]
        name = "hall"
        cable = "100 m"
        [[slave]]
        address = 3
        device = "posital-ocd-dpb1b"
        [[slave]]
        address = 4
        device = "posital-ocd-dpb1b"
        master = 7
        [[class1]]
        address = 7
        [[class2]]
        address = 1
        [[class2.job]]
        service = "diagnosis"
        slave = 3
        [[class2.job]]
        service = "parameter-read"
        parameters = [918, 922]
        slave = 3
        [[event]]
        cycle = 100
        do = "set-prm"
        octets = [[24, 255], [49, 0]]
        slave = 3
    "#;
    let parse = |key: &str, value: &str| Scenario::parse("o", "o.toml", text, &[(key.to_owned(), value.to_owned())]);
    let good = |key: &str, value: &str| parse(key, value).unwrap_or_else(|error| panic!("{error}"));
    let job = |scenario: &Scenario, number: usize| scenario.class2[0].jobs[number].clone();
    let changed = good("class2.1.job.2.period", "5 ms");
    assert_eq!(job(&changed, 1).period, Some(Span::from_ms(5)));
    assert_eq!((job(&changed, 0), job(&changed, 1).works.len()), (job(&good("run.cycles", "400"), 0), 2));
    assert_eq!(job(&good("class2.1.job.1.start", "7 ms"), 0).start, Span::from_ms(7));
    let parameter = |scenario: &Scenario| format!("{:?}", job(scenario, 1).works[1]);
    assert!(parameter(&good("class2.1.job.2.parameters.2", "964")).contains("964"));
    assert_eq!(good("class1.1.least_cycle", "3 ms").class1[0].least_cycle, Span::from_ms(3));
    assert_ne!(good("segment.1.cable", "90 m").topology, good("run.cycles", "400").topology);
    assert_ne!(good("event.1.octets.1.2", "254").events, good("run.cycles", "400").events);
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/gsd/isodp_scancon_06df.gsd");
    assert!(good("slave.3.device.gsd", file).slaves[0].device.source.contains("isodp_scancon"));
    for (key, expected) in [
        ("class2.1.job.3.period", "the list job has no number \"3\"\n  help: it has job.1 to job.2"),
        ("class2.1.job.0.period", "the list job has no number \"0\""),
        ("class2.1.job.period", "the list job has no number \"period\""),
        ("class2.1.job.2.perod", "class2.1.job.2.perod: there is no such key\n  help: did you mean \"period\"?"),
        ("class2.1.jobs.1.period", "class2.1.jobs: there is no such key\n  help: did you mean \"job\"?"),
        ("class2.2.job.1.period", "there is no [[class2]] number \"2\""),
        ("class1.1.least_cycl", "did you mean \"least_cycle\"?"),
        ("segment.2.cable", "there is no [[segment]] number \"2\""),
        ("class2.1.job.2.parameters.2.x", "entry 2 of the list has no keys, and so no \"x\""),
        ("class2.1.job.2", "an override names a key"),
        ("slave.3.device.gds", "did you mean \"gsd\"?"),
    ] {
        let error = parse(key, "5 ms").expect_err(key).to_string();
        assert!(error.contains(expected), "{key}: {error}");
    }
}

#[test]
fn an_acknowledgement_shows_as_the_make_does() {
    let acknowledging = |sensor: &str| shown(&commanded(sensor, FAULT), ACKNOWLEDGING);
    assert_eq!(acknowledging(""), 0);
    assert_eq!(acknowledging("sensor = { acknowledgement = \"immediate\" }"), 0);
    assert_eq!(acknowledging("sensor = { acknowledgement = \"self-clearing\" }"), 1);
    assert_eq!(acknowledging("sensor = { acknowledgement = \"until-reset\" }"), 40);
}

#[test]
fn the_error_bit_stays_during_the_acknowledgement_where_the_make_wants_it() {
    let both = |bit: &str| {
        let sensor = format!("sensor = {{ acknowledgement = \"until-reset\", error_bit = \"{bit}\" }}");
        shown(&commanded(&sensor, FAULT), ACKNOWLEDGING | ERROR)
    };
    assert_eq!((both("while-cause"), both("while-acknowledging")), (0, 40));
}

#[test]
fn the_value_bit_follows_the_request_where_the_make_wants_it() {
    let both = |bit: &str| shown(&commanded(&format!("sensor = {{ value_bit = \"{bit}\" }}"), FAULT), VALUE | ERROR);
    assert_eq!((both("cleared-by-error"), both("follows-request")), (0, 40));
}

#[test]
fn a_preset_sets_its_value_and_can_be_switched_off() {
    // Octet 15 bit 1 enables presets (manual 3.2.2).
    let commanded = |slave: &str, words: &[(u64, u16)]| {
        self::commanded(&format!("functions = true\nt_i = \"375 us\"\n{slave}"), words)
    };
    let xist1 = |slave: &str| last(&commanded(slave, &[(200, 0x1000)])).xist1;
    // 8192 x 4096 steps, shifted left by 7; half a revolution is 4096 steps.
    assert_eq!(last(&with("")).xist1, 4_096 << 7);
    assert_eq!(xist1(""), 0);
    assert_eq!(xist1("preset_value = 1000"), 1_000 << 7);
    assert_eq!(last(&commanded("preset_value = 1000", &[(200, 0x1800)])).xist1, 5_096 << 7);
    let off = commanded("sensor = { preset = false }", &[(200, 0x1000)]);
    assert_eq!(last(&off).xist1, 4_096 << 7);
    assert!(off.events_of(3).any(|event| event.what == Observation::Fault { code: 0x0F01 }));
}

#[test]
fn the_type_key_sets_the_resolution() {
    // 10 bit of one revolution, shifted left by 22.
    assert_eq!(last(&with("resolution = { steps_per_rev = 1024, revolutions = 1 }")).xist1, 512 << 22);
    assert_eq!(last(&with("resolution = { steps_per_rev = 65536, revolutions = 65536 }")).xist1, 32_768);
    let scaling = "scaling = { units_per_rev = 1000, total_range = 2000 }\nt_i = \"375 us\"";
    let both = |revolutions| format!("resolution = {{ steps_per_rev = 1024, revolutions = {revolutions} }}\n{scaling}");
    assert_eq!(last(&with(&both(2))).xist1, 500 << 21);
    let error = parse("", &both(1), "").unwrap_err();
    assert!(error.contains("total range <= 1000 units per revolution x 1 revolutions"), "{error}");
}

#[test]
fn hits_and_windows_decide_when_the_clock_is_locked() {
    let default = lock(&with(""));
    let locked = |pll: &str| lock(&with(&format!("pll = {{ {pll} }}")));
    assert_eq!(locked("hits_to_lock = 10"), default + 6);
    assert!(locked("hits_per_step = 2") < default);
    // The first window is the last: 4 hits.
    assert_eq!(locked("first_window_factor = 1, first_window_ppm = 0"), 4);
    assert!(locked("first_window_factor = 16") > default);
    assert!(locked("first_window_ppm = 3000") > default);
}

#[test]
fn the_window_is_never_narrower_than_its_least_width() {
    let width = |pll: &str| last(&with(pll)).window.expect("a window").as_us();
    assert_eq!((width(""), width("pll = { min_window = \"3 us\" }")), (1.0, 3.0));
}

#[test]
fn the_gains_decide_what_is_left_of_a_frequency_error() {
    // 50 ppm of 2 ms are 100 ns per cycle: without integral gain Kp leaves 100 ns / Kp.
    let left = |pll: &str| error_ns(&with(&format!("pll = {{ {pll} }}")));
    let (default, quarter, half) = (error_ns(&with("")), left("ki = \"0\""), left("kp = \"1/2\", ki = \"0\""));
    assert!(default < 60.0, "{default}");
    assert!((370.0..430.0).contains(&quarter), "{quarter}");
    assert!((170.0..230.0).contains(&half), "{half}");
}

#[test]
fn a_coarse_timer_latches_at_coarse_instants() {
    let spread = |slave: &str| {
        let run = with(slave);
        let offsets: Vec<_> = run.slave(3).filter_map(|row| row.latch_offset).map(isodp::time::Span::as_us).collect();
        let settled = &offsets[offsets.len() - 200..];
        settled.iter().copied().fold(f64::MIN, f64::max) - settled.iter().copied().fold(f64::MAX, f64::min)
    };
    let coarse = spread("t_pll_w = \"2 us\"\npll = { quantum = \"1 us\" }");
    assert!(spread("") < 0.1 && coarse > 0.8, "{coarse}");
}

#[test]
fn failures_in_a_row_start_over_when_the_option_says_so() {
    let first = with("").slave(3).find(|row| row.pll == PllState::Narrowing).expect("a start").cycle;
    let gap = format!("[[disturbance]]\nkind = \"missing-clocks\"\ncycle = {}\nfor = 2\n", first + 3);
    let waits = |slave: &str| {
        let run = run("", slave, &gap);
        run.observations.iter().filter(|seen| matches!(seen.2, Observation::Pll { to: PllState::Waiting, .. })).count()
    };
    assert_eq!(waits(""), 1);
    assert!(waits("pll = { failures_to_restart = 1 }") > 1);
}

#[test]
fn the_phases_of_the_signs_of_life_are_as_long_as_the_options_say() {
    let phases = |slave: &str| {
        let run = with(slave);
        (cycles_in(&run, Phase::MasterLife), cycles_in(&run, Phase::SlaveLife))
    };
    let (steps, confirmation) = phases("");
    assert_eq!(confirmation, 16);
    assert_eq!(phases("life_steps = 4\nlife_confirmation = 2"), (steps - 12, 2));
}

#[test]
fn the_own_sign_of_life_can_start_with_the_clock() {
    let early = |slave: &str| with(slave).slave(3).filter(|row| row.phase == Phase::MasterLife && row.sls > 0).count();
    assert_eq!((early(""), early("life_start = \"after-master\"")), (0, 0));
    assert!(early("life_start = \"after-clock\"") > 10);
}

#[test]
fn the_masters_sign_of_life_waits_for_its_delay() {
    // The first data unit of the master whose sign of life is not 0.
    let begins = |master: &str| {
        let run = run(master, "", "");
        let signed = |octets: &[u8]| octets.len() == 13 && octets[4..6] == [3, 2] && octets[7] >> 4 != 0;
        let (at, ..) = *run.telegrams.iter().find(|telegram| signed(&telegram.3)).expect("a sign of life");
        run.cycles.iter().rposition(|cycle| cycle.t0 <= at).expect("a cycle")
    };
    assert_eq!(begins("life_delay = 50"), begins("") + 50);
}

#[test]
fn active_spare_time_is_full_of_tokens_and_no_clock_is_late() {
    let tokens = |master: &str| {
        let run = run(master, "", "");
        let counts = run.counts.as_ref().expect("counts");
        assert_eq!((counts.network.late_clocks, counts.network.collisions), (0, 0));
        assert_eq!(last(&run).phase, Phase::Operation);
        run.telegrams.iter().filter(|telegram| telegram.3[0] == 0xDC).count() / run.cycles.len()
    };
    assert_eq!(tokens("active_spare = false"), 1);
    // About 1.8 ms, of which a token with T_ID1 takes less than 12 us.
    assert!(tokens("active_spare = true") > 150);
}

#[test]
fn options_that_cannot_be_are_refused() {
    let refused = [
        ("", "sensor = { acknowledgement = \"later\" }", "there is no acknowledgement \"later\""),
        ("", "sensor = { preset = 1 }", "write true or false"),
        ("", "sensor = { presets = true }", "did you mean \"preset\"?"),
        ("", "pll = { kp = \"1.5\" }", "beyond the range of a gain, 0 to 1"),
        ("", "pll = { kp = 1 }", "\"1/4\""),
        ("", "pll = { ki = \"1/0\" }", "is not a gain"),
        ("", "pll = { quantum = \"0 ns\" }", "timers without steps do not exist"),
        ("", "pll = { quantum = \"3 us\" }", "quantum <= half width of the window in force, 1 us"),
        ("", "pll = { min_window = \"501 us\" }", "min_window <= T_DP / 4 = 500 us"),
        ("", "pll = { hits_to_lock = 0 }", "a whole number from 1 to 255"),
        ("", "life_steps = 0", "a whole number from 1 to 255"),
        ("", "life_start = \"soon\"", "after-master, after-clock"),
        ("", "preset_value = 2147483648", "a whole number from -2147483648 to 2147483647"),
        ("", "resolution = { steps_per_rev = 1024 }", "this key is missing"),
        ("", "resolution = { steps_per_rev = 65537, revolutions = 65536 }", "32 bits"),
        ("life_delay = -1", "", "a whole number from 0"),
        ("active_spare = 1", "", "write true or false"),
        ("active_spare = true\ngc_jitter = { kind = \"uniform\", half_width = \"10 us\" }", "", "does not fit"),
    ];
    for (master, slave, words) in refused {
        let error = parse(master, slave, "").err().unwrap_or_else(|| panic!("{master}{slave} is taken"));
        assert!(error.contains(words), "{words}\n{error}");
    }
    let drive = "[[slave]]\naddress = 4\ndevice = \"subscriber-drive\"\npreset_value = 3";
    let error = parse("", "", drive).unwrap_err();
    assert!(error.contains("subscriber-drive has no preset_value"), "{error}");
}

#[test]
fn a_number_in_an_override_is_read_as_a_gain() {
    let gain = |text: &str| {
        let scenario = crate::support::scenario("reference", &[("slave.3.pll.kp", text)]);
        scenario.slave(crate::support::address(3)).expect("a slave").options.pll.kp
    };
    for text in ["1/8", "0.125", "1.25e-1", "\"0.125\""] {
        assert_eq!(gain(text), 8_192, "{text}");
    }
    assert_eq!(gain("1"), 65_536);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/reference.toml");
    for (key, value, words) in [
        ("slave.3.pll.kp", "1.5", "\"1.5\" is beyond the range of a gain, 0 to 1"),
        ("slave.3.pll.kp", "nan", "\"nan\" is not a gain"),
        ("master.t_o", "3", "\"3\" has no unit; a time has one of the units ns, us, ms, s, min, h, tick, tbit"),
        ("master.t_o", "true", "this is true or false"),
    ] {
        let sets = [(key.to_owned(), value.to_owned())];
        let error = Scenario::load(path.as_ref(), &sets).expect_err(value).to_string();
        assert!(error.contains(words), "{words}\n{error}");
    }
}
