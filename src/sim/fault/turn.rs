//! When a disturbance turns: the beginnings and ends of its bursts, one after the other.
//!
//! Only the next one is ever known, so that a disturbance which never ends needs no more room than one that comes once.

use crate::sim::fault::window::Window;

/// The axis that a window counts on, with a place on it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Turn {
    /// At this instant (ticks of true time).
    Time(i64),
    /// When the cycle of this number begins.
    Cycle(i64),
}

/// Where a disturbance is in its window.
#[derive(Clone, Copy, Debug)]
pub struct Turns {
    window: Window,
    /// Number of the burst that goes on or comes next.
    burst: u64,
    on: bool,
}

impl Turns {
    /// Before the first burst.
    pub const fn new(window: Window) -> Self {
        Self { window, burst: 0, on: false }
    }
    /// Whether a burst goes on.
    pub const fn is_on(&self) -> bool {
        self.on
    }
    /// Number of the burst that goes on or comes next, from 0.
    pub const fn burst(&self) -> u64 {
        self.burst
    }
    /// Where it turns next; none where nothing changes any more.
    pub fn next(&self) -> Option<Turn> {
        let (bursts, turn): (_, fn(i64) -> Turn) = match self.window {
            // It begins with the run and has no end.
            Window::Always => return (!self.on).then_some(Turn::Time(0)),
            Window::Cycles(bursts) => (bursts, Turn::Cycle),
            Window::Time(bursts) => (bursts, Turn::Time),
        };
        let at = if self.on { bursts.end(self.burst) } else { bursts.begin(self.burst) };
        at.map(turn)
    }
    /// Leaves out every turn before this tick and before this cycle.
    pub fn skip(&mut self, tick: i64, cycle: i64) {
        while self.next().is_some_and(|turn| match turn {
            Turn::Time(at) => at < tick,
            Turn::Cycle(at) => at < cycle,
        }) {
            self.turn();
        }
    }
    /// It turns. Whether a burst begins; otherwise one ends.
    pub const fn turn(&mut self) -> bool {
        self.on = !self.on;
        if !self.on {
            self.burst += 1;
        }
        self.on
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::fault::window::Bursts;

    /// The first turns of a window, `+` for a beginning.
    fn turns(window: Window) -> Vec<(Turn, bool)> {
        let mut turns = Turns::new(window);
        std::iter::from_fn(|| Some((turns.next()?, turns.turn()))).take(6).collect()
    }

    #[test]
    fn bursts_begin_and_end_in_turn() {
        let twice = Bursts { from: 4, length: Some(3), every: Some(8), times: Some(2) };
        let expected = [(4, true), (7, false), (12, true), (15, false)];
        assert_eq!(turns(Window::Cycles(twice)), expected.map(|(at, on)| (Turn::Cycle(at), on)));
        assert_eq!(turns(Window::Time(twice)), expected.map(|(at, on)| (Turn::Time(at), on)));
    }

    #[test]
    fn bursts_without_a_gap_end_before_the_next_begins() {
        let dense = Bursts { from: 1, length: Some(2), every: Some(2), times: None };
        let expected = [(1, true), (3, false), (3, true), (5, false), (5, true), (7, false)];
        assert_eq!(turns(Window::Cycles(dense)), expected.map(|(at, on)| (Turn::Cycle(at), on)));
    }

    #[test]
    fn what_is_past_is_left_out() {
        let bursts = Bursts { from: 4, length: Some(3), every: Some(8), times: Some(2) };
        for (now, on, next) in [(0, false, Some(4)), (4, false, Some(4)), (5, true, Some(7)), (13, true, Some(15))] {
            let (mut time, mut cycles) = (Turns::new(Window::Time(bursts)), Turns::new(Window::Cycles(bursts)));
            time.skip(now, i64::MAX);
            cycles.skip(i64::MAX, now);
            assert_eq!((time.is_on(), time.next()), (on, next.map(Turn::Time)), "{now}");
            assert_eq!((cycles.is_on(), cycles.next()), (on, next.map(Turn::Cycle)), "{now}");
        }
        let mut over = Turns::new(Window::Time(bursts));
        over.skip(100, 0);
        assert_eq!((over.is_on(), over.next()), (false, None));
    }

    #[test]
    fn what_has_no_end_turns_once() {
        assert_eq!(turns(Window::Always), [(Turn::Time(0), true)]);
        assert_eq!(turns(Window::Cycles(Bursts::once(9, None))), [(Turn::Cycle(9), true)]);
    }
}
