//! The normal distribution's tail and quantile, on `libm` alone.

use core::f64::consts::{FRAC_1_SQRT_2, TAU};

/// The probability that a standard normal number is larger than `z`.
pub fn normal_tail(z: f64) -> f64 {
    0.5 * libm::erfc(z * FRAC_1_SQRT_2)
}

/// The z that a standard normal number exceeds with probability `tail`; negative above one half.
///
/// # Panics
/// If `tail` is not between 0 and 1.
pub fn normal_quantile(tail: f64) -> f64 {
    /// Steps that bring four digits to sixteen, and one to spare.
    const STEPS: u32 = 4;
    assert!(tail > 0.0 && tail < 1.0, "tail {tail} is not between 0 and 1");
    if tail > 0.5 {
        return -normal_quantile(1.0 - tail);
    }
    // Abramowitz and Stegun 26.2.23, good to 4.5e-4.
    let t = (-2.0 * libm::log(tail)).sqrt();
    let start =
        t - (2.515_517 + t * (0.802_853 + t * 0.010_328)) / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)));
    // Newton's steps of the tail's logarithm, which is nearly a parabola.
    let step = |z: f64| {
        let found = normal_tail(z);
        let density = libm::exp(-0.5 * z * z) / TAU.sqrt();
        z + libm::log(found / tail) * found / density
    };
    (0..STEPS).fold(start, |z, _| step(z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_have_their_digits() {
        for (tail, expected) in [
            (0.5, 0.0),
            (0.4, 2.533_471_031_357_998e-1),
            (0.25, 6.744_897_501_960_817e-1),
            (0.1, 1.281_551_565_544_600_5),
            (0.05, 1.644_853_626_951_472_7),
            (0.025, 1.959_963_984_540_054_2),
            (0.01, 2.326_347_874_040_841),
            (0.005, 2.575_829_303_548_901),
            (1e-6, 4.753_424_308_822_899),
            (1e-12, 7.034_483_825_301_132),
            (1e-100, 2.127_345_356_096_532_4e1),
            (0.975, -1.959_963_984_540_054_2),
        ] {
            let found = normal_quantile(tail);
            assert!((found - expected).abs() <= 1e-13 * expected.abs().max(1.0), "{tail}: {found}");
        }
    }
}
