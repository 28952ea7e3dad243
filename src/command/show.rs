//! `athermal show`: a graph as a plan, or as a picture.

use std::path::PathBuf;

use athermal::Model;
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};
use serde_json::{Value, json};

use crate::drawing::{Diagram, Flow, diagram, dot, mermaid, plan, svg};
use crate::terminal::{Answer, Failure, Terminal, print};

/// Show a graph: its plan, or a picture of it
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  athermal show graphs/die-tester.toml
  athermal show graphs/die-tester.toml --format svg > die-tester.svg
  athermal show graphs/die-tester.toml --format mermaid      for Markdown
  athermal show model.json --expand --format dot | dot -Tpdf -o graph.pdf")]
pub struct Show {
    /// The graph, or a model
    graph: PathBuf,
    /// What to print
    #[arg(id = "format", long, value_name = "FORMAT", value_parser = formats(), default_value = "plan")]
    format: String,
    /// Show each instance of a node with `each` on its own
    #[arg(long)]
    expand: bool,
}

fn formats() -> PossibleValuesParser {
    PossibleValuesParser::new([
        PossibleValue::new("plan").help("What stands in which slot, and what is done at a tick"),
        PossibleValue::new("mermaid").help("A flowchart for Markdown and web pages"),
        PossibleValue::new("dot").help("A graph for Graphviz"),
        PossibleValue::new("svg").help("A picture that needs no other program"),
        PossibleValue::new("json").help("Boxes and arrows for programs"),
    ])
}

impl Show {
    /// Compiles and prints.
    ///
    /// # Errors
    /// When the graph has mistakes.
    pub fn run(&self, _terminal: &Terminal) -> Result<Answer, Failure> {
        let model = Model::load(&self.graph)?;
        let drawn = || diagram(&model.plan, self.expand);
        let text = match self.format.as_str() {
            "mermaid" => mermaid::text(&drawn()),
            "dot" => dot::text(&drawn()),
            "svg" => svg::text(&drawn()),
            "json" => format!("{:#}\n", facts(&drawn())),
            _ => plan::text(&model.plan, self.expand),
        };
        print(text.as_bytes())?;
        Ok(Answer::Fine)
    }
}

fn facts(diagram: &Diagram) -> Value {
    let boxes: Vec<Value> = diagram
        .boxes
        .iter()
        .map(|shown| {
            let class = format!("{:?}", shown.class).to_lowercase();
            json!({ "name": shown.title, "class": class, "lines": shown.lines })
        })
        .collect();
    let arrows: Vec<Value> = diagram
        .arrows
        .iter()
        .map(|arrow| {
            let kind = match arrow.kind {
                Flow::Data => "data",
                Flow::Delayed => "delayed",
                Flow::Truth => "truth",
            };
            json!({ "from": arrow.from, "to": arrow.to, "kind": kind })
        })
        .collect();
    json!({ "name": diagram.name, "boxes": boxes, "arrows": arrows })
}
