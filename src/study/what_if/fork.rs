//! Fork: a run brought to the point where a cycle begins, so that it can go on in two ways.
//!
//! A cycle begins with its SYNCH. The master gives it to the line as soon as its other work is done, long before the
//! first bit, and there it is decided whether this SYNCH strays or is lost. So the fork lies just before that; without
//! SYNCH, just before the cycle begins.

use crate::device::node::Node;
use crate::observation::{Disturbance, Observation};
use crate::sim::network::{Network, NetworkEvent, Until};
use crate::sim::queue::Queue;
use crate::sim::record::{Recorder, Stamp, Transmission};
use crate::study::build;
use crate::study::difference::{End, is_synch};
use crate::study::event_budget::EventBudget;
use crate::study::replay::ReplayError;
use crate::study::scenario::Scenario;
use crate::time::Time;
use crate::wire::Address;

/// What became of a SYNCH that the master sent.
#[derive(Clone, Copy)]
enum Sent {
    /// Its first bit leaves then.
    At(Time),
    /// The scenario took it away.
    TakenAway,
}

/// Looks for the master's last deed before a cycle.
struct Scout {
    master: Address,
    /// The SYNCH that was just sent.
    sent: Option<Sent>,
    /// When the cycle began.
    begun: Option<Time>,
}

impl Recorder for Scout {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        if telegram.sender == self.master && is_synch(telegram.octets) {
            self.sent = Some(Sent::At(telegram.start));
        }
    }
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        match what {
            _ if stamp.station != self.master => {}
            // A SYNCH that the scenario takes away is never a telegram.
            Observation::Disturbed { how: Disturbance::Lost, .. } => self.sent = Some(Sent::TakenAway),
            Observation::CycleStart { .. } => self.begun = Some(stamp.at),
            _ => {}
        }
    }
}

/// A network before a cycle.
pub(super) struct Fork<Q> {
    pub(super) network: Network<Node, Q>,
    /// When the cycle begins: first bit of its SYNCH, or t0 without one.
    pub(super) begin: Time,
}

/// The network of `scenario` as it is before `cycle`, with paths on which what `altered` disturbs can act too; `recorder` has
/// seen everything until then.
///
/// # Errors
/// The run has no such cycle, or makes no headway.
pub(super) fn fork<Q: Queue<NetworkEvent> + Clone, R: Recorder>(
    [scenario, altered]: [&Scenario; 2],
    cycle: u64,
    recorder: &mut R,
) -> Result<Fork<Q>, ReplayError> {
    let mut network: Network<Node, Q> = build::network_beside(scenario, altered);
    let mut headway = EventBudget::of(scenario).headway(&network, scenario);
    let end = End::of(scenario);
    let at = end.at.unwrap_or(Time::MAX);
    let over = |network: &Network<Node, Q>| end.cycle.is_some_and(|last| network.cycles() > last);
    let too_late = |network: &Network<Node, Q>| match network.cycles().checked_sub(1) {
        Some(last) => ReplayError::NoSuchCycle { wanted: cycle, last },
        None => ReplayError::NoCycle,
    };
    // As far as the beginning of the cycle before.
    while network.cycles() < cycle {
        if over(&network) || network.run(Until::Time(at), 1, recorder) {
            return Err(too_late(&network));
        }
        headway.check(1, &mut network, recorder)?;
    }
    let mut probe = network.clone();
    let mut scout = Scout { master: scenario.master.address, sent: None, begun: None };
    let (mut events, mut last) = (0, None);
    let t0 = loop {
        if over(&probe) || probe.run(Until::Time(at), 1, &mut scout) {
            return Err(too_late(&probe));
        }
        headway.check(1, &mut probe, &mut scout)?;
        if let Some(sent) = scout.sent.take() {
            last = Some((events, sent));
        }
        if let Some(t0) = scout.begun {
            break t0;
        }
        events += 1;
    };
    let (before, sent) = last.unwrap_or((events, Sent::TakenAway));
    network.run(Until::Time(at), before, recorder);
    let begin = match sent {
        Sent::At(start) => start,
        Sent::TakenAway => t0,
    };
    Ok(Fork { network, begin })
}
