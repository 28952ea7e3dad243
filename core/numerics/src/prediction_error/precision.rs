//! Decides how precisely the coefficients of a model are known that has been found by the prediction error.

use faer::Mat;

use super::Polynomials;
use crate::cholesky::inverse_of_factor;

/// The standard errors of all coefficients, each in the place of its coefficient: `s √((JᵀJ)⁻¹)_ii` with the Jacobian `J` of the
/// residuals and their variance `s²` (Ljung 1999, eq. 9.17 and 9.18); with a penalty those of the posterior, as in ridge. None
/// where the samples do not determine all coefficients.
pub(super) fn standard_errors(
    model: &Polynomials,
    hessian: &Mat<f64>,
    variance: f64,
) -> Option<Polynomials> {
    let count = hessian.nrows();
    let scales: Vec<f64> = (0..count).map(|i| hessian[(i, i)].sqrt()).collect();
    let scaled = Mat::from_fn(count, count, |i, j| {
        hessian[(i, j)] / (scales[i] * scales[j])
    });
    let root = inverse_of_factor(&scaled)?;
    let errors = scales.iter().enumerate().map(|(i, scale)| {
        let square = root.col(i).squared_norm_l2();
        (variance * square).sqrt() / scale
    });
    let errors: Vec<f64> = errors.collect();
    let known = errors.iter().all(|error| error.is_finite());
    known.then(|| model.with(&errors))
}
