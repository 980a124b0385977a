//! Heat: a figure over two parameters, as the colour of a cell each; where runs fail is outlined.

use plotters::style::RGBColor;

use super::{Parameter, Sheet, ends};
use crate::study::plot::chart::short;
use crate::study::plot::look::{
    Area, Canvas, FAINT, Font, GREY, INK, Key, Swatch, VERMILION, WHITE, fit, legend, sheet, text_width,
};

/// Height of the cells with their labels [px].
const HEIGHT: i32 = 640;
/// Space for the names of the rows [px].
const LEFT: i32 = 150;
/// Space for the scale of colours [px].
const RIGHT: i32 = 150;
/// Space for the names of the columns [px].
const BELOW: i32 = 54;
const SIZE: i32 = 12;

/// Colours from the smallest to the largest value: lighter is less, for every kind of colour blindness and on grey paper
/// (after viridis, turned round).
const SCALE: [RGBColor; 6] = [
    RGBColor(0xFD, 0xE7, 0x25),
    RGBColor(0x7A, 0xD1, 0x51),
    RGBColor(0x22, 0xA8, 0x84),
    RGBColor(0x2A, 0x78, 0x8E),
    RGBColor(0x41, 0x44, 0x87),
    RGBColor(0x44, 0x01, 0x54),
];

/// A figure over two parameters.
#[derive(Clone, PartialEq, Debug)]
pub struct Heat {
    /// The words.
    pub sheet: Sheet,
    /// From left to right.
    pub x: Parameter,
    /// From bottom to top.
    pub y: Parameter,
    /// What failing means, in words.
    pub fails: String,
    /// Row by row from the bottom; none where nothing was run or nothing is to be told.
    pub cells: Vec<Option<Cell>>,
}

/// One combination.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Cell {
    /// The mean of all repetitions; none if no run has a value.
    pub mean: Option<f64>,
    /// Whether a run failed.
    pub fails: bool,
}

impl Heat {
    /// Draws the picture.
    ///
    /// # Errors
    /// What the library says.
    pub fn draw(&self) -> Result<String, String> {
        let title = format!("{} over {} and {}", self.sheet.figure, self.x.name, self.y.name);
        let fails = self.cells.iter().flatten().any(|cell| cell.fails);
        let outlined = if fails { format!(" Outlined: {}.", self.fails) } else { String::new() };
        let subtitle = format!(
            "Sweep {}: mean of the repetitions of each combination; empty cells were not run.{outlined}",
            self.sheet.sweep
        );
        let footer = self.sheet.footer("mean per combination");
        sheet(&title, &subtitle, &footer, HEIGHT, |canvas, mut area| {
            if fails {
                legend(canvas, &mut area, &[Key::new(self.fails.clone(), VERMILION, Swatch::Line)]);
            }
            let inner = Area { left: area.left + LEFT, right: area.right - RIGHT, bottom: area.bottom - BELOW, ..area };
            let (lo, hi) = ends(self.cells.iter().flatten().filter_map(|cell| cell.mean));
            self.fill(canvas, inner, (lo, hi));
            self.outline(canvas, inner);
            self.names(canvas, inner);
            self.scale(canvas, Area { left: area.right - RIGHT + 40, ..inner }, (lo, hi));
        })
    }

    fn columns(&self) -> usize {
        self.x.labels.len()
    }
    fn rows(&self) -> usize {
        self.y.labels.len()
    }
    /// The cell of this column and row, counted from the bottom.
    fn area(&self, inner: Area, column: usize, row: usize) -> Area {
        let part =
            |length: i32, number: usize, of: usize| (i64::from(length) * number as i64 / of.max(1) as i64) as i32;
        let x = |column| inner.left + part(inner.width(), column, self.columns());
        let y = |row| inner.bottom - part(inner.height(), row, self.rows());
        Area { left: x(column), right: x(column + 1), top: y(row + 1), bottom: y(row) }
    }
    fn cell(&self, column: usize, row: usize) -> Option<&Cell> {
        self.cells.get(row * self.columns() + column)?.as_ref()
    }
    fn fill(&self, canvas: &mut Canvas<'_>, inner: Area, (lo, hi): (f64, f64)) {
        canvas.fill(inner, FAINT);
        for (row, column) in (0..self.rows()).flat_map(|row| (0..self.columns()).map(move |column| (row, column))) {
            let Some(mean) = self.cell(column, row).and_then(|cell| cell.mean) else { continue };
            let area = self.area(inner, column, row);
            let share = if hi > lo { (mean - lo) / (hi - lo) } else { 0.0 };
            canvas.fill(area, colour(share));
            let text = short(mean);
            if text_width(&text, SIZE) + 4 <= area.width() && area.height() > SIZE + 4 {
                let ink = if share > 0.45 { WHITE } else { INK };
                canvas.text(area.centre(), &text, Font::new(SIZE).middle().ink(ink));
            }
        }
        canvas.border(inner, GREY);
    }
    /// Lines between cells that fail and others.
    fn outline(&self, canvas: &mut Canvas<'_>, inner: Area) {
        let fails = |column: i64, row: i64| {
            let inside = column >= 0 && row >= 0 && column < self.columns() as i64;
            inside && self.cell(column as usize, row as usize).is_some_and(|cell| cell.fails)
        };
        for (row, column) in (0..self.rows()).flat_map(|row| (0..self.columns()).map(move |column| (row, column))) {
            let (x, y) = (column as i64, row as i64);
            if !fails(x, y) {
                continue;
            }
            let Area { left, top, right, bottom } = self.area(inner, column, row);
            let edges = [
                (fails(x - 1, y), [(left, top), (left, bottom)]),
                (fails(x + 1, y), [(right, top), (right, bottom)]),
                (fails(x, y - 1), [(left, bottom), (right, bottom)]),
                (fails(x, y + 1), [(left, top), (right, top)]),
            ];
            for (_, edge) in edges.into_iter().filter(|(same, _)| !same) {
                canvas.path(&edge, WHITE, 6);
                canvas.path(&edge, VERMILION, 3);
            }
        }
    }
    /// Labels of as many columns and rows as have room, and the names of both axes.
    fn names(&self, canvas: &mut Canvas<'_>, inner: Area) {
        let widest = self.x.labels.iter().map(|label| text_width(label, SIZE) + 10).max().unwrap_or(1);
        let most = (inner.width() / widest.min(inner.width()).max(1)).max(1) as usize;
        for column in (0..self.columns()).step_by(self.columns().div_ceil(most).max(1)) {
            let area = self.area(inner, column, 0);
            canvas.text((area.centre().0, inner.bottom + 8), &self.x.labels[column], Font::new(SIZE).middle().below());
        }
        let most = (inner.height() / (SIZE + 6)).max(1) as usize;
        for row in (0..self.rows()).step_by(self.rows().div_ceil(most).max(1)) {
            let area = self.area(inner, 0, row);
            let label = fit(&self.y.labels[row], SIZE, LEFT - 40);
            canvas.text((inner.left - 8, area.centre().1), &label, Font::new(SIZE).right());
        }
        let (x, y) = inner.centre();
        canvas.text((x, inner.bottom + 30), &self.x.name, Font::new(SIZE + 1).middle().below());
        canvas.text((inner.left - LEFT + 12, y), &self.y.name, Font::new(SIZE + 1).middle().upwards());
    }
    /// The scale of colours with its numbers.
    fn scale(&self, canvas: &mut Canvas<'_>, area: Area, (lo, hi): (f64, f64)) {
        const STEPS: i32 = 60;
        let bar = Area { right: area.left + 22, ..area };
        for step in 0..STEPS {
            let y = |step: i32| bar.bottom - bar.height() * step / STEPS;
            let share = f64::from(step) / f64::from(STEPS - 1);
            canvas.fill(Area { top: y(step + 1), bottom: y(step), ..bar }, colour(share));
        }
        canvas.border(bar, GREY);
        for quarter in 0..=4 {
            let y = bar.bottom - bar.height() * quarter / 4;
            let value = lo + (hi - lo) * f64::from(quarter) / 4.0;
            canvas.text((bar.right + 6, y), &short(value), Font::new(SIZE));
        }
        let name = Font::new(SIZE).middle().upwards();
        canvas.text((bar.left - 14, bar.centre().1), &self.sheet.axis(), name);
    }
}

/// The colour at `share` of the scale, 0 ..= 1.
fn colour(share: f64) -> RGBColor {
    let place = share.clamp(0.0, 1.0) * (SCALE.len() - 1) as f64;
    let (first, part) = ((place as usize).min(SCALE.len() - 2), place - (place as usize).min(SCALE.len() - 2) as f64);
    let mix = |a: u8, b: u8| libm::round(f64::from(a) + (f64::from(b) - f64::from(a)) * part) as u8;
    let (a, b) = (SCALE[first], SCALE[first + 1]);
    RGBColor(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_grow_darker() {
        let light = |share| {
            let RGBColor(r, g, b) = colour(share);
            0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b)
        };
        let all: Vec<_> = (0..=20).map(|step| light(f64::from(step) / 20.0)).collect();
        assert!(all.windows(2).all(|pair| pair[0] > pair[1]), "{all:?}");
        assert_eq!((colour(0.0), colour(1.0)), (SCALE[0], SCALE[5]));
    }
}
