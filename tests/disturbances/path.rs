//! Receivers, repeaters, slow answers and cut cables.

use isodp::observation::Observation;
use isodp::study::scenario::Scenario;
use isodp::time::{Span, Time};

use super::{bursts, disturbed, prints, refused, sends_in, tables};
use crate::support::{Run, address};

pub(super) fn no_answers(run: &Run, slave: u8) -> usize {
    let is = |what: &Observation| matches!(what, Observation::NoAnswer { slave: of } if *of == address(slave));
    run.events_of(2).filter(|row| is(&row.what)).count()
}
/// From t0 of a cycle to the first bit of a slave's reply in it.
pub(super) fn reply_at(run: &Run, slave: u8, cycle: u64) -> Span {
    let t0 = run.cycles.iter().find(|row| row.cycle == cycle).expect("a cycle").t0;
    let replies: Vec<Time> =
        run.telegrams_in(cycle).filter(|(_, _, by, _)| *by == address(slave)).map(|&(start, ..)| start).collect();
    replies[0] - t0
}
/// Arrivals of SYNCH at one slave in these cycles, off their prediction.
fn errors(run: &Run, slave: u8, cycles: std::ops::Range<u64>) -> Vec<Span> {
    run.slave(slave).filter(|row| cycles.contains(&row.cycle)).filter_map(|row| row.pll_error).collect()
}
fn spread(spans: &[Span]) -> Span {
    *spans.iter().max().expect("some") - *spans.iter().min().expect("some")
}

#[test]
fn a_slow_slave_answers_later_and_so_do_those_behind_it() {
    let calm = disturbed(&[]);
    let run = disturbed(&["kind = \"t-sdr-jitter\"; station = 3; by = \"5 us\"; cycle = 200; for = 50"]);
    for cycle in [199, 200, 249, 250] {
        let later = if (200..250).contains(&cycle) { Span::from_us(5) } else { Span::ZERO };
        for slave in 3..=6 {
            let off = reply_at(&run, slave, cycle) - reply_at(&calm, slave, cycle) - later;
            assert!(off.abs() <= Span::from_ticks(60), "slave {slave} in cycle {cycle}: {off}");
        }
    }
    let up_to = disturbed(&["kind = \"t-sdr-jitter\"; station = 3; up_to = \"60 tbit\"; cycle = 200"]);
    let all: Vec<_> = (200..399).map(|cycle| reply_at(&up_to, 3, cycle) - reply_at(&calm, 3, cycle)).collect();
    assert!(spread(&all) > Span::from_us(4) && spread(&all) <= Span::from_ns(5_010), "{}", spread(&all));
    // T_SL is 1000 t_bit: a slave that takes longer is as good as silent.
    let late = disturbed(&["kind = \"t-sdr-jitter\"; station = 3; by = \"200 us\"; cycle = 200; for = 3"]);
    assert_eq!(no_answers(&late, 3), 3);
}

#[test]
fn a_receiver_that_strays_moves_its_own_clock_alone() {
    let calm = disturbed(&[]);
    let run = disturbed(&["kind = \"receiver-jitter\"; station = 4; half_width = \"300 ns\"; cycle = 200; for = 100"]);
    let (before, inside) = (errors(&run, 4, 150..200), errors(&run, 4, 200..300));
    assert!(spread(&before) < Span::from_ns(450), "{}", spread(&before));
    assert!(spread(&inside) > Span::from_ns(500), "{}", spread(&inside));
    for slave in [3, 5] {
        assert_eq!(errors(&run, slave, 100..399), errors(&calm, slave, 100..399), "slave {slave}");
    }
    assert_eq!(bursts(&run, 4).len(), 2);
}

#[test]
fn no_strength_changes_nothing() {
    let undisturbed = prints(&[]);
    for none in [
        "kind = \"receiver-jitter\"; stations = \"2..6\"; half_width = \"0 ns\"",
        "kind = \"t-sdr-jitter\"; stations = \"all slaves\"; up_to = \"0 ns\"",
        "kind = \"cable-cut\"; position = \"60 m\"; cycle = 99999; for = 1",
    ] {
        assert_eq!(undisturbed, prints(&[none]), "{none}");
    }
}

/// Two halls with a repeater between them, a slave before it and two behind it.
pub(super) fn halls(more: &[&str]) -> Run {
    let text = r#"
[run]
seed = 5
cycles = 400
[bus]
rate = "12 Mbit/s"
[[segment]]
name = "hall 1"
cable = "100 m"
[[segment]]
name = "hall 2"
cable = "100 m"
[[repeater]]
from = "hall 1"
to = "hall 2"
[master]
address = 2
segment = "hall 1"
t_dp = "2 ms"
t_i = "125 us"
t_o = "1 ms"
[[slave]]
address = 3
segment = "hall 1"
device = "posital-ocd-dpb1b"
[[slave]]
addresses = "4..5"
segment = "hall 2"
device = "posital-ocd-dpb1b"
"#;
    let scenario = Scenario::parse("halls", "halls.toml", &[text, &tables(more)].concat(), &[]);
    Run::of(&scenario.unwrap_or_else(|error| panic!("{error}")))
}

#[test]
fn a_repeater_that_strays_moves_all_behind_it_alike() {
    let calm = halls(&[]);
    let name = "repeater = \"hall 1 - hall 2\"";
    assert_eq!(
        calm.fingerprint,
        halls(&[&format!("kind = \"repeater-jitter\"; {name}; half_width = \"0 ns\"")]).fingerprint
    );
    let run = halls(&[&format!("kind = \"repeater-jitter\"; {name}; half_width = \"150 ns\"; cycle = 200; for = 100")]);
    let inside = errors(&run, 4, 200..300);
    assert!(spread(&inside) > Span::from_ns(200), "{}", spread(&inside));
    assert!(spread(&errors(&run, 4, 370..399)) < Span::from_ns(50));
    // Both capture the same telegram on grids of their own.
    for (a, b) in inside.iter().zip(errors(&run, 5, 200..300)) {
        assert!((*a - b).abs() <= Span::from_ns(110), "{a} {b}");
    }
    assert_eq!(errors(&run, 3, 100..399), errors(&calm, 3, 100..399));
}

#[test]
fn a_cut_cable_parts_the_line_and_nothing_else() {
    // The slaves sit at 25, 50, 75 and 100 m.
    let run = disturbed(&["kind = \"cable-cut\"; position = \"60 m\"; cycle = 200; for = 4"]);
    for (slave, lost) in [(3, 0), (4, 0), (5, 4), (6, 4)] {
        assert_eq!(no_answers(&run, slave), lost, "slave {slave}");
        let expected = if lost == 0 { vec![199, 200, 201, 202, 203, 204] } else { vec![199, 204] };
        assert_eq!(sends_in(&run, slave, 199..205), expected, "slave {slave}");
    }
    assert_eq!((run.faults_of(4).len(), run.faults_of(5).len()), (0, 1));
    assert_eq!(bursts(&run, 2).len(), 2);
    // Two cuts at once part what each parts.
    let twice = disturbed(&[
        "kind = \"cable-cut\"; position = \"60 m\"; cycle = 200; for = 4",
        "kind = \"cable-cut\"; name = \"near\"; position = \"30 m\"; cycle = 202; for = 4",
    ]);
    assert_eq!([3, 4, 5, 6].map(|slave| no_answers(&twice, slave)), [0, 4, 6, 6]);
}

#[test]
fn a_telegram_under_way_at_the_cut_is_lost_to_the_other_side() {
    let calm = disturbed(&[]);
    // In the middle of the request to slave 6, the last one.
    let request = calm.telegrams_in(200).filter(|(_, _, by, octets)| *by == address(2) && octets.len() > 6).nth(3);
    let &(start, end, ..) = request.expect("a request to slave 6");
    let middle = start.ticks() + (end - start).ticks() / 2;
    let cut = format!("kind = \"cable-cut\"; position = \"60 m\"; at = \"{middle} tick\"; for = \"12 tick\"");
    let run = disturbed(&[&cut]);
    assert_eq!([3, 4, 5].map(|slave| no_answers(&run, slave)), [0, 0, 0]);
    let repeated = |what: &Observation| matches!(what, Observation::Retry { slave } if *slave == address(6));
    assert_eq!(run.events_of(2).filter(|row| repeated(&row.what)).count(), 1, "heard by nobody, then repeated");
}

#[test]
fn two_token_rings_arise_from_one_and_become_one_again() {
    let far = "[[class1]]\naddress = 12\nposition = \"90 m\"\n\
               [[slave]]\naddresses = \"20..21\"\nmaster = 12\nposition = \"95 m\"\ndevice = \"posital-ocd-dpb1b\"\n";
    for (at, length) in [("400 ms", "20 ms"), ("401.3 ms", "7.7 ms"), ("400.05 ms", "100 ms")] {
        let cut = tables(&[&format!("kind = \"cable-cut\"; position = \"80 m\"; at = \"{at}\"; for = \"{length}\"")]);
        let text = [far, &cut].concat();
        let scenario = super::changed(&[("run.cycles", "1000"), ("bus.hsa", "30"), ("bus.t_tr", "20000 tbit")], &text);
        let run = Run::of(&scenario);
        let claimed = |what: &Observation| matches!(what, Observation::TokenClaimed);
        let claims = run.events_of(12).filter(|row| claimed(&row.what) && row.at > Time::ZERO + Span::from_ms(400));
        assert!(claims.count() >= 1, "the far master has a ring of its own");
        // Both go on with their own slaves in the end, each heard by the other.
        for (slave, least) in [(3, 9), (4, 9), (20, 4), (21, 4)] {
            assert!(sends_in(&run, slave, 990..999).len() >= least, "slave {slave}, cut at {at}");
        }
        let ring = run.telegrams_in(995).filter(|(_, _, _, octets)| octets[0] == 0xDC);
        let mut senders: Vec<u8> = ring.map(|(_, _, by, _)| by.get()).collect();
        senders.sort_unstable();
        senders.dedup();
        assert_eq!(senders, [2, 12], "one token goes round");
    }
}

#[test]
fn paths_that_are_none_are_refused() {
    for (keys, says) in [
        ("kind = \"repeater-jitter\"; repeater = \"hall\"; half_width = \"1 ns\"", "there is no repeater \"hall\""),
        ("kind = \"receiver-jitter\"; station = 3; half_width = \"600 ns\"", "telegrams may move against each other"),
        ("kind = \"t-sdr-jitter\"; station = 3", "by what?"),
        ("kind = \"t-sdr-jitter\"; station = 3; by = \"2 s\"", "2 s is no T_SDR"),
        ("kind = \"cable-cut\"; position = \"0 m\"", "the beginning of a cable parts nothing"),
        ("kind = \"cable-cut\"; position = \"100 m\"", "this cable is 100 m long"),
        ("kind = \"cable-cut\"; position = \"10 m\"; segment = \"a\"", "there are no segments"),
    ] {
        let said = refused(&[keys]);
        assert!(said.contains(says), "{keys}: {said}");
    }
}
