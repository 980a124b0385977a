//! What goes wrong with crystals: they jump, wander and follow a temperature.
//!
//! | fault | during a burst | afterwards |
//! |---|---|---|
//! | Offset | so much faster or slower | as before |
//! | Wander | a random walk of equal steps in equal intervals, turned back at its bound | as before |
//! | Temperature | approaches a new offset, 1/e of the rest left after a time constant | returns the same way |
//!
//! What several disturbances make of one crystal adds up. A walk begins at nothing in every burst.

use crate::sim::crystal::Crystal;
use crate::sim::noise::{Purpose, Stream};
use crate::time::Span;
use crate::wire::Address;

/// What a disturbance does to crystals. All offsets are in parts per billion of the nominal frequency, positive is fast.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CrystalFault {
    /// It runs so much faster.
    Offset(i64),
    /// Its offset makes a step to either side, equally likely, in every interval.
    Wander {
        /// Size of a step, 0 ..= `bound`.
        step: i64,
        /// Time from step to step, above 0.
        interval: Span,
        /// Farthest offset: a step beyond it goes to the other side.
        bound: i64,
    },
    /// Its temperature is another one.
    Temperature {
        /// Offset after a long time.
        offset: i64,
        /// Time in which all but 1/e of the way is done, above 0.
        time_constant: Span,
        /// Time from one change of the rate to the next, above 0.
        interval: Span,
    },
}

impl CrystalFault {
    /// Largest offset that it makes (parts per billion).
    pub const fn bound(&self) -> i64 {
        match *self {
            Self::Offset(offset) | Self::Temperature { offset, .. } => offset.abs(),
            Self::Wander { bound, .. } => bound,
        }
    }
    /// Time from one change of the rate to the next; none where it changes at the ends of a burst alone.
    pub const fn interval(&self) -> Option<Span> {
        match *self {
            Self::Offset(_) => None,
            Self::Wander { interval, .. } | Self::Temperature { interval, .. } => Some(interval),
        }
    }
}

/// Bits of the fraction of a part per billion.
const FRACTION: u32 = 20;
/// Bits of the share of the way that one interval makes.
const SHARE: u32 = 32;

/// What a disturbance makes of one crystal.
#[derive(Clone, Debug)]
pub(crate) struct Pull {
    fault: CrystalFault,
    on: bool,
    /// The offset now (2^-20 parts per billion).
    offset: i64,
    /// Share of the way to the new temperature that one interval makes (2^-32).
    share: i64,
    stream: Stream,
}

impl Pull {
    /// The disturbance called `name` and one station.
    pub(crate) fn new(fault: CrystalFault, seed: u64, name: &str, station: Address) -> Self {
        let share = match fault {
            CrystalFault::Temperature { time_constant, interval, .. } => {
                let ratio = interval.ticks() as f64 / time_constant.ticks() as f64;
                libm::round(-libm::expm1(-ratio) * (1i64 << SHARE) as f64) as i64
            }
            _ => 0,
        };
        let stream = Stream::of_disturbance(seed, name, station.get(), Purpose::CrystalWander);
        Self { fault, on: false, offset: 0, share, stream }
    }
    /// The offset now (parts per billion), rounded.
    pub(crate) const fn ppb(&self) -> i64 {
        (self.offset + (1 << (FRACTION - 1))) >> FRACTION
    }
    /// A burst begins or ends.
    pub(crate) const fn turn(&mut self, on: bool) {
        self.on = on;
        match self.fault {
            CrystalFault::Offset(offset) => self.offset = if on { offset << FRACTION } else { 0 },
            CrystalFault::Wander { .. } => self.offset = 0,
            CrystalFault::Temperature { .. } => {}
        }
    }
    /// Whether it changes no more until the next burst begins.
    pub(crate) const fn rests(&self) -> bool {
        !self.on && self.offset == 0
    }
    /// An interval is over.
    pub(crate) fn step(&mut self) {
        match self.fault {
            CrystalFault::Offset(_) => {}
            CrystalFault::Wander { step, bound, .. } => {
                if self.on {
                    let up = self.stream.below(2) == 1;
                    let now = self.offset >> FRACTION;
                    let next = if up { now + step } else { now - step };
                    // A step beyond the bound goes to the other side.
                    let next = if next.abs() > bound { 2 * now - next } else { next };
                    self.offset = next << FRACTION;
                }
            }
            CrystalFault::Temperature { offset, .. } => self.approach(if self.on { offset } else { 0 }),
        }
    }
    /// One interval on the way to `goal` (parts per billion).
    fn approach(&mut self, goal: i64) {
        let goal = goal << FRACTION;
        let way = i128::from(goal - self.offset) * i128::from(self.share);
        self.offset += (way >> SHARE) as i64;
        // What is left is less than what a rate can tell.
        if (goal - self.offset).abs() < 1 << (FRACTION - 4) {
            self.offset = goal;
        }
    }
}

/// A crystal's own offset and those of all disturbances, within what a crystal can have (Model: more is no crystal).
pub(crate) fn within(ppb: i64) -> i64 {
    ppb.clamp(-Crystal::MAX_PPB, Crystal::MAX_PPB)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEED: u64 = 7;
    const STATION: Address = Address::new(3).unwrap();

    fn pull(fault: CrystalFault) -> Pull {
        Pull::new(fault, SEED, "pull", STATION)
    }
    fn steps(pull: &mut Pull, count: usize) -> Vec<i64> {
        let step = |()| {
            pull.step();
            pull.ppb()
        };
        std::iter::repeat_n((), count).map(step).collect()
    }

    #[test]
    fn an_offset_is_there_during_the_burst() {
        let mut pull = pull(CrystalFault::Offset(-20_000));
        assert_eq!((pull.ppb(), pull.rests()), (0, true));
        pull.turn(true);
        assert_eq!(pull.ppb(), -20_000);
        pull.turn(false);
        assert_eq!((pull.ppb(), pull.rests()), (0, true));
    }

    #[test]
    fn a_walk_makes_equal_steps_and_stays_within_its_bound() {
        let fault = CrystalFault::Wander { step: 10, interval: Span::from_ms(1), bound: 35 };
        let mut walk = pull(fault);
        assert_eq!(steps(&mut walk, 5), [0; 5], "before the burst");
        walk.turn(true);
        let offsets = steps(&mut walk, 10_000);
        assert!(offsets.windows(2).all(|pair| (pair[1] - pair[0]).abs() == 10));
        assert_eq!((offsets.iter().min(), offsets.iter().max()), (Some(&-30), Some(&30)));
        walk.turn(false);
        assert!(walk.rests() && walk.ppb() == 0);
        // Another station and another name walk otherwise.
        let first = |mut pull: Pull| {
            pull.turn(true);
            steps(&mut pull, 64)
        };
        let own = first(pull(fault));
        assert_eq!(own, offsets[..64]);
        assert_ne!(own, first(Pull::new(fault, SEED, "pull", Address::new(4).unwrap())));
        assert_ne!(own, first(Pull::new(fault, SEED, "other", STATION)));
    }

    #[test]
    fn a_temperature_is_approached_and_left_exponentially() {
        let interval = Span::from_ms(10);
        let fault = CrystalFault::Temperature { offset: 100_000, time_constant: Span::from_s(1), interval };
        let mut step = pull(fault);
        step.turn(true);
        let rising = steps(&mut step, 5_000);
        for (n, &offset) in rising.iter().enumerate() {
            let exact = 1e5 * -libm::expm1(-(n as f64 + 1.0) / 100.0);
            assert!((offset as f64 - exact).abs() < 1.0, "{n}: {offset} {exact}");
        }
        assert_eq!(rising.last(), Some(&100_000));
        step.turn(false);
        assert!(!step.rests(), "it cools down");
        let falling = steps(&mut step, 5_000);
        assert!((falling[99] as f64 - 1e5 * libm::exp(-1.0)).abs() < 1.0, "{}", falling[99]);
        assert!(step.rests() && falling.is_sorted_by(|a, b| a >= b));
    }

    #[test]
    fn the_sum_of_all_is_a_crystal_still() {
        assert_eq!([within(2_000_000), within(-2_000_000), within(5)], [Crystal::MAX_PPB, -Crystal::MAX_PPB, 5]);
    }
}
