//! The data link layer: the station contract, bus parameters, the active and the passive station.
//!
//! A station is a value. It is told what happened at which reading of its own crystal and answers with an
//! [`Outbox`]: telegrams to send, deadlines to arm, observations. Nothing else goes in or out, so the same machine
//! runs in the simulator, in a test and in firmware.

pub mod active;
pub mod params;
pub mod passive;
pub mod ring;

use crate::observation::Observation;
use crate::time::{Local, Span};
use crate::wire::{Address, Frame};

/// A machine on the bus.
pub trait Station {
    /// What a scenario may order this station to do.
    type Command: Copy;

    /// The station's own address.
    fn address(&self) -> Address;

    /// Which telegrams this station wants to hear. A step after which these are others says so
    /// ([`Outbox::filter_changed`]).
    fn filter(&self) -> Filter;

    /// Takes `input`, which happened at `now`, and answers into `out`. `out` is empty on entry; `now` never runs
    /// backwards from call to call.
    fn step(&mut self, now: Local, input: Input<'_, Self::Command>, out: &mut Outbox);
}

/// What can happen to a station. Its kind is an octet of its own and not one left over in `C`, so that a step sees at one
/// glance what came.
#[derive(Clone, Copy, Debug)]
#[repr(u8)]
pub enum Input<'a, C> {
    /// The supply came on. The first input of every station.
    PowerOn,
    /// The last bit of a telegram arrived. The octets may be disturbed.
    Telegram(Heard<'a>),
    /// A cycle begins: the last bit of the telegram that asked for it ([`Outbox::send_clock`]) has left this station,
    /// or the instant of [`Outbox::begin_cycle`] came.
    Sent,
    /// An armed deadline came due.
    Deadline {
        /// Which one.
        timer: Timer,
        /// Whether this station's receiver sees characters on the line at this instant.
        busy: bool,
    },
    /// The instant of [`Outbox::sample_at`] came; the shaft was at this raw position (steps).
    Sample(u32),
    /// The scenario orders something.
    Command(C),
}

impl<'a, C> Input<'a, C> {
    /// The same input with its command translated; none where the command has no translation.
    pub fn map_command<D>(self, translate: impl FnOnce(C) -> Option<D>) -> Option<Input<'a, D>> {
        Some(match self {
            Self::PowerOn => Input::PowerOn,
            Self::Telegram(heard) => Input::Telegram(heard),
            Self::Sent => Input::Sent,
            Self::Deadline { timer, busy } => Input::Deadline { timer, busy },
            Self::Sample(raw) => Input::Sample(raw),
            Self::Command(command) => Input::Command(translate(command)?),
        })
    }
}

/// A telegram as it arrived.
#[derive(Clone, Copy, Debug)]
pub struct Heard<'a> {
    /// The characters, start delimiter to end delimiter; none where one of them was broken and the receiver has dropped the
    /// telegram, so that only something on the line was noticed.
    pub octets: &'a [u8],
    /// Raw position of the shaft (steps) at this instant, if the station has asked for it
    /// ([`Outbox::sample_with_telegrams`]); zero otherwise.
    pub sample: u32,
}

/// Which telegrams reach a station's machine. The rest is dropped by its receiver, as the hardware does.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Filter {
    /// Everything, as an active station needs.
    pub all: bool,
    /// Own address, besides broadcasts (127).
    pub own: Address,
    /// Senders whose replies to 127 (slave to slave) are wanted: bit n is address n.
    pub publishers: u128,
}

impl Filter {
    /// Own address and broadcasts by masters.
    pub const fn own(own: Address) -> Self {
        Self { all: false, own, publishers: 0 }
    }
    /// Everything on the line.
    pub const fn all(own: Address) -> Self {
        Self { all: true, own, publishers: 0 }
    }
    /// Whether more passes than what is for this station or, from masters, for everybody.
    pub const fn is_curious(&self) -> bool {
        self.all || self.publishers != 0
    }
    /// Whether a telegram with this route passes; without a route only stations that hear everything get it.
    #[inline]
    pub fn passes(&self, route: Option<Route>) -> bool {
        self.all
            || route.is_some_and(|Route { da, sa, reply }| {
                da == self.own.get() || (da == Route::TO_ALL && (!reply || self.publishers >> sa & 1 == 1))
            })
    }
}

/// The octets of a telegram that decide who takes it, as they are, disturbed or not.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Route {
    /// Destination, 0..=127.
    pub da: u8,
    /// Source, 0..=127.
    pub sa: u8,
    /// Sent without the token: FC bit 6 is 0.
    pub reply: bool,
}

impl Route {
    /// Destination of broadcasts.
    pub const TO_ALL: u8 = Address::BROADCAST.get();

    /// Reads the route. None for SC, the token and what does not begin as a telegram: only active stations care.
    #[inline]
    pub fn of(octets: &[u8]) -> Option<Self> {
        // Destination, source and FC sit at 4 behind SD2 and at 1 behind SD1 and SD3.
        match *octets {
            [0x68, _, _, _, da, sa, fc, ..] => Some(Self::read([da, sa, fc])),
            _ => Self::of_short(octets),
        }
    }
    #[cold]
    fn of_short(octets: &[u8]) -> Option<Self> {
        match *octets {
            [0x10 | 0xA2, da, sa, fc, ..] => Some(Self::read([da, sa, fc])),
            _ => None,
        }
    }
    #[inline]
    const fn read([da, sa, fc]: [u8; 3]) -> Self {
        // Bit 7 announces a SAP.
        Self { da: da & 0x7F, sa: sa & 0x7F, reply: fc & 0x40 == 0 }
    }
}

/// Named deadlines of a station. Each is armed at most once at a time.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
#[repr(u8)]
pub enum Timer {
    /// Slot time T_SL, and the silence T_TO before a token is claimed.
    Slot,
    /// The next thing the active station has planned.
    Schedule,
    /// The DP watchdog (`EN 50170-2`).
    Watchdog,
    /// The clock's window closes.
    Window,
    /// T_O.
    SetPoint,
    /// The LEDs may change because nothing was heard.
    Leds,
    /// A slave-to-slave link may be lost (Model: D27).
    Links,
    /// The supervision of an MS2 connection strikes; the earliest of all.
    Connection,
}

impl Timer {
    /// Every timer, in the order of their numbers.
    pub const ALL: [Self; 8] = [
        Self::Slot,
        Self::Schedule,
        Self::Watchdog,
        Self::Window,
        Self::SetPoint,
        Self::Leds,
        Self::Links,
        Self::Connection,
    ];
}

/// A station's answer to one input. Reused from step to step, so that no step allocates.
#[derive(Clone, Debug)]
pub struct Outbox {
    frame: Frame,
    send: Option<Send>,
    /// When the deadlines come, never at all with [`OFF`](Self::OFF); an entry counts if its bit in `ordered` is set.
    orders: [Local; Self::PLACES],
    ordered: u32,
    cycle_at: Option<Local>,
    sample_with_telegrams: Option<bool>,
    filter_changed: bool,
    /// Any of the three before is set.
    unusual: bool,
    /// Those behind the first `observed` are of earlier steps.
    observations: [Observation; Self::MAX_OBSERVATIONS],
    observed: u32,
}

/// When a telegram is to be sent.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Send {
    /// First bit on the line.
    pub at: Local,
    /// The clock telegram: the master's jitter applies to it, and [`Input::Sent`] follows its last bit.
    pub clock: bool,
}

/// What is to become of a deadline.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Order {
    /// Arm it, whatever it was.
    At(Local),
    /// Disarm it.
    Off,
}

impl Default for Outbox {
    fn default() -> Self {
        Self::new()
    }
}

impl Outbox {
    /// Observations that one step may make: a few for each of 126 stations, as when a master with so many slaves is
    /// switched on again. A step that needs more is a bug.
    pub const MAX_OBSERVATIONS: usize = 512;
    /// Deadlines of a station: the timers by their numbers, and behind them the asked sample.
    pub const DEADLINES: usize = Self::SAMPLE + 1;
    /// Number of the asked sample among the deadlines.
    pub const SAMPLE: usize = Timer::ALL.len();
    /// Places for orders: a power of two, so that every number taken modulo it has one.
    const PLACES: usize = Self::DEADLINES.next_power_of_two();
    /// An instant that no clock reaches: the order to disarm.
    const OFF: Local = Local::MAX;

    /// An empty outbox.
    pub const fn new() -> Self {
        Self {
            frame: Frame::new(),
            send: None,
            orders: [Self::OFF; Self::PLACES],
            ordered: 0,
            cycle_at: None,
            sample_with_telegrams: None,
            filter_changed: false,
            unusual: false,
            observations: [Observation::OrderLost; Self::MAX_OBSERVATIONS],
            observed: 0,
        }
    }

    /// Makes it empty for the next step.
    pub fn clear(&mut self) {
        self.send = None;
        self.ordered = 0;
        self.observed = 0;
        if self.unusual {
            (self.cycle_at, self.sample_with_telegrams) = (None, None);
            (self.filter_changed, self.unusual) = (false, false);
        }
    }

    /// Sends the telegram that `fill` writes, its first bit at `at`. One telegram per step.
    ///
    /// # Panics
    /// When this step has sent one already.
    pub fn send(&mut self, at: Local, fill: impl FnOnce(&mut Frame)) {
        assert!(self.send.is_none(), "a step sends one telegram at most");
        fill(&mut self.frame);
        self.send = Some(Send { at, clock: false });
    }

    /// As [`send`](Self::send), for the clock telegram: [`Input::Sent`] comes when its last bit has left.
    pub fn send_clock(&mut self, at: Local, fill: impl FnOnce(&mut Frame)) {
        self.send(at, fill);
        self.send = Some(Send { at, clock: true });
    }

    /// A cycle without clock telegram begins at `at`: [`Input::Sent`] comes then.
    pub fn begin_cycle(&mut self, at: Local) {
        (self.cycle_at, self.unusual) = (Some(at), true);
    }

    /// Arms `timer`; an earlier arming is forgotten.
    pub fn arm(&mut self, timer: Timer, at: Local) {
        self.order(timer as usize, at);
    }
    /// Disarms `timer`.
    pub fn disarm(&mut self, timer: Timer) {
        self.order(timer as usize, Self::OFF);
    }
    fn order(&mut self, which: usize, at: Local) {
        self.orders[which] = at;
        self.ordered |= 1 << which;
    }
    /// Asks for the raw position of the shaft at `at`; [`Input::Sample`] brings it. One at a time.
    pub fn sample_at(&mut self, at: Local) {
        self.order(Self::SAMPLE, at);
    }
    /// Forgets an asked sample.
    pub fn cancel_sample(&mut self) {
        self.order(Self::SAMPLE, Self::OFF);
    }
    /// From now on every telegram brings the shaft's raw position along, or no more (Model: D8).
    pub fn sample_with_telegrams(&mut self, on: bool) {
        (self.sample_with_telegrams, self.unusual) = (Some(on), true);
    }
    /// [`Station::filter`] may say something else from now on.
    pub fn filter_changed(&mut self) {
        (self.filter_changed, self.unusual) = (true, true);
    }
    /// Tells what was seen or done.
    pub fn observe(&mut self, observation: Observation) {
        self.observations[self.observed as usize] = observation;
        self.observed += 1;
    }

    /// The telegram to send, if there is one.
    pub fn sending(&self) -> Option<(Send, &Frame)> {
        self.send.map(|send| (send, &self.frame))
    }
    /// The octets of the telegram to send, or of one sent before.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }
    /// When a cycle without clock telegram begins, if one does.
    pub fn beginning_cycle(&self) -> Option<Local> {
        self.cycle_at
    }
    /// What becomes of the deadlines: their numbers, ascending, with the order for each. The others stay as they are.
    pub fn orders(&self) -> impl Iterator<Item = (usize, Order)> {
        let mut left = self.ordered;
        core::iter::from_fn(move || {
            if left == 0 {
                return None;
            }
            let which = left.trailing_zeros() as usize;
            left &= left - 1;
            let at = self.orders[which % Self::PLACES];
            Some((which, if at == Self::OFF { Order::Off } else { Order::At(at) }))
        })
    }
    /// Whether a cycle begins, or the shaft's position or other telegrams are wanted than before: what steps seldom say.
    #[inline]
    pub fn is_unusual(&self) -> bool {
        self.unusual
    }
    /// Whether telegrams shall bring the shaft's position, where that changed.
    pub fn sampling_with_telegrams(&self) -> Option<bool> {
        self.sample_with_telegrams
    }
    /// Whether the station may want other telegrams than before.
    pub fn has_filter_changed(&self) -> bool {
        self.filter_changed
    }
    /// What was observed, in order.
    pub fn observations(&self) -> impl Iterator<Item = &Observation> {
        self.observations[..self.observed as usize].iter()
    }
}

/// The span after which a receiver takes a running telegram for broken: it never waits longer for its end.
pub const fn longest_telegram(rate: crate::time::BitRate) -> Span {
    rate.octets(crate::wire::MAX_FRAME)
}
