//! Decides how a test is run: the engine taken through the data, what is noted on the way; not whether it is as expected.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::declare::Trial;
use super::judge::{Finding, judge};
use crate::compile::Plan;
use crate::engine::{Engine, Fitted};
use crate::fault::WithFaults;
use crate::fit::{FitError, drive};
use crate::recording::{Event, Recording};
use crate::score::Watch;
use crate::time::{Duration, Instant};

/// The seed of the spikes and noise of faults.
const FAULT_SEED: u64 = 1;

/// What came of a test.
#[derive(Debug, Clone, Default)]
pub struct Verdict {
    /// Everything that was checked, in the order of the file.
    pub findings: Vec<Finding>,
    /// Ticks stepped.
    pub ticks: u64,
}

impl Verdict {
    /// Whether everything is as expected.
    #[must_use]
    pub fn passes(&self) -> bool {
        self.findings.iter().all(Finding::holds)
    }
}

/// Steps the plan over the data of a test, with its faults, and checks what comes out.
///
/// The plan is one that [`super::observe`] has been told of the test.
///
/// # Errors
/// When the data cannot be read, or the fit does not belong to the plan.
pub fn run(
    plan: &Arc<Plan>,
    trial: &Trial,
    fitted: &Fitted,
    data: &dyn Recording,
) -> Result<Verdict, FitError> {
    let faulty = WithFaults::new(data, trial.faults.clone(), FAULT_SEED);
    let data: &dyn Recording = if trial.faults.is_empty() {
        data
    } else {
        &faulty
    };
    let mut engine = Engine::new(Arc::clone(plan), fitted)?;
    let mut observed = Observed::new(plan, trial);
    let passed = drive(&mut engine, data, |engine, event| {
        observed.look(engine, event);
    })?;
    let expectations = trial.expect.iter();
    Ok(Verdict {
        findings: expectations
            .flat_map(|expectation| judge(plan, expectation, &observed))
            .collect(),
        ticks: passed.ticks,
    })
}

/// What is noted during a run.
pub(super) struct Observed {
    watch: Watch,
    /// When each truth of the watch was measured.
    truth_times: Vec<Vec<Duration>>,
    /// The ticks.
    pub(super) ticks: Vec<Duration>,
    /// What the slots under test were given, be it nothing: segment, time and value.
    values: BTreeMap<usize, Vec<(u32, Duration, f64)>>,
    segment: u32,
    first: Option<Instant>,
}

impl Observed {
    fn new(plan: &Plan, trial: &Trial) -> Self {
        let slots = trial
            .expect
            .iter()
            .flat_map(|expectation| &expectation.slots);
        let watch = Watch::new(plan);
        Self {
            truth_times: vec![Vec::new(); watch.truths.len()],
            watch,
            ticks: Vec::new(),
            values: slots.map(|&slot| (slot, Vec::new())).collect(),
            segment: 0,
            first: None,
        }
    }

    fn look(&mut self, engine: &Engine, event: Event) {
        self.watch.look(engine, event);
        let Event::Row(now) = event else {
            self.segment += 1;
            self.first = None;
            return;
        };
        let time = now - *self.first.get_or_insert(now);
        self.ticks.push(time);
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
