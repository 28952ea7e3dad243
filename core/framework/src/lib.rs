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
//! In a program that is three steps: compile, make an engine, step it. The node here is a feature that doubles; the shipped ones
//! come from plugin crates:
//!
//! ```
//! # use athermal_core::node::prelude::*;
//! # /// Doubled its input.
//! # #[derive(Debug, Serialize, Deserialize, JsonSchema)]
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
//! # use athermal_core::compile::{Wanted, compile};
//! # use athermal_core::diagnostic::{Diagnostics, Sources};
//! # use athermal_core::document::{Memory, declare, load_text};
//! # use athermal_core::{engine::{Engine, Fitted}, time::Instant};
//! const GRAPH: &str = r#"
//!     schema = 1
//!     signals.rise = { unit = "K", channels = ["plate", "room"], max_age = "1min" }
//!     nodes.doubled = { type = "doubled", inputs.signal = "rise" }
//!     outputs.doubled = "doubled"
//! "#;
//! let (mut sources, mut mistakes) = (Sources::new(), Diagnostics::new());
//! let plan = load_text("graph.toml", GRAPH, &Memory::new(), &mut sources, &mut mistakes)
//!     .and_then(|document| declare(document, &mut mistakes))
//!     .and_then(|graph| compile(&graph, Wanted::default(), &mut mistakes))
//!     .ok_or_else(|| mistakes.render(&sources, false, 100))?;
//! let mut engine = Engine::new(plan.into(), &Fitted::new())?;
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
//! - A **plan** is the graph, resolved: every mistake of the file has been reported by then, with its place and a way out.
//! - A **fit** is what a node has learned from history. A graph with its fits is a model (`athermal-run`).
//!
//! # To write a node of your own
//!
//! Implement one trait, of which each has a whole example, and make it known with [`register!`]. `athermal-testkit` tries every
//! rule on a node.
//!
//! | to write | implement |
//! |---|---|
//! | channels from channels: a filter, a monitor, a correction | [`node::Feature`] |
//! | the same, learned from a truth: an encoder | [`node::Feature`] with [`node::Encoder`] |
//! | a prediction, fitted on history | [`node::Estimator`] |
//! | one prediction of several | [`node::Combiner`] |
//!
//! # The layers
//!
//! The core knows no concrete node and no linear algebra. Each layer uses only those above it in this list; the first three are
//! the crate `athermal-graph`:
//!
//! | layer | decides |
//! |---|---|
//! | [`time`], [`mod@unit`], [`quantity`], [`channel`] | instants, durations, units, named channels with unit and span |
//! | [`diagnostic`] | how a mistake in a file is reported: code, place, reason, a way out |
//! | [`document`] | a file (with what it extends) as a tree with places, expanded into declarations |
//! | [`node`] | the traits that authors implement, the registry of kinds |
//! | [`compile`] | references, units, spans, all checks, an order, slots: a plan |
//! | [`engine`] | stepping a plan: held inputs and their ages, lags, truth alignment |
//!
//! # The afternoon
//!
//! Who wants to change the engine reads these files in this order, at most 8,000 lines of code; a test counts them. What is not
//! listed can be skipped: the texts of mistakes, the comparison of plans, evaluations of many steps.
//!
//! ```text
//! node          mod feature estimator combiner predictor learner port reach linear_form registry
//! compile       mod plan instance order resolver reference scope inputs conversion provenance
//! compile       feature estimator row learning combiner agreement leak gate steps
//! engine        mod error at_work
//! engine/tick   slots history gather context runner estimate vote output_slots part bank
//! engine/learning  pairing embargo gated_learner
//! engine/state  engine_state snapshot transfer blend
//! ```

pub mod compile;
pub mod engine;
pub mod node;
pub mod prng;
#[cfg(test)]
mod tests;

// The vocabulary that a graph is written in; authors of nodes need one crate.
pub use athermal_graph::{
    channel, diagnostic, document, event, events, failure, figures, lacks, message, quantity,
    register_error, registry, time, unit, watch,
};

/// What [`register!`], [`state!`] and [`predictor!`] need at their place of use.
#[doc(hidden)]
pub mod __private {
    pub use crate::node::read;
    pub use athermal_graph::registry::no_schema;
    pub use athermal_graph::{list, schema_of};
    pub use {rmp_serde, schemars, serde_json, typetag};
}
