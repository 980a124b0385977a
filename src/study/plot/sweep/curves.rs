//! Curves: a figure against a parameter, each combination of the other parameters a curve with the band of its
//! confidence interval.

use super::{Parameter, Sheet, ends};
use crate::study::plot::chart::{Axis, Chart};
use crate::study::plot::look::{Key, MAX_SERIES, Shape, Swatch, legend, series, sheet};

/// Height of everything below the words [px].
const HEIGHT: i32 = 620;

/// A figure against a parameter.
#[derive(Clone, PartialEq, Debug)]
pub struct Curves {
    /// The words.
    pub sheet: Sheet,
    /// The parameter.
    pub x: Parameter,
    /// In the order of the plan.
    pub curves: Vec<Curve>,
}

/// One combination of the other parameters.
#[derive(Clone, PartialEq, Debug)]
pub struct Curve {
    /// Which: `master.t_dp = 1 ms`; empty if there is no other parameter.
    pub label: String,
    /// By the number of the parameter's value.
    pub points: Vec<Point>,
}

/// One value of the parameter.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Point {
    /// Number of the value.
    pub value: usize,
    /// The mean of all repetitions.
    pub mean: f64,
    /// Bounds of the mean; none of a single repetition.
    pub bounds: Option<(f64, f64)>,
}

impl Curves {
    /// Draws the picture.
    ///
    /// # Errors
    /// What the library says.
    pub fn draw(&self) -> Result<String, String> {
        let shown = &self.curves[..self.curves.len().min(MAX_SERIES)];
        let few = if shown.len() < self.curves.len() {
            format!(" Only the first {} of {} curves are drawn.", shown.len(), self.curves.len())
        } else {
            String::new()
        };
        let subtitle = format!(
            "Sweep {}: mean of the repetitions at each value; the band holds the true mean at a confidence of {}.{few}",
            self.sheet.sweep, self.sheet.confidence
        );
        let title = format!("{} against {}", self.sheet.figure, self.x.name);
        let footer = self.sheet.footer("mean and confidence interval per combination");
        sheet(&title, &subtitle, &footer, HEIGHT, |canvas, mut area| {
            let key = |(index, curve): (usize, &Curve)| {
                let (colour, shape) = series(index);
                Key::new(curve.label.clone(), colour, Swatch::LineMark(shape))
            };
            let keys: Vec<_> = shown.iter().enumerate().map(key).filter(|key| !key.label.is_empty()).collect();
            legend(canvas, &mut area, &keys);
            let points = || shown.iter().flat_map(|curve| &curve.points);
            let (lo, hi) = ends(points().flat_map(|point| {
                let (low, high) = point.bounds.unwrap_or((point.mean, point.mean));
                [low, point.mean, high]
            }));
            // A figure that is never negative keeps its zero in sight unless it is far away.
            let lo = if lo >= 0.0 && lo < 0.5 * hi { 0.0 } else { lo };
            let chart = Chart::draw(canvas, area, self.axis(), Axis::airy(self.sheet.axis(), lo, hi));
            for (index, curve) in shown.iter().enumerate() {
                let (colour, shape) = series(index);
                let at = |point: &Point, value: f64| chart.at(self.x.place(point.value), value);
                let banded: Vec<_> = curve.points.iter().filter_map(|point| Some((point, point.bounds?))).collect();
                let over = banded.iter().map(|(point, (_, high))| at(point, *high));
                let under = banded.iter().rev().map(|(point, (low, _))| at(point, *low));
                if banded.len() > 1 {
                    canvas.polygon(&over.chain(under).collect::<Vec<_>>(), colour, 0.18);
                }
                let line: Vec<_> = curve.points.iter().map(|point| at(point, point.mean)).collect();
                canvas.path(&line, colour, 2);
                for place in line {
                    canvas.marker(place, shape, if shape == Shape::Dot { 3 } else { 4 }, colour);
                }
            }
        })
    }

    fn axis(&self) -> Axis {
        let (lo, hi) = ends((0..self.x.labels.len()).map(|index| self.x.place(index)));
        if self.x.is_logarithmic() {
            Axis::logarithm(self.x.name.clone(), lo, hi)
        } else {
            Axis::airy(self.x.name.clone(), lo, hi)
        }
    }
}
