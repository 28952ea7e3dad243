//! How a diagram looks as a picture: letters, colours, curves; light and dark after the viewer's taste.

use std::fmt::Write as _;

use super::layout::{Layout, layout};
use super::{Box, Class, Diagram, Flow};
use crate::markup::escaped;

const MARGIN: f64 = 24.0;
const TITLE: f64 = 40.0;
const LEGEND: f64 = 40.0;
const LINE: f64 = 17.0;
const PADDING: f64 = 12.0;

const STYLE: &str = "
  text { font-family: system-ui, 'Segoe UI', Helvetica, Arial, sans-serif; font-size: 12px; fill: #3c4450 }
  .name { font-size: 14px; font-weight: 600; fill: #14181f }
  .title { font-size: 17px; font-weight: 600; fill: #14181f }
  .paper { fill: #ffffff }
  rect { stroke-width: 1.5 }
  .signal { fill: #e3f1ec; stroke: #3a8f75 }
  .feature { fill: #e6effa; stroke: #3f77b8 }
  .estimator { fill: #fdf0dd; stroke: #c9862b }
  .combiner { fill: #f4e6f6; stroke: #9450a4 }
  .output { fill: #eceef1; stroke: #5b6675 }
  path { fill: none; stroke: #5b6675; stroke-width: 1.5 }
  .truth { stroke: #3a8f75; stroke-dasharray: 5 4 }
  .delayed { stroke: #b0413e; stroke-dasharray: 2 4 }
  .head { fill: #5b6675; stroke: none }
  .truth-head { fill: #3a8f75; stroke: none }
  .delayed-head { fill: #b0413e; stroke: none }
  @media (prefers-color-scheme: dark) {
    text { fill: #c3cad5 }
    .name, .title { fill: #f2f5f9 }
    .paper { fill: #14181f }
    .signal { fill: #17352c; stroke: #58b596 }
    .feature { fill: #182b44; stroke: #6aa0dc }
    .estimator { fill: #402c10; stroke: #e0a552 }
    .combiner { fill: #36203b; stroke: #c182d0 }
    .output { fill: #2a303a; stroke: #97a3b4 }
    path { stroke: #97a3b4 }
    .truth { stroke: #58b596 }
    .delayed { stroke: #e07f7b }
    .head { fill: #97a3b4 }
    .truth-head { fill: #58b596 }
    .delayed-head { fill: #e07f7b }
  }
";

/// Where boxes and arrows are in the picture.
#[must_use]
pub fn places(diagram: &Diagram) -> Layout {
    let sizes: Vec<[f64; 2]> = diagram.boxes.iter().map(size).collect();
    layout(diagram, &sizes)
}

/// The text of the picture.
#[must_use]
pub fn text(diagram: &Diagram) -> String {
    let layout = places(diagram);
    let width = (layout.size[0] + 2.0 * MARGIN).max(560.0);
    let height = layout.size[1] + 2.0 * MARGIN + TITLE + LEGEND;
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" \
         width=\"{width:.0}\" height=\"{height:.0}\" role=\"img\" aria-label=\"{}\">\n<style>{STYLE}</style>\n\
         <rect class=\"paper\" width=\"100%\" height=\"100%\"/>\n",
        escaped(&diagram.name)
    );
    let _ = writeln!(
        text,
        "<text class=\"title\" x=\"{MARGIN}\" y=\"{:.0}\">{}</text>",
        MARGIN + 12.0,
        escaped(&diagram.name)
    );
    let _ = writeln!(
        text,
        "<g transform=\"translate({MARGIN} {})\">",
        MARGIN + TITLE
    );
    for (arrow, way) in diagram.arrows.iter().zip(&layout.arrows) {
        // A truth and data of the same node would lie on each other: the truth enters a little below.
        let below = match arrow.kind {
            Flow::Truth => 9.0,
            Flow::Data | Flow::Delayed => -3.0,
        };
        text.push_str(&curve(way, arrow.kind, below));
    }
    for (shown, place) in diagram.boxes.iter().zip(&layout.boxes) {
        text.push_str(&drawn(shown, *place));
    }
    text.push_str("</g>\n");
    text.push_str(&legend(diagram, height - MARGIN));
    text.push_str("</svg>\n");
    text
}

fn size(shown: &Box) -> [f64; 2] {
    // Of usual fonts, a letter is about 0.56 em wide, and a bold one 0.6.
    let title = 14.0 * 0.6 * shown.title.chars().count() as f64;
    let lines = shown
        .lines
        .iter()
        .map(|line| 12.0 * 0.56 * line.chars().count() as f64);
    let width = lines.fold(title, f64::max) + 2.0 * PADDING;
    let height = 20.0 + LINE * shown.lines.len() as f64 + 1.2 * PADDING;
    [width.max(90.0), height]
}

fn drawn(shown: &Box, [x, y, width, height]: [f64; 4]) -> String {
    let round = if shown.class == Class::Signal { 16 } else { 6 };
    let mut text = format!(
        "<rect class=\"{}\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" rx=\"{round}\"/>\n",
        shown.class.word()
    );
    let left = x + PADDING;
    let mut at = y + 0.6 * PADDING + 15.0;
    let _ = writeln!(
        text,
        "<text class=\"name\" x=\"{left:.1}\" y=\"{at:.1}\">{}</text>",
        escaped(&shown.title)
    );
    for line in &shown.lines {
        at += LINE;
        let _ = writeln!(
            text,
            "<text x=\"{left:.1}\" y=\"{at:.1}\">{}</text>",
            escaped(line)
        );
    }
    text
}

/// A curve along a way, level where it leaves, passes and arrives, and the head of the arrow.
fn curve(way: &[[f64; 2]], kind: Flow, below: f64) -> String {
    let (Some(first), Some(last)) = (way.first(), way.last()) else {
        return String::new();
    };
    let name = kind.word();
    let mut path = format!("M{:.1} {:.1}", first[0], first[1] + below);
    let end = last[0] - 7.0;
    for pair in way.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        let to_x = if to == *last { end } else { to[0] };
        let bend = (to_x - from[0]) / 2.0;
        let _ = write!(
            path,
            " C{:.1} {:.1} {:.1} {:.1} {to_x:.1} {:.1}",
            from[0] + bend,
            from[1] + below,
            to_x - bend,
            to[1] + below,
            to[1] + below
        );
    }
    let (tip_x, tip_y) = (last[0], last[1] + below);
    let head = if kind == Flow::Data {
        "head".to_owned()
    } else {
        format!("{name}-head")
    };
    format!(
        "<path class=\"{name}\" d=\"{path}\"/>\n<path class=\"{head}\" d=\"M{tip_x:.1} {tip_y:.1} l-8 -4 v8 z\"/>\n"
    )
}

fn legend(diagram: &Diagram, y: f64) -> String {
    let flows = [
        (Flow::Data, "values"),
        (Flow::Truth, "the truth, once measured"),
        (Flow::Delayed, "values of earlier ticks"),
    ];
    let mut text = String::new();
    let mut x = MARGIN;
    for (flow, label) in flows {
        if diagram.arrows.iter().any(|arrow| arrow.kind == flow) {
            let middle = y - 4.0;
            let _ = writeln!(
                text,
                "<path class=\"{}\" d=\"M{x:.1} {middle:.1} h30\"/>\n<text x=\"{:.1}\" y=\"{y:.1}\">{label}</text>",
                flow.word(),
                x + 38.0
            );
            x += 38.0 + 7.0 * label.chars().count() as f64 + 24.0;
        }
    }
    text
}
