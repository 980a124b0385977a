//! The flight recorder: what it keeps, what it costs a result (nothing), and its files in foreign readers.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use isodp::device::node::Node;
use isodp::observation::Observation;
use isodp::sim::network::{Network, NetworkEvent};
use isodp::sim::queue::NearQueue;
use isodp::study::build;
use isodp::study::export::capture;
use isodp::study::flight::stretch::{Entry, Stretch, What};
use isodp::study::flight::trigger::Trigger;
use isodp::study::flight::{FlightRecorder, Recording};
use isodp::study::run::{run, until};
use isodp::study::scenario::{Flight, Scenario};
use isodp::time::{Span, Time};
use pcap_parser::traits::PcapReaderIterator;
use pcap_parser::{Block, OptionCode, PcapBlockOwned, PcapError, PcapNGReader};

use crate::cli::Room;
use crate::support::{Run, address, scenario};

/// A clock that is lost three times, and what the flight recorder keeps of it.
fn recording(name: &str, sets: &[(&str, &str)], settings: &Flight) -> (Scenario, Recording) {
    let scenario = scenario(name, sets);
    let mut network: Network<Node> = build::network(&scenario);
    let mut recorder = FlightRecorder::new(&scenario, settings);
    assert!(network.run(until(&scenario), u64::MAX, &mut recorder));
    let recording = recorder.finish(network.now());
    (scenario, recording)
}
/// Telegrams of a stretch as a run's log has them.
fn telegrams(stretch: &Stretch) -> Vec<(Time, Time, u8, Vec<u8>)> {
    let telegram = |entry: &Entry| match entry.what {
        What::Telegram { end, .. } => Some((entry.at, end, entry.station.get(), stretch.octets(entry).to_vec())),
        What::Seen(_) => None,
    };
    stretch.entries.iter().filter_map(telegram).collect()
}
/// Numbers of the first and last cycles of all stretches.
fn numbers(recording: &Recording) -> Vec<(u64, u64)> {
    recording.stretches.iter().map(Stretch::numbers).collect()
}
/// How often each trigger fired, and in no stretch.
fn tally(recording: &Recording, trigger: Trigger) -> (u64, u64) {
    let tally = recording.tallies.iter().find(|tally| tally.trigger == trigger).expect("a watched trigger");
    (tally.fired, tally.missed)
}

#[test]
fn recording_changes_nothing() {
    for name in ["gc-jitter-outside", "leds", "two-masters"] {
        let dir = tempfile::tempdir().expect("a directory");
        let network = scenario(name, &[("record.plots", "false"), ("record.flight.on", "true")]);
        let with = run::<NearQueue<NetworkEvent>>(&network, Some(dir.path()), |_| ()).expect("a run");
        assert!(with.summary.flight.as_ref().is_some_and(|line| line.contains("stretch")), "{name} has triggers");
        let off = scenario(name, &[("record.files", "false")]);
        let without = run::<NearQueue<NetworkEvent>>(&off, Some(dir.path()), |_| ()).expect("a run");
        assert_eq!((with.fingerprint, with.statistics), (without.fingerprint, without.statistics), "{name}");
        assert_eq!((with.stations, without.summary.flight), (without.stations, None), "{name}");
    }
}

#[test]
fn a_stretch_has_everything_of_its_cycles_and_nothing_else() {
    for name in ["gc-jitter-outside", "acknowledge", "two-masters", "auto-clear"] {
        let (scenario, recording) = recording(name, &[], &Flight::default());
        let run = Run::of(&scenario);
        assert!(!recording.stretches.is_empty(), "{name}");
        for stretch in &recording.stretches {
            let (first, last) = stretch.numbers();
            let t0 = |cycle| run.cycles.iter().find(|row| row.cycle == cycle).map(|row| row.t0);
            assert!(stretch.cycles.iter().all(|cycle| t0(cycle.number) == Some(cycle.t0)), "{name}");
            let within = |at: Time| (stretch.begin()..stretch.end).contains(&at);
            let mut sent: Vec<_> = run.telegrams.iter().filter(|(start, ..)| within(*start)).collect();
            sent.sort_by_key(|(start, ..)| *start);
            let sent: Vec<_> = sent.iter().map(|(s, e, by, octets)| (*s, *e, by.get(), octets.clone())).collect();
            assert_eq!(telegrams(stretch), sent, "{name}, cycles {first} to {last}");
            let observed = run.observations.iter().filter(|(at, ..)| within(*at));
            let kept = stretch.entries.iter().filter_map(|entry| match entry.what {
                What::Seen(what) => Some((entry.at, entry.station, what)),
                What::Telegram { .. } => None,
            });
            assert!(kept.eq(observed.copied()), "{name}, cycles {first} to {last}");
            // It begins with the SYNCH of its first cycle and ends before that of the next.
            let synch = |at: Time| run.telegrams.iter().any(|(s, _, _, octets)| *s == at && octets[9..11] == [0, 0x80]);
            let has_synch =
                |cycle: u64| t0(cycle).is_some_and(|t0| run.telegrams.iter().any(|(_, end, ..)| *end == t0));
            assert!(synch(stretch.begin()) || !has_synch(first), "{name}");
            assert!(stretch.triggers.iter().all(|fired| within(fired.at)), "{name}");
            let cycles = stretch.by_cycle().map(|(_, entries)| entries.len()).sum::<usize>();
            assert_eq!(cycles, stretch.entries.len(), "{name}: every line has a cycle");
        }
    }
}

#[test]
fn each_trigger_fires_where_it_should() {
    let usual = Flight::default();
    let of = |name: &str, sets: &[(&str, &str)], trigger| {
        let (scenario, recording) = recording(name, sets, &usual);
        let fired = recording.stretches.iter().flat_map(|stretch| &stretch.triggers);
        let cycles: Vec<u64> = fired.filter(|fired| fired.trigger == trigger).map(|fired| fired.cycle).collect();
        (Run::of(&scenario), tally(&recording, trigger), cycles)
    };
    for (name, trigger, code) in [("gc-loss", Trigger::Clock, 0x0F04), ("life-sign-loss", Trigger::Life, 0x0F02)] {
        let (run, (fired, missed), cycles) = of(name, &[], trigger);
        let faults = run.events.iter().filter(|row| row.what == Observation::Fault { code });
        let expected: Vec<u64> = faults.map(|row| row.cycle).collect();
        assert_eq!((fired, missed, cycles), (expected.len() as u64, 0, expected), "{name}");
    }
    let (run, (fired, _), cycles) = of("auto-clear", &[], Trigger::LostSlave);
    let lost = run.observations.iter().filter(|(.., what)| matches!(what, Observation::Lost { .. }));
    assert_eq!((fired, cycles.len()), (lost.count() as u64, 1));
    let (run, (fired, missed), cycles) = of("two-masters", &[], Trigger::Synch);
    let late = run.cycles.iter().filter(|row| row.synch_delay.is_some()).count() as u64;
    assert_eq!((fired, missed, cycles.len() as u64), (late, 0, late));
    let (run, (fired, _), cycles) = of("diagnosis", &[], Trigger::TDx);
    let longer = run.cycles.iter().filter(|row| cycles.contains(&row.cycle));
    let usual_t_dx = run.cycles.iter().filter_map(|row| row.t_dx).min().expect("cycles with data exchange");
    assert!(fired >= 1 && longer.clone().all(|row| row.t_dx > Some(usual_t_dx)), "{cycles:?}");
    // A network in which nothing happens.
    let (_, quiet) = recording("reference", &[("run.duration", "1 s")], &usual);
    assert!(quiet.stretches.is_empty() && quiet.tallies.iter().all(|tally| tally.fired == 0));
    assert_eq!(quiet.line(), "nothing happened that it watches for");
}

#[test]
fn stretches_are_as_long_and_as_many_as_they_may_be() {
    let network = "gc-jitter-outside";
    let (_, usual) = recording(network, &[], &Flight::default());
    let fired = tally(&usual, Trigger::Clock).0;
    assert!(usual.stretches.iter().all(|stretch| stretch.cycles.len() >= 11));
    let first = usual.stretches[0].triggers[0].cycle;
    assert_eq!(usual.stretches[0].numbers().0, first - 5);

    let narrow = Flight { before: 0, after: 0, ..Flight::default() };
    let (_, bare) = recording(network, &[], &narrow);
    assert_eq!(numbers(&bare)[0], (first, first));
    assert!(bare.stretches.iter().all(|stretch| stretch.cycles.len() == 1));

    let (_, one) = recording(network, &[], &Flight { captures: 1, ..Flight::default() });
    let kept = one.stretches[0].triggers.len() as u64;
    assert_eq!((one.stretches.len(), tally(&one, Trigger::Clock)), (1, (fired, fired - kept)));
    assert_eq!(telegrams(&one.stretches[0]), telegrams(&usual.stretches[0]));
    assert!(one.line().ends_with(&format!("; {} of them are in no stretch", fired - kept)), "{}", one.line());

    // A SYNCH that is late in every cycle makes stretches longer, but not without end, and leaves room for others.
    let late = [("bus.t_tr", "300000 tbit"), ("master.t_dp", "2 ms")];
    let settings = Flight { before: 1, after: 1, captures: 4, triggers: Trigger::ALL.to_vec() };
    let (_, busy) = recording("two-masters", &late[..1], &settings);
    let (fired, missed) = tally(&busy, Trigger::Synch);
    assert!(busy.stretches.iter().all(|stretch| stretch.cycles.len() <= FlightRecorder::LENGTHS * 3));
    assert!(busy.stretches.len() <= 2 && fired > missed, "half of all: {}", busy.line());
    let ends = busy.stretches.windows(2).all(|pair| pair[0].end <= pair[1].begin());
    assert!(ends, "stretches do not overlap");
}

#[test]
fn a_trace_has_every_telegram_and_marks_its_triggers() {
    let (_, recording) = recording("gc-jitter-outside", &[], &Flight::default());
    let text = isodp::study::trace::flight(&recording);
    let lines: Vec<&str> = text.lines().filter(|line| line.contains(" | ")).collect();
    let sent: Vec<_> = recording.stretches.iter().flat_map(telegrams).collect();
    assert_eq!(lines.len(), sent.len());
    for (line, (.., octets)) in lines.iter().zip(&sent) {
        let hex: Vec<String> = octets.iter().map(|octet| format!("{octet:02X}")).collect();
        assert!(line.ends_with(&format!("| {}", hex.join(" "))), "{line}");
    }
    let fired: usize = recording.stretches.iter().map(|stretch| stretch.triggers.len()).sum();
    assert_eq!(text.matches("fault 0F04   <== trigger 0F04\n").count(), fired);
    assert!(text.contains("gc-jitter-outside.toml --seed 1 --cycle "), "how to tell more:\n{text}");
}

/// The file of this name, as the recording's format writes it.
fn file(recording: &Recording, name: &str) -> Vec<u8> {
    let format = capture::FORMATS.iter().find(|format| format.file == name).expect("a format");
    let mut octets = Vec::new();
    (format.write)(recording, &mut octets).expect("a file in memory");
    octets
}

/// A packet of a pcapng file: its stamp (ns), its octets, its comments.
struct Packet {
    at_ns: u64,
    octets: Vec<u8>,
    comments: Vec<String>,
}

/// Link type, stamps per second, name of the interface, and the packets.
fn read_pcapng(octets: &[u8]) -> (i32, u64, String, Vec<Packet>) {
    let mut reader = PcapNGReader::new(65_536, octets).expect("a section");
    let (mut interface, mut packets) = (None, Vec::new());
    loop {
        match reader.next() {
            Ok((length, block)) => {
                match block {
                    PcapBlockOwned::NG(Block::InterfaceDescription(block)) => {
                        let name = block.options.iter().find(|option| option.code == OptionCode(2)).expect("if_name");
                        let name = name.as_str().expect("text").to_owned();
                        interface = Some((block.linktype.0, block.ts_resolution().expect("a resolution"), name));
                    }
                    PcapBlockOwned::NG(Block::EnhancedPacket(block)) => {
                        let comments = block.options.iter().filter(|option| option.code == OptionCode::Comment);
                        assert_eq!((block.if_id, block.caplen), (0, block.origlen));
                        packets.push(Packet {
                            at_ns: u64::from(block.ts_high) << 32 | u64::from(block.ts_low),
                            octets: block.data[..block.caplen as usize].to_vec(),
                            comments: comments.map(|option| option.as_str().expect("text").to_owned()).collect(),
                        });
                    }
                    _ => {}
                }
                reader.consume(length);
            }
            Err(PcapError::Eof) => break,
            Err(PcapError::Incomplete(_)) => reader.refill().expect("more of it"),
            Err(error) => panic!("{error}"),
        }
    }
    let (link, resolution, name) = interface.expect("an interface");
    (link, resolution, name, packets)
}

#[test]
fn another_reader_finds_every_telegram_in_the_pcapng_file() {
    for name in ["gc-loss", "two-masters", "leds"] {
        let (_, recording) = recording(name, &[], &Flight::default());
        let (link, resolution, interface, packets) = read_pcapng(&file(&recording, "flight.pcapng"));
        assert_eq!((link, resolution, interface), (147, 1_000_000_000, format!("isodp-{name}")));
        let sent: Vec<_> = recording.stretches.iter().flat_map(telegrams).collect();
        assert_eq!(packets.len(), sent.len());
        for (packet, (start, _, _, octets)) in packets.iter().zip(&sent) {
            assert_eq!(&packet.octets, octets);
            assert_eq!(packet.at_ns, start.since_zero().div_floor(Span::from_ns(1)) as u64);
        }
        let comments = || packets.iter().flat_map(|packet| &packet.comments);
        // A stretch in which every telegram was lost has no packet that could say something.
        let told = || recording.stretches.iter().filter(|stretch| !telegrams(stretch).is_empty());
        let fired: usize = told().map(|stretch| stretch.triggers.len()).sum();
        assert!(fired > 0);
        assert_eq!(comments().filter(|text| text.starts_with("TRIGGER ")).count(), fired, "{name}");
        assert_eq!(comments().filter(|text| text.starts_with("stretch ")).count(), told().count(), "{name}");
        let synch = |packet: &&Packet| packet.octets.len() == 13 && packet.octets[9..11] == [0, 0x80];
        let numbered = |packet: &Packet| packet.comments.iter().any(|text| text.starts_with("cycle "));
        assert!(packets.iter().filter(synch).filter(|packet| packet.octets[5] & 0x7F == 2).all(numbered), "{name}");
    }
}

/// Each variable of a VCD file by its path, with its changes: unit of time and text of the value.
fn read_vcd(octets: &[u8]) -> (Option<(u32, vcd::TimescaleUnit)>, BTreeMap<String, Vec<(u64, String)>>) {
    fn walk(items: &[vcd::ScopeItem], path: &str, found: &mut BTreeMap<vcd::IdCode, String>) {
        for item in items {
            match item {
                vcd::ScopeItem::Scope(scope) => walk(&scope.items, &format!("{path}{}.", scope.identifier), found),
                vcd::ScopeItem::Var(var) => {
                    found.insert(var.code, format!("{path}{}", var.reference));
                }
                _ => {}
            }
        }
    }
    let mut parser = vcd::Parser::new(octets);
    let header = parser.parse_header().expect("a header");
    let mut names = BTreeMap::new();
    walk(&header.items, "", &mut names);
    let mut changes: BTreeMap<String, Vec<(u64, String)>> =
        names.values().map(|name| (name.clone(), Vec::new())).collect();
    let (mut now, mut last) = (0, None);
    for command in parser {
        let (id, text) = match command.expect("a command") {
            vcd::Command::Timestamp(at) => {
                assert!(last.is_none_or(|last| last < at), "time goes on");
                (now, last) = (at, Some(at));
                continue;
            }
            vcd::Command::ChangeScalar(id, value) => (id, value.to_string()),
            vcd::Command::ChangeVector(id, value) => (id, value.to_string()),
            vcd::Command::ChangeReal(id, value) => (id, value.to_string()),
            vcd::Command::ChangeString(id, value) => (id, value),
            other => panic!("{other:?}"),
        };
        changes.get_mut(&names[&id]).expect("a variable").push((now, text));
    }
    (header.timescale, changes)
}
/// An instant in picoseconds, to the nearest.
fn ps(at: Time) -> u64 {
    (i128::from(at.since_zero().ticks()) * 1_000 + 6).div_euclid(12) as u64
}

#[test]
fn another_reader_finds_states_and_edges_in_the_vcd_file() {
    let (_, recording) = recording("gc-jitter-outside", &[], &Flight::default());
    let (scale, changes) = read_vcd(&file(&recording, "flight.vcd"));
    assert_eq!(scale, Some((1, vcd::TimescaleUnit::PS)));
    let value = |name: &str, at: u64| -> &str {
        let changes = &changes[name];
        let after = changes.partition_point(|(then, _)| *then <= at);
        after.checked_sub(1).map_or("", |before| changes[before].1.as_str())
    };
    let rises = |name: &str| -> Vec<u64> {
        let pairs = changes[name].windows(2).filter(|pair| (pair[0].1.as_str(), pair[1].1.as_str()) == ("0", "1"));
        pairs.map(|pair| pair[1].0).collect()
    };
    for stretch in &recording.stretches {
        let end = ps(stretch.end);
        assert_eq!((value("isodp.recorded", ps(stretch.begin())), value("isodp.recorded", end)), ("1", "0"));
        assert_eq!(value("isodp.master_2.mode", ps(stretch.begin())), "Operate");
        for fired in &stretch.triggers {
            let slave = format!("isodp.slave_{}", fired.station);
            let of = |name: &str, at: u64| value(&format!("{slave}.{name}"), at).to_owned();
            let at = ps(fired.at);
            assert_eq!(of("fault", at), format!("{:016b}", 0x0F04));
            assert_eq!(value("isodp.trigger", at), format!("0F04_of_{}", fired.station));
            assert_eq!(value("isodp.cycle", at), format!("{:064b}", fired.cycle));
        }
        for cycle in &stretch.cycles {
            assert_eq!(
                (value("isodp.bus.synch", ps(cycle.t0) - 1), value("isodp.bus.synch", ps(cycle.t0))),
                ("1", "0")
            );
        }
        for (start, last, by, _) in telegrams(stretch) {
            for at in [ps(start), ps(last) - 1] {
                assert_eq!((value("isodp.bus.busy", at), value("isodp.bus.sender", at)), ("1", &*format!("{by:07b}")));
            }
            assert_eq!((value("isodp.bus.busy", ps(last)), value("isodp.bus.sender", ps(last))), ("0", "zzzzzzz"));
        }
    }
    // Every change of state, where it is not followed by another one at once.
    let mut states = BTreeMap::new();
    for entry in recording.stretches.iter().flat_map(|stretch| &stretch.entries) {
        let (name, word) = match entry.what {
            What::Seen(Observation::Pll { to, .. }) => ("pll", to.text()),
            What::Seen(Observation::Phase { to, .. }) => ("phase", to.text()),
            What::Seen(Observation::SlaveState { to, .. }) => ("state", to.text()),
            _ => continue,
        };
        states.insert((ps(entry.at), format!("isodp.slave_{}.{name}", entry.station)), word.replace(' ', "_"));
    }
    assert!(states.len() > 10 && states.values().any(|word| word == "narrowing"));
    for ((at, name), word) in states {
        assert_eq!(value(&name, at), word, "{name}");
    }
    // Everything that a slave does at its instants.
    let seen = |stretch: &Stretch, slave: u8, is_it: fn(&Observation) -> bool| -> Vec<u64> {
        let entries = stretch.entries.iter().filter(|entry| entry.station == address(slave));
        entries
            .filter(|entry| matches!(&entry.what, What::Seen(what) if is_it(what)))
            .map(|entry| ps(entry.at))
            .collect()
    };
    for slave in [3, 4] {
        let all =
            |is_it| recording.stretches.iter().flat_map(|stretch| seen(stretch, slave, is_it)).collect::<Vec<_>>();
        let latches = all(|what| matches!(what, Observation::Latch { .. }));
        assert!(latches.len() > 10);
        assert_eq!(rises(&format!("isodp.slave_{slave}.latch")), latches);
        let set_points = all(|what| matches!(what, Observation::SetPoint { .. }));
        assert_eq!(rises(&format!("isodp.slave_{slave}.t_o")), set_points);
    }
    let errors = recording.stretches.iter().flat_map(|stretch| &stretch.entries).filter_map(|entry| match entry.what {
        What::Seen(Observation::Clock { error, window, .. }) => Some((entry.at, entry.station, error, window)),
        _ => None,
    });
    for (at, slave, error, window) in errors {
        let number =
            |name: &str| value(&format!("isodp.slave_{slave}.{name}"), ps(at)).parse::<f64>().expect("a number");
        let (told, width) = (number("pll_error_ns"), number("window_ns"));
        assert!(told.is_nan() || (told - error.as_ns()).abs() < 1e-9, "{told} for {error}");
        assert!((width - window.as_ns()).abs() < 1e-9, "{width} for {window}");
    }
}

/// With Wireshark's own reader, where it is installed.
#[test]
fn wireshark_reads_the_telegrams() {
    let room = Room::new();
    let scenario = format!("{}/scenarios/leds.toml", env!("CARGO_MANIFEST_DIR"));
    room.runs(&["replay", &scenario, "--cycle", "0", "--window", "60", "--out", "out"]);
    let dir = room.path("out/leds");
    let tshark = |arguments: &[&str]| {
        let mut command = Command::new("tshark");
        command.current_dir(&dir).args(["-r", "flight.pcapng", "-X", "lua_script:profibus_dp.lua"]).args(arguments);
        command.output()
    };
    let Ok(output) = tshark(&["-T", "fields", "-e", "profibus.service", "-e", "profibus.fcs.good"]) else {
        return println!("tshark is not installed: what it makes of flight.pcapng was not looked at");
    };
    let page = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for service in
        ["Global_Control", "Data_Exchange", "Slave_Diag", "Set_Prm", "Chk_Cfg", "Get_Cfg", "token", "FDL status"]
    {
        assert!(page.lines().any(|line| line.starts_with(service)), "{service}:\n{page}");
    }
    let (.., packets) = read_pcapng(&fs::read(dir.join("flight.pcapng")).expect("a file"));
    assert_eq!(page.lines().count(), packets.len());
    assert!(!page.contains('0') && !page.contains("False"), "every check octet is right");
    let count = |filter: &str| {
        let output = tshark(&["-Y", filter]).expect("tshark");
        assert!(output.status.success(), "{filter}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).lines().count()
    };
    let with = |is_it: fn(&[u8]) -> bool| packets.iter().filter(|packet| is_it(&packet.octets)).count();
    assert_eq!(
        count("profibus.gc.synch == 1"),
        with(|octets| octets.len() == 13 && octets[7] == 58 && octets[10] == 0x80)
    );
    assert_eq!(count("profibus.tlg81.zsw2"), with(|octets| octets.len() == 21 && octets[6] & 0x40 == 0));
    assert_eq!(count("profibus.bad"), 0);
}

#[test]
fn every_fault_comes_with_a_line_that_replays_it() {
    let room = Room::new();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/gc-jitter-outside.toml");
    room.write("odd name.toml", fs::read(file).expect("a scenario"));
    let set = ["--set", "master.watchdog=300 ms", "--set", "record.flight.on=true"];
    let page = room.runs(&[&["run", "odd name.toml", "--seed", "9"][..], &set].concat());
    let line = page.lines().find(|line| line.starts_with("0F04 of slave ")).unwrap_or_else(|| panic!("{page}"));
    let (told, command) = line.split_once(": isodp ").expect("a command");
    let number = |word: &str| told.split_whitespace().skip_while(|other| *other != word).nth(1).map(str::to_owned);
    let (slave, cycle) = (number("slave").expect("a slave"), number("cycle").expect("a cycle"));
    let cycle = cycle.trim_end_matches(',');
    assert_eq!(
        command,
        format!("replay 'odd name.toml' --seed 9 --cycle {cycle} --window 5 --run-set master.watchdog='300 ms'")
    );
    let replayed = room.runs(&[
        "replay",
        "odd name.toml",
        "--seed",
        "9",
        "--cycle",
        cycle,
        "--window",
        "5",
        "--run-set",
        "master.watchdog=300 ms",
        "--out",
        "again",
    ]);
    let (_, of_cycle) = replayed.split_once(&format!("\ncycle {cycle}, ")).expect("the cycle");
    let fault = |line: &str| line.ends_with("fault 0F04") && line.split_whitespace().nth(2) == Some(slave.as_str());
    assert!(of_cycle.split("\ncycle ").next().expect("lines").lines().any(fault), "{replayed}");
    assert!(replayed.ends_with("4 files in again/odd name\n"), "{replayed}");
    // The same files as the run's, but for the cycles in them.
    for format in capture::FORMATS {
        assert!(room.path(&format!("again/odd name/{}", format.file)).exists(), "{}", format.file);
        assert!(room.path(&format!("out/odd name/{}", format.file)).exists(), "{}", format.file);
    }
    let (.., packets) = read_pcapng(&fs::read(room.path("again/odd name/flight.pcapng")).expect("a file"));
    assert_eq!(packets.len(), replayed.lines().filter(|line| line.contains(" | ")).count());
    let summary: serde_json::Value =
        serde_json::from_slice(&fs::read(room.path("out/odd name/summary.json")).expect("a summary")).expect("JSON");
    assert_eq!(summary["first_faults"][0]["replay"], format!("isodp {command}"));
    assert_eq!(summary["first_faults"][0]["cycle"].to_string(), cycle);
}

#[test]
fn what_cannot_be_recorded_is_refused() {
    let refused = |key: &str, value: &str| {
        let sets = [(format!("record.flight.{key}"), value.to_owned())];
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/gc-loss.toml");
        Scenario::load(&file, &sets).expect_err("a wrong key").to_string()
    };
    assert!(refused("captures", "0").contains("a whole number from 1 to 256"));
    assert!(refused("before", "101").contains("a whole number from 0 to 100"));
    assert!(refused("trigers", "[]").contains("did you mean \"triggers\"?"));
    assert!(refused("triggers", "[]").contains("nothing triggers the flight recorder"));
    assert!(refused("triggers", "[\"0F05\"]").contains("there is no trigger \"0F05\""));
    let set = |value: &str| scenario("gc-loss", &[("record.flight.triggers", value)]).record.flight;
    let two = set("[\"synch\", \"0F02\", \"synch\"]").expect("switched on");
    assert_eq!(two, Flight { triggers: vec![Trigger::Life, Trigger::Synch], ..Flight::default() });
    assert_eq!(scenario("gc-loss", &[("record.flight.on", "false")]).record.flight, None);
    assert_eq!(scenario("gc-loss", &[]).record.flight, None, "off where nothing is said");
    let after = scenario("gc-loss", &[("record.flight.after", "9")]).record.flight;
    assert_eq!(after, Some(Flight { after: 9, ..Flight::default() }));
}
