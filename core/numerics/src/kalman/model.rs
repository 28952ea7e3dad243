//! Decides what a structural model is: its variances, and how they add up while time passes.

use crate::NumericsError;
use crate::checks::check_parameter;
use serde::{Deserialize, Serialize};

/// The variances of `y = μ + xᵀβ + ε`, where the level `μ` wanders and may have a trend `ν` that wanders too.
///
/// Local level: `μ' = μ + η`. Local linear trend: `μ' = μ + ν·Δ + η`, `ν' = ν + ζ` (Harvey 1989, sections 2.3 and 9.2). A level
/// that returns: `μ' = e^(−ρΔ) μ + η`, an autoregressive component in continuous time (section 9.1). The coefficients `β` stay
/// as they are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Structural {
    /// The variance of one observation, `ε`.
    pub observation: f64,
    /// The variance that the level gains per unit of time, `η`.
    pub level: f64,
    /// The variance that the trend gains per unit of time, `ζ`; none where there is no trend.
    pub trend: Option<f64>,
    /// The rate `ρ` at which a level without a trend returns to 0, per unit of time; 0 where it stays where it has gone.
    #[serde(default)]
    pub returning: f64,
    /// How time passes between observations.
    pub passage: Passage,
}

/// What a level does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Movement {
    /// It wanders.
    Wanders,
    /// It wanders, and returns to 0.
    Returns,
    /// It follows a trend that wanders, and wanders about it.
    Trend,
}

/// How time passes between observations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Passage {
    /// In whole steps: the textbook's model, whose noises of one step are independent.
    Steps,
    /// Continuously, for observations at irregular times: the trend's noise reaches the level within a step too
    /// (Harvey 1989, equation 9.2.11).
    Continuous,
}

/// What level and trend gain in uncertainty: the variance of either, and what they share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gained {
    pub(super) level: f64,
    pub(super) both: f64,
    pub(super) trend: f64,
}

impl Structural {
    /// How many states come before the coefficients.
    pub(super) fn moving(&self) -> usize {
        1 + usize::from(self.trend.is_some())
    }

    /// What is gained while time passes.
    #[inline]
    pub(super) fn gained(&self, time: f64) -> Gained {
        let level = self.level * time;
        let Some(trend) = self.trend else {
            let returned = 2.0 * self.returning * time;
            return Gained {
                level: if returned > 0.0 {
                    level * -libm::expm1(-returned) / returned
                } else {
                    level
                },
                both: 0.0,
                trend: 0.0,
            };
        };
        // The sums over the whole steps of 1, k and k², and the integrals that they become.
        let (first, second) = match self.passage {
            Passage::Steps => (
                time * (time - 1.0) / 2.0,
                time * (time - 1.0) * (2.0 * time - 1.0) / 6.0,
            ),
            Passage::Continuous => (time * time / 2.0, time * time * time / 3.0),
        };
        Gained {
            level: level + trend * second,
            both: trend * first,
            trend: trend * time,
        }
    }

    /// The share of a level that is left after a time.
    #[inline]
    pub(super) fn kept(&self, time: f64) -> f64 {
        if self.returning > 0.0 {
            libm::exp(-self.returning * time)
        } else {
            1.0
        }
    }

    /// Whether the variances, relative to that of an observation, and the rate are those of another to a hundredth.
    pub(super) fn is_near(&self, other: &Self) -> bool {
        let parts = |model: &Self| {
            let of = model.observation;
            [
                model.level / of,
                model.trend.unwrap_or(0.0) / of,
                model.returning,
            ]
        };
        let near = |(a, b): (f64, f64)| (a - b).abs() <= 0.01 * b.abs();
        parts(self).into_iter().zip(parts(other)).all(near)
    }

    pub(super) fn check(&self) -> Result<(), NumericsError> {
        let variances = [
            ("observation", self.observation),
            ("level", self.level),
            ("trend", self.trend.unwrap_or(0.0)),
            ("returning", self.returning),
        ];
        for (name, value) in variances {
            let fine = value >= 0.0 && value.is_finite();
            check_parameter(name, value, fine, "finite and not negative")?;
        }
        if self.trend.is_some() && self.returning > 0.0 {
            return Err(NumericsError::Parameter {
                name: "returning",
                value: self.returning,
                allowed: "0 beside a trend",
            });
        }
        Ok(())
    }
}
