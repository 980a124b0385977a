//! Cumulative: which share of the repetitions stays at or below a value, for each combination a line of steps.

use super::{Sheet, ends};
use crate::study::plot::chart::{Axis, Chart};
use crate::study::plot::look::{Key, Swatch, legend, series, sheet};

/// Height of everything below the words [px].
const HEIGHT: i32 = 620;

/// How a figure is distributed over repetitions.
#[derive(Clone, PartialEq, Debug)]
pub struct Cumulative {
    /// The words.
    pub sheet: Sheet,
    /// In the order of the plan, at most [`Cumulative::MOST`].
    pub steps: Vec<Steps>,
    /// How many combinations there are.
    pub of: usize,
}

/// The repetitions of one combination.
#[derive(Clone, PartialEq, Debug)]
pub struct Steps {
    /// Which.
    pub label: String,
    /// Values, ascending, each with the share of all that does not exceed it (0 to 1).
    pub points: Vec<(f64, f64)>,
}

impl Cumulative {
    /// Most lines of one picture, each of another colour.
    pub const MOST: usize = 7;

    /// Draws the picture.
    ///
    /// # Errors
    /// What the library says.
    pub fn draw(&self) -> Result<String, String> {
        let shown = &self.steps[..self.steps.len().min(Self::MOST)];
        let few = if shown.len() < self.of {
            format!(" {} of {} combinations are drawn.", shown.len(), self.of)
        } else {
            String::new()
        };
        let subtitle = format!("Sweep {}: share of the repetitions at or below a value.{few}", self.sheet.sweep);
        let title = format!("{}: cumulative distribution per combination", self.sheet.figure);
        let footer = self.sheet.footer("cumulative distribution of the repetitions");
        sheet(&title, &subtitle, &footer, HEIGHT, |canvas, mut area| {
            let key = |(index, steps): (usize, &Steps)| Key::new(steps.label.clone(), series(index).0, Swatch::Line);
            legend(canvas, &mut area, &shown.iter().enumerate().map(key).collect::<Vec<_>>());
            let (lo, hi) = ends(shown.iter().flat_map(|steps| steps.points.iter().map(|point| point.0)));
            let x = Axis::airy(self.sheet.axis(), lo, hi);
            let (left, right) = (x.lo, x.hi);
            let chart = Chart::draw(canvas, area, x, Axis::airy("share of repetitions [%]", 0.0, 100.0));
            for (index, steps) in shown.iter().enumerate() {
                let mut path = vec![chart.at(left, 0.0)];
                let mut before = 0.0;
                for &(value, share) in &steps.points {
                    path.extend([chart.at(value, before), chart.at(value, 100.0 * share)]);
                    before = 100.0 * share;
                }
                path.push(chart.at(right, 100.0));
                path.dedup();
                canvas.path(&path, series(index).0, 2);
            }
        })
    }
}
