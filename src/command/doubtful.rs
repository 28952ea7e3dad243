//! Decides under which keys programs are told what is doubtful in data: the same for every command that reads them. What is doubtful,
//! and in what words people are told, is decided elsewhere.

use athermal::files::Report;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::beyond::Beyond;
use super::faults::Faulty;

/// What is doubtful in a recording.
pub struct Doubtful<'a> {
    /// Channels that leap, stand still or fall silent.
    pub faults: &'a [Faulty],
    /// Channels whose samples lie where the fit saw none.
    pub outside_fit: &'a [Beyond<'a>],
    /// What was read of each file.
    pub reports: &'a [(String, Report)],
}

impl Doubtful<'_> {
    /// Adds what there is to an object.
    pub fn tell(&self, told: &mut Value) {
        for (key, found) in self.facts() {
            told[key] = found;
        }
    }

    /// A key for each kind of doubt of which there are any.
    #[must_use]
    pub fn facts(&self) -> Map<String, Value> {
        let mut facts = Map::new();
        for (key, found) in [
            ("leaps", each(self.faults, |of| of.leaps.as_ref())),
            ("stuck", each(self.faults, |of| of.stuck.as_ref())),
            ("silent", each(self.faults, |of| of.silent.as_ref())),
            (
                "outside_fit",
                self.outside_fit.iter().map(|of| json!(of)).collect(),
            ),
            ("overlaps", overlaps(self.reports)),
        ] {
            if !found.is_empty() {
                facts.insert(key.to_owned(), found.into());
            }
        }
        facts
    }
}

fn each<T: Serialize>(all: &[Faulty], fault: impl Fn(&Faulty) -> Option<&T>) -> Vec<Value> {
    let of = |faulty: &Faulty| Some(faulty.facts(fault(faulty)?));
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
