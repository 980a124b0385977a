//! The encoder against its manual, section by section, octet by octet, without a simulator.
//!
//! The names of the tests begin with the section; `src/device/mod.rs` lists them all.

mod data_exchange;
mod manual;
mod parameters;
mod records;
mod slave;
mod start_up;
