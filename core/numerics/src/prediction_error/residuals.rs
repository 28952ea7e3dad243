//! Decides how far a model's one-step predictions are off, sample by sample, and how that changes with each coefficient; not
//! which coefficients are best.
//!
//! What the filters of inputs gave before a segment begins is not known: it is found for each segment such that the residuals
//! and how far it is from rest are least together, which is linear (Ljung 1999, section 10.4; as random effects, Robinson 1991).
//! What the noise was before, and that was not foreseen, is taken to be 0.

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
    counted: Counted,
}

/// What counts in a search.
#[derive(Debug, Clone, Copy)]
pub(super) struct Counted {
    /// The residuals of a segment before are not counted.
    pub(super) first: usize,
    /// What the square of a value that a filter gave before a segment, less what it gives at rest, counts as much as.
    pub(super) start: f64,
}

impl Counted {
    /// From a sample on, wherever filters begin.
    pub(super) fn from(first: usize) -> Self {
        Self { first, start: 0.0 }
    }
}

/// Sums of the products of all of one list with all of another.
pub(super) struct Products {
    columns: usize,
    rows: Vec<f64>,
}

impl Products {
    pub(super) fn new(rows: usize, columns: usize) -> Self {
        Self {
            columns,
            rows: vec![0.0; rows * columns],
        }
    }

    pub(super) fn add(&mut self, rows: &[f64], columns: &[f64]) {
        for (sums, a) in self.rows.chunks_exact_mut(self.columns.max(1)).zip(rows) {
            for (sum, b) in sums.iter_mut().zip(columns) {
                *sum += a * b;
            }
        }
    }

    pub(super) fn sums(&self) -> Mat<f64> {
        let count = self.rows.len() / self.columns.max(1);
        Mat::from_fn(count, self.columns, |i, j| self.rows[i * self.columns + j])
    }
}

/// Where the filters of a segment begin.
pub(super) struct Start {
    /// How far off what they gave before is from rest: the newest value of the first filter, the one before and so on, and the
    /// same of the others.
    pub(super) values: Vec<f64>,
    /// How many of them its residuals tell; the others stay at rest.
    pub(super) told: f64,
}

/// The inverse of products of derivatives by the start, with what the start itself counts.
pub(super) fn inverse_with(counted: Counted, mut own: Mat<f64>) -> Option<Mat<f64>> {
    for i in 0..own.nrows() {
        own[(i, i)] += counted.start;
    }
    pseudo_inverse_left(&own, &own).ok()
}

impl<'a> Segment<'a> {
    pub(super) fn new(
        model: &'a Polynomials,
        samples: &Samples,
        segment: Range<usize>,
        counted: Counted,
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

    /// The start with which residuals and start count least together.
    pub(super) fn start(&self) -> Start {
        let count = self.model.starts();
        let mut start = Start {
            values: vec![0.0; count],
            told: 0.0,
        };
        if count == 0 || self.counted.start.is_infinite() {
            return start;
        }
        let mut own = Products::new(count, count);
        let mut with_residual = Products::new(count, 1);
        self.follow(&start.values, Derived::ByStart, |residual| {
            own.add(residual.by_start, residual.by_start);
            with_residual.add(residual.by_start, &[-residual.value]);
        });
        let (own, with_residual) = (own.sums(), with_residual.sums());
        // Where the filters grow beyond all numbers, the residuals tell so.
        if let Some(inverse) = inverse_with(self.counted, own.clone()) {
            let values = &inverse * with_residual;
            start.values = (0..count).map(|i| values[(i, 0)]).collect();
            let told = inverse * &own;
            start.told = (0..count).map(|i| told[(i, i)]).sum();
        }
        start
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
            if sample >= self.counted.first {
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

/// Goes through the residuals of a model, wherever filters begin. The first `first` of each segment are left out.
pub(super) fn residuals(
    model: &Polynomials,
    samples: &Samples,
    first: usize,
    mut take: impl FnMut(f64),
) {
    for segment in samples.segments() {
        let segment = Segment::new(model, samples, segment, Counted::from(first));
        segment.residuals(&segment.start().values, &mut take);
    }
}

/// What a model leaves.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Left {
    /// The sum of the squared residuals; infinite where it is not a number.
    pub(super) squares: f64,
    /// The sum of the squared starts, less those at rest.
    pub(super) of_starts: f64,
    /// How many starts the residuals tell.
    pub(super) told: f64,
}

impl Left {
    /// What is made least: the squares of residuals and starts.
    pub(super) fn sum(&self, counted: Counted) -> f64 {
        // What counts endlessly is 0.
        let of_starts = if self.of_starts > 0.0 {
            counted.start * self.of_starts
        } else {
            0.0
        };
        self.squares + of_starts
    }
}

pub(super) fn left(model: &Polynomials, samples: &Samples, counted: Counted) -> Left {
    let mut left = Left::default();
    for segment in samples.segments() {
        let segment = Segment::new(model, samples, segment, counted);
        let start = segment.start();
        segment.residuals(&start.values, |residual| {
            left.squares += residual * residual
        });
        left.of_starts += start.values.iter().map(|value| value * value).sum::<f64>();
        left.told += start.told;
    }
    if !left.squares.is_finite() {
        left.squares = f64::INFINITY;
    }
    left
}

/// The sum of the squared residuals, wherever filters begin; infinite where it is not a number.
pub(super) fn sum_of_squares(model: &Polynomials, samples: &Samples, first: usize) -> f64 {
    left(model, samples, Counted::from(first)).squares
}

/// The first sample of a segment that is counted: `first`, or a later one before which a model of these orders lacks something.
pub(super) fn counted_from(orders: &Orders, first: usize) -> usize {
    first.max(orders.first())
}
