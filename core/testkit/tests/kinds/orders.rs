//! The gate refuses every order of steps in which something is read before it is there.

use std::path::Path;

use athermal_core::compile::{Misordered, Plan, Step, Wanted, compile};
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::document::{Memory, declare, load};

/// A chain of two nodes.
fn plan() -> Plan {
    const GRAPH: &str = r#"
        schema = 1
        signals.t = { unit = "K", channels = ["a"] }
        nodes.first = { type = "brittle", inputs.signal = "t" }
        nodes.second = { type = "brittle", inputs.signal = "first" }
        outputs.out = "second"
    "#;
    let files = Memory::new().with("graph.toml", GRAPH);
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let path = Path::new("graph.toml");
    let graph = load(path, &files, &mut sources, &mut diagnostics)
        .and_then(|document| declare(document, &mut diagnostics))
        .unwrap();
    compile(&graph, Wanted::default(), &mut diagnostics).unwrap()
}

/// Every order of some steps.
fn orders(steps: &[Step]) -> Vec<Vec<Step>> {
    if steps.is_empty() {
        return vec![Vec::new()];
    }
    let first = |at: usize| {
        let rest = [&steps[..at], &steps[at + 1..]].concat();
        let first = steps[at];
        orders(&rest)
            .into_iter()
            .map(move |rest| [&[first], &rest[..]].concat())
    };
    (0..steps.len()).flat_map(first).collect()
}

#[test]
fn of_all_orders_of_a_chain_only_the_planned_one_passes() {
    let mut plan = plan();
    let planned = plan.steps.clone();
    assert_eq!(planned.len(), 4);
    let passes = orders(&planned).into_iter().filter(|order| {
        plan.steps.clone_from(order);
        plan.check_order().is_ok()
    });
    assert_eq!(passes.collect::<Vec<_>>(), [planned]);
}

#[test]
fn a_step_that_is_missing_or_done_twice_is_refused() {
    let mut plan = plan();
    let planned = plan.steps.clone();
    for nth in 0..planned.len() {
        plan.steps.clone_from(&planned);
        plan.steps.remove(nth);
        assert!(plan.check_order().is_err(), "without step {nth}");
    }
    plan.steps = [&planned[..], &[Step::Run(0)]].concat();
    assert_eq!(plan.check_order(), Err(Misordered::Node { node: 0 }));
}
