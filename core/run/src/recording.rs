//! Decides what a data set offers to fitting and scoring; files and formats are the business of plugins.

use crate::compile::Plan;
use crate::engine::EngineError;
use crate::time::Instant;

/// What went wrong while reading a recording; its text says what, where and what to do.
pub type RecordingError = Box<dyn std::error::Error + Send + Sync>;

/// A data set that can be read from its beginning as often as needed.
pub trait Recording {
    /// Starts reading the channels of a plan.
    ///
    /// # Errors
    /// When the data cannot be read or lack a channel.
    fn open(&self, plan: &Plan) -> Result<Box<dyn Rows + '_>, RecordingError>;
}

/// The rows of a recording, in order.
pub trait Rows {
    /// The next event. A row's values are written in the order of [`Plan::sources`], NaN where a channel has none.
    ///
    /// # Errors
    /// When the data cannot be read any further.
    fn next(&mut self, values: &mut [f64]) -> Result<Option<Event>, RecordingError>;
}

/// What comes next in a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// A row.
    Row(Instant),
    /// The rows that follow belong to another segment, whose times may start again.
    Segment,
}

/// A recording in memory.
#[derive(Debug, Clone, Default)]
pub struct Table {
    events: Vec<(Event, Vec<f64>)>,
}

impl Table {
    /// Adds a row: a value for each of [`Plan::sources`], NaN where a channel has none. One with more or fewer is told when it is
    /// read.
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
    pub fn read(recording: &dyn Recording, plan: &Plan) -> Result<Self, RecordingError> {
        let mut table = Self::default();
        let mut rows = recording.open(plan)?;
        let mut values = vec![f64::NAN; plan.sources.len()];
        while let Some(event) = rows.next(&mut values)? {
            let row = if matches!(event, Event::Row(_)) {
                values.clone()
            } else {
                Vec::new()
            };
            table.events.push((event, row));
        }
        Ok(table)
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
    fn open(&self, _plan: &Plan) -> Result<Box<dyn Rows + '_>, RecordingError> {
        Ok(Box::new(self.events.iter()))
    }
}

impl Rows for std::slice::Iter<'_, (Event, Vec<f64>)> {
    fn next(&mut self, values: &mut [f64]) -> Result<Option<Event>, RecordingError> {
        let Some((event, row)) = Iterator::next(self) else {
            return Ok(None);
        };
        if matches!(event, Event::Row(_)) {
            let (found, expected) = (row.len(), values.len());
            if found != expected {
                return Err(EngineError::WrongWidth { found, expected }.into());
            }
            values.copy_from_slice(row);
        }
        Ok(Some(*event))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_another_width_is_told_and_not_filled_up_with_the_one_before() {
        for row in [&[1.0][..], &[1.0, 2.0, 3.0]] {
            let mut table = Table::default();
            table.push(Instant::from_ns(0), &[1.0, 2.0]);
            table.segment();
            table.push(Instant::from_ns(1), row);
            let mut rows = table.events.iter();
            let mut values = [f64::NAN; 2];
            for _ in 0..2 {
                assert!(Rows::next(&mut rows, &mut values).unwrap().is_some());
            }
            let told = Rows::next(&mut rows, &mut values).unwrap_err().to_string();
            assert!(told.contains("values were given"), "{told}");
        }
    }
}
