//! The network's part in disturbances of the line: what becomes of a telegram, and telegrams that wait.
//!
//! Model: what a disturbance has put on the line is not disturbed again, except that it may collide.

use super::{Event, Network, NetworkEvent};
use crate::fdl::Station;
use crate::observation::Observation;
use crate::sim::bus::Mark;
use crate::sim::fault::line::Struck;
use crate::sim::fault::which::Sent;
use crate::sim::queue::{Phase, Queue};
use crate::sim::record::{Origin, Recorder};
use crate::time::{Span, Time};
use crate::wire::Frame;

/// A telegram that waits for its first bit.
#[derive(Clone, Debug)]
struct Waiting {
    frame: Frame,
    broken: bool,
    origin: Origin,
    length: Span,
}

/// Telegrams that a disturbance has held up or made and that are not on the line yet.
#[derive(Clone, Debug, Default)]
pub(super) struct Held {
    telegrams: Vec<Waiting>,
    free: Vec<u16>,
}

impl Held {
    /// Keeps a telegram of this length. Returns its place.
    fn keep(&mut self, frame: &Frame, broken: bool, origin: Origin, length: Span) -> u16 {
        let place = self.free.pop().unwrap_or_else(|| {
            self.telegrams.push(Waiting { frame: Frame::new(), broken, origin, length });
            self.telegrams.len() as u16 - 1
        });
        let waiting = &mut self.telegrams[usize::from(place)];
        waiting.frame.copy_from(frame);
        (waiting.broken, waiting.origin, waiting.length) = (broken, origin, length);
        place
    }
}

impl<S: Station, Q: Queue<NetworkEvent>> Network<S, Q> {
    /// What disturbances make of the telegram in the outbox. When it is on the line if it is to be sent as it is; otherwise
    /// it is on its way already, or lost.
    #[cold]
    pub(super) fn disturbed<R: Recorder>(
        &mut self,
        slot: usize,
        (start, end): (Time, Time),
        clock: bool,
        recorder: &mut R,
    ) -> Option<(Time, Time)> {
        let delay = if clock { Span::ZERO } else { self.answer_delay(slot, start) };
        let (start, end) = (start + delay, end + delay);
        let cycle = self.clocks_begun(clock);
        let sender = self.slots[slot].address;
        if self.faults.line.is_idle() {
            return (!self.faults.mutes(sender, (start, cycle))).then_some((start, end));
        }
        let (_, frame) = self.out.sending()?;
        self.faults.line.judge((start, cycle), &Sent { sender, clock, octets: frame.octets() });
        if self.faults.mutes(sender, (start, cycle)) {
            return None;
        }
        let (mut lost, mut late) = (false, Span::ZERO);
        for index in 0..self.faults.line.strikes().len() {
            let strike = self.faults.line.strikes()[index];
            let what = Observation::Disturbed { number: strike.number, how: strike.what.how() };
            self.tell(slot, &what, recorder);
            match strike.what {
                Struck::Lost => lost = true,
                Struck::Late(by) => late += by,
                Struck::Twice(_) | Struck::Damaged => {}
            }
        }
        if lost {
            return None;
        }
        let length = end - start;
        self.copy_telegrams(slot, (end + late, length));
        let (frame, broken) = self.faults.line.telegram();
        if late > Span::ZERO {
            let place = self.held.keep(frame, broken, Origin::Sender, length);
            self.push(start + late, Phase::Send, slot, (Event::Held, place.into()));
        } else {
            self.altered.copy_from(frame);
            self.send_altered(slot, (start, end), Mark { broken, ..Mark::OWN }, recorder);
        }
        None
    }
    /// How much later than usual a station answers.
    fn answer_delay(&mut self, slot: usize, start: Time) -> Span {
        let running = (start, self.clocks_begun(false));
        self.faults.answer_delay(self.slots[slot].address, running)
    }
    /// Keeps the copies of a telegram of this length that ends at `end`, as its sender has sent it.
    fn copy_telegrams(&mut self, slot: usize, (end, length): (Time, Span)) {
        for index in 0..self.faults.line.strikes().len() {
            let strike = self.faults.line.strikes()[index];
            if let (Struck::Twice(after), Some((_, frame))) = (strike.what, self.out.sending()) {
                let place = self.held.keep(frame, false, Origin::Disturbance(strike.number), length);
                self.push(end + after, Phase::Send, slot, (Event::Held, place.into()));
            }
        }
    }
    /// A telegram that waited leaves now. A station without supply sends nothing, nor does one that is kept from it.
    pub(super) fn release<R: Recorder>(&mut self, slot: usize, place: usize, recorder: &mut R) {
        self.held.free.push(place as u16);
        let running = (self.now, self.clocks_begun(false));
        let Self { held, altered, slots, now, faults, .. } = self;
        let Waiting { frame, broken, origin, length } = &held.telegrams[place];
        let sends = slots[slot].powered && !faults.mutes(slots[slot].address, running);
        if *origin == Origin::Sender && !sends {
            return;
        }
        altered.copy_from(frame);
        let (line, mark) = ((*now, *now + *length), Mark { origin: *origin, broken: *broken, apart: false });
        self.send_altered(slot, line, mark, recorder);
    }
}
