//! What is exported computes what the engine computes, to the bit.

// Shared functions of tests are none of `cfg(test)`.
#![allow(clippy::unwrap_used)]

mod beside;
mod command;
mod fmu;
mod graphs;
mod leaps;
mod learners;
mod math;
mod onnx;
mod processors;
mod random;
mod refusals;
mod sensors;
mod serial;
mod shipped;
mod st;
mod support;
