//! What the author of a source implements.

use std::fmt::Debug;
use std::path::PathBuf;

use super::{ConnectorError, Outflow, Stop};
use crate::compile::SourceChannel;
use crate::document::{TableBase, TimeBase};
use crate::time::Instant;
use crate::unit::Unit;

/// A kind of source: the parameters of one, as a machine file gives them.
pub trait Source: Debug + Send + Sync {
    /// By what its stamps go.
    fn stamps(&self) -> Stamps {
        Stamps::Clock
    }

    /// Whether a mapping names where in the source each channel is to be found. A source that is laid out as a table needs none: the
    /// channels have columns.
    fn needs_addresses(&self) -> bool {
        false
    }

    /// Whether its connection is dropped and made anew where it is connected, and neither gives a sample nor says that it is
    /// [alive](Outflow::alive) for as long as `silent` says. A reconnect that brings no data back is noticed by that.
    fn is_watched(&self) -> bool {
        self.stamps() == Stamps::Clock
    }

    /// Whether it will come to an end, after which the service ends too.
    fn ends(&self) -> bool {
        false
    }

    /// The source at work. Nothing is connected yet: that is for [`Inlet::run`].
    ///
    /// # Errors
    /// When the parameters do not fit what is asked of it; the service does not start.
    fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError>;
}

/// By what the stamps of a source go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stamps {
    /// By a clock that says the time of day. Messages may come in any order.
    Clock,
    /// Rows in the order of their times, as in a recording, whose clock need not say the time of day. A gap is no stamp of the future.
    Order,
}

/// What a source is asked for.
#[derive(Debug, Clone)]
pub struct SourceWiring {
    /// Its name in the machine file.
    pub name: String,
    /// The folder that relative paths start from.
    pub folder: PathBuf,
    /// The channels that it is to give, in the order in which [`Outflow::sample`] counts them.
    pub channels: Vec<WiredChannel>,
    /// How tables give time.
    pub time: TimeBase,
    /// How tables are laid out.
    pub table: TableBase,
}

/// A channel that a source is to give.
#[derive(Debug, Clone)]
pub struct WiredChannel {
    /// The channel as the graph knows it.
    pub channel: SourceChannel,
    /// The unit in which the graph has it.
    pub unit: Unit,
    /// Where the source has it: a column, a topic, a node.
    pub address: String,
    /// The unit of the channel from that of the source: `value * factor + offset`; none where it is the same.
    pub conversion: Option<(f64, f64)>,
    /// The newest stamp that the service knows of it; [`Instant::MIN`] without one. What is not after it is not asked for again.
    pub after: Instant,
}

/// A source at work, on a thread of its own.
pub trait Inlet: Send {
    /// Gives samples until there will be no more, or it is to stop.
    ///
    /// # Errors
    /// When it cannot go on, and why. It is reported, and `run` is called again after a while: 0.5 s at first, 30 s at most.
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError>;
}
