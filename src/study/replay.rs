//! Replay: a stretch of a run once more, with everything that happened in it told line by line.
//!
//! A run is the same every time, so that nothing has to be kept for this: the scenario is run again from its start, and
//! what lies in the wanted cycles is written down. The lines are those of a bus analyser: when, how long, who to whom,
//! what in the field's words, the octets; between them what stations saw and did.

use std::fmt::Write as _;

use super::build;
use super::run::until;
use super::scenario::Scenario;
use crate::device::node::Node;
use crate::observation::Observation;
use crate::sim::network::{Network, NetworkEvent};
use crate::sim::queue::Queue;
use crate::sim::record::{Recorder, Stamp, Transmission};
use crate::time::{BitRate, Span, Time};
use crate::wire::words::Words;
use crate::wire::{Address, FrameControl, Sap, Service, Telegram};

/// Control_Command and Group_Select of SYNCH (Model: D5).
const SYNCH: [u8; 2] = [0x00, 0x80];

/// The cycles that are told.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Window {
    /// The first.
    pub first: u64,
    /// The last.
    pub last: u64,
}

impl Window {
    /// `cycle` and `around` cycles before and after it.
    pub const fn around(cycle: u64, around: u64) -> Self {
        Self { first: cycle.saturating_sub(around), last: cycle.saturating_add(around) }
    }
}

/// Why there is nothing to tell.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ReplayError {
    /// The run is over before.
    #[error("cycle {wanted} is not in this run, whose last cycle is {last}")]
    NoSuchCycle {
        /// The cycle asked for.
        wanted: u64,
        /// The last one of the run.
        last: u64,
    },
    /// No cycle ever began.
    #[error("no cycle begins in this run")]
    NoCycle,
}

/// Runs `scenario` and tells the cycles of `window`, as far as the run has them.
///
/// # Errors
/// The run has not even the first of them.
pub fn replay<Q: Queue<NetworkEvent>>(scenario: &Scenario, window: Window) -> Result<String, ReplayError> {
    let mut network: Network<Node, Q> = build::network(scenario);
    let mut trace = Trace::new(scenario, window);
    let end = until(scenario);
    while trace.end.is_none() && !network.run(end, STRIDE, &mut trace) {}
    match (trace.cycles.is_empty(), trace.cycle) {
        (false, _) => Ok(trace.text(scenario)),
        (true, Some(last)) => Err(ReplayError::NoSuchCycle { wanted: window.first, last }),
        (true, None) => Err(ReplayError::NoCycle),
    }
}

/// Events between two looks whether the window is over.
const STRIDE: u64 = 1_000;

/// A cycle of the window.
#[derive(Clone, Copy, Debug)]
struct Cycle {
    number: u64,
    /// First bit of its SYNCH, or t0 without one.
    begin: Time,
    t0: Time,
}

/// One line.
#[derive(Clone, Debug)]
struct Line {
    at: Time,
    text: String,
}

/// Keeps what happens in the window.
struct Trace {
    window: Window,
    master: Address,
    rate: BitRate,
    /// Number of the running cycle; none before the first.
    cycle: Option<u64>,
    cycles: Vec<Cycle>,
    /// First bit of the SYNCH that no cycle has begun with yet.
    synch: Option<Time>,
    /// Where the window ends, once it is over.
    end: Option<Time>,
    /// The latest request on the line, for naming its answer.
    asked: Option<Service>,
    lines: Vec<Line>,
}

impl Trace {
    fn new(scenario: &Scenario, window: Window) -> Self {
        Self {
            window,
            master: scenario.master.address,
            rate: scenario.bus.params.rate,
            cycle: None,
            cycles: Vec::new(),
            synch: None,
            end: None,
            asked: None,
            lines: Vec::new(),
        }
    }
    /// Whether something of now may be in the window: a cycle's SYNCH is sent in the one before.
    fn is_near(&self) -> bool {
        let coming = self.cycle.map_or(0, |cycle| cycle + 1);
        coming >= self.window.first && self.end.is_none()
    }
    fn begin(&mut self, number: u64, t0: Time) {
        let begin = self.synch.take().unwrap_or(t0);
        self.cycle = Some(number);
        if number > self.window.last {
            self.end.get_or_insert(begin);
        } else if number >= self.window.first {
            self.cycles.push(Cycle { number, begin, t0 });
        }
    }
    /// Whole bits in `span`, half of one or more counting as one.
    fn bits(&self, span: Span) -> i64 {
        (span * 2 + self.rate.bit()).div_floor(self.rate.bit() * 2)
    }

    /// The window line by line.
    fn text(mut self, scenario: &Scenario) -> String {
        self.lines.sort_by_key(|line| line.at);
        let numbers = [self.cycles.first(), self.cycles.last()].map(|cycle| cycle.map_or(0, |cycle| cycle.number));
        let mut text = format!(
            "{}, seed {}, cycles {} to {}; instants from the start of each cycle (t0), at the sender\n",
            scenario.name, scenario.run.seed, numbers[0], numbers[1]
        );
        for (at, cycle) in self.cycles.iter().enumerate() {
            let _ = writeln!(text, "\ncycle {}, t0 at {:.9} s", cycle.number, cycle.t0.since_zero().as_s());
            let _ = writeln!(text, "{:>12} {:>9} {:>6} {:>4}    {:<4} what", "us", "tbit", "bits", "from", "to");
            let next = self.cycles.get(at + 1).map(|next| next.begin).or(self.end).unwrap_or(Time::MAX);
            for line in self.lines.iter().filter(|line| (cycle.begin..next).contains(&line.at)) {
                let from = line.at - cycle.t0;
                let _ = writeln!(text, "{:>12.3} {:>9} {}", from.as_us(), self.bits(from), line.text);
            }
        }
        text
    }
}

impl Recorder for Trace {
    fn telegram(&mut self, telegram: &Transmission<'_>) {
        let parsed = Telegram::parse(telegram.octets);
        let answered = self.asked;
        let mut to = String::new();
        match &parsed {
            Ok(Telegram::Data { header, du }) => {
                to = header.da.to_string();
                if let FrameControl::Request { service, .. } = header.fc {
                    self.asked = Some(service);
                }
                if telegram.sender == self.master && header.dsap == Some(Sap::GLOBAL_CONTROL) && *du == SYNCH {
                    self.synch = Some(telegram.start);
                }
            }
            Ok(Telegram::Token { da, .. }) => to = da.to_string(),
            Ok(Telegram::ShortAck) | Err(_) => {}
        }
        if self.is_near() {
            let what = match parsed {
                Ok(telegram) => Words::answering(telegram, answered).to_string(),
                Err(error) => format!("unreadable: {error}"),
            };
            let (bits, arrow) = (self.bits(telegram.end - telegram.start), if to.is_empty() { "  " } else { "->" });
            let mut text = format!("{bits:>6} {:>4} {arrow} {to:<4} {what} |", telegram.sender);
            for octet in telegram.octets {
                let _ = write!(text, " {octet:02X}");
            }
            self.lines.push(Line { at: telegram.start, text });
        }
    }

    fn observe(&mut self, stamp: Stamp<'_>, what: &Observation) {
        if let &Observation::CycleStart { cycle, .. } = what
            && stamp.station == self.master
        {
            self.begin(cycle, stamp.at);
        }
        if self.is_near() {
            self.lines.push(Line { at: stamp.at, text: format!("{:>6} {:>4}         {what}", "", stamp.station) });
        }
    }
}
