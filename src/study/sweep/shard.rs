//! Shard: a part of a sweep for one of several machines.
//!
//! To which part a run belongs is told by its key alone: every call has the same runs in the same part, and the parts
//! together have every run once.

use std::fmt;
use std::str::FromStr;

use super::key::{Identity, RunKey, part};

/// Part `number` of `of`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shard {
    /// From 1.
    number: u32,
    of: u32,
}

/// Most parts of a sweep.
const MOST: u32 = 10_000;

impl Shard {
    /// The whole sweep.
    pub const ALL: Self = Self { number: 1, of: 1 };

    /// Which part, from 1.
    pub const fn number(self) -> u32 {
        self.number
    }
    /// Of how many.
    pub const fn of(self) -> u32 {
        self.of
    }
    /// Whether it is the whole sweep.
    pub const fn is_all(self) -> bool {
        self.of == 1
    }
    /// Whether all runs of this combination are in it, where they must be in one.
    pub const fn has_all_of(self, combination: Identity) -> bool {
        combination.part(self.of) == self.number - 1
    }
    /// Whether this run is in it.
    pub const fn has(self, run: RunKey) -> bool {
        part(run, self.of) == self.number - 1
    }
}

/// `2/4`.
impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

/// Why a text is no part.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("a part is written I/N, such as 2/4, with I from 1 to N and N at most {MOST}")]
pub struct NoShard;

impl FromStr for Shard {
    type Err = NoShard;
    fn from_str(text: &str) -> Result<Self, NoShard> {
        let (number, of) = text.split_once('/').ok_or(NoShard)?;
        let [number, of] = [number, of].map(|text| text.trim().parse::<u32>().map_err(|_| NoShard));
        let (number, of) = (number?, of?);
        if of <= MOST && (1..=of).contains(&number) { Ok(Self { number, of }) } else { Err(NoShard) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_run_is_in_exactly_one_part() {
        let keys = (0..1_000_u128).map(|n| format!("{:032x}", n * 0x1234_5678_9abc_def1_2345_6789).parse().unwrap());
        let keys: Vec<RunKey> = keys.collect();
        for of in [1, 2, 3, 7, 100] {
            let parts: Vec<Shard> = (1..=of).map(|number| format!("{number}/{of}").parse().unwrap()).collect();
            assert!(keys.iter().all(|&key| parts.iter().filter(|part| part.has(key)).count() == 1), "{of} parts");
            assert!(keys.iter().all(|&key| Shard::ALL.has(key)));
        }
        for text in ["0/2", "3/2", "1", "1/0", "a/b", "1/2/3", "-1/2", "1/20000"] {
            assert_eq!(text.parse::<Shard>(), Err(NoShard), "{text}");
        }
        assert_eq!("2/4".parse::<Shard>().unwrap().to_string(), "2/4");
    }
}
