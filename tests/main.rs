//! The tests of the whole, in one binary.

mod determinism;
mod encoder;
mod encoder_scenarios;
mod layers;
mod rig;
mod support;
