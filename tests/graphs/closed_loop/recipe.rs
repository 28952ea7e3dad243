//! A correction that reads a recipe: in the loop a simulated machine announces its set points as its recording does.

use athermal::Engine;
use athermal::trial::machine::{MachineError, Row, Simulation};

use super::looped::Looped;
use crate::workbench::{Scratch, graph};

/// The graph that controls the die tester, beside the recipe of its chuck.
fn text(unit: &str) -> String {
    format!(
        r#"schema = 1
extends = {:?}
name = "follows a recipe"

[signals.set_point]
unit = "{unit}"
channels = ["chuck"]
column = "chuck_set_degC"
applies_at = "chuck_applies_at_s"
known_ahead = "30min"
max_age = "1d"

[nodes.coming]
type = "lag"
inputs.signal = "set_point"
lags = ["-5min", "0s"]

[outputs]
coming = "coming"
"#,
        graph("die-tester-control")
    )
}

/// What the recipe says of five minutes ahead and of now.
fn coming(engine: &Engine) -> [f64; 2] {
    let outputs = engine.plan().outputs.iter().zip(engine.outputs());
    let of = outputs.filter(|(of, _)| of.name.starts_with("coming"));
    let values: Vec<f64> = of.map(|(_, value)| *value).collect();
    values.try_into().unwrap()
}

#[test]
fn a_graph_in_the_loop_knows_the_recipe_of_the_machine_ahead() {
    let scratch = Scratch::new("a_graph_in_the_loop_knows_the_recipe");
    let file = scratch.file("recipe.toml", text("Cel"));
    let looped = Looped::new("die-tester", &file, 200_000.0, 50.0);
    let mut simulation = looped.started(0.5, 5, None, None);
    let mut row = Row::empty(looped.machine.channels());
    let mut seen = Vec::new();
    while simulation.next(&mut row) {
        seen.push((row.time_ns, coming(simulation.engine())));
    }
    let ahead_ns = 300_000_000_000;
    let last = seen.last().unwrap().0;
    let mut changes = 0;
    for &(now, [ahead, _]) in seen.iter().filter(|(now, _)| now + ahead_ns <= last) {
        let then = seen.partition_point(|(time, _)| *time < now + ahead_ns);
        let [_, applies] = seen[then].1;
        assert_eq!(ahead, applies, "at {now} ns");
    }
    for pair in seen.windows(2) {
        changes += usize::from(pair[0].1[1] != pair[1].1[1]);
    }
    assert!(changes >= 2, "the chuck changed {changes} times");
    assert!(simulation.applied().iter().any(|nm| nm.abs() > 10.0));
}

#[test]
fn a_recipe_in_a_unit_of_something_else_is_refused_in_the_loop() {
    let scratch = Scratch::new("a_recipe_in_a_unit_of_something_else");
    let file = scratch.file("recipe.toml", text("V"));
    let model = athermal::Model::load(&file).unwrap();
    let machine =
        athermal::core::registry::find::<athermal::trial::machine::KnownMachine>("die-tester")
            .unwrap()
            .machine;
    let setup = athermal::trial::machine::Setup::default();
    let simulation = machine.start(&setup).unwrap();
    let engine = model.engine().unwrap();
    let looped = athermal::trial::machine::ClosedLoop::new(machine, &setup, simulation, engine);
    let error = looped.map(|_| ()).unwrap_err();
    assert!(matches!(error, MachineError::Unit { .. }), "{error}");
    let told = error.to_string();
    assert!(told.contains("`set_point.chuck` in V"), "{told}");
}
