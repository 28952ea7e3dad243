//! Running scores of predictions. Decides the arithmetic of the figures; does not decide which predictions count.

use serde::{Deserialize, Serialize};

/// Sums over pairs of a truth and a prediction, from which scores follow at any time. Pairs in which either is not finite
/// are left out.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScoreAccumulator {
    count: u64,
    error_mean: f64,
    error_squares: Sum,
    truth_mean: f64,
    /// Σ(y − ȳ)², by Welford's recurrence.
    truth_spread: f64,
    truth_squares: Sum,
    largest_error: f64,
}

/// The figures of [`ScoreAccumulator`], in the unit of the truth where they have one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// The number of pairs.
    pub count: u64,
    /// The root of the mean squared error.
    pub rmse: f64,
    /// `1 − Σe²/Σ(y − ȳ)²`; nothing when the truth is constant.
    pub r2: Option<f64>,
    /// `1 − Σe²/Σy²`, the share of the truth's squares that predicting 0 would leave; nothing when the truth is 0
    /// throughout.
    pub r2_zero: Option<f64>,
    /// The mean of prediction minus truth.
    pub bias: f64,
    /// The largest absolute error.
    pub max_abs_error: f64,
}

impl ScoreAccumulator {
    /// No pairs yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a pair.
    pub fn push(&mut self, truth: f64, prediction: f64) {
        let error = prediction - truth;
        if !error.is_finite() {
            return;
        }
        self.count += 1;
        let n = self.count as f64;
        self.error_mean += (error - self.error_mean) / n;
        self.error_squares.add(error * error);
        let before = truth - self.truth_mean;
        self.truth_mean += before / n;
        self.truth_spread += before * (truth - self.truth_mean);
        self.truth_squares.add(truth * truth);
        self.largest_error = self.largest_error.max(error.abs());
    }

    /// The number of pairs so far.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The scores so far, or nothing without any pair.
    pub fn score(&self) -> Option<Score> {
        if self.count == 0 {
            return None;
        }
        let n = self.count as f64;
        let squares = self.error_squares.value();
        let against = |spread: f64| (spread > 0.0).then(|| 1.0 - squares / spread);
        // What rounding alone leaves of the spread of a constant truth.
        let rounding = n * (n.sqrt() * f64::EPSILON * self.truth_mean).powi(2);
        let spread = if self.truth_spread <= rounding {
            0.0
        } else {
            self.truth_spread
        };
        Some(Score {
            count: self.count,
            rmse: (squares / n).sqrt(),
            r2: against(spread),
            r2_zero: against(self.truth_squares.value()),
            bias: self.error_mean,
            max_abs_error: self.largest_error,
        })
    }
}

/// A sum that carries its rounding error along (Neumaier 1974).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
struct Sum {
    total: f64,
    lost: f64,
}

impl Sum {
    fn add(&mut self, value: f64) {
        let next = self.total + value;
        self.lost += if self.total.abs() >= value.abs() {
            (self.total - next) + value
        } else {
            (value - next) + self.total
        };
        self.total = next;
    }

    fn value(self) -> f64 {
        self.total + self.lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_figures_are_those_of_their_definitions() {
        let truth = [1.0, 2.0, 4.0, 5.0];
        let prediction = [1.5, 2.0, 3.0, 6.0];
        let mut running = ScoreAccumulator::new();
        for (y, p) in truth.iter().zip(&prediction) {
            running.push(*y, *p);
        }
        let score = running.score().unwrap();
        let squared_errors: f64 = 0.25 + 0.0 + 1.0 + 1.0;
        let spread_about_mean_3: f64 = 4.0 + 1.0 + 1.0 + 4.0;
        let squares: f64 = 1.0 + 4.0 + 16.0 + 25.0;
        assert_eq!(score.count, 4);
        assert_eq!(score.rmse, (squared_errors / 4.0).sqrt());
        assert!((score.r2.unwrap() - (1.0 - squared_errors / spread_about_mean_3)).abs() < 1e-15);
        assert_eq!(score.r2_zero, Some(1.0 - squared_errors / squares));
        assert_eq!(score.bias, 0.125);
        assert_eq!(score.max_abs_error, 1.0);
    }

    #[test]
    fn a_spread_far_from_zero_is_not_lost() {
        let mut running = ScoreAccumulator::new();
        for i in 0..1000 {
            let truth = 1e9 + f64::from(i % 2);
            running.push(truth, 1e9 + 0.5);
        }
        let score = running.score().unwrap();
        assert!(score.r2.unwrap().abs() < 1e-12);
    }

    #[test]
    fn a_constant_truth_has_no_r2_and_no_pairs_have_no_score() {
        let mut running = ScoreAccumulator::new();
        assert_eq!(running.score(), None);
        for _ in 0..1000 {
            running.push(0.1, 0.2);
            running.push(f64::NAN, 0.2);
        }
        let score = running.score().unwrap();
        assert_eq!(score.count, 1000);
        assert_eq!(score.r2, None);
        assert!(score.r2_zero.is_some());
    }
}
