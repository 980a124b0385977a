//! Plots: the pictures of a run, each an SVG file that can be understood alone.
//!
//! [`Plots`] and [`BusCycle`] collect while the run goes on, in memory that does not grow with the number of cycles;
//! [`Plots::pictures`] draws. The same run gives the same octets. Floating point is fine here: these are pictures, no
//! results. One picture is one file here and one line in the registry.

use super::row::{CycleRow, EventRow, LinkRow, Sink, SlaveRow};
use super::topology::Map;
use crate::time::Span;
use crate::wire::Address;

mod buckets;
pub mod budget;
mod bus_cycle;
mod chart;
mod distribution;
mod disturbances;
pub mod futures;
mod lanes;
mod latch_skew;
mod look;
pub mod plan;
mod pll_convergence;
mod position;
mod publish_latency;
mod recovery;
pub mod sweep;
mod synch_delay;
mod t_dp_deviation;
mod telegrams;
#[cfg(test)]
mod tests;
mod timeline;
mod topology;

pub use distribution::{Distribution, Distributions, LinkLatencies};
pub use recovery::EpisodeTimes;
pub use telegrams::BusCycle;

/// One line of the registry.
struct Plot {
    file: &'static str,
    /// Whether there is anything to show.
    when: fn(&Material<'_>) -> bool,
    draw: fn(&Material<'_>) -> Result<String, String>,
}

/// Every picture.
const PLOTS: &[Plot] = &[
    Plot { file: "latch_skew.svg", when: always, draw: latch_skew::draw },
    Plot { file: "pll_convergence.svg", when: always, draw: pll_convergence::draw },
    Plot { file: "t_dp_deviation.svg", when: always, draw: t_dp_deviation::draw },
    Plot { file: "timeline.svg", when: always, draw: timeline::draw },
    Plot { file: "publish_latency.svg", when: always, draw: publish_latency::draw },
    Plot { file: "bus_cycle.svg", when: always, draw: bus_cycle::draw },
    Plot { file: "position.svg", when: always, draw: position::draw },
    Plot { file: "topology.svg", when: always, draw: topology::draw },
    Plot { file: "synch_delay.svg", when: |material| material.meta.shares_token(), draw: synch_delay::draw },
    Plot { file: "disturbances.svg", when: |material| material.plots.disturbed.any(), draw: disturbances::draw },
    Plot { file: "recovery.svg", when: |material| !material.distributions.episodes.is_empty(), draw: recovery::draw },
];

/// The names that the pictures of a run can have.
pub fn files() -> impl Iterator<Item = &'static str> {
    PLOTS.iter().map(|plot| plot.file)
}

const fn always(_: &Material<'_>) -> bool {
    true
}

/// What every picture says about the run.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct PlotMeta {
    /// Name of the scenario.
    pub scenario: String,
    /// Its seed.
    pub seed: u64,
    /// Symbol of the bus cycle: T_DP, or T_cycle without SYNCH.
    pub cycle: &'static str,
    /// Nominal T_DP.
    pub t_dp: Span,
    /// The slaves, ascending.
    pub slaves: Vec<Address>,
    /// The links: publisher, subscriber.
    pub links: Vec<(Address, Address)>,
    /// Masters that can have the token.
    pub masters: usize,
    /// Simulated duration.
    pub duration: Span,
    /// Names of the disturbances, by number.
    pub disturbances: Vec<String>,
    /// The segments with their stations.
    pub topology: Map,
}

impl PlotMeta {
    /// Whether SYNCH may have to wait for the token.
    const fn shares_token(&self) -> bool {
        self.masters > 1
    }
    /// Where `address` stands among the slaves.
    fn index(&self, address: Address) -> Option<usize> {
        self.slaves.binary_search(&address).ok()
    }
    /// Unit of an axis over `cycles`, and the length of a cycle in it.
    fn time_unit(&self, cycles: u64) -> (&'static str, f64) {
        let total = self.t_dp.as_s() * cycles as f64;
        if total >= 10.0 { ("s", self.t_dp.as_s()) } else { ("ms", self.t_dp.as_ms()) }
    }
}

/// A picture that could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("drawing {file} failed: {reason}")]
pub struct PlotError {
    /// Which picture.
    pub file: &'static str,
    /// What the library said.
    pub reason: String,
}

/// What a picture may look at.
struct Material<'a> {
    meta: &'a PlotMeta,
    plots: &'a Plots,
    distributions: &'a Distributions,
    bus: &'a BusCycle,
}

/// Collects what the pictures need from the rows of a run.
#[derive(Clone, Debug)]
pub struct Plots {
    meta: PlotMeta,
    pll: pll_convergence::StartUps,
    deviation: t_dp_deviation::Deviation,
    delays: synch_delay::Delays,
    timeline: timeline::Timeline,
    disturbed: disturbances::Disturbed,
    position: position::Positions,
}

impl Plots {
    /// Collectors for the slaves of `meta`.
    pub fn new(mut meta: PlotMeta) -> Self {
        meta.slaves.sort_unstable();
        meta.slaves.dedup();
        let slaves = meta.slaves.len();
        Self {
            pll: pll_convergence::StartUps::new(slaves),
            deviation: t_dp_deviation::Deviation::new(),
            delays: synch_delay::Delays::new(),
            timeline: timeline::Timeline::new(slaves),
            disturbed: disturbances::Disturbed::new(slaves),
            position: position::Positions::new(slaves),
            meta,
        }
    }

    /// Every picture that has anything to show: name of its file and its text.
    ///
    /// # Errors
    /// The first picture that could not be drawn.
    pub fn pictures(
        &self,
        distributions: &Distributions,
        bus: &BusCycle,
    ) -> Result<Vec<(&'static str, String)>, PlotError> {
        let material = Material { meta: &self.meta, plots: self, distributions, bus };
        let draw = |plot: &Plot| match (plot.draw)(&material) {
            Ok(text) => Ok((plot.file, text)),
            Err(reason) => Err(PlotError { file: plot.file, reason }),
        };
        PLOTS.iter().filter(|plot| (plot.when)(&material)).map(draw).collect()
    }
}

impl Sink for Plots {
    fn cycle(&mut self, row: &CycleRow) {
        self.deviation.cycle(row);
        self.delays.cycle(row);
    }
    fn slave(&mut self, row: &SlaveRow) {
        if let Some(index) = self.meta.index(row.slave) {
            self.pll.slave(index, row);
            self.timeline.slave(index, row);
            self.disturbed.slave(index, row);
            self.position.slave(index, row);
        }
    }
    fn link(&mut self, _row: &LinkRow) {
        // The latencies come as distributions.
    }
    fn event(&mut self, row: &EventRow) {
        let slave = self.meta.index(row.station);
        self.timeline.event(slave, row);
        self.disturbed.event(slave, row);
    }
}
