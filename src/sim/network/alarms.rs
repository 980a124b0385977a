//! Alarms: deadlines that a station puts off again and again, so that they seldom come.
//!
//! The slot time, the watchdog and the window of the clock are armed anew by whatever shows that all is well. As events in
//! the queue, each of them would come at its old instant and find that it has moved on. So they wait here instead. An
//! alarm that is put off keeps the reading at which it was looked at last: it cannot come before the instant of that
//! reading, and the earliest of these instants is all that the network compares with its next event.

use crate::fdl::{Outbox, Timer};
use crate::sim::crystal::Crystal;
use crate::time::{Local, Time};

/// Alarms of a station.
const KINDS: usize = Timer::ALL.len();

/// One alarm of one station.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Alarm {
    /// Armed for this reading of the station's crystal; for the end of all readings where it is not armed.
    due: Local,
    /// A reading and its true time, or an instant before that: armed for this reading or a later one, it does not come
    /// before.
    seen: (Local, Time),
}

impl Alarm {
    const OFF: Self = Self { due: Local::MAX, seen: Self::UNSEEN };
    const UNSEEN: (Local, Time) = (Local::MAX, Time::MAX);

    /// Finds out when it comes, not before `now`.
    #[inline(never)]
    fn look(&mut self, crystal: &Crystal, now: Time) -> Time {
        self.seen = if self.due == Local::MAX { Self::UNSEEN } else { (self.due, crystal.to_true(self.due).max(now)) };
        self.seen.1
    }
}

/// What one station waits for, and the crystal that it waits by.
#[derive(Clone, Debug)]
struct Waiting {
    crystal: Crystal,
    /// By number; what is no timer is never armed.
    alarms: [Alarm; Outbox::DEADLINES],
}

impl Waiting {
    /// Finds out when the alarm of this number comes, not before `now`, if that is by `limit`; otherwise an instant before
    /// which it does not come is enough.
    #[inline]
    fn look(&mut self, which: usize, limit: Time, now: Time) -> Time {
        let Self { crystal, alarms } = self;
        let alarm = &mut alarms[which];
        if alarm.due == Local::MAX {
            alarm.seen = Alarm::UNSEEN;
            return Time::MAX;
        }
        let earliest = crystal.not_before(alarm.due);
        if earliest <= limit {
            return alarm.look(crystal, now);
        }
        alarm.seen = (alarm.due, earliest);
        earliest
    }
}

/// The alarms of all stations.
#[derive(Clone, Debug)]
pub(super) struct Alarms {
    /// By the station's slot.
    all: Vec<Waiting>,
    /// For each number the slots that have ever armed theirs.
    users: [Vec<u8>; KINDS],
    /// For each number an instant before which none of it comes.
    nexts: [Time; KINDS],
    /// The earliest of these, without the slot time's: that is looked at with every other request, the others seldom.
    others: Time,
    /// The earliest of all.
    next: Time,
}

/// The number of the slot time, and those of all others.
const SLOT_TIME: usize = Timer::Slot as usize;
const OTHERS: core::ops::Range<usize> = SLOT_TIME + 1..KINDS;

impl Alarms {
    /// Whether the deadline of this number is an alarm: every timer but those that are there to come.
    pub(super) const fn has(which: usize) -> bool {
        const TIMERS: u32 = (1 << KINDS) - 1;
        const ALARMS: u32 = TIMERS & !(1 << Timer::Schedule as u32 | 1 << Timer::SetPoint as u32);
        ALARMS >> which & 1 == 1
    }

    /// The alarms of the stations with these crystals, none of them armed.
    pub(super) fn new(crystals: impl Iterator<Item = Crystal>) -> Self {
        let all: Vec<_> =
            crystals.map(|crystal| Waiting { crystal, alarms: [Alarm::OFF; Outbox::DEADLINES] }).collect();
        Self {
            users: core::array::from_fn(|_| Vec::with_capacity(all.len())),
            all,
            nexts: [Time::MAX; KINDS],
            others: Time::MAX,
            next: Time::MAX,
        }
    }
    /// None comes before.
    pub(super) const fn next(&self) -> Time {
        self.next
    }
    /// Arms the one of this number for the reading `at`, whatever it was.
    #[inline]
    pub(super) fn arm(&mut self, (slot, which): (usize, usize), at: Local, now: Time) {
        let alarm = &mut self.all[slot].alarms[which];
        alarm.due = at;
        if at < alarm.seen.0 {
            self.bring_forward((slot, which), now);
        }
    }
    /// It is armed for an earlier reading than it was looked at for.
    #[inline(never)]
    fn bring_forward(&mut self, (slot, which): (usize, usize), now: Time) {
        let Waiting { crystal, alarms } = &mut self.all[slot];
        if alarms[which].seen.0 == Local::MAX && !self.users[which].contains(&(slot as u8)) {
            self.users[which].push(slot as u8);
        }
        let comes = alarms[which].look(crystal, now);
        self.comes(which, comes);
    }
    /// One of this number comes at this instant, or none of it before.
    fn comes(&mut self, which: usize, at: Time) {
        self.nexts[which] = self.nexts[which].min(at);
        if which != SLOT_TIME {
            self.others = self.others.min(at);
        }
        self.next = self.next.min(at);
    }
    /// Disarms the one of this number.
    #[inline]
    pub(super) fn disarm(&mut self, (slot, which): (usize, usize)) {
        self.all[slot].alarms[which].due = Local::MAX;
    }
    /// Disarms all of a station.
    pub(super) fn disarm_all(&mut self, slot: usize) {
        self.all[slot].alarms.iter_mut().for_each(|alarm| alarm.due = Local::MAX);
    }
    /// The station's `crystal` has another rate from `now` on.
    pub(super) fn retune(&mut self, slot: usize, crystal: &Crystal, now: Time) {
        self.all[slot].crystal.clone_from(crystal);
        for which in 0..KINDS {
            let comes = self.all[slot].alarms[which].look(crystal, now);
            self.comes(which, comes);
        }
    }

    /// Looks at all that may come by `limit`. If [`next`](Self::next) is not later than that now, one comes then.
    #[inline]
    pub(super) fn look(&mut self, limit: Time, now: Time) {
        if self.nexts[SLOT_TIME] <= limit {
            self.look_at(SLOT_TIME, limit, now);
        }
        if self.others <= limit {
            self.look_at_others(limit, now);
        }
        self.next = self.nexts[SLOT_TIME].min(self.others);
    }
    #[inline(never)]
    fn look_at_others(&mut self, limit: Time, now: Time) {
        for which in OTHERS {
            if self.nexts[which] <= limit {
                self.look_at(which, limit, now);
            }
        }
        self.others = self.nexts[OTHERS].iter().fold(Time::MAX, |first, &next| first.min(next));
    }
    /// Looks at all of one number. Mostly one station has a slot time, the only master: that needs no walk.
    #[inline]
    fn look_at(&mut self, which: usize, limit: Time, now: Time) {
        self.nexts[which] = match self.users[which][..] {
            [slot] => self.all[usize::from(slot)].look(which, limit, now),
            _ => self.look_at_many(which, limit, now),
        };
    }
    #[inline(never)]
    fn look_at_many(&mut self, which: usize, limit: Time, now: Time) -> Time {
        let Self { all, users, .. } = self;
        let looks = users[which].iter().map(|&slot| all[usize::from(slot)].look(which, limit, now));
        looks.fold(Time::MAX, Time::min)
    }
    /// Which one comes first: slot, number and reading. Of several at one instant the one with the least `rank`, then the
    /// one with the least number.
    pub(super) fn first<K: Ord>(&self, rank: impl Fn(usize) -> K) -> Option<(usize, usize, Local)> {
        let mut first = None;
        for which in (0..KINDS).filter(|&which| self.nexts[which] == self.next) {
            for slot in self.users[which].iter().map(|&slot| usize::from(slot)) {
                let Alarm { due, seen } = self.all[slot].alarms[which];
                let key = (rank(slot), which);
                if due != Local::MAX && seen.1 == self.next && first.as_ref().is_none_or(|(least, _)| key < *least) {
                    first = Some((key, (slot, which, due)));
                }
            }
        }
        first.map(|(_, alarm)| alarm)
    }
}

const _: () = assert!(Outbox::DEADLINES == KINDS + 1, "the asked sample is no timer");
const _: () = assert!(SLOT_TIME == 0, "the others come after it");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Span;

    const WINDOW: usize = Timer::Window as usize;

    fn reading(us: i64) -> Local {
        Local::ZERO + Span::from_us(us)
    }
    fn instant(us: i64) -> Time {
        Time::ZERO + Span::from_us(us)
    }
    /// Alarms of three stations whose crystals run true.
    fn three() -> Alarms {
        Alarms::new((0..3).map(|_| Crystal::new(0, Local::ZERO).unwrap()))
    }
    /// What comes by `limit`, if anything does; higher slots first.
    fn first(alarms: &mut Alarms, limit: Time) -> Option<(usize, usize, Local)> {
        alarms.look(limit, Time::ZERO);
        if alarms.next() > limit { None } else { alarms.first(|slot| usize::MAX - slot) }
    }

    #[test]
    fn what_is_put_off_or_disarmed_does_not_come() {
        let mut alarms = three();
        for (slot, us) in [(0, 50), (1, 40), (2, 60)] {
            alarms.arm((slot, WINDOW), reading(us), Time::ZERO);
        }
        assert_eq!(alarms.next(), instant(40));
        alarms.arm((1, WINDOW), reading(140), Time::ZERO);
        alarms.disarm((0, WINDOW));
        assert_eq!(alarms.next(), instant(40), "nobody has looked yet");
        assert_eq!(first(&mut alarms, instant(59)), None);
        assert_eq!(first(&mut alarms, instant(60)), Some((2, WINDOW, reading(60))));
        alarms.disarm_all(2);
        assert_eq!(first(&mut alarms, Time::MAX), Some((1, WINDOW, reading(140))));
        alarms.disarm_all(1);
        assert_eq!((first(&mut alarms, instant(1_000)), alarms.next()), (None, Time::MAX));
    }

    #[test]
    fn what_is_armed_for_earlier_comes_earlier_also_after_it_was_off() {
        let mut alarms = three();
        alarms.arm((0, SLOT_TIME), reading(100), Time::ZERO);
        alarms.arm((0, SLOT_TIME), reading(70), Time::ZERO);
        assert_eq!(alarms.next(), instant(70));
        alarms.disarm((0, SLOT_TIME));
        assert_eq!(first(&mut alarms, instant(90)), None);
        alarms.arm((0, SLOT_TIME), reading(80), Time::ZERO);
        assert_eq!(first(&mut alarms, instant(90)), Some((0, SLOT_TIME, reading(80))));
    }

    #[test]
    fn at_one_instant_the_rank_decides_and_then_the_number() {
        let mut alarms = three();
        for (slot, which) in [(0, SLOT_TIME), (1, WINDOW), (2, WINDOW), (2, SLOT_TIME)] {
            alarms.arm((slot, which), reading(10), Time::ZERO);
        }
        for expected in [(2, SLOT_TIME), (2, WINDOW), (1, WINDOW), (0, SLOT_TIME)] {
            let (slot, which, due) = first(&mut alarms, instant(10)).unwrap();
            assert_eq!((slot, which, due), (expected.0, expected.1, reading(10)));
            alarms.disarm((slot, which));
        }
    }

    #[test]
    fn a_new_rate_moves_an_alarm() {
        let (mut alarms, mut crystal) = (three(), Crystal::new(0, Local::ZERO).unwrap());
        alarms.arm((1, WINDOW), reading(1_000_000), Time::ZERO);
        crystal.set_rate(Time::ZERO, 1_000).unwrap();
        alarms.retune(1, &crystal, Time::ZERO);
        assert_eq!(alarms.next(), crystal.to_true(reading(1_000_000)));
        assert!(alarms.next() < instant(1_000_000), "faster");
        // Whatever is armed from here on is compared with the new rate.
        alarms.arm((1, WINDOW), reading(1_000_001), Time::ZERO);
        let expected = Some((1, WINDOW, reading(1_000_001)));
        assert_eq!(first(&mut alarms, crystal.to_true(reading(1_000_001))), expected);
    }
}
