//! What an estimator reads in place of measured past truths, where its own predictions are fed back. Only evaluations do
//! that, so memory may grow.

use std::collections::VecDeque;

use super::mode::Mode;
use super::mode::{StepLength, times};
use super::pairing::Pairing;
use crate::compile::{Entry, TruthLink};
use crate::engine::tick::Slots;
use crate::time::{Duration, Instant};

/// How many of the newest innovations that a prediction rests on count in its deviation.
const MOST_BROUGHT: usize = 256;

/// The predictions of one estimator, as they stand in for the truths that it would read.
#[derive(Debug)]
pub(crate) struct Feedback {
    link: TruthLink,
    mode: Mode,
    step: StepLength,
    past: Vec<Past>,
    /// Each run with what was predicted, after it.
    pairing: Pairing,
    truths: VecDeque<Truth>,
    deepest: Duration,
    row: Vec<f64>,
    /// Up to when truths are read as they were measured.
    origin: Instant,
    /// How the prediction of the last run changes with each past truth.
    slopes: Vec<f64>,
    /// By how much a past truth is changed to find that.
    nudge: f64,
    /// What [`widened`](Self::widened) gives.
    widened: f64,
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
    /// The run that predicted it; none where there was none.
    run: Option<Run>,
    /// What its innovation and those of the truths before it, the newest first, make of the error of what was predicted.
    brought: Vec<f64>,
}

#[derive(Debug)]
struct Run {
    at: Instant,
    regressors: Vec<f64>,
    slopes: Vec<f64>,
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
            step: StepLength::new(smallest + link.ahead),
            pairing: Pairing::new(link, regressors.len() + past.len() + 1),
            truths: VecDeque::new(),
            deepest,
            row: vec![0.0; regressors.len()],
            origin: Instant::MIN,
            slopes: vec![0.0; past.len()],
            past,
            nudge: 1.0,
            widened: 1.0,
        })
    }

    /// How long a step was planned to be; none where it is as long as the time between truths.
    pub fn step(&self) -> Option<Duration> {
        self.step.planned()
    }

    /// A truth of this tick that the run may read belongs to an earlier run; where there is no horizon, to the one to come.
    pub(crate) fn before_run(&mut self, slots: &Slots, now: Instant) {
        let slot = self.link.slot;
        if self.link.ahead > Duration::ZERO && slots.ran(slot) {
            self.observe(slots.values[slot], slots.given[slot].stamp, now);
        }
    }

    /// Takes a truth that has just been measured, be it nothing; a second call at the same instant does nothing.
    pub(crate) fn observe(&mut self, measured: f64, stamp: Instant, now: Instant) {
        if self.truths.back().is_some_and(|last| last.at == now) {
            return;
        }
        let mut predicted = f64::NAN;
        let run = self.pairing.truth(now).map(|paired| {
            let (regressors, rest) = paired.row.split_at(self.row.len());
            let (slopes, last) = rest.split_at(self.past.len());
            predicted = last[0];
            Run {
                at: paired.at,
                regressors: regressors.to_vec(),
                slopes: slopes.to_vec(),
            }
        });
        let known = self.truths.len();
        let brought = run
            .as_ref()
            .map(|run| self.error_of(run, self.origin, known));
        self.truths.push_back(Truth {
            at: now,
            stamp,
            measured,
            predicted,
            run,
            brought: brought.unwrap_or_default(),
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
        self.origin = origin;
        self.read(row, now, origin, self.truths.len());
    }

    /// Predicts every truth after the origin from those before it.
    fn predict_from(&mut self, origin: Instant, predict: impl Fn(&[f64], Instant) -> f64) {
        let first = self.truths.partition_point(|truth| truth.at <= origin);
        let mut row = std::mem::take(&mut self.row);
        for nth in first..self.truths.len() {
            let Some(mut run) = self.truths[nth].run.take() else {
                continue;
            };
            row.copy_from_slice(&run.regressors);
            self.read(&mut row, run.at, origin, nth);
            let mut predicted = f64::NAN;
            if !row.iter().any(|value| value.is_nan()) {
                predicted = predict(&row, run.at);
                self.find_slopes(&mut run.slopes, &mut row, predicted, run.at, &predict);
            }
            let brought = self.error_of(&run, origin, nth);
            let truth = &mut self.truths[nth];
            (truth.predicted, truth.brought, truth.run) = (predicted, brought, Some(run));
        }
        self.row = row;
    }

    /// Reads the past truths of a run at `now`, among the first `known`, those up to the origin as they were measured.
    fn read(&self, row: &mut [f64], now: Instant, origin: Instant, known: usize) {
        for past in &self.past {
            let truth = self.found(past, now, known);
            row[past.place] = truth.map_or(f64::NAN, |nth| {
                let truth = &self.truths[nth];
                if self.is_measured(truth, origin) {
                    truth.measured
                } else {
                    truth.predicted
                }
            });
        }
    }

    /// Which of the first `known` truths a run at `now` reads; none where that is too old.
    fn found(&self, past: &Past, now: Instant, known: usize) -> Option<usize> {
        let asked = now - past.lag;
        let count = self.truths.partition_point(|truth| truth.at <= asked);
        let last = count.min(known).checked_sub(1)?;
        (asked - self.truths[last].stamp <= past.max_age).then_some(last)
    }

    /// Whether a truth is read as it was measured.
    fn is_measured(&self, truth: &Truth, origin: Instant) -> bool {
        let begins = self.mode == Mode::FreeRun && truth.predicted.is_nan();
        begins || truth.at <= origin
    }

    /// Writes a run down, with what it predicted, about which the truth has this deviation while past truths are measured.
    pub(crate) fn ran(
        &mut self,
        row: &[f64],
        prediction: f64,
        std_dev: f64,
        now: Instant,
        predict: impl Fn(&[f64], Instant) -> f64,
    ) {
        if std_dev > 0.0 {
            self.nudge = std_dev;
        }
        let (mut nudged, mut slopes) = (
            std::mem::take(&mut self.row),
            std::mem::take(&mut self.slopes),
        );
        nudged.copy_from_slice(row);
        self.find_slopes(&mut slopes, &mut nudged, prediction, now, predict);
        (self.row, self.slopes) = (nudged, slopes);
        self.pairing.run(now, [row, &self.slopes, &[prediction]]);
        let brought = self.brought(&self.slopes, now, self.origin, self.truths.len());
        let squares = brought.iter().map(|by| by * by);
        self.widened = (1.0 + squares.sum::<f64>()).sqrt();
    }

    /// Finds how a prediction from a row changes with each past truth in it.
    fn find_slopes(
        &self,
        slopes: &mut [f64],
        row: &mut [f64],
        prediction: f64,
        at: Instant,
        predict: impl Fn(&[f64], Instant) -> f64,
    ) {
        for (slope, past) in slopes.iter_mut().zip(&self.past) {
            let truth = row[past.place];
            row[past.place] = truth + self.nudge;
            *slope = (predict(row, at) - prediction) / self.nudge;
            row[past.place] = truth;
        }
    }

    /// How many times as large as from measured truths alone the deviation about the prediction of the last run is.
    ///
    /// What was predicted of a truth errs by its innovation, and by what the errors of those that it was predicted from lead
    /// to: the deviation is that of as many steps as there are since the truths that were measured (Ljung 1999, section 3.2),
    /// to first order where the estimator is not linear. Innovations are taken to be as large as each other, and independent.
    pub(crate) fn widened(&self) -> f64 {
        self.widened
    }

    /// What innovations make of the error of a run, its own first.
    fn error_of(&self, run: &Run, origin: Instant, known: usize) -> Vec<f64> {
        let before = self.brought(&run.slopes, run.at, origin, known);
        std::iter::once(1.0).chain(before).collect()
    }

    /// What the innovations of the first `known` truths, the newest first, make of the error of a run at `now`.
    fn brought(&self, slopes: &[f64], now: Instant, origin: Instant, known: usize) -> Vec<f64> {
        let mut brought: Vec<f64> = Vec::new();
        for (past, slope) in self.past.iter().zip(slopes) {
            let Some(nth) = self.found(past, now, known) else {
                continue;
            };
            let truth = &self.truths[nth];
            if self.is_measured(truth, origin) {
                continue;
            }
            let newer = known - 1 - nth;
            let reach = (newer + truth.brought.len()).min(MOST_BROUGHT);
            brought.resize(brought.len().max(reach), 0.0);
            for (to, by) in brought.iter_mut().skip(newer).zip(&truth.brought) {
                *to += slope * by;
            }
        }
        brought
    }

    pub(crate) fn segment(&mut self) {
        self.pairing.clear();
        self.truths.clear();
        self.step.segment();
    }
}
