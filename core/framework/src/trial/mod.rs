//! Decides what the tests in a graph file mean and how one is run: data, faults and expectations, through the same engine that runs live;
//! which tests are run, on which threads, and how their results are shown is left to the command line.

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
pub(crate) use table::TestTable;
