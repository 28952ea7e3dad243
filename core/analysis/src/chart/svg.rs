//! How shapes are written as SVG.

use std::fmt::Write as _;

use super::{Anchor, Scene, Shape};
use crate::markup::escaped;

impl Scene {
    pub(super) fn svg(&self) -> String {
        let mut svg = String::new();
        let _ = write!(
            svg,
            "<svg class=\"chart\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">",
            self.width,
            self.height,
            escaped(&self.title)
        );
        self.behind.iter().for_each(|shape| shape.write(&mut svg));
        let zoom = self.zoom.map_or_else(String::new, |(from, to)| {
            format!(" class=\"zoom\" data-x0=\"{from}\" data-x1=\"{to}\"")
        });
        let (x, y, width, height) = self.frame;
        let _ = write!(
            svg,
            "<svg{zoom} x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" preserveAspectRatio=\"none\">"
        );
        self.inside.iter().for_each(|shape| shape.write(&mut svg));
        let _ = write!(
            svg,
            "</svg><rect class=\"frame\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"/><g class=\"ticks\">"
        );
        self.ticks.iter().for_each(|shape| shape.write(&mut svg));
        svg.push_str("</g>");
        self.around.iter().for_each(|shape| shape.write(&mut svg));
        svg.push_str("</svg>");
        svg
    }
}

impl Shape {
    fn write(&self, svg: &mut String) {
        let _ = match self {
            Self::Rect {
                class,
                x,
                y,
                width,
                height,
            } => write!(
                svg,
                "<rect class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\"/>"
            ),
            Self::Line { class, from, to } => write!(
                svg,
                "<line class=\"{class}\" x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\"/>",
                from.0, from.1, to.0, to.1
            ),
            Self::Path {
                class,
                points,
                dots,
            } => {
                let dotted = if *dots { "dots " } else { "" };
                let _ = write!(
                    svg,
                    "<path class=\"{dotted}{class}\" transform=\"scale(.1)\" d=\""
                );
                path(svg, points, *dots);
                svg.write_str("\"/>")
            }
            Self::Text { x, y, anchor, text } => {
                let anchor = match anchor {
                    Anchor::Start => "",
                    Anchor::Middle => " text-anchor=\"middle\"",
                    Anchor::End => " text-anchor=\"end\"",
                };
                write!(
                    svg,
                    "<text x=\"{x:.1}\" y=\"{y:.1}\"{anchor}>{}</text>",
                    escaped(text)
                )
            }
            Self::Key { class, x, y } => write!(
                svg,
                "<path class=\"{class}\" d=\"M{x:.1} {y:.1}h18\" style=\"stroke-width:3\"/>"
            ),
        };
    }
}

/// Points as steps in tenths of a unit, which is half as long as coordinates.
fn path(svg: &mut String, points: &[(f64, f64)], dots: bool) {
    let (mut drawing, mut last) = (false, (0, 0));
    for &(x, y) in points {
        if y.is_nan() {
            drawing = false;
            continue;
        }
        let at = ((10.0 * x).round() as i64, (10.0 * y).round() as i64);
        let (dx, dy) = (at.0 - last.0, at.1 - last.1);
        let command = if drawing && !dots { 'l' } else { 'm' };
        let gap = if dy < 0 { "" } else { " " };
        let _ = write!(svg, "{command}{dx}{gap}{dy}");
        if dots {
            svg.push_str("h0");
        }
        (drawing, last) = (true, at);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_stops_at_a_gap_and_goes_on_after_it() {
        let mut svg = String::new();
        let gap = (2.0, f64::NAN);
        path(
            &mut svg,
            &[(0.0, 1.0), (1.0, 2.0), gap, (3.0, 4.0), (4.0, 3.5)],
            false,
        );
        assert_eq!(svg, "m0 10l10 10m20 20l10-5");
    }
}
