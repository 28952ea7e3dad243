//! The way to the when_lost and back.

use super::machine::{Machine, NONE, compiled, goes_on_alike};

const GRAPH: &str = r#"
[signals.c]
unit = "nm"
channels = ["Z"]
max_age = "1s"
[signals.bad]
unit = "1"
channels = ["Z"]
max_age = "1h"
[nodes.safe]
type = "safe_state"
inputs = { signal = "c", distrust = "bad" }
when_lost = "zero"
after = 2
max_slew = "10 nm/s"
[outputs]
c = "safe"
why = "safe:why"
"#;

fn at(machine: &mut Machine, t: f64, value: f64, bad: f64) -> (f64, f64) {
    machine.step(t, &[value, bad]);
    (machine.get("c.Z"), machine.get("why.Z"))
}

#[test]
fn it_bridges_two_ticks_goes_to_its_safe_value_and_comes_back_without_a_step() {
    let mut machine = Machine::new(GRAPH);
    assert_eq!(at(&mut machine, 0.0, 25.0, 0.0), (25.0, 0.0));
    assert_eq!(at(&mut machine, 2.0, NONE, NONE), (25.0, 1.0));
    assert_eq!(at(&mut machine, 4.0, NONE, NONE), (25.0, 1.0));
    assert_eq!(at(&mut machine, 5.0, NONE, NONE), (15.0, 3.0));
    assert_eq!(at(&mut machine, 7.0, NONE, NONE), (0.0, 3.0));
    assert_eq!(at(&mut machine, 8.0, 25.0, NONE), (10.0, 5.0));
    assert_eq!(at(&mut machine, 9.0, 25.0, NONE), (20.0, 5.0));
    assert_eq!(at(&mut machine, 10.0, 25.0, NONE), (25.0, 0.0));
}

#[test]
fn after_a_pause_it_goes_on_from_where_it_is_and_does_not_make_up_for_it_at_once() {
    let mut machine = Machine::new(GRAPH);
    at(&mut machine, 0.0, 5000.0, 0.0);
    for t in [2.0, 4.0] {
        at(&mut machine, t, NONE, NONE);
    }
    assert_eq!(at(&mut machine, 5.0, NONE, NONE).0, 4990.0);
    let minute = 60.0 * 10.0;
    assert_eq!(at(&mut machine, 3605.0, NONE, NONE).0, 4990.0 - minute);
    let text = GRAPH.replace(
        "max_slew = \"10 nm/s\"",
        "max_slew = \"10 nm/s\"\nmax_gap = \"2s\"",
    );
    let mut machine = Machine::new(&text);
    at(&mut machine, 0.0, 5000.0, 0.0);
    at(&mut machine, 2.0, NONE, NONE);
    at(&mut machine, 4.0, NONE, NONE);
    assert_eq!(at(&mut machine, 9.0, NONE, NONE).0, 4980.0);
    assert!(compiled(&text.replace("\"2s\"", "\"0s\"")).0.is_err());
}

#[test]
fn what_is_distrusted_is_not_put_out() {
    let mut machine = Machine::new(GRAPH);
    at(&mut machine, 0.0, 25.0, 0.0);
    assert_eq!(at(&mut machine, 1.0, 99.0, 3.0), (25.0, 2.0));
    at(&mut machine, 2.0, 99.0, NONE);
    assert_eq!(at(&mut machine, 3.0, 99.0, NONE), (15.0, 4.0));
    assert_eq!(
        at(&mut Machine::new(GRAPH), 0.0, 99.0, NONE).1,
        2.0,
        "not known whether to trust it"
    );
}

#[test]
fn it_can_hold_or_go_to_a_stated_value() {
    let held = GRAPH.replace("\"zero\"", "\"hold\"");
    let mut machine = Machine::new(&held);
    at(&mut machine, 0.0, 25.0, 0.0);
    for t in 1..9 {
        assert_eq!(at(&mut machine, f64::from(2 * t), NONE, NONE).0, 25.0);
    }
    let stated = GRAPH.replace("\"zero\"", "\"value\"\nvalue = \"0.005 um\"");
    assert_eq!(at(&mut Machine::new(&stated), 0.0, NONE, 0.0).0, 5.0);
    let told = compiled(&GRAPH.replace("\"zero\"", "\"value\""))
        .0
        .unwrap_err();
    assert!(told.contains("needs to know which"), "{told}");
    let bad = compiled(&GRAPH.replace("\"zero\"", "\"bad\""));
    let told = bad.0.unwrap_err();
    assert!(told.contains("when_lost"), "{told}");
    let negative = compiled(&GRAPH.replace("10 nm/s", "-10 nm/s"));
    let told = negative.0.unwrap_err();
    let max_slew = "`max_slew` is -10 nm/s and must be 0 or more";
    assert!(told.contains(max_slew), "{told}");
    let rows: Vec<_> = (0..90)
        .map(|i| {
            (
                f64::from(i),
                vec![
                    if i % 7 > 3 { NONE } else { f64::from(i) },
                    f64::from(i % 11 / 9),
                ],
            )
        })
        .collect();
    goes_on_alike(GRAPH, &rows);
}
