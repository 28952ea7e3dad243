//! The filter against statsmodels: the shared oracle, and series with regressors, gaps and irregular times of its own.

use super::{Kalman, Movement, Passage, Series, Structural, follow, most_likely};
use crate::NumericsError;
use crate::oracle::{own_table, own_text, table, text};

const OWN: Structural = Structural {
    observation: 0.09,
    level: 0.01,
    trend: Some(0.0001),
    returning: 0.0,
    passage: Passage::Steps,
};

fn number(scalars: &serde_json::Value, path: &[&str]) -> f64 {
    let found = path.iter().fold(scalars, |value, key| &value[key]);
    found.as_f64().unwrap()
}

fn own_scalars() -> serde_json::Value {
    serde_json::from_str(&own_text("kalman/scalars.json")).unwrap()
}

/// The own series: times between rows, regressors row by row, observations.
fn own_series() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let rows = own_table("kalman/series.csv").numbers();
    let times = rows.iter().map(|row| row[0]).collect();
    let regressors = rows.iter().flat_map(|row| [row[1], row[2]]).collect();
    (times, regressors, rows.iter().map(|row| row[3]).collect())
}

fn in_steps(rows: usize) -> Vec<f64> {
    let mut times = vec![1.0; rows];
    times[0] = f64::NAN;
    times
}

#[track_caller]
fn near(found: f64, expected: f64, within: f64) {
    assert!(
        (found - expected).abs() <= within,
        "{found} instead of {expected}"
    );
}

#[test]
fn a_local_linear_trend_equals_the_oracle() {
    let (Some(input), Some(expected)) = (
        table("kalman_llt/input.csv"),
        table("kalman_llt/expected.csv"),
    ) else {
        return;
    };
    let scalars: serde_json::Value =
        serde_json::from_str(&text("kalman_llt/scalars.json").unwrap()).unwrap();
    let model = Structural {
        observation: 0.04,
        level: 0.0025,
        trend: Some(0.0001),
        returning: 0.0,
        passage: Passage::Steps,
    };
    let mut filter = Kalman::starting_at(model, vec![20.0, 0.0], &[1.0, 0.0, 0.0, 0.01]).unwrap();
    let mut sum = 0.0;
    for (nth, (y, expected)) in input.numbers().iter().zip(expected.numbers()).enumerate() {
        if nth > 0 {
            filter.advance(1.0);
        }
        let ahead = filter.forecast(0.0, &[]).unwrap();
        near(ahead.mean, expected[1], 1e-9);
        near(ahead.variance + model.observation, expected[2], 1e-10);
        let brought = filter.observe(&[], y[0]);
        let likelihood = brought.map_or(0.0, |innovation| innovation.log_likelihood());
        assert_eq!(brought.is_none(), y[0].is_nan());
        near(likelihood, expected[8], 1e-9);
        sum += likelihood;
        near(filter.state()[0], expected[3], 1e-9);
        near(filter.state()[1], expected[4], 1e-9);
        let covariance = filter.covariance();
        for (place, column) in [(0, 5), (1, 6), (2, 6), (3, 7)] {
            near(covariance[place], expected[column], 1e-10);
        }
    }
    near(sum, number(&scalars, &["llf"]), 1e-8);
    for ahead in table("kalman_llt/forecast.csv").unwrap().numbers() {
        let forecast = filter.forecast(ahead[0], &[]).unwrap();
        near(forecast.mean, ahead[1], 1e-9);
        near(
            (forecast.variance + model.observation).sqrt(),
            ahead[2],
            1e-9,
        );
    }
}

#[test]
fn an_exactly_diffuse_start_with_regressors_and_gaps_equals_the_oracle() {
    let (times, regressors, observations) = own_series();
    let expected = own_table("kalman/filtered.csv").numbers();
    for (passage, columns) in [(Passage::Steps, 1), (Passage::Continuous, 8)] {
        let mut filter = Kalman::diffuse(Structural { passage, ..OWN }, 2).unwrap();
        let mut expected = expected.iter().peekable();
        for (nth, &y) in observations.iter().enumerate() {
            if nth > 0 {
                filter.advance(match passage {
                    Passage::Steps => 1.0,
                    Passage::Continuous => times[nth],
                });
            }
            filter.observe(&regressors[2 * nth..2 * nth + 2], y);
            let Some(row) = expected.next_if(|row| row[0] as usize == nth) else {
                continue;
            };
            let row = &row[columns..];
            for (found, expected) in filter.state().iter().zip(row) {
                near(*found, *expected, 1e-9);
            }
            for (place, expected) in [(0, row[4]), (2, row[5]), (15, row[6])] {
                near(filter.covariance()[place], expected, 1e-9);
            }
        }
        assert!(expected.next().is_none());
    }
}

#[test]
fn forecasts_with_regressors_equal_the_oracle() {
    let (_, regressors, observations) = own_series();
    let scalars = own_scalars();
    let mut filter = Kalman::diffuse(OWN, 2).unwrap();
    for (nth, &y) in observations.iter().enumerate() {
        if nth > 0 {
            filter.advance(1.0);
        }
        filter.observe(&regressors[2 * nth..2 * nth + 2], y);
    }
    for step in 0..3 {
        let at = |name: &str| scalars[name][step].as_f64().unwrap();
        let x = [0, 1].map(|i| scalars["forecast_x"][step][i].as_f64().unwrap());
        let forecast = filter.forecast((step + 1) as f64, &x).unwrap();
        near(forecast.mean, at("forecast_mean"), 1e-9);
        let deviation = (forecast.variance + OWN.observation).sqrt();
        near(deviation, at("forecast_deviation"), 1e-9);
    }
}

#[test]
fn the_diffuse_likelihood_equals_the_oracle() {
    let (times, regressors, observations) = own_series();
    let scalars = own_scalars();
    let mut irregular = times;
    irregular[0] = f64::NAN;
    for (passage, times, name) in [
        (Passage::Steps, in_steps(observations.len()), "regular_llf"),
        (Passage::Continuous, irregular, "irregular_llf"),
    ] {
        let series = Series {
            times: &times,
            observations: &observations,
            regressors: &regressors,
            prior: f64::INFINITY,
            shared: 0.0,
        };
        let found = follow(Structural { passage, ..OWN }, &series).unwrap();
        near(found.log_likelihood, number(&scalars, &[name]), 1e-8);
    }
}

#[test]
fn the_most_likely_variances_equal_the_oracle() {
    let (_, regressors, observations) = own_series();
    let scalars = own_scalars();
    let times = in_steps(observations.len());
    let series = Series {
        times: &times,
        observations: &observations,
        regressors: &regressors,
        prior: f64::INFINITY,
        shared: 0.0,
    };
    for (movement, name) in [
        (Movement::Wanders, "most_likely_level"),
        (Movement::Trend, "most_likely_trend"),
    ] {
        let found = most_likely(movement, Passage::Steps, &series).unwrap();
        near(found.log_likelihood, number(&scalars, &[name, "llf"]), 1e-6);
        let model = found.model;
        let variances = [Some(model.observation), Some(model.level), model.trend];
        for (nth, variance) in variances.into_iter().flatten().enumerate() {
            let expected = scalars[name]["params"][nth].as_f64().unwrap();
            near(variance, expected, 0.01 * expected);
        }
        let again = follow(model, &series).unwrap();
        near(again.log_likelihood, found.log_likelihood, 1e-8);
    }
}

#[test]
fn the_search_is_no_worse_than_the_oracle_of_the_shared_series() {
    let Some(input) = table("kalman_llt/input.csv") else {
        return;
    };
    let scalars: serde_json::Value =
        serde_json::from_str(&text("kalman_llt/scalars.json").unwrap()).unwrap();
    let observations: Vec<f64> = input.numbers().iter().map(|row| row[0]).collect();
    let times = in_steps(observations.len());
    let series = Series {
        times: &times,
        observations: &observations,
        regressors: &[],
        prior: f64::INFINITY,
        shared: 0.0,
    };
    let found = most_likely(Movement::Trend, Passage::Steps, &series).unwrap();
    let variances: Vec<f64> = scalars["mle_params_default_init"]
        .as_array()
        .unwrap()
        .iter()
        .map(|value| value.as_f64().unwrap())
        .collect();
    let of_theirs = Structural {
        observation: variances[0],
        level: variances[1],
        trend: Some(variances[2]),
        returning: 0.0,
        passage: Passage::Steps,
    };
    let of_theirs = follow(of_theirs, &series).unwrap().log_likelihood;
    assert!(
        found.log_likelihood >= of_theirs - 1e-6,
        "{} below {of_theirs}",
        found.log_likelihood
    );
}

#[test]
fn time_may_be_let_pass_at_once_or_in_parts() {
    let returning = Structural {
        trend: None,
        returning: 0.3,
        ..OWN
    };
    for model in [
        OWN,
        Structural {
            passage: Passage::Continuous,
            ..OWN
        },
        returning,
    ] {
        let mut at_once = Kalman::diffuse(model, 0).unwrap();
        for y in [1.0, 2.0, 2.5] {
            at_once.observe(&[], y);
            at_once.advance(1.0);
        }
        let mut in_parts = at_once.clone();
        at_once.advance(7.0);
        for part in [2.0, 4.0, 1.0] {
            in_parts.advance(part);
        }
        let of = |filter: &Kalman| [filter.state(), filter.covariance()].concat();
        for (a, b) in of(&at_once).iter().zip(of(&in_parts)) {
            near(*a, b, 1e-12 * (1.0 + b.abs()));
        }
    }
}

#[test]
fn a_level_that_stays_makes_ridge_of_the_regressors() {
    use crate::{GramBlocks, LeastSquares};
    let (_, regressors, mut observations) = own_series();
    for y in &mut observations {
        *y = if y.is_nan() { 0.0 } else { *y };
    }
    let model = Structural {
        observation: 0.3,
        level: 0.0,
        trend: None,
        returning: 0.0,
        passage: Passage::Steps,
    };
    let alpha = 4.0;
    let coefficient = model.observation / alpha;
    let prior = [
        f64::INFINITY,
        0.0,
        0.0,
        0.0,
        coefficient,
        0.0,
        0.0,
        0.0,
        coefficient,
    ];
    let mut filter = Kalman::starting_at(model, vec![0.0; 3], &prior).unwrap();
    let mut blocks = GramBlocks::new(2);
    for (x, &y) in regressors.chunks_exact(2).zip(&observations) {
        filter.observe(x, y);
        filter.advance(1.0);
        blocks.push(x, y);
    }
    let ridge = LeastSquares::ridge(alpha);
    let fit = ridge
        .solve(&blocks.total(), &[0, 1], &[1.0, 1.0], None)
        .unwrap();
    near(filter.state()[0], fit.intercept, 1e-10);
    near(filter.state()[1], fit.coefficients[0], 1e-10);
    near(filter.state()[2], fit.coefficients[1], 1e-10);
}

#[test]
fn coefficients_are_those_of_all_observations_even_where_they_share_noise() {
    use crate::{GramBlocks, LeastSquares};
    let (_, regressors, mut observations) = own_series();
    for y in &mut observations {
        *y = if y.is_nan() { 0.0 } else { *y };
    }
    let times = in_steps(observations.len());
    let series = Series {
        times: &times,
        observations: &observations,
        regressors: &regressors,
        prior: 0.25,
        shared: 4.0,
    };
    let model = Structural {
        observation: 0.3,
        level: 0.0,
        trend: None,
        returning: 0.0,
        passage: Passage::Steps,
    };
    let found = follow(model, &series).unwrap();
    let mut blocks = GramBlocks::new(2);
    for (x, &y) in regressors.chunks_exact(2).zip(&observations) {
        blocks.push(x, y);
    }
    let ridge = LeastSquares::ridge(4.0);
    let fit = ridge
        .solve(&blocks.total(), &[0, 1], &[1.0, 1.0], None)
        .unwrap();
    for (nth, coefficient) in fit.coefficients.iter().enumerate() {
        near(
            found.filter.state()[1 + nth],
            *coefficient,
            2e-2 * coefficient.abs(),
        );
    }
    // Four that share their noise are as sure as one.
    let alone = Series {
        shared: 0.0,
        ..series
    };
    let alone = follow(model, &alone).unwrap();
    let ratio = found.filter.covariance()[4] / alone.filter.covariance()[4];
    near(ratio, 4.0, 0.3);
}

#[test]
fn a_level_that_returns_is_found_as_an_autoregression() {
    let mut normal = crate::draws::normal(7);
    let kept: f64 = 0.8;
    let mut level = 0.0;
    let observations: Vec<f64> = (0..4000)
        .map(|_| {
            level = kept * level + normal();
            level + 0.5 * normal()
        })
        .collect();
    let times = in_steps(observations.len());
    let series = Series {
        times: &times,
        observations: &observations,
        regressors: &[],
        prior: f64::INFINITY,
        shared: 0.0,
    };
    let found = most_likely(Movement::Returns, Passage::Continuous, &series).unwrap();
    near((-found.model.returning).exp(), kept, 0.05);
    near(found.model.observation, 0.25, 0.15);
    let stays = most_likely(Movement::Wanders, Passage::Continuous, &series).unwrap();
    assert!(found.log_likelihood > stays.log_likelihood + 10.0);
    assert!(found.innovation_rms < stays.innovation_rms);
    let (now, later) = (
        found.filter.forecast(0.0, &[]),
        found.filter.forecast(9.0, &[]),
    );
    let (now, later) = (now.unwrap(), later.unwrap());
    near(later.mean, now.mean * found.model.kept(9.0), 1e-12);
    assert!(later.variance < 1.2 / (1.0 - kept * kept));
}

#[test]
fn while_nothing_is_known_nothing_is_predicted() {
    let mut filter = Kalman::diffuse(OWN, 1).unwrap();
    assert!(filter.is_diffuse() && filter.forecast(1.0, &[2.0]).is_none());
    for (nth, (x, y)) in [(2.0, 1.0), (1.0, 3.0), (4.0, 2.0)].into_iter().enumerate() {
        assert_eq!(filter.is_diffuse(), nth < 3);
        assert!(filter.observe(&[x], y).unwrap().diffuse);
        filter.advance(1.0);
    }
    assert!(!filter.is_diffuse() && filter.forecast(1.0, &[2.0]).is_some());
}

#[test]
fn a_level_that_is_forgotten_is_learned_anew_and_coefficients_stay() {
    let mut filter = Kalman::diffuse(OWN, 1).unwrap();
    for step in 0..200 {
        let x = f64::from(step % 7);
        filter.observe(&[x], 10.0 + 2.0 * x);
        filter.advance(1.0);
    }
    filter.forget_level();
    assert!(filter.forecast(0.0, &[1.0]).is_none());
    filter.observe(&[1.0], -50.0);
    near(filter.state()[2], 2.0, 1e-3);
    near(filter.forecast(0.0, &[1.0]).unwrap().mean, -50.0, 1e-9);
    // Two observations at a distance tell the level; the trend is still unknown after one.
    assert!(filter.forecast(5.0, &[1.0]).is_none());
}

#[test]
fn a_level_that_is_restarted_is_known_as_well_as_is_told() {
    let mut filter = Kalman::diffuse(OWN, 1).unwrap();
    for step in 0..200 {
        let x = f64::from(step % 7);
        filter.observe(&[x], 10.0 + 2.0 * x);
        filter.advance(1.0);
    }
    let coefficient = filter.covariance()[8];
    filter.restart_level(&[(-3.0, 4.0), (0.5, 0.25)]);
    assert!(!filter.is_diffuse());
    let forecast = filter.forecast(2.0, &[0.0]).unwrap();
    near(forecast.mean, -2.0, 1e-12);
    let gained = 2.0 * OWN.level + OWN.trend.unwrap();
    near(forecast.variance, 4.0 + 4.0 * 0.25 + gained, 1e-12);
    assert_eq!(filter.covariance()[8], coefficient);
}

#[test]
fn a_filter_goes_on_from_another_of_the_same_states_only() {
    let mut from = Kalman::diffuse(OWN, 1).unwrap();
    for (x, y) in [(1.0, 2.0), (3.0, 1.0), (2.0, 2.0), (5.0, 5.0)] {
        from.observe(&[x], y);
        from.advance(1.0);
    }
    let noisier = Structural {
        observation: 1.0,
        ..OWN
    };
    let mut to = Kalman::diffuse(noisier, 1).unwrap();
    assert!(to.resume(&from));
    assert_eq!((to.state(), to.model()), (from.state(), noisier));
    let level = Structural { trend: None, ..OWN };
    assert!(!Kalman::diffuse(level, 1).unwrap().resume(&from));
    assert!(!Kalman::diffuse(level, 2).unwrap().resume(&from));
}

#[test]
fn a_filter_is_read_back_as_it_was_and_refused_where_its_parts_do_not_fit() {
    let mut filter = Kalman::diffuse(OWN, 1).unwrap();
    for (x, y) in [(1.0, 2.0), (3.0, 1.0)] {
        filter.observe(&[x], y);
        filter.advance(1.0);
    }
    let saved = serde_json::to_value(&filter).unwrap();
    let read = |saved: &serde_json::Value| serde_json::from_value::<Kalman>(saved.clone());
    let with = |part: &str, instead: serde_json::Value| {
        let mut other = saved.clone();
        other[part] = instead;
        read(&other)
    };
    let mut back = read(&saved).unwrap();
    assert_eq!(back.regressors(), 1);
    assert_eq!(back.observe(&[2.0], 5.0), filter.observe(&[2.0], 5.0));
    assert_eq!(back.state(), filter.state());
    assert!(with("room", serde_json::json!([0.0])).is_ok());
    let error = with("covariance", serde_json::json!([1.0])).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the length of covariance is 1 where 9 is needed"
    );
    for (part, instead) in [
        ("state", serde_json::json!([1.0])),
        ("diffuse", serde_json::json!([])),
        ("unknown", serde_json::json!(4)),
        (
            "covariance",
            serde_json::json!([-1.0, 0, 0, 0, 1, 0, 0, 0, 1]),
        ),
        (
            "covariance",
            serde_json::json!([1, 2.0, 0, 0, 1, 0, 0, 0, 1]),
        ),
        ("other", serde_json::json!(0)),
    ] {
        assert!(with(part, instead).is_err(), "{part}");
    }
}

#[test]
fn a_level_restarts_from_a_finite_pair_for_each_of_its_parts_only() {
    let filter = Kalman::diffuse(OWN, 1).unwrap();
    assert!(filter.can_restart(&[(1.0, 2.0), (0.0, 0.0)]));
    for known in [
        &[(1.0, 2.0)][..],
        &[(1.0, 2.0), (0.0, -1.0)],
        &[(1.0, f64::NAN), (0.0, 1.0)],
        &[(1.0, f64::INFINITY), (0.0, 1.0)],
        &[(f64::NAN, 1.0), (0.0, 1.0)],
    ] {
        assert!(!filter.can_restart(known), "{known:?}");
    }
}

#[test]
fn what_is_no_number_is_no_observation() {
    let mut filter = Kalman::diffuse(OWN, 1).unwrap();
    let before = filter.clone();
    for (x, y) in [(f64::NAN, 1.0), (1.0, f64::INFINITY), (f64::INFINITY, 1.0)] {
        assert!(filter.observe(&[x], y).is_none());
    }
    assert_eq!(filter.state(), before.state());
    assert_eq!(filter.covariance(), before.covariance());
}

#[test]
fn what_cannot_be_followed_is_refused() {
    let negative = Structural {
        level: f64::NAN,
        ..OWN
    };
    assert!(matches!(
        Kalman::diffuse(negative, 0),
        Err(NumericsError::Parameter { name: "level", .. })
    ));
    let narrow = Kalman::starting_at(OWN, vec![0.0; 2], &[1.0]);
    assert!(matches!(narrow, Err(NumericsError::Width { .. })));
    let series = |observations, times| Series {
        times,
        observations,
        regressors: &[],
        prior: f64::INFINITY,
        shared: 0.0,
    };
    let few = most_likely(
        Movement::Wanders,
        Passage::Steps,
        &series(&[1.0, 2.0], &[f64::NAN, 1.0]),
    );
    assert!(matches!(
        few,
        Err(NumericsError::TooFewRows {
            needed: 4,
            found: 2
        })
    ));
    let same = most_likely(
        Movement::Wanders,
        Passage::Steps,
        &series(&[1.0; 6], &[1.0; 6]),
    );
    assert_eq!(same, Err(NumericsError::NoConvergence));
}
