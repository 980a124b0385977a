//! Statistics: what can be said of many runs, and how surely. Pure functions and small values; nothing here reads a
//! file, draws a number or knows a clock.
//!
//! Whatever is counted is an integer and merges in any order. Whatever is computed of it uses `libm` and no platform
//! maths, and depends on the counts alone: the same digits on every machine, for any number of threads and any order.

pub mod aggregate;
pub mod batch_means;
pub mod beta;
pub mod bins;
pub mod bisection;
pub mod confidence;
pub mod interval;
pub mod normal;
pub mod pool;
pub mod probability;
pub mod quantile;
pub mod sequential;
pub mod steady_state;
pub mod stop_rule;
pub mod student;
