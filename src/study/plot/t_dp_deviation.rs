//! T_DP deviation: how much longer or shorter than T_DP each cycle was, over time and as a histogram.

use super::Material;
use super::buckets::{Buckets, Envelope};
use super::chart::{Axis, Chart, short};
use super::distribution::{Distribution, Grid};
use super::look::{
    Area, BLUE, Canvas, Font, Key, Swatch, VERMILION, Words, counted as plural, empty_page, legend, page, spread,
};
use crate::study::row::CycleRow;
use crate::time::Span;

const COLUMNS: usize = 80;
/// Room for the labels of the marks [px].
pub(super) const LABELS: i32 = 150;

/// Smallest and largest deviation over time [ticks].
#[derive(Clone, Debug)]
pub(super) struct Deviation {
    over_time: Buckets<Envelope>,
}

impl Deviation {
    pub(super) fn new() -> Self {
        Self { over_time: Buckets::new(1_024) }
    }
    /// Takes in one cycle.
    pub(super) fn cycle(&mut self, row: &CycleRow) {
        if let Some(deviation) = row.t_dp_deviation {
            self.over_time.at(row.cycle).add(deviation.ticks());
        }
    }
}

/// Draws `t_dp_deviation.svg`.
pub(super) fn draw(material: &Material<'_>) -> Result<String, String> {
    let over_time = &material.plots.deviation.over_time;
    let counted = &material.distributions.t_dp_deviation;
    let each = over_time.cycles_each();
    let shown = if each == 1 { "every cycle".to_owned() } else { format!("smallest and largest of {each} cycles") };
    let words = Words {
        title: "T_DP deviation: length of each cycle minus the nominal T_DP",
        subtitle: format!(
            "left: over time, {shown}; right: histogram of {}, same axis.",
            plural(counted.count, "cycle")
        ),
        plotted: "deviation of each cycle's length, over time and histogram",
    };
    if over_time.is_empty() {
        let why = "No deviation of T_DP was recorded: the run has fewer than two complete cycles.";
        return empty_page(material.meta, &words, why);
    }
    let (unit, cycle) = material.meta.time_unit(over_time.iter().last().map_or(1, |bucket| bucket.0 + each));
    let points: Vec<(f64, f64, f64)> = over_time
        .iter()
        .filter_map(|(first, envelope)| {
            let (lo, hi) = envelope.0?;
            Some((first as f64 * cycle, Span::from_ticks(lo).as_ns(), Span::from_ticks(hi).as_ns()))
        })
        .collect();
    page(material.meta, &words, 560, |canvas, mut area| {
        let keys = [
            Key::new(format!("deviation, {shown}"), BLUE, Swatch::Fill),
            Key::new("percentiles and extremes", VERMILION, Swatch::Dashes),
        ];
        legend(canvas, &mut area, &keys);
        let ends = points.iter().fold((0.0f64, 0.0f64), |ends, point| (ends.0.min(point.1), ends.1.max(point.2)));
        let (lo, hi) = counted.range().map_or(ends, |range| (ends.0.min(range.0), ends.1.max(range.1)));
        let y = Axis::airy("T_DP deviation [ns]", lo, hi);
        let split = area.left + (area.width() - LABELS) * 13 / 20;
        let end = points.last().map_or(cycle, |point| point.0 + cycle * each as f64);
        let x = Axis::linear(format!("time [{unit}]"), 0.0, end);
        let chart = Chart::draw(canvas, Area { right: split, ..area }, x, y.clone());
        if each == 1 {
            let line: Vec<(i32, i32)> = points.iter().map(|point| chart.at(point.0, point.1)).collect();
            canvas.path(&line, BLUE, 1);
        } else {
            chart.band(canvas, &points, cycle * each as f64, BLUE, 0.6);
        }
        let right = Area { left: split, right: area.right - LABELS, ..area };
        level_histogram(canvas, right, y, (counted, "cycles (logarithmic)", "ns"));
    })
}

/// Level columns on the same axis, with marks at the right: what was counted, the name of the other axis, the unit.
pub(super) fn level_histogram(
    canvas: &mut Canvas<'_>,
    outer: Area,
    y: Axis,
    (counted, name, unit): (&Distribution, &str, &str),
) {
    let grid = Grid::over(std::iter::once(counted), COLUMNS);
    let counts = grid.as_ref().map_or_else(Vec::new, |grid| counted.columns(grid));
    let most = counts.iter().copied().fold(0.0, f64::max);
    let chart = Chart::draw(canvas, outer, Axis::counts(name, most), y);
    if let Some(grid) = grid {
        for (index, &count) in counts.iter().enumerate().filter(|column| *column.1 > 0.0) {
            let (left, right) = (chart.area.left, chart.x(count).max(chart.area.left + 1));
            let (top, bottom) = (chart.y(grid.left(index + 1)), chart.y(grid.left(index)));
            canvas.fill(Area { left, top, right, bottom }, BLUE);
        }
    }
    let mut marks: Vec<&(String, f64)> = counted.marks.iter().rev().collect();
    marks.sort_by(|a, b| b.1.total_cmp(&a.1));
    let wanted: Vec<(i32, i32)> = marks.iter().map(|mark| (chart.y(mark.1), 18)).collect();
    let places = spread(&wanted, chart.area.top - 8, chart.area.bottom + 30);
    for ((label, value), place) in marks.into_iter().zip(places) {
        let (y, right) = (chart.y(*value), chart.area.right);
        canvas.dashes((chart.area.left, y), (right, y), VERMILION);
        canvas.path(&[(right, y), (right + 18, place)], VERMILION, 1);
        canvas.text((right + 22, place), &format!("{label} {} {unit}", short(*value)), Font::new(12).bold());
    }
}
