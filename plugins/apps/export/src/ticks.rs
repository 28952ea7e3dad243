//! Ticks on which a graph shows that it computes what the engine does: made-up samples, and what the engine made of them.

use std::sync::Arc;

use athermal_core::engine::{Engine, EngineError};
use athermal_core::prng::Prng;
use athermal_core::time::Instant;

use crate::form::Form;

/// Ticks and what comes out at each.
#[derive(Debug, Clone, Default)]
pub struct Ticks {
    /// The instants, in nanoseconds.
    pub times: Vec<i64>,
    /// The samples of each instant, NaN where there is none.
    pub inputs: Vec<Vec<f64>>,
    /// What the engine gave at each.
    pub outputs: Vec<Vec<f64>>,
}

/// How many ticks a self test has.
pub const TICKS: usize = 200;

/// How many times the shortest time between two ticks lies between two of the test: what lets most outputs have values is taken.
const STRIDES: [i64; 7] = [1, 2, 5, 10, 20, 40, 80];

/// The self test of a graph, as the engine computes it.
///
/// # Errors
/// When what was fitted does not belong to the plan.
pub fn self_test(engine: &Engine, form: &Form, frozen: bool) -> Result<Ticks, EngineError> {
    let mut best = (0, Ticks::default());
    for stride in STRIDES {
        let mut ticks = made_up(form, stride);
        let mut fresh = Engine::new(Arc::clone(engine.plan()), engine.fitted())?;
        fresh.freeze(frozen);
        ticks.run(&mut fresh)?;
        let given = ticks.given();
        if given > best.0 || best.1.times.is_empty() {
            best = (given, ticks);
        }
    }
    Ok(best.1)
}

impl Ticks {
    /// Steps an engine over the samples, and keeps what comes out.
    ///
    /// # Errors
    /// When a tick is refused.
    pub fn run(&mut self, engine: &mut Engine) -> Result<(), EngineError> {
        self.outputs.clear();
        for (&time, samples) in self.times.iter().zip(&self.inputs) {
            let out = engine.step(Instant::from_ns(time), samples)?;
            self.outputs.push(out.to_vec());
        }
        Ok(())
    }

    /// The largest size of an output; 1 where it has none.
    #[must_use]
    pub fn size(&self, output: usize) -> f64 {
        let sizes = self.outputs.iter().map(|row| row[output].abs());
        let largest = sizes.filter(|size| size.is_finite()).fold(0.0, f64::max);
        if largest > 0.0 { largest } else { 1.0 }
    }

    /// How many values came out.
    fn given(&self) -> usize {
        let all = self.outputs.iter().flatten();
        all.filter(|value| !value.is_nan()).count()
    }
}

/// Samples that swing slowly, with noise, gaps and one out of its range; times that jitter.
fn made_up(form: &Form, stride: i64) -> Ticks {
    let mut random = Prng::stream(7, "the self test");
    let step = form.period_ns.saturating_mul(stride);
    let mut ticks = Ticks::default();
    let mut due = vec![0; form.sources.len()];
    let mut time = 0;
    for tick in 0..TICKS {
        time += (step as f64 * random.between(0.9, 1.1)) as i64;
        let row = (form.ranges.iter().enumerate()).map(|(nth, &range)| {
            let silent = random.between(0.0, 1.0) < 0.02;
            if silent || time < due[nth] {
                return f64::NAN;
            }
            due[nth] = time + form.periods_ns[nth] - form.period_ns / 2;
            sample(range, nth, time as f64 / 1e9, random.normal())
        });
        let mut row: Vec<f64> = row.collect();
        if tick == TICKS / 2
            && let Some(first) = row.first_mut()
        {
            *first = f64::INFINITY;
        }
        ticks.times.push(time);
        ticks.inputs.push(row);
    }
    ticks
}

/// A temperature where the range is finite, else a position.
fn sample((low, high): (f64, f64), nth: usize, time_s: f64, noise: f64) -> f64 {
    let phase = time_s / (900.0 + 120.0 * nth as f64);
    if (high - low).is_finite() {
        let middle = 22.0_f64.clamp(low + 0.1 * (high - low), high - 0.1 * (high - low));
        let swing = (0.05 * (high - low)).min(2.0);
        middle + swing * phase.sin() + 0.001 * swing * noise
    } else {
        400.0 * phase.sin() + noise
    }
}
