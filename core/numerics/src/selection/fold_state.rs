//! One fold of a stepwise selection. Decides how the fold's statistics follow a change of the chosen set and what a
//! candidate would score; does not decide which candidate is taken.

use super::{Change, SelectionScore};
use crate::Split;
use std::ops::Range;

/// A candidate whose variance, given the chosen ones, is below this share of its own cannot be distinguished from a combination of
/// them.
const COLLINEAR_SHARE: f64 = 1e-11;

/// After so many sweeps the moments are computed anew, so that rounding does not gather.
const MOST_SWEEPS: usize = 256;

/// Training and test moments of one fold, both about the training means.
///
/// The training moments (plus the penalty on the diagonal) are swept by the chosen columns (Goodnight 1979, "A tutorial
/// on the sweep operator"), and the test moments are written in the matching basis: a column not chosen stands for its
/// residual given the chosen ones, a chosen one for its dual vector, the target for the residual of the current model. So
/// a candidate's test error needs three numbers, whatever the number of chosen columns, and taking a column out again is
/// the same score and the same sweep. Where nothing is ever taken out, the rows of chosen columns are left as they are.
pub(super) struct FoldState {
    order: usize,
    /// Row-major, lower triangles.
    train: Vec<f64>,
    test: Vec<f64>,
    /// The same before any sweep, where columns may be taken out again.
    unswept: Option<(Vec<f64>, Vec<f64>)>,
    sweeps: usize,
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
    pub(super) fn new(split: &Split, scales: &[f64], alpha: f64, reversible: bool) -> Self {
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
            unswept: reversible.then(|| (train_triangle.clone(), test_triangle.clone())),
            train: train_triangle,
            test: test_triangle,
            sweeps: 0,
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
    pub(super) fn varies(&self, column: usize) -> bool {
        self.own[column] > 0.0
    }

    /// Whether the column cannot be distinguished from a combination of the chosen ones.
    pub(super) fn combines(&self, column: usize) -> bool {
        self.varies(column)
            && !self.chosen[column]
            && self.train[row(column).end - 1] <= COLLINEAR_SHARE * self.own[column]
    }

    /// The test score as it stands.
    pub(super) fn present_score(&self, score: SelectionScore) -> f64 {
        self.scaled(self.test[row(self.order - 1).end - 1], score)
    }

    /// The test score once these columns are added or taken out; NaN when all to be added are combinations of the chosen
    /// ones.
    pub(super) fn score(&self, columns: &[usize], change: Change, score: SelectionScore) -> f64 {
        let concerned = |column: usize| {
            self.varies(column) && self.chosen[column] == (change == Change::Removed)
        };
        match *columns {
            [column] if concerned(column) => self.score_of_one(column, score),
            [_] => self.present_score(score),
            _ => {
                let concerned: Vec<usize> =
                    columns.iter().copied().filter(|&c| concerned(c)).collect();
                self.score_of_all(&concerned, score)
            }
        }
    }

    fn score_of_one(&self, column: usize, score: SelectionScore) -> f64 {
        if self.combines(column) {
            return f64::NAN;
        }
        let target = row(self.order - 1).start;
        let test_target = self.test[target + self.order - 1];
        let pivot = self.train[row(column).end - 1];
        let slope = self.train[target + column] / pivot;
        let own = self.test[row(column).end - 1];
        let errors = test_target - slope * (2.0 * self.test[target + column] - slope * own);
        self.scaled(errors, score)
    }

    fn score_of_all(&self, columns: &[usize], score: SelectionScore) -> f64 {
        let local: Vec<usize> = columns.iter().copied().chain([self.order - 1]).collect();
        let order = local.len();
        let part = |triangle: &[f64]| -> Vec<f64> {
            let pairs = local
                .iter()
                .flat_map(|&i| local.iter().map(move |&j| (i.max(j), i.min(j))));
            pairs.map(|(i, j)| triangle[row(i).start + j]).collect()
        };
        let (mut train, test) = (part(&self.train), part(&self.test));
        let mut swept = Vec::with_capacity(order);
        for (pivot_at, &column) in local[..order - 1].iter().enumerate() {
            let pivot = train[pivot_at * order + pivot_at];
            let independent = self.chosen[column] || pivot > COLLINEAR_SHARE * self.own[column];
            swept.push(independent);
            if !independent {
                continue;
            }
            let line: Vec<f64> = (0..order).map(|k| train[pivot_at * order + k]).collect();
            for i in (0..order).filter(|&i| i != pivot_at) {
                let factor = line[i] / pivot;
                for (value, p) in train[i * order..(i + 1) * order].iter_mut().zip(&line) {
                    *value -= factor * p;
                }
                train[i * order + pivot_at] = factor;
            }
            for (k, value) in line.iter().enumerate() {
                train[pivot_at * order + k] = value / pivot;
            }
            train[pivot_at * order + pivot_at] = -1.0 / pivot;
        }
        if order > 1 && !swept.contains(&true) {
            return f64::NAN;
        }
        // The target's new residual is the old one less these shares of the columns.
        let last = (order - 1) * order;
        let shares = (0..order - 1).map(|k| if swept[k] { train[last + k] } else { 0.0 });
        let combination: Vec<f64> = shares.map(|share| -share).chain([1.0]).collect();
        let errors = (0..order)
            .flat_map(|i| (0..order).map(move |j| (i, j)))
            .map(|(i, j)| combination[i] * combination[j] * test[i * order + j])
            .sum();
        self.scaled(errors, score)
    }

    fn scaled(&self, errors: f64, score: SelectionScore) -> f64 {
        let errors = if errors < 0.0 { 0.0 } else { errors };
        match score {
            SelectionScore::NegativeRmse => -(errors / self.test_weight).sqrt(),
            SelectionScore::R2 if self.test_spread > 0.0 => 1.0 - errors / self.test_spread,
            SelectionScore::R2 => f64::from(u8::from(errors == 0.0)),
        }
    }

    /// Takes `column` into the chosen set, or out of it. One that is a combination of the chosen ones stays out.
    pub(super) fn turn(&mut self, column: usize, change: Change) {
        let there = self.chosen[column];
        if there != (change == Change::Removed) || !self.varies(column) || self.combines(column) {
            return;
        }
        self.chosen[column] = !there;
        self.sweeps += 1;
        match &self.unswept {
            Some((train, test)) if self.sweeps > MOST_SWEEPS => {
                self.train.clone_from(train);
                self.test.clone_from(test);
                let chosen: Vec<usize> = (0..self.order).filter(|&c| self.chosen[c]).collect();
                self.sweeps = chosen.len();
                self.chosen.fill(false);
                for column in chosen {
                    self.chosen[column] = true;
                    self.sweep(column);
                }
            }
            _ => self.sweep(column),
        }
    }

    fn sweep(&mut self, column: usize) {
        let pivot = self.train[row(column).end - 1];
        let test_pivot = self.test[row(column).end - 1];
        copy_line(&self.train, column, &mut self.pivot_row);
        copy_line(&self.test, column, &mut self.test_row);
        for i in 0..self.order {
            self.multiplier[i] = self.pivot_row[i] / pivot;
            self.test_row[i] -= 0.5 * self.multiplier[i] * test_pivot;
        }
        let reversible = self.unswept.is_some();
        for i in 0..self.order {
            if !reversible && self.chosen[i] {
                continue;
            }
            let (b, t) = (self.multiplier[i], self.test_row[i]);
            let n = i + 1;
            subtract(&mut self.train[row(i)], b, &self.pivot_row[..n]);
            let test = &mut self.test[row(i)];
            subtract_both(test, b, &self.test_row[..n], t, &self.multiplier[..n]);
        }
        if reversible {
            self.write_pivot(column, pivot, test_pivot);
        }
    }

    /// The row and column of the pivot itself, for the day on which it is taken out again.
    fn write_pivot(&mut self, column: usize, pivot: f64, test_pivot: f64) {
        for i in 0..self.order {
            let at = row(i.max(column)).start + i.min(column);
            let residual = self.test_row[i] - 0.5 * self.multiplier[i] * test_pivot;
            self.train[at] = self.pivot_row[i] / pivot.abs();
            self.test[at] = residual / pivot.abs();
        }
        let diagonal = row(column).end - 1;
        self.train[diagonal] = -1.0 / pivot;
        self.test[diagonal] = test_pivot / (pivot * pivot);
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
