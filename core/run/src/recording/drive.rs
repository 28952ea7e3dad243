//! The one loop: a source through an engine, or through what is built around one.

use super::{Event, Recording, Samples, Source, SourceError};
use crate::engine::{Engine, EngineError};
use crate::time::Instant;

/// What a source can be driven through.
pub trait Steps {
    /// Why an event could not be taken.
    type Error;

    /// Takes an event, with the samples of a row. A row whose time is not after the last one is refused, counted and skipped: false.
    ///
    /// # Errors
    /// What ends the run.
    fn take(&mut self, event: Event, samples: &Samples) -> Result<bool, Self::Error>;
}

impl Steps for Engine {
    type Error = EngineError;

    fn take(&mut self, event: Event, samples: &Samples) -> Result<bool, EngineError> {
        match event {
            Event::Segment => self.segment(),
            Event::Row(time) => match self.step(time, &samples.values) {
                Ok(_) => {}
                Err(EngineError::NotAfter { .. }) => return Ok(false),
                Err(error) => return Err(error),
            },
        }
        Ok(true)
    }
}

/// What came from a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Passed {
    /// Rows that were taken.
    pub ticks: u64,
    /// Segments, at least one.
    pub segments: u64,
    /// The first instant and the last.
    pub period: Option<(Instant, Instant)>,
}

/// Rows of a recording that are read before the first of them is stepped: what reads and what steps each find the caches of the processor
/// as they left them.
pub const AHEAD: usize = 16;

/// Drives a source to its end, so many rows read at a time: one where each is to be answered before the next is there. `look` sees each
/// event that has been taken, before the next is.
///
/// # Errors
/// When the source can give no more, an event cannot be taken, or `look` fails; the rows before it have been taken.
pub fn drive<S: Steps, E: From<SourceError> + From<S::Error>>(
    steps: &mut S,
    source: &mut dyn Source,
    ahead: usize,
    mut look: impl FnMut(&mut S, Event, &Samples) -> Result<(), E>,
) -> Result<Passed, E> {
    let mut rows = vec![Samples::default(); ahead.max(1)];
    let mut read = Vec::with_capacity(rows.len());
    let mut passed = Passed {
        ticks: 0,
        segments: 1,
        period: None,
    };
    loop {
        for samples in &mut rows {
            read.push(source.next(samples));
            if !matches!(read.last(), Some(Ok(Some(_)))) {
                break;
            }
        }
        for (next, samples) in read.drain(..).zip(&rows) {
            let Some(event) = next? else {
                return Ok(passed);
            };
            if !steps.take(event, samples)? {
                continue;
            }
            match event {
                Event::Segment => passed.segments += 1,
                Event::Row(time) => {
                    passed.ticks += 1;
                    let (from, to) = passed.period.unwrap_or((time, time));
                    passed.period = Some((from.min(time), to.max(time)));
                }
            }
            look(steps, event, samples)?;
        }
    }
}

/// Drives a recording through an engine from its beginning to its end.
///
/// # Errors
/// When the recording cannot be read, or is not one of the graph.
pub fn pass(
    engine: &mut Engine,
    recording: &dyn Recording,
    mut look: impl FnMut(&Engine, Event, &Samples),
) -> Result<Passed, SourceError> {
    let mut source = recording.open(engine.plan())?;
    drive(engine, &mut *source, AHEAD, |engine, event, samples| {
        look(engine, event, samples);
        Ok(())
    })
}
