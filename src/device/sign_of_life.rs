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
use crate::wire::drive::SignOfLife;

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
    sign: SignOfLife,
    /// DP cycles this value has been expected, this one included, 1..=hold.
    cycles: u8,
}

impl Expectation {
    fn start(sign: SignOfLife) -> Self {
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
    Waiting { last: Option<SignOfLife> },
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
        expected: SignOfLife,
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
        let received = SignOfLife::masked(received);
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

    fn waiting(&mut self, last: Option<SignOfLife>, received: SignOfLife) -> Step {
        if received.is_valid() && last.is_some_and(|last| last != received) {
            self.failures = 0;
            self.enter(State::Strict { expected: Expectation::start(received), steps: 0 }, Verdict::Start)
        } else {
            self.enter(State::Waiting { last: Some(received) }, Verdict::Unused)
        }
    }

    fn strict(&mut self, expected: Expectation, steps: u8, received: SignOfLife) -> Step {
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

    fn confirming(&mut self, expected: Expectation, cycles: u8, received: SignOfLife) -> Step {
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

    fn operating(&mut self, expected: Expectation, received: SignOfLife) -> Step {
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

    fn give_up(&mut self, expected: Expectation, received: SignOfLife) -> Step {
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
    sign: SignOfLife,
}

impl Counter {
    /// A counter that does not run.
    pub const fn new() -> Self {
        Self { sign: SignOfLife::NONE }
    }
    /// The sign to send in this cycle; once per `T_DP` at the slave, once per `T_MAPC` at the master.
    ///
    /// `running` is [`Monitor::is_synchronised`] after the monitor's cycle: the first running cycle sends 1 (Model:
    /// D16), the cycle in which the monitor trips sends 0 (manual 2.1.3).
    pub fn cycle(&mut self, running: bool) -> SignOfLife {
        self.sign = if running { self.sign.next() } else { SignOfLife::NONE };
        self.sign
    }
    /// The sign sent last.
    pub const fn sign(self) -> SignOfLife {
        self.sign
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;
    use alloc::vec::Vec;

    fn after(sign: u8, steps: usize) -> u8 {
        (0..steps).fold(SignOfLife::masked(sign), |sign, _| sign.next()).get()
    }
    /// The value of an error-free master in DP cycle `k` after its start value 1.
    fn good(k: usize, hold: u8) -> u8 {
        after(1, k / usize::from(hold))
    }
    /// A monitor fed with an error-free master up to and including DP cycle `until` after the start value.
    fn fed(settings: MonitorSettings, until: usize) -> Monitor {
        let mut monitor = Monitor::new(settings);
        monitor.cycle(0);
        (0..=until).for_each(|k| _ = monitor.cycle(good(k, settings.hold)));
        monitor
    }
    /// A monitor in operation with an empty counter whose last accepted value is 5, in the last cycle of its hold time.
    fn operating(hold: u8, tolerance: u16) -> Monitor {
        let monitor = fed(MonitorSettings::new(hold, tolerance), usize::from(hold) * 35 - 1);
        assert_eq!((monitor.state(), good(usize::from(hold) * 35 - 1, hold)), (LifeState::Operating, 5));
        monitor
    }
    fn counters(monitor: &mut Monitor, received: &[u8]) -> Vec<u32> {
        let counter = |&value: &u8| {
            monitor.cycle(value);
            monitor.failures()
        };
        received.iter().map(counter).collect()
    }

    #[test]
    fn the_sign_of_life_counts_from_1_to_15_and_leaves_0_out() {
        let signs: Vec<u8> = (0..17).map(|k| after(0, k)).collect();
        assert_eq!(signs, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 1]);
        assert_eq!(SignOfLife::from_word(0xB7FF).to_word(), 0xB000);
    }

    #[test]
    fn synchronising_takes_16_steps_and_16_cycles() {
        // V13: own sign 1 at cycle 16·n, operation at cycle 16·n + 16.
        for hold in 1..=14 {
            let n = usize::from(hold);
            let (mut monitor, mut own) = (Monitor::new(MonitorSettings::new(hold, 1)), Counter::new());
            monitor.cycle(0);
            for k in 0..400 {
                let step = monitor.cycle(good(k, hold));
                let sign = own.cycle(monitor.is_synchronised()).get();
                let expected = if k < 16 * n { 0 } else { after(1, k - 16 * n) };
                assert_eq!(sign, expected, "n {n} cycle {k}");
                let entered = match k {
                    0 => Some(LifeState::Strict),
                    _ if k == 16 * n => Some(LifeState::Confirming),
                    _ if k == 16 * n + 16 => Some(LifeState::Operating),
                    _ => None,
                };
                assert_eq!(step.entered, entered, "n {n} cycle {k}");
            }
        }
    }

    #[test]
    fn traversal_and_confirmation_are_settings() {
        for (steps, confirmation) in [(15, 16), (1, 1), (16, 0), (255, 255)] {
            let settings = MonitorSettings { steps, confirmation, ..MonitorSettings::new(3, 1) };
            let (traversal, all) = (3 * usize::from(steps), 3 * usize::from(steps) + usize::from(confirmation));
            assert!(!fed(settings, traversal - 1).is_synchronised());
            assert!(fed(settings, traversal).is_synchronised());
            assert_ne!(fed(settings, all - 1).state(), LifeState::Operating);
            assert_eq!(fed(settings, all).state(), LifeState::Operating);
        }
    }

    #[test]
    fn only_a_change_to_a_new_value_starts() {
        let mut monitor = Monitor::new(MonitorSettings::new(1, 1));
        for value in [7, 7, 7, 0, 0] {
            assert_eq!(monitor.cycle(value).verdict, Verdict::Unused, "{value}");
        }
        assert_eq!(monitor.cycle(7).verdict, Verdict::Start);
        monitor.reset();
        assert_eq!(monitor.cycle(8).verdict, Verdict::Unused, "nothing known after a reset");
        assert_eq!(monitor.cycle(9).verdict, Verdict::Start);
    }

    #[test]
    fn table_a_one_stale_value_is_one_failure() {
        let mut monitor = operating(1, 1);
        let received = [6, 6, 8, 9, 10, 11, 12, 13, 14, 15, 1, 2, 3];
        assert_eq!(counters(&mut monitor, &received), [0, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0, 0]);
        assert_eq!(monitor.state(), LifeState::Operating);
    }

    #[test]
    fn table_b_two_stale_values_in_a_row_trip() {
        let (mut monitor, mut own) = (operating(1, 1), Counter::new());
        own.cycle(true);
        assert_eq!(counters(&mut monitor, &[6, 6]), [0, 10]);
        let step = monitor.cycle(6);
        assert!(step.tripped);
        assert_eq!((step.entered, monitor.failures()), (Some(LifeState::Waiting), 20));
        assert_eq!(own.cycle(monitor.is_synchronised()), SignOfLife::NONE, "0 in the cycle of the trip");
        let step = monitor.cycle(9);
        assert_eq!((step.verdict, step.tripped, monitor.failures()), (Verdict::Start, false, 0));
        assert!((10..=15).chain(1..=9).all(|value| monitor.cycle(value).verdict == Verdict::Right));
        assert_eq!(monitor.cycle(10).entered, Some(LifeState::Confirming));
    }

    #[test]
    fn table_e_ten_good_values_repay_a_failure() {
        let mut monitor = operating(1, 1);
        let received = [6, 6, 8, 9, 10, 11, 12, 13, 14, 15, 1, 2, 2, 4];
        assert_eq!(counters(&mut monitor, &received), [0, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0, 10, 9]);
        let mut monitor = operating(1, 1);
        let received = [6, 6, 8, 9, 10, 11, 12, 13, 14, 15, 1, 1];
        assert_eq!(counters(&mut monitor, &received)[11], 11, "nine are one too few");
        assert_eq!(monitor.state(), LifeState::Waiting);
    }

    #[test]
    fn the_failure_counter_is_ten_per_failure_against_ten_per_tolerated_one() {
        // V12: the tolerance is the number of failures back to back that survive.
        for tolerance in [0, 1, 2, 4, 10, 255, 1_000] {
            let mut monitor = operating(1, tolerance);
            for k in 1..=u32::from(tolerance) {
                assert!(!monitor.cycle(0).tripped, "0 is a failure like any other");
                assert_eq!(monitor.failures(), 10 * k);
            }
            assert!(monitor.cycle(0).tripped, "tolerance {tolerance}");
        }
        let mut monitor = operating(1, MonitorSettings::OFF);
        assert!((0..70_000).all(|_| !monitor.cycle(0).tripped), "P925 = 65535 switches the monitoring off");
    }

    #[test]
    fn the_expectation_runs_freely_and_is_never_rebased() {
        // A master that lost a step is wrong from then on.
        let mut monitor = operating(1, 4);
        assert_eq!(counters(&mut monitor, &[6, 7, 9, 10, 11, 12]), [0, 0, 10, 20, 30, 40]);
        assert!(monitor.cycle(13).tripped);
        // A single jump that returns is one failure.
        let mut monitor = operating(1, 1);
        assert_eq!(counters(&mut monitor, &[6, 12, 8, 9]), [0, 10, 9, 8]);
    }

    #[test]
    fn an_error_counts_at_every_position_of_a_held_value() {
        for position in 0..2 {
            let mut monitor = operating(2, 1);
            let mut received = vec![6, 6, 7, 7, 8, 8];
            received[2 + position] = 3;
            let mut expected = vec![0, 0, 0, 0, 0, 0];
            (2 + position..6).zip([10, 9, 8, 7]).for_each(|(k, counter)| expected[k] = counter);
            assert_eq!(counters(&mut monitor, &received), expected, "position {position}");
            // Before operation the same error starts over.
            let mut monitor = fed(MonitorSettings::new(2, 1), 9 + position);
            assert_eq!(monitor.cycle(14).entered, Some(LifeState::Waiting), "position {position}");
        }
    }

    #[test]
    fn every_state_answers_every_input() {
        use LifeState::{Confirming, Operating, Strict, Waiting};
        // Cycles since the start value at n = 2: right value, wrong value, 0, too long a hold, too short a hold, reset.
        let table = [
            (Strict, 11, [Strict, Waiting, Waiting, Waiting, Waiting, Waiting]),
            (Strict, 31, [Confirming, Waiting, Waiting, Waiting, Waiting, Waiting]),
            (Confirming, 39, [Confirming, Waiting, Waiting, Waiting, Waiting, Waiting]),
            (Confirming, 47, [Operating, Waiting, Waiting, Waiting, Waiting, Waiting]),
            (Operating, 49, [Operating, Operating, Operating, Operating, Operating, Waiting]),
        ];
        for (state, cycle, next) in table {
            for (input, expected) in next.into_iter().enumerate() {
                let early = usize::from(input == 4);
                let mut monitor = fed(MonitorSettings::new(2, 1), cycle - early);
                assert_eq!(monitor.state(), state);
                let step = match input {
                    // Too short a hold: the next value although the present one is due once more.
                    0 | 4 => monitor.cycle(good(cycle + 1, 2)),
                    1 => monitor.cycle(after(good(cycle + 1, 2), 1)),
                    2 => monitor.cycle(0),
                    3 => monitor.cycle(good(cycle, 2)),
                    _ => {
                        monitor.reset();
                        continue;
                    }
                };
                assert_eq!(monitor.state(), expected, "{state} after {cycle}, input {input}");
                assert!(!step.tripped, "no fault before operation, none within the tolerance");
                assert_eq!(step.entered, (expected != state).then_some(expected));
            }
        }
    }

    #[test]
    fn a_value_held_for_more_than_14_cycles_never_synchronises() {
        for hold in 1..=14 {
            let mut monitor = Monitor::new(MonitorSettings::new(hold, 1));
            let states: Vec<_> = (0..600)
                .map(|k| {
                    monitor.cycle(after(1, k / 15));
                    monitor.state()
                })
                .collect();
            assert!(states.iter().all(|&state| matches!(state, LifeState::Waiting | LifeState::Strict)), "{hold}");
        }
    }

    /// The same rules decided from the whole history in every cycle: nothing is remembered but what was received.
    struct History {
        received: Vec<u8>,
        hold: usize,
        tolerance: u32,
    }
    #[derive(PartialEq, Debug)]
    struct Seen {
        state: LifeState,
        failures: u32,
        tripped: bool,
    }
    impl History {
        /// Value that must come `age` cycles after the start value `first`: position in the ring of fifteen.
        fn due(&self, first: u8, age: usize) -> u8 {
            ((usize::from(first) - 1 + age / self.hold) % 15) as u8 + 1
        }
        fn decide(&self) -> Seen {
            let (all, mut failures) = (&self.received, 0);
            let mut begin = 1;
            loop {
                let Some(start) = (begin..all.len()).find(|&k| all[k] != 0 && all[k] != all[k - 1]) else {
                    return Seen { state: LifeState::Waiting, failures, tripped: false };
                };
                let wrong = |k: &usize| all[*k] != self.due(all[start], *k - start);
                let strict_until = start + 16 * self.hold + 16;
                let early = (start..all.len().min(strict_until + 1)).find(wrong);
                // Tolerant part: sum with a floor, up to the trip.
                failures = 0;
                let trip = (strict_until + 1..all.len()).filter(|_| early.is_none()).find(|k| {
                    failures = if wrong(k) { failures + 10 } else { u32::saturating_sub(failures, 1) };
                    wrong(k) && failures > 10 * self.tolerance
                });
                let age = all.len() - 1 - start;
                begin = match (early, trip) {
                    (None, Some(k)) if k + 1 == all.len() => {
                        return Seen { state: LifeState::Waiting, failures, tripped: true };
                    }
                    (Some(k), _) | (None, Some(k)) => k + 1,
                    (None, None) => {
                        let state = match age {
                            _ if age < 16 * self.hold => LifeState::Strict,
                            _ if age < 16 * self.hold + 16 => LifeState::Confirming,
                            _ => LifeState::Operating,
                        };
                        return Seen { state, failures, tripped: false };
                    }
                };
            }
        }
    }

    /// A small reproducible source of choices.
    struct Lcg(u64);
    impl Lcg {
        fn below(&mut self, bound: u64) -> u64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 33) % bound
        }
    }

    /// A mostly correct stream: stale values, wrong ones, zeros, lost and doubled cycles, restarts of the master.
    fn stream(random: &mut Lcg, hold: u8, length: usize) -> Vec<u8> {
        let mut received = vec![random.below(16) as u8];
        let (mut sign, mut age) = (SignOfLife::masked(random.below(16) as u8), 0);
        let rate = [15, 60, 400, 5_000][random.below(4) as usize];
        while received.len() < length {
            age += 1;
            if age >= hold {
                (sign, age) = (sign.next(), 0);
            }
            received.push(match random.below(rate) {
                0 => received[received.len() - 1],
                1 => random.below(16) as u8,
                2 => 0,
                3 => {
                    sign = SignOfLife::masked(random.below(16) as u8);
                    sign.get()
                }
                4 => {
                    age += 1;
                    sign.get()
                }
                _ => sign.get(),
            });
        }
        received
    }

    #[test]
    fn the_monitor_agrees_with_a_decision_from_the_whole_history() {
        let mut random = Lcg(20_070_101);
        let mut reached = [0u32; 5];
        for round in 0..2_000_000u32 {
            let hold = if round % 4 == 0 { 1 + random.below(14) as u8 } else { 1 + random.below(3) as u8 };
            let tolerance = random.below(5) as u16;
            let length = 1 + random.below(if round % 50 == 0 { 700 } else { 130 }) as usize;
            let received = stream(&mut random, hold, length);
            let mut monitor = Monitor::new(MonitorSettings::new(hold, tolerance));
            // Compared at a few cycles of each stream and at its end: deciding anew costs the whole history.
            let mut history = History { received: Vec::new(), hold: hold.into(), tolerance: tolerance.into() };
            for (k, &value) in received.iter().enumerate() {
                let step = monitor.cycle(value);
                history.received.push(value);
                if step.tripped || step.entered.is_some() || k + 1 == length || random.below(16) == 0 {
                    let seen = Seen { state: monitor.state(), failures: monitor.failures(), tripped: step.tripped };
                    assert_eq!(history.decide(), seen, "n {hold} tolerance {tolerance} {:?}", history.received);
                    reached[seen.state as usize] += 1;
                    reached[4] += u32::from(seen.tripped);
                }
            }
        }
        assert!(reached.iter().all(|&count| count > 1_000), "{reached:?}");
    }
}
