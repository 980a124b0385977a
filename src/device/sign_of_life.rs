//! Sign of life: the four-bit counters by which the two applications watch each other (manual 2.1.3, 2.1.4, 2.2).
//!
//! The monitor expects the other side's value to grow by one every `hold` DP cycles and to stay constant in between.
//! It compares in every DP cycle. Model: D16.
//!
//! | state | expected value | any other value |
//! |---|---|---|
//! | Waiting | - | change to a new value 1..=15: Strict, failure counter cleared (2.1.3) |
//! | Strict (phase 3) | Strict; the sixteenth step: Confirming (2.1.3) | Waiting |
//! | Confirming (phase 4) | Confirming; after sixteen cycles: Operating (2.1.4) | Waiting |
//! | Operating (phase 5) | failure counter −1 (2.1.5) | failure counter +10; above 10·tolerance: Waiting, fault 0F02 (5.3) |
//!
//! `reset` leads from every state to Waiting (loss of the clock, Model: D15). While Waiting a constant value, the value 0
//! and the very first value after `new` or `reset` start nothing: a start is a change that was seen, so the hold time
//! counts from its first cycle. The value that ends a strict phase or trips the monitor does not start the next attempt.
//!
//! In operation the expectation runs freely: after an error it goes on from the value that was expected, and the received
//! one is forgotten. 0 is a wrong value like any other.

use crate::observation::LifeState;

/// A sign of life: 1..=15 in turn, 0 = invalid or not running (manual 2.2; bits 12-15 of STW2 and ZSW2).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Debug)]
pub struct LifeSign(u8);

impl LifeSign {
    /// Not running.
    pub const INVALID: Self = Self(0);

    /// The sign in the low four bits of `value`.
    pub const fn new(value: u8) -> Self {
        Self(value & 0x0F)
    }
    /// The sign in bits 12-15 of STW2 or ZSW2 (manual 2.2).
    pub const fn from_word(word: u16) -> Self {
        Self((word >> 12) as u8)
    }
    /// STW2 or ZSW2 with this sign in bits 12-15, the unused bits 0 (manual 2.2).
    pub const fn to_word(self) -> u16 {
        (self.0 as u16) << 12
    }
    /// Value, 0..=15.
    pub const fn value(self) -> u8 {
        self.0
    }
    /// Whether the value is 1..=15.
    pub const fn is_valid(self) -> bool {
        self.0 != 0
    }
    /// The following value: 0 to 1, 1 to 2, … 15 to 1 (manual 2.2: 0 is left out).
    #[must_use]
    pub const fn next(self) -> Self {
        Self(if self.0 == 15 { 1 } else { self.0 + 1 })
    }
}

/// Failure counter: what one wrong value adds (Model: D16).
const FAILURE_WEIGHT: u32 = 10;

/// Settings of the sign-of-life monitor.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct MonitorSettings {
    /// DP cycles per value of the other side: `T_MAPC`/`T_DP`, 1..=14. Manual 3.3.3, octet 43.
    pub hold: u8,
    /// Failures accepted without history, 0..=65534; [`MonitorSettings::OFF`] = never trips. Manual 3.2.5, octet 24.
    pub tolerance: u16,
    /// Correct steps that synchronise (phase 3), 1..=255. Model: D16, default 16.
    pub steps: u8,
    /// Further correct DP cycles until operation (phase 4), 0..=255. Model: D16, default 16.
    pub confirmation: u8,
}

impl MonitorSettings {
    /// Tolerance with which the monitor counts but never trips (Model: as P925 = 65535).
    pub const OFF: u16 = u16::MAX;

    /// Settings with phases 3 and 4 of the default length.
    pub const fn new(hold: u8, tolerance: u16) -> Self {
        Self { hold, tolerance, steps: 16, confirmation: 16 }
    }
}

/// What a value must be, running freely from the start value.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Expectation {
    sign: LifeSign,
    /// DP cycles this value has been expected, this one included, 1..=hold.
    cycles: u8,
}

impl Expectation {
    fn start(sign: LifeSign) -> Self {
        Self { sign, cycles: 1 }
    }
    fn next(self, hold: u8) -> Self {
        if self.cycles < hold { Self { cycles: self.cycles + 1, ..self } } else { Self::start(self.sign.next()) }
    }
    /// Whether this is the first cycle of its value.
    fn is_step(self) -> bool {
        self.cycles == 1
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum State {
    Waiting { last: Option<LifeSign> },
    Strict { expected: Expectation, steps: u8 },
    Confirming { expected: Expectation, cycles: u8 },
    Operating { expected: Expectation },
}

/// What a received value was.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Verdict {
    /// Waiting, and nothing to start with.
    Unused,
    /// A new value other than 0: synchronisation begins, the failure counter is cleared.
    Start,
    /// As expected.
    Right,
    /// Not as expected.
    Wrong {
        /// The value that was expected.
        expected: LifeSign,
    },
}

/// Answer to the value of one DP cycle.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Step {
    /// What the value was.
    pub verdict: Verdict,
    /// The state entered with this value, if it is another one.
    pub entered: Option<LifeState>,
    /// More failures than tolerated in operation: fault 0F02 (manual 5.3).
    pub tripped: bool,
}

/// Monitor of the other side's sign of life.
#[derive(Clone, Debug)]
pub struct Monitor {
    settings: MonitorSettings,
    state: State,
    failures: u32,
}

impl Monitor {
    /// A monitor that waits for a start value.
    ///
    /// # Panics
    /// If `hold` is not 1..=14 or `steps` is 0: the caller checks parameters.
    pub fn new(settings: MonitorSettings) -> Self {
        assert!((1..=14).contains(&settings.hold), "T_MAPC is 1 to 14 times T_DP");
        assert!(settings.steps > 0, "synchronising takes at least one step");
        Self { settings, state: State::Waiting { last: None }, failures: 0 }
    }

    /// Starts over: the clock was lost (Model: D15). The failure counter stays until the next start value.
    pub fn reset(&mut self) {
        self.state = State::Waiting { last: None };
    }

    /// The value received in this DP cycle, in the low four bits; once per DP cycle while the clock is locked.
    pub fn cycle(&mut self, received: u8) -> Step {
        let received = LifeSign::new(received);
        match self.state {
            State::Waiting { last } => self.waiting(last, received),
            State::Strict { expected, steps } => self.strict(expected.next(self.settings.hold), steps, received),
            State::Confirming { expected, cycles } => {
                self.confirming(expected.next(self.settings.hold), cycles, received)
            }
            State::Operating { expected } => self.operating(expected.next(self.settings.hold), received),
        }
    }

    /// State, without its data.
    pub fn state(&self) -> LifeState {
        match self.state {
            State::Waiting { .. } => LifeState::Waiting,
            State::Strict { .. } => LifeState::Strict,
            State::Confirming { .. } => LifeState::Confirming,
            State::Operating { .. } => LifeState::Operating,
        }
    }

    /// Whether the own sign of life runs: phase 3 is complete (manual 2.1.4).
    pub fn is_synchronised(&self) -> bool {
        matches!(self.state, State::Confirming { .. } | State::Operating { .. })
    }

    /// Failure counter, +10 per wrong value, −1 per right one. After a trip it keeps its value until the next start value.
    pub fn failures(&self) -> u32 {
        self.failures
    }

    /// Settings this monitor was made with.
    pub fn settings(&self) -> &MonitorSettings {
        &self.settings
    }

    fn waiting(&mut self, last: Option<LifeSign>, received: LifeSign) -> Step {
        if received.is_valid() && last.is_some_and(|last| last != received) {
            self.failures = 0;
            self.enter(State::Strict { expected: Expectation::start(received), steps: 0 }, Verdict::Start)
        } else {
            self.enter(State::Waiting { last: Some(received) }, Verdict::Unused)
        }
    }

    fn strict(&mut self, expected: Expectation, steps: u8, received: LifeSign) -> Step {
        if received != expected.sign {
            return self.give_up(expected, received);
        }
        let steps = steps + u8::from(expected.is_step());
        let next = if steps < self.settings.steps {
            State::Strict { expected, steps }
        } else if self.settings.confirmation > 0 {
            State::Confirming { expected, cycles: 0 }
        } else {
            State::Operating { expected }
        };
        self.enter(next, Verdict::Right)
    }

    fn confirming(&mut self, expected: Expectation, cycles: u8, received: LifeSign) -> Step {
        if received != expected.sign {
            return self.give_up(expected, received);
        }
        let cycles = cycles + 1;
        let next = if cycles < self.settings.confirmation {
            State::Confirming { expected, cycles }
        } else {
            State::Operating { expected }
        };
        self.enter(next, Verdict::Right)
    }

    fn operating(&mut self, expected: Expectation, received: LifeSign) -> Step {
        if received == expected.sign {
            self.failures = self.failures.saturating_sub(1);
            return self.enter(State::Operating { expected }, Verdict::Right);
        }
        self.failures = self.failures.saturating_add(FAILURE_WEIGHT);
        let tolerance = self.settings.tolerance;
        if tolerance != MonitorSettings::OFF && self.failures > FAILURE_WEIGHT * u32::from(tolerance) {
            Step { tripped: true, ..self.give_up(expected, received) }
        } else {
            self.enter(State::Operating { expected }, Verdict::Wrong { expected: expected.sign })
        }
    }

    fn give_up(&mut self, expected: Expectation, received: LifeSign) -> Step {
        self.enter(State::Waiting { last: Some(received) }, Verdict::Wrong { expected: expected.sign })
    }

    /// Stores a state and names it if it is another one.
    fn enter(&mut self, next: State, verdict: Verdict) -> Step {
        let before = self.state();
        self.state = next;
        let now = self.state();
        Step { verdict, entered: (now != before).then_some(now), tripped: false }
    }
}

/// The own sign of life (manual 2.1.4): 0 while it does not run, then 1 and one more in every cycle.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Counter {
    sign: LifeSign,
}

impl Counter {
    /// A counter that does not run.
    pub const fn new() -> Self {
        Self { sign: LifeSign::INVALID }
    }
    /// The sign to send in this cycle; once per `T_DP` at the slave, once per `T_MAPC` at the master.
    ///
    /// `running` is [`Monitor::is_synchronised`] after the monitor's cycle: the first running cycle sends 1 (Model:
    /// D16), the cycle in which the monitor trips sends 0 (manual 2.1.3).
    pub fn cycle(&mut self, running: bool) -> LifeSign {
        self.sign = if running { self.sign.next() } else { LifeSign::INVALID };
        self.sign
    }
    /// The sign sent last.
    pub const fn sign(self) -> LifeSign {
        self.sign
    }
}
