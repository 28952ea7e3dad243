//! Decides what is written down of novelty and of contradictions while a recording is stepped over; not what they did to errors.

use std::sync::Arc;

use athermal_core::compile::{Outside, Plan, PlannedNode, PlannedRole, SourceChannel};
use athermal_core::engine::Engine;
use athermal_core::node::{Duty, Predictor, Role};
use athermal_run::model::Model;

use super::novelty::{Contradiction, Excursion, Novelty, Spoken, Stretch};

/// Stretches no farther apart are one.
const APART_S: f64 = 600.0;

impl Stretch {
    fn is_apart(&self, now_s: f64) -> bool {
        now_s - self.to_s > APART_S
    }
}

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
    learners: Vec<Learner>,
}

/// An estimator that goes on learning: the slots of its prediction and of its port `learning`, and how often who spoke.
struct Learner {
    node: String,
    slots: [usize; 2],
    spoke: [u64; 4],
}

impl Learner {
    fn new(node: &PlannedNode) -> Option<Self> {
        let says = node.says_of_learning()?;
        Some(Self {
            node: node.instance(),
            slots: [node.slots.start, says],
            spoke: [0; 4],
        })
    }

    fn look(&mut self, engine: &Engine) {
        let [prediction, says] = self.slots.map(|slot| engine.value(slot));
        if engine.ran(self.slots[0]) && !prediction.is_nan() {
            // Before its first truth it says nothing.
            let who = if says.is_nan() { 1 } else { says as usize / 10 };
            self.spoke[who.min(3)] += 1;
        }
    }

    fn finish(self) -> Option<Spoken> {
        let all = self.spoke.iter().sum::<u64>() as f64;
        let [learner, too_few, worse, silence] = self.spoke.map(|count| count as f64 / all);
        // Those that never yield to their fit are not worth a word.
        (learner < 1.0).then_some(Spoken {
            node: self.node,
            learner,
            too_few,
            worse,
            silence,
        })
    }
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
            learners: plan.nodes.iter().filter_map(Learner::new).collect(),
        }
    }

    pub(super) fn look(&mut self, engine: &Engine, now_s: f64) {
        self.estimators
            .iter_mut()
            .for_each(|of| of.look(engine, now_s));
        self.learners.iter_mut().for_each(|of| of.look(engine));
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
            learners: self
                .learners
                .into_iter()
                .filter_map(Learner::finish)
                .collect(),
            ..Novelty::default()
        };
        (novelty, periods)
    }
}

/// Of each estimator the slot of its prediction, and from when to when its last run was outside.
pub(super) type Periods = Vec<(usize, Vec<(f64, f64)>)>;

fn checks<'a>(plan: &'a Plan, node: &'a PlannedNode) -> impl Iterator<Item = Check> + 'a {
    let reasons = match node.kind.duty() {
        Duty::Compare => node.port("reason"),
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
