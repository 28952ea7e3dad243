//! How far predictions went outside of what their fits saw, what was done about it, and what that did to errors; and which sensors
//! contradicted the others.

use std::collections::BTreeMap;
use std::sync::Arc;

use athermal_core::compile::{Outside, Plan, PlannedRole};
use athermal_run::model::Model;
use athermal_run::recording::Recording;
use athermal_run::score::{Trace, trace};
use serde::Serialize;

use super::excursions::Periods;
use super::{Axis, Hours, ReportError, figure, rms};
use crate::figures::counted;

/// Predictions outside of their fits.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Novelty {
    /// Every estimator whose fit says where its edge is.
    pub estimators: Vec<Excursion>,
    /// What heeding it did to each prediction that is put out and that it changed.
    pub effects: Vec<Effect>,
    /// When a sensor contradicted the others, by a `cross_check` node.
    pub contradictions: Vec<Contradiction>,
    /// Who spoke for each estimator that went on learning.
    pub learners: Vec<Spoken>,
}

/// Who spoke for an estimator that went on learning, as shares of its predictions: it, or its fit and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spoken {
    /// The estimator: `learner.Z1`.
    pub node: String,
    /// What has learned.
    pub learner: f64,
    /// The fit, before there had been 20 windows of truth.
    pub too_few: f64,
    /// The fit, since it erred less.
    pub worse: f64,
    /// The fit, since no truth came for a memory.
    pub silence: f64,
}

/// How far an estimator went outside of its fit.
#[derive(Debug, Clone, Serialize)]
pub struct Excursion {
    /// The estimator: `thermal.Z1`.
    pub node: String,
    /// The same without the member of its set.
    #[serde(skip)]
    pub(super) name: String,
    /// What becomes of its predictions there: `shrink`, `absent` or `pass`.
    pub outside: &'static str,
    /// The share of its predictions with a `novelty` above 1; none where it is never known.
    pub share: Option<f64>,
    /// The worst time outside.
    pub worst: Option<Stretch>,
    /// What that does to its errors; none where no truth was predicted from outside.
    pub errors: Option<Compared>,
}

/// A time outside of a fit; what is apart by ten minutes or less is one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stretch {
    /// First instant in s.
    pub from_s: f64,
    /// Last instant in s.
    pub to_s: f64,
    /// The largest `novelty`.
    pub novelty: f64,
    /// The measured channel that pushed it there: with its regressors at their usual values it would be least. None where no channel
    /// alone lessens it.
    pub by: Option<String>,
    /// The integral of what is above 1, by which stretches are compared.
    #[serde(skip)]
    pub(super) size: f64,
    /// The regressors at the largest.
    #[serde(skip)]
    pub(super) row: Vec<f64>,
}

/// Root mean square errors of the same truths.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Compared {
    /// How many truths.
    pub n: usize,
    /// Their unit.
    pub unit: String,
    /// Of what was predicted; none where that was nothing.
    pub rmse: Option<f64>,
    /// Of what would have been had no prediction been changed and no vote gone by its novelty.
    pub rmse_unheeded: Option<f64>,
    /// Of no model.
    pub baseline_zero: Option<f64>,
}

/// What heeding novelty did to a prediction that is put out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// The axis.
    pub axis: String,
    /// The prediction: `vote.Z1`.
    pub prediction: String,
    /// Its errors at the truths for which it was changed.
    #[serde(flatten)]
    pub errors: Compared,
}

/// A time in which a sensor contradicted the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contradiction {
    /// The channel: `temperature.holder1`.
    pub sensor: String,
    /// The node that found it.
    pub node: String,
    /// From when on it was left out, in s.
    pub from_s: f64,
    /// When it was taken again; none where it was not.
    pub to_s: Option<f64>,
}

/// A larger share of the time outside is worth a word on a terminal.
const MANY: f64 = 0.005;

/// Errors of so few truths are chance, and none is worth a word on a terminal.
const FEWEST: usize = 20;

/// The plan in which nothing goes by novelty.
fn unheeding(plan: &Plan) -> Plan {
    let mut plan = plan.clone();
    for node in &mut plan.nodes {
        match &mut node.role {
            PlannedRole::Estimator { outside, .. } => *outside = Outside::Pass,
            PlannedRole::Combiner {
                novelties, beside, ..
            } => {
                *novelties = None;
                beside.novelties = None;
            }
            PlannedRole::Feature { .. } => {}
        }
    }
    plan
}

impl Novelty {
    /// Steps the model once more with novelty heeded nowhere, and sets the errors beside each other; not where nothing was outside.
    pub(super) fn compare(
        &mut self,
        model: &Model,
        recording: &dyn Recording,
        axes: &[Axis],
        periods: &Periods,
    ) -> Result<(), ReportError> {
        if self.estimators.iter().all(|of| of.worst.is_none()) {
            return Ok(());
        }
        let plan = Arc::new(unheeding(&model.plan));
        let unheeded = trace(&plan, &model.fitted, recording, &mut |_, _| {})?;
        for (estimator, (slot, periods)) in self.estimators.iter_mut().zip(periods) {
            let ahead_s = plan.channels[*slot].channel.ahead.secs();
            let is_outside = |at_s: f64| {
                let after = periods.partition_point(|(from_s, _)| *from_s <= at_s - ahead_s);
                after > 0 && at_s - ahead_s < periods[after - 1].1
            };
            let of_slot = |axis: &&Axis| axis.voters.iter().any(|voter| voter.slot == *slot);
            estimator.errors = axes.iter().find(of_slot).and_then(|axis| {
                errors(axis, *slot, &unheeded, |nth, _, _| {
                    is_outside(axis.truth.time_s[nth])
                })
            });
        }
        for axis in axes {
            let put_out = axis.put_out();
            let changed = |_: usize, with: f64, without: f64| {
                with.to_bits() != without.to_bits() && !(with.is_nan() && without.is_nan())
            };
            let errors = errors(axis, put_out.slot, &unheeded, changed);
            self.effects.extend(errors.map(|errors| Effect {
                axis: axis.name.clone(),
                prediction: put_out.prediction.clone(),
                errors,
            }));
        }
        Ok(())
    }

    /// What is worth a word, for people.
    #[must_use]
    pub(super) fn sentences(&self, hours: &Hours) -> Vec<String> {
        let mut of_nodes: BTreeMap<&str, Vec<&Excursion>> = BTreeMap::new();
        let often = |of: &&Excursion| of.share.is_some_and(|share| share >= MANY);
        for of in self.estimators.iter().filter(often) {
            of_nodes.entry(&of.name).or_default().push(of);
        }
        let contradictions = self.contradictions.iter().map(|of| of.sentence(hours));
        let nodes = of_nodes.values().filter_map(|all| {
            let share = |of: &&&Excursion| of.share.unwrap_or_default();
            let most = all
                .iter()
                .max_by(|one, other| share(one).total_cmp(&share(other)))?;
            Some(most.sentence(hours, all.len()))
        });
        let changed = self.effects.iter().filter(|of| of.errors.n >= FEWEST);
        contradictions
            .chain(nodes)
            .chain(changed.map(Effect::sentence))
            .chain(self.learners.iter().map(Spoken::sentence))
            .collect()
    }
}

/// The errors of a prediction at the truths that `counts` admits, by their number and what was predicted with and without; none where
/// there are none.
fn errors(
    axis: &Axis,
    slot: usize,
    unheeded: &Trace,
    counts: impl Fn(usize, f64, f64) -> bool,
) -> Option<Compared> {
    let with = axis.voters.iter().find(|voter| voter.slot == slot)?;
    let truth = unheeded
        .truths
        .iter()
        .find(|truth| truth.slot == axis.slot)?;
    let without = truth.predictions.iter().find(|of| of.slot == slot)?;
    let both = with.value.iter().zip(&without.values);
    let all = axis.truth.value.iter().zip(both).enumerate();
    let all = all.filter(|(nth, (_, (with, without)))| counts(*nth, **with, **without));
    let all: Vec<(f64, f64, f64)> = all.map(|(_, (y, (w, wo)))| (*y, *w, *wo)).collect();
    let no_model = axis.no_model.value(axis.truth.value.iter().copied());
    (!all.is_empty()).then(|| Compared {
        n: all.len(),
        unit: axis.error_unit.clone(),
        rmse: rms(all.iter().map(|(y, with, _)| with - y)),
        rmse_unheeded: rms(all.iter().map(|(y, _, without)| without - y)),
        baseline_zero: rms(all.iter().map(|(y, ..)| no_model - y)),
    })
}

impl Excursion {
    /// What becomes of predictions outside, for people.
    #[must_use]
    pub fn done(&self) -> &'static str {
        match self.outside {
            "shrink" => "go to no model",
            "absent" => "are left out",
            _ => "stay as they are",
        }
    }

    /// Of an estimator, and of how many of its name it is the one that is outside most often.
    fn sentence(&self, hours: &Hours, of: usize) -> String {
        let share = 100.0 * self.share.unwrap_or_default();
        let others = match of {
            1 => String::new(),
            all => format!(", most often of {all} of its node"),
        };
        let worst = self.worst.as_ref().map_or_else(String::new, |worst| {
            let by = worst.by.as_ref();
            let by = by.map_or_else(String::new, |by| format!(" by {by}"));
            format!(
                "; worst from hour {:.1} to {:.1}, {} times as far as the edge{by}",
                hours.at(worst.from_s),
                hours.at(worst.to_s),
                figure(Some(worst.novelty))
            )
        });
        format!(
            "{} is outside of its fit {} % of the time{others}{worst}. Its predictions {} then.",
            self.node,
            figure(Some(share)),
            self.done()
        )
    }
}

impl Spoken {
    /// For people.
    #[must_use]
    pub(super) fn sentence(&self) -> String {
        let percent = |share: f64| figure(Some(100.0 * share));
        format!(
            "{} speaks {} % of the time; its fit does {} % before 20 windows of truth, {} % since it erred less, {} % without truths.",
            self.node,
            percent(self.learner),
            percent(self.too_few),
            percent(self.worse),
            percent(self.silence)
        )
    }
}

impl Effect {
    fn sentence(&self) -> String {
        let Compared {
            n,
            unit,
            rmse,
            rmse_unheeded,
            baseline_zero,
        } = &self.errors;
        format!(
            "{}: that changes {} at {}: an error of {} {unit}, {} had nothing been done, {} without a model.",
            self.axis,
            self.prediction,
            counted(*n as u64, "truth"),
            figure(*rmse),
            figure(*rmse_unheeded),
            figure(*baseline_zero)
        )
    }
}

impl Contradiction {
    /// For people.
    #[must_use]
    pub(super) fn sentence(&self, hours: &Hours) -> String {
        let to = self.to_s.map_or_else(
            || "on to the end".to_owned(),
            |to_s| format!("to {:.1}", hours.at(to_s)),
        );
        format!(
            "{} contradicts the other sensors from hour {:.1} {to}: {} leaves it out.",
            self.sensor,
            hours.at(self.from_s),
            self.node
        )
    }
}
