//! Decides which data a test names; how files are read is left to who runs it.

use std::path::PathBuf;

use crate::machine::{Change, KnownMachine, Schedule, Setup, Simulated};
use crate::recording::Recording;
use crate::registry::{NotFound, find};

/// Data that can be read as often as needed.
#[derive(Debug, Clone, PartialEq)]
pub enum DataSet {
    /// Files, with their paths resolved.
    Files(Vec<PathBuf>),
    /// A simulated machine.
    Simulated(Simulation),
}

/// A simulated machine and how much of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// The machine's name, which is known.
    pub machine: &'static str,
    /// How many days.
    pub days: f64,
    /// The seed.
    pub seed: u64,
    /// Set points over time; none is the machine's own schedule.
    pub schedule: Option<Schedule>,
    /// What of it becomes another.
    pub changes: Vec<Change>,
}

impl Simulation {
    /// Its recording.
    ///
    /// # Errors
    /// There is no such machine, which declaring a test has made sure of.
    pub fn recording(&self) -> Result<Box<dyn Recording>, NotFound> {
        let setup = Setup {
            days: self.days,
            seed: self.seed,
            schedule: self.schedule.clone(),
            changes: self.changes.clone(),
            ..Setup::default()
        };
        let machine = find::<KnownMachine>(self.machine)?.machine;
        Ok(Box::new(Simulated::new(machine, setup)))
    }
}
