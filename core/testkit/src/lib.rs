//! Decides what every node must do, whoever wrote it, and checks it; for the tests of plugin crates.
//!
//! A crate that brings nodes has `athermal-core` under `[dependencies]` and `athermal-testkit` under `[dev-dependencies]`. Its
//! `tests/conformance.rs` then has a line for each kind:
//!
//! ```
//! # use athermal_core::node::prelude::*;
//! # /// Twice its input, as an example of a node.
//! # #[derive(Debug, Serialize, Deserialize, JsonSchema)]
//! # #[serde(deny_unknown_fields)]
//! # pub struct Twice {}
//! # impl Feature for Twice {
//! #     fn inputs() -> &'static [InputPort] {
//! #         const { &[InputPort::fresh("signal", "what is doubled")] }
//! #     }
//! #     fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
//! #         Ok(vec![OutputPort { name: "twice", channels: inputs.port("signal").to_vec() }])
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
//! # athermal_core::register!(Twice, Feature, "twice");
//! use athermal_testkit::{Bench, Case};
//!
//! athermal_testkit::conformance!(Twice, Case::new(""), Case::new("").input("signal", 1, "K"));
//! # fn main() {
//! let mut bench = Bench::of(&Twice {}).input("signal", 1, "K");
//! assert_eq!(bench.feed([(0.0, [1.0]), (10.0, [2.5])]).outputs(), [[2.0], [5.0]]);
//! # }
//! ```
//!
//! [`conformance!`](crate::conformance) makes a test of it that tries every [`Rule`] on every [`Case`] and tells all that are
//! broken, each with what to do about it. Simulated machines have rules of their own, which [`assert_every_machine_conforms`] tries.
//! [`Bench`] is for the tests of what a node computes. Both put the node into a small
//! graph of its own, compile it and step the real engine.

mod bench;
mod case;
mod compared;
mod derived;
mod fixture;
mod machine;
mod rule;
mod rules;
mod samples;
mod tried;
mod verdict;

pub use bench::Bench;
pub use case::Case;
pub use machine::{BrokenMachine, assert_every_machine_conforms, broken_machine};
pub use rule::Rule;
pub use verdict::{Broken, assert_conforms, assert_every_kind_conforms, broken};

/// A kind that a test takes through the rules; [`conformance!`](crate::conformance) makes it known.
#[doc(hidden)]
#[derive(Debug)]
pub struct Examined {
    /// Its name.
    pub kind: fn() -> &'static str,
}

#[doc(hidden)]
pub use inventory;

/// What [`conformance!`] needs at its place of use.
#[doc(hidden)]
pub mod __private {
    pub use athermal_core::node;
}

// The layers below, by the names that they have for everybody.
use athermal_core::{
    channel, compile, diagnostic, document, engine, node, prng, registry, time, unit,
};
use athermal_run::{fit, model, recording};

inventory::collect!(Examined);

/// A test, named after the parameters' type, that takes a kind through every [`Rule`](crate::Rule) in each of the cases.
///
/// `conformance!(Slope, Case::new(r#"windows = ["1min"]"#));`
#[macro_export]
macro_rules! conformance {
    (@ $node:ty, $first:ident :: $($rest:ident)::+, $($case:expr),+) => {
        $crate::conformance!(@ $node, $($rest)::+, $($case),+);
    };
    (@ $node:ty, $name:ident, $($case:expr),+) => {
        #[test]
        #[allow(non_snake_case)]
        fn $name() {
            $crate::assert_conforms::<$node>(&[$($case),+]);
        }

        $crate::inventory::submit! {
            $crate::Examined { kind: <$node as $crate::__private::node::NodeSpec>::kind_name }
        }
    };
    ($($node:ident)::+, $($case:expr),+ $(,)?) => {
        $crate::conformance!(@ $($node)::+, $($node)::+, $($case),+);
    };
}
