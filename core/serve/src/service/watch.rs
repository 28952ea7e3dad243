//! Sources that are connected and silent: a connection that stands is worth nothing where no data come through it.

use std::sync::Arc;
use std::time::{Duration as Wait, Instant as Clock};

use crate::connector::{SourceCounts, Stop};

/// Looks whether a source gives anything.
#[derive(Debug)]
pub(super) struct Watch {
    silent: Wait,
    counts: Arc<SourceCounts>,
    run: Stop,
    /// The signs of life that have been seen, and since when there was no other.
    seen: (u64, Clock),
}

impl Watch {
    /// One that asks for the end of a source's run once it has been connected and silent for so long.
    pub(super) fn new(silent: Wait, counts: &Arc<SourceCounts>, run: &Stop) -> Self {
        Self {
            silent,
            counts: Arc::clone(counts),
            run: run.clone(),
            seen: (0, Clock::now()),
        }
    }

    /// How often it is to look.
    pub(super) fn every(&self) -> Wait {
        self.silent / 8
    }

    /// Looks; each [`every`](Self::every) is often enough.
    pub(super) fn look(&mut self, now: Clock) {
        let signs = self.counts.signs();
        if signs != self.seen.0 || !self.counts.is_connected() {
            self.seen = (signs, now);
        } else if now.duration_since(self.seen.1) >= self.silent {
            self.seen = (signs, now);
            self.run.ask();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::Ordering;

    use super::*;

    #[test]
    fn a_source_is_asked_to_begin_anew_once_it_is_connected_and_silent_for_long() {
        let (counts, run) = (Arc::<SourceCounts>::default(), Stop::default());
        let mut watch = Watch::new(Wait::from_secs(30), &counts, &run);
        let at = {
            let began = Clock::now();
            move |seconds| began + Wait::from_secs(seconds)
        };
        // Away it may be for as long as it likes.
        (0..1_000).for_each(|second| watch.look(at(second)));
        assert!(!run.is_asked());
        counts.set_connected(true);
        watch.look(at(1_000));
        counts.given.fetch_add(1, Ordering::Relaxed);
        watch.look(at(1_020));
        watch.look(at(1_049));
        assert!(!run.is_asked());
        watch.look(at(1_050));
        assert!(run.is_asked());
        run.withdraw();
        watch.look(at(1_079));
        assert!(!run.is_asked(), "it has as long to begin anew");
    }
}
