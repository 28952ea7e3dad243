//! A graph made of modules means what the same graph written out means.

use std::collections::BTreeMap;

use crate::workbench::Read;
use athermal::core::compile::{Plan, meaning};
use serde_json::Value;

const PLAIN: &str = include_str!("../../graphs/die-tester.toml");

fn compiled(text: &str) -> (Option<Plan>, String) {
    let mut read = Read::new(text);
    (read.plan.take(), read.told())
}

/// The die tester with the estimators and the vote of an axis in a module.
fn in_a_module() -> String {
    let (head, _) = PLAIN.split_once("[nodes.thermal]").unwrap();
    head.to_owned()
        + r#"
[modules.axis]
inputs = ["features", "truth"]
required = ["limit"]
parameters = { ahead = "5min", lags = ["0s", "5min", "10min"], selection = { method = "forward", folds = 3, tolerance = 1e-3 } }
outputs = { predicted = "vote", thermal = "thermal" }

[modules.axis.nodes.thermal]
type = "linear"
inputs.features = "{features}"
inputs.truth = "{truth}"
ahead = "{ahead}"
train.abs_truth = { below = "150 nm/min" }
selection = "{selection}"

[modules.axis.nodes.motion]
type = "ar"
inputs.truth = "{truth}"
ahead = "{ahead}"
lags = "{lags}"
train.abs_truth = { below = "{limit} nm/min" }

[modules.axis.nodes.both]
type = "arx"
inputs.features = "{features}"
inputs.truth = "{truth}"
ahead = "{ahead}"
lags = "{lags}"
train.abs_truth = { below = "{limit} nm/min" }
selection = "{selection}"

[modules.axis.nodes.vote]
type = "auto_weighted"
inputs.voters = ["thermal", "motion", "both"]
inputs.truth = "{truth}"
memory = "15min"

[nodes.model]
module = "axis"
each = "axis"
inputs.features = "gradients"
inputs.truth = "drift.{axis}"
limit = 850

[outputs]
predicted = "model"
"#
}

#[test]
fn the_plan_is_that_of_the_graph_written_out() {
    let (plain, _) = compiled(PLAIN);
    let (modular, told) = compiled(&in_a_module());
    let (plain, modular) = (plain.unwrap(), modular.unwrap_or_else(|| panic!("{told}")));
    let nodes = |plan: &Plan| meaning(plan)["nodes"].to_string().replace("model/", "");
    let sorted = |nodes: &str| -> BTreeMap<String, Value> { serde_json::from_str(nodes).unwrap() };
    assert_eq!(sorted(&nodes(&modular)), sorted(&nodes(&plain)));
    let columns = |plan: &Plan| -> Vec<_> {
        plan.outputs
            .iter()
            .map(|column| column.name.clone())
            .collect()
    };
    assert_eq!(columns(&modular), columns(&plain));
    assert!(
        modular
            .nodes
            .iter()
            .any(|node| node.instance() == "model/vote.Z1")
    );
}

#[test]
fn a_mistake_inside_names_instance_and_member_and_stands_where_it_was_written() {
    let (plan, told) =
        compiled(&in_a_module().replace("limit = 850", "limit = \"850\"\nahead = \"2min\""));
    assert!(plan.is_none());
    assert!(
        told.contains("note: node `model/motion`, member `X1`, and 11 more members"),
        "{told}"
    );
    assert!(
        told.contains("the smallest lag allowed is 3min (here it is 0s)"),
        "{told}"
    );
    // The lags are the module's own, written in its parameters.
    assert!(told.contains("parameters = { ahead"), "{told}");
}

#[test]
fn what_an_instance_lacks_or_has_too_much_is_told() {
    let (plan, told) = compiled(
        &in_a_module()
            .replace("limit = 850", "limits = 850\ntype = \"mean\"")
            .replace(
                "inputs.features = \"gradients\"",
                "inputs.feature = \"gradients\"",
            ),
    );
    assert!(plan.is_none());
    for expected in [
        "error[A006]: node \"model\" of module \"axis\" has no key \"limits\"",
        "error[A006]: node \"model\" of module \"axis\" has no key \"type\"",
        "error[A006]: `inputs` of node \"model\" of module \"axis\" has no key \"feature\"",
    ] {
        assert!(told.contains(expected), "{expected}\n{told}");
    }
    // What is misspelt is not missing as well.
    assert_eq!(told.matches("error[").count(), 3, "{told}");
}

#[test]
fn an_output_of_a_module_names_an_output_that_there_is_whether_the_module_is_used_or_not() {
    let module = r#"
schema = 1
[signals.position]
unit = "nm"
channels = ["Z"]
max_age = "3min"
[nodes.drift]
type = "slope"
inputs.signal = "position"
windows = ["5min"]
[outputs]
drift = "drift"
[modules.inner]
inputs = ["truth"]
outputs = { predicted = "zero" }
nodes.zero = { type = "zero", inputs.truth = "{truth}", ahead = "5min" }
[modules.none]
nodes.zero = { type = "zero", inputs.truth = "drift", ahead = "5min" }
[modules.outer]
inputs = ["truth"]
required = ["kind"]
outputs = { OUTPUT }
nodes.inner = { module = "inner", inputs.truth = "{truth}" }
nodes.none = { module = "none" }
nodes.vote = { type = "auto_weighted", inputs.voters = ["inner"], inputs.truth = "{truth}", memory = "15min" }
nodes.slope = { type = "slope", inputs.signal = "{truth}", windows = ["5min"] }
nodes.any = { type = "{kind}", inputs.truth = "{truth}" }
"#;
    let told = |output: &str| {
        let text = module.replace("OUTPUT", &format!("w = \"{output}\""));
        compiled(&text).1
    };
    for (output, expected) in [
        (
            "inner:predictd",
            "error[A028]: \"inner\" has no output \"predictd\"",
        ),
        ("inner:", "error[A028]: \"inner\" has no output \"\""),
        ("none", "error[A028]: module \"none\" has no outputs"),
    ] {
        let told = told(output);
        assert!(told.contains(expected), "{expected}\n{told}");
        assert_eq!(told.matches("error[").count(), 1, "{told}");
    }
    for output in [
        "vote",
        "vote:weights",
        "vote:std_dev",
        "slope:stderr",
        "any:what",
        "inner",
        "inner:predicted",
    ] {
        let told = told(output);
        assert!(!told.contains("error["), "{output}\n{told}");
    }
}
