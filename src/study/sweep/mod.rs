//! Sweeps: one scenario many times, with other parameters and other draws, on all cores.
//!
//! ```text
//! sweep file -> Definition -> Plan ---------> jobs -> crew of workers -> Journal -> results.csv, summary.csv
//!               axes, skips   combination:            one run after        a line
//!               figures       refused, run            the other each       per run
//! ```
//!
//! A run is told by its [key](key::RunKey) alone: what is in the [journal] is never computed twice, whatever
//! ended the sweep before and however its file has grown since. Tables are written from the journal in the order of the
//! plan, so that they do not tell how many threads, calls or machines there were.

mod ascending;
mod attempt;
pub mod axis;
pub mod cell;
pub mod combination;
pub mod command;
pub mod crew;
pub mod definition;
mod format;
mod index;
pub mod journal;
pub mod key;
pub mod merge;
mod page;
pub mod parameter;
#[cfg(feature = "parquet")]
mod parquet;
mod picture;
pub mod plan;
mod pooled;
pub(super) mod results;
mod row;
mod sample;
pub mod shard;
pub mod skip;
pub mod store;
mod summary;
mod temporary;
mod worker;

pub(super) use attempt::attempt;
pub use attempt::is_at_work;
