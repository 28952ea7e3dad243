//! Decides what a model predicts from sample to sample, and what it makes of samples that are missing.

use serde::{Deserialize, Serialize};

use super::Polynomials;
use crate::NumericsError;
use crate::checks::check_length;
use crate::scratch::Scratch;

/// A model, followed sample by sample. Nothing is allocated once it is built.
///
/// Of a sample that is missing it takes what it had predicted for it, so that predictions several samples ahead are steps
/// without one (Ljung 1999, section 3.2).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Saved")]
pub struct Stepper {
    model: Polynomials,
    whitening: Vec<f64>,
    /// The newest first.
    past: Vec<f64>,
    noise: Vec<f64>,
    innovations: Vec<f64>,
    /// How unsure the innovations were at the newest sample that was there, each with each, in the variance of one.
    doubt: Vec<f64>,
    /// How many samples have been missing since then.
    missed: usize,
    /// `P w` of this doubt `P`, while it is worked out.
    #[serde(skip)]
    shared: Scratch,
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
    doubt: Vec<f64>,
    /// Once it was not written.
    #[serde(default)]
    missed: usize,
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
            doubt,
            missed,
            inputs,
        } = saved;
        let order = model.c.len();
        let of_noise = model.d.len().saturating_add(model.differences);
        check_length("past", model.a.len(), past.len())?;
        check_length("whitening", of_noise, whitening.len())?;
        check_length("noise", of_noise, noise.len())?;
        check_length("innovations", order, innovations.len())?;
        check_length("doubt", order * order, doubt.len())?;
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
            missed,
            shared: Scratch(vec![0.0; order]),
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
            doubt: vec![0.0; model.c.len() * model.c.len()],
            missed: 0,
            shared: Scratch(vec![0.0; model.c.len()]),
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

    /// Forgets what was: the inputs have always been like this.
    pub fn rest(&mut self, input: impl Fn(usize) -> f64) {
        let level = self.model.at_rest(&input) - self.model.level;
        for (nth, (past, transfer)) in self.inputs.iter_mut().zip(&self.model.inputs).enumerate() {
            past.values.fill(input(nth));
            past.filtered.fill(transfer.gain() * input(nth));
        }
        self.past.fill(level);
        self.noise.fill(0.0);
        self.doubt_innovations();
    }

    /// What was not foreseen until now is not known, but for its variance.
    fn doubt_innovations(&mut self) {
        self.innovations.fill(0.0);
        self.missed = 0;
        self.doubt.fill(0.0);
        let count = self.innovations.len();
        self.doubt
            .iter_mut()
            .step_by(count + 1)
            .for_each(|own| *own = 1.0);
    }

    /// Where it is has been measured: what the inputs do not explain of it has always been there, in the noise, or where there
    /// is no model of that, in the filters of the inputs.
    pub fn settle_on(&mut self, value: f64) {
        let value = value - self.model.level;
        let brought: f64 = self
            .inputs
            .iter()
            .zip(&self.model.inputs)
            .map(|(past, of)| match past.filtered.first() {
                Some(&filtered) => filtered,
                None => of.gain() * past.values.first().copied().unwrap_or(0.0),
            })
            .sum();
        let share = self.model.share();
        for (past, of) in self.inputs.iter_mut().zip(&self.model.inputs) {
            let off = if of.f.is_empty() {
                0.0
            } else {
                share * (value - brought)
            };
            past.filtered
                .iter_mut()
                .for_each(|filtered| *filtered += off);
        }
        self.past.fill(value);
        let noise = value * (1.0 + self.model.a.iter().sum::<f64>()) - brought;
        self.noise.fill(noise);
        self.doubt_innovations();
    }

    /// Goes on by one sample, and gives what was predicted of it.
    pub fn step(&mut self, input: impl Fn(usize) -> f64, value: Option<f64>) -> f64 {
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
        let expected = brought + noise - product(&self.model.a, &self.past);
        let innovation = value.map_or(0.0, |value| value - self.model.level - expected);
        push(&mut self.past, expected + innovation);
        push(&mut self.noise, noise + innovation);
        self.take_innovation(value.map(|_| innovation));
        self.model.level + expected
    }

    /// Shares what was off among the newest innovation and those before it, as far as these are in doubt: the Kalman filter of
    /// `C(q) e` (Ansley 1979). Its gain is that of `C` as soon as the start is forgotten, and for a root on the unit circle,
    /// where it never is, that of a mean.
    fn take_innovation(&mut self, off: Option<f64>) {
        let Some(off) = off else {
            // It is taken for as it was foreseen.
            self.missed = self.missed.saturating_add(1);
            return push(&mut self.innovations, 0.0);
        };
        self.pass_missed();
        if self.is_sure() {
            return push(&mut self.innovations, off);
        }
        let count = self.innovations.len();
        let c = &self.model.c;
        let shared = &mut self.shared.0;
        let mut variance = 1.0;
        for (nth, shared) in shared.iter_mut().enumerate() {
            *shared = product(c, &self.doubt[nth * count..]);
            variance += c[nth] * *shared;
        }
        let newest = off / variance;
        for (of, shared) in self.innovations.iter_mut().zip(&*shared) {
            *of += shared * newest;
        }
        for (nth, doubt) in self.doubt.iter_mut().enumerate() {
            *doubt -= shared[nth / count] * shared[nth % count] / variance;
        }
        shared.iter_mut().for_each(|of| *of /= -variance);
        push(&mut self.innovations, newest);
        self.pass(1.0 - 1.0 / variance);
        let mut own = self.doubt.iter().step_by(count + 1);
        if own.all(|&own| own < 4.0 * f64::EPSILON) {
            self.doubt.fill(0.0);
        }
    }

    /// Whether no innovation is in doubt.
    fn is_sure(&self) -> bool {
        let count = self.innovations.len();
        let mut own = self.doubt.iter().step_by(count + 1);
        own.all(|&own| own == 0.0)
    }

    /// How many samples have been missing since the newest that was there.
    #[must_use]
    pub fn missed(&self) -> usize {
        self.missed
    }

    /// By how much the variance of what is predicted so many samples ahead is larger than that of
    /// [`variances`](Polynomials::variances), in that of an innovation: more than 0 after a start, until what was not foreseen
    /// before it counts no more (Ansley 1979). What the innovations `e` are in doubt leads to `w e` in the sample asked for,
    /// with `w_i = Σ_m h_(steps − m) c_(m + i)` and the [`response`](Polynomials::response) `h` of the model, of which the last
    /// counts for all beyond.
    pub fn doubt(&mut self, response: &[f64], steps: usize) -> f64 {
        if self.is_sure() {
            return 0.0;
        }
        let ahead = self.missed.saturating_add(steps).min(response.len());
        let (c, shared) = (&self.model.c, &mut self.shared.0);
        for (nth, of) in shared.iter_mut().enumerate() {
            let back = response[..ahead].iter().rev();
            *of = c[nth..].iter().zip(back).map(|(c, h)| c * h).sum();
        }
        let rows = self.doubt.chunks_exact(c.len().max(1));
        let each = rows.zip(&*shared);
        each.map(|(row, own)| own * product(shared, row)).sum()
    }

    /// Puts the samples that have been missing before the innovations that are in doubt: they are in none.
    fn pass_missed(&mut self) {
        self.shared.0.fill(0.0);
        for _ in 0..self.missed.min(self.innovations.len()) {
            self.pass(0.0);
        }
        self.missed = 0;
    }

    /// Puts the doubt of an innovation, by itself and together with each of them, before that of those of the past.
    fn pass(&mut self, own: f64) {
        let count = self.innovations.len();
        // One row and one column further; what stands in the first of them is written anew.
        if let Some(rest) = self.doubt.len().checked_sub(count + 1) {
            self.doubt.copy_within(..rest, count + 1);
        }
        for nth in 1..count {
            self.doubt[nth] = self.shared.0[nth - 1];
            self.doubt[nth * count] = self.shared.0[nth - 1];
        }
        if let Some(first) = self.doubt.first_mut() {
            *first = own;
        }
    }

    /// Takes over where another stepper is, unless it has other orders.
    pub fn resume(&mut self, other: &Self) -> bool {
        let shape = |of: &Self| {
            let inputs = of.inputs.iter();
            let inputs: Vec<_> = inputs.map(|p| (p.values.len(), p.filtered.len())).collect();
            let innovations = (of.innovations.len(), of.doubt.len());
            (of.past.len(), of.noise.len(), innovations, inputs)
        };
        let alike = shape(self) == shape(other);
        if alike {
            self.take(other);
        }
        alike
    }

    /// Takes over where another of the same orders is, without making room.
    pub fn take(&mut self, other: &Self) {
        self.past.copy_from_slice(&other.past);
        self.noise.copy_from_slice(&other.noise);
        self.innovations.copy_from_slice(&other.innovations);
        self.doubt.copy_from_slice(&other.doubt);
        self.missed = other.missed;
        for (to, from) in self.inputs.iter_mut().zip(&other.inputs) {
            to.values.copy_from_slice(&from.values);
            to.filtered.copy_from_slice(&from.filtered);
        }
    }
}

/// `Σ p_j x_j` over the first of both.
fn product(polynomial: &[f64], past: &[f64]) -> f64 {
    polynomial.iter().zip(past).map(|(p, x)| p * x).sum()
}

/// Puts a value before those of the past, and forgets the oldest.
fn push(past: &mut [f64], value: f64) {
    if let Some(last) = past.len().checked_sub(1) {
        past.copy_within(..last, 1);
        past[0] = value;
    }
}

#[cfg(test)]
mod tests;
