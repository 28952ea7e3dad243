//! Decides what a fleet reports of a machine's data: what may be wrong with a channel, and what was left out while they were read.

use std::fmt;

use athermal_analysis::diagnosis::watch::ChannelFaults;
use athermal_analysis::figures::count;
use athermal_files::Report;
use serde::{Deserialize, Serialize};

/// What may be wrong with the data of a machine.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Doubt {
    /// The channel; null of what is one of rows.
    #[serde(default)]
    pub channel: Option<String>,
    /// What: of a channel `leaps`, `stuck`, `silent` or `rejected_samples`, of rows a word of [`of_reading`].
    pub fault: String,
    /// How many cells or rows; null where they are not counted.
    #[serde(default)]
    pub count: Option<u64>,
    /// The first of them, in words.
    #[serde(default)]
    pub first: Option<String>,
}

impl Doubt {
    /// One of so many rows.
    #[must_use]
    pub fn counted(fault: &str, count: u64, first: Option<String>) -> Self {
        Self {
            channel: None,
            fault: fault.to_owned(),
            count: Some(count),
            first,
        }
    }
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let channel = self.channel.as_deref().unwrap_or_default();
        let n = self.count.map_or_else(String::new, count);
        match &*self.fault {
            "rejected_samples" => write!(f, "{channel} has samples out of range"),
            "stuck" => write!(f, "{channel} stands still"),
            "silent" => write!(f, "{channel} is silent"),
            "leaps" => write!(f, "{channel} leaps"),
            "unreadable_cells" => write!(f, "{n} × unreadable cell, taken as missing"),
            "unreadable_rows" => write!(f, "{n} × unreadable row, left out"),
            "time_out_of_order" => write!(f, "{n} × row whose time is out of order, left out"),
            "time_again" => write!(
                f,
                "{n} × row whose time is that of the row before, left out"
            ),
            "short_rows" => write!(f, "{n} × row without its last cells"),
            "cut_off" => f.write_str("the last line has no end and was left out"),
            "overlap" => write!(f, "{n} × row in the period of another file"),
            "no_zone" => f.write_str("dates and times without a zone, taken for UTC"),
            "blocks_without_rows" => write!(f, "{n} × block kept whose rows are gone"),
            other => f.write_str(other),
        }
    }
}

/// What was left out or taken as missing while files were read, and times that are no instants: `unreadable_cells`, `unreadable_rows`,
/// `time_out_of_order`, `time_again`, `short_rows`, `cut_off`, `overlap` and `no_zone`.
#[must_use]
pub fn of_reading(reports: &[(String, Report)]) -> Vec<Doubt> {
    let mut all: Vec<Doubt> = Vec::new();
    let mut add = |fault: &str, more: u64, first: Option<String>| match all
        .iter_mut()
        .find(|of| of.fault == fault)
    {
        _ if more == 0 => {}
        Some(known) => known.count = known.count.map(|known| known + more),
        None => all.push(Doubt::counted(fault, more, first)),
    };
    for (file, report) in reports {
        // Where nearly all rows are such, that is how the log is.
        let is_usual = report.short_rows.count > 20
            && report.rows.saturating_sub(report.short_rows.count) <= 3;
        for (fault, found) in [
            ("unreadable_cells", &report.bad_cells),
            ("unreadable_rows", &report.refused_rows),
            ("time_out_of_order", &report.refused_time),
            ("time_again", &report.repeated_time),
            ("short_rows", &report.short_rows),
        ] {
            if fault != "short_rows" || !is_usual {
                let first = found.first.as_ref();
                add(fault, found.count, first.map(ToString::to_string));
            }
        }
        for (fault, place) in [
            ("cut_off", &report.truncated),
            ("no_zone", &report.without_zone),
        ] {
            if let Some(place) = place {
                add(fault, 1, Some(place.to_string()));
            }
        }
        for (other, rows) in &report.overlaps {
            add(
                "overlap",
                *rows,
                Some(format!("{file} in the period of {other}")),
            );
        }
    }
    all
}

/// What channels look like, and how many rows were refused for their time.
pub(crate) fn of_channels(
    faults: &[ChannelFaults],
    rejected: &[(String, u64)],
    refused: u64,
) -> Vec<Doubt> {
    let of = |channel: &String, fault: &str, count: Option<u64>| Doubt {
        channel: Some(channel.clone()),
        fault: fault.to_owned(),
        count,
        first: None,
    };
    let mut all = Vec::new();
    for found in faults {
        let kinds = [
            ("leaps", found.leaps.is_some()),
            ("stuck", found.stuck.is_some()),
            ("silent", found.silent.is_some()),
        ];
        let there = kinds.iter().filter(|(_, is_there)| *is_there);
        all.extend(there.map(|(fault, _)| of(&found.channel, fault, None)));
    }
    let rejected = rejected.iter();
    all.extend(rejected.map(|(channel, count)| of(channel, "rejected_samples", Some(*count))));
    if refused > 0 {
        all.push(Doubt::counted("time_out_of_order", refused, None));
    }
    all
}
