//! Flight: the keys of the flight recorder, `[record.flight]`.

use super::error::Fault;
use super::section::{Reader, Section, choice, number, yes};
use super::tree::{Node, Value};
use crate::study::flight::trigger::Trigger;

/// What the flight recorder keeps.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Flight {
    /// Cycles before a trigger, 0..=100.
    pub before: usize,
    /// Cycles after a trigger, 0..=100.
    pub after: usize,
    /// Most stretches of a run, 1..=256.
    pub captures: usize,
    /// What it watches for, in the order of [`Trigger::ALL`].
    pub triggers: Vec<Trigger>,
}

impl Default for Flight {
    /// Five cycles each side, 16 stretches, every trigger. Model: enough to see what led to a fault (T_PLL_W and signs of
    /// life are judged over a few cycles) and little enough to be read.
    fn default() -> Self {
        Self { before: 5, after: 5, captures: 16, triggers: Trigger::ALL.to_vec() }
    }
}

/// Reads `[record.flight]`; none where it is off. Without the table it is: it takes 3 to 13 % of the time of a run
/// (`cargo bench --bench network`).
pub(super) fn read(section: Option<Section<'_>>, reader: &mut Reader<'_>) -> Option<Flight> {
    let usual = Flight::default();
    let mut section = section?;
    let on = section.optional(reader, "on", yes).unwrap_or(true);
    let mut count = |key, range, usual| section.optional(reader, key, number(range)).unwrap_or(usual);
    let before = count("before", 0..=100, usual.before);
    let after = count("after", 0..=100, usual.after);
    let captures = count("captures", 1..=256, usual.captures);
    let triggers = section.optional(reader, "triggers", triggers).unwrap_or(usual.triggers);
    section.finish(reader);
    on.then_some(Flight { before, after, captures, triggers })
}

/// A list of names of triggers.
fn triggers(node: &Node) -> Result<Vec<Trigger>, Fault> {
    let known = || Trigger::ALL.iter().map(|trigger| format!("\"{trigger}\"")).collect::<Vec<_>>().join(", ");
    let Value::List(list) = &node.value else {
        return Err(Fault::new(format!("this is {}", node.value.noun())).help(format!("a list of {}", known())));
    };
    let name = |node| choice(node, "trigger", Trigger::ALL, |trigger| trigger.name()).copied();
    let mut triggers = list.iter().map(name).collect::<Result<Vec<_>, _>>()?;
    if triggers.is_empty() {
        return Err(
            Fault::new("nothing triggers the flight recorder").help(format!("some of {}, or on = false", known()))
        );
    }
    triggers.sort_unstable();
    triggers.dedup();
    Ok(triggers)
}
