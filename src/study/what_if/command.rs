//! The call of a what-if: which run, from which cycle on, with what otherwise.

use std::error::Error;
use std::path::PathBuf;

use super::{Futures, WhatIfError, futures, world};
use crate::sim::network::NetworkEvent;
use crate::sim::queue::NearQueue;
use crate::study::scenario::Scenario;

/// What is asked.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Call {
    /// Scenario file.
    pub file: PathBuf,
    /// Overrides of the whole run.
    pub run_sets: Vec<(String, String)>,
    /// Overrides that hold from the cycle on.
    pub sets: Vec<(String, String)>,
    /// The cycle.
    pub cycle: u64,
    /// How many cycles both go on; none is to the end of the run.
    pub window: Option<u64>,
}

/// The page that answers a call.
///
/// # Errors
/// A file that is no scenario, a cycle that never comes, or something that cannot change while the network runs.
pub fn answer(call: &Call) -> Result<String, Box<dyn Error>> {
    let original = Scenario::load(&call.file, &call.run_sets)?;
    let with = |sets: &[(String, String)]| Scenario::load(&call.file, &[&call.run_sets, sets].concat());
    let altered = with(&call.sets)?;
    if !world::can_change(&original, &altered) {
        let alone = |set: &&(String, String)| {
            with(std::slice::from_ref(set)).is_ok_and(|altered| !world::can_change(&original, &altered))
        };
        let mut guilty: Vec<_> = call.sets.iter().filter(alone).collect();
        if guilty.is_empty() {
            guilty = call.sets.iter().collect();
        }
        let keys: Vec<_> = guilty.iter().map(|(key, value)| format!("--set \"{key}={value}\"")).collect();
        return Err(WhatIfError::Station { keys: keys.join(", ") }.into());
    }
    let both = [&original, &altered];
    let Futures { from, differences, .. } = futures::<NearQueue<NetworkEvent>, _>(both, (call.cycle, call.window), ())?;
    let sets: Vec<_> = call.sets.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    let until = call.window.map_or_else(|| "to the end of the run".to_owned(), |window| format!("for {window} cycles"));
    let mut lines = vec![
        format!(
            "{}, seed {}: from cycle {} on, at {:.9} s, {until}",
            original.name,
            original.run.seed,
            call.cycle,
            from.since_zero().as_s()
        ),
        format!("altered: {}", sets.join(", ")),
        String::new(),
    ];
    lines.extend(differences.lines(["original", "altered"]));
    Ok(lines.join("\n") + "\n")
}
