//! Three states, their limits, hysteresis and dwell.

use super::machine::{Machine, NONE, compiled, goes_on_alike};

const GRAPH: &str = r#"
[signals.drift]
unit = "nm/min"
channels = ["X", "Z"]
max_age = "5min"
[nodes.stability]
type = "stability"
inputs.drift = "drift"
stable_below = "30 nm/min"
transient_above = "80 nm/min"
hysteresis = "5 nm/min"
dwell = "2min"
[outputs]
state = "stability"
worst = "stability:worst"
"#;

#[test]
fn a_state_changes_at_its_limit_after_the_dwell_and_back_below_the_hysteresis() {
    let mut machine = Machine::new(GRAPH);
    let mut minute = 0.0;
    let mut after = |drift: f64| {
        minute += 1.0;
        machine.step(60.0 * minute, &[0.0, drift]).get("state.Z")
    };
    assert_eq!(after(-29.0), 0.0, "the first state needs no dwell");
    assert_eq!([after(30.0), after(30.0), after(30.0)], [0.0, 0.0, 1.0]);
    assert_eq!(
        [after(26.0), after(26.0), after(26.0)],
        [1.0; 3],
        "not 5 nm/min below the limit"
    );
    assert_eq!(
        [
            after(-24.0),
            after(26.0),
            after(24.0),
            after(24.0),
            after(24.0)
        ],
        [1.0, 1.0, 1.0, 1.0, 0.0]
    );
    assert_eq!(
        [after(-90.0), after(90.0), after(81.0)],
        [0.0, 0.0, 2.0],
        "two states at once"
    );
    assert_eq!([after(76.0), after(76.0), after(76.0)], [2.0; 3]);
}

#[test]
fn the_worst_axis_counts_and_without_a_drift_there_is_no_state() {
    let mut machine = Machine::new(GRAPH);
    assert_eq!(machine.step(0.0, &[10.0, 50.0]).get("worst.worst"), 1.0);
    machine.step(60.0, &[NONE, NONE]);
    assert!(machine.get("state.X").is_nan());
    assert!(
        Machine::new(GRAPH)
            .step(0.0, &[10.0, NONE])
            .get("worst.worst")
            .is_nan()
    );
}

#[test]
fn it_goes_on_from_a_snapshot_and_refuses_limits_out_of_order() {
    let rows: Vec<_> = (0..100)
        .map(|i| {
            (
                f64::from(i) * 60.0,
                vec![f64::from(i * 7 % 120), f64::from(i * 13 % 90)],
            )
        })
        .collect();
    goes_on_alike(GRAPH, &rows);
    let told = compiled(&GRAPH.replace("80 nm/min", "20 nm/min"))
        .0
        .unwrap_err();
    assert!(told.contains("lies below `stable_below`"), "{told}");
    let told = compiled(&GRAPH.replace("5 nm/min", "5 K/min"))
        .0
        .unwrap_err();
    assert!(told.contains("K/min, which cannot be in nm/min"), "{told}");
}

#[test]
fn a_limit_that_cannot_be_read_hides_no_other_mistake() {
    let text = GRAPH
        .replace("80 nm/min", "80 K/min")
        .replace("\"5 nm/min\"", "\"9 um/min\"");
    let told = compiled(&text).0.unwrap_err();
    assert!(told.contains("`transient_above` is in K/min"), "{told}");
    assert!(told.contains("never become stable again"), "{told}");
}
