//! What the author of a source or a sink implements, and how its kind becomes known.
//!
//! A kind is a serde struct of parameters that implements [`Source`] or [`Sink`], made known with [`register_source!`](crate::register_source)
//! or [`register_sink!`](crate::register_sink). What works is an [`Inlet`] or an [`Outlet`]. Each has a thread of its own: it may wait,
//! block and fail, and the engine thread does not notice.

mod back_off;
mod error;
mod inlet;
mod kind;
mod left_out;
mod outlet;
mod source_link;
mod stop;
mod thin;

pub use back_off::BackOff;
pub use error::ConnectorError;
pub use inlet::{
    Inlet, Mapped, Mapping, ParameterRemark, Seen, Source, SourceWiring, Stamps, WiredChannel,
};
pub use kind::{ConnectorKind, SinkKind, SourceKind};
#[doc(hidden)]
pub use kind::{read_sink, read_source};
pub use left_out::{LeftOut, LeftOutCounts};
pub use outlet::{
    Kept, Messages, OpensMessages, OutRow, Outlet, Place, Purpose, Sink, SinkWiring, WiredOutput,
};
pub(crate) use source_link::{Arrival, SourceLink, link};
pub use source_link::{Connection, Outflow, Remarks, SourceCounts};
pub use stop::Stop;
