//! When features tell something of a truth and of what predictions leave of it, and when they only seem to.

use athermal::core::prng::Prng;
use athermal::diagnosis::{lag, observe};
use athermal::run::recording::Table;

use super::{linear, model, secs, two_sensors, wandering};

#[test]
fn a_truth_that_follows_a_sensor_ten_minutes_later_has_its_largest_correlation_there() {
    let terms = [("gradients.b@150s", 0.1)];
    let model = model("lags", &two_sensors(), &[("thermal", linear(&terms, 0.0))]);
    let table = wandering(6000, |course, row| {
        1000.0 * course[row.saturating_sub(60)][0]
    });
    let observation = observe(&model, &table).unwrap();
    let found = lag::lags(&model, &table, &observation, &[]).unwrap();
    assert_eq!(found.len(), 1);
    let of = |name: &str| {
        found[0]
            .features
            .iter()
            .find(|of| of.feature == name)
            .unwrap()
    };
    let cause = of("gradients.a@150s");
    // The drift is a slope over 300 s and the feature one over 150 s: their middles are 75 s apart.
    assert!(
        (cause.truth.best_lag_s - 675.0).abs() <= 30.0,
        "{}",
        cause.truth.best_lag_s
    );
    assert!(cause.truth.best > 0.95, "{}", cause.truth.best);
    let bystander = of("gradients.b@150s");
    assert!(!bystander.truth.is_significant(), "{bystander:?}");
    // What the model leaves still follows the sensor that it does not use.
    assert!(cause.residual.best > 0.9 && cause.residual.is_significant());
}

#[test]
fn of_many_features_that_have_nothing_to_do_with_a_truth_hardly_ever_one_seems_to() {
    let names: Vec<String> = (0..12).map(|nth| format!("\"x{nth}\"")).collect();
    let text = format!(
        "schema = 1\nname = \"chance\"\ntime.column = \"time_s\"\n\
         signals.x = {{ unit = \"1\", channels = [{}], max_age = \"1s\" }}\n\
         signals.y = {{ unit = \"1\", channels = [\"y\"], max_age = \"1s\" }}\n\
         nodes.guess = {{ type = \"linear\", inputs.features = \"x\", inputs.truth = \"y\", ahead = \"0s\" }}\n\
         outputs.predicted = \"guess\"\n",
        names.join(", ")
    );
    let model = model("chance", &text, &[("guess", linear(&[("x.x0", 0.0)], 0.0))]);
    let mut random = Prng::stream(3, "chance");
    let (mut said, mut beyond_three) = (0, 0);
    for _ in 0..40 {
        let (mut table, mut values) = (Table::default(), [0.0; 13]);
        for row in 0..600 {
            for (nth, value) in values.iter_mut().enumerate() {
                // From white to smooth.
                *value = 0.05 * nth as f64 * *value + random.normal();
            }
            table.push(secs(f64::from(row)), &values);
        }
        let observation = observe(&model, &table).unwrap();
        let found = lag::lags(&model, &table, &observation, &[]).unwrap();
        let left = || found[0].features.iter().map(|of| &of.residual);
        assert_eq!(left().count(), 12);
        said += usize::from(left().any(|of| of.is_significant()));
        beyond_three += usize::from(left().any(|of| of.best.abs() > 3.0 * of.error));
    }
    assert!(said <= 2, "{said} of 40");
    assert!(beyond_three > 10, "{beyond_three} of 40");
}

#[test]
fn no_feature_is_set_against_a_truth_of_before_its_time() {
    let terms = [("temperature.a", 0.0)];
    let text = two_sensors()
        .replace("\"gradients\"", "\"temperature\"")
        .replace("\"drift.z\"", "\"position.z\"")
        .replace("ahead = \"0s\"", "ahead = \"150s\"");
    let model = model("ahead", &text, &[("thermal", linear(&terms, 0.0))]);
    let (mut random, mut table) = (Prng::stream(5, "ahead"), Table::default());
    let mut course = vec![0.0];
    for row in 0..16_000_usize {
        let a = 0.5 * course[row] + random.normal();
        course.push(a);
        // What it follows lies 120 s back, and is not known 150 s before.
        let follows = row % 8 == 0 && row > 12;
        let z = if follows {
            course[row + 1 - 12]
        } else {
            f64::NAN
        };
        table.push(secs(10.0 * row as f64), &[a, random.normal(), z]);
    }
    let observation = observe(&model, &table).unwrap();
    let found = lag::lags(&model, &table, &observation, &[]).unwrap();
    let left = &found[0].features[0].residual;
    assert!(
        left.best.abs() < 0.2,
        "{} at {}",
        left.best,
        left.best_lag_s
    );
}

#[test]
fn missing_truths_leave_the_lag_of_a_feature_where_it_is() {
    let terms = [("temperature.a", 1000.0)];
    let text = two_sensors()
        .replace("\"gradients\"", "\"temperature\"")
        .replace("\"drift.z\"", "\"position.z\"")
        .replace("\"1min\"", "\"10s\"");
    let model = model("sparse", &text, &[("thermal", linear(&terms, 0.0))]);
    let (mut random, mut table) = (Prng::stream(4, "sparse"), Table::default());
    for row in 0..2000 {
        let [a, b, missing] = [random.normal(), random.normal(), random.uniform()];
        let z = if missing < 0.75 { f64::NAN } else { 1000.0 * a };
        let later = if row < 1000 { 0.0 } else { 36_000.0 };
        table.push(secs(10.0 * f64::from(row) + later), &[a, b, z]);
    }
    let observation = observe(&model, &table).unwrap();
    let found = lag::lags(&model, &table, &observation, &[]).unwrap();
    let of_a = &found[0].features[0].truth;
    assert_eq!(of_a.best_lag_s, 0.0);
    assert!(of_a.best > 0.99, "{}", of_a.best);
}
