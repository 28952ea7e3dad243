//! Decides how shapes become dots: PNG in the light colours, twice the size of the user units.

use epaint_default_fonts::UBUNTU_LIGHT;
use tiny_skia::{
    Color, FillRule, LineJoin, Paint, PathBuilder, Pixmap, Rect, Stroke, StrokeDash, Transform,
};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

use super::colours::light;
use super::{Anchor, Scene, Shape};

const SCALE: f32 = 2.0;
/// Size of letters in user units.
const LETTERS: f32 = 13.0;

/// What shapes are drawn on.
struct Canvas<'a> {
    pixels: Pixmap,
    face: Face<'a>,
    /// From the units of a shape to dots.
    to_dots: Transform,
}

impl Scene {
    /// The picture; none where it would be beyond all size.
    pub(super) fn png(&self) -> Option<Vec<u8>> {
        let (width, height) = (self.width as f32 * SCALE, self.height as f32 * SCALE);
        let mut canvas = Canvas {
            pixels: Pixmap::new(width as u32, height as u32)?,
            face: Face::parse(UBUNTU_LIGHT, 0).ok()?,
            to_dots: Transform::from_scale(SCALE, SCALE),
        };
        canvas.pixels.fill(colour("paper", 1.0));
        let whole = canvas.to_dots;
        self.behind.iter().for_each(|shape| canvas.draw(shape));
        let (x, y, width, height) = self.frame;
        canvas.to_dots = whole.pre_translate(x as f32, y as f32);
        self.inside.iter().for_each(|shape| canvas.draw(shape));
        canvas.to_dots = whole;
        let mut frame = PathBuilder::new();
        frame.push_rect(Rect::from_xywh(
            x as f32,
            y as f32,
            width as f32,
            height as f32,
        )?);
        canvas.stroke(frame, colour("line", 1.0), &line(1.0));
        let rest = self.ticks.iter().chain(&self.around);
        rest.for_each(|shape| canvas.draw(shape));
        canvas.pixels.encode_png().ok()
    }
}

/// A colour of the page by its name.
fn colour(name: &str, opacity: f32) -> Color {
    let [red, green, blue] = light(name).unwrap_or_default();
    let mut colour = Color::from_rgba8(red, green, blue, 255);
    colour.apply_opacity(opacity);
    colour
}

fn line(width: f32) -> Stroke {
    Stroke {
        width,
        line_join: LineJoin::Round,
        ..Stroke::default()
    }
}

fn paint(colour: Color) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color(colour);
    paint.anti_alias = true;
    paint
}

impl Canvas<'_> {
    fn stroke(&mut self, path: PathBuilder, colour: Color, stroke: &Stroke) {
        if let Some(path) = path.finish() {
            let paint = paint(colour);
            self.pixels
                .stroke_path(&path, &paint, stroke, self.to_dots, None);
        }
    }

    fn fill(&mut self, path: PathBuilder, colour: Color, to_dots: Transform) {
        if let Some(path) = path.finish() {
            let paint = paint(colour);
            self.pixels
                .fill_path(&path, &paint, FillRule::Winding, to_dots, None);
        }
    }

    fn draw(&mut self, shape: &Shape) {
        match shape {
            Shape::Rect {
                class,
                x,
                y,
                width,
                height,
            } => {
                let filled = match class.strip_prefix("bars ") {
                    Some(class) => colour(class, 0.8),
                    None => colour(class, 1.0),
                };
                let rect = Rect::from_xywh(*x as f32, *y as f32, *width as f32, *height as f32);
                let mut path = PathBuilder::new();
                if let Some(rect) = rect {
                    path.push_rect(rect);
                }
                self.fill(path, filled, self.to_dots);
            }
            Shape::Line { class, from, to } => {
                let mut path = PathBuilder::new();
                path.move_to(from.0 as f32, from.1 as f32);
                path.line_to(to.0 as f32, to.1 as f32);
                let (name, dash) = match *class {
                    "limit" => ("bad", StrokeDash::new(vec![5.0, 4.0], 0.0)),
                    class => (class, None),
                };
                let stroke = Stroke { dash, ..line(1.0) };
                self.stroke(path, colour(name, 1.0), &stroke);
            }
            Shape::Path {
                class,
                points,
                dots: true,
            } => {
                let mut path = PathBuilder::new();
                for (x, y) in points.iter().filter(|(_, y)| !y.is_nan()) {
                    path.push_circle(*x as f32, *y as f32, 1.5);
                }
                self.fill(path, colour(class, 0.55), self.to_dots);
            }
            Shape::Path { class, points, .. } => {
                self.stroke(joined(points), colour(class, 1.0), &line(1.3));
            }
            Shape::Text { x, y, anchor, text } => self.write(*x as f32, *y as f32, *anchor, text),
            Shape::Key { class, x, y } => {
                let mut path = PathBuilder::new();
                path.move_to(*x as f32, *y as f32);
                path.line_to(*x as f32 + 18.0, *y as f32);
                self.stroke(path, colour(class, 1.0), &line(3.0));
            }
        }
    }

    fn write(&mut self, x: f32, y: f32, anchor: Anchor, text: &str) {
        let face = self.face.clone();
        let size = LETTERS / f32::from(face.units_per_em());
        let glyphs: Vec<(GlyphId, f32)> = text
            .chars()
            .map(|letter| {
                let glyph = face.glyph_index(letter).unwrap_or_default();
                let advance = face.glyph_hor_advance(glyph).unwrap_or_default();
                (glyph, size * f32::from(advance))
            })
            .collect();
        let width: f32 = glyphs.iter().map(|(_, advance)| advance).sum();
        let mut x = match anchor {
            Anchor::Start => x,
            Anchor::Middle => x - 0.5 * width,
            Anchor::End => x - width,
        };
        for (glyph, advance) in glyphs {
            let mut outline = Outline(PathBuilder::new());
            face.outline_glyph(glyph, &mut outline);
            let place = self.to_dots.pre_translate(x, y).pre_scale(size, -size);
            self.fill(outline.0, colour("ink", 1.0), place);
            x += advance;
        }
    }
}

/// A line through the points, broken where there is no value. A point alone is no line, and not seen.
fn joined(points: &[(f64, f64)]) -> PathBuilder {
    let mut path = PathBuilder::new();
    for run in points.split(|(_, y)| y.is_nan()) {
        let mut run = run.iter().map(|&(x, y)| (x as f32, y as f32));
        if let Some((x, y)) = run.next() {
            path.move_to(x, y);
            run.for_each(|(x, y)| path.line_to(x, y));
        }
    }
    path
}

/// A letter's outline as a path.
struct Outline(PathBuilder);

impl OutlineBuilder for Outline {
    fn move_to(&mut self, x: f32, y: f32) {
        self.0.move_to(x, y);
    }
    fn line_to(&mut self, x: f32, y: f32) {
        self.0.line_to(x, y);
    }
    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.0.quad_to(x1, y1, x, y);
    }
    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.0.cubic_to(x1, y1, x2, y2, x, y);
    }
    fn close(&mut self) {
        self.0.close();
    }
}

#[cfg(test)]
mod tests {
    use tiny_skia::Pixmap;

    use crate::chart::{Chart, Layer};

    #[test]
    fn a_line_has_its_colour_where_it_runs_and_paper_beside_it() {
        let (x, y) = ([0.0, 1.0, 2.0], [1.0, 1.0, 1.0]);
        let chart = Chart {
            height: 132.0,
            layers: vec![Layer::line(&x, &y, "c2", "one")],
            y_range: Some((0.0, 2.0)),
            ..Chart::default()
        };
        let picture = Pixmap::decode_png(&chart.png().unwrap()).unwrap();
        assert_eq!((picture.width(), picture.height()), (1800, 264));
        // The frame is 70 high and begins at 26, so its middle is at 61, which is the dot 122.
        let dot = |x, y| {
            let dot = picture.pixel(x, y).unwrap();
            [dot.red(), dot.green(), dot.blue()]
        };
        assert_eq!(dot(900, 122), [0x0b, 0x62, 0xa8]);
        assert_eq!(dot(900, 112), [0xff, 0xff, 0xff]);
    }

    #[test]
    fn nothing_is_no_picture() {
        assert!(Chart::default().png().is_none());
    }
}
