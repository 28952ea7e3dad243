//! What was left out, by reason.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Serialize, Serializer};
use serde_json::{Map, json};

use super::{Known, Labels, Metrics};
use crate::connector::{LeftOut, LeftOutCounts};

/// How many samples were left out, by reason: by all that there are, or by those of which there are some.
#[derive(Debug)]
pub struct Reasons<const ALL: bool>(Vec<(LeftOut, u64)>);

impl Reasons<true> {
    pub(super) fn of(all: &[(LeftOut, u64)]) -> Self {
        Self(all.to_vec())
    }
}

impl Reasons<false> {
    /// What a source left out of which it knows no channel.
    pub(super) fn of_none(counts: &LeftOutCounts) -> Self {
        let all = LeftOut::ALL.map(|reason| (reason, counts.of(None, reason)));
        Self(all.into_iter().filter(|(_, count)| *count > 0).collect())
    }
}

impl<const ALL: bool> Serialize for Reasons<ALL> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(reason, count)| (reason.name(), count)))
    }
}

impl<const ALL: bool> JsonSchema for Reasons<ALL> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Reasons".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let names = LeftOut::ALL.map(LeftOut::name);
        let properties = names.map(|name| (name.to_owned(), json!({ "type": "integer" })));
        let properties: Map<_, _> = properties.into_iter().collect();
        let required = if ALL { &names[..] } else { &[] };
        json_schema!({ "type": "object", "properties": properties, "required": required })
    }
}

impl<const ALL: bool> Known for Reasons<ALL> {
    fn measure(&self, labels: &Labels, metrics: &mut Metrics) {
        let help = "Samples that were left out, by reason; without a channel where none is known. What is out_of_range was accepted, and is absent.";
        for (reason, count) in &self.0 {
            let mut labels = labels.clone();
            labels.push(("reason", reason.name().to_owned()));
            let name = ("athermal_dropped_samples_total", "counter");
            metrics.put(name, help, &labels, Some(*count as f64));
        }
    }
}
