//! Whole networks with slave-to-slave links: latencies to the tick, every octet in its cycle, lost publishers.

use std::collections::BTreeMap;

use isodp::device::drive::Subscriber;
use isodp::device::node::Node;
use isodp::observation::{LinkState, Observation};
use isodp::sim::network::{Network, NetworkEvent, Until};
use isodp::sim::queue::NearQueue;
use isodp::sim::record::{Recorder, Stamp, Transmission};
use isodp::study::build;
use isodp::study::run;
use isodp::study::scenario::Scenario;
use isodp::time::{Span, Time};
use isodp::wire::prm::SetPrm;
use isodp::wire::{FrameControl, Telegram};

use crate::support::{Run, address, scenario};

/// The scenarios about slave-to-slave links with their tests.
pub(crate) const TESTS: &[(&str, fn())] = &[("dxb-lost-publisher", dxb_lost_publisher), ("dxb-network", dxb_network)];

/// Publishers 3 and 4 at 0 m and 50 m, subscribers 10 and 11 at 10 m and 100 m, the master at 20 m; no crystal is off.
const FOUR: &str = r#"
    [run]
    cycles = 400
    [bus]
    rate = "12 Mbit/s"
    cable = "100 m"
    [master]
    address = 2
    position = "20 m"
    t_dp = "4 ms"
    t_i = "125 us"
    t_o = "2 ms"
    [[slave]]
    address = 3
    device = "posital-ocd-dpb1b"
    position = "0 m"
    motion = { kind = "speed", speed = "900 rpm" }
    [[slave]]
    address = 4
    device = "posital-ocd-dpb1b"
    position = "50 m"
    [[slave]]
    address = 10
    device = "subscriber-drive"
    position = "10 m"
    [[slave]]
    address = 11
    device = "subscriber-drive"
    position = "100 m"
    [[link]]
    publisher = 3
    subscriber = 10
    [[link]]
    publisher = 3
    subscriber = 11
    table = "subscriber"
    [[link]]
    publisher = 4
    subscriber = 10
    [[link]]
    publisher = 4
    subscriber = 11
    samples = [{ offset = 4, length = 4 }, { offset = 0, length = 12 }]
"#;

fn four(sets: &[(&str, &str)]) -> Scenario {
    let sets: Vec<_> = sets.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
    Scenario::parse("four", "four.toml", FOUR, &sets).unwrap_or_else(|error| panic!("{error}"))
}

/// A line delay in ticks of 1/12 ns: 5 ns/m.
const fn metres(m: i64) -> i64 {
    m * 60
}

/// By hand: with T_ID2 after SYNCH, requests of 143 t_bit and replies of 231 t_bit after T_SDR = T_ID1, which is longer
/// than the encoders' own 30 t_bit (Model: D27), the first reply ends T_ID2 + 374 + T_ID1 after t0 and the second one
/// 374 + 2 T_ID1 later; the line lies twice between master and first, once between master and second publisher.
#[test]
fn latencies_at_every_isochronous_rate() {
    // Rate, t_bit (ticks), T_ID1, T_ID2 (t_bit), then by hand the ends of both replies (t_bit).
    let rates = [
        ("1.5 Mbit/s", 8_000, 37, 150, 561, 1_009),
        ("3 Mbit/s", 4_000, 46, 250, 670, 1_136),
        ("6 Mbit/s", 2_000, 57, 450, 881, 1_369),
        ("12 Mbit/s", 1_000, 76, 800, 1_250, 1_776),
    ];
    for (rate, t_bit, t_id1, t_id2, first, second) in rates {
        assert_eq!((first, second - first), (t_id2 + 374 + t_id1, 374 + 2 * t_id1), "{rate}");
        let run = Run::of(&four(&[("bus.rate", rate)]));
        let first = first * t_bit + metres(20);
        let second = second * t_bit + metres(20 + 20 + 30);
        for (publisher, subscriber, end, line) in [
            (3, 10, first, metres(10)),
            (3, 11, first, metres(100)),
            (4, 10, second, metres(40)),
            (4, 11, second, metres(50)),
        ] {
            let rows: Vec<_> = (run.links.iter())
                .filter(|row| (row.publisher, row.subscriber) == (address(publisher), address(subscriber)))
                .filter(|row| (200..398).contains(&row.cycle))
                .collect();
            assert_eq!(rows.len(), 198, "{rate}: a row in every cycle");
            for row in rows {
                let late = |slave| run.row(slave, row.cycle - 1).latch_offset.expect("locked");
                let ticks = Span::from_ticks;
                assert_eq!(row.wire, ticks(231 * t_bit + line), "{rate}: {row:?}");
                let t_i = Span::from_us(125) - late(publisher);
                assert_eq!(row.publish, t_i + ticks(end + line), "{rate}: {row:?}");
                assert_eq!(row.age, Some(t_i + Span::from_ms(2) + late(subscriber)), "{rate}: {row:?}");
            }
        }
    }
}

/// Replies to all in the running cycle: publisher and octets.
#[derive(Default)]
struct Published(BTreeMap<u8, Vec<u8>>);

impl Recorder for Published {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        if let Ok(Telegram::Data { header, du }) = Telegram::parse(telegram.octets)
            && header.da.is_broadcast()
            && matches!(header.fc, FrameControl::Response { .. })
        {
            self.0.insert(telegram.sender.get(), du.to_vec());
        }
    }
    fn observe(&mut self, _stamp: Stamp<'_>, _what: &Observation) {}
}

type Line = Network<Node, NearQueue<NetworkEvent>>;

fn subscriber(network: &Line, number: u8) -> &Subscriber {
    match network.station(address(number)) {
        Some(Node::Drive(drive)) => drive.function(),
        _ => panic!("slave {number} is no drive"),
    }
}

/// Cycles in which a scenario's last slave is in operation.
fn operation(run: &Run, slaves: &[u8]) -> u64 {
    slaves.iter().map(|&slave| run.phases_of(slave).last().expect("a phase").1).max().expect("a slave")
}

#[test]
fn dxb_network() {
    let network = scenario("dxb-network", &[]);
    let run = Run::of(&network);
    let from = operation(&run, &[3, 4, 5, 6, 10, 11]) + 1;
    let pairs = run::layout(&network).links().to_vec();
    assert_eq!(pairs.len(), 9);
    for &(publisher, subscriber) in &pairs {
        let rows = run.links.iter().filter(|row| (row.publisher, row.subscriber) == (publisher, subscriber));
        let cycles: Vec<_> = rows.clone().map(|row| row.cycle).filter(|cycle| (from..499).contains(cycle)).collect();
        assert_eq!(cycles, (from..499).collect::<Vec<_>>(), "{publisher} -> {subscriber}: in every cycle");
        for row in rows.filter(|row| row.cycle >= from) {
            let apart = |slave| network.slave(slave).expect("a slave").position_mm;
            let line = Span::from_ticks((apart(publisher).abs_diff(apart(subscriber)) * 60).div_ceil(1_000) as i64);
            assert_eq!(row.wire, Span::from_ns(19_250) + line);
            // The edge of one is as late as the line and the timer grid of 1/48 us make it, of the other too.
            let age = row.age.expect("used") - Span::from_us(1_125);
            assert!(age.abs() < Span::from_us(1), "{publisher} -> {subscriber}: {age}");
        }
    }
    let counts = run.counts.as_ref().expect("the run is over");
    for link in &counts.links {
        assert_eq!((link.lost, link.length_errors, link.longest_gap), (0, 0, Some(Span::from_ms(2))));
        assert!(link.valid > 460, "{link:?}");
    }
    assert_chain(&run, from);
    assert_octets(&network);
}

/// Drive 6 follows slave 3, slave 11 follows drive 6: what it uses in cycle k, slave 3 latched in cycle k - 2.
fn assert_chain(run: &Run, from: u64) {
    let mut cycle = 0;
    let mut used = 0;
    for (at, station, what) in &run.observations {
        match *what {
            Observation::CycleStart { cycle: begun, .. } => cycle = begun,
            Observation::Used { publisher, position } if *station == address(11) && cycle > from + 1 => {
                if [3, 4].map(address).contains(&publisher) {
                    assert_eq!(position, run.row(publisher.get(), cycle - 1).xist1, "cycle {cycle} of {publisher}");
                } else if publisher == address(6) {
                    assert_eq!(position, run.row(3, cycle - 2).xist1, "cycle {cycle} over the chain");
                    // That latch was T_I before the cycle before; the edges are a little late.
                    let t0 = run.cycles.iter().find(|row| row.cycle == cycle - 1).expect("a cycle").t0;
                    let age = *at - (t0 - Span::from_us(125));
                    assert!((age - Span::from_us(3_125)).abs() < Span::from_us(1), "{age}");
                    used += 1;
                }
            }
            _ => {}
        }
    }
    assert!(used > 350, "{used}");
}

/// After every cycle the subscribers' areas hold what the publishers sent in it, at the places of the scenario.
fn assert_octets(scenario: &Scenario) {
    let mut network: Line = build::network(scenario);
    let mut sent = Published::default();
    assert!(network.run(Until::Cycle(150), u64::MAX, &mut sent));
    for cycle in 151..400 {
        sent.0.clear();
        assert!(network.run(Until::Cycle(cycle), u64::MAX, &mut sent));
        let of = |publisher: u8| &sent.0[&publisher];
        assert_eq!(sent.0.len(), 4, "all publish in every cycle");
        let [six, ten, eleven] = [6, 10, 11].map(|number| subscriber(&network, number));
        assert_eq!(six.link_data(), &of(3)[4..8]);
        let table = [&of(3)[4..8], &of(3)[0..2], of(4), &of(6)[8..12]].concat();
        assert_eq!(ten.link_data(), table, "cycle {cycle}");
        let (one, two) = (ten.slot_data(1).expect("slot 1"), ten.slot_data(2).expect("slot 2"));
        assert_eq!((&one[10..14], &one[0..2], &two[240..]), (&of(5)[4..8], &of(5)[2..4], &of(6)[0..4]));
        assert!(one[2..10].iter().chain(&one[14..]).chain(&two[..240]).all(|&octet| octet == 0), "nowhere else");
        assert_eq!(eleven.link_data(), &of(6)[4..8]);
        let (one, two) = (eleven.slot_data(1).expect("slot 1"), eleven.slot_data(2).expect("slot 2"));
        assert_eq!(one[..8], [&of(3)[4..8], &of(4)[4..8]].concat());
        assert_eq!(two[..16], [&of(5)[..], &of(5)[4..8]].concat());
    }
}

/// When the link from `publisher` changed at `subscriber`, and to what, from `from` on.
fn changes(run: &Run, publisher: u8, subscriber: u8, from: Time) -> Vec<(Time, LinkState)> {
    let change = |at: Time, what: &Observation| match *what {
        Observation::Link { publisher: of, to, .. } if of == address(publisher) && at >= from => Some((at, to)),
        _ => None,
    };
    run.events_of(subscriber).filter_map(|row| change(row.at, &row.what)).collect()
}

/// When valid data of `publisher` came to `subscriber`.
fn receptions(run: &Run, publisher: u8, subscriber: u8) -> Vec<Time> {
    let of = Observation::Subscribed { publisher: address(publisher) };
    let all = run.observations.iter().filter(|(_, station, what)| *station == address(subscriber) && *what == of);
    all.map(|&(at, ..)| at).collect()
}

/// Function code of the Data_Exchange replies of `slave` to its master, by their first bit: 8 is DL, A is DH.
fn reply_codes(run: &Run, slave: u8) -> Vec<(Time, u8)> {
    let reply = |octets: &[u8]| match *octets {
        [0x68, _, _, 0x68, 2, sa, fc, ..] if sa == slave => Some(fc),
        _ => None,
    };
    run.telegrams.iter().filter_map(|(start, .., octets)| Some((*start, reply(octets)?))).collect()
}

/// Extended diagnosis of `slave` as its master read it from `from` on: its length and first octets.
fn diagnoses(run: &Run, slave: u8, from: Time) -> Vec<(u8, [u8; 8])> {
    let read = |what: &Observation| match *what {
        Observation::ExtendedDiagnosis { slave: of, length, first } if of == address(slave) => Some((length, first)),
        _ => None,
    };
    run.events_of(2).filter(|row| row.at >= from).filter_map(|row| read(&row.what)).collect()
}
/// What slaves 10 and 11 say while slave 3 is lost: the link table's publisher before the subscriber table's.
fn told(subscriber: u8) -> (u8, [u8; 8]) {
    let pairs = if subscriber == 10 { [3, 0x01, 4, 0x81] } else { [4, 0x81, 3, 0x01] };
    let [a, b, c, d] = pairs;
    (8, [8, 0x83, 0, 0, a, b, c, d])
}

#[test]
fn dxb_lost_publisher() {
    let network = scenario("dxb-lost-publisher", &[]);
    let run = Run::of(&network);
    let (off, on) = (Time::ZERO + Span::from_s(1), Time::ZERO + Span::from_s(2));
    for subscriber in [10, 11] {
        let all = receptions(&run, 3, subscriber);
        let last = *all.iter().rfind(|&&at| at < off).expect("data before");
        let back = *all.iter().find(|&&at| at > on).expect("data again");
        let due = last + Span::from_ms(100);
        assert_eq!(changes(&run, 3, subscriber, off), [(due, LinkState::Lost), (back, LinkState::Active)]);
        assert_eq!(changes(&run, 4, subscriber, off), []);
        // Not used at T_O from then on until the return.
        let used = |from, to| {
            let of =
                |what: &Observation| matches!(what, Observation::Used { publisher, .. } if *publisher == address(3));
            let all = run.observations.iter().filter(|(_, station, what)| *station == address(subscriber) && of(what));
            all.filter(|(at, ..)| (from..to).contains(at)).count()
        };
        assert_eq!((used(last, due), used(due, back)), (50, 0), "the last value at 50 T_O, one in each T_DP");
        // The first reply after the loss is the first that says so, and the return is news too.
        let codes = reply_codes(&run, subscriber);
        let after = |at: Time| codes.iter().find(|&&(start, _)| start > at).expect("a reply").1;
        let before = |at: Time| codes.iter().rfind(|&&(start, _)| start < at).expect("a reply").1;
        assert_eq!([before(due), after(due), after(back)], [0x08, 0x0A, 0x0A], "slave {subscriber}");
        // The acyclic part of a cycle has time for one of the two slaves that ask at once, in address order.
        let high = codes.iter().filter(|&&(start, code)| start > off && code == 0x0A).count();
        assert_eq!(high, if subscriber == 10 { 2 } else { 4 }, "replies of high priority of slave {subscriber}");
        assert_eq!(diagnoses(&run, subscriber, off), [told(subscriber), (0, [0; 8])], "slave {subscriber}");
        let counts = run.counts.as_ref().expect("the run is over");
        let link = run::layout(&network).link(address(3), address(subscriber)).expect("a link");
        let link = &counts.links[link];
        assert_eq!((link.valid, link.lost, link.length_errors), (all.len() as u64, 1, 0));
        assert_eq!(link.longest_gap, Some(back - last));
    }
    assert_wrong_length(&network, &run);
    assert_statuses(&network);
}

/// Slave 12 was told 10 octets of slave 4: none of its replies is taken, whatever else happens.
fn assert_wrong_length(network: &Scenario, run: &Run) {
    assert_eq!(receptions(run, 4, 12), []);
    let states: Vec<_> = changes(run, 4, 12, Time::ZERO).iter().map(|change| change.1).collect();
    assert_eq!(states, [LinkState::LengthError]);
    let of_4 = |what: &Observation| matches!(what, Observation::Used { publisher, .. } if *publisher == address(4));
    assert!(!run.observations.iter().any(|(_, station, what)| *station == address(12) && of_4(what)));
    let counts = run.counts.as_ref().expect("the run is over");
    let link = run::layout(network).link(address(4), address(12)).expect("a link");
    let heard = receptions(run, 5, 12).len() as u64;
    assert_eq!((counts.links[link].valid, counts.links[link].longest_gap), (0, None));
    assert_eq!((counts.links[link].length_errors, counts.links[link].lost), (heard, 0), "as often as slave 5 is heard");
    // Its master learns of it in the start-up, of slave 5 as soon as that one publishes.
    let told = diagnoses(run, 12, Time::ZERO);
    assert_eq!(told.last(), Some(&(8, [8, 0x83, 0, 0, 4, 0x40, 5, 0x81])), "{told:02X?}");
    // The length stands in its Set_Prm.
    let prm = build::set_prm(network, network.slave(address(12)).expect("a slave"));
    let block = SetPrm::parse(&prm).expect("a Set_Prm").blocks().last().expect("a block").expect("a good one");
    assert_eq!(block.data, [1, 4, 10, 4, 4, 5, 12, 4, 4]);
}

/// What the subscribers say of their links, as octets of the diagnosis: before, during and after.
fn assert_statuses(scenario: &Scenario) {
    let mut network: Line = build::network(scenario);
    for (ms, to_3) in [(990, 0x81), (1_090, 0x81), (1_110, 0x01), (1_990, 0x01), (2_500, 0x81)] {
        assert!(network.run(Until::Time(Time::ZERO + Span::from_ms(ms)), u64::MAX, &mut Published::default()));
        let statuses = |number| {
            subscriber(&network, number).statuses().map(|(of, status)| (of.get(), status.0)).collect::<Vec<_>>()
        };
        assert_eq!(statuses(10), [(3, to_3), (4, 0x81)], "{ms} ms");
        assert_eq!(statuses(11), [(4, 0x81), (3, to_3)], "{ms} ms");
        assert_eq!(statuses(12), [(4, 0x40), (5, 0x81)], "{ms} ms");
    }
}

#[test]
fn the_summary_says_what_was_received() {
    let network = scenario("dxb-lost-publisher", &[("record.files", "false")]);
    let summary = run::run::<NearQueue<NetworkEvent>>(&network, None, |_| ()).expect("a run without files").summary;
    let json = serde_json::to_value(&summary).expect("a summary");
    let links = json["links"].as_array().expect("links");
    assert_eq!(links.len(), 6);
    let wrong = links.iter().find(|link| link["publisher"] == 4 && link["subscriber"] == 12).expect("a link");
    assert_eq!(wrong["receptions"]["valid"], 0);
    assert!(wrong["receptions"]["length_errors"].as_u64().expect("a number") > 1_400);
    assert!(wrong["receptions"]["longest_gap_ms"].is_null());
    let lost = links.iter().find(|link| link["publisher"] == 3 && link["subscriber"] == 10).expect("a link");
    assert_eq!(lost["receptions"]["lost"], 1);
    assert!(lost["receptions"]["longest_gap_ms"].as_f64().expect("a number") > 1_000.0);
}
