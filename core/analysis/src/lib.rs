//! What a fitted graph is worth on recorded data, and where its drift comes from.
//!
//! [`diagnosis`] finds lags, responses and dead sensors in a recording; [`report`] collects the facts about a model as one page;
//! [`chart`] draws both as SVG, and [`drawing`] a graph itself. [`figures`] and [`markup`] write numbers, tables and names for people.
//!
//! Read them in this order: a command of the command line calls one function of [`diagnosis`] or [`report`] and prints its result.

pub mod chart;
pub mod diagnosis;
pub mod drawing;
pub mod markup;
pub mod report;

pub use athermal_core::figures;
