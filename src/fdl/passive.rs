//! The passive station.
