//! Measure: a run of which only figures are wanted, many times over: no files, no pictures, no fingerprint.

use super::build;
use super::event_budget::{EventBudget, NoHeadway};
use super::figure::Figures;
use super::histogram::Histograms;
use super::metric::Metrics;
use super::run::{Progress, Speeds, episodes, layout};
use super::scenario::Scenario;
use crate::device::node::Node;
use crate::sim::network::{Network, NetworkEvent};
use crate::sim::queue::Queue;

/// Runs `scenario`. The memory of `used`, if there is any, serves again. `go_on` is told the progress now and then and
/// tells whether the run goes on; none if it did not.
///
/// # Errors
/// The run makes no headway.
pub fn measure<Q: Queue<NetworkEvent>>(
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
    let sinks = (histograms, episodes(scenario, &layout));
    let mut metrics = Metrics::new(layout, Speeds::of(scenario), sinks);
    let mut network: Network<Node, Q> = build::network(scenario);
    if !EventBudget::of(scenario).run_while(&mut network, scenario, &mut metrics, go_on)? {
        return Ok(None);
    }
    let (counts, (histograms, mut episodes)) = metrics.finish(network.now());
    episodes.finish(network.now());
    Ok(Some(Figures::new(counts, histograms, episodes)))
}
