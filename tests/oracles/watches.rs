//! Watches with their defaults on the recordings of both machines: quiet where nothing has changed, and an alarm where it has.

use std::path::Path;

use crate::workbench::{Scratch, data, graph};
use athermal::Model;
use athermal::files::{Dataset, Options};
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::{Event, Table};

/// When the machine begins to drift otherwise, in s.
const CHANGED_S: f64 = 4.0 * 86_400.0;
/// The kinds, each with how long an alarm may take, in s: not much longer than it does.
const KINDS: [(&str, f64); 2] = [("page_hinkley", 1.5 * 3_600.0), ("adwin", 2.0 * 3_600.0)];
/// The numbers of the port `reason` that are alarms.
const ALARMS: [f64; 2] = [1.0, 2.0];

/// When each output first gave an alarm, in s, along a recording whose positions creep by `creep` nm/min from [`CHANGED_S`] on.
fn alarms(model: &Model, table: &Table, creep: f64) -> Vec<Option<f64>> {
    let mut engine = model.engine().unwrap();
    let positions = model
        .plan
        .sources
        .iter()
        .map(|of| of.name.starts_with("position."));
    let positions: Vec<bool> = positions.collect();
    let mut first = vec![None; model.plan.outputs.len()];
    for (event, values) in table.events() {
        let Event::Row(at) = *event else { continue };
        let at_s = at.as_ns() as f64 / 1e9;
        let moved = creep * (at_s - CHANGED_S).max(0.0) / 60.0;
        let values = values.iter().zip(&positions);
        let values: Vec<f64> = values
            .map(|(value, is_position)| if *is_position { value + moved } else { *value })
            .collect();
        for (first, said) in first.iter_mut().zip(engine.step(at, &values).unwrap()) {
            if ALARMS.contains(said) {
                first.get_or_insert(at_s);
            }
        }
    }
    first
}

#[test]
fn watches_are_quiet_on_a_machine_that_stays_as_it_is_and_tell_of_one_that_does_not() {
    let Some(data) = data() else { return };
    for (kind, soon_s) in KINDS {
        for machine in ["die-tester", "linear-axis"] {
            assert_quiet_until_it_changes(kind, soon_s, machine, &data);
        }
    }
}

fn assert_quiet_until_it_changes(kind: &str, soon_s: f64, machine: &str, data: &Path) {
    let scratch = Scratch::new(&format!("watches-{kind}-{machine}"));
    let text = format!(
        "schema = 1\nextends = {:?}\nname = \"watched\"\n[nodes.watch]\ntype = {kind:?}\neach = \"axis\"\n\
             inputs.voters = \"thermal.{{axis}}\"\ninputs.truth = \"drift.{{axis}}\"\n\
             [nodes.vote_watch]\ntype = {kind:?}\neach = \"axis\"\n\
             inputs.voters = \"vote.{{axis}}\"\ninputs.truth = \"drift.{{axis}}\"\n\
             [outputs]\nof_thermal = \"watch:reason\"\nof_vote = \"vote_watch:reason\"\n",
        graph(machine)
    );
    let mut model = Model::load(scratch.file(&format!("{machine}.toml"), text)).unwrap();
    let recorded = |name: &str| {
        let file = data.join(machine).join(name);
        Table::read(&Dataset::new(vec![file], Options::default()), &model.plan).unwrap()
    };
    let (train, test) = (recorded("train.csv"), recorded("test.csv"));
    let (fitted, _) = fit(&model.plan, &train, &FitOptions::default(), &mut |_| {}).unwrap();
    model.fitted = fitted;
    for clean in [&train, &test] {
        let first = alarms(&model, clean, 0.0);
        assert!(
            first.iter().all(Option::is_none),
            "{kind}, {machine}: {first:?}"
        );
    }
    let outputs = model.plan.outputs.iter();
    let first = alarms(&model, &train, 60.0);
    for (output, first) in outputs
        .zip(first)
        .filter(|(of, _)| of.name.starts_with("of_thermal"))
    {
        let soon = first.is_some_and(|at| (CHANGED_S..CHANGED_S + soon_s).contains(&at));
        let after_h = first.map(|at| (at - CHANGED_S) / 3_600.0);
        assert!(
            soon,
            "{kind}, {machine}, {}: after {after_h:?} h",
            output.name
        );
    }
}
