//! Every picture of an invented but plausible run, read back with an XML reader and measured.

use std::path::Path;

use std::collections::BTreeSet;

use super::look::{WIDTH, text_width};
use super::*;
use crate::observation::{Disturbance, Inputs, Leds, Observation, Phase, PllState, SlaveCause, SlaveState};
use crate::sim::crystal::Crystal;
use crate::sim::record::{Origin, Recorder, Stamp, Transmission};
use crate::study::episode::SINGLES;
use crate::study::topology::{Segment, Station, Via};
use crate::time::{BitRate, Local, Time};
use crate::wire::{Fcb, Frame, Header, Sap, Service, Status};

const MASTER: u8 = 2;
const RATE: BitRate = BitRate::M12;

fn address(number: usize) -> Address {
    Address::new(number as u8).unwrap()
}

/// The master and 30 slaves on each segment of 100 m, one behind the other.
fn segments(slaves: &[Address]) -> Map {
    let slaves: Vec<&[Address]> = if slaves.is_empty() { vec![&[]] } else { slaves.chunks(30).collect() };
    let segment = |(index, slaves): (usize, &&[Address])| {
        let station = |(place, &address): (usize, &Address)| Station {
            address,
            device: ["posital-ocd-dpb1b", "simodrive-sensor-isochron", "subscriber-drive"][place % 3].to_owned(),
            mm: (place as u64 + 1) * 100_000 / slaves.len() as u64,
            delay: Span::from_ns(667 * index as i64 + 17 * (place as i64 + 1)),
        };
        let master = Station { address: address(MASTER.into()), device: "master".into(), mm: 0, delay: Span::ZERO };
        let via = index.checked_sub(1).map(|from| Via {
            from,
            from_mm: if index == 2 { 45_000 } else { 100_000 },
            to_mm: if index == 3 { 60_000 } else { 0 },
            what: if index == 1 { "2 olm, 300 m fibre".to_owned() } else { "repeater".to_owned() },
            delay: Span::from_ns(167),
            jitter: Span::from_ns(20 * (index as i64 % 2)),
        });
        Segment {
            name: format!("hall {index}"),
            cable_mm: 100_000,
            loads: slaves.len() + 2,
            stations: (index == 0)
                .then_some(master)
                .into_iter()
                .chain(slaves.iter().enumerate().map(station))
                .collect(),
            via,
            depth: index,
        }
    };
    Map { segments: slaves.iter().enumerate().map(segment).collect() }
}

/// An invented run.
struct World {
    plots: Plots,
    bus: BusCycle,
    distributions: Distributions,
    crystal: Crystal,
    noise: u64,
    now: Time,
    skews: Vec<i64>,
    deviations: Vec<i64>,
    delays: Vec<i64>,
}

impl World {
    fn new(slaves: usize, cycles: u64, t_dp: Span) -> Self {
        let slaves: Vec<Address> = (3..3 + slaves).map(address).collect();
        let topology = segments(&slaves);
        let links: Vec<_> = slaves.iter().skip(1).map(|&subscriber| (slaves[0], subscriber)).collect();
        let meta = PlotMeta {
            cycle: "T_DP",
            scenario: format!("invented-{}", slaves.len()),
            seed: 42,
            t_dp,
            slaves,
            links,
            masters: 2,
            disturbances: vec!["lost clocks".to_owned(), "noise".to_owned()],
            duration: t_dp * cycles as i64,
            topology,
        };
        let mut world = Self {
            plots: Plots::new(meta),
            bus: BusCycle::new(address(MASTER.into())),
            distributions: Distributions::default(),
            crystal: Crystal::new(0, Local::ZERO).unwrap(),
            noise: 42,
            now: Time::ZERO + Span::from_ms(1),
            skews: Vec::new(),
            deviations: Vec::new(),
            delays: Vec::new(),
        };
        for cycle in 0..cycles {
            world.cycle(cycle, cycles);
            if (90..92).contains(&cycle) {
                world.bus_cycle(cycle, t_dp);
            }
        }
        world.count();
        world
    }

    /// Roughly normal, standard deviation about `width`.
    fn noise(&mut self, width: i64) -> i64 {
        let mut sum = 0;
        for _ in 0..12 {
            self.noise = self.noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (self.noise >> 33) as i64 % 2_001 - 1_000;
        }
        sum * width / 2_000
    }

    fn cycle(&mut self, cycle: u64, cycles: u64) {
        let meta = self.plots.meta.clone();
        let t0 = Time::ZERO + meta.t_dp * cycle as i64;
        let deviation = self.noise(30 * 12);
        let skew = (self.noise(40 * 12) + 400 * 12).max(0);
        let locked = cycle > 60 && meta.slaves.len() > 1;
        if cycle > 0 {
            self.deviations.push(deviation / 12);
        }
        let delay = (cycle % 90 == 89).then(|| (self.noise(20) + 60).max(1));
        self.delays.extend(delay);
        self.skews.extend(locked.then_some(skew / 12));
        self.plots.cycle(&CycleRow {
            cycle,
            t0,
            gc_jitter: Span::ZERO,
            synch_delay: delay.map(Span::from_us),
            t_dp: Some(meta.t_dp),
            t_dp_deviation: (cycle > 0).then(|| Span::from_ticks(deviation)),
            t_dx: None,
            latch_skew: locked.then(|| Span::from_ticks(skew)),
            skew_counts: None,
            retries: 0,
            acyclic: None,
            spare: None,
        });
        for (index, &slave) in meta.slaves.iter().enumerate() {
            self.slave(index as u64, slave, cycle);
        }
        self.trouble(cycle, cycles);
    }

    fn slave(&mut self, index: u64, slave: Address, cycle: u64) {
        let begun = 12 + index % 5;
        let age = cycle.checked_sub(begun);
        let fault = index == 1 && (700..760).contains(&cycle);
        let (phase, pll) = match (age, fault) {
            (None, _) => (Phase::Configuration, PllState::Idle),
            (_, true) | (Some(0..=27), _) => (Phase::Clock, PllState::Narrowing),
            (Some(28..=45), _) => (Phase::MasterLife, PllState::Locked),
            (Some(46..=63), _) => (Phase::SlaveLife, PllState::Locked),
            _ => (Phase::Operation, PllState::Locked),
        };
        let settled = (16_000 >> (age.unwrap_or(0) / 2).min(12)) * 12;
        let sign = if index.is_multiple_of(2) { 1 } else { -1 };
        let error = sign * settled + self.noise(15 * 12);
        let window = (4_000i64 >> (age.unwrap_or(0) / 4).min(8)).max(1_000) * 12;
        self.plots.slave(&SlaveRow {
            cycle,
            t0: Time::ZERO,
            slave,
            state: SlaveState::DataExch,
            phase,
            pll,
            leds: if fault { Leds::NotAddressed } else { Leds::DataExchange },
            pll_error: age.filter(|&age| age > 0).map(|_| Span::from_ticks(error)),
            period: None,
            window: age.map(|_| Span::from_ticks(window)),
            latch_offset: (pll == PllState::Locked).then_some(Span::ZERO),
            mls: 1,
            sls: 1,
            life_counter: if index == 2 && cycle > 900 { 940u64.saturating_sub(cycle).min(40) as u16 } else { 0 },
            clock_counter: 0,
            g1_zsw: 0,
            xist1: ((cycle * 9_000 * (index + 3)) % 50_000_000) as u32,
            xist2: 0,
        });
    }

    /// Events around the cycles 700 and 900.
    fn trouble(&mut self, cycle: u64, cycles: u64) {
        let at = Time::ZERO;
        let mut event = |station: usize, what| {
            self.plots.event(&EventRow { at, cycle, station: address(station), what });
        };
        match cycle {
            150 | 699 | 700 | 950 => event(2, Observation::Disturbed { number: 0, how: Disturbance::Lost }),
            701 => event(4, Observation::Fault { code: 0x0F04 }),
            740 => event(4, Observation::Acknowledged { code: 0x0F04 }),
            900 => {
                event(5, Observation::Fault { code: 0x0F02 });
                event(5, Observation::Acknowledged { code: 0x0F02 });
                event(2, Observation::ClockLate { by: Span::from_us(1) });
            }
            960 => {
                let (from, to, cause) = (SlaveState::DataExch, SlaveState::WaitPrm, SlaveCause::Watchdog);
                event(6, Observation::SlaveState { from, to, cause });
            }
            _ if cycle + 5 == cycles => event(7, Observation::Fault { code: 0x0F01 }),
            _ => {}
        }
    }

    /// Puts a telegram on the line and lets the sender's clock run to its end.
    fn send(&mut self, sender: usize, frame: &Frame, then_bits: u32) -> Time {
        let (start, end) = (self.now, self.now + RATE.octets(frame.len()));
        self.bus.telegram(&Transmission {
            start,
            end,
            sender: address(sender),
            octets: frame.octets(),
            origin: Origin::Sender,
        });
        self.now = end + RATE.span(crate::time::Tbit(then_bits));
        end
    }
    fn ask(&mut self, header: Header, du: usize) -> Time {
        let mut frame = Frame::new();
        frame.set_data(&header, &vec![0x55; du]).unwrap();
        self.send(MASTER.into(), &frame, 30)
    }
    fn answer(&mut self, header: Header, sender: usize, du: usize) -> Time {
        let mut frame = Frame::new();
        frame.set_data(&header, &vec![0xAA; du]).unwrap();
        self.send(sender, &frame, 37)
    }
    fn saw(&mut self, at: Time, station: usize, what: Observation) {
        self.bus.observe(Stamp { at, station: address(station), crystal: &self.crystal.clone() }, &what);
    }

    /// One cycle on the line, from SYNCH to the token.
    fn bus_cycle(&mut self, cycle: u64, t_dp: Span) {
        let begin = self.now;
        let master = address(MASTER.into());
        let slaves = self.plots.meta.slaves.clone();
        let mut synch = Frame::new();
        let header = Header::request(Address::BROADCAST, master, Service::SdnHigh, Fcb::Unused);
        synch.set_data(&header.with_saps(Sap::GLOBAL_CONTROL, Sap::MASTER_MS0), &[0x00, 0x80]).unwrap();
        let t0 = self.send(MASTER.into(), &synch, 150);
        self.saw(t0, MASTER.into(), Observation::CycleStart { cycle, nominal: Local::ZERO });
        for (index, &slave) in slaves.iter().enumerate() {
            let service = if index == 0 { Service::Msrd } else { Service::SrdHigh };
            let header = Header::request(slave, master, service, Fcb::First);
            self.ask(header, 4);
            let mut reply = header.slave_reply(Status::Dl);
            if index == 0 {
                reply.da = Address::BROADCAST;
            }
            self.answer(reply, slave.get().into(), 12);
        }
        let acyclic =
            Header::request(slaves.first().map_or(address(9), |&slave| slave), master, Service::SrdLow, Fcb::First)
                .with_saps(Sap::MS1, Sap::MASTER_MS1);
        self.ask(acyclic, 10);
        self.ask(Header::request(address(126), master, Service::FdlStatus, Fcb::Unused), 0);
        self.now += RATE.span(crate::time::Tbit(300));
        self.other_master(master);
        for (index, &slave) in slaves.iter().enumerate() {
            let (t_o, t_i) = (t_dp.div_floor(Span::from_us(500)), Span::from_us(125));
            let noise = Span::from_ns(index as i64 * 20);
            let set_point = Observation::SetPoint { mls: 1, sls: 1, counter: 0, expected: true };
            self.saw(t0 + Span::from_us(375) * t_o + noise, slave.get().into(), set_point);
            let latch = Observation::Latch { locked: index != 3, inputs: Inputs::default() };
            let back = if index == 3 { Span::from_us(900) } else { t_i };
            self.saw(t0 + t_dp - back + noise, slave.get().into(), latch);
        }
        self.now = begin + t_dp;
    }

    /// The token goes to another master, which asks a slave of its own and one of these, and comes back.
    fn other_master(&mut self, master: Address) {
        let (other, own) = (address(12), self.plots.meta.slaves.first().copied().unwrap_or(master));
        let mut token = Frame::new();
        token.set_token(other, master);
        self.send(MASTER.into(), &token, 37);
        let exchange = Header::request(address(126), other, Service::SrdHigh, Fcb::First);
        let read = Header::request(own, other, Service::SrdLow, Fcb::First).with_saps(Sap::MS1, Sap::MASTER_MS2);
        for header in [exchange, read] {
            let mut frame = Frame::new();
            frame.set_data(&header, &[0x55; 4]).unwrap();
            self.send(12, &frame, 37);
            self.answer(header.slave_reply(Status::Dl), header.da.get().into(), 6);
        }
        // Its cycle is no cycle of the master's.
        self.saw(self.now, 12, Observation::CycleStart { cycle: 7, nominal: Local::ZERO });
        token.set_token(master, other);
        self.send(12, &token, 0);
    }

    fn count(&mut self) {
        let times = |recovery, harm: &str, bins: Vec<(f64, f64, u64)>| EpisodeTimes {
            recovery,
            harm: harm.to_owned(),
            count: bins.iter().map(|bin| bin.2).sum(),
            median: bins[bins.len() / 2].0,
            max: bins[bins.len() - 1].1,
            bins,
        };
        if self.plots.disturbed.any() {
            let dots = vec![(1.834, 1.834, 1), (1.85, 1.85, 1), (1.85, 1.85, 1), (7.0, 7.0, 1)];
            let bars =
                (0..100u32).map(|bin| (f64::from(bin), f64::from(bin + 1), 1 + u64::from(bin * 7 % 13))).collect();
            let (one, slow) = (vec![(50.5, 50.5, 1)], vec![(45_600.0, 45_600.0, 1); SINGLES]);
            self.distributions.episodes = vec![
                times(false, "0F04", dots),
                times(false, "loss", bars),
                times(true, "0F02", one),
                times(true, "loss", slow),
            ];
        }
        self.distributions.latch_skew = counted("latch skew", "ns", &mut self.skews);
        self.distributions.synch_delay = counted("SYNCH delay", "us", &mut self.delays);
        self.distributions.t_dp_deviation = counted("T_DP deviation", "ns", &mut self.deviations);
        for (index, &(publisher, subscriber)) in self.plots.meta.links.clone().iter().enumerate() {
            let mut spread = |middle: i64, width: i64| {
                let mut values: Vec<i64> =
                    (0..500).map(|_| self.noise(width) + middle + index as i64 * width / 2).collect();
                counted("latency", "us", &mut values)
            };
            let (wire, publish, age) = (spread(20, 0), spread(480, 3), spread(1_625, 2));
            self.distributions.links.push(LinkLatencies { publisher, subscriber, wire, publish, age });
        }
    }

    fn pictures(&self) -> Vec<(&'static str, String)> {
        self.plots.pictures(&self.distributions, &self.bus).unwrap()
    }
}

fn counted(title: &str, unit: &str, values: &mut [i64]) -> Distribution {
    values.sort_unstable();
    let bins = values.chunk_by(|a, b| a == b).map(|same| (same[0] as f64, same[0] as f64 + 1.0, same.len() as u64));
    let at = |share: f64| values.get(((values.len() as f64 * share) as usize).min(values.len().wrapping_sub(1)));
    let shares = [("p50", 0.5), ("p90", 0.9), ("p99", 0.99), ("p99.9", 0.999), ("max", 1.0)];
    Distribution {
        title: title.to_owned(),
        unit: unit.to_owned(),
        bins: bins.collect(),
        marks: shares.iter().filter_map(|&(label, share)| Some((label.to_owned(), *at(share)? as f64))).collect(),
        count: values.len() as u64,
    }
}

/// The runs that every picture must stand: none, one, eight and 122 slaves, a short one and a long one.
fn worlds() -> Vec<(&'static str, World)> {
    let ms = Span::from_ms;
    vec![
        ("no-slave", World::new(0, 1_000, ms(2))),
        ("no-cycle", World::new(8, 0, ms(2))),
        ("one-slave", World::new(1, 1_000, ms(2))),
        ("eight-slaves", World::new(8, 20_000, ms(2))),
        ("short-run", World::new(8, 200, ms(1))),
        ("122-slaves", World::new(122, 3_000, ms(8))),
    ]
}

/// Left, top, right, bottom.
type Box4 = (f64, f64, f64, f64);

fn number(node: roxmltree::Node<'_, '_>, name: &str) -> f64 {
    node.attribute(name).and_then(|text| text.parse().ok()).unwrap_or_else(|| panic!("{name} in {node:?}"))
}

/// Where a text stands, by the estimate of the layout.
fn text_box(node: roxmltree::Node<'_, '_>) -> Box4 {
    let size = number(node, "font-size");
    let width = f64::from(text_width(node.text().unwrap_or("").trim(), size.round() as i32));
    let left = match node.attribute("text-anchor") {
        Some("end") => -width,
        Some("middle") => -width / 2.0,
        _ => 0.0,
    };
    let (top, bottom) = match node.attribute("dy") {
        Some("0.76em") => (0.0, size),
        _ => (-size / 2.0, size / 2.0),
    };
    let (x, y) = (number(node, "x"), number(node, "y"));
    if node.has_attribute("transform") {
        return (x + top, y + left, x + bottom, y + left + width);
    }
    (x + left, y + top, x + left + width, y + bottom)
}

fn shape_box(node: roxmltree::Node<'_, '_>) -> Option<Box4> {
    let n = |name| number(node, name);
    Some(match node.tag_name().name() {
        "text" => text_box(node),
        "rect" => (n("x"), n("y"), n("x") + n("width"), n("y") + n("height")),
        "line" => (n("x1").min(n("x2")), n("y1").min(n("y2")), n("x1").max(n("x2")), n("y1").max(n("y2"))),
        "circle" => (n("cx") - n("r"), n("cy") - n("r"), n("cx") + n("r"), n("cy") + n("r")),
        "polyline" | "polygon" => {
            let points = node.attribute("points")?;
            let pairs = points.split_whitespace().filter_map(|pair| pair.split_once(','));
            let pairs = pairs.map(|(x, y)| (x.parse::<f64>().unwrap(), y.parse::<f64>().unwrap()));
            pairs.fold((f64::MAX, f64::MAX, f64::MIN, f64::MIN), |b, (x, y)| {
                (b.0.min(x), b.1.min(y), b.2.max(x), b.3.max(y))
            })
        }
        "svg" => return None,
        other => panic!("unexpected element {other}"),
    })
}

/// Everything of a picture is inside of it, and no two texts meet.
pub(super) fn all_inside_and_apart(name: &str, text: &str) {
    let document = roxmltree::Document::parse(text).unwrap();
    let height = number(document.root_element(), "height");
    let mut texts: Vec<(Box4, String)> = Vec::new();
    for node in document.descendants().filter(roxmltree::Node::is_element) {
        let Some(found) = shape_box(node) else { continue };
        let inside = found.0 >= 0.0 && found.1 >= 0.0 && found.2 <= f64::from(WIDTH) && found.3 <= height;
        assert!(inside, "{name}: {node:?} {:?} at {found:?} is outside", node.text());
        if node.has_tag_name("text") {
            texts.push((found, node.text().unwrap_or("").trim().to_owned()));
        }
    }
    for (index, (a, first)) in texts.iter().enumerate() {
        for (b, second) in &texts[index + 1..] {
            let apart = a.2 <= b.0 || b.2 <= a.0 || a.3 <= b.1 || b.3 <= a.1;
            assert!(apart, "{name}: '{first}' {a:?} meets '{second}' {b:?}");
        }
    }
}

#[test]
fn everything_is_inside_and_no_two_texts_meet() {
    for (name, world) in worlds() {
        for (file, text) in world.pictures() {
            all_inside_and_apart(&format!("{name} {file}"), &text);
        }
    }
}

fn words(text: &str) -> String {
    let document = roxmltree::Document::parse(text).unwrap();
    let texts = document.descendants().filter(|node| node.has_tag_name("text"));
    texts.filter_map(|node| Some(node.text()?.trim().to_owned())).collect::<Vec<_>>().join("\n")
}

/// File; words of the title, axes with units, legend.
const WORDS: [(&str, &[&str]); 11] = [
    ("latch_skew.svg", &["Latch skew:", "latch skew [ns]", "cycles (logarithmic)", "p99.9 ", "cycles per column"]),
    ("pll_convergence.svg", &["PLL convergence:", "error and window [ns]", "cycles since", "± window", "locked at"]),
    ("t_dp_deviation.svg", &["T_DP deviation:", "T_DP deviation [ns]", "time [", "cycles (logarithmic)", "p99 "]),
    (
        "timeline.svg",
        &["Timeline:", "time [", "phase 5 operation", "fault 0F04", "disturbed", "slave 3", "LED flashing"],
    ),
    ("publish_latency.svg", &["Publish latency:", "latency [us]", "Wire:", "Publish:", "Age at use:", "p99.9"]),
    (
        "bus_cycle.svg",
        &["Bus cycle:", "time from t0 [us]", "T_DP ", "T_O ", "T_I ", "T_DX ", "spare ", "SYNCH", "DXB", "master 12"],
    ),
    ("position.svg", &["Position:", "G1_XIST1 [steps]", "time ["]),
    ("topology.svg", &["Topology:", "hall 0: 100 m, ", " of 32 loads", "[ns]", "master", "posital-ocd-dpb1b", "17 ns"]),
    (
        "synch_delay.svg",
        &["SYNCH delay:", "SYNCH delay [us]", "time [", "late SYNCH (logarithmic)", "p99 ", "percentiles"],
    ),
    (
        "disturbances.svg",
        &["Disturbances:", "time [", "PLL error [ns]", "± window", "lost clocks", "DP state", "DATA_EXCH", "phase 5"],
    ),
    (
        "recovery.svg",
        &[
            "Recovery:",
            "time [ms]",
            "time [s]",
            "n = 4, median 1.85 ms, max 7 ms",
            "once, 50.5 ms",
            "after a loss",
            "median",
        ],
    ),
];

#[test]
fn every_picture_says_what_it_shows_with_units_and_legend() {
    assert!(WORDS.iter().map(|entry| entry.0).eq(PLOTS.iter().map(|plot| plot.file)));
    for (name, world) in worlds() {
        let slaves = world.plots.meta.slaves.len();
        let footer = format!("scenario invented-{slaves}, seed 42, T_DP {}", world.plots.meta.t_dp);
        for (file, text) in &world.pictures() {
            let (_, expected) = WORDS.iter().find(|entry| entry.0 == *file).expect("a registered picture");
            let words = words(text);
            assert!(words.contains(expected[0]) && words.contains(&footer), "{name} {file}:\n{words}");
            let several = !matches!(*file, "latch_skew.svg" | "publish_latency.svg") || slaves > 1;
            if slaves > 0 && name != "no-cycle" && several {
                for word in *expected {
                    assert!(words.contains(word), "{name} {file} lacks '{word}':\n{words}");
                }
            }
        }
    }
}

#[test]
fn a_picture_without_data_says_why_in_a_sentence() {
    for (file, text) in World::new(0, 0, Span::from_ms(2)).pictures() {
        let words = words(&text);
        let sentence = words.lines().any(|line| line.ends_with('.') && (line.contains("No") || line.contains("no ")));
        assert!(sentence, "{file}:\n{words}");
    }
}

#[test]
fn the_delay_by_the_token_is_drawn_where_there_are_several_masters() {
    let mut world = World::new(1, 200, Span::from_ms(2));
    let has = |world: &World| world.pictures().iter().any(|picture| picture.0 == "synch_delay.svg");
    assert!(has(&world));
    world.plots.meta.masters = 1;
    assert!(!has(&world));
}

#[test]
fn disturbances_are_drawn_where_there_are_any() {
    for (name, world) in worlds() {
        let drawn = |file| world.pictures().iter().any(|picture| picture.0 == file);
        let disturbed = name != "no-cycle";
        let expected = [disturbed, disturbed];
        assert_eq!([drawn("disturbances.svg"), drawn("recovery.svg")], expected, "{name}");
    }
}

#[test]
fn the_same_run_gives_the_same_octets() {
    let make = || World::new(8, 3_000, Span::from_ms(2)).pictures();
    assert_eq!(make(), make());
}

#[test]
fn a_fault_of_one_cycle_in_a_long_run_is_seen() {
    let mut world = World::new(1, 0, Span::from_ms(2));
    let count = |world: &World| {
        let pictures = world.pictures();
        let document = roxmltree::Document::parse(&pictures[3].1).unwrap();
        let bars = document.descendants().filter(|node| node.attribute("fill") == Some("#D55E00"));
        bars.filter(|node| node.attribute("width") == Some("3")).count()
    };
    for cycle in [0, 9_999_999] {
        world.slave(0, address(3), cycle);
    }
    assert_eq!(count(&world), 0);
    let what = Observation::Fault { code: 0x0F04 };
    world.plots.event(&EventRow { at: Time::ZERO, cycle: 5_000_000, station: address(3), what });
    assert_eq!(count(&world), 1);
}

#[test]
fn the_kept_bus_cycle_has_a_gap_poll_if_one_was_complete() {
    use telegrams::Kind::{OtherAcyclic, OtherAnswer, OtherReply, OtherRequest, OtherToken};
    let world = World::new(8, 100, Span::from_ms(2));
    let cycle = world.bus.cycle().unwrap();
    assert_eq!(cycle.number, Some(90));
    assert!(cycle.bars.iter().any(|bar| bar.kind == telegrams::Kind::Gap));
    assert_eq!(cycle.bars.iter().filter(|bar| bar.kind == telegrams::Kind::Request).count(), 8);
    assert_eq!(cycle.bars.iter().filter(|bar| bar.kind == telegrams::Kind::DxbReply).count(), 1);
    let of_other: Vec<_> = cycle.bars.iter().filter(|bar| bar.other == Some(address(12))).map(|bar| bar.kind).collect();
    assert_eq!(of_other, [OtherRequest, OtherReply, OtherAcyclic, OtherAnswer, OtherToken]);
}

#[test]
fn of_a_long_run_rows_of_cycles_are_looked_at_and_the_last_of_them_is_kept() {
    let t_dp = Span::from_ms(2);
    let mut world = World::new(2, 1, t_dp);
    for (last, kept) in [(300, 299), (511, 510), (4_096, 511), (4_097, 511), (4_100, 4_099), (5_000, 4_159)] {
        let next = world.bus.cycle().and_then(|cycle| cycle.number).map_or(0, |number| number + 2);
        for cycle in next..=last {
            world.bus_cycle(cycle, t_dp);
        }
        let cycle = world.bus.cycle().unwrap();
        assert_eq!(cycle.number, Some(kept), "cycles up to {last}");
        assert_eq!(cycle.bars.iter().filter(|bar| bar.kind == telegrams::Kind::Synch).count(), 1);
        assert_eq!(cycle.bars.iter().filter(|bar| bar.kind == telegrams::Kind::Request).count(), 2);
    }
}

#[test]
fn every_file_of_this_folder_is_registered_or_serves_the_others() {
    const SERVING: [&str; 13] = [
        "mod",
        "plan",
        "budget",
        "buckets",
        "chart",
        "distribution",
        "futures",
        "lanes",
        "look",
        "sweep",
        "telegrams",
        "tests",
        "tolerance",
    ];
    let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/study/plot");
    let stem = |path: &Path| path.file_stem().unwrap().to_string_lossy().into_owned();
    let files: BTreeSet<String> = std::fs::read_dir(dir).unwrap().map(|entry| stem(&entry.unwrap().path())).collect();
    let known = PLOTS.iter().map(|plot| stem(Path::new(plot.file))).chain(SERVING.map(str::to_owned));
    assert_eq!(files, known.collect());
}
