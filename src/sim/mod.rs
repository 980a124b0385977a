//! The world between the stations: true time, crystals, and what reads a run.

pub mod crystal;
pub mod record;
