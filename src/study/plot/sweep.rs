//! Sweep: the pictures of many runs, from plain numbers: figures against a parameter, over two of them, and how they
//! are distributed.

mod cumulative;
mod curves;
mod heat;
mod tail;

pub use cumulative::{Cumulative, Steps};
pub use curves::{Curve, Curves, Point};
pub use heat::{Cell, Heat};
pub use tail::Tail;

/// What every picture says about the sweep.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Sheet {
    /// Name of the sweep.
    pub sweep: String,
    /// The scenario, as the sweep file names it.
    pub base: String,
    /// The figure: `latch_skew.p99`.
    pub figure: String,
    /// Its unit; empty for counts.
    pub unit: String,
    /// Runs of the whole sweep.
    pub runs: u64,
    /// Confidence of intervals in words.
    pub confidence: String,
}

impl Sheet {
    /// The figure with its unit, as an axis is named.
    fn axis(&self) -> String {
        if self.unit.is_empty() { self.figure.clone() } else { format!("{} [{}]", self.figure, self.unit) }
    }
    /// The line at the foot.
    fn footer(&self, plotted: &str) -> String {
        format!("isodp | sweep {} of {}, {} runs | {plotted}", self.sweep, self.base, self.runs)
    }
}

/// A parameter on an axis.
#[derive(Clone, PartialEq, Debug)]
pub struct Parameter {
    /// With its unit: `master.t_dp [ms]`.
    pub name: String,
    /// Its values as they are written.
    pub labels: Vec<String>,
    /// Its values in its unit; none if they are no numbers.
    pub numbers: Option<Vec<f64>>,
}

impl Parameter {
    /// Where value `index` stands on an axis: at its number, otherwise one after the other.
    pub fn place(&self, index: usize) -> f64 {
        self.numbers.as_ref().map_or(index as f64 + 1.0, |numbers| numbers[index])
    }
    /// Whether its values are rather equal ratios than equal steps.
    fn is_logarithmic(&self) -> bool {
        let Some(numbers) = &self.numbers else { return false };
        let (lo, hi) = ends(numbers.iter().copied());
        let middle = numbers.get(numbers.len() / 2).copied().unwrap_or(lo);
        // In equal steps the middle value is half-way, in equal ratios it is near the low end.
        numbers.len() > 2 && lo > 0.0 && hi / lo >= 8.0 && (middle.min(lo + hi - middle) - lo) / (hi - lo) < 0.35
    }
}

/// The smallest and the largest of `values`; 0 and 1 of none.
fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let ends = values.fold(None, |ends: Option<(f64, f64)>, value| {
        let (lo, hi) = ends.unwrap_or((value, value));
        Some((lo.min(value), hi.max(value)))
    });
    ends.unwrap_or((0.0, 1.0))
}
