//! Decides how far a model's one-step predictions are off, sample by sample, and how that changes with each coefficient; not
//! which coefficients are best.
//!
//! What the filters of inputs gave before a segment begins is not known: it is found for each segment such that the residuals
//! are least, which is linear (Ljung 1999, section 10.4). What the noise was before, and that was not foreseen, is taken to be 0.

use std::ops::Range;

use faer::Mat;

use super::brought::Brought;
use super::ring::Ring;
use super::{Orders, Polynomials, Samples};
use crate::state_space::pseudo_inverse_left;

/// What is to be known beside the residuals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Derived {
    Nothing,
    ByStart,
    All,
}

/// A residual and how it changes.
pub(super) struct Residual<'a> {
    pub(super) value: f64,
    /// With each coefficient, in the order of [`Polynomials::flat`] (Ljung 1999, section 10.3).
    pub(super) by: &'a [f64],
    /// With each value that a filter gave before the segment.
    pub(super) by_start: &'a [f64],
}

/// A model in a segment of samples.
pub(super) struct Segment<'a> {
    model: &'a Polynomials,
    values: Vec<f64>,
    inputs: Vec<Vec<f64>>,
    /// The residuals before are not counted.
    first: usize,
}

impl<'a> Segment<'a> {
    pub(super) fn new(
        model: &'a Polynomials,
        samples: &Samples,
        segment: Range<usize>,
        first: usize,
    ) -> Self {
        let values = samples.values(segment.clone()).iter();
        let inputs = 0..model.inputs.len();
        Self {
            model,
            values: values.map(|y| y - model.level).collect(),
            inputs: inputs
                .map(|nth| samples.input(segment.clone(), nth))
                .collect(),
            first,
        }
    }

    /// How far off what the filters gave before the segment is from rest such that the residuals are least: the newest value of
    /// the first filter, the one before and so on, and the same of the others.
    pub(super) fn start(&self) -> Vec<f64> {
        let count = self.model.starts();
        let rest = vec![0.0; count];
        if count == 0 {
            return rest;
        }
        let mut own = Mat::<f64>::zeros(count, count);
        let mut with_residual = Mat::<f64>::zeros(count, 1);
        self.follow(&rest, Derived::ByStart, |residual| {
            for (i, a) in residual.by_start.iter().enumerate() {
                with_residual[(i, 0)] -= a * residual.value;
                for (j, b) in residual.by_start.iter().enumerate() {
                    own[(i, j)] += a * b;
                }
            }
        });
        match pseudo_inverse_left(&own, &own) {
            Ok(inverse) => {
                let start = inverse * with_residual;
                (0..count).map(|i| start[(i, 0)]).collect()
            }
            // The filters grow beyond all numbers, and the residuals tell so.
            Err(_) => rest,
        }
    }

    /// Goes through the residuals from such a start.
    pub(super) fn residuals(&self, start: &[f64], mut take: impl FnMut(f64)) {
        self.follow(start, Derived::Nothing, |residual| take(residual.value));
    }

    /// The same with all derivatives, the start being held.
    pub(super) fn derivatives(&self, start: &[f64], take: impl FnMut(Residual<'_>)) {
        self.follow(start, Derived::All, take);
    }

    fn follow(&self, start: &[f64], derived: Derived, mut take: impl FnMut(Residual<'_>)) {
        let Self { model, values, .. } = self;
        let whitening = model.whitening();
        let integrating = Polynomials {
            d: Vec::new(),
            ..(*model).clone()
        }
        .whitening();
        let of_level = -(1.0 + model.a.iter().sum::<f64>());
        let starts = if derived == Derived::Nothing {
            0
        } else {
            start.len()
        };
        let by_model = derived == Derived::All;
        let count = starts + if by_model { model.flat().len() } else { 0 };
        let mut rest = start;
        let brought: Vec<Brought> = model
            .inputs
            .iter()
            .zip(&self.inputs)
            .map(|(transfer, input)| {
                let (own, others) = rest.split_at(transfer.f.len());
                rest = others;
                Brought::new(transfer, input, own, by_model)
            })
            .collect();
        // Before this sample something that `A` or an input needs is missing.
        let begin = model.reach();
        let mut ring = Ring::new(count, whitening.len(), model.c.len(), integrating.len());
        for sample in begin..values.len() {
            let row = ring.next();
            let a = model.a.iter().enumerate();
            let explained: f64 = brought.iter().map(|of| of.whole[sample]).sum();
            row.noise = values[sample] + a.map(|(j, a)| a * values[sample - 1 - j]).sum::<f64>()
                - explained;
            let mut at = 0;
            let mut put = |value: f64| {
                row.raw[at] = value;
                at += 1;
            };
            if starts > 0 {
                brought
                    .iter()
                    .for_each(|of| of.derive_by_start(sample, &mut put));
            }
            if by_model {
                if model.differences == 0 {
                    put(of_level);
                }
                (1..=model.a.len()).for_each(|j| put(values[sample - j]));
                brought.iter().for_each(|of| of.derive(sample, &mut put));
            }
            if sample < begin + whitening.len() {
                continue;
            }
            ring.whiten(&whitening, &model.c, &integrating, model.d.len(), at);
            if sample >= self.first {
                let (by_start, by) = ring.derivatives().split_at(starts);
                take(Residual {
                    value: ring.residual(),
                    by,
                    by_start,
                });
            }
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
    for segment in samples.segments() {
        let segment = Segment::new(model, samples, segment, first);
        segment.residuals(&segment.start(), &mut take);
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
