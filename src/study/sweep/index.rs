//! Index: where the last record of every run is, in a file without a name, so that memory does not grow with the runs.
//!
//! The file is a row of places, each empty or with one run. Keys are hashes and evenly spread: the share that a key is of
//! the largest one tells its first place, and the next empty one from there on takes it. So neighbouring places that are
//! not empty hold neighbouring keys, and all of them can be told in order without being sorted as a whole. At most half
//! of the places are taken; then there are twice as many. Keys that come in order would crowd into the first places of a
//! row that is too short for those that follow; so a row begins as long as is known to be needed.

use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, Read, Seek, SeekFrom, Write};

use super::key::RunKey;
use super::temporary;

/// Octets of a place: the key, where the record is, how long it is, whether it is good.
const PLACE: usize = 32;
/// Places that are read at once where one is looked for: more than a search takes, nearly always.
const LOOK: usize = 8;
/// Places that are read at once where all are told.
const STRETCH: usize = 256;
/// The least number of places is 2 to this power.
const LEAST_BITS: u32 = 10;

/// Where a record is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Entry {
    /// Octets before its line.
    pub(super) at: u64,
    /// Octets of the whole line, at least 1.
    pub(super) length: u32,
    /// Whether the run has its figures.
    pub(super) good: bool,
}

/// Which run's record is where.
#[derive(Debug)]
pub(super) struct Index {
    file: File,
    /// There are 2 to this power first places; the last keys may stand beyond.
    bits: u32,
    runs: u64,
}

impl Index {
    /// An empty one for so many runs, or more.
    ///
    /// # Errors
    /// No temporary file can be made.
    pub(super) fn new(runs: u64) -> io::Result<Self> {
        Self::with((2 * runs).next_power_of_two().ilog2().max(LEAST_BITS))
    }
    fn with(bits: u32) -> io::Result<Self> {
        Ok(Self { file: temporary::file()?, bits, runs: 0 })
    }

    /// Where this run's record is; none if it has none.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(super) fn get(&self, key: RunKey) -> io::Result<Option<Entry>> {
        Ok(self.find(key)?.1)
    }
    /// Says where this run's record is, whatever was said before.
    ///
    /// # Errors
    /// The file cannot be read or written.
    pub(super) fn insert(&mut self, key: RunKey, entry: Entry) -> io::Result<()> {
        let (mut place, known) = self.find(key)?;
        if known.is_none() {
            if self.runs >= 1 << (self.bits - 1) {
                self.grow()?;
                place = self.find(key)?.0;
            }
            self.runs += 1;
        }
        (&self.file).seek(SeekFrom::Start(place * PLACE as u64))?;
        (&self.file).write_all(&octets(key, entry))
    }
    /// All runs, in the order of their keys.
    pub(super) fn iter(&self) -> Iter<'_> {
        Iter { index: self, next: 0, stretch: Vec::new(), ended: false, neighbours: Vec::new() }
    }

    /// The place of this run, or the empty one that it would take.
    fn find(&self, key: RunKey) -> io::Result<(u64, Option<Entry>)> {
        let mut first = self.first(key);
        loop {
            for (place, taken) in (first..).zip(self.read(first, LOOK)?) {
                match taken {
                    None => return Ok((place, None)),
                    Some((other, entry)) if other == key => return Ok((place, Some(entry))),
                    Some(_) => {}
                }
            }
            first += LOOK as u64;
        }
    }
    fn first(&self, key: RunKey) -> u64 {
        (key.0 >> (u128::BITS - self.bits)) as u64
    }
    /// So many places from this one on; beyond the end of the file they are empty.
    fn read(&self, first: u64, places: usize) -> io::Result<impl Iterator<Item = Option<(RunKey, Entry)>>> {
        let mut octets = [0; STRETCH * PLACE];
        let wanted = &mut octets[..places * PLACE];
        (&self.file).seek(SeekFrom::Start(first * PLACE as u64))?;
        let mut read = 0;
        while read < wanted.len() {
            match (&self.file).read(&mut wanted[read..]) {
                Ok(0) => break,
                Ok(more) => read += more,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok((0..places).map(move |place| taken(octets[place * PLACE..].first_chunk()?)))
    }
    /// Twice as many places.
    fn grow(&mut self) -> io::Result<()> {
        let mut wider = Self::with(self.bits + 1)?;
        let mut file = BufWriter::new(&wider.file);
        let mut end = 0;
        for taken in self.iter() {
            let (key, entry) = taken?;
            let place = wider.first(key).max(end);
            io::copy(&mut io::repeat(0).take((place - end) * PLACE as u64), &mut file)?;
            file.write_all(&octets(key, entry))?;
            end = place + 1;
        }
        file.flush()?;
        drop(file);
        wider.runs = self.runs;
        *self = wider;
        Ok(())
    }
}

fn octets(key: RunKey, entry: Entry) -> [u8; PLACE] {
    let mut octets = [0; PLACE];
    octets[..16].copy_from_slice(&key.0.to_le_bytes());
    octets[16..24].copy_from_slice(&entry.at.to_le_bytes());
    octets[24..28].copy_from_slice(&entry.length.to_le_bytes());
    octets[28] = entry.good.into();
    octets
}
/// What stands in a place; an empty one has no length.
fn taken(octets: &[u8; PLACE]) -> Option<(RunKey, Entry)> {
    let key = RunKey(u128::from_le_bytes(*octets.first_chunk()?));
    let at = u64::from_le_bytes(*octets[16..].first_chunk()?);
    let length = u32::from_le_bytes(*octets[24..].first_chunk()?);
    (length > 0).then_some((key, Entry { at, length, good: octets[28] == 1 }))
}

/// The runs of an index in order.
pub(super) struct Iter<'a> {
    index: &'a Index,
    /// The first place that is not read yet.
    next: u64,
    /// What was read and not looked at, the last place first.
    stretch: Vec<Option<(RunKey, Entry)>>,
    ended: bool,
    /// Runs of neighbouring places, the last key first.
    neighbours: Vec<(RunKey, Entry)>,
}

impl Iter<'_> {
    /// Reads the next places.
    fn read(&mut self) -> io::Result<()> {
        let all: Vec<_> = self.index.read(self.next, STRETCH)?.collect();
        self.next += STRETCH as u64;
        // Places beyond the first ones follow without a gap.
        self.ended = self.next > 1 << self.index.bits && all.last().is_some_and(Option::is_none);
        self.stretch.extend(all.into_iter().rev());
        Ok(())
    }
    /// Takes the runs of the next places that are not empty.
    fn gather(&mut self) -> io::Result<()> {
        loop {
            match self.stretch.pop() {
                Some(Some(taken)) => self.neighbours.push(taken),
                Some(None) if self.neighbours.is_empty() => {}
                None if !self.ended => self.read()?,
                Some(None) | None => break,
            }
        }
        self.neighbours.sort_unstable_by(|(one, _), (other, _)| other.cmp(one));
        Ok(())
    }
}

impl Iterator for Iter<'_> {
    type Item = io::Result<(RunKey, Entry)>;
    fn next(&mut self) -> Option<Self::Item> {
        if self.neighbours.is_empty()
            && let Err(error) = self.gather()
        {
            return Some(Err(error));
        }
        self.neighbours.pop().map(Ok)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    fn entry(at: u64) -> Entry {
        Entry { at, length: 7, good: at.is_multiple_of(2) }
    }

    /// Keys as hashes are, and such as no hash would be: all alike but for the last bits, at both ends.
    fn key() -> impl Strategy<Value = RunKey> {
        prop_oneof![any::<u128>(), 0..40u128, (0..40u128).prop_map(|less| u128::MAX - less)].prop_map(RunKey)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn it_finds_what_a_map_finds_and_tells_it_in_the_same_order(
            all in prop::collection::vec((key(), 0..1_000u64), 0..3_000),
        ) {
            let (mut index, mut map) = (Index::new(0).unwrap(), BTreeMap::new());
            for (key, at) in all {
                prop_assert_eq!(index.get(key).unwrap(), map.get(&key).copied());
                index.insert(key, entry(at)).unwrap();
                map.insert(key, entry(at));
                prop_assert_eq!(index.get(key).unwrap(), Some(entry(at)));
            }
            let told: Vec<_> = index.iter().collect::<io::Result<_>>().unwrap();
            prop_assert_eq!(told, map.into_iter().collect::<Vec<_>>());
        }
    }

    #[test]
    fn keys_that_come_in_order_stand_near_their_first_places() {
        const RUNS: u64 = 20_000;
        let mut index = Index::new(RUNS).unwrap();
        let even = u128::MAX / u128::from(RUNS);
        for number in 0..RUNS {
            index.insert(RunKey(u128::from(number) * even), entry(number)).unwrap();
        }
        for number in 0..RUNS {
            let key = RunKey(u128::from(number) * even);
            assert!(index.find(key).unwrap().0 - index.first(key) < 2, "{number}");
        }
    }

    #[test]
    fn looking_something_up_does_not_disturb_who_tells_all() {
        let mut index = Index::new(3).unwrap();
        let keys: Vec<_> = (0..1_000u128).map(|number| RunKey(number << 118 | 5)).collect();
        for &key in &keys {
            index.insert(key, entry(1)).unwrap();
        }
        for (&key, told) in keys.iter().zip(index.iter()) {
            assert_eq!((told.unwrap().0, index.get(keys[3]).unwrap()), (key, Some(entry(1))));
        }
    }
}
