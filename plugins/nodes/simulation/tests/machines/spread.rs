//! Machines of one type differ as their spread says, and by nothing else.

use athermal_simulation::{MACHINES, write_table};
use athermal_trial::machine::{Individual, Machine, Row, Setup};

fn setup(spread: &str, seed: u64) -> Setup {
    Setup {
        days: 0.25,
        seed: 3,
        individual: Individual {
            spread: spread.parse().unwrap(),
            seed,
        },
        ..Setup::default()
    }
}

fn table(machine: &dyn Machine, setup: &Setup) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut simulation = machine.start(setup).unwrap();
    write_table(machine.channels(), &mut *simulation, true, &mut bytes).unwrap();
    bytes
}

#[test]
fn a_spread_of_zero_is_the_design_to_the_bit_whatever_the_seed_of_the_machine() {
    for machine in MACHINES {
        let design = Setup {
            individual: Individual::DESIGN,
            ..setup("0%", 1)
        };
        assert_eq!(
            table(machine, &setup("0%", 9)),
            table(machine, &design),
            "{}",
            machine.name()
        );
    }
}

#[test]
fn the_seed_of_a_machine_gives_the_same_machine_and_another_seed_another() {
    for machine in MACHINES {
        let one = table(machine, &setup("30%", 1));
        assert_eq!(one, table(machine, &setup("30%", 1)), "{}", machine.name());
        assert_ne!(one, table(machine, &setup("30%", 2)), "{}", machine.name());
        assert_ne!(one, table(machine, &setup("0%", 1)), "{}", machine.name());
    }
}

/// All rows of a machine.
fn rows(machine: &dyn Machine, setup: &Setup) -> Vec<Row> {
    let mut simulation = machine.start(setup).unwrap();
    let mut row = Row::empty(machine.channels());
    let mut rows = Vec::new();
    while simulation.next(&mut row) {
        rows.push(row.clone());
    }
    rows
}

#[test]
fn the_noise_the_weather_and_the_instants_of_positions_are_those_of_the_other_seed() {
    for machine in MACHINES {
        let air = machine.channels().iter();
        let air = air
            .clone()
            .position(|of| ["room", "t4"].contains(&of.name))
            .unwrap();
        let (one, other) = (
            rows(machine, &setup("30%", 1)),
            rows(machine, &setup("30%", 2)),
        );
        let offset = one[0].values[air] - other[0].values[air];
        assert!(offset.abs() > 1e-3, "sensors have offsets");
        for (one, other) in one.iter().zip(&other) {
            // The air is the same, its sensor is another.
            let apart = one.values[air] - other.values[air] - offset;
            assert!(apart.abs() < 2e-4, "{}: {apart}", machine.name());
            let absent = |row: &Row| row.values.iter().map(|v| v.is_nan()).collect::<Vec<_>>();
            assert_eq!(absent(one), absent(other));
        }
    }
}

#[test]
fn machines_of_a_spread_drift_apart_by_about_as_much() {
    for machine in MACHINES {
        let rms = |seed| {
            let rows = rows(machine, &setup("30%", seed));
            let drifts = rows
                .iter()
                .map(|row| row.true_drift.last().copied().unwrap());
            let squares: Vec<f64> = drifts.filter(|of| !of.is_nan()).map(|of| of * of).collect();
            (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
        };
        let logs: Vec<f64> = (1..=24).map(|seed| rms(seed).ln()).collect();
        let mean = logs.iter().sum::<f64>() / logs.len() as f64;
        let spread = logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>();
        let spread = (spread / logs.len() as f64).sqrt();
        // Several parameters make a drift, so it is not 0.3 to the digit.
        assert!((0.1..0.6).contains(&spread), "{}: {spread}", machine.name());
    }
}
