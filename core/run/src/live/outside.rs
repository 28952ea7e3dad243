//! How many samples were accepted and do not count: they are infinite or outside of the range of their signal.

use super::Feed;

use crate::compile::Plan;

/// The counts by channel of the feed, on the engine thread.
#[derive(Debug)]
pub(super) struct Outside {
    feed: Vec<Feed>,
    /// Between which values samples count; none of a channel that the graph does not read.
    ranges: Vec<Option<(f64, f64)>>,
    counts: Vec<u64>,
}

impl Outside {
    pub(super) fn new(feed: &[Feed], plan: &Plan) -> Self {
        let mut outside = Self {
            feed: feed.to_vec(),
            ranges: vec![None; feed.len()],
            counts: vec![0; feed.len()],
        };
        outside.follow(plan);
        outside
    }

    /// Goes by the ranges of another plan. It allocates nothing.
    pub(super) fn follow(&mut self, plan: &Plan) {
        for (range, fed) in self.ranges.iter_mut().zip(&self.feed) {
            *range = fed.source(plan).map(|of| of.range);
        }
    }

    pub(super) fn look(&mut self, row: &[f64]) {
        for ((count, range), &value) in self.counts.iter_mut().zip(&self.ranges).zip(row) {
            let is_outside = |&(lowest, highest): &(f64, f64)| {
                value.is_infinite() || value < lowest || value > highest
            };
            *count += u64::from(range.as_ref().is_some_and(is_outside));
        }
    }

    /// The counts.
    pub(super) fn counts(&self) -> &[u64] {
        &self.counts
    }
}
