//! The identification against `sippy_unipi`, and models that are known.

use super::{Record, StateOrder, Subspace, Weighting};
use crate::{NumericsError, draws, oracle};

const PLAIN: Subspace = Subspace {
    horizon: 8,
    weighting: Weighting::N4sid,
    order: StateOrder::Given(3),
    alike: 1,
    feedthrough: true,
    refined: false,
};

/// The columns of a table on a scale of 1: inputs sample by sample and the output, and the scales.
fn scaled() -> (Vec<f64>, Vec<f64>, [f64; 3]) {
    let rows = oracle::own_table("state_space/record.csv").numbers();
    let count = rows.len() as f64;
    let scales = [0, 1, 2].map(|j| {
        let mean = rows.iter().map(|row| row[j]).sum::<f64>() / count;
        let squares: f64 = rows.iter().map(|row| (row[j] - mean).powi(2)).sum();
        (squares / count).sqrt()
    });
    let inputs = rows
        .iter()
        .flat_map(|row| [row[0] / scales[0], row[1] / scales[1]])
        .collect();
    (
        inputs,
        rows.iter().map(|row| row[2] / scales[2]).collect(),
        scales,
    )
}

fn numbers(value: &serde_json::Value) -> Vec<f64> {
    let values = value.as_array().unwrap().iter();
    values.map(|value| value.as_f64().unwrap()).collect()
}

#[track_caller]
fn near(found: f64, expected: f64, within: f64) {
    assert!(
        (found - expected).abs() <= within,
        "{found} instead of {expected}"
    );
}

#[test]
fn responses_gains_and_singular_values_are_those_of_the_own_oracle() {
    let (inputs, outputs, scales) = scaled();
    let record = Record {
        inputs: &inputs,
        outputs: &outputs,
    };
    let text = oracle::own_text("state_space/expected.json");
    let expected: serde_json::Value = serde_json::from_str(&text).unwrap();
    for (weighting, name) in [
        (Weighting::N4sid, "N4SID"),
        (Weighting::Moesp, "MOESP"),
        (Weighting::Cva, "CVA"),
    ] {
        let expected = &expected["by"][name];
        let how = Subspace { weighting, ..PLAIN };
        let found = how.identify(&[record], 2).unwrap();
        assert!(!found.stabilised);
        for (value, theirs) in found
            .singular_values
            .iter()
            .zip(numbers(&expected["singular"]))
        {
            near(*value, theirs, 1e-7);
        }
        for (input, direct) in numbers(&expected["direct"]).into_iter().enumerate() {
            let response = found.model.impulse_response(Some(input), 12);
            let scale = scales[2] / scales[input];
            near(response[0] * scale, direct, 1e-7);
            let theirs = numbers(&expected["response"][input.to_string()]);
            for (value, theirs) in response[1..].iter().zip(theirs) {
                near(value * scale, theirs, 1e-7);
            }
        }
        let response = found.model.impulse_response(None, 12);
        let theirs = numbers(&expected["response"]["noise"]);
        for (value, theirs) in response[1..].iter().zip(theirs) {
            near(*value, theirs, 1e-6);
        }
    }
}

#[test]
fn the_difference_equation_forecasts_what_the_states_do() {
    let (inputs, outputs, _) = scaled();
    let record = Record {
        inputs: &inputs,
        outputs: &outputs,
    };
    let how = Subspace {
        weighting: Weighting::Cva,
        refined: true,
        ..PLAIN
    };
    let model = how.identify(&[record], 2).unwrap().model;
    let by_states = model.one_step(&record, &[0.0; 3]);
    let equation = model.difference_equation();
    assert_eq!(
        (equation.a.len(), equation.b.len(), equation.c.len()),
        (3, 2, 3)
    );
    let mut innovations = vec![0.0; outputs.len()];
    let mut largest = 0.0_f64;
    for t in 0..outputs.len() {
        let mut expected = 0.0;
        for i in 0..3 {
            if let Some(before) = t.checked_sub(i + 1) {
                expected += equation.c[i] * innovations[before] - equation.a[i] * outputs[before];
            }
        }
        for (j, b) in equation.b.iter().enumerate() {
            for (i, b) in b.iter().enumerate().take(t + 1) {
                expected += b * inputs[(t - i) * 2 + j];
            }
        }
        innovations[t] = outputs[t] - expected;
        largest = largest.max((expected - by_states[t]).abs());
    }
    assert!(largest < 1e-9, "{largest}");
}

#[test]
fn found_anew_the_inputs_tell_more_of_one_step() {
    let (inputs, outputs, _) = scaled();
    let record = Record {
        inputs: &inputs,
        outputs: &outputs,
    };
    let plain = PLAIN.identify(&[record], 2).unwrap();
    let refined = Subspace {
        refined: true,
        ..PLAIN
    };
    let refined = refined.identify(&[record], 2).unwrap();
    assert!(
        refined.errors.0 < plain.errors.0,
        "{:?} {:?}",
        refined.errors,
        plain.errors
    );
    assert_eq!(refined.errors.1, outputs.len() - 8);
}

#[test]
fn three_states_are_told_by_a_threshold_and_none_is_more_than_is_there() {
    let (inputs, outputs, _) = scaled();
    let record = Record {
        inputs: &inputs,
        outputs: &outputs,
    };
    let order = |order| {
        let how = Subspace {
            weighting: Weighting::Cva,
            order,
            ..PLAIN
        };
        how.identify(&[record], 2).unwrap().model.order()
    };
    assert!((2..=3).contains(&order(StateOrder::Threshold(0.3))));
    assert!((1..=4).contains(&order(StateOrder::LargestGap)));
    assert_eq!(order(StateOrder::Threshold(0.999)), 1);
}

#[test]
fn of_little_that_is_independent_one_state_is_told() {
    let (inputs, outputs, _) = scaled();
    let record = Record {
        inputs: &inputs,
        outputs: &outputs,
    };
    let order = |alike| {
        let how = Subspace {
            weighting: Weighting::Cva,
            order: StateOrder::Threshold(0.01),
            alike,
            ..PLAIN
        };
        how.identify(&[record], 2).unwrap().model.order()
    };
    assert!((2..=3).contains(&order(1)), "{}", order(1));
    assert_eq!(order(40), 1);
}

#[test]
fn records_are_not_joined_where_one_ends() {
    let (inputs, outputs, _) = scaled();
    let half = outputs.len() / 2;
    let parts = [
        Record {
            inputs: &inputs[..2 * half],
            outputs: &outputs[..half],
        },
        Record {
            inputs: &inputs[2 * half..],
            outputs: &outputs[half..],
        },
    ];
    let refined = Subspace {
        refined: true,
        ..PLAIN
    };
    let forth = refined
        .identify(&parts, 2)
        .unwrap()
        .model
        .impulse_response(Some(0), 5);
    let back = refined.identify(&[parts[1], parts[0]], 2).unwrap().model;
    for (a, b) in forth.iter().zip(back.impulse_response(Some(0), 5)) {
        near(*a, b, 1e-9);
    }
}

#[test]
fn without_inputs_the_output_is_told_from_itself() {
    let (_, outputs, _) = scaled();
    let record = Record {
        inputs: &[],
        outputs: &outputs,
    };
    let how = Subspace {
        refined: true,
        order: StateOrder::Given(1),
        ..PLAIN
    };
    let found = how.identify(&[record], 0).unwrap();
    let mean_square = found.errors.0 / found.errors.1 as f64;
    assert!(mean_square < 0.95, "{mean_square}");
}

#[test]
fn errors_are_those_of_forecasts_and_not_of_where_short_records_begin() {
    let (mut draw, deviation) = (draws::normal(5), 0.1);
    let (mut inputs, mut outputs, mut state) = (Vec::new(), Vec::new(), 0.0);
    for _ in 0..3000 {
        let (input, innovation) = (draw(), deviation * draw());
        inputs.push(input);
        outputs.push(state + innovation);
        state = 0.95 * state + 0.3 * input + 0.05 * innovation;
    }
    let parts = inputs.chunks(20).zip(outputs.chunks(20));
    let records: Vec<Record<'_>> = parts
        .map(|(inputs, outputs)| Record { inputs, outputs })
        .collect();
    for refined in [false, true] {
        let how = Subspace {
            refined,
            order: StateOrder::Given(1),
            ..PLAIN
        };
        let found = how.identify(&records, 1).unwrap();
        let mean_square = found.errors.0 / found.errors.1 as f64;
        near(mean_square.sqrt(), deviation, 0.1 * deviation);
    }
}

#[test]
fn of_records_as_long_as_a_window_a_shorter_horizon_is_taken_and_the_longer_one_refused() {
    let (mut draw, mut state) = (draws::normal(8), 0.0);
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    for _ in 0..1200 {
        let input = draw();
        inputs.push(input);
        outputs.push(state + 0.1 * draw());
        state = 0.8 * state + 0.5 * input;
    }
    let parts = inputs.chunks(12).zip(outputs.chunks(12));
    let records: Vec<Record<'_>> = parts
        .map(|(inputs, outputs)| Record { inputs, outputs })
        .collect();
    let of = |horizon: usize| Subspace {
        horizon,
        order: StateOrder::Given(1),
        ..PLAIN
    };
    let refused = of(6).identify(&records, 1).unwrap_err();
    let needed = NumericsError::TooFewStretches {
        length: 13,
        needed: 24,
        found: 0,
    };
    assert_eq!(refused, needed);
    assert_eq!(Subspace::longest(2..=10, &records, 1), Some(5));
    let found = of(5).identify(&records, 1).unwrap();
    near(found.model.a[(0, 0)], 0.8, 0.05);
}

#[test]
fn wrong_requests_are_refused() {
    let (inputs, outputs, _) = scaled();
    let record = Record {
        inputs: &inputs,
        outputs: &outputs,
    };
    let short = Record {
        inputs: &inputs[..40],
        outputs: &outputs[..20],
    };
    // A record of 20 rows has one less than 20 of 2 rows, and so on.
    let length = 2 * PLAIN.horizon + 1;
    let whole = PLAIN.identify(&[short], 2);
    let found = 21 - length;
    assert!(
        matches!(whole, Err(NumericsError::TooFewStretches { length: l, needed, found: f })
            if l == length && f == found && needed > found),
        "{whole:?}"
    );
    for how in [
        Subspace {
            horizon: 1,
            ..PLAIN
        },
        Subspace {
            order: StateOrder::Given(9),
            ..PLAIN
        },
        Subspace {
            order: StateOrder::Given(0),
            ..PLAIN
        },
        Subspace {
            order: StateOrder::Threshold(f64::NAN),
            ..PLAIN
        },
    ] {
        assert!(matches!(
            how.identify(&[record], 2),
            Err(NumericsError::Parameter { .. })
        ));
    }
    let still = vec![0.0; outputs.len()];
    let still = Record {
        inputs: &inputs,
        outputs: &still,
    };
    let still = PLAIN.identify(&[still], 2).unwrap_err();
    assert_eq!(still, NumericsError::NoStates);
}

/// A record whose first input is the last output, as far as so much noise lets it be, its second the mean of the last two.
fn fed_back(noise: f64) -> (Vec<f64>, Vec<f64>) {
    let (driven, _, _) = scaled();
    let mut outputs = vec![0.0, 0.0];
    let mut inputs = vec![0.0; 4];
    for random in driven.chunks_exact(2) {
        let (last, before) = (outputs[outputs.len() - 1], outputs[outputs.len() - 2]);
        outputs.push(0.3 * last + random[1]);
        inputs.extend([last + noise * random[0], (last + before) / 2.0]);
    }
    (inputs, outputs)
}

#[test]
fn canonical_correlations_are_1_at_most_where_an_input_is_the_last_output() {
    for noise in [0.0, 1e-9, 1e-7, 1e-5, 1e-3] {
        let (inputs, outputs) = fed_back(noise);
        let record = Record {
            inputs: &inputs,
            outputs: &outputs,
        };
        let how = Subspace {
            weighting: Weighting::Cva,
            order: StateOrder::Threshold(0.25),
            refined: true,
            ..PLAIN
        };
        let found = how.identify(&[record], 2).unwrap();
        let values = found.singular_values;
        assert!(values[0] < 1.0 + 1e-4, "{noise}: {values:?}");
    }
}

/// So many samples of `y(t) = (q⁻¹ + 0.5 q⁻²)/A u(t) + (1 + 0.6 q⁻¹)/A e(t)`, `A = 1 − 1.5 q⁻¹ + 0.54 q⁻²`, with `e` of
/// variance 0.25; the sum of the squares of `e` after the first `skipped`.
fn armax(samples: usize, seed: u64, skipped: usize) -> (Vec<f64>, Vec<f64>, f64) {
    let mut normal = draws::normal(seed);
    let (mut u, mut e, mut y) = ([0.0; 2], 0.0, [0.0; 2]);
    let (mut inputs, mut outputs, mut squares) = (Vec::new(), Vec::new(), 0.0);
    for t in 0..samples + 100 {
        let (now, innovation) = (normal(), 0.5 * normal());
        let output = 1.5 * y[0] - 0.54 * y[1] + u[0] + 0.5 * u[1] + innovation + 0.6 * e;
        (u, e, y) = ([now, u[0]], innovation, [output, y[0]]);
        if t >= 100 {
            inputs.push(now);
            outputs.push(output);
        }
        if t >= 100 + skipped {
            squares += innovation * innovation;
        }
    }
    (inputs, outputs, squares)
}

#[test]
fn on_some_hundred_rows_the_gain_is_near_that_of_the_true_model() {
    for weighting in WEIGHTINGS {
        for seed in 0..5 {
            let (inputs, outputs, squares) = armax(400, seed, 10);
            let record = Record {
                inputs: &inputs,
                outputs: &outputs,
            };
            let how = Subspace {
                horizon: 10,
                weighting,
                order: StateOrder::Given(2),
                refined: true,
                ..PLAIN
            };
            let found = how.identify(&[record], 1).unwrap();
            let ratio = (found.errors.0 / squares).sqrt();
            assert!(ratio < 1.05, "{weighting:?} {seed}: {ratio}");
            let c = found.model.difference_equation().c;
            near(c[0], 0.6, 0.15);
            near(c[1], 0.0, 0.15);
        }
    }
}

const WEIGHTINGS: [Weighting; 3] = [Weighting::N4sid, Weighting::Moesp, Weighting::Cva];

#[test]
fn outputs_that_inputs_explain_at_once_have_no_states() {
    let (inputs, _, _) = scaled();
    let outputs: Vec<f64> = inputs.chunks_exact(2).map(|u| u[0] - u[1]).collect();
    let record = Record {
        inputs: &inputs,
        outputs: &outputs,
    };
    for weighting in WEIGHTINGS {
        let how = Subspace { weighting, ..PLAIN };
        let found = how.identify(&[record], 2).unwrap_err();
        assert_eq!(found, NumericsError::NoStates, "{weighting:?}");
    }
}

#[test]
fn without_noise_the_states_are_exact_and_the_gain_is_nothing() {
    let (inputs, _, _) = scaled();
    let mut states = [0.0; 2];
    let mut outputs = Vec::new();
    for u in inputs.chunks_exact(2) {
        outputs.push(states[0] + states[1] + 0.3 * u[0]);
        states = [0.9 * states[0] + u[0], 0.6 * states[1] + u[1] - u[0]];
    }
    let record = Record {
        inputs: &inputs,
        outputs: &outputs,
    };
    for weighting in WEIGHTINGS {
        let how = Subspace {
            weighting,
            order: StateOrder::LargestGap,
            refined: true,
            ..PLAIN
        };
        let found = how.identify(&[record], 2).unwrap();
        assert_eq!(found.model.k, [0.0; 2], "{weighting:?}");
        let equation = found.model.difference_equation();
        near(equation.a[0], -1.5, 1e-6);
        near(equation.a[1], 0.54, 1e-6);
    }
}
