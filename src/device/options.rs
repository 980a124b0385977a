//! Options of a unit: what the sources leave open, or what makes do differently, each with the model's default.

use crate::device::pll::PllSettings;
use crate::device::sensor::SensorOptions;
use crate::device::sign_of_life::MonitorSettings;
use crate::time::Span;

/// What can be chosen of a unit, not by its master.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct UnitOptions {
    /// Tolerated clock failures. Model: D15, default 1.
    pub clock_tolerance: u8,
    /// Clock recovery. Model: D11, D12, D14.
    pub pll: PllOptions,
    /// Start-up of the signs of life. Model: D16.
    pub life: LifeOptions,
    /// How the sensor handshake answers where makes differ. Model: D18.
    pub sensor: SensorOptions,
    /// Home position or shift that a preset sets (steps, or units when scaled). Model: D21, default 0.
    pub preset_value: i32,
    /// Resolution by the type key, where it is not the profile's.
    pub resolution: Option<Resolution>,
    /// MS2 connections at the same time, 0..=49, where they are not the profile's.
    pub ms2_connections: Option<u8>,
}

impl Default for UnitOptions {
    fn default() -> Self {
        Self {
            clock_tolerance: 1,
            pll: PllOptions::default(),
            life: LifeOptions::default(),
            sensor: SensorOptions::default(),
            preset_value: 0,
            resolution: None,
            ms2_connections: None,
        }
    }
}

/// What a disc and its gear tell apart, part of an encoder's type key.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Resolution {
    /// Steps in a revolution.
    pub steps_per_rev: u32,
    /// Revolutions that are told apart, 1 for a single-turn encoder.
    pub revolutions: u32,
}

/// Options of the clock recovery; what they do, see [`PllSettings`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PllOptions {
    /// n1, multiple of T_PLL_W in the first window. Model: D11, default 4.
    pub first_window_factor: u16,
    /// n2, share of T_DP in the first window (ppm). Model: D11, default 300.
    pub first_window_ppm: u32,
    /// Kp, proportional gain (1/65536), 0..=65536. Model: D11, default 1/4.
    pub kp: u32,
    /// Ki, integral gain (1/65536), 0..=65536. Model: D11, default 1/32.
    pub ki: u32,
    /// Hits in a row that halve the window. Model: D12, default 4.
    pub hits_per_step: u8,
    /// Further hits in a row at the final width until locked. Model: D12, default 4.
    pub hits_to_lock: u8,
    /// Failures in a row that start over before lock. Model: D12, default 3.
    pub failures_to_restart: u8,
    /// Grid of capture and timers, above 0. Model: D14, default 1/48 µs.
    pub quantum: Span,
    /// Least half width of the window. Model: D12, default 1 µs (manual 3.3.8).
    pub min_window: Span,
}

impl Default for PllOptions {
    fn default() -> Self {
        let settings = PllSettings::new(Span::from_ms(1), Span::ZERO, Span::ZERO);
        Self {
            first_window_factor: settings.first_window_factor,
            first_window_ppm: settings.first_window_ppm,
            kp: settings.kp,
            ki: settings.ki,
            hits_per_step: settings.hits_per_step,
            hits_to_lock: settings.hits_to_lock,
            failures_to_restart: settings.failures_to_restart,
            quantum: settings.quantum,
            min_window: settings.min_window,
        }
    }
}

impl PllOptions {
    /// `settings` with these options.
    #[must_use]
    pub const fn on(self, settings: PllSettings) -> PllSettings {
        PllSettings {
            first_window_factor: self.first_window_factor,
            first_window_ppm: self.first_window_ppm,
            kp: self.kp,
            ki: self.ki,
            hits_per_step: self.hits_per_step,
            hits_to_lock: self.hits_to_lock,
            failures_to_restart: self.failures_to_restart,
            quantum: self.quantum,
            min_window: self.min_window,
            ..settings
        }
    }
}

/// When the own sign of life starts. The manual says both.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub enum LifeStart {
    /// After phase 3: the master's has been followed (manual 2.1.4; Model: D16).
    #[default]
    AfterMaster,
    /// With the clock locked (manual 2.2).
    AfterClock,
}

/// Options of the signs of life.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LifeOptions {
    /// Correct steps that synchronise (phase 3), 1..=255. Model: D16, default 16.
    pub steps: u8,
    /// Further correct DP cycles until operation (phase 4). Model: D16, default 16.
    pub confirmation: u8,
    /// When the own sign of life starts. Model: D16.
    pub start: LifeStart,
}

impl Default for LifeOptions {
    fn default() -> Self {
        let MonitorSettings { steps, confirmation, .. } = MonitorSettings::new(1, 1);
        Self { steps, confirmation, start: LifeStart::default() }
    }
}
