//! Normal equations in scaled columns. Decides how they are set up, brought to a unit diagonal and solved, and how near to
//! singular they are; does not decide what is done then.

use crate::cholesky::inverse_of_factor;
use crate::orthogonal::Triangle;
use crate::{Gram, NumericsError, Rows};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

/// The normal equations of the columns that are not constant, in scaled columns.
pub(crate) struct Problem {
    /// Positions in the columns asked for.
    pub(crate) active: Vec<usize>,
    pub(crate) constant: Vec<usize>,
    scales: Vec<f64>,
    intercept: bool,
    /// `Xᵀ X`, scaled.
    pub(crate) gram: Mat<f64>,
    /// `Xᵀ y`, scaled.
    pub(crate) target: Vec<f64>,
    /// `yᵀ y`.
    pub(crate) spread: f64,
    /// `gram` brought to a unit diagonal.
    pub(crate) standard: Mat<f64>,
}

impl Problem {
    pub(crate) fn new(intercept: bool, gram: &Gram, columns: &[usize], scales: &[f64]) -> Self {
        let y = gram.width();
        let (moments, varies): (_, Vec<bool>) = if intercept {
            let varies = gram.variances().iter().map(|&v| v > 0.0).collect();
            (gram.moments(), varies)
        } else {
            let moments = gram.moments_about(&vec![0.0; y + 1]);
            let varies = (0..=y).map(|j| moments[(j, j)] > 0.0).collect();
            (moments, varies)
        };
        let (active, constant): (Vec<usize>, Vec<usize>) =
            (0..columns.len()).partition(|&k| varies[columns[k]]);
        let inverse: Vec<f64> = active.iter().map(|&k| 1.0 / scales[columns[k]]).collect();
        let order = active.len();
        let scaled = Mat::from_fn(order, order, |i, j| {
            moments[(columns[active[i]], columns[active[j]])] * (inverse[i] * inverse[j])
        });
        let target = (0..order).map(|i| moments[(columns[active[i]], y)] * inverse[i]);
        Self {
            target: target.collect(),
            scales: active.iter().map(|&k| scales[columns[k]]).collect(),
            constant,
            active,
            intercept,
            standard: Equilibrated::of(&scaled, 0.0).matrix,
            gram: scaled,
            spread: moments[(y, y)],
        }
    }

    pub(crate) fn penalised(&self, alpha: f64) -> Equilibrated {
        Equilibrated::of(&self.gram, alpha)
    }

    pub(crate) fn factorise(
        &self,
        gram: &Gram,
        columns: &[usize],
        rows: Rows<'_>,
    ) -> Result<Triangle, NumericsError> {
        let used: Vec<usize> = self.active.iter().map(|&k| columns[k]).collect();
        let centre: Vec<f64> = if self.intercept {
            let means = gram.means();
            let with_target = used.iter().copied().chain([gram.width()]);
            with_target.map(|j| means[j]).collect()
        } else {
            vec![0.0; used.len() + 1]
        };
        Triangle::of_rows(rows, &used, &centre, &self.scales)
    }

    /// `yᵀy − 2bᵀXᵀy + bᵀXᵀXb`, not below 0.
    pub(crate) fn residual_sum_of_squares(&self, b: &[f64]) -> f64 {
        let mut sum = self.spread;
        for (i, b_i) in b.iter().enumerate() {
            let fitted: f64 = (0..b.len()).map(|j| self.gram[(i, j)] * b[j]).sum();
            sum += b_i * (fitted - 2.0 * self.target[i]);
        }
        sum.max(0.0)
    }
}

/// A symmetric matrix brought to a unit diagonal: `D⁻¹ A D⁻¹`.
pub(crate) struct Equilibrated {
    pub(crate) matrix: Mat<f64>,
    roots: Vec<f64>,
}

impl Equilibrated {
    pub(crate) fn of(gram: &Mat<f64>, alpha: f64) -> Self {
        let order = gram.nrows();
        let roots: Vec<f64> = (0..order).map(|i| (gram[(i, i)] + alpha).sqrt()).collect();
        let matrix = Mat::from_fn(order, order, |i, j| {
            if i == j {
                1.0
            } else {
                gram[(i, j)] / roots[i] / roots[j]
            }
        });
        Self { matrix, roots }
    }

    pub(crate) fn order(&self) -> usize {
        self.roots.len()
    }

    /// `W` with `WᵀW` the inverse of the matrix as it was before it was brought to a unit diagonal, with `alpha` added to
    /// that; nothing when that is not positive definite.
    pub(crate) fn inverse_root(&self, alpha: f64) -> Option<Mat<f64>> {
        let mut matrix = self.matrix.clone();
        for i in 0..self.order() {
            matrix[(i, i)] += alpha;
        }
        let inverse = inverse_of_factor(&matrix)?;
        let order = self.order();
        Some(Mat::from_fn(order, order, |i, j| {
            inverse[(i, j)] / self.roots[j]
        }))
    }

    /// Solves with `alpha` added to the unit diagonal; nothing when that is not positive definite.
    pub(crate) fn solve(&self, target: &[f64], alpha: f64) -> Option<Vec<f64>> {
        let mut matrix = self.matrix.clone();
        for i in 0..self.order() {
            matrix[(i, i)] += alpha;
        }
        let factor = matrix.llt(Side::Lower).ok()?;
        let mut solution = Mat::from_fn(self.order(), 1, |i, _| target[i] / self.roots[i]);
        factor.solve_in_place(solution.as_mut());
        let coefficients: Vec<f64> = (0..self.order())
            .map(|i| solution[(i, 0)] / self.roots[i])
            .collect();
        coefficients
            .iter()
            .all(|b| b.is_finite())
            .then_some(coefficients)
    }
}

/// The condition number of the design whose Gram matrix this is: the root of the ratio of its extreme eigenvalues.
pub(crate) fn condition_of(gram: &Mat<f64>) -> Result<f64, NumericsError> {
    let values = gram
        .self_adjoint_eigenvalues(Side::Lower)
        .map_err(|_| NumericsError::NoConvergence)?;
    let (Some(&smallest), Some(&largest)) = (values.first(), values.last()) else {
        return Ok(1.0);
    };
    let rounding = f64::EPSILON * values.len() as f64 * largest;
    Ok(if smallest > rounding {
        (largest / smallest).sqrt()
    } else {
        f64::INFINITY
    })
}

/// The columns whose share that the ones before cannot explain is tiny, from a Cholesky factorisation in the order of the
/// columns that leaves such columns out. At least the one with the smallest share.
pub(crate) fn nearly_dependent(standard: &Mat<f64>, condition_bound: f64) -> Vec<usize> {
    let order = standard.nrows();
    let least = order as f64 / condition_bound.powi(2);
    let mut factor = Mat::<f64>::zeros(order, order);
    let mut kept: Vec<usize> = Vec::new();
    let mut dependent = Vec::new();
    let mut smallest = (f64::INFINITY, 0);
    for j in 0..order {
        for (at, &k) in kept.iter().enumerate() {
            let explained: f64 = kept[..at]
                .iter()
                .map(|&l| factor[(j, l)] * factor[(k, l)])
                .sum();
            factor[(j, k)] = (standard[(j, k)] - explained) / factor[(k, k)];
        }
        let share = 1.0 - kept.iter().map(|&k| factor[(j, k)].powi(2)).sum::<f64>();
        if share < smallest.0 {
            smallest = (share, j);
        }
        if share > least {
            factor[(j, j)] = share.sqrt();
            kept.push(j);
        } else {
            dependent.push(j);
        }
    }
    if dependent.is_empty() && order > 0 {
        dependent.push(smallest.1);
    }
    dependent
}
