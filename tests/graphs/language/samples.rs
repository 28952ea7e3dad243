//! What counts as a sample: finite, within the range of its signal, of a channel that the data have.

use athermal::files::{Dataset, Options};
use athermal::run::recording::Table;

use super::samples;
use crate::workbench::{Bench, Graph, Scratch, plan};

fn graph() -> Graph {
    samples().outputs("out = ['temperature', 'position']")
}

#[test]
fn a_value_outside_the_range_or_infinite_is_absent_and_counted() {
    let mut bench = Bench::new(&graph(), &[]);
    let limits = [
        (-20.0, true),
        (200.0, true),
        (-20.001, false),
        (200.001, false),
        (-180.0, false),
        (1e9, false),
    ];
    for (nth, (value, taken)) in limits.into_iter().enumerate() {
        let given = bench.tick(nth as f64, &[("temperature.room", value)]);
        assert_eq!(given[0].is_nan(), !taken, "{value}");
    }
    // A position has no range, and any finite value counts.
    assert_eq!(bench.tick(10.0, &[("position.Z", 1e300)])[2], 1e300);
    assert!(bench.tick(11.0, &[("position.Z", f64::INFINITY)])[2].is_nan());
    assert!(bench.tick(12.0, &[("position.Z", f64::NEG_INFINITY)])[2].is_nan());
    assert!(bench.tick(13.0, &[("position.Z", f64::NAN)])[2].is_nan());
    assert_eq!(
        bench.engine.rejected(),
        [4, 0, 2],
        "a NaN is no sample at all, and not counted"
    );
}

#[test]
fn a_channel_that_the_data_lack_is_a_mistake_unless_it_is_optional() {
    let scratch = Scratch::new("optional");
    let file = scratch.file("data.csv", "t,room,Z\n0,21,5\n1,22,6\n");
    let data = Dataset::new(vec![file], Options::default());
    let text = graph();
    let error = Table::read(&data, &plan(&text)).err().unwrap().to_string();
    for part in ["`chuck`", "`room`", "`Z`", "data.csv"] {
        assert!(error.contains(part), "{part} in {error}");
    }
    let text = text.replace("unit = \"Cel\"", "unit = \"Cel\"\noptional = [\"chuck\"]");
    let table = Table::read(&data, &plan(&text)).unwrap();
    let rows: Vec<_> = table.events().iter().map(|(_, values)| values).collect();
    assert_eq!(rows.len(), 2);
    assert!(rows.iter().all(|row| row[1].is_nan()));
    assert_eq!((rows[0][0], rows[0][2], rows[1][0]), (21.0, 5.0, 22.0));
}
