//! Rules that a network should keep, though it runs without.

use super::{Facts, Findings, stray};
use crate::device::position;
use crate::study::plan::finding::{Amount, Key, Relation};
use crate::study::scenario::Fault;
use crate::time::{BitRate, Span};

/// Drives that do not offer isochronous mode below 1.5 Mbit/s make it a risk there.
pub(super) fn isochronous_rate(facts: &Facts<'_>, found: &mut Findings) {
    let rate = facts.scenario.bus.params.rate;
    let drives: Vec<_> =
        facts.slaves().filter(|slave| slave.device.subscriber).map(|slave| slave.address.to_string()).collect();
    let here = match drives.as_slice() {
        [] => "no drive is in this network".to_owned(),
        drives => format!("this network's drives are at {}", drives.join(", ")),
    };
    let bound = ("isochronous mode of drives", Amount::Rate(BitRate::M1_5));
    found.check(Key::bus("rate"), Amount::Rate(rate), Relation::AtLeast, bound, || {
        Fault::new(format!(
            "isochronous mode at {rate}: drives such as SIMODRIVE 611 universal do not offer it; {here}"
        ))
        .rule("drives offer isochronous mode from 1.5 Mbit/s on (SIMODRIVE 611 universal manual)")
        .help("rate = \"1.5 Mbit/s\" or more")
    });
    found.of("bit rate", Some(Amount::Rate(BitRate::M1_5)));
}

/// A narrower window is raised silently.
pub(super) fn window_is_taken(facts: &Facts<'_>, found: &mut Findings) {
    for slave in facts.clocked() {
        let (t_pll_w, least) = (slave.times.t_pll_w, slave.options.pll.min_window.max(slave.device.min_window));
        let key = Key::slave(slave.address, "t_pll_w");
        found.check(key, t_pll_w, Relation::AtLeast, ("the device's narrowest", least), || {
            Fault::new(format!("T_PLL_W = {t_pll_w} of slave {} counts as {least}", slave.address))
                .rule("a window below the device's narrowest is raised without a word (manual 3.3.8)")
                .help(format!("t_pll_w = \"{least}\""))
        });
    }
}

/// One SYNCH may be early and the next late: the loop follows the mean of both.
pub(super) fn jitter_within_window(facts: &Facts<'_>, found: &mut Findings) {
    let Some((stray, words)) = stray(&facts.scenario.master.gc_jitter) else { return };
    for slave in facts.clocked() {
        let (t_pll_w, twice) = (slave.times.t_pll_w, stray * 2);
        let key = Key::slave(slave.address, "t_pll_w");
        found.check(key, t_pll_w, Relation::AtLeast, ("2 x jitter of SYNCH", twice), || {
            Fault::new(format!("jitter of {stray} ({words}) is more than half of T_PLL_W of slave {}", slave.address))
                .rule("2 x jitter <= T_PLL_W: one SYNCH may be early and the next late (Model: D1, D11)")
                .help(format!("t_pll_w = \"{twice}\" or more, up to the device's widest"))
        });
    }
}

pub(super) fn seamless(facts: &Facts<'_>, found: &mut Findings) {
    for slave in facts.slaves() {
        let Some(scaling) = slave.scaling.filter(|scaling| scaling.total_range > 0) else { continue };
        let revolutions = slave.resolution().revolutions;
        let (units, range) = (scaling.units_per_rev, scaling.total_range);
        let positions = u64::from(units) * u64::from(revolutions);
        let as_device = position::Scaling { units_per_rev: units, total_range: range };
        let key = Key::slave(slave.address, "scaling.total_range");
        let terms = format!("total range {range}");
        found.check(key, Amount::Count(positions as i64), Relation::MultipleOf, (terms, range), || {
            Fault::new(format!("the position of slave {} jumps after {revolutions} revolutions", slave.address))
                .rule(format!("{units} units x {revolutions} revolutions = n x total range (Model: D22)"))
        });
        debug_assert_eq!(found.all.last().map(super::Finding::holds), Some(as_device.is_seamless(revolutions)));
        found.of("units x revolutions", nearest_divisor(positions, range).map(|range| Amount::Count(range.into())));
    }
}

/// The divisor of `number` nearest to `wanted`.
fn nearest_divisor(number: u64, wanted: u32) -> Option<u32> {
    let root = (1..).take_while(|small: &u64| small * small <= number);
    let pairs = root.filter(|small| number.is_multiple_of(*small)).flat_map(|small| [small, number / small]);
    pairs.filter_map(|divisor| u32::try_from(divisor).ok()).min_by_key(|divisor| divisor.abs_diff(wanted))
}

pub(super) fn repeats_fit(facts: &Facts<'_>, found: &mut Findings) {
    let (scenario, plan) = (facts.scenario, &facts.plan);
    if scenario.master.dx_retries == 0 || plan.slots.is_empty() {
        return;
    }
    let repeat = plan.repeat(&scenario.bus.params);
    let (t_dp, needed) = (scenario.master.t_dp, plan.content() + repeat);
    found.check(Key::master("t_dp"), t_dp, Relation::AtLeast, ("content + T_S + T_SL + T_ID1", needed), || {
        Fault::new(format!("one repeated Data_Exchange, {repeat}, does not fit into the spare time"))
            .rule("T_DP >= content + T_S + T_SL + T_ID1; without, SYNCH is late after a lost telegram (Model: D7)")
            .help("dx_retries = 0, or a longer t_dp")
    });
    found.of("T_DP", None);
}

pub(super) fn drive_cycles(facts: &Facts<'_>, found: &mut Findings) {
    drive(facts, found, |_, t_dx| t_dx, "T_DX + 2 x T_BASE_IO", 2);
}

pub(super) fn drive_instants(facts: &Facts<'_>, found: &mut Findings) {
    drive(facts, found, |times, _| times, "T_I + T_O + T_BASE_IO", 1);
}

/// T_DP is so many steps longer than T_I + T_O or T_DX of every drive, whichever `of` takes.
fn drive(facts: &Facts<'_>, found: &mut Findings, of: fn(Span, Span) -> Span, terms: &str, steps: i64) {
    let t_dp = facts.scenario.master.t_dp;
    for slave in facts.clocked().filter(|slave| slave.device.subscriber) {
        let needed = of(slave.times.t_i + slave.times.t_o, facts.plan.t_dx) + slave.device.io_grid() * steps;
        found.check(Key::master("t_dp"), t_dp, Relation::AtLeast, (terms, needed), || {
            Fault::new(format!("T_DP = {t_dp} is short for drive {}", slave.address))
                .rule(format!("T_DP >= {terms} = {needed} (SINAMICS, alarm A01902)"))
        });
        found.of("T_DP", None);
    }
}

/// A rotation has time for a message of every active station.
pub(super) fn rotation(facts: &Facts<'_>, found: &mut Findings) {
    let (bus, plan) = (&facts.scenario.bus.params, &facts.plan);
    if plan.visits.is_empty() {
        return;
    }
    let (masters, t_mc) = (plan.visits.len() + 1, plan.longest_high(bus));
    let least = plan.least_t_tr(bus);
    let terms = format!("{masters} x (T_TC + T_MC) + T_MC");
    found.check(Key::bus("t_tr"), bus.t_tr, Relation::AtLeast, (terms, least), || {
        Fault::new(format!("T_TR = {} leaves some of the {masters} masters no low-priority message", bus.t_tr))
            .rule(format!(
                "T_TR >= {masters} x (T_TC {} + T_MC {t_mc}) + T_MC = {least} (felser.ch, token_umlaufzeit)",
                bus.t_tc()
            ))
            .help(format!("t_tr = \"{least}\" or more"))
    });
}

/// Whatever the other masters do with the token, it is back before SYNCH.
pub(super) fn token_in_time(facts: &Facts<'_>, found: &mut Findings) {
    let (bus, plan, t_dp) = (&facts.scenario.bus.params, &facts.plan, facts.scenario.master.t_dp);
    if plan.visits.is_empty() {
        return;
    }
    let t_th = plan.t_th(bus, t_dp);
    let needed = plan.content_at_most(t_th);
    let longest = plan.longest_t_tr(bus, t_dp).filter(|t_tr| *t_tr >= plan.least_t_tr(bus));
    found.check(Key::master("t_dp"), t_dp, Relation::AtLeast, ("own content + longest visits", needed), || {
        Fault::new(format!("the token may come back up to {} late for SYNCH", plan.synch_delay(bus, t_dp)))
            .rule(format!(
                "T_DP >= {needed}: each of {} other masters may have the token for T_TH = T_TR - T_DP = {t_th} and the \
                 message that it began (EN 50170-2, Model: D6)",
                plan.visits.len()
            ))
            .help(match longest {
                Some(most) => format!("t_tr = \"{most}\" or less, or a longer t_dp"),
                None => "a longer t_dp".to_owned(),
            })
    });
    found.of("T_DP", None);
}
