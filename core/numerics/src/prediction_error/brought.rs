//! Decides what an input brings about in a segment, from wherever its filter begins, and how that changes with each coefficient.

use super::Transfer;

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

/// What a filter that is left to itself goes on from: what it gave before the first sample, the newest first.
fn left_alone(f: &[f64], before: &[f64], count: usize) -> Vec<f64> {
    let mut left: Vec<f64> = Vec::with_capacity(count);
    for sample in 0..count {
        let past = |lag: usize| match sample.checked_sub(lag) {
            Some(sample) => left[sample],
            None => before[lag - sample - 1],
        };
        let sum: f64 = f.iter().enumerate().map(|(j, f)| f * past(j + 1)).sum();
        left.push(-sum);
    }
    left
}

/// An input of a segment on its way through the model.
pub(super) struct Brought {
    delay: usize,
    nb: usize,
    nf: usize,
    /// `u/F`, what `b` is multiplied with.
    of_b: (Vec<f64>, f64),
    /// `w/F`, what `f` is.
    of_f: (Vec<f64>, f64),
    /// `w = B/F u`.
    pub(super) whole: Vec<f64>,
    /// What each of the values that the filter gave before the first sample leads to, per unit.
    pub(super) of_start: Vec<Vec<f64>>,
    /// How what they lead to changes with each `f`.
    start_by_f: Vec<Vec<f64>>,
}

impl Brought {
    /// `start` says by how much what the filter gave before the first sample is off from what it had given had the input always
    /// been what it was first, the newest first.
    pub(super) fn new(transfer: &Transfer, input: &[f64], start: &[f64], derive: bool) -> Self {
        let (count, f) = (input.len(), &transfer.f);
        let first = input.first().copied().unwrap_or(0.0);
        let of_b = through(f, input, first);
        let past = Past {
            values: &of_b.0,
            before: of_b.1,
        };
        let whole = |sample| {
            let b = transfer.b.iter().enumerate();
            b.map(|(j, b)| b * past.at(sample, transfer.delay + j))
                .sum()
        };
        let mut whole: Vec<f64> = (0..count).map(whole).collect();
        let rest = transfer.b.iter().sum::<f64>() * of_b.1;
        let of_f = if derive {
            through(f, &whole, rest)
        } else {
            (Vec::new(), rest)
        };
        let unit = |nth: usize| (0..f.len()).map(move |other| f64::from(u8::from(other == nth)));
        let of_start = (0..f.len()).map(|nth| left_alone(f, &unit(nth).collect::<Vec<_>>(), count));
        let of_start: Vec<Vec<f64>> = of_start.collect();
        let mut start_by_f = Vec::new();
        if start.iter().any(|&by| by != 0.0) {
            let from_start = left_alone(f, start, count);
            let derived = if derive { f.len() } else { 0 };
            for lag in 1..=derived {
                let driven = (0..count).map(|sample| match sample.checked_sub(lag) {
                    Some(sample) => -from_start[sample],
                    None => -start[lag - sample - 1],
                });
                start_by_f.push(through(f, &driven.collect::<Vec<_>>(), 0.0).0);
            }
            let both = whole.iter_mut().zip(&from_start);
            both.for_each(|(whole, from_start)| *whole += from_start);
        }
        Self {
            delay: transfer.delay,
            nb: transfer.b.len(),
            nf: f.len(),
            of_b,
            of_f,
            whole,
            of_start,
            start_by_f,
        }
    }

    /// Puts down how the noise changes with each `b` and `f`.
    pub(super) fn derive(&self, sample: usize, put: &mut impl FnMut(f64)) {
        let past = |of: &(Vec<f64>, f64), lag| {
            let (values, before) = (&of.0, of.1);
            Past { values, before }.at(sample, lag)
        };
        (0..self.nb).for_each(|j| put(-past(&self.of_b, self.delay + j)));
        for j in 1..=self.nf {
            let by_start = self.start_by_f.get(j - 1).map_or(0.0, |of| of[sample]);
            put(past(&self.of_f, j) - by_start);
        }
    }

    /// Puts down how the noise changes with what the filter gave before the first sample.
    pub(super) fn derive_by_start(&self, sample: usize, put: &mut impl FnMut(f64)) {
        self.of_start.iter().for_each(|of| put(-of[sample]));
    }
}
