//! Numbers: fits, scores and predictions against other programs, plain arithmetic and recorded data. The folders beside hold what
//! `generate.py` of each wrote.

#![allow(clippy::unwrap_used)]

#[path = "../workbench/mod.rs"]
mod workbench;

mod changed_world;
mod coefficients;
mod compensation;
mod defaults;
mod estimators;
mod in_sample;
mod missing_truths;
mod new_machine;
mod novelty;
mod planned;
mod random_worlds;
mod redundancy;
mod reference_figures;
mod scores_by_hand;
mod shared;
mod starter_against_ridge;
mod starter_graphs;
mod state_space;
mod streaming;
mod uncertainty;
mod unlike_machines;
mod unusual_loads;
mod watches;
