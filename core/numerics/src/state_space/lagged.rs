//! Decides what past and future of a record are, and sums their products; not what is made of them.

use std::ops::Range;

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par, Side};

use super::Record;
use crate::NumericsError;

/// Rows are summed so many at a time.
const AT_ONCE: usize = 256;
/// Directions in which a matrix is below this share of its largest have rounding in them and nothing else.
const ROUNDING: f64 = 1e-13;
/// The same of what is left of a matrix when others were taken out of it, as a share of the whole: half of all digits are lost.
const LEFT: f64 = 1e-8;

/// Where the windows of twice the horizon begin that lie in a record.
pub(super) fn windows(record: &Record<'_>, horizon: usize) -> Range<usize> {
    0..(record.len() + 1).saturating_sub(2 * horizon)
}

/// The sums of products of rows of numbers.
pub(super) struct Products {
    sum: Mat<f64>,
    rows: Vec<f64>,
}

impl Products {
    pub(super) fn new(columns: usize) -> Self {
        Self {
            sum: Mat::zeros(columns, columns),
            rows: Vec::with_capacity(AT_ONCE * columns),
        }
    }

    pub(super) fn add(&mut self, row: &[f64]) {
        self.rows.extend_from_slice(row);
        if self.rows.len() >= AT_ONCE * row.len() {
            self.sum_up();
        }
    }

    pub(super) fn summed(mut self) -> Mat<f64> {
        self.sum_up();
        self.sum
    }

    fn sum_up(&mut self) {
        let columns = self.sum.nrows();
        let rows = self.rows.len() / columns;
        if rows > 0 {
            let block = MatRef::from_column_major_slice(&self.rows, columns, rows);
            let sum = self.sum.as_mut();
            matmul(sum, Accum::Add, block, block.transpose(), 1.0, Par::Seq);
            self.rows.clear();
        }
    }
}

/// The mean products of past inputs and outputs, future inputs and future outputs, in this order, over all windows.
pub(super) struct Lagged {
    products: Mat<f64>,
    pub(super) horizon: usize,
    pub(super) width: usize,
    pub(super) windows: usize,
}

impl Lagged {
    /// Over windows of twice the horizon.
    pub(super) fn of(records: &[Record<'_>], width: usize, horizon: usize) -> Self {
        let order = 2 * horizon * (width + 1);
        let mut sum = Products::new(order);
        let mut row = Vec::with_capacity(order);
        let mut count = 0;
        for record in records {
            for begin in windows(record, horizon) {
                row.clear();
                for half in [begin, begin + horizon] {
                    for at in half..half + horizon {
                        row.extend_from_slice(record.input(at));
                    }
                    row.extend_from_slice(&record.outputs[half..half + horizon]);
                }
                sum.add(&row);
                count += 1;
            }
        }
        let sum = sum.summed();
        let mean = count.max(1) as f64;
        Self {
            products: Mat::from_fn(order, order, |i, j| sum[(i, j)] / mean),
            horizon,
            width,
            windows: count,
        }
    }

    fn past(&self) -> usize {
        self.horizon * (self.width + 1)
    }

    fn part(&self, rows: (usize, usize), columns: (usize, usize)) -> Mat<f64> {
        self.products
            .submatrix(rows.0, columns.0, rows.1, columns.1)
            .to_owned()
    }

    /// What the past explains of the future outputs beside the future inputs, and products of what is left of past and future
    /// outputs when the future inputs are taken out of them.
    pub(super) fn projected(&self) -> Result<Projected, NumericsError> {
        let past = (0, self.past());
        let inputs = (self.past(), self.horizon * self.width);
        let outputs = (inputs.0 + inputs.1, self.horizon);
        let of_inputs = self.part(inputs, inputs);
        let inverse = pseudo_inverse_left(&of_inputs, &of_inputs)?;
        let left = |rows, columns| {
            let explained = self.part(rows, inputs) * &inverse * self.part(inputs, columns);
            self.part(rows, columns) - explained
        };
        let (whole, past_left) = (self.part(past, past), left(past, past));
        let of_outputs = self.part(outputs, outputs);
        let largest = (0..self.horizon).map(|i| of_outputs[(i, i)]);
        Ok(Projected {
            from_past: left(outputs, past) * pseudo_inverse_left(&past_left, &whole)?,
            past: whole,
            past_left,
            outputs_left: left(outputs, outputs),
            least_output: LEFT * largest.fold(0.0, f64::max),
        })
    }
}

pub(super) struct Projected {
    /// Future outputs from the past.
    pub(super) from_past: Mat<f64>,
    pub(super) past: Mat<f64>,
    pub(super) past_left: Mat<f64>,
    pub(super) outputs_left: Mat<f64>,
    /// What is left of outputs in a direction in which there is more than rounding.
    pub(super) least_output: f64,
}

impl Projected {
    /// Whether the future inputs leave more of the future outputs than rounding.
    pub(super) fn leaves_outputs(&self) -> bool {
        let left = &self.outputs_left;
        (0..left.nrows()).any(|i| left[(i, i)] > self.least_output)
    }
}

/// Eigenvalues in falling order, none below 0, and the vectors that belong to them.
pub(super) fn spectrum(matrix: &Mat<f64>) -> Result<(Vec<f64>, Mat<f64>), NumericsError> {
    let order = matrix.nrows();
    if order == 0 {
        return Ok((Vec::new(), Mat::zeros(0, 0)));
    }
    let eigen = matrix
        .self_adjoint_eigen(Side::Lower)
        .map_err(|_| NumericsError::NoConvergence)?;
    let values = eigen.S().column_vector();
    let falling: Vec<f64> = (0..order).rev().map(|i| values[i].max(0.0)).collect();
    let vectors = eigen.U();
    let turned = Mat::from_fn(order, order, |i, j| vectors[(i, order - 1 - j)]);
    Ok((falling, turned))
}

/// A power of a symmetric matrix, directions in which it is not more than `least` left out.
pub(super) fn power(
    matrix: &Mat<f64>,
    exponent: f64,
    least: f64,
) -> Result<Mat<f64>, NumericsError> {
    let (values, vectors) = spectrum(matrix)?;
    let least = least.max(ROUNDING * values.first().copied().unwrap_or(0.0));
    let order = values.len();
    let scaled = Mat::from_fn(order, order, |i, j| {
        if values[j] > least {
            vectors[(i, j)] * values[j].powf(exponent)
        } else {
            0.0
        }
    });
    Ok(scaled * vectors.transpose())
}

/// The pseudo-inverse of a symmetric matrix, its rows and columns on one scale.
pub(super) fn pseudo_inverse(matrix: &Mat<f64>) -> Result<Mat<f64>, NumericsError> {
    pseudo_inverse_above(matrix, matrix, 0.0)
}

/// The same of what is left of a symmetric matrix when others were taken out of it.
pub(super) fn pseudo_inverse_left(
    left: &Mat<f64>,
    whole: &Mat<f64>,
) -> Result<Mat<f64>, NumericsError> {
    pseudo_inverse_above(left, whole, LEFT)
}

/// The pseudo-inverse on the scale of a matrix, directions in which it is not more than `least` there left out.
pub(crate) fn pseudo_inverse_above(
    matrix: &Mat<f64>,
    of: &Mat<f64>,
    least: f64,
) -> Result<Mat<f64>, NumericsError> {
    let order = matrix.nrows();
    let root = |i: usize| {
        let own = of[(i, i)];
        if own > 0.0 { 1.0 / own.sqrt() } else { 0.0 }
    };
    let roots: Vec<f64> = (0..order).map(root).collect();
    let scale =
        |matrix: &Mat<f64>| Mat::from_fn(order, order, |i, j| matrix[(i, j)] * roots[i] * roots[j]);
    Ok(scale(&power(&scale(matrix), -1.0, least)?))
}
