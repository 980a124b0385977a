//! The recorder: everything that reads a run reads it here, and nothing that reads can change it.

use super::crystal::Crystal;
use crate::observation::Observation;
use crate::time::Time;
use crate::wire::Address;

/// One telegram on the line, after whatever the scenario did to it.
#[derive(Clone, Copy, Debug)]
pub struct Transmission<'a> {
    /// First bit at the sender.
    pub start: Time,
    /// Last bit at the sender.
    pub end: Time,
    /// Who sent it.
    pub sender: Address,
    /// The characters.
    pub octets: &'a [u8],
    /// How it came onto the line.
    pub origin: Origin,
}

/// How a telegram came onto the line.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Origin {
    /// Its sender sent it.
    #[default]
    Sender,
    /// A disturbance of this number, from 0, put it there at the sender's place.
    Disturbance(u16),
}

/// Who saw something, and when.
#[derive(Clone, Copy, Debug)]
pub struct Stamp<'a> {
    /// True time.
    pub at: Time,
    /// The station.
    pub station: Address,
    /// The station's crystal, for instants inside the observation.
    pub crystal: &'a Crystal,
}

/// Reads a run while it happens.
pub trait Recorder {
    /// A telegram will be on the line. Comes when its sender decides so, at or before its first bit; telegrams that do
    /// not overlap come in the order of their starts. What a disturbance has held up or made comes with its first bit, when
    /// a telegram that begins a little later may have come already.
    fn telegram(&mut self, telegram: &Transmission<'_>);
    /// A station observed something.
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation);
    /// The station `sender` lost its supply at `now`: what was told of its telegrams that would begin later never
    /// reaches the line. Who keeps telegrams drops them.
    fn withdrawn(&mut self, _sender: Address, _now: Time) {}
}

impl Recorder for () {
    fn telegram(&mut self, _: &Transmission<'_>) {}
    fn observe(&mut self, _: Stamp<'_>, _: &Observation) {}
}

impl<A: Recorder, B: Recorder> Recorder for (A, B) {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        self.0.telegram(telegram);
        self.1.telegram(telegram);
    }
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        self.0.observe(stamp, what);
        self.1.observe(stamp, what);
    }
    fn withdrawn(&mut self, sender: Address, now: Time) {
        self.0.withdrawn(sender, now);
        self.1.withdrawn(sender, now);
    }
}

impl<R: Recorder> Recorder for Option<R> {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        if let Some(recorder) = self {
            recorder.telegram(telegram);
        }
    }
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        if let Some(recorder) = self {
            recorder.observe(stamp, what);
        }
    }
    fn withdrawn(&mut self, sender: Address, now: Time) {
        if let Some(recorder) = self {
            recorder.withdrawn(sender, now);
        }
    }
}

impl<R: Recorder> Recorder for &mut R {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        (**self).telegram(telegram);
    }
    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        (**self).observe(stamp, what);
    }
    fn withdrawn(&mut self, sender: Address, now: Time) {
        (**self).withdrawn(sender, now);
    }
}
