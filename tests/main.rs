//! The tests of the whole, in one binary.

mod determinism;
mod encoder;
mod encoder_scenarios;
mod layers;
mod manual;
mod rig;
mod scenarios;
mod support;
