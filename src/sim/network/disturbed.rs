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
    /// Puts the telegram in the outbox onto the line, or what disturbances leave of it.
    #[cold]
    pub(super) fn transmit_disturbed<R: Recorder>(
        &mut self,
        slot: usize,
        (start, end): (Time, Time),
        clock: bool,
        recorder: &mut R,
    ) {
        let delay = if clock { Span::ZERO } else { self.answer_delay(slot, start) };
        let (start, end) = (start + delay, end + delay);
        let cycle = self.clocks_begun(clock);
        if self.faults.line.is_idle() {
            return self.transmit_whole(slot, (start, end), cycle, recorder);
        }
        let Some((_, frame)) = self.out.sending() else { return };
        let sent = Sent { sender: self.slots[slot].address, clock, octets: frame.octets() };
        self.faults.line.judge((start, cycle), &sent);
        if self.faults.mutes(sent.sender, (start, cycle)) {
            return;
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
            return;
        }
        let length = end - start;
        self.copy_telegrams(slot, (end + late, length));
        let (frame, broken) = self.faults.line.telegram();
        if late > Span::ZERO {
            let place = self.held.keep(frame, broken, Origin::Sender, length);
            return self.push(start + late, Phase::Send, slot, Event::Held(place));
        }
        let flight = self.bus.send(slot, (start, end), frame, Mark { broken, ..Mark::OWN });
        self.sent_off(slot, flight, recorder);
    }
    /// How much later than usual a station answers.
    fn answer_delay(&mut self, slot: usize, start: Time) -> Span {
        let running = (start, self.clocks_begun(false));
        self.faults.answer_delay(self.slots[slot].address, running)
    }
    /// Puts the telegram in the outbox onto the line as it is, unless something keeps its sender from it.
    fn transmit_whole<R: Recorder>(&mut self, slot: usize, line: (Time, Time), cycle: u64, recorder: &mut R) {
        if !self.faults.mutes(self.slots[slot].address, (line.0, cycle)) {
            let flight = self.bus.send(slot, line, self.out.frame(), Mark::OWN);
            self.sent_off(slot, flight, recorder);
        }
    }
    /// Keeps the copies of a telegram of this length that ends at `end`, as its sender has sent it.
    fn copy_telegrams(&mut self, slot: usize, (end, length): (Time, Span)) {
        for index in 0..self.faults.line.strikes().len() {
            let strike = self.faults.line.strikes()[index];
            if let (Struck::Twice(after), Some((_, frame))) = (strike.what, self.out.sending()) {
                let place = self.held.keep(frame, false, Origin::Disturbance(strike.number), length);
                self.push(end + after, Phase::Send, slot, Event::Held(place));
            }
        }
    }
    /// A telegram that waited leaves now. A station without supply sends nothing, nor does one that is kept from it.
    pub(super) fn release<R: Recorder>(&mut self, slot: usize, place: usize, recorder: &mut R) {
        self.held.free.push(place as u16);
        let running = (self.now, self.clocks_begun(false));
        let Self { held, bus, slots, now, faults, .. } = self;
        let Waiting { frame, broken, origin, length } = &held.telegrams[place];
        let sends = slots[slot].powered && !faults.mutes(slots[slot].address, running);
        if *origin == Origin::Sender && !sends {
            return;
        }
        let flight =
            bus.send(slot, (*now, *now + *length), frame, Mark { origin: *origin, broken: *broken, apart: false });
        self.sent_off(slot, flight, recorder);
    }
}
