//! Pooled: of each quantity that is pooled two tables, and where it was largest.
//!
//! | file | rows |
//! |---|---|
//! | `pooled_<quantity>.csv` | one per combination: count, mean, percentiles and extremes of all cycles of all repetitions, the extremes with run and cycle |
//! | `pooled_<quantity>_bins.csv` | one per bin that holds something: its smallest and its largest value, and how many values |
//!
//! Cycles of one run are no independent draws, so that nothing has bounds here; `summary.csv` has those of figures.

use std::path::Path;

use super::cell::Cell;
use super::parameter::Column;
use super::plan::{Job, Plan};
use super::results::Table;
use super::row::Row;
use super::store::StoreError;
use crate::study::export::Staged;
use crate::study::figure::{Unit, Value};
use crate::study::pool::Pooled;
use crate::study::statistics::aggregate::Extreme;
use crate::study::statistics::pool::Pool;
use crate::time::Span;

/// The quantiles that are told, by their names (millionths).
const QUANTILES: [(&str, u32); 6] = [
    ("p50", 500_000),
    ("p90", 900_000),
    ("p99", 990_000),
    ("p99_9", 999_000),
    ("p99_99", 999_900),
    ("p99_999", 999_990),
];

/// The file names of a quantity: `slave_3_pll_error`.
pub(super) fn file_name(pooled: &Pooled) -> String {
    pooled.name().replace(['.', '-'], "_")
}

/// Both tables of one quantity, under their temporary names.
struct Tables {
    unit: Unit,
    values: Table,
    bins: Table,
    worst: Option<(Extreme, u64)>,
}

impl Tables {
    fn create(dir: &Path, pooled: &Pooled, columns: &[Column]) -> Result<Self, StoreError> {
        let (unit, name) = (Unit::from(pooled.quantity().unit), file_name(pooled));
        let parameters = || columns.iter().map(|column| column.heading.name.clone());
        let time = |name: &str| format!("{name}{}", unit.suffix());
        let mut values = Table::create(dir, &format!("pooled_{name}.csv"))?;
        let quantiles = QUANTILES.iter().map(|&(name, _)| time(name));
        let of_extreme = |name: &str| [time(name), format!("{name}_run"), format!("{name}_cycle")];
        let names = ["runs".to_owned(), "n".to_owned(), time("mean"), time("deviation")].into_iter();
        values.row(parameters().chain(names).chain(of_extreme("min")).chain(quantiles).chain(of_extreme("max")))?;
        let mut bins = Table::create(dir, &format!("pooled_{name}_bins.csv"))?;
        bins.row(parameters().chain([time("low"), time("high"), "count".to_owned()]))?;
        Ok(Self { unit, values, bins, worst: None })
    }
    fn add(&mut self, parameters: &[String], row: &Row<'_>, pool: &Pool) -> Result<(), StoreError> {
        let (unit, all) = (self.unit, pool.values());
        let time = |ticks: i64| Cell::of(Value::Span(Span::from_ticks(ticks)), unit).to_string();
        let number = |ticks: Option<f64>| ticks.map_or_else(String::new, |ticks| unit.of_grains(ticks).to_string());
        let extreme = |extreme: Option<Extreme>| match extreme {
            Some(Extreme { value, at }) => [time(value), at.run.to_string(), at.cycle.to_string()],
            None => Default::default(),
        };
        let counts = [u64::from(row.runs), all.count()].map(|count| count.to_string());
        let moments = [all.mean(), all.deviation()].map(number);
        let quantiles =
            QUANTILES.iter().map(|&(_, millionths)| pool.quantile(millionths).map_or_else(String::new, time));
        let cells = parameters.iter().cloned().chain(counts).chain(moments);
        self.values.row(cells.chain(extreme(all.min())).chain(quantiles).chain(extreme(all.max())))?;
        for bin in pool.bins() {
            let cells = [time(bin.low), time(bin.high), bin.count.to_string()];
            self.bins.row(parameters.iter().cloned().chain(cells))?;
        }
        // Of several combinations with the same extreme the first one.
        for found in [all.min(), all.max()].into_iter().flatten() {
            if self.worst.is_none_or(|(worst, _)| worst.value.unsigned_abs() < found.value.unsigned_abs()) {
                self.worst = Some((found, row.combination));
            }
        }
        Ok(())
    }
}

/// Where a quantity was farthest from zero.
pub(super) struct Worst {
    /// The quantity.
    pub(super) name: String,
    /// The value.
    pub(super) value: Span,
    /// The run that had it.
    pub(super) job: Job,
    /// In which of its cycles.
    pub(super) cycle: u64,
}

/// The tables of all quantities that are pooled.
pub(super) struct Pooling<'a> {
    plan: &'a Plan,
    columns: Vec<Column>,
    all: Vec<Tables>,
}

impl<'a> Pooling<'a> {
    /// Begins them in `dir`.
    ///
    /// # Errors
    /// A file cannot be written.
    pub(super) fn create(dir: &Path, plan: &'a Plan) -> Result<Self, StoreError> {
        let columns = Column::of(&plan.definition);
        let tables = |pooled| Tables::create(dir, pooled, &columns);
        let all = plan.definition.pools.iter().map(tables).collect::<Result<_, _>>()?;
        Ok(Self { plan, columns, all })
    }
    /// Writes what a combination came to.
    ///
    /// # Errors
    /// A file cannot be written.
    pub(super) fn add(&mut self, row: &Row<'_>) -> Result<(), StoreError> {
        let definition = &self.plan.definition;
        let values = definition.combinations().values(row.combination);
        let parameters: Vec<_> =
            self.columns.iter().map(|column| column.cell(&definition.axes, &values).to_string()).collect();
        self.all.iter_mut().zip(&row.pools).try_for_each(|(tables, pool)| tables.add(&parameters, row, pool))
    }
    /// Where each quantity was farthest from zero, as far as it had a value.
    pub(super) fn worst(&self) -> Vec<Worst> {
        let of_tables = |(pooled, tables): (&Pooled, &Tables)| {
            let (Extreme { value, at }, combination) = tables.worst?;
            let job = self.plan.jobs_in(combination).find(|job| job.key == at.run)?;
            Some(Worst { name: pooled.name().to_owned(), value: Span::from_ticks(value), job, cycle: at.cycle })
        };
        self.plan.definition.pools.iter().zip(&self.all).filter_map(of_tables).collect()
    }
    /// The whole files.
    ///
    /// # Errors
    /// One cannot be written.
    pub(super) fn finish(self) -> Result<Vec<Staged>, StoreError> {
        let both = self.all.into_iter().flat_map(|tables| [tables.values, tables.bins]);
        both.map(Table::finish).collect()
    }
}
