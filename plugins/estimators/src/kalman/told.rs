//! Decides how a structural model tells its coefficients and noises, on the scale of the data.

use athermal_core::node::{Coefficients, Mode, Noise, Predictor};

use super::KalmanPredictor;

/// The time over which noises are told, in s.
const PER_S: f64 = 3600.0;

/// What a model at rest consists of. The level wanders, so that no constant has a standard error.
pub(super) fn coefficients(of: &KalmanPredictor) -> Coefficients {
    let (filter, scales) = (&of.filter, &of.scaling.scales);
    let order = filter.state().len();
    let moving = order - scales.len();
    let variances = filter.covariance().iter().step_by(order + 1).skip(moving);
    let states = filter.state()[moving..].iter().zip(variances).zip(scales);
    let (mut values, mut errors) = (Vec::new(), vec![f64::NAN]);
    for ((b, variance), scale) in states {
        values.push(b / scale);
        errors.push(variance.sqrt() / scale);
    }
    let model = filter.model();
    let wandering = |name: &str, deviation: f64| Noise {
        name: name.to_owned(),
        deviation,
        per_s: Some(PER_S),
    };
    let mut noises = vec![
        Noise {
            per_s: None,
            ..wandering("observation", model.observation.sqrt())
        },
        wandering("level", (model.level * PER_S).sqrt()),
    ];
    let trend = model.trend;
    noises.extend(trend.map(|trend| wandering("trend", (trend * PER_S).sqrt() * PER_S)));
    let returns = model.trend.is_none().then(|| Mode {
        of: "level".to_owned(),
        time_constant_s: 1.0 / model.returning,
        period_s: None,
    });
    Coefficients {
        noises,
        modes: returns.into_iter().collect(),
        ..Coefficients::linear(of.predict(&vec![0.0; scales.len()]), &values, Some(&errors))
    }
}
