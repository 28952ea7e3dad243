//! A recording in memory.

use super::{Event, Recording, Samples, Source, SourceError};
use crate::compile::Plan;
use crate::engine::EngineError;
use crate::time::Instant;

/// A recording in memory.
#[derive(Debug, Clone, Default)]
pub struct Table {
    events: Vec<(Event, Vec<f64>)>,
}

impl Table {
    /// Adds a row: a value for each of [`Plan::sources`], NaN where a channel has none. A table with a row of another width cannot be
    /// opened.
    pub fn push(&mut self, time: Instant, values: &[f64]) {
        self.events.push((Event::Row(time), values.to_vec()));
    }

    /// Starts another segment.
    pub fn segment(&mut self) {
        self.events.push((Event::Segment, Vec::new()));
    }

    /// Reads another recording into memory.
    ///
    /// # Errors
    /// As its rows.
    pub fn read(recording: &dyn Recording, plan: &Plan) -> Result<Self, SourceError> {
        let whole = Self::read_up_to(recording, plan, usize::MAX)?;
        Ok(whole.unwrap_or_default())
    }

    /// The same of so many rows at most; none where there are more.
    ///
    /// # Errors
    /// As its rows.
    pub fn read_up_to(
        recording: &dyn Recording,
        plan: &Plan,
        rows: usize,
    ) -> Result<Option<Self>, SourceError> {
        let mut table = Self::default();
        let mut source = recording.open(plan)?;
        let mut samples = Samples::default();
        while let Some(event) = source.next(&mut samples)? {
            match event {
                Event::Row(_) if table.events.len() == rows => return Ok(None),
                Event::Row(time) => table.push(time, &samples.values),
                Event::Segment => table.segment(),
            }
        }
        Ok(Some(table))
    }

    /// The events, each with the values of its row.
    #[must_use]
    pub fn events(&self) -> &[(Event, Vec<f64>)] {
        &self.events
    }

    /// The events, to be changed.
    pub fn events_mut(&mut self) -> &mut [(Event, Vec<f64>)] {
        &mut self.events
    }
}

impl Recording for Table {
    fn open(&self, plan: &Plan) -> Result<Box<dyn Source + '_>, SourceError> {
        let expected = plan.sources.len();
        let mut rows = self.events.iter();
        match rows.find(|(event, row)| *event != Event::Segment && row.len() != expected) {
            Some((_, row)) => {
                let found = row.len();
                Err(EngineError::WrongWidth { found, expected }.into())
            }
            None => Ok(Box::new(self.events.iter())),
        }
    }
}

impl Source for std::slice::Iter<'_, (Event, Vec<f64>)> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        let next = Iterator::next(self).map(|(event, row)| {
            if *event != Event::Segment {
                samples.values.clone_from(row);
            }
            *event
        });
        Ok(next)
    }
}
