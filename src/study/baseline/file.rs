//! The file of a baseline: written line by line, read with care, since people edit it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::trail::{Digests, EVENTS, JOURNAL, Line, Log, Trail};
use super::{Baseline, Hashes, VERSION};
use crate::sim::fingerprint::Fingerprint;
use crate::study::compare::Tolerances;
use crate::study::export::{ExportError, Staged};
use crate::study::figure::Value;
use crate::study::scenario::{Fault, read_file_of};
use crate::time::Time;
use crate::wire::Address;

/// What the file says that it is.
const FORMAT: &str = "isodp baseline";
/// The largest file that is read (octets). Model: ten times the largest that is written.
const MAX_FILE: u64 = 64 << 20;

/// Why a file is no baseline.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{path}: {message}\n  help: {help}")]
pub struct BaselineError {
    /// The file.
    pub path: String,
    /// What is wrong.
    pub message: String,
    /// What to do.
    pub help: String,
}

/// A figure in the file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stated {
    /// For people.
    is: String,
    /// Exactly.
    exact: Option<Value>,
}

/// What says what the file is.
#[derive(Deserialize)]
struct Head {
    format: Option<String>,
    version: Option<u32>,
}

/// The whole file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    #[serde(rename = "format")]
    _format: String,
    #[serde(rename = "version")]
    _version: u32,
    program: String,
    scenario: String,
    seed: u64,
    sets: Vec<(String, String)>,
    text: Vec<String>,
    fingerprint: BTreeMap<String, String>,
    #[serde(default)]
    tolerances: BTreeMap<String, String>,
    figures: BTreeMap<String, Stated>,
    events: StoredLog,
    journal: StoredLog,
    digests: StoredDigests,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredLog {
    /// Ticks of the first line that is left out.
    until: Option<i64>,
    lines: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredDigests {
    stride: u64,
    stations: BTreeMap<String, String>,
}

/// A JSON value in one line.
fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("texts and numbers have a JSON form")
}

/// One JSON object, an entry or a list in a line each.
struct Page(String);

impl Page {
    fn entry(&mut self, name: &str, value: &impl Serialize) {
        let _ = writeln!(self.0, "  {}: {},", json(&name), json(value));
    }
    /// Lines between brackets.
    fn block(&mut self, indent: &str, name: &str, [open, close]: [char; 2], lines: &[String]) {
        let _ = write!(self.0, "{indent}{}: {open}", json(&name));
        for (index, line) in lines.iter().enumerate() {
            let comma = if index == 0 { "" } else { "," };
            let _ = write!(self.0, "{comma}\n{indent}  {line}");
        }
        let end = if lines.is_empty() { String::new() } else { format!("\n{indent}") };
        let _ = write!(self.0, "{end}{close}");
    }
    fn list(&mut self, name: &str, lines: &[String]) {
        self.block("  ", name, ['[', ']'], lines);
        self.0 += ",\n";
    }
    fn map<'a, V: Serialize>(&mut self, name: &str, entries: impl Iterator<Item = (&'a str, V)>) {
        let lines: Vec<_> = entries.map(|(name, value)| format!("{}: {}", json(&name), json(&value))).collect();
        self.block("  ", name, ['{', '}'], &lines);
        self.0 += ",\n";
    }
    fn log(&mut self, name: &str, log: &Log) {
        let until = log.until.map(Time::ticks);
        let _ = writeln!(self.0, "  {}: {{\n    \"until\": {},", json(&name), json(&until));
        let lines: Vec<_> = log.lines.iter().map(|line| json(&line.emit())).collect();
        self.block("    ", "lines", ['[', ']'], &lines);
        self.0 += "\n  },\n";
    }
    fn digests(&mut self, digests: &Digests) {
        let _ = writeln!(self.0, "  \"digests\": {{\n    \"stride\": {},", digests.stride);
        let station = |(address, values): (&Address, &Vec<u32>)| {
            format!("{}: {}", json(&address.to_string()), json(&Digests::emit(values)))
        };
        let lines: Vec<_> = digests.stations.iter().map(station).collect();
        self.block("    ", "stations", ['{', '}'], &lines);
        self.0 += "\n  }\n}\n";
    }
}

impl Baseline {
    /// The text of the file.
    pub fn emit(&self) -> String {
        let mut page = Page("{\n".to_owned());
        page.entry("format", &FORMAT);
        page.entry("version", &VERSION);
        page.entry("program", &self.program);
        page.entry("scenario", &self.scenario);
        page.entry("seed", &self.seed);
        let hashes = self.hashes.named().map(|(name, hash)| (name, format!("{hash:016x}")));
        page.map("fingerprint", hashes.into_iter());
        page.map("tolerances", self.tolerances.texts());
        let stated = |value: &Option<Value>| Stated {
            is: value.map_or_else(|| "none".to_owned(), |value| value.to_string()),
            exact: *value,
        };
        page.map("figures", self.figures.iter().map(|(name, value)| (name.as_str(), stated(value))));
        page.list("sets", &self.sets.iter().map(json).collect::<Vec<_>>());
        page.list("text", &self.text.split('\n').map(|line| json(&line)).collect::<Vec<_>>());
        page.log("events", &self.trail.events);
        page.log("journal", &self.trail.journal);
        page.digests(&self.trail.digests);
        page.0
    }
    /// Writes the file `path`, over whatever is there.
    ///
    /// # Errors
    /// The file cannot be written; what was there stays then.
    pub fn save(&self, path: &Path) -> Result<(), ExportError> {
        let dir = path.parent().filter(|dir| !dir.as_os_str().is_empty()).unwrap_or(Path::new("."));
        std::fs::create_dir_all(dir).map_err(|source| ExportError::Directory { path: dir.to_owned(), source })?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let mut file = Staged::create(dir, &name)?;
        file.write_all(self.emit().as_bytes()).map_err(|error| file.error(error))?;
        file.place().map(|_| ())
    }

    /// Reads the file `path`.
    ///
    /// # Errors
    /// There is no such file, it is no baseline, one of another version, or damaged.
    pub fn load(path: &Path) -> Result<Self, BaselineError> {
        let path_text = path.display().to_string();
        let refuse =
            |message: String, help: &str| BaselineError { path: path_text.clone(), message, help: help.into() };
        let octets = read_file_of(path, "baseline", "name one baseline in it, *.baseline.json", MAX_FILE)
            .map_err(|Fault { message, .. }| refuse(message, "isodp baseline writes one"))?;
        let text = String::from_utf8(octets)
            .map_err(|_| refuse("this file is no text".into(), "name a file that isodp baseline wrote"))?;
        Self::parse(&text).map_err(|(message, help)| refuse(message, help))
    }
    /// Reads the text of a file.
    ///
    /// # Errors
    /// What is wrong, and what to do.
    pub fn parse(text: &str) -> Result<Self, (String, &'static str)> {
        const OTHER: &str = "name a file that isodp baseline wrote";
        const AGAIN: &str = "write it again with isodp baseline, or take it from where it was whole";
        let no_json = |error: serde_json::Error| (format!("this file is no baseline: {error}"), OTHER);
        let head: Head = serde_json::from_str(text).map_err(no_json)?;
        match (head.format.as_deref(), head.version) {
            (Some(FORMAT), Some(VERSION)) => {}
            (Some(FORMAT), Some(version)) => {
                let message = format!("this is a baseline of form {version}, and this program reads form {VERSION}");
                return Err((message, "write it again with isodp baseline"));
            }
            _ => return Err(("this file is no baseline".into(), OTHER)),
        }
        let damaged = |what: String| (format!("this baseline is damaged: {what}"), AGAIN);
        let stored: Stored = serde_json::from_str(text).map_err(|error| damaged(error.to_string()))?;
        stored.check().map_err(damaged)
    }
}

impl Stored {
    /// The baseline, if everything can be read.
    fn check(self) -> Result<Baseline, String> {
        let hash = |name: &str| {
            let text = self.fingerprint.get(name).ok_or_else(|| format!("fingerprint.{name} is missing"))?;
            u64::from_str_radix(text, 16).map_err(|_| format!("fingerprint.{name} \"{text}\" is no hash"))
        };
        let fingerprint = Fingerprint { wire: hash("wire")?, states: hash("states")?, latches: hash("latches")? };
        let hashes = Hashes { fingerprint, statistics: hash("statistics")? };
        let mut tolerances = Tolerances::default();
        for (name, limit) in &self.tolerances {
            tolerances.add(name, limit).map_err(|error| format!("tolerances: {error}"))?;
        }
        let trail = Trail {
            journal: self.journal.check("journal", JOURNAL)?,
            events: self.events.check("events", EVENTS)?,
            digests: self.digests.check()?,
        };
        Ok(Baseline {
            program: self.program,
            scenario: self.scenario,
            seed: self.seed,
            sets: self.sets,
            text: self.text.join("\n"),
            hashes,
            tolerances,
            figures: self.figures.into_iter().map(|(name, stated)| (name, stated.exact)).collect(),
            trail,
        })
    }
}

impl StoredLog {
    fn check(self, name: &str, most: usize) -> Result<Log, String> {
        let line = |(index, text): (usize, &String)| {
            Line::parse(text).ok_or_else(|| format!("{name}: line {} \"{text}\" says nothing", index + 1))
        };
        let lines = self.lines.iter().enumerate().map(line).collect::<Result<_, _>>()?;
        Ok(Log { most, lines, until: self.until.map(Time::from_ticks) })
    }
}

impl StoredDigests {
    fn check(self) -> Result<Digests, String> {
        if !self.stride.is_power_of_two() {
            return Err(format!("digests.stride {} is no power of two", self.stride));
        }
        let station = |(address, text): (&String, &String)| {
            let number = address.parse().ok().and_then(Address::new);
            let number = number.ok_or_else(|| format!("digests: \"{address}\" is no address"))?;
            let values =
                Digests::parse(text).ok_or_else(|| format!("digests of station {number} are cut or no hex"))?;
            Ok((number, values))
        };
        let stations = self.stations.iter().map(station).collect::<Result<_, String>>()?;
        Ok(Digests { stride: self.stride, stations })
    }
}
