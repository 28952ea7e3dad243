//! Decides how much of the past is kept for warming up new graphs.

use std::collections::VecDeque;

use crate::time::{Duration, Instant};

/// The ticks of the recent past, in order.
#[derive(Debug)]
pub(super) struct Retained {
    width: usize,
    span: Duration,
    most: usize,
    times: VecDeque<Option<Instant>>,
    samples: VecDeque<f64>,
}

impl Retained {
    /// Keeps `span` of the past of `width` channels, and no more than `memory` bytes.
    pub(super) fn new(width: usize, span: Duration, memory: usize) -> Self {
        let each = size_of::<Option<Instant>>() + width * size_of::<f64>();
        Self {
            width,
            span,
            most: (memory / each).max(1),
            times: VecDeque::new(),
            samples: VecDeque::new(),
        }
    }

    /// Keeps so much of the past from now on.
    pub(super) fn keep(&mut self, span: Duration) {
        self.span = span;
    }

    pub(super) fn push(&mut self, time: Instant, samples: &[f64]) {
        self.times.push_back(Some(time));
        self.samples.extend(samples);
        self.shorten(time);
    }

    /// What follows belongs to another segment.
    pub(super) fn segment(&mut self) {
        self.times.push_back(None);
        self.samples
            .extend(std::iter::repeat_n(f64::NAN, self.width));
    }

    pub(super) fn clear(&mut self) {
        self.times.clear();
        self.samples.clear();
    }

    /// How much of the past there is.
    pub(super) fn span(&self) -> Duration {
        let mut known = self.times.iter().flatten();
        match (known.next(), known.next_back()) {
            (Some(&first), Some(&last)) => last - first,
            _ => Duration::ZERO,
        }
    }

    /// The events, oldest first: the instant (none for a segment break) and the samples.
    pub(super) fn for_each(&self, mut look: impl FnMut(Option<Instant>, &[f64])) {
        let mut row = vec![f64::NAN; self.width];
        let mut samples = self.samples.iter();
        for &time in &self.times {
            for (value, &sample) in row.iter_mut().zip(samples.by_ref()) {
                *value = sample;
            }
            look(time, &row);
        }
    }

    fn shorten(&mut self, now: Instant) {
        // An older segment goes once the present one alone is long enough.
        if let Some(last_break) = self.times.iter().rposition(Option::is_none)
            && let Some(Some(begin)) = self.times.get(last_break + 1)
            && now - *begin >= self.span
        {
            self.drop_first(last_break + 1);
        }
        while self.times.len() > self.most
            || matches!(self.times.get(1), Some(Some(second)) if *second <= now && now - *second >= self.span)
        {
            self.drop_first(1);
        }
    }

    fn drop_first(&mut self, ticks: usize) {
        self.times.drain(..ticks);
        self.samples.drain(..ticks * self.width);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn s(seconds: i64) -> Instant {
        Instant::from_ns(seconds * 1_000_000_000)
    }

    fn d(seconds: i64) -> Duration {
        Duration::from_ns(seconds * 1_000_000_000)
    }

    #[test]
    fn the_stated_span_is_kept_and_not_much_more() {
        let mut retained = Retained::new(1, d(100), 1 << 20);
        for t in 0..10_000 {
            retained.push(s(t), &[t as f64]);
        }
        assert_eq!(retained.span(), d(100));
        let mut first = None;
        retained.for_each(|time, row| {
            first.get_or_insert((time, row[0]));
        });
        assert_eq!(first, Some((Some(s(9899)), 9899.0)));
    }

    #[test]
    fn memory_is_bounded_whatever_the_span() {
        let mut retained = Retained::new(10, d(1_000_000), 96 * 50);
        for t in 0..10_000 {
            retained.push(s(t), &[0.0; 10]);
        }
        assert_eq!(retained.times.len(), 50);
    }
}
