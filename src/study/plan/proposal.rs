//! Proposal: a set of values that keeps all rules, with the shortest T_DP on the grid.

use super::finding::{Amount, Finding, Key, Subject, nearest};
use super::rules::services::LEAST_CONTROL_CYCLES;
use super::rules::{Facts, Weight, stray};
use super::{Plan, smallest_t_o};
use crate::dp::master::Pace;
use crate::fdl::params::BusParams;
use crate::sim::jitter::GcJitter;
use crate::study::build;
use crate::study::scenario::{Scenario, Slave, Watchdog};
use crate::time::{Span, Tbit};

/// Cycles that a watchdog outlasts at least: a slave's start-up takes a service every other cycle. Model: with one to
/// spare.
const WATCHDOG_CYCLES: i64 = 3;
/// The watchdog where the scenario's is too short: longer than three of the longest T_DP.
const WATCHDOG: Watchdog = Watchdog::USUAL;
/// How often bus parameters are brought nearer to each other.
const ROUNDS: usize = 8;

/// A network whose times keep all rules.
#[derive(Clone, Debug)]
pub struct Proposal {
    /// The network with the proposed values.
    pub scenario: Scenario,
    /// T_DP with which a Data_Exchange can be repeated once before SYNCH, on the same grid.
    pub t_dp_with_repeat: Span,
}

impl Proposal {
    /// Proposes times for the network of `scenario`; its own times matter only where they may stay.
    ///
    /// # Errors
    /// What no T_DP, T_I, T_O, T_PLL_W and watchdog can mend: the rules that stay broken.
    pub fn of(scenario: &Scenario) -> Result<Self, Vec<Finding>> {
        let mut network = scenario.clone();
        mend(&mut network);
        let clocked = network.master.pace == Pace::Synch;
        let grid = grid(&network);
        if clocked {
            times(&mut network, grid);
        } else {
            network.master.t_dp = Plan::of(&network).free_running(&network).with_gap();
        }
        let plan = Plan::of(&network);
        let fine = network.configured().all(|slave| slave.device.wd_base_1ms);
        let good = |watchdog: Watchdog| {
            watchdog.span() > network.master.t_dp * WATCHDOG_CYCLES && (fine || !watchdog.base_1ms)
        };
        network.master.watchdog =
            network.master.watchdog.map(|watchdog| if good(watchdog) { watchdog } else { WATCHDOG });
        let services = &mut network.master.services;
        services.data_control_time =
            services.data_control_time.map(|time| time.max(network.master.t_dp * LEAST_CONTROL_CYCLES));
        let findings = Facts::of(&network).findings();
        let broken: Vec<_> =
            findings.into_iter().filter(|found| found.rule.weight == Weight::Must && !found.holds()).collect();
        if broken.is_empty() {
            let with_repeat = plan.content() + plan.repeat(&network.bus.params);
            let t_dp_with_repeat = with_repeat.max(network.master.t_dp).ceil_to(grid);
            Ok(Self { scenario: network, t_dp_with_repeat })
        } else {
            Err(broken)
        }
    }
}

/// The times of an isochronous network: T_DP, of every slave T_I, T_O and the window, and the T_TR of several masters.
fn times(network: &mut Scenario, grid: Span) {
    let (jitter, master) = (network.master.gc_jitter.clone(), network.master.address);
    let own = |slave: &&mut Slave| !slave.silent && slave.master == master && slave.device.isochronous;
    network.slaves.iter_mut().filter(own).for_each(|slave| window(slave, &jitter));
    let plan = Plan::of(network);
    for slave in network.slaves.iter_mut().filter(own) {
        slave.times.t_i = shortest_t_i(slave);
        slave.times.t_o = smallest_t_o(plan.t_dx_told(), slave.device.t_o_min, slave.device.io_grid());
    }
    network.master.t_dp = shortest_t_dp(network, &plan).ceil_to(grid);
    let bus = &mut network.bus.params;
    if plan.synch_delay(bus, network.master.t_dp) > Span::ZERO {
        bus.t_tr = plan.longest_t_tr(bus, network.master.t_dp).unwrap_or(bus.t_tr).max(plan.least_t_tr(bus));
    }
}

/// Brings bus parameters, T_MAPC and T_SDR to the nearest values that the rules allow.
fn mend(network: &mut Scenario) {
    for _ in 0..ROUNDS {
        let findings = Facts::of(network).findings();
        let broken = findings.iter().filter(|found| found.rule.weight == Weight::Must && !found.holds());
        let changes: Vec<_> = broken.map(|found| (found.key, nearest(found, &findings))).collect();
        let before = network.clone();
        if changes.iter().any(|(key, near)| key.subject == Subject::Bus && near.is_none()) {
            // T_SET and T_QUI can be so long that nothing else has room.
            let usual = BusParams::profile(network.bus.params.rate);
            (network.bus.params.t_set, network.bus.params.t_qui) = (usual.t_set, usual.t_qui);
        }
        let changes = changes.into_iter().filter_map(|(key, near)| Some((key, near?)));
        for (key, amount) in changes {
            set(network, key, amount);
        }
        if *network == before {
            return;
        }
    }
}

/// Gives a key its value; keys of other kinds stay as they are.
fn set(network: &mut Scenario, key: Key, amount: Amount) {
    let raw = amount.raw();
    let (bits, small) = (Tbit(raw.clamp(0, u32::MAX.into()) as u32), raw.clamp(0, u8::MAX.into()) as u8);
    let bus = &mut network.bus.params;
    match (key.subject, key.name) {
        (Subject::Bus, "t_set") => bus.t_set = bits,
        (Subject::Bus, "t_qui") => bus.t_qui = bits,
        (Subject::Bus, "min_tsdr") => bus.min_tsdr = bits,
        (Subject::Bus, "max_tsdr") => bus.max_tsdr = bits,
        (Subject::Bus, "t_sl") => bus.t_sl = bits,
        (Subject::Bus, "t_tr") => bus.t_tr = bits,
        (Subject::Bus, "max_retry_limit") => bus.max_retry_limit = small,
        (Subject::Bus, "gap_factor") => bus.gap_factor = small,
        (Subject::Bus, "hsa") => bus.hsa = small,
        (Subject::Master, "t_mapc") => network.master.t_mapc = small,
        (Subject::Slave(address), "t_sdr") => {
            network.slaves.iter_mut().filter(|slave| slave.address == address).for_each(|slave| slave.t_sdr = bits);
        }
        _ => {}
    }
}

/// The window of one slave: its own if it is wide enough for the device, its timers and the jitter, else the nearest that
/// is; and its delay, where it is one.
fn window(slave: &mut Slave, jitter: &GcJitter) {
    let unit = Span::from_iso_units(1);
    let widest = Span::from_iso_units(slave.device.t_pll_w_max.into());
    let jitter = stray(jitter).map_or(Span::ZERO, |(stray, _)| stray * 2);
    let pll = slave.options.pll;
    let least = slave.device.min_window.max(pll.min_window).max(pll.quantum).max(jitter).ceil_to(unit).min(widest);
    let times = &mut slave.times;
    times.t_pll_w = times.t_pll_w.clamp(least, widest).ceil_to(unit);
    times.t_pll_d = times.t_pll_d.min(Span::from_iso_units(u16::MAX.into())).ceil_to(unit);
}

/// The shortest T_I on the grid: the device's, and long enough for the delay and the window.
fn shortest_t_i(slave: &Slave) -> Span {
    let window = slave.times.t_pll_w.max(slave.options.pll.min_window);
    let delay = slave.times.t_pll_d + window + Span::from_iso_units(1);
    slave.device.t_i_min(slave.functions).max(delay).ceil_to(slave.device.io_grid())
}

/// The common grid of T_DP of all slaves.
fn grid(network: &Scenario) -> Span {
    let common = |a: i64, b: i64| {
        let (mut x, mut y) = (a, b);
        while y != 0 {
            (x, y) = (y, x % y);
        }
        a / x * b
    };
    Span::from_ticks(
        network
            .configured()
            .filter(|slave| network.is_clocked(slave))
            .map(|slave| slave.device.dp_grid().ticks())
            .fold(1, common),
    )
}

/// The shortest T_DP that all slaves allow and that holds everything, off the grid.
fn shortest_t_dp(network: &Scenario, plan: &Plan) -> Span {
    let (master, bus) = (&network.master, &network.bus.params);
    let jitter = stray(&master.gc_jitter).map_or(Span::ZERO, |(stray, _)| stray);
    let jitter = if master.accumulate { jitter } else { jitter * 2 };
    // The token is back in time at least where no other master has T_TH.
    let whole = plan.content_at_most(Span::ZERO).max(plan.content()) + jitter;
    let needed = |slave: &Slave| {
        let start_up = plan.start_up(network, slave, build::set_prm(network, slave).len());
        if !network.is_clocked(slave) {
            return start_up.max(slave.min_slave_interval());
        }
        let times = slave.times.t_o + slave.device.gap_min(slave.functions) + slave.times.t_i;
        let window = slave.options.pll.min_window * 4;
        times.max(window).max(start_up).max(slave.device.t_dp_min).max(slave.min_slave_interval())
    };
    let shortest = network.configured().map(needed).max().unwrap_or_default().max(whole).max(Span::from_us(500));
    // No T_DP is shorter than a telegram.
    shortest.max(bus.span(super::SYNCH))
}
