//! Rules of DP services in operation.

use super::{Facts, Findings};
use crate::study::plan::finding::{Key, Relation};
use crate::study::scenario::Fault;

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
