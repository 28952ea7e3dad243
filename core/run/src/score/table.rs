//! Decides on which instants each prediction is scored, and the figures.

use std::sync::Arc;

use serde::Serialize;

use super::fallback::Fallen;
use super::watch::{Truth, Watch};
use super::{FellBack, IntervalScore, Lack, Mode, NoModel, ScoreOptions, Unscored};
use crate::channel::Extremes;
use crate::compile::{Plan, PlannedNode};
use crate::engine::{Engine, SampleRange};
use crate::time::{Duration, Instant};

/// The share of instants below which a prediction does not restrict those on which the others are scored.
pub const RESTRICTS: f64 = 0.5;

/// The scores of all predictions of a plan.
#[derive(Debug, Clone, Default)]
pub struct Scores {
    /// The first and last instant of the data.
    pub period: Option<(Instant, Instant)>,
    /// Ticks stepped.
    pub ticks: u64,
    /// Ticks refused because their time was not after the one before.
    pub refused: u64,
    /// Samples rejected as infinite or out of range, by measured channel.
    pub rejected: Vec<(String, u64)>,
    /// Between which values the samples of each measured channel lay.
    pub ranges: Vec<SampleRange>,
    /// A row for each prediction, those of one truth together, in the order of the plan.
    pub scores: Vec<Score>,
    /// Predictions of a truth of which nothing is scored.
    pub unscored: Vec<Unscored>,
    /// Combiners that went by fewer truths than they take.
    pub lacks: Vec<Lack>,
    /// How often fallbacks took over.
    pub fell_back: Vec<FellBack>,
}

/// How well one prediction did. Errors are prediction minus truth, in the unit of the truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Score {
    /// The channel: `vote.Z1`.
    pub output: String,
    /// Its node.
    pub node: String,
    /// The kind of the node.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// What it predicts.
    pub truth: String,
    /// The unit of all errors: that of the truth, or K where that is a temperature.
    pub unit: String,
    /// Its horizon in seconds.
    pub ahead_s: f64,
    /// How far ahead of the measured truths that it may go by it was scored, in seconds: its horizon, and over several steps as many
    /// steps more as there are beyond the first, where past truths change it; none in a free run, where it goes by its own.
    pub horizon_s: Option<f64>,
    /// Instants scored.
    pub n: usize,
    /// Root mean square error.
    pub rmse: Option<f64>,
    /// 1 − SSE / Σ (y − b)², b being what no model predicts.
    pub r2_zero: Option<f64>,
    /// 1 − SSE / Σ (y − ȳ)².
    pub r2_mean: Option<f64>,
    /// How much of the truth's spread is predicted, in percent: 100 (1 − √(SSE / Σ (y − ȳ)²)) (Ljung 1999, section 16.4).
    pub fit: Option<f64>,
    /// Mean error.
    pub bias: Option<f64>,
    /// Largest absolute error.
    pub max_abs: Option<f64>,
    /// Share of the instants with a truth within the limit at which there is a prediction.
    pub valid: Option<f64>,
    /// What no model predicts: zero, or of a level its mean over the fit, or over these instants where that is not known.
    pub no_model: Option<f64>,
    /// Which of these it is.
    #[serde(skip)]
    pub no_model_is: NoModel,
    /// Root mean square of the truth less that on the same instants: the error of no model.
    pub baseline_zero: Option<f64>,
    /// Root mean square error of the truth at the smallest lag that sees nothing of the answer, several steps ahead of that so
    /// many steps back, on those of the same instants at which there is such a truth; none in a free run, which would repeat the
    /// first truth of each segment.
    pub baseline_persistence: Option<f64>,
    /// How many instants that is the error on.
    pub persistence_n: usize,
    /// Root mean square of the truth's standard error on the same instants, from the residuals of its own fit lines: both the
    /// scatter of the samples and the curvature of what they follow count, and a prediction may come below it.
    pub truth_noise: Option<f64>,
    /// Whether it is scored on all instants at which it is there, as what is put out is, and not on those common to all.
    pub own_instants: bool,
    /// Instants with a truth and this prediction that are not scored, since another prediction of the truth has no value there.
    pub left_out: usize,
    /// How well its intervals hold, where it gives any.
    pub interval: Option<IntervalScore>,
}

/// Whether so many instants are left out of those at which a prediction is there, more than one in twenty, that its scores may hide
/// what happened at them.
#[must_use]
pub fn hide_much(left_out: usize, there: usize) -> bool {
    20 * left_out > there
}

/// How many of some instants a figure is of, where these are so few that it [says](hide_much) little of the others.
#[must_use]
pub fn if_few(there: usize, of: usize) -> Option<usize> {
    hide_much(of - there, of).then_some(there)
}

impl Score {
    /// Whether it leaves so much out that it may [hide](hide_much) what happened there.
    #[must_use]
    pub fn leaves_many_out(&self) -> bool {
        hide_much(self.left_out, self.n + self.left_out)
    }

    /// On how many instants the error of persistence is, where these are so few that it [says](hide_much) little of the others.
    #[must_use]
    pub fn persistence_on_few(&self) -> Option<usize> {
        self.baseline_persistence?;
        if_few(self.persistence_n, self.n)
    }

    /// Whether the prediction is worse than no model.
    #[must_use]
    pub fn is_worse_than_nothing(&self) -> bool {
        matches!((self.rmse, self.baseline_zero), (Some(rmse), Some(zero)) if rmse > zero)
    }
}

pub(super) fn table(
    plan: &Arc<Plan>,
    watch: &Watch,
    engine: &Engine,
    period: Option<(Instant, Instant)>,
    ticks: u64,
    options: &ScoreOptions,
) -> Scores {
    let earlier = earlier(plan, engine, &watch.truths, options.mode);
    let (mut rows, mut unscored) = (Vec::new(), Vec::new());
    for truth in &watch.truths {
        let within = within_limit(plan, truth, options);
        let of = scores(plan, truth, &within, options, &earlier);
        for (score, prediction) in of.iter().zip(&truth.predictions) {
            if score.n == 0 {
                let there = (within.len(), score.left_out);
                unscored.push(Unscored::of(plan, engine, ticks, truth, prediction, there));
            }
        }
        rows.extend(of);
    }
    Scores {
        period,
        ticks,
        refused: engine.refused(),
        rejected: engine.rejected_channels(),
        ranges: engine.sample_ranges(),
        scores: rows,
        unscored,
        lacks: super::evidence::lacks(&watch.tallies),
        fell_back: Fallen::found(&watch.fallen, plan),
    }
}

/// For each node how much earlier than in one step the truths lie that it goes by, itself or through what it is made of; none where
/// it goes by its own predictions of them. Steps from truth to truth are given as long as they typically are.
fn earlier(plan: &Plan, engine: &Engine, truths: &[Truth], mode: Mode) -> Vec<Option<Duration>> {
    let between = |node: &PlannedNode| {
        let slot = node.role.truth()?.slot;
        let truth = truths.iter().find(|truth| truth.slot == slot)?;
        Some(truth.typical_gap())
    };
    let mut found = vec![Some(Duration::ZERO); plan.nodes.len()];
    for (nth, node) in plan.nodes.iter().enumerate() {
        let own = match engine.step_of(nth) {
            Some(_) if mode == Mode::FreeRun => None,
            None => Some(Duration::ZERO),
            Some(planned) => {
                let step = planned.or_else(|| between(node));
                Some(mode.earlier(step.unwrap_or(Duration::ZERO)))
            }
        };
        let entries = node.role.inputs().flat_map(|of| &plan.gathers[of].entries);
        let inputs = entries.filter_map(|entry| plan.channels[entry.slot].node);
        found[nth] = inputs.fold(own, |most, input| Some(most?.max(found[input]?)));
    }
    found
}

/// The truths that count.
fn within_limit(plan: &Plan, truth: &Truth, options: &ScoreOptions) -> Vec<usize> {
    let unit = &plan.channels[truth.slot].channel.unit;
    let limit = options.abs_truth_below.as_ref();
    let limit = limit.and_then(|limit| limit.as_difference(unit));
    (0..truth.values.len())
        .filter(|&i| limit.is_none_or(|limit| truth.values[i].abs() < limit))
        .collect()
}

fn scores(
    plan: &Plan,
    truth: &Truth,
    counted: &[usize],
    options: &ScoreOptions,
    earlier: &[Option<Duration>],
) -> Vec<Score> {
    let of = &plan.channels[truth.slot];
    let no_model_is = NoModel::of(plan, truth.slot, &options.levels);
    let there: Vec<usize> = truth
        .predictions
        .iter()
        .map(|prediction| {
            let there = counted.iter().filter(|&&i| !prediction.values[i].is_nan());
            there.count()
        })
        .collect();
    let valid = |nth: usize| there[nth] as f64 / counted.len() as f64;
    let restricting = |nth: usize| valid(nth) >= RESTRICTS;
    let common: Vec<usize> = counted
        .iter()
        .copied()
        .filter(|&i| {
            let mut rows = truth.predictions.iter().enumerate();
            rows.all(|(nth, prediction)| !restricting(nth) || !prediction.values[i].is_nan())
        })
        .collect();
    truth
        .predictions
        .iter()
        .enumerate()
        .map(|(nth, prediction)| {
            // What is put out is put out whether its voters are there or not.
            let is_put_out = plan.outputs.iter().any(|of| of.slot == prediction.slot);
            let own_instants = options.each_on_its_own || is_put_out || !restricting(nth);
            let instants: Vec<usize> = if own_instants {
                counted
                    .iter()
                    .copied()
                    .filter(|&i| !prediction.values[i].is_nan())
                    .collect()
            } else {
                common.clone()
            };
            let node = &plan.nodes[prediction.node];
            let errors = || {
                instants
                    .iter()
                    .map(|&i| prediction.values[i] - truth.values[i])
            };
            let truths = || instants.iter().map(|&i| truth.values[i]);
            let persistence = &truth.persistences[&prediction.ahead].values;
            let lasting: Vec<f64> = instants
                .iter()
                .map(|&i| persistence[i] - truth.values[i])
                .filter(|e| !e.is_nan() && options.mode != Mode::FreeRun)
                .collect();
            let n = instants.len();
            let mean = mean(truths());
            let mut range = Extremes::NONE;
            truths().for_each(|y| range.include(y));
            // What differs by rounding alone has no spread that could be predicted.
            let about_mean = mean.filter(|_| !range.is_one_value());
            let about_mean =
                about_mean.map(|mean| truths().map(|y| (y - mean) * (y - mean)).sum::<f64>());
            let squared: f64 = errors().map(|e| e * e).sum();
            let no_model = no_model_is.value(truths());
            let departures = || truths().map(|y| y - no_model);
            let about_no_model: f64 = departures().map(|y| y * y).sum();
            let share = |of: f64| (of > 0.0).then(|| 1.0 - squared / of);
            Score {
                output: plan.channels[prediction.slot].name.clone(),
                node: node.name.clone(),
                kind: node.kind.name,
                truth: of.name.clone(),
                unit: of.channel.unit.difference().to_string(),
                ahead_s: prediction.ahead.secs(),
                horizon_s: earlier[prediction.node].map(|more| (prediction.ahead + more).secs()),
                n,
                rmse: root_mean_square(errors()),
                r2_zero: share(about_no_model),
                r2_mean: about_mean.and_then(share),
                fit: about_mean
                    .filter(|&of| of > 0.0)
                    .map(|of| 100.0 * (1.0 - (squared / of).sqrt())),
                bias: self::mean(errors()),
                max_abs: errors().map(f64::abs).reduce(f64::max),
                valid: (!counted.is_empty()).then(|| valid(nth)),
                no_model: (n > 0).then_some(no_model),
                no_model_is,
                baseline_zero: root_mean_square(departures()),
                persistence_n: lasting.len(),
                baseline_persistence: root_mean_square(lasting.into_iter()),
                truth_noise: root_mean_square(
                    instants
                        .iter()
                        .map(|&i| truth.errors[i])
                        .filter(|e| !e.is_nan()),
                ),
                own_instants,
                left_out: there[nth] - n,
                interval: prediction.intervals.and_then(|intervals| {
                    let ends = instants
                        .iter()
                        .map(|&i| (prediction.ends[i], truth.values[i]));
                    IntervalScore::of(intervals, ends)
                }),
            }
        })
        .collect()
}

pub(super) fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut sum, mut n) = (0.0, 0_usize);
    for value in values {
        sum += value;
        n += 1;
    }
    (n > 0).then(|| sum / n as f64)
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> Option<f64> {
    mean(values.map(|value| value * value)).map(f64::sqrt)
}
