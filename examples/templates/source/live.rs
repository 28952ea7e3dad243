//! The source in a whole run: lines in, what the graph makes of them out.

use std::error::Error;

use athermal::Model;
use athermal::run::live::{self, Frame, Sink, SinkError};
use my_node::MyNode;

/// Keeps all outputs.
#[derive(Default)]
struct Kept(Vec<Vec<f64>>);

impl Sink for Kept {
    fn put(&mut self, frame: &Frame<'_>) -> Result<(), SinkError> {
        self.0.push(frame.outputs.to_vec());
        Ok(())
    }
}

#[test]
fn a_plate_that_warms_steadily_has_a_steady_slope() -> Result<(), Box<dyn Error>> {
    let mut engine = Model::load("graphs/my-node.toml")?.engine()?;
    let line = |tick| format!("{} plate={}\n", 10 * tick, 20.0 + 0.01 * f64::from(tick));
    let lines: String = (0..=60).map(line).collect();
    let mut source = MyNode::new(lines.as_bytes(), engine.plan());
    let mut kept = Kept::default();
    live::run(&mut engine, &mut source, &mut kept)?;
    assert_eq!((kept.0.len(), source.skipped()), (61, 0));
    // A centikelvin in ten seconds is 60 mK/min; of the room nothing is known.
    let [plate, room] = kept.0[60][..] else {
        panic!("the graph has two outputs: {:?}", kept.0[60]);
    };
    assert!((plate - 60.0).abs() < 1e-9 && room.is_nan());
    Ok(())
}
