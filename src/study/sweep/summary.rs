//! Summary: a row per combination, with what its repetitions have in common.
//!
//! | of each figure | what |
//! |---|---|
//! | `n` | repetitions with a value; those that failed or had nothing to tell are not among them |
//! | `mean`, `low`, `high` | the mean and its bounds at the sweep's confidence: Student's; of true and false, the share of the true ones with the bounds of Clopper and Pearson |
//! | `min`, `p50`, `p90`, `max` | values that runs had: the smallest, those of rank ceil(n / 2) and ceil(9 n / 10), the largest |
//! | `min_run`, `max_run` | the runs that had the smallest and the largest value; of several the one of the smallest key |
//! | `p50_low`, `p50_high`, `p90_low`, `p90_high` | values that runs had and that bound these at the sweep's confidence, whatever the distribution; empty where n is too small for one |
//! | `seen`, `seen_low`, `seen_high` | of a count, the share of repetitions in which it is above 0, with the bounds of Clopper and Pearson |

use std::path::Path;

use super::cell::Cell;
use super::parameter::Column;
use super::plan::Plan;
use super::results::Table;
use super::row::Row;
use super::sample::Sample;
use super::store::StoreError;
use crate::study::export::Staged;
use crate::study::figure::{Figure, Unit, Value};
use crate::study::statistics::probability::Probability;

/// File of the rows.
const FILE: &str = "summary.csv";

/// One statistic of a figure.
struct Statistic {
    name: &'static str,
    /// Whether it is one of counts alone.
    of_counts: bool,
    of: fn(&Sample<'_>) -> Option<String>,
}

/// What is told of each figure. One line here is all that a new one needs.
#[rustfmt::skip]
const STATISTICS: [Statistic; 17] = [
    Statistic { name: "n", of_counts: false, of: |sample| Some(sample.moments.count().to_string()) },
    Statistic { name: "mean", of_counts: false, of: |sample| number(sample.moments.mean()) },
    Statistic { name: "low", of_counts: false, of: |sample| number(sample.moments.interval().map(|interval| interval.low)) },
    Statistic { name: "high", of_counts: false, of: |sample| number(sample.moments.interval().map(|interval| interval.high)) },
    Statistic { name: "min", of_counts: false, of: |sample| value(sample, sample.min().map(|(value, _)| value)) },
    Statistic { name: "min_run", of_counts: false, of: |sample| sample.min().map(|(_, run)| run.to_string()) },
    Statistic { name: "p50", of_counts: false, of: |sample| value(sample, sample.percentile(50.0, |ranks| Some(ranks.estimate))) },
    Statistic { name: "p50_low", of_counts: false, of: |sample| value(sample, sample.percentile(50.0, |ranks| ranks.low)) },
    Statistic { name: "p50_high", of_counts: false, of: |sample| value(sample, sample.percentile(50.0, |ranks| ranks.high)) },
    Statistic { name: "p90", of_counts: false, of: |sample| value(sample, sample.percentile(90.0, |ranks| Some(ranks.estimate))) },
    Statistic { name: "p90_low", of_counts: false, of: |sample| value(sample, sample.percentile(90.0, |ranks| ranks.low)) },
    Statistic { name: "p90_high", of_counts: false, of: |sample| value(sample, sample.percentile(90.0, |ranks| ranks.high)) },
    Statistic { name: "max", of_counts: false, of: |sample| value(sample, sample.max().map(|(value, _)| value)) },
    Statistic { name: "max_run", of_counts: false, of: |sample| sample.max().map(|(_, run)| run.to_string()) },
    Statistic { name: "seen", of_counts: true, of: |sample| number(sample.moments.seen().estimate()) },
    Statistic { name: "seen_low", of_counts: true, of: |sample| number(Some(sample.moments.seen().bounds().0)) },
    Statistic { name: "seen_high", of_counts: true, of: |sample| number(Some(sample.moments.seen().bounds().1)) },
];

fn number(number: Option<f64>) -> Option<String> {
    number.map(|number| number.to_string())
}
fn value(sample: &Sample<'_>, value: Option<Value>) -> Option<String> {
    value.map(|value| Cell::of(value, sample.figure().unit()).to_string())
}
/// The statistics that are told of this figure.
fn told(figure: &Figure) -> impl Iterator<Item = &'static Statistic> {
    let counts = figure.unit() == Unit::Count;
    STATISTICS.iter().filter(move |statistic| counts || !statistic.of_counts)
}

/// The table, under its temporary name.
pub(super) struct Summary<'a> {
    plan: &'a Plan,
    columns: Vec<Column>,
    table: Table,
}

impl<'a> Summary<'a> {
    /// Begins it in `dir`.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(super) fn create(dir: &Path, plan: &'a Plan) -> Result<Self, StoreError> {
        let mut table = Table::create(dir, FILE)?;
        let columns = Column::of(&plan.definition);
        let names = columns.iter().map(|column| column.heading.name.clone());
        let names = names.chain(["runs", "failed", "broken"].map(str::to_owned));
        let of_figure = |figure: &Figure| {
            let column = figure.column();
            // A share has no unit, whatever it is the share of.
            let name = |statistic: &Statistic| format!("{}_{column}", statistic.name);
            told(figure).map(name).collect::<Vec<_>>()
        };
        table.row(names.chain(plan.definition.figures.iter().flat_map(of_figure)))?;
        Ok(Self { plan, columns, table })
    }
    /// Writes the row of a combination.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(super) fn add(&mut self, row: &Row<'_>) -> Result<(), StoreError> {
        let definition = &self.plan.definition;
        let values = definition.combinations().values(row.combination);
        let cells = self.columns.iter().map(|column| column.cell(&definition.axes, &values).to_string());
        let cells = cells.chain([row.runs, row.failed, row.broken].map(|count| count.to_string()));
        let of_sample = |sample: &Sample<'_>| {
            let cell = |statistic: &Statistic| (statistic.of)(sample).unwrap_or_default();
            told(sample.figure()).map(cell).collect::<Vec<_>>()
        };
        self.table.row(cells.chain(row.samples.iter().flat_map(of_sample)))
    }
    /// The whole file.
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn finish(self) -> Result<Staged, StoreError> {
        self.table.finish()
    }
}

/// A count that stayed 0 in all repetitions of some combinations, which is no proof that it always does.
pub(super) struct Never {
    /// Name of the figure.
    pub(super) figure: String,
    /// In how many combinations.
    pub(super) combinations: usize,
    /// Fewest repetitions of these with a value.
    pub(super) runs: u64,
    /// Upper bound of the probability that a run of such a combination has some: about 3 / runs (rule of three).
    pub(super) bound: f64,
}

/// The counts that were never above 0 in some combinations.
pub(super) struct NeverSeen<'a> {
    plan: &'a Plan,
    /// Per figure: in how many combinations, and in how few runs of one of them.
    counts: Vec<Option<(usize, u64)>>,
}

impl<'a> NeverSeen<'a> {
    /// Before any combination was looked at.
    pub(super) fn new(plan: &'a Plan) -> Self {
        Self { plan, counts: vec![None; plan.definition.figures.len()] }
    }
    /// Looks at a combination.
    pub(super) fn add(&mut self, row: &Row<'_>) {
        for (sample, never) in row.samples.iter().zip(&mut self.counts) {
            let seen = sample.moments.seen();
            if sample.figure().unit() == Unit::Count && matches!(seen, Probability::UpperBound(_)) {
                let (combinations, runs) = never.unwrap_or((0, u64::MAX));
                *never = Some((combinations + 1, runs.min(sample.moments.count())));
            }
        }
    }
    /// What was found.
    pub(super) fn told(self) -> Vec<Never> {
        let definition = &self.plan.definition;
        let named = definition.figures.iter().zip(self.counts).filter_map(|(figure, never)| Some((figure, never?)));
        let told = named.map(|(figure, (combinations, runs))| {
            let bound = Probability::of(0, runs, definition.confidence).bounds().1;
            Never { figure: figure.name().to_owned(), combinations, runs, bound }
        });
        told.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::statistics::confidence::Confidence;
    use crate::study::sweep::key::RunKey;
    use crate::study::sweep::sample::Gathering;
    use crate::time::Span;

    fn told_of(name: &str, values: &[Value]) -> Vec<String> {
        let figure = Figure::named(name).unwrap();
        let mut gathering = Gathering::new(&figure, Confidence::USUAL);
        for (run, &value) in (1..).zip(values) {
            gathering.add(value, RunKey(run)).unwrap();
        }
        let sample = gathering.finish(false).unwrap();
        told(&figure).map(|statistic| (statistic.of)(&sample).unwrap_or_default()).collect()
    }
    fn near(text: &str, expected: f64) {
        assert!((text.parse::<f64>().unwrap() - expected).abs() < 1e-6 * expected.abs().max(1.0), "{text}, {expected}");
    }

    #[test]
    fn a_sample_of_times_is_told_as_in_the_tables() {
        let values = [5, 1, 4, 2, 3].map(|ns| Value::Span(Span::from_ns(ns)));
        let told = told_of("latch_skew.p99", &values);
        assert_eq!(told[0], "5");
        near(&told[1], 3.0);
        // t of 4 degrees at 95 % is 2.776445, the deviation of the mean is sqrt(2.5 / 5).
        near(&told[2], 3.0 - 2.776_445_105 * 0.5_f64.sqrt());
        near(&told[3], 3.0 + 2.776_445_105 * 0.5_f64.sqrt());
        // Five values are too few for a bound of the median: all are below it once in 32.
        let run = |number: u128| RunKey(number).to_string();
        // The smallest is that of the second run, the largest that of the first.
        let (min, max) = (["1.000".to_owned(), run(2)], ["5.000".to_owned(), run(1)]);
        assert_eq!((&told[4..6], &told[12..]), (&min[..], &max[..]));
        assert_eq!(told[6..12], ["3.000", "", "", "5.000", "3.000", ""]);
    }

    #[test]
    fn bounds_of_percentiles_are_values_that_were_seen() {
        // Conover's table of the sign test: of 20 the 6th and the 15th bound the median.
        let values: Vec<_> = (1..=20).map(|ns| Value::Span(Span::from_ns(ns))).collect();
        let told = told_of("latch_skew.p99", &values);
        assert_eq!(told[6..9], ["10.000", "6.000", "15.000"]);
        // 0.9^20 is 12 %: no value of 20 is above the 90 % quantile often enough.
        assert_eq!((told[9].as_str(), told[11].as_str()), ("18.000", ""));
    }

    #[test]
    fn a_count_tells_how_likely_it_is_at_all() {
        let values: Vec<_> = (0..20).map(|run| Value::Count(if run < 5 { run + 1 } else { 0 })).collect();
        let told = told_of("faults", &values);
        near(&told[14], 0.25);
        near(&told[15], 0.086_571_469);
        near(&told[16], 0.491_045_872);
        let never = told_of("faults", &[Value::Count(0); 10]);
        assert_eq!((never[14].as_str(), never[15].as_str()), ("0", "0"));
        near(&never[16], 1.0 - 0.05_f64.powf(0.1));
    }

    #[test]
    fn nothing_is_told_of_nothing() {
        let nothing = told_of("latch_skew.p99", &[]);
        assert_eq!((nothing[0].as_str(), nothing[1..].concat().as_str()), ("0", ""));
        let one = told_of("latch_skew.p99", &[Value::Span(Span::from_ns(7))]);
        let run = RunKey(1).to_string();
        let expected = ["1", "7", "", "", "7.000", &run, "7.000", "", "", "7.000", "", "", "7.000", &run];
        assert_eq!(one, expected);
        let truths = [Value::Truth(true), Value::Truth(true), Value::Truth(false), Value::Truth(true)];
        assert_eq!(told_of("slave.3.in_operation", &truths)[..2], ["4", "0.75"]);
    }
}
