//! Summary: a row per combination, with what its repetitions have in common.
//!
//! | of each figure | what |
//! |---|---|
//! | `n` | repetitions with a value; those that failed or had nothing to tell are not among them |
//! | `mean`, `low`, `high` | the mean and its bounds at the sweep's confidence: Student's; of true and false, the share of the true ones with the bounds of Clopper and Pearson |
//! | `min`, `p50`, `p90`, `max` | values that runs had: the smallest, those of rank ceil(n / 2) and ceil(9 n / 10), the largest |
//! | `p50_low`, `p50_high`, `p90_low`, `p90_high` | values that runs had and that bound these at the sweep's confidence, whatever the distribution; empty where n is too small for one |
//! | `seen`, `seen_low`, `seen_high` | of a count, the share of repetitions in which it is above 0, with the bounds of Clopper and Pearson |

use std::cmp::Ordering;
use std::path::Path;

use super::journal::Journal;
use super::parameter::Column;
use super::plan::Plan;
use super::results::{Table, cell};
use super::store::StoreError;
use crate::study::export::Staged;
use crate::study::figure::{Figure, Unit, Value};
use crate::study::statistics::confidence::Confidence;
use crate::study::statistics::interval::Interval;
use crate::study::statistics::probability::Probability;
use crate::study::statistics::quantile::Ranks;
use crate::study::statistics::student::student_quantile;

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
const STATISTICS: [Statistic; 15] = [
    Statistic { name: "n", of_counts: false, of: |sample| Some(sample.values.len().to_string()) },
    Statistic { name: "mean", of_counts: false, of: |sample| number(sample.mean()) },
    Statistic { name: "low", of_counts: false, of: |sample| number(sample.interval().map(|interval| interval.low)) },
    Statistic { name: "high", of_counts: false, of: |sample| number(sample.interval().map(|interval| interval.high)) },
    Statistic { name: "min", of_counts: false, of: |sample| sample.ranked(0, 1) },
    Statistic { name: "p50", of_counts: false, of: |sample| sample.ranked(1, 2) },
    Statistic { name: "p50_low", of_counts: false, of: |sample| sample.bound(50.0, |ranks| ranks.low) },
    Statistic { name: "p50_high", of_counts: false, of: |sample| sample.bound(50.0, |ranks| ranks.high) },
    Statistic { name: "p90", of_counts: false, of: |sample| sample.ranked(9, 10) },
    Statistic { name: "p90_low", of_counts: false, of: |sample| sample.bound(90.0, |ranks| ranks.low) },
    Statistic { name: "p90_high", of_counts: false, of: |sample| sample.bound(90.0, |ranks| ranks.high) },
    Statistic { name: "max", of_counts: false, of: |sample| sample.ranked(1, 1) },
    Statistic { name: "seen", of_counts: true, of: |sample| number(sample.seen().estimate()) },
    Statistic { name: "seen_low", of_counts: true, of: |sample| number(Some(sample.seen().bounds().0)) },
    Statistic { name: "seen_high", of_counts: true, of: |sample| number(Some(sample.seen().bounds().1)) },
];

fn number(number: Option<f64>) -> Option<String> {
    number.map(|number| number.to_string())
}

/// The values of one figure in the repetitions of one combination.
pub(super) struct Sample<'a> {
    figure: &'a Figure,
    confidence: Confidence,
    /// Ascending.
    values: Vec<Value>,
}

impl<'a> Sample<'a> {
    /// A sample of these values.
    pub(super) fn new(figure: &'a Figure, confidence: Confidence, mut values: Vec<Value>) -> Self {
        values.sort_by(|one, other| one.compare(*other).unwrap_or(Ordering::Equal));
        Self { figure, confidence, values }
    }
    /// The values in the unit of the figure, ascending.
    pub(super) fn numbers(&self) -> impl Iterator<Item = f64> {
        let unit = self.figure.unit();
        self.values.iter().map(move |value| value.number(unit))
    }
    /// The mean in the unit of the figure; none without a value.
    pub(super) fn mean(&self) -> Option<f64> {
        (!self.values.is_empty()).then(|| self.numbers().sum::<f64>() / self.values.len() as f64)
    }
    /// The mean and its bounds; none of less than two values that are not true or false.
    pub(super) fn interval(&self) -> Option<Interval> {
        let (mean, count) = (self.mean()?, self.values.len());
        if self.figure.unit() == Unit::Truth {
            let (low, high) = self.seen().bounds();
            return Some(Interval { estimate: mean, low, high });
        }
        if count < 2 {
            return None;
        }
        let squares: f64 = self.numbers().map(|value| (value - mean) * (value - mean)).sum();
        let freedom = (count - 1) as f64;
        let deviation = (squares / freedom / count as f64).sqrt();
        Some(Interval::around(mean, student_quantile(freedom, self.confidence) * deviation))
    }
    /// How likely it is to be above 0, or true.
    pub(super) fn seen(&self) -> Probability {
        let seen = self.numbers().filter(|&value| value > 0.0).count();
        Probability::of(seen as u64, self.values.len() as u64, self.confidence)
    }
    /// The value of rank ceil(part / whole x n), at least 1.
    fn ranked(&self, part: usize, whole: usize) -> Option<String> {
        let rank = (self.values.len() * part).div_ceil(whole).max(1);
        self.of_rank(rank)
    }
    /// A bound of what `percent` of all runs do not exceed.
    fn bound(&self, percent: f64, of: fn(&Ranks) -> Option<u64>) -> Option<String> {
        let ranks = Ranks::new(self.values.len() as u64, percent, self.confidence)?;
        self.of_rank(of(&ranks)? as usize)
    }
    fn of_rank(&self, rank: usize) -> Option<String> {
        self.values.get(rank - 1).map(|&value| cell(value, self.figure.unit()))
    }
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

/// The rows of `plan`, in its order, as far as they are in the journal.
pub(super) fn rows<'a>(plan: &'a Plan, journal: &Journal) -> impl Iterator<Item = Result<Row<'a>, StoreError>> {
    let mut jobs = plan.jobs().peekable();
    std::iter::from_fn(move || {
        let combination = jobs.peek()?.combination;
        let mut values = vec![Vec::new(); plan.definition.figures.len()];
        let (mut runs, mut failed, mut broken) = (0, 0, 0);
        while let Some(job) = jobs.next_if(|job| job.combination == combination) {
            let record = match journal.get(job.key) {
                Ok(Some(record)) => record,
                Ok(None) => continue,
                Err(error) => return Some(Err(error.into())),
            };
            runs += 1;
            failed += u32::from(record.failure.is_some());
            broken += u32::from(record.failure.is_none() && record.is_bad());
            for (values, figure) in values.iter_mut().zip(&plan.definition.figures) {
                values.extend(record.figures.get(figure.name()).copied().flatten());
            }
        }
        let sample = |(figure, values)| Sample::new(figure, plan.definition.confidence, values);
        let samples = plan.definition.figures.iter().zip(values).map(sample).collect();
        Some(Ok(Row { combination, runs, failed, broken, samples }))
    })
}

/// Writes the summary of all runs that are in the journal under a temporary name.
///
/// # Errors
/// The file cannot be written or the journal not be read.
pub(super) fn write(dir: &Path, plan: &Plan, journal: &Journal) -> Result<Staged, StoreError> {
    let mut table = Table::create(dir, FILE)?;
    let definition = &plan.definition;
    let columns = Column::of(definition);
    let names = columns.iter().map(|column| column.name.clone()).chain(["runs", "failed", "broken"].map(str::to_owned));
    let of_figure = |figure: &Figure| {
        let column = figure.column();
        // A share has no unit, whatever it is the share of.
        let name = |statistic: &Statistic| format!("{}_{column}", statistic.name);
        told(figure).map(name).collect::<Vec<_>>()
    };
    table.row(names.chain(definition.figures.iter().flat_map(of_figure)))?;
    for row in rows(plan, journal) {
        let row = row?;
        let values = definition.combinations().values(row.combination);
        let cells = columns.iter().map(|column| column.cell(&definition.axes, &values));
        let cells = cells.chain([row.runs, row.failed, row.broken].map(|count| count.to_string()));
        let of_sample = |sample: &Sample<'_>| {
            let cell = |statistic: &Statistic| (statistic.of)(sample).unwrap_or_default();
            told(sample.figure).map(cell).collect::<Vec<_>>()
        };
        table.row(cells.chain(row.samples.iter().flat_map(of_sample)))?;
    }
    table.finish()
}

/// A count that stayed 0 in all repetitions of some combinations.
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

/// The counts that were never above 0 in some combinations, which is no proof that they never are.
///
/// # Errors
/// The journal cannot be read.
pub(super) fn never(plan: &Plan, journal: &Journal) -> Result<Vec<Never>, StoreError> {
    let figures = &plan.definition.figures;
    let mut all: Vec<Option<(usize, u64)>> = vec![None; figures.len()];
    for row in rows(plan, journal) {
        for (sample, never) in row?.samples.iter().zip(&mut all) {
            if sample.figure.unit() == Unit::Count && matches!(sample.seen(), Probability::UpperBound(_)) {
                let (combinations, runs) = never.unwrap_or((0, u64::MAX));
                *never = Some((combinations + 1, runs.min(sample.values.len() as u64)));
            }
        }
    }
    let named = figures.iter().zip(all).filter_map(|(figure, never)| Some((figure, never?)));
    let told = named.map(|(figure, (combinations, runs))| {
        let bound = Probability::of(0, runs, plan.definition.confidence).bounds().1;
        Never { figure: figure.name().to_owned(), combinations, runs, bound }
    });
    Ok(told.collect())
}

/// The statistics that are told of this figure.
fn told(figure: &Figure) -> impl Iterator<Item = &'static Statistic> {
    let counts = figure.unit() == Unit::Count;
    STATISTICS.iter().filter(move |statistic| counts || !statistic.of_counts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Span;

    fn told_of(name: &str, values: &[Value]) -> Vec<String> {
        let figure = Figure::named(name).unwrap();
        let sample = Sample::new(&figure, Confidence::USUAL, values.to_vec());
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
        assert_eq!(told[4..], ["1.000", "3.000", "", "", "5.000", "3.000", "", "5.000"]);
    }

    #[test]
    fn bounds_of_percentiles_are_values_that_were_seen() {
        // Conover's table of the sign test: of 20 the 6th and the 15th bound the median.
        let values: Vec<_> = (1..=20).map(|ns| Value::Span(Span::from_ns(ns))).collect();
        let told = told_of("latch_skew.p99", &values);
        assert_eq!(told[5..8], ["10.000", "6.000", "15.000"]);
        // 0.9^20 is 12 %: no value of 20 is above the 90 % quantile often enough.
        assert_eq!(told[8], "18.000");
        assert_eq!(told[10], "");
    }

    #[test]
    fn a_count_tells_how_likely_it_is_at_all() {
        let values: Vec<_> = (0..20).map(|run| Value::Count(if run < 5 { run + 1 } else { 0 })).collect();
        let told = told_of("faults", &values);
        near(&told[12], 0.25);
        near(&told[13], 0.086_571_469);
        near(&told[14], 0.491_045_872);
        let never = told_of("faults", &[Value::Count(0); 10]);
        assert_eq!((never[12].as_str(), never[13].as_str()), ("0", "0"));
        near(&never[14], 1.0 - 0.05_f64.powf(0.1));
    }

    #[test]
    fn nothing_is_told_of_nothing() {
        assert_eq!(told_of("latch_skew.p99", &[]), ["0", "", "", "", "", "", "", "", "", "", "", ""]);
        let one = told_of("latch_skew.p99", &[Value::Span(Span::from_ns(7))]);
        assert_eq!(one, ["1", "7", "", "", "7.000", "7.000", "", "", "7.000", "", "", "7.000"]);
        let truths = [Value::Truth(true), Value::Truth(true), Value::Truth(false), Value::Truth(true)];
        assert_eq!(told_of("slave.3.in_operation", &truths)[..2], ["4", "0.75"]);
    }
}
