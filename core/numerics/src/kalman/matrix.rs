//! The matrices of a filter, row by row in a slice. Decides how time and observations act on them; not when.

use super::Structural;

/// Below this share of what a row could at most say about states of which nothing is known, it says nothing about them.
pub(super) const NOTHING_NEW: f64 = 1e-9;

/// A matrix with these on its diagonal, row by row.
#[must_use]
pub(super) fn diagonal(values: &[f64]) -> Vec<f64> {
    let order = values.len();
    let mut matrix = vec![0.0; order * order];
    for (i, value) in values.iter().enumerate() {
        matrix[i * order + i] = *value;
    }
    matrix
}

/// How many directions of a diffuse covariance, given row by row, are diffuse: pivots of its elimination, largest first, each
/// state on its own scale.
pub(super) fn rank(mut matrix: Vec<f64>, order: usize) -> usize {
    let scales: Vec<f64> = (0..order)
        .map(|i| matrix[i * order + i].max(1.0).sqrt())
        .collect();
    for i in 0..order {
        for j in 0..order {
            matrix[i * order + j] /= scales[i] * scales[j];
        }
    }
    for found in 0..order {
        let own = |i: &usize| matrix[i * order + i];
        let pivot = (0..order).max_by(|a, b| own(a).total_cmp(&own(b)));
        let Some(pivot) = pivot.filter(|pivot| own(pivot) > NOTHING_NEW) else {
            return found;
        };
        let row = matrix[pivot * order..][..order].to_vec();
        for i in 0..order {
            for j in 0..order {
                matrix[i * order + j] -= row[i] * row[j] / row[pivot];
            }
        }
    }
    order
}

/// Adds `time` times the trend's row and column to those of the level.
#[inline]
pub(super) fn carry(matrix: &mut [f64], order: usize, time: f64) {
    for j in 0..order {
        matrix[j] += time * matrix[order + j];
    }
    for i in 0..order {
        matrix[i * order] += time * matrix[i * order + 1];
    }
}

/// Multiplies the row and column of the level by what is kept of it.
#[inline]
pub(super) fn shrink(matrix: &mut [f64], order: usize, kept: f64) {
    for j in 0..order {
        matrix[j] *= kept;
        matrix[j * order] *= kept;
    }
}

/// Multiplies a symmetric matrix by the row `(1, 0, x)` of an observation; the answer is the row times the product.
#[inline]
pub(super) fn product(matrix: &[f64], model: &Structural, x: &[f64], to: &mut [f64]) -> f64 {
    let (order, moving) = (to.len(), model.moving());
    for (to, row) in to.iter_mut().zip(matrix.chunks_exact(order)) {
        let terms = row[moving..].iter().zip(x);
        *to = terms.fold(row[0], |sum, (value, x)| sum + value * x);
    }
    let terms = to[moving..].iter().zip(x);
    terms.fold(to[0], |sum, (value, x)| sum + value * x)
}

/// An observation of the sum `z = (1, 0, x)ᵀs` of the states `s`.
pub(super) struct Observation<Shared, Left> {
    /// How many of the states it moves; what the others have in common stays.
    pub(super) states: usize,
    /// The variance of `z` after it.
    pub(super) variance: f64,
    /// The covariance of `z` and a state after it.
    pub(super) shared: Shared,
    /// What is left of an element of the covariance of the states.
    pub(super) left: Left,
}

impl<Shared: Fn(usize) -> f64, Left: Fn(usize, usize, f64) -> f64> Observation<Shared, Left> {
    /// Leaves of a covariance what an observation leaves of it, where nearly nothing of a large variance is left.
    ///
    /// The usual difference `P − PhhᵀP / F` rounds as much as `P` is large, and may come out negative (Bierman 1977, section
    /// V.2). Known to within the observation is `z` alone, and its variance and covariances are products, which round as much as they
    /// are large themselves. So of the states the one that makes most of `z` is written as `z` less the others, and the difference
    /// is taken of the others alone. None of those is known better than what it has in common with `z` says.
    pub(super) fn settle(
        &self,
        matrix: &mut [f64],
        model: &Structural,
        x: &[f64],
        sums: &mut [f64],
    ) {
        let (order, moving) = (sums.len(), model.moving());
        let weight = |i: usize| match i.checked_sub(moving) {
            Some(regressor) => x[regressor],
            None if i == 0 => 1.0,
            None => 0.0,
        };
        let part = |i: usize| weight(i).powi(2) * matrix[i * order + i];
        let pivot = (1..order).fold(0, |most, i| if part(i) > part(most) { i } else { most });
        sums.fill(0.0);
        for i in (0..order).filter(|&i| i != pivot) {
            for j in (0..order).filter(|&j| j != pivot) {
                let value = &mut matrix[i * order + j];
                let mut left = (self.left)(i, j, *value);
                if i == j {
                    let least = (self.shared)(i).powi(2) / self.variance;
                    left = left.max(0.0).max(least);
                }
                sums[j] += weight(i) * left;
                if i < self.states || j < self.states {
                    *value = left;
                }
            }
        }
        let own = weight(pivot);
        let mut variance = self.variance;
        for k in (0..order).filter(|&k| k != pivot) {
            let shared = (self.shared)(k);
            let left = shared - sums[k];
            variance -= weight(k) * (shared + left);
            if k < self.states || pivot < self.states {
                matrix[k * order + pivot] = left / own;
                matrix[pivot * order + k] = left / own;
            }
        }
        if pivot < self.states {
            matrix[pivot * order + pivot] = (variance / own / own).max(0.0);
        }
    }
}
