//! How far a linear model's prediction may be from the value that is observed. Decides the variance of that error; does not
//! decide the coefficients.

use crate::normal_equations::Problem;
use crate::{Gram, LeastSquares, LinearFit, Method, NumericsError, SINGULAR_BOUND};
use serde::{Deserialize, Serialize};

/// The variance of an observation about its prediction, `s²(1 + 1/n + |W(x − x̄)|²)`, with `WᵀW` the inverse of the
/// penalised normal equations and `s² = RSS / (n − 1 − tr H)`.
///
/// Without a penalty this is the textbook's prediction variance (Draper and Smith 1998, section 3.1). With one it is that of
/// the Bayesian model of which ridge is the posterior mean: coefficients with a prior variance of `s²/α` (Hastie,
/// Tibshirani and Friedman 2009, section 3.4.1); `tr H` is then the effective number of coefficients. Rows whose errors hang
/// together inform less than their number suggests: the first term stands, the others are too small.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PredictionVariance {
    /// The variance of the residuals, `s²`.
    pub noise: f64,
    /// The number of rows, `n`.
    pub rows: u64,
    /// The mean of each column; empty without an intercept.
    pub centre: Vec<f64>,
    /// `W`, a lower triangle row by row.
    pub root: Vec<f64>,
}

impl PredictionVariance {
    /// The variance at the values of the fit's columns, in their order.
    pub fn at(&self, x: &[f64]) -> f64 {
        let mut leverage = if self.centre.is_empty() {
            0.0
        } else {
            1.0 / self.rows as f64
        };
        for row in self.triangle().take(x.len()) {
            let along: f64 = row
                .iter()
                .enumerate()
                .map(|(j, w)| w * (x[j] - self.centre.get(j).copied().unwrap_or(0.0)))
                .sum();
            leverage += along * along;
        }
        self.noise * (1.0 + leverage)
    }

    /// The standard errors of the intercept, where there is one, and of the coefficients, in the order of the fit's columns:
    /// without a penalty `s √(n⁻¹ + |Wx̄|²)` and `s |We_j|`; with one those of the posterior. NaN for a column that the rows
    /// do not determine.
    #[must_use]
    pub fn standard_errors(&self) -> Vec<f64> {
        let mut squares = Vec::new();
        let mut of_intercept = 1.0 / self.rows as f64;
        for row in self.triangle() {
            squares.push(0.0);
            for (square, w) in squares.iter_mut().zip(row) {
                *square += w * w;
            }
            let along: f64 = row.iter().zip(&self.centre).map(|(w, x)| w * x).sum();
            of_intercept += along * along;
        }
        let intercept = (!self.centre.is_empty()).then_some(of_intercept);
        let sums = squares
            .into_iter()
            .map(|square| if square > 0.0 { square } else { f64::NAN });
        let all = intercept.into_iter().chain(sums);
        all.map(|square| (self.noise * square).sqrt()).collect()
    }

    /// The rows of `W`, each one longer than the one before it.
    fn triangle(&self) -> impl Iterator<Item = &[f64]> {
        let mut rest = self.root.as_slice();
        (1..).map_while(move |length| {
            let (row, below) = rest.split_at_checked(length)?;
            rest = below;
            Some(row)
        })
    }
}

impl LeastSquares {
    /// The variance about the predictions of a fit of the same columns, scales and rows.
    ///
    /// # Errors
    /// [`NumericsError::TooFewRows`] when there are no more rows than coefficients, [`NumericsError::NoConvergence`] when the
    /// normal equations cannot be factorised.
    pub fn prediction_variance(
        &self,
        gram: &Gram,
        scales: &[f64],
        fit: &LinearFit,
    ) -> Result<PredictionVariance, NumericsError> {
        let columns = &fit.columns;
        let problem = Problem::new(self.intercept, gram, columns, scales);
        let penalised = problem.penalised(self.alpha);
        let order = penalised.order();
        // What the rows do not determine at all must not make the whole unsolvable.
        let least = order as f64 / SINGULAR_BOUND.powi(2);
        let inverse = penalised
            .inverse_root(0.0)
            .or_else(|| penalised.inverse_root(least))
            .ok_or(NumericsError::NoConvergence)?;
        let squares: f64 = (0..order).map(|j| inverse.col(j).squared_norm_l2()).sum();
        // Of columns that are combinations of others the rows determine as many coefficients as there are directions.
        let determined = match fit.method {
            Method::Svd { rank } if self.alpha == 0.0 => rank as f64,
            _ => order as f64 - self.alpha * squares,
        };
        let effective = determined + f64::from(u8::from(self.intercept));
        let rows = gram.count();
        let free = rows as f64 - effective;
        if free <= 0.0 {
            return Err(NumericsError::TooFewRows {
                needed: effective.ceil() as u64 + 1,
                found: rows,
            });
        }
        let width = columns.len();
        let mut root = vec![0.0; width * (width + 1) / 2];
        for (i, &row) in problem.active.iter().enumerate() {
            for (j, &column) in problem.active[..=i].iter().enumerate() {
                let scale = scales[columns[column]];
                root[row * (row + 1) / 2 + column] = inverse[(i, j)] / scale;
            }
        }
        let means = gram.means();
        let centre = columns.iter().map(|&column| means[column]);
        Ok(PredictionVariance {
            noise: fit.residual_sum_of_squares / free,
            rows,
            centre: if self.intercept {
                centre.collect()
            } else {
                Vec::new()
            },
            root,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GramBlocks, Standardization, oracle};

    fn fitted(alpha: f64, columns: &[usize]) -> (LinearFit, PredictionVariance) {
        let rows = oracle::own_table("prediction_variance/rows.csv").numbers();
        let mut blocks = GramBlocks::new(4);
        for row in &rows {
            blocks.push(&row[..4], row[4]);
        }
        let gram = blocks.total();
        let scales = Standardization::of(&gram).scales;
        let squares = LeastSquares::ridge(alpha);
        let fit = squares
            .solve(&gram, columns, &scales, blocks.rows())
            .unwrap();
        let variance = squares.prediction_variance(&gram, &scales, &fit).unwrap();
        (fit, variance)
    }

    #[test]
    fn the_deviation_of_a_prediction_equals_the_oracle() {
        // The third column of the rows is constant and stands in the middle, so that its place must be kept.
        for (alpha, column) in [(0.0, 4), (5.0, 5)] {
            let (_, variance) = fitted(alpha, &[0, 1, 2, 3]);
            for row in oracle::own_table("prediction_variance/expected.csv").numbers() {
                let found = variance.at(&row[..4]).sqrt();
                let expected = row[column];
                assert!(
                    (found - expected).abs() < 1e-9 * expected,
                    "{found} instead of {expected} with a penalty of {alpha}"
                );
            }
        }
    }

    #[test]
    fn standard_errors_equal_the_oracle_and_a_constant_column_has_none() {
        let expected = oracle::own_table("prediction_variance/errors.csv").numbers();
        for (alpha, column) in [(0.0, 0), (5.0, 1)] {
            let (_, variance) = fitted(alpha, &[0, 1, 2, 3]);
            let mut found = variance.standard_errors();
            assert!(found.remove(3).is_nan());
            assert_eq!(found.len(), expected.len());
            for (found, expected) in found.iter().zip(&expected) {
                let expected = expected[column];
                assert!(
                    (found - expected).abs() < 1e-9 * expected,
                    "{found} instead of {expected} with a penalty of {alpha}"
                );
            }
        }
    }

    #[test]
    fn the_order_of_columns_changes_nothing() {
        let (_, one) = fitted(5.0, &[0, 1, 2, 3]);
        let (_, other) = fitted(5.0, &[3, 1, 0]);
        let (a, b) = (one.at(&[1.0, 2.0, 7.0, -1.0]), other.at(&[-1.0, 2.0, 1.0]));
        assert!((a - b).abs() < 1e-12 * a, "{a} and {b}");
    }

    #[test]
    fn columns_that_say_the_same_leave_the_variance_where_the_rows_are() {
        let mut blocks = GramBlocks::new(2);
        for i in 0..200 {
            let x = f64::from(i % 17);
            blocks.push(&[x, 2.0 * x], 3.0 * x + f64::from(i % 5));
        }
        let gram = blocks.total();
        let scales = Standardization::of(&gram).scales;
        let squares = LeastSquares::ordinary();
        let fit = squares
            .solve(&gram, &[0, 1], &scales, blocks.rows())
            .unwrap();
        let variance = squares.prediction_variance(&gram, &scales, &fit).unwrap();
        let (seen, unseen) = (variance.at(&[8.0, 16.0]), variance.at(&[8.0, 40.0]));
        assert!((seen / 2.0 - 1.0).abs() < 0.1, "{seen}");
        assert!(unseen > 1e3 * seen, "{unseen}");
    }

    #[test]
    fn a_column_that_says_nothing_new_costs_no_degree_of_freedom() {
        let mut blocks = GramBlocks::new(3);
        for i in 0..20 {
            let x = f64::from(i % 7);
            blocks.push(&[x, 2.0 * x, 3.0 - x], 3.0 * x + f64::from(i % 5));
        }
        let gram = blocks.total();
        let scales = Standardization::of(&gram).scales;
        let squares = LeastSquares::ordinary();
        let noise = |columns: &[usize]| {
            let fit = squares
                .solve(&gram, columns, &scales, blocks.rows())
                .unwrap();
            let variance = squares.prediction_variance(&gram, &scales, &fit).unwrap();
            (variance.noise, variance.at(&[4.0, 8.0, -1.0]))
        };
        let (one, all) = (noise(&[0]), noise(&[0, 1, 2]));
        assert!((all.0 / one.0 - 1.0).abs() < 1e-9, "{all:?} and {one:?}");
        assert!((all.1 / one.1 - 1.0).abs() < 1e-3, "{all:?} and {one:?}");
    }

    #[test]
    fn rows_that_are_no_more_than_coefficients_tell_no_variance() {
        let mut blocks = GramBlocks::new(2);
        for row in [[1.0, 0.0], [0.0, 1.0], [2.0, 5.0]] {
            blocks.push(&row, row[0]);
        }
        let gram = blocks.total();
        let squares = LeastSquares::ordinary();
        let fit = squares.solve(&gram, &[0, 1], &[1.0, 1.0], None).unwrap();
        let found = squares.prediction_variance(&gram, &[1.0, 1.0], &fit);
        assert_eq!(
            found,
            Err(NumericsError::TooFewRows {
                needed: 4,
                found: 3
            })
        );
    }
}
