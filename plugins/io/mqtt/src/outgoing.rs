//! Outputs as messages: what is published under which topic.

use athermal_serve::connector::{OutRow, WiredOutput};
use serde_json::{Map, Value, json};

use crate::session::shown;

/// A message on its way to a broker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Outgoing {
    /// Its topic.
    pub topic: String,
    /// What it says.
    pub payload: Vec<u8>,
    /// Whether it is the last of its tick.
    pub ends_row: bool,
}

/// How outputs become messages.
#[derive(Debug)]
pub struct Form {
    /// The topic of all outputs.
    whole: Option<String>,
    /// A topic for each output; none where they have one for all.
    topics: Vec<String>,
    outputs: Vec<WiredOutput>,
}

impl Form {
    /// With `{output}` in the topic there is one for each output; otherwise a tick is one message.
    pub fn new(topic: &str, outputs: Vec<WiredOutput>) -> Self {
        let (whole, topics) = match topic.contains("{output}") {
            true => {
                let topics = outputs.iter().map(|of| topic_of(topic, &of.name));
                (None, topics.collect())
            }
            false => (Some(topic.to_owned()), Vec::new()),
        };
        Self {
            whole,
            topics,
            outputs,
        }
    }

    /// The messages of a tick. An output that is absent is in none: a message that has nothing else is left out.
    pub fn messages(&self, row: &OutRow<'_>, into: &mut Vec<Outgoing>) {
        self.add_messages(row, into);
        if let Some(last) = into.last_mut() {
            last.ends_row = true;
        }
    }

    fn add_messages(&self, row: &OutRow<'_>, into: &mut Vec<Outgoing>) {
        let facts = json!({
            "time": shown(row.at),
            "time_ns": row.at.as_ns(),
            "behind_s": row.behind.secs(),
            "revision": format!("{:016x}", row.revision),
        });
        let Value::Object(facts) = facts else { return };
        let outputs = self.outputs.iter().zip(row.outputs).enumerate();
        // What no JSON can say is not there either.
        let outputs = outputs.filter(|(_, (_, value))| value.is_finite());
        if let Some(topic) = &self.whole {
            let (mut values, mut units) = (Map::new(), Map::new());
            for (_, (of, value)) in outputs {
                values.insert(of.name.clone(), json!(value));
                units.insert(of.name.clone(), json!(of.unit));
            }
            if values.is_empty() {
                return;
            }
            let mut message = facts;
            message.insert("values".to_owned(), values.into());
            message.insert("units".to_owned(), units.into());
            into.push(outgoing(topic, message));
            return;
        }
        for (nth, (of, value)) in outputs {
            let mut message = Map::from_iter([
                ("output".to_owned(), json!(of.name)),
                ("value".to_owned(), json!(value)),
                ("unit".to_owned(), json!(of.unit)),
            ]);
            message.extend(facts.clone());
            into.push(outgoing(&self.topics[nth], message));
        }
    }
}

fn outgoing(topic: &str, message: Map<String, Value>) -> Outgoing {
    Outgoing {
        topic: topic.to_owned(),
        payload: Value::Object(message).to_string().into_bytes(),
        ends_row: false,
    }
}

/// The topic of an output. A name that would be several levels, or none, has `_` in their place.
fn topic_of(topic: &str, output: &str) -> String {
    topic.replace("{output}", &output.replace(['/', '+', '#', '\0'], "_"))
}

#[cfg(test)]
mod tests {
    use athermal_core::time::{Duration, Instant};

    use super::*;

    fn messages(topic: &str, outputs: &[(&str, f64)]) -> Vec<(String, Value)> {
        let wired = outputs.iter().map(|(name, _)| WiredOutput {
            name: (*name).to_owned(),
            unit: Some("nm".to_owned()),
        });
        let values: Vec<_> = outputs.iter().map(|(_, value)| *value).collect();
        let mut all = Vec::new();
        let form = Form::new(topic, wired.collect());
        let row = OutRow {
            at: Instant::from_ns(1_500_000_000),
            is_beat: false,
            behind: Duration::from_ns(250_000_000),
            revision: 0xab,
            is_degraded: false,
            outputs: &values,
        };
        form.messages(&row, &mut all);
        let read = |of: Outgoing| (of.topic, serde_json::from_slice(&of.payload).unwrap());
        all.into_iter().map(read).collect()
    }

    #[test]
    fn each_output_has_a_topic_with_its_value_unit_time_and_revision() {
        let all = messages("dt/{output}", &[("c.X", 1.5), ("c/Y", -2.0)]);
        let expected = json!({
            "output": "c.X", "value": 1.5, "unit": "nm", "time": "1970-01-01T00:00:01.5Z",
            "time_ns": 1_500_000_000_i64, "behind_s": 0.25, "revision": "00000000000000ab",
        });
        assert_eq!(all[0], ("dt/c.X".to_owned(), expected));
        assert_eq!(all[1].0, "dt/c_Y");
    }

    #[test]
    fn a_tick_is_one_message_where_the_topic_names_no_output() {
        let all = messages("dt/tick", &[("a", 1.0), ("b", f64::NAN)]);
        assert_eq!(all.len(), 1);
        assert_eq!(all[0].1["values"], json!({ "a": 1.0 }));
        assert_eq!(all[0].1["units"], json!({ "a": "nm" }));
    }

    #[test]
    fn the_form_of_a_message_does_not_depend_on_how_many_outputs_there_are() {
        for outputs in [&[("a", 1.0)][..], &[("a", 1.0), ("b", 2.0)]] {
            let whole = messages("dt/tick", outputs);
            assert_eq!(whole.len(), 1);
            assert_eq!(whole[0].1["values"]["a"], json!(1.0));
            let each = messages("dt/{output}", outputs);
            assert_eq!(each.len(), outputs.len());
            assert_eq!(each[0].1["value"], json!(1.0));
        }
    }

    #[test]
    fn an_output_that_is_absent_is_in_no_message_and_null_in_none() {
        let outputs = [
            ("a", 1.0),
            ("b", f64::NAN),
            ("c", f64::INFINITY),
            ("d", 2.0),
        ];
        let each = messages("dt/{output}", &outputs);
        let topics: Vec<_> = each.iter().map(|(topic, _)| topic.as_str()).collect();
        assert_eq!(topics, ["dt/a", "dt/d"]);
        assert_eq!(each[1].1["value"], json!(2.0));
        let whole = messages("dt/tick", &outputs);
        assert_eq!(whole[0].1["values"], json!({ "a": 1.0, "d": 2.0 }));
        assert_eq!(messages("dt/tick", &outputs[1..3]), []);
    }
}
