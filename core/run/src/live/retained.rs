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
    /// How many events there are from the last segment break on, the break not counted; all where there is none.
    since_break: usize,
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
            since_break: 0,
        }
    }

    /// Keeps so much of the past from now on.
    pub(super) fn keep(&mut self, span: Duration) {
        self.span = span;
    }

    pub(super) fn push(&mut self, time: Instant, samples: &[f64]) {
        self.times.push_back(Some(time));
        self.samples.extend(samples);
        self.since_break += 1;
        self.shorten(time);
    }

    /// What follows belongs to another segment.
    pub(super) fn segment(&mut self) {
        if self.times.back() == Some(&None) {
            return;
        }
        self.times.push_back(None);
        self.samples
            .extend(std::iter::repeat_n(f64::NAN, self.width));
        self.since_break = 0;
    }

    pub(super) fn clear(&mut self) {
        self.times.clear();
        self.samples.clear();
        self.since_break = 0;
    }

    /// How much of the past there is, over all segments.
    pub(super) fn span(&self) -> Duration {
        let mut before = None;
        let mut span = Duration::ZERO;
        for time in &self.times {
            if let (Some(before), Some(time)) = (before, *time) {
                span += time - before;
            }
            before = *time;
        }
        span
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
        let begin = self.times.len() - self.since_break;
        // Older segments go once the present one alone is long enough; their clocks say nothing about its own.
        if begin > 0
            && matches!(self.times.get(begin), Some(Some(first)) if now - *first >= self.span)
        {
            self.drop_first(begin);
        }
        while self.times.len() > self.most
            || self.times.len() == self.since_break
                && matches!(self.times.get(1), Some(Some(second)) if now - *second >= self.span)
        {
            self.drop_first(1);
        }
    }

    fn drop_first(&mut self, ticks: usize) {
        self.times.drain(..ticks);
        self.samples.drain(..ticks * self.width);
        self.since_break = self.since_break.min(self.times.len());
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

    #[test]
    fn a_segment_is_kept_until_the_next_one_is_long_enough_whatever_their_clocks_say() {
        for begin in [-100_000, 0, 100_000] {
            let mut retained = Retained::new(1, d(100), 1 << 20);
            for t in 0..50 {
                retained.push(s(begin + t), &[t as f64]);
            }
            retained.segment();
            for t in 0..100 {
                retained.push(s(t), &[t as f64]);
            }
            assert_eq!(retained.span(), d(49 + 99), "a segment from {begin} s");
            retained.push(s(100), &[100.0]);
            assert_eq!(retained.span(), d(100));
            retained.push(s(101), &[101.0]);
            assert_eq!(retained.times.len(), 101);
        }
    }
}
