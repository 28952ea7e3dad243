//! Decides in which words a fitted estimator tells what it consists of; which units they are in is decided by its rows.

use serde::Serialize;

use crate::time::Duration;

/// What a fitted estimator consists of, in the units of the rows that it was fitted on: see
/// [`Predictor::coefficients`](super::Predictor::coefficients).
///
/// Without polynomials the prediction is the sum of the terms, each its value times its factors. With them, and `q⁻¹` for a step
/// back, it follows `A(q) (y − μ) = Σ B(q)/F(q) u + C(q)/(D(q) (1 − q⁻¹)^d) e` (Ljung 1999, eq. 4.33), of which the constant `μ`
/// is a term, and the 1 that `A`, `C`, `D` and `F` begin with is not.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Coefficients {
    /// The terms, in the order in which they are listed.
    pub terms: Vec<Term>,
    /// How large the noises are that it takes for granted.
    pub noises: Vec<Noise>,
    /// How it comes to rest.
    pub modes: Vec<Mode>,
    /// How often the noise is integrated.
    pub differences: usize,
    /// How long a step is, where it has steps.
    pub step: Option<Duration>,
}

impl Coefficients {
    /// A constant and a coefficient for each regressor in turn, the standard errors in the same order; none where they are not
    /// known.
    #[must_use]
    pub fn linear(constant: f64, values: &[f64], errors: Option<&[f64]>) -> Self {
        let places = (0..values.len()).map(|nth| Of::Product(vec![Factor::of(nth)]));
        let places = std::iter::once(Of::Constant).chain(places);
        let values = std::iter::once(&constant).chain(values);
        let terms = places.zip(values).enumerate().map(|(nth, (of, &value))| {
            let error = errors.and_then(|errors| errors.get(nth)).copied();
            Term::new(of, value).within(error.unwrap_or(f64::NAN))
        });
        Self {
            terms: terms.collect(),
            ..Self::default()
        }
    }
}

/// One coefficient.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// What it is a coefficient of.
    pub of: Of,
    /// Its value.
    pub value: f64,
    /// Its standard error; none where theory or the fit does not tell it.
    pub error: Option<f64>,
}

impl Term {
    /// A coefficient of which no standard error is known.
    #[must_use]
    pub fn new(of: Of, value: f64) -> Self {
        Self {
            of,
            value,
            error: None,
        }
    }

    /// The same with a standard error, where that is a number.
    #[must_use]
    pub fn within(self, error: f64) -> Self {
        Self {
            error: Some(error).filter(|error| error.is_finite()),
            ..self
        }
    }
}

/// What a coefficient is a coefficient of.
#[derive(Debug, Clone, PartialEq)]
pub enum Of {
    /// Nothing: it is what is predicted beside everything else, in the unit of the truth.
    Constant,
    /// Regressors, in the unit of the truth per those of the regressors.
    Product(Vec<Factor>),
    /// A power of a polynomial: without a unit, but that of `B` is in the unit of the truth per that of its input.
    Power {
        /// `A`, `B`, `C`, `D` or `F`.
        polynomial: char,
        /// How many steps it lies back.
        steps: usize,
        /// The regressor that is the input of `B` and `F`, by its place among those used.
        input: Option<usize>,
    },
}

/// A regressor as it stands in a product.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Factor {
    /// Its place among the regressors used.
    pub regressor: usize,
    /// What is subtracted from it, in its unit.
    pub about: f64,
    /// The least and the largest value that it counts with before that, in its unit.
    pub held: (f64, f64),
}

impl Factor {
    /// A regressor as it is.
    #[must_use]
    pub fn of(regressor: usize) -> Self {
        Self {
            regressor,
            about: 0.0,
            held: (f64::NEG_INFINITY, f64::INFINITY),
        }
    }
}

/// A noise, in the words in which a graph gives it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Noise {
    /// Its name: `level`.
    pub name: String,
    /// Its standard deviation, in the unit of the truth.
    pub deviation: f64,
    /// The time in s in which that adds up, where it does.
    pub per_s: Option<f64>,
}

/// One of the ways in which a model comes to rest.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mode {
    /// What comes to rest: the polynomial that it is a root of and its input, or a state: `A`, `F temperature.room`, `level`.
    pub of: String,
    /// The time in s in which it comes to rest, but for 1/e of the way; infinite (null in JSON) where it stays, negative where it
    /// grows.
    pub time_constant_s: f64,
    /// The period in s with which it swings, where it does.
    pub period_s: Option<f64>,
}
