//! Draws: what of a scenario hangs on its seed.
//!
//! Where each station's clock begins is always drawn and not told here: it moves instants by less than a step of a
//! slave's timer grid.

use crate::study::scenario::{Crystal, Scenario};
use crate::time::Span;

/// Whether a scenario draws something.
type Asks = fn(&Scenario) -> bool;

/// Everything that can be drawn: for people, and whether a scenario has it.
const DRAWS: [(&str, Asks); 4] = [
    ("clock jitter", |scenario| scenario.master.gc_jitter.draws()),
    ("crystals", has_crystals),
    ("repeater jitter", |scenario| scenario.topology.repeaters().iter().any(|repeater| repeater.jitter > Span::ZERO)),
    ("disturbances", |scenario| scenario.disturbances.iter().any(|disturbance| disturbance.what.draws())),
];

fn has_crystals(scenario: &Scenario) -> bool {
    let masters = std::iter::once(scenario.master.crystal).chain(scenario.class1.iter().map(|class1| class1.crystal));
    let slaves = scenario.slaves.iter().map(|slave| slave.crystal);
    let class2 = scenario.class2.iter().map(|class2| class2.crystal);
    masters.chain(slaves).chain(class2).any(|crystal| matches!(crystal, Crystal::Within(ppb) if ppb != 0))
}

/// What `scenario` draws, in words; empty where each repetition is the same.
pub fn drawn(scenario: &Scenario) -> Vec<&'static str> {
    DRAWS.iter().filter(|(_, has)| has(scenario)).map(|&(words, _)| words).collect()
}
