//! Position arithmetic: from the raw position on the disc to G1_XIST1 and G1_XIST2 (manual 2.2, 3.2.1 to 3.2.4).
//!
//! ```text
//! raw -> code sequence -> floor(raw·MUPR / steps) mod TMR -> + offset, mod range -> shifted left: G1_XIST1
//! ```
//!
//! Order and rounding: Model: D21. The encoder has no revolution counter beyond its physical range: if the physical
//! revolutions are no multiple of the period of the scaled value, the value jumps at the physical overflow (Model: D22).

use core::fmt;
use core::ops::Range;

/// Direction of rotation, seen onto the shaft, in which the position grows. Manual 3.2.1, octet 15 bit 0.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub enum CodeSequence {
    /// Clockwise.
    #[default]
    Cw,
    /// Counter-clockwise. Model: the raw position counted from the other end of the physical range.
    Ccw,
}

/// Scaling of the position (manual 3.2.2: in force with octet 15 bits 1 and 3).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Scaling {
    /// MUPR, measuring units per revolution, 1..=physical steps per revolution. Manual 3.2.3, octets 16-19.
    pub units_per_rev: u32,
    /// TMR, total measuring range (units), 1..=MUPR · physical revolutions; the value runs from 0 to TMR − 1.
    /// Manual 3.2.4, octets 20-23; Model: D20.
    pub total_range: u32,
}

/// A scaling that breaks a rule: the slave reports a parameter error and stays out of data exchange (manual 3.2.3, 3.2.4).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum ScalingError {
    /// No units per revolution at all (manual 3.2.3).
    NoUnits,
    /// More units than physical steps per revolution: the code would not be single-stepped (manual 3.2.3).
    UnitsAboveSteps {
        /// As parameterised (units).
        units_per_rev: u32,
        /// Physical resolution (steps).
        steps_per_rev: u32,
    },
    /// No measuring range at all (manual 3.2.4).
    NoRange,
    /// A period longer than the physical revolutions (manual 3.2.4; Model: D20, equality is allowed).
    RangeAboveRevolutions {
        /// As parameterised (units).
        total_range: u32,
        /// MUPR · physical revolutions (units).
        limit: u64,
    },
}

impl ScalingError {
    /// The octets of Set_Prm, counted from 1, that break the rule.
    pub const fn octets(self) -> Range<usize> {
        match self {
            Self::NoUnits | Self::UnitsAboveSteps { .. } => 16..20,
            Self::NoRange | Self::RangeAboveRevolutions { .. } => 20..24,
        }
    }
}

impl fmt::Display for ScalingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoUnits => write!(f, "measuring units per revolution is 0 (octets 16-19, manual 3.2.3)"),
            Self::UnitsAboveSteps { units_per_rev, steps_per_rev } => write!(
                f,
                "{units_per_rev} measuring units per revolution are more than the {steps_per_rev} physical steps \
                 (octets 16-19, manual 3.2.3)"
            ),
            Self::NoRange => write!(f, "total measuring range is 0 (octets 20-23, manual 3.2.4)"),
            Self::RangeAboveRevolutions { total_range, limit } => write!(
                f,
                "total measuring range {total_range} is more than the {limit} units of all physical revolutions \
                 (octets 20-23, manual 3.2.4)"
            ),
        }
    }
}
impl core::error::Error for ScalingError {}

impl Scaling {
    /// Checks the rules of manual 3.2.3 and 3.2.4 for a disc of `steps_per_rev` steps and `revolutions` revolutions.
    ///
    /// # Errors
    /// The first broken rule, in the order of the octets.
    pub const fn check(self, steps_per_rev: u32, revolutions: u32) -> Result<(), ScalingError> {
        let Self { units_per_rev, total_range } = self;
        let limit = units_per_rev as u64 * revolutions as u64;
        if units_per_rev == 0 {
            Err(ScalingError::NoUnits)
        } else if units_per_rev > steps_per_rev {
            Err(ScalingError::UnitsAboveSteps { units_per_rev, steps_per_rev })
        } else if total_range == 0 {
            Err(ScalingError::NoRange)
        } else if total_range as u64 > limit {
            Err(ScalingError::RangeAboveRevolutions { total_range, limit })
        } else {
            Ok(())
        }
    }

    /// Whether the value passes the physical overflow of `revolutions` revolutions without a jump (Model: D22).
    pub const fn is_seamless(self, revolutions: u32) -> bool {
        (self.units_per_rev as u64 * revolutions as u64).is_multiple_of(self.total_range as u64)
    }
}

/// From the raw position to the values of telegram 81.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Position {
    code_sequence: CodeSequence,
    scaling: Option<Scaling>,
    steps_per_rev: u32,
    revolutions: u32,
    offset: u32,
}

impl Position {
    /// Arithmetic for a disc of `steps_per_rev` steps and `revolutions` revolutions, without offset.
    ///
    /// # Errors
    /// A scaling that breaks a rule of manual 3.2.3 or 3.2.4.
    ///
    /// # Panics
    /// If the disc has no position or more than 2^32: a device profile is no remote input.
    pub fn new(
        steps_per_rev: u32,
        revolutions: u32,
        code_sequence: CodeSequence,
        scaling: Option<Scaling>,
    ) -> Result<Self, ScalingError> {
        let positions = u64::from(steps_per_rev) * u64::from(revolutions);
        assert!((1..=1 << 32).contains(&positions), "a disc of {positions} positions");
        if let Some(scaling) = scaling {
            scaling.check(steps_per_rev, revolutions)?;
        }
        Ok(Self { code_sequence, scaling, steps_per_rev, revolutions, offset: 0 })
    }

    /// Position value (steps, or units when scaled), 0..[`Position::range`], for `raw` (steps). A raw position beyond
    /// the disc wraps.
    pub fn value(&self, raw: u32) -> u32 {
        self.shifted(self.scaled(raw), self.offset)
    }

    /// Number of different values (steps, or units when scaled), 1..=2^32.
    pub fn range(&self) -> u64 {
        self.scaling.map_or_else(|| self.positions(), |scaling| scaling.total_range.into())
    }

    /// Bits by which G1_XIST1 is shifted left, 0..=31, as P979 reports it (manual 2.2; Model: D23).
    pub fn xist1_shift(&self) -> u32 {
        let bits = match self.scaling {
            Some(scaling) => bits(scaling.total_range),
            None => bits(self.steps_per_rev) + bits(self.revolutions),
        };
        32 - bits.clamp(1, 32)
    }

    /// Bits by which G1_XIST2 is shifted left, as P979 reports it (manual 2.2; Model: D23).
    pub const fn xist2_shift(&self) -> u32 {
        0
    }

    /// G1_XIST1: the position value, left justified (manual 2.2).
    pub fn xist1(&self, value: u32) -> u32 {
        value << self.xist1_shift()
    }

    /// G1_XIST2 without error: the position value, right justified, shift 0 (manual 2.2; Model: D23).
    pub fn xist2(&self, value: u32) -> u32 {
        value << self.xist2_shift()
    }

    /// Values in a revolution (steps, or units when scaled), as P979 reports them.
    pub fn values_per_rev(&self) -> u32 {
        self.scaling.map_or(self.steps_per_rev, |scaling| scaling.units_per_rev)
    }

    /// Whole revolutions that the value tells apart, as P979 reports them; none if its range ends within the first.
    pub fn whole_revolutions(&self) -> u32 {
        self.scaling.map_or(self.revolutions, |scaling| scaling.total_range / scaling.units_per_rev)
    }

    /// Sets the home position: from now on `raw` (steps) reads `preset` (steps or units), modulo the range.
    /// A negative preset is ignored. Manual 2.2, G1_STW bit 11 = 0.
    pub fn preset_absolute(&mut self, raw: u32, preset: i32) {
        if let Ok(preset) = u64::try_from(preset) {
            let range = self.range();
            self.offset = ((preset % range + range - u64::from(self.scaled(raw))) % range) as u32;
        }
    }

    /// Shifts the home position: every position reads `shift` (steps or units) more, modulo the range.
    /// Manual 2.2, G1_STW bit 11 = 1.
    pub fn preset_relative(&mut self, shift: i32) {
        let shift = i64::from(shift).rem_euclid(self.range() as i64);
        self.offset = self.shifted(self.offset, shift as u32);
    }

    /// Offset in force (steps, or units when scaled).
    pub fn offset(&self) -> u32 {
        self.offset
    }

    /// Scaling in force.
    pub fn scaling(&self) -> Option<Scaling> {
        self.scaling
    }

    fn positions(&self) -> u64 {
        u64::from(self.steps_per_rev) * u64::from(self.revolutions)
    }

    /// Value before the offset.
    fn scaled(&self, raw: u32) -> u32 {
        let raw = u64::from(raw) % self.positions();
        let raw = match self.code_sequence {
            CodeSequence::Cw => raw,
            CodeSequence::Ccw => self.positions() - 1 - raw,
        };
        let scale = |scaling: Scaling| {
            raw * u64::from(scaling.units_per_rev) / u64::from(self.steps_per_rev) % u64::from(scaling.total_range)
        };
        self.scaling.map_or(raw, scale) as u32
    }

    fn shifted(&self, value: u32, by: u32) -> u32 {
        ((u64::from(value) + u64::from(by)) % self.range()) as u32
    }
}

/// Bits that count from 0 to `count` − 1.
fn bits(count: u32) -> u32 {
    32 - (count - 1).leading_zeros()
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;
    use proptest::prelude::*;

    /// The manual's encoder, 13 bit single-turn and 12 bit multi-turn.
    fn encoder(scaling: Option<(u32, u32)>) -> Result<Position, ScalingError> {
        let scaling = scaling.map(|(units_per_rev, total_range)| Scaling { units_per_rev, total_range });
        Position::new(8192, 4096, CodeSequence::Cw, scaling)
    }
    fn raw(revolution: u32, step: u32) -> u32 {
        revolution * 8192 + step
    }

    #[test]
    fn unscaled_positions_are_left_and_right_justified() {
        let position = encoder(None).expect("unscaled");
        assert_eq!((position.xist1_shift(), position.range()), (7, 1 << 25));
        for (raw, xist1, xist2) in [
            (raw(0, 0), 0x0000_0000, 0x0000_0000),
            (raw(0, 1), 0x0000_0080, 0x0000_0001),
            (raw(0, 8191), 0x000F_FF80, 0x0000_1FFF),
            (raw(1, 0), 0x0010_0000, 0x0000_2000),
            (raw(1, 4096), 0x0018_0000, 0x0000_3000),
            (raw(2047, 8191), 0x7FFF_FF80, 0x00FF_FFFF),
            (raw(4095, 8191), 0xFFFF_FF80, 0x01FF_FFFF),
            (raw(4096, 0), 0x0000_0000, 0x0000_0000),
        ] {
            let value = position.value(raw);
            assert_eq!((position.xist1(value), position.xist2(value)), (xist1, xist2), "{raw}");
        }
    }

    #[test]
    fn the_manuals_example_counts_to_12799() {
        // V20; manual 3.2.4 prints 11799.
        let position = encoder(Some((100, 12_800))).expect("the manual's example");
        assert_eq!((position.range(), position.xist1_shift()), (12_800, 18));
        assert_eq!((position.value(raw(127, 8191)), position.value(raw(128, 0))), (12_799, 0));
        assert_eq!(position.value(raw(123, 4096)), 12_350);
        assert_eq!((0..4096 * 8192).step_by(7).map(|raw| position.value(raw)).max(), Some(12_799));
    }

    #[test]
    fn the_dialogs_default_hits_the_limit_exactly() {
        let position = encoder(Some((4096, 256 << 16))).expect("4096 units in 4096 revolutions");
        assert_eq!((position.range(), position.xist1_shift()), (16_777_216, 8));
        assert_eq!(position.value(raw(4095, 8191)), 16_777_215);
    }

    #[test]
    fn the_value_jumps_at_the_physical_overflow_unless_the_period_divides_it() {
        for (units_per_rev, total_range, last, seamless) in [
            (100, 12_800, 12_799, true),
            (1000, 32_000, 31_999, true),
            (100, 10_000, 9_599, false),
            (100, 5_000, 4_599, false),
            (4096, 12_288, 4_095, false),
        ] {
            let position = encoder(Some((units_per_rev, total_range))).expect("allowed");
            assert_eq!(position.value(raw(4095, 8191)), last, "{units_per_rev} {total_range}");
            assert_eq!(position.value(raw(0, 0)), 0);
            assert_eq!(position.scaling().map(|scaling| scaling.is_seamless(4096)), Some(seamless));
            assert_eq!(seamless, last + 1 == total_range);
        }
    }

    #[test]
    fn a_scaling_that_breaks_a_rule_names_it_and_its_octets() {
        for (units_per_rev, total_range, octets, text) in [
            (0, 1, 16..20, "units per revolution is 0"),
            (8193, 1, 16..20, "8193 measuring units per revolution are more than the 8192 physical steps"),
            (100, 0, 20..24, "range is 0"),
            (100, 409_601, 20..24, "409601 is more than the 409600 units"),
        ] {
            let error = encoder(Some((units_per_rev, total_range))).expect_err("breaks a rule");
            assert_eq!(error.octets(), octets);
            assert!(error.to_string().contains(text), "{error}");
        }
        for (units_per_rev, total_range) in [(1, 1), (8192, 1 << 25), (100, 409_600), (8191, 1)] {
            assert!(encoder(Some((units_per_rev, total_range))).is_ok(), "{units_per_rev} {total_range}");
        }
    }

    #[test]
    fn the_shift_leaves_the_bits_of_the_range() {
        for (steps, revolutions, shift) in [
            (8192, 65_536, 3), // Baumer, 29 bit
            (8192, 4096, 7),
            (8192, 1, 19),
            (1, 1, 31),
            (65_536, 65_536, 0),
            (3600, 4096, 8),
        ] {
            let position = Position::new(steps, revolutions, CodeSequence::Cw, None).expect("unscaled");
            assert_eq!(position.xist1_shift(), shift, "{steps} x {revolutions}");
        }
        for (total_range, shift) in [(1, 31), (2, 31), (3, 30), (12_800, 18), (1 << 24, 8), (1 << 25, 7)] {
            assert_eq!(encoder(Some((8192, total_range))).map(|p| p.xist1_shift()), Ok(shift), "{total_range}");
        }
    }

    #[test]
    fn a_preset_moves_the_home_position() {
        let mut position = encoder(Some((100, 12_800))).expect("the manual's example");
        let here = raw(77, 1234);
        position.preset_absolute(here, 0);
        assert_eq!(position.value(here), 0);
        position.preset_absolute(here, 500);
        assert_eq!(position.value(here), 500);
        position.preset_absolute(here, -1);
        assert_eq!(position.value(here), 500, "a negative one is ignored");
        position.preset_relative(-501);
        assert_eq!(position.value(here), 12_799);
        position.preset_relative(0);
        assert_eq!(position.value(here), 12_799, "the default shift does nothing");
    }

    #[test]
    fn counter_clockwise_counts_down_where_clockwise_counts_up() {
        let down = Position::new(8192, 4096, CodeSequence::Ccw, None).expect("unscaled");
        assert_eq!((down.value(0), down.value(1)), (33_554_431, 33_554_430));
        assert_eq!((down.value(33_554_431), down.value(33_554_432)), (0, 33_554_431));
    }

    fn disc() -> impl Strategy<Value = (u32, u32)> {
        (0u32..=32, 1u32..=u32::MAX, 1u32..=u32::MAX).prop_map(|(share, steps, revolutions)| {
            let steps = (u64::from(steps) >> (32 - share).min(31)).max(1);
            let most = (1u64 << 32) / steps;
            (steps as u32, (u64::from(revolutions) % most + 1).min(most).min(u32::MAX.into()) as u32)
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4096))]

        #[test]
        fn the_value_is_the_formula_over_the_whole_parameter_space(
            (steps, revolutions) in disc(),
            units in any::<u32>(),
            range in any::<u32>(),
            (scaled, ccw) in any::<(bool, bool)>(),
            (raw, home, preset) in any::<(u32, u32, i32)>(),
            shift in any::<i32>(),
        ) {
            let units = units % steps + 1;
            let limit = (u64::from(units) * u64::from(revolutions)).min(u32::MAX.into());
            let range = (u64::from(range) % limit) as u32 + 1;
            let sequence = if ccw { CodeSequence::Ccw } else { CodeSequence::Cw };
            let scaling = scaled.then_some(Scaling { units_per_rev: units, total_range: range });
            let mut position = Position::new(steps, revolutions, sequence, scaling).expect("within the rules");

            let physical = u128::from(steps) * u128::from(revolutions);
            let total = if scaled { u128::from(range) } else { physical };
            let reference = |raw: u32, offset: u128| {
                let raw = u128::from(raw) % physical;
                let raw = if ccw { physical - 1 - raw } else { raw };
                let value = if scaled { raw * u128::from(units) / u128::from(steps) % total } else { raw };
                (value + offset) % total
            };
            prop_assert_eq!(u128::from(position.range()), total);
            prop_assert_eq!(u128::from(position.value(raw)), reference(raw, 0));
            position.preset_absolute(home, preset);
            let mut offset = 0;
            if preset >= 0 {
                offset = (preset as u128 % total + total - reference(home, 0)) % total;
                prop_assert_eq!(u128::from(position.value(home)), preset as u128 % total);
            }
            position.preset_relative(shift);
            offset = (offset as i128 + i128::from(shift)).rem_euclid(total as i128) as u128;
            prop_assert_eq!(u128::from(position.offset()), offset);
            let value = position.value(raw);
            prop_assert_eq!(u128::from(value), reference(raw, offset));
            prop_assert!(position.xist1_shift() <= 31);
            prop_assert_eq!(position.xist1(value) >> position.xist1_shift(), position.xist2(value));
        }
    }
}
