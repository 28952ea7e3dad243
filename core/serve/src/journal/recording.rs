//! The journal as a recording: its ticks, for fitting, scoring and reports.

use std::io;
use std::path::{Path, PathBuf};

use athermal_run::model::content_of;
use athermal_run::recording::{Event, Recording, Samples, Source, SourceError};

use super::log::files;
use super::{Begin, Entry, JournalError, Log, Record};
use crate::channel::ABSENT;
use crate::compile::Plan;
use crate::engine::fnv_1a;
use crate::sequencer::Timeline;

/// The ticks and beats of a journal, as they were stepped. What came late is not among them.
#[derive(Debug, Clone)]
pub struct JournalRecording {
    folder: PathBuf,
}

impl JournalRecording {
    /// That of a state folder, or of the folder of a journal itself. Whether there is one is found when it is opened.
    #[must_use]
    pub fn in_state(folder: &Path) -> Self {
        let journal = folder.join("journal");
        let folder = if journal.is_dir() {
            journal
        } else {
            folder.to_owned()
        };
        Self { folder }
    }
}

impl JournalRecording {
    /// The length of all its files in bytes and a checksum of their content, as [`content_of`] gives them for one.
    ///
    /// # Errors
    /// When a file cannot be read.
    pub fn content(&self) -> std::io::Result<(u64, String)> {
        let files = files(&self.folder).map_err(std::io::Error::other)?;
        let (mut bytes, mut hashes) = (0, String::new());
        for (_, path) in files {
            let (length, hash) = content_of(&path)?;
            bytes += length;
            hashes += &hash;
        }
        Ok((bytes, format!("{:016x}", fnv_1a(hashes.as_bytes()))))
    }
}

impl Recording for JournalRecording {
    fn open(&self, plan: &Plan) -> Result<Box<dyn Source + '_>, SourceError> {
        let log = Log::open(&self.folder)?;
        if log.is_empty() {
            let error = io::Error::new(
                io::ErrorKind::NotFound,
                "there is no journal in this folder",
            );
            let path = self.folder.clone();
            return Err(JournalError::Unreadable { path, error }.into());
        }
        let sources = plan.sources.iter();
        let required = sources.clone().filter(|of| !of.optional);
        Ok(Box::new(Rows {
            log,
            timeline: None,
            wanted: sources
                .map(|of| (of.name.clone(), of.column.clone()))
                .collect(),
            missing: required.map(|of| of.name.clone()).collect(),
            places: Vec::new(),
            gaps: 0,
        }))
    }
}

struct Rows {
    log: Log,
    /// None before the first file.
    timeline: Option<Timeline>,
    wanted: Vec<(String, String)>,
    /// Of the wanted channels, those that no file has had so far and that the graph needs.
    missing: Vec<String>,
    /// Where each wanted channel stands in the feed.
    places: Vec<Option<usize>>,
    gaps: usize,
}

impl Rows {
    /// A file begins. True where records are missing before it.
    fn begin(&mut self, begin: &Begin) -> bool {
        let channels = &begin.feed.channels;
        let place = |wanted| channels.iter().position(|of| of == wanted);
        self.places = self.wanted.iter().map(place).collect();
        self.missing
            .retain(|name| !channels.iter().any(|(of, _)| of == name));
        let gaps = self.log.gaps().len();
        let has_gap = gaps > std::mem::replace(&mut self.gaps, gaps);
        if has_gap || self.timeline.is_none() {
            self.timeline = Some(begin.timeline());
        }
        has_gap
    }
}

impl Source for Rows {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        loop {
            let record = match self.log.read()? {
                None if self.missing.is_empty() => return Ok(None),
                None => {
                    let names = self.missing.join("`, `");
                    return Err(format!("the journal has no `{names}`").into());
                }
                Some(Entry::Begin(begin)) => {
                    if self.begin(&begin) {
                        return Ok(Some(Event::Segment));
                    }
                    continue;
                }
                Some(Entry::Record(_, record)) => record,
            };
            let Some(timeline) = &mut self.timeline else {
                continue;
            };
            match record {
                Record::Tick { at, .. } | Record::Beat { at, .. } => {
                    let row = timeline.tick(at);
                    let value = |place: &Option<usize>| place.map_or(ABSENT, |place| row[place]);
                    samples.time_text.clear();
                    samples.values.clear();
                    samples.values.extend(self.places.iter().map(value));
                    return Ok(Some(Event::Row(at)));
                }
                Record::Break { .. } => {
                    record.apply(timeline);
                    return Ok(Some(Event::Segment));
                }
                _ => record.apply(timeline),
            }
        }
    }
}
