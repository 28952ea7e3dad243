//! Arrow and Parquet: recordings that stand by columns, with types. Not what a channel is, nor which rows are taken.
//!
//! A column of numbers gives them as 64-bit floats: whole numbers, decimals and truth values too, and texts that are numbers; what is
//! null or not a number is absent. A column of instants gives them whatever form the graph declares; one without a zone goes by the
//! `zone` of `[time]`, as a text does. Where a stretch of time is asked for, groups of rows outside of it are not read. `key=value` in
//! the folders of a file's path stands for a column that the file itself lacks.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod column;
mod file;
mod memory;
mod parquet_sink;
mod rows;
mod sink;
mod stamp;

pub use file::{Batches, batches};
pub use memory::table;
pub use sink::ParquetSink;

use athermal_files::{FileKind, register_file_kind};

register_file_kind!(
    "Parquet",
    FileKind {
        endings: &["parquet", "pq"],
        mark: b"PAR1",
        open: file::parquet,
        create: Some(parquet_sink::create),
    }
);

register_file_kind!(
    "Arrow",
    FileKind {
        endings: &["arrow", "feather", "ipc"],
        mark: b"ARROW1",
        open: file::arrow,
        create: None,
    }
);

register_file_kind!(
    "a stream of Arrow",
    FileKind {
        endings: &["arrows"],
        mark: &[0xff, 0xff, 0xff, 0xff],
        open: file::arrow_stream,
        create: None,
    }
);
