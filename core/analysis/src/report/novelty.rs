//! How far predictions went outside of what their fits saw, what was done about it, and what that did to errors; and which sensors
//! contradicted the others.

use std::collections::BTreeMap;
use std::sync::Arc;

use athermal_core::compile::{Outside, Plan, PlannedNode, PlannedRole, SourceChannel};
use athermal_core::engine::Engine;
use athermal_core::node::{Predictor, Role};
use athermal_run::model::Model;
use athermal_run::recording::Recording;
use athermal_run::score::{Trace, trace};
use serde::Serialize;

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
}

/// How far an estimator went outside of its fit.
#[derive(Debug, Clone, Serialize)]
pub struct Excursion {
    /// The estimator: `thermal.Z1`.
    pub node: String,
    /// The same without the member of its set.
    #[serde(skip)]
    name: String,
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
    size: f64,
    /// The regressors at the largest.
    #[serde(skip)]
    row: Vec<f64>,
}

impl Stretch {
    fn is_apart(&self, now_s: f64) -> bool {
        now_s - self.to_s > APART_S
    }
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

/// Stretches no farther apart are one.
const APART_S: f64 = 600.0;

/// A larger share of the time outside is worth a word on a terminal.
const MANY: f64 = 0.005;

/// Has what is looked at computed, whether or not the graph reads it.
pub(super) fn ask_for_novelty(plan: &mut Plan) {
    let ports = |node: &PlannedNode| {
        let of_estimator = matches!(node.role, PlannedRole::Estimator { .. });
        node.port("novelty").filter(|_| of_estimator)
    };
    let slots: Vec<usize> = plan.nodes.iter().filter_map(ports).flatten().collect();
    plan.observe(slots);
}

/// What is written down while a recording is stepped over.
pub(super) struct NoveltyWatch {
    estimators: Vec<Watched>,
    checks: Vec<Check>,
}

/// An estimator that is watched.
struct Watched {
    excursion: Excursion,
    predictor: Arc<dyn Predictor>,
    /// The slots of its prediction and its novelty.
    slots: [usize; 2],
    /// Gather and place of each regressor that it uses.
    places: Vec<(usize, usize)>,
    /// Which regressors follow from each measured channel.
    of_sensors: Vec<(String, Vec<bool>)>,
    /// The mean of the rows inside, and how many they are.
    usual: (Vec<f64>, f64),
    runs: u64,
    outside: u64,
    now: Option<Stretch>,
    /// From each run outside to the next inside.
    periods: Vec<(f64, f64)>,
    /// When it ran last, where that was outside.
    last_outside: Option<f64>,
}

/// A channel of a `cross_check` node.
struct Check {
    reason: usize,
    found: Contradiction,
    is_out: bool,
    all: Vec<Contradiction>,
}

impl NoveltyWatch {
    pub(super) fn new(model: &Model) -> Self {
        let plan = &*model.plan;
        let nodes = plan.nodes.iter();
        Self {
            estimators: nodes
                .filter_map(|node| Watched::new(plan, node, model))
                .collect(),
            checks: plan.nodes.iter().flat_map(|of| checks(plan, of)).collect(),
        }
    }

    pub(super) fn look(&mut self, engine: &Engine, now_s: f64) {
        self.estimators
            .iter_mut()
            .for_each(|of| of.look(engine, now_s));
        for check in &mut self.checks {
            let reason = engine.value(check.reason);
            let is_out = reason == 1.0 || reason == 2.0;
            if is_out && !check.is_out {
                check.found.from_s = now_s;
            } else if !is_out && check.is_out {
                check.end(Some(now_s));
            }
            check.is_out = is_out;
        }
    }

    pub(super) fn segment(&mut self) {
        self.estimators.iter_mut().for_each(Watched::end);
        for check in self.checks.iter_mut().filter(|check| check.is_out) {
            check.end(None);
            check.is_out = false;
        }
    }

    /// What was found, and when each estimator was outside.
    pub(super) fn finish(mut self) -> (Novelty, Periods) {
        self.segment();
        let mut contradictions: Vec<_> = self.checks.into_iter().flat_map(|of| of.all).collect();
        contradictions.sort_by(|one, other| one.from_s.total_cmp(&other.from_s));
        let (estimators, periods) = self.estimators.into_iter().map(Watched::finish).unzip();
        let novelty = Novelty {
            estimators,
            contradictions,
            ..Novelty::default()
        };
        (novelty, periods)
    }
}

/// Of each estimator the slot of its prediction, and from when to when its last run was outside.
pub(super) type Periods = Vec<(usize, Vec<(f64, f64)>)>;

fn checks<'a>(plan: &'a Plan, node: &'a PlannedNode) -> impl Iterator<Item = Check> + 'a {
    let reasons = match node.kind.name {
        "cross_check" => node.port("reason"),
        _ => None,
    };
    let gather = node.role.inputs().next();
    let entries = gather
        .into_iter()
        .flat_map(|gather| &plan.gathers[gather].entries);
    entries
        .zip(reasons.into_iter().flatten())
        .map(|(entry, reason)| Check {
            reason,
            found: Contradiction {
                sensor: plan.channels[entry.slot].name.clone(),
                node: node.instance(),
                from_s: 0.0,
                to_s: None,
            },
            is_out: false,
            all: Vec::new(),
        })
}

impl Check {
    fn end(&mut self, to_s: Option<f64>) {
        self.all.push(Contradiction {
            to_s,
            ..self.found.clone()
        });
    }
}

/// The measured channels that a slot is made of, by their number: channel by channel where a node keeps them apart.
fn sensors_of(plan: &Plan, slot: usize) -> Vec<bool> {
    let mut seen = vec![false; plan.channels.len()];
    let mut open = vec![slot];
    while let Some(slot) = open.pop() {
        if std::mem::replace(&mut seen[slot], true) {
            continue;
        }
        let Some(node) = plan.channels[slot].node.map(|node| &plan.nodes[node]) else {
            continue;
        };
        let slots = |gather: usize| -> Vec<usize> {
            let entries = plan.gathers[gather].entries.iter();
            entries.map(|entry| entry.slot).collect()
        };
        let inputs: Vec<Vec<usize>> = node.role.inputs().map(slots).collect();
        let port = node.ports.iter().find(|(_, slots)| slots.contains(&slot));
        match (node.spec.role(), port) {
            (Role::Feature(feature), Some((name, slots))) => {
                let reach = feature.reach(name);
                let parts = reach.parts(&inputs, slot - slots.start, slots.len());
                open.extend(parts.into_iter().map(|(slot, _)| slot));
            }
            _ => open.extend(inputs.into_iter().flatten()),
        }
    }
    seen.truncate(plan.sources.len());
    seen
}

impl Watched {
    fn new(plan: &Plan, node: &PlannedNode, model: &Model) -> Option<Self> {
        let PlannedRole::Estimator {
            fit,
            gathers,
            outside,
            ..
        } = &node.role
        else {
            return None;
        };
        let novelty = node.port("novelty")?.start;
        let predictor = Arc::clone(model.fitted.get(&node.instance())?);
        let gathers = gathers.iter();
        let places: Vec<(usize, usize)> = gathers
            .flat_map(|&gather| (0..plan.gathers[gather].entries.len()).map(move |n| (gather, n)))
            .collect();
        let place = |name: &String| fit.regressors.iter().position(|of| of.name == *name);
        let used: Vec<usize> = predictor.uses().iter().map(place).collect::<Option<_>>()?;
        let places: Vec<(usize, usize)> = used.into_iter().map(|nth| places[nth]).collect();
        let made_of: Vec<Vec<bool>> = places
            .iter()
            .map(|&(gather, nth)| sensors_of(plan, plan.gathers[gather].entries[nth].slot))
            .collect();
        let of_sensor = |(nth, source): (usize, &SourceChannel)| {
            let columns: Vec<bool> = made_of.iter().map(|sensors| sensors[nth]).collect();
            columns
                .contains(&true)
                .then(|| (source.name.clone(), columns))
        };
        Some(Self {
            excursion: Excursion {
                node: node.instance(),
                name: node.name.clone(),
                outside: match outside {
                    Outside::Shrink => "shrink",
                    Outside::Absent => "absent",
                    Outside::Pass => "pass",
                },
                share: None,
                worst: None,
                errors: None,
            },
            slots: [node.slots.start, novelty],
            of_sensors: plan
                .sources
                .iter()
                .enumerate()
                .filter_map(of_sensor)
                .collect(),
            usual: (vec![0.0; places.len()], 0.0),
            predictor,
            places,
            runs: 0,
            outside: 0,
            now: None,
            periods: Vec::new(),
            last_outside: None,
        })
    }

    fn look(&mut self, engine: &Engine, now_s: f64) {
        let [prediction, novelty] = self.slots;
        if !engine.ran(prediction) {
            return;
        }
        let novelty = engine.value(novelty);
        let before_s = self.last_outside.take();
        if let Some(before_s) = before_s {
            self.periods.push((before_s, now_s));
        }
        if novelty.is_nan() {
            return;
        }
        self.runs += 1;
        if novelty > 1.0 && self.now.as_ref().is_some_and(|now| now.is_apart(now_s)) {
            self.close();
        }
        let places = self.places.iter();
        let row = places.map(|&(gather, nth)| engine.gathered(gather).0[nth]);
        if novelty <= 1.0 {
            let (means, count) = &mut self.usual;
            *count += 1.0;
            for (mean, value) in means.iter_mut().zip(row) {
                *mean += (value - *mean) / *count;
            }
            return;
        }
        self.outside += 1;
        self.last_outside = Some(now_s);
        let now = self.now.get_or_insert_with(|| Stretch {
            from_s: now_s,
            to_s: now_s,
            novelty: 0.0,
            by: None,
            size: 0.0,
            row: Vec::new(),
        });
        now.size += (novelty - 1.0) * before_s.map_or(0.0, |before_s| now_s - before_s);
        now.to_s = now_s;
        if novelty > now.novelty {
            now.novelty = novelty;
            now.row.clear();
            now.row.extend(row);
        }
    }

    /// Keeps the stretch that ends if it is the worst.
    fn close(&mut self) {
        let worst = &mut self.excursion.worst;
        if let Some(now) = self.now.take()
            && worst.as_ref().is_none_or(|worst| worst.size < now.size)
        {
            *worst = Some(now);
        }
    }

    /// A segment has ended.
    fn end(&mut self) {
        if let Some(last_s) = self.last_outside.take() {
            self.periods.push((last_s, f64::INFINITY));
        }
        self.close();
    }

    /// The measured channel that pushed regressors outside: what is left with its own at their usual values is least.
    fn pushed_by(&self, stretch: &Stretch) -> Option<String> {
        let left = |columns: &[bool]| {
            let mut row = stretch.row.clone();
            let usual = row.iter_mut().zip(&self.usual.0);
            for ((value, usual), is_of) in usual.zip(columns) {
                if *is_of {
                    *value = *usual;
                }
            }
            self.predictor.novelty(&row)
        };
        // What all regressors follow from, such as when positions are measured, is behind none in particular.
        let apart = self
            .of_sensors
            .iter()
            .filter(|(_, columns)| self.of_sensors.len() == 1 || columns.contains(&false));
        let apart = apart.map(|(name, columns)| (name, left(columns)));
        let least = apart.min_by(|one, other| one.1.total_cmp(&other.1))?;
        (least.1 < stretch.novelty).then(|| least.0.clone())
    }

    fn finish(mut self) -> (Excursion, (usize, Vec<(f64, f64)>)) {
        let mut worst = self.excursion.worst.take();
        if let Some(worst) = &mut worst {
            worst.by = self.pushed_by(worst);
        }
        let share = (self.runs > 0).then(|| self.outside as f64 / self.runs as f64);
        let excursion = Excursion {
            share,
            worst,
            ..self.excursion
        };
        (excursion, (self.slots[0], self.periods))
    }
}

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
        let changed = self.effects.iter().map(Effect::sentence);
        let any = !of_nodes.is_empty();
        contradictions
            .chain(nodes)
            .chain(changed.filter(|_| any))
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
