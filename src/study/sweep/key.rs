//! Key: what a run is told by, whatever sweep it is part of.
//!
//! The key is a hash of everything that the result depends on: the scenario as it is understood after all overrides (so
//! that neither the order nor the spelling of parameters matters, and a GSD file counts by what it says), its seed, and
//! the version of the model. Two runs of one key have one result, which need not be computed twice.

use std::fmt::{self, Write};
use std::str::FromStr;

use twox_hash::XxHash3_128;

use crate::study::scenario::{Run, Scenario};
pub use crate::study::statistics::aggregate::{RunKey, RunKeyError};
use crate::study::verdict::Expectation;

/// Version of the model's behaviour. A change that changes a fingerprint raises it: finished runs are then run again.
pub const MODEL_VERSION: u32 = 2;

/// A combination of parameters without its seed: what all its repetitions have in common.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Identity(u128);

/// Text that is hashed as it is written. XXH3: stable for good, on every machine.
struct Hashed(XxHash3_128);
impl Write for Hashed {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.write(text.as_bytes());
        Ok(())
    }
}

impl Identity {
    /// The identity of `scenario`. Its name, its question, the call that read it and what it keeps of a run are no part
    /// of it, nor is its seed; what it expects is one, since a run is told with its verdict.
    pub fn of(scenario: &Scenario) -> Self {
        // In full: a new field does not compile here until someone decides whether a result depends on it.
        let Scenario {
            name: _,
            question: _,
            invocation: _,
            record: _,
            run,
            bus,
            topology,
            master,
            class1,
            slaves,
            class2,
            links,
            events,
            disturbances,
            expectations,
        } = scenario;
        let run = Run { seed: 0, ..*run };
        // By name: a figure holds functions, whose places in memory differ from call to call.
        let expected = |expectation: &Expectation| format!("{} {:?}", expectation.figure.name(), expectation.demand);
        let expectations: Vec<_> = expectations.iter().map(expected).collect();
        let stations = (bus, topology, master, class1, slaves, class2);
        let all = (run, stations, links, events, disturbances, expectations);
        let mut hashed = Hashed(XxHash3_128::new());
        write!(hashed, "isodp {} model {MODEL_VERSION} {all:?}", env!("CARGO_PKG_VERSION")).expect("hashing takes all");
        Self(hashed.0.finish_128())
    }
    /// The run with this seed.
    pub fn run(self, seed: u64) -> RunKey {
        let octets = [self.0.to_le_bytes().as_slice(), &seed.to_le_bytes()].concat();
        RunKey(XxHash3_128::oneshot(&octets))
    }
    /// A seed of this combination's own for its repetition of this number.
    pub fn seed(self, repetition: u32) -> u64 {
        XxHash3_128::oneshot(&[self.0.to_le_bytes().as_slice(), &repetition.to_le_bytes()].concat()) as u64
    }
    /// To which of `parts` it belongs, from 0.
    pub(super) const fn part(self, parts: u32) -> u32 {
        (self.0 % parts as u128) as u32
    }
}
/// To which of `parts` a run belongs, from 0.
pub(super) const fn part(run: RunKey, parts: u32) -> u32 {
    (run.0 % parts as u128) as u32
}

/// 32 hexadecimal digits.
impl fmt::Display for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        RunKey(self.0).fmt(f)
    }
}
impl FromStr for Identity {
    type Err = RunKeyError;
    fn from_str(text: &str) -> Result<Self, RunKeyError> {
        text.parse().map(|RunKey(digits)| Self(digits))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# Why?\n[run]\nseed = 4\ncycles = 100\n[bus]\nrate = \"12 Mbit/s\"\n[master]\naddress = 1\n\
        t_dp = \"1 ms\"\nt_i = \"125 us\"\nt_o = \"500 us\"\n[[slave]]\naddress = 3\ndevice = \"posital-ocd-dpb1b\"\n";

    fn identity(name: &str, text: &str, sets: &[(&str, &str)]) -> Identity {
        let sets: Vec<_> = sets.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
        Identity::of(&Scenario::parse(name, name, text, &sets).unwrap())
    }

    #[test]
    fn a_combination_is_what_is_understood_not_how_it_is_written() {
        let plain = identity("a", TEXT, &[]);
        let other = format!("# Something else?\n\n{}", TEXT.split_once('\n').unwrap().1.replace(" = ", "="));
        assert_eq!(identity("b", &other, &[("run.seed", "9"), ("record.rows", "7")]), plain);
        assert_eq!(identity("a", TEXT, &[("master.t_dp", "1000 us")]), plain);
        assert_eq!(
            identity("a", TEXT, &[("master.t_i", "250 us"), ("slave.3.t_sdr", "40 tbit")]),
            identity("a", TEXT, &[("slave.3.t_sdr", "40 tbit"), ("master.t_i", "250 us")])
        );
        for set in [("master.t_i", "250 us"), ("slave.3.crystal", "1 ppb"), ("run.cycles", "101"), ("bus.cable", "1 m")]
        {
            assert_ne!(identity("a", TEXT, &[set]), plain, "{set:?}");
        }
    }

    #[test]
    fn keys_differ_by_seed_and_survive_as_text() {
        let plain = identity("a", TEXT, &[]);
        let key = plain.run(1);
        assert_ne!(key, plain.run(2));
        assert_eq!(key.to_string().parse(), Ok(key));
        assert_eq!(plain.to_string().parse(), Ok(plain));
        assert_ne!(plain.seed(1), plain.seed(2));
    }
}
