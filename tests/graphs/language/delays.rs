//! Delay and pick: values later, and under another name, with their stamps.

use super::samples;
use crate::workbench::{Bench, Graph, problems};

fn graph(nodes: Graph, output: &str) -> Graph {
    nodes.outputs(&format!(
        "out = '{output}'; also = ['temperature', 'position']"
    ))
}

fn late(delay: &str) -> Graph {
    let late = samples().node("late", "delay", "position");
    graph(late.with(&format!("delay = '{delay}'")), "late")
}

#[test]
fn a_delay_of_a_tick_gives_the_value_at_the_next_one_whenever_that_is() {
    let mut bench = Bench::new(&late("1 tick"), &[]);
    assert!(bench.tick(0.0, &[("position.Z", 1.0)])[0].is_nan());
    assert_eq!(bench.tick(7.0, &[("position.Z", 2.0)])[0], 1.0);
    assert_eq!(bench.stamp("late.Z"), 7.0, "the stamp moves with the value");
    assert_eq!(bench.tick(8.0, &[("temperature.room", 20.0)])[0], 2.0);
    assert!(bench.tick(9.0, &[])[0].is_nan(), "it is given once");
}

#[test]
fn a_delay_of_a_duration_gives_the_value_at_the_first_tick_at_or_after() {
    let mut bench = Bench::new(&late("30s"), &[]);
    let given: Vec<f64> = [
        (0.0, 1.0),
        (10.0, 2.0),
        (29.0, f64::NAN),
        (30.0, f64::NAN),
        (41.0, f64::NAN),
        (99.0, f64::NAN),
    ]
    .into_iter()
    .map(|(now, value)| bench.tick(now, &[("position.Z", value)])[0])
    .collect();
    assert!(given[..3].iter().all(|value| value.is_nan()));
    assert_eq!(given[3], 1.0);
    assert_eq!(given[4], 2.0);
    assert_eq!(
        bench.stamp("late.Z"),
        40.0,
        "its own stamp and the delay, not the tick that gave it"
    );
    assert!(given[5].is_nan());
}

#[test]
fn feedback_goes_through_a_delay() {
    // `now` carries the position and what `before` gives; `before` is `now` one tick later.
    let nodes = samples()
        .node("now", "pick", "position.Z before")
        .with("names = ['Z', 'last']")
        .node("before", "delay", "now.Z")
        .with("delay = '1 tick'; unit = 'nm'");
    let mut bench = Bench::new(&graph(nodes, "now"), &[]);
    assert!(bench.tick(0.0, &[("position.Z", 1.0)])[1].is_nan());
    assert_eq!(bench.tick(1.0, &[("position.Z", 2.0)])[..2], [2.0, 1.0]);
    assert_eq!(bench.tick(2.0, &[("position.Z", 4.0)])[..2], [4.0, 2.0]);
}

#[test]
fn nothing_else_closes_a_loop() {
    let nodes = samples()
        .node("one", "pick", "position.Z two.Z")
        .node("two", "pick", "one");
    let told = problems(&graph(nodes, "one"));
    assert!(
        told.contains("one → two → one") || told.contains("two → one → two"),
        "{told}"
    );
    assert!(told.contains("`delay`"), "{told}");
}

#[test]
fn pick_passes_values_stamps_and_absence() {
    let nodes = samples()
        .node("some", "pick", "late.Z temperature.chuck")
        .node("late", "delay", "position")
        .with("delay = '10s'");
    let mut bench = Bench::new(&graph(nodes, "some"), &[]);
    let given = bench.tick(0.0, &[("position.Z", 5.0), ("temperature.chuck", 30.0)]);
    assert!(given[0].is_nan());
    assert_eq!(given[1], 30.0);
    let given = bench.tick(15.0, &[("temperature.chuck", 31.0)]);
    assert_eq!(given[0], 5.0);
    assert_eq!(given[1], 31.0);
    assert_eq!(
        (bench.stamp("some.Z"), bench.stamp("some.chuck")),
        (10.0, 15.0)
    );
}

#[test]
fn what_closes_a_loop_is_given_an_age_where_it_is_read_since_its_signal_cannot_say_one() {
    let looped = |read: &str| {
        let nodes = samples().node("now", "sum", read);
        let nodes = nodes.node("before", "delay", "now");
        graph(nodes.with("delay = '1 tick'; unit = 'nm'"), "now")
    };
    let told = problems(&looped("position.Z before"));
    let advice = "set it where it is read: `inputs.signal = { from = \"…\", max_age = \"1min\" }`";
    assert!(told.contains(advice), "{told}");
    let heeded = "{ from = ['position.Z', 'before'], max_age = '1min' }";
    Bench::new(&looped(heeded), &[]);
}
