//! Sources: what makes the instant of SYNCH at an encoder differ from its prediction, and how each is switched off.
//!
//! | of the network | as a disturbance |
//! |---|---|
//! | `master.gc_jitter` | gc-jitter |
//! | `repeater.N.jitter` | repeater-jitter |
//! | each `crystal` | crystal-offset, crystal-wander, temperature-step |
//! | the timer grid of the slaves | |
//! | | receiver-jitter |
//!
//! All disturbances of one kind are one source. Model: other kinds take telegrams or stations away, or hold SYNCH up; they
//! are no jitter, and what comes of them stays in the rest.

use crate::sim::fault::What;
use crate::sim::fault::clock::CrystalFault;
use crate::sim::fault::instant::InstantFault;
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
    Source { name: "gc_jitter_disturbance", title: "disturbed GC", present: |scenario| has(scenario, strays_clock), off: |scenario| without(scenario, strays_clock) },
    Source { name: "repeaters", title: "repeaters", present: has_repeater_jitter, off: without_repeater_jitter },
    Source { name: "repeater_jitter", title: "disturbed repeaters", present: |scenario| has(scenario, strays_repeater), off: |scenario| without(scenario, strays_repeater) },
    Source { name: "receiver_jitter", title: "receivers", present: |scenario| has(scenario, strays_receiver), off: |scenario| without(scenario, strays_receiver) },
    Source { name: "crystals", title: "crystals", present: has_crystals, off: without_crystals },
    Source { name: "crystal_offset", title: "crystal jumps", present: |scenario| has(scenario, jumps), off: |scenario| without(scenario, jumps) },
    Source { name: "crystal_wander", title: "crystal wander", present: |scenario| has(scenario, wanders), off: |scenario| without(scenario, wanders) },
    Source { name: "temperature_step", title: "temperature", present: |scenario| has(scenario, warms), off: |scenario| without(scenario, warms) },
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

/// Whether a scenario has a disturbance that `is` one of these.
fn has(scenario: &Scenario, is: fn(&What) -> bool) -> bool {
    scenario.disturbances.iter().any(|disturbance| is(&disturbance.what))
}
/// Takes them out; the draws of the others hang on their names.
fn without(scenario: &mut Scenario, is: fn(&What) -> bool) {
    scenario.disturbances.retain(|disturbance| !is(&disturbance.what));
}
fn strays_clock(what: &What) -> bool {
    matches!(what, What::Clock(jitter, _) if *jitter != GcJitter::None)
}
fn strays_repeater(what: &What) -> bool {
    matches!(what, What::Repeater(_, half_width) if *half_width > Span::ZERO)
}
fn strays_receiver(what: &What) -> bool {
    matches!(what, What::Instant(_, InstantFault::Receiver { half_width }) if *half_width > Span::ZERO)
}
fn jumps(what: &What) -> bool {
    matches!(what, What::Crystal(_, fault @ CrystalFault::Offset(_)) if fault.bound() > 0)
}
fn wanders(what: &What) -> bool {
    matches!(what, What::Crystal(_, fault @ CrystalFault::Wander { .. }) if fault.bound() > 0)
}
fn warms(what: &What) -> bool {
    matches!(what, What::Crystal(_, fault @ CrystalFault::Temperature { .. }) if fault.bound() > 0)
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
