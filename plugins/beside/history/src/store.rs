//! What is kept, and for how long: rows whole, then stretches.

use std::collections::VecDeque;
use std::sync::Arc;

use crate::columns::Columns;

/// How long rows are kept whole, in ns.
pub(crate) const WHOLE: i64 = 600_000_000_000;
/// How long stretches are kept.
const DAY: i64 = 86_400_000_000_000;
/// How long a stretch is.
pub(crate) const STRETCH: i64 = 10_000_000_000;
/// How many bytes rows take at most.
const BYTES: usize = 32 << 20;

/// All that is kept, by the graphs that gave it, the oldest first.
#[derive(Debug, Default)]
pub(crate) struct Store {
    pub(crate) parts: VecDeque<Part>,
}

/// What one graph gave.
#[derive(Debug)]
pub(crate) struct Part {
    pub(crate) columns: Arc<Columns>,
    pub(crate) rows: Rows,
    pub(crate) stretches: Rows,
    /// The first instant of each stretch, in stretches since 1970.
    pub(crate) buckets: VecDeque<i64>,
    /// How many of the last rows, and of the last stretches, have not been written.
    pub(crate) unwritten: (usize, usize),
}

/// Numbers under each other, with their instants.
#[derive(Debug, Default)]
pub(crate) struct Rows {
    pub(crate) times: VecDeque<i64>,
    values: VecDeque<f64>,
    width: usize,
}

impl Rows {
    fn new(width: usize) -> Self {
        Self {
            width,
            ..Self::default()
        }
    }

    fn push(&mut self, at: i64, values: impl Iterator<Item = f64>) {
        self.times.push_back(at);
        self.values.extend(values);
    }

    fn pop(&mut self) {
        self.times.pop_front();
        self.values.drain(..self.width.min(self.values.len()));
    }

    pub(crate) fn len(&self) -> usize {
        self.times.len()
    }

    /// A value of a row.
    pub(crate) fn value(&self, row: usize, place: usize) -> f64 {
        self.values[row * self.width + place]
    }

    /// All values of a row.
    pub(crate) fn row(&self, row: usize) -> impl Iterator<Item = f64> + '_ {
        let begin = row * self.width;
        self.values.range(begin..begin + self.width).copied()
    }
}

impl Part {
    fn new(columns: Arc<Columns>) -> Self {
        let width = columns.width();
        Self {
            columns,
            rows: Rows::new(width),
            stretches: Rows::new(3 * width),
            buckets: VecDeque::new(),
            unwritten: (0, 0),
        }
    }

    fn push(&mut self, at: i64, values: &[f64]) {
        self.rows.push(at, values.iter().copied());
        self.unwritten.0 += 1;
        let bucket = at.div_euclid(STRETCH);
        let width = values.len();
        if self.buckets.back() != Some(&bucket) || self.stretches.times.back() > Some(&at) {
            let thrice = values.iter().chain(values).chain(values);
            self.stretch(bucket, at, thrice.copied());
            return;
        }
        let begin = self.stretches.values.len() - 3 * width;
        for (place, &value) in values.iter().enumerate() {
            let [lowest, highest, last] = [0, 1, 2].map(|of| begin + of * width + place);
            let kept = &mut self.stretches.values;
            // Of a value and none it is the value.
            kept[lowest] = kept[lowest].min(value);
            kept[highest] = kept[highest].max(value);
            if !value.is_nan() {
                kept[last] = value;
            }
        }
        if let Some(last) = self.stretches.times.back_mut() {
            *last = at;
        }
    }

    fn stretch(&mut self, bucket: i64, last: i64, values: impl Iterator<Item = f64>) {
        self.buckets.push_back(bucket);
        self.stretches.push(last, values);
        self.unwritten.1 += 1;
    }

    /// Lets go of what is older than may be, seen from an instant. Rows go by whole stretches.
    fn shorten(&mut self, now: i64) {
        let is_old = |at: i64, longest: i64| (now - at).abs() > longest;
        let most = BYTES / (size_of::<f64>() * (self.rows.width + 1));
        while let Some(&first) = self.rows.times.front()
            && (is_old(first, WHOLE) || self.rows.len() > most)
        {
            let bucket = first.div_euclid(STRETCH);
            while self.rows.times.front().map(|of| of.div_euclid(STRETCH)) == Some(bucket) {
                self.rows.pop();
            }
        }
        let stretches = (DAY / STRETCH) as usize;
        while let Some(&last) = self.stretches.times.front()
            && (is_old(last, DAY) || self.stretches.len() > stretches)
        {
            self.stretches.pop();
            self.buckets.pop_front();
        }
        self.unwritten.0 = self.unwritten.0.min(self.rows.len());
        self.unwritten.1 = self.unwritten.1.min(self.stretches.len());
    }
}

impl Store {
    /// The part that goes on, of these columns.
    fn part(&mut self, columns: &Arc<Columns>) -> &mut Part {
        let goes_on = self.parts.back().is_some_and(|of| of.columns == *columns);
        if !goes_on {
            self.parts.push_back(Part::new(Arc::clone(columns)));
        }
        let last = self.parts.len() - 1;
        &mut self.parts[last]
    }

    /// Takes a row.
    pub(crate) fn push(&mut self, columns: &Arc<Columns>, at: i64, values: &[f64]) {
        self.part(columns).push(at, values);
        self.parts.iter_mut().for_each(|part| part.shorten(at));
        while self.parts.len() > 1 && self.parts.front().is_some_and(Part::is_empty) {
            self.parts.pop_front();
        }
    }

    /// Takes a stretch as it was written: lowest, highest and last of each channel.
    pub(crate) fn stretch(
        &mut self,
        columns: &Arc<Columns>,
        bucket: i64,
        last: i64,
        values: &[f64],
    ) {
        let part = self.part(columns);
        part.stretch(bucket, last, values.iter().copied());
        part.unwritten.1 = 0;
    }

    /// Takes a row as it was written: its stretch has been, unless it is the last.
    pub(crate) fn row(&mut self, columns: &Arc<Columns>, at: i64, values: &[f64]) {
        let part = self.part(columns);
        let is_in = part.stretches.times.back().is_some_and(|last| *last >= at);
        match is_in {
            true => part.rows.push(at, values.iter().copied()),
            false => part.push(at, values),
        }
        part.unwritten = (0, part.unwritten.1);
    }

    /// Puts what was before in front of what there is.
    pub(crate) fn after(&mut self, mut before: Self) {
        before.parts.append(&mut self.parts);
        *self = before;
    }

    /// The newest instant.
    pub(crate) fn newest(&self) -> Option<i64> {
        let last = |part: &Part| part.stretches.times.back().copied();
        self.parts.iter().rev().find_map(last)
    }

    /// How many rows and stretches there are.
    pub(crate) fn counts(&self) -> (usize, usize) {
        let parts = self.parts.iter();
        parts.fold((0, 0), |(rows, stretches), part| {
            (rows + part.rows.len(), stretches + part.stretches.len())
        })
    }
}

impl Part {
    fn is_empty(&self) -> bool {
        self.stretches.len() == 0
    }
}
