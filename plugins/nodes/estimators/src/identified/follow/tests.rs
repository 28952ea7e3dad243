//! What a followed model predicts around pauses and gaps, and how sure it says it is of that.

use super::super::model::{MOST_SERIES, identified};
use super::*;
use athermal_core::node::Predictor;
use athermal_numerics::Polynomials;

#[test]
fn what_the_first_truth_is_off_by_is_shared_by_the_variance_that_filters_and_noise_give() {
    let step = Duration::from_ns(1_000_000_000);
    // The filter gives 0.2 of an input, whose variance is 1, and the noise has a variance of 0.04, as has that.
    let mut model = identified(step);
    model.model.a = Vec::new();
    model.model.inputs[0].f = vec![-0.5];
    model.model.d = vec![-0.8];
    model.deviations = vec![0.1, 0.2];
    let second = |model: &Identified| {
        let mut learner = Following::new(model);
        let first = Instant::from_ns(0);
        learner.run(&[0.0], first, first - step);
        learner.learn(&[0.0], 1.0, first);
        learner.run(&[0.0], first + step, first);
        learner.predict(&[0.0], first + step)
    };
    // Of what was before, a step later a quarter of the variance is left.
    let (filter, noise, innovation) = (0.04 * 0.25, 0.04, 0.01);
    let both = |share: f64, kept: f64| 0.5 * share + kept * (1.0 - share);
    let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found}");
    near(second(&model), both(filter / (filter + noise), 0.8));
    // Noise that may be anywhere has all, and what is not followed is an innovation.
    model.model.d = Vec::new();
    model.model.differences = 1;
    near(second(&model), both(0.0, 1.0));
    model.model.differences = 0;
    near(second(&model), both(filter / (filter + innovation), 0.0));
}

/// A filter that is far from rest when a segment begins, and truths with noise: what it is off by, and how unsure it says it is.
fn from_far_off(model: &Identified, count: i64) -> (Vec<f64>, Vec<f64>) {
    let mut learner = Following::new(model);
    let (mut state, mut filtered) = (12_345_u64, 40.0);
    // Uniform, of variance 1.
    let mut draw = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        f64::sqrt(3.0) * ((state >> 33) as f64 / f64::from(1 << 30) - 1.0)
    };
    let steps = (0..count).map(|nth| {
        let of = Instant::from_ns(0) + part(model.step, nth, 1);
        filtered = 0.1 - model.model.inputs[0].f[0] * filtered;
        learner.run(&[1.0], of, of - model.step);
        let told = (
            learner.predict(&[1.0], of) - filtered,
            learner.std_dev(&[1.0], of),
        );
        learner.learn(&[1.0], filtered + draw(), of);
        told
    });
    steps.unzip()
}

#[test]
fn after_a_start_truths_tell_where_a_slow_filter_is_and_the_deviation_says_how_well() {
    let mut model = identified(Duration::from_ns(1_000_000_000));
    model.model.a = Vec::new();
    model.model.inputs[0].f = vec![-0.999];
    let (off, deviations) = from_far_off(&model, 400);
    // The filter gives 100 times its input, or nothing of the kind: it is taken to be at rest until truths come.
    assert!(off[0].abs() > 50.0 && deviations[0] > 50.0);
    let square = |of: &[f64]| of.iter().map(|of| of * of).sum::<f64>() / of.len() as f64;
    for from in [1, 10, 100] {
        // Of as many truths, the mean is as unsure as this.
        let unsure = deviations[from].powi(2) - 1.0;
        let as_mean = 1.0 / from as f64;
        assert!((unsure / as_mean - 1.0).abs() < 0.1, "{from}: {unsure}");
    }
    let mean = square(&off[100..]).sqrt();
    assert!(mean < 0.2, "{mean}");
    assert!(deviations.is_sorted_by(|a, b| a >= b), "{deviations:?}");
}

#[test]
fn a_run_begins_where_inputs_tell_that_filters_are_and_not_where_they_would_be_after_long() {
    let step = Duration::from_ns(1_000_000_000);
    let mut model = identified(step);
    model.model.a = Vec::new();
    model.model.inputs[0].f = vec![-0.99];
    let first = |model: &Identified| {
        let mut learner = Following::new(model);
        let now = Instant::from_ns(0);
        learner.run(&[2.0], now, now - step);
        learner.predict(&[2.0], now)
    };
    // A model of before says nothing of that: its gain is 10.
    assert!((first(&model) - 20.0).abs() < 1e-9);
    model.beginnings = vec![Beginning {
        times: 0.3,
        square: 1.0,
    }];
    assert_eq!(model.mistakes(), []);
    assert!((first(&model) - (0.1 + 0.99 * 0.3) * 2.0).abs() < 1e-9);
    model.beginnings.push(model.beginnings[0]);
    assert_eq!(model.mistakes().len(), 1);
}

/// What it predicts of a truth of 0 around a pause of so many steps.
fn around_a_pause(steps: i64) -> Vec<f64> {
    let step = Duration::from_ns(1_000_000_000);
    let model = identified(step);
    assert_eq!(model.mistakes(), []);
    let mut learner = Following::new(&model);
    let instants = (0..20).chain(20 + steps..40 + steps);
    let predicted = instants.map(|nth| {
        let of = Instant::from_ns(0) + part(step, nth, 1);
        learner.run(&[1.0], of, of - step);
        let predicted = learner.predict(&[1.0], of);
        learner.learn(&[1.0], 0.0, of);
        predicted
    });
    predicted.collect()
}

#[test]
fn right_after_a_start_the_deviation_is_larger_by_what_was_not_foreseen_before_it() {
    let step = Duration::from_ns(1_000_000_000);
    let mut model = identified(step);
    model.model.c = vec![0.5];
    model.deviations = vec![2.0, 3.0];
    let mut learner = Following::new(&model);
    let mut deviations = Vec::new();
    for nth in 0..60 {
        let of = Instant::from_ns(0) + part(step, nth, 1);
        learner.run(&[1.0], of, of - step);
        deviations.push(learner.std_dev(&[1.0], of));
        learner.learn(&[1.0], 0.0, of);
    }
    // Of nothing it knows least; then the innovation before the first truth counts by half.
    assert_eq!(deviations[..2], [3.0, 2.0 * f64::sqrt(1.25)]);
    assert!(
        deviations[1..].is_sorted_by(|a, b| a >= b),
        "{deviations:?}"
    );
    assert_eq!(deviations[59], 2.0);
}

/// The deviations of a moving average about each of the truths that follow so many, while none of them is told.
fn deviations_after(truths: i64, count: i64) -> Vec<f64> {
    let step = Duration::from_ns(1_000_000_000);
    let mut model = identified(step);
    model.model.a.clear();
    model.model.c = vec![0.8];
    let variances = model.model.variances(10);
    model.deviations = variances.iter().map(|variance| variance.sqrt()).collect();
    let mut learner = Following::new(&model);
    let deviations = (0..truths + count).map(|nth| {
        let of = Instant::from_ns(0) + part(step, nth, 1);
        learner.run(&[1.0], of, of - step);
        let deviation = learner.std_dev(&[1.0], of);
        if nth < truths {
            learner.learn(&[1.0], 0.0, of);
        }
        deviation
    });
    deviations.skip(truths as usize).collect()
}

#[test]
fn of_truths_that_are_not_told_the_deviation_is_that_of_as_many_steps() {
    let spread = f64::sqrt(1.64);
    let near = |found: Vec<f64>, expected: [f64; 3]| {
        let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
        assert!(
            off.fold(0.0, f64::max) < 1e-9,
            "{found:?}, not {expected:?}"
        );
    };
    near(deviations_after(200, 3), [1.0, spread, spread]);
    // One truth tells of the next as much as their covariance says, and nothing of others.
    let after_one = f64::sqrt(1.64 - 0.64 / 1.64);
    near(deviations_after(1, 3), [after_one, spread, spread]);
}

#[test]
fn a_short_pause_is_bridged_with_the_inputs_before_it() {
    let predicted = around_a_pause(5);
    assert!(predicted[0].is_nan(), "nothing has been told");
    assert!(
        predicted[1..].iter().all(|value| value.abs() < 0.7),
        "{predicted:?}"
    );
}

#[test]
fn after_a_long_pause_it_begins_anew() {
    let predicted = around_a_pause(100);
    assert!(
        predicted[20].is_nan(),
        "nothing has been told: {predicted:?}"
    );
    assert!(
        predicted[21..].iter().all(|value| value.abs() < 0.2),
        "{predicted:?}"
    );
}

#[test]
fn of_truths_that_come_much_faster_than_a_step_each_series_takes_one_a_step() {
    let second = Duration::from_ns(1_000_000_000);
    let mut model = identified(part(second, 99, 1));
    model.series = MOST_SERIES;
    let mut learner = Following::new(&model);
    for nth in (0..1000).step_by(2) {
        let at = Instant::from_ns(0) + part(second, nth, 1);
        learner.run(&[1.0], at, at - part(second, 99, 1));
        learner.learn(&[1.0], 0.0, at);
    }
    for followed in &learner.known.series {
        assert!((10..=11).contains(&followed.truths), "{followed:?}");
    }
}

/// A file of the Kalman filter of statsmodels, see `tests/oracles/missing/generate.py`.
fn oracle(file: &str) -> String {
    let folder = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../tests/oracles/missing"
    );
    std::fs::read_to_string(std::path::Path::new(folder).join(file)).unwrap()
}

#[test]
fn where_truths_are_missing_predictions_and_deviations_are_those_of_a_kalman_filter() {
    #[derive(Deserialize)]
    struct Filtered {
        model: Polynomials,
        variance: f64,
    }
    let models = serde_json::from_str(&oracle("models.json")).unwrap();
    let models: std::collections::BTreeMap<String, Filtered> = models;
    let step = Duration::from_ns(1_000_000_000);
    assert_eq!(models.len(), 6);
    for (name, Filtered { model, variance }) in models {
        let width = model.inputs.len();
        let ahead = model.variances(64).into_iter();
        let mut followed = identified(step);
        followed.regressors.truncate(width);
        followed.scaling.means.truncate(width);
        followed.scaling.scales.truncate(width);
        followed.deviations = ahead.map(|of| (variance * of).sqrt()).collect();
        followed.model = model;
        assert_eq!(followed.mistakes(), []);
        let mut learner = Following::new(&followed);
        let rows = oracle(&format!("{name}.csv"));
        let (mut compared, mut missing) = (0, 0);
        for (nth, row) in rows.lines().skip(1).enumerate() {
            let row: Vec<Option<f64>> = row.split(',').map(|field| field.parse().ok()).collect();
            let [Some(u), truth, Some(predicted), Some(deviation)] = row[..] else {
                panic!("{row:?}");
            };
            let (input, of) = ([u], Instant::from_ns(0) + part(step, nth as i64, 1));
            learner.run(&input[..width], of, of - step);
            // Until then the filters know of different pasts.
            if nth >= 120 {
                let found = learner.predict(&input[..width], of);
                let unsure = learner.std_dev(&input[..width], of);
                assert!(
                    (found - predicted).abs() < 1e-8 * (1.0 + predicted.abs()),
                    "{name}, {nth}: {found}, not {predicted}"
                );
                assert!(
                    (unsure - deviation).abs() < 1e-8 * deviation,
                    "{name}, {nth}: {unsure}, not {deviation}"
                );
                compared += 1;
                missing += usize::from(truth.is_none());
            }
            if let Some(truth) = truth {
                learner.learn(&input[..width], truth, of);
            }
        }
        assert!(compared == 380 && missing > 100, "{name}: {missing}");
    }
}
