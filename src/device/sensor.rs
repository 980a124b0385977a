//! Sensor state machine: G1_STW in, G1_ZSW and the contents of G1_XIST1 and G1_XIST2 out (manual 2.2, 5.3).
//!
//! Once per DP cycle. The columns are checked from left to right; acknowledge and preset act on the rising edge of their
//! bits (manual 2.2), and a fault arises while its cause is reported for this cycle.
//!
//! | state | G1_STW.14 = 1 | G1_STW.15 rises | new fault | G1_STW.12 rises | otherwise |
//! |---|---|---|---|---|---|
//! | Normal (SD1) | Parking | Normal | Error | Preset, request | Normal |
//! | Error (SD3) | Parking | see below | Error, queued | Error | Error |
//! | Acknowledge (SD2) | Parking | Acknowledge | Acknowledge, queued | Acknowledge | see below |
//! | Preset (SD7) | Parking | Preset | Error | - | Normal once G1_STW.12 = 0 |
//! | Parking (SD12) | Parking | as Normal | as Normal, none while parked | as Normal | Normal once G1_STW.14 = 0 |
//!
//! Acknowledge concerns the fault that is shown. If its cause is gone, it is cleared; the next latched one is shown and
//! wants its own acknowledgement (Model: D18). By default (manual 2.2) this happens within the cycle and SD2 is passed
//! only if the cause persists; then, and with the other [`Acknowledgement`]s, SD2 lasts as described there.
//!
//! Model: D18. Parking suppresses errors: entering it clears all latched faults, none is latched during it, and
//! G1_XIST1 and G1_XIST2 read 0. Model: D19. A reserved bit 0 to 10 set is the cause of 0F01 as long as it is set.

use crate::wire::drive::SensorFault;

/// A set of faults.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct Faults(u8);

impl Faults {
    /// No fault.
    pub const NONE: Self = Self(0);

    /// This set and `fault`.
    #[must_use]
    pub const fn with(self, fault: SensorFault) -> Self {
        Self(self.0 | 1 << fault as u8)
    }
    /// Whether `fault` is in the set.
    pub const fn contains(self, fault: SensorFault) -> bool {
        self.0 & 1 << fault as u8 != 0
    }
    /// Whether the set is empty.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
    /// The faults of this set that are not in `other`.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }
    /// The faults in the order of their codes.
    pub fn iter(self) -> impl Iterator<Item = SensorFault> {
        let all = if self.is_empty() { &[] } else { SensorFault::ALL };
        all.iter().copied().filter(move |&fault| self.contains(fault))
    }
}
impl From<SensorFault> for Faults {
    fn from(fault: SensorFault) -> Self {
        Self::NONE.with(fault)
    }
}

/// Bits of G1_STW (manual 2.2).
pub mod stw {
    use crate::wire::drive::G1Stw;

    /// Bits 0 to 10, reserved.
    pub const RESERVED: u16 = !G1Stw::NAMED.0;
    /// Bit 11, home position mode: 0 = set (absolute), 1 = shift (relative).
    pub const RELATIVE: u16 = G1Stw::HOME_MODE.0;
    /// Bit 12, set preset or request shift, on the rising edge.
    pub const PRESET: u16 = G1Stw::PRESET.0;
    /// Bit 13, request the absolute value cyclically.
    pub const VALUE: u16 = G1Stw::ABSOLUTE_VALUE.0;
    /// Bit 14, activate parking sensor.
    pub const PARK: u16 = G1Stw::PARKING.0;
    /// Bit 15, acknowledge a sensor error.
    pub const ACKNOWLEDGE: u16 = G1Stw::ACKNOWLEDGE.0;
}

/// Bits of G1_ZSW (manual 2.2).
pub mod zsw {
    use crate::wire::drive::G1Zsw;

    /// Bit 11, acknowledgement of a sensor error in process.
    pub const ACKNOWLEDGING: u16 = G1Zsw::ACKNOWLEDGING.0;
    /// Bit 12, preset or shift executed.
    pub const PRESET: u16 = G1Zsw::PRESET_DONE.0;
    /// Bit 13, the absolute value is transmitted cyclically.
    pub const VALUE: u16 = G1Zsw::ABSOLUTE_VALUE.0;
    /// Bit 14, parking sensor activated.
    pub const PARKED: u16 = G1Zsw::PARKING.0;
    /// Bit 15, sensor error.
    pub const ERROR: u16 = G1Zsw::ERROR.0;
}

/// How an acknowledgement shows and ends. Makes of encoders differ (Model: D18).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub enum Acknowledgement {
    /// Cleared within the cycle; bit 11 only while the cause persists and G1_STW.15 stays 1 (manual 2.2).
    #[default]
    Immediate,
    /// Bit 11 from the request until the master resets G1_STW.15; meanwhile G1_XIST2 is 0 (PROFIdrive drives).
    UntilReset,
    /// Bit 11 for one cycle, longer only as with `Immediate`; then the encoder clears it itself.
    SelfClearing,
}

/// Bit 15 and G1_XIST2 during an acknowledgement whose cause is gone. Makes of encoders differ (Model: D18).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub enum ErrorBit {
    /// Bit 15 is 1 only while the cause persists.
    #[default]
    WhileCause,
    /// Bit 15 stays 1, and the code stays in G1_XIST2, as long as bit 11.
    WhileAcknowledging,
}

/// Bit 13 while bit 15 is 1. Makes of encoders differ (Model: D18).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub enum ValueBit {
    /// 0: G1_XIST2 does not carry the position (encoders).
    #[default]
    ClearedByError,
    /// Follows G1_STW.13 all the same (drives).
    FollowsRequest,
}

/// Options of the sensor state machine.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct SensorOptions {
    /// How an acknowledgement shows and ends.
    pub acknowledgement: Acknowledgement,
    /// Bit 15 during an acknowledgement.
    pub error_bit: ErrorBit,
    /// Bit 13 during an error.
    pub value_bit: ValueBit,
    /// Whether preset and shift are enabled (manual 3.2.2, octet 15 bit 1); if not, a request for them is 0F01.
    pub preset_enabled: bool,
}

impl Default for SensorOptions {
    fn default() -> Self {
        Self {
            acknowledgement: Acknowledgement::default(),
            error_bit: ErrorBit::default(),
            value_bit: ValueBit::default(),
            preset_enabled: true,
        }
    }
}

/// A requested change of the home position (manual 2.2, G1_STW bits 11 and 12).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Preset {
    /// Set the home position.
    Absolute,
    /// Shift the home position.
    Relative,
}

/// What G1_XIST1 carries.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Xist1 {
    /// 0, parking.
    Zero,
    /// The position, left justified.
    Position,
}

/// What G1_XIST2 carries (manual 2.2).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Xist2 {
    /// 0: parking, or nothing requested.
    Zero,
    /// The position, right justified.
    Position,
    /// An error code, 0F01, 0F02 or 0F04 (manual 5.3).
    Code(u16),
}

/// Answer of the sensor state machine in one DP cycle.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Answer {
    /// G1_ZSW.
    pub zsw: u16,
    /// What G1_XIST1 carries.
    pub xist1: Xist1,
    /// What G1_XIST2 carries.
    pub xist2: Xist2,
    /// The home position is to be changed now.
    pub preset: Option<Preset>,
    /// Faults latched in this cycle.
    pub latched: Faults,
    /// The fault cleared by acknowledgement in this cycle.
    pub cleared: Option<SensorFault>,
}

impl Answer {
    /// What is answered before the first cycle.
    pub const NONE: Self =
        Self { zsw: 0, xist1: Xist1::Position, xist2: Xist2::Zero, preset: None, latched: Faults::NONE, cleared: None };
}

/// Latched faults, each at most once, the first latched in front.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
struct Latch {
    faults: [Option<SensorFault>; SensorFault::ALL.len()],
}

impl Latch {
    fn first(self) -> Option<SensorFault> {
        self.faults[0]
    }
    fn set(self) -> Faults {
        self.faults.into_iter().flatten().fold(Faults::NONE, Faults::with)
    }
    /// Latches what is not latched yet and tells what that was.
    fn add(&mut self, causes: Faults) -> Faults {
        if causes.is_empty() {
            return Faults::NONE;
        }
        let new = causes.without(self.set());
        for fault in new.iter() {
            if let Some(free) = self.faults.iter_mut().find(|place| place.is_none()) {
                *free = Some(fault);
            }
        }
        new
    }
    fn clear_first(&mut self) {
        self.faults[0] = None;
        self.faults.rotate_left(1);
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum State {
    Normal,
    Error,
    Acknowledge {
        /// The fault being acknowledged.
        fault: SensorFault,
        /// Whether its cause is gone and it is cleared.
        cleared: bool,
    },
    Preset,
    Parking,
}

/// States of the sensor, without their data.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum SensorState {
    /// SD1, normal operation.
    Normal,
    /// SD3, an error is shown.
    Error,
    /// SD2, an acknowledgement is in process.
    Acknowledge,
    /// SD7, preset or shift is executed.
    Preset,
    /// SD12, parking.
    Parking,
}

/// The sensor state machine of one encoder.
#[derive(Clone, Debug)]
pub struct Sensor {
    options: SensorOptions,
    state: State,
    latch: Latch,
    /// G1_STW of the previous cycle, for the edges.
    last: u16,
}

/// Input of one cycle, as the states see it.
#[derive(Clone, Copy)]
struct Request {
    stw: u16,
    rising: u16,
    causes: Faults,
}

impl Sensor {
    /// A sensor in normal operation, without faults.
    pub fn new(options: SensorOptions) -> Self {
        Self { options, state: State::Normal, latch: Latch::default(), last: 0 }
    }

    /// One DP cycle: G1_STW, and the faults whose cause is there in this cycle. A fault that is an event (a trip of a
    /// monitor) is reported once; a lasting one in every cycle.
    pub fn cycle(&mut self, stw: u16, causes: Faults) -> Answer {
        let request = self.request(stw, causes);
        self.last = stw;
        let mut answer = Answer {
            zsw: 0,
            xist1: Xist1::Position,
            xist2: Xist2::Zero,
            preset: None,
            latched: Faults::NONE,
            cleared: None,
        };
        self.state = if stw & stw::PARK != 0 {
            self.latch = Latch::default();
            State::Parking
        } else {
            answer.latched = self.latch.add(request.causes);
            match self.state {
                State::Normal | State::Parking => self.normal(request, &mut answer),
                State::Preset => self.preset(request),
                State::Error => self.error(request, &mut answer),
                State::Acknowledge { fault, cleared } => self.acknowledge(fault, cleared, request, &mut answer),
            }
        };
        self.show(stw, answer)
    }

    /// State, without its data.
    pub fn state(&self) -> SensorState {
        match self.state {
            State::Normal => SensorState::Normal,
            State::Error => SensorState::Error,
            State::Acknowledge { .. } => SensorState::Acknowledge,
            State::Preset => SensorState::Preset,
            State::Parking => SensorState::Parking,
        }
    }

    /// Faults latched and not yet cleared.
    pub fn latched(&self) -> Faults {
        self.latch.set()
    }

    fn request(&self, stw: u16, causes: Faults) -> Request {
        let rising = stw & !self.last;
        let unsupported = stw & stw::RESERVED != 0 || (!self.options.preset_enabled && rising & stw::PRESET != 0);
        let causes = if unsupported { causes.with(SensorFault::Unsupported) } else { causes };
        Request { stw, rising, causes }
    }

    fn normal(&self, request: Request, answer: &mut Answer) -> State {
        if self.latch.first().is_some() {
            State::Error
        } else if request.rising & stw::PRESET != 0 {
            let relative = request.stw & stw::RELATIVE != 0;
            answer.preset = Some(if relative { Preset::Relative } else { Preset::Absolute });
            State::Preset
        } else {
            State::Normal
        }
    }

    fn preset(&self, request: Request) -> State {
        match (self.latch.first(), request.stw & stw::PRESET) {
            (Some(_), _) => State::Error,
            (None, 0) => State::Normal,
            (None, _) => State::Preset,
        }
    }

    fn error(&mut self, request: Request, answer: &mut Answer) -> State {
        match self.latch.first() {
            Some(fault) if request.rising & stw::ACKNOWLEDGE != 0 => {
                let gone = self.clear(fault, request, answer);
                if gone && self.options.acknowledgement == Acknowledgement::Immediate {
                    self.rest()
                } else {
                    State::Acknowledge { fault, cleared: gone }
                }
            }
            _ => self.rest(),
        }
    }

    fn acknowledge(&mut self, fault: SensorFault, cleared: bool, request: Request, answer: &mut Answer) -> State {
        let held = request.stw & stw::ACKNOWLEDGE != 0;
        let until_reset = self.options.acknowledgement == Acknowledgement::UntilReset;
        if cleared {
            return if held && until_reset { State::Acknowledge { fault, cleared } } else { self.rest() };
        }
        let gone = self.clear(fault, request, answer);
        match (held, gone) {
            (true, true) if until_reset => State::Acknowledge { fault, cleared: true },
            (true, false) => State::Acknowledge { fault, cleared: false },
            _ => self.rest(),
        }
    }

    /// Clears the fault in front unless its cause is still there, and tells whether it is gone.
    fn clear(&mut self, fault: SensorFault, request: Request, answer: &mut Answer) -> bool {
        let gone = !request.causes.contains(fault);
        if gone {
            self.latch.clear_first();
            answer.cleared = Some(fault);
        }
        gone
    }

    /// Error as long as a fault is latched, else normal.
    fn rest(&self) -> State {
        if self.latch.first().is_some() { State::Error } else { State::Normal }
    }

    /// Fills in G1_ZSW and what the actual values carry.
    fn show(&self, stw: u16, mut answer: Answer) -> Answer {
        let shown = match self.state {
            State::Error => self.latch.first(),
            State::Acknowledge { fault, cleared } => {
                (!cleared || self.options.error_bit == ErrorBit::WhileAcknowledging).then_some(fault)
            }
            State::Normal | State::Preset | State::Parking => None,
        };
        let waits = matches!(self.state, State::Acknowledge { .. })
            && self.options.acknowledgement == Acknowledgement::UntilReset;
        answer.zsw = match self.state {
            State::Parking => zsw::PARKED,
            State::Acknowledge { .. } => zsw::ACKNOWLEDGING,
            State::Preset => zsw::PRESET,
            State::Normal | State::Error => 0,
        };
        if self.state == State::Parking {
            return Answer { xist1: Xist1::Zero, ..answer };
        }
        let requested = stw & stw::VALUE != 0;
        if shown.is_some() {
            answer.zsw |= zsw::ERROR;
        }
        if requested && (shown.is_none() || self.options.value_bit == ValueBit::FollowsRequest) {
            answer.zsw |= zsw::VALUE;
        }
        answer.xist2 = match shown {
            Some(fault) => Xist2::Code(fault.code()),
            None if requested && !waits => Xist2::Position,
            None => Xist2::Zero,
        };
        answer
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    const ACK: u16 = stw::ACKNOWLEDGE;
    const LIFE: Faults = Faults::NONE.with(SensorFault::LifeSign);
    const CLOCK: Faults = Faults::NONE.with(SensorFault::Clock);

    fn sensor(acknowledgement: Acknowledgement) -> Sensor {
        Sensor::new(SensorOptions { acknowledgement, ..SensorOptions::default() })
    }
    /// Runs cycles of (G1_STW, causes) and gives G1_ZSW and G1_XIST2 of each.
    fn run(sensor: &mut Sensor, cycles: &[(u16, Faults)]) -> Vec<(u16, Xist2)> {
        let shown = |&(stw, causes): &(u16, Faults)| {
            let answer = sensor.cycle(stw, causes);
            (answer.zsw, answer.xist2)
        };
        cycles.iter().map(shown).collect()
    }
    fn in_state(state: SensorState) -> Sensor {
        let mut sensor = sensor(Acknowledgement::UntilReset);
        match state {
            SensorState::Normal => sensor.cycle(0, Faults::NONE),
            SensorState::Error => sensor.cycle(0, LIFE),
            SensorState::Acknowledge => {
                sensor.cycle(0, LIFE);
                sensor.cycle(ACK, Faults::NONE)
            }
            SensorState::Preset => sensor.cycle(stw::PRESET, Faults::NONE),
            SensorState::Parking => sensor.cycle(stw::PARK, Faults::NONE),
        };
        assert_eq!(sensor.state(), state);
        sensor
    }

    #[test]
    fn every_state_answers_every_input() {
        use SensorState::{Acknowledge, Error, Normal, Parking, Preset};
        let inputs = [
            (0, Faults::NONE),
            (stw::VALUE, Faults::NONE),
            (stw::PRESET, Faults::NONE),
            (ACK, Faults::NONE),
            (ACK, LIFE),
            (0, CLOCK),
            (1, Faults::NONE),
            (stw::PARK, Faults::NONE),
            (u16::MAX, Faults::NONE),
        ];
        let table = [
            (Normal, [Normal, Normal, Preset, Normal, Error, Error, Error, Parking, Parking]),
            (Error, [Error, Error, Error, Acknowledge, Acknowledge, Error, Error, Parking, Parking]),
            (Acknowledge, [Normal, Normal, Normal, Acknowledge, Acknowledge, Error, Error, Parking, Parking]),
            (Preset, [Normal, Normal, Preset, Normal, Error, Error, Error, Parking, Parking]),
            (Parking, [Normal, Normal, Preset, Normal, Error, Error, Error, Parking, Parking]),
        ];
        for (state, next) in table {
            for ((stw, causes), expected) in inputs.into_iter().zip(next) {
                let mut sensor = in_state(state);
                sensor.cycle(stw, causes);
                assert_eq!(sensor.state(), expected, "{state:?} with G1_STW {stw:04X} and {causes:?}");
            }
        }
    }

    #[test]
    fn the_absolute_value_is_sent_on_request() {
        let shown = run(&mut sensor(Acknowledgement::Immediate), &[(0, Faults::NONE), (stw::VALUE, Faults::NONE)]);
        assert_eq!(shown, [(0, Xist2::Zero), (zsw::VALUE, Xist2::Position)]);
    }

    #[test]
    fn a_fault_stays_until_the_rising_edge_of_the_acknowledgement() {
        let mut sensor = sensor(Acknowledgement::Immediate);
        sensor.cycle(ACK, Faults::NONE);
        let (error, code) = (zsw::ERROR, Xist2::Code(0x0F02));
        assert_eq!(
            run(&mut sensor, &[(ACK, LIFE), (ACK | stw::VALUE, Faults::NONE), (0, Faults::NONE), (ACK, Faults::NONE)]),
            [(error, code), (error, code), (error, code), (0, Xist2::Zero)],
            "latched though the event is over; a bit that is already 1 acknowledges nothing"
        );
    }

    #[test]
    fn faults_are_shown_one_after_the_other() {
        let mut sensor = sensor(Acknowledgement::Immediate);
        assert_eq!(sensor.cycle(0, CLOCK).latched, CLOCK);
        assert_eq!(sensor.cycle(0, LIFE.with(SensorFault::Clock)).latched, LIFE, "0F04 is latched already");
        sensor.cycle(1, Faults::NONE);
        let codes: Vec<_> = (0..3)
            .map(|_| {
                let Xist2::Code(code) = sensor.cycle(0, Faults::NONE).xist2 else { unreachable!() };
                assert_eq!(sensor.cycle(ACK, Faults::NONE).cleared.map(SensorFault::code), Some(code));
                code
            })
            .collect();
        assert_eq!(codes, [0x0F04, 0x0F02, 0x0F01]);
        assert_eq!((sensor.state(), sensor.latched()), (SensorState::Normal, Faults::NONE));
    }

    #[test]
    fn reserved_bits_are_a_command_that_is_not_supported() {
        for bit in 0..16 {
            let answer = sensor(Acknowledgement::Immediate).cycle(1 << bit, Faults::NONE);
            assert_eq!(answer.latched.contains(SensorFault::Unsupported), bit <= 10, "bit {bit}");
        }
        // While they are set the cause is there, and clearing takes longer than a cycle: bit 11 (manual 2.2).
        let mut sensor = sensor(Acknowledgement::Immediate);
        let both = (zsw::ERROR | zsw::ACKNOWLEDGING, Xist2::Code(0x0F01));
        assert_eq!(
            run(&mut sensor, &[(1, Faults::NONE), (ACK | 1, Faults::NONE), (ACK | 1, Faults::NONE)])[1..],
            [both, both]
        );
        assert_eq!(run(&mut sensor.clone(), &[(ACK, Faults::NONE)]), [(0, Xist2::Zero)]);
        assert_eq!(run(&mut sensor, &[(1, Faults::NONE)]), [(zsw::ERROR, Xist2::Code(0x0F01))]);
    }

    #[test]
    fn a_preset_is_requested_once_per_rising_edge() {
        let mut sensor = sensor(Acknowledgement::Immediate);
        let presets: Vec<_> = [0, stw::PRESET, stw::PRESET, stw::RELATIVE, stw::PRESET | stw::RELATIVE]
            .map(|stw| (sensor.cycle(stw, Faults::NONE).preset, sensor.state()))
            .into();
        assert_eq!(
            presets,
            [
                (None, SensorState::Normal),
                (Some(Preset::Absolute), SensorState::Preset),
                (None, SensorState::Preset),
                (None, SensorState::Normal),
                (Some(Preset::Relative), SensorState::Preset),
            ]
        );
        assert_eq!(sensor.cycle(stw::PRESET | stw::VALUE, Faults::NONE).zsw, zsw::PRESET | zsw::VALUE);
        let answer = sensor.cycle(stw::PRESET, LIFE);
        assert_eq!((answer.zsw, answer.preset), (zsw::ERROR, None), "a fault ends it");
        sensor.cycle(stw::PRESET | ACK, Faults::NONE);
        assert_eq!(sensor.state(), SensorState::Normal, "no second preset without a new edge");
    }

    #[test]
    fn a_disabled_preset_is_a_command_that_is_not_supported() {
        let mut sensor = Sensor::new(SensorOptions { preset_enabled: false, ..SensorOptions::default() });
        let answer = sensor.cycle(stw::PRESET, Faults::NONE);
        assert_eq!((answer.preset, answer.xist2), (None, Xist2::Code(0x0F01)));
        assert_eq!(sensor.cycle(stw::PRESET | ACK, Faults::NONE).zsw, 0, "the request was an event");
    }

    #[test]
    fn parking_clears_and_suppresses_errors() {
        let mut sensor = in_state(SensorState::Error);
        for causes in [LIFE, CLOCK, Faults::NONE] {
            let answer = sensor.cycle(stw::PARK | stw::VALUE | stw::PRESET | 1, causes);
            assert_eq!((answer.zsw, answer.xist1, answer.xist2), (zsw::PARKED, Xist1::Zero, Xist2::Zero));
            assert_eq!((answer.preset, answer.latched), (None, Faults::NONE));
        }
        let answer = sensor.cycle(stw::VALUE | stw::PRESET, Faults::NONE);
        assert_eq!((answer.zsw, answer.xist1, answer.xist2), (zsw::VALUE, Xist1::Position, Xist2::Position));
    }

    #[test]
    fn acknowledgements_of_other_makes() {
        let (none, error, bit11) = (Faults::NONE, zsw::ERROR, zsw::ACKNOWLEDGING);
        let code = Xist2::Code(0x0F02);
        let request = [(0, LIFE), (ACK, none), (ACK, none), (0, none)];
        let lasting = [(0, LIFE), (ACK, LIFE), (ACK, none), (ACK, none), (0, none)];
        let given_up = [(0, LIFE), (ACK, LIFE), (0, LIFE), (0, none)];
        let zero = Xist2::Zero;
        for (acknowledgement, cycles, expected) in [
            (Acknowledgement::Immediate, &request[..], &[(error, code), (0, zero), (0, zero), (0, zero)][..]),
            (Acknowledgement::UntilReset, &request, &[(error, code), (bit11, zero), (bit11, zero), (0, zero)]),
            (Acknowledgement::SelfClearing, &request, &[(error, code), (bit11, zero), (0, zero), (0, zero)]),
            (
                Acknowledgement::Immediate,
                &lasting,
                &[(error, code), (error | bit11, code), (0, zero), (0, zero), (0, zero)],
            ),
            (
                Acknowledgement::UntilReset,
                &lasting,
                &[(error, code), (error | bit11, code), (bit11, zero), (bit11, zero), (0, zero)],
            ),
            (
                Acknowledgement::SelfClearing,
                &lasting,
                &[(error, code), (error | bit11, code), (0, zero), (0, zero), (0, zero)],
            ),
            (
                Acknowledgement::UntilReset,
                &given_up,
                &[(error, code), (error | bit11, code), (error, code), (error, code)],
            ),
        ] {
            assert_eq!(run(&mut sensor(acknowledgement), cycles), expected, "{acknowledgement:?}");
        }
    }

    #[test]
    fn bits_13_and_15_of_other_makes() {
        let cycles = [(stw::VALUE, LIFE), (stw::VALUE | ACK, Faults::NONE), (stw::VALUE, Faults::NONE)];
        let zsw = |error_bit, value_bit| {
            let acknowledgement = Acknowledgement::UntilReset;
            let options = SensorOptions { acknowledgement, error_bit, value_bit, ..SensorOptions::default() };
            run(&mut Sensor::new(options), &cycles).into_iter().map(|(zsw, _)| zsw >> 11).collect::<Vec<_>>()
        };
        // Bits 15 to 11.
        assert_eq!(zsw(ErrorBit::WhileCause, ValueBit::ClearedByError), [0b10000, 0b00101, 0b00100]);
        assert_eq!(zsw(ErrorBit::WhileAcknowledging, ValueBit::ClearedByError), [0b10000, 0b10001, 0b00100]);
        assert_eq!(zsw(ErrorBit::WhileCause, ValueBit::FollowsRequest), [0b10100, 0b00101, 0b00100]);
        assert_eq!(zsw(ErrorBit::WhileAcknowledging, ValueBit::FollowsRequest), [0b10100, 0b10101, 0b00100]);
    }
}
