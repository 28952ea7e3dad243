//! Which rows of a source the run before has seen.

use super::{Report, Reporter};
use crate::recording::{Event, Samples};
use crate::time::{Duration, Instant};

/// Rows up to the last one that the run before had seen are skipped.
#[derive(Debug, Default)]
pub(super) struct Restart {
    /// The last instant that the run before had seen.
    pub(super) seen: Option<Instant>,
    /// The last of which its output has a row.
    pub(super) written: Option<Instant>,
    /// How many rows nothing came of so far.
    skipped: u64,
    /// How long the last of them was before the last of the run before.
    before: Duration,
}

impl Restart {
    /// Whether an event is one that the run before had seen. Rows that it wrote and whose state is lost are stepped, and reported.
    pub(super) fn skips(
        &mut self,
        event: Event,
        samples: &Samples,
        reporter: &dyn Reporter,
    ) -> bool {
        let Event::Row(time) = event else {
            self.seen = None;
            return false;
        };
        if self.seen.is_some_and(|seen| time <= seen) {
            let last = self.seen.max(self.written).unwrap_or(time);
            self.skip(samples, last - time, reporter);
            return true;
        }
        self.seen = None;
        match self.written.filter(|written| time <= *written) {
            Some(written) => self.skip(samples, written - time, reporter),
            None => (self.written, self.skipped) = (None, 0),
        }
        false
    }

    fn skip(&mut self, samples: &Samples, before: Duration, reporter: &dyn Reporter) {
        self.skipped += 1;
        self.before = before;
        let rows = self.skipped;
        let is_first = rows == 1 && self.seen.is_some();
        // 10, 100, 1,000 and so on: where the clock has been set back, it goes on for as long as that.
        if is_first || rows >= 10 && 10_u64.pow(rows.ilog10()) == rows {
            let time = samples.time_text.clone();
            reporter.report(Report::Skipped { rows, time, before });
        }
    }

    /// Reports a source that has come to its end while all of it was skipped: a clock may once have been ahead.
    pub(super) fn end(&self, reporter: &dyn Reporter) {
        if self.skipped > 0 {
            let before = self.before;
            reporter.report(Report::AllSkipped { before });
        }
    }
}
