//! Position: `G1_XIST1` of each slave over time.

use plotters::style::RGBColor;

use super::buckets::{Buckets, Envelope};
use super::chart::{Axis, Chart, Ruler, plain};
use super::lanes::Lanes;
use super::look::{
    Area, BLUE, Canvas, Font, Key, MAX_SERIES, PALE, Swatch, WIDTH, Words, counted, empty_page, legend, legend_height,
    page,
};
use super::{Material, PlotMeta};
use crate::study::row::SlaveRow;

/// Height of the lane of a slave [px].
const LANE: i32 = 64;
/// Room for the ends of a lane's scale [px].
const ENDS: i32 = 100;
/// Columns of the heat strips.
const COLUMNS: usize = 128;
/// Shades of the heat strips.
const SHADES: usize = 8;

/// Smallest and largest position over time per slave [steps].
#[derive(Clone, Debug)]
pub(super) struct Positions(Vec<Buckets<Envelope>>);

impl Positions {
    pub(super) fn new(slaves: usize) -> Self {
        Self(vec![Buckets::new(512); slaves])
    }
    /// Takes in one cycle of slave number `index`.
    pub(super) fn slave(&mut self, index: usize, row: &SlaveRow) {
        if row.latch_offset.is_some() {
            self.0[index].at(row.cycle).add(i64::from(row.xist1));
        }
    }
}

/// One slave with at least one position, as (cycle, smallest, largest).
struct Track {
    name: String,
    each: u64,
    points: Vec<(u64, f64, f64)>,
}

impl Track {
    /// The points with their time instead of their cycle.
    fn scaled(&self, cycle: f64) -> Vec<(f64, f64, f64)> {
        self.points.iter().map(|&(first, lo, hi)| (first as f64 * cycle, lo, hi)).collect()
    }
}

fn tracks(material: &Material<'_>) -> Vec<Track> {
    let all = material.meta.slaves.iter().zip(&material.plots.position.0);
    let filled = all.filter(|(_, buckets)| !buckets.is_empty());
    filled
        .map(|(slave, buckets)| Track {
            name: format!("slave {slave}"),
            each: buckets.cycles_each(),
            points: buckets
                .iter()
                .filter_map(|(first, envelope)| envelope.0.map(|(lo, hi)| (first, lo as f64, hi as f64)))
                .collect(),
        })
        .collect()
}

/// Draws `position.svg`.
pub(super) fn draw(material: &Material<'_>) -> Result<String, String> {
    let tracks = tracks(material);
    let cycles = tracks.iter().filter_map(|track| Some(track.points.last()?.0 + track.each)).max().unwrap_or(0);
    let each = tracks.iter().map(|track| track.each).max().unwrap_or(1);
    let many = tracks.len() > MAX_SERIES;
    let how = if many {
        "Too many slaves to tell apart: one strip per slave, the darker the higher its position."
    } else if each > 1 {
        "Bands from the smallest to the largest value of each piece of time."
    } else {
        "Every cycle."
    };
    let words = Words {
        title: "Position: G1_XIST1 as latched by each slave with a locked clock",
        subtitle: format!("{} of {}. {how}", tracks.len(), counted(material.meta.slaves.len() as u64, "slave")),
        plotted: "latched G1_XIST1 over time",
    };
    if tracks.is_empty() {
        return empty_page(material.meta, &words, "No position was recorded: no slave latched with a locked clock.");
    }
    let (lo, hi) = tracks
        .iter()
        .flat_map(|track| &track.points)
        .fold((f64::MAX, f64::MIN), |ends, point| (ends.0.min(point.1), ends.1.max(point.2)));
    if many {
        return strips(material.meta, &words, &tracks, cycles, (lo, hi));
    }
    let (unit, cycle) = material.meta.time_unit(cycles);
    let x = Axis::linear(format!("time [{unit}]"), 0.0, cycles as f64 * cycle);
    if let [track] = &tracks[..] {
        return page(material.meta, &words, 560, |canvas, mut area| {
            legend(canvas, &mut area, &[Key::new(&track.name, BLUE, Swatch::Fill)]);
            let chart = Chart::draw(canvas, area, x, Axis::airy("G1_XIST1 [steps]", lo, hi));
            chart.band(canvas, &track.scaled(cycle), track.each as f64 * cycle, BLUE, 0.5);
        });
    }
    page(material.meta, &words, LANE * tracks.len() as i32 + Ruler::HEIGHT + 34, |canvas, mut area| {
        let key = format!("G1_XIST1 [steps], every lane from {} to {}", plain(lo, 0), plain(hi, 0));
        legend(canvas, &mut area, &[Key::new(key, BLUE, Swatch::Fill)]);
        lanes(canvas, area, &tracks, &x, (lo, hi), cycle);
    })
}

/// One band below the other, all on the same scale.
fn lanes(canvas: &mut Canvas<'_>, area: Area, tracks: &[Track], x: &Axis, (lo, hi): (f64, f64), cycle: f64) {
    let bottom = area.top + LANE * tracks.len() as i32;
    let plot = Area { left: area.left + Lanes::NAMES, top: area.top, right: area.right - ENDS, bottom };
    let ruler = Ruler::draw(canvas, plot, x.clone());
    let y = Axis::linear("", lo, hi);
    for (index, track) in tracks.iter().enumerate() {
        let top = plot.top + LANE * index as i32;
        let place = Area { top: top + 3, bottom: top + LANE - 6, ..plot };
        canvas.border(place, PALE);
        canvas.text((plot.left - 8, place.centre().1), &track.name, Font::new(12).right());
        canvas.text((plot.right + 8, place.top + 5), &plain(y.hi, 0), Font::new(10));
        canvas.text((plot.right + 8, place.bottom - 5), &plain(y.lo, 0), Font::new(10));
        let chart = Chart::inside(place, &ruler, y.clone());
        chart.band(canvas, &track.scaled(cycle), track.each as f64 * cycle, BLUE, 0.6);
    }
}

/// From white to blue.
fn shade(level: usize) -> RGBColor {
    let mix = |from: u8, to: u8| {
        let (from, to) = (usize::from(from), usize::from(to));
        ((from * (SHADES - 1 - level) + to * level) / (SHADES - 1)) as u8
    };
    RGBColor(mix(0xE8, 0x08), mix(0xF1, 0x30), mix(0xFA, 0x6B))
}

fn strips(
    meta: &PlotMeta,
    words: &Words<'_>,
    tracks: &[Track],
    cycles: u64,
    (lo, hi): (f64, f64),
) -> Result<String, String> {
    let (unit, cycle) = meta.time_unit(cycles);
    let step = ((hi - lo) / SHADES as f64).max(1.0);
    let keys: Vec<Key> = (0..SHADES)
        .map(|level| {
            let from = lo + step * level as f64;
            Key::new(format!("{} to {} steps", plain(from, 0), plain(from + step, 0)), shade(level), Swatch::Fill)
        })
        .collect();
    let lanes_height = Lanes::each(tracks.len()) * tracks.len() as i32;
    let width = WIDTH;
    let height = legend_height(&keys, width - 40) + lanes_height + Ruler::HEIGHT + 10;
    page(meta, words, height, |canvas, mut area| {
        legend(canvas, &mut area, &keys);
        let left = area.left + Lanes::NAMES;
        let lanes = Lanes::new(tracks.len(), area.top, left, area.right - 24);
        let plot = Area { left, right: area.right - 24, bottom: area.top + lanes_height, ..area };
        let axis = Axis::linear(format!("time [{unit}], shade: G1_XIST1 [steps]"), 0.0, cycles as f64 * cycle);
        let ruler = Ruler::draw(canvas, plot, axis);
        for (index, track) in tracks.iter().enumerate() {
            lanes.ground(canvas, index);
            lanes.name(canvas, index, left, &track.name);
            strip(canvas, &ruler, lanes.lane(index), track, |value| ((value - lo) / step) as usize, cycle);
        }
    })
}

/// One strip: the mean of smallest and largest of each column, neighbours of one shade in one piece.
fn strip(canvas: &mut Canvas<'_>, ruler: &Ruler, lane: Area, track: &Track, level: impl Fn(f64) -> usize, cycle: f64) {
    let each = track.points.len().div_ceil(COLUMNS).max(1);
    let cells: Vec<(u64, u64, usize)> = track
        .points
        .chunks(each)
        .map(|points| {
            let lo = points.iter().map(|p| p.1).fold(f64::MAX, f64::min);
            let hi = points.iter().map(|p| p.2).fold(f64::MIN, f64::max);
            let level = level(f64::midpoint(lo, hi)).min(SHADES - 1);
            (points[0].0, points[points.len() - 1].0 + track.each, level)
        })
        .collect();
    for piece in cells.chunk_by(|a, b| a.2 == b.2 && a.1 == b.0) {
        let (from, to) = (piece[0].0, piece[piece.len() - 1].1);
        let (left, right) = (ruler.x(from as f64 * cycle), ruler.x(to as f64 * cycle));
        canvas.fill(Area { left, right, ..lane }, shade(piece[0].2));
    }
}
