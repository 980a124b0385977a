//! The incomplete beta function I_x(a, b), its inverse, and the binomial distribution, which is made of it.
//!
//! Everything exact that is said of probabilities, quantiles and means of few runs comes from here. It is written on
//! `libm` alone, so that an interval has the same digits on every machine: the statistics crates there are take logarithm and power from
//! the platform.
//!
//! x^a (1-x)^b / B(a, b) is computed by the saddle point (Loader, "Fast and accurate computation of binomial
//! probabilities", 2000), which keeps its digits however large a and b are; the rest is the continued fraction
//! (9) of DiDonato and Morris ("Significant digit computation of the incomplete beta function ratios", 1992), whose cost
//! grows with the root of a + b.

use core::f64::consts::TAU;

/// ln sqrt(2 pi).
const LN_SQRT_TAU: f64 = 0.918_938_533_204_672_8;

/// A number from 0 to 1 with what it lacks to 1, so that neither loses its digits next to the other.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Share {
    /// The number x.
    pub x: f64,
    /// 1 - x.
    pub rest: f64,
}

impl Share {
    /// `x`, 0 ..= 1, as it is.
    pub fn new(x: f64) -> Self {
        Self { x, rest: 1.0 - x }
    }
    /// 1 - x in place of x.
    #[must_use]
    pub const fn turned(self) -> Self {
        Self { x: self.rest, rest: self.x }
    }
}

/// I_x(a, b): the probability that a beta variable with parameters `a` and `b` is at most `x`.
///
/// # Panics
/// If `a` or `b` is not a positive number, or `x` is outside of 0 ..= 1.
pub fn beta_cdf(a: f64, b: f64, x: Share) -> f64 {
    assert!(a > 0.0 && b > 0.0 && (a + b).is_finite(), "beta distribution of {a} and {b}");
    assert!((0.0..=1.0).contains(&x.x), "{} is outside of 0 to 1", x.x);
    if x.x <= 0.0 || x.rest <= 0.0 {
        return if x.rest <= 0.0 { 1.0 } else { 0.0 };
    }
    // On this side of the mean the fraction converges fast, on the other side that of 1 - x does.
    if x.x < (a + 1.0) / (a + b + 2.0) {
        weight(a, b, x) / fraction(a, b, x)
    } else {
        1.0 - weight(b, a, x.turned()) / fraction(b, a, x.turned())
    }
}

/// The x with I_x(a, b) = `p`; the far end of 0 ..= 1 where `p` is 0 or 1.
///
/// # Panics
/// As [`beta_cdf`].
pub fn beta_quantile(a: f64, b: f64, p: Share) -> Share {
    assert!((0.0..=1.0).contains(&p.x), "{} is outside of 0 to 1", p.x);
    if p.x <= 0.0 || p.rest <= 0.0 {
        return Share::new(if p.rest <= 0.0 { 1.0 } else { 0.0 });
    }
    // The smaller of x and 1 - x is looked for: it has all its digits.
    if beta_cdf(a, b, Share::new(0.5)) >= p.x {
        Share::new(lower_half(a, b, p))
    } else {
        Share::new(lower_half(b, a, p.turned())).turned()
    }
}

/// The x, 0 < x <= 1/2, with I_x(a, b) = p: Newton's steps of ln x, kept between the ends that are known.
///
/// The smaller tail is the one compared, by its logarithm: a tail of 1e-12 is met to as many digits as one of 0.5.
fn lower_half(a: f64, b: f64, p: Share) -> f64 {
    /// Steps that suffice even if each only halves the exponent of x.
    const STEPS: u32 = 200;
    /// Newton's steps double the digits: after one so small, relative to x, all of them are right.
    const SMALL: f64 = 1e-9;
    let upper = p.x > 0.5;
    let tail = |x: Share| if upper { beta_cdf(b, a, x.turned()) } else { beta_cdf(a, b, x) };
    let (wanted, sign) = if upper { (p.rest, -1.0) } else { (p.x, 1.0) };
    let (mut low, mut high) = (0.0_f64, 0.5_f64);
    let mut x = (a / (a + b)).min(0.5);
    for _ in 0..STEPS {
        let share = Share::new(x);
        let found = tail(share);
        let off = sign * libm::log(found / wanted);
        if off.abs() < f64::MIN_POSITIVE {
            return x;
        }
        if off < 0.0 {
            low = x;
        } else {
            high = x;
        }
        let slope = weight(a, b, share) / (share.rest * found);
        let next = x * libm::exp(-off / slope);
        if (next - x).abs() <= SMALL * x {
            return next.clamp(low, high);
        }
        x = if low < next && next < high {
            next
        } else if low > 0.0 {
            (low * high).sqrt()
        } else {
            high / 1024.0
        };
    }
    x
}

/// x^a (1-x)^b / B(a, b), for 0 < x < 1.
fn weight(a: f64, b: f64, x: Share) -> f64 {
    let n = a + b;
    let exponent =
        stirling_error(n) - stirling_error(a) - stirling_error(b) - deviance(a, n * x.x) - deviance(b, n * x.rest);
    (a / n * b / TAU).sqrt() * libm::exp(exponent)
}

/// ln Gamma(z + 1) less Stirling's formula for it, z > 0.
fn stirling_error(z: f64) -> f64 {
    /// From here on the series has all digits of an f64.
    const LARGE: f64 = 16.0;
    if z < LARGE {
        return libm::lgamma(z + 1.0) - (z + 0.5) * libm::log(z) + z - LN_SQRT_TAU;
    }
    let square = 1.0 / (z * z);
    let terms = [-691.0 / 360_360.0, 1.0 / 1_188.0, -1.0 / 1_680.0, 1.0 / 1_260.0, -1.0 / 360.0, 1.0 / 12.0];
    terms.iter().fold(0.0, |sum, term| sum * square + term) / z
}

/// x ln(x / mean) + mean - x, without the loss of digits near x = mean.
fn deviance(x: f64, mean: f64) -> f64 {
    let (difference, sum) = (x - mean, x + mean);
    if difference.abs() >= 0.1 * sum {
        return x * libm::log(x / mean) - difference;
    }
    // ln(x / mean) = 2 artanh(v), as a series in v.
    let v = difference / sum;
    let mut total = difference * v;
    let mut power = 2.0 * x * v;
    for odd in (3..).step_by(2) {
        power *= v * v;
        let next = total + power / f64::from(odd);
        if next.to_bits() == total.to_bits() {
            break;
        }
        total = next;
    }
    total
}

/// x^a (1-x)^b / (B(a, b) I_x(a, b)), a continued fraction, by Lentz's method, for x below the mean.
///
/// 1 - x is never taken as a difference, so x may be as near to 1 as it likes.
fn fraction(a: f64, b: f64, x: Share) -> f64 {
    /// In place of a denominator that vanishes.
    const TINY: f64 = 1e-300;
    let safe = |value: f64| if value.abs() < TINY { TINY } else { value };
    let denominator = |term: f64| {
        let twice = a + 2.0 * term;
        let first = if term > 0.0 { term + term * (b - term) * x.x / (twice - 1.0) } else { 0.0 };
        first + (a + term) * (a * x.rest - b * x.x + 1.0 + term * (1.0 + x.rest)) / (twice + 1.0)
    };
    let mut value = safe(denominator(0.0));
    let (mut ratio, mut inverse) = (value, 0.0);
    let mut term = 0.0;
    loop {
        term += 1.0;
        let root = x.x / (a + 2.0 * term - 1.0);
        let numerator = (a + term - 1.0) * (a + b + term - 1.0) * term * (b - term) * root * root;
        let below = denominator(term);
        inverse = 1.0 / safe(below + numerator * inverse);
        ratio = safe(below + numerator / ratio);
        value *= ratio * inverse;
        // Model: it converges for every x below the mean; the bound only keeps a mistake from running for ever.
        if (ratio * inverse - 1.0).abs() <= f64::EPSILON || term > 1e9 {
            return value;
        }
    }
}

/// The probability of at most `k` successes in `n` trials of probability `p` each.
///
/// # Panics
/// If `p` is outside of 0 ..= 1.
pub fn binomial_cdf(k: u64, n: u64, p: Share) -> f64 {
    if k >= n { 1.0 } else { beta_cdf((n - k) as f64, (k + 1) as f64, p.turned()) }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::FRAC_1_SQRT_2;

    use super::*;

    #[track_caller]
    fn near(found: f64, expected: f64, relative: f64) {
        assert!((found / expected - 1.0).abs() <= relative, "{found:e} is not {expected:e}");
    }

    // Expected values here and in the neighbouring files: computed with 60 digits by a program of other origin (mpmath).

    #[test]
    fn distribution_functions_have_their_digits() {
        for (a, b, x, expected) in [
            (1.0, 10.0, 0.25, 9.436_864_852_905_273e-1),
            (5.0, 16.0, 0.125, 9.501_116_598_654_122e-2),
            (0.5, 0.5, 0.3125, 3.776_427_064_608_769e-1),
            (2.5, 0.5, 0.9375, 5.887_244_480_896_833e-1),
            (50.0, 0.5, 0.96875, 7.550_584_564_749_274e-2),
            (1e3, 2e3, 0.3125, 7.282_614_925_509_493_5e-3),
            (1e5, 3e5, 0.250_976_562_5, 9.230_274_177_798_956e-1),
            (1e6, 1e6, 0.500_976_562_5, 9.971_287_912_796_314e-1),
            (3.0, 1e6, 9.536_743_164_062_5e-7, 7.198_089_508_968_794e-2),
            (0.5, 2e3, 0.000_244_140_625, 6.769_503_492_198_432e-1),
            (12.0, 7.0, 0.007_812_5, 9.189_551_132_055_135e-22),
        ] {
            near(beta_cdf(a, b, Share::new(x)), expected, 1e-11);
            let rest = beta_cdf(b, a, Share::new(x).turned());
            assert!((1.0 - rest - expected).abs() < 1e-12, "{rest:e} and {expected:e}");
        }
        assert_eq!(beta_cdf(2.0, 3.0, Share::new(0.0)).to_bits(), 0);
        assert_eq!(beta_cdf(2.0, 3.0, Share::new(1.0)).to_bits(), 1.0f64.to_bits());
    }

    #[test]
    fn quantiles_have_their_digits_near_either_end() {
        for (a, b, p, x, rest) in [
            (1.0, 10.0, 0.25, 2.835_834_213_692_65e-2, 9.716_416_578_630_735e-1),
            (2.0, 9.0, 0.03125, 2.842_982_103_284_055_8e-2, 9.715_701_789_671_595e-1),
            (5.0, 16.0, 0.03125, 9.174_778_806_046_895e-2, 9.082_522_119_395_311e-1),
            (6.0, 15.0, 0.96875, 4.801_039_266_372_369e-1, 5.198_960_733_627_631e-1),
            (1.0, 1e6, 0.96875, 3.465_729_897_143_990_6e-6, 9.999_965_342_701_028e-1),
            (2.0, 1e6, 0.03125, 2.735_822_966_914_53e-7, 9.999_997_264_177_033e-1),
            (0.5, 5.0, 0.9375, 3.052_204_229_587_734_4e-1, 6.947_795_770_412_266e-1),
            (0.5, 0.5, 0.03125, 2.407_636_663_901_557e-3, 9.975_923_633_360_985e-1),
            (300.0, 200.0, 0.007_812_5, 5.465_175_530_227_712e-1, 4.534_824_469_772_288e-1),
            (10.0, 1.0, 0.03125, FRAC_1_SQRT_2, 1.0 - FRAC_1_SQRT_2),
            (100_001.0, 2e5, 0.96875, 3.349_396_510_349_942_3e-1, 6.650_603_489_650_058e-1),
            (5.0, 5.0, 9.094_947_017_729_282e-13, 1.486_334_324_891_861_6e-3, 9.985_136_656_751_081e-1),
            (0.5, 1e6, 0.9375, 1.734_883_933_762_446_7e-6, 9.999_982_651_160_663e-1),
        ] {
            for found in [beta_quantile(a, b, Share::new(p)), beta_quantile(b, a, Share::new(p).turned()).turned()] {
                near(found.x, x, 1e-11);
                near(found.rest, rest, 1e-11);
            }
        }
        assert_eq!(beta_quantile(2.0, 3.0, Share::new(0.0)), Share { x: 0.0, rest: 1.0 });
        assert_eq!(beta_quantile(2.0, 3.0, Share::new(1.0)), Share { x: 1.0, rest: 0.0 });
    }

    #[test]
    fn quantile_and_distribution_function_undo_each_other() {
        for a in [0.5, 1.0, 1.5, 7.0, 63.5, 1e4] {
            for b in [0.5, 1.0, 2.5, 40.0, 1e5] {
                for p in [1e-9, 1e-3, 0.025, 0.5, 0.975, 0.999] {
                    let x = beta_quantile(a, b, Share::new(p));
                    near(x.x + x.rest, 1.0, 1e-15);
                    near(beta_cdf(a, b, x), p, 1e-9);
                }
            }
        }
    }

    #[test]
    fn binomial_probabilities_add_up() {
        for (k, n, p, expected) in [
            (0, 10, 0.25, 5.631_351_470_947_265_6e-2),
            (3, 10, 0.25, 7.758_750_915_527_344e-1),
            (49, 100, 0.5, 4.602_053_813_064_106_4e-1),
            (990, 1_000, 0.992_187_5, 2.598_361_896_660_967e-1),
            (499_000, 1_000_000, 0.5, 2.280_414_993_269_104e-2),
        ] {
            near(binomial_cdf(k, n, Share::new(p)), expected, 1e-11);
        }
        assert_eq!(binomial_cdf(7, 7, Share::new(0.5)).to_bits(), 1.0f64.to_bits());
        // Of an impossible and a certain success.
        assert_eq!(binomial_cdf(0, 7, Share::new(0.0)).to_bits(), 1.0f64.to_bits());
        assert_eq!(binomial_cdf(6, 7, Share::new(1.0)).to_bits(), 0);
    }
}
