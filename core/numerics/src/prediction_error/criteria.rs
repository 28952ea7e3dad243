//! What a fit is worth beside its number of coefficients. Decides the formulas; not which models are compared.

/// The four figures of a fit by least squares. They compare fits on the same rows only.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InformationCriteria {
    /// `N ln V + 2k`, `V` the mean square of the residuals and `k` the coefficients and their variance (Akaike 1974).
    pub aic: f64,
    /// `AIC + 2k(k + 1)/(N − k − 1)` (Hurvich and Tsai 1989).
    pub aicc: f64,
    /// `N ln V + k ln N` (Schwarz 1978).
    pub bic: f64,
    /// `V (N + p)/(N − p)`, `p` the coefficients alone (Akaike 1969; Ljung 1999, eq. 16.54).
    pub fpe: f64,
}

impl InformationCriteria {
    /// The figures of a fit with so many coefficients, an intercept or a level among them.
    #[must_use]
    pub fn of(rows: usize, coefficients: usize, residual_sum_of_squares: f64) -> Self {
        let (n, p) = (rows as f64, coefficients as f64);
        let k = p + 1.0;
        // A fit without error would be infinitely good whatever its order.
        let variance = (residual_sum_of_squares / n).max(f64::MIN_POSITIVE);
        let likelihood = n * variance.ln();
        let aic = likelihood + 2.0 * k;
        let room = |left: f64| if left > 0.0 { left } else { 0.0 };
        Self {
            aic,
            aicc: aic + 2.0 * k * (k + 1.0) / room(n - k - 1.0),
            bic: likelihood + k * n.ln(),
            fpe: variance * (n + p) / room(n - p),
        }
    }
}
