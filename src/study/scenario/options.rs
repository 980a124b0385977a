//! Options of a slave: the keys by which a device differs from the model's defaults.

use super::error::Fault;
use super::section::{Reader, Section, choice, cycle_time, number, quantity, yes};
use super::tree::Node;
use crate::device::options::{LifeOptions, LifeStart, PllOptions, Resolution, UnitOptions};
use crate::device::profile::MOST_MS2_CONNECTIONS;
use crate::device::sensor::{Acknowledgement, ErrorBit, SensorOptions, ValueBit};
use crate::study::quantity::gain;
use crate::time::{BitRate, Span};

/// Words for how an acknowledgement shows (Model: D18).
const ACKNOWLEDGEMENTS: &[(&str, Acknowledgement)] = &[
    ("immediate", Acknowledgement::Immediate),
    ("until-reset", Acknowledgement::UntilReset),
    ("self-clearing", Acknowledgement::SelfClearing),
];
/// Words for bit 15 during an acknowledgement (Model: D18).
const ERROR_BITS: &[(&str, ErrorBit)] =
    &[("while-cause", ErrorBit::WhileCause), ("while-acknowledging", ErrorBit::WhileAcknowledging)];
/// Words for bit 13 during an error (Model: D18).
const VALUE_BITS: &[(&str, ValueBit)] =
    &[("cleared-by-error", ValueBit::ClearedByError), ("follows-request", ValueBit::FollowsRequest)];
/// Words for the start of the own sign of life (Model: D16).
const LIFE_STARTS: &[(&str, LifeStart)] =
    &[("after-master", LifeStart::AfterMaster), ("after-clock", LifeStart::AfterClock)];

/// Reads the option that a word names.
fn word<T: Copy>(noun: &str, words: &'static [(&'static str, T)]) -> impl Fn(&Node) -> Result<T, Fault> {
    move |node| choice(node, noun, words, |row| row.0).map(|row| row.1)
}

/// Reads all options of a slave; what is left out has the model's default.
pub(super) fn read(section: &mut Section<'_>, reader: &mut Reader<'_>, rate: BitRate) -> UnitOptions {
    let usual = UnitOptions::default();
    let clock_tolerance = section.optional(reader, "clock_tolerance", number(0..=u8::MAX));
    let pll = section.table(reader, "pll").map(|inner| pll(inner, reader, rate));
    let steps = section.optional(reader, "life_steps", number(1..=u8::MAX));
    let confirmation = section.optional(reader, "life_confirmation", number(0..=u8::MAX));
    let start = section.optional(reader, "life_start", word("start of the sign of life", LIFE_STARTS));
    let sensor = section.table(reader, "sensor").map(|inner| sensor(inner, reader));
    let preset_value = section.optional(reader, "preset_value", number(i32::MIN..=i32::MAX));
    let resolution = section.table(reader, "resolution").and_then(|inner| resolution(inner, reader));
    let ms2_connections = section.optional(reader, "ms2_connections", number(0..=MOST_MS2_CONNECTIONS));
    UnitOptions {
        clock_tolerance: clock_tolerance.unwrap_or(usual.clock_tolerance),
        pll: pll.unwrap_or(usual.pll),
        life: LifeOptions {
            steps: steps.unwrap_or(usual.life.steps),
            confirmation: confirmation.unwrap_or(usual.life.confirmation),
            start: start.unwrap_or(usual.life.start),
        },
        sensor: sensor.unwrap_or(usual.sensor),
        preset_value: preset_value.unwrap_or(usual.preset_value),
        resolution,
        ms2_connections,
    }
}

/// Reads `pll = { ... }` (Model: D11, D12, D14).
fn pll(mut section: Section<'_>, reader: &mut Reader<'_>, rate: BitRate) -> PllOptions {
    let (s, mut pll) = (&mut section, PllOptions::default());
    let factor = s.optional(reader, "first_window_factor", number(0..=u16::MAX));
    pll.first_window_factor = factor.unwrap_or(pll.first_window_factor);
    // A quarter of T_DP is the widest window.
    let share = s.optional(reader, "first_window_ppm", number(0..=250_000));
    pll.first_window_ppm = share.unwrap_or(pll.first_window_ppm);
    for (key, value) in [("kp", &mut pll.kp), ("ki", &mut pll.ki)] {
        *value = s.optional(reader, key, quantity("1/4", gain)).unwrap_or(*value);
    }
    let counts = [
        ("hits_per_step", &mut pll.hits_per_step),
        ("hits_to_lock", &mut pll.hits_to_lock),
        ("failures_to_restart", &mut pll.failures_to_restart),
    ];
    for (key, value) in counts {
        *value = s.optional(reader, key, number(1..=u8::MAX)).unwrap_or(*value);
    }
    let step = |node: &Node| match cycle_time(rate)(node)? {
        Span::ZERO => Err(Fault::new("timers without steps do not exist").help("the default is \"250 tick\"")),
        span => Ok(span),
    };
    pll.quantum = s.optional(reader, "quantum", step).unwrap_or(pll.quantum);
    pll.min_window = s.optional(reader, "min_window", cycle_time(rate)).unwrap_or(pll.min_window);
    section.finish(reader);
    pll
}

/// Reads `sensor = { ... }` (Model: D18).
fn sensor(mut section: Section<'_>, reader: &mut Reader<'_>) -> SensorOptions {
    let (s, usual) = (&mut section, SensorOptions::default());
    let acknowledgement = s.optional(reader, "acknowledgement", word("acknowledgement", ACKNOWLEDGEMENTS));
    let error_bit = s.optional(reader, "error_bit", word("error bit", ERROR_BITS));
    let value_bit = s.optional(reader, "value_bit", word("value bit", VALUE_BITS));
    let preset = s.optional(reader, "preset", yes);
    section.finish(reader);
    SensorOptions {
        acknowledgement: acknowledgement.unwrap_or(usual.acknowledgement),
        error_bit: error_bit.unwrap_or(usual.error_bit),
        value_bit: value_bit.unwrap_or(usual.value_bit),
        preset_enabled: preset.unwrap_or(usual.preset_enabled),
    }
}

/// Reads `resolution = { steps_per_rev, revolutions }`.
fn resolution(mut section: Section<'_>, reader: &mut Reader<'_>) -> Option<Resolution> {
    let steps_per_rev = section.required(reader, "steps_per_rev", "8192", number(1..=u32::MAX));
    let revolutions = section.required(reader, "revolutions", "4096", number(1..=u32::MAX));
    section.finish(reader);
    Some(Resolution { steps_per_rev: steps_per_rev?, revolutions: revolutions? })
}
