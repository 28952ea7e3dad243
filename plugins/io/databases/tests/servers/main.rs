//! Sinks on real databases: Debian's `influxdb`, `victoria-metrics` and `postgresql-15`. Without one its tests are skipped, and fail under
//! `ATHERMAL_REQUIRE_SERVERS=1`.

#![allow(clippy::unwrap_used)]

mod kills;
mod server;
mod sinks;
