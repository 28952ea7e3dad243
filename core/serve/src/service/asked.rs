//! What a running service says of itself.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration as Wait;

use athermal_run::live::monitor::Watch;
use athermal_run::model::Card;

use super::{Held, Service, ServiceOptions, SinkCounts, Snapshot, Watcher};
use crate::companion::Beside;
use crate::connector::{Connection, LeftOut, Sink, SinkWiring, SourceCounts};
use crate::facts::Sections;
use crate::figures::unix_seconds;
use crate::folder::StateFolder;
use crate::journal::JournalStatus;
use crate::time::Instant;

/// What became of the samples of a channel since the start.
#[derive(Debug, Clone)]
pub struct ChannelSamples {
    /// The channel.
    pub channel: String,
    /// Its source; none where the machine file names none.
    pub source: Option<String>,
    /// How it is, as its source says; none where that says nothing.
    pub state: Option<String>,
    /// How many were accepted.
    pub accepted: u64,
    /// How many were left out, by reason. Those that are out of range were accepted, and are absent at their ticks.
    pub left_out: [(LeftOut, u64); LeftOut::ALL.len()],
    /// The stamp of the newest that was stepped; [`Instant::MIN`] before the first.
    pub stamp: Instant,
}

impl ChannelSamples {
    /// How many were left out for a reason.
    #[must_use]
    pub fn left_out(&self, reason: LeftOut) -> u64 {
        self.left_out[reason as usize].1
    }
}

impl Service {
    /// What companions are given.
    pub(super) fn beside(
        &self,
        options: &ServiceOptions,
        sinks: Vec<(Arc<dyn Sink>, SinkWiring)>,
    ) -> Beside {
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or(path.to_owned());
        Beside {
            name: self.name.clone(),
            machine: absolute(&options.machine),
            state: absolute(self.folder.path()),
            handle: self.handle(),
            happenings: self.happened,
            sinks,
            observers: self.observers.clone(),
            shared: self.shared_by_companions.clone(),
        }
    }

    /// The name of the machine.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// When the model that runs was fitted, in s since 1970.
    #[must_use]
    pub fn fitted_s(&self) -> Option<f64> {
        unix_seconds(self.card()?.created.as_deref()?)
    }

    /// How the model that runs was fitted, where that is known.
    #[must_use]
    pub fn card(&self) -> Option<&Card> {
        self.cards.get(self.running()?.revision)
    }

    /// What is kept in mind of it.
    #[must_use]
    pub fn watcher(&self) -> &Watcher {
        &self.watcher
    }

    /// What companions know.
    #[must_use]
    pub fn sections(&self) -> Sections {
        let all = self.sections.iter().map(|(name, read)| (*name, read()));
        Sections(all.collect())
    }

    /// How long it has been running.
    #[must_use]
    pub fn uptime(&self) -> Wait {
        self.began.elapsed()
    }

    /// After how many ticks, beats, breaks and freezes the last checkpoint was saved.
    #[must_use]
    pub fn last_checkpoint(&self) -> u64 {
        self.keeper.last()
    }

    /// What the graph keeps of the past; none before there are two checkpoints of this run.
    #[must_use]
    pub fn held(&self) -> Option<Held> {
        self.keeper.held()
    }

    /// The state folder.
    #[must_use]
    pub fn folder(&self) -> &StateFolder {
        &self.folder
    }

    /// How often the engine thread has gone round: it lives for as long as this grows from one call to the next.
    #[must_use]
    pub fn beat(&self) -> u64 {
        self.engine.thread().unpark();
        self.shared.beat.load(Ordering::Relaxed)
    }

    /// What the engine thread knew within the last second or two.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        self.shared.read()
    }

    /// The channels, in the order of [`Snapshot::counts`].
    #[must_use]
    pub fn channels(&self) -> &[String] {
        &self.channels
    }

    /// The sources, and what each counts.
    #[must_use]
    pub fn sources(&self) -> &[(String, Arc<SourceCounts>)] {
        &self.sources
    }

    /// The samples of each channel, in the order of [`channels`](Self::channels): what became of them.
    #[must_use]
    pub fn samples(&self) -> Vec<ChannelSamples> {
        samples(&self.channels, &self.sources, &self.snapshot())
    }

    /// The sources without which the service is not whole: those that have not been connected since it started, and all that are away
    /// where none is connected. It changes nothing of what is put out.
    #[must_use]
    pub fn lacking(&self) -> Vec<&str> {
        let sources = self.sources.iter();
        lacking(sources.map(|(name, of)| (name.as_str(), of.connection())))
    }

    /// Whether anything is not as it should be: the journal cannot be written, a node was given up, a source [lacks](Self::lacking), or it
    /// is not known what runs.
    #[must_use]
    pub fn is_degraded(&self) -> bool {
        let lacks = !self.lacking().is_empty() || self.running().is_none();
        lacks || self.progress.status().is_degraded || !self.given_up().is_empty()
    }

    /// What is watched of the graph that runs, and what was found.
    #[must_use]
    pub fn watched(&self) -> Option<&Watch> {
        self.keeper.look().watched()
    }

    /// The sinks, and what each counts.
    #[must_use]
    pub fn sinks(&self) -> &[(String, Arc<SinkCounts>)] {
        &self.sinks
    }

    /// How the journal is.
    #[must_use]
    pub fn journal(&self) -> JournalStatus {
        self.progress.status()
    }
}

/// What became of the samples of these channels, by what the sources and the engine thread have counted.
pub(super) fn samples(
    channels: &[String],
    sources: &[(String, Arc<SourceCounts>)],
    known: &Snapshot,
) -> Vec<ChannelSamples> {
    let channel = |(place, name): (usize, &String)| {
        let mut sources = sources.iter();
        let source = sources.find_map(|(name, of)| Some((name, of, of.channel(place)?)));
        let counts = known.counts[place];
        let left_out = |reason: LeftOut| {
            let by_source = source.map_or(0, |(_, of, nth)| of.left_out.of(Some(nth), reason));
            let by_engine = match reason {
                LeftOut::Late => counts.late,
                LeftOut::Repeated => counts.twice,
                LeftOut::Future => counts.future,
                LeftOut::Clock => counts.clock,
                LeftOut::OutOfRange => known.outside[place],
                _ => 0,
            };
            by_source + by_engine
        };
        ChannelSamples {
            channel: name.clone(),
            source: source.map(|(name, ..)| name.clone()),
            state: source.and_then(|(_, of, nth)| of.state(nth)),
            accepted: counts.accepted,
            left_out: LeftOut::ALL.map(|reason| (reason, left_out(reason))),
            stamp: known.stamps[place],
        }
    };
    channels.iter().enumerate().map(channel).collect()
}

fn lacking<'a>(sources: impl Iterator<Item = (&'a str, Connection)> + Clone) -> Vec<&'a str> {
    let is_fed = |of| matches!(of, Connection::Connected | Connection::Ended);
    let is_none_there = !sources.clone().any(|(_, of)| is_fed(of));
    let lacks = |of| of == Connection::Never || is_none_there && of == Connection::Away;
    let lacking = sources.filter(|(_, of)| lacks(*of));
    lacking.map(|(name, _)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_service_lacks_what_never_connected_and_all_that_is_away_where_nothing_is_there() {
        use Connection::{Away, Connected, Ended, Never};
        for (one, other, lacks) in [
            (Connected, Connected, &[][..]),
            (Connected, Never, &["b"]),
            (Connected, Away, &[]),
            (Ended, Away, &[]),
            (Away, Away, &["a", "b"]),
            (Never, Away, &["a", "b"]),
        ] {
            let found = lacking([("a", one), ("b", other)].into_iter());
            assert_eq!(found, lacks, "{one:?} {other:?}");
        }
    }
}
