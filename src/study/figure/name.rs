//! Names of figures: a dotted text becomes a [`Figure`], or an error with the nearest name that there is.

use core::fmt;

use super::family::{self, CODE, FAMILIES, Family};
use super::statistic::{Of, STATISTICS};
use super::steady::{self, STEADY};
use super::value::Unit;
use crate::observation::MasterClass;
use crate::study::histogram::{self, QUANTITIES, Quantity};
use crate::study::layout::Layout;
use crate::study::scenario::nearest;
use crate::wire::Address;
use crate::wire::drive::SensorFault;

/// What a figure can be of.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Scope {
    /// The whole network.
    Network,
    /// A slave in the list of the master whose figures are taken.
    Slave,
    /// A slave-to-slave link.
    Link,
    /// A master, where several share the token.
    Master,
    /// Any station of the live list.
    Station,
    /// The acyclic services of one class of masters.
    Acyclic,
}

impl Scope {
    /// Every scope.
    pub const ALL: [Self; 6] = [Self::Network, Self::Slave, Self::Link, Self::Master, Self::Station, Self::Acyclic];

    /// The word that begins its names; none of the network's.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Network => "",
            Self::Slave => "slave",
            Self::Link => "link",
            Self::Master => "master",
            Self::Station => "station",
            Self::Acyclic => "acyclic",
        }
    }
    /// What its names begin with, the subject as a placeholder.
    pub const fn pattern(self) -> &'static str {
        match self {
            Self::Network => "",
            Self::Slave => "slave.<addr>.",
            Self::Link => "link.<pub>-<sub>.",
            Self::Master => "master.<addr>.",
            Self::Station => "station.<addr>.",
            Self::Acyclic => "acyclic.<class1 or class2>.",
        }
    }
    /// Whether `each`, `min` and `max` can stand for all its subjects.
    pub const fn has_each(self) -> bool {
        matches!(self, Self::Slave | Self::Link | Self::Master)
    }
    /// Every subject of this kind in a network, in order.
    pub fn subjects(self, layout: &Layout) -> Vec<Subject> {
        let slaves = || layout.slaves().iter().map(|slave| slave.address);
        let masters = || layout.masters().iter().map(|master| master.address);
        match self {
            Self::Network => vec![Subject::Network],
            Self::Slave => slaves().map(Subject::Slave).collect(),
            Self::Link => layout.links().iter().map(|&(publisher, to)| Subject::Link(publisher, to)).collect(),
            Self::Master => masters().map(Subject::Master).collect(),
            Self::Station => {
                let others = layout.masters().iter().flat_map(|master| master.slaves.iter().copied());
                let mut all: Vec<_> = slaves().chain(masters()).chain(others).chain([layout.master]).collect();
                all.sort_unstable();
                all.dedup();
                all.into_iter().map(Subject::Station).collect()
            }
            Self::Acyclic => MasterClass::ALL.iter().copied().map(Subject::Acyclic).collect(),
        }
    }
    /// Whether a family's line is about subjects of this kind.
    fn has(self, of: family::Of) -> bool {
        match of {
            family::Of::Network(_) | family::Of::NetworkFault(_) => self == Self::Network,
            family::Of::Slave(_)
            | family::Of::SlaveFault(_)
            | family::Of::Episodes(_)
            | family::Of::EpisodesFault(_) => self == Self::Slave,
            family::Of::Station(_) => matches!(self, Self::Station | Self::Slave | Self::Master),
            family::Of::Master(_) => self == Self::Master,
            family::Of::Link(_) => self == Self::Link,
            family::Of::Acyclic(_) => self == Self::Acyclic,
        }
    }
    /// The families of this kind, in the order of the registry.
    pub fn families(self) -> impl Iterator<Item = &'static Family> {
        FAMILIES.iter().filter(move |family| self.has(family.of))
    }
    /// The quantities of this kind, in the order of their registry.
    pub fn quantities(self) -> impl Iterator<Item = &'static Quantity> {
        QUANTITIES.iter().filter(move |quantity| match quantity.source {
            histogram::Source::Network(_) | histogram::Source::Ring(_) => self == Self::Network,
            histogram::Source::Slave(_) => self == Self::Slave,
            histogram::Source::Link(_) => self == Self::Link,
        })
    }
    /// The ends of all listed names of this kind: families, each code of a fault, then the statistics of quantities.
    fn ends(self) -> impl Iterator<Item = String> {
        let families = self.families().flat_map(|family| match family.name.split_once(CODE) {
            Some((stem, tail)) => {
                SensorFault::ALL.iter().map(|fault| format!("{stem}{:04X}{tail}", fault.code())).collect()
            }
            None => vec![family.name.to_owned()],
        });
        let quantities = || self.quantities().map(|quantity| quantity.name);
        let all = quantities().flat_map(|name| STATISTICS.iter().map(move |row| format!("{name}.{}", row.name)));
        let steady = |name| STEADY.iter().map(move |row| format!("{}{name}.{}", steady::BEGIN, row.0));
        families.chain(all).chain(quantities().flat_map(steady))
    }
}

/// Whose figure it is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Subject {
    /// The whole network.
    Network,
    /// A slave.
    Slave(Address),
    /// A publisher and its subscriber.
    Link(Address, Address),
    /// A master.
    Master(Address),
    /// Any station.
    Station(Address),
    /// The acyclic services of this class of masters.
    Acyclic(MasterClass),
}

impl Subject {
    /// The word of this subject in a name: `3`, `3-11`, `class1`; nothing for the network.
    pub fn word(self) -> String {
        match self {
            Self::Network => String::new(),
            Self::Slave(address) | Self::Master(address) | Self::Station(address) => address.to_string(),
            Self::Link(publisher, subscriber) => format!("{publisher}-{subscriber}"),
            Self::Acyclic(MasterClass::One) => "class1".to_owned(),
            Self::Acyclic(MasterClass::Two) => "class2".to_owned(),
        }
    }
}

/// `the network`, `slave 3`, `link 3-11`, `class 1`.
impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Network => f.write_str("the network"),
            Self::Slave(address) => write!(f, "slave {address}"),
            Self::Link(publisher, subscriber) => write!(f, "link {publisher}-{subscriber}"),
            Self::Master(address) => write!(f, "master {address}"),
            Self::Station(address) => write!(f, "station {address}"),
            Self::Acyclic(class) => class.fmt(f),
        }
    }
}

/// For whom a figure is asked.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Who {
    /// One subject.
    One(Subject),
    /// Every subject of a scope, each for itself.
    Each(Scope),
    /// The smallest value of all subjects of a scope; none as soon as one of them has none.
    Min(Scope),
    /// The largest one; none as soon as one of them has none.
    Max(Scope),
}

/// What is asked.
#[derive(Clone, Copy, Debug)]
pub(super) enum What {
    Family(&'static Family),
    Fault(&'static Family, u16),
    Distribution(&'static Quantity, Of),
    Steady(&'static Quantity, steady::Of),
}

/// The name of a figure that can be asked of a run.
#[derive(Clone, Debug)]
pub struct Figure {
    name: String,
    who: Who,
    pub(super) what: What,
}

/// Two figures are the same if they have the same name.
impl PartialEq for Figure {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}
impl Eq for Figure {}

/// A name that is no figure, or none of this network. Reads as a sentence.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{message}; {help}")]
pub struct FigureError {
    /// What is wrong.
    pub message: String,
    /// What would be right.
    pub help: String,
}

impl FigureError {
    fn new(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { message: message.into(), help: help.into() }
    }
}

/// Where to look for names.
const LISTED: &str = "isodp figures lists all of them";

impl Figure {
    /// The figure called `name`.
    ///
    /// # Errors
    /// There is no such figure; the nearest one is named.
    pub fn named(name: &str) -> Result<Self, FigureError> {
        let name = name.trim();
        let scope = Scope::ALL.into_iter().find(|scope| {
            let word = scope.word();
            !word.is_empty() && name.split_once('.').map_or(name, |(first, _)| first) == word
        });
        let (who, end) = match scope {
            None => (Who::One(Subject::Network), name),
            Some(scope) => who(scope, name)?,
        };
        match what(scope.unwrap_or(Scope::Network), end) {
            Some(what) => Ok(Self { name: name.to_owned(), who, what }),
            None => Err(unknown(name, scope.unwrap_or(Scope::Network), end)),
        }
    }
    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }
    /// For whom it is asked.
    pub const fn who(&self) -> Who {
        self.who
    }
    /// What it is of.
    pub const fn scope(&self) -> Scope {
        match self.who {
            Who::One(Subject::Network) => Scope::Network,
            Who::One(Subject::Slave(_)) => Scope::Slave,
            Who::One(Subject::Link(..)) => Scope::Link,
            Who::One(Subject::Master(_)) => Scope::Master,
            Who::One(Subject::Station(_)) => Scope::Station,
            Who::One(Subject::Acyclic(_)) => Scope::Acyclic,
            Who::Each(scope) | Who::Min(scope) | Who::Max(scope) => scope,
        }
    }
    /// The unit in which people read it.
    pub fn unit(&self) -> Unit {
        match self.what {
            What::Family(family) | What::Fault(family, _) => family.unit,
            What::Distribution(quantity, of) => of.unit(quantity),
            What::Steady(quantity, of) => of.unit(quantity),
        }
    }
    /// Whether it can be below zero.
    pub fn is_signed(&self) -> bool {
        match self.what {
            What::Family(family) => family.name == family::LEFT,
            What::Fault(..) => false,
            What::Distribution(quantity, of) => quantity.signed && !of.is_magnitude(),
            What::Steady(quantity, of) => quantity.signed && !of.is_magnitude(),
        }
    }
    /// Whether it is of the steady state, which is watched for only where somebody asks.
    pub fn is_of_steady_state(&self) -> bool {
        match self.what {
            What::Family(family) => steady::is_asked(family.name),
            What::Steady(..) => true,
            What::Fault(..) | What::Distribution(..) => false,
        }
    }
    /// Its name as that of a column of a table, with its unit: `slave_3_pll_error_p99_ns`.
    pub fn column(&self) -> String {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        self.name.chars().map(plain).collect::<String>() + self.unit().suffix()
    }

    /// Whether a network of `layout` has this figure. It may be without value all the same.
    ///
    /// # Errors
    /// It cannot have it; the subjects that there are are named.
    pub fn check(&self, layout: &Layout) -> Result<(), FigureError> {
        let scope = self.scope();
        let all = scope.subjects(layout);
        let absent = |message: String, help: &str| Err(FigureError::new(message, help));
        if let What::Distribution(quantity, _) | What::Steady(quantity, _) = self.what
            && quantity.subjects(layout).is_empty()
            && scope == Scope::Network
        {
            let message = format!("this network has no {}", quantity.name);
            return absent(message, "it is recorded where several masters share the token");
        }
        if all.is_empty() {
            return match scope {
                Scope::Master => absent(
                    "this network has one master only".to_owned(),
                    "figures by master are kept where several share the token; those of the network are its own",
                ),
                _ => absent(
                    format!("this network has no {}", scope.word()),
                    "add a [[link]] with publisher and subscriber",
                ),
            };
        }
        match self.who {
            // A stranger may be found.
            Who::One(Subject::Station(_)) => Ok(()),
            Who::One(subject) if !all.contains(&subject) => {
                let words: Vec<_> = all.iter().map(|subject| subject.word()).collect();
                let noun = scope.word();
                absent(
                    format!("this network has no {noun} {}", subject.word()),
                    &format!("it has {noun} {}", words.join(", ")),
                )
            }
            _ => Ok(()),
        }
    }

    /// Every figure with a listed name that a network of `layout` has, in a fixed order: of the network, then by slave,
    /// link, master, station and class.
    pub fn all(layout: &Layout) -> Vec<Self> {
        let mut all = Vec::new();
        for scope in Scope::ALL {
            for subject in scope.subjects(layout) {
                let begin = match scope {
                    Scope::Network => String::new(),
                    _ => format!("{}.{}.", scope.word(), subject.word()),
                };
                let figures = scope.ends().filter_map(|end| {
                    let what = what(scope, &end)?;
                    Some(Self { name: format!("{begin}{end}"), who: Who::One(subject), what })
                });
                all.extend(figures.filter(|figure| figure.check(layout).is_ok()));
            }
        }
        all
    }
}

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.name)
    }
}

/// Whose figure `name` is, which begins with the word of `scope`, and the rest of it.
fn who(scope: Scope, name: &str) -> Result<(Who, &str), FigureError> {
    let mut parts = name.splitn(3, '.').skip(1);
    let (subject, end) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    let who = match subject {
        "each" if scope.has_each() => Who::Each(scope),
        "min" if scope.has_each() => Who::Min(scope),
        "max" if scope.has_each() => Who::Max(scope),
        word => Who::One(one(scope, word).ok_or_else(|| no_subject(scope, name, word))?),
    };
    Ok((who, end))
}

/// The subject that `word` names.
fn one(scope: Scope, word: &str) -> Option<Subject> {
    let address = |text: &str| text.parse().ok().filter(|&number| number <= 125).and_then(Address::new);
    Some(match scope {
        Scope::Network => Subject::Network,
        Scope::Slave => Subject::Slave(address(word)?),
        Scope::Master => Subject::Master(address(word)?),
        Scope::Station => Subject::Station(address(word)?),
        Scope::Link => {
            let (publisher, subscriber) = word.split_once('-')?;
            Subject::Link(address(publisher)?, address(subscriber)?)
        }
        Scope::Acyclic => Subject::Acyclic(match word {
            "class1" => MasterClass::One,
            "class2" => MasterClass::Two,
            _ => return None,
        }),
    })
}

fn no_subject(scope: Scope, name: &str, word: &str) -> FigureError {
    let (noun, each) = (scope.word(), if scope.has_each() { ", each, min and max" } else { "" });
    let (what, good) = match scope {
        Scope::Link => ("a publisher and a subscriber", "link.3-11.publish.max"),
        Scope::Acyclic => ("class1 or class2", "acyclic.class2.response.max"),
        Scope::Station => ("an address", "station.3.repeats"),
        Scope::Master => ("an address", "master.2.cycle_time.max"),
        _ => ("an address", "slave.3.lock_time"),
    };
    let message = match word {
        "" => format!("\"{}\" says {noun} and not which", cut(name)),
        _ => format!("\"{}\" is no {noun}", cut(word)),
    };
    FigureError::new(message, format!("after {noun} comes {what}{each}, such as \"{good}\""))
}

/// What the end of a name asks.
fn what(scope: Scope, end: &str) -> Option<What> {
    if let Some(family) = scope.families().find(|family| family.name == end) {
        return Some(What::Family(family));
    }
    let by_code = |family: &&Family| {
        let (stem, tail) = family.name.split_once(CODE)?;
        let digits = end.strip_prefix(stem)?.strip_suffix(tail)?;
        let good = digits.len() == 4 && digits.bytes().all(|octet| octet.is_ascii_hexdigit());
        u16::from_str_radix(digits, 16).ok().filter(|_| good)
    };
    if let Some((family, code)) = scope.families().find_map(|family| Some((family, by_code(&family)?))) {
        return Some(What::Fault(family, code));
    }
    let (steady, end) = end.strip_prefix(steady::BEGIN).map_or((false, end), |end| (true, end));
    let (quantity, statistic) = end.split_once('.')?;
    let quantity = scope.quantities().find(|row| row.name == quantity)?;
    if steady {
        return Some(What::Steady(quantity, steady::Of::named(statistic)?));
    }
    Some(What::Distribution(quantity, Of::named(statistic)?))
}

/// The error for a name whose end is no figure of `scope`.
fn unknown(name: &str, scope: Scope, end: &str) -> FigureError {
    let message = format!("there is no figure \"{}\"", cut(name));
    if end.is_empty() && scope != Scope::Network {
        let example = scope.families().next().map_or("", |family| family.name);
        return FigureError::new(message, format!("a figure comes behind it, such as \"{name}.{example}\""));
    }
    if scope.quantities().any(|row| row.name == end) {
        let all: Vec<_> = STATISTICS.iter().map(|row| row.name).collect();
        let known = format!("\"{name}\" is a distribution: behind it comes {}, p95 ...", all.join(", "));
        return FigureError::new(message, known);
    }
    if end.strip_prefix(steady::BEGIN).is_some_and(|end| scope.quantities().any(|row| row.name == end)) {
        let all: Vec<_> = STEADY.iter().map(|row| row.0).collect();
        let known = format!("\"{name}\" is a quantity in steady state: behind it comes {}, p95 ...", all.join(", "));
        return FigureError::new(message, known);
    }
    let begin = &name[..name.len() - end.len()];
    let names: Vec<_> = scope.ends().map(|end| format!("{begin}{end}")).collect();
    let elsewhere = || {
        let other = Scope::ALL.into_iter().find(|&other| other != scope && what(other, end).is_some())?;
        Some(match other {
            Scope::Network => format!("the network has it: \"{end}\""),
            _ if other.has_each() => format!("each {} has it: \"{}{end}\"", other.word(), begin_of(other)),
            _ => format!("\"{}{end}\" is one", other.pattern()),
        })
    };
    let help = elsewhere().or_else(|| nearest(name, names.iter().map(String::as_str)));
    FigureError::new(message, help.unwrap_or_else(|| LISTED.to_owned()))
}
/// How a name for all subjects of `scope` begins.
fn begin_of(scope: Scope) -> String {
    format!("{}.each.", scope.word())
}

/// `text`, cut where a message would become unreadable.
fn cut(text: &str) -> String {
    let short: String = text.chars().take(60).collect();
    if short.len() < text.len() { short + "..." } else { short }
}
