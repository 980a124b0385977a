//! Tail: which share of all cycles exceeds a value, for each combination a line of steps down to its largest value.

use super::{Cumulative, Sheet, Steps, ends};
use crate::study::plot::chart::{Axis, Chart};
use crate::study::plot::look::{Key, Swatch, legend, series, sheet};

/// Height of everything below the words [px].
const HEIGHT: i32 = 620;

/// How often a quantity was how large in all cycles of all repetitions.
#[derive(Clone, PartialEq, Debug)]
pub struct Tail {
    /// The words.
    pub sheet: Sheet,
    /// Whether the quantity can be negative: its magnitudes are drawn then.
    pub signed: bool,
    /// In the order of the plan, at most [`Cumulative::MOST`]: magnitudes, ascending, each with the share that exceeds it.
    pub steps: Vec<Steps>,
    /// How many combinations there are.
    pub of: usize,
}

impl Tail {
    /// Draws the picture.
    ///
    /// # Errors
    /// What the library says.
    pub fn draw(&self) -> Result<String, String> {
        let shown = &self.steps[..self.steps.len().min(Cumulative::MOST)];
        let few = if shown.len() < self.of {
            format!(" {} of {} combinations are drawn.", shown.len(), self.of)
        } else {
            String::new()
        };
        let value = if self.signed { "magnitude" } else { "value" };
        let subtitle = format!(
            "Sweep {}: share of all cycles whose {value} is above that on the axis, down to the largest seen.{few}",
            self.sheet.sweep
        );
        let title = format!("{}: how often a {value} is exceeded", self.sheet.figure);
        let footer = self.sheet.footer("all cycles of all repetitions that have a value");
        sheet(&title, &subtitle, &footer, HEIGHT, |canvas, mut area| {
            let key = |(index, steps): (usize, &Steps)| Key::new(steps.label.clone(), series(index).0, Swatch::Line);
            legend(canvas, &mut area, &shown.iter().enumerate().map(key).collect::<Vec<_>>());
            let points = || shown.iter().flat_map(|steps| steps.points.iter().copied());
            let (lo, hi) = ends(points().map(|point| point.0));
            let rarest = points().map(|point| point.1).filter(|&share| share > 0.0).fold(1.0, f64::min);
            let name = if self.signed { format!("magnitude of {}", self.sheet.axis()) } else { self.sheet.axis() };
            let airy = Axis::airy(name, lo, hi);
            // Nothing is below zero.
            let left = airy.lo.max(0.0);
            let x = Axis { lo: left, ..airy };
            // The last step of a line goes down to the end of the axis.
            let floor = 100.0 * rarest / 2.0;
            let chart = Chart::draw(canvas, area, x, Axis::logarithm("share of cycles above [%]", floor, 100.0));
            for (index, steps) in shown.iter().enumerate() {
                let mut before = 100.0;
                let mut path = vec![chart.at(left, before)];
                for &(value, share) in &steps.points {
                    let share = (100.0 * share).max(floor / 1.1);
                    path.extend([chart.at(value, before), chart.at(value, share)]);
                    before = share;
                }
                path.dedup();
                canvas.path(&path, series(index).0, 2);
            }
        })
    }
}
