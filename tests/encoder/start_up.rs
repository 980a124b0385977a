//! Manual 2.1 and 5.3: the five start-up phases, what disturbs them and how they begin anew.

use isodp::observation::{Observation, Phase, SlaveState};
use isodp::wire::drive::Inputs81;

use crate::rig::{CFG, CHK_CFG, Life, PRM, Rig, SET_PRM, T_DP, prm};

use Phase::{Clock, Configuration, MasterLife, Operation, SlaveLife};

/// Cycles of SYNCH from the first one that is seen to lock: itself, three halvings of the first window of 4.6 us down to
/// 1 us and the final width, four hits each (Model: D11, D12).
const LOCK: u32 = 17;
const ERROR: u16 = 0x8000;
const ACKNOWLEDGE: u16 = 0x8000;

type Way = fn(&mut Rig);

/// Goes on undisturbed until this phase begins; the cycles that this took.
pub(super) fn until(rig: &mut Rig, life: &mut Life, phase: Phase) -> u32 {
    for cycles in 0..700 {
        if rig.encoder.phase() == phase {
            return cycles;
        }
        rig.cycle(life.next(), 0);
    }
    panic!("{phase} is not reached");
}
/// An encoder in this phase, with the master's sign of life.
pub(super) fn in_phase(prm: &[u8], phase: Phase) -> (Rig, Life) {
    let mut rig = Rig::exchanging(prm);
    let mut life = Life::new(prm[42]);
    until(&mut rig, &mut life, phase);
    (rig, life)
}
/// Wrong signs of life in a row until 0F02.
pub(super) fn failures_until_trip(prm: &[u8]) -> u32 {
    let (mut rig, _) = in_phase(prm, Operation);
    (1..1_000)
        .find(|_| {
            rig.cycle(0, 0);
            rig.encoder.phase() != Operation
        })
        .expect("a trip")
}
/// Does something so many times.
pub(super) fn repeat<T>(times: u32, mut act: impl FnMut() -> T) {
    for _ in 0..times {
        let _ = act();
    }
}
fn faults(rig: &mut Rig) -> Vec<u16> {
    let seen = rig.take_seen();
    let code = |what: &Observation| if let Observation::Fault { code } = *what { Some(code) } else { None };
    seen.iter().filter_map(code).collect()
}
fn sls(inputs: &Inputs81) -> u16 {
    inputs.zsw2.0 >> 12
}
/// [`PRM`] with this T_MAPC.
fn with_t_mapc(n: u8) -> Vec<u8> {
    prm(&[(43, n)])
}

#[test]
fn section_2_1_2_the_clock_starts_with_operate_and_data_and_is_locked_after_17_synchs() {
    let mut rig = Rig::exchanging(&PRM);
    assert_eq!(rig.encoder.phase(), Configuration);
    rig.cycle(1, 0);
    assert_eq!(rig.encoder.phase(), Clock, "Operate was said, data came");
    for _ in 1..LOCK {
        rig.cycle(1, 0);
        assert_eq!(rig.encoder.phase(), Clock);
    }
    rig.cycle(1, 0);
    assert_eq!(rig.encoder.phase(), MasterLife);
    assert!(faults(&mut rig).is_empty());
}

#[test]
fn section_2_1_2_in_clear_the_clock_does_not_start() {
    let mut rig = Rig::exchanging(&PRM);
    rig.control([0x02, 0x00]);
    for _ in 0..50 {
        rig.cycle(0, 0);
    }
    assert_eq!(rig.encoder.phase(), Configuration);
}

#[test]
fn section_2_1_3_and_2_1_4_take_16_steps_and_16_cycles_for_every_t_mapc() {
    for n in 1..=14 {
        let (mut rig, mut life) = in_phase(&with_t_mapc(n), MasterLife);
        rig.take_seen();
        // Lock came in cycle 17, counted from 0; the first value after that which is another one starts.
        let first = 18_usize.next_multiple_of(n.into()) - 18;
        let mut seen = Vec::new();
        for _ in 0..first + 16 * usize::from(n) + 32 {
            let reply = sls(&rig.cycle(life.next(), 0));
            seen.push((sls(rig.encoder.inputs()), rig.encoder.phase(), reply));
        }
        let n = usize::from(n);
        let one = seen.iter().position(|&(sls, ..)| sls != 0).expect("a sign of life");
        assert_eq!(one, first + 16 * n, "n = {n}");
        let signs: Vec<_> = seen[one..].iter().take(16).map(|&(sls, ..)| sls).collect();
        assert_eq!(signs, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 1], "every T_DP, n = {n}");
        let phase = |phase| seen.iter().position(|&(_, now, _)| now == phase);
        assert_eq!((phase(SlaveLife), phase(Operation)), (Some(one), Some(one + 16)), "n = {n}");
        assert_eq!(seen[one + 1].2, 1, "the reply of the next cycle carries it");
        assert!(faults(&mut rig).is_empty());
    }
}
#[test]
fn section_2_1_3_any_wrong_value_begins_anew_without_a_fault() {
    for n in 1..=14 {
        for wrong in [0, 9] {
            let (mut rig, mut life) = in_phase(&with_t_mapc(n), MasterLife);
            for _ in 0..9 * u32::from(n) {
                rig.cycle(life.next(), 0);
            }
            let good = life.next();
            rig.cycle(if wrong == good { wrong + 1 } else { wrong }, 0);
            let cycles = until(&mut rig, &mut life, SlaveLife);
            assert!(cycles >= 16 * u32::from(n), "n = {n}: 16 steps from a new start, {cycles}");
            // A start in the middle of a value is found out at the next value; the one after that is a good start.
            assert!(cycles <= 16 * u32::from(n) + 2 * u32::from(n) + 1, "n = {n}: at once, {cycles}");
            assert!(faults(&mut rig).is_empty());
        }
    }
}

#[test]
fn section_2_1_4_any_wrong_value_ends_the_own_sign_of_life_without_a_fault() {
    for n in 1..=14 {
        let (mut rig, mut life) = in_phase(&with_t_mapc(n), SlaveLife);
        rig.cycle(life.next(), 0);
        assert_eq!(sls(rig.encoder.inputs()), 2);
        life.next();
        rig.cycle(0, 0);
        assert_eq!((rig.encoder.phase(), sls(rig.encoder.inputs())), (MasterLife, 0), "n = {n}");
        until(&mut rig, &mut life, Operation);
        assert!(faults(&mut rig).is_empty());
    }
}

#[test]
fn section_2_1_5_tolerated_failures_and_one_more() {
    for n in 1..=14 {
        let (mut rig, mut life) = in_phase(&with_t_mapc(n), Operation);
        life.next();
        rig.cycle(0, 0);
        assert_eq!(rig.encoder.phase(), Operation, "one is tolerated");
        for _ in 0..10 {
            rig.cycle(life.next(), 0);
        }
        for _ in 0..2 {
            life.next();
            rig.cycle(0, 0);
        }
        assert_eq!((rig.encoder.phase(), faults(&mut rig)), (MasterLife, vec![0x0F02]), "n = {n}");
        let shown = rig.cycle(life.next(), 0);
        assert_eq!((sls(&shown), shown.g1_zsw.0 & ERROR, shown.xist2), (0, ERROR, 0x0F02));
        // Synchronised again, the fault stays until it is acknowledged (manual 5.3).
        until(&mut rig, &mut life, Operation);
        let shown = rig.cycle(life.next(), ACKNOWLEDGE);
        assert_eq!((shown.g1_zsw.0 & ERROR, shown.xist2), (ERROR, 0x0F02));
        let shown = rig.cycle(life.next(), 0);
        assert_eq!((shown.g1_zsw.0, shown.xist2, sls(&shown) > 0), (0, 0, true));
    }
}

#[test]
fn section_2_1_2_clock_failures_before_lock_make_no_fault() {
    for lost in [1, 2, 3, 10] {
        let (mut rig, mut life) = in_phase(&PRM, Clock);
        for _ in 0..6 {
            rig.cycle(life.next(), 0);
        }
        for _ in 0..lost {
            rig.cycle_with(false, life.next(), 0);
        }
        let cycles = until(&mut rig, &mut life, MasterLife);
        // Six SYNCHs were the first one and five hits. A failure begins the run of four hits anew; the third one the lot.
        let expected = if lost >= 3 { LOCK } else { 12 };
        assert_eq!((cycles, faults(&mut rig)), (expected, vec![]), "{lost} lost");
    }
}

#[test]
fn section_2_1_2_a_lost_clock_is_fault_0f04_in_each_later_phase_and_everything_begins_anew() {
    for n in [1, 2, 14] {
        for phase in [MasterLife, SlaveLife, Operation] {
            let (mut rig, mut life) = in_phase(&with_t_mapc(n), phase);
            rig.cycle_with(false, life.next(), 0);
            assert_eq!((rig.encoder.phase(), faults(&mut rig)), (phase, vec![]), "one failure is tolerated in {phase}");
            let shown = rig.cycle_with(false, life.next(), 0);
            assert_eq!((rig.encoder.phase(), faults(&mut rig)), (Clock, vec![0x0F04]), "{phase}");
            assert_eq!((sls(&shown), shown.g1_zsw.0, shown.xist2), (0, ERROR, 0x0F04), "in the reply of this cycle");
            for _ in 0..20 {
                rig.cycle_with(false, life.next(), 0);
            }
            assert_eq!((rig.encoder.phase(), faults(&mut rig)), (Clock, vec![]), "no second fault while it waits");
            assert_eq!(until(&mut rig, &mut life, MasterLife), LOCK, "the clock is back");
            until(&mut rig, &mut life, Operation);
            let shown = rig.cycle(life.next(), ACKNOWLEDGE);
            assert_eq!((shown.g1_zsw.0, shown.xist2), (ERROR, 0x0F04), "kept until acknowledged");
            assert_eq!(rig.cycle(life.next(), 0).g1_zsw.0, 0);
        }
    }
}

#[test]
fn section_2_1_1_every_phase_ends_with_data_exchange() {
    for phase in [Clock, MasterLife, SlaveLife, Operation] {
        let ways: [(&str, Way); 5] = [
            ("watchdog", |rig| rig.advance(rig.now + T_DP * 101)),
            ("unlock", |rig| drop(rig.srd(SET_PRM, &prm(&[(1, 0x40)])))),
            ("new parameters", |rig| drop(rig.srd(SET_PRM, &PRM))),
            ("bad parameters", |rig| drop(rig.srd(SET_PRM, &PRM[..58]))),
            ("bad configuration", |rig| drop(rig.srd(CHK_CFG, &CFG[..5]))),
        ];
        for (name, way) in ways {
            let (mut rig, _) = in_phase(&PRM, phase);
            way(&mut rig);
            assert_eq!(rig.encoder.phase(), Configuration, "{name} in {phase}");
            assert_ne!(rig.state(), SlaveState::DataExch);
            // No latch and no T_O of before.
            rig.take_seen();
            rig.advance(rig.now + T_DP * 5);
            let late = |what: &Observation| matches!(what, Observation::Latch { .. } | Observation::SetPoint { .. });
            assert!(!rig.seen.iter().any(late), "{name} in {phase}");
            rig.srd(SET_PRM, &PRM);
            rig.srd(CHK_CFG, &CFG);
            rig.control([0x00, 0x00]);
            let mut life = Life::new(1);
            assert_eq!(until(&mut rig, &mut life, Operation), 1 + LOCK + 33);
            assert_eq!(rig.cycle(life.next(), 0).g1_zsw.0, 0, "a fault does not outlive data exchange");
        }
    }
}

#[test]
fn section_5_3_both_faults_pending_are_shown_in_the_order_of_their_coming() {
    // 0F02, then 0F04 while it waits to be acknowledged.
    let (mut rig, mut life) = in_phase(&PRM, Operation);
    repeat(2, || rig.cycle(0, 0));
    repeat(2, || rig.cycle_with(false, 5, 0));
    assert_eq!(faults(&mut rig), [0x0F02, 0x0F04]);
    until(&mut rig, &mut life, MasterLife);
    acknowledged(&mut rig, &mut life, [0x0F02, 0x0F04]);
    // 0F04, then 0F02 after everything is synchronous again.
    let (mut rig, mut life) = in_phase(&PRM, Operation);
    repeat(2, || rig.cycle_with(false, 5, 0));
    until(&mut rig, &mut life, Operation);
    repeat(2, || rig.cycle(0, 0));
    assert_eq!(faults(&mut rig), [0x0F04, 0x0F02]);
    acknowledged(&mut rig, &mut life, [0x0F04, 0x0F02]);
}
/// Two acknowledgements clear these two, each in the reply of the next cycle.
fn acknowledged(rig: &mut Rig, life: &mut Life, codes: [u32; 2]) {
    for (code, next) in [(codes[0], codes[1]), (codes[1], 0)] {
        let shown = rig.cycle(life.next(), ACKNOWLEDGE);
        assert_eq!((shown.g1_zsw.0, shown.xist2), (ERROR, code));
        let shown = rig.cycle(life.next(), ACKNOWLEDGE);
        assert_eq!((shown.g1_zsw.0 & ERROR != 0, shown.xist2), (next != 0, next), "a held bit acknowledges once");
        rig.cycle(life.next(), 0);
    }
}
