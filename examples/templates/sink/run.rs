//! A live program: rows of a log in, what the graph makes of them as lines on standard output.
//!
//! `tail -n +1 -f log.csv | cargo run --release --example run -- model.json - | my-controller`

use std::error::Error;
use std::io::stdout;
use std::sync::Arc;

use athermal::Model;
use athermal::files::{Options, Reader, layout};
use athermal::run::live;
use my_node::MyNode;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(model), Some(log)) = (arguments.next(), arguments.next()) else {
        return Err("name a model (or a graph in which nothing needs fitting) and a log".into());
    };
    let mut engine = Model::load(model)?.engine()?;
    let plan = Arc::clone(engine.plan());
    let mut source = Reader::open(log, layout(&plan), Options::default())?;
    let mut sink = MyNode::new(stdout().lock(), &plan);
    live::run(&mut engine, &mut source, &mut sink)?;
    Ok(())
}
