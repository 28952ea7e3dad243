//! What is watched of the graph that runs, on the control thread: the engine thread has no part in it.

use super::Control;
use crate::engine::SampleRange;
use crate::live::TickView;
use crate::live::monitor::{Finding, Monitor, Watch};
use crate::time::Instant;

/// What is watched, and what was found and not yet taken.
#[derive(Default)]
pub(super) struct Watching {
    watch: Option<Watch>,
    new: Vec<Finding>,
    found: Vec<(Instant, Finding)>,
}

impl Watching {
    pub(super) fn row(&mut self, time: Instant, samples: &[f64]) {
        if let Some(watch) = &mut self.watch {
            watch.row(time, samples, &mut self.new);
            self.keep(time);
        }
    }

    pub(super) fn stepped(&mut self, tick: &TickView<'_>) {
        if let Some(watch) = &mut self.watch {
            watch.stepped(tick, &mut self.new);
            self.keep(tick.at);
        }
    }

    /// Whether what is found next takes more of the graph than is mirrored.
    pub(super) fn looks_inside(&self) -> bool {
        self.watch.as_ref().is_some_and(Watch::looks_inside)
    }

    pub(super) fn segment(&mut self) {
        self.watch.iter_mut().for_each(Monitor::segment);
    }

    fn keep(&mut self, time: Instant) {
        let new = self.new.drain(..);
        self.found.extend(new.map(|of| (time, of)));
    }
}

impl Control {
    /// Watches the graph that runs from now on. `usual` is where samples lay in its fit.
    pub fn watch(&mut self, usual: &[SampleRange]) {
        if let Some(replica) = &mut self.replica {
            replica.usual = usual.to_vec();
        }
        let watch = Watch::new(&self.running, &self.running.sources, usual);
        self.watching.watch = Some(watch);
    }

    /// What is watched; none where nothing is.
    #[must_use]
    pub fn watched(&self) -> Option<&Watch> {
        self.watching.watch.as_ref()
    }

    /// What was found since the last call, with the instants of the ticks.
    pub fn found(&mut self) -> Vec<(Instant, Finding)> {
        std::mem::take(&mut self.watching.found)
    }

    /// No tick follows: what is only known then is found.
    pub fn end_watch(&mut self) {
        let last = self.last.unwrap_or(Instant::MIN);
        let watching = &mut self.watching;
        if let (Some(watch), Some(replica)) = (&mut watching.watch, &self.replica) {
            watch.end(&replica.engine, &mut watching.new);
            watching.keep(last);
        }
    }

    /// Another graph has taken over.
    pub(super) fn watch_on(&mut self, time: Instant) {
        let usual = self.replica.as_ref().map_or(&[][..], |of| &of.usual);
        let watching = &mut self.watching;
        if let Some(watch) = &mut watching.watch {
            watch.follow(&self.running, &self.feed, usual, &mut watching.new);
            watching.keep(time);
        }
    }
}
