//! Fingerprints: one number for all octets, one for all changes of state, one for all latch instants.
//!
//! Each station has its own three, so that a station more or less leaves those of the others as they were. The
//! network's are made of its stations' in the order of addresses. Along the way checkpoints are kept, so that two runs
//! that differ can be told apart down to a stretch of cycles.

use std::fmt::{self, Write};
use std::hash::Hasher;

use twox_hash::XxHash64;

use super::record::{Recorder, Stamp, Transmission};
use crate::observation::{Disturbance, Observation};
use crate::time::Time;
use crate::wire::{Address, MAX_FRAME};

/// Most checkpoints kept; with more, every second one is dropped.
const CHECKPOINTS: usize = 64;

/// A running hash. XXH64 of octets: stable for good, on every machine.
#[derive(Clone)]
pub struct Digest(XxHash64);

impl Default for Digest {
    fn default() -> Self {
        Self(XxHash64::with_seed(0))
    }
}
impl Digest {
    /// Adds octets.
    pub fn octets(&mut self, octets: &[u8]) {
        self.0.write(octets);
    }
    /// Adds a number.
    pub fn number(&mut self, number: u64) {
        self.octets(&number.to_le_bytes());
    }
    fn instant(&mut self, at: Time) {
        self.octets(&at.ticks().to_le_bytes());
    }
    /// The hash of everything so far.
    pub fn value(&self) -> u64 {
        self.0.finish()
    }
}
impl Write for Digest {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.octets(text.as_bytes());
        Ok(())
    }
}

/// What one station, or a whole network, did.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Fingerprint {
    /// Every telegram sent: start and octets.
    pub wire: u64,
    /// Every event, see [`Observation::is_event`]: instant and text.
    pub states: u64,
    /// Every latch: instant and words.
    pub latches: u64,
}
impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "wire {:016x}  states {:016x}  latches {:016x}", self.wire, self.states, self.latches)
    }
}

/// Octets of an instant.
const INSTANT: usize = size_of::<i64>();

/// The latest telegram of a station, which may still be withdrawn: its first bit's instant, then its octets.
#[derive(Clone)]
struct Latest {
    start: Time,
    octets: [u8; INSTANT + MAX_FRAME],
    /// 0 if there is none.
    length: usize,
}

impl Default for Latest {
    fn default() -> Self {
        Self { start: Time::ZERO, octets: [0; INSTANT + MAX_FRAME], length: 0 }
    }
}
impl Latest {
    fn set(&mut self, start: Time, octets: &[u8]) {
        self.start = start;
        self.length = INSTANT + octets.len();
        self.octets[..INSTANT].copy_from_slice(&start.ticks().to_le_bytes());
        self.octets[INSTANT..self.length].copy_from_slice(octets);
    }
    fn octets(&self) -> &[u8] {
        &self.octets[..self.length]
    }
}

#[derive(Clone, Default)]
struct Station {
    /// All telegrams but the latest.
    wire: Digest,
    /// A station gives no other telegram to the line before this one has left.
    latest: Latest,
    states: Digest,
    latches: Digest,
}

impl Station {
    fn fingerprint(&self) -> Fingerprint {
        let mut wire = self.wire.clone();
        wire.octets(self.latest.octets());
        Fingerprint { wire: wire.value(), states: self.states.value(), latches: self.latches.value() }
    }
}

/// Takes the fingerprints of a run.
#[derive(Clone)]
pub struct Fingerprints {
    /// The master whose cycles are counted; others number their own.
    master: Address,
    stations: Vec<Option<Station>>,
    checkpoints: Vec<(u64, Fingerprint)>,
    stride: u64,
}

impl Fingerprints {
    /// Nothing seen yet of a run whose cycles are those of `master`.
    pub fn new(master: Address) -> Self {
        Self { master, stations: vec![None; 128], checkpoints: Vec::with_capacity(CHECKPOINTS + 1), stride: 1 }
    }
    fn station(&mut self, address: Address) -> &mut Station {
        self.stations[usize::from(address.get())].get_or_insert_default()
    }
    /// Fingerprints of each station that was ever seen, in the order of addresses.
    pub fn stations(&self) -> impl Iterator<Item = (Address, Fingerprint)> {
        self.stations
            .iter()
            .enumerate()
            .filter_map(|(address, station)| Some((Address::new(address as u8)?, station.as_ref()?.fingerprint())))
    }
    /// The network's fingerprint.
    pub fn total(&self) -> Fingerprint {
        let mut total = Station::default();
        for (address, station) in self.stations() {
            for (digest, part) in [
                (&mut total.wire, station.wire),
                (&mut total.states, station.states),
                (&mut total.latches, station.latches),
            ] {
                digest.number(address.get().into());
                digest.number(part);
            }
        }
        total.fingerprint()
    }
    /// The network's fingerprint at the start of some cycles, evenly spread over the run.
    pub fn checkpoints(&self) -> &[(u64, Fingerprint)] {
        &self.checkpoints
    }
    fn checkpoint(&mut self, cycle: u64) {
        if !cycle.is_multiple_of(self.stride) {
            return;
        }
        self.checkpoints.push((cycle, self.total()));
        if self.checkpoints.len() > CHECKPOINTS {
            self.stride *= 2;
            let stride = self.stride;
            self.checkpoints.retain(|(cycle, _)| cycle.is_multiple_of(stride));
        }
    }
}

impl Recorder for Fingerprints {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        let Station { wire, latest, .. } = self.station(telegram.sender);
        wire.octets(latest.octets());
        latest.set(telegram.start, telegram.octets);
    }
    fn withdrawn(&mut self, sender: Address, now: Time) {
        if let Some(Station { latest, .. }) = &mut self.stations[usize::from(sender.get())]
            && latest.start > now
        {
            latest.length = 0;
        }
    }
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        match what {
            Observation::CycleStart { cycle, .. } if stamp.station == self.master => self.checkpoint(*cycle),
            // What was done to a station shows in what it did.
            Observation::CycleStart { .. }
            | Observation::Disturbed { how: Disturbance::Begins | Disturbance::Ends, .. } => {}
            Observation::Latch { locked, inputs } => {
                // One piece: a hash takes longer to be told something than to add it.
                let mut octets = [0; INSTANT + 9];
                octets[..INSTANT].copy_from_slice(&stamp.at.ticks().to_le_bytes());
                octets[INSTANT] = u8::from(*locked);
                octets[INSTANT + 1..][..4].copy_from_slice(&inputs.xist1.to_le_bytes());
                octets[INSTANT + 5..].copy_from_slice(&inputs.xist2.to_le_bytes());
                self.station(stamp.station).latches.octets(&octets);
            }
            event if event.is_event() => {
                let states = &mut self.station(stamp.station).states;
                states.instant(stamp.at);
                // Writing into a digest cannot fail.
                let _ = write!(states, "{event}");
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::crystal::Crystal;
    use crate::sim::record::Origin;
    use crate::time::{Local, Span};

    const MASTER: Address = Address::new(2).unwrap();

    fn send(all: &mut Fingerprints, sender: u8, octets: &[u8]) {
        let start = Time::ZERO + Span::from_us(1);
        let sender = Address::new(sender).unwrap();
        all.telegram(&Transmission { start, end: start, sender, octets, origin: Origin::Sender });
    }

    #[test]
    fn a_further_station_changes_nothing_for_the_others() {
        let [mut one, mut two] = [Fingerprints::new(MASTER), Fingerprints::new(MASTER)];
        send(&mut one, 3, &[1, 2]);
        send(&mut two, 3, &[1, 2]);
        send(&mut two, 4, &[5]);
        assert_eq!(one.stations().next(), two.stations().next());
        assert_ne!(one.total().wire, two.total().wire);
        assert_ne!(one.total().latches, two.total().latches, "a station that is there counts");
    }

    #[test]
    fn a_telegram_that_never_began_is_none() {
        let [us, slave] = [Span::from_us(1), Span::from_us(2)].map(|span| Time::ZERO + span);
        let slave = (Address::new(3).unwrap(), slave);
        let [mut one, mut two] = [Fingerprints::new(MASTER), Fingerprints::new(MASTER)];
        send(&mut one, 3, &[1, 2]);
        send(&mut two, 3, &[1, 2]);
        // Its first bit has left.
        two.withdrawn(slave.0, us);
        assert_eq!(one.total(), two.total());
        two.telegram(&Transmission {
            start: slave.1,
            end: slave.1,
            sender: slave.0,
            octets: &[7],
            origin: Origin::Sender,
        });
        assert_ne!(one.total(), two.total());
        two.withdrawn(MASTER, us);
        two.withdrawn(slave.0, us);
        let [one, two] = [&one, &two].map(|all| all.stations().find(|(station, _)| *station == slave.0));
        assert_eq!(one, two);
    }

    #[test]
    fn one_octet_shows() {
        let [mut one, mut two] = [Fingerprints::new(MASTER), Fingerprints::new(MASTER)];
        send(&mut one, 3, &[1, 2]);
        send(&mut two, 3, &[1, 3]);
        assert_ne!(one.total(), two.total());
    }

    #[test]
    fn checkpoints_stay_few_and_evenly_spread() {
        let mut all = Fingerprints::new(MASTER);
        let crystal = Crystal::new(0, Local::ZERO).unwrap();
        let stamp = Stamp { at: Time::ZERO, station: MASTER, crystal: &crystal };
        let other = Stamp { station: Address::new(1).unwrap(), ..stamp };
        for cycle in 0..10_000 {
            all.observe(stamp, &Observation::CycleStart { cycle, nominal: Local::ZERO });
            // Another master counts cycles of its own.
            all.observe(other, &Observation::CycleStart { cycle: cycle / 3, nominal: Local::ZERO });
        }
        let cycles: Vec<u64> = all.checkpoints().iter().map(|&(cycle, _)| cycle).collect();
        assert!(cycles.len() <= CHECKPOINTS && cycles.len() > CHECKPOINTS / 4);
        assert!(cycles.windows(2).all(|pair| pair[1] - pair[0] == cycles[1]), "{cycles:?}");
    }
}
