//! Which of the telegrams that it is about a disturbance gets hold of: the keys `rate`, `telegrams` and `pattern`.

use super::Key;
use crate::sim::fault::manner::{Manner, Pattern};
use crate::study::quantity::share;
use crate::study::scenario::error::Fault;
use crate::study::scenario::section::{Reader, Section, number, quantity, text};
use crate::study::scenario::tree::Node;

pub(super) const RATE: Key =
    Key { name: "rate", unit: "share", default: "all", what: "each of these telegrams with this probability" };
pub(super) const TELEGRAMS: Key =
    Key { name: "telegrams", unit: "number", default: "all", what: "only the first so many, each time it begins" };
pub(super) const PATTERN: Key = Key {
    name: "pattern",
    unit: "x and .",
    default: "all",
    what: "one after the other, x is meant and . is not, each time from the beginning",
};

/// Reads how many of its telegrams a disturbance gets hold of.
pub(super) fn read(section: &mut Section<'_>, reader: &mut Reader<'_>) -> Option<Manner> {
    let rate = section.optional(reader, "rate", quantity("1 %", share)).map(Manner::Share);
    let telegrams = section.optional(reader, "telegrams", number(0..=i64::MAX as u64)).map(Manner::First);
    let pattern = section.optional(reader, "pattern", pattern).map(Manner::Pattern);
    let given = ["rate", "telegrams", "pattern"].iter().filter(|key| section.has(key)).count();
    if given > 1 {
        let fault = Fault::new("rate, telegrams and pattern exclude each other").help("leave one of them");
        section.complain(reader, fault);
        return None;
    }
    let manner = rate.or(telegrams).or(pattern);
    if given == 0 { Some(Manner::All) } else { manner }
}

fn pattern(node: &Node) -> Result<Pattern, Fault> {
    Pattern::parse(text(node)?).ok_or_else(|| {
        Fault::new("this is no pattern of telegrams").help(format!(
            "1 to {} characters, x for a telegram that is meant and . for one that is not",
            Pattern::LONGEST
        ))
    })
}
