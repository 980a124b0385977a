//! Acyclic services in whole networks: MS1 of the master that parameterises, MS2 of class 2 masters beside it.

use isodp::observation::{
    AcyclicFailure, AcyclicResult, AcyclicService, ConnectionCause, ConnectionState, MasterClass, Observation,
};
use isodp::study::scenario::Scenario;
use isodp::time::{Span, Time};
use isodp::wire::acyclic::{AbortCode, ErrorCode};
use isodp::wire::{FrameControl, Sap, Service, Telegram};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use crate::support::{Run, address, scenario};

/// Shipped scenarios with their tests.
pub(crate) const TESTS: &[(&str, fn())] = &[("class2-beside", class_2_masters_beside)];

/// Three encoders at 12 Mbit/s with a T_DP of 1 ms.
const THREE: &str = r#"
    [bus]
    rate = "12 Mbit/s"
    hsa = 9
    [master]
    address = 2
    t_dp = "1 ms"
    t_i = "125 us"
    t_o = "500 us"
    [[slave]]
    addresses = "3..5"
    device = "posital-ocd-dpb1b"
"#;

fn network(ms: u32, more: &str, sets: &[(&str, &str)]) -> Scenario {
    let text = format!("{THREE}\n[run]\nduration = \"{ms} ms\"\n{more}");
    let sets: Vec<_> = sets.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
    Scenario::parse("acyclic", "acyclic.toml", &text, &sets).unwrap_or_else(|error| panic!("{error}"))
}
/// Instants and observations of one station that `pick` takes.
fn seen<T>(run: &Run, station: u8, pick: impl Fn(&Observation) -> Option<T>) -> Vec<(Time, T)> {
    let of_station = run.observations.iter().filter(|(_, who, _)| *who == address(station));
    of_station.filter_map(|(at, _, what)| Some((*at, pick(what)?))).collect()
}
fn failures(run: &Run, station: u8) -> Vec<(u8, AcyclicFailure)> {
    let failure = |what: &Observation| match *what {
        Observation::AcyclicFailed { slave, why } => Some((slave.get(), why)),
        _ => None,
    };
    seen(run, station, failure).into_iter().map(|(_, failure)| failure).collect()
}
fn connections(run: &Run, station: u8) -> Vec<(ConnectionState, ConnectionCause)> {
    let change = |what: &Observation| match *what {
        Observation::Connection { to, why, .. } => Some((to, why)),
        _ => None,
    };
    seen(run, station, change).into_iter().map(|(_, change)| change).collect()
}
fn values(run: &Run, station: u8) -> Vec<(u8, u16, u32)> {
    let value = |what: &Observation| match *what {
        Observation::ParameterValue { slave, pnu, value, .. } => Some((slave.get(), pnu, value)),
        _ => None,
    };
    seen(run, station, value).into_iter().map(|(_, value)| value).collect()
}
fn ended(run: &Run, class: MasterClass, result: AcyclicResult) -> u64 {
    run.counts.as_ref().expect("the run is over").acyclic.of(class).ended(result)
}

const OPENED: [(ConnectionState, ConnectionCause); 2] =
    [(ConnectionState::Opening, ConnectionCause::Initiated), (ConnectionState::Open, ConnectionCause::Confirmed)];

// ----- MS1

fn read(cycle: u64, slave: &str) -> String {
    format!("[[event]]\ncycle = {cycle}\ndo = \"read-parameter\"\nparameter = 918\nelements = 0\n{slave}\n")
}

#[test]
fn ms1_reads_and_what_is_refused_is_answered_all_the_same() {
    let change = "[[event]]\ncycle = 101\ndo = \"change-parameter\"\nparameter = 918\nvalue = 9\nslave = 4\n";
    let run = Run::of(&network(300, &[&read(100, "slaves = \"all\""), change].concat(), &[]));
    assert_eq!(values(&run, 2), [(3, 918, 3), (4, 918, 4), (5, 918, 5)]);
    let refused = |what: &Observation| match *what {
        Observation::ParameterError { slave, pnu, number, .. } => Some((slave.get(), pnu, number)),
        _ => None,
    };
    assert_eq!(seen(&run, 2, refused).len(), 1, "read-only");
    // Each request is written and its answer read.
    assert_eq!(ended(&run, MasterClass::One, AcyclicResult::Positive), 8);
}

#[test]
fn ms1_gives_a_slave_without_supply_up_after_c1_response_timeout() {
    let off = "[[event]]\ncycle = 100\ndo = \"power-off\"\nslave = 4\n";
    let more = [off, &read(101, "slave = 4"), &read(102, "slave = 3")].concat();
    let patient = [("master.ms1_timeout", "120 ms"), ("master.lost_after", "10000")];
    let run = Run::of(&network(400, &more, &patient));
    assert_eq!(failures(&run, 2), [(4, AcyclicFailure::Timeout)]);
    assert_eq!(values(&run, 2), [(3, 918, 3)], "and goes on with the next");
    let done = |what: &Observation| match *what {
        Observation::AcyclicDone { result: AcyclicResult::Timeout, took, .. } => Some(took),
        _ => None,
    };
    let took = seen(&run, 2, done)[0].1;
    assert!(took > Span::from_ms(120) && took < Span::from_ms(122), "{took}");

    let run = Run::of(&network(400, &more, &[("master.ms1_timeout", "120 ms")]));
    assert_eq!(failures(&run, 2), [(4, AcyclicFailure::Left)], "it left data exchange before");
}

/// A GSD file of an encoder with other acyclic services, and a scenario beside it with `more`.
fn from_gsd(changes: &[(&str, &str)], more: &str) -> (crate::cli::Room, Result<Scenario, String>) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/gsd/isodp_posital_06df.gsd");
    let mut gsd = std::fs::read_to_string(path).expect("a shipped file");
    for (keyword, value) in changes {
        let line = gsd.lines().find(|line| line.starts_with(keyword)).expect("a keyword").to_owned();
        gsd = gsd.replace(&line, &format!("{keyword} = {value}"));
    }
    let room = crate::cli::Room::new();
    room.write("encoder.gsd", gsd);
    let three = THREE.replace("\"posital-ocd-dpb1b\"", "{ gsd = \"encoder.gsd\" }");
    room.write("net.toml", format!("{three}\n[run]\nduration = \"900 ms\"\n{more}"));
    let scenario = Scenario::load(&room.path("net.toml"), &[]).map_err(|error| error.to_string());
    (room, scenario)
}
/// How long services of this class took that ended without an answer.
fn timed_out(run: &Run, station: u8) -> Vec<Span> {
    let took = |what: &Observation| match *what {
        Observation::AcyclicDone { result: AcyclicResult::Timeout, took, .. } => Some(took),
        _ => None,
    };
    seen(run, station, took).into_iter().map(|(_, took)| took).collect()
}

#[test]
fn each_slave_has_the_response_timeouts_of_its_gsd_file() {
    let off = "[[event]]\ncycle = 300\ndo = \"power-off\"\nslave = 4\n";
    let tool = "[[class2]]\naddress = 1\n[[class2.job]]\nservice = \"parameter-read\"\nparameter = 918\nslave = 4\n\
                start = \"400 ms\"\n";
    let more = [off, &read(301, "slave = 4"), tool].concat();
    let times = [("C1_Response_Timeout", "12"), ("C2_Response_Timeout", "7")];
    let patient = |scenario: Result<Scenario, String>, sets: Option<Span>| {
        let mut scenario = scenario.unwrap_or_else(|error| panic!("{error}"));
        scenario.master.lost_after = 10_000;
        scenario.master.ms1_timeout = sets;
        Run::of(&scenario)
    };
    let about = |took: &[Span], ms| took.len() == 1 && took[0] > Span::from_ms(ms) && took[0] < Span::from_ms(ms + 3);
    let (_room, scenario) = from_gsd(&times, &more);
    let run = patient(scenario.clone(), None);
    assert!(about(&timed_out(&run, 2), 120), "{:?}", timed_out(&run, 2));
    assert!(about(&timed_out(&run, 1), 70), "{:?}", timed_out(&run, 1));
    let run = patient(scenario.clone(), Some(Span::from_ms(50)));
    assert!(about(&timed_out(&run, 2), 50), "[master] ms1_timeout is for all");
    // A slave with another GSD file has another time.
    let (_room, mut scenario) = (0, scenario.expect("good"));
    scenario.slaves[1].device = isodp::device::profile::find("posital-ocd-dpb1b").expect("built in").into();
    assert_eq!(timed_out(&patient(Ok(scenario), None), 2), [], "10 s are not over");
}

#[test]
fn records_beyond_the_length_of_the_gsd_file_are_refused_and_warned_of() {
    let tool = "[[class2]]\naddress = 1\n[[class2.job]]\nservice = \"parameter-read\"\nparameter = 979\nelements = 11\n\
                slave = 5\nstart = \"300 ms\"\n[[class2.job]]\nservice = \"record-write\"\nindex = 47\nlength = 41\ndata = [1]\n\
                slave = 3\nstart = \"300 ms\"\n";
    let more = [&read(300, "slave = 3").replace("918", "979").replace("elements = 0", "elements = 11"), tool].concat();
    for (octets, refused) in [("50", 0), ("49", 1), ("40", 1)] {
        let lengths = [("C1_Max_Data_Len", octets), ("C2_Max_Data_Len", octets)];
        let (_room, scenario) = from_gsd(&lengths, &more);
        let scenario = scenario.unwrap_or_else(|error| panic!("{error}"));
        let warned = isodp::study::plan::rules::warnings(&scenario).join("\n");
        let run = Run::of(&scenario);
        let constraint = AcyclicFailure::Refused(ErrorCode::READ_CONSTRAINT);
        assert_eq!(failures(&run, 2), vec![(3, constraint); refused], "{octets}");
        let of_tool =
            |why| failures(&run, 1).iter().filter(|failure| failure.1 == AcyclicFailure::Refused(why)).count();
        assert_eq!(of_tool(ErrorCode::READ_CONSTRAINT), refused, "{octets}: {:?}", failures(&run, 1));
        assert_eq!(of_tool(ErrorCode::WRITE_LENGTH), usize::from(octets == "40"), "{octets}: {:?}", failures(&run, 1));
        assert_eq!(warned.contains("octets (GSD: C1_Max_Data_Len)"), refused == 1, "{warned}");
        assert_eq!(
            warned.contains("slave 5 refuses an acyclic request or answer of 50 octets"),
            refused == 1,
            "{warned}"
        );
        assert_eq!(
            warned.contains("slave 3 refuses an acyclic request or answer of 41 octets"),
            octets == "40",
            "{warned}"
        );
        // The Initiate response says it too: octet 2.
        let told = run.telegrams.iter().any(|(.., octets)| {
            matches!(Telegram::parse(octets), Ok(Telegram::Data { du: [0x57, max, ..], header }) if header.sa == address(5) && max.to_string() == lengths[1].1)
        });
        assert!(told, "{octets}");
    }
}

#[test]
fn a_gsd_file_has_the_number_of_ms2_connections() {
    let more = [reader(1, 3, 300), reader(7, 3, 320)].concat();
    let (_room, scenario) = from_gsd(&[("C2_Max_Count_Channels", "1")], &more);
    let run = Run::of(&scenario.unwrap_or_else(|error| panic!("{error}")));
    assert_eq!((connections(&run, 1), values(&run, 7)), (OPENED.to_vec(), vec![]));
    let (_room, scenario) = from_gsd(&[("C2_Read_Write_supp", "0")], &more);
    let error = scenario.expect_err("no MS2");
    assert!(error.contains("class2.1.job.1.slave: slave 3 takes no acyclic requests of class 2 masters"), "{error}");
    let diagnosis = more.replace("service = \"parameter-read\"\nparameter = 918", "service = \"diagnosis\"");
    assert!(from_gsd(&[("C2_Read_Write_supp", "0")], &diagnosis).1.is_ok(), "DP-V0 is for all");
}

#[test]
fn a_class_2_master_loses_its_supply_and_comes_back() {
    let off = "[[event]]\nat = \"500 ms\"\ndo = \"power-off\"\nstation = 1\n";
    let on = "[[event]]\nat = \"900 ms\"\ndo = \"power-on\"\nstation = 1\n";
    let run = Run::of(&network(4_000, &[&reader(1, 4, 300), off, on].concat(), &[]));
    let (gone, back) = (Time::ZERO + Span::from_ms(500), Time::ZERO + Span::from_ms(900));
    let sent = |from: Time, to: Time| {
        run.telegrams.iter().filter(|(at, _, who, _)| *who == address(1) && *at > from && *at < to).count()
    };
    let end = Time::ZERO + Span::from_s(4);
    assert!(sent(Time::ZERO, gone) > 20 && sent(gone + Span::from_ms(1), back) == 0 && sent(back, end) > 100);
    let read = |what: &Observation| matches!(what, Observation::ParameterValue { .. }).then_some(());
    let times: Vec<_> = seen(&run, 1, read).into_iter().map(|(at, ())| at).collect();
    assert!(
        times.iter().any(|at| *at < gone) && times.iter().filter(|at| **at > back + Span::from_ms(300)).count() > 5
    );
    assert_eq!(late(&run).len(), 0, "nobody else notices");
    let error = Scenario::parse(
        "x",
        "x.toml",
        &format!("{THREE}\n[run]\ncycles = 900\n{}", off.replace("= 1\n", "= 9\n")),
        &[],
    );
    assert!(error.expect_err("no station 9").to_string().contains("there is no station 9"));
}

#[test]
fn ms1_is_closed_outside_of_data_exchange() {
    // Slave 5 is the last to be parameterised.
    let run = Run::of(&network(200, &read(2, "slave = 5"), &[]));
    assert_eq!(failures(&run, 2), [(5, AcyclicFailure::Closed)]);
    // A bad Set_Prm, and a request before the slave is back.
    let bad = "[[event]]\ncycle = 100\ndo = \"set-prm\"\noctets = [[24, 0xFF], [49, 0]]\nslave = 3\n";
    let run = Run::of(&network(300, &[bad, &read(110, "slave = 3")].concat(), &[]));
    assert_eq!(failures(&run, 2), [(3, AcyclicFailure::Closed)]);
}

// ----- MS2

#[test]
fn ms2_reads_writes_idles_and_stays_open() {
    let more = r#"
        [[class2]]
        address = 1
        [[class2.job]]
        service = "parameter-read"
        parameters = [918, 979]
        slave = 4
        start = "300 ms"
        [[class2.job]]
        service = "record-read"
        index = 46
        slave = 4
        start = "400 ms"
        [[class2.job]]
        service = "record-write"
        slot = 2
        index = 47
        data = [1, 2]
        slave = 4
        start = "400 ms"
    "#;
    let run = Run::of(&network(4_000, more, &[]));
    assert_eq!(connections(&run, 1), OPENED);
    assert_eq!(connections(&run, 4), OPENED);
    let values = values(&run, 1);
    assert_eq!((values[0], values.len()), ((4, 918, 4), 1 + 11), "P979 has eleven elements");
    let refused = [(4, AcyclicFailure::Refused(ErrorCode::INDEX)), (4, AcyclicFailure::Refused(ErrorCode::SLOT))];
    assert_eq!(failures(&run, 1), refused);
    assert_eq!(ended(&run, MasterClass::Two, AcyclicResult::Positive), 4);
    assert_eq!(ended(&run, MasterClass::Two, AcyclicResult::Negative), 2);
    // From 0.4 s on there is nothing to do: one Idle each second, low priority, to the connection's SAP.
    let idle = run.telegrams.iter().filter(|(.., octets)| match Telegram::parse(octets) {
        Ok(Telegram::Data { header, du: [0x48, 0] }) => {
            let low = matches!(header.fc, FrameControl::Request { service: Service::SrdLow, .. });
            low && (header.da, header.dsap, header.ssap) == (address(4), Some(Sap(0)), Some(Sap::MASTER_MS2))
        }
        _ => false,
    });
    assert_eq!(idle.count(), 3);
}

fn reader(station: u8, slave: u8, start_ms: u32) -> String {
    format!(
        "[[class2]]\naddress = {station}\nresponse_timeout = \"500 ms\"\n[[class2.job]]\nservice = \"parameter-read\"\n\
         parameter = 918\nslave = {slave}\nstart = \"{start_ms} ms\"\nperiod = \"100 ms\"\n"
    )
}

/// A tool that reads a parameter of all three slaves all the time, and what is warned of it.
fn reads_all(timeout_ms: u32, per_token: u8, sets: &[(&str, &str)]) -> (Run, String) {
    let more = format!(
        "[[class2]]\naddress = 1\nresponse_timeout = \"{timeout_ms} ms\"\nper_token = {per_token}\n[[class2.job]]\n\
         service = \"parameter-read\"\nparameter = 918\nslaves = \"all\"\nstart = \"600 ms\"\nperiod = \"1 us\"\n"
    );
    let scenario = network(1_600, &more, sets);
    let warned = isodp::study::plan::rules::warnings(&scenario).join("\n");
    (Run::of(&scenario), warned)
}

#[test]
fn a_response_timeout_shorter_than_a_turn_is_warned_of() {
    const WORDS: &str = "the class 2 master 1 may give a request up after";
    // Three slaves, a message with a token each 8 ms: a turn takes 24 ms. With two messages it takes 8 ms or 16 ms.
    let slow: &[(&str, &str)] = &[("master.t_dp", "8 ms"), ("bus.t_tr", "200000 tbit")];
    for (timeout, per_token, gives_up, reads) in
        [(20, 1, true, false), (30, 1, false, true), (10, 2, true, true), (20, 2, false, true), (10, 3, false, true)]
    {
        let (run, warned) = reads_all(timeout, per_token, slow);
        let (given_up, read) = (timed_out(&run, 1).len(), values(&run, 1).len());
        assert_eq!(warned.contains(WORDS), gives_up, "{timeout} ms, {per_token}: {warned}");
        assert_eq!((given_up > 0, read > 0), (gives_up, reads), "{timeout} ms, {per_token}: {given_up} {read}");
    }
    let (_, warned) = reads_all(20, 1, slow);
    assert_eq!(
        warned,
        "the class 2 master 1 may give a request up after 20 ms, before it has polled for the answer; C2_Response_Timeout > \
         3 x T_DP = 24 ms: 3 slaves take turns, 1 of them with each token (Model: all slaves busy); response_timeout = \
         \"30 ms\" or more, more messages per_token, or fewer slaves"
    );
    for name in crate::support::shipped() {
        let warned = isodp::study::plan::rules::warnings(&scenario(&name, &[])).join("\n");
        assert!(!warned.contains("may give a request up") && !warned.contains("over MS2"), "{name}: {warned}");
    }
}

#[test]
fn a_t_tr_that_leaves_no_time_for_ms2_is_warned_of() {
    // 8 ms are 96000 t_bit.
    for (t_tr, warns) in [("96000 tbit", true), ("120000 tbit", false)] {
        let (run, warned) = reads_all(100, 1, &[("master.t_dp", "8 ms"), ("bus.t_tr", t_tr)]);
        let words = "leaves the class 2 master 1 no time for any request over MS2; T_TR > T_DP = 96000 tbit: ";
        assert_eq!(warned.contains(words), warns, "{t_tr}: {warned}");
        assert_eq!((timed_out(&run, 1).len() > 5, values(&run, 1).is_empty()), (warns, warns), "{t_tr}");
    }
}

#[test]
fn ms2_two_masters_at_once_and_the_third_is_refused() {
    let more = [reader(1, 3, 300), reader(7, 3, 320), reader(8, 3, 340)].concat();
    let run = Run::of(&network(800, &more, &[]));
    for station in [1, 7] {
        assert_eq!(connections(&run, station), OPENED, "{station}");
        let values = values(&run, station);
        assert!(values.len() >= 4 && values.iter().all(|&value| value == (3, 918, 3)), "{station}: {values:?}");
        assert_eq!(failures(&run, station), []);
    }
    let refused = connections(&run, 8);
    assert!(refused.len() >= 8, "it tries again with each job");
    for pair in refused.chunks_exact(2) {
        assert_eq!(pair, [OPENED[0], (ConnectionState::Closed, ConnectionCause::Refused)]);
    }
    assert!(failures(&run, 8).iter().all(|&failure| failure == (3, AcyclicFailure::Closed)));
    assert_eq!(values(&run, 8), []);

    let run = Run::of(&network(800, &more, &[("slave.3.ms2_connections", "3")]));
    assert_eq!(connections(&run, 8), OPENED, "a device with three connections");
    let run = Run::of(&network(800, &more, &[("slave.3.ms2_connections", "0")]));
    assert_eq!(values(&run, 1), [], "a device without MS2");
}

#[test]
fn ms2_gives_a_slave_without_supply_up_and_comes_back() {
    let off = "[[event]]\nat = \"500 ms\"\ndo = \"power-off\"\nslave = 4\n";
    let on = "[[event]]\nat = \"1700 ms\"\ndo = \"power-on\"\nslave = 4\n";
    let run = Run::of(&network(2_500, &[reader(1, 4, 300), off.into(), on.into()].concat(), &[]));
    let changes = connections(&run, 1);
    let timeout = ConnectionCause::GaveUp(AbortCode::Timeout);
    assert_eq!(changes[..2], OPENED);
    assert_eq!(changes[2..4], [(ConnectionState::Aborting, timeout), (ConnectionState::Closed, ConnectionCause::Told)]);
    assert_eq!(changes[4..6], [OPENED[0], (ConnectionState::Closed, timeout)], "nobody to tell");
    assert_eq!(changes[changes.len() - 2..], OPENED);
    assert!(failures(&run, 1).iter().all(|&failure| failure == (4, AcyclicFailure::Timeout)));
    assert!(values(&run, 1).len() > 8);
}

#[test]
fn ms2_outlives_data_exchange() {
    let bad = "[[event]]\ncycle = 500\ndo = \"set-prm\"\noctets = [[24, 0xFF], [49, 0]]\nslave = 4\n";
    let run = Run::of(&network(1_500, &[&reader(1, 4, 300), bad].concat(), &[]));
    assert!(run.counts_of(4).state != isodp::observation::SlaveState::DataExch);
    assert_eq!(connections(&run, 1), OPENED);
    assert_eq!(failures(&run, 1), []);
    assert_eq!(values(&run, 1).len(), 12, "every 100 ms from 0.3 s on");
}

#[test]
fn the_reading_services_of_dp_v0_are_for_every_master() {
    let services = ["diagnosis", "rd-inp", "rd-outp", "get-cfg"];
    let job = |service| format!("[[class2.job]]\nservice = \"{service}\"\nslave = 5\nstart = \"300 ms\"\n");
    let more = ["[[class2]]\naddress = 1\n".to_owned()].into_iter().chain(services.map(job)).collect::<String>();
    let run = Run::of(&network(500, &more, &[]));
    let data = |what: &Observation| match *what {
        Observation::AcyclicData { slave, service, len, head, .. } => Some((slave, service, len, head)),
        _ => None,
    };
    let read: Vec<_> = seen(&run, 1, data).into_iter().map(|(_, data)| data).collect();
    let [diagnosis, inputs, outputs, config] = read[..] else { panic!("{read:?}") };
    assert_eq!(diagnosis, (address(5), AcyclicService::Diagnosis, 6, [0, 0x0C, 0, 2, 0x06, 0xDF, 0, 0]));
    assert_eq!((inputs.1, inputs.2), (AcyclicService::Inputs, 12));
    assert_eq!((outputs.1, outputs.2), (AcyclicService::Outputs, 4));
    assert!(inputs.3[0] >> 4 != 0 && outputs.3[0] >> 4 != 0, "both signs of life run");
    assert_eq!(config, (address(5), AcyclicService::Configuration, 6, [0xC3, 0xC1, 0xC5, 0xFD, 0, 0x51, 0, 0]));
    assert_eq!(connections(&run, 1), [], "no connection for that");
    let early = more.replace("300 ms", "1 ms");
    let run = Run::of(&network(500, &early, &[("slave.5.powered_at", "400 ms")]));
    assert!(failures(&run, 1).contains(&(5, AcyclicFailure::Timeout)), "nobody there");
}

// ----- the cycle

/// Late SYNCHs: when and by how much.
fn late(run: &Run) -> Vec<(Time, Span)> {
    let late = |what: &Observation| match *what {
        Observation::ClockLate { by } => Some(by),
        _ => None,
    };
    seen(run, 2, late)
}

#[test]
fn class_2_masters_beside() {
    let scenario = scenario("class2-beside", &[]);
    let run = Run::of(&scenario);
    let late = late(&run);
    assert_eq!(late.len(), 6, "each time that the tool at 7 writes");
    for (at, by) in late {
        assert!(at > Time::ZERO + Span::from_ms(2_500), "harmless until then: {by} late");
        assert!(by > Span::from_us(60) && by < Span::from_us(150), "{by}");
    }
    assert!(run.cycles.iter().filter_map(|row| row.t_dx).all(|t_dx| t_dx < Span::from_us(181)));
    for slave in 3..6 {
        let counts = run.counts_of(slave);
        assert_eq!((counts.clock_failures, counts.fault_count()), (6, 0), "slave {slave}");
        assert_eq!(connections(&run, slave).len(), 4, "both connections stay open");
    }
    assert_eq!(ended(&run, MasterClass::Two, AcyclicResult::Negative), 18);
    assert!(ended(&run, MasterClass::Two, AcyclicResult::Positive) > 1_500);
}

/// The shortest T_DP from `least` on that a network of `slaves` encoders has at this rate, plus `slack` steps.
///
/// Nothing that the first `lossy` slaves say reaches anybody in every other cycle: Data_Exchange
/// takes its repeats, and less is left.
fn busy(rate: &str, slaves: u8, slack: u32, reads: u32, lossy: u8) -> Scenario {
    let lost =
        |slave| format!("[[disturbance]]\nkind = \"lost-telegrams\"\nfrom = {slave}\ncycle = 70\nfor = 1\nevery = 2\n");
    let lost: String = (3..3 + lossy.min(slaves)).map(lost).collect();
    let events: String = (0..reads).map(|i| read(u64::from(60 + i), "slaves = \"all\"")).collect();
    let text = |steps: u32| {
        format!(
            "[run]\ncycles = 260\n[bus]\nrate = \"{rate}\"\nhsa = 20\n[master]\naddress = 2\nt_dp = \"{} us\"\n\
             t_i = \"125 us\"\nt_o = \"{} us\"\n[[slave]]\naddresses = \"3..{}\"\ndevice = \"posital-ocd-dpb1b\"\n{events}{lost}",
            steps * 125,
            steps * 125 - 250,
            slaves + 2
        )
    };
    let parse = |steps| Scenario::parse("busy", "busy.toml", &text(steps), &[]);
    let least = (4..256).find(|&steps| parse(steps).is_ok()).expect("a T_DP up to 32 ms");
    parse((least + slack).min(256)).expect("more time is no fault")
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, rng_seed: RngSeed::Fixed(6), failure_persistence: None, ..ProptestConfig::default() })]

    /// D6: what does not fit before the next SYNCH waits, however much there is to do.
    #[test]
    fn acyclic_traffic_of_a_single_master_never_delays_synch(
        rate in prop::sample::select(&["1.5 Mbit/s", "3 Mbit/s", "6 Mbit/s", "12 Mbit/s"][..]),
        slaves in 1u8..=8,
        slack in prop_oneof![0u32..5, 0u32..24],
        reads in 20u32..60,
        lossy in prop_oneof![Just(0u8), 1u8..=8],
    ) {
        let scenario = busy(rate, slaves, slack, reads, lossy);
        let run = Run::of(&scenario);
        for row in &run.cycles[..run.cycles.len() - 1] {
            prop_assert!(row.spare.is_none_or(|spare| spare >= Span::ZERO), "cycle {}: {:?}", row.cycle, row.spare);
        }
        // The shortest cycle has no time for the longest answer, 1.9 ms at 1.5 Mbit/s: that one waits for ever.
        let done = ended(&run, MasterClass::One, AcyclicResult::Positive);
        prop_assert!(if slack < 16 || lossy > 0 { done > 0 } else { done > 20 }, "{} services", done);
        // One message in each cycle at most.
        let mut asked = vec![0; run.cycles.len()];
        for (start, _, sender, octets) in &run.telegrams {
            let Ok(Telegram::Data { header, .. }) = Telegram::parse(octets) else { continue };
            let low = matches!(header.fc, FrameControl::Request { service: Service::SrdLow, .. });
            let cycle = run.cycles.partition_point(|row| row.t0 <= *start);
            if low && *sender == scenario.master.address && cycle > 0 {
                asked[cycle - 1] += 1;
            }
        }
        prop_assert_eq!(asked.iter().max(), Some(&1));
        // Repeats of Data_Exchange may take too long; then nothing else was sent in that cycle.
        let late = late(&run);
        prop_assert!(lossy > 0 || late.is_empty(), "{:?}", late);
        for (at, by) in late {
            let cycle = run.cycles.partition_point(|row| row.t0 <= at) - 1;
            prop_assert_eq!(asked[cycle], 0, "SYNCH {} late after a message in cycle {}", by, cycle);
        }
    }
}

// ----- the keys

#[test]
fn wrong_keys_are_told_with_what_to_do() {
    let class2 = |keys: &str| format!("[[class2]]\naddress = 1\n{keys}");
    let job = |keys: &str| class2(&format!("[[class2.job]]\n{keys}\n"));
    for (more, expected) in [
        ("[[class2]]\naddress = 2\n".to_owned(), "have the address 2"),
        ("[[class2]]\naddress = 4\n".to_owned(), "have the address 4"),
        ("[[class2]]\naddress = 60\n".to_owned(), "the address 60 is above hsa = 9"),
        (class2("position = \"1 m\""), "beyond the end of the cable"),
        (class2("response_timeout = \"15 ms\""), "in steps of 10 ms"),
        (class2("send_timeout = \"0 s\""), "is no response timeout"),
        (class2("per_token = 0"), "a whole number from 1 to 255"),
        (class2("jobs = 1"), "did you mean \"job\"?"),
        (class2("job = 1"), "write [[class2.job]]"),
        (job("service = \"rd-in\"\nslave = 3"), "did you mean \"rd-inp\"?"),
        (job("service = \"rd-inp\""), "this job needs either slave or slaves"),
        (job("service = \"rd-inp\"\nslave = 9"), "there is no slave 9"),
        (job("service = \"rd-inp\"\nslave = 3\nperiod = \"0 s\""), "a period is more than nothing"),
        (job("service = \"rd-inp\"\nslave = 3\nindex = 47"), "there is no such key"),
        (job("service = \"parameter-read\"\nslave = 3"), "either parameter or parameters"),
        (job("service = \"parameter-read\"\nslave = 3\nparameters = []"), "no list of parameter numbers"),
        (job("service = \"record-read\"\nslave = 3"), "index = 47"),
        (job("service = \"record-write\"\nslave = 3\nindex = 47\ndata = [256]"), "0 to 255"),
    ] {
        let text = format!("{THREE}\n[run]\ncycles = 10\n{more}");
        let error = Scenario::parse("wrong", "wrong.toml", &text, &[]).expect_err(&more).to_string();
        assert!(error.contains(expected), "{more}\n{error}");
    }
    let text = THREE.replace("t_dp =", "ms1_timeout = \"5 ms\"\nt_dp =") + "[run]\ncycles = 10\n";
    let error = Scenario::parse("wrong", "wrong.toml", &text, &[]).expect_err("5 ms").to_string();
    assert!(error.contains("C1_Response_Timeout"), "{error}");
}
