//! Tolerance: how far one value of a scenario can go until what is expected no longer holds.
//!
//! ```text
//!           Scale            Search                 Trial                        Outcome
//! from, to -------> numbers -------> one number --> runs 1, 2, ... on a crew --> page, table, JSON, picture
//!                            <------ holds or not <-- sequential test
//! ```
//!
//! | a value | what becomes of it |
//! |---|---|
//! | the scenario refuses it | does not hold: there the scenario ends; the rule is told |
//! | nothing is drawn | one run decides |
//! | anything else | runs with the seeds s, s + 1, ... until the sequential test has an answer; the same seeds for every value |
//!
//! A run that breaks off counts as one that does not hold, and is named. The test sees the runs in the order of their
//! seeds, whoever has finished when: the answer does not tell how many threads there were.

pub mod command;
pub mod draws;
mod json;
pub mod outcome;
mod page;
mod picture;
pub mod scale;
mod table;
pub mod trial;
