//! Chart: a plot area with two axes whose labels name units and keep apart.

use plotters::style::RGBColor;

use super::distribution::{Distribution, Grid};
use super::look::{Area, Canvas, Font, GREY, INK, PALE, WHITE, spread, text_width};

const TICK: i32 = 11;
const NAME: i32 = 13;

/// How values become positions on an axis.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Scale {
    /// Evenly.
    Linear,
    /// Counts: logarithm of one plus the value, so that nothing is at zero and one is visible.
    Counts,
    /// Linear up to this magnitude, logarithmic beyond, both signs.
    Symmetric(f64),
    /// Logarithm of values above zero.
    Logarithm,
}

/// One axis.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub(super) name: String,
    pub(super) lo: f64,
    pub(super) hi: f64,
    pub(super) scale: Scale,
}

impl Axis {
    /// From `lo` to `hi` evenly; a range without extent is widened.
    pub(super) fn linear(name: impl Into<String>, lo: f64, hi: f64) -> Self {
        let (lo, hi) = if hi - lo > f64::EPSILON * lo.abs().max(hi.abs()) { (lo, hi) } else { (lo - 1.0, hi + 1.0) };
        Self { name: name.into(), lo, hi, scale: Scale::Linear }
    }
    /// The same with 5 % of air on both ends.
    pub(super) fn airy(name: impl Into<String>, lo: f64, hi: f64) -> Self {
        let axis = Self::linear(name, lo, hi);
        let air = (axis.hi - axis.lo) * 0.05;
        Self { lo: axis.lo - air, hi: axis.hi + air, ..axis }
    }
    /// Over the columns of a histogram with air on both ends, and so wide that one column alone looks narrow.
    pub(super) fn over(name: impl Into<String>, grid: &Grid) -> Self {
        const NARROW: f64 = 16.0;
        let (lo, hi) = (grid.left(0), grid.right());
        let missing = (NARROW * (grid.left(1) - lo) - (hi - lo)).max(0.0) / 2.0;
        Self::airy(name, lo - missing, hi + missing)
    }
    /// Counts from 0 to `hi`, logarithmic.
    pub(super) fn counts(name: impl Into<String>, hi: f64) -> Self {
        Self { name: name.into(), lo: 0.0, hi: hi.max(1.0) * 1.6, scale: Scale::Counts }
    }
    /// From `-hi` to `hi`, linear within `linear`.
    pub(super) fn symmetric(name: impl Into<String>, hi: f64, linear: f64) -> Self {
        let hi = hi.max(linear) * 1.3;
        Self { name: name.into(), lo: -hi, hi, scale: Scale::Symmetric(linear) }
    }

    /// From `lo` to `hi`, both above zero, logarithmic, with a little air on both ends.
    pub(super) fn logarithm(name: impl Into<String>, lo: f64, hi: f64) -> Self {
        Self { name: name.into(), lo: lo / 1.1, hi: hi * 1.1, scale: Scale::Logarithm }
    }

    fn bend(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => value,
            Scale::Logarithm => libm::log10(value.max(self.lo)),
            Scale::Counts => libm::log10(1.0 + value.max(0.0)),
            Scale::Symmetric(linear) => {
                let size = value.abs() / linear;
                let bent = if size <= 1.0 { size } else { 1.0 + libm::log10(size) };
                bent.copysign(value)
            }
        }
    }
    /// 0 at the low end, 1 at the high end, never outside.
    fn position(&self, value: f64) -> f64 {
        let (lo, hi) = (self.bend(self.lo), self.bend(self.hi));
        ((self.bend(value) - lo) / (hi - lo)).clamp(0.0, 1.0)
    }

    /// Values to be labelled, with at most `most` labels.
    fn ticks(&self, most: usize) -> Vec<(f64, String)> {
        match self.scale {
            Scale::Linear => linear_ticks(self.lo, self.hi, most),
            Scale::Logarithm => logarithmic_ticks(self.lo, self.hi, most),
            Scale::Counts => {
                let decades: Vec<f64> = decades(1.0, self.hi);
                thin(std::iter::once(0.0).chain(decades).collect(), most)
            }
            Scale::Symmetric(linear) => {
                let above = decades(linear, self.hi);
                let each = above.len().div_ceil((most / 2).max(1));
                let above: Vec<f64> = above.into_iter().step_by(each.max(1)).collect();
                let below = above.iter().rev().map(|value| -value);
                let values: Vec<f64> = below.chain([0.0]).chain(above.iter().copied()).collect();
                values.into_iter().map(|value| (value, plain(value, 0))).collect()
            }
        }
    }
}

fn decades(from: f64, to: f64) -> Vec<f64> {
    let next = |value: &f64| Some(value * 10.0);
    std::iter::successors(Some(from), next).take_while(|&value| value <= to * 1.000_001).collect()
}

/// 1, 2, 5 and 10 of every decade as far as there is room, otherwise 1 alone.
fn logarithmic_ticks(lo: f64, hi: f64, most: usize) -> Vec<(f64, String)> {
    let from = libm::floor(libm::log10(lo)) as i32;
    let values = |parts: &'static [f64]| {
        let decade = move |decade: i32| parts.iter().map(move |part| part * libm::exp10(f64::from(decade)));
        let inside = (from..from + 40).flat_map(decade).filter(|value| (lo..=hi).contains(value));
        inside.collect::<Vec<_>>()
    };
    let fitting =
        [&[1.0, 2.0, 5.0][..], &[1.0, 3.0][..]].into_iter().map(values).find(|values| values.len() <= most.max(3));
    let values = fitting.unwrap_or_else(|| values(&[1.0]));
    let each = values.len().div_ceil(most.max(2)).max(1);
    values.into_iter().step_by(each).map(|value| (value, short(value))).collect()
}

fn thin(values: Vec<f64>, most: usize) -> Vec<(f64, String)> {
    let each = values.len().div_ceil(most.max(2)).max(1);
    values.into_iter().step_by(each).map(|value| (value, plain(value, 0))).collect()
}

fn linear_ticks(lo: f64, hi: f64, most: usize) -> Vec<(f64, String)> {
    let rough = (hi - lo) / most.max(2) as f64;
    let exponent = libm::floor(libm::log10(rough));
    let unit = libm::exp10(exponent);
    let (factor, extra) = match rough / unit {
        r if r <= 1.0 => (1.0, 0),
        r if r <= 2.0 => (2.0, 0),
        r if r <= 2.5 => (2.5, 1),
        r if r <= 5.0 => (5.0, 0),
        _ => (10.0, -1),
    };
    let step = unit * factor;
    let decimals = (extra - exponent as i32).max(0) as usize;
    let first = libm::ceil(lo / step - 1e-9) as i64;
    let last = libm::floor(hi / step + 1e-9) as i64;
    (first..=last).map(|index| index as f64 * step).map(|value| (value, plain(value, decimals))).collect()
}

/// A number with `decimals` places, without a negative zero, from six digits on in groups of three.
pub(super) fn plain(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let (sign, digits) = text.strip_prefix('-').map_or(("", text.as_str()), |digits| ("-", digits));
    if digits.chars().all(|c| matches!(c, '0' | '.')) {
        return digits.to_owned();
    }
    let whole = digits.find('.').unwrap_or(digits.len());
    if whole < 6 {
        return text;
    }
    let mut grouped = String::from(sign);
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && index < whole && (whole - index).is_multiple_of(3) {
            grouped.push(' ');
        }
        grouped.push(digit);
    }
    grouped
}

/// A value in at most four digits, for labels.
pub(super) fn short(value: f64) -> String {
    let decimals = match value.abs() {
        v if v >= 1_000.0 => 0,
        v if v >= 100.0 => 1,
        v if v >= 10.0 => 2,
        _ => 3,
    };
    let text = plain(value, decimals);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A level axis under an area.
#[derive(Clone)]
pub(super) struct Ruler {
    pub(super) area: Area,
    axis: Axis,
}

impl Ruler {
    /// What a ruler takes below its area [px].
    pub(super) const HEIGHT: i32 = 2 * TICK + NAME + 8;

    /// Draws grid lines through `area`, ticks and name below it.
    pub(super) fn draw(canvas: &mut Canvas<'_>, area: Area, axis: Axis) -> Self {
        let ruler = Self { area, axis };
        for (value, label) in ruler.ticks() {
            let x = ruler.x(value);
            canvas.path(&[(x, area.top), (x, area.bottom)], PALE, 1);
            canvas.path(&[(x, area.bottom), (x, area.bottom + 4)], INK, 1);
            canvas.text((x, area.bottom + 8), &label, Font::new(TICK).middle().below());
        }
        canvas.text((area.centre().0, area.bottom + 12 + TICK), &ruler.axis.name, Font::new(NAME).middle().below());
        ruler
    }

    /// As many labels as have room.
    fn ticks(&self) -> Vec<(f64, String)> {
        let mut most = 12;
        loop {
            let ticks = self.axis.ticks(most);
            let apart = ticks.windows(2).all(|pair| {
                let half = |label: &str| text_width(label, TICK) / 2;
                self.x(pair[1].0) - self.x(pair[0].0) >= half(&pair[0].1) + half(&pair[1].1) + 12
            });
            if apart || most <= 2 {
                return ticks;
            }
            most -= 1;
        }
    }

    /// Pixel of a value.
    pub(super) fn x(&self, value: f64) -> i32 {
        self.area.left + libm::round(self.axis.position(value) * f64::from(self.area.width())) as i32
    }
}

/// A drawn chart: its plot area and how values become pixels.
pub(super) struct Chart {
    pub(super) area: Area,
    ruler: Ruler,
    y: Axis,
}

impl Chart {
    /// Draws frame, grid, ticks and names of both axes into `outer`.
    pub(super) fn draw(canvas: &mut Canvas<'_>, outer: Area, x: Axis, y: Axis) -> Self {
        let rough_rows = ((outer.height() - 50) / 34).max(2) as usize;
        let rows = y.ticks(rough_rows);
        let widest = rows.iter().map(|row| text_width(&row.1, TICK)).max().unwrap_or(0);
        let area = Area {
            left: outer.left + NAME + 10 + widest + 8,
            top: outer.top + TICK / 2,
            right: outer.right - 24,
            bottom: outer.bottom - Ruler::HEIGHT,
        };
        canvas.fill(area, WHITE);
        let chart = Self { area, ruler: Ruler::draw(canvas, area, x), y };
        for (value, label) in rows {
            let y = chart.y(value);
            canvas.path(&[(area.left, y), (area.right, y)], PALE, 1);
            canvas.text((area.left - 8, y), &label, Font::new(TICK).right());
        }
        canvas.border(area, GREY);
        let name = Font::new(NAME).middle().upwards();
        canvas.text((outer.left + NAME / 2, area.centre().1), &chart.y.name, name);
        chart
    }

    /// Part of a drawing that has its x axis already; draws nothing.
    pub(super) fn inside(area: Area, ruler: &Ruler, y: Axis) -> Self {
        Self { area, ruler: ruler.clone(), y }
    }

    /// The same with ticks and grid lines of the y axis; its name is for the caller to write.
    pub(super) fn beside(canvas: &mut Canvas<'_>, area: Area, ruler: &Ruler, y: Axis) -> Self {
        let chart = Self::inside(area, ruler, y);
        for (value, label) in chart.y.ticks((area.height() / 16).max(2) as usize) {
            let y = chart.y(value);
            canvas.path(&[(area.left, y), (area.right, y)], PALE, 1);
            canvas.text((area.left - 8, y), &label, Font::new(TICK).right());
        }
        canvas.border(area, GREY);
        chart
    }

    /// Pixel of a value of the x axis.
    pub(super) fn x(&self, value: f64) -> i32 {
        self.ruler.x(value)
    }
    /// Pixel of a value of the y axis.
    pub(super) fn y(&self, value: f64) -> i32 {
        self.area.bottom - libm::round(self.y.position(value) * f64::from(self.area.height())) as i32
    }
    /// Pixel of a pair.
    pub(super) fn at(&self, x: f64, y: f64) -> (i32, i32) {
        (self.x(x), self.y(y))
    }

    /// A band between (x, lo, hi) and its successor, as steps; each value holds until `step` later.
    pub(super) fn band(
        &self,
        canvas: &mut Canvas<'_>,
        points: &[(f64, f64, f64)],
        step: f64,
        colour: RGBColor,
        opacity: f64,
    ) {
        for run in runs(points, step) {
            // At least two pixels high, or it could not be seen.
            let air = |lo: f64, hi: f64| i32::from(self.y(lo) - self.y(hi) < 2);
            let over = run.iter().flat_map(|&(x, lo, hi)| {
                let y = self.y(hi) - air(lo, hi);
                [(self.x(x), y), (self.x(x + step), y)]
            });
            let under = run.iter().rev().flat_map(|&(x, lo, hi)| {
                let y = self.y(lo) + air(lo, hi);
                [(self.x(x + step), y), (self.x(x), y)]
            });
            let mut outline: Vec<_> = over.chain(under).collect();
            outline.dedup();
            canvas.polygon(&outline, colour, opacity);
        }
    }

    /// The outline of columns, from the first to the last that is not empty.
    pub(super) fn outline(&self, canvas: &mut Canvas<'_>, grid: &Grid, counts: &[f64], colour: RGBColor) {
        let Some(first) = counts.iter().position(|&count| count > 0.0) else { return };
        let last = counts.iter().rposition(|&count| count > 0.0).unwrap_or(first);
        let mut path = vec![self.at(grid.left(first), 0.0)];
        for (index, &count) in counts.iter().enumerate().take(last + 1).skip(first) {
            path.push(self.at(grid.left(index), count));
            path.push(self.at(grid.left(index + 1), count));
        }
        path.push(self.at(grid.left(last + 1), 0.0));
        path.dedup();
        canvas.path(&path, colour, 2);
    }

    /// Labels above the plot area for marked values of the x axis, each with a leader and a dashed line.
    pub(super) fn marks_above(&self, canvas: &mut Canvas<'_>, of: &Distribution, colour: RGBColor) {
        let mut marks: Vec<(f64, String)> =
            of.marks.iter().map(|(label, value)| (*value, format!("{label} {} {}", short(*value), of.unit))).collect();
        marks.sort_by(|a, b| a.0.total_cmp(&b.0));
        let wanted: Vec<(i32, i32)> =
            marks.iter().map(|(value, label)| (self.x(*value), text_width(label, 12) + 14)).collect();
        let places = spread(&wanted, self.area.left - 40, self.area.right + 20);
        for ((value, label), place) in marks.iter().zip(places) {
            let x = self.x(*value);
            canvas.dashes((x, self.area.top), (x, self.area.bottom), colour);
            canvas.path(&[(place, self.area.top - 22), (x, self.area.top)], colour, 1);
            canvas.text((place, self.area.top - 30), label, Font::new(12).middle().bold());
        }
    }
}

/// Pieces of neighbouring points; a hole longer than `step` divides.
fn runs(points: &[(f64, f64, f64)], step: f64) -> impl Iterator<Item = &[(f64, f64, f64)]> {
    points.chunk_by(move |a, b| b.0 - a.0 <= step * 1.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_ticks_are_round_numbers_with_the_decimals_they_need() {
        let labels = |lo, hi, most| linear_ticks(lo, hi, most).into_iter().map(|tick| tick.1).collect::<Vec<_>>();
        assert_eq!(labels(0.0, 2_000.0, 5), ["0", "500", "1000", "1500", "2000"]);
        assert_eq!(labels(-0.2, 0.3, 5), ["-0.2", "-0.1", "0.0", "0.1", "0.2", "0.3"]);
        assert_eq!(labels(0.0, 1.0, 4), ["0.00", "0.25", "0.50", "0.75", "1.00"]);
    }

    #[test]
    fn logarithmic_ticks_are_as_many_as_have_room() {
        let labels = |lo, hi, most| logarithmic_ticks(lo, hi, most).into_iter().map(|tick| tick.1).collect::<Vec<_>>();
        assert_eq!(labels(0.9, 11.0, 5), ["1", "2", "5", "10"]);
        assert_eq!(labels(90.0, 1_100.0, 3), ["100", "300", "1000"]);
        assert_eq!(labels(0.5, 200_000.0, 6), ["1", "10", "100", "1000", "10000", "100 000"]);
        let axis = Axis::logarithm("", 1.0, 100.0);
        assert!((axis.position(10.0) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_symmetric_axis_has_both_signs_and_zero_in_the_middle() {
        let axis = Axis::symmetric("", 20_000.0, 10.0);
        assert!((axis.position(0.0) - 0.5).abs() < 1e-12);
        assert!((axis.position(-500.0) + axis.position(500.0) - 1.0).abs() < 1e-12);
        let labels: Vec<_> = axis.ticks(20).into_iter().map(|tick| tick.1).collect();
        assert_eq!(labels, ["-10000", "-1000", "-100", "-10", "0", "10", "100", "1000", "10000"]);
    }

    #[test]
    fn short_numbers_have_at_most_four_digits_that_say_something() {
        for (value, text) in [(0.0, "0"), (1.5, "1.5"), (12.345, "12.35"), (123.46, "123.5"), (2_000.4, "2000")] {
            assert_eq!(short(value), text);
        }
        assert_eq!(plain(-0.001, 1), "0.0");
        assert_eq!(plain(-12_345_678.9, 1), "-12 345 678.9");
        assert_eq!(plain(12_345.0, 0), "12345");
    }
}
