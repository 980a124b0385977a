//! Confidence: how often an interval is to hold what it is about.

use core::fmt;

/// The probability that an interval holds the true value, between 0 and 1.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Confidence(f64);

/// A confidence that is no probability between 0 and 1.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
#[error("confidence = {0} is not between 0 and 1; 0.95 is usual")]
pub struct ConfidenceError(f64);

impl Confidence {
    /// 95 %, as is usual.
    pub const USUAL: Self = Self(0.95);

    /// A confidence of `value`.
    ///
    /// # Errors
    /// If `value` is not between 0 and 1.
    pub fn new(value: f64) -> Result<Self, ConfidenceError> {
        // Nearer to 1 than this, what is outside has lost its digits.
        if value > 0.0 && value < 1.0 - 1e-12 { Ok(Self(value)) } else { Err(ConfidenceError(value)) }
    }
    /// The probability itself.
    pub const fn value(self) -> f64 {
        self.0
    }
    /// The probability of missing the true value.
    pub const fn outside(self) -> f64 {
        1.0 - self.0
    }
    /// Half of that: what an interval may miss on either side.
    pub const fn tail(self) -> f64 {
        0.5 * self.outside()
    }
}

/// In percent: `95 %`, `99.9 %`.
impl fmt::Display for Confidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // To the millionth of a percent: 0.57 is 56.99999999999999 % in binary.
        write!(f, "{} %", (self.0 * 1e8).round() / 1e6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_probabilities_between_0_and_1_are_taken() {
        for value in [0.0, 1.0, -0.5, 95.0, f64::NAN, f64::INFINITY] {
            assert!(Confidence::new(value).is_err(), "{value}");
        }
        let error = Confidence::new(95.0).unwrap_err();
        assert_eq!(error.to_string(), "confidence = 95 is not between 0 and 1; 0.95 is usual");
        assert_eq!(Confidence::new(0.95).unwrap(), Confidence::USUAL);
        assert_eq!([0.95, 0.999, 0.57].map(|c| Confidence::new(c).unwrap().to_string()), ["95 %", "99.9 %", "57 %"]);
    }
}
