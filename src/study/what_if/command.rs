//! The call of a what-if: which run, from which cycle on, with what otherwise.

use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::rider::{Rider, over, rider};
use super::{Futures, WhatIfError, futures, world};
use crate::sim::network::NetworkEvent;
use crate::sim::queue::NearQueue;
use crate::study::compare::{Moved, Tolerances, Verdict, side_by_side};
use crate::study::export::{ExportError, Staged};
use crate::study::plot::futures::{FILE, draw};
use crate::study::report::aligned;
use crate::study::run::{Speeds, layout, meta};
use crate::study::scenario::Scenario;

/// Figures that are shown.
const FIGURES: usize = 40;

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
    /// Where the picture goes, to `out/<scenario>/`; none is nowhere.
    pub out: Option<PathBuf>,
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
    let rider = rider(&original, call.cycle);
    let alter = |rider: &mut Rider| rider.set_shafts(Speeds::of(&altered));
    let Futures { from, differences, ends } =
        futures::<NearQueue<NetworkEvent>, _>(both, (call.cycle, call.window), rider, alter)?;
    let [before, now] = ends.map(|(end, rider)| over(rider, end));
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
    lines.push(String::new());
    table(&side_by_side(&before.0, &now.0, &Tolerances::default()), call.cycle, &mut lines);
    if let Some(out) = &call.out {
        let dir = out.join(&original.name);
        let meta = meta(&original, &layout(&original));
        write(&dir, &draw(&meta, call.cycle, [&before.1, &now.1])?)?;
        lines.push(format!("{FILE} in {}", dir.display()));
    }
    Ok(lines.iter().flat_map(|line| [line.trim_end(), "\n"]).collect())
}

/// How the figures part.
fn table(all: &[Moved], cycle: u64, lines: &mut Vec<String>) {
    let moved: Vec<_> = all.iter().filter(|moved| moved.verdict() != Verdict::Same).collect();
    if moved.is_empty() {
        return lines.push(format!("none of {} figures is another", all.len()));
    }
    lines.push(format!(
        "{} of {} figures are others; distributions from cycle {cycle} on, counts and instants of the whole run",
        moved.len(),
        all.len()
    ));
    let row = |moved: &&Moved| std::iter::once(moved.name.clone()).chain(moved.cells()).collect();
    let rows: Vec<Vec<String>> = moved.iter().take(FIGURES).map(row).collect();
    lines.extend(aligned(&["figure", "original", "altered", "change", ""], &[0], &rows));
    if let Some(more @ 1..) = moved.len().checked_sub(FIGURES) {
        lines.push(format!("and {more} more"));
    }
}

/// Writes the picture.
fn write(dir: &Path, picture: &str) -> Result<(), ExportError> {
    std::fs::create_dir_all(dir).map_err(|source| ExportError::Directory { path: dir.to_owned(), source })?;
    let mut file = Staged::create(dir, FILE)?;
    file.write_all(picture.as_bytes()).map_err(|error| file.error(error))?;
    file.place().map(|_| ())
}
