//! What a fit makes of values that are missing.

use super::super::tests::{models, orders, simulated};
use super::super::{InputOrders, Orders, PredictionError, Stepper};
use super::*;
use crate::draws::uniform;

/// The same samples with about such a share of the values of each segment missing, its first ones aside, and twelve in a row.
fn with_missing(samples: &Samples, share: f64) -> Samples {
    let (mut with_missing, mut draw) = (Samples::new(samples.width()), uniform(3));
    for segment in samples.segments() {
        with_missing.segment();
        let inputs: Vec<Vec<f64>> = (0..samples.width())
            .map(|nth| samples.input(segment.clone(), nth))
            .collect();
        for (sample, &value) in samples.values(segment).iter().enumerate() {
            let inputs = inputs.iter().map(|input| input[sample]);
            // Draws are even between −1 and 1.
            let gone = draw() < 2.0 * share - 1.0;
            if sample >= 8 && (gone || (20..32).contains(&sample)) {
                with_missing.push_missing(inputs);
            } else {
                with_missing.push(inputs, value);
            }
        }
    }
    with_missing
}

#[test]
fn where_nothing_is_missing_errors_and_their_slopes_are_residuals_and_their_derivatives() {
    for (name, model) in models() {
        let samples = simulated(&model, 90, 0.3, 7);
        let counted = Counted::from(0);
        let start = vec![0.3; model.starts()];
        for range in samples.segments() {
            let gapped = Gapped::new(&model, &samples, range.clone(), &counted);
            let slopes = gapped.slopes(&start);
            let mut row = 0;
            let segment = Segment::new(&model, &samples, range, &counted);
            segment.derivatives(&start, |residual, by| {
                assert!(
                    (slopes.errors[row].scaled - residual).abs() < 1e-9,
                    "{name}"
                );
                assert_eq!(slopes.errors[row].log_variance, 0.0);
                for (nth, expected) in by.iter().enumerate() {
                    let found = slopes.scaled[(row, nth)];
                    let near = (found - expected).abs() < 1e-6 * (1.0 + expected.abs());
                    assert!(near, "{name}, {nth}: {found}, not {expected}");
                }
                row += 1;
            });
            assert_eq!(row, slopes.errors.len());
        }
    }
}

#[test]
fn where_values_are_missing_a_stepper_errs_by_as_much() {
    for (name, model) in models() {
        let samples = with_missing(&simulated(&model, 150, 0.3, 3), 0.2);
        let counted = Counted::from(0);
        let range = samples.segments().last().unwrap();
        let gapped = Gapped::new(&model, &samples, range.clone(), &counted);
        let errors = gapped.errors(&vec![0.0; model.starts()]);
        let inputs: Vec<Vec<f64>> = (0..samples.width())
            .map(|nth| samples.input(range.clone(), nth))
            .collect();
        let mut stepper = Stepper::new(model.clone());
        stepper.rest(|nth| inputs[nth][0]);
        let mut last = None;
        for (sample, &value) in samples.values(range).iter().enumerate() {
            let known = (!value.is_nan()).then_some(value);
            let mut room = vec![0.0; stepper.remembers()];
            let variance = 1.0 + stepper.doubt(1, &mut room);
            let off = value - stepper.step(|nth| inputs[nth][sample], known);
            last = known
                .map(|_| (off / variance.sqrt(), variance.ln()))
                .or(last);
        }
        // What the noise was before the first sample is not known; it is forgotten.
        let (scaled, log_variance) = last.unwrap();
        let found = errors.last().unwrap();
        assert!((found.scaled - scaled).abs() < 1e-6, "{name}");
        assert!((found.log_variance - log_variance).abs() < 1e-6, "{name}");
    }
}

#[test]
fn what_is_made_least_changes_as_its_gradient_says() {
    for (name, model) in models() {
        let samples = with_missing(&simulated(&model, 240, 0.3, 7), 0.2);
        let moved: Vec<f64> = model.flat().iter().map(|at| 0.9 * at + 0.01).collect();
        let counted = Counted {
            measured: 2,
            starts: vec![0.2; model.starts()],
            ..Counted::from(5)
        };
        let search = PredictionError {
            penalty: 0.5,
            ..PredictionError::default()
        };
        let judged = |flat: &[f64]| search.judged(model.with(flat), &samples, &counted);
        let (_, gradient) = search.normal_equations(&judged(&moved), &samples, &counted);
        for (nth, slope) in gradient.iter().enumerate() {
            let beside = |by: f64| {
                let mut flat = moved.clone();
                flat[nth] += by;
                judged(&flat).sum
            };
            let expected = (beside(1e-5) - beside(-1e-5)) / 4e-5;
            let near = (slope - expected).abs() < 1e-5 * (1.0 + expected.abs());
            assert!(near, "{name}, {nth}: {slope}, not {expected}");
        }
    }
}

#[test]
fn every_kind_is_found_again_where_three_in_ten_values_are_missing() {
    for (name, model) in models() {
        let samples = with_missing(&simulated(&model, 6000, 0.2, 11), 0.3);
        let search = PredictionError::default();
        let fit = search.fit(&orders(&model), &samples, 0).unwrap();
        assert!(fit.converged, "{name}: {} steps", fit.steps);
        let errors = search.standard_errors(&fit, &samples).unwrap().flat();
        let found = fit.model.flat();
        for ((found, expected), error) in found.iter().zip(model.flat()).zip(errors) {
            let off = (found - expected).abs();
            assert!(
                off < 3.5 * error && error < 0.1,
                "{name}: {found} ± {error}, not {expected}"
            );
        }
        // The spread of numbers that are even between −1 and 1.
        let expected = 0.2 * 0.2 / 3.0;
        assert!((fit.variance() / expected - 1.0).abs() < 0.06, "{name}");
        // Right after a gap predictions err more than by an innovation.
        let follows = model.follows();
        assert_eq!(fit.variance_ratio > 1.0, follows, "{name}");
        let mean = fit.squared_errors / fit.rows as f64;
        assert_eq!(
            mean > 1.05 * expected,
            follows,
            "{name}: {mean}, not {expected}"
        );
    }
}

#[test]
fn coefficients_and_their_errors_are_near_the_oracle_of_the_exact_likelihood() {
    let table = crate::oracle::own_table("missing_fit/samples.csv");
    let expected = crate::oracle::own_text("missing_fit/expected.json");
    let expected: serde_json::Value = serde_json::from_str(&expected).unwrap();
    let input = |nb, nk, nf| InputOrders { nb, nk, nf };
    let of = |na, inputs: &[InputOrders], nc, nd, differences| Orders {
        na,
        inputs: inputs.to_vec(),
        nc,
        nd,
        differences,
    };
    for (name, orders) in [
        ("oe", of(0, &[input(1, 0, 1); 2], 0, 0, 0)),
        ("bj", of(0, &[input(1, 1, 1)], 1, 1, 0)),
        ("arma", of(2, &[], 1, 0, 0)),
        ("armax", of(2, &[input(1, 1, 0)], 1, 0, 0)),
        ("arimax", of(1, &[input(1, 0, 0)], 1, 0, 1)),
    ] {
        let column = table.header.iter().position(|of| of == name).unwrap();
        let mut samples = Samples::new(orders.inputs.len());
        for row in table.numbers() {
            let inputs = row[..orders.inputs.len()].iter().copied();
            if row[column].is_nan() {
                samples.push_missing(inputs);
            } else {
                samples.push(inputs, row[column]);
            }
        }
        assert!(samples.missing() > 150, "{name}");
        let search = PredictionError::default();
        let fit = search.fit(&orders, &samples, 0).unwrap();
        let own = search.standard_errors(&fit, &samples).unwrap().flat();
        let numbers = |which: &str| -> Vec<f64> {
            let all = expected[name][which].as_array().unwrap().iter();
            all.map(|number| number.as_f64().unwrap()).collect()
        };
        let level = usize::from(orders.has_level());
        let errors = numbers("errors");
        let found = fit.model.flat();
        let found = found.iter().zip(&own).skip(level);
        for (((found, own), expected), error) in found.zip(numbers("coefficients")).zip(errors) {
            // It also counts the first samples, of which ours only makes a start, and takes filters to begin at rest.
            let near = (found - expected).abs() < 0.2 * error;
            assert!(near, "{name}: {found}, not {expected} ± {error}");
            assert!(
                (own / error - 1.0).abs() < 0.15,
                "{name}: ± {own}, not {error}"
            );
        }
        let deviation = expected[name]["deviation"].as_f64().unwrap();
        assert!(
            (fit.variance().sqrt() / deviation - 1.0).abs() < 0.01,
            "{name}"
        );
    }
}
