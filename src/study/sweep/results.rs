//! Results: a row per run, with its parameters and its figures.
//!
//! | `status` | the run |
//! |---|---|
//! | `done` | has its figures; the scenario expects nothing |
//! | `passed`, `broken` | has its figures, which are as the scenario expects, or not |
//! | `failed` | has none: it broke off |
//!
//! Rows are in the order of the plan, whoever finished when, and are read from the journal one by one: the table is as
//! long as it needs to be and the memory is not.

use std::io;
use std::path::{Path, PathBuf};

use csv::Writer;

use super::definition::Definition;
use super::journal::Record;
use super::parameter::Column;
use super::plan::{Job, Plan};
use super::store::StoreError;
use crate::study::export::decimal::Decimal;
use crate::study::export::{ExportError, Staged};
use crate::study::figure::{Figure, Unit, Value};

/// File of the rows.
const FILE: &str = "results.csv";

/// The table, under its temporary name.
pub(super) struct Results<'a> {
    plan: &'a Plan,
    columns: Vec<Column>,
    table: Table,
    /// The combination of the last row and its cells.
    last: Option<(u64, Vec<String>)>,
}

impl<'a> Results<'a> {
    /// Begins it in `dir`.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(super) fn create(dir: &Path, plan: &'a Plan) -> Result<Self, StoreError> {
        let mut table = Table::create(dir, FILE)?;
        let columns = Column::of(&plan.definition);
        let names = columns.iter().map(|column| column.name.clone());
        let figures = plan.definition.figures.iter().map(Figure::column);
        let fixed = ["repetition", "seed", "status"].map(str::to_owned);
        table.row(names.chain(fixed).chain(figures).chain(["run".to_owned()]))?;
        Ok(Self { plan, columns, table, last: None })
    }
    /// Writes the row of a run.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(super) fn add(&mut self, job: Job, record: &Record) -> Result<(), StoreError> {
        let definition = &self.plan.definition;
        let cells = match self.last.take() {
            Some((combination, cells)) if combination == job.combination => cells,
            _ => {
                let values = definition.combinations().values(job.combination);
                self.columns.iter().map(|column| column.cell(&definition.axes, &values)).collect()
            }
        };
        self.table.row(cells.iter().cloned().chain(row(definition, job, record)))?;
        self.last = Some((job.combination, cells));
        Ok(())
    }
    /// The whole file.
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn finish(self) -> Result<Staged, StoreError> {
        self.table.finish()
    }
}

fn row(definition: &Definition, job: Job, record: &Record) -> Vec<String> {
    let mut row = vec![job.repetition.to_string(), job.seed.to_string(), record.status().to_owned()];
    for figure in &definition.figures {
        let value = record.figures.get(figure.name()).copied().flatten();
        row.push(value.map_or_else(String::new, |value| cell(value, figure.unit())));
    }
    row.push(job.key.to_string());
    row
}

/// A value in a table: exact to the picosecond where it is a time.
pub(super) fn cell(value: Value, unit: Unit) -> String {
    match (value, unit) {
        (Value::Span(span), Unit::Us) => Decimal::us(span).to_string(),
        (Value::Span(span), Unit::Ms) => Decimal::ms(span).to_string(),
        (Value::Span(span), Unit::S) => Decimal::s(span).to_string(),
        (Value::Span(span), _) => Decimal::ns(span).to_string(),
        (Value::Count(count), _) => count.to_string(),
        (Value::Truth(truth), _) => truth.to_string(),
        (Value::Steps(_) | Value::Share(_), _) => value.number(unit).to_string(),
    }
}

/// A CSV file under its temporary name.
pub(in crate::study) struct Table {
    writer: Writer<Staged>,
    path: PathBuf,
}

impl Table {
    pub(in crate::study) fn create(dir: &Path, name: &str) -> Result<Self, StoreError> {
        Ok(Self { writer: Writer::from_writer(Staged::create(dir, name)?), path: dir.join(name) })
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
