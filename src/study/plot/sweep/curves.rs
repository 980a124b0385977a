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
                let (low, high) = self.band(point).unwrap_or((point.mean, point.mean));
                [low, point.mean, high]
            }));
            // A figure that is never negative keeps its zero in sight unless it is far away.
            let lo = if lo >= 0.0 && lo < 0.5 * hi { 0.0 } else { lo };
            let chart = Chart::draw(canvas, area, self.axis(), Axis::airy(self.sheet.axis(), lo, hi));
            for (index, curve) in shown.iter().enumerate() {
                let (colour, shape) = series(index);
                let at = |point: &Point, value: f64| chart.at(self.x.place(point.value), value);
                let banded: Vec<_> = curve.points.iter().filter_map(|point| Some((point, self.band(point)?))).collect();
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

    /// The bounds of `point` as far as the figure can go: no count and no share is negative, and no share is above 100 %.
    /// The interval of a mean, which is symmetric, does not know that; tables have it as it was reckoned.
    fn band(&self, point: &Point) -> Option<(f64, f64)> {
        let (least, most) = match self.sheet.unit.as_str() {
            "" => (0.0, f64::INFINITY),
            "%" => (0.0, 100.0),
            _ => (f64::NEG_INFINITY, f64::INFINITY),
        };
        point.bounds.map(|(low, high)| (low.max(least), high.min(most)))
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Three values whose means have these bounds, as a picture.
    fn drawn(unit: &str, means: [f64; 3], bounds: [(f64, f64); 3]) -> String {
        let sheet = Sheet {
            sweep: "s".to_owned(),
            base: "s.toml".to_owned(),
            figure: "faults".to_owned(),
            unit: unit.to_owned(),
            runs: 9,
            confidence: "95 %".to_owned(),
        };
        let labels: Vec<_> = ["1", "2", "3"].map(str::to_owned).into();
        let x = Parameter { name: "n".to_owned(), labels, numbers: Some(vec![1.0, 2.0, 3.0]) };
        let point = |value: usize| Point { value, mean: means[value], bounds: Some(bounds[value]) };
        let curves = vec![Curve { label: String::new(), points: (0..3).map(point).collect() }];
        Curves { sheet, x, curves }.draw().expect("a picture")
    }

    #[test]
    fn bands_end_where_counts_and_shares_do() {
        let (few, over, cut) =
            ([0.2, 1.0, 4.0], [(-0.3, 0.7), (-1.0, 3.0), (1.0, 7.0)], [(0.0, 0.7), (0.0, 3.0), (1.0, 7.0)]);
        assert_eq!(drawn("", few, over), drawn("", few, cut));
        assert_eq!(drawn("%", few, over), drawn("%", few, cut));
        assert_ne!(drawn("us", few, over), drawn("us", few, cut), "a time may be negative");
        let (most, over, cut) = (
            [50.0, 99.0, 99.9],
            [(40.0, 60.0), (96.0, 102.0), (99.5, 100.3)],
            [(40.0, 60.0), (96.0, 100.0), (99.5, 100.0)],
        );
        assert_eq!(drawn("%", most, over), drawn("%", most, cut));
        assert_ne!(drawn("", most, over), drawn("", most, cut), "a count has no end");
    }
}
