//! The tests of the whole, in one binary.

mod determinism;
mod devices;
mod layers;
mod manual;
mod options;
mod scenarios;
mod support;
