//! What is reported where the name of a state or predictor is taken twice: no graph uses a node of either crate. It has a process of
//! its own, since names taken twice stop every graph of a process.

#![allow(clippy::unwrap_used)]

use std::sync::LazyLock;

use athermal_core::node::{
    Feature, InputPort, Inputs, Mistake, NodeKind, Operator, OutputPort, Outputs, RoleName,
    StateForm, Tick,
};
use athermal_core::registry::{Listed, Registered};
use athermal_testkit::{Case, broken};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Gives nothing, and keeps what another crate keeps too.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Keeper {}

impl Feature for Keeper {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is kept")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let channels = inputs.port("signal").to_vec();
        let name = "kept";
        Ok(vec![OutputPort { name, channels }])
    }

    fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Silent)
    }
}

/// The same under a name that another crate has too.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Twin {}

impl Feature for Twin {
    fn inputs() -> &'static [InputPort] {
        Keeper::inputs()
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        Keeper {}.outputs(inputs)
    }

    fn build(&self, inputs: &Inputs, wanted: &[bool]) -> Box<dyn Operator> {
        Keeper {}.build(inputs, wanted)
    }
}

struct Silent;

impl Operator for Silent {
    fn step(&mut self, _tick: &Tick<'_>, _outputs: &mut Outputs<'_>) {}

    fn segment(&mut self) {}
}

#[derive(Debug, Serialize, Deserialize)]
struct Kept {}

athermal_core::register!(Keeper, Feature, "keeper");
athermal_core::register!(Twin, Feature, "twin");
athermal_core::state!(Kept, "kept/1");

// As `state!` and `register!` of another crate would.
const fn of_others<T>(name: &'static str, item: T) -> Registered<T> {
    Registered {
        name,
        package: "keepers",
        version: "0.3.1",
        schema: || {
            static SCHEMA: LazyLock<Value> = LazyLock::new(|| schemars::schema_for!(Keeper).into());
            &SCHEMA
        },
        item,
    }
}

static KEPT: Registered<StateForm> = of_others(
    "kept/1",
    StateForm {
        read: |_| unreachable!(),
    },
);
static TWIN: Registered<NodeKind> = of_others(
    "twin",
    NodeKind {
        role: RoleName::Feature,
        ports: || &[],
        inputs: Keeper::inputs,
        facts: Keeper::facts,
        read: athermal_core::node::read::<Keeper>,
    },
);

athermal_testkit::inventory::submit! { Listed(&KEPT) }
athermal_testkit::inventory::submit! { Listed(&TWIN) }

#[test]
fn a_graph_is_told_which_crates_took_the_name() {
    let told = athermal_run::model::Model::from_text(
        "model.json",
        r#"{"athermal_model": 1, "card": null, "fitted": {}, "graph": {
            "signals": {"t": {"unit": "K", "channels": ["a"]}},
            "nodes": {"k": {"type": "keeper", "inputs": {"signal": "t"}}},
            "outputs": {"out": "k"}
        }}"#
        .to_owned(),
    );
    let told = told.map(|_| ()).map_err(|error| error.to_string());
    assert_eq!(
        told.unwrap_err(),
        r#"error[A041]: `keeper` cannot be used, since the state `kept/1` is brought by several crates: `athermal-testkit`, `keepers`
 --> model.json:1:1
  |
1 | {"athermal_model": 1, "card": null, "fitted": {}, "graph": {
  | ^ which of them?
  |
  = help: leave one of the crates out when the program is built, or rename what one of them brings
"#
    );
}

#[test]
fn the_kit_says_so_before_anything_else() {
    let told: Vec<String> = broken::<Keeper>(&[Case::new("")])
        .iter()
        .map(ToString::to_string)
        .collect();
    assert_eq!(
        told,
        [
            "names: the state `kept/1` is brought by several crates: `athermal-testkit`, `keepers`\n  to do: take another name, and \
          begin those of states and predictors with that of the kind: all crates of a program share them. Ports and kinds are a \
          letter, then letters, digits, `_` and `-`; a feature of several output ports declares them in `ports`"
        ]
    );
}

#[test]
fn a_kind_of_two_crates_is_told_by_both() {
    let told = broken::<Twin>(&[Case::new("")]);
    assert_eq!(
        told[0].found,
        "the node type `twin` is brought by several crates: `athermal-testkit`, `keepers`"
    );
}
