//! How long a service waits, and how it ends.

use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use std::time::{Duration as Wait, Instant as Clock};

use super::asked::samples;
use super::engine_thread::Request;
use super::watch::Watch;
use super::{ChannelSamples, Service, ServiceError, ServiceEvent, ServiceHandle};
use crate::journal::JournalStatus;
use crate::moment::Moment;

/// What comes within so long is taken in together.
const TOGETHER: Wait = Wait::from_millis(50);
/// How often is looked at what wakes nobody.
const LOOK: Wait = Wait::from_secs(1);
/// How long the threads may take to end.
const ENDS: Wait = Wait::from_secs(5);

/// What is left of a service that has ended.
#[derive(Debug)]
pub struct Ended {
    /// What became of the samples of each channel.
    pub channels: Vec<ChannelSamples>,
    /// How many ticks samples made since the start.
    pub ticks: u64,
    /// How many ticks, beats, breaks and freezes there were, those of earlier runs included.
    pub happenings: u64,
    /// How many ticks were cut early because too many samples waited.
    pub hurried: u64,
    /// How the journal is.
    pub journal: JournalStatus,
    /// Whether the engine could not go on.
    pub has_failed: bool,
}

impl Service {
    /// Waits until [`pump`](Self::pump) has something to do. For the thread that started the service, which others may unpark; any other
    /// one looks now and then.
    pub fn wait(&mut self) {
        let is_at_rest = !self.is_asked_to_end
            && !self.shared.has_ended.load(Ordering::Acquire)
            && self.control.id() == std::thread::current().id();
        if is_at_rest {
            let watches = self.watches.iter().map(Watch::every);
            let due = watches.fold(self.keeper.due(), Wait::min);
            std::thread::park_timeout(due.min(LOOK));
        }
        // However fast it comes.
        std::thread::sleep(TOGETHER.saturating_sub(self.waited.elapsed()));
        self.waited = Clock::now();
    }

    /// Whether all sources have come to their ends and their rows are put out, the engine cannot go on, or the end was asked for. A
    /// sink that does not get on is not waited for; it has its rows at the next start.
    #[must_use]
    pub fn is_over(&self) -> bool {
        let is_put = || self.sink_threads.iter().all(JoinHandle::is_finished);
        self.is_asked_to_end
            || self.engine.is_finished() && (is_put() || self.put.1.elapsed() >= ENDS)
    }

    /// Asks for the end: whoever runs the service stops it.
    pub fn ask_to_end(&mut self, by: &str) {
        self.note(&format!("{by}: asked for the end"));
        self.is_asked_to_end = true;
    }

    /// Ends: what waits is stepped, rows are put out, the journal is synced, and a checkpoint is taken.
    ///
    /// # Errors
    /// When the last checkpoint cannot be written. Everything is in the journal all the same.
    pub fn stop(mut self) -> Result<(Ended, Vec<ServiceEvent>), ServiceError> {
        // Whoever still asks is answered that it has ended.
        drop(std::mem::replace(&mut self.asked, ServiceHandle::new().1));
        self.companions.clear();
        self.stop_sources.ask();
        self.request(Request::Stop);
        let mut events = Vec::new();
        let began = Clock::now();
        while !self.engine.is_finished() && began.elapsed() < ENDS {
            events.extend(self.pump());
            std::thread::sleep(Wait::from_millis(2));
        }
        // What came last, where the engine ended before anybody looked.
        events.extend(self.pump());
        self.keeper.control().end_watch();
        let found: Vec<_> = self.found().collect();
        self.observers.events(&found);
        events.extend(found);
        let graph = self.engine.is_finished().then(|| self.engine.join());
        let mut has_failed = self.has_failed;
        let mut snapshot = self.shared.read();
        if let Some(Ok(mut graph)) = graph {
            self.keeper.control().needs_replica();
            graph.rest();
            graph.facts(&mut snapshot, Moment::START);
            graph.into_parts().2.finish();
        } else {
            has_failed = true;
        }
        let ended = |thread: &JoinHandle<()>| thread.is_finished();
        while !self.sink_threads.iter().all(ended) && began.elapsed() < ENDS {
            std::thread::sleep(Wait::from_millis(2));
        }
        self.stop_sinks.ask();
        events.extend(self.events.try_iter());
        let ended = Ended {
            channels: samples(&self.channels, &self.sources, &snapshot),
            ticks: snapshot.ticks,
            happenings: snapshot.happenings,
            hurried: snapshot.hurried,
            journal: self.progress.status(),
            has_failed,
        };
        if !has_failed {
            self.keeper.finish()?;
        }
        // A source that does not stop does not keep the program from ending.
        drop(self.source_threads);
        Ok((ended, events))
    }
}
