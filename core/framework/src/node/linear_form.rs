//! Decides in which order a weighted sum of regressors is summed, for one prediction as for several of the same values at once.

/// What is predicted by `constant + Σ b_j x_j`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearForm<'a> {
    /// The constant, in the unit of what is predicted.
    pub constant: f64,
    /// The `b_j`, one for each regressor, in units of what is predicted per unit of the regressor.
    pub coefficients: &'a [f64],
}

impl LinearForm<'_> {
    /// Its value at regressors, as many as there are coefficients.
    #[inline]
    #[must_use]
    pub fn at(&self, regressors: &[f64]) -> f64 {
        self.constant + Strands::default().sum(self.coefficients, regressors)
    }
}

/// A sum of products so far, in four strands so that it does not wait for each addition. Strands are summed with the next but one: a
/// processor that adds two numbers at once then takes them as they lie.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Strands([f64; 4]);

impl Strands {
    /// Adds the next four products.
    #[inline(always)]
    pub(crate) fn add(&mut self, b: &[f64; 4], x: &[f64; 4]) {
        let Self(sums) = self;
        *sums = std::array::from_fn(|strand| sums[strand] + b[strand] * x[strand]);
    }

    /// The whole sum, after the products of the other coefficients.
    #[inline]
    pub(crate) fn sum(mut self, coefficients: &[f64], regressors: &[f64]) -> f64 {
        let (b4, b_rest) = coefficients.as_chunks();
        let (x4, x_rest) = regressors.as_chunks();
        for (b, x) in b4.iter().zip(x4) {
            self.add(b, x);
        }
        let rest: f64 = b_rest.iter().zip(x_rest).map(|(b, x)| b * x).sum();
        let Self(sums) = self;
        (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
    }
}
