//! Bus cycle: one cycle as it was on the line, drawn to scale like an engineering drawing.

use plotters::style::RGBColor;

use super::chart::{Axis, Ruler, plain};
use super::lanes::Lanes;
use super::look::{
    Area, BLACK, BLUE, Canvas, FAINT, Font, GREEN, GREY, INK, Key, ORANGE, PURPLE, SKY, Shape, Swatch, VERMILION,
    WHITE, WIDTH, Words, counted, empty_page, fit, legend, legend_height, page, spread, text_width,
};
use super::telegrams::{Bar, Cycle, Kind};
use super::{Material, PlotMeta};
use crate::time::Time;
use crate::wire::Address;

/// Height of a row of dimensions [px].
const DIMENSION: i32 = 26;
/// Rows of dimensions: T_DP; T_O and T_I; T_DX and spare; room for one that meets another.
const DIMENSIONS: usize = 4;
/// Height of the bus lane [px].
const BUS: i32 = 36;
/// Height of the names above the bus lane, with their leaders [px].
const NAMES: i32 = LETTERS + 20;
/// Letters in dimensions and above the bus lane [px].
const LETTERS: i32 = 11;

/// Every kind with its words and colour.
const KINDS: [(Kind, &str, RGBColor); 13] = [
    (Kind::Synch, "SYNCH (Global_Control)", VERMILION),
    (Kind::Request, "Data_Exchange request", BLUE),
    (Kind::Reply, "reply", SKY),
    (Kind::DxbReply, "DXB reply to all", GREEN),
    (Kind::Acyclic, "acyclic", ORANGE),
    (Kind::Gap, "GAP poll and answer", PURPLE),
    (Kind::Token, "token", BLACK),
    (Kind::OtherRequest, "another master's Data_Exchange request", RGBColor(0x8B, 0x5A, 0x2B)),
    (Kind::OtherReply, "reply to it", RGBColor(0xD9, 0xBF, 0x9C)),
    (Kind::OtherAcyclic, "another master's acyclic request", RGBColor(0x9A, 0x8B, 0x00)),
    (Kind::OtherAnswer, "answer to it", RGBColor(0xF0, 0xE4, 0x42)),
    (Kind::OtherToken, "another master's token", RGBColor(0xA8, 0xA8, 0xA8)),
    (Kind::Unreadable, "unreadable", GREY),
];

fn colour(kind: Kind) -> RGBColor {
    KINDS.iter().find(|entry| entry.0 == kind).map_or(GREY, |entry| entry.2)
}

/// A length with its two ends [µs from t0].
struct Dimension {
    label: String,
    from: f64,
    to: f64,
}

/// The cycle with everything counted from t0.
pub(super) struct View<'a> {
    pub(super) cycle: &'a Cycle,
    pub(super) slaves: &'a [Address],
    pub(super) t0: Time,
    /// First bit of the next SYNCH and the next t0 [µs].
    pub(super) next: (f64, f64),
    /// Whether the cycle begins with SYNCH.
    pub(super) clocked: bool,
}

impl View<'_> {
    fn us(&self, at: Time) -> f64 {
        (at - self.t0).as_us()
    }
    /// Last bit of the last Data_Exchange reply [µs].
    fn t_dx(&self) -> Option<f64> {
        let replies = self.cycle.bars.iter().filter(|bar| matches!(bar.kind, Kind::Reply | Kind::DxbReply));
        replies.map(|bar| self.us(bar.end)).reduce(f64::max)
    }
    /// Last bit before the silence [µs].
    fn quiet(&self) -> f64 {
        self.cycle.bars.iter().map(|bar| self.us(bar.end)).fold(0.0, f64::max)
    }
    /// End of the axis: a planned cycle, or its T_O, can be longer than T_DP. What is far away stays at the edge.
    fn end(&self) -> f64 {
        let cycle = self.quiet().max(self.next.1);
        self.t_o().map_or(cycle, |t_o| cycle.max(t_o.0.min(2.0 * cycle)))
    }
    /// Latest T_O, whether another slave's differs by more than 1 µs, and its slave.
    fn t_o(&self) -> Option<(f64, bool, Address)> {
        extreme(self.slaves.iter().filter_map(|&slave| Some((self.us(self.cycle.t_o(slave)?), slave))), 1.0)
    }
    /// Earliest latch at T_I, as [`View::t_o`].
    fn latch(&self) -> Option<(f64, bool, Address)> {
        let latches = self.slaves.iter().filter_map(|&slave| match self.cycle.latch(slave)? {
            (at, true) => Some((self.us(at), slave)),
            (_, false) => None,
        });
        extreme(latches, -1.0)
    }
    fn dimensions(&self) -> Vec<Dimension> {
        let us = |value: f64| format!("{} us", plain(value, 2));
        let t_dp = self.next.1;
        let mut all = vec![Dimension {
            label: format!("{} {}", if self.clocked { "T_DP" } else { "T_cycle" }, us(t_dp)),
            from: 0.0,
            to: t_dp,
        }];
        if let Some((t_o, differ, slave)) = self.t_o() {
            let who = if differ { format!(" (latest: slave {slave})") } else { String::new() };
            all.push(Dimension { label: format!("T_O {}{who}", us(t_o)), from: 0.0, to: t_o });
        }
        if let Some((latch, differ, slave)) = self.latch() {
            let who = if differ { format!(" (earliest: slave {slave})") } else { String::new() };
            all.push(Dimension { label: format!("T_I {}{who}", us(t_dp - latch)), from: latch, to: t_dp });
        }
        if let Some(t_dx) = self.t_dx() {
            all.push(Dimension { label: format!("T_DX {}", us(t_dx)), from: 0.0, to: t_dx });
        }
        let (quiet, next) = (self.quiet(), self.next.0);
        if next > quiet {
            let word = if self.clocked { "spare" } else { "silence" };
            all.push(Dimension { label: format!("{word} {}", us(next - quiet)), from: quiet, to: next });
        }
        all
    }
}

/// The largest (`sign` 1) or smallest (`sign` -1) value, whether the values differ by more than 1, and whose it is.
fn extreme(values: impl Iterator<Item = (f64, Address)>, sign: f64) -> Option<(f64, bool, Address)> {
    let values: Vec<(f64, Address)> = values.collect();
    let pick = |sign: f64| values.iter().copied().reduce(|a, b| if (b.0 - a.0) * sign > 0.0 { b } else { a });
    let (first, last) = (pick(sign)?, pick(-sign)?);
    Some((first.0, (first.0 - last.0).abs() > 1.0, first.1))
}

/// Draws `bus_cycle.svg`.
pub(super) fn draw(material: &Material<'_>) -> Result<String, String> {
    let meta = material.meta;
    let mut words = Words {
        title: "Bus cycle: every telegram of one cycle, to scale",
        subtitle: String::new(),
        plotted: "telegrams, T_O and latch instants of one bus cycle",
    };
    let found = material.bus.cycle().and_then(|cycle| Some((cycle, cycle.t0?, cycle.next?)));
    let Some((cycle, t0, next)) = found else {
        "One cycle.".clone_into(&mut words.subtitle);
        return empty_page(meta, &words, "No complete bus cycle was seen: fewer than two SYNCH were on the line.");
    };
    let next = ((next.0 - t0).as_us(), (next.1 - t0).as_us());
    let view = View { cycle, slaves: &meta.slaves, t0, next, clocked: true };
    words.subtitle = subtitle(&view);
    draw_view(meta, &words, &view)
}

/// Draws one cycle.
pub(super) fn draw_view(meta: &PlotMeta, words: &Words<'_>, view: &View<'_>) -> Result<String, String> {
    let cycle = view.cycle;
    let keys = keys(view);
    let others = others(cycle);
    let count = others.len() + meta.slaves.len();
    let above = DIMENSIONS as i32 * DIMENSION + NAMES;
    let lanes_height = Lanes::each(count) * count as i32;
    let height = legend_height(&keys, WIDTH - 40) + above + BUS + 12 + lanes_height + Ruler::HEIGHT + 10;
    page(meta, words, height, |canvas, mut area| {
        legend(canvas, &mut area, &keys);
        let top = area.top + above;
        let plot =
            Area { left: area.left + Lanes::NAMES, top, right: area.right - 24, bottom: top + BUS + 12 + lanes_height };
        let start = cycle.bars.iter().map(|bar| view.us(bar.start)).fold(0.0, f64::min);
        let end = view.end();
        let air = end * 0.005;
        let ruler = Ruler::draw(canvas, plot, Axis::linear("time from t0 [us]", start - air, end + air));
        bus_lane(canvas, view, &ruler, Area { bottom: top + BUS, ..plot });
        let lanes = Lanes::new(count, top + BUS + 12, plot.left, plot.right);
        for (index, &master) in others.iter().enumerate() {
            master_lane(canvas, view, &ruler, (&lanes, index), master);
        }
        for (index, &slave) in meta.slaves.iter().enumerate() {
            slave_lane(canvas, view, &ruler, (&lanes, others.len() + index), slave);
        }
        dimensions(canvas, view, &ruler, area.top);
        names(canvas, view, &ruler, top);
    })
}

/// The other masters that had the token, ascending.
fn others(cycle: &Cycle) -> Vec<Address> {
    let mut others: Vec<Address> = cycle.bars.iter().filter_map(|bar| bar.other).collect();
    others.sort_unstable();
    others.dedup();
    others
}

fn subtitle(view: &View<'_>) -> String {
    let number = view.cycle.number.map_or_else(String::new, |number| format!("cycle {number}, "));
    let dropped = match view.cycle.dropped {
        0 => String::new(),
        more => format!(" {more} more are not shown."),
    };
    format!(
        "{number}{}, {}, from SYNCH to the next SYNCH; t0 is the last bit of SYNCH, at {} s of the \
         run. Instants at the sender; a telegram shorter than a pixel is one pixel wide.{dropped}",
        counted(view.slaves.len() as u64, "slave"),
        counted(view.cycle.bars.len() as u64, "telegram"),
        plain(view.t0.since_zero().as_s(), 6),
    )
}

fn keys(view: &View<'_>) -> Vec<Key> {
    let seen = |kind: Kind| view.cycle.bars.iter().any(|bar| bar.kind == kind);
    let mut keys: Vec<Key> = KINDS
        .iter()
        .filter(|entry| seen(entry.0))
        .map(|&(_, label, colour)| Key::new(label, colour, Swatch::Fill))
        .collect();
    let latches = || view.slaves.iter().filter_map(|&slave| view.cycle.latch(slave));
    if view.t_o().is_some() {
        keys.push(Key::new("T_O: set points take effect", BLACK, Swatch::Mark(Shape::Down)));
    }
    if latches().any(|latch| latch.1) {
        keys.push(Key::new("T_I: position latched", VERMILION, Swatch::Mark(Shape::Up)));
    }
    if latches().any(|latch| !latch.1) {
        keys.push(Key::new("latched without a locked clock", GREY, Swatch::Mark(Shape::Up)));
    }
    keys
}

/// The whole line, with names as far as they have room.
fn bus_lane(canvas: &mut Canvas<'_>, view: &View<'_>, ruler: &Ruler, lane: Area) {
    canvas.fill(lane, FAINT);
    canvas.text((lane.left - 8, lane.centre().1), "bus", Font::new(12).right().bold());
    let place = |bar: &Bar| (ruler.x(view.us(bar.start)), ruler.x(view.us(bar.end)));
    for bar in &view.cycle.bars {
        let (left, right) = place(bar);
        canvas.fill(Area { left, right, ..lane }, colour(bar.kind));
    }
    if view.clocked {
        let next = Area { left: ruler.x(view.next.0), right: ruler.x(view.next.1), ..lane };
        canvas.fill(next, colour(Kind::Synch));
    }
}

/// Names above the bus lane at `bottom`: first the rare ones, each with a leader, then the slaves as far as they fit.
fn names(canvas: &mut Canvas<'_>, view: &View<'_>, ruler: &Ruler, bottom: i32) {
    let centre = |from: f64, to: f64| ruler.x(f64::midpoint(from, to));
    let asking = view.cycle.bars.iter().filter(|bar| bar.asks);
    let mut all: Vec<(Kind, i32, String)> =
        asking.map(|bar| (bar.kind, centre(view.us(bar.start), view.us(bar.end)), name(bar))).collect();
    if view.clocked {
        all.push((Kind::Synch, centre(view.next.0, view.next.1), "SYNCH".to_owned()));
    }
    // The next SYNCH of a plan can come before the end of its cycle.
    all.sort_by_key(|entry| entry.1);
    let (slaves, rare): (Vec<_>, Vec<_>) =
        all.into_iter().partition(|entry| matches!(entry.0, Kind::Request | Kind::OtherRequest));
    let width = |name: &str| text_width(name, LETTERS) + 6;
    let wanted: Vec<(i32, i32)> = rare.iter().map(|entry| (entry.1, width(&entry.2))).collect();
    let needed: i32 = wanted.iter().map(|entry| entry.1).sum();
    // A cycle full of acyclic messages or tokens: the colours have to do.
    let room = (ruler.area.left - 20, ruler.area.right + 24);
    let places = if needed <= room.1 - room.0 { spread(&wanted, room.0, room.1) } else { Vec::new() };
    let y = bottom - NAMES + LETTERS / 2 + 2;
    let mut taken: Vec<(i32, i32)> = Vec::new();
    for ((_, at, name), &place) in rare.iter().zip(&places) {
        canvas.path(&[(place, y + LETTERS / 2 + 2), (*at, bottom - 1)], GREY, 1);
        plate(canvas, (place, y), name, Font::new(LETTERS).middle());
        taken.push((place - width(name) / 2, place + width(name) / 2));
    }
    for (_, at, name) in slaves {
        let (left, right) = (at - width(&name) / 2, at + width(&name) / 2);
        if taken.iter().all(|other| right + 2 <= other.0 || other.1 + 2 <= left) {
            plate(canvas, (at, y), &name, Font::new(LETTERS).middle());
            taken.push((left, right));
        }
    }
}

/// A text in the middle of white, so that no line runs through it.
fn plate(canvas: &mut Canvas<'_>, (x, y): (i32, i32), text: &str, font: Font) {
    let half = text_width(text, LETTERS) / 2 + 1;
    let high = LETTERS / 2 + 2;
    canvas.fill(Area { left: x - half, top: y - high, right: x + half, bottom: y + high }, WHITE);
    canvas.text((x, y), text, font);
}

fn name(bar: &Bar) -> String {
    let slave = bar.slave.map_or_else(String::new, |slave| slave.to_string());
    match bar.kind {
        Kind::Synch => "SYNCH".to_owned(),
        Kind::Token | Kind::OtherToken if bar.slave.is_some() => format!("token to {slave}"),
        Kind::Token | Kind::OtherToken => "token".to_owned(),
        Kind::Gap => format!("GAP {slave}"),
        Kind::Acyclic | Kind::OtherAcyclic => format!("acyclic {slave}").trim_end().to_owned(),
        Kind::Request
        | Kind::Reply
        | Kind::DxbReply
        | Kind::Unreadable
        | Kind::OtherRequest
        | Kind::OtherReply
        | Kind::OtherAnswer => slave,
    }
}

/// What another master sent with the token, and what it was answered.
fn master_lane(canvas: &mut Canvas<'_>, view: &View<'_>, ruler: &Ruler, lane: (&Lanes, usize), master: Address) {
    let (lanes, index) = lane;
    lanes.ground(canvas, index);
    lanes.name(canvas, index, ruler.area.left, &format!("master {master}"));
    for bar in view.cycle.bars.iter().filter(|bar| bar.other == Some(master)) {
        let (left, right) = (ruler.x(view.us(bar.start)), ruler.x(view.us(bar.end)));
        canvas.fill(Area { left, right, ..lanes.lane(index) }, colour(bar.kind));
    }
}

fn slave_lane(canvas: &mut Canvas<'_>, view: &View<'_>, ruler: &Ruler, lane: (&Lanes, usize), slave: Address) {
    let (lanes, index) = lane;
    lanes.ground(canvas, index);
    lanes.name(canvas, index, ruler.area.left, &format!("slave {slave}"));
    let place = lanes.lane(index);
    let bars = view.cycle.bars.iter().filter(|bar| bar.slave == Some(slave) && bar.kind != Kind::Gap);
    for bar in bars {
        let (left, right) = (ruler.x(view.us(bar.start)), ruler.x(view.us(bar.end)));
        canvas.fill(Area { left, right, ..place }, colour(bar.kind));
    }
    let r = (place.height() / 4).clamp(3, 6);
    if let Some(t_o) = view.cycle.t_o(slave) {
        let y = i32::midpoint(place.top, place.bottom) + r;
        canvas.marker((ruler.x(view.us(t_o)), y), Shape::Down, r, BLACK);
    }
    if let Some((latch, locked)) = view.cycle.latch(slave) {
        let y = i32::midpoint(place.top, place.bottom) - r;
        canvas.marker((ruler.x(view.us(latch)), y), Shape::Up, r, if locked { VERMILION } else { GREY });
    }
}

/// A dimension in its place.
struct Placed {
    label: String,
    from: i32,
    to: i32,
    /// Middle of the label.
    centre: i32,
    y: i32,
}

/// Each dimension in the first row where it meets no other.
fn place(view: &View<'_>, ruler: &Ruler, top: i32) -> Vec<Placed> {
    let mut rows: [Vec<(i32, i32)>; DIMENSIONS] = Default::default();
    let mut placed = Vec::new();
    for dimension in view.dimensions() {
        let (from, to) = (ruler.x(dimension.from), ruler.x(dimension.to));
        let label = fit(&dimension.label, LETTERS, ruler.area.width() / 2);
        let half = text_width(&label, LETTERS) / 2 + 2;
        // A label wider than its arrow stands on the side that has more room.
        let centre = if 2 * half <= to - from {
            i32::midpoint(from, to)
        } else if to + 10 + 2 * half <= ruler.area.right {
            to + 10 + half
        } else {
            from - 10 - half
        };
        let (left, right) = (from.min(centre - half), to.max(centre + half));
        let free = |row: &Vec<(i32, i32)>| row.iter().all(|other| right <= other.0 || other.1 <= left);
        let row = rows.iter().position(free).unwrap_or(DIMENSIONS - 1);
        rows[row].push((left, right));
        placed.push(Placed { label, from, to, centre, y: top + (row as i32 + 1) * DIMENSION - 4 });
    }
    placed
}

/// Dimension lines above the bus lane.
fn dimensions(canvas: &mut Canvas<'_>, view: &View<'_>, ruler: &Ruler, top: i32) {
    let placed = place(view, ruler, top);
    for dimension in &placed {
        for x in [dimension.from, dimension.to] {
            canvas.dashes((x, dimension.y - 4), (x, ruler.area.bottom), GREY);
        }
    }
    for Placed { label, from, to, centre, y } in placed {
        arrow(canvas, from, to, y);
        let beside = centre < from || centre > to;
        let text_y = if beside { y } else { y - LETTERS / 2 - 4 };
        plate(canvas, (centre, text_y), &label, Font::new(LETTERS).middle().bold());
    }
}

/// A line with a head at both ends; the heads stand outside of a short one.
fn arrow(canvas: &mut Canvas<'_>, from: i32, to: i32, y: i32) {
    const HEAD: i32 = 7;
    canvas.path(&[(from, y), (to, y)], INK, 1);
    let way = if to - from >= 3 * HEAD { 1 } else { -1 };
    for (tip, way) in [(from, way), (to, -way)] {
        canvas.polygon(&[(tip, y), (tip + way * HEAD, y - 3), (tip + way * HEAD, y + 3)], INK, 1.0);
    }
}
