//! Control: the data unit of `Global_Control`, the clock among them. EN 50170-2.

rules! {
    /// A `Global_Control` that cannot be read.
    pub struct ControlError, pub enum ControlRule {
        Length = "a Global_Control has 2 octets";
        Reserved = "bits 7, 6 and 0 of the control command are 0";
    }
}

const SYNC: u8 = 0x20;
const UNSYNC: u8 = 0x10;
const FREEZE: u8 = 0x08;
const UNFREEZE: u8 = 0x04;
const CLEAR: u8 = 0x02;

/// The two octets of `Global_Control`.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
#[allow(clippy::struct_excessive_bools)] // Five independent bits of one octet.
pub struct GlobalControl {
    /// Octet 1 bit 5: outputs change only with the next such telegram.
    pub sync: bool,
    /// Octet 1 bit 4: back to outputs that change at once.
    pub unsync: bool,
    /// Octet 1 bit 3: inputs are taken with the next such telegram.
    pub freeze: bool,
    /// Octet 1 bit 2: back to inputs that are always fresh.
    pub unfreeze: bool,
    /// Octet 1 bit 1: outputs are cleared; its absence is Operate.
    pub clear: bool,
    /// Octet 2: bit i selects group i + 1, 0 all slaves.
    pub groups: u8,
}

impl GlobalControl {
    /// Octets of the data unit.
    pub const LEN: usize = 2;
    /// Nothing but Operate, to all slaves.
    pub const OPERATE: Self =
        Self { sync: false, unsync: false, freeze: false, unfreeze: false, clear: false, groups: 0 };
    /// Clear, to all slaves.
    pub const CLEAR: Self = Self { clear: true, ..Self::OPERATE };
    /// The clock: `00 80`. Its last bit is the start of the DP cycle (VPC3+ driver, D5).
    pub const SYNCH: Self = Self { groups: 0x80, ..Self::OPERATE };
    /// The data unit of the clock.
    pub const SYNCH_OCTETS: [u8; Self::LEN] = [0x00, 0x80];

    /// Reads the data unit.
    ///
    /// # Errors
    /// Not 2 octets, or a reserved bit is set.
    pub fn parse(du: &[u8]) -> Result<Self, ControlError> {
        let &[command, groups] = du else {
            return Err(ControlError::new(du.len(), ControlRule::Length, du.len() as u32));
        };
        if command & !(SYNC | UNSYNC | FREEZE | UNFREEZE | CLEAR) != 0 {
            return Err(ControlError::new(1, ControlRule::Reserved, command));
        }
        let bit = |mask| command & mask != 0;
        Ok(Self {
            sync: bit(SYNC),
            unsync: bit(UNSYNC),
            freeze: bit(FREEZE),
            unfreeze: bit(UNFREEZE),
            clear: bit(CLEAR),
            groups,
        })
    }
    /// The data unit.
    pub fn emit(&self) -> [u8; Self::LEN] {
        let bit = |on, mask| if on { mask } else { 0 };
        let command = bit(self.sync, SYNC)
            | bit(self.unsync, UNSYNC)
            | bit(self.freeze, FREEZE)
            | bit(self.unfreeze, UNFREEZE)
            | bit(self.clear, CLEAR);
        [command, self.groups]
    }
    /// Whether this is the clock.
    pub fn is_synch(&self) -> bool {
        *self == Self::SYNCH
    }
    /// Whether a slave with this `Group_Ident` is meant.
    pub const fn selects(&self, group_ident: u8) -> bool {
        self.groups == 0 || self.groups & group_ident != 0
    }
    /// Whether outputs are held from now on; Unsync wins. `None` leaves it as it is.
    pub const fn sync_mode(&self) -> Option<bool> {
        match (self.unsync, self.sync) {
            (true, _) => Some(false),
            (false, true) => Some(true),
            (false, false) => None,
        }
    }
    /// Whether inputs are held from now on; Unfreeze wins. `None` leaves it as it is.
    pub const fn freeze_mode(&self) -> Option<bool> {
        match (self.unfreeze, self.freeze) {
            (true, _) => Some(false),
            (false, true) => Some(true),
            (false, false) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_is_refused_or_written_again() {
        for command in 0..=255u8 {
            match GlobalControl::parse(&[command, 0x80]) {
                Ok(control) => {
                    assert_eq!(control.emit(), [command, 0x80]);
                    assert_eq!(control.is_synch(), command == 0);
                    assert!(!(control.unsync && control.sync_mode() == Some(true)));
                    assert!(!(control.unfreeze && control.freeze_mode() == Some(true)));
                }
                Err(error) => assert_ne!((error.rule, command & 0xC1), (ControlRule::Reserved, 0)),
            }
        }
        assert!(GlobalControl::parse(&[0]).is_err());
    }

    #[test]
    fn group_0_means_everybody() {
        assert!(GlobalControl::OPERATE.selects(0));
        assert!(GlobalControl::SYNCH.selects(0x81));
        assert!(!GlobalControl::SYNCH.selects(0x01));
    }
}
