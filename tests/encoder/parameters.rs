//! Manual 3 and 5.1: every parameter, every rule broken by itself, and what becomes of it.

use isodp::device::isochronous::IsoSettings;
use isodp::device::options::UnitOptions;
use isodp::observation::{ClockVerdict, Leds, Observation, SlaveState};
use isodp::time::Span;
use isodp::wire::prm::{Block, BlockType, IsoM, SetPrm, UserPrm81};
use isodp::wire::{Service, Status};

use crate::rig::{CFG, CHK_CFG, ENCODER, MASTER, PRM, Reply, Rig, SET_PRM, prm};

const OUTPUTS: [u8; 4] = [0; 4];
const RS: Reply = Reply::Status(Status::Rs);
/// Diagnosis with Prm_Fault, with Cfg_Fault, after good parameters, in data exchange (manual 5.1).
pub(super) const PRM_FAULT: [u8; 6] = [0x42, 0x05, 0x00, 0xFF, 0x06, 0xDF];
const CFG_FAULT: [u8; 6] = [0x06, 0x05, 0x00, 0xFF, 0x06, 0xDF];
const WAITS_CFG: [u8; 6] = [0x02, 0x0C, 0x00, MASTER, 0x06, 0xDF];
const READY: [u8; 6] = [0x00, 0x0C, 0x00, MASTER, 0x06, 0xDF];

/// Good parameters and the good configuration lead into data exchange, whatever was before.
fn recovers(rig: &mut Rig) {
    assert_eq!(rig.srd(SET_PRM, &PRM), Reply::Ack);
    assert_eq!((rig.diag(), rig.leds()), (WAITS_CFG.to_vec(), Leds::NotAddressed));
    assert_eq!(rig.srd(CHK_CFG, &CFG), Reply::Ack);
    assert_eq!((rig.diag(), rig.leds()), (READY.to_vec(), Leds::DataExchange));
    assert!(matches!(rig.exchange(&OUTPUTS), Reply::Data(MASTER, du) if du.len() == 12));
}
/// The encoder acknowledges this Set_Prm and then says Prm_Fault and stays out of data exchange, until it gets good ones.
fn refused(du: &[u8], why: &str) {
    let mut rig = Rig::new();
    assert_eq!(rig.srd(SET_PRM, du), Reply::Ack, "{why}");
    assert_eq!((rig.diag(), rig.leds()), (PRM_FAULT.to_vec(), Leds::Refused), "{why}");
    assert_eq!(rig.srd(CHK_CFG, &CFG), RS, "{why}");
    assert_eq!(rig.exchange(&OUTPUTS), RS, "{why}");
    assert_eq!(rig.state(), SlaveState::WaitPrm, "{why}");
    recovers(&mut rig);
}
fn accepted(du: &[u8], why: &str) {
    let mut rig = Rig::new();
    assert_eq!(rig.srd(SET_PRM, du), Reply::Ack);
    assert_eq!(rig.state(), SlaveState::WaitCfg, "{why}");
}
/// The first of these is refused, the second accepted: the rule lies between them.
fn border(bad: &[(usize, u8)], good: &[(usize, u8)], why: &str) {
    refused(&prm(bad), why);
    accepted(&prm(good), why);
}
/// Octets of a 16-bit or 32-bit value.
fn u16_at(octet: usize, value: u16) -> [(usize, u8); 2] {
    let [high, low] = value.to_be_bytes();
    [(octet, high), (octet + 1, low)]
}
fn u32_at(octet: usize, value: u32) -> [(usize, u8); 4] {
    let [a, b, c, d] = value.to_be_bytes();
    [(octet, a), (octet + 1, b), (octet + 2, c), (octet + 3, d)]
}
/// The scaled encoder: octet 15 bits 1 and 3, T_I and the gap 375 us.
fn scaled(units: u32, range: u32) -> Vec<(usize, u8)> {
    let mut all = vec![(15, 0x0A), (49, 3)];
    all.extend(u32_at(16, units));
    all.extend(u32_at(20, range));
    all
}

#[test]
fn section_3_1_set_prm_has_59_octets_with_these_fields() {
    let set_prm = SetPrm::parse(&PRM).expect("parameters");
    assert_eq!((PRM.len(), set_prm.status.0, set_prm.watchdog_units(), set_prm.min_tsdr), (59, 0x88, Some(20), 11));
    assert_eq!((set_prm.ident, set_prm.group, set_prm.dpv1.octets()), (0x06DF, 0x80, [0xC0, 0x00, 0x18]));
    let blocks: Vec<Block<'_>> = set_prm.blocks().map(|block| block.expect("a block")).collect();
    let places: Vec<_> = blocks.iter().map(|block| (block.octet, block.kind, 4 + block.data.len())).collect();
    assert_eq!(places, [(11, BlockType::User, 21), (32, BlockType::IsoM, 28)]);
    let mut changed = scaled(100, 12_800);
    changed.push((24, 7));
    let changed = prm(&changed);
    let user = SetPrm::parse(&changed).expect("parameters").blocks().next().expect("a block").expect("a block");
    let user = UserPrm81::parse(&user).expect("the user block");
    assert_eq!(
        (user.options.0, user.units_per_revolution, user.total_range, user.max_failures),
        (0x0A, 100, 12_800, 7)
    );
    let iso = IsoM::parse(&blocks[1]).expect("the isochronous block");
    let expected = IsoM {
        version: 1,
        t_base_dp: 1_500,
        t_dp: 16,
        t_mapc: 1,
        t_base_io: 1_500,
        t_i: 1,
        t_o: 8,
        t_dx: 5_388,
        t_pll_w: 12,
        t_pll_d: 0,
    };
    assert_eq!(iso, expected);
    recovers(&mut Rig::new());
}

#[test]
fn section_3_1_set_prm_of_another_length_is_refused() {
    for len in (0..=62).filter(|&len| len != PRM.len()) {
        let mut du = PRM.to_vec();
        du.resize(len, 0);
        refused(&du, &format!("{len} octets"));
    }
}

#[test]
fn section_3_1_another_ident_or_a_reserved_bit_is_refused() {
    for (octet, value) in [(5, 0x07), (6, 0xDE), (1, 0x89), (1, 0x8A), (1, 0x8C), (8, 0xC8), (8, 0xD0)] {
        refused(&prm(&[(octet, value)]), &format!("octet {octet} is {value:02X}"));
    }
    for (octet, value) in [(9, 0x02), (10, 0x38), (10, 0x58), (2, 0), (3, 0)] {
        refused(&prm(&[(octet, value)]), &format!("octet {octet} is {value:02X}"));
    }
    // "Currently not used" (manual 3.1): octet 15 bits 2 and 4 to 7, octets 25 to 31.
    for (octet, value) in (25..=31).map(|octet| (octet, 0xFF)).chain([(15, 0xF4)]) {
        accepted(&prm(&[(octet, value)]), "octets that are not used say nothing");
    }
}

#[test]
fn section_3_1_sync_and_freeze_are_not_supported() {
    for status in [0xA8, 0x98] {
        let mut rig = Rig::new();
        assert_eq!(rig.srd(SET_PRM, &prm(&[(1, status)])), Reply::Ack);
        assert_eq!((rig.diag(), rig.leds()), (vec![0x12, 0x05, 0x00, 0xFF, 0x06, 0xDF], Leds::Refused));
        recovers(&mut rig);
    }
}

#[test]
fn section_3_1_each_block_is_there_once_with_its_own_length_and_type() {
    let (head, user, iso) = (&PRM[..10], &PRM[10..31], &PRM[31..]);
    let of = |blocks: &[&[u8]]| [&[head], blocks].concat().concat();
    accepted(&of(&[iso, user]), "the order of the blocks is free");
    for (blocks, why) in [
        (&[user][..], "isochronous mode without its block"),
        (&[iso], "no user block"),
        (&[user, iso, iso], "two isochronous blocks"),
        (&[user, user, iso], "two user blocks"),
        (&[user, iso, &[4, 0x42, 0, 0]], "an unknown block"),
        (&[user, iso, &[8, 0x02, 0, 0, 0, 0, 0, 0]], "redundancy"),
        (&[user, iso, &[9, 0x03, 0, 0, 1, 3, 12, 4, 4]], "an encoder does not subscribe"),
        (&[user, iso, &[4, 0x04, 0, 0]], "a second isochronous block, empty"),
        (&[user, iso, &[3, 0x42, 0]], "a block shorter than its head"),
        (&[user, iso, &[0, 0, 0, 0]], "a block of no length"),
    ] {
        refused(&of(blocks), why);
    }
    for (octet, value) in [(11, 20), (11, 22), (32, 27), (32, 29), (12, 0x82), (33, 0x05), (12, 0x04), (33, 0x81)] {
        refused(&prm(&[(octet, value)]), &format!("octet {octet} is {value:02X}"));
    }
    for (octet, value) in [(13, 1), (14, 1), (34, 1), (35, 1), (36, 0), (36, 2)] {
        refused(&prm(&[(octet, value)]), &format!("slot, specifier or version: octet {octet} is {value:02X}"));
    }
    // A block one octet shorter or longer in a telegram that fits it.
    let longer = |block: &[u8]| [&[block[0] + 1], &block[1..], &[0]].concat();
    let shorter = |block: &[u8]| [&[block[0] - 1], &block[1..block.len() - 1]].concat();
    for (user, iso) in [(longer(user), iso.to_vec()), (shorter(user), iso.to_vec())] {
        refused(&of(&[&user, &iso]), "the user block has 21 octets");
    }
    for (user, iso) in [(user.to_vec(), longer(iso)), (user.to_vec(), shorter(iso))] {
        refused(&of(&[&user, &iso]), "the isochronous block has 28 octets");
    }
    refused(&prm(&[(10, 0x10)]), "no structure: octets 11 to 59 are no blocks");
    refused(&PRM[..7], "parameters of DP-V0 alone");
}

#[test]
fn section_3_1_without_isochronous_mode_the_encoder_runs_freely() {
    let du = [&PRM[..9], &[0x08], &PRM[10..31]].concat();
    let mut rig = Rig::exchanging(&du);
    for raw in [5, 700] {
        rig.raw = raw;
        let inputs = rig.cycle(0, 0x2000);
        assert_eq!((inputs.zsw2.0, inputs.xist1, inputs.xist2), (0, raw << 7, raw));
    }
}

#[test]
fn section_3_2_1_code_sequence_turns_the_direction_if_enabled() {
    // Octet 15, position of 1000 steps clockwise. Bit 0 without bit 1 changes nothing (manual 3.2.2).
    for (options, xist2) in [(0x00, 1_000), (0x01, 1_000), (0x02, 1_000), (0x03, (1 << 25) - 1 - 1_000)] {
        let mut rig = Rig::exchanging(&prm(&[(15, options), (49, 3)]));
        rig.raw = 1_000;
        assert_eq!(rig.cycle(0, 0x2000).xist2, xist2, "octet 15 is {options:02X}");
    }
}

#[test]
fn section_3_2_2_functions_need_375_us_of_t_i_and_gap() {
    // T_I 125 and 375 us with bit 1; with bit 1 off 125 us will do.
    for options in [0x02, 0x03, 0x0A, 0x0B] {
        border(&[(15, options), (49, 2)], &[(15, options), (49, 3)], "T_I is 375 us or more with octet 15 bit 1");
        // T_DP 2 ms, T_I 375 us: T_O up to 1250 us.
        let at = |t_o| [(15, options), (49, 3), (51, t_o)];
        border(&at(11), &at(10), "the gap is 375 us or more with octet 15 bit 1");
    }
    for options in [0x00, 0x01, 0x08, 0x09] {
        border(&[(15, options), (49, 0)], &[(15, options), (49, 1)], "T_I is 125 us or more");
    }
}

#[test]
fn section_3_2_2_scaling_needs_bits_1_and_3() {
    for (options, xist2) in [(0x00, 4_096), (0x08, 4_096), (0x02, 4_096), (0x0A, 50)] {
        let mut changes = scaled(100, 12_800);
        changes.push((15, options));
        let mut rig = Rig::exchanging(&prm(&changes));
        rig.raw = 4_096;
        assert_eq!(rig.cycle(0, 0x2000).xist2, xist2, "octet 15 is {options:02X}");
    }
}

#[test]
fn section_3_2_3_units_per_revolution_up_to_the_steps_of_the_disc() {
    border(&scaled(8_193, 8_192), &scaled(8_192, 8_192), "8192 steps");
    refused(&prm(&scaled(0, 8_192)), "no units");
    refused(&prm(&scaled(u32::MAX, 8_192)), "2^32 - 1 units");
    let mut off = scaled(8_193, 8_192);
    off.push((15, 0x02));
    accepted(&prm(&off), "without scaling the value says nothing");
}

#[test]
fn section_3_2_4_total_range_up_to_units_times_revolutions() {
    // Equality is accepted: the manual's own default has it (Model: D20).
    border(&scaled(4_096, 16_777_217), &scaled(4_096, 16_777_216), "4096 x 4096");
    border(&scaled(8_192, 33_554_433), &scaled(8_192, 33_554_432), "8192 x 4096");
    border(&scaled(100, 409_601), &scaled(100, 409_600), "100 x 4096");
    refused(&prm(&scaled(100, 0)), "no range");
    refused(&prm(&scaled(1, u32::MAX)), "2^32 - 1");
}

#[test]
fn section_3_2_4_the_manuals_example_counts_to_12799() {
    let mut rig = Rig::exchanging(&prm(&scaled(100, 12_800)));
    // 128 revolutions; 123.5 revolutions are 12350 units; 18 bits are left in front of 14.
    for (revs, steps, value) in
        [(0, 0, 0), (123, 4_096, 12_350), (127, 8_191, 12_799), (128, 0, 0), (255, 8_191, 12_799)]
    {
        rig.raw = revs * 8_192 + steps;
        let inputs = rig.cycle(0, 0x2000);
        assert_eq!((inputs.xist1, inputs.xist2), (value << 18, value));
    }
}

#[test]
fn section_3_2_5_octet_24_is_the_number_of_tolerated_failures() {
    for tolerated in [0, 1, 3, 255] {
        let du = prm(&[(24, tolerated)]);
        let set_prm = SetPrm::parse(&du).expect("parameters");
        let iso = IsoM::parse(&set_prm.blocks().nth(1).expect("a block").expect("a block")).expect("a block");
        assert_eq!(IsoSettings::new(&iso, du[23], &UnitOptions::default()).life.tolerance, u16::from(tolerated));
        let failures = super::start_up::failures_until_trip(&du);
        assert_eq!(failures, u32::from(tolerated) + 1, "octet 24 is {tolerated}");
    }
}

#[test]
fn section_3_3_1_t_base_dp_is_one_of_six() {
    for (base, t_dp) in [(375u32, 64), (750, 32), (1_500, 16), (3_000, 8), (6_000, 4), (12_000, 2)] {
        let of = |base| [&u32_at(37, base)[..], &u16_at(41, t_dp)].concat();
        border(&of(base + 1), &of(base), "T_BASE_DP in 1/12 us");
    }
    refused(&prm(&u32_at(37, 0)), "no time base");
}

#[test]
fn section_3_3_2_t_dp_is_500_us_to_32_ms() {
    // T_DX 1/12 us, T_O and T_I 125 us: room enough in the shortest cycle.
    let of = |t_dp| [&u16_at(41, t_dp)[..], &u32_at(52, 1), &u16_at(50, 2)].concat();
    border(&of(3), &of(4), "500 us");
    border(&of(257), &of(256), "32 ms");
    refused(&prm(&of(0)), "no cycle");
}

#[test]
fn section_3_3_3_t_mapc_is_1_to_14() {
    border(&[(43, 0)], &[(43, 1)], "T_MAPC in T_DP");
    border(&[(43, 15)], &[(43, 14)], "T_MAPC in T_DP");
    refused(&prm(&[(43, 255)]), "T_MAPC in T_DP");
}

#[test]
fn section_3_3_4_t_base_io_is_one_of_six() {
    for (base, t_i, t_o) in [(375u32, 4, 32), (750, 2, 16), (1_500, 1, 8), (3_000, 1, 4), (6_000, 1, 2), (12_000, 1, 0)]
    {
        let of = |base| [&u32_at(44, base)[..], &u16_at(48, t_i), &u16_at(50, t_o)].concat();
        refused(&prm(&of(base + 1)), "T_BASE_IO in 1/12 us");
        if t_o > 0 {
            accepted(&prm(&of(base)), "T_BASE_IO in 1/12 us");
        }
    }
    let one_ms = [&u32_at(44, 12_000)[..], &u16_at(41, 24), &u16_at(48, 1), &u16_at(50, 1)].concat();
    accepted(&prm(&one_ms), "T_DP 3 ms, T_I and T_O 1 ms");
}

#[test]
fn section_3_3_5_t_i_is_125_us_or_more_and_ends_after_t_o() {
    border(&u16_at(48, 0), &u16_at(48, 1), "125 us");
    // T_DP 2 ms, T_O 1 ms: T_I up to 875 us.
    border(&u16_at(48, 8), &u16_at(48, 7), "the gap is 125 us or more");
    for t_i in [15, 16, 17, u16::MAX] {
        refused(&prm(&u16_at(48, t_i)), "T_I is less than T_DP");
    }
}

#[test]
fn section_3_3_6_t_o_is_after_t_dx_and_before_the_latch() {
    // T_DX 449 us: T_O above 574 us, and up to T_DP - T_I - 125 us.
    border(&u16_at(50, 4), &u16_at(50, 5), "T_O is more than T_DX + 125 us");
    border(&u16_at(50, 15), &u16_at(50, 14), "the gap is 125 us or more");
    for t_o in [0, 16, 17, u16::MAX] {
        refused(&prm(&u16_at(50, t_o)), "T_O is in the cycle");
    }
}

#[test]
fn section_3_3_7_t_dx_counts_in_twelfths_of_a_microsecond() {
    // T_O 1 ms is 12000: T_DX + 1500 must be less.
    border(&u32_at(52, 10_500), &u32_at(52, 10_499), "T_O is more than T_DX + 125 us");
    refused(&prm(&u32_at(52, u32::MAX)), "a T_DX of six minutes");
    accepted(&prm(&u32_at(52, 0)), "nothing is exchanged");
}

#[test]
fn section_3_3_8_a_window_below_1_us_is_raised_silently() {
    border(&u16_at(56, 0), &u16_at(56, 1), "T_PLL_W is 1/12 us or more");
    border(&u16_at(56, 241), &u16_at(56, 240), "T_PLL_W_MAX is 20 us");
    // What the clock recovery ends with (1/12 us).
    for (asked, taken) in [(1, 12), (11, 12), (12, 12), (13, 13), (240, 240)] {
        let mut rig = Rig::exchanging(&prm(&u16_at(56, asked)));
        super::start_up::repeat(40, || rig.cycle(0, 0));
        let last = rig.seen.iter().rev().find_map(|what| match *what {
            Observation::Clock { verdict: ClockVerdict::Hit, window, .. } => Some(window),
            _ => None,
        });
        assert_eq!(last, Some(Span::from_iso_units(taken)), "T_PLL_W is {asked}");
    }
}

#[test]
fn section_3_3_9_t_pll_d_delays_the_latch_but_not_beyond_the_next_clock() {
    // T_I 125 us is 1500, the window 12: a latch later than that would be pushed away by the next clock.
    border(&u16_at(58, 1_488), &u16_at(58, 1_487), "the delayed latch comes before the next clock");
    refused(&prm(&u16_at(58, u16::MAX)), "5 ms");
    let mut rig = Rig::exchanging(&prm(&u16_at(58, 600)));
    let mut latched_at = Vec::new();
    for k in 0..40 {
        // The shaft tells the instant: 80 us before the next clock it still stands, after 74 us it has moved.
        rig.raw = k;
        let _ = rig.cycle(0, 0x2000);
        latched_at.push(rig.encoder.inputs().xist2);
    }
    assert_eq!(latched_at[39], 39, "T_I 125 us less 50 us delay, before the end of the cycle");
}

#[test]
fn section_3_4_a_publisher_answers_msrd_to_everybody() {
    let mut rig = Rig::exchanging(&prm(&[(8, 0xE0)]));
    assert!(matches!(rig.exchange_from(MASTER, Service::Msrd, &OUTPUTS), Reply::Data(127, du) if du.len() == 12));
    assert!(matches!(rig.exchange(&OUTPUTS), Reply::Data(MASTER, _)), "SRD is answered to its master alone");
    let mut rig = Rig::exchanging(&PRM);
    assert_eq!(rig.exchange_from(MASTER, Service::Msrd, &OUTPUTS), RS, "without Publisher_Enable");
    assert_eq!(rig.state(), SlaveState::DataExch);
}

#[test]
fn section_2_1_1_another_configuration_is_refused() {
    let changed = (0..6).flat_map(|octet| (0..8).map(move |bit| (octet, bit))).map(|(octet, bit)| {
        let mut cfg = CFG.to_vec();
        cfg[octet] ^= 1 << bit;
        cfg
    });
    let other_lengths = (0..6).map(|len| CFG[..len].to_vec()).chain([[&CFG[..], &[0]].concat(), CFG.repeat(2)]);
    for cfg in changed.chain(other_lengths) {
        for exchanging in [false, true] {
            let mut rig = if exchanging { Rig::exchanging(&PRM) } else { Rig::parameterised(&PRM) };
            assert_eq!(rig.srd(CHK_CFG, &cfg), Reply::Ack, "{cfg:02X?}");
            assert_eq!((rig.diag(), rig.leds()), (CFG_FAULT.to_vec(), Leds::Refused), "{cfg:02X?}");
            assert_eq!(rig.exchange(&OUTPUTS), RS, "{cfg:02X?}");
            recovers(&mut rig);
        }
    }
}

#[test]
fn section_5_1_the_diagnosis_has_six_octets() {
    let mut rig = Rig::new();
    assert_eq!(rig.diag(), [0x02, 0x05, 0x00, 0xFF, 0x06, 0xDF], "wants parameters, belongs to nobody");
    recovers(&mut rig);
    let mut rig = Rig::parameterised(&prm(&[(1, 0x80)]));
    assert_eq!(rig.diag(), [0x02, 0x04, 0x00, MASTER, 0x06, 0xDF], "without watchdog");
    let other = rig.srd_from(ENCODER + 1, crate::rig::SLAVE_DIAG, &[]);
    assert_eq!(other, Reply::Data(ENCODER + 1, vec![0x02, 0x04, 0x00, MASTER, 0x06, 0xDF]), "everybody may ask");
}
