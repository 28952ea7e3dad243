//! Logs of all kinds are read whole, and written as they are read.

#![allow(clippy::unwrap_used)]

mod any_bytes;
mod forms;
mod hostile;
mod shared_data;
mod time_in_two_columns;
mod zones;
