//! Facts of manuals and published calculations, one test per source, through the crate's public face.

use isodp::device::pll::{Pll, PllSettings};
use isodp::device::profile;
use isodp::fdl::params::BusParams;
use isodp::observation::{ClockVerdict, LifeState, Observation, Phase};
use isodp::study::plan::{Plan, smallest_t_o};
use isodp::study::scenario::{Scenario, ScenarioError};
use isodp::time::{BitRate, Local, Span, Tbit};
use isodp::wire::{FrameControl, Telegram};

use crate::support::{Run, address, scenario};

/// A scenario from text, with a list of `[[...]]` entries behind its tables.
fn parse(tables: &str, entries: &str) -> Result<Scenario, ScenarioError> {
    Scenario::parse("network", "network", &format!("{tables}\n{entries}"), &[])
}

/// Tables of a network at `rate` with a cycle of 4 ms, which every rate from 1.5 Mbit/s on can hold.
fn tables(rate: BitRate, cycles: u64, master: &str) -> String {
    format!(
        "[run]\ncycles = {cycles}\n[bus]\nrate = \"{}\"\n[master]\naddress = 2\nt_dp = \"4 ms\"\nt_i = \"125 us\"\n\
         t_o = \"2 ms\"\n{master}\n",
        rate.text()
    )
}

/// A slave of one of the two manuals.
fn encoder(number: u8, more: &str) -> String {
    format!(
        "[[slave]]\naddress = {number}\ndevice = \"scancon-sag-dpb1b\"\ncrystal = {{ within = \"50 ppm\" }}\n{more}\n"
    )
}

/// SINAMICS S120 manual, reference times: T_DX 300 us and T_O_MIN 125 us on a grid of 1500 x 1/12 us give T_O = 4 units,
/// with "more than" as with "at least"; T_DP is 8 units.
#[test]
fn v8_sinamics_s120_reference_times() {
    let grid = Span::from_iso_units(1_500);
    let (t_dx, t_o_min) = (Span::from_iso_units(3_600), grid);
    assert_eq!(smallest_t_o(t_dx, t_o_min, grid), grid * 4);
    assert_eq!((t_dx + t_o_min).ceil_to(grid), grid * 4);
    for device in profile::PROFILES {
        assert_eq!((device.io_grid(), device.dp_grid(), device.t_o_min), (grid, grid, t_o_min), "{}", device.name);
    }
    assert_eq!(grid * 8, Span::from_ms(1));
}

/// SIMODRIVE 611 universal manual: permitted jitter of Global_Control (ns) by bit rate, read as peak to peak.
const PERMITTED_JITTER: [(BitRate, i64); 4] =
    [(BitRate::M1_5, 800), (BitRate::M3, 900), (BitRate::M6, 900), (BitRate::M12, 1_000)];

/// With T_PLL_W as the permitted jitter, jitter inside of it is a hit in every cycle, at each bit rate.
#[test]
fn v10_permitted_clock_jitter_of_the_611u_keeps_lock() {
    for (rate, permitted) in PERMITTED_JITTER {
        // The encoder takes no window below 1 us (manual 3.3.8).
        let master = format!("gc_jitter = {{ kind = \"uniform\", half_width = \"{} ns\" }}", permitted / 2);
        let network = parse(&tables(rate, 2_000, &master), &[encoder(3, ""), encoder(4, "")].concat());
        let run = Run::of(&network.expect("a good scenario"));
        for slave in [3, 4] {
            let counts = run.counts_of(slave);
            assert_eq!((counts.clock_failures, counts.fault_count()), (0, 0), "slave {slave} at {rate}");
            assert_eq!(counts.phase, Phase::Operation, "slave {slave} at {rate}");
        }
    }
}

/// The same with windows below 1 us too, as a loop alone; 1.1 times the window to each side fails and is lost.
#[test]
fn v10_clock_failures_accumulate_just_outside() {
    for (rate, permitted) in PERMITTED_JITTER {
        let window = Span::from_ns(permitted);
        for (tenths, lost) in [(5, false), (11, true)] {
            let most = window.ticks() / 10 * tenths;
            // Numbers of the middle-square kind would do; these are a full period of 2^20.
            let mut state = 1_i64;
            let noise = std::iter::repeat_with(move || {
                state = (state * 1_103_515_245 + 12_345) & 0xF_FFFF;
                (state - 0x8_0000) * most / 0x8_0000
            });
            let (failures, losses) = fed(window, noise.take(20_000));
            assert_eq!((failures > 0, losses > 0), (lost, lost), "{tenths}/10 of {permitted} ns at {rate}: {failures}");
        }
    }
}

/// Clock failures and losses of lock of a loop with this window at T_DP = 1 ms, once locked, for these jitters (ticks).
fn fed(window: Span, jitters: impl Iterator<Item = i64>) -> (usize, usize) {
    let t_dp = Span::from_ms(1);
    let settings = PllSettings { min_window: Span::from_ticks(1), ..PllSettings::new(t_dp, window, Span::ZERO) };
    let mut pll = Pll::new(settings);
    pll.start();
    let (mut failures, mut losses) = (0, 0);
    for (cycle, jitter) in (1..).zip(jitters) {
        let arrival = Local::ZERO + t_dp * cycle + Span::from_ticks(if cycle > 100 { jitter } else { 0 });
        let was = pll.is_locked();
        let end = pll.window_end();
        let mut verdicts = Vec::new();
        if let Some(end) = end.filter(|&end| end < arrival) {
            verdicts.extend(pll.window_closed(end).map(|judgement| judgement.verdict));
        }
        verdicts.extend(pll.synch(arrival).map(|judgement| judgement.verdict));
        let failed = |verdict: &&ClockVerdict| matches!(verdict, ClockVerdict::Missing | ClockVerdict::Outside);
        failures += verdicts.iter().filter(failed).count();
        losses += usize::from(was && !pll.is_locked());
    }
    (failures, losses)
}

/// ET 200M manual: with a clock jitter of 1.3 us a slave's own jitter is 5 us at most, and it takes up to 150 DP cycles
/// longer to start. Both sides of 1.3 us are taken; the window is 1.3 us / 0.39, which no sequence of them leaves.
#[test]
fn v11_et_200m_jitter_and_start_up() {
    let master = "t_pll_w = \"4 us\"\ngc_jitter = { kind = \"uniform\", half_width = \"1300 ns\" }";
    let network = parse(&tables(BitRate::M12, 3_000, master), &encoder(3, "")).expect("a good scenario");
    let run = Run::of(&network);
    let counts = run.counts_of(3);
    assert_eq!((counts.clock_failures, counts.fault_count()), (0, 0));
    assert!(counts.lock.is_some_and(|lock| lock.cycles <= 150), "{:?}", counts.lock);
    let latches = || run.slave(3).filter(|row| row.cycle > 100).filter_map(|row| row.latch_offset);
    let jitter = latches().max().expect("latches") - latches().min().expect("latches");
    assert!((Span::from_us(2)..=Span::from_us(5)).contains(&jitter), "{jitter}");
}

/// MASTERDRIVES compendium, P925 = 1 to 10: so many failures in a row survive from zero, one more trips.
#[test]
fn v12_failure_counter_of_the_sign_of_life() {
    for tolerance in 1..=10 {
        let lost = |slave, count| {
            format!("[[disturbance]]\nkind = \"lost-telegrams\"\nto = {slave}\ncycle = 200\nfor = {count}\n")
        };
        let own = format!("max_life_failures = {tolerance}");
        let entries = [encoder(3, &own), encoder(4, &own), lost(3, tolerance), lost(4, tolerance + 1)].concat();
        let tables = tables(BitRate::M12, 300, "lost_after = 50");
        let run = Run::of(&parse(&tables, &entries).expect("a good scenario"));
        let peak = |slave| run.slave(slave).map(|row| row.life_counter).max();
        assert_eq!((run.faults_of(3), peak(3)), (vec![], Some(10 * tolerance as u16)));
        assert_eq!(run.faults_of(4), [(200 + tolerance, 0x0F02)]);
        assert_eq!(peak(4), Some(10 * (tolerance + 1) as u16));
    }
}

/// The same rule for clocks (Model: D15).
#[test]
fn v12_failure_counter_of_the_clock() {
    for tolerance in 1..=10 {
        let own = |tolerance| format!("clock_tolerance = {tolerance}");
        let missing = format!("[[disturbance]]\nkind = \"missing-clocks\"\ncycle = 200\nfor = {}\n", tolerance + 1);
        let entries = [encoder(3, &own(tolerance + 1)), encoder(4, &own(tolerance)), missing].concat();
        let run = Run::of(&parse(&tables(BitRate::M12, 300, ""), &entries).expect("a good scenario"));
        let peak = |slave| run.slave(slave).map(|row| row.clock_counter).max();
        assert_eq!((run.faults_of(3), peak(3)), (vec![], Some(10 * (tolerance + 1) as u16)));
        assert_eq!(run.faults_of(4), [(200 + tolerance, 0x0F04)]);
        assert_eq!(peak(4), Some(10 * (tolerance + 1) as u16));
    }
}

/// With P925 = 1 a second failure trips unless ten good values lie between.
#[test]
fn v12_ten_good_values_repay_a_failure() {
    for (good, trips) in [(9, true), (10, false)] {
        let lost = |cycle| format!("[[disturbance]]\nkind = \"lost-telegrams\"\nto = 3\ncycle = {cycle}\nfor = 1\n");
        let missing = |cycle| format!("[[disturbance]]\nkind = \"missing-clocks\"\ncycle = {cycle}\nfor = 1\n");
        let entries = [encoder(3, ""), lost(200), lost(200 + good + 1), missing(250), missing(250 + good + 1)].concat();
        let run = Run::of(&parse(&tables(BitRate::M12, 350, ""), &entries).expect("a good scenario"));
        let first = (200 + good + 1, 0x0F02);
        // The first fault is shown, the second is kept behind it (Model: D18).
        let second = (250 + good + 1, 0x0F04);
        assert_eq!(run.faults_of(3), if trips { vec![first, second] } else { vec![] }, "{good} good values");
    }
}

/// ISG kernel: the master's limit for a slave's sign of life is 40, exceeded by the fifth failure in a row.
#[test]
fn v12_failure_counter_of_the_master() {
    for (count, trips) in [(4, false), (5, true)] {
        let lost = format!("[[disturbance]]\nkind = \"lost-telegrams\"\nfrom = 3\ncycle = 200\nfor = {count}\n");
        let run = Run::of(&parse(&tables(BitRate::M12, 300, ""), &[encoder(3, ""), lost].concat()).expect("good"));
        let tripped = |what: &Observation| matches!(what, Observation::SlaveLife { tripped: true, .. });
        let cycles: Vec<_> = run.events_of(2).filter(|row| tripped(&row.what)).map(|row| row.cycle).collect();
        assert_eq!(cycles, if trips { vec![204] } else { vec![] }, "{count} lost replies");
        assert!(run.faults_of(3).is_empty());
    }
}

/// The PROFIdrive sample application: the slave's sign of life leaves 0 exactly 16 n cycles after the first new value of
/// the master's, and tolerant operation begins 16 cycles later, for T_MAPC = n T_DP.
#[test]
fn v13_length_of_the_sign_of_life_synchronisation() {
    for (n, first, operation) in [(1, 16, 32), (2, 32, 48), (4, 64, 80), (14, 224, 240)] {
        let sets = [("master.t_mapc", n.to_string()), ("run.duration", "700 ms".to_owned())];
        let sets = [0, 1].map(|i| (sets[i].0, sets[i].1.as_str()));
        let run = Run::of(&scenario("startup", &sets));
        for slave in [3, 4] {
            let start = run.events_of(slave).find_map(|row| match row.what {
                Observation::MasterLife { to: LifeState::Strict, .. } => Some(row.cycle),
                _ => None,
            });
            let start = start.expect("a start value");
            // It is new: the value before was another one, and n cycles hold one value.
            assert_ne!(run.row(slave, start).mls, run.row(slave, start - 1).mls);
            let value = |cycle| run.row(slave, cycle).sls;
            assert!((0..start + first).all(|cycle| value(cycle) == 0), "n = {n}");
            // It begins with 1 and counts every T_DP, whatever T_MAPC is.
            assert_eq!([0, 1, 2, 13, 14, 15].map(|k| value(start + first + k)), [1, 2, 3, 14, 15, 1], "n = {n}");
            let reached = run.phases_of(slave).last().copied();
            assert_eq!(reached, Some((Phase::Operation, start + operation)), "n = {n}");
            let locked = run.phases_of(slave)[1].1;
            assert!(start - locked <= n, "n = {n}: locked in {locked}, start value in {start}");
            assert!(run.faults_of(slave).is_empty());
            let held = run.slave(slave).filter(|row| row.cycle >= start && row.mls == run.row(slave, start).mls);
            assert_eq!(held.take_while(|row| row.cycle < start + 15 * n).count() as u64, n);
        }
    }
}

/// A PROFIBUS manual's table of default times by bit rate (t_bit): T_QUI, T_SET, min T_SDR, max T_SDR, T_SL. T_ID1 is
/// T_QUI + 2 T_SET + 2 + T_SYN by the PBS600 manual.
#[test]
fn v16_default_times_by_bit_rate() {
    let slow = (0, 1, 11, 60, 100, 37);
    for (rate, expected) in [
        (BitRate::K9_6, slow),
        (BitRate::K19_2, slow),
        (BitRate::K93_75, slow),
        (BitRate::K187_5, slow),
        (BitRate::K500, (0, 1, 11, 100, 200, 37)),
        (BitRate::M1_5, (0, 1, 11, 150, 300, 37)),
        (BitRate::M3, (3, 4, 11, 250, 400, 46)),
        (BitRate::M6, (6, 8, 11, 450, 600, 57)),
        (BitRate::M12, (9, 16, 11, 800, 1_000, 76)),
    ] {
        let bus = BusParams::profile(rate);
        let times = (bus.t_qui.0, bus.t_set.0, bus.min_tsdr.0, bus.max_tsdr.0, bus.t_sl.0, bus.t_id1().0);
        assert_eq!(times, expected, "{rate}");
        assert_eq!(bus.t_id2(), bus.max_tsdr, "{rate}");
    }
}

/// On the line too 37 t_bit lie between a reply and the next request at 1.5 Mbit/s, and 76 at 12 Mbit/s, T_SDR between a
/// request and its reply, and T_ID2 behind SYNCH.
#[test]
fn v16_idle_times_on_the_line() {
    for (rate, t_id1, t_id2) in
        [(BitRate::M1_5, 37, 150), (BitRate::M3, 46, 250), (BitRate::M6, 57, 450), (BitRate::M12, 76, 800)]
    {
        let exact = |number| encoder(number, "").replace("{ within = \"50 ppm\" }", "\"0 ppm\"");
        let network = parse(&tables(rate, 150, ""), &[exact(3), exact(4)].concat()).expect("a good scenario");
        let run = Run::of(&network);
        let telegrams: Vec<_> = run.telegrams_in(120).collect();
        let gaps: Vec<_> = telegrams.windows(2).map(|pair| pair[1].0 - pair[0].1).collect();
        let bits = [30, t_id1, 30].map(|bits| rate.span(Tbit(bits)));
        assert_eq!(gaps[..3], bits, "{rate}");
        let t0 = run.cycles[120].t0;
        assert_eq!(telegrams[0].0 - t0, rate.span(Tbit(t_id2)), "{rate}");
        let replies = telegrams.iter().filter(|(.., octets)| match Telegram::parse(octets) {
            Ok(Telegram::Data { header, .. }) => matches!(header.fc, FrameControl::Response { .. }),
            _ => false,
        });
        assert_eq!(replies.map(|(.., sender, _)| *sender).collect::<Vec<_>>(), [3, 4].map(address), "{rate}");
    }
}

/// Encoder manual 6.4.2, dialog "Clocking": one encoder at 1.5 Mbit/s with T_BASE_IO 125 us, scaling off: the smallest
/// T_I is 0.125 ms, the smallest T_O 0.625 ms.
#[test]
fn v21_clocking_dialog() {
    let with = |t_i: &str, t_o: &str| {
        let times = format!("t_i = \"{t_i}\"\nt_o = \"{t_o}\"");
        parse(&tables(BitRate::M1_5, 200, ""), &encoder(3, &times))
    };
    let network = with("125 us", "625 us").expect("what the dialog offers");
    let plan = Plan::of(&network);
    let device = &network.slaves[0].device;
    assert_eq!(plan.t_dx, BitRate::M1_5.span(Tbit(150 + 143 + 150 + 231)));
    assert_eq!((device.t_i_min(false), plan.t_o_min(device)), (Span::from_us(125), Span::from_us(625)));
    for (t_i, t_o, key) in [("125 us", "500 us", "t_o"), ("0 us", "625 us", "t_i")] {
        let refused = with(t_i, t_o).expect_err("below what the dialog offers").to_string();
        assert!(refused.contains(&format!("slave.3.{key}")) && refused.contains("manual 3.3"), "{refused}");
    }
    // The slave itself takes these parameters and works with them.
    assert_eq!(Run::of(&network).counts_of(3).phase, Phase::Operation);
}
