//! Cuts of cables: who still hears whom.
//!
//! A cut parts the network in two at a place of a cable. Each part goes on by itself: its stations hear each other and
//! nobody else, its line is busy and its telegrams collide by themselves. Model: the ends of a cut cable are terminated,
//! nothing is reflected. A telegram reaches a station if no cut was between the two from its first bit until its last
//! one is there; half a telegram is dropped as if it had not come. When a cable is whole again, telegrams of the two
//! parts that are on the line at that moment break each other.

use crate::sim::topology::{Place, Tree};
use crate::time::Time;

/// Cuts in a set, a bit each.
pub type CutSet = u64;

/// All cuts that a network may have.
#[derive(Clone, Debug, Default)]
pub struct Cuts {
    /// Each with the name of the disturbance that makes it.
    named: Vec<(String, Place)>,
    /// On which side of each cut a station is, by station.
    sides: Vec<CutSet>,
    /// Those that are cut now.
    open: CutSet,
    /// When each was whole again last.
    joined: Vec<Time>,
}

impl Cuts {
    /// Most cuts of a network.
    pub const MAX: usize = CutSet::BITS as usize;

    /// Whole cables that may be cut at these places, each under a name, between stations at `places`.
    ///
    /// # Panics
    /// If there are more than [`Self::MAX`].
    pub fn new(cuts: Vec<(String, Place)>, tree: &Tree, places: &[Place]) -> Self {
        assert!(cuts.len() <= Self::MAX, "{} cuts", cuts.len());
        let side = |&station: &Place| {
            let far = cuts.iter().enumerate().filter(|&(_, &(_, cut))| tree.is_behind(cut, station));
            far.fold(0, |set, (number, _)| set | 1 << number)
        };
        let sides = places.iter().map(side).collect();
        let joined = vec![Time::ZERO; cuts.len()];
        Self { named: cuts, sides, open: 0, joined }
    }
    /// Cables that are never cut.
    pub const fn none() -> Self {
        Self { named: Vec::new(), sides: Vec::new(), open: 0, joined: Vec::new() }
    }
    /// Whether no cable is ever cut.
    pub const fn is_empty(&self) -> bool {
        self.named.is_empty()
    }
    /// The cuts between two stations, open or not.
    fn between(&self, a: usize, b: usize) -> CutSet {
        match (self.sides.get(a), self.sides.get(b)) {
            (Some(a), Some(b)) => a ^ b,
            _ => 0,
        }
    }
    /// Whether two stations hear nothing of each other now.
    #[inline]
    pub fn part(&self, a: usize, b: usize) -> bool {
        self.part_by(self.open, a, b)
    }
    /// Whether two stations hear nothing of each other where these are cut.
    pub fn part_by(&self, open: CutSet, a: usize, b: usize) -> bool {
        open != 0 && self.between(a, b) & open != 0
    }
    /// Those that are cut now.
    pub const fn open(&self) -> CutSet {
        self.open
    }
    /// Whether a telegram between two stations that began at `start` lacks a piece.
    pub fn tear(&self, a: usize, b: usize, start: Time) -> bool {
        let between = self.between(a, b);
        let since = |(number, &joined): (usize, &Time)| between >> number & 1 == 1 && start < joined;
        between & self.open != 0 || self.joined.iter().enumerate().any(since)
    }
    /// The cut that the disturbance called `name` makes at this place is open from now on, or closed.
    pub fn set(&mut self, (name, place): (&str, Place), open: bool, now: Time) {
        let found = |(other, at): &(String, Place)| other == name && *at == place;
        let Some(number) = self.named.iter().position(found) else { return };
        if open {
            self.open |= 1 << number;
        } else {
            self.open &= !(1 << number);
            self.joined[number] = now;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::topology::{CABLE_DELAY, Link, cable_delay};
    use crate::time::Span;

    fn at(segment: u8, metres: u64) -> Place {
        Place::new(segment, cable_delay(metres * 1_000, CABLE_DELAY))
    }
    fn pairs(cuts: &Cuts, count: usize) -> Vec<(usize, usize)> {
        let all = (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b)));
        all.filter(|&(a, b)| cuts.part(a, b)).collect()
    }

    #[test]
    fn a_cut_parts_what_lies_on_its_two_sides_also_behind_links() {
        // Segment 1 hangs on segment 0 at 30 m, segment 2 on segment 1 at its end.
        let link = |from, to| Link { ends: [from, to], delay: Span::from_ns(9) };
        let tree = Tree::new(3, vec![link(at(0, 30), at(1, 0)), link(at(1, 50), at(2, 0))]).unwrap();
        let places = [at(0, 0), at(0, 20), at(0, 40), at(1, 10), at(2, 5)];
        let (a, b) = (("a", at(0, 25)), ("b", at(1, 20)));
        let mut cuts = Cuts::new(vec![("a".into(), a.1), ("b".into(), b.1)], &tree, &places);
        assert_eq!(pairs(&cuts, 5), []);
        cuts.set(a, true, Time::ZERO);
        assert_eq!(pairs(&cuts, 5), [(0, 2), (0, 3), (0, 4), (1, 2), (1, 3), (1, 4)]);
        cuts.set(b, true, Time::ZERO);
        assert_eq!(pairs(&cuts, 5).len(), 8, "three parts: 2, 2 and 1 stations");
        cuts.set(a, false, Time::ZERO);
        assert_eq!(pairs(&cuts, 5), [(0, 4), (1, 4), (2, 4), (3, 4)]);
        cuts.set(("other", a.1), true, Time::ZERO);
        cuts.set(("a", b.1), true, Time::ZERO);
        assert_eq!(pairs(&cuts, 5).len(), 4);
    }

    #[test]
    fn a_telegram_needs_a_whole_cable_from_its_first_bit_on() {
        let ns = |ns| Time::ZERO + Span::from_ns(ns);
        let a = ("a", at(0, 10));
        let mut cuts = Cuts::new(vec![("a".into(), a.1)], &Tree::line(), &[at(0, 0), at(0, 20)]);
        assert!(!cuts.tear(0, 1, ns(50)));
        cuts.set(a, true, ns(100));
        assert!(cuts.tear(0, 1, ns(50)) && !cuts.tear(1, 1, ns(50)));
        cuts.set(a, false, ns(200));
        assert_eq!([50, 199, 200].map(|start| cuts.tear(1, 0, ns(start))), [true, true, false]);
    }
}
