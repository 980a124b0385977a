//! Topology: segments of cable joined by links to a tree, and how long a telegram takes along it.
//!
//! ```text
//! segment 0  ----A---------+--------B----
//!                          | link 0
//! segment 1      -----C----+-------+---
//!                                  | link 1
//! segment 2                        +-------D--
//! ```
//! A link, be it a repeater or a pair of optical link modules, hands on everything that it hears on either side, so a
//! telegram crosses each link of the tree once. All delays are reckoned before the network runs.

use crate::time::Span;

/// Delay of one metre of cable, 5 ns (PROFIBUS network manual: 5 us/km).
pub const CABLE_DELAY: Span = Span::from_ns(5);

/// Delay along `mm` of cable with a `delay` per metre, rounded down to a tick.
pub const fn cable_delay(mm: u64, delay: Span) -> Span {
    Span::from_ticks((mm * delay.ticks() as u64 / 1_000) as i64)
}

/// A place on the cables: a segment and the delay from its beginning.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Place {
    segment: u8,
    along: Span,
}

impl Place {
    /// The place on `segment` that a signal from its beginning reaches after `along`.
    pub const fn new(segment: u8, along: Span) -> Self {
        Self { segment, along }
    }
    /// Delay between two places of one segment.
    fn delay(self, other: Self) -> Span {
        (self.along - other.along).abs()
    }
}

/// What joins two segments.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Link {
    /// Where it is connected.
    pub ends: [Place; 2],
    /// How long a telegram takes through it, nominally, at least 0.
    pub delay: Span,
}

/// What keeps segments and links from being a tree.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum TreeError {
    /// The two ends are connected without this link too, or are on one segment.
    #[error("link {0} closes a loop")]
    Loop(usize),
    /// No link leads from segment 0 to this one.
    #[error("segment {0} is connected to nothing")]
    Apart(usize),
}

/// Segments joined by links so that exactly one path leads from each to each.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Tree {
    segments: usize,
    links: Vec<Link>,
    /// The link by which a path to the second segment leaves the first; [`Self::HERE`] where they are one.
    towards: Vec<u8>,
}

impl Tree {
    /// Most segments: as many as a network may have addresses.
    pub const MAX_SEGMENTS: usize = 127;
    const HERE: u8 = u8::MAX;

    /// One segment.
    pub fn line() -> Self {
        Self { segments: 1, links: Vec::new(), towards: vec![Self::HERE] }
    }
    /// `segments` joined by `links`.
    ///
    /// # Errors
    /// The first link that closes a loop, or else the first segment that is not connected to segment 0.
    ///
    /// # Panics
    /// If there is no segment, or more than [`Self::MAX_SEGMENTS`], or a link ends at none of them.
    pub fn new(segments: usize, links: Vec<Link>) -> Result<Self, TreeError> {
        assert!((1..=Self::MAX_SEGMENTS).contains(&segments), "{segments} segments");
        let mut parts: Vec<usize> = (0..segments).collect();
        for (index, link) in links.iter().enumerate() {
            let [a, b] = link.ends.map(|end| parts[usize::from(end.segment)]);
            if a == b {
                return Err(TreeError::Loop(index));
            }
            parts.iter_mut().filter(|part| **part == b).for_each(|part| *part = a);
        }
        if let Some(apart) = parts.iter().position(|&part| part != parts[0]) {
            return Err(TreeError::Apart(apart));
        }
        let mut tree = Self { segments, links, towards: vec![Self::HERE; segments * segments] };
        for target in 0..segments {
            tree.lead_to(target);
        }
        Ok(tree)
    }
    /// Fills in by which link each segment's path to `target` leaves it.
    fn lead_to(&mut self, target: usize) {
        let mut reached = vec![target];
        let mut next = 0;
        while let Some(&near) = reached.get(next) {
            next += 1;
            for (index, link) in self.links.iter().enumerate() {
                let [a, b] = link.ends.map(|end| usize::from(end.segment));
                for (from, to) in [(a, b), (b, a)] {
                    if to == near && from != target && self.towards[from * self.segments + target] == Self::HERE {
                        self.towards[from * self.segments + target] = index as u8;
                        reached.push(from);
                    }
                }
            }
        }
    }

    /// The links that join the segments.
    pub fn links(&self) -> &[Link] {
        &self.links
    }
    /// The links on the way from segment `from` to segment `to`: each by its index, and by which of its ends the way
    /// enters it.
    pub fn path(&self, from: u8, to: u8) -> impl Iterator<Item = (usize, usize)> + '_ {
        let mut at = from;
        std::iter::from_fn(move || {
            let link = self.towards[usize::from(at) * self.segments + usize::from(to)];
            let ends = self.links.get(usize::from(link))?.ends;
            let near = usize::from(ends[0].segment != at);
            at = ends[1 - near].segment;
            Some((usize::from(link), near))
        })
    }
    /// How long a telegram takes from `from` to `to`, without jitter.
    pub fn delay(&self, from: Place, to: Place) -> Span {
        let (mut at, mut delay) = (from, Span::ZERO);
        for (link, near) in self.path(from.segment, to.segment) {
            let link = self.links[link];
            delay += at.delay(link.ends[near]) + link.delay;
            at = link.ends[1 - near];
        }
        delay + at.delay(to)
    }
    /// Whether `place` lies behind `cut`: the path from the beginning of the cut's segment to it leads through the cut.
    pub fn is_behind(&self, cut: Place, place: Place) -> bool {
        // Where the path from there comes onto the segment.
        let onto = self.path(place.segment, cut.segment).last();
        let at = onto.map_or(place, |(link, near)| self.links[link].ends[1 - near]);
        at.along >= cut.along
    }
}

/// Links in a set, by index.
type LinkSet = u128;

/// The delays between the stations of a network, each pair's once.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Delays {
    /// Half of the matrix is filled, so that a pair costs the cache one place.
    nominal: Vec<Span>,
    /// The links with jitter between two stations, by the order of these links; empty if no link has any.
    unsteady: Vec<LinkSet>,
}

impl Delays {
    /// Stations of a row, a power of two that no network reaches.
    const ROW: usize = 128;

    /// The delays between stations at `places`; `unsteady` are the links with jitter.
    ///
    /// # Panics
    /// If there are more stations than addresses.
    pub fn new(tree: &Tree, places: &[Place], unsteady: &[usize]) -> Self {
        assert!(places.len() < Self::ROW, "{} stations", places.len());
        let pairs = places.len() * Self::ROW;
        let mut delays = Self { nominal: vec![Span::ZERO; pairs], unsteady: Vec::new() };
        if !unsteady.is_empty() {
            delays.unsteady = vec![0; pairs];
        }
        for (a, &from) in places.iter().enumerate() {
            for (b, &to) in places.iter().enumerate().skip(a) {
                let pair = Self::pair(a, b);
                delays.nominal[pair] = tree.delay(from, to);
                if let Some(set) = delays.unsteady.get_mut(pair) {
                    let crossed = tree.path(from.segment, to.segment);
                    let crossed = crossed.filter_map(|(link, _)| unsteady.iter().position(|&other| other == link));
                    *set = crossed.fold(0, |set, link| set | 1 << link);
                }
            }
        }
        delays
    }
    fn pair(a: usize, b: usize) -> usize {
        a.min(b) * Self::ROW + a.max(b)
    }
    /// Whether every telegram takes the same time.
    pub const fn is_steady(&self) -> bool {
        self.unsteady.is_empty()
    }
    /// Delay between stations `a` and `b` without jitter.
    #[inline]
    pub fn nominal(&self, a: usize, b: usize) -> Span {
        self.nominal[Self::pair(a, b)]
    }
    /// Delay between stations `a` and `b` of a telegram for which the links with jitter strayed by `strays`.
    pub fn of(&self, a: usize, b: usize, strays: &[Span]) -> Span {
        let set = self.unsteady.get(Self::pair(a, b)).copied().unwrap_or(0);
        let crossed = strays.iter().enumerate().filter(|(link, _)| set >> link & 1 == 1);
        crossed.fold(self.nominal(a, b), |delay, (_, &stray)| delay + stray)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(segment: u8, metres: u64) -> Place {
        Place::new(segment, cable_delay(metres * 1_000, CABLE_DELAY))
    }
    fn link(from: Place, to: Place, delay: i64) -> Link {
        Link { ends: [from, to], delay: Span::from_ns(delay) }
    }
    /// The tree of the module's picture: link 0 from 50 m to 40 m, 100 ns; link 1 from 80 m to 0 m, 700 ns.
    fn three() -> Tree {
        Tree::new(3, vec![link(at(0, 50), at(1, 40), 100), link(at(1, 80), at(2, 0), 700)]).unwrap()
    }

    #[test]
    fn five_nanoseconds_per_metre() {
        let line = Tree::line();
        assert_eq!(line.delay(at(0, 0), at(0, 100)), Span::from_ns(500));
        assert_eq!(line.delay(at(0, 70), at(0, 20)), Span::from_ns(250));
        assert_eq!(cable_delay(1_999, CABLE_DELAY), Span::from_ticks(119));
    }

    #[test]
    fn a_path_adds_up_cables_and_links() {
        let tree = three();
        let ns = |a, b| tree.delay(a, b).div_floor(Span::from_ns(1));
        assert_eq!(ns(at(0, 20), at(0, 90)), 350);
        assert_eq!(ns(at(0, 20), at(1, 40)), 150 + 100);
        assert_eq!(ns(at(0, 20), at(1, 10)), 150 + 100 + 150);
        assert_eq!(ns(at(0, 20), at(2, 30)), 150 + 100 + 200 + 700 + 150);
        let links = |from, to| tree.path(from, to).collect::<Vec<_>>();
        assert_eq!((links(0, 2), links(2, 0), links(1, 1)), (vec![(0, 0), (1, 0)], vec![(1, 1), (0, 1)], vec![]));
    }

    #[test]
    fn what_is_no_tree_is_named() {
        let join = |a, b| link(at(a, 0), at(b, 0), 1);
        let error = |segments, links: &[Link]| Tree::new(segments, links.to_vec()).unwrap_err();
        assert_eq!(error(3, &[join(0, 1), join(1, 2), join(2, 0)]), TreeError::Loop(2));
        assert_eq!(error(2, &[join(0, 1), join(1, 0)]), TreeError::Loop(1));
        assert_eq!(error(1, &[join(0, 0)]), TreeError::Loop(0));
        assert_eq!(error(3, &[join(0, 1)]), TreeError::Apart(2));
        assert_eq!(error(4, &[join(2, 3)]), TreeError::Apart(1));
        assert_eq!(Tree::new(1, Vec::new()).unwrap(), Tree::line());
    }

    #[test]
    fn only_the_links_between_two_stations_make_their_delay_stray() {
        let places = [at(0, 0), at(0, 100), at(1, 0), at(2, 10)];
        let steady = Delays::new(&three(), &places, &[]);
        assert!(steady.is_steady());
        let delays = Delays::new(&three(), &places, &[0, 1]);
        let strays = [Span::from_ns(7), Span::from_ns(-30)];
        let stray = |a, b| (delays.of(a, b, &strays) - steady.of(a, b, &[])).div_floor(Span::from_ns(1));
        assert_eq!([stray(0, 1), stray(0, 2), stray(2, 3), stray(3, 1)], [0, 7, -30, -23]);
        assert_eq!(delays.nominal(3, 1), steady.nominal(1, 3));
        // Only the second link has jitter: its stray is the first in the list.
        let second = Delays::new(&three(), &places, &[1]);
        assert_eq!((second.of(0, 2, &strays[1..]), second.nominal(0, 2)), (steady.nominal(0, 2), steady.nominal(0, 2)));
        assert_eq!(second.of(0, 3, &strays[1..]) - second.nominal(0, 3), strays[1]);
    }

    prop_compose! {
        /// Any tree: segment n hangs on one of those before it; lengths (m), delays (ns) and stations are drawn.
        fn tree()(
            links in prop::collection::vec((any::<prop::sample::Index>(), 0u64..300, 0u64..300, 0i64..9_000), 0..20),
            stations in prop::collection::vec((any::<prop::sample::Index>(), 0u64..300), 1..30),
        ) -> (Tree, Vec<Place>) {
            let segments = links.len() + 1;
            let hung = links.iter().enumerate().map(|(n, &(on, from, to, delay))| {
                link(at(on.index(n + 1) as u8, from), at(n as u8 + 1, to), delay)
            });
            let places = stations.iter().map(|&(segment, m)| at(segment.index(segments) as u8, m));
            (Tree::new(segments, hung.collect()).expect("a tree"), places.collect())
        }
    }
    proptest! {
        #[test]
        fn delays_of_any_tree_are_symmetric_and_add_up_along_paths((tree, places) in tree()) {
            let delays = Delays::new(&tree, &places, &[]);
            for (a, &from) in places.iter().enumerate() {
                prop_assert_eq!(delays.nominal(a, a), Span::ZERO);
                for (b, &to) in places.iter().enumerate() {
                    let whole = tree.delay(from, to);
                    prop_assert_eq!(whole, tree.delay(to, from));
                    prop_assert_eq!(whole, delays.nominal(a, b));
                    prop_assert_eq!(whole, delays.nominal(b, a));
                    // Through any other station the way is no shorter, through a link on the path as long.
                    for &via in &places {
                        prop_assert!(tree.delay(from, via) + tree.delay(via, to) >= whole);
                    }
                    for (link, near) in tree.path(from.segment, to.segment) {
                        let Link { ends, delay } = tree.links()[link];
                        let parts = tree.delay(from, ends[near]) + delay + tree.delay(ends[1 - near], to);
                        prop_assert_eq!(parts, whole);
                    }
                }
            }
        }
    }
}
