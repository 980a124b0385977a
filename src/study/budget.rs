//! Margin budget: where each encoder's clock window goes.
//!
//! A SYNCH is a hit if its PLL error e, arrival minus prediction, is within ± T_PLL_W (manual 3.3.8). What brings e
//! there is measured, not reckoned: the scenario runs with all of its sources, with none, with each one missing and with
//! each one alone, always with the same draws, and each time the largest |e| of each encoder is taken over the cycles in
//! which it is locked and settled.
//!
//! ```text
//! part of a source   = (largest |e| with all - without it + with it alone - without any) / 2
//! rest               = largest |e| without any source: rounding of the loop, and what else the scenario disturbs
//! interaction        = largest |e| with all - rest - all parts
//! left               = T_PLL_W - largest |e| with all
//! ```
//!
//! Model: the mean of a source's effect as the last and as the first one. Of two sources this is exact, and what adds up
//! in the worst case does so here: each effect alone is too much where extremes seldom meet, each missing one too little.
//! The interaction tells how far the parts are from the whole; it can be negative.
//!
//! Of each part is told what the **loop adds**: the prediction follows a part of every jitter, so that e is larger than the
//! jitter itself. It is the part minus the same part of the distance between the captured arrival and the master's
//! jitter-free grid, which is what e would be if the prediction followed nothing but that grid.
//!
//! Propagation is a source only by its jitter, of repeaters and receivers: a delay that stays the same is in the prediction.

pub mod measure;
pub mod source;

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use rayon::iter::{IntoParallelIterator, ParallelIterator};
use serde_json::{Value, json};

use super::event_budget::NoHeadway;
use super::export::decimal::Decimal;
use super::export::{ExportError, Staged};
use super::plot;
use super::report::{aligned, number};
use super::scenario::Scenario;
use crate::time::Span;
use crate::wire::Address;
use measure::{Measured, SETTLING, clocked, measure, window};
use source::{SOURCES, Source};

/// Encoders on the page; of more, those with the least left.
pub const SHOWN: usize = 16;
/// Most characters of a line of the page.
const COLUMNS: usize = 120;
/// The picture.
const PICTURE: &str = "budget.svg";
/// The numbers.
const NUMBERS: &str = "budget.json";

/// Why there is no budget.
#[derive(Debug, thiserror::Error)]
pub enum BudgetError {
    /// No slave of the scenario has a clock.
    #[error(
        "{0}: no slave follows a clock, so there is no window to share out\n  help: a budget needs a master with SYNCH and isochronous slaves"
    )]
    NoClock(String),
    /// One of the runs makes no headway.
    #[error(transparent)]
    NoHeadway(#[from] NoHeadway),
    /// A file could not be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The picture could not be drawn.
    #[error(transparent)]
    Plot(#[from] plot::PlotError),
}

/// A figure of a run, shared out among the sources. The parts, the rest and the interaction add up to the whole.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Shares {
    /// The figure with all sources.
    pub whole: Span,
    /// The figure without any.
    pub rest: Span,
    /// What each source brings, in the order of [`Budget::sources`].
    pub parts: Vec<Span>,
    /// What is missing to the whole.
    pub interaction: Span,
}

/// The window of one encoder.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SlaveBudget {
    /// The encoder.
    pub address: Address,
    /// Its device.
    pub device: String,
    /// Half width of its window once locked: T_PLL_W, at least 1 µs (manual 3.3.8).
    pub window: Span,
    /// Cycles that count, with all sources.
    pub cycles: u64,
    /// Its shares; none if it was not settled in one of the runs.
    pub shares: Option<SlaveShares>,
}

/// The shares of one encoder.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SlaveShares {
    /// Of the largest |e|.
    pub worst: Shares,
    /// Of the 99.9th percentile of |e|.
    pub p99_9: Shares,
    /// Of what the largest |e| would be if the prediction followed the jitter-free grid.
    pub direct: Shares,
}

impl SlaveShares {
    /// How much the loop makes of source number `index` beyond its own size.
    pub fn loop_adds(&self, index: usize) -> Span {
        self.worst.parts[index] - self.direct.parts[index]
    }
}

impl SlaveBudget {
    /// What is left of the window; negative where e left it, none without shares.
    pub fn left(&self) -> Option<Span> {
        Some(self.window - self.shares.as_ref()?.worst.whole)
    }
}

/// The budget of a scenario.
#[derive(Clone, Debug)]
pub struct Budget {
    /// Name of the scenario.
    pub scenario: String,
    /// Its seed.
    pub seed: u64,
    /// The sources that it has.
    pub sources: Vec<&'static Source>,
    /// Runs that were made.
    pub runs: usize,
    /// Its encoders in address order.
    pub slaves: Vec<SlaveBudget>,
}

/// Which sources are on: a bit for each that the scenario has.
type Mask = u32;

impl Budget {
    /// The budget of `scenario`; `watch` is told after each run how many there are. The runs share all processors, and
    /// their number changes nothing.
    ///
    /// # Errors
    /// No slave has a clock, or a run makes no headway.
    pub fn of(scenario: &Scenario, watch: impl Fn(usize) + Sync) -> Result<Self, BudgetError> {
        if clocked(scenario).next().is_none() {
            return Err(BudgetError::NoClock(scenario.name.clone()));
        }
        let sources: Vec<&Source> = SOURCES.iter().filter(|source| (source.present)(scenario)).collect();
        let masks = masks(sources.len());
        let runs = masks.len();
        let run = |mask: Mask| {
            let measured = measure(&variant(scenario, &sources, mask));
            watch(runs);
            (mask, measured)
        };
        // The first run that fails is the one to tell, whichever ended first.
        let runs_by_mask: Vec<_> = masks.into_par_iter().map(run).collect();
        let measured = runs_by_mask.into_iter().map(|(mask, measured)| Ok((mask, measured?)));
        let measured = measured.collect::<Result<BTreeMap<Mask, Vec<Measured>>, NoHeadway>>()?;
        let slave = |(index, slave): (usize, &super::scenario::Slave)| SlaveBudget {
            address: slave.address,
            device: slave.device.name.clone().into_owned(),
            window: window(scenario, slave),
            cycles: measured[&all(sources.len())][index].cycles,
            shares: shares(&measured, index, sources.len()),
        };
        let slaves = clocked(scenario).enumerate().map(slave).collect();
        Ok(Self { scenario: scenario.name.clone(), seed: scenario.run.seed, runs, slaves, sources })
    }
}

/// Every source on.
const fn all(sources: usize) -> Mask {
    (1 << sources) - 1
}

/// What is run: everything, nothing, each source missing, each alone; with few sources some of these are the same.
fn masks(sources: usize) -> Vec<Mask> {
    let each = (0..sources).map(|source| 1 << source);
    let mut masks: Vec<Mask> = each.flat_map(|one| [one, all(sources) ^ one]).chain([0, all(sources)]).collect();
    masks.sort_unstable();
    masks.dedup();
    masks
}

/// The scenario with those of its sources that `mask` has.
fn variant(scenario: &Scenario, sources: &[&Source], mask: Mask) -> Scenario {
    let mut variant = scenario.clone();
    for (index, source) in sources.iter().enumerate() {
        if mask & 1 << index == 0 {
            (source.off)(&mut variant);
        }
    }
    variant
}

/// The shares of slave number `index`; none if one of the runs has no cycle that counts.
fn shares(measured: &BTreeMap<Mask, Vec<Measured>>, index: usize, sources: usize) -> Option<SlaveShares> {
    let judged = measured.values().all(|slaves| slaves[index].cycles > 0);
    let of = |figure: fn(&Measured) -> Span| Shares::of(sources, |mask| figure(&measured[&mask][index]));
    judged.then(|| SlaveShares {
        worst: of(|measured| measured.worst),
        p99_9: of(|measured| measured.p99_9),
        direct: of(|measured| measured.direct),
    })
}

impl Shares {
    /// The shares of a figure that is known for each of [`masks`].
    fn of(sources: usize, figure: impl Fn(Mask) -> Span) -> Self {
        let (whole, rest) = (figure(all(sources)), figure(0));
        let part = |source: usize| {
            let one = 1 << source;
            let both = whole - figure(all(sources) ^ one) + figure(one) - rest;
            Span::from_ticks(both.ticks().div_euclid(2))
        };
        let parts: Vec<Span> = (0..sources).map(part).collect();
        let interaction = whole - rest - parts.iter().copied().sum();
        Self { whole, rest, parts, interaction }
    }
}

impl Budget {
    /// Writes the picture and the numbers to `dir`; names of the files.
    ///
    /// # Errors
    /// One of them cannot be drawn or written; then there is none.
    pub fn write(&self, scenario: &Scenario, dir: &Path) -> Result<[&'static str; 2], BudgetError> {
        let files = [(PICTURE, plot::budget::draw(scenario, self)?), (NUMBERS, format!("{:#}\n", self.json()))];
        std::fs::create_dir_all(dir).map_err(|source| ExportError::Directory { path: dir.to_owned(), source })?;
        let mut staged = Vec::with_capacity(files.len());
        for (name, text) in &files {
            let mut file = Staged::create(dir, name)?;
            file.write_all(text.as_bytes()).map_err(|error| file.error(error))?;
            staged.push(file);
        }
        Staged::place_all(staged)?;
        Ok(files.map(|file| file.0))
    }

    /// Everything as JSON; times in nanoseconds.
    pub fn json(&self) -> Value {
        let shares = |of: &Shares| {
            let parts = self.sources.iter().zip(&of.parts).map(|(source, &part)| (source.name.to_owned(), ns(part)));
            json!({
                "whole_ns": ns(of.whole),
                "parts_ns": parts.collect::<serde_json::Map<_, _>>(),
                "rest_ns": ns(of.rest),
                "interaction_ns": ns(of.interaction),
            })
        };
        let slave = |slave: &SlaveBudget| {
            json!({
                "address": slave.address.get(),
                "device": slave.device,
                "window_ns": ns(slave.window),
                "left_ns": slave.left().map(ns),
                "cycles": slave.cycles,
                "pll_error_worst": slave.shares.as_ref().map(|of| shares(&of.worst)),
                "pll_error_p99.9": slave.shares.as_ref().map(|of| shares(&of.p99_9)),
                "without_the_loop": slave.shares.as_ref().map(|of| shares(&of.direct)),
            })
        };
        json!({
            "scenario": self.scenario,
            "seed": self.seed,
            "runs": self.runs,
            "slaves": self.slaves.iter().map(slave).collect::<Vec<_>>(),
        })
    }

    /// The page.
    pub fn page(&self) -> String {
        let mut shown: Vec<&SlaveBudget> = self.slaves.iter().collect();
        let more = shown.len().saturating_sub(SHOWN);
        if more > 0 {
            shown.sort_by_key(|slave| slave.left());
            shown.truncate(SHOWN);
            shown.sort_by_key(|slave| slave.address);
        }
        let mut lines = vec![format!(
            "{}: margin budget of {}, seed {}, {}, the first {SETTLING} cycles after each lock left out",
            self.scenario,
            number(self.slaves.len(), "encoder"),
            self.seed,
            number(self.runs, "run"),
        )];
        for (title, figure) in [("largest |e|", Figure::Worst), ("p99.9 of |e|", Figure::P99_9)] {
            lines.push(String::new());
            lines.extend(self.table(&shown, title, figure));
        }
        lines.push(String::new());
        lines.push("in ns; a part is what a source brings, in brackets what of it the loop adds".to_owned());
        if more > 0 {
            lines.push(format!("the {SHOWN} encoders with the least left; {more} more have no less, see {NUMBERS}"));
        }
        lines.extend(self.slaves.iter().filter(|slave| slave.shares.is_none()).map(|slave| {
            let address = slave.address;
            format!("slave {address}: no budget, it was not locked for {SETTLING} cycles in a row in every run")
        }));
        lines.iter().flat_map(|line| [line.trim_end(), "\n"]).collect()
    }

    fn table(&self, slaves: &[&SlaveBudget], title: &str, figure: Figure) -> Vec<String> {
        // What matters most comes first: the rest may go on below.
        let mut header = vec!["slave", "T_PLL_W", title, "left"];
        header.extend(self.sources.iter().map(|source| source.title));
        header.extend(["rest", "interaction"]);
        let row = |slave: &&SlaveBudget| {
            let all = slave.shares.as_ref()?;
            let of = figure.shares(all);
            let mut row = vec![slave.address.to_string()];
            row.extend([slave.window, of.whole, slave.window - of.whole].map(tenths));
            row.extend((0..of.parts.len()).map(|source| figure.part(all, source)));
            row.extend([of.rest, of.interaction].map(tenths));
            Some(row)
        };
        folded(&header, &slaves.iter().filter_map(row).collect::<Vec<_>>())
    }
}

/// A table of numbers whose first column says whose they are. What does not fit into [`COLUMNS`] goes on below, indented,
/// with the first column once more.
fn folded(header: &[&str], rows: &[Vec<String>]) -> Vec<String> {
    /// Between two columns, and in front of what goes on.
    const GAP: usize = 2;
    let width = |column: usize| {
        let cells = rows.iter().map(|row| row[column].chars().count());
        GAP + cells.chain([header[column].chars().count()]).max().unwrap_or(0)
    };
    let mut parts: Vec<Vec<usize>> = vec![vec![0]];
    let mut taken = width(0);
    for column in 1..header.len() {
        if taken + width(column) > COLUMNS {
            parts.push(vec![0]);
            taken = GAP + width(0);
        }
        taken += width(column);
        parts.last_mut().expect("one at least").push(column);
    }
    let part = |(number, columns): (usize, &Vec<usize>)| {
        let header: Vec<_> = columns.iter().map(|&column| header[column]).collect();
        let rows: Vec<Vec<_>> =
            rows.iter().map(|row| columns.iter().map(|&column| row[column].clone()).collect()).collect();
        let indent = if number > 0 { GAP } else { 0 };
        let lines = aligned(&header, &[], &rows).into_iter();
        lines.map(|line| format!("{:indent$}{line}", "")).collect::<Vec<_>>()
    };
    parts.iter().enumerate().flat_map(part).collect()
}

/// A figure of the page.
#[derive(Clone, Copy)]
enum Figure {
    Worst,
    P99_9,
}

impl Figure {
    const fn shares(self, of: &SlaveShares) -> &Shares {
        match self {
            Self::Worst => &of.worst,
            Self::P99_9 => &of.p99_9,
        }
    }
    /// What a source brings, and of the largest error what the loop adds.
    fn part(self, of: &SlaveShares, source: usize) -> String {
        let part = tenths(self.shares(of).parts[source]);
        match self {
            Self::Worst => format!("{part} ({})", tenths(of.loop_adds(source))),
            Self::P99_9 => part,
        }
    }
}

fn ns(span: Span) -> Value {
    json!(Decimal::ns(span))
}
/// Nanoseconds with one decimal.
fn tenths(span: Span) -> String {
    let text = format!("{:.1}", span.as_ns());
    if text == "-0.0" { "0.0".to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_folded_where_they_do_not_fit() {
        let row = |slave: &str, cells: usize| {
            let cells = (1..cells).map(|column| format!("{slave}{column:0>18}"));
            std::iter::once(slave.to_owned()).chain(cells).collect::<Vec<_>>()
        };
        let titles = ["slave", "a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l"];
        // A line of n cells has 5 + 21 (n - 1) characters, one that goes on two more.
        for (cells, lengths) in [(1, &[5][..]), (6, &[110]), (7, &[110, 28]), (11, &[110, 112]), (12, &[110, 112, 28])]
        {
            let lines = folded(&titles[..cells], &[row("3", cells), row("4", cells)]);
            let found: Vec<_> = lines.chunks(3).map(|part| part[0].len()).collect();
            assert_eq!(found, lengths, "{lines:#?}");
            assert!(lines.chunks(3).skip(1).all(|part| part[0].starts_with("  slave")), "{lines:#?}");
            let all: Vec<&str> = lines.iter().flat_map(|line| line.split_whitespace()).collect();
            assert!(titles[..cells].iter().all(|title| all.contains(title)), "{lines:#?}");
            assert!(row("4", cells).iter().all(|cell| all.contains(&cell.as_str())), "{lines:#?}");
        }
    }
}
