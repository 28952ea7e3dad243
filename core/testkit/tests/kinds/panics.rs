//! A panic within a node carries the name that the node has in its graph.

use std::panic::{AssertUnwindSafe, catch_unwind};

use athermal_core::diagnostic::{NodePanic, panic_text};
use athermal_core::engine::Engine;
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

fn engine(graph: &str) -> Engine {
    let model = Model::from_text("model.json", graph.to_owned()).unwrap();
    model.engine().unwrap()
}

/// What a panic is reported as.
fn panic_of(work: impl FnOnce()) -> String {
    let panic = catch_unwind(AssertUnwindSafe(work)).unwrap_err();
    assert!(panic.is::<NodePanic>());
    panic_text(&*panic)
}

#[test]
fn a_panic_of_a_node_that_is_made_names_it() {
    let text = panic_of(|| drop(engine(&GRAPH.replace('Y', "fragile"))));
    assert!(
        text.starts_with(
            "the node `passed.fragile` panicked before its first tick: cannot be made;"
        ),
        "{text}"
    );
}

#[test]
fn a_panic_names_the_node_and_the_tick() {
    let text = panic_of(|| {
        let mut engine = engine(GRAPH);
        for (second, value) in [(1, 0.5), (2, 1.5)] {
            let now = Instant::from_ns(second * 1_000_000_000);
            engine.step(now, &[0.0, value]).unwrap();
        }
    });
    assert_eq!(
        text,
        "the node `passed.Y` panicked at 2 s: too much; this is a mistake in its code, for the author of `brittle`, \
         from athermal-testkit 0.1.0"
    );
}

#[test]
fn a_node_that_panics_is_given_up_where_that_is_asked_for_and_the_others_go_on() {
    let mut engine = engine(GRAPH);
    engine.isolate_panics();
    let mut given = Vec::new();
    for (second, [x, y]) in [(1, [0.1, 0.5]), (2, [0.2, 1.5]), (3, [0.3, 0.5])] {
        let now = Instant::from_ns(second * 1_000_000_000);
        given.push(engine.step(now, &[x, y]).unwrap().to_vec());
    }
    assert_eq!(given[0], [0.1, 0.5]);
    assert!(given[1][0] == 0.2 && given[1][1].is_nan(), "{given:?}");
    assert!(given[2][0] == 0.3 && given[2][1].is_nan(), "{given:?}");
    let panics: Vec<_> = engine.panics().iter().map(|of| &*of.node).collect();
    assert_eq!(panics, ["passed.Y"]);
    // A copy does without it too, and would give up others.
    let mut twin = engine.twin().unwrap();
    let now = Instant::from_ns(4_000_000_000);
    let row = twin.step(now, &[1.5, 0.5]).unwrap();
    assert!(row.iter().all(|value| value.is_nan()), "{row:?}");
    let panics: Vec<_> = twin.panics().iter().map(|of| &*of.node).collect();
    assert_eq!(panics, ["passed.Y", "passed.X"]);
}
