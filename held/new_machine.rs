//! A new machine of a fleet, from two hours of its own data and what the other machines have in common, beside a week of its own.
//! `ATHERMAL_LONG=1` takes 30 machines and ten new ones, of a week each.

use std::sync::Arc;

use athermal::core::compile::Plan;
use athermal::core::engine::{Engine, Fitted};
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::{Event, Recording, Table};
use athermal::trial::machine::{Individual, Setup, Simulated, machine};
use athermal_estimators::Pooling;

use crate::workbench::{Scratch, compiled, graph};

const AXES: [&str; 6] = ["X1", "Y1", "Z1", "X2", "Y2", "Z2"];
/// The chuck goes to another temperature every so often; the hour after it is a stepping one.
const HOLD_S: i64 = 4 * 3600;
const STEPPING_S: i64 = 3600;

/// Days of one machine of the fleet.
fn days(days: f64, of: u64, seed: u64) -> Simulated<'static> {
    let setup = Setup {
        days,
        seed,
        individual: Individual {
            spread: "30%".parse().unwrap(),
            seed: of,
        },
        ..Setup::default()
    };
    Simulated::new(machine("die-tester").unwrap().machine, setup)
}

/// The graph of the fleet, whose estimators have these keys of their solver, with the drift beside the predictions.
fn plan(solver: &str) -> Arc<Plan> {
    let text = format!(
        "schema = 1\nextends = '{}'\nname = \"new\"\n[nodes.expansion.solver]\n{solver}\n\
         [outputs]\ndrift = \"drift\"\npredicted = \"expansion\"\n",
        graph("die-tester-fleet").display()
    );
    Arc::new(compiled(&text).unwrap_or_else(|problems| panic!("{problems}")))
}

fn fitted(plan: &Arc<Plan>, on: &dyn Recording) -> Fitted {
    fit(plan, on, &FitOptions::default(), &mut |_| {})
        .unwrap()
        .0
}

/// The part of a recording that lies between two instants in s.
fn part(table: &Table, from_s: i64, to_s: i64) -> Table {
    let mut part = Table::default();
    for (event, values) in table.events() {
        if let Event::Row(time) = event
            && (from_s..to_s).contains(&(time.as_ns() / 1_000_000_000))
        {
            part.push(*time, values);
        }
    }
    part
}

/// Whether the hour is a stepping one, and the truth and the prediction, for each axis at each instant of a truth.
type Predictions = Vec<Vec<(bool, f64, f64)>>;

fn predictions(plan: &Arc<Plan>, fitted: &Fitted, on: &Table) -> Predictions {
    let mut engine = Engine::new(Arc::clone(plan), fitted).unwrap();
    let place = |name: String| plan.outputs.iter().position(|of| of.name == name).unwrap();
    let places = AXES.map(|axis| ["drift", "predicted"].map(|of| place(format!("{of}.{axis}"))));
    let mut all = vec![Vec::new(); AXES.len()];
    for (event, values) in on.events() {
        let Event::Row(time) = *event else { continue };
        let outputs = engine.step(time, values).unwrap();
        let now_s = time.as_ns() / 1_000_000_000;
        let is_stepping = now_s >= HOLD_S && now_s % HOLD_S < STEPPING_S;
        for (axis, [truth, predicted]) in all.iter_mut().zip(places) {
            axis.push((is_stepping, outputs[truth], outputs[predicted]));
        }
    }
    all
}

/// The root mean square error of each axis, in quiet hours and in stepping ones.
fn errors(of: &Predictions) -> Vec<[f64; 2]> {
    let of_axis = |axis: &Vec<(bool, f64, f64)>| {
        [false, true].map(|stepping| {
            let (mut sum, mut count, mut before) = (0.0, 0.0, f64::NAN);
            for &(is_stepping, truth, predicted) in axis {
                // A drift stands from one position to the next; it counts where it is new.
                let is_new = truth != before;
                before = truth;
                if is_stepping == stepping && is_new && truth.is_finite() && predicted.is_finite() {
                    sum += (predicted - truth).powi(2);
                    count += 1.0;
                }
            }
            assert!(count > 20.0, "{count} truths");
            f64::sqrt(sum / count)
        })
    };
    of.iter().map(of_axis).collect()
}

/// Geometric means over axes and machines of errors over those of a week, in quiet hours and in stepping ones.
#[derive(Debug, Default)]
struct Ratios {
    logs: [f64; 2],
    count: f64,
}

impl Ratios {
    fn add(&mut self, errors: &[[f64; 2]], of_week: &[[f64; 2]]) {
        for (own, week) in errors.iter().zip(of_week) {
            self.count += 1.0;
            for part in 0..2 {
                self.logs[part] += (own[part] / week[part]).ln();
            }
        }
    }

    fn means(&self) -> [f64; 2] {
        self.logs.map(|log| (log / self.count).exp())
    }
}

#[test]
fn two_hours_with_the_prior_of_a_fleet_are_nearly_as_good_as_a_week() {
    let is_long = std::env::var_os("ATHERMAL_LONG").is_some();
    let (fleet, new, length) = if is_long { (30, 10, 7.0) } else { (8, 2, 1.5) };
    let scratch = Scratch::new("new-machine");
    let plain = plan("");
    let mut pooling = Pooling::new(fleet, "2h".parse().unwrap());
    for of in 1..=fleet as u64 {
        let watch = pooling.watched(&plain).unwrap();
        fitted(&watch.plan, &days(length, of, of));
        pooling.add(&format!("machine{of}"), watch);
    }
    let prior = serde_json::to_string(&pooling.finish().0).unwrap();
    let prior = format!("prior = '{}'", scratch.file("type.json", prior).display());
    let (with, mean) = (plan(&prior), plan(&format!("{prior}\nprior_weight = 1e9")));
    // Two hours without a step of the chuck, and two with one.
    for start in [1, 3] {
        let mut ratios: [Ratios; 3] = Default::default();
        for of in 101..101 + new {
            let own = Table::read(&days(length, of, of), &plain).unwrap();
            let later = Table::read(&days(2.0, of, 1000 + of), &plain).unwrap();
            let week = errors(&predictions(&plain, &fitted(&plain, &own), &later));
            let hours = part(&own, start * 3600, (start + 2) * 3600);
            for (plan, ratios) in [&with, &mean, &plain].into_iter().zip(&mut ratios) {
                let own = errors(&predictions(plan, &fitted(plan, &hours), &later));
                ratios.add(&own, &week);
            }
        }
        let [with, mean, without] = ratios.map(|of| of.means());
        println!(
            "two hours from hour {start}, over a week, quiet and stepping hours: with the prior {with:.3?}, its mean alone {mean:.3?}, \
             without {without:.3?}"
        );
    }
}
