//! The planner against published figures, against a run, and against itself.

use std::fmt::Write as _;

use isodp::device::profile::{PROFILES, find};
use isodp::fdl::params::{BusParams, ParamRule};
use isodp::observation::{GapAnswer, Observation, Phase, SlaveState};
use isodp::study::plan::finding::{Finding, nearest};
use isodp::study::plan::proposal::Proposal;
use isodp::study::plan::rules::{self, Facts, Weight};
use isodp::study::plan::{self, Plan, message_cycle, octets, smallest_t_o};
use isodp::study::scenario::{Extent, Scenario};
use isodp::time::{BitRate, Span, Tbit, Time};
use isodp::wire::Address;
use proptest::prelude::*;

use crate::cli::Room;
use crate::props::config;
use crate::support::{Run, address};

/// What some estimates count twice: T_SYN, which is in T_ID1 (Model: D4).
const T_SYN: u32 = BusParams::T_SYN.0;

/// Felser's estimate for a single master, 300 + 11 x octets (t_bit), at 1.5 Mbit/s with T_SDR 32: 33 are counted twice.
#[test]
fn v1_message_cycle_at_1_5_mbit() {
    let bus = BusParams::profile(BitRate::M1_5);
    for (outputs, inputs) in [(0, 0), (4, 12), (4, 4), (16, 16), (244, 244), (1, 0)] {
        let published = 300 + 11 * (outputs + inputs) as u32;
        assert_eq!(message_cycle(&bus, outputs, inputs, Tbit(32)).0 + T_SYN, published, "{outputs} + {inputs}");
    }
}

/// Balluff's table at 12 Mbit/s: T_SDR 30, T_ID1 75 there and 76 by the formula, T_SYN once too often.
#[test]
fn v4_balluff_at_12_mbit() {
    let bus = BusParams::profile(BitRate::M12);
    let us = |bits: u32| bus.span(Tbit(bits)).as_us();
    // Their T_ID1 is one shorter.
    let published = |outputs, inputs| message_cycle(&bus, outputs, inputs, Tbit(30)).0 - 1 + T_SYN;
    let [overhead, eight, thirty_two] = [published(0, 0), published(4, 4), published(16, 16)];
    assert_eq!((overhead, us(overhead)), (336, 28.0));
    // They round an octet, 0.917 us, up to 1 us.
    for (bits, exact, rounded, octets) in [(eight, 35.33, 36.0, 8.0), (thirty_two, 57.33, 60.0, 32.0)] {
        assert!((us(bits) - exact).abs() < 0.005, "{} us", us(bits));
        assert!((rounded - us(bits) - octets / 12.0).abs() < 0.005, "{} us", us(bits));
    }
    let token = plan::TOKEN.0 + bus.t_id1().0 - 1;
    let status = plan::STATUS_REQUEST.0 + bus.t_id1().0 - 1;
    assert_eq!((us(token), us(status)), (9.0, 11.75));
    assert!((us(eight + token + status) - 56.08).abs() < 0.005);
}

/// All rates that devices on RS 485 have: 31.25 kbit/s is of another line.
const CABLE_RATES: &[BitRate] = &[
    BitRate::K9_6,
    BitRate::K19_2,
    BitRate::K45_45,
    BitRate::K93_75,
    BitRate::K187_5,
    BitRate::K500,
    BitRate::M1_5,
    BitRate::M3,
    BitRate::M6,
    BitRate::M12,
];

/// The DP profile's table: rate, T_QUI, T_SET, max T_SDR, T_SL, T_ID1 (t_bit).
#[test]
fn v16_default_times_and_t_id1_of_every_rate() {
    for &rate in BitRate::ALL {
        let (t_qui, t_set, max_tsdr, t_sl, t_id1) = match rate {
            BitRate::K500 => (0, 1, 100, 200, 37),
            BitRate::M1_5 => (0, 1, 150, 300, 37),
            BitRate::M3 => (3, 4, 250, 400, 46),
            BitRate::M6 => (6, 8, 450, 600, 57),
            BitRate::M12 => (9, 16, 800, 1_000, 76),
            _ => (0, 1, 60, 100, 37),
        };
        let bus = BusParams::profile(rate);
        let found = [bus.t_qui, bus.t_set, bus.min_tsdr, bus.max_tsdr, bus.t_sl, bus.t_id1(), bus.t_id2()];
        assert_eq!(found, [t_qui, t_set, 11, max_tsdr, t_sl, t_id1, max_tsdr].map(Tbit), "{rate}");
        // T_ID1 = T_QUI + 2 T_SET + 2 + T_SYN, at least min T_SDR.
        assert_eq!(t_id1, t_qui + 2 * t_set + 2 + T_SYN, "{rate}");
        assert!(bus.rules(Span::ZERO).iter().all(ParamRule::holds), "{rate}");
    }
}

/// Felser: T_TR >= n (T_TC + T_MC) + k T_MC.
#[test]
fn v17_shortest_target_rotation_time() {
    let bus = BusParams::profile(BitRate::M1_5);
    let (token, message) = (bus.t_tc(), message_cycle(&bus, 4, 12, Tbit(32)));
    assert_eq!((token, message), (Tbit(70), Tbit(443)));
    assert_eq!(bus.least_t_tr(1, 0, message), Tbit(513));
    assert_eq!(bus.least_t_tr(3, 2, message), Tbit(3 * 513 + 2 * 443));
}

/// SINAMICS S120: T_DX 3600 units, T_O_MIN 1 step of 125 us; T_O is 4 steps, T_I 2, T_DP 8.
#[test]
fn v8_reference_times_of_a_drive() {
    let grid = Span::from_us(125);
    assert_eq!(smallest_t_o(Span::from_iso_units(3_600), grid, grid), grid * 4);
    assert_eq!(plan::dead_time(grid * 2, grid * 4, grid * 8, 1), Span::from_us(1_750));
}

/// Manual 6.4.2: one encoder at 1.5 Mbit/s has T_I from 0.125 ms and T_O from 0.625 ms on.
#[test]
fn v21_clocking_dialog() {
    for device in ["scancon-sag-dpb1b", "posital-ocd-dpb1b"] {
        let text = format!(
            "[run]\ncycles = 1\n[bus]\nrate = \"1.5 Mbit/s\"\n[master]\naddress = 2\nt_dp = \"1 ms\"\nt_i = \"1 ms\"\nt_o = \
             \"0 us\"\n[[slave]]\naddress = 3\ndevice = \"{device}\"\n"
        );
        let scenario = to_plan(&text);
        let facts = Facts::of(&scenario);
        assert_eq!(facts.plan.t_dx, BitRate::M1_5.span(Tbit(674)));
        assert_eq!(facts.plan.t_o_min(&scenario.slaves[0].device), Span::from_us(625));
        let near = nearest_of(&facts.findings(), "slave.3.t_i").expect("a T_I");
        assert_eq!(near, "875 us", "the latest T_I that is shorter than T_DP");
        let proposed = Proposal::of(&scenario).expect("times").scenario.slaves[0].times;
        assert_eq!((proposed.t_i, proposed.t_o), (Span::from_us(125), Span::from_us(625)));
    }
}

fn to_plan(text: &str) -> Scenario {
    Scenario::parse_to_plan("drawn", "drawn.toml", text, &[]).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// The nearest value of the first violated rule about a key.
fn nearest_of(findings: &[Finding], key: &str) -> Option<String> {
    let broken = findings.iter().find(|found| found.key.to_string() == key && !found.holds())?;
    nearest(broken, findings).map(|near| near.to_string())
}

/// What is drawn of a network that is to be planned; all crystals are perfect.
#[derive(Clone, Debug)]
struct Net {
    rate: BitRate,
    cable_m: u32,
    master_m: u32,
    /// Device, own T_SDR (t_bit), octet 15 bit 1.
    slaves: Vec<(usize, u32, bool)>,
    first: u8,
    /// Links from the first encoders to the first drive.
    links: usize,
    t_mapc: u8,
    jitter_ns: u32,
    gap_factor: u8,
    active_spare: bool,
    get_cfg: bool,
}

prop_compose! {
    fn net(rates: &'static [BitRate])(
        rate in prop::sample::select(rates),
        cable_m in 0u32..=200,
        master_share in 0u32..=100,
        slaves in prop::collection::vec((0..PROFILES.len(), 11u32..900, any::<bool>()), 1..=20),
        first in 3u8..60,
        links in 0usize..4,
        t_mapc in 1u8..=3,
        (jitter_ns, gap_factor) in (prop_oneof![Just(0u32), 0u32..400], 1u8..6),
        (active_spare, get_cfg) in any::<(bool, bool)>(),
    ) -> Net {
        let master_m = cable_m * master_share / 100;
        Net { rate, cable_m, master_m, slaves, first, links, t_mapc, jitter_ns, gap_factor, active_spare, get_cfg }
    }
}

const FAST: &[BitRate] = &[BitRate::M1_5, BitRate::M3, BitRate::M6, BitRate::M12];

impl Net {
    /// The scenario with these times, which need not keep any rule.
    fn text(&self, t_dp: &str, t_i: &str, t_o: &str, more: &str) -> String {
        let jitter = match self.jitter_ns {
            0 => "{ kind = \"none\" }".to_owned(),
            ns => format!("{{ kind = \"uniform\", half_width = \"{ns} ns\" }}"),
        };
        let mut text = format!(
            "[run]\ncycles = 400\n[bus]\nrate = \"{}\"\ncable = \"{} m\"\ngap_factor = {}\n[master]\naddress = 2\nposition = \
             \"{} m\"\nt_dp = \"{t_dp}\"\nt_i = \"{t_i}\"\nt_o = \"{t_o}\"\nt_mapc = {}\nactive_spare = {}\nget_cfg = {}\n\
             gc_jitter = {jitter}\n{more}",
            self.rate, self.cable_m, self.gap_factor, self.master_m, self.t_mapc, self.active_spare, self.get_cfg
        );
        for (number, &(device, t_sdr, functions)) in self.slaves.iter().enumerate() {
            let device = &PROFILES[device];
            let t_sdr = t_sdr.min(device.max_tsdr(self.rate).0);
            let address = self.address(number);
            let _ = write!(
                text,
                "[[slave]]\naddress = {address}\ndevice = \"{}\"\nt_sdr = \"{t_sdr} tbit\"\n",
                device.name
            );
            if !device.subscriber {
                let _ = writeln!(text, "functions = {functions}");
            }
        }
        text + &self.link_text()
    }
    fn address(&self, number: usize) -> u8 {
        self.first + number as u8
    }
    fn link_text(&self) -> String {
        let of = |subscriber: bool| {
            let all = self.slaves.iter().enumerate();
            all.filter(move |(_, slave)| PROFILES[slave.0].subscriber == subscriber)
                .map(|(number, _)| self.address(number))
        };
        let Some(drive) = of(true).next() else { return String::new() };
        let link = |publisher| format!("[[link]]\npublisher = {publisher}\nsubscriber = {drive}\n");
        of(false).take(self.links).map(link).collect()
    }
    fn proposal(&self) -> Proposal {
        let scenario = to_plan(&self.text("1 ms", "0 us", "0 us", ""));
        Proposal::of(&scenario).unwrap_or_else(|broken| panic!("{broken:#?}"))
    }
}

/// The text with proposed values.
fn written(text: &str, scenario: &Scenario, proposal: &Proposal) -> String {
    plan::written(text, &[], scenario, proposal).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn broken(findings: &[Finding]) -> impl Iterator<Item = &Finding> {
    findings.iter().filter(|found| found.rule.weight == Weight::Must && !found.holds())
}

/// Whether T_DP holds everything; with 20 slow slaves at 1.5 Mbit/s and octet 15 bit 1 it always does: 32 ms are long.
fn proposed(net: &Net) -> Scenario {
    let text = net.text("1 ms", "0 us", "0 us", "");
    let text = written(&text, &to_plan(&text), &net.proposal());
    Scenario::parse("proposal", "proposal.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

proptest! {
    #![proptest_config(config(60))]

    /// The rule behind V1 and V4: T_MC = 2 x 99 + 11 x octets + T_SDR + T_ID1, for every rate.
    #[test]
    fn a_message_cycle_is_the_sum_of_its_parts(
        rate in prop::sample::select(BitRate::ALL),
        (outputs, inputs) in (0usize..=244, 0usize..=244),
        t_sdr in 11u32..1_000,
    ) {
        let bus = BusParams::profile(rate);
        let expected = 198 + 11 * (outputs + inputs) as u32 + t_sdr + 35 + 2 * bus.t_set.0 + bus.t_qui.0;
        prop_assert_eq!(message_cycle(&bus, outputs, inputs, Tbit(t_sdr)).0, expected);
    }
    /// The rule behind V17: one more master adds a token and a message, one more low-priority message its own length.
    #[test]
    fn a_rotation_grows_with_masters_and_messages(
        rate in prop::sample::select(BitRate::ALL),
        (n, k, mc) in (1u32..30, 0u32..50, 200u32..9_000),
    ) {
        let bus = BusParams::profile(rate);
        let t_tr = |n, k| bus.least_t_tr(n, k, Tbit(mc)).0;
        prop_assert_eq!(t_tr(n + 1, k) - t_tr(n, k), 33 + bus.t_id1().0 + mc);
        prop_assert_eq!(t_tr(n, k + 1) - t_tr(n, k), mc);
    }
    /// The rule behind V8 and V21: the smallest point of the grid above the bound.
    #[test]
    fn the_smallest_t_o_exceeds_its_bound_by_a_step_at_most(t_dx in 0u32..400_000, min in 0u32..6_000, base in 1u32..12) {
        let (t_dx, min) = (Span::from_iso_units(t_dx), Span::from_iso_units(min));
        let grid = Span::from_iso_units(base * 375);
        let t_o = smallest_t_o(t_dx, min, grid);
        prop_assert!(t_o > t_dx + min && t_o - grid <= t_dx + min && t_o.is_multiple_of(grid));
    }
    /// T_DX = T_ID2 + the message cycles of all slaves without the last T_ID1, at its longest and as expected.
    #[test]
    fn t_dx_is_the_sum_of_its_message_cycles(net in net(CABLE_RATES)) {
        let scenario = to_plan(&net.text("1 ms", "0 us", "0 us", ""));
        let bus = &scenario.bus.params;
        for plan in [Plan::of(&scenario), Plan::expected(&scenario)] {
            let cycles: Span = plan.slots.iter().map(|slot| slot.t_mc(bus)).sum();
            prop_assert_eq!(plan.t_dx, bus.span(bus.t_id2()) + cycles - bus.span(bus.t_id1()));
            let free = plan.free_running(&scenario);
            prop_assert_eq!(free.busy(), cycles + bus.span(plan::TOKEN + bus.t_id1()));
            prop_assert_eq!(free.cycle(), free.busy().max(free.least()));
            prop_assert_eq!(free.gap, plan.gap);
            for slot in &plan.slots {
                let slave = scenario.slave(slot.slave).expect("a slave");
                let (outputs, inputs) = (usize::from(slave.device.outputs), usize::from(slave.device.inputs));
                let without_cable = bus.span(message_cycle(bus, outputs, inputs, slot.t_sdr));
                prop_assert_eq!(slot.t_mc(bus), without_cable + slot.t_td_both);
            }
        }
        prop_assert!(Plan::expected(&scenario).t_dx <= Plan::of(&scenario).t_dx);
    }
    /// A value that is said to do does: no rule about its key is violated with it.
    #[test]
    fn the_nearest_value_keeps_the_rules_about_its_key(
        net in net(CABLE_RATES),
        (t_dp, t_i, t_o) in (0u32..40_000, 0u32..3_000, 0u32..6_000),
        more in prop::sample::select(&["", "t_pll_w = \"0 us\"\n", "t_pll_w = \"30 us\"\n", "t_pll_d = \"1 ms\"\n",
            "t_pll_w = \"1001 ns\"\n", "watchdog = \"10 ms\"\n"][..]),
        bus in prop::sample::select(&["", "t_sl = \"50 tbit\"\n", "max_tsdr = \"20 tbit\"\n", "t_set = \"0 tbit\"\n",
            "min_tsdr = \"5 tbit\"\n", "gap_factor = 0\n", "t_set = \"600 tbit\"\n"][..]),
    ) {
        let us = |number: u32| format!("{number} us");
        let text = net.text(&us(t_dp), &us(t_i), &us(t_o), more);
        let text = if bus.starts_with("gap_factor") {
            text.replace(&format!("gap_factor = {}\n", net.gap_factor), bus)
        } else {
            text.replace("[master]", &format!("{bus}[master]"))
        };
        let scenario = to_plan(&text);
        let findings = Facts::of(&scenario).findings();
        for found in broken(&findings).filter(|found| !found.follows && found.key.name != "gc_jitter") {
            let Some(near) = nearest(found, &findings) else { continue };
            let value = match near {
                plan::finding::Amount::Time(span) => format!("{} tick", span.ticks()),
                other => other.to_string(),
            };
            let set = [(found.key.to_string(), value.clone())];
            let mended = Scenario::parse_to_plan("drawn", "drawn.toml", &text, &set).expect("a network to plan");
            let after = Facts::of(&mended).findings();
            let left = broken(&after).find(|other| other.key == found.key && !other.follows);
            prop_assert!(left.is_none(), "{} = {value}: {:?}", found.key, left);
        }
        // Reading for a run refuses exactly what the planner calls violated.
        let read = Scenario::parse("drawn", "drawn.toml", &text, &[]);
        prop_assert_eq!(read.is_err(), broken(&findings).next().is_some(), "{:?}", read.err());
    }
    /// A proposal keeps all rules, and no shorter T_DP on the grid does.
    #[test]
    fn a_proposal_keeps_all_rules_and_is_the_shortest(net in net(FAST)) {
        let scenario = proposed(&net);
        let findings = Facts::of(&scenario).findings();
        prop_assert!(findings.iter().all(|found| found.holds() || found.rule.text.contains("repeated")));
        let grid = Span::from_us(125);
        let shorter = Scenario { master: isodp::study::scenario::Master {
            t_dp: scenario.master.t_dp - grid, ..scenario.master.clone() }, ..scenario.clone() };
        let findings = Facts::of(&shorter).findings();
        prop_assert!(broken(&findings).next().is_some(), "{} would do", shorter.master.t_dp);
    }
}

proptest! {
    #![proptest_config(config(24))]

    /// Planned and simulated agree to the tick where nothing disturbs: T_DX, GAP, token, spare time.
    #[test]
    fn a_run_has_the_planned_cycle(net in net(FAST)) {
        let net = Net { jitter_ns: 0, active_spare: false, ..net };
        let scenario = proposed(&net);
        let run = Run::of(&scenario);
        let plan = Plan::expected(&scenario);
        let bus = &scenario.bus.params;
        let started = start(&run);
        prop_assert!(started + 20 < 400, "started in cycle {started}");
        let mut gaps = 0;
        for cycle in run.cycles.iter().filter(|row| row.cycle > started && row.t_dx.is_some()) {
            prop_assert_eq!(cycle.t_dx, Some(plan.t_dx), "cycle {}", cycle.cycle);
            let (acyclic, spare) = (cycle.acyclic.expect("a token"), cycle.spare.expect("a token"));
            prop_assert_eq!(plan.t_dx + acyclic + spare + bus.span(plan::SYNCH), scenario.master.t_dp);
            if has_message(&run, cycle.cycle) {
                continue;
            }
            let mode = if has_mode(&run, cycle.cycle) { plan.mode(bus) } else { Span::ZERO };
            let polled = polled(&run, cycle.cycle);
            gaps += usize::from(polled.is_some());
            let gap = match polled.map(|(address, answer)| (plan.slot(address), answer)) {
                None => Span::ZERO,
                Some((None, answer)) => {
                    prop_assert_eq!(answer, GapAnswer::Absent);
                    plan.gap
                }
                // A slave of the network answers with 6 octets of its own.
                Some((Some(slot), _)) => {
                    bus.span(bus.t_id1() + plan::STATUS_REQUEST + slot.t_sdr + plan::STATUS_REQUEST) + slot.t_td_both
                }
            };
            // Beside the telegram that tells the mode the token may have to wait for the next cycle.
            let fits = plan.t_dx + mode + gap + plan.token + plan.synch <= scenario.master.t_dp;
            prop_assert!(fits || mode > Span::ZERO);
            let token = if fits { plan.token } else { bus.span(bus.t_id1()) };
            prop_assert_eq!(acyclic, mode + gap + token, "cycle {}: {:?}", cycle.cycle, polled);
            prop_assert!(gap <= plan.gap, "a poll that nobody answers takes longest");
        }
        prop_assert!(gaps > 0, "no GAP poll was seen");
        // Every telegram of a cycle is where its slot is, at its sender's plug.
        let (t0, next) = bounds(&run, started + 1);
        let seen: Vec<_> = run.telegrams.iter().filter(|telegram| (t0..next).contains(&telegram.0)).collect();
        for (pair, slot) in seen.chunks(2).zip(&plan.slots) {
            let one_way = Span::from_ticks(slot.t_td_both.ticks() / 2);
            prop_assert_eq!((pair[0].0 - t0, pair[0].1 - t0), (slot.request, slot.request_end), "to {}", slot.slave);
            let reply = (pair[1].0 - t0 + one_way, pair[1].1 - t0 + one_way, pair[1].2);
            prop_assert_eq!(reply, (slot.reply, slot.reply_end, slot.slave));
        }
    }
    /// The rule behind V1 and V4, free-running: the cycle of a run is the sum of the message cycles and the token, at every
    /// G-th visit with a GAP poll, and no shorter than the master and the slaves allow.
    #[test]
    fn a_free_running_cycle_is_planned_to_the_bit(
        net in net(CABLE_RATES),
        least in prop_oneof![Just(0u32), 0u32..20_000],
        interval in prop_oneof![Just(None), (1u32..3_000).prop_map(Some)],
    ) {
        let scenario = free(&net, least, interval);
        let (run, plan, bus) = (Run::of(&scenario), Plan::expected(&scenario), &scenario.bus.params);
        let free = plan.free_running(&scenario);
        let started = start(&run);
        prop_assert!(started + 20 < 400, "started in cycle {started}");
        let mut polls = Vec::new();
        for pair in run.cycles.windows(2).filter(|pair| pair[0].cycle > started && pair[0].t_dx.is_some()) {
            let cycle = pair[0].cycle;
            prop_assert_eq!(pair[0].t_dx, Some(plan.t_dx), "cycle {}", cycle);
            if has_message(&run, cycle) {
                continue;
            }
            let mode = if has_mode(&run, cycle) { plan.mode(bus) } else { Span::ZERO };
            let gap = match polled(&run, cycle).map(|(address, _)| plan.slot(address)) {
                None => Span::ZERO,
                Some(None) => free.gap,
                Some(Some(slot)) => {
                    bus.span(bus.t_id1() + plan::STATUS_REQUEST + slot.t_sdr + plan::STATUS_REQUEST) + slot.t_td_both
                }
            };
            polls.extend((gap > Span::ZERO).then_some(cycle));
            prop_assert_eq!(pair[1].t0 - pair[0].t0, free.cycle_with(mode + gap), "cycle {}", cycle);
        }
        prop_assert!(polls.len() > 1, "GAP polls were seen");
        for pair in polls.windows(2) {
            prop_assert!((pair[1] - pair[0]).is_multiple_of(net.gap_factor.into()), "every G-th visit: {:?}", pair);
        }
    }
    /// A run of a proposal starts up without a fault.
    #[test]
    fn a_proposal_starts_up_without_a_fault(net in net(FAST)) {
        let scenario = proposed(&net);
        let run = Run::of(&scenario);
        let counts = run.counts.as_ref().expect("counts");
        prop_assert_eq!((counts.network.collisions, counts.network.late_clocks), (0, 0));
        let last = run.cycles.last().expect("cycles").cycle;
        for row in run.slaves.iter().filter(|row| row.cycle == last) {
            prop_assert_eq!((row.state, row.phase), (SlaveState::DataExch, Phase::Operation), "slave {}", row.slave);
        }
        for slave in &counts.slaves {
            prop_assert_eq!(slave.fault_count(), 0, "slave {}", slave.address);
        }
    }
}

/// The network without SYNCH, with a least cycle time (us) and Min_Slave_Interval (us) of every slave.
fn free(net: &Net, least: u32, interval: Option<u32>) -> Scenario {
    let net = Net { jitter_ns: 0, ..net.clone() };
    let text = net.text(
        "1 ms",
        "0 us",
        "0 us",
        &format!("isochronous = false\nleast_cycle = \"{least} us\"\nwatchdog = \"60 s\"\n"),
    );
    let clocked = ["t_dp", "t_i", "t_o", "active_spare", "gc_jitter"];
    let interval = interval.map_or_else(String::new, |us| format!("min_slave_interval = \"{us} us\"\n"));
    let lines = text.lines().filter(|line| clocked.iter().all(|key| line.split(' ').next() != Some(key)));
    let text: String = lines.flat_map(|line| [line, "\n"]).collect();
    let text = text.replace("[[slave]]\n", &format!("[[slave]]\n{interval}"));
    Scenario::parse("free", "free.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// The cycle in which the last slave entered data exchange.
fn start(run: &Run) -> u64 {
    let joined = |what: &Observation| matches!(what, Observation::SlaveState { to: SlaveState::DataExch, .. });
    run.events.iter().filter(|row| joined(&row.what)).map(|row| row.cycle).max().unwrap_or(0) + 1
}

/// The address that was polled in this cycle, and what was found.
fn polled(run: &Run, cycle: u64) -> Option<(Address, GapAnswer)> {
    let (t0, next) = bounds(run, cycle);
    run.observations.iter().filter(|seen| (t0..next).contains(&seen.0)).find_map(|(_, _, what)| match what {
        Observation::Gap { address, answer } => Some((*address, *answer)),
        _ => None,
    })
}

/// From the start of a cycle to that of the next, or to the end.
fn bounds(run: &Run, cycle: u64) -> (Time, Time) {
    let t0 = |cycle: u64| run.cycles.iter().find(|row| row.cycle == cycle).map(|row| row.t0);
    (t0(cycle).expect("a cycle"), t0(cycle + 1).unwrap_or(Time::MAX))
}

/// Whether a slave was asked for something else than data in this cycle, such as the diagnosis of a new link.
fn has_message(run: &Run, cycle: u64) -> bool {
    let (t0, next) = bounds(run, cycle);
    let mut inside = run.telegrams.iter().filter(|telegram| (t0..next).contains(&telegram.0));
    inside.any(|(_, _, sender, octets)| {
        let to = octets.get(4).copied().unwrap_or(0);
        *sender == address(2) && octets[0] == 0x68 && to & 0x80 != 0 && to != 0xFF
    })
}

/// Whether Operate or Clear was told in this cycle.
fn has_mode(run: &Run, cycle: u64) -> bool {
    let (t0, next) = bounds(run, cycle);
    let mut inside = run.telegrams.iter().filter(|telegram| (t0..next).contains(&telegram.0));
    inside.any(|telegram| telegram.3.len() == 13 && telegram.3[4] == 0xFF && telegram.3[10] != 0x80)
}

/// Three encoders at 12 Mbit/s as in a known network: T_DP 2 ms, T_I 125 us, T_O 375 us, watchdog 200 ms.
const THREE: &str = "[run]\ncycles = 1\n[bus]\nrate = \"12 Mbit/s\"\n[master]\naddress = 2\nget_cfg = false\nt_dp = \"2 ms\"\n\
                     t_i = \"125 us\"\nt_o = \"375 us\"\n[[slave]]\naddresses = \"6..8\"\ndevice = \"simodrive-sensor-isochron\"\n";

/// The worked telegrams, of the first encoder without and with Publisher_Enable, and Chk_Cfg.
#[test]
fn telegrams_are_those_of_a_configuration_tool() {
    let drive = "[[slave]]\naddress = 9\ndevice = \"subscriber-drive\"\n[[link]]\npublisher = 6\nsubscriber = 9\n";
    let plain = "68 40 40 68 86 82 5D 3D 3E 88 14 01 0B 80 F9 80 C0 00 18 15 81 00 00 08 00 00 20 00 02 00 00 00 01 00 00 00 \
                 00 00 00 00 1C 04 00 00 01 00 00 05 DC 00 10 01 00 00 05 DC 00 01 00 03 00 00 0A 72 00 0C 00 00 9A 16";
    let scenario = to_plan(THREE);
    let [prm, cfg] = octets::telegrams(&scenario, &scenario.slaves[0]);
    assert_eq!(octets::hex(&prm.telegram), plain);
    assert_eq!(octets::hex(&cfg.telegram), "68 0B 0B 68 86 82 7D 3E 3E C3 C1 C5 FD 00 51 98 16");
    assert_eq!(octets::hex(&prm.du()), plain["68 40 40 68 86 82 5D 3D 3E ".len()..plain.len() - " 9A 16".len()]);
    // Octets 32 to 59 are the isochronous block, and each says what it is.
    let field = |name: &str| prm.fields.iter().find(|field| field.name.trim() == name).expect("a field");
    for (name, place, value) in [
        ("Station_Status", "1", "Lock_Req, WD_On"),
        ("WD_Fact_2", "3", "1; watchdog 200 ms"),
        ("min_TSDR", "4", "11 tbit"),
        ("DPV1_Status_3", "10", "IsoM_Req, Prm_Structure"),
        ("units per revolution", "16..19", "8192 counts"),
        ("tolerated failures of the sign of life", "24", "1"),
        ("T_DP", "41..42", "16 x 125 us = 2 ms"),
        ("T_O", "50..51", "3 x 125 us = 375 us"),
        ("T_DX", "52..55", "2674 x 1/12 us = 222.833 us"),
        ("T_PLL_D", "58..59", "0 x 1/12 us = 0 ns"),
    ] {
        let found = field(name);
        assert_eq!((found.place().as_str(), found.value.as_str()), (place, value), "{name}");
    }
    // As a publisher its min_TSDR is T_ID1; the drive makes T_DX longer, which is not the point here.
    let four = to_plan(&[THREE, drive].concat());
    let [publisher, _] = octets::telegrams(&four, &four.slaves[0]);
    assert_eq!(octets::hex(&publisher.telegram[..19]), "68 40 40 68 86 82 5D 3D 3E 88 14 01 4C 80 F9 80 E0 00 18");
    let [subscriber, _] = octets::telegrams(&four, &four.slaves[3]);
    assert!(octets::hex(&subscriber.du()).ends_with("09 03 00 00 01 06 0C 04 04"));
}

#[test]
fn every_octet_of_every_telegram_has_a_name_and_a_place() {
    let four = to_plan(
        &[THREE, "[[slave]]\naddress = 9\ndevice = \"subscriber-drive\"\n[[link]]\npublisher = 6\nsubscriber = 9\n"]
            .concat(),
    );
    for slave in &four.slaves {
        for written in octets::telegrams(&four, slave) {
            let mut next = 1;
            for field in &written.fields {
                assert!(field.first == next && !field.octets.is_empty() && !field.name.trim().is_empty(), "{field:?}");
                next += field.octets.len();
            }
            let du = &written.telegram[9..written.telegram.len() - 2];
            assert_eq!(written.du(), du, "{} to {}", written.name, written.slave);
        }
    }
    let text = octets::text(&four, None);
    assert!(!octets::text(&four, Some(address(9))).contains("to slave 6"), "only what is asked for");
    assert!(text.contains("Set_Prm to slave 7: as but for the octets below to slave 6\n"), "{text}");
    assert!(text.contains("Chk_Cfg to slave 8: as to slave 6\n"), "{text}");
}

/// D22, a narrow window, much jitter, a slow rate: the planner warns, a run begins all the same.
#[test]
fn warnings_do_not_refuse() {
    let text = THREE.replace("12 Mbit/s", "500 kbit/s").replace("2 ms", "16 ms").replace("125 us", "375 us").replace(
        "t_o = \"375 us\"",
        "t_o = \"8 ms\"\nt_pll_w = \"500 ns\"\ngc_jitter = { kind = \"uniform\", half_width = \"400 ns\" }",
    ) + "scaling = { units_per_rev = 100, total_range = 10000 }\n";
    let scenario = Scenario::parse("slow", "slow.toml", &text.replace("cycles = 1\n", "cycles = 200\n"), &[])
        .unwrap_or_else(|error| panic!("{error}\n{text}"));
    let findings = Facts::of(&scenario).findings();
    let warned: Vec<_> = findings.iter().filter(|found| !found.holds()).collect();
    for (rule, near) in [
        ("bit rate >= 1.5 Mbit/s", "1.5 Mbit/s"),
        ("T_PLL_W >= the device's narrowest", "1 us"),
        ("T_PLL_W >= 2 x jitter of SYNCH", "1 us"),
        ("revolutions x units = n x total range", "10240"),
    ] {
        let found = warned.iter().find(|found| found.rule.text == rule).unwrap_or_else(|| panic!("{rule}"));
        assert_eq!(nearest(found, &findings).map(|near| near.to_string()).as_deref(), Some(near), "{rule}");
    }
    assert!(warned.iter().all(|found| found.rule.weight != Weight::Must));
    let told = rules::warnings(&scenario);
    assert!(told.len() == 1 && told[0].contains("SIMODRIVE 611 universal"), "{told:?}");
    let run = Run::of(&scenario);
    assert_eq!(run.counts_of(address(6).get()).fault_count(), 0);
    let rate = find("simodrive-sensor-isochron").expect("a device").max_tsdr(BitRate::K500);
    assert_eq!(rate, Tbit(15));
}

/// Calls `isodp plan` in a room with this scenario as `three.toml`; exit code, page, standard error.
fn call(room: &Room, scenario: &str, arguments: &[&str]) -> (Option<i32>, String, String) {
    room.write("three.toml", scenario);
    let output = room.call(&[&["plan", "three.toml"], arguments].concat());
    let text = |octets: Vec<u8>| String::from_utf8(octets).expect("UTF-8");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn exit_codes_tell_whether_the_rules_hold() {
    let room = Room::new();
    let (code, page, error) = call(&room, THREE, &[]);
    assert_eq!((code, error.as_str()), (Some(0), ""));
    assert!(page.contains("rules: all hold\n") && page.contains("T_DX 222.833 us at most"), "{page}");
    let (code, page, _) = call(&room, THREE, &["--set", "slave.7.t_o=250 us"]);
    assert_eq!(code, Some(1));
    let told =
        "rules: 1 rule violated\nviolated: slave 7: T_O = 250 us is too early for slave 7; nearest t_o = 375 us\n";
    assert!(page.contains(told), "{page}");
    let row = page.lines().find(|line| line.starts_with("VIOLATED")).expect("a row");
    let words: Vec<_> = row.split("  ").map(str::trim).filter(|word| !word.is_empty()).collect();
    let rule = "T_O 250 us > 347.833 us (T_DX + T_O_MIN)";
    assert_eq!(words, ["VIOLATED", "slave 7", rule, "-97.833 us", "manual 3.3.6, Model: D3"]);
    // Nothing else than times may be wrong.
    for (key, what) in [("slave.7.device=clock", "there is no device"), ("master.address=7", "have the address 7")] {
        let (code, page, error) = call(&room, THREE, &["--set", key]);
        assert!(code == Some(2) && page.is_empty() && error.contains(what), "{error}");
    }
    let (code, _, error) = call(&room, THREE, &["--slave", "9"]);
    assert_eq!((code, error.as_str()), (Some(2), "error: no slave has the address 9; the slaves are 6, 7, 8\n"));
}

#[test]
fn a_plan_leaves_its_files_and_a_part_of_it_none() {
    let room = Room::new();
    for part in [&["--propose"][..], &["--slave", "7"]] {
        assert_eq!(call(&room, THREE, part).0, Some(0));
        assert!(!room.path("out").exists(), "{part:?}");
    }
    assert_eq!(call(&room, THREE, &["--out", "there"]).0, Some(0));
    let file = |name: &str| std::fs::read_to_string(room.path("there/three").join(name)).expect(name);
    let json: serde_json::Value = serde_json::from_str(&file("plan.json")).expect("JSON");
    assert_eq!((json["holds"].as_bool(), json["cycle"]["t_dx_us"].as_f64()), (Some(true), Some(222.833_333)));
    assert_eq!(json["slaves"].as_array().map(Vec::len), Some(3));
    let mut rules = json["rules"].as_array().expect("rules").iter();
    let rule = rules.find(|rule| rule["key"] == "slave.6.t_o" && rule["relation"] == ">").expect("the bound of T_O");
    assert_eq!((rule["value"]["value"].as_f64(), rule["value"]["unit"].as_str()), (Some(375.0), Some("us")));
    assert!(file("plan.svg").contains("</svg>") && file("telegrams.txt").contains("9A 16"));
    // What cannot be written leaves nothing.
    room.write("occupied", "");
    let (code, _, error) = call(&room, THREE, &["--out", "occupied"]);
    assert!(code == Some(2) && error.contains("occupied"), "{error}");
}

#[test]
fn a_proposal_can_be_run_and_what_cannot_be_proposed_is_said() {
    let room = Room::new();
    let wrong = THREE.replace("2 ms", "500 us").replace("cycles = 1", "cycles = 100");
    let (code, proposal, error) = call(&room, &wrong, &["--propose", "--set", "slave.6.t_i=1 us"]);
    assert_eq!((code, error.as_str()), (Some(1), ""), "the scenario itself breaks rules");
    room.write("proposal.toml", &proposal);
    assert_eq!(room.call(&["plan", "proposal.toml"]).status.code(), Some(0), "{proposal}");
    assert!(room.runs(&["run", "proposal.toml"]).contains("nothing went wrong on the bus"));
    // 3 slaves at 9.6 kbit/s take longer than the longest T_DP.
    let slow = THREE.replace("12 Mbit/s", "9.6 kbit/s");
    let (code, page, error) = call(&room, &slow, &["--propose"]);
    assert!(code == Some(2) && page.is_empty(), "{page}");
    let start = "error: no T_DP, T_I, T_O, T_PLL_W and watchdog keep all rules:\n  master.t_dp: ";
    assert!(error.starts_with(start), "{error}");
}

#[test]
fn a_run_below_1_5_mbit_warns_on_standard_error_and_in_its_summary() {
    let room = Room::new();
    let slow = THREE.replace("12 Mbit/s", "500 kbit/s").replace("2 ms", "16 ms").replace("375 us", "8 ms");
    room.write("slow.toml", slow.replace("cycles = 1", "cycles = 20"));
    let output = room.call(&["run", "slow.toml"]);
    let text = |octets: &[u8]| String::from_utf8_lossy(octets).into_owned();
    let warning = "warning: isochronous mode at 500 kbit/s: drives such as SIMODRIVE 611 universal do not offer it";
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stderr).starts_with(warning), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains(warning), "{}", text(&output.stdout));
    let summary = std::fs::read_to_string(room.path("out/slow/summary.json")).expect("a summary");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
    assert_eq!(summary["warnings"].as_array().map(Vec::len), Some(1));
}

/// With T_DP = 0 and T_I beyond every cycle nothing panics, and the proposal mends it.
#[test]
fn the_worst_scenario_can_be_planned() {
    let text = THREE.replace("2 ms", "0 us").replace("125 us", "1 s");
    let text = text.replace("[master]", "t_set = \"65535 tbit\"\n[master]");
    let text = text + "t_pll_w = \"1 s\"\nt_pll_d = \"1 s\"\nt_sdr = \"65535 tbit\"\n";
    let scenario = to_plan(&text);
    let findings = Facts::of(&scenario).findings();
    assert!(broken(&findings).count() > 10);
    assert!(octets::text(&scenario, None).contains("T_PLL_W"));
    let proposal = Proposal::of(&scenario).unwrap_or_else(|broken| panic!("{broken:#?}"));
    let text = written(&text, &scenario, &proposal);
    assert!(Scenario::parse("mended", "mended.toml", &text, &[]).is_ok(), "{text}");
}

/// Every rule of the registry has something to say about some network.
#[test]
fn every_rule_finds_something() {
    let drive = "functions = true\nscaling = { units_per_rev = 100, total_range = 12800 }\n[[slave]]\naddress = 9\ndevice = \
                 \"subscriber-drive\"\n[[link]]\npublisher = 6\nsubscriber = 9\n\
                 [[event]]\ncycle = 0\ndo = \"read-parameter\"\nparameter = 918\nslave = 6\n";
    let jitter = "data_control_time = \"1 s\"\ngc_jitter = { kind = \"normal\", sigma = \"10 ns\" }\n[[slave]]";
    let other = "[[class1]]\naddress = 10\n[[class2]]\naddress = 11\n[[class2.job]]\nservice = \"parameter-read\"\n\
                 parameter = 918\nslave = 6\n";
    let scenario = to_plan(&[&THREE.replacen("[[slave]]", jitter, 1), drive, other].concat());
    let facts = Facts::of(&scenario);
    for rule in rules::ALL.iter().copied().flatten() {
        let found = rule.findings(&facts);
        assert!(!found.is_empty(), "{}", rule.text);
        assert!(!rule.source.is_empty() && found.iter().all(|found| !found.terms.is_empty()), "{}", rule.text);
    }
}

/// The page of three encoders, whose numbers follow from T_ID2 800, requests 143, T_SDR 200, replies 231, T_ID1 76 t_bit.
#[test]
fn a_page_shows_the_cycle_its_shares_and_its_instants() {
    let page = call(&Room::new(), THREE, &[]).1;
    let expected = "\
three: master 2, 3 slaves, 0 links, 12 Mbit/s, cable 0 m
T_DP 2 ms, its content needs 500 us
T_DX 222.833 us at most (MaxTsdr), 180.333 us expected (own T_SDR)
T_ID1 76 tbit   T_ID2 800 tbit   T_SL 1000 tbit   bit 83.333 ns

Data_Exchange at the longest, from t0 (last bit of SYNCH) on; T_S to 2 T_TD in tbit
slave  device                     T_S  T_SDR  T_R  2 T_TD  T_MC us  start us   end us
6      simodrive-sensor-isochron  143    200  231       0   54.167    66.667  114.500
7      simodrive-sensor-isochron  143    200  231       0   54.167   120.833  168.667
8      simodrive-sensor-isochron  143    200  231       0   54.167   175.000  222.833

share of the cycle                    tbit        us  of T_DP
T_DX: T_ID2 and every Data_Exchange   2674   222.833   11.1 %
GAP: T_ID1, FDL status, T_SL          1142    95.167    4.8 %
token: T_ID1, 3 octets                 109     9.083    0.5 %
SYNCH: T_ID1, T_GC of 13 octets        219    18.250    0.9 %
spare: acyclic messages, silence     19856  1654.667   82.7 %
T_DP                                 24000  2000.000  100.0 %

slave     T_I           allowed     T_O            allowed  T_PLL_W        allowed  dead time
6..8   125 us  125 us .. 1.5 ms  375 us  375 us .. 1.75 ms     1 us  1 us .. 20 us     2.5 ms
T_M 222.833 us: the master application may compute from then on, for 1.777 ms (T_MAPC 1)
dead time = T_I + T_MAPC x T_DP + T_O: latch, data a cycle later, compute, set point the cycle after

                   O                                                                        I
|...DDdddDDDGGGGtt................................................................................S|
0                                                                                               2 ms
";
    assert!(page.starts_with(expected), "\n{page}");
}

/// Of a full segment the page is no longer than of a few slaves, and no line is wider than a wide terminal.
#[test]
fn a_page_of_many_slaves_fits() {
    let many = THREE.replace("6..8", "3..33").replace("2 ms", "16 ms").replace("375 us", "12 ms");
    for scenario in [THREE.to_owned(), many.clone(), many.replace("16 ms", "1 ms")] {
        let page = call(&Room::new(), &scenario, &[]).1;
        assert!(page.lines().count() <= 60, "{page}");
        assert!(page.lines().all(|line| line.chars().count() <= 100), "{page}");
        let every = call(&Room::new(), &scenario, &["--rules"]).1;
        assert!(every.lines().count() > page.lines().count() + 20, "{every}");
        assert!(every.lines().all(|line| line.chars().count() <= 100), "{every}");
    }
    let page = call(&Room::new(), &many, &[]).1;
    assert!(page.contains("\n3..33  simodrive-sensor-isochron  143    200  231"), "{page}");
}

/// A network of segments: repeaters are in the message cycles, and the proposal says where everything is.
#[test]
fn a_network_of_segments_is_planned_to_the_tick_and_proposed() {
    let scenario = crate::support::scenario("repeaters", &[("run.duration", "500 ms"), ("run.seed", "3")]);
    let run = Run::of(&scenario);
    let plan = Plan::expected(&scenario);
    let last = run.cycles.iter().rev().find_map(|row| row.t_dx).expect("a cycle");
    // Without crystals that are off, the run is the plan.
    assert_eq!(last, plan.t_dx);
    assert!(plan.t_dx <= Plan::of(&scenario).t_dx);
    let proposal = Proposal::of(&scenario).expect("times");
    let text = written(&shipped_text("repeaters").1, &scenario, &proposal);
    let read =
        Scenario::parse("proposal", "proposal.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!(Plan::of(&read), Plan::of(&proposal.scenario), "{text}");
    assert_eq!(read.topology, scenario.topology, "{text}");
}

/// Rules that hold are a number and the three that are nearest to their bounds; the others are there with their numbers.
#[test]
fn a_page_shows_the_rules_that_matter() {
    let page = call(&Room::new(), THREE, &["--set", "slave.7.t_o=250 us"]).1;
    let rows = |word: &str| page.lines().filter(|line| line.starts_with(word)).count();
    assert_eq!((rows("VIOLATED"), rows("ok ")), (1, 3), "{page}");
    assert!(page.contains(" rules hold, the tightest:\n") && page.contains("--rules"), "{page}");
    let tight = page.lines().find(|line| line.contains("> 347.833 us") && line.starts_with("ok")).expect("T_O");
    assert!(tight.ends_with("27.167 us") && tight.contains("slave 6, 8"), "{tight}");
    let every = call(&Room::new(), THREE, &["--rules"]).1;
    assert!(every.contains("<= T_SL 1000 tbit <= 16383 tbit"), "{every}");
}

/// Without SYNCH there is no T_DP, no T_I and T_O, no window, in the page as in the picture and the data.
#[test]
fn a_free_running_network_is_planned_in_its_own_words() {
    let room = Room::new();
    let text = THREE.replace("t_dp = \"2 ms\"\nt_i = \"125 us\"\nt_o = \"375 us\"\n", "isochronous = false\n");
    for arguments in [&[][..], &["--rules"]] {
        let (code, page, error) = call(&room, &text, arguments);
        assert_eq!((code, error.as_str()), (Some(0), ""), "{page}");
        for word in ["SYNCH", "T_DP", "T_I ", "T_O", "T_PLL", "T_M "] {
            assert!(!page.contains(word), "{word}: {page}");
        }
        // 3 x (143 + 200 + 231 + 76) + 33 + 76 t_bit, then FDL status, T_SL and T_ID1.
        assert!(page.contains("T_cycle 171.583 us at most (MaxTsdr), 266.75 us with a GAP poll"), "{page}");
    }
    let file = |name: &str| std::fs::read_to_string(room.path("out/three").join(name)).expect(name);
    let (json, picture) = (file("plan.json"), file("plan.svg"));
    let data: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!((data["isochronous"].as_bool(), data.get("cycle").is_none()), (Some(false), true));
    assert!(data["slaves"][0].get("t_i_us").is_none() && data["slaves"][0].get("t_s_tbit").is_some());
    assert_eq!(data["free_running"]["exchange_us"].as_f64(), Some(162.5));
    assert!(picture.contains("T_cycle") && !picture.contains("SYNCH") && !picture.contains("T_DP"), "{picture}");
}

/// What the token does at another master is in the page, in the data and in what a rule says; the T_TR that is told does.
#[test]
fn a_plan_of_two_masters_tells_what_the_token_may_do() {
    let scenario = crate::support::scenario("two-masters", &[]);
    let (bus, t_dp) = (scenario.bus.params, scenario.master.t_dp);
    let plan = Plan::of(&scenario);
    assert_eq!(plan.t_th(&bus, t_dp), bus.span(Tbit(8_900)));
    let bits = |bits: u32| bus.span(Tbit(bits));
    // Longest Data_Exchange 143 + 800 + 231 + 76, token and T_ID1; of 27 slaves, Global_Control with T_ID2, GAP.
    let visit = plan.visits[0];
    assert_eq!((visit.station, visit.least, visit.longest), (address(12), bits(1_250 + 109), bits(1_250 + 109)));
    assert_eq!(visit.work, bits(27 * 1_250 + 143 + 800 + 1_142 + 109));
    assert_eq!(plan.content(), plan.own() + bits(1_359));
    assert_eq!(plan.least_t_tr(&bus), Tbit(2 * (109 + 1_250) + 1_250));
    assert_eq!(plan.synch_delay(&bus, t_dp), plan.own() + bits(8_900 + 1_359) - t_dp);
    let t_tr = plan.longest_t_tr(&bus, t_dp).expect("a T_TR");
    let findings = |t_tr: &str| {
        let scenario = crate::support::scenario("two-masters", &[("bus.t_tr", t_tr)]);
        let all = Facts::of(&scenario).findings();
        all.into_iter().filter(|found| !found.holds()).map(|found| found.rule.text).collect::<Vec<_>>()
    };
    assert_eq!(findings("20900 tbit"), ["T_DP holds the longest visits of the token"]);
    assert_eq!(findings(&t_tr.to_string()), Vec::<&str>::new());
    assert_eq!(findings("3967 tbit"), ["T_TR >= n (T_TC + T_MC) + k T_MC"]);
    // A run is never later than planned, and with the T_TR that is told never late.
    for (t_tr, most) in [(bus.t_tr, plan.synch_delay(&bus, t_dp)), (t_tr, Span::ZERO)] {
        let run = Run::of(&crate::support::scenario("two-masters", &[("bus.t_tr", &t_tr.to_string())]));
        let late = run.counts.as_ref().map(|counts| counts.network.latest_clock);
        assert!(late <= Some(most), "{late:?} of {most}");
        assert_eq!(late == Some(Span::ZERO), most == Span::ZERO);
    }
}

/// Where a shipped scenario is, and its text.
fn shipped_text(name: &str) -> (std::path::PathBuf, String) {
    let path = std::path::PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenarios").join(format!("{name}.toml"));
    let text = std::fs::read_to_string(&path).expect("a scenario");
    (path, text)
}

/// A proposal is the file with other values: it has all its stations, links, events and comments, keeps all rules, runs, and
/// is the same for a file without times.
#[test]
fn the_proposal_for_every_shipped_scenario_runs() {
    for name in crate::support::shipped() {
        let (path, text) = shipped_text(&name);
        let source = path.display().to_string();
        let scenario = Scenario::parse_to_propose(&name, &source, &text, &[]).unwrap_or_else(|e| panic!("{e}"));
        let proposal = Proposal::of(&scenario).unwrap_or_else(|broken| panic!("{name}: {broken:#?}"));
        let proposed = written(&text, &scenario, &proposal);
        let read = Scenario::parse(&name, &source, &proposed, &[]).unwrap_or_else(|e| panic!("{e}\n{proposed}"));
        let expected = Scenario { question: read.question.clone(), ..proposal.scenario.clone() };
        assert_eq!(read, expected, "{proposed}");
        for comment in text.lines().filter(|line| line.starts_with('#')) {
            assert!(proposed.contains(comment), "{name} has lost {comment}");
        }
        let findings = Facts::of(&read).findings();
        assert_eq!(broken(&findings).count(), 0, "{name}");
        let short =
            Scenario { run: isodp::study::scenario::Run { duration: Extent::Cycles(200), ..read.run }, ..read.clone() };
        assert_eq!(Run::of(&short).cycles.last().map(|row| row.cycle), Some(199), "{name}");
        if text.contains("isochronous = false") {
            continue; // Nothing to leave out.
        }
        let times = ["t_dp", "t_i", "t_o"];
        let without: String = text
            .lines()
            .filter(|line| times.iter().all(|key| line.split(' ').next() != Some(key)))
            .flat_map(|line| [line, "\n"])
            .collect();
        assert!(Scenario::parse_to_plan(&name, &source, &without, &[]).is_err(), "T_DP must be there to be planned");
        let open = Scenario::parse_to_propose(&name, &source, &without, &[]).unwrap_or_else(|e| panic!("{e}"));
        let times = Proposal::of(&open).expect("times").scenario;
        assert_eq!(times.master.t_dp, read.master.t_dp, "{name}");
        assert_eq!(times.slaves, read.slaves, "{name}");
    }
}

/// What --set changes is in the proposal: a slave among others gets a table of its own, the comment behind a value stays.
#[test]
fn a_proposal_takes_changed_values_along() {
    let room = Room::new();
    let text =
        THREE.replace("t_i = \"125 us\"", "t_i = \"1 us\" # as in the plant").replace("cycles = 1\n", "cycles = 90\n");
    let sets = ["--set", "slave.7.functions=true", "--set", "bus.cable=50 m", "--set", "slave.8.crystal=20 ppm"];
    let (_, proposal, error) = call(&room, &text, &[&["--propose"][..], &sets].concat());
    assert!(error.is_empty() && proposal.contains("t_i = \"125 us\" # as in the plant"), "{error}{proposal}");
    let read = Scenario::parse("read", "read.toml", &proposal, &[]).unwrap_or_else(|e| panic!("{e}\n{proposal}"));
    assert_eq!(read.bus.cable_mm, 50_000);
    let functions: Vec<_> = read.slaves.iter().map(|slave| (slave.address.get(), slave.functions)).collect();
    assert_eq!(functions, [(6, false), (7, true), (8, false)]);
    assert_ne!(read.slaves[0].times.t_i, read.slaves[1].times.t_i, "octet 15 bit 1 takes longer");
    assert_ne!(read.slaves[1].crystal, read.slaves[2].crystal);
}
