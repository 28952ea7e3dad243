//! How a fitted estimator answers a change of one sensor: step and impulse responses, reconstructed from the frame.
//!
//! The impulse response of a linear estimator is `Γ = Σ c_k e_k`, its coefficients times what each feature makes of an impulse
//! (Mandelli, Dankwart and Napoli, section 3.2). It is found by asking the graph itself: all sensors rest at their means, one of
//! them steps, and the engine runs. So it holds for whatever features a graph has, lags and other frames included, and for an
//! estimator that is not linear it is the answer to a change of one standard deviation. Where a node that watches sensors lets
//! that not through, the change is a hundredth of it, or less, and sensors rest as in the module `rest`.
//!
//! Estimators that read or follow past truths run freely, on their own predictions: truths that rest while a sensor steps would
//! contradict them, and what is asked for is the transfer function of the model.

use std::sync::Arc;

use athermal_core::compile::{Plan, PlannedRole};
use athermal_core::engine::{Engine, EngineError, Mode};
use athermal_core::time::{Duration, Instant};
use athermal_run::fit::FitError;
use athermal_run::model::Model;
use serde::Serialize;

use super::observation::Observation;
use super::of_truths;
use super::reach;
use super::rest::{Rest, SilentNode, silent};

/// Instants of a response, at most.
const MOST_INSTANTS: i64 = 2_000;
/// A step that a watch does not let through is tried again at these shares of its size.
const SMALLER: [f64; 3] = [1.0, 1e-2, 1e-4];
/// A step response below this share of the largest of its estimator is none.
const NOTHING: f64 = 1e-9;
/// A step response that ends below this share of its largest value has come back to nothing, unless it rests there.
const LASTS: f64 = 0.01;
/// The last of a step response is shown as long as it is further than this share of its largest value from where it ends.
const SHOWN: f64 = 1e-3;
/// A step response is at rest when it has changed by less than this share of its largest value within [`QUIET`] ticks.
const AT_REST: f64 = 1e-6;
const QUIET: usize = 50;
/// The share of an answer that must have come for it to have settled.
const SETTLED: f64 = 0.9;

/// How one estimator answers its sensors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Responses {
    /// The estimator: `thermal.Z1`.
    pub node: String,
    /// What it predicts.
    pub truth: String,
    /// The unit of the truth.
    pub unit: String,
    /// The sensors that it answers.
    pub sensors: Vec<Response>,
}

/// How an estimator answers one sensor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Response {
    /// The measured channel: `temperature.chuck`.
    pub sensor: String,
    /// The unit of a change of it.
    pub sensor_unit: String,
    /// Time in s from the change to the instant that is predicted.
    pub time_s: Vec<f64>,
    /// What is predicted at each time after a step of one unit, in the unit of the truth.
    pub step: Vec<f64>,
    /// What is predicted at each time after an impulse of one unit times one minute, in the unit of the truth.
    pub impulse: Vec<f64>,
    /// The sum of the step response over time, in the unit of the truth times minutes: of a drift per minute, how far a step of
    /// one unit moves the axis in the end. None where the step response does not come back to nothing.
    pub total: Option<f64>,
    /// Where the step response comes to rest, in the unit of the truth: the static gain. None where it comes back to nothing, and
    /// where it does not come to rest.
    pub gain: Option<f64>,
    /// The time in s at which the step response is first as large in size as it gets, within the times shown.
    pub peak_s: f64,
    /// The step response there.
    pub peak: f64,
    /// The time in s from which on the sum stays within a tenth of its total, or the step response within a tenth of its gain; none
    /// where there is neither.
    pub settled_s: Option<f64>,
    /// By how much the answers to a step up and a step down differ, as a share of their size: 0 for a linear estimator.
    pub asymmetry: f64,
}

impl Response {
    /// Leaves out what comes later, where nothing does.
    fn end_after(&mut self, count: usize) {
        for series in [&mut self.time_s, &mut self.step, &mut self.impulse] {
            series.truncate(count);
        }
        if let Some(largest) = largest(&self.step) {
            (self.peak_s, self.peak) = (self.time_s[largest], self.step[largest]);
        }
    }
}

/// Where a step response is first as large as it gets, but for rounding.
fn largest(step: &[f64]) -> Option<usize> {
    const ROUNDING: f64 = 1e-9;
    let most = step.iter().map(|value| value.abs()).fold(0.0, f64::max);
    step.iter()
        .position(|value| value.abs() >= (1.0 - ROUNDING) * most)
}

/// The responses of every estimator that answers any sensor.
///
/// # Errors
/// When the fit does not belong to the graph.
pub fn responses(model: &Model, observation: &Observation) -> Result<Vec<Responses>, FitError> {
    Ok(answers(model, observation)?.0)
}

/// The responses, and those that are not known although the estimator uses something.
pub(super) fn answers(
    model: &Model,
    observation: &Observation,
) -> Result<(Vec<Responses>, Vec<SilentNode>), FitError> {
    let plan = &*model.plan;
    let estimators: Vec<usize> = (0..plan.nodes.len())
        .filter(|&node| matches!(plan.nodes[node].role, PlannedRole::Estimator { .. }))
        .collect();
    let slots: Vec<usize> = estimators
        .iter()
        .map(|&node| plan.nodes[node].slots.start)
        .collect();
    let of_truth = of_truths(plan);
    let Some(mut probe) = Probe::new(model, observation, &slots)? else {
        return Ok(Default::default());
    };
    let uses = |node: usize| {
        let fitted = model.fitted.get(&plan.nodes[node].instance());
        fitted.is_some_and(|of| !of.uses().is_empty())
    };
    let mut silent_nodes = Vec::new();
    for (&node, &slot) in estimators.iter().zip(&slots) {
        if uses(node) && probe.resting.value(slot).is_nan() {
            silent_nodes.push(SilentNode {
                sensor: None,
                estimator: Some(plan.nodes[node].instance()),
                silent: silent(plan, &probe.resting, slot),
            });
        }
    }
    let mut sensors: Vec<Vec<Response>> = vec![Vec::new(); slots.len()];
    for source in (0..plan.sources.len())
        .filter(|&source| !of_truth[source] && !plan.sources[source].is_instant)
    {
        let size = match observation.sources[source].deviation() {
            spread if spread > 0.0 => spread,
            _ => continue,
        };
        let (answers, size, lost) = probe.run_somehow(source, size)?;
        for (nth, silent) in lost {
            if uses(estimators[nth]) {
                silent_nodes.push(SilentNode {
                    sensor: Some(plan.sources[source].name.clone()),
                    estimator: Some(plan.nodes[estimators[nth]].instance()),
                    silent,
                });
            }
        }
        for (nth, [up, down]) in answers.iter().enumerate() {
            let ahead = plan.channels[slots[nth]].channel.ahead;
            let answer = Answer {
                up: &up.values,
                down: &down.values,
                size,
            };
            if let Some(response) = answer.response(plan, source, ahead, probe.clock.step) {
                sensors[nth].push(response);
            }
        }
    }
    let facts = estimators.iter().zip(sensors).map(|(&node, mut sensors)| {
        let node = &plan.nodes[node];
        let truth = plan.channels[node.slots.start].predicts;
        let truth = truth.map(|slot| &plan.channels[slot]);
        let largest = sensors.iter().map(|of| of.peak.abs()).fold(0.0, f64::max);
        sensors.retain(|of| of.peak.abs() > NOTHING * largest);
        let last = |of: &Response| {
            let end = of.gain.unwrap_or(0.0);
            let far = |y: &f64| (y - end).abs() > SHOWN * of.peak.abs();
            of.step.iter().rposition(far)
        };
        let last = sensors.iter().filter_map(last).max().unwrap_or(0);
        sensors
            .iter_mut()
            .for_each(|of| of.end_after(last + 2 + last / 10));
        Responses {
            node: node.instance(),
            truth: truth.map_or_else(String::new, |of| of.name.clone()),
            unit: truth.map_or_else(String::new, |of| of.channel.unit.difference().to_string()),
            sensors,
        }
    });
    let facts = facts.filter(|of| !of.sensors.is_empty());
    Ok((facts.collect(), silent_nodes))
}

/// Which of the slots that are followed fell silent, each with the first node that gave nothing.
type Lost = Vec<(usize, String)>;

/// A graph at rest that is about to be disturbed.
struct Probe<'a> {
    model: &'a Model,
    /// The slots whose values are followed.
    slots: &'a [usize],
    /// The mean of every measured channel.
    rest: Vec<f64>,
    clock: Clock,
    /// What goes on at rest.
    resting: Engine,
    /// Of each tick after those at rest, what the slots are where nothing steps, as far as somebody has asked.
    undisturbed: Vec<Vec<f64>>,
}

impl<'a> Probe<'a> {
    /// None where nothing was measured often enough to have a rate.
    fn new(
        model: &'a Model,
        observation: &Observation,
        slots: &'a [usize],
    ) -> Result<Option<Self>, EngineError> {
        let sources = &observation.sources;
        let intervals = sources.iter().filter_map(|source| source.interval());
        let Some(interval) = intervals.min() else {
            return Ok(None);
        };
        let reach = reach::of_estimators(&model.plan);
        let widest = Duration::from_ns(reach.as_ns() / MOST_INSTANTS);
        let step = interval.max(widest).max(Duration::from_ns(1));
        let most = MOST_INSTANTS.min(i64::MAX / step.as_ns());
        let ticks = (reach.as_ns() / step.as_ns() + 2).min(most);
        let rest = sources
            .iter()
            .map(|of| if of.samples > 0 { of.mean } else { f64::NAN });
        let rest: Vec<f64> = rest.collect();
        // The stillest rest at which as many have a value as at any.
        let mut best: Option<(usize, Clock, Engine)> = None;
        for kind in Rest::ALL {
            let aside = sources.iter().map(|of| kind.to_either_side(of)).collect();
            let clock = Clock {
                step,
                ticks,
                most,
                aside: Arc::new(aside),
            };
            let resting = clock.engine_at_rest(model, &rest)?;
            let valid = slots.iter().filter(|&&slot| !resting.value(slot).is_nan());
            let valid = valid.count();
            if best.as_ref().is_none_or(|(most, ..)| valid > *most) {
                best = Some((valid, clock, resting));
            }
            if valid == slots.len() {
                break;
            }
        }
        let Some((_, clock, resting)) = best else {
            return Ok(None);
        };
        Ok(Some(Self {
            resting,
            undisturbed: Vec::new(),
            model,
            slots,
            rest,
            clock,
        }))
    }

    /// What the slots are at a tick where nothing steps.
    fn undisturbed(&mut self, tick: usize) -> Result<&[f64], EngineError> {
        for next in self.undisturbed.len()..=tick {
            self.clock
                .advance(&mut self.resting, next as i64, &self.rest)?;
            let values = self.slots.iter().map(|&slot| self.resting.value(slot));
            self.undisturbed.push(values.collect());
        }
        Ok(&self.undisturbed[tick])
    }

    /// The answers to a step of `size`, or of a smaller one where that is let through; with its size, and of each slot that fell
    /// silent the first node that gave nothing.
    fn run_somehow(
        &mut self,
        source: usize,
        size: f64,
    ) -> Result<(Vec<[Course; 2]>, f64, Lost), EngineError> {
        let mut best: Option<(Vec<[Course; 2]>, f64, Lost)> = None;
        for share in SMALLER {
            let (found, lost) = self.run(source, share * size)?;
            let fewer = best
                .as_ref()
                .is_none_or(|(.., fewest)| lost.len() < fewest.len());
            let none = lost.is_empty();
            if fewer {
                best = Some((found, share * size, lost));
            }
            if none {
                break;
            }
        }
        Ok(best.unwrap_or_default())
    }

    /// How the slots change from the instant on at which a source steps up and down by `size`, tick by tick, against a run in which
    /// it rests; NaN where there is no value. And of each slot that thereby lost its value the first node that gave nothing.
    fn run(&mut self, source: usize, size: f64) -> Result<(Vec<[Course; 2]>, Lost), EngineError> {
        let mut lost: Lost = Lost::new();
        let mut runs = Vec::new();
        for change in [size, -size] {
            let mut samples = self.rest.clone();
            samples[source] += change;
            runs.push((self.clock.engine_at_rest(self.model, &self.rest)?, samples));
        }
        let mut found = vec![<[Course; 2]>::default(); self.slots.len()];
        let (clock, slots, model) = (self.clock.clone(), self.slots, self.model);
        for tick in 0..clock.most {
            let undisturbed = self.undisturbed(tick as usize)?;
            for (side, (engine, samples)) in runs.iter_mut().enumerate() {
                clock.advance(engine, tick, samples)?;
                let slots = slots.iter().zip(undisturbed);
                for (nth, ((&slot, rest), courses)) in slots.zip(&mut found).enumerate() {
                    courses[side].push(engine.value(slot) - rest);
                    let is_lost = engine.value(slot).is_nan() && !rest.is_nan();
                    if is_lost && lost.iter().all(|of| of.0 != nth) {
                        lost.push((nth, silent(&model.plan, engine, slot)));
                    }
                }
            }
            if tick >= clock.ticks && found.iter().flatten().all(Course::is_at_rest) {
                break;
            }
        }
        Ok((found, lost))
    }
}

/// When the ticks are; that of the step is 0, at the instant 0, so that a reach as long as all time fits on either side of it.
#[derive(Clone)]
struct Clock {
    step: Duration,
    /// So many at rest, and at least as many after the step.
    ticks: i64,
    /// So many after the step at most.
    most: i64,
    /// By how much each channel goes to either side of what it is, tick by tick.
    aside: Arc<Vec<f64>>,
}

impl Clock {
    /// An engine that has seen all sensors at rest until the tick before the step.
    fn engine_at_rest(&self, model: &Model, rest: &[f64]) -> Result<Engine, EngineError> {
        let mut engine = Engine::new(Arc::clone(&model.plan), &model.fitted)?;
        // Nothing has been measured that could be learned from.
        engine.freeze(true);
        engine.predict_in(Mode::FreeRun);
        for tick in -self.ticks..0 {
            self.advance(&mut engine, tick, rest)?;
        }
        Ok(engine)
    }

    fn advance(&self, engine: &mut Engine, tick: i64, samples: &[f64]) -> Result<(), EngineError> {
        let at = Instant::from_ns(tick * self.step.as_ns());
        let side = if tick.rem_euclid(2) == 0 { 1.0 } else { -1.0 };
        let samples = samples.iter().zip(&*self.aside);
        let samples: Vec<f64> = samples.map(|(value, aside)| value + side * aside).collect();
        engine.step(at, &samples).map(|_| ())
    }
}

/// What a slot did after a step, tick by tick.
#[derive(Clone, Default)]
struct Course {
    values: Vec<f64>,
    /// The largest of their sizes.
    largest: f64,
}

impl Course {
    fn push(&mut self, value: f64) {
        self.values.push(value);
        self.largest = self.largest.max(value.abs());
    }

    /// Whether it has not changed of late; one that is no number never will.
    fn is_at_rest(&self) -> bool {
        let Some(before) = self.values.len().checked_sub(QUIET + 1) else {
            return false;
        };
        let (was, is) = (self.values[before], self.values[self.values.len() - 1]);
        is.is_nan() || (is - was).abs() <= AT_REST * self.largest
    }
}

/// What a slot did after a step up and a step down.
struct Answer<'a> {
    up: &'a [f64],
    down: &'a [f64],
    size: f64,
}

impl Answer<'_> {
    /// None where there was no answer.
    fn response(
        &self,
        plan: &Plan,
        source: usize,
        ahead: Duration,
        every: Duration,
    ) -> Option<Response> {
        let pairs = self.up.iter().zip(self.down);
        let step: Vec<f64> = pairs
            .clone()
            .map(|(up, down)| (up - down) / (2.0 * self.size))
            .collect();
        let asymmetric = pairs.map(|(up, down)| (up + down).abs() / (2.0 * self.size));
        let asymmetric = asymmetric.fold(0.0, f64::max);
        let largest = largest(&step)?;
        let peak = step[largest];
        if !step.iter().all(|value| value.is_finite()) || peak == 0.0 {
            return None;
        }
        let minutes = every.secs() / 60.0;
        let time_s: Vec<f64> = (0..step.len())
            .map(|tick| tick as f64 * every.secs() + ahead.secs())
            .collect();
        let before = std::iter::once(0.0).chain(step.iter().copied());
        let impulse = step
            .iter()
            .zip(before)
            .map(|(now, before)| (now - before) / minutes);
        let sums: Vec<f64> = step
            .iter()
            .scan(0.0, |sum, value| {
                *sum += value * minutes;
                Some(*sum)
            })
            .collect();
        let total = *sums.last()?;
        let end = *step.last()?;
        let near = |value: f64, of: f64| (value - of).abs() <= (1.0 - SETTLED) * of.abs();
        // One that ran to the last instant that there is may be on its way still.
        let quarter = step[step.len() - step.len().div_ceil(4)];
        let moves = (end - quarter).abs();
        // A slope answers a step so much more than a level does that what the level leaves for good is small beside it.
        let small = end.abs() <= LASTS * peak.abs();
        let rests = end.abs() > AT_REST * peak.abs() && moves <= LASTS * end.abs();
        let comes_back = small && !rests;
        let lasts = if small {
            rests
        } else {
            moves <= LASTS * peak.abs()
        };
        let outside = if comes_back {
            sums.iter().rposition(|&sum| !near(sum, total))
        } else {
            step.iter().rposition(|&value| !near(value, end))
        };
        let settled = outside.map_or(0, |last| last + 1);
        Some(Response {
            sensor: plan.sources[source].name.clone(),
            sensor_unit: plan.channels[source].channel.unit.difference().to_string(),
            impulse: impulse.collect(),
            total: comes_back.then_some(total),
            gain: lasts.then_some(end),
            peak_s: time_s[largest],
            peak,
            settled_s: time_s.get(settled).copied().filter(|_| comes_back || lasts),
            asymmetry: asymmetric / peak.abs(),
            time_s,
            step,
        })
    }
}
