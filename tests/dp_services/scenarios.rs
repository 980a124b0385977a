//! The expected answers of the scenarios about DP services.

use isodp::observation::{MasterMode, Observation, Phase};
use isodp::time::{BitRate, Span, Tbit};
use isodp::wire::drive::{G1Zsw, Inputs81};

use crate::support::{Run, address, scenario};

/// Shipped scenarios with their tests.
pub(crate) const TESTS: &[(&str, fn())] =
    &[("auto-clear", auto_clear), ("diagnosis", diagnosis), ("sync-freeze", sync_freeze)];

/// Cycles in which the master's check of one slave's sign of life tripped.
fn trips(run: &Run, number: u8) -> Vec<u64> {
    let trip = |what: &Observation| matches!(*what, Observation::SlaveLife { slave, tripped: true, .. } if slave == address(number));
    run.events_of(2).filter(|row| trip(&row.what)).map(|row| row.cycle).collect()
}
/// What the master read of one slave's diagnosis during data exchange.
fn diagnoses(run: &Run, number: u8) -> Vec<(u64, [u8; 3])> {
    let status = |what: &Observation| match *what {
        Observation::Diagnosis { slave, status } if slave == address(number) => Some(status),
        _ => None,
    };
    let rows = run.events_of(2).filter(|row| row.cycle >= 100);
    rows.filter_map(|row| Some((row.cycle, status(&row.what)?))).collect()
}

#[test]
fn sync_freeze() {
    let run = Run::of(&scenario("sync-freeze", &[]));
    // Freeze: the octets of cycle 200 until the Unfreeze of cycle 300, one cycle of them taken by Slave_Diag.
    let replies: Vec<Option<Inputs81>> = (198..305).map(|cycle| run.reply(3, cycle)).collect();
    let at = |cycle: usize| replies[cycle - 198];
    let held = at(200).expect("a reply");
    assert!((201..=300).filter(|&cycle| cycle != 202).all(|cycle| at(cycle) == Some(held)));
    assert_eq!((at(202), at(302)), (None, None), "Slave_Diag instead");
    // G1_XIST1 is left-justified by 7 bits (Model: D23); 1500 rpm are 204.8 steps in a cycle.
    let moved = |a: usize, b: usize| (at(b).expect("a reply").xist1 - at(a).expect("a reply").xist1) >> 7;
    assert!((204..=205).contains(&moved(199, 200)), "it turns");
    assert!((20_684..=20_686).contains(&moved(200, 301)), "101 cycles at once");
    assert_eq!((trips(&run, 3), run.faults_of(3)), (vec![205], vec![]));
    assert_eq!(diagnoses(&run, 3), [(202, [0x00, 0x1C, 0x00]), (302, [0x00, 0x0C, 0x00])]);

    // Sync: control words act in the cycle of the command alone, and show in the next one (Model: D10).
    assert_eq!(run.faults_of(4), [(402, 0x0F02)]);
    let parked = |cycle| G1Zsw(run.reply(4, cycle).expect("a reply").g1_zsw.0).has(G1Zsw::PARKING);
    assert!((451..=500).all(|cycle| !parked(cycle)) && (501..=600).all(parked));
    assert!((601..799).filter(|&cycle| cycle != 602).all(|cycle| !parked(cycle)));
    let mls = |cycle| run.row(4, cycle).mls;
    assert!((400..500).all(|cycle| mls(cycle) == mls(400)) && (500..600).all(|cycle| mls(cycle) == mls(500)));
    assert_ne!(mls(400), mls(500));
    let (off, on) = ([0x00, 0x0C, 0x00], [0x00, 0x2C, 0x00]);
    assert_eq!(diagnoses(&run, 4), [(402, on), (602, off)], "the second Sync changes no mode");

    // Nobody else: neither the other group's slave nor the ones that were not meant.
    assert!(diagnoses(&run, 5).is_empty() && trips(&run, 5).is_empty() && run.faults_of(5).is_empty());
    assert!(run.slave(5).all(|row| row.life_counter == 0));
    assert!(run.counts.as_ref().expect("counts").slaves.iter().all(|slave| slave.phase == Phase::Operation));
    // Two cycles of Slave_Diag are shorter by 2 x 11 + 6 - 2 x 9 - 16 characters, no cycle is longer.
    let t_dx = |cycle: u64| run.cycles[cycle as usize].t_dx.expect("slaves exchange data");
    assert_eq!(t_dx(201) - t_dx(202), BitRate::M12.span(Tbit(66)));
    assert!((100..799).all(|cycle| t_dx(cycle) <= t_dx(199)));
}

#[test]
fn auto_clear() {
    let run = Run::of(&scenario("auto-clear", &[]));
    let modes = run.events_of(2).filter_map(|row| match row.what {
        Observation::MasterMode { to, .. } => Some((row.cycle, to)),
        _ => None,
    });
    let modes: Vec<_> = modes.filter(|&(cycle, _)| cycle > 0).collect();
    assert_eq!(modes, [(15, MasterMode::Operate), (320, MasterMode::Clear), (600, MasterMode::Operate)]);
    let blamed = run.events_of(2).filter_map(|row| match row.what {
        Observation::AutoClear { slave } => Some((row.cycle, slave)),
        _ => None,
    });
    assert_eq!(blamed.collect::<Vec<_>>(), [(320, address(4))]);
    // Data_Control_Time from the last answer to the first cycle that begins after it.
    let answers = run.telegrams.iter().filter(|(.., sender, _)| *sender == address(4));
    let last = answers.map(|&(_, end, ..)| end).filter(|&end| end < run.cycles[320].t0).max().expect("an answer");
    let gone = run.cycles[320].t0 - last;
    assert!((Span::from_ms(20)..Span::from_ms(21)).contains(&gone), "{gone}");

    // From cycle 320 to 599 every Data_Exchange is empty, SD1, and no outputs are in force.
    let requests = |cycle| -> Vec<usize> {
        let requests = run.telegrams_in(cycle).filter(|(.., sender, octets)| {
            *sender == address(2) && octets.len() > 3 && octets[octets.len() - 1] == 0x16
        });
        let exchange = |octets: &[u8]| {
            matches!(octets, [0x10, _, _, fc, ..] if fc & 0x0F != 0x09) || octets.len() == 13 && octets[4] < 0x80
        };
        requests.filter(|(.., octets)| exchange(octets)).map(|(.., octets)| octets.len()).collect()
    };
    assert_eq!((requests(299), requests(310)), (vec![13; 3], vec![13; 2]));
    for cycle in 320..600 {
        assert_eq!(requests(cycle), vec![6; if cycle < 405 { 2 } else { 3 }], "cycle {cycle}");
    }
    assert_eq!((requests(600), requests(898)), (vec![13; 3], vec![13; 3]));
    assert!((320..600).all(|cycle| run.row(3, cycle).mls == 0 && run.row(5, cycle).mls == 0));
    let said = |cycle| {
        run.telegrams_in(cycle)
            .any(|(.., octets)| octets[..] == *b"\x68\x07\x07\x68\xFF\x82\x46\x3A\x3E\x02\x00\x41\x16")
    };
    assert!(
        said(320) && !said(319) && (0..3).all(|third| (327 + 6 * third..333 + 6 * third).any(said)),
        "every 6 cycles"
    );
    assert_eq!(
        (run.faults_of(3), run.faults_of(4), run.faults_of(5)),
        (vec![(321, 0x0F02)], vec![], vec![(321, 0x0F02)])
    );
    for slave in [3, 4, 5] {
        assert!((632..=651).contains(&run.phases_of(slave).last().expect("operation").1), "slave {slave}");
        assert_eq!(run.counts_of(slave).phase, Phase::Operation);
    }

    // Without the flag nothing of this happens to the others.
    let without = Run::of(&scenario("auto-clear", &[("master.auto_clear", "false")]));
    assert!(without.faults_of(3).is_empty() && without.row(3, 500).mls != 0);
    // A time longer than the slave is gone neither.
    let patient = Run::of(&scenario("auto-clear", &[("master.data_control_time", "150 ms")]));
    assert!(patient.faults_of(3).is_empty());
}

#[test]
fn diagnosis() {
    let run = Run::of(&scenario("diagnosis", &[]));
    assert_eq!(diagnoses(&run, 5), [(303, [0x00, 0x0C, 0x00])]);
    assert_eq!(run.counts_of(5).diagnoses, 1);
    assert!([3, 4].into_iter().all(|slave| run.counts_of(slave).diagnoses == 0));
    let counters: Vec<_> = (300..306).map(|cycle| run.row(5, cycle).life_counter).collect();
    assert_eq!(counters, [0, 0, 10, 20, 19, 18]);
    assert!([3, 4, 5].into_iter().all(|slave| run.faults_of(slave).is_empty() && trips(&run, slave).is_empty()));
    let t_dx = |cycle: u64| run.cycles[cycle as usize].t_dx.expect("slaves exchange data");
    assert_eq!(t_dx(301) - t_dx(303), BitRate::M12.span(Tbit(66)));
    assert_eq!((t_dx(200), t_dx(304)), (t_dx(100), t_dx(100)));
    let strict = Run::of(&scenario("diagnosis", &[("slave.5.max_life_failures", "1")]));
    assert_eq!(strict.faults_of(5), [(303, 0x0F02)]);
}
