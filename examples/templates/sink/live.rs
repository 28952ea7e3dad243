//! The sink in a whole run: a log in, lines with what the graph makes of it out.

use std::error::Error;

use athermal::Model;
use athermal::files::{Options, Reader, layout};
use athermal::run::live;
use my_node::MyNode;

#[test]
fn each_row_of_a_log_becomes_a_line() -> Result<(), Box<dyn Error>> {
    let mut engine = Model::load("graphs/my-node.toml")?.engine()?;
    let log = "time_s,plate,room\n0,20,\n10,20.5,\n20,21,\n";
    let layout = layout(engine.plan());
    let mut source = Reader::from_read("a log", log.as_bytes(), layout, Options::default())?;
    let mut lines = Vec::new();
    let mut sink = MyNode::new(&mut lines, engine.plan());
    live::run(&mut engine, &mut source, &mut sink)?;
    let lines = String::from_utf8(lines)?;
    // Over less than five minutes there is no slope.
    let none = "gradient.plate=- gradient.room=-";
    let expected = ["0.000", "10.000", "20.000"].map(|time| format!("{time} {none}"));
    assert_eq!(lines.lines().collect::<Vec<_>>(), expected);
    Ok(())
}
