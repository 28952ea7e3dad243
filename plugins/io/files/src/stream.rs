//! Files as source and sink of a run: rows in, rows out.

use athermal_core::time::Instant;
use athermal_run::live::{Frame, Sink, SinkError};
use athermal_run::recording::{Event, Samples, Source, SourceError};

use crate::{FileError, Reader, Row, Writer};

/// What comes next, its row read into the room that samples have; none at the end.
pub(crate) fn next_of(
    samples: &mut Samples,
    next: impl FnOnce(&mut Row) -> Result<crate::Event, FileError>,
) -> Result<Option<Event>, FileError> {
    let mut row = Row {
        time_text: std::mem::take(&mut samples.time_text),
        values: std::mem::take(&mut samples.values),
        ..Row::default()
    };
    let event = next(&mut row)?;
    (samples.time_text, samples.values) = (row.time_text, row.values);
    Ok(match event {
        crate::Event::Row => Some(Event::Row(Instant::from_ns(row.time_ns))),
        crate::Event::Segment => Some(Event::Segment),
        crate::Event::End => None,
    })
}

impl Source for Reader {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        Ok(next_of(samples, |row| self.next_event(row))?)
    }
}

impl Sink for Writer {
    fn put(&mut self, frame: &Frame<'_>) -> Result<(), SinkError> {
        Ok(self.write_row(frame.time_text, frame.time.as_ns(), frame.outputs)?)
    }

    fn flush(&mut self) -> Result<(), SinkError> {
        Ok(self.make_last()?)
    }

    fn finish(&mut self) -> Result<(), SinkError> {
        Ok(self.end()?)
    }
}

/// A writer whose last column is the revision of the graph that made each row.
pub struct WithRevision(pub Writer);

impl Sink for WithRevision {
    fn put(&mut self, frame: &Frame<'_>) -> Result<(), SinkError> {
        let Self(writer) = self;
        let (text, time) = (frame.time_text, frame.time.as_ns());
        Ok(writer.write_labelled_row(text, time, frame.outputs, frame.revision)?)
    }

    fn flush(&mut self) -> Result<(), SinkError> {
        self.0.flush()
    }

    fn finish(&mut self) -> Result<(), SinkError> {
        Sink::finish(&mut self.0)
    }
}
