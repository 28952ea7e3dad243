//! A panic within a node is told with the name that the node has in its graph.

use std::process::Command;

use athermal_core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, Tick,
};
use athermal_core::time::Instant;
use athermal_run::model::Model;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Passes its input on, and panics above 1.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Brittle {}

impl Feature for Brittle {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is passed on")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let channels = inputs.port("signal").to_vec();
        let name = "passed";
        Ok(vec![OutputPort { name, channels }])
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        assert!(inputs.port("signal")[0].name != "fragile", "cannot be made");
        Box::new(Passing)
    }
}

struct Passing;

impl Operator for Passing {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let value = tick.port(0)[0];
        assert!(value < 1.0, "too much");
        outputs.set(0, value);
    }

    fn segment(&mut self) {}
}

athermal_core::register!(Brittle, Feature, "brittle");

const GRAPH: &str = r#"{"athermal_model": 1, "card": null, "fitted": {}, "graph": {
    "sets": {"axis": ["X", "Y"]},
    "signals": {"t": {"unit": "K", "channels": ["X", "Y"]}},
    "nodes": {"passed": {"each": "axis", "type": "brittle", "inputs": {"signal": "t.{axis}"}}},
    "outputs": {"out": "passed"}
}}"#;

#[test]
#[ignore = "panics, and is called by the other"]
fn a_node_panics() {
    let model = Model::from_text("model.json", GRAPH.to_owned()).unwrap();
    let mut engine = model.engine().unwrap();
    for (second, value) in [(1, 0.5), (2, 1.5)] {
        let now = Instant::from_ns(second * 1_000_000_000);
        engine.step(now, &[0.0, value]).unwrap();
    }
}

#[test]
#[ignore = "panics, and is called by the other"]
fn a_node_panics_when_it_is_made() {
    let graph = GRAPH.replace('Y', "fragile");
    let model = Model::from_text("model.json", graph).unwrap();
    let _ = model.engine();
}

/// What is told of the node in a test that panics.
fn told_by(test: &str) -> String {
    let output = Command::new(std::env::current_exe().unwrap())
        .args([
            &format!("panics::{test}"),
            "--exact",
            "--ignored",
            "--nocapture",
        ])
        .output()
        .unwrap();
    let told = String::from_utf8(output.stderr).unwrap();
    let mut lines = told.lines();
    lines
        .find(|line| line.starts_with("the node"))
        .unwrap()
        .to_owned()
}

#[test]
fn a_panic_of_a_node_that_is_made_names_it() {
    let told = told_by("a_node_panics_when_it_is_made");
    assert!(
        told.starts_with("the node `passed.fragile` panicked before its first tick;"),
        "{told}"
    );
}

#[test]
fn a_panic_names_the_node_and_the_tick() {
    assert_eq!(
        told_by("a_node_panics"),
        "the node `passed.Y` panicked at 2 s; what it said stands above, and is for the author of `brittle`, from athermal-core 0.1.0"
    );
}
