//! The dataflow framework of athermal: what a node is, how a graph file becomes a plan, and the engine that steps it.
//!
//! A machine is described by a **graph file** (TOML). [`document`] reads it into a tree that remembers where every value
//! stands, [`compile`] resolves it into a [`compile::Plan`], and an [`engine::Engine`] steps the plan, one **tick** (an
//! instant with new measurements) at a time. [`fit`] and [`score`] drive the same engine over recordings; a
//! [`model::Model`] is a graph with what was fitted.
//!
//! Each layer uses only those above it in this list:
//!
//! | layer | decides |
//! |---|---|
//! | [`time`], [`mod@unit`], [`quantity`], [`channel`] | instants, durations, units, named channels with unit and span |
//! | [`diagnostic`] | how a mistake in a file is told: code, place, reason, a way out |
//! | [`document`] | a file (with what it extends) as a tree with places, expanded into declarations |
//! | [`node`] | the traits that authors implement, the registry of kinds |
//! | [`compile`] | references, units, spans, all checks, an order, slots: a plan |
//! | [`engine`] | stepping a plan: held inputs and their ages, lags, truth alignment |
//! | [`recording`] | what a data set offers to the layers below |
//! | [`prng`], [`fault`] | seeded random numbers; what can be wrong with a sensor of any recording |
//! | [`machine`] | what a simulated machine is, and as what recording it serves |
//! | [`model`], [`fit`], [`score`] | a fitted graph, training it, scoring it |
//! | [`schema`] | the JSON Schema of graph files, for editors |
//! | [`trial`] | the tests in a graph file: what they mean, running one, judging it |
//! | [`live`] | sources, sinks, running from one to the other; replacing a graph while it runs |
//! | `testkit`, a feature | what every node must do, for the tests of those who write nodes |
//!
//! The core knows no concrete node and no linear algebra. Nodes come from plugin crates, which make a kind known with
//! [`register!`]. Whoever writes one implements one trait, of which each has a whole example:
//!
//! | to write | implement |
//! |---|---|
//! | channels from channels: a filter, a monitor, a correction | [`node::Feature`] |
//! | the same, learned from a truth: an encoder | [`node::Feature`] with [`node::Encoder`] |
//! | a prediction, fitted on history | [`node::Estimator`] |
//! | one prediction of several | [`node::Combiner`] |
//! | where samples come from | [`live::Source`] |
//! | where outputs go | [`live::Sink`] |
//! | a simulated machine | [`machine::Machine`] |

pub mod channel;
pub mod compile;
pub mod diagnostic;
pub mod document;
pub mod engine;
pub mod fault;
pub mod fit;
pub mod live;
pub mod machine;
pub mod model;
pub mod node;
pub mod prng;
pub mod quantity;
pub mod recording;
pub mod schema;
pub mod score;
#[cfg(feature = "testkit")]
pub mod testkit;
pub mod time;
pub mod trial;
pub mod unit;

#[doc(hidden)]
pub use inventory;

/// What [`register!`] needs at its place of use.
#[doc(hidden)]
pub mod __private {
    pub use crate::node::read;
    pub use {schemars, serde_json};
}
