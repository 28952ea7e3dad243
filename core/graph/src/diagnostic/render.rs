//! How diagnostics look, for people and for programs; which there are is decided by the collector.

use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

use super::{Diagnostic, Diagnostics, Place, Severity, Sources};

/// Lines longer than this are shown in part; minified files would fill the terminal.
const WIDEST: usize = 400;

pub(super) fn text(
    diagnostics: &Diagnostics,
    sources: &Sources,
    color: bool,
    width: usize,
) -> String {
    let renderer = if color {
        Renderer::styled()
    } else {
        Renderer::plain()
    };
    let renderer = renderer
        .decor_style(DecorStyle::Ascii)
        .term_width(width.clamp(40, WIDEST));
    let mut out = String::new();
    for diagnostic in diagnostics.iter() {
        if !out.is_empty() {
            out.push_str("\n\n");
        }
        out.push_str(&renderer.render(&[group(diagnostic, sources)]));
    }
    if !out.is_empty() {
        out.push('\n');
    }
    out
}

fn group<'a>(diagnostic: &'a Diagnostic, sources: &'a Sources) -> Group<'a> {
    let level = match diagnostic.severity {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
    };
    let mut group = Group::with_title(level.primary_title(&diagnostic.message).id(diagnostic.code));
    let mut shown: Vec<(Place, &str, AnnotationKind)> = Vec::new();
    if let Some(place) = diagnostic.place {
        shown.push((place, &diagnostic.label, AnnotationKind::Primary));
    }
    shown.extend(
        diagnostic
            .related
            .iter()
            .map(|(place, label)| (*place, label.as_str(), AnnotationKind::Context)),
    );
    // One snippet per file, in the order in which files are first named.
    while let Some(&(first, ..)) = shown.first() {
        let (here, elsewhere): (Vec<_>, Vec<_>) = shown
            .into_iter()
            .partition(|(place, ..)| place.source == first.source);
        let ranges: Vec<(usize, usize)> = here
            .iter()
            .map(|(place, ..)| sources.range(*place))
            .collect();
        let start = ranges.iter().map(|(start, _)| *start).min().unwrap_or(0);
        let end = ranges.iter().map(|(_, end)| *end).max().unwrap_or(0);
        // Only the lines that are shown: the renderer looks through all that it gets, each time.
        let (line, lines) = sources.lines(first.source, start, end);
        let text = &sources.text(first.source)[lines.clone()];
        let mut snippet = Snippet::source(text)
            .line_start(line)
            .path(sources.path(first.source));
        for ((_, label, kind), (start, end)) in here.iter().zip(ranges) {
            let annotation = kind.span(start - lines.start..end - lines.start);
            snippet = snippet.annotation(if label.is_empty() {
                annotation
            } else {
                annotation.label(*label)
            });
        }
        group = group.element(snippet);
        shown = elsewhere;
    }
    if let Some(phrase) = diagnostic.context_phrase() {
        group = group.element(Level::NOTE.message(phrase));
    }
    if let Some(help) = &diagnostic.help {
        group = group.element(Level::HELP.message(help));
    }
    group
}

pub(super) fn json(diagnostics: &Diagnostics, sources: &Sources) -> serde_json::Value {
    let list: Vec<serde_json::Value> = diagnostics
        .iter()
        .map(|diagnostic| {
            let position = diagnostic.place.map(|place| sources.line_column(place));
            let message = match diagnostic.context_phrase() {
                Some(phrase) => format!("{} ({phrase})", diagnostic.message),
                None => diagnostic.message.clone(),
            };
            serde_json::json!({
                "code": diagnostic.code,
                "severity": diagnostic.severity.word(),
                "file": diagnostic.place.map(|place| sources.path(place.source)),
                "line": position.map(|(line, _)| line),
                "column": position.map(|(_, column)| column),
                "span": diagnostic.place.map(|place| [place.start, place.end]),
                "message": message,
                "help": diagnostic.help,
            })
        })
        .collect();
    serde_json::json!({ "diagnostics": list })
}
