//! How long and how often is measured, and the medians of it.

use std::time::Instant;

/// How often each contender is timed, and for how many slave-cycles at a time.
#[derive(Clone, Copy)]
pub(crate) struct Effort {
    rounds: usize,
    slave_cycles: u64,
    /// Cycles whose every result is compared before.
    pub(crate) compared: u64,
}

impl Effort {
    const FULL: Self = Self { rounds: 15, slave_cycles: 150_000, compared: 400 };
    const SHORT: Self = Self { rounds: 1, slave_cycles: 1_000, compared: 30 };

    /// As the arguments say: `--test` is one short round, everything else is ignored.
    pub(crate) fn of_arguments() -> Self {
        if std::env::args().any(|argument| argument == "--test") { Self::SHORT } else { Self::FULL }
    }
    /// Cycles of one round of a network of so many encoders.
    pub(crate) fn cycles(self, encoders: u8) -> u64 {
        (self.slave_cycles / u64::from(encoders)).max(10)
    }

    /// Medians of the contenders' times [ns per slave-cycle]. They take turns, so that a slow spell of the machine
    /// meets them all.
    pub(crate) fn medians<const N: usize>(self, encoders: u8, mut contenders: [&mut dyn FnMut(u64); N]) -> [f64; N] {
        let cycles = self.cycles(encoders);
        let mut rounds: [Vec<f64>; N] = std::array::from_fn(|_| Vec::with_capacity(self.rounds));
        for _ in 0..self.rounds {
            for (contender, times) in contenders.iter_mut().zip(&mut rounds) {
                let begun = Instant::now();
                contender(cycles);
                times.push(begun.elapsed().as_secs_f64() * 1e9 / (cycles * u64::from(encoders)) as f64);
            }
        }
        rounds.map(|mut times| {
            times.sort_by(f64::total_cmp);
            times[times.len() / 2]
        })
    }
}
