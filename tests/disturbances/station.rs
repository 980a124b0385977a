//! Stations that fall silent, grow deaf or lose their supply, and a master's application that errs.

use isodp::device::node::Node;
use isodp::observation::{
    ClockVerdict, Disturbance, HandlerState, LifeState, MasterMode, Observation, Phase, SlaveCause,
};
use isodp::sim::fingerprint::{Fingerprint, Fingerprints};
use isodp::sim::network::{Network, NetworkEvent};
use isodp::sim::queue::NearQueue;
use isodp::sim::record::{Origin, Recorder, Stamp, Transmission};
use isodp::study::build;
use isodp::study::difference::Differences;
use isodp::study::scenario::Scenario;
use isodp::study::what_if;
use isodp::time::{Span, Time};
use isodp::wire::Address;

use super::{bursts, changed, disturbed, prints, refused, scene, sends_in, tables};
use crate::support::{Run, address};

/// How often one station saw this.
fn count(run: &Run, station: u8, is: impl Fn(&Observation) -> bool) -> usize {
    run.events_of(station).filter(|row| is(&row.what)).count()
}
const fn missed(what: &Observation) -> bool {
    matches!(what, Observation::Clock { verdict: ClockVerdict::Missing, .. })
}
fn no_answer(slave: u8) -> impl Fn(&Observation) -> bool {
    move |what| matches!(what, Observation::NoAnswer { slave: of } if *of == address(slave))
}

#[test]
fn a_silent_station_says_nothing_and_comes_back_with_its_state() {
    let run = disturbed(&["kind = \"silent\"; station = 3; cycle = 200; for = 1"]);
    assert_eq!(sends_in(&run, 3, 198..204), [198, 199, 201, 202, 203]);
    // It heard no SYNCH in one cycle, which is tolerated, and what it was before it is again: no new start.
    assert_eq!((count(&run, 2, no_answer(3)), count(&run, 3, missed)), (1, 1));
    assert_eq!(bursts(&run, 3), [(200, Disturbance::Begins), (201, Disturbance::Ends)]);
    let long = disturbed(&["kind = \"silent\"; station = 3; cycle = 200; for = 5"]);
    assert_eq!(sends_in(&long, 3, 198..208), [198, 199, 205, 206, 207]);
    assert_eq!((count(&long, 2, no_answer(3)), long.faults_of(3).len()), (5, 1));
    assert_eq!(count(&run, 3, |what| matches!(what, Observation::SlaveState { .. })), 3, "its start alone");
    assert_eq!(bursts(&run, 4), []);
}

#[test]
fn the_mute_hear_and_the_deaf_send() {
    let mute = disturbed(&["kind = \"mute\"; stations = \"3, 5\"; cycle = 200; for = 2"]);
    for slave in [3, 5] {
        assert_eq!(sends_in(&mute, slave, 199..203), [199, 202]);
        assert_eq!((count(&mute, slave, missed), count(&mute, 2, no_answer(slave))), (0, 2));
    }
    assert_eq!(sends_in(&mute, 4, 199..203), [199, 200, 201, 202]);
    // A deaf slave is not asked, as it seems to it; a deaf master hears no answers.
    let deaf = disturbed(&["kind = \"deaf\"; station = 2; cycle = 200; for = 2"]);
    for slave in 3..=6 {
        assert_eq!(sends_in(&deaf, slave, 199..203), [199, 200, 201, 202]);
        assert_eq!((count(&deaf, slave, missed), count(&deaf, 2, no_answer(slave))), (0, 2));
    }
}

#[test]
fn a_mute_master_sends_no_synch_and_counts_its_cycles() {
    let run = disturbed(&["kind = \"mute\"; station = 2; cycle = 200; for = 2"]);
    for slave in 3..=5 {
        assert_eq!((count(&run, slave, missed), run.counts_of(slave).fault_count()), (2, 1), "tolerance is one");
    }
    assert_eq!(run.cycles.iter().filter(|row| (199..203).contains(&row.cycle)).count(), 4);
}

#[test]
fn silent_is_mute_and_deaf_at_once() {
    let silent = prints(&["kind = \"silent\"; station = 4; cycle = 150; for = 20"]);
    let both = ["mute", "deaf"].map(|kind| format!("kind = \"{kind}\"; station = 4; cycle = 150; for = 20"));
    assert_eq!(silent, prints(&both.each_ref().map(String::as_str)));
    assert_ne!(silent, prints(&[]));
}

#[test]
fn what_never_begins_changes_nothing() {
    let undisturbed = prints(&[]);
    for kind in ["silent", "mute", "deaf", "restart", "hold-life-sign", "repeat-life-sign", "wrong-parameters"] {
        let never = format!("kind = \"{kind}\"; stations = \"all slaves\"; cycle = 100000; for = 5; every = 7");
        assert_eq!(undisturbed, prints(&[&never]), "{kind}");
    }
}

#[test]
fn a_restart_is_the_events_power_off_and_power_on() {
    let events = "[[event]]\nat = \"300 ms\"\ndo = \"power-off\"\nslave = 3\n\
                  [[event]]\nat = \"350 ms\"\ndo = \"power-on\"\nslave = 3\n";
    let restart = disturbed(&["kind = \"restart\"; station = 3; at = \"300 ms\"; for = \"50 ms\""]);
    assert_eq!(restart.fingerprint, Run::of(&scene(events)).fingerprint);
    let phases: Vec<_> = restart.phases_of(3).into_iter().map(|(phase, _)| phase).collect();
    assert_eq!(phases.iter().filter(|&&phase| phase == Phase::Operation).count(), 2, "{phases:?}");
}

#[test]
fn overlapping_outages_are_one_long_outage() {
    let power = |run: &Run| -> Vec<(Time, bool)> {
        let power = |row: &isodp::study::row::EventRow| match row.what {
            Observation::Power { on } => Some((row.at, on)),
            _ => None,
        };
        run.events_of(3).filter_map(power).collect()
    };
    let two = disturbed(&[
        "kind = \"restart\"; station = 3; at = \"300 ms\"; for = \"50 ms\"",
        "kind = \"restart\"; station = 3; at = \"320 ms\"; for = \"80 ms\"",
    ]);
    let ms = |ms| Time::ZERO + Span::from_ms(ms);
    assert_eq!(power(&two), [(Time::ZERO, true), (ms(300), false), (ms(400), true)]);
    // A station that is switched off stays off when a disturbance ends.
    let off = "[[event]]\nat = \"310 ms\"\ndo = \"power-off\"\nslave = 3\n";
    let restart = tables(&["kind = \"restart\"; station = 3; at = \"300 ms\"; for = \"50 ms\""]);
    assert_eq!(power(&Run::of(&scene(&[off, &restart].concat()))), [(Time::ZERO, true), (ms(300), false)]);
}

#[test]
fn a_master_that_was_off_starts_its_slaves_anew_and_its_application_knows() {
    let run = disturbed(&["kind = \"restart\"; station = 2; at = \"300 ms\"; for = \"100 ms\""]);
    let mode = |row: &isodp::study::row::EventRow| match row.what {
        Observation::MasterMode { to, .. } => Some(to),
        _ => None,
    };
    let modes: Vec<_> = run.events_of(2).filter_map(mode).collect();
    let start = [MasterMode::Clear, MasterMode::Operate];
    assert_eq!(modes, [&start[..], &[MasterMode::Offline], &start[..]].concat());
    for slave in 3..=6 {
        let joined = |what: &Observation| matches!(what, Observation::Handler { slave: of, to: HandlerState::DataExchange, .. } if *of == address(slave));
        assert_eq!(count(&run, 2, joined), 2, "slave {slave}");
    }
    for slave in 3..=5 {
        let forgotten = |what: &Observation| matches!(what, Observation::SlaveLife { slave: of, to: LifeState::Waiting, tripped: false, .. } if *of == address(slave));
        assert_eq!(count(&run, 2, forgotten), 1, "the application of slave {slave}");
        assert_eq!(run.phases_of(slave).last().map(|&(phase, _)| phase), Some(Phase::Operation));
    }
}

/// A class 1 master beside the isochronous one, with a slave of its own.
#[test]
fn a_further_master_can_lose_its_supply_too() {
    let text = "[run]\ncycles = 1500\n[bus]\nrate = \"12 Mbit/s\"\nhsa = 15\nt_tr = \"21000 tbit\"\n\
                [master]\naddress = 2\nt_dp = \"2 ms\"\nt_i = \"125 us\"\nt_o = \"1 ms\"\nt_pll_w = \"1 us\"\n\
                [[class1]]\naddress = 5\n[[slave]]\naddresses = \"3..4\"\ndevice = \"posital-ocd-dpb1b\"\n\
                [[slave]]\naddress = 10\nmaster = 5\ndevice = \"posital-ocd-dpb1b\"\n";
    // Cycles are those of [master], which goes on.
    for window in ["at = \"600 ms\"; for = \"400 ms\"", "cycle = 300; for = 200"] {
        let text = [text, &tables(&[&format!("kind = \"restart\"; station = 5; {window}")])].concat();
        let scenario = Scenario::parse("two", "two.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}"));
        let run = Run::of(&scenario);
        assert!(sends_in(&run, 5, 310..490).is_empty(), "{window}");
        let thrown_out =
            |what: &Observation| matches!(what, Observation::SlaveState { cause: SlaveCause::Watchdog, .. });
        assert_eq!(count(&run, 10, thrown_out), 1, "{window}");
        let entered = |what: &Observation| matches!(what, Observation::RingEntered);
        assert_eq!(count(&run, 5, entered), 2, "{window}");
        // Both are what they were, and the isochronous network has not seen more than the one lost token.
        assert!(sends_in(&run, 10, 1_400..1_490).len() > 40, "{window}");
        for slave in 3..=4 {
            let operations = run.phases_of(slave).into_iter().filter(|&(phase, _)| phase == Phase::Operation).count();
            assert_eq!((operations, run.counts_of(slave).fault_count()), (1, 0), "slave {slave}, {window}");
        }
    }
}

/// A telegram: first bit, sender, octets.
type Sent = (Time, Address, Vec<u8>);

/// Every telegram that reached the line, or may still, and those that were withdrawn.
#[derive(Default)]
struct Line {
    sent: Vec<Sent>,
    withdrawn: Vec<Sent>,
}
impl Recorder for Line {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        self.sent.push((telegram.start, telegram.sender, telegram.octets.to_vec()));
    }
    fn observe(&mut self, _: Stamp<'_>, _: &Observation) {}
    fn withdrawn(&mut self, sender: Address, now: Time) {
        let stays = |(start, by, _): &Sent| *by != sender || *start <= now;
        let (sent, withdrawn) = std::mem::take(&mut self.sent).into_iter().partition(stays);
        self.sent = sent;
        self.withdrawn.extend::<Vec<_>>(withdrawn);
    }
}

/// Runs a scenario to its end.
fn lined(scenario: &Scenario) -> (Fingerprints, Line) {
    let mut network: Network<Node, NearQueue<NetworkEvent>> = build::network(scenario);
    let mut recorder = (Fingerprints::new(address(2)), Line::default());
    assert!(network.run(isodp::study::run::until(scenario), 10_000_000, &mut recorder));
    recorder
}

/// At whatever instant of a cycle the supply fails: the fingerprint of the wire is that of what was on it.
#[test]
fn what_a_station_could_not_send_any_more_is_in_no_fingerprint() {
    let mut withdrawn = 0;
    for step in 0..80 {
        let off = format!("at = \"{} us\"; for = \"20 ms\"", 100_000 + step * 25);
        let keys =
            ["2", "3"].map(|station| format!("kind = \"restart\"; name = \"{station}\"; station = {station}; {off}"));
        let sets = [("run.cycles", "70")];
        let scenario = changed(&sets, &tables(&keys.each_ref().map(String::as_str)));
        let (prints, line) = lined(&scenario);
        let mut expected = Fingerprints::new(address(2));
        for (start, sender, octets) in &line.sent {
            let origin = Origin::Sender;
            let telegram = Transmission { start: *start, end: *start, sender: *sender, octets, origin };
            expected.telegram(&telegram);
        }
        let wires = |prints: &Fingerprints| prints.stations().map(|(by, print)| (by, print.wire)).collect::<Vec<_>>();
        assert_eq!(wires(&prints), wires(&expected), "{off}");
        withdrawn += line.withdrawn.len();
    }
    assert!(withdrawn > 20, "{withdrawn}");
}

/// Two runs that differ in nothing but how far one SYNCH strays: where the supply fails before it begins, they are the same.
#[test]
fn what_a_station_could_not_send_any_more_is_no_difference() {
    let strays = |name: &str, more: &str, ticks: i64| {
        let jitter = "kind = \"gc-jitter\"; shape = \"uniform\"; half_width = \"300 ns\"; cycle = 50; for = 1";
        let end = format!("{ticks} tick");
        changed(&[("run.duration", &end)], &tables(&[&format!("{jitter}; name = \"{name}\""), more]))
    };
    let still = "kind = \"silent\"; station = 3; at = \"1 h\"";
    let t0 = Run::of(&strays("one", still, 12_000 * 150_000)).cycles[50].t0.ticks();
    let mut unsent = 0;
    for step in 0..60 {
        // SYNCH itself takes 12 us.
        let off = t0 - 12_000 * 5 - 6_000 * step;
        let restart = format!("kind = \"restart\"; station = 2; at = \"{off} tick\"; for = \"50 ms\"");
        let [one, other] = ["one", "other"].map(|name| strays(name, &restart, t0 + 12_000 * 1_000));
        let [(one_prints, one_line), (other_prints, other_line)] = [&one, &other].map(lined);
        let found = Differences::of::<NearQueue<NetworkEvent>>(&one, &other);
        if one_prints.total() == other_prints.total() {
            assert_eq!(found, Differences::default(), "{restart}");
            unsent += usize::from(one_line.withdrawn != other_line.withdrawn);
        } else {
            assert!(found.first().is_some(), "{restart}");
        }
    }
    assert!(unsent > 2, "{unsent}");
}

#[test]
fn an_order_to_a_master_without_supply_is_lost_and_told() {
    let order = "[[event]]\nat = \"350 ms\"\ndo = \"acknowledge\"\nslave = 3\n";
    let off = tables(&["kind = \"restart\"; station = 2; at = \"300 ms\"; for = \"100 ms\""]);
    let lost = |what: &Observation| matches!(what, Observation::OrderLost);
    assert_eq!(count(&Run::of(&scene(&[order, &off].concat())), 2, lost), 1);
    assert_eq!(count(&Run::of(&scene(order)), 2, lost), 0);
}

#[test]
fn a_held_sign_of_life_is_the_event_and_counts_on_at_the_end() {
    let hold = "[[event]]\ncycle = 200\ndo = \"hold-life-sign\"\nslaves = [3, 4]\n\
                [[event]]\ncycle = 203\ndo = \"release-life-sign\"\nslaves = [3, 4]\n";
    let run = disturbed(&["kind = \"hold-life-sign\"; stations = \"3..4\"; cycle = 200; for = 3"]);
    assert_eq!(run.fingerprint, Run::of(&scene(hold)).fingerprint);
    assert_eq!((run.faults_of(3).len(), run.faults_of(5).len()), (1, 0), "one failure is tolerated");
}

#[test]
fn two_holds_last_as_long_as_the_longer_one() {
    let long = "kind = \"hold-life-sign\"; station = 3; cycle = 200; for = 8";
    let short = "kind = \"hold-life-sign\"; stations = \"3..4\"; cycle = 201; for = 2; name = \"short\"";
    let sent = |disturbances: &[&str]| -> Vec<u8> {
        let run = disturbed(disturbances);
        (195..215).map(|cycle| run.row(3, cycle).mls).collect()
    };
    assert_eq!(sent(&[long, short]), sent(&[long]));
    assert_ne!(sent(&[long]), sent(&[]));
}

#[test]
fn a_repeated_value_comes_once_more_and_a_jump_goes_on_from_its_value() {
    let signs = |disturbance: &[&str]| -> Vec<u8> {
        let run = disturbed(disturbance);
        (199..206).map(|cycle| run.row(3, cycle).mls).collect()
    };
    let plain = signs(&[]);
    let next = |sign: u8| sign % 15 + 1;
    assert!(plain.windows(2).all(|pair| pair[1] == next(pair[0])), "{plain:?}");
    let repeated = signs(&["kind = \"repeat-life-sign\"; station = 3; cycle = 202; for = 1"]);
    assert_eq!(repeated[..3], plain[..3]);
    assert_eq!(repeated[3..], plain[2..6]);
    let to = next(next(plain[3]));
    let jumped = signs(&[&format!("kind = \"jump-life-sign\"; station = 3; to = {to}; cycle = 202; for = 1")]);
    assert_eq!((jumped[2], jumped[3], jumped[4]), (plain[2], to, next(to)));
}

#[test]
fn wrong_parameters_keep_a_slave_out_until_they_are_good_again() {
    // Octets 5 and 6 are the ident number.
    let run = disturbed(&["kind = \"wrong-parameters\"; station = 4; octets = [[5, 0x12]]; cycle = 150; for = 60"]);
    assert_eq!(sends_in(&run, 4, 149..150), [149]);
    let operating: Vec<_> = run.phases_of(4).into_iter().filter(|&(phase, _)| phase == Phase::Operation).collect();
    assert_eq!(operating.len(), 2, "{operating:?}");
    assert!(operating[1].1 > 210);
    let others: Vec<_> = run.phases_of(3).into_iter().filter(|&(phase, _)| phase == Phase::Operation).collect();
    assert_eq!(others.len(), 1);
}

#[test]
fn bursts_come_as_often_as_the_window_has_them() {
    let begins = |run: &Run| bursts(run, 3).iter().filter(|(_, how)| *how == Disturbance::Begins).count();
    assert_eq!(begins(&disturbed(&["kind = \"mute\"; station = 3; cycle = 100; for = 1; every = 55"])), 6);
    assert_eq!(begins(&disturbed(&["kind = \"mute\"; station = 3; cycle = 100; for = 1; every = 50; times = 2"])), 2);
    assert_eq!(
        begins(&disturbed(&["kind = \"mute\"; station = 3; at = \"100 ms\"; for = \"1 ms\"; every = \"100 ms\""])),
        8
    );
}

#[test]
fn a_station_that_is_not_there_is_refused() {
    let said = refused(&["kind = \"silent\"; station = 9; cycle = 1"]);
    assert!(said.contains("disturbance.1.station: there is no station 9"), "{said}");
    assert!(said.contains("the stations are 2, 3, 4, 5, 6"), "{said}");
    let said = refused(&["kind = \"hold-life-sign\"; stations = \"2..3\"; cycle = 1"]);
    assert!(said.contains("station 2 is not a slave of a master"), "{said}");
    let said = refused(&["kind = \"deaf\"; cycle = 1"]);
    assert!(said.contains("needs either station or stations"), "{said}");
    let one = changed(&[("run.cycles", "10")], &tables(&["kind = \"silent\"; stations = \"all slaves\""]));
    assert_eq!(one.disturbances[0].what.stations().len(), 4);
}

/// What becomes of two scenarios that part in a cycle.
fn futures(original: &str, altered: &str, cycle: u64) -> [Fingerprint; 2] {
    let [original, altered] = [scene(original), scene(altered)];
    let rider = Fingerprints::new(address(2));
    let futures = what_if::futures::<NearQueue<NetworkEvent>, _>([&original, &altered], (cycle, None), rider, |_| ());
    futures.expect("another future").ends.map(|(_, prints)| prints.total())
}

#[test]
fn a_disturbance_of_another_future_is_that_of_a_run_with_it() {
    for keys in [
        "kind = \"silent\"; station = 3; cycle = 200; for = 2; every = 50",
        "kind = \"restart\"; station = 3; at = \"450 ms\"; for = \"50 ms\"; every = \"150 ms\"",
        "kind = \"crystal-offset\"; stations = \"2..3\"; offset = \"30 ppm\"; at = \"450 ms\"; for = \"50 ms\"",
        "kind = \"temperature-step\"; station = 4; offset = \"50 ppm\"; time_constant = \"20 ms\"; cycle = 220; for = 40",
        "kind = \"hold-life-sign\"; stations = \"all slaves\"; cycle = 190; for = 1",
        "kind = \"gc-jitter\"; shape = \"uniform\"; half_width = \"200 ns\"; cycle = 200; for = 90",
    ] {
        let with = tables(&[keys]);
        let whole = [Run::of(&scene("")).fingerprint, Run::of(&scene(&with)).fingerprint];
        assert_eq!(futures("", &with, 190), whole, "{keys}");
        assert_eq!(futures(&with, &with, 190), [whole[1]; 2], "{keys}");
        assert_ne!(whole[0], whole[1]);
        // The same one beside another that comes first changes its number alone.
        let never = tables(&["kind = \"mute\"; station = 6; cycle = 99999; for = 1"]);
        assert_eq!(futures(&with, &[never, with.clone()].concat(), 230)[1], whole[1], "{keys}");
    }
}

#[test]
fn a_burst_that_another_future_does_not_have_ends_where_it_begins() {
    let silent = tables(&["kind = \"restart\"; station = 3; cycle = 180; for = 100"]);
    let ended = tables(&["kind = \"restart\"; station = 3; cycle = 180; for = 20"]);
    let [original, altered] = futures(&silent, "", 200);
    assert_eq!(original, Run::of(&scene(&silent)).fingerprint);
    // It ends at the beginning of the SYNCH of the cycle, not of the cycle: not the very same run.
    let whole = Run::of(&scene(&ended));
    assert_ne!(altered, original);
    let back = |run: &Run| run.phases_of(3).last().map(|&(phase, cycle)| (phase, cycle));
    assert!(matches!(back(&whole), Some((Phase::Operation, _))));
    let resumed = tables(&["kind = \"restart\"; station = 3; cycle = 180; for = 100; name = \"again\""]);
    assert_ne!(futures(&silent, &resumed, 200)[1], altered, "a burst that should go on begins");
}
