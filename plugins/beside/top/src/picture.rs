//! Where what stands.

use athermal_core::figures;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style, Stylize as _};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{
    Axis, Block, Borders, Chart, Dataset, GraphType, Paragraph, Row, Table, Wrap,
};
use serde_json::Value;

use crate::known::{CURVES, Known, SPANS_S};

/// As on the page: what is measured, what is predicted, what is left.
const COLOURS: [Color; 3] = [Color::Gray, Color::LightBlue, Color::LightRed];
const BAD: Style = Style::new()
    .fg(Color::LightRed)
    .add_modifier(Modifier::BOLD);
const GOOD: Style = Style::new().fg(Color::LightGreen);
const MUTED: Style = Style::new().fg(Color::DarkGray);

/// Draws all of it.
pub(crate) fn draw(frame: &mut Frame<'_>, known: &Known) {
    let area = frame.area();
    let axes = axes(known);
    let alarms = alarms(known);
    let below = (area.height / 3).clamp(4, 16);
    let rows = [
        Constraint::Length(1),
        Constraint::Length(axes.len() as u16),
        Constraint::Min(6),
        Constraint::Length(below),
        Constraint::Length(1),
    ];
    let [head, said, curve, sensors, keys] = Layout::vertical(rows).areas(area);
    frame.render_widget(Paragraph::new(title(known)), head);
    frame.render_widget(Paragraph::new(axes), said);
    chart(frame, known, curve);
    let halves = match alarms.is_empty() {
        true => [Constraint::Fill(1), Constraint::Length(0)],
        false => [Constraint::Fill(3), Constraint::Fill(2)],
    };
    let [left, right] = Layout::horizontal(halves).areas(sensors);
    table(frame, known, left);
    if !alarms.is_empty() {
        let block = Block::new().borders(Borders::TOP).title("alarms");
        frame.render_widget(
            Paragraph::new(alarms)
                .wrap(Wrap { trim: true })
                .block(block),
            right,
        );
    }
    let words = known.said.clone().unwrap_or_else(|| {
        let held = if known.is_held {
            "held; p goes on"
        } else {
            "p hold"
        };
        format!("←→ axis  +- span  ↑↓ sensors  a acknowledge  {held}  q end")
    });
    frame.render_widget(Paragraph::new(words).style(MUTED), keys);
}

fn text(of: &Value) -> &str {
    of.as_str().unwrap_or("–")
}

fn title(known: &Known) -> Line<'static> {
    let status = &known.status;
    let is_running = status["state"] == "running" && known.lost.is_none();
    let mut spans = vec![
        Span::from(text(&status["name"]).to_owned()).bold(),
        Span::from("  "),
        Span::styled(
            text(&status["state"]).to_owned(),
            if is_running { GOOD } else { BAD },
        ),
        Span::from(format!(
            "  revision {}",
            &text(&status["revision"])
                .chars()
                .take(8)
                .collect::<String>()
        )),
    ];
    if let Some(last) = known.now["last_s"].as_f64() {
        spans.push(Span::from(format!(
            "  last tick {}",
            figures::instant(last)
        )));
    }
    let journal = &status["journal"];
    let mut bad = |words: String| spans.push(Span::styled(format!("  {words}"), BAD));
    if journal["is_degraded"] == true {
        bad("journal not written".to_owned());
    }
    for source in status["sources"].as_array().into_iter().flatten() {
        if source["connected"] != true {
            bad(format!(
                "{} {}",
                text(&source["source"]),
                text(&source["connection"])
            ));
        }
    }
    if status["frozen"] == true {
        spans.push(Span::styled("  learning frozen", MUTED));
    }
    Line::from(spans)
}

/// Why nothing may be said, or each axis in a sentence.
fn axes(known: &Known) -> Vec<Line<'static>> {
    let doubt = known.doubt();
    let is_known = doubt.is_none();
    let mut lines: Vec<Line<'static>> = doubt.map(|of| Line::styled(of, BAD)).into_iter().collect();
    for (nth, axis) in known.axes().iter().enumerate() {
        let chosen = if nth == known.axis { "▶ " } else { "  " };
        let (mark, style) = match axis["may_measure"].as_bool().filter(|_| is_known) {
            Some(true) => ("✓ ", GOOD),
            Some(false) => ("✗ ", BAD),
            None => ("? ", MUTED),
        };
        let words = match known.lost {
            Some(_) => format!("{}: not known", text(&axis["axis"])),
            None => text(&axis["sentence"]).to_owned(),
        };
        lines.push(Line::from(vec![
            Span::from(chosen),
            Span::styled(mark, style),
            Span::from(words),
        ]));
    }
    lines
}

fn points(known: &Known, channel: &str) -> Vec<(f64, f64)> {
    let history = &known.history;
    let channels = history["channels"].as_array();
    let place = channels.and_then(|of| of.iter().position(|of| of["channel"] == channel));
    let Some(place) = place else {
        return Vec::new();
    };
    let numbers = |of: &Value| of.as_array().cloned().unwrap_or_default();
    let last = known.now["last_s"].as_f64().unwrap_or_default();
    let [times, lowest, highest] = [
        &history["time_s"],
        &history["lowest"][place],
        &history["highest"][place],
    ]
    .map(numbers);
    let all = times.iter().zip(lowest.iter().zip(&highest));
    // Both ends of a stretch, so that no extreme is lost.
    let both = all.filter_map(|(time, (low, high))| {
        let at = time.as_f64()? - last;
        Some([(at, low.as_f64()?), (at, high.as_f64()?)])
    });
    both.flatten().collect()
}

fn chart(frame: &mut Frame<'_>, known: &Known, area: Rect) {
    let curves = known.curves();
    let data: Vec<_> = curves
        .iter()
        .map(|(what, name)| (*what, points(known, name)))
        .collect();
    let values = || {
        data.iter()
            .flat_map(|(_, points)| points.iter().map(|(_, value)| *value))
    };
    let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    let axis = known.shown();
    let name = axis.map_or("", |of| text(&of["axis"]));
    let unit = axis.and_then(|of| of["unit"].as_str()).unwrap_or_default();
    let span = SPANS_S[known.span];
    let mut title = vec![Span::from(format!(
        " {name}, {unit}, {}: ",
        figures::time(span)
    ))];
    for (what, _) in &data {
        let place = CURVES.iter().position(|of| of == what).unwrap_or_default();
        title.push(Span::styled(format!("━ {what} "), COLOURS[place]));
    }
    let block = Block::new().borders(Borders::TOP).title(Line::from(title));
    if low > high {
        let words = Paragraph::new("nothing is known of its past").style(MUTED);
        return frame.render_widget(words.block(block), area);
    }
    let room = ((high - low) * 0.05).max(f64::MIN_POSITIVE.max(high.abs() * 1e-6));
    let sets = data.iter().map(|(what, points)| {
        let place = CURVES.iter().position(|of| of == what).unwrap_or_default();
        let set = Dataset::default()
            .marker(Marker::Braille)
            .style(COLOURS[place]);
        // Where values are rare there is nothing to join.
        let kind = if points.len() < 4 {
            GraphType::Scatter
        } else {
            GraphType::Line
        };
        set.graph_type(kind).data(points)
    });
    let bounds = [low - room, high + room];
    let labels = [bounds[0], (low + high) / 2.0, bounds[1]].map(figures::number);
    let times = [-span, -span / 2.0, 0.0].map(|of| {
        if of == 0.0 {
            "now".to_owned()
        } else {
            format!("-{}", figures::time(-of))
        }
    });
    let chart = Chart::new(sets.collect())
        .block(block)
        .legend_position(None)
        .x_axis(
            Axis::default()
                .bounds([-span, 0.0])
                .labels(times)
                .style(MUTED),
        )
        .y_axis(Axis::default().bounds(bounds).labels(labels).style(MUTED));
    frame.render_widget(chart, area);
}

/// Sensors: value, age, and what was left out of them.
fn table(frame: &mut Frame<'_>, known: &Known, area: Rect) {
    let channels = known.channels["channels"].as_array();
    let faults = &known.status["watched"]["faults"];
    let row = |of: &Value| {
        let name = text(&of["channel"]);
        let fault = faults
            .as_array()
            .into_iter()
            .flatten()
            .find(|it| it["channel"] == name);
        let left_out = of.as_object().into_iter().flatten().filter(|(key, count)| {
            let is_own = ["accepted", "age_s", "channel", "source"].contains(&key.as_str());
            !is_own && count.as_u64() > Some(0)
        });
        let left_out: Vec<_> = left_out
            .map(|(key, count)| format!("{count} {}", key.replace('_', " ")))
            .collect();
        let age = match of["age_s"].as_f64() {
            Some(age) if age < 1.0 => "< 1 s".to_owned(),
            Some(age) => figures::rounded(age.round()),
            None => "–".to_owned(),
        };
        let words = fault.map_or_else(|| left_out.join(", "), |of| text(&of["fault"]).to_owned());
        let style = if fault.is_some() { BAD } else { Style::new() };
        Row::new([name.to_owned(), age, of["accepted"].to_string(), words]).style(style)
    };
    let count = channels.map_or(0, Vec::len);
    let room = usize::from(area.height.saturating_sub(2));
    let first = known.first_sensor.min(count.saturating_sub(room));
    let rows: Vec<_> = channels
        .into_iter()
        .flatten()
        .skip(first)
        .take(room)
        .map(row)
        .collect();
    let shown = if count > room {
        format!(" {}-{} of {count}", first + 1, first + rows.len())
    } else {
        String::new()
    };
    let widths = [
        Constraint::Fill(3),
        Constraint::Length(8),
        Constraint::Length(9),
        Constraint::Fill(2),
    ];
    let table = Table::new(rows, widths)
        .header(Row::new(["channel", "age", "samples", "left out"]).style(MUTED))
        .block(
            Block::new()
                .borders(Borders::TOP)
                .title(format!("sensors{shown}")),
        );
    frame.render_widget(table, area);
}

fn alarms(known: &Known) -> Vec<Line<'static>> {
    let alarms = known.alarms["alarms"].as_array();
    let mut all: Vec<_> = alarms.into_iter().flatten().collect();
    // What is raised comes first.
    all.sort_by_key(|of| match text(&of["state"]) {
        "raised" => 0,
        "acknowledged" => 1,
        _ => 2,
    });
    let line = |of: &&Value| {
        let state = text(&of["state"]);
        let style = match state {
            "raised" => BAD,
            "acknowledged" => Style::new().fg(Color::Yellow),
            _ => MUTED,
        };
        let value = of["value"].as_f64().map_or_else(String::new, |value| {
            format!(" {} {}", figures::number(value), text(&of["unit"]))
        });
        let words = of["text"]
            .as_str()
            .map_or_else(String::new, |words| format!(": {words}"));
        Line::from(vec![
            Span::styled(format!("{state} "), style),
            Span::from(format!("{}{value}{words}", text(&of["name"]))),
        ])
    };
    all.iter().map(line).collect()
}
