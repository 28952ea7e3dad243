//! What is done with recorded data, as functions of option structs: work as a value, for whoever calls it.
//!
//! A job is a struct of options, which is read from a command line, from JSON ([`asked`]), and described by a schema. What is remarked
//! on the way, and how far it has come, goes to a [`Watch`](athermal_core::watch::Watch). No job knows a terminal, or prints.
//!
//! | job | gives |
//! |---|---|
//! | [`fit::Fit`] | a fitted model, and how the fit went |
//! | [`blocks::BlockOptions`] | the sums of days, made or kept, and a fit on them |
//! | [`predict::Predict`] | what a model puts out at each row |
//! | [`evaluate::Evaluate`] | scores |
//! | [`report::Report`] | what a model is worth, as facts, text and a page |
//! | [`diagnose::Diagnose`] | why it predicts as well as it does |
//! | [`compare::Compare`] | several graphs, fitted and scored on the same data |
//! | [`init::Init`] | a starter graph |
//! | [`simulate::Simulate`] | the rows of a simulated machine |

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod asked;
pub mod beyond;
pub mod blocks;
pub mod compare;
pub mod data;
pub mod diagnose;
pub mod doubts;
pub mod evaluate;
pub mod faults;
pub mod fit;
pub mod init;
pub mod model;
mod noise;
pub mod path;
pub mod predict;
pub mod refused;
pub mod remarks;
pub mod report;
mod rows;
pub mod scored;
pub mod simulate;
pub mod thinned;
mod threads;
mod unscored;

pub use rows::{RowsId, Summed};
pub use threads::Threads;

use serde_json::Value;

/// What a job found out, before it is shown.
#[derive(Debug)]
pub struct Found {
    /// For people.
    pub text: String,
    /// For programs.
    pub facts: Value,
}
