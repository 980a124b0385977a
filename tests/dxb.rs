//! Slave-to-slave communication (DXB): a subscriber alone, and whole networks.

mod alone;
mod network;

pub(crate) use network::TESTS;
