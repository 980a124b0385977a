//! Figures: everything that a run recorded or counted, by name. Expectations, comparisons and sweeps ask here.
//!
//! A name is a path of words with dots between them:
//!
//! | it begins with | it is of |
//! |---|---|
//! | nothing | the whole network |
//! | `slave.3.` | a slave of the master whose figures are taken |
//! | `link.3-11.` | a publisher and its subscriber |
//! | `master.12.` | a master, where several share the token |
//! | `station.7.` | any station, as the live list counts it |
//! | `acyclic.class2.` | the acyclic services of a class of masters |
//! | `slave.each.`, `link.each.`, `master.each.` | all of them, each for itself; an expectation must hold for every one |
//! | `slave.min.`, `slave.max.` and so on | the smallest or largest of them; none as soon as one of them has none |
//!
//! `steady.` before a quantity means its values in steady state alone, and they have bounds: `steady.latch_skew.mean_low`,
//! `slave.3.steady.pll_error.magnitude_p99_high` ([`STEADY`]).
//!
//! Then comes a family ([`FAMILIES`]), `lock_time`, `faults`, `faults.0F04`, or a recorded quantity
//! ([`QUANTITIES`](super::histogram::QUANTITIES)) and a statistic ([`STATISTICS`]): `latch_skew.p99`,
//! `slave.each.pll_error.magnitude_p99`. A new quantity, statistic or family is a line of its table and has its names
//! at once. Figures read what was counted and recorded; they never change a run or its fingerprint.
//!
//! | state of a figure | value |
//! |---|---|
//! | it happened, or can be counted | its value |
//! | nothing to tell: no lock, no fault, no locked latch | none |
//! | the network cannot have it: no such slave, no links | an error before the run, [`Figure::check`] |

pub mod family;
mod name;
pub mod page;
pub mod statistic;
pub mod steady;
pub mod value;

pub use family::{FAMILIES, Family};
pub use name::{Figure, FigureError, Scope, Subject, Who};
pub use statistic::{STATISTICS, Statistic};
pub use steady::STEADY;
pub use value::{Unit, Value};

use core::cmp::Ordering;

use super::count::Counts;
use super::episode::Episodes;
use super::histogram::{self, Histograms, Quantity};
use super::layout::Layout;
use super::steady::SteadyState;
use name::What;

/// The figures of one run.
#[derive(Clone, Debug)]
pub struct Figures {
    counts: Counts,
    histograms: Histograms,
    episodes: Episodes,
    steady: Option<SteadyState>,
}

impl Figures {
    /// The figures of what a run counted and recorded.
    pub const fn new(counts: Counts, histograms: Histograms, episodes: Episodes) -> Self {
        Self { counts, histograms, episodes, steady: None }
    }
    /// The same with the steady state that was watched for; without, its figures have no value.
    #[must_use]
    pub fn with_steady_state(self, steady: Option<SteadyState>) -> Self {
        Self { steady, ..self }
    }
    /// What was counted.
    pub const fn counts(&self) -> &Counts {
        &self.counts
    }
    /// What was recorded.
    pub const fn histograms(&self) -> &Histograms {
        &self.histograms
    }
    /// What became of disturbances.
    pub const fn episodes(&self) -> &Episodes {
        &self.episodes
    }
    /// The steady state, if it was watched for.
    pub const fn steady_state(&self) -> Option<&SteadyState> {
        self.steady.as_ref()
    }
    /// What was recorded, for its memory to serve again.
    pub fn into_histograms(self) -> Histograms {
        self.histograms
    }
    /// The network that these are of.
    pub fn layout(&self) -> &Layout {
        self.histograms.layout()
    }

    /// The figure called `name`; none if it has no value.
    ///
    /// # Errors
    /// There is no such figure, this network cannot have it, or it is one of each subject and so many values.
    pub fn get(&self, name: &str) -> Result<Option<Value>, FigureError> {
        let figure = Figure::named(name)?;
        figure.check(self.layout())?;
        if let Who::Each(scope) = figure.who() {
            let word = scope.word();
            let message = format!("\"{name}\" has a value for each {word}");
            let help = format!("ask for {word}.min, {word}.max or one of them");
            return Err(FigureError { message, help });
        }
        Ok(self.value(&figure))
    }
    /// The value of a figure; none if it has none, and for one of each subject.
    pub fn value(&self, figure: &Figure) -> Option<Value> {
        let extreme = |scope, wanted| {
            let mut all = self.of_each(figure, scope).map(|(_, value)| value);
            let first = all.next()??;
            all.try_fold(first, |best, value| {
                let value = value?;
                Some(if value.compare(best) == Some(wanted) { value } else { best })
            })
        };
        match figure.who() {
            Who::One(subject) => self.of(figure.what, subject),
            Who::Each(_) => None,
            Who::Min(scope) => extreme(scope, Ordering::Less),
            Who::Max(scope) => extreme(scope, Ordering::Greater),
        }
    }
    /// The values of a figure: one, or with its subject one for each, in order.
    pub fn values(&self, figure: &Figure) -> Vec<(Option<Subject>, Option<Value>)> {
        match figure.who() {
            Who::Each(scope) => self.of_each(figure, scope).map(|(subject, value)| (Some(subject), value)).collect(),
            _ => vec![(None, self.value(figure))],
        }
    }
    /// Every figure with a listed name and its value, in the order of [`Figure::all`].
    pub fn iter(&self) -> impl Iterator<Item = (Figure, Option<Value>)> {
        Figure::all(self.layout()).into_iter().map(|figure| {
            let value = self.value(&figure);
            (figure, value)
        })
    }

    fn of_each(&self, figure: &Figure, scope: Scope) -> impl Iterator<Item = (Subject, Option<Value>)> {
        let what = figure.what;
        scope.subjects(self.layout()).into_iter().map(move |subject| (subject, self.of(what, subject)))
    }
    fn of(&self, what: What, subject: Subject) -> Option<Value> {
        match what {
            What::Family(family) => self.counted(family, subject, 0),
            What::Fault(family, code) => self.counted(family, subject, code),
            What::Distribution(quantity, of) => of.of(self.histograms.get(quantity.name, recorded(subject)?)?),
            What::Steady(quantity, of) => {
                of.of(&self.steady.as_ref()?.values(quantity.name, recorded(subject)?, &self.histograms)?)
            }
        }
    }
    /// What is counted of a subject; `code` is that of a fault where the family asks for one.
    fn counted(&self, family: &Family, subject: Subject, code: u16) -> Option<Value> {
        let slave = |address| self.counts.slaves.get(self.layout().slave(address)?);
        let episodes = |address| self.episodes.slaves().iter().find(|slave| slave.address == address);
        match (family.of, subject) {
            (family::Of::Network(of), Subject::Network) => of(self),
            (family::Of::NetworkFault(of), Subject::Network) => of(self, code),
            (family::Of::Slave(of), Subject::Slave(address)) => of(slave(address)?),
            (family::Of::SlaveFault(of), Subject::Slave(address)) => of(slave(address)?, code),
            (family::Of::Episodes(of), Subject::Slave(address)) => of(episodes(address)?),
            (family::Of::EpisodesFault(of), Subject::Slave(address)) => of(episodes(address)?, code),
            (
                family::Of::Station(of),
                Subject::Slave(address) | Subject::Master(address) | Subject::Station(address),
            ) => Some(self.counts.live_list.at(address)).filter(|station| station.seen.is_some()).and_then(of),
            (family::Of::Master(of), Subject::Master(address)) => {
                of(self.counts.masters.iter().find(|master| master.address == address)?)
            }
            (family::Of::Link(of), Subject::Link(publisher, subscriber)) => {
                of(self.counts.links.get(self.layout().link(publisher, subscriber)?)?)
            }
            (family::Of::Acyclic(of), Subject::Acyclic(class)) => of(self.counts.acyclic.of(class)),
            _ => None,
        }
    }
}

impl Figure {
    /// The quantity that it is a statistic of, and whose; no subject where it is one of several. None if it is no
    /// statistic of a quantity, or one of the steady state.
    pub fn distribution(&self) -> Option<(&'static Quantity, Option<histogram::Subject>)> {
        let What::Distribution(quantity, _) = self.what else { return None };
        let subject = if let Who::One(subject) = self.who() { recorded(subject) } else { None };
        Some((quantity, subject))
    }
}

/// The subject of a distribution; none of those that have no distributions.
const fn recorded(subject: Subject) -> Option<histogram::Subject> {
    Some(match subject {
        Subject::Network => histogram::Subject::Network,
        Subject::Slave(address) => histogram::Subject::Slave(address),
        Subject::Link(publisher, subscriber) => histogram::Subject::Link(publisher, subscriber),
        Subject::Master(_) | Subject::Station(_) | Subject::Acyclic(_) => return None,
    })
}
