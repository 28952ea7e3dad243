//! How one linear model goes on learning by stochastic gradients, as one would write it for this machine alone.

use athermal::core::node::{LinearForm, TrainedRange};
use athermal_numerics::Sgd;
use serde_json::Value;

use super::Linear;

pub struct Learner {
    /// The size from which on a truth is not learned from.
    below: f64,
    means: Vec<f64>,
    scales: Vec<f64>,
    level: f64,
    sgd: Sgd,
    range: TrainedRange,
    seen: u32,
    mean_square: f64,
    refused: u32,
    row: Vec<f64>,
    coefficients: Vec<f64>,
}

impl Learner {
    /// Goes on from a fit.
    pub fn read(fit: &Value, below: f64) -> Self {
        let frame = &fit["frame"];
        let read = |value: &Value| serde_json::from_value(value.clone()).expect("numbers");
        let means: Vec<f64> = read(&frame["means"]);
        let rmse = fit["rmse"].as_f64().expect("a fit has errors");
        Self {
            below,
            row: means.clone(),
            coefficients: means.clone(),
            means,
            scales: read(&frame["scales"]),
            level: frame["level"].as_f64().expect("a level is finite"),
            sgd: serde_json::from_value(fit["recursion"]["sgd"].clone()).expect("it learns by SGD"),
            range: serde_json::from_value(fit["range"].clone()).expect("a fit has a range"),
            seen: 10,
            mean_square: rmse * rmse,
            refused: 0,
        }
    }

    /// Learns from a truth and the regressors of the run that it belongs to.
    pub fn learn(&mut self, model: &mut Linear, regressors: &[f64], truth: f64) {
        for (value, &(_, place)) in self.row.iter_mut().zip(&model.terms) {
            *value = regressors[place];
        }
        let whole = self.row.iter().all(|value| !value.is_nan());
        if !(whole && truth.abs() < self.below && self.range.contains(&self.row, 1.0)) {
            return;
        }
        if !self.admits(truth - model.predict(regressors)) {
            return;
        }
        let ends = self.means.iter().zip(&self.scales);
        for (value, (mean, scale)) in self.row.iter_mut().zip(ends) {
            *value = (*value - mean) / scale;
        }
        self.sgd.step(&self.row, truth - self.level);
        let weights = self.sgd.weights().iter().zip(&self.scales);
        let to = model.terms.iter_mut().zip(&mut self.coefficients);
        for (((to, _), copy), (weight, scale)) in to.zip(weights) {
            (*to, *copy) = (weight / scale, weight / scale);
        }
        let shift = LinearForm {
            constant: 0.0,
            coefficients: &self.coefficients,
        };
        model.intercept = self.sgd.intercept() + self.level - shift.at(&self.means);
    }

    /// Whether an error is below six times the recent one, for which the last fifty count; one that is not counts as twice the recent one.
    fn admits(&mut self, error: f64) -> bool {
        if self.refused >= 20 {
            (self.seen, self.mean_square, self.refused) = (0, 0.0, 0);
        }
        let square = error * error;
        let judged = self.seen >= 10 && self.mean_square > 0.0;
        let most = if judged {
            36.0 * self.mean_square
        } else {
            f64::INFINITY
        };
        self.seen = (self.seen + 1).min(50);
        let admitted = square <= most;
        let counted = if admitted {
            square
        } else {
            square.min(4.0 * self.mean_square)
        };
        self.mean_square += (counted - self.mean_square) / f64::from(self.seen);
        self.refused = if admitted { 0 } else { self.refused + 1 };
        admitted
    }
}
