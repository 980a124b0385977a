//! Moving shafts: where an encoder's shaft stands at an instant of true time, and what the disc under it reads.
//!
//! An angle is an integer of 2^-32 revolution. A [`Motion`] says how a shaft moves; a [`Shaft`] is the same with
//! everything checked and divided in advance, so that asking it costs a multiplication (or one sine). No motion
//! accumulates anything: the angle after 24 years is as good as the first.

use crate::time::{Span, Time};
use core::f64::consts::TAU;
use core::fmt;

/// The angle of a shaft [2^-32 revolution]. The whole part counts revolutions and may be negative.
///
/// The range is ±2^31 revolutions, 248 days at 6 000 rpm; beyond it the count goes round. Encoders whose number of
/// revolutions is a power of two do not see that.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Angle(i64);

impl Angle {
    /// The shaft's zero.
    pub const ZERO: Self = Self(0);
    /// Units in one revolution.
    pub const UNITS_PER_REV: i64 = 1 << 32;

    /// An angle of `units` [2^-32 revolution].
    pub const fn from_units(units: i64) -> Self {
        Self(units)
    }
    /// An angle of whole revolutions.
    pub const fn from_revs(revs: i32) -> Self {
        Self((revs as i64) << 32)
    }
    /// The angle [2^-32 revolution].
    pub const fn units(self) -> i64 {
        self.0
    }
    /// The angle in revolutions, for display and statistics.
    pub fn as_revs(self) -> f64 {
        self.0 as f64 / Self::UNITS_PER_REV as f64
    }
    /// The sum, going round at the end of the range.
    const fn turned(self, units: i64) -> Self {
        Self(self.0.wrapping_add(units))
    }
}
impl fmt::Debug for Angle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} rev", self.as_revs())
    }
}

/// How a shaft moves.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Motion {
    /// It does not.
    Standstill {
        /// Where it stands.
        at: Angle,
    },
    /// At constant speed.
    Speed {
        /// Where it stands at time zero.
        start: Angle,
        /// Speed [10^-6 rpm], negative backwards, at most ±[`Motion::MAX_MICRO_RPM`].
        micro_rpm: i64,
    },
    /// To and fro: `centre` + `amplitude` · sin(time / `period` + `phase`).
    Sine {
        /// The middle of the movement.
        centre: Angle,
        /// Largest deflection, at most ±2^20 revolutions.
        amplitude: Angle,
        /// Time from one middle to the next in the same direction.
        period: Span,
        /// Where in the period the movement is at time zero; one revolution is one period.
        phase: Angle,
    },
    /// Through given points in straight lines; the first and the last point hold before and after.
    Table {
        /// Instants, strictly increasing, and angles.
        points: Vec<(Time, Angle)>,
    },
}

impl Motion {
    /// The fastest shaft [10^-6 rpm], 100 000 rpm. Model: eight times what an encoder's bearings allow.
    pub const MAX_MICRO_RPM: i64 = 100_000_000_000;
    /// Largest deflection of a sine: beyond it a `f64` has no longer a bit for each unit.
    pub const MAX_AMPLITUDE: Angle = Angle::from_revs(1 << 20);
}

/// Why a motion or a resolution cannot be.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum MotionError {
    /// The shaft turns faster than [`Motion::MAX_MICRO_RPM`].
    #[error("the shaft turns faster than {} rpm", Motion::MAX_MICRO_RPM / 1_000_000)]
    TooFast,
    /// The deflection of a sine is beyond [`Motion::MAX_AMPLITUDE`].
    #[error("the amplitude {0:?} is beyond {max:?}", max = Motion::MAX_AMPLITUDE)]
    Amplitude(Angle),
    /// The period of a sine is zero or negative.
    #[error("the period {0} is not positive")]
    Period(Span),
    /// A table has no points.
    #[error("the table has no points")]
    NoPoints,
    /// A point of a table is not later than the one before.
    #[error("point {0} of the table, counted from 0, is not later than the point before")]
    Order(usize),
    /// A resolution has no steps, no revolutions, or more than 2^32 positions.
    #[error("{steps_per_rev} steps · {revolutions} revolutions is not between 1 and 2^32 positions")]
    Resolution {
        /// Steps in a revolution.
        steps_per_rev: u32,
        /// Revolutions that are told apart.
        revolutions: u32,
    },
}

/// A shaft that moves as a [`Motion`] says.
#[derive(Clone, Debug)]
pub struct Shaft {
    course: Course,
}

/// A motion, prepared.
#[derive(Clone, Debug)]
enum Course {
    Standstill(Angle),
    /// `rate` in 2^-64 unit per tick.
    Speed {
        start: Angle,
        rate: i128,
        revs_per_s: f64,
    },
    /// `step` in 2^-128 period per tick, `phase` in 2^-64 period, `swing` in units, `peak` in revolutions per second.
    Sine {
        centre: Angle,
        swing: f64,
        peak: f64,
        step: u128,
        phase: u64,
    },
    Table(Vec<Knot>),
}

/// A point of a table, with the slope from here to the next [2^-62 unit per tick], 0 at the last.
#[derive(Clone, Copy, Debug)]
struct Knot {
    time: Time,
    angle: Angle,
    slope: i128,
}

/// Ticks in a second.
const TICKS_PER_S: i64 = Span::from_s(1).ticks();
/// Bits of the fraction in the slope of a table.
const SLOPE_FRACTION: u32 = 62;

impl Shaft {
    /// Checks and prepares `motion`.
    ///
    /// # Errors
    /// A speed, amplitude, period or table outside of what [`Motion`] allows.
    pub fn new(motion: &Motion) -> Result<Self, MotionError> {
        let course = match motion {
            Motion::Standstill { at } => Course::Standstill(*at),
            Motion::Speed { start, micro_rpm } => speed(*start, *micro_rpm)?,
            Motion::Sine { centre, amplitude, period, phase } => sine(*centre, *amplitude, *period, *phase)?,
            Motion::Table { points } => Course::Table(knots(points)?),
        };
        Ok(Self { course })
    }

    /// Where the shaft stands at `time`, to the nearest unit.
    ///
    /// Before it is rounded, constant speed is off by at most a quarter of a unit after 24 years, a table by less than
    /// half a unit between points up to 6 years apart and not at all at its points: where the exact angle is a whole
    /// number of units, this is it. A sine is as good as 53 bits are.
    pub fn angle(&self, time: Time) -> Angle {
        match &self.course {
            Course::Standstill(at) => *at,
            // Bits 64..128 of the product are the whole units; what is cut off above is whole rounds of the range.
            Course::Speed { start, rate, .. } => {
                let product = rate.wrapping_mul(i128::from(time.ticks()));
                start.turned((product.wrapping_add(1 << 63) >> 64) as i64)
            }
            Course::Sine { centre, swing, step, phase, .. } => {
                centre.turned(libm::round(swing * libm::sin(argument(*step, *phase, time))) as i64)
            }
            Course::Table(knots) => match last_before(knots, time) {
                Some(knot) => {
                    let span = i128::from(time.ticks()) - i128::from(knot.time.ticks());
                    knot.angle.turned(((knot.slope * span + (1 << (SLOPE_FRACTION - 1))) >> SLOPE_FRACTION) as i64)
                }
                None => knots[0].angle,
            },
        }
    }

    /// The same movement, turned so that the shaft stands at `angle` at `time`.
    #[must_use]
    pub fn through(mut self, time: Time, angle: Angle) -> Self {
        let by = angle.0.wrapping_sub(self.angle(time).0);
        match &mut self.course {
            Course::Standstill(at) => *at = at.turned(by),
            Course::Speed { start, .. } => *start = start.turned(by),
            Course::Sine { centre, .. } => *centre = centre.turned(by),
            Course::Table(knots) => knots.iter_mut().for_each(|knot| knot.angle = knot.angle.turned(by)),
        }
        self
    }

    /// How fast the shaft turns at `time` [revolutions per second], negative backwards; at a point of a table, the
    /// speed after it.
    pub fn speed(&self, time: Time) -> f64 {
        match &self.course {
            Course::Standstill(_) => 0.0,
            Course::Speed { revs_per_s, .. } => *revs_per_s,
            Course::Sine { peak, step, phase, .. } => peak * libm::cos(argument(*step, *phase, time)),
            Course::Table(knots) => {
                let slope = last_before(knots, time).map_or(0, |knot| knot.slope);
                slope as f64 / (1u64 << SLOPE_FRACTION) as f64 * TICKS_PER_S as f64 / Angle::UNITS_PER_REV as f64
            }
        }
    }
}

/// Prepares constant speed.
fn speed(start: Angle, micro_rpm: i64) -> Result<Course, MotionError> {
    /// Ticks in 10^6 minutes, over the 2^19 that are taken from the numerator too.
    const TICKS: i128 = (60_000_000 * TICKS_PER_S as i128) >> 19;
    if micro_rpm.unsigned_abs() > Motion::MAX_MICRO_RPM.unsigned_abs() {
        return Err(MotionError::TooFast);
    }
    // 2^32 units in a revolution and 64 bits of fraction make 2^96.
    let rate = ((i128::from(micro_rpm) << (96 - 19)) + TICKS / 2).div_euclid(TICKS);
    Ok(Course::Speed { start, rate, revs_per_s: micro_rpm as f64 / 60e6 })
}

/// Prepares a sine.
fn sine(centre: Angle, amplitude: Angle, period: Span, phase: Angle) -> Result<Course, MotionError> {
    if amplitude.0.unsigned_abs() > Motion::MAX_AMPLITUDE.0.unsigned_abs() {
        return Err(MotionError::Amplitude(amplitude));
    }
    if period <= Span::ZERO {
        return Err(MotionError::Period(period));
    }
    let peak = TAU * amplitude.as_revs() / period.as_s();
    if peak.abs() * 60e6 > Motion::MAX_MICRO_RPM as f64 {
        return Err(MotionError::TooFast);
    }
    // Less than 2^-128 period too small per tick: 2^-65 period after 24 years.
    let step = u128::MAX / period.ticks() as u128;
    Ok(Course::Sine { centre, swing: amplitude.0 as f64, peak, step, phase: (phase.0 as u64) << 32 })
}

/// Argument of the sine [radian], in ±π. Whole periods fall off as integers, so a late instant is as sharp as an early one.
fn argument(step: u128, phase: u64, time: Time) -> f64 {
    /// Radians in 2^-64 period.
    const RADIANS: f64 = TAU / (1u128 << 64) as f64;
    let periods = (step.wrapping_mul(time.ticks() as u128) >> 64) as u64;
    periods.wrapping_add(phase) as i64 as f64 * RADIANS
}

/// Prepares a table.
fn knots(points: &[(Time, Angle)]) -> Result<Vec<Knot>, MotionError> {
    if points.is_empty() {
        return Err(MotionError::NoPoints);
    }
    let slope = |(i, pair): (usize, &[(Time, Angle)])| {
        let ticks = i128::from(pair[1].0.ticks()) - i128::from(pair[0].0.ticks());
        let units = i128::from(pair[1].1.0) - i128::from(pair[0].1.0);
        if ticks <= 0 {
            return Err(MotionError::Order(i + 1));
        }
        // units / 2^32 revolutions in ticks / (60 · TICKS_PER_S) minutes.
        let limit = i128::from(Motion::MAX_MICRO_RPM / 1_000_000) << 32;
        if units.abs() * i128::from(60 * TICKS_PER_S) > limit * ticks {
            return Err(MotionError::TooFast);
        }
        Ok((units << SLOPE_FRACTION).div_euclid(ticks))
    };
    let slopes = points.windows(2).enumerate().map(slope).chain([Ok(0)]);
    points.iter().zip(slopes).map(|(&(time, angle), slope)| Ok(Knot { time, angle, slope: slope? })).collect()
}

/// The last point of a table not after `time`, if there is one.
fn last_before(knots: &[Knot], time: Time) -> Option<&Knot> {
    knots[..knots.partition_point(|knot| knot.time <= time)].last()
}

/// What a disc tells apart: steps in a revolution and revolutions.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Resolution {
    steps_per_rev: u32,
    revolutions: u32,
}

impl Resolution {
    /// A disc of `steps_per_rev` steps under a gear that counts `revolutions`, 1 for a single-turn encoder.
    ///
    /// # Errors
    /// [`MotionError::Resolution`] if either is 0 or the positions do not fit into 32 bits.
    pub const fn new(steps_per_rev: u32, revolutions: u32) -> Result<Self, MotionError> {
        let positions = steps_per_rev as u64 * revolutions as u64;
        if positions == 0 || positions > 1 << 32 {
            return Err(MotionError::Resolution { steps_per_rev, revolutions });
        }
        Ok(Self { steps_per_rev, revolutions })
    }
    /// Steps in a revolution.
    pub const fn steps_per_rev(self) -> u32 {
        self.steps_per_rev
    }
    /// Revolutions that are told apart.
    pub const fn revolutions(self) -> u32 {
        self.revolutions
    }
    /// The raw position: `angle` in steps, rounded down, modulo all positions. Model: D21, the first stage.
    pub const fn raw(self, angle: Angle) -> u32 {
        let revs = (angle.0 >> 32).rem_euclid(self.revolutions as i64) as u64;
        let within = (angle.0 as u32 as u64 * self.steps_per_rev as u64) >> 32;
        (revs * self.steps_per_rev as u64 + within) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn shaft(motion: &Motion) -> Shaft {
        Shaft::new(motion).unwrap()
    }
    fn turning(micro_rpm: i64) -> Shaft {
        shaft(&Motion::Speed { start: Angle::ZERO, micro_rpm })
    }
    fn at(span: Span) -> Time {
        Time::ZERO + span
    }
    /// An angle in thousandths of a revolution.
    fn milli(revs: i64) -> Angle {
        Angle::from_units((revs << 32) / 1_000)
    }
    /// A slow sine: an amplitude of one revolution in eight seconds, centre 10.
    fn swing(phase: Angle) -> Motion {
        Motion::Sine { centre: Angle::from_revs(10), amplitude: Angle::from_revs(1), period: Span::from_s(8), phase }
    }

    /// The angle at constant speed, exact and rounded down, going round at the end of the range.
    fn exact(micro_rpm: i64, time: Time) -> i64 {
        let ticks_per_micro_rpm = i128::from(60_000_000 * TICKS_PER_S);
        let product = i128::from(micro_rpm) * i128::from(time.ticks());
        let rest = (product.rem_euclid(ticks_per_micro_rpm) << 32) / ticks_per_micro_rpm;
        ((product.div_euclid(ticks_per_micro_rpm) << 32) + rest) as i64
    }

    #[test]
    fn a_shaft_at_constant_speed_is_where_the_product_says() {
        for (rpm, s, revs) in [(60, 1, 1), (-60, 1, -1), (6_000, 86_400, 8_640_000), (-1, 60, -1), (7, -180, -21)] {
            assert_eq!(turning(rpm * 1_000_000).angle(at(Span::from_s(s))), Angle::from_revs(revs));
        }
        assert!((turning(-90_000_000).speed(at(Span::from_s(5))) + 1.5).abs() < f64::EPSILON);
        assert_eq!(turning(0).angle(Time::MAX), Angle::ZERO);
    }

    #[test]
    fn twenty_four_years_at_full_speed_go_round_and_lose_nothing() {
        for micro_rpm in [Motion::MAX_MICRO_RPM, -Motion::MAX_MICRO_RPM, 1, 61_728_394_506] {
            for ticks in [i64::MAX, i64::MIN, i64::MAX / 7 * 5] {
                let time = Time::from_ticks(ticks);
                let off = turning(micro_rpm).angle(time).units().wrapping_sub(exact(micro_rpm, time));
                assert!(off == 0 || off == 1, "{micro_rpm} {ticks}: {off}");
            }
        }
    }

    #[test]
    fn a_sine_has_its_quarters_and_its_speed() {
        let rises = shaft(&swing(Angle::ZERO));
        let leads = shaft(&swing(milli(250)));
        for (s, milli_revs) in [(0, 10_000), (2, 11_000), (4, 10_000), (6, 9_000), (8, 10_000), (700_000_002, 11_000)] {
            let off = rises.angle(at(Span::from_s(s))).units() - milli(milli_revs).units();
            assert!(off.abs() <= 1, "{s} s: {off}");
            let off = leads.angle(at(Span::from_s(s - 2))).units() - milli(milli_revs).units();
            assert!(off.abs() <= 1, "{s} s, phase: {off}");
        }
        let peak = TAU / 8.0;
        assert!((rises.speed(Time::ZERO) - peak).abs() < 1e-12);
        assert!((rises.speed(at(Span::from_s(4))) + peak).abs() < 1e-12);
        assert!(rises.speed(at(Span::from_s(2))).abs() < 1e-12);
    }

    #[test]
    fn a_sine_never_changes_from_release_to_release() {
        let shaft = shaft(&Motion::Sine {
            centre: Angle::ZERO,
            amplitude: Angle::from_revs(1_000),
            period: Span::from_ms(54_321),
            phase: milli(111),
        });
        let units = [1, 7, 1_000, 123_456_789].map(|s| shaft.angle(at(Span::from_s(s))).units());
        assert_eq!(units, [3_119_958_773_628, 4_286_259_471_105, -540_623_972_343, -3_529_117_873_294]);
    }

    #[test]
    fn a_table_is_exact_at_its_points_straight_between_and_held_outside() {
        let points = vec![
            (Time::from_ticks(-7), milli(500)),
            (at(Span::from_s(1)), Angle::from_revs(3)),
            (at(Span::from_s(3)), Angle::from_revs(-1)),
            (at(Span::from_s(4)), Angle::from_revs(-1)),
        ];
        let shaft = shaft(&Motion::Table { points: points.clone() });
        for &(time, angle) in &points {
            assert_eq!(shaft.angle(time), angle);
        }
        assert_eq!(shaft.angle(Time::from_ticks(i64::MIN)), milli(500));
        assert_eq!(shaft.angle(Time::MAX), Angle::from_revs(-1));
        assert_eq!(shaft.angle(at(Span::from_ms(1_500))), Angle::from_revs(2));
        assert!((shaft.speed(at(Span::from_s(1))) + 2.0).abs() < 1e-12);
        assert!(shaft.speed(Time::from_ticks(-8)).abs() + shaft.speed(Time::MAX).abs() < 1e-12);
        let single = Motion::Table { points: vec![points[1]] };
        assert_eq!(Shaft::new(&single).unwrap().angle(Time::ZERO), Angle::from_revs(3));
    }

    #[test]
    fn impossible_motions_are_refused() {
        let refused = |motion: Motion| Shaft::new(&motion).unwrap_err();
        let sine = |amplitude, period| Motion::Sine { centre: Angle::ZERO, amplitude, period, phase: Angle::ZERO };
        let table = |points: &[(i64, i32)]| Motion::Table {
            points: points.iter().map(|&(t, revs)| (Time::from_ticks(t), Angle::from_revs(revs))).collect(),
        };
        let turn = Angle::from_revs(1);
        for micro_rpm in [Motion::MAX_MICRO_RPM + 1, i64::MIN] {
            assert_eq!(refused(Motion::Speed { start: turn, micro_rpm }), MotionError::TooFast);
        }
        assert_eq!(refused(sine(turn, Span::ZERO)), MotionError::Period(Span::ZERO));
        assert_eq!(refused(sine(turn, Span::from_us(1))), MotionError::TooFast);
        let wide = Angle::from_revs(1 << 21);
        assert_eq!(refused(sine(wide, Span::from_s(9))), MotionError::Amplitude(wide));
        assert_eq!(refused(table(&[])), MotionError::NoPoints);
        assert_eq!(refused(table(&[(0, 0), (10, 0), (10, 0)])), MotionError::Order(2));
        assert_eq!(refused(table(&[(0, 0), (1_000_000, 1)])), MotionError::TooFast);
        assert_eq!(refused(table(&[(i64::MIN, i32::MIN), (i64::MAX, i32::MAX), (0, 0)])), MotionError::Order(2));
        assert_eq!(MotionError::TooFast.to_string(), "the shaft turns faster than 100000 rpm");
    }

    #[test]
    fn the_raw_position_wraps_in_both_directions() {
        let disc = Resolution::new(4_096, 4_096).unwrap();
        let last = 4_096 * 4_096 - 1;
        for (units, raw) in [
            (0, 0),
            (-1, last),
            ((1 << 20) - 1, 0),
            (1 << 20, 1),
            (-(1 << 20), last),
            (-(1 << 20) - 1, last - 1),
            ((4_096 << 32) - 1, last),
            (4_096 << 32, 0),
            (i64::MAX, last),
            (i64::MIN, 0),
        ] {
            assert_eq!(disc.raw(Angle::from_units(units)), raw, "{units}");
        }
        assert_eq!(Resolution::new(1 << 16, 1 << 16).unwrap().raw(Angle::from_units(-1)), u32::MAX);
        assert_eq!(Resolution::new(3_600, 1).unwrap().raw(milli(-250)), 2_700);
    }

    #[test]
    fn a_disc_needs_steps_and_room() {
        for (steps, revs) in [(0, 1), (1, 0), (1 << 31, 3), (u32::MAX, u32::MAX)] {
            assert!(Resolution::new(steps, revs).is_err());
        }
    }

    proptest! {
        #[test]
        fn the_raw_position_is_the_floor(steps in 1u32..=65_536, revolutions in 1u32..=65_536, units: i64) {
            let floor = (i128::from(units) * i128::from(steps)) >> 32;
            let raw = floor.rem_euclid(i128::from(steps) * i128::from(revolutions));
            prop_assert_eq!(i128::from(Resolution::new(steps, revolutions).unwrap().raw(Angle::from_units(units))), raw);
        }

        #[test]
        fn a_table_lies_on_its_lines(
            t0 in 0i64..1 << 61, span in 1i64..1 << 60, a0 in -1i64 << 40..1 << 40, rise in -500i64..500, share in 0f64..1.0,
        ) {
            let units = rise * (span % (1 << 50));
            let points = vec![(Time::from_ticks(t0), Angle(a0)), (Time::from_ticks(t0 + span), Angle(a0 + units))];
            let dt = (share * span as f64) as i64;
            let exact = i128::from(a0) + (i128::from(units) * i128::from(dt)).div_euclid(i128::from(span));
            let angle = shaft(&Motion::Table { points }).angle(Time::from_ticks(t0 + dt));
            prop_assert!((i128::from(angle.units()) - exact).abs() <= 1);
        }
    }
}
