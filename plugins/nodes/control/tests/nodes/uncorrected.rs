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

#[test]
fn what_is_not_what_was_commanded_or_not_reported_is_not_known_and_the_reason_says_so() {
    let graph = GRAPH
        .replace(
            "[nodes.free]",
            "[signals.asked]\nunit = \"um\"\nchannels = [\"Z\"]\ncolumn = \"asked\"\nmax_age = \"30s\"\n[nodes.free]",
        )
        .replace("applied = \"applied\" }", "applied = \"applied\", commanded = \"asked\" }\ndiffers = \"3 nm\"")
        .replace("free = \"free\"", "free = \"free\"\nwhy = \"free:reason\"");
    let mut machine = Machine::new(&graph);
    let is = |found: f64, expected: f64| found == expected || found.is_nan() && expected.is_nan();
    for (nth, (samples, free, why)) in [
        // Within 3 nm, and where nothing was commanded there is nothing to differ from.
        ([105.0, 0.002, NONE], 103.0, 0.0),
        ([105.0, 0.010, 0.012], 95.0, 0.0),
        // The wrong sign, and twice as much.
        ([105.0, -0.010, 0.012], NONE, 2.0),
        ([105.0, 0.024, 0.012], NONE, 2.0),
        ([105.0, 0.012, 0.012], 93.0, 0.0),
    ]
    .into_iter()
    .enumerate()
    {
        machine.step(10.0 * nth as f64, &samples);
        assert!(
            is(machine.get("free.Z"), free) && is(machine.get("why.Z"), why),
            "{nth}: {}",
            machine.get("why.Z")
        );
    }
    machine.step(100.0, &[105.0, NONE, 0.012]);
    assert!(machine.get("free.Z").is_nan() && machine.get("why.Z") == 1.0);
    let alone = graph.replace("differs = \"3 nm\"", "");
    assert!(
        compiled(&alone)
            .0
            .unwrap_err()
            .contains("`differs` and `inputs.commanded` go together")
    );
    let kelvin = graph.replace("3 nm", "3 K");
    assert!(
        compiled(&kelvin)
            .0
            .unwrap_err()
            .contains("`differs` is in K")
    );
}
