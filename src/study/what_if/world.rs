//! World: what of a scenario can be otherwise from some cycle on, in a network that runs.
//!
//! The stations go on as they are: whatever they were built with or told in Set_Prm stays. What is around them can change,
//! the line when SYNCH of this cycle is decided on, the rest with its first bit:
//!
//! ```text
//! line   master.gc_jitter           from this SYNCH on; the stream of draws goes on
//!        [[disturbance]]            the new list holds
//! rest   crystal of any station     a new rate, no step in its reading
//!        motion of a slave          a new movement, no step in its angle
//!        [[event]]                  orders that have not come yet are those of the new list
//! ```

use crate::device::node::Node;
use crate::sim::cut::Cuts;
use crate::sim::motion::Shaft;
use crate::sim::network::{Network, NetworkEvent};
use crate::sim::queue::Queue;
use crate::study::build;
use crate::study::scenario::{Event, Scenario, When};
use crate::time::Time;

/// The keys that can change, for messages.
pub(super) const KEYS: &str = "master.gc_jitter, crystal (of master, slave.N, class1.N, class2.N), slave.N.motion, \
                               disturbance, event";

/// `altered` with the world of `original`: where it is not `original`, something else differs.
fn in_the_old_world(original: &Scenario, altered: &Scenario) -> Scenario {
    let mut other = altered.clone();
    other.master.gc_jitter.clone_from(&original.master.gc_jitter);
    other.master.crystal = original.master.crystal;
    for (slave, old) in other.slaves.iter_mut().zip(&original.slaves) {
        slave.crystal = old.crystal;
        slave.motion = old.motion.clone();
    }
    for (class1, old) in other.class1.iter_mut().zip(&original.class1) {
        class1.crystal = old.crystal;
    }
    for (class2, old) in other.class2.iter_mut().zip(&original.class2) {
        class2.crystal = old.crystal;
    }
    other.disturbances.clone_from(&original.disturbances);
    other.events.clone_from(&original.events);
    // What is kept and expected of a run is no part of the network.
    other.record.clone_from(&original.record);
    other.expectations.clone_from(&original.expectations);
    other
}

/// Whether a network of `original` that runs can become one of `altered`. Its paths must know the disturbances of both
/// from the start ([`build::network_beside`]).
pub(super) fn can_change(original: &Scenario, altered: &Scenario) -> bool {
    in_the_old_world(original, altered) == *original
}
/// Whether the paths have room for the cuts of both.
pub(super) fn has_room(original: &Scenario, altered: &Scenario) -> bool {
    build::cuts_beside(original, altered).len() <= Cuts::MAX
}

/// Those of `events` that have not come at `now`, before `cycle` begins.
fn coming(events: &[Event], now: Time, cycle: u64) -> impl Iterator<Item = &Event> {
    events.iter().filter(move |event| match event.when {
        When::Time(at) => Time::ZERO + at > now,
        When::Cycle(at) => at >= cycle,
    })
}

/// Whether both scenarios order the same until `now`, before `cycle` begins.
pub(super) fn same_past(original: &Scenario, altered: &Scenario, now: Time, cycle: u64) -> bool {
    let past = |scenario: &Scenario| -> Vec<Event> {
        let coming: Vec<_> = coming(&scenario.events, now, cycle).collect();
        scenario.events.iter().filter(|event| !coming.contains(event)).cloned().collect()
    };
    past(original) == past(altered)
}

/// Turns the line of `network`, which runs as `original` says, into one that goes on as `altered` says.
///
/// # Panics
/// If a scenario breaks a rule that reading it checks.
pub(super) fn change_line<Q: Queue<NetworkEvent>>(network: &mut Network<Node, Q>, [original, altered]: [&Scenario; 2]) {
    if altered.master.gc_jitter != original.master.gc_jitter {
        network.change_jitter(altered.master.gc_jitter.clone()).expect("a checked jitter");
    }
    if altered.disturbances != original.disturbances {
        network.set_faults(build::faults(altered));
        build::order_disturbances(network, altered);
    }
}

/// The same with the rest of the world, when `cycle` begins.
///
/// # Panics
/// As [`change_line`].
pub(super) fn change_rest<Q: Queue<NetworkEvent>>(
    network: &mut Network<Node, Q>,
    [original, altered]: [&Scenario; 2],
    cycle: u64,
) {
    for (station, old) in altered.stations().zip(original.stations()) {
        if station.crystal != old.crystal {
            let ppb = build::crystal_offset(altered.run.seed, station.address, station.crystal);
            network.set_crystal(station.address, ppb).expect("a checked offset");
        }
    }
    for (slave, old) in altered.slaves.iter().zip(&original.slaves) {
        if slave.motion != old.motion {
            network.set_shaft(slave.address, Shaft::new(&slave.motion).expect("a checked motion"));
        }
    }
    if altered.events != original.events {
        network.cancel_orders();
        let coming: Vec<_> = coming(&altered.events, network.now(), cycle).cloned().collect();
        build::order(network, altered, &coming);
    }
}
