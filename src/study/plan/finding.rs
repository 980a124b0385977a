//! Findings: what a rule of the planner finds about one value, with the numbers on both sides.

use std::fmt;

use super::rules::{Rule, Weight};
use crate::study::scenario::Fault;
use crate::time::{BitRate, Span, Tbit};
use crate::wire::Address;

/// A value with its unit.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Amount {
    /// A time.
    Time(Span),
    /// A time in bits (t_bit).
    Bits(i64),
    /// A number without unit.
    Count(i64),
    /// A bit rate.
    Rate(BitRate),
}

impl Amount {
    /// The number alone: ticks, bits, the rate's place among all rates.
    pub const fn raw(self) -> i64 {
        match self {
            Self::Time(span) => span.ticks(),
            Self::Bits(number) | Self::Count(number) => number,
            Self::Rate(rate) => rate as i64,
        }
    }
    /// Another number with the same unit; a bit rate stays what it is.
    #[must_use]
    pub const fn of(self, raw: i64) -> Self {
        match self {
            Self::Time(_) => Self::Time(Span::from_ticks(raw)),
            Self::Bits(_) => Self::Bits(raw),
            Self::Count(_) => Self::Count(raw),
            Self::Rate(rate) => Self::Rate(rate),
        }
    }
    /// The number as JSON has it, with its unit.
    pub fn number(self) -> (f64, &'static str) {
        match self {
            Self::Time(span) => (span.as_us(), "us"),
            Self::Bits(number) => (number as f64, "tbit"),
            Self::Count(number) => (number as f64, ""),
            Self::Rate(rate) => (12e9 / rate.bit().ticks() as f64, "bit/s"),
        }
    }
}
impl From<Span> for Amount {
    fn from(span: Span) -> Self {
        Self::Time(span)
    }
}
impl From<Tbit> for Amount {
    fn from(bits: Tbit) -> Self {
        Self::Bits(bits.0.into())
    }
}
impl From<u32> for Amount {
    fn from(number: u32) -> Self {
        Self::Count(number.into())
    }
}
impl fmt::Display for Amount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Time(span) => span.fmt(f),
            Self::Bits(number) => write!(f, "{number} tbit"),
            Self::Count(number) => number.fmt(f),
            Self::Rate(rate) => rate.fmt(f),
        }
    }
}

/// How the two sides must compare.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Relation {
    /// Not less.
    AtLeast,
    /// More.
    MoreThan,
    /// Not more.
    AtMost,
    /// Less.
    LessThan,
    /// A whole multiple.
    MultipleOf,
}

impl Relation {
    /// The sign between the sides.
    pub const fn sign(self) -> &'static str {
        match self {
            Self::AtLeast => ">=",
            Self::MoreThan => ">",
            Self::AtMost => "<=",
            Self::LessThan => "<",
            Self::MultipleOf => "= n x",
        }
    }
    /// How far `value` is on the right side of `bound`; negative if it is on the wrong one. Off a grid, minus the way to
    /// the nearest point.
    fn margin(self, value: i64, bound: i64) -> i64 {
        match self {
            Self::AtLeast | Self::MoreThan => value - bound,
            Self::AtMost | Self::LessThan => bound - value,
            Self::MultipleOf => {
                let over = value.rem_euclid(bound.max(1));
                -over.min(bound.max(1) - over)
            }
        }
    }
}

/// Whose value.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Subject {
    /// `[bus]`.
    Bus,
    /// `[master]`.
    Master,
    /// The slave at this address.
    Slave(Address),
    /// The `[[class2]]` of this number, from 1, at this address.
    Class2(usize, Address),
}

/// A key of a scenario.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Key {
    /// In whose table.
    pub subject: Subject,
    /// The key, such as `t_o`.
    pub name: &'static str,
}

impl Key {
    /// A key of `[bus]`.
    pub const fn bus(name: &'static str) -> Self {
        Self { subject: Subject::Bus, name }
    }
    /// A key of `[master]`.
    pub const fn master(name: &'static str) -> Self {
        Self { subject: Subject::Master, name }
    }
    /// A key of a slave.
    pub const fn slave(address: Address, name: &'static str) -> Self {
        Self { subject: Subject::Slave(address), name }
    }
    /// A key of the `[[class2]]` of this number, from 1, at this address.
    pub const fn class2(number: usize, address: Address, name: &'static str) -> Self {
        Self { subject: Subject::Class2(number, address), name }
    }
}
impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.subject {
            Subject::Bus => write!(f, "bus.{}", self.name),
            Subject::Master => write!(f, "master.{}", self.name),
            Subject::Slave(address) => write!(f, "slave.{address}.{}", self.name),
            Subject::Class2(number, _) => write!(f, "class2.{number}.{}", self.name),
        }
    }
}

/// What a rule finds about one value.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The rule.
    pub rule: &'static Rule,
    /// The key that is to blame if it does not hold.
    pub key: Key,
    /// The left side in symbols, such as `T_O`.
    pub symbol: &'static str,
    /// The left side.
    pub value: Amount,
    /// How it must compare.
    pub relation: Relation,
    /// The right side in symbols; the number is [`Self::bound`].
    pub terms: String,
    /// The right side.
    pub bound: Amount,
    /// Whether the left side is not the key's value itself, but follows from it.
    pub follows: bool,
    /// What would do, where the rule knows it better than [`nearest`].
    pub advised: Option<Amount>,
    /// What reading a scenario says; none if it holds, or if another finding has said it.
    pub fault: Option<Fault>,
}

impl Finding {
    /// Whether the rule holds.
    pub fn holds(&self) -> bool {
        let margin = self.margin();
        match self.relation {
            Relation::MoreThan | Relation::LessThan => margin > 0,
            Relation::AtLeast | Relation::AtMost | Relation::MultipleOf => margin >= 0,
        }
    }
    fn margin(&self) -> i64 {
        self.relation.margin(self.value.raw(), self.bound.raw())
    }
    /// How far the value is on the right side, negative if it is on the wrong one; none for a grid that it lies on and for
    /// bit rates.
    pub fn margin_amount(&self) -> Option<Amount> {
        match (self.value, self.relation) {
            (Amount::Rate(_), _) => None,
            (_, Relation::MultipleOf) if self.holds() => None,
            _ => Some(self.value.of(self.margin())),
        }
    }
}

/// The value nearest to the one that `finding` blames with which every rule about its key holds, all other values as they
/// are; none if there is no such value.
pub fn nearest(finding: &Finding, all: &[Finding]) -> Option<Amount> {
    if finding.follows {
        return finding.advised;
    }
    let same = |other: &&Finding| other.key == finding.key && !other.follows;
    let must = |other: &&Finding| other.rule.weight == Weight::Must;
    // What should be kept is given up first.
    within(finding, all.iter().filter(same)).or_else(|| within(finding, all.iter().filter(same).filter(must)))
}

/// The value nearest to that of `finding` with which all of `others`, which are about the same value, hold.
fn within<'a>(finding: &Finding, others: impl Iterator<Item = &'a Finding>) -> Option<Amount> {
    let (mut low, mut high, mut grid) = (i64::MIN / 4, i64::MAX / 4, 1);
    for other in others {
        let bound = other.bound.raw();
        match other.relation {
            Relation::AtLeast => low = low.max(bound),
            Relation::MoreThan => low = low.max(bound.saturating_add(1)),
            Relation::AtMost => high = high.min(bound),
            Relation::LessThan => high = high.min(bound.saturating_sub(1)),
            Relation::MultipleOf => grid = common_multiple(grid, bound.max(1))?,
        }
    }
    let (low, high) = ((low + grid - 1).div_euclid(grid) * grid, high.div_euclid(grid) * grid);
    if low > high {
        return None;
    }
    let value = finding.value.raw();
    let below = value.div_euclid(grid) * grid;
    let near = if value - below <= below + grid - value { below } else { below + grid };
    Some(finding.value.of(near.clamp(low, high)))
}

/// The least common multiple, if it is one.
fn common_multiple(a: i64, b: i64) -> Option<i64> {
    let (mut x, mut y) = (a, b);
    while y != 0 {
        (x, y) = (y, x % y);
    }
    (a / x).checked_mul(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_margin_is_positive_on_the_right_side() {
        for (relation, value, bound, margin) in [
            (Relation::AtLeast, 7, 5, 2),
            (Relation::MoreThan, 5, 5, 0),
            (Relation::AtMost, 7, 5, -2),
            (Relation::LessThan, 3, 5, 2),
            (Relation::MultipleOf, 10, 5, 0),
            (Relation::MultipleOf, 11, 5, -1),
            (Relation::MultipleOf, 14, 5, -1),
            (Relation::MultipleOf, 3, 0, 0),
        ] {
            assert_eq!(relation.margin(value, bound), margin, "{value} {} {bound}", relation.sign());
        }
    }

    #[test]
    fn grids_meet_at_their_common_multiples() {
        assert_eq!(common_multiple(1, 7), Some(7));
        assert_eq!(common_multiple(4, 6), Some(12));
        assert_eq!(common_multiple(i64::MAX, i64::MAX - 1), None);
    }
}
