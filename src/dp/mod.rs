//! DP: the services of the master and the slave, their state machines and the isochronous cycle.

pub mod class2;
pub mod handler;
pub mod image;
pub mod iso;
pub mod master;
pub mod ms1;
pub mod ms2;
pub mod slave;
pub mod supervision;

use crate::wire::Sap;

/// Destination and source SAP of Slave_Diag.
pub const SLAVE_DIAG: (Sap, Sap) = (Sap::SLAVE_DIAG, Sap::MASTER_MS0);
/// Destination and source SAP of Get_Cfg.
pub const GET_CFG: (Sap, Sap) = (Sap::GET_CFG, Sap::MASTER_MS0);
/// Destination and source SAP of RD_Inp.
pub const RD_INP: (Sap, Sap) = (Sap::RD_INP, Sap::MASTER_MS0);
/// Destination and source SAP of RD_Outp.
pub const RD_OUTP: (Sap, Sap) = (Sap::RD_OUTP, Sap::MASTER_MS0);
/// Destination and source SAP of Set_Prm.
pub const SET_PRM: (Sap, Sap) = (Sap::SET_PRM, Sap::MASTER_MS0);
/// Destination and source SAP of Chk_Cfg.
pub const CHK_CFG: (Sap, Sap) = (Sap::CHK_CFG, Sap::MASTER_MS0);
/// Destination and source SAP of Global_Control.
pub const GLOBAL_CONTROL: (Sap, Sap) = (Sap::GLOBAL_CONTROL, Sap::MASTER_MS0);
/// Group 8, the clock's: bit 7 of Group_Ident (Set_Prm octet 7) and of Group_Select (Global_Control octet 2).
pub const CLOCK_GROUP: u8 = 0x80;
