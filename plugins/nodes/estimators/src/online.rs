//! Decides how a fitted linear model goes on learning; how it is fitted, and what it learns from, is decided elsewhere.

use athermal_core::node::{
    Coefficients, Learner, LinearForm, Mistake, Predictor, Restored, State, TrainedRange,
};
use athermal_core::node::{number, number_or_none, numbers};
use athermal_core::time::Instant;
use athermal_numerics::{Novelty, Rls, Sgd, Standardization};
use serde::{Deserialize, Serialize};

use crate::novelty::{after_learning, novelty_at, novelty_mistakes};
use crate::scaling::scale_mistakes;

/// A truth that misses by more than so many deviations is a leap of the constant: it would move all coefficients by more than a
/// memory of a thousand rows has found out.
const LEAP: f64 = 100.0;
/// How large the variance of a leap is at most, in that of the noise: beyond, rounding would be more than noise.
const WIDEST: f64 = 1e12;

/// Regressors as the recursion sees them: standardised as in the fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Frame {
    pub(crate) regressors: Vec<String>,
    #[serde(with = "numbers")]
    means: Vec<f64>,
    #[serde(with = "numbers")]
    scales: Vec<f64>,
    /// What is subtracted from the truth.
    #[serde(with = "number")]
    level: f64,
}

/// What goes on, row by row.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Recursion {
    /// Stochastic gradients, with an intercept of their own.
    Sgd(Sgd),
    /// Recursive least squares, the intercept being the last coefficient.
    Rls {
        /// The recursion.
        rls: Rls,
        /// The standard deviation of the noise, in the unit of the truth.
        #[serde(with = "number")]
        noise: f64,
    },
}

impl Frame {
    pub(crate) fn new(
        regressors: Vec<String>,
        columns: &[usize],
        standard: &Standardization,
        level: f64,
    ) -> Self {
        let of = |all: &[f64]| columns.iter().map(|&column| all[column]).collect();
        Self {
            regressors,
            means: of(&standard.means),
            scales: of(&standard.scales),
            level,
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let width = self.regressors.len();
        scale_mistakes(width, ("means", &self.means), ("scales", &self.scales))
    }

    /// Puts the standardised values at the beginning of a row.
    fn standardise(&self, regressors: &[f64], row: &mut [f64]) {
        let ends = self.means.iter().zip(&self.scales);
        for ((place, x), (mean, scale)) in row.iter_mut().zip(regressors).zip(ends) {
            *place = (x - mean) / scale;
        }
    }

    /// Coefficients on the scale of the data as those of standardised regressors, the intercept last.
    pub(crate) fn scaled(&self, coefficients: &[f64], intercept: f64) -> Vec<f64> {
        let ends = self.means.iter().zip(&self.scales);
        let products = coefficients.iter().zip(&self.means);
        let shift: f64 = products.map(|(b, mean)| b * mean).sum();
        let scaled = coefficients
            .iter()
            .zip(ends)
            .map(|(b, (_, scale))| b * scale);
        scaled.chain([intercept + shift - self.level]).collect()
    }

    /// The coefficients on the scale of the data, and the intercept.
    fn unscaled(&self, recursion: &Recursion, coefficients: &mut [f64]) -> f64 {
        let (weights, intercept) = recursion.weights();
        for ((place, weight), scale) in coefficients.iter_mut().zip(weights).zip(&self.scales) {
            *place = weight / scale;
        }
        // In strands, since it is done for each truth that is learned.
        intercept + self.level - form(0.0, coefficients).at(&self.means)
    }

    /// `s √(1 + zᵀPz)`: the noise, and what is not known of the coefficients; NaN where the recursion knows neither.
    fn std_dev(&self, recursion: &Recursion, regressors: &[f64]) -> f64 {
        let Recursion::Rls { rls, noise } = recursion else {
            return f64::NAN;
        };
        noise * (1.0 + self.spread(rls, regressors)).sqrt()
    }

    /// `zᵀPz`: what is not known of the coefficients, in units of the noise.
    fn spread(&self, rls: &Rls, regressors: &[f64]) -> f64 {
        rls.spread(|i| match regressors.get(i) {
            Some(x) => (x - self.means[i]) / self.scales[i],
            None => 1.0,
        })
    }

    /// What is predicted in the middle of the rows of the fit.
    fn centre(&self, recursion: &Recursion) -> f64 {
        recursion.weights().1 + self.level
    }

    /// The standard errors of the intercept and of the coefficients on the scale of the data; none where the recursion knows
    /// nothing of them.
    fn errors(&self, recursion: &Recursion) -> Option<Vec<f64>> {
        let Recursion::Rls { rls, noise } = recursion else {
            return None;
        };
        let width = self.scales.len();
        let of_intercept = rls.spread(|i| {
            if i < width {
                -self.means[i] / self.scales[i]
            } else {
                1.0
            }
        });
        let variances = rls.covariance().iter().step_by(width + 2);
        let scaled = variances
            .zip(&self.scales)
            .map(|(variance, scale)| variance / (scale * scale));
        let all = std::iter::once(of_intercept).chain(scaled);
        Some(all.map(|variance| noise * variance.sqrt()).collect())
    }
}

impl Recursion {
    /// What does not fit so many regressors.
    fn mistakes(&self, width: usize) -> Vec<Mistake> {
        match self {
            Self::Sgd(sgd) => Mistake::of_lengths(width, &[("weights", sgd.weights().len())]),
            Self::Rls { rls, noise } => {
                let coefficients = [("coefficients", rls.coefficients().len())];
                let mut mistakes = Mistake::of_lengths(width + 1, &coefficients);
                // Not a number where rows were too few to tell.
                if *noise < 0.0 || noise.is_infinite() {
                    let message = format!("`noise` is {noise} and must be from 0 on");
                    mistakes.push(Mistake::at("noise", message));
                }
                mistakes
            }
        }
    }

    /// The weights of the standardised regressors, and the intercept.
    fn weights(&self) -> (&[f64], f64) {
        match self {
            Self::Sgd(sgd) => (sgd.weights(), sgd.intercept()),
            Self::Rls { rls, .. } => {
                let (intercept, weights) = rls
                    .coefficients()
                    .split_last()
                    .expect("the intercept is always a coefficient");
                (weights, *intercept)
            }
        }
    }
}

/// A fitted linear model that can go on learning.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OnlinePredictor {
    /// The model as it was fitted, on the scale of the data.
    #[serde(with = "numbers")]
    coefficients: Vec<f64>,
    #[serde(with = "number")]
    intercept: f64,
    frame: Frame,
    recursion: Recursion,
    /// The range of the regressors in the fit.
    range: TrainedRange,
    /// The root mean square of the errors of the fit, where nothing else says how large they are.
    #[serde(
        default,
        with = "number_or_none",
        skip_serializing_if = "Option::is_none"
    )]
    rmse: Option<f64>,
    /// How far regressors are from those of the fit, where its rows say so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    novelty: Option<Novelty>,
}

impl OnlinePredictor {
    pub(crate) fn new(
        frame: Frame,
        recursion: Recursion,
        range: TrainedRange,
        rmse: Option<f64>,
        novelty: Option<Novelty>,
    ) -> Self {
        let mut coefficients = vec![0.0; frame.regressors.len()];
        let intercept = frame.unscaled(&recursion, &mut coefficients);
        Self {
            coefficients,
            intercept,
            frame,
            recursion,
            range,
            rmse,
            novelty,
        }
    }
}

impl Predictor for OnlinePredictor {
    fn uses(&self) -> &[String] {
        &self.frame.regressors
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let width = self.frame.regressors.len();
        let lists = [("coefficients", self.coefficients.len())];
        let mut mistakes = Mistake::of_lengths(width, &lists);
        mistakes.extend(self.frame.mistakes());
        mistakes.extend(self.recursion.mistakes(width));
        mistakes.extend(self.range.mistakes(width));
        mistakes.extend(novelty_mistakes(self.novelty.as_ref(), width));
        mistakes
    }

    fn predict(&self, regressors: &[f64]) -> f64 {
        form(self.intercept, &self.coefficients).at(regressors)
    }

    fn linear(&self) -> Option<LinearForm<'_>> {
        Some(form(self.intercept, &self.coefficients))
    }

    fn std_dev(&self, regressors: &[f64]) -> f64 {
        self.frame.std_dev(&self.recursion, regressors)
    }

    fn novelty(&self, regressors: &[f64]) -> f64 {
        novelty_at(self.novelty.as_ref(), regressors)
    }

    fn centre(&self) -> f64 {
        self.frame.centre(&self.recursion)
    }

    fn coefficients(&self) -> Option<Coefficients> {
        let errors = self.frame.errors(&self.recursion);
        let (constant, values) = (self.intercept, &self.coefficients);
        Some(Coefficients::linear(constant, values, errors.as_deref()))
    }

    fn learner(&self) -> Option<Box<dyn Learner>> {
        let state = OnlineState {
            frame: self.frame.clone(),
            recursion: self.recursion.clone(),
        };
        let fit = OfFit {
            rmse: self.rmse,
            novelty: self.novelty.clone(),
            rls: match &self.recursion {
                Recursion::Rls { rls, .. } if self.novelty.is_some() => Some(rls.clone()),
                _ => None,
            },
        };
        Some(Box::new(OnlineLearner::new(state, fit)))
    }

    fn trained_range(&self) -> Option<&TrainedRange> {
        Some(&self.range)
    }
}

athermal_core::predictor!(OnlinePredictor, "online_linear");

/// What has been learned: enough to go on, whatever the fit that it is carried to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct OnlineState {
    frame: Frame,
    recursion: Recursion,
}

athermal_core::state!(OnlineState, "online_linear/1");

/// A linear model that goes on learning.
#[derive(Debug)]
struct OnlineLearner {
    state: OnlineState,
    /// The model of now, on the scale of the data.
    coefficients: Vec<f64>,
    intercept: f64,
    row: Vec<f64>,
    fit: OfFit,
}

/// What a learner goes by that stays as the fit found it.
#[derive(Debug)]
struct OfFit {
    rmse: Option<f64>,
    novelty: Option<Novelty>,
    /// Where the recursion began, where there is a novelty.
    rls: Option<Rls>,
}

impl OnlineLearner {
    fn new(state: OnlineState, fit: OfFit) -> Self {
        let width = state.frame.regressors.len();
        let mut learner = Self {
            coefficients: vec![0.0; width],
            intercept: 0.0,
            row: vec![1.0; width + 1],
            fit,
            state,
        };
        learner.refresh();
        learner
    }

    /// Moves the constant alone where a truth misses by so much that it has leapt; whether it has.
    fn leapt(&mut self, regressors: &[f64], truth: f64, at: Instant) -> bool {
        let by = truth - self.predict(regressors, at);
        let usual = match &self.state.recursion {
            Recursion::Sgd(_) => self.usual_error(),
            Recursion::Rls { .. } => self.std_dev(regressors, at),
        };
        // Written so that NaN fails.
        let leapt = by.is_finite() && by.abs() > LEAP * usual && usual > 0.0;
        if leapt {
            match &mut self.state.recursion {
                Recursion::Sgd(sgd) => sgd.shift(by),
                Recursion::Rls { rls, noise } => {
                    // Whether it stays there shows at the next truth.
                    let variance = (by / *noise).powi(2).min(WIDEST);
                    rls.shift(regressors.len(), by, variance);
                }
            }
        }
        leapt
    }

    fn refresh(&mut self) {
        let OnlineState { frame, recursion } = &self.state;
        self.intercept = frame.unscaled(recursion, &mut self.coefficients);
    }
}

impl Learner for OnlineLearner {
    fn predict(&self, regressors: &[f64], _of: Instant) -> f64 {
        form(self.intercept, &self.coefficients).at(regressors)
    }

    fn linear(&self) -> Option<LinearForm<'_>> {
        Some(form(self.intercept, &self.coefficients))
    }

    fn std_dev(&self, regressors: &[f64], _of: Instant) -> f64 {
        let OnlineState { frame, recursion } = &self.state;
        frame.std_dev(recursion, regressors)
    }

    fn novelty(&self, regressors: &[f64]) -> f64 {
        let novelty = novelty_at(self.fit.novelty.as_ref(), regressors);
        let OnlineState { frame, recursion } = &self.state;
        match (recursion, &self.fit.rls) {
            (Recursion::Rls { rls, .. }, Some(of_fit)) => after_learning(novelty, || {
                [rls, of_fit].map(|rls| frame.spread(rls, regressors))
            }),
            _ => novelty,
        }
    }

    fn centre(&self, _of: Instant) -> f64 {
        self.state.frame.centre(&self.state.recursion)
    }

    fn usual_error(&self) -> f64 {
        self.fit.rmse.unwrap_or(f64::NAN)
    }

    fn learn(&mut self, regressors: &[f64], truth: f64, at: Instant) {
        if self.leapt(regressors, truth, at) {
            return self.refresh();
        }
        let OnlineState { frame, recursion } = &mut self.state;
        frame.standardise(regressors, &mut self.row);
        let truth = truth - frame.level;
        match recursion {
            Recursion::Sgd(sgd) => {
                sgd.step(&self.row[..regressors.len()], truth);
            }
            Recursion::Rls { rls, .. } => {
                rls.step(&self.row, truth);
            }
        }
        self.refresh();
    }

    fn snapshot(&self) -> Box<dyn State> {
        Box::new(self.state.clone())
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        let mut known = match state.known::<OnlineState>() {
            Ok(known) => known,
            Err(cold) => return cold,
        };
        if known.frame.regressors != self.state.frame.regressors {
            return Restored::cold("another fit chose other regressors");
        }
        let width = known.frame.regressors.len();
        if !(known.frame.mistakes().is_empty() && known.recursion.mistakes(width).is_empty()) {
            return Restored::cold("its parts do not fit together");
        }
        // What was learned goes on; how it goes on is said by the parameters of now.
        known.recursion = match (known.recursion, &self.state.recursion) {
            (Recursion::Sgd(known), Recursion::Sgd(own)) => {
                Recursion::Sgd(known.with(own.options()))
            }
            (Recursion::Rls { rls, .. }, Recursion::Rls { rls: own, noise }) => Recursion::Rls {
                rls: rls.with(own.options()),
                noise: *noise,
            },
            _ => return Restored::cold("it learned by another recursion"),
        };
        self.state = known;
        self.refresh();
        Restored::Accepted
    }
}

fn form(constant: f64, coefficients: &[f64]) -> LinearForm<'_> {
    LinearForm {
        constant,
        coefficients,
    }
}
