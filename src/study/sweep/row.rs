//! Row: what the repetitions of one combination came to.

use std::io;

use super::definition::Definition;
use super::journal::Record;
use super::sample::{Gathering, Sample};

/// A combination whose repetitions are being looked at.
pub(super) struct Gathered<'a> {
    combination: u64,
    runs: u32,
    failed: u32,
    broken: u32,
    samples: Vec<Gathering<'a>>,
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
}

impl<'a> Gathered<'a> {
    /// The combination of this number, before its first repetition.
    pub(super) fn new(definition: &'a Definition, combination: u64) -> Self {
        let gathering = |figure| Gathering::new(figure, definition.confidence);
        let samples = definition.figures.iter().map(gathering).collect();
        Self { combination, runs: 0, failed: 0, broken: 0, samples }
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
        Ok(())
    }
    /// The row of all repetitions, with outlines of distributions if they are wanted; none without a repetition.
    ///
    /// # Errors
    /// A temporary file cannot be read.
    pub(super) fn finish(self, outline: bool) -> io::Result<Option<Row<'a>>> {
        let Self { combination, runs, failed, broken, samples } = self;
        let samples = samples.into_iter().map(|sample| sample.finish(outline)).collect::<io::Result<_>>()?;
        Ok((runs > 0).then_some(Row { combination, runs, failed, broken, samples }))
    }
}
