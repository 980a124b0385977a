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
