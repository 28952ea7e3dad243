//! What monitors of a graph at work find, in words: `run` and `serve` say the same.

use athermal_core::events;
use serde::Serialize;
use serde_json::{Value, json};

use super::{Finding, NoOutput, SensorChange, SensorFault};
use crate::diagnostic::listed;
use crate::engine::SampleRange;
use crate::event::EventKind;
use crate::figures::{apart, count, counted, exact, instant, time as length};
use crate::message::Message;

/// What a recording is read for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Models learn from it.
    Fit,
    /// Models are set against it.
    Scores,
    /// Models predict from it.
    Run,
}

/// A fault of a channel, as JSON.
#[must_use]
pub fn facts(channel: &str, of_truth: bool, fault: &impl Serialize) -> Value {
    let mut facts = json!({ "channel": channel, "of_truth": of_truth });
    if let (Value::Object(all), Value::Object(found)) = (&mut facts, json!(fault)) {
        all.extend(found);
    }
    facts
}

/// What is declared of what monitors find.
pub const KINDS: &[EventKind] = events!(kinds {
    /// A sample is infinite or outside of the `range` of its signal, the first in an hour.
    "rejected_samples", fault, { channel: String, time: String, value: f64 };
    /// A sample lies farther outside of those of the fit than these are apart, the first in an hour.
    "outside_fit", fault, { channel: String, time: String, value: f64, lowest_in_fit: f64, highest_in_fit: f64 };
    /// A sensor gives one value for much longer than ever else.
    "stuck", fault, { channel: String, of_truth: bool, from_s: f64, to_s: f64, value: f64, samples: u64 };
    /// A sensor that was stuck changes again.
    "changes_again", note, { channel: String, of_truth: bool, from_s: f64, to_s: f64 };
    /// A sensor gives nothing for ten minutes while ticks come.
    "silent", fault, { channel: String, of_truth: bool, from_s: f64, to_s: f64 };
    /// A sensor that was silent has samples again.
    "has_samples_again", note, { channel: String, of_truth: bool, from_s: f64, to_s: f64 };
    /// No output has had a value for an hour beyond the warm-up of the graph, or up to the end.
    "no_output", fault, { ticks: u64, first_silent: String };
});
/// The event for samples that do not count.
pub const REJECTED: &str = "rejected_samples";
/// The event for samples outside of those of the fit.
pub const OUTSIDE_FIT: &str = "outside_fit";
/// So many widths beyond, another unit is more likely than another day.
const ANOTHER_UNIT: f64 = 10.0;

/// What was found at a row, and whether it is a fault. `time` is the instant of the row in words, `at_s` in s. For people, sensors that
/// fail or come back `together` stand in one sentence, as when a logger is unplugged.
#[must_use]
pub fn messages(
    finding: &Finding,
    (time, at_s): (&str, f64),
    together: bool,
) -> Vec<(bool, Message)> {
    let found = match finding {
        Finding::Rejected {
            channel,
            range,
            value,
        } => {
            let words = format!(
                "{channel} at {time}: {}, taken as missing; others like it are counted",
                why_rejected(*value, *range)
            );
            let facts = json!({ "channel": channel, "time": time, "value": value });
            Message::new(REJECTED, facts, words)
        }
        Finding::OutsideFit { usual, value } => {
            let [found, lowest, highest] = apart([*value, usual.lowest, usual.highest]);
            let words = format!(
                "{} at {time}: {found}, and was between {lowest} and {highest} in the data of the fit: {}",
                usual.channel,
                doubt(usual, *value, *value).unwrap_or_default()
            );
            let facts = json!({
                "channel": usual.channel,
                "time": time,
                "value": value,
                "lowest_in_fit": usual.lowest,
                "highest_in_fit": usual.highest,
            });
            Message::new(OUTSIDE_FIT, facts, words)
        }
        Finding::Sensors(changes) => return of_sensors(changes, at_s, together),
        Finding::NoOutput(of) => no_output(of),
    };
    vec![(true, found)]
}

/// What is wrong with a sample.
fn why_rejected(value: f64, (lowest, highest): (f64, f64)) -> String {
    if value.is_infinite() {
        "an infinite sample".to_owned()
    } else if value < lowest {
        let [value, lowest] = apart([value, lowest]);
        format!("{value} is below the lowest of its range, {lowest}")
    } else {
        let [value, highest] = apart([value, highest]);
        format!("{value} is above the highest of its range, {highest}")
    }
}

/// That so many samples of a channel did not count.
#[must_use]
pub fn rejected(channel: &str, samples: u64, rows: u64) -> Message {
    let counted = counted(samples, "sample");
    let words = match samples {
        most if 2 * most > rows && most > 1 => format!(
            "{channel}: {}{counted} are infinite or out of range, taken as missing; is its unit that of the log?",
            if most == rows { "all " } else { "" }
        ),
        1 => format!("{channel}: {counted} is infinite or out of range, taken as missing"),
        _ => format!("{channel}: {counted} are infinite or out of range, taken as missing"),
    };
    let facts = json!({ "channel": channel, "samples": samples });
    Message::new(REJECTED, facts, words)
}

/// What to think of samples that lie far outside of those of a fit; none where they do not.
#[must_use]
pub fn doubt(usual: &SampleRange, lowest: f64, highest: f64) -> Option<&'static str> {
    if usual.exceeded_by(lowest, highest) > ANOTHER_UNIT {
        Some("is it in the unit of the fit? The fit learned nothing of values so far outside")
    } else {
        let far = usual.is_far_from(lowest, highest);
        far.then_some("the fit learned nothing of values so far outside")
    }
}

/// That nothing came out, with the first node that gives nothing.
#[must_use]
pub fn no_output(of: &NoOutput) -> Message {
    let pace = match of.apart_s > 0.0 {
        true => format!(", which are {} apart", length(of.apart_s)),
        false => String::new(),
    };
    let words = format!(
        "no output has a value in any of {}{pace}; the first to lack one is {}",
        counted(of.rows, "row"),
        of.first_silent
    );
    let facts = json!({ "ticks": of.rows, "first_silent": of.first_silent });
    Message::new("no_output", facts, words)
}

/// What to think of a standstill.
#[must_use]
pub fn of_standstill(of_truth: bool, purpose: Purpose) -> &'static str {
    match (of_truth, purpose) {
        (true, Purpose::Fit) => {
            "is its measurement stuck? That is learned as no drift: leave these rows out"
        }
        (true, Purpose::Scores) => "is its measurement stuck? That counts as no drift",
        (true, Purpose::Run) => "is its measurement stuck? That is taken for no drift",
        (false, Purpose::Fit) => {
            "is the sensor stuck? That is learned too: leave these rows out, or have a `health` node take them out"
        }
        (false, Purpose::Scores | Purpose::Run) => {
            "is the sensor stuck? Predictions from that mean little; a `health` node takes such samples out"
        }
    }
}

/// What happened to sensors at a row.
fn of_sensors(changes: &[SensorChange], at_s: f64, together: bool) -> Vec<(bool, Message)> {
    let (mut all, mut silent, mut back) = (Vec::new(), Vec::new(), Vec::new());
    for change in changes {
        let name = &change.channel;
        match (change.fault, change.is_over) {
            (SensorFault::Silent { from_s }, false) => silent.push((change, from_s)),
            (SensorFault::Silent { from_s }, true) => back.push((change, from_s)),
            (SensorFault::Stuck(stuck), false) => {
                let words = format!(
                    "{name} is {} in all of its last {} samples, since {}: {}",
                    exact(stuck.value),
                    count(stuck.samples),
                    instant(stuck.from_s),
                    of_standstill(change.of_truth, Purpose::Run)
                );
                let facts = facts(name, change.of_truth, &stuck);
                all.push((true, Message::new(change.fault.kind(), facts, words)));
            }
            (SensorFault::Stuck(stuck), true) => {
                let words = format!(
                    "{name} changes again, after {}",
                    length(at_s - stuck.from_s)
                );
                let of = message("changes_again", change, (stuck.from_s, at_s), words);
                all.push((false, of));
            }
        }
    }
    // Programs take one message for each.
    let at_once = if together { usize::MAX } else { 1 };
    for silent in silent.chunks(at_once) {
        let (names, since_s) = named(silent);
        let (has, the_sensor, it) = match silent.len() {
            1 => ("has", "the sensor", "it"),
            _ => ("have", "the sensors", "them"),
        };
        let words = format!(
            "{names} {has} no sample since {}: did {the_sensor} fail? What needs {it} predicts nothing",
            instant(since_s)
        );
        let kind = silent[0].0.fault.kind();
        all.push((true, message(kind, silent[0].0, (since_s, at_s), words)));
    }
    for back in back.chunks(at_once) {
        let (names, since_s) = named(back);
        let has = if back.len() == 1 { "has" } else { "have" };
        let words = format!(
            "{names} {has} samples again, after {}",
            length(at_s - since_s)
        );
        let of = message("has_samples_again", back[0].0, (since_s, at_s), words);
        all.push((false, of));
    }
    all
}

/// What happened to a sensor, from when to when.
fn message(
    name: &'static str,
    of: &SensorChange,
    (from_s, to_s): (f64, f64),
    words: String,
) -> Message {
    let times: Value = json!({ "from_s": from_s, "to_s": to_s });
    Message::new(name, facts(&of.channel, of.of_truth, &times), words)
}

/// The names of sensors, and since when the first of them has failed.
fn named(all: &[(&SensorChange, f64)]) -> (String, f64) {
    let names: Vec<String> = all.iter().map(|(of, _)| of.channel.clone()).collect();
    let since_s = all.iter().map(|(_, from_s)| *from_s);
    (listed(&names, 6), since_s.fold(f64::INFINITY, f64::min))
}
