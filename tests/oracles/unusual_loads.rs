//! Machines under loads that their fit never saw: motors that heat several times as much, a source of heat beside a sensor. The sensor
//! nearest to it is right, and no `cross_check` may take it from the models. `ATHERMAL_LONG=1` looks at more loads, seeds and machines.

use std::sync::Arc;

use crate::workbench::{Read, graph};
use athermal::Engine;
use athermal::core::compile::Plan;
use athermal::core::engine::Fitted;
use athermal::core::registry::find;
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::{Event, Table};
use athermal::trial::machine::{KnownMachine, Setup, Simulated};
use athermal_simulation::{Disturbance, disturbed};

const DAY_S: f64 = 86_400.0;

/// A load: what is other than in the fit, of the command line.
#[derive(Default)]
struct Load {
    changes: Vec<String>,
    disturbances: Vec<String>,
    /// Coolant that comes in bursts past the sensor of the column of the linear axis, and how much of that the column takes.
    coolant: Option<f64>,
}

/// By how much the positions X, Y and Z move with a kelvin of the column, in nm: its levers, 0.3 m and 11.7 ppm/K.
const COLUMN_NM: [f64; 3] = [197.0, 211.0, -807.0];

/// What coolant of 0.7 K does to a row from the sixth hour on: each two hours for ten minutes, within a minute or so.
fn cool(names: &[String], values: &mut [f64], now_s: f64, column: f64) {
    let (began, ended) = (now_s % 7200.0, (now_s % 7200.0 - 600.0).max(0.0));
    let warmer = 0.7 * (1.0 - (-began.min(600.0) / 60.0).exp()) * (-ended / 60.0).exp();
    if now_s > 6.0 * 3600.0 {
        for (name, value) in names.iter().zip(values) {
            *value += warmer
                * match &**name {
                    "temperature.t3" => 1.0,
                    "position.X" => column * COLUMN_NM[0],
                    "position.Y" => column * COLUMN_NM[1],
                    "position.Z" => column * COLUMN_NM[2],
                    _ => 0.0,
                };
        }
    }
}

/// Motors that heat so much more from the sixth hour on, for some hours or for good.
fn motors(percent: f64, hours: Option<f64>) -> Load {
    let mut changes = vec![format!("load={percent}%@6h")];
    changes.extend(hours.map(|hours| format!("load={}%@{}h", -percent.min(99.0), 6.0 + hours)));
    // What is above 99 % is taken back in steps.
    let mut left = percent - 99.0;
    while hours.is_some() && left > 0.0 {
        let until = 6.0 + hours.unwrap_or_default();
        changes.push(format!("load={}%@{until}h", -left.min(99.0)));
        left -= 99.0;
    }
    Load {
        changes,
        ..Load::default()
    }
}

/// A source of heat on the first stage from the sixth hour on, in mK/s.
fn lamp(size: f64, hours: f64) -> Load {
    Load {
        disturbances: vec![format!("lamp,from=6h,for={hours}h,size={size} mK/s")],
        ..Load::default()
    }
}

/// The most hours of a day in which a sensor is absent, and the errors of each axis, with `cross_check` and without.
fn scored(
    machine: &str,
    (plans, fitted): &([Arc<Plan>; 2], Fitted),
    load: &Load,
    days: f64,
    seed: u64,
) -> (f64, Vec<[f64; 2]>) {
    let by: Vec<Disturbance> = load
        .disturbances
        .iter()
        .map(|of| of.parse().unwrap())
        .collect();
    let setup = Setup {
        days,
        seed,
        changes: load.changes.iter().map(|of| of.parse().unwrap()).collect(),
        ..Setup::default()
    };
    let known = find::<KnownMachine>(machine).unwrap().machine;
    let table = match disturbed(machine, &by).unwrap() {
        Some(own) => Table::read(&Simulated::new(&*own, setup), &plans[0]).unwrap(),
        None => Table::read(&Simulated::new(known, setup), &plans[0]).unwrap(),
    };
    let mut absent = std::collections::BTreeMap::<(String, i64), f64>::new();
    let mut errors = Vec::new();
    for (with, plan) in plans.iter().enumerate() {
        let places = |of: &str| -> Vec<usize> {
            let outputs = plan.outputs.iter().enumerate();
            let own = outputs.filter(|(_, output)| output.name.starts_with(of));
            own.map(|(place, _)| place).collect()
        };
        let [drifts, predictions, reasons] = ["drift.", "predicted.", "why."].map(places);
        let mut engine = Engine::new(Arc::clone(plan), fitted).unwrap();
        let names: Vec<String> = plan.sources.iter().map(|of| of.name.clone()).collect();
        let (mut sums, mut seen) = (vec![(0.0, 0.0); drifts.len()], vec![f64::NAN; drifts.len()]);
        let mut before = 0.0;
        for (event, values) in table.events() {
            let Event::Row(time) = *event else {
                panic!("one segment")
            };
            let now = time.as_ns() as f64 / 1e9;
            let mut values = values.to_vec();
            if let Some(column) = load.coolant {
                cool(&names, &mut values, now, column);
            }
            let outputs = engine.step(time, &values).unwrap();
            for &place in &reasons {
                if with == 0 && [1.0, 2.0].contains(&outputs[place]) {
                    let day = (plan.outputs[place].name.clone(), (now / DAY_S) as i64);
                    *absent.entry(day).or_default() += (now - before) / 3600.0;
                }
            }
            before = now;
            for (nth, (&drift, &prediction)) in drifts.iter().zip(&predictions).enumerate() {
                let (truth, predicted) = (outputs[drift], outputs[prediction]);
                // A drift stands from one position to the next; it counts where it is new.
                if truth.is_finite() && predicted.is_finite() && truth != seen[nth] {
                    seen[nth] = truth;
                    sums[nth].0 += (predicted - truth).powi(2);
                    sums[nth].1 += 1.0;
                }
            }
        }
        errors.push(sums.into_iter().map(|(sum, count)| f64::sqrt(sum / count)));
    }
    let without = errors.pop().unwrap();
    let both = errors.pop().unwrap().zip(without);
    let most = absent.values().copied().fold(0.0, f64::max);
    (most, both.map(|(with, without)| [with, without]).collect())
}

/// A graph with `cross_check` and one in which it takes nothing out, and what both are fitted to.
fn fitted(machine: &str, extends: &str, hindsight: bool) -> ([Arc<Plan>; 2], Fitted) {
    let plans = ["", "nodes.trusted.limit = 1e12\n"].map(|more| {
        let more = format!("nodes.trusted.hindsight = {hindsight}\n{more}");
        let text = format!(
            "schema = 1\nextends = '{}'\nname = \"unusual-load\"\n{more}[outputs]\ndrift = \"drift\"\nwhy = \"trusted:reason\"\n",
            graph(extends).display()
        );
        let mut read = Read::new(&text);
        let plan = read.plan.take();
        Arc::new(plan.unwrap_or_else(|| panic!("{}", read.told())))
    });
    let known = find::<KnownMachine>(machine).unwrap().machine;
    let week = Simulated::new(known, Setup::default());
    let options = FitOptions::default();
    let fitted = fit(&plans[0], &week, &options, &mut |_| {}).unwrap().0;
    (plans, fitted)
}

#[test]
fn under_a_load_that_the_fit_never_saw_no_sensor_is_absent_and_predictions_are_as_without_cross_check()
 {
    let is_long = std::env::var_os("ATHERMAL_LONG").is_some();
    let graphs = [
        ("linear-axis", "linear-axis-virtual-sensor"),
        ("die-tester", "die-tester-virtual-sensor"),
    ];
    let (count, seeds, days) = if is_long {
        (2, 2..6, 2.25)
    } else {
        (1, 2..3, 0.6)
    };
    let mut loads = vec![
        (
            "motors heat eleven times as much".to_owned(),
            motors(1000.0, None),
        ),
        ("a lamp of 2 mK/s for a shift".to_owned(), lamp(2.0, 8.0)),
    ];
    if is_long {
        for percent in [30.0, 100.0, 300.0] {
            for hours in [Some(8.0), Some(24.0), None] {
                let name = format!("motors by {percent} % for {hours:?} h");
                loads.push((name, motors(percent, hours)));
            }
        }
        for size in [0.6, 2.0, 5.0] {
            loads.push((format!("a lamp of {size} mK/s for a day"), lamp(size, 24.0)));
        }
    }
    let mut wrong = Vec::new();
    for (machine, extends) in &graphs[..count] {
        let fitted = fitted(machine, extends, true);
        for (name, load) in &loads {
            for seed in seeds.clone() {
                let (hours, errors) = scored(machine, &fitted, load, days, seed);
                let ratios = errors.iter().map(|[with, without]| with / without);
                let worst = ratios.fold(0.0, f64::max);
                let found = format!(
                    "{machine}, {name}, seed {seed}: a sensor absent {hours:.1} h a day, errors at worst {worst:.3} of those without"
                );
                println!("{found}");
                if hours > 1.0 || worst.is_nan() || worst > 1.05 {
                    wrong.push(found);
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn truths_give_a_sensor_back_that_coolant_moves_with_its_body_and_none_that_it_moves_alone() {
    let [with, without] = [true, false]
        .map(|hindsight| fitted("linear-axis", "linear-axis-virtual-sensor", hindsight));
    let seeds = match std::env::var_os("ATHERMAL_LONG") {
        Some(_) => 2..6,
        None => 2..3,
    };
    for seed in seeds {
        // Of Z, which the column moves most.
        let scored = |fitted, column| {
            let load = Load {
                coolant: Some(column),
                ..Load::default()
            };
            let (hours, errors) = scored("linear-axis", fitted, &load, 1.0, seed);
            println!(
                "seed {seed}, column {column}: absent {hours:.2} h, errors {:.2?}",
                errors[2]
            );
            (hours, errors[2][0] / errors[2][1])
        };
        let (hours, ratio) = scored(&with, 1.0);
        assert!(hours <= 1.0 && ratio <= 1.1, "{hours} h, {ratio}");
        let (hours, ratio) = scored(&without, 1.0);
        assert!(hours > 3.0 && ratio > 1.3, "{hours} h, {ratio}");
        for fitted in [&with, &without] {
            let (hours, ratio) = scored(fitted, 0.0);
            assert!(hours > 3.0 && ratio < 1.0, "{hours} h, {ratio}");
        }
    }
}
