//! What a fleet reports of a machine's data: the remarks of the jobs, each with what programs ask of it.

use std::fmt;

use athermal_core::message::Message;
use athermal_files::Report;
use athermal_jobs::remarks::without_zone;
use serde::{Deserialize, Serialize};

/// What may be wrong with the data of a machine, or was left out of them.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Doubt {
    /// What: the name of the remark, such as `stuck`, or the reason of a row that was left out, such as `time_again`; `remark` of any other.
    pub fault: String,
    /// The channel; null of what is one of rows.
    #[serde(default)]
    pub channel: Option<String>,
    /// How many cells, rows or samples; null where they are not counted.
    #[serde(default)]
    pub count: Option<u64>,
    /// The remark.
    #[serde(default)]
    pub text: String,
}

impl Doubt {
    /// Remarks of a job, and that times have no zone where they have none.
    #[must_use]
    pub fn all(remarks: &[Message], files: &[(String, Report)]) -> Vec<Self> {
        let zone = without_zone(files).map(|text| Self {
            fault: "no_zone".to_owned(),
            text,
            ..Self::default()
        });
        remarks.iter().map(Self::from).chain(zone).collect()
    }
}

impl From<&Message> for Doubt {
    fn from(message: &Message) -> Self {
        let facts = message.facts();
        let text = |key: &str| facts[key].as_str().map(str::to_owned);
        let name = match message.name() {
            "" => "remark",
            name => name,
        };
        Self {
            fault: text("reason").unwrap_or_else(|| name.to_owned()),
            channel: text("channel"),
            count: facts["count"].as_u64().or(facts["samples"].as_u64()),
            text: message.to_string(),
        }
    }
}

/// The remark without what stands behind its first colon, but for that of a name.
impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = self.text.split("; the first").next().unwrap_or_default();
        let mut parts = text.splitn(3, ": ");
        let first = parts.next().unwrap_or_default();
        f.write_str(first)?;
        match parts.next().filter(|_| !first.contains(' ')) {
            Some(second) => write!(f, ": {second}"),
            None => Ok(()),
        }
    }
}
