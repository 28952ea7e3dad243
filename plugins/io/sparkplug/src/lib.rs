//! Sparkplug B: what edge nodes publish at an MQTT broker as a source of a service, which is a host of theirs; and its outputs as the
//! metrics of an edge node.
//!
//! | module | decides |
//! |---|---|
//! | `host` | what births, data and deaths say, and when an edge node is asked for a rebirth; no broker, no clock |
//! | `source` | all of it at work, on a session of `athermal-mqtt` |
//! | `edge` | what births, data and deaths of an edge node are; no broker, no clock |
//! | `sink` | all of it at work, likewise |

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod edge;
mod host;
mod sink;
mod source;

use std::time::Duration as Wait;

use athermal_mqtt::client::Ended;
use athermal_serve::connector::ParameterRemark;

/// How long is waited for the broker at the end.
const LEAVE: Wait = Wait::from_millis(200);

/// Why a connection has ended.
fn words(ended: Ended) -> String {
    match ended {
        Ended::TakenOver => "another client has taken over its session".to_owned(),
        Ended::Version(words) | Ended::Closed(words) | Ended::Other(words) => words,
    }
}

/// What is wrong with levels of topics.
fn level_remarks(levels: &[(&str, Option<&String>)]) -> Vec<ParameterRemark> {
    let wrong = |(_, text): &&(&str, Option<&String>)| {
        text.is_some_and(|of| of.is_empty() || of.contains(['/', '+', '#']))
    };
    let remark = |(key, _): &(&str, Option<&String>)| ParameterRemark {
        at: vec![(*key).to_owned()],
        is_mistake: true,
        words: "it is a level of a topic, and has none of `/`, `+` and `#`".to_owned(),
        help: "write it as it stands in topics".to_owned(),
    };
    levels.iter().filter(wrong).map(remark).collect()
}
