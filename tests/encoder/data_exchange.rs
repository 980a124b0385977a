//! Manual 2.2, 5.2 and 5.3: the words of telegram 81, the LEDs and the fault codes.

use isodp::observation::{Leds, Observation, Phase};
use isodp::time::Span;

use super::start_up::{in_phase, repeat};
use crate::rig::{CFG, CHK_CFG, MASTER, PRM, Reply, Rig, SET_PRM, SLAVE_DIAG, prm};

/// Octet 15 bit 1 and the T_I that it needs (manual 3.2.2).
const ENABLED: [(usize, u8); 2] = [(15, 0x02), (49, 3)];
const HOME_MODE: u16 = 1 << 11;
const PRESET: u16 = 1 << 12;
const VALUE: u16 = 1 << 13;
const PARK: u16 = 1 << 14;
const BIT_15: u16 = 1 << 15;

#[test]
fn section_2_2_g1_xist1_is_left_justified_and_g1_xist2_right_justified() {
    let mut rig = Rig::exchanging(&PRM);
    for (rev, step, xist1, xist2) in [
        (0, 0, 0x0000_0000, 0x0000_0000),
        (0, 1, 0x0000_0080, 0x0000_0001),
        (0, 8_191, 0x000F_FF80, 0x0000_1FFF),
        (1, 0, 0x0010_0000, 0x0000_2000),
        (1, 4_096, 0x0018_0000, 0x0000_3000),
        (2_047, 8_191, 0x7FFF_FF80, 0x00FF_FFFF),
        (4_095, 8_191, 0xFFFF_FF80, 0x01FF_FFFF),
    ] {
        rig.raw = rev * 8_192 + step;
        let inputs = rig.cycle(0, VALUE);
        assert_eq!((inputs.xist1, inputs.xist2, inputs.g1_zsw.0), (xist1, xist2, VALUE), "{rev} rev {step}");
        assert_eq!(rig.cycle(0, 0).xist2, 0, "not requested");
    }
}

/// A locked encoder acts at T_O of cycle n, and the reply of cycle n+1 shows it; a free-running one at once (Model: D8).
#[test]
fn section_2_2_a_control_word_of_cycle_n_shows_in_the_reply_of_cycle_n_plus_1() {
    for (stw, zsw) in [(VALUE, VALUE), (PARK, PARK), (PRESET, PRESET), (1 << 3, BIT_15)] {
        let (mut rig, mut life) = in_phase(&prm(&ENABLED), Phase::Operation);
        rig.raw = 77;
        rig.cycle(life.next(), 0);
        assert_eq!(rig.cycle(life.next(), stw).g1_zsw.0, 0, "{stw:04X} in cycle n");
        assert_eq!(rig.cycle(life.next(), stw).g1_zsw.0, zsw, "{stw:04X} in cycle n + 1");
        let mut rig = Rig::exchanging(&prm(&ENABLED));
        assert_eq!(rig.cycle(0, stw).g1_zsw.0, zsw, "{stw:04X}, free-running");
    }
}

#[test]
fn section_2_2_the_position_latched_at_the_end_of_cycle_n_travels_in_cycle_n_plus_1() {
    let (mut rig, mut life) = in_phase(&PRM, Phase::Operation);
    for raw in 1_000..1_020 {
        let before = rig.raw;
        rig.raw = raw;
        assert_eq!(rig.cycle(life.next(), VALUE).xist1, before << 7);
    }
}

#[test]
fn section_2_2_preset_sets_the_position_to_0_with_the_rising_edge() {
    for locked in [false, true] {
        let (mut rig, mut life) = in_phase(&prm(&ENABLED), if locked { Phase::Operation } else { Phase::Clock });
        let mut cycle = |rig: &mut Rig, raw, stw| {
            rig.raw = raw;
            // The reply of the next cycle, before anything else moves.
            rig.cycle(if locked { life.next() } else { 0 }, stw);
            rig.encoder.inputs().to_owned()
        };
        cycle(&mut rig, 5_000, VALUE);
        let set = cycle(&mut rig, 5_000, VALUE | PRESET);
        assert_eq!((set.xist1, set.xist2, set.g1_zsw.0), (0, 0, VALUE | PRESET));
        assert_eq!(cycle(&mut rig, 5_010, VALUE | PRESET).xist2, 10, "a held bit sets nothing");
        assert_eq!(cycle(&mut rig, 4_999, VALUE).xist2, (1 << 25) - 1, "below 0 the range ends");
        let shifted = cycle(&mut rig, 5_020, VALUE | PRESET | HOME_MODE);
        assert_eq!((shifted.xist2, shifted.g1_zsw.0), (20, VALUE | PRESET), "a shift by 0");
    }
}

#[test]
fn section_2_2_a_preset_with_the_first_request_is_about_its_own_position() {
    let mut rig = Rig::exchanging(&prm(&ENABLED));
    rig.raw = 5_000;
    assert_eq!(rig.cycle(0, PRESET | VALUE).xist2, 0);
    rig.raw = 5_007;
    assert_eq!(rig.cycle(0, VALUE).xist2, 7);
}

#[test]
fn section_3_2_2_a_preset_that_is_not_enabled_is_0f01() {
    for options in [0x00, 0x01, 0x08] {
        let mut rig = Rig::exchanging(&prm(&[(15, options)]));
        rig.raw = 5_000;
        let refused = rig.cycle(0, PRESET | VALUE);
        assert_eq!((refused.xist1, refused.xist2, refused.g1_zsw.0), (5_000 << 7, 0x0F01, BIT_15));
        rig.cycle(0, VALUE | BIT_15);
        assert_eq!(rig.cycle(0, VALUE).xist2, 5_000, "acknowledged, and nothing was set");
    }
}

#[test]
fn section_2_2_parking_shows_no_error_and_no_position_and_the_sign_of_life_runs_on() {
    let (mut rig, mut life) = in_phase(&PRM, Phase::Operation);
    rig.raw = 99;
    rig.cycle(life.next(), 1);
    assert_eq!(rig.cycle(life.next(), 1 | PARK).xist2, 0x0F01);
    let mut last = rig.cycle(life.next(), 1 | PARK).zsw2.0 >> 12;
    for _ in 0..20 {
        let parked = rig.cycle(life.next(), 1 | PARK);
        assert_eq!((parked.g1_zsw.0, parked.xist1, parked.xist2), (PARK, 0, 0));
        assert_eq!(parked.zsw2.0 >> 12, last % 15 + 1);
        last = parked.zsw2.0 >> 12;
    }
    // Faults while parked are not kept.
    repeat(2, || rig.cycle(0, PARK));
    rig.cycle(0, 0);
    let back = rig.cycle(0, 0);
    assert_eq!((back.g1_zsw.0, back.xist1, back.xist2), (0, 99 << 7, 0));
}

#[test]
fn section_5_3_reserved_bits_are_0f01_as_long_as_they_are_set() {
    for bit in 0..=10 {
        let mut rig = Rig::exchanging(&PRM);
        let stw = 1 << bit;
        assert_eq!(rig.cycle(0, stw).xist2, 0x0F01, "bit {bit}");
        let held = rig.cycle(0, stw | BIT_15);
        assert_eq!((held.g1_zsw.0, held.xist2), (BIT_15 | 1 << 11, 0x0F01), "the cause is there: in process");
        let gone = rig.cycle(0, BIT_15);
        assert_eq!((gone.g1_zsw.0, gone.xist2), (0, 0));
    }
}

#[test]
fn section_5_2_the_six_patterns_on_the_bench() {
    let mut rig = Rig::new();
    assert_eq!(rig.leds(), Leds::NotConfigured, "2: ready, without configuration");
    rig.srd(SLAVE_DIAG, &[]);
    assert_eq!(rig.leds(), Leds::NotConfigured);
    rig.srd(SET_PRM, &PRM[..58]);
    assert_eq!(rig.leds(), Leds::Refused, "3: wrong length");
    rig.srd(SET_PRM, &prm(&[(1, 0x80)]));
    assert_eq!(rig.leds(), Leds::NotAddressed, "4: parameters, no data");
    rig.srd(CHK_CFG, &CFG[..3]);
    assert_eq!(rig.leds(), Leds::Refused, "3: wrong configuration");
    rig.srd(SET_PRM, &PRM);
    rig.srd(CHK_CFG, &CFG);
    assert_eq!(rig.leds(), Leds::DataExchange, "6");
    rig.advance(rig.now + Span::from_ms(200));
    assert_eq!(rig.leds(), Leds::NotAddressed, "4: the watchdog ended data exchange");
    rig.advance(rig.now + Span::from_ms(39_700));
    assert_eq!(rig.leds(), Leds::NotAddressed);
    rig.advance(rig.now + Span::from_ms(200));
    assert_eq!(rig.leds(), Leds::Silence, "5: 40 s without a telegram");
    rig.srd(SLAVE_DIAG, &[]);
    assert_eq!(rig.leds(), Leds::NotAddressed, "4: a telegram");
    let changes = rig.seen.iter().filter(|what| matches!(what, Observation::Leds { .. })).count();
    assert_eq!(changes, 9, "from no supply on, each change is told once");
}

#[test]
fn section_5_2_with_the_watchdog_off_a_cut_line_stays_data_exchange() {
    let mut rig = Rig::exchanging(&prm(&[(1, 0x80)]));
    assert!(matches!(rig.exchange(&[0; 4]), Reply::Data(MASTER, _)));
    rig.advance(rig.now + Span::from_s(100));
    assert_eq!(rig.leds(), Leds::DataExchange);
}
