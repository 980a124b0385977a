//! Interval: an estimate with the bounds between which the true value is.

/// An estimate and its bounds, all three in the unit of the values they were made of.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Interval {
    /// The estimate.
    pub estimate: f64,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
}

impl Interval {
    /// `estimate` ± `half_width`.
    pub fn around(estimate: f64, half_width: f64) -> Self {
        Self { estimate, low: estimate - half_width, high: estimate + half_width }
    }
    /// Half the distance of the bounds.
    pub fn half_width(&self) -> f64 {
        0.5 * (self.high - self.low)
    }
    /// Whether `value` is between the bounds, both included.
    pub fn holds(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}
