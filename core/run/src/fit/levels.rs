//! Decides the passes of a fit: what is fed by estimators and encoders comes after them. From estimators it learns out-of-fold
//! predictions; encoders are fitted once, since the outputs of two fits mean different things.

use std::ops::Range;
use std::sync::Arc;

use super::collect::{Collector, Share, Trainee};
use super::progress::{FitProgress, Listener};
use super::rates::Spacing;
use super::train::{Made, Making, begin, end, train_kept};
use super::{FitError, FitOptions, FitReport};
use crate::compile::{Plan, PlannedRole};
use crate::engine::{Engine, Fitted, When, naming_one};
use crate::recording::{Event, Passed, Recording, pass};
use crate::score::Means;

/// A fit under way.
pub(super) struct Fitting<'a> {
    plan: &'a Arc<Plan>,
    recording: &'a dyn Recording,
    options: &'a FitOptions,
    progress: Listener<'a>,
    /// What is to be fitted, by level: nodes of a level are fed by levels below only.
    levels: Vec<Level>,
    /// The truths that estimators learn from which are fed by others.
    truths: Vec<usize>,
    /// The ticks with one of them, as the last pass met them: by those folds are cut.
    counted: Counted,
    stepped: u64,
    /// How many fits of a level have begun, and how many there will be.
    begun: u64,
    fits: u64,
    report: FitReport,
}

/// Nodes that are fitted together.
#[derive(Default)]
pub(super) struct Level {
    pub(super) nodes: Vec<usize>,
    /// Those of them that feed others that are fitted.
    feeding: Vec<usize>,
    /// Whether an estimator feeds one of them.
    of_predictions: bool,
}

/// The fits of a share of the ticks, level by level, and of the same without each of its folds, as far as levels above have
/// asked for them: what two levels learn from is fitted once.
struct Course {
    share: Share,
    fitted: Fitted,
    /// How many levels have been fitted.
    levels: usize,
    /// Each fold with the course of all ticks but those.
    folds: Vec<(Range<u64>, Course)>,
}

impl Course {
    fn of(share: Share) -> Self {
        Self {
            share,
            fitted: Fitted::new(),
            levels: 0,
            folds: Vec::new(),
        }
    }

    /// The same ticks without each of so many folds, with about the same number of these ticks in each.
    fn without_folds(&self, ticks: &[u64], folds: usize) -> Vec<(Range<u64>, Course)> {
        let folds = self.share.cut(ticks, folds).into_iter();
        folds
            .map(|fold| {
                let mut share = self.share.clone();
                share.without.push(fold.clone());
                (fold, Course::of(share))
            })
            .collect()
    }
}

/// The numbers of the ticks that count: of all of them, or of every so many where there are more than can be kept.
#[derive(Default)]
struct Counted {
    ticks: Vec<u64>,
    /// How many ticks there were.
    passed: u64,
    /// How many of them count.
    found: u64,
    /// How many times every second one has been let go.
    halved: u32,
}

impl Counted {
    const MOST: usize = 1 << 16;

    fn tick(&mut self, counts: bool) {
        if counts {
            if self.found.trailing_zeros() >= self.halved {
                self.ticks.push(self.passed);
            }
            self.found += 1;
        }
        self.passed += 1;
        if self.ticks.len() > Self::MOST {
            let mut nth = 0_usize;
            self.ticks.retain(|_| {
                nth += 1;
                nth % 2 == 1
            });
            self.halved += 1;
        }
    }
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
        progress: Listener<'a>,
    ) -> Self {
        let mut levels = levels(plan);
        if let (Some(only), [level]) = (&options.only, &mut levels[..]) {
            level
                .nodes
                .retain(|&node| only.contains(&plan.nodes[node].instance()));
        }
        let above = levels.iter().filter(|level| level.of_predictions);
        let rows = above.flat_map(|level| &level.nodes);
        let rows = rows.filter_map(|&node| plan.nodes[node].rows());
        let truths = rows.map(|rows| rows.fit.truth.slot).collect();
        let top = levels.len().saturating_sub(1);
        let whole = &mut Planned::default();
        Self {
            fits: whole.fits_up_to(top, plan, &levels, options.folds()),
            begun: 0,
            truths,
            counted: Counted::default(),
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
            let (mut means, mut spacing) = (Means::new(self.plan), Spacing::new(self.plan));
            let passed = pass(&mut engine, self.recording, |engine, event, _| {
                spacing.look(engine, event, true);
                if matches!(event, Event::Row(_)) {
                    means.look(|slot| engine.value(slot));
                }
            })?;
            self.note(&engine, passed, &means, &spacing);
            return Ok((Fitted::new(), self.report));
        }
        let top = self.levels.len() - 1;
        let mut course = Course::of(Share::all());
        let mut made = self.fit_up_to(top, &mut course)?;
        made.sort_by_key(|(node, _)| *node);
        self.report.estimators = made.into_iter().map(|(_, fit)| fit).collect();
        Ok((course.fitted, self.report))
    }

    /// Fits the levels up to one that have not been fitted yet, but for what is given.
    fn fit_up_to(
        &mut self,
        top: usize,
        course: &mut Course,
    ) -> Result<Vec<(usize, super::EstimatorFit)>, FitError> {
        let mut reports = Vec::new();
        for level in course.levels..=top {
            course.levels = level + 1;
            let plan = self.plan;
            let open = |node: &&usize| !course.fitted.contains_key(&plan.nodes[**node].instance());
            // Without a fold only what levels above learn from it is asked for.
            let Level { nodes, feeding, .. } = &self.levels[level];
            let asked = if course.share.without.is_empty() {
                nodes
            } else {
                feeding
            };
            let nodes: Vec<_> = asked.iter().filter(open).copied().collect();
            if nodes.is_empty() {
                continue;
            }
            let parts = self.parts(level, course)?;
            let made = self.fit_level(&nodes, &parts)?;
            for (&node, (fit, predictor)) in nodes.iter().zip(made) {
                if let Some(predictor) = predictor {
                    course.fitted.insert(fit.node.clone(), Arc::from(predictor));
                }
                reports.push((node, fit));
            }
        }
        Ok(reports)
    }

    /// Estimators below are fitted without the part of the ticks that they predict for those of this level.
    fn parts(&mut self, level: usize, course: &mut Course) -> Result<Vec<Part>, FitError> {
        if !self.levels[level].of_predictions {
            return Ok(vec![Part {
                fitted: course.fitted.clone(),
                share: course.share.clone(),
            }]);
        }
        if course.folds.is_empty() {
            course.folds = course.without_folds(&self.counted.ticks, self.options.folds());
        }
        let mut parts = Vec::new();
        for (fold, without) in &mut course.folds {
            // Encoders are given: see above.
            for node in &self.plan.nodes {
                if let (PlannedRole::Feature { .. }, Some(fit)) =
                    (&node.role, course.fitted.get(&node.instance()))
                {
                    without.fitted.insert(node.instance(), Arc::clone(fit));
                }
            }
            self.fit_up_to(level - 1, without)?;
            parts.push(Part {
                fitted: without.fitted.clone(),
                share: Share {
                    within: fold.clone(),
                    without: course.share.without.clone(),
                },
            });
        }
        Ok(parts)
    }

    fn fit_level(&mut self, nodes: &[usize], parts: &[Part]) -> Result<Vec<Made>, FitError> {
        self.begun += 1;
        let mut collector = Collector::new(self.plan, nodes, self.options.memory);
        self.pass(&mut collector, parts, None)?;
        if !collector.overflowed {
            return Ok(train_kept(
                self.plan,
                &collector,
                self.options,
                &self.progress,
            ));
        }
        let all = collector.trainees.iter();
        let mut makings =
            self.stream(all.map(|trainee| (trainee, Vec::new())), nodes.len(), parts)?;
        // Which candidates stay the same in the rows that are complete is known at their end; without them it takes another pass.
        let constants = makings.iter().map(Making::constant).enumerate();
        let again: Vec<_> = constants.filter(|(_, all)| !all.is_empty()).collect();
        if !again.is_empty() {
            for (nth, _) in again.iter().rev() {
                makings.remove(*nth);
            }
            let places: Vec<usize> = again.iter().map(|(nth, _)| *nth).collect();
            let without = again
                .into_iter()
                .map(|(nth, constant)| (&collector.trainees[nth], constant));
            let made = self.stream(without, nodes.len(), parts)?;
            for (nth, making) in places.into_iter().zip(made) {
                makings.insert(nth, making);
            }
        }
        let ended = collector.trainees.iter().zip(makings);
        Ok(ended
            .map(|(trainee, making)| {
                naming_one(self.plan, trainee.node, When::Fit, || {
                    end(self.plan, &collector, trainee, making, true, &self.progress)
                })
            })
            .collect())
    }

    /// Reads the data once more for some of so many estimators of a level, each without some of its candidates.
    fn stream<'t>(
        &mut self,
        trainees: impl Iterator<Item = (&'t Trainee, Vec<usize>)>,
        of: usize,
        parts: &[Part],
    ) -> Result<Vec<Making>, FitError> {
        let memory = self.options.memory / of.max(1);
        let (mut nodes, mut makings) = (Vec::new(), Vec::new());
        for (trainee, constant) in trainees {
            nodes.push(trainee.node);
            makings.push(naming_one(self.plan, trainee.node, When::Fit, || {
                begin(self.plan, trainee, memory, constant)
            }));
        }
        let mut collector = Collector::new(self.plan, &nodes, 0);
        self.pass(&mut collector, parts, Some(&mut makings))?;
        Ok(makings)
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
            let (stepped, progress) = (&mut self.stepped, &self.progress);
            let (fit, of) = (self.begun, self.fits);
            let report = |stepped| progress.report(FitProgress::Ticks { stepped, fit, of });
            report(*stepped);
            let (truths, counted) = (&self.truths, &mut self.counted);
            *counted = Counted::default();
            let (mut means, mut spacing) = (Means::new(self.plan), Spacing::new(self.plan));
            let passed = pass(&mut engine, self.recording, |engine, event, _| {
                spacing.look(engine, event, true);
                collector.look(
                    engine,
                    event,
                    &part.share,
                    live.as_deref_mut().map(Vec::as_mut_slice),
                );
                if matches!(event, Event::Row(_)) {
                    means.look(|slot| engine.value(slot));
                    let came = |&slot: &usize| !engine.value(slot).is_nan();
                    counted.tick(truths.iter().any(came));
                    *stepped += 1;
                    if stepped.is_multiple_of(4096) {
                        report(*stepped);
                    }
                }
            })?;
            self.note(&engine, passed, &means, &spacing);
        }
        Ok(())
    }

    fn note(&mut self, engine: &Engine, passed: Passed, means: &Means, spacing: &Spacing) {
        self.report.ticks = passed.ticks;
        self.report.segments = passed.segments;
        self.report.period = passed.period;
        self.report.refused = engine.refused();
        self.report.rejected = engine.rejected_channels();
        self.report.ranges = engine.sample_ranges();
        self.report.rates = spacing.usual(self.plan);
        self.report.levels = means.levels(self.plan);
    }
}

/// A [`Course`] of which only the number of fits is asked; all of its folds have the same.
#[derive(Default)]
struct Planned {
    levels: usize,
    fold: Option<Box<Planned>>,
    is_fold: bool,
}

impl Planned {
    fn fits_up_to(&mut self, top: usize, plan: &Plan, levels: &[Level], folds: usize) -> u64 {
        let mut fits = 0_u64;
        while self.levels <= top && self.levels < levels.len() {
            let level = &levels[self.levels];
            let is_open =
                |&node: &usize| matches!(plan.nodes[node].role, PlannedRole::Estimator { .. });
            if !self.is_fold || level.feeding.iter().any(is_open) {
                fits = fits.saturating_add(1);
                if level.of_predictions {
                    let fold = self.fold.get_or_insert_default();
                    fold.is_fold = true;
                    let of_fold = fold.fits_up_to(self.levels - 1, plan, levels, folds);
                    fits = of_fold.saturating_mul(folds as u64).saturating_add(fits);
                }
            }
            self.levels += 1;
        }
        fits
    }
}

/// The nodes that need a fit, by how many others feed them, one through the other.
pub(super) fn levels(plan: &Plan) -> Vec<Level> {
    let mut levels: Vec<Level> = Vec::new();
    // Of each slot the first level that may read it, and whether a fitted estimator is behind it.
    let mut of_slot = vec![(0_usize, false); plan.channels.len()];
    for (index, node) in plan.nodes.iter().enumerate() {
        let entries = |gather: usize| plan.gathers[gather].entries.iter();
        let mut after = (0, false);
        for entry in node.role.inputs().flat_map(entries) {
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
        // What freezes it is not among its rows, but whoever learns from what it gives needs that fitted too.
        for entry in node.role.gathers().flat_map(entries) {
            after.0 = after.0.max(of_slot[entry.slot].0);
        }
        of_slot[node.slots.clone()].fill(after);
    }
    let fitted = plan.nodes.iter().filter(|node| node.rows().is_some());
    let feeds = plan.behind(fitted.flat_map(|node| plan.reads(node)));
    for level in &mut levels {
        let feeding = |node: &&usize| feeds[plan.nodes[**node].slots.clone()].contains(&true);
        level.feeding = level.nodes.iter().filter(feeding).copied().collect();
    }
    levels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_more_ticks_than_can_be_kept_every_so_many_counts() {
        let mut counted = Counted::default();
        let all = 5 * Counted::MOST as u64;
        for tick in 0..2 * all {
            counted.tick(tick % 2 == 1);
        }
        assert!(counted.ticks.len() <= Counted::MOST);
        // They are as far apart from the first to the last.
        let apart = |pair: &[u64]| pair[1] - pair[0] == 16;
        assert!(counted.ticks.windows(2).all(apart));
        assert_eq!(counted.ticks[0], 1);
        let parts = Share::all().cut(&counted.ticks, 2);
        assert!(parts[0].end.abs_diff(all) < 16, "{parts:?}");
    }
}
