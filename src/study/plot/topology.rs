//! Topology: the segments to scale, one below the other, with their stations and what joins them.

use plotters::style::RGBColor;

use super::Material;
use super::look::{
    Area, BLACK, Canvas, FAINT, Font, GREY, INK, Key, Shape, Swatch, WHITE, Words, fit, legend, legend_height, page,
    series, spread, text_width,
};
use crate::study::topology::{Map, Segment, Station};
use crate::time::Span;

/// Height of a segment's lane (px): title, link, line, addresses, delays.
const LANE: i32 = 190;
/// From the top of the lane to the line (px).
const LINE: i32 = 82;
/// From the line up to the way that leads to it, with its box (px).
const BOX: i32 = 36;
/// Room on the right for the ways from segment to segment (px), and how many lie beside each other.
const GUTTER: (i32, i32) = (70, 8);
/// Least distance of two addresses (px).
const LABEL: i32 = 26;
/// Free space at both ends of the longest cable (px).
const MARGIN: i32 = 30;
/// Most kinds of devices that the legend tells apart.
const DEVICES: usize = 12;

/// Draws `topology.svg`.
pub(super) fn draw(material: &Material<'_>) -> Result<String, String> {
    let map = &material.meta.topology;
    let none = if map.segments.len() > 1 { "" } else { " There is no repeater." };
    let far = map.farthest().filter(|station| station.delay > Span::ZERO);
    let far = far.map_or(String::new(), |Station { address, delay, .. }| {
        format!(" A telegram of the master reaches station {address} last, after {delay}.")
    });
    let words = Words {
        title: "Topology: segments, stations and delays",
        subtitle: format!(
            "{}, cables to scale; under each station its address and the delay from the master [ns].{far}{none}",
            map.counted()
        ),
        plotted: "segments of cable with stations and links, to scale",
    };
    let devices = devices(map);
    let mut keys: Vec<_> = devices.iter().enumerate().map(|(index, device)| key(index, device)).collect();
    if map.segments.len() > 1 {
        keys.push(Key::new("repeater or link module", GREY, Swatch::Mark(Shape::Square)));
    }
    let height = legend_height(&keys, super::look::WIDTH - 2 * MARGIN) + LANE * map.segments.len() as i32;
    page(material.meta, &words, height.max(LANE), |canvas, mut area| {
        legend(canvas, &mut area, &keys);
        let lanes = Lanes { area, longest: map.segments.iter().map(|s| s.cable_mm).max().unwrap_or(0).max(1) };
        for index in 0..map.segments.len() {
            lanes.ground(canvas, index);
        }
        for (index, segment) in map.segments.iter().enumerate() {
            lanes.link(canvas, index, segment);
        }
        for (index, segment) in map.segments.iter().enumerate() {
            lanes.segment(canvas, index, segment, &devices);
        }
    })
}

/// The kinds of devices in the order of the map.
fn devices(map: &Map) -> Vec<&str> {
    let mut devices: Vec<&str> = Vec::new();
    for station in map.segments.iter().flat_map(|segment| &segment.stations) {
        if !devices.contains(&station.device.as_str()) && devices.len() < DEVICES {
            devices.push(&station.device);
        }
    }
    // The master's colour is always the same.
    devices.sort_by_key(|&device| device != "master");
    devices
}

fn key(index: usize, device: &str) -> Key {
    let (colour, shape) = mark(index, device);
    Key::new(fit(device, 12, 300), colour, Swatch::Mark(shape))
}

/// How a device is drawn.
fn mark(index: usize, device: &str) -> (RGBColor, Shape) {
    if device == "master" { (BLACK, Shape::Square) } else { series(index.saturating_sub(1)) }
}

struct Lanes {
    area: Area,
    /// The longest cable (mm).
    longest: u64,
}

impl Lanes {
    fn top(&self, index: usize) -> i32 {
        self.area.top + LANE * index as i32
    }
    fn line(&self, index: usize) -> i32 {
        self.top(index) + LINE
    }
    fn x(&self, mm: u64) -> i32 {
        let room = f64::from(self.area.width() - 2 * MARGIN - GUTTER.0);
        self.area.left + MARGIN + (room * mm.min(self.longest) as f64 / self.longest as f64).round() as i32
    }

    fn ground(&self, canvas: &mut Canvas<'_>, index: usize) {
        let top = self.top(index);
        canvas.fill(Area { top: top + 2, bottom: top + LANE - 4, ..self.area }, FAINT);
    }
    /// The way from the segment on the master's side, and the box of the repeater or the modules on it.
    fn link(&self, canvas: &mut Canvas<'_>, index: usize, segment: &Segment) {
        let Some(via) = &segment.via else { return };
        let text = fit(&format!("{}: {}", via.what, via.delay_text()), 12, self.area.width() / 2);
        let wide = text_width(&text, 12) + 16;
        let (from, to) = (self.x(via.from_mm), self.x(via.to_mm));
        let (y, above) = (self.line(via.from), self.line(index) - BOX);
        // Neighbouring ways part by a few pixels, so that each can be followed.
        let number = index as i32 % GUTTER.1;
        let gutter = self.area.right - GUTTER.0 + 10 + number * (GUTTER.0 - 20) / GUTTER.1;
        let rise = y - 8 - 2 * number;
        let way = [(from, y), (from, rise), (gutter, rise), (gutter, above), (to, above), (to, self.line(index))];
        canvas.path(&way, GREY, 1);
        canvas.marker((from, y), Shape::Square, 6, GREY);
        canvas.marker((to, self.line(index)), Shape::Square, 6, GREY);
        let left = (to + 20).min(gutter - wide - 20);
        let frame = Area { left, top: above - 11, right: left + wide, bottom: above + 11 };
        canvas.fill(frame, WHITE);
        canvas.border(frame, INK);
        canvas.text(frame.centre(), &text, Font::new(12).middle());
    }
    fn segment(&self, canvas: &mut Canvas<'_>, index: usize, segment: &Segment, devices: &[&str]) {
        let y = self.line(index);
        let title = fit(&segment.title(), 13, self.area.width() - 12);
        canvas.text((self.area.left + 6, self.top(index) + 14), &title, Font::new(13).bold());
        canvas.path(&[(self.x(0), y), (self.x(segment.cable_mm), y)], INK, 3);
        for end in [0, segment.cable_mm] {
            canvas.path(&[(self.x(end), y - 6), (self.x(end), y + 6)], INK, 2);
        }
        let wanted: Vec<_> = segment.stations.iter().map(|station| (self.x(station.mm), LABEL)).collect();
        let centres = spread(&wanted, self.area.left, self.area.right - GUTTER.0);
        for (station, centre) in segment.stations.iter().zip(centres) {
            let device = devices.iter().position(|&device| device == station.device);
            let (colour, shape) = device.map_or((GREY, Shape::Dot), |index| mark(index, &station.device));
            let x = self.x(station.mm);
            canvas.path(&[(x, y), (x, y + 7), (centre, y + 16)], GREY, 1);
            canvas.marker((x, y), shape, 4, colour);
            canvas.text((centre, y + 22), &station.address.to_string(), Font::new(12).middle().bold());
            let delay = format!("{:.0} ns", station.delay.as_ns());
            canvas.text(
                (centre, y + 34 + text_width(&delay, 11) / 2),
                &delay,
                Font::new(11).middle().upwards().ink(GREY),
            );
        }
    }
}
