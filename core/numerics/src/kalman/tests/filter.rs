//! What a filter knows after each observation.

use super::*;

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
fn an_observation_that_moves_the_level_alone_counts_with_what_is_not_known_of_the_rest() {
    let model = Structural { trend: None, ..OWN };
    // Level 1 and coefficient 2, with a covariance of 0.1 between them.
    let start = [0.5, 0.1, 0.1, 0.3];
    let mut filter = Kalman::starting_at(model, vec![1.0, 2.0], &start).unwrap();
    let x = 4.0;
    let brought = filter.observe_with(1, &[x], 12.0, 0.5).unwrap();
    let variance = 0.5 + 2.0 * x * 0.1 + x * x * 0.3 + model.observation / 0.5;
    near(brought.error, 12.0 - 1.0 - 2.0 * x, 1e-12);
    near(brought.variance, variance, 1e-12);
    let (own, of_coefficient) = (0.5 + x * 0.1, 0.1 + x * 0.3);
    let gain = own / variance;
    near(filter.state()[0], 1.0 + gain * brought.error, 1e-12);
    assert_eq!(filter.state()[1], 2.0);
    let found = filter.covariance();
    near(found[0], 0.5 - gain * own, 1e-12);
    near(found[1], 0.1 - gain * of_coefficient, 1e-12);
    assert_eq!((found[2], found[3]), (found[1], 0.3));
    let mut diffuse = Kalman::diffuse(model, 1).unwrap();
    assert!(diffuse.observe_with(1, &[x], 12.0, 1.0).is_none());
}

#[test]
fn a_level_that_may_have_leapt_is_where_the_next_observation_puts_it_and_coefficients_stay() {
    let mut filter = Kalman::diffuse(OWN, 1).unwrap();
    for step in 0..200 {
        let x = f64::from(step % 7);
        filter.observe(&[x], 10.0 + 2.0 * x);
        filter.advance(1.0);
    }
    let before = filter.clone();
    for leap in [1e3, 1e5] {
        let mut filter = before.clone();
        filter.widen(0, leap * leap);
        filter.observe(&[3.0], 16.0 + leap);
        near(filter.state()[0], 10.0 + leap, 1e-3);
        near(filter.state()[2], before.state()[2], 1e-4);
        near(filter.covariance()[0], OWN.observation, 0.05);
        let ratio = filter.covariance()[8] / before.covariance()[8];
        near(ratio, 1.0, 1e-4);
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

/// A level, a trend and a coefficient, followed in segments of so many rows, and whether all is known after each segment.
fn known_after_segments(rows: usize, trend: Option<f64>) -> Vec<bool> {
    let model = Structural { trend, ..OWN };
    let mut filter = Kalman::diffuse(model, 1).unwrap();
    let mut x = 0.5;
    let segments = (0..6).map(|_| {
        filter.forget_level();
        for row in 0..rows {
            if row > 0 {
                filter.advance(1.0);
            }
            x = 3.7 * x * (1.0 - x);
            filter.observe(&[x], 1.0 + x);
        }
        !filter.is_diffuse()
    });
    segments.collect()
}

#[test]
fn a_coefficient_is_not_known_from_segments_that_are_too_short_for_level_and_trend() {
    // A row tells the level, another one the trend, and only one more in the same segment the coefficient.
    assert_eq!(known_after_segments(1, None), [false; 6]);
    assert_eq!(known_after_segments(2, None), [true; 6]);
    assert_eq!(known_after_segments(1, OWN.trend), [false; 6]);
    assert_eq!(known_after_segments(2, OWN.trend), [false; 6]);
    assert_eq!(known_after_segments(3, OWN.trend), [true; 6]);
}

#[test]
fn a_segment_that_ends_while_its_trend_is_unknown_leaves_the_next_as_much_to_tell() {
    let mut filter = Kalman::diffuse(OWN, 0).unwrap();
    filter.observe(&[], 1.0);
    // A row without an observation.
    filter.advance(1.0);
    filter.forget_level();
    filter.observe(&[], 1.0);
    assert!(filter.is_diffuse(), "the trend is not known");
    filter.advance(1.0);
    filter.observe(&[], 2.0);
    assert!(!filter.is_diffuse());
}

#[test]
fn filters_that_know_the_same_are_equal_whatever_way_they_came() {
    let mut filter = Kalman::diffuse(OWN, 1).unwrap();
    filter.observe(&[0.5], 1.0);
    let mut other = Kalman::diffuse(OWN, 1).unwrap();
    assert!(other.resume(&filter));
    assert_eq!(other, filter);
    other.observe(&[0.5], 1.0);
    assert_ne!(other, filter);
}

#[test]
fn one_more_coefficient_that_is_known_to_be_0_changes_nothing() {
    let mut filter = Kalman::diffuse(OWN, 1).unwrap();
    for step in 0..20 {
        let x = f64::from(step % 7);
        filter.observe(&[x], 10.0 + 2.0 * x);
        filter.advance(1.0);
    }
    let mut wider = filter.with_coefficient();
    let brought = filter.observe(&[3.0], 15.0);
    assert_eq!(wider.observe(&[1.0, 3.0], 15.0), brought);
    assert_eq!(wider.state()[..2], filter.state()[..2]);
    assert_eq!(wider.state()[2..], [0.0, filter.state()[2]]);
    assert_eq!(
        wider.forecast(3.0, &[1.0, 4.0]),
        filter.forecast(3.0, &[4.0])
    );
}

/// A step: the time that passes, the regressor and the observation.
type Step = (f64, f64, f64);

/// Follows steps from these variances of level, trend and a coefficient, and compares state and covariance with those that the
/// textbook's recursion gives with 80 digits.
fn compare(variances: [f64; 3], steps: &[Step], state: [f64; 3], covariance: [f64; 9]) {
    let model = Structural {
        observation: 1.0,
        level: 0.25,
        trend: Some(1.0),
        returning: 0.0,
        passage: Passage::Continuous,
    };
    let mut start = [0.0; 9];
    for (nth, variance) in variances.into_iter().enumerate() {
        start[4 * nth] = variance;
    }
    let mut filter = Kalman::starting_at(model, vec![0.0; 3], &start).unwrap();
    for &(time, x, y) in steps {
        filter.advance(time);
        filter.observe(&[x], y).unwrap();
    }
    for (found, expected) in filter.state().iter().zip(state) {
        near(found / expected, 1.0, 1e-7);
    }
    for (found, expected) in filter.covariance().iter().zip(covariance) {
        near(found / expected, 1.0, 1e-7);
    }
}

#[test]
fn after_a_gap_that_makes_a_level_unknown_what_is_known_is_that_of_exact_arithmetic() {
    let steps = [
        (1.0, 0.5, 3.0),
        (1.0, -1.25, 4.5),
        (3e6, 0.75, -2e9),
        (1.0, 2.0, -2.0005e9),
        (2.0, -0.5, -2.00125e9),
    ];
    compare(
        [4.0, 1.0, 9.0],
        &steps[..3],
        [
            -1_999_999_999.759693,
            -1000.5430954228848,
            -0.320409463939139,
        ],
        [
            1.6598944284785908,
            0.3627971463773913,
            -0.8798592379717768,
            0.3627971463773913,
            750000.5508738761,
            -0.48372886183701136,
            -0.8798592379717768,
            -0.48372886183701136,
            1.1731456506294657,
        ],
    );
    compare(
        [4.0, 1.0, 9.0],
        &steps,
        [-2001270135.8913832, -420646.8859646229, -30032.202943360873],
        [
            0.976516858421331,
            0.515124629197411,
            0.1141223047234698,
            0.515124629197411,
            1.4968501071864875,
            0.3954240789829986,
            0.1141223047234698,
            0.3954240789829986,
            0.46850242405694814,
        ],
    );
}

#[test]
fn a_coefficient_of_which_hardly_anything_is_known_is_found_as_in_exact_arithmetic() {
    compare(
        [4.0, 1.0, 1e18],
        &[(1.0, 0.5, 3.0), (1.0, -1.25, 4.5)],
        [3.905142052124912, 1.0481333646395867, -0.36769194646630665],
        [
            1.7699186037410972,
            1.4779290913359944,
            1.1555920795178838,
            1.4779290913359944,
            2.3230805353369335,
            1.1124677154261564,
            1.1555920795178838,
            1.1124677154261564,
            1.348986460045394,
        ],
    );
}

#[test]
fn states_that_stay_are_as_uncertain_after_a_gap_as_before() {
    let model = Structural {
        observation: 1.0,
        level: 1e18,
        trend: None,
        returning: 0.0,
        passage: Passage::Continuous,
    };
    let start = [4.0, 0.5, 0.5, 9.0];
    let mut filter = Kalman::starting_at(model, vec![0.0; 2], &start).unwrap();
    filter.advance(1.0);
    filter.observe_with(1, &[0.5], 7.0, 1.0).unwrap();
    assert_eq!(filter.state()[1], 0.0);
    // The level is the observation less what the coefficient makes of it: Var = R + x² Var(b), Cov = −x Var(b).
    for (found, expected) in filter.covariance().iter().zip([3.25, -4.5, -4.5, 9.0]) {
        near(*found, expected, 1e-9);
    }
}

#[test]
fn no_noises_however_far_apart_leave_a_variance_below_0() {
    let times: Vec<f64> = (0..40)
        .map(|nth| if nth == 0 { f64::NAN } else { 300.0 })
        .collect();
    let observations: Vec<f64> = (0..40).map(|nth| 3.0 * f64::from(nth).sin()).collect();
    for observation in [1.0, 1e-6, 1e-12, 0.0] {
        for (level, trend) in [
            (1e12, None),
            (1e18, None),
            (0.0, Some(1e6)),
            (0.0, Some(1e16)),
        ] {
            for regressors in [&[][..], &observations] {
                let series = Series {
                    times: &times,
                    observations: &observations,
                    regressors,
                    prior: 1.0,
                    shared: 0.0,
                };
                let model = Structural {
                    observation,
                    level,
                    trend,
                    returning: 0.0,
                    passage: Passage::Continuous,
                };
                let followed = follow(model, &series).unwrap();
                assert!(followed.filter.can_restart(&followed.at_large), "{model:?}");
                let order = followed.filter.state().len();
                for state in 0..order {
                    assert!(followed.filter.covariance()[state * (order + 1)] >= 0.0);
                }
            }
        }
    }
}
