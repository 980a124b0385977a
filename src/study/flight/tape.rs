//! Tape: the last cycles of a run, each with everything that was told in it, and the stretch that is being kept.
//!
//! ```text
//! told:      | cycle k-1                 | cycle k                  | cycle k+1
//! SYNCH:     ====t0                  ====t0                     ====t0
//!                 \__ told in k-1 ___/ begins k
//! ```
//!
//! A telegram is told when its sender decides, before its first bit, so that a cycle's own SYNCH is told in the cycle
//! before: a stretch takes that one along and drops what is not its own at its end. The room of a cycle is used again
//! when it falls off the end, so that nothing is allocated once every one of them has held a usual cycle.

use super::stretch::{Cycle, Entry, Standing, Stretch, What};
use super::trigger::Fired;
use crate::observation::Observation;
use crate::sim::record::{Stamp, Transmission};
use crate::time::Time;
use crate::wire::{Address, Sap};

/// Most entries of one cycle. Model: a T_DP of 32 ms full of tokens has a third of that; before the first cycle and
/// without master it is the latest half that is worth keeping.
const ENTRIES: usize = 32_768;
/// Longest telegram (octets).
const LONGEST: usize = 255;

/// One cycle, or the time before the first.
#[derive(Clone, Debug)]
struct Bucket {
    cycle: Option<Cycle>,
    /// Every station when it began.
    standings: Vec<Standing>,
    entries: Vec<Entry>,
    octets: Vec<u8>,
    left_out: u64,
}

impl Bucket {
    fn begin(&mut self, cycle: Option<Cycle>, standings: &[Standing]) {
        self.cycle = cycle;
        self.standings.clear();
        self.standings.extend_from_slice(standings);
        self.entries.clear();
        self.octets.clear();
        self.left_out = 0;
    }
    /// Adds an entry; a telegram's octets with it.
    fn push(&mut self, mut entry: Entry, octets: &[u8]) {
        if self.entries.len() == ENTRIES {
            self.drop_half();
        }
        if let What::Telegram { from, len, .. } = &mut entry.what {
            (*from, *len) = (self.octets.len() as u32, octets.len() as u16);
            self.octets.extend_from_slice(octets);
        }
        self.entries.push(entry);
    }
    #[cold]
    fn drop_half(&mut self) {
        let kept = self.entries.split_off(ENTRIES / 2);
        for entry in &self.entries {
            if let What::Seen(what) = entry.what
                && let Some(standing) = self.standings.iter_mut().find(|known| known.station == entry.station)
            {
                standing.observe(&what);
            }
        }
        self.left_out += self.entries.len() as u64;
        let octets = std::mem::take(&mut self.octets);
        self.entries.clear();
        for mut entry in kept {
            if let What::Telegram { from, len, .. } = &mut entry.what {
                let old = &octets[*from as usize..][..usize::from(*len)];
                *from = self.octets.len() as u32;
                self.octets.extend_from_slice(old);
            }
            self.entries.push(entry);
        }
    }
    /// Adds everything to `stretch`.
    fn copy_to(&self, stretch: &mut Stretch) {
        if self.left_out > 0 && stretch.entries.is_empty() {
            // As they are after what was left out.
            stretch.standings.clone_from(&self.standings);
        }
        let shift = stretch.octets.len() as u32;
        stretch.octets.extend_from_slice(&self.octets);
        stretch.left_out += self.left_out;
        stretch.entries.extend(self.entries.iter().map(|&(mut entry)| {
            if let What::Telegram { from, .. } = &mut entry.what {
                *from += shift;
            }
            entry
        }));
    }
}

/// The last cycles of a run.
#[derive(Clone, Debug)]
pub struct Tape {
    /// The master whose cycles are counted.
    master: Address,
    /// Every station now.
    standings: Vec<Standing>,
    /// Place of each address in `standings`.
    places: [u8; 128],
    buckets: Vec<Bucket>,
    /// The bucket of the running cycle.
    newest: usize,
    /// Buckets that hold something.
    filled: usize,
    /// First and last bit of the latest SYNCH.
    synch: Option<(Time, Time)>,
    /// The stretch that is being kept.
    open: Option<Stretch>,
    /// End of the latest stretch: the next one begins there at the earliest.
    kept_until: Time,
}

impl Tape {
    /// Nobody there, see [`Self::places`].
    const NOBODY: u8 = u8::MAX;

    /// An empty tape for the network of `stations` that can go back by `before` cycles; cycles are those of `master`.
    pub fn new(master: Address, stations: &[Address], before: usize) -> Self {
        let standings: Vec<_> = stations.iter().map(|&station| Standing::new(station)).collect();
        let mut places = [Self::NOBODY; 128];
        for (place, station) in stations.iter().enumerate() {
            places[usize::from(station.get())] = place as u8;
        }
        let bucket =
            Bucket { cycle: None, standings: standings.clone(), entries: Vec::new(), octets: Vec::new(), left_out: 0 };
        // The running cycle, those before it, and the one in which the first of them was announced.
        let buckets = vec![bucket; before + 2];
        Self {
            master,
            standings,
            places,
            buckets,
            newest: 0,
            filled: 1,
            synch: None,
            open: None,
            kept_until: Time::ZERO,
        }
    }

    /// The running cycle; none before the first.
    pub fn cycle(&self) -> Option<Cycle> {
        self.buckets[self.newest].cycle
    }
    /// The stretch that is being kept.
    pub fn open(&self) -> Option<&Stretch> {
        self.open.as_ref()
    }
    /// The bucket of `back` cycles ago.
    fn bucket(&self, back: usize) -> &Bucket {
        let count = self.buckets.len();
        &self.buckets[(self.newest + count - back) % count]
    }

    /// A telegram was sent.
    pub fn telegram(&mut self, telegram: &Transmission<'_>) {
        let octets = &telegram.octets[..telegram.octets.len().min(LONGEST)];
        if telegram.sender == self.master && is_synch(octets) {
            self.synch = Some((telegram.start, telegram.end));
        }
        let what = What::Telegram { end: telegram.end, from: 0, len: 0, origin: telegram.origin };
        let entry = Entry { at: telegram.start, station: telegram.sender, what };
        self.buckets[self.newest].push(entry, octets);
    }
    /// The telegrams of `sender` that were told and would begin after `now` are none.
    pub fn withdrawn(&mut self, sender: Address, now: Time) {
        let stays =
            |entry: &Entry| entry.station != sender || entry.at <= now || !matches!(entry.what, What::Telegram { .. });
        for bucket in &mut self.buckets {
            bucket.entries.retain(stays);
        }
        if let Some(stretch) = &mut self.open {
            stretch.entries.retain(stays);
        }
    }
    /// Something was observed. The beginning of a cycle must have been told with [`Self::begin`] before.
    pub fn observe(&mut self, stamp: &Stamp<'_>, what: &Observation) {
        let place = self.places[usize::from(stamp.station.get())];
        if let Some(standing) = self.standings.get_mut(usize::from(place)) {
            standing.observe(what);
        }
        let entry = Entry { at: stamp.at, station: stamp.station, what: What::Seen(*what) };
        self.buckets[self.newest].push(entry, &[]);
    }
    /// Cycle `number` begins at `t0`. Returns where the one before ends.
    pub fn begin(&mut self, number: u64, t0: Time) -> Time {
        let begin = self.synch.take().filter(|&(_, end)| end == t0).map_or(t0, |(start, _)| start);
        let cycle = Cycle { number, begin, t0 };
        if let Some(stretch) = &mut self.open {
            self.buckets[self.newest].copy_to(stretch);
        }
        self.newest = (self.newest + 1) % self.buckets.len();
        self.filled = (self.filled + 1).min(self.buckets.len());
        self.buckets[self.newest].begin(Some(cycle), &self.standings);
        begin
    }
    /// The running cycle belongs to the open stretch.
    pub fn go_on(&mut self) {
        if let (Some(stretch), Some(cycle)) = (&mut self.open, self.buckets[self.newest].cycle) {
            stretch.cycles.push(cycle);
        }
    }

    /// Opens a stretch at the running cycle and as many before it as there are. Without a running cycle nothing happens.
    pub fn keep(&mut self) {
        if self.cycle().is_none() {
            return;
        }
        let mut stretch = Stretch::default();
        let own = |back: &usize| self.bucket(*back).cycle.is_some_and(|cycle| cycle.begin >= self.kept_until);
        let oldest = (0..self.filled.min(self.buckets.len() - 1)).take_while(own).last().unwrap_or(0);
        let announced = (oldest + 1).min(self.filled - 1);
        stretch.standings.clone_from(&self.bucket(announced).standings);
        for back in (1..=announced).rev() {
            self.bucket(back).copy_to(&mut stretch);
        }
        stretch.cycles.extend((0..=oldest).rev().filter_map(|back| self.bucket(back).cycle));
        self.open = Some(stretch);
    }
    /// Notes in the open stretch why it is kept.
    pub fn note(&mut self, fired: Fired) {
        if let Some(stretch) = &mut self.open {
            stretch.triggers.push(fired);
        }
    }
    /// The open stretch ended at `end`, where another cycle has just begun.
    pub fn close(&mut self, end: Time) -> Option<Stretch> {
        let mut stretch = self.open.take()?;
        self.kept_until = end;
        stretch.finish(end, true);
        Some(stretch)
    }
    /// The run is over at `end`: hands over the open stretch.
    pub fn finish(mut self, end: Time) -> Option<Stretch> {
        let mut stretch = self.open.take()?;
        self.buckets[self.newest].copy_to(&mut stretch);
        stretch.finish(end, false);
        Some(stretch)
    }
}

/// Whether these are the octets of SYNCH: Global_Control `00 80` (Model: D5).
fn is_synch(octets: &[u8]) -> bool {
    matches!(*octets, [0x68, _, _, _, _, _, _, dsap, _, 0x00, 0x80, _, _] if Sap(dsap) == Sap::GLOBAL_CONTROL)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::Phase;
    use crate::sim::crystal::Crystal;
    use crate::sim::record::Origin;
    use crate::time::{Local, Span};

    const MASTER: Address = Address::new(2).unwrap();
    const SLAVE: Address = Address::new(3).unwrap();
    /// SYNCH of master 2.
    const SYNCH: [u8; 13] = [0x68, 7, 7, 0x68, 0xFF, 0x82, 0x46, 0x3A, 0x3E, 0x00, 0x80, 0xBF, 0x16];

    /// A tape that is told cycles of 100 us: SYNCH from -10 us, one observation and one reply in each.
    struct Told {
        tape: Tape,
        crystal: Crystal,
    }
    fn us(us: i64) -> Time {
        Time::ZERO + Span::from_us(us)
    }
    impl Told {
        fn new(before: usize) -> Self {
            let crystal = Crystal::new(0, Local::ZERO).unwrap();
            Self { tape: Tape::new(MASTER, &[MASTER, SLAVE], before), crystal }
        }
        fn send(&mut self, at: i64, sender: Address, octets: &[u8]) {
            let (start, end) = (us(at), us(at + 10));
            self.tape.telegram(&Transmission { start, end, sender, octets, origin: Origin::Sender });
        }
        fn see(&mut self, at: i64, station: Address, what: &Observation) {
            self.tape.observe(&Stamp { at: us(at), station, crystal: &self.crystal }, what);
        }
        /// Cycle `number` from 100 us x number on, whose SYNCH is told 40 us before. Returns where the one before ends.
        fn cycle(&mut self, number: i64) -> Time {
            let t0 = number * 100;
            let end = self.tape.begin(number as u64, us(t0));
            self.tape.go_on();
            self.see(t0 + 1, SLAVE, &Observation::Fault { code: number as u16 });
            self.send(t0 + 20, SLAVE, &[0xE5]);
            self.send(t0 + 90, MASTER, &SYNCH);
            self.see(t0 + 61, SLAVE, &Observation::TokenClaimed);
            end
        }
    }
    /// Instants (us) of what a stretch has.
    fn instants(stretch: &Stretch) -> Vec<i64> {
        stretch.entries.iter().map(|entry| (entry.at - Time::ZERO).div_floor(Span::from_us(1))).collect()
    }

    #[test]
    fn a_stretch_goes_back_takes_its_synch_along_and_leaves_that_of_the_next() {
        let mut told = Told::new(2);
        for number in 1..=5 {
            told.cycle(number);
        }
        told.tape.keep();
        assert_eq!(told.cycle(6), us(590));
        let end = told.cycle(7);
        let stretch = told.tape.close(end).unwrap();
        // Cycle 7 was taken in before the stretch was closed.
        let numbers: Vec<u64> = stretch.cycles.iter().map(|cycle| cycle.number).collect();
        assert_eq!((numbers, stretch.end), (vec![3, 4, 5, 6, 7], us(690)));
        assert_eq!(instants(&stretch)[..6], [290, 301, 320, 361, 390, 401]);
        assert_eq!(instants(&stretch).last(), Some(&661));
        assert!(stretch.entries.iter().all(|entry| match entry.what {
            What::Telegram { len, .. } =>
                stretch.octets(entry).len() == usize::from(len) && stretch.octets(entry)[0] != 0,
            What::Seen(_) => stretch.octets(entry).is_empty(),
        }));
        assert_eq!(stretch.standings[1].fault, 2, "as cycle 2 left it");
    }

    #[test]
    fn stretches_do_not_overlap() {
        let mut told = Told::new(3);
        for number in 1..=4 {
            told.cycle(number);
        }
        told.tape.keep();
        let end = told.tape.begin(5, us(500));
        let first = told.tape.close(end).unwrap();
        told.tape.keep();
        told.send(590, MASTER, &SYNCH);
        let end = told.tape.begin(6, us(600));
        let second = told.tape.close(end).unwrap();
        assert_eq!((first.numbers(), second.numbers()), ((1, 4), (5, 5)));
        assert_eq!((first.end, second.begin()), (us(490), us(490)));
        assert_eq!((instants(&first)[0], instants(&second)), (101, vec![490]), "cycle 1 has no SYNCH");
    }

    #[test]
    fn a_cycle_that_never_ends_keeps_its_later_half() {
        let mut told = Told::new(0);
        told.tape.begin(1, us(100));
        let (from, to) = (Phase::Configuration, Phase::Operation);
        told.see(101, SLAVE, &Observation::Phase { from, to });
        for number in 0..ENTRIES as i64 {
            told.send(200 + number, SLAVE, &[0x10, number as u8]);
        }
        told.tape.keep();
        let stretch = told.tape.finish(us(1_000_000)).unwrap();
        assert_eq!((stretch.entries.len(), stretch.left_out), (ENTRIES / 2 + 1, ENTRIES as u64 / 2));
        let last = stretch.entries.last().unwrap();
        assert_eq!(stretch.octets(last), [0x10, (ENTRIES - 1) as u8]);
        assert_eq!(stretch.standings[1].phase, Phase::Operation, "what was dropped has its effect");
    }

    #[test]
    fn what_a_station_without_supply_had_planned_is_not_on_the_tape() {
        let mut told = Told::new(1);
        told.cycle(1);
        told.tape.keep();
        told.tape.withdrawn(MASTER, us(150));
        told.tape.withdrawn(SLAVE, us(150));
        let stretch = told.tape.finish(us(200)).unwrap();
        assert_eq!(instants(&stretch), [101, 120, 161], "its SYNCH at 190 us never left");
    }
}
