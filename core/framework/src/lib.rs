//! The dataflow framework of athermal: what a node is, how a graph file becomes a plan, and the engine that steps it.
//!
//! Machines drift when they warm up. A **graph file** (TOML) says how the drift of one is predicted: which **channels** are
//! measured, which **nodes** compute something from them, and what comes out. There are three roles of nodes. A feature makes
//! channels of channels, an estimator is fitted on history and predicts a channel that will be measured, a combiner makes one
//! prediction of several. The same graph is fitted, scored, tested and run live:
//!
//! ```text
//!  graph file ─▶ document ─▶ compile ─▶ Plan ─────▶ Engine ─▶ outputs     at every tick, the same engine for
//!  (TOML)        a tree      checked,   nodes in      ▲                   fit, score, trial and live
//!                            resolved   an order      │
//!                                                  samples from a recording, a live source or a simulated machine
//! ```
//!
//! In a program that is three steps: load, make an engine, step it. The node here is a feature that doubles; the shipped ones
//! come from plugin crates:
//!
//! ```
//! # use athermal_core::node::{Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, Tick};
//! # /// Doubled its input.
//! # #[derive(Debug, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
//! # #[serde(deny_unknown_fields)]
//! # pub struct Doubled {}
//! # impl Feature for Doubled {
//! #     fn inputs() -> &'static [InputPort] {
//! #         const { &[InputPort::fresh("signal", "what is doubled")] }
//! #     }
//! #     fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
//! #         Ok(vec![OutputPort { name: "doubled", channels: inputs.port("signal").to_vec() }])
//! #     }
//! #     fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
//! #         Box::new(Doubling)
//! #     }
//! # }
//! # struct Doubling;
//! # impl Operator for Doubling {
//! #     fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
//! #         for (i, value) in tick.port(0).iter().enumerate().filter(|(_, value)| !value.is_nan()) {
//! #             outputs.set(i, 2.0 * value);
//! #         }
//! #     }
//! #     fn segment(&mut self) {}
//! # }
//! # athermal_core::register!(Doubled, Feature, "doubled");
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # use athermal_core::{model::Model, time::Instant};
//! # let path = std::env::temp_dir().join(format!("athermal-core-{}.toml", std::process::id()));
//! std::fs::write(&path, r#"
//!     schema = 1
//!     signals.rise = { unit = "K", channels = ["plate", "room"], max_age = "1min" }
//!     nodes.doubled = { type = "doubled", inputs.signal = "rise" }
//!     outputs.doubled = "doubled"
//! "#)?;
//! let mut engine = Model::load(&path)?.engine()?;
//! # std::fs::remove_file(&path)?;
//! // Samples in the order of the plan's sources; NaN where there is no new value.
//! let outputs = engine.step(Instant::from_ns(0), &[0.25, f64::NAN])?;
//! assert!(outputs[0] == 0.5 && outputs[1].is_nan());
//! # Ok(())
//! # }
//! ```
//!
//! # Six words
//!
//! - A **channel** is a series of numbers with a name and a unit; a **span** where each is made of a stretch of time, such as a slope.
//! - A **tick** is an instant at which something was measured. Nodes run at the ticks that bring them something new.
//! - **Absent** is a value: NaN. What was not measured is never zero and never an old number beyond its stated age.
//! - The **truth** is the channel that an estimator predicts, so much **ahead**. It is handed out when it has been measured and not before; a
//!   graph in which it would leak is refused.
//! - A **plan** is the graph, resolved: every mistake of the file has been told by then, with its place and a way out.
//! - A **model** is a graph with what was fitted, in one file.
//!
//! # To write something of your own
//!
//! Implement one trait, of which each has a whole example, and make it known with [`register!`] (or [`register_machine!`]). A
//! source and a sink are handed to [`live::run`] by your program. `testkit`, a feature of this crate, tries every rule on a node.
//!
//! | to write | implement |
//! |---|---|
//! | channels from channels: a filter, a monitor, a correction | [`node::Feature`] |
//! | the same, learned from a truth: an encoder | [`node::Feature`] with [`node::Encoder`] |
//! | a prediction, fitted on history | [`node::Estimator`] |
//! | one prediction of several | [`node::Combiner`] |
//! | where samples come from | [`recording::Source`] |
//! | where outputs go | [`live::Sink`] |
//! | a simulated machine | [`machine::Machine`] |
//!
//! # Where things are decided
//!
//! The core knows no concrete node and no linear algebra. Each layer uses only those above it in this list:
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

pub mod compile;
pub mod engine;
pub mod node;
pub mod prng;

// The vocabulary that a graph is written in; authors of nodes need one crate.
pub use athermal_graph::{channel, diagnostic, document, quantity, time, unit};

#[doc(hidden)]
pub use inventory;

/// What [`register!`], [`state!`] and [`predictor!`] need at their place of use.
#[doc(hidden)]
pub mod __private {
    pub use crate::node::read;
    pub use {rmp_serde, schemars, serde_json, typetag};
}
