//! Learning as a user meets it: from a graph file, over recorded data, on the command line.

use crate::workbench::{Scratch, athermal, simulated};

const GRAPH: &str = r#"
extends = "GRAPHS/die-tester-sensor.toml"
schema = 1
[nodes.thermal]
type = "rls"
each = "axis"
inputs.features = "gradients"
inputs.truth = "drift.{axis}"
ahead = "0s"
train.abs_truth = { below = "150 nm/min" }
selection = { method = "forward", folds = 3, tolerance = 1e-3 }
"#;

#[test]
fn evaluating_learns_on_the_way_and_never_writes_the_model() {
    let scratch = Scratch::new("learning-evaluate");
    let train = simulated(&scratch, "train.csv", "die-tester", 2.0, 1);
    let test = simulated(&scratch, "test.csv", "die-tester", 1.0, 2);
    let graphs = concat!(env!("CARGO_MANIFEST_DIR"), "/graphs");
    let graph = scratch.file("graph.toml", GRAPH.replace("GRAPHS", graphs));
    let model = scratch.path("model.json");
    athermal(&[&"fit", &graph, &"--data", &train, &"-o", &model]).ended(0);
    let written = std::fs::read(&model).unwrap();
    let evaluate = |frozen: &[&str]| {
        let mut call: Vec<&dyn AsRef<std::ffi::OsStr>> =
            vec![&"evaluate", &model, &"--data", &test, &"--format", &"json"];
        call.extend(
            frozen
                .iter()
                .map(|flag| flag as &dyn AsRef<std::ffi::OsStr>),
        );
        athermal(&call).ended(0).out
    };
    let learned = evaluate(&[]);
    assert_eq!(learned, evaluate(&[]), "it starts from the fit each time");
    assert_ne!(learned, evaluate(&["--frozen"]));
    assert_eq!(std::fs::read(&model).unwrap(), written);
}
