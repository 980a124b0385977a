//! Recovery: how long disturbances took to lead to a fault, and slaves to come back to full operation.

use super::Material;
use super::chart::{Axis, Ruler, short};
use super::look::{
    Area, BLUE, Canvas, FAINT, Font, GREEN, Key, Shape, Swatch, VERMILION, WIDTH, Words, counted, empty_page, legend,
    legend_height, page,
};
use crate::study::episode::{Episodes, Harm, SINGLES, Times};
use crate::time::Span;

/// Bins of a histogram.
const BINS: usize = 160;
/// Height of the lane of one kind [px].
const LANE: i32 = 62;
/// Height of a title over lanes [px].
const TITLE: i32 = 30;
/// Width of the words in front of a lane [px].
const NAMES: i32 = 190;
/// Width of the numbers behind a lane [px].
const NUMBERS: i32 = 300;
/// Radius of a dot [px].
const DOT: i32 = 4;
/// Space below a ruler [px].
const GAP: i32 = 14;

/// Times of one kind for the picture, in milliseconds.
#[derive(Clone, PartialEq, Debug)]
pub struct EpisodeTimes {
    /// Back to full operation, instead of from a disturbance to a fault.
    pub recovery: bool,
    /// What the disturbance led to, or what ended full operation: `0F04`, `loss`.
    pub harm: String,
    /// From, up to, how many; ascending. Of few values one each, from and up to the same.
    pub bins: Vec<(f64, f64, u64)>,
    /// How many in all.
    pub count: u64,
    /// Half of them are no longer.
    pub median: f64,
    /// The longest.
    pub max: f64,
}

impl EpisodeTimes {
    /// Everything that a run has of them.
    pub fn all(episodes: &Episodes) -> Vec<Self> {
        let each = |recovery| move |(&harm, times): (&Harm, &Times)| Self::of(recovery, harm, times);
        let faults = episodes.to_harm().iter().filter_map(each(false));
        faults.chain(episodes.recovery().iter().filter_map(each(true))).collect()
    }
    fn of(recovery: bool, harm: Harm, times: &Times) -> Option<Self> {
        let histogram = times.histogram();
        let singles = times.singles().map(|singles| {
            let mut singles: Vec<Span> = singles.to_vec();
            singles.sort_unstable();
            singles.into_iter().map(|time| (time.as_ms(), time.as_ms(), 1)).collect()
        });
        let bins = || histogram.bins(BINS).iter().map(|bin| (bin.from.as_ms(), bin.to.as_ms(), bin.count)).collect();
        Some(Self {
            recovery,
            harm: harm.to_string(),
            bins: singles.unwrap_or_else(bins),
            count: histogram.count(),
            median: histogram.percentile(50.0)?.as_ms(),
            max: histogram.max()?.as_ms(),
        })
    }
}

/// Draws `recovery.svg`.
pub(super) fn draw(material: &Material<'_>) -> Result<String, String> {
    let all = &material.distributions.episodes;
    let of = |recovery| all.iter().filter(|times| times.recovery == recovery).collect::<Vec<_>>();
    let (faults, recoveries) = (of(false), of(true));
    let total = |times: &[&EpisodeTimes]| counted(times.iter().map(|times| times.count).sum(), "time");
    let words = Words {
        title: "Recovery: from a disturbance to a fault, and from the end of full operation to the next",
        subtitle: format!(
            "{} from a disturbance, {} to recover, over all slaves. Full operation: DATA_EXCH, PLL locked and phase 5. Up to \
             {SINGLES} times of a kind are dots, equal ones above each other; more are bars whose height is logarithmic.",
            total(&faults),
            total(&recoveries),
        ),
        plotted: "times from disturbance to fault and from the end of full operation to the next",
    };
    if all.is_empty() {
        return empty_page(material.meta, &words, "No slave was harmed: there are no times to show.");
    }
    let keys = [
        Key::new("from a disturbance", VERMILION, Swatch::Mark(Shape::Dot)),
        Key::new("back to full operation", GREEN, Swatch::Mark(Shape::Dot)),
        Key::new("median", BLUE, Swatch::Dashes),
        Key::new("maximum", BLUE, Swatch::Line),
    ];
    let height = |times: &[&EpisodeTimes]| match times.len() as i32 {
        0 => 0,
        lanes => TITLE + lanes * LANE + Ruler::HEIGHT + GAP,
    };
    let body = legend_height(&keys, WIDTH - 40) + height(&faults) + height(&recoveries);
    page(material.meta, &words, body, |canvas, mut area| {
        legend(canvas, &mut area, &keys);
        for (title, times) in
            [("From the first disturbance", &faults), ("From the end of full operation to the next", &recoveries)]
        {
            if !times.is_empty() {
                panel(canvas, Area { bottom: area.top + height(times) - GAP, ..area }, title, times);
                area.top += height(times);
            }
        }
    })
}

fn label(times: &EpisodeTimes) -> String {
    match (times.harm.as_str(), times.recovery) {
        ("loss", false) => "to a loss without fault".to_owned(),
        ("loss", true) => "after a loss".to_owned(),
        (code, false) => format!("to fault {code}"),
        (code, true) => format!("after fault {code}"),
    }
}

/// Times of one kind below each other, with one axis.
fn panel(canvas: &mut Canvas<'_>, area: Area, title: &str, all: &[&EpisodeTimes]) {
    canvas.text((area.left, area.top + TITLE / 2), title, Font::new(14).bold());
    let longest = all.iter().map(|times| times.max).fold(0.0, f64::max);
    let (unit, each) = if longest >= 10_000.0 { ("s", 1_000.0) } else { ("ms", 1.0) };
    let plot = Area {
        left: area.left + NAMES,
        right: area.right - NUMBERS,
        top: area.top + TITLE,
        bottom: area.bottom - Ruler::HEIGHT,
    };
    let lane = |index: usize| {
        let top = plot.top + index as i32 * LANE;
        Area { top, bottom: top + LANE - 4, ..plot }
    };
    (0..all.len()).for_each(|index| canvas.fill(lane(index), FAINT));
    let ruler = Ruler::draw(canvas, plot, Axis::linear(format!("time [{unit}]"), 0.0, longest / each * 1.04));
    for (index, times) in all.iter().enumerate() {
        let lane = lane(index);
        let middle = lane.centre().1;
        canvas.text((lane.left - 8, middle), &label(times), Font::new(12).right());
        let x = |ms: f64| ruler.x(ms / each);
        let colour = if times.recovery { GREEN } else { VERMILION };
        let (median, max) = (x(times.median), x(times.max));
        canvas.path(&[(max, lane.top), (max, lane.bottom)], BLUE, 2);
        canvas.dashes((median, lane.top), (median, lane.bottom), BLUE);
        if times.bins.iter().all(|bin| bin.0 >= bin.1) {
            dots(canvas, lane, &times.bins.iter().map(|bin| x(bin.0)).collect::<Vec<_>>(), colour);
        } else {
            let bins: Vec<_> = times.bins.iter().map(|&(from, to, count)| (x(from), x(to), count)).collect();
            bars(canvas, lane, &bins, colour);
        }
        let numbers = if times.count == 1 {
            format!("once, {}", value(times.max))
        } else {
            format!("n = {}, median {}, max {}", times.count, value(times.median), value(times.max))
        };
        canvas.text((lane.right + 10, middle), &numbers, Font::new(12));
    }
}

/// A time in the unit that suits it, whatever the axis has.
fn value(ms: f64) -> String {
    if ms >= 10_000.0 { format!("{} s", short(ms / 1_000.0)) } else { format!("{} ms", short(ms)) }
}

/// A dot per value, those that meet above each other, as far as the lane is high.
fn dots(canvas: &mut Canvas<'_>, lane: Area, values: &[i32], colour: plotters::style::RGBColor) {
    let mut placed: Vec<(i32, i32)> = Vec::with_capacity(values.len());
    for &x in values {
        let meets = |y: i32| placed.iter().any(|&(px, py)| (px - x).abs() < 2 * DOT && py == y);
        let mut levels = (0..LANE / (2 * DOT + 1) - 1).map(|level| lane.bottom - DOT - 3 - level * (2 * DOT + 1));
        let y = levels.find(|&y| !meets(y)).unwrap_or(lane.top + DOT);
        placed.push((x, y));
        canvas.marker((x, y), Shape::Dot, DOT, colour);
    }
}

fn bars(canvas: &mut Canvas<'_>, lane: Area, bins: &[(i32, i32, u64)], colour: plotters::style::RGBColor) {
    let bent = |count: u64| libm::log10(1.0 + count as f64);
    let most = bins.iter().map(|bin| bin.2).max().map_or(1.0, bent);
    for &(left, right, count) in bins.iter().filter(|bin| bin.2 > 0) {
        let height = libm::round(bent(count) / most * f64::from(lane.height() - 8)) as i32;
        canvas.fill(Area { left, right: right.max(left + 2), top: lane.bottom - height.max(2), ..lane }, colour);
    }
}
