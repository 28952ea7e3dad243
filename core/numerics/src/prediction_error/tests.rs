use faer::Mat;

use super::residuals::Left;
use super::search::remembered;
use super::segment::{Counted, Segment};
use super::*;
use crate::draws::uniform as noise;

/// What a model gives when it is fed noise, in two segments.
pub(super) fn simulated(model: &Polynomials, count: usize, spread: f64, seed: u64) -> Samples {
    let mut samples = Samples::new(model.inputs.len());
    let (mut u, mut e) = (noise(seed), noise(seed + 1));
    for length in [count / 3, count - count / 3] {
        samples.segment();
        let mut stepper = Stepper::new(model.clone());
        let mut level = vec![0.0; model.inputs.len()];
        for nth in 0..length {
            for of in &mut level {
                *of = if nth == 0 { 0.0 } else { 0.7 * *of + u() };
            }
            let mut next = stepper.clone();
            let expected = next.step(|i| level[i], None);
            let value = expected + spread * e();
            stepper.step(|i| level[i], Some(value));
            samples.push(level.iter().copied(), value);
        }
    }
    samples
}

fn transfer(delay: usize, b: &[f64], f: &[f64]) -> Transfer {
    Transfer {
        delay,
        b: b.to_vec(),
        f: f.to_vec(),
    }
}

pub(super) fn orders(model: &Polynomials) -> Orders {
    let inputs = model.inputs.iter().map(|of| InputOrders {
        nb: of.b.len(),
        nk: of.delay,
        nf: of.f.len(),
    });
    Orders {
        na: model.a.len(),
        inputs: inputs.collect(),
        nc: model.c.len(),
        nd: model.d.len(),
        differences: model.differences,
    }
}

/// A model of every kind.
pub(super) fn models() -> Vec<(&'static str, Polynomials)> {
    let none = Polynomials {
        a: vec![],
        inputs: vec![],
        c: vec![],
        d: vec![],
        differences: 0,
        level: 3.0,
    };
    vec![
        (
            "ARMA",
            Polynomials {
                a: vec![-1.4, 0.6],
                c: vec![0.5],
                ..none.clone()
            },
        ),
        (
            "moving average",
            Polynomials {
                c: vec![0.4, 0.2],
                ..none.clone()
            },
        ),
        (
            "ARMAX",
            Polynomials {
                a: vec![-0.8],
                inputs: vec![transfer(1, &[0.5, 0.2], &[]), transfer(0, &[-0.3], &[])],
                c: vec![-0.4],
                ..none.clone()
            },
        ),
        (
            "output error",
            Polynomials {
                inputs: vec![
                    transfer(1, &[0.5, 0.2], &[-1.2, 0.5]),
                    transfer(0, &[0.7], &[-0.6]),
                ],
                ..none.clone()
            },
        ),
        (
            "Box–Jenkins",
            Polynomials {
                inputs: vec![transfer(1, &[0.5], &[-0.8])],
                c: vec![0.6],
                d: vec![-0.7],
                ..none.clone()
            },
        ),
        (
            "ARIMAX",
            Polynomials {
                a: vec![-0.5],
                inputs: vec![transfer(1, &[0.8], &[])],
                c: vec![-0.3],
                differences: 1,
                level: 0.0,
                ..none
            },
        ),
    ]
}

#[test]
fn derivatives_are_those_of_the_residuals() {
    for (name, model) in models() {
        let samples = simulated(&model, 90, 0.3, 7);
        let moved: Vec<f64> = model.flat().iter().map(|at| 0.9 * at + 0.01).collect();
        let at = model.with(&moved);
        let counted = Counted::from(0);
        let left = Left::by(&at, &samples, &counted);
        let starts: Vec<Vec<f64>> = left.starts.iter().map(|of| of.values.clone()).collect();
        let all = |model: &Polynomials, starts: &[Vec<f64>]| {
            let mut all = Vec::new();
            for (segment, start) in samples.segments().zip(starts) {
                let segment = Segment::new(model, &samples, segment, &counted);
                let mut row = 0;
                segment.derivatives(start, |residual, by| {
                    let mut by_start = Mat::zeros(1, start.len());
                    if row < left.free(0).lasting(usize::MAX) {
                        left.free(0).add_products(row, &[1.0], &mut by_start);
                    }
                    let by_start = (0..start.len()).map(|nth| by_start[(0, nth)]);
                    all.push((
                        residual,
                        by.iter().copied().chain(by_start).collect::<Vec<_>>(),
                    ));
                    row += 1;
                });
            }
            all
        };
        let here = all(&at, &starts);
        for nth in 0..moved.len() + at.starts() {
            let step = 1e-6;
            let beside = |by: f64| {
                let (mut flat, mut starts) = (moved.clone(), starts.clone());
                match nth.checked_sub(flat.len()) {
                    Some(of_start) => starts.iter_mut().for_each(|start| start[of_start] += by),
                    None => flat[nth] += by,
                }
                all(&at.with(&flat), &starts)
            };
            let (above, below) = (beside(step), beside(-step));
            for (sample, (_, derivatives)) in here.iter().enumerate() {
                let found = (above[sample].0 - below[sample].0) / (2.0 * step);
                assert!(
                    (found - derivatives[nth]).abs() < 1e-6 * (1.0 + found.abs()),
                    "{name}, coefficient {nth}, sample {sample}: {found}, not {}",
                    derivatives[nth]
                );
            }
        }
    }
}

#[test]
fn a_stepper_errs_by_the_residuals() {
    for (name, model) in models() {
        let samples = simulated(&model, 90, 0.3, 3);
        let found = Left::by(&model, &samples, &Counted::from(0))
            .residuals
            .concat();
        // What the noise was before the first sample is not known; it is forgotten.
        let last: f64 = found[found.len() - 1];
        let segment = samples.segments().last().unwrap();
        let inputs: Vec<Vec<f64>> = (0..samples.width())
            .map(|nth| samples.input(segment.clone(), nth))
            .collect();
        let mut stepper = Stepper::new(model.clone());
        stepper.rest(|nth| inputs[nth][0]);
        let mut error = f64::NAN;
        for (sample, &value) in samples.values(segment).iter().enumerate() {
            error = value - stepper.step(|nth| inputs[nth][sample], Some(value));
        }
        assert!((error - last).abs() < 1e-6, "{name}: {error}, not {last}");
    }
}

#[test]
fn every_kind_is_found_again() {
    for (name, model) in models() {
        let samples = simulated(&model, 6000, 0.2, 11);
        let fit = PredictionError::default()
            .fit(&orders(&model), &samples, 0)
            .unwrap();
        assert!(fit.converged, "{name}: {} steps", fit.steps);
        for (found, expected) in fit.model.flat().iter().zip(model.flat()) {
            assert!(
                (found - expected).abs() < 0.06,
                "{name}: {:?}, not {:?}",
                fit.model.flat(),
                model.flat()
            );
        }
        // The spread of numbers that are even between −1 and 1.
        let expected = 0.2 * 0.2 / 3.0;
        assert!((fit.variance() / expected - 1.0).abs() < 0.06, "{name}");
    }
}

/// The same samples from a later one on, in segments of so many, with one between them missing.
fn cut(samples: &Samples, from: usize, length: usize) -> Samples {
    let mut cut = Samples::new(samples.width());
    for segment in samples.segments() {
        let inputs: Vec<Vec<f64>> = (0..samples.width())
            .map(|nth| samples.input(segment.clone(), nth))
            .collect();
        cut.segment();
        for (sample, &value) in samples.values(segment).iter().enumerate().skip(from) {
            if (sample - from) % (length + 1) == length {
                cut.segment();
            } else {
                cut.push(inputs.iter().map(|input| input[sample]), value);
            }
        }
    }
    cut
}

#[test]
fn filters_are_found_in_records_that_begin_while_they_ring_and_are_cut() {
    for (name, model) in models().into_iter().skip(3).take(2) {
        let samples = simulated(&model, 6000, 0.2, 11);
        for length in [usize::MAX, 900, 20] {
            let samples = cut(&samples, 100, length.min(samples.count()));
            let search = PredictionError {
                start_spread: 10.0,
                ..PredictionError::default()
            };
            let fit = search.fit(&orders(&model), &samples, 0).unwrap();
            let errors = search.standard_errors(&fit, &samples).unwrap().flat();
            let found = fit.model.flat();
            for ((found, expected), error) in found.iter().zip(model.flat()).zip(errors) {
                assert!(
                    (found - expected).abs() < 3.5 * error && error < 0.1,
                    "{name}, {length}: {found} ± {error}, not {expected}"
                );
            }
            let expected = 0.2 * 0.2 / 3.0;
            assert!((fit.variance() / expected - 1.0).abs() < 0.08, "{name}");
        }
    }
}

#[test]
fn filters_without_noise_are_found_exactly() {
    for (name, model) in models().into_iter().skip(3).take(1) {
        let samples = cut(&simulated(&model, 600, 0.0, 5), 50, 200);
        let fit = PredictionError::default()
            .fit(&orders(&model), &samples, 0)
            .unwrap();
        for (found, expected) in fit.model.flat().iter().zip(model.flat()) {
            assert!((found - expected).abs() < 1e-6, "{name}: {fit:?}");
        }
    }
}

#[test]
fn a_filter_at_the_edge_of_stability_leaves_the_others_their_best() {
    // What the second input brings about grows without end, which no stable filter does.
    let grows = Polynomials {
        a: vec![],
        inputs: vec![transfer(0, &[0.8], &[-0.7]), transfer(0, &[2.0], &[1.0005])],
        c: vec![],
        d: vec![],
        differences: 0,
        level: 2.0,
    };
    let (mut u, mut e) = (noise(3), noise(4));
    let (mut samples, mut stepper) = (Samples::new(2), Stepper::new(grows.clone()));
    for nth in 0..400 {
        let input = [u(), f64::from(u8::from(nth == 100))];
        let expected = stepper.clone().step(|i| input[i], None);
        let value = expected + 0.3 * e();
        stepper.step(|i| input[i], Some(value));
        samples.push(input, value);
    }
    // Near the edge nothing but that tells what both filters began with, and their sum, from each other.
    let search = PredictionError {
        start_spread: 10.0,
        ..PredictionError::default()
    };
    let fit = search.fit(&orders(&grows), &samples, 0).unwrap();
    let edge = fit.model.inputs[1].f[0];
    assert!(fit.converged && (0.99..1.0).contains(&edge), "{fit:?}");
    let errors = search.standard_errors(&fit, &samples);
    // The second filter ends there; what it is multiplied by does not, nor does anything else.
    let errors = errors.unwrap();
    assert!(errors.level.is_finite());
    assert_eq!([errors.inputs[0].f.len(), errors.inputs[1].f.len()], [1, 0]);
    let known = errors
        .inputs
        .iter()
        .flat_map(|input| input.b.iter().chain(&input.f));
    assert!(
        known.into_iter().all(|error| error.is_finite()),
        "{errors:?}"
    );
    let at = fit.model.flat();
    let counted = Counted {
        first: fit.first,
        measured: fit.measured,
        starts: fit.start_counts.clone(),
    };
    let least = search.judged(fit.model.clone(), &samples, &counted).sum;
    let mut compared = 0;
    for (nth, by) in (0..at.len()).flat_map(|nth| [(nth, 1e-3), (nth, -1e-3)]) {
        let mut moved = at.clone();
        moved[nth] += by;
        let moved = fit.model.with(&moved);
        if !moved.unstable(remembered(&samples)).contains(&true) {
            let sum = search.judged(moved, &samples, &counted).sum;
            assert!(sum > least, "{nth} by {by}: {fit:?}");
            compared += 1;
        }
    }
    assert!(compared >= at.len());
}

#[test]
fn fewer_samples_than_coefficients_are_refused_and_constant_ones_are_not() {
    let (_, armax) = models().swap_remove(2);
    let search = PredictionError::default();
    let few = simulated(&armax, 9, 0.2, 1);
    assert!(search.fit(&orders(&armax), &few, 0).is_err());
    let mut constant = Samples::new(2);
    for _ in 0..100 {
        constant.push([1.0, 1.0], 5.0);
    }
    for (name, model) in models() {
        let orders = orders(&model);
        let mut samples = Samples::new(orders.inputs.len());
        (0..100).for_each(|_| samples.push(orders.inputs.iter().map(|_| 1.0), 5.0));
        let fit = search.fit(&orders, &samples, 0).unwrap();
        assert!(fit.residual_sum_of_squares < 1e-12, "{name}");
        let mut stepper = Stepper::new(fit.model);
        stepper.rest(|_| 1.0);
        stepper.settle(5.0, f64::INFINITY);
        let ahead: Vec<f64> = (0..50).map(|_| stepper.step(|_| 1.0, None)).collect();
        assert!(
            ahead.iter().all(|y| (y - 5.0).abs() < 1e-6),
            "{name}: {ahead:?}"
        );
    }
}

#[test]
fn predictions_further_ahead_are_less_sure_and_in_the_end_as_sure_as_none() {
    let model = Polynomials {
        a: vec![-0.8],
        inputs: vec![],
        c: vec![],
        d: vec![],
        differences: 0,
        level: 10.0,
    };
    let variances = model.variances(200);
    assert_eq!(variances[0], 1.0);
    assert!((variances[1] - (1.0 + 0.64)).abs() < 1e-12);
    assert!((variances[199] - 1.0 / (1.0 - 0.64)).abs() < 1e-9);
}

#[test]
fn what_a_short_record_cannot_tell_from_a_unit_root_is_not_told_as_one() {
    // Differences of noise: its moving average has a root on the unit circle.
    let mut samples = Samples::new(0);
    let mut noise = noise(9);
    for _ in 0..40 {
        samples.segment();
        let mut before = 0.0;
        for _ in 0..20 {
            let now = noise();
            samples.push([], now - before);
            before = now;
        }
    }
    let fit = PredictionError::default()
        .fit(&asked(0, None, 1, 0, 0), &samples, 0)
        .unwrap();
    assert!((-0.95..-0.94).contains(&fit.model.c[0]), "{fit:?}");
    let errors = PredictionError::default().standard_errors(&fit, &samples);
    assert_eq!(errors.map(|errors| errors.c), Some(vec![]));
}

/// What `generate.py` wrote.
struct Oracle {
    expected: serde_json::Value,
    samples: Vec<Vec<f64>>,
    names: Vec<String>,
}

impl Oracle {
    fn read() -> Self {
        let table = crate::oracle::own_table("prediction_error/samples.csv");
        let expected = crate::oracle::own_text("prediction_error/expected.json");
        Self {
            expected: serde_json::from_str(&expected).unwrap(),
            samples: table.numbers(),
            names: table.header,
        }
    }

    fn samples(&self, name: &str, orders: &Orders) -> Samples {
        let column = self.names.iter().position(|other| other == name).unwrap();
        let mut samples = Samples::new(orders.inputs.len());
        for row in &self.samples {
            samples.push(orders.inputs.iter().map(|_| row[0]), row[column]);
        }
        samples
    }

    fn fit(&self, name: &str, orders: &Orders) -> PredictionErrorFit {
        let samples = self.samples(name, orders);
        PredictionError::default().fit(orders, &samples, 0).unwrap()
    }

    fn numbers(&self, name: &str, by: &str, what: &str) -> Vec<f64> {
        let found = self.expected[name][by][what].as_array().unwrap();
        found
            .iter()
            .map(|number| number.as_f64().unwrap())
            .collect()
    }
}

fn asked(
    na: usize,
    input: Option<(usize, usize)>,
    nc: usize,
    nd: usize,
    differences: usize,
) -> Orders {
    let input = input.map(|(nb, nf)| InputOrders { nb, nk: 1, nf });
    Orders {
        na,
        inputs: input.into_iter().collect(),
        nc,
        nd,
        differences,
    }
}

/// Every kind of the oracle.
fn of_oracle() -> [(&'static str, Orders); 6] {
    [
        ("arma", asked(2, None, 1, 0, 0)),
        ("armax", asked(2, Some((2, 0)), 1, 0, 0)),
        ("oe", asked(0, Some((2, 2)), 0, 0, 0)),
        ("bj", asked(0, Some((2, 1)), 1, 1, 0)),
        ("arima", asked(1, None, 1, 0, 1)),
        ("arimax", asked(1, Some((2, 0)), 1, 0, 1)),
    ]
}

#[test]
fn coefficients_equal_the_oracle_of_scipy() {
    let oracle = Oracle::read();
    for (name, orders) in of_oracle() {
        let fit = oracle.fit(name, &orders);
        let expected = &oracle.expected[name]["scipy"];
        assert_eq!(
            fit.rows as u64,
            expected["rows"].as_u64().unwrap(),
            "{name}"
        );
        let sum = expected["sum_of_squares"].as_f64().unwrap();
        let off = fit.residual_sum_of_squares / sum - 1.0;
        assert!(off.abs() < 1e-9, "{name}: {off:e}");
        let expected = oracle.numbers(name, "scipy", "coefficients");
        for (found, expected) in fit.model.flat().iter().zip(&expected) {
            assert!(
                (found - expected).abs() < 2e-5,
                "{name}: {found}, not {expected}"
            );
        }
    }
}

#[test]
fn standard_errors_equal_the_oracle_of_scipy() {
    let oracle = Oracle::read();
    for (name, orders) in of_oracle() {
        let samples = oracle.samples(name, &orders);
        let fit = oracle.fit(name, &orders);
        let found = PredictionError::default().standard_errors(&fit, &samples);
        let found = found.unwrap().flat();
        let expected = oracle.numbers(name, "scipy", "errors");
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(&expected) {
            assert!(
                (found / expected - 1.0).abs() < 2e-3,
                "{name}: {found}, not {expected}"
            );
        }
    }
}

#[test]
fn coefficients_are_near_the_oracle_of_the_exact_likelihood() {
    let oracle = Oracle::read();
    for (name, orders) in [&of_oracle()[0], &of_oracle()[4], &of_oracle()[5]] {
        let fit = oracle.fit(name, orders);
        let expected = oracle.numbers(name, "statsmodels", "coefficients");
        let errors = oracle.numbers(name, "statsmodels", "errors");
        let found = fit.model.flat();
        for ((found, expected), error) in found.iter().zip(&expected).zip(&errors) {
            // It also counts the first samples, of which ours only makes a start.
            assert!(
                (found - expected).abs() < 0.1 * error,
                "{name}: {found}, not {expected}"
            );
        }
        let variance = oracle.expected[*name]["statsmodels"]["variance"]
            .as_f64()
            .unwrap();
        assert!((fit.variance() / variance - 1.0).abs() < 0.01, "{name}");
    }
}

#[test]
fn a_moving_average_that_is_longer_than_the_first_regression_is_searched() {
    let (_, model) = models().swap_remove(0);
    let samples = simulated(&model, 600, 1.0, 3);
    let orders = Orders {
        nc: 45,
        ..orders(&model)
    };
    let search = PredictionError {
        most_steps: 1,
        ..PredictionError::default()
    };
    let fit = search.fit(&orders, &samples, 0).unwrap();
    assert!(fit.residual_sum_of_squares.is_finite());
}

#[test]
fn transfer_functions_are_near_the_oracle_of_another_search() {
    let oracle = Oracle::read();
    for (name, orders) in &of_oracle()[1..4] {
        let model = oracle.fit(name, orders).model;
        let of = |which: &str, part: usize| -> Vec<f64> {
            let polynomials = &oracle.expected[*name]["sippy"][which][part];
            let found = polynomials.as_array().unwrap().iter();
            found.map(|number| number.as_f64().unwrap()).collect()
        };
        let near = |found: &[f64], expected: &[f64]| {
            for (found, expected) in found.iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 5e-3,
                    "{name}: {found}, not {expected}"
                );
            }
        };
        near(&model.inputs[0].b, &of("G", 0));
        let denominator = [&model.a[..], &model.inputs[0].f].concat();
        near(&denominator, &of("G", 1)[1..]);
        near(&model.c, of("H", 0).get(1..).unwrap_or_default());
        near(
            &model.d,
            of("H", 1)
                .get(1..)
                .filter(|_| model.a.is_empty())
                .unwrap_or_default(),
        );
    }
}
