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
