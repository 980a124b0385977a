//! The network's part in what comes onto the line from nowhere.

use super::turn::{Effect, Turning};
use super::{Event, Network, NetworkEvent};
use crate::fdl::Station;
use crate::observation::{Disturbance, Observation};
use crate::sim::bus::Mark;
use crate::sim::fault::source::Emission;
use crate::sim::queue::{Phase, Queue};
use crate::sim::record::{Origin, Recorder};

impl<S: Station, Q: Queue<NetworkEvent>> Network<S, Q> {
    /// A burst begins. What goes on by itself may still be planned from the one before.
    pub(super) fn start_source(&mut self, index: usize) {
        let Turning { effect: Effect::Source(source), slots, .. } = &mut self.turning[index] else { return };
        if source.planned {
            return;
        }
        source.planned = source.goes_on();
        let (at, slot) = (self.now + source.fault.after + source.pause(), slots[0]);
        self.push(at, Phase::Send, slot, (Event::Source, index as u32));
    }
    /// What a source has planned comes now. Noise that goes on stops outside of a burst until the next one begins.
    #[cold]
    pub(super) fn emit<R: Recorder>(&mut self, index: usize, recorder: &mut R) {
        let Turning { number, turns, retired: false, slots, effect: Effect::Source(source), .. } =
            &mut self.turning[index]
        else {
            return;
        };
        if source.goes_on() {
            source.planned = turns.is_on();
            if !source.planned {
                return;
            }
        }
        let (number, now, slot) = (*number, self.now, slots[0]);
        let broken = source.fill(&mut self.altered);
        let again = source.planned.then(|| source.pause());
        let how = match source.fault.what {
            Emission::Noise { .. } => Disturbance::Noise,
            Emission::Telegram(_) => Disturbance::Foreign,
        };
        let end = now + self.rate.octets(self.altered.len());
        let mark = Mark { origin: Origin::Disturbance(number), broken, apart: true };
        self.tell(slot, &Observation::Disturbed { number, how }, recorder);
        self.send_altered(slot, (now, end), mark, recorder);
        if let Some(again) = again {
            self.push(now + again, Phase::Send, slot, (Event::Source, index as u32));
        }
    }
}
