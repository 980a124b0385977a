//! The two LEDs in the connection cap (manual 5.2).
//!
//! | No. | red | green | shown |
//! |---|---|---|---|
//! | 1 | dark | dark | without supply |
//! | 2 | bright | bright | until the first parameters since power on |
//! | 3 | bright | flashing | while a parameter or configuration fault is pending |
//! | 4 | flashing | bright | after parameters, outside of data exchange |
//! | 5 | bright | dark | after 40 s without any telegram |
//! | 6 | dark | bright | in data exchange |
//!
//! The manual names no order. Model: 1, 6, 3, 5, 2, 4, the first that fits; so a slave whose watchdog is off stays in
//! data exchange, and at pattern 6, when its line is cut.

use crate::observation::{Leds, SlaveState};
use crate::time::{Local, Span};

/// The "longer period" without data of manual 5.2. Model: D25.
pub const SILENCE: Span = Span::from_s(40);
/// Period of flashing, lit in its first half. Model: D25, 1 Hz.
pub const FLASH_PERIOD: Span = Span::from_s(1);

/// What one LED does.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Lamp {
    /// Off.
    Dark,
    /// On.
    Bright,
    /// On and off, see [`FLASH_PERIOD`].
    Flashing,
}

impl Lamp {
    /// The manual's word.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Dark => "dark",
            Self::Bright => "bright",
            Self::Flashing => "flashing",
        }
    }
    /// Whether it gives light at `now`. Model: a flashing one starts lit at the zero of the station's own clock.
    pub const fn is_lit(self, now: Local) -> bool {
        match self {
            Self::Dark => false,
            Self::Bright => true,
            Self::Flashing => now.ticks().rem_euclid(FLASH_PERIOD.ticks()) < FLASH_PERIOD.ticks() / 2,
        }
    }
}

/// What manual 5.2 says of each pattern.
impl Leds {
    /// Its number in the manual's table, 1..=6.
    pub const fn number(self) -> u8 {
        self as u8 + 1
    }
    /// The red LED.
    pub const fn red(self) -> Lamp {
        match self {
            Self::NoSupply | Self::DataExchange => Lamp::Dark,
            Self::NotConfigured | Self::Refused | Self::Silence => Lamp::Bright,
            Self::NotAddressed => Lamp::Flashing,
        }
    }
    /// The green LED.
    pub const fn green(self) -> Lamp {
        match self {
            Self::NoSupply | Self::Silence => Lamp::Dark,
            Self::NotConfigured | Self::NotAddressed | Self::DataExchange => Lamp::Bright,
            Self::Refused => Lamp::Flashing,
        }
    }
    /// What it tells, and where to look first.
    pub const fn meaning(self) -> &'static str {
        match self {
            Self::NoSupply => "no supply",
            Self::NotConfigured => "ready, not configured since power on: wrong address or bus lines not connected",
            Self::Refused => "parameters or configuration refused: wrong length or values, such as the total range",
            Self::NotAddressed => "ready, its master does not address it: wrong address in the master's configuration",
            Self::Silence => "no data for about 40 s: bus line interrupted",
            Self::DataExchange => "data exchange, normal operation",
        }
    }
}

/// What the LEDs depend on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LedInput {
    /// Whether there is supply.
    pub powered: bool,
    /// State of the DP slave.
    pub state: SlaveState,
    /// Whether Prm_Fault, Cfg_Fault or Not_Supported is pending in its diagnosis.
    pub fault: bool,
    /// Whether a telegram came since the last update, for whomever it was.
    pub heard: bool,
}

/// Decides what the LEDs show.
///
/// To be updated after every telegram, at every change of its input and at [`LedLogic::next_deadline`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LedLogic {
    leds: Leds,
    /// Parameters came since power on, good or bad.
    configured: bool,
    heard: Option<Local>,
    deadline: Option<Local>,
}

impl Default for LedLogic {
    fn default() -> Self {
        Self { leds: Leds::NoSupply, configured: false, heard: None, deadline: None }
    }
}

impl LedLogic {
    /// What the LEDs show.
    pub const fn leds(&self) -> Leds {
        self.leds
    }
    /// When to update at the latest, even if nothing happens.
    ///
    /// It stays where it is while telegrams come, so that it need not be armed again for each: an update at the deadline
    /// may find that a telegram came since, and moves it.
    pub const fn next_deadline(&self) -> Option<Local> {
        self.deadline
    }
    /// As [`update`](Self::update) with a telegram in data exchange that goes on: it shows the same, whatever else there
    /// is. A deadline of before is left to come.
    pub const fn goes_on(&mut self, now: Local) {
        self.heard = Some(now);
    }
    /// Takes over what is the case at `now`; what the LEDs showed and show if this changed.
    pub fn update(&mut self, now: Local, input: LedInput) -> Option<(Leds, Leds)> {
        let from = self.leds;
        if !input.powered {
            *self = Self::default();
            return (from != self.leds).then_some((from, self.leds));
        }
        // Only parameters lead out of WAIT_PRM, and only bad ones to a fault.
        self.configured |= input.fault || matches!(input.state, SlaveState::WaitCfg | SlaveState::DataExch);
        if input.heard {
            self.heard = Some(now);
        }
        let silent_from = self.heard.map(|heard| heard + SILENCE);
        let silent = silent_from.is_some_and(|silent_from| now >= silent_from);
        self.leds = shown(input, silent, self.configured);
        let concerned = !silent && input.state != SlaveState::DataExch && !input.fault;
        let pending = self.deadline.filter(|&deadline| now < deadline);
        self.deadline = if concerned { pending.or(silent_from) } else { pending };
        (from != self.leds).then_some((from, self.leds))
    }
}

/// The pattern with supply.
const fn shown(input: LedInput, silent: bool, configured: bool) -> Leds {
    match (input.state, input.fault, silent, configured) {
        (SlaveState::DataExch, ..) => Leds::DataExchange,
        (_, true, ..) => Leds::Refused,
        (_, _, true, _) => Leds::Silence,
        (_, _, _, false) => Leds::NotConfigured,
        (_, _, _, true) => Leds::NotAddressed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::Observation;
    use alloc::format;
    use alloc::string::ToString;
    use alloc::vec::Vec;
    use proptest::prelude::*;

    const OFF: LedInput = LedInput { powered: false, state: SlaveState::PowerOn, fault: false, heard: false };

    fn at(s: i64) -> Local {
        Local::ZERO + Span::from_s(s)
    }
    fn input(state: SlaveState) -> LedInput {
        LedInput { powered: true, state, fault: false, heard: true }
    }
    /// The logic after these inputs, one a second from second 0.
    fn after(inputs: &[LedInput]) -> LedLogic {
        let mut logic = LedLogic::default();
        for (s, &input) in (0..).zip(inputs) {
            logic.update(at(s), input);
        }
        logic
    }

    #[test]
    fn the_six_patterns_are_those_of_the_manual() {
        let table: Vec<_> = Leds::ALL.iter().map(|leds| (leds.number(), leds.red(), leds.green())).collect();
        assert_eq!(
            table,
            [
                (1, Lamp::Dark, Lamp::Dark),
                (2, Lamp::Bright, Lamp::Bright),
                (3, Lamp::Bright, Lamp::Flashing),
                (4, Lamp::Flashing, Lamp::Bright),
                (5, Lamp::Bright, Lamp::Dark),
                (6, Lamp::Dark, Lamp::Bright),
            ]
        );
        for leds in Leds::ALL {
            assert_eq!(leds.text(), format!("{}/{}", leds.red().text(), leds.green().text()));
            assert!(!leds.meaning().is_empty());
        }
    }

    #[test]
    fn a_change_is_an_event_that_reads_as_the_manual() {
        let change = Observation::Leds { from: Leds::NotAddressed, to: Leds::DataExchange };
        assert_eq!(change.to_string(), "LEDs red/green flashing/bright -> dark/bright");
        let power = Observation::Power { on: false };
        assert_eq!(power.to_string(), "supply off");
        assert!(change.is_event() && power.is_event());
    }

    #[test]
    fn a_flashing_lamp_is_lit_in_the_first_half_of_each_second() {
        for (ms, lit) in [(0, true), (499, true), (500, false), (999, false), (1_000, true), (-1, false), (-501, true)]
        {
            let now = Local::ZERO + Span::from_ms(ms);
            assert_eq!(Lamp::Flashing.is_lit(now), lit, "{ms}");
            assert!(Lamp::Bright.is_lit(now) && !Lamp::Dark.is_lit(now));
        }
    }

    #[test]
    fn every_state_with_every_input_shows_its_pattern() {
        use SlaveState::{DataExch, PowerOn, WaitCfg, WaitPrm};
        let walked = [
            // Before, state, fault, silent: pattern.
            (&[][..], PowerOn, false, false, Leds::NotConfigured),
            (&[], WaitPrm, false, false, Leds::NotConfigured),
            (&[], WaitPrm, true, false, Leds::Refused),
            (&[], WaitPrm, false, true, Leds::Silence),
            (&[], WaitPrm, true, true, Leds::Refused),
            (&[], WaitCfg, false, false, Leds::NotAddressed),
            (&[], WaitCfg, false, true, Leds::Silence),
            (&[WaitCfg], WaitPrm, false, false, Leds::NotAddressed),
            (&[WaitCfg], WaitPrm, true, false, Leds::Refused),
            (&[WaitCfg], WaitPrm, false, true, Leds::Silence),
            (&[WaitCfg], DataExch, false, false, Leds::DataExchange),
            (&[WaitCfg, DataExch], DataExch, false, true, Leds::DataExchange),
            (&[WaitCfg, DataExch], WaitPrm, false, false, Leds::NotAddressed),
            (&[WaitCfg, DataExch], WaitPrm, true, false, Leds::Refused),
            (&[WaitCfg, DataExch], WaitPrm, false, true, Leds::Silence),
        ];
        for (before, state, fault, silent, expected) in walked {
            let states = [&[WaitPrm], before].concat();
            let mut logic = after(&states.iter().map(|&state| input(state)).collect::<Vec<_>>());
            let now = at(if silent { states.len() as i64 + 39 } else { 10 });
            logic.update(now, LedInput { fault, heard: false, ..input(state) });
            assert_eq!(logic.leds(), expected, "{before:?} {state} fault {fault} silent {silent}");
            assert_eq!(logic.update(now, OFF), Some((expected, Leds::NoSupply)));
            assert_eq!(logic, LedLogic::default());
        }
    }

    #[test]
    fn a_refused_attempt_counts_as_configuration() {
        let refused = LedInput { fault: true, ..input(SlaveState::WaitPrm) };
        assert_eq!(after(&[refused]).leds(), Leds::Refused);
        assert_eq!(after(&[refused, input(SlaveState::WaitPrm)]).leds(), Leds::NotAddressed);
        assert_eq!(after(&[refused, OFF, input(SlaveState::WaitPrm)]).leds(), Leds::NotConfigured);
    }

    #[test]
    fn only_changes_are_told() {
        let mut logic = LedLogic::default();
        let told = [OFF, input(SlaveState::WaitPrm), input(SlaveState::WaitPrm), input(SlaveState::WaitCfg)]
            .map(|input| logic.update(at(1), input));
        assert_eq!(
            told,
            [None, Some((Leds::NoSupply, Leds::NotConfigured)), None, Some((Leds::NotConfigured, Leds::NotAddressed))]
        );
    }

    #[test]
    fn who_never_heard_anything_is_not_configured_rather_than_cut_off() {
        let mut logic = LedLogic::default();
        let deaf = LedInput { heard: false, ..input(SlaveState::WaitPrm) };
        logic.update(at(0), deaf);
        assert_eq!(logic.next_deadline(), None);
        assert_eq!((logic.update(at(1_000), deaf), logic.leds()), (None, Leds::NotConfigured));
    }

    #[test]
    fn silence_begins_40_s_after_the_last_telegram() {
        let deaf = LedInput { heard: false, ..input(SlaveState::WaitPrm) };
        let mut logic = after(&[input(SlaveState::WaitPrm)]);
        assert_eq!(logic.next_deadline(), Some(at(40)));
        logic.update(at(15), input(SlaveState::WaitPrm));
        assert_eq!(logic.next_deadline(), Some(at(40)), "stays while telegrams come");
        assert_eq!(logic.update(at(40), deaf), None, "a telegram came since");
        assert_eq!(logic.next_deadline(), Some(at(55)));
        assert_eq!(logic.update(at(55) - Span::from_ticks(1), deaf), None);
        assert_eq!(logic.update(at(55), deaf), Some((Leds::NotConfigured, Leds::Silence)));
        assert_eq!(logic.next_deadline(), None);
        let back = logic.update(at(70), input(SlaveState::WaitPrm));
        assert_eq!((back, logic.next_deadline()), (Some((Leds::Silence, Leds::NotConfigured)), Some(at(110))));
    }

    #[test]
    fn data_exchange_needs_no_deadline_and_leaving_it_brings_one() {
        let mut logic = after(&[input(SlaveState::WaitCfg), input(SlaveState::DataExch)]);
        logic.update(at(40), input(SlaveState::DataExch));
        assert_eq!(logic.next_deadline(), None);
        logic.update(at(50), input(SlaveState::DataExch));
        let deaf = LedInput { heard: false, ..input(SlaveState::WaitPrm) };
        assert_eq!(logic.update(at(60), deaf), Some((Leds::DataExchange, Leds::NotAddressed)));
        assert_eq!(logic.next_deadline(), Some(at(90)));
    }

    fn any_input() -> impl Strategy<Value = (i64, LedInput)> {
        let state = prop::sample::select(SlaveState::ALL);
        (0i64..60, prop::bool::weighted(0.95), state, prop::bool::weighted(0.1), any::<bool>())
            .prop_map(|(wait, powered, state, fault, heard)| (wait, LedInput { powered, state, fault, heard }))
    }

    proptest! {
        /// Who updates at its changes and at the deadlines alone sees what an update in every second sees.
        #[test]
        fn the_deadline_is_never_too_late(inputs in prop::collection::vec(any_input(), 1..60)) {
            let (mut lazy, mut eager) = (LedLogic::default(), LedLogic::default());
            let (mut s, mut last) = (0, OFF);
            for (wait, input) in inputs {
                for _ in 0..wait {
                    let quiet = LedInput { heard: false, ..last };
                    if lazy.next_deadline().is_some_and(|deadline| deadline <= at(s)) {
                        lazy.update(at(s), quiet);
                    }
                    eager.update(at(s), quiet);
                    prop_assert_eq!(lazy.leds(), eager.leds(), "{} s", s);
                    s += 1;
                }
                lazy.update(at(s), input);
                eager.update(at(s), input);
                prop_assert_eq!(lazy.leds(), eager.leds(), "{} s", s);
                prop_assert!(lazy.next_deadline().is_none_or(|deadline| deadline > at(s)));
                last = input;
            }
        }
    }
}
