//! SYNCH delay: how late SYNCH was because another master had the token, over time and as a histogram.

use super::Material;
use super::buckets::{Buckets, Envelope};
use super::chart::{Axis, Chart};
use super::look::{Area, BLUE, Key, Swatch, VERMILION, Words, counted as plural, empty_page, legend, page};
use super::t_dp_deviation::{LABELS, level_histogram};
use crate::study::row::CycleRow;
use crate::time::Span;

/// Delays over time [ticks].
#[derive(Clone, Debug)]
pub(super) struct Delays {
    over_time: Buckets<Envelope>,
    cycles: u64,
}

impl Delays {
    pub(super) fn new() -> Self {
        Self { over_time: Buckets::new(1_024), cycles: 0 }
    }
    /// Takes in one cycle.
    pub(super) fn cycle(&mut self, row: &CycleRow) {
        self.cycles = self.cycles.max(row.cycle + 1);
        if let Some(delay) = row.synch_delay {
            self.over_time.at(row.cycle).add(delay.ticks());
        }
    }
}

/// Draws `synch_delay.svg`.
pub(super) fn draw(material: &Material<'_>) -> Result<String, String> {
    let Delays { over_time, cycles } = &material.plots.delays;
    let counted = &material.distributions.synch_delay;
    let each = over_time.cycles_each();
    let shown = if each == 1 { "each of them".to_owned() } else { format!("the latest of {each} cycles") };
    let words = Words {
        title: "SYNCH delay: how late SYNCH was because the token was away",
        subtitle: format!(
            "SYNCH was late in {} of {}. Left: {shown}, over time; right: histogram, same axis.",
            counted.count,
            plural(*cycles, "cycle")
        ),
        plotted: "delay of every late SYNCH, over time and histogram",
    };
    let points: Vec<(u64, f64)> = over_time
        .iter()
        .filter_map(|(first, envelope)| Some((first, Span::from_ticks(envelope.0?.1).as_us())))
        .collect();
    if points.is_empty() {
        let why = "No SYNCH was late: the token was back in time in every cycle.";
        return empty_page(material.meta, &words, why);
    }
    let (unit, cycle) = material.meta.time_unit(*cycles);
    page(material.meta, &words, 560, |canvas, mut area| {
        let keys = [
            Key::new(format!("late SYNCH, {shown}"), BLUE, Swatch::Fill),
            Key::new("percentiles and maximum", VERMILION, Swatch::Dashes),
        ];
        legend(canvas, &mut area, &keys);
        let top = points.iter().map(|point| point.1).fold(counted.top().max(0.0), f64::max);
        // From zero, which is in time.
        let y = Axis { lo: 0.0, ..Axis::airy("SYNCH delay [us]", 0.0, top) };
        let split = area.left + (area.width() - LABELS) * 13 / 20;
        let x = Axis::linear(format!("time [{unit}]"), 0.0, *cycles as f64 * cycle);
        let chart = Chart::draw(canvas, Area { right: split, ..area }, x, y.clone());
        for (first, delay) in points {
            let left = chart.x(first as f64 * cycle).min(chart.area.right - 2);
            canvas.fill(Area { left, right: left + 2, top: chart.y(delay), bottom: chart.area.bottom }, BLUE);
        }
        let right = Area { left: split, right: area.right - LABELS, ..area };
        level_histogram(canvas, right, y, (counted, "late SYNCH (logarithmic)", "us"));
    })
}
