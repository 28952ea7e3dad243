//! Recordings in files: CSV and JSON lines, read and written row by row in constant memory.
//!
//! This package decides what bytes mean: delimiters, quoting, numbers, instants, what "no value" looks like, and what is
//! done with a line that cannot be used. A flag may stand as `true` or `false`, in any case, and is 1 or 0; where something else
//! than a comma separates cells (`;`, tab, `|`), a number may have a decimal comma. Text is UTF-8, or UTF-16 with the mark that says
//! so; cells that are not UTF-8 are taken for Windows-1252, so that `Wärme [°C]` is a name whoever wrote it. A table may have other
//! lines above its names and a row of units below them, and may name its columns again, in another order. Rows of one time are one
//! where a recording is read and they do not contradict each other. It does not decide what a channel is for, its unit, or when a value is too old.
//!
//! ```
//! use athermal_files::{Layout, Options, Reader, Row, TimeForm};
//!
//! let text = "time_s,plate,room\n0.0,21.5,\n0.3,21.6,20.9\n";
//! let layout = Layout::new("time_s", TimeForm::SECONDS, ["room", "plate"]);
//! let mut reader = Reader::from_read("example.csv", text.as_bytes(), layout, Options::default())?;
//! let mut row = Row::default();
//! assert!(reader.next_into(&mut row)?);
//! assert!(row.values[0].is_nan());
//! assert!(reader.next_into(&mut row)?);
//! assert_eq!(row.time_ns, 300_000_000);
//! assert_eq!(row.values, [20.9, 21.6]);
//! # Ok::<(), athermal_files::FileError>(())
//! ```

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod begun;
mod cell;
mod cells;
mod columns;
mod csv_rows;
mod dataset;
mod decimal;
mod detect;
mod error;
mod instant;
mod joined;
mod json_objects;
mod json_rows;
mod layout;
mod ledger;
mod lent;
mod lines;
mod long;
mod machines;
mod merge;
mod reader;
mod recording;
mod runs;
mod stream;
mod stretch;
mod typed;
mod unpacked;
mod writer;

pub use begun::{begun_columns, begun_until};
pub use cell::{number, text_of, with_decimal_point};
pub use dataset::{Dataset, layout, recordings_in};
pub use detect::{
    Description, Format, LongFormat, NumberForm, apart, other_time, zone_in_name, zone_of,
};
pub use error::{Again, CellFault, FileError, MissingColumn, Place};
pub use instant::{has_clock, has_zone, is_time_of_day};
pub use layout::{ChannelColumn, Layout, TimeColumn, TimeForm};
pub use ledger::{Count, Report};
pub use lent::{OpenTable, Tables};
pub use lines::STANDARD_INPUT;
pub use machines::MachineFault;
pub use merge::{Joint, MergeError};
pub use reader::{Options, Reader, Row};
pub use recording::{DATED_NS, Event, Recording};
pub use stream::WithRevision;
pub use stretch::{Bound, Stretch};
pub use typed::{FileKind, Selection, TypedFile, TypedRows, TypedSink, TypedTime, Within};
pub use writer::{Flush, Writer};

/// What the macros of this crate use.
#[doc(hidden)]
pub mod __private {
    pub use athermal_core::__private::{list, no_schema};
}
