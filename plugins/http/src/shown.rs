//! Answers of a service, in words for people.

use std::fmt::Write as _;
use std::path::Path;

use athermal_analysis::figures::{apart, instant};
use athermal_run::live::monitor::feedback;
use athermal_serve::connector::LeftOut;
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
        "{} ticks{} since the start, the last one {} behind; checkpoint after {} of {} ticks, beats, breaks and freezes",
        of["ticks"],
        match of["beats"].as_u64() {
            None | Some(0) => String::new(),
            Some(beats) => format!(" and {beats} beats"),
        },
        seconds(&of["behind_s"]),
        of["last_checkpoint"],
        of["happenings"]
    );
    if of["undecided"] != 0 {
        let _ = writeln!(
            all,
            "{} samples are far ahead, and wait until it is known what time it is",
            of["undecided"]
        );
    }
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
        let left_out = source["left_out"].as_object().into_iter().flatten();
        let left_out = counts(left_out.map(|(why, count)| (why.as_str(), count)));
        let _ = writeln!(
            all,
            "source {}: {}, {} samples, {} wait, {} dropped, {} restarts{left_out}",
            text(&source["source"]),
            match source["connection"].as_str() {
                Some("never") => "never connected",
                other => other.unwrap_or("away"),
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
            "sink {}: {} rows, {} wait, {} in the spool, {} dropped, {} too old, {} superseded, {} failures",
            text(&sink["sink"]),
            sink["put"],
            sink["waiting"],
            sink["spooled"],
            sink["dropped"],
            sink["behind"],
            sink["superseded"],
            sink["failures"]
        );
        if let Some(error) = sink["error"].as_str() {
            let _ = writeln!(all, "  {error}; tried again");
        }
    }
    for channel in of["channels"].as_array().into_iter().flatten() {
        let reasons = LeftOut::ALL.map(LeftOut::name);
        let _ = writeln!(
            all,
            "{}: {} samples of {}, age {}{}",
            text(&channel["channel"]),
            channel["accepted"],
            text(&channel["source"]),
            seconds(&channel["age_s"]),
            counts(reasons.into_iter().map(|why| (why, &channel[why])))
        );
    }
    watched(&of["watched"], &mut all);
    let events = of["events"].as_array().into_iter().flatten();
    for event in events.rev().take(5) {
        let _ = writeln!(all, "lately: {}", text(&event["message"]));
    }
    all
}

/// What was left out, by reason; nothing where nothing was.
fn counts<'a>(all: impl Iterator<Item = (&'a str, &'a Value)>) -> String {
    let some = all.filter(|(_, count)| count.as_u64() > Some(0));
    let some: Vec<_> = some
        .map(|(why, count)| format!("{count} {}", why.replace('_', " ")))
        .collect();
    match some.is_empty() {
        true => String::new(),
        false => format!(", left out {}", some.join(", ")),
    }
}

/// What monitors have found.
fn watched(of: &Value, all: &mut String) {
    for fault in of["faults"].as_array().into_iter().flatten() {
        let what = match fault["value"].as_f64() {
            Some(value) => format!("stuck at {value}"),
            None => "no sample".to_owned(),
        };
        let since = instant(fault["since_s"].as_f64().unwrap_or(f64::NAN));
        let _ = writeln!(all, "{}: {what} since {since}", text(&fault["channel"]));
    }
    for outside in of["outside_fit"].as_array().into_iter().flatten() {
        let keys = ["lowest", "highest", "lowest_in_fit", "highest_in_fit"];
        let values = keys.map(|key| outside[key].as_f64().unwrap_or(f64::NAN));
        let [lowest, highest, lowest_in_fit, highest_in_fit] = apart(values);
        let _ = writeln!(
            all,
            "{}: {} samples far outside of the fit, {lowest} to {highest}; there {lowest_in_fit} to {highest_in_fit}",
            text(&outside["channel"]),
            outside["samples"]
        );
    }
    if let Some(node) = of["no_output"]["first_silent"].as_str() {
        let _ = writeln!(
            all,
            "no output has had a value in {} ticks and beats; the first to lack one is {node}",
            of["no_output"]["ticks"]
        );
    }
    let fed_back = of["feeds_back"].as_array().map_or(&[][..], Vec::as_slice);
    let fed_back: Vec<_> = fed_back.iter().map(text).collect();
    if let Some(words) = feedback::words(&fed_back) {
        let _ = writeln!(all, "{words}");
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
