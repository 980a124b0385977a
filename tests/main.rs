//! The tests of the whole, in one binary.

mod determinism;
mod layers;
mod support;
