//! Decides how an identified model tells its polynomials, on the scale of the data, and how they come to rest.

use athermal_core::node::{Coefficients, Mistake, Mode, Noise, Of, Term};
use athermal_numerics::Fading;

use super::model::Identified;

/// Standard errors that do not belong to the coefficients.
pub(super) fn mistakes(of: &Identified) -> Vec<Mistake> {
    let (model, Some(errors)) = (&of.model, &of.errors) else {
        return Vec::new();
    };
    let mut mistakes = Vec::new();
    let mut check = |name: &str, of: &[f64], errors: &[f64]| {
        if !errors.is_empty() {
            mistakes.extend(Mistake::of_lengths(of.len(), &[(name, errors.len())]));
        }
    };
    check("errors.a", &model.a, &errors.a);
    check("errors.c", &model.c, &errors.c);
    check("errors.d", &model.d, &errors.d);
    for (input, errors) in model.inputs.iter().zip(&errors.inputs) {
        check("errors.inputs.b", &input.b, &errors.b);
        check("errors.inputs.f", &input.f, &errors.f);
    }
    let inputs = [("errors.inputs", errors.inputs.len())];
    mistakes.extend(Mistake::of_lengths(model.inputs.len(), &inputs));
    mistakes
}

pub(super) fn coefficients(of: &Identified) -> Coefficients {
    let model = &of.model;
    let mut all = Coefficients {
        step: Some(of.step),
        differences: model.differences,
        ..Coefficients::default()
    };
    // Noise that is integrated leaves no level.
    if model.differences == 0 {
        let at_rest = of.at_rest(&vec![0.0; of.regressors.len()]);
        let error = match &of.errors {
            // Where there are inputs, it is of another constant: that at their means.
            Some(errors) if of.regressors.is_empty() && !of.mean_level => errors.level,
            _ => f64::NAN,
        };
        all.terms
            .push(Term::new(Of::Constant, at_rest).within(error));
    }
    let errors = of.errors.as_ref();
    let step_s = of.step.secs();
    let mut tell = |polynomial: char, input: Option<usize>, (values, errors): (&[f64], &[f64])| {
        let (first, scale) = match (polynomial, input) {
            ('B', Some(nth)) => (model.inputs[nth].delay, of.scaling.scales[nth]),
            _ => (1, 1.0),
        };
        for (nth, value) in values.iter().enumerate() {
            let steps = first + nth;
            let of = Of::Power {
                polynomial,
                steps,
                input,
            };
            let error = errors.get(nth).copied().unwrap_or(f64::NAN);
            all.terms
                .push(Term::new(of, value / scale).within(error / scale));
        }
        if matches!(polynomial, 'A' | 'D' | 'F') {
            all.modes
                .extend(Fading::of(values).iter().map(|fading| Mode {
                    of: match input {
                        Some(nth) => format!("{polynomial} {}", of.regressors[nth]),
                        None => polynomial.to_string(),
                    },
                    time_constant_s: fading.time_constant * step_s,
                    period_s: fading.period.map(|period| period * step_s),
                }));
        }
    };
    tell('A', None, (&model.a, errors.map_or(&[], |of| &of.a)));
    for (nth, input) in model.inputs.iter().enumerate() {
        let errors = errors.and_then(|of| of.inputs.get(nth));
        tell('B', Some(nth), (&input.b, errors.map_or(&[], |of| &of.b)));
        tell('F', Some(nth), (&input.f, errors.map_or(&[], |of| &of.f)));
    }
    tell('C', None, (&model.c, errors.map_or(&[], |of| &of.c)));
    tell('D', None, (&model.d, errors.map_or(&[], |of| &of.d)));
    all.noises
        .extend(of.deviations.first().map(|&deviation| Noise {
            name: "e".to_owned(),
            deviation,
            per_s: None,
        }));
    all
}
