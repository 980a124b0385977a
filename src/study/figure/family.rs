//! Families: what is counted or noted once in a run, of the network, a slave, a link, a master, a station or acyclic
//! services. Distributions are not among them; every quantity has its own.

use std::collections::BTreeMap;

use super::Figures;
use super::value::{Unit, Value};
use crate::observation::{AcyclicResult, MasterMode, Phase, PllState, SlaveState};
use crate::study::acyclic::ClassCounts;
use crate::study::count::{LinkCounts, Moment, Rotation, SlaveCounts};
use crate::study::episode::{Harm, SlaveEpisodes, Spread, Times};
use crate::study::histogram::Subject;
use crate::study::live_list::{CycleTimes, Station};
use crate::study::masters::MasterCounts;
use crate::study::steady::Begin;
use crate::time::Span;

/// What stands for the code of a fault in the name of a family.
pub const CODE: &str = "<code>";

/// A figure of every subject of one kind.
#[derive(Clone, Copy, Debug)]
pub struct Family {
    /// Its name, the end of a figure's; [`CODE`] stands for four hexadecimal digits of a fault.
    pub name: &'static str,
    /// The unit in which people read it.
    pub unit: Unit,
    /// What it is, for people.
    pub what: &'static str,
    /// Where its meaning comes from.
    pub source: &'static str,
    /// How it is made.
    pub of: Of,
}

/// Of what a family is, and how it is made of what was counted.
#[derive(Clone, Copy, Debug)]
pub enum Of {
    /// The whole network.
    Network(fn(&Figures) -> Option<Value>),
    /// The whole network, by the code of a fault.
    NetworkFault(fn(&Figures, u16) -> Option<Value>),
    /// A slave.
    Slave(fn(&SlaveCounts) -> Option<Value>),
    /// A slave, by the code of a fault.
    SlaveFault(fn(&SlaveCounts, u16) -> Option<Value>),
    /// A slave's episodes.
    Episodes(fn(&SlaveEpisodes) -> Option<Value>),
    /// A slave's episodes, by the code of a fault.
    EpisodesFault(fn(&SlaveEpisodes, u16) -> Option<Value>),
    /// Any station of the live list; slaves and masters have it too.
    Station(fn(&Station) -> Option<Value>),
    /// A master, where several share the token.
    Master(fn(&MasterCounts) -> Option<Value>),
    /// A link.
    Link(fn(&LinkCounts) -> Option<Value>),
    /// The acyclic services of one class of masters.
    Acyclic(fn(&ClassCounts) -> Option<Value>),
}

#[expect(clippy::unnecessary_wraps, reason = "the signature of a family's line")]
const fn count(count: u64) -> Option<Value> {
    Some(Value::Count(count))
}
#[expect(clippy::unnecessary_wraps, reason = "the signature of a family's line")]
const fn truth(truth: bool) -> Option<Value> {
    Some(Value::Truth(truth))
}
fn span(span: Option<Span>) -> Option<Value> {
    span.map(Value::Span)
}
fn instant(moment: Option<Moment>) -> Option<Value> {
    moment.map(|moment| Value::Span(moment.at.since_zero()))
}
/// The sum over all slaves.
fn sum(figures: &Figures, of: fn(&SlaveCounts) -> u64) -> Option<Value> {
    count(figures.counts.slaves.iter().map(of).sum())
}
/// The sum over all stations of the live list.
fn stations(figures: &Figures, of: fn(&Station) -> u64) -> Option<Value> {
    count(figures.counts.live_list.stations().map(|(_, station)| of(station)).sum())
}
fn cycle_time(times: &CycleTimes, of: fn(&CycleTimes) -> Span) -> Option<Value> {
    span((times.count > 0).then(|| of(times)))
}
fn rotation(rotation: &Rotation, of: fn(&Rotation) -> Span) -> Option<Value> {
    span((rotation.count > 0).then(|| of(rotation)))
}
fn in_operation(slave: &SlaveCounts) -> bool {
    slave.phase == Phase::Operation
}
fn share(slave: &SlaveCounts) -> Option<Value> {
    let all = slave.phases.iter().copied().sum::<Span>().ticks();
    (all > 0).then(|| Value::Share(slave.phases[Phase::Operation as usize].ticks() as f64 / all as f64))
}
#[expect(clippy::unnecessary_wraps, reason = "the signature of a family's line")]
fn in_phase(slave: &SlaveCounts, phase: Phase) -> Option<Value> {
    Some(Value::Span(slave.phases[phase as usize]))
}
fn steady(figures: &Figures, of: fn(Begin) -> Value) -> Option<Value> {
    figures.steady_state()?.begin().map(of)
}
fn last_change(figures: &Figures) -> Option<Value> {
    let slaves = figures.counts.slaves.iter().map(|slave| slave.last_change);
    instant(slaves.chain([figures.counts.network.last_mode]).max().flatten())
}
/// From a disturbance to a fault of any code.
fn to_fault(slave: &SlaveEpisodes) -> Spread {
    let faults = slave.to_harm.iter().filter(|(harm, _)| matches!(harm, Harm::Fault(_)));
    faults.fold(Spread::default(), |all, (_, times)| all.merged(*times))
}
/// From the end of full operation to the next, whatever ended it.
fn recovery(slave: &SlaveEpisodes) -> Spread {
    slave.recovery.values().fold(Spread::default(), |all, times| all.merged(*times))
}
/// The same of all slaves.
fn all(figures: &Figures, of: fn(&SlaveEpisodes) -> Spread) -> Spread {
    figures.episodes.slaves().iter().map(of).fold(Spread::default(), Spread::merged)
}
/// From a disturbance to a fault of this code.
fn to_code(slave: &SlaveEpisodes, code: u16) -> Spread {
    slave.to_harm.get(&Harm::Fault(code)).copied().unwrap_or_default()
}
/// The same of all slaves.
fn all_to_code(figures: &Figures, code: u16) -> Spread {
    figures.episodes.slaves().iter().map(|slave| to_code(slave, code)).fold(Spread::default(), Spread::merged)
}
/// What this share of the times of these kinds, of all slaves, does not exceed.
fn percentile(times: &BTreeMap<Harm, Times>, is: impl Fn(&Harm) -> bool, percent: f64) -> Option<Value> {
    let mut histograms = times.iter().filter(|(harm, _)| is(harm)).map(|(_, times)| times.histogram());
    let first = histograms.next()?;
    let Some(second) = histograms.next() else { return span(first.percentile(percent)) };
    let mut all = first.clone();
    [second].into_iter().chain(histograms).for_each(|more| all.merge(more));
    span(all.percentile(percent))
}
fn fault_percentile(figures: &Figures, percent: f64) -> Option<Value> {
    percentile(figures.episodes.to_harm(), |harm| matches!(harm, Harm::Fault(_)), percent)
}
fn code_percentile(figures: &Figures, code: u16, percent: f64) -> Option<Value> {
    percentile(figures.episodes.to_harm(), |harm| *harm == Harm::Fault(code), percent)
}
fn recovery_percentile(figures: &Figures, percent: f64) -> Option<Value> {
    percentile(figures.episodes.recovery(), |_| true, percent)
}
/// The one family that can be below zero: T_DP minus the longest T_DX.
pub(super) const LEFT: &str = "left_after_t_dx";
fn left(figures: &Figures) -> Option<Value> {
    let t_dx = figures.histograms.get("t_dx", Subject::Network)?.max()?;
    Some(Value::Span(figures.layout().t_dp - t_dx))
}

/// Every family. One line here is all that a new one needs.
#[rustfmt::skip]
pub const FAMILIES: &[Family] = &[
    Family { name: "cycles", unit: Unit::Count, what: "cycles that began", source: "Model: D1", of: Of::Network(|f| count(f.counts.network.cycles)) },
    Family { name: "duration", unit: Unit::S, what: "true length of the run", source: "run.duration", of: Of::Network(|f| Some(Value::Span(f.counts.network.duration))) },
    Family { name: "cycle_time.min", unit: Unit::Us, what: "shortest true time from one cycle start at the master to the next", source: "Model: D1", of: Of::Network(|f| cycle_time(&f.counts.network.cycle_times, |t| t.min)) },
    Family { name: "cycle_time.mean", unit: Unit::Us, what: "mean of the same, to the tick below", source: "Model: D1", of: Of::Network(|f| span(f.counts.network.cycle_times.mean())) },
    Family { name: "cycle_time.max", unit: Unit::Us, what: "longest of the same", source: "Model: D1", of: Of::Network(|f| cycle_time(&f.counts.network.cycle_times, |t| t.max)) },
    Family { name: LEFT, unit: Unit::Us, what: "T_DP minus the longest T_DX", source: "manual 3.3.2, Model: D2", of: Of::Network(left) },
    Family { name: "skew_steps.max", unit: Unit::Steps, what: "largest latch skew in steps of the slaves", source: "Model: D9", of: Of::Network(|f| f.counts.network.skew_counts.map(Value::Steps)) },
    Family { name: "faults", unit: Unit::Count, what: "faults that all slaves latched", source: "manual 5.3", of: Of::Network(|f| sum(f, SlaveCounts::fault_count)) },
    Family { name: "faults.<code>", unit: Unit::Count, what: "of these, the ones with this code", source: "manual 5.3", of: Of::NetworkFault(|f, code| count(f.counts.slaves.iter().map(|slave| slave.faults.get(&code).copied().unwrap_or(0)).sum())) },
    Family { name: "first_fault", unit: Unit::S, what: "when a slave latched the first fault", source: "manual 5.3", of: Of::Network(|f| instant(f.counts.slaves.iter().filter_map(|slave| slave.first_fault).min())) },
    Family { name: "last_fault", unit: Unit::S, what: "when a slave latched the last fault", source: "manual 5.3", of: Of::Network(|f| instant(f.counts.slaves.iter().filter_map(|slave| slave.last_fault).max())) },
    Family { name: "acknowledgements", unit: Unit::Count, what: "faults that were acknowledged", source: "manual 2.2, Model: D18", of: Of::Network(|f| sum(f, |slave| slave.acknowledgements)) },
    Family { name: "clock_failures", unit: Unit::Count, what: "clock failures of all slaves: SYNCH outside the window or missing", source: "Model: D11", of: Of::Network(|f| sum(f, |slave| slave.clock_failures)) },
    Family { name: "resynchronisations", unit: Unit::Count, what: "how often clock recoveries locked again", source: "Model: D12", of: Of::Network(|f| sum(f, |slave| slave.resynchronisations)) },
    Family { name: "in_operation", unit: Unit::Truth, what: "whether all slaves are in cyclic operation at the end", source: "manual 2.1.5", of: Of::Network(|f| truth(f.counts.slaves.iter().all(in_operation))) },
    Family { name: "last_state_change", unit: Unit::S, what: "when a DP state, start-up phase, clock recovery or a master's mode changed last", source: "manual 2.1", of: Of::Network(last_change) },
    Family { name: "steady_state.begin", unit: Unit::Ms, what: "when the steady state begins: every slave is locked and in cyclic operation", source: "manual 2.1, Model: D12, D16", of: Of::Network(|f| steady(f, |s| Value::Span(s.at.since_zero()))) },
    Family { name: "steady_state.begin_cycle", unit: Unit::Count, what: "cycles before it", source: "manual 2.1, Model: D12, D16", of: Of::Network(|f| steady(f, |s| Value::Count(s.cycle))) },
    Family { name: "steady_state.cycles", unit: Unit::Count, what: "cycles from then on", source: "manual 2.1, Model: D12, D16", of: Of::Network(|f| steady(f, |s| Value::Count(s.cycles))) },
    Family { name: "steady_state.faults", unit: Unit::Count, what: "faults that slaves latched in these", source: "manual 5.3", of: Of::Network(|f| steady(f, |s| Value::Count(s.faults))) },
    Family { name: "retries", unit: Unit::Count, what: "requests that the master repeated", source: "Model: D7", of: Of::Network(|f| count(f.counts.network.retries)) },
    Family { name: "no_answers", unit: Unit::Count, what: "requests without answer after all retries", source: "Model: D7", of: Of::Network(|f| count(f.counts.network.no_answers)) },
    Family { name: "diagnoses", unit: Unit::Count, what: "times that slaves asked for Slave_Diag during data exchange (DH)", source: "EN 50170-2", of: Of::Network(|f| count(f.counts.network.diagnoses)) },
    Family { name: "auto_clears", unit: Unit::Count, what: "times that the master went back to Clear on its own", source: "EN 50170-2", of: Of::Network(|f| count(f.counts.network.auto_clears)) },
    Family { name: "late_clocks", unit: Unit::Count, what: "SYNCHs that could not be sent when planned", source: "Model: D1", of: Of::Network(|f| count(f.counts.network.late_clocks)) },
    Family { name: "late_clock.max", unit: Unit::Us, what: "how late the latest SYNCH left", source: "Model: D1", of: Of::Network(|f| span((f.counts.network.late_clocks > 0).then_some(f.counts.network.latest_clock))) },
    Family { name: "missed_clocks", unit: Unit::Count, what: "SYNCHs left out because the token was away or the bus in use", source: "Model: D1", of: Of::Network(|f| count(f.counts.network.missed_clocks)) },
    Family { name: "tokens_claimed", unit: Unit::Count, what: "tokens claimed by the master after silence, the first one included", source: "EN 50170-2", of: Of::Network(|f| count(f.counts.network.tokens_claimed)) },
    Family { name: "rotation.count", unit: Unit::Count, what: "how often the token came round to the master", source: "EN 50170-2, T_RR", of: Of::Network(|f| count(f.counts.network.rotation.count)) },
    Family { name: "rotation.min", unit: Unit::Us, what: "shortest token rotation time", source: "EN 50170-2, T_RR", of: Of::Network(|f| rotation(&f.counts.network.rotation, |r| r.min)) },
    Family { name: "rotation.mean", unit: Unit::Us, what: "mean token rotation time", source: "EN 50170-2, T_RR", of: Of::Network(|f| span(f.counts.network.rotation.mean())) },
    Family { name: "rotation.max", unit: Unit::Us, what: "longest token rotation time", source: "EN 50170-2, T_RR", of: Of::Network(|f| rotation(&f.counts.network.rotation, |r| r.max)) },
    Family { name: "collisions", unit: Unit::Count, what: "telegrams that overlapped with another one", source: "Model: D4", of: Of::Network(|f| count(f.counts.network.collisions)) },
    Family { name: "disturbed", unit: Unit::Count, what: "telegrams that the scenario disturbed", source: "disturbance", of: Of::Network(|f| count(f.counts.network.disturbed)) },
    Family { name: "events", unit: Unit::Count, what: "rows of events.csv", source: "events.csv", of: Of::Network(|f| count(f.counts.network.events)) },
    Family { name: "lost", unit: Unit::Count, what: "how often stations left data exchange or the ring against their master's will", source: "live list", of: Of::Network(|f| stations(f, |station| station.lost)) },
    Family { name: "syncs", unit: Unit::Count, what: "how often slaves were brought into data exchange", source: "live list", of: Of::Network(|f| stations(f, |station| station.syncs)) },
    Family { name: "repeats", unit: Unit::Count, what: "requests and tokens that any master repeated", source: "live list", of: Of::Network(|f| stations(f, |station| station.repeats)) },
    Family { name: "illegal_responses", unit: Unit::Count, what: "answers that do not fit their request", source: "live list", of: Of::Network(|f| stations(f, |station| station.illegal)) },
    Family { name: "time_to_fault.count", unit: Unit::Count, what: "how many times from a disturbance to a fault there are, all slaves", source: "Model: episodes", of: Of::Network(|f| count(all(f, to_fault).count)) },
    Family { name: "time_to_fault.min", unit: Unit::Ms, what: "shortest of the times from a disturbance to a fault, all slaves", source: "Model: episodes", of: Of::Network(|f| span(all(f, to_fault).min())) },
    Family { name: "time_to_fault.mean", unit: Unit::Ms, what: "mean of the times from a disturbance to a fault, to the tick below, all slaves", source: "Model: episodes", of: Of::Network(|f| span(all(f, to_fault).mean())) },
    Family { name: "time_to_fault.p50", unit: Unit::Ms, what: "what 50 % of the times from a disturbance to a fault do not exceed, three significant digits, all slaves", source: "Model: episodes", of: Of::Network(|f| fault_percentile(f, 50.0)) },
    Family { name: "time_to_fault.p90", unit: Unit::Ms, what: "what 90 % of them do not exceed", source: "Model: episodes", of: Of::Network(|f| fault_percentile(f, 90.0)) },
    Family { name: "time_to_fault.p99", unit: Unit::Ms, what: "what 99 % of them do not exceed", source: "Model: episodes", of: Of::Network(|f| fault_percentile(f, 99.0)) },
    Family { name: "time_to_fault.max", unit: Unit::Ms, what: "longest of the times from a disturbance to a fault, all slaves", source: "Model: episodes", of: Of::Network(|f| span(all(f, to_fault).max())) },
    Family { name: "time_to_fault.<code>.count", unit: Unit::Count, what: "how many times from a disturbance to a fault with this code there are, all slaves", source: "Model: episodes", of: Of::NetworkFault(|f, code| count(all_to_code(f, code).count)) },
    Family { name: "time_to_fault.<code>.min", unit: Unit::Ms, what: "shortest of them", source: "Model: episodes", of: Of::NetworkFault(|f, code| span(all_to_code(f, code).min())) },
    Family { name: "time_to_fault.<code>.mean", unit: Unit::Ms, what: "mean of them, to the tick below", source: "Model: episodes", of: Of::NetworkFault(|f, code| span(all_to_code(f, code).mean())) },
    Family { name: "time_to_fault.<code>.p50", unit: Unit::Ms, what: "what 50 % of them do not exceed, three significant digits", source: "Model: episodes", of: Of::NetworkFault(|f, code| code_percentile(f, code, 50.0)) },
    Family { name: "time_to_fault.<code>.p90", unit: Unit::Ms, what: "what 90 % of them do not exceed", source: "Model: episodes", of: Of::NetworkFault(|f, code| code_percentile(f, code, 90.0)) },
    Family { name: "time_to_fault.<code>.p99", unit: Unit::Ms, what: "what 99 % of them do not exceed", source: "Model: episodes", of: Of::NetworkFault(|f, code| code_percentile(f, code, 99.0)) },
    Family { name: "time_to_fault.<code>.max", unit: Unit::Ms, what: "longest of them", source: "Model: episodes", of: Of::NetworkFault(|f, code| span(all_to_code(f, code).max())) },
    Family { name: "recovery.count", unit: Unit::Count, what: "how many times from the end of full operation to the next there are, all slaves", source: "manual 2.1.5, Model: episodes", of: Of::Network(|f| count(all(f, recovery).count)) },
    Family { name: "recovery.min", unit: Unit::Ms, what: "shortest of the times from the end of full operation to the next, all slaves", source: "manual 2.1.5, Model: episodes", of: Of::Network(|f| span(all(f, recovery).min())) },
    Family { name: "recovery.mean", unit: Unit::Ms, what: "mean of the times from the end of full operation to the next, to the tick below, all slaves", source: "manual 2.1.5, Model: episodes", of: Of::Network(|f| span(all(f, recovery).mean())) },
    Family { name: "recovery.p50", unit: Unit::Ms, what: "what 50 % of the times from the end of full operation to the next do not exceed, three significant digits, all slaves", source: "manual 2.1.5, Model: episodes", of: Of::Network(|f| recovery_percentile(f, 50.0)) },
    Family { name: "recovery.p90", unit: Unit::Ms, what: "what 90 % of them do not exceed", source: "manual 2.1.5, Model: episodes", of: Of::Network(|f| recovery_percentile(f, 90.0)) },
    Family { name: "recovery.p99", unit: Unit::Ms, what: "what 99 % of them do not exceed", source: "manual 2.1.5, Model: episodes", of: Of::Network(|f| recovery_percentile(f, 99.0)) },
    Family { name: "recovery.max", unit: Unit::Ms, what: "longest of the times from the end of full operation to the next, all slaves", source: "manual 2.1.5, Model: episodes", of: Of::Network(|f| span(all(f, recovery).max())) },
    Family { name: "losses", unit: Unit::Count, what: "how often slaves lost full operation", source: "manual 2.1.5, Model: episodes", of: Of::Network(|f| count(f.episodes.slaves().iter().map(|slave| slave.losses).sum())) },
    Family { name: "unrecovered", unit: Unit::Count, what: "slaves that lost full operation and are without it at the end", source: "manual 2.1.5, Model: episodes", of: Of::Network(|f| count(f.episodes.slaves().iter().filter(|slave| slave.lasting.is_some()).count() as u64)) },

    Family { name: "in_operation", unit: Unit::Truth, what: "whether it is in cyclic operation at the end", source: "manual 2.1.5", of: Of::Slave(|s| truth(in_operation(s))) },
    Family { name: "exchanging", unit: Unit::Truth, what: "whether it is in DATA_EXCH at the end", source: "EN 50170-2", of: Of::Slave(|s| truth(s.state == SlaveState::DataExch)) },
    Family { name: "locked", unit: Unit::Truth, what: "whether its clock recovery is locked at the end", source: "Model: D12", of: Of::Slave(|s| truth(s.pll == PllState::Locked)) },
    Family { name: "lock_time", unit: Unit::Ms, what: "from the first SYNCH that its clock recovery took to the first lock", source: "manual 2.1.2, Model: D12", of: Of::Slave(|s| span(s.lock.map(|lock| lock.span))) },
    Family { name: "lock_cycles", unit: Unit::Count, what: "cycles that began in between", source: "manual 2.1.2, Model: D12", of: Of::Slave(|s| s.lock.map(|lock| Value::Count(lock.cycles))) },
    Family { name: "first_operation", unit: Unit::S, what: "when it first reached cyclic operation", source: "manual 2.1.5", of: Of::Slave(|s| instant(s.first_operation)) },
    Family { name: "operation_share", unit: Unit::Share, what: "part of the run that it spent in cyclic operation", source: "manual 2.1.5", of: Of::Slave(share) },
    Family { name: "phase_time.configuration", unit: Unit::Ms, what: "time in phase 1, parameters and configuration", source: "manual 2.1.1", of: Of::Slave(|s| in_phase(s, Phase::Configuration)) },
    Family { name: "phase_time.clock", unit: Unit::Ms, what: "time in phase 2, synchronising to the clock", source: "manual 2.1.2", of: Of::Slave(|s| in_phase(s, Phase::Clock)) },
    Family { name: "phase_time.master_life", unit: Unit::Ms, what: "time in phase 3, synchronising to the master's sign of life", source: "manual 2.1.3", of: Of::Slave(|s| in_phase(s, Phase::MasterLife)) },
    Family { name: "phase_time.slave_life", unit: Unit::Ms, what: "time in phase 4, the master synchronises to the slave's sign of life", source: "manual 2.1.4", of: Of::Slave(|s| in_phase(s, Phase::SlaveLife)) },
    Family { name: "phase_time.operation", unit: Unit::Ms, what: "time in phase 5, cyclic operation", source: "manual 2.1.5", of: Of::Slave(|s| in_phase(s, Phase::Operation)) },
    Family { name: "last_state_change", unit: Unit::S, what: "when its DP state, start-up phase or clock recovery changed last", source: "manual 2.1", of: Of::Slave(|s| instant(s.last_change)) },
    Family { name: "faults", unit: Unit::Count, what: "faults that it latched", source: "manual 5.3", of: Of::Slave(|s| count(s.fault_count())) },
    Family { name: "faults.<code>", unit: Unit::Count, what: "of these, the ones with this code", source: "manual 5.3", of: Of::SlaveFault(|s, code| count(s.faults.get(&code).copied().unwrap_or(0))) },
    Family { name: "first_fault", unit: Unit::S, what: "when it latched the first fault", source: "manual 5.3", of: Of::Slave(|s| instant(s.first_fault)) },
    Family { name: "last_fault", unit: Unit::S, what: "when it latched the last fault", source: "manual 5.3", of: Of::Slave(|s| instant(s.last_fault)) },
    Family { name: "acknowledgements", unit: Unit::Count, what: "faults that were acknowledged", source: "manual 2.2, Model: D18", of: Of::Slave(|s| count(s.acknowledgements)) },
    Family { name: "clock_failures", unit: Unit::Count, what: "clock failures: SYNCH outside the window or missing", source: "Model: D11", of: Of::Slave(|s| count(s.clock_failures)) },
    Family { name: "resynchronisations", unit: Unit::Count, what: "how often its clock recovery locked again", source: "Model: D12", of: Of::Slave(|s| count(s.resynchronisations)) },
    Family { name: "retries", unit: Unit::Count, what: "requests to it that the master repeated", source: "Model: D7", of: Of::Slave(|s| count(s.retries)) },
    Family { name: "no_answers", unit: Unit::Count, what: "requests to it without answer after all retries", source: "Model: D7", of: Of::Slave(|s| count(s.no_answers)) },
    Family { name: "diagnoses", unit: Unit::Count, what: "times that it asked for Slave_Diag during data exchange (DH)", source: "EN 50170-2", of: Of::Slave(|s| count(s.diagnoses)) },
    Family { name: "time_to_fault.count", unit: Unit::Count, what: "how many times from a disturbance to a fault there are", source: "Model: episodes", of: Of::Episodes(|s| count(to_fault(s).count)) },
    Family { name: "time_to_fault.min", unit: Unit::Ms, what: "shortest of the times from a disturbance to a fault", source: "Model: episodes", of: Of::Episodes(|s| span(to_fault(s).min())) },
    Family { name: "time_to_fault.mean", unit: Unit::Ms, what: "mean of the times from a disturbance to a fault, to the tick below", source: "Model: episodes", of: Of::Episodes(|s| span(to_fault(s).mean())) },
    Family { name: "time_to_fault.max", unit: Unit::Ms, what: "longest of the times from a disturbance to a fault", source: "Model: episodes", of: Of::Episodes(|s| span(to_fault(s).max())) },
    Family { name: "time_to_fault.<code>.count", unit: Unit::Count, what: "how many times from a disturbance to a fault with this code there are", source: "Model: episodes", of: Of::EpisodesFault(|s, code| count(to_code(s, code).count)) },
    Family { name: "time_to_fault.<code>.min", unit: Unit::Ms, what: "shortest of them", source: "Model: episodes", of: Of::EpisodesFault(|s, code| span(to_code(s, code).min())) },
    Family { name: "time_to_fault.<code>.mean", unit: Unit::Ms, what: "mean of them, to the tick below", source: "Model: episodes", of: Of::EpisodesFault(|s, code| span(to_code(s, code).mean())) },
    Family { name: "time_to_fault.<code>.max", unit: Unit::Ms, what: "longest of them", source: "Model: episodes", of: Of::EpisodesFault(|s, code| span(to_code(s, code).max())) },
    Family { name: "recovery.count", unit: Unit::Count, what: "how many times from the end of full operation to the next there are", source: "manual 2.1.5, Model: episodes", of: Of::Episodes(|s| count(recovery(s).count)) },
    Family { name: "recovery.min", unit: Unit::Ms, what: "shortest of the times from the end of full operation to the next", source: "manual 2.1.5, Model: episodes", of: Of::Episodes(|s| span(recovery(s).min())) },
    Family { name: "recovery.mean", unit: Unit::Ms, what: "mean of the times from the end of full operation to the next, to the tick below", source: "manual 2.1.5, Model: episodes", of: Of::Episodes(|s| span(recovery(s).mean())) },
    Family { name: "recovery.max", unit: Unit::Ms, what: "longest of the times from the end of full operation to the next", source: "manual 2.1.5, Model: episodes", of: Of::Episodes(|s| span(recovery(s).max())) },
    Family { name: "losses", unit: Unit::Count, what: "how often it lost full operation", source: "manual 2.1.5, Model: episodes", of: Of::Episodes(|s| count(s.losses)) },

    Family { name: "lost", unit: Unit::Count, what: "how often it left data exchange, or as master the ring, against its master's will", source: "live list", of: Of::Station(|s| count(s.lost)) },
    Family { name: "syncs", unit: Unit::Count, what: "how often it was brought into data exchange", source: "live list", of: Of::Station(|s| count(s.syncs)) },
    Family { name: "repeats", unit: Unit::Count, what: "requests and tokens to it that any master repeated", source: "live list", of: Of::Station(|s| count(s.repeats)) },
    Family { name: "repeats_per_cycle.max", unit: Unit::Count, what: "most of them in one cycle", source: "live list", of: Of::Station(|s| count(s.most_repeats)) },
    Family { name: "illegal_responses", unit: Unit::Count, what: "answers that do not fit their request", source: "live list", of: Of::Station(|s| count(s.illegal)) },
    Family { name: "diagnoses_read", unit: Unit::Count, what: "diagnoses that any master read from it", source: "live list", of: Of::Station(|s| count(s.diagnoses)) },

    Family { name: "operate", unit: Unit::Truth, what: "whether it is in Operate at the end", source: "EN 50170-2", of: Of::Master(|m| truth(m.mode == MasterMode::Operate)) },
    Family { name: "cycle_time.min", unit: Unit::Us, what: "its shortest cycle", source: "Model: D1", of: Of::Master(|m| cycle_time(&m.cycle_times, |t| t.min)) },
    Family { name: "cycle_time.mean", unit: Unit::Us, what: "its mean cycle", source: "Model: D1", of: Of::Master(|m| span(m.cycle_times.mean())) },
    Family { name: "cycle_time.max", unit: Unit::Us, what: "its longest cycle", source: "Model: D1", of: Of::Master(|m| cycle_time(&m.cycle_times, |t| t.max)) },
    Family { name: "t_dx.max", unit: Unit::Us, what: "its longest T_DX", source: "Model: D2", of: Of::Master(|m| span(m.t_dx_max)) },
    Family { name: "token_visits", unit: Unit::Count, what: "how often it got the token", source: "EN 50170-2", of: Of::Master(|m| count(m.visits)) },
    Family { name: "tokens_claimed", unit: Unit::Count, what: "how often it claimed the token after silence", source: "EN 50170-2", of: Of::Master(|m| count(m.claims)) },
    Family { name: "rotation.min", unit: Unit::Us, what: "its shortest token rotation time", source: "EN 50170-2, T_RR", of: Of::Master(|m| rotation(&m.rotation, |r| r.min)) },
    Family { name: "rotation.mean", unit: Unit::Us, what: "its mean token rotation time", source: "EN 50170-2, T_RR", of: Of::Master(|m| span(m.rotation.mean())) },
    Family { name: "rotation.max", unit: Unit::Us, what: "its longest token rotation time", source: "EN 50170-2, T_RR", of: Of::Master(|m| rotation(&m.rotation, |r| r.max)) },

    Family { name: "valid", unit: Unit::Count, what: "valid receptions", source: "Model: D27", of: Of::Link(|l| count(l.valid)) },
    Family { name: "lost", unit: Unit::Count, what: "how often nothing came for the watchdog time", source: "Model: D27", of: Of::Link(|l| count(l.lost)) },
    Family { name: "length_errors", unit: Unit::Count, what: "data of another length than parameterised", source: "Model: D27", of: Of::Link(|l| count(l.length_errors)) },
    Family { name: "gap.max", unit: Unit::Ms, what: "longest true time between two valid receptions", source: "Model: D27", of: Of::Link(|l| span(l.longest_gap)) },

    Family { name: "requests", unit: Unit::Count, what: "acyclic services that are over", source: "EN 50170-2, DP-V1", of: Of::Acyclic(|a| count(a.requests())) },
    Family { name: "positive", unit: Unit::Count, what: "of these, answered positively", source: "EN 50170-2, DP-V1", of: Of::Acyclic(|a| count(a.ended(AcyclicResult::Positive))) },
    Family { name: "negative", unit: Unit::Count, what: "of these, answered negatively", source: "EN 50170-2, DP-V1", of: Of::Acyclic(|a| count(a.ended(AcyclicResult::Negative))) },
    Family { name: "timeouts", unit: Unit::Count, what: "of these, without answer in time", source: "EN 50170-2, DP-V1", of: Of::Acyclic(|a| count(a.ended(AcyclicResult::Timeout))) },
    Family { name: "connection_lost", unit: Unit::Count, what: "of these, ended by their connection", source: "EN 50170-2, DP-V1", of: Of::Acyclic(|a| count(a.ended(AcyclicResult::Broken))) },
    Family { name: "response.min", unit: Unit::Us, what: "shortest response time", source: "EN 50170-2, DP-V1", of: Of::Acyclic(|a| span(a.min())) },
    Family { name: "response.mean", unit: Unit::Us, what: "mean response time, to the tick below", source: "EN 50170-2, DP-V1", of: Of::Acyclic(|a| span(a.mean())) },
    Family { name: "response.max", unit: Unit::Us, what: "longest response time", source: "EN 50170-2, DP-V1", of: Of::Acyclic(|a| span(a.max())) },
];
