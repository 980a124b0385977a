//! Rules of the bus parameters.

use super::{Facts, Findings};
use crate::study::plan::finding::{Amount, Key, Relation};
use crate::study::scenario::Fault;
use crate::time::Tbit;

pub(super) fn parameters(facts: &Facts<'_>, found: &mut Findings) {
    let bus = &facts.scenario.bus;
    // The first one that is broken explains the others.
    let mut told = false;
    let topology = &facts.scenario.topology;
    let t_td = topology.t_td_max();
    // A line's delay is its cable's; that of segments is not to be seen in the file.
    let path = if topology.has_segments() { format!(", T_TD = {t_td} on the longest path") } else { String::new() };
    for rule in bus.params.rules(t_td) {
        let in_bits = !matches!(rule.name, "max_retry_limit" | "gap_factor" | "hsa");
        let amount = |number: u32| if in_bits { Amount::Bits(number.into()) } else { Amount::Count(number.into()) };
        let key = Key::bus(rule.name);
        let help = if rule.min <= rule.max {
            format!("{} to {} with the other bus parameters and the cable", rule.min, rule.max)
        } else {
            "no value fits with the other bus parameters and the cable: change those".to_owned()
        };
        let fault = Fault::new(format!("{} is not allowed here", rule.value))
            .rule(format!("{} (EN 50170-2){path}", rule.rule))
            .help(help);
        for (relation, bound) in [(Relation::AtLeast, rule.min), (Relation::AtMost, rule.max)] {
            found.silent(key, amount(rule.value), relation, (rule.rule, amount(bound)));
            if let Some(last) = found.all.last_mut().filter(|last| !last.holds() && !told) {
                last.fault = Some(fault.clone());
                told = true;
            }
        }
    }
}

/// Reading a scenario has refused higher addresses before.
pub(super) fn addresses(facts: &Facts<'_>, found: &mut Findings) {
    let scenario = facts.scenario;
    let highest = scenario.stations().map(|station| station.address).max();
    if let Some(highest) = highest {
        let (hsa, highest) = (u32::from(scenario.bus.params.hsa), u32::from(highest.get()));
        found.silent(Key::bus("hsa"), hsa, Relation::AtLeast, ("highest address", highest));
    }
}

pub(super) fn device_max_tsdr(facts: &Facts<'_>, found: &mut Findings) {
    let params = &facts.scenario.bus.params;
    let slowest = facts.scenario.answering().max_by_key(|slave| slave.device.max_tsdr(params.rate));
    let Some(slave) = slowest else { return };
    let needed = slave.device.max_tsdr(params.rate);
    let terms = format!("MaxTsdr of {}", slave.device.name);
    found.check(Key::bus("max_tsdr"), params.max_tsdr, Relation::AtLeast, (terms, needed), || {
        Fault::new(format!("{} is too short for slave {}", params.max_tsdr, slave.address))
            .rule(format!("{} may take MaxTsdr = {needed} at {} (Model: D2)", slave.device.name, params.rate))
            .help(format!("max_tsdr = \"{needed}\" or more"))
    });
}

pub(super) fn own_t_sdr(facts: &Facts<'_>, found: &mut Findings) {
    let params = &facts.scenario.bus.params;
    for slave in facts.scenario.answering() {
        let min = params.min_tsdr;
        let max = slave.device.max_tsdr(params.rate).max(min);
        let fault = || {
            Fault::new(format!("{} is not what this slave may take to answer", slave.t_sdr))
                .rule(format!("min_tsdr = {min} <= T_SDR <= MaxTsdr = {max} of {} (Model: D2)", slave.device.name))
                .help(format!("t_sdr = \"{}\"", slave.t_sdr.clamp(min, max)))
        };
        let key = Key::slave(slave.address, "t_sdr");
        found.check(key, slave.t_sdr, Relation::AtLeast, ("min T_SDR", min), fault);
        found.check(key, slave.t_sdr, Relation::AtMost, ("MaxTsdr", max), fault);
    }
}

/// Octet 4 has eight bits for the min_TSDR of a publisher.
pub(super) fn publisher_min_tsdr(facts: &Facts<'_>, found: &mut Findings) {
    const MOST: Tbit = Tbit(255);
    let (params, links) = (&facts.scenario.bus.params, &facts.scenario.links);
    let Some(publisher) = links.first().map(|link| link.publisher) else { return };
    let t_id1 = params.t_id1();
    let t_set = i64::from(MOST.0.saturating_sub(35 + params.t_qui.0) / 2);
    found.check(Key::bus("t_set"), t_id1, Relation::AtMost, ("octet 4 of a publisher's Set_Prm", MOST), || {
        Fault::new(format!("T_ID1 = {t_id1} is more than publisher {publisher} can be told"))
            .rule("a publisher's min_TSDR is T_ID1 = 35 + 2 T_SET + T_QUI, at most 255 (Set_Prm octet 4, Model: D27)")
            .help(format!("t_set = \"{} tbit\" or less, or no links", t_set.max(0)))
    });
    found.of("T_ID1", (t_set > 0).then_some(Amount::Bits(t_set)));
}
