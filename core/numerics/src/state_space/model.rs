//! Decides what a state-space model is, how it forecasts and which difference equation says the same.

use faer::Mat;

use super::Record;

/// `x' = A x + B u + K e`, `y = C x + D u + e`: the innovations form of a model with one output, in which it is its own Kalman
/// filter (Ljung 1999, section 4.3).
#[derive(Debug, Clone)]
pub struct StateSpace {
    /// How states go on.
    pub a: Mat<f64>,
    /// What inputs do to states.
    pub b: Mat<f64>,
    /// The output of each state.
    pub c: Vec<f64>,
    /// What inputs do to the output at once.
    pub d: Vec<f64>,
    /// The Kalman gain.
    pub k: Vec<f64>,
}

/// `y(t) + Σ a_i y(t − i) = Σ_j Σ_i b_ji u_j(t − i) + e(t) + Σ c_i e(t − i)`.
#[derive(Debug, Clone, PartialEq)]
pub struct DifferenceEquation {
    /// Of past outputs, from the last one on.
    pub a: Vec<f64>,
    /// Of each input, from the present one on.
    pub b: Vec<Vec<f64>>,
    /// Of past innovations, from the last one on.
    pub c: Vec<f64>,
}

impl StateSpace {
    /// The number of states.
    #[must_use]
    pub fn order(&self) -> usize {
        self.c.len()
    }

    /// What an impulse of an input, or with none an innovation, does to the output at once and in so many samples after.
    #[must_use]
    pub fn impulse_response(&self, input: Option<usize>, samples: usize) -> Vec<f64> {
        let mut state: Vec<f64> = match input {
            Some(j) => (0..self.order()).map(|i| self.b[(i, j)]).collect(),
            None => self.k.clone(),
        };
        let mut response = vec![input.map_or(1.0, |j| self.d[j])];
        for _ in 0..samples {
            response.push(product(&self.c, &state));
            state = self.forth(&state);
        }
        response
    }

    /// The difference equation with the same responses: `A` is the characteristic polynomial of `A` (Faddeev and Leverrier),
    /// the others are its products with the impulse responses.
    #[must_use]
    pub fn difference_equation(&self) -> DifferenceEquation {
        let order = self.order();
        let a = characteristic(&self.a);
        let times = |response: Vec<f64>| -> Vec<f64> {
            (0..=order)
                .map(|j| (0..=j).map(|i| a[i] * response[j - i]).sum())
                .collect()
        };
        let b = (0..self.d.len()).map(|j| times(self.impulse_response(Some(j), order)));
        let b = b.collect();
        let c = times(self.impulse_response(None, order))[1..].to_vec();
        DifferenceEquation {
            b,
            c,
            a: a[1..].to_vec(),
        }
    }

    /// The forecasts of each sample of a record from those before, from a state on.
    #[must_use]
    pub fn one_step(&self, record: &Record<'_>, start: &[f64]) -> Vec<f64> {
        let mut state = start.to_vec();
        (0..record.len())
            .map(|t| {
                let input = record.input(t);
                let expected = product(&self.c, &state) + product(&self.d, input);
                let innovation = record.outputs[t] - expected;
                let mut next = self.forth(&state);
                for (i, next) in next.iter_mut().enumerate() {
                    for (j, u) in input.iter().enumerate() {
                        *next += self.b[(i, j)] * u;
                    }
                    *next += self.k[i] * innovation;
                }
                state = next;
                expected
            })
            .collect()
    }

    fn forth(&self, state: &[f64]) -> Vec<f64> {
        let along = |i: usize| (0..state.len()).map(|j| self.a[(i, j)] * state[j]).sum();
        (0..state.len()).map(along).collect()
    }
}

pub(super) fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The coefficients of the characteristic polynomial, from the highest power on.
fn characteristic(matrix: &Mat<f64>) -> Vec<f64> {
    let order = matrix.nrows();
    let mut coefficients = vec![1.0];
    let mut left = Mat::<f64>::identity(order, order);
    for k in 1..=order {
        let product = matrix * &left;
        let trace: f64 = (0..order).map(|i| product[(i, i)]).sum();
        let coefficient = -trace / k as f64;
        left = product;
        for i in 0..order {
            left[(i, i)] += coefficient;
        }
        coefficients.push(coefficient);
    }
    coefficients
}

/// The largest modulus among the eigenvalues, from powers of the matrix.
pub(super) fn spectral_radius(matrix: &Mat<f64>) -> f64 {
    const SQUARINGS: i32 = 30;
    let mut squared = matrix.clone();
    let mut logarithm = 0.0;
    for doubling in 0..SQUARINGS {
        let norm = squared.norm_l2();
        if !norm.is_finite() {
            return f64::INFINITY;
        }
        if norm <= 0.0 {
            return 0.0;
        }
        logarithm += norm.ln() / 2_f64.powi(doubling);
        squared = Mat::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
            squared[(i, j)] / norm
        });
        squared = &squared * &squared;
    }
    logarithm.exp()
}
