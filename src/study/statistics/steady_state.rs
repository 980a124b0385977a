//! Steady state: from which cycle on a run shows the network at work, and no more its start.
//!
//! A network is in steady state when every slave's clock recovery is locked and its sign of life is valid, all at the
//! same time, for so many cycles that it is no accident. Figures of earlier cycles are of the start-up. What is lost later
//! is a fault of the network at work and belongs to its figures.

use core::fmt;

/// What a slave must have reached.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Condition {
    /// Its clock recovery is locked.
    Locked,
    /// Its sign of life is valid.
    Alive,
}

impl Condition {
    /// Every condition.
    pub const ALL: [Self; 2] = [Self::Locked, Self::Alive];
}

/// As a sentence says it.
impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Locked => "lock of the clock recovery",
            Self::Alive => "sign of life",
        })
    }
}

/// Watches for the beginning of the steady state.
#[derive(Clone, Debug)]
pub struct SteadyWatch {
    /// The first cycle of the run.
    first: u64,
    /// Cycles that all conditions must hold in a row.
    settled_after: u64,
    /// Per slave, per condition: whether it holds.
    holds: Vec<[bool; Condition::ALL.len()]>,
    /// How many of them do not.
    missing: usize,
    /// Since when all do, and what came last.
    since: Option<Steady>,
    /// The cycle of the last change.
    now: u64,
    settled: bool,
}

/// The beginning of the steady state.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Steady {
    /// The first cycle of it.
    pub begin: u64,
    /// Cycles of the run before it.
    pub transient: u64,
    /// The slave that came last, by its number, and with what; none of a network without slaves.
    pub last: Option<(usize, Condition)>,
}

impl SteadyWatch {
    /// A watch over a run that begins with cycle `first`, in which no slave has reached anything yet. Steady state is
    /// what lasts for `settled_after` cycles at least.
    pub fn new(first: u64, settled_after: u64, slaves: usize) -> Self {
        let missing = slaves * Condition::ALL.len();
        let since = (missing == 0).then_some(Steady { begin: first, transient: 0, last: None });
        let holds = vec![[false; Condition::ALL.len()]; slaves];
        Self { first, settled_after, holds, missing, since, now: first, settled: false }
    }

    /// In `cycle`, `condition` begins or ceases to hold for the slave of number `slave`. Where a slave has no such
    /// condition it is said to hold in the first cycle.
    ///
    /// # Panics
    /// If there is no such slave, or `cycle` is before the last one told.
    pub fn note(&mut self, cycle: u64, slave: usize, condition: Condition, holds: bool) {
        assert!(cycle >= self.now, "cycle {cycle} after cycle {}", self.now);
        self.pass(cycle);
        let before = &mut self.holds[slave][condition as usize];
        if self.settled || *before == holds {
            return;
        }
        *before = holds;
        if holds {
            self.missing -= 1;
        } else {
            self.missing += 1;
        }
        let steady = Steady { begin: cycle, transient: cycle - self.first, last: Some((slave, condition)) };
        self.since = (self.missing == 0).then_some(steady);
    }

    /// All cycles before `cycle` are over: the beginning of the steady state, if it is settled by now.
    pub fn pass(&mut self, cycle: u64) -> Option<Steady> {
        self.now = self.now.max(cycle);
        self.settled |= self.since.is_some_and(|since| self.now - since.begin >= self.settled_after);
        self.since.filter(|_| self.settled)
    }

    /// What becomes the beginning of the steady state if nothing is lost again.
    pub fn candidate(&self) -> Option<Steady> {
        self.since
    }
    /// What is missing for a steady state, by the slave's number.
    pub fn missing(&self) -> impl Iterator<Item = (usize, Condition)> {
        let slaves = self.holds.iter().enumerate();
        slaves.flat_map(|(slave, holds)| {
            Condition::ALL.into_iter().filter(|&condition| !holds[condition as usize]).map(move |which| (slave, which))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Condition::{Alive, Locked};

    fn watch(settled_after: u64, slaves: usize, told: &[(u64, usize, Condition, bool)]) -> SteadyWatch {
        let mut watch = SteadyWatch::new(100, settled_after, slaves);
        for &(cycle, slave, condition, holds) in told {
            watch.note(cycle, slave, condition, holds);
        }
        watch
    }

    #[test]
    fn it_begins_with_the_last_condition_of_the_last_slave() {
        let mut both = watch(
            0,
            2,
            &[(140, 0, Locked, true), (150, 1, Alive, true), (151, 1, Locked, true), (170, 0, Alive, true)],
        );
        let last = Some((0, Alive));
        assert_eq!(both.pass(170), Some(Steady { begin: 170, transient: 70, last }));
        assert_eq!(both.missing().count(), 0);
    }

    #[test]
    fn what_was_lost_meanwhile_must_come_back() {
        let told = [(110, 0, Locked, true), (120, 0, Locked, false), (130, 0, Alive, true), (130, 1, Alive, true)];
        let mut lost = watch(0, 2, &told);
        assert_eq!(lost.pass(500), None);
        assert_eq!(lost.missing().collect::<Vec<_>>(), [(0, Locked), (1, Locked)]);
        lost.note(510, 1, Locked, true);
        lost.note(520, 0, Locked, true);
        assert_eq!(lost.pass(520).map(|steady| steady.transient), Some(420));
    }

    #[test]
    fn an_accident_of_a_few_cycles_is_no_steady_state() {
        let told = [(110, 0, Locked, true), (110, 0, Alive, true), (119, 0, Alive, false), (130, 0, Alive, true)];
        let mut short = watch(10, 1, &told);
        assert_eq!(short.pass(139), None);
        assert_eq!(short.pass(140).map(|steady| steady.begin), Some(130));
        let told = [(110, 0, Locked, true), (110, 0, Alive, true), (120, 0, Alive, false)];
        assert_eq!(watch(10, 1, &told).pass(121).map(|steady| steady.begin), Some(110));
    }

    #[test]
    fn what_is_lost_later_does_not_change_it() {
        let told = [(110, 0, Locked, true), (112, 0, Alive, true), (300, 0, Locked, false), (310, 0, Locked, true)];
        assert_eq!(watch(5, 1, &told).pass(400).map(|steady| steady.begin), Some(112));
    }

    #[test]
    fn a_network_without_slaves_is_steady_from_its_first_cycle() {
        let steady = Steady { begin: 100, transient: 0, last: None };
        assert_eq!((watch(3, 0, &[]).pass(102), watch(3, 0, &[]).pass(103)), (None, Some(steady)));
    }

    #[test]
    #[should_panic(expected = "cycle 109 after cycle 110")]
    fn cycles_come_in_their_order() {
        watch(0, 1, &[(110, 0, Locked, true), (109, 0, Alive, true)]);
    }
}
