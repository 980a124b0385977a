//! Sources: what makes the instant of SYNCH at an encoder differ from its prediction, and how each is switched off.

use crate::sim::jitter::GcJitter;
use crate::study::scenario::{Crystal, Scenario, Topology};
use crate::time::Span;

/// The finest timer grid there is.
const FINEST: Span = Span::from_ticks(1);

/// Something that uses up a part of T_PLL_W.
#[derive(Clone, Copy, Debug)]
pub struct Source {
    /// Its name in files.
    pub name: &'static str,
    /// Its name for people.
    pub title: &'static str,
    /// Whether a scenario has it.
    pub present: fn(&Scenario) -> bool,
    /// Takes it away and leaves everything else: every draw belongs to its own stream, so that of the other sources no
    /// draw changes.
    pub off: fn(&mut Scenario),
}

/// Every source. One line here is all that a new one needs.
#[rustfmt::skip]
pub const SOURCES: &[Source] = &[
    Source { name: "gc_jitter", title: "GC jitter", present: has_gc_jitter, off: |scenario| scenario.master.gc_jitter = GcJitter::None },
    Source { name: "repeaters", title: "repeaters", present: has_repeater_jitter, off: without_repeater_jitter },
    Source { name: "crystals", title: "crystals", present: has_crystals, off: without_crystals },
    Source { name: "quantum", title: "timer grid", present: has_quantum, off: without_quantum },
];

fn has_gc_jitter(scenario: &Scenario) -> bool {
    scenario.master.gc_jitter != GcJitter::None
}

fn has_repeater_jitter(scenario: &Scenario) -> bool {
    scenario.topology.repeaters().iter().any(|repeater| repeater.jitter > Span::ZERO)
}
fn without_repeater_jitter(scenario: &mut Scenario) {
    let mut repeaters = scenario.topology.repeaters().to_vec();
    for repeater in &mut repeaters {
        repeater.jitter = Span::ZERO;
    }
    scenario.topology =
        Topology::new(scenario.topology.segments().to_vec(), repeaters).expect("the tree it was before");
}

const NONE: Crystal = Crystal::Offset(0);

fn has_crystals(scenario: &Scenario) -> bool {
    let still = |crystal: Crystal| matches!(crystal, Crystal::Offset(0) | Crystal::Within(0));
    !still(scenario.master.crystal) || scenario.slaves.iter().any(|slave| !still(slave.crystal))
}
fn without_crystals(scenario: &mut Scenario) {
    scenario.master.crystal = NONE;
    for slave in &mut scenario.slaves {
        slave.crystal = NONE;
    }
}

fn has_quantum(scenario: &Scenario) -> bool {
    scenario.slaves.iter().any(|slave| slave.options.pll.quantum > FINEST)
}
fn without_quantum(scenario: &mut Scenario) {
    for slave in &mut scenario.slaves {
        slave.options.pll.quantum = FINEST;
    }
}
