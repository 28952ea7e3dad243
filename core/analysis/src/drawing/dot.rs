//! How a diagram is written for Graphviz.

use std::fmt::Write as _;

use super::{Class, Diagram, Flow};

/// The text of a directed graph.
#[must_use]
pub fn text(diagram: &Diagram) -> String {
    let mut text = format!(
        "digraph {} {{\n  rankdir=LR;\n  node [shape=box, style=rounded, fontname=\"Helvetica\"];\n",
        quoted(&diagram.name)
    );
    for (number, shown) in diagram.boxes.iter().enumerate() {
        let lines: Vec<&str> = std::iter::once(shown.title.as_str())
            .chain(shown.lines.iter().map(String::as_str))
            .collect();
        let shape = match shown.class {
            Class::Signal => ", shape=ellipse",
            Class::Output => ", peripheries=2",
            _ => "",
        };
        let _ = writeln!(
            text,
            "  n{number} [label={}{shape}];",
            quoted(&lines.join("\n"))
        );
    }
    for arrow in &diagram.arrows {
        let style = match arrow.kind {
            Flow::Data => "",
            Flow::Delayed => " [style=dashed, label=\"delayed\"]",
            Flow::Truth => " [style=dashed, label=\"truth\"]",
        };
        let _ = writeln!(text, "  n{} -> n{}{style};", arrow.from, arrow.to);
    }
    text.push_str("}\n");
    text
}

fn quoted(text: &str) -> String {
    let text = text.replace('\\', "\\\\").replace('"', "\\\"");
    format!("\"{}\"", text.replace('\n', "\\n"))
}
