//! Which variances are found, and what a series is followed to.

use super::*;

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
    let series = of_truths(&times, &observations);
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
    let series = of_truths(&times, &observations);
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
fn a_level_that_wanders_is_not_taken_for_one_that_returns() {
    let found = |kept: f64| {
        let returned = (0..40).map(|seed| {
            let mut normal = crate::draws::normal(seed);
            let mut level = 0.0;
            let observations: Vec<f64> = (0..400)
                .map(|_| {
                    level = kept * level + 0.3 * normal();
                    level + normal()
                })
                .collect();
            let times = in_steps(observations.len());
            let series = of_truths(&times, &observations);
            let found = most_likely(Movement::Returns, Passage::Continuous, &series).unwrap();
            u32::from(found.model.returning > 0.0)
        });
        returned.sum::<u32>()
    };
    // One in twenty; and of such as come back ten times within the series nearly all.
    assert!(found(1.0) <= 5, "{}", found(1.0));
    assert!(found(0.9) >= 30, "{}", found(0.9));
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
    let series = |observations, times| of_truths(times, observations);
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
