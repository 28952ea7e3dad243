//! Decides how far a model's one-step predictions are off in a segment of which no value is missing, and how that changes with each
//! coefficient; not where the filters of inputs begin, nor which coefficients are best.
//!
//! What the noise was before a segment begins, and that was not foreseen, is taken to be 0.

use std::ops::Range;

use super::brought::Brought;
use super::polynomials::back;
use super::ring::Ring;
use super::{Polynomials, Samples};

/// A model in a segment of samples.
pub(super) struct Segment<'a> {
    pub(super) model: &'a Polynomials,
    pub(super) values: Vec<f64>,
    pub(super) inputs: Vec<Vec<f64>>,
    counted: &'a Counted,
}

/// What counts in a search.
#[derive(Debug, Clone)]
pub(super) struct Counted {
    /// The residuals of a segment before are not counted.
    pub(super) first: usize,
    /// Where values of it are missing, nor are those before which not so many in a row are known.
    pub(super) measured: usize,
    /// What the squares of the values of a start count; nothing where there are none.
    pub(super) starts: Vec<f64>,
}

impl Counted {
    /// From a sample on, wherever filters begin.
    pub(super) fn from(first: usize) -> Self {
        Self {
            first,
            measured: 0,
            starts: Vec::new(),
        }
    }

    /// The first residual that is counted of a model, which has none before it knows all that the noise is made of.
    pub(super) fn begin(&self, model: &Polynomials) -> usize {
        self.first.max(model.reach() + model.whitening().len())
    }
}

impl<'a> Segment<'a> {
    pub(super) fn new(
        model: &'a Polynomials,
        samples: &Samples,
        segment: Range<usize>,
        counted: &'a Counted,
    ) -> Self {
        let values = samples.values(segment.clone()).iter();
        let inputs = 0..model.inputs.len();
        Self {
            model,
            values: values.map(|y| y - model.level).collect(),
            inputs: inputs
                .map(|nth| samples.input(segment.clone(), nth))
                .collect(),
            counted,
        }
    }

    /// The residuals that are counted, from such a start.
    pub(super) fn residuals(&self, start: &[f64]) -> Vec<f64> {
        let model = self.model;
        let noise = self.noise(&self.brought(start, false));
        let whitening = model.whitening();
        let unknown = whitening.len().min(noise.len());
        let mut residuals = vec![0.0; unknown];
        for sample in unknown..noise.len() {
            let whitened = noise[sample] + back(&whitening, &noise[..sample]);
            residuals.push(whitened - back(&model.c, &residuals[unknown..]));
        }
        let skipped = self.counted.begin(model) - model.reach();
        residuals.drain(..skipped.min(residuals.len()));
        residuals
    }

    /// The same, and how each changes with each coefficient in the order of [`Polynomials::flat`], the start being held (Ljung 1999,
    /// section 10.3).
    pub(super) fn derivatives(&self, start: &[f64], mut take: impl FnMut(f64, &[f64])) {
        let Self { model, values, .. } = self;
        let whitening = model.whitening();
        let integrating = Polynomials {
            d: Vec::new(),
            ..(*model).clone()
        }
        .whitening();
        let of_level = -(1.0 + model.a.iter().sum::<f64>());
        let brought = self.brought(start, true);
        let noise = self.noise(&brought);
        let begin = model.reach();
        let count = model.flat().len();
        let mut ring = Ring::new(count, whitening.len(), model.c.len(), integrating.len());
        for (sample, noise) in (begin..values.len()).zip(noise) {
            let row = ring.next();
            row.noise = noise;
            let mut at = 0;
            let mut put = |value: f64| {
                row.raw[at] = value;
                at += 1;
            };
            if model.differences == 0 {
                put(of_level);
            }
            (1..=model.a.len()).for_each(|j| put(values[sample - j]));
            brought.iter().for_each(|of| of.derive(sample, &mut put));
            if sample < begin + whitening.len() {
                continue;
            }
            ring.whiten(&whitening, &model.c, &integrating, model.d.len(), at);
            if sample >= self.counted.first {
                take(ring.residual(), ring.derivatives());
            }
        }
    }

    /// What each input brings about, from such a start; with what it takes to derive it where that is asked for.
    pub(super) fn brought(&self, start: &[f64], derive: bool) -> Vec<Brought> {
        let mut rest = start;
        let transfers = self.model.inputs.iter().zip(&self.inputs);
        let brought = transfers.map(|(transfer, input)| {
            let (own, others) = rest.split_at(transfer.f.len());
            rest = others;
            Brought::new(transfer, input, own, derive)
        });
        brought.collect()
    }

    /// `A (y − μ) − Σ w`, from the first sample before which nothing is missing that `A` or an input needs.
    fn noise(&self, brought: &[Brought]) -> Vec<f64> {
        let begin = self.model.reach();
        let mut explained = vec![0.0; self.values.len()];
        for of in brought {
            let both = explained.iter_mut().zip(&of.whole);
            both.for_each(|(sum, brought)| *sum += brought);
        }
        let of = |sample: usize| {
            let past = back(&self.model.a, &self.values[..sample]);
            self.values[sample] + past - explained[sample]
        };
        (begin..self.values.len()).map(of).collect()
    }
}
