//! What the author of a sink implements.

use std::fmt::Debug;
use std::path::PathBuf;
use std::time::Duration as Wait;

use serde::{Deserialize, Serialize};

use super::{ConnectorError, ParameterRemark, Seen};
use crate::document::TimeBase;
use crate::time::{Duration, Instant};

/// A kind of sink: the parameters of one, as a machine file gives them.
pub trait Sink: Debug + Send + Sync {
    /// What it is for.
    fn purpose(&self) -> Purpose {
        Purpose::Log
    }

    /// As those of a source.
    fn remarks(&self) -> Vec<ParameterRemark> {
        Vec::new()
    }

    /// Whether it can put each output out, for whoever commissions it: it connects, looks, and leaves; none where it cannot be asked.
    /// [`Seen::channel`] is the number of an output, and
    /// [`Seen::granted`] to where it goes.
    fn look(&self, _: SinkWiring, _: Wait) -> Option<Result<Vec<Seen>, ConnectorError>> {
        None
    }

    /// The sink at work. Nothing is connected yet: that is for the first [`Outlet::put`].
    ///
    /// # Errors
    /// When it cannot be what is asked of it: a command keeps the service from starting, a log is tried again.
    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError>;

    /// What sends messages beside rows, such as alarms, where the kind does.
    fn messages(&self) -> Option<&dyn OpensMessages> {
        None
    }
}

/// Sends messages beside the rows of a sink, to where that puts them.
pub trait OpensMessages {
    /// On a connection of its own, whose name ends in `suffix`, under a topic.
    ///
    /// # Errors
    /// When it can never send there, and why.
    fn open(
        &self,
        wiring: &SinkWiring,
        suffix: &str,
        topic: &str,
    ) -> Result<Box<dyn Messages>, ConnectorError>;
}

/// Messages on their way, on a thread that may wait.
pub trait Messages: Send {
    /// Sends one, until the other end has it.
    ///
    /// # Errors
    /// When it does not have it yet, and why: it may have it later all the same, and is to be sent again.
    fn send(&mut self, text: &str) -> Result<(), ConnectorError>;
}

/// What a sink is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// It keeps every row, old ones too.
    Log,
    /// It moves something: only what is recent is put out, once, and never in a step.
    Command,
}

/// What a sink is given.
#[derive(Debug, Clone)]
pub struct SinkWiring {
    /// Its name in the machine file.
    pub name: String,
    /// The name of the graph, if it has one.
    pub machine: Option<String>,
    /// A folder of its own beside the journal, which need not be there yet.
    pub state: PathBuf,
    /// The folder that relative paths start from.
    pub folder: PathBuf,
    /// The outputs that it is given, in the order of [`OutRow::outputs`].
    pub outputs: Vec<WiredOutput>,
    /// How tables give time.
    pub time: TimeBase,
    /// The longest pause after a failure, for whoever connects by itself.
    pub retry: Wait,
}

/// An output that a sink is given.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WiredOutput {
    /// Its column, as `run` writes it: `correction.Z1`.
    pub name: String,
    /// Its unit.
    pub unit: Option<String>,
}

/// A sink at work, on a thread of its own.
pub trait Outlet: Send {
    /// Puts a row out.
    ///
    /// # Errors
    /// When it cannot be put out, and why. A log is given the same row again after a while; the next ones wait meanwhile, and where there
    /// is no room for them they are made again from the journal.
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError>;

    /// Whether what it has taken can leave; otherwise why not. What waits is kept meanwhile. Asked after each row, and every two seconds.
    ///
    /// # Errors
    /// Why it cannot leave at the moment.
    fn state(&mut self) -> Result<(), ConnectorError> {
        Ok(())
    }

    /// Hands what is still held back to the system. Called when no row waits.
    ///
    /// # Errors
    /// As [`put`](Self::put).
    fn flush(&mut self) -> Result<(), ConnectorError> {
        Ok(())
    }

    /// How many rows it took that have not left, where it is a log.
    fn held(&self) -> u64 {
        0
    }

    /// The rows that it keeps, where it can be asked for them after a start: then each is put out exactly once.
    fn kept(&mut self) -> Option<&mut dyn Kept> {
        None
    }

    /// What the machine says is applied at present, one value for each output, where it says so.
    fn applied(&mut self) -> Option<Vec<f64>> {
        None
    }
}

/// Where the rows of a sink end: a number of rows, whatever became of their bytes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Place {
    /// By what the sink knows the file in which they stand, or whatever else it has them in.
    pub file: u64,
    /// How many rows of it are before the place.
    pub rows: u64,
}

/// The rows that a sink keeps.
pub trait Kept {
    /// Where its end is, once all rows are on the disk, or wherever they go.
    ///
    /// # Errors
    /// As [`Outlet::put`], and where rows are still on their way. The place that was kept before is good until then.
    fn end(&mut self) -> Result<Place, ConnectorError>;

    /// How many whole rows stand behind a place that [`end`](Self::end) gave; none where it is gone. What is left of a row is cut off.
    ///
    /// # Errors
    /// As [`Outlet::put`].
    fn rows_after(&mut self, end: Place) -> Result<Option<u64>, ConnectorError>;

    /// Cuts back to so many rows behind a place.
    ///
    /// # Errors
    /// As [`Outlet::put`].
    fn cut(&mut self, end: Place, rows: u64) -> Result<(), ConnectorError>;

    /// A place that [`end`](Self::end) gave is kept: it is not asked for what was before it any more.
    fn forget(&mut self, end: Place) {
        let _ = end;
    }
}

/// What came of a tick, as a sink is given it.
#[derive(Debug, Clone, Copy)]
pub struct OutRow<'a> {
    /// The instant.
    pub at: Instant,
    /// Whether the tick was made by time alone.
    pub is_beat: bool,
    /// How far it lies behind the newest stamp and the time since.
    pub behind: Duration,
    /// The revision of the graph that made it.
    pub revision: u64,
    /// Whether the service is degraded while the row is put out, as its status says.
    pub is_degraded: bool,
    /// The outputs; NaN where there is none.
    pub outputs: &'a [f64],
}
