//! Databases as sinks: what a service puts out, row by row, each at least once. A row that comes again is the same key, and changes nothing.
//!
//! | module | decides |
//! |---|---|
//! | `batches` | how many rows go at once, when it is tried again, and what becomes of a row that is refused |
//! | `influx` | rows as lines, over HTTP |
//! | `http` | one request |
//! | `sql` | rows into a table of PostgreSQL |
//!
//! The journal of the service is the spool of each: what a database does not have is made again from there.

#![cfg_attr(test, allow(clippy::unwrap_used))]

#[cfg(any(feature = "influx", feature = "postgres"))]
mod batches;
#[cfg(feature = "influx")]
mod http;
#[cfg(feature = "influx")]
mod influx;
#[cfg(feature = "postgres")]
mod sql;
