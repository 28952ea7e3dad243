//! How a diagram is written for Mermaid, which web pages and Markdown files draw.

use std::fmt::Write as _;

use super::{Class, Diagram, Flow};

/// The text of a flowchart.
#[must_use]
pub fn text(diagram: &Diagram) -> String {
    let mut text = String::from("flowchart LR\n");
    for (number, shown) in diagram.boxes.iter().enumerate() {
        let lines = std::iter::once(format!("<b>{}</b>", escaped(&shown.title)));
        let lines: Vec<String> = lines
            .chain(shown.lines.iter().map(|line| escaped(line)))
            .collect();
        let (open, close) = match shown.class {
            Class::Signal => ("([", "])"),
            Class::Output => ("[[", "]]"),
            _ => ("[", "]"),
        };
        let _ = writeln!(text, "  n{number}{open}\"{}\"{close}", lines.join("<br>"));
    }
    for arrow in &diagram.arrows {
        let line = match arrow.kind {
            Flow::Data => "-->",
            Flow::Delayed => "-. delayed .->",
            Flow::Truth => "-. truth .->",
        };
        let _ = writeln!(text, "  n{} {line} n{}", arrow.from, arrow.to);
    }
    text
}

/// Quotes and angle brackets as Mermaid's character codes.
fn escaped(text: &str) -> String {
    text.replace('#', "#35;")
        .replace('"', "#quot;")
        .replace('<', "#lt;")
        .replace('>', "#gt;")
}
