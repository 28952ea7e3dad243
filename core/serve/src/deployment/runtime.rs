//! `[runtime]`: how ticks are cut, and what is kept of them.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Deserialize;

use super::keys;
use super::size::Size;
use crate::diagnostic::{Diagnostics, Sources};
use crate::document::Value;
use crate::time::Duration;

/// What `[runtime]` says.
#[derive(Debug, Clone, PartialEq)]
pub struct Runtime {
    /// The state folder; none where the file does not name one.
    pub state: Option<PathBuf>,
    /// How long nothing may be measured until time passes without samples; for ever without.
    pub heartbeat: Option<Duration>,
    /// An instant is stepped so long after its first sample came.
    pub wait: Duration,
    /// No tick is cut after a start or a reconnect until every source has been connected so long.
    pub settle: Duration,
    /// Instants no further apart are one tick.
    pub join: Duration,
    /// A stamp further ahead is refused.
    pub future: Duration,
    /// At most so much is lost in a power cut.
    pub sync: Duration,
    /// How often a checkpoint is taken.
    pub checkpoint: Duration,
    /// How long, and how much of, the journal is kept, and how many checkpoints.
    pub keep: Keep,
}

/// What `[runtime] keep` says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Keep {
    /// How long files of the journal are kept; for ever without.
    pub journal: Option<Duration>,
    /// How many bytes of the journal are kept; all without.
    pub at_most: Option<u64>,
    /// How many checkpoints are kept.
    pub checkpoints: usize,
}

/// How a graph runs as a service: how ticks are cut, and what is kept of them.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RuntimeKeys {
    /// The folder of journal and checkpoints, relative to this file; without it a folder beside the machine file. One process holds it.
    state: Option<String>,
    /// How long nothing may be measured until time passes without samples, so that silence is noticed; for ever without.
    #[schemars(extend("exclusiveMinimum" = 0))]
    heartbeat: Option<Duration>,
    /// An instant is stepped so long after its first sample came: by then the other sources have given theirs.
    wait: Duration,
    /// After a start or a reconnect no tick is cut until every source has been connected so long, or away for its `silent`.
    settle: Duration,
    /// Instants no further apart are one tick, at the last of them.
    join: Duration,
    /// A stamp further ahead of the newest one and the time since is refused.
    future: Duration,
    /// At most so much is lost in a power cut.
    #[schemars(extend("exclusiveMinimum" = 0))]
    sync: Duration,
    /// How often a checkpoint is taken.
    #[schemars(extend("exclusiveMinimum" = 0))]
    checkpoint: Duration,
    /// What is kept of the past.
    keep: KeepKeys,
}

/// What is kept of the past.
#[derive(Debug, Deserialize, JsonSchema, serde::Serialize)]
#[serde(deny_unknown_fields, default)]
struct KeepKeys {
    /// How long files of the journal are kept.
    #[schemars(extend("exclusiveMinimum" = 0))]
    journal: Duration,
    /// How much of the journal is kept.
    at_most: Size,
    /// How many checkpoints are kept.
    #[schemars(range(min = 1))]
    checkpoints: usize,
}

const fn ms(ms: i64) -> Duration {
    Duration::from_ns(ms * 1_000_000)
}

impl Default for KeepKeys {
    fn default() -> Self {
        Self {
            journal: ms(30 * 86_400_000),
            at_most: Size(20_000_000_000),
            checkpoints: 3,
        }
    }
}

impl Default for RuntimeKeys {
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
            keep: KeepKeys::default(),
        }
    }
}

impl From<RuntimeKeys> for Runtime {
    fn from(keys: RuntimeKeys) -> Self {
        Self {
            state: keys.state.map(PathBuf::from),
            heartbeat: keys.heartbeat,
            wait: keys.wait,
            settle: keys.settle,
            join: keys.join,
            future: keys.future,
            sync: keys.sync,
            checkpoint: keys.checkpoint,
            keep: Keep {
                journal: Some(keys.keep.journal),
                at_most: Some(keys.keep.at_most.0),
                checkpoints: keys.keep.checkpoints,
            },
        }
    }
}

impl Default for Runtime {
    fn default() -> Self {
        RuntimeKeys::default().into()
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
    let keys = keys::read::<RuntimeKeys>(section, "`[runtime]`", diagnostics)?;
    let mut runtime = Runtime::from(keys);
    let place = section.place_of("state");
    runtime.state = runtime
        .state
        .map(|state| files.resolve(place, &state.to_string_lossy()));
    Some(runtime)
}
