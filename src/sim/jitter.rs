//! Jitter of the master's clock: how SYNCH strays from its nominal instant, in shapes (Model: D1).
//!
//! | shape | stray of a SYNCH |
//! |---|---|
//! | None | nothing |
//! | Uniform | drawn, equally likely within the half width |
//! | Normal | drawn, normal |
//! | `BoundedNormal` | drawn, normal, again until it lies within the bound |
//! | Sine | amplitude x sine of the share of the period that is over |
//! | Step | the offset |
//! | Drift | grows with each cycle, or with time, up to its bound |
//! | Table | the entries one by one, then from the first again or the last one for good |
//!
//! A shape that depends on time counts from the first SYNCH of a burst, whose own share is nothing: a sine begins at
//! zero, a drift too, a table with its first entry. Several jitters add up. One that accumulates adds its strays up from
//! SYNCH to SYNCH for as long as a burst lasts; afterwards the master is on its grid again (Model: D1).

use crate::sim::fault::window::Window;
use crate::sim::noise::{Purpose, Stream, reaches};
use crate::time::{Span, Time};
use std::sync::Arc;

/// How the master's SYNCH strays from its nominal instant (Model: D1, the send instant of that one telegram).
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub enum GcJitter {
    /// Not at all.
    #[default]
    None,
    /// Equally likely anywhere between -`half_width` and +`half_width`.
    Uniform {
        /// Largest deviation, 0 ..= [`GcJitter::LIMIT`].
        half_width: Span,
    },
    /// Normal.
    Normal {
        /// Standard deviation, 0 ..= [`GcJitter::LIMIT`].
        sigma: Span,
    },
    /// Normal, drawn again until it lies within the bound.
    BoundedNormal {
        /// Standard deviation before the bound, 0 ..= [`GcJitter::LIMIT`].
        sigma: Span,
        /// Largest deviation, `sigma` / 4 ..= [`GcJitter::LIMIT`].
        bound: Span,
    },
    /// A sine that begins at zero, upwards.
    Sine {
        /// Largest deviation, 0 ..= [`GcJitter::LIMIT`].
        amplitude: Span,
        /// Length of a period.
        period: Period,
    },
    /// The same for all SYNCH.
    Step {
        /// The deviation, within ±[`GcJitter::LIMIT`].
        offset: Span,
    },
    /// Grows from nothing.
    Drift {
        /// How fast, within ±[`GcJitter::LIMIT`] in one cycle or second.
        rate: Rate,
        /// Largest deviation, 0 ..= [`GcJitter::LIMIT`].
        bound: Span,
    },
    /// One entry after the other.
    Table {
        /// The deviations, each within ±[`GcJitter::LIMIT`]; at least one.
        offsets: Arc<[Span]>,
        /// Whether the first entry follows the last one; otherwise the last one stays.
        repeat: bool,
    },
}

/// Length of a period, above 0.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Period {
    /// So long.
    Time(Span),
    /// So many cycles.
    Cycles(u32),
}

/// How fast a drift grows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Rate {
    /// By this from SYNCH to SYNCH.
    PerCycle(Span),
    /// By this in a second.
    PerSecond(Span),
}

/// A kind of jitter as a user meets it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct JitterKind {
    /// The word for it in a scenario.
    pub name: &'static str,
    /// What it does, in a sentence.
    pub what: &'static str,
    /// Its keys in a scenario, each with an example of its value.
    pub keys: &'static [(&'static str, &'static str)],
}

/// Every kind of jitter, in the order of [`GcJitter`]'s variants.
pub const KINDS: &[JitterKind] = &[
    JitterKind { name: "none", what: "every clock leaves at its nominal instant", keys: &[] },
    JitterKind {
        name: "uniform",
        what: "equally likely anywhere within the half width",
        keys: &[("half_width", "\"1 us\"")],
    },
    JitterKind { name: "normal", what: "normal with the given standard deviation", keys: &[("sigma", "\"1 us\"")] },
    JitterKind {
        name: "bounded_normal",
        what: "normal, drawn again until it lies within the bound",
        keys: &[("sigma", "\"1 us\""), ("bound", "\"1 us\"")],
    },
    JitterKind {
        name: "sine",
        what: "a sine of the amplitude, one period in a time or a number of cycles",
        keys: &[("amplitude", "\"1 us\""), ("period", "\"100 ms\"")],
    },
    JitterKind { name: "step", what: "the same offset for every clock", keys: &[("offset", "\"1 us\"")] },
    JitterKind {
        name: "drift",
        what: "grows per_cycle or per_second up to the bound",
        keys: &[("per_cycle", "\"1 ns\""), ("bound", "\"1 us\"")],
    },
    JitterKind {
        name: "table",
        what: "the offsets one by one, in the file or from a CSV file with the column offset_ns; then from the start, or held",
        keys: &[("offsets", "[\"0 ns\", \"100 ns\", \"-100 ns\"]"), ("repeat", "true")],
    },
];

/// Why a jitter cannot be.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum JitterError {
    /// A parameter is negative.
    #[error("{parameter} = {value} is negative")]
    Negative {
        /// The parameter's name as in [`KINDS`].
        parameter: &'static str,
        /// Its value.
        value: Span,
    },
    /// A parameter is larger than the longest T_DP.
    #[error("{parameter} = {value} is longer than the longest T_DP, {limit}", limit = GcJitter::LIMIT)]
    TooLong {
        /// The parameter's name as in [`KINDS`].
        parameter: &'static str,
        /// Its value.
        value: Span,
    },
    /// The bound cuts so much away that the rest is no normal distribution and most draws are lost.
    #[error("bound = {bound} is less than a quarter of sigma = {sigma}; uniform jitter is nearly the same")]
    BoundTooTight {
        /// Standard deviation.
        sigma: Span,
        /// Largest deviation.
        bound: Span,
    },
    /// A period of nothing.
    #[error("a period of nothing has no sine")]
    NoPeriod,
    /// A table without entries.
    #[error("a table without offsets says nothing")]
    NoOffsets,
}

impl GcJitter {
    /// The longest T_DP: no parameter is longer (Model: D3).
    pub const LIMIT: Span = Span::from_ms(32);

    /// Whether it draws anything.
    pub fn draws(&self) -> bool {
        match *self {
            Self::Uniform { half_width: width }
            | Self::Normal { sigma: width }
            | Self::BoundedNormal { sigma: width, .. } => width > Span::ZERO,
            Self::None | Self::Sine { .. } | Self::Step { .. } | Self::Drift { .. } | Self::Table { .. } => false,
        }
    }
    /// The row of [`KINDS`] for this jitter.
    pub fn kind(&self) -> &'static JitterKind {
        &KINDS[match self {
            Self::None => 0,
            Self::Uniform { .. } => 1,
            Self::Normal { .. } => 2,
            Self::BoundedNormal { .. } => 3,
            Self::Sine { .. } => 4,
            Self::Step { .. } => 5,
            Self::Drift { .. } => 6,
            Self::Table { .. } => 7,
        }]
    }

    /// Whether a SYNCH strays for nothing that was there before it: no shape in time.
    pub const fn is_drawn(&self) -> bool {
        matches!(self, Self::None | Self::Uniform { .. } | Self::Normal { .. } | Self::BoundedNormal { .. })
    }

    /// The largest stray, if there is one.
    pub fn bound(&self) -> Option<Span> {
        match self {
            Self::None => Some(Span::ZERO),
            Self::Uniform { half_width } => Some(*half_width),
            Self::Normal { .. } => None,
            Self::BoundedNormal { bound, .. } | Self::Drift { bound, .. } => Some(*bound),
            Self::Sine { amplitude, .. } => Some(*amplitude),
            Self::Step { offset } => Some(offset.abs()),
            Self::Table { offsets, .. } => offsets.iter().map(|offset| offset.abs()).max(),
        }
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// The first parameter that is negative or longer than [`Self::LIMIT`], a bound less than a quarter of sigma, a
    /// period of nothing, or an empty table.
    pub fn check(&self) -> Result<(), JitterError> {
        match self {
            Self::None => Ok(()),
            Self::Uniform { half_width } => width("half_width", *half_width),
            Self::Normal { sigma } => width("sigma", *sigma),
            Self::BoundedNormal { sigma, bound } => {
                width("sigma", *sigma)?;
                width("bound", *bound)?;
                let (sigma, bound) = (*sigma, *bound);
                if reaches(sigma, bound) { Ok(()) } else { Err(JitterError::BoundTooTight { sigma, bound }) }
            }
            Self::Sine { amplitude, period } => {
                let nothing = matches!(*period, Period::Time(Span::ZERO) | Period::Cycles(0));
                if nothing { Err(JitterError::NoPeriod) } else { width("amplitude", *amplitude) }
            }
            Self::Step { offset } => length("offset", *offset),
            Self::Drift { rate, bound } => {
                match *rate {
                    Rate::PerCycle(rate) => length("per_cycle", rate),
                    Rate::PerSecond(rate) => length("per_second", rate),
                }?;
                width("bound", *bound)
            }
            Self::Table { offsets, .. } => {
                let check = |offset: &Span| length("offsets", *offset);
                if offsets.is_empty() { Err(JitterError::NoOffsets) } else { offsets.iter().try_for_each(check) }
            }
        }
    }

    /// The stray of a SYNCH, `place` being how far into a burst it is.
    fn stray(&self, place: Place, stream: &mut Stream) -> Span {
        match self {
            Self::None => Span::ZERO,
            Self::Uniform { half_width } => stream.uniform(*half_width),
            Self::Normal { sigma } => stream.normal_span(*sigma),
            Self::BoundedNormal { sigma, bound } => stream.bounded_normal(*sigma, *bound),
            Self::Sine { amplitude, period } => {
                let share = match *period {
                    Period::Cycles(cycles) => (place.count % u64::from(cycles)) as f64 / f64::from(cycles),
                    Period::Time(period) => {
                        place.since.ticks().rem_euclid(period.ticks()) as f64 / period.ticks() as f64
                    }
                };
                let sine = libm::sin(share * core::f64::consts::TAU);
                Span::from_ticks(libm::round(sine * amplitude.ticks() as f64) as i64)
            }
            Self::Step { offset } => *offset,
            Self::Drift { rate, bound } => {
                let ticks = match *rate {
                    Rate::PerCycle(rate) => i128::from(rate.ticks()) * i128::from(place.count),
                    Rate::PerSecond(rate) => {
                        let second = i128::from(Span::from_s(1).ticks());
                        i128::from(rate.ticks()) * i128::from(place.since.ticks()) / second
                    }
                };
                let bound = i128::from(bound.ticks());
                Span::from_ticks(ticks.clamp(-bound, bound) as i64)
            }
            Self::Table { offsets, repeat } => {
                let count = offsets.len() as u64;
                let place = if *repeat { place.count % count } else { place.count.min(count - 1) };
                offsets[place as usize]
            }
        }
    }
}

/// A length of a parameter that is not negative.
fn width(parameter: &'static str, value: Span) -> Result<(), JitterError> {
    if value < Span::ZERO { Err(JitterError::Negative { parameter, value }) } else { length(parameter, value) }
}
/// A length of a parameter to either side.
fn length(parameter: &'static str, value: Span) -> Result<(), JitterError> {
    let within = -GcJitter::LIMIT <= value && value <= GcJitter::LIMIT;
    if within { Ok(()) } else { Err(JitterError::TooLong { parameter, value }) }
}

/// How far into a burst a SYNCH is.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// SYNCH before it.
    count: u64,
    /// Time since the first one's nominal instant.
    since: Span,
}

/// One jitter at work, clock by clock.
#[derive(Clone, Debug)]
pub struct JitterSource {
    jitter: GcJitter,
    window: Window,
    accumulates: bool,
    stream: Stream,
    /// Number of the burst that goes on, when its first SYNCH should have left, and how many there were.
    burst: Option<u64>,
    first: Time,
    count: u64,
    /// What accumulated.
    sum: Span,
}

impl JitterSource {
    /// No sum of strays is longer than a day, however long the burst is.
    const MOST: i64 = Span::from_s(86_400).ticks();

    /// The jitter of the master `station` in a run with `seed`.
    ///
    /// # Errors
    /// Those of [`GcJitter::check`].
    pub fn new(jitter: GcJitter, seed: u64, station: u8) -> Result<Self, JitterError> {
        Self::of_disturbance(jitter, Window::Always, false, Stream::new(seed, station, Purpose::GcJitter))
    }
    /// The jitter of a disturbance, which may accumulate; `stream` is its own.
    ///
    /// # Errors
    /// Those of [`GcJitter::check`].
    pub fn of_disturbance(
        jitter: GcJitter,
        window: Window,
        accumulates: bool,
        stream: Stream,
    ) -> Result<Self, JitterError> {
        jitter.check()?;
        let (first, sum) = (Time::ZERO, Span::ZERO);
        Ok(Self { jitter, window, accumulates, stream, burst: None, first, count: 0, sum })
    }

    /// Strays as `jitter` says from the next clock on, which is the first one of its shape. The stream goes on where it
    /// is.
    ///
    /// # Errors
    /// Those of [`GcJitter::check`]; nothing is changed then.
    pub fn change(&mut self, jitter: GcJitter) -> Result<(), JitterError> {
        jitter.check()?;
        (self.jitter, self.burst) = (jitter, None);
        Ok(())
    }

    /// How much later than nominal the clock leaves that should leave at `at` and begins the cycle of this number. Signed.
    #[inline]
    pub fn draw(&mut self, at: Time, cycle: u64) -> Span {
        let Some(burst) = self.window.burst(at, cycle) else { return Span::ZERO };
        if self.burst != Some(burst) {
            (self.burst, self.first, self.count, self.sum) = (Some(burst), at, 0, Span::ZERO);
        }
        let place = Place { count: self.count, since: at - self.first };
        self.count += 1;
        let stray = self.jitter.stray(place, &mut self.stream);
        if !self.accumulates {
            return stray;
        }
        self.sum = Span::from_ticks((self.sum + stray).ticks().clamp(-Self::MOST, Self::MOST));
        self.sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::fault::window::Bursts;

    const SEED: u64 = 0x0123_4567_89ab_cdef;
    const US: Span = Span::from_us(1);

    /// The strays of the first SYNCH, one every millisecond.
    fn first<const N: usize>(jitter: GcJitter) -> [i64; N] {
        let mut source = JitterSource::new(jitter, SEED, 2).unwrap();
        core::array::from_fn(|cycle| source.draw(at(cycle), cycle as u64).ticks())
    }
    fn at(cycle: usize) -> Time {
        Time::ZERO + Span::from_ms(cycle as i64)
    }
    fn table(offsets: &[i64], repeat: bool) -> GcJitter {
        GcJitter::Table { offsets: offsets.iter().map(|&ticks| Span::from_ticks(ticks)).collect(), repeat }
    }
    /// One of each variant: a new one does not compile until it is listed here.
    fn one_of_each() -> Vec<GcJitter> {
        let mut all = vec![GcJitter::None];
        loop {
            all.push(match &all[all.len() - 1] {
                GcJitter::None => GcJitter::Uniform { half_width: US },
                GcJitter::Uniform { .. } => GcJitter::Normal { sigma: US },
                GcJitter::Normal { .. } => GcJitter::BoundedNormal { sigma: US, bound: Span::from_ns(500) },
                GcJitter::BoundedNormal { .. } => GcJitter::Sine { amplitude: US, period: Period::Cycles(12) },
                GcJitter::Sine { .. } => GcJitter::Step { offset: -US },
                GcJitter::Step { .. } => GcJitter::Drift { rate: Rate::PerCycle(US), bound: US * 3 },
                GcJitter::Drift { .. } => table(&[7, -8], true),
                GcJitter::Table { .. } => return all,
            });
        }
    }

    #[test]
    fn every_kind_is_registered() {
        let all = one_of_each();
        assert_eq!(all.len(), KINDS.len());
        for (jitter, row) in all.iter().zip(KINDS) {
            assert_eq!(jitter.kind(), row);
            assert!(jitter.check().is_ok());
            assert_eq!(row.keys.is_empty(), *jitter == GcJitter::None);
            assert!(format!("{jitter:?}").to_lowercase().starts_with(&row.name.replace('_', "")));
        }
    }

    #[test]
    fn draws_never_change_from_release_to_release() {
        // Computed a second time, from the written rules, outside of this crate.
        let golden: [[i64; 8]; 4] = [
            [0; 8],
            [-8_372, -6_931, 5_820, -7_980, -4_114, -11_958, -2_149, 9_256],
            [-5_818, 6_241, -2_623, 140, 3_120, -11_033, 3_628, 4_517],
            [-5_818, -2_623, 140, 3_120, 3_628, 4_517, -4_637, -4_624],
        ];
        for (jitter, expected) in one_of_each().into_iter().zip(golden) {
            assert!(jitter.is_drawn());
            assert_eq!(first(jitter), expected);
        }
    }

    #[test]
    fn a_sine_begins_at_zero_and_has_its_period_in_cycles_or_in_time() {
        // Twelfths of a turn: 0, 1/2, sqrt(3)/2 and 1 of 12000 ticks.
        let expected = [0, 6_000, 10_392, 12_000, 10_392, 6_000, 0, -6_000, -10_392, -12_000, -10_392, -6_000, 0];
        assert_eq!(first(GcJitter::Sine { amplitude: US, period: Period::Cycles(12) }), expected);
        assert_eq!(first(GcJitter::Sine { amplitude: US, period: Period::Time(Span::from_ms(12)) }), expected);
        assert_eq!(first(GcJitter::Sine { amplitude: Span::ZERO, period: Period::Cycles(12) }), [0; 13]);
    }

    #[test]
    fn a_step_stays_and_a_drift_grows_to_its_bound() {
        let ns = |ns| Span::from_ns(ns);
        assert_eq!(first(GcJitter::Step { offset: ns(-5) }), [-60; 4]);
        assert_eq!(first(GcJitter::Drift { rate: Rate::PerCycle(ns(1)), bound: ns(3) }), [0, 12, 24, 36, 36]);
        assert_eq!(first(GcJitter::Drift { rate: Rate::PerSecond(ns(-1_000)), bound: ns(3) }), [0, -12, -24, -36, -36]);
    }

    #[test]
    fn a_table_repeats_or_holds_its_last_entry() {
        assert_eq!(first(table(&[1, -2, 3], true)), [1, -2, 3, 1, -2, 3, 1]);
        assert_eq!(first(table(&[1, -2, 3], false)), [1, -2, 3, 3, 3, 3, 3]);
    }

    #[test]
    fn a_burst_has_its_own_beginning() {
        let strays = |jitter: GcJitter, window, accumulates| -> Vec<i64> {
            let stream = Stream::of_disturbance(SEED, "drift", 2, Purpose::GcJitter);
            let mut source = JitterSource::of_disturbance(jitter, window, accumulates, stream).unwrap();
            (0..12).map(|cycle| source.draw(at(cycle), cycle as u64).ticks()).collect()
        };
        let cycles = Window::Cycles(Bursts { from: 2, length: Some(3), every: Some(5), times: None });
        let drift = GcJitter::Drift { rate: Rate::PerCycle(Span::from_ticks(1)), bound: US };
        assert_eq!(strays(drift, cycles, false), [0, 0, 0, 1, 2, 0, 0, 0, 1, 2, 0, 0]);
        // The same stretches in time.
        let ms = Span::from_ms(1).ticks();
        let time = Window::Time(Bursts { from: 2 * ms, length: Some(3 * ms), every: Some(5 * ms), times: None });
        assert_eq!(strays(table(&[-1], true), time, false), [0, 0, -1, -1, -1, 0, 0, -1, -1, -1, 0, 0]);
        assert_eq!(strays(table(&[-1], true), time, true), [0, 0, -1, -2, -3, 0, 0, -1, -2, -3, 0, 0], "accumulating");
    }

    #[test]
    fn another_shape_begins_with_its_first_clock_and_the_draws_go_on() {
        let mut source = JitterSource::new(GcJitter::Uniform { half_width: US }, SEED, 2).unwrap();
        let mut straight = source.clone();
        let draw = |source: &mut JitterSource, cycle: usize| source.draw(at(cycle), cycle as u64);
        assert_eq!(draw(&mut source, 0), draw(&mut straight, 0));
        source.change(GcJitter::Sine { amplitude: US, period: Period::Cycles(4) }).unwrap();
        assert_eq!([1, 2, 3].map(|cycle| draw(&mut source, cycle)), [Span::ZERO, US, Span::ZERO]);
        source.change(GcJitter::Uniform { half_width: US }).unwrap();
        assert_eq!(draw(&mut source, 4), draw(&mut straight, 1));
    }

    #[test]
    fn parameters_that_make_no_sense_are_named() {
        let tick = Span::from_ticks(1);
        for (jitter, text) in [
            (GcJitter::Uniform { half_width: -US }, "half_width = -1 us is negative"),
            (GcJitter::Normal { sigma: -tick }, "sigma = -0.083 ns is negative"),
            (GcJitter::Normal { sigma: Span::from_ms(33) }, "sigma = 33 ms is longer than the longest T_DP, 32 ms"),
            (GcJitter::BoundedNormal { sigma: US, bound: -US }, "bound = -1 us is negative"),
            (
                GcJitter::BoundedNormal { sigma: US, bound: Span::from_ns(250) - tick },
                "bound = 249.917 ns is less than a quarter of sigma = 1 us; uniform jitter is nearly the same",
            ),
            (GcJitter::Sine { amplitude: US, period: Period::Cycles(0) }, "a period of nothing has no sine"),
            (GcJitter::Step { offset: Span::from_ms(-33) }, "offset = -33 ms is longer than the longest T_DP, 32 ms"),
            (GcJitter::Drift { rate: Rate::PerCycle(US), bound: -US }, "bound = -1 us is negative"),
            (table(&[], true), "a table without offsets says nothing"),
        ] {
            assert_eq!(jitter.check().unwrap_err().to_string(), text);
            assert!(JitterSource::new(jitter, SEED, 2).is_err());
        }
        assert!(GcJitter::BoundedNormal { sigma: US, bound: Span::from_ns(250) }.check().is_ok());
    }

    #[test]
    fn bounds_are_those_of_the_draws() {
        for jitter in one_of_each() {
            let strays: [i64; 64] = first(jitter.clone());
            let most = strays.iter().map(|ticks| ticks.abs()).max().unwrap();
            match jitter.bound() {
                Some(bound) => assert!(most <= bound.ticks(), "{jitter:?}: {most}"),
                None => assert!(matches!(jitter, GcJitter::Normal { .. })),
            }
        }
    }
}
