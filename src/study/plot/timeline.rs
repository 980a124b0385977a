//! Timeline: what every slave went through, one lane each, with every fault, however short, as a mark.

use plotters::style::RGBColor;

use super::Material;
use super::buckets::{Buckets, Merge};
use super::chart::{Axis, Ruler};
use super::lanes::Lanes;
use super::look::{
    Area, BLACK, BLUE, Canvas, FAINT, Font, GREEN, GREY, INK, Key, Lit, ORANGE, PURPLE, SKY, Swatch, VERMILION, WHITE,
    WIDTH, Words, counted, empty_page, lamp, legend, legend_height, page,
};
use crate::device::leds::Lamp;
use crate::observation::{Disturbance, Leds, Observation, Phase, SlaveState};
use crate::study::row::{EventRow, SlaveRow};

/// Buckets of the whole run.
const WHOLE: usize = 1_024;
/// Cycles of the start-up that have a picture of their own.
const START: u64 = 256;
/// Narrowest mark [px].
const MARK: i32 = 3;
/// Farthest that a mark steps aside for its neighbour [px].
const ASIDE: i32 = 12;
/// Height of a bus lane [px].
const BUS_LANE: i32 = 18;
/// Width of one column of totals [px].
const TOTAL: i32 = 44;

/// Sign-of-life fault (manual 5.3).
const LIFE_FAULT: u16 = 0x0F02;
/// Clock fault (manual 5.3).
const CLOCK_FAULT: u16 = 0x0F04;

/// What is marked: its words, its colour, and the upper and lower end of the mark in halves of a lane.
pub(super) struct Mark {
    pub(super) label: &'static str,
    column: &'static str,
    pub(super) colour: RGBColor,
    from: i32,
    to: i32,
}

pub(super) const MARKS: [Mark; 5] = [
    Mark { label: "fault 0F04, clock", column: "0F04", colour: VERMILION, from: 0, to: 2 },
    Mark { label: "fault 0F02, sign of life", column: "0F02", colour: BLACK, from: 0, to: 2 },
    Mark { label: "another fault", column: "other", colour: BLUE, from: 0, to: 2 },
    Mark { label: "left DATA_EXCH (upper half)", column: "left", colour: PURPLE, from: 0, to: 1 },
    Mark { label: "fault acknowledged (lower half)", column: "ack", colour: GREEN, from: 1, to: 2 },
];
/// What disturbs the network, one lane each.
const TROUBLES: [&str; 6] = ["disturbed", "collision", "SYNCH late", "no answer", "sign of life held", "supply off"];

/// Colour and name of each phase.
pub(super) const PHASES: [(Phase, RGBColor); 5] = [
    (Phase::Configuration, RGBColor(0xB8, 0xB8, 0xB8)),
    (Phase::Clock, ORANGE),
    (Phase::MasterLife, RGBColor(0xF0, 0xE4, 0x42)),
    (Phase::SlaveLife, SKY),
    (Phase::Operation, RGBColor(0xCF, 0xEB, 0xDD)),
];

/// A lamp: what a pattern makes it do, and its colour.
type Light = (fn(Leds) -> Lamp, RGBColor);
/// The red LED, the upper strip, and the green one, the lower (manual 5.2).
const LAMPS: [Light; 2] = [(Leds::red, VERMILION), (Leds::green, GREEN)];

/// One piece of time of one slave.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// The lowest pattern of the LEDs, by its number in the manual.
    leds: Option<Leds>,
    /// The lowest phase.
    phase: Option<Phase>,
    /// Bit per entry of `MARKS` or `TROUBLES`.
    marks: u8,
    /// Largest failure counter, of clock or sign of life.
    counter: u16,
}

impl Cell {
    fn phase(&mut self, phase: Phase) {
        self.phase = Some(self.phase.map_or(phase, |before| before.min(phase)));
    }
    fn leds(&mut self, leds: Leds) {
        self.leds = Some(self.leds.map_or(leds, |before| before.min(leds)));
    }
}
impl Merge for Cell {
    fn merge(&mut self, other: &Self) {
        if let Some(phase) = other.phase {
            self.phase(phase);
        }
        if let Some(leds) = other.leds {
            self.leds(leds);
        }
        self.marks |= other.marks;
        self.counter = self.counter.max(other.counter);
    }
}

/// A lane: the whole run and its start, and how often each mark was set.
#[derive(Clone, Debug)]
struct Lane {
    whole: Buckets<Cell>,
    start: Buckets<Cell>,
    totals: [u32; TROUBLES.len()],
}

impl Lane {
    fn new() -> Self {
        Self { whole: Buckets::new(WHOLE), start: Buckets::new(START as usize), totals: [0; TROUBLES.len()] }
    }
    fn each(&mut self, cycle: u64, change: impl Fn(&mut Cell)) {
        change(self.whole.at(cycle));
        if cycle < START {
            change(self.start.at(cycle));
        }
    }
    fn mark(&mut self, cycle: u64, mark: usize) {
        self.each(cycle, |cell| cell.marks |= 1 << mark);
        self.totals[mark] = self.totals[mark].saturating_add(1);
    }
}

/// All lanes.
#[derive(Clone, Debug)]
pub(super) struct Timeline {
    bus: Lane,
    slaves: Vec<Lane>,
    cycles: u64,
}

impl Timeline {
    pub(super) fn new(slaves: usize) -> Self {
        Self { bus: Lane::new(), slaves: vec![Lane::new(); slaves], cycles: 0 }
    }
    /// Takes in one cycle of slave number `index`.
    pub(super) fn slave(&mut self, index: usize, row: &SlaveRow) {
        self.cycles = self.cycles.max(row.cycle + 1);
        let counter = row.life_counter.max(row.clock_counter);
        self.slaves[index].each(row.cycle, |cell| {
            cell.phase(row.phase);
            cell.leds(row.leds);
            cell.counter = cell.counter.max(counter);
        });
    }
    /// Takes in what a station saw; `slave` is its number if it is a slave.
    pub(super) fn event(&mut self, slave: Option<usize>, row: &EventRow) {
        self.cycles = self.cycles.max(row.cycle + 1);
        let trouble = match row.what {
            Observation::Disturbed { how: Disturbance::Ends, .. } => None,
            Observation::Disturbed { .. } => Some(0),
            Observation::Collision { .. } => Some(1),
            Observation::ClockLate { .. } => Some(2),
            Observation::NoAnswer { .. } => Some(3),
            Observation::MasterLifeHeld { held: true, .. } => Some(4),
            Observation::Power { on: false } => Some(5),
            _ => None,
        };
        if let Some(trouble) = trouble {
            self.bus.mark(row.cycle, trouble);
        }
        let Some(index) = slave else { return };
        let lane = &mut self.slaves[index];
        match row.what {
            Observation::Fault { code: CLOCK_FAULT } => lane.mark(row.cycle, 0),
            Observation::Fault { code: LIFE_FAULT } => lane.mark(row.cycle, 1),
            Observation::Fault { .. } => lane.mark(row.cycle, 2),
            Observation::SlaveState { from: SlaveState::DataExch, .. } => lane.mark(row.cycle, 3),
            Observation::Acknowledged { .. } => lane.mark(row.cycle, 4),
            Observation::Phase { to, .. } => lane.each(row.cycle, |cell| cell.phase(to)),
            Observation::Leds { to, .. } => lane.each(row.cycle, |cell| cell.leds(to)),
            Observation::Power { on: false } => lane.each(row.cycle, |cell| cell.leds(Leds::NoSupply)),
            _ => {}
        }
    }
}

/// Draws `timeline.svg`.
pub(super) fn draw(material: &Material<'_>) -> Result<String, String> {
    let (meta, timeline) = (material.meta, &material.plots.timeline);
    let (cycles, slaves) = (timeline.cycles, meta.slaves.len());
    let zoomed = cycles > START * 2;
    let split = if zoomed { format!("Left: the first {START} cycles; right: the whole run. ") } else { String::new() };
    // A master without supply begins no cycle.
    let gone = meta.duration - meta.t_dp * cycles as i64;
    let gone = if gone > meta.t_dp * 10 {
        format!("Time is cycles begun x T_DP: {gone} of the run had no cycle and take no room. ")
    } else {
        String::new()
    };
    let words = Words {
        title: "Timeline: start-up phases, faults, LEDs and disturbances of every slave",
        subtitle: format!(
            "{}, {}. {split}{gone}Each piece of time shows its lowest phase and, in the two strips below, the first pattern of \
             the manual's table that the red and the green LED showed; a mark is at least {MARK} pixels wide, and \
             marks that meet stand side by side. Numbers at the right: totals of the run.",
            counted(slaves as u64, "slave"),
            counted(cycles, "cycle"),
        ),
        plotted: "phases, faults, acknowledgements, LEDs and disturbances per slave",
    };
    if cycles == 0 || slaves == 0 {
        return empty_page(meta, &words, "Nothing happened: no cycle of any slave was recorded.");
    }
    let counters = Lanes::each(slaves) >= 24 && highest_counter(timeline) > 0;
    let keys = keys(counters.then(|| highest_counter(timeline)));
    let lanes_height = Lanes::each(slaves) * slaves as i32;
    let bus_height = TROUBLES.len() as i32 * BUS_LANE + 30;
    let height = legend_height(&keys, WIDTH - 40) + bus_height + lanes_height + Ruler::HEIGHT + 10;
    page(meta, &words, height, |canvas, mut area| {
        legend(canvas, &mut area, &keys);
        let left = area.left + Lanes::NAMES;
        let right = area.right - TOTAL * MARKS.len() as i32 - 10;
        let bottom = area.top + bus_height + lanes_height;
        let plot = Area { left, right, top: area.top, bottom };
        let names = Names { meta_left: left, totals_left: right + 10, lanes_top: area.top + bus_height };
        names.draw(canvas, material, area.top);
        let panels = if zoomed {
            let middle = plot.left + plot.width() / 3;
            vec![(Area { right: middle - 20, ..plot }, false), (Area { left: middle + 20, ..plot }, true)]
        } else {
            vec![(plot, true)]
        };
        for (area, whole) in panels {
            let cycles = if whole { cycles } else { START };
            let panel = Panel { material, area, lanes_top: names.lanes_top, whole, cycles };
            panel.draw(canvas, counters);
        }
    })
}

fn highest_counter(timeline: &Timeline) -> u16 {
    let cells = timeline.slaves.iter().flat_map(|lane| lane.whole.iter());
    cells.map(|cell| cell.1.counter).max().unwrap_or(0)
}

fn keys(counter: Option<u16>) -> Vec<Key> {
    let phases =
        PHASES.iter().map(|(phase, colour)| Key::new(format!("phase {}", phase.text()), *colour, Swatch::Fill));
    let marks = MARKS.iter().map(|mark| Key::new(mark.label, mark.colour, Swatch::Fill));
    let trouble = Key::new("disturbance of the network", INK, Swatch::Fill);
    let counter = counter.map(|top| {
        let label = format!("larger of the two failure counters, height of the lane = {top}");
        Key::new(label, GREY, Swatch::Line)
    });
    let lamps = [
        ("red LED bright (upper strip)", VERMILION, Lit::Full),
        ("green LED bright (lower strip)", GREEN, Lit::Full),
        ("red LED flashing", VERMILION, Lit::Striped),
        ("green LED flashing", GREEN, Lit::Striped),
        ("LED dark", GREY, Lit::Dark),
    ];
    let lamps = lamps.map(|(label, colour, lit)| Key::new(label, colour, Swatch::Lamp(lit)));
    phases.chain(marks).chain([trouble]).chain(counter).chain(lamps).collect()
}

/// The words beside the lanes.
struct Names {
    meta_left: i32,
    totals_left: i32,
    lanes_top: i32,
}

impl Names {
    const fn column(&self, index: usize) -> i32 {
        self.totals_left + (index as i32 + 1) * TOTAL
    }

    fn draw(&self, canvas: &mut Canvas<'_>, material: &Material<'_>, top: i32) {
        let timeline = &material.plots.timeline;
        for (index, name) in TROUBLES.iter().enumerate() {
            let y = top + index as i32 * BUS_LANE + BUS_LANE / 2;
            canvas.text((self.meta_left - 8, y), name, Font::new(12).right());
            canvas.text((self.column(0), y), &timeline.bus.totals[index].to_string(), Font::new(11).right());
        }
        for (index, mark) in MARKS.iter().enumerate() {
            let font = Font::new(11).right().bold();
            canvas.text((self.column(index), self.lanes_top - 10), mark.column, font);
        }
        let lanes = Lanes::new(timeline.slaves.len(), self.lanes_top, self.meta_left, self.totals_left);
        for (index, (slave, lane)) in material.meta.slaves.iter().zip(&timeline.slaves).enumerate() {
            lanes.name(canvas, index, self.meta_left, &format!("slave {slave}"));
            let y = lanes.lane(index).centre().1;
            for (column, &total) in lane.totals.iter().enumerate().filter(|total| *total.1 > 0) {
                let font = Font::new(lanes.letters().min(11)).right();
                canvas.text((self.column(column), y), &total.to_string(), font);
            }
        }
    }
}

/// One stretch of time over all lanes.
struct Panel<'a> {
    material: &'a Material<'a>,
    area: Area,
    lanes_top: i32,
    whole: bool,
    cycles: u64,
}

impl Panel<'_> {
    fn buckets<'l>(&self, lane: &'l Lane) -> &'l Buckets<Cell> {
        if self.whole { &lane.whole } else { &lane.start }
    }

    fn draw(&self, canvas: &mut Canvas<'_>, counters: bool) {
        let timeline = &self.material.plots.timeline;
        let (unit, cycle) = self.material.meta.time_unit(self.cycles);
        let axis = Axis::linear(format!("time [{unit}]"), 0.0, self.cycles as f64 * cycle);
        let ruler = Ruler::draw(canvas, self.area, axis);
        let x = |cycles: u64| ruler.x(cycles.min(self.cycles) as f64 * cycle);
        for row in 0..TROUBLES.len() {
            let top = self.area.top + row as i32 * BUS_LANE;
            let lane = Area { top, bottom: top + BUS_LANE - 3, ..self.area };
            canvas.fill(lane, FAINT);
            let mut free = lane.left;
            for (first, _) in self.buckets(&timeline.bus).iter().filter(|cell| cell.1.marks & 1 << row != 0) {
                bar(canvas, lane, x(first), &mut free, INK);
            }
        }
        let lanes = Lanes::new(timeline.slaves.len(), self.lanes_top, self.area.left, self.area.right);
        let top = highest_counter(timeline);
        for (index, slave) in timeline.slaves.iter().enumerate() {
            lanes.ground(canvas, index);
            let (lane, buckets) = (lanes.lane(index), self.buckets(slave));
            let strip = lamp_height(lane.height());
            let place = Area { bottom: lane.bottom - LAMPS.len() as i32 * strip - 1, ..lane };
            phases(canvas, place, buckets, x);
            if counters {
                counter(canvas, place, buckets, top, x);
            }
            marks(canvas, place, buckets, x);
            canvas.fill(Area { top: place.bottom, bottom: place.bottom + 1, ..lane }, WHITE);
            lamps(canvas, Area { top: place.bottom + 1, ..lane }, buckets, x);
        }
    }
}

/// Height of the strip of one lamp in a lane of this height [px].
fn lamp_height(lane: i32) -> i32 {
    (lane / 8).clamp(2, 4)
}

fn lamps(canvas: &mut Canvas<'_>, place: Area, buckets: &Buckets<Cell>, x: impl Fn(u64) -> i32) {
    let cells: Vec<(u64, Option<Leds>)> = buckets.iter().map(|(first, cell)| (first, cell.leds)).collect();
    let each = place.height() / LAMPS.len() as i32;
    for run in cells.chunk_by(|a, b| a.1 == b.1) {
        let Some(leds) = run[0].1 else { continue };
        let (left, right) = (x(run[0].0), x(run[run.len() - 1].0 + buckets.cycles_each()));
        for (row, (of, colour)) in (0..).zip(LAMPS) {
            let lit = match of(leds) {
                Lamp::Dark => Lit::Dark,
                Lamp::Bright => Lit::Full,
                Lamp::Flashing => Lit::Striped,
            };
            let top = place.top + row * each;
            lamp(canvas, Area { left, right, top, bottom: top + each }, lit, colour);
        }
    }
}

fn phases(canvas: &mut Canvas<'_>, place: Area, buckets: &Buckets<Cell>, x: impl Fn(u64) -> i32) {
    let cells: Vec<(u64, Option<Phase>)> = buckets.iter().map(|(first, cell)| (first, cell.phase)).collect();
    for run in cells.chunk_by(|a, b| a.1 == b.1) {
        let Some(phase) = run[0].1 else { continue };
        let (left, right) = (x(run[0].0), x(run[run.len() - 1].0 + buckets.cycles_each()));
        let colour = PHASES.iter().find(|entry| entry.0 == phase).map_or(GREY, |entry| entry.1);
        canvas.fill(Area { left, right, ..place }, colour);
    }
}

fn counter(canvas: &mut Canvas<'_>, place: Area, buckets: &Buckets<Cell>, top: u16, x: impl Fn(u64) -> i32) {
    let y = |counter: u16| place.bottom - i32::from(counter) * place.height() / i32::from(top.max(1));
    let cells: Vec<(u64, u16)> = buckets.iter().map(|(first, cell)| (first, cell.counter)).collect();
    for run in cells.chunk_by(|a, b| (a.1 > 0) == (b.1 > 0)).filter(|run| run[0].1 > 0) {
        let steps = run
            .iter()
            .flat_map(|&(first, counter)| [(x(first), y(counter)), (x(first + buckets.cycles_each()), y(counter))]);
        let mut line: Vec<(i32, i32)> = steps.collect();
        line.dedup();
        canvas.path(&line, GREY, 1);
    }
}

fn marks(canvas: &mut Canvas<'_>, place: Area, buckets: &Buckets<Cell>, x: impl Fn(u64) -> i32) {
    let mut free = place.left;
    for (first, cell) in buckets.iter().filter(|cell| cell.1.marks != 0) {
        for (_, mark) in MARKS.iter().enumerate().filter(|(index, _)| cell.marks & 1 << index != 0) {
            let half = |halves: i32| place.top + place.height() * halves / 2;
            let lane = Area { top: half(mark.from), bottom: half(mark.to), ..place };
            bar(canvas, lane, x(first), &mut free, mark.colour);
        }
    }
}

/// A mark at `x`, or beside its neighbour, which ends at `free`.
fn bar(canvas: &mut Canvas<'_>, lane: Area, x: i32, free: &mut i32, colour: RGBColor) {
    let left = if *free - x > ASIDE { x } else { x.max(*free) }.min(lane.right - MARK);
    canvas.fill(Area { left, right: left + MARK, ..lane }, colour);
    *free = left + MARK;
}
