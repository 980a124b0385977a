//! Segments, repeaters and optical links in whole networks.

use std::fmt::Write as _;

use isodp::sim::network::NetworkEvent;
use isodp::sim::queue::{HeapQueue, NearQueue};
use isodp::study::plan::Plan;
use isodp::study::run::run;
use isodp::study::scenario::Scenario;
use isodp::time::{Span, Tbit};
use proptest::prelude::*;

use crate::props::config;
use crate::support::{Run, address, scenario};

/// The scenarios that are tested here.
pub(crate) const TESTS: &[(&str, fn())] = &[("repeaters", repeaters)];

/// Grid of the timers (Model: D14).
const QUANTUM: Span = Span::from_ticks(250);
/// Cycles after which every loop has forgotten how it began.
const SETTLED: u64 = 300;

fn ns(ns: f64) -> Span {
    Span::from_ticks((ns * 12.0).round() as i64)
}
fn parse(text: &str) -> Scenario {
    Scenario::parse("wired", "wired.toml", text, &[]).unwrap_or_else(|error| panic!("{error}\n{text}"))
}
/// What is said of this scenario.
fn refused(text: &str) -> String {
    match Scenario::parse("wired", "wired.toml", text, &[]) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("nothing is said of\n{text}"),
    }
}
/// Latch skews of settled cycles, smallest and largest.
fn skews(run: &Run) -> (Span, Span) {
    let rows = run.cycles[..run.cycles.len() - 1].iter().filter(|row| row.cycle >= SETTLED);
    let skews: Vec<_> = rows.map(|row| row.latch_skew.expect("all are locked")).collect();
    assert!(skews.len() > 300, "{} settled cycles", skews.len());
    (*skews.iter().min().expect("some"), *skews.iter().max().expect("some"))
}
fn no_faults(scenario: &Scenario, run: &Run) {
    for slave in scenario.configured().map(|slave| slave.address.get()) {
        let counts = run.counts_of(slave);
        assert_eq!((counts.clock_failures, counts.no_answers, counts.fault_count()), (0, 0, 0), "slave {slave}");
    }
    assert_eq!(run.counts.as_ref().expect("counts").network.collisions, 0);
}

/// Two segments of 100 m with `link` between them; master and slave 3 on the first, slaves 4 and 5 on the second. No
/// crystal is off.
fn two(link: &str) -> String {
    format!(
        "[run]\ncycles = 1000\n[bus]\nrate = \"12 Mbit/s\"\n[[segment]]\nname = \"a\"\ncable = \"100 m\"\n[[segment]]\n\
         name = \"b\"\ncable = \"100 m\"\n[[repeater]]\nfrom = \"a\"\nto = \"b\"\n{link}\n[master]\naddress = 2\n\
         segment = \"a\"\nt_dp = \"2 ms\"\nt_i = \"125 us\"\nt_o = \"1 ms\"\n[[slave]]\naddress = 3\nsegment = \"a\"\n\
         device = \"posital-ocd-dpb1b\"\n[[slave]]\naddresses = \"4..5\"\nsegment = \"b\"\n\
         device = \"posital-ocd-dpb1b\"\n"
    )
}
/// [`two`] as one line of 200 m, slave 3 in its middle and the others at its end.
fn straight() -> String {
    let text = two("").replace("[[segment]]\nname = \"b\"\ncable = \"100 m\"\n", "");
    let text = text.replace("[[repeater]]\nfrom = \"a\"\nto = \"b\"\n", "").replace("100 m", "200 m");
    let text = text.replace("address = 3\n", "address = 3\nposition = \"100 m\"\n");
    text.replace("segment = \"b\"", "position = \"200 m\"")
}

/// Delays of the path, by the numbers of the scenario's own comment.
#[test]
fn delays_are_those_of_cables_repeater_modules_and_fibre() {
    let network = scenario("repeaters", &[]);
    let two_bits = ns(2_000.0 / 12.0);
    let expected = [
        (3, ns(250.0)),
        (4, ns(500.0)),
        (5, ns(500.0 + 200.0) + two_bits),
        (6, ns(500.0 + 400.0) + two_bits),
        (7, ns(900.0 + 1_500.0 + 150.0) + two_bits * 5),
        (8, ns(900.0 + 1_500.0 + 300.0) + two_bits * 5),
    ];
    for (slave, delay) in expected {
        let slave = address(slave);
        assert_eq!(network.delay(network.master.address, slave), delay, "slave {slave}");
        assert_eq!(network.delay(slave, network.master.address), delay, "slave {slave}");
        assert_eq!(network.t_td(network.master.address, slave), delay, "no jitter, whole metres");
    }
    assert_eq!(network.topology.t_td_max(), ns(240.0 * 5.0 + 1_500.0) + two_bits * 5);
}

/// The skew is the difference of the delays of the nearest and the farthest slave; T_PLL_D at each slave makes up for it,
/// but for half of its unit at both ends.
#[test]
fn repeaters() {
    let network = scenario("repeaters", &[]);
    let run = Run::of(&network);
    no_faults(&network, &run);
    let delay = |slave| network.delay(network.master.address, address(slave));
    let (low, high) = skews(&run);
    let apart = delay(8) - delay(3);
    assert!(low >= apart - QUANTUM * 2 && high <= apart + QUANTUM * 2, "{low} to {high}, path {apart}");
    for row in run.slaves.iter().filter(|row| row.cycle >= SETTLED && row.latch_offset.is_some()) {
        let late = row.latch_offset.expect("locked") - delay(row.slave.get());
        assert!(late.abs() <= QUANTUM, "slave {}: {late}", row.slave);
    }

    let sum = (3..=8).fold(Span::ZERO, |sum, slave| sum + delay(slave));
    assert_eq!(sum * 2, ns(19_200.0));
    let exchange = network.bus.params.span(Tbit(800 + 6 * (143 + 30 + 231) + 5 * 76));
    assert!(run.cycles[200..900].iter().all(|row| row.t_dx == Some(exchange + sum * 2)));

    let unit = Span::from_iso_units(1);
    let units: Vec<i64> = (3..=8).map(|slave| ((delay(8) - delay(slave)) * 2 + unit).div_floor(unit * 2)).collect();
    assert_eq!(units, [39, 36, 32, 30, 2, 0]);
    let sets: Vec<_> =
        (3..).zip(&units).map(|(slave, units)| (format!("slave.{slave}.t_pll_d"), format!("{units} tbit"))).collect();
    let sets: Vec<_> = sets.iter().map(|(key, value)| (key.as_str(), value.as_str())).collect();
    let equalised = scenario("repeaters", &sets);
    let run = Run::of(&equalised);
    no_faults(&equalised, &run);
    let (_, high) = skews(&run);
    assert!(high <= unit + QUANTUM * 2 && high < Span::from_ns(130), "{high}");
}

/// A device between master and slaves adds its delay twice to each exchange behind it, to the tick.
#[test]
fn t_dx_grows_by_twice_the_delay_of_every_slave_behind() {
    let from = 100;
    let t_dx = |network: &Scenario| {
        let run = Run::of(network);
        no_faults(network, &run);
        let rows = run.cycles[from..run.cycles.len() - 1].iter();
        let mut all: Vec<_> = rows.map(|row| row.t_dx.expect("slaves exchange data")).collect();
        all.dedup();
        assert_eq!(all.len(), 1, "no crystal is off: {all:?}");
        all[0]
    };
    let line = parse(&straight());
    let (own, planned) = (t_dx(&line), Plan::of(&line).t_dx);
    for (link, delay) in [
        ("delay = \"0 ns\"", Span::ZERO),
        ("", ns(2_000.0 / 12.0)),
        ("kind = \"ilm\"", ns(9_000.0 / 12.0)),
        ("kind = \"olm\"\nmodules = 3\nfibre = \"100 m\"", ns(1_000.0 + 500.0)),
        ("delay = \"777 ns\"", ns(777.0)),
    ] {
        let text = two(link).replace("address = 3\n", "address = 3\nposition = \"100 m\"\n");
        let network = parse(&text.replace("addresses = \"4..5\"\n", "addresses = \"4..5\"\nposition = \"100 m\"\n"));
        assert_eq!(t_dx(&network) - own, delay * 4, "{link}: two slaves, there and back");
        assert_eq!(Plan::of(&network).t_dx - planned, delay * 4, "{link}");
    }
}

/// Latch offsets of one slave in settled cycles.
fn offsets(run: &Run, slave: u8) -> Vec<Span> {
    let rows = run.slave(slave).filter(|row| row.cycle >= SETTLED);
    rows.filter_map(|row| row.latch_offset).collect()
}
/// Errors of one slave's clock recovery in settled cycles.
fn errors(run: &Run, slave: u8) -> Vec<Span> {
    let rows = run.slave(slave).filter(|row| row.cycle >= SETTLED);
    rows.filter_map(|row| row.pll_error).collect()
}

/// Jitter of a repeater is in the clock errors of those behind it at full strength, the same for all of them, and of
/// nobody else.
#[test]
fn jitter_shows_behind_the_repeater_only() {
    let widest = |run: &Run, slave| errors(run, slave).into_iter().map(Span::abs).max().expect("errors");
    let still = parse(&two("delay = \"500 ns\""));
    let still = Run::of(&still);
    for slave in 3..=5 {
        assert!(widest(&still, slave) <= QUANTUM * 2, "without jitter: {}", widest(&still, slave));
    }
    let jitter = Span::from_ns(300);
    let network = parse(&two("delay = \"500 ns\"\njitter = \"300 ns\""));
    let run = Run::of(&network);
    no_faults(&network, &run);
    assert_eq!(errors(&run, 3), errors(&still, 3), "nothing changes in front of the repeater");
    assert_eq!(offsets(&run, 3), offsets(&still, 3));
    for slave in 4..=5 {
        let widest = widest(&run, slave);
        // The loop's own motion adds up to 1.55 times the jitter (see `device::pll`).
        assert!(widest > Span::from_ns(270) && widest <= Span::from_ns(780) + QUANTUM * 2, "{widest}");
    }
    let (a, b) = (errors(&run, 4), errors(&run, 5));
    let apart = a.iter().zip(&b).map(|(a, b)| (*a - *b).abs()).max().expect("errors");
    assert!(apart <= QUANTUM * 2, "one draw for all behind the repeater: {apart}");
    // Every telegram to them and from them is delayed by its own draw: T_DX is within four draws.
    let own = Plan::of(&parse(&two("delay = \"500 ns\""))).t_dx;
    assert_eq!(Plan::of(&network).t_dx - own, jitter * 4, "planned with the worst jitter");
    let t_dx = || run.cycles[100..run.cycles.len() - 1].iter().map(|row| row.t_dx.expect("data"));
    let middle = still.cycles[500].t_dx.expect("data");
    assert!(t_dx().all(|t_dx| (t_dx - middle).abs() <= jitter * 4));
    assert!(t_dx().max() > Some(middle + jitter) && t_dx().min() < Some(middle - jitter));
    // Both queues and a second run agree.
    let heap = Run::on::<HeapQueue<NetworkEvent>>(&network);
    assert_eq!((run.fingerprint, &run.stations), (heap.fingerprint, &heap.stations));
    assert_eq!(Run::of(&network).fingerprint, run.fingerprint);
}

/// A repeater elsewhere draws from a stream of its own: neither the crystals nor another repeater's draws change.
#[test]
fn a_repeater_more_changes_no_other_draw() {
    let jitter = "name = \"first\"\ndelay = \"500 ns\"\njitter = \"100 ns\"";
    let drawn = two(jitter).replace(
        "[master]\n",
        "[master]\ncrystal = { within = \"50 ppm\" }\ngc_jitter = { kind = \"uniform\", half_width = \"100 ns\" }\n",
    );
    let drawn = drawn.replace("device = ", "crystal = { within = \"50 ppm\" }\ndevice = ");
    let more =
        "[[segment]]\nname = \"c\"\n[[repeater]]\nfrom = \"b\"\nto = \"c\"\ndelay = \"2 us\"\njitter = \"300 ns\"\n";
    // The list in the file may put it first, too.
    let before = drawn.replacen("[[segment]]", &format!("{more}[[segment]]"), 1);
    let alone = Run::of(&parse(&drawn));
    for text in [format!("{drawn}{more}"), before] {
        let run = Run::of(&parse(&text));
        assert_eq!(run.fingerprint, alone.fingerprint);
        assert_eq!(errors(&run, 5), errors(&alone, 5));
    }
    let renamed = Run::of(&parse(&drawn.replace("\"first\"", "\"second\"")));
    assert_ne!(errors(&renamed, 5), errors(&alone, 5));
    assert_eq!(errors(&renamed, 3), errors(&alone, 3));
}

/// One segment with a name is the cable of `[bus]`.
#[test]
fn a_network_of_one_segment_is_one_line() {
    let text = "[run]\ncycles = 500\n[bus]\nrate = \"12 Mbit/s\"\ncable = \"100 m\"\n[master]\naddress = 2\nt_dp = \"2 ms\"\n\
                t_i = \"125 us\"\nt_o = \"1 ms\"\ncrystal = { within = \"50 ppm\" }\n[[slave]]\naddresses = \"3..6\"\n\
                device = \"posital-ocd-dpb1b\"\ncrystal = { within = \"50 ppm\" }\n";
    let named = text.replace("cable = \"100 m\"\n", "[[segment]]\nname = \"all\"\ncable = \"100 m\"\n");
    let [plain, named] = [text, &named].map(|text| Run::of(&parse(text)));
    assert_eq!((plain.fingerprint, plain.stations), (named.fingerprint, named.stations));
}

/// Four segments in line with 30, 30, 30 and 32 slaves run as one network.
#[test]
fn a_hundred_and_twenty_two_slaves_run_on_five_segments() {
    let mut text =
        "[run]\ncycles = 900\n[bus]\nrate = \"12 Mbit/s\"\n[master]\naddress = 2\nsegment = \"0\"\nt_dp = \"16 ms\"\n\
                    t_i = \"125 us\"\nt_o = \"15 ms\"\nwatchdog = \"10 s\"\n"
            .to_owned();
    for number in 0..5 {
        let (first, last) = (3 + number * 30, (32 + number * 30).min(124));
        let _ = write!(
            text,
            "[[segment]]\nname = \"{number}\"\ncable = \"50 m\"\n[[slave]]\naddresses = \"{first}..{last}\"\n"
        );
        let _ = write!(text, "segment = \"{number}\"\ndevice = \"simodrive-sensor-isochron\"\n");
        if number > 0 {
            let _ = write!(text, "[[repeater]]\nfrom = \"{}\"\nto = \"{number}\"\n", number - 1);
        }
    }
    let network = parse(&text);
    assert_eq!((0..5).map(|segment| network.loads(segment)).collect::<Vec<_>>(), [32, 32, 32, 32, 3]);
    let run = Run::of(&network);
    no_faults(&network, &run);
    let replies = run.telegrams_in(898).filter(|(.., sender, _)| *sender != network.master.address).count();
    assert_eq!(replies, 122);
}

#[test]
fn segments_that_are_wrong_are_named() {
    let good = two("");
    let cases = [
        ("to = \"b\"", "to = \"c\"", "repeater.1.to: there is no such segment"),
        ("to = \"b\"", "to = \"a\"", "repeater.1.to: this repeater closes a loop"),
        (
            "to = \"b\"",
            "to = \"b\"\n[[repeater]]\nfrom = \"b\"\nto = \"a\"",
            "repeater.2.to: this repeater closes a loop",
        ),
        (
            "name = \"b\"",
            "name = \"b\"\n[[segment]]\nname = \"c\"",
            "segment.3.name: segment \"c\" is not connected to \"a\"",
        ),
        ("name = \"b\"", "name = \"a\"", "segment.2.name: two of them are called \"a\""),
        ("name = \"b\"", "name = \" \"", "segment.2.name: this name is empty"),
        ("to = \"b\"", "to = \"b\"\nkind = \"hub\"", "repeater.1.kind: there is no kind of repeater \"hub\""),
        ("to = \"b\"", "to = \"b\"\nfrom_position = \"101 m\"", "repeater.1.from_position: 101 m is beyond the end"),
        (
            "to = \"b\"",
            "to = \"b\"\njitter = \"200 ns\"",
            "repeater.1.jitter: a jitter of 200 ns is more than the delay",
        ),
        ("to = \"b\"", "to = \"b\"\ndelay = \"1 us\"\njitter = \"460 ns\"", "telegrams against each other by 920 ns"),
        ("to = \"b\"", "to = \"b\"\nfibre = \"1 m\"", "repeater.1: only optical link modules have modules and fibre"),
        ("to = \"b\"", "to = \"b\"\nkind = \"olm\"\nfibre = \"5 km\"", "bus.t_sl: 1000 is not allowed here"),
        ("to = \"b\"", "to = \"b\"\ndelay = \"2 ms\"", "repeater.1.delay: 2 ms is longer than any such device takes"),
        ("addresses = \"4..5\"\nsegment = \"b\"", "addresses = \"4..5\"", "slave.4.segment: this key is missing"),
        ("address = 2\nsegment = \"a\"", "address = 2\nsegment = \"x\"", "master.segment: there is no such segment"),
        (
            "address = 3\n",
            "address = 3\nposition = \"101 m\"\n",
            "slave.3.position: 101 m is beyond the end of the cable",
        ),
        (
            "rate = \"12 Mbit/s\"",
            "rate = \"12 Mbit/s\"\ncable = \"1 m\"",
            "bus.cable: with [[segment]] each segment has",
        ),
        ("\"4..5\"", "\"4..35\"", "segment.2.name: 33 stations and repeaters are too many on segment \"b\""),
    ];
    for (from, to, expected) in cases {
        assert_eq!(good.matches(from).count(), 1, "{from}");
        let said = refused(&good.replace(from, to));
        assert!(said.contains(expected), "{to}:\n{said}");
    }
    let bare = "[run]\ncycles = 9\n[bus]\nrate = \"12 Mbit/s\"\n[master]\naddress = 2\nt_dp = \"2 ms\"\nt_i = \"125 us\"\n\
                t_o = \"1 ms\"\n[[slave]]\naddress = 3\ndevice = \"posital-ocd-dpb1b\"\n";
    for text in [format!("{bare}segment = \"a\"\n"), format!("{bare}[[repeater]]\nfrom = \"a\"\nto = \"b\"\n")] {
        assert!(refused(&text).contains("there are no segments"), "{}", refused(&text));
    }
}

#[test]
fn long_cables_and_many_repeaters_are_warned_of() {
    let warnings = |text: &str| parse(text).wiring_warnings();
    assert_eq!(warnings(&two("")), Vec::<String>::new());
    let long = two("").replacen("\"100 m\"", "\"101 m\"", 1);
    assert_eq!(
        warnings(&long),
        [
            "101 m of cable on segment \"a\" are more than a segment has at 12 Mbit/s: at most 100 m (EN 50170-2, cable type A)"
        ]
    );
    let outcome = run::<NearQueue<NetworkEvent>>(&parse(&long), None, |_| ()).expect("a run without files");
    let page = isodp::study::report::render(&outcome.summary, None);
    assert!(page.contains("\nwarning: 101 m of cable on segment \"a\""), "{page}");
    let mut chain = two("");
    for number in 0..9 {
        let from = if number == 0 { "b".to_owned() } else { format!("c{}", number - 1) };
        let _ =
            write!(chain, "[[segment]]\nname = \"c{number}\"\n[[repeater]]\nfrom = \"{from}\"\nto = \"c{number}\"\n");
    }
    assert_eq!(warnings(&chain).len(), 1);
    assert!(warnings(&chain)[0].starts_with("10 repeaters in series are more than"), "{:?}", warnings(&chain));
    assert_eq!(
        warnings(&chain.replace("[[repeater]]", "[[repeater]]\nkind = \"olm\"\ndelay = \"50 ns\"")),
        Vec::<String>::new()
    );
}

/// The page and the file show the tree.
#[test]
fn the_topology_is_drawn_in_text() {
    let outcome = run::<NearQueue<NetworkEvent>>(&scenario("repeaters", &[]), None, |_| ()).expect("no files");
    let expected = "\
topology: 3 segments, farthest from the master is station 8, 3.533 us
control room: 100 m, 4 of 32 loads
|  2..4: 0 ns to 500 ns from the master
|  at 100 m: repeater, 166.667 ns, to 0 m
+--press: 80 m, 4 of 32 loads
   |  5, 6: 866.667 ns to 1.067 us from the master
   |  at 80 m: 2 olm, 300 m fibre, 2.167 us, to 0 m
   +--gallery: 60 m, 3 of 32 loads
      |  7, 8: 3.383 us to 3.533 us from the master";
    assert_eq!(outcome.summary.topology.join("\n"), expected);
}

/// A publisher's reply reaches a subscriber behind the repeater later by the path between the two.
#[test]
fn slave_to_slave_goes_across_segments() {
    let text = two("delay = \"640 ns\"").replace("t_o = \"1 ms\"", "t_o = \"1.25 ms\"");
    let text = format!(
        "{text}[[slave]]\naddress = 9\nsegment = \"b\"\nposition = \"30 m\"\ndevice = \"subscriber-drive\"\n[[link]]\npublisher = 3\n\
         subscriber = 9\n[[link]]\npublisher = 5\nsubscriber = 9\n"
    );
    let network = parse(&text);
    let run = Run::of(&network);
    no_faults(&network, &run);
    let reply = network.bus.params.span(Tbit(231));
    let mut links = 0;
    for row in run.links.iter().filter(|row| row.cycle >= SETTLED) {
        assert_eq!(row.wire, reply + network.delay(row.publisher, row.subscriber), "publisher {}", row.publisher);
        links += 1;
    }
    assert!(links > 1_000, "{links}");
    assert_eq!(network.delay(address(3), address(9)), ns(640.0 + 30.0 * 5.0));
}

/// A class 2 master is a load of its segment and has its delays.
#[test]
fn a_class_2_master_sits_on_a_segment_too() {
    let text = two("delay = \"640 ns\"").replace("t_dp = \"2 ms\"", "t_dp = \"4 ms\"");
    let other = |more: &str| format!("{text}[[class2]]\naddress = 1\n{more}\n");
    let network = parse(&other("segment = \"b\"\nposition = \"20 m\""));
    assert_eq!((network.loads(0), network.loads(1)), (3, 4));
    assert_eq!(network.delay(network.master.address, address(1)), ns(500.0 + 640.0 + 100.0));
    assert!(refused(&other("")).contains("class2.1.segment: this key is missing"));
    assert!(refused(&other("segment = \"b\"\nposition = \"101 m\"")).contains("class2.1.position: 101 m is beyond"));
}

prop_compose! {
    /// Any tree of segments with jitter on some of its links, and a slave on each.
    fn tree()(
        segments in prop::collection::vec((any::<prop::sample::Index>(), 0u32..=100, 0u32..=100, 0u32..40, any::<bool>()), 0..6),
        cable in 0u32..=100,
        seed in any::<u64>(),
    ) -> String {
        let mut text = format!(
            "[run]\nseed = {seed}\ncycles = 700\n[bus]\nrate = \"12 Mbit/s\"\n[master]\naddress = 2\nsegment = \"0\"\n\
             position = \"0 m\"\nt_dp = \"4 ms\"\nt_i = \"125 us\"\nt_o = \"2 ms\"\n[[segment]]\nname = \"0\"\ncable = \"{cable} m\"\n\
             [[slave]]\naddress = 3\nsegment = \"0\"\ndevice = \"posital-ocd-dpb1b\"\n"
        );
        let mut cables = vec![cable];
        for (index, (on, cable, position, jitter, turned)) in segments.into_iter().enumerate() {
            let (number, on) = (index + 1, on.index(cables.len()));
            let at = position.min(cables[on]);
            cables.push(cable);
            // A link may be written from either side.
            let ends = if turned {
                format!("from = \"{number}\"\nfrom_position = \"0 m\"\nto = \"{on}\"\nto_position = \"{at} m\"")
            } else {
                format!("from = \"{on}\"\nfrom_position = \"{at} m\"\nto = \"{number}\"")
            };
            let _ = write!(
                text,
                "[[segment]]\nname = \"{number}\"\ncable = \"{cable} m\"\n[[repeater]]\n{ends}\njitter = \"{jitter} ns\"\n\
                 [[slave]]\naddress = {}\nsegment = \"{number}\"\ndevice = \"posital-ocd-dpb1b\"\n",
                number + 3
            );
        }
        text
    }
}
proptest! {
    #![proptest_config(config(12))]
    #[test]
    fn any_tree_runs_and_every_slave_latches_its_delay_late(text in tree()) {
        let network = parse(&text);
        let run = Run::on::<NearQueue<NetworkEvent>>(&network);
        let heap = Run::on::<HeapQueue<NetworkEvent>>(&network);
        prop_assert_eq!((run.fingerprint, &run.stations), (heap.fingerprint, &heap.stations));
        let counts = run.counts.as_ref().expect("counts");
        prop_assert_eq!((counts.network.collisions, counts.network.late_clocks, counts.network.no_answers), (0, 0, 0));
        for slave in &counts.slaves {
            prop_assert_eq!((slave.fault_count(), slave.clock_failures), (0, 0), "slave {}", slave.address);
            let (master, station) = (network.master.address, slave.address);
            // What T_TD has more is the jitter of the path (and rounding); the loop makes at most 1.55 of it.
            let jitter = network.t_td(master, station) - network.delay(master, station);
            let bound = Span::from_ticks(jitter.ticks() * 155 / 100) + QUANTUM * 3;
            for offset in offsets(&run, station.get()) {
                let off = offset - network.delay(master, station);
                prop_assert!(off.abs() <= bound, "slave {station}: {off} of {bound}");
            }
        }
        let planned = Plan::of(&network).t_dx;
        prop_assert!(run.cycles.iter().all(|row| row.t_dx.is_none_or(|t_dx| t_dx <= planned)));
    }
}
