//! A new machine of a fleet, from two hours of its own data and what the other machines have in common, beside a week of its own.
//! `ATHERMAL_LONG=1` takes 30 machines and ten new ones, of a week each.

use std::sync::Arc;

use athermal::core::compile::{Plan, Wanted};
use athermal::core::engine::Fitted;
use athermal::core::registry::find;
use athermal::run::fit::{FitOptions, fit};
use athermal::run::model::Model;
use athermal::run::recording::{Event, Recording, Table};
use athermal::run::score::{ScoreOptions, TruthTrace, score, trace};
use athermal::trial::machine::{Individual, KnownMachine, Setup, Simulated};
use athermal_estimators::Pooling;

use crate::workbench::{Scratch, compiled, graph};

const AXES: usize = 6;
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
    Simulated::new(find::<KnownMachine>("die-tester").unwrap().machine, setup)
}

/// The graph of the fleet, whose estimators have these keys of their solver.
fn plan(solver: &str) -> Arc<Plan> {
    Arc::new(compiled(&of_fleet(solver)).unwrap_or_else(|problems| panic!("{problems}")))
}

fn of_fleet(solver: &str) -> String {
    format!(
        "schema = 1\nextends = '{}'\nname = \"new\"\n[nodes.expansion.solver]\n{solver}\n",
        graph("die-tester-fleet").display()
    )
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

/// What is scored apart: quiet or stepping hours, and truths of which size in nm/min. The graph is fitted on truths below 150, and its
/// own tests score those below 250.
const PARTS: [(bool, f64); 4] = [
    (false, f64::INFINITY),
    (true, f64::INFINITY),
    (true, 250.0),
    (true, 150.0),
];

/// The root mean square error of each axis in each part, paired as in scoring.
fn errors(plan: &Arc<Plan>, fitted: &Fitted, on: &Table) -> Vec<[f64; PARTS.len()]> {
    let trace = trace(plan, fitted, on, &mut |_, _| {}).unwrap();
    let of_axis = |axis: &TruthTrace| {
        let [prediction] = &axis.predictions[..] else {
            panic!("{} predictions", axis.predictions.len());
        };
        PARTS.map(|(stepping, below)| {
            let (mut sum, mut count) = (0.0, 0.0);
            let values = axis.values.iter().zip(&prediction.values);
            for ((_, at), (truth, predicted)) in axis.times.iter().zip(values) {
                let at_s = at.as_ns() / 1_000_000_000;
                let is_stepping = at_s >= HOLD_S && at_s % HOLD_S < STEPPING_S;
                let counts = is_stepping == stepping && truth.abs() < below;
                if counts && predicted.is_finite() {
                    sum += (predicted - truth).powi(2);
                    count += 1.0;
                }
            }
            assert!(count > 100.0, "{count} truths");
            f64::sqrt(sum / count)
        })
    };
    assert_eq!(trace.truths.len(), AXES);
    trace.truths.iter().map(of_axis).collect()
}

/// How many truths of each axis there are, of any size or below so many nm/min, and how many lie in the intervals that are to cover nine
/// tenths of them.
fn covered(plan: &Arc<Plan>, fitted: &Fitted, on: &Table, below: Option<&str>) -> Vec<[f64; 2]> {
    let options = ScoreOptions {
        abs_truth_below: below.map(|of| of.parse().unwrap()),
        ..ScoreOptions::default()
    };
    let scores = score(plan, fitted, on, &options, &mut |_| {}).unwrap();
    let of = scores.scores.iter().map(|of| {
        let interval = of.interval.as_ref().unwrap();
        assert_eq!(interval.stated, 0.9);
        [interval.n as f64, interval.n as f64 * interval.covered]
    });
    of.collect()
}

/// Geometric means over axes and machines of errors over those of a week, in each part.
#[derive(Debug, Default)]
struct Ratios {
    logs: [f64; PARTS.len()],
    count: f64,
}

impl Ratios {
    fn add(&mut self, errors: &[[f64; PARTS.len()]], of_week: &[[f64; PARTS.len()]]) {
        for (own, week) in errors.iter().zip(of_week) {
            self.count += 1.0;
            for part in 0..PARTS.len() {
                self.logs[part] += (own[part] / week[part]).ln();
            }
        }
    }

    fn means(&self) -> [f64; PARTS.len()] {
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
    let text = of_fleet(&prior);
    let scored = Model::load_for(scratch.file("new.toml", text), Wanted::SCORES);
    let scored = scored.unwrap().plan;
    let (with, mean) = (plan(&prior), plan(&format!("{prior}\nprior_weight = 1e9")));
    // Two hours without a step of the chuck, and two with one; what the error may be at most. A twentieth more than that of a week is
    // the aim. It is missed in quiet hours after two with a step, and of the truths below 150 nm/min in stepping ones.
    let bounds = if is_long {
        [(1, [1.05, 1.0, 1.05, 1.13]), (3, [1.075, 1.0, 1.05, 1.08])]
    } else {
        [(1, [1.1; 4]), (3, [1.1; 4])]
    };
    for (start, most) in bounds {
        let mut ratios: [Ratios; 3] = Default::default();
        let mut intervals = [None, Some("150 nm/min")].map(|below| (below, vec![[0.0; 2]; AXES]));
        for of in 101..101 + new {
            let own = Table::read(&days(length, of, of), &plain).unwrap();
            let later = Table::read(&days(2.0, of, 1000 + of), &plain).unwrap();
            let week = errors(&plain, &fitted(&plain, &own), &later);
            let hours = part(&own, start * 3600, (start + 2) * 3600);
            for (plan, ratios) in [&with, &mean, &plain].into_iter().zip(&mut ratios) {
                ratios.add(&errors(plan, &fitted(plan, &hours), &later), &week);
            }
            let own = fitted(&with, &hours);
            for (below, axes) in &mut intervals {
                let found = covered(&scored, &own, &later, *below);
                assert_eq!(found.len(), AXES);
                for (sum, own) in axes.iter_mut().flatten().zip(found.iter().flatten()) {
                    *sum += own;
                }
            }
        }
        let [with, mean, without] = ratios.map(|of| of.means());
        println!(
            "two hours from hour {start}, over a week; quiet hours, stepping hours, there truths below 250 and 150 nm/min: with the prior \
             {with:.3?}, its mean alone {mean:.3?}, without {without:.3?}"
        );
        for (below, axes) in intervals {
            let shares: Vec<f64> = axes.iter().map(|[all, within]| within / all).collect();
            println!(
                "90 % intervals of each axis, truths below {}: {shares:.3?}",
                below.unwrap_or("any")
            );
            // Z2 misses 0.85: its errors are larger in some hours than in others.
            let least = if is_long { 0.83 } else { 0.78 };
            assert!(shares.iter().all(|share| *share > least), "{shares:?}");
        }
        for (part, most) in most.into_iter().enumerate() {
            let [with, mean, without] = [with, mean, without].map(|of| of[part]);
            assert!(with < most, "{with} in {:?}", PARTS[part]);
            let share = if is_long { 0.95 } else { 1.0 };
            assert!(
                with < share * mean,
                "{with} and {mean} in {:?}",
                PARTS[part]
            );
            assert!(
                with < 0.8 * without,
                "{with} and {without} in {:?}",
                PARTS[part]
            );
        }
    }
}
