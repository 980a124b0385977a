//! The event queue: what happens next, by a total key, so that no container decides an order.
//!
//! Two queues stand behind one trait. [`NearQueue`] is the fast one; [`HeapQueue`] is the plain one that it is compared
//! with. Both give the same order for the same pushes, because no two keys are equal.

use crate::time::Time;
use core::fmt;
use std::collections::BinaryHeap;

/// What kind of event comes first among events of one instant.
///
/// The scenario speaks first, so that a command at an instant rules all of it. A telegram's last bit leaves its sender
/// before it arrives anywhere, also where no cable lies between. Stations hear before they decide: a telegram that ends
/// exactly when a slot timer runs out counts as heard. What is sent comes last: it is the answer to everything that
/// the instant brought.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
#[repr(u8)]
pub enum Phase {
    /// A command of the scenario.
    Command,
    /// The last bit of a telegram leaves its sender.
    Edge,
    /// A telegram's last bit arrives at a station.
    Telegram,
    /// A station's deadline comes due.
    Deadline,
    /// A station's first bit leaves.
    Send,
}

impl Phase {
    /// Every phase, first to last.
    pub const ALL: &'static [Self] = &[Self::Command, Self::Edge, Self::Telegram, Self::Deadline, Self::Send];
}

/// An event's place in the order: time, phase, station, and the station's own number for it.
///
/// The four lie side by side in 64, 8, 8 and 48 bits, so that the order is one comparison.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Key(u128);

impl Key {
    /// Largest number of an event: a station that makes ten million a second reaches it after ten months.
    pub const MAX_NUMBER: u64 = (1 << 48) - 1;
    /// Turns the order of signed times into that of unsigned bits.
    const SIGN: u64 = 1 << 63;

    /// The place of `station`'s event `number` at `time`. Together with phase and station the number is given out once.
    ///
    /// # Panics
    /// If `number` is beyond [`Self::MAX_NUMBER`].
    pub const fn new(time: Time, phase: Phase, station: u8, number: u64) -> Self {
        assert!(number <= Self::MAX_NUMBER, "event number beyond 48 bits");
        let rest = (phase as u64) << 56 | (station as u64) << 48 | number;
        Self(((time.ticks() as u64 ^ Self::SIGN) as u128) << 64 | rest as u128)
    }
    /// When.
    pub const fn time(self) -> Time {
        Time::from_ticks(((self.0 >> 64) as u64 ^ Self::SIGN) as i64)
    }
    /// What kind.
    pub const fn phase(self) -> Phase {
        Phase::ALL[(self.0 >> 56) as u8 as usize]
    }
    /// Where.
    pub const fn station(self) -> u8 {
        (self.0 >> 48) as u8
    }
    /// Which, of this station.
    pub const fn number(self) -> u64 {
        self.0 as u64 & Self::MAX_NUMBER
    }
}
impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} {:?} of {} #{}", self.time(), self.phase(), self.station(), self.number())
    }
}

/// Events waiting for their turn.
///
/// Keys are unique; pushing one that waits already is a mistake that the order of the two would show.
pub trait Queue<E: Copy>: Default {
    /// Adds an event.
    fn push(&mut self, key: Key, event: E);
    /// The first event's key.
    fn peek(&mut self) -> Option<Key>;
    /// Takes the first event out.
    ///
    /// # Panics
    /// If no event waits, or it is earlier than the one before: somebody pushed an event into the past.
    fn take(&mut self) -> (Key, E);
    /// Takes the first event out if there is one.
    ///
    /// # Panics
    /// As [`take`](Self::take).
    fn pop(&mut self) -> Option<(Key, E)> {
        self.peek().map(|_| self.take())
    }
    /// How many events wait.
    fn len(&self) -> usize;
    /// Whether no event waits.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Room for the events of a full network, 126 stations with a few deadlines each, before a queue grows.
const ROOM: usize = 1_024;

/// Watches that time goes on.
#[derive(Clone, Copy, Debug)]
struct Watch(Time);

impl Default for Watch {
    fn default() -> Self {
        Self(Time::from_ticks(i64::MIN))
    }
}
impl Watch {
    /// Notes that `key` is popped.
    fn pass(&mut self, key: Key) {
        let time = key.time();
        assert!(time >= self.0, "time goes backwards: {key:?} after {:?}", self.0);
        self.0 = time;
    }
}

/// An event in the heap, the earliest greatest.
#[derive(Clone, Copy, Debug)]
struct Waiting<E> {
    key: Key,
    event: E,
}
impl<E> PartialEq for Waiting<E> {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}
impl<E> Eq for Waiting<E> {}
impl<E> PartialOrd for Waiting<E> {
    fn partial_cmp(&self, other: &Self) -> Option<core::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl<E> Ord for Waiting<E> {
    fn cmp(&self, other: &Self) -> core::cmp::Ordering {
        other.key.cmp(&self.key)
    }
}

/// The plain queue: the standard library's heap. O(log n).
#[derive(Clone, Debug)]
pub struct HeapQueue<E> {
    heap: BinaryHeap<Waiting<E>>,
    watch: Watch,
}

impl<E: Copy> Default for HeapQueue<E> {
    fn default() -> Self {
        Self { heap: BinaryHeap::with_capacity(ROOM), watch: Watch::default() }
    }
}
impl<E: Copy> Queue<E> for HeapQueue<E> {
    fn push(&mut self, key: Key, event: E) {
        self.heap.push(Waiting { key, event });
    }
    fn peek(&mut self) -> Option<Key> {
        self.heap.peek().map(|waiting| waiting.key)
    }
    fn take(&mut self) -> (Key, E) {
        let Waiting { key, event } = self.heap.pop().expect("an event waits");
        self.watch.pass(key);
        (key, event)
    }
    fn len(&self) -> usize {
        self.heap.len()
    }
}

/// The fast queue: a calendar.
///
/// Today's events are sorted. Most events of a bus cycle come next as soon as they are pushed (a request, its answer, its
/// echo): they end the list of today and leave it at once. Events of another day of the coming year are noted on the
/// page of that day, in no order, and sorted when the day has come. The few that are later still wait in a heap.
///
/// As long as few events wait, as in a network of one or two slaves, pages are not worth it: today does not end.
#[derive(Clone, Debug)]
pub struct NearQueue<E> {
    /// Events of `date` and of days before it, descending: the next one is the last.
    today: Vec<(Key, E)>,
    /// Day up to which `today` has everything; the end of all days as long as few events have waited at once.
    date: i64,
    /// Pages of the coming year: for each day, modulo the year, its first note.
    pages: Box<[Option<NoteId>; YEAR]>,
    /// The pages that have notes, as bits.
    marked: u128,
    notes: Vec<Note<E>>,
    /// First of the notes that can be written over.
    blank: Option<NoteId>,
    /// Events beyond the year.
    later: BinaryHeap<Waiting<E>>,
    watch: Watch,
}

/// Bits of a tick's number within its day: a day is 0.35 ms.
const DAY_BITS: u32 = 22;
/// Days in a year: 45 ms, more than the longest T_DP.
const YEAR: usize = u128::BITS as usize;
/// So many events are kept in order faster than noted.
const FEW: usize = 12;

/// An event on a page.
#[derive(Clone, Copy, Debug)]
struct Note<E> {
    key: Key,
    event: E,
    /// The next note of the page, or the next blank one.
    next: Option<NoteId>,
}
/// Names a note: its index and one.
type NoteId = core::num::NonZeroU32;

/// Where a note is.
const fn place(id: NoteId) -> usize {
    id.get() as usize - 1
}

/// The day of an event.
const fn day(key: Key) -> i64 {
    key.time().ticks() >> DAY_BITS
}
/// The page of a day.
const fn page(day: i64) -> usize {
    day as usize % YEAR
}

impl<E: Copy> Default for NearQueue<E> {
    fn default() -> Self {
        Self {
            today: Vec::with_capacity(ROOM),
            date: i64::MAX,
            pages: Box::new([None; YEAR]),
            marked: 0,
            notes: Vec::with_capacity(ROOM),
            blank: None,
            later: BinaryHeap::with_capacity(ROOM),
            watch: Watch::default(),
        }
    }
}
impl<E: Copy> NearQueue<E> {
    /// Steps from the next event before the search halves.
    const STEPS: usize = 8;

    /// Puts an event that is not the next of all at its place.
    #[inline(never)]
    fn put(&mut self, key: Key, event: E) {
        if self.date < i64::MAX {
            self.put_by_day(key, event);
        } else {
            self.put_among_few(key, event);
        }
    }
    /// The same while today does not end.
    #[inline(never)]
    fn put_among_few(&mut self, key: Key, event: E) {
        if self.today.len() >= FEW {
            self.spread_out();
            return self.put_by_day(key, event);
        }
        self.today.push((key, event));
        let mut place = self.today.len() - 1;
        while place > 0 && self.today[place - 1].0 < key {
            self.today[place] = self.today[place - 1];
            place -= 1;
        }
        self.today[place] = (key, event);
    }
    /// The same once there are days.
    #[inline(never)]
    fn put_by_day(&mut self, key: Key, event: E) {
        let day = day(key);
        if day <= self.date {
            self.insert(key, event);
        } else if day - self.date < YEAR as i64 {
            self.note(key, event);
        } else {
            self.put_later(key, event);
        }
    }
    /// The same beyond the year.
    #[cold]
    fn put_later(&mut self, key: Key, event: E) {
        self.later.push(Waiting { key, event });
    }
    /// From now on there are days and pages.
    #[cold]
    fn spread_out(&mut self) {
        self.date = self.today.last().map_or(0, |&(next, _)| day(next));
        let later = self.today.partition_point(|&(key, _)| day(key) > self.date);
        for place in 0..later {
            let (key, event) = self.today[place];
            self.put_by_day(key, event);
        }
        self.today.drain(..later);
    }
    #[inline(never)]
    fn insert(&mut self, key: Key, event: E) {
        let len = self.today.len();
        let mut place = len;
        while place > 0 && self.today[place - 1].0 < key {
            place -= 1;
            if len - place == Self::STEPS {
                place = self.today.partition_point(|&(waiting, _)| waiting > key);
                break;
            }
        }
        self.today.insert(place, (key, event));
    }

    /// Notes an event on the page of its day.
    fn note(&mut self, key: Key, event: E) {
        let Some(id) = self.blank else { return self.note_anew(key, event) };
        let page = page(day(key));
        let note = &mut self.notes[place(id)];
        self.blank = note.next;
        *note = Note { key, event, next: self.pages[page] };
        self.pages[page] = Some(id);
        self.marked |= 1 << page;
    }

    /// The same where no note can be written over.
    #[cold]
    fn note_anew(&mut self, key: Key, event: E) {
        self.notes.push(Note { key, event, next: None });
        self.blank = NoteId::new(self.notes.len() as u32);
        self.note(key, event);
    }

    /// The next day with a note.
    fn next_noted(&self) -> Option<i64> {
        if self.marked == 0 {
            return None;
        }
        let tomorrow = self.date + 1;
        let ahead = self.marked.rotate_right(page(tomorrow) as u32).trailing_zeros();
        Some(tomorrow + i64::from(ahead))
    }

    /// The list of today is empty: goes on to the next day that has something. Not before the next event is asked for,
    /// because what is pushed until then may come earlier.
    #[inline(never)]
    fn turn(&mut self) {
        let noted = self.next_noted();
        let later = self.later.peek().map(|waiting| day(waiting.key));
        let Some(date) = noted.into_iter().chain(later).min() else { return };
        self.date = date;
        if noted == Some(date) {
            self.take_page(page(date));
        }
        while self.later.peek().is_some_and(|waiting| day(waiting.key) == date) {
            self.today.extend(self.later.pop().map(|Waiting { key, event }| (key, event)));
        }
        self.today.sort_unstable_by(|(a, _), (b, _)| b.cmp(a));
    }
    fn take_page(&mut self, page: usize) {
        let first = self.pages[page].take();
        self.marked &= !(1 << page);
        let (mut next, mut last) = (first, None);
        while let Some(id) = next {
            let note = &self.notes[place(id)];
            self.today.push((note.key, note.event));
            (next, last) = (note.next, Some(id));
        }
        // All of them can be written over, before those that could be already.
        if let Some(last) = last {
            self.notes[place(last)].next = self.blank;
            self.blank = first;
        }
    }
}
impl<E: Copy> Queue<E> for NearQueue<E> {
    #[inline]
    fn push(&mut self, key: Key, event: E) {
        if day(key) <= self.date && self.today.last().is_none_or(|&(next, _)| key < next) {
            self.today.push((key, event));
        } else {
            self.put(key, event);
        }
    }
    #[inline]
    fn peek(&mut self) -> Option<Key> {
        if self.today.is_empty() {
            self.turn();
        }
        self.today.last().map(|&(key, _)| key)
    }
    #[inline]
    fn take(&mut self) -> (Key, E) {
        if self.today.is_empty() {
            self.turn();
        }
        let &(key, event) = self.today.last().expect("an event waits");
        self.today.pop();
        self.watch.pass(key);
        (key, event)
    }
    fn len(&self) -> usize {
        let blank = core::iter::successors(self.blank, |&id| self.notes[place(id)].next);
        self.today.len() + self.notes.len() - blank.count() + self.later.len()
    }
    fn is_empty(&self) -> bool {
        self.today.is_empty() && self.marked == 0 && self.later.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn key(ticks: i64) -> Key {
        Key::new(Time::from_ticks(ticks), Phase::Send, 3, 0)
    }

    #[test]
    fn a_key_keeps_its_parts() {
        for ticks in [i64::MIN, -1, 0, 1, i64::MAX] {
            for &phase in Phase::ALL {
                let key = Key::new(Time::from_ticks(ticks), phase, 255, Key::MAX_NUMBER);
                assert_eq!((key.time().ticks(), key.phase()), (ticks, phase));
                assert_eq!((key.station(), key.number()), (255, Key::MAX_NUMBER));
            }
        }
    }

    #[test]
    fn keys_order_by_time_then_phase_then_station_then_number() {
        let at = Time::from_ticks;
        let ascending = [
            Key::new(at(-5), Phase::Send, 125, 9),
            Key::new(at(0), Phase::Command, 125, 9),
            Key::new(at(0), Phase::Edge, 125, 9),
            Key::new(at(0), Phase::Telegram, 125, 9),
            Key::new(at(0), Phase::Deadline, 1, 9),
            Key::new(at(0), Phase::Deadline, 2, 7),
            Key::new(at(0), Phase::Deadline, 2, 8),
            Key::new(at(0), Phase::Send, 0, 0),
            Key::new(at(1), Phase::Command, 0, 0),
        ];
        assert!(ascending.is_sorted_by(|a, b| a < b));
        assert!(Phase::ALL.is_sorted_by(|a, b| a < b));
    }

    #[test]
    #[should_panic(expected = "48 bits")]
    fn a_number_that_does_not_fit_is_refused() {
        let _ = Key::new(Time::ZERO, Phase::Send, 0, Key::MAX_NUMBER + 1);
    }

    fn into_the_past(mut queue: impl Queue<()>) {
        queue.push(key(10), ());
        queue.pop();
        queue.push(key(9), ());
        queue.pop();
    }
    #[test]
    #[should_panic(expected = "time goes backwards")]
    fn the_near_queue_notices_the_past() {
        into_the_past(NearQueue::default());
    }
    #[test]
    #[should_panic(expected = "time goes backwards")]
    fn the_heap_queue_notices_the_past() {
        into_the_past(HeapQueue::default());
    }

    /// Pushes and pops, the queue against a list that is sorted for each pop.
    fn follows<Q: Queue<u64>>(script: &[(i64, u8, u8, bool)]) {
        let (mut queue, mut list, mut now) = (Q::default(), Vec::new(), 0);
        let pop = |queue: &mut Q, list: &mut Vec<(Key, u64)>| {
            list.sort_unstable_by_key(|&(key, _)| key);
            let first = (!list.is_empty()).then(|| list.remove(0));
            assert_eq!(queue.peek(), first.map(|(key, _)| key));
            if let Some((key, event)) = first {
                assert_eq!(queue.take(), (key, event));
                queue.push(key, event);
            }
            assert_eq!(queue.pop(), first);
            assert_eq!((queue.len(), queue.is_empty()), (list.len(), list.is_empty()));
            first.map_or(0, |(key, _)| key.time().ticks())
        };
        for (number, &(ahead, phase, station, take)) in (0..).zip(script) {
            let phase = Phase::ALL[usize::from(phase)];
            let key = Key::new(Time::from_ticks(now + ahead), phase, station, number);
            queue.push(key, number);
            list.push((key, number));
            if take {
                now = pop(&mut queue, &mut list);
            }
        }
        while !queue.is_empty() {
            pop(&mut queue, &mut list);
        }
        assert!(list.is_empty() && queue.peek().is_none() && queue.pop().is_none());
    }

    proptest! {
        #[test]
        fn both_queues_pop_in_the_order_of_the_keys(
            script in prop::collection::vec((prop_oneof![0i64..4, 0i64..1_000, 0i64..1 << 23, 0i64..1 << 31], 0u8..5, 0u8..3, prop::bool::weighted(0.4)), 0..200),
        ) {
            follows::<NearQueue<u64>>(&script);
            follows::<HeapQueue<u64>>(&script);
        }
    }

    #[test]
    fn both_queues_agree_on_a_long_bus_cycle() {
        // Far deadlines for every station, then chains of near events: the shape of a real run.
        let mut script = Vec::new();
        for cycle in 0..40 {
            script.extend((0..120).map(|station| (1_000 + cycle, 3, station, false)));
            script.extend((0..120).map(|station| (i64::from(station) % 3, 4, station, true)));
            script.extend((0..120).map(|station| (0, 0, station, true)));
        }
        follows::<NearQueue<u64>>(&script);
        follows::<HeapQueue<u64>>(&script);
    }
}
