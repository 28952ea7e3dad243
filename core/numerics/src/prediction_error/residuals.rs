//! Decides how far a model's one-step predictions are off, sample by sample, and how that changes with each coefficient; not
//! which coefficients are best.

use std::ops::Range;

use super::{Orders, Polynomials};
use crate::Record;
use crate::Standardizer;

/// Evenly spaced samples of the inputs and of what they lead to, in segments.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    width: usize,
    values: Vec<f64>,
    /// One input after the other for each sample.
    inputs: Vec<f64>,
    starts: Vec<usize>,
}

impl Samples {
    /// None yet, with so many inputs.
    #[must_use]
    pub fn new(width: usize) -> Self {
        Self {
            width,
            ..Self::default()
        }
    }

    /// The next sample begins a segment.
    pub fn segment(&mut self) {
        if self.starts.last() != Some(&self.values.len()) {
            self.starts.push(self.values.len());
        }
    }

    /// Takes a sample, of as many inputs as there are.
    pub fn push(&mut self, inputs: impl IntoIterator<Item = f64>, value: f64) {
        if self.starts.is_empty() {
            self.starts.push(0);
        }
        self.values.push(value);
        self.inputs.extend(inputs);
        self.inputs.resize(self.values.len() * self.width, 0.0);
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.values.len()
    }

    /// How many inputs.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// The standard deviation of the values; 1 where they are all the same.
    #[must_use]
    pub fn spread(&self) -> f64 {
        let mut values = Standardizer::new(1);
        self.values
            .iter()
            .for_each(|&value| values.partial_fit(&[value]));
        values.standardization().scales[0]
    }

    /// The same with values that are so many times smaller.
    #[must_use]
    pub fn divided(&self, by: f64) -> Self {
        let mut divided = self.clone();
        divided.values.iter_mut().for_each(|value| *value /= by);
        divided
    }

    /// How many are left when the first of each segment are not counted.
    #[must_use]
    pub fn counted(&self, first: usize) -> usize {
        self.segments()
            .map(|segment| segment.len().saturating_sub(first))
            .sum()
    }

    /// How many samples the longest segment has.
    pub(super) fn longest(&self) -> usize {
        let lengths = self.segments().map(|segment| segment.len());
        lengths.max().unwrap_or(0)
    }

    /// The segments, as subspace identification takes them.
    pub fn records(&self) -> impl Iterator<Item = Record<'_>> {
        self.segments().map(|segment| Record {
            inputs: &self.inputs[segment.start * self.width..segment.end * self.width],
            outputs: &self.values[segment],
        })
    }

    pub(super) fn segments(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let ends = self
            .starts
            .iter()
            .skip(1)
            .copied()
            .chain([self.values.len()]);
        self.starts.iter().zip(ends).map(|(&start, end)| start..end)
    }

    pub(super) fn values(&self, segment: Range<usize>) -> &[f64] {
        &self.values[segment]
    }

    pub(super) fn input(&self, segment: Range<usize>, nth: usize) -> Vec<f64> {
        segment
            .map(|sample| self.inputs[sample * self.width + nth])
            .collect()
    }

    /// The differences from one sample to the next, which are one fewer in each segment.
    pub(super) fn differenced(&self) -> Self {
        let mut differenced = Self::new(self.width);
        for segment in self.segments() {
            differenced.segment();
            for sample in segment.skip(1) {
                let row = |sample: usize| &self.inputs[sample * self.width..][..self.width];
                let inputs = row(sample)
                    .iter()
                    .zip(row(sample - 1))
                    .map(|(now, before)| now - before);
                differenced.push(inputs, self.values[sample] - self.values[sample - 1]);
            }
        }
        differenced
    }
}

/// A signal that has always been what it was first, before its first sample.
pub(super) struct Past<'a> {
    pub(super) values: &'a [f64],
    pub(super) before: f64,
}

impl Past<'_> {
    pub(super) fn at(&self, sample: usize, lag: usize) -> f64 {
        match sample.checked_sub(lag) {
            Some(sample) => self.values[sample],
            None => self.before,
        }
    }
}

/// `x/F(q)`, where `x` has always been `before` until its first sample.
pub(super) fn through(f: &[f64], x: &[f64], before: f64) -> (Vec<f64>, f64) {
    let rest = before / (1.0 + f.iter().sum::<f64>());
    let mut filtered: Vec<f64> = Vec::with_capacity(x.len());
    for (sample, value) in x.iter().enumerate() {
        let past = Past {
            values: &filtered,
            before: rest,
        };
        let sum: f64 = f
            .iter()
            .enumerate()
            .map(|(j, f)| f * past.at(sample, j + 1))
            .sum();
        filtered.push(value - sum);
    }
    (filtered, rest)
}

/// What is left of a unit at each sample, if all samples up to the first are 1 and the filter is left to itself.
fn dying(f: &[f64], count: usize) -> Vec<f64> {
    let mut left: Vec<f64> = Vec::with_capacity(count);
    for sample in 0..count {
        let past = Past {
            values: &left,
            before: 1.0,
        };
        let sum: f64 = f
            .iter()
            .enumerate()
            .map(|(j, f)| f * past.at(sample, j + 1))
            .sum();
        left.push(if sample == 0 { 1.0 } else { -sum });
    }
    left
}

/// An input of a segment on its way through the model.
struct Brought {
    delay: usize,
    nb: usize,
    nf: usize,
    /// `u/F`, what `b` is multiplied with.
    of_b: (Vec<f64>, f64),
    /// `w/F`, what `f` is.
    of_f: (Vec<f64>, f64),
    /// `w = B/F u`.
    whole: Vec<f64>,
    /// What it would be had the input always been what it was first.
    rest: f64,
    /// `F` of an input at rest.
    gain: f64,
    /// What is left of a unit that `w` was off by up to the first sample, and how that changes with each `f`.
    left: Vec<f64>,
    of_left: Vec<Vec<f64>>,
}

impl Brought {
    fn new(transfer: &super::Transfer, input: &[f64], measured: bool, derive: bool) -> Self {
        let first = input.first().copied().unwrap_or(0.0);
        let of_b = through(&transfer.f, input, first);
        let past = Past {
            values: &of_b.0,
            before: of_b.1,
        };
        let whole = |sample| {
            let b = transfer.b.iter().enumerate();
            b.map(|(j, b)| b * past.at(sample, transfer.delay + j))
                .sum()
        };
        let whole: Vec<f64> = (0..input.len()).map(whole).collect();
        let rest = transfer.b.iter().sum::<f64>() * of_b.1;
        let mut left = Vec::new();
        let mut of_left = Vec::new();
        if measured && !transfer.f.is_empty() {
            left = dying(&transfer.f, input.len());
            let derived = if derive { transfer.f.len() } else { 0 };
            for j in 1..=derived {
                let past = Past {
                    values: &left,
                    before: 1.0,
                };
                let driven: Vec<f64> = (0..input.len())
                    .map(|sample| {
                        if sample == 0 {
                            0.0
                        } else {
                            -past.at(sample, j)
                        }
                    })
                    .collect();
                of_left.push(through(&transfer.f, &driven, 0.0).0);
            }
        }
        Self {
            rest,
            gain: 1.0 + transfer.f.iter().sum::<f64>(),
            left,
            of_left,
            delay: transfer.delay,
            nb: transfer.b.len(),
            nf: transfer.f.len(),
            of_f: if derive {
                through(&transfer.f, &whole, rest)
            } else {
                (Vec::new(), rest)
            },
            of_b,
            whole,
        }
    }

    /// Puts down how the noise changes with each `b` and `f`; of what all filters were off by at first, `left` is left.
    fn derive(&self, sample: usize, left: f64, off: f64, put: &mut impl FnMut(f64)) {
        let past = |of: &(Vec<f64>, f64), lag| {
            let (values, before) = (&of.0, of.1);
            Past { values, before }.at(sample, lag)
        };
        let at_rest = left * self.of_b.1;
        (0..self.nb).for_each(|j| put(at_rest - past(&self.of_b, self.delay + j)));
        let at_rest = left * self.rest / self.gain;
        for j in 1..=self.nf {
            let dying = self.of_left.get(j - 1).map_or(0.0, |of| of[sample]);
            put(past(&self.of_f, j) - at_rest - off * dying);
        }
    }
}

/// Goes through the residuals of a model. The first `first` of each segment are left out.
pub(super) fn residuals(
    model: &Polynomials,
    samples: &Samples,
    first: usize,
    mut take: impl FnMut(f64),
) {
    go_through(model, samples, first, false, |residual, _| take(residual));
}

/// Goes through the residuals of a model, each with its derivatives in the order of [`Polynomials::flat`] (Ljung 1999, section
/// 10.3). The first `first` of each segment are left out.
pub(super) fn derivatives(
    model: &Polynomials,
    samples: &Samples,
    first: usize,
    take: impl FnMut(f64, &[f64]),
) {
    go_through(model, samples, first, true, take);
}

fn go_through(
    model: &Polynomials,
    samples: &Samples,
    first: usize,
    derive: bool,
    mut take: impl FnMut(f64, &[f64]),
) {
    let count = if derive { model.flat().len() } else { 0 };
    let whitening = model.whitening();
    let integrating = Polynomials {
        d: Vec::new(),
        ..model.clone()
    }
    .whitening();
    let of_level = -(1.0 + model.a.iter().sum::<f64>());
    let share = model.share();
    for segment in samples.segments() {
        let values: Vec<f64> = samples
            .values(segment.clone())
            .iter()
            .map(|y| y - model.level)
            .collect();
        let brought: Vec<Brought> = model
            .inputs
            .iter()
            .enumerate()
            .map(|(nth, transfer)| {
                let input = samples.input(segment.clone(), nth);
                Brought::new(transfer, &input, share > 0.0, derive)
            })
            .collect();
        let off = match values.first() {
            Some(first) => share * (first - brought.iter().map(|of| of.rest).sum::<f64>()),
            None => 0.0,
        };
        // Before this sample something that `A` or a direct input needs is missing.
        let begin = first_of(model);
        let mut ring = Ring::new(count, whitening.len(), model.c.len(), integrating.len());
        for sample in begin..values.len() {
            let row = ring.next();
            let a = model.a.iter().enumerate();
            let left_of = |of: &Brought| of.left.get(sample).copied().unwrap_or(0.0);
            let left: f64 = brought.iter().map(left_of).sum();
            let brought_now: f64 = brought.iter().map(|of| of.whole[sample]).sum();
            let brought_now = brought_now + off * left;
            let left = share * left;
            row.noise = values[sample] + a.map(|(j, a)| a * values[sample - 1 - j]).sum::<f64>()
                - brought_now;
            let mut at = 0;
            if derive {
                let mut put = |value: f64| {
                    row.raw[at] = value;
                    at += 1;
                };
                if model.differences == 0 {
                    put(of_level + left);
                }
                (1..=model.a.len()).for_each(|j| put(values[sample - j]));
                brought
                    .iter()
                    .for_each(|of| of.derive(sample, left, off, &mut put));
            }
            if sample < begin + whitening.len() {
                continue;
            }
            ring.whiten(&whitening, &model.c, &integrating, model.d.len(), at);
            if sample >= first {
                take(ring.residual(), ring.derivatives());
            }
        }
    }
}

fn first_of(model: &Polynomials) -> usize {
    let direct = model
        .inputs
        .iter()
        .filter(|of| of.f.is_empty() && !of.b.is_empty());
    let reach = direct.map(|of| of.delay + of.b.len() - 1).max();
    model.a.len().max(reach.unwrap_or(0))
}

/// The last samples, as far back as the noise model reaches.
struct Ring {
    rows: Vec<Row>,
    now: usize,
}

#[derive(Clone)]
struct Row {
    /// `A y − Σ w`, before the noise model.
    noise: f64,
    /// Its derivatives.
    raw: Vec<f64>,
    residual: f64,
    derivatives: Vec<f64>,
}

impl Ring {
    fn new(count: usize, whitening: usize, nc: usize, integrating: usize) -> Self {
        let row = Row {
            noise: 0.0,
            raw: vec![0.0; count],
            residual: 0.0,
            derivatives: vec![0.0; count],
        };
        Self {
            rows: vec![row; 1 + whitening.max(nc).max(integrating) + integrating],
            now: 0,
        }
    }

    /// The row of the next sample, whose residual is 0 until it has been worked out.
    fn next(&mut self) -> &mut Row {
        self.now = (self.now + 1) % self.rows.len();
        let row = &mut self.rows[self.now];
        row.residual = 0.0;
        row.derivatives.fill(0.0);
        row
    }

    fn back(&self, lag: usize) -> usize {
        (self.now + self.rows.len() - lag) % self.rows.len()
    }

    /// `ε = D (1 − q⁻¹)^d/C` of the noise, and the same of its derivatives; then those by `C` and `D` themselves.
    fn whiten(&mut self, whitening: &[f64], c: &[f64], integrating: &[f64], nd: usize, at: usize) {
        let mut new = std::mem::take(&mut self.rows[self.now].derivatives);
        new[..at].copy_from_slice(&self.rows[self.now].raw[..at]);
        let mut residual = self.rows[self.now].noise;
        for (j, d) in whitening.iter().enumerate() {
            let row = &self.rows[self.back(j + 1)];
            residual += d * row.noise;
            for (to, from) in new[..at].iter_mut().zip(&row.raw) {
                *to += d * from;
            }
        }
        let derived = if new.is_empty() { 0 } else { c.len() };
        for j in 0..derived {
            new[at + j] = -self.rows[self.back(j + 1)].residual;
        }
        let derived = if new.is_empty() { 0 } else { nd };
        for j in 0..derived {
            // The noise, integrated back, `j + 1` samples ago.
            let mut noise = self.rows[self.back(j + 1)].noise;
            for (i, d) in integrating.iter().enumerate() {
                noise += d * self.rows[self.back(j + 2 + i)].noise;
            }
            new[at + c.len() + j] = noise;
        }
        for (j, c) in c.iter().enumerate() {
            let row = &self.rows[self.back(j + 1)];
            residual -= c * row.residual;
            for (to, from) in new.iter_mut().zip(&row.derivatives) {
                *to -= c * from;
            }
        }
        let row = &mut self.rows[self.now];
        row.residual = residual;
        row.derivatives = new;
    }

    fn residual(&self) -> f64 {
        self.rows[self.now].residual
    }

    fn derivatives(&self) -> &[f64] {
        &self.rows[self.now].derivatives
    }
}

/// The sum of the squared residuals; infinite where it is not a number.
pub(super) fn sum_of_squares(model: &Polynomials, samples: &Samples, first: usize) -> f64 {
    let mut sum = 0.0;
    residuals(model, samples, first, |residual| sum += residual * residual);
    if sum.is_finite() { sum } else { f64::INFINITY }
}

/// The first sample of a segment that is counted: `first`, or a later one before which a model of these orders lacks something.
pub(super) fn counted_from(orders: &Orders, first: usize) -> usize {
    first.max(orders.first())
}
