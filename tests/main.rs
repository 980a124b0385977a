//! The tests of the whole, in one binary.

mod acyclic;
mod cli;
mod determinism;
mod devices;
mod dp_services;
mod dxb;
mod encoder;
mod encoder_scenarios;
mod foreign;
mod golden;
mod gsd;
mod interop;
mod layers;
mod live_list;
mod manual;
mod options;
mod plan;
mod props;
mod rig;
mod ring;
mod scenarios;
mod startup;
mod support;
mod swarm;
mod topology;
