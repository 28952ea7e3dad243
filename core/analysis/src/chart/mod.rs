//! Series as pictures: [`Chart`] holds what is drawn and lays it out; `scale` sets the axes and `svg` writes the shapes.

mod colours;
mod plot;
mod scale;
mod svg;

pub(crate) use colours::LINES;
pub use colours::{COLOURS, STYLE};
use colours::{UNSCALED, in_light};
pub use plot::Plot;

use scale::{decimated, label, range, thinned, ticks};

/// What is left free about the frame, in user units.
const LEFT: f64 = 62.0;
const RIGHT: f64 = 12.0;
/// Above the frame stands the legend, in as many rows as it needs.
const TOP: f64 = 26.0;
const ROW: f64 = 16.0;
/// The width of a letter, about.
const LETTER: f64 = 7.4;
const BOTTOM: f64 = 36.0;
/// Stretches of x of which the extremes are kept.
const BUCKETS: usize = 1500;

/// How a layer is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A line, broken where there is no value.
    Line,
    /// A dot per point.
    Dots,
    /// Bars from zero.
    Bars,
}

/// One layer of a chart: points of equal number of `x` and `y`.
#[derive(Debug, Clone)]
pub struct Layer<'a> {
    /// Where the points stand.
    pub x: &'a [f64],
    /// Their values; NaN where there is none.
    pub y: &'a [f64],
    /// The class that gives its colour: `c1` to `c6`.
    pub class: &'static str,
    /// Its text in the legend; empty for no entry.
    pub label: String,
    /// How it is drawn.
    pub mark: Mark,
}

impl<'a> Layer<'a> {
    /// A line.
    pub fn line(x: &'a [f64], y: &'a [f64], class: &'static str, label: impl Into<String>) -> Self {
        Self {
            x,
            y,
            class,
            label: label.into(),
            mark: Mark::Line,
        }
    }
}

/// A chart to be drawn.
#[derive(Debug, Clone)]
pub struct Chart<'a> {
    /// What it shows, for those who cannot see it.
    pub title: String,
    /// What x is.
    pub x_label: String,
    /// What y is, with its unit.
    pub y_label: String,
    /// Its width in user units, in which letters are 13 high.
    pub width: f64,
    /// Its height, a row of the legend included.
    pub height: f64,
    /// What is drawn, one over the other.
    pub layers: Vec<Layer<'a>>,
    /// Stretches of the x axis with a class each (`s1`, `s2`), drawn behind.
    pub bands: Vec<(f64, f64, &'static str)>,
    /// Horizontal limits.
    pub limits: Vec<f64>,
    /// Lowest and highest y; else what the layers span.
    pub y_range: Option<(f64, f64)>,
    /// Whether x is in seconds and shown in hours, and can be zoomed.
    pub time: bool,
    /// The x that is shown as 0.
    pub zero: f64,
}

impl Default for Chart<'_> {
    fn default() -> Self {
        Self {
            title: String::new(),
            x_label: String::new(),
            y_label: String::new(),
            width: 900.0,
            height: 220.0,
            layers: Vec::new(),
            bands: Vec::new(),
            limits: Vec::new(),
            y_range: None,
            time: false,
            zero: 0.0,
        }
    }
}

/// Something drawn, in user units of the picture. The class gives colour and line.
#[derive(Debug, Clone, PartialEq)]
enum Shape {
    Rect {
        class: String,
        x: f64,
        y: f64,
        width: f64,
        height: f64,
    },
    /// A straight line from one end to the other.
    Line {
        class: &'static str,
        from: (f64, f64),
        to: (f64, f64),
    },
    /// Points joined by lines, with gaps at NaN; or dots.
    Path {
        class: &'static str,
        points: Vec<(f64, f64)>,
        dots: bool,
    },
    Text {
        x: f64,
        y: f64,
        anchor: Anchor,
        text: String,
    },
    /// The line before an entry of the legend.
    Key { class: &'static str, x: f64, y: f64 },
}

/// Which end of a text stands at its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Anchor {
    Start,
    Middle,
    End,
}

/// A picture, laid out.
#[derive(Debug)]
struct Scene {
    title: String,
    width: f64,
    height: f64,
    /// The frame: x, y, width, height.
    frame: (f64, f64, f64, f64),
    /// The ends of x in seconds, from what is shown as 0, where it can be zoomed.
    zoom: Option<(f64, f64)>,
    behind: Vec<Shape>,
    /// What stands in the frame, in units from its corner.
    inside: Vec<Shape>,
    /// The figures along x, which change with the zoom.
    ticks: Vec<Shape>,
    around: Vec<Shape>,
}

impl Chart<'_> {
    /// The picture as an `svg` element of a page that has [`COLOURS`] and [`STYLE`]; nothing where there is nothing to draw.
    #[must_use]
    pub fn svg(&self) -> String {
        self.scene().map_or_else(String::new, |scene| scene.svg())
    }

    /// The picture as an SVG file of its own, in the light colours: editors and typesetters know neither variables nor lines that keep
    /// their width when they are scaled.
    #[must_use]
    pub fn file(&self) -> String {
        let style = format!(
            "><style>{}{UNSCALED}</style><rect class=\"paper\" width=\"100%\" height=\"100%\"/>",
            in_light(STYLE)
        );
        self.svg().replacen('>', &style, 1)
    }

    /// Lowest and highest y of the picture.
    fn y_span(&self) -> (f64, f64) {
        let values = self.layers.iter().flat_map(|layer| layer.y.iter().copied());
        let spanned = range(values.chain(self.limits.iter().copied()));
        let (low, high) = self.y_range.or(spanned).unwrap_or((0.0, 1.0));
        let (low, high) = if high > low {
            (low, high)
        } else {
            (low - 1.0, low + 1.0)
        };
        let margin = if self.y_range.is_some() {
            0.0
        } else {
            0.04 * (high - low)
        };
        (low - margin, high + margin)
    }

    fn scene(&self) -> Option<Scene> {
        let (x0, x1) = range(self.layers.iter().flat_map(Layer::edges))?;
        let x1 = if x1 > x0 { x1 } else { x0 + 1.0 };
        let (y0, y1) = self.y_span();
        let (around, rows) = self.legend();
        let top = TOP + ROW * rows as f64;
        let whole = self.height + ROW * rows as f64;
        let (right, width) = (self.width - RIGHT, self.width - LEFT - RIGHT);
        let height = self.height - TOP - BOTTOM;
        let px = |x: f64| (x - x0) / (x1 - x0) * width;
        let py = |y: f64| (y1 - y.clamp(y0, y1)) / (y1 - y0) * height;
        let mut scene = Scene {
            title: self.title.clone(),
            width: self.width,
            height: whole,
            frame: (LEFT, top, width, height),
            zoom: self.time.then_some((x0 - self.zero, x1 - self.zero)),
            behind: Vec::new(),
            inside: Vec::new(),
            ticks: Vec::new(),
            around,
        };
        let marks = ticks(y0, y1, 5);
        let step = step_of(&marks);
        for y in marks {
            let at = top + py(y);
            scene.behind.push(Shape::Line {
                class: "grid",
                from: (LEFT, at),
                to: (right, at),
            });
            scene
                .behind
                .push(text(LEFT - 6.0, at + 4.0, Anchor::End, label(y, step)));
        }
        for (from, to, class) in &self.bands {
            scene.inside.push(Shape::Rect {
                class: (*class).to_owned(),
                x: px(*from),
                y: 0.0,
                width: (px(*to) - px(*from)).max(0.4),
                height,
            });
        }
        for &limit in &self.limits {
            scene.inside.push(Shape::Line {
                class: "limit",
                from: (0.0, py(limit)),
                to: (width, py(limit)),
            });
        }
        for layer in &self.layers {
            layer.draw(&mut scene.inside, &px, &py, py(0.0));
        }
        let scale = if self.time { 3600.0 } else { 1.0 };
        let marks = ticks((x0 - self.zero) / scale, (x1 - self.zero) / scale, 8);
        let step = step_of(&marks);
        let foot = whole - BOTTOM + 15.0;
        for x in marks {
            let at = LEFT + px(self.zero + x * scale);
            scene
                .ticks
                .push(text(at, foot, Anchor::Middle, label(x, step)));
        }
        scene
            .around
            .push(text(right, whole - 4.0, Anchor::End, self.x_label.clone()));
        Some(scene)
    }

    /// The legend, and how many rows it has beyond the first.
    fn legend(&self) -> (Vec<Shape>, usize) {
        let room = self.width - LEFT - RIGHT;
        let y_label = elided(&self.y_label, room);
        let length = |text: &str| LETTER * text.chars().count() as f64;
        let (mut x, mut row) = (LEFT + length(&y_label) + 16.0, 0);
        let mut shapes = vec![text(LEFT, TOP - 9.0, Anchor::Start, y_label)];
        for layer in self.layers.iter().filter(|layer| !layer.label.is_empty()) {
            let label = elided(&layer.label, room - 23.0);
            let width = 23.0 + length(&label);
            if x + width > self.width - RIGHT && x > LEFT {
                (x, row) = (LEFT, row + 1);
            }
            let y = TOP - 9.0 + ROW * row as f64;
            shapes.push(Shape::Key {
                class: layer.class,
                x,
                y: y - 4.0,
            });
            shapes.push(text(x + 23.0, y, Anchor::Start, label));
            x += width + 18.0;
        }
        (shapes, row)
    }
}

/// A text that has room in so many user units: one that is too long loses what stands before its end, where windows and units are.
fn elided(text: &str, room: f64) -> String {
    let (letters, most) = (text.chars().count(), (room / LETTER) as usize);
    if letters <= most || most < 3 {
        return text.to_owned();
    }
    let (before, after) = (most / 3, most - 1 - most / 3);
    let (start, end) = (
        text.chars().take(before),
        text.chars().skip(letters - after),
    );
    start.chain(['…']).chain(end).collect()
}

fn text(x: f64, y: f64, anchor: Anchor, text: String) -> Shape {
    Shape::Text { x, y, anchor, text }
}

fn step_of(marks: &[f64]) -> f64 {
    match marks {
        [first, second, ..] => second - first,
        _ => 1.0,
    }
}

impl Layer<'_> {
    /// How far apart bars stand.
    fn pitch(&self) -> f64 {
        match self.x {
            [first, second, ..] if self.mark == Mark::Bars => second - first,
            _ => 0.0,
        }
    }

    /// All x; of bars both their sides.
    fn edges(&self) -> impl Iterator<Item = f64> {
        let half = 0.5 * self.pitch();
        self.x.iter().flat_map(move |x| [x - half, x + half])
    }

    fn draw(
        &self,
        shapes: &mut Vec<Shape>,
        px: &dyn Fn(f64) -> f64,
        py: &dyn Fn(f64) -> f64,
        zero: f64,
    ) {
        if self.mark == Mark::Bars {
            let width = match self.pitch() {
                pitch if pitch > 0.0 => px(pitch) - px(0.0),
                _ => 20.0,
            };
            let bar = |(&x, &y): (&f64, &f64)| Shape::Rect {
                class: format!("bars {}", self.class),
                x: px(x) - 0.45 * width,
                y: py(y).min(zero),
                width: 0.9 * width,
                height: (zero - py(y)).abs(),
            };
            let there = self.x.iter().zip(self.y).filter(|(_, y)| !y.is_nan());
            shapes.extend(there.map(bar));
            return;
        }
        let kept = match self.mark {
            Mark::Dots => thinned(self.x, self.y, 2 * BUCKETS),
            _ => decimated(self.x, self.y, BUCKETS),
        };
        shapes.push(Shape::Path {
            class: self.class,
            points: kept
                .into_iter()
                .map(|(x, y)| (px(x), if y.is_nan() { y } else { py(y) }))
                .collect(),
            dots: self.mark == Mark::Dots,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_without_room_keeps_its_end() {
        let room = 12.0 * LETTER;
        assert_eq!(elided("gradients", room), "gradients");
        assert_eq!(elided("gradients.near_holder@150s", room), "grad…er@150s");
    }
}
