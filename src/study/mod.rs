//! Studies: scenario files, runs, what they record, and what is made of it. The only layer that knows files,
//! threads and reports.

pub mod acyclic;
pub mod baseline;
pub mod batch;
pub mod budget;
pub mod build;
pub mod compare;
pub mod count;
pub mod devices;
pub mod difference;
pub mod episode;
pub mod event_budget;
pub mod export;
pub mod figure;
pub mod first_fault;
pub mod flight;
pub mod gsd;
pub mod histogram;
pub mod invocation;
pub mod layout;
pub mod live_list;
pub mod masters;
pub mod measure;
pub mod metric;
pub mod plan;
pub mod plot;
pub mod pool;
pub mod quantity;
pub mod replay;
pub mod report;
pub mod row;
pub mod run;
#[cfg(test)]
mod sample;
pub mod scenario;
pub mod statistics;
pub mod steady;
pub mod summary;
pub mod sweep;
mod tally;
pub mod tolerance;
pub mod topology;
pub mod trace;
pub mod verdict;
pub mod what_if;
