//! Truth reaches whoever learns from it only when it has been measured, and late enough to share nothing with what is
//! predicted.

use std::sync::Arc;

use athermal::files::{Dataset, Options};
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::{Event, Recording, Samples, Table};
use athermal::run::score::{ScoreOptions, score};
use athermal::{Engine, Instant};

use super::slopes;
use crate::workbench::{Bench, Graph, data, linear, plan, slot};

/// A combiner over a voter that always answers, so that whatever it is told can be seen.
fn watched(ahead: &str, truth: &str, kind: &str) -> Graph {
    let memory = ["", "memory = '15min'"][usize::from(kind == "auto_weighted")];
    slopes()
        .model("still", "zero", "", truth, ahead)
        .model("warm", "linear", "temperature", truth, ahead)
        .vote("vote", kind, "still warm", truth)
        .with(memory)
        .outputs("out = 'vote'; also = 'gradients'")
}

#[test]
fn the_truth_of_a_tick_does_not_touch_its_outputs() {
    let warm = linear(&[("temperature.room", 1.0)], 0.0);
    let run = |last: f64| {
        let mut bench = Bench::new(
            &watched("10s", "position.Z", "auto_weighted"),
            &[("warm", warm.clone())],
        );
        for tick in 0..20 {
            bench.tick(
                10.0 * f64::from(tick),
                &[("temperature.room", 21.0), ("position.Z", 3.0)],
            );
        }
        let at_once = bench.tick(200.0, &[("temperature.room", 21.0), ("position.Z", last)]);
        let after = bench.tick(210.0, &[("temperature.room", 21.0)]);
        (at_once[0], after[0])
    };
    let (one, other) = (run(3.0), run(3e6));
    assert!(one.0.is_finite());
    assert_eq!(one.0.to_bits(), other.0.to_bits());
    assert_ne!(
        one.1.to_bits(),
        other.1.to_bits(),
        "the next tick must know of it, or this proves nothing"
    );
}

/// What a combiner has been told at each tick, against the embargo worked out from the list of truths.
fn check_embargo(ahead_s: f64, truth: &str, span_s: f64) {
    let ahead = format!("{ahead_s}s");
    let text = watched(&ahead, truth, "test_newest_arrival");
    let mut bench = Bench::new(&text, &[]);
    let mut truths: Vec<f64> = Vec::new();
    let mut informed = 0;
    for tick in 0..400 {
        let now = 10.0 * f64::from(tick);
        let mut samples = vec![("temperature.room", 21.0)];
        // Positions come irregularly, about every 75 s.
        if tick % 7 == 0 || tick % 15 == 2 {
            samples.push(("position.Z", (0.01 * now).sin()));
        }
        bench.tick(now, &samples);
        let told = bench.value("vote.Z");
        let allowed = now + (ahead_s - span_s).min(0.0);
        let expected = truths.iter().copied().rfind(|&tau| tau <= allowed);
        assert_eq!(
            told,
            expected.unwrap_or(-1.0),
            "at {now} s with {ahead_s} s ahead of {truth}"
        );
        informed += usize::from(expected.is_some());
        // A truth counts from the tick after the one that measured it, and where a run belongs to it.
        if !bench.value(truth).is_nan() && now >= ahead_s {
            truths.push(now);
        }
    }
    assert!(informed > 200, "{informed}");
}

#[test]
fn a_virtual_sensor_knows_no_truth_younger_than_the_span() {
    check_embargo(0.0, "drift.Z", 300.0);
}

#[test]
fn half_a_window_ahead_no_truth_younger_than_the_other_half_is_known() {
    check_embargo(150.0, "drift.Z", 300.0);
}

#[test]
fn a_forecast_over_the_whole_span_knows_every_truth_measured_before() {
    check_embargo(300.0, "drift.Z", 300.0);
    check_embargo(900.0, "drift.Z", 300.0);
}

#[test]
fn of_plain_samples_every_one_measured_before_is_known() {
    check_embargo(0.0, "position.Z", 0.0);
}

/// The graph whose last node adds 0.7 of the last residual that it knows of to the ARX estimate.
const TRICK: &str = r#"
schema = 1
extends = "die-tester-sensor.toml"
[nodes.trick]
type = "test_last_residual"
each = "axis"
inputs.voters = ["both.{axis}"]
inputs.truth = "drift.{axis}"
share = 0.7
[outputs]
predicted = "vote"
tricked = "trick"
"#;

#[test]
fn reference_adding_the_last_residual_does_not_help() {
    let Some(data) = data() else { return };
    let plan = plan(TRICK);
    let file = |name: &str| {
        let path = data.join("die-tester").join(name);
        Dataset::new(vec![path], Options::default())
    };
    let test = Table::read(&file("test.csv"), &plan).unwrap();
    let (fitted, _) = fit(
        &plan,
        &file("train.csv"),
        &FitOptions::default(),
        &mut |_| {},
    )
    .unwrap();
    let options = ScoreOptions {
        abs_truth_below: "250 nm/min".parse().ok(),
        ..ScoreOptions::default()
    };
    let scores = score(&plan, &fitted, &test, &options, &mut |_| {})
        .unwrap()
        .scores;
    let rmse = |output: String| {
        scores
            .iter()
            .find(|score| score.output == output)
            .unwrap()
            .rmse
            .unwrap()
    };
    let (mut with, mut without) = (Vec::new(), Vec::new());
    for axis in ["X1", "Y1", "Z1", "X2", "Y2", "Z2"] {
        with.push(rmse(format!("trick.{axis}")) / rmse(format!("both.{axis}")));
        // The same trick, had it been told each truth as soon as it was measured.
        let (mut plain, mut cheat) = (0.0, 0.0);
        for neighbours in pairs_at_the_same_tick(&plan, &fitted, &test, axis).windows(2) {
            let [(before, truth_before), (now, truth)] = neighbours else {
                unreachable!()
            };
            if truth.abs() < 250.0 {
                plain += (now - truth).powi(2);
                cheat += (now + 0.7 * (truth_before - before) - truth).powi(2);
            }
        }
        without.push(f64::sqrt(cheat / plain));
    }
    println!("{with:?}\n{without:?}");
    // On an axis whose creep outlasts the embargo the trick may still gain a little (2 % on Z1): that is knowledge of
    // the past. What overlaps is worth much more, and on every axis.
    let mean = |ratios: &[f64]| ratios.iter().sum::<f64>() / ratios.len() as f64;
    assert!(mean(&with) > 1.0, "the trick is worth {with:?}");
    assert!(with.iter().all(|&ratio| ratio > 0.97), "{with:?}");
    assert!(
        mean(&without) < 0.95 && without.iter().all(|&ratio| ratio < 1.0),
        "without the embargo it would be, and this proves nothing: {without:?}"
    );
}

/// The ARX estimate and the truth at every tick that has both.
fn pairs_at_the_same_tick(
    plan: &Arc<athermal::core::compile::Plan>,
    fitted: &athermal::core::engine::Fitted,
    recording: &dyn Recording,
    axis: &str,
) -> Vec<(f64, f64)> {
    let (both, drift) = (
        slot(plan, &format!("both.{axis}")),
        slot(plan, &format!("drift.{axis}")),
    );
    let mut engine = Engine::new(Arc::clone(plan), fitted).unwrap();
    let mut rows = recording.open(plan).unwrap();
    let mut samples = Samples::default();
    let mut pairs = Vec::new();
    while let Some(event) = rows.next(&mut samples).unwrap() {
        let Event::Row(time) = event else {
            panic!("one segment")
        };
        engine.step(time, &samples.values).unwrap();
        let pair = (engine.value(both), engine.value(drift));
        if !pair.0.is_nan() && !pair.1.is_nan() {
            pairs.push(pair);
        }
    }
    pairs
}

#[test]
fn a_truth_belongs_to_the_last_run_at_or_before_its_horizon_and_to_none_long_before() {
    // Temperatures stop at 600 s for 20 min; drift goes on. A run at τ − ahead or up to one span before it counts.
    let plan = plan(
        &slopes()
            .model("warm", "linear", "temperature", "drift.Z", "0s")
            .outputs("out = 'warm'; also = 'gradients'"),
    );
    let mut table = Table::default();
    let mut paired = 0;
    let mut unpaired = 0;
    for tick in 0..300_u32 {
        let now = 10.0 * f64::from(tick);
        let runs = now <= 600.0 || now > 1800.0;
        let temperature = if runs {
            21.0 + (0.1 * now).sin()
        } else {
            f64::NAN
        };
        table.push(
            Instant::from_ns(i64::from(tick) * 10_000_000_000),
            &[temperature, temperature, now * now],
        );
        if now >= 300.0 {
            let close = now <= 900.0 || now > 1800.0;
            paired += u64::from(close);
            unpaired += u64::from(!close);
        }
    }
    let (_, report) = fit(&plan, &table, &FitOptions::default(), &mut |_| {}).unwrap();
    let fitted = &report.estimators[0];
    assert_eq!(
        (fitted.rows, fitted.dropped.without_run),
        (paired, unpaired)
    );
}
