//! The event queue: what happens next, by a total key, so that no container decides an order.
//!
//! Two queues stand behind one trait. [`NearQueue`] is the fast one; [`HeapQueue`] is the plain one that it is compared
//! with. Both give the same order for the same pushes, because no two keys are equal.

use crate::time::Time;
use core::fmt;
use std::collections::{BinaryHeap, VecDeque};

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

    /// The place of `station`'s event `number` at `time`. Together with the station the number is given out once.
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
    /// Takes the first event out.
    ///
    /// # Panics
    /// If it is earlier than the one before: somebody pushed an event into the past.
    fn pop(&mut self) -> Option<(Key, E)>;
    /// The first event's key.
    fn peek(&self) -> Option<&Key>;
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
    fn pop(&mut self) -> Option<(Key, E)> {
        let Waiting { key, event } = self.heap.pop()?;
        self.watch.pass(key);
        Some((key, event))
    }
    fn peek(&self) -> Option<&Key> {
        self.heap.peek().map(|waiting| &waiting.key)
    }
    fn len(&self) -> usize {
        self.heap.len()
    }
}

/// The fast queue: a sorted ring, searched from its late end, behind a slot for the very next event.
///
/// Most events of a bus cycle come next as soon as they are pushed (a request, its answer, its echo): they pass through
/// the slot and never see the ring. Most others come after all that wait: they end the ring. What falls between is
/// found by a few steps from the late end, then by halving, and moves the shorter side of the ring.
#[derive(Clone, Debug)]
pub struct NearQueue<E> {
    /// Earlier than the whole ring, if there is one.
    slot: Option<(Key, E)>,
    /// Ascending.
    ring: VecDeque<(Key, E)>,
    watch: Watch,
}

impl<E: Copy> Default for NearQueue<E> {
    fn default() -> Self {
        Self { slot: None, ring: VecDeque::with_capacity(ROOM), watch: Watch::default() }
    }
}
impl<E: Copy> NearQueue<E> {
    /// Steps from the late end before the search halves.
    const STEPS: usize = 8;

    /// Puts an event at its place in the ring.
    fn insert(&mut self, key: Key, event: E) {
        let len = self.ring.len();
        let mut place = len;
        while place > 0 && key < self.ring[place - 1].0 {
            place -= 1;
            if len - place == Self::STEPS {
                place = self.ring.partition_point(|&(waiting, _)| waiting < key);
                break;
            }
        }
        self.ring.insert(place, (key, event));
    }
}
impl<E: Copy> Queue<E> for NearQueue<E> {
    fn push(&mut self, key: Key, event: E) {
        match self.slot {
            Some((next, _)) if next < key => self.insert(key, event),
            None if self.ring.front().is_some_and(|&(first, _)| first < key) => self.insert(key, event),
            _ => {
                if let Some(displaced) = self.slot.replace((key, event)) {
                    self.ring.push_front(displaced);
                }
            }
        }
    }
    fn pop(&mut self) -> Option<(Key, E)> {
        let (key, event) = match self.slot.take() {
            Some(next) => next,
            None => self.ring.pop_front()?,
        };
        self.watch.pass(key);
        Some((key, event))
    }
    fn peek(&self) -> Option<&Key> {
        self.slot.as_ref().or_else(|| self.ring.front()).map(|(key, _)| key)
    }
    fn len(&self) -> usize {
        usize::from(self.slot.is_some()) + self.ring.len()
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
            assert_eq!(queue.peek(), first.as_ref().map(|(key, _)| key));
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
            script in prop::collection::vec((prop_oneof![0i64..4, 0i64..1_000], 0u8..5, 0u8..3, prop::bool::weighted(0.4)), 0..200),
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
