//! Student's t distribution: what a mean of few values may stray by.

use super::beta::{Share, beta_cdf, beta_quantile};
use super::confidence::Confidence;

/// The t that the magnitude of a Student variable of `freedom` degrees does not exceed with probability `confidence`.
///
/// # Panics
/// If `freedom` is not a positive number.
pub fn student_quantile(freedom: f64, confidence: Confidence) -> f64 {
    // freedom / (freedom + t²) is a beta variable: at most x if the magnitude is at least t.
    let outside = Share { x: confidence.outside(), rest: confidence.value() };
    let share = beta_quantile(0.5 * freedom, 0.5, outside);
    (freedom * (share.rest / share.x)).sqrt()
}

/// The probability that the magnitude of a Student variable of `freedom` degrees is at most `t`.
///
/// # Panics
/// If `freedom` is not a positive number or `t` is negative.
pub fn student_within(freedom: f64, t: f64) -> f64 {
    assert!(t >= 0.0, "magnitude {t} is negative");
    let square = t * t;
    let sum = freedom + square;
    beta_cdf(0.5, 0.5 * freedom, Share { x: square / sum, rest: freedom / sum })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (freedom, confidence, expected) in [
            (1.0, 0.5, 1.0),
            (1.0, 0.9, 6.313_751_514_675_043),
            (1.0, 0.95, 12.706_204_736_174_705),
            (1.0, 0.99, 63.656_741_162_871_58),
            (2.0, 0.95, 4.302_652_729_749_464),
            (5.0, 0.95, 2.570_581_835_636_315_5),
            (9.0, 0.99, 3.249_835_541_592_126_3),
            (15.0, 0.95, 2.131_449_545_559_775_7),
            (30.0, 0.9, 1.697_260_886_593_957_8),
            (30.0, 0.999, 3.645_958_635_042_022),
            (120.0, 0.95, 1.979_930_405_082_441),
            (1_000.0, 0.95, 1.962_339_080_826_408_5),
            (1e6, 0.99, 2.575_834_220_105_334_2),
            (3.0, 1e-3, 1.360_350_082_597_361_3e-3),
        ] {
            let found = student_quantile(freedom, Confidence::new(confidence).unwrap());
            assert!((found / expected - 1.0).abs() < 1e-11, "{freedom} {confidence}: {found}");
            assert!((student_within(freedom, found) / confidence - 1.0).abs() < 1e-11);
        }
    }
}
