//! `[outputs]`: what comes out, and how it passes from an old graph to a new one; references are left to the compiler.

use super::placeholder;
use super::reading::{known_keys, meant, missing, one_or_more, quantity, table};
use crate::diagnostic::Diagnostics;
use crate::document::graph_file::OutputDecl;
use crate::document::problem;
use crate::document::tree::{Data, Entry, Value};

pub(super) fn declare(outputs: Option<&Value>, diagnostics: &mut Diagnostics) -> Vec<OutputDecl> {
    let Some(outputs) = outputs.and_then(|outputs| table(outputs, "outputs", diagnostics)) else {
        return Vec::new();
    };
    outputs
        .iter()
        .filter_map(|(name, entry)| output(name, entry, diagnostics))
        .collect()
}

fn output(name: &str, entry: &Entry, diagnostics: &mut Diagnostics) -> Option<OutputDecl> {
    let what = format!("output \"{name}\"");
    let (from, blend) = match &entry.value.data {
        Data::Table(keys) => {
            let known = ["from", "blend"];
            known_keys(keys, &known, &what, diagnostics);
            let blend = meant(keys, "blend", &known).and_then(|value| {
                let rate = quantity(value, "blend", ("nm/s", false), diagnostics)?;
                Some((rate, value.place))
            });
            match meant(keys, "from", &known) {
                Some(from) => (from, blend),
                None => {
                    missing(
                        &entry.value,
                        "from",
                        &what,
                        Some("name what it gives, e.g. from = \"vote\""),
                        diagnostics,
                    );
                    return None;
                }
            }
        }
        _ => (&entry.value, None),
    };
    let from = one_or_more(from, name, &what, diagnostics)?;
    for (text, place) in &from {
        for placeholder in placeholder::names(text) {
            let problem = problem::UnknownPlaceholder {
                name: placeholder.to_owned(),
                known: Vec::new(),
                what: what.clone(),
                instead: Some(for_all_members(text)),
            };
            diagnostics.report(*place, problem);
        }
    }
    Some(OutputDecl {
        name: name.to_owned(),
        place: entry.key,
        from,
        blend,
    })
}

/// A reference to one member, as one to all of them: `watch:reason.{axis}` is `watch:reason`.
fn for_all_members(text: &str) -> String {
    let open: Vec<String> = placeholder::names(text)
        .map(|name| format!("{{{name}}}"))
        .collect();
    let mut all = text.to_owned();
    for placeholder in open {
        all = match all.strip_suffix(&placeholder) {
            Some(before) if before.ends_with('.') => before.trim_end_matches('.').to_owned(),
            _ => all.replace(&placeholder, "*"),
        };
    }
    all
}
