//! Proposal: a set of values that keeps all rules, with the shortest T_DP on the grid.

use std::fmt::Write as _;

use super::finding::{Amount, Finding, Key, Subject, nearest};
use super::rules::services::LEAST_CONTROL_CYCLES;
use super::rules::{Facts, Weight, stray};
use super::{Plan, smallest_t_o};
use crate::fdl::params::BusParams;
use crate::sim::noise::GcJitter;
use crate::study::build;
use crate::study::quantity;
use crate::study::report::ranges;
use crate::study::scenario::topology::Topology;
use crate::study::scenario::{CodeSequence, Crystal, Extent, Link, Sample, Scenario, Slave, Watchdog};
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
        for slave in network.slaves.iter_mut().filter(|slave| !slave.silent) {
            window(slave, network.master.gc_jitter);
        }
        let plan = Plan::of(&network);
        for slave in network.slaves.iter_mut().filter(|slave| !slave.silent && slave.device.isochronous) {
            slave.times.t_i = shortest_t_i(slave);
            slave.times.t_o = smallest_t_o(plan.t_dx_told(), slave.device.t_o_min, slave.device.io_grid());
        }
        let grid = grid(&network);
        network.master.t_dp = shortest_t_dp(&network, &plan).ceil_to(grid);
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

    /// The proposed network as the text of a scenario: the bus, the master, the slaves and the links. Motions, events,
    /// disturbances and class 2 masters are not part of it.
    pub fn text(&self) -> String {
        let mut text = String::new();
        head(&mut text, self);
        topology(&mut text, &self.scenario.topology);
        master(&mut text, &self.scenario);
        slaves(&mut text, &self.scenario);
        for link in &self.scenario.links {
            link_table(&mut text, link);
        }
        text
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
fn window(slave: &mut Slave, jitter: GcJitter) {
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
    let jitter = stray(master.gc_jitter).map_or(Span::ZERO, |(stray, _)| stray);
    let jitter = if master.accumulate { jitter } else { jitter * 2 };
    let whole = plan.content() + jitter;
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

fn head(text: &mut String, proposal: &Proposal) {
    let scenario = &proposal.scenario;
    let plan = Plan::of(scenario);
    let _ = write!(
        text,
        "# Proposal for {}: the shortest T_DP with which all rules hold.\n#\n# T_DX {} at most; the cycle holds {}, {} is \
         spare.\n# A repeated Data_Exchange fits before SYNCH from t_dp = \"{}\" on.\n# Motions, events, disturbances and class 2 mastersare not part of it.\n\n[run]\nseed = {}\n",
        scenario.name,
        plan.t_dx,
        plan.content(),
        plan.spare(scenario.master.t_dp),
        exact(proposal.t_dp_with_repeat),
        scenario.run.seed
    );
    let _ = match scenario.run.duration {
        Extent::Time(span) => writeln!(text, "duration = \"{}\"", exact(span)),
        Extent::Cycles(cycles) => writeln!(text, "cycles = {cycles}"),
    };
    let (bus, usual) = (&scenario.bus.params, BusParams::profile(scenario.bus.params.rate));
    let _ = write!(text, "\n[bus]\nrate = \"{}\"\n", bus.rate);
    if !scenario.topology.has_segments() {
        let _ = writeln!(text, "cable = \"{} mm\"", scenario.bus.cable_mm);
    }
    for (key, value, usual) in [
        ("t_sl", bus.t_sl, usual.t_sl),
        ("min_tsdr", bus.min_tsdr, usual.min_tsdr),
        ("max_tsdr", bus.max_tsdr, usual.max_tsdr),
        ("t_set", bus.t_set, usual.t_set),
        ("t_qui", bus.t_qui, usual.t_qui),
    ] {
        if value != usual {
            let _ = writeln!(text, "{key} = \"{value}\"");
        }
    }
    let numbers = [
        ("max_retry_limit", bus.max_retry_limit, usual.max_retry_limit),
        ("gap_factor", bus.gap_factor, usual.gap_factor),
        ("hsa", bus.hsa, usual.hsa),
    ];
    for (key, value, _) in numbers.into_iter().filter(|(_, value, usual)| value != usual) {
        let _ = writeln!(text, "{key} = {value}");
    }
}

/// The segments and what joins them; nothing for a single cable.
fn topology(text: &mut String, topology: &Topology) {
    if !topology.has_segments() {
        return;
    }
    let segments = topology.segments();
    for segment in segments {
        let (name, cable, delay) = (&segment.name, segment.cable_mm, exact(segment.delay_per_metre));
        let _ = write!(text, "\n[[segment]]\nname = {name:?}\ncable = \"{cable} mm\"\ndelay_per_metre = \"{delay}\"\n");
    }
    for repeater in topology.repeaters() {
        let name = |end: usize| &segments[usize::from(repeater.ends[end].segment)].name;
        let _ = write!(text, "\n[[repeater]]\nname = {:?}\nkind = \"{}\"\n", repeater.name, repeater.kind.name);
        let _ = write!(text, "from = {:?}\nfrom_position = \"{} mm\"\n", name(0), repeater.ends[0].mm);
        let _ = write!(text, "to = {:?}\nto_position = \"{} mm\"\n", name(1), repeater.ends[1].mm);
        let _ = write!(text, "delay = \"{}\"\njitter = \"{}\"\n", exact(repeater.delay), exact(repeater.jitter));
        if repeater.kind.name == "olm" {
            let _ = write!(text, "modules = {}\nfibre = \"{} mm\"\n", repeater.modules, repeater.fibre_mm);
        }
    }
}

/// The segment of a station, where there are several.
fn segment(text: &mut String, scenario: &Scenario, index: u8) {
    if scenario.topology.has_segments() {
        let _ = writeln!(text, "segment = {:?}", scenario.topology.segments()[usize::from(index)].name);
    }
}

fn master(text: &mut String, scenario: &Scenario) {
    let master = &scenario.master;
    let _ = write!(text, "\n[master]\naddress = {}\nposition = \"{} mm\"\n", master.address, master.position_mm);
    segment(text, scenario, master.segment);
    let _ = writeln!(text, "t_dp = \"{}\"", exact(master.t_dp));
    let _ = writeln!(text, "t_mapc = {}", master.t_mapc);
    if let Some(first) = first(scenario) {
        let notes =
            ["latch before the end of the cycle", "set points in force after its start", "half width of the window"];
        for ((key, span), note) in times(first).into_iter().zip(notes) {
            let _ = writeln!(text, "{key} = \"{}\" # {note}", exact(span));
        }
    }
    let watchdog = master.watchdog.map_or(Span::ZERO, Watchdog::span);
    let _ = writeln!(text, "watchdog = \"{}\"", exact(watchdog));
    let _ = writeln!(text, "get_cfg = {}\ndx_retries = {}", master.get_cfg, master.dx_retries);
    let _ = writeln!(text, "lost_after = {}\nclear_for = {}", master.lost_after, master.clear_for);
    let _ = writeln!(text, "active_spare = {}", master.active_spare);
    if master.services.auto_clear {
        let _ = writeln!(text, "auto_clear = true");
    }
    if let Some(time) = master.services.data_control_time {
        let _ = writeln!(text, "data_control_time = \"{}\"", exact(time));
    }
    let _ = writeln!(text, "life_start = {}\nlife_delay = {}", master.life_start, master.life_delay);
    let _ = writeln!(text, "crystal = {}", crystal(master.crystal));
    let _ = writeln!(text, "gc_jitter = {}", jitter(master.gc_jitter, master.accumulate));
}

/// The slave whose times are the master's keys: the first that is clocked.
fn first(scenario: &Scenario) -> Option<&Slave> {
    scenario.configured().find(|slave| scenario.is_clocked(slave))
}
/// The times that slaves inherit from the master.
fn times(slave: &Slave) -> [(&'static str, Span); 3] {
    [("t_i", slave.times.t_i), ("t_o", slave.times.t_o), ("t_pll_w", slave.times.t_pll_w)]
}

/// One table for neighbours that differ in their addresses alone.
fn slaves(text: &mut String, scenario: &Scenario) {
    let Some(first) = first(scenario).or(scenario.configured().next()) else { return };
    let inherited = times(first);
    let count = scenario.slaves.len() as u64;
    // On one cable slaves are spread evenly if nothing else is said; on segments the place is always said.
    let line = !scenario.topology.has_segments();
    let spread = |index: usize| line.then(|| scenario.bus.cable_mm * (index as u64 + 1) / count);
    let tables: Vec<_> = scenario
        .slaves
        .iter()
        .enumerate()
        .map(|(index, slave)| (slave.address.get(), table(slave, &inherited, spread(index), scenario)))
        .collect();
    for group in tables.chunk_by(|a, b| a.1 == b.1) {
        let addresses: Vec<u8> = group.iter().map(|(address, _)| *address).collect();
        let _ = write!(text, "\n[[slave]]\naddresses = \"{}\"\n{}", ranges(&addresses), group[0].1);
    }
}

fn table(slave: &Slave, inherited: &[(&str, Span)], spread: Option<u64>, scenario: &Scenario) -> String {
    let bus = &scenario.bus.params;
    let mut text = format!("device = \"{}\"\n", slave.device.name);
    segment(&mut text, scenario, slave.segment);
    if spread != Some(slave.position_mm) {
        let _ = writeln!(text, "position = \"{} mm\"", slave.position_mm);
    }
    if slave.crystal != Crystal::Offset(0) {
        let _ = writeln!(text, "crystal = {}", crystal(slave.crystal));
    }
    if slave.t_sdr != Tbit(30).min(slave.device.max_tsdr(bus.rate)).max(bus.min_tsdr) {
        let _ = writeln!(text, "t_sdr = \"{}\"", slave.t_sdr);
    }
    for ((key, span), (_, usual)) in times(slave).into_iter().zip(inherited) {
        if span != *usual && slave.device.isochronous {
            let _ = writeln!(text, "{key} = \"{}\"", exact(span));
        }
    }
    if slave.times.t_pll_d != Span::ZERO {
        let _ = writeln!(text, "t_pll_d = \"{}\"", exact(slave.times.t_pll_d));
    }
    let _ = writeln!(text, "max_life_failures = {}", slave.max_life_failures);
    if slave.functions {
        let _ = writeln!(text, "functions = true");
    }
    if slave.code_sequence == CodeSequence::Ccw {
        let _ = writeln!(text, "code_sequence = \"ccw\"");
    }
    if let Some(scaling) = slave.scaling {
        let (units, range) = (scaling.units_per_rev, scaling.total_range);
        let _ = writeln!(text, "scaling = {{ units_per_rev = {units}, total_range = {range} }}");
    }
    if let Some(disc) = slave.options.resolution {
        let (steps, revolutions) = (disc.steps_per_rev, disc.revolutions);
        let _ = writeln!(text, "resolution = {{ steps_per_rev = {steps}, revolutions = {revolutions} }}");
    }
    let pll = slave.options.pll;
    let (least, quantum) = (exact(pll.min_window), exact(pll.quantum));
    let _ = writeln!(text, "pll = {{ min_window = \"{least}\", quantum = \"{quantum}\" }}");
    services(&mut text, slave);
    if slave.silent {
        let _ = writeln!(text, "silent = true");
    }
    if slave.powered_at != Span::ZERO {
        let _ = writeln!(text, "powered_at = \"{}\"", exact(slave.powered_at));
    }
    text
}

fn link_table(text: &mut String, link: &Link) {
    let _ = write!(text, "\n[[link]]\npublisher = {}\nsubscriber = {}\n", link.publisher, link.subscriber);
    if let Some(slot) = link.slot() {
        let _ = write!(text, "table = \"subscriber\"\nslot = {slot}\n");
    }
    if let Some(length) = link.publisher_length {
        let _ = writeln!(text, "publisher_length = {length}");
    }
    let samples: Vec<_> = link
        .samples
        .iter()
        .map(|Sample { offset, length, to }| match link.slot() {
            None => format!("{{ offset = {offset}, length = {length} }}"),
            Some(_) => format!("{{ offset = {offset}, length = {length}, to = {to} }}"),
        })
        .collect();
    let _ = writeln!(text, "samples = [{}]", samples.join(", "));
}

/// A span as a scenario can have it, exactly.
fn exact(span: Span) -> String {
    let shown = span.to_string();
    if quantity::span(&shown, None) == Ok(span) { shown } else { format!("{} tick", span.ticks()) }
}

fn services(text: &mut String, slave: &Slave) {
    let services = slave.services;
    let groups: Vec<_> =
        (0..7).filter(|bit| services.groups & (1 << bit) != 0).map(|bit| (bit + 1).to_string()).collect();
    if !groups.is_empty() {
        let _ = writeln!(text, "groups = [{}]", groups.join(", "));
    }
    for (key, _) in [("sync", services.sync), ("freeze", services.freeze)].into_iter().filter(|pair| pair.1) {
        let _ = writeln!(text, "{key} = true");
    }
    if let Some(interval) = services.min_slave_interval {
        let _ = writeln!(text, "min_slave_interval = \"{}\"", exact(interval));
    }
}

fn crystal(crystal: Crystal) -> String {
    match crystal {
        Crystal::Offset(ppb) => format!("\"{ppb} ppb\""),
        Crystal::Within(ppb) => format!("{{ within = \"{ppb} ppb\" }}"),
    }
}

fn jitter(jitter: GcJitter, accumulate: bool) -> String {
    let values = match jitter {
        GcJitter::None => String::new(),
        GcJitter::Uniform { half_width } => format!(", half_width = \"{}\"", exact(half_width)),
        GcJitter::Normal { sigma } => format!(", sigma = \"{}\"", exact(sigma)),
        GcJitter::BoundedNormal { sigma, bound } => {
            format!(", sigma = \"{}\", bound = \"{}\"", exact(sigma), exact(bound))
        }
    };
    let name = jitter.kind().name.replace('_', "-");
    format!("{{ kind = \"{name}\"{values}, accumulate = {accumulate} }}")
}
