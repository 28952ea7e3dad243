//! Decides how series become a picture: scales, decimation that keeps extremes, SVG. Which pictures there are is decided by the page.

use std::fmt::Write as _;

use super::Series;

/// Outer size and inner frame in user units.
const WIDTH: f64 = 900.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = 12.0;
/// Above the frame stands the legend.
const TOP: f64 = 26.0;
const BOTTOM: f64 = 30.0;

/// How a mark is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mark {
    Line,
    Dots,
    Bars,
}

/// One layer of a chart.
pub(crate) struct Layer<'a> {
    pub(crate) x: &'a [f64],
    pub(crate) y: &'a [f64],
    /// The class that gives its colour: `c1` … `c6`.
    pub(crate) class: &'static str,
    pub(crate) label: String,
    pub(crate) mark: Mark,
}

impl<'a> Layer<'a> {
    pub(crate) fn line(series: &'a Series, class: &'static str, label: impl Into<String>) -> Self {
        Self {
            x: &series.time_s,
            y: &series.value,
            class,
            label: label.into(),
            mark: Mark::Line,
        }
    }
}

/// A chart to be drawn.
pub(crate) struct Chart<'a> {
    pub(crate) title: String,
    pub(crate) x_label: &'a str,
    pub(crate) y_label: String,
    pub(crate) height: f64,
    pub(crate) layers: Vec<Layer<'a>>,
    /// Stretches of the x axis with a class each, drawn behind.
    pub(crate) bands: Vec<(f64, f64, &'static str)>,
    /// A horizontal limit.
    pub(crate) limit: Option<f64>,
    /// Lowest and highest y; else what the layers span.
    pub(crate) y_range: Option<(f64, f64)>,
    /// Whether x is in seconds and shown in hours, and can be zoomed.
    pub(crate) time: bool,
}

/// Colours and lines of all charts, light and dark.
pub(crate) const STYLE: &str = "\
svg.chart{font:13px system-ui,sans-serif;fill:var(--ink)}\
.chart .frame{fill:none;stroke:var(--line)}.chart .grid{stroke:var(--grid);stroke-width:1;vector-effect:non-scaling-stroke}\
.chart path{fill:none;stroke-width:1.3;vector-effect:non-scaling-stroke;stroke-linejoin:round}\
.chart .dots{stroke-linecap:round;stroke-width:3;opacity:.55}.chart .bars{stroke:none;opacity:.8}\
.c1{stroke:var(--c1)}.c2{stroke:var(--c2)}.c3{stroke:var(--c3)}.c4{stroke:var(--c4)}.c5{stroke:var(--c5)}.c6{stroke:var(--c6)}\
.bars.c1{fill:var(--c1)}.bars.c2{fill:var(--c2)}\
.chart .limit{stroke:var(--bad);stroke-dasharray:5 4;vector-effect:non-scaling-stroke}\
.chart .s1{fill:var(--s1)}.chart .s2{fill:var(--s2)}.chart .s0{fill:none}";

/// The colours, for pictures that stand alone and as the root of the page.
pub(crate) const COLOURS: &str = "\
:root{--ink:#1b2430;--paper:#fff;--line:#9aa5b1;--grid:#e4e8ec;--muted:#5d6975;--bad:#b3261e;--good:#1b7f4b;\
--c1:#5d6975;--c2:#0b62a8;--c3:#c2410c;--c4:#1b7f4b;--c5:#7b3fa0;--c6:#8a6d00;--s1:#fff3d6;--s2:#fbdcd8}\
@media(prefers-color-scheme:dark){:root{--ink:#e6eaee;--paper:#14181d;--line:#5b6672;--grid:#2a313a;--muted:#9aa5b1;--bad:#ff8a80;--good:#6fd39b;\
--c1:#a9b4bf;--c2:#6cb4f0;--c3:#ff9d66;--c4:#6fd39b;--c5:#c79be6;--c6:#e0c24d;--s1:#3a3218;--s2:#43211f}}\
@media print{:root{--ink:#000;--paper:#fff;--line:#777;--grid:#ddd;--muted:#444;--bad:#b3261e;--good:#1b7f4b;\
--c1:#5d6975;--c2:#0b62a8;--c3:#c2410c;--c4:#1b7f4b;--c5:#7b3fa0;--c6:#8a6d00;--s1:#fff3d6;--s2:#fbdcd8}}";

/// At most about twice as many points as `buckets`: of each stretch of x the lowest and the highest, in their order.
pub(crate) fn decimated(x: &[f64], y: &[f64], buckets: usize) -> Vec<(f64, f64)> {
    let count = x.len().min(y.len());
    if count <= 2 * buckets {
        return (0..count).map(|i| (x[i], y[i])).collect();
    }
    let per = count.div_ceil(buckets);
    let mut kept = Vec::with_capacity(2 * buckets);
    for from in (0..count).step_by(per) {
        let stretch = from..(from + per).min(count);
        let present = || stretch.clone().filter(|&i| !y[i].is_nan());
        let low = present().min_by(|&a, &b| y[a].total_cmp(&y[b]));
        let high = present().max_by(|&a, &b| y[a].total_cmp(&y[b]));
        match (low, high) {
            (Some(low), Some(high)) => {
                kept.push((x[low.min(high)], y[low.min(high)]));
                if low != high {
                    kept.push((x[low.max(high)], y[low.max(high)]));
                }
            }
            _ => kept.push((x[from], f64::NAN)),
        }
    }
    kept
}

/// Round numbers that divide a range.
pub(crate) fn ticks(low: f64, high: f64, about: usize) -> Vec<f64> {
    let raw = (high - low) / about as f64;
    if !(raw > 0.0 && raw.is_finite()) {
        return vec![low];
    }
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|nice| nice * power)
        .find(|step| *step >= raw)
        .unwrap_or(10.0 * power);
    let first = (low / step).ceil() as i64;
    let last = (high / step).floor() as i64;
    (first..=last).map(|n| n as f64 * step).collect()
}

/// The same for a number of decimals that the step needs.
fn label(value: f64, step: f64) -> String {
    let decimals = if step >= 1.0 {
        0
    } else {
        (-step.log10()).ceil().min(6.0) as usize
    };
    format!("{value:.decimals$}")
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

impl Chart<'_> {
    fn x_range(&self) -> Option<(f64, f64)> {
        let all = self.layers.iter().flat_map(|layer| layer.x.iter().copied());
        range(all)
    }

    /// The picture as an `svg` element.
    pub(crate) fn svg(&self) -> String {
        let Some((x0, x1)) = self.x_range() else {
            return String::new();
        };
        let x1 = if x1 > x0 { x1 } else { x0 + 1.0 };
        let spanned = range(
            self.layers
                .iter()
                .flat_map(|layer| layer.y.iter().copied())
                .chain(self.limit),
        );
        let (mut y0, mut y1) = self.y_range.or(spanned).unwrap_or((0.0, 1.0));
        if y1 <= y0 {
            (y0, y1) = (y0 - 1.0, y1 + 1.0);
        }
        let margin = if self.y_range.is_some() {
            0.0
        } else {
            0.04 * (y1 - y0)
        };
        (y0, y1) = (y0 - margin, y1 + margin);
        let (width, height) = (WIDTH - LEFT - RIGHT, self.height - TOP - BOTTOM);
        let px = |x: f64| (x - x0) / (x1 - x0) * width;
        let py = |y: f64| (y1 - y.clamp(y0, y1)) / (y1 - y0) * height;
        let mut svg = String::new();
        let _ = write!(
            svg,
            "<svg class=\"chart\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {}\" role=\"img\" aria-label=\"{}\">",
            self.height,
            escaped(&self.title)
        );
        let marks = ticks(y0, y1, 5);
        let step = if marks.len() > 1 {
            marks[1] - marks[0]
        } else {
            1.0
        };
        for y in &marks {
            let at = TOP + py(*y);
            let _ = write!(
                svg,
                "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                WIDTH - RIGHT,
                LEFT - 6.0,
                at + 4.0,
                label(*y, step)
            );
        }
        let zoom = if self.time {
            format!(" class=\"zoom\" data-x0=\"{x0}\" data-x1=\"{x1}\"")
        } else {
            String::new()
        };
        let _ = write!(
            svg,
            "<svg{zoom} x=\"{LEFT}\" y=\"{TOP}\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" preserveAspectRatio=\"none\">"
        );
        for (from, to, class) in &self.bands {
            let _ = write!(
                svg,
                "<rect class=\"{class}\" x=\"{:.1}\" width=\"{:.1}\" y=\"0\" height=\"{height}\"/>",
                px(*from),
                (px(*to) - px(*from)).max(0.4)
            );
        }
        if let Some(limit) = self.limit {
            let _ = write!(
                svg,
                "<line class=\"limit\" x1=\"0\" x2=\"{width}\" y1=\"{0:.1}\" y2=\"{0:.1}\"/>",
                py(limit)
            );
        }
        for layer in &self.layers {
            layer.draw(&mut svg, &px, &py, height, y0);
        }
        let _ = write!(
            svg,
            "</svg><rect class=\"frame\" x=\"{LEFT}\" y=\"{TOP}\" width=\"{width}\" height=\"{height}\"/><g class=\"ticks\">"
        );
        let scale = if self.time { 3600.0 } else { 1.0 };
        let marks = ticks(x0 / scale, x1 / scale, 8);
        let step = if marks.len() > 1 {
            marks[1] - marks[0]
        } else {
            1.0
        };
        for x in marks {
            let _ = write!(
                svg,
                "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                LEFT + px(x * scale),
                self.height - BOTTOM + 15.0,
                label(x, step)
            );
        }
        let _ = write!(
            svg,
            "</g><text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>",
            WIDTH - RIGHT,
            self.height - 2.0,
            escaped(self.x_label)
        );
        let mut x = LEFT;
        let _ = write!(
            svg,
            "<text x=\"{x}\" y=\"{}\">{}</text>",
            TOP - 9.0,
            escaped(&self.y_label)
        );
        x += 9.0 * self.y_label.chars().count() as f64 + 16.0;
        for layer in self.layers.iter().filter(|layer| !layer.label.is_empty()) {
            let _ = write!(
                svg,
                "<path class=\"{}\" d=\"M{x} {1}h18\" style=\"stroke-width:3\"/><text x=\"{2}\" y=\"{3}\">{4}</text>",
                layer.class,
                TOP - 13.0,
                x + 23.0,
                TOP - 9.0,
                escaped(&layer.label)
            );
            x += 23.0 + 7.6 * layer.label.chars().count() as f64 + 18.0;
        }
        svg.push_str("</svg>");
        svg
    }

    /// The picture as a file of its own.
    pub(crate) fn file(&self) -> String {
        let style = format!("<style>{COLOURS}{STYLE}</style>");
        self.svg().replacen('>', &format!(">{style}"), 1)
    }
}

impl Layer<'_> {
    fn draw(
        &self,
        svg: &mut String,
        px: &dyn Fn(f64) -> f64,
        py: &dyn Fn(f64) -> f64,
        height: f64,
        y0: f64,
    ) {
        if self.mark == Mark::Bars {
            let width = if self.x.len() > 1 {
                px(self.x[1]) - px(self.x[0])
            } else {
                20.0
            };
            for (&x, &y) in self.x.iter().zip(self.y) {
                let (at, base) = (py(y), py(y0.max(0.0)).min(height));
                let _ = write!(
                    svg,
                    "<rect class=\"bars {}\" x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\"/>",
                    self.class,
                    px(x) - 0.45 * width,
                    at.min(base),
                    0.9 * width,
                    (base - at).abs()
                );
            }
            return;
        }
        let class = if self.mark == Mark::Dots { "dots " } else { "" };
        let _ = write!(svg, "<path class=\"{class}{}\" d=\"", self.class);
        let mut drawing = false;
        for (x, y) in decimated(self.x, self.y, 1500) {
            if y.is_nan() {
                drawing = false;
            } else if self.mark == Mark::Dots {
                let _ = write!(svg, "M{:.1} {:.1}h0", px(x), py(y));
            } else {
                let _ = write!(
                    svg,
                    "{}{:.1} {:.1}",
                    if drawing { 'L' } else { 'M' },
                    px(x),
                    py(y)
                );
                drawing = true;
            }
        }
        svg.push_str("\"/>");
    }
}

fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values
        .filter(|value| value.is_finite())
        .fold(None, |range, value| {
            let (low, high) = range.unwrap_or((value, value));
            Some((f64::min(low, value), f64::max(high, value)))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimation_keeps_the_lowest_and_the_highest_and_shows_gaps() {
        let x: Vec<f64> = (0..100_000).map(f64::from).collect();
        let mut y: Vec<f64> = x.iter().map(|x| (x * 0.001).sin()).collect();
        (y[12_345], y[70_001]) = (50.0, -40.0);
        y[30_000..40_000].fill(f64::NAN);
        let kept = decimated(&x, &y, 1000);
        assert!(kept.len() <= 2000);
        assert!(kept.contains(&(12_345.0, 50.0)) && kept.contains(&(70_001.0, -40.0)));
        assert!(kept.iter().any(|(_, y)| y.is_nan()));
        assert!(kept.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(-3.0, 103.0, 5), [0.0, 50.0, 100.0]);
        assert_eq!(ticks(0.0, 1.0, 5).len(), 6);
        assert_eq!(ticks(1.0, 1.0, 5), [1.0]);
    }

    #[test]
    fn a_name_cannot_break_the_page() {
        assert_eq!(escaped("<b>&\""), "&lt;b&gt;&amp;&quot;");
    }
}
