//! Decides what a record of inputs and of what they lead to is; not what is made of it.

use std::ops::Range;

use super::Orders;
use crate::{Record, Standardizer};

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

    /// How many values that filters gave before segments are found when the first of each segment are not counted.
    pub(super) fn starts(&self, orders: &Orders, first: usize) -> usize {
        self.segments()
            .map(|segment| segment.len().saturating_sub(first).min(orders.starts()))
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
