//! Simulated machines whose axes drift with temperature. Decides which machines there are, not who runs them.
//!
//! ```
//! use athermal_simulation::{Row, Setup, machine};
//!
//! let machine = machine("linear-axis").expect("`linear-axis` is built in");
//! let mut simulation = machine.start(&Setup { days: 0.01, ..Setup::default() })?;
//! let mut row = Row::empty(machine.channels());
//! while simulation.next(&mut row) {
//!     assert!(row.values[3] > 15.0, "the room is not that cold");
//! }
//! # Ok::<(), athermal_simulation::SetupError>(())
//! ```

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod bar;
pub mod chuck;
pub mod creep;
mod die_tester;
pub mod fault;
mod linear_axis;
mod machine;
pub mod motors;
pub mod prng;
pub mod recorder;
pub mod room;
pub mod schedule;
mod table;
pub mod wander;

pub use die_tester::DieTester;
pub use fault::{Fault, FaultError, FaultKind, Faults, Faulty};
pub use linear_axis::LinearAxis;
pub use machine::{
    Channel, LONGEST_DAYS, Machine, Row, SECOND_NS, SetPoint, Setup, SetupError, Simulation,
    rows_of,
};
pub use schedule::{Schedule, ScheduleError};
pub use table::write_table;

/// The machines of this crate, by name.
pub const MACHINES: [&dyn Machine; 2] = [&DieTester, &LinearAxis];

/// The machine of that name, if it is one of this crate's.
#[must_use]
pub fn machine(name: &str) -> Option<&'static dyn Machine> {
    MACHINES.into_iter().find(|machine| machine.name() == name)
}
