//! Decides how a structural model tells its coefficients and noises, on the scale of the data.

use athermal_core::node::{Coefficients, Figure, Mode, Noise, Predictor};
use athermal_core::time::Duration;
use athermal_numerics::Structural;

use super::KalmanPredictor;

/// The time over which noises are given, in s.
const PER_S: f64 = 3600.0;

/// After so many times in which it returns, 2 % of a level are left, and less than a thousandth of its variance.
const LASTS: f64 = 4.0;

/// Noises as a graph file gives them, over an hour, in the unit of the truth.
pub(super) struct Hourly {
    observation: f64,
    level: f64,
    trend: Option<f64>,
    returns_s: Option<f64>,
}

impl Hourly {
    pub(super) fn of(model: &Structural) -> Self {
        Self {
            observation: model.observation.sqrt(),
            level: (model.level * PER_S).sqrt(),
            trend: model.trend.map(|trend| (trend * PER_S).sqrt() * PER_S),
            returns_s: (model.returning > 0.0 && model.level > 0.0).then(|| 1.0 / model.returning),
        }
    }

    /// Whether nothing moves the level; the time in which it would return then means nothing.
    pub(super) fn is_still(&self) -> bool {
        self.level == 0.0 && self.trend.is_none_or(|trend| trend == 0.0)
    }

    /// The standard deviation of a level that is gone before the next truth, and of the observation with it, so that nothing tells
    /// one from the other; truths are so many seconds apart.
    pub(super) fn fades_within(&self, apart_s: f64) -> Option<f64> {
        let returns_s = self.returns_s.filter(|returns| LASTS * returns < apart_s)?;
        let level = self.level * self.level / PER_S * returns_s / 2.0;
        Some((self.observation * self.observation + level).sqrt())
    }

    /// For programs.
    pub(super) fn figure(&self) -> Figure {
        let always = [
            ("observation", self.observation),
            ("level", self.level),
            ("per_s", PER_S),
        ];
        let trend = self.trend.map(|trend| ("trend", trend));
        let returns = self.returns_s.map(|returns_s| ("returns_s", returns_s));
        Figure::named(always.into_iter().chain(trend).chain(returns))
    }

    /// For a graph file, to four significant digits.
    pub(super) fn as_given(&self, unit: &str) -> String {
        let noise = |name: &str, value: f64| format!("{name} = \"{} {unit}\"", significant(value));
        let mut parts = vec![
            noise("observation", self.observation),
            noise("level", self.level),
        ];
        parts.extend(self.trend.map(|trend| noise("trend", trend)));
        parts.push("per = \"1h\"".to_owned());
        let returns = self.returns_s.map(significant);
        let returns = returns.and_then(Duration::from_secs_f64);
        let least = Duration::from_ns(1);
        parts.extend(returns.map(|returns| format!("returns = \"{}\"", returns.max(least))));
        format!("{{ {} }}", parts.join(", "))
    }
}

/// A number to four significant digits.
fn significant(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

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
    let hourly = Hourly::of(&model);
    let wandering = |name: &str, deviation: f64| Noise {
        name: name.to_owned(),
        deviation,
        per_s: Some(PER_S),
    };
    let mut noises = vec![
        Noise {
            per_s: None,
            ..wandering("observation", hourly.observation)
        },
        wandering("level", hourly.level),
    ];
    noises.extend(hourly.trend.map(|trend| wandering("trend", trend)));
    let returns = (model.trend.is_none() && !hourly.is_still()).then(|| Mode {
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

#[cfg(test)]
mod tests {
    use athermal_numerics::Passage;

    use super::*;

    fn given(level: f64, returning: f64) -> String {
        let model = Structural {
            observation: 4.0,
            level,
            trend: None,
            returning,
            passage: Passage::Continuous,
        };
        Hourly::of(&model).as_given("V")
    }

    #[test]
    fn a_level_that_nothing_moves_has_no_time_in_which_it_returns() {
        assert_eq!(
            given(0.0, 55.0),
            "{ observation = \"2 V\", level = \"0 V\", per = \"1h\" }"
        );
    }

    #[test]
    fn a_level_that_returns_at_once_does_so_in_a_time_that_can_be_given() {
        let told = given(1.0, 1e15);
        assert!(told.ends_with("returns = \"1ns\" }"), "{told}");
    }
}
