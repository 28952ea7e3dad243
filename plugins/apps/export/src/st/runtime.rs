//! Parts the runtime: what is the same for every graph, and what reads the tables of one, which is written under its name. So two graphs
//! fit into one project.

use std::collections::BTreeSet;

/// The runtime, written by hand.
const RUNTIME: &str = include_str!("../../st/athermal_rt.st");

/// The runtime in two parts.
pub(super) struct Parts {
    /// What is the same for every graph.
    pub(super) shared: String,
    /// What is written once for each, with the names as they are in the runtime.
    pub(super) own: String,
    /// The names that are the same for every graph.
    names: BTreeSet<&'static str>,
}

/// Pieces of a text: names, and what stands between them.
fn pieces(text: &str) -> impl Iterator<Item = &str> {
    let is_of_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut rest = text;
    std::iter::from_fn(move || {
        let first = rest.chars().next()?;
        let is_name = is_of_name(first);
        let end = rest.find(|c: char| is_of_name(c) != is_name);
        let (piece, after) = rest.split_at(end.unwrap_or(rest.len()));
        rest = after;
        Some(piece)
    })
}

fn names(text: &str) -> impl Iterator<Item = &str> {
    pieces(text).filter(|piece| piece.starts_with("AT_"))
}

/// A declaration with the comment before it, and the names that it makes known.
fn declarations() -> Vec<(&'static str, Vec<&'static str>)> {
    let ends = [
        ("FUNCTION ", "\nEND_FUNCTION\n"),
        ("TYPE ", "\nEND_TYPE\n"),
        ("VAR_GLOBAL ", "\nEND_VAR\n"),
    ];
    let mut all = Vec::new();
    let mut rest = RUNTIME;
    // What comes first, at the beginning of a line, and where it ends.
    while let Some((begin, word, end)) = ends
        .iter()
        .filter_map(|(word, end)| {
            let at_start = rest.starts_with(word).then_some(0);
            let begin = at_start.or_else(|| Some(rest.find(&format!("\n{word}"))? + 1))?;
            let length = rest[begin..].find(end)? + end.len();
            Some((begin, *word, begin + length))
        })
        .min()
    {
        let (declaration, after) = rest.split_at(end);
        let body = &declaration[begin..];
        let made = if word == "VAR_GLOBAL " {
            let lines = body.lines().map(str::trim_start);
            lines
                .filter_map(|line| names(line).next().filter(|name| line.starts_with(name)))
                .collect()
        } else {
            names(body).take(1).collect()
        };
        all.push((declaration.trim_start_matches('\n'), made));
        rest = after;
    }
    all
}

impl Parts {
    pub(super) fn new() -> Self {
        let all = declarations();
        let known: BTreeSet<&str> = all
            .iter()
            .flat_map(|(_, made)| made.iter().copied())
            .collect();
        // Whatever the runtime does not declare is in the tables; whatever needs that is the graph's own too.
        let mut own: BTreeSet<&str> = names(RUNTIME)
            .filter(|name| !known.contains(name))
            .collect();
        loop {
            let before = own.len();
            for (text, made) in &all {
                if names(text).any(|name| own.contains(name)) {
                    own.extend(made);
                }
            }
            if own.len() == before {
                break;
            }
        }
        let part = |is_own: bool| {
            let chosen = all
                .iter()
                .filter(|(_, made)| made.iter().any(|name| own.contains(name)) == is_own);
            let texts: Vec<&str> = chosen.map(|(text, _)| *text).collect();
            texts.join("\n")
        };
        Self {
            shared: part(false),
            own: part(true),
            names: known.difference(&own).copied().collect(),
        }
    }

    /// A text in which what is a graph's own has its name in place of `AT`.
    pub(super) fn named(&self, text: &str, graph: &str) -> String {
        let mut named = String::with_capacity(text.len());
        for piece in pieces(text) {
            match piece.strip_prefix("AT_") {
                Some(rest) if !self.names.contains(piece) => {
                    named.push_str(graph);
                    named.push('_');
                    named.push_str(rest);
                }
                _ => named.push_str(piece),
            }
        }
        named
    }
}
