//! Parameter: the columns of tables that tell of which combination a row is.

use super::axis::{Axis, plain};
use super::cell::{Cell, Heading, Kind};
use super::definition::Definition;
use crate::study::plot::sweep::Parameter;
use crate::study::quantity::Measure;

/// A column of tables.
#[derive(Clone, PartialEq, Debug)]
pub struct Column {
    /// Its name, with the unit if it has one, `master_t_dp_ms`, and what all values are.
    pub heading: Heading,
    /// Number of the axis.
    axis: usize,
    /// Number of the key among the axis' keys; none for its labels.
    key: Option<usize>,
    /// The unit of all values, that of the first one; none if they are no numbers with a unit.
    unit: Option<Measure>,
}

/// The name of a column for values of the key `name` in `unit`, which may be empty.
pub(in crate::study) fn named(name: &str, unit: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let name: String = name.replace('#', "").chars().map(plain).collect();
    let unit = unit.replace('/', "_per_").replace('%', "percent");
    if unit.is_empty() { name } else { format!("{name}_{unit}") }
}

impl Column {
    /// The columns of a sweep: of each axis its labels, if it has some, then its keys.
    pub fn of(definition: &Definition) -> Vec<Self> {
        let of_axis = |(number, axis): (usize, &Axis)| {
            let labels = axis.labels.is_some().then(|| Self::new(&axis.name, number, None, axis));
            let keys = axis.keys.iter().enumerate();
            labels
                .into_iter()
                .chain(keys.map(|(key, name)| Self::new(name, number, Some(key), axis)))
                .collect::<Vec<_>>()
        };
        definition.axes.iter().enumerate().flat_map(of_axis).collect()
    }
    fn new(name: &str, number: usize, key: Option<usize>, axis: &Axis) -> Self {
        let heading = Heading { name: String::new(), kind: Kind::Text };
        let mut column = Self { heading, axis: number, key, unit: None };
        let first = Measure::read(column.text(axis, 0)).filter(|first| !first.unit.is_empty());
        let fits = |first: &Measure| {
            let all = (0..axis.len()).map(|value| Measure::read(column.text(axis, value)));
            all.into_iter().all(|value| value.is_some_and(|value| value.is_like(*first)))
        };
        column.unit = first.filter(fits);
        let texts = (0..axis.len()).map(|value| column.text(axis, value));
        let kind = column.unit.map_or_else(|| Kind::of(&texts), |_| Kind::Number);
        column.heading = Heading { name: named(name, column.unit.map_or("", |unit| unit.unit)), kind };
        column
    }
    fn text<'a>(&self, axis: &'a Axis, value: usize) -> &'a str {
        self.key.map_or_else(|| axis.label(value), |key| plain(&axis.values[value][key]))
    }
    /// The axis of this number as that of a picture: its labels, or its first key's values.
    pub fn picture(axes: &[Axis], number: usize) -> Parameter {
        let of = &axes[number];
        let column = Self::new(&of.name, number, of.labels.is_none().then_some(0), of);
        let labels: Vec<_> = (0..of.len()).map(|value| of.label(value).to_owned()).collect();
        let measures: Option<Vec<_>> = labels.iter().map(|label| Measure::read(label)).collect();
        let measures = measures.filter(|all| all.iter().all(|measure| measure.is_like(all[0])));
        let numbers = measures.map(|all| all.iter().map(|measure| measure.value_in(all[0])).collect());
        let unit = column.unit.map_or_else(String::new, |unit| format!(" [{}]", unit.unit));
        Parameter { name: format!("{}{unit}", of.name), labels, numbers }
    }
    /// What stands in the column for these numbers of the axes' values.
    pub fn cell(&self, axes: &[Axis], values: &[usize]) -> Cell {
        let text = self.text(&axes[self.axis], values[self.axis]);
        match self.unit.and_then(|unit| Some((Measure::read(text)?, unit))) {
            Some((value, unit)) => {
                Cell::Number(value.decimal_in(unit).unwrap_or_else(|| value.value_in(unit).to_string()))
            }
            None => self.heading.kind.read(text).unwrap_or_else(|| Cell::text(text)),
        }
    }
}
