//! Diag: the data unit of `Slave_Diag`. EN 50170-2.

use super::header::Address;
use core::fmt;

/// Octet 4 while no master has parameterised the slave.
const NO_MASTER: u8 = 0xFF;

rules! {
    /// A diagnosis that cannot be read.
    pub struct DiagError, pub enum DiagRule {
        Length = "a diagnosis has at least 6 octets";
        Master = "the parameterising master is 0 to 126, or 255 for none";
    }
}

bits! {
    /// Octets 1..=3, `Station_Status_1` to `_3`; octet 1 is bits 23..=16. Some bits are set by the reading master, the
    /// slave sends them as 0.
    pub struct DiagStatus: u32 {
        /// Octet 1 bit 7, set by the master: the slave belongs to another master.
        master_lock MASTER_LOCK = 23, "Master_Lock";
        /// Octet 1 bit 6: the last `Set_Prm` was wrong.
        prm_fault PRM_FAULT = 22, "Prm_Fault";
        /// Octet 1 bit 5, set by the master: the answer made no sense.
        invalid_slave_response INVALID_SLAVE_RESPONSE = 21, "Invalid_Slave_Response";
        /// Octet 1 bit 4: the slave does not know the function asked for.
        not_supported NOT_SUPPORTED = 20, "Not_Supported";
        /// Octet 1 bit 3: extended blocks report something wrong.
        ext_diag EXT_DIAG = 19, "Ext_Diag";
        /// Octet 1 bit 2: the last `Chk_Cfg` was wrong.
        cfg_fault CFG_FAULT = 18, "Cfg_Fault";
        /// Octet 1 bit 1: no data exchange yet.
        station_not_ready STATION_NOT_READY = 17, "Station_Not_Ready";
        /// Octet 1 bit 0, set by the master: no answer.
        station_non_existent STATION_NON_EXISTENT = 16, "Station_Non_Existent";
        /// Octet 2 bit 7, set by the master: not in its parameter set.
        deactivated DEACTIVATED = 15, "Deactivated";
        /// Octet 2 bit 5.
        sync_mode SYNC_MODE = 13, "Sync_Mode";
        /// Octet 2 bit 4.
        freeze_mode FREEZE_MODE = 12, "Freeze_Mode";
        /// Octet 2 bit 3: the watchdog runs.
        wd_on WD_ON = 11, "WD_On";
        /// Octet 2 bit 2, always 1 from a slave. It has no name in the standard.
        by_slave BY_SLAVE = 10, "(always 1)";
        /// Octet 2 bit 1: the master goes on reading the diagnosis and exchanges no data.
        stat_diag STAT_DIAG = 9, "Stat_Diag";
        /// Octet 2 bit 0: the slave wants to be parameterised.
        prm_req PRM_REQ = 8, "Prm_Req";
        /// Octet 3 bit 7: more diagnosis than fits.
        ext_diag_overflow EXT_DIAG_OVERFLOW = 7, "Ext_Diag_Overflow";
    }
}

/// The data unit of `Slave_Diag`. Shown as the standard's names of the bits that are set.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Diagnosis<'a> {
    /// Octets 1..=3.
    pub status: DiagStatus,
    /// Octet 4, the master that parameterised the slave.
    pub master: Option<Address>,
    /// Octets 5..=6, `Ident_Number`.
    pub ident: u16,
    /// Octets from 7 on, extended blocks; the encoders send none.
    pub extended: &'a [u8],
}

impl<'a> Diagnosis<'a> {
    /// Octets of the part that every slave sends.
    pub const LEN: usize = 6;

    /// Reads the data unit.
    ///
    /// # Errors
    /// Fewer than 6 octets, or a master that cannot be.
    pub fn parse(du: &'a [u8]) -> Result<Self, DiagError> {
        let &[octet_1, octet_2, octet_3, master, ident_high, ident_low, ref extended @ ..] = du else {
            return Err(DiagError::new(du.len(), DiagRule::Length, du.len() as u32));
        };
        let master = match Address::new(master) {
            Some(address) if !address.is_broadcast() => Some(address),
            None if master == NO_MASTER => None,
            _ => return Err(DiagError::new(4, DiagRule::Master, master)),
        };
        Ok(Self {
            status: DiagStatus(u32::from_be_bytes([0, octet_1, octet_2, octet_3])),
            master,
            ident: u16::from_be_bytes([ident_high, ident_low]),
            extended,
        })
    }
    /// Octets 1..=6, without extended blocks.
    pub fn emit(&self) -> [u8; Diagnosis::LEN] {
        let [_, octet_1, octet_2, octet_3] = self.status.0.to_be_bytes();
        let [ident_high, ident_low] = self.ident.to_be_bytes();
        let master = self.master.map_or(NO_MASTER, Address::get);
        [octet_1, octet_2, octet_3, master, ident_high, ident_low]
    }
}
impl fmt::Display for Diagnosis<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The bit that is always 1 tells nobody anything.
        fmt::Display::fmt(&self.status.with(DiagStatus::BY_SLAVE, false), f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    #[test]
    fn the_diagnoses_of_a_real_start_up_read_by_name() {
        for (octets, master, text) in [
            ([0x02, 0x05, 0x00, 0xFF, 0x80, 0xE0], None, "Station_Not_Ready, Prm_Req"),
            ([0x00, 0x0E, 0x00, 0x01, 0x80, 0xE0], Address::new(1), "WD_On, Stat_Diag"),
            ([0x00, 0x0C, 0x00, 0x01, 0x80, 0xE0], Address::new(1), "WD_On"),
            ([0x42, 0x05, 0x00, 0xFF, 0x80, 0xF9], None, "Prm_Fault, Station_Not_Ready, Prm_Req"),
            ([0x00, 0x04, 0x00, 0x02, 0x80, 0xF9], Address::new(2), "none"),
        ] {
            let diagnosis = Diagnosis::parse(&octets).unwrap();
            assert_eq!((diagnosis.master, diagnosis.to_string().as_str()), (master, text));
            assert_eq!(diagnosis.emit(), octets);
        }
    }

    #[test]
    fn extended_blocks_are_kept_and_strange_masters_refused() {
        let octets = [0x08, 0x0C, 0x80, 0x02, 0x80, 0xF9, 0x03, 0x81, 0x07];
        assert_eq!(Diagnosis::parse(&octets).unwrap().extended, [0x03, 0x81, 0x07]);
        assert_eq!(Diagnosis::parse(&octets[..5]), Err(DiagError::new(5, DiagRule::Length, 5u8)));
        for master in [127, 128, 254] {
            let octets = [0, 4, 0, master, 0, 0];
            assert_eq!(Diagnosis::parse(&octets), Err(DiagError::new(4, DiagRule::Master, master)));
        }
    }
}
