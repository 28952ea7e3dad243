//! Simulated machines whose axes drift with temperature. Decides which machines there are, not who runs them.
//!
//! ```
//! use athermal_core::registry::find;
//! use athermal_trial::machine::{KnownMachine, Row, Setup};
//! use athermal_simulation as _;
//!
//! let machine = find::<KnownMachine>("linear-axis")?.machine;
//! let mut simulation = machine.start(&Setup { days: 0.01, ..Setup::default() })?;
//! let mut row = Row::empty(machine.channels());
//! while simulation.next(&mut row) {
//!     assert!(row.values[3] > 15.0, "the room is not that cold");
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod bar;
pub mod chuck;
pub mod creep;
mod die_tester;
mod disturbance;
mod linear_axis;
pub mod motors;
pub mod recorder;
pub mod room;
mod table;
pub mod wander;

pub use die_tester::DieTester;
pub use disturbance::{Disturbance, DisturbanceError, disturbed};
pub use linear_axis::LinearAxis;
pub use table::{table_columns, write_set_points, write_table};

use athermal_trial::machine::Machine;
use disturbance::World;

/// The machines of this crate, by name.
pub const MACHINES: [&dyn Machine; 2] = [DIE_TESTER, LINEAR_AXIS];

const DIE_TESTER: &DieTester = &DieTester { world: World::SAME };
const LINEAR_AXIS: &LinearAxis = &LinearAxis { world: World::SAME };

athermal_trial::register_machine!(*DIE_TESTER, "die-tester");
athermal_trial::register_machine!(*LINEAR_AXIS, "linear-axis");
