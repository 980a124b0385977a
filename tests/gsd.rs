//! GSD files: what is understood, what a network of such devices does, and what comes of broken files.

use std::fs;
use std::path::PathBuf;

use isodp::device::profile::{self, Profile};
use isodp::observation::{LinkState, Observation, Phase};
use isodp::study::build;
use isodp::study::gsd::Gsd;
use isodp::study::scenario::{CodeSequence, Scaling, Scenario};
use isodp::time::Span;
use proptest::prelude::*;

use crate::cli::Room;
use crate::support::{Run, scenario};

const FILES: [(&str, &str); 2] =
    [("isodp_posital_06df.gsd", "posital-ocd-dpb1b"), ("isodp_scancon_06df.gsd", "scancon-sag-dpb1b")];

fn shipped(name: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenarios/gsd").join(name);
    fs::read_to_string(path).expect("a shipped file")
}
fn text() -> String {
    shipped(FILES[0].0)
}
/// The shipped file with one thing changed.
fn with(from: &str, to: &str) -> String {
    let text = text();
    assert_eq!(text.matches(from).count(), 1, "{from}");
    text.replace(from, to)
}
fn parse(text: &str) -> Gsd {
    Gsd::parse("test.gsd", text.as_bytes()).unwrap_or_else(|problem| panic!("{problem}"))
}
fn profile(gsd: &Gsd) -> Profile {
    (*gsd.device(None).unwrap_or_else(|fault| panic!("{}", fault.message))).clone()
}

/// Every field by its name, so that a new one is compared too.
fn assert_same(read: &Profile, known: &Profile) {
    let Profile {
        name,
        title,
        ident,
        config,
        inputs,
        outputs,
        max_tsdr,
        rates,
        t_dp_min,
        t_dp_max,
        t_base_dp,
        t_base_io,
        t_i_min,
        t_o_min,
        gap_min,
        functions_min,
        t_pll_w_max,
        min_window,
        steps_per_rev,
        revolutions,
        publisher,
        subscriber,
        dxb,
        max_prm,
        fail_safe,
        sync,
        freeze,
        max_diag,
        min_slave_interval,
        acyclic,
        c1,
        c2,
        ms2_connections,
        wd_base_1ms,
        isochronous,
        isochronous_required,
        source,
    } = read;
    assert_eq!((name, title, ident, config), (&known.name, &known.title, &known.ident, &known.config));
    assert_eq!((inputs, outputs, max_tsdr, rates), (&known.inputs, &known.outputs, &known.max_tsdr, &known.rates));
    assert_eq!((min_slave_interval, t_dp_min, t_dp_max), (&known.min_slave_interval, &known.t_dp_min, &known.t_dp_max));
    assert_eq!((sync, freeze, max_diag), (&known.sync, &known.freeze, &known.max_diag));
    assert_eq!((t_base_dp, t_base_io, t_i_min), (&known.t_base_dp, &known.t_base_io, &known.t_i_min));
    assert_eq!((t_o_min, gap_min, functions_min), (&known.t_o_min, &known.gap_min, &known.functions_min));
    assert_eq!((t_pll_w_max, min_window), (&known.t_pll_w_max, &known.min_window));
    assert_eq!((steps_per_rev, revolutions), (&known.steps_per_rev, &known.revolutions));
    assert_eq!((publisher, subscriber, dxb), (&known.publisher, &known.subscriber, &known.dxb));
    assert_eq!((max_prm, fail_safe, acyclic), (&known.max_prm, &known.fail_safe, &known.acyclic));
    assert_eq!((c1, c2, ms2_connections), (&known.c1, &known.c2, &known.ms2_connections));
    assert_eq!((wd_base_1ms, isochronous), (&known.wd_base_1ms, &known.isochronous));
    assert_eq!(isochronous_required, &known.isochronous_required);
    assert!(source.contains("test.gsd"), "where it comes from is its own: {source}");
}

#[test]
fn the_shipped_files_are_the_built_in_devices() {
    for (file, name) in FILES {
        let gsd = parse(&shipped(file));
        assert_eq!(gsd.findings(), [], "{file}");
        assert_same(&profile(&gsd), profile::find(name).expect("a built-in device"));
    }
}

#[test]
fn a_network_from_gsd_files_has_the_fingerprint_of_the_built_in_one() {
    for (file, name) in FILES {
        let path = format!("gsd/{file}");
        let keys: Vec<_> =
            (3..=10).map(|slave| (format!("slave.{slave}.device"), format!("slave.{slave}.device.gsd"))).collect();
        let short = ("run.duration", "2 s");
        let known: Vec<_> = keys.iter().map(|(key, _)| (key.as_str(), name)).chain([short]).collect();
        let read: Vec<_> = keys.iter().map(|(_, key)| (key.as_str(), path.as_str())).chain([short]).collect();
        let (known, read) = (scenario("reference", &known), scenario("reference", &read));
        for (a, b) in known.slaves.iter().zip(&read.slaves) {
            assert_eq!(build::set_prm(&known, a), build::set_prm(&read, b));
        }
        assert!(read.slaves[0].device.source.contains(file));
        let (known, read) = (Run::of(&known), Run::of(&read));
        assert_eq!((known.fingerprint, known.stations), (read.fingerprint, read.stations), "{file}");
    }
}

/// Shipped scenarios that have their test here.
pub(crate) const TESTS: &[(&str, fn())] = &[("gsd-device", gsd_device)];

#[test]
fn gsd_device() {
    let network = scenario("gsd-device", &[]);
    let run = Run::of(&network);
    // One after the other, and each in as many cycles.
    let from_clock = |slave| {
        let phases = run.phases_of(slave);
        let (_, first) = phases[0];
        phases.into_iter().map(move |(phase, cycle)| (phase, cycle - first)).collect::<Vec<_>>()
    };
    assert_eq!(from_clock(3), from_clock(4));
    for slave in 3..=5 {
        assert_eq!(run.phases_of(slave).last().map(|phase| phase.0), Some(Phase::Operation));
        assert_eq!(run.faults_of(slave), []);
    }
    let positions = |slave| -> Vec<u32> {
        run.slave(slave).filter(|row| (100..290).contains(&row.cycle)).map(|row| row.xist2).collect()
    };
    for (a, b) in positions(3).into_iter().zip(positions(4)) {
        let apart = a.wrapping_sub(b) % (1 << 25);
        assert!(apart <= 1 || apart == (1 << 25) - 1, "{a} {b}");
    }
    let scaled = positions(5);
    assert!(scaled.windows(2).all(|pair| (1..=3).contains(&((pair[0] + 12_800 - pair[1]) % 12_800))), "{scaled:?}");
    assert!(scaled.iter().all(|&position| position < 12_800) && scaled.windows(2).any(|pair| pair[1] > pair[0]));
}

/// One GSD device at address 3; `more` are further lines of the scenario.
fn scene(gsd: &str, device: &str, more: &str) -> (Room, String) {
    let room = Room::new();
    room.write("test.GSE", gsd);
    let text = format!(
        "[run]\ncycles = 300\n[bus]\nrate = \"12 Mbit/s\"\n[master]\naddress = 2\nt_dp = \"2 ms\"\nt_i = \"375 us\"\nt_o = \"1 ms\"\n\
         [[slave]]\naddress = 3\ndevice = {device}\n{more}"
    );
    room.write("one.toml", &text);
    (room, text)
}
fn load(gsd: &str, device: &str, more: &str) -> Result<Scenario, String> {
    let (room, _) = scene(gsd, device, more);
    let error = |error: isodp::study::scenario::ScenarioError| {
        error
            .to_string()
            .replace(&format!("{}/", room.path("").display()), "")
            .replace(&room.path("").display().to_string(), "")
    };
    Scenario::load(&room.path("one.toml"), &[]).map_err(error)
}
const DEVICE: &str = "{ gsd = \"test.GSE\" }";

#[test]
fn named_parameters_fill_the_octets_of_set_prm() {
    let named = "[slave.prm]\n\"code sequence\" = \"CCW\"\n\"Scaling, preset, counting direction\" = 1\n\
                 \"Measuring units per revolution\" = 100\n\"Total measuring range\" = 12800\n\
                 \"Maximum failures master's sign of life\" = 7\n";
    let own =
        "code_sequence = \"ccw\"\nscaling = { units_per_rev = 100, total_range = 12800 }\nmax_life_failures = 7\n";
    let [named, own, built_in] = [(DEVICE, named), (DEVICE, own), ("\"posital-ocd-dpb1b\"", own)]
        .map(|(device, more)| load(&text(), device, more).unwrap_or_else(|error| panic!("{error}")));
    let octets = build::set_prm(&named, &named.slaves[0]);
    assert_eq!(octets[10..24], [0x15, 0x81, 0, 0, 0x0B, 0, 0, 0, 100, 0, 0, 0x32, 0, 7]);
    for other in [&own, &built_in] {
        assert_eq!(build::set_prm(other, &other.slaves[0]), octets);
    }
    let slave = &named.slaves[0];
    assert_eq!((slave.code_sequence, slave.functions, slave.max_life_failures), (CodeSequence::Ccw, true, 7));
    assert_eq!(slave.scaling, Some(Scaling { units_per_rev: 100, total_range: 12_800 }));
}

#[test]
fn what_a_slave_with_a_gsd_file_cannot_have() {
    let module = "module = \"Telegram 81\"";
    let table = [
        ("device = { gsd = \"nothing.gsd\" }", "nothing.gsd: there is no such file"),
        ("device = { gsd = 5 }", "slave.3.device.gsd: this is a number"),
        ("device = { gsd = \".\" }", "this is a directory"),
        ("device = { modul = \"x\" }", "did you mean \"module\"?"),
        (
            "device = { gsd = \"test.GSE\", module = \"81\" }",
            "slave.3.device.module: the GSD file has no module \"81\"",
        ),
        ("prm = { \"Code sequenze\" = \"cw\" }", "did you mean \"Code sequence\"?"),
        ("prm = { \"Code sequence\" = \"left\" }", "known here: ccw, cw"),
        ("prm = { \"Code sequence\" = 2 }", "\"Code sequence\" = 2 does not fit into its octets"),
        ("prm = { \"Code sequence\" = true }", "write a number, or one of the parameter's texts"),
        ("prm = { \"Measuring units per revolution\" = 0 }", "help: 1 to 8192"),
        ("prm = { \"Measuring units per revolution\" = \"many\" }", "\"Measuring units per revolution\" has no texts"),
        ("prm = { \"Code sequence\" = 1, \"code sequence\" = 0 }", "another parameter sets the octets of"),
        ("prm = { \"Code sequence\" = 0 }\ncode_sequence = \"cw\"", "leave out code_sequence, or leave out"),
        (
            "prm = { \"Scaling function\" = 1 }\nscaling = { units_per_rev = 1, total_range = 1 }",
            "and scaling of this slave",
        ),
        (
            "prm = { \"Total measuring range\" = 1 }\nscaling = { units_per_rev = 1, total_range = 1 }",
            "octet 20 of Set_Prm",
        ),
        ("prm = { \"Maximum failures master's sign of life\" = 1 }\nmax_life_failures = 1", "and max_life_failures of"),
        ("prm = { \"Code sequence\" = \"ccw\" }", "has no effect in slave 3"),
        ("prm = 5", "write prm = { ... }"),
    ];
    for (line, expected) in table {
        let (device, more) = match line.strip_prefix("device = ") {
            Some(device) => (device, ""),
            None => (DEVICE, line),
        };
        let error = load(&text(), device, more).err().unwrap_or_else(|| panic!("{line} is good?"));
        assert!(error.contains(expected), "{line}\n{error}");
    }
    let error = load(&text(), "\"posital-ocd-dpb1b\"", "prm = { x = 1 }").expect_err("not built in");
    assert!(error.contains("only a device from a GSD file has named user parameters"), "{error}");
    assert!(load(&text(), &format!("{{ gsd = \"test.GSE\", {module} }}"), "").is_ok());
}

#[test]
fn the_rules_of_the_bus_take_the_files_numbers() {
    let read = "[[event]]\ncycle = 200\ndo = \"read-parameter\"\nslave = 3\nparameter = 918\n";
    let table = [
        ("12M_supp                 = 1", "12M_supp = 0", "", "slave 3 does not work at 12 Mbit/s"),
        ("MaxTsdr_12M              = 800", "MaxTsdr_12M = 900", "", "slave 3 may take MaxTsdr = 900"),
        ("Min_Slave_Intervall      = 1 ", "Min_Slave_Intervall = 25 ", "", "Min_Slave_Interval = 2.5 ms"),
        ("TDP_MIN                  = 4", "TDP_MIN = 20", "", "T_DP is 2.5 ms to 32 ms"),
        ("TBASE_DP                 = 1500", "TBASE_DP = 12000", "", "4 ms to 32 ms"),
        ("TI_MIN                   = 1", "TI_MIN = 4", "", "T_I >= 500 us"),
        ("T_PLL_W_MAX              = 240", "T_PLL_W_MAX = 6", "", "T_PLL_W is 83.333 ns to 500 ns"),
        (
            "Max_User_Prm_Data_Len      = 52",
            "Max_User_Prm_Data_Len = 51",
            "",
            "takes 51 octets (GSD: Max_User_Prm_Data_Len)",
        ),
        ("C1_Read_Write_supp       = 1", "C1_Read_Write_supp = 0", read, "slave 3 takes no acyclic requests"),
    ];
    for (from, to, more, expected) in table {
        let error = load(&with(from, to), DEVICE, more).err().unwrap_or_else(|| panic!("{to} is good?"));
        let error = error.replace('\n', " ");
        assert!(
            error.contains(expected) || expected.starts_with("slave 3 may") && error.contains("MaxTsdr = 900 tbit"),
            "{to}\n{error}"
        );
    }
    assert!(load(&text(), DEVICE, read).is_ok());
}

/// The configuration tool sets watchdog base, Publisher_Enable and its like; alarms are the file's.
#[test]
fn the_tool_has_the_last_word_on_dpv1_status() {
    let gsd = with("0x00,0x00,0x08, \\", "0x27,0xFD,0xFF, \\");
    let network = load(&gsd, DEVICE, "").unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(build::set_prm(&network, &network.slaves[0])[7..10], [0xC0, 0xFD, 0x1F]);
    assert_eq!(Run::of(&network).phases_of(3).last().map(|phase| phase.0), Some(Phase::Operation));
}

/// A device without isochronous mode is polled in the isochronous cycle, and has no part in the clock.
#[test]
fn a_device_without_isochronous_mode_runs_freely_among_isochronous_ones() {
    let gsd = with("Isochron_Mode_supp       = 1", "Isochron_Mode_supp = 0");
    assert!(parse(&gsd).to_string().contains("can be simulated as an encoder without isochronous mode"));
    let other =
        "motion = { kind = \"speed\", speed = \"60 rpm\" }\n[[slave]]\naddress = 4\ndevice = \"posital-ocd-dpb1b\"\n";
    let network = load(&gsd, DEVICE, other).unwrap_or_else(|error| panic!("{error}"));
    assert!(!network.is_clocked(&network.slaves[0]) && network.is_clocked(&network.slaves[1]));
    let [free, clocked] = [0, 1].map(|slave| build::set_prm(&network, &network.slaves[slave]));
    // DPV1_Enable and Fail_Safe, no IsoM_Req, no group of the clock, no block of isochronous mode.
    assert_eq!((free[6..10].to_vec(), free.len()), (vec![0, 0xC0, 0, 0x08], 10 + 21));
    assert_eq!((clocked[6..10].to_vec(), clocked.len()), (vec![0x80, 0xC0, 0, 0x18], 59));
    let run = Run::of(&network);
    assert_eq!(run.phases_of(4).last().map(|phase| phase.0), Some(Phase::Operation));
    assert_eq!((run.phases_of(3), run.faults_of(3)), (vec![], vec![]), "its phases never begin");
    assert_eq!(run.counts_of(3).state, isodp::observation::SlaveState::DataExch);
    let rows: Vec<_> = run.slave(3).filter(|row| row.cycle > 100).map(|row| row.xist1).collect();
    assert!(rows.windows(2).all(|pair| pair[0] != pair[1]), "its position is that of each request: {rows:?}");
    // Its times are none, and the rules of isochronous mode are not about it.
    let error = load(&gsd, DEVICE, "t_i = \"125 us\"\n").expect_err("no T_I");
    assert!(error.contains("slave.3.t_i: this device has no isochronous mode"), "{error}");
    let broken = gsd
        .replace("TBASE_DP                 = 1500", "TBASE_DP = 0")
        .replace("TDP_MIN                  = 4", "TDP_MIN = 99");
    assert!(load(&broken, DEVICE, other).is_ok());
    let (room, _) = scene(&gsd, DEVICE, other);
    for arguments in [&["plan", "one.toml"][..], &["plan", "one.toml", "--propose"], &["run", "one.toml"]] {
        let output = room.call(arguments);
        let text = |octets: &[u8]| String::from_utf8_lossy(octets).into_owned();
        assert_eq!(output.status.code(), Some(0), "{arguments:?}\n{}\n{}", text(&output.stdout), text(&output.stderr));
    }
}

#[test]
fn a_device_that_requires_isochronous_mode_has_a_master_with_synch() {
    let gsd = with("Isochron_Mode_required   = 0", "Isochron_Mode_required = 1");
    let further = "[[slave]]\naddress = 4\ndevice = \"posital-ocd-dpb1b\"\n[[class1]]\naddress = 7\n";
    assert!(load(&gsd, DEVICE, further).is_ok());
    let error = load(&gsd, DEVICE, &format!("master = 7\n{further}")).expect_err("free-running");
    assert!(
        error.contains("slave.3.master: slave 3 works only in isochronous mode, and its master 7 sends no SYNCH")
            && error.contains("isodp-posital") | error.contains("Isochron_Mode_required"),
        "{error}"
    );
    assert!(load(&text(), DEVICE, &format!("master = 7\n{further}")).is_ok(), "the other encoder can do without");
}

/// 25 ms are 25 steps of 1 ms: octet 8 bit 2.
#[test]
fn a_watchdog_in_steps_of_1_ms_needs_slaves_that_have_them() {
    let off = "crystal = \"0 ppm\"\n[[event]]\ncycle = 200\ndo = \"power-off\"\nstation = 2\n";
    let (room, text) = scene(&self::text(), DEVICE, off);
    let watchdog =
        |ms: &str| [("master.watchdog".to_owned(), ms.to_owned()), ("run.duration".to_owned(), "1 s".to_owned())];
    let network = Scenario::load(&room.path("one.toml"), &watchdog("25 ms")).unwrap_or_else(|error| panic!("{error}"));
    let prm = build::set_prm(&network, &network.slaves[0]);
    assert_eq!((prm[1], prm[2], prm[7]), (25, 1, 0xC4));
    let run = Run::of(&network);
    let mut asked = run.telegrams.iter().filter(|(.., octets)| {
        matches!(isodp::wire::Telegram::parse(octets), Ok(isodp::wire::Telegram::Data { header, .. }) if header.da.get() == 3 && header.sa.get() == 2)
    });
    let (_, last, ..) = asked.next_back().expect("a request");
    let expired = run.observations.iter().find_map(|(at, who, what)| match what {
        Observation::SlaveState { cause: isodp::observation::SlaveCause::Watchdog, .. } if who.get() == 3 => Some(*at),
        _ => None,
    });
    let took = expired.expect("the watchdog expires") - *last;
    assert!((took - Span::from_ms(25)).ticks().abs() <= 1, "{took}");
    assert_eq!(
        build::set_prm(&Scenario::load(&room.path("one.toml"), &watchdog("30 ms")).expect("good"), &network.slaves[0])
            [7],
        0xC0
    );

    let coarse = with("WD_Base_1ms_supp         = 1", "WD_Base_1ms_supp = 0");
    room.write("test.GSE", &coarse);
    let error = Scenario::load(&room.path("one.toml"), &watchdog("25 ms")).expect_err("too fine").to_string();
    assert!(
        error.contains("master.watchdog: a watchdog of 25 ms is too fine for slave 3")
            && error.contains("the next is watchdog = \"30 ms\""),
        "{error}"
    );
    assert!(Scenario::load(&room.path("one.toml"), &watchdog("30 ms")).is_ok());
    let proposed = room.call(&["plan", "one.toml", "--propose", "--set", "master.watchdog=25 ms"]).stdout;
    let proposed = String::from_utf8(proposed).expect("a text");
    assert!(proposed.contains("watchdog = \"200 ms\""), "{proposed}");
    // Another master's watchdog is about its own slaves.
    let other = "[[slave]]\naddress = 4\nmaster = 7\ndevice = { gsd = \"test.GSE\" }\n[[class1]]\naddress = 7\nwatchdog = \"25 ms\"\n";
    room.write("two.toml", text + other);
    let error = Scenario::load(&room.path("two.toml"), &[]).expect_err("too fine").to_string();
    assert!(error.contains("class1.1.watchdog: a watchdog of 25 ms is too fine for slave 4"), "{error}");
}

#[test]
fn a_device_without_publisher_function_has_no_subscribers() {
    let more = "[[slave]]\naddress = 4\ndevice = \"subscriber-drive\"\n[[link]]\npublisher = 3\nsubscriber = 4\n";
    assert!(load(&text(), DEVICE, more).is_ok());
    let error =
        load(&with("Publisher_supp           = 1", "Publisher_supp = 0"), DEVICE, more).expect_err("no publisher");
    assert!(error.contains("link.1.publisher: slave 3 cannot publish"), "{error}");
}

/// A subscriber has user parameters of its own, which the model sends and does not read.
#[test]
fn a_subscriber_from_a_gsd_file_follows_a_publisher() {
    let gsd = with("Subscriber_supp          = 0", "Subscriber_supp = 1\nDXB_Max_Link_Count = 1");
    let gsd = gsd.replace("0xFD,0x00,0x51", "0xFD,0x01,0x23").replace("= 52", "= 100");
    let more =
        "[[slave]]\naddresses = \"4..5\"\ndevice = \"posital-ocd-dpb1b\"\n[[link]]\npublisher = 4\nsubscriber = 3\n";
    let network = load(&gsd, DEVICE, more).unwrap_or_else(|error| panic!("{error}"));
    assert!(network.slaves[0].device.subscriber);
    let prm = build::set_prm(&network, &network.slaves[0]);
    assert_eq!((prm[10..12].to_vec(), prm.len()), (vec![0x15, 0x81], 10 + 21 + 28 + 9));
    let run = Run::of(&network);
    let active = |what: &Observation| matches!(what, Observation::Link { to: LinkState::Active, .. });
    assert!(run.events_of(3).any(|row| active(&row.what)));
    assert_eq!(run.phases_of(3).last().map(|phase| phase.0), Some(Phase::Operation));

    let second = format!("{more}[[link]]\npublisher = 5\nsubscriber = 3\n");
    let error = load(&gsd, DEVICE, &second).expect_err("one link at most");
    assert!(error.contains("up to 1 links (GSD: DXB_Max_Link_Count)"), "{error}");
}

#[test]
fn a_device_that_the_model_cannot_simulate_is_refused_with_the_reason() {
    let telegram = "0xC3,0xC1,0xC5,0xFD,0x00,0x51";
    let table = [
        (
            "Isochron_Mode_supp       = 1\nIsochron_Mode_required   = 0",
            "Isochron_Mode_supp = 0\nIsochron_Mode_required = 1",
            "Isochron_Mode_required without Isochron_Mode_supp",
        ),
        ("Station_Type             = 0", "Station_Type = 1", "Station_Type = 1 is not a slave"),
        ("Ident_Number             = 0x06DF", "", "there is no Ident_Number"),
        ("TBASE_IO                 = 1500", "TBASE_IO = 1501", "TBASE_IO = 1501 is none of 375,"),
        ("TDP_MAX                  = 256", "TDP_MAX = 3", "TDP_MIN is more than TDP_MAX"),
        ("T_PLL_W_MAX              = 240", "T_PLL_W_MAX = 0", "T_PLL_W_MAX = 0 is no window"),
        (telegram, "0xC3,0xC1,0xC5,0xFD,0x00,0x50", "no module is telegram 81"),
        (telegram, "0x70", "no module is telegram 81"),
        ("0x15,0x81", "0x16,0x81", "the preset user parameters are no blocks"),
        ("0x15,0x81", "0x15,0x04", "begins a block of 21 octets: IsoM parameters"),
        ("Bit(0) 0 0-1", "Bit(0) 2 0-1", "\"Code sequence\" = 2 does not fit into its octets"),
    ];
    for (from, to, expected) in table {
        let gsd = parse(&with(from, to));
        let fault = gsd.device(None).expect_err(to);
        assert!(fault.message.contains(expected), "{to}: {fault:?}");
        assert!(gsd.to_string().contains(expected), "{to}: {gsd}");
    }
    let two = with("EndModule", "EndModule\nModule = \"Other\" 0x70\n2\nEndModule");
    assert_eq!(profile(&parse(&two)).config[..], [0xC3, 0xC1, 0xC5, 0xFD, 0x00, 0x51]);
    let fault = parse(&two).device(Some("other")).expect_err("another module");
    assert!(fault.message.contains("is not telegram 81: 70") && fault.rule.contains("encoders with telegram 81"));
    let twice = with("EndModule", "EndModule\nModule = \"Twice\" 0xC3,0xC1,0xC5,0xFD,0x00,0x51\n2\nEndModule");
    let fault = parse(&twice).device(None).expect_err("two of them");
    assert!(fault.message.contains("it is not clear which one is meant") && fault.help.contains("Telegram 81, Twice"));
    assert!(parse(&twice).device(Some(" twice ")).is_ok());
}

#[test]
fn what_does_not_fit_is_told_and_does_no_harm() {
    let table = [
        ("TDP_MIN                  = 4", "TDP_MIN = 3", "TDP_MIN x TBASE_DP = 3 x 1500 / 12 us is not within 500 us"),
        ("TDP_MAX                  = 256", "TDP_MAX = 257", "is not within 500 us to 32 ms"),
        ("TI_MIN                   = 1", "TI_MIN = 0", "TI_MIN = 0 is taken as 1 x TBASE_IO"),
        ("T_PLL_W_MAX              = 240", "", "there is no T_PLL_W_MAX; it is taken as 12, 1 us"),
        ("MaxTsdr_3M               = 250", "", "there is no MaxTsdr_3M; it is taken as 250 tbit"),
        ("MaxTsdr_3M               = 250", "MaxTsdr_3M = 5", "MaxTsdr_3M = 5 is not within 11 to 1023"),
        ("DPV1_Slave               = 1", "DPV1_Slave = 0", "isochronous mode without DPV1_Slave"),
        ("Max_Input_Len            = 12", "Max_Input_Len = 11", "has 12 octets, more than Max_Input_Len"),
        ("Max_User_Prm_Data_Len      = 52", "Max_User_Prm_Data_Len = 40", "the isochronous block are 52 octets"),
        ("Fail_Safe                = 1", "Fail_Safe = 1\nfail_safe = 1", "Fail_Safe was there before"),
    ];
    for (from, to, expected) in table {
        let gsd = parse(&with(from, to));
        let found = gsd.findings();
        assert!(found.len() == 1 && found[0].message.contains(expected) && !found[0].refuses, "{to}: {found:?}");
        assert!(gsd.device(None).is_ok() && gsd.to_string().contains(expected), "{to}: {gsd}");
    }
    assert_eq!(profile(&parse(&with("TDP_MIN                  = 4", "TDP_MIN = 1"))).t_dp_min, Span::from_us(500));
}

/// The same file, written as other editors and other people would.
#[test]
fn the_way_of_writing_changes_nothing() {
    let plain = parse(&text());
    let joined = text().replace("\\\n", "");
    let ways = [
        text().replace('\n', "\r\n"),
        text().replace('\n', "\r"),
        text().to_lowercase().replace("0x", "0X"),
        text().to_uppercase().replace("0X", "0x"),
        joined,
        text().replace('=', " =  \\\n\t"),
        format!("any text\n\u{FEFF}\n{}\n\n", text().replace("#Profibus_DP", "  #PROFIBUS_DP  ; begins")),
        format!("{}\x1A\0\0", text()),
        text().replace("; comment", ";"),
    ];
    for way in ways {
        let other = parse(&way);
        let [a, b] = [&plain, &other].map(profile);
        assert_eq!(a, Profile { title: a.title.clone(), ..b.clone() }, "{way}");
        assert!(a.title.eq_ignore_ascii_case(&b.title));
        assert_eq!(plain.user_prm(None).expect("good").octets(), other.user_prm(None).expect("good").octets());
    }
    let mut latin = with("Revision                 = \"isodp 1\"", "Revision = \"f@r 5 @s\"").into_bytes();
    for octet in latin.iter_mut().filter(|octet| **octet == b'@') {
        *octet = 0xB5;
    }
    let gsd = Gsd::parse("test.gsg", &latin).expect("Latin-1");
    assert!(gsd.to_string().contains("f\u{B5}r 5 \u{B5}s"), "{gsd}");
}

/// Blocks without an effect, modules with numbers and areas, slots: all of it is passed over with its place.
#[test]
fn the_page_says_what_was_ignored() {
    let more = "EndModule\nModule = \"Empty\" 0x00\n2\nInfo_Text = \"x\"\nData_Area_Beg\nIO_Direction = 0\nData_Area_End\nEndModule\n\
                SlotDefinition\nSlot(1) = \"Position\" 1 1-2\nSlot(2) = \"Spare\" 2 1,2\nEndSlotDefinition\n\
                UnitDiagType = 1\nX_Unit_Diag_Bit(0) = \"a = b\"\nthis is anything\nEndUnitDiagType\n\
                Unit_Diag_Bit(0) = \"x\"\nUnit_Diag_Bit(1) = \"y\"\n24V Pins = 0";
    let gsd = parse(&with("EndModule", more));
    let page = gsd.to_string();
    for expected in [
        "Unit_Diag_Bit",
        " and 1 more",
        "24V Pins",
        "Prm_Block_Structure_req",
        "Set_Prm always comes in blocks",
        "nothing here depends on it",
        "UnitDiagType",
        "slot 1 Position: Telegram 81; allowed: Telegram 81, Empty",
    ] {
        assert!(page.contains(expected), "{expected}\n{page}");
    }
    let line = 1 + text().lines().position(|line| line.starts_with("TDP_MAX")).expect("a line");
    let row = page.lines().find(|row| row.starts_with("TDP_MAX")).expect("a row");
    assert!(row.contains("256") && row.contains("32 ms, longest T_DP") && row.ends_with(&line.to_string()), "{row}");
    assert_eq!(gsd.modules().collect::<Vec<_>>(), ["Telegram 81", "Empty"]);
}

/// Where a file is broken, the message says the line, the column and what to do.
#[test]
fn broken_files_are_told_with_their_place() {
    let table = [
        ("Vendor_Name              = \"POSITAL\"", "Vendor_Name = 5", "this is no text"),
        ("Vendor_Name              = \"POSITAL\"", "Vendor_Name =", "Vendor_Name has no value"),
        ("Ident_Number             = 0x06DF", "Ident_Number = \"06DF\"", "this is no whole number"),
        ("Ident_Number             = 0x06DF", "Ident_Number = 0x106DF", "67295 is out of range"),
        ("Ident_Number             = 0x06DF", "Ident_Number = 6DF", "this is no whole number"),
        ("MaxTsdr_12M              = 800", "MaxTsdr_12M = 1.5", "this is no whole number"),
        ("MaxTsdr_12M              = 800", "MaxTsdr_12M = 1,5", "this is not one whole number"),
        ("MaxTsdr_12M              = 800", "MaxTsdr_12M = -1", "-1 is out of range"),
        ("MaxTsdr_12M              = 800", "MaxTsdr_12M : 800", "this is no statement"),
        ("MaxTsdr_12M              = 800", "MaxTsdr_12M = \\ 800", "a backslash within a line"),
        ("= \"SAG\"", "", ""),
        ("Bit(0) 0 0-1", "Bit(8) 0 0-1", "an octet has the bits 0 to 7"),
        ("Bit(0) 0 0-1", "BitArea(3-1) 0 0-1", "no bits from 3 to 1"),
        ("Bit(0) 0 0-1", "Boolean 0 0-1", "there is no such data type"),
        ("Bit(0) 0 0-1", "Bit(0", "there is no such data type"),
        ("Bit(0) 0 0-1", "Bit(0) 0 0-1-2", "this is not one whole number"),
        ("Bit(0) 0 0-1", "", "a parameter without data type"),
        ("Unsigned8 1 0-255", "Unsigned8", "Unsigned8 has no value"),
        ("Text(1) = \"ccw\"", "Text(1) = ccw", "this is no text"),
        ("Text(1) = \"ccw\"", "Text(1) = \"ccw", "this text has no end"),
        ("Ext_User_Prm_Data_Ref(12)  = 5", "Ext_User_Prm_Data_Ref(12) = 55", "there is no ExtUserPrmData 55"),
        ("Ext_User_Prm_Data_Ref(12)  = 5", "Ext_User_Prm_Data_Ref = 5", "does not say where"),
        ("Ext_User_Prm_Data_Ref(12)  = 5", "Ext_User_Prm_Data_Ref(237) = 5", "do not fit into Set_Prm"),
        ("Ext_User_Prm_Data_Const(0)", "Ext_User_Prm_Data_Const(230)", "do not fit into Set_Prm"),
        ("0x15,0x81", "0x15,0x181", "385 is out of range"),
        ("0x15,0x81", "0x15,,0x81", "has no value"),
        ("\nEndModule", "", "Module without EndModule"),
        ("Module = \"Telegram 81\" 0xC3", "Module = 0xC3", "no name with its octets of Chk_Cfg"),
        ("EndModule", "EndModule\nSlotDefinition\nSlot(1) = \"x\" 9 1-3\nEndSlotDefinition", "there is no module 9"),
        ("EndModule", "EndModule\nSlotDefinition\nSlot(1) = \"x\"\nEndSlotDefinition", "no slot"),
    ];
    for (from, to, expected) in table.into_iter().filter(|row| !row.2.is_empty()) {
        let text = with(from, to);
        let problem = Gsd::parse("test.gsd", text.as_bytes()).expect_err(to);
        assert!(problem.fault.message.contains(expected), "{to}: {problem}");
        let position = problem.position.as_ref().unwrap_or_else(|| panic!("{to} has no place: {problem}"));
        assert!(problem.to_string().starts_with(&format!("test.gsd:{}:{}: ", position.line, position.column)));
        assert!(position.column <= position.text.chars().count().max(1), "{problem}");
    }
    for (octets, expected) in [
        (&b""[..], "there is no line #Profibus_DP"),
        (b"#Profibus_DP\n", "this file describes nothing"),
        (b"GSD_Revision = 3", "is this a GSD file for PROFIBUS DP?"),
        (b"\xFF\xFE#\0P\0", "this is no text: octet 00 in line 1"),
    ] {
        let problem = Gsd::parse("test.gsd", octets).expect_err(expected).to_string();
        assert!(problem.contains(expected), "{problem}");
    }
}

#[test]
fn the_program_shows_a_file_and_refuses_a_broken_one() {
    let room = Room::new();
    room.write("good.gsd", text());
    room.write("bad.gsg", with("TDP_MAX                  = 256", "TDP_MAX = many"));
    let call = |arguments: &[&str]| {
        let output = room.call(arguments);
        let text = |octets: Vec<u8>| String::from_utf8(octets).expect("a text");
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    let (code, page, _) = call(&["gsd", "good.gsd"]);
    assert_eq!(code, Some(0));
    assert!(page.contains("can be simulated as an encoder: device = { gsd = \"good.gsd\" }"), "{page}");
    // Inconsistent, but readable; what is merely missing or another device's is no fault of the file.
    for (from, to, expected) in [
        ("TDP_MIN                  = 4", "TDP_MIN = 3", 1),
        ("T_PLL_W_MAX              = 240", "T_PLL_W_MAX = 0", 1),
        ("Max_Input_Len            = 12", "Max_Input_Len = 11", 1),
        ("C1_Max_Data_Len          = 240", "C1_Max_Data_Len = 241", 1),
        ("C2_Max_Count_Channels    = 2", "C2_Max_Count_Channels = 50", 1),
        ("T_PLL_W_MAX              = 240", "", 0),
        ("C1_Response_Timeout      = 1000", "", 0),
        ("Station_Type             = 0", "Station_Type = 1", 0),
    ] {
        room.write("other.gsd", with(from, to));
        let (code, page, error) = call(&["gsd", "other.gsd"]);
        assert_eq!((code, error.as_str()), (Some(expected), ""), "{to}: {page}");
        let word = if expected == 1 { "error" } else { "note" };
        assert!(page.contains("does not fit") || page.contains(" what"), "{page}");
        assert!(page.lines().any(|line| line.split_whitespace().nth(1) == Some(word)), "{page}");
    }
    let (_, help, _) = call(&["gsd", "--help"]);
    assert!(help.contains("1 it is inconsistent"), "{help}");
    let (code, page, error) = call(&["gsd", "bad.gsg"]);
    assert_eq!((code, page.as_str()), (Some(2), ""));
    assert!(
        error.contains("bad.gsg:") && error.contains("TDP_MAX = many") && error.contains("this is no whole number"),
        "{error}"
    );
    let (code, _, error) = call(&["gsd", "none.gsd"]);
    assert!(code == Some(2) && error.contains("none.gsd: there is no such file"), "{error}");
    let (code, _, error) = call(&["gsd", "."]);
    assert!(code == Some(2) && error.contains("name one GSD file in it"), "{error}");
    let (_, help, _) = call(&["devices", "--help"]);
    assert!(help.contains("GSD") && help.contains("isodp gsd"), "{help}");
}

/// Asks for everything that a file can be asked for.
fn ask(octets: &[u8]) {
    match Gsd::parse("test.gsd", octets) {
        Ok(gsd) => {
            let page = gsd.to_string();
            assert!(page.contains("can be simulated") || page.contains("cannot be simulated") || !page.is_empty());
            let modules: Vec<_> = gsd.modules().take(3).map(str::to_owned).collect();
            for module in modules.iter().map(|name| Some(name.as_str())).chain([None]) {
                let (device, prm) = (gsd.device(module), gsd.user_prm(module));
                if let (Ok(device), Ok(prm)) = (device, prm) {
                    assert_eq!((device.inputs, device.outputs), (12, 4));
                    assert!(device.t_dp_min <= device.t_dp_max && device.t_i_min > Span::ZERO);
                    assert!(device.dp_grid() > Span::ZERO && prm.octets().len() <= 237);
                }
            }
        }
        Err(problem) => assert!(!problem.fault.message.is_empty() && !problem.to_string().is_empty()),
    }
}

/// Long files of one thing: read or refused, but in no time that grows with its square.
#[test]
fn long_files_take_no_longer_than_they_are() {
    let many = |count: usize, of: &dyn Fn(usize) -> String| (0..count).map(of).collect::<String>();
    let modules = |count| many(count, &|i| format!("Module = \"M{i}\" 0x10\n{i}\nEndModule\n"));
    let files = [
        many(60_000, &|i| format!("k{i} = 1\n")),
        many(60_000, &|_| "Fail_Safe = 1\n".to_owned()),
        many(60_000, &|_| "UnitDiagType = 1\n".to_owned()),
        many(20_000, &|i| format!("UnitDiagType = {i}\nEndUnitDiagType\n")),
        many(20_000, &|_| "Ext_User_Prm_Data_Ref(0) = 9\n".to_owned()),
        format!(
            "{}SlotDefinition\n{}EndSlotDefinition\n",
            modules(3_000),
            many(255, &|i| format!("Slot({i}) = \"s\" 1 0-65535\n"))
        ),
        modules(20_000),
        format!("Vendor_Name = \"{}\"\n", "x\\\n".repeat(100_000)),
        format!("Ext_User_Prm_Data_Const(0) = {}\n", "1,".repeat(200_000)),
        "(".repeat(400_000),
    ];
    for file in files {
        ask(format!("#Profibus_DP\n{file}").as_bytes());
    }
    let slots = |count| {
        let slots = many(count, &|i| format!("Slot({i}) = \"s\" 1 0-65535\n"));
        with("EndModule", &format!("EndModule\n{}SlotDefinition\n{slots}EndSlotDefinition\n", modules(3_000)))
    };
    let problem = Gsd::parse("test.gsd", slots(255).as_bytes()).expect_err("too many");
    assert!(problem.fault.message.contains("too many slots for too many modules"));
    let page = parse(&slots(2)).to_string();
    assert!(page.contains("...\n") && page.contains("and 2941 more"), "{page}");
}

#[test]
fn a_file_cut_off_anywhere_is_no_panic() {
    let text = text();
    let start = text.find("#Profibus_DP").expect("a start");
    let mut end = start;
    for line in text[start..].split_inclusive('\n') {
        ask(&text.as_bytes()[..end + line.len() / 2]);
        end += line.len();
        ask(&text.as_bytes()[..end]);
    }
}

/// What files are made of, and what they should not be made of.
const SCRAPS: [&str; 40] = [
    "=",
    "(",
    ")",
    ",",
    "-",
    "@",
    "\"",
    "\\",
    ";",
    "\n",
    "0",
    "255",
    "256",
    "65536",
    "4294967295",
    "4294967296",
    "-1",
    "0x",
    "0xFF",
    "1.5",
    "\"text\"",
    "Module",
    "EndModule",
    "PrmText",
    "EndPrmText",
    "ExtUserPrmData = 9 \"x\"\nSigned32 -5 -9-9\nEndExtUserPrmData\n",
    "Ext_User_Prm_Data_Ref(235) = 9\n",
    "Ext_User_Prm_Data_Ref(0)",
    "Text(1)",
    "SlotDefinition",
    "Bit(7)",
    "BitArea(0-7)",
    "Unsigned32",
    "Vendor_Name",
    "Max_User_Prm_Data_Len = 0\n",
    "Subscriber_supp = 1\n",
    "User_Prm_Data = 1,2,3\n",
    "TBASE_DP",
    "\u{B5}",
    "#Profibus_DP\n",
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_octets_are_no_panic(octets in prop::collection::vec(any::<u8>(), 0..400)) {
        ask(&octets);
        ask(&[b"#Profibus_DP\n", &octets[..]].concat());
    }

    #[test]
    fn changed_files_are_no_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), 0_usize..12, prop::sample::select(&SCRAPS[..])), 1..8),
    ) {
        let mut text = text().into_bytes();
        for (at, length, scrap) in changes {
            let at = at.index(text.len());
            let end = (at + length).min(text.len());
            text.splice(at..end, scrap.bytes());
        }
        ask(&text);
    }

    #[test]
    fn words_in_the_place_of_others_are_no_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>(), any::<bool>()), 1..6),
    ) {
        let text = text();
        let mut words: Vec<&str> = text[text.find("#Prof").expect("a start")..].split_inclusive([' ', '\n', ',', '(', ')']).collect();
        for (from, to, scrap) in changes {
            let word = if scrap { SCRAPS[from.index(SCRAPS.len())] } else { words[from.index(words.len())] };
            let to = to.index(words.len());
            words[to] = word;
        }
        ask(words.concat().as_bytes());
    }
}
