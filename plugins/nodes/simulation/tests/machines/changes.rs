//! A machine that becomes another for good does so as stated and from then on, without a leap; before it keeps its bits.

use athermal_core::registry::find;
use athermal_trial::machine::{KnownMachine, Row, Setup, Simulated};

/// The rows of half a day.
fn rows(name: &str, changes: &[&str]) -> Vec<Row> {
    let machine = find::<KnownMachine>(name).unwrap().machine;
    let setup = Setup {
        days: 0.5,
        seed: 3,
        changes: changes.iter().map(|text| text.parse().unwrap()).collect(),
        ..Setup::default()
    };
    let mut simulation = Simulated::new(machine, setup).start().unwrap();
    let mut row = Row::empty(machine.channels());
    let mut rows = Vec::new();
    while simulation.next(&mut row) {
        rows.push(row.clone());
    }
    rows
}

fn bits(row: &Row) -> Vec<u64> {
    let all = row.values.iter().chain(&row.true_drift);
    all.map(|value| value.to_bits()).collect()
}

/// The first row that differs, in hours.
fn since(same: &[Row], other: &[Row]) -> f64 {
    let differs = |(one, other): (&Row, &Row)| bits(one) != bits(other);
    let nth = same.iter().zip(other).position(differs).unwrap();
    nth as f64 / 360.0
}

#[test]
fn each_change_begins_when_it_is_said_to_and_not_before() {
    for machine in ["linear-axis", "die-tester"] {
        let same = rows(machine, &[]);
        for change in [
            "expansion=30%@6h",
            "contact=-50%@6h",
            "load=300%@3h..9h",
            "season=4 K@6h..10h",
        ] {
            let hours = since(&same, &rows(machine, &[change]));
            // Motors heat in bursts, hours apart.
            let (first, within) = if change.starts_with("load") {
                (3.0, 9.0)
            } else {
                (6.0, 4.0)
            };
            assert!(
                (first..first + within).contains(&hours),
                "{machine}, {change}: {hours}"
            );
        }
    }
}

#[test]
fn bodies_that_grow_more_drift_more_from_then_on_and_leap_nowhere() {
    let (same, more) = (
        rows("linear-axis", &[]),
        rows("linear-axis", &["expansion=100%@0s"]),
    );
    // Y is moved by the arm alone but for little, and creeps.
    let drifts = |rows: &[Row], axis: usize| -> Vec<f64> {
        let all = rows.iter().map(|row| row.true_drift[axis]);
        all.filter(|drift| !drift.is_nan()).collect()
    };
    for axis in 0..3 {
        let (was, is) = (drifts(&same, axis), drifts(&more, axis));
        let products: f64 = was.iter().zip(&is).map(|(was, is)| was * is).sum();
        let ratio = products / was.iter().map(|was| was * was).sum::<f64>();
        assert!((1.5..2.05).contains(&ratio), "axis {axis}: {ratio}");
    }
    let changed = rows("linear-axis", &["expansion=30%@6h"]);
    let largest = |rows: &[Row]| {
        drifts(rows, 1)
            .iter()
            .fold(0.0, |most: f64, of| most.max(of.abs()))
    };
    assert!(largest(&changed) < 1.4 * largest(&same));
}

#[test]
fn a_machine_that_cannot_change_refuses_to() {
    struct Still;
    impl athermal_trial::machine::Machine for Still {
        fn name(&self) -> &'static str {
            "still"
        }
        fn summary(&self) -> &'static str {
            "A machine at rest."
        }
        fn channels(&self) -> &[athermal_trial::machine::Channel] {
            &[]
        }
        fn set_points(&self) -> &[athermal_trial::machine::SetPoint] {
            &[]
        }
        fn start(
            &self,
            _setup: &Setup,
        ) -> Result<Box<dyn athermal_trial::machine::Simulation>, athermal_trial::machine::SetupError>
        {
            panic!("it is not asked to");
        }
    }
    let setup = Setup {
        changes: vec!["load=10%@1h".parse().unwrap()],
        ..Setup::default()
    };
    let refused = Simulated::new(&Still, setup).start().err().unwrap();
    assert_eq!(
        refused.to_string(),
        "`still` cannot change: leave `change` out"
    );
}
