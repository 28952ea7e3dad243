//! A live program: lines of the controller on standard input, what the graph makes of them as CSV on standard output.
//!
//! `my-controller | cargo run --release --example run -- model.json`

use std::error::Error;
use std::io::stdin;
use std::sync::Arc;

use athermal::Model;
use athermal::files::{Flush, Writer};
use athermal::run::live;
use my_node::MyNode;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1);
    let path = path.ok_or("name a model, or a graph in which nothing needs fitting")?;
    let mut engine = Model::load(path)?.engine()?;
    let plan = Arc::clone(engine.plan());
    let outputs: Vec<String> = plan.outputs.iter().map(|out| out.name.clone()).collect();
    let mut source = MyNode::new(stdin().lock(), &plan);
    let mut sink = Writer::create("-", "time_s", &outputs, Flush::EachRow)?;
    live::run(&mut engine, &mut source, &mut sink)?;
    eprintln!("{} lines could not be read", source.skipped());
    Ok(())
}
