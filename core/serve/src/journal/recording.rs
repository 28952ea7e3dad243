//! The journal as a recording: its ticks, for fitting, scoring and reports.

use std::path::{Path, PathBuf};

use athermal_run::recording::{Event, Recording, Samples, Source, SourceError};

use super::{Begin, Entry, JournalError, Log, Record};
use crate::channel::ABSENT;
use crate::compile::Plan;
use crate::sequencer::Timeline;

/// The ticks and beats of a journal, as they were stepped. What came late is not among them.
#[derive(Debug, Clone)]
pub struct JournalRecording {
    folder: PathBuf,
}

impl JournalRecording {
    /// That of a folder.
    ///
    /// # Errors
    /// When there is no journal.
    pub fn new(folder: &Path) -> Result<Self, JournalError> {
        if Log::open(folder)?.is_empty() {
            return Err(JournalError::Unreadable {
                path: folder.to_owned(),
                error: std::io::Error::new(
                    std::io::ErrorKind::NotFound,
                    "there is no journal in this folder",
                ),
            });
        }
        Ok(Self {
            folder: folder.to_owned(),
        })
    }
}

impl Recording for JournalRecording {
    fn open(&self, plan: &Plan) -> Result<Box<dyn Source + '_>, SourceError> {
        let sources = plan.sources.iter();
        Ok(Box::new(Rows {
            log: Log::open(&self.folder)?,
            timeline: None,
            wanted: sources
                .map(|of| (of.name.clone(), of.column.clone()))
                .collect(),
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
                None => return Ok(None),
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
