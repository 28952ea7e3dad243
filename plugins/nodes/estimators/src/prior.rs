//! What a fleet knows of the coefficients of its machines, as a file holds it. Decides how it meets the regressors of a fit.

use std::collections::BTreeMap;
use std::sync::Arc;

use athermal_core::node::{Mistake, Regressor, TrainingReport};
use athermal_core::time::Duration;
use athermal_core::unit::Unit;
use athermal_numerics::{CoefficientPrior, Novelty, NumericsError, PredictionVariance, Pull};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The format that this version writes.
const FORMAT: u64 = 1;

/// A prior of the estimators of a graph, which `athermal fleet fit --pooled` writes.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior(Arc<Contents>);

#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Contents {
    athermal_prior: u64,
    estimators: BTreeMap<String, EstimatorPrior>,
}

/// What is known of one estimator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorPrior {
    /// From how many machines.
    pub machines: usize,
    /// What is predicted: `drift.Z1`.
    pub truth: String,
    /// The unit of the truth's differences.
    pub unit: String,
    /// How far ahead it is predicted.
    pub ahead: Duration,
    /// How long the stretches are for which the penalty is the best.
    pub stretch: Duration,
    /// The penalty towards the prior, in squares of the truth's unit.
    pub penalty: f64,
    /// How much of the covariance is the same for all coefficients, 0 to 1.
    pub shrinkage: f64,
    /// The regressors, by name.
    pub regressors: Vec<PriorRegressor>,
    /// Mean and covariance of the constant and the coefficients of the regressors, in their order.
    pub coefficients: CoefficientPrior,
    /// How far regressors are from those that machines of the fleet had.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub novelty: Option<Novelty>,
    /// What the machines' own fits leave.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<PriorNoise>,
}

/// What fits of machines to all of their own rows leave.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorNoise {
    /// The mean of its variance, in squares of the truth's unit.
    pub variance: f64,
    /// How many independent rows of a machine of its own would know its variance as well, above 0.
    pub freedom: f64,
}

impl PriorNoise {
    /// Of the variances of machines. These differ as those of so many rows would, of which the logarithm has the variance `2 / freedom`.
    pub(crate) fn of(variances: &[f64]) -> Option<Self> {
        let count = variances.len() as f64;
        let mean = |of: &dyn Fn(&f64) -> f64| variances.iter().map(of).sum::<f64>() / count;
        let middle = mean(&|of| of.ln());
        let apart = mean(&|of| (of.ln() - middle).powi(2)) * count / (count - 1.0);
        let variance = mean(&|of| *of);
        let is_known = count > 1.0 && variance > 0.0 && apart.is_finite();
        is_known.then(|| Self {
            variance,
            freedom: (2.0 / apart).clamp(1.0, 1e3),
        })
    }
}

/// A regressor of a prior.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorRegressor {
    /// As reports and models name it.
    pub name: String,
    /// The unit of its values.
    pub unit: String,
}

impl Serialize for Prior {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Prior {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Contents::deserialize(deserializer).map(|contents| Self(Arc::new(contents)))
    }
}

/// A prior as the rows of one fit meet it.
#[derive(Debug, Clone)]
pub(crate) struct Met {
    pub(crate) coefficients: CoefficientPrior,
    /// Of each regressor its place in the prior, where that knows it.
    places: Vec<Option<usize>>,
    penalty: f64,
    machines: usize,
    novelty: Option<Novelty>,
    noise: Option<PriorNoise>,
}

/// What an estimator is made for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wanted<'a> {
    pub(crate) instance: &'a str,
    pub(crate) regressors: &'a [Regressor],
    /// Of the truth's differences.
    pub(crate) unit: &'a Unit,
    pub(crate) ahead: Duration,
}

impl Prior {
    /// One of these estimators, by the names of their instances.
    #[must_use]
    pub fn new(estimators: BTreeMap<String, EstimatorPrior>) -> Self {
        Self(Arc::new(Contents {
            athermal_prior: FORMAT,
            estimators,
        }))
    }

    /// What is known of each estimator, by the name of its instance.
    #[must_use]
    pub fn estimators(&self) -> &BTreeMap<String, EstimatorPrior> {
        &self.0.estimators
    }

    /// What is wrong with it, whatever it is used for; `place` is the key that holds it.
    pub(crate) fn mistakes(&self, place: &str) -> Vec<Mistake> {
        let Contents {
            athermal_prior: format,
            estimators,
        } = &*self.0;
        if *format != FORMAT {
            let message = format!("the prior has format {format}, and this version reads {FORMAT}");
            return vec![
                Mistake::at(place, message).help("make it anew with `athermal fleet fit --pooled`"),
            ];
        }
        let wrong = estimators.iter().filter_map(|(instance, prior)| {
            let reason = prior.wrong()?;
            Some(Mistake::at(
                place,
                format!("the prior of `{instance}` {reason}"),
            ))
        });
        wrong.collect()
    }

    /// How it meets the rows of a fit.
    ///
    /// # Errors
    /// A sentence: it knows nothing of this estimator, or knows it with other regressors, units or another horizon.
    pub(crate) fn meet(&self, wanted: Wanted<'_>) -> Result<Met, String> {
        let instance = wanted.instance;
        let Some(prior) = self.0.estimators.get(instance) else {
            let known: Vec<&str> = self.0.estimators.keys().map(String::as_str).collect();
            let known = known.join(", ");
            return Err(format!(
                "the prior has nothing for `{instance}`; it has {known}"
            ));
        };
        let of = |what: &str| format!("the prior of `{instance}` {what}");
        if prior.ahead != wanted.ahead {
            let (own, asked) = (prior.ahead, wanted.ahead);
            return Err(of(&format!("predicts {own} ahead, and the node {asked}")));
        }
        let truth_factor = Unit::parse(&prior.unit).ok();
        let truth_factor = truth_factor.and_then(|unit| unit.factor_to(wanted.unit));
        let Some(truth_factor) = truth_factor else {
            let (own, asked) = (&prior.unit, wanted.unit);
            return Err(of(&format!("predicts in {own}, and the node in {asked}")));
        };
        let mut coefficients = prior.coefficients.clone();
        let order = coefficients.order();
        let mut factors = vec![1.0; order];
        let mut places = Vec::with_capacity(wanted.regressors.len());
        for regressor in wanted.regressors {
            let mut known = prior.regressors.iter();
            let place = known.position(|known| known.name == regressor.name);
            places.push(place);
            let Some(place) = place else { continue };
            let own = &prior.regressors[place].unit;
            if *own == regressor.unit {
                continue;
            }
            let [from, to] = [&regressor.unit, own].map(|unit| Unit::parse(unit).ok());
            let factor = from.zip(to).and_then(|(from, to)| from.factor_to(&to));
            let Some(factor) = factor else {
                let (name, unit) = (&regressor.name, &regressor.unit);
                return Err(of(&format!(
                    "has `{name}` in {own}, and the node in {unit}"
                )));
            };
            factors[place + 1] = factor;
            coefficients.centre[place] /= factor;
        }
        if places.iter().all(Option::is_none) && !wanted.regressors.is_empty() {
            let own = prior.regressors.first().map_or("none", |of| &of.name);
            let asked = wanted.regressors.first().map_or("none", |of| &of.name);
            return Err(of(&format!(
                "knows none of the node's regressors: it has `{own}` …, and the node `{asked}` …"
            )));
        }
        for (mean, factor) in coefficients.mean.iter_mut().zip(&factors) {
            *mean *= truth_factor * factor;
        }
        let cells = (0..order).flat_map(|i| (0..=i).map(move |j| (i, j)));
        for (covariance, (i, j)) in coefficients.covariance.iter_mut().zip(cells) {
            *covariance *= truth_factor * truth_factor * factors[i] * factors[j];
        }
        let is_same = places.iter().copied().eq((0..order - 1).map(Some));
        let in_its_units = factors.iter().all(|factor| *factor == 1.0);
        Ok(Met {
            coefficients,
            places,
            penalty: prior.penalty * truth_factor * truth_factor,
            machines: prior.machines,
            novelty: prior.novelty.clone().filter(|_| is_same && in_its_units),
            noise: prior.noise.map(|of| PriorNoise {
                variance: of.variance * truth_factor * truth_factor,
                ..of
            }),
        })
    }
}

impl EstimatorPrior {
    fn wrong(&self) -> Option<String> {
        let Self {
            regressors,
            coefficients,
            ..
        } = self;
        let (named, known) = (regressors.len(), coefficients.centre.len());
        if named != known {
            return Some(format!("names {named} regressors and has {known} centres"));
        }
        if !(self.penalty > 0.0 && self.penalty.is_finite()) {
            return Some(format!(
                "has the penalty {}, which must be above 0",
                self.penalty
            ));
        }
        let is_wrong =
            |of: &PriorNoise| !(of.variance > 0.0 && of.freedom > 0.0 && of.freedom.is_finite());
        if self.noise.as_ref().is_some_and(is_wrong) {
            return Some(
                "has a noise that is none: both of its numbers must be above 0".to_owned(),
            );
        }
        match coefficients.check() {
            Ok(()) => None,
            Err(NumericsError::NoConvergence) => {
                Some("has a covariance that is not positive definite".to_owned())
            }
            Err(error) => Some(format!("cannot be used: {error}")),
        }
    }
}

impl Met {
    /// Columns of the fit with their places in the prior.
    pub(crate) fn columns(&self, columns: &[usize]) -> Vec<(usize, Option<usize>)> {
        columns
            .iter()
            .map(|&column| (column, self.places[column]))
            .collect()
    }

    /// How hard it pulls, so many times as hard as was best over machines.
    pub(crate) fn pull(&self, weight: f64, alpha: f64) -> Pull {
        Pull {
            penalty: weight * self.penalty,
            alpha,
        }
    }

    /// How far regressors are from those of the fleet, for a fit of all of them.
    pub(crate) fn novelty(&self, columns: &[usize]) -> Option<Novelty> {
        let all = columns.iter().copied().eq(0..self.places.len());
        self.novelty.clone().filter(|_| all)
    }

    /// How far predictions may be off, of a fit to so many rows. What is left beside a prediction is as much as the fleet's machines leave on
    /// weeks of rows, as far as these few do not know it better: as many of them say as much as one as the penalty is above that. The
    /// coefficients are as sure as their posterior is, of which the noise is the penalty. How much is left is not sure itself, so errors have
    /// Student's t, and the variance is that of normal errors whose middle nine tenths reach as far.
    pub(crate) fn variance(
        &self,
        of: PredictionVariance,
        pull: Pull,
        rows: u64,
    ) -> PredictionVariance {
        let (noise, wider) = self.noise.map_or((of.noise, 1.0), |fleet| {
            let own = rows as f64 * (fleet.variance / self.penalty).min(1.0);
            let freedom = fleet.freedom + own;
            let noise = (fleet.freedom * fleet.variance + own * of.noise) / freedom;
            (noise, student_over_normal(freedom))
        });
        let share = pull.penalty / noise;
        PredictionVariance {
            noise: noise * wider * wider,
            rows: ((of.rows as f64 / share) as u64).max(1),
            root: of.root.iter().map(|w| w * share.sqrt()).collect(),
            ..of
        }
    }

    /// What there is to tell of it.
    pub(crate) fn tell(
        &self,
        pull: Pull,
        regressors: &[Regressor],
        columns: &[usize],
        report: &mut TrainingReport,
    ) {
        report.figure("prior_machines", self.machines);
        report.figure("prior_penalty", pull.penalty);
        report.notes.push(format!(
            "towards the prior of {} machines, with a penalty of {:.3e}",
            self.machines, pull.penalty
        ));
        let unknown = columns
            .iter()
            .filter(|column| self.places[**column].is_none());
        let unknown: Vec<&str> = unknown
            .map(|column| regressors[*column].name.as_str())
            .collect();
        if !unknown.is_empty() {
            report.figure("unknown_to_prior", unknown.len());
            report.notes.push(format!(
                "the prior does not know these, so they are pulled towards 0: {}",
                unknown.join(", ")
            ));
        }
    }
}

/// How much farther the middle nine tenths of Student's t reach than those of a normal variable (Abramowitz and Stegun 26.7.5).
fn student_over_normal(freedom: f64) -> f64 {
    let z2 = 1.644_854_f64.powi(2);
    let second = (5.0 * z2 * z2 + 16.0 * z2 + 3.0) / 96.0;
    1.0 + (z2 + 1.0) / (4.0 * freedom) + second / (freedom * freedom)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn regressor(name: &str, unit: &str) -> Regressor {
        Regressor {
            name: name.to_owned(),
            unit: unit.to_owned(),
            sensors: Vec::new(),
            lag: Duration::ZERO,
            of_truth: false,
        }
    }

    fn prior() -> Prior {
        let named = |name: &str| PriorRegressor {
            name: name.to_owned(),
            unit: "mK/min".to_owned(),
        };
        let estimator = EstimatorPrior {
            machines: 9,
            truth: "drift".to_owned(),
            unit: "nm/min".to_owned(),
            ahead: Duration::ZERO,
            stretch: Duration::ZERO,
            penalty: 50.0,
            shrinkage: 0.5,
            regressors: vec![named("a"), named("b")],
            coefficients: CoefficientPrior {
                centre: vec![5.0, 7.0],
                mean: vec![10.0, 2.0, 3.0],
                covariance: vec![4.0, 0.0, 1.0, 0.5, 0.25, 2.0],
            },
            novelty: None,
            noise: Some(PriorNoise {
                variance: 30.0,
                freedom: 12.0,
            }),
        };
        Prior::new(BTreeMap::from([("thermal".to_owned(), estimator)]))
    }

    fn met(regressors: &[Regressor], unit: &str) -> Result<Met, String> {
        prior().meet(Wanted {
            instance: "thermal",
            regressors,
            unit: &Unit::parse(unit).unwrap(),
            ahead: Duration::ZERO,
        })
    }

    #[test]
    fn other_units_of_the_same_quantities_are_converted() {
        let rows = [
            regressor("new", "K"),
            regressor("b", "K/min"),
            regressor("a", "mK/min"),
        ];
        let met = met(&rows, "um/min").unwrap();
        let near = |found: &[f64], expected: &[f64]| {
            assert_eq!(found.len(), expected.len());
            for (found, expected) in found.iter().zip(expected) {
                let error = (found - expected).abs();
                assert!(error <= 1e-12 * expected.abs(), "{found} for {expected}");
            }
        };
        assert_eq!(
            met.columns(&[0, 1, 2]),
            [(0, None), (1, Some(1)), (2, Some(0))]
        );
        // 3 nm/min per mK/min are 3 µm/min per K/min.
        near(&met.coefficients.mean, &[0.01, 0.002, 3.0]);
        near(&met.coefficients.centre, &[5.0, 0.007]);
        near(
            &met.coefficients.covariance,
            &[4e-6, 0.0, 1e-6, 0.5e-3, 0.25e-3, 2.0],
        );
        near(&[met.pull(2.0, 1.0).penalty], &[100e-6]);
    }

    #[test]
    fn what_it_cannot_be_used_for_is_a_sentence() {
        let wrong = |regressors: &[Regressor], unit: &str| met(regressors, unit).unwrap_err();
        assert_eq!(
            wrong(&[regressor("a", "K")], "nm/min"),
            "the prior of `thermal` has `a` in mK/min, and the node in K"
        );
        assert_eq!(
            wrong(&[regressor("a", "mK/min")], "nm"),
            "the prior of `thermal` predicts in nm/min, and the node in nm"
        );
        assert_eq!(
            wrong(&[regressor("c", "mK/min")], "nm/min"),
            "the prior of `thermal` knows none of the node's regressors: it has `a` …, and the node `c` …"
        );
    }

    #[test]
    fn the_noise_of_the_fleet_counts_beside_that_of_few_rows_and_the_posterior_is_that_of_the_penalty()
     {
        let met = met(
            &[regressor("a", "mK/min"), regressor("b", "mK/min")],
            "nm/min",
        )
        .unwrap();
        let of = PredictionVariance {
            noise: 3.0,
            rows: 200,
            centre: vec![0.0; 2],
            root: vec![0.1, 0.0, 0.2],
        };
        let found = met.variance(of.clone(), met.pull(1.0, 1.0), 20);
        // 20 rows say as much as 20 · 30 / 50.
        let noise = (12.0 * 30.0 + 12.0 * 3.0) / 24.0;
        // Abramowitz and Stegun, table 26.10: t of 24 degrees of freedom and a chance of 0.05 is 1.711.
        let wider = student_over_normal(24.0);
        assert!((1.645 * wider - 1.711).abs() < 1e-3, "{wider}");
        let wider = wider * wider;
        assert!((found.noise - noise * wider).abs() < 1e-12, "{found:?}");
        let beyond = found.at(&[1.0, 1.0]) - found.at(&[0.0, 0.0]);
        let expected = 50.0 * (0.01 + 0.04) * wider;
        assert!((beyond - expected).abs() < 1e-12, "{beyond}");
        assert_eq!(found.rows, 66);
        // Of machines whose logarithms differ by 0.4 the variance is known as of twelve rows.
        let of = PriorNoise::of(&[-0.4_f64, 0.4, 0.0, -0.4, 0.4, 0.0].map(f64::exp)).unwrap();
        assert!((of.freedom - 2.0 / 0.128).abs() < 1e-9, "{of:?}");
    }

    #[test]
    fn it_reads_back_from_json_to_the_bit() {
        let text = serde_json::to_string(&prior()).unwrap();
        assert_eq!(serde_json::from_str::<Prior>(&text).unwrap(), prior());
        assert_eq!(prior().mistakes("solver.prior"), []);
    }
}
