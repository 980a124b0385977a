//! Row: what the repetitions of one combination came to.

use std::io;

use super::definition::Definition;
use super::journal::Record;
use super::sample::{Gathering, Sample};
use crate::study::statistics::pool::Pool;

/// A combination whose repetitions are being looked at.
pub(super) struct Gathered<'a> {
    combination: u64,
    runs: u32,
    failed: u32,
    broken: u32,
    samples: Vec<Gathering<'a>>,
    pools: Vec<Pool>,
}

/// What the repetitions of one combination came to.
pub(super) struct Row<'a> {
    pub(super) combination: u64,
    pub(super) runs: u32,
    pub(super) failed: u32,
    /// Runs with figures that are not as expected.
    pub(super) broken: u32,
    /// Per figure.
    pub(super) samples: Vec<Sample<'a>>,
    /// All repetitions' values of each pooled quantity.
    pub(super) pools: Vec<Pool>,
}

impl<'a> Gathered<'a> {
    /// The combination of this number, before its first repetition.
    pub(super) fn new(definition: &'a Definition, combination: u64) -> Self {
        let gathering = |figure| Gathering::new(figure, definition.confidence);
        let samples = definition.figures.iter().map(gathering).collect();
        let pools = vec![Pool::default(); definition.pools.len()];
        Self { combination, runs: 0, failed: 0, broken: 0, samples, pools }
    }
    /// Takes what a repetition came to.
    ///
    /// # Errors
    /// A temporary file cannot be written.
    pub(super) fn add(&mut self, definition: &Definition, record: &Record) -> io::Result<()> {
        self.runs += 1;
        self.failed += u32::from(record.failure.is_some());
        self.broken += u32::from(record.failure.is_none() && record.is_bad());
        for (sample, figure) in self.samples.iter_mut().zip(&definition.figures) {
            if let Some(value) = record.figures.get(figure.name()).copied().flatten() {
                sample.add(value, record.key)?;
            }
        }
        for (all, pooled) in self.pools.iter_mut().zip(&definition.pools) {
            record.pools.get(pooled.name()).into_iter().for_each(|pool| all.merge(pool));
        }
        Ok(())
    }
    /// The row of all repetitions, with outlines of distributions if they are wanted; none without a repetition.
    ///
    /// # Errors
    /// A temporary file cannot be read.
    pub(super) fn finish(self, outline: bool) -> io::Result<Option<Row<'a>>> {
        let Self { combination, runs, failed, broken, samples, pools } = self;
        let samples = samples.into_iter().map(|sample| sample.finish(outline)).collect::<io::Result<_>>()?;
        Ok((runs > 0).then_some(Row { combination, runs, failed, broken, samples, pools }))
    }
}
