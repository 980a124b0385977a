//! Distribution: what a histogram picture needs, as plain data from whoever counted.

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
    /// Per link.
    pub links: Vec<LinkLatencies>,
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

    /// Counts in `columns` equal columns between `lo` and `hi`; a bin wider than a column is shared out evenly.
    pub(super) fn columns(&self, lo: f64, hi: f64, columns: usize) -> Vec<f64> {
        let mut counts = vec![0.0; columns];
        let width = (hi - lo) / columns as f64;
        let column = |value: f64| (((value - lo) / width).floor().max(0.0) as usize).min(columns - 1);
        for &(from, to, n) in self.bins.iter().filter(|bin| bin.2 > 0) {
            let (first, last) = (column(from), column(to));
            if first == last {
                counts[first] += n as f64;
                continue;
            }
            for (index, count) in counts.iter_mut().enumerate().take(last + 1).skip(first) {
                let left = lo + index as f64 * width;
                let overlap = (to.min(left + width) - from.max(left)).max(0.0);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_keep_every_count() {
        let bins = vec![(0.0, 1.0, 5), (1.0, 1.0, 7), (1.0, 4.0, 30), (9.0, 10.0, 1)];
        let distribution = Distribution { bins, ..Distribution::default() };
        assert_eq!(distribution.range(), Some((0.0, 10.0)));
        for columns in [1, 3, 10, 64] {
            let total: f64 = distribution.columns(0.0, 10.0, columns).iter().sum();
            assert!((total - 43.0).abs() < 1e-9, "{columns} columns hold {total}");
        }
        assert_eq!(Distribution::default().range(), None);
    }
}
