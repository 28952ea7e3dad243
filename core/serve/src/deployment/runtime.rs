//! `[runtime]`: how ticks are cut, and what is kept of them.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Deserialize;

use super::keys;
use super::size::Size;
use crate::diagnostic::{Diagnostics, Sources};
use crate::document::Value;
use crate::time::Duration;

/// How a graph runs as a service: how ticks are cut, and what is kept of them.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Runtime {
    /// The folder of journal and checkpoints, relative to this file; without it a folder beside the machine file. One process holds it.
    pub state: Option<PathBuf>,
    /// How long nothing may be measured until time passes without samples, so that silence is noticed; for ever without.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub heartbeat: Option<Duration>,
    /// An instant is stepped so long after its first sample came: by then the other sources have given theirs.
    pub wait: Duration,
    /// After a start or a reconnect no tick is cut until every source has been connected so long, or away for its `silent`.
    pub settle: Duration,
    /// Instants no further apart are one tick, at the last of them.
    pub join: Duration,
    /// A stamp further ahead of the newest one and the time since, and of a host whose clock is right, is of the future.
    pub future: Duration,
    /// At most so much is lost in a power cut.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub sync: Duration,
    /// How often a checkpoint is taken.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub checkpoint: Duration,
    /// How much of the past is held in memory, so that a graph that takes over can warm up.
    pub retain: Duration,
    /// What is kept of the past.
    pub keep: Keep,
}

/// What is kept of the past.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema, serde::Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct Keep {
    /// How long files of the journal are kept.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub journal: Duration,
    /// How much of the journal is kept.
    pub at_most: Size,
    /// How many checkpoints are kept.
    #[schemars(range(min = 1))]
    pub checkpoints: usize,
}

const fn ms(ms: i64) -> Duration {
    Duration::from_ns(ms * 1_000_000)
}

impl Default for Keep {
    fn default() -> Self {
        Self {
            journal: ms(30 * 86_400_000),
            at_most: Size(20_000_000_000),
            checkpoints: 3,
        }
    }
}

impl Default for Runtime {
    fn default() -> Self {
        Self {
            state: None,
            heartbeat: None,
            wait: ms(200),
            settle: ms(5_000),
            join: Duration::ZERO,
            future: ms(5_000),
            sync: ms(1_000),
            checkpoint: ms(60_000),
            retain: ms(3_600_000),
            keep: Keep::default(),
        }
    }
}

/// Reads `[runtime]`; what a file without it has is the default.
pub(super) fn read(
    section: Option<&Value>,
    files: &Sources,
    diagnostics: &mut Diagnostics,
) -> Option<Runtime> {
    let Some(section) = section else {
        return Some(Runtime::default());
    };
    let mut runtime = keys::read::<Runtime>(section, "`[runtime]`", diagnostics)?;
    let place = section.place_of("state");
    runtime.state = runtime
        .state
        .map(|state| files.resolve(place, &state.to_string_lossy()));
    Some(runtime)
}
