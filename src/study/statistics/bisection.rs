//! Bisection: how far a network can be led until it no longer holds.
//!
//! A search goes from a value that is expected to hold, `from`, towards one that is expected to fail, `to`, whichever is
//! larger: so it finds the largest value that holds or the smallest.
//!
//! ```text
//!  from    first                                                              to
//!   |--------|--------|-----------------|-----------------------------------|
//!   1. from  2. first, then twice as far each time until one fails
//!                     holds ----------- fails
//!                              |---|  3. halved until the two are neighbours
//!      .   4.  probes  .                      .         .         .         .
//! ```
//!
//! Halving never asks again where it has an answer, so it would not notice that a value far beyond holds again. The
//! probes look: evenly spread over both sides. Where one contradicts, the search is not monotone; that is reported, and
//! the answer is made safe: the failing value nearest to `from`, halved again towards what holds before it.

use super::sequential::{Tested, Verdict};

/// The values that a search can try.
pub trait Axis {
    /// A value.
    type Value: Copy + PartialOrd;
    /// Whether nothing between `a` and `b` is worth a try.
    fn neighbours(&self, a: Self::Value, b: Self::Value) -> bool;
    /// The value at `part` / `whole` of the way from `a` to `b`; none if it would be one of these.
    fn between(&self, a: Self::Value, b: Self::Value, part: u32, whole: u32) -> Option<Self::Value>;
    /// The value twice as far from `from` as `value`, but not beyond `to`.
    fn doubled(&self, from: Self::Value, value: Self::Value, to: Self::Value) -> Self::Value;
}

/// Why a search cannot be.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the first value to try is not after the beginning of the search, or it is beyond the end")]
pub struct SearchError;

/// A search. Made by [`Search::new`].
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Search<A: Axis> {
    axis: A,
    from: A::Value,
    first: A::Value,
    to: A::Value,
    probes: u32,
}

/// A value that was tried and what became of it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Point<V> {
    /// The value.
    pub value: V,
    /// The answer, with the number of runs and failures.
    pub tested: Tested,
}

/// What a search found.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Answer<V> {
    /// Neighbours: the last that holds, the first that fails.
    Band {
        /// It holds, and so does all that was tried before it.
        holds: V,
        /// It does not.
        fails: V,
    },
    /// All that was tried holds, up to the end of the search: there the limit may be far beyond.
    Everywhere,
    /// Not even the beginning of the search holds.
    Nowhere,
}

/// A value that holds beyond one that fails.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Inversion<V> {
    /// It fails.
    pub fails: V,
    /// It holds, farther on.
    pub holds: V,
}

/// The outcome of a search.
#[derive(Clone, PartialEq, Debug)]
pub struct Found<V> {
    /// The answer.
    pub answer: Answer<V>,
    /// Every value that was tried, from the beginning of the search to its end, each once.
    pub curve: Vec<Point<V>>,
    /// Every value that holds beyond one that fails, with the nearest such one; empty for a monotone property.
    pub inversions: Vec<Inversion<V>>,
}

impl<V> Found<V> {
    /// The number of runs of all values together.
    pub fn runs(&self) -> u64 {
        self.curve.iter().map(|point| point.tested.runs).sum()
    }
}

impl<A: Axis> Search<A> {
    /// A search on `axis` from `from` towards `to`, trying `first` after `from`, with `probes` probes on either side.
    ///
    /// # Errors
    /// If `first` does not lie between the ends.
    pub fn new(axis: A, from: A::Value, first: A::Value, to: A::Value, probes: u32) -> Result<Self, SearchError> {
        let way = (from < first && first <= to) || (from > first && first >= to);
        way.then_some(Self { axis, from, first, to, probes }).ok_or(SearchError)
    }

    /// Searches. `test` is never asked twice for one value.
    ///
    /// # Errors
    /// Those of `test`; the search ends there.
    pub fn run<E>(&self, test: impl FnMut(A::Value) -> Result<Tested, E>) -> Result<Found<A::Value>, E> {
        let mut curve = Curve { test, up: self.from < self.to, points: Vec::new() };
        self.bracket(&mut curve)?;
        self.halve(&mut curve)?;
        self.probe(&mut curve)?;
        self.halve(&mut curve)?;
        let answer = curve.answer();
        Ok(Found { answer, inversions: curve.inversions(), curve: curve.points })
    }

    fn bracket<F, E>(&self, curve: &mut Curve<A::Value, F>) -> Result<(), E>
    where
        F: FnMut(A::Value) -> Result<Tested, E>,
    {
        let mut holds = curve.holds(self.from)?;
        let mut value = self.first;
        let mut at_end = false;
        while holds && !at_end {
            holds = curve.holds(value)?;
            at_end = value == self.to;
            value = self.axis.doubled(self.from, value, self.to);
        }
        Ok(())
    }
    fn halve<F, E>(&self, curve: &mut Curve<A::Value, F>) -> Result<(), E>
    where
        F: FnMut(A::Value) -> Result<Tested, E>,
    {
        while let Answer::Band { holds, fails } = curve.answer() {
            let middle = self.axis.between(holds, fails, 1, 2).filter(|_| !self.axis.neighbours(holds, fails));
            let Some(middle) = middle else { break };
            curve.holds(middle)?;
        }
        Ok(())
    }
    fn probe<F, E>(&self, curve: &mut Curve<A::Value, F>) -> Result<(), E>
    where
        F: FnMut(A::Value) -> Result<Tested, E>,
    {
        let (before, beyond) = match curve.answer() {
            Answer::Band { holds, fails } => (holds, fails),
            Answer::Everywhere => (self.to, self.to),
            Answer::Nowhere => (self.from, self.from),
        };
        for part in 1..=self.probes {
            // The end of the search is the last probe beyond.
            let far =
                if part < self.probes { self.axis.between(beyond, self.to, part, self.probes) } else { Some(self.to) };
            let near = self.axis.between(self.from, before, part, self.probes + 1);
            for value in [near, far].into_iter().flatten() {
                curve.holds(value)?;
            }
        }
        Ok(())
    }
}

/// What was tried, in the order of the search's way.
struct Curve<V, F> {
    test: F,
    up: bool,
    points: Vec<Point<V>>,
}

impl<V: Copy + PartialOrd, F> Curve<V, F> {
    fn holds<E>(&mut self, value: V) -> Result<bool, E>
    where
        F: FnMut(V) -> Result<Tested, E>,
    {
        let up = self.up;
        let place = self.points.partition_point(|point| if up { point.value < value } else { point.value > value });
        if self.points.get(place).is_none_or(|point| point.value != value) {
            let tested = (self.test)(value)?;
            self.points.insert(place, Point { value, tested });
        }
        Ok(self.points[place].holds())
    }
    /// The failing value nearest to the beginning, and the one that holds before it.
    fn answer(&self) -> Answer<V> {
        match self.points.iter().position(|point| !point.holds()) {
            None => Answer::Everywhere,
            Some(0) => Answer::Nowhere,
            Some(number) => Answer::Band { holds: self.points[number - 1].value, fails: self.points[number].value },
        }
    }
    fn inversions(&self) -> Vec<Inversion<V>> {
        let mut fails = None;
        let mut found = Vec::new();
        for point in &self.points {
            match fails {
                _ if !point.holds() => fails = Some(point.value),
                Some(fails) => found.push(Inversion { fails, holds: point.value }),
                None => {}
            }
        }
        found
    }
}

impl<V> Point<V> {
    /// Whether the value holds.
    pub fn holds(&self) -> bool {
        self.tested.verdict == Verdict::Holds
    }
}

#[cfg(test)]
mod tests {
    use core::convert::Infallible;

    use super::*;

    /// Integers so far apart.
    #[derive(Clone, Copy, PartialEq, Debug)]
    struct Steps(i64);
    impl Axis for Steps {
        type Value = i64;
        fn neighbours(&self, a: i64, b: i64) -> bool {
            (a - b).abs() <= self.0
        }
        fn between(&self, a: i64, b: i64, part: u32, whole: u32) -> Option<i64> {
            let value = a + (b - a) / self.0 * i64::from(part) / i64::from(whole) * self.0;
            (value != a && value != b).then_some(value)
        }
        fn doubled(&self, from: i64, value: i64, to: i64) -> i64 {
            let doubled = 2 * value - from;
            if from < to { doubled.min(to) } else { doubled.max(to) }
        }
    }

    fn search(search: &Search<Steps>, holds: impl Fn(i64) -> bool) -> Found<i64> {
        search.run(|value| Ok::<_, Infallible>(Tested::once(holds(value)))).unwrap()
    }
    fn steps(step: i64, from: i64, first: i64, to: i64, probes: u32) -> Search<Steps> {
        Search::new(Steps(step), from, first, to, probes).unwrap()
    }
    fn tried(found: &Found<i64>) -> Vec<i64> {
        found.curve.iter().map(|point| point.value).collect()
    }

    #[test]
    fn the_largest_value_that_holds_is_found_exactly() {
        for limit in 0..200 {
            let found = search(&steps(1, 0, 3, 200, 0), |value| value <= limit);
            assert_eq!(found.answer, Answer::Band { holds: limit, fails: limit + 1 });
            assert!(found.runs() <= 16 && found.inversions.is_empty(), "{limit}: {}", found.runs());
        }
    }

    #[test]
    fn the_smallest_value_that_holds_is_found_downwards() {
        let found = search(&steps(125, 10_000, 9_875, 0, 3), |value| value >= 1_300);
        assert_eq!(found.answer, Answer::Band { holds: 1_375, fails: 1_250 });
        assert!(found.curve.is_sorted_by(|a, b| a.value > b.value), "in the order of the way");
        assert!(tried(&found).iter().all(|value| value % 125 == 0));
    }

    #[test]
    fn ends_are_told_apart_from_a_band() {
        let wide = steps(1, 0, 1, 1_000, 0);
        assert_eq!(search(&wide, |_| true).answer, Answer::Everywhere);
        assert_eq!(tried(&search(&wide, |_| true)), [0, 1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1_000]);
        let nowhere = search(&wide, |_| false);
        assert_eq!((nowhere.answer, tried(&nowhere)), (Answer::Nowhere, vec![0]));
        assert_eq!(search(&wide, |value| value < 1_000).answer, Answer::Band { holds: 999, fails: 1_000 });
        assert_eq!(search(&wide, |value| value == 0).answer, Answer::Band { holds: 0, fails: 1 });
    }

    #[test]
    fn probes_find_what_holds_again_and_what_fails_before() {
        // It fails from 100 on, but holds again in a resonance at 500 to 700.
        let again = |value: i64| value < 100 || (500..700).contains(&value);
        let blind = search(&steps(1, 0, 1, 1_000, 0), again);
        assert!(blind.inversions.is_empty());
        let seen = search(&steps(1, 0, 1, 1_000, 8), again);
        assert_eq!(seen.answer, Answer::Band { holds: 99, fails: 100 });
        assert!(seen.inversions.iter().all(|inversion| again(inversion.holds) && !again(inversion.fails)));
        assert_eq!(seen.inversions.iter().map(|inversion| inversion.holds).collect::<Vec<_>>(), [550, 662]);
        // It fails in a gap from 40 to 60 that doubling has jumped over: the safe answer is below the gap.
        let gap = |value: i64| value < 90 && !(40..=60).contains(&value);
        assert_eq!(search(&steps(1, 0, 1, 1_000, 0), gap).answer, Answer::Band { holds: 89, fails: 90 });
        let safe = search(&steps(1, 0, 1, 1_000, 3), gap);
        assert_eq!(safe.answer, Answer::Band { holds: 39, fails: 40 });
        assert!(!safe.inversions.is_empty());
    }

    #[test]
    fn no_value_is_asked_for_twice() {
        let mut asked = Vec::new();
        let found = steps(2, 0, 2, 400, 20).run(|value| {
            assert!(!asked.contains(&value), "{value}");
            asked.push(value);
            Ok::<_, Infallible>(Tested { verdict: Verdict::Fails, proven: true, runs: 7, failures: 7 })
        });
        let found = found.unwrap();
        assert_eq!((found.answer, found.runs()), (Answer::Nowhere, 7 * asked.len() as u64));
        let mut asked = Vec::new();
        let found = steps(2, 0, 2, 400, 20).run(|value| {
            assert!(!asked.contains(&value), "{value}");
            asked.push(value);
            Ok::<_, Infallible>(Tested::once(value < 123))
        });
        assert_eq!(found.unwrap().answer, Answer::Band { holds: 122, fails: 124 });
    }

    #[test]
    fn an_error_of_a_run_ends_the_search() {
        let run =
            steps(1, 0, 1, 100, 0).run(|value| if value == 8 { Err("out of disk") } else { Ok(Tested::once(true)) });
        assert_eq!(run, Err("out of disk"));
    }

    #[test]
    fn a_search_goes_one_way() {
        for (from, first, to) in [(0, 0, 9), (0, -1, 9), (0, 10, 9), (9, 10, 0), (9, 9, 0), (9, -1, 0)] {
            assert_eq!(Search::new(Steps(1), from, first, to, 0), Err(SearchError), "{from} {first} {to}");
        }
    }
}
