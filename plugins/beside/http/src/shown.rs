//! Answers of a service, in words for people.

use std::fmt::Write as _;
use std::path::Path;

use athermal_core::engine::NodeCarry;
use serde::Deserialize as _;
use serde_json::Value;

fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Null => "none".to_owned(),
        other => other.to_string(),
    }
}

/// A tick or an event of a stream, on a line.
pub fn item(event: &str, data: &Value) -> String {
    match event {
        "tick" => {
            let mut line = text(&data["time_s"]);
            for part in ["outputs", "channels"] {
                for (name, value) in data[part].as_object().into_iter().flatten() {
                    let _ = write!(
                        line,
                        "  {name}={}",
                        if value.is_null() {
                            "-".to_owned()
                        } else {
                            value.to_string()
                        }
                    );
                }
            }
            line
        }
        "dropped" => format!("# {} were left out: this reader is slow", data["items"]),
        _ => format!("# {}", text(&data["message"])),
    }
}

/// What becomes of the nodes of a staged graph.
pub fn staged(path: &Path, of: &Value) -> String {
    let nodes = Vec::<NodeCarry>::deserialize(&of["nodes"]).unwrap_or_default();
    let mut all = NodeCarry::graph_words(path, &text(&of["revision"]), &nodes);
    for silent in of["silent"].as_array().into_iter().flatten() {
        let (silent, past_s) = (text(silent), of["past_s"].as_f64().unwrap_or(f64::NAN));
        let _ = write!(all, "\n  {silent} had no value over the past {past_s:.1} s");
    }
    all
}
