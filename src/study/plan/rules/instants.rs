//! Rules of every slave's instants, window and timers.

use super::{Facts, Findings, neighbours, on_off, shortest_t_dp, written};
use crate::study::plan::finding::{Key, Relation};
use crate::study::scenario::{Fault, Slave};
use crate::time::Span;

pub(super) fn t_i_grid(facts: &Facts<'_>, found: &mut Findings) {
    for slave in facts.clocked() {
        grid(found, slave, ("t_i", slave.times.t_i), "3.3.4, 3.3.5");
    }
}

pub(super) fn t_o_grid(facts: &Facts<'_>, found: &mut Findings) {
    for slave in facts.clocked() {
        grid(found, slave, ("t_o", slave.times.t_o), "3.3.4, 3.3.6");
    }
}

fn grid(found: &mut Findings, slave: &Slave, (key, span): (&'static str, Span), section: &str) {
    let grid = slave.device.io_grid();
    let name = super::symbol(key);
    found.check(Key::slave(slave.address, key), span, Relation::MultipleOf, ("T_BASE_IO", grid), || {
        Fault::new(format!("{name} = {span} is not on the grid"))
            .rule(format!("{name} is a multiple of T_BASE_IO = {grid} (manual {section})"))
            .help(neighbours(key, span, grid))
    });
}

pub(super) fn t_i_minimum(facts: &Facts<'_>, found: &mut Findings) {
    for slave in facts.clocked() {
        let (t_i, min) = (slave.times.t_i, slave.device.t_i_min(slave.functions));
        let key = Key::slave(slave.address, "t_i");
        found.check(key, t_i, Relation::AtLeast, (format!("TI_MIN, octet 15 bit 1 {}", on_off(slave)), min), || {
            let section = if slave.functions { "3.2.2" } else { "3.3.5" };
            Fault::new(format!("T_I = {t_i} is too short for slave {}", slave.address))
                .rule(format!(
                    "T_I >= {min} with scaling, preset and code sequence {} (manual {section})",
                    on_off(slave)
                ))
                .help(format!("the shortest is t_i = \"{min}\""))
        });
    }
}

pub(super) fn t_o_minimum(facts: &Facts<'_>, found: &mut Findings) {
    let t_dx = facts.plan.t_dx_told();
    for slave in facts.clocked() {
        let (t_o, t_o_min) = (slave.times.t_o, slave.device.t_o_min);
        let bound = t_dx + t_o_min;
        found.check(Key::slave(slave.address, "t_o"), t_o, Relation::MoreThan, ("T_DX + T_O_MIN", bound), || {
            Fault::new(format!("T_O = {t_o} is too early for slave {}", slave.address))
                .rule(format!("T_O > T_DX + T_O_MIN = {t_dx} + {t_o_min} = {bound} (manual 3.3.6, Model: D3)"))
                .help(format!("the earliest is t_o = \"{}\"", facts.plan.t_o_min(&slave.device)))
        });
    }
}

/// The gap rule; since T_I is above 0 it holds T_O below T_DP too.
pub(super) fn t_o_maximum(facts: &Facts<'_>, found: &mut Findings) {
    let t_dp = facts.scenario.master.t_dp;
    for slave in facts.clocked() {
        let (times, gap_min) = (slave.times, slave.device.gap_min(slave.functions));
        let bound = t_dp - times.t_i - gap_min;
        found.check(Key::slave(slave.address, "t_o"), times.t_o, Relation::AtMost, ("T_DP - T_I - gap", bound), || {
            too_late(facts, slave)
        });
    }
}

fn too_late(facts: &Facts<'_>, slave: &Slave) -> Fault {
    let t_dp = facts.scenario.master.t_dp;
    let (times, gap_min) = (&slave.times, slave.device.gap_min(slave.functions));
    let (min, max) = (facts.plan.t_o_min(&slave.device), facts.plan.t_o_max(slave, t_dp));
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
    Fault::new(message)
        .rule(format!(
            "(T_DP - T_I) - T_O >= {gap_min} with scaling, preset and code sequence {}, here ({t_dp} - {}) - {} \
             (manual 3.3.5, 3.3.6, Model: D3)",
            on_off(slave),
            times.t_i,
            times.t_o
        ))
        .help(help)
}

/// The gap rule says it if not.
pub(super) fn t_o_within(facts: &Facts<'_>, found: &mut Findings) {
    for slave in facts.clocked() {
        let bound = ("T_DP", facts.scenario.master.t_dp);
        found.silent(Key::slave(slave.address, "t_o"), slave.times.t_o, Relation::LessThan, bound);
    }
}

/// The gap rule says it if not.
pub(super) fn t_i_within(facts: &Facts<'_>, found: &mut Findings) {
    for slave in facts.clocked() {
        let bound = ("T_DP", facts.scenario.master.t_dp);
        found.silent(Key::slave(slave.address, "t_i"), slave.times.t_i, Relation::LessThan, bound);
    }
}

pub(super) fn window(facts: &Facts<'_>, found: &mut Findings) {
    for slave in facts.clocked() {
        let max = Span::from_iso_units(u32::from(slave.device.t_pll_w_max));
        let range = (Span::from_iso_units(1), max);
        iso_units(found, slave, ("t_pll_w", slave.times.t_pll_w), range, ("T_PLL_W_MAX", "3.3.8"));
    }
}

pub(super) fn delay(facts: &Facts<'_>, found: &mut Findings) {
    for slave in facts.clocked() {
        // The delayed latch must lie before the next clock, which may come a window early.
        let window = slave.times.t_pll_w.max(slave.options.pll.min_window);
        let before_clock = (slave.times.t_i - window - Span::from_iso_units(1)).max(Span::ZERO);
        let max = Span::from_iso_units(u32::from(u16::MAX)).min(before_clock);
        let range = (Span::ZERO, max);
        iso_units(found, slave, ("t_pll_d", slave.times.t_pll_d), range, ("T_I - window", "3.3.9, Model: D13"));
    }
}

/// A time in whole units of 1/12 us in a range whose upper end has these terms in this section.
fn iso_units(
    found: &mut Findings,
    slave: &Slave,
    (key, span): (&'static str, Span),
    (min, max): (Span, Span),
    (terms, section): (&str, &str),
) {
    let unit = Span::from_iso_units(1);
    let name = super::symbol(key);
    let out = || {
        Fault::new(format!("{name} = {span} is out of range"))
            .rule(format!("{name} is {min} to {max} for {} (manual {section})", slave.device.name))
            .help(format!("{key} = {}", written(span.clamp(min, max))))
    };
    let key_of = Key::slave(slave.address, key);
    found.check(key_of, span, Relation::AtLeast, ("the shortest", min), out);
    found.check(key_of, span, Relation::AtMost, (terms, max), out);
    found.check(key_of, span, Relation::MultipleOf, ("1/12 us", unit), || {
        let below = unit * span.div_floor(unit);
        Fault::new(format!("{name} = {span} is between two steps"))
            .rule(format!("{name} is a whole number of 1/12 us (manual {section})"))
            .help(format!("the neighbours are {key} = {} and {}", written(below), written(below + unit)))
    });
}

/// The narrowest window is one that may be.
pub(super) fn least_window(facts: &Facts<'_>, found: &mut Findings) {
    let widest = Span::from_ticks(facts.scenario.master.t_dp.ticks() / 4);
    for slave in facts.clocked() {
        let least = slave.options.pll.min_window;
        let key = Key::slave(slave.address, "pll.min_window");
        found.check(key, least, Relation::AtMost, ("T_DP / 4", widest), || {
            Fault::new(format!("a window of {least} to either side would reach the next clock"))
                .rule(format!("min_window <= T_DP / 4 = {widest} (Model: D12)"))
                .help("the default is min_window = \"1 us\"")
        });
    }
}

/// A timer whose steps are longer than the window cannot hit it.
pub(super) fn quantum(facts: &Facts<'_>, found: &mut Findings) {
    for slave in facts.clocked() {
        let (pll, quantum) = (slave.options.pll, slave.options.pll.quantum);
        let window = slave.times.t_pll_w.max(pll.min_window);
        let key = Key::slave(slave.address, "pll.quantum");
        found.check(key, quantum, Relation::AtMost, ("window in force", window), || {
            Fault::new(format!("timer steps of {quantum} are longer than the window"))
                .rule(format!("quantum <= half width of the window in force, {window} (manual 3.3.8, Model: D14)"))
                .help("the default is quantum = \"250 tick\", 1/48 us")
        });
    }
}
