//! What the author of a source implements.

use std::fmt::Debug;
use std::path::PathBuf;
use std::time::Duration as Wait;

use super::{ConnectorError, Outflow, Stop};
use crate::compile::SourceChannel;
use crate::document::{TableBase, TimeBase};
use crate::time::{Duration, Instant};
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

    /// The channels that it gives by parameters of its own, beside those of `channels`; none unless it says otherwise.
    fn mappings(&self) -> Vec<Mapping> {
        Vec::new()
    }

    /// What is wrong with its parameters, or doubtful, beyond their types and ranges; it is reported at their places. `addressed` is the
    /// number of channels that `channels` gives it by an address.
    fn remarks(&self, _addressed: usize) -> Vec<ParameterRemark> {
        Vec::new()
    }

    /// What is wrong with an address that `channels` gives a channel, or doubtful: it is reported where that stands.
    fn remark(&self, _address: &str) -> Option<ParameterRemark> {
        None
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

    /// What it has of each channel at present, for whoever commissions it: it connects, reads one of everything, and leaves. It takes no
    /// longer than so long, and disturbs nothing that runs.
    ///
    /// # Errors
    /// When it cannot be reached, or asked so.
    fn look(&self, _: SourceWiring, _: Wait) -> Result<Vec<Seen>, ConnectorError> {
        let words = "sources of this kind cannot be asked for one of everything; `athermal serve --dry-run` shows what comes";
        Err(ConnectorError::new(words))
    }

    /// The source at work. Nothing is connected yet: that is for [`Inlet::run`].
    ///
    /// # Errors
    /// When the parameters do not fit what is asked of it; the service does not start.
    fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError>;
}

/// What a source or sink says of its parameters.
#[derive(Debug, Clone)]
pub struct ParameterRemark {
    /// Where the parameter stands, as in [`Mapping::at`].
    pub at: Vec<String>,
    /// Whether it cannot be used so; otherwise it is only doubtful.
    pub is_mistake: bool,
    /// What, and why.
    pub words: String,
    /// What to do.
    pub help: String,
}

/// What a source has of a channel at present.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    /// Its number among those that were asked for.
    pub channel: usize,
    /// The value, in the unit of the source; none where nothing came that could be used.
    pub value: Option<f64>,
    /// What is said of it: good, or why there is none.
    pub quality: String,
    /// Of when it is, for people.
    pub stamp: Option<String>,
    /// By how much its clock is behind the one of this computer, the way included.
    pub offset: Option<Duration>,
    /// What the other side granted, where it was asked for something.
    pub granted: String,
}

/// Channels that a source gives by a parameter of its own.
#[derive(Debug, Clone, Default)]
pub struct Mapping {
    /// Where the parameter stands in its table: keys, and numbers of lists from 0 on, such as `messages`, `0`, `channel`.
    pub at: Vec<String>,
    /// A pattern of channels, such as `temperature.{sensor}`.
    pub channel: String,
    /// Where the source has them, for people; `{set}` is the member, `{channel}` the channel.
    pub address: String,
    /// The unit in which the source gives them; that of the signal without.
    pub unit: Option<Unit>,
    /// A sample no later than this is given to the next tick.
    pub late: Option<Duration>,
}

/// Which mapping a channel is of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mapped {
    /// Its number among [`Source::mappings`].
    pub mapping: usize,
    /// What `{…}` in its texts stand for: sets with their members, and `channel`.
    pub members: Vec<(String, String)>,
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
    /// The name of the graph, if it has one.
    pub machine: Option<String>,
    /// A folder of its own beside the journal, which need not be there yet.
    pub state: PathBuf,
    /// The folder that relative paths start from.
    pub folder: PathBuf,
    /// The channels that it is to give, in the order in which [`Outflow::sample`] counts them.
    pub channels: Vec<WiredChannel>,
    /// How long it may be connected without a sample and without a sign of life: then it is started over.
    pub silent: Wait,
    /// The longest pause after a failure, for whoever connects by itself.
    pub retry: Wait,
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
    /// Which of the source's own mappings names it; none where `channels` does.
    pub mapped: Option<Mapped>,
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
    /// When it cannot go on, and why. It is reported, and `run` is called again after a while: 0.5 s at first, and
    /// no longer than `retry` says.
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError>;
}
