//! What comes onto the line from nowhere: electrical noise, and telegrams of nobody.
//!
//! Model: it begins at a station's place and everybody hears it, that station too. Noise comes in characters whose bits are
//! all drawn, so that one in four passes a UART; without an average distance it comes once at the beginning of each burst.

use crate::sim::noise::{Purpose, Stream};
use crate::time::Span;
use crate::wire::{Address, Frame};

/// What a disturbance puts on the line.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SourceFault {
    /// The station at whose place; without one the first station.
    pub near: Option<Address>,
    /// How long after the beginning of a burst; of noise with an average distance from there on.
    pub after: Span,
    /// What.
    pub what: Emission,
}

/// What comes from nowhere.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Emission {
    /// Characters without sense.
    Noise {
        /// Average distance of their beginnings; none for once in a burst.
        mean: Option<Span>,
        /// How many characters, from the first to the second number, each equally likely.
        octets: (u8, u8),
    },
    /// These characters.
    Telegram(Box<[u8]>),
}

/// A disturbance that puts something on the line, at work.
#[derive(Clone, Debug)]
pub struct Source {
    /// What it does.
    pub fault: SourceFault,
    /// Whether its next noise is planned.
    pub planned: bool,
    stream: Stream,
}

impl Source {
    pub(super) fn new(name: &str, fault: SourceFault, seed: u64) -> Self {
        /// No station's address: where nothing is said, it does not matter who the first one is.
        const NO_STATION: u8 = 127;
        let near = fault.near.map_or(NO_STATION, Address::get);
        let stream = Stream::of_disturbance(seed, name, near, Purpose::Noise);
        Self { fault, planned: false, stream }
    }
    /// Whether it goes on by itself while a burst lasts.
    pub const fn goes_on(&self) -> bool {
        matches!(self.fault.what, Emission::Noise { mean: Some(_), .. })
    }
    /// How long until it comes again, at least one tick: memoryless, so that what is planned in one burst may come in the
    /// next.
    pub fn pause(&mut self) -> Span {
        match self.fault.what {
            Emission::Noise { mean: Some(mean), .. } => self.stream.exponential(mean),
            _ => Span::ZERO,
        }
    }
    /// Writes the characters that come now. Whether one of them is broken.
    pub fn fill(&mut self, frame: &mut Frame) -> bool {
        /// Values of a character's bits behind a start bit: eight data bits, parity and stop.
        const CHARACTERS: u64 = 1 << 10;
        match &self.fault.what {
            Emission::Telegram(octets) => {
                frame.set(octets);
                false
            }
            &Emission::Noise { octets: (least, most), .. } => {
                let octets = usize::from(least) + self.stream.below(u64::from(most - least) + 1) as usize;
                frame.set_len(octets);
                let mut broken = false;
                for octet in frame.octets_mut() {
                    let character = self.stream.below(CHARACTERS);
                    *octet = character as u8;
                    let (parity, stop) = (character >> 8 & 1, character >> 9 == 1);
                    broken |= !stop || parity != u64::from(octet.count_ones() % 2);
                }
                broken
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(name: &str, what: Emission) -> Source {
        let near = Address::new(3);
        Source::new(name, SourceFault { near, after: Span::ZERO, what }, 1)
    }

    #[test]
    fn noise_is_as_long_as_asked_and_one_character_in_four_is_good() {
        let mut noise = source("noise", Emission::Noise { mean: None, octets: (1, 3) });
        let mut frame = Frame::new();
        let (mut lengths, mut good) = ([0; 4], [0; 4]);
        for _ in 0..12_000 {
            let broken = noise.fill(&mut frame);
            lengths[frame.len()] += 1;
            good[frame.len()] += i32::from(!broken);
        }
        assert!(lengths[0] == 0 && lengths[1..].iter().all(|n| (3_800..4_200).contains(n)), "{lengths:?}");
        // A quarter, a sixteenth and a sixty-fourth of 4000.
        assert!(
            (900..1_100).contains(&good[1]) && (200..300).contains(&good[2]) && (35..95).contains(&good[3]),
            "{good:?}"
        );
    }

    #[test]
    fn distances_have_their_mean_and_belong_to_the_name() {
        let mean = Some(Span::from_ms(1));
        let distances = |name| {
            let mut noise = source(name, Emission::Noise { mean, octets: (1, 1) });
            (0..10_000).map(|_| noise.pause()).collect::<Vec<_>>()
        };
        let all = distances("noise");
        // 10 ms for ten, with a standard deviation of 1 % of the whole.
        let sum: i64 = all.iter().map(|span| span.ticks()).sum();
        assert!((sum - Span::from_s(10).ticks()).abs() < Span::from_ms(300).ticks(), "{sum}");
        assert!(all.iter().all(|&span| span > Span::ZERO) && all.iter().any(|&span| span > Span::from_ms(5)));
        assert_ne!(all, distances("other"));
    }

    #[test]
    fn a_telegram_is_what_it_is() {
        let mut telegram = source("token", Emission::Telegram([0xDC, 2, 5].into()));
        let mut frame = Frame::new();
        assert!(!telegram.fill(&mut frame) && !telegram.goes_on());
        assert_eq!((frame.octets(), telegram.pause()), (&[0xDC, 2, 5][..], Span::ZERO));
    }
}
