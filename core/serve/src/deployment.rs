//! What a machine file says about a service: its sources and sinks, and how ticks are cut.

use std::path::PathBuf;

use crate::compile::SourceChannel;
use crate::connector::{Sink, SinkKind, Source, SourceKind};
use crate::sequencer::ClockRule;
use crate::time::Duration;

/// What a machine file says about a service.
#[derive(Debug)]
pub struct Deployment {
    /// `[runtime]`.
    pub runtime: Runtime,
    /// `[sources.NAME]`, in the order of the file.
    pub sources: Vec<DeclaredSource>,
    /// `[sinks.NAME]`, in the order of the file.
    pub sinks: Vec<DeclaredSink>,
}

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

impl Default for Runtime {
    fn default() -> Self {
        let ms = |ms: i64| Duration::from_ns(ms * 1_000_000);
        Self {
            state: None,
            heartbeat: None,
            wait: ms(200),
            settle: ms(5_000),
            join: Duration::ZERO,
            future: ms(5_000),
            sync: ms(1_000),
            checkpoint: ms(60_000),
            keep: Keep {
                journal: Some(ms(30 * 86_400_000)),
                at_most: Some(20 << 30),
                checkpoints: 3,
            },
        }
    }
}

/// A source that a machine file declares.
#[derive(Debug)]
pub struct DeclaredSource {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: &'static SourceKind,
    /// Its parameters.
    pub parameters: Box<dyn Source>,
    /// A source that is away so long is not waited for, and one that gives nothing for so long is started again.
    pub silent: Duration,
    /// How its clock is judged; not at all without.
    pub clock: Option<ClockRule>,
    /// The channels that it gives.
    pub channels: Vec<DeclaredChannel>,
}

/// A channel that a source gives.
#[derive(Debug, Clone)]
pub struct DeclaredChannel {
    /// The channel as the graph knows it.
    pub channel: SourceChannel,
    /// Where the source has it: a column, a topic, a node.
    pub address: String,
    /// The unit of the channel from that of the source: `value * factor + offset`; none where it is the same.
    pub conversion: Option<(f64, f64)>,
    /// A sample no later than this is given to the next tick.
    pub late: Duration,
}

/// A sink that a machine file declares.
#[derive(Debug)]
pub struct DeclaredSink {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: &'static SinkKind,
    /// Its parameters.
    pub parameters: Box<dyn Sink>,
    /// The columns of the outputs that it is given, as `run` writes them, in order.
    pub outputs: Vec<String>,
    /// A tick that lies further behind is not put out; for commands 5 s unless the file says otherwise.
    pub behind: Option<Duration>,
    /// By how much a command may change per second, in the unit of each output; without bound where there is none.
    pub rate: Vec<Option<f64>>,
}
impl Deployment {
    /// stub
    pub fn read(
        _: &crate::document::GraphFile,
        _: &crate::compile::Plan,
        _: &mut crate::diagnostic::Diagnostics,
    ) -> Option<Self> {
        None
    }
}
