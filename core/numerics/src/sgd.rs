//! Linear regression by stochastic gradients with an L2 penalty. Decides one step and how its rate falls; does not decide
//! the order of the rows, nor how they are scaled (they should be standardised).

use crate::NumericsError;
use crate::dot::dot;
use serde::{Deserialize, Serialize};

/// The step size as a function of the number `t` of rows seen, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum LearningRate {
    /// `eta0` throughout.
    Constant {
        /// The step size.
        eta0: f64,
    },
    /// `eta0 / t^power`.
    InvScaling {
        /// The first step size.
        eta0: f64,
        /// How fast it falls; 0.25 is usual.
        power: f64,
    },
}

impl LearningRate {
    fn at(self, t: u64) -> f64 {
        match self {
            Self::Constant { eta0 } => eta0,
            Self::InvScaling { eta0, power } => eta0 / (t as f64).powf(power),
        }
    }

    fn check(self) -> Result<(), NumericsError> {
        let (eta0, power) = match self {
            Self::Constant { eta0 } => (eta0, 0.0),
            Self::InvScaling { eta0, power } => (eta0, power),
        };
        if !(eta0 > 0.0 && eta0.is_finite()) {
            return Err(NumericsError::Parameter {
                name: "eta0",
                value: eta0,
                allowed: "positive and finite",
            });
        }
        if !(0.0..=1.0).contains(&power) {
            return Err(NumericsError::Parameter {
                name: "power",
                value: power,
                allowed: "from 0 to 1",
            });
        }
        Ok(())
    }
}

/// The penalty and the step size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SgdOptions {
    /// The penalty per row: `½(y − ŷ)² + ½α‖w‖²` is stepped down; the intercept is free.
    pub alpha: f64,
    /// The step size.
    pub rate: LearningRate,
}

/// A linear model that learns row by row.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Saved")]
pub struct Sgd {
    options: SgdOptions,
    weights: Vec<f64>,
    intercept: f64,
    seen: u64,
}

/// A model as it is read, before it is known whether it can be one.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Saved {
    options: SgdOptions,
    weights: Vec<f64>,
    intercept: f64,
    seen: u64,
}

impl TryFrom<Saved> for Sgd {
    type Error = NumericsError;

    fn try_from(saved: Saved) -> Result<Self, NumericsError> {
        let started = Self::starting_at(saved.weights, saved.intercept, saved.options)?;
        Ok(Self {
            seen: saved.seen,
            ..started
        })
    }
}

impl Sgd {
    /// Starts from zero weights for `width` regressors.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`] for a penalty or step size out of range.
    pub fn new(width: usize, options: SgdOptions) -> Result<Self, NumericsError> {
        Self::starting_at(vec![0.0; width], 0.0, options)
    }

    /// Starts from given weights, such as those of a least-squares fit.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`] for a penalty or step size out of range, [`NumericsError::NotFinite`] for weights.
    pub fn starting_at(
        weights: Vec<f64>,
        intercept: f64,
        options: SgdOptions,
    ) -> Result<Self, NumericsError> {
        if !(options.alpha >= 0.0 && options.alpha.is_finite()) {
            return Err(NumericsError::Parameter {
                name: "alpha",
                value: options.alpha,
                allowed: "finite and not negative",
            });
        }
        options.rate.check()?;
        if weights.iter().chain([&intercept]).any(|w| !w.is_finite()) {
            return Err(NumericsError::NotFinite);
        }
        Ok(Self {
            options,
            weights,
            intercept,
            seen: 0,
        })
    }

    /// The model's value.
    ///
    /// # Panics
    /// When `x` has not one value per weight.
    pub fn predict(&self, x: &[f64]) -> f64 {
        assert_eq!(x.len(), self.weights.len(), "a row has a value per weight");
        dot(&self.weights, x) + self.intercept
    }

    /// Learns from one row, without allocating. A row with a value that is not finite is ignored, and so is one after which
    /// the weights would not be finite; the answer says whether the row was used.
    ///
    /// # Panics
    /// When `x` has not one value per weight.
    pub fn step(&mut self, x: &[f64], y: f64) -> bool {
        let error = self.predict(x) - y;
        let eta = self.options.rate.at(self.seen + 1);
        let pull = eta * error;
        // Without a way out, so that several numbers are looked at at once.
        let bounded = |x: &f64| (pull * x).is_finite();
        if !x.iter().fold(bounded(&1.0), |all, x| all & bounded(x)) {
            return false;
        }
        self.seen += 1;
        let keep = (1.0 - eta * self.options.alpha).max(0.0);
        for (w, x) in self.weights.iter_mut().zip(x) {
            *w = *w * keep - pull * x;
        }
        self.intercept -= pull;
        true
    }

    /// Learns from all rows in their order, `epochs` times. Rows are pairs of regressors and target.
    ///
    /// # Panics
    /// When a row has not one value per weight.
    pub fn epochs<'a, I>(&mut self, rows: I, epochs: usize)
    where
        I: IntoIterator<Item = (&'a [f64], f64)> + Clone,
    {
        for _ in 0..epochs {
            for (x, y) in rows.clone() {
                self.step(x, y);
            }
        }
    }

    /// Moves the intercept without a row.
    ///
    /// # Panics
    /// When that is not finite.
    pub fn shift(&mut self, by: f64) {
        assert!(by.is_finite(), "a shift is finite");
        self.intercept += by;
    }

    /// Goes on with other options.
    #[must_use]
    pub fn with(mut self, options: SgdOptions) -> Self {
        self.options = options;
        self
    }

    /// How the model learns.
    #[must_use]
    pub fn options(&self) -> SgdOptions {
        self.options
    }

    /// The weights, one per regressor.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// The intercept.
    pub fn intercept(&self) -> f64 {
        self.intercept
    }

    /// How many rows were used.
    pub fn seen(&self) -> u64 {
        self.seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Gram, Standardization, oracle};

    const EVERY: LearningRate = LearningRate::Constant { eta0: 0.01 };

    #[test]
    fn what_could_not_have_been_started_is_not_read() {
        let rate = EVERY;
        let model = Sgd::new(2, SgdOptions { alpha: 0.0, rate }).unwrap();
        let text = serde_json::to_string(&model).unwrap();
        assert_eq!(serde_json::from_str::<Sgd>(&text).unwrap(), model);
        for (right, wrong) in [("0.01", "-0.01"), ("\"alpha\":0.0", "\"alpha\":-1.0")] {
            let broken = text.replace(right, wrong);
            assert_ne!(broken, text);
            serde_json::from_str::<Sgd>(&broken).unwrap_err();
        }
    }

    #[test]
    fn epochs_follow_the_oracle() {
        let Some(input) = oracle::table("linear_ridge/input.csv") else {
            return;
        };
        let expected = oracle::table("linear_ridge/sgd.csv").unwrap();
        let mut gram = Gram::new(8);
        let mut rows = input.numbers();
        for row in &rows {
            gram.push(&row[..8], row[8]);
        }
        let scaling = Standardization::of(&gram);
        for row in &mut rows {
            scaling.apply(&mut row[..8]);
            row[8] -= gram.means()[8];
        }
        for (name, numbers) in expected.records.iter().zip(expected.numbers()) {
            let eta0 = 0.01;
            let rate = if name[0].starts_with("constant") {
                LearningRate::Constant { eta0 }
            } else {
                LearningRate::InvScaling { eta0, power: 0.25 }
            };
            let mut model = Sgd::new(8, SgdOptions { alpha: 1e-3, rate }).unwrap();
            model.epochs(
                rows.iter().map(|row| (&row[..8], row[8])),
                numbers[1] as usize,
            );
            for (found, wanted) in model.weights().iter().zip(&numbers[2..10]) {
                assert!(
                    (found - wanted).abs() < 1e-9,
                    "{}: {found} {wanted}",
                    name[0]
                );
            }
            assert!((model.intercept() - numbers[10]).abs() < 1e-9);
        }
        assert!(expected.records.len() >= 6);
    }

    #[test]
    fn learning_row_by_row_follows_the_online_oracle() {
        let Some(input) = oracle::table("online_river/input.csv") else {
            return;
        };
        let expected = oracle::table("online_river/expected.csv").unwrap();
        let mut scaler = crate::Standardizer::new(3);
        // The library steps down the squared error where this steps down its half: 0.05 and 1e-3 are there what these are here.
        let options = SgdOptions {
            alpha: 0.5e-3,
            rate: LearningRate::Constant { eta0: 0.1 },
        };
        let mut model = Sgd::new(3, options).unwrap();
        let close = |found: f64, wanted: f64| {
            assert!(
                (found - wanted).abs() <= 1e-8 * wanted.abs().max(1.0),
                "{found} {wanted}"
            );
        };
        for (row, expected) in input.numbers().iter().zip(expected.numbers()) {
            let mut z = row[..3].to_vec();
            scaler.partial_fit(&z);
            scaler.standardization().apply(&mut z);
            model.step(&z, row[3]);
            for (found, wanted) in model.weights().iter().zip(&expected[2..5]) {
                close(*found, *wanted);
            }
            close(model.intercept(), expected[5]);
        }
        assert_eq!(expected.records.len(), 300);
    }

    #[test]
    fn a_row_that_is_not_finite_changes_nothing() {
        let options = SgdOptions {
            alpha: 0.1,
            rate: EVERY,
        };
        let mut model = Sgd::starting_at(vec![1.0, 2.0], 3.0, options).unwrap();
        let before = model.clone();
        assert!(!model.step(&[f64::NAN, 0.0], 1.0));
        assert!(!model.step(&[1.0, 0.0], f64::INFINITY));
        assert_eq!(model, before);
        assert!(model.step(&[1.0, 0.0], 1.0));
        assert_ne!(model, before);
    }

    #[test]
    fn options_out_of_range_are_refused() {
        let with = |alpha, eta0| {
            let rate = LearningRate::Constant { eta0 };
            Sgd::new(1, SgdOptions { alpha, rate })
        };
        assert!(with(0.0, 0.01).is_ok());
        assert!(with(-1.0, 0.01).is_err());
        assert!(with(f64::NAN, 0.01).is_err());
        assert!(with(0.0, 0.0).is_err());
    }
}
