//! A graph is replaced while it runs: nothing is lost, repeated or reordered, and reports tell the truth.

mod allocation;
mod blending;
mod course;
mod failures;
mod mirrored;
mod model;
mod planted;
mod properties;
mod random_graph;
mod session;
mod snapshots;
mod standing;
mod threads;
mod versions;
