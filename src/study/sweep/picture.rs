//! Picture: what the pictures of a sweep show.
//!
//! | file | when |
//! |---|---|
//! | `curve_<figure>.svg` | an axis has several values: the one with the most, numbers first, is from left to right |
//! | `heat_<figure>.svg` | exactly two axes have several values |
//! | `cumulative_<figure>.svg` | combinations have several repetitions |

use super::parameter::Column;
use super::plan::{Fate, Plan};
use super::row::Row;
use super::sample::Sample;
use super::store::StoreError;
use crate::study::figure::Figure;
use crate::study::plot::sweep::{Cell, Cumulative, Curve, Curves, Heat, Parameter, Point, Sheet, Steps};
use crate::study::statistics::interval::Interval;

/// Most rows and columns of a heat map that can still be told apart.
const CELLS: usize = 400;

/// A mean and its bounds, as far as there are any.
type Mean = (Option<f64>, Option<(f64, f64)>);

/// What is known of one combination.
#[derive(Clone, Default)]
struct Told {
    /// Per figure.
    means: Vec<Mean>,
    bad: bool,
}

/// What the pictures are drawn from, gathered combination by combination.
pub(super) struct Gallery<'a> {
    plan: &'a Plan,
    told: Vec<Option<Told>>,
    /// The combinations whose distributions are drawn.
    outlined: Vec<u64>,
    /// Per figure.
    distributions: Vec<Vec<Steps>>,
}

impl<'a> Gallery<'a> {
    /// Before any combination was looked at.
    pub(super) fn new(plan: &'a Plan) -> Self {
        let run = |fate: &Fate| matches!(fate, Fate::Run(_));
        let run: Vec<u64> = (0..).zip(&plan.fates).filter(|(_, fate)| run(fate)).map(|(number, _)| number).collect();
        let count = run.len().min(Cumulative::MOST);
        let outlined = (0..count).map(|part| run[part * (run.len() - 1) / (count.max(2) - 1)]).collect();
        let distributions = vec![Vec::new(); plan.definition.figures.len()];
        Self { plan, told: vec![None; plan.fates.len()], outlined, distributions }
    }
    /// Whether the distributions of this combination are drawn.
    pub(super) fn outlines(&self, combination: u64) -> bool {
        self.outlined.contains(&combination)
    }
    /// Takes what a combination came to.
    pub(super) fn add(&mut self, row: Row<'_>) {
        let bounds = |interval: Interval| (interval.low, interval.high);
        let mean = |sample: &Sample<'_>| (sample.moments.mean(), sample.moments.interval().map(bounds));
        let means = row.samples.iter().map(mean).collect();
        self.told[row.combination as usize] = Some(Told { means, bad: row.failed + row.broken > 0 });
        if self.outlines(row.combination) {
            for (all, sample) in self.distributions.iter_mut().zip(row.samples) {
                all.push(Steps { label: label(self.plan, row.combination, None), points: sample.outline });
            }
        }
    }
    /// Draws all pictures: the names of their files and their texts.
    ///
    /// # Errors
    /// The library fails.
    pub(super) fn draw(self) -> Result<Vec<(String, String)>, StoreError> {
        let mut pictures = Vec::new();
        let Self { plan, told, distributions, .. } = self;
        for (number, (figure, steps)) in plan.definition.figures.iter().zip(distributions).enumerate() {
            let of_figure = OfFigure { plan, told: &told, number, sheet: sheet(plan, figure) };
            let cumulative = of_figure.cumulative(steps);
            let drawn = [
                ("curve", of_figure.curves().map(|curves| curves.draw())),
                ("heat", of_figure.heat().map(|heat| heat.draw())),
                ("cumulative", cumulative.map(|cumulative| cumulative.draw())),
            ];
            for (kind, drawn) in drawn {
                let file = format!("{kind}_{}.svg", figure.name().replace('.', "_"));
                match drawn {
                    None => {}
                    Some(Ok(text)) => pictures.push((file, text)),
                    Some(Err(reason)) => return Err(StoreError::Plot { file, reason }),
                }
            }
        }
        Ok(pictures)
    }
}

fn sheet(plan: &Plan, figure: &Figure) -> Sheet {
    Sheet {
        sweep: plan.definition.name.clone(),
        base: plan.definition.base.clone(),
        figure: figure.name().to_owned(),
        unit: figure.unit().text().to_owned(),
        runs: plan.jobs().count() as u64,
        confidence: plan.definition.confidence.to_string(),
    }
}

/// The values of all axes with several values but one, in words.
fn label(plan: &Plan, combination: u64, without: Option<usize>) -> String {
    let axes = &plan.definition.axes;
    let values = plan.definition.combinations().values(combination);
    let varying = (0..axes.len()).filter(|&axis| axes[axis].len() > 1 && Some(axis) != without);
    let words: Vec<_> =
        varying.map(|axis| format!("{} = {}", axes[axis].name, axes[axis].label(values[axis]))).collect();
    words.join(", ")
}

/// One figure of a sweep.
struct OfFigure<'a> {
    plan: &'a Plan,
    told: &'a [Option<Told>],
    /// Number of the figure.
    number: usize,
    sheet: Sheet,
}

impl OfFigure<'_> {
    /// Numbers of the axes with several values.
    fn varying(&self) -> Vec<usize> {
        let axes = &self.plan.definition.axes;
        (0..axes.len()).filter(|&axis| axes[axis].len() > 1).collect()
    }
    fn parameter(&self, axis: usize) -> Parameter {
        Column::picture(&self.plan.definition.axes, axis)
    }
    fn curves(&self) -> Option<Curves> {
        let axes = &self.plan.definition.axes;
        let has_numbers = |number: usize| self.parameter(number).numbers.is_some();
        let rank = |&number: &usize| (has_numbers(number), axes[number].len(), usize::MAX - number);
        let across = self.varying().into_iter().max_by_key(rank)?;
        let mut curves: Vec<Curve> = Vec::new();
        for (combination, told) in (0..).zip(self.told) {
            let Some((Some(mean), bounds)) = told.as_ref().map(|told| told.means[self.number]) else { continue };
            let value = self.plan.definition.combinations().values(combination)[across];
            let label = label(self.plan, combination, Some(across));
            let point = Point { value, mean, bounds };
            match curves.iter_mut().find(|curve| curve.label == label) {
                Some(curve) => curve.points.push(point),
                None => curves.push(Curve { label, points: vec![point] }),
            }
        }
        let x = self.parameter(across);
        for curve in &mut curves {
            curve.points.sort_by(|one, other| x.place(one.value).total_cmp(&x.place(other.value)));
        }
        (!curves.is_empty()).then(|| Curves { sheet: self.sheet.clone(), x, curves })
    }
    fn heat(&self) -> Option<Heat> {
        let axes = &self.plan.definition.axes;
        let [y, x] = self.varying().try_into().ok()?;
        // The axis with more values is from left to right.
        let (x, y) = if axes[x].len() < axes[y].len() { (y, x) } else { (x, y) };
        if axes[x].len() > CELLS || axes[y].len() > CELLS {
            return None;
        }
        let mut cells = vec![None; axes[x].len() * axes[y].len()];
        for (combination, told) in (0..).zip(self.told) {
            let values = self.plan.definition.combinations().values(combination);
            let cell = |told: &Told| Cell { mean: told.means[self.number].0, fails: told.bad };
            cells[values[y] * axes[x].len() + values[x]] = told.as_ref().map(cell);
        }
        let fails = "a run breaks an expectation of the scenario, or breaks off".to_owned();
        Some(Heat { sheet: self.sheet.clone(), x: self.parameter(x), y: self.parameter(y), fails, cells })
    }
    fn cumulative(&self, steps: Vec<Steps>) -> Option<Cumulative> {
        let steps: Vec<_> = steps.into_iter().filter(|steps| !steps.points.is_empty()).collect();
        let several = steps.iter().any(|steps| steps.points.len() > 1);
        several.then(|| Cumulative { sheet: self.sheet.clone(), steps, of: self.plan.combinations_to_run() })
    }
}
