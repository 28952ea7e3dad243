//! How an exported graph is built and used: recipes, an example and a page on what it takes.

use crate::form::Form;

/// Replaces the name in a text that is written for any graph.
fn named(text: &str, form: &Form, float: bool) -> String {
    let precision = if float { " -DATHERMAL_FLOAT" } else { "" };
    text.replace("@name@", &form.name)
        .replace("@NAME@", &form.name.to_uppercase())
        .replace("@precision@", precision)
}

pub(super) fn makefile(form: &Form, float: bool) -> String {
    named(include_str!("Makefile.in"), form, float)
}

pub(super) fn cmake(form: &Form, float: bool) -> String {
    named(include_str!("CMakeLists.txt.in"), form, float)
}

pub(super) fn main(form: &Form) -> String {
    named(include_str!("main.c.in"), form, false)
}

pub(super) fn readme(form: &Form) -> String {
    let layout = form.layout;
    let text = named(include_str!("README.md.in"), form, false);
    let rates: Vec<String> = (form.sources.iter().zip(&form.periods_ns))
        .map(|(source, &period)| {
            format!(
                "| `{}` | {} | {} |",
                source.name,
                source.unit,
                seconds(period)
            )
        })
        .collect();
    let outputs: Vec<String> = (form.outputs.iter())
        .map(|output| format!("| `{}` | {} |", output.name, output.unit))
        .collect();
    let nodes: Vec<String> = (form.nodes.iter())
        .map(|node| format!("`{}` ({})", node.node, node.kind))
        .collect();
    text.replace("@title@", &form.title)
        .replace("@revision@", &form.revision)
        .replace("@double@", &layout.bytes(8).to_string())
        .replace("@single@", &layout.bytes(4).to_string())
        .replace("@operations@", &super::operations(form).to_string())
        .replace("@inputs@", &rates.join("\n"))
        .replace("@outputs@", &outputs.join("\n"))
        .replace("@nodes@", &nodes.join(", "))
        .replace("@rows@", &rows(form))
}

fn seconds(ns: i64) -> String {
    format!("{} s", ns as f64 / 1e9)
}

/// The rows of the windows, which take most of the room.
fn rows(form: &Form) -> String {
    let slopes = form.nodes.iter().filter(|node| node.kind == "slope");
    let rows = slopes.map(|node| {
        format!(
            "`{}` keeps {} rows of {} channels",
            node.node,
            node.place_of("room"),
            node.place_of("channels")
        )
    });
    let rows: Vec<String> = rows.collect();
    if rows.is_empty() {
        "no windows are kept".to_owned()
    } else {
        rows.join(", ")
    }
}
