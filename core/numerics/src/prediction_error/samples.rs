//! Decides what a record of inputs and of what they lead to is, and what of it is missing; not what is made of it.

use std::ops::Range;

use super::Orders;
use crate::{Record, Standardization, Standardizer};

/// Gaps of more samples are not filled to find where a search begins.
const LONGEST_FILLED: usize = 5;

/// Evenly spaced samples of the inputs and of what they lead to, in segments. The inputs of each are known; what they lead to may
/// be missing.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    width: usize,
    values: Vec<f64>,
    /// One input after the other for each sample.
    inputs: Vec<f64>,
    starts: Vec<usize>,
    /// The places of those whose value is missing, in order.
    missing: Vec<usize>,
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

    /// Takes a sample of which only the inputs are known.
    pub fn push_missing(&mut self, inputs: impl IntoIterator<Item = f64>) {
        self.missing.push(self.values.len());
        self.push(inputs, f64::NAN);
    }

    /// How many values there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.values.len() - self.missing.len()
    }

    /// How many values are missing.
    #[must_use]
    pub fn missing(&self) -> usize {
        self.missing.len()
    }

    /// How many inputs.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// The standard deviation of the values; 1 where they are all the same.
    #[must_use]
    pub fn spread(&self) -> f64 {
        self.standardization().scales[0]
    }

    /// The mean of the values.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.standardization().means[0]
    }

    fn standardization(&self) -> Standardization {
        let mut values = Standardizer::new(1);
        let known = self.records().flat_map(|record| record.outputs);
        known.for_each(|&value| values.partial_fit(&[value]));
        values.standardization()
    }

    /// The same with values that are so many times smaller.
    #[must_use]
    pub fn divided(&self, by: f64) -> Self {
        let mut divided = self.clone();
        divided.values.iter_mut().for_each(|value| *value /= by);
        divided
    }

    /// How many values are left when in each segment those before so many samples, and before so many values in a row, are not
    /// counted.
    #[must_use]
    pub fn counted(&self, first: usize, measured: usize) -> usize {
        let segments = self.segments();
        segments
            .map(|segment| self.counted_in(&segment, first, measured))
            .sum()
    }

    /// The same in one segment.
    pub(super) fn counted_in(
        &self,
        segment: &Range<usize>,
        first: usize,
        measured: usize,
    ) -> usize {
        let begin = (segment.start + self.begin(segment, first, measured)).min(segment.end);
        segment.end - begin - self.missing_in(&(begin..segment.end)).len()
    }

    /// The first sample of a segment that is not among its first ones and before which so many values in a row are known; one
    /// beyond its end where there is none.
    pub(super) fn begin(&self, segment: &Range<usize>, first: usize, measured: usize) -> usize {
        let mut begin = first.max(measured);
        for missing in self.missing_in(segment).iter().map(|at| at - segment.start) {
            if missing >= begin {
                break;
            }
            if missing + measured >= begin {
                begin = missing + measured + 1;
            }
        }
        begin
    }

    /// The places in a range whose value is missing.
    fn missing_in(&self, range: &Range<usize>) -> &[usize] {
        let before = |end: usize| self.missing.partition_point(|&at| at < end);
        &self.missing[before(range.start)..before(range.end)]
    }

    /// Whether no value of a segment is missing.
    pub(super) fn is_complete(&self, segment: &Range<usize>) -> bool {
        self.missing_in(segment).is_empty()
    }

    /// How many values that filters gave before segments are found when those are not counted that [`counted`](Self::counted)
    /// leaves out.
    pub(super) fn starts(&self, orders: &Orders, first: usize, measured: usize) -> usize {
        self.segments()
            .map(|segment| {
                let counted = self.counted_in(&segment, first, measured);
                counted.min(orders.starts())
            })
            .sum()
    }

    /// How many samples the longest segment has.
    pub(super) fn longest(&self) -> usize {
        let lengths = self.segments().map(|segment| segment.len());
        lengths.max().unwrap_or(0)
    }

    /// The stretches without a value that is missing, as subspace identification takes them.
    pub fn records(&self) -> impl Iterator<Item = Record<'_>> {
        self.stretches(0).map(|stretch| Record {
            inputs: &self.inputs[stretch.start * self.width..stretch.end * self.width],
            outputs: &self.values[stretch],
        })
    }

    /// The inputs of each sample, and its value unless that is missing.
    pub fn all(&self) -> impl Iterator<Item = (&[f64], Option<f64>)> {
        (0..self.values.len()).map(|at| {
            let known = self.is_complete(&(at..at + 1)).then(|| self.values[at]);
            (&self.inputs[at * self.width..(at + 1) * self.width], known)
        })
    }

    /// How many segments there are.
    #[must_use]
    pub fn pieces(&self) -> usize {
        self.starts.len()
    }

    /// The segments, cut where more than so many values in a row are missing, without these and those that are missing at either
    /// end.
    fn stretches(&self, most: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        self.segments().flat_map(move |segment| {
            let (mut stretches, mut start) = (Vec::new(), segment.start);
            for gap in self.gaps(&segment) {
                if gap.len() > most || gap.start == start || gap.end == segment.end {
                    if gap.start > start {
                        stretches.push(start..gap.start);
                    }
                    start = gap.end;
                }
            }
            if start < segment.end || segment.is_empty() {
                stretches.push(start..segment.end);
            }
            stretches
        })
    }

    /// The places in a range whose value is missing, as far as they follow each other.
    fn gaps(&self, range: &Range<usize>) -> impl Iterator<Item = Range<usize>> {
        let gaps = self.missing_in(range).chunk_by(|at, next| at + 1 == *next);
        gaps.map(|gap| gap[0]..gap[0] + gap.len())
    }

    /// The same where nothing is missing: in short gaps values lie on the line from the one before to the one after, and longer
    /// ones end a segment.
    pub(super) fn filled(&self) -> Self {
        let mut values = self.values.clone();
        let mut filled = Self::new(self.width);
        for stretch in self.stretches(LONGEST_FILLED) {
            for gap in self.gaps(&stretch) {
                let (from, to) = (values[gap.start - 1], values[gap.end]);
                let steps = (gap.len() + 1) as f64;
                for (nth, value) in (1..).zip(&mut values[gap]) {
                    *value = from + f64::from(nth) / steps * (to - from);
                }
            }
            filled.segment();
            for at in stretch {
                let inputs = &self.inputs[at * self.width..][..self.width];
                filled.push(inputs.iter().copied(), values[at]);
            }
        }
        filled
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

    /// Where nothing is missing, the differences from one sample to the next, which are one fewer in each segment.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A segment for each text: a digit is a value, which is its own input too, and a dot is one that is missing.
    fn samples(segments: &[&str]) -> Samples {
        let mut samples = Samples::new(1);
        for segment in segments {
            samples.segment();
            for (nth, value) in segment.chars().enumerate() {
                match value.to_digit(10) {
                    Some(value) => samples.push([nth as f64], f64::from(value)),
                    None => samples.push_missing([nth as f64]),
                }
            }
        }
        samples
    }

    #[test]
    fn records_are_the_stretches_without_a_value_that_is_missing() {
        let samples = samples(&["..12..3.", "456", "...", "7"]);
        let records = samples.records();
        let found: Vec<_> = records
            .map(|of| (of.inputs.to_vec(), of.outputs.to_vec()))
            .collect();
        let expected = [
            (vec![2.0, 3.0], vec![1.0, 2.0]),
            (vec![6.0], vec![3.0]),
            (vec![0.0, 1.0, 2.0], vec![4.0, 5.0, 6.0]),
            (vec![0.0], vec![7.0]),
        ];
        assert_eq!(found, expected);
        assert_eq!(
            (samples.count(), samples.missing(), samples.pieces()),
            (7, 8, 4)
        );
    }

    #[test]
    fn short_gaps_are_filled_along_a_line_and_long_ones_end_a_segment() {
        let filled = samples(&["1.3..9......45."]).filled();
        let records: Vec<_> = filled.records().map(|of| of.outputs.to_vec()).collect();
        assert_eq!(
            records,
            [vec![1.0, 2.0, 3.0, 5.0, 7.0, 9.0], vec![4.0, 5.0]]
        );
    }

    #[test]
    fn nothing_is_counted_before_enough_values_in_a_row_are_known() {
        let one = samples(&["1.23.4567.8"]);
        let segment = one.segments().next().unwrap();
        let begin = |first, measured| one.begin(&segment, first, measured);
        assert_eq!((begin(0, 0), begin(4, 0), begin(0, 1)), (0, 4, 1));
        assert_eq!((begin(0, 2), begin(2, 1), begin(0, 3)), (4, 3, 8));
        assert!(begin(0, 5) >= segment.len());
        assert_eq!(
            (one.counted(0, 0), one.counted(0, 2), one.counted(0, 3)),
            (8, 5, 2)
        );
        assert_eq!(one.counted(0, 5), 0);
        // Where nothing is missing it is as many samples.
        assert_eq!(samples(&["12345"]).counted(3, 2), 2);
    }
}
