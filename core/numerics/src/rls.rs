//! Recursive least squares with forgetting. Decides one step and what keeps it sound over millions of them; does not decide
//! how regressors are scaled (they should be standardised), nor which rows are learned from.

use crate::checks::{check_length, check_parameter};
use crate::dot::dot;
use crate::scratch::Scratch;
use crate::{Gram, NumericsError};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use pulp::{Arch, Simd, WithSimd};
use serde::{Deserialize, Serialize};

/// How fast the past is forgotten.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Forgetting {
    /// A row counts `factor` times as much as the one after it; 1 forgets nothing.
    Constant {
        /// Above 0, at most 1.
        factor: f64,
    },
    /// As much as each row surprises, so that what is known stays constant (Fortescue, Kershenbaum and Ydstie 1981):
    /// `λ = 1 − e² (1 − xᵀK) / (memory · noise²)`, the gain `K` taken with `λ = 1`, and never below `lowest`.
    Variable {
        /// Over how many rows of ordinary noise the past counts, above 1.
        memory: f64,
        /// The standard deviation of the ordinary noise, in the unit of the target, above 0.
        noise: f64,
        /// The smallest factor, above 0, at most 1.
        lowest: f64,
    },
}

/// How a recursion runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RlsOptions {
    /// How fast the past is forgotten.
    pub forgetting: Forgetting,
    /// The largest trace of the covariance, in units of the noise variance: nothing is forgotten by a row that would exceed
    /// it, or long quiet stretches would make the next disturbance arbitrarily costly ("wind-up"). Infinite for the textbook.
    pub most_trace: f64,
}

/// Recursive least squares (Ljung 1999, eq. 11.12): the minimiser of `Σ λ^(n−i) (y_i − x_iᵀθ)²` with a start that is
/// forgotten likewise, row by row.
///
/// An intercept is a regressor that is 1 throughout. The covariance stays symmetric to the last bit, which keeps rounding
/// errors from growing (Verhaegen 1989) as long as it is not singular but for rounding: a row in whose direction it has become
/// negative tells nothing any more, and is passed over.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Saved")]
pub struct Rls {
    options: RlsOptions,
    coefficients: Vec<f64>,
    /// Row by row, in units of the noise variance.
    covariance: Vec<f64>,
    /// Covariance times row.
    #[serde(skip)]
    projected: Scratch,
    seen: u64,
}

/// A recursion as it is read, before it is known whether its parts fit together.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Saved {
    options: RlsOptions,
    coefficients: Vec<f64>,
    covariance: Vec<f64>,
    seen: u64,
}

impl TryFrom<Saved> for Rls {
    type Error = NumericsError;

    fn try_from(saved: Saved) -> Result<Self, NumericsError> {
        let Saved {
            options,
            coefficients,
            covariance,
            seen,
        } = saved;
        options.check()?;
        let width = coefficients.len();
        check_length("coefficients", width.max(1), width)?;
        check_length("covariance", width * width, covariance.len())?;
        // Its diagonal may be what rounding left of 0, where a row determined all of it.
        if !finite_and_symmetric(&coefficients, &covariance) {
            return Err(NumericsError::NotFinite);
        }
        Ok(Self {
            options,
            projected: Scratch(vec![0.0; width]),
            coefficients,
            covariance,
            seen,
        })
    }
}

/// Of a covariance with a row and a column per coefficient.
fn finite_and_symmetric(coefficients: &[f64], covariance: &[f64]) -> bool {
    let width = coefficients.len();
    let symmetric = |i: usize, j: usize| covariance[i * width + j] == covariance[j * width + i];
    let mut numbers = coefficients.iter().chain(covariance);
    numbers.all(|value| value.is_finite()) && (0..width).all(|i| (0..i).all(|j| symmetric(i, j)))
}

impl RlsOptions {
    fn check(self) -> Result<(), NumericsError> {
        self.forgetting.check()?;
        let most = self.most_trace;
        check_parameter("most_trace", most, most > 0.0, "above 0")
    }
}

impl Forgetting {
    fn check(self) -> Result<(), NumericsError> {
        let factor = |name, value: f64| {
            let fine = value > 0.0 && value <= 1.0;
            check_parameter(name, value, fine, "above 0 and at most 1")
        };
        match self {
            Self::Constant { factor: constant } => factor("factor", constant),
            Self::Variable {
                memory,
                noise,
                lowest,
            } => {
                let fine = memory > 1.0 && memory.is_finite();
                check_parameter("memory", memory, fine, "above 1")?;
                let fine = noise > 0.0 && noise.is_finite();
                check_parameter("noise", noise, fine, "above 0")?;
                factor("lowest", lowest)
            }
        }
    }

    /// The factor of a row with this error before learning, whose share of the prediction's variance is `spread`.
    fn factor(self, error: f64, spread: f64) -> f64 {
        match self {
            Self::Constant { factor } => factor,
            Self::Variable {
                memory,
                noise,
                lowest,
            } => {
                let surprise = error * error / (1.0 + spread) / (memory * noise * noise);
                (1.0 - surprise).max(lowest)
            }
        }
    }
}

/// A step for the widest vectors that the processor has: no sum is taken in another order, and no product fused with one, so that
/// the bits are the same on all of them.
struct Step<'a> {
    rls: &'a mut Rls,
    x: &'a [f64],
    y: f64,
}

impl WithSimd for Step<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        self.rls.step_here(self.x, self.y)
    }
}

impl Rls {
    /// Starts from coefficients and their covariance, row by row, in units of the noise variance.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`] for options out of range, [`NumericsError::NotFinite`] for numbers that are not finite,
    /// or a covariance that is not symmetric and of positive diagonal.
    pub fn starting_at(
        coefficients: Vec<f64>,
        covariance: Vec<f64>,
        options: RlsOptions,
    ) -> Result<Self, NumericsError> {
        options.check()?;
        let width = coefficients.len();
        let sound = covariance.len() == width * width
            && finite_and_symmetric(&coefficients, &covariance)
            && (0..width).all(|i| covariance[i * width + i] > 0.0);
        if !sound {
            return Err(NumericsError::NotFinite);
        }
        Ok(Self {
            options,
            projected: Scratch(vec![0.0; width]),
            coefficients,
            covariance,
            seen: 0,
        })
    }

    /// Starts from zero coefficients, each known no better than `variance` times the noise variance.
    ///
    /// # Errors
    /// As [`Rls::starting_at`].
    pub fn new(width: usize, variance: f64, options: RlsOptions) -> Result<Self, NumericsError> {
        let mut covariance = vec![0.0; width * width];
        covariance
            .iter_mut()
            .step_by(width + 1)
            .for_each(|diagonal| *diagonal = variance);
        Self::starting_at(vec![0.0; width], covariance, options)
    }

    /// The model's value.
    ///
    /// # Panics
    /// When `x` has not one value per coefficient.
    #[must_use]
    #[inline]
    pub fn predict(&self, x: &[f64]) -> f64 {
        assert_eq!(
            x.len(),
            self.coefficients.len(),
            "a row has a value per coefficient"
        );
        dot(&self.coefficients, x)
    }

    /// The variance of the model's value, in units of the noise variance: `xᵀPx`, what is not known of the coefficients.
    /// `x(i)` is the value of regressor `i`.
    #[must_use]
    pub fn spread(&self, x: impl Fn(usize) -> f64) -> f64 {
        let rows = self.covariance.chunks_exact(self.coefficients.len().max(1));
        let spread = rows.enumerate().map(|(i, row)| {
            let below: f64 = (0..i).map(|j| row[j] * x(j)).sum();
            x(i) * (2.0 * below + row[i] * x(i))
        });
        spread.sum::<f64>().max(0.0)
    }

    /// Learns from one row, without allocating: its error before. A row after which the coefficients would not be finite is
    /// ignored.
    ///
    /// # Panics
    /// When `x` has not one value per coefficient.
    pub fn step(&mut self, x: &[f64], y: f64) -> f64 {
        Arch::new().dispatch(Step { rls: self, x, y })
    }

    #[inline(always)]
    fn step_here(&mut self, x: &[f64], y: f64) -> f64 {
        let error = y - self.predict(x);
        let width = x.len();
        let rows = self.covariance.chunks_exact(width.max(1));
        let projected = &mut self.projected.0;
        for (projected, row) in projected.iter_mut().zip(rows) {
            *projected = dot(row, x);
        }
        let spread = dot(projected, x);
        let mut factor = self.options.forgetting.factor(error, spread);
        let trace: f64 = self.covariance.iter().step_by(width + 1).sum();
        if trace > factor * self.options.most_trace {
            factor = 1.0;
        }
        let total = factor + spread;
        let pull = error / total;
        // Written so that NaN fails. A negative spread is what rounding leaves where nothing is left to learn.
        if !(spread >= 0.0 && pull.is_finite() && spread.is_finite()) {
            return error;
        }
        self.seen += 1;
        for (coefficient, projected) in self.coefficients.iter_mut().zip(&*projected) {
            *coefficient += projected * pull;
        }
        let root = total.sqrt().recip();
        projected.iter_mut().for_each(|value| *value *= root);
        let grow = factor.recip();
        let rows = self.covariance.chunks_exact_mut(width.max(1));
        for (row, &left) in rows.zip(&*projected) {
            for (value, &right) in row.iter_mut().zip(&*projected) {
                *value = (*value - left * right) * grow;
            }
        }
        error
    }

    /// Moves a coefficient without a row, and makes it more uncertain by a variance of its own in units of the noise variance.
    ///
    /// # Panics
    /// When there is no such coefficient, or a number is not finite, or the variance negative.
    pub fn shift(&mut self, coefficient: usize, by: f64, variance: f64) {
        let fine = by.is_finite() && variance >= 0.0 && variance.is_finite();
        assert!(fine, "a shift and its variance are finite");
        let width = self.coefficients.len();
        self.coefficients[coefficient] += by;
        self.covariance[coefficient * (width + 1)] += variance;
    }

    /// Goes on with other options.
    #[must_use]
    pub fn with(mut self, options: RlsOptions) -> Self {
        self.options = options;
        self
    }

    /// How the recursion runs.
    #[must_use]
    pub fn options(&self) -> RlsOptions {
        self.options
    }

    /// The coefficients, one per regressor.
    #[must_use]
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Their covariance, row by row, in units of the noise variance.
    #[must_use]
    pub fn covariance(&self) -> &[f64] {
        &self.covariance
    }

    /// How many rows were used.
    #[must_use]
    pub fn seen(&self) -> u64 {
        self.seen
    }
}

/// The covariance of the standardised columns' coefficients and, last, the intercept's, in units of the noise variance, when
/// the rows in `gram` count as if there were `rows` of them: `(rows/n · ZᵀZ + αI)⁻¹`. A start for [`Rls::starting_at`].
///
/// # Errors
/// [`NumericsError::NoConvergence`] when that cannot be inverted.
pub fn covariance_of(
    gram: &Gram,
    columns: &[usize],
    scales: &[f64],
    alpha: f64,
    rows: f64,
) -> Result<Vec<f64>, NumericsError> {
    let moments = gram.moments();
    let share = rows / gram.weight();
    // What the rows do not determine at all must not make the whole unsolvable, nor so wide that the recursion's differences lose
    // their sign within some 10⁵ rows.
    let alpha = alpha.max(1e-7 * rows);
    let order = columns.len() + 1;
    let known = Mat::from_fn(order, order, |i, j| {
        match (columns.get(i), columns.get(j)) {
            (Some(&a), Some(&b)) => {
                let penalty = if i == j { alpha } else { 0.0 };
                share * moments[(a, b)] / (scales[a] * scales[b]) + penalty
            }
            (None, None) => rows,
            _ => 0.0,
        }
    });
    let factor = known
        .llt(Side::Lower)
        .map_err(|_| NumericsError::NoConvergence)?;
    let inverse = factor.solve(Mat::<f64>::identity(order, order));
    let lower = |i: usize, j: usize| inverse[(i.max(j), i.min(j))];
    let whole: Vec<f64> = (0..order * order)
        .map(|at| lower(at / order, at % order))
        .collect();
    if whole.iter().all(|value| value.is_finite()) {
        Ok(whole)
    } else {
        Err(NumericsError::NoConvergence)
    }
}

#[cfg(test)]
mod tests;
