//! What a stepper makes of samples that are there, that are missing, and of those before the first.

use super::super::roots::is_within;
use super::super::{Orders, Transfer};
use super::*;
use crate::draws::uniform;

/// What `y` is expected to be next, if it is `C(q) e` and nothing is known but its past: least squares on its autocovariance.
fn expected_of_moving_average(c: &[f64], past: &[f64]) -> f64 {
    let c: Vec<f64> = std::iter::once(1.0).chain(c.iter().copied()).collect();
    let covariance = |lag: usize| -> f64 {
        c.iter()
            .zip(&c[lag.min(c.len())..])
            .map(|(a, b)| a * b)
            .sum()
    };
    let count = past.len();
    let of = |i: usize, j: usize| covariance(i.abs_diff(j));
    let among = faer::Mat::from_fn(count, count, of);
    let with_next = faer::Mat::from_fn(count, 1, |i, _| of(i, count));
    let weights = faer::linalg::solvers::Solve::solve(&among.partial_piv_lu(), &with_next);
    (0..count).map(|i| weights[(i, 0)] * past[i]).sum()
}

#[test]
fn from_the_start_a_moving_average_is_followed_as_well_as_its_past_allows() {
    for c in [vec![-1.0], vec![0.5], vec![-1.2, 0.4], vec![0.3, -0.2, 0.9]] {
        let mut stepper = Stepper::new(Polynomials {
            a: vec![],
            inputs: vec![],
            c: c.clone(),
            d: vec![],
            differences: 0,
            level: 3.0,
        });
        stepper.rest(|_| 0.0);
        let (mut noise, mut past) = (uniform(5), Vec::new());
        for _ in 0..12 {
            let value = noise();
            let expected = expected_of_moving_average(&c, &past);
            let found = stepper.step(|_| 0.0, Some(3.0 + value)) - 3.0;
            assert!(
                (found - expected).abs() < 1e-9,
                "{c:?}: {found}, not {expected}"
            );
            past.push(value);
        }
    }
}

#[test]
fn what_has_a_level_but_is_taken_for_integrated_is_followed_as_a_mean() {
    let mut stepper = Stepper::new(Polynomials {
        a: vec![],
        inputs: vec![],
        c: vec![-1.0],
        d: vec![],
        differences: 1,
        level: 0.0,
    });
    let values = [40.0, 1.0, -2.0, 3.0, 0.5, -1.5];
    stepper.rest(|_| 0.0);
    stepper.step(|_| 0.0, Some(values[0]));
    stepper.settle(values[0], f64::INFINITY);
    for count in 1..values.len() {
        let mean = values[..count].iter().sum::<f64>() / count as f64;
        let found = stepper.step(|_| 0.0, Some(values[count]));
        assert!((found - mean).abs() < 1e-12, "{count}: {found}, not {mean}");
    }
}

#[test]
fn right_after_a_start_predictions_of_a_moving_average_are_less_sure_by_what_came_before_it() {
    let c = 0.8;
    let mut stepper = Stepper::new(Polynomials {
        c: vec![c],
        ..Polynomials::zero(&Orders {
            nc: 1,
            ..Orders::default()
        })
    });
    stepper.settle(1.0, f64::INFINITY);
    // The variances of the innovations algorithm (Brockwell and Davis 1991, example 5.2.1).
    let mut variance = 1.0 + c * c;
    for _ in 0..20 {
        assert!((1.0 + doubt(&stepper, 1) - variance).abs() < 1e-12);
        stepper.step(|_| 0.0, Some(0.3));
        variance = 1.0 + c * c - c * c / variance;
    }
    for _ in 0..200 {
        stepper.step(|_| 0.0, Some(0.3));
    }
    assert_eq!(doubt(&stepper, 1), 0.0);
}

/// What the last of so many samples is expected to be and with which variance, where some of those before it are known and a
/// start at which all but the innovations was 0: of the samples as sums of innovations, what those known tell.
fn expected_by_hand(model: &Polynomials, known: &[Option<f64>]) -> (f64, f64) {
    let (before, all) = (model.c.len(), known.len() + 1);
    let mut filter = vec![1.0];
    let differences = std::iter::repeat_n(&[-1.0][..], model.differences);
    for polynomial in [&model.a[..], &model.d].into_iter().chain(differences) {
        let of = |nth: usize| if nth == 0 { 1.0 } else { polynomial[nth - 1] };
        let mut product = vec![0.0; filter.len() + polynomial.len()];
        for (i, own) in filter.iter().enumerate() {
            (0..=polynomial.len()).for_each(|j| product[i + j] += own * of(j));
        }
        filter = product;
    }
    // What the innovation before or after the start leads to.
    let samples = faer::Mat::from_fn(all, before + all, |_, _| 0.0);
    let samples = (0..before + all).fold(samples, |mut samples, nth| {
        for row in 0..all {
            let back = (row + before).checked_sub(nth);
            let own = match back {
                Some(0) => 1.0,
                Some(back) => model.c.get(back - 1).copied().unwrap_or(0.0),
                None => 0.0,
            };
            let past =
                (1..filter.len().min(row + 1)).map(|lag| filter[lag] * samples[(row - lag, nth)]);
            samples[(row, nth)] = own - past.sum::<f64>();
        }
        samples
    });
    let covariance = &samples * samples.transpose();
    let told = known.iter().enumerate();
    let told: Vec<(usize, f64)> = told
        .filter_map(|(nth, value)| Some((nth, (*value)?)))
        .collect();
    let count = told.len();
    let among = faer::Mat::from_fn(count, count, |i, j| covariance[(told[i].0, told[j].0)]);
    let with = faer::Mat::from_fn(count, 1, |i, _| covariance[(told[i].0, all - 1)]);
    let weights = faer::linalg::solvers::Solve::solve(&among.partial_piv_lu(), &with);
    let each = || (0..count).map(|i| (weights[(i, 0)], i));
    let expected = each().map(|(weight, i)| weight * told[i].1).sum();
    let explained: f64 = each().map(|(weight, i)| weight * with[(i, 0)]).sum();
    (expected, covariance[(all - 1, all - 1)] - explained)
}

/// The variance of what is `ahead` samples after the newest of so many that are all known.
fn variance_by_hand(model: &Polynomials, known: usize, ahead: usize) -> f64 {
    let mut samples = vec![Some(0.0); known];
    samples.resize(known + ahead - 1, None);
    expected_by_hand(model, &samples).1
}

fn doubt(stepper: &Stepper, steps: usize) -> f64 {
    stepper.doubt(steps, &mut vec![0.0; stepper.remembers()])
}

fn noise(a: &[f64], c: &[f64], d: &[f64], differences: usize) -> Polynomials {
    Polynomials {
        a: a.to_vec(),
        inputs: vec![],
        c: c.to_vec(),
        d: d.to_vec(),
        differences,
        level: 0.0,
    }
}

/// Models of every kind of past.
fn noises() -> [Polynomials; 9] {
    [
        noise(&[], &[0.8], &[], 0),
        noise(&[-0.7], &[], &[], 0),
        noise(&[-0.7], &[0.5], &[], 0),
        noise(&[-1.2, 0.4], &[0.4, -0.3, 0.6], &[], 0),
        noise(&[], &[0.6, 0.2], &[-0.7], 0),
        noise(&[], &[], &[-1.1, 0.3], 1),
        noise(&[-0.5], &[-0.9], &[], 1),
        noise(&[], &[-1.0], &[], 1),
        noise(&[-0.6, 0.2], &[0.4], &[-0.7], 2),
    ]
}

#[test]
fn where_samples_are_missing_predictions_and_their_variances_are_what_the_others_tell() {
    for model in noises() {
        for seed in 0..4 {
            let (mut chance, mut known) = (uniform(seed), Vec::new());
            let mut stepper = Stepper::new(model.clone());
            stepper.settle(0.0, f64::INFINITY);
            for nth in 0..25 {
                let (expected, variance) = expected_by_hand(&model, &known);
                let ahead = 1.0 + doubt(&stepper, 1);
                assert!(
                    (ahead - variance).abs() < 1e-7 * variance,
                    "{model:?}, {nth}: {ahead}, not {variance}"
                );
                let value = (chance() > -0.2).then(|| 3.0 * chance());
                let found = stepper.step(|_| 0.0, value);
                assert!(
                    (found - expected).abs() < 1e-7 * (1.0 + expected.abs()),
                    "{model:?}, {nth} of {known:?}: {found}, not {expected}"
                );
                known.push(value);
            }
        }
    }
}

#[test]
fn some_samples_after_a_gap_nothing_is_in_doubt() {
    for model in noises() {
        // Innovations before a root near the unit circle are forgotten slowly, or never.
        if !is_within(&model.c, 0.85) {
            continue;
        }
        let mut stepper = Stepper::new(model.clone());
        stepper.settle(0.0, f64::INFINITY);
        (0..300).for_each(|_| _ = stepper.step(|_| 0.0, Some(0.1)));
        assert_eq!(doubt(&stepper, 1), 0.0, "{model:?}");
        (0..3000).for_each(|_| _ = stepper.step(|_| 0.0, None));
        assert!(doubt(&stepper, 1) > 0.0, "{model:?}");
        (0..300).for_each(|_| _ = stepper.step(|_| 0.0, Some(0.1)));
        assert_eq!(doubt(&stepper, 1), 0.0, "{model:?}");
    }
}

#[test]
fn a_model_that_grows_without_end_is_followed_again_after_a_gap_in_which_it_did() {
    let mut stepper = Stepper::new(noise(&[-1.5], &[0.3], &[], 0));
    stepper.settle(0.0, f64::INFINITY);
    stepper.step(|_| 0.0, Some(0.0));
    (0..1200).for_each(|_| _ = stepper.step(|_| 0.0, None));
    for value in [1.0, 1.0] {
        stepper.step(|_| 0.0, Some(value));
    }
    let predicted = stepper.step(|_| 0.0, None);
    assert!(
        predicted.is_finite() && predicted.abs() < 3.0,
        "{predicted}"
    );
}

#[test]
fn what_is_foreseen_is_what_steps_without_samples_predict() {
    for model in noises() {
        let mut stepper = Stepper::new(model);
        stepper.settle(1.0, f64::INFINITY);
        for value in [Some(0.4), None, Some(-0.2)] {
            stepper.step(|_| 0.0, value);
        }
        let mut other = Stepper::new(stepper.model().clone());
        other.take_past(&stepper);
        for _ in 0..5 {
            assert_eq!(other.foresee(|_| 0.0), stepper.step(|_| 0.0, None));
        }
    }
}

#[test]
fn the_doubt_of_a_start_is_carried_to_the_sample_that_is_predicted() {
    for model in noises() {
        let variances = model.variances(30);
        for known in 0..6 {
            let mut stepper = Stepper::new(model.clone());
            stepper.settle(0.0, f64::INFINITY);
            for _ in 0..known {
                stepper.step(|_| 0.0, Some(0.0));
            }
            // As many are missing as there are between the newest and the one that is predicted, or fewer.
            for missed in 0..4 {
                for steps in 1..4 {
                    let ahead = missed + steps;
                    let found = variances[steps - 1] + doubt(&stepper, steps);
                    let expected = variance_by_hand(&model, known, ahead);
                    assert!(
                        (found - expected).abs() < 1e-9 * expected,
                        "{model:?}, {ahead} after {known}: {found}, not {expected}"
                    );
                }
                stepper.step(|_| 0.0, None);
            }
        }
    }
}

#[test]
fn two_samples_after_a_truth_a_moving_average_of_one_is_known_no_worse_than_its_spread() {
    let c = 0.8;
    let model = Polynomials {
        c: vec![c],
        ..Polynomials::zero(&Orders {
            nc: 1,
            ..Orders::default()
        })
    };
    let mut stepper = Stepper::new(model.clone());
    stepper.settle(1.0, f64::INFINITY);
    let variance = model.variances(2)[1] + doubt(&stepper, 2);
    assert!((variance - (1.0 + c * c)).abs() < 1e-12, "{variance}");
}

#[test]
fn a_stepper_that_is_read_back_goes_on_as_it_was_and_one_whose_parts_do_not_fit_is_refused() {
    let model = Polynomials {
        a: vec![-0.5],
        inputs: vec![Transfer {
            delay: 1,
            b: vec![0.5, 0.2],
            f: vec![-0.6],
        }],
        c: vec![0.5, 0.2],
        d: vec![-0.3],
        differences: 1,
        level: 0.0,
    };
    let mut stepper = Stepper::new(model);
    stepper.settle(1.0, f64::INFINITY);
    stepper.step(|_| 0.2, Some(0.3));
    stepper.step(|_| 0.2, None);
    let written = serde_json::to_value(&stepper).unwrap();
    let mut read: Stepper = serde_json::from_value(written.clone()).unwrap();
    for value in [Some(0.4), None, Some(-0.1)] {
        assert_eq!(read.step(|_| 0.1, value), stepper.step(|_| 0.1, value));
    }
    for place in [
        "/past",
        "/whitening",
        "/noise",
        "/innovations",
        "/doubt",
        "/inputs",
        "/inputs/0/values",
        "/inputs/0/filtered",
        "/model/c",
    ] {
        let mut spoilt = written.clone();
        spoilt
            .pointer_mut(place)
            .unwrap()
            .as_array_mut()
            .unwrap()
            .pop();
        let refused = serde_json::from_value::<Stepper>(spoilt).unwrap_err();
        assert!(
            refused.to_string().contains("the length of"),
            "{place}: {refused}"
        );
    }
}

#[test]
fn steppers_that_are_where_another_is_are_equal_whatever_way_they_came() {
    let model = Polynomials {
        c: vec![0.5, 0.2],
        ..Polynomials::zero(&Orders {
            nc: 2,
            ..Orders::default()
        })
    };
    let mut stepper = Stepper::new(model.clone());
    stepper.settle(1.0, f64::INFINITY);
    stepper.step(|_| 0.0, Some(0.3));
    let mut other = Stepper::new(model);
    other.take(&stepper);
    assert_eq!(other, stepper);
    other.step(|_| 0.0, Some(0.3));
    assert_ne!(other, stepper);
}
