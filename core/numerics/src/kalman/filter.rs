//! The Kalman filter of a structural model, one scalar observation at a time. Decides what is known after each; does not
//! decide which variances the model has.

use super::Structural;
use super::matrix::{NOTHING_NEW, Observation, carry, diagonal, product, rank, shrink};
use crate::NumericsError;
use crate::checks::{check_length, check_parameter};
use crate::scratch::Scratch;
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};

/// Where what is expected of an observation is more uncertain than the observation by this factor, what is left of a covariance
/// is a small difference of large numbers, and is worked out in another way, which costs more.
const UNSURE: f64 = 1e3;

/// What is known of level, trend and coefficients, in this order.
///
/// States whose variance is given as infinite are diffuse: nothing is known of them, exactly (Koopman 1997; Durbin and
/// Koopman 2012, chapter 5), rather than something with a large variance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Saved")]
pub struct Kalman {
    model: Structural,
    state: Vec<f64>,
    /// Row by row; where something is diffuse, the finite part.
    covariance: Vec<f64>,
    /// Row by row, the part of the covariance that is multiplied by infinity; empty where nothing ever was diffuse.
    diffuse: Vec<f64>,
    /// How many more observations it takes at least until nothing is diffuse.
    unknown: usize,
    /// Scratch.
    #[serde(skip)]
    room: Scratch,
}

/// A filter as it is read, before it is known whether its parts fit together.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Saved {
    model: Structural,
    state: Vec<f64>,
    covariance: Vec<f64>,
    diffuse: Vec<f64>,
    unknown: usize,
    /// The scratch, which was once written too.
    #[serde(default, rename = "room")]
    _room: IgnoredAny,
}

impl TryFrom<Saved> for Kalman {
    type Error = NumericsError;

    fn try_from(saved: Saved) -> Result<Self, NumericsError> {
        let Saved {
            model,
            state,
            covariance,
            diffuse,
            unknown,
            ..
        } = saved;
        model.check()?;
        let order = state.len();
        check_length("state", order.max(model.moving()), order)?;
        check_length("covariance", order * order, covariance.len())?;
        let fine = unknown <= order;
        check_parameter("unknown", unknown as f64, fine, "at most one per state")?;
        if unknown > 0 || !diffuse.is_empty() {
            check_length("diffuse", order * order, diffuse.len())?;
        }
        let filter = Self {
            model,
            state,
            covariance,
            diffuse,
            unknown,
            room: Scratch(vec![0.0; 3 * order]),
        };
        if filter.is_sound() {
            Ok(filter)
        } else {
            Err(NumericsError::NotFinite)
        }
    }
}

/// Whether a matrix, where there is one, may be a covariance, but for rounding.
fn is_covariance(matrix: &[f64], order: usize) -> bool {
    let largest = matrix
        .iter()
        .fold(0.0, |most: f64, value| most.max(value.abs()));
    let rounding = 1e-9 * largest;
    let rows = matrix.chunks_exact(order.max(1)).enumerate();
    matrix.iter().all(|value| value.is_finite())
        && rows.into_iter().all(|(i, row)| {
            let symmetric =
                |(j, value): (usize, &f64)| (value - matrix[j * order + i]).abs() <= rounding;
            row[i] >= -rounding && row.iter().enumerate().all(symmetric)
        })
}

/// What an observation brought.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation {
    /// Observation minus prediction.
    pub error: f64,
    /// The variance of the error before the observation; where the prediction was diffuse, the factor of infinity in it.
    pub variance: f64,
    /// Whether nothing was known that could predict the observation.
    pub diffuse: bool,
}

/// A prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Forecast {
    /// The expected observation.
    pub mean: f64,
    /// The variance of what is expected, without that of the observation itself.
    pub variance: f64,
}

impl Innovation {
    /// The logarithm of the density of the observation, given those before.
    #[must_use]
    pub fn log_likelihood(&self) -> f64 {
        let square = if self.diffuse {
            0.0
        } else {
            self.error * self.error / self.variance
        };
        -0.5 * ((2.0 * std::f64::consts::PI).ln() + self.variance.ln() + square)
    }
}

impl Kalman {
    /// Starts with nothing known of level, trend and the coefficients of `regressors`.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`] for variances out of range.
    pub fn diffuse(model: Structural, regressors: usize) -> Result<Self, NumericsError> {
        let order = model.moving() + regressors;
        let variances = vec![f64::INFINITY; order];
        Self::starting_at(model, vec![0.0; order], &diagonal(&variances))
    }

    /// Starts from what is known of level, trend and coefficients before the first observation, their covariance row by
    /// row. An infinite variance says that nothing is known of a state.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`] for variances out of range, [`NumericsError::Width`] where the numbers of states do not
    /// fit, [`NumericsError::NotFinite`] for other numbers that are not finite.
    pub fn starting_at(
        model: Structural,
        state: Vec<f64>,
        covariance: &[f64],
    ) -> Result<Self, NumericsError> {
        model.check()?;
        let order = state.len();
        if order < model.moving() || covariance.len() != order * order {
            return Err(NumericsError::Width {
                expected: order.max(model.moving()).pow(2),
                found: covariance.len(),
            });
        }
        let mut filter = Self {
            model,
            state,
            covariance: covariance.to_vec(),
            diffuse: Vec::new(),
            unknown: 0,
            room: Scratch(vec![0.0; 3 * order]),
        };
        for i in 0..order {
            if filter.covariance[i * order + i] == f64::INFINITY {
                filter.forget(i);
            }
        }
        let all = filter.covariance.iter().chain(&filter.state);
        if all.into_iter().any(|value| !value.is_finite()) {
            return Err(NumericsError::NotFinite);
        }
        Ok(filter)
    }

    /// The model that is followed.
    #[must_use]
    pub fn model(&self) -> Structural {
        self.model
    }

    /// How many regressors an observation has: one per coefficient.
    #[must_use]
    pub fn regressors(&self) -> usize {
        self.state.len() - self.model.moving()
    }

    /// Level, trend where there is one, and coefficients.
    #[must_use]
    pub fn state(&self) -> &[f64] {
        &self.state
    }

    /// The covariance of the states, row by row; of no meaning while something is diffuse.
    #[must_use]
    pub fn covariance(&self) -> &[f64] {
        &self.covariance
    }

    /// Both, to be changed together.
    pub(super) fn parts_mut(&mut self) -> (&mut [f64], &mut [f64]) {
        (&mut self.state, &mut self.covariance)
    }

    /// Whether there is a state of which nothing is known.
    #[must_use]
    pub fn is_diffuse(&self) -> bool {
        self.unknown > 0
    }

    /// Whether what is known is finite, and how well may be a covariance: after numbers so small or so large that their squares
    /// are none it is not.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let order = self.state.len();
        self.state.iter().all(|value| value.is_finite())
            && is_covariance(&self.covariance, order)
            && is_covariance(&self.diffuse, order)
    }

    /// Lets time pass.
    #[inline]
    pub fn advance(&mut self, time: f64) {
        let order = self.state.len();
        let gained = self.model.gained(time);
        if self.model.trend.is_some() {
            self.state[0] += time * self.state[1];
            carry(&mut self.covariance, order, time);
            if self.unknown > 0 {
                carry(&mut self.diffuse, order, time);
            }
            self.covariance[1] += gained.both;
            self.covariance[order] += gained.both;
            self.covariance[order + 1] += gained.trend;
        } else if self.model.returning > 0.0 {
            let kept = self.model.kept(time);
            self.state[0] *= kept;
            shrink(&mut self.covariance, order, kept);
            if self.unknown > 0 {
                shrink(&mut self.diffuse, order, kept);
            }
        }
        self.covariance[0] += gained.level;
    }

    /// Takes an observation with its regressors, without allocating; NaN is none. The answer is empty where the observation
    /// was not used: it is missing, a number is not finite, or it says nothing about what is uncertain.
    ///
    /// # Panics
    /// When `x` has not one value per coefficient.
    #[inline]
    pub fn observe(&mut self, x: &[f64], y: f64) -> Option<Innovation> {
        self.observe_share(x, y, 1.0)
    }

    /// The same for an observation that says only a share, above 0 up to 1, of what another would, since it says the rest
    /// together with others: its variance is divided by that.
    ///
    /// # Panics
    /// When `x` has not one value per coefficient.
    #[inline]
    pub fn observe_share(&mut self, x: &[f64], y: f64, share: f64) -> Option<Innovation> {
        let error = self.error(x, y)?;
        if self.unknown > 0
            && let Some(innovation) = self.learn_of_the_unknown(x, error, share)
        {
            return Some(innovation);
        }
        self.take(x, error, share, self.state.len())
    }

    /// The same for an observation that moves only the first so many states. The others stay as they are, and as uncertain,
    /// which counts (the filter of Schmidt 1966, which considers states that it does not estimate). While something is
    /// diffuse, nothing is moved.
    ///
    /// # Panics
    /// When `x` has not one value per coefficient.
    pub fn observe_with(
        &mut self,
        states: usize,
        x: &[f64],
        y: f64,
        share: f64,
    ) -> Option<Innovation> {
        let error = self.error(x, y)?;
        if self.unknown > 0 {
            return None;
        }
        self.take(x, error, share, states)
    }

    /// Makes a state more uncertain by a variance of its own, as of a leap that nothing else shows. One that is no number, or
    /// not above 0, adds nothing; the largest number is the most.
    ///
    /// # Panics
    /// When there is no such state.
    pub fn widen(&mut self, state: usize, variance: f64) {
        let order = self.state.len();
        let own = &mut self.covariance[state * order + state];
        *own = (*own + variance.max(0.0)).min(f64::MAX);
    }

    /// The same with one more coefficient before the others, which is known to be 0. Only where nothing is diffuse.
    ///
    /// # Panics
    /// When something is.
    #[must_use]
    pub fn with_coefficient(&self) -> Self {
        assert!(self.unknown == 0, "all states are known");
        let (order, place) = (self.state.len(), self.model.moving());
        let mut state = self.state.clone();
        state.insert(place, 0.0);
        let mut covariance = Vec::with_capacity((order + 1).pow(2));
        let none = vec![0.0; order];
        let mut rows: Vec<&[f64]> = self.covariance.chunks_exact(order).collect();
        rows.insert(place, &none);
        for row in rows {
            covariance.extend([&row[..place], &[0.0], &row[place..]].concat());
        }
        Self {
            room: Scratch(vec![0.0; 3 * state.len()]),
            model: self.model,
            state,
            covariance,
            diffuse: Vec::new(),
            unknown: 0,
        }
    }

    /// By how much a prediction misses; none where that is not finite.
    #[inline]
    fn error(&self, x: &[f64], y: f64) -> Option<f64> {
        assert_eq!(
            self.model.moving() + x.len(),
            self.state.len(),
            "a row has a value per coefficient"
        );
        let error = y - self.expected(0.0, |regressor| x[regressor]);
        error.is_finite().then_some(error)
    }

    /// Takes the error of an observation of which all is known, and moves the first so many states.
    #[inline]
    fn take(&mut self, x: &[f64], error: f64, share: f64, states: usize) -> Option<Innovation> {
        let order = self.state.len();
        let (shared, rest) = self.room.0.split_at_mut(order);
        let own = self.model.observation / share;
        let explained = product(&self.covariance, &self.model, x, shared);
        let variance = explained + own;
        if !(variance > 0.0 && variance.is_finite()) {
            return None;
        }
        let root = variance.sqrt();
        let step = error / root;
        for share in shared.iter_mut() {
            *share /= root;
        }
        for (state, share) in self.state.iter_mut().zip(&*shared).take(states) {
            *state += share * step;
        }
        if explained > UNSURE * own {
            let observation = Observation {
                states,
                variance: own * (explained / variance),
                shared: |i: usize| shared[i] * (own / root),
                left: |i: usize, j: usize, value: f64| value - shared[i] * shared[j],
            };
            observation.settle(&mut self.covariance, &self.model, x, &mut rest[..order]);
        } else {
            let rows = self.covariance.chunks_exact_mut(order);
            for (i, (row, a)) in rows.zip(&*shared).enumerate() {
                // What two states that stay have in common stays too.
                let columns = if i < states { order } else { states };
                for (value, b) in row.iter_mut().zip(&*shared).take(columns) {
                    *value -= a * b;
                }
            }
        }
        Some(Innovation {
            error,
            variance,
            diffuse: false,
        })
    }

    /// What is expected `time` from now of the observation that has these regressors; none while that is diffuse.
    ///
    /// # Panics
    /// When `x` has not one value per coefficient.
    #[must_use]
    pub fn forecast(&self, time: f64, x: &[f64]) -> Option<Forecast> {
        assert_eq!(
            self.model.moving() + x.len(),
            self.state.len(),
            "a row has a value per coefficient"
        );
        self.forecast_of(time, |regressor| x[regressor])
    }

    /// The same, the regressors given by their number.
    #[must_use]
    pub fn forecast_of(&self, time: f64, x: impl Fn(usize) -> f64) -> Option<Forecast> {
        let order = self.state.len();
        let weight = |i: usize| match i.checked_sub(self.model.moving()) {
            Some(regressor) => x(regressor),
            None if i == 0 => self.model.kept(time),
            None => time,
        };
        let spread = |matrix: &[f64]| -> f64 {
            let rows = matrix.chunks_exact(order).enumerate();
            rows.map(|(i, row)| {
                let along = row.iter().enumerate().map(|(j, value)| weight(j) * value);
                weight(i) * along.sum::<f64>()
            })
            .sum()
        };
        if self.unknown > 0 {
            let most: f64 = (0..order).map(|i| weight(i).powi(2)).sum();
            if spread(&self.diffuse) > NOTHING_NEW * most {
                return None;
            }
        }
        Some(Forecast {
            mean: self.expected(time, &x),
            variance: (spread(&self.covariance) + self.model.gained(time).level).max(0.0),
        })
    }

    /// Forgets level and trend, of which nothing is known from now on; the coefficients stay.
    pub(super) fn forget_level(&mut self) {
        for state in 0..self.model.moving() {
            self.forget(state);
        }
    }

    /// Whether level and trend can be started afresh from this: there is one pair of a mean and a variance for each of
    /// them, all are finite, and no variance is negative.
    #[must_use]
    pub fn can_restart(&self, known: &[(f64, f64)]) -> bool {
        let fine = |&(mean, variance): &(f64, f64)| {
            mean.is_finite() && variance >= 0.0 && variance.is_finite()
        };
        known.len() == self.model.moving() && known.iter().all(fine)
    }

    /// Starts level and trend afresh from what is known of them, each a mean and a variance; the coefficients stay.
    ///
    /// # Panics
    /// When it [cannot](Self::can_restart).
    pub fn restart_level(&mut self, known: &[(f64, f64)]) {
        assert!(
            self.can_restart(known),
            "level and trend are found together, and what is known of them is finite"
        );
        let order = self.state.len();
        self.forget_level();
        for (state, &(mean, variance)) in known.iter().enumerate() {
            self.state[state] = mean;
            self.covariance[state * order + state] = variance;
            self.diffuse[state * order + state] = 0.0;
            self.unknown -= 1;
        }
    }

    /// Goes on from what another filter knew of the same states, under this one's variances; whether the two have the same
    /// states.
    #[must_use]
    pub fn resume(&mut self, from: &Self) -> bool {
        let same =
            self.model.moving() == from.model.moving() && self.state.len() == from.state.len();
        if same {
            self.state.clone_from(&from.state);
            self.covariance.clone_from(&from.covariance);
            self.diffuse.clone_from(&from.diffuse);
            self.unknown = from.unknown;
        }
        same
    }

    /// Makes a state diffuse.
    fn forget(&mut self, state: usize) {
        let order = self.state.len();
        if self.unknown == 0 {
            self.diffuse.clear();
            self.diffuse.resize(order * order, 0.0);
        }
        let own = &self.diffuse[state * order..][..order];
        let known = own.iter().all(|&diffuse| diffuse == 0.0);
        for other in 0..order {
            for matrix in [&mut self.covariance, &mut self.diffuse] {
                matrix[state * order + other] = 0.0;
                matrix[other * order + state] = 0.0;
            }
        }
        self.diffuse[state * order + state] = 1.0;
        self.state[state] = 0.0;
        if known {
            self.unknown += 1;
        } else {
            // With it goes what had been observed of it together with others.
            self.unknown = rank(self.diffuse.clone(), order);
        }
    }

    /// What is expected `time` from now of the observation that has these regressors, given by their number; of no
    /// meaning while that is diffuse.
    #[must_use]
    #[inline]
    pub fn expected(&self, time: f64, x: impl Fn(usize) -> f64) -> f64 {
        let moving = self.model.moving();
        let mut mean = self.state[0] * self.model.kept(time);
        if moving > 1 {
            mean += time * self.state[1];
        }
        let terms = self.state[moving..].iter().enumerate();
        terms.fold(mean, |sum, (nth, coefficient)| sum + coefficient * x(nth))
    }

    /// Takes an observation of something that nothing is known of; none where all that it shows is known.
    fn learn_of_the_unknown(&mut self, x: &[f64], error: f64, share: f64) -> Option<Innovation> {
        let order = self.state.len();
        let (of_diffuse, rest) = self.room.0.split_at_mut(order);
        let (shared, rest) = rest.split_at_mut(order);
        let variance = product(&self.diffuse, &self.model, x, of_diffuse);
        let most = 1.0 + x.iter().map(|x| x * x).sum::<f64>();
        if variance.is_nan() || variance <= NOTHING_NEW * most {
            return None;
        }
        let own = self.model.observation / share;
        let explained = product(&self.covariance, &self.model, x, shared);
        let finite = explained + own;
        for (state, gain) in self.state.iter_mut().zip(&*of_diffuse) {
            *state += gain / variance * error;
        }
        let left = |i: usize, j: usize, value: f64| {
            let (a, b) = (of_diffuse[i] / variance, of_diffuse[j] / variance);
            value + (a * b * finite - (a * shared[j] + b * shared[i]))
        };
        if explained > UNSURE * own {
            let observation = Observation {
                states: order,
                variance: own,
                shared: |i: usize| of_diffuse[i] / variance * own,
                left,
            };
            observation.settle(&mut self.covariance, &self.model, x, rest);
        } else {
            for (at, value) in self.covariance.iter_mut().enumerate() {
                *value = left(at / order, at % order, *value);
            }
        }
        for i in 0..order {
            for j in 0..order {
                self.diffuse[i * order + j] -= of_diffuse[i] * of_diffuse[j] / variance;
            }
        }
        self.unknown -= 1;
        Some(Innovation {
            error,
            variance,
            diffuse: true,
        })
    }
}
