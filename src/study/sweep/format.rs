//! Format: the files that have the rows of the results, each in its own way.

use std::path::Path;

use super::cell::{Cell, Heading};
use super::results::Table;
use super::store::StoreError;
use crate::study::export::Staged;

/// Takes the rows of the results into a file that has its temporary name.
pub(super) trait Rows {
    /// Writes a row: a cell for each heading.
    ///
    /// # Errors
    /// The file cannot be written.
    fn row(&mut self, cells: &[Cell]) -> Result<(), StoreError>;
    /// The whole file.
    ///
    /// # Errors
    /// It cannot be written.
    fn finish(self: Box<Self>) -> Result<Staged, StoreError>;
}

/// One file of the results.
pub(super) type Sheet = Box<dyn Rows>;

/// One way to write rows.
pub(super) struct Format {
    /// The file's name.
    file: &'static str,
    open: fn(Staged, &[Heading]) -> Result<Sheet, StoreError>,
}

/// Every format of the results. One line here is all that a new one needs.
const FORMATS: &[Format] = &[
    Format { file: "results.csv", open: csv },
    #[cfg(feature = "parquet")]
    Format { file: "results.parquet", open: super::parquet::open },
];

/// Begins the files of all formats in `dir`.
///
/// # Errors
/// One cannot be written.
pub(super) fn open(dir: &Path, headings: &[Heading]) -> Result<Vec<Sheet>, StoreError> {
    FORMATS.iter().map(|format| (format.open)(Staged::create(dir, format.file)?, headings)).collect()
}

fn csv(file: Staged, headings: &[Heading]) -> Result<Sheet, StoreError> {
    let mut table = Table::of(file);
    table.row(headings.iter().map(|heading| heading.name.clone()))?;
    Ok(Box::new(table))
}

impl Rows for Table {
    fn row(&mut self, cells: &[Cell]) -> Result<(), StoreError> {
        Self::row(self, cells.iter().map(Cell::to_string))
    }
    fn finish(self: Box<Self>) -> Result<Staged, StoreError> {
        Self::finish(*self)
    }
}
