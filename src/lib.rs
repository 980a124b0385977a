#![cfg_attr(not(feature = "sim"), no_std)]
//! isodp: a deterministic, telegram-accurate simulator of isochronous PROFIBUS DP (DP-V2) networks.

extern crate alloc;

pub mod fdl;
pub mod observation;
#[cfg(feature = "sim")]
pub mod sim;
#[cfg(feature = "sim")]
pub mod study;
pub mod time;
pub mod wire;
