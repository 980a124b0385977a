//! Pools: every value that a quantity had in a run, wherever somebody asks for it.
//!
//! A name is that of a figure without its statistic: `latch_skew`, `slave.3.pll_error`, `link.3-11.publish`.

use super::figure::Figure;
use super::histogram::{QUANTITIES, Quantity, Source, Subject};
use super::row::{CycleRow, LinkRow, Sink, SlaveRow};
use super::scenario::section::suggestion;
use super::statistics::aggregate::{Place, RunKey};
use super::statistics::pool::Pool;
use crate::time::Span;

/// A quantity of one subject.
#[derive(Clone, Debug)]
pub struct Pooled {
    name: String,
    /// A figure that networks have if they have this quantity: its largest value.
    figure: Figure,
    quantity: &'static Quantity,
    subject: Subject,
}

/// Two are the same if they have the same name.
impl PartialEq for Pooled {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

/// A name of no quantity.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct PooledError {
    /// What is wrong.
    pub message: String,
    /// What would be right.
    pub help: String,
}

impl Pooled {
    /// The quantity called `name`.
    ///
    /// # Errors
    /// There is none, or it is one of several subjects.
    pub fn named(name: &str) -> Result<Self, PooledError> {
        let figure = Figure::named(&format!("{name}.max")).ok();
        let found = figure.and_then(|figure| Some((figure.distribution()?, figure)));
        let Some(((quantity, subject), figure)) = found else { return Err(unknown(name)) };
        match subject {
            Some(subject) => Ok(Self { name: name.to_owned(), figure, quantity, subject }),
            None => Err(PooledError {
                message: format!("\"{name}\" is a quantity of several, and a pool is that of one"),
                help: format!("name one of them, such as \"{}\"", example(quantity)),
            }),
        }
    }
    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }
    /// Its quantity.
    pub const fn quantity(&self) -> &'static Quantity {
        self.quantity
    }
    /// Its largest value as a figure; a network that has this has the quantity.
    pub const fn figure(&self) -> &Figure {
        &self.figure
    }
}

fn unknown(name: &str) -> PooledError {
    let known: Vec<_> = QUANTITIES.iter().map(example).collect();
    let help = suggestion(name, known.iter().map(String::as_str));
    PooledError { message: format!("\"{name}\" is no quantity of a cycle"), help }
}
/// How a quantity is named.
fn example(quantity: &Quantity) -> String {
    let name = quantity.name;
    match quantity.source {
        Source::Network(_) | Source::Ring(_) => name.to_owned(),
        Source::Slave(_) => format!("slave.3.{name}"),
        Source::Link(_) => format!("link.3-11.{name}"),
    }
}

/// The pools of one run, in the order in which they were asked for.
#[derive(Clone, Debug)]
pub struct Pools {
    run: RunKey,
    all: Vec<(Source, Subject, Pool)>,
}

impl Pools {
    /// Empty pools for the run of this key.
    pub fn new(run: RunKey, wanted: &[Pooled]) -> Self {
        let pool = |pooled: &Pooled| (pooled.quantity.source, pooled.subject, Pool::default());
        Self { run, all: wanted.iter().map(pool).collect() }
    }
    /// No pool.
    pub const fn none() -> Self {
        Self { run: RunKey(0), all: Vec::new() }
    }
    /// What they hold.
    pub fn into_pools(self) -> impl Iterator<Item = Pool> {
        self.all.into_iter().map(|(_, _, pool)| pool)
    }
    fn add(&mut self, cycle: u64, of: impl Fn(Source, Subject) -> Option<Span>) {
        let at = Place { run: self.run, cycle };
        for (source, subject, pool) in &mut self.all {
            if let Some(value) = of(*source, *subject) {
                pool.add(value.ticks(), at);
            }
        }
    }
}

impl Sink for Pools {
    fn cycle(&mut self, row: &CycleRow) {
        self.add(row.cycle, |source, _| match source {
            Source::Network(of) | Source::Ring(of) => of(row),
            Source::Slave(_) | Source::Link(_) => None,
        });
    }
    fn slave(&mut self, row: &SlaveRow) {
        self.add(row.cycle, |source, subject| match source {
            Source::Slave(of) if subject == Subject::Slave(row.slave) => of(row),
            _ => None,
        });
    }
    fn link(&mut self, row: &LinkRow) {
        self.add(row.cycle, |source, subject| match source {
            Source::Link(of) if subject == Subject::Link(row.publisher, row.subscriber) => of(row),
            _ => None,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::sample;

    fn pools(names: &[&str]) -> Pools {
        let wanted: Vec<_> = names.iter().map(|name| Pooled::named(name).unwrap()).collect();
        let mut pools = Pools::new(RunKey(9), &wanted);
        for cycle in 1..=3 {
            pools.cycle(&sample::cycle(cycle));
            pools.slave(&sample::slave(cycle, 3));
            pools.slave(&sample::slave(cycle, 5));
            pools.link(&sample::link(cycle));
        }
        pools
    }

    #[test]
    fn every_quantity_of_a_subject_has_its_values_and_no_others() {
        for name in ["latch_skew", "slave.5.pll_error", "link.3-5.age"] {
            let pool = pools(&[name]).into_pools().next().unwrap();
            let first = pool.values().max().unwrap().at;
            assert_eq!((pool.values().count(), first.run), (3, RunKey(9)), "{name}");
            assert!((1..=3).contains(&first.cycle), "{name}");
        }
        let none: Vec<_> = pools(&["slave.9.pll_error", "link.5-3.age"]).into_pools().collect();
        assert_eq!(none, [Pool::default(), Pool::default()]);
        let skew = pools(&["latch_skew"]).into_pools().next().unwrap();
        assert_eq!(skew.values().min().unwrap().value, sample::cycle(1).latch_skew.unwrap().ticks());
    }

    #[test]
    fn names_that_are_none_are_told_with_the_nearest() {
        let told = |name: &str| {
            let PooledError { message, help } = Pooled::named(name).unwrap_err();
            format!("{message}; {help}")
        };
        assert_eq!(told("latch_skwe"), "\"latch_skwe\" is no quantity of a cycle; did you mean \"latch_skew\"?");
        assert_eq!(
            told("slave.each.pll_error"),
            "\"slave.each.pll_error\" is a quantity of several, and a pool is that of one; name one of them, such as \"slave.3.pll_error\""
        );
        assert!(
            told("pll_error").contains("known here: latch_skew, ")
                && told("pll_error").contains(", slave.3.pll_error, ")
        );
        assert!(told("faults").starts_with("\"faults\" is no quantity of a cycle; "));
        assert!(told("steady.latch_skew").starts_with("\"steady.latch_skew\" is no quantity of a cycle; "));
    }
}
