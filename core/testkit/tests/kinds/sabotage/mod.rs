//! The conformance kit finds what it is made to find: for every rule there is a node that breaks it, and one that breaks none.

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

use std::collections::BTreeSet;

use athermal_core::node::NodeSpec;
use athermal_testkit::{Case, Rule, assert_every_kind_conforms, broken};

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

/// Asserts that a rule is broken, and the whole of what is told to be found.
#[track_caller]
fn finds<T: NodeSpec>(case: Case, rule: Rule, found: &str) {
    let broken = broken::<T>(&[case]);
    let told = broken.iter().find(|broken| broken.rule == rule);
    let told = told.map(|broken| broken.found.as_str());
    assert_eq!(told, Some(found), "{broken:#?}");
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
    athermal_testkit::assert_conforms::<Votes>(&[]);
}

#[test]
#[should_panic(expected = "no `conformance!` for [\"brittle\", \"faulty\"")]
fn a_kind_that_is_registered_and_not_examined_is_told() {
    assert_every_kind_conforms(env!("CARGO_PKG_NAME"));
}

athermal_testkit::conformance!(combiner::Votes, Case::new(""));

use combiner::Votes;
