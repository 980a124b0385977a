//! What if: from some cycle on, another future beside the one that was.
//!
//! The scenario runs to the cycle, the network is copied, the world around the copy's stations is changed, and both go
//! on side by side. Until the cycle begins, with the first bit of its SYNCH, both do the same.

pub mod command;
mod fork;
mod rider;
mod world;

use super::difference::{Differences, End, Race, Runner};
use super::event_budget::EventBudget;
use super::replay::ReplayError;
use super::scenario::Scenario;
use crate::sim::cut::Cuts;
use crate::sim::network::NetworkEvent;
use crate::sim::queue::Queue;
use crate::sim::record::Recorder;
use crate::time::{Span, Time};

/// Why there is no other future.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum WhatIfError {
    /// The run does not come so far.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// Something would change that only a new start-up can.
    #[error(
        "{keys}: this cannot change while the network runs\n  rule: a station keeps what it was built with and what \
         Set_Prm told it; what can change is around it: {}\n  help: for a whole run with it, use --run-set instead of --set",
        world::KEYS
    )]
    Station {
        /// Which overrides.
        keys: String,
    },
    /// Cables are cut at more places than a network can tell apart.
    #[error(
        "too many cuts\n  rule: at most {max} places in both futures together (Model)\n  help: fewer cuts, or --run-set instead of --set",
        max = Cuts::MAX
    )]
    Cuts,
    /// An order that would have come before.
    #[error(
        "an event before cycle {cycle} is not the same: what has happened cannot change\n  help: give it an instant after the beginning of cycle {cycle}"
    )]
    Past {
        /// The cycle from which on the future is another.
        cycle: u64,
    },
}

/// Two futures of one run.
#[derive(Debug)]
pub struct Futures<R> {
    /// When they part.
    pub from: Time,
    /// What they differ in.
    pub differences: Differences,
    /// The end of each, and what rode along: first that of the original, then that of the other.
    pub ends: [(Time, R); 2],
}

/// Runs `original` with `rider` until `cycle` begins, and from there on beside `altered`; for `window` cycles, or to
/// the end of the run. `alter` is told of the rider of the other future before it goes on.
///
/// # Errors
/// The run has no such cycle or makes no headway, or a network that runs cannot become `altered`.
///
/// # Panics
/// If a scenario breaks a rule that reading it checks.
pub fn futures<Q: Queue<NetworkEvent> + Clone, R: Recorder + Clone>(
    [original, altered]: [&Scenario; 2],
    (cycle, window): (u64, Option<u64>),
    mut rider: R,
    alter: impl FnOnce(&mut R),
) -> Result<Futures<R>, WhatIfError> {
    if !world::can_change(original, altered) {
        return Err(WhatIfError::Station { keys: String::new() });
    }
    if !world::has_room(original, altered) {
        return Err(WhatIfError::Cuts);
    }
    let fork = fork::fork::<Q, R>([original, altered], cycle, &mut rider)?;
    let from = fork.begin;
    if !world::same_past(original, altered, from, cycle) {
        return Err(WhatIfError::Past { cycle });
    }
    let mut other = fork.network.clone();
    world::change_line(&mut other, [original, altered]);
    let mut end = End::of(original);
    if let Some(window) = window {
        end = end.or_cycle(cycle.saturating_add(window));
    }
    let before = cycle.checked_sub(1);
    let runner = |network, scenario: &Scenario, rider| {
        let guard = Some(EventBudget::of(scenario).headway(&network, scenario));
        Runner { network, master: original.master.address, cycle: before, end, guard, rider }
    };
    let mut beside = rider.clone();
    alter(&mut beside);
    let runners = [runner(fork.network, original, rider), runner(other, altered, beside)];
    let mut race = Race::of(runners, original.master.t_dp);
    race.advance(from - Span::from_ticks(1));
    world::change_rest(race.begin(cycle), [original, altered], cycle);
    let (differences, ends) = race.run_guarded().map_err(ReplayError::from)?;
    Ok(Futures { from, differences, ends })
}
