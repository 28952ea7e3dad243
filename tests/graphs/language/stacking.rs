//! What a stack learns from, and what it does while voters are absent.

use std::sync::Arc;

use athermal::core::node::Figure;
use athermal::run::fit::{FitOptions, FitProgress, Outcome, fit};
use athermal::run::recording::{Event, Table};
use athermal::{Engine, Instant};

use super::samples;
use crate::workbench::{Graph, numbers, plan, problems, slot};

/// A voter with two regressors, and one with so many that it fits its rows far too well.
fn nodes(stacked: &str) -> Graph {
    let linear = |graph: Graph, name: &str, features: &str| {
        let model = graph.model(name, "linear", features, "position.Z", "0s");
        model.with("solver = { type = 'ols' }; outside = 'pass'")
    };
    let past = samples().node("past", "lag", "temperature");
    let past = past.with("lags = ['0s', '10s', '20s', '30s', '40s']");
    linear(linear(past, "plain", "temperature"), "rich", "past")
        .vote("stack", "stack", "plain rich", "position.Z")
        .with(stacked)
        .outputs("out = 'stack'")
}

/// Few rows, ten seconds apart: two wandering temperatures, and a position that follows them.
fn few() -> Table {
    let mut table = Table::default();
    let rows = numbers(include_str!("../../oracles/stacking/input.csv"));
    for (seconds, row) in (0..).step_by(10).zip(rows) {
        table.push(Instant::from_ns(seconds * 1_000_000_000), &row);
    }
    table
}

#[test]
fn what_two_levels_learn_from_is_fitted_once() {
    let above = |name: &str, below: &str| {
        format!(
            "[nodes.{name}]\ntype = \"stack\"\ninputs.voters = [\"{below}\", \"plain\"]\n\
             inputs.truth = \"position.Z\"\nahead = \"0s\"\n"
        )
    };
    let graph = nodes("ahead = \"0s\"").replace(
        "[outputs]",
        &format!(
            "{}{}[outputs]\nhigher = \"higher\"\nhighest = \"highest\"",
            above("higher", "stack"),
            above("highest", "higher")
        ),
    );
    let mut table = Table::default();
    let rows = 4096;
    for second in 0..rows {
        let t = f64::from(second);
        let warm = (0.013 * t).sin();
        let values = [
            warm,
            (0.031 * t).cos(),
            3.0 * warm + 0.1 * (1.7 * t * t).sin(),
        ];
        table.push(
            Instant::from_ns(i64::from(second) * 10_000_000_000),
            &values,
        );
    }
    let mut told = (0, 0, 0);
    let plan = plan(&graph);
    let (_, report) = fit(&plan, &table, &FitOptions::default(), &mut |progress| {
        if let FitProgress::Ticks { stepped, fit, of } = progress {
            told = (stepped, fit, of);
        }
    })
    .unwrap();
    assert_eq!(report.estimators.len(), 5);
    // A level takes a pass, and one above others a pass for each of three folds. What lies below the third level is fitted
    // once on all ticks and once without each fold, and so on: 1, 1 + 3 + 3 · 1, 1 + 3 + 3 + 3 · 7 and 1 + 3 + 3 + 3 + 3 · 28.
    let stepped = 94 * u64::try_from(rows).unwrap();
    // The lowest is fitted once for all ticks, and each above with all that it asks for: once, and three times what the one
    // below it takes.
    let fits = 1 + 4 + 13 + 40;
    assert_eq!(told, (stepped, fits, fits));
}

#[test]
fn a_voter_that_only_knows_its_own_rows_by_heart_gets_little_weight_as_in_the_oracle() {
    let plan = plan(&nodes("ahead = \"0s\""));
    let table = few();
    let (fitted, report) = fit(&plan, &table, &FitOptions::default(), &mut |_| {}).unwrap();
    let of = |node: &str| {
        report
            .estimators
            .iter()
            .find(|fit| fit.node == node)
            .unwrap()
    };
    let report = |node: &str| match &of(node).outcome {
        Outcome::Fitted(report) => report.clone(),
        Outcome::Failed(error) => panic!("{node}: {error}"),
    };
    let rmse = |node: &str| report(node).in_sample_rmse.unwrap();
    assert!(
        rmse("rich") < 0.9 * rmse("plain"),
        "on its own rows the rich one looks better: {} {}",
        rmse("rich"),
        rmse("plain")
    );
    let stacked = report("stack");
    let Figure::Named(weights) = &stacked.figures["weights"] else {
        panic!("{stacked:?}");
    };
    let weight = |name: &str| weights[name].0;
    let expected = &numbers(include_str!("../../oracles/stacking/expected.csv"))[0];
    assert!(weight("rich.Z") < 0.25 * weight("plain.Z"), "{weights:?}");
    for (name, expected) in ["plain.Z", "rich.Z"].into_iter().zip(expected) {
        assert!((weight(name) - expected).abs() < 1e-9, "{weights:?}");
        let told = format!("{name} {expected:.3}");
        assert!(stacked.notes[0].contains(&told), "{:?}", stacked.notes);
    }

    // While the lags are cold the rich one is absent, and the plain one goes on alone.
    let mut engine = Engine::new(Arc::clone(&plan), &fitted).unwrap();
    for (tick, (event, values)) in table.events().iter().enumerate() {
        let Event::Row(now) = *event else {
            unreachable!()
        };
        engine.step(now, values).unwrap();
        let [rich, stack] = ["rich.Z", "stack.Z"].map(|name| engine.value(slot(&plan, name)));
        assert_eq!(rich.is_nan(), tick < 4, "{tick}");
        assert!(stack.is_finite(), "{tick}");
    }
}

#[test]
fn thirds_of_the_data_hold_as_many_truths_each() {
    let plan = plan(&nodes("ahead = \"0s\""));
    let mut table = Table::default();
    for tick in 0..900_i32 {
        let t = f64::from(tick);
        let (warm, calm) = ((0.13 * t).sin(), (0.031 * t).cos());
        // Positions are measured in the first third, and seldom later.
        let measured = tick < 300 || (600..606).contains(&tick);
        let position = 3.0 * warm - calm + 0.1 * (1.7 * t * t).sin();
        let position = if measured { position } else { f64::NAN };
        let now = Instant::from_ns(i64::from(tick) * 10_000_000_000);
        table.push(now, &[warm, calm, position]);
    }
    let (_, report) = fit(&plan, &table, &FitOptions::default(), &mut |_| {}).unwrap();
    let stack = report.estimators.iter().find(|fit| fit.node == "stack");
    let stack = stack.unwrap();
    // The lags of one voter are cold in the first rows, which so are not complete.
    assert_eq!(stack.rows + stack.dropped.incomplete, 306);
    let Outcome::Fitted(report) = &stack.outcome else {
        panic!("{:?}", stack.outcome);
    };
    let Figure::Named(weights) = &report.figures["weights"] else {
        panic!("{report:?}");
    };
    let sum: f64 = weights.values().map(|weight| weight.0).sum();
    assert!((sum - 1.0).abs() < 0.05, "{weights:?}");
    assert!(report.in_sample_rmse.unwrap() < 0.15, "{report:?}");
}

#[test]
fn votes_for_another_instant_than_the_stack_predicts_are_told() {
    let told = problems(&nodes("ahead = \"1min\""));
    assert!(told.contains("A050"), "{told}");
    assert!(
        told.contains("`plain.Z` looks 0s ahead and `stack` 1min"),
        "{told}"
    );
}

/// Two temperatures that know of different parts of a position, 600 rows.
fn parts() -> Table {
    let mut table = Table::default();
    let mut state = 7_u64;
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as f64 / f64::from(1 << 30) - 1.0
    };
    for row in 0..600 {
        let (one, other) = (random(), random());
        let position = 3.0 * one + 4.0 * other + 0.5 * random();
        table.push(
            Instant::from_ns(row * 10_000_000_000),
            &[one, other, position],
        );
    }
    table
}

#[test]
fn a_stack_of_stacks_of_stacks_trusts_the_one_that_knows_most() {
    let mut text = samples();
    for (name, of) in [("one", "temperature.room"), ("other", "temperature.chuck")] {
        text = text.model(name, "linear", of, "position.Z", "0s");
    }
    for (name, voters) in [
        ("first", ["one", "other"]),
        ("second", ["one", "first"]),
        ("third", ["one", "second"]),
    ] {
        let stack = text.vote(name, "stack", &voters.join(" "), "position.Z");
        text = stack.with("ahead = '0s'");
    }
    let plan = plan(&text.outputs("out = 'third'"));
    let (_, report) = fit(&plan, &parts(), &FitOptions::default(), &mut |_| {}).unwrap();
    let error = |node: &str| {
        let fit = report.estimators.iter().find(|fit| fit.node == node);
        match &fit.unwrap().outcome {
            Outcome::Fitted(report) => report.in_sample_rmse.unwrap(),
            Outcome::Failed(error) => panic!("{node}: {error}"),
        }
    };
    // Out of fold each of them errs as the one below it does.
    let [first, second, third] = ["first", "second", "third"].map(error);
    assert!(first < 0.6 * error("other"), "{first}");
    assert!((second / first - 1.0).abs() < 0.05, "{first}, {second}");
    assert!((third / first - 1.0).abs() < 0.05, "{first}, {third}");
}

/// What a stack finds over a voter that goes on learning, frozen by what is given.
fn stacked_over(learning: &str) -> (f64, Vec<f64>) {
    let graph = samples()
        .model("alone", "linear", "temperature.chuck", "position.Z", "0s")
        .model("level", "linear", "temperature.chuck", "position.Z", "0s")
        .vote("higher", "stack", "['level']", "position.Z")
        .with("ahead = '0s'")
        .node("never", "scale", "alone")
        .with("factor = 0.0")
        .node("never_higher", "scale", "higher")
        .with("factor = 0.0")
        .model("learns", "rls", "temperature.room", "position.Z", "0s")
        .with("memory = '100s'")
        .with(learning)
        .model("stays", "linear", "temperature.room", "position.Z", "0s")
        .vote("stack", "stack", "learns stays", "position.Z")
        .with("ahead = '0s'")
        .outputs("out = 'stack'; level = 'never'; higher = 'never_higher'");
    let mut table = Table::default();
    for row in 0..600_u32 {
        let t = f64::from(row);
        let (room, chuck) = ((0.7 * t).sin(), (0.3 * t).cos());
        // What a kelvin does changes as time goes on.
        let per_kelvin = 1.0 + (0.01 * t).sin();
        let values = [room, chuck, per_kelvin * room + 0.1 * chuck];
        table.push(Instant::from_ns(i64::from(row) * 10_000_000_000), &values);
    }
    let plan = plan(&graph);
    let (_, report) = fit(&plan, &table, &FitOptions::default(), &mut |_| {}).unwrap();
    let of_stack = report.estimators.iter().find(|fit| fit.node == "stack");
    let Outcome::Fitted(report) = &of_stack.unwrap().outcome else {
        panic!("{report:?}")
    };
    let Figure::Named(weights) = &report.figures["weights"] else {
        panic!("{report:?}");
    };
    let weights = ["learns.Z", "stays.Z"].map(|name| weights[name].0);
    (report.in_sample_rmse.unwrap(), weights.to_vec())
}

#[test]
fn what_freezes_a_voter_is_fitted_with_it_in_folds() {
    const LEARNS: &str = "learn = { outliers = inf, margin = inf }";
    let free = stacked_over(LEARNS);
    let frozen = stacked_over("learn = false");
    // A voter that learns follows what changes, and one that is frozen throughout does not.
    assert!(free.0 < 0.5 * frozen.0, "{free:?} {frozen:?}");
    // What freezes it is never anything but 0, where it is fitted: the same as if nothing did.
    for gate in ["never", "never_higher"] {
        let gated = stacked_over(&format!("{LEARNS}\ninputs.freeze = \"{gate}\""));
        assert_eq!(gated, free, "{gate}");
    }
}
