//! Recordings of simulated machines, so that tests need no data from elsewhere. Decides nothing that is expected.

use std::path::PathBuf;

use athermal::trial::machine::Setup;

use super::Scratch;

/// Writes so many days of a machine as a CSV file.
pub fn simulated(scratch: &Scratch, name: &str, machine: &str, days: f64, seed: u64) -> PathBuf {
    let machine = athermal::core::registry::find::<athermal::trial::machine::KnownMachine>(machine)
        .expect("a machine of that name is built in")
        .machine;
    let setup = Setup {
        days,
        seed,
        ..Setup::default()
    };
    let mut text = Vec::new();
    let mut simulation = machine.start(&setup).unwrap();
    athermal_simulation::write_table(machine.channels(), simulation.as_mut(), false, &mut text)
        .unwrap();
    scratch.file(name, text)
}
