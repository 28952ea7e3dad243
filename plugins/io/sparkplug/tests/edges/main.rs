//! Edge nodes of two other makes over Mosquitto: `pip install mqtt-spb-wrapper`, and `npm install sparkplug-client`. Without them tests are
//! skipped, and fail under `ATHERMAL_REQUIRE_SERVERS=1`. `ATHERMAL_PYTHON` names the Python that has the one, if it is not `python3`, and
//! `NODE_PATH` the folder of the other.

#![allow(clippy::unwrap_used)]

mod client;
mod host;
mod peers;
mod sink;
mod wrapper;
