//! Sources and sinks on real servers of other makes: asyncua, `pip install asyncua`, and node-opcua, `npm install node-opcua`. Without them
//! tests are skipped, and fail under `ATHERMAL_REQUIRE_SERVERS=1`. `ATHERMAL_PYTHON` names the Python that has the one, if it is not
//! `python3`, and `NODE_PATH` the folder of the other.

#![allow(clippy::unwrap_used)]

mod certificates;
mod faults;
mod load;
mod makes;
mod plant;
mod qualities;
mod service;
mod sinks;
