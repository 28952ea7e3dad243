//! Decides how far a model's one-step predictions are off, sample by sample, and how that changes with each coefficient; not
//! which coefficients are best.
//!
//! What the noise was before a segment begins, and that was not foreseen, is taken to be 0.

use std::collections::BTreeMap;
use std::ops::Range;

use super::brought::Brought;
use super::missing::Gapped;
use super::polynomials::back;
use super::ring::Ring;
use super::starts::{FreeResponses, Start};
use super::{Orders, Polynomials, Samples};

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

/// What a model leaves, wherever its filters begin.
#[derive(Debug)]
pub(super) struct Left {
    /// The residuals that are counted, by segment. Where values are missing, each is in the standard deviation of its prediction,
    /// times the root of `mean`.
    pub(super) residuals: Vec<Vec<f64>>,
    pub(super) starts: Vec<Start>,
    /// Of the segments of which no value is missing.
    free: FreeResponses,
    /// Of the others, by their number.
    free_in_gapped: BTreeMap<usize, FreeResponses>,
    /// The sum of the squared residuals; infinite where it is not a number.
    pub(super) squares: f64,
    /// What the squares of the starts count.
    pub(super) of_starts: f64,
    /// The geometric mean of the variances of predictions, in that of an innovation: 1 where no value is missing.
    pub(super) mean: f64,
    /// The sum of the squares of what predictions are off by.
    pub(super) squared_errors: f64,
}

impl Left {
    pub(super) fn by(model: &Polynomials, samples: &Samples, counted: &Counted) -> Self {
        let free = FreeResponses::new(model, samples, counted);
        let (mut all, mut starts) = (Vec::new(), Vec::new());
        let (mut free_in_gapped, mut log_variances) = (BTreeMap::new(), BTreeMap::new());
        let rest = vec![0.0; free.starts()];
        for (nth, segment) in samples.segments().enumerate() {
            if samples.is_complete(&segment) {
                let segment = Segment::new(model, samples, segment, counted);
                let mut residuals = segment.residuals(&rest);
                starts.push(free.begin(&mut residuals));
                all.push(residuals);
            } else {
                let gapped = Gapped::new(model, samples, segment, counted);
                let errors = gapped.errors(&rest);
                let mut residuals: Vec<f64> = errors.iter().map(|error| error.scaled).collect();
                let own = FreeResponses::in_gapped(&gapped, residuals.len(), counted);
                starts.push(own.begin(&mut residuals));
                free_in_gapped.insert(nth, own);
                let own = errors.iter().map(|error| error.log_variance);
                log_variances.insert(nth, own.collect::<Vec<f64>>());
                all.push(residuals);
            }
        }
        let squares =
            |values: &mut dyn Iterator<Item = &f64>| values.map(|value| value * value).sum::<f64>();
        let (mut mean, mut squared_errors) = (1.0, None);
        if samples.missing() > 0 {
            let rows = all.iter().map(Vec::len).sum::<usize>().max(1) as f64;
            mean = (log_variances.values().flatten().sum::<f64>() / rows).exp();
            let mut sum = 0.0;
            for (nth, residuals) in all.iter().enumerate() {
                let variances = log_variances.get(&nth).into_iter().flatten();
                let variances = variances.map(|log| log.exp()).chain(std::iter::repeat(1.0));
                let errors = residuals.iter().zip(variances);
                sum += errors.map(|(error, of)| error * error * of).sum::<f64>();
            }
            squared_errors = Some(sum);
            let scale = mean.sqrt();
            all.iter_mut().flatten().for_each(|error| *error *= scale);
        }
        let sum = squares(&mut all.iter().flatten());
        let of_starts: f64 = starts
            .iter()
            .map(|start| start.counting(&counted.starts))
            .sum();
        Self {
            squares: if sum.is_finite() { sum } else { f64::INFINITY },
            of_starts: mean * of_starts,
            squared_errors: squared_errors.unwrap_or(sum),
            residuals: all,
            starts,
            free,
            free_in_gapped,
            mean,
        }
    }

    /// What is made least: the squares of residuals and starts.
    pub(super) fn sum(&self) -> f64 {
        self.squares + self.of_starts
    }

    /// The sum of the squares, each over the variance of its prediction in that of an innovation.
    pub(super) fn innovations(&self) -> f64 {
        self.squares / self.mean
    }

    /// How many starts the residuals tell.
    pub(super) fn told(&self) -> f64 {
        self.starts.iter().map(|start| start.told).sum()
    }

    /// What becomes of a start in the residuals of a segment.
    pub(super) fn free(&self, segment: usize) -> &FreeResponses {
        self.free_in_gapped.get(&segment).unwrap_or(&self.free)
    }
}

/// The first sample of a segment that is counted: `first`, or a later one before which a model of these orders lacks something.
pub(super) fn counted_from(orders: &Orders, first: usize) -> usize {
    first.max(orders.first())
}
