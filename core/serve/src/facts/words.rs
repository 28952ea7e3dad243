//! Facts in words, where those are made of more than one.

use serde_json::Value;

use crate::connector::LeftOut;
use crate::figures::{apart, instant};

fn number(of: &Value) -> f64 {
    of.as_f64().unwrap_or(f64::NAN)
}

fn size(bytes: f64) -> String {
    match bytes < 1e6 {
        true => format!("{:.0} kB", bytes / 1e3),
        false => format!("{:.1} MB", bytes / 1e6),
    }
}

pub(super) fn ticks(of: &Value) -> Option<String> {
    let beats = match of["beats"].as_u64() {
        None | Some(0) => String::new(),
        Some(beats) => format!(" and {beats} beats"),
    };
    let behind = of["behind_s"].as_f64();
    let behind = behind.map_or_else(|| "none".to_owned(), |of| format!("{of:.1} s"));
    Some(format!(
        "{} ticks{beats} since the start, the last one {behind} behind; checkpoint after {} of {} ticks, beats, breaks and freezes",
        of["ticks"], of["last_checkpoint"], of["happenings"]
    ))
}

pub(super) fn held(of: &Value) -> Option<String> {
    let bytes = size(of["held"]["bytes"].as_f64()?);
    let full = size(of["held"]["bytes_full"].as_f64()?);
    Some(format!(
        "windows hold {bytes}, and {full} once they are full"
    ))
}

pub(super) fn verdict(of: &Value) -> Option<String> {
    let verdict = of["verdict"].as_object()?;
    let over = if verdict["over"] == true {
        "over"
    } else {
        "under way"
    };
    let ratio = verdict["ratio"].as_f64();
    let ratio = ratio.map_or_else(|| "none".to_owned(), |of| of.to_string());
    Some(format!(
        "in the shadow: {over}, error relative to what runs {ratio}"
    ))
}

pub(super) fn given_up(of: &Value) -> Option<String> {
    each(&of["given_up"], |of| {
        format!("given up: {}", of.as_str().unwrap_or_default())
    })
}

pub(super) fn events(of: &Value) -> Option<String> {
    let all = of["events"].as_array()?;
    let last: Vec<_> = all.iter().rev().take(5).cloned().collect();
    each(&last.into(), |of| {
        format!("lately: {}", of["message"].as_str().unwrap_or_default())
    })
}

fn each(all: &Value, words: impl Fn(&Value) -> String) -> Option<String> {
    let all: Vec<_> = all.as_array()?.iter().map(words).collect();
    (!all.is_empty()).then(|| all.join("\n"))
}

pub(super) fn connection(of: &Value) -> Option<String> {
    Some(match of["connection"].as_str() {
        Some("never") => "never connected".to_owned(),
        other => other.unwrap_or("away").to_owned(),
    })
}

pub(super) fn channel_state(of: &Value) -> Option<String> {
    of["state"].as_str().map(str::to_owned)
}

pub(super) fn left_out_at_source(of: &Value) -> Option<String> {
    left_out(&of["left_out"])
}

/// What was left out, by reason; nothing where nothing was.
pub(super) fn left_out(of: &Value) -> Option<String> {
    let all = LeftOut::ALL.map(LeftOut::name).into_iter();
    let some = all.filter(|why| of[*why].as_u64() > Some(0));
    let some: Vec<_> = some
        .map(|why| format!("{} {}", of[why], why.replace('_', " ")))
        .collect();
    (!some.is_empty()).then(|| format!("left out {}", some.join(", ")))
}

pub(super) fn fault(of: &Value) -> Option<String> {
    let what = match of["value"].as_f64() {
        Some(value) => format!("stuck at {value}"),
        None => "no sample".to_owned(),
    };
    let since = instant(number(&of["since_s"]));
    Some(format!("{}: {what} since {since}", of["channel"].as_str()?))
}

pub(super) fn outside_fit(of: &Value) -> Option<String> {
    let keys = ["lowest", "highest", "lowest_in_fit", "highest_in_fit"];
    let [lowest, highest, lowest_in_fit, highest_in_fit] = apart(keys.map(|key| number(&of[key])));
    let (channel, samples) = (of["channel"].as_str()?, &of["samples"]);
    Some(format!(
        "{channel}: {samples} samples far outside of the fit, {lowest} to {highest}; there {lowest_in_fit} to {highest_in_fit}"
    ))
}
