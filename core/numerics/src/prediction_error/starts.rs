//! Decides where the filters of inputs begin in a segment: such that its residuals and how far the filters are from rest are least
//! together, which is linear (Ljung 1999, section 10.5; as random effects, Robinson 1991).

use std::collections::BTreeMap;

use faer::Mat;

use super::polynomials::back;
use super::segment::Counted;
use super::{Polynomials, Samples};
use crate::state_space::pseudo_inverse_above;

/// What is left of 1 when nothing of it can be seen any more beside numbers about 1.
pub(super) const OVER: f64 = 1e-20;

/// Of starts that lead to nearly the same, what is less than this share of all that they lead to counts as nothing.
const DISTINCT: f64 = 1e-8;

/// Where the filters of a segment begin.
#[derive(Debug, Clone)]
pub(super) struct Start {
    /// How far off what they gave before is from rest: the newest value of the first filter, the one before and so on, and the
    /// same of the others.
    pub(super) values: Vec<f64>,
    /// How many of them its residuals tell; the others stay at rest.
    pub(super) determined: f64,
}

/// What becomes of a start in the residuals of a segment: the same in all segments of which no value is missing.
#[derive(Debug)]
pub(super) struct FreeResponses {
    /// How the residuals, from the first that is counted until nothing is left of a start, change with each of its values.
    derivatives: Mat<f64>,
    /// What residuals tell of a start, by how many of them change with it.
    determined: BTreeMap<usize, Determined>,
}

#[derive(Debug)]
struct Determined {
    /// The products of the derivatives.
    own: Mat<f64>,
    /// The inverse of that with what the start itself counts; none where the filters grow beyond all numbers.
    inverse: Option<Mat<f64>>,
}

impl Start {
    /// What its squares count.
    pub(super) fn counting(&self, counts: &[f64]) -> f64 {
        let counted = self.values.iter().zip(counts);
        // What counts endlessly is 0.
        let counted = counted.filter(|(value, _)| **value != 0.0);
        counted.map(|(value, of)| of * value * value).sum()
    }
}

impl FreeResponses {
    pub(super) fn new(model: &Polynomials, samples: &Samples, counted: &Counted) -> Self {
        let mut responses = Vec::with_capacity(model.starts());
        for f in model.inputs.iter().map(|transfer| &transfer.f) {
            let of = |nth| free_response(model, f, nth, samples.longest(), counted);
            responses.extend((0..f.len()).map(of));
        }
        let complete = samples
            .segments()
            .filter(|segment| samples.is_complete(segment));
        let rows = complete.map(|segment| segment.len().saturating_sub(counted.begin(model)));
        Self::of(&responses, rows, counted)
    }

    /// Of what becomes of each value in the residuals, in segments of so many.
    pub(super) fn of(
        responses: &[Vec<f64>],
        residuals: impl Iterator<Item = usize>,
        counted: &Counted,
    ) -> Self {
        let longest = responses.iter().map(Vec::len).max().unwrap_or(0);
        let mut free = Self {
            derivatives: Mat::from_fn(longest, responses.len(), |row, nth| {
                responses[nth].get(row).copied().unwrap_or(0.0)
            }),
            determined: BTreeMap::new(),
        };
        if free.starts() > 0 && counted.starts.iter().all(|of| of.is_finite()) {
            for rows in residuals {
                let rows = free.lasting(rows);
                if !free.determined.contains_key(&rows) {
                    free.determined
                        .insert(rows, free.determined_by(rows, counted));
                }
            }
        }
        free
    }

    /// How many values a start has.
    pub(super) fn starts(&self) -> usize {
        self.derivatives.ncols()
    }

    /// How many of so many residuals of a segment change with its start.
    pub(super) fn lasting(&self, residuals: usize) -> usize {
        self.derivatives.nrows().min(residuals)
    }

    /// Adds the products of what the residual of a row changes with: coefficients, and each value of a start.
    pub(super) fn add_products(&self, row: usize, by: &[f64], sums: &mut Mat<f64>) {
        for start in 0..self.starts() {
            let by_start = self.derivatives[(row, start)];
            if by_start == 0.0 {
                continue;
            }
            let sums = sums.col_as_slice_mut(start).iter_mut();
            sums.zip(by).for_each(|(sum, by)| *sum += by * by_start);
        }
    }

    fn determined_by(&self, rows: usize, counted: &Counted) -> Determined {
        let derivatives = self.derivatives.subrows(0, rows);
        let own = derivatives.transpose() * derivatives;
        let mut with_start = own.clone();
        for (i, of) in counted.starts.iter().enumerate() {
            with_start[(i, i)] += of;
        }
        Determined {
            inverse: pseudo_inverse_above(&with_start, &with_start, DISTINCT).ok(),
            own,
        }
    }

    /// How much less the squares of the coefficients' derivatives count in a segment of so many residuals since its start
    /// follows them, of which the products with the derivatives of the start are these.
    pub(super) fn followed(&self, across: &Mat<f64>, residuals: usize) -> Option<Mat<f64>> {
        let determined = self.determined.get(&self.lasting(residuals))?;
        Some(across * determined.inverse.as_ref()? * across.transpose())
    }

    /// The start with which residuals and start count least together; the residuals are those from rest, and become those from
    /// the start.
    pub(super) fn begin(&self, residuals: &mut [f64]) -> Start {
        let count = self.starts();
        let mut start = Start {
            values: vec![0.0; count],
            determined: 0.0,
        };
        let rows = self.lasting(residuals.len());
        let Some(Determined {
            own,
            inverse: Some(inverse),
        }) = self.determined.get(&rows)
        else {
            return start;
        };
        let derivatives = self.derivatives.subrows(0, rows);
        let at_rest = Mat::from_fn(rows, 1, |row, _| residuals[row]);
        let values = inverse * (derivatives.transpose() * at_rest);
        let by_start = derivatives * &values;
        for (row, residual) in residuals[..rows].iter_mut().enumerate() {
            *residual -= by_start[(row, 0)];
        }
        start.values = (0..count).map(|i| -values[(i, 0)]).collect();
        let determined = inverse * own;
        start.determined = (0..count).map(|i| determined[(i, i)]).sum();
        start
    }
}

/// How the residuals change with the `nth` value that a filter of an input gave before a segment, from the first that is counted
/// until nothing is left of it.
fn free_response(
    model: &Polynomials,
    f: &[f64],
    nth: usize,
    longest: usize,
    counted: &Counted,
) -> Vec<f64> {
    let whitening = model.whitening();
    let memory = f.len().max(whitening.len()).max(model.c.len());
    let begin = model.reach() + whitening.len();
    // From the oldest of what the filter gave before the first sample.
    let mut left = vec![0.0; f.len()];
    left[f.len() - 1 - nth] = 1.0;
    let mut residuals = vec![0.0; begin.min(longest)];
    let mut quiet = 0;
    for sample in 0..longest {
        left.push(-back(f, &left));
        let newest = left[left.len() - 1];
        let mut residual = 0.0;
        if sample >= begin {
            residual = -newest
                - back(&whitening, &left[..left.len() - 1])
                - back(&model.c, &residuals[begin..]);
            residuals.push(residual);
        }
        let over = newest.abs() < OVER && residual.abs() < OVER;
        quiet = if over { quiet + 1 } else { 0 };
        if quiet > memory {
            break;
        }
    }
    residuals.drain(..counted.begin(model).min(residuals.len()));
    residuals
}

/// What is left in each sample of the `nth` value that a filter gave before a segment, until that is nothing.
pub(super) fn left_of_start(f: &[f64], nth: usize, longest: usize) -> Vec<f64> {
    // From the oldest of what the filter gave before the first sample.
    let mut left = vec![0.0; f.len()];
    left[f.len() - 1 - nth] = 1.0;
    let mut quiet = 0;
    while left.len() < f.len() + longest && quiet <= f.len() {
        left.push(-back(f, &left));
        let over = left[left.len() - 1].abs() < OVER;
        quiet = if over { quiet + 1 } else { 0 };
    }
    left.split_off(f.len())
}
