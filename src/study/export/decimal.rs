//! Decimals: spans as numbers of a stated unit, exact to the picosecond.
//!
//! A tick is 1/12 ns, so its third decimal of a nanosecond is periodic. Spans are rounded once, by integers, to the
//! nearest picosecond, halves away from zero (a tick is 83⅓ ps, so a half cannot occur): at most a third of a
//! picosecond is lost, in every unit.

use core::fmt;

use serde::{Serialize, Serializer};

use crate::time::Span;

/// A span as a number of some unit, with all its decimals down to the picosecond.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Decimal {
    picoseconds: i128,
    /// Decimals that lead from the unit to the picosecond.
    digits: u32,
}

impl Decimal {
    /// In nanoseconds, three decimals.
    pub const fn ns(span: Span) -> Self {
        Self::new(span, 3)
    }
    /// In microseconds, six decimals.
    pub const fn us(span: Span) -> Self {
        Self::new(span, 6)
    }
    /// In milliseconds, nine decimals.
    pub const fn ms(span: Span) -> Self {
        Self::new(span, 9)
    }
    /// In seconds, twelve decimals.
    pub const fn s(span: Span) -> Self {
        Self::new(span, 12)
    }
    const fn new(span: Span, digits: u32) -> Self {
        let thirds = span.ticks() as i128 * 250;
        let half = if thirds < 0 { -1 } else { 1 };
        Self { picoseconds: (thirds + half) / 3, digits }
    }
    /// The nearest `f64`.
    pub fn value(self) -> f64 {
        // The power is exact: it has at most 40 bits.
        self.picoseconds as f64 / 10_u64.pow(self.digits) as f64
    }
}

/// All decimals, always: `-0.083`.
impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = 10_u128.pow(self.digits);
        let magnitude = self.picoseconds.unsigned_abs();
        // Both parts fit: the range of 24 years has less than 2^60 ns, and a second has 10^12 ps.
        let (whole, fraction) = ((magnitude / unit) as u64, (magnitude % unit) as u64);
        let sign = if self.picoseconds < 0 { "-" } else { "" };
        write!(f, "{sign}{whole}.{fraction:0width$}", width = self.digits as usize)
    }
}

/// A number without trailing zeros.
impl Serialize for Decimal {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(self.value())
    }
}

/// Functions that serialize spans as numbers of one unit, a missing one as null; by reference as serde asks for it.
macro_rules! units {
    ($($function:ident = $decimal:ident of $type:ty;)*) => {$(
        #[allow(clippy::trivially_copy_pass_by_ref)]
        pub(in crate::study) fn $function<S: Serializer>(span: &$type, serializer: S) -> Result<S::Ok, S::Error> {
            Option::<Span>::from(*span).map(Decimal::$decimal).serialize(serializer)
        }
    )*};
}
units! {
    s = s of Span;
    ms = ms of Span;
    us = us of Span;
    ns = ns of Span;
    us_or_null = us of Option<Span>;
    ns_or_null = ns of Option<Span>;
    ms_or_null = ms of Option<Span>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_printed_to_the_nearest_picosecond() {
        let text = [0, 1, -1, 2, -2, 3, 12, -12_000, 12_345].map(|n| Decimal::ns(Span::from_ticks(n)).to_string());
        assert_eq!(text, ["0.000", "0.083", "-0.083", "0.167", "-0.167", "0.250", "1.000", "-1000.000", "1028.750"]);
        assert_eq!(Decimal::us(Span::from_ticks(-1)).to_string(), "-0.000083");
        assert_eq!(Decimal::ms(Span::from_us(1_500)).to_string(), "1.500000000");
        assert_eq!(Decimal::s(Span::from_ms(10)).to_string(), "0.010000000000");
        assert_eq!(Decimal::ns(Span::MAX).to_string(), "768614336404564650.583");
    }

    #[test]
    fn numbers_have_no_noise_in_their_digits() {
        for (decimal, json) in [
            (Decimal::ns(Span::from_ticks(1)), "0.083"),
            (Decimal::ns(Span::from_ns(-62_500)), "-62500.0"),
            (Decimal::us(Span::from_ticks(12_345)), "1.02875"),
        ] {
            assert_eq!(serde_json::to_string(&decimal).unwrap(), json);
        }
    }
}
