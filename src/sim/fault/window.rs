//! When a disturbance acts: from a moment on, for a while, again and again, so many times.
//!
//! A window counts in true time or in the cycles of the network. A burst is one stretch of it, from its first tick or
//! cycle up to, and without, its end.

use crate::time::{Span, Time};

/// When a disturbance acts.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Window {
    /// All the time.
    #[default]
    Always,
    /// In these cycles.
    Cycles(Bursts),
    /// At these instants (ticks of true time).
    Time(Bursts),
}

/// Stretches of equal length at equal distances on an axis of cycles or ticks.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Bursts {
    /// Where the first one begins, at least 0.
    pub from: i64,
    /// How long each is, at least 1; none for one that never ends.
    pub length: Option<i64>,
    /// Distance from one's beginning to the next one's, at least `length`; none for a single one.
    pub every: Option<i64>,
    /// How many there are, at least 1; none where they never end.
    pub times: Option<u64>,
}

impl Bursts {
    /// One stretch from `from` on.
    pub const fn once(from: i64, length: Option<i64>) -> Self {
        Self { from, length, every: None, times: None }
    }

    /// Number of the burst, from 0, that `at` belongs to.
    pub const fn burst(&self, at: i64) -> Option<u64> {
        if at < self.from {
            return None;
        }
        let since = at - self.from;
        let (number, inside) = match self.every {
            Some(every) => (since / every, since % every),
            None => (0, since),
        };
        let number = number as u64;
        let ended = matches!(self.length, Some(length) if inside >= length);
        let over = matches!(self.times, Some(times) if number >= times);
        if ended || over { None } else { Some(number) }
    }
    /// Where the burst of this number begins, if there is one.
    pub fn begin(&self, number: u64) -> Option<i64> {
        if number > 0 && self.every.is_none() || self.times.is_some_and(|times| number >= times) {
            return None;
        }
        let number = i64::try_from(number).ok()?;
        self.from.checked_add(self.every.unwrap_or(0).checked_mul(number)?)
    }
    /// Where the burst of this number ends, if there is one and it ends.
    pub fn end(&self, number: u64) -> Option<i64> {
        self.begin(number)?.checked_add(self.length?)
    }
    /// Where the last burst ends; none where they go on for ever.
    pub fn last_end(&self) -> Option<i64> {
        match (self.every, self.times) {
            (None, _) => self.end(0),
            (Some(_), times) => self.end(times?.saturating_sub(1)),
        }
    }
}

impl Window {
    /// Number of the burst, from 0, that goes on at `now` in the cycle of this number.
    pub const fn burst(&self, now: Time, cycle: u64) -> Option<u64> {
        match self {
            Self::Always => Some(0),
            Self::Cycles(bursts) => bursts.burst(cycle as i64),
            Self::Time(bursts) => bursts.burst(now.ticks()),
        }
    }
    /// Whether it acts at `now` in the cycle of this number.
    pub const fn contains(&self, now: Time, cycle: u64) -> bool {
        self.burst(now, cycle).is_some()
    }
    /// When its last burst is over, with cycles of length `t_dp`; none for one that goes on for ever.
    pub fn over(&self, t_dp: Span) -> Option<Time> {
        match self {
            Self::Always => None,
            Self::Cycles(bursts) => Some(Time::from_ticks(t_dp.ticks().checked_mul(bursts.last_end()?)?)),
            Self::Time(bursts) => bursts.last_end().map(Time::from_ticks),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of the bursts at 0 to 29, `.` for none.
    fn drawn(bursts: Bursts) -> String {
        (0..30).map(|at| bursts.burst(at).map_or('.', |n| char::from_digit(n as u32, 10).unwrap())).collect()
    }

    #[test]
    fn bursts_are_where_they_are_drawn() {
        let one = Bursts::once(4, Some(3));
        assert_eq!(drawn(one), "....000.......................");
        assert_eq!(drawn(Bursts { length: None, ..one }), "....00000000000000000000000000");
        assert_eq!(drawn(Bursts { every: Some(8), ..one }), "....000.....111.....222.....33");
        assert_eq!(drawn(Bursts { every: Some(8), times: Some(2), ..one }), "....000.....111...............");
        assert_eq!(drawn(Bursts { every: Some(3), times: Some(3), ..one }), "....000111222.................");
    }

    #[test]
    fn beginnings_and_ends_are_those_of_the_drawing() {
        for (every, times) in [(None, None), (Some(8), None), (Some(8), Some(2)), (Some(3), Some(3)), (None, Some(1))] {
            let bursts = Bursts { from: 4, length: Some(3), every, times };
            for number in 0..4 {
                let (begin, end) = (bursts.begin(number), bursts.end(number));
                assert_eq!(begin.map(|begin| begin + 3), end);
                if let Some(begin) = begin {
                    assert_eq!(bursts.burst(begin), Some(number), "{bursts:?}");
                    assert_ne!(bursts.burst(begin - 1), Some(number));
                    assert_eq!([begin + 2, begin + 3].map(|at| bursts.burst(at) == Some(number)), [true, false]);
                }
            }
            let last = bursts.last_end();
            assert_eq!(last.is_none(), every.is_some() && times.is_none());
            if let Some(last) = last {
                assert!(bursts.burst(last - 1).is_some() && (last..last + 100).all(|at| bursts.burst(at).is_none()));
            }
        }
        assert_eq!(Bursts::once(0, None).last_end(), None);
    }

    #[test]
    fn a_window_counts_cycles_or_time() {
        let bursts = Bursts::once(12_000, Some(12_000));
        let us = |us| Time::ZERO + Span::from_us(us);
        assert_eq!([0, 1, 2].map(|t| Window::Time(bursts).contains(us(t), 12_000)), [false, true, false]);
        assert_eq!([0, 12_000, 24_000].map(|c| Window::Cycles(bursts).contains(us(1), c)), [false, true, false]);
        assert!(Window::Always.contains(Time::ZERO, 0));
        assert_eq!(Window::Time(bursts).over(Span::from_ms(1)), Some(us(2)));
        assert_eq!(Window::Cycles(Bursts::once(3, Some(2))).over(Span::from_ms(1)), Some(us(5_000)));
        assert_eq!(Window::Always.over(Span::from_ms(1)), None);
    }
}
