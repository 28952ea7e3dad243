//! Decides what an estimator reads in place of measured past truths, where its own predictions are fed back; only
//! evaluations do that, so that memory may be taken as it comes.

use std::collections::VecDeque;

use super::mode::{Step, times};
use super::pairing::Pairing;
use super::{Mode, Slots};
use crate::compile::{Entry, TruthLink};
use crate::time::{Duration, Instant};

/// The predictions of one estimator, as they stand in for the truths that it would read.
#[derive(Debug)]
pub(crate) struct Feedback {
    link: TruthLink,
    mode: Mode,
    step: Step,
    past: Vec<Past>,
    /// Each run with what was predicted, after it.
    pairing: Pairing,
    truths: VecDeque<Truth>,
    deepest: Duration,
    row: Vec<f64>,
}

/// A past truth in a row.
#[derive(Debug, Clone, Copy)]
struct Past {
    place: usize,
    lag: Duration,
    max_age: Duration,
}

#[derive(Debug)]
struct Truth {
    at: Instant,
    stamp: Instant,
    measured: f64,
    /// What was predicted of it: NaN where nothing was.
    predicted: f64,
    /// The run that predicted it, and its regressors; none where there was no run.
    run: Option<(Instant, Vec<f64>)>,
}

impl Feedback {
    /// None for an estimator that reads no past truth.
    pub(crate) fn new(mode: Mode, link: &TruthLink, regressors: &[Entry]) -> Option<Self> {
        let past: Vec<Past> = regressors
            .iter()
            .enumerate()
            .filter(|(_, entry)| entry.slot == link.slot)
            .map(|(place, entry)| Past {
                place,
                lag: entry.lag,
                max_age: entry.max_age,
            })
            .collect();
        let smallest = past.iter().map(|past| past.lag).min()?;
        let deepest = past.iter().map(|past| past.lag).max()?;
        Some(Self {
            link: *link,
            mode,
            step: Step::new(smallest + link.ahead),
            past,
            pairing: Pairing::new(link, regressors.len() + 1),
            truths: VecDeque::new(),
            deepest,
            row: vec![0.0; regressors.len()],
        })
    }

    /// A truth of this tick that the run may read belongs to an earlier run; where there is no horizon, to the one to come.
    pub(crate) fn before_run(&mut self, slots: &Slots, now: Instant) {
        let slot = self.link.slot;
        if self.link.ahead > Duration::ZERO && slots.ran(slot) {
            self.observe(slots.values[slot], slots.stamps[slot], now);
        }
    }

    /// Takes a truth that has just been measured, be it nothing; it may be told twice.
    pub(crate) fn observe(&mut self, measured: f64, stamp: Instant, now: Instant) {
        if self.truths.back().is_some_and(|last| last.at == now) {
            return;
        }
        let paired = self.pairing.truth(now);
        let run = paired.map(|paired| (paired.at, paired.row));
        self.truths.push_back(Truth {
            at: now,
            stamp,
            measured,
            predicted: run.map_or(f64::NAN, |(_, row)| row[row.len() - 1]),
            run: run.map(|(at, row)| (at, row[..row.len() - 1].to_vec())),
        });
        self.step.truth(now);
        let reach = match self.mode {
            Mode::Steps(steps) => times(self.step.length(), i64::from(steps.get())),
            Mode::OneStep | Mode::FreeRun => Duration::ZERO,
        };
        let oldest = now - self.deepest - reach - self.link.ahead;
        while self.truths.get(1).is_some_and(|next| next.at <= oldest) {
            self.truths.pop_front();
        }
    }

    /// Replaces the past truths in the row of a run; `predict` is asked for predictions of runs before.
    pub(crate) fn replace(
        &mut self,
        row: &mut [f64],
        now: Instant,
        predict: impl Fn(&[f64], Instant) -> f64,
    ) {
        let origin = match self.mode {
            Mode::OneStep => return,
            Mode::FreeRun => Instant::MIN,
            Mode::Steps(steps) => {
                let back = times(self.step.length(), i64::from(steps.get()));
                let origin = now + self.link.ahead - back;
                self.predict_from(origin, predict);
                origin
            }
        };
        self.read(row, now, origin, self.truths.len());
    }

    /// Predicts every truth after the origin from those before it.
    fn predict_from(&mut self, origin: Instant, predict: impl Fn(&[f64], Instant) -> f64) {
        let first = self.truths.partition_point(|truth| truth.at <= origin);
        let mut row = std::mem::take(&mut self.row);
        for nth in first..self.truths.len() {
            let predicted = match &self.truths[nth].run {
                None => f64::NAN,
                Some((at, of_run)) => {
                    row.copy_from_slice(of_run);
                    self.read(&mut row, *at, origin, nth);
                    if row.iter().any(|value| value.is_nan()) {
                        f64::NAN
                    } else {
                        predict(&row, *at)
                    }
                }
            };
            self.truths[nth].predicted = predicted;
        }
        self.row = row;
    }

    /// Reads the past truths of a run at `now`, among the first `known`, those up to the origin as they were measured.
    fn read(&self, row: &mut [f64], now: Instant, origin: Instant, known: usize) {
        for past in &self.past {
            let asked = now - past.lag;
            let count = self.truths.partition_point(|truth| truth.at <= asked);
            let last = count.min(known).checked_sub(1);
            let truth = last.map(|last| &self.truths[last]);
            let young = truth.filter(|truth| asked - truth.stamp <= past.max_age);
            row[past.place] = young.map_or(f64::NAN, |truth| self.stand_in(truth, origin));
        }
    }

    fn stand_in(&self, truth: &Truth, origin: Instant) -> f64 {
        let begins = self.mode == Mode::FreeRun && truth.predicted.is_nan();
        if begins || truth.at <= origin {
            truth.measured
        } else {
            truth.predicted
        }
    }

    /// Writes a run down, with what it predicted.
    pub(crate) fn ran(&mut self, row: &[f64], prediction: f64, now: Instant) {
        self.pairing.run(now, [row, &[prediction]]);
    }

    pub(crate) fn segment(&mut self) {
        self.pairing.clear();
        self.truths.clear();
        self.step.segment();
    }
}
