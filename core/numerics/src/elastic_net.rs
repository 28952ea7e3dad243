//! Least squares with a penalty on absolute coefficients. Decides how such coefficients are found; does not decide how large
//! the penalty is.

use crate::active_set::ActiveSet;
use crate::checks::{check_columns, check_parameter, check_penalty, check_scale, check_splits};
use crate::normal_equations::Problem;
use crate::penalty::TestMoments;
use crate::quiet_folds::telling;
use crate::{Gram, NumericsError, Split};

/// Minimises `1/(2n) Σ(y − b₀ − xᵀb)² + α (ρ t Σ|s_j b_j| + (1 − ρ)/2 Σ(s_j b_j)²)` with column scales `s` and a scale `t` of the
/// target, on the Gram matrix. `ρ = 1` is the lasso. With the scale of the target, the same penalty means the same in all units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElasticNet {
    /// The penalty `α`, on the *mean* of squares, unlike that of ridge.
    pub alpha: f64,
    /// The share `ρ` of the absolute values, above 0 up to 1.
    pub l1_ratio: f64,
    /// The scale `t` of the target, in its unit, above 0.
    pub target_scale: f64,
}

/// A sparse linear model on the original scale of its columns.
#[derive(Debug, Clone, PartialEq)]
pub struct SparseFit {
    /// One coefficient per column that was asked for, many of them 0.
    pub coefficients: Vec<f64>,
    /// The intercept in target units.
    pub intercept: f64,
    /// The sum of the squared residuals, without the penalty.
    pub residual_sum_of_squares: f64,
    /// Whether the search came to its end.
    pub converged: bool,
}

impl ElasticNet {
    /// Fits `columns` of the rows in `gram`. `scales` has one positive value per regressor of the rows, used or not.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`], [`NumericsError::Column`], [`NumericsError::RepeatedColumn`], [`NumericsError::Scale`],
    /// [`NumericsError::TooFewRows`] without rows, [`NumericsError::NotFinite`].
    pub fn solve(
        &self,
        gram: &Gram,
        columns: &[usize],
        scales: &[f64],
    ) -> Result<SparseFit, NumericsError> {
        self.check(gram, columns, scales)?;
        let problem = Problem::new(true, gram, columns, scales);
        let mut search = ActiveSet::new(&problem, gram.weight());
        let converged = self.search(&mut search, self.alpha);
        let mut coefficients = vec![0.0; columns.len()];
        for (&k, weight) in problem.active.iter().zip(&search.weights) {
            coefficients[k] = weight / scales[columns[k]];
        }
        let means = gram.means();
        let terms = columns.iter().zip(&coefficients);
        Ok(SparseFit {
            intercept: terms.fold(means[gram.width()], |rest, (&j, b)| rest - b * means[j]),
            residual_sum_of_squares: problem.residual_sum_of_squares(&search.weights),
            coefficients,
            converged,
        })
    }

    /// The smallest penalty for which all coefficients are 0.
    ///
    /// # Errors
    /// As [`ElasticNet::solve`].
    pub fn largest_alpha(
        &self,
        gram: &Gram,
        columns: &[usize],
        scales: &[f64],
    ) -> Result<f64, NumericsError> {
        self.check(gram, columns, scales)?;
        let problem = Problem::new(true, gram, columns, scales);
        let largest = problem.target.iter().fold(0.0_f64, |l, t| l.max(t.abs()));
        Ok(largest / gram.weight() / (self.l1_ratio * self.target_scale))
    }

    /// The score of each penalty in each fold but the [quiet](crate::quiet_folds) ones: `R²` on its test rows of the model of its
    /// training rows.
    ///
    /// # Errors
    /// As [`ElasticNet::solve`], and [`NumericsError::Folds`], [`NumericsError::Width`].
    pub fn cross_validated(
        &self,
        splits: &[Split],
        columns: &[usize],
        scales: &[f64],
        alphas: &[f64],
    ) -> Result<Vec<Vec<f64>>, NumericsError> {
        check_splits(splits, scales)?;
        let mut order: Vec<usize> = (0..alphas.len()).collect();
        // From the largest on, each solution is a good start for the next.
        order.sort_by(|&a, &b| alphas[b].total_cmp(&alphas[a]));
        let mut scores = vec![Vec::with_capacity(splits.len()); alphas.len()];
        for split in telling(splits) {
            self.check(&split.train, columns, scales)?;
            let problem = Problem::new(true, &split.train, columns, scales);
            let used: Vec<usize> = problem.active.iter().map(|&k| columns[k]).collect();
            let test = TestMoments::of(split, &used, scales);
            let mut search = ActiveSet::new(&problem, split.train.weight());
            for &at in &order {
                check_penalty(alphas[at])?;
                self.search(&mut search, alphas[at]);
                let errors = test.errors(&test.cross, &test.target, &search.weights);
                scores[at].push(test.r2(errors));
            }
        }
        Ok(scores)
    }

    fn search(&self, search: &mut ActiveSet<'_>, alpha: f64) -> bool {
        let threshold = alpha * self.l1_ratio * self.target_scale;
        search.run(threshold, alpha * (1.0 - self.l1_ratio))
    }

    fn check(&self, gram: &Gram, columns: &[usize], scales: &[f64]) -> Result<(), NumericsError> {
        check_penalty(self.alpha)?;
        let fine = self.l1_ratio > 0.0 && self.l1_ratio <= 1.0;
        check_parameter("l1_ratio", self.l1_ratio, fine, "above 0 up to 1")?;
        let scale = self.target_scale;
        let fine = scale > 0.0 && scale.is_finite();
        check_parameter("target_scale", scale, fine, "above 0")?;
        if scales.len() != gram.width() {
            return Err(NumericsError::Width {
                expected: gram.width(),
                found: scales.len(),
            });
        }
        check_columns(columns, gram.width())?;
        for &column in columns {
            check_scale(column, scales[column])?;
        }
        if !gram.is_finite() {
            return Err(NumericsError::NotFinite);
        }
        if gram.count() == 0 || gram.weight() <= 0.0 {
            return Err(NumericsError::TooFewRows {
                needed: 1,
                found: gram.count(),
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Folds, GramBlocks, Standardization, oracle};

    /// The rows, the scales of their columns, that of the target, and what is expected.
    fn own() -> (GramBlocks, Vec<f64>, f64, serde_json::Value) {
        let mut blocks = GramBlocks::new(12);
        for row in oracle::own_table("selection/input.csv").numbers() {
            blocks.push(&row[..12], row[12]);
        }
        let gram = blocks.total();
        let scales = Standardization::of(&gram).scales;
        let target_scale = gram.variances()[12].sqrt();
        let text = oracle::own_text("penalties/expected.json");
        let expected = serde_json::from_str(&text).unwrap();
        (blocks, scales, target_scale, expected)
    }

    const ALL: [usize; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];

    #[test]
    fn the_coefficients_are_those_of_the_own_oracle() {
        let (blocks, scales, target_scale, expected) = own();
        let gram = blocks.total();
        let models = expected["elastic_net"].as_array().unwrap();
        for model in models {
            let number = |key: &str| model[key].as_f64().unwrap();
            let how = ElasticNet {
                alpha: number("alpha"),
                l1_ratio: number("l1_ratio"),
                target_scale,
            };
            let fit = how.solve(&gram, &ALL, &scales).unwrap();
            assert!(fit.converged);
            assert!((fit.intercept - number("intercept")).abs() < 1e-8);
            for (found, wanted) in fit
                .coefficients
                .iter()
                .zip(model["coef"].as_array().unwrap())
            {
                assert!((found - wanted.as_f64().unwrap()).abs() < 1e-8, "{how:?}");
            }
            let zeros = fit.coefficients.iter().filter(|b| **b == 0.0).count();
            assert_eq!(zeros as u64, model["zeros"]);
        }
        assert!(models.len() >= 4);
    }

    #[test]
    fn the_scores_of_all_folds_are_those_of_the_own_oracle() {
        let (blocks, scales, target_scale, expected) = own();
        let splits = blocks.splits(&Folds::contiguous(5)).unwrap();
        let lasso = ElasticNet {
            alpha: 0.0,
            l1_ratio: 1.0,
            target_scale,
        };
        let rows = expected["lasso_folds"].as_array().unwrap();
        let alphas: Vec<f64> = rows
            .iter()
            .map(|row| row["alpha"].as_f64().unwrap())
            .collect();
        let found = lasso
            .cross_validated(&splits, &ALL, &scales, &alphas)
            .unwrap();
        for (scores, row) in found.iter().zip(rows) {
            for (score, wanted) in scores.iter().zip(row["folds"].as_array().unwrap()) {
                assert!((score - wanted.as_f64().unwrap()).abs() < 1e-8);
            }
        }
        let largest = lasso.largest_alpha(&blocks.total(), &ALL, &scales).unwrap();
        assert!((largest / expected["largest_alpha"].as_f64().unwrap() - 1.0).abs() < 1e-10);
    }

    #[test]
    fn of_columns_that_are_combinations_of_others_the_cheapest_are_used() {
        let mut blocks = GramBlocks::new(4);
        for i in 0..600 {
            let (a, b) = ((0.37 * f64::from(i)).sin(), (0.11 * f64::from(i)).cos());
            blocks.push(&[a, b, a + b, a], 3.0 * (a + b));
        }
        let gram = blocks.total();
        for alpha in [1e-6, 1e-3, 0.1] {
            let lasso = ElasticNet {
                alpha,
                l1_ratio: 1.0,
                target_scale: 1.0,
            };
            let fit = lasso.solve(&gram, &[0, 1, 2, 3], &[1.0; 4]).unwrap();
            assert!(fit.converged);
            let found = &fit.coefficients;
            let others = [found[0], found[1], found[3]];
            assert!(others.iter().all(|b| b.abs() < 1e-9), "{found:?}");
            assert!(found[2] > 2.5 && found[2] < 3.0, "{found:?}");
        }
        let unpenalised = ElasticNet {
            alpha: 0.0,
            l1_ratio: 1.0,
            target_scale: 1.0,
        };
        let fit = unpenalised.solve(&gram, &[0, 1, 2, 3], &[1.0; 4]).unwrap();
        assert!(fit.converged && fit.residual_sum_of_squares < 1e-9);
    }

    #[test]
    fn wrong_requests_are_refused() {
        let (blocks, scales, target_scale, _) = own();
        let gram = blocks.total();
        let solve = |alpha, l1_ratio| {
            let how = ElasticNet {
                alpha,
                l1_ratio,
                target_scale,
            };
            how.solve(&gram, &ALL, &scales)
        };
        assert!(solve(f64::NAN, 1.0).is_err());
        assert!(solve(1.0, 0.0).is_err());
        assert!(solve(1.0, f64::NAN).is_err());
        assert!(solve(1.0, 0.5).is_ok());
    }
}
