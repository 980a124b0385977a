//! Data: the plan as JSON. Keys come in a fixed order and name their units.

use serde::Serialize;

use super::finding::{Amount, Finding, nearest};
use super::octets;
use super::ring::Visit;
use super::rules::{Facts, Weight};
use super::{Plan, computing_time, dead_time};
use crate::study::export::decimal::Decimal;
use crate::study::scenario::{Pace, Slave};
use crate::time::Span;

#[derive(Serialize)]
struct Document {
    scenario: String,
    bit_rate: &'static str,
    master: u8,
    isochronous: bool,
    holds: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    cycle: Option<Cycle>,
    free_running: FreeRunning,
    #[serde(skip_serializing_if = "Option::is_none")]
    ring: Option<Ring>,
    slaves: Vec<SlaveData>,
    rules: Vec<Verdict>,
}

#[derive(Serialize)]
struct Cycle {
    t_dp_us: Decimal,
    t_dp_min_us: Decimal,
    t_dx_us: Decimal,
    t_dx_expected_us: Decimal,
    t_m_us: Decimal,
    computing_time_us: Decimal,
    t_mapc: u8,
    gap_us: Decimal,
    token_us: Decimal,
    visits_us: Decimal,
    synch_us: Decimal,
    content_us: Decimal,
    spare_us: Decimal,
    repeat_us: Decimal,
    t_id1_tbit: u32,
    t_id2_tbit: u32,
}

#[expect(clippy::struct_field_names, reason = "every number says its unit")]
#[derive(Serialize)]
struct FreeRunning {
    cycle_us: Decimal,
    cycle_with_gap_us: Decimal,
    cycle_expected_us: Decimal,
    exchange_us: Decimal,
    token_us: Decimal,
    gap_us: Decimal,
    pause_us: Decimal,
    least_cycle_us: Decimal,
    slave_intervals_us: Decimal,
}

#[derive(Serialize)]
struct Ring {
    t_tr_tbit: u32,
    t_tr_min_tbit: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    synch_delay_us: Option<Decimal>,
    visits: Vec<VisitData>,
}

#[derive(Serialize)]
struct VisitData {
    master: u8,
    class: u8,
    least_us: Decimal,
    longest_message_us: Decimal,
    work_us: Decimal,
}

#[derive(Serialize)]
struct SlaveData {
    address: u8,
    device: String,
    t_s_tbit: u32,
    t_sdr_tbit: u32,
    t_r_tbit: u32,
    t_td_both_us: Decimal,
    t_mc_us: Decimal,
    request_us: Decimal,
    reply_end_us: Decimal,
    #[serde(flatten)]
    instants: Option<Instants>,
    set_prm: String,
    chk_cfg: String,
}

/// What a slave with a clock has.
#[expect(clippy::struct_field_names, reason = "every number says its unit")]
#[derive(Serialize)]
struct Instants {
    t_i_us: Decimal,
    t_i_min_us: Decimal,
    t_i_max_us: Decimal,
    t_o_us: Decimal,
    t_o_min_us: Decimal,
    t_o_max_us: Decimal,
    t_pll_w_us: Decimal,
    dead_time_us: Decimal,
}

#[derive(Serialize)]
struct Verdict {
    rule: &'static str,
    source: &'static str,
    weight: &'static str,
    key: String,
    symbol: &'static str,
    value: Number,
    relation: &'static str,
    bound: Number,
    terms: String,
    holds: bool,
    margin: Option<Number>,
    nearest: Option<Number>,
}

#[derive(Serialize)]
struct Number {
    value: f64,
    unit: &'static str,
}
impl From<Amount> for Number {
    fn from(amount: Amount) -> Self {
        let (value, unit) = match amount {
            // As exact as the other times here.
            Amount::Time(span) => (Decimal::us(span).value(), "us"),
            other => other.number(),
        };
        Self { value, unit }
    }
}

/// The plan and what the rules find, as JSON.
///
/// # Errors
/// If the library refuses, which it has no reason to.
pub(super) fn json(facts: &Facts<'_>, findings: &[Finding]) -> Result<String, serde_json::Error> {
    let (scenario, plan) = (facts.scenario, &facts.plan);
    let (bus, us) = (&scenario.bus.params, Decimal::us);
    let (free, expected) = (plan.free_running(scenario), Plan::expected(scenario).free_running(scenario));
    let clocked = scenario.master.pace == Pace::Synch;
    let must = |found: &&Finding| found.rule.weight == Weight::Must;
    let document = Document {
        scenario: scenario.name.clone(),
        bit_rate: bus.rate.text(),
        master: scenario.master.address.get(),
        holds: findings.iter().filter(must).all(Finding::holds),
        isochronous: clocked,
        cycle: clocked.then(|| cycle(facts)),
        free_running: FreeRunning {
            cycle_us: us(free.cycle()),
            cycle_with_gap_us: us(free.with_gap()),
            cycle_expected_us: us(expected.cycle()),
            exchange_us: us(free.exchange),
            token_us: us(free.token),
            gap_us: us(free.gap),
            pause_us: us(free.pause(Span::ZERO)),
            least_cycle_us: us(free.least_cycle),
            slave_intervals_us: us(free.intervals),
        },
        ring: (!plan.visits.is_empty()).then(|| ring(facts)),
        slaves: scenario.configured().map(|slave| slave_data(facts, slave)).collect(),
        rules: findings.iter().map(|found| verdict(found, findings)).collect(),
    };
    Ok(serde_json::to_string_pretty(&document)? + "\n")
}

fn ring(facts: &Facts<'_>) -> Ring {
    let (scenario, plan) = (facts.scenario, &facts.plan);
    let (bus, us) = (&scenario.bus.params, Decimal::us);
    let clocked = scenario.master.pace == Pace::Synch;
    let visit = |visit: &Visit| VisitData {
        master: visit.station.get(),
        class: visit.class,
        least_us: us(visit.least),
        longest_message_us: us(visit.longest),
        work_us: us(visit.work),
    };
    Ring {
        t_tr_tbit: bus.t_tr.0,
        t_tr_min_tbit: plan.least_t_tr(bus).0,
        synch_delay_us: clocked.then(|| us(plan.synch_delay(bus, scenario.master.t_dp))),
        visits: plan.visits.iter().map(visit).collect(),
    }
}

fn cycle(facts: &Facts<'_>) -> Cycle {
    let (scenario, plan) = (facts.scenario, &facts.plan);
    let (bus, master, us) = (&scenario.bus.params, &scenario.master, Decimal::us);
    let shortest = scenario.configured().map(|slave| plan.t_dp_min(&slave.device)).max().unwrap_or_default();
    Cycle {
        t_dp_us: us(master.t_dp),
        t_dp_min_us: us(shortest),
        t_dx_us: us(plan.t_dx),
        t_dx_expected_us: us(Plan::expected(scenario).t_dx),
        t_m_us: us(plan.t_m()),
        computing_time_us: us(computing_time(plan, master.t_dp, master.t_mapc)),
        t_mapc: master.t_mapc,
        gap_us: us(plan.gap),
        token_us: us(plan.token),
        visits_us: us(plan.content() - plan.own()),
        synch_us: us(plan.synch),
        content_us: us(plan.content()),
        spare_us: us(plan.spare(master.t_dp)),
        repeat_us: us(plan.repeat(bus)),
        t_id1_tbit: bus.t_id1().0,
        t_id2_tbit: bus.t_id2().0,
    }
}

fn slave_data(facts: &Facts<'_>, slave: &Slave) -> SlaveData {
    let (scenario, plan) = (facts.scenario, &facts.plan);
    let (bus, master, us, times) = (&scenario.bus.params, &scenario.master, Decimal::us, slave.times);
    let slot = plan.slot(slave.address);
    let span = |of: fn(&super::Slot) -> Span| us(slot.map_or(Span::ZERO, of));
    let [prm, cfg] = octets::telegrams(scenario, slave);
    let instants = || Instants {
        t_i_us: us(times.t_i),
        t_i_min_us: us(slave.device.t_i_min(slave.functions)),
        t_i_max_us: us(plan.t_i_max(slave, master.t_dp)),
        t_o_us: us(times.t_o),
        t_o_min_us: us(plan.t_o_min(&slave.device)),
        t_o_max_us: us(plan.t_o_max(slave, master.t_dp)),
        t_pll_w_us: us(times.t_pll_w),
        dead_time_us: us(dead_time(times.t_i, times.t_o, master.t_dp, master.t_mapc)),
    };
    SlaveData {
        address: slave.address.get(),
        device: slave.device.name.to_string(),
        t_s_tbit: slot.map_or(0, |slot| slot.t_s.0),
        t_sdr_tbit: slot.map_or(0, |slot| slot.t_sdr.0),
        t_r_tbit: slot.map_or(0, |slot| slot.t_r.0),
        t_td_both_us: span(|slot| slot.t_td_both),
        t_mc_us: us(slot.map_or(Span::ZERO, |slot| slot.t_mc(bus))),
        request_us: span(|slot| slot.request),
        reply_end_us: span(|slot| slot.reply_end),
        instants: scenario.is_clocked(slave).then(instants),
        set_prm: octets::hex(&prm.telegram),
        chk_cfg: octets::hex(&cfg.telegram),
    }
}

fn verdict(found: &Finding, all: &[Finding]) -> Verdict {
    Verdict {
        rule: found.rule.text,
        source: found.rule.source,
        weight: match found.rule.weight {
            Weight::Must => "must",
            Weight::Warning => "warning",
            Weight::Advice => "advice",
        },
        key: found.key.to_string(),
        symbol: found.symbol,
        value: found.value.into(),
        relation: found.relation.sign(),
        bound: found.bound.into(),
        terms: found.terms.clone(),
        holds: found.holds(),
        margin: found.margin_amount().map(Into::into),
        nearest: if found.holds() { None } else { nearest(found, all).map(Into::into) },
    }
}
