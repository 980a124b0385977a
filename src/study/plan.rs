//! Planner: what a network will do, without simulating it.
//!
//! ```text
//! t0                                          T_O                    T_I       t0 + T_DP
//! |- T_ID2 -| request | reply |- T_ID1 -| ... | GAP | token | spare |           | SYNCH |
//! |------------------- T_DX ------------------|
//! ```
//! Everything counts from t0, the last bit of SYNCH at the master (Model: D1). [`Plan::of`] takes the longest T_SDR that
//! each device may need, [`Plan::expected`] the one that it has (Model: D2).
//!
//! | file | what |
//! |---|---|
//! | cycle | the arithmetic of the cycle, a dead time, a free-running network |
//! | ring | the token's visits to other active stations |
//! | finding | what a rule finds: both sides, the margin, the nearest value that would do |
//! | rules | the registry of all rules between times; reading a scenario uses the same |
//! | proposal | a set of values that keeps all rules, with the shortest T_DP |
//! | written | a proposal as the scenario that was read with other values |
//! | octets | Set_Prm and Chk_Cfg of every slave, octet by octet |
//! | page, data | the plan as a page for people and as JSON |
//! | command | `isodp plan` |

pub mod command;
mod cycle;
mod data;
pub mod finding;
pub mod octets;
mod page;
pub mod proposal;
pub mod ring;
pub mod rules;
mod written;

pub use cycle::*;
pub use written::written;
