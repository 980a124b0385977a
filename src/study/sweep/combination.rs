//! Combination: one value of every axis.

use super::axis::Axis;

/// All combinations of some axes, by number; the last axis changes fastest. Without axes there is one.
#[derive(Clone, Copy, Debug)]
pub struct Combinations<'a> {
    axes: &'a [Axis],
}

impl<'a> Combinations<'a> {
    /// Those of `axes`.
    pub const fn new(axes: &'a [Axis]) -> Self {
        Self { axes }
    }
    /// How many there are.
    pub fn len(self) -> u64 {
        self.axes.iter().fold(1, |product, axis| product.saturating_mul(axis.len() as u64))
    }
    /// Whether there is none: an axis has no value.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }
    /// Numbers of the axes' values in the combination `number`.
    pub fn values(self, mut number: u64) -> Vec<usize> {
        let mut values = vec![0; self.axes.len()];
        for (value, axis) in values.iter_mut().zip(self.axes).rev() {
            let length = axis.len() as u64;
            (*value, number) = ((number % length) as usize, number / length);
        }
        values
    }
    /// Keys and values of the combination `number`, as overrides have them, in the order of the axes.
    pub fn sets(self, number: u64) -> Vec<(String, String)> {
        let values = self.values(number);
        let of_axis = |(axis, value): (&Axis, usize)| {
            let pairs = axis.keys.iter().cloned().zip(axis.values[value].iter().cloned());
            pairs.collect::<Vec<_>>()
        };
        self.axes.iter().zip(values).flat_map(of_axis).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::scenario::tree::Place;

    fn axis(key: &str, values: &[&str]) -> Axis {
        let values: Vec<_> = values.iter().map(|&value| vec![value.to_owned()]).collect();
        let places = vec![Place::Missing; values.len()];
        Axis { name: key.to_owned(), keys: vec![key.to_owned()], values, labels: None, place: Place::Missing, places }
    }

    #[test]
    fn the_last_axis_changes_fastest() {
        let axes = [axis("a.x", &["1", "2"]), axis("b.y", &["p", "q", "r"])];
        let all = Combinations::new(&axes);
        let text = |number| {
            let sets = all.sets(number);
            sets.iter().map(|(key, value)| format!("{key}={value}")).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(all.len(), 6);
        assert_eq!(
            (0..6).map(text).collect::<Vec<_>>(),
            ["a.x=1 b.y=p", "a.x=1 b.y=q", "a.x=1 b.y=r", "a.x=2 b.y=p", "a.x=2 b.y=q", "a.x=2 b.y=r"]
        );
        assert_eq!((Combinations::new(&[]).len(), Combinations::new(&[]).sets(0)), (1, Vec::new()));
    }
}
