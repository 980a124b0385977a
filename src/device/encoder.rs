//! The absolute encoder of the manuals: code sequence, scaling, preset and the format of its position words.

use crate::device::options::{Resolution, UnitOptions};
use crate::device::parameters::{DeviceIdentification, Parameters, Refused, SensorFormat};
use crate::device::position::{CodeSequence, Position, Scaling};
use crate::device::profile::Device;
use crate::device::sensor::Preset;
use crate::device::unit::{Function, Unit};
use crate::dp::slave::Refusal;
use crate::time::Span;
use crate::wire::Address;
use crate::wire::acyclic::ErrorCode;
use crate::wire::prm::{BlockType, SetPrm, UserPrm81};

/// An absolute encoder on the bus.
pub type Encoder = Unit<Disc>;

/// P922 (manual 2.2).
const TELEGRAM: u16 = 81;

/// What the encoder does with the raw position of its disc.
#[derive(Clone, Debug)]
pub struct Disc {
    profile: Device,
    resolution: Resolution,
    /// Absolute preset and relative shift. Model: D21; no parameter of these devices is writable.
    preset_value: i32,
    position: Position,
}

impl Disc {
    /// The disc of a device, unscaled and clockwise.
    ///
    /// # Panics
    /// If the disc has no position or more than 2^32: a mistake in the profile or the options.
    pub fn new(profile: impl Into<Device>, options: &UnitOptions) -> Self {
        let profile = profile.into();
        let resolution = options.resolution.unwrap_or(profile.resolution());
        let position = Position::new(resolution.steps_per_rev, resolution.revolutions, CodeSequence::Cw, None);
        let position = position.expect("an unscaled disc breaks no rule");
        Self { profile, resolution, preset_value: options.preset_value, position }
    }

    /// P964. Model: the manuals print no values, so the manufacturer is 0 and the firmware as old as the manual.
    fn identification(&self) -> DeviceIdentification {
        let device_type = self.profile.ident;
        DeviceIdentification { manufacturer: 0, device_type, firmware: 0x0101, year: 2007, day_month: 101, axes: 1 }
    }

    /// The position that these parameters ask for (manual 3.2).
    fn asked_for(&self, user: &UserPrm81) -> Result<Position, Refusal> {
        let ccw = user.options.activate() && user.options.counter_clockwise();
        let code_sequence = if ccw { CodeSequence::Ccw } else { CodeSequence::Cw };
        let scaling = user
            .scaled()
            .then_some(Scaling { units_per_rev: user.units_per_revolution, total_range: user.total_range });
        let Resolution { steps_per_rev, revolutions } = self.resolution;
        Position::new(steps_per_rev, revolutions, code_sequence, scaling).map_err(|error| {
            let octet = error.octets().start;
            let value = if octet == 16 { user.units_per_revolution } else { user.total_range };
            let rule = "scaling fits the disc: units per revolution up to its steps, total range up to units x revolutions (manual 3.2.3, 3.2.4)";
            Refusal::Device { octet, rule, value: value.into() }
        })
    }
}

/// The user block: one, and nothing else but the isochronous block.
fn user_block(prm: &SetPrm<'_>) -> Result<UserPrm81, Refusal> {
    let mut user = None;
    for block in prm.blocks() {
        let block = block?;
        match block.kind {
            BlockType::IsoM => {}
            BlockType::User if user.is_none() => user = Some(UserPrm81::parse(&block)?),
            kind => {
                let rule = "an encoder takes one user block and one isochronous block (manual 3.1)";
                return Err(Refusal::Device { octet: block.octet + 1, rule, value: kind.code().into() });
            }
        }
    }
    let rule = "an encoder needs its user block (manual 3.1)";
    user.ok_or(Refusal::Device { octet: 10, rule, value: prm.dpv1.octets()[2].into() })
}

impl Function for Disc {
    fn check(&self, prm: &SetPrm<'_>) -> Result<(), Refusal> {
        self.asked_for(&user_block(prm)?).map(|_| ())
    }
    fn parameterise(&mut self, prm: &SetPrm<'_>, _watchdog: Option<Span>) {
        if let Ok(position) = user_block(prm).and_then(|user| self.asked_for(&user)) {
            self.position = position;
        }
    }
    fn max_failures(prm: &SetPrm<'_>) -> u8 {
        user_block(prm).map_or(1, |user| user.max_failures)
    }
    fn slow(prm: &SetPrm<'_>) -> bool {
        user_block(prm).is_ok_and(|user| user.options.activate())
    }
    fn position(&self, raw: u32) -> (u32, u32) {
        let value = self.position.value(raw);
        (self.position.xist1(value), self.position.xist2(value))
    }
    fn parameters(&self, address: Address, request: &[u8], out: &mut [u8]) -> Result<usize, ErrorCode> {
        let parameters = Parameters {
            address,
            telegram: TELEGRAM,
            identification: self.identification(),
            profile: Parameters::PROFILE,
            format: SensorFormat::of(&self.position),
        };
        parameters.answer(request, out).map_err(|Refused(code)| code)
    }
    fn preset(&mut self, preset: Preset, raw: u32) {
        match preset {
            Preset::Absolute => self.position.preset_absolute(raw, self.preset_value),
            Preset::Relative => self.position.preset_relative(self.preset_value),
        }
    }
}
