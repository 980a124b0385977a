//! The rules between the keys of a scenario: one function per rule, each of which names the rule with its source, the
//! numbers, and the nearest right value.

use super::class1;
use super::class2;
use super::error::Fault;
use super::gsd;
use super::kinds::jitter_bound;
use super::section::Reader;
use super::services;
use super::topology;
use super::tree::Place;
use super::{Action, CodeSequence, Crystal, Disturbance, Extent, Link, Run, Sample, Scenario, Slave, When};
use crate::device::options::Resolution;
use crate::dp::master::Pace;
use crate::sim::motion;
use crate::sim::noise::GcJitter;
use crate::study::build;
use crate::study::plan::Plan;
use crate::study::quantity;
use crate::time::{BitRate, Span};
use crate::wire::Address;

/// A rule: looks at the facts and complains.
type Rule = fn(&Facts<'_>, &mut Reader<'_>);

/// What the rules look at.
pub(super) struct Facts<'a> {
    pub(super) scenario: &'a Scenario,
    plan: Plan,
}

/// All rules in stages, those of isochronous mode and those of every master. A stage takes for granted that the stages
/// before found nothing.
const STAGES: &[(&[Rule], &[Rule])] = &[
    (&[], &[some_slave, own_addresses, class1::owners, addresses_within_hsa, wiring, crystals, run_length]),
    (&[], &[class2::slaves]),
    (&[isochronous_rate], &[gsd::device_rates, bus_parameters, device_max_tsdr, own_t_sdr]),
    (&[t_dp_limits, t_dp_grid, t_dp_content], &[t_mapc, watchdog_outlasts_t_dp]),
    (&[services::slave_interval], &[services::data_control_time, services::sync_and_freeze]),
    (&[], &[encoder_parameters, resolution]),
    (&[t_i_grid, t_o_grid, t_i_minimum, t_o_minimum, t_o_maximum, window, delay, least_window], &[]),
    (&[quantum], &[]),
    (&[jitter_fits], &[functions, code_sequence, units_per_rev, total_range, cycles_fit]),
    (&[], &[publishers, subscribers, samples, link_counts, link_watchdog]),
    (&[], &[sample_lengths, destinations, told_lengths]),
    (&[], &[gsd::set_prm_length]),
    (
        &[],
        &[
            event_stations,
            class1::event_stations,
            gsd::acyclic_devices,
            event_instants,
            disturbance_stations,
            services::commands,
        ],
    ),
    (&[start_up], &[]),
];

/// Largest offset of a crystal. Model: twice what cheap ones have over temperature and age.
const CRYSTAL_MAX_PPB: i64 = 200_000;

/// Checks `scenario` stage by stage until one complains.
pub(super) fn check(scenario: &Scenario, reader: &mut Reader<'_>) -> Vec<super::error::Problem> {
    let facts = Facts { scenario, plan: Plan::of(scenario) };
    for (isochronous, always) in STAGES {
        let isochronous = isochronous.iter().filter(|_| scenario.master.pace == Pace::Synch);
        for rule in isochronous.chain(*always) {
            rule(&facts, reader);
        }
        let problems = reader.take_problems();
        if !problems.is_empty() {
            return problems;
        }
    }
    Vec::new()
}

/// Complains about `key`, which stands at its own path or at one of `others`.
pub(super) fn about(reader: &mut Reader<'_>, key: &str, others: &[&str], fault: Fault) {
    let place = match reader.place(&[key]) {
        Place::Missing => reader.place(others),
        place => place,
    };
    reader.complain_first(place, key, fault);
}

/// Complains about `key` of `slave`, which may have inherited it from `[master]`.
pub(super) fn about_slave(reader: &mut Reader<'_>, slave: &Slave, key: &str, fault: Fault) {
    let path = format!("slave.{}.{key}", slave.address);
    let address = format!("slave.{}.address", slave.address);
    about(reader, &path, &[&format!("master.{key}"), &address], fault);
}

fn some_slave(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    if facts.scenario.configured().next().is_none() {
        let fault =
            Fault::new("there is no slave that answers").help("add a [[slave]] with address, device, t_i and t_o");
        about(reader, "slave", &[], fault);
    }
}

fn own_addresses(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    // Of slaves the table is known by the address, so that two of them are found when they are read.
    let all: Vec<_> = facts.scenario.stations().collect();
    for (i, station) in all.iter().enumerate() {
        if let Some(other) = all[..i].iter().find(|other| other.address == station.address) {
            let (a, b) = (other.what_it_is(), station.what_it_is());
            let fault = Fault::new(format!("{a} and {b} have the address {}", station.address))
                .rule("every station of a bus has an address of its own (EN 50170-2)");
            about(reader, &format!("{}.address", station.path()), &[], fault);
        }
    }
}

fn addresses_within_hsa(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let hsa = facts.scenario.bus.params.hsa;
    for station in facts.scenario.stations() {
        let address = station.address;
        if address.get() > hsa {
            let fault = Fault::new(format!("the address {address} is above hsa = {hsa}"))
                .rule("no station is above the highest station address HSA (EN 50170-2)")
                .help(format!("hsa = {address} or more, at most 126"));
            about(reader, &format!("{}.address", station.path()), &[], fault);
        }
    }
}

fn wiring(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    topology::positions(facts.scenario, reader);
    topology::loads(facts.scenario, reader);
    topology::jitter(facts.scenario, reader);
}

fn crystals(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for station in facts.scenario.stations() {
        let (Crystal::Offset(ppb) | Crystal::Within(ppb)) = station.crystal;
        if ppb.abs() > CRYSTAL_MAX_PPB {
            let fault = Fault::new(format!("a crystal is not off by {} ppm", ppb as f64 / 1e3))
                .rule("a crystal is within 200 ppm (Model: twice what cheap ones have)")
                .help(format!("\"{} ppm\" at most", ppb.signum() * CRYSTAL_MAX_PPB / 1_000));
            about(reader, &format!("{}.crystal", station.path()), &[], fault);
        }
    }
}

fn run_length(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let (key, fault) = match facts.scenario.run.duration {
        Extent::Time(span) if span <= Span::ZERO => ("run.duration", Fault::new("a run of no time shows nothing")),
        Extent::Cycles(0) => ("run.cycles", Fault::new("a run of no cycles shows nothing")),
        _ => return,
    };
    about(reader, key, &[], fault);
}

fn isochronous_rate(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let rate = facts.scenario.bus.params.rate;
    if rate < BitRate::M1_5 {
        let fault = Fault::new(format!("{rate} is too slow for isochronous mode"))
            .rule("isochronous mode is offered from 1.5 Mbit/s on (SIMODRIVE 611 universal manual)")
            .help("\"1.5 Mbit/s\", \"3 Mbit/s\", \"6 Mbit/s\" or \"12 Mbit/s\"");
        about(reader, "bus.rate", &[], fault);
    }
}

fn bus_parameters(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let bus = &facts.scenario.bus;
    let topology = &facts.scenario.topology;
    let t_td = topology.t_td_max();
    if let Err(broken) = bus.params.check(t_td) {
        let help = if broken.min <= broken.max {
            format!("{} to {} with the other bus parameters and the cable", broken.min, broken.max)
        } else {
            "no value fits with the other bus parameters and the cable: change those".to_owned()
        };
        // A line's delay is its cable's; that of segments is not to be seen in the file.
        let path = if topology.has_segments() { format!(", T_TD = {t_td} on the longest path") } else { String::new() };
        let fault = Fault::new(format!("{} is not allowed here", broken.value))
            .rule(format!("{} (EN 50170-2){path}", broken.rule))
            .help(help);
        about(reader, &format!("bus.{}", broken.name), &["bus.cable", "bus.rate"], fault);
    }
}

fn device_max_tsdr(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let params = &facts.scenario.bus.params;
    let slowest = facts.scenario.answering().max_by_key(|slave| slave.device.max_tsdr(params.rate));
    let Some(slave) = slowest else { return };
    let needed = slave.device.max_tsdr(params.rate);
    if needed > params.max_tsdr {
        let fault = Fault::new(format!("{} is too short for slave {}", params.max_tsdr, slave.address))
            .rule(format!("{} may take MaxTsdr = {needed} at {} (Model: D2)", slave.device.name, params.rate))
            .help(format!("max_tsdr = \"{needed}\" or more"));
        about(reader, "bus.max_tsdr", &["bus.rate"], fault);
    }
}

fn own_t_sdr(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let params = &facts.scenario.bus.params;
    for slave in facts.scenario.answering() {
        let min = params.min_tsdr;
        let max = slave.device.max_tsdr(params.rate).max(min);
        if !(min..=max).contains(&slave.t_sdr) {
            let fault = Fault::new(format!("{} is not what this slave may take to answer", slave.t_sdr))
                .rule(format!("min_tsdr = {min} <= T_SDR <= MaxTsdr = {max} of {} (Model: D2)", slave.device.name))
                .help(format!("t_sdr = \"{}\"", slave.t_sdr.clamp(min, max)));
            about_slave(reader, slave, "t_sdr", fault);
        }
    }
}

fn t_dp_limits(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let t_dp = facts.scenario.master.t_dp;
    for slave in facts.scenario.configured() {
        let (min, max) = (slave.device.t_dp_min, slave.device.t_dp_max);
        if !(min..=max).contains(&t_dp) {
            let fault = Fault::new(format!("T_DP = {t_dp} is out of the range of {}", slave.device.name))
                .rule(format!("T_DP is {min} to {max} (manual 3.3.2)"))
                .help(format!("t_dp = \"{}\"", t_dp.clamp(min, max)));
            about(reader, "master.t_dp", &[], fault);
        }
    }
}

fn t_dp_grid(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let t_dp = facts.scenario.master.t_dp;
    for slave in facts.scenario.configured() {
        let grid = slave.device.dp_grid();
        if !t_dp.is_multiple_of(grid) {
            let fault = Fault::new(format!("T_DP = {t_dp} is not on the grid of {}", slave.device.name))
                .rule(format!("T_DP is a multiple of T_BASE_DP = {grid} (manual 3.3.1, 3.3.2)"))
                .help(neighbours("t_dp", t_dp, grid));
            about(reader, "master.t_dp", &[], fault);
        }
    }
}

fn t_dp_content(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let (plan, t_dp) = (&facts.plan, facts.scenario.master.t_dp);
    if t_dp < plan.content() {
        let Plan { t_dx, gap, token, synch, .. } = plan;
        let fault = Fault::new(format!("T_DP = {t_dp} cannot hold the cycle of {} slaves", plan.slots.len()))
            .rule(format!(
                "T_DP >= T_DX {t_dx} + GAP {gap} + token {token} + Global_Control {synch} = {} (manual 3.3.2)",
                plan.content()
            ))
            .help(shortest_t_dp(facts));
        about(reader, "master.t_dp", &[], fault);
    }
}

fn t_mapc(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let t_mapc = facts.scenario.master.t_mapc;
    if !(1..=14).contains(&t_mapc) {
        let fault = Fault::new(format!("T_MAPC = {t_mapc} x T_DP is out of range"))
            .rule("T_MAPC is 1 to 14 x T_DP (manual 3.3.3, octet 43)")
            .help(format!("t_mapc = {}", t_mapc.clamp(1, 14)));
        about(reader, "master.t_mapc", &[], fault);
    }
}

fn watchdog_outlasts_t_dp(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let master = &facts.scenario.master;
    if let Some(watchdog) = master.watchdog.map(super::Watchdog::span)
        && watchdog <= master.t_dp
    {
        let fault = Fault::new(format!("a watchdog of {watchdog} runs out in every cycle"))
            .rule(format!("the watchdog is longer than T_DP = {} (Model: one Data_Exchange per cycle)", master.t_dp))
            .help("watchdog = \"200 ms\", or \"0 ms\" for none");
        about(reader, "master.watchdog", &["master.t_dp"], fault);
    }
}

fn t_i_grid(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.configured() {
        let grid = slave.device.io_grid();
        if !slave.times.t_i.is_multiple_of(grid) {
            let fault = Fault::new(format!("T_I = {} is not on the grid", slave.times.t_i))
                .rule(format!("T_I is a multiple of T_BASE_IO = {grid} (manual 3.3.4, 3.3.5)"))
                .help(neighbours("t_i", slave.times.t_i, grid));
            about_slave(reader, slave, "t_i", fault);
        }
    }
}

fn t_o_grid(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.configured() {
        let grid = slave.device.io_grid();
        if !slave.times.t_o.is_multiple_of(grid) {
            let fault = Fault::new(format!("T_O = {} is not on the grid", slave.times.t_o))
                .rule(format!("T_O is a multiple of T_BASE_IO = {grid} (manual 3.3.4, 3.3.6)"))
                .help(neighbours("t_o", slave.times.t_o, grid));
            about_slave(reader, slave, "t_o", fault);
        }
    }
}

fn t_i_minimum(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.configured() {
        let min = slave.device.t_i_min(slave.functions);
        if slave.times.t_i < min {
            let section = if slave.functions { "3.2.2" } else { "3.3.5" };
            let fault = Fault::new(format!("T_I = {} is too short for slave {}", slave.times.t_i, slave.address))
                .rule(format!(
                    "T_I >= {min} with scaling, preset and code sequence {} (manual {section})",
                    on_off(slave)
                ))
                .help(format!("the shortest is t_i = \"{min}\""));
            about_slave(reader, slave, "t_i", fault);
        }
    }
}

fn t_o_minimum(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let t_dx = facts.plan.t_dx_told();
    for slave in facts.scenario.configured() {
        let min = facts.plan.t_o_min(&slave.device);
        if slave.times.t_o < min {
            let t_o_min = slave.device.t_o_min;
            let fault = Fault::new(format!("T_O = {} is too early for slave {}", slave.times.t_o, slave.address))
                .rule(format!(
                    "T_O > T_DX + T_O_MIN = {t_dx} + {t_o_min} = {} (manual 3.3.6, Model: D3)",
                    t_dx + t_o_min
                ))
                .help(format!("the earliest is t_o = \"{min}\""));
            about_slave(reader, slave, "t_o", fault);
        }
    }
}

/// The gap rule; since T_I is above 0 it holds T_O below T_DP too.
fn t_o_maximum(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let t_dp = facts.scenario.master.t_dp;
    for slave in facts.scenario.configured() {
        let (times, gap_min) = (&slave.times, slave.device.gap_min(slave.functions));
        let (min, max) = (facts.plan.t_o_min(&slave.device), facts.plan.t_o_max(slave, t_dp));
        if times.t_o > max {
            let gap = t_dp - times.t_i - times.t_o;
            let message = if gap < Span::ZERO {
                format!("T_O = {} comes after the latch of slave {}", times.t_o, slave.address)
            } else {
                format!("T_O = {} is only {gap} before the latch of slave {}", times.t_o, slave.address)
            };
            let help = if max >= min {
                format!("the latest is t_o = \"{max}\"")
            } else {
                format!("no T_O fits between T_DX and the latch; {}", shortest_t_dp(facts))
            };
            let fault = Fault::new(message)
                .rule(format!(
                    "(T_DP - T_I) - T_O >= {gap_min} with scaling, preset and code sequence {}, here ({t_dp} - {}) - {} \
                     (manual 3.3.5, 3.3.6, Model: D3)",
                    on_off(slave),
                    times.t_i,
                    times.t_o
                ))
                .help(help);
            about_slave(reader, slave, "t_o", fault);
        }
    }
}

fn window(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.configured() {
        let max = Span::from_iso_units(u32::from(slave.device.t_pll_w_max));
        iso_units(reader, slave, ("t_pll_w", slave.times.t_pll_w), Span::from_iso_units(1), max, "3.3.8");
    }
}

fn delay(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.configured() {
        // The delayed latch must lie before the next clock, which may come a window early.
        let window = slave.times.t_pll_w.max(slave.options.pll.min_window);
        let before_clock = (slave.times.t_i - window - Span::from_iso_units(1)).max(Span::ZERO);
        let max = Span::from_iso_units(u32::from(u16::MAX)).min(before_clock);
        iso_units(reader, slave, ("t_pll_d", slave.times.t_pll_d), Span::ZERO, max, "3.3.9, Model: D13");
    }
}

/// The narrowest window is one that may be.
fn least_window(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let widest = Span::from_ticks(facts.scenario.master.t_dp.ticks() / 4);
    for slave in facts.scenario.configured() {
        let least = slave.options.pll.min_window;
        if least > widest {
            let fault = Fault::new(format!("a window of {least} to either side would reach the next clock"))
                .rule(format!("min_window <= T_DP / 4 = {widest} (Model: D12)"))
                .help("the default is min_window = \"1 us\"");
            about_slave(reader, slave, "pll.min_window", fault);
        }
    }
}

/// A timer whose steps are longer than the window cannot hit it.
fn quantum(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.configured() {
        let (pll, quantum) = (slave.options.pll, slave.options.pll.quantum);
        let window = slave.times.t_pll_w.max(pll.min_window);
        if quantum > window {
            let fault = Fault::new(format!("timer steps of {quantum} are longer than the window"))
                .rule(format!("quantum <= half width of the window in force, {window} (manual 3.3.8, Model: D14)"))
                .help("the default is quantum = \"250 tick\", 1/48 us");
            about_slave(reader, slave, "pll.quantum", fault);
        }
    }
}

/// A time in whole units of 1/12 us from `min` to `max`.
fn iso_units(reader: &mut Reader<'_>, slave: &Slave, of: (&str, Span), min: Span, max: Span, section: &str) {
    let unit = Span::from_iso_units(1);
    let (key, span) = of;
    let name = key.to_uppercase();
    if !(min..=max).contains(&span) {
        let fault = Fault::new(format!("{name} = {span} is out of range"))
            .rule(format!("{name} is {min} to {max} for {} (manual {section})", slave.device.name))
            .help(format!("{key} = {}", written(span.clamp(min, max))));
        about_slave(reader, slave, key, fault);
    } else if !span.is_multiple_of(unit) {
        let below = unit * span.div_floor(unit);
        let fault = Fault::new(format!("{name} = {span} is between two steps"))
            .rule(format!("{name} is a whole number of 1/12 us (manual {section})"))
            .help(format!("the neighbours are {key} = {} and {}", written(below), written(below + unit)));
        about_slave(reader, slave, key, fault);
    }
}

/// Octet 15 and scaling belong to the encoders' parameter block, which a subscriber does not have.
fn encoder_parameters(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.answering().filter(|slave| slave.device.subscriber) {
        let given = [
            ("scaling", slave.scaling.is_some()),
            ("functions", slave.functions),
            ("code_sequence", slave.code_sequence == CodeSequence::Ccw),
            ("resolution", slave.options.resolution.is_some()),
            ("preset_value", slave.options.preset_value != 0),
        ];
        if let Some((key, _)) = given.into_iter().find(|&(_, given)| given) {
            let fault = Fault::new(format!("{} has no {key}", slave.device.name))
                .rule("disc, scaling, preset and code sequence are an encoder's (manual 3.2)");
            about_slave(reader, slave, key, fault);
        }
    }
}

/// The positions of a disc fit into the words of telegram 81.
fn resolution(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.answering() {
        let Resolution { steps_per_rev, revolutions } = slave.resolution();
        if let Err(error) = motion::Resolution::new(steps_per_rev, revolutions) {
            let fault = Fault::new(error.to_string()).rule("G1_XIST1 and G1_XIST2 have 32 bits (manual 2.2)");
            about_slave(reader, slave, "resolution", fault);
        }
    }
}

fn functions(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.answering() {
        if slave.scaling.is_some() && !slave.functions {
            let fault = Fault::new(format!("slave {} has scaling, but functions = false", slave.address))
                .rule("scaling needs octet 15 bit 1 as well as bit 3 (manual 3.2.2, Model: D21)")
                .help("leave out functions, or leave out scaling");
            about_slave(reader, slave, "functions", fault);
        }
    }
}

fn code_sequence(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.answering() {
        if slave.code_sequence == CodeSequence::Ccw && !slave.functions {
            let fault = Fault::new(format!("code_sequence = \"ccw\" has no effect in slave {}", slave.address))
                .rule("the code sequence is in force with octet 15 bit 1 alone (manual 3.2.2)")
                .help("add functions = true, which needs T_I and the gap of 375 us");
            about_slave(reader, slave, "code_sequence", fault);
        }
    }
}

fn units_per_rev(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.answering() {
        let (Some(scaling), steps) = (slave.scaling, slave.resolution().steps_per_rev) else { continue };
        if !(1..=steps).contains(&scaling.units_per_rev) {
            let fault = Fault::new(format!("{} units per revolution are out of range", scaling.units_per_rev))
                .rule(format!("1 to {steps} units, the physical resolution of {} (manual 3.2.3)", slave.device.name))
                .help(format!("units_per_rev = {}", scaling.units_per_rev.clamp(1, steps)));
            about_slave(reader, slave, "scaling.units_per_rev", fault);
        }
    }
}

fn total_range(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.answering() {
        let Some(scaling) = slave.scaling else { continue };
        let revolutions = slave.resolution().revolutions;
        let max = u64::from(scaling.units_per_rev) * u64::from(revolutions);
        if scaling.total_range == 0 || u64::from(scaling.total_range) > max {
            let fault = Fault::new(format!("a total range of {} is out of range", scaling.total_range))
                .rule(format!(
                    "total range <= {} units per revolution x {revolutions} revolutions (manual 3.2.4, Model: D20)",
                    scaling.units_per_rev
                ))
                .help(format!("total_range = {}", u64::from(scaling.total_range).clamp(1, max.max(1))));
            about_slave(reader, slave, "scaling.total_range", fault);
        }
    }
}

fn jitter_fits(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let master = &facts.scenario.master;
    let bus = &facts.scenario.bus.params;
    let spare = master.t_dp - facts.plan.content();
    // Tokens in the spare time leave an idle line of T_ID1 alone.
    let spare = if master.active_spare { spare.min(bus.span(bus.t_id1())) } else { spare };
    // A stray to the one side follows a stray to the other; accumulating, each one counts from the last.
    let times = if master.accumulate { 1 } else { 2 };
    let (stray, words) = match (jitter_bound(master.gc_jitter), master.gc_jitter) {
        (Some(bound), _) => (bound, "its bound"),
        (None, GcJitter::Normal { sigma }) => (sigma * 6, "six times sigma"),
        (None, _) => return,
    };
    if stray * times > spare {
        let fault = Fault::new(format!("jitter of {stray} ({words}) does not fit into the spare time of {spare}"))
            .rule(format!("{times} x {stray} <= T_DP {} - cycle {} (Model: D1, D6)", master.t_dp, facts.plan.content()))
            .help(format!("at most {}, or a longer t_dp", Span::from_us(spare.div_floor(Span::from_us(times)))));
        about(reader, "master.gc_jitter", &[], fault);
    }
}

fn cycles_fit(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let Extent::Cycles(cycles) = facts.scenario.run.duration else { return };
    let most = Run::LONGEST.div_floor(facts.scenario.master.t_dp) as u64;
    if cycles > most {
        let fault = Fault::new(format!("{cycles} cycles of {} are too long", facts.scenario.master.t_dp))
            .rule("a run ends within 24 years (Model: range of time)")
            .help(format!("cycles = {most} at most"));
        about(reader, "run.cycles", &[], fault);
    }
}

/// The links with their paths.
fn links<'a>(facts: &Facts<'a>) -> impl Iterator<Item = (String, &'a Link)> {
    facts.scenario.links.iter().enumerate().map(|(i, link)| (format!("link.{}", i + 1), link))
}

fn publishers(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (path, link) in links(facts) {
        let fault = match configured(facts, link.publisher) {
            None => no_slave(facts, link.publisher),
            Some(slave) if !slave.device.publisher => Fault::new(format!("slave {} cannot publish", slave.address))
                .rule(format!("{} has no publisher function (its profile, manual 3.4)", slave.device.name)),
            Some(_) if link.publisher == link.subscriber => {
                Fault::new(format!("slave {} would subscribe to itself", link.publisher))
                    .rule("publisher and subscriber are two slaves (manual 1.2)")
            }
            Some(_) => continue,
        };
        about(reader, &format!("{path}.publisher"), &[], fault);
    }
}

fn subscribers(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (i, (path, link)) in links(facts).enumerate() {
        let earlier = &facts.scenario.links[..i];
        let fault = match configured(facts, link.subscriber) {
            None => no_slave(facts, link.subscriber),
            Some(_) if link.publisher == link.subscriber => continue,
            Some(slave) if !slave.device.subscriber => Fault::new(format!("slave {} cannot subscribe", slave.address))
                .rule(format!("{} has no subscriber function (its profile, manual 3.4)", slave.device.name))
                .help("subscriber-drive can"),
            Some(_) if earlier.iter().any(|e| is_pair(e, link) && e.table == link.table) => {
                Fault::new(format!("slave {} has this publisher already", link.subscriber))
                    .rule("one link per publisher, subscriber and table (Model: D26 counts latencies by the pair)")
                    .help("one link with both: samples = [{ offset = 4, length = 4 }, { offset = 0, length = 2 }]")
            }
            Some(_) => continue,
        };
        about(reader, &format!("{path}.subscriber"), &[], fault);
    }
}

/// The slave at `address`, if the master has it in its list.
fn configured<'a>(facts: &Facts<'a>, address: Address) -> Option<&'a Slave> {
    facts.scenario.slave(address).filter(|slave| !slave.silent && slave.master == facts.scenario.master.address)
}

/// The fault of naming a slave that is not there, or silent.
fn no_slave(facts: &Facts<'_>, address: Address) -> Fault {
    let all: Vec<_> = facts.scenario.configured().map(|slave| slave.address.to_string()).collect();
    let silent = facts.scenario.slave(address).is_some();
    let message = if silent { format!("slave {address} is silent") } else { format!("there is no slave {address}") };
    Fault::new(message).help(format!("the slaves are {}", all.join(", ")))
}

/// Whether two links are of the same publisher and subscriber.
fn is_pair(one: &Link, other: &Link) -> bool {
    (one.publisher, one.subscriber) == (other.publisher, other.subscriber)
}

/// Every sample with the path of its keys.
fn all_samples<'a>(facts: &Facts<'a>, reader: &Reader<'_>) -> Vec<(String, &'a Link, Sample)> {
    let mut all = Vec::new();
    for (path, link) in links(facts) {
        let listed = reader.place(&[&format!("{path}.samples")]) != Place::Missing;
        for (i, &sample) in link.samples.iter().enumerate() {
            all.push((if listed { format!("{path}.samples.{}", i + 1) } else { path.clone() }, link, sample));
        }
    }
    all
}

/// Length of the publisher's data as Set_Prm says it, and who says so.
fn told_length<'a>(facts: &Facts<'a>, link: &Link) -> Option<(u8, &'a str)> {
    let publisher = facts.scenario.slave(link.publisher)?;
    Some(
        link.publisher_length
            .map_or((publisher.device.inputs, &*publisher.device.name), |told| (told, "publisher_length")),
    )
}

fn samples(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (path, link, sample) in all_samples(facts, reader) {
        let Some((inputs, whose)) = told_length(facts, link) else { continue };
        let (offset, length) = (u32::from(sample.offset), u32::from(sample.length));
        if length == 0 || offset + length > u32::from(inputs) {
            let fault = Fault::new(format!(
                "a sample of {length} octets from octet {offset} on is not in the publisher's data"
            ))
            .rule(format!(
                "length >= 1 and offset {offset} + length {length} <= {inputs} octets of {whose} (DXB link table)"
            ))
            .help("offset = 4, length = 4 is G1_XIST1 of telegram 81");
            let publisher = format!("link.{}.publisher", number_of(&path));
            about(reader, &format!("{path}.length"), &[&format!("{path}.offset"), &publisher], fault);
        }
    }
}

/// The number of the link that `path` belongs to.
fn number_of(path: &str) -> &str {
    path.split('.').nth(1).unwrap_or_default()
}

fn sample_lengths(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (path, link, sample) in all_samples(facts, reader) {
        let Some(subscriber) = facts.scenario.slave(link.subscriber) else { continue };
        let longest = subscriber.device.dxb.data;
        if sample.length > longest {
            let fault = Fault::new(format!("slave {} takes no sample of {} octets", link.subscriber, sample.length))
                .rule(format!("length <= {longest} octets of {} (DXB_Max_Data_Length)", subscriber.device.name));
            about(reader, &format!("{path}.length"), &[], fault);
        }
    }
}

/// Where the samples of the subscriber table go.
fn destinations(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let mut taken: Vec<(Address, u8, std::ops::Range<u16>)> = Vec::new();
    for (path, link, sample) in all_samples(facts, reader) {
        let (Some(slot), Some(subscriber)) = (link.slot(), facts.scenario.slave(link.subscriber)) else { continue };
        let (limits, name) = (subscriber.device.dxb, &subscriber.device.name);
        let to = u16::from(sample.to)..u16::from(sample.to) + u16::from(sample.length);
        if slot > limits.slots {
            let fault = Fault::new(format!("slave {} has no slot {slot} for samples", link.subscriber))
                .rule(format!("slot 1 to {} of {name} (its profile)", limits.slots));
            about(reader, &format!("link.{}.slot", number_of(&path)), &[], fault);
        } else if to.end > limits.data.into() {
            let fault = Fault::new(format!(
                "{} octets from octet {} on are not in the slot's data area",
                sample.length, to.start
            ))
            .rule(format!("to + length <= {} octets of {name} (its profile)", limits.data));
            about(reader, &format!("{path}.to"), &[&format!("{path}.length")], fault);
        } else if let Some((.., other)) = taken.iter().find(|(station, number, other)| {
            (*station, *number) == (link.subscriber, slot) && other.start < to.end && to.start < other.end
        }) {
            let fault =
                Fault::new(format!("octets {} to {} of slot {slot} are taken already", other.start, other.end - 1))
                    .rule(format!(
                        "no two samples of slave {} go to the same octet (Model: its slots)",
                        link.subscriber
                    ))
                    .help(format!("for example to = {}", other.end));
            let publisher = format!("link.{}.publisher", number_of(&path));
            about(reader, &format!("{path}.to"), &[&format!("{path}.offset"), &publisher], fault);
        }
        taken.push((link.subscriber, slot, to));
    }
}

/// A publisher's data have one length, and its subscriber knows one.
fn told_lengths(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (i, (path, link)) in links(facts).enumerate() {
        let Some((told, _)) = told_length(facts, link) else { continue };
        let others = facts.scenario.links[..i].iter().filter(|other| is_pair(other, link));
        let other = others.filter_map(|other| told_length(facts, other)).find(|&(other, _)| other != told);
        if let Some((other, _)) = other {
            let fault = Fault::new(format!("slave {} would know two lengths of its publisher's data", link.subscriber))
                .rule("all links of a pair say the same publisher_length (Model: a publisher has one)")
                .help(format!("publisher_length = {other} here too"));
            about(reader, &format!("{path}.publisher_length"), &[&format!("{path}.publisher")], fault);
        }
    }
}

fn link_counts(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for slave in facts.scenario.configured() {
        let most = usize::from(slave.device.dxb.links);
        let all = all_samples(facts, reader);
        let mut own = all.iter().filter(|(_, link, _)| link.subscriber == slave.address);
        if let Some((path, ..)) = own.nth(most) {
            let fault = Fault::new(format!("slave {} has more than {most} links", slave.address))
                .rule(format!("a subscriber has up to {most} links (GSD: DXB_Max_Link_Count), each sample is one"));
            about(reader, &format!("link.{}.subscriber", number_of(path)), &[], fault);
        }
    }
}

fn link_watchdog(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    if facts.scenario.master.watchdog.is_none() && !facts.scenario.links.is_empty() {
        let fault = Fault::new("links need the watchdog")
            .rule("a subscriber watches its links for the watchdog time (VPC3+ manual, Model: D27)")
            .help("watchdog = \"200 ms\"");
        about(reader, "master.watchdog", &[], fault);
    }
}

fn event_stations(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let events = facts.scenario.events.iter().enumerate();
    let orders = events.filter(|(_, event)| !matches!(event.action, Action::PowerOff | Action::PowerOn));
    for (i, event) in orders {
        if let Some(&address) = event.slaves.iter().find(|&&address| facts.scenario.slave(address).is_none()) {
            let path = format!("event.{}", i + 1);
            about(reader, &format!("{path}.slave"), &[&format!("{path}.slaves")], no_slave(facts, address));
        }
    }
}

fn event_instants(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let t_dp = facts.scenario.master.t_dp;
    for (i, event) in facts.scenario.events.iter().enumerate() {
        let (key, late) = match (event.when, facts.scenario.run.duration) {
            (When::Time(at), Extent::Time(end)) => ("at", at >= end),
            (When::Cycle(at), Extent::Cycles(end)) => ("cycle", at >= end),
            (When::Cycle(at), Extent::Time(end)) => ("cycle", at >= end.div_floor(t_dp) as u64),
            // How long the first cycle takes to come is not known here.
            (When::Time(_), Extent::Cycles(_)) => continue,
        };
        if late {
            let fault = Fault::new("the run is over before this event");
            about(reader, &format!("event.{}.{key}", i + 1), &[], fault.help("a longer run, or an earlier event"));
        }
    }
}

fn disturbance_stations(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    for (i, disturbance) in facts.scenario.disturbances.iter().enumerate() {
        let Disturbance::LostTelegrams { from, to, .. } = disturbance else { continue };
        for (key, station) in [("from", from), ("to", to)] {
            if let Some(address) = *station
                && address != facts.scenario.master.address
                && facts.scenario.class1(address).is_none()
                && facts.scenario.slave(address).is_none()
            {
                let fault = no_slave(facts, address);
                about(reader, &format!("disturbance.{}.{key}", i + 1), &[], fault);
            }
        }
    }
}

/// A slave that starts up, or comes back, does so while the others exchange data.
fn start_up(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let (plan, t_dp) = (&facts.plan, facts.scenario.master.t_dp);
    let needed = |slave| plan.start_up(facts.scenario, slave, build::set_prm(facts.scenario, slave).len());
    let longest = facts.scenario.configured().map(|slave| (needed(slave), slave)).max_by_key(|&(needed, _)| needed);
    if let Some((needed, slave)) = longest.filter(|&(needed, _)| needed > t_dp) {
        let fault = Fault::new(format!("T_DP = {t_dp} leaves slave {} no time to start up", slave.address))
            .rule(format!(
                "T_DP >= {needed}: Data_Exchange with the others, its Set_Prm, token {} and Global_Control {} (manual \
                 3.3.2: time reserved for acyclic services, Model: D6)",
                plan.token, plan.synch
            ))
            .help(format!("the shortest is t_dp = \"{}\"", needed.ceil_to(slave.device.dp_grid())));
        about(reader, "master.t_dp", &[], fault);
    }
}

impl Action {
    /// Whether an event with this action names slaves.
    pub(super) const fn about_slaves(self) -> bool {
        !matches!(self, Self::Clear | Self::Operate | Self::Control(_))
    }
}

/// The shortest T_DP that would hold everything, as help.
fn shortest_t_dp(facts: &Facts<'_>) -> String {
    let needed = |slave: &Slave| {
        let gap = slave.device.gap_min(slave.functions);
        let times =
            facts.plan.t_o_min(&slave.device) + gap + slave.times.t_i.max(slave.device.t_i_min(slave.functions));
        facts.plan.t_dp_min(&slave.device).max(times.ceil_to(slave.device.dp_grid()))
    };
    let shortest = facts.scenario.configured().map(needed).max().unwrap_or_default();
    format!("the shortest is t_dp = \"{shortest}\"")
}

/// The two points of `grid` around `span`, as help.
fn neighbours(key: &str, span: Span, grid: Span) -> String {
    let below = grid * span.div_floor(grid);
    format!("the neighbours are {key} = \"{below}\" and \"{}\"", below + grid)
}

/// `span` as a scenario can have it, exactly.
fn written(span: Span) -> String {
    let shown = span.to_string();
    if quantity::span(&shown, None) == Ok(span) {
        format!("\"{shown}\"")
    } else {
        format!("\"{} tick\" ({shown})", span.ticks())
    }
}

/// Whether octet 15 bit 1 is set, in words.
const fn on_off(slave: &Slave) -> &'static str {
    if slave.functions { "on" } else { "off" }
}
