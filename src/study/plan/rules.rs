//! Rules: the registry of every rule between the times of a network, each with its source and its numbers.
//!
//! One rule is one function and one line here. Reading a scenario for a run refuses what breaks a rule of weight
//! [`Weight::Must`], with the text that the rule has for it; the planner shows all of them, kept or broken.

mod advice;
mod bus;
mod cycle;
mod instants;
pub(super) mod services;

pub(in crate::study) use cycle::coarse_watchdog;

use super::Plan;
use super::finding::{Amount, Finding, Key, Relation};
use crate::device::profile::Profile;
use crate::dp::master::Pace;
use crate::sim::jitter::GcJitter;
use crate::study::scenario::{Fault, Scenario, Slave};
use crate::time::Span;

/// What breaking a rule means.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Weight {
    /// Such a network does not run.
    Must,
    /// It runs, and the run says so.
    Warning,
    /// It runs; the planner says so.
    Advice,
}

/// A rule.
#[derive(Debug)]
pub struct Rule {
    /// The rule in symbols.
    pub text: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// What breaking it means.
    pub weight: Weight,
    /// Keys that may be to blame instead, where the file does not have the key.
    pub instead: &'static [&'static str],
    /// Whether it is about isochronous mode, and not asked of a master without SYNCH.
    clocked: bool,
    judge: fn(&Facts<'_>, &mut Findings),
}

impl Rule {
    const fn must(text: &'static str, source: &'static str, judge: fn(&Facts<'_>, &mut Findings)) -> Self {
        Self { text, source, weight: Weight::Must, instead: &[], clocked: false, judge }
    }
    const fn advice(text: &'static str, source: &'static str, judge: fn(&Facts<'_>, &mut Findings)) -> Self {
        Self { weight: Weight::Advice, ..Self::must(text, source, judge) }
    }
    const fn warning(text: &'static str, source: &'static str, judge: fn(&Facts<'_>, &mut Findings)) -> Self {
        Self { weight: Weight::Warning, ..Self::must(text, source, judge) }
    }
    const fn clocked(self) -> Self {
        Self { clocked: true, ..self }
    }
    const fn or(self, instead: &'static [&'static str]) -> Self {
        Self { instead, ..self }
    }
    /// What this rule finds in a network.
    pub fn findings(&'static self, facts: &Facts<'_>) -> Vec<Finding> {
        let mut found = Findings { rule: self, all: Vec::new() };
        if !self.clocked || facts.scenario.master.pace == Pace::Synch {
            (self.judge)(facts, &mut found);
        }
        found.all
    }
}

/// The bus parameters and what slaves need of them.
pub static BUS: &[Rule] = &[
    Rule::must("every bus parameter within the range that the others leave", "EN 50170-2", bus::parameters)
        .or(&["bus.cable", "bus.rate"]),
    Rule::must("HSA >= every address", "EN 50170-2", bus::addresses),
    Rule::must("max T_SDR >= MaxTsdr of every slave", "Model: D2", bus::device_max_tsdr).or(&["bus.rate"]),
    Rule::must("min T_SDR <= T_SDR <= MaxTsdr", "Model: D2", bus::own_t_sdr),
    Rule::must("T_ID1 <= 255, a publisher's min_TSDR", "Set_Prm octet 4, Model: D27", bus::publisher_min_tsdr)
        .or(&["bus.t_qui", "link.1.publisher"]),
];
/// The bus cycle.
pub static CYCLE: &[Rule] = &[
    Rule::must("TDP_MIN <= T_DP <= TDP_MAX", "manual 3.3.2", cycle::t_dp_limits).clocked(),
    Rule::must("500 us <= T_DP <= 32 ms", "Set_Prm block 04", cycle::t_dp_system).clocked(),
    Rule::must("T_DP = n x T_BASE_DP", "manual 3.3.1, 3.3.2", cycle::t_dp_grid).clocked(),
    Rule::must("T_DP >= T_DX + GAP + token + visits + SYNCH", "manual 3.3.2", cycle::t_dp_content).clocked(),
    Rule::must("T_DX < T_DP", "manual 3.3.2", cycle::t_dx_ends).clocked(),
    Rule::must("T_BASE_DP, T_BASE_IO are time bases", "Set_Prm block 04", cycle::time_bases).clocked(),
    Rule::must("1 <= T_MAPC <= 14 (T_DP)", "manual 3.3.3, octet 43", cycle::t_mapc),
    Rule::must("watchdog > T_DP", "Model: an exchange a cycle", cycle::watchdog_outlasts_t_dp).or(&["master.t_dp"]),
    Rule::must("watchdog = WD_Base x WD_Fact_1 x WD_Fact_2", "Set_Prm octets 2, 3, 8", cycle::watchdog_factors),
];
/// DP services in operation.
pub static SERVICES: &[Rule] = &[
    Rule::must("Min_Slave_Interval <= T_DP", "GSD, Min_Slave_Intervall", services::slave_interval)
        .clocked()
        .or(&["master.t_dp"]),
    Rule::must("Data_Control_Time >= 6 x T_DP", "Model: D5", services::data_control_time),
];
/// Acyclic services.
pub static ACYCLIC: &[Rule] = &[
    Rule::warning("octets of a record <= C1_Max_Data_Len, C2_Max_Data_Len", "GSD", services::acyclic_lengths),
    Rule::warning("C2_Response_Timeout > n x T_DP", "Model: all slaves busy", services::class2_turns),
    Rule::warning("T_TR > T_DP where MS2 is used", "EN 50170-2", services::class2_time).clocked(),
];
/// T_I, T_O and the window of every slave.
pub static INSTANTS: &[Rule] = &[
    Rule::must("T_I = n x T_BASE_IO", "manual 3.3.4, 3.3.5", instants::t_i_grid).clocked(),
    Rule::must("T_O = n x T_BASE_IO", "manual 3.3.4, 3.3.6", instants::t_o_grid).clocked(),
    Rule::must("T_I >= TI_MIN", "manual 3.2.2, 3.3.5", instants::t_i_minimum).clocked(),
    Rule::must("T_O > T_DX + T_O_MIN", "manual 3.3.6, Model: D3", instants::t_o_minimum).clocked(),
    Rule::must("(T_DP - T_I) - T_O >= gap", "manual 3.3.5, 3.3.6, Model: D3", instants::t_o_maximum).clocked(),
    Rule::must("T_O < T_DP", "manual 3.3.6, Model: D3", instants::t_o_within).clocked(),
    Rule::must("T_I < T_DP", "manual 3.3.5", instants::t_i_within).clocked(),
    Rule::must("1/12 us <= T_PLL_W <= T_PLL_W_MAX", "manual 3.3.8", instants::window).clocked(),
    Rule::must("T_PLL_D + window < T_I", "manual 3.3.9, Model: D13", instants::delay).clocked(),
    Rule::must("narrowest window <= T_DP / 4", "Model: D12", instants::least_window).clocked(),
];
/// The timers of every slave.
pub static TIMERS: &[Rule] =
    &[Rule::must("timer step <= window in force", "manual 3.3.8, Model: D14", instants::quantum).clocked()];
/// The master's jitter.
pub static JITTER: &[Rule] = &[Rule::must("jitter fits into the spare time", "Model: D1, D6", cycle::jitter_fits)
    .or(&["master.t_dp"])
    .clocked()];
/// The start-up of slaves.
pub static START_UP: &[Rule] =
    &[Rule::must("T_DP holds the start-up of a slave", "manual 3.3.2, Model: D6", cycle::start_up).clocked()];
/// What a network should keep.
pub static ADVICE: &[Rule] = &[
    Rule::warning("bit rate >= 1.5 Mbit/s", "SIMODRIVE 611 universal manual", advice::isochronous_rate).clocked(),
    Rule::advice("T_PLL_W >= the device's narrowest", "manual 3.3.8", advice::window_is_taken).clocked(),
    Rule::advice("T_PLL_W >= 2 x jitter of SYNCH", "Model: D1, D11", advice::jitter_within_window).clocked(),
    Rule::advice("revolutions x units = n x total range", "Model: D22", advice::seamless).clocked(),
    Rule::advice("T_DP holds a repeated Data_Exchange", "Model: D7", advice::repeats_fit).clocked(),
    Rule::advice("T_TR >= n (T_TC + T_MC) + k T_MC", "felser.ch, token_umlaufzeit", advice::rotation),
    Rule::advice("T_DP holds the longest visits of the token", "EN 50170-2, Model: D6", advice::token_in_time)
        .clocked(),
    Rule::advice("T_DP - T_DX >= 2 x T_BASE_IO of a drive", "SINAMICS A01902", advice::drive_cycles).clocked(),
    Rule::advice("T_DP >= T_I + T_O + T_BASE_IO of a drive", "SINAMICS A01902", advice::drive_instants).clocked(),
];

/// Every rule.
pub static ALL: &[&[Rule]] = &[BUS, CYCLE, SERVICES, INSTANTS, TIMERS, JITTER, START_UP, ACYCLIC, ADVICE];

/// What the rules look at.
#[derive(Clone, Debug)]
pub struct Facts<'a> {
    /// The network.
    pub scenario: &'a Scenario,
    /// Its cycle at the longest.
    pub plan: Plan,
}

impl<'a> Facts<'a> {
    /// The facts of a network.
    pub fn of(scenario: &'a Scenario) -> Self {
        Self { scenario, plan: Plan::of(scenario) }
    }
    /// What all rules find, in the order of the registry.
    pub fn findings(&self) -> Vec<Finding> {
        ALL.iter().copied().flatten().flat_map(|rule| rule.findings(self)).collect()
    }
    fn slaves(&self) -> impl Iterator<Item = &'a Slave> {
        self.scenario.configured()
    }
    /// Those of them that are clocked.
    fn clocked(&self) -> impl Iterator<Item = &'a Slave> {
        self.slaves().filter(|slave| self.scenario.is_clocked(slave))
    }
    /// The devices of clocked slaves in the order of their first slaves.
    fn devices(&self) -> Vec<&'a Profile> {
        let mut devices: Vec<&'a Profile> = Vec::new();
        for slave in self.clocked() {
            if devices.iter().all(|known| **known != *slave.device) {
                devices.push(&slave.device);
            }
        }
        devices
    }
}

/// What a run of `scenario` has to tell: what its wiring should not have, and broken rules of weight [`Weight::Warning`]; a
/// sentence each.
pub fn warnings(scenario: &Scenario) -> Vec<String> {
    let facts = Facts::of(scenario);
    let rules = ALL.iter().copied().flatten().filter(|rule| rule.weight == Weight::Warning);
    let broken = rules.flat_map(|rule| rule.findings(&facts)).filter_map(|found| found.fault);
    scenario.wiring_warnings().into_iter().chain(broken.map(|fault| sentence(&fault))).collect()
}

/// A fault in one line.
pub fn sentence(fault: &Fault) -> String {
    let parts = [&fault.message, &fault.rule, &fault.help];
    parts.into_iter().filter(|part| !part.is_empty()).map(String::as_str).collect::<Vec<_>>().join("; ")
}

/// Takes what one rule finds.
#[derive(Debug)]
pub struct Findings {
    rule: &'static Rule,
    all: Vec<Finding>,
}

impl Findings {
    /// The value of `key` compared with a bound, given in symbols and as a number; `fault` says what is wrong if it is.
    fn check(
        &mut self,
        key: Key,
        value: impl Into<Amount>,
        relation: Relation,
        (terms, bound): (impl Into<String>, impl Into<Amount>),
        fault: impl FnOnce() -> Fault,
    ) {
        self.silent(key, value, relation, (terms, bound));
        if let Some(last) = self.all.last_mut().filter(|last| !last.holds()) {
            last.fault = Some(fault());
        }
    }
    /// The same where another rule says what is wrong.
    fn silent(
        &mut self,
        key: Key,
        value: impl Into<Amount>,
        relation: Relation,
        (terms, bound): (impl Into<String>, impl Into<Amount>),
    ) {
        let (terms, value, bound) = (terms.into(), value.into(), bound.into());
        let (rule, symbol) = (self.rule, symbol(key.name));
        self.all.push(Finding {
            rule,
            key,
            symbol,
            value,
            relation,
            terms,
            bound,
            follows: false,
            advised: None,
            fault: None,
        });
    }
    /// The finding just made is about `symbol`, which follows from the key's value; `advised` would do for the key.
    fn of(&mut self, symbol: &'static str, advised: Option<Amount>) {
        if let Some(last) = self.all.last_mut() {
            (last.symbol, last.follows) = (symbol, true);
            last.advised = advised.filter(|_| !last.holds());
        }
    }
}

/// The standard's symbol for a key.
pub fn symbol(key: &'static str) -> &'static str {
    const SYMBOLS: &[(&str, &str)] = &[
        ("t_set", "T_SET"),
        ("t_qui", "T_QUI"),
        ("min_tsdr", "min T_SDR"),
        ("max_tsdr", "max T_SDR"),
        ("t_sl", "T_SL"),
        ("gap_factor", "G"),
        ("hsa", "HSA"),
        ("rate", "bit rate"),
        ("t_sdr", "T_SDR"),
        ("t_dp", "T_DP"),
        ("t_mapc", "T_MAPC"),
        ("gc_jitter", "jitter"),
        ("t_i", "T_I"),
        ("t_o", "T_O"),
        ("t_pll_w", "T_PLL_W"),
        ("t_pll_d", "T_PLL_D"),
        ("t_tr", "T_TR"),
        ("min_slave_interval", "Min_Slave_Interval"),
        ("data_control_time", "Data_Control_Time"),
        ("response_timeout", "C2_Response_Timeout"),
        ("pll.min_window", "narrowest window"),
        ("pll.quantum", "timer step"),
    ];
    SYMBOLS.iter().find(|row| row.0 == key).map_or(key, |row| row.1)
}

/// How far one SYNCH may stray, and how that is known; none without jitter (Model: D1).
pub(super) fn stray(jitter: &GcJitter) -> Option<(Span, &'static str)> {
    match (jitter.bound(), jitter) {
        (Some(Span::ZERO), _) => None,
        (Some(bound), _) => Some((bound, "its bound")),
        (None, GcJitter::Normal { sigma }) => Some((*sigma * 6, "six times sigma")),
        (None, _) => None,
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
    let shortest = facts.clocked().map(needed).max().unwrap_or_default();
    format!("the shortest is t_dp = \"{shortest}\"")
}

/// The two points of `grid` around `span`, as help.
fn neighbours(key: &str, span: Span, grid: Span) -> String {
    let below = grid * span.div_floor(grid);
    format!("the neighbours are {key} = \"{below}\" and \"{}\"", below + grid)
}

/// `span` as a scenario can have it, exactly.
pub fn written(span: Span) -> String {
    let shown = span.to_string();
    if crate::study::quantity::span(&shown, None) == Ok(span) {
        format!("\"{shown}\"")
    } else {
        format!("\"{} tick\" ({shown})", span.ticks())
    }
}

/// Whether octet 15 bit 1 is set, in words.
const fn on_off(slave: &Slave) -> &'static str {
    if slave.functions { "on" } else { "off" }
}
