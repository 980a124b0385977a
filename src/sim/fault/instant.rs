//! What goes wrong with instants: receivers that capture late or early, and slaves that are slow to answer.
//!
//! | fault | what strays | bounds |
//! |---|---|---|
//! | Receiver | when a telegram's end reaches a station's machine | never before its last bit has left the sender |
//! | Answer | when a slave begins to answer | never earlier than without the disturbance |
//!
//! Each telegram strays by itself, and each station has draws of its own.

use crate::sim::fault::window::Window;
use crate::sim::noise::{Purpose, Stream};
use crate::time::{Span, Time};
use crate::wire::Address;

/// What a disturbance does to instants.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum InstantFault {
    /// These stations capture a telegram's end early or late, equally likely anywhere within the half width.
    Receiver {
        /// Largest deviation, at least 0.
        half_width: Span,
    },
    /// These slaves answer later.
    Answer {
        /// By this, at least 0.
        by: Span,
        /// And by up to this, equally likely, at least 0.
        up_to: Span,
    },
}

/// A disturbance of instants at work.
#[derive(Clone, Debug)]
pub(super) struct Straying {
    /// Number of the disturbance in the scenario, from 0.
    pub number: u16,
    window: Window,
    fault: InstantFault,
    streams: Vec<(Address, Stream)>,
}

impl Straying {
    pub(super) fn new(
        (number, name, window): (u16, &str, Window),
        stations: &[Address],
        fault: InstantFault,
        seed: u64,
    ) -> Self {
        let purpose = match fault {
            InstantFault::Receiver { .. } => Purpose::Sampling,
            InstantFault::Answer { .. } => Purpose::ResponseDelay,
        };
        let stream = |&station: &Address| (station, Stream::of_disturbance(seed, name, station.get(), purpose));
        Self { number, window, fault, streams: stations.iter().map(stream).collect() }
    }
    /// Takes over what the same disturbance had drawn.
    pub(super) fn go_on_from(&mut self, before: &Self) {
        self.streams.clone_from(&before.streams);
    }
    /// How much later than usual something of this station is now.
    pub(super) fn draw(&mut self, station: Address, (now, cycle): (Time, u64)) -> Span {
        let stream = self.streams.iter_mut().find(|(other, _)| *other == station);
        let Some((_, stream)) = stream.filter(|_| self.window.contains(now, cycle)) else { return Span::ZERO };
        match self.fault {
            InstantFault::Receiver { half_width } => stream.uniform(half_width),
            InstantFault::Answer { by, up_to } => by + Span::from_ticks(stream.below(up_to.ticks() as u64 + 1) as i64),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::fault::window::Bursts;

    const NS: Span = Span::from_ns(1);

    fn draws(fault: InstantFault, name: &str, station: u8) -> Vec<Span> {
        let stations = [3, 4].map(|number| Address::new(number).unwrap());
        let window = Window::Cycles(Bursts::once(0, Some(2_000)));
        let mut straying = Straying::new((0, name, window), &stations, fault, 9);
        (0..3_000).map(|cycle| straying.draw(Address::new(station).unwrap(), (Time::ZERO, cycle))).collect()
    }

    #[test]
    fn strays_reach_their_bounds_within_the_window_alone() {
        let receiver = draws(InstantFault::Receiver { half_width: NS * 50 }, "a", 3);
        let (low, high) = (receiver.iter().min().unwrap(), receiver.iter().max().unwrap());
        assert!(*low >= -NS * 50 && *low < -NS * 48 && *high <= NS * 50 && *high > NS * 48);
        let answer = draws(InstantFault::Answer { by: NS * 100, up_to: NS * 50 }, "a", 3);
        let (inside, outside) = answer.split_at(2_000);
        let (low, high) = (inside.iter().min().unwrap(), inside.iter().max().unwrap());
        assert!(*low >= NS * 100 && *low < NS * 102 && *high <= NS * 150 && *high > NS * 148);
        assert!(outside.iter().chain(&receiver[2_000..]).all(|&stray| stray == Span::ZERO));
        assert!(draws(InstantFault::Answer { by: NS, up_to: NS }, "a", 5).iter().all(|&stray| stray == Span::ZERO));
    }

    #[test]
    fn each_station_and_each_disturbance_has_its_own_draws() {
        let fault = InstantFault::Receiver { half_width: NS * 50 };
        assert_eq!(draws(fault, "a", 3), draws(fault, "a", 3));
        assert_ne!(draws(fault, "a", 3), draws(fault, "a", 4));
        assert_ne!(draws(fault, "a", 3), draws(fault, "b", 3));
    }
}
