//! A deadline that is no alarm: an event in the queue stands for it.
//!
//! Only one event of a deadline counts at a time. Arming it for later than that event costs nothing until the event comes
//! and finds that there is time left.

use crate::time::{Local, Time};

/// A deadline of one station.
#[derive(Clone, Copy, Debug)]
pub(super) struct Deadline {
    /// Armed for this reading of the station's crystal.
    reading: Local,
    /// The true time of it; the end of all time where it is not armed.
    at: Time,
    /// Time of the event in the queue that counts; the end of all time where there is none.
    queued: Time,
}

/// What an event of a deadline turns out to be.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Turned {
    /// The deadline, armed for this reading.
    Due(Local),
    /// Too early: one at this time counts instead.
    Early(Time),
    /// Nothing: the deadline was disarmed, or an event before took its place.
    Void,
}

impl Deadline {
    /// Not armed.
    pub(super) const OFF: Self = Self { reading: Local::MAX, at: Time::MAX, queued: Time::MAX };

    /// Arms it for `reading`, which comes `at`, whatever it was. Whether that needs an event.
    #[inline]
    pub(super) fn arm(&mut self, reading: Local, at: Time) -> bool {
        (self.reading, self.at) = (reading, at);
        let first = at < self.queued;
        if first {
            self.queued = at;
        }
        first
    }
    /// Disarms it.
    #[inline]
    pub(super) fn disarm(&mut self) {
        self.at = Time::MAX;
    }
    /// The reading that it is armed for.
    pub(super) fn armed(&self) -> Option<Local> {
        (self.at < Time::MAX).then_some(self.reading)
    }
    /// An event of it comes `now`.
    #[inline]
    pub(super) fn turn(&mut self, now: Time) -> Turned {
        if self.queued != now {
            return Turned::Void;
        }
        self.queued = Time::MAX;
        if self.at <= now {
            self.at = Time::MAX;
            return Turned::Due(self.reading);
        }
        if self.at == Time::MAX {
            return Turned::Void;
        }
        self.queued = self.at;
        Turned::Early(self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Span;

    fn reading(us: i64) -> Local {
        Local::ZERO + Span::from_us(us)
    }
    fn instant(us: i64) -> Time {
        Time::ZERO + Span::from_us(us)
    }

    #[test]
    fn what_is_put_off_comes_once() {
        let mut deadline = Deadline::OFF;
        assert_eq!(deadline.armed(), None);
        assert!(deadline.arm(reading(10), instant(11)));
        assert!(!deadline.arm(reading(20), instant(21)), "the event at 11 is there");
        assert_eq!(deadline.armed(), Some(reading(20)));
        assert_eq!(deadline.turn(instant(11)), Turned::Early(instant(21)));
        assert_eq!(deadline.turn(instant(21)), Turned::Due(reading(20)));
        assert_eq!((deadline.armed(), deadline.turn(instant(21))), (None, Turned::Void));
    }

    #[test]
    fn what_is_brought_forward_leaves_an_event_that_does_not_count() {
        let mut deadline = Deadline::OFF;
        assert!(deadline.arm(reading(20), instant(21)) && deadline.arm(reading(10), instant(11)));
        assert_eq!(deadline.turn(instant(11)), Turned::Due(reading(10)));
        assert_eq!(deadline.turn(instant(21)), Turned::Void);
        // An earlier one, armed before the event that does not count: that one stays without a meaning.
        assert!(deadline.arm(reading(30), instant(31)));
        assert_eq!(deadline.turn(instant(31)), Turned::Due(reading(30)));
    }

    #[test]
    fn what_is_disarmed_does_not_come_and_can_be_armed_again_for_the_same_event() {
        let mut deadline = Deadline::OFF;
        assert!(deadline.arm(reading(10), instant(11)));
        deadline.disarm();
        assert_eq!(deadline.armed(), None);
        assert!(!deadline.arm(reading(10), instant(11)));
        assert_eq!(deadline.turn(instant(11)), Turned::Due(reading(10)));
        assert!(deadline.arm(reading(10), instant(11)));
        deadline.disarm();
        assert_eq!(deadline.turn(instant(11)), Turned::Void);
        assert!(deadline.arm(reading(40), instant(41)), "no event is left");
    }
}
