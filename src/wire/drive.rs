//! Drive: standard telegram 81 of the PROFIdrive profile, the process data of an encoder. Manual 2.2.

/// A sign of life, 0..=15. 0 says that it does not run; a running one goes from 1 to 15 and on to 1.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct SignOfLife(u8);

impl SignOfLife {
    /// Not running.
    pub const NONE: Self = Self(0);
    /// Where a running one starts.
    pub const FIRST: Self = Self(1);
    /// Where a running one turns around.
    pub const LAST: Self = Self(15);

    /// The sign of life `value`, `None` above 15.
    pub const fn new(value: u8) -> Option<Self> {
        if value <= Self::LAST.0 { Some(Self(value)) } else { None }
    }
    /// The value, 0..=15.
    pub const fn get(self) -> u8 {
        self.0
    }
    /// Whether it runs: 1..=15.
    pub const fn is_valid(self) -> bool {
        self.0 != 0
    }
    /// Its successor: 1 after 15, and 1 after 0.
    #[must_use]
    pub const fn next(self) -> Self {
        if self.0 < Self::LAST.0 { Self(self.0 + 1) } else { Self::FIRST }
    }
    /// Bits 15..=12 of a word.
    /// The sign in the low four bits of `value`.
    pub const fn masked(value: u8) -> Self {
        Self(value & 0x0F)
    }
    /// The sign in bits 15..=12 of STW2 or ZSW2.
    pub const fn from_word(word: u16) -> Self {
        Self((word >> 12) as u8)
    }
    /// STW2 or ZSW2 with this sign in bits 15..=12, the unused bits 0.
    pub const fn to_word(self) -> u16 {
        (self.0 as u16) << 12
    }
}
impl core::fmt::Display for SignOfLife {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        core::fmt::Display::fmt(&self.0, f)
    }
}

/// Control word 2: the master's sign of life in bits 15..=12, the rest not used.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Stw2(pub u16);

/// Status word 2: the slave's sign of life in bits 15..=12, the rest not used.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Zsw2(pub u16);

impl Stw2 {
    /// The master's sign of life.
    pub const fn sign_of_life(self) -> SignOfLife {
        SignOfLife::from_word(self.0)
    }
    /// The same word with this sign of life.
    #[must_use]
    pub const fn with_sign_of_life(self, sign: SignOfLife) -> Self {
        Self(self.0 & 0x0FFF | sign.to_word())
    }
}
impl Zsw2 {
    /// The slave's sign of life.
    pub const fn sign_of_life(self) -> SignOfLife {
        SignOfLife::from_word(self.0)
    }
    /// The same word with this sign of life.
    #[must_use]
    pub const fn with_sign_of_life(self, sign: SignOfLife) -> Self {
        Self(self.0 & 0x0FFF | sign.to_word())
    }
}

bits! {
    /// Sensor control word `G1_STW`; bits 10..=0 are reserved.
    pub struct G1Stw: u16 {
        /// Bit 11: the preset shifts the position (relative) instead of setting it (absolute).
        home_mode HOME_MODE = 11, "home position mode";
        /// Bit 12: set or shift the home position with the rising edge.
        preset PRESET = 12, "set preset / request shift";
        /// Bit 13: transmit the absolute position in `G1_XIST2`.
        absolute_value ABSOLUTE_VALUE = 13, "request absolute value cyclically";
        /// Bit 14: park; no error messages.
        parking PARKING = 14, "activate parking sensor";
        /// Bit 15: acknowledge a sensor error.
        acknowledge ACKNOWLEDGE = 15, "acknowledge sensor error";
    }
}
impl G1Stw {
    /// The reserved bits that are set, which is a command not supported (D19).
    pub const fn reserved(self) -> u16 {
        self.unnamed()
    }
}

bits! {
    /// Sensor status word `G1_ZSW`; bits 10..=0 are reserved.
    pub struct G1Zsw: u16 {
        /// Bit 11: an error is being acknowledged, which takes longer than a bus cycle.
        acknowledging ACKNOWLEDGING = 11, "acknowledgement in process";
        /// Bit 12: the home position was set or shifted.
        preset_done PRESET_DONE = 12, "preset / shift executed";
        /// Bit 13: `G1_XIST2` carries the absolute position.
        absolute_value ABSOLUTE_VALUE = 13, "transmit absolute value cyclically";
        /// Bit 14: parked.
        parking PARKING = 14, "parking sensor activated";
        /// Bit 15: sensor error, `G1_XIST2` carries its code.
        error ERROR = 15, "sensor error";
    }
}
impl G1Zsw {
    /// The reserved bits that are set.
    pub const fn reserved(self) -> u16 {
        self.unnamed()
    }
}

/// Output data of telegram 81, master to encoder.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Outputs81 {
    /// Octets 1..=2.
    pub stw2: Stw2,
    /// Octets 3..=4.
    pub g1_stw: G1Stw,
}

impl Outputs81 {
    /// Octets of the data unit.
    pub const LEN: usize = 4;

    /// Reads a data unit of exactly 4 octets.
    pub const fn parse(du: &[u8]) -> Option<Self> {
        match *du {
            [s0, s1, g0, g1] => {
                Some(Self { stw2: Stw2(u16::from_be_bytes([s0, s1])), g1_stw: G1Stw(u16::from_be_bytes([g0, g1])) })
            }
            _ => None,
        }
    }
    /// The data unit.
    pub const fn emit(&self) -> [u8; Self::LEN] {
        let [s0, s1] = self.stw2.0.to_be_bytes();
        let [g0, g1] = self.g1_stw.0.to_be_bytes();
        [s0, s1, g0, g1]
    }
}

/// Input data of telegram 81, encoder to master.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Inputs81 {
    /// Octets 1..=2.
    pub zsw2: Zsw2,
    /// Octets 3..=4.
    pub g1_zsw: G1Zsw,
    /// Octets 5..=8, position, left-justified by the shift of P979.
    pub xist1: u32,
    /// Octets 9..=12, absolute position, right-justified, or the code of an error.
    pub xist2: u32,
}

impl Inputs81 {
    /// Octets of the data unit.
    pub const LEN: usize = 12;

    /// Reads a data unit of exactly 12 octets.
    pub const fn parse(du: &[u8]) -> Option<Self> {
        match *du {
            [z0, z1, g0, g1, a0, a1, a2, a3, b0, b1, b2, b3] => Some(Self {
                zsw2: Zsw2(u16::from_be_bytes([z0, z1])),
                g1_zsw: G1Zsw(u16::from_be_bytes([g0, g1])),
                xist1: u32::from_be_bytes([a0, a1, a2, a3]),
                xist2: u32::from_be_bytes([b0, b1, b2, b3]),
            }),
            _ => None,
        }
    }
    /// The data unit.
    pub const fn emit(&self) -> [u8; Self::LEN] {
        let [z0, z1] = self.zsw2.0.to_be_bytes();
        let [g0, g1] = self.g1_zsw.0.to_be_bytes();
        let [a0, a1, a2, a3] = self.xist1.to_be_bytes();
        let [b0, b1, b2, b3] = self.xist2.to_be_bytes();
        [z0, z1, g0, g1, a0, a1, a2, a3, b0, b1, b2, b3]
    }
    /// The error that `G1_XIST2` reports, if bit 15 of `G1_ZSW` is set and the encoders know the code.
    pub fn fault(&self) -> Option<SensorFault> {
        if self.g1_zsw.error() { u16::try_from(self.xist2).ok().and_then(SensorFault::from_code) } else { None }
    }
}

codes! {
    /// The error codes that the encoders put into `G1_XIST2`. Manual 5.3.
    pub enum SensorFault: u16 {
        /// Command not supported.
        Unsupported = 0x0F01, "command not supported";
        /// The master's sign of life failed.
        LifeSign = 0x0F02, "master's sign of life fault";
        /// Synchronisation to the clock failed.
        Clock = 0x0F04, "synchronisation fault";
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    #[test]
    fn a_sign_of_life_traverses_1_to_15_and_never_returns_to_0() {
        let mut sign = SignOfLife::NONE;
        let traversed: Vec<u8> = core::iter::repeat_with(|| {
            sign = sign.next();
            sign.get()
        })
        .take(17)
        .collect();
        assert_eq!(traversed, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 1, 2]);
        assert!(!SignOfLife::NONE.is_valid() && SignOfLife::LAST.is_valid());
        assert_eq!(SignOfLife::new(16), None);
    }

    #[test]
    fn a_sign_of_life_leaves_the_unused_bits_alone() {
        let word = Stw2(0x0ABC).with_sign_of_life(SignOfLife::LAST);
        assert_eq!((word, word.sign_of_life()), (Stw2(0xFABC), SignOfLife::LAST));
    }

    #[test]
    fn reserved_bits_are_the_eleven_low_ones() {
        assert_eq!(G1Stw(0xFFFF).reserved(), 0x07FF);
        assert_eq!(G1Zsw(0xF800).reserved(), 0);
    }

    #[test]
    fn a_fault_needs_the_error_bit_and_a_known_code() {
        let inputs = Inputs81 { g1_zsw: G1Zsw::ERROR, xist2: 0x0F04, ..Inputs81::default() };
        assert_eq!(inputs.fault(), Some(SensorFault::Clock));
        assert_eq!(Inputs81 { g1_zsw: G1Zsw::default(), ..inputs }.fault(), None);
        assert_eq!(Inputs81 { xist2: 0x0001_0F04, ..inputs }.fault(), None);
    }
}
