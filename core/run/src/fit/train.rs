//! Decides how collected examples become a fitted estimator.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::FitOptions;
use super::block::{Content, Group};
use super::collect::{Collector, Sink, Trainee};
use super::doubt::{Lacking, Truths, note_constant};
use super::progress::{FitProgress, Listener};
use super::report::{EstimatorFit, Outcome};
use crate::channel::Extremes;
use crate::compile::{Plan, PlannedLearning, PlannedNode, PlannedRole, TruthLink};
use crate::engine::{When, naming_one};
use crate::node::{
    LearningLimits, Predictor, Regressor, Role, Trained, Trainer, TrainingError, TrainingSetup,
};
use crate::time::Instant;

/// A fit in the making: the complete rows of the candidates that were kept go to the trainer.
pub(super) struct Making {
    trainer: Box<dyn Trainer>,
    kept: Vec<usize>,
    /// The candidates that were left out since they stay the same.
    constant: Vec<usize>,
    may_leave_out: MayLeaveOut,
    /// Whether the estimator sees truths while it runs.
    learns: bool,
    row: Vec<f64>,
    all: Vec<f64>,
    truths: Truths,
    /// The ranges of the candidates that were kept and of the truth.
    ranges: Vec<Extremes>,
    incomplete: u64,
    lacking: Lacking,
    /// Why sums could not be taken.
    broken: Option<TrainingError>,
}

/// Which candidates a trainer may be made to do without.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MayLeaveOut {
    /// None: its model has no constant of its own.
    None,
    /// Not all: what encodes nothing has nothing to give.
    NotAll,
    /// Any: what is left is the constant.
    Any,
}

impl Making {
    /// The candidates that stay the same in all complete rows, where a trainer has been given some that may be left out. It is to
    /// be made again without them: a model that has a constant of its own learns nothing from them, and would give no prediction
    /// where their sensors are dead. Rows that lacked nothing else then come back, so that none of the others can stay the same.
    ///
    /// Where an estimator is fitted without each fold, one that stays the same in the rest alone is left out of that fit alone:
    /// it would have no effect in it, so that what is predicted for the fold is the same.
    pub(super) fn constant(&self) -> Vec<usize> {
        let candidates = self.kept.iter().zip(&self.ranges);
        let stay = candidates.filter(|(_, range)| range.is_one_value());
        let stay: Vec<usize> = stay.map(|(&candidate, _)| candidate).collect();
        let may = match self.may_leave_out {
            MayLeaveOut::None => false,
            MayLeaveOut::NotAll => stay.len() < self.kept.len(),
            MayLeaveOut::Any => true,
        };
        if may && self.truths.rows >= LEAST_ROWS {
            stay
        } else {
            Vec::new()
        }
    }
}

impl Making {
    /// Takes the examples of a stretch that folds do not cut.
    pub(super) fn take(&mut self, groups: &[Group], begins_segment: bool) {
        // Before the first row: no rows are kept.
        self.trainer.summed();
        if begins_segment {
            self.trainer.segment();
        }
        for group in groups {
            self.row.clear();
            let states = self.kept.iter().map(|&nth| group.states[nth].value());
            self.row.extend(states);
            if self.row.iter().any(|value| value.is_nan()) {
                self.incomplete += group.count();
                self.lacking.count(&self.row, group.count());
                continue;
            }
            match &group.content {
                Content::Rows(_) => {
                    group.each_row(|row, truth| {
                        self.row(Instant::from_ns(0), [row].into_iter(), truth)
                    });
                }
                Content::Sums {
                    truths,
                    extremes,
                    sums,
                } => self.add(group, truths, extremes, sums.get()),
            }
        }
        if let Some(summed) = self.trainer.summed() {
            summed.end_stretch();
        }
    }

    fn add(&mut self, group: &Group, truths: &Truths, extremes: &[(f64, f64)], sums: &str) {
        self.truths.merge(truths);
        let places: Vec<usize> = self.kept.iter().map(|&nth| group.place(nth)).collect();
        let truth = group.place(group.states.len());
        let all = places.iter().chain([&truth]);
        for (range, (lowest, highest)) in self.ranges.iter_mut().zip(all.map(|&at| extremes[at])) {
            range.include(lowest);
            range.include(highest);
        }
        let summed = self.trainer.summed();
        if let Some(Err(error)) = summed.map(|summed| summed.add_sums(sums, &places)) {
            self.broken.get_or_insert(error);
        }
    }
}

impl Sink for Making {
    fn row<'a>(&mut self, at: Instant, parts: impl Iterator<Item = &'a [f64]> + Clone, truth: f64) {
        self.all.clear();
        for part in parts {
            self.all.extend_from_slice(part);
        }
        self.row.clear();
        self.row
            .extend(self.kept.iter().map(|&candidate| self.all[candidate]));
        if self.row.iter().any(|value| value.is_nan()) {
            self.incomplete += 1;
            self.lacking.count(&self.row, 1);
        } else {
            self.truths.count(truth);
            for (range, value) in self.ranges.iter_mut().zip(self.row.iter().chain([&truth])) {
                range.include(*value);
            }
            self.trainer.row_at(at, &self.row, truth);
        }
    }

    fn run(&mut self, of: Instant, row: &[f64]) {
        self.row.clear();
        self.row
            .extend(self.kept.iter().map(|&candidate| row[candidate]));
        if !self.row.iter().any(|value| value.is_nan()) {
            self.trainer.run_at(of, &self.row);
        }
    }

    fn segment(&mut self) {
        self.trainer.segment();
    }
}

/// A fit, and its report.
pub(super) type Made = (EstimatorFit, Option<Box<dyn Predictor>>);

/// Starts the fit of one estimator, now that it is known which candidates have values, and which of them stay the same.
pub(super) fn begin(plan: &Plan, trainee: &Trainee, memory: usize, constant: Vec<usize>) -> Making {
    let regressors = plan.nodes[trainee.node].role.fit();
    let regressors = regressors.map_or(&[][..], |fit| &fit.regressors);
    let mut kept = trainee.validity.kept();
    kept.retain(|candidate| !constant.contains(candidate));
    let (trainer, may_leave_out) = trainer_of(plan, (trainee.node, trainee.link), &kept, memory);
    Making {
        trainer,
        constant,
        may_leave_out,
        learns: learning_of(&plan.nodes[trainee.node]).is_some(),
        row: Vec::with_capacity(kept.len()),
        ranges: vec![Extremes::NONE; kept.len() + 1],
        all: Vec::new(),
        lacking: Lacking::new(kept.iter().map(|&candidate| &regressors[candidate])),
        kept,
        truths: Truths::default(),
        incomplete: 0,
        broken: None,
    }
}

fn learning_of(node: &PlannedNode) -> Option<&PlannedLearning> {
    match &node.role {
        PlannedRole::Estimator { learning, .. } => learning.as_ref(),
        PlannedRole::Feature { .. } | PlannedRole::Combiner { .. } => None,
    }
}

/// What learns a truth from the rows of a node, of which some candidates are kept.
pub(super) fn trainer_of(
    plan: &Plan,
    (node, truth): (usize, TruthLink),
    kept: &[usize],
    memory: usize,
) -> (Box<dyn Trainer>, MayLeaveOut) {
    let node = &plan.nodes[node];
    let learning = learning_of(node);
    let regressors = node.role.fit().map_or(&[][..], |fit| &fit.regressors);
    let regressors = kept.iter().map(|&candidate| regressors[candidate].clone());
    let setup = TrainingSetup {
        instance: node.instance(),
        regressors: regressors.collect::<Vec<Regressor>>(),
        places: kept.to_vec(),
        error_unit: plan.channels[truth.slot]
            .channel
            .unit
            .difference()
            .to_string(),
        memory,
        ahead: truth.ahead,
        span: truth.span,
        learns: learning.is_some(),
        limits: learning.map_or(LearningLimits::NONE, |learning| learning.limits),
    };
    match node.spec.role() {
        Role::Estimator(estimator) if estimator.needs_constants() => {
            (estimator.trainer(&setup), MayLeaveOut::None)
        }
        Role::Estimator(estimator) => (estimator.trainer(&setup), MayLeaveOut::Any),
        Role::Feature(feature) => {
            let encoder = feature.encoder();
            let encoder = encoder.expect("a feature with rows has an encoder");
            (encoder.trainer(&setup), MayLeaveOut::NotAll)
        }
        Role::Combiner(_) => unreachable!("a combiner is not fitted"),
    }
}

/// Fewer complete rows say nothing about how a truth hangs together with anything.
const LEAST_ROWS: u64 = 2;
/// Squares of larger values overflow when some of them are summed.
const LARGEST: f64 = 1e150;

/// Ends the fit of one estimator.
pub(super) fn end(
    plan: &Plan,
    collector: &Collector,
    trainee: &Trainee,
    making: Making,
    streamed: bool,
    progress: &Listener<'_>,
) -> Made {
    let node = &plan.nodes[trainee.node];
    let truth = &plan.channels[trainee.link.slot];
    let regressors = node.role.fit().map_or(&[][..], |fit| &fit.regressors);
    let mut dropped = trainee.dropped;
    dropped.incomplete = making.incomplete;
    let has_values = trainee.validity.kept();
    let dropped_candidates = (0..regressors.len())
        .filter(|candidate| !has_values.contains(candidate))
        .map(|candidate| {
            (
                regressors[candidate].name.clone(),
                trainee.validity.share(candidate),
            )
        })
        .collect();
    let truths = making.truths;
    let trained = if trainee.validity.knows_nothing() {
        let no_truth = || no_truth(plan, collector, trainee);
        let came = dropped.without_run > 0;
        let never_ran = came.then(|| collector.waited_for(plan, trainee));
        Err(never_ran.flatten().unwrap_or_else(no_truth))
    } else if truths.rows < LEAST_ROWS {
        Err(TrainingError::TooFewRows {
            rows: truths.rows as usize,
            needed: LEAST_ROWS as usize,
        })
    } else {
        let mut ranges = making.ranges.iter();
        let overflows = ranges.position(|range| range.largest() > LARGEST);
        let too_large = overflows.map(|nth| TrainingError::TooLarge {
            name: match making.kept.get(nth) {
                Some(&candidate) => regressors[candidate].name.clone(),
                None => truth.name.clone(),
            },
            largest: making.ranges[nth].largest(),
        });
        // Some trainers would make a model of sums that overflowed.
        match too_large.or(making.broken) {
            Some(error) => Err(error),
            None => {
                let node = &node.instance();
                let mut order = |nth, of| progress.report(FitProgress::Order { node, nth, of });
                making.trainer.finish_telling(&mut order)
            }
        }
    };
    let trained = trained.and_then(|trained| {
        if making.learns && trained.predictor.learner().is_none() {
            let author = node.kind.author();
            return Err(TrainingError::NoLearner { author });
        }
        Ok(trained)
    });
    let (outcome, predictor) = match trained {
        Ok(Trained {
            predictor,
            mut report,
        }) => {
            let constant = making.constant.iter();
            note_constant(constant.map(|&nth| &*regressors[nth].name), &mut report);
            making.lacking.note(truths.rows, &mut report);
            let asked = (regressors.len(), making.learns);
            truths.doubt(predictor.as_ref(), asked, &mut report);
            (Outcome::Fitted(report), Some(predictor))
        }
        Err(error) => {
            let error = making.lacking.too_few(error, making.incomplete);
            (Outcome::Failed(error), None)
        }
    };
    let fit = EstimatorFit {
        node: node.instance(),
        kind: node.kind.name,
        truth: truth.name.clone(),
        unit: truth.channel.unit.difference().to_string(),
        rows: truths.rows,
        dropped,
        dropped_candidates,
        streamed,
        outcome,
    };
    (fit, predictor)
}

/// Why there is no truth to learn from.
fn no_truth(plan: &Plan, collector: &Collector, trainee: &Trainee) -> TrainingError {
    let (slot, dropped) = (trainee.link.slot, trainee.dropped);
    let truth = plan.channels[slot].name.clone();
    let none_came = dropped.outside_limits == 0 && dropped.without_run == 0;
    let behind = plan.behind([slot]);
    let measured = (0..plan.channels.len()).filter(|&slot| behind[slot]);
    let measured = measured.filter(|&slot| plan.channels[slot].node.is_none());
    let measured: Vec<usize> = measured.collect();
    let is_known = measured
        .iter()
        .all(|&slot| plan.channels[slot].history.is_none());
    if !none_came || !is_known || plan.channels[slot].node.is_none() {
        return TrainingError::NoTruth {
            truth,
            outside_limits: dropped.outside_limits,
            too_early: dropped.without_run,
        };
    }
    let names = |slots: &mut dyn Iterator<Item = &usize>| {
        let names = slots.map(|&slot| plan.channels[slot].name.clone());
        names.collect::<Vec<String>>()
    };
    TrainingError::TruthNeverWhole {
        truth,
        silent: names(&mut measured.iter().filter(|&&slot| collector.is_silent(slot))),
        measured: names(&mut measured.iter()),
        span: plan.channels[slot].channel.span,
    }
}

/// Fits all estimators from the examples kept, on several threads; the result does not depend on how many.
pub(super) fn train_kept(
    plan: &Plan,
    collector: &Collector,
    options: &FitOptions,
    progress: &Listener<'_>,
) -> Vec<Made> {
    in_threads(collector.trainees.len(), options.threads, |index| {
        let trainee = &collector.trainees[index];
        naming_one(plan, trainee.node, When::Fit, || {
            // The whole memory, or how folds are cut would depend on the number of threads.
            let mut making = begin(plan, trainee, options.memory, Vec::new());
            collector.replay(index, &mut making);
            let constant = making.constant();
            if !constant.is_empty() {
                // What the first one keeps is gone before the next keeps as much.
                drop(making);
                making = begin(plan, trainee, options.memory, constant);
                collector.replay(index, &mut making);
            }
            end(plan, collector, trainee, making, false, progress)
        })
    })
}

/// Works through so many things on several threads; the results are in the order of the things.
pub(super) fn in_threads<T: Send>(
    count: usize,
    threads: usize,
    make: impl Fn(usize) -> T + Sync,
) -> Vec<T> {
    let threads = threads.clamp(1, count.max(1));
    let next = AtomicUsize::new(0);
    let work = || {
        let mut made = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= count {
                return made;
            }
            made.push((index, make(index)));
        }
    };
    let mut made = if threads == 1 {
        work()
    } else {
        crossbeam::thread::scope(|scope| {
            let handles: Vec<_> = (0..threads).map(|_| scope.spawn(|_| work())).collect();
            handles
                .into_iter()
                .flat_map(|handle| handle.join().unwrap_or_else(|panic| resume_unwind(panic)))
                .collect::<Vec<_>>()
        })
        .expect("each thread has been joined")
    };
    made.sort_by_key(|&(index, _)| index);
    made.into_iter().map(|(_, made)| made).collect()
}
