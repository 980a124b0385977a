//! PLL convergence: how each slave's prediction of the clock meets the clock during start-up (Model: D11, D12).

use super::Material;
use super::chart::{Axis, Chart};
use super::look::{
    Area, BLACK, BLUE, Canvas, GREY, Key, MAX_SERIES, SKY, Swatch, VERMILION, Words, counted, empty_page, legend, page,
    series,
};
use crate::observation::PllState;
use crate::study::row::SlaveRow;
use crate::time::Span;

/// Longest start-up that is shown [cycles].
const CYCLES: usize = 120;
/// What is shown after the last lock [cycles].
const AFTER_LOCK: usize = 20;
/// Errors below this are drawn linearly [ns]: five timer quanta, so that rounding does not look like a swing.
const LINEAR: f64 = 100.0;

/// One clock instant of one slave.
#[derive(Clone, Copy, Debug)]
struct Sample {
    error: Option<Span>,
    window: Span,
}

/// The first cycles of one slave after its first clock.
#[derive(Clone, Debug, Default)]
struct StartUp {
    first: Option<u64>,
    samples: Vec<Sample>,
    locked: Option<usize>,
}

impl StartUp {
    fn error(&self, cycle: usize) -> Option<f64> {
        self.samples.get(cycle)?.error.map(Span::as_ns)
    }
    fn worst(&self) -> Option<f64> {
        self.samples.iter().filter_map(|sample| sample.error).map(|error| error.abs().as_ns()).reduce(f64::max)
    }
}

/// The first start-up of every slave.
#[derive(Clone, Debug)]
pub(super) struct StartUps(Vec<StartUp>);

impl StartUps {
    pub(super) fn new(slaves: usize) -> Self {
        Self(vec![StartUp::default(); slaves])
    }
    /// Takes in one cycle of slave number `index`.
    pub(super) fn slave(&mut self, index: usize, row: &SlaveRow) {
        let start_up = &mut self.0[index];
        let Some(window) = row.window else { return };
        let first = *start_up.first.get_or_insert(row.cycle);
        let cycle = (row.cycle - first) as usize;
        // A slave whose clock recovery rests in between leaves a hole, which ends what can be called one start-up.
        if cycle >= CYCLES || cycle != start_up.samples.len() {
            return;
        }
        start_up.samples.push(Sample { error: row.pll_error, window });
        if row.pll == PllState::Locked && start_up.locked.is_none() {
            start_up.locked = Some(cycle);
        }
    }
    /// Cycles to show.
    fn cycles(&self) -> usize {
        let recorded = self.0.iter().map(|start_up| start_up.samples.len()).max().unwrap_or(0);
        let started = || self.0.iter().filter(|start_up| start_up.first.is_some());
        let last = started().map(|start_up| start_up.locked.unwrap_or(CYCLES)).max().unwrap_or(0);
        recorded.min(last + AFTER_LOCK)
    }
}

/// Draws `pll_convergence.svg`.
pub(super) fn draw(material: &Material<'_>) -> Result<String, String> {
    let start_ups = &material.plots.pll;
    let cycles = start_ups.cycles();
    let started = start_ups.0.iter().filter(|start_up| start_up.first.is_some()).count();
    let locked = start_ups.0.iter().filter(|start_up| start_up.locked.is_some()).count();
    let many = started > MAX_SERIES;
    let how = if many {
        "Too many slaves to tell apart: range over all slaves, their median, and the slave with the largest error."
    } else {
        "One line per slave."
    };
    let words = Words {
        title: "PLL convergence: arrival of SYNCH minus its prediction during start-up, and the clock window",
        subtitle: format!(
            "{started} of {} started the clock recovery, {locked} locked. First {}, counted from \
             each slave's own first clock. {how} Above ±{LINEAR} ns the axis is logarithmic.",
            counted(material.meta.slaves.len() as u64, "slave"),
            counted(cycles as u64, "cycle"),
        ),
        plotted: "PLL error and window of each slave's first start-up",
    };
    if started == 0 {
        return empty_page(material.meta, &words, "No slave started its clock recovery: none reached phase 2.");
    }
    let keys = if many { keys_of_many(material) } else { keys_of_each(material) };
    page(material.meta, &words, 640, |canvas, mut area| {
        legend(canvas, &mut area, &keys);
        let highest = largest(&start_ups.0, cycles);
        let x = Axis::linear("cycles since the slave's first clock", 0.0, cycles as f64);
        let y = Axis::symmetric("error and window [ns]", highest, LINEAR);
        let chart = Chart::draw(canvas, Area { top: area.top + 4, ..area }, x, y);
        windows(canvas, &chart, &start_ups.0, cycles);
        if many {
            draw_many(canvas, &chart, &start_ups.0, cycles);
        } else {
            draw_each(canvas, &chart, &start_ups.0, cycles);
        }
    })
}

fn largest(start_ups: &[StartUp], cycles: usize) -> f64 {
    let samples = start_ups.iter().flat_map(|start_up| start_up.samples.iter().take(cycles));
    let sizes = samples.map(|sample| sample.window.as_ns().max(sample.error.map_or(0.0, |error| error.abs().as_ns())));
    sizes.fold(0.0, f64::max)
}

fn lock_text(start_up: &StartUp) -> String {
    start_up.locked.map_or_else(|| "not locked".to_owned(), |cycle| format!("locked at {cycle}"))
}

fn keys_of_each(material: &Material<'_>) -> Vec<Key> {
    let slaves = material.meta.slaves.iter().zip(&material.plots.pll.0);
    let started = slaves.filter(|(_, start_up)| start_up.first.is_some()).enumerate();
    let lines = started.map(|(index, (slave, start_up))| {
        let (colour, shape) = series(index);
        Key::new(format!("slave {slave}, {}", lock_text(start_up)), colour, Swatch::LineMark(shape))
    });
    let common =
        [Key::new("± window, widest slave", GREY, Swatch::Pale), Key::new("cycle of the lock", BLACK, Swatch::Ring)];
    lines.chain(common).collect()
}

fn worst(start_ups: &[StartUp]) -> Option<usize> {
    let errors = start_ups.iter().enumerate().filter_map(|(index, start_up)| Some((index, start_up.worst()?)));
    errors
        .fold(None, |worst: Option<(usize, f64)>, one| match worst {
            Some(before) if before.1 >= one.1 => Some(before),
            _ => Some(one),
        })
        .map(|worst| worst.0)
}

fn lock_range(start_ups: &[StartUp]) -> Option<(usize, usize)> {
    let locks = || start_ups.iter().filter_map(|start_up| start_up.locked);
    Some((locks().min()?, locks().max()?))
}

fn keys_of_many(material: &Material<'_>) -> Vec<Key> {
    let start_ups = &material.plots.pll.0;
    let mut keys = vec![
        Key::new("error, range over all slaves", SKY, Swatch::Fill),
        Key::new("error, median", BLUE, Swatch::Line),
        Key::new("± window, widest slave", GREY, Swatch::Pale),
    ];
    if let Some(index) = worst(start_ups) {
        let slave = material.meta.slaves[index];
        let label = format!("slave {slave}, largest error, {}", lock_text(&start_ups[index]));
        keys.push(Key::new(label, VERMILION, Swatch::LineMark(series(0).1)));
    }
    if let Some((first, last)) = lock_range(start_ups) {
        keys.push(Key::new(format!("first lock at {first}, last at {last}"), BLACK, Swatch::Dashes));
    }
    keys
}

/// The band between plus and minus the widest window.
fn windows(canvas: &mut Canvas<'_>, chart: &Chart, start_ups: &[StartUp], cycles: usize) {
    let widest = |cycle: usize| {
        let windows = start_ups.iter().filter_map(|start_up| start_up.samples.get(cycle));
        windows.map(|sample| sample.window.as_ns()).reduce(f64::max)
    };
    let points: Vec<(f64, f64, f64)> =
        (0..cycles).filter_map(|cycle| widest(cycle).map(|window| (cycle as f64, -window, window))).collect();
    let outline = |sign: f64| -> Vec<(i32, i32)> {
        points.iter().flat_map(|p| [chart.at(p.0, sign * p.2), chart.at(p.0 + 1.0, sign * p.2)]).collect()
    };
    let (upper, lower) = (outline(1.0), outline(-1.0));
    let around: Vec<(i32, i32)> = upper.iter().copied().chain(lower.iter().rev().copied()).collect();
    canvas.polygon(&around, GREY, 0.15);
    canvas.path(&upper, GREY, 1);
    canvas.path(&lower, GREY, 1);
}

fn draw_each(canvas: &mut Canvas<'_>, chart: &Chart, start_ups: &[StartUp], cycles: usize) {
    let started = start_ups.iter().filter(|start_up| start_up.first.is_some());
    for (index, start_up) in started.enumerate() {
        line(canvas, chart, start_up, cycles, index);
    }
}

fn line(canvas: &mut Canvas<'_>, chart: &Chart, start_up: &StartUp, cycles: usize, index: usize) {
    let (colour, shape) = series(index);
    let point = |cycle: usize| start_up.error(cycle).map(|error| chart.at(cycle as f64 + 0.5, error));
    let points: Vec<(i32, i32)> = (0..cycles).filter_map(point).collect();
    canvas.path(&points, colour, 1);
    for &at in &points {
        canvas.marker(at, shape, 3, colour);
    }
    if let Some(at) = start_up.locked.filter(|&cycle| cycle < cycles).and_then(point) {
        canvas.ring(at, 7, colour);
    }
}

fn draw_many(canvas: &mut Canvas<'_>, chart: &Chart, start_ups: &[StartUp], cycles: usize) {
    let mut band = Vec::new();
    let mut median = Vec::new();
    for cycle in 0..cycles {
        let mut errors: Vec<f64> = start_ups.iter().filter_map(|start_up| start_up.error(cycle)).collect();
        errors.sort_by(f64::total_cmp);
        if let [lo, .., hi] | [lo @ hi] = errors[..] {
            band.push((cycle as f64, lo, hi));
            median.push(chart.at(cycle as f64 + 0.5, errors[errors.len() / 2]));
        }
    }
    chart.band(canvas, &band, 1.0, SKY, 0.7);
    canvas.path(&median, BLUE, 2);
    if let Some(index) = worst(start_ups) {
        let points: Vec<(i32, i32)> = (0..cycles)
            .filter_map(|cycle| start_ups[index].error(cycle).map(|error| chart.at(cycle as f64 + 0.5, error)))
            .collect();
        canvas.path(&points, VERMILION, 1);
        for &at in &points {
            canvas.marker(at, series(0).1, 3, VERMILION);
        }
    }
    if let Some((first, last)) = lock_range(start_ups) {
        for cycle in [first, last].into_iter().filter(|&cycle| cycle < cycles) {
            let x = chart.x(cycle as f64 + 0.5);
            canvas.dashes((x, chart.area.top), (x, chart.area.bottom), BLACK);
        }
    }
}
