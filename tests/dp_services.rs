//! DP services in operation: Sync, Freeze, Clear, diagnosis; a slave alone, whole networks, shipped scenarios.

mod network;
mod scenarios;
mod slave;

pub(crate) use scenarios::TESTS;
