//! Decides what the author of a fitted feature implements beside [`Feature`](super::Feature): which rows it learns from, and what learns.

use std::any::Any;
use std::fmt::Debug;
use std::sync::Arc;

use super::{Inputs, Predictor, Trainer, TrainingSetup};
use crate::time::Duration;

/// How a feature is fitted: a feature that gives one has a port `truth`, and a graph says `ahead` and `train` of it as of an
/// estimator.
///
/// A row holds its other inputs at some lags, as it saw them at the run that a truth belongs to. It is fitted before all that
/// reads it, once: two fits of an encoder give numbers that mean different things, so that estimators fed by it learn from the
/// rows that it has learned from. What the fit gives stands in the model under the name of the node, and reaches
/// [`Feature::build`](super::Feature::build) as [`Inputs::fit`].
pub trait Encoder: Debug {
    /// The lags at which each channel is read, in the fit and when it runs: a port holds all channels at the first, then all at
    /// the second. The lag 0 is among them, since new values make the node run.
    fn lags(&self) -> Vec<Duration> {
        vec![Duration::ZERO]
    }

    /// Whether it is given, when it runs, the newest truth that a prediction as far ahead may know, and what it saw at the run that this
    /// truth belongs to. Of a truth that is of a window it is also fitted on its inputs so long ago. Behind the ports of its inputs are then
    /// those so long ago, if that is none of its lags; each once more, at all these lags before that run; and one of the truth. How long
    /// ago that run was is in [`Inputs::hindsight`]. No embargo is kept for it: what it gives may not follow from the truth but by being
    /// there or absent.
    fn looks_back(&self) -> bool {
        false
    }

    /// What learns from the rows. Its [`Predictor`] is what `build` is given; it may predict the truth, or nothing.
    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer>;
}

/// How long it takes to know better: what a feature that [looks back](Encoder::looks_back) has to know of the truth that it is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hindsight {
    /// The place of the first port that looks back.
    pub port: usize,
    /// From a run until the truth that belongs to it is given.
    pub delay: Duration,
    /// How much of the past the truth is of.
    pub span: Duration,
}

/// What a feature was fitted to, on its way into what runs.
#[derive(Debug, Clone)]
pub(crate) struct FeatureFit {
    pub(crate) predictor: Arc<dyn Predictor>,
    pub(crate) places: Vec<usize>,
}

impl Inputs {
    /// What was fitted, and where each of the regressors that it [`uses`](Predictor::uses) stands in the values of the ports, one
    /// port after the other; none where nothing has been fitted yet, or something of another type.
    #[must_use]
    pub fn fit<T: Predictor>(&self) -> Option<(&T, &[usize])> {
        let fit = self.fit.as_ref()?;
        let predictor: &dyn Any = &*fit.predictor;
        Some((predictor.downcast_ref()?, &fit.places))
    }
}
