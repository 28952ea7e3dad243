//! Truths that follow a gap in which a process has moved are learned from; ones that are off for no such reason are not.

use athermal::core::engine::Engine;
use athermal::core::prng::Prng;

use super::world::{fitted_on, run};
use crate::workbench::Graph;

const LEARNED: f64 = 0.0;
const OUTLIER: f64 = 3.0;

fn graph(node: &str) -> Graph {
    Graph::new()
        .signal("shift", "nm", "Z", "10s")
        .section("nodes.model", node)
        .with("inputs.truth = 'shift'; ahead = '0s'")
        .outputs("out = 'model'; learning = 'model:learning'")
}

/// A tick every 10 s: what comes back to 0 by a hundredth of itself each, with noise of 0.1.
fn wandering(count: usize) -> Vec<f64> {
    let mut random = Prng::stream(4, "wandering");
    let mut shift = 0.0;
    let next = |_| {
        shift = 0.99 * shift + 0.1 * random.normal();
        shift
    };
    (0..count).map(next).collect()
}

/// What the port `learning` tells of each truth of some rows, after a fit on others; a truth that is NaN has no value.
fn became(node: &str, rows: &[f64]) -> Vec<f64> {
    let each = |rows: &[f64]| rows.iter().map(|&shift| [shift]).collect::<Vec<_>>();
    let (plan, fitted) = fitted_on(&graph(node), &each(&wandering(2000)));
    let mut engine = Engine::new(plan, &fitted).unwrap();
    let outputs = run(&mut engine, 0, &each(rows));
    outputs
        .into_iter()
        .map(|outputs| outputs[1] % 10.0)
        .collect()
}

/// Whoever moves while no truth comes says that it may have.
const FOLLOWING: [&str; 2] = [
    "type = \"arma\"\nna = 1\nnc = 1",
    "type = \"kalman\"\nnoises = { observation = \"0.01 nm\", level = \"0.1 nm\", per = \"10s\" }",
];

#[test]
fn after_a_gap_in_which_the_process_moved_good_truths_are_learned_from() {
    for node in FOLLOWING {
        let mut rows = wandering(300);
        let missed = 200..260;
        rows[missed.clone()].fill(f64::NAN);
        // One and a half times as far as it usually goes meanwhile, and more than ten times as far as within a step.
        let off = rows[199] + 1.2 - rows[260];
        rows[260..].iter_mut().for_each(|shift| *shift += off);
        let became = became(node, &rows);
        let learned = became[261..].iter().filter(|&&of| of == LEARNED).count();
        assert_eq!(learned, 39, "{node}: {:?}", &became[255..]);
    }
}

#[test]
fn an_outlier_is_not_learned_from_while_truths_come() {
    for node in FOLLOWING {
        let mut rows = wandering(300);
        rows[250] += 1.2;
        let became = became(node, &rows);
        let refused = became.iter().filter(|&&of| of == OUTLIER).count();
        assert_eq!(refused, 1, "{node}: {became:?}");
    }
}
