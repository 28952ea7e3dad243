//! `athermal browse mqtt://…`: listens to a broker for a while, and writes the `messages` that a source would take.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::Duration as Wait;

use athermal_command::{Answer, Browsed, Failure, Terminal, print};
use athermal_core::document::placeholders;
use athermal_core::unit::Unit;
use clap::Args;
use serde_json::Value;

use crate::broker::{Broker, Identity, Version, keep_alive};
use crate::client::Settings;
use crate::listen::{Heard, listen};

/// Subscribes to all topics of a broker for a while: what it publishes is written as a source, with the topics, where their values and
/// times stand, and units as far as names say them.
#[derive(Debug, Args)]
pub struct Browse {
    /// Of MQTT: the topics to listen to
    #[arg(long, value_name = "TOPIC", default_value = "#")]
    topic: String,
    /// Of MQTT: a file of certificates that the broker's own is judged by
    #[arg(long, value_name = "FILE")]
    authorities: Option<PathBuf>,
    /// Of MQTT: a file with the certificate by which the broker knows the client
    #[arg(long, value_name = "FILE", requires = "key")]
    certificate: Option<PathBuf>,
    /// Of MQTT: a file with the key of that certificate
    #[arg(long, value_name = "FILE", requires = "certificate")]
    key: Option<PathBuf>,
}

athermal_command::register_scheme!(Browse, "mqtt", "mqtts");

impl athermal_command::Browse for Browse {
    fn run(&self, at: &Browsed, terminal: &Terminal) -> Result<Answer, Failure> {
        let named: Broker = at.address.parse().map_err(Failure::Request)?;
        let mut broker = named.clone();
        broker.authorities.clone_from(&self.authorities);
        let identity = self.certificate.clone().zip(self.key.clone());
        broker.identity = identity.map(|(certificate, key)| Identity { certificate, key });
        let settings = Settings {
            broker,
            version: Version::Five,
            client_id: "athermal-browse".to_owned(),
            login: at.login.clone(),
            keep_alive: Wait::from_secs(keep_alive().secs() as u64),
            receive_maximum: 500,
            keeps_session: false,
            last_will: None,
        };
        let mut topics = BTreeMap::new();
        let mut refused = None;
        let ended = listen(
            settings,
            std::slice::from_ref(&self.topic),
            at.wait(),
            |heard| {
                match heard {
                    Heard::Answer(_, answer) => refused = answer.err(),
                    Heard::Message(message) => {
                        let before = topics.remove(&message.topic);
                        let payload = with_absent(before, message.payload);
                        topics.insert(message.topic, payload);
                    }
                }
                refused.is_some()
            },
        );
        ended.map_err(|why| Failure::Outside(format!("{named}: {why}")))?;
        if let Some(why) = refused {
            return Err(Failure::Outside(format!(
                "{named} refuses `{}`: {why}",
                self.topic
            )));
        }
        if topics.is_empty() {
            terminal.warning(format_args!(
                "nothing came under `{}` in {}: listen for longer, as with `--for 1min`",
                self.topic, at.patience
            ));
            return Ok(Answer::No);
        }
        print!("{}", table(&named, &topics));
        terminal.note(format_args!(
            "{} topics in {}; next: name the channels as your graph does, then `athermal check --live FILE`",
            topics.len(),
            at.patience
        ));
        Ok(Answer::Fine)
    }
}

/// A message, with the values of one before it where its own are absent: not each has all of them.
fn with_absent(before: Option<Vec<u8>>, payload: Vec<u8>) -> Vec<u8> {
    fn fill(value: &mut Value, before: Value) {
        match (value, before) {
            (Value::Object(fields), Value::Object(before)) => {
                for (key, of) in before {
                    fill(fields.entry(key).or_insert(Value::Null), of);
                }
            }
            (value @ Value::Null, before) => *value = before,
            _ => {}
        }
    }
    let read = |of: &[u8]| serde_json::from_slice::<Value>(of).ok();
    let (Some(mut value), Some(before)) = (read(&payload), before.as_deref().and_then(read)) else {
        return payload;
    };
    fill(&mut value, before);
    value.to_string().into_bytes()
}

/// Names of times, and of qualities.
const TIMES: [&str; 9] = [
    "time",
    "timestamp",
    "ts",
    "t",
    "datetime",
    "date",
    "sourcetimestamp",
    "time_ms",
    "time_ns",
];
const QUALITIES: [&str; 3] = ["quality", "status", "q"];
const VALUES: [&str; 4] = ["value", "v", "val", "y"];
const NAMES: [&str; 4] = ["id", "name", "tag", "n"];
/// A number of seconds since 1970 that is a time of our days is no smaller.
const A_TIME: f64 = 1e8;

/// The table of a source.
fn table(broker: &Broker, topics: &BTreeMap<String, Vec<u8>>) -> String {
    let mut text = format!(
        "[sources.line]\ntype = \"mqtt\"\nbroker = {}\nmessages = [\n",
        quoted(&broker.to_string())
    );
    let mut names = BTreeSet::new();
    for (topic, payload) in topics {
        match message(topic, payload, &mut names) {
            Ok(line) => text += &format!("  {line},\n"),
            Err(why) => text += &format!("  # {}: {why}\n", topic.escape_debug()),
        }
    }
    text + "]\n"
}

/// A text as TOML writes it: as JSON does, but for one sign.
fn quoted(text: &str) -> String {
    let json = Value::from(text).to_string();
    json.replace('\u{7f}', "\\u007f")
}

fn message(
    topic: &str,
    payload: &[u8],
    names: &mut BTreeSet<String>,
) -> Result<String, &'static str> {
    if topic.starts_with('$') {
        return Err("of the broker itself");
    }
    if has_braces(topic) {
        return Err(BRACES);
    }
    let text = std::str::from_utf8(payload).map_err(|_| "no text")?;
    let head = format!("{{ topic = {}", quoted(topic));
    let last = topic.rsplit('/').next().unwrap_or(topic);
    if text.trim().parse::<f64>().is_ok_and(f64::is_finite) {
        let channel = channel(last, None, names);
        return Ok(format!("{head}, time = \"arrival\", {channel} }}"));
    }
    let value: Value = serde_json::from_str(text).map_err(|_| "neither a number nor JSON")?;
    match list(&value, &head, names) {
        Some(line) => Ok(line),
        None => object(&value, &head, last, names),
    }
}

/// Why what has braces of its own cannot be named.
const BRACES: &str = "a name in braces would be that of a set";

fn has_braces(text: &str) -> bool {
    placeholders(text).next().is_some()
}

/// An object with values.
fn object(
    value: &Value,
    head: &str,
    last: &str,
    names: &mut BTreeSet<String>,
) -> Result<String, &'static str> {
    let Value::Object(fields) = value else {
        return Err("no object with values");
    };
    if fields.get("alive").is_some_and(Value::is_boolean) {
        return Err("whether a service lives");
    }
    let mut leaves = Vec::new();
    collect(value, "", &mut leaves);
    if leaves.iter().any(|(at, _)| has_braces(at)) {
        return Err(BRACES);
    }
    let (quality, quality_at) = quality_of(&leaves);
    let is_value = |at: &str, value: &Value| {
        let is_state = is(at, &QUALITIES[..2]) || quality_at == Some(at);
        value.is_number() && !is_time(at, value) && !is_state
    };
    let numbers = leaves.iter().filter(|(at, value)| is_value(at, value));
    let middle = format!("{head}{}{quality}", time_of(&leaves));
    match numbers.collect::<Vec<_>>().as_slice() {
        [] => Err("it has no numbers"),
        [(at, _)] if is(at, &VALUES) || fields.len() == 1 => {
            let unit = fields
                .iter()
                .find(|(key, _)| key.eq_ignore_ascii_case("unit"));
            let unit = unit.and_then(|(_, unit)| Unit::in_name(unit.as_str()?));
            let channel = channel(last, unit, names);
            Ok(format!("{middle}, value = {}, {channel} }}", quoted(at)))
        }
        several => {
            let of = several.iter().map(|(at, _)| {
                let last = at.rsplit('/').next().unwrap_or(at);
                entry(at, last, names)
            });
            let of: Vec<_> = of.collect();
            Ok(format!("{middle}, channels = {{ {} }} }}", of.join(", ")))
        }
    }
}

/// A list of objects with a name and a value each.
fn list(value: &Value, head: &str, names: &mut BTreeSet<String>) -> Option<String> {
    let (at, items) = match value {
        Value::Array(items) => (String::new(), items),
        Value::Object(fields) => fields
            .iter()
            .find_map(|(key, of)| Some((format!("/{}", escaped(key)), of.as_array()?)))?,
        _ => return None,
    };
    let first = items.first()?.as_object()?;
    let key = |known: &[&str]| {
        let found = first.keys().find(|key| is(key, known))?;
        Some(format!("/{}", escaped(found)))
    };
    let (name, inner) = (key(&NAMES)?, key(&VALUES)?);
    let mut leaves = Vec::new();
    collect(items.first()?, "", &mut leaves);
    if !leaves.iter().any(|(at, value)| is_time(at, value)) {
        collect(value, "", &mut leaves);
    }
    let (time, (quality, _)) = (time_of(&leaves), quality_of(&leaves));
    let tags: BTreeSet<_> = items
        .iter()
        .filter_map(|of| of.pointer(&name)?.as_str())
        .filter(|tag| !has_braces(tag))
        .collect();
    let entries: Vec<_> = tags
        .into_iter()
        .map(|tag| entry(tag, tag.rsplit(['.', '/']).next().unwrap_or(tag), names))
        .collect();
    let can_be_named = !entries.is_empty() && !has_braces(&at);
    can_be_named.then(|| {
        format!(
            "{head}, each = {}, name = {}, value = {}{time}{quality}, channels = {{ {} }} }}",
            quoted(&at),
            quoted(&name),
            quoted(&inner),
            entries.join(", ")
        )
    })
}

/// A key as it stands in a JSON pointer.
fn escaped(key: &str) -> String {
    key.replace('~', "~0").replace('/', "~1")
}

/// The values of an object with their pointers.
fn collect<'a>(value: &'a Value, at: &str, into: &mut Vec<(String, &'a Value)>) {
    match value {
        Value::Object(fields) => {
            for (key, of) in fields {
                collect(of, &format!("{at}/{}", escaped(key)), into);
            }
        }
        Value::Array(_) => {}
        leaf => into.push((at.to_owned(), leaf)),
    }
}

fn is(at: &str, known: &[&str]) -> bool {
    let last = at.rsplit('/').next().unwrap_or(at).to_lowercase();
    known.contains(&last.as_str())
}

/// Whether a value is a time by its name and by what it is: `T` is a temperature more often.
fn is_time(at: &str, value: &Value) -> bool {
    let is_one = match value {
        Value::Number(number) => number.as_f64().is_some_and(|of| of >= A_TIME),
        Value::String(text) => text.parse::<jiff::Timestamp>().is_ok(),
        _ => false,
    };
    is_one && is(at, &TIMES)
}

/// The time among values, with the unit that its size says; that of the arrival where there is none.
fn time_of(leaves: &[(String, &Value)]) -> String {
    let Some((at, value)) = leaves.iter().find(|(at, value)| is_time(at, value)) else {
        return ", time = \"arrival\"".to_owned();
    };
    let unit = value.as_f64().map(|value| match value {
        ..1e11 => "s",
        ..1e14 => "ms",
        ..1e17 => "us",
        _ => "ns",
    });
    let unit = unit.map_or(String::new(), |unit| format!(", unit = \"{unit}\""));
    format!(", time = {{ at = {}{unit} }}", quoted(at))
}

/// What says that a value is good, where it stands, if it does say so: of a message that is not good nothing can be learned.
fn quality_of<'a>(leaves: &'a [(String, &Value)]) -> (String, Option<&'a str>) {
    let is_good = |of: &Value| match of {
        // OPC DA has 192, OPC UA 0.
        Value::Number(number) => matches!(number.as_u64(), Some(0 | 192)),
        Value::String(text) => ["good", "ok"]
            .iter()
            .any(|of| text.eq_ignore_ascii_case(of)),
        _ => false,
    };
    let found = leaves
        .iter()
        .find(|(at, value)| is(at, &QUALITIES) && is_good(value));
    let Some((at, value)) = found else {
        return (String::new(), None);
    };
    let good = match value {
        Value::String(text) => quoted(text),
        other => other.to_string(),
    };
    let text = format!(", quality = {{ at = {}, good = [{good}] }}", quoted(at));
    (text, Some(at))
}

/// A channel, and its unit where that is known, or its name says so.
fn channel(last: &str, unit: Option<Unit>, names: &mut BTreeSet<String>) -> String {
    let unit = unit.or_else(|| unit_in(last));
    let shown = unit.as_ref().map_or(String::new(), |unit| {
        format!(", unit = {}", quoted(unit.text()))
    });
    format!(
        "channel = {}{shown}",
        quoted(&name_of(last, unit.as_ref(), names))
    )
}

fn entry(key: &str, last: &str, names: &mut BTreeSet<String>) -> String {
    let unit = unit_in(last);
    let name = quoted(&name_of(last, unit.as_ref(), names));
    match unit {
        Some(unit) => format!(
            "{} = {{ channel = {name}, unit = {} }}",
            quoted(key),
            quoted(unit.text())
        ),
        None => format!("{} = {name}", quoted(key)),
    }
}

/// The unit that the last word of a name is.
fn unit_in(name: &str) -> Option<Unit> {
    let words: Vec<_> = name
        .split(['_', ' ', '[', ']', '(', ')'])
        .filter(|of| !of.is_empty())
        .collect();
    let last = words.last().filter(|_| words.len() > 1)?;
    Unit::in_name(last)
}

/// The name of a channel: what it measures, if its unit says so, and what it is called.
fn name_of(last: &str, unit: Option<&Unit>, names: &mut BTreeSet<String>) -> String {
    let measures =
        |of: &str| unit.is_some_and(|unit| Unit::parse(of).is_ok_and(|of| unit.measures_same(&of)));
    let signal = if measures("Cel") {
        "temperature"
    } else if measures("nm") {
        "position"
    } else {
        "value"
    };
    let kept = last.chars().map(|of| {
        if of.is_ascii_alphanumeric() || of == '_' {
            of
        } else {
            '_'
        }
    });
    let mut name: String = kept.collect();
    if let Some((before, _)) = name
        .rsplit_once('_')
        .filter(|_| unit.is_some() && unit_in(last).is_some())
    {
        name = before.to_owned();
    }
    if name.is_empty() {
        name = "channel".to_owned();
    }
    // What has the form of a channel is one.
    let is_word =
        |of: &str| !of.is_empty() && of.chars().all(|of| of.is_ascii_alphanumeric() || of == '_');
    let own = last
        .split_once('.')
        .filter(|(signal, name)| is_word(signal) && is_word(name));
    let (signal, name) = own.map_or((signal, name), |(signal, name)| (signal, name.to_owned()));
    let mut full = format!("{signal}.{name}");
    let mut number = 2;
    while !names.insert(full.clone()) {
        full = format!("{signal}.{name}{number}");
        number += 1;
    }
    full
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(topics: &[(&str, &str)]) -> Vec<String> {
        let topics = topics
            .iter()
            .map(|(topic, payload)| ((*topic).to_owned(), payload.as_bytes().to_vec()))
            .collect();
        let text = table(&"mqtt://plant".parse().unwrap(), &topics);
        text.lines()
            .skip(4)
            .map(|line| line.trim().to_owned())
            .collect()
    }

    #[test]
    fn what_a_message_says_decides_where_its_values_stand() {
        let lines = written(&[
            ("a/plate_degC", "21.5"),
            (
                "b/room",
                r#"{"timestamp": 1764279677123, "value": 21.5, "unit": "degC", "q": 192}"#,
            ),
            (
                "c/all",
                r#"{"time": "2025-11-27T21:41:17Z", "T": {"x_degC": 1, "y_degC": 2}, "Z_nm": 3}"#,
            ),
            (
                "d/kepware",
                r#"{"values": [{"id": "Ch1.Room", "v": 1, "t": 1764279677123, "q": 192}]}"#,
            ),
            ("e/text", "on"),
        ]);
        assert_eq!(
            lines,
            [
                r#"{ topic = "a/plate_degC", time = "arrival", channel = "temperature.plate", unit = "Cel" },"#,
                r#"{ topic = "b/room", time = { at = "/timestamp", unit = "ms" }, quality = { at = "/q", good = [192] }, value = "/value", channel = "temperature.room", unit = "Cel" },"#,
                r#"{ topic = "c/all", time = { at = "/time" }, channels = { "/T/x_degC" = { channel = "temperature.x", unit = "Cel" }, "/T/y_degC" = { channel = "temperature.y", unit = "Cel" }, "/Z_nm" = { channel = "position.Z", unit = "nm" } } },"#,
                r#"{ topic = "d/kepware", each = "/values", name = "/id", value = "/v", time = { at = "/t", unit = "ms" }, quality = { at = "/q", good = [192] }, channels = { "Ch1.Room" = "value.Room" } },"#,
                "# e/text: neither a number nor JSON",
                "]",
            ]
        );
    }

    #[test]
    fn two_topics_of_one_name_have_two_channels() {
        let lines = written(&[("a/T", "1"), ("b/T", "2")]);
        assert!(
            lines[0].contains("\"value.T\"") && lines[1].contains("\"value.T2\""),
            "{lines:?}"
        );
    }

    #[test]
    fn a_value_that_is_absent_at_times_is_found() {
        let payload = |text: &str| text.as_bytes().to_vec();
        let before = with_absent(None, payload(r#"{"v": {"a": 1.5, "b": 2.5}}"#));
        let filled = with_absent(Some(before), payload(r#"{"v": {"a": null, "b": 3.5}}"#));
        let value: Value = serde_json::from_slice(&filled).unwrap();
        assert_eq!(value, serde_json::json!({ "v": { "a": 1.5, "b": 3.5 } }));
        assert_eq!(with_absent(Some(filled), payload("on")), payload("on"));
    }

    #[test]
    fn a_temperature_is_no_time_and_a_heat_flow_no_quality() {
        let lines = written(&[
            ("a", r#"{"T": 21.5, "q": 3.5, "ts": 1764279677}"#),
            ("b", r#"{"value": 21.5, "status": "failed"}"#),
        ]);
        let expected = r#"{ topic = "a", time = { at = "/ts", unit = "s" }, channels = { "/T" = "value.T", "/q" = "value.q" } },"#;
        assert_eq!(lines[0], expected);
        let expected =
            r#"{ topic = "b", time = "arrival", value = "/value", channel = "value.b" },"#;
        assert_eq!(lines[1], expected);
    }

    #[derive(serde::Deserialize)]
    struct Line {
        messages: Vec<athermal_messages::message::Messages>,
    }

    proptest::proptest! {
        #[test]
        fn whatever_is_published_what_is_written_is_a_source_without_mistakes(
            topic in "[^+#\\x00]{1,8}",
            key in "\\PC{0,6}|[a-z/~{}\\x7f\"\\\\]{0,6}",
            unit in "[a-zA-Z\\x7f]{0,4}",
            number in -1e3..1e13_f64,
        ) {
            let list = serde_json::json!({ key.as_str(): [{ "id": key, "v": number, "t": 1_764_279_677 }] });
            let object = serde_json::json!({ key.as_str(): number, "unit": unit, "a/b": { "~": 1 } });
            for payload in [list, object, number.into()] {
                let topics = BTreeMap::from([(topic.clone(), payload.to_string().into_bytes())]);
                let text = table(&"mqtt://plant".parse().unwrap(), &topics);
                let table: toml::Table = text.parse().unwrap_or_else(|of| panic!("{of}: {text}"));
                let line: Line = table["sources"]["line"].clone().try_into().unwrap_or_else(|of| panic!("{of}: {text}"));
                for of in line.messages {
                    proptest::prop_assert_eq!(of.mistakes(None), Vec::new());
                    proptest::prop_assert_eq!(&of.topic, &topic);
                }
            }
        }
    }
}
