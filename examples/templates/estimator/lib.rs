//! An estimator of athermal: a line through the truths over the first of the features.

use athermal_core::node::prelude::*;

/// Predicts the truth by a straight line over the first feature, its slope shrunk.
///
/// `ŷ = ȳ + b (x − x̄)` with `b = Σ(x − x̄)(y − ȳ) / ((1 + shrinkage) Σ(x − x̄)²)` over the rows of the fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MyNode {
    /// By how much the slope is shrunk: 0 not at all, 1 to its half, at most 1000.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub shrinkage: f64,
}

impl Estimator for MyNode {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held(
                    "features",
                    "what the prediction is made of: the first counts",
                ),
                InputPort::truth("what is predicted, such as the drift of an axis"),
            ]
        }
    }

    fn regressors(&self) -> Regressors {
        Regressors {
            feature_lags: vec![Duration::ZERO],
            ..Regressors::default()
        }
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let first = setup.regressors.first();
        Box::new(Sums {
            shrinkage: self.shrinkage,
            uses: first
                .map(|regressor| regressor.name.clone())
                .into_iter()
                .collect(),
            rows: Vec::new(),
        })
    }
}

/// What learns.
struct Sums {
    shrinkage: f64,
    uses: Vec<String>,
    rows: Vec<(f64, f64)>,
}

impl Trainer for Sums {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        self.rows
            .push((regressors.first().copied().unwrap_or(0.0), truth));
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        let rows = self.rows.len();
        if rows < 2 {
            return Err(TrainingError::TooFewRows { rows, needed: 2 });
        }
        let mean = |of: fn(&(f64, f64)) -> f64| self.rows.iter().map(of).sum::<f64>() / rows as f64;
        let (feature, truth) = (mean(|row| row.0), mean(|row| row.1));
        let products = self.rows.iter().map(|(x, y)| (x - feature) * (y - truth));
        let squares = self.rows.iter().map(|(x, _)| (x - feature) * (x - feature));
        let slope = products.sum::<f64>() / ((1.0 + self.shrinkage) * squares.sum::<f64>());
        let line = MyNodeFitted {
            uses: self.uses,
            feature,
            truth,
            // A feature that never changes says nothing.
            slope: if slope.is_finite() { slope } else { 0.0 },
        };
        Ok(Trained {
            predictor: Box::new(line),
            report: TrainingReport::default(),
        })
    }
}

/// What was learned, as a model file holds it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MyNodeFitted {
    uses: Vec<String>,
    feature: f64,
    truth: f64,
    slope: f64,
}

impl Predictor for MyNodeFitted {
    fn uses(&self) -> &[String] {
        &self.uses
    }

    fn predict(&self, regressors: &[f64]) -> f64 {
        let feature = regressors.first().copied().unwrap_or(self.feature);
        self.truth + self.slope * (feature - self.feature)
    }
}

athermal_core::predictor!(MyNodeFitted, "my_node");

athermal_core::register!(MyNode, Estimator, "my_node");

#[cfg(test)]
mod tests {
    use super::*;
    use athermal_testkit::Bench;

    #[test]
    fn a_line_is_found_and_its_slope_shrunk() {
        for (shrinkage, expected) in [(0.0, 8.0), (1.0, 5.5)] {
            let rows = [
                (0.0, [0.0, 2.0]),
                (10.0, [1.0, 4.0]),
                (20.0, [1.0, 4.0]),
                (30.0, [0.0, 2.0]),
            ];
            let mut bench = Bench::of(&MyNode { shrinkage })
                .input("features", 1, "K")
                .with("ahead = \"0s\"")
                .fitted_on(rows);
            bench.feed([(0.0, [3.0, f64::NAN])]);
            assert_eq!(bench.outputs(), [[expected]]);
        }
    }
}
