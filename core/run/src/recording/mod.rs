//! What gives samples: a [`Source`], read once, and a [`Recording`], which opens as many of them as needed. [`drive`] is the one
//! loop that takes a source through an engine. Files and formats are the business of plugins.

mod drive;
mod source;
mod table;
mod thin;

pub use drive::{AHEAD, Passed, Steps, drive, pass};
pub use source::{Event, Samples, Source, SourceError};
pub use table::Table;
pub use thin::{Left, ThinnedChannels, Thinner, Thinning, thin};

use crate::compile::Plan;

/// A data set that can be read from its beginning as often as needed.
pub trait Recording {
    /// A source of the channels of a plan, from the first row on.
    ///
    /// # Errors
    /// When the data cannot be read or lack a channel.
    fn open(&self, plan: &Plan) -> Result<Box<dyn Source + '_>, SourceError>;
}
