//! A station's crystal: the one place where true time becomes a station's reading and back.
//!
//! A crystal runs at `1 + ppb · 10⁻⁹` of true time. The rate is kept as a fraction of 2^62, the reading together with
//! its fraction of a tick, so a thousand changes of the rate lose nothing. "Exact" below means exact for this stored
//! rate; it differs from the rate asked for by at most 2^-63, which moves a reading by less than one tick in 24 years.

use crate::time::{Local, Time};

/// Bits of the fraction in a rate and in a reading.
const FRACTION: u32 = 62;
/// Mask of the fraction.
const FRACTION_MASK: i128 = (1 << FRACTION) - 1;
/// One billion: the denominator of parts per billion.
const BILLION: i128 = 1_000_000_000;

/// Why a crystal cannot be built or changed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum CrystalError {
    /// The offset, in ppb, lies outside of ±[`Crystal::MAX_PPB`].
    #[error("a crystal offset of {0} ppb is outside of ±{max} ppb", max = Crystal::MAX_PPB)]
    Offset(i64),
}

/// A station's own clock as a function of true time: straight, with a slope that may change at given instants.
///
/// Both directions are monotone. Results outside of the range of 24 years saturate at its end.
#[derive(Clone, Debug)]
pub struct Crystal {
    /// True time at which the present rate began.
    since: Time,
    /// Reading at `since`, rounded down.
    reading: Local,
    /// What the rounding cut off [2^-62 tick], 0..2^62.
    fraction: i64,
    /// Local ticks in one true tick [2^-62].
    rate: i64,
    /// True ticks in one local tick [2^-62], rounded down.
    inverse: i64,
    /// How fast it is [parts per billion].
    ppb: i64,
}

impl Crystal {
    /// Largest offset of a crystal [parts per billion], 1000 ppm. Model: ten times what a poor oscillator shows.
    pub const MAX_PPB: i64 = 1_000_000;

    /// A crystal `ppb` [parts per billion] fast that shows `start` at true time zero.
    ///
    /// # Errors
    /// [`CrystalError::Offset`] if `ppb` is outside of ±[`Self::MAX_PPB`].
    pub fn new(ppb: i64, start: Local) -> Result<Self, CrystalError> {
        let (rate, inverse) = rates(ppb)?;
        Ok(Self { since: Time::ZERO, reading: start, fraction: 0, rate, inverse, ppb })
    }

    /// Goes on at `ppb` [parts per billion] from `at`, without a step in the reading.
    ///
    /// Instants before `at` are converted with the new rate from now on, and what [`Self::to_true`] said about
    /// readings after `at` no longer holds: deadlines that are armed must be converted again.
    ///
    /// # Errors
    /// [`CrystalError::Offset`] if `ppb` is outside of ±[`Self::MAX_PPB`]; the crystal is unchanged.
    ///
    /// # Panics
    /// If `at` is before the last change.
    pub fn set_rate(&mut self, at: Time, ppb: i64) -> Result<(), CrystalError> {
        assert!(at >= self.since, "crystal changed at {at:?}, before its last change at {:?}", self.since);
        let (rate, inverse) = rates(ppb)?;
        let exact = self.elapsed(at);
        self.reading = self.after(exact >> FRACTION);
        self.fraction = (exact & FRACTION_MASK) as i64;
        (self.since, self.rate, self.inverse, self.ppb) = (at, rate, inverse, ppb);
        Ok(())
    }

    /// How fast it is now [parts per billion].
    pub const fn ppb(&self) -> i64 {
        self.ppb
    }

    /// What the crystal shows at `time`: the exact value rounded down.
    #[inline]
    pub fn to_local(&self, time: Time) -> Local {
        let Some(span) = near(time.ticks(), self.since.ticks()) else { return self.far_to_local(time) };
        let ticks = (wide(span, self.rate) + i128::from(self.fraction)) >> FRACTION;
        self.reading.ticks().checked_add(ticks as i64).map_or_else(|| self.far_to_local(time), Local::from_ticks)
    }

    /// The first instant at which the crystal shows `local` or more, so that a deadline never comes early.
    ///
    /// `to_local(to_true(l)) >= l` and `to_local(to_true(l) - 1 tick) < l` unless the result saturates.
    #[inline]
    pub fn to_true(&self, local: Local) -> Time {
        let Some(ticks) = near(local.ticks(), self.reading.ticks()) else { return self.far_to_true(local) };
        // Half a tick is what the inverse, too small by less than 2^-62, makes of 2^61 ticks, one is what is rounded down,
        // and a thousandth more than one is what the fraction is worth: the estimate is off by less than 1.51 ticks.
        let mut span = (wide(ticks, self.inverse) >> FRACTION) as i64;
        // What it leaves of the way [2^-62 local tick] is therefore known by its lower 64 bits.
        let mut left = (ticks << FRACTION).wrapping_sub(self.fraction).wrapping_sub(span.wrapping_mul(self.rate));
        while left > 0 {
            (span, left) = (span + 1, left - self.rate);
        }
        if left <= -self.rate {
            span -= 1;
        }
        self.since.ticks().checked_add(span).map_or_else(|| self.far_to_true(local), Time::from_ticks)
    }

    /// An instant that is no later than [`to_true`](Self::to_true) of `local`, and at most 3 ticks before it, for less than
    /// what that takes.
    #[inline]
    pub fn not_before(&self, local: Local) -> Time {
        let Some(ticks) = near(local.ticks(), self.reading.ticks()) else { return self.far_to_true(local) };
        // By so much the estimate of `to_true` may be too late: the fraction is worth one tick and a thousandth.
        let span = (wide(ticks, self.inverse) >> FRACTION) as i64 - 1;
        self.since.ticks().checked_add(span).map_or_else(|| self.far_to_true(local), Time::from_ticks)
    }

    /// [`to_local`](Self::to_local) wherever in the range.
    #[cold]
    fn far_to_local(&self, time: Time) -> Local {
        self.after(self.elapsed(time) >> FRACTION)
    }
    /// [`to_true`](Self::to_true) wherever in the range.
    #[cold]
    fn far_to_true(&self, local: Local) -> Time {
        let ticks = i128::from(local.ticks()) - i128::from(self.reading.ticks());
        let goal = (ticks << FRACTION) - i128::from(self.fraction);
        let rate = i128::from(self.rate);
        // Off by four ticks at the end of the range.
        let mut span = (ticks * i128::from(self.inverse)) >> FRACTION;
        while span * rate < goal {
            span += 1;
        }
        while (span - 1) * rate >= goal {
            span -= 1;
        }
        Time::from_ticks(saturate(i128::from(self.since.ticks()) + span))
    }

    /// Local ticks that pass from the last change until `time`, with the fraction of the reading [2^-62 tick].
    fn elapsed(&self, time: Time) -> i128 {
        let span = i128::from(time.ticks()) - i128::from(self.since.ticks());
        span * i128::from(self.rate) + i128::from(self.fraction)
    }

    /// The reading `ticks` after the last change.
    fn after(&self, ticks: i128) -> Local {
        Local::from_ticks(saturate(i128::from(self.reading.ticks()) + ticks))
    }
}

/// Rate and inverse rate [2^-62] of a crystal that is `ppb` fast.
fn rates(ppb: i64) -> Result<(i64, i64), CrystalError> {
    if !(-Crystal::MAX_PPB..=Crystal::MAX_PPB).contains(&ppb) {
        return Err(CrystalError::Offset(ppb));
    }
    let rate = ((BILLION + i128::from(ppb)) << FRACTION) + BILLION / 2;
    let rate = rate / BILLION;
    Ok((rate as i64, ((1 << (2 * FRACTION)) / rate) as i64))
}

/// How far `to` is from `from`, if no farther than 2^61 ticks: the product with a rate then has at most 125 bits.
#[inline]
const fn near(to: i64, from: i64) -> Option<i64> {
    const NEAR: i64 = 1 << 61;
    match to.checked_sub(from) {
        Some(ticks) if -NEAR <= ticks && ticks < NEAR => Some(ticks),
        _ => None,
    }
}

/// The product of two numbers, exact.
#[inline]
const fn wide(a: i64, b: i64) -> i128 {
    a as i128 * b as i128
}

/// The nearest value in the range of 24 years.
fn saturate(ticks: i128) -> i64 {
    ticks.clamp(i128::from(i64::MIN), i128::from(i64::MAX)) as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Span;
    use proptest::prelude::*;

    /// Twenty-three years [ticks]: inside of the range at every rate.
    const RANGE: i64 = i64::MAX / 24 * 23;

    fn crystal(ppb: i64) -> Crystal {
        Crystal::new(ppb, Local::ZERO).unwrap()
    }
    fn tick(n: i64) -> Span {
        Span::from_ticks(n)
    }
    fn check_inverse(crystal: &Crystal, local: Local) {
        let time = crystal.to_true(local);
        assert!(crystal.to_local(time) >= local, "{crystal:?} {local:?}");
        assert!(crystal.to_local(time - tick(1)) < local, "{crystal:?} {local:?}");
    }

    #[test]
    fn offsets_beyond_a_thousand_ppm_are_refused() {
        for ppb in [1_000_001, -1_000_001, i64::MIN, i64::MAX] {
            assert_eq!(Crystal::new(ppb, Local::ZERO).unwrap_err(), CrystalError::Offset(ppb));
        }
        let mut crystal = crystal(1_000_000);
        assert!(crystal.set_rate(Time::ZERO, 1_000_001).is_err());
        assert_eq!(
            CrystalError::Offset(2_000_000).to_string(),
            "a crystal offset of 2000000 ppb is outside of ±1000000 ppb"
        );
    }

    #[test]
    #[should_panic(expected = "before its last change")]
    fn a_rate_cannot_change_in_the_past() {
        let mut crystal = crystal(5);
        crystal.set_rate(Time::from_ticks(10), 6).unwrap();
        let _ = crystal.set_rate(Time::from_ticks(9), 7);
    }

    #[test]
    fn a_perfect_crystal_adds_its_start_and_nothing_else() {
        let crystal = Crystal::new(0, Local::from_ticks(777)).unwrap();
        for ticks in [i64::MIN + 1_000, -1, 0, 1, 12_345, i64::MAX - 777] {
            assert_eq!(crystal.to_local(Time::from_ticks(ticks)), Local::from_ticks(ticks + 777));
            assert_eq!(crystal.to_true(Local::from_ticks(ticks + 777)), Time::from_ticks(ticks));
        }
    }

    #[test]
    fn the_drift_after_a_thousand_seconds_is_the_offset() {
        let t = Time::ZERO + Span::from_s(1_000);
        for ppb in [-1_000_000, -100_000, -7, -1, 0, 1, 3, 50_000, 1_000_000] {
            // 1000 s · 1 ppb = 1 µs = 12 000 ticks; the reading is rounded down.
            let drift = crystal(ppb).to_local(t).ticks() - t.ticks();
            assert!(drift == ppb * 12_000 || drift == ppb * 12_000 - 1, "{ppb}: {drift}");
        }
    }

    #[test]
    fn a_hundred_thousand_changes_lose_nothing() {
        let mut wandering = crystal(333);
        for k in 1..=100_000 {
            wandering.set_rate(Time::from_ticks(k * 12_000_007), 333).unwrap();
        }
        let t = Time::from_ticks(200_000 * 12_000_007);
        assert_eq!(wandering.to_local(t), crystal(333).to_local(t));
    }

    #[test]
    fn the_ends_of_the_range_saturate() {
        let (slow, fast) = (crystal(-1_000_000), crystal(1_000_000));
        assert_eq!(slow.to_true(Local::MAX), Time::MAX);
        assert_eq!(fast.to_local(Time::MAX), Local::MAX);
        assert_eq!(fast.to_local(Time::from_ticks(i64::MIN)), Local::from_ticks(i64::MIN));
        let ahead = Crystal::new(-1_000_000, Local::MAX).unwrap();
        assert_eq!(ahead.to_true(Local::from_ticks(i64::MIN)), Time::from_ticks(i64::MIN));
        let behind = Crystal::new(1_000_000, Local::from_ticks(i64::MIN)).unwrap();
        assert_eq!(behind.to_true(Local::MAX), Time::MAX);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2_000))]

        #[test]
        fn readings_follow_the_rate(ppb in -1_000_000i64..=1_000_000, t in 0..RANGE) {
            // Split so that the product with 10^9 + ppb stays exact; the stored rate may move it by one tick.
            let exact = i128::from(t) * (BILLION + i128::from(ppb)) / BILLION;
            let local = i128::from(crystal(ppb).to_local(Time::from_ticks(t)).ticks());
            prop_assert!((local - exact).abs() <= 1);
        }

        #[test]
        fn the_inverse_is_the_first_instant(
            ppb in -1_000_000i64..=1_000_000, start in -RANGE / 24..RANGE / 24, local in -RANGE..RANGE, near in 0i64..1_000_000,
        ) {
            let crystal = Crystal::new(ppb, Local::from_ticks(start)).unwrap();
            for ticks in [local / 23 * 22, start + near, start - near, start] {
                check_inverse(&crystal, Local::from_ticks(ticks));
            }
        }

        #[test]
        fn near_and_far_are_converted_alike(
            ppb in -1_000_000i64..=1_000_000, start in any::<i64>(), fraction in 0..1i64 << FRACTION, since in any::<i64>(),
            far in any::<i64>(), near in -1_000_000_000_000i64..1_000_000_000_000,
        ) {
            let (since, reading) = (Time::from_ticks(since), Local::from_ticks(start));
            let all = Crystal { since, reading, fraction, ..crystal(ppb) };
            let long = Crystal { since: Time::from_ticks(near), reading: Local::from_ticks(-near), ..all.clone() };
            for (crystal, ticks) in [(&all, far), (&all, start.saturating_add(near)), (&long, far), (&long, far >> 2), (&long, far >> 3)] {
                let (time, local) = (Time::from_ticks(ticks), Local::from_ticks(ticks));
                prop_assert_eq!(crystal.to_local(time), crystal.far_to_local(time));
                prop_assert_eq!(crystal.to_true(local), crystal.far_to_true(local));
                let early = i128::from(crystal.to_true(local).ticks()) - i128::from(crystal.not_before(local).ticks());
                prop_assert!((0..=3).contains(&early), "{early}");
            }
        }

        #[test]
        fn both_directions_are_monotone(ppb in -1_000_000i64..=1_000_000, a in -RANGE..RANGE, step in 0i64..5) {
            let c = crystal(ppb);
            prop_assert!(c.to_local(Time::from_ticks(a + step)) >= c.to_local(Time::from_ticks(a)));
            prop_assert!(c.to_true(Local::from_ticks(a + step)) >= c.to_true(Local::from_ticks(a)));
        }

        #[test]
        fn a_change_of_rate_is_no_step(
            changes in prop::collection::vec((1i64..10_000_000_000_000, -1_000_000i64..=1_000_000), 1..20),
            start in 0i64..1_000_000_000, near in 0i64..100_000,
        ) {
            let mut crystal = Crystal::new(0, Local::from_ticks(start)).unwrap();
            let mut at = Time::ZERO;
            for (span, ppb) in changes {
                at += tick(span);
                let (before, shown) = (crystal.to_local(at - tick(1)), crystal.to_local(at));
                crystal.set_rate(at, ppb).unwrap();
                prop_assert_eq!(crystal.to_local(at), shown);
                prop_assert!(before <= shown && shown <= crystal.to_local(at + tick(1)));
                // An armed reading keeps its order against the change, whatever the new rate.
                prop_assert!(crystal.to_true(shown) <= at && crystal.to_true(shown + tick(1)) > at);
                check_inverse(&crystal, shown + tick(near));
            }
        }
    }
}
