//! Decides the passes of a fit: what is fed by estimators and encoders comes after them. From estimators it learns out-of-fold
//! predictions; encoders are fitted once, since the outputs of two fits mean different things.

use std::sync::Arc;

use super::collect::{Collector, Share};
use super::drive::{Passed, drive};
use super::train::{Made, Making, begin, end, train_kept};
use super::{FitError, FitOptions, FitReport};
use crate::compile::{Plan, PlannedRole};
use crate::engine::{Engine, Fitted};
use crate::recording::{Event, Recording};

/// A fit under way.
pub(super) struct Fitting<'a> {
    plan: &'a Arc<Plan>,
    recording: &'a dyn Recording,
    options: &'a FitOptions,
    progress: &'a mut dyn FnMut(u64),
    /// What is to be fitted, by level: nodes of a level are fed by levels below only.
    levels: Vec<Level>,
    stepped: u64,
    report: FitReport,
}

/// Nodes that are fitted together.
#[derive(Default)]
struct Level {
    nodes: Vec<usize>,
    /// Whether an estimator feeds one of them.
    of_predictions: bool,
}

/// What one part of the rows of a level is made with: the fits below, and the ticks whose truths count.
struct Part {
    fitted: Fitted,
    share: Share,
}

impl<'a> Fitting<'a> {
    pub(super) fn new(
        plan: &'a Arc<Plan>,
        recording: &'a dyn Recording,
        options: &'a FitOptions,
        progress: &'a mut dyn FnMut(u64),
    ) -> Self {
        let levels = levels(plan);
        Self {
            plan,
            recording,
            options,
            progress,
            levels,
            stepped: 0,
            report: FitReport::default(),
        }
    }

    pub(super) fn run(mut self) -> Result<(Fitted, FitReport), FitError> {
        if self.levels.is_empty() {
            let mut engine = Engine::new(Arc::clone(self.plan), &Fitted::new())?;
            let passed = drive(&mut engine, self.recording, |_, _| {})?;
            self.note(&engine, passed);
            return Ok((Fitted::new(), self.report));
        }
        let top = self.levels.len() - 1;
        let (fitted, made) = self.fit_up_to(top, &Share::all(), &Fitted::new())?;
        let mut made: Vec<_> = made;
        made.sort_by_key(|(node, _)| *node);
        self.report.estimators = made.into_iter().map(|(_, fit)| fit).collect();
        Ok((fitted, self.report))
    }

    /// Fits all levels up to one on a share of the ticks, but for what is given.
    fn fit_up_to(
        &mut self,
        top: usize,
        share: &Share,
        given: &Fitted,
    ) -> Result<(Fitted, Vec<(usize, super::EstimatorFit)>), FitError> {
        let mut fitted = given.clone();
        let mut reports = Vec::new();
        for level in 0..=top {
            let plan = self.plan;
            let open = |node: &&usize| !given.contains_key(&plan.nodes[**node].instance());
            let nodes: Vec<_> = self.levels[level]
                .nodes
                .iter()
                .filter(open)
                .copied()
                .collect();
            if nodes.is_empty() {
                continue;
            }
            let parts = self.parts(level, share, &fitted)?;
            let made = self.fit_level(&nodes, &parts)?;
            for (&node, (fit, predictor)) in nodes.iter().zip(made) {
                if let Some(predictor) = predictor {
                    fitted.insert(fit.node.clone(), Arc::from(predictor));
                }
                reports.push((node, fit));
            }
        }
        Ok((fitted, reports))
    }

    /// Estimators below are fitted without the part of the ticks that they predict for those of this level.
    fn parts(
        &mut self,
        level: usize,
        share: &Share,
        below: &Fitted,
    ) -> Result<Vec<Part>, FitError> {
        if !self.levels[level].of_predictions {
            return Ok(vec![Part {
                fitted: below.clone(),
                share: share.clone(),
            }]);
        }
        let mut encoders = Fitted::new();
        for node in &self.plan.nodes {
            if let (PlannedRole::Feature { .. }, Some(fit)) =
                (&node.role, below.get(&node.instance()))
            {
                encoders.insert(node.instance(), Arc::clone(fit));
            }
        }
        let folds = self.options.folds.max(2) as u64;
        let mut parts = Vec::new();
        for fold in share.cut(self.report.ticks, folds) {
            let mut without = share.clone();
            without.without.push(fold.clone());
            let (fitted, _) = self.fit_up_to(level - 1, &without, &encoders)?;
            parts.push(Part {
                fitted,
                share: Share {
                    within: fold,
                    without: share.without.clone(),
                },
            });
        }
        Ok(parts)
    }

    fn fit_level(&mut self, nodes: &[usize], parts: &[Part]) -> Result<Vec<Made>, FitError> {
        let mut collector = Collector::new(self.plan, nodes, self.options.memory);
        self.pass(&mut collector, parts, None)?;
        if !collector.overflowed {
            return Ok(train_kept(self.plan, &collector, self.options));
        }
        let memory = self.options.memory / nodes.len().max(1);
        let mut makings: Vec<Making> = collector
            .trainees
            .iter()
            .map(|trainee| begin(self.plan, trainee, memory))
            .collect();
        let mut second = Collector::new(self.plan, nodes, 0);
        self.pass(&mut second, parts, Some(&mut makings))?;
        let ended = collector.trainees.iter().zip(makings);
        Ok(ended
            .map(|(trainee, making)| end(self.plan, trainee, making, true))
            .collect())
    }

    fn pass(
        &mut self,
        collector: &mut Collector,
        parts: &[Part],
        mut live: Option<&mut Vec<Making>>,
    ) -> Result<(), FitError> {
        for (nth, part) in parts.iter().enumerate() {
            if nth > 0 {
                collector.rewind();
            }
            let mut engine = Engine::new(Arc::clone(self.plan), &part.fitted)?;
            let (stepped, progress) = (&mut self.stepped, &mut self.progress);
            let passed = drive(&mut engine, self.recording, |engine, event| {
                collector.look(
                    engine,
                    event,
                    &part.share,
                    live.as_deref_mut().map(Vec::as_mut_slice),
                );
                if matches!(event, Event::Row(_)) {
                    *stepped += 1;
                    if stepped.is_multiple_of(4096) {
                        progress(*stepped);
                    }
                }
            })?;
            self.note(&engine, passed);
        }
        Ok(())
    }

    fn note(&mut self, engine: &Engine, passed: Passed) {
        self.report.ticks = passed.ticks;
        self.report.segments = passed.segments;
        self.report.period = passed.period;
        self.report.refused = engine.refused();
        self.report.rejected = engine.rejected_channels();
    }
}

/// The nodes that need a fit, by how many others feed them, one through the other.
fn levels(plan: &Plan) -> Vec<Level> {
    let mut levels: Vec<Level> = Vec::new();
    // Of each slot the first level that may read it, and whether a fitted estimator is behind it.
    let mut of_slot = vec![(0_usize, false); plan.channels.len()];
    for (index, node) in plan.nodes.iter().enumerate() {
        let gathers = node.role.inputs();
        let entries = gathers.flat_map(|gather| &plan.gathers[gather].entries);
        let mut after = (0, false);
        for entry in entries {
            let (level, predicted) = of_slot[entry.slot];
            after = (after.0.max(level), after.1 | predicted);
        }
        if node.rows().is_some() {
            let (level, predicted) = after;
            if levels.len() <= level {
                levels.resize_with(level + 1, Level::default);
            }
            levels[level].nodes.push(index);
            levels[level].of_predictions |= predicted;
            let predicts = matches!(node.role, PlannedRole::Estimator { .. });
            after = (level + 1, predicted | predicts);
        }
        of_slot[node.slots.clone()].fill(after);
    }
    levels
}
