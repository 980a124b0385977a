//! Time: ticks of 1/12 ns, two clocks kept apart by type, bit rates and bit times.
//!
//! The tick is chosen so that everything the protocol counts is a whole number of ticks: one IsoM unit
//! (1/12 µs) is 1 000, one bit at 12 Mbit/s is 1 000, at 9.6 kbit/s 1 250 000. An `i64` of ticks covers 24 years.

use core::fmt;
use core::marker::PhantomData;
use core::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// A signed duration [ticks of 1/12 ns].
///
/// A span that a station measures is counted in ticks of this station's own crystal.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Span(i64);

impl Span {
    /// No time at all.
    pub const ZERO: Self = Self(0);
    /// The longest span, longer than any run.
    pub const MAX: Self = Self(i64::MAX);
    /// Ticks in one nanosecond.
    pub const TICKS_PER_NS: i64 = 12;
    /// Ticks in one IsoM unit of 1/12 µs (manual 3.3).
    pub const TICKS_PER_ISO_UNIT: i64 = 1_000;

    /// A span of `ticks` [1/12 ns].
    pub const fn from_ticks(ticks: i64) -> Self {
        Self(ticks)
    }
    /// A span of `units` [1/12 µs], the unit of every IsoM field (manual 3.3).
    pub const fn from_iso_units(units: u32) -> Self {
        Self(units as i64 * Self::TICKS_PER_ISO_UNIT)
    }
    /// A span of whole nanoseconds.
    pub const fn from_ns(ns: i64) -> Self {
        Self(ns * Self::TICKS_PER_NS)
    }
    /// A span of whole microseconds.
    pub const fn from_us(us: i64) -> Self {
        Self::from_ns(us * 1_000)
    }
    /// A span of whole milliseconds.
    pub const fn from_ms(ms: i64) -> Self {
        Self::from_us(ms * 1_000)
    }
    /// A span of whole seconds.
    pub const fn from_s(s: i64) -> Self {
        Self::from_ms(s * 1_000)
    }
    /// Length [ticks of 1/12 ns].
    pub const fn ticks(self) -> i64 {
        self.0
    }
    /// Length (ns), for display and statistics.
    pub fn as_ns(self) -> f64 {
        self.0 as f64 / Self::TICKS_PER_NS as f64
    }
    /// Length (µs), for display and statistics.
    pub fn as_us(self) -> f64 {
        self.as_ns() / 1e3
    }
    /// Length (ms), for display and statistics.
    pub fn as_ms(self) -> f64 {
        self.as_ns() / 1e6
    }
    /// Length (s), for display and statistics.
    pub fn as_s(self) -> f64 {
        self.as_ns() / 1e9
    }
    /// Magnitude. Only for comparing with a half width; a signed quantity is recorded with its sign.
    #[must_use]
    pub const fn abs(self) -> Self {
        Self(self.0.abs())
    }
    /// Whole multiples of `step` in this span, rounded down.
    pub const fn div_floor(self, step: Self) -> i64 {
        self.0.div_euclid(step.0)
    }
    /// The next multiple of `step` not below this span.
    #[must_use]
    pub const fn ceil_to(self, step: Self) -> Self {
        Self((self.0 + step.0 - 1).div_euclid(step.0) * step.0)
    }
    /// Whether this span lies on the grid of `step`.
    pub const fn is_multiple_of(self, step: Self) -> bool {
        self.0.rem_euclid(step.0) == 0
    }
    /// Product that says `None` beyond the range of 24 years.
    pub const fn checked_mul(self, factor: i64) -> Option<Self> {
        match self.0.checked_mul(factor) {
            Some(ticks) => Some(Self(ticks)),
            None => None,
        }
    }
}

impl Add for Span {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}
impl AddAssign for Span {
    fn add_assign(&mut self, other: Self) {
        self.0 += other.0;
    }
}
impl Sub for Span {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}
impl SubAssign for Span {
    fn sub_assign(&mut self, other: Self) {
        self.0 -= other.0;
    }
}
impl Neg for Span {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}
impl Mul<i64> for Span {
    type Output = Self;
    fn mul(self, factor: i64) -> Self {
        Self(self.0 * factor)
    }
}
impl core::iter::Sum for Span {
    fn sum<I: Iterator<Item = Self>>(spans: I) -> Self {
        spans.fold(Self::ZERO, Add::add)
    }
}

/// Text with the largest unit in which the span is at least one, at most three decimals: `2 ms`, `62.5 us`, `-0.333 ns`.
impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const UNITS: [(i64, &str); 4] = [(12_000_000_000, "s"), (12_000_000, "ms"), (12_000, "us"), (12, "ns")];
        let ticks = i128::from(self.0.unsigned_abs());
        let (per_unit, unit) = UNITS.into_iter().find(|&(t, _)| ticks >= i128::from(t)).unwrap_or(UNITS[3]);
        let per_unit = i128::from(per_unit);
        let thousandths = (ticks * 1_000 + per_unit / 2) / per_unit;
        let (whole, fraction) = (thousandths / 1_000, thousandths % 1_000);
        let sign = if self.0 < 0 { "-" } else { "" };
        match fraction {
            0 => write!(f, "{sign}{whole} {unit}"),
            _ if fraction % 100 == 0 => write!(f, "{sign}{whole}.{} {unit}", fraction / 100),
            _ if fraction % 10 == 0 => write!(f, "{sign}{whole}.{:02} {unit}", fraction / 10),
            _ => write!(f, "{sign}{whole}.{fraction:03} {unit}"),
        }
    }
}
impl fmt::Debug for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Marks the one true time of the simulated world. Only `sim` and above use it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum World {}
/// Marks the reading of one station's own crystal.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Station {}

/// A point on the clock `C` [ticks of 1/12 ns since this clock's zero].
#[derive(PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Instant<C> {
    ticks: i64,
    clock: PhantomData<C>,
}

/// True time. No machine ever sees one: only `sim` and above may name this type.
pub type Time = Instant<World>;
/// What a station's own crystal shows.
pub type Local = Instant<Station>;

impl<C> Instant<C> {
    /// The clock's zero.
    pub const ZERO: Self = Self::from_ticks(0);
    /// The end of the range, later than any run.
    pub const MAX: Self = Self::from_ticks(i64::MAX);

    /// The instant `ticks` [1/12 ns] after the clock's zero.
    pub const fn from_ticks(ticks: i64) -> Self {
        Self { ticks, clock: PhantomData }
    }
    /// Ticks [1/12 ns] since the clock's zero.
    pub const fn ticks(self) -> i64 {
        self.ticks
    }
    /// Span since the clock's zero.
    pub const fn since_zero(self) -> Span {
        Span(self.ticks)
    }
}
impl<C> Clone for Instant<C> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<C> Copy for Instant<C> {}
impl<C> Default for Instant<C> {
    fn default() -> Self {
        Self::ZERO
    }
}
impl<C> Add<Span> for Instant<C> {
    type Output = Self;
    fn add(self, span: Span) -> Self {
        Self::from_ticks(self.ticks + span.0)
    }
}
impl<C> AddAssign<Span> for Instant<C> {
    fn add_assign(&mut self, span: Span) {
        self.ticks += span.0;
    }
}
impl<C> Sub<Span> for Instant<C> {
    type Output = Self;
    fn sub(self, span: Span) -> Self {
        Self::from_ticks(self.ticks - span.0)
    }
}
impl<C> Sub for Instant<C> {
    type Output = Span;
    fn sub(self, other: Self) -> Span {
        Span(self.ticks - other.ticks)
    }
}
impl<C> fmt::Debug for Instant<C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "@{}", self.since_zero())
    }
}

/// A duration counted in bits (t_bit). It becomes a [`Span`] only together with a [`BitRate`].
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Debug)]
pub struct Tbit(pub u32);

impl Tbit {
    /// Bits of one character on the line: start, eight data bits, even parity, stop.
    pub const PER_OCTET: u32 = 11;

    /// Bit times that `octets` characters occupy on the line.
    pub const fn of_octets(octets: usize) -> Self {
        Self(octets as u32 * Self::PER_OCTET)
    }
}
impl Add for Tbit {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}
impl fmt::Display for Tbit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} tbit", self.0)
    }
}

macro_rules! bit_rates {
    ($($(#[$doc:meta])* $name:ident = $ticks:literal, $text:literal;)*) => {
        /// Bit rates of the DP profile.
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
        pub enum BitRate { $($(#[$doc])* $name,)* }

        impl BitRate {
            /// Every rate, slowest first.
            pub const ALL: &'static [Self] = &[$(Self::$name,)*];

            /// Duration of one bit, exact.
            pub const fn bit(self) -> Span {
                Span(match self { $(Self::$name => $ticks,)* })
            }
            /// The rate as people write it, for example `1.5 Mbit/s`.
            pub const fn text(self) -> &'static str {
                match self { $(Self::$name => $text,)* }
            }
        }
    };
}
bit_rates! {
    /// 9.6 kbit/s.
    K9_6 = 1_250_000, "9.6 kbit/s";
    /// 19.2 kbit/s.
    K19_2 = 625_000, "19.2 kbit/s";
    /// 31.25 kbit/s.
    K31_25 = 384_000, "31.25 kbit/s";
    /// 45.45 kbit/s, exactly 500/11 kbit/s: the only reading with a whole number of ticks per bit.
    K45_45 = 264_000, "45.45 kbit/s";
    /// 93.75 kbit/s.
    K93_75 = 128_000, "93.75 kbit/s";
    /// 187.5 kbit/s.
    K187_5 = 64_000, "187.5 kbit/s";
    /// 500 kbit/s.
    K500 = 24_000, "500 kbit/s";
    /// 1.5 Mbit/s, the slowest rate at which isochronous mode is offered.
    M1_5 = 8_000, "1.5 Mbit/s";
    /// 3 Mbit/s.
    M3 = 4_000, "3 Mbit/s";
    /// 6 Mbit/s.
    M6 = 2_000, "6 Mbit/s";
    /// 12 Mbit/s.
    M12 = 1_000, "12 Mbit/s";
}

impl BitRate {
    /// Duration of `bits` at this rate, exact.
    pub const fn span(self, bits: Tbit) -> Span {
        Span(self.bit().0 * bits.0 as i64)
    }
    /// Time that `octets` characters occupy on the line.
    pub const fn octets(self, octets: usize) -> Span {
        self.span(Tbit::of_octets(octets))
    }
}
impl fmt::Display for BitRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    #[test]
    fn every_bit_is_a_whole_number_of_ticks() {
        // bit/s of wire.md 2.1 as fractions over 11, so that 500/11 kbit/s is whole.
        let times_11 = [
            105_600,
            211_200,
            343_750,
            500_000,
            1_031_250,
            2_062_500,
            5_500_000,
            16_500_000,
            33_000_000,
            66_000_000,
            132_000_000i64,
        ];
        for (rate, bps_11) in BitRate::ALL.iter().zip(times_11) {
            assert_eq!(rate.bit().ticks() * bps_11, 12_000_000_000 * 11, "{rate}");
        }
    }

    #[test]
    fn spans_read_as_people_write_them() {
        for (span, text) in [
            (Span::from_us(125), "125 us"),
            (Span::from_ms(2), "2 ms"),
            (Span::from_ticks(6), "0.5 ns"),
            (Span::from_ns(-62_500), "-62.5 us"),
            (Span::from_ns(1_234), "1.234 us"),
            (Span::from_s(10), "10 s"),
            (Span::ZERO, "0 ns"),
        ] {
            assert_eq!(span.to_string(), text);
        }
    }

    #[test]
    fn grid_arithmetic_rounds_towards_the_later_point() {
        let base = Span::from_us(125);
        assert_eq!(Span::from_us(574).ceil_to(base), Span::from_us(625));
        assert_eq!(Span::from_us(625).ceil_to(base), Span::from_us(625));
        assert!(!Span::from_us(574).is_multiple_of(base));
        assert_eq!(Span::from_ns(-1).div_floor(Span::from_ns(2)), -1);
    }
}
