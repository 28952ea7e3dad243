//! Decides how a fitted linear model goes on learning; how it is fitted, and what it learns from, is decided elsewhere.

use athermal_core::node::{
    Coefficients, Learner, LinearForm, Mistake, Predictor, Restored, State, TrainedRange,
};
use athermal_core::node::{number, number_or_none, numbers};
use athermal_core::time::{Duration, Instant};
use athermal_numerics::{Learned, Novelty, Rls, Sgd, Standardization};
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};

use crate::novelty::{after_learning, novelty_at, novelty_mistakes};
use crate::scaling::scale_mistakes;

/// A truth that misses by more than so many deviations is a leap of the constant: it would move all coefficients by more than a
/// memory of a thousand rows has found out.
const LEAP: f64 = 100.0;
/// One that misses by more than so many deviations counts as if it missed by them (Huber 1964): an hour of wrong truths that are no
/// outliers moves little.
const MOST: f64 = 2.0;

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
        /// A truth says little whose `xᵀP₀x` is below.
        #[serde(with = "number")]
        little: f64,
    },
}

/// What was learned, without the fit that it goes on from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Known {
    Sgd(Sgd),
    /// As a recursion before kept it that forgot to nothing; its form has no heir.
    #[serde(skip_serializing)]
    Rls(IgnoredAny),
    LeastSquares {
        /// The coefficients of the fit, by which it is known again.
        #[serde(with = "numbers")]
        of_fit: Vec<f64>,
        learned: Learned,
        /// When a truth came last.
        last: Option<Instant>,
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
        let Recursion::Rls { rls, .. } = recursion else {
            return f64::NAN;
        };
        (rls.variance() * (1.0 + self.spread(rls, regressors))).sqrt()
    }

    /// The value of a standardised regressor, and after them that of the constant.
    fn value(&self, regressors: &[f64], i: usize) -> f64 {
        match regressors.get(i) {
            Some(x) => (x - self.means[i]) / self.scales[i],
            None => 1.0,
        }
    }

    /// `zᵀPz`: what is not known of the coefficients, in units of the noise.
    fn spread(&self, rls: &Rls, regressors: &[f64]) -> f64 {
        rls.spread(|i| self.value(regressors, i))
    }

    /// The same of the fit.
    pub(crate) fn spread_of_fit(&self, rls: &Rls, regressors: &[f64]) -> f64 {
        rls.spread_of_fit(|i| self.value(regressors, i))
    }

    /// What is predicted in the middle of the rows of the fit.
    fn centre(&self, recursion: &Recursion) -> f64 {
        recursion.weights().1 + self.level
    }

    /// The standard errors of the intercept and of the coefficients on the scale of the data; none where the recursion knows
    /// nothing of them.
    fn errors(&self, recursion: &Recursion) -> Option<Vec<f64>> {
        let Recursion::Rls { rls, .. } = recursion else {
            return None;
        };
        let (width, noise) = (self.scales.len(), rls.variance().sqrt());
        let of_intercept = rls.spread(|i| {
            if i < width {
                -self.means[i] / self.scales[i]
            } else {
                1.0
            }
        });
        let one = |nth: usize| rls.spread(|i| f64::from(u8::from(i == nth)));
        let scaled = self.scales.iter().enumerate();
        let scaled = scaled.map(|(nth, scale)| one(nth) / (scale * scale));
        let all = std::iter::once(of_intercept).chain(scaled);
        Some(all.map(|variance| noise * variance.sqrt()).collect())
    }
}

impl Recursion {
    /// What does not fit so many regressors.
    fn mistakes(&self, width: usize) -> Vec<Mistake> {
        match self {
            Self::Sgd(sgd) => Mistake::of_lengths(width, &[("weights", sgd.weights().len())]),
            Self::Rls { rls, .. } => {
                let coefficients = [("coefficients", rls.coefficients().len())];
                Mistake::of_lengths(width + 1, &coefficients)
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
        let mut learner = OnlineLearner {
            coefficients: self.coefficients.clone(),
            intercept: self.intercept,
            row: vec![1.0; self.coefficients.len() + 1],
            frame: self.frame.clone(),
            recursion: self.recursion.clone(),
            rmse: self.rmse,
            novelty: self.novelty.clone(),
            leaps: true,
            last: None,
        };
        learner.refresh();
        Some(Box::new(learner))
    }

    fn trained_range(&self) -> Option<&TrainedRange> {
        Some(&self.range)
    }
}

athermal_core::predictor!(OnlinePredictor, "online_linear");

/// What has been learned: enough to go on from a fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct OnlineState {
    frame: Frame,
    recursion: Known,
}

athermal_core::state!(OnlineState, "online_linear/1");

/// A linear model that goes on learning.
#[derive(Debug)]
struct OnlineLearner {
    frame: Frame,
    recursion: Recursion,
    /// The model of now, on the scale of the data.
    coefficients: Vec<f64>,
    intercept: f64,
    row: Vec<f64>,
    /// What stays as the fit found it.
    rmse: Option<f64>,
    novelty: Option<Novelty>,
    /// Whether a truth can leap: a difference over a window has no origin that could be set anew.
    leaps: bool,
    /// When a truth was learned from or passed over last.
    last: Option<Instant>,
}

impl OnlineLearner {
    /// By how much a truth misses, and what is usual.
    fn misses(&self, regressors: &[f64], truth: f64, at: Instant) -> (f64, f64) {
        let usual = match &self.recursion {
            Recursion::Sgd(_) => self.usual_error(),
            Recursion::Rls { .. } => self.std_dev(regressors, at),
        };
        (truth - self.predict(regressors, at), usual)
    }

    /// Moves the constant alone where a truth misses by so much that it has leapt; whether it has.
    fn leapt(&mut self, width: usize, (by, usual): (f64, f64)) -> bool {
        // Written so that NaN fails.
        let leapt = self.leaps && by.is_finite() && by.abs() > LEAP * usual && usual > 0.0;
        if leapt {
            match &mut self.recursion {
                Recursion::Sgd(sgd) => sgd.shift(by),
                // Whether it stays there shows at the next truths.
                Recursion::Rls { rls, .. } => rls.shift(width, by),
            }
        }
        leapt
    }

    fn refresh(&mut self) {
        self.intercept = self.frame.unscaled(&self.recursion, &mut self.coefficients);
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
        self.frame.std_dev(&self.recursion, regressors)
    }

    fn novelty(&self, regressors: &[f64]) -> f64 {
        let novelty = novelty_at(self.novelty.as_ref(), regressors);
        match &self.recursion {
            Recursion::Rls { rls, .. } => after_learning(novelty, || {
                let of_fit = self.frame.spread_of_fit(rls, regressors);
                [self.frame.spread(rls, regressors), of_fit]
            }),
            Recursion::Sgd(_) => novelty,
        }
    }

    fn centre(&self, _of: Instant) -> f64 {
        self.frame.centre(&self.recursion)
    }

    fn usual_error(&self) -> f64 {
        self.rmse.unwrap_or(f64::NAN)
    }

    fn set_window(&mut self, window: Duration) {
        // A step of stochastic gradients has no other bound.
        self.leaps = window == Duration::ZERO || matches!(self.recursion, Recursion::Sgd(_));
    }

    fn memory(&self) -> Option<Duration> {
        match &self.recursion {
            Recursion::Sgd(_) => None,
            Recursion::Rls { rls, .. } => {
                let longest = Duration::from_ns(i64::MAX);
                Some(Duration::from_secs_f64(rls.fit().memory_s).unwrap_or(longest))
            }
        }
    }

    fn says_little(&self, regressors: &[f64]) -> bool {
        match &self.recursion {
            Recursion::Sgd(_) => false,
            Recursion::Rls { rls, little } => self.frame.spread_of_fit(rls, regressors) < *little,
        }
    }

    fn pass_over(&mut self, _regressors: &[f64], _truth: f64, at: Instant) {
        self.last = Some(at);
    }

    fn learn(&mut self, regressors: &[f64], truth: f64, at: Instant) {
        let after_s = self.last.map_or(0.0, |last| (at - last).secs().max(0.0));
        self.last = Some(at);
        let (by, usual) = self.misses(regressors, truth, at);
        if self.leapt(regressors.len(), (by, usual)) {
            return self.refresh();
        }
        self.frame.standardise(regressors, &mut self.row);
        let truth = truth - self.frame.level;
        match &mut self.recursion {
            Recursion::Sgd(sgd) => {
                sgd.step(&self.row[..regressors.len()], truth);
            }
            Recursion::Rls { rls, .. } => {
                let most = MOST * usual;
                let truth = match by.abs() > most {
                    true => truth - by + most.copysign(by),
                    false => truth,
                };
                rls.step(&self.row, truth, after_s);
            }
        }
        self.refresh();
    }

    fn segment(&mut self, shift: Duration) {
        self.last = self.last.map(|last| last + shift);
    }

    fn snapshot(&self) -> Box<dyn State> {
        Box::new(OnlineState {
            frame: self.frame.clone(),
            recursion: match &self.recursion {
                Recursion::Sgd(sgd) => Known::Sgd(sgd.clone()),
                Recursion::Rls { rls, .. } => Known::LeastSquares {
                    of_fit: rls.fit().coefficients.clone(),
                    learned: rls.learned().clone(),
                    last: self.last,
                },
            },
        })
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        let OnlineState { frame, recursion } = match state.known() {
            Ok(known) => known,
            Err(cold) => return cold,
        };
        if frame.regressors != self.frame.regressors {
            return Restored::cold("another fit chose other regressors");
        }
        let width = frame.regressors.len();
        match (recursion, &mut self.recursion) {
            (Known::Sgd(known), Recursion::Sgd(own)) => {
                let known = Recursion::Sgd(known.with(own.options()));
                if !(frame.mistakes().is_empty() && known.mistakes(width).is_empty()) {
                    return Restored::cold("its parts do not fit together");
                }
                (self.frame, self.recursion) = (frame, known);
            }
            (
                Known::LeastSquares {
                    of_fit,
                    learned,
                    last,
                },
                Recursion::Rls { rls, .. },
            ) => {
                if frame != self.frame || of_fit != rls.fit().coefficients {
                    return Restored::cold("another fit begins from what it knows itself");
                }
                if !rls.resume(&learned) {
                    return Restored::cold("its parts do not fit together");
                }
                self.last = last;
            }
            _ => return Restored::cold("it learned by another recursion"),
        }
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
