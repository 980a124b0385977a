//! When a disturbance turns: the beginnings and ends of its bursts, one after the other.
//!
//! Only the next one is ever known, so that a disturbance which never ends needs no more room than one that comes once.

use crate::sim::fault::window::Window;
use crate::time::Time;

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
    /// As seen at `now`, before the cycle of this number begins: a burst that should go on begins next.
    pub fn from(window: Window, now: Time, cycle: u64) -> Self {
        let mut turns = Self::new(window);
        let over = |turn| match turn {
            Turn::Time(at) => at <= now.ticks(),
            Turn::Cycle(at) => at <= cycle as i64,
        };
        let bursts = match window {
            Window::Always => return turns,
            Window::Cycles(bursts) | Window::Time(bursts) => bursts,
        };
        let at = if matches!(window, Window::Time(_)) { now.ticks() } else { cycle as i64 };
        if let (Some(every), true) = (bursts.every, at > bursts.from) {
            turns.burst = ((at - bursts.from) / every) as u64;
        }
        // It may be over already.
        let ended = Self { on: true, ..turns }.next();
        if ended.is_some_and(over) {
            turns.burst += 1;
        }
        turns
    }
    /// Its window.
    pub const fn window(&self) -> Window {
        self.window
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
    fn in_the_middle_of_a_window_the_burst_that_goes_on_begins_next() {
        let bursts = Bursts { from: 4, length: Some(3), every: Some(8), times: Some(2) };
        let next = [0, 4, 6, 7, 11, 12, 14, 15, 99].map(|cycle| {
            let turns = Turns::from(Window::Cycles(bursts), Time::ZERO, cycle);
            turns.next().map(|turn| (turns.burst(), turn))
        });
        let (first, second) = (Some((0, Turn::Cycle(4))), Some((1, Turn::Cycle(12))));
        assert_eq!(next, [first, first, first, second, second, second, second, None, None]);
        let once = Turns::from(Window::Time(Bursts::once(4, None)), Time::from_ticks(100), 0);
        assert_eq!(once.next(), Some(Turn::Time(4)));
    }

    #[test]
    fn what_has_no_end_turns_once() {
        assert_eq!(turns(Window::Always), [(Turn::Time(0), true)]);
        assert_eq!(turns(Window::Cycles(Bursts::once(9, None))), [(Turn::Cycle(9), true)]);
    }
}
