//! Recursive least squares with forgetting. Decides one step and what keeps it sound over millions of them; does not decide
//! how regressors are scaled (they should be standardised), nor which rows are learned from.

use crate::checks::check_parameter;
use crate::{Gram, NumericsError};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
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
/// errors from growing (Verhaegen 1989).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rls {
    options: RlsOptions,
    coefficients: Vec<f64>,
    /// Row by row, in units of the noise variance.
    covariance: Vec<f64>,
    /// Scratch: covariance times row.
    #[serde(skip)]
    projected: Vec<f64>,
    seen: u64,
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
        options.forgetting.check()?;
        let most = options.most_trace;
        check_parameter("most_trace", most, most > 0.0, "above 0")?;
        let width = coefficients.len();
        let symmetric = |i: usize, j: usize| covariance[i * width + j] == covariance[j * width + i];
        let sound = covariance.len() == width * width
            && covariance.iter().all(|value| value.is_finite())
            && (0..width).all(|i| covariance[i * width + i] > 0.0)
            && (0..width).all(|i| (0..i).all(|j| symmetric(i, j)));
        if !sound || coefficients.iter().any(|value| !value.is_finite()) {
            return Err(NumericsError::NotFinite);
        }
        Ok(Self {
            options,
            projected: vec![0.0; width],
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
        let error = y - self.predict(x);
        let width = x.len();
        // A recursion that has been read back comes without its scratch.
        self.projected.resize(width, 0.0);
        let rows = self.covariance.chunks_exact(width.max(1));
        for (projected, row) in self.projected.iter_mut().zip(rows) {
            *projected = dot(row, x);
        }
        let spread = dot(&self.projected, x);
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
        for (coefficient, projected) in self.coefficients.iter_mut().zip(&self.projected) {
            *coefficient += projected * pull;
        }
        let root = total.sqrt().recip();
        self.projected.iter_mut().for_each(|value| *value *= root);
        let grow = factor.recip();
        let rows = self.covariance.chunks_exact_mut(width.max(1));
        for (row, &left) in rows.zip(&self.projected) {
            for (value, &right) in row.iter_mut().zip(&self.projected) {
                *value = (*value - left * right) * grow;
            }
        }
        error
    }

    /// Goes on with other options.
    #[must_use]
    pub fn with(mut self, options: RlsOptions) -> Self {
        self.options = options;
        // What has been read back must not have to make room later.
        self.projected.resize(self.coefficients.len(), 0.0);
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
    // What the rows do not determine at all must not make the whole unsolvable.
    let alpha = alpha.max(1e-9 * rows);
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

/// The product of two vectors, summed in four strands so that it does not wait for each addition.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a4, a_rest) = a.as_chunks::<4>();
    let (b4, b_rest) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (a, b) in a4.iter().zip(b4) {
        for strand in 0..4 {
            sums[strand] += a[strand] * b[strand];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle;

    const TEXTBOOK: RlsOptions = options(1.0);

    const fn options(factor: f64) -> RlsOptions {
        RlsOptions {
            forgetting: Forgetting::Constant { factor },
            most_trace: f64::INFINITY,
        }
    }

    fn trace(rls: &Rls) -> f64 {
        let width = rls.coefficients().len();
        rls.covariance().iter().step_by(width + 1).sum()
    }

    /// Numbers between −1 and 1 (Marsaglia 2003, xorshift64).
    fn random(state: &mut u64) -> f64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        (*state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    #[test]
    fn every_row_follows_the_oracle() {
        let Some(input) = oracle::table("rls/input.csv") else {
            return;
        };
        let expected = oracle::table("rls/expected.csv").unwrap().numbers();
        let rows = input.numbers();
        for recursion in expected.chunks(rows.len()) {
            let mut rls = Rls::new(4, 1e3, options(recursion[0][0])).unwrap();
            for (row, expected) in rows.iter().zip(recursion) {
                let error = rls.step(&row[..4], row[4]);
                assert!((error - expected[2]).abs() < 1e-8);
                for (found, wanted) in rls.coefficients().iter().zip(&expected[3..7]) {
                    assert!((found - wanted).abs() < 1e-8, "{found} {wanted}");
                }
                assert!((trace(&rls) - expected[7]).abs() < 1e-7 * expected[7]);
            }
        }
        assert_eq!(expected.len(), 3 * rows.len());
    }

    #[test]
    fn variable_forgetting_follows_the_oracle() {
        let rows = oracle::own_table("rls_variable/rows.csv").numbers();
        let expected = oracle::own_table("rls_variable/expected.csv").numbers();
        let variable = RlsOptions {
            forgetting: Forgetting::Variable {
                memory: 200.0,
                noise: 0.1,
                lowest: 0.8,
            },
            most_trace: f64::INFINITY,
        };
        let mut rls = Rls::new(3, 100.0, variable).unwrap();
        for (row, expected) in rows.iter().zip(&expected) {
            let error = rls.step(&row[..3], row[3]);
            assert!(
                (error - expected[1]).abs() < 1e-8,
                "{error} {}",
                expected[1]
            );
            for (found, wanted) in rls.coefficients().iter().zip(&expected[2..5]) {
                assert!((found - wanted).abs() < 1e-8, "{found} {wanted}");
            }
        }
        assert_eq!(expected.len(), 250);
    }

    #[test]
    fn a_million_rows_leave_the_covariance_symmetric_and_positive() {
        for factor in [1.0, 0.999, 0.9] {
            let width = 8;
            let bounded = RlsOptions {
                most_trace: 1e3,
                ..options(factor)
            };
            let mut rls = Rls::new(width, 100.0, bounded).unwrap();
            let mut state = 0x9e37_79b9_7f4a_7c15;
            let mut x = vec![0.0; width];
            for row in 0..1_000_000 {
                // Excited for a while, then hardly: what makes a careless recursion wind up.
                let scale = if row % 2000 < 1000 { 1.0 } else { 1e-6 };
                x.iter_mut().for_each(|x| *x = scale * random(&mut state));
                x[width - 1] = x[0];
                let y: f64 = x.iter().sum::<f64>() + 0.1 * scale * random(&mut state);
                rls.step(&x, y);
            }
            let p = rls.covariance();
            for i in 0..width {
                assert!(p[i * width + i] > 0.0, "{factor}: {p:?}");
                assert!((0..i).all(|j| p[i * width + j] == p[j * width + i]));
            }
            assert!(trace(&rls) <= 1e3 / 0.9);
            // Two regressors are the same, so that only their sum is known.
            let sum = rls.coefficients()[0] + rls.coefficients()[width - 1];
            assert!(
                (sum - 2.0).abs() < 0.1,
                "{factor}: {:?}",
                rls.coefficients()
            );
            assert!(rls.seen() > 900_000);
        }
    }

    #[test]
    fn a_start_from_rows_is_where_the_recursion_over_them_ends() {
        let mut state = 11;
        let rows: Vec<[f64; 4]> = (0..200)
            .map(|_| [(); 4].map(|()| random(&mut state)))
            .collect();
        let mut gram = Gram::new(3);
        for row in &rows {
            gram.push(&row[..3], row[3]);
        }
        let means = gram.means();
        let scales = crate::Standardization::of(&gram).scales;
        let started = covariance_of(&gram, &[2, 0], &scales, 1.0, 200.0).unwrap();
        // A prior of variance 1 is a penalty of 1; the intercept is as good as free.
        let mut prior = vec![0.0; 9];
        (prior[0], prior[4], prior[8]) = (1.0, 1.0, 1e6);
        let mut rls = Rls::starting_at(vec![0.0; 3], prior, TEXTBOOK).unwrap();
        for row in &rows {
            let z = |column: usize| (row[column] - means[column]) / scales[column];
            rls.step(&[z(2), z(0), 1.0], row[3]);
        }
        for (found, wanted) in started.iter().zip(rls.covariance()) {
            assert!(
                (found - wanted).abs() < 1e-9,
                "{started:?} {:?}",
                rls.covariance()
            );
        }
        let by_hand: f64 = rls.covariance().iter().sum();
        assert!((rls.spread(|_| 1.0) - by_hand).abs() < 1e-12);
    }

    #[test]
    fn surprises_make_variable_forgetting_forget_and_nothing_else_does() {
        let run = |forgetting| {
            let variable = RlsOptions {
                forgetting,
                most_trace: f64::INFINITY,
            };
            let mut rls = Rls::new(2, 1e3, variable).unwrap();
            let mut state = 7;
            let mut late = 0.0;
            for row in 0..2000 {
                let x = [random(&mut state), 1.0];
                let slope = if row < 1000 { 2.0 } else { -1.0 };
                let error = rls.step(&x, slope * x[0] + 0.5 + 0.1 * random(&mut state));
                if (1050..1200).contains(&row) {
                    late += error * error;
                }
            }
            (late, trace(&rls))
        };
        let noise = 0.1 / 3_f64.sqrt();
        let (variable, _) = run(Forgetting::Variable {
            memory: 500.0,
            noise,
            lowest: 0.5,
        });
        let (constant, _) = run(Forgetting::Constant {
            factor: 1.0 - 1.0 / 500.0,
        });
        assert!(variable < 0.2 * constant, "{variable} {constant}");
        let never = run(Forgetting::Variable {
            memory: 1e12,
            noise,
            lowest: 0.5,
        });
        let (endless, trace) = run(Forgetting::Constant { factor: 1.0 });
        assert!((never.0 - endless).abs() < 1e-6 * endless);
        assert!((never.1 - trace).abs() < 1e-6 * trace);
    }

    #[test]
    fn a_row_that_is_not_finite_changes_nothing() {
        let mut rls = Rls::new(2, 10.0, TEXTBOOK).unwrap();
        rls.step(&[1.0, 2.0], 3.0);
        let before = rls.clone();
        for (x, y) in [
            ([f64::NAN, 0.0], 1.0),
            ([1.0, 0.0], f64::INFINITY),
            ([f64::MAX, f64::MAX], 1.0),
        ] {
            rls.step(&x, y);
            assert_eq!(rls.coefficients(), before.coefficients());
            assert_eq!(rls.covariance(), before.covariance());
        }
        rls.step(&[1.0, 0.0], 1.0);
        assert_ne!(rls.coefficients(), before.coefficients());
    }

    #[test]
    fn options_and_starts_out_of_range_are_refused() {
        let with = |forgetting, most_trace| {
            Rls::new(
                1,
                1.0,
                RlsOptions {
                    forgetting,
                    most_trace,
                },
            )
        };
        let constant = |factor| Forgetting::Constant { factor };
        assert!(with(constant(0.99), 1.0).is_ok());
        for factor in [0.0, -0.1, 1.1, f64::NAN] {
            assert!(with(constant(factor), 1.0).is_err());
        }
        assert!(with(constant(0.99), 0.0).is_err() && with(constant(0.99), f64::NAN).is_err());
        let variable = |memory, noise, lowest| {
            with(
                Forgetting::Variable {
                    memory,
                    noise,
                    lowest,
                },
                1.0,
            )
        };
        assert!(variable(100.0, 1.0, 0.5).is_ok());
        assert!(variable(1.0, 1.0, 0.5).is_err() && variable(f64::NAN, 1.0, 0.5).is_err());
        assert!(variable(100.0, 0.0, 0.5).is_err() && variable(100.0, 1.0, 0.0).is_err());
        let start =
            |covariance: [f64; 4]| Rls::starting_at(vec![0.0; 2], covariance.to_vec(), TEXTBOOK);
        assert!(start([1.0, 0.5, 0.5, 1.0]).is_ok());
        assert!(start([1.0, 0.5, 0.4, 1.0]).is_err() && start([1.0, 0.5, 0.5, 0.0]).is_err());
    }

    #[test]
    fn a_recursion_that_was_written_and_read_goes_on_with_the_same_bits() {
        let mut rls = Rls::new(3, 10.0, options(0.98)).unwrap();
        let mut state = 3;
        let mut row = || [(); 4].map(|()| random(&mut state));
        for _ in 0..20 {
            let [a, b, c, y] = row();
            rls.step(&[a, b, c], y);
        }
        let mut back: Rls = rls.clone();
        back.projected = Vec::new();
        for _ in 0..20 {
            let [a, b, c, y] = row();
            assert_eq!(
                rls.step(&[a, b, c], y).to_bits(),
                back.step(&[a, b, c], y).to_bits()
            );
        }
    }
}
