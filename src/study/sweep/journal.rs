//! Journal: what every finished run came to, one line each, appended as it comes and never changed.
//!
//! A line is a JSON object that tells whether it is whole:
//!
//! ```text
//! {"sum":"9f0c5e1a77b2d340","len":115,"run":{"key":"...","seed":1,"figures":{"faults":{"count":0},"lock_time":null}}}
//! ```
//!
//! `len` are the octets of the object after `run`, `sum` is their XXH64. However a sweep ends, at most the last line is
//! torn; opening the journal cuts such an end off. A line that was damaged later is passed over, and its run is run again.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::index::{Entry, Index};
use super::key::RunKey;
use crate::sim::fingerprint::Digest;
use crate::study::figure::Value;
use crate::study::statistics::aggregate::text;

/// What one run came to.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Record {
    /// Which run.
    #[serde(with = "text")]
    pub key: RunKey,
    /// Its seed.
    pub seed: u64,
    /// Its figures by name, exact, as far as they have a value; nothing if it failed.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub figures: BTreeMap<String, Option<Value>>,
    /// The figures whose expectations do not hold; none if the scenario expects nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub broken: Option<Vec<String>>,
    /// Why it failed, if it did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<Failure>,
}

impl Record {
    /// What became of the run, in a word.
    pub const fn status(&self) -> &'static str {
        match (&self.failure, &self.broken) {
            (Some(_), _) => "failed",
            (None, None) => "done",
            (None, Some(broken)) if broken.is_empty() => "passed",
            (None, Some(_)) => "broken",
        }
    }
    /// Whether it failed or broke an expectation.
    pub fn is_bad(&self) -> bool {
        self.failure.is_some() || self.broken.as_ref().is_some_and(|broken| !broken.is_empty())
    }
}

/// Why a run has no figures.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Failure {
    /// In words.
    pub reason: String,
    /// The last cycle that had begun when somebody looked.
    pub cycle: u64,
}

/// The journal of a sweep, open for more.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    end: u64,
    index: Index,
    /// Lines that were passed over.
    damaged: usize,
}

/// The journal cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[error("cannot {what} the journal {}: {source}", path.display())]
pub struct JournalError {
    what: &'static str,
    path: PathBuf,
    source: io::Error,
}

/// Longest line that is taken for one (octets): far more than any record has.
const LONGEST: u64 = 16 << 20;
/// What is read at once (octets).
const BUFFER: usize = 1 << 18;

impl Journal {
    /// Opens the journal at `path`, or begins it. A record counts as good if it has all `figures`.
    ///
    /// # Errors
    /// The file cannot be opened, read or cut.
    pub fn open(path: &Path, figures: &[String]) -> Result<Self, JournalError> {
        let (journal, length) = Self::with(path, File::options().read(true).append(true).create(true), figures)?;
        if length > journal.end {
            let cut = journal.file.set_len(journal.end);
            cut.map_err(|source| journal.error("cut the torn end of", source))?;
        }
        Ok(journal)
    }
    /// The journal at `path` as it is, to be read alone.
    ///
    /// # Errors
    /// The file cannot be opened or read.
    pub fn look(path: &Path, figures: &[String]) -> Result<Self, JournalError> {
        Ok(Self::with(path, File::options().read(true), figures)?.0)
    }
    fn with(path: &Path, options: &OpenOptions, figures: &[String]) -> Result<(Self, u64), JournalError> {
        let error = |what| move |source| JournalError { what, path: path.to_owned(), source };
        let file = options.open(path).map_err(error("open"))?;
        let lines = lines(&file).map_err(error("read"))?;
        let index = Index::new(lines).map_err(error("index"))?;
        let mut journal = Self { path: path.to_owned(), file, end: 0, index, damaged: 0 };
        let length = journal.scan(figures).map_err(error("read"))?;
        Ok((journal, length))
    }
    /// Reads every line; returns the length of the file, torn end included.
    fn scan(&mut self, figures: &[String]) -> io::Result<u64> {
        let mut reader = BufReader::with_capacity(BUFFER, &self.file);
        let mut line = Vec::new();
        let mut at = 0;
        loop {
            line.clear();
            let length = (&mut reader).take(LONGEST).read_until(b'\n', &mut line)? as u64;
            if length == 0 {
                return Ok(at);
            }
            let whole = line.ends_with(b"\n");
            match parse(&line) {
                Some(record) if whole => {
                    let good = record.failure.is_none() && figures.iter().all(|name| record.figures.contains_key(name));
                    self.index.insert(record.key, Entry { at, length: length as u32, good })?;
                }
                _ if whole => self.damaged += 1,
                _ => {}
            }
            at += length;
            if whole {
                self.end = at;
            }
        }
    }

    /// Appends one record. It is in the file when this returns.
    ///
    /// # Errors
    /// The file cannot be written, most likely because the disk is full.
    pub fn append(&mut self, record: &Record) -> Result<(), JournalError> {
        let line = line(record);
        self.file.write_all(&line).map_err(|source| self.error("write", source))?;
        let entry = Entry { at: self.end, length: line.len() as u32, good: record.failure.is_none() };
        self.index.insert(record.key, entry).map_err(|source| self.error("index", source))?;
        self.end += line.len() as u64;
        Ok(())
    }
    /// Whether this run has its figures.
    ///
    /// # Errors
    /// What was indexed cannot be read.
    pub fn has(&self, key: RunKey) -> Result<bool, JournalError> {
        Ok(self.entry(key)?.is_some_and(|entry| entry.good))
    }
    /// Whether this run has a record, be it one of its failure.
    ///
    /// # Errors
    /// What was indexed cannot be read.
    pub fn knows(&self, key: RunKey) -> Result<bool, JournalError> {
        Ok(self.entry(key)?.is_some())
    }
    /// The last record of this run; none if there is none.
    ///
    /// # Errors
    /// The file cannot be read, or is not what it was any more.
    pub fn get(&self, key: RunKey) -> Result<Option<Record>, JournalError> {
        self.entry(key)?.map(|entry| self.read(entry)).transpose()
    }
    /// The last record of every run, in the order of their keys.
    pub fn records(&self) -> impl Iterator<Item = Result<Record, JournalError>> {
        self.index.iter().map(|told| {
            let (_, entry) = told.map_err(|source| self.error("read the index of", source))?;
            self.read(entry)
        })
    }
    /// How many lines were passed over because they are damaged.
    pub fn damaged(&self) -> usize {
        self.damaged
    }
    /// Sees to it that what was appended outlives the machine's next power failure.
    ///
    /// # Errors
    /// The disk does not take it.
    pub fn sync(&self) -> Result<(), JournalError> {
        self.file.sync_data().map_err(|source| self.error("write", source))
    }
    /// Writes the last record of every run, in the order of their keys: the same octets, however they came to be here.
    ///
    /// # Errors
    /// A record cannot be read, or `out` takes no more.
    pub fn sorted(&self, out: &mut impl Write) -> Result<(), JournalError> {
        for record in self.records() {
            out.write_all(&line(&record?)).map_err(|source| self.error("copy", source))?;
        }
        Ok(())
    }
    fn entry(&self, key: RunKey) -> Result<Option<Entry>, JournalError> {
        self.index.get(key).map_err(|source| self.error("read the index of", source))
    }
    fn read(&self, entry: Entry) -> Result<Record, JournalError> {
        let mut octets = vec![0; entry.length as usize];
        let mut file = &self.file;
        let read = file.seek(SeekFrom::Start(entry.at)).and_then(|_| file.read_exact(&mut octets));
        let record = read.and_then(|()| parse(&octets).ok_or_else(|| io::ErrorKind::InvalidData.into()));
        record.map_err(|source| self.error("read", source))
    }
    fn error(&self, what: &'static str, source: io::Error) -> JournalError {
        JournalError { what, path: self.path.clone(), source }
    }
}

/// How many lines `file` has, a torn one included; it is read from its beginning again then.
fn lines(mut file: &File) -> io::Result<u64> {
    let mut reader = BufReader::with_capacity(BUFFER, file);
    let mut lines = 0;
    while reader.skip_until(b'\n')? > 0 {
        lines += 1;
    }
    file.rewind()?;
    Ok(lines)
}

/// The line of one record.
fn line(record: &Record) -> Vec<u8> {
    let run = serde_json::to_vec(record).expect("a record is plain data");
    let mut line = format!("{{\"sum\":\"{:016x}\",\"len\":{},\"run\":", sum(&run), run.len()).into_bytes();
    line.extend_from_slice(&run);
    line.extend_from_slice(b"}\n");
    line
}

/// The record of one line, if it is whole.
fn parse(line: &[u8]) -> Option<Record> {
    let rest = line.strip_prefix(b"{\"sum\":\"")?;
    let (digits, rest) = rest.split_at_checked(16)?;
    let rest = rest.strip_prefix(b"\",\"len\":")?;
    let comma = rest.iter().position(|&octet| octet == b',')?;
    let length: usize = std::str::from_utf8(&rest[..comma]).ok()?.parse().ok()?;
    let run = rest[comma..].strip_prefix(b",\"run\":")?.strip_suffix(b"}\n")?;
    let expected = u64::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?;
    let whole = run.len() == length && sum(run) == expected;
    whole.then(|| serde_json::from_slice(run).ok()).flatten()
}

fn sum(octets: &[u8]) -> u64 {
    let mut digest = Digest::default();
    digest.octets(octets);
    digest.value()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Span;
    use std::fs;

    fn key(number: u128) -> RunKey {
        format!("{number:032x}").parse().unwrap()
    }
    fn record(number: u128) -> Record {
        let figures = [("faults", Value::Count(3)), ("latch_skew.p99", Value::Span(Span::from_ns(441)))];
        let figures = figures.into_iter().map(|(name, value)| (name.to_owned(), Some(value))).collect();
        Record { key: key(number), seed: 7, figures, broken: Some(Vec::new()), failure: None }
    }
    fn has(journal: &Journal, number: u128) -> bool {
        journal.has(key(number)).unwrap()
    }
    fn names() -> Vec<String> {
        vec!["faults".to_owned()]
    }
    fn filled(path: &Path, numbers: &[u128]) {
        let mut journal = Journal::open(path, &names()).unwrap();
        for &number in numbers {
            journal.append(&record(number)).unwrap();
        }
    }

    #[test]
    fn what_was_appended_is_found_again() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("journal.jsonl");
        filled(&path, &[5, 1, 3]);
        let mut journal = Journal::open(&path, &names()).unwrap();
        let keys = journal.records().map(|record| record.unwrap().key).collect::<Vec<_>>();
        assert_eq!(keys, [key(1), key(3), key(5)]);
        assert_eq!(journal.get(key(3)).unwrap(), Some(record(3)));
        assert_eq!((journal.get(key(2)).unwrap(), has(&journal, 2), journal.damaged()), (None, false, 0));
        journal.append(&record(2)).unwrap();
        assert_eq!(journal.get(key(2)).unwrap(), Some(record(2)));
        for line in fs::read_to_string(&path).unwrap().lines() {
            let object: serde_json::Value = serde_json::from_str(line).unwrap();
            assert_eq!(object["run"]["figures"]["faults"]["count"], 3, "every line is JSON");
        }
    }

    #[test]
    fn a_journal_torn_anywhere_keeps_all_whole_lines_and_goes_on() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("journal.jsonl");
        filled(&path, &[1, 2]);
        let whole = fs::read(&path).unwrap();
        let first = whole.iter().position(|&octet| octet == b'\n').unwrap() + 1;
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            let mut journal = Journal::open(&path, &names()).unwrap();
            assert_eq!((has(&journal, 1), has(&journal, 2)), (length >= first, false), "{length} octets");
            assert_eq!(journal.damaged(), 0);
            journal.append(&record(2)).unwrap();
            drop(journal);
            assert!(has(&Journal::open(&path, &names()).unwrap(), 2), "{length} octets");
        }
    }

    #[test]
    fn a_damaged_line_is_passed_over_wherever_an_octet_is_wrong() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("journal.jsonl");
        filled(&path, &[1, 2]);
        let whole = fs::read(&path).unwrap();
        let first = whole.iter().position(|&octet| octet == b'\n').unwrap();
        for at in 0..first {
            let mut octets = whole.clone();
            octets[at] ^= 0x01;
            fs::write(&path, &octets).unwrap();
            let journal = Journal::open(&path, &names()).unwrap();
            assert_eq!((has(&journal, 1), has(&journal, 2)), (false, true), "octet {at}");
            assert!(journal.damaged() > 0);
        }
    }

    #[test]
    fn a_run_that_failed_or_lacks_a_figure_is_not_done() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("journal.jsonl");
        let failure = Some(Failure { reason: "why".to_owned(), cycle: 4 });
        let failed = Record { figures: BTreeMap::new(), broken: None, failure, ..record(1) };
        let mut journal = Journal::open(&path, &names()).unwrap();
        journal.append(&failed).unwrap();
        journal.append(&record(2)).unwrap();
        assert_eq!((has(&journal, 1), journal.get(key(1)).unwrap()), (false, Some(failed)));
        journal.append(&record(1)).unwrap();
        assert!(has(&journal, 1));
        let more = ["faults", "retries"].map(str::to_owned);
        let journal = Journal::open(&path, &more).unwrap();
        assert!(!has(&journal, 1) && !has(&journal, 2));
    }

    #[test]
    fn sorted_journals_do_not_tell_in_which_order_runs_ended() {
        let dir = tempfile::tempdir().unwrap();
        let sorted = |name: &str, numbers: &[u128]| {
            let path = dir.path().join(name);
            filled(&path, numbers);
            let mut octets = Vec::new();
            Journal::open(&path, &names()).unwrap().sorted(&mut octets).unwrap();
            octets
        };
        assert_eq!(sorted("a", &[3, 1, 2, 1]), sorted("b", &[1, 2, 3]));
    }
}
