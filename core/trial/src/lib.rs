//! The tests in a graph file of athermal, and what they run on: simulated machines and faulty sensors.
//!
//! | layer | decides |
//! |---|---|
//! | [`fault`] | what can be wrong with a sensor of any recording |
//! | [`machine`] | what a simulated machine is, and as what recording it serves |
//! | [`declare`](declare()), [`run`](run()) | what the tests mean: data, faults and expectations; running one, through the same engine that runs live |
//!
//! Which tests are run, on which threads, and how their results are shown is left to the command line.

pub mod fault;
pub mod machine;

mod channels;
mod data;
mod declare;
mod expect;
mod expectation;
mod judge;
mod observed;
pub mod problem;
mod run;
mod series;
mod shape;
mod table;

pub use data::{DataSet, Simulation};
pub use declare::{On, Trial, declare, mistakes, observe};
pub use expectation::{Check, Expectation, Period, Rival, Tolerance};
pub use judge::{Finding, Wanted};
pub use run::{Verdict, run};
pub use series::{Curve, Series, Shape, Synthetic};
pub use table::TestTable;

// The layers below, by the names that they have for everybody.
use athermal_core::{
    compile, diagnostic, document, engine, failure, node, prng, quantity, registry, time, unit,
};
use athermal_run::{fit, recording, score};

/// What macros of this crate make use of.
#[doc(hidden)]
pub mod __private {
    pub use athermal_core::__private::{list, no_schema};
}
