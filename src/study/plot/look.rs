//! Look: what all pictures share. Palette, fonts, page with title, subtitle and footer, legend.
//!
//! There is no font library behind an SVG, so the width of a text is estimated from a table that is wider than the
//! usual sans-serif fonts. Everything is laid out with this estimate; that keeps texts apart on any machine.

use plotters::backend::DrawingBackend;
use plotters::backend::SVGBackend;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontFamily, FontStyle, FontTransform, IntoFont, RGBAColor, RGBColor, ShapeStyle};

use super::PlotMeta;

/// Width of every picture [px].
pub(super) const WIDTH: i32 = 1_400;
/// Free space around everything [px].
const MARGIN: i32 = 20;
/// Height of one line of the legend [px].
const LEGEND_ROW: i32 = 20;

/// Text and axes.
pub(super) const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
/// Secondary text, leaders.
pub(super) const GREY: RGBColor = RGBColor(0x66, 0x66, 0x66);
/// Grid lines and borders.
pub(super) const PALE: RGBColor = RGBColor(0xDD, 0xDD, 0xDD);
/// Empty lanes.
pub(super) const FAINT: RGBColor = RGBColor(0xF3, 0xF3, 0xF3);
/// A lamp without light.
const UNLIT: RGBColor = RGBColor(0xD9, 0xD9, 0xD9);
/// Width of the stripes of a flashing lamp [px].
const STRIPE: i32 = 4;
/// Paper.
pub(super) const WHITE: RGBColor = RGBColor(0xFF, 0xFF, 0xFF);

// Seven colours that stay apart in every kind of colour blindness (Okabe and Ito, Color Universal Design).
/// Blue.
pub(super) const BLUE: RGBColor = RGBColor(0x00, 0x72, 0xB2);
/// Vermilion.
pub(super) const VERMILION: RGBColor = RGBColor(0xD5, 0x5E, 0x00);
/// Bluish green.
pub(super) const GREEN: RGBColor = RGBColor(0x00, 0x9E, 0x73);
/// Reddish purple.
pub(super) const PURPLE: RGBColor = RGBColor(0xCC, 0x79, 0xA7);
/// Orange.
pub(super) const ORANGE: RGBColor = RGBColor(0xE6, 0x9F, 0x00);
/// Sky blue.
pub(super) const SKY: RGBColor = RGBColor(0x56, 0xB4, 0xE9);
/// Black.
pub(super) const BLACK: RGBColor = RGBColor(0x00, 0x00, 0x00);

const SERIES: [RGBColor; 7] = [BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK];

/// Most series that one chart shows one by one; beyond, a picture collapses them and says so.
pub(super) const MAX_SERIES: usize = 10;

/// Colour and marker of series `index`: no two of the first fourteen agree in both.
pub(super) fn series(index: usize) -> (RGBColor, Shape) {
    let shape = if (index / SERIES.len()).is_multiple_of(2) { Shape::Dot } else { Shape::Square };
    (SERIES[index % SERIES.len()], shape)
}

/// A marker.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Shape {
    Dot,
    Square,
    Up,
    Down,
}

/// A rectangle of the picture [px].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Area {
    pub(super) left: i32,
    pub(super) top: i32,
    pub(super) right: i32,
    pub(super) bottom: i32,
}

impl Area {
    pub(super) const fn width(&self) -> i32 {
        self.right - self.left
    }
    pub(super) const fn height(&self) -> i32 {
        self.bottom - self.top
    }
    pub(super) const fn centre(&self) -> (i32, i32) {
        (i32::midpoint(self.left, self.right), i32::midpoint(self.top, self.bottom))
    }
}

/// How a text looks and which point of it is given.
#[derive(Clone, Copy)]
pub(super) struct Font {
    size: i32,
    h: HPos,
    v: VPos,
    bold: bool,
    upwards: bool,
    colour: RGBColor,
}

impl Font {
    /// Text of `size` [px], its left end centred on the point.
    pub(super) const fn new(size: i32) -> Self {
        Self { size, h: HPos::Left, v: VPos::Center, bold: false, upwards: false, colour: INK }
    }
    pub(super) const fn middle(self) -> Self {
        Self { h: HPos::Center, ..self }
    }
    pub(super) const fn right(self) -> Self {
        Self { h: HPos::Right, ..self }
    }
    pub(super) const fn below(self) -> Self {
        Self { v: VPos::Top, ..self }
    }
    pub(super) const fn bold(self) -> Self {
        Self { bold: true, ..self }
    }
    pub(super) const fn upwards(self) -> Self {
        Self { upwards: true, ..self }
    }
    pub(super) const fn ink(self, colour: RGBColor) -> Self {
        Self { colour, ..self }
    }
}

/// A picture that is being drawn. Whatever fails is kept until [`draw`] returns.
pub(super) struct Canvas<'a> {
    svg: SVGBackend<'a>,
    failed: Option<String>,
}

impl Canvas<'_> {
    fn keep<T, E: std::fmt::Display>(&mut self, result: Result<T, E>) {
        if let Err(error) = result {
            self.failed.get_or_insert_with(|| error.to_string());
        }
    }
    /// A filled rectangle, at least one pixel wide and high.
    pub(super) fn fill(&mut self, area: Area, colour: RGBColor) {
        self.tint(area, colour, 1.0);
    }
    /// The same, `opacity` 0..=1.
    pub(super) fn tint(&mut self, area: Area, colour: RGBColor, opacity: f64) {
        let (right, bottom) = (area.right.max(area.left + 1), area.bottom.max(area.top + 1));
        let drawn = self.svg.draw_rect((area.left, area.top), (right, bottom), &see_through(colour, opacity), true);
        self.keep(drawn);
    }
    /// The border of a rectangle.
    pub(super) fn border(&mut self, area: Area, colour: RGBColor) {
        let drawn = self.svg.draw_rect((area.left, area.top), (area.right, area.bottom), &colour, false);
        self.keep(drawn);
    }
    /// Straight lines from point to point.
    pub(super) fn path(&mut self, points: &[(i32, i32)], colour: RGBColor, width: u32) {
        let style = ShapeStyle { color: see_through(colour, 1.0), filled: false, stroke_width: width };
        let drawn = match points {
            [] | [_] => return,
            &[from, to] => self.svg.draw_line(from, to, &style),
            _ => self.svg.draw_path(points.iter().copied(), &style),
        };
        self.keep(drawn);
    }
    /// A dashed straight line, upright or level.
    pub(super) fn dashes(&mut self, from: (i32, i32), to: (i32, i32), colour: RGBColor) {
        const DASH: i32 = 4;
        let length = (to.0 - from.0).abs().max((to.1 - from.1).abs());
        let (dx, dy) = ((to.0 - from.0).signum(), (to.1 - from.1).signum());
        for start in (0..length).step_by(2 * DASH as usize) {
            let end = (start + DASH).min(length);
            self.path(&[(from.0 + dx * start, from.1 + dy * start), (from.0 + dx * end, from.1 + dy * end)], colour, 1);
        }
    }
    /// Upright stripes over a level strip, one drawn, one left out, each `width` [px].
    pub(super) fn stripes(&mut self, area: Area, width: i32, colour: RGBColor) {
        for left in (area.left..area.right).step_by(2 * width as usize) {
            self.fill(Area { left, right: (left + width).min(area.right), ..area }, colour);
        }
    }
    /// A filled polygon.
    pub(super) fn polygon(&mut self, points: &[(i32, i32)], colour: RGBColor, opacity: f64) {
        let drawn = self.svg.fill_polygon(points.iter().copied(), &see_through(colour, opacity));
        self.keep(drawn);
    }
    /// A marker of half width `r`; an `Up` or `Down` touches the point with its tip.
    pub(super) fn marker(&mut self, (x, y): (i32, i32), shape: Shape, r: i32, colour: RGBColor) {
        match shape {
            Shape::Dot => {
                let drawn = self.svg.draw_circle((x, y), r as u32, &colour, true);
                self.keep(drawn);
            }
            Shape::Square => self.fill(Area { left: x - r, top: y - r, right: x + r, bottom: y + r }, colour),
            Shape::Up => self.polygon(&[(x, y), (x + r, y + 2 * r), (x - r, y + 2 * r)], colour, 1.0),
            Shape::Down => self.polygon(&[(x, y), (x + r, y - 2 * r), (x - r, y - 2 * r)], colour, 1.0),
        }
    }
    /// A circle around a point.
    pub(super) fn ring(&mut self, at: (i32, i32), r: i32, colour: RGBColor) {
        let style = ShapeStyle { color: see_through(colour, 1.0), filled: false, stroke_width: 2 };
        let drawn = self.svg.draw_circle(at, r as u32, &style, false);
        self.keep(drawn);
    }
    /// A text in one line.
    pub(super) fn text(&mut self, at: (i32, i32), text: &str, font: Font) {
        let style = if font.bold { FontStyle::Bold } else { FontStyle::Normal };
        // plotters divides the size by 1.24 on its way into the SVG.
        let mut desc = (FontFamily::SansSerif, f64::from(font.size) * 1.24, style).into_font();
        if font.upwards {
            desc = desc.transform(FontTransform::Rotate270);
        }
        let style = desc.color(&font.colour).pos(Pos::new(font.h, font.v));
        let drawn = self.svg.draw_text(text, &style, at);
        self.keep(drawn);
    }
}

fn see_through(colour: RGBColor, opacity: f64) -> RGBAColor {
    RGBAColor(colour.0, colour.1, colour.2, opacity)
}

/// What a text of `size` [px] takes [px], never too little for the usual sans-serif fonts.
pub(super) fn text_width(text: &str, size: i32) -> i32 {
    let thousandths: i32 = text
        .chars()
        .map(|c| match c {
            ' ' | '.' | ',' | ':' | ';' | '|' | '\'' | 'i' | 'l' | 'j' => 340,
            'I' | 'f' | 't' | 'r' | '(' | ')' | '[' | ']' | '/' | '-' => 420,
            'm' | 'w' | 'M' | 'W' | '%' | '→' | '±' | '…' | '@' => 1_000,
            'A'..='Z' | '_' => 720,
            _ => 640,
        })
        .sum();
    (thousandths * size + 999) / 1_000
}

/// `text`, cut with an ellipsis if it is wider than `room` [px].
pub(super) fn fit(text: &str, size: i32, room: i32) -> String {
    if text_width(text, size) <= room {
        return text.to_owned();
    }
    let mut cut = text.to_owned();
    while cut.pop().is_some() {
        let shown = format!("{}…", cut.trim_end());
        if text_width(&shown, size) <= room {
            return shown;
        }
    }
    String::new()
}

/// `text` in lines no wider than `room` [px], broken at spaces.
pub(super) fn wrap(text: &str, size: i32, room: i32) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let last = lines.last_mut().expect("never empty");
        let longer = if last.is_empty() { word.to_owned() } else { format!("{last} {word}") };
        if text_width(&longer, size) <= room || last.is_empty() {
            *last = fit(&longer, size, room);
        } else {
            lines.push(fit(word, size, room));
        }
    }
    lines
}

/// Centres for labels of given (wanted centre, size) in ascending order, moved as little as needed to keep them apart.
pub(super) fn spread(wanted: &[(i32, i32)], lo: i32, hi: i32) -> Vec<i32> {
    let mut centres = Vec::with_capacity(wanted.len());
    let mut free = lo;
    for &(centre, size) in wanted {
        let left = (centre - size / 2).max(free);
        centres.push(left + size / 2);
        free = left + size;
    }
    let mut free = hi;
    for (centre, &(_, size)) in centres.iter_mut().zip(wanted).rev() {
        let right = (*centre - size / 2 + size).min(free);
        *centre = right - size + size / 2;
        free = right - size;
    }
    centres
}

/// `1 slave`, `8 slaves`.
pub(super) fn counted(number: u64, of: &str) -> String {
    format!("{number} {of}{}", if number == 1 { "" } else { "s" })
}

/// The words around a picture.
pub(super) struct Words<'a> {
    /// What is shown.
    pub(super) title: &'a str,
    /// The particulars.
    pub(super) subtitle: String,
    /// One half sentence for the footer: what was plotted.
    pub(super) plotted: &'a str,
}

/// Draws one picture of a run: the words, and `body` in the area that they leave.
pub(super) fn page(
    meta: &PlotMeta,
    words: &Words<'_>,
    body_height: i32,
    body: impl FnOnce(&mut Canvas<'_>, Area),
) -> Result<String, String> {
    let footer = format!(
        "isodp | scenario {}, seed {}, {} {}, {}, {} | {}",
        fit(&meta.scenario, FOOTER, ROOM / 3),
        meta.seed,
        meta.cycle,
        meta.t_dp,
        counted(meta.slaves.len() as u64, "slave"),
        meta.duration,
        words.plotted
    );
    sheet(words.title, &format!("Scenario {}: {}", meta.scenario, words.subtitle), &footer, body_height, body)
}

/// Text at the foot of a picture [px].
const FOOTER: i32 = 11;
/// Width between the margins [px].
const ROOM: i32 = WIDTH - 2 * MARGIN;

/// Draws one picture: title, subtitle and footer, and `body` in the area that they leave.
pub(super) fn sheet(
    title: &str,
    subtitle: &str,
    footer: &str,
    body_height: i32,
    body: impl FnOnce(&mut Canvas<'_>, Area),
) -> Result<String, String> {
    const TITLE: i32 = 22;
    const SUBTITLE: i32 = 13;
    let subtitle = wrap(subtitle, SUBTITLE, ROOM);
    let top = MARGIN + TITLE + 12 + subtitle.len() as i32 * (SUBTITLE + 5);
    let bottom = top + body_height;
    let height = bottom + FOOTER + 2 * MARGIN;
    draw(height, |canvas| {
        canvas.fill(Area { left: 0, top: 0, right: WIDTH, bottom: height }, WHITE);
        canvas.text((MARGIN, MARGIN), &fit(title, TITLE, ROOM), Font::new(TITLE).below().bold());
        for (index, line) in subtitle.iter().enumerate() {
            let y = MARGIN + TITLE + 10 + index as i32 * (SUBTITLE + 5);
            canvas.text((MARGIN, y), line, Font::new(SUBTITLE).below().ink(GREY));
        }
        body(canvas, Area { left: MARGIN, top, right: WIDTH - MARGIN, bottom });
        let footer = fit(footer, FOOTER, ROOM);
        canvas.path(&[(MARGIN, bottom + MARGIN - 8), (WIDTH - MARGIN, bottom + MARGIN - 8)], PALE, 1);
        canvas.text((MARGIN, bottom + MARGIN), &footer, Font::new(FOOTER).below().ink(GREY));
    })
}

fn draw(height: i32, body: impl FnOnce(&mut Canvas<'_>)) -> Result<String, String> {
    let mut text = String::new();
    let mut canvas = Canvas { svg: SVGBackend::with_string(&mut text, (WIDTH as u32, height as u32)), failed: None };
    body(&mut canvas);
    let done = canvas.svg.present();
    canvas.keep(done);
    let failed = canvas.failed.take();
    drop(canvas);
    failed.map_or(Ok(text), Err)
}

/// A page that says in one sentence why there is nothing to see.
pub(super) fn empty_page(meta: &PlotMeta, words: &Words<'_>, why: &str) -> Result<String, String> {
    page(meta, words, 260, |canvas, area| {
        canvas.fill(area, FAINT);
        canvas.border(area, PALE);
        let lines = wrap(why, 16, area.width() - 80);
        let first = area.centre().1 - 12 * (lines.len() as i32 - 1);
        for (index, line) in lines.iter().enumerate() {
            canvas.text((area.centre().0, first + 24 * index as i32), line, Font::new(16).middle());
        }
    })
}

/// How an entry of the legend shows its colour.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Swatch {
    Fill,
    Pale,
    Line,
    Mark(Shape),
    LineMark(Shape),
    Ring,
    Dashes,
    /// A lamp: a strip on dark ground, see [`Lit`].
    Lamp(Lit),
}

/// How a lamp is drawn: its strip full, striped or left dark.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Lit {
    Full,
    Striped,
    Dark,
}

/// One entry of a legend.
pub(super) struct Key {
    pub(super) label: String,
    pub(super) colour: RGBColor,
    pub(super) swatch: Swatch,
}

impl Key {
    pub(super) fn new(label: impl Into<String>, colour: RGBColor, swatch: Swatch) -> Self {
        Self { label: label.into(), colour, swatch }
    }
}

/// Rows that a legend in `width` [px] takes [px].
pub(super) fn legend_height(keys: &[Key], width: i32) -> i32 {
    let rows = legend_places(keys, width).last().map_or(0, |&(_, row)| row + 1);
    if rows == 0 { 0 } else { rows * LEGEND_ROW + 6 }
}

fn legend_places(keys: &[Key], width: i32) -> Vec<(i32, i32)> {
    let (mut x, mut row) = (0, 0);
    keys.iter()
        .map(|key| {
            let needs = 34 + text_width(&key.label, 12) + 22;
            if x > 0 && x + needs > width {
                (x, row) = (0, row + 1);
            }
            let place = (x, row);
            x += needs;
            place
        })
        .collect()
}

/// Draws a legend at the top of `area` and takes its height away from it.
pub(super) fn legend(canvas: &mut Canvas<'_>, area: &mut Area, keys: &[Key]) {
    for (key, (x, row)) in keys.iter().zip(legend_places(keys, area.width())) {
        let at = (area.left + x, area.top + row * LEGEND_ROW + LEGEND_ROW / 2);
        swatch(canvas, at, key);
        let label = fit(&key.label, 12, area.width() - 34);
        canvas.text((at.0 + 34, at.1), &label, Font::new(12));
    }
    area.top += legend_height(keys, area.width());
}

/// Draws the strip of a lamp.
pub(super) fn lamp(canvas: &mut Canvas<'_>, area: Area, lit: Lit, colour: RGBColor) {
    canvas.fill(area, if lit == Lit::Full { colour } else { UNLIT });
    if lit == Lit::Striped {
        canvas.stripes(area, STRIPE, colour);
    }
}

/// Draws the 26 pixels in front of a legend's text.
pub(super) fn swatch(canvas: &mut Canvas<'_>, (x, y): (i32, i32), key: &Key) {
    let block = Area { left: x, top: y - 6, right: x + 26, bottom: y + 6 };
    match key.swatch {
        Swatch::Fill => canvas.fill(block, key.colour),
        Swatch::Pale => canvas.tint(block, key.colour, 0.25),
        Swatch::Line => canvas.path(&[(x, y), (x + 26, y)], key.colour, 2),
        Swatch::Dashes => canvas.dashes((x, y), (x + 26, y), key.colour),
        Swatch::Lamp(lit) => lamp(canvas, Area { top: y - 2, bottom: y + 3, ..block }, lit, key.colour),
        Swatch::Ring => canvas.ring((x + 13, y), 6, key.colour),
        Swatch::Mark(shape) => mark(canvas, (x + 13, y), shape, key.colour),
        Swatch::LineMark(shape) => {
            canvas.path(&[(x, y), (x + 26, y)], key.colour, 1);
            mark(canvas, (x + 13, y), shape, key.colour);
        }
    }
}

fn mark(canvas: &mut Canvas<'_>, (x, y): (i32, i32), shape: Shape, colour: RGBColor) {
    match shape {
        Shape::Up => canvas.marker((x, y - 5), shape, 5, colour),
        Shape::Down => canvas.marker((x, y + 5), shape, 5, colour),
        Shape::Dot | Shape::Square => canvas.marker((x, y), shape, 4, colour),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_labels_keep_their_place_if_they_can_and_never_touch() {
        assert_eq!(spread(&[(100, 20), (200, 20)], 0, 300), [100, 200]);
        let crowded = spread(&[(290, 40), (295, 40), (299, 40)], 0, 300);
        assert_eq!(crowded, [200, 240, 280]);
        assert_eq!(spread(&[(0, 40), (5, 40)], 0, 300), [20, 60]);
    }

    #[test]
    fn long_texts_are_cut_or_wrapped() {
        assert_eq!(fit("short", 12, 200), "short");
        let cut = fit("a text that is far too long", 12, 80);
        assert!(cut.ends_with('…') && text_width(&cut, 12) <= 80, "{cut}");
        let lines = wrap("a text that is far too long", 12, 80);
        assert!(lines.len() > 1 && lines.iter().all(|line| text_width(line, 12) <= 80), "{lines:?}");
    }
}
