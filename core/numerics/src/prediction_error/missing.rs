//! Decides how far a model's one-step predictions are off in a segment of which values are missing, how unsure they are, and how
//! both change with each coefficient; not which coefficients are best.
//!
//! Where the value of a sample is missing, the filters of inputs go on, and the noise is found from the values that follow:
//! what a prediction is off by, and its variance, are those of the Kalman filter of the model (Jones 1980). Before the first that is
//! counted, as many values are known as the model needs, so that nothing is in doubt there.

use std::collections::BTreeMap;
use std::ops::Range;

use faer::Mat;

use super::brought::Brought;
use super::doubt::Doubt;
use super::past::{product, push};
use super::segment::{Counted, Segment};
use super::starts::{OVER, Start, left_of_start};
use super::{Polynomials, Samples};

/// How far a coefficient of the noise is moved to see what changes with it, about where rounding and curvature count the same.
const BESIDE: f64 = 1e-7;

/// A model in a segment of which values are missing.
pub(super) struct Gapped<'a> {
    segment: Segment<'a>,
    gains: Gains,
    /// The first sample that is counted.
    begin: usize,
}

/// The Kalman filter of a model through a segment, whatever the values in it are.
struct Gains {
    /// `H`: what the past of values, noise and innovations leads to in the next value, the newest first in each.
    next: Vec<f64>,
    a: Vec<f64>,
    whitening: usize,
    /// The first sample that is predicted; all that is needed of those before is known.
    from: usize,
    steps: Vec<Step>,
    /// By how much what is off by one is to put right the past, in each step in which that is in doubt.
    shares: Vec<f64>,
}

/// What becomes of a sample.
#[derive(Clone, Copy)]
enum Step {
    Missing,
    /// The past is known.
    Sure,
    /// The prediction has such a variance, in that of an innovation.
    Unsure(f64),
}

/// What one sample that is counted was off by.
#[derive(Clone, Copy)]
pub(super) struct Error {
    /// In the standard deviation of the prediction, where that of an innovation is 1.
    pub(super) scaled: f64,
    /// The logarithm of its variance.
    pub(super) log_variance: f64,
}

impl Gains {
    fn new(model: &Polynomials, values: &[f64]) -> Self {
        let whitening = model.whitening();
        let (na, nw) = (model.a.len(), whitening.len());
        let needed = na + nw;
        let mut known = 0;
        let mut from = values.len();
        for (sample, value) in values.iter().enumerate() {
            if known >= needed && sample >= model.reach() + nw {
                from = sample;
                break;
            }
            known = if value.is_nan() { 0 } else { known + 1 };
        }
        let past = model.a.iter().chain(&whitening).map(|p| -p);
        let next: Vec<f64> = past.chain(model.c.iter().copied()).collect();
        let mut doubt = Doubt::of_noise(model, &whitening);
        let mut shares = Vec::new();
        let mut step = |value: &f64| {
            if value.is_nan() {
                doubt.miss();
                return Step::Missing;
            }
            if doubt.is_sure() {
                return Step::Sure;
            }
            let variance = doubt.observe();
            shares.extend(doubt.shared().iter().map(|shared| shared / variance));
            Step::Unsure(variance)
        };
        Self {
            steps: values[from..].iter().map(&mut step).collect(),
            a: model.a.clone(),
            whitening: nw,
            next,
            from,
            shares,
        }
    }

    /// Goes through values and what is explained of them, from the first that is predicted; hands over the sample, what it is off
    /// by and the variance of that, while more is asked for.
    fn follow(
        &self,
        value: impl Fn(usize) -> f64,
        explained: impl Fn(usize) -> f64,
        mut take: impl FnMut(usize, f64, f64) -> bool,
    ) {
        let (na, ends) = (self.a.len(), self.a.len() + self.whitening);
        let mut past = vec![0.0; self.next.len()];
        if self.steps.is_empty() {
            return;
        }
        for lag in 1..=na {
            past[lag - 1] = value(self.from - lag);
        }
        for lag in 1..=self.whitening {
            let sample = self.from - lag;
            let a = (1..).zip(&self.a);
            let of_past: f64 = a.map(|(j, a)| a * value(sample - j)).sum();
            past[na + lag - 1] = value(sample) + of_past - explained(sample);
        }
        let mut shares = self.shares.chunks_exact(past.len().max(1));
        for (sample, step) in (self.from..).zip(&self.steps) {
            let noise = product(&self.next[na..], &past[na..]);
            let expected = explained(sample) + noise + product(&self.next[..na], &past);
            let mut newest = (expected, noise, 0.0);
            let mut asked = true;
            if let Step::Sure | Step::Unsure(_) = step {
                let off = value(sample) - expected;
                newest = (expected + off, noise + off, off);
                let mut variance = 1.0;
                if let Step::Unsure(unsure) = step {
                    variance = *unsure;
                    let shares = shares.next().unwrap_or_default();
                    let both = past.iter_mut().zip(shares);
                    both.for_each(|(past, share)| *past += share * off);
                    // What is put right of past values is the noise's.
                    newest.1 += off * product(&self.a, shares);
                    newest.2 = off / variance;
                }
                asked = take(sample, off, variance);
            }
            push(&mut past[..na], newest.0);
            push(&mut past[na..ends], newest.1);
            push(&mut past[ends..], newest.2);
            if !asked {
                return;
            }
        }
    }
}

impl<'a> Gapped<'a> {
    pub(super) fn new(
        model: &'a Polynomials,
        samples: &Samples,
        segment: Range<usize>,
        counted: &'a Counted,
    ) -> Self {
        let needed = model.a.len() + model.whitening().len();
        let measured = counted.measured.max(needed);
        let begin = samples.begin(&segment, counted.begin(model), measured);
        let segment = Segment::new(model, samples, segment, counted);
        Self {
            gains: Gains::new(model, &segment.values),
            segment,
            begin,
        }
    }

    /// What the samples that are counted are off by, from such a start of the filters of inputs.
    pub(super) fn errors(&self, start: &[f64]) -> Vec<Error> {
        let explained = explained(
            &self.segment.brought(start, false),
            self.segment.values.len(),
        );
        self.errors_of(&self.gains, &explained)
    }

    fn errors_of(&self, gains: &Gains, explained: &[f64]) -> Vec<Error> {
        let value = |sample: usize| self.segment.values[sample];
        self.followed(gains, value, |sample| explained[sample])
    }

    fn followed(
        &self,
        gains: &Gains,
        value: impl Fn(usize) -> f64,
        explained: impl Fn(usize) -> f64,
    ) -> Vec<Error> {
        let mut errors = Vec::new();
        gains.follow(value, explained, |sample, off, variance| {
            if sample >= self.begin {
                errors.push(Error {
                    scaled: off / variance.sqrt(),
                    log_variance: variance.ln(),
                });
            }
            true
        });
        errors
    }

    /// How what the samples are off by changes with each value of a start, until nothing is left of it.
    pub(super) fn free_responses(&self) -> Vec<Vec<f64>> {
        let transfers = self.segment.model.inputs.iter();
        let responses = transfers.flat_map(|transfer| {
            let f = &transfer.f;
            (0..f.len()).map(|nth| self.free_response(f, nth))
        });
        responses.collect()
    }

    fn free_response(&self, f: &[f64], nth: usize) -> Vec<f64> {
        let memory = f.len().max(self.gains.next.len());
        let left = left_of_start(f, nth, self.segment.values.len());
        let explained = |sample: usize| left.get(sample).copied().unwrap_or(0.0);
        let (mut response, mut quiet) = (Vec::new(), 0);
        self.gains.follow(
            |_| 0.0,
            explained,
            |sample, off, variance| {
                if sample >= self.begin {
                    response.push(off / variance.sqrt());
                }
                let over = sample >= left.len() && off.abs() < OVER;
                quiet = if over { quiet + 1 } else { 0 };
                quiet <= memory
            },
        );
        response
    }

    /// How what the samples are off by, and how unsure that is, change with each coefficient in the order of
    /// [`Polynomials::flat`], the start being held: that they go on in proportion to what is explained is all it takes for the
    /// inputs and the level; beside a coefficient of the noise the filter is another.
    fn slopes(&self, start: &[f64]) -> Slopes {
        let Segment { model, values, .. } = &self.segment;
        let brought = self.segment.brought(start, true);
        let explained = explained(&brought, values.len());
        let errors = self.errors_of(&self.gains, &explained);
        let count = model.flat().len();
        let mut slopes = Slopes {
            scaled: Mat::zeros(errors.len(), count),
            log_variance: Mat::zeros(errors.len(), count),
            errors,
        };
        let level = usize::from(model.differences == 0);
        let of_inputs = level + model.a.len();
        let inputs = by_inputs(&brought, values.len());
        let of_noise = (level..of_inputs).chain(of_inputs + inputs.len()..count);
        let mut put = |column: usize, by: Vec<Error>| {
            let column = slopes.scaled.col_as_slice_mut(column).iter_mut();
            column.zip(by).for_each(|(slope, by)| *slope = by.scaled);
        };
        if level > 0 {
            put(0, self.followed(&self.gains, |_| -1.0, |_| 0.0));
        }
        for (column, by) in (of_inputs..).zip(inputs) {
            let explained = |sample: usize| -by[sample];
            put(column, self.followed(&self.gains, |_| 0.0, explained));
        }
        let flat = model.flat();
        for column in of_noise {
            let step = BESIDE * flat[column].abs().max(1.0);
            let mut moved = flat.clone();
            moved[column] += step;
            let gains = Gains::new(&model.with(&moved), values);
            let beside = self.errors_of(&gains, &explained);
            for (row, (at, beside)) in slopes.errors.iter().zip(beside).enumerate() {
                let slope = |at: f64, beside: f64| (beside - at) / step;
                slopes.scaled[(row, column)] = slope(at.scaled, beside.scaled);
                slopes.log_variance[(row, column)] = slope(at.log_variance, beside.log_variance);
            }
        }
        slopes
    }
}

/// What all inputs bring about in a segment.
fn explained(brought: &[Brought], count: usize) -> Vec<f64> {
    let mut explained = vec![0.0; count];
    for of in brought {
        let both = explained.iter_mut().zip(&of.whole);
        both.for_each(|(sum, brought)| *sum += brought);
    }
    explained
}

/// How the noise in each sample changes with each coefficient of an input.
fn by_inputs(brought: &[Brought], count: usize) -> Vec<Vec<f64>> {
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for sample in 0..count {
        let mut column = 0;
        let mut put = |by: f64| {
            if sample == 0 {
                columns.push(Vec::with_capacity(count));
            }
            columns[column].push(by);
            column += 1;
        };
        brought.iter().for_each(|of| of.derive(sample, &mut put));
    }
    columns
}

/// What samples of a segment are off by and how unsure that is, and how both change with each coefficient: a row for each sample
/// that is counted.
struct Slopes {
    errors: Vec<Error>,
    scaled: Mat<f64>,
    log_variance: Mat<f64>,
}

/// How what is made least changes with each coefficient where values are missing: the squares of errors in their standard
/// deviations, times the geometric mean of their variances (the likelihood, of which the variance of an innovation is the best one;
/// Harvey 1989, section 3.4).
pub(super) struct Weighted {
    /// Of the segments with a value that is missing, by their number.
    gapped: BTreeMap<usize, Slopes>,
    /// The root of the geometric mean.
    scale: f64,
    /// How its logarithm changes.
    log_scale: Vec<f64>,
    /// By how much squares of how variances change are more than their mean's.
    spread: Mat<f64>,
}

impl Weighted {
    /// Of a model with such starts and geometric mean; none where nothing is missing.
    pub(super) fn new(
        model: &Polynomials,
        samples: &Samples,
        counted: &Counted,
        starts: &[Start],
        mean: f64,
    ) -> Option<Self> {
        if samples.missing() == 0 {
            return None;
        }
        let mut gapped = BTreeMap::new();
        let mut rows = 0;
        for (nth, (segment, start)) in samples.segments().zip(starts).enumerate() {
            if samples.is_complete(&segment) {
                rows += segment.len().saturating_sub(counted.begin(model));
            } else {
                let slopes = Gapped::new(model, samples, segment, counted).slopes(&start.values);
                rows += slopes.errors.len();
                gapped.insert(nth, slopes);
            }
        }
        let (count, rows) = (model.flat().len(), rows.max(1) as f64);
        let mut log_scale = vec![0.0; count];
        let mut spread = Mat::<f64>::zeros(count, count);
        for slopes in gapped.values() {
            for (column, sum) in log_scale.iter_mut().enumerate() {
                let slopes = slopes.log_variance.col_as_slice(column).iter();
                *sum += slopes.sum::<f64>() / (2.0 * rows);
            }
            spread += slopes.log_variance.transpose() * &slopes.log_variance;
        }
        for i in 0..count {
            for j in 0..count {
                spread[(i, j)] -= 4.0 * rows * log_scale[i] * log_scale[j];
            }
        }
        Some(Self {
            gapped,
            scale: mean.sqrt(),
            log_scale,
            spread: spread * 0.25,
        })
    }

    /// The residuals of a segment that are counted, and how each changes with each coefficient.
    pub(super) fn derivatives(
        &self,
        nth: usize,
        segment: &Segment<'_>,
        start: &[f64],
        mut take: impl FnMut(f64, &[f64]),
    ) {
        let mut row = vec![0.0; self.log_scale.len()];
        let mut weigh = |residual: f64, by: &dyn Fn(usize) -> f64| {
            let residual = self.scale * residual;
            for (column, (to, log_scale)) in row.iter_mut().zip(&self.log_scale).enumerate() {
                *to = self.scale * by(column) + residual * log_scale;
            }
            take(residual, &row);
        };
        match self.gapped.get(&nth) {
            Some(slopes) => {
                for (nth, error) in slopes.errors.iter().enumerate() {
                    weigh(error.scaled, &|column| slopes.scaled[(nth, column)]);
                }
            }
            None => segment.derivatives(start, |residual, by| {
                weigh(residual, &|column| by[column]);
            }),
        }
    }

    /// Adds what `JᵀJ` lacks of what is expected of the curvature, since variances change too: as much again as it has of that.
    /// `rest` is what is made least beside the squares of residuals, and `square` the mean of these.
    pub(super) fn add(&self, hessian: &mut Mat<f64>, gradient: &mut [f64], square: f64, rest: f64) {
        *hessian += &self.spread * square;
        let both = gradient.iter_mut().zip(&self.log_scale);
        both.for_each(|(slope, log_scale)| *slope += rest * log_scale);
    }
}

#[cfg(test)]
mod tests;
