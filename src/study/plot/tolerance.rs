//! Tolerance: the share of runs that break an expectation against a value of the scenario, with the answer of the search.

use super::chart::{Axis, Chart};
use super::look::{
    Area, BLUE, Canvas, Font, GREEN, GREY, Key, ORANGE, PURPLE, Shape, Swatch, VERMILION, legend, sheet, text_width,
};

/// Height of everything below the words [px].
const HEIGHT: i32 = 620;
/// Height of the words about the band [px].
const NAME: i32 = 26;
/// From this ratio of the ends on an axis is logarithmic.
const FAR: f64 = 20.0;

/// What is drawn.
#[derive(Clone, PartialEq, Debug)]
pub struct Tolerance {
    /// The question.
    pub title: String,
    /// The answer.
    pub answer: String,
    /// What is expected.
    pub expected: String,
    /// The key with its unit.
    pub x: String,
    /// In the order of the search's way.
    pub points: Vec<Point>,
    /// Where the limit is, if it was found.
    pub band: Option<Band>,
    /// What is asked of chance; none where nothing is drawn.
    pub chance: Option<Chance>,
    /// The line at the foot.
    pub footer: String,
}

/// A value that was tried.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Point {
    /// The value.
    pub x: f64,
    /// Share of its runs that fail; none without a run.
    pub share: Option<f64>,
    /// Bounds of the probability; none where nothing is drawn.
    pub bounds: Option<(f64, f64)>,
    /// What became of it.
    pub mark: Mark,
}

/// What became of a value.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Mark {
    /// It holds.
    Holds,
    /// It fails.
    Fails,
    /// Most runs did not prove that it holds.
    Unproven,
    /// The scenario refuses it.
    Refused,
}

/// Where the limit is.
#[derive(Clone, PartialEq, Debug)]
pub struct Band {
    /// The last value that holds and the first that does not.
    pub ends: (f64, f64),
    /// In words.
    pub words: String,
}

/// What is asked of chance.
#[derive(Clone, PartialEq, Debug)]
pub struct Chance {
    /// A share of failing runs that is good enough.
    pub good_enough: f64,
    /// A share that is too much.
    pub too_much: f64,
    /// Confidence of bounds and verdicts in words.
    pub confidence: String,
}

impl Mark {
    /// Every mark with its words.
    const ALL: [(Self, &'static str); 4] = [
        (Self::Holds, "holds"),
        (Self::Fails, "fails"),
        (Self::Unproven, "not proven to hold, so it fails"),
        (Self::Refused, "refused by the scenario, not run"),
    ];

    /// How it is drawn.
    const fn key(self) -> (plotters::style::RGBColor, Shape) {
        match self {
            Self::Holds => (GREEN, Shape::Dot),
            Self::Fails => (VERMILION, Shape::Square),
            Self::Unproven => (PURPLE, Shape::Square),
            Self::Refused => (GREY, Shape::Down),
        }
    }
}

impl Tolerance {
    /// Draws the picture.
    ///
    /// # Errors
    /// What the library says.
    pub fn draw(&self) -> Result<String, String> {
        let how = match &self.chance {
            Some(Chance { confidence, .. }) => {
                format!("The band of each share holds its probability at a confidence of {confidence}.")
            }
            None => "Nothing is drawn: one run of each value tells all.".to_owned(),
        };
        let subtitle = format!("Answer: {}. Expected: {}. {how}", self.answer, self.expected);
        sheet(&self.title, &subtitle, &self.footer, HEIGHT, |canvas, mut area| {
            legend(canvas, &mut area, &self.keys());
            area.top += NAME;
            let chart =
                Chart::draw(canvas, area, self.axis(), Axis::airy("runs that break an expectation [%]", 0.0, 100.0));
            self.limits(canvas, &chart);
            self.curve(canvas, &chart);
        })
    }
    fn keys(&self) -> Vec<Key> {
        let has = |mark: Mark| self.points.iter().any(|point| point.mark == mark);
        let marks = Mark::ALL.into_iter().filter(|(mark, _)| has(*mark));
        let mut keys: Vec<_> = marks
            .map(|(mark, words)| {
                let (colour, shape) = mark.key();
                Key::new(words, colour, Swatch::Mark(shape))
            })
            .collect();
        if let Some(chance) = &self.chance {
            let percent = |share: f64| super::chart::short(share * 100.0);
            keys.push(Key::new("share of failing runs", BLUE, Swatch::Line));
            keys.push(Key::new(format!("its {} confidence", chance.confidence), BLUE, Swatch::Pale));
            keys.push(Key::new(format!("{} % is good enough", percent(chance.good_enough)), GREEN, Swatch::Dashes));
            keys.push(Key::new(format!("{} % is too much", percent(chance.too_much)), VERMILION, Swatch::Dashes));
        }
        if self.band.is_some() {
            keys.push(Key::new("the answer", ORANGE, Swatch::Pale));
        }
        keys
    }
    fn axis(&self) -> Axis {
        let xs = || self.points.iter().map(|point| point.x);
        let (lo, hi) = (xs().fold(f64::INFINITY, f64::min), xs().fold(f64::NEG_INFINITY, f64::max));
        if lo > 0.0 && hi / lo >= FAR {
            Axis::logarithm(self.x.clone(), lo, hi)
        } else {
            Axis::airy(self.x.clone(), lo, hi)
        }
    }
    /// The band of the answer with its words above it, and the shares that are asked for.
    fn limits(&self, canvas: &mut Canvas<'_>, chart: &Chart) {
        let area = chart.area;
        if let Some(band) = &self.band {
            let ends = [chart.x(band.ends.0), chart.x(band.ends.1)];
            let (left, right) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
            // At least four pixels wide, or it could not be seen.
            let air = ((4 - (right - left)).max(0) + 1) / 2;
            canvas.tint(Area { left: left - air, right: right + air, ..area }, ORANGE, 0.35);
            let half = text_width(&band.words, 12) / 2 + 4;
            let middle = i32::midpoint(left, right);
            let place = middle.clamp(area.left + half, (area.right - half).max(area.left + half));
            canvas.path(&[(place, area.top - 10), (middle, area.top)], ORANGE, 1);
            canvas.text((place, area.top - 18), &band.words, Font::new(12).middle().bold());
        }
        if let Some(chance) = &self.chance {
            for (share, colour) in [(chance.good_enough, GREEN), (chance.too_much, VERMILION)] {
                let y = chart.y(share * 100.0);
                canvas.dashes((area.left, y), (area.right, y), colour);
            }
        }
    }
    fn curve(&self, canvas: &mut Canvas<'_>, chart: &Chart) {
        let run: Vec<_> = self.points.iter().filter_map(|point| Some((point, point.share?))).collect();
        let at = |x: f64, share: f64| chart.at(x, share * 100.0);
        for banded in run.chunk_by(|a, b| a.0.bounds.is_some() == b.0.bounds.is_some()) {
            let bounds: Vec<_> = banded.iter().filter_map(|(point, _)| Some((point.x, point.bounds?))).collect();
            let over = bounds.iter().map(|&(x, (_, high))| at(x, high));
            let under = bounds.iter().rev().map(|&(x, (low, _))| at(x, low));
            if bounds.len() > 1 {
                canvas.polygon(&over.chain(under).collect::<Vec<_>>(), BLUE, 0.18);
            }
        }
        let line: Vec<_> = run.iter().map(|&(point, share)| at(point.x, share)).collect();
        canvas.path(&line, if self.chance.is_some() { BLUE } else { GREY }, if self.chance.is_some() { 2 } else { 1 });
        for point in &self.points {
            let (colour, shape) = point.mark.key();
            let place = point.share.map_or((chart.x(point.x), chart.area.bottom), |share| at(point.x, share));
            canvas.marker(place, shape, 5, colour);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::all_inside_and_apart;
    use super::*;

    fn point(x: f64, share: f64, bounds: Option<(f64, f64)>, mark: Mark) -> Point {
        Point { x, share: (mark != Mark::Refused).then_some(share), bounds, mark }
    }
    fn picture(points: Vec<Point>, band: Option<(f64, f64)>, drawn: bool) -> Tolerance {
        let words = "the limit is between 0.000460000001 ms and 0.000480000001 ms".to_owned();
        let chance = Chance { good_enough: 0.01, too_much: 0.1, confidence: "95 %".to_owned() };
        Tolerance {
            title: "a scenario with a long name: how far can disturbance.12.half_width go from 100 ns towards 2 us?"
                .to_owned(),
            answer: "holds up to 0.000460000001 ms, fails from 0.000480000001 ms on".to_owned(),
            expected: ["slave.each.clock_failures == 0"; 8].join(", "),
            x: "disturbance.12.half_width [ms]".to_owned(),
            points,
            band: band.map(|ends| Band { ends, words }),
            chance: drawn.then_some(chance),
            footer: "isodp".to_owned(),
        }
    }

    #[test]
    fn everything_is_inside_and_the_answer_is_named() {
        let some = |x: f64, share: f64, mark| point(x, share, Some((share / 2.0, (share * 2.0).min(1.0))), mark);
        let rising = |flip: f64| {
            vec![
                point(flip, 0.0, None, Mark::Holds),
                some(flip + 1.0, 0.004, Mark::Holds),
                some(flip + 2.0, 0.3, Mark::Unproven),
                some(flip + 500.0, 1.0, Mark::Fails),
                point(flip + 900.0, 0.0, None, Mark::Refused),
            ]
        };
        let falling: Vec<_> = rising(5.0).into_iter().rev().collect();
        for (name, picture) in [
            ("at the left end", picture(rising(0.0), Some((1.0, 2.0)), true)),
            ("logarithmic", picture(rising(3.0), Some((4.0, 5.0)), true)),
            ("at the right end", picture(falling, Some((905.0, 904.999)), true)),
            ("one value", picture(vec![point(7.0, 1.0, None, Mark::Fails)], None, false)),
            (
                "refused",
                picture(
                    vec![point(1.0, 0.0, None, Mark::Holds), point(2.0, 0.0, None, Mark::Refused)],
                    Some((1.0, 2.0)),
                    false,
                ),
            ),
        ] {
            let text = picture.draw().unwrap();
            all_inside_and_apart(name, &text);
            let named = text.contains("the limit is between");
            assert_eq!(named, picture.band.is_some(), "{name}");
            assert_eq!(text.contains("is good enough"), picture.chance.is_some(), "{name}");
            assert_eq!(
                text.contains("refused by the scenario"),
                picture.points.iter().any(|point| point.mark == Mark::Refused)
            );
            assert_eq!(text, picture.draw().unwrap());
        }
    }
}
