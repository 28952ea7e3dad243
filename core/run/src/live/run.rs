//! Decides how an engine is run from a source to a sink on one thread; where both are is theirs.

use std::fmt;

use super::{Frame, Sink, SinkError};
use crate::engine::{Engine, EngineError};
use crate::recording::{Event, Source, SourceError, drive};

/// Steps an engine through all that a source gives, and puts out what comes of it.
///
/// Each tick is put out before the next samples are asked for. Ticks that the engine refuses, because their time is not
/// after the last one, are counted by it and passed over.
///
/// # Errors
/// When the source, the sink or the engine fails.
pub fn run(
    engine: &mut Engine,
    source: &mut dyn Source,
    sink: &mut dyn Sink,
) -> Result<(), RunError> {
    run_keeping(engine, source, sink, &mut |_, _| Ok(()))
}

/// The same, with a look at the engine after each tick that has been put out: to keep a
/// [`snapshot`](Engine::snapshot) now and then, from which another run goes on. The sink is to be [flushed](Sink::flush) before.
///
/// # Errors
/// When the source, the sink, the engine or `keep` fails.
pub fn run_keeping(
    engine: &mut Engine,
    source: &mut dyn Source,
    sink: &mut dyn Sink,
    keep: &mut dyn FnMut(&Engine, &mut dyn Sink) -> Result<(), SinkError>,
) -> Result<(), RunError> {
    let ended = run_to_the_end(engine, source, sink, keep);
    // Also after an error: what was put out until then is not to be lost.
    let finished = sink.finish().map_err(RunError::Sink);
    ended.and(finished)
}

fn run_to_the_end(
    engine: &mut Engine,
    source: &mut dyn Source,
    sink: &mut dyn Sink,
    keep: &mut dyn FnMut(&Engine, &mut dyn Sink) -> Result<(), SinkError>,
) -> Result<(), RunError> {
    let revision = engine.revision().to_owned();
    drive(engine, source, |engine, event, samples| {
        let Event::Row(time) = event else {
            return Ok(());
        };
        let frame = Frame {
            time,
            time_text: &samples.time_text,
            revision: &revision,
            outputs: engine.outputs(),
        };
        sink.put(&frame).map_err(RunError::Sink)?;
        keep(engine, sink).map_err(RunError::Keep)
    })
    .map(drop)
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
    /// What the engine knows cannot be kept.
    Keep(SinkError),
}

impl fmt::Display for RunError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Source(error) | Self::Sink(error) | Self::Keep(error) => error.fmt(f),
            Self::Engine(error) => error.fmt(f),
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
