//! Files as source and sink of a run: rows in, rows out; what a row looks like is decided by reader and writer.

use athermal_core::live::{Frame, Samples, Sink, SinkError, Source, SourceError};
use athermal_core::recording::Event;
use athermal_core::time::Instant;

use crate::{Reader, Row, Writer};

impl Source for Reader {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        let mut row = match self.waiting.take() {
            Some(waiting) => waiting,
            None => {
                let mut row = Row {
                    time_text: std::mem::take(&mut samples.time_text),
                    values: std::mem::take(&mut samples.values),
                    ..Row::default()
                };
                if !self.next_into(&mut row)? {
                    return Ok(None);
                }
                row
            }
        };
        if std::mem::take(&mut row.begins_segment) {
            self.waiting = Some(row);
            return Ok(Some(Event::Segment));
        }
        (samples.time_text, samples.values) = (row.time_text, row.values);
        Ok(Some(Event::Row(Instant::from_ns(row.time_ns))))
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
        Ok(self.flush_all()?)
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
