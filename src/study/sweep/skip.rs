//! Skip: combinations that are left out.
//!
//! Each `[[skip]]` names axes and what their values must be for a combination to be left out: all of its lines must
//! hold. Several tables leave out what any of them does. A comparison is with a value or with another axis.

use std::cmp::Ordering;

use super::axis::Axis;
use crate::study::quantity::Measure;
use crate::study::scenario::error::Fault;
use crate::study::scenario::section::{Reader, Section, suggestion};
use crate::study::scenario::tree::{Node, Place, Table, Value};

/// One `[[skip]]`.
#[derive(Clone, PartialEq, Debug)]
pub struct Skip {
    /// All of them must hold.
    comparisons: Vec<Comparison>,
}

/// `axis <= value`.
#[derive(Clone, PartialEq, Debug)]
struct Comparison {
    axis: usize,
    relation: Relation,
    with: With,
}

/// What an axis is compared with.
#[derive(Clone, PartialEq, Debug)]
enum With {
    Value(String),
    Axis(usize),
}

/// How two values are compared.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Relation {
    Less,
    AtMost,
    More,
    AtLeast,
    Is,
    IsNot,
}

impl Relation {
    /// Longer signs first.
    const SIGNS: [(&'static str, Self); 6] = [
        ("<=", Self::AtMost),
        (">=", Self::AtLeast),
        ("==", Self::Is),
        ("!=", Self::IsNot),
        ("<", Self::Less),
        (">", Self::More),
    ];
    const fn is_of_order(self) -> bool {
        !matches!(self, Self::Is | Self::IsNot)
    }
    /// Whether it holds between two values; those that are no numbers of one kind are the same or not.
    fn holds(self, one: &str, other: &str) -> bool {
        let order = Measure::read(one).zip(Measure::read(other)).and_then(|(one, other)| one.compare(other));
        match (self, order) {
            (Self::Is, None) => one == other,
            (Self::IsNot, None) => one != other,
            (_, None) => false,
            (Self::Less, Some(order)) => order == Ordering::Less,
            (Self::AtMost, Some(order)) => order != Ordering::Greater,
            (Self::More, Some(order)) => order == Ordering::Greater,
            (Self::AtLeast, Some(order)) => order != Ordering::Less,
            (Self::Is, Some(order)) => order == Ordering::Equal,
            (Self::IsNot, Some(order)) => order != Ordering::Equal,
        }
    }
}

impl Skip {
    /// Whether the combination with these numbers of values is left out.
    pub fn leaves_out(&self, axes: &[Axis], values: &[usize]) -> bool {
        let of = |axis: usize| axes[axis].label(values[axis]);
        self.comparisons.iter().all(|comparison| {
            let with = match &comparison.with {
                With::Value(value) => value,
                &With::Axis(other) => of(other),
            };
            comparison.relation.holds(of(comparison.axis), with)
        })
    }
    /// Reads one `[[skip]]`.
    pub(super) fn read(section: &Section<'_>, reader: &mut Reader<'_>, axes: &[Axis]) -> Option<Self> {
        let mut lines = Vec::new();
        if let Some(table) = section.all() {
            flatten(table, "", &mut lines);
        }
        if lines.is_empty() {
            let fault = Fault::new("this names no axis").help("for example: \"master.t_dp\" = \"< 1 ms\"");
            section.complain(reader, fault);
        }
        let mut comparisons = Vec::new();
        for (name, place, node) in lines {
            match read_line(&name, node, axes) {
                Ok(line) => comparisons.extend(line),
                Err((blame, fault)) => {
                    reader.complain(if blame { place } else { node.place }, &section.path_of(&name), fault);
                }
            }
        }
        (!comparisons.is_empty()).then_some(Self { comparisons })
    }
}

/// Names with dots and their values: a table without dots in its name is a part of a name.
fn flatten<'t>(table: &'t Table, before: &str, lines: &mut Vec<(String, Place, &'t Node)>) {
    for (key, (place, node)) in &table.0 {
        let name = if before.is_empty() { key.clone() } else { format!("{before}.{key}") };
        match &node.value {
            Value::Table(inner) => flatten(inner, &name, lines),
            _ => lines.push((name, *place, node)),
        }
    }
}

/// The comparisons of one line; an error tells whether its name is to blame.
fn read_line(name: &str, node: &Node, axes: &[Axis]) -> Result<Vec<Comparison>, (bool, Fault)> {
    let named = |name: &str| axes.iter().position(|axis| axis.name == name);
    let number = named(name).ok_or_else(|| {
        let known = axes.iter().map(|axis| axis.name.as_str());
        (true, Fault::new(format!("there is no axis \"{name}\"")).help(suggestion(name, known)))
    })?;
    let items = match &node.value {
        Value::List(items) => &items[..],
        _ => std::slice::from_ref(node),
    };
    let comparison = |item: &Node| {
        let written = match &item.value {
            Value::Text(text) => text.trim().to_owned(),
            other => other.literal(),
        };
        let sign = Relation::SIGNS.into_iter().find(|(sign, _)| written.starts_with(sign));
        let (sign, relation) = sign.unwrap_or(("", Relation::Is));
        let operand = written[sign.len()..].trim();
        let with = named(operand).map_or_else(|| With::Value(operand.to_owned()), With::Axis);
        let comparison = Comparison { axis: number, relation, with };
        sense(&comparison, axes).map(|()| comparison).map_err(|fault| (false, fault))
    };
    items.iter().map(comparison).collect()
}

/// Refuses to order what has no order.
fn sense(comparison: &Comparison, axes: &[Axis]) -> Result<(), Fault> {
    if !comparison.relation.is_of_order() {
        return Ok(());
    }
    let labels = |axis: usize| (0..axes[axis].len()).map(move |number| axes[axis].label(number));
    let first = labels(comparison.axis).next().and_then(Measure::read);
    let has_order = |value: &str| Measure::read(value).zip(first).is_some_and(|(value, first)| value.is_like(first));
    let strange = match &comparison.with {
        With::Value(value) => labels(comparison.axis).chain([value.as_str()]).find(|value| !has_order(value)),
        &With::Axis(other) => labels(comparison.axis).chain(labels(other)).find(|value| !has_order(value)),
    };
    match strange {
        None => Ok(()),
        Some(strange) => Err(Fault::new(format!("\"{strange}\" is neither more nor less than the others"))
            .rule("<, <=, > and >= compare numbers with units of one kind")
            .help("== and != compare anything")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_compared_by_what_they_say_and_texts_by_their_letters() {
        use Relation::{AtLeast, AtMost, Is, IsNot, Less, More};
        for (relation, one, other, holds) in [
            (Less, "999 us", "1 ms", true),
            (Less, "1 ms", "1000 us", false),
            (AtMost, "1 ms", "1000 us", true),
            (More, "10", "9", true),
            (AtLeast, "0.25 ns", "3 tick", true),
            (Is, "1 ms", "1000 us", true),
            (IsNot, "1 ms", "1 us", true),
            (Is, "3..10", "3..10", true),
            (IsNot, "3..10", "3..11", true),
            (Less, "3..10", "3..11", false),
        ] {
            assert_eq!(relation.holds(one, other), holds, "{one} {relation:?} {other}");
        }
    }
}
