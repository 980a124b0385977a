//! Budget: where the clock window of each encoder goes, as a waterfall.
//!
//! Each part begins where the one above ends. Of many encoders the two with the least left are drawn in full, and all of
//! them as one bar each.

use plotters::style::RGBColor;

use super::chart::{Axis, Ruler, plain};
use super::lanes::Lanes;
use super::look::{
    Area, BLACK, BLUE, Canvas, FAINT, Font, GREEN, GREY, INK, Key, ORANGE, PURPLE, SKY, Swatch, VERMILION, WIDTH,
    Words, counted, legend, legend_height, page,
};
use super::{PlotError, plan};
use crate::study::budget::measure::SETTLING;
use crate::study::budget::{Budget, SlaveBudget, SlaveShares};
use crate::study::scenario::Scenario;
use crate::time::Span;

const FILE: &str = "budget.svg";
/// Most encoders that are all drawn in full.
const FULL: usize = 4;
/// Of more, those in full.
const WORST: usize = 2;
/// Height of one part [px].
const ROW: i32 = 19;
/// Height of the title over a waterfall [px].
const TITLE: i32 = 30;
/// Width of the words in front of the parts [px].
const NAMES: i32 = 150;
/// Width of the numbers behind the parts [px].
const NUMBERS: i32 = 240;
/// Space below a ruler [px].
const GAP: i32 = 16;
/// Of a part, how strongly that is drawn which the loop adds.
const ADDED: f64 = 0.45;

/// Of the sources, one after the other: as many as there can be.
const COLOURS: [RGBColor; 10] = [
    BLUE,
    ORANGE,
    PURPLE,
    GREEN,
    SKY,
    RGBColor(0x8B, 0x5A, 0x2B),
    RGBColor(0xF0, 0xE4, 0x42),
    RGBColor(0x44, 0x3A, 0x8C),
    RGBColor(0x9A, 0x8B, 0x00),
    RGBColor(0xD9, 0xBF, 0x9C),
];
/// What is left of the window.
const LEFT: RGBColor = RGBColor(0xBF, 0xE3, 0xD0);

/// A part of the window.
struct Part {
    title: String,
    colour: RGBColor,
    /// Without and with what the loop adds [ns].
    direct: f64,
    size: f64,
    /// Behind the number.
    note: String,
}

/// Draws `budget.svg`.
///
/// # Errors
/// What the library says.
pub fn draw(scenario: &Scenario, budget: &Budget) -> Result<String, PlotError> {
    picture(scenario, budget).map_err(|reason| PlotError { file: FILE, reason })
}

fn picture(scenario: &Scenario, budget: &Budget) -> Result<String, String> {
    let shared: Vec<(&SlaveBudget, &SlaveShares)> =
        budget.slaves.iter().filter_map(|slave| Some((slave, slave.shares.as_ref()?))).collect();
    let missing = budget.slaves.len() - shared.len();
    let mut full = shared.clone();
    if full.len() > FULL {
        full.sort_by_key(|slave| slave.0.left());
        full.truncate(WORST);
    }
    let words = words(budget, missing, full.len() < shared.len());
    let meta = plan::meta(scenario);
    if shared.is_empty() {
        let why = format!(
            "No encoder was locked for {SETTLING} cycles in a row in every run: there is nothing to share out."
        );
        return super::look::empty_page(&meta, &words, &why);
    }
    let keys = keys(budget);
    let block = TITLE + ROW * (budget.sources.len() as i32 + 3) + Ruler::HEIGHT + GAP;
    let lanes = if full.len() < shared.len() {
        TITLE + Lanes::each(shared.len()) * shared.len() as i32 + Ruler::HEIGHT
    } else {
        0
    };
    let height = legend_height(&keys, WIDTH - 40) + full.len() as i32 * block + lanes;
    let most = shared.iter().map(|slave| reach(budget, slave)).fold(0.0, f64::max);
    page(&meta, &words, height, |canvas, mut area| {
        legend(canvas, &mut area, &keys);
        for slave in &full {
            waterfall(canvas, Area { bottom: area.top + block - GAP, ..area }, (budget, slave), most);
            area.top += block;
        }
        if full.len() < shared.len() {
            bars(canvas, area, (budget, &shared), most);
        }
    })
}

fn words(budget: &Budget, missing: usize, many: bool) -> Words<'static> {
    let many = if many {
        format!(" In full: the {WORST} encoders with the least left; below, all of them, parts in the same order.")
    } else {
        String::new()
    };
    let missing = match missing {
        0 => String::new(),
        one => format!(
            " {} without a budget: not locked for {SETTLING} cycles in a row in every run.",
            counted(one as u64, "encoder")
        ),
    };
    Words {
        title: "Margin budget: what uses up the clock window T_PLL_W of each encoder",
        subtitle: format!(
            "the largest |e|, arrival of SYNCH minus its prediction, of {}, while locked and settled. Each source was \
             switched off and run alone with the same draws, {} in all. Pale: what the loop adds to a source, since its \
             prediction follows a part of every jitter. Interaction: what the parts together lack or have too much.{many}{missing}",
            counted(budget.slaves.len() as u64, "encoder"),
            counted(budget.runs as u64, "run"),
        ),
        plotted: "parts of the largest PLL error per encoder",
    }
}

fn keys(budget: &Budget) -> Vec<Key> {
    let sources = budget.sources.iter().zip(COLOURS.iter().cycle());
    let sources = sources.map(|(source, colour)| Key::new(source.title, *colour, Swatch::Fill));
    let others = [
        Key::new("what the loop adds", INK, Swatch::Pale),
        Key::new("rest, all sources off", GREY, Swatch::Fill),
        Key::new("interaction", BLACK, Swatch::Fill),
        Key::new("left", LEFT, Swatch::Fill),
        Key::new("beyond the window", VERMILION, Swatch::Fill),
        Key::new("T_PLL_W", VERMILION, Swatch::Dashes),
    ];
    sources.chain(others).collect()
}

/// The parts of one encoder from the first source to the interaction.
fn parts(budget: &Budget, shares: &SlaveShares) -> Vec<Part> {
    let plain_part = |title: &str, colour, size: Span| Part {
        title: title.to_owned(),
        colour,
        direct: size.as_ns(),
        size: size.as_ns(),
        note: String::new(),
    };
    let source = |(index, source): (usize, &&crate::study::budget::source::Source)| Part {
        direct: shares.direct.parts[index].as_ns(),
        note: format!(", loop adds {}", number(shares.loop_adds(index).as_ns())),
        ..plain_part(source.title, COLOURS[index % COLOURS.len()], shares.worst.parts[index])
    };
    let others =
        [plain_part("rest", GREY, shares.worst.rest), plain_part("interaction", BLACK, shares.worst.interaction)];
    budget.sources.iter().enumerate().map(source).chain(others).collect()
}

/// The largest value that is drawn for an encoder [ns].
fn reach(budget: &Budget, (slave, shares): &(&SlaveBudget, &SlaveShares)) -> f64 {
    let mut end = 0.0;
    let mut most = slave.window.as_ns().max(shares.worst.whole.as_ns());
    for part in parts(budget, shares) {
        most = most.max(end + part.direct.max(part.size));
        end += part.size;
    }
    most
}

fn number(ns: f64) -> String {
    plain(ns, 1)
}

/// One encoder in full.
fn waterfall(canvas: &mut Canvas<'_>, area: Area, of: (&Budget, &(&SlaveBudget, &SlaveShares)), most: f64) {
    let (budget, (slave, shares)) = of;
    let (whole, window) = (shares.worst.whole.as_ns(), slave.window.as_ns());
    let verdict = if whole > window {
        format!("{} ns beyond the window", number(whole - window))
    } else {
        format!("{} ns left", number(window - whole))
    };
    let title = format!(
        "slave {}: largest |e| {} ns of {} ns in {}, {verdict}",
        slave.address,
        number(whole),
        number(window),
        counted(slave.cycles, "cycle")
    );
    canvas.text((area.left, area.top + TITLE / 2), &title, Font::new(14).bold());
    let plot = Area {
        left: area.left + NAMES,
        right: area.right - NUMBERS,
        top: area.top + TITLE,
        bottom: area.bottom - Ruler::HEIGHT,
    };
    canvas.fill(plot, FAINT);
    let ruler = Ruler::draw(canvas, plot, Axis::linear("|e| [ns]", 0.0, most * 1.03));
    let mut end = 0.0;
    for (index, part) in parts(budget, shares).iter().enumerate() {
        let top = plot.top + index as i32 * ROW;
        row(canvas, &ruler, Area { top, bottom: top + ROW, ..plot }, part, end);
        end += part.size;
        let x = ruler.x(end);
        canvas.path(&[(x, top + 2), (x, top + 2 * ROW - 3)], INK, 1);
    }
    let top = plot.bottom - ROW;
    let over = whole > window;
    let last = Part {
        title: if over { "beyond the window" } else { "left" }.to_owned(),
        colour: if over { VERMILION } else { LEFT },
        direct: window - whole,
        size: window - whole,
        note: String::new(),
    };
    row(canvas, &ruler, Area { top, ..plot }, &last, whole);
    let x = ruler.x(window);
    canvas.dashes((x, plot.top), (x, plot.bottom), VERMILION);
}

/// One part: its words, its bar from `from` on, its number.
fn row(canvas: &mut Canvas<'_>, ruler: &Ruler, area: Area, part: &Part, from: f64) {
    let middle = area.centre().1;
    canvas.text((area.left - 8, middle), &part.title, Font::new(12).right());
    let bar = Area { top: area.top + 3, bottom: area.bottom - 3, ..area };
    steps(canvas, ruler, bar, part, from);
    canvas.text((area.right + 10, middle), &format!("{} ns{}", number(part.size), part.note), Font::new(12));
}

/// The bar of one part: what it is itself, and what the loop adds or takes away.
fn steps(canvas: &mut Canvas<'_>, ruler: &Ruler, area: Area, part: &Part, from: f64) {
    let mut piece = |a: f64, b: f64, opacity: f64| {
        let (a, b) = (ruler.x(from + a), ruler.x(from + b));
        if a != b {
            canvas.tint(Area { left: a.min(b), right: a.max(b), ..area }, part.colour, opacity);
        }
    };
    // What the loop takes away of a source is not drawn twice.
    piece(0.0, if part.size * part.direct > 0.0 { smaller(part.direct, part.size) } else { part.direct }, 1.0);
    piece(part.direct, part.size, ADDED);
}

fn smaller(a: f64, b: f64) -> f64 {
    if a.abs() < b.abs() { a } else { b }
}

/// All encoders, a bar each.
fn bars(canvas: &mut Canvas<'_>, area: Area, of: (&Budget, &[(&SlaveBudget, &SlaveShares)]), most: f64) {
    let (budget, slaves) = of;
    canvas.text((area.left, area.top + TITLE / 2), "All encoders", Font::new(14).bold());
    let (left, right, top) = (area.left + NAMES, area.right - NUMBERS, area.top + TITLE);
    let lanes = Lanes::new(slaves.len(), top, left, right);
    (0..slaves.len()).for_each(|index| lanes.ground(canvas, index));
    let plot = Area { left, right, top, bottom: top + Lanes::each(slaves.len()) * slaves.len() as i32 };
    let ruler = Ruler::draw(canvas, plot, Axis::linear("|e| [ns]", 0.0, most * 1.03));
    for (index, (slave, shares)) in slaves.iter().enumerate() {
        let lane = lanes.lane(index);
        lanes.name(canvas, index, left, &format!("slave {}", slave.address));
        let (whole, window) = (shares.worst.whole.as_ns(), slave.window.as_ns());
        let mut end = 0.0;
        for part in parts(budget, shares) {
            // Steps back lie on the lower half, so that what they take back stays seen.
            let bar = if part.size < 0.0 { Area { top: lane.centre().1, ..lane } } else { lane };
            steps(canvas, &ruler, bar, &part, end);
            end += part.size;
        }
        let colour = if whole > window { VERMILION } else { LEFT };
        let (a, b) = (ruler.x(whole), ruler.x(window));
        canvas.fill(
            Area { left: a.min(b), right: a.max(b), top: lane.centre().1 - 2, bottom: lane.centre().1 + 2 },
            colour,
        );
        canvas.path(&[(b, lane.top), (b, lane.bottom)], VERMILION, 2);
        let text = format!("{} ns, {} ns left", number(whole), number(window - whole));
        canvas.text((right + 10, lane.centre().1), &text, Font::new(lanes.letters()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::profile::find;
    use crate::study::budget::Shares;
    use crate::study::budget::source::SOURCES;
    use crate::study::plot::tests::all_inside_and_apart;
    use crate::study::scenario::tests::network;
    use crate::time::BitRate;
    use crate::wire::Address;

    /// A budget of so many encoders and sources, the encoder in the middle without shares where `gap` says so. Every
    /// third part is below zero, and of every fourth encoder e left the window.
    fn invented(slaves: usize, sources: usize, gap: bool) -> Budget {
        let shares = |index: usize, part: i64| {
            let sign = |source: usize| if source % 3 == 2 { -1 } else { 1 };
            let parts: Vec<_> = (0..sources).map(|n| Span::from_ns(part * sign(n) * (1 + (n as i64) % 4))).collect();
            let (rest, interaction) = (Span::from_ns(20), Span::from_ns(-35));
            let far = if index % 4 == 3 { Span::from_us(1) } else { Span::ZERO };
            Shares {
                whole: rest + far + interaction + parts.iter().copied().sum(),
                rest: rest + far,
                parts,
                interaction,
            }
        };
        let slave = |index: usize| SlaveBudget {
            address: Address::new(index as u8 + 3).unwrap(),
            device: "posital-ocd-dpb1b".to_owned(),
            window: Span::from_us(1),
            cycles: 1_234_567,
            shares: (!gap || index != slaves / 2).then(|| SlaveShares {
                worst: shares(index, 120),
                p99_9: shares(index, 90),
                direct: shares(index, 70),
            }),
        };
        Budget {
            scenario: "invented".to_owned(),
            seed: 42,
            sources: SOURCES[..sources].iter().collect(),
            runs: 2 * sources + 2,
            slaves: (0..slaves).map(slave).collect(),
        }
    }

    /// No source, one and all of them; one encoder, as many as are drawn in full, and as many as a bus can have.
    #[test]
    fn everything_is_inside_and_no_two_texts_meet() {
        assert!(SOURCES.len() <= COLOURS.len(), "two sources would look alike");
        let scenario = network(BitRate::M12, find("posital-ocd-dpb1b").unwrap(), 1);
        for sources in [0, 1, 4, SOURCES.len()] {
            for (slaves, gap) in [(1, false), (FULL, false), (FULL + 2, true), (122, true)] {
                let budget = invented(slaves, sources, gap);
                let text = draw(&scenario, &budget).unwrap();
                all_inside_and_apart(&format!("{slaves} encoders, {sources} sources"), &text);
                for title in budget.sources.iter().map(|source| source.title) {
                    assert!(text.matches(title).count() > 1, "{title} in the legend and beside its bar");
                }
                assert_eq!(text.contains("All encoders"), slaves > FULL);
            }
        }
        let none = draw(&scenario, &invented(1, 2, true)).unwrap();
        all_inside_and_apart("no shares", &none);
        assert!(none.contains("there is nothing to share out"), "{none}");
    }
}
