//! Decides how an engine is taken through a recording; what is looked at after each tick is the caller's.

use crate::engine::{Engine, EngineError};
use crate::recording::{Event, Recording, RecordingError};
use crate::time::Instant;

/// What a pass over a recording met.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Passed {
    pub ticks: u64,
    pub(crate) segments: u64,
    pub(crate) period: Option<(Instant, Instant)>,
}

/// Steps an engine through a recording. `look` is told of each tick that has been stepped, and of each segment break.
///
/// A tick that the engine refuses is counted by it and passed over.
pub fn drive(
    engine: &mut Engine,
    recording: &dyn Recording,
    mut look: impl FnMut(&Engine, Event),
) -> Result<Passed, RecordingError> {
    let plan = std::sync::Arc::clone(engine.plan());
    let mut values = vec![f64::NAN; plan.sources.len()];
    let mut rows = recording.open(&plan)?;
    let mut passed = Passed {
        segments: 1,
        ..Passed::default()
    };
    while let Some(event) = rows.next(&mut values)? {
        match event {
            Event::Segment => {
                engine.segment();
                passed.segments += 1;
            }
            Event::Row(time) => match engine.step(time, &values) {
                Ok(_) => {
                    passed.ticks += 1;
                    let (from, to) = passed.period.unwrap_or((time, time));
                    passed.period = Some((from.min(time), to.max(time)));
                }
                Err(EngineError::NotAfter { .. }) => continue,
                Err(error) => return Err(Box::new(error)),
            },
        }
        look(engine, event);
    }
    Ok(passed)
}
