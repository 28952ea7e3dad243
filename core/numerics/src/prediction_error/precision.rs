//! Decides how precisely the coefficients of a model are known that has been found by the prediction error.

use faer::Mat;

use super::search::{held, remembered};
use super::segment::Counted;
use super::{Polynomials, PredictionError, PredictionErrorFit, Samples};
use crate::cholesky::inverse_of_factor;

impl PredictionError {
    /// The standard errors of all coefficients that this search found in these samples, each in the place of its coefficient:
    /// `s √((JᵀJ)⁻¹)_ii` with the Jacobian `J` of the residuals and their variance `s²` (Ljung 1999, eq. 9.17 and 9.18); with a
    /// penalty those of the posterior, as in ridge. Where values are missing, what variances of predictions tell is in it.
    ///
    /// A polynomial that only the bound of stability holds where it is has none, and its list is empty: the theory is that of a
    /// minimum, which there lies outside. So it is where samples hardly determine it. Those of the others are given as if it were known, and
    /// a level that was given has NaN. None at all where the samples do
    /// not determine all coefficients.
    #[must_use]
    pub fn standard_errors(
        &self,
        fit: &PredictionErrorFit,
        samples: &Samples,
    ) -> Option<Polynomials> {
        let counted = Counted {
            first: fit.first,
            measured: fit.measured,
            starts: fit.start_counts.clone(),
        };
        let at = self.judged(fit.model.clone(), samples, &counted);
        let (hessian, gradient) = self.normal_equations(&at, samples, &counted);
        let given = self.given(&fit.model);
        let held = held(&fit.model, &hessian, &gradient, remembered(samples), given)?;
        let free: Vec<usize> = (0..held.len()).filter(|&i| !held[i]).collect();
        let scale = |i: usize| hessian[(free[i], free[i])].sqrt();
        let scaled = Mat::from_fn(free.len(), free.len(), |i, j| {
            hessian[(free[i], free[j])] / (scale(i) * scale(j))
        });
        let root = inverse_of_factor(&scaled)?;
        let mut errors = vec![f64::NAN; held.len()];
        for (i, &place) in free.iter().enumerate() {
            let square = root.col(i).squared_norm_l2();
            errors[place] = (fit.variance() * fit.variance_ratio * square).sqrt() / scale(i);
        }
        let known = free.iter().all(|&place| errors[place].is_finite());
        known.then(|| without_held(fit.model.with(&errors)))
    }
}

/// Errors of which those of a polynomial that is held, which are no numbers, are left out.
fn without_held(mut errors: Polynomials) -> Polynomials {
    let filters = errors.inputs.iter_mut().map(|input| &mut input.f);
    let all = filters.chain([&mut errors.a, &mut errors.c, &mut errors.d]);
    for polynomial in all.filter(|of| of.iter().any(|error| error.is_nan())) {
        polynomial.clear();
    }
    errors
}
