//! DP: the services of the master and the slave, their state machines and the isochronous cycle.

pub mod handler;
pub mod image;
pub mod iso;
pub mod master;
pub mod ms1;
pub mod slave;

use crate::wire::Sap;

/// Destination and source SAP of Slave_Diag.
pub const SLAVE_DIAG: (Sap, Sap) = (Sap::SLAVE_DIAG, Sap::MASTER_MS0);
/// Destination and source SAP of Get_Cfg.
pub const GET_CFG: (Sap, Sap) = (Sap::GET_CFG, Sap::MASTER_MS0);
/// Destination and source SAP of Set_Prm.
pub const SET_PRM: (Sap, Sap) = (Sap::SET_PRM, Sap::MASTER_MS0);
/// Destination and source SAP of Chk_Cfg.
pub const CHK_CFG: (Sap, Sap) = (Sap::CHK_CFG, Sap::MASTER_MS0);
/// Destination and source SAP of Global_Control.
pub const GLOBAL_CONTROL: (Sap, Sap) = (Sap::GLOBAL_CONTROL, Sap::MASTER_MS0);
