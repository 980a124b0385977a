//! The world between the stations: crystals, noise, moving shafts and the order of events.
//!
//! Only this layer and those above it know true time. Everything here is decided by integers, draws from streams that
//! have a name, and computes transcendental functions in Rust, so a run is the same on every machine.

pub mod bus;
pub mod crystal;
pub mod cut;
pub mod fault;
pub mod fingerprint;
pub mod jitter;
pub mod motion;
pub mod network;
pub mod noise;
pub mod queue;
pub mod record;
pub mod share;
pub mod topology;
