//! Tape: what each station of a run did and saw, kept until the other run has got there too.
//!
//! A telegram comes before its first bit, and is none if its sender loses the supply until then. So nothing counts before
//! its instant has passed.

use std::collections::VecDeque;

use super::happening::{Happening, What};
use crate::observation::Observation;
use crate::sim::record::{Recorder, Stamp, Transmission};
use crate::time::Time;
use crate::wire::Address;

/// Which happenings are compared.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Strand {
    /// All of them.
    Everything,
    /// The observations that are events.
    Events,
}

impl Strand {
    pub(super) const ALL: [Self; 2] = [Self::Everything, Self::Events];
}

/// One station's happenings that have no counterpart yet.
#[derive(Clone, Debug, Default)]
struct Lane {
    waiting: [VecDeque<Happening>; 2],
    /// Nobody asks for these any more.
    finished: [bool; 2],
}

/// Takes a run down, station by station.
#[derive(Clone, Debug)]
pub(super) struct Tape {
    master: Address,
    /// The cycle whose beginning ends the run.
    last: Option<u64>,
    /// The running cycle.
    cycle: Option<u64>,
    /// When the run ended.
    ended: Option<Time>,
    lanes: Vec<Lane>,
}

impl Tape {
    /// An empty tape of a network whose cycles are those of `master`, from the cycle `from` on, which ends when `last`
    /// begins.
    pub(super) fn new(master: Address, from: Option<u64>, last: Option<u64>) -> Self {
        Self { master, last, cycle: from, ended: None, lanes: vec![Lane::default(); Self::STATIONS] }
    }
    /// Addresses that a station can have.
    pub(super) const STATIONS: usize = 128;

    /// From here on `cycle` is under way.
    pub(super) fn begin(&mut self, cycle: u64) {
        self.cycle = Some(cycle);
    }
    /// When the run ended before its time.
    pub(super) const fn ended(&self) -> Option<Time> {
        self.ended
    }
    /// The first happening of `station` in this strand, if it is not later than `until`.
    pub(super) fn first(&self, station: usize, strand: Strand, until: Time) -> Option<&Happening> {
        self.lanes[station].waiting[strand as usize].front().filter(|happening| happening.at <= until)
    }
    /// Takes the same off.
    pub(super) fn pop(&mut self, station: usize, strand: Strand, until: Time) -> Option<Happening> {
        self.first(station, strand, until)?;
        self.lanes[station].waiting[strand as usize].pop_front()
    }
    /// Nothing more of this strand is wanted.
    pub(super) fn finish(&mut self, station: usize, strand: Strand) {
        let lane = &mut self.lanes[station];
        lane.finished[strand as usize] = true;
        lane.waiting[strand as usize] = VecDeque::new();
    }

    fn keep(&mut self, station: Address, strand: Strand, what: impl FnOnce(Option<u64>) -> Happening) {
        let lane = &mut self.lanes[usize::from(station.get())];
        if !lane.finished[strand as usize] && self.ended.is_none() {
            lane.waiting[strand as usize].push_back(what(self.cycle));
        }
    }
}

impl Recorder for Tape {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        self.keep(telegram.sender, Strand::Everything, |cycle| Happening::of_telegram(cycle, telegram));
    }
    fn withdrawn(&mut self, sender: Address, now: Time) {
        if self.ended.is_none() {
            let stays = |happening: &Happening| happening.at <= now || !matches!(happening.what, What::Telegram { .. });
            self.lanes[usize::from(sender.get())].waiting[Strand::Everything as usize].retain(stays);
        }
    }
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        if let &Observation::CycleStart { cycle, .. } = what
            && stamp.station == self.master
        {
            self.cycle = Some(cycle);
            if self.last == Some(cycle) {
                self.ended.get_or_insert(stamp.at);
            }
        }
        let happening = |cycle| Happening::of_observation(cycle, &stamp, what);
        self.keep(stamp.station, Strand::Everything, happening);
        if what.is_event() {
            self.keep(stamp.station, Strand::Events, happening);
        }
    }
}
