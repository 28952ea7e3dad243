//! A fitted estimator at work: which regressors it is given, and when it gives nothing.

use std::sync::Arc;

use super::edge::Edge;
use super::gather::Gathered;
use super::part::Part;
use crate::channel::unless_infinite;
use crate::compile::{Gather, Outside, PlannedNode, PlannedRole, TruthLink};
use crate::engine::learning::Feedback;
use crate::engine::learning::GatedLearner;
use crate::engine::state::NodeState;
use crate::engine::{EngineError, Mode};
use crate::node::{FeatureFit, LinearForm, Predictor, Regressor, Restored};
use crate::time::{Duration, Instant};

/// Where each of the regressors that a fit uses is among those of its node.
///
/// # Errors
/// When the node has none of a name that the fit uses.
fn places_of(
    node: &PlannedNode,
    regressors: &[Regressor],
    fit: &dyn Predictor,
) -> Result<Vec<usize>, EngineError> {
    let names = || regressors.iter().map(|regressor| &regressor.name);
    let place = |name: &String| {
        let place = names().position(|known| known == name);
        place.ok_or_else(|| EngineError::UnknownRegressor {
            node: node.instance(),
            regressor: name.clone(),
            known: names().cloned().collect(),
        })
    };
    fit.uses().iter().map(place).collect()
}

/// What a feature was fitted to, as what runs is built from it.
///
/// # Errors
/// When the node has no regressor of a name that the fit uses.
pub(crate) fn fit_of(
    node: &PlannedNode,
    regressors: &[Regressor],
    predictor: &Arc<dyn Predictor>,
) -> Result<FeatureFit, EngineError> {
    Ok(FeatureFit {
        places: places_of(node, regressors, &**predictor)?,
        predictor: Arc::clone(predictor),
    })
}

/// What comes out where something was predicted at `now` from values of which the oldest has a stamp: nothing without a
/// finite prediction.
#[inline]
pub(crate) fn given(prediction: f64, oldest: Instant, now: Instant) -> (f64, Instant) {
    if prediction.is_finite() {
        (prediction, oldest)
    } else {
        (f64::NAN, now)
    }
}

/// A fitted estimator in a running plan.
#[derive(Debug)]
pub(crate) struct Estimate {
    predictor: Arc<dyn Predictor>,
    /// Where the regressors that it uses are, in their order.
    parts: Box<[Part]>,
    /// How many they are.
    width: usize,
    /// Whether nothing is asked of it but its prediction, from what was measured; it may learn.
    plain: bool,
    takes_absent: bool,
    /// What goes on learning, where the plan wants it: it then predicts in place of the predictor.
    pub(crate) learning: Option<Box<GatedLearner>>,
    /// The edge of the rows of the fit, where anybody heeds it.
    pub(crate) edge: Option<Edge>,
    /// How far the row of this tick is outside of it; NaN where that is not known.
    pub(crate) novelty: f64,
    /// What is read in place of measured past truths, in an evaluation of several steps.
    feedback: Option<Box<Feedback>>,
}

impl Estimate {
    /// Finds the regressors that a predictor uses.
    ///
    /// # Errors
    /// When the node has no regressor of a name that the predictor uses, or is to learn and the predictor does not.
    pub(crate) fn new(
        node: &PlannedNode,
        predictor: Arc<dyn Predictor>,
        widths: &[usize],
    ) -> Result<Self, EngineError> {
        let PlannedRole::Estimator {
            fit,
            gathers,
            learning,
            std_dev,
            novelty,
            outside,
            ..
        } = &node.role
        else {
            return Err(EngineError::NotAnEstimator {
                node: node.instance(),
            });
        };
        let places: Vec<_> = gathers
            .iter()
            .flat_map(|&gather| (0..widths[gather]).map(move |place| (gather, place)))
            .collect();
        let used = places_of(node, &fit.regressors, &*predictor)?;
        let used_of_gathers: Vec<_> = used.iter().map(|&index| places[index]).collect();
        let same_gather = |one: &(usize, usize), other: &(usize, usize)| one.0 == other.0;
        let parts = used_of_gathers.chunk_by(same_gather).map(|part| {
            let places: Vec<_> = part.iter().map(|&(_, place)| place).collect();
            Part::new(part[0].0, &places)
        });
        let parts = parts.collect();
        let learning = learning.map(|planned| {
            let learning = GatedLearner::new(&predictor, planned, fit.truth, fit.training);
            learning.map(Box::new).ok_or_else(|| {
                let node = node.instance();
                EngineError::DoesNotLearn { node }
            })
        });
        let heeded = novelty.is_some() || *outside != Outside::Pass;
        Ok(Self {
            width: used.len(),
            plain: std_dev.is_none(),
            edge: heeded.then(|| Edge::new(*outside)),
            novelty: f64::NAN,
            takes_absent: predictor.takes_absent(),
            predictor,
            parts,
            learning: learning.transpose()?,
            feedback: None,
        })
    }

    /// Predicts from past truths as a mode allows.
    pub(crate) fn predict_in(&mut self, mode: Mode, link: &TruthLink, gathers: &[Gather]) {
        let entries = self.parts.iter().flat_map(|part| part.entries(gathers));
        self.feedback = match mode {
            Mode::OneStep => None,
            mode => Feedback::new(mode, link, &entries.collect::<Vec<_>>()).map(Box::new),
        };
        self.plain &= self.feedback.is_none();
        if let Some(learning) = &mut self.learning {
            learning.predict_in(mode);
        }
    }

    /// How long a step of it was planned to be, which is none where it is as long as the time between truths; none of either where
    /// no past truth changes what it predicts in the mode that it is in.
    pub fn step(&self) -> Option<Option<Duration>> {
        let read = self.feedback.as_ref().map(|feedback| feedback.step());
        let followed = self.learning.as_ref().map(|learning| learning.step());
        read.max(followed)
    }

    /// How many regressors it reads.
    pub(crate) fn width(&self) -> usize {
        self.width
    }

    /// What is read in place of measured past truths.
    pub(crate) fn feedback(&mut self) -> Option<&mut Feedback> {
        self.feedback.as_deref_mut()
    }

    /// What the prediction is, where it is a linear form and nothing else is asked of it; it may learn.
    pub(crate) fn form(&self) -> Option<LinearForm<'_>> {
        self.linear().filter(|_| self.plain)
    }

    /// The same whatever else is asked of it.
    pub(crate) fn linear(&self) -> Option<LinearForm<'_>> {
        let form = match &self.learning {
            Some(learning) => learning.form(),
            None => self.predictor.linear(),
        };
        form.filter(|form| form.coefficients.len() == self.width)
    }

    /// Where the regressors are.
    pub(crate) fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// The prediction at a tick and its stamp, the oldest among the values used; NaN where one of them is missing that is needed.
    ///
    /// All regressors are left in `row`, and `on` says whether learning goes on.
    #[inline(never)]
    pub(crate) fn run(
        &mut self,
        gathered: &[Gathered],
        row: &mut [f64],
        now: Instant,
        on: bool,
    ) -> (f64, Instant) {
        let (mut whole, mut oldest) = self.read(gathered, row, now);
        whole |= self.takes_absent;
        // Where none of several regressors is there, none had a stamp.
        whole &= oldest < Instant::MAX;
        if let Some(learning) = &mut self.learning {
            // What is learned from was measured, whatever stands in for it in a prediction.
            learning.run(whole.then_some(&*row), now, gathered, on);
        }
        if let Some(mut feedback) = self.feedback.take() {
            feedback.replace(row, now, |row, at| self.predict(row, at));
            whole = self.takes_absent || row.iter().all(|value| !value.is_nan());
            oldest = oldest.min(now);
            self.feedback = Some(feedback);
        }
        let mut prediction = f64::NAN;
        self.novelty = f64::NAN;
        if whole {
            self.novelty = self.novelty_at(row);
            prediction = self.bounded(row, now, self.novelty);
        }
        if let Some(mut feedback) = self.feedback.take() {
            let std_dev = self.std_dev_of_one(row, now);
            feedback.ran(row, prediction, std_dev, now, |row, at| {
                self.predict(row, at)
            });
            self.feedback = Some(feedback);
        }
        given(prediction, oldest, now)
    }

    /// The prediction from regressors at an instant: that of what goes on learning, else of the fit.
    #[inline]
    fn predict(&self, row: &[f64], at: Instant) -> f64 {
        self.bounded(row, at, self.novelty_at(row))
    }

    /// The same where it is known how far the row is outside.
    #[inline]
    fn bounded(&self, row: &[f64], at: Instant, novelty: f64) -> f64 {
        let prediction = match &self.learning {
            Some(learning) => learning.predict(row, at),
            None => self.predictor.predict(row),
        };
        match self.edge {
            Some(edge) => edge.bounded(prediction, novelty, || self.centre(at)),
            None => prediction,
        }
    }

    /// How far a row is outside, 1 at the edge; NaN where that is not known or nobody asks.
    #[inline]
    fn novelty_at(&self, row: &[f64]) -> f64 {
        if self.edge.is_none() {
            return f64::NAN;
        }
        self.novelty_of(row)
    }

    /// The same whoever asks.
    #[inline]
    pub(crate) fn novelty_of(&self, row: &[f64]) -> f64 {
        unless_infinite(match &self.learning {
            Some(learning) => learning.novelty(row),
            None => self.predictor.novelty(row),
        })
    }

    /// What it predicts at an instant in the middle of the rows of the fit.
    pub(crate) fn centre(&self, at: Instant) -> f64 {
        match &self.learning {
            Some(learning) => learning.centre(at),
            None => self.predictor.centre(),
        }
    }

    /// Reads the row: whether all of it is there, and the oldest stamp of what is.
    #[inline]
    fn read(&self, gathered: &[Gathered], mut row: &mut [f64], now: Instant) -> (bool, Instant) {
        let nothing_needed = if self.parts.is_empty() {
            now
        } else {
            Instant::MAX
        };
        let (mut whole, mut oldest) = (true, nothing_needed);
        for part in &self.parts {
            let (piece, rest) = row.split_at_mut(part.len());
            row = rest;
            let (all, stamp) = part.read(gathered, piece);
            whole &= all;
            oldest = oldest.min(stamp);
        }
        (whole, oldest)
    }

    /// The standard deviation of the truth about the prediction of this tick, which was made from a row.
    pub(crate) fn std_dev(&self, row: &[f64], prediction: f64, now: Instant) -> f64 {
        let widened = self.feedback.as_ref().map_or(1.0, |of| of.widened());
        let mut std_dev = widened * self.std_dev_of_one(row, now);
        if let Some(edge) = &self.edge {
            std_dev = edge.widened(std_dev, prediction, self.novelty, || self.centre(now));
        }
        if std_dev.is_finite() {
            std_dev
        } else {
            f64::NAN
        }
    }

    /// The same from past truths that were all measured.
    fn std_dev_of_one(&self, row: &[f64], now: Instant) -> f64 {
        match &self.learning {
            Some(learning) => learning.std_dev(row, now),
            None => self.predictor.std_dev(row),
        }
    }

    /// What goes on learning.
    pub(crate) fn learning(&mut self) -> Option<&mut GatedLearner> {
        self.learning.as_deref_mut()
    }

    /// The segment has ended with this tick.
    pub(crate) fn segment(&mut self, last: Instant, gathered: &[Gathered], on: bool) {
        if let Some(learning) = &mut self.learning {
            learning.segment(last, gathered, on);
        }
        if let Some(feedback) = &mut self.feedback {
            feedback.segment();
        }
    }

    /// What was learned since the fit.
    pub(crate) fn snapshot(&self) -> NodeState {
        self.learning
            .as_deref()
            .map(GatedLearner::snapshot)
            .unwrap_or_default()
    }

    /// Goes on from what was learned.
    pub(crate) fn restore(&mut self, state: &NodeState) -> Restored {
        match &mut self.learning {
            Some(learning) => learning.restore(state),
            None if state.own.is_some() => Restored::cold("it does not learn any more"),
            None => Restored::Accepted,
        }
    }

    /// Asks for the prediction from any values.
    pub fn ask_idly(&self, value: &mut dyn FnMut() -> f64) {
        let row: Vec<f64> = (0..self.width).map(|_| value()).collect();
        self.predictor.predict(&row);
        self.predict(&row, Instant::from_ns(0));
    }
}
