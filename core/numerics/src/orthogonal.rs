//! Least squares from the rows by orthogonal factorisations. Decides how ill-conditioned rows are solved; does not decide
//! when rows are used instead of their Gram matrix.

use crate::{NumericsError, Rows};
use faer::Mat;

/// Rows per step of the factorisation.
const STEP_ROWS: usize = 1024;

/// What the rows, centred and scaled, come down to: `R` and `Qᵀy` of `X = QR`, and what `X` cannot explain of `y`.
pub(crate) struct Triangle {
    r: Mat<f64>,
    target: Vec<f64>,
    unexplained: f64,
}

/// The minimum-norm solution in the scaled columns.
pub(crate) struct MinimumNorm {
    pub(crate) coefficients: Vec<f64>,
    pub(crate) residual_sum_of_squares: f64,
    pub(crate) rank: usize,
}

impl Triangle {
    /// Factorises `(row[columns] − centre) / scales`, the target (the last of `centre`) being centred alone; a Householder
    /// QR of each 1,024 rows below the triangle of those before.
    pub(crate) fn of_rows(
        rows: Rows<'_>,
        columns: &[usize],
        centre: &[f64],
        scales: &[f64],
    ) -> Result<Self, NumericsError> {
        let width = columns.len();
        let order = width + 1;
        let mut triangle = Mat::<f64>::zeros(order, order);
        let mut stack = Mat::<f64>::zeros(order + STEP_ROWS, order);
        let mut filled = order;
        for (x, y, weight) in rows.iter() {
            let root = weight.sqrt();
            for (k, &column) in columns.iter().enumerate() {
                stack[(filled, k)] = root * (x[column] - centre[k]) / scales[k];
            }
            stack[(filled, width)] = root * (y - centre[width]);
            filled += 1;
            if filled == stack.nrows() {
                triangle = reduce(&mut stack, &triangle, filled);
                filled = order;
            }
        }
        if filled > order {
            triangle = reduce(&mut stack, &triangle, filled);
        }
        let unexplained = triangle[(width, width)].powi(2);
        if !unexplained.is_finite() {
            return Err(NumericsError::NotFinite);
        }
        Ok(Self {
            r: triangle.submatrix(0, 0, width, width).to_owned(),
            target: (0..width).map(|k| triangle[(k, width)]).collect(),
            unexplained,
        })
    }

    /// The condition number of the rows when each column is brought to the same length.
    pub(crate) fn condition(&self) -> Result<f64, NumericsError> {
        let lengths: Vec<f64> = (0..self.r.ncols())
            .map(|j| self.r.col(j).norm_l2())
            .collect();
        let equal = Mat::from_fn(self.r.nrows(), self.r.ncols(), |i, j| {
            self.r[(i, j)] / lengths[j]
        });
        let values = equal
            .singular_values()
            .map_err(|_| NumericsError::NoConvergence)?;
        let (Some(&largest), Some(&smallest)) = (values.first(), values.last()) else {
            return Ok(1.0);
        };
        let rounding = f64::EPSILON * values.len() as f64 * largest;
        Ok(if smallest > rounding {
            largest / smallest
        } else {
            f64::INFINITY
        })
    }

    /// Minimises the sum of squares plus `alpha` times the squared length of the coefficients; directions whose singular
    /// value is below `rcond` times the largest are left out.
    pub(crate) fn minimum_norm(
        &self,
        alpha: f64,
        rcond: f64,
    ) -> Result<MinimumNorm, NumericsError> {
        let width = self.target.len();
        let svd = self
            .r
            .thin_svd()
            .map_err(|_| NumericsError::NoConvergence)?;
        let (u, v, values) = (svd.U(), svd.V(), svd.S().column_vector());
        let least = if width > 0 { rcond * values[0] } else { 0.0 };
        let mut coefficients = vec![0.0; width];
        let mut rank = 0;
        for k in 0..width {
            let value = values[k];
            if value.is_nan() || value <= least {
                continue;
            }
            rank += 1;
            let along: f64 = (0..width).map(|i| u[(i, k)] * self.target[i]).sum();
            let step = along * value / (value * value + alpha);
            for (i, coefficient) in coefficients.iter_mut().enumerate() {
                *coefficient += step * v[(i, k)];
            }
        }
        let mut residual_sum_of_squares = self.unexplained;
        for i in 0..width {
            let fitted: f64 = (i..width).map(|j| self.r[(i, j)] * coefficients[j]).sum();
            residual_sum_of_squares += (self.target[i] - fitted).powi(2);
        }
        Ok(MinimumNorm {
            coefficients,
            residual_sum_of_squares,
            rank,
        })
    }
}

fn reduce(stack: &mut Mat<f64>, above: &Mat<f64>, filled: usize) -> Mat<f64> {
    let order = above.ncols();
    stack
        .as_mut()
        .submatrix_mut(0, 0, order, order)
        .copy_from(above);
    let r = stack.as_ref().subrows(0, filled).qr().thin_R().to_owned();
    // Below the diagonal stand leftovers of the factorisation, which a later step would take for rows.
    Mat::from_fn(order, order, |i, j| if i <= j { r[(i, j)] } else { 0.0 })
}
