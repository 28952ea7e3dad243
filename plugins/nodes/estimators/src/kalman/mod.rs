//! The estimator that follows a level and a trend while truths come in.

use athermal_core::node::{
    Coefficients, Estimator, InputPort, Learner, Learns, Mistake, Predictor, Regressors,
    TrainedRange, Trainer, TrainingSetup,
};
use athermal_core::quantity::Quantity;
use athermal_core::time::Duration;
use athermal_core::unit::Unit;
use athermal_numerics::{Kalman as Filter, Novelty};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

mod coefficients;
mod fit;
mod follow;

use crate::features::too_many;
use crate::novelty::{novelty_at, novelty_mistakes};
use crate::rls::day;
use crate::scaling::Scaling;
use fit::KalmanTrainer;
use follow::{Following, std_dev};

/// Kalman filter of a structural model: a level that wanders, maybe with a trend, and linear regression on features.
///
/// `y = ȳ + μ + Σ b_j x_j + ε` with the mean truth `ȳ` of the fit. The level `μ` wanders and returns to 0 at a rate
/// of its own (an autoregressive component). With a rate of 0 it is the random walk of the local level. Or it has a
/// slope that is a random walk (local linear trend). Both are in continuous time, so that truths may come at any
/// instants and be missing. (Harvey 1989, sections 2.3, 9.1 and 9.2; Durbin and Koopman 2012, chapters 2 to 4.) The
/// fit finds the coefficients, and unless `noises` gives them the variances and the rate that make its rows most
/// likely. Running, the filter takes each truth that the embargo lets through and predicts `ahead` of now from the
/// newest one. The coefficients are states that do not wander: each truth moves them too, by as much as they are
/// still uncertain. What was learned of them fades in `memory`, and goes back to a tenth of what the fit knew, as
/// that of `rls` does. As there, at most ten truths of one window teach, and one that says little of the coefficients
/// moves the level alone. It speaks only while its error over the last 20 windows of truth is no larger than that of
/// the fit on the same truths. Until then, and one `memory` after the last truth, the fit stands in: a filter whose
/// level and trend follow the same truths, with the coefficients of the fit. With `learn = false` it stays where the
/// fit ended, which is regression on the features.
/// Without features it is a forecast from the past of the truth alone.
///
/// The fit knows nothing of level and trend where it starts, nor at the start of a segment (a diffuse start). A level is one
/// that returns only where that makes the rows likelier by a factor of 60, as one in twenty does that does not return. What is
/// not known of the variances and of that rate is no part of `std_dev`; what is not known of level, trend and coefficients is.
///
/// Where a feature lies outside the range of the fit, by more than `learn.margin` says, its truth moves level and
/// trend only (Schmidt 1966). The coefficients stay, so that a dead sensor cannot spoil them. One that misses by more
/// than ten deviations, and is no outlier any more since so many before it did too, is a leap of the level. The level
/// is then where the truth is, as unsure as it has leapt until the next truth shows whether it stays there. The
/// coefficients hardly move. Of the variance of the leap, the mean `ȳ` of a level that returns has a hundredth, so
/// that the mean has moved where the level stays away. A trend has as much as a ramp since the truth before could
/// explain. In a new segment the mean is as unsure as it has moved.
///
/// The limit of `learn.outliers` keeps spikes out, and with them the beginning of what really changes within a truth
/// or two. Without features there is nothing else to go by: the drift of the die tester's axis Z1 leaps by hundreds
/// of nm/min when a die is loaded. One to three truths are refused each time, and the error is 66 nm/min instead
/// of 56. Where truths are sound, say `learn = { outliers = inf }`. That several in a row are refused on one side does
/// not tell a change from a spike: where windows overlap, one bad position spoils several truths.
///
/// Truths whose windows overlap share their noise, which the model would take for a level that moves. So a truth that
/// comes sooner than `every` after the one before counts for its share of that time: its variance is multiplied by
/// the inverse. The coefficients are so those of all rows; the variances are found from rows `every` apart. In a new
/// segment level and trend start from what the fit knew of them at large. The port `std_dev` is the standard
/// deviation of the truth about its prediction; it grows while no truth comes. The port `learning` says what became
/// of the newest truth, in the numbers of `rls`. What is not learned from is not followed either, but for 4, a
/// feature outside the range of the fit. The answer changes with time alone, so the node runs at every tick. The port
/// `novelty` is that of `linear`, of the features, and less where it has learned since, as that of `rls` is by the
/// variance that the coefficients bring in.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Kalman {
    /// Whether the level has a trend that wanders too; it follows a ramp without lag, and is less sure of the level.
    #[serde(default)]
    pub trend: bool,
    /// How large the noises are; without it they are found by maximum likelihood.
    #[serde(default)]
    pub noises: Option<Noises>,
    /// The penalty on the coefficients of standardised features, at least 0, as in ridge. Their prior variance is the sum
    /// of the model's variances over a typical step, the mean gap between rows, divided by it. 0 says that nothing is known of
    /// them. A smaller one than 1e-10 counts as that, since differences of larger variances would be rounding alone.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0))]
    pub penalty: f64,
    /// The time within which truths share their noise; without it the span of the truth.
    #[serde(default)]
    pub every: Option<Duration>,
    /// In which time what was learned of the coefficients fades, but for 1/e.
    #[serde(default = "day")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub memory: Duration,
}

/// How large the noises of a structural model are, as standard deviations in units that measure the same as the truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Noises {
    /// Of one truth, such as "3.85 nm/min"; above 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub observation: Quantity,
    /// What the level wanders in the time `per`, such as "10 nm/min"; 0 or more.
    #[schemars(extend("minimum" = 0))]
    pub level: Quantity,
    /// By what the change of the level within `per` wanders in the time `per`, such as "1 nm/min"; 0 or more, for a level with a trend.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub trend: Option<Quantity>,
    /// The time in which they do, such as "1h".
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub per: Duration,
    /// The time in which a level without a trend returns to its mean, but for 1/e of the way; without it, it does not.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub returns: Option<Duration>,
}

fn one() -> f64 {
    1.0
}

impl Estimator for Kalman {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held(
                    "features",
                    "what the prediction is made of beside the level",
                )
                .or_none(),
                InputPort::truth("what is predicted, and what the level follows"),
                InputPort::freeze(),
            ]
        }
    }

    fn regressors(&self) -> Regressors {
        Regressors {
            feature_lags: vec![Duration::ZERO],
            every_tick: true,
            ..Regressors::default()
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let noises = self.noises.as_ref();
        noises.map_or_else(Vec::new, |noises| noises.mistakes(self.trend))
    }

    fn mistakes_beside(&self, truth: &Unit) -> Vec<Mistake> {
        let noises = self.noises.iter();
        noises
            .flat_map(|noises| noises.of_another_unit(truth))
            .collect()
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
        Box::new(KalmanTrainer::new(setup, self.clone()))
    }
}

impl Noises {
    /// Each noise with its name.
    fn each(&self) -> impl Iterator<Item = (&'static str, &Quantity)> {
        let moving = [("observation", &self.observation), ("level", &self.level)];
        let trend = self.trend.iter().map(|trend| ("trend", trend));
        moving.into_iter().chain(trend)
    }

    fn of_another_unit(&self, truth: &Unit) -> Vec<Mistake> {
        let unit = truth.difference();
        let other = self
            .each()
            .filter(|(_, given)| given.as_difference(&unit).is_none());
        let mistake = |(name, given): (&str, &Quantity)| {
            let found = &given.unit;
            let message = format!("`{name}` is in {found}, and the truth in {truth}");
            Mistake::at(format!("noises.{name}"), message).help(format!(
                "give it in {unit} or a unit that measures the same"
            ))
        };
        other.map(mistake).collect()
    }

    fn mistakes(&self, trend: bool) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        if self.returns.is_some() && trend {
            let message = "a level with a trend does not return to a mean";
            mistakes.push(
                Mistake::at("noises.returns", message)
                    .help("leave `returns` out, or say `trend = false`"),
            );
        }
        match (&self.trend, trend) {
            (None, true) => mistakes.push(
                Mistake::at(
                    "noises",
                    "the level has a trend, and `noises` lacks `trend`",
                )
                .help("0 of the unit of the level is a trend that stays as it is"),
            ),
            (Some(_), false) => mistakes.push(
                Mistake::at("noises.trend", "the level has no trend that could wander")
                    .help("say `trend = true` beside `noises`"),
            ),
            _ => {}
        }
        mistakes
    }
}

/// A fitted structural model: where its filter starts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct KalmanPredictor {
    regressors: Vec<String>,
    scaling: Scaling,
    /// The coefficients of scaled regressors as the fit left them, and level and trend as they are at large. Its unit of
    /// time is the second.
    filter: Filter,
    /// Mean and variance of level and trend at large.
    at_large: Vec<(f64, f64)>,
    every: Duration,
    /// The range of the regressors in the fit; of models before it was kept, none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    range: Option<TrainedRange>,
    /// How far regressors are from those of the rows that were followed, where these say so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    novelty: Option<Novelty>,
    /// In which time what is learned of the coefficients fades.
    #[serde(default = "day")]
    memory: Duration,
    /// A truth says little of them where the variance that they bring into its prediction was less in the fit.
    #[serde(default)]
    little: f64,
}

impl Predictor for KalmanPredictor {
    fn uses(&self) -> &[String] {
        &self.regressors
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let width = self.regressors.len();
        let mut mistakes = self.scaling.mistakes(width);
        let known = self.filter.regressors();
        if known != width {
            let message = format!("`filter` has {known} coefficients and must have {width}");
            mistakes.push(Mistake::at("filter", message));
        }
        if self.filter.is_diffuse() {
            let message = "`filter` knows nothing of a state: `unknown` must be 0";
            mistakes.push(Mistake::at("filter", message));
        }
        if !self.filter.can_restart(&self.at_large) {
            let message = "`at_large` must have a finite mean and a finite variance of at least 0 for the level, and for the trend where there is one";
            mistakes.push(Mistake::at("at_large", message));
        }
        mistakes.extend(self.range.iter().flat_map(|range| range.mistakes(width)));
        mistakes.extend(novelty_mistakes(self.novelty.as_ref(), width));
        mistakes
    }

    fn predict(&self, regressors: &[f64]) -> f64 {
        self.scaling.truth + self.filter.expected(0.0, self.scaling.of(regressors))
    }

    fn std_dev(&self, regressors: &[f64]) -> f64 {
        std_dev(&self.filter, 0.0, self.scaling.of(regressors))
    }

    fn novelty(&self, regressors: &[f64]) -> f64 {
        novelty_at(self.novelty.as_ref(), regressors)
    }

    fn centre(&self) -> f64 {
        self.scaling.truth + self.filter.expected(0.0, |_| 0.0)
    }

    fn coefficients(&self) -> Option<Coefficients> {
        Some(coefficients::coefficients(self))
    }

    fn learner(&self) -> Option<Box<dyn Learner>> {
        Some(Box::new(Following::new(self)))
    }

    fn trained_range(&self) -> Option<&TrainedRange> {
        self.range.as_ref()
    }
}

athermal_core::predictor!(KalmanPredictor, "kalman");

athermal_core::register!(Kalman, Estimator, "kalman");
