//! Scale: the values that a search can try, numbered from its beginning.
//!
//! All of them are exact and lie on a grid that begins with `from`: number n is `from` and n steps towards `to`, and the
//! last number is `to` itself, however long its step is. With a step, neighbours are one step apart; with a resolution,
//! they are so near to each other, as a share of their magnitude, that nothing between is worth a try.

use crate::study::quantity::Measure;
use crate::study::scenario::error::Fault;
use crate::study::statistics::bisection::Axis;
use crate::study::sweep::axis::{distance, like, measured, too_fine};

/// Most values of a grid. Model: halving them takes 40 values to try.
const MOST: i128 = 1_000_000_000_000;
/// From this ratio on a value is looked for in the right order of magnitude first.
const FAR: f64 = 4.0;

/// The values.
#[derive(Clone, PartialEq, Debug)]
pub struct Scale {
    from: Measure,
    to: Measure,
    /// Distance of neighbours on the grid, positive.
    step: Measure,
    /// Number of `to`.
    last: i64,
    /// Distance of neighbours as a share of the larger magnitude; 0 with a step.
    resolution: f64,
}

impl Scale {
    /// Values `step` apart.
    ///
    /// # Errors
    /// The three are not of one kind, the step is not above 0, or there are too many values.
    pub fn stepped(from: Measure, to: Measure, step: Measure) -> Result<Self, Fault> {
        like(from, to)?;
        if !from.is_like(step) {
            return Err(Fault::new(format!("\"{from}\" and the step \"{step}\" are not of one kind")));
        }
        if step.steps().0 <= 0 {
            let fault = Fault::new(format!("a step of \"{step}\" leads nowhere"));
            return Err(fault.help("write it positive, whatever the direction"));
        }
        Self::new((from, to), step, 0.0)
    }
    /// Values that are known to `resolution`, a share of their magnitude above 0. The grid is that fine at the smaller
    /// end; where the search begins or ends with zero, or crosses it, a tenth of that at the larger one.
    ///
    /// # Errors
    /// The ends are not of one kind, or the grid has too many values.
    pub fn resolved(from: Measure, to: Measure, resolution: f64) -> Result<Self, Fault> {
        like(from, to)?;
        let whole = !from.noun.is_empty() || [from, to].iter().all(|end| end.steps().1 == 1);
        Self::gridded((from, to), resolution, whole)
    }
    fn gridded((from, to): (Measure, Measure), resolution: f64, whole: bool) -> Result<Self, Fault> {
        let ends = [from.value(), to.value_in(from)];
        let [small, large] = [ends[0].abs().min(ends[1].abs()), ends[0].abs().max(ends[1].abs())];
        let crosses = ends[0] * ends[1] <= 0.0;
        let fine = resolution * if crosses { 0.1 * large } else { small };
        Self::new((from, to), round(fine, from, whole)?, resolution)
    }
    /// The same ends and resolution with fractions between them, where only whole numbers were: for a key that takes more
    /// than those, such as a share from 0 to 1. Nothing where a step was asked for.
    pub fn finer(&self) -> Option<Self> {
        let finer = || Self::gridded((self.from, self.to), self.resolution, false).ok();
        let whole = self.resolution > 0.0 && self.from.noun.is_empty() && self.step.steps().1 == 1;
        finer().filter(|finer| whole && finer.step.steps().1 > 1)
    }
    fn new((from, to): (Measure, Measure), step: Measure, resolution: f64) -> Result<Self, Fault> {
        let quotient = distance(from, to).and_then(|(above, below)| {
            let (of, per) = step.steps();
            Some((above.checked_mul(per)?, below.checked_mul(of)?))
        });
        let (above, below) = quotient.ok_or_else(too_fine)?;
        let count = above / below + i128::from(above % below != 0);
        if count > MOST {
            let fault = Fault::new(format!("there are {count} steps of \"{step}\" from \"{from}\" to \"{to}\""));
            return Err(fault.rule(format!("a search has at most {MOST}")));
        }
        let scale = Self { from, to, step, last: count as i64, resolution };
        // What the farthest number can be reckoned with, all can.
        scale.on_grid(scale.last).map(|_| scale).ok_or_else(too_fine)
    }
    /// The same ends and resolution on coarser grids, the finest first: for a key that takes only values of a grid of its
    /// own, such as multiples of 125 us or of 1/12 us. Nothing where a step was asked for.
    pub fn coarser(&self) -> impl Iterator<Item = Self> {
        /// Of every power of ten; 125 us is T_BASE_DP and T_BASE_IO of most devices.
        const PARTS: [&str; 5] = ["1", "1.25", "2", "2.5", "5"];
        /// The unit of times in Set_Prm (manual 3.3).
        const ISO: &str = "1000 tick";
        let powers = (-9..=9).map(|power: i32| match power {
            0.. => (1_000_000_000_i128 / 10_i128.pow(9 - power as u32), 1),
            _ => (1, 10_i128.pow(power.unsigned_abs())),
        });
        let of_ten = powers.flat_map(|(above, below)| {
            let unit = Measure::read(format!("1 {}", self.from.unit).trim());
            PARTS.into_iter().filter_map(move |part| {
                let (unit, part) = (unit?, Measure::read(part)?.steps());
                let (of, per) = unit.steps();
                unit.with_steps((
                    of.checked_mul(part.0)?.checked_mul(above)?,
                    per.checked_mul(part.1)?.checked_mul(below)?,
                ))
            })
        });
        let mut steps: Vec<_> = of_ten.chain(Measure::read(ISO)).filter(|step| step.is_like(self.from)).collect();
        let order = |a: &Measure, b: &Measure| a.compare(*b).unwrap_or(std::cmp::Ordering::Equal);
        steps.retain(|step| self.resolution > 0.0 && step.steps().1 == 1 && order(&self.step, step).is_lt());
        steps.sort_by(order);
        let (ends, resolution) = (self.ends(), self.resolution);
        steps.into_iter().filter_map(move |step| Self::new(ends, step, resolution).ok()).filter(|scale| scale.last > 1)
    }
    /// Number of the last value, at least 1.
    pub const fn last(&self) -> i64 {
        self.last
    }
    /// Distance of neighbours on the grid.
    pub const fn step(&self) -> Measure {
        self.step
    }
    /// Distance of neighbours as a share of the larger magnitude; 0 with a step.
    pub const fn resolution(&self) -> f64 {
        self.resolution
    }
    /// Whether values grow from the beginning of the search to its end.
    pub fn grows(&self) -> bool {
        self.to.value_in(self.from) > self.from.value()
    }
    /// Both ends, each in its own unit.
    pub fn ends(&self) -> (Measure, Measure) {
        (self.from, self.to)
    }
    /// The unit of all values; may be empty.
    pub const fn unit(&self) -> &'static str {
        self.from.unit
    }
    /// The value of this number, from 0 to [`last`](Self::last).
    pub fn measure(&self, number: i64) -> Measure {
        let to = || self.from.with_steps(self.to.steps());
        let value = if number == self.last { to() } else { self.on_grid(number) };
        value.unwrap_or(self.to)
    }
    fn on_grid(&self, number: i64) -> Option<Measure> {
        let ((start, start_below), (step, step_below)) = (self.from.steps(), self.step.steps());
        let way = if self.grows() { i128::from(number) } else { -i128::from(number) };
        let above = start.checked_mul(step_below)?.checked_add(step.checked_mul(way)?.checked_mul(start_below)?)?;
        self.from.with_steps((above, start_below.checked_mul(step_below)?))
    }
    /// The value of this number as an override has it, with its unit.
    pub fn text(&self, number: i64) -> String {
        self.measure(number).to_string()
    }
    /// The value of this number in the unit of all.
    pub fn value(&self, number: i64) -> f64 {
        self.measure(number).value_in(self.from)
    }
    /// The number whose value is nearest to `value`, after the first.
    ///
    /// # Errors
    /// `value` does not lie between the ends.
    pub fn nearest(&self, value: Measure) -> Result<i64, Fault> {
        let (start, end) = (self.from.value(), self.to.value_in(self.from));
        let share = (value.value_in(self.from) - start) / (end - start);
        if !(self.from.is_like(value) && share > 0.0 && share <= 1.0) {
            let (from, to) = (self.from, self.to);
            return Err(Fault::new(format!("\"{value}\" does not lie between \"{from}\" and \"{to}\"")));
        }
        let steps = (value.value_in(self.from) - start).abs() / self.step.value_in(self.from);
        Ok((libm::round(steps) as i64).clamp(1, self.last))
    }
}

/// The largest 1, 2 or 5 times a power of ten that is at most `fine` in the unit of `like`; no finer than the smallest
/// step of its kind where values are `whole`.
fn round(fine: f64, like: Measure, whole: bool) -> Result<Measure, Fault> {
    /// Decimals of the finest.
    const DECIMALS: i32 = 15;
    let first = libm::floor(libm::log10(fine.max(1e-30))) as i32;
    for exponent in (-DECIMALS..=first).rev() {
        for digit in [5_u8, 2, 1] {
            let number = if exponent >= 0 {
                format!("{digit}{}", "0".repeat(exponent as usize))
            } else {
                format!("0.{}{digit}", "0".repeat(-exponent as usize - 1))
            };
            let step = Measure::read(format!("{number} {}", like.unit).trim());
            let fits = |step: &Measure| step.value() <= fine * (1.0 + 1e-9) && (!whole || step.steps().1 == 1);
            if let Some(step) = step.filter(fits) {
                // Written as the ends are.
                return like.with_steps(step.steps()).ok_or_else(too_fine);
            }
        }
    }
    if whole {
        like.with_steps((1, 1)).ok_or_else(too_fine)
    } else {
        measured(&format!("0.000000000000001 {}", like.unit))
    }
}

impl Axis for &Scale {
    type Value = i64;
    fn neighbours(&self, a: i64, b: i64) -> bool {
        let (x, y) = (self.value(a), self.value(b));
        a.abs_diff(b) <= 1 || (x - y).abs() <= self.resolution * x.abs().max(y.abs())
    }
    fn between(&self, a: i64, b: i64, part: u32, whole: u32) -> Option<i64> {
        let (x, y) = (self.value(a), self.value(b));
        let far = self.resolution > 0.0 && x * y > 0.0 && (x / y).max(y / x) > FAR;
        let number = if far {
            let value = x * libm::pow(y / x, f64::from(part) / f64::from(whole));
            let steps = (value - self.from.value()).abs() / self.step.value_in(self.from);
            libm::round(steps) as i64
        } else {
            a + ((i128::from(b) - i128::from(a)) * i128::from(part) / i128::from(whole)) as i64
        };
        (a.min(b) < number && number < a.max(b)).then_some(number)
    }
    fn doubled(&self, from: i64, value: i64, to: i64) -> i64 {
        (2 * value - from).min(to)
    }
}

#[cfg(test)]
mod tests {
    use core::convert::Infallible;

    use super::*;
    use crate::study::statistics::bisection::{Answer, Search};
    use crate::study::statistics::sequential::Tested;

    fn measure(text: &str) -> Measure {
        Measure::read(text).unwrap_or_else(|| panic!("{text}"))
    }
    fn stepped(from: &str, to: &str, step: &str) -> Result<Scale, Fault> {
        Scale::stepped(measure(from), measure(to), measure(step))
    }
    fn resolved(from: &str, to: &str, resolution: f64) -> Scale {
        Scale::resolved(measure(from), measure(to), resolution).unwrap_or_else(|fault| panic!("{}", fault.message))
    }
    fn texts(scale: &Scale) -> Vec<String> {
        (0..=scale.last()).map(|number| scale.text(number)).collect()
    }
    /// The last value that holds and the first that fails, and how many were tried.
    fn found(scale: &Scale, holds: impl Fn(f64) -> bool) -> (String, String, usize) {
        let search = Search::new(scale, 0, scale.last(), scale.last(), 0).unwrap();
        let found = search.run(|number| Ok::<_, Infallible>(Tested::once(holds(scale.value(number))))).unwrap();
        let Answer::Band { holds, fails } = found.answer else { panic!("{found:?}") };
        (scale.text(holds), scale.text(fails), found.curve.len())
    }

    #[test]
    fn steps_lead_from_one_end_to_the_other() {
        assert_eq!(texts(&stepped("1 ms", "0.4 ms", "200 us").unwrap()), ["1 ms", "0.8 ms", "0.6 ms", "0.4 ms"]);
        assert_eq!(texts(&stepped("0 ns", "1 us", "400 ns").unwrap()), ["0 ns", "400 ns", "800 ns", "1000 ns"]);
        assert_eq!(texts(&stepped("-1", "2", "2").unwrap()), ["-1", "1", "2"]);
        assert_eq!(texts(&stepped("0 ns", "1 ns", "4 tick").unwrap()), ["0 ns", "4 tick", "8 tick", "1 ns"]);
        assert_eq!(texts(&stepped("0.5 %", "0.7 %", "0.1 %").unwrap()), ["0.5 %", "0.6 %", "0.7 %"]);
    }

    #[test]
    fn a_resolution_makes_a_grid_of_round_steps() {
        for (from, to, resolution, step) in [
            ("100 ns", "2 us", 0.01, "1 ns"),
            ("0 ns", "2 us", 0.01, "2 ns"),
            ("10 ms", "1 ms", 0.01, "0.01 ms"),
            ("1 ns", "1 us", 0.01, "1 tick"),
            ("1", "14", 0.01, "1"),
            ("0.5", "14", 0.01, "0.005"),
            ("1 ppm", "500 ppm", 0.01, "0.01 ppm"),
            ("-50 ppm", "50 ppm", 0.01, "0.05 ppm"),
            ("0.1 %", "10 %", 0.02, "0.002 %"),
            ("1/4", "1/64", 0.01, "0.0001"),
            ("1e-12", "1e-9", 0.01, "1e-14"),
        ] {
            let scale = resolved(from, to, resolution);
            assert_eq!(scale.step().to_string(), measure(step).to_string(), "{from} {to}");
            assert_eq!(
                [scale.text(0), scale.text(scale.last())].map(|text| measure(&text).steps()),
                [from, to].map(|text| measure(text).steps())
            );
        }
    }

    #[test]
    fn a_limit_is_found_to_the_step_or_to_the_resolution() {
        let (holds, fails, tried) = found(&stepped("100 ns", "2 us", "1 ns").unwrap(), |ns| ns <= 463.0);
        assert_eq!((holds.as_str(), fails.as_str()), ("463 ns", "464 ns"));
        assert!(tried <= 13, "{tried}");
        let (holds, fails, tried) = found(&resolved("10 ms", "1 us", 0.01), |ms| ms >= 0.0123);
        let [holds, fails] = [holds, fails].map(|text| measure(&text).value_in(measure("1 ms")));
        assert!(
            holds >= 0.0123 && 0.0123 > fails && holds - fails <= 0.01 * holds && tried < 20,
            "{holds} {fails} {tried}"
        );
        // Towards zero and beyond no relative distance is small enough: the grid ends it.
        let (holds, fails, _) = found(&resolved("-50 ppm", "50 ppm", 0.01), |ppm| ppm <= 0.0);
        assert_eq!((holds.as_str(), fails.as_str()), ("0 ppm", "0.05 ppm"));
    }

    #[test]
    fn coarser_grids_have_the_steps_that_keys_ask_for() {
        let steps =
            |from, to| resolved(from, to, 0.01).coarser().map(|scale| scale.step().to_string()).collect::<Vec<_>>();
        assert_eq!(
            steps("2 ms", "0.5 ms"),
            [
                "0.01 ms",
                "0.0125 ms",
                "0.02 ms",
                "0.025 ms",
                "0.05 ms",
                "0.1 ms",
                "0.125 ms",
                "0.2 ms",
                "0.25 ms",
                "0.5 ms",
                "1 ms",
                "1.25 ms"
            ]
        );
        assert!(steps("1 us", "2 us").contains(&"1000 tick".to_owned()));
        assert_eq!(steps("1", "9"), ["2", "5"]);
        assert_eq!(stepped("1 ms", "9 ms", "1 ms").unwrap().coarser().count(), 0);
    }

    #[test]
    fn whole_ends_without_a_unit_may_have_fractions_between_them() {
        let step = |from, to| resolved(from, to, 0.01).finer().map(|scale| scale.step().to_string());
        assert_eq!(step("0", "1").as_deref(), Some("0.001"));
        assert_eq!(step("1", "14").as_deref(), Some("0.01"));
        for (from, to) in [("0.5", "1"), ("1/4", "1"), ("0 ns", "1 us"), ("100", "10000")] {
            assert_eq!(step(from, to), None, "{from} {to}");
        }
        assert_eq!(stepped("0", "9", "1").unwrap().finer(), None);
    }

    #[test]
    fn numbers_near_a_value_lie_between_the_ends() {
        let scale = stepped("1 ms", "0 ms", "100 us").unwrap();
        assert_eq!(scale.nearest(measure("730 us")).unwrap(), 3);
        assert_eq!(scale.nearest(measure("0.999 ms")).unwrap(), 1);
        for text in ["1 ms", "2 ms", "-1 ms", "1 m"] {
            assert!(scale.nearest(measure(text)).is_err(), "{text}");
        }
    }

    #[test]
    fn what_is_no_scale_is_told() {
        let told = |from, to, step| stepped(from, to, step).unwrap_err().message;
        assert_eq!(told("1 ms", "2 m", "1 ms"), "\"1 ms\" and \"2 m\" are not of one kind");
        assert_eq!(told("1 ms", "1 ms", "1 ms"), "this range begins and ends with \"1 ms\"");
        assert_eq!(told("1 ms", "2 ms", "1 m"), "\"1 ms\" and the step \"1 m\" are not of one kind");
        assert_eq!(told("1 ms", "2 ms", "0 ms"), "a step of \"0 ms\" leads nowhere");
        assert!(told("0 h", "24 h", "1 tick").contains("steps of \"1 tick\""));
    }
}
