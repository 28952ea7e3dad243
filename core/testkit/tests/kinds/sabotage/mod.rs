//! The conformance kit finds what it is made to find: for every rule there is a node that breaks it, and one that breaks none.

use std::collections::BTreeSet;

use athermal_core::node::*;
use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use athermal_testkit::{Bench, Case, Rule, assert_every_kind_conforms, broken};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A kind whose one parameter says what is wrong with it, and nothing by default.
macro_rules! faulty {
    ($(#[$kind_doc:meta])* $public:vis struct $kind:ident; $($(#[$fault_doc:meta])* $fault:ident,)+) => {
        $(#[$kind_doc])*
        #[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        $public struct $kind {
            /// What is wrong with it; nothing by default.
            #[serde(default)]
            #[schemars(with = "String")]
            fault: Fault,
        }

        #[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        enum Fault {
            #[default]
            None,
            $($(#[$fault_doc])* $fault,)+
        }
    };
}

/// A port of a feature that has each channel of its input, made of that alone.
macro_rules! passes_on {
    ($summary:literal => $port:literal) => {
        fn inputs() -> &'static [InputPort] {
            const { &[InputPort::fresh("signal", $summary)] }
        }

        fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
            let (name, channels) = ($port, inputs.port("signal").to_vec());
            Ok(vec![OutputPort { name, channels }])
        }

        fn reach(&self, _port: &str) -> Reach {
            Reach::Own
        }
    };
}

mod combiner;
mod encoder;
mod estimator;
mod feature;
mod gaps;
mod instants;
mod learning;
mod machine;
mod memory;
mod optional;
mod pace;
mod parameters;
mod ports;
mod scale;
mod words;

/// Asserts that a rule is broken, and that what is told contains these words.
#[track_caller]
fn breaks<T: NodeSpec>(case: Case, rule: Rule, words: &str) {
    let broken = broken::<T>(&[case]);
    let told = broken.iter().find(|broken| broken.rule == rule);
    let Some(told) = told else {
        panic!("{rule} is not found broken, but {broken:#?}");
    };
    assert!(told.found.contains(words), "`{words}` is not in: {told}");
    assert!(told.to_string().contains("to do: "), "{told}");
}

/// A case with this fault.
fn with(fault: &str) -> Case {
    Case::new(format!("fault = \"{fault}\""))
}

/// Asserts that a rule is broken, and the whole of what is told to be found.
#[track_caller]
fn finds<T: NodeSpec>(case: Case, rule: Rule, found: &str) {
    let broken = broken::<T>(&[case]);
    let told = broken.iter().find(|broken| broken.rule == rule);
    let told = told.map(|broken| broken.found.as_str());
    assert_eq!(told, Some(found), "{broken:#?}");
}

/// Asserts that one rule is broken and no other, and that what is told contains these words.
#[track_caller]
fn breaks_one<T: NodeSpec>(case: Case, rule: Rule, words: &str) {
    let broken = broken::<T>(&[case]);
    assert!(
        broken.iter().all(|broken| broken.rule == rule),
        "{broken:#?}"
    );
    let found = broken.iter().any(|broken| broken.found.contains(words));
    assert!(found, "`{words}` is not in: {broken:#?}");
}

/// Asserts that no rule is broken but those.
#[track_caller]
fn breaks_only<T: NodeSpec>(case: Case, rules: &[Rule]) {
    let broken = broken::<T>(&[case]);
    let found: BTreeSet<Rule> = broken.iter().map(|broken| broken.rule).collect();
    assert_eq!(found, rules.iter().copied().collect(), "{broken:#?}");
}

#[test]
#[should_panic(expected = "answers: there is no case to try it in\n  to do: give the case what")]
fn a_kind_that_is_tried_in_no_case_has_proved_nothing() {
    athermal_testkit::assert_conforms::<Poll>(&[]);
}

#[test]
#[should_panic(expected = "no `conformance!` for [\"brittle\", \"faulty\"")]
fn a_kind_that_is_registered_and_not_examined_is_told() {
    assert_every_kind_conforms(env!("CARGO_PKG_NAME"));
}

athermal_testkit::conformance!(combiner::Poll, Case::new(""));

use combiner::Poll;
