//! Disturbances: the disturbed stretch of a run on one axis of time. What was disturbed, and of the slaves that suffered
//! most the PLL error with its window, the DP state, the start-up phase and every fault.

use plotters::style::RGBColor;

use super::Material;
use super::buckets::{Buckets, Merge};
use super::chart::{Axis, Chart, Ruler};
use super::look::{
    Area, BLUE, Canvas, FAINT, Font, GREY, INK, Key, SKY, Shape, Swatch, VERMILION, WIDTH, Words, counted, empty_page,
    fit, legend, legend_height, page,
};
use super::timeline::{MARKS, PHASES};
use crate::observation::{ClockVerdict, Disturbance, Observation, Phase, SlaveState};
use crate::study::row::{EventRow, SlaveRow};

/// Slaves that are shown.
const SHOWN: usize = 4;
/// Pieces of time.
const PIECES: usize = 512;
/// Cycles before the first trouble and before each that comes after a quiet time.
const BEFORE: u64 = 16;
/// Cycles after the last change of anything.
const AFTER: u64 = 24;
/// Cycles without a change after which nothing is kept before the next one.
const QUIET: u64 = 256;
/// Disturbances that are told apart; more are one.
const NAMED: usize = 56;
/// Narrowest mark [px].
const MARK: i32 = 3;
/// Height of a lane of disturbances [px].
const LANE: i32 = 18;
/// Height of one slave: its error, its two strips, the space below [px].
const ERROR: i32 = 110;
const STRIP: i32 = 14;
const SPACE: i32 = 18;
/// Width of the names [px].
const NAMES: i32 = 190;
/// Errors below this are drawn linearly [ns].
const LINEAR: f64 = 100.0;

/// Other troubles, behind the disturbances.
const TROUBLES: [&str; 5] = ["collision", "SYNCH late", "no answer", "sign of life held", "supply off"];

/// Colour of a clock failure.
const FAILED: RGBColor = VERMILION;

/// Colour of each DP state.
const STATES: [(SlaveState, RGBColor); 4] = [
    (SlaveState::PowerOn, RGBColor(0x77, 0x77, 0x77)),
    (SlaveState::WaitPrm, RGBColor(0xA8, 0xA8, 0xA8)),
    (SlaveState::WaitCfg, SKY),
    (SlaveState::DataExch, RGBColor(0xA6, 0xD8, 0xC4)),
];

/// One piece of time of one slave.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// Smallest and largest PLL error [ticks].
    error: Option<(i64, i64)>,
    /// Widest window [ticks].
    window: Option<i64>,
    /// The lowest.
    state: Option<SlaveState>,
    /// The lowest.
    phase: Option<Phase>,
    /// Bit per entry of [`MARKS`], and [`FAILURE`].
    marks: u8,
}

/// Bit of a clock failure in a piece of time.
const FAILURE: u8 = 1 << 7;

impl Cell {
    fn of(row: &SlaveRow) -> Self {
        Self {
            error: row.pll_error.map(|error| (error.ticks(), error.ticks())),
            window: row.window.map(crate::time::Span::ticks),
            state: Some(row.state),
            phase: Some(row.phase),
            marks: 0,
        }
    }
}
impl Merge for Cell {
    fn merge(&mut self, other: &Self) {
        let lower = |a: (i64, i64), b: (i64, i64)| (a.0.min(b.0), a.1.max(b.1));
        self.error = match (self.error, other.error) {
            (Some(a), Some(b)) => Some(lower(a, b)),
            (a, b) => a.or(b),
        };
        self.window = self.window.max(other.window);
        self.state = [self.state, other.state].into_iter().flatten().min();
        self.phase = [self.phase, other.phase].into_iter().flatten().min();
        self.marks |= other.marks;
    }
}

/// What was in trouble: a bit per disturbance, then a bit per entry of [`TROUBLES`].
#[derive(Clone, Copy, Debug, Default)]
struct Troubles(u64);
impl Merge for Troubles {
    fn merge(&mut self, other: &Self) {
        self.0 |= other.0;
    }
}

/// One slave.
#[derive(Clone, Debug)]
struct Lane {
    pieces: Buckets<Cell>,
    /// The latest cycles, kept in case something happens now.
    recent: [Cell; BEFORE as usize],
    /// Faults and ends of data exchange, clock failures, largest error: what makes a slave worth showing.
    score: (u32, u32, i64),
}

/// The disturbed stretch of a run.
#[derive(Clone, Debug)]
pub(super) struct Disturbed {
    /// First cycle that is shown; none before anything happened.
    start: Option<u64>,
    /// Last cycle in which something changed.
    last: u64,
    /// Last cycle of the run.
    end: u64,
    bus: Buckets<Troubles>,
    /// Disturbances whose burst goes on, by their bits.
    going_on: u64,
    slaves: Vec<Lane>,
}

impl Disturbed {
    pub(super) fn new(slaves: usize) -> Self {
        let lane = Lane { pieces: Buckets::new(PIECES), recent: [Cell::default(); BEFORE as usize], score: (0, 0, 0) };
        let slaves = vec![lane; slaves];
        Self { start: None, last: 0, end: 0, bus: Buckets::new(PIECES), going_on: 0, slaves }
    }
    /// Whether anything happened.
    pub(super) const fn any(&self) -> bool {
        self.start.is_some()
    }

    /// Takes in one cycle of slave number `index`.
    pub(super) fn slave(&mut self, index: usize, row: &SlaveRow) {
        self.end = row.cycle;
        if let Some(start) = self.start.filter(|_| self.going_on != 0 && index == 0) {
            self.bus.at(row.cycle.saturating_sub(start)).0 |= self.going_on;
        }
        let lane = &mut self.slaves[index];
        let cell = Cell::of(row);
        lane.recent[(row.cycle % BEFORE) as usize] = cell;
        if let Some(start) = self.start.filter(|_| row.cycle <= self.last + QUIET) {
            lane.pieces.at(row.cycle.saturating_sub(start)).merge(&cell);
            let error = cell.error.map_or(0, |error| error.0.abs().max(error.1.abs()));
            lane.score.2 = lane.score.2.max(error);
        }
    }

    /// Takes in what a station saw; `slave` is its number if it is a slave.
    pub(super) fn event(&mut self, slave: Option<usize>, row: &EventRow) {
        let trouble = trouble(&row.what);
        let mark = slave.and_then(|_| mark(&row.what));
        let begins = trouble.is_some_and(|bit| bit != NAMED + 2) || mark.is_some_and(|mark| mark < 4);
        if begins && self.start.is_none() {
            self.start = Some(row.cycle.saturating_sub(BEFORE));
            self.last = row.cycle;
            self.recall(row.cycle.saturating_sub(BEFORE), row.cycle);
        }
        let Some(start) = self.start else { return };
        if trouble.is_some() || mark.is_some() || slave.is_some() && changes(&row.what) {
            self.recall((self.last + QUIET + 1).max(row.cycle.saturating_sub(BEFORE)), row.cycle);
            self.last = self.last.max(row.cycle);
        }
        let piece = row.cycle.saturating_sub(start);
        if let Some(bit) = trouble {
            self.bus.at(piece).0 |= 1 << bit;
            match row.what {
                Observation::Disturbed { how: Disturbance::Begins, .. } => self.going_on |= 1 << bit,
                Observation::Disturbed { how: Disturbance::Ends, .. } => self.going_on &= !(1 << bit),
                _ => {}
            }
        }
        let Some(lane) = slave.map(|index| &mut self.slaves[index]) else { return };
        if let Some(mark) = mark {
            lane.pieces.at(piece).marks |= 1 << mark;
            lane.score.0 += u32::from(mark < 4);
        }
        if let Observation::Clock { verdict: ClockVerdict::Outside | ClockVerdict::Missing, .. } = row.what {
            lane.pieces.at(piece).marks |= FAILURE;
            lane.score.1 += 1;
        }
    }

    /// The cycles from `from` to before `cycle` were quiet, and are wanted now.
    fn recall(&mut self, from: u64, cycle: u64) {
        let Some(start) = self.start else { return };
        for lane in &mut self.slaves {
            for past in from..cycle {
                lane.pieces.at(past - start).merge(&lane.recent[(past % BEFORE) as usize]);
            }
        }
    }

    /// The slaves to show, in address order: those that suffered most.
    fn worst(&self) -> Vec<usize> {
        let mut all: Vec<usize> = (0..self.slaves.len()).collect();
        all.sort_by_key(|&index| std::cmp::Reverse(self.slaves[index].score));
        all.truncate(SHOWN);
        all.sort_unstable();
        all
    }
    /// Cycles that are shown.
    fn cycles(&self, start: u64) -> u64 {
        (self.last + AFTER).min(self.end.max(self.last)) + 1 - start
    }
}

/// Which lane this belongs to.
fn trouble(what: &Observation) -> Option<usize> {
    match *what {
        Observation::Disturbed { number, .. } => Some(usize::from(number).min(NAMED - 1)),
        Observation::Collision { .. } => Some(NAMED),
        Observation::ClockLate { .. } => Some(NAMED + 1),
        Observation::NoAnswer { .. } => Some(NAMED + 2),
        Observation::MasterLifeHeld { held: true, .. } => Some(NAMED + 3),
        Observation::Power { on: false } => Some(NAMED + 4),
        _ => None,
    }
}

/// Which of [`MARKS`] this is.
fn mark(what: &Observation) -> Option<usize> {
    match *what {
        Observation::Fault { code: 0x0F04 } => Some(0),
        Observation::Fault { code: 0x0F02 } => Some(1),
        Observation::Fault { .. } => Some(2),
        Observation::SlaveState { from: SlaveState::DataExch, .. } => Some(3),
        Observation::Acknowledged { .. } => Some(4),
        _ => None,
    }
}

/// Whether a slave is no longer what it was, or was hit.
const fn changes(what: &Observation) -> bool {
    matches!(
        what,
        Observation::SlaveState { .. }
            | Observation::Phase { .. }
            | Observation::Pll { .. }
            | Observation::Power { .. }
            | Observation::Clock { .. }
            | Observation::SetPoint { .. }
    )
}

/// Draws `disturbances.svg`.
pub(super) fn draw(material: &Material<'_>) -> Result<String, String> {
    let (meta, disturbed) = (material.meta, &material.plots.disturbed);
    let shown = disturbed.worst();
    let Some(start) = disturbed.start.filter(|_| !shown.is_empty()) else {
        let words = words(material, 0, 0, 0);
        return empty_page(meta, &words, "No slave was disturbed.");
    };
    let cycles = disturbed.cycles(start);
    let lanes = lanes(material);
    let keys = keys(material, &shown);
    let each = ERROR + 2 * (STRIP + 4) + SPACE;
    let top = lanes.len() as i32 * LANE + SPACE;
    let height = legend_height(&keys, WIDTH - 40) + top + shown.len() as i32 * each + Ruler::HEIGHT + 6;
    page(meta, &words(material, start, cycles, shown.len()), height, |canvas, mut area| {
        legend(canvas, &mut area, &keys);
        let bottom = area.top + top + shown.len() as i32 * each - SPACE / 2;
        let plot = Area { left: area.left + NAMES, right: area.right - 24, top: area.top, bottom };
        let view = View { material, start, cycles, plot };
        view.ground(canvas, lanes.len(), shown.len());
        let ruler = view.ruler(canvas);
        view.troubles(canvas, &ruler, &lanes);
        let highest = shown.iter().map(|&index| highest(&disturbed.slaves[index])).fold(0.0, f64::max);
        for (place, &index) in (0..).zip(&shown) {
            let top = plot.top + top + place * each;
            view.slave(canvas, &ruler, (index, highest), Area { top, bottom: top + each - SPACE, ..plot });
        }
    })
}

fn words(material: &Material<'_>, start: u64, cycles: u64, shown: usize) -> Words<'static> {
    let slaves = material.meta.slaves.len();
    let whose = if shown < slaves {
        format!("the {shown} of {slaves} slaves that suffered most")
    } else {
        counted(slaves as u64, "slave")
    };
    let each = material.plots.disturbed.slaves.first().map_or(1, |lane| lane.pieces.cycles_each());
    let each = if each > 1 {
        format!(" Each piece of time is {each} cycles: range of the error, widest window, lowest state and phase.")
    } else {
        String::new()
    };
    let quiet = if cycles > QUIET { " Without an error: quiet for long, not kept." } else { "" };
    Words {
        title: "Disturbances: what hit the network, and what it did to the slaves",
        subtitle: format!(
            "{whose}, cycles {start} to {}, from the first trouble to the last change.{each} Above and below ±{LINEAR} ns \
             the error is drawn logarithmically.{quiet}",
            start + cycles.saturating_sub(1),
        ),
        plotted: "disturbances, PLL error with its window, DP state, phase and faults",
    }
}

/// Those that occur.
fn keys(material: &Material<'_>, shown: &[usize]) -> Vec<Key> {
    let lanes = shown.iter().map(|&index| &material.plots.disturbed.slaves[index]);
    let cells: Vec<&Cell> = lanes.flat_map(|lane| lane.pieces.iter().map(|piece| piece.1)).collect();
    let marks = cells.iter().fold(0, |all, cell| all | cell.marks);
    let failure = Key::new("clock failure, SYNCH missing or outside of the window", FAILED, Swatch::Mark(Shape::Down));
    let error = [
        Key::new("disturbance", INK, Swatch::Fill),
        Key::new("PLL error, arrival of SYNCH minus prediction", BLUE, Swatch::Fill),
        Key::new("± window", GREY, Swatch::Pale),
    ];
    let failure = (marks & FAILURE != 0).then_some(failure);
    let marks = MARKS.iter().enumerate().filter(|(bit, _)| marks & 1 << bit != 0).map(|(_, mark)| {
        let label = mark.label.split(" (").next().unwrap_or(mark.label);
        Key::new(label, mark.colour, Swatch::Fill)
    });
    let states = STATES.iter().filter(|(state, _)| cells.iter().any(|cell| cell.state == Some(*state)));
    let states = states.map(|(state, colour)| Key::new(state.text(), *colour, Swatch::Fill));
    let phases = PHASES.iter().filter(|(phase, _)| cells.iter().any(|cell| cell.phase == Some(*phase)));
    let phases = phases.map(|(phase, colour)| Key::new(format!("phase {}", phase.text()), *colour, Swatch::Fill));
    error.into_iter().chain(failure).chain(marks).chain(states).chain(phases).collect()
}

/// The lanes on top that have anything: bit and name.
fn lanes(material: &Material<'_>) -> Vec<(usize, String)> {
    let all = material.plots.disturbed.bus.iter().fold(0, |all, piece| all | piece.1.0);
    let name = |bit: usize| match bit.checked_sub(NAMED) {
        Some(trouble) => TROUBLES[trouble].to_owned(),
        None if bit == NAMED - 1 && material.meta.disturbances.len() > NAMED => "further disturbances".to_owned(),
        None => material.meta.disturbances.get(bit).cloned().unwrap_or_else(|| "telegram disturbed".to_owned()),
    };
    (0..NAMED + TROUBLES.len()).filter(|bit| all & 1 << bit != 0).map(|bit| (bit, name(bit))).collect()
}

/// The largest error or window of a slave [ns].
fn highest(lane: &Lane) -> f64 {
    let of = |cell: &Cell| {
        let error = cell.error.map_or(0, |error| error.0.abs().max(error.1.abs()));
        error.max(cell.window.unwrap_or(0)) as f64 / 12.0
    };
    lane.pieces.iter().map(|piece| of(piece.1)).fold(0.0, f64::max)
}

/// The stretch on paper.
struct View<'a> {
    material: &'a Material<'a>,
    start: u64,
    cycles: u64,
    plot: Area,
}

impl View<'_> {
    fn lane(&self, row: usize) -> Area {
        let top = self.plot.top + row as i32 * LANE;
        Area { top, bottom: top + LANE - 3, ..self.plot }
    }
    fn ground(&self, canvas: &mut Canvas<'_>, lanes: usize, slaves: usize) {
        (0..lanes).for_each(|row| canvas.fill(self.lane(row), FAINT));
        for place in 0..slaves as i32 {
            let top = self.plot.top + lanes as i32 * LANE + SPACE + place * (ERROR + 2 * (STRIP + 4) + SPACE);
            canvas.fill(Area { top, bottom: top + ERROR, ..self.plot }, FAINT);
        }
    }
    fn ruler(&self, canvas: &mut Canvas<'_>) -> Ruler {
        let (unit, cycle) = self.material.meta.time_unit(self.start + self.cycles);
        let at = |cycles: u64| cycles as f64 * cycle;
        Ruler::draw(
            canvas,
            self.plot,
            Axis::linear(format!("time [{unit}]"), at(self.start), at(self.start + self.cycles)),
        )
    }
    /// Pixel of the beginning of a piece.
    fn x(&self, ruler: &Ruler, piece: u64) -> i32 {
        ruler.x(self.time(piece))
    }
    fn time(&self, piece: u64) -> f64 {
        let (_, cycle) = self.material.meta.time_unit(self.start + self.cycles);
        (self.start + piece.min(self.cycles)) as f64 * cycle
    }

    fn troubles(&self, canvas: &mut Canvas<'_>, ruler: &Ruler, lanes: &[(usize, String)]) {
        let bus = &self.material.plots.disturbed.bus;
        for (row, (bit, name)) in lanes.iter().enumerate() {
            let lane = self.lane(row);
            let name = fit(name, 12, NAMES - 16);
            canvas.text((lane.left - 8, lane.centre().1), &name, Font::new(12).right());
            let pieces: Vec<(u64, bool)> =
                bus.iter().map(|(first, troubles)| (first, troubles.0 & 1 << bit != 0)).collect();
            for run in pieces.chunk_by(|a, b| a.1 == b.1).filter(|run| run[0].1) {
                let (left, right) = (self.x(ruler, run[0].0), self.x(ruler, run[run.len() - 1].0 + bus.cycles_each()));
                let left = left.min(lane.right - MARK);
                canvas.fill(Area { left, right: right.max(left + MARK), ..lane }, INK);
            }
        }
    }

    /// One slave: its error with the window, its state and its phase.
    fn slave(&self, canvas: &mut Canvas<'_>, ruler: &Ruler, (index, highest): (usize, f64), area: Area) {
        let lane = &self.material.plots.disturbed.slaves[index];
        let each = lane.pieces.cycles_each();
        let error = Area { bottom: area.top + ERROR, ..area };
        let chart = Chart::beside(canvas, error, ruler, Axis::symmetric("", highest, LINEAR));
        let address = self.material.meta.slaves[index];
        canvas.text((area.left - NAMES, error.top + 8), &format!("slave {address}"), Font::new(14).bold());
        canvas.text((area.left - NAMES, error.top + 28), "PLL error [ns]", Font::new(12).ink(GREY));
        let step = self.time(each) - self.time(0);
        let pieces: Vec<(u64, Cell)> =
            lane.pieces.iter().filter(|piece| piece.0 < self.cycles).map(|(at, cell)| (at, *cell)).collect();
        let ns = |ticks: i64| ticks as f64 / 12.0;
        let of = |range: fn(&Cell) -> Option<(i64, i64)>| -> Vec<(f64, f64, f64)> {
            let points =
                pieces.iter().filter_map(|(at, cell)| range(cell).map(|(lo, hi)| (self.time(*at), ns(lo), ns(hi))));
            points.collect()
        };
        chart.band(canvas, &of(|cell| cell.window.map(|window| (-window, window))), step, GREY, 0.22);
        chart.band(canvas, &of(|cell| cell.error), step, BLUE, 1.0);
        self.faults(canvas, ruler, error, &pieces);
        for (at, _) in pieces.iter().filter(|piece| piece.1.marks & FAILURE != 0) {
            let middle = i32::midpoint(self.x(ruler, *at), self.x(ruler, at + each));
            canvas.marker((middle, error.top + 9), Shape::Down, 4, FAILED);
        }
        let strip = |row: i32| {
            let top = area.top + ERROR + 4 + row * (STRIP + 4);
            Area { top, bottom: top + STRIP, ..area }
        };
        let state = |cell: &Cell| cell.state.and_then(|state| STATES.iter().find(|of| of.0 == state)).map(|of| of.1);
        let phase = |cell: &Cell| cell.phase.and_then(|phase| PHASES.iter().find(|of| of.0 == phase)).map(|of| of.1);
        self.strip(canvas, ruler, (strip(0), "DP state"), (&pieces, each), state);
        self.strip(canvas, ruler, (strip(1), "phase"), (&pieces, each), phase);
        for row in 0..2 {
            self.faults(canvas, ruler, strip(row), &pieces);
        }
    }

    fn faults(&self, canvas: &mut Canvas<'_>, ruler: &Ruler, area: Area, pieces: &[(u64, Cell)]) {
        let mut free = area.left;
        for (at, cell) in pieces.iter().filter(|piece| piece.1.marks != 0) {
            for (_, mark) in MARKS.iter().enumerate().filter(|(bit, _)| cell.marks & 1 << bit != 0) {
                let left = self.x(ruler, *at).max(free).min(area.right - MARK);
                canvas.fill(Area { left, right: left + MARK, ..area }, mark.colour);
                free = left + MARK;
            }
        }
    }

    /// A strip of colours; where nothing was recorded nothing had changed.
    fn strip(
        &self,
        canvas: &mut Canvas<'_>,
        ruler: &Ruler,
        (area, name): (Area, &str),
        (pieces, each): (&[(u64, Cell)], u64),
        colour: impl Fn(&Cell) -> Option<RGBColor>,
    ) {
        canvas.text((area.left - 8, area.centre().1), name, Font::new(11).right());
        let mut now = None;
        let colours: Vec<(u64, Option<RGBColor>)> = pieces
            .iter()
            .map(|(at, cell)| {
                now = colour(cell).or(now);
                (*at, now)
            })
            .collect();
        for run in colours.chunk_by(|a, b| a.1 == b.1) {
            let (left, right) = (self.x(ruler, run[0].0), self.x(ruler, run[run.len() - 1].0 + each));
            if let Some(colour) = run[0].1 {
                canvas.fill(Area { left, right, ..area }, colour);
            }
        }
    }
}
