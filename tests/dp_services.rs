//! DP services in operation: Sync, Freeze, Clear, diagnosis; a slave alone, and whole networks.

mod slave;
