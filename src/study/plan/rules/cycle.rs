//! Rules of the bus cycle and of the master.

use super::{Facts, Findings, neighbours, shortest_t_dp, stray};
use crate::sim::fault::What;
use crate::sim::fault::window::{Bursts, Window};
use crate::study::build;
use crate::study::plan::Plan;
use crate::study::plan::finding::{Amount, Key, Relation};
use crate::study::scenario::{Fault, Slave, Watchdog};
use crate::time::Span;
use crate::wire::prm::IsoM;

const T_DP: Key = Key::master("t_dp");

pub(super) fn t_dp_limits(facts: &Facts<'_>, found: &mut Findings) {
    let t_dp = facts.scenario.master.t_dp;
    for device in facts.devices() {
        let (min, max) = (device.t_dp_min, device.t_dp_max);
        let fault = || {
            Fault::new(format!("T_DP = {t_dp} is out of the range of {}", device.name))
                .rule(format!("T_DP is {min} to {max} (manual 3.3.2)"))
                .help(format!("t_dp = \"{}\"", t_dp.clamp(min, max)))
        };
        found.check(T_DP, t_dp, Relation::AtLeast, ("TDP_MIN", min), fault);
        found.check(T_DP, t_dp, Relation::AtMost, ("TDP_MAX", max), fault);
    }
}

/// What the isochronous block can say at all.
pub(super) fn t_dp_system(facts: &Facts<'_>, found: &mut Findings) {
    let t_dp = facts.scenario.master.t_dp;
    let [min, max] =
        [IsoM::T_DP_RANGE.start(), IsoM::T_DP_RANGE.end()].map(|&units| Span::from_iso_units(units as u32));
    let fault = || {
        Fault::new(format!("T_DP = {t_dp} is out of the range of isochronous mode"))
            .rule(format!("T_DP is {min} to {max} (Set_Prm block 04, octets 41..42)"))
            .help(format!("t_dp = \"{}\"", t_dp.clamp(min, max)))
    };
    found.check(T_DP, t_dp, Relation::AtLeast, ("isochronous mode", min), fault);
    found.check(T_DP, t_dp, Relation::AtMost, ("isochronous mode", max), fault);
}

pub(super) fn t_dp_grid(facts: &Facts<'_>, found: &mut Findings) {
    let t_dp = facts.scenario.master.t_dp;
    for device in facts.devices() {
        let grid = device.dp_grid();
        found.check(T_DP, t_dp, Relation::MultipleOf, ("T_BASE_DP", grid), || {
            Fault::new(format!("T_DP = {t_dp} is not on the grid of {}", device.name))
                .rule(format!("T_DP is a multiple of T_BASE_DP = {grid} (manual 3.3.1, 3.3.2)"))
                .help(neighbours("t_dp", t_dp, grid))
        });
    }
}

pub(super) fn t_dp_content(facts: &Facts<'_>, found: &mut Findings) {
    let (plan, t_dp) = (&facts.plan, facts.scenario.master.t_dp);
    let visits = plan.content() - plan.own();
    let terms = if plan.visits.is_empty() { "" } else { " + visits" };
    let terms = format!("T_DX + GAP + token{terms} + SYNCH");
    found.check(T_DP, t_dp, Relation::AtLeast, (terms, plan.content()), || {
        let Plan { t_dx, gap, token, synch, .. } = plan;
        let others =
            if plan.visits.is_empty() { String::new() } else { format!(" + visits of other masters {visits}") };
        Fault::new(format!("T_DP = {t_dp} cannot hold the cycle of {} slaves", plan.slots.len()))
            .rule(format!(
                "T_DP >= T_DX {t_dx} + GAP {gap} + token {token}{others} + Global_Control {synch} = {} (manual 3.3.2)",
                plan.content()
            ))
            .help(shortest_t_dp(facts))
    });
}

/// The content of the cycle says it if not.
pub(super) fn t_dx_ends(facts: &Facts<'_>, found: &mut Findings) {
    found.silent(T_DP, facts.scenario.master.t_dp, Relation::MoreThan, ("T_DX", facts.plan.t_dx));
}

pub(super) fn time_bases(facts: &Facts<'_>, found: &mut Findings) {
    for device in facts.devices() {
        for (symbol, base) in [("T_BASE_DP", device.t_base_dp), ("T_BASE_IO", device.t_base_io)] {
            let bases = IsoM::TIME_BASES;
            let near = bases.into_iter().min_by_key(|known| known.abs_diff(base)).unwrap_or(base);
            let (base, near) = (Span::from_iso_units(base), Span::from_iso_units(near));
            // Equal is both a multiple of the nearest base and not more than it.
            let fault = || {
                Fault::new(format!("{symbol} = {base} of {} is no time base", device.name))
                    .rule("a time base is 375, 750, 1500, 3000, 6000 or 12000 x 1/12 us (Set_Prm block 04)")
                    .help("another device")
            };
            for relation in [Relation::AtLeast, Relation::AtMost] {
                found.check(T_DP, base, relation, ("nearest time base", near), fault);
                found.of(symbol, None);
            }
        }
    }
}

pub(super) fn t_mapc(facts: &Facts<'_>, found: &mut Findings) {
    let t_mapc = facts.scenario.master.t_mapc;
    let fault = || {
        Fault::new(format!("T_MAPC = {t_mapc} x T_DP is out of range"))
            .rule("T_MAPC is 1 to 14 x T_DP (manual 3.3.3, octet 43)")
            .help(format!("t_mapc = {}", t_mapc.clamp(1, 14)))
    };
    let key = Key::master("t_mapc");
    found.check(key, u32::from(t_mapc), Relation::AtLeast, ("the shortest", 1u32), fault);
    found.check(key, u32::from(t_mapc), Relation::AtMost, ("the longest", 14u32), fault);
}

pub(super) fn watchdog_outlasts_t_dp(facts: &Facts<'_>, found: &mut Findings) {
    let (master, cycle) = (&facts.scenario.master, facts.scenario.cycle_symbol());
    let Some(watchdog) = master.watchdog.map(Watchdog::span) else { return };
    found.check(Key::master("watchdog"), watchdog, Relation::MoreThan, (cycle, master.t_dp), || {
        Fault::new(format!("a watchdog of {watchdog} runs out in every cycle"))
            .rule(format!("the watchdog is longer than {cycle} = {} (Model: one Data_Exchange per cycle)", master.t_dp))
            .help("watchdog = \"200 ms\", or \"0 ms\" for none")
    });
}

/// The factors: reading the key has refused everything else. Steps of 1 ms are for slaves that have them.
pub(super) fn watchdog_factors(facts: &Facts<'_>, found: &mut Findings) {
    let Some(watchdog) = facts.scenario.master.watchdog else { return };
    let (key, span) = (Key::master("watchdog"), watchdog.span());
    let (step, longest) = if watchdog.base_1ms { ("1 ms", "1 ms x 255 x 255") } else { ("10 ms", "10 ms x 255 x 255") };
    found.silent(key, span, Relation::MultipleOf, (step, watchdog.base()));
    found.silent(key, span, Relation::AtMost, (longest, watchdog.base() * (255 * 255)));
    if !watchdog.base_1ms {
        return;
    }
    for slave in facts.slaves().filter(|slave| !slave.device.wd_base_1ms) {
        let terms = format!("10 ms, slave {} has no WD_Base_1ms_supp", slave.address);
        found.check(key, span, Relation::MultipleOf, (terms, Watchdog::BASE), || coarse_watchdog(span, slave));
    }
}
/// The fault of a watchdog in steps of 1 ms for a slave that does not have them.
pub(in crate::study) fn coarse_watchdog(span: Span, slave: &Slave) -> Fault {
    let above = (span.div_floor(Watchdog::BASE) + 1..).find_map(|steps| Watchdog::of(Watchdog::BASE * steps));
    let help = above.map_or_else(String::new, |above| format!("the next is watchdog = \"{}\"", above.span()));
    Fault::new(format!("a watchdog of {span} is too fine for slave {}", slave.address))
        .rule(format!(
            "the watchdog is a multiple of 10 ms where a slave has no WD_Base_1ms_supp, such as {} (its GSD file)",
            slave.device.name
        ))
        .help(help)
}

pub(super) fn jitter_fits(facts: &Facts<'_>, found: &mut Findings) {
    let master = &facts.scenario.master;
    let bus = &facts.scenario.bus.params;
    let spare = facts.plan.spare(master.t_dp);
    // Tokens in the spare time leave an idle line of T_ID1 alone.
    let spare = if master.active_spare { spare.min(bus.span(bus.t_id1())) } else { spare };
    // A stray to the one side follows a stray to the other; accumulating, each one counts from the last.
    let (times, terms) = if master.accumulate { (1, "spare time") } else { (2, "spare time / 2") };
    let (stray, words) = match (stray(&master.gc_jitter), disturbed_strays(facts)) {
        (None, Span::ZERO) => return,
        (Some(own), Span::ZERO) => own,
        (None, disturbed) => (disturbed, "the bounds of disturbances"),
        (Some((own, _)), disturbed) => (own + disturbed, "with the bounds of disturbances"),
    };
    let most = Span::from_ticks(spare.ticks().div_euclid(times));
    found.check(Key::master("gc_jitter"), stray, Relation::AtMost, (terms, most), || {
        Fault::new(format!("jitter of {stray} ({words}) does not fit into the spare time of {spare}"))
            .rule(format!("{times} x {stray} <= T_DP {} - cycle {} (Model: D1, D6)", master.t_dp, facts.plan.content()))
            .help(format!("at most {}, or a longer t_dp", Span::from_us(spare.div_floor(Span::from_us(times)))))
    });
}

/// The sum of the largest strays of all disturbances of SYNCH that have a bound.
fn disturbed_strays(facts: &Facts<'_>) -> Span {
    let bounds = facts.scenario.disturbances.iter().filter_map(|disturbance| match &disturbance.what {
        What::Clock(jitter, false) => jitter.bound(),
        // Strays that add up have a bound where so many clocks have one.
        What::Clock(jitter, true) => {
            let Window::Cycles(Bursts { length: Some(cycles), .. }) = disturbance.window else { return None };
            jitter.bound()?.ticks().checked_mul(cycles).map(Span::from_ticks)
        }
        _ => None,
    });
    // No spare time is as long as a second.
    bounds.fold(Span::ZERO, |sum, bound| sum + bound.min(Span::from_s(1)))
}

/// A slave that starts up, or comes back, does so while the others exchange data.
pub(super) fn start_up(facts: &Facts<'_>, found: &mut Findings) {
    let (plan, t_dp) = (&facts.plan, facts.scenario.master.t_dp);
    let needed = |slave| plan.start_up(facts.scenario, slave, build::set_prm(facts.scenario, slave).len());
    let longest = facts.slaves().map(|slave| (needed(slave), slave)).max_by_key(|&(needed, _)| needed);
    let Some((needed, slave)) = longest else { return };
    let terms = format!("with the start-up of slave {}", slave.address);
    found.check(T_DP, t_dp, Relation::AtLeast, (terms, Amount::from(needed)), || {
        Fault::new(format!("T_DP = {t_dp} leaves slave {} no time to start up", slave.address))
            .rule(format!(
                "T_DP >= {needed}: Data_Exchange with the others, its Set_Prm, token {} and Global_Control {} (manual \
                 3.3.2: time reserved for acyclic services, Model: D6)",
                plan.token, plan.synch
            ))
            .help(format!("the shortest is t_dp = \"{}\"", needed.ceil_to(slave.device.dp_grid())))
    });
}
