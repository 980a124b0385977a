//! Statistics: what can be said of many runs, and how surely. Pure functions and small values; nothing here reads a
//! file, draws a number or knows a clock.
//!
//! Whatever is counted is an integer and merges in any order. Whatever is computed of it uses `libm` and no platform
//! maths, and depends on the counts alone: the same digits on every machine, for any number of threads and any order.

pub mod beta;
pub mod confidence;
pub mod interval;
pub mod normal;
pub mod probability;
pub mod sequential;
pub mod student;
