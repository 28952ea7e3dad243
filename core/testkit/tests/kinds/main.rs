//! Kinds of nodes as authors write them, with mistakes: what the macros, the compiler, the engine and the conformance kit find.

#![allow(clippy::unwrap_used)]

mod faulty_kinds;
mod misuse;
mod orders;
mod panics;
mod sabotage;
