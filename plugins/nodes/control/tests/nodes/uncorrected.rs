//! What is taken off a position.

use super::machine::{Machine, NONE, compiled, goes_on_alike};

const GRAPH: &str = r#"
[signals.position]
unit = "nm"
channels = ["Z"]
max_age = "2min"
[signals.applied]
unit = "um"
channels = ["Z"]
column = "applied"
max_age = "30s"
[nodes.free]
type = "uncorrected"
inputs = { position = "position", applied = "applied" }
[outputs]
free = "free"
"#;

#[test]
fn the_correction_held_at_the_sample_is_taken_off_in_the_unit_of_the_position() {
    let mut machine = Machine::new(GRAPH);
    machine.step(0.0, &[NONE, 0.002]);
    assert!(machine.get("free.Z").is_nan());
    // 105 nm measured, of which 2 nm were put there; the same sample's correction counts, not the one before.
    assert_eq!(machine.step(10.0, &[105.0, NONE]).get("free.Z"), 103.0);
    assert_eq!(machine.step(20.0, &[105.0, 0.004]).get("free.Z"), 101.0);
    assert!(
        machine.step(60.0, &[105.0, NONE]).get("free.Z").is_nan(),
        "too old"
    );
}

#[test]
fn before_the_first_report_nothing_or_zero_was_applied_as_stated() {
    assert!(
        Machine::new(GRAPH)
            .step(0.0, &[105.0, NONE])
            .get("free.Z")
            .is_nan()
    );
    let zero = GRAPH.replace("[outputs]", "until_first = \"zero\"\n[outputs]");
    let mut machine = Machine::new(&zero);
    assert_eq!(machine.step(0.0, &[105.0, NONE]).get("free.Z"), 105.0);
    assert_eq!(machine.step(10.0, &[105.0, 0.005]).get("free.Z"), 100.0);
    assert!(machine.step(100.0, &[105.0, NONE]).get("free.Z").is_nan());
    let rows: Vec<_> = (0..40)
        .map(|i| {
            (
                f64::from(i) * 20.0,
                vec![f64::from(i), if i == 3 { 0.001 } else { NONE }],
            )
        })
        .collect();
    goes_on_alike(&zero, &rows);
}

#[test]
fn corrections_and_positions_go_together_one_by_one() {
    let two = GRAPH.replacen("channels = [\"Z\"]", "channels = [\"Y\", \"Z\"]", 1);
    let told = compiled(&two).0.unwrap_err();
    assert!(
        told.contains("`applied` has 1 channels and `position` has 2"),
        "{told}"
    );
    let kelvin = GRAPH.replace("unit = \"um\"", "unit = \"K\"");
    assert!(
        compiled(&kelvin)
            .0
            .unwrap_err()
            .contains("was corrected in K")
    );
}
