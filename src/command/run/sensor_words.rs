//! The words of sensors that fail and are in order again.

use athermal::run::live::monitor::{SensorChange, SensorFault};
use serde_json::json;

use crate::command::faults::{self, Purpose, of_standstill};
use crate::command::model::few;
use crate::message::Message;
use crate::terminal::Terminal;
use athermal_analysis::figures::{count, exact, instant, time};

/// Reports what happened to sensors at a row. For people, those that fail or come back together stand in one sentence, as when a
/// logger is unplugged.
pub fn changes(terminal: &Terminal, changes: &[SensorChange], at_s: f64) {
    let (mut silent, mut back) = (Vec::new(), Vec::new());
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
                let facts = faults::facts(name, change.of_truth, &stuck);
                terminal.warning(Message::new("stuck", facts, words));
            }
            (SensorFault::Stuck(stuck), true) => {
                let after = time(at_s - stuck.from_s);
                let words = format!("{name} changes again, after {after}");
                terminal.note(message(
                    "changes_again",
                    change,
                    (stuck.from_s, at_s),
                    words,
                ));
            }
        }
    }
    // Programs take one message for each.
    let at_once = if terminal.events { 1 } else { usize::MAX };
    for silent in silent.chunks(at_once) {
        let (names, since_s) = together(silent);
        let (has, the_sensor, it) = match silent.len() {
            1 => ("has", "the sensor", "it"),
            _ => ("have", "the sensors", "them"),
        };
        let words = format!(
            "{names} {has} no sample since {}: did {the_sensor} fail? What needs {it} predicts nothing",
            instant(since_s)
        );
        terminal.warning(message("silent", silent[0].0, (since_s, at_s), words));
    }
    for back in back.chunks(at_once) {
        let (names, since_s) = together(back);
        let has = if back.len() == 1 { "has" } else { "have" };
        let after = time(at_s - since_s);
        let words = format!("{names} {has} samples again, after {after}");
        let name = "has_samples_again";
        terminal.note(message(name, back[0].0, (since_s, at_s), words));
    }
}

/// What happened to a sensor, from when to when.
fn message(
    name: &'static str,
    of: &SensorChange,
    (from_s, to_s): (f64, f64),
    words: String,
) -> Message {
    let times = json!({ "from_s": from_s, "to_s": to_s });
    Message::new(name, faults::facts(&of.channel, of.of_truth, &times), words)
}

/// The names of sensors, and since when the first of them has failed.
fn together(all: &[(&SensorChange, f64)]) -> (String, f64) {
    let names: Vec<String> = all.iter().map(|(of, _)| of.channel.clone()).collect();
    let since_s = all.iter().map(|(_, from_s)| *from_s);
    (few(&names), since_s.fold(f64::INFINITY, f64::min))
}
