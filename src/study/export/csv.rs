//! CSV: cycles, slaves, links and events as tables for spreadsheets and data frames.
//!
//! The first line names the columns, with their units; a cell without value is empty. Times are exact decimals
//! ([`Decimal`]), states are words, LEDs two words, red/green, addresses, counters, `xist1` and `xist2` are decimal numbers, `g1_zsw` is
//! hexadecimal (`0x1000`). Long runs are thinned by [`Thinning`]; `events.csv` keeps its first 100 000 rows. Both are
//! stated in `summary.json` with the number of rows left out.

use std::fmt::Write as _;

use super::decimal::Decimal;
use super::staged::{ExportError, Staged};
use super::thinning::Thinning;
use super::{Export, Exporter, Target};
use crate::study::histogram::Histograms;
use crate::study::row::{CycleRow, EventRow, LinkRow, Sink, SlaveRow};
use crate::study::scenario::CsvTable;
use crate::study::summary::Summary;
use crate::time::Span;

/// Tables of all rows.
pub const EXPORTER: Exporter =
    Exporter { name: "csv", what: "tables of cycles, slaves, links and events", files: names, every, open };

/// Rows of `events.csv` that are kept.
pub const EVENT_ROWS: u64 = 100_000;

const CYCLES: &str = "cycles.csv";
const SLAVES: &str = "slaves.csv";
const LINKS: &str = "links.csv";
const EVENTS: &str = "events.csv";

fn every() -> Vec<String> {
    [CYCLES, SLAVES, LINKS, EVENTS].map(str::to_owned).into()
}

/// A column of a table: its title and how a row's cell is written.
struct Column<R>(&'static str, fn(&R, &mut Cell));

#[rustfmt::skip]
const CYCLE_COLUMNS: &[Column<CycleRow>] = &[
    Column("cycle", |row, cell| cell.put(row.cycle)),
    Column("t0_ns", |row, cell| cell.put(Decimal::ns(row.t0.since_zero()))),
    Column("gc_jitter_ns", |row, cell| cell.put(Decimal::ns(row.gc_jitter))),
    Column("t_dp_us", |row, cell| cell.us(row.t_dp)),
    Column("t_dp_deviation_ns", |row, cell| cell.ns(row.t_dp_deviation)),
    Column("t_dx_us", |row, cell| cell.us(row.t_dx)),
    Column("latch_skew_ns", |row, cell| cell.ns(row.latch_skew)),
    Column("skew_steps", |row, cell| cell.steps(row.skew_counts)),
    Column("retries", |row, cell| cell.put(row.retries)),
    Column("acyclic_us", |row, cell| cell.us(row.acyclic)),
    Column("spare_us", |row, cell| cell.us(row.spare)),
];

#[rustfmt::skip]
const SLAVE_COLUMNS: &[Column<SlaveRow>] = &[
    Column("cycle", |row, cell| cell.put(row.cycle)),
    Column("t0_ns", |row, cell| cell.put(Decimal::ns(row.t0.since_zero()))),
    Column("slave", |row, cell| cell.put(row.slave)),
    Column("state", |row, cell| cell.put(row.state)),
    Column("phase", |row, cell| cell.put(row.phase)),
    Column("pll", |row, cell| cell.put(row.pll)),
    Column("pll_error_ns", |row, cell| cell.ns(row.pll_error)),
    Column("period_us", |row, cell| cell.us(row.period)),
    Column("window_ns", |row, cell| cell.ns(row.window)),
    Column("latch_offset_ns", |row, cell| cell.ns(row.latch_offset)),
    Column("mls", |row, cell| cell.put(row.mls)),
    Column("sls", |row, cell| cell.put(row.sls)),
    Column("life_counter", |row, cell| cell.put(row.life_counter)),
    Column("clock_counter", |row, cell| cell.put(row.clock_counter)),
    Column("g1_zsw", |row, cell| cell.put(format_args!("{:#06X}", row.g1_zsw))),
    Column("xist1", |row, cell| cell.put(row.xist1)),
    Column("xist2", |row, cell| cell.put(row.xist2)),
    Column("leds", |row, cell| cell.put(row.leds)),
];

#[rustfmt::skip]
const LINK_COLUMNS: &[Column<LinkRow>] = &[
    Column("cycle", |row, cell| cell.put(row.cycle)),
    Column("publisher", |row, cell| cell.put(row.publisher)),
    Column("subscriber", |row, cell| cell.put(row.subscriber)),
    Column("wire_ns", |row, cell| cell.put(Decimal::ns(row.wire))),
    Column("publish_ns", |row, cell| cell.put(Decimal::ns(row.publish))),
    Column("age_ns", |row, cell| cell.ns(row.age)),
];

#[rustfmt::skip]
const EVENT_COLUMNS: &[Column<EventRow>] = &[
    Column("at_ns", |row, cell| cell.put(Decimal::ns(row.at.since_zero()))),
    Column("cycle", |row, cell| cell.put(row.cycle)),
    Column("station", |row, cell| cell.put(row.station)),
    Column("event", |row, cell| cell.put(row.what)),
];

/// The text of one cell, reused from cell to cell.
#[derive(Default)]
struct Cell(String);

impl Cell {
    fn put(&mut self, value: impl core::fmt::Display) {
        // A String takes everything.
        let _ = write!(self.0, "{value}");
    }
    fn ns(&mut self, span: Option<Span>) {
        self.some(span.map(Decimal::ns));
    }
    fn us(&mut self, span: Option<Span>) {
        self.some(span.map(Decimal::us));
    }
    fn steps(&mut self, steps: Option<f64>) {
        if let Some(steps) = steps {
            self.put(format_args!("{steps:.6}"));
        }
    }
    fn some(&mut self, value: Option<impl core::fmt::Display>) {
        if let Some(value) = value {
            self.put(value);
        }
    }
}

/// One file of rows.
struct Table<R: 'static> {
    columns: &'static [Column<R>],
    /// Gone after the first error.
    writer: Option<csv::Writer<Staged>>,
    error: Option<ExportError>,
    cell: Cell,
}

impl<R> Table<R> {
    fn new(file: Staged, columns: &'static [Column<R>]) -> Self {
        let writer = csv::WriterBuilder::new().buffer_capacity(1 << 16).from_writer(file);
        let mut table = Self { columns, writer: Some(writer), error: None, cell: Cell::default() };
        table.write(|writer, _| writer.write_record(columns.iter().map(|column| column.0)));
        table
    }
    /// Writes one row; after an error, nothing.
    fn row(&mut self, row: &R) {
        let columns = self.columns;
        self.write(|writer, cell| {
            for column in columns {
                cell.0.clear();
                (column.1)(row, cell);
                writer.write_field(&cell.0)?;
            }
            writer.write_record(None::<&[u8]>)
        });
    }
    /// Lets `write` write and keeps its error.
    fn write(&mut self, write: impl FnOnce(&mut csv::Writer<Staged>, &mut Cell) -> csv::Result<()>) {
        let Some(writer) = &mut self.writer else { return };
        if let Err(error) = write(writer, &mut self.cell) {
            self.error = Some(writer.get_ref().error(error.into()));
            self.writer = None;
        }
    }
    fn close(self) -> Result<Staged, ExportError> {
        let Some(writer) = self.writer else { return Err(self.error.expect("a table without writer has an error")) };
        let path = writer.get_ref().path().to_owned();
        writer.into_inner().map_err(|error| ExportError::Write { path, source: error.into_error() })
    }
}

/// A table that long runs thin, if it is wanted.
type Thinned<R> = Option<(Table<R>, Thinning)>;

/// All tables of one run.
struct Tables {
    cycles: Thinned<CycleRow>,
    slaves: Thinned<SlaveRow>,
    links: Thinned<LinkRow>,
    events: Option<Table<EventRow>>,
    events_seen: u64,
}

/// The file of a table.
const fn file(table: CsvTable) -> &'static str {
    match table {
        CsvTable::Cycles => CYCLES,
        CsvTable::Slaves => SLAVES,
        CsvTable::Links => LINKS,
        CsvTable::Events => EVENTS,
    }
}

fn names(target: &Target<'_>) -> Vec<String> {
    target.tables.iter().map(|&table| file(table).to_owned()).collect()
}

fn open(target: &Target<'_>) -> Result<Box<dyn Export>, ExportError> {
    let (slaves, links) = (target.layout.slaves().len(), target.layout.links().len());
    let events = target.tables.contains(&CsvTable::Events);
    Ok(Box::new(Tables {
        cycles: thinned(target, CsvTable::Cycles, CYCLE_COLUMNS, 1)?,
        slaves: thinned(target, CsvTable::Slaves, SLAVE_COLUMNS, slaves)?,
        links: thinned(target, CsvTable::Links, LINK_COLUMNS, links)?,
        events: if events { Some(Table::new(Staged::create(target.dir, EVENTS)?, EVENT_COLUMNS)) } else { None },
        events_seen: 0,
    }))
}

/// Begins `table` if it is wanted; it has `rows` rows per cycle.
fn thinned<R>(
    target: &Target<'_>,
    table: CsvTable,
    columns: &'static [Column<R>],
    rows: usize,
) -> Result<Thinned<R>, ExportError> {
    if !target.tables.contains(&table) {
        return Ok(None);
    }
    let name = file(table);
    let thinning = Thinning::new(name, target.rows, target.cycles, rows as u64);
    Ok(Some((Table::new(Staged::create(target.dir, name)?, columns), thinning)))
}

/// Writes `row` of `cycle` if it is not thinned out.
fn put<R>(table: &mut Thinned<R>, cycle: u64, row: &R) {
    if let Some((table, thinning)) = table
        && thinning.keeps(cycle)
    {
        table.row(row);
    }
}

impl Tables {
    fn thinnings(&mut self) -> impl Iterator<Item = &mut Thinning> {
        let cycles = self.cycles.as_mut().map(|table| &mut table.1);
        let slaves = self.slaves.as_mut().map(|table| &mut table.1);
        let links = self.links.as_mut().map(|table| &mut table.1);
        [cycles, slaves, links].into_iter().flatten()
    }
}

impl Sink for Tables {
    fn cycle(&mut self, row: &CycleRow) {
        put(&mut self.cycles, row.cycle, row);
    }
    fn slave(&mut self, row: &SlaveRow) {
        put(&mut self.slaves, row.cycle, row);
    }
    fn link(&mut self, row: &LinkRow) {
        put(&mut self.links, row.cycle, row);
    }
    fn event(&mut self, row: &EventRow) {
        self.thinnings().for_each(|thinning| thinning.event(row.cycle));
        if let Some(events) = &mut self.events
            && self.events_seen < EVENT_ROWS
        {
            events.row(row);
        }
        self.events_seen += 1;
    }
}

impl Export for Tables {
    fn close(mut self: Box<Self>, _: &Histograms, summary: &mut Summary) -> Result<Vec<Staged>, ExportError> {
        summary.thinning = self.thinnings().map(|thinning| thinning.clone()).collect();
        summary.events_left_out = self.events.as_ref().map_or(0, |_| self.events_seen.saturating_sub(EVENT_ROWS));
        let cycles = self.cycles.map(|table| table.0.close());
        let slaves = self.slaves.map(|table| table.0.close());
        let links = self.links.map(|table| table.0.close());
        [cycles, slaves, links, self.events.map(Table::close)].into_iter().flatten().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::sample;

    fn read(files: Vec<Staged>, name: &str) -> (Vec<String>, Vec<Vec<String>>) {
        let file = files.into_iter().find(|file| file.path().ends_with(name)).unwrap();
        let mut reader = csv::Reader::from_path(file.place().unwrap()).unwrap();
        let header = reader.headers().unwrap().iter().map(str::to_owned).collect();
        let rows = reader.records().map(|row| row.unwrap().iter().map(str::to_owned).collect()).collect();
        (header, rows)
    }
    fn written(rows: u64, cycles: u64, feed: impl Fn(&mut dyn Export)) -> (tempfile::TempDir, Vec<Staged>, Summary) {
        let dir = tempfile::tempdir().unwrap();
        let layout = sample::layout();
        let mut tables =
            open(&Target { dir: dir.path(), layout: &layout, cycles, rows, tables: CsvTable::EVERY }).unwrap();
        feed(tables.as_mut());
        let mut summary = sample::summary();
        let files = tables.close(&Histograms::new(&layout), &mut summary).unwrap();
        (dir, files, summary)
    }

    #[test]
    fn every_cell_is_what_the_row_says() {
        let feed = |tables: &mut dyn Export| {
            tables.event(&sample::event(7));
            tables.cycle(&sample::cycle(7));
            tables.slave(&sample::slave(7, 3));
            tables.link(&sample::link(7));
        };
        for (name, header, row) in [
            (
                CYCLES,
                "cycle t0_ns gc_jitter_ns t_dp_us t_dp_deviation_ns t_dx_us latch_skew_ns skew_steps retries acyclic_us spare_us",
                "7|7000000.000|-0.083|1000.000167|0.167|449.000000|90.000|0.250000|1||300.000000",
            ),
            (
                SLAVES,
                "cycle t0_ns slave state phase pll pll_error_ns period_us window_ns latch_offset_ns mls sls life_counter \
                 clock_counter g1_zsw xist1 xist2 leds",
                "7|7000000.000|3|DATA_EXCH|5 operation|locked|-42.000|1000.000000|1000.000|45.000|3|4|0|10|0x1000|4294967295|17|dark/bright",
            ),
            (LINKS, "cycle publisher subscriber wire_ns publish_ns age_ns", "7|3|5|21000.000|400000.000|750000.000"),
            (EVENTS, "at_ns cycle station event", "7001000.000|7|5|fault 0F04"),
        ] {
            let (_dir, files, _) = written(1_000, 100, feed);
            let (titles, rows) = read(files, name);
            assert_eq!(titles, header.split_whitespace().collect::<Vec<_>>());
            assert_eq!(rows, [row.split('|').collect::<Vec<_>>()]);
        }
    }

    #[test]
    fn a_long_run_is_thinned_and_says_so() {
        let (_dir, files, summary) = written(1_000, 4_000, |tables| {
            for cycle in 0..4_000 {
                tables.cycle(&sample::cycle(cycle));
                tables.slave(&sample::slave(cycle, 3));
                tables.slave(&sample::slave(cycle, 5));
            }
        });
        let strides: Vec<_> = summary.thinning.iter().map(|table| (table.file, table.stride_cycles)).collect();
        assert_eq!(strides, [(CYCLES, 4), (SLAVES, 8), (LINKS, 4)]);
        let (_, rows) = read(files, CYCLES);
        assert_eq!(rows.len() as u64, 512 + (4_000 - 512) / 4);
        assert_eq!(summary.thinning[0].rows_left_out, 4_000 - rows.len() as u64);
        assert_eq!(rows[513][0], "516");
    }

    #[test]
    fn events_beyond_the_cap_are_counted() {
        let (_dir, files, summary) = written(10, 10, |tables| {
            (0..EVENT_ROWS + 5).for_each(|_| tables.event(&sample::event(0)));
        });
        assert_eq!(summary.events_left_out, 5);
        assert_eq!(read(files, EVENTS).1.len() as u64, EVENT_ROWS);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_told_with_the_path() {
        let dir = tempfile::tempdir().unwrap();
        let mut table = Table::new(Staged::full(dir.path(), LINKS), LINK_COLUMNS);
        (0..10_000).for_each(|cycle| table.row(&sample::link(cycle)));
        let error = table.close().unwrap_err();
        assert!(
            error.to_string().starts_with(&format!("cannot write {}", dir.path().join(LINKS).display())),
            "{error}"
        );
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
        let short = Table::new(Staged::full(dir.path(), LINKS), LINK_COLUMNS);
        assert!(short.close().is_err());
    }
}
