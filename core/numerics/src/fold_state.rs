//! One fold of a stepwise selection. Decides how the fold's statistics follow a change of the chosen set and what a
//! candidate would score; does not decide which candidate is taken.

use crate::{SelectionScore, Split};
use std::ops::Range;

/// A candidate whose variance, given the chosen ones, is below this share of its own cannot be told from a combination of
/// them.
const COLLINEAR_SHARE: f64 = 1e-11;

/// Training and test moments of one fold, both about the training means.
///
/// The training moments (plus the penalty on the diagonal) are swept by the chosen columns (Goodnight 1979, "A tutorial
/// on the sweep operator"), and the test moments are written in the matching basis: a column not chosen stands for its
/// residual given the chosen ones, the target for the residual of the current model. So a candidate's test error needs
/// three numbers, whatever the number of chosen columns. Rows of chosen columns are not updated any more. Kept up, they
/// would stand for dual vectors, and taking a column out again would be the same score and the same sweep.
pub(crate) struct FoldState {
    order: usize,
    /// Row-major, lower triangles.
    train: Vec<f64>,
    test: Vec<f64>,
    /// The diagonal of the training moments before any sweep; 0 for a column that is constant in training.
    own: Vec<f64>,
    chosen: Vec<bool>,
    test_weight: f64,
    /// Sum of squares of the target about the mean of the test rows.
    test_spread: f64,
    multiplier: Vec<f64>,
    pivot_row: Vec<f64>,
    test_row: Vec<f64>,
}

impl FoldState {
    /// `scales` has one positive value per regressor; `alpha` is the penalty on the scaled coefficients.
    pub(crate) fn new(split: &Split, scales: &[f64], alpha: f64) -> Self {
        let (train, test) = (&split.train, &split.test);
        let order = train.width() + 1;
        let target = order - 1;
        let centre = train.mean_offsets();
        let train_moments = train.moments_off_shift(&centre);
        let test_moments = match (train.shift(), test.shift()) {
            (Some(a), Some(b)) if a == b => test.moments_off_shift(&centre),
            _ => test.moments_about(&train.means()),
        };
        let inverse: Vec<f64> = scales.iter().map(|s| 1.0 / s).chain([1.0]).collect();
        let variances = train.variances();
        let mut own = Vec::with_capacity(order);
        let mut packed = [Vec::new(), Vec::new()];
        for (triangle, moments) in packed.iter_mut().zip([&train_moments, &test_moments]) {
            triangle.reserve_exact(order * (order + 1) / 2);
            for i in 0..order {
                triangle.extend((0..=i).map(|j| moments[(i, j)] * (inverse[i] * inverse[j])));
            }
        }
        let [mut train_triangle, test_triangle] = packed;
        for j in 0..target {
            let diagonal = &mut train_triangle[row(j).end - 1];
            *diagonal += alpha;
            own.push(if variances[j] > 0.0 { *diagonal } else { 0.0 });
        }
        let test_variance = test.variances()[target];
        Self {
            order,
            train: train_triangle,
            test: test_triangle,
            own,
            chosen: vec![false; order],
            test_weight: test.weight(),
            test_spread: test_variance * test.weight(),
            multiplier: vec![0.0; order],
            pivot_row: vec![0.0; order],
            test_row: vec![0.0; order],
        }
    }

    /// Whether the column varies in the training rows at all. One that does not has the coefficient 0 in this fold.
    pub(crate) fn varies(&self, column: usize) -> bool {
        self.own[column] > 0.0
    }

    /// The test score with `column` in addition, NaN when it is a combination of the chosen ones.
    pub(crate) fn score(&self, column: usize, score: SelectionScore) -> f64 {
        let target = row(self.order - 1).start;
        let test_target = self.test[target + self.order - 1];
        let errors = if self.varies(column) {
            let pivot = self.train[row(column).end - 1];
            if pivot <= COLLINEAR_SHARE * self.own[column] {
                return f64::NAN;
            }
            let slope = self.train[target + column] / pivot;
            let own = self.test[row(column).end - 1];
            test_target - slope * (2.0 * self.test[target + column] - slope * own)
        } else {
            test_target
        };
        let errors = if errors < 0.0 { 0.0 } else { errors };
        match score {
            SelectionScore::NegativeRmse => -(errors / self.test_weight).sqrt(),
            SelectionScore::R2 if self.test_spread > 0.0 => 1.0 - errors / self.test_spread,
            SelectionScore::R2 => f64::from(u8::from(errors == 0.0)),
        }
    }

    /// Takes `column` into the chosen set.
    pub(crate) fn include(&mut self, column: usize) {
        if !self.varies(column) {
            return;
        }
        let pivot = self.train[row(column).end - 1];
        let test_pivot = self.test[row(column).end - 1];
        copy_line(&self.train, column, &mut self.pivot_row);
        copy_line(&self.test, column, &mut self.test_row);
        self.chosen[column] = true;
        for i in 0..self.order {
            self.multiplier[i] = self.pivot_row[i] / pivot;
            self.test_row[i] -= 0.5 * self.multiplier[i] * test_pivot;
        }
        for i in 0..self.order {
            if self.chosen[i] {
                continue;
            }
            let (b, t) = (self.multiplier[i], self.test_row[i]);
            let n = i + 1;
            subtract(&mut self.train[row(i)], b, &self.pivot_row[..n]);
            let test = &mut self.test[row(i)];
            subtract_both(test, b, &self.test_row[..n], t, &self.multiplier[..n]);
        }
    }
}

/// `values − factor · line`.
fn subtract(values: &mut [f64], factor: f64, line: &[f64]) {
    for (value, p) in values.iter_mut().zip(line) {
        *value -= factor * p;
    }
}

/// `values − (b · t_line + t · b_line)`.
fn subtract_both(values: &mut [f64], b: f64, t_line: &[f64], t: f64, b_line: &[f64]) {
    for ((value, t_j), b_j) in values.iter_mut().zip(t_line).zip(b_line) {
        *value -= b * t_j + t * b_j;
    }
}

/// Where row `i` of a packed lower triangle lies; its diagonal is the last.
fn row(i: usize) -> Range<usize> {
    let start = i * (i + 1) / 2;
    start..start + i + 1
}

/// A whole row of the symmetric matrix whose lower triangle is given.
fn copy_line(triangle: &[f64], line: usize, out: &mut [f64]) {
    out[..=line].copy_from_slice(&triangle[row(line)]);
    for (i, value) in out.iter_mut().enumerate().skip(line + 1) {
        *value = triangle[row(i).start + line];
    }
}
