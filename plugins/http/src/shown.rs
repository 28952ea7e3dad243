//! Answers of a service, in words for people.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::Value;

fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Null => "none".to_owned(),
        other => other.to_string(),
    }
}

fn seconds(value: &Value) -> String {
    value
        .as_f64()
        .map_or_else(|| "none".to_owned(), |of| format!("{of:.1} s"))
}

fn size(bytes: f64) -> String {
    match bytes < 1e6 {
        true => format!("{:.0} kB", bytes / 1e3),
        false => format!("{:.1} MB", bytes / 1e6),
    }
}

/// How a service is.
pub fn status(of: &Value) -> String {
    let mut all = format!(
        "{}: {}, up {}, revision {}\n",
        text(&of["name"]),
        text(&of["state"]),
        seconds(&of["uptime_s"]),
        text(&of["revision"])
    );
    let _ = writeln!(
        all,
        "{} ticks since the start, the last one {} behind; checkpoint after {} of {}",
        of["ticks"],
        seconds(&of["behind_s"]),
        of["last_checkpoint"],
        of["happenings"]
    );
    let held = [&of["held"]["bytes"], &of["held"]["bytes_full"]].map(Value::as_f64);
    if let [Some(bytes), Some(full)] = held {
        let (bytes, full) = (size(bytes), size(full));
        let _ = writeln!(all, "windows hold {bytes}, and {full} once they are full");
    }
    if of["frozen"] == true {
        all += "learning is frozen\n";
    }
    if let Some(revision) = of["staged"]["revision"].as_str() {
        let _ = writeln!(all, "staged: {revision}");
    }
    if of["verdict"].is_object() {
        let _ = writeln!(
            all,
            "in the shadow: {}, error relative to what runs {}",
            if of["verdict"]["over"] == true {
                "over"
            } else {
                "under way"
            },
            text(&of["verdict"]["ratio"])
        );
    }
    if let Some(revision) = of["previous"].as_str() {
        let _ = writeln!(all, "can be taken back to {revision}");
    }
    let journal = &of["journal"];
    if journal["is_degraded"] == true {
        let _ = writeln!(
            all,
            "the journal cannot be written: {}",
            text(&journal["error"])
        );
    }
    if journal["lost"] != 0 {
        let _ = writeln!(
            all,
            "{} records were never written to the journal",
            journal["lost"]
        );
    }
    for panic in of["given_up"].as_array().into_iter().flatten() {
        let _ = writeln!(all, "given up: {}", text(panic));
    }
    for source in of["sources"].as_array().into_iter().flatten() {
        let _ = writeln!(
            all,
            "source {}: {}, {} samples, {} wait, {} dropped, {} restarts",
            text(&source["source"]),
            match source["connected"] == true {
                true => "connected",
                false => "away",
            },
            source["given"],
            source["waiting"],
            source["dropped"],
            source["restarts"]
        );
        if source["thinned"] != 0 {
            let _ = writeln!(all, "  thinned, from {}", source["thinned"]);
        }
    }
    for sink in of["sinks"].as_array().into_iter().flatten() {
        let _ = writeln!(
            all,
            "sink {}: {} rows, {} wait, {} dropped, {} too old, {} failures",
            text(&sink["sink"]),
            sink["put"],
            sink["waiting"],
            sink["dropped"],
            sink["behind"],
            sink["failures"]
        );
        if let Some(error) = sink["error"].as_str() {
            let _ = writeln!(all, "  {error}; tried again");
        }
    }
    for channel in of["channels"].as_array().into_iter().flatten() {
        let left_out = ["late", "repeated", "future", "clock"];
        let left_out = left_out.iter().filter(|why| channel[**why] != 0);
        let left_out: Vec<_> = left_out
            .map(|why| format!("{} {why}", channel[*why]))
            .collect();
        let _ = write!(
            all,
            "{}: {} samples, age {}",
            text(&channel["channel"]),
            channel["accepted"],
            seconds(&channel["age_s"])
        );
        match left_out.is_empty() {
            true => all += "\n",
            false => _ = writeln!(all, ", left out {}", left_out.join(", ")),
        }
    }
    let events = of["events"].as_array().into_iter().flatten();
    for event in events.rev().take(5) {
        let _ = writeln!(all, "lately: {}", text(&event["message"]));
    }
    all
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
    let nodes = of["nodes"].as_array().map_or(&[][..], Vec::as_slice);
    let mut all = format!(
        "{} (revision {}): {} of {} nodes go on as they were",
        path.display(),
        text(&of["revision"]),
        of["carried"],
        nodes.len()
    );
    for node in nodes {
        let Some(reason) = reason(node) else { continue };
        let _ = write!(all, "\n  {}: {reason}", text(&node["node"]));
    }
    for silent in of["silent"].as_array().into_iter().flatten() {
        let _ = write!(
            all,
            "\n  {} had no value over the past {}",
            text(silent),
            seconds(&of["past_s"])
        );
    }
    all
}

/// The outcome of a node that does not go on as it was, with its reason.
fn reason(node: &Value) -> Option<String> {
    let reason = node["reason"].as_str()?;
    let outcome = match node["carry"].as_str()? {
        "adopted" => "goes on from the old state",
        "warmed" => "warmed by the past",
        "cold" => "cold",
        other => other,
    };
    Some(format!("{outcome}, {reason}"))
}
