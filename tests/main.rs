//! The tests of the whole, in one binary.

mod determinism;
mod devices;
mod layers;
mod manual;
mod rig;
mod scenarios;
mod support;
