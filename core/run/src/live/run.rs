//! An engine from a source to a sink, on one thread, without a session.

use std::fmt;

use super::{Frame, Sink, SinkError, StageError, StateError};
use crate::engine::{Engine, EngineError, RestoreError};
use crate::recording::{Event, Source, SourceError, drive};

/// Steps an engine through all that a source gives, and puts out what comes of it.
///
/// Each row is answered before the next is read. Rows whose timestamp does not increase are skipped and counted.
///
/// # Errors
/// When the source, the sink or the engine fails.
pub fn run(
    engine: &mut Engine,
    source: &mut dyn Source,
    sink: &mut dyn Sink,
) -> Result<(), RunError> {
    let revision = engine.revision().to_owned();
    let ended = drive(engine, source, 1, |engine, event, samples| {
        let Event::Row(time) = event else {
            return Ok(());
        };
        let frame = Frame {
            time,
            time_text: &samples.time_text,
            revision: &revision,
            outputs: engine.outputs(),
        };
        sink.put(&frame).map_err(RunError::Sink)
    });
    // Also after an error: what was put out until then is not to be lost.
    let finished = sink.finish().map_err(RunError::Sink);
    ended.and(finished)
}

/// Why a run ended before its source did.
#[derive(Debug)]
pub enum RunError {
    /// The source can give no more.
    Source(SourceError),
    /// The samples are not those of the graph.
    Engine(EngineError),
    /// The outputs cannot be put out.
    Sink(SinkError),
    /// A graph cannot take over.
    Stage(StageError),
    /// The state cannot be used.
    State(StateError),
    /// A node does not take its own state back, so that the engine cannot be copied.
    Copy(RestoreError),
}

impl fmt::Display for RunError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Source(error) | Self::Sink(error) => error.fmt(f),
            Self::Engine(error) => error.fmt(f),
            Self::Stage(error) => error.fmt(f),
            Self::State(error) => error.fmt(f),
            Self::Copy(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for RunError {}

impl From<SourceError> for RunError {
    fn from(error: SourceError) -> Self {
        Self::Source(error)
    }
}

impl From<EngineError> for RunError {
    fn from(error: EngineError) -> Self {
        Self::Engine(error)
    }
}

impl From<StageError> for RunError {
    fn from(error: StageError) -> Self {
        Self::Stage(error)
    }
}

impl From<StateError> for RunError {
    fn from(error: StateError) -> Self {
        Self::State(error)
    }
}

impl From<RestoreError> for RunError {
    fn from(error: RestoreError) -> Self {
        Self::Copy(error)
    }
}
