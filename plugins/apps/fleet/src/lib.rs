//! Fits, scores and compares the machines of a fleet.
//!
//! | part | decides |
//! |---|---|
//! | [`fit_machine`] | what the rows of a machine and a graph give: the bytes of a model |
//! | [`RowsId`] | by what rows are known again |
//! | `batches` | how rows come as batches of Arrow |
//! | [`found`] | which files are of which machine |
//! | [`pool`] | how jobs are given to processes, and what happens when one dies |
//! | [`manifest`] | what a folder of models remembers, so that a fit is resumed |
//! | [`doubts`] | what was left out of the data of a machine, and what may be wrong with them |
//! | [`figure`], [`spread`], [`unlike`] | how a machine stands beside the others |
//! | `commands` | `athermal fleet` |

#![cfg_attr(test, allow(clippy::unwrap_used))]

#[cfg(feature = "arrow")]
pub mod batches;
mod commands;
pub mod doubts;
pub mod figure;
pub mod found;
pub mod job;
mod machine;
pub mod manifest;
#[cfg(feature = "arrow")]
mod once;
pub mod page;
pub mod pool;
pub mod spread;
pub mod unlike;
mod worker;

pub use athermal_jobs::RowsId;
pub use machine::{MachineError, MachineFit, fit_machine};
#[cfg(feature = "arrow")]
pub use once::Once;
