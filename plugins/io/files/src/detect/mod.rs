//! What `[table]` leaves open is found here, for the reader and for whoever writes a `[table]`: the format, where the table begins,
//! what separates its cells, its units, and which layout its rows have. Not what the columns mean.

mod apart;
mod description;
mod format;
mod header;
mod long;
mod other_time;
mod times;
mod units;

pub use apart::apart;
pub use description::Description;
pub use format::Format;
pub use long::LongFormat;
pub use other_time::other_time;
pub use times::{NumberForm, zone_in_name, zone_of};

pub(crate) use format::begins_json_array;
pub(crate) use header::{Head, seek};
pub(crate) use units::{are_units, is_of_processing, unit};
