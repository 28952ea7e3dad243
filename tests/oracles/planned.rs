//! A recipe that is known ahead, on a simulated die tester: what a forecast gains by it, and that it is the same from rows as from files.

use std::sync::Arc;

use crate::workbench::{Scratch, compiled, graph, simulated};
use athermal::Engine;
use athermal::core::compile::Plan;
use athermal::core::registry::find;
use athermal::files::{Dataset, Options};
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::{Event, Recording, Table};
use athermal::trial::machine::{KnownMachine, Setup, Simulated};

/// The days of a simulation of the die tester, with other weather for another seed.
fn days(days: f64, seed: u64) -> Simulated<'static> {
    let setup = Setup {
        days,
        seed,
        ..Setup::default()
    };
    Simulated::new(find::<KnownMachine>("die-tester").unwrap().machine, setup)
}

fn plan() -> Arc<Plan> {
    let text = format!(
        "schema = 1\nextends = '{}'\nname = \"planned\"\n[outputs]\ndrift = \"drift\"\nset_point = \"set_point\"\n",
        graph("die-tester-planned").display()
    );
    Arc::new(compiled(&text).unwrap_or_else(|problems| panic!("{problems}")))
}

/// Of a forecast, with the recipe and without: each instant with the truth and both errors.
type Errors = Vec<(f64, f64, [f64; 2])>;

/// The errors on Z1 and Z2, and the instants at which the set point changed.
fn errors(
    plan: &Arc<Plan>,
    train: &dyn Recording,
    test: &dyn Recording,
) -> ([Errors; 2], Vec<f64>) {
    let (fitted, _) = fit(plan, train, &FitOptions::default(), &mut |_| {}).unwrap();
    let mut engine = Engine::new(Arc::clone(plan), &fitted).unwrap();
    let table = Table::read(test, plan).unwrap();
    let place = |name: &str| plan.outputs.iter().position(|of| of.name == name).unwrap();
    let set_point = place("set_point.chuck");
    let axes = ["Z1", "Z2"]
        .map(|axis| ["drift", "predicted", "unplanned"].map(|of| place(&format!("{of}.{axis}"))));
    let mut errors = [Vec::new(), Vec::new()];
    let mut rows: Vec<(f64, [[f64; 2]; 2])> = Vec::new();
    let (mut changes, mut before) = (Vec::new(), f64::NAN);
    for (event, values) in table.events() {
        let Event::Row(time) = *event else { continue };
        let now = time.as_ns() as f64 / 1e9;
        let outputs = engine.step(time, values).unwrap();
        let applies = outputs[set_point];
        if !applies.is_nan() {
            if applies != before && !before.is_nan() {
                changes.push(now);
            }
            before = applies;
        }
        rows.push((now, axes.map(|[_, a, b]| [outputs[a], outputs[b]])));
        for ((errors, axis), [drift, ..]) in errors.iter_mut().zip(0..).zip(axes) {
            let (truth, made) = (outputs[drift], now - 300.0);
            let nth = rows.partition_point(|(at, _)| *at <= made);
            if truth.is_nan() || nth == 0 {
                continue;
            }
            let of_axis: [f64; 2] = rows[nth - 1].1[axis];
            if of_axis.iter().all(|of| !of.is_nan()) {
                errors.push((now, truth, of_axis.map(|of| of - truth)));
            }
        }
    }
    (errors, changes)
}

/// The root mean squares of both errors where the row counts.
fn both(errors: &Errors, counts: impl Fn(f64, f64) -> bool) -> [f64; 2] {
    let counted: Vec<_> = errors.iter().filter(|of| counts(of.0, of.1)).collect();
    assert!(counted.len() > 50, "{} truths", counted.len());
    [0, 1].map(|which| {
        let squares = counted.iter().map(|(.., of)| of[which] * of[which]);
        (squares.sum::<f64>() / counted.len() as f64).sqrt()
    })
}

#[test]
fn a_forecast_that_knows_the_recipe_is_better_where_the_chuck_moves_and_nowhere_worse() {
    let plan = plan();
    let (errors, changes) = errors(&plan, &days(7.0, 1), &days(2.5, 2));
    assert!(changes.len() > 10, "{changes:?}");
    let follows = |at: f64| {
        changes
            .iter()
            .any(|from| (0.0..=1800.0).contains(&(at - from)))
    };
    println!("5-min forecast in nm/min: with the recipe, without, ratio");
    for (axis, errors) in ["Z1", "Z2"].iter().zip(&errors) {
        let all = both(errors, |_, _| true);
        let after = both(errors, |at, _| follows(at));
        let calm = both(errors, |_, truth| truth.abs() < 250.0);
        for (what, [with, without], most) in [
            ("all", all, 0.5),
            ("30 min after a change", after, 0.25),
            ("|y| < 250", calm, 1.0),
        ] {
            println!(
                "  {axis} {what}: {with:.1} {without:.1} {:.3}",
                with / without
            );
            assert!(with <= most * without, "{axis}, {what}");
        }
    }
}

#[test]
fn a_recipe_from_a_file_gives_the_bits_of_one_that_is_simulated() {
    let scratch = Scratch::new("a_recipe_from_a_file");
    let setup = Setup {
        days: 0.5,
        seed: 3,
        ..Setup::default()
    };
    let tester = find::<KnownMachine>("die-tester").unwrap().machine;
    let recipe = athermal_simulation::write_set_points(tester, &setup);
    let files = [
        simulated(&scratch, "days.csv", "die-tester", 0.5, 3),
        scratch.file("recipe.csv", recipe),
    ];
    let plan = plan();
    let read = |recording: &dyn Recording| Table::read(recording, &plan).unwrap();
    let options = Options {
        merge: true,
        ..Options::default()
    };
    let merged = read(&Dataset::new(files.to_vec(), options));
    let simulated = read(&days(0.5, 3));
    let bits = |table: &Table| -> Vec<(Event, Vec<u64>)> {
        let rows = table.events().iter();
        rows.map(|(event, row)| (*event, row.iter().map(|value| value.to_bits()).collect()))
            .collect()
    };
    assert_eq!(bits(&merged), bits(&simulated));
}
