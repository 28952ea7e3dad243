//! Decides what an input brings about in a segment, from wherever its filter begins, and how that changes with each coefficient.

use super::Transfer;
use super::polynomials::back;

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
    (driven(f, x, &vec![rest; f.len()]), rest)
}

/// `x/F(q)` after `before`, the oldest first.
fn driven(f: &[f64], x: &[f64], before: &[f64]) -> Vec<f64> {
    if let ([f], [last]) = (f, before) {
        // As below, without looking back in memory.
        let mut last = *last;
        let next = |value: &f64| {
            last = value - f * last;
            last
        };
        return x.iter().map(next).collect();
    }
    let mut filtered = before.to_vec();
    filtered.reserve(x.len());
    for value in x {
        filtered.push(value - back(f, &filtered));
    }
    filtered.drain(..f.len());
    filtered
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
        let mut whole = vec![0.0; count];
        for (j, b) in transfer.b.iter().enumerate() {
            let (before, after) = whole.split_at_mut((transfer.delay + j).min(count));
            before.iter_mut().for_each(|sum| *sum += b * of_b.1);
            let both = after.iter_mut().zip(&of_b.0);
            both.for_each(|(sum, value)| *sum += b * value);
        }
        let rest = transfer.b.iter().sum::<f64>() * of_b.1;
        let of_f = if derive {
            through(f, &whole, rest)
        } else {
            (Vec::new(), rest)
        };
        let mut start_by_f = Vec::new();
        if start.iter().any(|&by| by != 0.0) {
            // From the oldest of what the filter gave before the first sample.
            let mut from_start: Vec<f64> = start.iter().rev().copied().collect();
            from_start.extend(driven(f, &vec![0.0; count], &from_start));
            let derived = if derive { f.len() } else { 0 };
            for lag in 1..=derived {
                let late = from_start[f.len() - lag..][..count].iter();
                let late: Vec<f64> = late.map(|value| -value).collect();
                start_by_f.push(through(f, &late, 0.0).0);
            }
            let both = whole.iter_mut().zip(&from_start[f.len()..]);
            both.for_each(|(whole, from_start)| *whole += from_start);
        }
        Self {
            delay: transfer.delay,
            nb: transfer.b.len(),
            nf: f.len(),
            of_b,
            of_f,
            whole,
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
}
