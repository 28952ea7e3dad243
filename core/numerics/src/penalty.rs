//! How large a ridge penalty should be. Decides how penalties are compared; does not decide which are, nor what is fitted
//! with the best.

use crate::checks::{check_columns, check_penalty, check_splits};
use crate::normal_equations::Problem;
use crate::quiet_folds::telling;
use crate::{Gram, NumericsError, Split};
use faer::{Mat, Side};

/// Penalties on a logarithmic scale, both ends among them, `per_decade` to each factor of ten or a little closer.
pub fn logarithmic_grid(smallest: f64, largest: f64, per_decade: u32) -> Vec<f64> {
    let ratio = largest / smallest;
    // A ratio beyond all numbers has a logarithm all the same.
    let decades = if ratio.is_finite() {
        ratio.log10()
    } else {
        largest.log10() - smallest.log10()
    };
    let steps = (decades * f64::from(per_decade)).ceil();
    if !(smallest > 0.0 && steps >= 1.0 && steps.is_finite()) {
        return vec![smallest];
    }
    let between = (0..steps as usize).map(|i| {
        let half = decades * i as f64 / steps / 2.0;
        if ratio.is_finite() {
            smallest * 10_f64.powf(decades * i as f64 / steps)
        } else {
            smallest * 10_f64.powf(half) * 10_f64.powf(half)
        }
    });
    between.chain([largest]).collect()
}

/// The generalised cross-validation score of each penalty, `n·Σe² / (n − d)²` with `d = 1 + Σ λ_i / (λ_i + α)` effective
/// coefficients, in squares of the target's unit; the smaller the better (Golub, Heath and Wahba 1979, equation 1.4).
///
/// # Errors
/// [`NumericsError::Parameter`], [`NumericsError::Column`], [`NumericsError::RepeatedColumn`], [`NumericsError::NotFinite`],
/// [`NumericsError::NoConvergence`].
pub fn generalised_cross_validation(
    gram: &Gram,
    columns: &[usize],
    scales: &[f64],
    alphas: &[f64],
) -> Result<Vec<f64>, NumericsError> {
    check(columns, gram.width(), alphas)?;
    if !gram.is_finite() {
        return Err(NumericsError::NotFinite);
    }
    let spectrum = Spectrum::of(gram, columns, scales)?;
    let n = gram.weight();
    let score = |&alpha: &f64| {
        let (mut explained, mut effective) = (0.0, 1.0);
        for (value, along) in spectrum.values.iter().zip(&spectrum.along) {
            let damped = value + alpha;
            if damped > 0.0 {
                explained += along * along * (damped + alpha) / (damped * damped);
                effective += value / damped;
            }
        }
        let left = n - effective;
        if left > 0.0 {
            // Written so that NaN stays one, and is no model without errors.
            let squares = spectrum.spread - explained;
            n * (if squares < 0.0 { 0.0 } else { squares }) / (left * left)
        } else {
            f64::INFINITY
        }
    };
    Ok(alphas.iter().map(score).collect())
}

/// The score of each penalty in each fold but the [quiet](crate::quiet_folds) ones: `R²` on its test rows of the model of its
/// training rows.
///
/// # Errors
/// As [`generalised_cross_validation`], and [`NumericsError::Folds`], [`NumericsError::Scale`], [`NumericsError::Width`].
pub fn cross_validated_penalties(
    splits: &[Split],
    columns: &[usize],
    scales: &[f64],
    alphas: &[f64],
) -> Result<Vec<Vec<f64>>, NumericsError> {
    check_splits(splits, scales)?;
    check(columns, scales.len(), alphas)?;
    let mut scores = vec![Vec::with_capacity(splits.len()); alphas.len()];
    for split in telling(splits) {
        let spectrum = Spectrum::of(&split.train, columns, scales)?;
        let test = TestMoments::of(split, &spectrum.columns, scales);
        let turned = spectrum.vectors.transpose() * &test.cross * &spectrum.vectors;
        let target = spectrum.vectors.transpose() * &test.target;
        for (alpha, scores) in alphas.iter().zip(&mut scores) {
            let weights: Vec<f64> = spectrum
                .values
                .iter()
                .zip(&spectrum.along)
                .map(|(value, along)| {
                    let damped = value + alpha;
                    if damped > 0.0 { along / damped } else { 0.0 }
                })
                .collect();
            let errors = test.errors(&turned, &target, &weights);
            scores.push(test.r2(errors));
        }
    }
    Ok(scores)
}

fn check(columns: &[usize], width: usize, alphas: &[f64]) -> Result<(), NumericsError> {
    check_columns(columns, width)?;
    alphas.iter().try_for_each(|&alpha| check_penalty(alpha))
}

/// Normal equations along their own axes.
struct Spectrum {
    /// The columns that vary.
    columns: Vec<usize>,
    vectors: Mat<f64>,
    /// The eigenvalues, not negative.
    values: Vec<f64>,
    /// The target along each axis.
    along: Vec<f64>,
    spread: f64,
}

impl Spectrum {
    fn of(gram: &Gram, columns: &[usize], scales: &[f64]) -> Result<Self, NumericsError> {
        let problem = Problem::new(true, gram, columns, scales);
        let order = problem.active.len();
        let (vectors, values) = if order == 0 {
            (Mat::zeros(0, 0), Vec::new())
        } else {
            let eigen = problem
                .gram
                .self_adjoint_eigen(Side::Lower)
                .map_err(|_| NumericsError::NoConvergence)?;
            let values = eigen.S().column_vector();
            // What rounding leaves of a direction that is not there.
            let least = f64::EPSILON * order as f64 * values[order - 1].max(0.0);
            let kept = |value: f64| if value > least { value } else { 0.0 };
            (
                eigen.U().to_owned(),
                (0..order).map(|k| kept(values[k])).collect(),
            )
        };
        let along = (0..order).map(|k| {
            let terms = problem.target.iter().enumerate();
            if values[k] > 0.0 {
                terms.map(|(i, target)| vectors[(i, k)] * target).sum()
            } else {
                0.0
            }
        });
        Ok(Self {
            along: along.collect(),
            columns: problem.active.iter().map(|&k| columns[k]).collect(),
            vectors,
            values,
            spread: problem.spread,
        })
    }
}

/// The test rows of a fold about the training means, in scaled columns.
pub(crate) struct TestMoments {
    pub(crate) cross: Mat<f64>,
    pub(crate) target: Mat<f64>,
    squares: f64,
    spread: f64,
}

impl TestMoments {
    pub(crate) fn of(split: &Split, columns: &[usize], scales: &[f64]) -> Self {
        let moments = split.test.moments_about(&split.train.means());
        let y = split.test.width();
        let order = columns.len();
        Self {
            cross: Mat::from_fn(order, order, |i, j| {
                moments[(columns[i], columns[j])] / (scales[columns[i]] * scales[columns[j]])
            }),
            target: Mat::from_fn(order, 1, |i, _| {
                moments[(columns[i], y)] / scales[columns[i]]
            }),
            squares: moments[(y, y)],
            spread: split.test.variances()[y] * split.test.weight(),
        }
    }

    /// The squared errors of a model with these weights, all in one basis.
    pub(crate) fn errors(&self, cross: &Mat<f64>, target: &Mat<f64>, weights: &[f64]) -> f64 {
        let mut errors = self.squares;
        for (i, w) in weights.iter().enumerate() {
            let fitted: f64 = weights
                .iter()
                .enumerate()
                .map(|(j, v)| cross[(i, j)] * v)
                .sum();
            errors += w * (fitted - 2.0 * target[(i, 0)]);
        }
        // Written so that NaN stays one, and is no model without errors.
        if errors < 0.0 { 0.0 } else { errors }
    }

    /// `R²` as [`crate::SelectionScore::R2`] has it.
    pub(crate) fn r2(&self, errors: f64) -> f64 {
        if self.spread > 0.0 {
            1.0 - errors / self.spread
        } else {
            f64::from(u8::from(errors == 0.0))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Folds, GramBlocks, LeastSquares, Standardization, oracle};

    fn own() -> (GramBlocks, serde_json::Value) {
        let mut blocks = GramBlocks::new(12);
        for row in oracle::own_table("selection/input.csv").numbers() {
            blocks.push(&row[..12], row[12]);
        }
        let text = oracle::own_text("penalties/expected.json");
        (blocks, serde_json::from_str(&text).unwrap())
    }

    const ALL: [usize; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];

    fn number(value: &serde_json::Value) -> f64 {
        value.as_f64().unwrap()
    }

    #[test]
    fn generalised_cross_validation_is_that_of_the_own_oracle() {
        let (blocks, expected) = own();
        let gram = blocks.total();
        let scales = Standardization::of(&gram).scales;
        for row in expected["penalties"].as_array().unwrap() {
            let alpha = number(&row["alpha"]);
            let found = generalised_cross_validation(&gram, &ALL, &scales, &[alpha]).unwrap();
            assert!(
                (found[0] / number(&row["gcv"]) - 1.0).abs() < 1e-10,
                "{alpha}"
            );
        }
    }

    #[test]
    fn the_scores_of_all_folds_are_those_of_the_own_oracle() {
        let (blocks, expected) = own();
        let scales = Standardization::of(&blocks.total()).scales;
        let splits = blocks.splits(&Folds::contiguous(5)).unwrap();
        for row in expected["penalties"].as_array().unwrap() {
            let alpha = number(&row["alpha"]);
            let found = cross_validated_penalties(&splits, &ALL, &scales, &[alpha]).unwrap();
            let wanted = row["folds"].as_array().unwrap();
            assert_eq!(found[0].len(), wanted.len());
            for (score, wanted) in found[0].iter().zip(wanted) {
                assert!((score - number(wanted)).abs() < 1e-10, "{alpha}");
            }
        }
    }

    #[test]
    fn without_a_penalty_collinear_columns_do_not_spoil_the_score() {
        let mut blocks = GramBlocks::new(3);
        for i in 0..600 {
            let (a, b) = ((0.37 * f64::from(i)).sin(), (0.11 * f64::from(i)).cos());
            blocks.push(&[a, a, 4.0], 2.0 * a + b);
        }
        let gram = blocks.total();
        let fit = LeastSquares::ordinary()
            .solve(&gram, &[0], &[1.0; 3], None)
            .unwrap();
        let found = generalised_cross_validation(&gram, &[0, 1, 2], &[1.0; 3], &[0.0]).unwrap();
        let by_hand = 600.0 * fit.residual_sum_of_squares / (598.0 * 598.0);
        assert!((found[0] / by_hand - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_grid_has_both_ends_and_even_steps() {
        let grid = logarithmic_grid(1e-2, 1e3, 2);
        assert_eq!((grid.len(), grid[0], grid[10]), (11, 1e-2, 1e3));
        for pair in grid.windows(2) {
            assert!((pair[1] / pair[0] - 10_f64.sqrt()).abs() < 1e-12);
        }
        assert_eq!(logarithmic_grid(1.0, 1.0, 4), [1.0]);
    }

    #[test]
    fn a_grid_may_span_more_than_the_largest_number() {
        let grid = logarithmic_grid(1e-200, 1e200, 1);
        assert_eq!((grid.len(), grid[0], grid[400]), (401, 1e-200, 1e200));
        for pair in grid.windows(2) {
            assert!((pair[1] / pair[0] / 10.0 - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_fold_in_which_the_target_hardly_changes_has_no_part_in_a_score() {
        let mut blocks = GramBlocks::new(1);
        for i in 0..300 {
            let x = (0.37 * f64::from(i)).sin();
            let jitter = 1e-9 * (0.11 * f64::from(i)).cos();
            blocks.push(
                &[x],
                if i < 100 {
                    jitter
                } else {
                    2.0 * x + (7.0 * x).cos()
                },
            );
        }
        let splits = blocks.splits(&Folds::contiguous(3)).unwrap();
        assert_eq!(crate::quiet_folds(&splits), [0]);
        let found = cross_validated_penalties(&splits, &[0], &[1.0], &[1.0]).unwrap();
        let of_the_others = cross_validated_penalties(&splits[1..], &[0], &[1.0], &[1.0]).unwrap();
        assert_eq!(found, of_the_others);
        assert!(found[0].iter().all(|score| *score > 0.1), "{found:?}");
        let sparse = crate::ElasticNet {
            alpha: 0.0,
            l1_ratio: 1.0,
            target_scale: 1.0,
        };
        let found = sparse
            .cross_validated(&splits, &[0], &[1.0], &[0.1])
            .unwrap();
        assert_eq!(found[0].len(), 2);
    }
}
