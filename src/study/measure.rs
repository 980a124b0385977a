//! Measure: a run of which only figures and pools are wanted, many times over: no files, no pictures, no fingerprint.

use super::build;
use super::episode::Episodes;
use super::event_budget::{EventBudget, NoHeadway};
use super::figure::{Figure, Figures};
use super::histogram::Histograms;
use super::metric::Metrics;
use super::pool::Pools;
use super::row::{CycleRow, EventRow, LinkRow, Sink, SlaveRow};
use super::run::{Progress, Speeds, episodes, layout, steady_state};
use super::scenario::Scenario;
use super::steady::SteadyState;
use crate::device::node::Node;
use crate::sim::network::{Network, NetworkEvent};
use crate::sim::queue::Queue;

/// What keeps what figures are made of. The steady state is watched for only where one of them asks: it costs a look at
/// everything that is recorded when it begins.
struct Kept {
    steady: Option<SteadyState>,
    histograms: Histograms,
    episodes: Episodes,
}
impl Sink for Kept {
    fn cycle(&mut self, row: &CycleRow) {
        if let Some(steady) = &mut self.steady {
            steady.cycle(row, &self.histograms);
        }
        self.histograms.cycle(row);
    }
    fn slave(&mut self, row: &SlaveRow) {
        self.histograms.slave(row);
        self.episodes.slave(row);
        if let Some(steady) = &mut self.steady {
            steady.slave(row);
        }
    }
    fn link(&mut self, row: &LinkRow) {
        self.histograms.link(row);
    }
    fn event(&mut self, row: &EventRow) {
        self.histograms.event(row);
        self.episodes.event(row);
        if let Some(steady) = &mut self.steady {
            steady.event(row);
        }
    }
}

/// Runs `scenario`, for the figures `wanted` besides those that it expects something of, and fills `pools`. The memory of
/// `used`, if there is any, serves again. `go_on` is told the progress now and then and tells whether the run goes on; none if it did not.
///
/// # Errors
/// The run makes no headway.
pub fn measure<Q: Queue<NetworkEvent>>(
    (wanted, pools): (&[Figure], &mut Pools),
    scenario: &Scenario,
    used: Option<Histograms>,
    go_on: impl FnMut(Progress) -> bool,
) -> Result<Option<Figures>, NoHeadway> {
    let layout = layout(scenario);
    let histograms = match used {
        Some(mut used) => {
            used.reset(&layout);
            used
        }
        None => Histograms::new(&layout),
    };
    let expected = scenario.expectations.iter().map(|expectation| &expectation.figure);
    let asked = wanted.iter().chain(expected).any(Figure::is_of_steady_state);
    let steady = if asked { steady_state(scenario, &layout) } else { None };
    let sinks = (Kept { steady, histograms, episodes: episodes(scenario, &layout) }, pools);
    let mut metrics = Metrics::new(layout, Speeds::of(scenario), sinks);
    let mut network: Network<Node, Q> = build::network(scenario);
    if !EventBudget::of(scenario).run_while(&mut network, scenario, &mut metrics, go_on)? {
        return Ok(None);
    }
    let (counts, (Kept { steady, histograms, mut episodes }, _)) = metrics.finish(network.now());
    episodes.finish(network.now());
    Ok(Some(Figures::new(counts, histograms, episodes).with_steady_state(steady)))
}
