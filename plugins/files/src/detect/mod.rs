//! What `[table]` leaves open is found here, for the reader and for whoever writes a `[table]`: the format, where the table begins,
//! what separates its cells, its units, and which layout its rows have. Not what the columns mean.

mod description;
mod format;
mod header;
mod long;
mod units;

pub use description::Description;
pub use format::Format;
pub use long::LongFormat;

pub(crate) use format::begins_json_array;
pub(crate) use header::{Head, seek};
pub(crate) use units::{are_units, unit};
