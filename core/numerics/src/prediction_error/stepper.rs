//! Decides what a model predicts from sample to sample, and what it makes of samples that are missing.

use serde::{Deserialize, Serialize};

use super::doubt::Doubt;
use super::past::{product, push};
use super::{Polynomials, Transfer};
use crate::NumericsError;
use crate::checks::check_length;

/// A model, followed sample by sample. Nothing is allocated once it is built.
///
/// A sample that is missing is at first taken for what was predicted of it, so that predictions several samples ahead are steps
/// without one (Ljung 1999, section 3.2). How unsure that is, is kept, so that the samples that follow also tell what it was: the
/// Kalman filter of the model. So do those after a start of what the filters of inputs gave before it, which nothing moves but the
/// inputs: the better they are known, the less samples count, until the inputs alone determine them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Saved")]
pub struct Stepper {
    model: Polynomials,
    whitening: Vec<f64>,
    /// The newest first.
    past: Vec<f64>,
    noise: Vec<f64>,
    innovations: Vec<f64>,
    doubt: Doubt,
    inputs: Vec<PastInput>,
}

/// A stepper as it is read, before it is known whether its parts fit together.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Saved {
    model: Polynomials,
    whitening: Vec<f64>,
    past: Vec<f64>,
    noise: Vec<f64>,
    innovations: Vec<f64>,
    /// Row after row; nothing where nothing is in doubt.
    doubt: Vec<f64>,
    inputs: Vec<PastInput>,
}

impl TryFrom<Saved> for Stepper {
    type Error = NumericsError;

    fn try_from(saved: Saved) -> Result<Self, NumericsError> {
        let Saved {
            model,
            whitening,
            past,
            noise,
            innovations,
            doubt: written,
            inputs,
        } = saved;
        let of_noise = model.d.len().saturating_add(model.differences);
        check_length("past", model.a.len(), past.len())?;
        check_length("whitening", of_noise, whitening.len())?;
        check_length("noise", of_noise, noise.len())?;
        check_length("innovations", model.c.len(), innovations.len())?;
        let mut doubt = Doubt::none(&model, &whitening);
        if !written.is_empty() {
            check_length("doubt", doubt.places(), written.len())?;
        }
        doubt.read(&written);
        check_length("inputs", model.inputs.len(), inputs.len())?;
        for (past, of) in inputs.iter().zip(&model.inputs) {
            let reach = of.delay.saturating_add(of.b.len());
            check_length("inputs.values", reach, past.values.len())?;
            check_length("inputs.filtered", of.f.len(), past.filtered.len())?;
        }
        Ok(Self {
            model,
            whitening,
            past,
            noise,
            innovations,
            doubt,
            inputs,
        })
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PastInput {
    /// Of the input itself.
    values: Vec<f64>,
    /// Of what it brings about.
    filtered: Vec<f64>,
}

impl Stepper {
    /// A model at rest with all inputs 0.
    #[must_use]
    pub fn new(model: Polynomials) -> Self {
        let whitening = model.whitening();
        let inputs = model.inputs.iter().map(|of| PastInput {
            values: vec![0.0; of.delay + of.b.len()],
            filtered: vec![0.0; of.f.len()],
        });
        Self {
            past: vec![0.0; model.a.len()],
            noise: vec![0.0; whitening.len()],
            innovations: vec![0.0; model.c.len()],
            doubt: Doubt::none(&model, &whitening),
            inputs: inputs.collect(),
            whitening,
            model,
        }
    }

    /// The model that is followed.
    #[must_use]
    pub fn model(&self) -> &Polynomials {
        &self.model
    }

    /// Forgets what was: the inputs have always been like this, and their filters gave what `before` says, of which `square` is
    /// the variance, in that of an innovation.
    pub fn begin(
        &mut self,
        input: impl Fn(usize) -> f64,
        before: impl Fn(usize) -> f64,
        square: impl Fn(usize) -> f64,
    ) {
        let mut brought = 0.0;
        for (nth, past) in self.inputs.iter_mut().enumerate() {
            let filtered = before(nth);
            past.values.fill(input(nth));
            past.filtered.fill(filtered);
            brought += filtered;
        }
        let level = brought / (1.0 + self.model.a.iter().sum::<f64>());
        self.past.fill(level);
        self.noise.fill(0.0);
        self.innovations.fill(0.0);
        self.doubt.begin(square);
    }

    /// The same at rest: the filters gave what such inputs lead to.
    #[cfg(test)]
    pub(super) fn rest(&mut self, input: impl Fn(usize) -> f64) {
        let gains: Vec<f64> = self.model.inputs.iter().map(Transfer::gain).collect();
        self.begin(&input, |nth| gains[nth] * input(nth), |_| 0.0);
    }

    /// Takes the first sample after a [`begin`](Self::begin), about which noise that follows it has such a variance, in that of an
    /// innovation; infinite where it may be anywhere.
    ///
    /// What was measured before is not known. Of a model that looks back on it, or on noise, it is taken to have always been like
    /// this one: of what the inputs do not explain of that each of their filters has its share by how unsure it is, and the noise
    /// the rest.
    pub fn first(&mut self, input: impl Fn(usize) -> f64, value: f64, variance_of_noise: f64) {
        if self.past.is_empty() && self.noise.is_empty() {
            self.step(input, Some(value));
        } else {
            self.step(input, None);
            self.settle(value, variance_of_noise);
        }
    }

    pub(super) fn settle(&mut self, value: f64, variance_of_noise: f64) {
        let value = value - self.model.level;
        let brought = |(past, of): (&PastInput, &Transfer)| match past.filtered.first() {
            Some(&filtered) => filtered,
            None => of.gain() * past.values.first().copied().unwrap_or(0.0),
        };
        let inputs = self.inputs.iter().zip(&self.model.inputs);
        let explained: f64 = inputs.map(brought).sum();
        let in_all = value * (1.0 + self.model.a.iter().sum::<f64>());
        let off = in_all - explained;
        self.doubt.settle(variance_of_noise);
        let mut shares = self.doubt.shared()[self.past.len()..].iter();
        let mut noise = off;
        for past in &mut self.inputs {
            let both = past.filtered.iter_mut().zip(&mut shares).enumerate();
            for (lag, (filtered, share)) in both {
                *filtered += share * off;
                noise -= if lag == 0 { share * off } else { 0.0 };
            }
        }
        self.past.fill(value);
        self.noise.fill(noise);
        self.innovations.fill(0.0);
    }

    /// Goes on by one sample, and gives what was predicted of it.
    pub fn step(&mut self, input: impl Fn(usize) -> f64, value: Option<f64>) -> f64 {
        let (expected, noise) = self.expect(input);
        let level = self.model.level;
        match value {
            Some(value) => self.take_value(value - level, expected, noise),
            None => {
                self.push(expected, noise, 0.0);
                self.doubt.miss();
            }
        }
        level + expected
    }

    /// As [`step`](Self::step) by a sample that is missing, on the way to a prediction: how unsure it is of that is not worked
    /// out, so that no value must follow.
    pub fn foresee(&mut self, input: impl Fn(usize) -> f64) -> f64 {
        let (expected, noise) = self.expect(input);
        self.push(expected, noise, 0.0);
        self.model.level + expected
    }

    /// What is expected of the next value, without the level, and of the noise in it. Takes the inputs.
    fn expect(&mut self, input: impl Fn(usize) -> f64) -> (f64, f64) {
        let mut brought = 0.0;
        for (nth, (past, of)) in self.inputs.iter_mut().zip(&self.model.inputs).enumerate() {
            push(&mut past.values, input(nth));
            let from = past.values.get(of.delay..).unwrap_or_default();
            let filtered = product(&of.b, from) - product(&of.f, &past.filtered);
            push(&mut past.filtered, filtered);
            brought += filtered;
        }
        let noise =
            product(&self.model.c, &self.innovations) - product(&self.whitening, &self.noise);
        (brought + noise - product(&self.model.a, &self.past), noise)
    }

    /// Shares what was off among the innovation and the past, as far as that is in doubt.
    ///
    /// Where the start is all that is in doubt, that is the Kalman filter of `C(q) e` (Ansley 1979). Its gain is that of `C` as
    /// soon as the start is forgotten, and for a root on the unit circle, where it never is, that of a mean.
    fn take_value(&mut self, value: f64, expected: f64, noise: f64) {
        let off = value - expected;
        if self.doubt.is_sure() {
            return self.push(expected + off, noise + off, off);
        }
        let innovation = off / self.doubt.observe();
        // What is put right of past values and of filters is the noise's.
        let mut of_noise = noise + off;
        let mut shared = self.doubt.shared().iter();
        for (a, past) in self.model.a.iter().zip(&mut self.past) {
            let right = shared.next().map_or(0.0, |shared| shared * innovation);
            *past += right;
            of_noise += a * right;
        }
        for (of, past) in self.model.inputs.iter().zip(&mut self.inputs) {
            // The newest that it gave is among them already, and the oldest no more.
            let mut newest = 0.0;
            for (nth, f) in of.f.iter().enumerate() {
                let right = shared.next().map_or(0.0, |shared| shared * innovation);
                newest -= f * right;
                if let Some(earlier) = past.filtered.get_mut(nth + 1) {
                    *earlier += right;
                }
            }
            if let Some(filtered) = past.filtered.first_mut() {
                *filtered += newest;
            }
            of_noise -= newest;
        }
        let others = self.noise.iter_mut().chain(&mut self.innovations);
        for (of, shared) in others.zip(shared) {
            *of += shared * innovation;
        }
        self.push(expected + off, of_noise, innovation);
    }

    /// Puts the newest before those of the past.
    fn push(&mut self, value: f64, noise: f64, innovation: f64) {
        push(&mut self.past, value);
        push(&mut self.noise, noise);
        push(&mut self.innovations, innovation);
    }

    /// How many numbers of the past it goes by, beside the inputs.
    #[must_use]
    pub fn remembers(&self) -> usize {
        let filtered = self.inputs.iter().map(|past| past.filtered.len());
        self.past.len() + filtered.sum::<usize>() + self.noise.len() + self.innovations.len()
    }

    /// By how much the variance of what is predicted so many samples ahead is larger than that of
    /// [`variances`](Polynomials::variances), in that of an innovation: more than 0 after a start or samples that were missing,
    /// until what filters gave and noise was before is known or counts no more. It is worked out in `room` for as many numbers as it [`remembers`](Self::remembers).
    #[must_use]
    pub fn doubt(&self, steps: usize, room: &mut [f64]) -> f64 {
        self.doubt.ahead(steps, room)
    }

    /// Takes over where another stepper is, unless it has other orders.
    pub fn resume(&mut self, other: &Self) -> bool {
        let shape = |of: &Self| {
            let inputs = of.inputs.iter();
            let inputs: Vec<_> = inputs.map(|p| (p.values.len(), p.filtered.len())).collect();
            (of.past.len(), of.noise.len(), of.innovations.len(), inputs)
        };
        let alike = shape(self) == shape(other);
        if alike {
            self.take(other);
        }
        alike
    }

    /// Takes over where another of the same orders is, without making room.
    fn take(&mut self, other: &Self) {
        self.take_past(other);
        self.doubt.take(&other.doubt);
    }

    /// Takes over where another of the same orders is, but for how unsure it is of that, without making room: to
    /// [`foresee`](Self::foresee) from there.
    pub fn take_past(&mut self, other: &Self) {
        self.past.copy_from_slice(&other.past);
        self.noise.copy_from_slice(&other.noise);
        self.innovations.copy_from_slice(&other.innovations);
        for (to, from) in self.inputs.iter_mut().zip(&other.inputs) {
            to.values.copy_from_slice(&from.values);
            to.filtered.copy_from_slice(&from.filtered);
        }
    }
}

#[cfg(test)]
mod tests;
