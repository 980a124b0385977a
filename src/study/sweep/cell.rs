//! Cell: what stands in a table, and of what kind its column is.
//!
//! | kind | cells | in CSV | in Parquet |
//! |---|---|---|---|
//! | whole | counts, repetitions | `7` | INT64 |
//! | natural | seeds | `7` | INT64, unsigned |
//! | number | times, everything else with a unit, decimals | `0.250` | DOUBLE |
//! | truth | true or false | `true` | BOOLEAN |
//! | text | whatever is none of these | `3..10`, `1/4` | STRING |
//!
//! Nothing is an empty cell in CSV and a null in Parquet. The column of a parameter without a unit is of the narrowest kind
//! that all its values are of.

use core::fmt;

use crate::study::export::decimal::Decimal;
use crate::study::figure::{Unit, Value};

/// The name of a column and what its cells are.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Heading {
    /// Its name, with the unit if it has one: `latch_skew_p99_ns`.
    pub name: String,
    /// What stands below.
    pub kind: Kind,
}

/// What the cells of a column are.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// Whole numbers within an `i64`.
    Whole,
    /// Whole numbers within a `u64`.
    Natural,
    /// Numbers.
    Number,
    /// True or false.
    Truth,
    /// Texts.
    Text,
}

/// What stands in a cell. Printed, it is what CSV has.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Cell {
    /// There is no value.
    Nothing,
    /// A whole number.
    Whole(i128),
    /// A number as it is printed, with all its digits: an `f64` may have fewer.
    Number(String),
    /// True or false.
    Truth(bool),
    /// A text; an empty one is [`Cell::Nothing`].
    Text(String),
}

impl Kind {
    /// The kinds that texts are looked at for, the narrowest first.
    const READ: [Self; 3] = [Self::Whole, Self::Number, Self::Truth];

    /// The kind that all these texts are of.
    pub fn of<'a>(texts: &(impl Iterator<Item = &'a str> + Clone)) -> Self {
        let fits = |kind: &Self| texts.clone().all(|text| kind.read(text).is_some());
        Self::READ.into_iter().find(fits).unwrap_or(Self::Text)
    }
    /// `text` as a cell of this kind, printed as it is written; none if it is of another.
    pub fn read(self, text: &str) -> Option<Cell> {
        match self {
            Self::Whole => text.parse::<i64>().ok().map(|whole| Cell::Whole(whole.into())),
            Self::Natural => text.parse::<u64>().ok().map(|whole| Cell::Whole(whole.into())),
            Self::Number => is_number(text).then(|| Cell::Number(text.to_owned())),
            Self::Truth => text.parse().ok().map(Cell::Truth),
            Self::Text => Some(Cell::text(text)),
        }
        .filter(|cell| cell.to_string() == text)
    }
}
/// What a figure of this unit is.
impl From<Unit> for Kind {
    fn from(unit: Unit) -> Self {
        match unit {
            Unit::Count => Self::Whole,
            Unit::Truth => Self::Truth,
            Unit::Ns | Unit::Us | Unit::Ms | Unit::S | Unit::Steps | Unit::Share => Self::Number,
        }
    }
}

/// Whether it is a number that can be reckoned with, and no name such as `007`.
fn is_number(text: &str) -> bool {
    let digits = text.trim_start_matches(['+', '-']).as_bytes();
    let is_name = digits.starts_with(b"0") && digits.get(1).is_some_and(u8::is_ascii_digit);
    !is_name && text.parse::<f64>().is_ok_and(f64::is_finite)
}

impl Cell {
    /// A text, or nothing if it is empty.
    pub fn text(text: impl Into<String>) -> Self {
        let text = text.into();
        if text.is_empty() { Self::Nothing } else { Self::Text(text) }
    }
    /// What a figure of `unit` is: exact to the picosecond where it is a time.
    pub fn of(value: Value, unit: Unit) -> Self {
        match (value, unit) {
            (Value::Span(span), Unit::Us) => Self::Number(Decimal::us(span).to_string()),
            (Value::Span(span), Unit::Ms) => Self::Number(Decimal::ms(span).to_string()),
            (Value::Span(span), Unit::S) => Self::Number(Decimal::s(span).to_string()),
            (Value::Span(span), _) => Self::Number(Decimal::ns(span).to_string()),
            (Value::Count(count), _) => Self::Whole(count.into()),
            (Value::Truth(truth), _) => Self::Truth(truth),
            (Value::Steps(_) | Value::Share(_), _) => Self::Number(value.number(unit).to_string()),
        }
    }
}
impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nothing => Ok(()),
            Self::Whole(whole) => whole.fmt(f),
            Self::Number(text) | Self::Text(text) => f.write_str(text),
            Self::Truth(truth) => truth.fmt(f),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Span;

    #[test]
    fn a_column_is_what_all_its_texts_are() {
        let of = |texts: &[&str]| Kind::of(&texts.iter().copied());
        assert_eq!(of(&["1", "-20", "9223372036854775807"]), Kind::Whole);
        for numbers in [["1", "2.50"], ["1e-6", "-3"], ["0", "0.5"], ["9223372036854775808", "1"]] {
            assert_eq!(of(&numbers), Kind::Number, "{numbers:?}");
        }
        assert_eq!(of(&["true", "false"]), Kind::Truth);
        for texts in
            [["3", "3..4"], ["1/4", "1/8"], ["007", "008"], ["nan", "1"], ["inf", "1"], ["true", "1"], ["", "1"]]
        {
            assert_eq!(of(&texts), Kind::Text, "{texts:?}");
        }
    }

    #[test]
    fn cells_are_printed_as_they_were_written() {
        for (kind, text) in [
            (Kind::Whole, "-7"),
            (Kind::Natural, "18446744073709551615"),
            (Kind::Number, "0.250"),
            (Kind::Number, "1e-6"),
            (Kind::Truth, "true"),
            (Kind::Text, "3..4"),
            (Kind::Text, ""),
        ] {
            assert_eq!(kind.read(text).expect(text).to_string(), text);
        }
        for (kind, text) in [(Kind::Whole, "+7"), (Kind::Whole, "7.0"), (Kind::Natural, "-1"), (Kind::Truth, "1")] {
            assert_eq!(kind.read(text), None, "{text}");
        }
        assert_eq!(Kind::Text.read(""), Some(Cell::Nothing));
    }

    #[test]
    fn figures_are_cells_of_the_kind_of_their_unit() {
        let span = Value::Span(Span::from_us(1_500));
        for (value, unit, text) in [
            (span, Unit::Ns, "1500000.000"),
            (span, Unit::Us, "1500.000000"),
            (span, Unit::Ms, "1.500000000"),
            (span, Unit::S, "0.001500000000"),
            (Value::Count(3), Unit::Count, "3"),
            (Value::Steps(0.25), Unit::Steps, "0.25"),
            (Value::Share(0.9995), Unit::Share, "99.95"),
            (Value::Truth(true), Unit::Truth, "true"),
        ] {
            let cell = Cell::of(value, unit);
            assert_eq!(cell.to_string(), text);
            assert_eq!(Kind::from(unit).read(text), Some(cell), "{unit:?}");
        }
    }
}
