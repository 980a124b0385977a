//! Disturbances of paths and instants: receivers, repeaters and slow answers.

use super::station::{STATION, STATIONS, targets};
use super::{DisturbanceKind, Key};
use crate::sim::cut::Cuts;
use crate::sim::fault::What;
use crate::sim::fault::instant::InstantFault;
use crate::study::plan::rules::Facts;
use crate::study::quantity::span;
use crate::study::scenario::check::about;
use crate::study::scenario::error::Fault;
use crate::study::scenario::section::{Reader, Section, instant, quantity, suggestion, text};
use crate::study::scenario::topology::{Point, cable, station_segment};
use crate::study::scenario::tree::Node;
use crate::time::Span;

const HALF_WIDTH: Key = Key { name: "half_width", unit: "time", default: "-", what: "largest stray to either side" };

/// Receivers capture by themselves.
pub(super) const RECEIVER_JITTER: DisturbanceKind = DisturbanceKind {
    name: "receiver-jitter",
    what: "these stations capture the end of each telegram early or late, equally likely within the half width",
    keys: &[STATION, STATIONS, HALF_WIDTH],
    example: r#"kind = "receiver-jitter", stations = "all slaves", half_width = "100 ns", at = "1 s""#,
    read: |section, reader| {
        let half_width = section.required(reader, "half_width", "\"100 ns\"", instant);
        let stations = targets(section, reader);
        Some(What::Instant(stations?, InstantFault::Receiver { half_width: half_width? }))
    },
};
/// Answers come late.
pub(super) const T_SDR_JITTER: DisturbanceKind = DisturbanceKind {
    name: "t-sdr-jitter",
    what: "these slaves answer later than their T_SDR: by a fixed time, and by anything up to another one",
    keys: &[
        STATION,
        STATIONS,
        Key { name: "by", unit: "time or t_bit", default: "0", what: "every answer comes later by this" },
        Key {
            name: "up_to",
            unit: "time or t_bit",
            default: "0",
            what: "and by anything from 0 to this, equally likely",
        },
    ],
    example: r#"kind = "t-sdr-jitter", station = 3, up_to = "20 tbit", cycle = 1000, for = 500"#,
    read: |section, reader| {
        let rate = reader.around.rate;
        let time = |node: &Node| match quantity("20 tbit", |text| span(text, Some(rate)))(node)? {
            span if span < Span::ZERO => Err(Fault::new(format!("{span} is negative"))),
            span if span > Span::from_s(1) => Err(Fault::new(format!("{span} is no T_SDR")).help("at most 1 s")),
            span => Ok(span),
        };
        let by = section.optional(reader, "by", time);
        let up_to = section.optional(reader, "up_to", time);
        if !section.has("by") && !section.has("up_to") {
            section.complain(reader, Fault::new("by what?").help("by = \"5 us\", or up_to = \"20 tbit\", or both"));
        }
        let (by, up_to) = (by.unwrap_or(Span::ZERO), up_to.unwrap_or(Span::ZERO));
        targets(section, reader).map(|stations| What::Instant(stations, InstantFault::Answer { by, up_to }))
    },
};
/// A repeater strays more.
pub(super) const REPEATER_JITTER: DisturbanceKind = DisturbanceKind {
    name: "repeater-jitter",
    what: "the delay of a repeater strays by up to the half width, besides its own jitter",
    keys: &[
        Key {
            name: "repeater",
            unit: "name",
            default: "-",
            what: "the repeater, by its name or the names of its segments",
        },
        HALF_WIDTH,
    ],
    example: r#"kind = "repeater-jitter", repeater = "hall 1 - hall 2", half_width = "50 ns", at = "1 s""#,
    read: |section, reader| {
        let repeater = repeater(section, reader);
        let half_width = section.required(reader, "half_width", "\"50 ns\"", instant);
        Some(What::Repeater(repeater?, half_width?))
    },
};

/// A cable is cut.
pub(super) const CABLE_CUT: DisturbanceKind = DisturbanceKind {
    name: "cable-cut",
    what: "a cable is cut: both parts of the network go on by themselves and know nothing of each other",
    keys: &[
        Key { name: "segment", unit: "name", default: "the only one", what: "whose cable is cut" },
        Key { name: "position", unit: "length", default: "-", what: "where, from the beginning of the cable" },
    ],
    example: r#"kind = "cable-cut", position = "40 m", at = "1 s", for = "500 ms""#,
    read: |section, reader| {
        let topology = reader.around.topology.clone();
        let segment = station_segment(section, reader, topology.as_ref());
        let length = topology.as_ref().map_or(0, |topology| topology.segments()[usize::from(segment)].cable_mm);
        let inside = |node: &Node| match cable(node)? {
            0 => Err(Fault::new("the beginning of a cable parts nothing").help("position = \"1 m\" or more")),
            mm if mm >= length => {
                Err(Fault::new(format!("this cable is {} m long", length as f64 / 1e3)).help("a place before its end"))
            }
            mm => Ok(mm),
        };
        let mm = section.required(reader, "position", "\"40 m\"", inside)?;
        Some(What::Cut(topology?.place(Point { segment, mm })))
    },
};

/// Not more cables are cut than the network can tell apart.
pub(in crate::study::scenario) fn few_cuts(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let all = facts.scenario.disturbances.iter().enumerate();
    let mut cuts = all.filter(|(_, disturbance)| matches!(disturbance.what, What::Cut(_)));
    if let Some((i, _)) = cuts.nth(Cuts::MAX) {
        let fault = Fault::new("too many cuts").rule(format!("at most {} places (Model)", Cuts::MAX));
        about(reader, &format!("disturbance.{}.position", i + 1), &[], fault);
    }
}

/// The repeater that is meant, by its index.
fn repeater(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<usize> {
    let names: Vec<_> = reader.around.topology.iter().flat_map(|topology| topology.repeaters()).collect();
    let names: Vec<_> = names.iter().map(|repeater| repeater.name.clone()).collect();
    section.required(reader, "repeater", "\"hall 1 - hall 2\"", |node| {
        let word = text(node)?;
        names.iter().position(|name| name == word).ok_or_else(|| {
            let fault = Fault::new(format!("there is no repeater \"{word}\""));
            if names.is_empty() {
                fault.help("this network has none: add [[segment]] and [[repeater]]")
            } else {
                fault.help(suggestion(word, names.iter().map(String::as_str)))
            }
        })
    })
}

/// Telegrams stay in order: what strays on a path is less than the pause between two of them.
pub(in crate::study::scenario) fn in_order(facts: &Facts<'_>, reader: &mut Reader<'_>) {
    let (topology, bus) = (&facts.scenario.topology, &facts.scenario.bus.params);
    let repeaters = topology.repeaters();
    let mut sum: Span = repeaters.iter().fold(Span::ZERO, |sum, repeater| sum + repeater.jitter);
    let idle = bus.span(bus.min_tsdr);
    for (i, disturbance) in facts.scenario.disturbances.iter().enumerate() {
        let half_width = match disturbance.what {
            What::Instant(_, InstantFault::Receiver { half_width }) => half_width,
            What::Repeater(index, half_width) => {
                let (own, delay) = (repeaters[index].jitter, repeaters[index].crossing());
                if own + half_width > delay {
                    let fault =
                        Fault::new(format!("a jitter of {} is more than the delay of {delay}", own + half_width))
                            .rule("nothing leaves a repeater before it has come");
                    about(reader, &format!("disturbance.{}.half_width", i + 1), &[], fault);
                }
                half_width
            }
            _ => continue,
        };
        // A stray to the one side follows a stray to the other.
        sum = sum + half_width.min(Span::from_s(1));
        if sum * 2 >= idle {
            let fault = Fault::new(format!("telegrams may move against each other by {}", sum * 2))
                .rule(format!(
                    "twice the jitter of repeaters and receivers is less than the shortest pause, min T_SDR = {idle} (Model)"
                ))
                .help("less jitter, or a longer min_tsdr");
            return about(reader, &format!("disturbance.{}.half_width", i + 1), &[], fault);
        }
    }
}
