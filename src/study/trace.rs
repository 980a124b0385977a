//! Trace: a stretch of a run line by line, as a bus analyser shows it: when, how long, who to whom, what in the field's
//! words, the octets; between the telegrams what stations saw and did.

use std::fmt::Write as _;

use super::flight::stretch::{Entry, Stretch, What};
use super::flight::{Recorded, Recording};
use crate::sim::record::Origin;
use crate::time::{Span, Time};
use crate::wire::words::Words;
use crate::wire::{FrameControl, Service, Telegram};

/// Cycles before and after a trigger in the command line that tells more of it.
pub const WINDOW: u64 = 5;

/// Tells the cycles of a stretch.
#[derive(Clone, Copy, Debug)]
pub struct Trace<'a> {
    stretch: &'a Stretch,
    network: &'a Recorded,
}

impl<'a> Trace<'a> {
    /// The trace of `stretch` in `network`.
    pub const fn new(stretch: &'a Stretch, network: &'a Recorded) -> Self {
        Self { stretch, network }
    }

    /// Adds every cycle to `text`.
    pub fn tell(&self, text: &mut String) {
        // Names the answers.
        let mut asked = None;
        for (cycle, entries) in self.stretch.by_cycle() {
            // A String takes everything.
            let _ = writeln!(text, "\ncycle {}, t0 at {:.9} s", cycle.number, cycle.t0.since_zero().as_s());
            let _ = writeln!(text, "{:>12} {:>9} {:>6} {:>4}    {:<4} what", "us", "tbit", "bits", "from", "to");
            for entry in entries {
                let from = entry.at - cycle.t0;
                let _ = write!(text, "{:>12.3} {:>9} ", from.as_us(), self.bits(from));
                match entry.what {
                    What::Telegram { end, origin, .. } => self.telegram(text, entry, (end, origin), &mut asked),
                    What::Seen(what) => {
                        let _ = write!(text, "{:>6} {:>4}         {what}", "", entry.station);
                        self.trigger(text, entry);
                    }
                }
                text.push('\n');
            }
        }
        if self.stretch.left_out > 0 {
            let _ = writeln!(text, "\n{} older lines are left out", self.stretch.left_out);
        }
    }

    fn telegram(&self, text: &mut String, entry: &Entry, (end, origin): (Time, Origin), asked: &mut Option<Service>) {
        let octets = self.stretch.octets(entry);
        let parsed = Telegram::parse(octets);
        let answered = *asked;
        let to = match &parsed {
            Ok(Telegram::Data { header, .. }) => {
                if let FrameControl::Request { service, .. } = header.fc {
                    *asked = Some(service);
                }
                header.da.to_string()
            }
            Ok(Telegram::Token { da, .. }) => da.to_string(),
            Ok(Telegram::ShortAck) | Err(_) => String::new(),
        };
        let arrow = if to.is_empty() { "  " } else { "->" };
        let _ = write!(text, "{:>6} {:>4} {arrow} {to:<4} ", self.bits(end - entry.at), entry.station);
        let _ = match parsed {
            Ok(telegram) => write!(text, "{}", Words::answering(telegram, answered)),
            Err(error) => write!(text, "unreadable: {error}"),
        };
        if let Some(name) = self.network.culprit(origin) {
            let _ = write!(text, " (put there by disturbance {name})");
        }
        text.push_str(" |");
        for octet in octets {
            let _ = write!(text, " {octet:02X}");
        }
    }
    /// Marks what the stretch was kept for.
    fn trigger(&self, text: &mut String, entry: &Entry) {
        let mut triggers = self.stretch.triggers.iter();
        let fired = triggers.find(|fired| {
            (fired.at, fired.station) == (entry.at, entry.station) && What::Seen(fired.what) == entry.what
        });
        if let Some(fired) = fired {
            let _ = write!(text, "   <== trigger {}", fired.trigger);
        }
    }
    /// Whole bits in `span`, half of one or more counting as one.
    fn bits(&self, span: Span) -> i64 {
        let bit = self.network.rate.bit();
        (span * 2 + bit).div_floor(bit * 2)
    }
}

/// Everything that the flight recorder kept.
pub fn flight(recording: &Recording) -> String {
    let network = &recording.network;
    let mut text = format!(
        "{}, seed {}, flight recorder: {}\n\
         us and tbit count from the start of each cycle (t0) to the first bit at the sender, t0 from power-on (true time)\n",
        network.scenario,
        network.seed,
        recording.line()
    );
    for (index, stretch) in recording.stretches.iter().enumerate() {
        let (first, last) = stretch.numbers();
        let (begin, end) = (stretch.begin().since_zero().as_s(), stretch.end.since_zero().as_s());
        let number = index + 1;
        let _ = writeln!(text, "\n==== stretch {number}: cycles {first} to {last}, {begin:.9} s to {end:.9} s");
        for fired in stretch.triggers.iter().take(SHOWN) {
            let _ = writeln!(text, "     {fired}, in cycle {} at {:.9} s", fired.cycle, fired.at.since_zero().as_s());
        }
        if let Some(more) = stretch.triggers.len().checked_sub(SHOWN).filter(|&more| more > 0) {
            let _ = writeln!(text, "     and {more} more");
        }
        if let Some(fired) = stretch.triggers.first() {
            let _ = writeln!(text, "     {}", network.invocation.replay(network.seed, fired.cycle, WINDOW));
        }
        Trace::new(stretch, network).tell(&mut text);
    }
    text
}

/// Triggers of a stretch that its heading names.
const SHOWN: usize = 8;
