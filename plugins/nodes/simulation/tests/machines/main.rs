//! Simulated machines: the rules that every machine keeps, the same bytes for a seed, drift of the published size.

#![allow(clippy::unwrap_used)]

mod changes;
mod conformance;
mod determinism;
mod disturbances;
mod drift;
mod spread;
