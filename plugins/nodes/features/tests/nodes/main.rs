//! Features: the rules that every node keeps, and their values against oracles.

#![allow(clippy::unwrap_used)]

mod conformance;
mod oracles;
