//! Publish latency: the three latencies of slave-to-slave data per link (Model: D26).

use plotters::style::RGBColor;

use super::Material;
use super::chart::{Axis, Chart, plain};
use super::distribution::{Distribution, Grid, LinkLatencies};
use super::look::{
    Area, BLUE, Canvas, Font, GREY, INK, Key, Swatch, VERMILION, Words, counted, empty_page, fit, page, series, swatch,
};

const COLUMNS: usize = 100;
/// Height of a panel [px].
const PANEL: i32 = 300;
/// Width of the table beside a panel [px].
const TABLE: i32 = 510;
/// Width of the links' names in the table [px].
const NAMES: i32 = 190;
/// Most links that are drawn one by one.
const MAX_LINKS: usize = 7;

/// One of the three latencies.
struct Kind {
    title: &'static str,
    of: fn(&LinkLatencies) -> &Distribution,
}

const KINDS: [Kind; 3] = [
    Kind { title: "Wire: first bit sent by the publisher to last bit at the subscriber", of: |link| &link.wire },
    Kind { title: "Publish: publisher's latch to last bit at the subscriber", of: |link| &link.publish },
    Kind { title: "Age at use: publisher's latch to the subscriber's T_O", of: |link| &link.age },
];

/// One outline and its line in the table.
struct Entry<'a> {
    key: Key,
    counts: Vec<f64>,
    marks: Option<&'a Distribution>,
}

/// Draws `publish_latency.svg`.
pub(super) fn draw(material: &Material<'_>) -> Result<String, String> {
    let links = &material.distributions.links;
    let how = if links.len() > MAX_LINKS {
        "Too many links to tell apart: the sum of all links and the links with the smallest and the largest maximum."
    } else {
        "One outline per link; where outlines coincide the last one is seen, the table names all."
    };
    let words = Words {
        title: "Publish latency: how old slave-to-slave data are, per link",
        subtitle: format!("{}. {how} Height: cycles per column, logarithmic.", counted(links.len() as u64, "link")),
        plotted: "wire latency, publish latency and age at use per link, histograms",
    };
    if links.iter().all(|link| KINDS.iter().all(|kind| (kind.of)(link).range().is_none())) {
        let why = if material.meta.links.is_empty() {
            "This scenario has no slave-to-slave links."
        } else {
            "No slave-to-slave data were taken over in this run."
        };
        return empty_page(material.meta, &words, why);
    }
    page(material.meta, &words, PANEL * KINDS.len() as i32, |canvas, area| {
        for (index, kind) in KINDS.iter().enumerate() {
            let top = area.top + index as i32 * PANEL;
            panel(canvas, Area { top, bottom: top + PANEL, ..area }, kind, links);
        }
    })
}

fn panel(canvas: &mut Canvas<'_>, area: Area, kind: &Kind, links: &[LinkLatencies]) {
    canvas.text((area.left, area.top + 14), kind.title, Font::new(14).bold());
    let filled: Vec<&LinkLatencies> = links.iter().filter(|link| (kind.of)(link).range().is_some()).collect();
    let body = Area { top: area.top + 30, ..area };
    let Some(grid) = Grid::over(filled.iter().map(|link| (kind.of)(link)), COLUMNS) else {
        canvas.text(body.centre(), "Nothing of this kind was recorded.", Font::new(14).middle().ink(GREY));
        return;
    };
    let x = Axis::over("latency [us]", &grid);
    let entries = entries(kind, &filled, &grid);
    let most = entries.iter().flat_map(|entry| entry.counts.iter().copied()).fold(0.0, f64::max);
    let outer = Area { right: area.right - TABLE, ..body };
    let chart = Chart::draw(canvas, outer, x, Axis::counts("cycles (logarithmic)", most));
    for entry in &entries {
        chart.outline(canvas, &grid, &entry.counts, entry.key.colour);
    }
    table(canvas, Area { left: area.right - TABLE, ..body }, &entries);
}

fn name(link: &LinkLatencies) -> String {
    format!("{} → {}", link.publisher, link.subscriber)
}

fn entries<'a>(kind: &Kind, links: &[&'a LinkLatencies], grid: &Grid) -> Vec<Entry<'a>> {
    let entry = |label: String, link: &'a LinkLatencies, colour: RGBColor| {
        let of = (kind.of)(link);
        Entry { key: Key::new(label, colour, Swatch::Line), counts: of.columns(grid), marks: Some(of) }
    };
    if links.len() <= MAX_LINKS {
        let one = |(index, link): (usize, &&'a LinkLatencies)| entry(name(link), link, series(index).0);
        return links.iter().enumerate().map(one).collect();
    }
    let mut sum = Vec::new();
    for link in links {
        let counts = (kind.of)(link).columns(grid);
        sum.resize(counts.len(), 0.0);
        sum.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
    }
    let all = Key::new(format!("all {} links", links.len()), GREY, Swatch::Line);
    let mut entries = vec![Entry { key: all, counts: sum, marks: None }];
    let best = links.iter().copied().reduce(|a, b| if (kind.of)(b).top() < (kind.of)(a).top() { b } else { a });
    entries.extend(best.map(|link| entry(format!("smallest: {}", name(link)), link, BLUE)));
    let worst = links.iter().copied().reduce(|a, b| if (kind.of)(b).top() > (kind.of)(a).top() { b } else { a });
    entries.extend(worst.map(|link| entry(format!("largest: {}", name(link)), link, VERMILION)));
    entries
}

/// To the nanosecond as far as a column has room.
fn exact(value: f64) -> String {
    let decimals = match value.abs() {
        v if v >= 10_000.0 => 1,
        v if v >= 1_000.0 => 2,
        _ => 3,
    };
    plain(value, decimals)
}

/// The legend with the percentiles of each entry.
fn table(canvas: &mut Canvas<'_>, area: Area, entries: &[Entry<'_>]) {
    const ROW: i32 = 22;
    let Some(header) = entries.iter().find_map(|entry| entry.marks) else { return };
    let column = (area.width() - NAMES) / header.marks.len().max(1) as i32;
    let right = |index: usize| area.left + NAMES + (index as i32 + 1) * column;
    let y = area.top + 12;
    canvas.text((area.left + 10, y), "link [us]", Font::new(12).bold());
    for (index, (label, _)) in header.marks.iter().enumerate() {
        canvas.text((right(index), y), &fit(label, 12, column - 6), Font::new(12).right().bold());
    }
    canvas.path(&[(area.left + 10, y + 11), (area.right, y + 11)], INK, 1);
    for (row, entry) in entries.iter().enumerate() {
        let y = y + ROW * (row as i32 + 1);
        swatch(canvas, (area.left + 10, y), &entry.key);
        canvas.text((area.left + 44, y), &fit(&entry.key.label, 12, NAMES - 48), Font::new(12));
        for (index, (_, value)) in entry.marks.iter().flat_map(|of| of.marks.iter()).enumerate() {
            let text = exact(*value);
            canvas.text((right(index), y), &fit(&text, 12, column - 6), Font::new(12).right());
        }
    }
}
