//! Decides what a model leaves of all segments, wherever its filters begin; not which coefficients are best.

use std::collections::BTreeMap;
use std::iter::{once, repeat};

use super::missing::Gapped;
use super::segment::{Counted, Segment};
use super::starts::{FreeResponses, Start};
use super::{Polynomials, Samples};

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
                let (responses, rows) = (gapped.free_responses(), once(residuals.len()));
                let own = FreeResponses::of(&responses, rows, counted);
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
                let variances = variances.map(|log| log.exp()).chain(repeat(1.0));
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
    pub(super) fn determined(&self) -> f64 {
        self.starts.iter().map(|start| start.determined).sum()
    }

    /// What becomes of a start in the residuals of a segment.
    pub(super) fn free(&self, segment: usize) -> &FreeResponses {
        self.free_in_gapped.get(&segment).unwrap_or(&self.free)
    }
}
