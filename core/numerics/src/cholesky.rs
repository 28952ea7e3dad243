//! Decides when a Cholesky factor can be inverted.

use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Mat, Par, Side};

/// The inverse of the lower Cholesky factor; nothing when there is none.
pub(crate) fn inverse_of_factor(matrix: &Mat<f64>) -> Option<Mat<f64>> {
    let factor = matrix.llt(Side::Lower).ok()?;
    let mut inverse = Mat::<f64>::identity(matrix.nrows(), matrix.nrows());
    solve_lower_triangular_in_place(factor.L(), inverse.as_mut(), Par::Seq);
    let finite = (0..inverse.ncols()).all(|j| inverse.col(j).iter().all(|value| value.is_finite()));
    finite.then_some(inverse)
}
