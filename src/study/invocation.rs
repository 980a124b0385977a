//! Invocation: how a scenario was asked for, so that a command line can be told that runs it once more.

use std::fmt::Write as _;

/// The file of a scenario and what was set on the command line.
#[derive(Clone, Debug, Default)]
pub struct Invocation {
    /// The file as it was named.
    pub file: String,
    /// Keys and values that were set for the run, in their order; that of the seed among them.
    pub sets: Vec<(String, String)>,
}

/// Where a scenario was read is no part of what it says: two that say the same are equal.
impl PartialEq for Invocation {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}
impl Eq for Invocation {}

impl Invocation {
    /// The key that `--seed` sets.
    const SEED: &'static str = "run.seed";
    /// Keys of what is kept; none of them changes a run.
    const RECORD: &'static str = "record.";

    /// The command line that tells `cycle`, and `window` cycles before and after it, of the run with this seed.
    pub fn replay(&self, seed: u64, cycle: u64, window: u64) -> String {
        let mut line = format!("isodp replay {} --seed {seed} --cycle {cycle} --window {window}", quoted(&self.file));
        for (key, value) in self.sets.iter().filter(|(key, _)| key != Self::SEED && !key.starts_with(Self::RECORD)) {
            // A String takes everything.
            let _ = write!(line, " --run-set {}={}", quoted(key), quoted(value));
        }
        line
    }
}

/// `word` as a shell takes it for one word.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./:=,%+@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_repeats_everything_that_changes_a_run_and_names_the_seed_itself() {
        let set = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        let sets =
            vec![set("master.t_o", "1.5 ms"), set("run.seed", "9"), set("bus.t_slot", "5"), set("record.rows", "5")];
        let invocation = Invocation { file: "my scenes/it's.toml".into(), sets };
        assert_eq!(
            invocation.replay(9, 1_234, 5),
            r"isodp replay 'my scenes/it'\''s.toml' --seed 9 --cycle 1234 --window 5 --run-set master.t_o='1.5 ms' --run-set bus.t_slot=5"
        );
        let plain = Invocation { file: "scenarios/gc-loss.toml".into(), sets: Vec::new() };
        assert_eq!(plain.replay(1, 2, 3), "isodp replay scenarios/gc-loss.toml --seed 1 --cycle 2 --window 3");
        assert_eq!(quoted(""), "''");
    }
}
