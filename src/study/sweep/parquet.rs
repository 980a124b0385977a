//! Parquet: the rows of the results in columns of their kind, for tools that read tables of millions of rows.
//!
//! Rows are kept until a row group is full, so that the memory does not depend on how many there are; only the footer,
//! which names the row groups, grows with them. Nothing in the file tells when, where or on how many threads it was
//! written.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::Type;

use super::cell::{Cell, Heading, Kind};
use super::format::{Rows, Sheet};
use super::store::StoreError;
use crate::study::export::{ExportError, Staged};

/// Rows of a row group. Model: a column of numbers then takes 640 KiB until it is written, and each group is worth the
/// reading.
const GROUP: usize = 65_536;
/// Who wrote the file, in the form that the format asks for.
const CREATED_BY: &str = concat!("isodp version ", env!("CARGO_PKG_VERSION"));

/// A Parquet file under its temporary name.
struct Parquet {
    writer: SerializedFileWriter<Staged>,
    path: PathBuf,
    columns: Vec<(String, Box<dyn Column>)>,
    /// Rows that are kept.
    rows: usize,
    /// Rows of a row group.
    group: usize,
}

/// Begins the file.
///
/// # Errors
/// It cannot be written.
pub(super) fn open(file: Staged, headings: &[Heading]) -> Result<Sheet, StoreError> {
    Ok(Box::new(Parquet::create(file, headings, GROUP)?))
}

impl Parquet {
    fn create(file: Staged, headings: &[Heading], group: usize) -> Result<Self, StoreError> {
        let path = file.path().to_owned();
        let (stored, columns): (Vec<_>, Vec<_>) = headings.iter().map(|heading| column(heading.kind)).unzip();
        let names = headings.iter().map(|heading| heading.name.clone());
        let columns = names.clone().zip(columns).collect();
        let writer = begin(file, names.zip(stored)).map_err(|error| failed(&path, error))?;
        Ok(Self { writer, path, columns, rows: 0, group })
    }
    /// Writes the rows that are kept as a row group.
    fn flush(&mut self) -> Result<(), ParquetError> {
        if self.rows == 0 {
            return Ok(());
        }
        let mut group = self.writer.next_row_group()?;
        for (_, column) in &mut self.columns {
            let mut writer = group.next_column()?.ok_or(ParquetError::EOF("there is no such column".to_owned()))?;
            column.write(&mut writer)?;
            writer.close()?;
        }
        group.close()?;
        self.rows = 0;
        Ok(())
    }
}

/// Begins the file with these columns. Every one takes nulls, as CSV takes empty cells.
fn begin(
    file: Staged,
    columns: impl Iterator<Item = (String, Stored)>,
) -> Result<SerializedFileWriter<Staged>, ParquetError> {
    let field = |(name, (physical, logical)): (String, Stored)| {
        let field = Type::primitive_type_builder(&name, physical).with_logical_type(logical);
        field.with_repetition(Repetition::OPTIONAL).build().map(Arc::new)
    };
    let schema = Type::group_type_builder("results").with_fields(columns.map(field).collect::<Result<_, _>>()?);
    let properties = WriterProperties::builder().set_created_by(CREATED_BY.to_owned()).build();
    SerializedFileWriter::new(file, Arc::new(schema.build()?), Arc::new(properties))
}

/// What went wrong with the file: what the system says, if it was that.
fn failed(path: &Path, error: ParquetError) -> StoreError {
    let source = match error {
        ParquetError::External(error) => error.downcast::<io::Error>().map_or_else(io::Error::other, |error| *error),
        error => io::Error::other(error),
    };
    ExportError::Write { path: path.to_owned(), source }.into()
}

impl Rows for Parquet {
    fn row(&mut self, cells: &[Cell]) -> Result<(), StoreError> {
        for ((name, column), cell) in self.columns.iter_mut().zip(cells) {
            if column.put(cell).is_none() {
                let source = io::Error::other(format!("\"{cell}\" is not of the kind of the column {name}"));
                return Err(ExportError::Write { path: self.path.clone(), source }.into());
            }
        }
        self.rows += 1;
        if self.rows == self.group { self.flush().map_err(|error| failed(&self.path, error)) } else { Ok(()) }
    }
    fn finish(mut self: Box<Self>) -> Result<Staged, StoreError> {
        let flushed = self.flush();
        let Self { writer, path, .. } = *self;
        flushed.and_then(|()| writer.into_inner()).map_err(|error| failed(&path, error))
    }
}

/// The cells of one column that are not written yet.
trait Column {
    /// Takes a cell; none if it is not of the column's kind.
    fn put(&mut self, cell: &Cell) -> Option<()>;
    /// Writes all and forgets them.
    fn write(&mut self, writer: &mut SerializedColumnWriter<'_>) -> Result<(), ParquetError>;
}

/// Cells as values of `T`.
struct Chunk<T: DataType> {
    read: fn(&Cell) -> Option<T::T>,
    values: Vec<T::T>,
    /// Per row 1 if there is a value, 0 if there is none.
    levels: Vec<i16>,
}

impl<T: DataType> Chunk<T> {
    fn of(read: fn(&Cell) -> Option<T::T>) -> Box<dyn Column> {
        Box::new(Self { read, values: Vec::new(), levels: Vec::new() })
    }
}
impl<T: DataType> Column for Chunk<T> {
    fn put(&mut self, cell: &Cell) -> Option<()> {
        let value = if *cell == Cell::Nothing { None } else { Some((self.read)(cell)?) };
        self.levels.push(value.is_some().into());
        self.values.extend(value);
        Some(())
    }
    fn write(&mut self, writer: &mut SerializedColumnWriter<'_>) -> Result<(), ParquetError> {
        writer.typed::<T>().write_batch(&self.values, Some(&self.levels), None)?;
        self.values.clear();
        self.levels.clear();
        Ok(())
    }
}

/// How values are stored, and what they mean where that is more.
type Stored = (Physical, Option<LogicalType>);

/// How a column of this kind is stored, and such a column.
fn column(kind: Kind) -> (Stored, Box<dyn Column>) {
    match kind {
        Kind::Whole => (
            (Physical::INT64, None),
            Chunk::<Int64Type>::of(|cell| match cell {
                Cell::Whole(whole) => i64::try_from(*whole).ok(),
                _ => None,
            }),
        ),
        Kind::Natural => (
            (Physical::INT64, Some(LogicalType::integer(64, false))),
            // The format has no unsigned type of its own: the same bits, told to be without a sign.
            Chunk::<Int64Type>::of(|cell| match cell {
                Cell::Whole(whole) => u64::try_from(*whole).ok().map(u64::cast_signed),
                _ => None,
            }),
        ),
        Kind::Number => (
            (Physical::DOUBLE, None),
            Chunk::<DoubleType>::of(|cell| match cell {
                Cell::Number(text) => text.parse().ok(),
                _ => None,
            }),
        ),
        Kind::Truth => (
            (Physical::BOOLEAN, None),
            Chunk::<BoolType>::of(|cell| match cell {
                Cell::Truth(truth) => Some(*truth),
                _ => None,
            }),
        ),
        Kind::Text => (
            (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            Chunk::<ByteArrayType>::of(|cell| match cell {
                Cell::Text(text) => Some(ByteArray::from(text.as_str())),
                _ => None,
            }),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::file::metadata::RowGroupMetaData;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;
    use std::fs::File;

    fn headings() -> Vec<Heading> {
        let kinds = [Kind::Whole, Kind::Natural, Kind::Number, Kind::Truth, Kind::Text];
        kinds.map(|kind| Heading { name: format!("{kind:?}"), kind }).into()
    }
    /// A row in which every third cell is missing, another one each time.
    fn row(number: i64) -> Vec<Cell> {
        let cells = [
            Cell::Whole((-number).into()),
            Cell::Whole((u64::MAX - number as u64).into()),
            Cell::Number(format!("{number}.125")),
            Cell::Truth(number % 2 == 0),
            Cell::text(format!("row {number}")),
        ];
        let known = |(column, cell)| if (number + column) % 3 == 0 { Cell::Nothing } else { cell };
        (0..).zip(cells).map(known).collect()
    }
    fn field(heading: &Heading, cell: &Cell) -> Field {
        match cell {
            Cell::Nothing => Field::Null,
            Cell::Whole(whole) if heading.kind == Kind::Natural => Field::ULong(*whole as u64),
            Cell::Whole(whole) => Field::Long(*whole as i64),
            Cell::Number(text) => Field::Double(text.parse().unwrap()),
            Cell::Truth(truth) => Field::Bool(*truth),
            Cell::Text(text) => Field::Str(text.clone()),
        }
    }
    /// The rows of each group of a file of so many rows, in groups of 100, after every cell was looked at.
    fn groups(rows: i64) -> Vec<i64> {
        let dir = tempfile::tempdir().unwrap();
        let headings = headings();
        let file = Staged::create(dir.path(), "rows.parquet").unwrap();
        let mut parquet = Box::new(Parquet::create(file, &headings, 100).unwrap());
        for number in 0..rows {
            parquet.row(&row(number)).unwrap();
            assert!(parquet.rows < 100, "a full group is written at once");
        }
        let path = parquet.finish().unwrap().place().unwrap();
        let reader = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
        let mut read = reader.get_row_iter(None).unwrap();
        for number in 0..rows {
            let read: Vec<_> =
                read.next().unwrap().unwrap().into_columns().into_iter().map(|(_, field)| field).collect();
            let expected: Vec<_> =
                headings.iter().zip(&row(number)).map(|(heading, cell)| field(heading, cell)).collect();
            assert_eq!(read, expected, "row {number}");
        }
        assert!(read.next().is_none());
        assert_eq!(reader.metadata().file_metadata().created_by(), Some(CREATED_BY));
        reader.metadata().row_groups().iter().map(RowGroupMetaData::num_rows).collect()
    }

    #[test]
    fn rows_come_in_groups_of_bounded_size_and_none_is_lost() {
        assert_eq!(groups(0), [0; 0]);
        assert_eq!(groups(1), [1]);
        assert_eq!(groups(100), [100]);
        assert_eq!(groups(250), [100, 100, 50]);
    }

    #[test]
    fn a_cell_of_another_kind_is_an_error_and_no_null() {
        let dir = tempfile::tempdir().unwrap();
        for (at, cell, said) in [
            (0, Cell::Number("0.5".to_owned()), "\"0.5\" is not of the kind of the column Whole"),
            (
                0,
                Cell::Whole(i128::from(i64::MAX) + 1),
                "\"9223372036854775808\" is not of the kind of the column Whole",
            ),
            (1, Cell::Whole(-1), "\"-1\" is not of the kind of the column Natural"),
            (2, Cell::Whole(1), "\"1\" is not of the kind of the column Number"),
            (3, Cell::text("yes"), "\"yes\" is not of the kind of the column Truth"),
            (4, Cell::Truth(true), "\"true\" is not of the kind of the column Text"),
        ] {
            let mut parquet = open(Staged::create(dir.path(), "rows.parquet").unwrap(), &headings()).unwrap();
            let mut cells = row(1);
            cells[at] = cell;
            let error = parquet.row(&cells).unwrap_err().to_string();
            assert!(error.contains("rows.parquet") && error.ends_with(said), "{error}");
        }
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0, "nothing stays");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_told_as_that() {
        let dir = tempfile::tempdir().unwrap();
        let parquet = Parquet::create(Staged::full(dir.path(), "rows.parquet"), &headings(), 2).unwrap();
        let mut parquet: Sheet = Box::new(parquet);
        let written = (0..1_000).try_for_each(|number| parquet.row(&row(number)));
        let error = written.and_then(|()| parquet.finish().map(drop)).unwrap_err().to_string();
        assert!(error.ends_with("rows.parquet: No space left on device (os error 28)"), "{error}");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0, "nothing stays");
    }
}
