//! Futures: latch skew and PLL error of two futures of one run over the cycles, with the point where they part.

use super::buckets::{Buckets, Envelope};
use super::chart::{Axis, Chart};
use super::look::{Area, BLACK, BLUE, Canvas, Key, Swatch, VERMILION, Words, empty_page, legend, page};
use super::{PlotError, PlotMeta};
use crate::study::row::{CycleRow, Sink, SlaveRow};
use crate::time::Span;

/// Name of the file.
pub const FILE: &str = "what_if.svg";
/// Columns of a picture.
const COLUMNS: usize = 1_024;
/// Height of one of the two charts [px].
const HEIGHT: i32 = 320;

/// What is drawn of one future, in memory that does not grow with the number of cycles.
#[derive(Clone, Debug)]
pub struct Course {
    /// The first cycle that is drawn.
    first: u64,
    skew: Buckets<Envelope>,
    error: Buckets<Envelope>,
}

impl Course {
    /// Nothing yet, from cycle `first` on.
    pub fn new(first: u64) -> Self {
        Self { first, skew: Buckets::new(COLUMNS), error: Buckets::new(COLUMNS) }
    }
}

impl Sink for Course {
    fn cycle(&mut self, row: &CycleRow) {
        if let (Some(skew), Some(cycle)) = (row.latch_skew, row.cycle.checked_sub(self.first)) {
            self.skew.at(cycle).add(skew.ticks());
        }
    }
    fn slave(&mut self, row: &SlaveRow) {
        if let (Some(error), Some(cycle)) = (row.pll_error, row.cycle.checked_sub(self.first)) {
            self.error.at(cycle).add(error.ticks());
        }
    }
}

/// A series: cycle, smallest and largest value \[ns\].
type Points = Vec<(f64, f64, f64)>;

/// The points of a series, and for how many cycles each stands.
fn points(first: u64, buckets: &Buckets<Envelope>) -> (Points, f64) {
    let ns = |ticks| Span::from_ticks(ticks).as_ns();
    let point = |(cycle, envelope): (u64, &Envelope)| {
        let (lo, hi) = envelope.0?;
        Some(((first + cycle) as f64, ns(lo), ns(hi)))
    };
    (buckets.iter().filter_map(point).collect(), buckets.cycles_each() as f64)
}

/// Draws the original and the other future, which part when cycle `parting` begins.
///
/// # Errors
/// The picture cannot be drawn.
pub fn draw(meta: &PlotMeta, parting: u64, courses: [&Course; 2]) -> Result<String, PlotError> {
    let words = Words {
        title: "What if: two futures of one run",
        subtitle: format!(
            "original and altered part when cycle {parting} begins. Above: latch skew per cycle; below: PLL error, smallest to \
             largest over the slaves."
        ),
        plotted: "latch skew and PLL error of both futures over the cycles",
    };
    let series = |of: fn(&Course) -> &Buckets<Envelope>| courses.map(|course| points(course.first, of(course)));
    let charts =
        [("latch skew [ns]", series(|course| &course.skew)), ("PLL error [ns]", series(|course| &course.error))];
    let all = || charts.iter().flat_map(|(_, both)| both).flat_map(|(points, _)| points);
    let drawn = if all().next().is_none() {
        empty_page(meta, &words, "No slave was clocked in these cycles: there is no latch skew and no PLL error.")
    } else {
        let first = all().map(|point| point.0).fold(f64::INFINITY, f64::min);
        let last = all().map(|point| point.0).fold(first, f64::max) + 1.0;
        page(meta, &words, 2 * HEIGHT + 40, |canvas, mut area| {
            let keys = [
                Key::new("original", BLUE, Swatch::Fill),
                Key::new("altered", VERMILION, Swatch::Fill),
                Key::new(format!("they part, cycle {parting}"), BLACK, Swatch::Dashes),
            ];
            legend(canvas, &mut area, &keys);
            for (index, (name, both)) in charts.iter().enumerate() {
                let top = area.top + index as i32 * HEIGHT;
                let outer = Area { top, bottom: top + HEIGHT, ..area };
                chart(canvas, outer, (name, (first, last), parting as f64), both);
            }
        })
    };
    drawn.map_err(|reason| PlotError { file: FILE, reason })
}

/// One of the two charts.
fn chart(
    canvas: &mut Canvas<'_>,
    outer: Area,
    (name, (first, last), parting): (&str, (f64, f64), f64),
    both: &[(Points, f64); 2],
) {
    let values = both.iter().flat_map(|(points, _)| points);
    let (lo, hi) = values.fold((0.0f64, 0.0f64), |(lo, hi), point| (lo.min(point.1), hi.max(point.2)));
    let chart = Chart::draw(canvas, outer, Axis::linear("cycle", first, last), Axis::airy(name, lo, hi));
    for ((points, each), colour) in both.iter().zip([BLUE, VERMILION]) {
        chart.band(canvas, points, *each, colour, 0.55);
    }
    let x = chart.x(parting);
    canvas.dashes((x, chart.area.top), (x, chart.area.bottom), BLACK);
}
