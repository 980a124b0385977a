//! Results: a row per run, with its parameters and its figures.
//!
//! | `status` | the run |
//! |---|---|
//! | `done` | has its figures; the scenario expects nothing |
//! | `passed`, `broken` | has its figures, which are as the scenario expects, or not |
//! | `failed` | has none: it broke off |
//!
//! Rows are in the order of the plan, whoever finished when, and are read from the journal one by one: the table is as
//! long as it needs to be and the memory is not. It is written in every [format](super::format) at once, with the same
//! columns.

use std::io;
use std::path::{Path, PathBuf};

use csv::Writer;

use super::cell::{Cell, Heading, Kind};
use super::definition::Definition;
use super::format::{self, Rows, Sheet};
use super::journal::Record;
use super::parameter::Column;
use super::plan::{Job, Plan};
use super::store::StoreError;
use crate::study::export::{ExportError, Staged};

/// The files of the table, under their temporary names.
pub(super) struct Results<'a> {
    plan: &'a Plan,
    columns: Vec<Column>,
    files: Vec<Sheet>,
    /// The combination of the last row and its cells.
    last: Option<(u64, Vec<Cell>)>,
}

impl<'a> Results<'a> {
    /// Begins it in `dir`.
    ///
    /// # Errors
    /// A file cannot be written.
    pub(super) fn create(dir: &Path, plan: &'a Plan) -> Result<Self, StoreError> {
        let columns = Column::of(&plan.definition);
        let files = format::open(dir, &headings(&plan.definition, &columns))?;
        Ok(Self { plan, columns, files, last: None })
    }
    /// Writes the row of a run.
    ///
    /// # Errors
    /// A file cannot be written.
    pub(super) fn add(&mut self, job: Job, record: &Record) -> Result<(), StoreError> {
        let definition = &self.plan.definition;
        let cells = match self.last.take() {
            Some((combination, cells)) if combination == job.combination => cells,
            _ => {
                let values = definition.combinations().values(job.combination);
                self.columns.iter().map(|column| column.cell(&definition.axes, &values)).collect()
            }
        };
        let row: Vec<_> = cells.iter().cloned().chain(row(definition, job, record)).collect();
        self.files.iter_mut().try_for_each(|file| file.row(&row))?;
        self.last = Some((job.combination, cells));
        Ok(())
    }
    /// The whole files.
    ///
    /// # Errors
    /// One cannot be written.
    pub(super) fn finish(self) -> Result<Vec<Staged>, StoreError> {
        self.files.into_iter().map(Rows::finish).collect()
    }
}

/// The columns of the table: what the combination is, which run, what became of it.
fn headings(definition: &Definition, columns: &[Column]) -> Vec<Heading> {
    let fixed = [("repetition", Kind::Whole), ("seed", Kind::Natural), ("status", Kind::Text)];
    let figures = definition.figures.iter().map(|figure| (figure.column(), Kind::from(figure.unit())));
    let run = (fixed.into_iter().map(|(name, kind)| (name.to_owned(), kind))).chain(figures);
    let run = run.chain([("run".to_owned(), Kind::Text)]).map(|(name, kind)| Heading { name, kind });
    columns.iter().map(|column| column.heading.clone()).chain(run).collect()
}

/// What stands below [`headings`] behind the combination's cells.
fn row(definition: &Definition, job: Job, record: &Record) -> Vec<Cell> {
    let mut row = vec![Cell::Whole(job.repetition.into()), Cell::Whole(job.seed.into()), Cell::text(record.status())];
    for figure in &definition.figures {
        let value = record.figures.get(figure.name()).copied().flatten();
        row.push(value.map_or(Cell::Nothing, |value| Cell::of(value, figure.unit())));
    }
    row.push(Cell::text(job.key.to_string()));
    row
}

/// A CSV file under its temporary name.
pub(in crate::study) struct Table {
    writer: Writer<Staged>,
    path: PathBuf,
}

impl Table {
    pub(in crate::study) fn create(dir: &Path, name: &str) -> Result<Self, StoreError> {
        Ok(Self::of(Staged::create(dir, name)?))
    }
    pub(super) fn of(file: Staged) -> Self {
        let path = file.path().to_owned();
        Self { writer: Writer::from_writer(file), path }
    }
    pub(in crate::study) fn row(&mut self, cells: impl Iterator<Item = String>) -> Result<(), StoreError> {
        let written = self.writer.write_record(cells);
        written.map_err(|error| self.error(io::Error::other(error)))
    }
    pub(in crate::study) fn finish(self) -> Result<Staged, StoreError> {
        let path = self.path;
        let error = |error: csv::IntoInnerError<_>| ExportError::Write { path, source: error.into_error() };
        Ok(self.writer.into_inner().map_err(error)?)
    }
    fn error(&self, source: io::Error) -> StoreError {
        ExportError::Write { path: self.path.clone(), source }.into()
    }
}
