//! Studies: scenario files, runs, what they record, and what is made of it. The only layer that knows files,
//! threads and reports.

pub mod plot;
pub mod row;
