//! Decides how faults reach the rows of a simulation; not what a fault does to a value.

use super::{Row, Simulation};
use crate::fault::Faults;

/// A simulation whose sensors fail. The true drift is not touched.
pub struct Faulty {
    simulation: Box<dyn Simulation>,
    faults: Faults,
}

impl Faulty {
    /// `simulation` with `faults`.
    #[must_use]
    pub fn new(simulation: Box<dyn Simulation>, faults: Faults) -> Self {
        Self { simulation, faults }
    }
}

impl Simulation for Faulty {
    fn next(&mut self, row: &mut Row) -> bool {
        let more = self.simulation.next(row);
        if more {
            self.faults.apply(row.time_ns, &mut row.values);
        }
        more
    }

    fn correct(&mut self, asked: &[f64], applied: &mut [f64]) {
        self.simulation.correct(asked, applied);
    }
}
