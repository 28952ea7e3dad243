//! What is exported computes what the engine computes, to the bit.

// Shared functions of tests are none of `cfg(test)`.
#![allow(clippy::unwrap_used)]

mod command;
mod fmu;
mod graphs;
mod learners;
mod math;
mod onnx;
mod processors;
mod random;
mod refusals;
mod sensors;
mod shipped;
mod st;
mod support;
