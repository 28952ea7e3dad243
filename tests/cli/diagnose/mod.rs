//! What `athermal diagnose` says is true: facts against formulas and against recordings made so that the answer is known.
//! Decides how near is near enough.

mod lags;
mod pictures;
mod program;
mod reach;
use std::sync::Arc;

use crate::workbench::{Graph, Scratch, graph, linear, secs, simulated};
use athermal::core::node::Predictor;
use athermal::core::prng::Prng;
use athermal::diagnosis::{
    Options, day, diagnose, observe, regressor, residual, response, sensor, window,
};
use athermal::files::Dataset;
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::{Event, Table};
use athermal::run::score::trace;
use athermal::{Duration, Instant, Model};

/// Two temperatures and a position, every 10 s, and an estimator whose coefficients the test gives.
fn two_sensors() -> Graph {
    Graph::named("two-sensors")
        .time("time_s")
        .signal("temperature", "Cel", "a b", "1min")
        .signal("position", "nm", "z", "1min")
        .slope("drift", "position", "5min", "nm/min")
        .slope("gradients", "temperature", "150s 10min", "mK/min")
        .model("thermal", "linear", "gradients", "drift.z", "0s")
        .outputs("predicted = 'thermal'")
}

fn model(test: &str, text: &str, fitted: &[(&str, Arc<dyn Predictor>)]) -> Model {
    let scratch = Scratch::new(test);
    let mut model = Model::load(scratch.file("graph.toml", text)).unwrap();
    for (node, predictor) in fitted {
        model
            .fitted
            .insert((*node).to_owned(), Arc::clone(predictor));
    }
    model
}

/// Temperatures that wander, and a position made of them, every 10 s.
fn wandering(rows: usize, position: impl Fn(&[[f64; 2]], usize) -> f64) -> Table {
    let mut random = Prng::stream(3, "wandering");
    let (mut table, mut at) = (Table::default(), [20.0, 30.0]);
    let mut rate = [0.0_f64; 2];
    let mut course = Vec::new();
    for row in 0..rows {
        for (rate, at) in rate.iter_mut().zip(&mut at) {
            *rate = 0.98 * *rate + 0.001 * random.normal();
            *at += *rate;
        }
        course.push(at);
        table.push(
            secs(10.0 * row as f64),
            &[at[0], at[1], position(&course, row)],
        );
    }
    table
}

/// What a least-squares slope over `window_s` of samples `every_s` apart makes of an impulse so many samples ago, per s.
fn frame(window_s: f64, every_s: f64, age: usize) -> f64 {
    let n = window_s / every_s;
    let age = age as f64;
    if age >= n {
        return 0.0;
    }
    12.0 * ((n - 1.0) / 2.0 - age) / (n * (n * n - 1.0) * every_s)
}

#[test]
fn an_impulse_response_is_the_sum_of_the_frame_times_its_coefficients() {
    let terms = [
        ("gradients.a@150s", 0.4),
        ("gradients.a@600s", -0.1),
        ("gradients.b@600s", 0.7),
    ];
    let model = model(
        "impulse",
        &two_sensors(),
        &[("thermal", linear(&terms, 5.0))],
    );
    let table = wandering(600, |course, row| 1000.0 * course[row][0]);
    let observation = observe(&model, &table).unwrap();
    let found = response::responses(&model, &observation).unwrap();
    assert_eq!(found.len(), 1);
    let [a, b] = &found[0].sensors[..] else {
        panic!("{found:?}")
    };
    let per_minute_and_millikelvin = 60.0 * 1000.0;
    let impulse_lasts_min = 10.0 / 60.0;
    for age in 0..a.impulse.len() {
        let of =
            |window_s| frame(window_s, 10.0, age) * per_minute_and_millikelvin / impulse_lasts_min;
        let (expected_a, expected_b) = (0.4 * of(150.0) - 0.1 * of(600.0), 0.7 * of(600.0));
        assert!(
            (a.impulse[age] - expected_a).abs() < 1e-6,
            "{age}: {} {expected_a}",
            a.impulse[age]
        );
        assert!(
            (b.impulse[age] - expected_b).abs() < 1e-6,
            "{age}: {} {expected_b}",
            b.impulse[age]
        );
        assert!((a.time_s[age] - 10.0 * age as f64).abs() < 1e-9);
    }
    // A step of 1 K in the end: the sum of the coefficients in nm per mK.
    let [of_a, of_b] = [a, b].map(|of| of.total.unwrap());
    assert!((of_a - 300.0).abs() < 1e-6 && (of_b - 700.0).abs() < 1e-6);
    assert!(a.asymmetry < 1e-9, "{}", a.asymmetry);
    // The step response of one window is a parabola with its top in the middle.
    assert!((b.peak_s - 300.0).abs() <= 10.0, "{}", b.peak_s);
    assert!(
        b.settled_s
            .is_some_and(|settled| (400.0..600.0).contains(&settled))
    );
}

#[test]
fn an_answer_that_lasts_has_a_gain_and_no_sum() {
    let text = two_sensors().replace(
        "inputs.features = \"gradients\"",
        "inputs.features = \"temperature\"",
    );
    let terms = [("temperature.a", 3.0)];
    let model = model("lasting", &text, &[("thermal", linear(&terms, 0.0))]);
    let table = wandering(600, |course, row| 1000.0 * course[row][0]);
    let observation = observe(&model, &table).unwrap();
    let found = response::responses(&model, &observation).unwrap();
    let [of] = &found[0].sensors[..] else {
        panic!("{found:?}")
    };
    assert_eq!((of.total, of.settled_s, of.peak_s), (None, Some(0.0), 0.0));
    assert!(of.gain.is_some_and(|gain| (gain - 3.0).abs() < 1e-9));
    assert!(of.step.iter().all(|step| (step - 3.0).abs() < 1e-9));
}

#[test]
fn what_a_level_leaves_for_good_is_told_beside_slopes_that_answer_far_more() {
    let text = two_sensors().replace(
        "inputs.features = \"gradients\"",
        "inputs.features = [\"gradients\", \"temperature\"]",
    );
    let terms = [("gradients.a@150s", 0.4), ("temperature.a", -0.03)];
    let model = model("for-good", &text, &[("thermal", linear(&terms, 0.0))]);
    let table = wandering(600, |course, row| 1000.0 * course[row][0]);
    let observation = observe(&model, &table).unwrap();
    let found = response::responses(&model, &observation).unwrap();
    let [of] = &found[0].sensors[..] else {
        panic!("{found:?}")
    };
    assert!(of.peak > 100.0 * 0.03, "{}", of.peak);
    assert_eq!(of.total, None);
    assert!(of.gain.is_some_and(|gain| (gain + 0.03).abs() < 1e-9));
}

#[test]
fn an_estimator_that_reads_past_truths_answers_as_its_transfer_function() {
    let text = two_sensors()
        .replace("type = \"linear\"", "type = \"arx\"\nlags = [\"10s\"]")
        .replace("\"drift.z\"", "\"position.z\"")
        .replace("\"gradients\"", "\"temperature\"");
    let terms = [("temperature.a", 2.0), ("position.z lag 10s", 0.8)];
    let model = model("transfer", &text, &[("thermal", linear(&terms, 0.0))]);
    let table = wandering(600, |course, row| 1000.0 * course[row][0]);
    let observation = observe(&model, &table).unwrap();
    let found = response::responses(&model, &observation).unwrap();
    let [of] = &found[0].sensors[..] else {
        panic!("{found:?}")
    };
    // `y(t) = 0.8 y(t − 1) + 2 u(t)`, of which a step brings about `2 (1 − 0.8ⁿ) / (1 − 0.8)` by its n-th sample.
    assert!(of.step.len() > 20, "{}", of.step.len());
    for (nth, step) in (1..).zip(&of.step) {
        let expected = 2.0 * (1.0 - 0.8_f64.powi(nth)) / (1.0 - 0.8);
        assert!((step - expected).abs() < 1e-6, "{nth}: {step} {expected}");
    }
    assert!(of.gain.is_some_and(|gain| (gain - 10.0).abs() < 1e-3));
    assert!(of.time_s.contains(&of.peak_s), "{}", of.peak_s);
    // Nine tenths have come when `0.8ⁿ` is a tenth, at the eleventh sample.
    assert_eq!((of.total, of.settled_s), (None, Some(100.0)));
    assert!(of.asymmetry < 1e-9, "{}", of.asymmetry);
}

/// Two series that nothing predicts: each truth is all residual.
fn noise() -> Graph {
    Graph::named("noise")
        .time("time_s")
        .signal("y", "1", "white smooth", "1s")
        .model("nothing", "zero", "", "y.{channel}", "0s")
        .with("each = ['channel']")
        .section("sets", "channel = ['white', 'smooth']")
        .outputs("predicted = 'nothing'")
}

#[test]
fn white_residuals_are_told_from_others() {
    let model = model("white", &noise(), &[]);
    let mut random = Prng::stream(1, "noise");
    let (mut table, mut smooth) = (Table::default(), 0.0);
    for row in 0..2000 {
        smooth = 0.6 * smooth + random.normal();
        table.push(secs(f64::from(row)), &[random.normal(), smooth]);
    }
    let observation = observe(&model, &table).unwrap();
    let found = residual::residuals(&model.plan, &observation);
    assert_eq!(found[0].white, Some(true), "{:?}", found[0].p_value);
    assert_eq!(found[1].white, Some(false));
    assert_eq!((found[1].spaced, found[1].spacing_s), (2000, 1.0));
    assert!((found[1].autocorrelation[0] - 0.6).abs() < 0.05);
}

#[test]
fn a_pause_and_missing_truths_leave_residuals_what_they_are() {
    let model = model("paused", &noise(), &[]);
    let found = |pause: f64, missing: bool| {
        let mut random = Prng::stream(1, "noise");
        let (mut table, mut smooth) = (Table::default(), 0.0);
        for row in 0..1500 {
            smooth = 0.5 * smooth + random.normal();
            let later = if row < 800 { 0.0 } else { pause };
            let is_missing = random.uniform() < 0.75 && missing;
            let smooth = if is_missing { f64::NAN } else { smooth };
            table.push(secs(f64::from(row) + later), &[random.normal(), smooth]);
        }
        let observation = observe(&model, &table).unwrap();
        let days = day::count(&observation, "750s".parse().unwrap());
        let mut found = residual::residuals(&model.plan, &observation);
        (found.remove(1), days)
    };
    let (whole, two) = found(0.0, false);
    let (paused, three) = found(36_000.0, false);
    assert_eq!((two, three), (2, 3));
    assert_eq!((paused.spaced, paused.spacing_s), (1500, 1.0));
    // Of 1499 pairs of neighbours one is missing.
    assert!((paused.autocorrelation[0] - whole.autocorrelation[0]).abs() < 0.002);
    assert_eq!(paused.white, Some(false));
    let (few, _) = found(0.0, true);
    assert!(few.spaced < 500 && few.spacing_s == 1.0, "{}", few.spaced);
    assert!(
        (few.autocorrelation[0] - 0.5).abs() < 0.2,
        "{:?}",
        few.autocorrelation
    );
    assert_eq!(few.white, Some(false));
}

#[test]
fn a_single_truth_long_after_the_first_row_is_one_residual() {
    let model = model("single", &noise(), &[]);
    let mut table = Table::default();
    table.push(secs(0.0), &[f64::NAN; 2]);
    table.push(secs(36_000.0), &[1.0, f64::NAN]);
    let observation = observe(&model, &table).unwrap();
    let found = residual::residuals(&model.plan, &observation);
    assert_eq!((found[0].n, found[0].spaced), (1, 1));
    assert_eq!(found[0].white, None);
}

#[test]
fn residuals_are_taken_one_per_window_and_never_across_segments() {
    let model = model(
        "spacing",
        &two_sensors(),
        &[("thermal", linear(&[("gradients.a@150s", 1.0)], 0.0))],
    );
    let whole = wandering(1200, |course, row| 1000.0 * course[row][0]);
    let mut table = Table::default();
    for (row, (event, values)) in whole.events().iter().enumerate() {
        let Event::Row(at) = *event else { continue };
        if row == 600 {
            table.segment();
        }
        table.push(at, values);
    }
    let observation = observe(&model, &table).unwrap();
    let found = residual::residuals(&model.plan, &observation);
    assert_eq!(found[0].spacing_s, 300.0);
    // Of 100 minutes each, the first drift comes after five and then one in every five.
    assert_eq!(found[0].spaced, 19 + 19);
}

#[test]
fn a_sensor_at_rest_takes_away_what_it_contributes() {
    let terms = [("gradients.a@150s", 2.0), ("gradients.b@150s", 0.5)];
    let model = model(
        "contribution",
        &two_sensors(),
        &[("thermal", linear(&terms, 0.0))],
    );
    let table = wandering(3000, |course, row| {
        2000.0 * course[row][0] + 500.0 * course[row][1]
    });
    let observation = observe(&model, &table).unwrap();
    let (found, untold) = sensor::contributions(&model, &table, &observation).unwrap();
    assert!(untold.is_empty());
    let names: Vec<&str> = found.iter().map(|of| of.sensor.as_str()).collect();
    // Positions are what is predicted, not what it is predicted from.
    assert_eq!(names, ["temperature.a", "temperature.b"]);
    // The model is right up to its shorter window, so what a sensor contributes is what is missing without it.
    for of in &found {
        let without = (of.rmse_at_rest.powi(2) - of.rmse.powi(2)).sqrt();
        assert!((of.moves / without - 1.0).abs() < 0.25, "{of:?}");
    }
    assert!(found[0].moves > 2.0 * found[1].moves);
    let designs = regressor::designs(&model, &table).unwrap();
    for (regressor, of) in designs[0].regressors.iter().zip(&found) {
        assert!(
            (regressor.effect / of.moves - 1.0).abs() < 0.02,
            "{regressor:?} {of:?}"
        );
        assert!((1.0..1.5).contains(&regressor.inflation), "{regressor:?}");
    }
    assert!(designs[0].condition >= 1.0 && designs[0].condition < 2.0);
}

#[test]
fn a_sensor_that_is_watched_is_tried_like_any_other() {
    let terms = [("gradients.a@150s", 2.0), ("gradients.b@150s", 0.5)];
    let facts = |watch: &str| {
        let text = two_sensors().replace(
            "[nodes.gradients]\ntype = \"slope\"\ninputs.signal = \"temperature\"",
            &format!(
                "[nodes.sound]\ntype = \"health\"\ninputs.signal = \"temperature\"\n{watch}\n\
                 [nodes.gradients]\ntype = \"slope\"\ninputs.signal = \"sound\""
            ),
        );
        let model = model("watched", &text, &[("thermal", linear(&terms, 0.0))]);
        let table = wandering(3000, |course, row| 2000.0 * course[row][0]);
        diagnose(&model, &table, &Options::default(), &mut |_, _, _| {})
            .unwrap()
            .0
    };
    let free = facts("range = [\"-1e4 Cel\", \"1e4 Cel\"]");
    let watches = [
        "stuck_after = \"1min\"\nmax_rate = \"0.01 K/s\"\nrecover = \"5min\"",
        "stuck_after = \"1min\"\nnoise_above = \"0.1 mK\"\nnoise_samples = 100",
    ];
    for watch in watches {
        let watched = facts(watch);
        assert!(
            watched.silent_nodes.is_empty(),
            "{watch}: {:?}",
            watched.silent_nodes
        );
        for (of, as_free) in watched.contributions.iter().zip(&free.contributions) {
            assert_eq!(of.sensor, as_free.sensor);
            assert!(
                (of.moves / as_free.moves - 1.0).abs() < 0.02,
                "{of:?} {as_free:?}"
            );
        }
        let [of, as_free] = [&watched, &free].map(|it| &it.responses[0].sensors);
        assert_eq!(of.len(), 2, "{watch}");
        for (of, as_free) in of.iter().zip(as_free) {
            let [total, expected] = [of, as_free].map(|it| it.total.unwrap());
            assert!(
                (total / expected - 1.0).abs() < 0.01,
                "{watch}: {total} {expected}"
            );
        }
    }
    let blind = facts("range = [\"-1 Cel\", \"1 Cel\"]");
    assert!(blind.contributions.is_empty() && blind.responses.is_empty());
    let [untold] = &blind.silent_nodes[..] else {
        panic!("{:?}", blind.silent_nodes)
    };
    assert_eq!(untold.estimator.as_deref(), Some("thermal"));
    assert_eq!(untold.silent, "sound");
}

#[test]
fn a_day_left_out_is_scored_by_a_fit_that_has_not_seen_it() {
    let scratch = Scratch::new("days");
    let file = simulated(&scratch, "log.csv", "die-tester", 1.5, 5);
    let model = Model::load(graph("die-tester-sensor")).unwrap();
    let recording = Dataset::new(vec![file], athermal::files::Options::default());
    let observation = observe(&model, &recording).unwrap();
    let half: Duration = "12h".parse().unwrap();
    let found = day::days(&model, &recording, &observation, half, &mut |_, _| {});
    let found = found.unwrap().unwrap();
    assert_eq!((found.count, found.left_out.len()), (3, 3));
    assert_eq!(
        found
            .curve
            .iter()
            .map(|point| point.days)
            .collect::<Vec<_>>(),
        [1, 2]
    );

    // The second half day, by hand: the others are segments.
    let whole = Table::read(&recording, &model.plan).unwrap();
    let hours = |at: Instant| at.as_ns() as f64 / 3.6e12;
    let (mut others, mut cut) = (Table::default(), false);
    for (event, values) in whole.events() {
        let Event::Row(at) = *event else { continue };
        if (12.0..24.0).contains(&hours(at)) {
            continue;
        }
        if hours(at) >= 24.0 && !std::mem::replace(&mut cut, true) {
            others.segment();
        }
        others.push(at, values);
    }
    let rmse = |table: &Table| {
        let (fitted, _) = fit(&model.plan, table, &FitOptions::default(), &mut |_| {}).unwrap();
        let trace = trace(&model.plan, &fitted, &whole, &mut |_, _| {}).unwrap();
        let truth = &trace.truths[2];
        let inside = |nth: &usize| (12.0..24.0).contains(&hours(truth.times[*nth].1));
        let errors: Vec<f64> = (0..truth.values.len())
            .filter(inside)
            .map(|nth| truth.predictions[0].values[nth] - truth.values[nth])
            .filter(|error| !error.is_nan())
            .collect();
        (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
    };
    let mut scores = found.left_out[1].scores.iter();
    let score = scores
        .find(|score| score.prediction == "thermal.Z1")
        .unwrap();
    assert!((score.rmse.unwrap() / rmse(&others) - 1.0).abs() < 1e-12);
    assert!(
        (score.rmse.unwrap() / rmse(&whole) - 1.0).abs() > 1e-6,
        "the day was seen"
    );
}

#[test]
fn a_graph_is_tried_with_its_own_window_though_what_is_measured_has_a_span_too() {
    let text = two_sensors().replace("inputs.signal = \"position\"", "inputs.signal = \"means\"")
        + "[nodes.means]\ntype = \"resample\"\ninputs.signal = \"position\"\nevery = \"1min\"\n";
    let thermal = linear(&[("gradients.a@150s", 1.0)], 0.0);
    let model = model("own-window", &text, &[("thermal", thermal)]);
    let table = wandering(3000, |_, row| 1000.0 * (row as f64 / 300.0).sin());
    let found = window::windows(&model, &table).unwrap();
    assert_eq!(found[0].window_s, 300.0);
    assert!(found[0].widths.iter().all(|of| of.window_s != 420.0));
}

#[test]
fn fits_on_a_few_days_are_set_against_those_on_all_others_where_both_predict() {
    let text = two_sensors()
        .replace("\"drift.z\"", "\"position.z\"")
        .replace("\"gradients\"", "\"temperature\"")
        .replace("max_age = \"1min\"", "max_age = \"5s\"");
    let scratch = Scratch::new("both-predict");
    let model = Model::load(scratch.file("graph.toml", text)).unwrap();
    let (mut table, mut random) = (Table::default(), Prng::stream(4, "days"));
    let rows = 4 * 500;
    for row in 0..rows {
        let [a, b, noise, chance] = [(); 4].map(|()| random.normal());
        let (day, of_day) = (row / 500, row % 500);
        // On the third day the sensor is often silent, so that fits with it do without the sensor and predict the disturbed rows
        // too, in which it is silent else.
        let silent = if day == 2 { chance > 0.0 } else { of_day < 35 };
        let disturbed = if day != 2 && of_day < 35 { 100.0 } else { 0.1 };
        let b_or_none = if silent { f64::NAN } else { b };
        table.push(
            secs(10.0 * f64::from(row)),
            &[a, b_or_none, a + b + disturbed * noise],
        );
    }
    let observation = observe(&model, &table).unwrap();
    let day: Duration = "5000s".parse().unwrap();
    let days = day::days(&model, &table, &observation, day, &mut |_, _| {});
    let days = days.unwrap().unwrap();
    assert!(!days.left_out[0].dropped.is_empty(), "{days:?}");
    let point = &days.curve[0];
    assert!(point.dropped.is_empty(), "{point:?}");
    let [rmse, others] = [point.scores[0].rmse, point.scores[0].all_others];
    assert!(rmse.unwrap() < 0.2 && others.unwrap() < 1.2, "{point:?}");
}

#[test]
fn a_wider_window_lifts_a_drift_above_its_noise() {
    let model = model(
        "window",
        &two_sensors(),
        &[("thermal", linear(&[("gradients.a@150s", 1.0)], 0.0))],
    );
    let mut random = Prng::stream(8, "noise");
    let noise: Vec<f64> = (0..3000).map(|_| 12.0 * random.normal()).collect();
    let table = wandering(3000, |_, row| {
        noise[row] + 1000.0 * (row as f64 / 300.0).sin()
    });
    let found = window::windows(&model, &table).unwrap();
    let [of] = &found[..] else {
        panic!("{found:?}")
    };
    assert_eq!((of.truth.as_str(), of.window_s), ("drift.z", 300.0));
    let ratios: Vec<f64> = of
        .widths
        .iter()
        .filter(|of| of.window_s <= 600.0)
        .map(|of| of.ratio)
        .collect();
    assert!(
        ratios.len() > 4 && ratios.windows(2).all(|pair| pair[0] < pair[1]),
        "{ratios:?}"
    );
    // Of n samples 10 s apart, the error of a slope is σ √(12 / (n (n² − 1))) per sample.
    let own = of.widths.iter().find(|of| of.window_s == 300.0).unwrap();
    let n: f64 = 30.0;
    let expected = 12.0 * (12.0 / (n * (n * n - 1.0))).sqrt() / 10.0 * 60.0;
    assert!(
        (own.noise / expected - 1.0).abs() < 0.1,
        "{} {expected}",
        own.noise
    );
}

#[test]
fn a_recording_without_a_truth_is_no_reason_to_stop() {
    let model = model(
        "empty",
        &two_sensors(),
        &[("thermal", linear(&[("gradients.a@150s", 1.0)], 0.0))],
    );
    let options = Options {
        day: "1d".parse().ok(),
        windows: true,
        ..Options::default()
    };
    let mut empty = Table::default();
    diagnose(&model, &empty, &options, &mut |_, _, _| {}).unwrap();
    for row in 0..50 {
        empty.push(secs(10.0 * f64::from(row)), &[20.0, f64::NAN, f64::NAN]);
    }
    let mut seen = Vec::new();
    let mut progress = |what, done, all| seen.push((what, done, all));
    let (found, _) = diagnose(&model, &empty, &options, &mut progress).unwrap();
    assert!(found.residuals[0].n == 0 && found.days.is_none());
    let looked: Vec<_> = (1..=6).map(|done| ("looking", done, 6)).collect();
    assert_eq!(seen, looked);
}
