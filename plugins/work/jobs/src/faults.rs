//! Warnings about faulty sensors.

pub use athermal_analysis::diagnosis::watch::{ChannelFaults, ChannelWatch, FaultWatch, Purpose};

use athermal_analysis::diagnosis::leap::Leaps;
use athermal_core::watch::Watch;
use athermal_run::live::monitor::silence::Silence;
use serde_json::Value;

use athermal_analysis::figures::{apart, count, counted, exact, instant};
use athermal_core::message::Message;
use athermal_run::live::monitor::words::of_standstill;

/// Warns of them.
pub fn warn(host: &dyn Watch, all: &[ChannelFaults]) {
    for message in messages(all) {
        host.warning(message);
    }
}

/// The warnings, one for each fault.
pub fn messages(all: &[ChannelFaults]) -> Vec<Message> {
    let mut messages = Vec::new();
    for faulty in all {
        let channel = &faulty.channel;
        let mut add = |name, facts: Value, words| messages.push(Message::new(name, facts, words));
        if let Some(leaps) = &faulty.leaps {
            let (at, then) = (instant(leaps.first.at_s), of_leaps(faulty, leaps));
            let words = format!("{channel} {leaps}, at {at}: {then}");
            add("leaps", faulty.facts(leaps), words);
        }
        if let Some(stuck) = &faulty.stuck {
            let words = format!(
                "{channel} is {} in {} samples one after the other, from {} to {}: {}",
                exact(stuck.value),
                count(stuck.samples),
                instant(stuck.from_s),
                instant(stuck.to_s),
                of_standstill(faulty.of_truth, faulty.purpose)
            );
            add("stuck", faulty.facts(stuck), words);
        }
        if let Some(silent) = &faulty.silent {
            let words = format!("{channel} has no sample in {}", of_silence(faulty, silent));
            add("silent", faulty.facts(silent), words);
        }
    }
    messages
}

fn of_silence(faulty: &ChannelFaults, silent: &Silence) -> String {
    let never = silent.rows == silent.of_rows;
    let rows = if never {
        format!("any of {}", counted(silent.rows, "row"))
    } else {
        format!(
            "{} of {} rows, from {} to {}",
            count(silent.rows),
            count(silent.of_rows),
            instant(silent.from_s),
            instant(silent.to_s)
        )
    };
    let asked = match (faulty.of_truth, never) {
        (true, _) => "is it not measured any more?",
        (false, true) => "is the sensor connected, and its column the right one?",
        (false, false) => "did the sensor fail?",
    };
    let then = match (faulty.of_truth, faulty.purpose) {
        (true, Purpose::Fit) => "Nothing is learned of it there",
        (true, Purpose::Scores) => {
            "Nothing is scored there, and what goes by it or by errors has none"
        }
        (true, Purpose::Run) => "What goes by it or by errors has none there",
        (false, Purpose::Fit) => "What needs it learns nothing there",
        (false, Purpose::Scores | Purpose::Run) => "What needs it predicts nothing there",
    };
    format!("{rows}: {asked} {then}")
}

fn of_leaps(faulty: &ChannelFaults, leaps: &Leaps) -> String {
    if faulty.of_truth {
        let then = match faulty.purpose {
            Purpose::Fit => {
                "That is no drift: truths whose window holds it are left out. Begin another file there and give all of them with \
                 `--segments`, so that windows begin afresh"
            }
            Purpose::Scores => {
                "That is no drift: truths whose window holds it are not scored. Begin another file there and give all of them with \
                 `--segments`, so that windows begin afresh"
            }
            Purpose::Run => "That is no drift: nothing was learned of truths whose window holds it",
        };
        return format!("was it moved, or zeroed anew? {then}");
    }
    let then = match faulty.purpose {
        Purpose::Fit => "That is learned too",
        Purpose::Scores | Purpose::Run => "Predictions from that mean nothing",
    };
    let (low, high) = leaps.usual;
    let [_, _, lowest, highest] = apart([leaps.first.from, leaps.first.to, low, high]);
    let usual = low..=high;
    if usual.contains(&leaps.first.from) && usual.contains(&leaps.first.to) {
        return format!(
            "did the sensor fail? {then}: no `range` takes out such samples alone, so leave these rows out"
        );
    }
    format!(
        "did the sensor fail? {then}: leave such samples out by a `range` in [signals.{}]; nine in ten are between {lowest} and {highest}",
        faulty.channel.split('.').next().unwrap_or_default()
    )
}
