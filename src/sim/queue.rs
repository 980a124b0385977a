//! The event queue: what happens next, by a total key, so that no container decides an order.
//!
//! Two queues stand behind one trait. [`NearQueue`] is the fast one; [`HeapQueue`] is the plain one that it is compared
//! with. Both give the same order for the same pushes, because no two keys are equal.

// See `network`.
#![allow(clippy::inline_always)]

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
    /// Behind every event.
    const NEVER: Self = Self(u128::MAX);
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
    /// Adds an event, where it may wait.
    fn push(&mut self, lane: Lane, key: Key, event: E);
    /// The first event's key.
    fn peek(&self) -> Option<Key>;
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

/// Room for one event of each station of a full network, and some: in a row, and in what grows before it does.
const ROOM: usize = 1 << u8::BITS;
/// Steps from the end of a list, beyond which a search halves.
const STEPS: usize = 8;

/// When an event will come, as far as its kind tells: a hint that says where it waits best. It never changes the order, only
/// what the event costs.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Lane {
    /// Before nearly all that wait: what is pushed last is taken first.
    Soon,
    /// After nearly all that wait in the row of this number, which is below [`Self::ROWS`].
    Row(usize),
    /// At any time.
    Any,
}

impl Lane {
    /// How many rows there are.
    pub const ROWS: usize = 3;
}

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
    fn push(&mut self, _lane: Lane, key: Key, event: E) {
        self.heap.push(Waiting { key, event });
    }
    fn peek(&self) -> Option<Key> {
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

/// The fast queue: a stack, and beside it a few rows and a heap, as [`Lane`] says.
///
/// A bus cycle is a chain of events of which each is the next one of all as soon as it is known (a request, its answer, the
/// next request): they lie on the stack and leave it at once. Between them come events that were known long before, in the
/// order in which they became known: every station's T_O, every station's latch. They stand in rows, and the first one of
/// each row lies on the stack and stands for all of it, as the first one of the heap does. So the stack stays short, and an
/// event is compared with few others.
#[derive(Clone, Debug)]
pub struct NearQueue<E> {
    /// Descending: the next one is the last.
    stack: Vec<Next<E>>,
    rows: [Row<E>; Lane::ROWS],
    heap: BinaryHeap<Waiting<E>>,
    /// Key of the event that stands for the heap; [`Key::NEVER`] where none does.
    heap_head: Key,
    watch: Watch,
}

/// An event on the stack.
#[derive(Clone, Copy, Debug)]
struct Next<E> {
    key: Key,
    event: E,
    /// The row that it stands for, or stands in, or one of the two below.
    stands_for: u8,
}
impl<E> Next<E> {
    const HEAP: u8 = Lane::ROWS as u8;
    const ITSELF: u8 = Self::HEAP + 1;
}

impl<E: Copy + Default> Default for NearQueue<E> {
    fn default() -> Self {
        Self {
            stack: Vec::with_capacity(ROOM),
            rows: core::array::from_fn(|_| Row::default()),
            heap: BinaryHeap::with_capacity(ROOM),
            heap_head: Key::NEVER,
            watch: Watch::default(),
        }
    }
}
impl<E: Copy> NearQueue<E> {
    /// Puts an event on the stack.
    #[inline(always)]
    fn stack(&mut self, next: Next<E>) {
        if self.stack.last().is_none_or(|first| next.key < first.key) {
            self.stack.push(next);
        } else {
            self.insert(next);
        }
    }
    /// The same below others.
    #[inline(never)]
    fn insert(&mut self, next: Next<E>) {
        let mut place = self.stack.len();
        while place > 0 && self.stack[place - 1].key < next.key {
            place -= 1;
            if self.stack.len() - place == STEPS {
                place = self.stack.partition_point(|waiting| waiting.key > next.key);
                break;
            }
        }
        self.stack.insert(place, next);
    }
    /// Puts an event into a row, not behind the last one.
    #[inline(never)]
    fn push_out_of_turn(&mut self, row: usize, key: Key, event: E) {
        let next = Next { key, event, stands_for: row as u8 };
        match self.rows[row].squeeze_in(next) {
            Squeezed::In => {}
            Squeezed::First => self.insert(next),
            Squeezed::Out => self.insert(Next { stands_for: Next::<E>::ITSELF, ..next }),
        }
    }
    #[cold]
    fn push_any(&mut self, key: Key, event: E) {
        if key > self.heap_head {
            return self.heap.push(Waiting { key, event });
        }
        let mut stands_for = Next::<E>::ITSELF;
        if self.heap_head == Key::NEVER {
            (self.heap_head, stands_for) = (key, Next::<E>::HEAP);
        }
        self.insert(Next { key, event, stands_for });
    }
    /// The event that stood for a row, or for the heap, is taken: the one behind it follows.
    #[inline(never)]
    fn follow(&mut self, stands_for: u8) {
        let Some(row) = self.rows.get_mut(usize::from(stands_for)) else { return self.follow_in_heap() };
        if row.begin == row.end {
            (row.begin, row.end, row.last) = (0, 0, Key::NEVER);
            return;
        }
        let next = row.list[usize::from(row.begin)];
        row.begin += 1;
        row.first = next.key;
        self.stack(next);
    }
    #[cold]
    fn follow_in_heap(&mut self) {
        let next = self.heap.pop();
        self.heap_head = next.map_or(Key::NEVER, |waiting| waiting.key);
        if let Some(Waiting { key, event }) = next {
            self.insert(Next { key, event, stands_for: Next::<E>::HEAP });
        }
    }
}
impl<E: Copy + Default> Queue<E> for NearQueue<E> {
    #[inline(always)]
    fn push(&mut self, lane: Lane, key: Key, event: E) {
        match lane {
            Lane::Soon => self.stack(Next { key, event, stands_for: Next::<E>::ITSELF }),
            Lane::Row(row) => {
                if !self.rows[row].push(Next { key, event, stands_for: row as u8 }) {
                    self.push_out_of_turn(row, key, event);
                }
            }
            Lane::Any => self.push_any(key, event),
        }
    }
    #[inline(always)]
    fn peek(&self) -> Option<Key> {
        self.stack.last().map(|next| next.key)
    }
    #[inline(always)]
    fn take(&mut self) -> (Key, E) {
        let &Next { key, event, stands_for } = self.stack.last().expect("an event waits");
        self.stack.pop();
        if stands_for != Next::<E>::ITSELF {
            self.follow(stands_for);
        }
        self.watch.pass(key);
        (key, event)
    }
    fn len(&self) -> usize {
        self.stack.len() + self.rows.iter().map(Row::len).sum::<usize>() + self.heap.len()
    }
    fn is_empty(&self) -> bool {
        self.stack.is_empty()
    }
}

/// Events that come, nearly always, in the order in which they are pushed. The first one is not here but on the stack.
#[derive(Clone, Debug)]
struct Row<E> {
    /// Ascending from `begin` to `end`, of which neither is beyond the list.
    list: Box<[Next<E>; ROOM]>,
    begin: u8,
    end: u8,
    /// Key of the event on the stack.
    first: Key,
    /// Key of the last one; [`Key::NEVER`] where no event stands for the row.
    last: Key,
}

/// Where an event goes that is not the last one of a row.
enum Squeezed {
    /// It is in the row.
    In,
    /// It stands for the row from now on.
    First,
    /// It comes before the row, or there is no room for it.
    Out,
}

impl<E: Copy + Default> Default for Row<E> {
    fn default() -> Self {
        let list = Box::new([Next { key: Key::NEVER, event: E::default(), stands_for: 0 }; ROOM]);
        Self { list, begin: 0, end: 0, first: Key::NEVER, last: Key::NEVER }
    }
}
impl<E: Copy> Row<E> {
    const fn len(&self) -> usize {
        (self.end - self.begin) as usize
    }
    const fn is_full(&self) -> bool {
        self.end == u8::MAX
    }
    /// Puts an event behind all others. False, and nothing is done, where it does not belong there.
    #[inline(always)]
    fn push(&mut self, next: Next<E>) -> bool {
        let is_last = next.key > self.last && !self.is_full();
        if is_last {
            self.list[usize::from(self.end)] = next;
            self.end += 1;
            self.last = next.key;
        }
        is_last
    }
    fn squeeze_in(&mut self, next: Next<E>) -> Squeezed {
        let key = next.key;
        if self.last == Key::NEVER {
            (self.first, self.last) = (key, key);
            return Squeezed::First;
        }
        if self.is_full() {
            self.list.copy_within(usize::from(self.begin)..usize::from(self.end), 0);
            (self.begin, self.end) = (0, self.end - self.begin);
        }
        if key < self.first || self.is_full() {
            return Squeezed::Out;
        }
        let (begin, mut place) = (usize::from(self.begin), usize::from(self.end));
        if place - begin > STEPS && self.list[place - STEPS].key > key {
            let before = begin + self.list[begin..place - STEPS].partition_point(|waiting| waiting.key < key);
            self.list.copy_within(before..place, before + 1);
            place = before;
        }
        while place > begin && self.list[place - 1].key > key {
            self.list[place] = self.list[place - 1];
            place -= 1;
        }
        self.list[place] = next;
        self.end += 1;
        self.last = self.last.max(key);
        Squeezed::In
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
        queue.push(Lane::Any, key(10), ());
        queue.pop();
        queue.push(Lane::Any, key(9), ());
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

    const LANES: &[Lane] = &[Lane::Soon, Lane::Row(0), Lane::Row(1), Lane::Row(2), Lane::Any];

    /// Pushes and pops, the queue against a list that is sorted for each pop.
    fn follows<Q: Queue<u64>>(script: &[(i64, u8, (u8, Lane), bool)]) {
        let (mut queue, mut list, mut now) = (Q::default(), Vec::new(), 0);
        let pop = |queue: &mut Q, list: &mut Vec<(Key, u64)>, lane: Lane| {
            list.sort_unstable_by_key(|&(key, _)| key);
            let first = (!list.is_empty()).then(|| list.remove(0));
            assert_eq!(queue.peek(), first.map(|(key, _)| key));
            if let Some((key, event)) = first {
                assert_eq!(queue.take(), (key, event));
                queue.push(lane, key, event);
            }
            assert_eq!(queue.pop(), first);
            assert_eq!((queue.len(), queue.is_empty()), (list.len(), list.is_empty()));
            first.map_or(0, |(key, _)| key.time().ticks())
        };
        for (number, &(ahead, phase, (station, lane), take)) in (0..).zip(script) {
            let phase = Phase::ALL[usize::from(phase)];
            let key = Key::new(Time::from_ticks(now + ahead), phase, station, number);
            queue.push(lane, key, number);
            list.push((key, number));
            if take {
                now = pop(&mut queue, &mut list, lane);
            }
        }
        while !queue.is_empty() {
            pop(&mut queue, &mut list, Lane::Any);
        }
        assert!(list.is_empty() && queue.peek().is_none() && queue.pop().is_none());
    }

    proptest! {
        #[test]
        fn both_queues_pop_in_the_order_of_the_keys(
            script in prop::collection::vec((prop_oneof![0i64..4, 0i64..1_000, 0i64..1 << 23, 0i64..1 << 31], 0u8..5, (0u8..3, prop::sample::select(LANES)), prop::bool::weighted(0.4)), 0..200),
        ) {
            follows::<NearQueue<u64>>(&script);
            follows::<HeapQueue<u64>>(&script);
        }
    }

    #[test]
    fn what_comes_before_the_first_of_a_row_or_of_the_heap_does_not_stand_for_it() {
        for &lane in LANES {
            follows::<NearQueue<u64>>(&[10, 5, 7, 20, 6].map(|ahead| (ahead, 3, (1, lane), false)));
        }
    }

    #[test]
    fn a_row_without_room_goes_on() {
        // Every third comes out of turn; in the second half one is taken for each that is pushed.
        let ahead = |n: i64| if n % 3 == 0 { 5_000 + n - n % 100 } else { 10_000 + n };
        let script = (0..1_200).map(|n| (ahead(n), 3, (n as u8 % 3, Lane::Row(1)), n > 600));
        follows::<NearQueue<u64>>(&script.collect::<Vec<_>>());
    }

    #[test]
    fn both_queues_agree_on_a_long_bus_cycle() {
        // Far deadlines for every station, some out of turn, then chains of near events: the shape of a real run.
        let mut script = Vec::new();
        for cycle in 0..40 {
            script.extend((0..120).map(|station| (1_000 + cycle, 3, (station, Lane::Row(0)), false)));
            script.extend((0..120).map(|station| (2_000 - i64::from(station % 17), 3, (station, Lane::Row(1)), false)));
            script.extend((0..120).map(|station| (i64::from(station) % 3, 4, (station, Lane::Soon), true)));
            script.extend((0..120).map(|station| (0, 0, (station, Lane::Soon), true)));
        }
        follows::<NearQueue<u64>>(&script);
        follows::<HeapQueue<u64>>(&script);
    }
}
