//! Thinning: which cycles of a long run a table keeps, by a rule that is known before the run.
//!
//! A cycle k is kept if k < 512, or k is a multiple of the stride, or an event came in one of the cycles k-32 to k.
//! The stride is the smallest power of two with which the run's cycles fit into the table's limit of rows. What events
//! add is limited to as many rows again; after that only the first two rules hold. So a table has at most twice its
//! limit of rows and those of 512 cycles.

use serde::Serialize;

/// The rule for one table, and what it has done so far.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Thinning {
    /// The table's file.
    pub file: &'static str,
    /// Every how many cycles one is kept; 1 if all are.
    pub stride_cycles: u64,
    /// Cycles from the beginning that are all kept.
    pub first_cycles: u64,
    /// Cycles that are kept from one with an event on, this one not counted.
    pub cycles_after_event: u64,
    /// Rows that were written.
    pub rows_written: u64,
    /// Rows that were left out.
    pub rows_left_out: u64,
    /// Rows that may still come because of events.
    #[serde(skip)]
    extra: u64,
    /// The last cycle that is kept because of an event, and one more.
    #[serde(skip)]
    until: u64,
    /// The cycle that was decided last.
    #[serde(skip)]
    decided: Option<(u64, bool)>,
}

impl Thinning {
    /// Cycles from the beginning that are all kept.
    pub const FIRST: u64 = 512;
    /// Cycles that are kept after one with an event.
    pub const AFTER_EVENT: u64 = 32;

    /// The rule for a table of at most `limit` rows, before events, in a run of `cycles` with `rows` rows in each.
    pub fn new(file: &'static str, limit: u64, cycles: u64, rows: u64) -> Self {
        let fitting = (limit / rows.max(1)).max(1);
        let stride = cycles.div_ceil(fitting).max(1).next_power_of_two();
        Self {
            file,
            stride_cycles: stride,
            first_cycles: Self::FIRST,
            cycles_after_event: Self::AFTER_EVENT,
            rows_written: 0,
            rows_left_out: 0,
            extra: limit,
            until: 0,
            decided: None,
        }
    }

    /// An event came in `cycle`.
    pub fn event(&mut self, cycle: u64) {
        self.until = self.until.max(cycle.saturating_add(Self::AFTER_EVENT + 1));
    }

    /// Whether a row of `cycle` is kept. Asked for every row; all rows of a cycle get the same answer.
    pub fn keeps(&mut self, cycle: u64) -> bool {
        let keep = match self.decided {
            Some((decided, keep)) if decided == cycle => keep,
            _ => self.decide(cycle),
        };
        self.decided = Some((cycle, keep));
        let by_event = keep && !self.by_number(cycle);
        self.extra = self.extra.saturating_sub(u64::from(by_event));
        self.rows_written += u64::from(keep);
        self.rows_left_out += u64::from(!keep);
        keep
    }

    fn decide(&self, cycle: u64) -> bool {
        self.by_number(cycle) || (cycle < self.until && self.extra > 0)
    }
    fn by_number(&self, cycle: u64) -> bool {
        cycle < Self::FIRST || cycle.is_multiple_of(self.stride_cycles)
    }
}

/// One line for people: the rule and what it left out.
impl core::fmt::Display for Thinning {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { file, rows_left_out, .. } = self;
        if *rows_left_out == 0 {
            return write!(f, "{file}: every cycle");
        }
        write!(
            f,
            "{file}: cycles 0 to {}, one in {}, {} after an event; {rows_left_out} rows left out",
            Self::FIRST - 1,
            self.stride_cycles,
            Self::AFTER_EVENT
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(thinning: &mut Thinning, cycles: core::ops::Range<u64>) -> Vec<u64> {
        cycles.filter(|&cycle| thinning.keeps(cycle)).collect()
    }

    #[test]
    fn the_stride_is_the_smallest_power_of_two_that_fits() {
        for (limit, cycles, rows, stride) in [
            (1_000, 1_000, 1, 1),
            (1_000, 1_001, 1, 2),
            (1_000, 4_001, 1, 8),
            (1_000, 1_000, 8, 8),
            (1_000, 0, 0, 1),
            (1, 1_000_000, 122, 1 << 20),
        ] {
            assert_eq!(Thinning::new("t", limit, cycles, rows).stride_cycles, stride, "{limit} {cycles} {rows}");
        }
    }

    #[test]
    fn a_short_run_is_kept_whole() {
        let mut thinning = Thinning::new("t.csv", 1_000, 1_000, 1);
        assert_eq!(kept(&mut thinning, 0..1_000).len(), 1_000);
        assert_eq!((thinning.rows_written, thinning.rows_left_out), (1_000, 0));
        assert_eq!(thinning.to_string(), "t.csv: every cycle");
    }

    #[test]
    fn the_beginning_the_grid_and_what_follows_an_event_are_kept() {
        let mut thinning = Thinning::new("t.csv", 1_000, 16_000, 1);
        assert_eq!(kept(&mut thinning, 0..1_000).len(), 512 + 31);
        let expected: Vec<u64> = (1_003..=1_035).chain([1_040, 1_056]).collect();
        assert!(kept(&mut thinning, 1_000..1_003).is_empty());
        thinning.event(1_003);
        assert_eq!(kept(&mut thinning, 1_003..1_060), expected);
        assert_eq!(
            thinning.to_string(),
            format!("t.csv: cycles 0 to 511, one in 16, 32 after an event; {} rows left out", thinning.rows_left_out)
        );
        assert_eq!(thinning.rows_written + thinning.rows_left_out, 1_060);
    }

    #[test]
    fn events_in_every_cycle_do_not_fill_the_disk_and_no_cycle_is_torn() {
        let (limit, rows) = (100, 3);
        let mut thinning = Thinning::new("t.csv", limit, 100_000, rows);
        let mut written = 0;
        for cycle in 0..100_000 {
            thinning.event(cycle);
            let kept = (0..rows).filter(|_| thinning.keeps(cycle)).count() as u64;
            assert!(kept == 0 || kept == rows, "cycle {cycle} is torn");
            written += kept;
        }
        assert!(written <= 2 * limit + (Thinning::FIRST + 1) * rows, "{written}");
        assert_eq!(thinning.rows_written, written);
        assert_eq!(thinning.rows_left_out, 300_000 - written);
    }
}
