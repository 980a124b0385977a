//! Scenarios: one network, what moves and what goes wrong in it, and how long to watch.
//!
//! A scenario is a TOML file whose leading comment asks a question. Reading it takes three steps, each in a module of
//! its own: the text becomes a tree of values that know their place, the tree becomes a [`Scenario`] key by key,
//! and the rules of the bus and of the devices are checked on the whole. What is wrong on the way is collected
//! into one [`ScenarioError`].

mod acyclic;
mod check;
mod class1;
mod class2;
pub mod disturbance;
pub mod error;
mod expect;
#[cfg(test)]
mod faults;
mod flight;
mod gsd;
mod jitter;
pub mod kinds;
mod link;
mod options;
mod read;
pub(super) mod section;
mod services;
mod station;
pub mod topology;
pub(super) mod tree;
mod written;

use check::Check;
pub use class2::{Class2, Class2Job};
pub use error::{Fault, Position, Problem, ScenarioError};
pub use flight::Flight;
pub use link::{Link, Sample, Table};
pub use station::Station;

use crate::device::options::{Resolution, UnitOptions};
use crate::device::profile::Device;
use crate::dp::handler::{Patch, StartupTelegram};
pub use crate::dp::master::Pace;
use crate::fdl::params::BusParams;
pub use crate::sim::fault::line::{Effect, LineFault};
pub use crate::sim::fault::which::{Service, Which};
pub use crate::sim::fault::window::{Bursts, Window};
pub use crate::sim::fault::{Disturbance, What};
use crate::sim::jitter::GcJitter;
use crate::sim::motion::Motion;
use crate::study::invocation::Invocation;
use crate::study::verdict::Expectation;
use crate::time::{Span, Tbit};
use crate::wire::Address;
use crate::wire::control::GlobalControl;
pub use crate::wire::parameter::Format;
pub use class1::Class1;
pub(super) use read::TABLES_OF_ONE;
use section::Reader;
pub(super) use section::{nearest, suggestion};
pub use services::{MasterServices, SlaveServices};
use std::fs::File;
use std::io::Read;
use std::path::Path;
pub use topology::{Point, Topology};
use tree::Source;
pub(super) use written::written;

/// A whole scenario, complete and checked.
#[derive(Clone, PartialEq, Debug)]
pub struct Scenario {
    /// The file's name without its extension.
    pub name: String,
    /// The file's leading comment: the question, the expected answer, the source.
    pub question: String,
    /// How long, and with which draws.
    pub run: Run,
    /// The bus: its rate and its times.
    pub bus: Bus,
    /// Segments of cable and what joins them.
    pub topology: Topology,
    /// The master whose figures are taken.
    pub master: Master,
    /// Further, free-running class 1 masters in the order of the file.
    pub class1: Vec<Class1>,
    /// The slaves in address order, which is the order of Data_Exchange (Model: D6).
    pub slaves: Vec<Slave>,
    /// Class 2 masters in the order of the file.
    pub class2: Vec<Class2>,
    /// Slave-to-slave links in the order of the file.
    pub links: Vec<Link>,
    /// Orders in the order of the file; at one instant this is the order in which they act.
    pub events: Vec<Event>,
    /// Disturbances in the order of the file.
    pub disturbances: Vec<Disturbance>,
    /// What to keep.
    pub record: Record,
    /// The file and the overrides that it was read from.
    pub invocation: Invocation,
    /// What is expected of the run's figures, in the order of the file.
    pub expectations: Vec<Expectation>,
}

/// Where the text of a scenario comes from.
struct Origin<'a> {
    /// The directory in which GSD files are looked for.
    dir: &'a Path,
    /// The scenario's name.
    name: &'a str,
    /// What messages call it.
    source: &'a str,
}

impl<'a> Origin<'a> {
    fn of_text(name: &'a str, source: &'a str) -> Self {
        Self { dir: Path::new(source).parent().unwrap_or(Path::new("")), name, source }
    }
}

impl Scenario {
    /// Longest scenario file (octets).
    pub const MAX_FILE: u64 = 4 << 20;

    /// Reads the file `path` with `overrides`, pairs of a dotted key and a value: `("master.t_o", "1.5 ms")`,
    /// `("slave.3.crystal", "20 ppm")` by address, `("slave.#1.addresses", "3..6")` and `("link.1.length", "2")` by the
    /// table's number from 1. A value is TOML if it can be and a text otherwise.
    ///
    /// # Errors
    /// The file cannot be read, is no text, too long or empty, or [`Self::parse`] finds something wrong.
    pub fn load(path: &Path, overrides: &[(String, String)]) -> Result<Self, ScenarioError> {
        Self::open(path, overrides, Check::All)
    }
    /// As [`Self::load`], but the rules of [`plan::rules`](crate::study::plan::rules) may be broken: a network to plan.
    ///
    /// # Errors
    /// As [`Self::load`] for everything else.
    pub fn load_to_plan(path: &Path, overrides: &[(String, String)]) -> Result<Self, ScenarioError> {
        Self::open(path, overrides, Check::ToPlan)
    }
    /// As [`Self::load`], and the text of the file.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_with_text(path: &Path, overrides: &[(String, String)]) -> Result<(Self, String), ScenarioError> {
        let (name, source, text) = Self::text_of(path)?;
        let dir = path.parent().unwrap_or(Path::new(""));
        let origin = Origin { dir, name: &name, source: &source };
        Ok((Self::read(&origin, &text, overrides, Check::All)?, text))
    }
    fn open(path: &Path, overrides: &[(String, String)], check: Check) -> Result<Self, ScenarioError> {
        let (name, source, text) = Self::text_of(path)?;
        let dir = path.parent().unwrap_or(Path::new(""));
        Self::read(&Origin { dir, name: &name, source: &source }, &text, overrides, check)
    }
    /// Name, source and text of a file.
    pub(super) fn text_of(path: &Path) -> Result<(String, String, String), ScenarioError> {
        let source = path.display().to_string();
        let octets = read_file(path, "scenario", "name one scenario file in it, *.toml")
            .map_err(|fault| ScenarioError::about_file(&source, fault))?;
        let text = decode(&octets).map_err(|fault| ScenarioError::about_file(&source, fault))?.to_owned();
        let name = name_of(path).map_err(|fault| ScenarioError::about_file(&source, fault))?;
        Ok((name, source, text))
    }

    /// Reads `text` as the scenario `name`; messages call it `source`, and GSD files are looked for beside it.
    /// `overrides` as for [`Self::load`].
    ///
    /// # Errors
    /// The text is no TOML, a key is unknown, missing or wrong, or a rule of the bus or of a device is broken.
    pub fn parse(name: &str, source: &str, text: &str, overrides: &[(String, String)]) -> Result<Self, ScenarioError> {
        Self::read(&Origin::of_text(name, source), text, overrides, Check::All)
    }
    /// As [`Self::parse`], but the rules of [`plan::rules`](crate::study::plan::rules) may be broken: a network to plan.
    ///
    /// # Errors
    /// As [`Self::parse`] for everything else.
    pub fn parse_to_plan(
        name: &str,
        source: &str,
        text: &str,
        overrides: &[(String, String)],
    ) -> Result<Self, ScenarioError> {
        Self::read(&Origin::of_text(name, source), text, overrides, Check::ToPlan)
    }
    /// As [`Self::parse_to_plan`], and T_DP, T_I and T_O may be missing.
    ///
    /// # Errors
    /// As [`Self::parse_to_plan`] for everything else.
    pub fn parse_to_propose(
        name: &str,
        source: &str,
        text: &str,
        overrides: &[(String, String)],
    ) -> Result<Self, ScenarioError> {
        Self::read(&Origin::of_text(name, source), text, overrides, Check::ToPropose)
    }
    /// Reads the file `path` as [`Self::parse_to_propose`] does, and its text.
    ///
    /// # Errors
    /// As [`Self::parse_to_propose`], and the file cannot be read.
    pub fn load_to_propose(path: &Path, overrides: &[(String, String)]) -> Result<(Self, String), ScenarioError> {
        let (name, source, text) = Self::text_of(path)?;
        let dir = path.parent().unwrap_or(Path::new(""));
        let origin = Origin { dir, name: &name, source: &source };
        Ok((Self::read(&origin, &text, overrides, Check::ToPropose)?, text))
    }
    fn read(
        origin: &Origin<'_>,
        text: &str,
        overrides: &[(String, String)],
        check: Check,
    ) -> Result<Self, ScenarioError> {
        let &Origin { dir, name, source: file } = origin;
        if text.trim().is_empty() {
            let fault = Fault::new("the scenario is empty").help("it needs [run], [bus], [master] and a [[slave]]");
            return Err(ScenarioError::about_file(file, fault));
        }
        let source = Source::new(file, text, overrides).in_dir(dir);
        let root = source.parse()?;
        let mut reader = Reader::new(&source);
        reader.proposes = check == Check::ToPropose;
        let read = read::scenario(&mut reader, root);
        let mut problems = reader.take_problems();
        if let Some(mut scenario) = read.filter(|_| problems.is_empty()) {
            problems = check::check(&scenario, &mut reader, check);
            if problems.is_empty() {
                name.clone_into(&mut scenario.name);
                scenario.question = question(text);
                scenario.invocation = Invocation { file: file.to_owned(), sets: overrides.to_vec() };
                return Ok(scenario);
            }
        }
        Err(ScenarioError { problems })
    }
    /// The slave with this address.
    pub fn slave(&self, address: Address) -> Option<&Slave> {
        self.slaves.binary_search_by_key(&address, |slave| slave.address).ok().map(|index| &self.slaves[index])
    }
    /// The slaves that the master has in its list, in address order: all but the silent ones.
    pub fn configured(&self) -> impl Iterator<Item = &Slave> {
        self.slaves_of(self.master.address)
    }
    /// Whether the slave at `address` is parameterised as publisher.
    pub fn publishes(&self, address: Address) -> bool {
        self.links.iter().any(|link| link.publisher == address)
    }
}

/// The octets of the file `path`, which is a `noun`; `in_directory` says what to name instead of a directory.
pub(super) fn read_file(path: &Path, noun: &str, in_directory: &str) -> Result<Vec<u8>, Fault> {
    read_file_of(path, noun, in_directory, Scenario::MAX_FILE)
}
/// The same with at most `most` octets.
pub(super) fn read_file_of(path: &Path, noun: &str, in_directory: &str, most: u64) -> Result<Vec<u8>, Fault> {
    let unreadable = |error: std::io::Error| {
        Fault::new(match error.kind() {
            std::io::ErrorKind::NotFound => "there is no such file".to_owned(),
            std::io::ErrorKind::PermissionDenied => "this file may not be read".to_owned(),
            _ => format!("this file cannot be read: {error}"),
        })
    };
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    if metadata.is_dir() {
        return Err(Fault::new("this is a directory").help(in_directory));
    }
    let too_long = |megabytes: u64| {
        Fault::new(format!("a {megabytes} MB file is no {noun}"))
            .rule(format!("a {noun} has at most {} MB", most >> 20))
    };
    if metadata.len() > most {
        return Err(too_long(metadata.len().div_ceil(1_000_000)));
    }
    // A device or a pipe has no length: no more is read than a scenario may have.
    let mut octets = Vec::new();
    let file = File::open(path).map_err(unreadable)?;
    file.take(most + 1).read_to_end(&mut octets).map_err(unreadable)?;
    if octets.len() as u64 > most {
        return Err(too_long((most >> 20) + 1));
    }
    Ok(octets)
}

/// The scenario's name: the file's without its extension. Results go to a directory of this name.
fn name_of(path: &Path) -> Result<String, Fault> {
    match path.file_stem().map(|stem| stem.to_string_lossy().into_owned()) {
        Some(name) if !matches!(name.as_str(), "." | "..") => Ok(name),
        _ => Err(Fault::new("this file has no name before its extension")
            .rule("the results of NAME.toml go to a directory NAME")
            .help("rename it")),
    }
}

/// The text that `octets` are, without a byte order mark.
fn decode(octets: &[u8]) -> Result<&str, Fault> {
    let text = std::str::from_utf8(octets).map_err(|error| {
        let line = octets[..error.valid_up_to()].split(|&octet| octet == b'\n').count();
        let octet = octets[error.valid_up_to()];
        Fault::new(format!("this file is no UTF-8 text: octet {octet:02X} in line {line}"))
            .help("save it as UTF-8; a scenario is a text file")
    })?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text))
}

/// The leading comment of `text`, without its marks.
fn question(text: &str) -> String {
    let lines = text.lines().skip_while(|line| line.trim().is_empty());
    let comment = lines.map_while(|line| line.trim_start().strip_prefix('#'));
    let lines: Vec<_> = comment.map(|line| line.strip_prefix(' ').unwrap_or(line).trim_end()).collect();
    lines.join("\n").trim().to_owned()
}

/// How long a run is and which draws it makes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Run {
    /// Key of every random stream.
    pub seed: u64,
    /// Where the run ends.
    pub duration: Extent,
    /// Events per T_DP beyond which a run makes no headway, at least 1; none is what the bits of a T_DP allow.
    pub max_events: Option<u64>,
}

impl Run {
    /// The longest run, 24 years of 365 days: the rest of the range of time is for what comes after the end.
    pub const LONGEST: Span = Span::from_s(24 * 365 * 86_400);
}

/// A length of a run.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Extent {
    /// True time from power-on, above 0.
    Time(Span),
    /// Bus cycles, at least 1.
    Cycles(u64),
}

/// The bus.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Bus {
    /// Bit rate and the times of the data link layer.
    pub params: BusParams,
    /// Length of the cable of a network without segments (mm), at most [`Bus::MAX_CABLE_MM`].
    pub cable_mm: u64,
}

impl Bus {
    /// The longest cable (mm), 100 km. Model: no network of copper and glass comes near it.
    pub const MAX_CABLE_MM: u64 = 100_000_000;
}

/// The master with its application.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Master {
    /// Its address, 0..=125.
    pub address: Address,
    /// Index of its segment.
    pub segment: u8,
    /// Where on the segment's cable it sits (mm).
    pub position_mm: u64,
    /// How far its crystal is off.
    pub crystal: Crystal,
    /// Whether its cycles begin with SYNCH.
    pub pace: Pace,
    /// When its supply comes on.
    pub powered_at: Span,
    /// Bus cycle T_DP (manual 3.3.2); without SYNCH the planned cycle.
    pub t_dp: Span,
    /// Master application cycle T_MAPC (T_DP), 1..=14 (manual 3.3.3).
    pub t_mapc: u8,
    /// The watchdog that it sets in every slave; none is off.
    pub watchdog: Option<Watchdog>,
    /// Whether it reads the configuration with Get_Cfg during start-up.
    pub get_cfg: bool,
    /// Repeats of an unanswered Data_Exchange, 0..=15 (Model: D7).
    pub dx_retries: u8,
    /// Cycles without an answer until a slave counts as lost.
    pub lost_after: u32,
    /// Cycles in Clear before it changes to Operate.
    pub clear_for: u64,
    /// How its SYNCH strays (Model: D1).
    pub gc_jitter: GcJitter,
    /// Whether each stray moves all later SYNCH too (Model: D1).
    pub accumulate: bool,
    /// First value of its sign of life, 1..=15 (Model: D17).
    pub life_start: u8,
    /// Cycles from a slave's data exchange in Operate to that value (Model: D17).
    pub life_delay: u32,
    /// Whether further tokens to itself fill the spare time (Model: D6).
    pub active_spare: bool,
    /// When an acyclic request over MS1 is given up, a multiple of 10 ms, also by further masters; none is each slave's
    /// C1_Response_Timeout (GSD).
    pub ms1_timeout: Option<Span>,
    /// How it watches and tells its slaves.
    pub services: MasterServices,
}

/// How far a crystal is off its nominal frequency (10^-9), positive is fast.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Crystal {
    /// This much.
    Offset(i64),
    /// A draw of the station's own, anywhere between minus and plus this.
    Within(i64),
}

/// The watchdog of Set_Prm: WD_Base x factor 1 x factor 2 (octets 2, 3 and 8).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Watchdog {
    /// WD_Fact_1, 1..=255.
    pub factor_1: u8,
    /// WD_Fact_2, 1..=255.
    pub factor_2: u8,
    /// WD_Base: steps of 1 ms instead of 10 ms, for slaves with WD_Base_1ms_supp (octet 8 bit 2).
    pub base_1ms: bool,
}

impl Watchdog {
    /// Step of the watchdog, WD_Base = 0.
    pub const BASE: Span = Span::from_ms(10);
    /// Step of the watchdog, WD_Base = 1.
    pub const BASE_1MS: Span = Span::from_ms(1);
    /// The longest watchdog, about 650 s.
    pub const MAX: Span = Span::from_ms(10 * 255 * 255);
    /// The watchdog where nothing else is said, 200 ms.
    pub const USUAL: Self = Self { factor_1: 20, factor_2: 1, base_1ms: false };

    /// The watchdog of exactly `span`, in steps of 10 ms where they make it, with the smallest second factor; `None` if
    /// two factors up to 255 cannot make it.
    pub fn of(span: Span) -> Option<Self> {
        [false, true].into_iter().find_map(|base_1ms| Self::with_base(span, base_1ms))
    }
    fn with_base(span: Span, base_1ms: bool) -> Option<Self> {
        let base = if base_1ms { Self::BASE_1MS } else { Self::BASE };
        if span <= Span::ZERO || span > Self::MAX || !span.is_multiple_of(base) {
            return None;
        }
        let steps = span.div_floor(base);
        let factor = (1..=255).find(|factor| steps % factor == 0 && steps / factor <= 255);
        factor.map(|factor| Self { factor_1: (steps / factor) as u8, factor_2: factor as u8, base_1ms })
    }
    /// Its step.
    pub const fn base(self) -> Span {
        if self.base_1ms { Self::BASE_1MS } else { Self::BASE }
    }
    /// How long it runs.
    pub const fn span(self) -> Span {
        let ms = if self.base_1ms { 1 } else { 10 };
        Span::from_ms(ms * self.factor_1 as i64 * self.factor_2 as i64)
    }
}

/// One slave.
#[derive(Clone, PartialEq, Debug)]
pub struct Slave {
    /// Its address, 0..=125.
    pub address: Address,
    /// The master that has it in its list.
    pub master: Address,
    /// What it is.
    pub device: Device,
    /// Index of its segment.
    pub segment: u8,
    /// Where on the segment's cable it sits (mm).
    pub position_mm: u64,
    /// How far its crystal is off.
    pub crystal: Crystal,
    /// Its own T_SDR, before a longer min_TSDR of Set_Prm raises it (Model: D2, D27).
    pub t_sdr: Tbit,
    /// What its isochronous block sets.
    pub times: IsoTimes,
    /// How its shaft moves.
    pub motion: Motion,
    /// Tolerated failures of the master's sign of life, octet 24 (manual 3.2.5).
    pub max_life_failures: u8,
    /// Octet 15 bit 0 (manual 3.2.1).
    pub code_sequence: CodeSequence,
    /// Octet 15 bit 1: scaling, preset and code sequence are in force (manual 3.2.2).
    pub functions: bool,
    /// Octet 15 bit 3 with its values (manual 3.2.3, 3.2.4); needs `functions`.
    pub scaling: Option<Scaling>,
    /// Sits on the cable and never answers; the master does not have it in its list.
    pub silent: bool,
    /// When its supply comes on (true time).
    pub powered_at: Span,
    /// What it is parameterised for besides Data_Exchange.
    pub services: SlaveServices,
    /// Where it differs from the model's defaults (Model: D11, D12, D14 to D16, D18, D21).
    pub options: UnitOptions,
    /// User parameters of a device from a GSD file, with what the scenario sets: Set_Prm from octet 8 on, before what
    /// the configuration tool adds. Empty for the other devices.
    pub user_prm: Vec<u8>,
}

impl Slave {
    /// What its disc and gear tell apart: the type key's, or its profile's.
    pub fn resolution(&self) -> Resolution {
        self.options.resolution.unwrap_or(self.device.resolution())
    }
}

/// The instants and the window of one slave's isochronous block.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct IsoTimes {
    /// T_I, latch before the end of the cycle (manual 3.3.5).
    pub t_i: Span,
    /// T_O, set-point transfer after the start of the cycle (manual 3.3.6).
    pub t_o: Span,
    /// T_PLL_W, half width of the clock window (manual 3.3.8).
    pub t_pll_w: Span,
    /// T_PLL_D, delay of the recovered clock (manual 3.3.9, Model: D13).
    pub t_pll_d: Span,
}

/// In which direction the position increases, seen onto the shaft (manual 3.2.1).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CodeSequence {
    /// Clockwise.
    Cw,
    /// Counter-clockwise.
    Ccw,
}

/// Scaling of the position.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Scaling {
    /// Measuring units per revolution (counts), octets 16..=19 (manual 3.2.3).
    pub units_per_rev: u32,
    /// Total measuring range (counts), octets 20..=23 (manual 3.2.4).
    pub total_range: u32,
}

/// An order at an instant.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Event {
    /// When.
    pub when: When,
    /// Which slaves it is about, in address order; empty for an order to the master alone. The supply of masters can
    /// be switched too.
    pub slaves: Vec<Address>,
    /// What to do.
    pub action: Action,
}

/// An instant of a run.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum When {
    /// True time since power-on.
    Time(Span),
    /// The beginning of this bus cycle, counted from 0.
    Cycle(u64),
}

/// What a scenario can order.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Action {
    /// The master sets G1_STW.15 until the fault is acknowledged.
    Acknowledge,
    /// The master stops counting its sign of life.
    HoldLifeSign {
        /// For so many bus cycles; none is until it is released.
        cycles: Option<u32>,
    },
    /// The master counts its sign of life again.
    ReleaseLifeSign,
    /// The master's sign of life jumps.
    JumpLifeSign {
        /// To this value, 0..=15.
        to: u8,
    },
    /// The master sends this sensor control word G1_STW from now on.
    ControlWord {
        /// The word.
        value: u16,
    },
    /// The master application reads a parameter over the parameter channel (manual 4).
    ReadParameter {
        /// Parameter number.
        parameter: u16,
        /// First element.
        subindex: u16,
        /// How many elements; 0 for a parameter that is no array.
        elements: u8,
    },
    /// The master application tries to change a parameter.
    ChangeParameter {
        /// Parameter number.
        parameter: u16,
        /// The element.
        subindex: u16,
        /// Format of the value.
        format: Format,
        /// The value.
        value: u32,
    },
    /// The master starts the slaves anew, with Set_Prm or Chk_Cfg changed; without changes with the good one.
    Startup {
        /// Which telegram.
        telegram: StartupTelegram,
        /// What is changed.
        patch: Patch,
    },
    /// The supply of the slaves goes off.
    PowerOff,
    /// The supply of the slaves comes on.
    PowerOn,
    /// The master changes to Clear.
    Clear,
    /// The master changes to Operate.
    Operate,
    /// The master sends Sync, Freeze or their ends to these groups.
    Control(GlobalControl),
}

/// What a run keeps.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Record {
    /// Whether anything is written at all.
    pub files: bool,
    /// Whether plots are drawn.
    pub plots: bool,
    /// Which CSV files are written.
    pub tables: Vec<CsvTable>,
    /// Most rows that a CSV file keeps before it is thinned, at least 1.
    pub rows: u64,
    /// What the flight recorder keeps; none is off.
    pub flight: Option<Flight>,
}

/// A CSV file.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum CsvTable {
    /// A row per cycle.
    Cycles,
    /// A row per slave and cycle.
    Slaves,
    /// A row per link and cycle.
    Links,
    /// A row per event.
    Events,
}

impl CsvTable {
    /// Every table.
    pub const EVERY: &'static [Self] = &[Self::Cycles, Self::Slaves, Self::Links, Self::Events];
    /// Every table with the key that switches it on and off.
    pub const ALL: &'static [(&'static str, Self)] = &[
        ("cycles_csv", Self::Cycles),
        ("slaves_csv", Self::Slaves),
        ("links_csv", Self::Links),
        ("events_csv", Self::Events),
    ];
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::sim::motion::Angle;
    use crate::time::BitRate;

    /// `n` slaves of the kind `device` from address 3 on at a bus without length, T_DP 8 ms.
    pub(crate) fn network(rate: BitRate, device: impl Into<Device>, n: u8) -> Scenario {
        let device = device.into();
        let address = |number| Address::new(number).unwrap();
        let (t_i, t_o, t_pll_w) = (Span::from_us(125), Span::from_ms(4), Span::from_us(1));
        let slave = |number| Slave {
            address: address(number),
            master: address(2),
            device: device.clone(),
            segment: 0,
            position_mm: 0,
            crystal: Crystal::Offset(0),
            t_sdr: Tbit(30),
            times: IsoTimes { t_i, t_o, t_pll_w, t_pll_d: Span::ZERO },
            motion: Motion::Standstill { at: Angle::ZERO },
            max_life_failures: 1,
            code_sequence: CodeSequence::Cw,
            functions: false,
            scaling: None,
            silent: false,
            powered_at: Span::ZERO,
            services: SlaveServices::default(),
            options: UnitOptions::default(),
            user_prm: Vec::new(),
        };
        Scenario {
            name: "network".into(),
            question: String::new(),
            run: Run { seed: 1, duration: Extent::Cycles(1_000), max_events: None },
            bus: Bus { params: BusParams::profile(rate), cable_mm: 0 },
            topology: Topology::line(0),
            master: Master {
                address: address(2),
                segment: 0,
                position_mm: 0,
                crystal: Crystal::Offset(0),
                pace: Pace::Synch,
                powered_at: Span::ZERO,
                t_dp: Span::from_ms(8),
                t_mapc: 1,
                watchdog: Watchdog::of(Span::from_ms(200)),
                get_cfg: true,
                dx_retries: 1,
                lost_after: 10,
                clear_for: 0,
                gc_jitter: GcJitter::None,
                accumulate: false,
                life_start: 1,
                life_delay: 0,
                active_spare: false,
                ms1_timeout: None,
                services: MasterServices::default(),
            },
            class1: Vec::new(),
            slaves: (3..3 + n).map(slave).collect(),
            class2: Vec::new(),
            links: Vec::new(),
            events: Vec::new(),
            disturbances: Vec::new(),
            record: Record {
                files: true,
                plots: true,
                tables: CsvTable::ALL.iter().map(|&(_, table)| table).collect(),
                rows: 20_000,
                flight: None,
            },
            invocation: Invocation::default(),
            expectations: Vec::new(),
        }
    }

    #[test]
    fn a_watchdog_is_a_product_of_two_factors() {
        let factors = |ms| Watchdog::of(Span::from_ms(ms)).map(|w| (w.factor_1, w.factor_2));
        assert_eq!(factors(200), Some((20, 1)));
        assert_eq!(factors(2_560), Some((128, 2)));
        assert_eq!(factors(650_250), Some((255, 255)));
        // 257 and 367 are primes, and the rest is out of range.
        assert_eq!([2_570, 7 * 367, 0, -10, 650_260].map(factors), [None; 5]);
        // What is no multiple of 10 ms has steps of 1 ms, up to 65 s.
        let fine = |ms| Watchdog::of(Span::from_ms(ms)).map(|w| (w.factor_1, w.factor_2, w.base_1ms));
        assert_eq!([205, 25, 1].map(fine), [205, 25, 1].map(|ms: u8| Some((ms, 1, true))));
        assert_eq!([65_025, 65_035, 20].map(fine), [Some((255, 255, true)), None, Some((2, 1, false))]);
        assert_eq!(Watchdog::of(Span::from_us(20_500)), None);
        for ms in 1..20_000 {
            if let Some(watchdog) = Watchdog::of(Span::from_ms(ms)) {
                assert_eq!(watchdog.span(), Span::from_ms(ms));
            }
        }
    }
}
