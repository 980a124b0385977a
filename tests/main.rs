//! The tests of the whole, in one binary.

mod cli;
mod determinism;
mod foreign;
mod golden;
mod layers;
mod props;
mod startup;
mod support;
