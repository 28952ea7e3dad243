//! Estimators: the rules that every node keeps.

#![allow(clippy::unwrap_used)]

mod conformance;
