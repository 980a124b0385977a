//! Rules of DP services in operation.

use super::{Facts, Findings};
use crate::device::parameters::PARAMETERS;
use crate::device::tool::Work;
use crate::dp::ms2::TIMEOUT_UNIT;
use crate::study::plan::finding::{Amount, Key, Relation};
use crate::study::scenario::{Action, Class2, Fault, Scenario, Slave};
use crate::time::{Span, Tbit};
use crate::wire::Address;
use crate::wire::parameter::Format;

/// Shortest Data_Control_Time in cycles. Model: D5, its third is two cycles or more, since not every cycle has time to
/// tell the mode.
pub(in crate::study::plan) const LEAST_CONTROL_CYCLES: i64 = 6;

/// No slave is asked faster than it may be.
pub(super) fn slave_interval(facts: &Facts<'_>, found: &mut Findings) {
    let t_dp = facts.scenario.master.t_dp;
    for slave in facts.slaves() {
        let least = slave.min_slave_interval();
        let key = Key::slave(slave.address, "min_slave_interval");
        found.check(key, least, Relation::AtMost, ("T_DP", t_dp), || {
            Fault::new(format!("T_DP = {t_dp} is too short for slave {}", slave.address))
                .rule(format!(
                    "T_DP >= Min_Slave_Interval = {least} of every slave (GSD, Min_Slave_Intervall in 100 us)"
                ))
                .help(format!("the shortest is t_dp = \"{}\"", least.ceil_to(slave.device.dp_grid())))
        });
    }
}

/// The mode can be told often enough.
pub(super) fn data_control_time(facts: &Facts<'_>, found: &mut Findings) {
    let master = &facts.scenario.master;
    let least = master.t_dp * LEAST_CONTROL_CYCLES;
    let Some(time) = master.services.data_control_time else { return };
    let cycle = facts.scenario.cycle_symbol();
    let terms = format!("{LEAST_CONTROL_CYCLES} x {cycle}");
    found.check(Key::master("data_control_time"), time, Relation::AtLeast, (terms, least), || {
        Fault::new(format!("a Data_Control_Time of {time} is too short"))
            .rule(format!(
                "Data_Control_Time >= {LEAST_CONTROL_CYCLES} x {cycle} = {least}: the mode is told every third of it, and \
                 not in every cycle (Model: D5)"
            ))
            .help(format!("data_control_time = \"{least}\" or more"))
    });
}

/// Octets of the header of the parameter channel's requests and answers, and of the address of a parameter.
const HEAD: usize = 4;
const ADDRESS: usize = 6;
/// What a read asks for that wants all there is (C2_Max_Data_Len at most).
const ALL_OF_IT: usize = 240;

/// Octets of values in the parameter channel: format, number, the values and what makes their number even.
fn values(format: Format, count: usize) -> usize {
    2 + (format.size() * count).next_multiple_of(2)
}
/// The longer of a read request and its answer, as far as the parameter is known.
fn reading(pnu: u16, elements: u8) -> usize {
    let known = PARAMETERS.iter().find(|known| known.pnu == pnu);
    let answer = known.map_or(0, |known| HEAD + values(known.format, elements.max(1).into()));
    answer.max(HEAD + ADDRESS)
}

/// The longest data that `[master]` writes to and reads from this slave.
fn longest_of_class_1(scenario: &Scenario, slave: &Slave) -> Option<usize> {
    let events = scenario.events.iter().filter(|event| event.slaves.contains(&slave.address));
    let octets = events.filter_map(|event| match event.action {
        Action::ReadParameter { parameter, elements, .. } => Some(reading(parameter, elements)),
        Action::ChangeParameter { format, .. } => Some(HEAD + ADDRESS + values(format, 1)),
        _ => None,
    });
    octets.max()
}
/// The longest data that class 2 masters write to and read from this slave.
fn longest_of_class_2(scenario: &Scenario, slave: &Slave) -> Option<usize> {
    let jobs = scenario.class2.iter().flat_map(|class2| &class2.jobs).filter(|job| job.slaves.contains(&slave.address));
    let octets = jobs.flat_map(|job| &job.works).filter_map(|work| match work {
        Work::Parameter(address) => Some(reading(address.pnu, address.elements)),
        Work::ReadRecord(_, length) => Some(usize::from(*length)).filter(|&length| length != ALL_OF_IT),
        Work::WriteRecord(_, data) => Some(data.len()),
        Work::Read(_) => None,
    });
    octets.max()
}

/// No acyclic request and no answer to one is longer than the slave takes: it refuses what is.
pub(super) fn acyclic_lengths(facts: &Facts<'_>, found: &mut Findings) {
    for slave in facts.scenario.answering() {
        let device = &slave.device;
        for (class, longest, most) in [
            ("C1_Max_Data_Len", longest_of_class_1(facts.scenario, slave), device.c1.max_data),
            ("C2_Max_Data_Len", longest_of_class_2(facts.scenario, slave), device.c2.max_data),
        ] {
            let Some(octets) = longest else { continue };
            let key = Key::slave(slave.address, "device");
            found.check(key, octets as u32, Relation::AtMost, (class, u32::from(most)), || {
                Fault::new(format!("slave {} refuses an acyclic request or answer of {octets} octets", slave.address))
                    .rule(format!("records of {} have up to {most} octets (GSD: {class})", device.name))
                    .help("ask for fewer elements, or for a shorter record")
            });
            found.of("octets of the longest record", None);
        }
    }
}

/// The slaves of the jobs of a class 2 master, each once, and the shortest C2_Response_Timeout of those that it asks over
/// MS2; none if it asks nobody over MS2.
fn asked(scenario: &Scenario, class2: &Class2) -> Option<(usize, Span)> {
    let mut all: Vec<Address> = class2.jobs.iter().flat_map(|job| job.slaves.iter().copied()).collect();
    all.sort_unstable();
    all.dedup();
    let over_ms2 = class2.jobs.iter().filter(|job| job.works.iter().any(|work| !matches!(work, Work::Read(_))));
    let slaves = over_ms2.flat_map(|job| &job.slaves).filter_map(|&address| scenario.slave(address));
    let timeout = slaves.map(|slave| class2.response_timeout.unwrap_or(slave.device.c2.response_timeout)).min()?;
    Some((all.len(), timeout))
}

/// A class 2 master asks for an answer before it gives the request up. Model: slaves take turns, a message each; a request
/// and the first poll for its answer are as many messages apart as there are slaves with something to do, the token comes
/// once in a cycle, and T_TH has time for all messages of a visit. No shorter C2_Response_Timeout does where all are busy.
pub(super) fn class2_turns(facts: &Facts<'_>, found: &mut Findings) {
    let scenario = facts.scenario;
    for (number, class2) in (1..).zip(&scenario.class2) {
        let Some((slaves, timeout)) = asked(scenario, class2) else { continue };
        let visits = slaves.div_ceil(class2.per_token.into()) as i64;
        let (cycle, turn) = (scenario.cycle_symbol(), scenario.master.t_dp * visits);
        let enough = TIMEOUT_UNIT * (turn.div_floor(TIMEOUT_UNIT) + 1);
        let key = Key::class2(number, class2.address, "response_timeout");
        found.check(key, timeout, Relation::MoreThan, (format!("{visits} x {cycle}"), turn), || {
            Fault::new(format!(
                "the class 2 master {} may give a request up after {timeout}, before it has polled for the answer",
                class2.address
            ))
            .rule(format!(
                "C2_Response_Timeout > {visits} x {cycle} = {turn}: {slaves} slaves take turns, {} of them with each token \
                 (Model: all slaves busy)",
                class2.per_token
            ))
            .help(format!("response_timeout = \"{enough}\" or more, more messages per_token, or fewer slaves"))
        });
        found.of("C2_Response_Timeout", Some(Amount::Time(enough)));
    }
}

/// Whoever asks over MS2 does so with low priority, and so in T_TH alone, which is what T_TR leaves of a rotation. The
/// token comes to each station once in T_DP.
pub(super) fn class2_time(facts: &Facts<'_>, found: &mut Findings) {
    let (scenario, bus) = (facts.scenario, &facts.scenario.bus.params);
    let t_dp = scenario.master.t_dp;
    for class2 in scenario.class2.iter().filter(|class2| asked(scenario, class2).is_some()) {
        let bound = Tbit(t_dp.ceil_to(bus.rate.bit()).div_floor(bus.rate.bit()) as u32);
        found.check(Key::bus("t_tr"), bus.t_tr, Relation::MoreThan, ("T_DP", bound), || {
            Fault::new(format!(
                "T_TR = {} leaves the class 2 master {} no time for any request over MS2",
                bus.t_tr, class2.address
            ))
            .rule(format!("T_TR > T_DP = {bound}: T_TH = T_TR - T_RR, and the token takes T_DP (EN 50170-2)"))
            .help("a longer t_tr")
        });
    }
}
