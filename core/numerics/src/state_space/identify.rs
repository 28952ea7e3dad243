//! Decides which state-space model a record has.

use std::ops::RangeInclusive;

use faer::Mat;

use super::lagged::{Lagged, Projected, power, pseudo_inverse, spectrum, windows};
use super::model::{product, spectral_radius};
use super::refine::{beginning, refine};
use super::{Record, StateSpace};
use crate::NumericsError;
use crate::checks::check_parameter;

/// The most states.
pub const MOST_STATES: usize = 20;
/// The slowest mode that is allowed: one that grows is brought back to this.
const SLOWEST: f64 = 0.9995;
/// Singular values below this share of the largest have rounding in them and nothing else.
const ROUNDING: f64 = 1e-8;
/// Steps of the Riccati recursion.
const MOST_STEPS: usize = 10_000;

/// Subspace identification (Van Overschee and De Moor 1996, chapter 4; Ljung 1999, section 10.6).
///
/// The part of the future outputs that the past explains beside the future inputs has a rank: the number of states. Its singular
/// vectors give the states themselves, with which the matrices are least squares; the covariances of what those leave give the
/// Kalman gain. With `refined`, `B`, `D` and the gain are then found anew, so that one-step forecasts err least.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Subspace {
    /// How many samples past and future have each, 2 or more.
    pub horizon: usize,
    /// How future outputs are weighed before their rank is determined.
    pub weighting: Weighting,
    /// How many states.
    pub order: StateOrder,
    /// How many records are of the same time, 1 or more: as many as series were interleaved.
    pub alike: usize,
    /// Whether inputs act on the output of the same sample.
    pub feedthrough: bool,
    /// Whether `B`, `D` and the gain are found anew.
    pub refined: bool,
}

/// How future outputs are weighed before their rank is determined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weighting {
    /// Not at all.
    N4sid,
    /// Less what future inputs explain of the past.
    Moesp,
    /// The same, and outputs by what is left of them: singular values are canonical correlations, 1 at most.
    Cva,
}

/// How many states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StateOrder {
    /// So many.
    Given(usize),
    /// As many as there are singular values before the one that falls most, in proportion; half the horizon at most, and not
    /// more than chance does not explain.
    LargestGap,
    /// As many as there are singular values of at least this share of the largest, and not more than chance does not explain.
    Threshold(f64),
}

/// A model, and what determined its order.
#[derive(Debug, Clone)]
pub struct Identification {
    /// The model.
    pub model: StateSpace,
    /// All singular values, in falling order.
    pub singular_values: Vec<f64>,
    /// Whether a mode grew and was brought back.
    pub stabilised: bool,
    /// The sum of the squares of one-step errors, each record beginning in the state from which they are least and its first
    /// `horizon` not counted, and how many there were.
    pub errors: (f64, usize),
}

impl Subspace {
    /// The longest horizon among these of which records with `width` inputs have enough windows that another follows directly.
    #[must_use]
    pub fn longest(
        horizons: RangeInclusive<usize>,
        records: &[Record<'_>],
        width: usize,
    ) -> Option<usize> {
        let mut longest = horizons.rev();
        longest.find(|&horizon| followed(records, horizon) >= needed(horizon, width))
    }

    /// Identifies a model from records that have `width` inputs. Inputs and outputs should vary about 0 on one scale.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`], [`NumericsError::TooFewStretches`] when there are not twice as many pairs of windows, one a
    /// sample after the other, as a past has values,
    /// [`NumericsError::NotFinite`], [`NumericsError::NoStates`] for outputs that the inputs of the same time explain but for
    /// rounding, [`NumericsError::NoConvergence`].
    pub fn identify(
        &self,
        records: &[Record<'_>],
        width: usize,
    ) -> Result<Identification, NumericsError> {
        self.check(records)?;
        let (needed, found) = (needed(self.horizon, width), followed(records, self.horizon));
        if found < needed {
            return Err(NumericsError::TooFewStretches {
                length: 2 * self.horizon + 1,
                needed,
                found,
            });
        }
        let lagged = Lagged::of(records, width, self.horizon);
        let projected = lagged.projected()?;
        if !projected.leaves_outputs() {
            return Err(NumericsError::NoStates);
        }
        let (values, observability) = self.ranked(&projected)?;
        let order = match self.order {
            StateOrder::Given(order) => order,
            rule => {
                let most = self.beyond_chance(&projected, lagged.windows, width)?;
                rule.of(&values, self.horizon).min(most)
            }
        };
        let order = order.clamp(1, MOST_STATES.min(values.len()));
        let observability = observability.subcols(0, order).to_owned();
        let inverse = pseudo_inverse(&(observability.transpose() * &observability))?;
        let states = inverse * observability.transpose() * &projected.from_past;
        let mut regression = Regression::new(order, width);
        for record in records {
            regression.add(record, &states, self.horizon);
        }
        let mut model = regression.solve(self.feedthrough)?;
        let radius = spectral_radius(&model.a);
        let stabilised = radius > SLOWEST;
        if stabilised {
            let factor = SLOWEST / radius;
            model.a = Mat::from_fn(order, order, |i, j| model.a[(i, j)] * factor);
        }
        model.k = regression.gain(&model);
        if self.refined {
            refine(&mut model, records, width, self.feedthrough)?;
        }
        let mut errors = (0.0, 0);
        for record in records {
            let expected = model.one_step(record, &beginning(&model, record)?);
            for (y, expected) in record.outputs.iter().zip(&expected).skip(self.horizon) {
                errors.0 += (y - expected).powi(2);
                errors.1 += 1;
            }
        }
        Ok(Identification {
            model,
            singular_values: values,
            stabilised,
            errors,
        })
    }

    fn check(&self, records: &[Record<'_>]) -> Result<(), NumericsError> {
        let horizon = self.horizon as f64;
        check_parameter("horizon", horizon, self.horizon >= 2, "2 or more")?;
        match self.order {
            StateOrder::Given(order) => {
                let fine = (1..=self.horizon.min(MOST_STATES)).contains(&order);
                let allowed = "from 1 to the horizon, and at most 20";
                check_parameter("order", order as f64, fine, allowed)?;
            }
            StateOrder::Threshold(share) => {
                let fine = share > 0.0 && share < 1.0;
                check_parameter("threshold", share, fine, "above 0 and below 1")?;
            }
            StateOrder::LargestGap => {}
        }
        let mut values = records
            .iter()
            .flat_map(|record| record.inputs.iter().chain(record.outputs));
        if values.any(|value| !value.is_finite()) {
            return Err(NumericsError::NotFinite);
        }
        Ok(())
    }

    /// How many canonical correlations are larger than the largest that a past would have with a future about which it says
    /// nothing (Wachter 1980).
    fn beyond_chance(
        &self,
        projected: &Projected,
        windows: usize,
        width: usize,
    ) -> Result<usize, NumericsError> {
        let by_correlation = Self {
            weighting: Weighting::Cva,
            ..*self
        };
        let (correlations, _) = by_correlation.ranked(projected)?;
        let windows = windows as f64 / self.alike.max(1) as f64;
        let past = (self.horizon * (width + 1)) as f64 / windows;
        let future = self.horizon as f64 / windows;
        let chance = if past + future < 1.0 {
            (past * (1.0 - future)).sqrt() + (future * (1.0 - past)).sqrt()
        } else {
            1.0
        };
        let beyond = correlations.iter().filter(|&&value| value > chance);
        Ok(beyond.count())
    }

    /// The singular values, and what each state shows of itself in the future outputs.
    fn ranked(&self, projected: &Projected) -> Result<(Vec<f64>, Mat<f64>), NumericsError> {
        let from = &projected.from_past;
        let past = match self.weighting {
            Weighting::N4sid => &projected.past,
            Weighting::Moesp | Weighting::Cva => &projected.past_left,
        };
        let explained = from * past * from.transpose();
        let (squares, shown) = match self.weighting {
            Weighting::N4sid | Weighting::Moesp => spectrum(&explained)?,
            Weighting::Cva => {
                let least = projected.least_output;
                let weight = power(&projected.outputs_left, -0.5, least)?;
                let (squares, vectors) = spectrum(&(&weight * explained * &weight))?;
                (
                    squares,
                    power(&projected.outputs_left, 0.5, least)? * vectors,
                )
            }
        };
        let values: Vec<f64> = squares.iter().map(|square| square.sqrt()).collect();
        if values.first().is_none_or(|&largest| largest <= 0.0) {
            return Err(NumericsError::NoStates);
        }
        let scaled = Mat::from_fn(shown.nrows(), shown.ncols(), |i, j| {
            shown[(i, j)] * values[j].sqrt()
        });
        Ok((values, scaled))
    }
}

/// How many windows another follows directly: only of such a pair is it seen how the states go on. A record that is just as long as
/// a window has none.
fn followed(records: &[Record<'_>], horizon: usize) -> usize {
    let windows = records.iter().map(|record| windows(record, horizon));
    windows.map(|windows| windows.len().saturating_sub(1)).sum()
}

/// The fewest of them that tell what so many inputs and the output do: twice as many as a past has values.
fn needed(horizon: usize, width: usize) -> usize {
    2 * horizon * (width + 1)
}

impl StateOrder {
    fn of(self, values: &[f64], horizon: usize) -> usize {
        match self {
            Self::Given(order) => order,
            Self::Threshold(share) => {
                let least = share * values[0];
                values.iter().take_while(|value| **value >= least).count()
            }
            Self::LargestGap => {
                let most = (horizon / 2).max(1).min(values.len() - 1);
                let least = (ROUNDING * values[0]).max(f64::MIN_POSITIVE);
                let falls = |nth: usize| values[nth - 1].max(least) / values[nth].max(least);
                (1..=most)
                    .reduce(|a, b| if falls(b) > falls(a) { b } else { a })
                    .unwrap_or(1)
            }
        }
    }
}

/// Least squares of next states and outputs on states and inputs.
struct Regression {
    order: usize,
    width: usize,
    /// Products of `(x', y, x, u)`.
    products: Mat<f64>,
    count: usize,
}

impl Regression {
    fn new(order: usize, width: usize) -> Self {
        let all = 2 * order + 1 + width;
        Self {
            order,
            width,
            products: Mat::zeros(all, all),
            count: 0,
        }
    }

    fn add(&mut self, record: &Record<'_>, states: &Mat<f64>, horizon: usize) {
        let state = |at: usize| -> Vec<f64> {
            let inputs = (at - horizon..at).flat_map(|t| record.input(t));
            let past: Vec<f64> = inputs
                .chain(&record.outputs[at - horizon..at])
                .copied()
                .collect();
            (0..self.order)
                .map(|i| (0..past.len()).map(|j| states[(i, j)] * past[j]).sum())
                .collect()
        };
        // States at the last samples of a record have no future that was looked at.
        let end = (record.len() + 1).saturating_sub(horizon);
        let mut last: Option<Vec<f64>> = None;
        for at in horizon..end {
            let next = state(at);
            if let Some(last) = last {
                let mut row = next.clone();
                row.push(record.outputs[at - 1]);
                row.extend(last);
                row.extend_from_slice(record.input(at - 1));
                for (i, a) in row.iter().enumerate() {
                    for (j, b) in row.iter().enumerate() {
                        self.products[(i, j)] += a * b;
                    }
                }
                self.count += 1;
            }
            last = Some(next);
        }
    }

    fn solve(&self, feedthrough: bool) -> Result<StateSpace, NumericsError> {
        let Self { order, width, .. } = *self;
        let from = order + 1;
        let fitted = |targets: (usize, usize), columns: usize| -> Result<Mat<f64>, NumericsError> {
            let own = self.products.submatrix(from, from, columns, columns);
            let cross = self.products.submatrix(targets.0, from, targets.1, columns);
            Ok(cross * pseudo_inverse(&own.to_owned())?)
        };
        let next = fitted((0, order), order + width)?;
        let output = fitted((order, 1), order + if feedthrough { width } else { 0 })?;
        Ok(StateSpace {
            a: next.subcols(0, order).to_owned(),
            b: next.subcols(order, width).to_owned(),
            c: (0..order).map(|i| output[(0, i)]).collect(),
            d: (0..width)
                .map(|j| {
                    if feedthrough {
                        output[(0, order + j)]
                    } else {
                        0.0
                    }
                })
                .collect(),
            k: vec![0.0; order],
        })
    }

    /// The Kalman gain for the covariances of what the model leaves, where the Riccati recursion ends.
    fn gain(&self, model: &StateSpace) -> Vec<f64> {
        let Self { order, width, .. } = *self;
        let all = 2 * order + 1 + width;
        // What is left is `(x', y) − M (x, u)`.
        let taker = Mat::from_fn(order + 1, all, |i, j| {
            let from = order + 1;
            let coefficient = match (i < order, j.checked_sub(from)) {
                (_, None) => return f64::from(u8::from(i == j)),
                (true, Some(j)) if j < order => model.a[(i, j)],
                (true, Some(j)) => model.b[(i, j - order)],
                (false, Some(j)) if j < order => model.c[j],
                (false, Some(j)) => model.d[j - order],
            };
            -coefficient
        });
        let left = &taker * &self.products * taker.transpose();
        let count = self.count.max(1) as f64;
        let left = |i: usize, j: usize| left[(i, j)] / count;
        let mut covariance = Mat::from_fn(order, order, left);
        let mut gain = vec![0.0; order];
        for _ in 0..MOST_STEPS {
            let shown: Vec<f64> = (0..order)
                .map(|i| (0..order).map(|j| covariance[(i, j)] * model.c[j]).sum())
                .collect();
            let variance = product(&model.c, &shown) + left(order, order);
            if variance.is_nan() || variance <= 0.0 {
                return vec![0.0; order];
            }
            let both: Vec<f64> = (0..order)
                .map(|i| {
                    (0..order).map(|j| model.a[(i, j)] * shown[j]).sum::<f64>() + left(i, order)
                })
                .collect();
            let carried = &model.a * &covariance * model.a.transpose();
            covariance = Mat::from_fn(order, order, |i, j| {
                carried[(i, j)] + left(i, j) - both[i] * both[j] / variance
            });
            let new: Vec<f64> = both.iter().map(|both| both / variance).collect();
            let moved = new.iter().zip(&gain).map(|(a, b)| (a - b).abs());
            let moved = moved.fold(0.0, f64::max);
            gain = new;
            if moved < 1e-14 {
                break;
            }
        }
        let filter = Mat::from_fn(order, order, |i, j| model.a[(i, j)] - gain[i] * model.c[j]);
        if gain.iter().all(|k| k.is_finite()) && spectral_radius(&filter) < 1.0 {
            gain
        } else {
            vec![0.0; order]
        }
    }
}
