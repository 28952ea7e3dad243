//! The estimator that is fitted once and then learns from every truth: recursive least squares.

use athermal_core::node::{
    Estimator, InputPort, Learns, Mistake, Predictor, Regressors, Trained, Trainer, TrainingError,
    TrainingReport, TrainingSetup, TruthLags, between_lessons,
};
use athermal_core::time::{Duration, Instant};
use athermal_numerics::{RlsFit, information_of};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::features::too_many;
use crate::lags::repeated;
use crate::online::{Frame, OnlinePredictor, Recursion};
use crate::penalty::Penalty;
use crate::regression::LinearTrainer;
use crate::selection::Selection;
use crate::solver::Solver;
use crate::unsolved::unsolved;

/// Recursive least squares: linear regression that goes on learning while it runs, and goes back to its fit.
///
/// Predicts `b₀ + Σ b_j x_j` from features and, with `lags`, the past of the truth. The fit is that of `linear` or
/// `arx` with ridge; from then on truths that the embargo lets through move the coefficients, on regressors
/// standardised as in the fit. What was learned fades in `memory`, and goes back to a tenth of what the fit knew and
/// not to nothing. This is exponential resetting and forgetting (Salgado, Goodwin and Middleton 1988; Kulhavý and
/// Zarrop 1993; survey: Lai and Bernstein 2024). With `λ = exp(−Δt / memory)` and `β = 0.1` it is
/// `R ← λR + (1 − λ)βR₀ + xxᵀ`, `b ← λb + (1 − λ)βR₀θ₀ + xy`, `θ = R⁻¹b`. So `P = R⁻¹` is at most `P₀ / β` in every
/// direction, and where nothing excites a regressor its coefficient is that of the fit. It learns unless the graph
/// says `learn = false`; `learn = { outliers = 6.0, margin = 1.0 }` says from what it does not.
///
/// At most ten truths of one window teach, since more share their noise. The rows of the fit count as one memory's
/// worth of such truths, so that the first ones move the coefficients no more than later ones do. A truth that says
/// little, `xᵀP₀x` below a tenth of its median in the fit, neither teaches nor ages. One that misses by more than two
/// deviations counts as if by two (Huber 1964). A regressor that is the same in all rows of the fit is left out of it
/// and of what is learned later: it comes in with the next fit. A truth without a window that misses by
/// more than a hundred deviations, and is no outlier any more, moves the constant alone. That is then known as by that
/// truth.
///
/// It speaks only while its error over the last 20 windows of truth is no larger than that of the fit on the same truths. Until
/// then, and one `memory` after the last truth, the fit stands in: its prediction, `std_dev` and `novelty` are those of the node.
///
/// The port `learning` is two numbers in one. Its ones say what became of the newest truth: 0 learned from, 1 frozen
/// on command, 2 frozen by a channel, 3 an outlier. 4 is a regressor outside the range of the fit, 5 a truth outside
/// `train.abs_truth`, 6 no complete row. 7 is a truth that says little or is one too many of its window. Its tens say
/// who speaks: 0 the learner, all others the fit. 10 is that there have not been 20 windows of truth yet, 20 that its
/// error was smaller, 30 that no truth came for a `memory`. The port `std_dev` is the standard deviation of the truth
/// about the prediction, `s √(1 + xᵀPx)`, `s` that of the truths remembered. The port `novelty` is that of `linear`.
/// Of what lies beyond the edge of the fit `√(xᵀPx / xᵀP₀x)` counts, `P₀` the `P` of the fit: less where it has
/// learned since, more where it has forgotten. A vote weighs it by that, and its prediction shrinks by it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rls {
    /// The lags of the truth, such as `["5min", "10min"]`; without them only features are regressors.
    #[serde(default)]
    pub lags: Vec<Duration>,
    /// In which time what was learned fades, but for 1/e.
    #[serde(default = "day")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub memory: Duration,
    /// The ridge penalty of the fit, at least 0.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0))]
    pub alpha: f64,
    /// How regressors are chosen in the fit; without it, all are used.
    #[serde(default)]
    pub selection: Option<Selection>,
}

fn one() -> f64 {
    1.0
}

/// How long what learners learn counts, where nothing else is said.
pub(crate) fn day() -> Duration {
    Duration::from_ns(86_400_000_000_000)
}

/// `β`: the share of the fit that what fades goes back to.
pub(crate) const SHARE: f64 = 0.1;
/// A truth says little below this share of what is usual.
pub(crate) const LITTLE: f64 = 0.1;

impl Estimator for Rls {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("features", "what the prediction is made of").or_none(),
                InputPort::truth("what is predicted and learned from"),
                InputPort::freeze(),
            ]
        }
    }

    fn regressors(&self) -> Regressors {
        let lagged = !self.lags.is_empty();
        Regressors {
            feature_lags: vec![Duration::ZERO],
            truth_lags: if lagged {
                TruthLags::At(self.lags.clone())
            } else {
                TruthLags::None
            },
            every_tick: lagged,
            ..Regressors::default()
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        repeated("lags", &self.lags)
    }

    fn learns(&self) -> Learns {
        Learns::ByDefault
    }

    fn has_std_dev(&self) -> bool {
        true
    }

    fn has_novelty(&self) -> bool {
        true
    }

    fn mistakes_for(&self, features: usize) -> Vec<Mistake> {
        too_many(features, 1)
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let solver = Solver::ridge(Penalty::Fixed(self.alpha));
        // The range is kept whether it learns or not, so that the same fit serves both.
        let setup = TrainingSetup {
            learns: true,
            ..setup.clone()
        };
        Box::new(RlsTrainer {
            parameters: self.clone(),
            taught: Taught::new(setup.span),
            rows: LinearTrainer::new(&setup, solver, self.selection),
        })
    }
}

athermal_core::register!(Rls, Estimator, "rls");

/// Fits as `linear` does, and finds where the recursion starts.
struct RlsTrainer {
    parameters: Rls,
    taught: Taught,
    rows: LinearTrainer,
}

/// How many rows of a fit would have taught, and in which time.
struct Taught {
    between: Duration,
    last: Option<Instant>,
    newest: Option<Instant>,
    rows: f64,
    time_s: f64,
}

impl Taught {
    fn new(span: Duration) -> Self {
        Self {
            between: between_lessons(span),
            last: None,
            newest: None,
            rows: 0.0,
            time_s: 0.0,
        }
    }

    fn row(&mut self, at: Instant) {
        if let Some(newest) = self.newest {
            self.time_s += (at - newest).secs().max(0.0);
        }
        self.newest = Some(at);
        if self
            .last
            .is_none_or(|last| at < last || at - last >= self.between)
        {
            self.last = Some(at);
            self.rows += 1.0;
        }
    }

    /// How many there are in a memory; of so many rows in all, where no times were given.
    fn in_memory(&self, memory: Duration, count: f64) -> f64 {
        let rows = if self.rows > 0.0 { self.rows } else { count };
        let share = memory.secs() / self.time_s;
        // Written so that NaN fails.
        if share < 1.0 {
            (rows * share).max(1.0)
        } else {
            rows
        }
    }
}

impl RlsTrainer {
    fn start(&self, report: &mut TrainingReport) -> Result<OnlinePredictor, TrainingError> {
        let Rls { memory, alpha, .. } = self.parameters;
        let found = self.rows.find(report)?;
        let (count, used) = (
            found.gram.count() as f64,
            found.fit.columns.len() as f64 + 1.0,
        );
        let squares = found.fit.residual_sum_of_squares;
        // Even a fit without error has truths that are rounded.
        let variance = (squares / (count - used).max(1.0)).max(f64::MIN_POSITIVE.sqrt());
        let rows = self.taught.in_memory(memory, count);
        let (columns, scales) = (&found.fit.columns, &found.standard.scales);
        let frame = Frame::new(found.names.clone(), columns, &found.standard, 0.0);
        let fit = RlsFit {
            memory_s: memory.secs(),
            share: SHARE,
            coefficients: frame.scaled(&found.fit.coefficients, found.fit.intercept),
            information: information_of(&found.gram, columns, scales, alpha, rows),
            rows,
            variance,
        };
        let rls = athermal_numerics::Rls::try_from(fit).map_err(unsolved)?;
        let usual = self
            .rows
            .median(columns, |row| frame.spread_of_fit(&rls, row));
        let little = LITTLE * usual.unwrap_or(0.0);
        let range = self.rows.range_of(columns).unwrap_or_default();
        let novelty = self.rows.novelty_of(&found);
        let recursion = Recursion::Rls { rls, little };
        Ok(OnlinePredictor::new(frame, recursion, range, None, novelty))
    }
}

impl Trainer for RlsTrainer {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        self.rows.row(regressors, truth);
    }

    fn row_at(&mut self, at: Instant, regressors: &[f64], truth: f64) {
        self.taught.row(at);
        self.row(regressors, truth);
    }

    fn segment(&mut self) {
        (self.taught.last, self.taught.newest) = (None, None);
        self.rows.segment();
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        let mut report = TrainingReport::default();
        let predictor = self.start(&mut report)?;
        let predictor: Box<dyn Predictor> = Box::new(predictor);
        Ok(Trained { predictor, report })
    }
}
