//! Distribution: what a histogram picture needs, as plain data from whoever counted.

use super::recovery::EpisodeTimes;
use crate::wire::Address;

/// A counted quantity.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Distribution {
    /// What was counted, in the field's words: `latch skew`.
    pub title: String,
    /// Unit of every value: `ns`.
    pub unit: String,
    /// From, up to, how many; ascending, widths may differ.
    pub bins: Vec<(f64, f64, u64)>,
    /// Values to be marked, with their labels: `p99.9`, `max`.
    pub marks: Vec<(String, f64)>,
    /// How many values were counted.
    pub count: u64,
}

/// The three latencies of one link (Model: D26), each in µs.
#[derive(Clone, PartialEq, Debug)]
pub struct LinkLatencies {
    /// Whose data.
    pub publisher: Address,
    /// Who takes them.
    pub subscriber: Address,
    /// First bit sent by the publisher to last bit at the subscriber.
    pub wire: Distribution,
    /// Publisher's latch to last bit at the subscriber.
    pub publish: Distribution,
    /// Publisher's latch to the subscriber's T_O.
    pub age: Distribution,
}

/// Everything counted that the pictures show.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Distributions {
    /// Latch skew per cycle (ns).
    pub latch_skew: Distribution,
    /// Length of each cycle minus the nominal T_DP (ns).
    pub t_dp_deviation: Distribution,
    /// How late each late SYNCH was (µs).
    pub synch_delay: Distribution,
    /// Per link.
    pub links: Vec<LinkLatencies>,
    /// Times to faults and of recovery, by kind.
    pub episodes: Vec<EpisodeTimes>,
}

impl Distribution {
    /// Smallest and largest value of a bin that is not empty.
    pub(super) fn range(&self) -> Option<(f64, f64)> {
        let filled = self.bins.iter().filter(|bin| bin.2 > 0);
        filled.fold(None, |range, &(lo, hi, _)| {
            let (a, b) = range.unwrap_or((lo, hi));
            Some((a.min(lo), b.max(hi)))
        })
    }

    /// Width of the narrowest bin that has a width.
    fn finest(&self) -> Option<f64> {
        self.bins.iter().map(|bin| bin.1 - bin.0).filter(|&width| width > 0.0).reduce(f64::min)
    }

    /// Counts in the columns of `grid`; a bin wider than a column is shared out evenly.
    pub(super) fn columns(&self, grid: &Grid) -> Vec<f64> {
        let mut counts = vec![0.0; grid.columns];
        // A bin that ends where a column ends belongs to this column alone.
        let slack = grid.width * 1e-6;
        for &(from, to, n) in self.bins.iter().filter(|bin| bin.2 > 0) {
            let (first, last) = (grid.column(from + slack), grid.column((to - slack).max(from + slack)));
            if first == last {
                counts[first] += n as f64;
                continue;
            }
            for (index, count) in counts.iter_mut().enumerate().take(last + 1).skip(first) {
                let left = grid.left(index);
                let overlap = (to.min(left + grid.width) - from.max(left)).max(0.0);
                *count += n as f64 * overlap / (to - from);
            }
        }
        counts
    }

    /// The largest marked value, or the end of the last bin.
    pub(super) fn top(&self) -> f64 {
        let marked = self.marks.iter().map(|mark| mark.1).fold(f64::NEG_INFINITY, f64::max);
        if marked.is_finite() { marked } else { self.range().map_or(0.0, |range| range.1) }
    }
}

/// Equal columns, each a whole number of the narrowest bins, so that no column gets more bins than its neighbour.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Grid {
    lo: f64,
    width: f64,
    columns: usize,
}

impl Grid {
    /// At most `most` columns over everything that was counted; none if nothing was.
    pub(super) fn over<'a>(all: impl Iterator<Item = &'a Distribution> + Clone, most: usize) -> Option<Self> {
        let ranges = all.clone().filter_map(Distribution::range);
        let (lo, hi) = ranges.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
        let finest = all.filter_map(Distribution::finest).reduce(f64::min).unwrap_or(1.0);
        let bins = ((hi - lo) / finest).round().max(1.0);
        let width = finest * (bins / most as f64).ceil();
        let columns = (((hi - lo) / width - 1e-9).ceil() as usize).clamp(1, most);
        Some(Self { lo, width, columns })
    }
    fn column(&self, value: f64) -> usize {
        (((value - self.lo) / self.width).floor().max(0.0) as usize).min(self.columns - 1)
    }
    /// Where column `index` begins.
    pub(super) fn left(&self, index: usize) -> f64 {
        self.lo + index as f64 * self.width
    }
    /// Where the last column ends.
    pub(super) fn right(&self) -> f64 {
        self.left(self.columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_keep_every_count() {
        let bins = vec![(0.0, 1.0, 5), (1.0, 1.0, 7), (1.0, 4.0, 30), (9.0, 10.0, 1)];
        let distribution = Distribution { bins, ..Distribution::default() };
        assert_eq!(distribution.range(), Some((0.0, 10.0)));
        for columns in [1, 3, 10, 64] {
            let grid = Grid::over(std::iter::once(&distribution), columns).unwrap();
            let counts = distribution.columns(&grid);
            let total: f64 = counts.iter().sum();
            assert!((total - 43.0).abs() < 1e-9 && counts.len() <= columns, "{columns} columns hold {total}");
        }
        assert_eq!(Distribution::default().range(), None);
        assert_eq!(Grid::over(std::iter::empty(), 5), None);
    }

    #[test]
    fn columns_are_as_even_as_their_bins() {
        let bins = (0..1_000).map(|bin| (f64::from(bin), f64::from(bin + 1), 2)).collect();
        let distribution = Distribution { bins, ..Distribution::default() };
        let grid = Grid::over(std::iter::once(&distribution), 120).unwrap();
        let counts = distribution.columns(&grid);
        assert_eq!(counts.len(), 112);
        assert!(counts[..111].iter().all(|&count| (count - 18.0).abs() < 1e-9), "{counts:?}");
    }
}
