//! How far answers and lags reach: as far as what estimators read, and as a recording can tell.

use athermal::diagnosis::{lag, observe, response};

use super::{linear, model, two_sensors, wandering};

/// Intervals about the prediction that remember errors for longer than anything else reaches back.
const INTERVAL: &str = r#"
[nodes.interval]
type = "conformal"
inputs.prediction = "thermal"
inputs.truth = "drift.z"
memory = "60d"
[outputs]
predicted = "interval"
"#;

#[test]
fn what_intervals_remember_changes_neither_answers_nor_lags() {
    let with = two_sensors().replace("\n[outputs]\npredicted = \"thermal\"\n", INTERVAL);
    let table = wandering(1200, |course, row| 1000.0 * course[row][0]);
    let terms = [("gradients.a@150s", 0.4), ("gradients.b@600s", 0.7)];
    let [without, with] =
        [("alone", &*two_sensors()), ("remembering", &with)].map(|(name, text)| {
            let model = model(name, text, &[("thermal", linear(&terms, 5.0))]);
            let observation = observe(&model, &table).unwrap();
            let answers = response::responses(&model, &observation).unwrap();
            let of = ["thermal".to_owned()];
            let lags = lag::lags(&model, &table, &observation, &of).unwrap();
            (answers, lags)
        });
    assert_eq!(without.0[0].sensors.len(), 2);
    assert!(without == with, "{:?}", with.1[0].lag_s);
}

#[test]
fn answers_reach_as_far_back_as_there_is_time() {
    let slow = two_sensors().replace("\"10min\"", "\"100000d\"");
    let terms = [("gradients.a@8640000000s", 0.4)];
    let model = model("long", &slow, &[("thermal", linear(&terms, 5.0))]);
    let table = wandering(1200, |course, row| 1000.0 * course[row][0]);
    let observation = observe(&model, &table).unwrap();
    let answers = response::responses(&model, &observation).unwrap();
    let [answer] = &answers[0].sensors[..] else {
        panic!("{answers:?}");
    };
    let times = answer.time_s.iter();
    assert!(times.clone().zip(times.skip(1)).all(|(a, b)| a < b));
}

#[test]
fn lags_reach_no_further_than_a_quarter_of_the_recording() {
    let slow = two_sensors().replace("\"10min\"", "\"2d\"");
    let model = model("short", &slow, &[("thermal", linear(&[], 0.0))]);
    let table = wandering(3600, |course, row| 1000.0 * course[row][0]);
    let observation = observe(&model, &table).unwrap();
    let found = lag::lags(&model, &table, &observation, &[]).unwrap();
    let lags = &found[0].lag_s;
    assert_eq!(lags.len(), 121);
    let furthest = lags.last().unwrap();
    assert!((8900.0..=9000.0).contains(furthest), "{furthest}");
}

#[test]
fn a_prediction_is_no_feature_of_what_it_predicts() {
    let text = two_sensors().vote("stack", "stack", "thermal", "drift.z");
    let text = text.with("ahead = '0s'");
    let terms = [("gradients.a@150s", 0.4)];
    let model = model("stacked", &text, &[("thermal", linear(&terms, 5.0))]);
    let table = wandering(1200, |course, row| 1000.0 * course[row][0]);
    let observation = observe(&model, &table).unwrap();
    let found = lag::lags(&model, &table, &observation, &[]).unwrap();
    let names = found[0].features.iter().map(|of| of.feature.as_str());
    assert!(names.clone().all(|name| name.starts_with("gradients.")));
    assert_eq!(names.count(), 4);
}
