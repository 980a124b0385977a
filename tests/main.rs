//! The tests of the whole, in one binary.

mod cli;
mod determinism;
mod devices;
mod foreign;
mod golden;
mod layers;
mod manual;
mod options;
mod props;
mod scenarios;
mod startup;
mod support;
