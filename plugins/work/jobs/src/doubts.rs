//! What is doubtful in recorded data: the same warnings for people and the same keys for programs, whichever command reads them.

use athermal_core::compile::Plan;
use athermal_core::watch::Watch;
use athermal_files::{Dataset, Report};
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::beyond::{self, Beyond};
use crate::faults::{self, ChannelFaults};
use crate::remarks;
use athermal_core::message::Message;

/// What is doubtful in a recording on which a model was run.
pub struct Doubts<'a> {
    /// The plan of the model.
    pub plan: &'a Plan,
    /// The recording, read.
    pub dataset: &'a Dataset,
    /// Rows refused for their time.
    pub refused: u64,
    /// Samples that were infinite or out of range, by channel.
    pub rejected: &'a [(String, u64)],
    /// Channels that leap, stand still or fall silent.
    pub faults: Vec<ChannelFaults>,
    /// Channels whose samples lie where the fit saw none.
    pub outside_fit: Vec<Beyond<'a>>,
}

impl Doubts<'_> {
    /// Adds them to what a command prints as JSON.
    pub fn add_to(&self, facts: &mut Value) {
        for (key, found) in self::facts(&self.faults, &self.outside_fit, &self.dataset.reports()) {
            facts[key] = found;
        }
    }

    /// The warnings of them, but for dates without a zone.
    #[must_use]
    pub fn messages(&self) -> Vec<Message> {
        let (files, rejected) = (self.dataset.reports(), self.rejected);
        let mut all = remarks::doubts(self.plan, &files, self.refused, rejected);
        all.extend(beyond::messages(&self.outside_fit));
        all.extend(faults::messages(&self.faults));
        all
    }

    /// Warns of them.
    pub fn warn(&self, host: &dyn Watch) {
        remarks::warn_of(host, self.messages(), &self.dataset.reports());
    }
}

/// A key for each kind of doubt of which there are any.
#[must_use]
pub fn facts(
    faults: &[ChannelFaults],
    outside_fit: &[Beyond<'_>],
    files: &[(String, Report)],
) -> Map<String, Value> {
    let outside_fit: Vec<Value> = outside_fit.iter().map(|of| json!(of)).collect();
    let all = [
        ("leaps", each(faults, |of| of.leaps.as_ref())),
        ("stuck", each(faults, |of| of.stuck.as_ref())),
        ("silent", each(faults, |of| of.silent.as_ref())),
        ("outside_fit", outside_fit),
        ("overlaps", overlaps(files)),
    ];
    let found = all.into_iter().filter(|(_, found)| !found.is_empty());
    found
        .map(|(key, found)| (key.to_owned(), found.into()))
        .collect()
}

fn each<T: Serialize>(
    all: &[ChannelFaults],
    fault: impl Fn(&ChannelFaults) -> Option<&T>,
) -> Vec<Value> {
    let of = |faulty: &ChannelFaults| Some(faulty.facts(fault(faulty)?));
    all.iter().filter_map(of).collect()
}

/// The files whose periods overlap.
fn overlaps(reports: &[(String, Report)]) -> Vec<Value> {
    let each = |(file, report): &(String, Report)| {
        let of =
            |(other, rows): &(String, u64)| json!({ "file": file, "with": other, "rows": rows });
        report.overlaps.iter().map(of).collect::<Vec<_>>()
    };
    reports.iter().flat_map(each).collect()
}
