//! Decides what is noted while a test runs; not whether it is as expected.

use std::collections::BTreeMap;

use super::declare::Trial;
use crate::compile::Plan;
use crate::engine::Engine;
use crate::recording::Event;
use crate::score::{Mode, Watch};
use crate::time::{Duration, Instant};

/// What is noted during a run.
pub(super) struct Observed {
    watch: Watch,
    /// When each truth of the watch was measured.
    truth_times: Vec<Vec<Duration>>,
    /// The ticks: segment and time.
    pub(super) ticks: Vec<(u32, Duration)>,
    /// What the slots under test were given, be it nothing: segment, time and value.
    values: BTreeMap<usize, Vec<(u32, Duration, f64)>>,
    segment: u32,
    first: Option<Instant>,
}

impl Observed {
    pub(super) fn new(plan: &Plan, trial: &Trial) -> Self {
        let slots = trial
            .expect
            .iter()
            .flat_map(|expectation| &expectation.slots);
        let watch = Watch::new(plan, Mode::OneStep);
        Self {
            truth_times: vec![Vec::new(); watch.truths.len()],
            watch,
            ticks: Vec::new(),
            values: slots.map(|&slot| (slot, Vec::new())).collect(),
            segment: 0,
            first: None,
        }
    }

    pub(super) fn look(&mut self, engine: &Engine, event: Event) {
        self.watch.look(engine, event);
        let Event::Row(now) = event else {
            self.segment += 1;
            self.first = None;
            return;
        };
        let time = now - *self.first.get_or_insert(now);
        self.ticks.push((self.segment, time));
        for (times, truth) in self.truth_times.iter_mut().zip(&self.watch.truths) {
            if times.len() < truth.values.len() {
                times.push(time);
            }
        }
        for (&slot, values) in &mut self.values {
            if engine.ran(slot) {
                values.push((self.segment, time, engine.value(slot)));
            }
        }
    }

    /// The measured values of what a slot predicts, and what it predicted of each.
    pub(super) fn prediction(&self, slot: usize) -> Option<(&[f64], &[f64])> {
        self.watch.truths.iter().find_map(|truth| {
            let of = truth.predictions.iter().find(|of| of.slot == slot)?;
            Some((truth.values.as_slice(), of.values.as_slice()))
        })
    }

    /// The measured values of what a slot predicts.
    pub(super) fn truths(&self, slot: usize) -> Option<&[f64]> {
        self.prediction(slot).map(|(truth, _)| truth)
    }

    /// What the truth at the smallest lag would have predicted in place of a slot.
    pub(super) fn persistence(&self, slot: usize) -> Option<&[f64]> {
        self.watch.truths.iter().find_map(|truth| {
            let of = truth.predictions.iter().find(|of| of.slot == slot)?;
            Some(truth.persistences.get(&of.ahead)?.values.as_slice())
        })
    }

    /// When the values of what a slot predicts were measured.
    pub(super) fn truth_times(&self, slot: usize) -> Option<&[Duration]> {
        let has = |of: &crate::score::Prediction| of.slot == slot;
        let truths = self.watch.truths.iter();
        let nth = truths
            .clone()
            .position(|truth| truth.predictions.iter().any(has))?;
        Some(&self.truth_times[nth])
    }

    /// What a slot under test was given.
    pub(super) fn values(&self, slot: usize) -> &[(u32, Duration, f64)] {
        self.values.get(&slot).map_or(&[], Vec::as_slice)
    }
}
