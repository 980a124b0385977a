//! Quantities: numbers with units at the text border, read into exact integers.
//!
//! A text such as `125 us` is a decimal number and a unit. It is multiplied out in integers, never in floating point,
//! so what a scenario says is what the run has. A quantity that is not a whole number of its smallest step is refused
//! with its two neighbours; only angles, of which most have no exact value, are rounded, once.

use std::cmp::Ordering;
use std::fmt;

use crate::sim::motion::Angle;
use crate::sim::share::Share;
use crate::time::{BitRate, Span, Tbit};

/// A unit: one of it is `ratio.0 / ratio.1` of the kind's smallest step.
type Unit = (&'static str, (i128, i128));

/// What a text can be read as.
struct Kind {
    /// With its article, for messages.
    noun: &'static str,
    /// A good text.
    example: &'static str,
    /// The smallest step in words.
    step: &'static str,
    /// The unit in which `n` steps can always be written.
    unit_of_step: &'static str,
    /// Accepted units; the first of several spellings is the one that messages show.
    units: &'static [Unit],
}

/// Units of time without bit times, in ticks.
const TIME_UNITS: &[Unit] = &[
    ("ns", (12, 1)),
    ("us", (12_000, 1)),
    ("ms", (12_000_000, 1)),
    ("s", (12_000_000_000, 1)),
    ("min", (720_000_000_000, 1)),
    ("h", (43_200_000_000_000, 1)),
    ("tick", (1, 1)),
];
/// Other spellings of units: micro sign, Greek mu, plural.
const SPELLINGS: &[(&str, &str)] = &[("\u{b5}s", "us"), ("\u{3bc}s", "us"), ("ticks", "tick")];

const TIME: Kind =
    Kind { noun: "a time", example: "125 us", step: "ticks of 1/12 ns", unit_of_step: "tick", units: TIME_UNITS };
const BITS: Kind = Kind {
    noun: "a number of bit times",
    example: "300 tbit",
    step: "bits",
    unit_of_step: "tbit",
    units: &[("tbit", (1, 1))],
};
const LENGTH: Kind = Kind {
    noun: "a length",
    example: "100 m",
    step: "millimetres",
    unit_of_step: "mm",
    units: &[("mm", (1, 1)), ("cm", (10, 1)), ("m", (1_000, 1)), ("km", (1_000_000, 1))],
};
const DEVIATION: Kind = Kind {
    noun: "a deviation of a frequency",
    example: "50 ppm",
    step: "ppb",
    unit_of_step: "ppb",
    units: &[("ppm", (1_000, 1)), ("ppb", (1, 1))],
};
const SPEED: Kind = Kind {
    noun: "a speed",
    example: "1500 rpm",
    step: "millionths of an rpm",
    unit_of_step: "urpm",
    units: &[("rpm", (1_000_000, 1)), ("rev/s", (60_000_000, 1)), ("deg/s", (1_000_000, 6)), ("urpm", (1, 1))],
};
const ANGLE: Kind = Kind {
    noun: "an angle",
    example: "0.25 rev",
    step: "2^-32 revolutions",
    unit_of_step: "",
    units: &[("rev", (Angle::UNITS_PER_REV as i128, 1)), ("deg", (Angle::UNITS_PER_REV as i128, 360))],
};
const GAIN: Kind = Kind { noun: "a gain", example: "1/4", step: "1/65536", unit_of_step: "", units: &[] };
const SHARE: Kind = Kind {
    noun: "a share",
    example: "1 %",
    step: "parts in 10^15",
    unit_of_step: "of 10^15",
    units: &[("%", (10i128.pow(13), 1)), ("ppm", (10i128.pow(9), 1)), ("ppb", (10i128.pow(6), 1))],
};
const RATE: Kind = Kind {
    noun: "a bit rate",
    example: "12 Mbit/s",
    step: "hundredths of a bit/s",
    unit_of_step: "",
    units: &[("bit/s", (100, 1)), ("kbit/s", (100_000, 1)), ("Mbit/s", (100_000_000, 1))],
};

/// Why a text is not the quantity that it should be. Reads as a sentence.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum QuantityError {
    /// There is no number in front.
    #[error("\"{text}\" is not {noun}: write a number and a unit, such as \"{example}\"")]
    NoNumber {
        /// What was written.
        text: String,
        /// What it should be.
        noun: &'static str,
        /// A good text.
        example: &'static str,
    },
    /// The unit is missing or not one of this quantity.
    #[error("\"{text}\" has {found}; {noun} has one of the units {units}")]
    Unit {
        /// What was written.
        text: String,
        /// What stands where the unit should.
        found: String,
        /// What it should be.
        noun: &'static str,
        /// All units that fit.
        units: String,
    },
    /// The quantity lies between two steps.
    #[error("\"{text}\" is not a whole number of {step}; its neighbours are \"{below}\" and \"{above}\"")]
    NotWhole {
        /// What was written.
        text: String,
        /// The step.
        step: &'static str,
        /// The next smaller quantity that can be.
        below: String,
        /// The next larger one.
        above: String,
    },
    /// The quantity does not fit.
    #[error("\"{text}\" is beyond the range of {noun}, {min} to {max}")]
    Range {
        /// What was written.
        text: String,
        /// What it should be.
        noun: &'static str,
        /// The smallest.
        min: String,
        /// The largest.
        max: String,
    },
    /// The bit rate is not one of the DP profile.
    #[error("\"{text}\" is not a bit rate of PROFIBUS DP; the nearest is \"{nearest}\"")]
    NoSuchRate {
        /// What was written.
        text: String,
        /// The nearest one that exists.
        nearest: BitRate,
    },
}

/// Reads a time, `"125 us"`; with a bit rate also bit times, `"37 tbit"`.
///
/// # Errors
/// No time, an unknown unit, no whole number of ticks, or more than 24 years.
pub fn span(text: &str, rate: Option<BitRate>) -> Result<Span, QuantityError> {
    let (number, unit) = Decimal::split(text, &TIME)?;
    let ticks = match rate {
        Some(rate) if unit == "tbit" => number.times((i128::from(rate.bit().ticks()), 1)),
        Some(_) => number.times(ratio(text, unit, &TIME, &["tbit"])?),
        None => number.times(ratio(text, unit, &TIME, &[])?),
    };
    let ticks = whole(text, &TIME, ticks)?;
    i64::try_from(ticks).map(Span::from_ticks).map_err(|_| range(text, &TIME, "-24 years", "24 years"))
}

/// Reads bit times, `"300 tbit"`.
///
/// # Errors
/// No number of bit times, a fraction of a bit, or a number that is negative or beyond 2^32 - 1.
pub fn tbit(text: &str) -> Result<Tbit, QuantityError> {
    u32::try_from(read(text, &BITS)?).map(Tbit).map_err(|_| range(text, &BITS, "0 tbit", "4294967295 tbit"))
}

/// Reads a length (mm), `"0.1 km"`.
///
/// # Errors
/// No length, a fraction of a millimetre, or a length that is negative or beyond 1000 km.
pub fn millimetres(text: &str) -> Result<u64, QuantityError> {
    /// 1000 km.
    const MAX: i128 = 1_000_000_000;
    match read(text, &LENGTH)? {
        mm @ 0..=MAX => Ok(mm as u64),
        _ => Err(range(text, &LENGTH, "0 m", "1000 km")),
    }
}

/// Reads a deviation of a frequency (10^-9), `"50 ppm"`.
///
/// # Errors
/// No deviation, a fraction of a ppb, or more than ±1000 ppm.
pub fn ppb(text: &str) -> Result<i64, QuantityError> {
    /// 1000 ppm.
    const MAX: u128 = 1_000_000;
    match read(text, &DEVIATION)? {
        ppb if ppb.unsigned_abs() <= MAX => Ok(ppb as i64),
        _ => Err(range(text, &DEVIATION, "-1000 ppm", "1000 ppm")),
    }
}

/// Reads a speed (10^-6 rpm), `"1500 rpm"`.
///
/// # Errors
/// No speed, a fraction of 10^-6 rpm, or more than an `i64` holds.
pub fn micro_rpm(text: &str) -> Result<i64, QuantityError> {
    i64::try_from(read(text, &SPEED)?).map_err(|_| range(text, &SPEED, "-9e12 rpm", "9e12 rpm"))
}

/// Reads an angle, `"0.25 rev"` or `"90 deg"`, rounded to the nearest 2^-32 revolution, halves up.
///
/// # Errors
/// No angle, or 2^31 revolutions and more.
pub fn angle(text: &str) -> Result<Angle, QuantityError> {
    let (number, unit) = Decimal::split(text, &ANGLE)?;
    let rounded = number.times(ratio(text, unit, &ANGLE, &[])?).map(|(above, below)| {
        // Both are far below 2^126: twice the numerator does not overflow.
        (2 * above + below).div_euclid(2 * below)
    });
    rounded
        .and_then(|units| i64::try_from(units).ok())
        .map(Angle::from_units)
        .ok_or_else(|| range(text, &ANGLE, "-2147483648 rev", "2147483647 rev"))
}

/// Reads a gain (1/65536), `"1/4"`, `"0.25"` or `"25e-2"`, rounded to the nearest step, halves up.
///
/// # Errors
/// No gain, or one that is negative or above 1.
pub fn gain(text: &str) -> Result<u32, QuantityError> {
    /// A gain of one.
    const ONE: i128 = 1 << 16;
    let (above, below) = text.split_once('/').unwrap_or((text, "1"));
    let none = || QuantityError::NoNumber { text: text.into(), noun: GAIN.noun, example: GAIN.example };
    let above = Decimal::plain(above).ok_or_else(none)?;
    let below = Decimal::plain(below).filter(|below| below.digits > 0).ok_or_else(none)?;
    let rounded = above.times((ONE, below.digits)).and_then(|(above, denominator)| {
        let numerator = above.checked_mul(10i128.pow(below.places))?.checked_mul(2)?;
        Some(numerator.checked_add(denominator)?.div_euclid(denominator.checked_mul(2)?))
    });
    match rounded {
        Some(gain @ 0..=ONE) => Ok(gain as u32),
        _ => Err(range(text, &GAIN, "0", "1")),
    }
}

/// Reads a bit rate, `"12 Mbit/s"`.
///
/// # Errors
/// No bit rate, or none of the DP profile.
pub fn bit_rate(text: &str) -> Result<BitRate, QuantityError> {
    let centi_bps = read(text, &RATE)?;
    let of = |rate: BitRate| read(rate.text(), &RATE).unwrap_or_default();
    let nearest = BitRate::ALL.iter().copied().min_by_key(|&rate| of(rate).abs_diff(centi_bps));
    match nearest {
        Some(rate) if of(rate) == centi_bps => Ok(rate),
        _ => Err(QuantityError::NoSuchRate { text: text.into(), nearest: nearest.unwrap_or(BitRate::M12) }),
    }
}

/// Reads a share of a whole, `"1 %"`, `"5 ppm"`, or as a plain number `"0.001"` and `"1e-6"`.
///
/// # Errors
/// No share, one that is finer than 10^-15, or one that is not between 0 and 1.
pub fn share(text: &str) -> Result<Share, QuantityError> {
    let parts = if let Some(number) = Decimal::plain(text) {
        number.times((Share::WHOLE.into(), 1))
    } else {
        let (number, unit) = Decimal::split(text, &SHARE)?;
        number.times(ratio(text, unit, &SHARE, &[])?)
    };
    let parts = whole(text, &SHARE, parts)?;
    u64::try_from(parts).ok().and_then(Share::new).ok_or_else(|| range(text, &SHARE, "0", "1"))
}

/// A decimal number as it was written: `digits` / 10^`places`.
#[derive(Clone, Copy)]
struct Decimal {
    digits: i128,
    places: u32,
}

impl Decimal {
    /// Most digits of a number; more than any quantity needs, and few enough that no product overflows unseen.
    const MAX_DIGITS: usize = 24;

    /// Splits `text` into its number and its unit.
    fn split<'a>(text: &'a str, kind: &Kind) -> Result<(Self, &'a str), QuantityError> {
        let trimmed = text.trim();
        let is_number = |c: char| c.is_ascii_digit() || matches!(c, '.' | '_' | '+' | '-');
        let end = trimmed.find(|c| !is_number(c)).unwrap_or(trimmed.len());
        let (number, unit) = trimmed.split_at(end);
        let none = || QuantityError::NoNumber { text: text.into(), noun: kind.noun, example: kind.example };
        Ok((Self::parse(number).ok_or_else(none)?, unit.trim()))
    }
    /// Reads a number without a unit, with or without an exponent.
    fn plain(text: &str) -> Option<Self> {
        let (number, rest) = Self::split(text, &GAIN).ok()?;
        if rest.is_empty() { Some(number) } else { number.shifted(rest.strip_prefix(['e', 'E'])?.parse().ok()?) }
    }
    /// The product with 10^`exponent`; none far beyond what any quantity has.
    fn shifted(self, exponent: i32) -> Option<Self> {
        /// Most places that leave room for the unit.
        const MAX_PLACES: u32 = 36;
        match exponent {
            0..=15 => Some(Self { digits: self.digits.checked_mul(10i128.pow(exponent as u32))?, ..self }),
            -30..0 => Some(Self { places: self.places + exponent.unsigned_abs(), ..self })
                .filter(|number| number.places <= MAX_PLACES),
            _ => None,
        }
    }
    /// Reads `[+-]digits[.digits]` with underscores between digits.
    fn parse(number: &str) -> Option<Self> {
        let unsigned = number.strip_prefix(['+', '-']).unwrap_or(number);
        let (whole, fraction) = unsigned.split_once('.').unwrap_or((unsigned, "0"));
        let good = |part: &str| {
            part.bytes().all(|b| b.is_ascii_digit() || b == b'_')
                && part.starts_with(|c: char| c.is_ascii_digit())
                && part.ends_with(|c: char| c.is_ascii_digit())
        };
        if !good(whole) || !good(fraction) {
            return None;
        }
        let digits: String = [whole, fraction.trim_end_matches('0')].concat().replace('_', "");
        let places = fraction.trim_end_matches('0').replace('_', "").len() as u32;
        let digits = digits.trim_start_matches('0');
        if digits.len() > Self::MAX_DIGITS || places as usize > Self::MAX_DIGITS {
            return None;
        }
        let magnitude: i128 = if digits.is_empty() { 0 } else { digits.parse().ok()? };
        Some(Self { digits: if number.starts_with('-') { -magnitude } else { magnitude }, places })
    }
    /// The product with `numerator` / `denominator` as a fraction; `None` if it is beyond all ranges.
    fn times(self, (numerator, denominator): (i128, i128)) -> Option<(i128, i128)> {
        Some((self.digits.checked_mul(numerator)?, 10i128.pow(self.places).checked_mul(denominator)?))
            .filter(|(above, _)| above.unsigned_abs() < 1 << 125)
    }
}

/// How a [`Measure`] without a unit is written, and those that are reckoned from it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Form {
    /// `0.25`, and everything with a unit.
    Decimal,
    /// `1/4`.
    Fraction,
    /// `2.5e-1`.
    Exponent,
}

/// A number with the unit of any quantity, or with none, exact: for what compares and counts values without knowing which
/// key they are for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Measure {
    /// The unit as messages show it; empty without one.
    pub unit: &'static str,
    /// What it measures, with its article; empty without a unit.
    pub noun: &'static str,
    /// The number in steps of its kind, in lowest terms; the denominator is positive.
    steps: (i128, i128),
    /// Steps in one of the unit.
    ratio: (i128, i128),
    form: Form,
}

impl Measure {
    /// The kinds whose units tell them apart.
    /// A `ppm` is one of a frequency here.
    const KINDS: [&'static Kind; 8] = [&TIME, &BITS, &LENGTH, &DEVIATION, &SPEED, &ANGLE, &SHARE, &RATE];
    /// Most digits of a number, and most of its places.
    const DIGITS: usize = 15;

    /// Reads `"1.5 ms"`, `"1500 rpm"`, `"7"`, `"1/4"`, `"1e-6"`; none if it is anything else, or a number of more than 15
    /// digits.
    pub fn read(text: &str) -> Option<Self> {
        Self::without_unit(text).or_else(|| Self::with_unit(text))
    }
    fn with_unit(text: &str) -> Option<Self> {
        let (number, unit) = Decimal::split(text, &TIME).ok().filter(|(number, _)| Self::is_short(number))?;
        let unit = SPELLINGS.iter().find(|(other, _)| *other == unit).map_or(unit, |&(_, usual)| usual);
        let of_kind = |kind: &'static Kind| {
            let &(unit, ratio) = kind.units.iter().find(|(name, _)| *name == unit)?;
            Some((unit, kind.noun, ratio))
        };
        let (unit, noun, ratio) = Self::KINDS.into_iter().find_map(of_kind)?;
        Some(Self { unit, noun, steps: lowest(number.times(ratio)?), ratio, form: Form::Decimal })
    }
    fn without_unit(text: &str) -> Option<Self> {
        let part = |text| Decimal::plain(text).filter(Self::is_short);
        let (above, below) = text.split_once('/').unwrap_or((text, "1"));
        let (above, below) = (part(above)?, part(below).filter(|below| below.digits > 0)?);
        let ten = |places| 10i128.pow(places);
        let steps = above.times((ten(below.places), below.digits))?;
        let form = match text {
            _ if text.contains('/') => Form::Fraction,
            _ if text.contains(['e', 'E']) => Form::Exponent,
            _ => Form::Decimal,
        };
        Some(Self { unit: "", noun: "", steps: lowest(steps), ratio: (1, 1), form })
    }
    /// Whether products of it and a few others do not overflow.
    fn is_short(number: &Decimal) -> bool {
        number.digits.unsigned_abs().to_string().len() <= Self::DIGITS && number.places as usize <= Self::DIGITS
    }
    /// The number of this kind's smallest steps, a fraction in lowest terms.
    pub const fn steps(self) -> (i128, i128) {
        self.steps
    }
    /// Another number of the same kind and unit; none if it is out of reach.
    pub fn with_steps(self, (above, below): (i128, i128)) -> Option<Self> {
        (below > 0 && above.unsigned_abs() < 1 << 100).then(|| Self { steps: lowest((above, below)), ..self })
    }
    /// The number in its unit, to the nearest `f64`.
    pub fn value(self) -> f64 {
        self.value_in(self)
    }
    /// The number in the unit of `other`, to the nearest `f64`.
    pub fn value_in(self, other: Self) -> f64 {
        let (above, below) = self.steps;
        (above * other.ratio.1) as f64 / (below * other.ratio.0) as f64
    }
    /// The number in the unit of `other` with its decimals; none if it has no end.
    pub fn decimal_in(self, other: Self) -> Option<String> {
        let (above, below) = self.steps;
        let (mut above, mut below) = lowest((above.checked_mul(other.ratio.1)?, below.checked_mul(other.ratio.0)?));
        let mut places = 0_usize;
        while below > 1 {
            let factor = [(10, 10), (2, 5), (5, 2)].into_iter().find(|&(divisor, _)| below % divisor == 0)?;
            below /= factor.0;
            above = above.checked_mul(10 / factor.0)?;
            places += 1;
        }
        let (sign, digits) = (if above < 0 { "-" } else { "" }, format!("{:0>1$}", above.unsigned_abs(), places + 1));
        let (whole, fraction) = digits.split_at(digits.len() - places);
        Some(if places == 0 { format!("{sign}{whole}") } else { format!("{sign}{whole}.{fraction}") })
    }
    /// A fraction as one, and a number with an exponent as such; none if it is none.
    fn as_written(self) -> Option<String> {
        match self.form {
            Form::Decimal => None,
            Form::Fraction => Some(format!("{}/{}", self.steps.0, self.steps.1)),
            Form::Exponent => {
                let text = format!("{:e}", self.value());
                Self::read(&text).is_some_and(|read| read.steps == self.steps).then_some(text)
            }
        }
    }
    /// Whether `other` measures the same.
    pub fn is_like(self, other: Self) -> bool {
        self.noun == other.noun
    }
    /// Which of two of the same kind is more; none if they are not.
    pub fn compare(self, other: Self) -> Option<Ordering> {
        let product = |(above, _): (i128, i128), (_, below): (i128, i128)| above.checked_mul(below);
        let exact = product(self.steps, other.steps).zip(product(other.steps, self.steps));
        let nearly = || self.value_in(other).total_cmp(&other.value());
        self.is_like(other).then(|| exact.map_or_else(nearly, |(mine, theirs)| mine.cmp(&theirs)))
    }
}
/// The unit's own number where it has an end, otherwise steps of time: `1.5 ms`, `18001 tick`. A fraction or a number with
/// an exponent stays one where that is shorter: `15/64`, but `0.2401`.
impl fmt::Display for Measure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let decimal = self.decimal_in(*self);
        let length = decimal.as_ref().map_or(usize::MAX, String::len);
        if let Some(written) = self.as_written().filter(|written| written.len() <= length) {
            return f.write_str(&written);
        }
        match decimal {
            Some(number) if self.unit.is_empty() => f.write_str(&number),
            Some(number) => write!(f, "{number} {}", self.unit),
            None if self.noun == TIME.noun && self.steps.1 == 1 => write!(f, "{} tick", self.steps.0),
            None if self.unit.is_empty() => self.value().fmt(f),
            None => write!(f, "{} {}", self.value(), self.unit),
        }
    }
}

/// The fraction without common factors.
fn lowest((above, below): (i128, i128)) -> (i128, i128) {
    let (mut a, mut b) = (above.unsigned_abs(), below.unsigned_abs());
    while b != 0 {
        (a, b) = (b, a % b);
    }
    let divisor = a.max(1) as i128;
    (above / divisor, below / divisor)
}

/// Reads `text` as whole steps of `kind`.
fn read(text: &str, kind: &Kind) -> Result<i128, QuantityError> {
    let (number, unit) = Decimal::split(text, kind)?;
    whole(text, kind, number.times(ratio(text, unit, kind, &[])?))
}

/// What one of `unit` is worth; `more` are further units that the caller knows, for the message.
fn ratio(text: &str, unit: &str, kind: &Kind, more: &[&str]) -> Result<(i128, i128), QuantityError> {
    let unit = SPELLINGS.iter().find(|(other, _)| *other == unit).map_or(unit, |&(_, usual)| usual);
    kind.units.iter().find(|(name, _)| *name == unit).map(|&(_, ratio)| ratio).ok_or_else(|| {
        let names: Vec<_> = kind.units.iter().map(|&(name, _)| name).chain(more.iter().copied()).collect();
        QuantityError::Unit { text: text.into(), found: found(unit), noun: kind.noun, units: names.join(", ") }
    })
}

/// What stands in the place of a unit, in words.
fn found(unit: &str) -> String {
    let is_exponent = |rest: &str| rest.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '+' | '-'));
    match unit.strip_prefix(['e', 'E']) {
        _ if unit.is_empty() => "no unit".into(),
        Some(rest) if is_exponent(rest) => "an exponent, which is not read".into(),
        _ => format!("the unit \"{unit}\""),
    }
}

/// The whole number that `fraction` is.
fn whole(text: &str, kind: &Kind, fraction: Option<(i128, i128)>) -> Result<i128, QuantityError> {
    let Some((above, below)) = fraction else {
        return Ok(if text.trim().starts_with('-') { i128::MIN } else { i128::MAX });
    };
    let floor = above.div_euclid(below);
    if above.rem_euclid(below) == 0 {
        return Ok(floor);
    }
    let show = |steps: i128| format!("{steps} {}", kind.unit_of_step);
    Err(QuantityError::NotWhole { text: text.into(), step: kind.step, below: show(floor), above: show(floor + 1) })
}

/// The error for a quantity that does not fit.
fn range(text: &str, kind: &Kind, min: &str, max: &str) -> QuantityError {
    QuantityError::Range { text: text.into(), noun: kind.noun, min: min.into(), max: max.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn message<T: std::fmt::Debug>(result: Result<T, QuantityError>) -> String {
        result.unwrap_err().to_string()
    }

    #[test]
    fn gains_are_fractions_or_decimals() {
        for (text, steps) in [
            ("1/4", 16_384),
            ("0.25", 16_384),
            ("25e-2", 16_384),
            ("1 / 32", 2_048),
            ("0", 0),
            ("1", 65_536),
            ("0.3", 19_661),
        ] {
            assert_eq!(gain(text), Ok(steps), "{text}");
        }
        assert_eq!(gain("1/3"), Ok(21_845));
        for text in ["1/0", "", "/", "1/", "a quarter", "1/-4", "1/2/2"] {
            assert!(message(gain(text)).contains("is not a gain"), "{text}");
        }
        for text in ["-0.1", "2", "1.1", "999999999999999999999999/0.000000000000000000000001"] {
            assert!(message(gain(text)).contains("is beyond the range of a gain, 0 to 1"), "{text}");
        }
    }

    #[test]
    fn measures_compare_across_units_and_print_in_their_own() {
        let read = |text| Measure::read(text).unwrap();
        for (less, more) in
            [("999 us", "1 ms"), ("-1 ns", "0 s"), ("1 tick", "0.084 ns"), ("2", "10"), ("1 m", "101 cm")]
        {
            assert_eq!(read(less).compare(read(more)), Some(Ordering::Less), "{less}, {more}");
            assert_eq!(read(more).compare(read(less)), Some(Ordering::Greater), "{less}, {more}");
        }
        assert_eq!(read("1000 us").compare(read("1 ms")), Some(Ordering::Equal));
        assert_eq!(read("1 us").compare(read("1 m")), None);
        assert_eq!(read("1").compare(read("1 m")), None);
        for text in ["1.5 ms", "-0.25 ns", "1500 rpm", "7", "0.5", "12 Mbit/s", "30 tbit", "0.1 deg", "2.5 %"] {
            assert_eq!(read(text).to_string(), text);
        }
        assert_eq!(read("1.50 ms").decimal_in(read("1 us")).unwrap(), "1500");
        assert_eq!(read("1 tick").decimal_in(read("1 us")), None);
        assert_eq!(read("1 us").with_steps((12_001, 1)).unwrap().to_string(), "12001 tick");
        for text in ["3..10", "12 parsec", "", "ms", "0.1234567890123456 s", "uniform"] {
            assert_eq!(Measure::read(text), None, "{text}");
        }
    }

    #[test]
    fn measures_without_unit_may_be_fractions_and_have_exponents() {
        let read = |text| Measure::read(text).unwrap_or_else(|| panic!("{text}"));
        for (text, steps) in
            [("1/4", (1, 4)), ("2 / 6", (1, 3)), ("1e-6", (1, 1_000_000)), ("2.5E3", (2_500, 1)), ("-1/2", (-1, 2))]
        {
            assert_eq!((read(text).steps(), read(text).unit), (steps, ""), "{text}");
        }
        for (text, shown) in [
            ("1/4", "1/4"),
            ("2/6", "1/3"),
            ("2401/10000", "0.2401"),
            ("8/2", "4"),
            ("1e-6", "1e-6"),
            ("56.2e-6", "5.62e-5"),
            ("1e-2", "1e-2"),
            ("250e-3", "0.25"),
            ("1e3", "1e3"),
            ("0.000001", "0.000001"),
        ] {
            assert_eq!(read(text).to_string(), shown);
            assert_eq!(read(shown).steps(), read(text).steps());
        }
        assert_eq!(read("1/64").with_steps((15, 64)).unwrap().to_string(), "15/64");
        assert_eq!(read("1e-6").with_steps((3, 10_000_000)).unwrap().to_string(), "3e-7");
        assert_eq!(read("1/4").compare(read("0.26")), Some(Ordering::Less));
        for text in
            ["1/0", "1/2/3", "1/-2", "/2", "1e", "1e99", "1e-31", "e-6", "1 s/2", "1/4 ms", "1e-6 s", "2026-01-01"]
        {
            assert_eq!(Measure::read(text), None, "{text}");
        }
    }

    #[test]
    fn times_are_exact() {
        for (text, span_) in [
            ("125 us", Span::from_us(125)),
            ("125us", Span::from_us(125)),
            ("125 \u{b5}s", Span::from_us(125)),
            ("125 \u{3bc}s", Span::from_us(125)),
            ("2 ms", Span::from_ms(2)),
            ("0.5 ns", Span::from_ticks(6)),
            ("0.25 ns", Span::from_ticks(3)),
            ("1 tick", Span::from_ticks(1)),
            ("-7 ticks", Span::from_ticks(-7)),
            ("+1.500 s", Span::from_ms(1_500)),
            ("  10   s ", Span::from_s(10)),
            ("1_000 ns", Span::from_us(1)),
            ("1.5 h", Span::from_s(5_400)),
            ("37 tbit", BitRate::M1_5.span(Tbit(37))),
        ] {
            assert_eq!(span(text, Some(BitRate::M1_5)), Ok(span_), "{text}");
        }
    }

    #[test]
    fn a_time_between_two_ticks_is_refused_with_its_neighbours() {
        assert_eq!(
            message(span("0.1 ns", None)),
            "\"0.1 ns\" is not a whole number of ticks of 1/12 ns; its neighbours are \"1 tick\" and \"2 tick\""
        );
        assert_eq!(
            message(span("-0.1 ns", None)),
            "\"-0.1 ns\" is not a whole number of ticks of 1/12 ns; its neighbours are \"-2 tick\" and \"-1 tick\""
        );
        assert_eq!(
            message(tbit("3.5 tbit")),
            "\"3.5 tbit\" is not a whole number of bits; its neighbours are \"3 tbit\" and \"4 tbit\""
        );
    }

    #[test]
    fn a_wrong_unit_is_answered_with_the_right_ones() {
        assert_eq!(
            message(span("10 m", None)),
            "\"10 m\" has the unit \"m\"; a time has one of the units ns, us, ms, s, min, h, tick"
        );
        assert_eq!(
            message(span("10", Some(BitRate::M12))),
            "\"10\" has no unit; a time has one of the units ns, us, ms, s, min, h, tick, tbit"
        );
        assert_eq!(
            message(span("soon", None)),
            "\"soon\" is not a time: write a number and a unit, such as \"125 us\""
        );
        assert_eq!(
            message(micro_rpm("3 m/s")),
            "\"3 m/s\" has the unit \"m/s\"; a speed has one of the units rpm, rev/s, deg/s, urpm"
        );
    }

    #[test]
    fn what_is_too_large_is_refused() {
        assert_eq!(
            message(span("300000 h", None)),
            "\"300000 h\" is beyond the range of a time, -24 years to 24 years"
        );
        for text in ["999999999999999999999999 h", "-999999999999999999999999 h"] {
            assert!(matches!(span(text, None), Err(QuantityError::Range { .. })), "{text}");
        }
        assert!(matches!(span(&"9".repeat(200), None), Err(QuantityError::NoNumber { .. })));
        assert!(matches!(tbit("-1 tbit"), Err(QuantityError::Range { .. })));
        assert!(matches!(tbit("4294967296 tbit"), Err(QuantityError::Range { .. })));
        assert!(matches!(millimetres("-1 m"), Err(QuantityError::Range { .. })));
        assert!(matches!(ppb("1000.001 ppm"), Err(QuantityError::Range { .. })));
        assert!(matches!(angle("2147483648 rev"), Err(QuantityError::Range { .. })));
    }

    #[test]
    fn other_quantities() {
        assert_eq!(millimetres("0.1 km"), Ok(100_000));
        assert_eq!(millimetres("12.5 m"), Ok(12_500));
        assert_eq!(ppb("-50 ppm"), Ok(-50_000));
        assert_eq!(micro_rpm("1500 rpm"), Ok(1_500_000_000));
        assert_eq!(micro_rpm("90 deg/s"), Ok(15_000_000));
        assert_eq!(angle("0.25 rev"), Ok(Angle::from_units(1 << 30)));
        assert_eq!(angle("90 deg"), Ok(Angle::from_units(1 << 30)));
        assert_eq!(angle("-1 rev"), Ok(Angle::from_revs(-1)));
        assert_eq!(angle("0.1 rev"), Ok(Angle::from_units(429_496_730)));
    }

    #[test]
    fn shares_are_exact() {
        let whole = Share::WHOLE;
        for (text, parts) in [
            ("1 %", whole / 100),
            ("100%", whole),
            ("0.5 %", whole / 200),
            ("3 ppm", 3 * whole / 1_000_000),
            ("2 ppb", 2_000_000),
            ("1e-6", whole / 1_000_000),
            ("2.5E-9", 2_500_000),
            ("100e-17", 1),
            ("0.25", whole / 4),
            ("1", whole),
            ("0", 0),
        ] {
            assert_eq!(share(text).map(Share::parts), Ok(parts), "{text}");
        }
        assert_eq!(message(share("often")), "\"often\" is not a share: write a number and a unit, such as \"1 %\"");
        assert!(message(share("1e-16")).contains("is not a whole number of parts in 10^15"));
        for text in ["-1 %", "101 %", "2", "1e1", "-1e-6"] {
            assert!(message(share(text)).ends_with("is beyond the range of a share, 0 to 1"), "{text}");
        }
        for text in ["1 s", "1e99", "1e-99", "1e"] {
            assert!(matches!(share(text), Err(QuantityError::Unit { .. })), "{text}");
        }
    }

    #[test]
    fn every_bit_rate_is_read_as_it_is_shown() {
        for &rate in BitRate::ALL {
            assert_eq!(bit_rate(rate.text()), Ok(rate));
        }
        assert_eq!(bit_rate("12000 kbit/s"), Ok(BitRate::M12));
        assert_eq!(
            message(bit_rate("11 Mbit/s")),
            "\"11 Mbit/s\" is not a bit rate of PROFIBUS DP; the nearest is \"12 Mbit/s\""
        );
    }

    proptest! {
        #[test]
        fn what_a_span_shows_is_read_again(us in -1_000_000_000i64..1_000_000_000) {
            let long = Span::from_us(us);
            let short = Span::from_ns(us);
            // Three decimals of the unit shown are exact as long as there are no more than six digits.
            for whole in [Span::from_us(us % 1_000_000), Span::from_ns(us % 1_000_000)] {
                prop_assert_eq!(span(&whole.to_string(), None), Ok(whole));
            }
            prop_assert_eq!(span(&format!("{us} us"), None), Ok(long));
            prop_assert_eq!(span(&format!("{us} ns"), None), Ok(short));
        }
        #[test]
        fn no_text_panics(text in "[-+.0-9_ a-zµ/]{0,40}") {
            let _ = (span(&text, Some(BitRate::M12)), tbit(&text), millimetres(&text), ppb(&text));
            let _ = (micro_rpm(&text), angle(&text), bit_rate(&text), share(&text), gain(&text));
            let _ = Measure::read(&text).map(|measure| measure.to_string());
        }
    }
}
