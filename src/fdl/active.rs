//! The active station.
