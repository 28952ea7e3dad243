//! Combiners: the rules that every node keeps, and their weights against oracles.

#![allow(clippy::unwrap_used)]

mod conformance;
mod hedge;
mod oracles;
mod weights;
