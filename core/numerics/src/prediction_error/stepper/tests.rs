//! What a stepper makes of samples that are there, that are missing, and of those before the first.

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
    stepper.settle_on(values[0]);
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
    stepper.settle_on(1.0);
    // The variances of the innovations algorithm (Brockwell and Davis 1991, example 5.2.1).
    let mut variance = 1.0 + c * c;
    for _ in 0..20 {
        assert!((1.0 + stepper.doubt(&[1.0], 1) - variance).abs() < 1e-12);
        stepper.step(|_| 0.0, Some(0.3));
        variance = 1.0 + c * c - c * c / variance;
    }
    for _ in 0..200 {
        stepper.step(|_| 0.0, Some(0.3));
    }
    assert_eq!(stepper.doubt(&[1.0], 1), 0.0);
}

/// The variance of what is `ahead` samples after the newest of so many, which all follow a start at which all but the
/// innovations was known: of the samples as sums of innovations, the part that those measured do not tell.
fn variance_by_hand(model: &Polynomials, known: usize, ahead: usize) -> f64 {
    let (before, all) = (model.c.len(), known + ahead);
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
    let among = covariance.submatrix(0, 0, known, known);
    let with = covariance.submatrix(0, all - 1, known, 1);
    let told = faer::linalg::solvers::Solve::solve(&among.partial_piv_lu(), &with);
    let told: f64 = (0..known).map(|nth| told[(nth, 0)] * with[(nth, 0)]).sum();
    covariance[(all - 1, all - 1)] - told
}

#[test]
fn the_doubt_of_a_start_is_carried_to_the_sample_that_is_predicted() {
    let noise = |a: &[f64], c: &[f64], d: &[f64], differences: usize| Polynomials {
        a: a.to_vec(),
        inputs: vec![],
        c: c.to_vec(),
        d: d.to_vec(),
        differences,
        level: 0.0,
    };
    let models = [
        noise(&[], &[0.8], &[], 0),
        noise(&[-0.7], &[0.5], &[], 0),
        noise(&[-1.2, 0.4], &[0.4, -0.3, 0.6], &[], 0),
        noise(&[], &[0.6, 0.2], &[-0.7], 0),
        noise(&[-0.5], &[-0.9], &[], 1),
        noise(&[], &[-1.0], &[], 1),
    ];
    for model in models {
        let (response, variances) = (model.response(30), model.variances(30));
        for known in 0..6 {
            let mut stepper = Stepper::new(model.clone());
            stepper.settle_on(0.0);
            for _ in 0..known {
                stepper.step(|_| 0.0, Some(0.0));
            }
            // As many are missing as there are between the newest and the one that is predicted, or fewer.
            for missed in 0..4 {
                for steps in 1..4 {
                    let ahead = missed + steps;
                    let found = variances[ahead - 1] + stepper.doubt(&response, steps);
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
    stepper.settle_on(1.0);
    let variance = model.variances(2)[1] + stepper.doubt(&model.response(2), 2);
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
    stepper.settle_on(1.0);
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
    stepper.settle_on(1.0);
    stepper.step(|_| 0.0, Some(0.3));
    let mut other = Stepper::new(model);
    other.take(&stepper);
    assert_eq!(other, stepper);
    other.step(|_| 0.0, Some(0.3));
    assert_ne!(other, stepper);
}
